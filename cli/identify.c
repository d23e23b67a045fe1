/* sst identify: takes a picture of every camera, to identify its position. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "capture/array/capture.h"
#include "capture/array/masks.h"
#include "cli/cli_internal.h"
#include "cli/identify_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/font.h"
#include "pipeline/image/raw.h"

#define TILE_WIDTH 400
#define GAP        8
#define DOT        2
#define CAPTION    (DOT * (SST_FONT_HEIGHT + 3)) /* px of a line below each picture */

/* --- pictures ----------------------------------------------------------------------------------------------------- */

static int decode(struct sst_image *img, const struct sst_frame *f, const char *name)
{
    const struct sst_raw raw = { f->fourcc, f->width, f->height, f->stride, f->data, f->bytes };
    int err;

    if (sst_raw_is_jpeg(f->fourcc))
        return sst_image_decode(img, f->data, f->bytes, name);
    err = sst_raw_decode(img, &raw);
    if (err)
        sst_log_error("cannot decode the frame of %s: %s", name, strerror(-err));
    return err;
}

/* --- grabbing ----------------------------------------------------------------------------------------------------- */

/* The frame as others may see it. @return NULL: masks cannot be applied to it */
static const struct sst_frame *mask(struct session *s, int i, struct sst_frame *f)
{
    struct sst_frameset set = { .cameras = s->count, .present = 1 };

    if (!s->masks)
        return f;
    set.frame[i] = f;
    sst_masks_apply(s->masks, &set, s->masked);
    return s->masked->set.frame[i];
}

void identify_frame(struct session *s, struct sst_frame *f)
{
    const int i = s->index[f->cam];
    struct shot *shot = &s->shots[i];

    if (!(f->faults & SST_FRAME_BAD) && !shot->image.width && shot->good++ >= SKIP_FRAMES) {
        const struct sst_frame *seen = mask(s, i, f);

        if (seen && !decode(&shot->image, seen, shot->genicam ? shot->device.port : shot->device.node))
            s->missing--;
    }
}

static void on_frame(void *arg, struct sst_frame *f)
{
    struct session *s = arg;

    identify_frame(s, f);
    sst_grab_release(s->grab, f);
}

void identify_state(void *arg, int cam, enum sst_grab_state state, const char *why)
{
    struct session *s = arg;
    struct shot *shot = &s->shots[s->index[cam]];

    if (state != SST_GRAB_STREAMING && state != SST_GRAB_READY)
        snprintf(shot->why, sizeof(shot->why), "%s", why);
}

/* Is a picture outstanding of a camera that can still deliver it? */
static bool any_waiting(const struct session *s, const struct identify_grab *grab)
{
    for (int i = 0; i < grab->cameras; i++) {
        if (!s->shots[s->index[i]].image.width && grab->state(s, i) != SST_GRAB_REFUSED)
            return true;
    }
    return false;
}

int identify_wait(struct session *s, const struct identify_grab *grab)
{
    const int64_t end_ns = sst_clock_now_ns() + PICTURE_NS;
    int err = 0;

    s->missing = grab->cameras;
    while (err >= 0 && s->missing && any_waiting(s, grab) && sst_clock_now_ns() < end_ns)
        err = grab->poll(s);
    return err < 0 ? err : 0;
}

static enum sst_grab_state state_of(const struct session *s, int cam)
{
    return sst_grab_camera_state(s->grab, cam);
}

static int poll_grab(struct session *s)
{
    return sst_grab_poll(s->grab, 100);
}

/* Take a picture of each camera in s->index. A failure is recorded in its shot. @return 0 or -errno */
static int grab_pictures(struct session *s, struct sst_grab_config *cfg)
{
    const struct sst_grab_events events = { s, on_frame, identify_state };
    int err = sst_grab_open(&s->grab, cfg, &events);

    if (err)
        return err;
    err = sst_grab_start(s->grab);
    err = err < 0 ? err : identify_wait(s, &(struct identify_grab){ cfg->cameras, state_of, poll_grab });
    sst_grab_close(s->grab);
    s->grab = NULL;
    return err;
}

static void write_title(char *title, size_t size, const struct shot *shot)
{
    if (shot->place.row >= 0)
        snprintf(title, size, "camera row %d, col %d", shot->place.row, shot->place.col);
    else
        snprintf(title, size, "camera");
}

/* Select cameras first .. first+n-1 that can be opened and have no picture yet. */
static int take_round(struct session *s, struct sst_grab_config *cfg, struct sst_grab_binding *bindings, int first,
                      int n)
{
    cfg->cameras = 0;
    for (int i = first; i < first + n; i++) {
        if (s->shots[i].image.width || s->shots[i].device.error || s->shots[i].genicam)
            continue;
        memcpy(bindings[cfg->cameras].port, s->shots[i].device.port, sizeof(bindings->port));
        bindings[cfg->cameras].node = s->shots[i].device.nth;
        write_title(bindings[cfg->cameras].title, sizeof(bindings->title), &s->shots[i]);
        s->index[cfg->cameras++] = i;
    }
    return cfg->cameras ? grab_pictures(s, cfg) : 0;
}

/* All at once; then, one by one, cameras without USB bandwidth beside the others. */
static int take_pictures(struct session *s, const struct sst_array_config *array)
{
    struct sst_grab_binding *bindings = calloc((size_t)s->count, sizeof(*bindings));
    struct sst_grab_config cfg;
    char said[SST_LOG_MAX] = "";
    int err;

    if (!bindings) {
        sst_log_error("no memory for %d cameras", s->count);
        return -ENOMEM;
    }
    cli_grab_config(&cfg, array);
    cfg.bindings = bindings;
    sst_log_hold_errors(said); /* results have the reason of each camera */
    err = take_round(s, &cfg, bindings, 0, s->count);
    for (int i = 0; !err && s->count > 1 && i < s->count; i++)
        err = take_round(s, &cfg, bindings, i, 1);
    err = err ? err : identify_genicams(s, array);
    sst_log_hold_errors(NULL);
    free(bindings);
    if (err && *said)
        sst_log_error("%s", said);
    return err;
}

/* --- output ------------------------------------------------------------------------------------------------------- */

static void paste(struct sst_image *sheet, const struct sst_image *tile, int left, int top)
{
    const int width = sst_min_int(tile->width, sheet->width - left);

    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < tile->height && top + y < sheet->height; y++)
            memcpy(sst_image_row(sheet, c, top + y) + left, sst_image_row(tile, c, y), (size_t)width);
    }
}

/* Black on white below a picture, two pixels per dot, truncated to the width of the tile. */
static void write_caption(struct sst_image *sheet, const char *text, int left, int top, int width)
{
    for (int y = 0; y < DOT * SST_FONT_HEIGHT; y++)
        for (int x = 0; x < width && left + x < sheet->width; x++)
            for (int c = 0; c < 3 && sst_font_dot(text, x / DOT, y / DOT); c++)
                sst_image_row(sheet, c, top + y)[left + x] = 0;
}

/* Position of a picture in the sheet: that in the array, or below the array in the order of ports. */
static int lay_out(const struct session *s, const struct sst_array_config *cfg, struct cli_place *at)
{
    int rows = 0, more = 0;

    for (int i = 0; i < s->count; i++) {
        at[i] = s->shots[i].place;
        rows = sst_max_int(rows, at[i].row + 1);
    }
    for (int i = 0; i < s->count; i++) {
        if (at[i].row < 0) {
            at[i] = (struct cli_place){ rows + more / cfg->cols, more % cfg->cols };
            more++;
        }
    }
    return rows + (more + cfg->cols - 1) / cfg->cols;
}

static int write_sheet(const struct session *s, const struct sst_array_config *cfg, const char *path)
{
    struct cli_place *at = calloc((size_t)s->count, sizeof(*at));
    struct sst_image sheet = { 0 };
    char text[2 * SST_GRAB_NAME_MAX + 32];
    const int rows = at ? lay_out(s, cfg, at) : 0;
    int err = at ? 0 : -ENOMEM;

    for (int i = 0; !err && i < s->count; i++) {
        struct sst_image tile = { 0 };

        if (!s->shots[i].image.width)
            continue;
        err = sst_image_halve(&tile, &s->shots[i].image);
        err = err ? err : sst_image_shrink(&tile, TILE_WIDTH);
        if (!err && !sheet.width) {
            err = sst_image_init(&sheet, cfg->cols * (tile.width + GAP), rows * (tile.height + CAPTION + GAP));
            if (!err)
                memset(sheet.plane[0], 255, 3 * sheet.stride * (size_t)sheet.height);
        }
        if (!err) {
            const int left = at[i].col * (tile.width + GAP), top = at[i].row * (tile.height + CAPTION + GAP);

            snprintf(text, sizeof(text), "r%dc%d  %s  %s", at[i].row, at[i].col, s->shots[i].device.serial,
                     s->shots[i].device.port);
            paste(&sheet, &tile, left, top);
            write_caption(&sheet, text, left, top + tile.height + 2 * DOT, tile.width);
        }
        sst_image_fini(&tile);
    }
    if (!err)
        err = sst_image_write_png(&sheet, path);
    else
        sst_log_error("no memory for the sheet of pictures %s", path);
    sst_image_fini(&sheet);
    free(at);
    return err;
}

/* Ports outside of USB contain colons. */
static void file_name(char *out, size_t size, const struct shot *shot)
{
    snprintf(out, size, "%s%s%s", shot->device.port, *shot->device.serial ? "_" : "", shot->device.serial);
    if (shot->device.nth > 1)
        sst_text_add(out, size, "_%d", shot->device.nth);
    sst_text_add(out, size, ".png");
    for (char *c = out; *c; c++) {
        if (*c == '/' || *c == ':' || *c == ' ')
            *c = '-';
    }
}

static const char *why_none(const struct shot *shot)
{
    return *shot->why ? shot->why : "no picture received";
}

/* Reasons of all cameras, where no table has them. */
static void report_none(const struct session *s)
{
    for (int i = 0; i < s->count; i++) {
        const struct shot *shot = &s->shots[i];
        const bool serial = *shot->device.serial;
        char title[32];

        write_title(title, sizeof(title), shot);
        sst_log_error("%s (%s %s): %s", title, serial ? "serial" : "port",
                      serial ? shot->device.serial : shot->device.port, why_none(shot));
    }
    sst_log_error("no camera delivered a picture; `sst doctor` checks for the reason");
}

/* `files` gets the name of each picture, NULL if there is none; to free. @return 0 or -errno */
static int write_pictures(const struct session *s, const char *dir, char **files)
{
    char path[SST_PATH_MAX], name[2 * SST_GRAB_NAME_MAX + 24];
    int err = sst_path_make_dir(dir), got = 0;

    for (int i = 0; !err && i < s->count; i++) {
        if (!s->shots[i].image.width)
            continue;
        file_name(name, sizeof(name), &s->shots[i]);
        err = sst_path_join(path, dir, name);
        err = err ? err : sst_image_write_png(&s->shots[i].image, path);
        files[i] = err ? NULL : strdup(path);
        got++;
    }
    if (err)
        return err;
    if (!got)
        report_none(s);
    else if (got < s->count)
        sst_log_warning("no picture of %d of %d cameras", s->count - got, s->count);
    return got ? 0 : -ENODATA;
}

static void print_table(const struct session *s, char *const *files, const char *sheet)
{
    char at[16];

    printf("%-6s %-10s %-14s %s\n", "PLACE", "PORT", "SERIAL", "PICTURE");
    for (int i = 0; i < s->count; i++) {
        const struct shot *shot = &s->shots[i];

        printf("%-6s %-10s %-14s %s\n", cli_place_text(at, shot->place), shot->device.port,
               *shot->device.serial ? shot->device.serial : "-", files[i] ? files[i] : why_none(shot));
    }
    printf("\nall pictures at their positions: %s\n", sheet);
}

static int print_json(const struct session *s, char *const *files, const char *sheet)
{
    json_t *list = json_array();
    int err = list ? 0 : -ENOMEM;

    for (int i = 0; !err && i < s->count; i++) {
        const struct shot *shot = &s->shots[i];
        json_t *one = json_pack("{s:s, s:s, s:s, s:s}", "port", shot->device.port, "serial", shot->device.serial,
                                files[i] ? "picture" : "missing", files[i] ? files[i] : why_none(shot), "name",
                                shot->device.name);

        if (!cli_place_json(one, shot->place) || json_array_append_new(list, one))
            err = -ENOMEM;
    }
    if (err)
        json_decref(list);
    else if (cli_dump_json(json_pack("{s:o, s:s}", "cameras", list, "sheet", sheet), JSON_INDENT(2)) != CLI_OK)
        err = -ENOMEM;
    if (err)
        sst_log_error("no memory for the list of pictures");
    return err;
}

/* Write and print all results. */
static int show(const struct session *s, const struct sst_array_config *cfg, const char *dir, bool json)
{
    char **files = calloc((size_t)s->count, sizeof(*files)), sheet[SST_PATH_MAX];
    int err = files ? sst_path_join(sheet, dir, "identify.png") : -ENOMEM;

    err = err ? err : write_pictures(s, dir, files);
    err = err ? err : write_sheet(s, cfg, sheet);
    if (!err && json)
        err = print_json(s, files, sheet);
    else if (!err)
        print_table(s, files, sheet);
    for (int i = 0; files && i < s->count; i++)
        free(files[i]);
    free(files);
    return err;
}

static bool serial_is_unique(const struct session *s, int index)
{
    for (int i = 0; i < s->count; i++) {
        if (i != index && !strcmp(s->shots[i].device.serial, s->shots[index].device.serial) &&
            strcmp(s->shots[i].device.port, s->shots[index].device.port) != 0)
            return false;
    }
    return *s->shots[index].device.serial != 0;
}

enum taken {
    TAKEN_NOT = 0,
    TAKEN_MISSING = 1, /* by a camera that is not connected: perhaps the one that it replaces */
    TAKEN = 2,
};

/* Positions of the array, row by row. */
static void mark_taken(enum taken *taken, const struct session *s, const struct sst_array_config *cfg)
{
    for (int k = 0; k < cfg->bound; k++) {
        const int at = cfg->camera[k].row * cfg->cols + cfg->camera[k].col;

        taken[at] = cfg->camera[k].kind == SST_CONFIG_V4L2 && !s->connected[at] ? TAKEN_MISSING : TAKEN;
    }
    for (int at = 0; !cfg->bound && at < cfg->rows * cfg->cols; at++)
        taken[at] = s->connected[at] ? TAKEN : TAKEN_NOT;
}

/* The first position that is at most taken so, in the order in which cameras are placed; -1, -1: none. */
static struct cli_place first_free(enum taken *taken, const struct sst_array_config *cfg, enum taken most)
{
    for (int n = 0; n < cfg->rows * cfg->cols; n++) {
        struct cli_place at;

        sst_array_place(cfg, n, &at.row, &at.col);
        if (taken[at.row * cfg->cols + at.col] <= most) {
            taken[at.row * cfg->cols + at.col] = TAKEN;
            return at;
        }
    }
    return (struct cli_place){ -1, -1 };
}

/* Cameras keep their positions; others are put at free ones, to be corrected by hand with the pictures. */
static int write_bindings(const struct session *s, const struct sst_array_config *cfg, const char *path)
{
    enum taken taken[SST_CAMERAS_MAX] = { TAKEN_NOT };
    struct sst_outfile out = { 0 };
    int over = 0, err = sst_outfile_open(&out, path);

    if (err)
        return err;
    mark_taken(taken, s, cfg);
    fprintf(out.stream, "# Cameras of the configuration have their positions, others free ones in the order of ports; change rows\n"
                        "# and columns to where the cameras are.\n"
                        "cameras:\n  bind:\n");
    for (int i = 0; i < s->count; i++) {
        const bool serial = serial_is_unique(s, i);
        struct cli_place at = s->shots[i].place;

        for (int most = TAKEN_NOT; at.row < 0 && most < TAKEN; most++)
            at = first_free(taken, cfg, most);
        if (at.row < 0) {
            over++;
            continue;
        }
        fprintf(out.stream, "    - { row: %d, col: %d, %s%s: \"%s\"", at.row, at.col,
                s->shots[i].genicam ? "kind: genicam, " : "", serial ? "serial" : "port",
                serial ? s->shots[i].device.serial : s->shots[i].device.port);
        if (s->shots[i].device.nth > 1)
            fprintf(out.stream, ", node: %d", s->shots[i].device.nth);
        fprintf(out.stream, " }\n");
    }
    if (over)
        sst_log_warning("%s: %d camera%s no free position in the array of %dx%d and %s left out; raise array: rows or cols",
                        path, over, over == 1 ? " has" : "s have", cfg->rows, cfg->cols, over == 1 ? "is" : "are");
    return sst_outfile_commit(&out);
}

/* --- command ------------------------------------------------------------------------------------------------------ */

/* Select the requested V4L2 and GenICam cameras; of several nodes of one device the ones in the array. */
static int choose(struct session *s, const struct sst_array_config *cfg, const char *serial, const char *port)
{
    struct sst_grab_device *devices;
    struct cli_place *place = NULL;
    int count, all, err = sst_grab_list(&devices, &count);

    if (err)
        return err;
    (void)sst_grab_select(devices, count, cfg->fourcc);
    all = count;
    err = sst_grab_list_parts(&devices, &count, &all, sst_capture_split(cfg));
    s->shots = calloc(SST_CAMERAS_MAX, sizeof(*s->shots));
    place = calloc((size_t)count + 1, sizeof(*place));
    err = err ? err : s->shots && place ? 0 : -ENOMEM;
    if (!err)
        cli_places(place, cfg, devices, count);
    for (int i = 0; !err && i < count && s->count < SST_CAMERAS_MAX; i++) {
        if (place[i].row >= 0)
            s->connected[place[i].row * cfg->cols + place[i].col] = true;
        if ((serial && strcmp(serial, devices[i].serial) != 0) || (port && strcmp(port, devices[i].port) != 0) ||
            (*devices[i].left_out && place[i].row < 0))
            continue;
        s->shots[s->count] = (struct shot){ .device = devices[i], .place = place[i] };
        if (devices[i].error)
            snprintf(s->shots[s->count].why, sizeof(s->shots->why), "%s", strerror(devices[i].error));
        s->count++;
    }
    free(place);
    free(devices);
    err = err ? err : identify_list_genicams(s, cfg, serial, port);
    if (!err && s->count)
        return 0;
    sst_log_error("%s; see `sst cameras`", err              ? "no memory for a list of cameras"
                                           : serial || port ? "no such camera is connected"
                                                            : "no camera is connected");
    return err ? err : -ENODATA;
}

/* Masks for the cameras in the order of the shots. A picture without a place in the array is black as a whole. */
static int open_masks(struct session *s, const struct sst_array_config *cfg)
{
    struct sst_array_config *a = malloc(sizeof(*a));
    int unknown = 0, err;

    if (!a)
        return -ENOMEM;
    *a = *cfg;
    a->bound = s->count;
    for (int i = 0; i < s->count; i++) {
        a->camera[i] = (struct sst_config_camera){ .row = s->shots[i].place.row, .col = s->shots[i].place.col };
        unknown += a->camera[i].row < 0;
    }
    err = sst_masks_create(&s->masks, a);
    if (!err && s->masks && unknown)
        sst_log_warning(
            "%d cameras have no place in the array, so privacy masks cannot be placed and their pictures are "
            "black; take out privacy: masks until cameras: bind is written",
            unknown);
    s->masked = err ? NULL : malloc(sizeof(*s->masked));
    free(a);
    return err || s->masked ? err : -ENOMEM;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    const char *serial = NULL, *port = NULL, *dir = "identify", *write = NULL, *config = NULL;
    bool json = false;
    const struct cli_option options[] = {
        { "serial", 0, CLI_STRING, &serial, "S", "only the camera of this serial" },
        { "port", 0, CLI_STRING, &port, "P", "only the camera at this USB port or address" },
        { "output", 'o', CLI_MADE, &dir, "DIR", "folder for the pictures (identify)" },
        { "write", 0, CLI_FILE, &write, "FILE", "write a proposal of the `bind:` section" },
        { "config", 'c', CLI_STRING, &config, "FILE", "configuration of the array (/etc/sst/sstd.yaml)" },
        { "json", 0, CLI_FLAG, &json, NULL, "print one JSON object" },
    };
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    struct session s = { 0 };
    struct sst_array_config cfg;
    int err;

    if (r != CLI_GO_ON)
        return r;
    if (write && config && cli_is_one_file(write, config))
        return cli_usage_error(cmd,
                               "--write would replace the configuration with the bindings alone; name another file");
    err = sst_array_config_read(&cfg, config);
    err = err ? err : choose(&s, &cfg, serial, port);
    if (!err && write)
        err = write_bindings(&s, &cfg, write);
    err = err ? err : open_masks(&s, &cfg);
    err = err ? err : take_pictures(&s, &cfg);
    err = err ? err : show(&s, &cfg, dir, json);
    for (int i = 0; i < s.count; i++)
        sst_image_fini(&s.shots[i].image);
    sst_masks_destroy(s.masks);
    free(s.masked);
    free(s.shots);
    return cli_exit_code(err);
}

const struct cli_command cli_identify = { "identify", run };
