/* Rows of all views that some rows of a picture need, one view behind the other, where the views do not fit together.
 * Rays are compared with the views around theirs (SST_VERIFY_AUTO):
 *
 *      view                          view around it
 *      from + ny                     from + ny + least        a ray of disparity px moves by px * by rows,
 *         .   rays of the rows          .                     for the smallest and the largest disparity
 *      end + ny                      end + ny + most          that are compared */
#include <math.h>

#include "pipeline/gpu/rectify.h"
#include "pipeline/method/render/device_internal.h"

/* Rows of the views, top .. end - 1. */
struct reach {
    int top[SST_MAX_VIEWS], end[SST_MAX_VIEWS];
};

/* Add the rows top .. end - 1 of a view. */
static void widen(struct reach *r, int k, double top, double end, int height)
{
    const int first = (int)sst_clamp_double(floor(top), 0, height), last = (int)sst_clamp_double(ceil(end), 0, height);

    if (first >= last)
        return;
    r->top[k] = r->top[k] < r->end[k] ? sst_min_int(r->top[k], first) : first;
    r->end[k] = sst_max_int(r->end[k], last);
}

/* Rows of views that are made from frames are whole groups. @return pixels */
static size_t round_up(struct reach *r, const struct device_batch *b)
{
    const int height = b->d->lf->height, unit = SST_GPU_RECTIFY_GROUP_HEIGHT;
    size_t rows = 0;

    for (int k = 0; k < b->p->count; k++) {
        if (b->p->tap[k].frame)
            r->end[k] = sst_min_int(r->top[k] + (r->end[k] - r->top[k] + unit - 1) / unit * unit, height);
        rows += (size_t)(r->end[k] - r->top[k]);
    }
    return rows * (size_t)b->d->pitch;
}

/* Rows of the views for the rows from .. end - 1 of the picture: rays lie between two rows, and so do places around
 * them; rays beside the rows are verified, too. @return pixels */
static size_t find_reach(struct reach *r, const struct device_batch *b, int from, int end)
{
    const struct sst_render_plan *p = b->p;
    const int beside = b->verify, height = b->d->lf->height;
    double least_px, most_px;
    const bool any =
        b->verify && p->explainer && explainer_reach(p->explainer, p->numbers.nearest_end, &least_px, &most_px);

    *r = (struct reach){ .end = { 0 } };
    for (int k = 0; k < p->count; k++) {
        const struct sst_render_tap *t = &p->tap[k];
        const int y0 = sst_max_int(from - beside, t->y0), y1 = sst_min_int(end + beside, t->y1);
        struct sst_gpu_verify_near near[SST_GPU_VERIFY_AROUND];
        const int around = any ? explainer_around(p->explainer, k, near) : 0;

        if (t->x0 >= t->x1 || y0 >= y1)
            continue;
        widen(r, k, y0 + sst_min_int(t->iy, t->ny), y1 + sst_max_int(t->iy, t->ny) + 1, height);
        for (int i = 0; i < around; i++) {
            const double moves[2] = { least_px * (double)near[i].by, most_px * (double)near[i].by };

            widen(r, (int)near[i].view, y0 + t->ny + fmin(moves[0], moves[1]) - 1,
                  y1 + t->ny + fmax(moves[0], moves[1]) + 2, height);
        }
    }
    return round_up(r, b);
}

void device_reserve_band(struct device_batch *b, int top, int end, int rows)
{
    struct sst_run *run = b->d->run;
    size_t pixels = 4;

    for (int y = top; y < end; y += rows) {
        struct reach r;
        const size_t n = find_reach(&r, b, y, sst_min_int(y + rows, end));

        pixels = n > pixels ? n : pixels;
    }
    b->band.pixels = sst_run_scratch(run, DEVICE_SCRATCH_COLOUR, 4 * pixels).buffer;
    b->band.disp = sst_run_scratch(run, DEVICE_SCRATCH_DISP, 2 * pixels).buffer;
    b->band.valid = sst_run_scratch(run, DEVICE_SCRATCH_VALID, pixels).buffer;
    if (b->verify && b->d->doubts)
        b->band.confidence = sst_run_scratch(run, DEVICE_SCRATCH_CONFIDENCE, pixels).buffer;
}

void device_place_band(struct device_batch *b, int top, int end)
{
    struct device_taps *taps = &b->taps;
    struct reach r;
    uint32_t at = 0;

    (void)find_reach(&r, b, top, end);
    for (int k = 0; k < taps->count; k++) {
        taps->wanted[k] = r.top[k] < r.end[k];
        taps->place[k] = (struct device_place){ &b->band, at - (uint32_t)(r.top[k] * b->d->pitch), r.top[k], r.end[k] };
        at += (uint32_t)((r.end[k] - r.top[k]) * b->d->pitch);
    }
    for (int k = 0; k < taps->count && !sst_run_failed(b->d->run); k++) {
        if (!taps->wanted[k])
            continue;
        if (taps->tap[k]->frame) {
            device_ready_frames(b->d, taps, k);
            device_make_rows(b->d, taps, k, &taps->place[k], false);
        } else {
            device_upload_rows(b->d, &taps->place[k], taps->tap[k]->v, DEVICE_COLOURS | DEVICE_LABELS, taps->threads);
            b->d->report.uploads++;
        }
    }
}
