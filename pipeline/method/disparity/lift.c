/* Filled pixels that are of a nearer surface beside them, by their colours (design.md, 5.7). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/disparity/visible.h"

#define VIEWS 12  /* that are asked at most, ... */
#define SURE  2   /* ... up to this lead of one answer */
#define APART 64  /* 1/64 px: surfaces farther from each other are two */
#define LEAST 120 /* difference of R, G and B together that noise and whole pixels do not make */

/* A view that is asked, and where it shows a pixel. */
struct asked {
    const struct sst_image *image;
    const struct sst_map_u16 *disp;
    struct sst_shift across, down;
};

/* A view and its map. */
struct lifted {
    const struct sst_image *image;
    const struct sst_map_u16 *disp;
    const struct sst_map_u8 *status, *settled;
    struct asked view[VIEWS];
    int views;
};

static int difference(const struct sst_image *a, int ax, int ay, const struct sst_image *b, int bx, int by)
{
    int sum = 0;

    for (int c = 0; c < 3; c++)
        sum += abs(sst_image_row(a, c, ay)[ax] - sst_image_row(b, c, by)[bx]);
    return sum;
}

/* A pixel that may be of a nearer surface beside it. */
struct doubtful {
    int x, own, nearer;
    int most; /* difference up to which a view shows its colour */
    int lead; /* views with other colours, less the others */
};

/* Ask view i about pixels of row y: pixels side by side lie in the same lines of the cache. */
static void ask(struct doubtful *pixel, int pixels, const struct lifted *l, int i, int y)
{
    const struct asked *v = &l->view[i];

    for (int k = 0; k < pixels; k++) {
        struct doubtful *p = &pixel[k];
        const int xv = sst_shifted(p->x, v->across, p->own), yv = sst_shifted(y, v->down, p->own);

        if (abs(p->lead) >= SURE || (unsigned)xv >= (unsigned)v->disp->width ||
            (unsigned)yv >= (unsigned)v->disp->height || (int)sst_map_u16_row(v->disp, yv)[xv] > p->own + APART)
            continue;
        p->lead += difference(l->image, p->x, y, v->image, xv, yv) > p->most ? 1 : -1;
    }
}

/* Is a surface beside the pixel nearer? @param row  of the map, the one above and the one below */
static bool has_nearer(const uint16_t *const row[3], int x, int width)
{
    const int left = sst_max_int(x - 1, 0), right = sst_min_int(x + 1, width - 1);
    int most = 0;

    for (int i = 0; i < 3; i++)
        most = sst_max_int(most, sst_max_int(row[i][x], sst_max_int(row[i][left], row[i][right])));
    return most > row[0][x] + APART;
}

/* The disparity of the most similar pixel beside this one that shows a nearer surface; the own one: there is none.
 * @param mean  out: mean difference from them */
static int nearer_beside(const struct lifted *l, int x, int y, int *mean)
{
    const int own = sst_map_u16_row(l->disp, y)[x];
    int found = own, least = INT_MAX, sum = 0, n = 0;

    for (int i = 0; i < 9; i++) {
        const int xb = x + i % 3 - 1, yb = y + i / 3 - 1;
        int beside, d;

        if ((unsigned)xb >= (unsigned)l->disp->width || (unsigned)yb >= (unsigned)l->disp->height ||
            sst_map_u8_row(l->status, yb)[xb] != SST_DISPARITY_CORRECT)
            continue;
        beside = sst_map_u16_row(l->disp, yb)[xb];
        if (beside <= own + APART || beside == (int)SST_DISP_NONE)
            continue;
        d = difference(l->image, x, y, l->image, xb, yb);
        sum += d;
        n++;
        if (d < least) {
            least = d;
            found = beside;
        }
    }
    *mean = n ? sum / n : 0;
    return found;
}

/* The pixels of row y that may be of a nearer surface. @return how many */
static int find_doubtful(struct doubtful *pixel, const struct lifted *l, int y)
{
    const int width = l->disp->width;
    const uint16_t *const own[3] = { sst_map_u16_row(l->disp, y), sst_map_u16_row(l->disp, sst_max_int(y - 1, 0)),
                                     sst_map_u16_row(l->disp, sst_min_int(y + 1, l->disp->height - 1)) };
    const uint8_t *status = sst_map_u8_row(l->status, y), *settled = sst_map_u8_row(l->settled, y);
    int n = 0;

    for (int x = 0; x < width; x++) {
        int mean;

        if ((status[x] == SST_DISPARITY_CORRECT && settled[x]) || !has_nearer(own, x, width))
            continue;
        pixel[n] = (struct doubtful){ .x = x, .own = own[0][x], .nearer = nearer_beside(l, x, y, &mean) };
        pixel[n].most = sst_max_int(mean, LEAST);
        n += pixel[n].nearer != pixel[n].own;
    }
    return n;
}

static void lift(struct sst_map_u16 *out, const struct lifted *l, struct doubtful *pixel)
{
    for (int y = 0; y < out->height; y++) {
        const int n = find_doubtful(pixel, l, y);
        uint16_t *to = sst_map_u16_row(out, y);

        for (int i = 0; i < l->views; i++)
            ask(pixel, n, l, i, y);
        for (int k = 0; k < n; k++)
            to[pixel[k].x] = (uint16_t)(pixel[k].lead > 0 ? pixel[k].nearer : pixel[k].own);
    }
}

/* The maps of all views. */
struct lift_job {
    const struct sst_visible_views *in;
    const struct sst_map_u16 *filled;
    const struct sst_map_u8 *status;
    struct sst_map_u16 *out; /* [views], owned */
};

static int lift_view(void *arg, int view, int worker SST_UNUSED)
{
    const struct lift_job *job = arg;
    const struct sst_visible_views *in = job->in;
    const struct sst_visible_view *own = &in->view[view];
    const struct sst_map_u16 *filled = &job->filled[view];
    struct lifted l = { own->image, filled, &job->status[view], own->agreed, .views = 0 };
    struct doubtful *pixel;
    int nearest[VIEWS];
    int err;

    if (!own->image)
        return 0;
    if (in->cancel && *in->cancel)
        return -ECANCELED;
    err = sst_map_u16_init(&job->out[view], filled->width, filled->height);
    pixel = malloc((size_t)filled->width * sizeof(*pixel));
    if (err || !pixel) {
        free(pixel);
        return -ENOMEM;
    }
    memcpy(job->out[view].data, filled->data, filled->stride * (size_t)filled->height);
    l.views = sst_visible_nearest(in, view, VIEWS, nearest);
    for (int i = 0; i < l.views; i++) {
        const struct sst_visible_view *v = &in->view[nearest[i]];

        l.view[i] = (struct asked){ v->image, &job->filled[nearest[i]], sst_shift_by(own->bx - v->bx, in->disp_min_px),
                                    sst_shift_by(own->by - v->by, in->disp_min_px) };
    }
    lift(&job->out[view], &l, pixel);
    free(pixel);
    return 0;
}

int sst_disparity_lift(const struct sst_visible_views *in, struct sst_map_u16 *filled, const struct sst_map_u8 *status,
                       int threads)
{
    struct lift_job job = { in, filled, status, calloc((size_t)in->count, sizeof(*job.out)) };
    const int err = job.out ? sst_parallel_for(in->count, threads, lift_view, &job) : -ENOMEM;

    for (int k = 0; job.out && k < in->count; k++) {
        if (!err && job.out[k].data) {
            sst_map_u16_fini(&filled[k]);
            filled[k] = job.out[k];
        } else {
            sst_map_u16_fini(&job.out[k]);
        }
    }
    free(job.out);
    return err;
}
