/* Lists of visits, and their counts by days, read from the lines on disk. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/log.h"
#include "base/stats.h"
#include "daemon/visits/visits_internal.h"

static const char *const picture_names[] = { "camera", "seen" };

static bool has_zone(const json_t *data, const char *zone)
{
    const json_t *one;
    size_t i;

    json_array_foreach(json_object_get(data, "zones"), i, one)
    {
        if (json_is_string(one) && !strcmp(json_string_value(one), zone))
            return true;
    }
    return false;
}

/* A time, or the name of a visit: as names have it, without the Z that ends a time. */
static void key_of(char out[NAME_LENGTH + 1], const char *text)
{
    size_t n;

    snprintf(out, NAME_LENGTH + 1, "%s", text);
    n = strlen(out);
    for (size_t i = 0; i < n; i++)
        out[i] = out[i] == ':' || out[i] == '.' ? '-' : out[i];
    if (n && out[n - 1] == 'Z')
        out[n - 1] = 0;
}

/* Order of a visit's time and the moment, second, minute or day that a query names; 0: within it. Times are texts of
 * one form. */
static int compare_time(const char *visit, const char *query)
{
    const size_t n = strlen(query);

    return strncmp(visit, query, n && query[n - 1] == 'Z' ? n - 1 : n); /* a Z is later than a fraction */
}

static bool fits(const json_t *data, const struct sst_visits_query *q)
{
    return (!q->from || compare_time(visits_text(data, "to"), q->from) >= 0) &&
           (!q->to || compare_time(visits_text(data, "from"), q->to) <= 0) &&
           (!q->label || !strcmp(visits_text(data, "label"), q->label)) && (!q->zone || has_zone(data, q->zone));
}

/* Names that a query asks for. */
struct range {
    char before[NAME_LENGTH + 1], after[NAME_LENGTH + 1]; /* "": any */
    bool oldest;                                          /* first */
};

static struct range range_of(const struct sst_visits_query *q)
{
    struct range r = { .oldest = q->after && !q->before };

    key_of(r.before, q->before ? q->before : "");
    key_of(r.after, q->after ? q->after : "");
    return r;
}

static bool is_within(const struct range *r, const char *name)
{
    return (!r->before[0] || strcmp(name, r->before) < 0) && (!r->after[0] || strcmp(name, r->after) > 0);
}

/* Lines of a day. @return text to free, or NULL: none that can be read */
static char *read_lines(const struct sst_visits *v, const char *day)
{
    char path[SST_PATH_MAX], why[SST_LOG_MAX] = "", *held;
    uint8_t *data = NULL;
    size_t size;
    int err = visits_day_path(path, v, day, VISITS_LINES);

    held = sst_log_hold_errors(why);
    err = err ? err : sst_file_read(path, DAY_MOST, &data, &size);
    sst_log_hold_errors(held);
    return err ? NULL : (char *)data;
}

json_t *visits_read_day(const struct sst_visits *v, const char *day)
{
    json_t *all = json_object();
    char *data = read_lines(v, day), *next = NULL;

    for (char *line = data ? strtok_r(data, "\n", &next) : NULL; line; line = strtok_r(NULL, "\n", &next)) {
        json_t *o = json_loads(line, 0, NULL); /* the last line may be cut off */
        const char *name = visits_text(o, "visit");

        if (visits_is_name(name))
            (void)json_object_set(all, name, o);
        json_decref(o);
    }
    free(data);
    return all;
}

/* The names of a day's visits alone. @return object, or NULL: out of memory */
static json_t *read_names(const struct sst_visits *v, const char *day)
{
    static const char begin[] = "{\"visit\":\"";
    json_t *all = json_object();
    char *data = read_lines(v, day), *next = NULL, *end;

    for (char *line = data ? strtok_r(data, "\n", &next) : NULL; line; line = strtok_r(NULL, "\n", &next)) {
        char *name = line + sizeof(begin) - 1;

        if (strncmp(line, begin, sizeof(begin) - 1) != 0 || line[strlen(line) - 1] != '}' ||
            !(end = strchr(name, '"'))) {
            json_t *o = json_loads(line, 0, NULL); /* written by another program, or cut off */

            if (visits_is_name(visits_text(o, "visit")))
                (void)json_object_set_new(all, visits_text(o, "visit"), json_true());
            json_decref(o);
            continue;
        }
        *end = 0;
        if (visits_is_name(name))
            (void)json_object_set_new(all, name, json_true());
    }
    free(data);
    return all;
}

static void add_facts(const struct sst_visits *v, json_t *data, const json_t *reviewed, const char *user)
{
    const char *name = visits_text(data, "visit");
    json_t *list = json_array(), *by = json_object_get(reviewed, name);

    for (int i = 0; i < 2; i++) {
        char path[SST_PATH_MAX];

        if (!visits_file_path(path, v, name, visits_picture_files[i]) && !access(path, R_OK))
            json_array_append_new(list, json_string(picture_names[i]));
    }
    json_object_set_new(data, "pictures", list);
    json_object_set_new(data, "keep", json_boolean(visits_is_kept(v, name)));
    json_object_set_new(data, "reviewed", json_boolean(visits_is_reviewed(reviewed, name, user)));
    json_object_set_new(data, "reviewed_by", by ? json_incref(by) : json_array());
    /* Of a service that was killed: it has no end. */
    if (strcmp(visits_text(data, "from"), v->start) < 0)
        json_object_set_new(data, "active", json_false());
}

/* Add visits of a day that fit: the newest first, or the oldest. */
static void add_day(const struct sst_visits *v, const char *day, const struct sst_visits_query *q, json_t *out)
{
    const struct range range = range_of(q);
    json_t *all = visits_read_day(v, day), *reviewed = visits_reviewed(v, day), *data;
    const size_t n = json_object_size(all);
    char **name = n ? malloc(n * sizeof(*name)) : NULL;
    const char *key;
    int count = 0;

    json_object_foreach(all, key, data)
    {
        if (name && fits(data, q) && is_within(&range, key) &&
            (!q->reviewed || visits_is_reviewed(reviewed, key, q->user) == (q->reviewed > 0)))
            name[count++] = (char *)(uintptr_t)key;
    }
    sst_stats_sort_strings(name, count);
    for (int i = 0; i < count && (int)json_array_size(out) < q->limit; i++) {
        data = json_object_get(all, name[range.oldest ? i : count - 1 - i]);
        add_facts(v, data, reviewed, q->user);
        json_array_append(out, data);
    }
    free(name);
    json_decref(reviewed);
    json_decref(all);
}

/* A visit that began the day before may still have been there. */
static bool may_have(const struct sst_visits_query *q, const char *day, const char *next_day)
{
    return !(q->to && strncmp(day, q->to, DAY) > 0) && !(q->from && next_day && strncmp(next_day, q->from, DAY) < 0) &&
           !(q->before && strncmp(day, q->before, DAY) > 0) && !(q->after && strncmp(day, q->after, DAY) < 0);
}

static json_t *reversed(json_t *list)
{
    json_t *out = json_array();

    for (size_t i = json_array_size(list); out && i-- > 0;)
        json_array_append(out, json_array_get(list, i));
    json_decref(list);
    return out;
}

json_t *sst_visits_list(struct sst_visits *v, const struct sst_visits_query *q)
{
    const bool oldest = q->after && !q->before;
    json_t *out = json_array();
    struct dirent **day = NULL;
    const int n = v->dir[0] ? visits_days(v, &day) : 0;

    for (int k = 0; k < n; k++) {
        const int i = oldest ? n - 1 - k : k;

        if (out && may_have(q, day[i]->d_name, i > 0 ? day[i - 1]->d_name : NULL) &&
            (int)json_array_size(out) < q->limit)
            add_day(v, day[i]->d_name, q, out);
    }
    for (int i = 0; i < n; i++)
        free(day[i]);
    free(day);
    return oldest ? reversed(out) : out;
}

/* --- counting by days --------------------------------------------------------------------------------------------- */

/* The day of a time zone on which a visit came. @return false: the name has no time */
static bool day_of(char out[SST_CLOCK_TEXT], const char *name, int offset_min)
{
    struct tm t = { 0 };

    if (!visits_is_name(name) ||
        sscanf(name, "%4d-%2d-%2dT%2d-%2d", &t.tm_year, &t.tm_mon, &t.tm_mday, &t.tm_hour, &t.tm_min) != 5)
        return false;
    t.tm_year -= 1900;
    t.tm_mon--;
    t.tm_min += offset_min;
    (void)timegm(&t); /* carries the minutes */
    return strftime(out, SST_CLOCK_TEXT, "%Y-%m-%d", &t) == DAY;
}

static void add_count(json_t *days, const char *day, const char *key, int more)
{
    json_t *one = json_object_get(days, day);

    if (!one) {
        one = json_pack("{s:s, s:i, s:i}", "day", day, "visits", 0, "reviewed", 0);
        json_object_set_new(days, day, one);
    }
    json_object_set_new(one, key, json_integer(json_integer_value(json_object_get(one, key)) + more));
}

/* The names are enough unless there is a filter: a month may have 100 MB of lines. */
static void count_day(const struct sst_visits *v, const char *utc_day, const struct sst_visits_query *q, int offset_min,
                      json_t *days)
{
    json_t *all = q->label || q->zone ? visits_read_day(v, utc_day) : read_names(v, utc_day);
    json_t *reviewed = visits_reviewed(v, utc_day), *data;
    char day[SST_CLOCK_TEXT];
    const char *name;

    json_object_foreach(all, name, data)
    {
        const struct sst_visits_query kinds = { .label = q->label, .zone = q->zone };

        if (!day_of(day, name, offset_min) || (q->from && strncmp(day, q->from, DAY) < 0) ||
            (q->to && strncmp(day, q->to, DAY) > 0) || ((q->label || q->zone) && !fits(data, &kinds)))
            continue;
        add_count(days, day, "visits", 1);
        if (visits_is_reviewed(reviewed, name, q->user))
            add_count(days, day, "reviewed", 1);
    }
    json_decref(reviewed);
    json_decref(all);
}

json_t *sst_visits_days(struct sst_visits *v, const struct sst_visits_query *q, int offset_min)
{
    json_t *days = json_object(), *out = json_array();
    struct dirent **day = NULL;
    const int n = v->dir[0] ? visits_days(v, &day) : 0;
    char **name = malloc(sizeof(*name) * (size_t)(2 * n + 1)); /* a day of names is on two of a time zone */
    const char *key;
    json_t *one;
    int count = 0;

    for (int i = 0; i < n; i++) {
        /* a day of names has visits of the days before and after, too */
        const bool later = q->to && i + 1 < n && strncmp(day[i + 1]->d_name, q->to, DAY) > 0;
        const bool earlier = q->from && i > 0 && strncmp(day[i - 1]->d_name, q->from, DAY) < 0;

        if (days && !later && !earlier)
            count_day(v, day[i]->d_name, q, offset_min, days);
    }
    json_object_foreach(days, key, one)
    {
        if (name && count < 2 * n)
            name[count++] = (char *)(uintptr_t)key;
    }
    sst_stats_sort_strings(name, name ? count : 0);
    while (name && count-- > 0)
        json_array_append(out, json_object_get(days, name[count]));
    free(name);
    for (int i = 0; i < n; i++)
        free(day[i]);
    free(day);
    json_decref(days);
    return out;
}
