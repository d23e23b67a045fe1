/* Summary of the scene for pictures and reports: when each tile changed, and which disparities and labels occur. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/live/live_internal.h"

#define COUNT_COLS   320   /* about this number of pixels of a row is counted */
#define OUTSIDE      0.005 /* fraction of the pixels beyond each end of the range for sliders */
#define RANGE_SLACK  0.05  /* the range moves when an end is off by more than this fraction of it ... */
#define RANGE_MIN_PX 1.0   /* ... and this; it shrinks only after ... */
#define RANGE_S      60.0

/* --- times of changes --------------------------------------------------------------------------------------------- */

static bool stamp_view(uint64_t *stamp, const uint8_t *map, int tiles, bool whole, uint64_t serial)
{
    bool any = false;

    for (int i = 0; i < tiles; i++) {
        if (whole || map[i]) {
            stamp[i] = serial;
            any = true;
        }
    }
    return any;
}

/* A present view without disparities yet: unknown everywhere. */
static int give_unknown(struct sst_lightfield *lf, struct sst_view *v)
{
    int err;

    if (v->disp.data || !v->image.plane[0])
        return 0;
    err = sst_map_u16_init(&v->disp, lf->width, lf->height);
    for (int y = 0; !err && y < lf->height; y++)
        memset(sst_map_u16_row(&v->disp, y), 0xFF, (size_t)lf->width * sizeof(uint16_t)); /* SST_DISP_NONE */
    return err;
}

int live_ingest(struct sst_live *live, const struct sst_liveframes_changes *changes)
{
    struct sst_lightfield *lf = &live->lf;
    const uint64_t serial = live->serial + 1;
    bool any = false, moved = false;
    int err = 0;

    for (int k = 0; k < lf->rows * lf->cols && !err; k++) {
        struct sst_view *v = &lf->views[k];
        const bool present = v->present && v->image.plane[0];

        if (present && live->ready)
            err = give_unknown(lf, v);
        moved |= present != live->present[k];
        live->present[k] = present;
        if (changes && live->stamp[k] && (changes->whole || changes->map[k]))
            any |= stamp_view(live->stamp[k], changes->map[k], changes->cols * changes->rows, changes->whole, serial);
    }
    if (err) {
        sst_log_error("no memory for the disparities of a view");
        return err;
    }
    if (moved)
        live->present_serial = serial;
    if (any || moved)
        live->serial = serial;
    return 0;
}

/* --- disparities and labels in the scene -------------------------------------------------------------------------- */

/* Counts of the labels that occur. */
struct counts {
    const uint64_t *of[256];
    int labels;
};

static uint64_t count_bin(const struct counts *c, int bin)
{
    uint64_t n = 0;

    for (int i = 0; i < c->labels; i++)
        n += c->of[i][bin];
    return n;
}

/* Disparities with a fraction OUTSIDE of the pixels beyond each end. @return false: no disparities */
static bool find_range(const struct sst_live *live, double *min_px, double *max_px)
{
    const struct sst_label_histogram *h = &live->renderer->histogram;
    struct counts c = { .labels = 0 };
    uint64_t total = 0, below = 0, above = 0;
    int lo = h->first_bin, hi = h->bins - 1;

    for (int label = 0; label < 256; label++) {
        if (h->count[label])
            c.of[c.labels++] = h->count[label];
    }
    for (int i = 0; i < h->bins; i++)
        total += count_bin(&c, i);
    if (!total)
        return false;
    while ((double)(below += count_bin(&c, lo)) <= OUTSIDE * (double)total)
        lo++;
    while ((double)(above += count_bin(&c, hi)) <= OUTSIDE * (double)total)
        hi--;
    *min_px = sst_disp_px(&live->lf, (uint16_t)lo);
    *max_px = sst_disp_px(&live->lf, (uint16_t)hi);
    return true;
}

/* The range grows at once and shrinks late: it sets the depth of field, which must not change with every passer-by. */
static void follow_range(struct sst_live *live, int64_t t_ns)
{
    double min_px, max_px, slack;

    if (!find_range(live, &min_px, &max_px))
        return;
    if (isnan(live->min_px) || (double)(t_ns - live->range_ns) * 1e-9 > RANGE_S) {
        live->min_px = min_px;
        live->max_px = max_px;
    }
    slack = fmax(RANGE_MIN_PX, RANGE_SLACK * (live->max_px - live->min_px));
    if (min_px < live->min_px - slack)
        live->min_px = min_px;
    if (max_px > live->max_px + slack)
        live->max_px = max_px;
    if (min_px < live->min_px + slack && max_px > live->max_px - slack)
        live->range_ns = t_ns;
}

/* Counts of disparities, and votes for the focus: neither needs the other. */
static int count_job(void *arg, int votes, int worker SST_UNUSED)
{
    struct sst_live *live = arg;

    if (votes)
        return live->sampled ? sst_render_focus_vote(&live->focus, &live->lf, live->sample, live->sampled) : 0;
    return sst_renderer_recount(live->renderer, live->sample, live->sampled,
                                sst_max_int(live->lf.width / COUNT_COLS, 1));
}

int live_summarize(struct sst_live *live, int64_t t_ns)
{
    int err = 0;

    if (!live->ready)
        return 0;
    if (live->counted != live->serial && !live->late) {
        live->sampled = sst_render_sample_views(&live->lf, live->sample);
        err = sst_parallel_for(2, live->cfg.threads, count_job, live);
        if (err)
            return err;
        follow_range(live, t_ns);
        err = live_cut_follow(live, t_ns);
        if (err)
            return err;
        if (live->sampled)
            live_zones_count(live, &live->lf.views[live->sample[0]]);
        live->counted = live->serial;
    }
    sst_render_focus_step(&live->focus, t_ns);
    return 0;
}

const struct sst_lightfield *sst_live_lightfield(const struct sst_live *live)
{
    return &live->lf;
}

double sst_live_default_focus(const struct sst_live *live)
{
    return live->posed ? sst_liveposed_focus(live->posed) : live->focus.focus_px;
}


bool sst_live_device(const struct sst_live *live, struct sst_render_device_report *out)
{
    return live->renderer && sst_renderer_device(live->renderer, out);
}

bool sst_live_label_device(const struct sst_live *live, struct sst_network_device_report *out)
{
    return live->scene && sst_livescene_device(live->scene, out);
}

const char *const sst_live_device_steps[] = { "labels", "render", NULL };
const char *const sst_live_cpu_steps[] = { "change", "decode", "rectify",    "disparity",
                                           "refine", "encode", "background", NULL };

bool sst_live_range(const struct sst_live *live, double *min_px, double *max_px)
{
    if (live->posed)
        return sst_liveposed_range(live->posed, min_px, max_px);
    if (isnan(live->min_px))
        return false;
    *min_px = live->min_px;
    *max_px = live->max_px;
    return true;
}
