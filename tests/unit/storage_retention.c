/* Retention: order of removal, and limits of the room. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/storage/storage_internal.h"
#include "tests/storage_bench.h"

#define MS  ((int64_t)1000000)
#define DAY ((int64_t)86400 * 1000 * MS)
#define T0  (20600 * DAY) /* in 2026 */

int fdatasync(int fd SST_UNUSED)
{
    return 0; /* the disk has time; the test has not */
}

int fsync(int fd SST_UNUSED)
{
    return 0; /* likewise */
}

static void add(struct catalog *c, enum store_kind kind, uint64_t order, const char *why, int64_t bytes)
{
    struct store_entry e = { .kind = kind, .order = order, .bytes = bytes };

    e.from_ns = e.to_ns = e.made_ns = T0 + (int64_t)order * DAY;
    store_name(e.name, kind, e.made_ns, 1);
    snprintf(e.why, sizeof(e.why), "%s", why);
    assert_int_equal(catalog_add(c, &e), 0);
}

static uint64_t goes(const struct catalog *c, const struct store_limits *l, const struct store_room *room,
                     enum store_verdict want)
{
    int victim = -1;

    assert_int_equal(store_judge(c, l, room, &victim), want);
    return victim < 0 ? 0 : c->entry[victim].order;
}

static void what_was_made_by_hand_outlives_the_rest(void **state)
{
    struct catalog c = { 0 };
    struct store_limits l = { .quota_bytes = 1000, .margin_bytes = 50 };
    struct store_room room = { .used_bytes = 960, .free_bytes = 1 << 30, .clock_steady = true };

    (void)state;
    add(&c, SST_STORE_SNAPSHOT, 1, "", 100);
    add(&c, SST_STORE_RECORDING, 2, SST_STORE_ON_DEMAND, 200);
    add(&c, SST_STORE_RECORDING, 3, "continuous", 300);
    add(&c, SST_STORE_EXPORT, 4, "", 150);
    add(&c, SST_STORE_RECORDING, 5, "motion in door", 210);
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 3);
    /* More than half of the room was made by hand: then the oldest such entry. */
    c.entry[3].bytes = 250;
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 1);
    l.manual_bytes = 550; /* as configured */
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 3);
    l.manual_bytes = 549;
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 1);
    /* Half of the room is half of the disk's free space and ours. */
    l = (struct store_limits){ .min_free_bytes = 1000, .margin_bytes = 50 };
    room.free_bytes = 140;
    assert_int_equal(store_manual_bytes(&l, &room), 50);
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 1);
    /* Entries that are being read go after others; if nothing else is left, they go. */
    l = (struct store_limits){ .quota_bytes = 1000, .margin_bytes = 50, .manual_bytes = 900 };
    c.entry[2].readers = 1;
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 5);
    c.entry[4].stage = SST_STORE_ACTIVE;
    c.entry[4].segments = 3; /* it could be trimmed, but others come first */
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 3);
    c.entry[2].stage = SST_STORE_KEPT;
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 5); /* but it makes room, as long as it has some ... */
    c.entry[4].segments = 2;
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 1); /* nothing else: the disk is never full for it */
    catalog_fini(&c);
}

/* Reduced recordings outlive full ones up to their part, and entries made by hand outlive both. */
static void reduced_recordings_outlive_full_ones(void **state)
{
    struct catalog c = { 0 };
    struct store_limits l = { .quota_bytes = 900, .margin_bytes = 50 };
    struct store_room room = { .used_bytes = 860, .free_bytes = 1 << 30, .clock_steady = true };

    (void)state;
    add(&c, SST_STORE_RECORDING, 1, SST_STORE_REDUCED_WHY, 100);
    add(&c, SST_STORE_RECORDING, 2, "continuous", 300);
    add(&c, SST_STORE_RECORDING, 3, SST_STORE_ON_DEMAND, 200);
    add(&c, SST_STORE_RECORDING, 4, SST_STORE_REDUCED_WHY, 190);
    assert_int_equal(store_reduced_bytes(&l, &room), 300);
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 2);
    c.entry[3].bytes = 201; /* more than a third of the room */
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 1);
    l.reduced_bytes = 500;
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 2);
    catalog_remove(&c, c.entry[1].name);
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_MUCH), 1); /* no full one is left */
    /* An age of their own. */
    l = (struct store_limits){ .max_age_ns = { 1, 5 * DAY, 0 } };
    room.wall_ns = T0 + 7 * DAY;
    add(&c, SST_STORE_RECORDING, 6, "continuous", 300);
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_OLD), 1);
    room.wall_ns = T0 + 6 * DAY;
    assert_int_equal(goes(&c, &l, &room, SST_STORE_FITS), 0);
    catalog_fini(&c);
}

static void each_has_an_age_of_its_own(void **state)
{
    struct catalog c = { 0 };
    struct store_limits l = { .max_age_ns = { 2 * DAY } };
    const struct store_room room = { .wall_ns = T0 + 10 * DAY, .clock_steady = true };

    (void)state;
    add(&c, SST_STORE_SNAPSHOT, 1, "", 1);
    add(&c, SST_STORE_RECORDING, 2, "continuous", 1);
    add(&c, SST_STORE_RECORDING, 3, SST_STORE_ON_DEMAND, 1);
    add(&c, SST_STORE_RECORDING, 4, "continuous", 1);
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_OLD), 2);
    l = (struct store_limits){ .max_age_ns = { [SST_STORE_MANUAL] = 8 * DAY } };
    assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_OLD), 1);
    catalog_remove(&c, c.entry[0].name);
    l.max_age_ns[SST_STORE_MANUAL] = 1;
    assert_int_equal(goes(&c, &l, &room, SST_STORE_FITS), 0); /* the newest by hand, however old */
    catalog_fini(&c);
}

/* Recorded before the clock was set: it goes when the next entry is too old, and not before. */
static void what_an_unset_clock_stamped_goes_with_what_came_next(void **state)
{
    const struct store_limits l = { .max_age_ns = { 2 * DAY } };
    struct store_room room = { .clock_steady = true };

    (void)state;
    for (int earlier = 0; earlier < 2; earlier++) {
        /* 1970; the day on which the system was made; long before an older entry; in the future */
        for (int wrong = 0; wrong < 4; wrong++) {
            const int64_t stamp = (int64_t[]){ 60000 * MS, T0 - 700 * DAY, T0 + 90 * DAY, T0 + 900 * DAY }[wrong];
            struct catalog c = { 0 };
            int first = 0;

            if (earlier)
                add(&c, SST_STORE_RECORDING, 99, "continuous", 1);
            else if (wrong == 2)
                continue; /* then nothing gives it away */
            for (int i = 0; i < 4; i++)
                add(&c, SST_STORE_RECORDING, 100 + (uint64_t)i, "continuous", 1);
            first = earlier;
            for (int i = 0; i < 2; i++)
                c.entry[first + i].from_ns = c.entry[first + i].to_ns = stamp + i;
            room.wall_ns = T0 + 100 * DAY;
            if (earlier)
                assert_int_equal(goes(&c, &l, &room, SST_STORE_FITS), 0);
            room.wall_ns = T0 + 101 * DAY + 1;
            if (earlier) {
                assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_OLD), 99);
                catalog_remove(&c, c.entry[0].name);
            }
            room.wall_ns = T0 + 104 * DAY;
            if (wrong != 2) /* the entry that gave it away has gone */
                assert_int_equal(goes(&c, &l, &room, SST_STORE_FITS), 0);
            room.wall_ns++;
            for (uint64_t n = 100; n < 103; n++) {
                assert_int_equal(goes(&c, &l, &room, SST_STORE_TOO_OLD), n);
                catalog_remove(&c, c.entry[0].name);
            }
            room.wall_ns += 900 * DAY;
            assert_int_equal(goes(&c, &l, &room, SST_STORE_FITS), 0); /* the newest */
            catalog_fini(&c);
        }
    }
}

static void videos_for_downloads_have_their_part_of_the_room(void **state)
{
    struct store_limits l = { .margin_bytes = 50 };
    struct store_room room = { .used_bytes = 600, .free_bytes = 1400 };

    (void)state;
    assert_int_equal(store_download_bytes(&l, &room, 0), 1350); /* no limit but the disk */
    l.min_free_bytes = 1000;
    assert_int_equal(store_download_bytes(&l, &room, 0), 400);
    l.quota_bytes = 700;
    assert_int_equal(store_download_bytes(&l, &room, 0), 100);
    room.used_bytes = 690;
    assert_int_equal(store_download_bytes(&l, &room, 0), 70); /* a tenth: the oldest goes for it */
    assert_int_equal(store_download_bytes(&l, &room, 30), 40);
    assert_int_equal(store_download_bytes(&l, &room, 65), 10);
    l.min_free_bytes = 0;
    room.free_bytes = 60;
    assert_int_equal(store_download_bytes(&l, &room, 0), 10);
}

static int snapshots(struct bench *b, char first[SST_STORE_NAME], char last[SST_STORE_NAME])
{
    json_t *all = sst_storage_list(b->storage), *list = json_object_get(all, "snapshots");
    const size_t n = json_array_size(list);

    if (n) {
        snprintf(first, SST_STORE_NAME, "%s", json_string_value(json_object_get(json_array_get(list, 0), "name")));
        snprintf(last, SST_STORE_NAME, "%s", json_string_value(json_object_get(json_array_get(list, n - 1), "name")));
    }
    json_decref(all);
    return (int)n;
}

static bool the_last_is_at_work(struct bench *b)
{
    json_t *all = sst_storage_list(b->storage), *list = json_object_get(all, "snapshots");
    const bool active = json_is_true(json_object_get(json_array_get(list, json_array_size(list) - 1), "active"));

    json_decref(all);
    return active;
}

static void snapshots_never_fill_the_room(void **state)
{
    char name[SST_STORE_NAME], first[SST_STORE_NAME] = "", last[SST_STORE_NAME] = "";
    struct bench b;
    struct catalog found = { 0 };

    (void)state;
    bench_init(&b, SST_RECORD_OFF);
    b.config->storage.quota_gb = 400e3 / 1e9;
    bench_open_storage(&b);
    bench_wait_ready(&b);
    bench_put_pictures(&b, 2, sst_clock_now_ns());
    for (int i = 0; i < 18; i++) {
        int err = sst_storage_snapshot(b.storage, NULL, 0, name);

        /* until there is room, and no other is waited for */
        for (int wait = 0; (err == -ENOSPC || err == -EBUSY) && wait < 60000; wait++) {
            usleep(1000);
            err = sst_storage_snapshot(b.storage, NULL, 0, name);
        }
        assert_int_equal(err, 0);
    }
    bench_wait(&b, NULL, "removed", 1);
    for (int i = 0; i < 60000 && the_last_is_at_work(&b); i++)
        usleep(1000);
    assert_in_range(snapshots(&b, first, last), 1, 20);
    assert_string_equal(last, name);
    assert_true(bench_number(&b, NULL, "used_bytes") <= 400000 + 60000);
    bench_fini(&b);
    assert_int_equal(store_scan(in(dir, "snapshots"), SST_STORE_SNAPSHOT, false, &found), 0);
    assert_in_range(found.count, 1, 20);
    assert_string_equal(found.entry[found.count - 1].name, last);
    for (int i = 1; i < found.count; i++)
        assert_true(found.entry[i].order > found.entry[i - 1].order && found.entry[i].made_ns > 0);

    /* After a start, too, the order is that in which they were made. */
    bench_init(&b, SST_RECORD_OFF);
    bench_open_storage(&b);
    bench_wait(&b, NULL, "snapshots", found.count);
    assert_int_equal(snapshots(&b, first, name), found.count);
    assert_string_equal(first, found.entry[0].name);
    assert_string_equal(name, last);
    bench_fini(&b);
    catalog_fini(&found);
}

/* Room of visits is no room for recordings and snapshots. */
static void what_others_take_counts(void **state)
{
    char name[SST_STORE_NAME];
    struct bench b;
    int err;

    (void)state;
    bench_init(&b, SST_RECORD_OFF);
    b.config->storage.quota_gb = 1e6 / 1e9;
    bench_open_storage(&b);
    bench_wait_ready(&b);
    bench_put_pictures(&b, 2, sst_clock_now_ns());
    for (int i = 0; i < 2; i++) {
        err = sst_storage_snapshot(b.storage, NULL, 0, name);
        for (int wait = 0; (err == -ENOSPC || err == -EBUSY) && wait < 60000; wait++) {
            usleep(1000);
            err = sst_storage_snapshot(b.storage, NULL, 0, name);
        }
        assert_int_equal(err, 0);
    }
    bench_wait(&b, NULL, "snapshots", 2);
    assert_int_equal(bench_number(&b, NULL, "removed"), 0);
    sst_storage_aside(b.storage, SST_STORAGE_ASIDE_VISITS, 995000);
    bench_wait(&b, NULL, "removed", 1);
    bench_wait(&b, NULL, "used_bytes", 995000);
    bench_fini(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_was_made_by_hand_outlives_the_rest),
        TEST(reduced_recordings_outlive_full_ones),
        TEST(each_has_an_age_of_its_own),
        TEST(what_an_unset_clock_stamped_goes_with_what_came_next),
        TEST(videos_for_downloads_have_their_part_of_the_room),
        TEST(snapshots_never_fill_the_room),
        TEST(what_others_take_counts),
    };
    const int rc = begin_tests(WITH_AVFORMAT);

    return rc ? rc : cmocka_run_group_tests(tests, NULL, remove_all);
}
