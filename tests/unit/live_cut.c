/* The automatic cut of clear pictures: just behind the foreground of simulated scenes, by their truth, and in front of
 * everything that moves behind it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "pipeline/live/live_internal.h"
#include "simulators/scene/noise.h"
#include "simulators/scene/scene.h"
#include "tests/live_shown.h"
#include "tests/small.h"
#include "tests/test.h"

#define SECOND INT64_C(1000000000)

/* --- simulated scenes --------------------------------------------------------------------------------------------- */

/* A scene with its true maps, taken in once. */
static void show_scene(struct shown *s, const char *name, const struct sst_scene_config *like)
{
    struct sst_scene_config cfg = *like;
    struct sst_lightfield *lf;

    cfg.rows = cfg.cols = 6;
    show(s, NULL, cfg.width, cfg.height, cfg.rows, true);
    lf = &s->live->lf;
    assert_int_equal(sst_scene_create(&s->scene, name, &cfg), 0);
    sst_scene_range(s->scene, &lf->range_min_px, &lf->range_max_px);
    lf->disp_min_px = floor(lf->range_min_px);
    assert_int_equal(sst_parallel_for(lf->rows * lf->cols, 2, make_view, s), 0);
    s->live->ready = true;
    s->live->confirmed = 0.7; /* as in dense leaves */
    s->changes.whole = true;
    take(s, 1);
}

/* Nearest surface behind the cut, and the farthest one in front of it; of all views, less half a percent each: rays on
 * edges. */
static void around_cut(const struct shown *s, double cut, double *behind, double *front)
{
    const struct sst_lightfield *lf = &s->live->lf;
    const size_t room = (size_t)(lf->width * lf->height) * SST_RENDER_SAMPLED;
    double *far_px = calloc(room, sizeof(double)), *near_px = calloc(room, sizeof(double));
    int fars = 0, nears = 0;

    assert_true(far_px && near_px);
    for (int k = 0; k < s->live->sampled; k++) {
        const struct sst_map_u16 *disp = &lf->views[s->live->sample[k]].disp;

        for (int i = 0; i < lf->width * lf->height; i++) {
            const double d = sst_disp_px(lf, sst_map_u16_row(disp, i / lf->width)[i % lf->width]);

            *(d > cut ? &near_px[nears++] : &far_px[fars++]) = d;
        }
    }
    assert_true(nears > 0 && fars > 0);
    *behind = sst_stats_quantile(far_px, fars, 0.995);
    *front = sst_stats_quantile(near_px, nears, 0.005);
    free(far_px);
    free(near_px);
}

/* @return false: the scene has no gap */
static bool assert_near_end(const struct shown *s, const char *name, int seed)
{
    const double cut = sst_live_cut(s->live);
    double behind, front;

    if (isnan(cut))
        return false;
    around_cut(s, cut, &behind, &front);
    print_message("%s, seed %d: cut %.2f px, behind it %.2f, in front %.2f\n", name, seed, cut, behind, front);
    assert_true(behind < cut && cut < front);
    assert_true(front - cut <= 0.25 * (front - behind) + 0.5);
    return true;
}

static void scenes_are_cut_just_behind_the_foreground(void **state SST_UNUSED)
{
    static const char *const layered[] = { "bush", "pedestrian", "cell", "cat" };
    struct sst_scene_config cfg;

    sst_scene_config_defaults(&cfg);
    cfg.width = 120;
    cfg.height = 90;
    cfg.time_s = 1.2;
    for (const char *const *name = sst_scene_names(); *name; name++) {
        bool has = false;
        struct shown s;

        show_scene(&s, *name, &cfg);
        for (size_t i = 0; i < ARRAY_LEN(layered); i++)
            has |= !strcmp(*name, layered[i]);
        if (!assert_near_end(&s, *name, 1) && has)
            fail_msg("%s is not cut", *name);
        hide(&s);
    }
}

/* The layer in front covers 30 to 75 %, and is no mesh, which small views do not resolve. Truth: the scene without it,
 * which is behind the cut. */
static void random_layers_are_cut_just_behind_the_nearest(void **state SST_UNUSED)
{
    static const char *const kinds[] = { "leaves", "foliage", "branches", "slats", "crowd" };
    struct sst_scene_config cfg;

    sst_scene_config_defaults(&cfg);
    cfg.width = 88;
    cfg.height = 66;
    for (cfg.seed = 1; cfg.seed <= 20; cfg.seed++) {
        struct sst_map_f32 bare = { 0 };
        struct shown s;
        double most = 0;

        cfg.layers.kind = kinds[cfg.seed % ARRAY_LEN(kinds)];
        cfg.layers.cover_percent = 28 + 2.35 * (double)cfg.seed;
        show_scene(&s, "layers", &cfg);
        if (!assert_near_end(&s, cfg.layers.kind, (int)cfg.seed))
            fail_msg("layers of seed %d are not cut", (int)cfg.seed);
        assert_int_equal(sst_map_f32_init(&bare, cfg.width, cfg.height), 0);
        assert_int_equal(sst_scene_render(s.scene, 0, 0, ~0u, &(struct sst_scene_maps){ .disp = &bare }), 0);
        for (int i = 0; i < cfg.width * cfg.height; i++)
            most = fmax(most, (double)sst_map_f32_row(&bare, i / cfg.width)[i % cfg.width]);
        assert_true(most < sst_live_cut(s.live));
        sst_map_f32_fini(&bare);
        hide(&s);
    }
}

/* --- a hedge, a wall and people, by hand -------------------------------------------------------------------------- */

#define WIDTH  96
#define HEIGHT 64
#define WALL   3.4
#define HEDGE  17.0 /* its farthest leaves; the nearest are 6 px nearer */

/* Somebody 10 px wide, at a place and disparity. 0: nobody */
struct walker {
    double x, disp_px;
};

/* Disparity of a pixel: stripes of leaves over half of the picture, before people, before the wall. */
static double surface(const struct walker *who, int n, double front_px, int x, int y)
{
    double d = WALL + 0.2 * y / HEIGHT;

    for (int i = 0; i < n; i++)
        if (fabs(x - who[i].x) < 5 && y > 10)
            d = fmax(d, who[i].disp_px);
    return front_px > 0 && (x + y / 7) % 4 < 2 ? fmax(d, front_px + (x * 7 + y * 3) % 25 / 4.0) : d;
}

struct by_hand {
    const struct walker *who;
    int n;
    double front_px;
};

static double surface_by_hand(const void *scene, int x, int y)
{
    const struct by_hand *h = scene;

    return surface(h->who, h->n, h->front_px, x, y);
}

/* A set in which every view sees the same surfaces. */
static void put_surface(struct shown *s, double (*surface_of)(const void *, int, int), const void *scene, double min_px,
                        int64_t t_ns)
{
    struct sst_lightfield *lf = &s->live->lf;

    lf->disp_min_px = min_px;
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        struct sst_view *v = &lf->views[k];

        if (!v->image.plane[0])
            assert_int_equal(sst_image_init(&v->image, WIDTH, HEIGHT), 0);
        if (!v->disp.data)
            assert_int_equal(sst_map_u16_init(&v->disp, WIDTH, HEIGHT), 0);
        for (int y = 0; y < HEIGHT; y++)
            for (int x = 0; x < WIDTH; x++)
                sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(lf, surface_of(scene, x, y));
    }
    s->live->ready = s->changes.whole = true;
    s->live->confirmed = 0.7;
    take(s, t_ns);
}

static void put(struct shown *s, const struct walker *who, int n, double front_px, int64_t t_ns)
{
    put_surface(s, surface_by_hand, &(struct by_hand){ who, n, front_px }, 2, t_ns);
}

static struct sst_live_track track_of(const struct walker *w, bool hidden)
{
    return (struct sst_live_track){
        .id = 1, .hidden = hidden, .disp_px = w->disp_px, .x0 = w->x - 5, .y0 = 11, .x1 = w->x + 5, .y1 = HEIGHT
    };
}

static double begin(struct shown *s, const struct walker *who, int n, double front_px)
{
    show(s, NULL, WIDTH, HEIGHT, 3, false);
    put(s, who, n, front_px, SECOND);
    live_cut_guard(s->live, NULL, 0, SECOND);
    return sst_live_cut(s->live);
}

static void starts_do_not_matter(void **state SST_UNUSED)
{
    struct shown s;
    const double alone = begin(&s, NULL, 0, HEDGE);

    hide(&s);
    assert_true(alone > HEDGE - 2 && alone < HEDGE);
    for (double d = 4; d < 13; d += 0.7) { /* somebody passes while the service starts */
        const struct walker who = { 20 + 4 * d, d };
        const double cut = begin(&s, &who, 1, HEDGE);

        hide(&s);
        if (!(fabs(cut - alone) <= 0.8))
            fail_msg("%.2f px with somebody at %.1f px, %.2f without", cut, d, alone);
    }
}

static void who_moves_behind_the_hedge_stays(void **state SST_UNUSED)
{
    struct shown s;
    const double alone = begin(&s, NULL, 0, HEDGE);
    double before = alone;
    int needed = 0;

    for (int i = 0; i < 150; i++) { /* from the wall to the leaves; reported after 3 s */
        const struct walker who = { 10 + 0.5 * i, 4 + 0.085 * i };
        const struct sst_live_track t = track_of(&who, i % 3 > 0);
        const int64_t t_ns = (2 + i / 5) * SECOND + i % 5 * SECOND / 5;

        put(&s, &who, 1, HEDGE, t_ns);
        needed += live_cut_removes(s.live, &t, i >= 15);
        live_cut_guard(s.live, &t, i >= 15, t_ns);
        assert_false(live_cut_removes(s.live, &t, i >= 15));
        if (!(sst_live_cut(s.live) > who.disp_px))
            fail_msg("set %d: cut %.2f px removes somebody at %.2f px", i, sst_live_cut(s.live), who.disp_px);
        assert_true(sst_live_cut(s.live) >= before - 1e-9); /* steady: it gives way, and waits */
        before = sst_live_cut(s.live);
    }
    for (int i = 0; i < 5; i++) {
        put(&s, NULL, 0, HEDGE, (40 + i) * SECOND);
        live_cut_guard(s.live, NULL, 0, (40 + i) * SECOND);
    }
    assert_float_equal(sst_live_cut(s.live), alone, 1e-9);
    assert_in_range(needed, 1, 75); /* sets whose picture waits for tracks: less than half */
    hide(&s);
}

/* Leaves in front of a disparity that are behind the cut: fraction of all leaves. */
static double leaves_shown(const struct shown *s)
{
    int all = 0, shown = 0;

    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const double d = surface(NULL, 0, HEDGE, x, y);

            all += d >= HEDGE;
            shown += d >= HEDGE && d <= sst_live_cut(s->live);
        }
    }
    return (double)shown / all;
}

/* A hidden track that lies too near, of twigs or an image of the walker at the far end of the foreground: the accuracy
 * of its depth is no reason to show leaves in front of that. */
static void depths_among_leaves_show_few_of_them(void **state SST_UNUSED)
{
    static const double placed[] = { 16.2, HEDGE - 0.2, HEDGE + 0.4, HEDGE + 2 }, most[] = { 0.13, 0.13, 0.21, 0.49 };

    for (size_t i = 0; i < ARRAY_LEN(placed); i++) {
        const struct sst_live_track t = track_of(&(struct walker){ 50, placed[i] }, true);
        struct shown s;

        (void)begin(&s, NULL, 0, HEDGE);
        live_cut_guard(s.live, &t, 1, 2 * SECOND);
        print_message("hidden at %.2f px: cut %.2f px, %.2f of the leaves behind it\n", placed[i], sst_live_cut(s.live),
                      leaves_shown(&s));
        assert_false(live_cut_removes(s.live, &t, 1));
        assert_true(sst_live_cut(s.live) > placed[i]);
        assert_true(leaves_shown(&s) <= most[i]);
        hide(&s);
    }
}

/* Somebody without a track yet stands just behind the leaves. */
static void who_is_not_noticed_yet_stays(void **state SST_UNUSED)
{
    const struct walker who = { 50, HEDGE - 2.2 };
    struct shown s;
    const double alone = begin(&s, NULL, 0, HEDGE);

    for (int i = 0; i < 70; i++) {
        put(&s, &who, 1, HEDGE, (10 + i) * SECOND / 4 + 2 * SECOND);
        live_cut_guard(s.live, NULL, 0, (10 + i) * SECOND / 4 + 2 * SECOND);
        assert_float_equal(sst_live_cut(s.live), alone, 1e-9);
    }
    hide(&s);
}

static void the_foremost_is_removed_and_the_next_is_not(void **state SST_UNUSED)
{
    const struct walker who[2] = { { 30, 16 }, { 60, 9 } };
    const struct sst_live_track t[2] = { track_of(&who[0], false), track_of(&who[1], false) };
    struct shown s;

    assert_true(begin(&s, who, 1, 0) < who[0].disp_px);
    for (int i = 0; i < 20; i++) {
        put(&s, who, 2, 0, (2 + i) * SECOND);
        live_cut_guard(s.live, t, 2, (2 + i) * SECOND);
        assert_true(sst_live_cut(s.live) < who[0].disp_px && sst_live_cut(s.live) > who[1].disp_px);
    }
    for (int i = 0; i < 20; i++) { /* the first one has left: the other one is in front now */
        put(&s, who + 1, 1, 0, (30 + i) * SECOND);
        live_cut_guard(s.live, t + 1, 1, (30 + i) * SECOND);
    }
    assert_true(sst_live_cut(s.live) < who[1].disp_px && sst_live_cut(s.live) > WALL + 1);
    hide(&s);
}

static void somebody_before_the_hedge_leaves_it_removed(void **state SST_UNUSED)
{
    const struct walker who = { 40, 34 };
    const struct sst_live_track t = track_of(&who, false);
    struct shown s;
    const double alone = begin(&s, NULL, 0, HEDGE);

    for (int i = 0; i < 40; i++) {
        put(&s, &who, 1, HEDGE, (2 + i) * SECOND / 2);
        live_cut_guard(s.live, &t, 1, (2 + i) * SECOND / 2);
        assert_float_equal(sst_live_cut(s.live), alone, 1e-9);
    }
    hide(&s);
}

/* The search behind leaves reports a part of a body, at a rough depth. */
static void the_box_reaches_from_head_to_foot(void **state SST_UNUSED)
{
    const struct walker who = { 50, 10 };
    struct sst_live_track t = { .hidden = true, .disp_px = 11, .x0 = 44, .x1 = 54, .y0 = 30, .y1 = 42 }, far = t;
    struct shown s;

    (void)begin(&s, &who, 1, HEDGE);
    live_track_grow(s.live, &t);
    assert_float_equal(t.disp_px, who.disp_px, 0.2);
    assert_true(t.x0 >= 44 && t.x0 <= 48 && t.x1 >= 53 && t.x1 <= 56); /* 46 to 54 are its columns */
    assert_true(t.y0 >= 11 && t.y0 <= 14 && t.y1 >= HEIGHT - 3);
    assert_true(t.at[1] == t.y0 && t.at[3] == t.y1);
    far.x0 += 30; /* nobody is there: the box stays */
    far.x1 += 30;
    live_track_grow(s.live, &far);
    assert_true(far.disp_px == 11 && far.y0 == 30 && far.y1 == 42);
    hide(&s);
}

/* --- random fences, hedges, walls and people ---------------------------------------------------------------------- */

#define SETS     75 /* 15 s */
#define PEOPLE   5
#define SETTLING 5 /* sets of the start: a crowd may be the foreground, until it was seen to move */

struct layer {
    double px, depth_px; /* farthest surfaces, and how much nearer others are */
    int period, covers;  /* px: covers of period */
};

struct person {
    double from_px, to_px, half, bias; /* disparities; width; of reports, a fraction */
    int begin, end, notice;            /* sets */
    bool back, there;
    struct walker at;
};

struct random_scene {
    double wall_px, slope_px, smear; /* fraction of the rays with a wrong depth */
    struct layer front, middle;      /* middle.px 0: none */
    struct person who[PEOPLE];
    int people, set;
    uint64_t seed;
};

static uint32_t hash_of(int x, int y, int set)
{
    return (uint32_t)(x * 7919 + y * 104729 + set * 31337) * 2654435761u >> 12;
}

static double layer_at(const struct layer *l, int x, int y)
{
    return l->px > 0 && (x + y / 7) % l->period < l->covers ? l->px + l->depth_px * (hash_of(x, y, 0) % 64) / 64.0 : 0;
}

static double random_surface(const void *scene, int x, int y)
{
    const struct random_scene *r = scene;
    const uint32_t hash = hash_of(x, y, r->set);
    double d = r->wall_px + r->slope_px * y / HEIGHT;

    if (hash % 1000 < 1000 * r->smear)
        return r->wall_px + (r->front.px - r->wall_px) * (hash / 1000 % 128) / 128.0;
    for (int i = 0; i < r->people; i++)
        if (r->who[i].there && fabs(x - r->who[i].at.x) < r->who[i].half && y > 10)
            d = fmax(d, r->who[i].at.disp_px);
    return fmax(d, fmax(layer_at(&r->front, x, y), layer_at(&r->middle, x, y)));
}

/* A fence or a hedge, in every third scene another one behind it, and people between it and the wall, also where there
 * is no more than the accuracy of a depth between them and the leaves. */
static struct random_scene make_random(uint64_t number)
{
    struct random_scene r = { .seed = number * 104729 + 7 };
    uint64_t *seed = &r.seed;
    double far_px;

    r.wall_px = sst_random_in(seed, 0.5, 6);
    r.slope_px = sst_random_in(seed, 0, 1.5);
    r.smear = sst_random_in(seed, 0, 0.06);
    far_px = r.wall_px + r.slope_px;
    r.front.px = far_px + sst_random_in(seed, 6, 24);
    r.front.depth_px = sst_random_in(seed, 0.3, 8);
    r.front.period = 3 + (int)(sst_random(seed) * 9);
    r.front.covers = sst_max_int((int)lround(r.front.period * sst_random_in(seed, 0.15, 0.8)), 1);
    if (number % 3 == 0)
        r.middle = (struct layer){ .px = far_px + (r.front.px - far_px) * sst_random_in(seed, 0.3, 0.5),
                                   .depth_px = sst_random_in(seed, 0.3, 2),
                                   .period = r.front.period,
                                   .covers = 1 };
    r.people = 1 + (int)(sst_random(seed) * PEOPLE);
    for (int i = 0; i < r.people; i++) {
        struct person *p = &r.who[i];

        p->from_px = sst_random_in(seed, far_px + 1, r.front.px - 0.3);
        p->to_px = sst_random_in(seed, far_px + 1, r.front.px - 0.3);
        p->half = sst_random_in(seed, 2, 10);
        p->begin = (int)sst_random_in(seed, -20, SETS / 2);
        p->end = p->begin + (int)sst_random_in(seed, 30, 80);
        p->notice = p->begin + (int)sst_random_in(seed, 3, 15);
        p->bias = sst_random_in(seed, -0.06, 0.06);
        p->back = sst_random(seed) < 0.5;
    }
    return r;
}

/* @param track  out, [PEOPLE] @return number of tracks */
static int move_people(struct random_scene *r, int set, struct sst_live_track *track)
{
    int n = 0;

    r->set = set;
    for (int i = 0; i < r->people; i++) {
        struct person *p = &r->who[i];
        const double done = (double)(set - p->begin) / (p->end - p->begin);
        const bool hidden = sst_random(&r->seed) < 0.7;
        const double error = hidden ? p->bias + sst_random_in(&r->seed, -0.02, 0.02) : p->bias / 2;

        p->there = done >= 0 && done <= 1;
        p->at = (struct walker){ WIDTH * (p->back ? 1.1 - 1.2 * done : 1.2 * done - 0.1),
                                 p->from_px + (p->to_px - p->from_px) * done };
        if (!p->there || set < p->notice)
            continue;
        track[n] = track_of(&p->at, hidden);
        track[n].id = (uint32_t)i + 1;
        track[n].x0 = p->at.x - p->half;
        track[n].x1 = p->at.x + p->half;
        track[n++].disp_px *= 1 + error;
    }
    return n;
}

/* Persons with a track stay in the picture; without one, too, except just behind the leaves: maps place leaves there.
 */
static void assert_none_is_removed(const struct shown *s, const struct random_scene *r, int number)
{
    for (int i = 0; i < r->people; i++) {
        const struct person *p = &r->who[i];
        const bool noticed = r->set >= p->notice;

        if (p->there && (noticed || (r->set >= SETTLING && p->at.disp_px < r->front.px - 2.5)) &&
            isgreater(p->at.disp_px, sst_live_cut(s->live)))
            fail_msg("scene %d, set %d: cut %.2f px removes %d, %s, at %.2f px; wall %.2f, foreground from %.2f",
                     number, r->set, sst_live_cut(s->live), i, noticed ? "noticed" : "not noticed yet", p->at.disp_px,
                     r->wall_px + r->slope_px, r->front.px);
    }
}

static void who_passes_behind_random_foregrounds_stays(void **state SST_UNUSED)
{
    struct sst_live_track track[PEOPLE];

    for (int number = 301; number <= 330; number++) { /* 326: in the open, just behind a thin fence */
        struct random_scene r = make_random((uint64_t)number);
        struct shown s;
        double most = 0;

        show(&s, NULL, WIDTH, HEIGHT, 3, false);
        for (int set = 0; set < SETS; set++) {
            const int n = move_people(&r, set, track);

            put_surface(&s, random_surface, &r, floor(r.wall_px), SECOND + set * (SECOND / 5));
            live_cut_guard(s.live, track, n, SECOND + set * (SECOND / 5));
            assert_false(live_cut_removes(s.live, track, n));
            assert_none_is_removed(&s, &r, number);
            most = fmax(most, sst_live_cut(s.live));
        }
        print_message("scene %d: %d people, wall %.2f, foreground %.2f to %.2f px, %d of %d%s: cut at most %.2f px\n",
                      number, r.people, r.wall_px + r.slope_px, r.front.px, r.front.px + r.front.depth_px,
                      r.front.covers, r.front.period, r.middle.px > 0 ? ", another one behind it" : "", most);
        assert_true(most > r.wall_px + r.slope_px && most <= r.front.px * 1.08 + 1.25);
        hide(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        plain_test(scenes_are_cut_just_behind_the_foreground),
        plain_test(random_layers_are_cut_just_behind_the_nearest),
        cmocka_unit_test(starts_do_not_matter),
        cmocka_unit_test(who_moves_behind_the_hedge_stays),
        cmocka_unit_test(depths_among_leaves_show_few_of_them),
        cmocka_unit_test(who_is_not_noticed_yet_stays),
        cmocka_unit_test(the_foremost_is_removed_and_the_next_is_not),
        cmocka_unit_test(somebody_before_the_hedge_leaves_it_removed),
        cmocka_unit_test(the_box_reaches_from_head_to_foot),
        cmocka_unit_test(who_passes_behind_random_foregrounds_stays),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
