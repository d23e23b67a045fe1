/* tests/synthetic_sets.h - sets whose bytes follow from their index, so that a reader can tell what was written. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_SYNTHETIC_SETS_H
#define SST_TESTS_SYNTHETIC_SETS_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "capture/recording/recorder.h"

#define SYNTHETIC_START_NS 5000000000000 /* of set 0 */
#define SYNTHETIC_WALL_NS  1700000000000000000

/* Stands for an array: its frames' memory is made once. */
struct synthetic {
    int cameras;
    uint32_t fourcc;
    int width, height;
    size_t bytes; /* largest frame */
    int64_t period_ns;
    bool holes;    /* every camera misses one set in 17 */
    bool exact;    /* all frames have `bytes` */
    uint8_t *data; /* [cameras][bytes] */
    struct sst_frame *frame;
    struct sst_recorder_track track[SST_CAMERAS_MAX];
};

static inline uint64_t synthetic_hash(uint64_t x)
{
    x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9u;
    x = (x ^ x >> 27) * 0x94D049BB133111EBu;
    return x ^ x >> 31;
}

static inline bool synthetic_missing(const struct synthetic *s, uint64_t index, int cam)
{
    return s->holes && synthetic_hash(index * 1000 + (uint64_t)cam) % 17 == 0;
}

static inline size_t synthetic_bytes(const struct synthetic *s, uint64_t index, int cam)
{
    return s->exact ? s->bytes : 1 + synthetic_hash(index * 7777 + (uint64_t)cam) % s->bytes;
}

static inline void synthetic_fill(uint8_t *data, size_t n, uint64_t index, int cam)
{
    uint64_t x = synthetic_hash(index * 256 + (uint64_t)cam + 1);

    for (size_t i = 0; i < n; i += 8) {
        x = x * 6364136223846793005u + 1442695040888963407u;
        memcpy(data + i, &x, n - i < 8 ? n - i : 8);
    }
}

/* Start of exposure less the set's time: -2000 .. 1999 ns. */
static inline int64_t synthetic_dt_ns(uint64_t index, int cam)
{
    return (int64_t)(synthetic_hash(index * 31 + (uint64_t)cam) % 4000) - 2000;
}

static inline void synthetic_init(struct synthetic *s)
{
    s->data = (uint8_t *)malloc((size_t)s->cameras * s->bytes);
    s->frame = (struct sst_frame *)calloc((size_t)s->cameras, sizeof(*s->frame));
    for (int k = 0; k < s->cameras; k++) {
        s->track[k].row = k / 6;
        s->track[k].col = k % 6;
        snprintf(s->track[k].serial, sizeof(s->track[k].serial), "S%03d", k);
        snprintf(s->track[k].port, sizeof(s->track[k].port), "1-%d", k);
    }
}

static inline void synthetic_fini(struct synthetic *s)
{
    free(s->data);
    free(s->frame);
}

static inline struct sst_recorder_config synthetic_config(const struct synthetic *s, const char *dir)
{
    struct sst_recorder_config cfg;

    sst_recorder_config_defaults(&cfg);
    cfg.dir = dir;
    cfg.rows = (s->cameras + 5) / 6;
    cfg.cols = 6;
    cfg.cameras = s->cameras;
    cfg.tracks = s->track;
    cfg.fourcc = s->fourcc;
    cfg.width = s->width;
    cfg.height = s->height;
    cfg.rate_hz = 1e9 / (double)s->period_ns;
    cfg.spacing_mm = 40;
    return cfg;
}

/* Set `index` in the array's memory; good until the next one. */
static inline void synthetic_set(struct synthetic *s, uint64_t index, struct sst_frameset *set)
{
    *set = (struct sst_frameset){ .index = index,
                                  .t_ns = SYNTHETIC_START_NS + (int64_t)index * s->period_ns,
                                  .edge = true,
                                  .cameras = s->cameras,
                                  .skew = { 3999, -2000, 0 } };
    set->wall_ns = SYNTHETIC_WALL_NS + (int64_t)index * s->period_ns;
    for (int k = 0; k < s->cameras; k++) {
        struct sst_frame *f = &s->frame[k];

        if (synthetic_missing(s, index, k))
            continue;
        *f = (struct sst_frame){ .cam = k,
                                 .fourcc = s->fourcc,
                                 .width = s->width,
                                 .height = s->height,
                                 .data = s->data + (size_t)k * s->bytes,
                                 .bytes = synthetic_bytes(s, index, k),
                                 .sequence = (uint32_t)index + 7,
                                 .t_ns = set->t_ns + synthetic_dt_ns(index, k) };
        f->arrival_ns = f->t_ns + 30000000 + k;
        synthetic_fill(s->data + (size_t)k * s->bytes, f->bytes, index, k);
        set->frame[k] = f;
        set->present++;
    }
}

#endif
