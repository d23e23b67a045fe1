/* Lines that visits cross: a crossing counts once the foot is clear of the line, so that a person who stands on it
 * crosses it once. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#define CLEAR_SIZE    0.05  /* of a visitor's height: the foot is found no better, ... */
#define CLEAR_PICTURE 0.005 /* ... nor than this part of the picture's height */

struct line {
    double x, y, dx, dy, length; /* px */
};

static struct line line_of(const struct live_engine *v, const struct sst_zone *z)
{
    const int width = sst_max_int(v->state.width, 1), height = sst_max_int(v->state.height, 1);
    double x[SST_ZONE_POINTS] = { 0 }, y[SST_ZONE_POINTS] = { 0 };
    struct line l;

    (void)sst_zone_corners(z, x, y);
    l = (struct line){
        .x = x[0] * width, .y = y[0] * height, .dx = (x[1] - x[0]) * width, .dy = (y[1] - y[0]) * height
    };
    l.length = fmax(hypot(l.dx, l.dy), 1e-6);
    return l;
}

/* Distance to the right of a line in a picture with y downwards, and position along it: 0..1 between its ends. */
static double right_of(const struct live_engine *v, const struct line *l, const struct visit_point *p, double *along)
{
    const double x = p->x * sst_max_int(v->state.width, 1) - l->x, y = p->y * sst_max_int(v->state.height, 1) - l->y;

    *along = (x * l->dx + y * l->dy) / (l->length * l->length);
    return (l->dx * y - l->dy * x) / l->length;
}

/* @param way  from, to @return 1: the visitor has crossed forward; -1: backward; 0: neither */
static int cross(const struct live_engine *v, const struct sst_zone *z, struct visit_line *s,
                 const struct visit_point *const way[2], double clear_px)
{
    const struct line l = line_of(v, z);
    double at0, at1;
    const double was_px = right_of(v, &l, way[0], &at0), is_px = right_of(v, &l, way[1], &at1);
    const int before = s->side;

    if ((was_px > 0) != (is_px > 0)) {
        const double along = at0 + (at1 - at0) * was_px / (was_px - is_px);

        s->between = along >= 0 && along <= 1;
    }
    if (fabs(is_px) < clear_px)
        return 0;
    s->side = is_px > 0 ? 1 : -1;
    return before && before != s->side && s->between ? s->side : 0;
}

static bool is_wanted(const struct sst_zone *z, const char *label, const struct visit_point *p, int way)
{
    bool wanted = !z->labels[0][0];

    for (int k = 0; k < SST_ZONE_LABELS && z->labels[k][0]; k++)
        wanted |= !strcmp(z->labels[k], label);
    return wanted && p->disp_px <= z->near_px && p->disp_px >= z->far_px &&
           (z->direction == SST_LINE_BOTH || (z->direction == SST_LINE_FORWARD) == (way > 0));
}

int engine_lines_follow(struct live_engine *v, struct visit *a, const struct visit_point *from, double height_px,
                        struct visit_crossing out[SST_ZONES_MAX])
{
    const char *label = engine_label_name(v, a->label);
    const double clear_px = CLEAR_SIZE * height_px + CLEAR_PICTURE * v->state.height;
    int n = 0;

    pthread_mutex_lock(&v->lock);
    for (int i = 0; i < v->live_config.zones && i < v->config.zones; i++) {
        const struct sst_zone *z = &v->config.zone[i];
        const int way =
            z->line ? cross(v, z, &a->line[i], (const struct visit_point *[2]){ from, &a->last }, clear_px) : 0;

        if (!way || !is_wanted(z, label, &a->last, way))
            continue;
        out[n++] = (struct visit_crossing){ .zone = i, .forward = way > 0, .t_ns = a->last.t_ns };
    }
    pthread_mutex_unlock(&v->lock);
    return n;
}
