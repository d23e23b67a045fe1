/* Verbs of struct sst_api about videos for others, and notifications. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/text.h"
#include "daemon/service/service_internal.h"

#define LEAD_NS  INT64_C(3000000000) /* of a visit's video before its beginning and after its end */
#define KEY_FILE "signing-key.pem"   /* beside the control token */

void service_site(char out[256], const struct sst_config *c)
{
    out[0] = out[255] = 0;
    if (c->site[0])
        snprintf(out, 256, "%s", c->site);
    else
        (void)gethostname(out, 255);
}

static void count_cases(void *storage, int64_t bytes)
{
    sst_storage_aside(storage, SST_STORAGE_ASIDE_CASES, bytes);
}

int service_open_cases(struct sst_service *s)
{
    const char *token = s->config.web.token_file;
    char key[SST_PATH_MAX], site[256];
    const struct sst_cases_config cfg = {
        .storage = s->storage, .dir = s->config.storage.dir, .key = key, .site = site
    };
    int err;

    snprintf(key, sizeof(key), "%.*s" KEY_FILE, (int)(sst_path_base(token) - token), token);
    service_site(site, &s->config);
    err = sst_cases_open(&s->cases, &cfg);
    if (!err)
        sst_cases_report(s->cases, count_cases, s->storage);
    return err;
}

void service_configure_cases(struct sst_service *s, const struct sst_config *to)
{
    char site[256];

    service_site(site, to);
    sst_cases_configure(s->cases, site);
}

/* --- spans of a request ------------------------------------------------------------------------------------------- */

static void title_of(char out[128], const char *what, int64_t wall_ns)
{
    const time_t seconds = (time_t)(wall_ns / 1000000000);
    char when[32], part[81];
    struct tm tm;

    localtime_r(&seconds, &tm);
    strftime(when, sizeof(when), "%Y-%m-%d %H:%M:%S", &tm);
    snprintf(part, sizeof(part), "%s", what);
    sst_text_end_whole(part);
    snprintf(out, 128, "%s, %s", part, when);
}

/* The data of a visit by its name, which begins with its time: "2026-11-21T18-05-00-123Z-7". @return NULL: none is kept */
static json_t *find_visit(struct sst_service *s, const char *name)
{
    int year, month, day, hour, minute, second, ms;
    struct sst_visits_query query = { .limit = 1000 };
    json_t *list, *visit, *found = NULL;
    char at[SST_CLOCK_TEXT];
    size_t i;

    if (sscanf(name, "%4d-%2d-%2dT%2d-%2d-%2d-%3dZ", &year, &month, &day, &hour, &minute, &second, &ms) != 7)
        return NULL;
    snprintf(at, sizeof(at), "%.13s:%.2s:%.2s.%.3sZ", name, name + 14, name + 17, name + 20);
    query.from = query.to = at;
    list = sst_visits_list(s->visits, &query);
    json_array_foreach(list, i, visit)
    {
        const char *other = json_string_value(json_object_get(visit, "visit"));

        if (!found && other && !strcmp(other, name))
            found = json_incref(visit);
    }
    json_decref(list);
    return found;
}

/* Facts of a visit for a manifest, which has no fractions. */
static json_t *facts_of(const json_t *visit)
{
    static const char *const keys[] = { "visit", "label", "hidden", "direction", "zones", "from", "to" };
    const json_t *nearest_m = json_object_get(visit, "nearest_m");
    json_t *facts = json_object();

    for (size_t i = 0; i < ARRAY_LEN(keys); i++)
        json_object_set(facts, keys[i], json_object_get(visit, keys[i]));
    if (json_is_real(nearest_m))
        json_object_set_new(facts, "nearest_mm", json_integer((json_int_t)(json_real_value(nearest_m) * 1000)));
    return facts;
}

static int span_of_visit(struct sst_service *s, const json_t *name, struct sst_case_span *span, char *error)
{
    const char *text = json_string_value(name), *label;
    json_t *visit;

    *span = (struct sst_case_span){ .visit = text && strlen(text) < 64 ? find_visit(s, text) : NULL };
    if (!span->visit)
        return sst_api_refuse(error, -ENOENT, "there is no visit %.64s", text ? text : "of that kind");
    if (!sst_clock_read(json_string_value(json_object_get(span->visit, "from")), &span->from_ns) ||
        !sst_clock_read(json_string_value(json_object_get(span->visit, "to")), &span->to_ns))
        return sst_api_refuse(error, -ENOENT, "the visit %.64s has no time", text);
    label = json_string_value(json_object_get(span->visit, "label"));
    title_of(span->title, label && *label ? label : "Something", span->from_ns);
    visit = span->visit;
    span->visit = facts_of(visit);
    json_decref(visit);
    span->from_ns -= LEAD_NS;
    span->to_ns += LEAD_NS;
    if (span->to_ns - span->from_ns > SST_CASE_S_MOST * INT64_C(1000000000)) /* its first hour */
        span->to_ns = span->from_ns + SST_CASE_S_MOST * INT64_C(1000000000);
    return 0;
}

static int span_of_times(const json_t *request, struct sst_case_span *span, char *error)
{
    const char *recording = json_string_value(json_object_get(request, "recording"));
    const char *title = json_string_value(json_object_get(request, "title"));

    *span = (struct sst_case_span){ .from_ns = 0 };
    if (!sst_clock_read(json_string_value(json_object_get(request, "from")), &span->from_ns) ||
        !sst_clock_read(json_string_value(json_object_get(request, "to")), &span->to_ns))
        return sst_api_refuse(error, -EINVAL,
                              "give visits: [names], or from and to like \"2026-11-21T18:05:00.5Z\"");
    if (span->to_ns <= span->from_ns || span->to_ns - span->from_ns > SST_CASE_S_MOST * INT64_C(1000000000))
        return sst_api_refuse(error, -EINVAL, "to must be after from, by an hour at most");
    if (recording && strlen(recording) >= sizeof(span->recording))
        return sst_api_refuse(error, -ENOENT, "there is no recording %.64s", recording);
    snprintf(span->recording, sizeof(span->recording), "%s", recording ? recording : "");
    title_of(span->title, title && *title ? title : "Recording", span->from_ns);
    return 0;
}

/* Is there a recording of its beginning? A span may begin a little before one. */
static int check_recorded(struct sst_service *s, const struct sst_case_span *span, char *error)
{
    char name[64], dir[SST_PATH_MAX], when[SST_CLOCK_TEXT];
    const int err =
        sst_storage_hold(s->storage, span->recording[0] ? span->recording : NULL, span->from_ns, name, dir);

    if (!err) {
        sst_storage_release(s->storage, name);
        return 0;
    }
    sst_clock_text(when, span->from_ns);
    return sst_api_refuse(error, -ENOENT, "%s%.64s%s has %s: without a recording there is no video",
                          span->recording[0] ? "recording " : "no recording", span->recording,
                          span->recording[0] ? " does not exist or" : "", when);
}

static int read_spans(struct sst_service *s, const json_t *request, struct sst_case_span *span, int *count, char *error)
{
    const json_t *visits = json_object_get(request, "visits"), *one;
    size_t i;
    int err = 0;

    if (visits && (json_object_get(request, "from") || json_object_get(request, "to")))
        return sst_api_refuse(error, -EINVAL, "give visits, or from and to, not both");
    if (visits && (!json_is_array(visits) || !json_array_size(visits) || json_array_size(visits) > SST_CASE_SPANS_MAX))
        return sst_api_refuse(error, -EINVAL, "visits must be a list of 1 to %d names", SST_CASE_SPANS_MAX);
    if (!visits) {
        err = span_of_times(request, span, error);
        *count = 1;
    }
    json_array_foreach(visits, i, one)
    {
        if (err)
            break;
        err = span_of_visit(s, one, &span[i], error);
        *count = (int)i + 1;
    }
    for (int k = 0; !err && k < *count; k++)
        err = check_recorded(s, &span[k], error);
    return err;
}

/* --- verbs -------------------------------------------------------------------------------------------------------- */

int service_cases(void *arg, struct sst_api_answer *out)
{
    out->body = sst_cases_list(((struct sst_service *)arg)->cases);
    return out->body ? 0 : -ENOMEM;
}

int service_case_create(void *arg, const json_t *request, struct sst_api_answer *out)
{
    static const char *const known[] = { "visits", "from", "to", "recording", "title", NULL };
    struct sst_service *s = arg;
    struct sst_case_span *span;
    char name[SST_CASE_NAME];
    int count = 0, err = sst_api_members(request, known, out->error);

    if (err)
        return err;
    span = calloc(SST_CASE_SPANS_MAX, sizeof(*span));
    if (!span)
        return -ENOMEM;
    err = read_spans(s, request, span, &count, out->error);
    if (!err) {
        err = sst_cases_add(s->cases, span, count, name);
        if (err == -EBUSY)
            sst_api_refuse(out->error, err, "four videos are waiting already; try again when one is ready");
    }
    for (int i = 0; i < count; i++)
        json_decref(span[i].visit);
    free(span);
    if (!err) {
        out->body = json_pack("{s:s}", "name", name);
        err = out->body ? 0 : -ENOMEM;
    }
    return err;
}

int service_case_change(void *arg, const char *name, const json_t *request, struct sst_api_answer *out)
{
    static const char *const known[] = { "delete", NULL };
    int err = sst_api_members(request, known, out->error);

    if (err)
        return err;
    if (!json_is_true(json_object_get(request, "delete")))
        return sst_api_refuse(out->error, -EINVAL, "give delete: true; it ends a video that is being made");
    err = sst_cases_remove(((struct sst_service *)arg)->cases, name);
    if (err == -ENOENT)
        return sst_api_refuse(out->error, err, "there is no video %.64s", name);
    if (err)
        return sst_api_refuse(out->error, err, "%.64s is being downloaded; try again later", name);
    out->body = json_pack("{s:s}", "deleted", name);
    return out->body ? 0 : -ENOMEM;
}

int service_signing_key(void *arg, char **pem)
{
    char text[SST_EVIDENCE_PEM], print[SST_EVIDENCE_PRINT];
    const int err = sst_cases_key(((struct sst_service *)arg)->cases, text, print);

    if (err)
        return err;
    *pem = malloc(strlen(text) + sizeof(print) + 64);
    if (!*pem)
        return -ENOMEM;
    sprintf(*pem, "# Ed25519; SHA-256 of the key: %s\n%s", print, text);
    return 0;
}

int service_push(void *arg, struct sst_api_answer *out)
{
    out->body = sst_push_state(((struct sst_service *)arg)->push);
    return out->body ? 0 : -ENOMEM;
}

int service_push_change(void *arg, const json_t *request, struct sst_api_answer *out)
{
    static const char *const known[] = { "endpoint", "p256dh", "auth", "labels", "zones", "cool_down_s", "delete", "test",
                                         NULL };
    int err = sst_api_members(request, known, out->error);

    err = err ? err : sst_push_change(((struct sst_service *)arg)->push, request, out->error);
    if (err)
        return err;
    out->body = json_pack("{s:b}", "subscribed", !json_is_true(json_object_get(request, "delete")));
    return out->body ? 0 : -ENOMEM;
}
