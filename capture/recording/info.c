/* recording.json: facts about all sets of a recording. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>
#if WITH_AVFORMAT
#include <libavformat/avformat.h>
#endif

#include "base/log.h"
#include "base/text.h"
#include "capture/recording/recording_internal.h"

#define FORMAT_NAME    "sst-recording"
#define INFO_MAX_BYTES ((size_t)4 << 20)

/* --- writing ------------------------------------------------------------------------------------------------------ */

static json_t *tracks_to_json(const struct sst_recorder_config *cfg)
{
    json_t *tracks = json_array();

    for (int k = 0; tracks && k < cfg->cameras; k++) {
        struct sst_recorder_track t = cfg->tracks[k];

        sst_text_make_utf8(t.serial);
        sst_text_make_utf8(t.port);
        sst_text_make_utf8(t.name);
        if (json_array_append_new(tracks,
                                  json_pack("{s:i, s:i, s:i, s:i, s:s, s:s, s:s}", "cam", k, "track", k + 1, "row",
                                            t.row, "col", t.col, "serial", t.serial, "port", t.port, "name", t.name))) {
            json_decref(tracks);
            tracks = NULL;
        }
    }
    return tracks;
}

static json_t *columns_to_json(void)
{
    json_t *list = json_array();

    for (int i = 0; list && i < MANIFEST_COLUMNS; i++) {
        if (json_array_append_new(list, json_string(manifest_columns[i]))) {
            json_decref(list);
            list = NULL;
        }
    }
    return list;
}

static const char *muxer(void)
{
#if WITH_AVFORMAT
    static char text[32]; /* the same bytes from any thread */
    const unsigned v = avformat_version();

    snprintf(text, sizeof(text), "libavformat %u.%u.%u", v >> 16, v >> 8 & 255, v & 255);
    return text;
#else
    return "none";
#endif
}

int manifest_write_json(const char *path, const json_t *root)
{
    char *text = root ? json_dumps(root, JSON_INDENT(1)) : NULL;
    const int err = text ? sst_file_write(path, text, strlen(text)) : -ENOMEM;

    free(text);
    return err;
}

int manifest_write_info(const char *path, const struct sst_recorder_config *cfg)
{
    char format[5];
    json_t *root;
    int err;

    sst_recording_format_name(cfg->fourcc, format);
    root = json_pack("{s:s, s:i, s:s, s:s, s:i, s:i, s:i, s:s, s:i, s:i, s:f, s:f, s:o, s:o}", "format", FORMAT_NAME,
                     "version", SST_RECORDING_VERSION, "program", "sst " SST_VERSION, "muxer", muxer(), "rows",
                     cfg->rows, "cols", cfg->cols, "cameras", cfg->cameras, "pixel_format", format, "width", cfg->width,
                     "height", cfg->height, "rate_hz", cfg->rate_hz, "spacing_mm", cfg->spacing_mm, "frame_columns",
                     columns_to_json(), "tracks", tracks_to_json(cfg));
    err = manifest_write_json(path, root);
    json_decref(root);
    return err;
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

static const char *read_track(const json_t *json, int k, struct sst_recording_info *info)
{
    struct sst_recorder_track *t = &info->track[k];
    const char *serial, *port, *name;
    int cam;

    if (json_unpack((json_t *)json, "{s:i, s:i, s:i, s:s, s:s, s:s}", "cam", &cam, "row", &t->row, "col", &t->col,
                    "serial", &serial, "port", &port, "name", &name) ||
        cam != k)
        return "a track lacks cam, row, col, serial, port or name";
    if (t->row < 0 || t->row >= info->rows || t->col < 0 || t->col >= info->cols)
        return "a track is outside the grid";
    for (int i = 0; i < k; i++) {
        if (info->track[i].row == t->row && info->track[i].col == t->col)
            return "two tracks have the same row and col";
    }
    snprintf(t->serial, sizeof(t->serial), "%s", serial);
    snprintf(t->port, sizeof(t->port), "%s", port);
    snprintf(t->name, sizeof(t->name), "%s", name);
    return NULL;
}

static bool columns_known(const json_t *list)
{
    bool known = json_array_size(list) == MANIFEST_COLUMNS;

    for (size_t i = 0; known && i < MANIFEST_COLUMNS; i++) {
        const char *name = json_string_value(json_array_get(list, i));

        known = name && !strcmp(name, manifest_columns[i]);
    }
    return known;
}

static const char *read_info(json_t *root, struct sst_recording_info *info)
{
    const char *format, *pixel, *fault = NULL;
    json_t *columns, *tracks;
    int version;

    if (json_unpack(root, "{s:s, s:i}", "format", &format, "version", &version) || strcmp(format, FORMAT_NAME))
        return "its format is not sst-recording";
    if (version != SST_RECORDING_VERSION)
        return "unsupported version; use a newer sst";
    if (json_unpack(root, "{s:i, s:i, s:i, s:s, s:i, s:i, s:F, s:F, s:o, s:o}", "rows", &info->rows, "cols",
                    &info->cols, "cameras", &info->cameras, "pixel_format", &pixel, "width", &info->width, "height",
                    &info->height, "rate_hz", &info->rate_hz, "spacing_mm", &info->spacing_mm, "frame_columns",
                    &columns, "tracks", &tracks))
        return "a key is missing or of another type";
    info->fourcc = sst_recording_format_parse(pixel);
    if (info->rows < 1 || info->cols < 1 || info->rows > SST_CAMERAS_MAX || info->cols > SST_CAMERAS_MAX ||
        info->cameras < 1 || info->cameras > SST_CAMERAS_MAX || info->cameras > info->rows * info->cols)
        return "rows, cols and cameras do not match";
    if (info->width < 1 || info->height < 1 || info->width > 32768 || info->height > 32768)
        return "width or height is outside 1..32768";
    if (!isfinite(info->rate_hz) || info->rate_hz < 0 || !isfinite(info->spacing_mm) || info->spacing_mm < 0)
        return "rate_hz or spacing_mm is below 0";
    if (!sst_recording_format_known(info->fourcc))
        return "unsupported pixel_format";
    if (!columns_known(columns))
        return "unexpected frame_columns";
    if ((int)json_array_size(tracks) != info->cameras)
        return "the number of tracks is not that of cameras";
    for (int k = 0; !fault && k < info->cameras; k++)
        fault = read_track(json_array_get(tracks, (size_t)k), k, info);
    return fault;
}

int manifest_read_info(const char *path, struct sst_recording_info *info)
{
    struct sst_recording_info made = { 0 };
    json_error_t error;
    const char *fault;
    uint8_t *data;
    size_t size;
    json_t *root;
    const int err = sst_file_read_text(path, INFO_MAX_BYTES, &data, &size);

    if (err)
        return err;
    root = json_loadb((const char *)data, size, JSON_REJECT_DUPLICATES, &error);
    free(data);
    if (!root) {
        sst_log_error("%s:%d:%d: %s; this is not a recording.json", path, error.line, error.column, error.text);
        return -EBADMSG;
    }
    fault = read_info(root, &made);
    if (fault)
        sst_log_error("%s: %s", path, fault);
    else
        *info = made;
    json_decref(root);
    return fault ? -EBADMSG : 0;
}
