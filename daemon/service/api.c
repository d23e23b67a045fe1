/* What can be asked of the service: struct sst_api, made of its parts. */
#define _XOPEN_SOURCE 700 /* strptime */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "daemon/service/service_internal.h"

static int labels(void *arg, struct sst_api_answer *out)
{
    return viewer_labels(((struct sst_service *)arg)->viewer, out);
}

static int views(void *arg, struct sst_api_answer *out)
{
    return viewer_views(((struct sst_service *)arg)->viewer, out);
}

static int view_create(void *arg, const json_t *settings, struct sst_api_answer *out)
{
    return viewer_view_create(((struct sst_service *)arg)->viewer, settings, out);
}

static int view_change(void *arg, const char *id, const json_t *settings, struct sst_api_answer *out)
{
    return viewer_view_change(((struct sst_service *)arg)->viewer, id, settings, out);
}

static int pick(void *arg, const char *id, double x, double y, struct sst_api_answer *out)
{
    return viewer_pick(((struct sst_service *)arg)->viewer, id, x, y, out);
}

static int calibration_check(void *arg, struct sst_api_answer *out)
{
    return viewer_calibration_check(((struct sst_service *)arg)->viewer, out);
}

static int outlet(void *arg, enum sst_api_picture kind, const char *name, struct sst_outlet **out)
{
    return viewer_outlet(((struct sst_service *)arg)->viewer, kind, name, out);
}

static int reload(void *arg, bool dry_run, struct sst_api_answer *out)
{
    return service_apply(arg, dry_run, out);
}

/* --- requests ----------------------------------------------------------------------------------------------------- */

static int answer_name(struct sst_api_answer *out, const char *name)
{
    out->body = json_pack("{s:s}", "name", name);
    return out->body ? 0 : -ENOMEM;
}

/** What a failure of the disk or a lack of sets means here. */
static int explain(struct sst_service *s, int err, struct sst_api_answer *out)
{
    json_t *status = err == -ENOSPC || err == -EROFS || err == -EIO ? sst_storage_status(s->storage) : NULL;
    const char *reason = json_string_value(json_object_get(status, "reason"));

    if (status)
        snprintf(out->error, sizeof(out->error), "nothing can be kept: %s",
                 reason && reason[0] ? reason : strerror(-err));
    else if (err == -ENODATA)
        snprintf(out->error, sizeof(out->error), "nothing has been captured yet");
    else if (err)
        snprintf(out->error, sizeof(out->error), "this could not be done: %s", strerror(-err));
    json_decref(status);
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
    if (!action || (strcmp(action, "start") && strcmp(action, "stop"))) {
        snprintf(out->error, sizeof(out->error), "action must be \"start\" or \"stop\"");
        return -EINVAL;
    }
    if (seconds && !json_is_null(seconds) && (!json_is_number(seconds) || !(length_s >= 0 && length_s <= 1e7))) {
        snprintf(out->error, sizeof(out->error), "seconds must be a number from 0 (until stopped) to 10000000");
        return -EINVAL;
    }
    if (!strcmp(action, "start")) {
        err = sst_storage_record(s->storage, length_s, name);
        return err ? explain(s, err, out) : answer_name(out, name);
    }
    err = sst_storage_stop(s->storage);
    if (err == -ENOENT) {
        snprintf(out->error, sizeof(out->error), "nothing is being recorded on demand");
        return -EAGAIN;
    }
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
    struct sst_outlet *from = NULL;
    const struct sst_jpeg *jpeg = NULL;
    char name[64];
    int err = sst_api_members(request, known, out->error);

    if (err)
        return err;
    if (!id || viewer_outlet(s->viewer, SST_PICTURE_VIEW, id, &from)) {
        snprintf(out->error, sizeof(out->error), "there is no view %.32s", id ? id : "of that kind");
        return -ENOENT;
    }
    jpeg = sst_outlet_get(from, 0);
    err = sst_storage_snapshot(s->storage, jpeg ? jpeg->data : NULL, jpeg ? jpeg->bytes : 0, name);
    if (jpeg)
        sst_jpeg_unref(jpeg);
    sst_outlet_unref(from);
    return err ? explain(s, err, out) : answer_name(out, name);
}

static int recordings(void *arg, struct sst_api_answer *out)
{
    out->body = sst_storage_list(((struct sst_service *)arg)->storage);
    return out->body ? 0 : -ENOMEM;
}

/** "2026-11-21T18:05:00Z", with a fraction if need be. */
static bool read_time(const char *text, int64_t *wall_ns)
{
    struct tm tm = { 0 };
    const char *end = text ? strptime(text, "%Y-%m-%dT%H:%M:%S", &tm) : NULL;
    double fraction = 0;
    char *after;

    if (!end)
        return false;
    if (*end == '.') {
        fraction = strtod(end, &after);
        end = after;
    }
    if (strcmp(end, "Z") || !(fraction >= 0 && fraction < 1) || tm.tm_year < 70 || tm.tm_year > 200)
        return false;
    *wall_ns = (int64_t)timegm(&tm) * 1000000000 + (int64_t)(fraction * 1e9);
    return true;
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
    if (!read_time(json_string_value(json_object_get(request, "time")), &wall_ns)) {
        snprintf(out->error, sizeof(out->error), "time must be like \"2026-11-21T18:05:00.5Z\"");
        return -EINVAL;
    }
    err = sst_storage_export(s->storage, recording && recording[0] ? recording : NULL, wall_ns, name);
    if (err == -ENOENT)
        snprintf(out->error, sizeof(out->error), "there is no set within 10 s of that moment in %.64s",
                 recording && recording[0] ? recording : "the recordings");
    else if (err == -EBADMSG)
        snprintf(out->error, sizeof(out->error),
                 "the recording is damaged at that moment; the journal names the frame");
    else if (err)
        return explain(s, err, out);
    return err ? err : answer_name(out, name);
}

static int delete_kept(void *arg, const json_t *request, struct sst_api_answer *out)
{
    static const char *const known[] = { "name", NULL };
    struct sst_service *s = arg;
    const char *name = json_string_value(json_object_get(request, "name"));
    int err = sst_api_members(request, known, out->error);

    if (err)
        return err;
    if (!name || !name[0]) {
        snprintf(out->error, sizeof(out->error), "name must be that of a recording, snapshot or export");
        return -EINVAL;
    }
    err = sst_storage_delete(s->storage, name);
    if (err == -ENOENT)
        snprintf(out->error, sizeof(out->error), "there is no recording, snapshot or export %.64s", name);
    else if (err == -EBUSY)
        snprintf(out->error, sizeof(out->error), "%.64s is still being written; delete it when it has ended", name);
    else if (err)
        snprintf(out->error, sizeof(out->error), "%.64s cannot be removed from the disk: %s; the journal says more",
                 name, strerror(-err));
    return err ? err : answer_name(out, name);
}

static int download(void *arg, const char *name, struct sst_download **out)
{
    return sst_storage_download(((struct sst_service *)arg)->storage, name, out);
}

void service_api(struct sst_service *s)
{
    s->api = (struct sst_api){
        .arg = s,
        .status = service_status,
        .cameras = service_cameras,
        .labels = labels,
        .metrics = service_metrics,
        .views = views,
        .view_create = view_create,
        .view_change = view_change,
        .pick = pick,
        .reload = reload,
        .record = record,
        .snapshot = snapshot,
        .recordings = recordings,
        .export_ = export_moment,
        .delete_ = delete_kept,
        .calibration_check = calibration_check,
        .outlet = outlet,
        .download = download,
        .events = s->events,
    };
}
