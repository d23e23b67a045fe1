/* The automatic cut of clear pictures, and the histogram that the page draws it into.
 *
 * A cut that separates the same rays stays, wherever in the gap it lies, and so does one behind which nothing else
 * stands: when what stood in front has left, the cut waits for the next one. It moves when another cut has been found
 * for a second between which and itself there are rays, and goes when for a second there is no gap any more. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "pipeline/live/live_internal.h"

#define WAIT_NS     INT64_C(1000000000)
#define MOVED_SHARE 0.01 /* rays between two cuts that are not the same */
#define CLOSE_PX    0.5  /* to both sides of a cut, where ... */
#define CLOSE_SHARE 0.01 /* ... so many rays close the gap */

/* Fraction of the counted rays with a disparity of from_px .. to_px. */
static double share_between(const struct sst_live *live, double from_px, double to_px)
{
    const struct sst_label_histogram *h = &live->renderer->histogram;
    const double lo = (fmin(from_px, to_px) - h->disp_min_px) * SST_DISP_SCALE;
    const double hi = (fmax(from_px, to_px) - h->disp_min_px) * SST_DISP_SCALE;
    uint64_t inside = 0, all = 0;

    for (int label = 0; label < 256; label++) {
        for (int bin = h->first_bin; h->count[label] && bin < h->bins; bin++) {
            all += h->count[label][bin];
            inside += bin > lo && bin <= hi ? h->count[label][bin] : 0;
        }
    }
    return all ? (double)inside / (double)all : 0;
}

/* What the cut should become: the one found, if it separates other rays; NaN, if its gap has closed; else itself. */
static double wanted(const struct sst_live *live, double found_px)
{
    const double cut_px = live->cut.cut_px;

    if (isnan(cut_px))
        return found_px;
    if (!isnan(found_px))
        return share_between(live, cut_px, found_px) > MOVED_SHARE ? found_px : cut_px;
    return share_between(live, cut_px - CLOSE_PX, cut_px + CLOSE_PX) > CLOSE_SHARE ? NAN : cut_px;
}

static bool same(double a, double b)
{
    return (isnan(a) && isnan(b)) || fabs(a - b) < 1e-9;
}

int live_cut_follow(struct sst_live *live, int64_t t_ns)
{
    struct live_cut *c = &live->cut;
    double found_px = NAN, to_px;
    int err = sst_render_find_cut(live->renderer, &found_px);

    if (err && err != -ENODATA)
        return err;
    to_px = wanted(live, err ? NAN : found_px);
    if (same(to_px, c->cut_px)) {
        c->since_ns = 0;
    } else if (isnan(c->cut_px)) {
        c->cut_px = to_px;
    } else if (!c->since_ns) {
        c->since_ns = t_ns;
    } else if (t_ns - c->since_ns >= WAIT_NS) {
        c->cut_px = to_px;
        c->since_ns = 0;
    }
    return 0;
}

double sst_live_cut(const struct sst_live *live)
{
    return live->cut.cut_px;
}

bool sst_live_histogram(const struct sst_live *live, double *min_px, double *max_px, float share[SST_LIVE_HISTOGRAM])
{
    const int lead = live_lead_view(live);
    const struct sst_map_u16 *disp = lead < 0 ? NULL : &live->lf.views[lead].disp;
    uint32_t count[SST_LIVE_HISTOGRAM] = { 0 }, all = 0;
    double lo, hi, scale;

    if (!live->ready || !disp || !sst_live_range(live, &lo, &hi))
        return false;
    scale = SST_LIVE_HISTOGRAM / fmax(hi - lo, 1 / SST_DISP_SCALE);
    for (int y = 0; y < disp->height; y += 2) {
        const uint16_t *row = sst_map_u16_row(disp, y);

        for (int x = 0; x < disp->width; x += 2) {
            const double at = (sst_disp_px(&live->lf, row[x]) - lo) * scale;

            if (row[x] == SST_DISP_NONE)
                continue;
            count[sst_clamp_int((int)at, 0, SST_LIVE_HISTOGRAM - 1)]++;
            all++;
        }
    }
    if (!all)
        return false;
    for (int i = 0; i < SST_LIVE_HISTOGRAM; i++)
        share[i] = (float)count[i] / (float)all;
    *min_px = lo;
    *max_px = hi;
    return true;
}
