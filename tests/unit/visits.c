/* Visits: kept on disk, listed, and removed in time. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "daemon/visits/visits.h"
#include "tests/folder.h"
#include "tests/test.h"

#define dir test_path("visits")

static int64_t begin_ns; /* wall time of the tests: the same visit has the same name whenever it is stored */

/* A visit of n seconds before the tests. @param out  its name */
static json_t *visit(char out[64], int64_t ago_s, unsigned id, bool active, const char *label, const char *zone)
{
    const int64_t wall_ns = begin_ns - ago_s * 1000000000;
    char from[SST_CLOCK_TEXT], to[SST_CLOCK_TEXT];

    sst_clock_text(from, wall_ns);
    sst_clock_text(to, wall_ns + 5000000000);
    snprintf(out, 64, "%s-%u", from, id);
    for (char *c = out; *c; c++)
        *c = *c == ':' || *c == '.' ? '-' : *c;
    return json_pack("{s:s, s:b, s:s, s:s, s:s, s:[s]}", "visit", out, "active", active, "label", label, "from", from,
                     "to", to, "zones", zone);
}

static void store(struct sst_visits *v, char out[64], int64_t ago_s, unsigned id, bool active, const char *label,
                  const char *zone)
{
    json_t *data = visit(out, ago_s, id, active, label, zone);

    sst_visits_put(v, data);
    json_decref(data);
}

static uint8_t *bytes_of(const char *text)
{
    return (uint8_t *)strdup(text);
}

static json_t *list(struct sst_visits *v, const struct sst_visits_query *q)
{
    json_t *o = sst_visits_list(v, q);

    assert_non_null(o);
    return o;
}

static int count(struct sst_visits *v, const struct sst_visits_query *q)
{
    json_t *o = list(v, q);
    const int n = (int)json_array_size(o);

    json_decref(o);
    return n;
}

static void wait_for(struct sst_visits *v, int n)
{
    for (int i = 0; i < 1000 && count(v, &(struct sst_visits_query){ .limit = 1000 }) != n; i++)
        usleep(5000);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 1000 }), n);
}

/* Files of a day that is too old go after its visits are listed no more. */
static void wait_gone(const char *name)
{
    for (int i = 0; i < 12000 && !access(test_path("visits/%.10s", name), F_OK); i++)
        usleep(5000);
}

static int change(struct sst_visits *v, const char *name, enum sst_visits_change what, const char *user)
{
    json_t *names = json_pack("[s]", name), *failed = json_object();
    const int err = sst_visits_change(v, names, what, user, failed);
    const int why = (int)json_integer_value(json_object_get(failed, name));

    json_decref(names);
    json_decref(failed);
    return err ? err : why;
}

static const char *text(const json_t *o, size_t i, const char *key)
{
    return json_string_value(json_object_get(json_array_get(o, i), key));
}

static void visits_are_kept_and_listed(void **state)
{
    int err = -ENOENT;
    char name[4][64], from[SST_CLOCK_TEXT];
    struct sst_visits *v;
    uint8_t *data;
    size_t size;
    json_t *o;

    (void)state;
    assert_int_equal(sst_visits_open(&v, dir, 30), 0);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 10 }), 0);
    store(v, name[0], 3 * 86400, 1, false, "Car", "street");
    store(v, name[1], 7200, 2, false, "Pedestrian", "gate");
    sst_visits_put_picture(v, name[1], SST_VISIT_SEEN, bytes_of("jpeg"), 4);
    store(v, name[2], 60, 3, true, "Pedestrian", "street");
    store(v, name[2], 60, 3, false, "Bicyclist", "street"); /* it has gone, and is known better */
    wait_for(v, 3);
    o = list(v, &(struct sst_visits_query){ .limit = 10 });
    assert_string_equal(text(o, 0, "visit"), name[2]);
    assert_string_equal(text(o, 0, "label"), "Bicyclist");
    assert_string_equal(text(o, 1, "visit"), name[1]);
    assert_string_equal(text(o, 2, "visit"), name[0]);
    assert_int_equal(json_array_size(json_object_get(json_array_get(o, 0), "pictures")), 0);
    json_decref(o);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 2 }), 2);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 10, .label = "Pedestrian" }), 1);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 10, .zone = "street" }), 2);
    sst_clock_text(from, sst_clock_wall_ns() - 86400 * INT64_C(1000000000));
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 10, .from = from }), 2);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 10, .to = from }), 1);
    /* Seconds without a fraction mean all of the second. */
    o = list(v, &(struct sst_visits_query){ .limit = 1 });
    snprintf(from, sizeof(from), "%.19sZ", text(o, 0, "to"));
    json_decref(o);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 10, .from = from }), 1);

    for (int i = 0; i < 1000 && err; i++) {
        err = sst_visits_read_picture(v, name[1], SST_VISIT_SEEN, &data, &size);
        usleep(err ? 5000 : 0);
    }
    assert_int_equal(err, 0);
    assert_int_equal(size, 4);
    assert_memory_equal(data, "jpeg", 4);
    free(data);
    assert_int_equal(sst_visits_read_picture(v, name[1], SST_VISIT_CAMERA, &data, &size), -ENOENT);
    assert_int_equal(sst_visits_read_picture(v, "../../etc/passwd", SST_VISIT_SEEN, &data, &size), -EINVAL);
    assert_int_equal(sst_visits_read_picture(v, "2026-11-23/../x", SST_VISIT_SEEN, &data, &size), -EINVAL);
    sst_visits_close(v, 5000);

    /* Another service finds them; visits that lasted when the first was killed have no end. */
    assert_int_equal(sst_visits_open(&v, dir, 30), 0);
    wait_for(v, 3);
    sst_visits_close(v, 5000);
}

static bool is_kept(struct sst_visits *v, const char *name)
{
    json_t *o = list(v, &(struct sst_visits_query){ .limit = 1000 });
    bool kept = false;

    for (size_t i = 0; i < json_array_size(o); i++)
        kept |= !strcmp(text(o, i, "visit"), name) && json_is_true(json_object_get(json_array_get(o, i), "keep"));
    json_decref(o);
    return kept;
}

/* Of a day that is too old the kept visits stay, with their pictures. */
static void a_kept_visit_outlives_its_day(void **state)
{
    char name[4][64];
    struct sst_visits *v;
    uint8_t *data;
    size_t size;

    (void)state;
    sst_path_remove_tree(dir);
    assert_int_equal(sst_visits_open(&v, dir, 30), 0);
    store(v, name[0], 10 * 86400, 1, false, "Car", "street");
    store(v, name[1], 10 * 86400, 2, false, "Pedestrian", "gate");
    store(v, name[2], 12 * 86400, 3, false, "Pedestrian", "gate");
    for (int i = 0; i < 3; i++)
        sst_visits_put_picture(v, name[i], SST_VISIT_SEEN, bytes_of("jpeg"), 4);
    wait_for(v, 3);
    assert_int_equal(change(v, name[1], SST_VISITS_KEEP, NULL), 0);
    assert_int_equal(change(v, name[2], SST_VISITS_KEEP, NULL), 0);
    assert_int_equal(change(v, name[2], SST_VISITS_KEEP, NULL), 0);
    assert_int_equal(change(v, name[2], SST_VISITS_RELEASE, NULL), 0);
    assert_int_equal(change(v, name[2], SST_VISITS_RELEASE, NULL), 0);
    assert_int_equal(change(v, "2026-11-23T00-00-00-000Z-77", SST_VISITS_KEEP, NULL), -ENOENT);
    assert_int_equal(change(v, "../x", SST_VISITS_KEEP, NULL), -ENOENT);
    assert_true(is_kept(v, name[1]) && !is_kept(v, name[2]) && !is_kept(v, name[0]));
    sst_visits_close(v, 5000);

    assert_int_equal(sst_visits_open(&v, dir, 5), 0);
    store(v, name[3], 10, 4, false, "Car", "street");
    wait_for(v, 4); /* the clock was set a moment ago: old visits stay */
    sst_visits_clock(v, true);
    wait_for(v, 2);
    wait_gone(name[2]);
    assert_true(is_kept(v, name[1]));
    assert_int_equal(sst_visits_read_picture(v, name[1], SST_VISIT_SEEN, &data, &size), 0);
    free(data);
    assert_int_equal(sst_visits_read_picture(v, name[0], SST_VISIT_SEEN, &data, &size), -ENOENT);
    assert_int_not_equal(access(test_path("visits/%.10s", name[2]), F_OK), 0);
    sst_visits_close(v, 5000);
}

/* Nothing of a deleted visit is left on the disk, and the others stay. */
static void a_visit_is_deleted_for_good(void **state)
{
    char name[3][64], path[SST_PATH_MAX];
    struct sst_visits *v;
    uint8_t *data;
    size_t size;

    (void)state;
    sst_path_remove_tree(dir);
    assert_int_equal(sst_visits_open(&v, dir, 30), 0);
    store(v, name[0], 86400, 1, true, "Car", "street");
    store(v, name[0], 86400, 1, false, "Car", "street");
    store(v, name[1], 86400, 2, false, "Pedestrian", "gate");
    sst_visits_put_picture(v, name[0], SST_VISIT_SEEN, bytes_of("jpeg"), 4);
    sst_visits_put_picture(v, name[1], SST_VISIT_SEEN, bytes_of("jpeg"), 4);
    store(v, name[2], -3600, 3, true, "Pedestrian", "gate"); /* it came after the service */
    wait_for(v, 3);
    assert_int_equal(change(v, name[0], SST_VISITS_KEEP, NULL), 0);
    assert_int_equal(change(v, name[2], SST_VISITS_DELETE, NULL), -EINPROGRESS);
    assert_int_equal(change(v, name[0], SST_VISITS_DELETE, NULL), 0);
    assert_int_equal(change(v, name[0], SST_VISITS_DELETE, NULL), -ENOENT);
    wait_for(v, 2);
    assert_int_equal(sst_visits_read_picture(v, name[0], SST_VISIT_SEEN, &data, &size), -ENOENT);
    assert_int_equal(sst_visits_read_picture(v, name[1], SST_VISIT_SEEN, &data, &size), 0);
    free(data);
    snprintf(path, sizeof(path), "%s", test_path("visits/%.10s/visits.jsonl", name[0]));
    assert_int_equal(sst_file_read(path, 1 << 20, &data, &size), 0);
    assert_null(strstr((char *)data, name[0]));
    assert_non_null(strstr((char *)data, name[1]));
    free(data);
    sst_visits_close(v, 5000);
    sst_path_remove_tree(dir);
}

/* Pages by time are of the same visits whatever comes meanwhile. */
static void visits_are_paged(void **state)
{
    struct sst_visits_query q = { .limit = 3 };
    char name[8][64], from[SST_CLOCK_TEXT], more[64];
    struct sst_visits *v;
    json_t *o;

    (void)state;
    assert_int_equal(sst_visits_open(&v, test_path("pages"), 30), 0);
    for (int i = 0; i < 8; i++) /* the oldest first, of three days */
        store(v, name[i], (8 - i) * 30000, (unsigned)i, false, "Car", "street");
    wait_for(v, 8);
    for (int i = 7, n = 3; i >= 0; i -= n) {
        o = list(v, &q);
        n = (int)json_array_size(o);
        assert_int_equal(n, i >= 2 ? 3 : 2);
        for (int k = 0; k < n; k++)
            assert_string_equal(text(o, (size_t)k, "visit"), name[i - k]);
        q.before = name[i - n + 1];
        json_decref(o);
        store(v, more, -i, (unsigned)(100 + i), false, "Car", "street"); /* another one comes */
        wait_for(v, 8 + (7 - i) / 3 + 1);
    }
    assert_int_equal(count(v, &q), 0);

    q = (struct sst_visits_query){ .limit = 2, .after = name[2] };
    o = list(v, &q);
    assert_string_equal(text(o, 0, "visit"), name[4]); /* the next ones, the newest first */
    assert_string_equal(text(o, 1, "visit"), name[3]);
    assert_int_equal(json_array_size(o), 2);
    snprintf(from, sizeof(from), "%s", text(o, 0, "from"));
    json_decref(o);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 10, .before = from }), 4);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 10, .after = name[1], .before = from }), 2);
    from[19] = 0; /* seconds alone: visits within the second are not before it */
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 10, .before = strcat(from, "Z") }), 4);
    sst_visits_close(v, 5000);
}

/* The `reviewed` of a visit for a user. */
static bool is_reviewed(struct sst_visits *v, const char *name, const char *user)
{
    json_t *o = list(v, &(struct sst_visits_query){ .limit = 1000, .user = user });
    bool found = false;

    for (size_t i = 0; i < json_array_size(o); i++)
        found |= !strcmp(text(o, i, "visit"), name) && json_is_true(json_object_get(json_array_get(o, i), "reviewed"));
    json_decref(o);
    return found;
}

/* Reviewed visits are one user's, survive a restart, and go with the visit. */
static void visits_are_reviewed(void **state)
{
    char name[4][64], user[8], *file;
    struct sst_visits *v;
    uint8_t *data;
    size_t size;

    (void)state;
    assert_int_equal(sst_visits_open(&v, test_path("reviews"), 30), 0);
    for (int i = 0; i < 3; i++)
        store(v, name[i], i, (unsigned)i, false, "Car", "street");
    store(v, name[3], 86400, 3, false, "Car", "street");
    wait_for(v, 4);
    assert_int_equal(change(v, name[0], SST_VISITS_REVIEWED, "anna"), 0);
    assert_int_equal(change(v, name[0], SST_VISITS_REVIEWED, "anna"), 0);
    assert_int_equal(change(v, name[1], SST_VISITS_REVIEWED, "anna"), 0);
    assert_int_equal(change(v, name[1], SST_VISITS_REVIEWED, "view"), 0);
    assert_int_equal(change(v, "2026-11-23T00-00-00-000Z-77", SST_VISITS_REVIEWED, "view"), -ENOENT);
    assert_true(is_reviewed(v, name[0], "anna") && !is_reviewed(v, name[0], "view"));
    assert_true(is_reviewed(v, name[1], "view") && is_reviewed(v, name[0], NULL) && !is_reviewed(v, name[2], NULL));
    sst_visits_close(v, 5000);

    assert_int_equal(sst_visits_open(&v, test_path("reviews"), 30), 0);
    assert_true(is_reviewed(v, name[0], "anna"));
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 9, .user = "anna", .reviewed = 1 }), 2);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 9, .user = "view", .reviewed = -1 }), 3);
    assert_int_equal(change(v, name[0], SST_VISITS_UNREVIEWED, "anna"), 0);
    assert_int_equal(change(v, name[0], SST_VISITS_UNREVIEWED, "bob"), 0);
    assert_false(is_reviewed(v, name[0], NULL));
    assert_int_equal(change(v, name[1], SST_VISITS_DELETE, NULL), 0);
    file = (char *)test_path("reviews/%.10s/reviewed.json", name[1]);
    if (!access(file, F_OK)) { /* unless the last visits were of two days */
        assert_int_equal(sst_file_read(file, 1 << 20, &data, &size), 0);
        assert_int_equal(size, 2);
        free(data);
    }
    for (int i = 0; i < 33; i++) {
        snprintf(user, sizeof(user), "u%d", i);
        assert_int_equal(change(v, name[3], SST_VISITS_REVIEWED, user), i < 32 ? 0 : -EUSERS);
    }
    sst_visits_close(v, 5000);
}

/* One request changes visits of several days, and names unchanged ones. */
static void many_are_changed_at_once(void **state)
{
    char name[6][64], active[64];
    json_t *names = json_array(), *failed = json_object();
    struct sst_visits *v;

    (void)state;
    assert_int_equal(sst_visits_open(&v, test_path("many"), 30), 0);
    for (int i = 0; i < 6; i++) {
        store(v, name[i], i * 40000 + 60, (unsigned)i, false, "Car", "street");
        if (i % 2)
            json_array_append_new(names, json_string(name[i]));
    }
    store(v, active, -3600, 9, true, "Car", "street");
    wait_for(v, 7);
    assert_int_equal(sst_visits_change(v, names, SST_VISITS_REVIEWED, "anna", failed), 0);
    assert_int_equal(sst_visits_change(v, names, SST_VISITS_KEEP, NULL, failed), 0);
    assert_int_equal(json_object_size(failed), 0);
    assert_true(is_kept(v, name[1]) && is_kept(v, name[5]) && !is_kept(v, name[0]) && is_reviewed(v, name[3], "anna"));
    json_array_append_new(names, json_string(active));
    json_array_append_new(names, json_string("../../etc/passwd"));
    assert_int_equal(sst_visits_change(v, names, SST_VISITS_DELETE, NULL, failed), 0);
    assert_int_equal(json_object_size(failed), 2);
    assert_int_equal(json_integer_value(json_object_get(failed, active)), -EINPROGRESS);
    assert_int_equal(json_integer_value(json_object_get(failed, "../../etc/passwd")), -ENOENT);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 9 }), 4);
    sst_visits_close(v, 5000);
    json_decref(names);
    json_decref(failed);
}

static int number(const json_t *o, size_t i, const char *key)
{
    return (int)json_integer_value(json_object_get(json_array_get(o, i), key));
}

/* Days begin at midnight of the time zone. */
static void days_are_counted(void **state)
{
    static const char lines[] = "{\"visit\":\"2026-11-21T22-59-59-999Z-1\",\"label\":\"Car\",\"zones\":[]}\n"
                                "{\"visit\":\"2026-11-21T22-59-59-999Z-1\",\"label\":\"Car\",\"zones\":[]}\n"
                                "{\"visit\":\"2026-11-21T23-00-00-000Z-2\",\"label\":\"\",\"zones\":[\"gate\"]}\n"
                                "{ \"label\": \"Car\", \"visit\": \"2026-11-21T23-30-00-000Z-3\" }\n"
                                "{\"visit\":\"2026-11-21T23-40-00-000Z-4\",\"lab\n";
    struct sst_visits *v;
    json_t *o;

    (void)state;
    assert_int_equal(sst_path_make_dir(test_path("days")), 0);
    assert_int_equal(sst_path_make_dir(test_path("days/2026-11-21")), 0);
    assert_int_equal(sst_file_write(test_path("days/2026-11-21/visits.jsonl"), lines, strlen(lines)), 0);
    assert_int_equal(sst_visits_open(&v, test_path("days"), 36500), 0);
    assert_int_equal(change(v, "2026-11-21T23-00-00-000Z-2", SST_VISITS_REVIEWED, "anna"), 0);
    o = sst_visits_days(v, &(struct sst_visits_query){ .user = "anna" }, 0);
    assert_int_equal(json_array_size(o), 1);
    assert_string_equal(text(o, 0, "day"), "2026-11-21");
    assert_true(number(o, 0, "visits") == 3 && number(o, 0, "reviewed") == 1);
    json_decref(o);
    o = sst_visits_days(v, &(struct sst_visits_query){ .user = "bob" }, 60);
    assert_int_equal(json_array_size(o), 2);
    assert_string_equal(text(o, 0, "day"), "2026-11-22");
    assert_true(number(o, 0, "visits") == 2 && number(o, 0, "reviewed") == 0 && number(o, 1, "visits") == 1);
    json_decref(o);
    o = sst_visits_days(v, &(struct sst_visits_query){ .from = "2026-11-22", .to = "2026-11-30", .zone = "gate" }, 60);
    assert_int_equal(json_array_size(o), 1);
    assert_true(number(o, 0, "visits") == 1 && number(o, 0, "reviewed") == 1);
    json_decref(o);
    o = sst_visits_days(v, &(struct sst_visits_query){ .label = "Car", .to = "2026-11-20" }, -1440);
    assert_int_equal(number(o, 0, "visits"), 2);
    json_decref(o);
    sst_visits_close(v, 5000);
}

static void a_killed_service_leaves_no_visitors(void **state)
{
    char name[64];
    struct sst_visits *v;
    json_t *o;
    FILE *f;

    (void)state;
    assert_int_equal(sst_visits_open(&v, dir, 30), 0);
    store(v, name, 30, 9, true, "Pedestrian", "gate");
    wait_for(v, 4);
    sst_visits_close(v, 5000);
    usleep(2000);
    assert_int_equal(sst_visits_open(&v, dir, 30), 0);
    o = list(v, &(struct sst_visits_query){ .limit = 1 });
    assert_string_equal(text(o, 0, "visit"), name);
    assert_true(json_is_false(json_object_get(json_array_get(o, 0), "active")));
    json_decref(o);

    /* A line that was cut off, and bytes that are none. */
    f = fopen(test_path("visits/%.10s/visits.jsonl", name), "ae");
    assert_non_null(f);
    fputs("{\"visit\": \"2026-11", f);
    fclose(f);
    wait_for(v, 4);
    sst_visits_close(v, 5000);
    assert_int_equal(sst_visits_open(&v, dir, 30), 0);
    store(v, name, 10, 11, false, "Pedestrian", "gate");
    wait_for(v, 5);
    sst_visits_close(v, 5000);
}

static void old_ones_are_removed(void **state)
{
    char name[64];
    struct sst_visits *v;

    (void)state;
    assert_int_equal(sst_path_make_dir(test_path("visits/2001-02-03")), 0);
    assert_int_equal(sst_path_make_dir(test_path("visits/notes")), 0); /* not ours */
    assert_int_equal(sst_visits_open(&v, dir, 36500), 0);
    sst_visits_clock(v, true);
    store(v, name, 0, 20, false, "Car", "street");
    wait_for(v, 6);
    assert_true(sst_path_exists(test_path("visits/2001-02-03")));
    sst_visits_configure(v, 2); /* needs no visit to be stored */
    for (int i = 0; i < 1000 && count(v, &(struct sst_visits_query){ .limit = 100, .label = "Car" }) != 1; i++)
        usleep(5000);
    sst_visits_close(v, 5000);
    assert_int_equal(sst_visits_open(&v, dir, 2), 0);
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 100, .label = "Car" }),
                     1); /* not the visit of 3 days ago */
    assert_false(sst_path_exists(test_path("visits/2001-02-03")));
    assert_true(sst_path_exists(test_path("visits/notes")));
    sst_visits_close(v, 5000);
}

static void nothing_is_kept_without_days_or_room(void **state)
{
    char name[64];
    struct sst_visits *v;

    (void)state;
    assert_int_equal(sst_visits_open(&v, test_path("none"), 0), 0);
    store(v, name, 0, 1, false, "Car", "street");
    sst_visits_close(v, 5000);
    assert_false(sst_path_exists(test_path("none")));

    assert_int_equal(sst_visits_open(&v, "/proc/none", 30), 0); /* cannot be made: said once, and lived with */
    sst_log_set_level(SST_LOG_ERROR);
    for (unsigned i = 0; i < 200; i++) {
        store(v, name, 0, i, false, "Car", "street");
        sst_visits_put_picture(v, name, SST_VISIT_CAMERA, bytes_of("jpeg"), 4);
    }
    assert_int_equal(count(v, &(struct sst_visits_query){ .limit = 10 }), 0);
    sst_visits_close(v, 5000);
}

static SST_ATOMIC(int64_t) taken; /* bytes, as reported */

static void note_bytes(void *arg, int64_t bytes)
{
    (void)arg;
    atomic_store(&taken, bytes);
}

static bool is_listed(struct sst_visits *v, const char *name)
{
    json_t *o = list(v, &(struct sst_visits_query){ .limit = 1000 });
    bool found = false;

    for (size_t i = 0; i < json_array_size(o); i++)
        found |= !strcmp(text(o, i, "visit"), name);
    json_decref(o);
    return found;
}

static void store_with_picture(struct sst_visits *v, char out[64], int64_t ago_s, unsigned id)
{
    uint8_t *jpeg = calloc(1, 10000);

    assert_non_null(jpeg);
    store(v, out, ago_s, id, true, "Car", "street");
    sst_visits_put_picture(v, out, SST_VISIT_SEEN, jpeg, 10000);
    store(v, out, ago_s, id, false, "Car", "street");
}

/* A tenth of the room is for visits: the oldest go, the ones that are kept for good do not. */
static void visits_stay_within_their_share(void **state)
{
    char name[12][64], more[64];
    struct sst_visits *v;

    (void)state;
    assert_int_equal(sst_visits_open(&v, test_path("share"), 30), 0);
    for (int i = 0; i < 8; i++) /* of two days */
        store_with_picture(v, name[i], (8 - i) * 11000, (unsigned)i + 1);
    wait_for(v, 8);
    assert_int_equal(change(v, name[1], SST_VISITS_KEEP, NULL), 0);
    sst_visits_limit(v, 450000, note_bytes, NULL);
    wait_for(v, 4);
    assert_true(is_listed(v, name[1]) && is_listed(v, name[7]) && is_listed(v, name[5]) && !is_listed(v, name[0]));
    for (int i = 0; i < 1000 && (atomic_load(&taken) > 45000 || !atomic_load(&taken)); i++)
        usleep(5000);
    assert_in_range(atomic_load(&taken), 40000, 45000);
    sst_visits_close(v, 60000);

    /* Existing visits are counted at the next start. */
    assert_int_equal(sst_visits_open(&v, test_path("share"), 30), 0);
    sst_visits_limit(v, 450000, note_bytes, NULL);
    for (int i = 8; i < 12; i++)
        store_with_picture(v, name[i], 100 - i, (unsigned)i + 1);
    for (int i = 0; i < 12000 && (!is_listed(v, name[11]) || is_listed(v, name[8])); i++)
        usleep(5000);
    assert_true(is_listed(v, name[1]) && is_listed(v, name[11]) && !is_listed(v, name[7]) && !is_listed(v, name[8]));

    /* Kept visits fill it: another one's picture goes again, and room is made by deleting one. */
    for (int i = 9; i < 12; i++)
        assert_int_equal(change(v, name[i], SST_VISITS_KEEP, NULL), 0);
    store_with_picture(v, more, 10, 20);
    for (int i = 0; i < 12000 && (!is_listed(v, more) || atomic_load(&taken) > 45000); i++)
        usleep(5000);
    assert_in_range(atomic_load(&taken), 40000, 45000);
    assert_true(is_listed(v, name[1]) && is_listed(v, name[9]) && is_listed(v, name[11]));
    assert_int_equal(change(v, name[1], SST_VISITS_DELETE, NULL), 0);
    store_with_picture(v, more, 5, 21);
    for (int i = 0; i < 12000 && !is_listed(v, more); i++)
        usleep(5000);
    assert_true(is_listed(v, more) && is_listed(v, name[11]));
    sst_visits_close(v, 60000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(visits_stay_within_their_share),
        cmocka_unit_test(visits_are_kept_and_listed),
        cmocka_unit_test(a_killed_service_leaves_no_visitors),
        cmocka_unit_test(old_ones_are_removed),
        cmocka_unit_test(nothing_is_kept_without_days_or_room),
        cmocka_unit_test(a_kept_visit_outlives_its_day),
        cmocka_unit_test(a_visit_is_deleted_for_good),
        cmocka_unit_test(visits_are_paged),
        cmocka_unit_test(visits_are_reviewed),
        cmocka_unit_test(many_are_changed_at_once),
        cmocka_unit_test(days_are_counted),
    };

    begin_ns = sst_clock_wall_ns();
    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
