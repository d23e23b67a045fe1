/* Visits from tracks of the live picture: one event when an object comes, one of the same name when it has gone.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/stats.h"
#include "base/text.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#define PICTURE_QUALITY 85
#define PICTURE_BETTER  1.25 /* times larger than in the picture before */
#define PICTURES_MOST   5
#define PICTURE_NS      INT64_C(500000000)
#define DEEPER          0.15 /* logarithm of a ratio of distances: nearer or farther by this, a visitor has moved */
#define DEEPER_HIDDEN   0.45 /* behind leaves depths come from a few planes */
#define PATH_STEP       0.02 /* of the picture's width or height between two points of a path */
/* Limits between a lost track and the new one that continues it. */
#define JOIN_S         12.0 /* gap */
#define JOIN_RATIO     1.4  /* of their distances */
#define JOIN_HEIGHTS_S 2.5  /* speed, in heights of the person a second: runners have 2 to 3 */
#define PATH_NS        INT64_C(1500000000) /* behind leaves a point of a path is made from all within this */

double engine_distance_m(const struct live_engine *v, double disp_px)
{
    const struct engine_state *s = &v->state;

    return v->live_config.calibration && s->focal_px > 0 && s->spacing_mm > 0 && disp_px > 0
               ? s->focal_px * s->spacing_mm / disp_px / 1000
               : NAN;
}

/* Where a thing stands: the middle of its lower edge, as fractions of the picture. */
static struct visit_point foot(const struct live_engine *v, const struct sst_live_track *t, int64_t t_ns)
{
    const int width = sst_max_int(v->state.width, 1), height = sst_max_int(v->state.height, 1);

    return (struct visit_point){ .t_ns = t_ns,
                                 .x = sst_clamp_double((t->x0 + t->x1) / 2 / width, 0, 1),
                                 .y = sst_clamp_double(t->y1 / height, 0, 1),
                                 .disp_px = t->disp_px };
}

/* @param always  also near the point before: a picture was taken there */
static void add_point(struct visit *a, struct visit_point p, bool always)
{
    const struct visit_point *last = a->points ? &a->path[a->points - 1] : NULL;

    if (last && (last->t_ns == p.t_ns || (!always && hypot(p.x - last->x, p.y - last->y) < PATH_STEP)))
        return;
    if (a->points == VISIT_POINTS) { /* every second one stays */
        for (int i = 1; i < VISIT_POINTS / 2; i++)
            a->path[i] = a->path[2 * i];
        a->points = VISIT_POINTS / 2;
    }
    a->path[a->points++] = p;
}

const char *engine_label_name(const struct live_engine *v, int label)
{
    return label ? sst_classes_name(&v->classes, label) : "";
}

/* The zones that a point is in, by their labels and depths; and whether one is a mask. */
static unsigned zones_at(struct live_engine *v, struct visit_point p, int label, bool *masked)
{
    const char *name = engine_label_name(v, label);
    unsigned zones = 0;

    *masked = false;
    pthread_mutex_lock(&v->lock);
    for (int i = 0; i < v->live_config.zones && i < v->config.zones; i++) {
        const struct sst_zone *z = &v->config.zone[i];
        bool wanted = !z->labels[0][0];

        for (int k = 0; k < SST_ZONE_LABELS && z->labels[k][0]; k++)
            wanted |= !strcmp(z->labels[k], name);
        if (!wanted || !sst_live_zone_has(&v->live_config.zone[i], p.x, p.y, p.disp_px))
            continue;
        *masked |= z->mask;
        zones |= z->mask ? 0 : 1u << i;
    }
    pthread_mutex_unlock(&v->lock);
    return zones;
}

/* "left to right": the larger of the ways across, up or down, and in depth; "": none. */
static const char *direction(const struct visit *a)
{
    const struct visit_point *from = &a->path[0], *to = &a->last;
    const double dx = to->x - from->x, dy = to->y - from->y;
    const double depth = from->disp_px > 0 && to->disp_px > 0 ? log(to->disp_px / from->disp_px) : 0;

    if (fabs(dx) >= 0.1 && fabs(dx) >= fabs(dy))
        return dx > 0 ? "left to right" : "right to left";
    if (fabs(depth) >= (a->hidden ? DEEPER_HIDDEN : DEEPER))
        return depth > 0 ? "nearer" : "farther";
    return fabs(dy) < 0.1 ? "" : dy > 0 ? "downwards" : "upwards";
}

static json_t *zones_json(const struct live_engine *v, const struct visit *a)
{
    json_t *list = json_array();

    for (int i = 0; i < v->config.zones; i++)
        if (a->zones & 1u << i)
            json_array_append_new(list, json_string(v->config.zone[i].name));
    return list;
}

static json_t *crossings_json(const struct live_engine *v, const struct visit *a)
{
    json_t *list = json_array();

    for (int i = 0; i < a->crossings; i++) {
        const struct visit_crossing *c = &a->crossing[i];

        if (c->zone < v->config.zones)
            json_array_append_new(list, json_pack("{s:s, s:s, s:f}", "zone", v->config.zone[c->zone].name, "direction",
                                                  c->forward ? "forward" : "backward", "seconds",
                                                  round((double)(c->t_ns - a->from_ns) / 1e7) / 100));
    }
    return list;
}

static const struct visit_point *point_of(const struct visit *a, int i)
{
    return i < a->points ? &a->path[i] : &a->last;
}

/* Between leaves a head is seen in one set, legs in the next: the upper quartile of the lower edges around a point in
 * time is the foot, the mean of the middles the place. */
static struct visit_point path_point(const struct visit *a, int i)
{
    struct visit_point p = *point_of(a, i);
    const int64_t before_ns = p.t_ns - point_of(a, 0)->t_ns, after_ns = a->last.t_ns - p.t_ns;
    double y[VISIT_POINTS + 1], x = 0;
    int n = 0, middles = 0;

    for (int k = 0; a->hidden && k <= a->points; k++) {
        const struct visit_point *other = point_of(a, k);
        const int64_t apart_ns = llabs(other->t_ns - p.t_ns);

        if (apart_ns <= PATH_NS)
            y[n++] = other->y;
        if (apart_ns <= PATH_NS && apart_ns <= before_ns &&
            apart_ns <= after_ns) { /* as far before as after: a walker stays in place */
            x += other->x;
            middles++;
        }
    }
    if (n)
        p.y = sst_stats_quantile(y, n, 0.75);
    if (middles)
        p.x = x / middles;
    return p;
}

static json_t *path_json(const struct live_engine *v, const struct visit *a)
{
    json_t *list = json_array();

    const bool ends = a->points && a->path[a->points - 1].t_ns == a->last.t_ns; /* with the last place */

    for (int i = 0; i < a->points + !ends; i++) {
        const struct visit_point p = path_point(a, i);

        json_array_append_new(list, json_pack("[f, f, f, o]", round((double)(p.t_ns - a->from_ns) / 1e7) / 100,
                                              round(1e4 * p.x) / 1e4, round(1e4 * p.y) / 1e4,
                                              sst_api_real(engine_distance_m(v, p.disp_px))));
    }
    return list;
}

static void visit_name(char out[64], const struct visit *a)
{
    char when[SST_CLOCK_TEXT];

    sst_clock_text(when, a->from_wall_ns);
    for (char *c = when; *c; c++)
        *c = *c == ':' || *c == '.' ? '-' : *c;
    snprintf(out, 64, "%s-%u", when, a->id);
}

/* Address of the visit on the page; "": there is no page, or its address is not known. */
static void visit_page(char out[512], const struct sst_config *cfg, const char *name)
{
    char page[512];

    sst_config_page(page, cfg);
    out[0] = 0;
    if (page[0])
        snprintf(out, 512, "%.400s/#visit=%s", page, name);
}

static json_t *visit_json_locked(const struct live_engine *v, const struct visit *a, bool active)
{
    char name[64], from[SST_CLOCK_TEXT], to[SST_CLOCK_TEXT], page[512];

    visit_name(name, a);
    visit_page(page, &v->config, name);
    sst_clock_text(from, a->from_wall_ns);
    sst_clock_text(to, a->from_wall_ns + (a->last.t_ns - a->from_ns));
    return json_pack(
        "{s:s, s:s, s:b, s:b, s:s, s:s, s:s, s:s, s:f, s:s, s:o, s:o, s:o, s:o, s:o, s:[f, f, f, f], s:o, s:o}",
        "visit", name, "page", page, "active", active, "hidden", a->hidden, "label", engine_label_name(v, a->label),
        "label_by",
        !a->label    ? ""
        : a->by_size ? "size and motion"
                     : "network",
        "from", from, "to", to, "seconds", round((double)(a->last.t_ns - a->from_ns) / 1e8) / 10, "direction",
        direction(a), "zones", zones_json(v, a), "crossed", crossings_json(v, a), "distance_m",
        sst_api_real(engine_distance_m(v, a->last.disp_px)), "nearest_m",
        sst_api_real(engine_distance_m(v, a->nearest_px)), "nearest_px", sst_api_real(a->nearest_px), "box", a->box[0],
        a->box[1], a->box[2], a->box[3], "picture_s",
        a->pictures ? json_real(round((double)(a->picture_ns - a->from_ns) / 1e7) / 100) : json_null(), "path",
        path_json(v, a));
}

static void store(struct live_engine *v, const struct visit *a, enum sst_visit_picture kind,
                  const struct sst_image *image)
{
    char name[64];
    uint8_t *jpeg;
    size_t bytes;

    visit_name(name, a);
    if (!engine_jpeg(v, image, PICTURE_QUALITY, &jpeg, &bytes))
        sst_visits_put_picture(v->kept, name, kind, jpeg, bytes);
}

/* Where a thing is seen in this set, as fractions of the picture. @return the share of the picture that it takes; 0: it
 * is not seen */
static double seen_at(const struct live_engine *v, const struct sst_live_track *t, double box[4])
{
    const int width = v->state.width, height = v->state.height;

    if (t->state != SST_LIVE_TRACK_SEEN || width < 1 || height < 1)
        return 0;
    for (int i = 0; i < 4; i++)
        box[i] = sst_clamp_double(t->at[i] / (i % 2 ? height : width), 0, 1);
    return (box[2] - box[0]) * (box[3] - box[1]);
}

/* Has the camera of a view delivered its picture of this set? Its former picture stays in the light field. */
static bool is_fresh(const struct live_engine *v, int view)
{
    const struct sst_lightfield *lf = sst_live_lightfield(v->live);

    return v->input.frame[view].bytes && lf->views[view].present && lf->views[view].image.plane[0];
}

/* A better picture than the one before: the reference camera's, and see-through with the focus on the visitor.
 * Both, and the box, are of one set. */
static void take_pictures(struct live_engine *v, struct visit *a, const struct sst_live_track *t)
{
    double box[4];
    const double size = seen_at(v, t, box);
    const struct sst_lightfield *lf;
    struct view_settings settings;
    const struct sst_image *image;
    int64_t rendered_px;
    json_t *data;
    int err;

    if (!v->live || size <= PICTURE_BETTER * a->best || a->pictures == PICTURES_MOST ||
        (a->pictures && v->set_t_ns - a->picture_ns < PICTURE_NS))
        return;
    lf = sst_live_lightfield(v->live);
    if (a->of_camera && !is_fresh(v, lf->ref_view)) /* the picture of another set stays, and its box */
        return;
    pthread_mutex_lock(&v->lock);
    view_settings_defaults(&settings, &v->config.live);
    pthread_mutex_unlock(&v->lock);
    settings.render.method = SST_RENDER_SST;
    settings.render.focus_px = t->disp_px;
    err = v->visit_picture ? 0 : sst_livepicture_create(&v->visit_picture, v->live);
    err = err ? err : sst_livepicture_render(v->visit_picture, &settings.render, &image, &rendered_px);
    if (err)
        return;
    a->best = size;
    a->picture_ns = v->set_t_ns;
    a->pictures++;
    memcpy(a->box, box, sizeof(box));
    add_point(a, a->last, true);
    if (t->hidden && (!t->label || a->by_size)) { /* no view's labels show it */
        const int label = sst_live_recognise(v->live, image, t->at);

        a->label = label ? label : a->label;
        a->by_size &= !label;
    }
    store(v, a, SST_VISIT_SEEN, image);
    if (is_fresh(v, lf->ref_view)) {
        store(v, a, SST_VISIT_CAMERA, &lf->views[lf->ref_view].image);
        a->of_camera = true;
    }
    if (!a->announced) /* the event that follows has its box */
        return;
    pthread_mutex_lock(&v->lock);
    data = visit_json_locked(v, a, true);
    pthread_mutex_unlock(&v->lock);
    sst_visits_put(v->kept, data);
    json_decref(data);
}

static void emit(struct live_engine *v, const struct visit *a, bool active)
{
    char text[192] = "", what[SST_CLASS_NAME_MAX];
    const char *way;
    double near_m;
    json_t *data;

    pthread_mutex_lock(&v->lock);
    data = visit_json_locked(v, a, active);
    snprintf(what, sizeof(what), "%s", a->label ? engine_label_name(v, a->label) : "Something");
    near_m = engine_distance_m(v, active ? a->last.disp_px : a->nearest_px);
    v->state.visits += active && !a->announced;
    for (int i = 0; i < v->config.zones; i++)
        if (a->zones & 1u << i && !v->config.zone[i].line)
            sst_text_add(text, sizeof(text), "%s%s", *text ? ", " : " in ", v->config.zone[i].name);
    pthread_mutex_unlock(&v->lock);
    way = direction(a);
    if (!active)
        sst_text_add(text, sizeof(text), " for %.0f s%s%s", (double)(a->last.t_ns - a->from_ns) / 1e9, *way ? ", " : "",
                     way);
    if (!isnan(near_m))
        sst_text_add(text, sizeof(text), ", %s%.1f m away", active ? "" : "at least ", near_m);
    if (a->hidden)
        sst_text_add(text, sizeof(text), ", behind the foreground");
    sst_visits_put(v->kept, data);
    sst_events_emit(v->events, SST_EVENT_INFO, "visit", data, "%s %s%s", what,
                    !active        ? "was there"
                    : a->announced ? "is"
                                   : "came",
                    text);
}

/* A visit has crossed a line: an event of its own. */
static void cross(struct live_engine *v, struct visit *a, const struct visit_crossing *c)
{
    const char *way = c->forward ? "forward" : "backward";
    char name[64], page[512], zone[32] = "", what[SST_CLASS_NAME_MAX], text[64] = "";
    const double m = engine_distance_m(v, a->last.disp_px);
    json_t *data;

    if (a->crossings == VISIT_CROSSINGS)
        memmove(&a->crossing[0], &a->crossing[1], sizeof(*c) * (size_t)--a->crossings);
    a->crossing[a->crossings++] = *c;
    a->zones |= 1u << c->zone;
    visit_name(name, a);
    pthread_mutex_lock(&v->lock);
    data = visit_json_locked(v, a, true);
    visit_page(page, &v->config, name);
    if (c->zone < v->config.zones)
        snprintf(zone, sizeof(zone), "%s", v->config.zone[c->zone].name);
    snprintf(what, sizeof(what), "%s", a->label ? engine_label_name(v, a->label) : "Something");
    pthread_mutex_unlock(&v->lock);
    if (!isnan(m))
        sst_text_add(text, sizeof(text), ", %.1f m away", m);
    sst_visits_put(v->kept, data);
    json_decref(data);
    sst_events_emit(v->events, SST_EVENT_INFO, "line",
                    json_pack("{s:s, s:s, s:s, s:s, s:s, s:b, s:o}", "zone", zone, "direction", way, "visit", name,
                              "page", page, "label", a->label ? what : "", "hidden", a->hidden, "distance_m",
                              sst_api_real(m)),
                    "%s crossed %s %s%s%s", what, zone, way, text, a->hidden ? ", behind the foreground" : "");
}

static struct visit *find(struct live_engine *v, uint32_t id)
{
    for (int i = 0; i < v->visits; i++)
        if (v->visit[i].id == id)
            return &v->visit[i];
    return NULL;
}

/* The network's label counts before one by size and motion. */
static void set_label(const struct live_engine *v, struct visit *a, const struct sst_live_track *t)
{
    const struct sized *size = engine_sized(v, t->id);
    const bool by_size = size && size->by_size;

    if (!t->label || (by_size && a->label && !a->by_size))
        return;
    a->label = t->label;
    a->by_size = by_size;
}

/* --- visits that go on as another track --------------------------------------------------------------------------- */

static struct visit_lost lost_of(const struct visit *a)
{
    struct visit_lost lost = { .last = a->last, .label = a->label, .height_px = a->height_px };

    memcpy(lost.line, a->line, sizeof(lost.line));
    return lost;
}

static void lose(struct live_engine *v, const struct visit *a)
{
    if (v->losts == VISITS_LOST)
        memmove(v->lost, v->lost + 1, sizeof(*v->lost) * (size_t)--v->losts);
    v->lost[v->losts++] = lost_of(a);
}

/* How far a thing would have gone from where another was last, in its own heights a second; infinite: it is another. */
static double way_between(const struct live_engine *v, const struct visit_lost *from, const struct visit *to,
                          const struct visit_point *at)
{
    const double dt_s = (double)(at->t_ns - from->last.t_ns) / 1e9, far = at->disp_px / from->last.disp_px;
    const double dx = (at->x - from->last.x) * v->state.width, dy = (at->y - from->last.y) * v->state.height;
    const double height_px = fmax(from->height_px, to->height_px);

    if (!(dt_s > 0 && dt_s <= JOIN_S) || !(far < JOIN_RATIO && far > 1 / JOIN_RATIO) || !(height_px > 0) ||
        (from->label && to->label && from->label != to->label))
        return INFINITY;
    return hypot(dx, dy) / height_px / dt_s;
}

/* A track that begins where another was lost, or is not seen now, as things go: lines between the two places are
 * crossed. The last place, and the sides of lines there, go over to the new visit. @param from  out @return it does */
static bool join_lost(struct live_engine *v, struct visit *a, const struct visit_point *at, struct visit_point *from)
{
    struct visit_lost lost, best = { .height_px = 0 };
    double least = JOIN_HEIGHTS_S;
    int at_best = -1;

    for (int i = 0; i < v->losts + v->visits; i++) {
        struct visit *other = i < v->losts ? NULL : &v->visit[i - v->losts];

        if (other == a || (other && (!other->points || other->last.t_ns >= v->set_t_ns)))
            continue;
        lost = other ? lost_of(other) : v->lost[i];
        if (way_between(v, &lost, a, at) >= least)
            continue;
        least = way_between(v, &lost, a, at);
        best = lost;
        at_best = i;
    }
    if (at_best < 0)
        return false;
    *from = best.last;
    memcpy(a->line, best.line, sizeof(a->line));
    if (at_best >= v->losts) /* it crosses no line for a second time */
        memset(v->visit[at_best - v->losts].line, 0, sizeof(a->line));
    else
        memmove(&v->lost[at_best], &v->lost[at_best + 1], sizeof(best) * (size_t)(--v->losts - at_best));
    return true;
}

static void follow_visit(struct live_engine *v, struct visit *a, const struct sst_live_track *t, int64_t t_ns)
{
    struct visit_crossing crossing[SST_ZONES_MAX];
    struct visit_point from = a->last;
    int crossings = 0;
    unsigned before;
    bool masked;

    a->there = true;
    a->hidden |= t->hidden;
    set_label(v, a, t);
    if (t->state == SST_LIVE_TRACK_COVERED)
        return;
    a->last = foot(v, t, t_ns);
    a->height_px = t->y1 - t->y0;
    a->nearest_px = fmax(a->nearest_px, t->disp_px);
    before = a->zones;
    a->zones |= zones_at(v, a->last, a->label, &masked);
    if (a->points || join_lost(v, a, &a->last, &from))
        crossings = engine_lines_follow(v, a, &from, t->y1 - t->y0, crossing);
    add_point(a, a->last, false);
    take_pictures(v, a, t);
    if (a->announced && a->zones & ~before)
        emit(v, a, true);
    for (int i = 0; i < crossings; i++)
        cross(v, a, &crossing[i]);
}

void engine_visits_forget_zones(struct live_engine *v)
{
    for (int i = 0; i < v->visits; i++) {
        v->visit[i].zones = 0;
        v->visit[i].crossings = 0;
        v->losts = 0;
        memset(v->visit[i].line, 0, sizeof(v->visit[i].line));
    }
}

void engine_visits_follow(struct live_engine *v, const struct sst_live_track *track, int n)
{
    int kept = 0;

    for (int i = 0; i < v->visits; i++)
        v->visit[i].there = false;
    for (int i = 0; i < n; i++)
        if (find(v, track[i].id))
            find(v, track[i].id)->there = true;
    for (int i = 0; i < v->visits; i++)
        if (!v->visit[i].there)
            lose(v, &v->visit[i]); /* before others begin */
    for (int i = 0; i < n; i++) {
        struct visit *a = find(v, track[i].id);
        bool masked = false;

        if (!a)
            (void)zones_at(v, foot(v, &track[i], v->set_t_ns), track[i].label, &masked);
        if (masked) /* it comes when it leaves the mask */
            continue;
        if (a) {
            follow_visit(v, a, &track[i], v->set_t_ns);
        } else if (v->visits < SST_LIVE_TRACKS) {
            a = &v->visit[v->visits++];
            *a = (struct visit){ .id = track[i].id,
                                 .from_ns = track[i].first_ns,
                                 .from_wall_ns = v->set_wall_ns - (v->set_t_ns - track[i].first_ns) };
            follow_visit(v, a, &track[i], v->set_t_ns);
            emit(v, a, true);
            a->announced = true;
        }
    }
    for (int i = 0; i < v->visits; i++) {
        if (v->visit[i].there)
            v->visit[kept++] = v->visit[i];
        else
            emit(v, &v->visit[i], false);
    }
    v->visits = kept;
}

bool engine_visit_lasts_locked(const struct live_engine *v, const struct sst_record_trigger *t)
{
    bool lasts = false;

    for (int i = 0; i < v->visits; i++) {
        const struct visit *a = &v->visit[i];

        lasts |= (t->zone < 0 || a->zones & 1u << t->zone) &&
                 (!t->label[0] || !strcmp(t->label, engine_label_name(v, a->label)));
    }
    return lasts;
}
