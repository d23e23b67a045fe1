/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/lightfield/parallax.h"

#include <math.h>
#include <stdlib.h>

#include "base/log.h"
#include "base/stats.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/lightfield_internal.h"

#define BLOCK    16
#define BLOCKS   20    /* in each direction */
#define PAIRS    4     /* outermost views: left, right, top, bottom */
#define TEXTURED 16    /* blocks needed ... */
#define CONTRAST 5.0   /* ... of this standard deviation, in levels, and of twice the noise's */
#define ALIKE    0.7   /* correlation of the same surface */
#define BETTER   0.1   /* a place elsewhere must correlate by this much better */
#define STILL_PX 0.1   /* over the widest baseline */
#define STILL    0.5   /* of the textured blocks */
#define MOVED    0.02  /* of the textured blocks, found elsewhere: parallax */
#define SEARCH   0.125 /* of the width: how far a block is searched */

struct pair {
    const struct sst_image *image;
    double bx, by; /* from the reference view */
};

struct scene {
    const struct sst_image *ref;
    struct pair pair[PAIRS];
    int pairs;
    double widest; /* spacings */
};

/* Block of BLOCK x BLOCK pixels in a picture. */
struct block {
    const struct sst_image *image;
    int x, y;
};

static int pixel(const struct sst_image *img, int x, int y)
{
    return sst_image_row(img, 1, y)[x];
}

/* Variances of a block, which is inside its picture, and of a block in another picture, and their covariance.
 * @return false: the other block is outside */
static bool moments(const struct block *a, const struct block *b, double out[3])
{
    const double n = BLOCK * BLOCK;
    int64_t sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;

    if (b->x < 0 || b->y < 0 || b->x + BLOCK > b->image->width || b->y + BLOCK > b->image->height)
        return false;
    for (int y = 0; y < BLOCK; y++) {
        const uint8_t *p = sst_image_row(a->image, 1, a->y + y) + a->x,
                      *q = sst_image_row(b->image, 1, b->y + y) + b->x;

        for (int x = 0; x < BLOCK; x++) {
            sa += p[x];
            sb += q[x];
            aa += p[x] * p[x];
            bb += q[x] * q[x];
            ab += p[x] * q[x];
        }
    }
    out[0] = (double)aa / n - (double)sa / n * ((double)sa / n);
    out[1] = (double)bb / n - (double)sb / n * ((double)sb / n);
    out[2] = (double)ab / n - (double)sa / n * ((double)sb / n);
    return true;
}

/* Mean correlation of a block with the places in the other views that have this disparity; -1: outside most views. */
static double correlation(const struct scene *s, int x0, int y0, double disp_px)
{
    const struct block own = { s->ref, x0, y0 };
    double sum = 0, m[3];
    int n = 0;

    for (int i = 0; i < s->pairs; i++) {
        const int dx = (int)lround(-disp_px * s->pair[i].bx), dy = (int)lround(-disp_px * s->pair[i].by);
        const struct block there = { s->pair[i].image, x0 + dx, y0 + dy };

        if (!moments(&own, &there, m))
            continue;
        sum += m[0] > 0 && m[1] > 0 ? m[2] / sqrt(m[0] * m[1]) : 0;
        n++;
    }
    return 2 * n > s->pairs || n == s->pairs ? sum / n : -1;
}

/* Disparity of a block by the gradients of the reference view; exact near 0 only. Gains are removed with the mean. */
static double gradient_disparity(const struct scene *s, int x0, int y0)
{
    double above = 0, below = 0;

    for (int i = 0; i < s->pairs; i++) {
        const struct pair *p = &s->pair[i];
        double mean = 0;

        for (int y = y0; y < y0 + BLOCK; y++) {
            for (int x = x0; x < x0 + BLOCK; x++)
                mean += (pixel(p->image, x, y) - pixel(s->ref, x, y)) / (double)(BLOCK * BLOCK);
        }
        for (int y = y0; y < y0 + BLOCK; y++) {
            for (int x = x0; x < x0 + BLOCK; x++) {
                const double gx = 0.5 * (pixel(s->ref, x + 1, y) - pixel(s->ref, x - 1, y));
                const double gy = 0.5 * (pixel(s->ref, x, y + 1) - pixel(s->ref, x, y - 1));
                const double along = gx * p->bx + gy * p->by;

                above += along * (pixel(p->image, x, y) - pixel(s->ref, x, y) - mean);
                below += along * along;
            }
        }
    }
    return below > 0 ? above / below : 0;
}

/* Is the block found at another disparity than 0, better than there? */
static bool is_elsewhere(const struct scene *s, int x0, int y0, double here)
{
    const double step = 1 / s->widest;
    const int steps = (int)(SEARCH * s->ref->width);

    for (int i = 1; i <= steps; i++) {
        const double found = fmax(correlation(s, x0, y0, i * step), correlation(s, x0, y0, -i * step));

        if (found > ALIKE && found > here + BETTER)
            return true;
    }
    return false;
}

static int block_at(int i, int size)
{
    return 1 + (int)((int64_t)(size - BLOCK - 2) * i / (BLOCKS - 1));
}

static int block_x(const struct scene *s, int i)
{
    return block_at(i % BLOCKS, s->ref->width);
}

static int block_y(const struct scene *s, int i)
{
    return block_at(i / BLOCKS, s->ref->height);
}

/* Block i of a picture. */
static struct block block_of(const struct scene *s, const struct sst_image *image, int i)
{
    return (struct block){ image, block_x(s, i), block_y(s, i) };
}

/* Variance of the noise: half the variance of differences at the same place, the lower quartile of all blocks. */
static double noise_variance(const struct scene *s)
{
    double var[BLOCKS * BLOCKS], m[3];

    for (int i = 0; i < BLOCKS * BLOCKS; i++) {
        const struct block own = block_of(s, s->ref, i), there = block_of(s, s->pair[0].image, i);

        (void)moments(&own, &there, m);
        var[i] = 0.5 * (m[0] + m[1] - 2 * m[2]);
    }
    sst_stats_sort_double(var, BLOCKS * BLOCKS);
    return var[BLOCKS * BLOCKS / 4];
}

/* Choose the blocks with a contrast above the noise's. @return their number */
static int select_textured(const struct scene *s, double noise, bool *use)
{
    int n = 0;

    for (int i = 0; i < BLOCKS * BLOCKS; i++) {
        const struct block own = block_of(s, s->ref, i);
        double m[3];

        use[i] = moments(&own, &own, m) && m[0] > CONTRAST * CONTRAST + 4 * noise;
        n += use[i];
    }
    return n;
}

/* Number of chosen blocks that stand still; they are taken out of the choice. */
static int remove_still(const struct scene *s, bool *use)
{
    int n = 0;

    for (int i = 0; i < BLOCKS * BLOCKS; i++) {
        const int x0 = block_x(s, i), y0 = block_y(s, i);

        if (use[i] && correlation(s, x0, y0, 0) > ALIKE && fabs(gradient_disparity(s, x0, y0)) * s->widest < STILL_PX) {
            use[i] = false;
            n++;
        }
    }
    return n;
}

static int count_moved(const struct scene *s, const bool *use)
{
    int n = 0;

    for (int i = 0; i < BLOCKS * BLOCKS; i++)
        n += use[i] && is_elsewhere(s, block_x(s, i), block_y(s, i), correlation(s, block_x(s, i), block_y(s, i), 0));
    return n;
}

static enum sst_parallax judge(const struct scene *s)
{
    bool use[BLOCKS * BLOCKS];
    const int textured = select_textured(s, noise_variance(s), use);

    if (textured < TEXTURED) { /* much noise, or differences by parallax everywhere */
        (void)select_textured(s, 0, use);
        return count_moved(s, use) >= TEXTURED ? SST_PARALLAX_SEEN : SST_PARALLAX_UNKNOWN;
    }
    if (remove_still(s, use) < STILL * textured || count_moved(s, use) > MOVED * textured)
        return SST_PARALLAX_SEEN;
    return SST_PARALLAX_NONE;
}

/* The outermost present views other than the reference view, each once. @return their number */
static int outermost(const struct sst_lightfield *lf, int view[PAIRS])
{
    static const int side[PAIRS][2] = { { -1, 0 }, { 1, 0 }, { 0, -1 }, { 0, 1 } };
    const struct sst_view *ref = &lf->views[lf->ref_view];
    int n = 0;

    for (int i = 0; i < PAIRS; i++) {
        double best = 1e-9;
        int at = -1;

        for (int k = 0; k < lf->rows * lf->cols; k++) {
            const struct sst_view *v = &lf->views[k];
            const double x = v->bx - ref->bx, y = v->by - ref->by;
            /* Straight along one axis first: blocks are searched there without a shift across. */
            const double out = side[i][0] * x + side[i][1] * y - 0.5 * fabs(side[i][0] ? y : x);

            if (v->present && k != lf->ref_view && out > best) {
                best = out;
                at = k;
            }
        }
        if (at >= 0)
            view[n++] = at;
    }
    return n;
}

static int read_image(struct sst_image *out, const struct sst_lightfield *lf, int view, const char *dir)
{
    struct view_file file;
    int err = view_file_read(&file, lf, view, dir);

    if (err)
        return err;
    err = sst_image_decode_samples(out, file.data, file.size, file.path, lf->samples);
    free(file.data);
    return err;
}

enum sst_parallax sst_lightfield_parallax(const struct sst_lightfield *lf, const char *dir)
{
    struct sst_image read[PAIRS + 1] = { 0 };
    const struct sst_image *image[PAIRS + 1];
    enum sst_parallax result = SST_PARALLAX_UNKNOWN;
    struct scene s = { 0 };
    int view[PAIRS + 1];
    bool fits = true;

    s.pairs = outermost(lf, view);
    view[s.pairs] = lf->ref_view;
    for (int i = 0; i <= s.pairs && fits; i++) {
        image[i] = &lf->views[view[i]].image;
        if (!image[i]->plane[0]) {
            fits = dir && !read_image(&read[i], lf, view[i], dir);
            image[i] = &read[i];
        }
        fits &= image[i]->width > BLOCK + 2 && image[i]->height > BLOCK + 2 && image[i]->width == image[0]->width &&
                image[i]->height == image[0]->height;
    }
    if (s.pairs && fits) {
        s.ref = image[s.pairs];
        for (int i = 0; i < s.pairs; i++) {
            s.pair[i] = (struct pair){ image[i], lf->views[view[i]].bx - lf->views[lf->ref_view].bx,
                                       lf->views[view[i]].by - lf->views[lf->ref_view].by };
            s.widest = fmax(s.widest, hypot(s.pair[i].bx, s.pair[i].by));
        }
        result = judge(&s);
    }
    for (int i = 0; i <= PAIRS; i++)
        sst_image_fini(&read[i]);
    return result;
}

void sst_lightfield_warn_views(const struct sst_lightfield *lf, const char *dir, const char *name)
{
    if (sst_lightfield_parallax(lf, dir) == SST_PARALLAX_NONE)
        sst_log_warning(
            "%s: the views show no parallax: they are one picture from one place; its disparities will mean "
            "nothing; check that the camera moved from view to view",
            name);
}
