/* Disparity range of a light field from a coarse match of its reference view. */
#include <errno.h>
#include <math.h>

#include "base/log.h"
#include "pipeline/disparity/stage.h"

#define REDUCED_SIDE 320   /* longer sides are halved until they are at most about this */
#define CONFIDENT    100   /* of 255: a clear second minimum; filled pixels have 0 */
#define CUT          0.005 /* share of the confident pixels left out at each end */

static int reduce(struct sst_image *out, const struct sst_image *in, int *factor)
{
    struct sst_image half = { 0 };
    int err = sst_image_halve(out, in);

    *factor = 2;
    while (!err && (out->width > 2 * REDUCED_SIDE || out->height > 2 * REDUCED_SIDE)) {
        err = sst_image_halve(&half, out);
        if (err)
            break;
        sst_image_fini(out);
        *out = half;
        *factor *= 2;
    }
    return err;
}

/* Disparities of the confident pixels as a histogram of half pixels (reduced), from the lowest searched. */
static int64_t collect(int64_t *histogram, int bins, const struct sst_lightfield *lf)
{
    int64_t total = 0;

    for (int y = 0; y < lf->height; y++) {
        const uint16_t *d = sst_map_u16_row(&lf->views[0].disp, y);
        const uint8_t *c = sst_map_u8_row(&lf->views[0].confidence, y);

        for (int x = 0; x < lf->width; x++) {
            if (c[x] < CONFIDENT || d[x] == SST_DISP_NONE)
                continue;
            histogram[sst_min_int(d[x] / 32, bins - 1)]++;
            total++;
        }
    }
    return total;
}

/* Fill a light field of one pair from two views of lf, reduced. */
static int make_pair(struct sst_lightfield *pair, const struct sst_lightfield *lf, int a, int b, int *factor)
{
    int err = sst_lightfield_init(pair, 1, 2);

    for (int i = 0; !err && i < 2; i++) {
        const struct sst_view *from = &lf->views[i ? b : a];

        err = reduce(&pair->views[i].image, &from->image, factor);
        if (!err && from->valid.data)
            err = sst_mask_reduce(&pair->views[i].valid, &from->valid, *factor);
        pair->views[i].present = true;
        pair->views[i].bx = from->bx - lf->views[a].bx;
        pair->views[i].by = from->by - lf->views[a].by;
        pair->width = pair->views[i].image.width;
        pair->height = pair->views[i].image.height;
    }
    return err;
}

int sst_disparity_range(const struct sst_lightfield *lf, int threads, double *min_px, double *max_px)
{
    enum { BINS = 2 * SST_DISPARITY_MAX_STEPS };
    struct sst_disparity_config cfg;
    int64_t histogram[BINS] = { 0 }, total = 0, below = 0;
    const int ref = lf->ref_view, col = ref % lf->cols, row = ref / lf->cols;
    int factor = 1, err = sst_disparity_preset(&cfg, "balanced"), first = -1, last = -1;
    double reach = 0;

    if (err)
        return err;
    cfg.threads = threads;
    for (int side = 0; !err && side < 4; side++) {
        const int c = col + (side == 0) - (side == 1), r = row + (side == 2) - (side == 3);
        struct sst_lightfield pair = { 0 };

        if (c < 0 || r < 0 || c >= lf->cols || r >= lf->rows || !lf->views[r * lf->cols + c].present)
            continue;
        err = make_pair(&pair, lf, ref, r * lf->cols + c, &factor);
        /* Nothing nearer than a fifth of the picture's longer side per spacing, either way. */
        reach = fmin(ceil(sst_max_int(pair.width, pair.height) / 5.0), SST_DISPARITY_MAX_STEPS / 2 - 1);
        cfg.disp_min_px = -reach;
        cfg.disp_max_px = reach;
        err = err ? err : sst_disparity_lightfield(&pair, &cfg, NULL, NULL);
        if (!err)
            total += collect(histogram, BINS, &pair);
        sst_lightfield_fini(&pair);
    }
    if (err)
        return err;
    for (int i = 0; i < BINS; i++) {
        below += histogram[i];
        if (first < 0 && (double)below > CUT * (double)total)
            first = i;
        if (last < 0 && (double)below >= (1 - CUT) * (double)total && below > 0)
            last = i;
    }
    if (total < 100 || first < 0) {
        sst_log_error("the disparity range cannot be told from these views; give it with --range-min and --range-max");
        return -ENODATA;
    }
    /* One reduced pixel of margin: half a bin is all that the histogram blurs, the rest is for what the cut left out.
     */
    *min_px = floor((-reach + first * 0.5 - 1.0) * factor);
    *max_px = ceil((-reach + (last + 1) * 0.5 + 1.0) * factor);
    return 0;
}
