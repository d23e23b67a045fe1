/* Which triggers the frames of a recording's sets are of, as the simulated cameras wrote into their pictures.
 *
 *   strips RECORDING [RECORDING ...]   several: of several hosts, joined
 * Prints one JSON object: sets, frames, unread (pictures without a strip) and mixed (sets with frames of several
 * triggers). Exit status 1: a set is mixed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "capture/recording/recording.h"
#include "pipeline/image/image.h"
#include "pipeline/image/raw.h"
#include "tests/strip_read.h"

static struct {
    int sets, frames, unread, mixed;
} n;

/* @return the trigger; -1: no strip can be read */
static int64_t trigger_of(const struct sst_recording_info *info, const struct sst_recording_frame *f,
                          const uint8_t *data)
{
    const struct sst_raw raw = { info->fourcc, info->width, info->height, f->stride, data, f->bytes };
    struct sst_sim_exposure e;
    struct sst_image img;
    int64_t trigger = -1;

    if (sst_raw_decode(&img, &raw))
        return -1;
    /* Black and white: each plane is the luma. */
    if (!strip_read(sst_image_row(&img, 1, 0), (size_t)(sst_image_row(&img, 1, 1) - sst_image_row(&img, 1, 0)),
                    info->width, info->height, &e))
        trigger = (int64_t)e.trigger;
    sst_image_fini(&img);
    return trigger;
}

static void look(const struct sst_recording *r, int i)
{
    static struct sst_recording_set set;
    const struct sst_recording_info *info = sst_recording_info(r);
    int64_t first = -1;
    bool mixed = false;

    if (sst_recording_set(r, i, &set))
        return;
    n.sets++;
    for (int cam = 0; cam < info->cameras; cam++) {
        uint8_t *data;
        int64_t trigger;

        if (!set.frame[cam].present || sst_recording_frame(r, &set, cam, &data))
            continue;
        n.frames++;
        trigger = trigger_of(info, &set.frame[cam], data);
        free(data);
        n.unread += trigger < 0;
        if (trigger < 0)
            continue;
        if (first < 0)
            first = trigger;
        if (trigger != first && !mixed)
            fprintf(stderr, "set %d: camera %d shows trigger %lld, another %lld\n", i, cam, (long long)trigger,
                    (long long)first);
        mixed |= trigger != first;
    }
    n.mixed += mixed;
}

int main(int argc, char **argv)
{
    struct sst_recording *r;
    const int err = argc < 2   ? -1
                    : argc > 2 ? sst_recording_open_joined(&r, (const char *const *)argv + 1, argc - 1)
                               : sst_recording_open(&r, argv[1]);

    if (err)
        return 2;
    for (int i = 0; i < sst_recording_sets(r); i++)
        look(r, i);
    sst_recording_close(r);
    printf("{\"sets\": %d, \"frames\": %d, \"unread\": %d, \"mixed\": %d}\n", n.sets, n.frames, n.unread, n.mixed);
    return n.mixed > 0;
}
