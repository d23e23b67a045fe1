/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/live/frames/unchanged.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/live/frames/frames_internal.h"
#include "pipeline/live/live.h"

#define SETTLE 2 /* pictures after a change that count as changed, too: what is left of it would never be shown else   \
                  */

struct still_camera {
    struct change_detector detector; /* empty until its first picture */
    bool known;
    int unsettled;
};

struct sst_unchanged {
    int cameras, width, height;
    struct decoder *decoder;
    uint8_t *changed; /* [tiles] */
    uint8_t *all;     /* [tiles] ones */
    struct still_camera *camera;
};

int sst_unchanged_create(struct sst_unchanged **out, int cameras, uint32_t fourcc, int width, int height)
{
    const size_t tiles =
        (size_t)((width + SST_LIVE_TILE - 1) / SST_LIVE_TILE) * (size_t)((height + SST_LIVE_TILE - 1) / SST_LIVE_TILE);
    struct sst_unchanged *s = calloc(1, sizeof(*s));
    int err = s ? 0 : -ENOMEM;

    if (!err) {
        s->cameras = cameras;
        s->width = width;
        s->height = height;
        s->camera = calloc((size_t)cameras, sizeof(*s->camera));
        s->changed = sst_mem_alloc(tiles, 1);
        s->all = sst_mem_alloc(tiles, 1);
        err = s->camera && s->changed && s->all ? decoder_create(&s->decoder, fourcc, width, height) : -ENOMEM;
    }
    if (err) {
        sst_unchanged_destroy(s);
        return err;
    }
    memset(s->all, 1, tiles);
    *out = s;
    return 0;
}

void sst_unchanged_destroy(struct sst_unchanged *s)
{
    if (!s)
        return;
    for (int i = 0; s->camera && i < s->cameras; i++)
        if (s->camera[i].detector.cols)
            detector_fini(&s->camera[i].detector);
    decoder_destroy(s->decoder);
    free(s->camera);
    sst_mem_free(s->changed);
    sst_mem_free(s->all);
    free(s);
}

bool sst_unchanged_same(struct sst_unchanged *s, int cam, const uint8_t *data, size_t bytes, size_t stride)
{
    struct still_camera *c = &s->camera[cam];
    struct verdict v;

    if ((!c->detector.cols && detector_init(&c->detector, s->width, s->height)) ||
        decoder_read_means(s->decoder, &(struct decoder_frame){ data, bytes, stride }, &c->detector.now, NULL)) {
        c->known = false;
        return false;
    }
    v = detector_judge(&c->detector, s->changed);
    if (c->known && !v.changed && !c->unsettled)
        return true;
    c->unsettled = !c->known || v.changed ? SETTLE : c->unsettled - 1;
    c->known = true;
    detector_accept(&c->detector, s->all);
    return false;
}
