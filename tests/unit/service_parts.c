/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/jpeg_slot.h"
#include "base/log.h"
#include "capture/array/ring.h"
#include "daemon/events/events.h"
#include "daemon/publish/api.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"
#include "tests/test.h"

/* --- ring --------------------------------------------------------------------------------------------------------- */

static int put(struct sst_ring *r, int cameras, size_t bytes, uint64_t index, int missing)
{
    static uint8_t data[1 << 16];
    static struct sst_frame frame[8];
    struct sst_frameset set = { .index = index, .t_ns = (int64_t)index * 1000, .cameras = cameras };

    memset(data, (int)index & 255, sizeof(data));
    for (int i = 0; i < cameras; i++) {
        frame[i] = (struct sst_frame){ .cam = i, .data = data, .bytes = bytes };
        set.frame[i] = i == missing ? NULL : &frame[i];
        set.present += i != missing;
    }
    return sst_ring_put(r, &set);
}

static void ring_keeps_the_newest(void **state)
{
    struct sst_ring_counters n;
    struct sst_ring *r;
    const struct sst_kept *k;
    uint64_t dropped = 7;

    (void)state;
    assert_int_equal(sst_ring_create(&r, 0), -EINVAL);
    assert_int_equal(sst_ring_create(&r, 100000), 0);
    assert_null(sst_ring_get(r, 0));
    assert_null(sst_ring_newest(r, 0, &dropped));
    assert_false(sst_ring_wait(r, 0, 1));
    for (uint64_t i = 1; i <= 50; i++)
        assert_int_equal(put(r, 4, 3000, i, -1), 0);
    sst_ring_counters(r, &n);
    assert_int_equal(n.kept, 50);
    assert_true(n.sets >= 5 && n.sets <= 8);
    assert_int_equal(n.bytes, n.sets * 12000);
    k = sst_ring_get(r, 1); /* gone: the oldest that is there */
    assert_int_equal(k->number, 50 - n.sets + 1);
    assert_int_equal(n.oldest_ns, k->set.t_ns);
    assert_int_equal(k->set.frame[3]->data[2999], k->set.index & 255);
    sst_ring_unref(r, k);
    k = sst_ring_newest(r, 40, &dropped);
    assert_int_equal(k->number, 50);
    assert_int_equal(dropped, 9);
    sst_ring_unref(r, k);
    assert_null(sst_ring_newest(r, 50, &dropped));
    assert_true(sst_ring_wait(r, 49, 0));
    sst_ring_shut(r);
    assert_false(sst_ring_wait(r, 50, 10000));
    sst_ring_destroy(r);
}

/* A recording that is being read stays as it is, however long, and the others go on. */
static void ring_survives_slow_readers(void **state)
{
    const struct sst_kept *held[2], *k;
    struct sst_ring *r;
    uint64_t dropped;

    (void)state;
    assert_int_equal(sst_ring_create(&r, 100000), 0);
    assert_int_equal(put(r, 4, 3000, 1, -1), 0);
    assert_int_equal(put(r, 4, 3000, 2, -1), 0);
    held[0] = sst_ring_get(r, 2);
    assert_int_equal(put(r, 4, 3000, 3, -1), 0);
    assert_int_equal(put(r, 4, 3000, 4, -1), 0);
    held[1] = sst_ring_get(r, 4);
    for (uint64_t i = 5; i <= 200; i++)
        assert_int_equal(put(r, 4, (size_t)(1000 + 37 * (i % 50)), i, -1), 0);
    assert_int_equal(held[0]->set.index, 2);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(held[0]->set.frame[i]->data[0], 2);
        assert_int_equal(held[0]->set.frame[i]->data[2999], 2);
        assert_int_equal(held[1]->set.frame[i]->data[2999], 4);
    }
    k = sst_ring_newest(r, 0, &dropped);
    assert_int_equal(k->number, 200);
    sst_ring_unref(r, k);
    /* larger than everything, and larger than the free room between the two */
    assert_int_equal(put(r, 4, 60000, 201, -1), -ENOBUFS);
    sst_ring_unref(r, held[0]);
    sst_ring_unref(r, held[1]);
    assert_int_equal(put(r, 4, 20000, 202, -1), 0);
    sst_ring_destroy(r);
}

/* Hidden sets are found by nobody, also ones that somebody still reads; later ones are. */
static void ring_forgets(void **state)
{
    const struct sst_kept *held, *k;
    struct sst_ring_counters n;
    struct sst_ring *r;
    uint64_t dropped;

    (void)state;
    assert_int_equal(sst_ring_create(&r, 100000), 0);
    for (uint64_t i = 1; i <= 4; i++)
        assert_int_equal(put(r, 4, 1000, i, -1), 0);
    held = sst_ring_get(r, 3);
    sst_ring_forget(r);
    assert_null(sst_ring_get(r, 0));
    assert_null(sst_ring_get(r, 1));
    assert_null(sst_ring_newest(r, 0, &dropped));
    sst_ring_counters(r, &n);
    assert_int_equal(n.sets, 1); /* in use */
    assert_int_equal(held->set.frame[3]->data[999], 3);
    assert_int_equal(put(r, 4, 1000, 5, -1), 0);
    k = sst_ring_get(r, 1);
    assert_int_equal(k->number, 5);
    sst_ring_unref(r, k);
    k = sst_ring_newest(r, 0, &dropped);
    assert_int_equal(k->number, 5);
    sst_ring_unref(r, k);
    sst_ring_unref(r, held);
    sst_ring_destroy(r);
}

static void ring_prefers_complete_sets(void **state)
{
    const struct sst_kept *k;
    struct sst_ring *r;
    uint64_t dropped;

    (void)state;
    assert_int_equal(sst_ring_create(&r, 1 << 20), 0);
    assert_int_equal(put(r, 3, 0, 1, -1), 0);
    assert_int_equal(put(r, 3, 100, 2, 1), 0);
    k = sst_ring_newest(r, 0, &dropped);
    assert_int_equal(k->number, 1);
    assert_int_equal(k->set.frame[0]->bytes, 0);
    sst_ring_unref(r, k);
    k = sst_ring_newest(r, 1, &dropped);
    assert_int_equal(k->number, 2);
    assert_null(k->set.frame[1]);
    sst_ring_unref(r, k);
    sst_ring_destroy(r);
}

static void *read_ring(void *arg)
{
    struct sst_ring *r = arg;
    uint64_t last = 0, dropped;

    while (sst_ring_wait(r, last, 2000)) {
        const struct sst_kept *k = sst_ring_newest(r, last, &dropped);

        if (!k)
            continue;
        for (int i = 0; i < 4; i++)
            if (k->set.frame[i]->data[k->set.frame[i]->bytes - 1] != (k->set.index & 255))
                abort();
        last = k->number;
        sst_ring_unref(r, k);
    }
    return NULL;
}

static void ring_with_threads(void **state)
{
    pthread_t readers[3];
    struct sst_ring *r;

    (void)state;
    assert_int_equal(sst_ring_create(&r, 200000), 0);
    for (int i = 0; i < 3; i++)
        assert_int_equal(pthread_create(&readers[i], NULL, read_ring, r), 0);
    for (uint64_t i = 1; i <= 3000; i++)
        assert_int_equal(put(r, 4, 1 + i * 7 % 5000, i, -1), 0);
    sst_ring_shut(r);
    for (int i = 0; i < 3; i++)
        pthread_join(readers[i], NULL);
    sst_ring_destroy(r);
}

/* --- slot ------------------------------------------------------------------------------------------------------- */

static void count(void *arg)
{
    ++*(int *)arg;
}

static void outlet_shows_the_newest(void **state)
{
    const struct sst_jpeg *a, *b;
    struct sst_slot *o;

    (void)state;
    assert_int_equal(sst_slot_create(&o), 0);
    assert_null(sst_slot_get(o, 0));
    assert_int_equal(sst_slot_put(o, (uint8_t *)strdup("one"), 3, 11, 5, 6), 0);
    a = sst_slot_get(o, 0);
    assert_int_equal(sst_slot_put(o, (uint8_t *)strdup("two"), 3, 12, 5, 6), 0);
    b = sst_slot_get(o, a->number);
    assert_memory_equal(a->data, "one", 3);
    assert_memory_equal(b->data, "two", 3);
    assert_int_equal(b->number, 2);
    assert_int_equal(b->set, 12);
    assert_null(sst_slot_get(o, 2));
    sst_slot_jpeg_unref(a);
    sst_slot_jpeg_unref(b);
    assert_true(sst_slot_wait(o, 1, 0));
    assert_false(sst_slot_wait(o, 2, 1));
    sst_slot_shut(o);
    assert_false(sst_slot_wait(o, 2, 10000));
    sst_slot_join(o);
    assert_int_equal(sst_slot_clients(o), 1);
    sst_slot_unref(sst_slot_ref(o));
    sst_slot_unref(o);
}

/* --- events ------------------------------------------------------------------------------------------------------- */

static void events_are_kept_in_order(void **state)
{
    struct sst_events *e;
    uint64_t id = 0, levels[3];
    char *line = NULL, held[SST_LOG_MAX] = "";
    int told = 0, n = 0;
    json_t *o;

    (void)state;
    sst_log_set_level(SST_LOG_ERROR);
    unsetenv("JOURNAL_STREAM");
    assert_int_equal(sst_events_create(&e, 4), 0);
    assert_int_equal(sst_events_watch(e, count, &told), 0);
    assert_false(sst_events_next(e, 0, &id, &line));
    for (int i = 1; i <= 6; i++)
        sst_events_emit(e, SST_EVENT_WARNING, "camera-lost", json_pack("{s:i, s:i}", "row", i, "col", 2),
                        "camera %d \"went\"", i);
    while (sst_events_next(e, id, &id, &line)) {
        o = json_loads(line, 0, NULL);
        assert_int_equal(json_integer_value(json_object_get(o, "id")), 3 + n++);
        assert_int_equal(json_integer_value(json_object_get(json_object_get(o, "data"), "row")), 2 + n);
        assert_string_equal(json_string_value(json_object_get(o, "level")), "warning");
        json_decref(o);
        free(line);
    }
    assert_int_equal(n, 4);
    assert_int_equal(told, 6);
    sst_events_emit(e, SST_EVENT_INFO, "state", NULL, "bad \xff bytes");
    assert_null(sst_log_hold_errors(held)); /* an event is shown, whatever its thread keeps back */
    sst_events_emit(e, SST_EVENT_ERROR, "trigger-lost", NULL, "the trigger is gone, as this test tells");
    assert_ptr_equal(sst_log_hold_errors(NULL), held);
    assert_string_equal(held, "");
    sst_events_counts(e, levels);
    assert_int_equal(levels[SST_EVENT_WARNING], 6);
    assert_int_equal(levels[SST_EVENT_ERROR], 1);
    assert_int_equal(levels[SST_EVENT_INFO], 1);
    assert_true(sst_events_wait(e, 3, 0));
    sst_events_shut(e);
    assert_false(sst_events_wait(e, 100, 10000));
    sst_events_unwatch(e, count, &told);
    sst_events_destroy(e);
}

static void wall_time_as_text(void **state)
{
    char text[SST_CLOCK_TEXT];
    int64_t wall_ns;

    (void)state;
    sst_clock_text(text, 0);
    assert_string_equal(text, "1970-01-01T00:00:00.000Z");
    sst_clock_text(text, INT64_C(1763748300123456789));
    assert_string_equal(text, "2025-11-21T18:05:00.123Z");
    sst_clock_text(text, -1000000);
    assert_string_equal(text, "1969-12-31T23:59:59.999Z");
    assert_true(sst_clock_read("2028-02-29T23:59:59.5Z", &wall_ns));
    sst_clock_text(text, wall_ns);
    assert_string_equal(text, "2028-02-29T23:59:59.500Z");
    assert_false(sst_clock_read("2027-02-29T00:00:00Z", &wall_ns));
    assert_false(sst_clock_read("2026-11-31T00:00:00Z", &wall_ns));
    assert_true(sst_clock_begins_with_day("2000-02-29T"));
    assert_false(sst_clock_begins_with_day("2100-02-29"));
    assert_false(sst_clock_begins_with_day("2026-11"));
}

/* --- windows and settings ----------------------------------------------------------------------------------------- */

static void window_of_the_last_values(void **state)
{
    static struct time_window w;

    (void)state;
    assert_true(isnan(window_quantile(&w, 0.5, 0)));
    window_add(&w, 7, 5);
    assert_true(window_quantile(&w, 0, 5) == 7 && window_quantile(&w, 1, SST_WINDOW_NS + 4) == 7);
    assert_true(isnan(window_quantile(&w, 0.5, SST_WINDOW_NS + 5))); /* a value of long ago is none of now */
    for (int i = 1; i <= 1000; i++)
        window_add(&w, i, i);
    assert_int_equal(w.count, 1001);
    assert_true(w.sum == 500507);
    assert_true(window_quantile(&w, 0, 1000) == 1000 - SST_WINDOW + 1);
    assert_true(window_quantile(&w, 0.5, 1000) == 1000 - SST_WINDOW + 1 + SST_WINDOW / 2);
    assert_true(window_quantile(&w, 1, 1000) == 1000);
    assert_true(window_quantile(&w, 0, SST_WINDOW_NS + 990) == 991);
}

static int take(struct view_settings *s, const char *text, char error[512])
{
    json_t *o = json_loads(text, JSON_DECODE_ANY, NULL);
    const int err = view_settings_take(s, o, error);

    assert_non_null(o);
    json_decref(o);
    return err;
}

/* A reload brings changes of the file, and leaves settings made meanwhile alone. */
static void settings_follow_the_configuration(void **state)
{
    const struct sst_live_settings from = { .focus_px = NAN, .c1 = 0.25, .c2 = 0.5, .label_factor = 2, .threads = 1 };
    struct sst_live_settings to = from;
    struct view_settings s;

    (void)state;
    view_settings_defaults(&s, &from);
    s.render.focus_px = 7;
    s.render.c2 = 0.125;
    s.follow = true;
    view_settings_follow(&s, &from, &to);
    assert_true(s.render.focus_px == 7 && s.render.c2 == 0.125 && s.follow);
    to.c1 = 0.75;
    to.sigma_px = 3;
    to.label_factor = 9;
    to.threads = 2;
    view_settings_follow(&s, &from, &to);
    assert_true(s.render.focus_px == 7 && s.render.c2 == 0.125 && s.follow);
    assert_true(s.render.c1 == 0.75 && s.render.sigma_px == 3 && s.render.label_factor == 9 && s.render.threads == 2);
    to.method = SST_LIVE_CLEAR;
    to.cut_px = 9;
    to.outline = true;
    snprintf(to.remove_label, sizeof(to.remove_label), "Car");
    s.tint = true;
    view_settings_follow(&s, &from, &to);
    assert_true(s.render.method == SST_RENDER_CLEAR && s.render.cut_px == 9 && s.outline && s.tint);
    assert_string_equal(s.remove_label, "Car");
    to.focus_px = 5;
    to.c2 = 0;
    view_settings_follow(&s, &from, &to);
    assert_true(s.render.focus_px == 5 && s.render.c2 == 0 && !s.follow);
}

static void settings_of_a_view(void **state)
{
    static const char *const wrong[] = { "[]",
                                         "7",
                                         "{\"focus\": 3}",
                                         "{\"focus_px\": \"3\"}",
                                         "{\"focus_px\": 1e9}",
                                         "{\"c1\": -0.1}",
                                         "{\"c1\": null}",
                                         "{\"label_factor\": 0.5}",
                                         "{\"method\": \"magic\"}",
                                         "{\"method\": null}",
                                         "{\"follow\": 1}",
                                         "{\"focus_label\": 3}",
                                         "{\"remove_label\": 3}",
                                         "{\"cut_px\": \"near\"}",
                                         "{\"outline\": 1}",
                                         "{\"tint\": null}",
                                         "{\"focus_label\": \"a name that is longer than any class can be, by far\"}",
                                         "{\"c2\": 0.5, \"focus_px\": true}" };
    const struct sst_live_settings config = { .focus_px = NAN, .c1 = 0.25, .c2 = 0.5, .label_factor = 2 };
    struct view_settings s, before;
    char error[512];
    json_t *o;

    (void)state;
    view_settings_defaults(&s, &config);
    assert_true(isnan(s.render.focus_px) && s.render.c1 == 0.25);
    memcpy(&before, &s, sizeof(s));
    for (size_t i = 0; i < ARRAY_LEN(wrong); i++) {
        error[0] = 0;
        assert_int_equal(take(&s, wrong[i], error), -EINVAL);
        assert_true(strlen(error) > 10);
        assert_memory_equal(&s, &before, sizeof(s));
    }
    assert_int_equal(take(&s, "{}", error), 0);
    assert_int_equal(
        take(&s, "{\"focus_px\": 12, \"method\": \"refocus\", \"focus_label\": \"Car\", \"follow\": true}", error), 0);
    assert_true(s.render.focus_px == 12 && s.render.method == SST_RENDER_REFOCUS && s.follow);
    assert_int_equal(take(&s, "{\"focus_px\": null, \"focus_label\": \"\", \"aperture\": 1.5}", error), 0);
    assert_true(isnan(s.render.focus_px) && !s.focus_label[0] && s.render.aperture == 1.5);
    o = view_settings_json(&s);
    assert_true(json_is_null(json_object_get(o, "focus_px")));
    assert_true(json_number_value(json_object_get(o, "aperture")) == 1.5);
    assert_string_equal(json_string_value(json_object_get(o, "method")), "refocus");
    json_decref(o);
    assert_int_equal(
        take(&s,
             "{\"method\": \"clear\", \"cut_px\": 12, \"remove_label\": \"Pedestrian\", \"outline\": true, "
             "\"tint\": true}",
             error),
        0);
    assert_true(s.render.method == SST_RENDER_CLEAR && s.render.cut_px == 12 && s.outline && s.tint);
    assert_string_equal(s.remove_label, "Pedestrian");
    assert_int_equal(take(&s, "{\"cut_px\": null, \"outline\": false}", error), 0);
    assert_true(isnan(s.render.cut_px) && !s.outline && s.tint);
    o = view_settings_json(&s);
    assert_true(json_is_null(json_object_get(o, "cut_px")));
    assert_string_equal(json_string_value(json_object_get(o, "method")), "clear");
    assert_string_equal(json_string_value(json_object_get(o, "remove_label")), "Pedestrian");
    json_decref(o);
}

/* --- requests ----------------------------------------------------------------------------------------------------- */

static void unknown_members_are_refused_with_the_likely_one(void **state)
{
    static const char *const known[] = { "action", "seconds", "rate_hz", NULL }, *const none[] = { NULL };
    static const struct {
        const char *request, *said;
    } wrong[] = {
        { "{\"secnds\": 5}", "unknown member `secnds`; did you mean `seconds`?" },
        { "{\"action\": 1, \"rate\": 5}", "did you mean `rate_hz`?" },
        { "{\"zzz\": 5}", "there are action, seconds and rate_hz" },
        { "[]", "must be an object" },
    };
    char error[512];

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(wrong); i++) {
        json_t *o = json_loads(wrong[i].request, 0, NULL);

        assert_int_equal(sst_api_members(o, known, error), -EINVAL);
        assert_contains(error, wrong[i].said);
        if (json_is_object(o)) {
            assert_int_equal(sst_api_members(o, none, error), -EINVAL);
            assert_non_null(strstr(error, "it has none"));
        }
        json_decref(o);
    }
    assert_int_equal(sst_api_members(NULL, known, error), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ring_keeps_the_newest),
        cmocka_unit_test(ring_survives_slow_readers),
        cmocka_unit_test(ring_forgets), cmocka_unit_test(ring_prefers_complete_sets),
        cmocka_unit_test(ring_with_threads),
        cmocka_unit_test(outlet_shows_the_newest),
        cmocka_unit_test(events_are_kept_in_order),
        cmocka_unit_test(wall_time_as_text),
        cmocka_unit_test(window_of_the_last_values),
        cmocka_unit_test(settings_of_a_view),
        cmocka_unit_test(settings_follow_the_configuration),
        cmocka_unit_test(unknown_members_are_refused_with_the_likely_one),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
