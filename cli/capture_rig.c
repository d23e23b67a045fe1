/* sst capture rig: one camera stepped over a grid by a motor rig. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <jansson.h>
#include <linux/videodev2.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/statvfs.h>

#include "base/log.h"
#include "base/text.h"
#include "capture/rig/rig_camera.h"
#include "capture/rig/rig_still.h"
#include "cli/cli_internal.h"
#include "config/array.h"

/* Options that override still: in the configuration; NULL: not given. */
struct still_options {
    const char *files, *exposure, *aperture, *iso, *focus;
};

/* --- still camera ------------------------------------------------------------------------------------------------- */

/* For the estimates before a capture: a camera of 24 megapixels. */
#define JPEG_BYTES 10000000
#define RAW_BYTES  30000000
#define SHOT_S     2.0

/* "still", "still:ID": the serial or port, "" where there is none; NULL: another camera. */
static const char *still_selected(const char *camera)
{
    if (!camera || strncmp(camera, "still", 5) != 0)
        return NULL;
    return camera[5] == ':' ? camera + 6 : camera[5] ? NULL : "";
}

static int still_check(const struct cli_command *cmd, const char *still, const struct still_options *o)
{
    const char *option = o->files      ? "--files"
                         : o->exposure ? "--exposure"
                         : o->aperture ? "--aperture"
                         : o->iso      ? "--iso"
                         : o->focus    ? "--focus"
                                       : NULL;

    if (!still && option)
        return cli_usage_error(cmd, "%s sets a still camera; add --camera still, or use controls: in the configuration",
                               option);
    return CLI_GO_ON;
}

/* @return the index of a word, -1: none */
static int choose(const char *word, const char *const *words, int count)
{
    for (int i = 0; i < count; i++)
        if (!strcmp(word, words[i]))
            return i;
    return -1;
}

static void override(char *value, size_t size, const char *option)
{
    if (option)
        snprintf(value, size, "%s", option);
}

static int still_configure(const struct cli_command *cmd, const struct still_options *o, const char *format,
                           struct sst_array_config *a, struct sst_scan_config *cfg)
{
    static const char *const files[] = { "jpeg", "raw", "raw+jpeg" };
    static const char *const focuses[] = { "leave", "manual", "locked" };
    const int kind = o->files ? choose(o->files, files, ARRAY_LEN(files)) : (int)a->still_files;
    const int focus = o->focus ? choose(o->focus, focuses, ARRAY_LEN(focuses)) : (int)a->still_focus;

    if (kind < 0)
        return cli_usage_error(cmd, "--files %s is none of jpeg, raw and raw+jpeg", o->files);
    if (focus < 0)
        return cli_usage_error(cmd, "--focus %s is none of manual, locked and leave", o->focus);
    a->still_files = (enum sst_config_files)kind;
    a->still_focus = (enum sst_config_focus)focus;
    override(a->still_exposure, sizeof(a->still_exposure), o->exposure);
    override(a->still_aperture, sizeof(a->still_aperture), o->aperture);
    override(a->still_iso, sizeof(a->still_iso), o->iso);
    override(a->still_format, sizeof(a->still_format), format);
    cfg->fourcc = kind == SST_CONFIG_RAW ? SST_SCAN_RAW : V4L2_PIX_FMT_MJPEG;
    cfg->width = cfg->height = 0;
    cfg->shot_s = SHOT_S + a->still_mirror_ms / 1000.0;
    cfg->view_bytes = (kind != SST_CONFIG_RAW ? JPEG_BYTES : 0) + (kind != SST_CONFIG_JPEG ? RAW_BYTES : 0);
    return CLI_GO_ON;
}

static void still_text(const struct sst_array_config *a, char *text, size_t size)
{
    static const char *const files[] = { "jpeg", "raw", "raw+jpeg" };
    static const char *const focuses[] = { "leave", "manual", "locked" };

    text[0] = 0;
    sst_text_add(text, size, "still,files=%s,exposure=%s,aperture=%s,iso=%s,format=%s,focus=%s", files[a->still_files],
                 a->still_exposure, a->still_aperture, a->still_iso, a->still_format, focuses[a->still_focus]);
}

static void still_config(struct sst_still_config *out, const struct sst_array_config *a, const char *camera,
                         bool resumed, const SST_ATOMIC(bool) * cancel)
{
    static const enum sst_still_files files[] = { SST_STILL_JPEG, SST_STILL_RAW, SST_STILL_BOTH };
    static const enum sst_still_focus focuses[] = { SST_STILL_FOCUS_LEAVE, SST_STILL_FOCUS_MANUAL,
                                                    SST_STILL_FOCUS_LOCKED };

    sst_still_config_defaults(out);
    out->camera = camera;
    out->exposure = a->still_exposure;
    out->aperture = a->still_aperture;
    out->iso = a->still_iso;
    out->format = a->still_format;
    out->focus = focuses[a->still_focus];
    out->focused = resumed;
    out->files = files[a->still_files];
    out->mirror_ms = a->still_mirror_ms;
    out->card_ms = a->still_card_ms;
    out->quiet_ms = a->still_quiet_ms;
    out->response_ms = a->still_response_ms;
    out->reopen_ms = a->still_reopen_ms;
    out->battery_percent = a->still_battery_percent;
    out->keep = a->still_keep;
    out->cancel = cancel;
}

static json_t *still_report(const struct sst_scan_still *still)
{
    json_t *all = sst_scan_still_state(still), *counts;
    struct sst_still_counters n;

    sst_scan_still_counters(still, &n);
    counts = json_pack("{s:i, s:i, s:i, s:i, s:i, s:i, s:i}", "exposures", n.exposures, "busy", n.busy, "silent",
                       n.silent, "lost", n.lost, "damaged", n.damaged, "refused", n.refused, "reopened", n.reopened);
    if (!all || !counts || json_object_update(all, counts)) {
        json_decref(all);
        all = NULL;
    }
    json_decref(counts);
    return all;
}

static void still_print(const json_t *report)
{
    static const struct {
        const char *key, *text;
    } counts[] = { { "busy", "waited for it" },    { "silent", "without an answer" }, { "lost", "transfers failed" },
                   { "damaged", "damaged files" }, { "refused", "settings refused" }, { "reopened", "opened again" } };
    const json_t *battery = json_object_get(report, "battery_percent");
    const json_t *free_bytes = json_object_get(report, "card_free_bytes");

    if (!battery)
        return;
    printf("still camera: %d exposures", (int)json_integer_value(json_object_get(report, "exposures")));
    for (size_t i = 0; i < ARRAY_LEN(counts); i++) {
        const int n = (int)json_integer_value(json_object_get(report, counts[i].key));

        if (n)
            printf(", %d %s", n, counts[i].text);
    }
    if (json_is_integer(battery))
        printf("; battery %d %%", (int)json_integer_value(battery));
    if (json_is_integer(free_bytes))
        printf("; card %.0f MB free", (double)json_integer_value(free_bytes) * 1e-6);
    printf("\n");
}

/* --- the command -------------------------------------------------------------------------------------------------- */

/* Options of the command line; the rest comes from the configuration. */
struct options {
    const char *dir, *config, *pitch, *pitch_y, *origin, *camera, *bus, *profile, *format;
    const char *still; /* serial or port of a still camera, "" the only one; NULL: another camera */
    struct still_options still_options;
    int grid[2], size[2], axes, attempts, settle_ms, guard_ms;
    double backlash_mm, speed_mm_s, accel_mm_s2;
    bool dry_run, resume, json;
};

static atomic_bool cancel;
static struct sst_rig *_Atomic rig_at_work;

static void on_signal(int sig SST_UNUSED)
{
    struct sst_rig *rig = atomic_load(&rig_at_work);

    atomic_store(&cancel, true);
    if (rig)
        sst_rig_cancel(rig);
}

static void catch_signals(void)
{
    static const int signals[] = { SIGINT, SIGTERM, SIGHUP };
    const struct sigaction action = { .sa_handler = on_signal };

    for (size_t i = 0; i < ARRAY_LEN(signals); i++)
        (void)sigaction(signals[i], &action, NULL);
}

/* --- options ------------------------------------------------------------------------------------------------------ */

/* Parse "40", "40mm", "4cm" or "250um" to um; false if invalid */
static bool parse_length(const char *text, const char **end, double *um)
{
    static const struct {
        const char *unit;
        double um;
    } units[] = { { "mm", 1e3 }, { "cm", 1e4 }, { "um", 1 }, { "", 1e3 } };
    char *p;
    const double v = strtod(text, &p);

    if (p == text || !isfinite(v))
        return false;
    for (size_t i = 0; i < ARRAY_LEN(units); i++) {
        if (strncmp(p, units[i].unit, strlen(units[i].unit)) != 0)
            continue;
        *um = v * units[i].um;
        *end = p + strlen(units[i].unit);
        return fabs(*um) <= 1e9;
    }
    return false;
}

static int set_length(const struct cli_command *cmd, const char *name, const char *text, double min_um, int32_t *out)
{
    const char *end;
    double um;

    if (!text)
        return CLI_GO_ON;
    if (!parse_length(text, &end, &um) || *end || um < min_um)
        return cli_usage_error(cmd, "--%s %s is not a length such as 40mm, 4cm or 250um", name, text);
    *out = (int32_t)lround(um);
    return CLI_GO_ON;
}

static int set_origin(const struct cli_command *cmd, const char *text, int axes, int32_t origin_um[SST_RIG_AXES])
{
    const char *p = text;
    double um;

    for (int a = 0; p && a < axes; a++) {
        if (!parse_length(p, &p, &um) || (a + 1 < axes ? *p++ != ',' : *p != 0))
            return cli_usage_error(cmd, "--origin %s is not one length for each of the %d axes, for example 10,10",
                                   text, axes);
        origin_um[a] = (int32_t)lround(um);
    }
    return CLI_GO_ON;
}

static void rig_config(struct sst_rig_config *rig, const struct sst_array_config *a)
{
    sst_rig_config_defaults(rig);
    snprintf(rig->bus, sizeof(rig->bus), "%s", a->rig_bus);
    snprintf(rig->profile, sizeof(rig->profile), "%s", a->rig_profile);
    rig->axes = a->rig_axes;
    for (int i = 0; i < a->rig_axes; i++) {
        rig->unit[i] = a->rig_unit[i];
        rig->travel_min_um[i] = (int32_t)lround(a->rig_travel_min_mm[i] * 1000);
        rig->travel_max_um[i] = (int32_t)lround(a->rig_travel_max_mm[i] * 1000);
        rig->um_per_count[i] = a->rig_um_per_count[i];
    }
    rig->response_ms = sst_clamp_int(a->rig_response_ms, 10, 10000);
    rig->retries = sst_min_int(a->rig_retries, 10);
    rig->reconnect_ms = a->rig_reconnect_ms;
    rig->settle_ms = a->rig_settle_ms;
    rig->tolerance_um = sst_max_int((int)lround(a->rig_tolerance_um), 1);
    rig->speed_mm_s = a->rig_speed_mm_s;
    rig->accel_mm_s2 = a->rig_accel_mm_s2;
}

static int set_format(const struct cli_command *cmd, const char *text, uint32_t *fourcc)
{
    if (!text)
        return CLI_GO_ON;
    if (strlen(text) < 3 || strlen(text) > 4)
        return cli_usage_error(cmd, "--format %s is not a pixel format; MJPG, GREY and Y16 can be captured", text);
    *fourcc = (uint8_t)text[0] | (uint32_t)(uint8_t)text[1] << 8 | (uint32_t)(uint8_t)text[2] << 16 |
              (uint32_t)(text[3] ? (uint8_t)text[3] : ' ') << 24;
    return CLI_GO_ON;
}

/* Read the configuration and apply the options. @return CLI_GO_ON or an exit code */
static int configure(const struct cli_command *cmd, const struct options *o, struct sst_array_config *array,
                     struct sst_rig_config *rig, struct sst_scan_config *cfg)
{
    int r = cli_exit_code(sst_array_config_read(array, o->config));

    if (r != CLI_OK)
        return r;
    if (o->axes)
        array->rig_axes = o->axes;
    if (o->bus)
        snprintf(array->rig_bus, sizeof(array->rig_bus), "%s", o->bus);
    if (o->profile)
        snprintf(array->rig_profile, sizeof(array->rig_profile), "%s", o->profile);
    if (o->settle_ms >= 0)
        array->rig_settle_ms = o->settle_ms;
    if (o->speed_mm_s > 0)
        array->rig_speed_mm_s = o->speed_mm_s;
    if (o->accel_mm_s2 > 0)
        array->rig_accel_mm_s2 = o->accel_mm_s2;
    if (o->size[0]) {
        array->width = o->size[0];
        array->height = o->size[1];
    }
    rig_config(rig, array);
    if (!o->dry_run && (!rig->bus[0] || !rig->profile[0]))
        return cli_usage_error(cmd, "the bus and the drives of the rig are not set: use --bus tcp:HOST:PORT --profile "
                                    "NAME, or rig: in the configuration");

    sst_scan_config_defaults(cfg);
    cfg->dir = o->dir;
    cfg->must_exist = o->resume;
    cfg->rows = o->grid[0] ? o->grid[0] : array->rows;
    cfg->cols = o->grid[1] ? o->grid[1] : array->cols;
    cfg->pitch_um[0] = (int32_t)lround(array->spacing_mm * 1000);
    cfg->backlash_um = (int32_t)lround(o->backlash_mm * 1000);
    cfg->attempts = o->attempts;
    cfg->guard_ms = o->guard_ms;
    for (int a = 0; a < rig->axes; a++)
        cfg->origin_um[a] = rig->travel_min_um[a] + cfg->backlash_um;
    r = set_length(cmd, "pitch", o->pitch, 1, &cfg->pitch_um[0]);
    cfg->pitch_um[1] = cfg->pitch_um[0];
    if (r == CLI_GO_ON)
        r = set_length(cmd, "pitch-y", o->pitch_y, 1, &cfg->pitch_um[1]);
    if (r == CLI_GO_ON)
        r = set_origin(cmd, o->origin, rig->axes, cfg->origin_um);
    if (r == CLI_GO_ON)
        r = o->still ? still_configure(cmd, &o->still_options, o->format, array, cfg)
                     : set_format(cmd, o->format, &array->fourcc);
    if (r != CLI_GO_ON)
        return r;
    if (cfg->pitch_um[0] < 1)
        return cli_usage_error(cmd, "the distance between views is missing: --pitch 40mm");
    cfg->cancel = &cancel;
    if (o->still)
        return CLI_GO_ON;
    cfg->fourcc = array->fourcc;
    cfg->width = array->width;
    cfg->height = array->height;
    cfg->rate_hz = array->rate_hz;
    return CLI_GO_ON;
}

/* Names and values of the controls, which must be the same in a resumed capture. */
static void controls_text(const struct options *o, const struct sst_array_config *a, char *text, size_t size)
{
    if (o->still) {
        still_text(a, text, size);
        return;
    }
    text[0] = 0;
    for (int i = 0; i < a->controls; i++)
        sst_text_add(text, size, "%s%s=%lld", i ? "," : "", a->control[i].name, (long long)a->control[i].value);
}

/* --- output ------------------------------------------------------------------------------------------------------- */

static void print_plan(const struct sst_scan_config *cfg, const struct sst_scan_plan *plan, bool json)
{
    json_t *poses = json ? json_array() : NULL;

    if (!json)
        printf("  nr  row col        x mm       y mm       z mm\n");
    for (int i = 0; i < plan->views; i++) {
        const int view = sst_scan_view(cfg, i);
        const struct sst_rig_pos p = sst_scan_pose(cfg, view);

        if (json)
            json_array_append_new(poses, json_pack("{s:i, s:i, s:[iii]}", "row", view / cfg->cols, "col",
                                                   view % cfg->cols, "um", p.um[0], p.um[1], p.um[2]));
        else
            printf("%4d %4d %3d  %10.3f %10.3f %10.3f\n", i + 1, view / cfg->cols, view % cfg->cols, p.um[0] / 1000.0,
                   p.um[1] / 1000.0, p.um[2] / 1000.0);
    }
    if (json) {
        json_t *all =
            json_pack("{s:o, s:f, s:f, s:b, s:I}", "poses", poses, "way_mm", plan->way_mm, "seconds", plan->seconds,
                      "speed_assumed", (int)plan->speed_assumed, "bytes", (json_int_t)plan->bytes);

        (void)cli_dump_json(all, JSON_INDENT(1));
        return;
    }
    printf("%d views, %.0f mm of travel, about %.0f s after homing%s, about %.1f MB\n", plan->views, plan->way_mm,
           plan->seconds, plan->speed_assumed ? " (assuming 50 mm/s: set --speed)" : "", (double)plan->bytes * 1e-6);
}

/* @param camera  counters of the camera, taken over */
static void print_report(const struct sst_scan_config *cfg, const struct sst_scan_report *r, json_t *camera, int count,
                         bool json)
{
    if (json) {
        json_t *all = json_pack(
            "{s:s, s:i, s:i, s:i, s:i, s:i, s:i, s:i, s:i, s:{s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, "
            "s:I}, "
            "s:o}",
            "dir", cfg->dir, "views", cfg->rows * cfg->cols, "there", count, "taken", r->taken, "again", r->again,
            "rig_faults", r->rig_faults, "camera_faults", r->camera_faults, "moved", r->moved, "homed", r->homed, "rig",
            "requests", (json_int_t)r->rig.requests, "timeouts", (json_int_t)r->rig.timeouts, "garbled",
            (json_int_t)r->rig.garbled, "exceptions", (json_int_t)r->rig.exceptions, "lost", (json_int_t)r->rig.lost,
            "reconnects", (json_int_t)r->rig.reconnects, "late", (json_int_t)r->rig.late, "stalls",
            (json_int_t)r->rig.stalls, "limits", (json_int_t)r->rig.limits, "alarms", (json_int_t)r->rig.alarms,
            "missed", (json_int_t)r->rig.missed, "lies", (json_int_t)r->rig.lies, "camera", camera);

        (void)cli_dump_json(all, JSON_COMPACT);
        return;
    }
    printf("%s: %d of %d views, %d captured now, %d attempts failed (rig %d, camera %d, moved %d), homed %d times\n",
           cfg->dir, count, cfg->rows * cfg->cols, r->taken, r->again, r->rig_faults, r->camera_faults, r->moved,
           r->homed);
    still_print(camera);
    json_decref(camera);
    if (r->rig.timeouts + r->rig.garbled + r->rig.exceptions + r->rig.lost + r->rig.late)
        printf("bus: %llu requests: %llu without reply in time, %llu garbled, %llu refused, %llu with the line lost; "
               "%llu late replies discarded\n",
               (unsigned long long)r->rig.requests, (unsigned long long)r->rig.timeouts,
               (unsigned long long)r->rig.garbled, (unsigned long long)r->rig.exceptions,
               (unsigned long long)r->rig.lost, (unsigned long long)r->rig.late);
}

/* Warn early if the disk will be full before the end. */
static void check_space(const struct sst_scan_config *cfg, const struct sst_scan_plan *plan)
{
    struct statvfs v;

    if (!statvfs(cfg->dir, &v) && (double)v.f_bavail * (double)v.f_frsize < (double)plan->bytes)
        sst_log_warning(
            "%s: %.1f MB are free, the views need about %.1f MB; a capture that runs out of space can be resumed",
            cfg->dir, (double)v.f_bavail * (double)v.f_frsize * 1e-6, (double)plan->bytes * 1e-6);
}

/* --- capturing ---------------------------------------------------------------------------------------------------- */

/* Exit code for missing or refusing devices, which other commands do not have. */
static int exit_code(int err)
{
    switch (-err) {
    case ENODEV:
    case EHOSTUNREACH:
    case ECONNREFUSED:
    case ENOSYS:
    case EPROTO:
    case ETIMEDOUT:
    case ENOTUNIQ:
    case EBUSY:
    case EMFILE:
    case ENOTCONN:
    case ENOMEDIUM:
    case EPERM:
        return CLI_MISSING;
    default:
        return cli_exit_code(err);
    }
}

/* The camera on the rig: one of both kinds. */
struct on_rig {
    struct sst_scan_grab *grab;
    struct sst_scan_still *still;
    struct sst_scan_camera camera;
};

static int open_camera(struct on_rig *on, const struct options *o, const struct sst_array_config *array, bool resumed)
{
    struct sst_still_config still;

    if (!o->still)
        return sst_scan_grab_open(&on->grab, array, o->camera, &cancel, &on->camera);
    still_config(&still, array, o->still, resumed, &cancel);
    return sst_scan_still_open(&on->still, &still, &on->camera);
}

static void close_camera(struct on_rig *on)
{
    sst_scan_still_close(on->still);
    sst_scan_grab_close(on->grab);
}

static json_t *camera_report(const struct on_rig *on)
{
    struct sst_grab_counters count = { .frames = 0 };

    if (on->still)
        return still_report(on->still);
    if (on->grab)
        sst_scan_grab_counters(on->grab, &count);
    return json_pack("{s:I, s:I, s:I}", "frames", (json_int_t)count.frames, "bad", (json_int_t)count.bad, "lost",
                     (json_int_t)count.lost);
}

static int capture(const struct options *o, const struct sst_array_config *array, const struct sst_rig_config *rig_cfg,
                   const struct sst_scan_config *cfg, struct sst_scan_store *store)
{
    struct sst_scan_report report = { .there = sst_scan_store_count(store) };
    struct on_rig on = { .grab = NULL };
    struct sst_rig *rig = NULL;
    int err;

    if (report.there == cfg->rows * cfg->cols) {
        err = sst_scan_store_finish(store);
        if (!err)
            print_report(cfg, &report, camera_report(&on), report.there, o->json);
        return err;
    }
    catch_signals();
    err = sst_rig_open(&rig, rig_cfg);
    if (!err) {
        atomic_store(&rig_at_work, rig);
        err = open_camera(&on, o, array, report.there > 0);
    }
    if (!err) {
        err = sst_scan_run(&(struct sst_scan){ rig, rig_cfg, &on.camera, store, cfg }, &report);
        cli_progress_end();
        print_report(cfg, &report, camera_report(&on), sst_scan_store_count(store), o->json);
    }
    atomic_store(&rig_at_work, NULL);
    close_camera(&on);
    sst_rig_close(rig);
    return err;
}

static int run_with(const struct cli_command *cmd, const struct options *o, struct sst_array_config *array)
{
    struct sst_scan_config cfg;
    struct sst_scan_plan plan;
    struct sst_rig_config rig;
    struct sst_scan_store *store;
    char controls[1024];
    int err, r = configure(cmd, o, array, &rig, &cfg);

    if (r != CLI_GO_ON)
        return r;
    controls_text(o, array, controls, sizeof(controls));
    cfg.controls = controls;
    cfg.progress = cli_progress;
    cfg.progress_arg = (char[]){ "capture" };
    err = sst_scan_plan(&plan, &cfg, &rig);
    if (err)
        return exit_code(err);
    if (o->dry_run) {
        print_plan(&cfg, &plan, o->json);
        return CLI_OK;
    }
    err = sst_scan_store_open(&store, &cfg);
    if (err)
        return exit_code(err);
    check_space(&cfg, &plan);
    err = capture(o, array, &rig, &cfg, store);
    sst_scan_store_close(store);
    return exit_code(err);
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct options o = { .settle_ms = -1, .backlash_mm = 1, .attempts = 3, .guard_ms = 40 };
    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &o.dir, "DIR", "light-field folder; an incomplete capture in it is resumed" },
        { "grid", 0, CLI_GRID, o.grid, "RxC", "rows and columns of views; array: in the configuration", 1, 256 },
        { "pitch", 0, CLI_STRING, &o.pitch, "P", "distance between columns: 40mm, 4cm, 250um; array: spacing_mm" },
        { "pitch-y", 0, CLI_STRING, &o.pitch_y, "P", "distance between rows; as --pitch" },
        { "origin", 0, CLI_STRING, &o.origin, "X,Y[,Z]", "position of view 0,0; start of the travel plus backlash" },
        { "camera", 0, CLI_STRING, &o.camera, "ID",
          "serial or port of the camera, the only one connected; still or still:ID: a still camera" },
        { "size", 0, CLI_SIZE, o.size, "WxH", "pixels of a frame; cameras: in the configuration", 1, 32768 },
        { "format", 0, CLI_STRING, &o.format, "F",
          "MJPG, GREY or Y16; of a still camera its own name; cameras: in the configuration" },
        { "files", 0, CLI_STRING, &o.still_options.files, "F", "still camera: jpeg, raw or raw+jpeg; still: files" },
        { "exposure", 0, CLI_STRING, &o.still_options.exposure, "T", "still camera: seconds, 1/125; still: exposure" },
        { "aperture", 0, CLI_STRING, &o.still_options.aperture, "N", "still camera: 8; still: aperture" },
        { "iso", 0, CLI_STRING, &o.still_options.iso, "N", "still camera: 100; still: iso" },
        { "focus", 0, CLI_STRING, &o.still_options.focus, "F", "still camera: manual, locked or leave; still: focus" },
        { "config", 'c', CLI_STRING, &o.config, "FILE", "configuration; /etc/sst/sstd.yaml if it exists" },
        { "bus", 0, CLI_STRING, &o.bus, "BUS", "tcp:HOST:PORT or rtu:DEVICE,BAUD,8E1; rig: bus" },
        { "profile", 0, CLI_STRING, &o.profile, "NAME",
          "register map of the drives, a name or a .yaml file; rig: profile" },
        { "axes", 0, CLI_INT, &o.axes, "N", "number of axes: x, y, z; rig: axes", 1, 3 },
        { "speed", 0, CLI_DOUBLE, &o.speed_mm_s, "MM/S", "speed of all axes; rig: speed_mm_s", 0.001, 1e5 },
        { "accel", 0, CLI_DOUBLE, &o.accel_mm_s2, "MM/S2", "acceleration of all axes; rig: accel_mm_s2", 0.001, 1e6 },
        { "settle", 0, CLI_INT, &o.settle_ms, "MS", "time of standstill before a frame; rig: settle_ms", 0, 60000 },
        { "guard", 0, CLI_INT, &o.guard_ms, "MS", "further time to wait, for drivers with late time stamps; 40", 0,
          60000 },
        { "backlash", 0, CLI_DOUBLE, &o.backlash_mm, "MM", "approach each pose from this far below; 0: directly; 1", 0,
          1000 },
        { "attempts", 0, CLI_INT, &o.attempts, "N", "attempts per view; 3", 1, 100 },
        { "dry-run", 'n', CLI_FLAG, &o.dry_run, NULL, "only print poses, duration and disk space" },
        { "resume", 0, CLI_FLAG, &o.resume, NULL, "resume only, never start a new capture" },
        { "json", 0, CLI_FLAG, &o.json, NULL, "print JSON" },
    };
    struct sst_array_config *array;
    const char *none[1];
    int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, none, 0, 0);

    if (r != CLI_GO_ON)
        return r;
    if (!o.dir && !o.dry_run)
        return cli_usage_error(cmd, "the output folder is missing: -o DIR");
    o.still = still_selected(o.camera);
    r = still_check(cmd, o.still, &o.still_options);
    if (r != CLI_GO_ON)
        return r;
    array = calloc(1, sizeof(*array));
    if (!array)
        return CLI_MEMORY;
    r = run_with(cmd, &o, array);
    free(array);
    return r;
}

const struct cli_command cli_capture_rig = { "capture rig", run };
