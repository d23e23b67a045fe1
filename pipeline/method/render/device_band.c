/* Rows of all views that some rows of a picture need, one view behind the other, where the views do not fit together.
 * Rays are compared with the views around theirs (SST_VERIFY_AUTO):
 *
 *      view                          view around it
 *      from + ny                     from + ny + least        a ray of disparity px moves by px * by rows,
 *         .   rays of the rows          .                     for the smallest and the largest disparity
 *      end + ny                      end + ny + most          that are compared */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/method/render/device_internal.h"

/* Add the rows top .. end - 1 of a view. */
static void widen(struct device_place *p, double top, double end, int height)
{
    const int first = (int)sst_clamp_double(floor(top), 0, height), last = (int)sst_clamp_double(ceil(end), 0, height);

    if (first >= last)
        return;
    p->top = p->top < p->end ? sst_min_int(p->top, first) : first;
    p->end = sst_max_int(p->end, last);
}

/* Place the rows of the views for the rows from .. end - 1 of the picture: rays lie between two rows, and so do places
 * around them; rays beside the rows are verified, too. @return pixels */
static size_t place(struct device_batch *b, int from, int end)
{
    const struct sst_render_plan *p = b->p;
    const int beside = b->verify, height = b->d->lf->height;
    struct device_place *place = b->taps.place;
    double least_px, most_px;
    const bool any =
        b->verify && p->explainer && explainer_reach(p->explainer, p->numbers.nearest_end, &least_px, &most_px);

    for (int k = 0; k < p->count; k++)
        place[k].top = place[k].end = 0;
    for (int k = 0; k < p->count; k++) {
        const struct sst_render_tap *t = &p->tap[k];
        const int y0 = sst_max_int(from - beside, t->y0), y1 = sst_min_int(end + beside, t->y1);
        struct explainer_near near[EXPLAINER_AROUND];
        const int around = any ? explainer_around(p->explainer, k, near) : 0;

        if (t->x0 >= t->x1 || y0 >= y1)
            continue;
        widen(&place[k], y0 + sst_min_int(t->iy, t->ny), y1 + sst_max_int(t->iy, t->ny) + 1, height);
        for (int i = 0; i < around; i++) {
            const double moves[2] = { least_px * (double)near[i].by, most_px * (double)near[i].by };

            widen(&place[near[i].tap], y0 + t->ny + fmin(moves[0], moves[1]) - 1,
                  y1 + t->ny + fmax(moves[0], moves[1]) + 2, height);
        }
    }
    return device_place_rows(b->d, &b->taps, &b->band);
}

void device_reserve_band(struct device_batch *b, int top, int end, int rows)
{
    size_t pixels = 0;

    for (int y = top; y < end; y += rows) {
        const size_t n = place(b, y, sst_min_int(y + rows, end));

        pixels = n > pixels ? n : pixels;
    }
    device_reserve_rows(b->d, &b->band, pixels, b->verify && b->d->doubts);
}

void device_place_band(struct device_batch *b, int top, int end)
{
    (void)place(b, top, end);
    device_upload_placed(b->d, &b->taps, DEVICE_COLOURS | DEVICE_LABELS);
}
