/* sst cameras: lists connected cameras with identity, position in the array and state. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "capture/array/capture.h"
#include "cli/cli_internal.h"

/* --- cameras of the service, as a grid of frame rates seen from behind -------------------------------------------- */

#define SIDE_MAX 256
#define TEXT     300

static const json_t *camera_at(const json_t *list, int row, int col)
{
    const json_t *cam;
    size_t i;

    json_array_foreach(list, i, cam)
    {
        if (cli_number(cam, "row") == row && cli_number(cam, "col") == col)
            return cam;
    }
    return NULL;
}

static bool streams(const json_t *cam)
{
    char state[TEXT];

    return !strcmp(cli_text(cam, "state", state, sizeof(state)), "streaming");
}

static void print_cell(const json_t *cam)
{
    char state[TEXT];

    if (!cam)
        printf(" %7s", "-");
    else if (streams(cam))
        printf(" %7.1f", cli_number(cam, "rate_hz"));
    else
        printf(" %7.7s", cli_text(cam, "state", state, sizeof(state)));
}

static void print_camera(const json_t *cam)
{
    char name[TEXT], state[TEXT], serial[TEXT], port[TEXT], reason[TEXT];

    cli_text(cam, "serial", serial, sizeof(serial));
    cli_text(cam, "port", port, sizeof(port));
    printf("%-8s %-11s %-14s %-10s %7.1f %9.0f %6.0f %6.0f  %s\n", cli_text(cam, "name", name, sizeof(name)),
           cli_text(cam, "state", state, sizeof(state)), *serial ? serial : "-", *port ? port : "-",
           cli_number(cam, "rate_hz"), cli_number(cam, "frames"), cli_number(cam, "bad"), cli_number(cam, "lost"),
           cli_text(cam, "reason", reason, sizeof(reason)));
}

static int side(const json_t *answer, const char *name)
{
    const double n = cli_number(answer, name);

    return n >= 1 && n <= SIDE_MAX ? (int)n : 0;
}

static void print_grid(const json_t *answer, bool all)
{
    const int rows = side(answer, "rows"), cols = side(answer, "cols");
    const json_t *list = cli_member(answer, "cameras"), *cam;
    int streaming = 0;
    bool header = false;
    size_t i;

    json_array_foreach(list, i, cam) streaming += streams(cam);
    printf("%d of %d cameras stream; frames per second, seen from behind:\n     ", streaming,
           (int)json_array_size(list));
    for (int col = 0; col < cols; col++)
        printf(" %5s%-2d", "c", col);
    printf("\n");
    for (int row = 0; row < rows; row++) {
        printf("r%-4d", row);
        for (int col = 0; col < cols; col++)
            print_cell(camera_at(list, row, col));
        printf("\n");
    }
    json_array_foreach(list, i, cam)
    {
        if (!all && streams(cam))
            continue;
        if (!header)
            printf("\n%-8s %-11s %-14s %-10s %7s %9s %6s %6s  %s\n", "CAMERA", "STATE", "SERIAL", "PORT", "RATE",
                   "FRAMES", "BAD", "LOST", "WHY");
        header = true;
        print_camera(cam);
    }
}

/* --- cameras of this machine -------------------------------------------------------------------------------------- */

#define USER_MAX 64

/* "ffmpeg (1234)" if a process that we may inspect has the node open; else "". */
static bool has_open(const char *pid, const char *node)
{
    char dir[300], link[600], target[64];
    struct dirent *entry;
    bool found = false;
    DIR *fds;

    snprintf(dir, sizeof(dir), "/proc/%s/fd", pid);
    fds = opendir(dir);
    while (fds && !found && (entry = readdir(fds))) {
        ssize_t n;

        snprintf(link, sizeof(link), "%s/%s", dir, entry->d_name);
        n = readlink(link, target, sizeof(target) - 1);
        target[n > 0 ? n : 0] = 0;
        found = !strcmp(target, node);
    }
    if (fds)
        closedir(fds);
    return found;
}

static void find_user(char user[USER_MAX], const char *node)
{
    DIR *proc = opendir("/proc");
    struct dirent *entry;

    *user = 0;
    while (proc && !*user && (entry = readdir(proc))) {
        char path[300], name[32];

        if (!isdigit((unsigned char)*entry->d_name) || !has_open(entry->d_name, node))
            continue;
        snprintf(path, sizeof(path), "/proc/%s/comm", entry->d_name);
        snprintf(user, USER_MAX, "%s (%.12s)", sst_file_line(name, sizeof(name), path), entry->d_name);
    }
    if (proc)
        closedir(proc);
}

static void state_text(char *text, size_t size, const struct sst_grab_device *d, bool used)
{
    char user[USER_MAX];

    if (*d->left_out && !used) {
        snprintf(text, size, "left out: %s", d->left_out);
    } else if (d->error == EACCES || d->error == EPERM) {
        snprintf(text, size, "no permission: add this user to the group of the node (video)");
    } else if (d->error == ETIMEDOUT) {
        snprintf(text, size, "hangs: it does not respond");
    } else if (d->error) {
        snprintf(text, size, "cannot be opened: %s", strerror(d->error));
    } else if (d->busy) {
        find_user(user, d->node);
        snprintf(text, size, "busy%s%s", *user ? ": " : "", user);
    } else {
        snprintf(text, size, "free");
    }
}

/* --- output ------------------------------------------------------------------------------------------------------- */

/* Still cameras, which are no part of the array. */
struct stills {
    struct sst_still_device *device;
    int count;
};

/* GenICam cameras, which have no node. */
struct genicams {
    const struct sst_array_config *cfg;
    struct sst_genicam_device *device;
    int count;
};

struct others {
    struct stills stills;
    struct genicams genicams;
};

static void still_state(char *text, size_t size, const struct sst_still_device *d)
{
    if (d->error == EACCES || d->error == EPERM)
        snprintf(text, size, "no permission: install systemd/60-sst.rules and add this user to group video");
    else if (d->error)
        snprintf(text, size, "cannot be opened: %s", strerror(d->error));
    else
        snprintf(text, size, "%s", WITH_GPHOTO2 ? "there" : "there, but sst is built without libgphoto2");
}

static json_t *still_json(const struct stills *stills)
{
    json_t *list = json_array();

    for (int i = 0; list && i < stills->count; i++) {
        const struct sst_still_device *d = &stills->device[i];
        char state[128];

        still_state(state, sizeof(state), d);
        if (json_array_append_new(list, json_pack("{s:s, s:s, s:s, s:s}", "name", d->name, "serial", d->serial, "port",
                                                  d->port, "state", state))) {
            json_decref(list);
            list = NULL;
        }
    }
    return list;
}

static void print_stills(const struct stills *stills)
{
    if (!stills->count)
        return;
    printf("\n%-26s %-14s %-10s %s\n", "STILL CAMERA", "SERIAL", "PORT", "STATE");
    for (int i = 0; i < stills->count; i++) {
        const struct sst_still_device *d = &stills->device[i];
        char state[128];

        still_state(state, sizeof(state), d);
        printf("%-26s %-14s %-10s %s\n", d->name, *d->serial ? d->serial : "-", d->port, state);
    }
}

/* Video nodes that are no cameras, and why. */
static json_t *left_out_json(const struct sst_grab_device *devices, int count)
{
    json_t *list = json_array();

    for (int i = 0; list && i < count; i++)
        if (json_array_append_new(list, json_pack("{s:s, s:s, s:s}", "node", devices[i].node, "port", devices[i].port,
                                                  "reason", devices[i].left_out))) {
            json_decref(list);
            list = NULL;
        }
    return list;
}

static void print_left_out(const struct sst_grab_device *devices, int count)
{
    for (int i = 0; i < count; i++)
        printf("%s%-12s %-14s %s\n", i ? "" : "\nNO CAMERAS\n", devices[i].node, devices[i].port, devices[i].left_out);
}

static int print_json(const struct sst_grab_device *devices, const struct cli_place *place, int count, int all,
                      const struct others *others)
{
    const struct genicams *genicams = &others->genicams;
    json_t *list = json_array(), *still = still_json(&others->stills), *out = left_out_json(devices + count, all - count);
    json_t *other = cli_genicam_json(genicams->cfg, genicams->device, genicams->count);
    int err = list && still && out && other ? 0 : -ENOMEM;

    for (int i = 0; !err && i < count; i++) {
        const struct sst_grab_device *d = &devices[i];
        char state[128];
        json_t *one;

        state_text(state, sizeof(state), d, place[i].row >= 0);
        one = json_pack("{s:s, s:s, s:s, s:s, s:s, s:s, s:s}", "node", d->node, "name", d->name, "serial", d->serial,
                        "port", d->port, "driver", d->driver, "formats", d->formats, "state", state);
        if (!cli_place_json(one, place[i]) || json_array_append_new(list, one))
            err = -ENOMEM;
    }
    if (err) {
        json_decref(list);
        json_decref(still);
        json_decref(out);
        json_decref(other);
    } else if (cli_dump_json(json_pack("{s:o, s:o, s:o, s:o}", "cameras", list, "genicam", other, "still", still,
                                       "left_out", out),
                             JSON_INDENT(2)) != CLI_OK) {
        err = -ENOMEM;
    }
    if (err)
        sst_log_error("cannot print the list of cameras: %s", strerror(-err));
    return err;
}

static void print_table(const struct sst_grab_device *devices, const struct cli_place *place, int count)
{
    if (!count) {
        puts("no cameras are connected: plug one in (`dmesg` shows whether the kernel detects it)");
        return;
    }
    printf("%-6s %-12s %-14s %-10s %-12s %-24s %-20s %s\n", "PLACE", "NODE", "SERIAL", "PORT", "DRIVER", "NAME",
           "STATE", "FORMATS");
    for (int i = 0; i < count; i++) {
        const struct sst_grab_device *d = &devices[i];
        char state[128], at[16];

        state_text(state, sizeof(state), d, place[i].row >= 0);
        printf("%-6s %-12s %-14s %-10s %-12s %-24s %-20s %s\n", cli_place_text(at, place[i]), d->node,
               *d->serial ? d->serial : "-", d->port, *d->driver ? d->driver : "-", d->name, state, d->formats);
    }
}

/* Warn about missing bound cameras and duplicate serials, in both output formats. */
static void warn_missing(const struct sst_array_config *cfg, const struct cli_place *place, int count,
                         const struct genicams *genicams)
{
    int missing = 0;

    for (int k = 0; k < cfg->bound; k++) {
        const struct sst_config_camera *c = &cfg->camera[k];
        bool there = false;

        for (int i = 0; i < count; i++)
            there |= place[i].row == c->row && place[i].col == c->col;
        for (int i = 0; i < genicams->count; i++)
            there |= cli_is_genicam(c, &genicams->device[i]);
        if (!there && ++missing <= 8)
            sst_log_warning("row %d col %d: no camera with %s %s is connected", c->row, c->col,
                            *c->serial ? "serial" : "port", *c->serial ? c->serial : c->port);
    }
    if (missing > 8)
        sst_log_warning("and %d more cameras are missing", missing - 8);
}

static void warn_duplicates(const struct sst_grab_device *devices, int count)
{
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < i; k++) {
            if (*devices[i].serial && !strcmp(devices[i].serial, devices[k].serial) &&
                strcmp(devices[i].port, devices[k].port) != 0)
                sst_log_warning("serial %s is claimed by two devices, at port %s and at port %s; bind both by port",
                                devices[i].serial, devices[k].port, devices[i].port);
        }
    }
}

/* --- command ------------------------------------------------------------------------------------------------------ */

static int local(const char *config, bool json)
{
    struct sst_array_config cfg;
    struct sst_grab_device *devices = NULL;
    struct cli_place *place = NULL;
    struct others others = { .genicams = { &cfg, NULL, 0 } };
    struct stills *stills = &others.stills;
    struct genicams *genicams = &others.genicams;
    int count = 0, all = 0, err;

    err = sst_array_config_read(&cfg, config);
    err = err ? err : sst_grab_list_all(&devices, &count, &all);
    if (err)
        return err;
    (void)sst_grab_select(devices, count, cfg.fourcc);
    err = sst_grab_list_parts(&devices, &count, &all, sst_capture_split(&cfg));
    err = err ? err : sst_still_list(&stills->device, &stills->count);
    err = err ? err : cli_genicam_list(&genicams->device, &genicams->count);
    if (err) {
        free(stills->device);
        free(devices);
        return err;
    }
    place = calloc((size_t)count + 1, sizeof(*place));
    if (!place) {
        sst_log_error("no memory for a list of cameras");
        free(stills->device);
        free(genicams->device);
        free(devices);
        return -ENOMEM;
    }
    cli_places(place, &cfg, devices, count);
    warn_missing(&cfg, place, count, genicams);
    warn_duplicates(devices, count);
    if (json) {
        err = print_json(devices, place, count, all, &others);
    } else {
        if (count || !genicams->count)
            print_table(devices, place, count);
        cli_genicam_print(&cfg, genicams->device, genicams->count);
        print_left_out(devices + count, all - count);
        print_stills(stills);
    }
    free(stills->device);
    free(genicams->device);
    free(place);
    free(devices);
    return err;
}

/* True if the default service runs. Errors of the request are only shown if it does. */
static int service_cameras(const struct sst_client_service *where, bool asked, json_t **answer)
{
    char error[SST_LOG_MAX] = "", *before = asked ? NULL : sst_log_hold_errors(error);
    const int err = sst_client_ask(where, "/api/v1/cameras", NULL, answer);

    if (!asked)
        (void)sst_log_hold_errors(before);
    if (!asked && err && err != -ENOPKG && err != -ENOTSUP)
        sst_log_warning("%s; listing the cameras of this machine", error);
    return err;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_client_service where = { 0 };
    const char *config = NULL;
    bool json = false, only_local = false, all = false, asked;
    const struct cli_option options[] = {
        { "local", 0, CLI_FLAG, &only_local, NULL, "list the cameras of this machine, even if a service runs" },
        { "all", 'a', CLI_FLAG, &all, NULL, "list each camera of the service on its own line" },
        { "json", 0, CLI_FLAG, &json, NULL, "print one JSON object" },
        { "config", 'c', CLI_STRING, &config, "FILE",
          "list local cameras with their positions in this configuration (/etc/sst/sstd.yaml)" },
        CLI_SERVICE_OPTIONS(where),
    };
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    json_t *answer;
    int err;

    if (r != CLI_GO_ON)
        return r;
    asked = where.socket || where.url || all;
    if (asked && (only_local || config))
        return cli_usage_error(
            cmd,
            "--local and --config list the cameras of this machine and cannot be combined with --socket, --url or -a");
    if (!only_local && !config) {
        err = service_cameras(&where, asked, &answer);
        if (!err && json)
            return cli_print_json(answer);
        if (!err)
            print_grid(answer, all);
        if (!err)
            json_decref(answer);
        if (!err || asked)
            return cli_exit_code(err);
    }
    return cli_exit_code(local(config, json));
}

const struct cli_command cli_cameras = { "cameras", run };
