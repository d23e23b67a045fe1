/* The automatic cut of clear pictures, and the histogram that the page draws it into.
 *
 * A cut is useful where other views see behind the removed surfaces. A known cut stays as long as its gap is open, also
 * when the foreground object has left: it waits for the next one. When its gap has been closed for a second, or a
 * useful cut that removes less has been found for a second, the new cut replaces it, or none does. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "pipeline/live/live_internal.h"

#define FINE_SHIFT  3 /* of stored disparities, for the histogram */
#define FINE_BINS   (1 << (16 - FINE_SHIFT))
#define WAIT_NS     INT64_C(1000000000)
#define MOVED_SHARE 0.05 /* of all rays between two cuts that are not the same */
#define CLOSE_PX    0.5  /* to both sides of a cut, where ... */
#define CLOSE_SHARE 0.01 /* ... this fraction of the rays closes the gap */
#define SEEN_SHARE  0.5  /* of the removed pixels: other views see behind them. In dense leaves the maps ... */
#define DENSE       0.9  /* ... confirm a smaller fraction than this, and say little about that */

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

/* Do other views see behind enough of what the cut removes from the lead view? By the samples of
 * sst_render_focus_vote(). */
static bool sees_behind(const struct sst_live *live, double cut_px)
{
    const struct sst_render_focus *f = &live->focus;
    const int cut_q6 = (int)((cut_px - live->lf.disp_min_px) * SST_DISP_SCALE);
    int removed = 0, seen = 0;

    for (int i = 0; i < f->cells; i++) {
        if (f->front[i] == SST_DISP_NONE || f->front[i] <= cut_q6)
            continue;
        removed++;
        seen += f->behind[i] && f->behind[i] - 1 <= cut_q6;
    }
    return seen >= SEEN_SHARE * removed;
}

/* Next value of the cut: itself, while its gap is open; else the one found; NaN: none. */
static double wanted(const struct sst_live *live, double found_px)
{
    const double cut_px = live->cut.cut_px;

    const bool open = !isnan(cut_px) && share_between(live, cut_px - CLOSE_PX, cut_px + CLOSE_PX) <= CLOSE_SHARE;
    const bool useful = !isnan(found_px) && (live->confirmed < DENSE || sees_behind(live, found_px));

    if (open && !(useful && found_px > cut_px && share_between(live, cut_px, found_px) > MOVED_SHARE))
        return cut_px;
    return useful ? found_px : NAN;
}

static bool same(double a, double b)
{
    return isnan(a) || isnan(b) ? isnan(a) && isnan(b) : fabs(a - b) < 1e-9;
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
    const int lead = sst_render_lead_view(&live->lf);
    const struct sst_map_u16 *disp = lead < 0 ? NULL : &live->lf.views[lead].disp;
    uint32_t fine[FINE_BINS] = { 0 }, count[SST_LIVE_HISTOGRAM] = { 0 }, all = 0;
    double lo, hi, scale;

    if (!live->ready || !disp || !sst_live_range(live, &lo, &hi))
        return false;
    scale = SST_LIVE_HISTOGRAM / fmax(hi - lo, 1 / SST_DISP_SCALE);
    for (int y = 0; y < disp->height; y += 2) {
        const uint16_t *row = sst_map_u16_row(disp, y);

        for (int x = 0; x < disp->width; x += 2)
            fine[row[x] >> FINE_SHIFT]++;
    }
    for (int i = 0; i < FINE_BINS - 1; i++) { /* the last one: unknown */
        const double px = sst_disp_px(&live->lf, (uint16_t)((i << FINE_SHIFT) + (1 << FINE_SHIFT) / 2));

        count[sst_clamp_int((int)((px - lo) * scale), 0, SST_LIVE_HISTOGRAM - 1)] += fine[i];
        all += fine[i];
    }
    if (!all)
        return false;
    for (int i = 0; i < SST_LIVE_HISTOGRAM; i++)
        share[i] = (float)count[i] / (float)all;
    *min_px = lo;
    *max_px = hi;
    return true;
}
