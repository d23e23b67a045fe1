/* calib.yaml: written with its own layout for readability, parsed strictly. 256 cameras make about 300 kB and 15000
 * nodes, well within the parser's limits. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/file.h"
#include "base/log.h"
#include "base/yaml.h"
#include "pipeline/camera/format_parts.h"

#define VERSION  1
#define NS_PER_S 1000000000

/* --- times and strings -------------------------------------------------------------------------------------------- */

/* "2026-11-21T14:23:01.000000000Z" */
static void format_time(int64_t wall_ns, char out[48])
{
    const time_t seconds = (time_t)(wall_ns / NS_PER_S);
    struct tm tm;
    char day[32];

    gmtime_r(&seconds, &tm);
    strftime(day, sizeof(day), "%Y-%m-%dT%H:%M:%S", &tm);
    snprintf(out, 48, "%s.%09dZ", day, (int)(wall_ns % NS_PER_S));
}

static bool parse_time(const char *text, int64_t *wall_ns)
{
    struct tm tm = { 0 };
    char again[48];
    int64_t seconds;
    int ns;

    if (sscanf(text, "%4d-%2d-%2dT%2d:%2d:%2d.%9dZ", &tm.tm_year, &tm.tm_mon, &tm.tm_mday, &tm.tm_hour, &tm.tm_min,
               &tm.tm_sec, &ns) != 7 ||
        tm.tm_year < 1970 || tm.tm_year > 2261 || ns < 0)
        return false;
    tm.tm_year -= 1900;
    tm.tm_mon -= 1;
    seconds = timegm(&tm); /* timegm() would carry 99 months into years */
    if (seconds < 0 || seconds >= INT64_MAX / NS_PER_S)
        return false;
    *wall_ns = seconds * NS_PER_S + ns;
    if (*wall_ns <= 0)
        return false;
    format_time(*wall_ns, again); /* reject the 31st of February and the like */
    return !strcmp(text, again);
}

/* Bytes of the UTF-8 character at s if a quoted one-line YAML string can hold it, or 0. */
static int character(const unsigned char *s)
{
    uint32_t code;
    const int n = sst_utf8_character(s, &code);

    return code == 0x2028 || code == 0x2029 || code == 0xfeff ? 0 : n; /* line breaks, and the byte order mark */
}

static void put_text(FILE *f, const char *indent, const char *key, const char *text)
{
    const unsigned char *s = (const unsigned char *)text;

    if (!*s)
        return;
    fprintf(f, "%s%s: \"", indent, key);
    while (*s) {
        const int n = character(s);

        if (n == 1 && (*s == '"' || *s == '\\'))
            putc('\\', f);
        if (n)
            fwrite(s, 1, (size_t)n, f);
        else
            putc('?', f);
        s += n ? n : 1;
    }
    fputs("\"\n", f);
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

static void put_number(FILE *f, double v)
{
    sst_put_numbers(f, &v, 1);
}

static void put_numbers(FILE *f, const char *key, const double *v, int n, int per_line)
{
    fprintf(f, "    %s: [", key);
    for (int i = 0; i < n; i++) {
        fputs(i == 0 ? "" : i % per_line ? ", " : ",\n               ", f);
        put_number(f, v[i]);
    }
    fputs("]\n", f);
}

static void put_named(FILE *f, const char *key, double v)
{
    fprintf(f, "%s: ", key);
    put_number(f, v);
    putc('\n', f);
}

static void put_camera(FILE *f, const struct sst_calib *calib, int view)
{
    const struct sst_calib_camera *c = &calib->camera[view];

    fprintf(f, "\n  - row: %d\n    col: %d\n", view / calib->cols, view % calib->cols);
    put_text(f, "    ", "name", c->name);
    put_numbers(f, "focal_px", (const double[]){ c->fx, c->fy }, 2, 2);
    put_numbers(f, "centre_px", (const double[]){ c->cx, c->cy }, 2, 2);
    put_numbers(f, "distortion", c->k, c->lens, 5);
    put_numbers(f, "rotation", c->rotation, 9, 3);
    put_numbers(f, "position_mm", c->position_mm, 3, 3);
    put_numbers(f, "gain", c->gain, 3, 3);
    put_numbers(f, "falloff", c->falloff, 3, 3);
    if (c->corners == 0 && c->rms_px == 0 && c->sigma_px == 0)
        return;
    fprintf(f, "    quality: { rms_px: ");
    put_number(f, c->rms_px);
    fprintf(f, ", corners: %d, sigma_px: ", c->corners);
    put_number(f, c->sigma_px);
    fprintf(f, " }\n");
}

static const char preamble[] =
    "# Calibration of a camera array, by sst; docs/integrate/formats.md describes it.\n"
    "#\n"
    "# Views count from row 0, column 0 at the top left, seen from behind the cameras. Axes: x right, y down, z "
    "forward,\n"
    "# millimetres. A point X is at P = rotation (X - position_mm) in a camera's axes (rotation row by row). With\n"
    "# a = P.x / P.z, b = P.y / P.z, r2 = a^2 + b^2, distortion [k1, k2, p1, p2, k3] or [k1, k2, p1, p2, k3, k4, k5, "
    "k6]\n"
    "# (the order of OpenCV; [] is none) and s = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3) it "
    "is\n"
    "# seen at\n"
    "#   x = fx (a s + 2 p1 a b + p2 (r2 + 2 a^2)) + cx      focal_px: [fx, fy]\n"
    "#   y = fy (b s + p1 (r2 + 2 b^2) + 2 p2 a b) + cy      centre_px: [cx, cy]\n"
    "# in pixels whose centres are whole numbers: (0, 0) is the middle of the upper left one. Light: gain is of "
    "linear\n"
    "# red, green and blue relative to the mean camera; at a distance r from the principal point it falls off as\n"
    "# 1 + f0 r^2 + f1 r^4 + f2 r^6, r in half diagonals of the picture. quality: rms_px is of the corners used, per\n"
    "# point; sigma_px the expected error of carrying a pixel from the reference view to this one at range_mm.\n\n";

static void put_all(FILE *f, const struct sst_calib *calib)
{
    char text[48];

    fputs(preamble, f);
    fprintf(f, "format: sst-calib\nversion: %d\n", VERSION);
    if (calib->created_wall_ns > 0) {
        format_time(calib->created_wall_ns, text);
        put_text(f, "", "created", text);
    }
    put_text(f, "", "source", calib->source);
    put_text(f, "", "board", calib->board);
    fprintf(f, "rows: %d\ncols: %d\nwidth: %d\nheight: %d\n", calib->rows, calib->cols, calib->width, calib->height);
    fprintf(f, "reference: [%d, %d] # row, column: its camera's axes are those of all\n",
            calib->reference / calib->cols, calib->reference % calib->cols);
    fprintf(f, "rig: %s # %s\n", calib->rig ? "true" : "false",
            calib->rig ? "one camera at many poses" : "a camera for each view");
    if (calib->range_mm > 0)
        put_named(f, "range_mm", calib->range_mm);
    if (calib->noise_px > 0)
        put_named(f, "noise_px", calib->noise_px);
    fputs("\ncameras:\n", f);
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        if (calib->camera[k].known)
            put_camera(f, calib, k);
    }
}

int sst_calib_write(const struct sst_calib *calib, const char *path)
{
    const char *text = sst_calib_fault(calib);
    struct sst_outfile out;
    int err;

    if (text) {
        sst_log_error("cannot write %s: invalid calibration: %s", path, text);
        return -EINVAL;
    }
    err = sst_outfile_open(&out, path);
    if (err)
        return err;
    put_all(out.stream, calib);
    return sst_outfile_commit(&out);
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

/* A list of exactly n numbers; a single number for all is not accepted. */
static bool need_numbers(struct sst_yaml *doc, struct sst_yaml_node *map, const char *key, double *out, int n)
{
    struct sst_yaml_node *node = sst_yaml_need(doc, map, key);

    if (node && (node->type != SST_YAML_LIST || node->count != n)) {
        sst_yaml_fault(doc, node, "must be a list of %d numbers", n);
        return false;
    }
    return sst_yaml_doubles(doc, node, -SST_CALIB_LARGEST, SST_CALIB_LARGEST, out, n);
}

/* An optional key: without it the default stays. @return false: there is a fault */
static bool may_numbers(struct sst_yaml *doc, struct sst_yaml_node *map, const char *key, double *out, int n)
{
    return !sst_yaml_get(map, key) || need_numbers(doc, map, key, out, n);
}

static bool read_lens(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_calib_camera *cam)
{
    struct sst_yaml_node *node = sst_yaml_need(doc, map, "distortion");

    if (!node)
        return false;
    if (node->type != SST_YAML_LIST || (node->count != 0 && node->count != 5 && node->count != 8)) {
        sst_yaml_fault(doc, node, "must be a list of 0, 5 or 8 numbers: k1, k2, p1, p2, k3 and k4, k5, k6");
        return false;
    }
    cam->lens = node->count;
    return sst_yaml_doubles(doc, node, -SST_CALIB_LARGEST, SST_CALIB_LARGEST, cam->k, cam->lens);
}

static bool read_quality(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_calib_camera *cam)
{
    struct sst_yaml_node *at = sst_yaml_get(map, "quality"), *rms, *corners, *sigma;
    bool ok = true;

    if (!at)
        return true;
    if (at->type != SST_YAML_MAP) {
        sst_yaml_fault(doc, at, "needs the keys rms_px, corners and sigma_px");
        return false;
    }
    rms = sst_yaml_get(at, "rms_px");
    corners = sst_yaml_get(at, "corners");
    sigma = sst_yaml_get(at, "sigma_px");
    ok &= !rms || sst_yaml_double(doc, rms, 0, SST_CALIB_LARGEST, &cam->rms_px);
    ok &= !corners || sst_yaml_int(doc, corners, 0, INT32_MAX, &cam->corners);
    ok &= !sigma || sst_yaml_double(doc, sigma, 0, SST_CALIB_LARGEST, &cam->sigma_px);
    return ok;
}

static bool read_camera(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_calib_camera *cam)
{
    struct sst_yaml_node *name = sst_yaml_get(map, "name");
    double focal[2] = { 0 }, centre[2] = { 0 };
    bool ok = !name || sst_yaml_string(doc, name, cam->name, sizeof(cam->name));

    ok &= need_numbers(doc, map, "focal_px", focal, 2);
    ok &= need_numbers(doc, map, "centre_px", centre, 2);
    ok &= read_lens(doc, map, cam);
    ok &= need_numbers(doc, map, "rotation", cam->rotation, 9);
    ok &= need_numbers(doc, map, "position_mm", cam->position_mm, 3);
    ok &= may_numbers(doc, map, "gain", cam->gain, 3);
    ok &= may_numbers(doc, map, "falloff", cam->falloff, 3);
    ok &= read_quality(doc, map, cam);
    cam->fx = focal[0];
    cam->fy = focal[1];
    cam->cx = centre[0];
    cam->cy = centre[1];
    return ok;
}

static void read_entry(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_calib *calib)
{
    struct sst_yaml_node *row_at = sst_yaml_need(doc, map, "row"), *col_at = sst_yaml_need(doc, map, "col");
    struct sst_calib_camera spare = { .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, .gain = { 1, 1, 1 } }, *cam = &spare;
    int row = 0, col = 0;
    bool placed = sst_yaml_int(doc, row_at, 0, calib->rows - 1, &row);
    const char *text;

    placed &= sst_yaml_int(doc, col_at, 0, calib->cols - 1, &col);
    if (placed && calib->camera[row * calib->cols + col].known)
        sst_yaml_fault(doc, map, "have two entries for row %d, column %d; remove one", row, col);
    else if (placed)
        cam = &calib->camera[row * calib->cols + col];
    cam->known = true;
    if (!read_camera(doc, map, cam))
        return; /* reported already */
    text = sst_camera_fault(cam);
    if (text)
        sst_yaml_fault(doc, map, "entry of row %d, column %d: %s; correct it", row, col, text);
}

static void read_cameras(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_calib *calib)
{
    struct sst_yaml_node *list = sst_yaml_need(doc, root, "cameras");

    if (!list)
        return;
    if (list->type != SST_YAML_LIST || !list->count) {
        sst_yaml_fault(doc, list, "must be a list with an entry for each camera");
        return;
    }
    for (struct sst_yaml_node *n = list->first; n; n = n->next) {
        if (n->type == SST_YAML_MAP)
            read_entry(doc, n, calib);
        else
            sst_yaml_fault(doc, n, "needs entries with row, col, focal_px and so on");
    }
}

static void read_reference(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_calib *calib)
{
    struct sst_yaml_node *at = sst_yaml_need(doc, root, "reference");
    int row, col, known = 0;

    if (!at)
        return;
    if (at->type != SST_YAML_LIST || at->count != 2) {
        sst_yaml_fault(doc, at, "must be [row, column]");
        return;
    }
    if (!sst_yaml_int(doc, at->first, 0, calib->rows - 1, &row) ||
        !sst_yaml_int(doc, at->last, 0, calib->cols - 1, &col))
        return;
    calib->reference = row * calib->cols + col;
    for (int k = 0; k < calib->rows * calib->cols; k++)
        known += calib->camera[k].known;
    if (known && !calib->camera[calib->reference].known) /* a list without a camera is reported already */
        sst_yaml_fault(doc, at, "is row %d, column %d, which has no entry in cameras; choose one that has", row, col);
}

static void read_facts(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_calib *calib)
{
    struct sst_yaml_node *created = sst_yaml_get(root, "created");
    char text[48];

    (void)sst_yaml_int(doc, sst_yaml_need(doc, root, "width"), 1, SST_IMAGE_MAX_SIDE, &calib->width);
    (void)sst_yaml_int(doc, sst_yaml_need(doc, root, "height"), 1, SST_IMAGE_MAX_SIDE, &calib->height);
    (void)sst_yaml_bool(doc, sst_yaml_get(root, "rig"), &calib->rig);
    (void)sst_yaml_double(doc, sst_yaml_get(root, "range_mm"), 0, SST_CALIB_LARGEST, &calib->range_mm);
    (void)sst_yaml_double(doc, sst_yaml_get(root, "noise_px"), 0, SST_CALIB_LARGEST, &calib->noise_px);
    (void)sst_yaml_string(doc, sst_yaml_get(root, "source"), calib->source, sizeof(calib->source));
    (void)sst_yaml_string(doc, sst_yaml_get(root, "board"), calib->board, sizeof(calib->board));
    if (sst_yaml_string(doc, created, text, sizeof(text)) && !parse_time(text, &calib->created_wall_ns))
        sst_yaml_fault(doc, created, "must be a time such as \"2026-01-31T09:15:00.000000000Z\", not %s", text);
}

/* The file's kind and grid. @return 0, -EBADMSG (faults that make further checks useless), -ENOMEM */
static int read_grid(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_calib *calib)
{
    static const char *const formats[] = { "sst-calib" };
    struct sst_yaml_node *version_at, *rows_at = sst_yaml_need(doc, root, "rows");
    int format, version = VERSION, rows, cols;
    bool known;

    version_at = sst_yaml_need(doc, root, "version");
    (void)sst_yaml_choice(doc, sst_yaml_need(doc, root, "format"), formats, 1, &format);
    if (sst_yaml_int(doc, version_at, 1, INT32_MAX, &version) && version != VERSION) {
        sst_yaml_know_all(root);
        sst_yaml_fault(doc, version_at, "is %d, which this version of sst does not support; use a newer one", version);
        return -EBADMSG;
    }
    known = sst_yaml_int(doc, rows_at, 1, SST_MAX_VIEWS, &rows);
    known &= sst_yaml_int(doc, sst_yaml_need(doc, root, "cols"), 1, SST_MAX_VIEWS, &cols);
    if (!known) {
        sst_yaml_know_all(root);
        return -EBADMSG;
    }
    if (rows * cols > SST_MAX_VIEWS) {
        sst_yaml_know_all(root);
        sst_yaml_fault(doc, rows_at, "times cols is %d; up to %d views are possible", rows * cols, SST_MAX_VIEWS);
        return -EBADMSG;
    }
    return sst_calib_init(calib, rows, cols);
}

int sst_calib_parse(struct sst_calib *calib, const char *text, size_t size, const char *name)
{
    struct sst_calib found = { 0 };
    struct sst_yaml_node *root;
    struct sst_yaml *doc;
    const char *unsound;
    int err = sst_yaml_parse(&doc, text, size, name), faults;

    if (err)
        return err;
    root = sst_yaml_root(doc);
    err = root ? read_grid(doc, root, &found) : -EBADMSG;
    if (!err) {
        read_facts(doc, root, &found);
        read_cameras(doc, root, &found);
        read_reference(doc, root, &found);
    }
    if (err == -ENOMEM)
        sst_log_error("%s: not enough memory to read it", name);
    faults = err == -ENOMEM ? 0 : sst_yaml_finish(doc);
    err = err ? err : faults;
    sst_yaml_destroy(doc);
    unsound = err ? NULL : sst_calib_fault(&found);
    if (unsound) {
        sst_log_error("%s: %s; calibrate again or correct it", name, unsound);
        err = -EBADMSG;
    }
    if (err)
        sst_calib_fini(&found);
    else
        *calib = found;
    return err;
}

int sst_calib_read(struct sst_calib *calib, const char *path)
{
    uint8_t *data;
    size_t size;
    int err = sst_file_read_text(path, SST_YAML_MAX_BYTES, &data, &size);

    if (err)
        return err;
    err = sst_calib_parse(calib, (const char *)data, size, path);
    free(data);
    return err;
}
