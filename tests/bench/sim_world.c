/* How long a simulated world takes to prepare, to open again and to deliver frames:
 *   make build/bench/sim_world && build/bench/sim_world [WORLD [CACHE [FOLDER]]]
 * With FOLDER the first frames of some cameras are left there as files. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/file.h"
#include "simulators/scene/world/sim_world.h"

#define FRAMES 2000

static double ms_since(int64_t start_ns)
{
    return (double)(sst_clock_now_ns() - start_ns) / 1e6;
}

static int deliver(struct sst_sim_world *w, uint32_t fourcc, const char *what, int frames, int exposure_us,
                   uint8_t *out, size_t capacity)
{
    const int cams = sst_sim_world_cameras(w);
    const struct sst_sim_settings *s = sst_sim_world_settings(w);
    const int64_t start = sst_clock_now_ns();
    size_t bytes = 0, sum = 0;
    int err = 0;

    for (int i = 0; i < frames && !err; i++) {
        const struct sst_sim_exposure e = { .cam = i % cams,
                                            .trigger = (uint64_t)(i / cams),
                                            .t_ns = 1000000000 + i / cams * 33333333LL,
                                            .exposure_us = exposure_us,
                                            .gain = 1 };

        err = sst_sim_world_frame(w, &e, (struct sst_sim_format){ fourcc, s->width, s->height },
                                  (struct sst_sim_room){ out, capacity }, &bytes);
        sum += bytes;
    }
    printf("%-28s %8.1f us a frame, %zu bytes\n", what, ms_since(start) * 1000 / frames, sum / (size_t)frames);
    return err;
}

/* Each frame at a pose of its own: the costs of a rig. */
static int deliver_poses(struct sst_sim_world *w, int frames, uint8_t *out, size_t capacity)
{
    const struct sst_sim_settings *s = sst_sim_world_settings(w);
    const int64_t start = sst_clock_now_ns();
    size_t bytes;
    int err = 0;

    for (int i = 0; i < frames && !err; i++) {
        const struct sst_sim_exposure e = { .exposure_us = 5000, .gain = 1, .pose_um = { 1000 * (i + 1), 0, 0 } };

        err = sst_sim_world_frame(w, &e, (struct sst_sim_format){ V4L2_PIX_FMT_MJPEG, s->width, s->height },
                                  (struct sst_sim_room){ out, capacity }, &bytes);
    }
    printf("%-28s %8.1f ms a frame\n", "MJPEG, new pose", ms_since(start) / frames);
    return err;
}

static int leave_frames(struct sst_sim_world *w, const char *folder, uint8_t *out, size_t capacity)
{
    const int cams = sst_sim_world_cameras(w);
    const struct sst_sim_settings *s = sst_sim_world_settings(w);
    int err = sst_path_make_dir(folder);

    for (int i = 0; i < 4 * cams && !err; i++) {
        const struct sst_sim_exposure e = { .cam = i % cams,
                                            .trigger = (uint64_t)(i / cams),
                                            .t_ns = 1 + i / cams * 500000000LL,
                                            .exposure_us = 5000,
                                            .gain = 1 };
        char name[64], path[SST_PATH_MAX];
        size_t bytes;

        snprintf(name, sizeof(name), "cam%02d-%d.jpg", i % cams, i / cams);
        err = sst_path_join(path, folder, name);
        if (!err)
            err = sst_sim_world_frame(w, &e, (struct sst_sim_format){ V4L2_PIX_FMT_MJPEG, s->width, s->height },
                                      (struct sst_sim_room){ out, capacity }, &bytes);
        if (!err)
            err = sst_file_write(path, out, bytes);
    }
    return err;
}

int main(int argc, char **argv)
{
    const size_t capacity = (size_t)64 << 20;
    uint8_t *out = malloc(capacity);
    struct sst_sim_world *w;
    int64_t start = sst_clock_now_ns();
    const int64_t cpu = sst_clock_cpu_ns();
    const char *world = argc > 1 ? argv[1] : NULL, *cache = argc > 2 ? argv[2] : NULL;

    if (!out || sst_sim_world_open(&w, world, cache))
        return 1;
    printf("%-28s %8.2f s, %.2f s of CPU\n", "first opening", ms_since(start) / 1000,
           (double)(sst_clock_cpu_ns() - cpu) / 1e9);
    sst_sim_world_close(w);
    start = sst_clock_now_ns();
    if (sst_sim_world_open(&w, world, cache))
        return 1;
    printf("%-28s %8.1f ms\n", "opening again", ms_since(start));
    if (deliver(w, V4L2_PIX_FMT_MJPEG, "MJPEG", FRAMES, 5000, out, capacity) ||
        deliver(w, V4L2_PIX_FMT_MJPEG, "MJPEG", FRAMES, 5000, out, capacity) ||
        deliver(w, V4L2_PIX_FMT_MJPEG, "MJPEG, half exposure, first", 72, 2500, out, capacity) ||
        deliver(w, V4L2_PIX_FMT_MJPEG, "MJPEG, half exposure, again", 72, 2500, out, capacity) ||
        deliver(w, V4L2_PIX_FMT_YUYV, "YUYV, first", 72, 5000, out, capacity) ||
        deliver(w, V4L2_PIX_FMT_YUYV, "YUYV, again", 72, 5000, out, capacity) ||
        (sst_sim_world_cameras(w) == 1 && deliver_poses(w, 20, out, capacity)) ||
        (argc > 3 && leave_frames(w, argv[3], out, capacity)))
        return 1;
    sst_sim_world_close(w);
    free(out);
    return 0;
}
