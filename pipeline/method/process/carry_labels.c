#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/method/process/process_internal.h"

#define SOURCES    4       /* nearest key views that labels come from */
#define DISP_SHIFT 8       /* what arrives at a pixel: disparity + 1 (0: nothing yet), label */
#define SIMILAR    24      /* levels: a label stays with a colour whose channels all differ by at most this */
#define REACH_MOST 32768.0 /* px; sources that are farther away are left out */

struct carry {
    struct sst_lightfield *lf;
    const bool *carried;
    struct sst_map_f32 *entropy;
};

/* Labels that arrive in one view. */
struct arrived {
    int width, height;
    uint32_t *at;   /* [height][width] */
    float *entropy; /* likewise; NULL: not wanted */
};

static int arrived_init(struct arrived *a, const struct sst_lightfield *lf, bool entropy)
{
    const size_t pixels = (size_t)lf->width * (size_t)lf->height;

    *a = (struct arrived){ .width = lf->width, .height = lf->height };
    a->at = sst_mem_alloc(pixels, sizeof(*a->at));
    a->entropy = entropy ? sst_mem_alloc_raw(pixels, sizeof(*a->entropy)) : NULL;
    return a->at && (!entropy || a->entropy) ? 0 : -ENOMEM;
}

static void arrived_fini(struct arrived *a)
{
    sst_mem_free(a->at);
    sst_mem_free(a->entropy);
}

/* The nearest key views other than the view itself. @return their number */
static int sources_of(const struct carry *c, int view, int source[SOURCES])
{
    const struct sst_lightfield *lf = c->lf;
    double distance[SOURCES];
    int n = 0;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const double far = hypot(lf->views[k].bx - lf->views[view].bx, lf->views[k].by - lf->views[view].by);
        int at;

        if (k == view || !lf->views[k].present || c->carried[k] || (n == SOURCES && far >= distance[n - 1]) ||
            far * (fabs(lf->disp_min_px) + SST_DISP_NONE / SST_DISP_SCALE) > REACH_MOST)
            continue;
        n += n < SOURCES;
        for (at = n - 1; at > 0 && distance[at - 1] > far; at--) {
            distance[at] = distance[at - 1];
            source[at] = source[at - 1];
        }
        distance[at] = far;
        source[at] = k;
    }
    return n;
}

/* A pixel with disparity d moves by (at + d step) / 2^16, rounded down. */
struct shift {
    int32_t at, step;
};

static struct shift shift_of(double b, double disp_min_px)
{
    return (struct shift){ (int32_t)floor((disp_min_px * b + 0.5) * 65536 + 0.5), (int32_t)floor(b * 1024 + 0.5) };
}

static bool similar(const struct sst_image *a, int xa, int ya, const struct sst_image *b, int xb, int yb)
{
    for (int c = 0; c < 3; c++) {
        if (abs(sst_image_row(a, c, ya)[xa] - sst_image_row(b, c, yb)[xb]) > SIMILAR)
            return false;
    }
    return true;
}

static void carry_row(struct arrived *a, const struct sst_view *own, const struct sst_view *from,
                      const struct sst_map_f32 *entropy, int y, struct shift across, struct shift down)
{
    const uint16_t *d = sst_map_u16_row(&from->disp, y);
    const uint8_t *label = sst_map_u8_row(&from->label, y);
    const float *e = entropy ? sst_map_f32_row(entropy, y) : NULL;

    for (int x = 0; x < a->width; x++) {
        const int xt = x + ((across.at + d[x] * across.step) >> 16), yt = y + ((down.at + d[x] * down.step) >> 16);
        const uint32_t value = ((uint32_t)d[x] + 1) << DISP_SHIFT | label[x];
        size_t at;

        if (d[x] == SST_DISP_NONE || (unsigned)xt >= (unsigned)a->width || (unsigned)yt >= (unsigned)a->height)
            continue;
        at = (size_t)yt * (size_t)a->width + (size_t)xt;
        if (value <= a->at[at] || !similar(&own->image, xt, yt, &from->image, x, y))
            continue;
        a->at[at] = value;
        if (e)
            a->entropy[at] = e[x];
    }
}

static void carry_to(struct arrived *a, const struct carry *c, int view)
{
    const struct sst_lightfield *lf = c->lf;
    const struct sst_view *own = &lf->views[view];
    int source[SOURCES];
    const int n = sources_of(c, view, source);

    for (int i = 0; i < n; i++) {
        const struct sst_view *from = &lf->views[source[i]];
        const struct shift across = shift_of(from->bx - own->bx, lf->disp_min_px);
        const struct shift down = shift_of(from->by - own->by, lf->disp_min_px);

        for (int y = 0; y < a->height; y++)
            carry_row(a, own, from, c->entropy ? &c->entropy[source[i]] : NULL, y, across, down);
    }
}

/* Where nothing arrived, the label of the pixel on the left or above goes on: slanted surfaces get wider. */
static void close_gaps(struct arrived *a)
{
    for (int y = 0; y < a->height; y++) {
        for (int x = 0; x < a->width; x++) {
            const size_t at = (size_t)y * (size_t)a->width + (size_t)x, stride = (size_t)a->width;
            const bool across = x > 0 && x + 1 < a->width && a->at[at - 1] && a->at[at + 1];
            const bool down = y > 0 && y + 1 < a->height && a->at[at - stride] && a->at[at + stride];
            const size_t from = across ? at - 1 : at - stride;

            if (a->at[at] || (!across && !down))
                continue;
            a->at[at] = a->at[from];
            if (a->entropy)
                a->entropy[at] = a->entropy[from];
        }
    }
}

static int carry_job(void *arg, int view, int worker SST_UNUSED)
{
    const struct carry *c = arg;
    struct sst_view *own = &c->lf->views[view];
    struct arrived a = { 0 };
    int err;

    if (!own->present || !c->carried[view])
        return 0;
    sst_map_u8_fini(&own->label);
    err = arrived_init(&a, c->lf, c->entropy != NULL);
    err = err ? err : sst_map_u8_init(&own->label, a.width, a.height);
    if (!err && c->entropy)
        err = sst_map_f32_init(&c->entropy[view], a.width, a.height);
    if (!err) {
        carry_to(&a, c, view);
        close_gaps(&a);
    }
    for (int y = 0; !err && y < a.height; y++) {
        const uint32_t *at = a.at + (size_t)y * (size_t)a.width;
        const uint8_t *valid = own->valid.data ? sst_map_u8_row(&own->valid, y) : NULL;
        uint8_t *label = sst_map_u8_row(&own->label, y);

        for (int x = 0; x < a.width; x++)
            label[x] = !valid || valid[x] ? (uint8_t)at[x] : SST_LABEL_NONE;
        for (int x = 0; c->entropy && x < a.width; x++)
            sst_map_f32_row(&c->entropy[view], y)[x] =
                at[x] ? a.entropy[(size_t)y * (size_t)a.width + (size_t)x] : INFINITY;
    }
    arrived_fini(&a);
    return err;
}

int process_carry_labels(struct sst_lightfield *lf, const bool *carried, struct sst_map_f32 *entropy, int threads)
{
    struct carry c = { lf, carried, entropy };

    return sst_parallel_for(lf->rows * lf->cols, threads, carry_job, &c);
}

/* Columns from .. end - 1 have no label; those beside them have one, unless they are outside. */
static void fill_run(uint8_t *label, const uint16_t *d, int from, int end, int width)
{
    for (int x = from; x < end; x++) {
        const bool left = from > 0 && (end == width || abs(d[x] - d[from - 1]) <= abs(d[x] - d[end]));

        label[x] = left ? label[from - 1] : label[end];
    }
}

static int fill_job(void *arg, int view, int worker SST_UNUSED)
{
    const struct carry *c = arg;
    struct sst_view *v = &c->lf->views[view];

    for (int y = 0; v->present && c->carried[view] && y < v->label.height; y++) {
        const uint16_t *d = sst_map_u16_row(&v->disp, y);
        uint8_t *label = sst_map_u8_row(&v->label, y);

        for (int x = 0, end; x < v->label.width; x = end + 1) {
            for (end = x; end < v->label.width && label[end] == SST_LABEL_NONE; end++)
                ;
            if (end > x && (x > 0 || end < v->label.width))
                fill_run(label, d, x, end, v->label.width);
        }
        for (int x = 0; v->valid.data && x < v->label.width; x++)
            label[x] &= sst_map_u8_row(&v->valid, y)[x];
    }
    return 0;
}

int process_fill_labels(struct sst_lightfield *lf, const bool *carried, int threads)
{
    struct carry c = { lf, carried, NULL };

    return sst_parallel_for(lf->rows * lf->cols, threads, fill_job, &c);
}

int process_carry_error(const struct sst_lightfield *lf, const bool *carried, int view, double *percent)
{
    struct sst_lightfield borrowed = *lf;
    const struct carry c = { &borrowed, carried, NULL };
    struct arrived a;
    int64_t n = 0, off = 0;
    const int err = arrived_init(&a, lf, false);

    if (!err)
        carry_to(&a, &c, view);
    for (int y = 0; !err && y < a.height; y++) {
        const uint8_t *label = sst_map_u8_row(&lf->views[view].label, y);

        for (int x = 0; x < a.width; x++) {
            const uint8_t there = (uint8_t)a.at[(size_t)y * (size_t)a.width + (size_t)x];

            n += label[x] && there;
            off += label[x] && there && label[x] != there;
        }
    }
    *percent = n ? 100.0 * (double)off / (double)n : NAN;
    arrived_fini(&a);
    return err;
}
