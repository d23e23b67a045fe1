/* Functions of struct sst_api: the service's own, and calls of the live engine passed on. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#define REFUSED_NS  INT64_C(60000000000) /* between events about wrong passwords */
#define VISITS_MOST 1000                 /* that one request changes */

/* --- requests ----------------------------------------------------------------------------------------------------- */

static int answer_name(struct sst_api_answer *out, const char *name)
{
    out->body = json_pack("{s:s}", "name", name);
    return out->body ? 0 : -ENOMEM;
}

/** Status of a failure of the disk or a lack of sets. */
static int explain(struct sst_service *s, int err, struct sst_api_answer *out)
{
    struct sst_storage_report storage;

    if (err == -ENOSPC || err == -EROFS || err == -EIO) {
        sst_storage_report(s->storage, &storage);
        snprintf(out->error, sizeof(out->error), "nothing can be stored: %.480s",
                 storage.reason[0] ? storage.reason : "the disk does not answer in time; the service's log says more");
    } else if (err == -ENODATA) {
        snprintf(out->error, sizeof(out->error), "nothing has been captured yet");
    } else if (err == -ENOTSUP) {
        snprintf(out->error, sizeof(out->error), "%s", SST_STORE_NO_MUXER);
    } else if (err) {
        snprintf(out->error, sizeof(out->error), "the request failed: %s", strerror(-err));
    }
    return err;
}

static int record(void *arg, const json_t *request, struct sst_api_answer *out)
{
    static const char *const known[] = { "action", "seconds", NULL };
    struct sst_service *s = arg;
    const char *action = json_string_value(json_object_get(request, "action"));
    const json_t *seconds = json_object_get(request, "seconds");
    const double length_s = seconds && !json_is_null(seconds) ? json_number_value(seconds) : 0;
    char name[64];
    int err = sst_api_members(request, known, out->error);

    if (err)
        return err;
    if (!action || (strcmp(action, "start") && strcmp(action, "stop")))
        return sst_api_refuse(out->error, -EINVAL, "action must be \"start\" or \"stop\"");
    if (seconds && !json_is_null(seconds) && (!json_is_number(seconds) || !(length_s >= 0 && length_s <= 1e7)))
        return sst_api_refuse(out->error, -EINVAL, "seconds must be a number from 0 (until stopped) to 10000000");
    if (!strcmp(action, "start")) {
        err = sst_storage_record(s->storage, length_s, name);
        return err ? explain(s, err, out) : answer_name(out, name);
    }
    err = sst_storage_stop(s->storage);
    if (err == -ENOENT)
        return sst_api_refuse(out->error, -EAGAIN, "nothing is being recorded on demand");
    if (err)
        return explain(s, err, out);
    out->body = json_object();
    return out->body ? 0 : -ENOMEM;
}

static int snapshot(void *arg, const json_t *request, struct sst_api_answer *out)
{
    static const char *const known[] = { "view", NULL };
    struct sst_service *s = arg;
    const json_t *view = json_object_get(request, "view");
    const char *id = view ? json_string_value(view) : "main";
    struct sst_slot *from = NULL;
    const struct sst_jpeg *jpeg = NULL;
    char name[64];
    int err = sst_api_members(request, known, out->error);

    if (err)
        return err;
    if (!id || engine_outlet(s->engine, SST_PICTURE_VIEW, id, &from))
        return sst_api_refuse(out->error, -ENOENT, "there is no view %.32s", id ? id : "of that kind");
    jpeg = sst_slot_get(from, 0);
    err = sst_storage_snapshot(s->storage, jpeg ? jpeg->data : NULL, jpeg ? jpeg->bytes : 0, name);
    sst_slot_jpeg_unref(jpeg);
    sst_slot_unref(from);
    return err ? explain(s, err, out) : answer_name(out, name);
}

static int recordings(void *arg, struct sst_api_answer *out)
{
    out->body = sst_storage_list(((struct sst_service *)arg)->storage);
    return out->body ? 0 : -ENOMEM;
}

static int export_moment(void *arg, const json_t *request, struct sst_api_answer *out)
{
    static const char *const known[] = { "time", "recording", NULL };
    struct sst_service *s = arg;
    const char *recording = json_string_value(json_object_get(request, "recording"));
    int64_t wall_ns;
    char name[64];
    int err = sst_api_members(request, known, out->error);

    if (err)
        return err;
    if (!sst_clock_read(json_string_value(json_object_get(request, "time")), &wall_ns))
        return sst_api_refuse(out->error, -EINVAL, "time must be like \"2026-11-21T18:05:00.5Z\"");
    err = sst_storage_export(s->storage, recording && recording[0] ? recording : NULL, wall_ns, name);
    if (err == -ENOENT)
        return sst_api_refuse(out->error, err, "there is no set within 10 s of that moment in %.64s",
                              recording && recording[0] ? recording : "the recordings");
    if (err == -EBADMSG)
        return sst_api_refuse(out->error, err, "the recording is damaged at that moment; the journal names the frame");
    return err ? explain(s, err, out) : answer_name(out, name);
}

static int delete_kept(void *arg, const json_t *request, struct sst_api_answer *out)
{
    static const char *const known[] = { "name", NULL };
    struct sst_service *s = arg;
    const char *name = json_string_value(json_object_get(request, "name"));
    int err = sst_api_members(request, known, out->error);

    if (err)
        return err;
    if (!name || !name[0])
        return sst_api_refuse(out->error, -EINVAL, "name must be that of a recording, snapshot or export");
    err = sst_storage_delete(s->storage, name);
    if (err == -ENOENT)
        snprintf(out->error, sizeof(out->error), "there is no recording, snapshot or export %.64s", name);
    else if (err == -EBUSY)
        snprintf(out->error, sizeof(out->error), "%.64s is still being written; delete it when it has ended", name);
    else if (err)
        snprintf(out->error, sizeof(out->error), "%.64s cannot be removed from the disk: %s; see the journal", name,
                 strerror(-err));
    return err ? err : answer_name(out, name);
}

/* Rate-limited: a recorder with a wrong password tries again for ever. */
static void report_refused(struct sst_service *s, const char *address, const char *over)
{
    const int64_t now_ns = sst_clock_now_ns();
    bool report;

    if (!address[0] || address[strspn(address, "0123456789abcdefABCDEF.:%")])
        return;
    pthread_mutex_lock(&s->lock);
    report = !s->refused_ns || now_ns - s->refused_ns > REFUSED_NS;
    s->refused_ns = report ? now_ns : s->refused_ns;
    pthread_mutex_unlock(&s->lock);
    if (report)
        sst_events_emit(s->events, SST_EVENT_WARNING, "client",
                        json_pack("{s:s, s:s}", "reason", "wrong password", "address", address),
                        "%.64s sent a wrong user or password over %s", address, over);
}

static int publisher(void *arg, const json_t *request, struct sst_api_answer *out)
{
    static const char *const known[] = { "name", "pid", "clients", "refused", "problem", NULL };
    struct sst_service *s = arg;
    const char *name = json_string_value(json_object_get(request, "name"));
    const char *refused = json_string_value(json_object_get(request, "refused"));
    const char *problem = json_string_value(json_object_get(request, "problem"));
    const json_int_t pid = json_integer_value(json_object_get(request, "pid"));
    const json_int_t clients = json_integer_value(json_object_get(request, "clients"));
    const bool onvif = name && !strcmp(name, "onvif");
    const int err = sst_api_members(request, known, out->error);

    if (err)
        return err;
    if (!name || (!onvif && strcmp(name, "rtsp") != 0) || pid < 1 || pid > INT32_MAX || clients < 0 || clients > INT32_MAX)
        return sst_api_refuse(out->error, -EINVAL, "name must be \"rtsp\" or \"onvif\", pid and clients whole numbers");
    sst_counters_report(&s->counters, onvif ? SST_COUNTERS_ONVIF : SST_COUNTERS_RTSP, (int)pid, (int)clients,
                        problem ? problem : "");
    report_refused(s, refused ? refused : "", onvif ? "ONVIF" : "RTSP");
    out->body = json_object();
    return out->body ? 0 : -ENOMEM;
}

static int download(void *arg, const char *name, struct sst_download **out)
{
    struct sst_service *s = arg;

    if (!strncmp(name, SST_CASE_PREFIX, strlen(SST_CASE_PREFIX)))
        return sst_cases_download(s->cases, name, out);
    return sst_storage_download(s->storage, name, out);
}

/* One more than asked for says whether there are others. */
static int list_visits(void *arg, const struct sst_visits_query *query, struct sst_api_answer *out)
{
    struct sst_visits_query q = *query;
    json_t *list;
    bool more;

    q.limit++;
    list = sst_visits_list(((struct sst_service *)arg)->visits, &q);
    more = (int)json_array_size(list) > query->limit;
    if (more)
        json_array_remove(list, q.after && !q.before ? 0 : json_array_size(list) - 1);
    out->body = list ? json_pack("{s:o, s:b}", "visits", list, "more", more) : NULL;
    return out->body ? 0 : -ENOMEM;
}

static int visit_days(void *arg, const struct sst_visits_query *query, int offset_min, struct sst_api_answer *out)
{
    json_t *list = sst_visits_days(((struct sst_service *)arg)->visits, query, offset_min);

    out->body = list ? json_pack("{s:o}", "days", list) : NULL;
    return out->body ? 0 : -ENOMEM;
}

/* @param member  out, of the answer @return false: not one change */
static bool read_visit_change(const json_t *request, enum sst_visits_change *what, const char **member)
{
    const json_t *keep = json_object_get(request, "keep"), *gone = json_object_get(request, "delete");
    const json_t *reviewed = json_object_get(request, "reviewed");

    if (!!keep + !!gone + !!reviewed != 1 || !(gone ? json_is_true(gone) : json_is_boolean(keep ? keep : reviewed)))
        return false;
    *member = keep ? "keep" : gone ? "deleted" : "reviewed";
    *what = keep                     ? json_is_true(keep) ? SST_VISITS_KEEP : SST_VISITS_RELEASE
            : gone                   ? SST_VISITS_DELETE
            : json_is_true(reviewed) ? SST_VISITS_REVIEWED
                                     : SST_VISITS_UNREVIEWED;
    return true;
}

static int visit_fault(int err, const char *visit, char error[512])
{
    switch (err) {
    case -EINPROGRESS:
        return sst_api_refuse(error, -EBUSY, "this visit has not ended; delete it when it has");
    case -EBUSY:
        return sst_api_refuse(error, -EBUSY, "the disk of storage.dir does not answer; try again");
    case -EUSERS:
        return sst_api_refuse(error, -EBUSY, "32 users have reviewed visit %.64s already; no more are noted", visit);
    case -ENOENT:
        return sst_api_refuse(error, -ENOENT, "there is no visit %.64s", visit);
    default:
        return sst_api_refuse(error, err, "visits below storage.dir cannot be written: %s", strerror(-err));
    }
}

/* Names of a request; one of the address, or many. @return NULL: none, or too many */
static json_t *visit_names(const char *visit, const json_t *request)
{
    json_t *names = json_object_get(request, "visits"), *one;
    size_t i;

    if (visit)
        return names ? NULL : json_pack("[s]", visit);
    json_array_foreach(names, i, one)
    {
        if (!json_is_string(one))
            return NULL;
    }
    return i > 0 && i <= VISITS_MOST ? json_incref(names) : NULL;
}

static int change_visit(void *arg, const char *visit, const char *user, const json_t *request,
                        struct sst_api_answer *out)
{
    static const char *const known[] = { "keep", "delete", "reviewed", "visits", NULL };
    json_t *names = visit_names(visit, request), *failed = json_object(), *faults = json_array(), *one;
    enum sst_visits_change what = SST_VISITS_KEEP;
    const char *member = "", *name;
    int err = sst_api_members(request, known, out->error);

    if (!err && (!names || !read_visit_change(request, &what, &member)))
        err =
            sst_api_refuse(out->error, -EINVAL, "give keep: true or false, reviewed: true or false, or delete: true%s",
                           visit ? "" : ", and visits: an array of 1 to 1000 names");
    if (!err && (err = sst_visits_change(((struct sst_service *)arg)->visits, names, what, user, failed)))
        err = visit_fault(err, "", out->error);
    json_object_foreach(failed, name, one)
    {
        const int why = visit_fault((int)json_integer_value(one), name, out->error);

        err = visit ? why : err;
        json_array_append_new(faults, json_pack("{s:s, s:s}", "visit", name, "error", out->error));
    }
    if (!err)
        out->body = visit ? json_pack("{s:s, s:b}", "visit", visit, member,
                                      what != SST_VISITS_RELEASE && what != SST_VISITS_UNREVIEWED)
                          : json_pack("{s:i, s:O}", "changed", (int)(json_array_size(names) - json_array_size(faults)),
                                      "failed", faults);
    json_decref(names);
    json_decref(failed);
    json_decref(faults);
    return err ? err : out->body ? 0 : -ENOMEM;
}

static int read_visit(void *arg, const char *visit, enum sst_visit_picture kind, uint8_t **data, size_t *size)
{
    return sst_visits_read_picture(((struct sst_service *)arg)->visits, visit, kind, data, size);
}

void service_api(struct sst_service *s)
{
    s->api = (struct sst_api){
        .arg = s,
        .live = s->engine,
        .status = service_status,
        .cameras = service_cameras,
        .labels = engine_labels,
        .metrics = service_metrics,
        .tracks = engine_tracks,
        .visits = list_visits,
        .visit_days = visit_days,
        .visit_change = change_visit,
        .visit_picture = read_visit,
        .views = engine_views,
        .view_create = engine_view_create,
        .view_change = engine_view_change,
        .pick = engine_pick,
        .view_remove = engine_remove,
        .reload = service_apply,
        .zones = service_zones,
        .masks = service_masks,
        .zones_change = service_zones_change,
        .record = record,
        .snapshot = snapshot,
        .recordings = recordings,
        .export_ = export_moment,
        .delete_ = delete_kept,
        .publisher = publisher,
        .cases = service_cases,
        .case_create = service_case_create,
        .case_change = service_case_change,
        .signing_key = service_signing_key,
        .push = service_push,
        .push_change = service_push_change,
        .calibration_check = engine_calibration_check,
        .slot = engine_outlet,
        .download = download,
        .replayed = s->replay,
        .replay = replay_state,
        .replay_change = replay_change,
        .replay_take = replay_take,
        .replay_release = replay_release,
        .events = s->events,
    };
}
