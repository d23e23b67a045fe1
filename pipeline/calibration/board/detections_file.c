/* Detections as JSON (docs/integrate/formats.md); numbers survive a round trip bit for bit. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "pipeline/calibration/board/detect.h"

#define FORMAT         "sst-detections"
#define FILE_MAX_BYTES ((size_t)1 << 30)
#define FRAMES_MAX     100000
#define PLACE_MAX      1e6 /* px */
#define DRIVE_MAX      1e7 /* mm */

static const char *const outcomes[6] = { "found", "none", "few", "blurred", "moving", "other_board" };

/* --- writing ----------------------------------------------------------------------------------------------------- */

/* Quoted text; bytes that are not UTF-8 become question marks. */
static int put_string(FILE *out, const char *text)
{
    char plain[64], *dumped;
    json_t *json;

    snprintf(plain, sizeof(plain), "%s", text);
    sst_text_make_utf8(plain);
    json = json_string(plain);
    dumped = json ? json_dumps(json, JSON_ENCODE_ANY) : NULL;
    json_decref(json);
    if (!dumped)
        return -ENOMEM;
    fputs(dumped, out);
    free(dumped);
    return 0;
}

static int put_names(FILE *out, const char *key, char (*name)[64], int n)
{
    int err = 0;

    fprintf(out, "  \"%s\": [", key);
    for (int i = 0; i < n && !err; i++) {
        fputs(i ? ", " : "", out);
        err = put_string(out, name[i]);
    }
    fprintf(out, "],\n");
    return err;
}

static void put_detection(FILE *out, const struct sst_detection *d, bool last)
{
    fprintf(out, "    {\"frame\": %d, \"view\": %d, \"blur_px\": %.17g, \"blur_aspect\": %.17g, \"corners\": [",
            d->frame, d->view, d->blur_px, d->blur_aspect);
    for (int i = 0; i < d->corners; i++) {
        const struct sst_corner *c = &d->corner[i];

        fprintf(out, "%s[%d, %.17g, %.17g, %.17g]", i ? ", " : "", c->id, c->x, c->y, c->weight);
    }
    fprintf(out, "]}%s\n", last ? "" : ",");
}

static int put_head(FILE *out, const struct sst_detections *all)
{
    char board[128];
    int err;

    sst_board_format(&all->board, board);
    fprintf(out,
            "{\n  \"format\": \"" FORMAT "\",\n  \"version\": 1,\n  \"board\": \"%s\",\n  \"rows\": %d,\n"
            "  \"cols\": %d,\n  \"width\": %d,\n  \"height\": %d,\n  \"rig\": %s,\n",
            board, all->rows, all->cols, all->width, all->height, all->rig ? "true" : "false");
    err = put_names(out, "cameras", all->camera_name, all->rows * all->cols);
    err = err ? err : put_names(out, "frames", all->frame_name, all->frames);
    fprintf(out, "  \"outcomes\": {");
    for (int i = 0; i < 6; i++)
        fprintf(out, "%s\"%s\": %d", i ? ", " : "", outcomes[i], all->outcome[i]);
    fprintf(out, "},\n");
    for (int i = 0; all->drive_mm && i < all->rows * all->cols; i++)
        fprintf(out, "%s[%.17g, %.17g, %.17g]%s", i ? ", " : "  \"drive_mm\": [", all->drive_mm[i][0],
                all->drive_mm[i][1], all->drive_mm[i][2], i + 1 == all->rows * all->cols ? "],\n" : "");
    return err;
}

int sst_detections_write(const struct sst_detections *all, const char *path)
{
    struct sst_outfile out;
    int err = sst_outfile_open(&out, path);

    if (err)
        return err;
    err = put_head(out.stream, all);
    fprintf(out.stream, "  \"detections\": [\n");
    for (int i = 0; i < all->count; i++)
        put_detection(out.stream, &all->detection[i], i + 1 == all->count);
    fprintf(out.stream, "  ]\n}\n");
    if (err) {
        sst_log_error("%s: not enough memory to write it", path);
        sst_outfile_abort(&out);
        return err;
    }
    return sst_outfile_commit(&out);
}

/* --- reading ----------------------------------------------------------------------------------------------------- */

/* Parser state; a fault is logged once, with its position. */
struct reader {
    const char *path;
    int err;
};

static int bad(struct reader *r, const char *where, int index, const char *what)
{
    if (!r->err) {
        if (index < 0)
            sst_log_error("%s: %s %s; correct it, or detect again", r->path, where, what);
        else
            sst_log_error("%s: %s[%d] %s; correct it, or detect again", r->path, where, index, what);
        r->err = -EBADMSG;
    }
    return r->err;
}

static int whole(struct reader *r, const json_t *object, const char *key, int min, int max)
{
    const json_t *value = json_object_get(object, key);

    if (!json_is_integer(value) || json_integer_value(value) < min || json_integer_value(value) > max) {
        bad(r, key, -1, "is not a whole number within its limits");
        return min;
    }
    return (int)json_integer_value(value);
}

static bool numbers(const json_t *list, double *out, size_t n)
{
    if (json_array_size(list) != n)
        return false;
    for (size_t i = 0; i < n; i++) {
        out[i] = json_number_value(json_array_get(list, i));
        if (!json_is_number(json_array_get(list, i)) || !isfinite(out[i]))
            return false;
    }
    return true;
}

static int read_corners(struct reader *r, struct sst_detection *d, const json_t *list, const struct sst_board *board,
                        int index)
{
    const size_t n = json_array_size(list);

    if (n < 1 || n > (size_t)sst_board_points(board))
        return bad(r, "detections", index, "has no corners, or more than the board");
    d->corner = calloc(n, sizeof(*d->corner));
    if (!d->corner)
        return r->err = -ENOMEM;
    for (size_t i = 0; i < n; i++) {
        const json_t *corner = json_array_get(list, i);
        double v[4] = { 0, 0, 0, 1 };

        if (!numbers(corner, v, json_array_size(corner) == 3 ? 3 : 4) || fabs(v[1]) > PLACE_MAX ||
            fabs(v[2]) > PLACE_MAX || !(v[3] > 0 && v[3] <= 1) || !json_is_integer(json_array_get(corner, 0)) ||
            v[0] < 0 || v[0] >= sst_board_points(board) || (i > 0 && (int)v[0] <= d->corner[i - 1].id))
            return bad(r, "detections", index,
                       "has corners that are not [id, x, y, weight] of the board by ascending id");
        d->corner[d->corners++] = (struct sst_corner){ (int)v[0], v[1], v[2], v[3] };
    }
    return 0;
}

static int read_detection(struct reader *r, struct sst_detections *all, const json_t *object, int index)
{
    struct sst_detection d = { .frame = whole(r, object, "frame", 0, all->frames - 1),
                               .view = whole(r, object, "view", 0, all->rows * all->cols - 1),
                               .blur_px = json_number_value(json_object_get(object, "blur_px")),
                               .blur_aspect = json_number_value(json_object_get(object, "blur_aspect")) };
    int err = r->err;

    err = err ? err : read_corners(r, &d, json_object_get(object, "corners"), &all->board, index);
    if (!err && (!(d.blur_px >= 0) || !(d.blur_aspect >= 0) || !isfinite(d.blur_px + d.blur_aspect)))
        err = bad(r, "detections", index, "has a blur that is not a width");
    if (!err) {
        err = sst_detections_add(all, &d);
        if (err == -EINVAL)
            err = bad(r, "detections", index, "repeats an earlier frame and view");
    }
    sst_detection_fini(&d);
    return r->err = err;
}

static void read_names(struct reader *r, char (*out)[64], const json_t *list, const char *key, int n)
{
    for (int i = 0; i < n && !r->err; i++) {
        const char *text = json_string_value(json_array_get(list, (size_t)i));

        if (!text || strlen(text) > 63)
            bad(r, key, i, "is not a name of at most 63 bytes");
        else
            strcpy(out[i], text);
    }
}

static void read_drive(struct reader *r, struct sst_detections *all, const json_t *list)
{
    const int n = all->rows * all->cols;

    if (!list || r->err)
        return;
    all->drive_mm = calloc((size_t)n, sizeof(*all->drive_mm));
    if (!all->drive_mm) {
        r->err = -ENOMEM;
        return;
    }
    for (int i = 0; i < n && !r->err; i++) {
        const double *d = all->drive_mm[i];

        if (!numbers(json_array_get(list, (size_t)i), all->drive_mm[i], 3) || fabs(d[0]) > DRIVE_MAX ||
            fabs(d[1]) > DRIVE_MAX || fabs(d[2]) > DRIVE_MAX)
            bad(r, "drive_mm", i, "is not three lengths of at most 10 km");
    }
}

static void read_lists(struct reader *r, struct sst_detections *all, const json_t *root)
{
    const json_t *frames = json_object_get(root, "frames"), *cameras = json_object_get(root, "cameras");
    const json_t *list = json_object_get(root, "detections"), *counts = json_object_get(root, "outcomes");

    if (json_array_size(cameras) != (size_t)(all->rows * all->cols))
        bad(r, "cameras", -1, "is not a list of rows x cols names");
    if (!json_is_array(frames) || json_array_size(frames) > FRAMES_MAX)
        bad(r, "frames", -1, "is not a list of at most 100000 names");
    if (!json_is_array(list))
        bad(r, "detections", -1, "is not a list");
    read_names(r, all->camera_name, cameras, "cameras", all->rows * all->cols);
    for (size_t i = 0; i < json_array_size(frames) && !r->err; i++)
        r->err = sst_detections_frame(all, "") < 0 ? -ENOMEM : 0;
    read_names(r, all->frame_name, frames, "frames", all->frames);
    for (int i = 0; i < 6 && counts && !r->err; i++)
        all->outcome[i] = whole(r, counts, outcomes[i], 0, INT32_MAX);
    read_drive(r, all, json_object_get(root, "drive_mm"));
    for (size_t i = 0; i < json_array_size(list) && !r->err; i++)
        read_detection(r, all, json_array_get(list, i), (int)i);
}

static int read_root(struct sst_detections *out, const json_t *root, const char *path)
{
    const char *format = json_string_value(json_object_get(root, "format"));
    const char *text = json_string_value(json_object_get(root, "board"));
    struct sst_detections all = { 0 };
    struct reader r = { .path = path };
    struct sst_board board;
    int rows, cols, width, height;

    if (!format || strcmp(format, FORMAT) != 0 || whole(&r, root, "version", 1, 1) != 1 || r.err)
        return bad(&r, "format", -1, "and version are not those of sst's detections (version 1)");
    if (!text)
        return bad(&r, "board", -1, "is missing");
    if (sst_board_parse(&board, text))
        return -EBADMSG;
    rows = whole(&r, root, "rows", 1, SST_MAX_VIEWS);
    cols = whole(&r, root, "cols", 1, SST_MAX_VIEWS);
    width = whole(&r, root, "width", 1, SST_IMAGE_MAX_SIDE);
    height = whole(&r, root, "height", 1, SST_IMAGE_MAX_SIDE);
    if (!r.err && rows * cols > SST_MAX_VIEWS)
        bad(&r, "rows", -1, "times cols is more than 256");
    if (!r.err)
        r.err = sst_detections_init(
            &all,
            &(struct sst_detections){ .board = board, .rows = rows, .cols = cols, .width = width, .height = height });
    if (r.err)
        return r.err;
    all.rig = json_is_true(json_object_get(root, "rig"));
    read_lists(&r, &all, root);
    if (r.err)
        sst_detections_fini(&all);
    else
        *out = all;
    return r.err;
}

int sst_detections_read(struct sst_detections *all, const char *path)
{
    uint8_t *text = NULL;
    json_error_t error;
    json_t *root = NULL;
    size_t size;
    int err = sst_file_read_text(path, FILE_MAX_BYTES, &text, &size);

    if (err)
        return err;
    root = json_loadb((const char *)text, size, JSON_REJECT_DUPLICATES, &error);
    free(text);
    if (!root) {
        sst_log_error("%s:%d:%d: %s; correct it, or detect again", path, error.line, error.column, error.text);
        return -EBADMSG;
    }
    err = read_root(all, root, path);
    if (err == -ENOMEM)
        sst_log_error("%s: not enough memory to read it", path);
    json_decref(root);
    return err;
}
