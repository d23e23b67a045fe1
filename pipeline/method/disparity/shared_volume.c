/* One cost volume that several threads fill and search: where each with one of its own would need too much memory, or
 * there are more threads than views. All steps work on bands of rows or of columns, with the bytes of one thread. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/method/disparity/stage.h"

#define BANDS_EACH  2  /* bands of rows and of columns that a thread computes, so that the last one waits less */
#define BAND_LEAST  32 /* rows of a band: more than support regions reach into the bands beside it */
#define COLUMNS     64 /* columns of a band: a multiple of this */
#define FILTER_BAND 48 /* rows that are filtered at once */

_Static_assert(BAND_LEAST >= SST_SUPPORT_MAX_ARM, "support regions reach into the bands beside");

/* What all jobs of a view need. */
struct shared {
    const struct sst_volume_search *in;
    const struct sst_volume *whole;
    struct sst_volume *part; /* [in->threads] */
    struct sst_disparity_sgm_penalties penalties;
    uint8_t *edges; /* [bands - 1][2 SST_SUPPORT_MAX_ARM] rows of costs around the borders of bands */
    int bands;
    struct sst_map_u16 *raw; /* of the filters */
    struct sst_mem_kept *rows;
};

static int band_row(const struct shared *s, int band)
{
    return (int)((int64_t)s->whole->height * band / s->bands);
}

static size_t row_cells(const struct shared *s)
{
    return s->whole->width_padded * s->whole->steps_padded;
}

/* A worker's volume as a band of rows. */
static struct sst_volume *take_band(const struct shared *s, int band, int worker)
{
    struct sst_volume *v = &s->part[worker];

    v->y0 = band_row(s, band);
    v->height = band_row(s, band + 1) - v->y0;
    v->cost = s->whole->cost + (size_t)v->y0 * row_cells(s);
    v->sum = s->whole->sum + (size_t)v->y0 * row_cells(s);
    return v;
}

static int cancelled(const struct shared *s)
{
    return s->in->cfg->cancel && *s->in->cfg->cancel ? -ECANCELED : 0;
}

static int fill_job(void *arg, int band, int worker)
{
    const struct shared *s = arg;

    sst_volume_fill(take_band(s, band, worker), s->in->ref, s->in->neighbours, s->in->count);
    return cancelled(s);
}

static int aggregate_job(void *arg, int band, int worker)
{
    const struct shared *s = arg;
    const size_t rows = SST_SUPPORT_MAX_ARM * row_cells(s);
    const uint8_t *above = band ? s->edges + 2 * (size_t)(band - 1) * rows : NULL;
    const uint8_t *below = band + 1 < s->bands ? s->edges + (2 * (size_t)band + 1) * rows : NULL;
    const int err = cancelled(s);

    return err ? err : sst_disparity_support_band(take_band(s, band, worker), s->in->support, above, below);
}

static int aggregate(struct shared *s)
{
    const size_t rows = SST_SUPPORT_MAX_ARM * row_cells(s);
    int err = 0;

    for (int round = 0; !err && round < s->in->rounds; round++) {
        for (int band = 0; band + 1 < s->bands; band++) {
            const uint8_t *border = s->whole->cost + (size_t)band_row(s, band + 1) * row_cells(s);

            memcpy(s->edges + 2 * (size_t)band * rows, border - rows, 2 * rows);
        }
        err = sst_parallel_for(s->bands, s->in->threads, aggregate_job, s);
    }
    return err;
}

static int along_job(void *arg, int band, int worker)
{
    const struct shared *s = arg;
    struct sst_volume *v = take_band(s, band, worker);
    const int err = cancelled(s);

    return err ? err : sst_disparity_sgm_along(v, &s->in->ref->image, v->y0, &s->penalties);
}

static int columns_of(const struct shared *s)
{
    const int each = (s->whole->width + s->bands - 1) / s->bands;

    return (each + COLUMNS - 1) / COLUMNS * COLUMNS;
}

static int down_job(void *arg, int band, int worker)
{
    const struct shared *s = arg;
    const int x0 = band * columns_of(s), x1 = sst_min_int(x0 + columns_of(s), s->whole->width), err = cancelled(s);

    return err || x1 <= x0
               ? err
               : sst_disparity_sgm_down(s->whole, &s->in->ref->image, (struct sst_rect){ x0, 0, x1, s->whole->height },
                                        &s->penalties, &s->part[worker].lines);
}

static int winner_job(void *arg, int band, int worker)
{
    const struct shared *s = arg;
    struct sst_volume *v = take_band(s, band, worker);
    struct sst_map_u16 disp = sst_map_u16_rows(s->in->disp, v->y0, v->height);
    struct sst_map_u8 confidence = sst_map_u8_rows(s->in->confidence, v->y0, v->height);

    return sst_volume_winner(v, false, &disp, &confidence);
}

static int filter_job(void *arg, int band, int worker)
{
    const struct shared *s = arg;
    const struct sst_rows rows = { band * FILTER_BAND, sst_min_int((band + 1) * FILTER_BAND, s->raw->height) };
    const struct sst_smoothing in = { s->raw, &s->in->ref->luma, true, s->in->cfg->bilateral_tau };

    return sst_disparity_smooth_rows(s->in->disp, &in, rows, &s->rows[worker], &s->part[worker].lines);
}

static int filter(struct shared *s)
{
    struct sst_map_u16 *disp = s->in->disp, raw = { 0 };
    const int threads = s->in->threads, bands = (disp->height + FILTER_BAND - 1) / FILTER_BAND;
    int err = sst_map_u16_init(&raw, disp->width, disp->height);

    s->raw = &raw;
    s->rows = sst_mem_alloc((size_t)threads, sizeof(*s->rows));
    if (!err && !s->rows)
        err = -ENOMEM;
    if (!err) {
        memcpy(raw.data, disp->data, raw.stride * (size_t)raw.height);
        err = sst_parallel_for(bands, threads, filter_job, s);
    }
    for (int i = 0; s->rows && i < threads; i++)
        sst_mem_kept_fini(&s->rows[i]);
    sst_mem_free(s->rows);
    sst_map_u16_fini(&raw);
    return err;
}

int sst_volume_search(struct sst_volume *v, struct sst_volume *part, const struct sst_volume_search *in)
{
    struct shared s = { .in = in, .whole = v, .part = part };
    int err;

    s.bands = sst_clamp_int(BANDS_EACH * in->threads, 1, sst_max_int(v->height / BAND_LEAST, 1));
    s.edges = sst_mem_alloc_raw((size_t)s.bands, 2 * SST_SUPPORT_MAX_ARM * row_cells(&s));
    if (!s.edges)
        return -ENOMEM;
    sst_disparity_sgm_penalties_init(&s.penalties, in->cfg);
    err = sst_parallel_for(s.bands, in->threads, fill_job, &s);
    err = err ? err : aggregate(&s);
    err = err ? err : sst_parallel_for(s.bands, in->threads, along_job, &s);
    err = err ? err : sst_parallel_for(s.bands, in->threads, down_job, &s);
    err = err ? err : sst_parallel_for(s.bands, in->threads, winner_job, &s);
    sst_mem_free(s.edges);
    return err ? err : filter(&s);
}
