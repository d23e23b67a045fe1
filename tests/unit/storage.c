/* daemon/storage: what is wanted is recorded, from the set that it should begin with to the one that it should end
 * with. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <sys/wait.h>

#include "daemon/storage/storage_internal.h"
#include "daemon/storage/video_internal.h"
#include "tests/quick.h"
#include "tests/storage_bench.h"

#define MS      ((int64_t)1000000)
#define HOUR_NS (3600 * 1000 * MS)
#define T0      (INT64_C(20600) * 86400 * 1000 * MS) /* in 2026 */

int fdatasync(int fd SST_UNUSED)
{
    return 0; /* the disk has time; the test has not */
}

int fsync(int fd SST_UNUSED)
{
    return 0; /* a call that records is answered within a second, too */
}

/* --- rules -------------------------------------------------------------------------------------------------------- */

static void a_trigger_ignores_a_single_set(void **state)
{
    struct event_trigger w = { .trigger = 0, .share = 0.1 };
    int64_t t = 0;

    (void)state;
    for (int i = 0; i < 50; i++) /* one set in three */
        assert_false(event_trigger_update(&w, i % 3 ? 0.02 : 0.9, t += 100 * MS));
    assert_false(event_trigger_update(&w, 0.2, t += 100 * MS));
    assert_false(event_trigger_update(&w, 0.2, t + 200 * MS));
    assert_true(event_trigger_update(&w, 0.2, t + 300 * MS));
    assert_true(w.active);
    assert_int_equal(w.begin_ns, t);
    t += 300 * MS;
    for (int i = 0; i < 50; i++) /* flicker, and values between both limits */
        assert_false(event_trigger_update(&w, i % 2 ? 0.0 : 0.075, t += 100 * MS));
    assert_true(w.active && w.last_ns == t - 100 * MS);
    for (int i = 0; i < 9; i++)
        assert_false(event_trigger_update(&w, i % 2 ? NAN : 0.04, t += 100 * MS));
    assert_true(event_trigger_update(&w, 0.04, t += 100 * MS));
    assert_false(w.active);

    /* A share of 0: anything; slow pictures need two sets, too. */
    w = (struct event_trigger){ .share = 0 };
    assert_false(event_trigger_update(&w, 0, t));
    assert_false(event_trigger_update(&w, 1e-6, t + 5000 * MS));
    assert_true(event_trigger_update(&w, 1e-6, t + 10000 * MS));
    assert_false(event_trigger_update(&w, NAN, t + 15000 * MS));
    assert_true(event_trigger_update(&w, NAN, t + 20000 * MS));
}

/* Two sets in three speak for it: it takes three times as long; times that are asked for count. */
static void single_sets_only_delay_a_trigger(void **state)
{
    struct event_trigger w = { .share = 0.1, .begin_s = 1, .end_s = 2 };
    int64_t t = 0, begun = 0;

    (void)state;
    for (int i = 0; i < 100 && !w.active; i++)
        if (event_trigger_update(&w, i % 3 == 2 ? 0 : 0.2, t += 100 * MS))
            begun = t;
    assert_true(w.active && w.begin_ns == 100 * MS);
    assert_in_range(begun, 2500 * MS, 3200 * MS);
    while (w.active && t < begun + 20000 * MS)
        (void)event_trigger_update(&w, t / (100 * MS) % 3 ? 0 : 0.2, t + 100 * MS), t += 100 * MS;
    assert_false(w.active);
    assert_in_range(t - begun, 5000 * MS, 7000 * MS);
    /* Time that stands still or runs back speaks for nothing. */
    w = (struct event_trigger){ .share = 0.1 };
    for (int i = 0; i < 100; i++)
        assert_false(event_trigger_update(&w, 0.2, 5000 * MS - i * MS));
}

/* A second of change every four, for ten minutes. @return times that it was reported to have begun */
static int storm(struct event_trigger *w, int *ended, int *times)
{
    int began = 0;

    for (int i = 0; i < 6000; i++) {
        const double value = i % 40 < 10 ? 0.5 : 0;

        (void)event_trigger_update(w, value, i * 100 * MS);
        if (!event_trigger_report(w, value, i * 100 * MS))
            continue;
        began += w->reported;
        *ended += !w->reported;
        *times += w->reported ? 0 : w->times;
    }
    *times += w->reported ? w->times : 0;
    return began;
}

static void repeated_changes_are_reported_as_one(void **state)
{
    struct event_trigger motion = { .share = 0.1 }, label = { .share = 0.1, .label = "Pedestrian" };
    int ended = 0, times = 0;

    (void)state;
    assert_int_equal(storm(&motion, &ended, &times), 3); /* after 1 s, 2 s; then 4 s are longer than the pause */
    assert_int_equal(ended, 2);
    assert_int_equal(times, 150);
    assert_true(motion.reported && motion.peak == 0.5);
    ended = times = 0;
    assert_int_equal(storm(&label, &ended, &times), 150);
    assert_int_equal(ended, 150);
    /* After a rest a single one ends after a second again. */
    for (int i = 0, reported = 0; i < 1000; i++) {
        const int64_t t = 600000 * MS + i * 100 * MS;
        const double value = i >= 900 && i < 910 ? 0.5 : 0;

        (void)event_trigger_update(&motion, value, t);
        reported += event_trigger_report(&motion, value, t);
        assert_int_equal(motion.reported, i < 9 || (i >= 903 && i < 920));
        assert_int_equal(reported, (i >= 9) + (i >= 903) + (i >= 920));
    }
}

static void triggers_follow_the_configuration(void **state)
{
    struct sst_config *c = calloc(1, sizeof(*c));
    struct event_triggers w;

    (void)state;
    c->zones = 2;
    strcpy(c->zone[0].name, "door");
    strcpy(c->zone[1].name, "gate");
    c->storage.triggers = 4;
    c->storage.trigger[0] = (struct sst_record_trigger){ .zone = 0, .share = 0.3 };
    c->storage.trigger[1] = (struct sst_record_trigger){ .zone = 1, .share = 0.1, .label = "Pedestrian" };
    c->storage.trigger[2] = (struct sst_record_trigger){ .zone = -1, .share = 0.5 };
    c->storage.trigger[3] = (struct sst_record_trigger){ .zone = 0, .visit = true };
    event_triggers_init(&w, c);
    assert_int_equal(w.count, 5); /* changes at the gate are reported, but not recorded */
    assert_string_equal(w.list[1].label, "Pedestrian");
    assert_true(w.list[2].index == -1 && !w.list[2].zone[0]);
    assert_true(w.list[3].visit && w.list[3].trigger == 3 && !w.list[2].visit);
    assert_true(w.list[4].trigger == -1 && w.list[4].index == 1);
    assert_string_equal(w.list[4].zone, "gate");
    free(c);
}

static void the_oldest_goes_and_no_clock_takes_the_newest(void **state)
{
    struct catalog c = { 0 };
    struct store_limits l = { .quota_bytes = 1000, .margin_bytes = 50 };
    struct store_room room = { .used_bytes = 951, .free_bytes = 1 << 30, .wall_ns = T0 + 1000, .clock_steady = true };
    struct store_entry e = { .bytes = 300 };
    int victim = -1;

    (void)state;
    /* Made 3, 1, 2 in the list's order of names; the wall clock went backwards before the last. */
    for (int i = 0; i < 3; i++) {
        store_name(e.name, SST_STORE_RECORDING, (int64_t)i * 1000000000, 1);
        e.order = (uint64_t[]){ 3, 1, 2 }[i];
        e.from_ns = e.to_ns = T0 + (int64_t[]){ 100, 900, 800 }[i];
        assert_int_equal(catalog_add(&c, &e), 0);
    }
    assert_int_equal(c.order, 3);
    assert_int_equal(store_judge(&c, &l, &room, &victim), SST_STORE_TOO_MUCH);
    assert_int_equal(c.entry[victim].order, 1);
    room.used_bytes = 950;
    assert_int_equal(store_judge(&c, &l, &room, &victim), SST_STORE_FITS);
    l = (struct store_limits){ .min_free_bytes = 1000, .margin_bytes = 50 };
    room.free_bytes = 1049;
    c.entry[0].stage = SST_STORE_ACTIVE; /* is never removed */
    assert_int_equal(store_judge(&c, &l, &room, &victim), SST_STORE_TOO_MUCH);
    assert_int_equal(c.entry[victim].order, 2);
    c.entry[1].stage = c.entry[2].stage = SST_STORE_KEPT;
    assert_int_equal(store_judge(&c, &l, &room, &victim), SST_STORE_FITS);
    room.free_bytes = 999;
    assert_int_equal(store_judge(&c, &l, &room, &victim), SST_STORE_NO_ROOM);

    /* Ages: all look old after a step, the one made last stays; while the clock is in doubt none goes. */
    l = (struct store_limits){ .max_age_ns = { 150 } };
    for (int i = 0; i < 3; i++)
        c.entry[i].stage = SST_STORE_DONE;
    assert_int_equal(store_judge(&c, &l, &room, &victim), SST_STORE_TOO_OLD);
    assert_int_equal(c.entry[victim].order, 2);
    room.clock_steady = false;
    assert_int_equal(store_judge(&c, &l, &room, &victim), SST_STORE_FITS);
    room = (struct store_room){ .wall_ns = INT64_MAX, .clock_steady = true };
    for (int left = 3; left > 1; left--) {
        assert_int_equal(store_judge(&c, &l, &room, &victim), SST_STORE_TOO_OLD);
        catalog_remove(&c, c.entry[victim].name);
    }
    assert_int_equal(store_judge(&c, &l, &room, &victim), SST_STORE_FITS);
    assert_int_equal(c.entry[0].order, 3);
    catalog_fini(&c);
}

static void names_are_checked(void **state)
{
    static const char *const bad[] = { "", ".", "..", "../x", "a/b", ".lock", "a b", "a\n", "\xc3\xa4", "a%2e" };
    char name[SST_STORE_NAME], longest[80];

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(bad); i++)
        assert_false(store_name_good(bad[i]));
    memset(longest, 'a', sizeof(longest));
    longest[64] = 0;
    assert_false(store_name_good(longest));
    longest[63] = 0;
    assert_true(store_name_good(longest));
    store_name(name, SST_STORE_EXPORT, (int64_t)1763748300 * 1000 * MS, 2);
    assert_string_equal(name, "export-2025-11-21T18-05-00Z-2");
    assert_true(store_name_good(name));
    store_name(name, SST_STORE_RECORDING, INT64_MIN, 1);
    assert_true(store_name_good(name));
}

/* --- recording ---------------------------------------------------------------------------------------------------- */

static void continuous_recording_holds_every_set(void **state)
{
    char path[SST_PATH_MAX];
    struct bench b;
    uint64_t first = 0;

    (void)state;
    bench_init(&b, SST_RECORD_CONTINUOUS);
    bench_open_storage(&b);
    for (int i = 0; i < 60; i++) {
        bench_put(&b, sst_clock_now_ns());
        usleep(1000);
    }
    bench_wait(&b, "recording", "sets", 60);
    assert_int_equal(bench_number(&b, "recording", "dropped"), 0);
    assert_int_equal(bench_events(&b, "record-start", "continuous"), 1);
    assert_int_equal(bench_recording(&b, 0, path), 1);
    assert_int_equal(bench_check(&b, path, &first), 60); /* readable while it is written */

    /* Off by another configuration; sets in memory at the stop are still written. */
    b.config->storage.mode = SST_RECORD_OFF;
    assert_int_equal(sst_storage_configure(b.storage, b.config), 0);
    bench_wait_inactive(&b);
    bench_wait_event(&b, "record-stop", "\"sets\":60", 1);
    assert_int_equal(sst_storage_stop(b.storage), -ENOENT);
    b.config->storage.mode = SST_RECORD_CONTINUOUS;
    assert_int_equal(sst_storage_configure(b.storage, b.config), 0);
    bench_put(&b, sst_clock_now_ns());
    bench_wait(&b, "recording", "active", 1);
    for (int i = 0; i < 20; i++)
        bench_put(&b, sst_clock_now_ns());
    bench_fini(&b);
    assert_true(size_of(in(path, "storage.json")) > 0);
}

static void a_demand_begins_with_the_moments_before(void **state)
{
    const int64_t now_ns = sst_clock_now_ns();
    char path[SST_PATH_MAX], name[64], again[64];
    struct bench b;
    uint64_t first = 0;
    int n;

    (void)state;
    bench_init(&b, SST_RECORD_OFF);
    b.config->storage.preroll_s = 2;
    bench_open_storage(&b);
    assert_int_equal(sst_storage_record(b.storage, 0, name), -ENODATA);
    for (int i = 0; i <= 50; i++) /* 5 s, the last one is now */
        bench_put(&b, now_ns - (50 - i) * 100 * MS);
    bench_wait_ready(&b);
    assert_int_equal(sst_storage_record(b.storage, 0, name), 0);
    assert_int_equal(sst_storage_record(b.storage, 1000, again), 0);
    assert_string_equal(name, again);
    for (int i = 0; i < 5; i++) {
        bench_put(&b, sst_clock_now_ns());
        usleep(2000);
    }
    bench_wait(&b, "recording", "sets", 5);
    assert_int_equal(sst_storage_stop(b.storage), 0);
    usleep(1000);
    bench_put(&b, sst_clock_now_ns()); /* ends it */
    bench_wait_inactive(&b);
    assert_int_equal(bench_recording(&b, 0, path), 1);
    assert_string_equal(sst_path_base(path), name);
    n = bench_check(&b, path, &first);
    /* Not one before 2 s ago, and none after that is missing. */
    assert_true(first >= 31 && now_ns - (50 - (int64_t)first) * 100 * MS >= now_ns - 2000 * MS);
    assert_true((int64_t)first <= 31 + (sst_clock_now_ns() - now_ns) / (100 * MS) + 1);
    assert_int_equal((int)first + n, 56);
    bench_fini(&b);
}

static void see(struct bench *b, int64_t t_ns, double changed, double label)
{
    struct sst_seen seen = { .t_ns = t_ns, .zones = 1, .changed = { changed, 0 }, .label = { 0, label } };

    sst_storage_seen(b->storage, &seen);
}

/* Storage that records by change in the zone "door", and by another trigger. */
static void open_door(struct bench *b, struct sst_record_trigger other)
{
    bench_init(b, SST_RECORD_EVENT);
    b->config->zones = 1;
    strcpy(b->config->zone[0].name, "door");
    b->config->storage.triggers = 2;
    b->config->storage.trigger[0] = (struct sst_record_trigger){ .zone = 0, .share = 0.2 };
    b->config->storage.trigger[1] = other;
    b->config->storage.preroll_s = 1;
    b->config->storage.postroll_s = 2;
    bench_open_storage(b);
    bench_wait_ready(b);
}

static void an_event_is_recorded_with_what_surrounds_it(void **state)
{
    const int64_t start_ns = sst_clock_now_ns(); /* the array's time runs faster than ours */
    char path[SST_PATH_MAX];
    struct bench b;
    uint64_t first = 0;

    (void)state;
    open_door(&b, (struct sst_record_trigger){ .zone = 0, .share = 0.1, .label = "Pedestrian" });
    /* 10 Hz. Change in sets 30..39, the label in 50..59 (before the post-roll is over): one recording; a flicker;
     * change in 100..109: another. */
    for (int i = 0; i < 200; i++) {
        const bool change = (i >= 30 && i < 40) || (i >= 100 && i < 110) || i == 150;

        bench_put(&b, start_ns + i * 100 * MS);
        see(&b, start_ns + i * 100 * MS, change ? 0.5 : 0.01, i >= 50 && i < 60 ? 0.3 : 0);
        usleep(2000);
        if (i == 85) /* two that follow while the first is still being written would be one */
            bench_wait_event(&b, "record-stop", NULL, 1);
    }
    bench_wait_event(&b, "record-stop", NULL, 2);
    assert_int_equal(bench_recording(&b, 0, path), 2);
    assert_int_equal(bench_check(&b, path, &first), 60 - 1 + 20 - 20 + 1);
    assert_int_equal(first, 20);
    assert_int_equal(bench_recording(&b, 1, path), 2);
    assert_int_equal(bench_check(&b, path, &first), 109 + 20 - 90 + 1);
    assert_int_equal(first, 90);
    assert_int_equal(bench_events(&b, "motion", "\"active\":true"), 2);
    assert_int_equal(bench_events(&b, "motion", "\"active\":false"), 2);
    assert_int_equal(bench_events(&b, "label", "\"label\":\"Pedestrian\""), 2);
    assert_int_equal(bench_events(&b, "record-start", "motion in door"), 2);
    assert_int_equal(bench_events(&b, "record-stop", NULL), 2);
    bench_fini(&b);
}

/* A visit is recorded as a label is, and has events of its own. */
static void a_visit_is_recorded(void **state)
{
    const int64_t start_ns = sst_clock_now_ns();
    char path[SST_PATH_MAX];
    struct bench b;
    uint64_t first = 0;

    (void)state;
    open_door(&b, (struct sst_record_trigger){ .zone = 0, .share = 0.1, .visit = true });
    for (int i = 0; i < 80; i++) {
        bench_put(&b, start_ns + i * 100 * MS);
        see(&b, start_ns + i * 100 * MS, 0.01, i >= 30 && i < 40);
        usleep(2000);
    }
    bench_wait_event(&b, "record-stop", NULL, 1);
    assert_int_equal(bench_events(&b, "record-start", "visit in door"), 1);
    assert_int_equal(bench_recording(&b, 0, path), 1);
    assert_int_equal(bench_check(&b, path, &first), 39 + 20 - 20 + 1);
    assert_int_equal(first, 20);
    assert_int_equal(bench_events(&b, "motion", NULL) + bench_events(&b, "label", NULL), 0);
    bench_fini(&b);
}

/* Sets that a recording holds. */
static int indices(const char *path, uint64_t *index, int most)
{
    struct sst_recording *r;
    struct sst_recording_set set;
    int n;

    assert_int_equal(sst_recording_open(&r, path), 0);
    n = sst_recording_sets(r);
    for (int i = 0; i < n && i < most; i++) {
        assert_int_equal(sst_recording_set(r, i, &set), 0);
        index[i] = set.index;
    }
    sst_recording_close(r);
    return n;
}

static void put_and_see(struct bench *b, int64_t start_ns, int i, double changed)
{
    bench_put(b, start_ns + i * 100 * MS);
    see(b, start_ns + i * 100 * MS, changed, 0);
    usleep(2000);
}

/* In memory: a busy machine loses nothing. */
static void hold_everything(struct bench *b)
{
    sst_ring_destroy(b->ring);
    assert_int_equal(sst_ring_create(&b->ring, (size_t)64 << 20), 0);
}

/* Every tenth set, between events that have every set with their pre-roll. */
static void reduced_recordings_fill_the_time_between(void **state)
{
    const int64_t start_ns = sst_clock_now_ns();
    char path[SST_PATH_MAX];
    uint64_t index[40], first = 0;
    struct bench b;
    json_t *status;
    int n;

    (void)state;
    bench_init(&b, SST_RECORD_EVENT);
    b.config->zones = 1;
    strcpy(b.config->zone[0].name, "door");
    b.config->storage.triggers = 1;
    b.config->storage.trigger[0] = (struct sst_record_trigger){ .zone = 0, .share = 0.2 };
    b.config->storage.preroll_s = 1;
    b.config->storage.postroll_s = 2; /* known before it is over: an end is noticed after one second */
    b.config->storage.reduced = SST_REDUCED_SETS;
    b.config->storage.reduced_every = 10;
    hold_everything(&b);
    bench_open_storage(&b);
    bench_wait_ready(&b);
    for (int i = 0; i < 55; i++)
        put_and_see(&b, start_ns, i, 0.01);
    bench_wait(&b, "recording", "sets", 6); /* 0, 10 ... 50 */
    for (int i = 55; i < 150; i++)
        put_and_see(&b, start_ns, i, i >= 60 && i < 70 ? 0.5 : 0.01);
    bench_wait_event(&b, "record-start", "reduced", 2);
    bench_wait(&b, "recording", "sets", 6);
    status = bench_status(&b);
    assert_true(json_is_true(json_object_get(json_object_get(status, "recording"), "reduced")));
    assert_int_equal(json_integer_value(json_object_get(json_object_get(status, "reduced"), "recordings")), 2);
    assert_int_equal(json_integer_value(json_object_get(json_object_get(status, "full"), "recordings")), 1);
    json_decref(status);
    assert_int_equal(bench_recording(&b, 1, path), 3);
    assert_int_equal(bench_check(&b, path, &first), 69 + 20 - 50 + 1); /* none is missing */
    assert_int_equal(first, 50);
    (void)bench_recording(&b, 0, path);
    n = indices(path, index, 40);
    assert_in_range(n, 6, 7); /* 0, 10 ... until the event is noticed */
    for (int i = 0; i < n; i++)
        assert_int_equal(index[i], 10 * i);
    bench_fini(&b);
}

/* With `changed` and `tiles` a set is kept where something has changed since the last one; with `view` one a minute,
 * whatever. Frames that are no pictures stay whole. */
static void reduced_recordings_skip_what_stands_still(void **state)
{
    static const enum sst_reduced_mode modes[] = { SST_REDUCED_CHANGED, SST_REDUCED_VIEW, SST_REDUCED_TILES };

    (void)state;
    for (size_t m = 0; m < ARRAY_LEN(modes); m++) {
        const int64_t start_ns = sst_clock_now_ns();
        char path[SST_PATH_MAX];
        uint64_t index[40];
        struct bench b;
        int n;

        bench_init(&b, SST_RECORD_OFF);
        if (sst_clock_wall_ns() % HOUR_NS > HOUR_NS - 100 * 1000 * MS) /* a new hour is a new recording */
            b.wall_ns = -100 * 1000 * MS;
        b.config->storage.reduced = modes[m];
        b.config->storage.reduced_every = 10;
        hold_everything(&b);
        bench_open_storage(&b);
        bench_wait_ready(&b);
        for (int i = 0; i < 800; i++) { /* 80 s; something moves from the 20th to the 25th */
            struct sst_seen seen = { .t_ns = start_ns + i * 100 * MS,
                                     .changed = { i >= 200 && i < 250 ? 0.1 : 0.001 } };

            sst_storage_seen(b.storage, &seen);
            bench_put(&b, seen.t_ns);
            usleep(1000);
        }
        bench_wait(&b, "recording", "sets", 2);
        sst_ring_shut(b.ring); /* sets that have come are handled, then it ends */
        assert_true(sst_storage_finish(b.storage, 60000));
        assert_int_equal(bench_recording(&b, (int)m, path), m + 1);
        n = indices(path, index, 40);
        assert_int_equal(index[0], 0);
        if (modes[m] == SST_REDUCED_VIEW) {
            assert_int_equal(n, 2);
            assert_int_equal(index[1], 600);
        } else {
            /* The first, five of those that moved (more, if they come later than what is known of them), and none
             * after that but one a minute. */
            assert_in_range(n, 6, 34);
            assert_true(index[n - 1] <= 260 || (index[n - 1] >= index[n - 2] + 600 && index[n - 2] <= 260));
        }
        bench_fini(&b);
    }
}

/* Live pictures that end must not keep a recording going. */
static void an_event_ends_without_live_pictures(void **state)
{
    struct bench b;
    int64_t t_ns = 0;

    (void)state;
    bench_init(&b, SST_RECORD_EVENT);
    b.config->storage.triggers = 1;
    b.config->storage.trigger[0] = (struct sst_record_trigger){ .zone = -1, .share = 0.2 };
    bench_open_storage(&b);
    bench_wait_ready(&b);
    for (int i = 0; i < 10; i++) {
        struct sst_seen seen = { .t_ns = t_ns = sst_clock_now_ns(), .changed = { 0.5 } };

        bench_put(&b, t_ns);
        sst_storage_seen(b.storage, &seen);
        usleep(50000);
    }
    bench_wait(&b, "recording", "active", 1);
    while (bench_number(&b, "recording", "active")) {
        assert_quick(t_ns, 15000 * MS);
        bench_put(&b, sst_clock_now_ns());
        usleep(50000);
    }
    assert_true(sst_clock_now_ns() - t_ns > 4000 * MS);
    bench_fini(&b);
}

/* --- limits ------------------------------------------------------------------------------------------------------- */

/* The status of a trimmed recording describes its remaining sets. */
static void check_shortened(const char *path, uint64_t listed)
{
    struct sst_recording_set *set = malloc(sizeof(*set));
    struct sst_recording_removed removed;
    struct store_entry e;
    struct sst_recording *r;
    int n, cam;

    assert_non_null(set);
    assert_int_equal(sst_recording_open(&r, path), 0);
    removed = *sst_recording_removed(r);
    n = sst_recording_sets(r);
    assert_true(removed.before_segment > 10 && n > 50 && removed.sets + (uint64_t)n == 700);
    assert_int_equal(n, listed);
    for (int i = 0; i < n; i++)
        assert_int_equal(sst_recording_check(r, i, &cam), 0);
    assert_int_equal(sst_recording_set(r, 0, set), 0);
    assert_int_equal(set->index, removed.sets);
    assert_int_equal(set->segment, removed.before_segment);
    assert_int_equal(set->wall_ns, removed.wall_ns);
    assert_int_equal(sst_recording_set(r, n - 1, set), 0);
    assert_int_equal(set->index, 699);
    sst_recording_close(r);
    assert_int_equal(store_read(path, &e), 0);
    assert_true(e.stage == SST_STORE_DONE && (int)e.sets == n && e.from_ns == removed.wall_ns);
    free(set);
}

/* A bench that records continuously, with frames of the same size each. */
static void init_exact(struct bench *b)
{
    bench_init(b, SST_RECORD_CONTINUOUS);
    synthetic_fini(&b->sets);
    b->sets.bytes = 20000;
    b->sets.exact = true;
    synthetic_init(&b->sets);
}

/* Sets of the only recording, as listed after the oldest segments have gone. */
static int64_t settled_sets(struct bench *b)
{
    int64_t sets = -1, before;

    do {
        json_t *list;

        before = sets;
        usleep(500000);
        list = sst_storage_list(b->storage);
        sets = json_integer_value(json_object_get(json_array_get(json_object_get(list, "recordings"), 0), "sets"));
        json_decref(list);
    } while (sets != before);
    return sets;
}

static void the_quota_holds_while_sets_come(void **state)
{
    char path[SST_PATH_MAX];
    struct bench b;
    int64_t most = 0, all = 0, sets;

    (void)state;
    init_exact(&b);
    sst_ring_destroy(b.ring); /* one that holds everything: a busy machine loses nothing either */
    assert_int_equal(sst_ring_create(&b.ring, (size_t)64 << 20), 0);
    b.config->storage.quota_gb = 0.012;
    b.config->storage.sync_s = 0.02; /* segments of a fifteenth of a second */
    bench_open_storage(&b);
    bench_wait_ready(&b);
    for (int i = 0; i < 700; i++) { /* 42 MB */
        bench_put(&b, sst_clock_now_ns());
        all += 3 * 20000;
        usleep(3000);
        if (i % 10 == 0) {
            const int64_t used = store_bytes(in(dir, "recordings"));

            most = used > most ? used : most;
        }
    }
    bench_wait(&b, "recording", "sets", 700);
    assert_true(most <= 12000000 && most > 8000000 && all > 40000000);
    assert_int_equal(sst_storage_state(b.storage), SST_STORAGE_LOW);
    {
        json_t *o = bench_status(&b);

        assert_string_equal(json_string_value(json_object_get(o, "limit")), "quota");
        json_decref(o);
    }
    assert_int_equal(bench_events(&b, "storage", "\"state\":\"LOW\""), 1);
    assert_int_equal(bench_events(&b, "storage", NULL), 1);
    assert_true(bench_number(&b, NULL, "shortened") > 10);
    assert_int_equal(bench_number(&b, NULL, "removed"), 0);
    assert_int_equal(bench_number(&b, "recording", "dropped"), 0);
    assert_int_equal(bench_recording(&b, 0, path), 1); /* one recording, of which the oldest went */
    sets = settled_sets(&b);
    bench_fini(&b);
    check_shortened(path, (uint64_t)sets);
}

/* Less room than the two pieces that always stay: FULL is reported, and it goes on after removing earlier sets. */
static void a_quota_of_two_pieces_holds_nothing_up(void **state)
{
    const int64_t end_ns = sst_clock_now_ns() + 60000 * MS;
    struct bench b;

    (void)state;
    init_exact(&b);
    b.config->storage.quota_gb = 0.002;
    b.config->storage.sync_s = 0.02;
    bench_open_storage(&b);
    bench_wait_ready(&b);
    while (bench_events(&b, "record-start", NULL) < 4) {
        assert_true(sst_clock_now_ns() < end_ns);
        bench_put(&b, sst_clock_now_ns());
        usleep(3000);
        assert_true(store_bytes(in(dir, "recordings")) <= 2000000 + 3 * 4096); /* the folder itself */
    }
    assert_true(bench_events(&b, "storage", "raise quota_gb") >= 1);
    bench_fini(&b);
}

/* Files of others are neither counted nor removed, whatever they are called. */
static void what_is_not_ours_stays(void **state)
{
    static const char *const others[] = { "recordings/2020-01-01T00-00-00Z", "recordings/mine", "recordings/mine.tmp-x",
                                          "snapshots/holiday", "snapshots/.hidden" };
    struct bench b;

    (void)state;
    bench_init(&b, SST_RECORD_CONTINUOUS);
    assert_int_equal(mkdir(dir, 0777), 0);
    assert_int_equal(mkdir(in(dir, "recordings"), 0777), 0);
    assert_int_equal(mkdir(in(dir, "snapshots"), 0777), 0);
    for (size_t i = 0; i < ARRAY_LEN(others); i++) {
        assert_int_equal(mkdir(in(dir, others[i]), 0777), 0);
        assert_int_equal(sst_file_write(in(in(dir, others[i]), "file"), others[i], 9), 0);
    }
    /* A link with a name of ours leads elsewhere. */
    assert_int_equal(symlink("/usr", in(dir, "recordings/2021-01-01T00-00-00Z.tmp-removed")), 0);
    assert_int_equal(mkdir(in(dir, "recordings/2022-01-01T00-00-00Z"), 0777), 0); /* begun by a killed service */
    assert_int_equal(mkdir(in(dir, "snapshots/snapshot-2022-01-01T00-00-00Z.tmp-a1B2c3"), 0777), 0);
    b.config->storage.quota_gb = 0.001;
    b.config->storage.max_age_days = 1e-9;
    bench_open_storage(&b);
    bench_wait_ready(&b);
    for (int i = 0; i < 20; i++)
        bench_put(&b, sst_clock_now_ns());
    bench_wait(&b, "recording", "sets", 20);
    bench_wait_exactly(&b, NULL, "recordings", 1); /* an empty folder is removed by the next scan */
    bench_fini(&b);
    for (size_t i = 0; i < ARRAY_LEN(others); i++)
        assert_int_equal(size_of(in(in(dir, others[i]), "file")), 9);
    assert_true(access("/usr/bin", F_OK) == 0);
    assert_int_equal(access(in(dir, "recordings/2022-01-01T00-00-00Z"), F_OK), -1);
    assert_int_equal(access(in(dir, "snapshots/snapshot-2022-01-01T00-00-00Z.tmp-a1B2c3"), F_OK), -1);
}

/* --- snapshots, exports, downloads -------------------------------------------------------------------------------- */

static void a_snapshot_can_be_taken_away(void **state)
{
    static const char *const bad[] = {
        "..", "../../etc/passwd", "nothing.tar", "", "snapshots", ".lock", "recordings"
    };
    char name[64], line[SST_PATH_MAX * 3];
    struct sst_download *d[SST_DOWNLOADS_MAX], *other;
    struct bench b;

    (void)state;
    bench_init(&b, SST_RECORD_OFF);
    bench_open_storage(&b);
    bench_wait_ready(&b);
    assert_int_equal(sst_storage_snapshot(b.storage, NULL, 0, name), -ENODATA);
    bench_put_pictures(&b, 3, sst_clock_now_ns() - 300 * MS);
    assert_int_equal(sst_storage_snapshot(b.storage, (const uint8_t *)"picture", 7, name), 0);
    bench_wait_event(&b, "snapshot", name, 1);

    assert_int_equal(bench_download(&b, name, "image/jpeg", in(top, "got")), 7);
    snprintf(line, sizeof(line), "%s.tar", name);
    assert_int_equal(bench_download(&b, line, "application/x-tar", in(top, "got.tar")) % 512, 0);
    snprintf(line, sizeof(line),
             "cd %s && tar xf got.tar && diff -r %s %s/snapshots/%s && ls %s/views | wc -l | grep -qx 3", top, name,
             dir, name, name);
    assert_int_equal(system(line), 0);
    for (size_t i = 0; i < ARRAY_LEN(bad); i++)
        assert_int_equal(sst_storage_download(b.storage, bad[i], &other), -ENOENT);

    /* There is a limit, and downloads that are closed do not count. */
    for (int round = 0; round < 2; round++) {
        for (int i = 0; i < SST_DOWNLOADS_MAX; i++)
            assert_int_equal(sst_storage_download(b.storage, name, &d[i]), 0);
        assert_int_equal(bench_number(&b, NULL, "downloads"), SST_DOWNLOADS_MAX);
        assert_int_equal(sst_storage_download(b.storage, name, &other), -EMFILE);
        for (int i = 0; i < SST_DOWNLOADS_MAX; i++)
            d[i]->close(d[i]);
    }
    bench_fini(&b);
    snprintf(line, sizeof(line), "ls -A %s/snapshots | wc -l | grep -qx 1", dir);
    assert_int_equal(system(line), 0);
}

static void an_export_is_of_the_moment(void **state)
{
    const int64_t base_ns = sst_clock_now_ns() - 8000 * MS, wall_ns = sst_clock_wall_ns() - 8000 * MS;
    char name[64], path[SST_PATH_MAX], line[2 * SST_PATH_MAX];
    struct bench b;

    (void)state;
    bench_init(&b, SST_RECORD_CONTINUOUS);
    bench_open_storage(&b);
    bench_wait_ready(&b);
    bench_put_pictures(&b, 80, base_ns);
    bench_wait(&b, "recording", "sets", 80);
    (void)bench_recording(&b, 0, path);
    assert_int_equal(sst_storage_export(b.storage, NULL, wall_ns - 60000 * MS, name), -ENOENT);
    assert_int_equal(sst_storage_export(b.storage, "../x", wall_ns, name), -ENOENT);
    /* From memory, and from the recording that is being written. */
    for (int i = 0; i < 2; i++) {
        assert_int_equal(sst_storage_export(b.storage, i ? sst_path_base(path) : NULL, wall_ns + 4210 * MS, name), 0);
        bench_wait_event(&b, "export", name, 1);
        snprintf(line, sizeof(line), "grep -q '\"set\":42,' %s/exports/%s/set.json", dir, name);
        assert_int_equal(system(line), 0);
    }
    assert_int_equal(sst_storage_export(b.storage, sst_path_base(path), wall_ns + 60000 * MS, name), -ENOENT);
    bench_fini(&b);
}

/* The clock is set back by an hour, later on by two: a moment is found in the recording of its time. */
static void a_moment_is_found_although_the_clock_was_set(void **state)
{
    const int64_t base_ns = sst_clock_now_ns() - 8000 * MS, wall_ns = sst_clock_wall_ns() - 8000 * MS;
    char path[SST_PATH_MAX], name[64], of[SST_PATH_MAX];
    uint64_t first;
    struct bench b;

    (void)state;
    bench_init(&b, SST_RECORD_CONTINUOUS);
    hold_everything(&b);
    bench_open_storage(&b);
    bench_wait_ready(&b);
    for (int i = 0; i < 3; i++) {
        b.wall_ns = -i * HOUR_NS;
        for (int k = 0; k < 20; k++)
            bench_put(&b, base_ns + (i * 20 + k) * 100 * MS);
    }
    bench_wait_event(&b, "record-start", "continuous", 3);
    bench_wait(&b, "recording", "sets", 20);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(bench_recording(&b, i, path), 3);
        assert_int_equal(sst_storage_hold(b.storage, NULL, wall_ns - i * HOUR_NS + (i * 2000 + 900) * MS, name, of), 0);
        assert_string_equal(name, sst_path_base(path));
        sst_storage_release(b.storage, name);
        assert_int_equal(bench_check(&b, path, &first), 20); /* no set is lost where one ends */
        assert_int_equal(first, 20 * i);
    }
    bench_fini(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_trigger_ignores_a_single_set),
        TEST(single_sets_only_delay_a_trigger),
        TEST(repeated_changes_are_reported_as_one),
        TEST(triggers_follow_the_configuration),
        TEST(the_oldest_goes_and_no_clock_takes_the_newest),
        TEST(names_are_checked),
        TEST(continuous_recording_holds_every_set),
        TEST(a_demand_begins_with_the_moments_before),
        TEST(an_event_is_recorded_with_what_surrounds_it),
        TEST(a_visit_is_recorded),
        TEST(reduced_recordings_fill_the_time_between),
        TEST(reduced_recordings_skip_what_stands_still),
        TEST(an_event_ends_without_live_pictures),
        TEST(the_quota_holds_while_sets_come),
        TEST(a_quota_of_two_pieces_holds_nothing_up),
        TEST(what_is_not_ours_stays),
        TEST(a_snapshot_can_be_taken_away),
        TEST(an_export_is_of_the_moment),
        TEST(a_moment_is_found_although_the_clock_was_set),
    };
    const int rc = begin_tests(WITH_AVFORMAT);

    return rc ? rc : cmocka_run_group_tests(tests, NULL, remove_all);
}
