/* daemon/service/engine_visits.c, engine_lines.c: tracks, also of who is behind leaves, become visits in the events and
 * on disk: zones, direction, distance, and the lines that they cross. engine_views.c: views that share a picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"
#include "tests/folder.h"
#include "tests/test.h"

#define WIDTH  640
#define HEIGHT 480
#define TALL   120 /* px, of the visitor */
#define SET_NS INT64_C(500000000)

#define assert_near(a, b, within) assert_true(fabs((double)(a) - (double)(b)) <= (within))

static struct live_engine *v;
static struct sst_use_calibration calibration;
static uint64_t last;

static int setup(void **state)
{
    const int err = test_folder_create(state);

    v = calloc(1, sizeof(*v));
    assert_non_null(v);
    pthread_mutex_init(&v->lock, NULL);
    sst_config_defaults(&v->config);
    v->classes = sst_classes_default;
    v->state.width = WIDTH;
    v->state.height = HEIGHT;
    v->state.focal_px = 500;
    v->state.spacing_mm = 100;
    v->live_config.calibration = &calibration; /* distances are known: 50 m at 1 px */
    v->set_t_ns = INT64_C(100000000000);
    v->set_wall_ns = INT64_C(1795600000000000000);
    last = 0;
    assert_int_equal(sst_events_create(&v->events, 256), 0);
    assert_int_equal(sst_visits_open(&v->kept, test_path("visits"), 30), 0);
    return err;
}

static int teardown(void **state)
{
    sst_visits_close(v->kept, 5000);
    sst_events_destroy(v->events);
    pthread_mutex_destroy(&v->lock);
    free(v);
    return test_folder_remove(state);
}

static struct sst_zone *add_zone(const char *name, const char *points)
{
    struct sst_zone *z = &v->config.zone[v->config.zones++];
    double x[SST_ZONE_POINTS], y[SST_ZONE_POINTS];

    *z = (struct sst_zone){ .x1 = 1, .y1 = 1, .near_px = INFINITY, .far_px = -INFINITY };
    snprintf(z->name, sizeof(z->name), "%s", name);
    snprintf(z->points, sizeof(z->points), "%s", points);
    z->line = sst_zone_corners(z, x, y) == 2;
    engine_zones(v->live_config.zone, &v->config);
    v->live_config.zones = v->config.zones;
    return z;
}

/* A set in which somebody stands with the foot at a point. @param disp_px  0: nobody is there */
static void stand(double x, double y, double disp_px, bool hidden, int label)
{
    const struct sst_live_track t = { .id = 7,
                                      .state = SST_LIVE_TRACK_SEEN,
                                      .hidden = hidden,
                                      .label = label,
                                      .x0 = x - 20,
                                      .x1 = x + 20,
                                      .y0 = y - TALL,
                                      .y1 = y,
                                      .disp_px = disp_px,
                                      .first_ns = v->visits ? v->visit[0].from_ns : v->set_t_ns,
                                      .seen_ns = v->set_t_ns };

    engine_visits_follow(v, &t, disp_px > 0);
    v->set_t_ns += SET_NS;
    v->set_wall_ns += SET_NS;
}

static void walk(double x0, double y0, double x1, double y1, double disp_px, bool hidden, int label)
{
    for (int i = 0; i <= 20; i++)
        stand(x0 + (x1 - x0) * i / 20, y0 + (y1 - y0) * i / 20, disp_px, hidden, label);
}

/* The next event of a type; NULL: there is none. Its data is at `data`. */
static json_t *next(const char *type)
{
    char *text;

    while (sst_events_next(v->events, last, &last, &text)) {
        json_t *o = json_loads(text, 0, NULL);

        free(text);
        if (!strcmp(json_string_value(json_object_get(o, "type")), type))
            return o;
        json_decref(o);
    }
    return NULL;
}

static const char *text_of(const json_t *event, const char *key)
{
    return json_string_value(json_object_get(json_object_get(event, "data"), key));
}

static double number_of(const json_t *event, const char *key)
{
    return json_number_value(json_object_get(json_object_get(event, "data"), key));
}

/* Somebody walks by behind the leaves, farther and farther away. */
static void who_is_behind_leaves_is_a_visit(void **state)
{
    json_t *o, *data;
    char name[64];

    (void)state;
    add_zone("hedge", "0.5,0 1,0 1,1 0.5,1");
    walk(100, 400, 500, 400, 10, true, 0);
    stand(0, 0, 0, false, 0);
    o = next("visit"); /* it comes */
    assert_non_null(o);
    snprintf(name, sizeof(name), "%s", text_of(o, "visit"));
    assert_true(json_is_true(json_object_get(json_object_get(o, "data"), "hidden")));
    assert_true(json_is_true(json_object_get(json_object_get(o, "data"), "active")));
    assert_string_equal(text_of(o, "label"), "");
    assert_contains(json_string_value(json_object_get(o, "message")), "behind the foreground");
    json_decref(o);
    o = next("visit"); /* it enters the zone */
    assert_string_equal(json_string_value(json_array_get(json_object_get(json_object_get(o, "data"), "zones"), 0)),
                        "hedge");
    json_decref(o);
    o = next("visit"); /* it has gone */
    data = json_object_get(o, "data");
    assert_string_equal(text_of(o, "visit"), name);
    assert_false(json_is_true(json_object_get(data, "active")));
    assert_true(json_is_true(json_object_get(data, "hidden")));
    assert_string_equal(text_of(o, "direction"), "left to right");
    assert_near(number_of(o, "seconds"), 10, 0.01);
    assert_near(number_of(o, "nearest_m"), 5, 0.01);
    assert_near(number_of(o, "nearest_px"), 10, 0.01);
    assert_true(json_array_size(json_object_get(data, "path")) > 10);
    json_decref(o);
    assert_null(next("visit"));
    for (int i = 0; i < 1000; i++) { /* and so on disk */
        o = sst_visits_list(v->kept, &(struct sst_visits_query){ .limit = 10, .zone = "hedge" });
        if (json_array_size(o) == 1 && !json_is_true(json_object_get(json_array_get(o, 0), "active")))
            break;
        json_decref(o);
        o = NULL;
        usleep(5000);
    }
    assert_non_null(o);
    assert_string_equal(json_string_value(json_object_get(json_array_get(o, 0), "direction")), "left to right");
    json_decref(o);
}

/* Behind leaves now the head is seen, now the legs: the path follows the foot, which walks evenly. */
static void the_path_behind_leaves_is_even(void **state)
{
    static const int hidden_below[] = { 0, 90, 40, 70, 0, 60, 100 };
    json_t *o, *path, *point;
    size_t i;

    (void)state;
    add_zone("hedge", "0,0 1,0 1,1 0,1");
    for (int k = 0; k <= 28; k++)
        stand(100 + 16 * k, 440 - hidden_below[k % 7], 10, true, 0);
    stand(0, 0, 0, false, 0);
    do {
        o = next("visit");
        assert_non_null(o);
        path = json_object_get(json_object_get(o, "data"), "path");
        if (json_is_true(json_object_get(json_object_get(o, "data"), "active")))
            json_decref(o);
        else
            break;
    } while (true);
    assert_true(json_array_size(path) > 10);
    json_array_foreach(path, i, point)
    {
        const double s = json_number_value(json_array_get(point, 0)), x = json_number_value(json_array_get(point, 1));

        assert_near(x * WIDTH, 100 + 32 * s, 10);
        assert_near(json_number_value(json_array_get(point, 2)) * HEIGHT, 440, 41);
    }
    json_decref(o);
}

/* Depth alone: persons who come nearer, go away, and stand still behind leaves, where depth is known less well. */
static void directions_in_depth(void **state)
{
    static const struct {
        double from_px, to_px;
        const char *want;
    } way[] = { { 6, 12, "nearer" }, { 12, 6, "farther" }, { 6, 7.2, "" } };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(way); i++) {
        json_t *o, *gone = NULL;

        for (int k = 0; k <= 20; k++)
            stand(320, 400, way[i].from_px + (way[i].to_px - way[i].from_px) * k / 20, true, 0);
        stand(0, 0, 0, false, 0);
        while ((o = next("visit"))) {
            json_decref(gone);
            gone = o;
        }
        assert_string_equal(text_of(gone, "direction"), way[i].want);
        json_decref(gone);
    }
}

static void expect_line(const char *zone, const char *direction)
{
    json_t *o = next("line");

    if (!o)
        fail_msg("nothing crossed %s %s", zone, direction);
    assert_string_equal(text_of(o, "zone"), zone);
    assert_string_equal(text_of(o, "direction"), direction);
    assert_contains(json_string_value(json_object_get(o, "message")), zone);
    json_decref(o);
}

/* A line across the way, from the upper end to the lower: forward is to its right-hand side, the picture's left. */
static void lines_are_crossed_with_a_direction(void **state)
{
    const json_t *crossed;
    json_t *o;

    (void)state;
    add_zone("drive", "0.5,0.5 0.5,1");
    walk(100, 400, 500, 400, 10, true, 0);
    expect_line("drive", "backward");
    assert_true(engine_visit_lasts_locked(v, &(struct sst_record_trigger){ .zone = 0, .visit = true }));
    walk(500, 400, 100, 400, 10, true, 0);
    expect_line("drive", "forward");
    walk(100, 400, 100, 100, 10, true, 0); /* around its upper end */
    walk(100, 100, 500, 100, 10, true, 0);
    walk(500, 100, 500, 400, 10, true, 0);
    assert_null(next("line"));
    stand(0, 0, 0, false, 0);
    last = 0;
    for (o = NULL;;) {
        json_t *visit = next("visit");

        if (!visit)
            break;
        json_decref(o);
        o = visit;
    }
    crossed = json_object_get(json_object_get(o, "data"), "crossed");
    assert_int_equal(json_array_size(crossed), 2);
    assert_string_equal(json_string_value(json_object_get(json_array_get(crossed, 0), "direction")), "backward");
    assert_string_equal(json_string_value(json_object_get(json_array_get(crossed, 1), "zone")), "drive");
    assert_string_equal(json_string_value(json_array_get(json_object_get(json_object_get(o, "data"), "zones"), 0)),
                        "drive");
    json_decref(o);
}

/* A person who stands on a line, with a foot that is found a little to the left and to the right of it. */
static void who_stands_on_a_line_crosses_it_once(void **state)
{
    (void)state;
    add_zone("drive", "0.5,0.5 0.5,1");
    walk(200, 400, 316, 400, 10, false, 0);
    for (int i = 0; i < 40; i++)
        stand(i % 2 ? 317 : 323, 400, 10, false, 0);
    assert_null(next("line"));
    walk(320, 400, 500, 400, 10, false, 0);
    expect_line("drive", "backward");
    assert_null(next("line"));
}

/* Direction, depth and labels of a line; occluders, behind which the line is crossed unseen. */
static void lines_count_what_is_wanted(void **state)
{
    struct sst_zone *z;

    (void)state;
    z = add_zone("drive", "0.5,0.5 0.5,1");
    z->direction = SST_LINE_FORWARD;
    walk(100, 400, 500, 400, 10, false, 0);
    assert_null(next("line"));
    z->far_px = 11;
    walk(500, 400, 100, 400, 10, false, 0);
    assert_null(next("line"));
    z->far_px = -INFINITY;
    z->direction = SST_LINE_BOTH;
    snprintf(z->labels[0], sizeof(z->labels[0]), "Pedestrian");
    walk(100, 400, 500, 400, 10, false, 0);
    assert_null(next("line"));
    walk(500, 400, 100, 400, 10, false, SST_LABEL_PEDESTRIAN);
    expect_line("drive", "forward");
    stand(100, 400, 10, false, SST_LABEL_PEDESTRIAN);
    stand(500, 400, 10, false, SST_LABEL_PEDESTRIAN); /* was behind something meanwhile */
    expect_line("drive", "backward");
    engine_visits_forget_zones(v);
    assert_int_equal(v->visit[0].zones, 0);
    walk(500, 400, 100, 400, 10, false, SST_LABEL_PEDESTRIAN);
    expect_line("drive", "forward");
}

/* --- names by size and motion, removed things, pace ----------------------------------------------------------------
 */

/* Somebody of a size walks to the right, in 2 sets a second; named as on the live thread. @return the label of the
 * visit,
 * "": none */
static const char *named(double width_m, double height_m, double m_s, bool hidden)
{
    static char label[SST_CLASS_NAME_MAX];
    const double px_m = 10 / 0.1; /* at 10 px: 5 m away */

    for (int i = 0; i <= 12; i++) {
        struct sst_live_track t = { .id = 9, .hidden = hidden, .disp_px = 10, .first_ns = v->set_t_ns };

        t.x0 = 60 + m_s * 0.5 * i * px_m;
        t.x1 = t.x0 + width_m * px_m;
        t.y1 = 460;
        t.y0 = 460 - height_m * px_m;
        v->set_t_ns += SET_NS;
        if (t.x1 > WIDTH - 5) /* it leaves the picture */
            break;
        engine_names_follow(v, &t, 1);
        engine_visits_follow(v, &t, 1);
        snprintf(label, sizeof(label), "%s", engine_label_name(v, t.label));
        assert_string_equal(engine_named_by(v, &t), t.label ? "size and motion" : "");
    }
    engine_names_follow(v, NULL, 0);
    engine_visits_follow(v, NULL, 0);
    return label;
}

static void persons_are_named_by_size_and_motion(void **state)
{
    struct sst_live_track t = { .id = 11, .label = 9, .disp_px = 10, .x0 = 100, .x1 = 150, .y0 = 200, .y1 = 380 };
    json_t *o, *found = NULL;

    (void)state;
    v->live = (struct sst_live *)v; /* not looked into */
    assert_string_equal(named(0.6, 1.8, 0.6, true), "Pedestrian");
    while ((o = next("visit"))) {
        json_decref(found);
        found = o;
    }
    assert_string_equal(text_of(found, "label"), "Pedestrian");
    assert_string_equal(text_of(found, "label_by"), "size and motion");
    json_decref(found);
    assert_string_equal(named(0.9, 1.3, 0.5, false), "Pedestrian");
    assert_string_equal(named(0.6, 2.6, 0.6, true), "");  /* too tall */
    assert_string_equal(named(0.5, 0.6, 0.6, false), ""); /* a dog */
    assert_string_equal(named(1.9, 1.5, 0.5, false), ""); /* not upright */
    assert_string_equal(named(0.6, 1.8, 0.1, true), "");  /* it stands, or sways */
    assert_string_equal(named(0.6, 1.8, 6.0, false), ""); /* faster than anybody walks */
    v->live_config.calibration = NULL;                    /* sizes are not known */
    assert_string_equal(named(0.6, 1.8, 0.6, true), "");
    engine_names_follow(v, &t, 1);
    assert_int_equal(t.label, 9); /* the network's stays */
    assert_string_equal(engine_named_by(v, &t), "network");
    v->live = NULL;
}

static void removed_tracks_are_reported(void **state)
{
    (void)state;
    v->state.cut_px = 8;
    v->track[0] =
        (struct sst_live_track){ .id = 3, .label = sst_classes_find(&v->classes, "Pedestrian"), .disp_px = 11.4 };
    v->track[1] = (struct sst_live_track){ .id = 4, .disp_px = 7 };
    v->tracks = 2;
    engine_removed_locked(v);
    assert_int_equal(v->state.removed_count, 1);
    assert_int_equal(v->state.removed[0].track, 3);
    assert_string_equal(v->state.removed[0].name, "Pedestrian");
    assert_near(v->state.removed[0].distance_m, 4.4, 0.05);
    assert_contains(v->state.removed_text, "1 person removed, 4.4 m");
    v->state.cut_px = 6;
    engine_removed_locked(v);
    assert_contains(v->state.removed_text, "2 moving things removed, the nearest 4.4 m");
    v->state.cut_px = NAN; /* nothing is cut */
    engine_removed_locked(v);
    assert_true(!v->state.removed_count && !v->state.removed_text[0]);
}

/* Seconds with so many processed and passed sets, up to now. */
static void pace(uint64_t taken, uint64_t passed)
{
    const int64_t now_s = sst_clock_now_ns() / 1000000000;

    for (int i = 0; i < RATE_SLOTS; i++)
        v->second[(now_s - i) % RATE_SLOTS] = (struct second){ .s = now_s - i, .taken = taken, .passed = passed };
    v->pace_s = 0;
    engine_pace_follow(v);
}

static void too_slow_is_noticed(void **state)
{
    json_t *o;

    (void)state;
    assert_true(engine_pace_slow(0.3, 5, false)); /* below 2 a second */
    assert_true(engine_pace_slow(4, 10, false));  /* more than half are passed over */
    assert_false(engine_pace_slow(6, 10, false));
    assert_true(engine_pace_slow(6, 10, true)); /* that ends later than it begins */
    assert_false(engine_pace_slow(7, 10, true));
    assert_false(engine_pace_slow(1, 1, false)); /* no more come */
    v->live = (struct sst_live *)v;              /* not looked into */
    v->state.ready = true;
    pace(1, 4);
    assert_false(v->state.too_slow); /* it has only started */
    v->pace_from_s = 1;
    pace(1, 4);
    assert_false(v->state.too_slow); /* not at once */
    v->pace_turn_s -= 5;
    pace(1, 4);
    assert_true(v->state.too_slow);
    assert_contains(v->state.slow_text, "1.0 of 5.0 sets a second");
    o = next("too-slow");
    assert_non_null(o);
    assert_true(json_is_true(json_object_get(json_object_get(o, "data"), "active")));
    assert_string_equal(json_string_value(json_object_get(o, "level")), "warning");
    json_decref(o);
    pace(5, 0);
    v->pace_turn_s -= 9;
    pace(5, 0);
    assert_true(v->state.too_slow); /* nor does it end at once */
    v->pace_turn_s -= 2;
    pace(5, 0);
    assert_false(v->state.too_slow);
    v->config.live.rate_hz = 3; /* as the service was told */
    pace(3, 7);
    v->pace_turn_s -= v->pace_turn_s ? 9 : 0;
    pace(3, 7);
    assert_false(v->state.too_slow);
    v->live = NULL;
}

/* Boxes end by the time of the last sighting: of this set, or of the one in which the track was seen last. */
/* Boxes of /api/v1/tracks that are no tracks yet. */
static json_t *unconfirmed(void)
{
    struct sst_api_answer answer = { 0 };
    json_t *list;

    assert_int_equal(engine_tracks(v, &answer), 0);
    list = json_incref(json_object_get(answer.body, "unconfirmed"));
    json_decref(answer.body);
    assert_true(json_is_array(list));
    return list;
}

/* A set with something that came into the clear picture, or not. @return unconfirmed ones */
static size_t come(double x, double disp_px, json_t **first)
{
    static json_t *kept;
    json_t *list;
    size_t n;

    const struct sst_livepicture_clear shown = { .arrivals = disp_px > 0,
                                                 .arrival = { { { x, 200, x + 40, 350 }, disp_px } } };

    engine_unconfirmed_follow_locked(v, &shown);
    engine_unconfirmed_follow_locked(v, &shown); /* of another view */
    list = unconfirmed();
    n = json_array_size(list); /* known with the picture, before its tracks */
    json_decref(list);
    engine_tracks_follow(v);
    v->set_t_ns += SET_NS;
    v->set_wall_ns += SET_NS;
    list = unconfirmed();
    assert_int_equal(json_array_size(list), n);
    json_decref(kept);
    kept = n ? json_incref(json_array_get(list, 0)) : NULL;
    json_decref(list);
    if (first)
        *first = kept;
    return n;
}

static void what_comes_has_a_box_before_its_track(void **state SST_UNUSED)
{
    const struct sst_live_track t = {
        .id = 7, .hidden = true, .at = { 190, 210, 240, 330 }, .disp_px = 9, .seen_ns = v->set_t_ns
    };
    struct sst_livepicture_clear shown = { .arrivals = 1, .arrival = { { { 200, 200, 240, 350 }, 10 } } };
    json_int_t id;
    json_t *u;

    assert_int_equal(come(100, 10, &u), 1);
    id = json_integer_value(json_object_get(u, "id"));
    assert_true(fabs(json_number_value(json_object_get(u, "distance_m")) - 5) < 1e-9);
    assert_int_equal(come(140, 10, &u), 1); /* it goes on */
    assert_int_equal(json_integer_value(json_object_get(u, "id")), id);
    assert_true(fabs(json_number_value(json_array_get(json_object_get(u, "box"), 0)) - 140) < 1e-9);
    assert_int_equal(come(0, 0, NULL), 1); /* half a second without news, and a second */
    assert_int_equal(come(0, 0, NULL), 0);
    assert_int_equal(come(140, 10, &u), 1);
    assert_int_not_equal(json_integer_value(json_object_get(u, "id")), id);
    assert_int_equal(come(400, 10, NULL), 2); /* another one */
    assert_int_equal(come(400, 20, NULL), 2); /* and one nearer */
    assert_null(next("visit"));               /* nothing comes of boxes */

    v->unconfirmeds = 0;
    v->track[0] = t;
    v->tracks = 1;
    engine_unconfirmed_follow_locked(v, &shown);
    assert_int_equal(v->unconfirmeds, 1);
    assert_int_equal(v->unconfirmed[0].track, 7); /* which the slower search has not seen there yet */
    v->track[0].seen_ns = v->set_t_ns + 1;
    engine_unconfirmed_follow_locked(v, NULL);
    assert_int_equal(v->unconfirmeds, 0);
    v->set_t_ns += SET_NS;
    shown.arrival[0].disp_px = 15;
    engine_unconfirmed_follow_locked(v, &shown);
    assert_int_equal(v->unconfirmeds, 1);
    assert_int_equal(v->unconfirmed[0].track, 0);
    v->set_t_ns -= 2 * SET_NS; /* a recording is played again */
    engine_unconfirmed_follow_locked(v, NULL);
    assert_int_equal(v->unconfirmeds, 0);
}

static void tracks_say_when_they_were_seen(void **state)
{
    struct sst_live_track t = { .id = 12, .state = SST_LIVE_TRACK_SEEN, .seen_ns = 4 * SET_NS };
    json_t *o;

    v->tracks_t_ns = 6 * SET_NS;
    v->tracks_wall_ns = INT64_C(1700000000000000000) + 6 * SET_NS;
    for (int covered = 0; covered <= 1; covered++) {
        char expected[SST_CLOCK_TEXT];

        t.state = covered ? SST_LIVE_TRACK_COVERED : SST_LIVE_TRACK_STILL;
        sst_clock_text(expected, v->tracks_wall_ns - (covered ? 2 * SET_NS : 0));
        o = engine_track_json_locked(v, &t);
        assert_string_equal(json_string_value(json_object_get(o, "seen")), expected);
        json_decref(o);
    }
    (void)state;
}

/* --- crossings over a gap ------------------------------------------------------------------------------------------
 */

/* A new track with its foot at a point. */
static void stand_as(uint32_t id, double x, double disp_px)
{
    const struct sst_live_track t = { .id = id,
                                      .x0 = x - 20,
                                      .x1 = x + 20,
                                      .y0 = 400 - TALL,
                                      .y1 = 400,
                                      .disp_px = disp_px,
                                      .first_ns = v->set_t_ns,
                                      .seen_ns = v->set_t_ns };

    engine_visits_follow(v, &t, 1);
    v->set_t_ns += SET_NS;
    v->set_wall_ns += SET_NS;
}

/* @return crossings of a walker lost at one place and found at another, some sets later */
static int crossed(double lost_x, double found_x, double found_px, int sets)
{
    int n = 0;

    for (int i = 0; i < 4; i++)
        stand_as(21, lost_x - 60 + 20 * i, 10);
    for (int i = 0; i < sets; i++) {
        engine_visits_follow(v, NULL, 0);
        v->set_t_ns += SET_NS;
    }
    for (int i = 0; i < 4; i++)
        stand_as(22, found_x + 20 * i, found_px);
    engine_visits_follow(v, NULL, 0);
    v->losts = 0;
    for (json_t *o; (o = next("line")); n++) {
        assert_string_equal(text_of(o, "direction"), "backward");
        json_decref(o);
    }
    return n;
}

static void who_is_lost_at_a_line_crosses_it(void **state)
{
    (void)state;
    add_zone("gate", "0.5,0 0.5,1");
    assert_int_equal(crossed(200, 440, 10, 2), 1);
    assert_int_equal(crossed(200, 440, 11.5, 2), 1);
    assert_int_equal(crossed(200, 440, 16, 2), 0);  /* another one, elsewhere */
    assert_int_equal(crossed(200, 240, 10, 2), 0);  /* before the line */
    assert_int_equal(crossed(200, 600, 10, 0), 0);  /* 400 px in half a second */
    assert_int_equal(crossed(200, 440, 10, 40), 0); /* 20 s later */
}

/* Outlines and tint are drawn over a shared picture. */
static void views_share_the_picture_of_main(void **state SST_UNUSED)
{
    struct view *m = &v->view[0], *e = &v->view[1];
    struct view_settings settings;

    view_settings_defaults(&settings, &v->config.live);
    m->used = e->used = true;
    m->settings = settings;
    settings.tint = settings.outline = true;
    settings.outline_moving = !settings.outline_moving;
    assert_true(engine_view_shows_main(v, e, &settings));
    assert_false(engine_view_shows_main(v, m, &settings));
    settings.render.cut_px = 7;
    assert_false(engine_view_shows_main(v, e, &settings));
    settings.render.cut_px = m->settings.render.cut_px;
    e->alone = true; /* something was removed from it */
    assert_false(engine_view_shows_main(v, e, &settings));
    e->alone = false;
    m->shown.objects = 1;
    assert_false(engine_view_shows_main(v, e, &settings));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(who_is_behind_leaves_is_a_visit, setup, teardown),
        cmocka_unit_test_setup_teardown(the_path_behind_leaves_is_even, setup, teardown),
        cmocka_unit_test_setup_teardown(directions_in_depth, setup, teardown),
        cmocka_unit_test_setup_teardown(lines_are_crossed_with_a_direction, setup, teardown),
        cmocka_unit_test_setup_teardown(who_stands_on_a_line_crosses_it_once, setup, teardown),
        cmocka_unit_test_setup_teardown(lines_count_what_is_wanted, setup, teardown),
        cmocka_unit_test_setup_teardown(persons_are_named_by_size_and_motion, setup, teardown),
        cmocka_unit_test_setup_teardown(removed_tracks_are_reported, setup, teardown),
        cmocka_unit_test_setup_teardown(too_slow_is_noticed, setup, teardown),
        cmocka_unit_test_setup_teardown(what_comes_has_a_box_before_its_track, setup, teardown),
        cmocka_unit_test_setup_teardown(tracks_say_when_they_were_seen, setup, teardown),
        cmocka_unit_test_setup_teardown(who_is_lost_at_a_line_crosses_it, setup, teardown),
        cmocka_unit_test_setup_teardown(views_share_the_picture_of_main, setup, teardown),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
