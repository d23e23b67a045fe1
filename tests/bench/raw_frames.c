/* The frames that the cameras of a simulated world deliver, as RR_CC.jpg, and its true calibration:
 *   raw_frames WORLD FOLDER
 * FOLDER exists; it gets frames/, which `sst import folder` reads, and calib.yaml. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <linux/videodev2.h>

#include "base/file.h"
#include "simulators/scene/world/sim_world.h"

#define FRAME_MAX ((size_t)16 << 20)

static int write_frame(struct sst_sim_world *w, const char *folder, int cam, uint8_t *frame)
{
    const struct sst_sim_settings *s = sst_sim_world_settings(w);
    const struct sst_sim_exposure e = {
        .cam = cam, .t_ns = 1000000000, .exposure_us = s->exposure_us, .gain = 1
    };
    char path[SST_PATH_MAX];
    size_t bytes;
    int err = sst_sim_world_frame(w, &e, (struct sst_sim_format){ V4L2_PIX_FMT_MJPEG, s->width, s->height },
                                  (struct sst_sim_room){ frame, FRAME_MAX }, &bytes);

    if (err)
        return err;
    snprintf(path, sizeof(path), "%s/frames/%02d_%02d.jpg", folder, cam / s->cols, cam % s->cols);
    return sst_file_write(path, frame, bytes);
}

int main(int argc, char **argv)
{
    uint8_t *frame = malloc(FRAME_MAX);
    struct sst_sim_world *w = NULL;
    char path[SST_PATH_MAX];
    int err = frame ? 0 : -ENOMEM;

    if (argc != 3) {
        fprintf(stderr, "usage: raw_frames WORLD FOLDER\n");
        free(frame);
        return 2;
    }
    snprintf(path, sizeof(path), "%s/frames", argv[2]);
    if (!err && mkdir(path, 0777) && errno != EEXIST)
        err = -errno;
    snprintf(path, sizeof(path), "%s/calib.yaml", argv[2]);
    err = err ? err : sst_sim_world_parameters(argv[1], path);
    err = err ? err : sst_sim_world_open(&w, argv[1], argv[2]);
    for (int cam = 0; w && cam < sst_sim_world_cameras(w) && !err; cam++)
        err = write_frame(w, argv[2], cam, frame);
    if (err)
        fprintf(stderr, "raw_frames: %s: %s\n", argv[1], strerror(-err));
    sst_sim_world_close(w);
    free(frame);
    return err ? 1 : 0;
}
