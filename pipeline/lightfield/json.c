/* lightfield.json: format version 1; version 2 adds the calibration. Every field is checked; a fault is logged in one
 * sentence with file and field. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/lightfield/calibrated.h"
#include "pipeline/lightfield/correction.h"
#include "pipeline/lightfield/json_read.h"
#include "pipeline/lightfield/lightfield_internal.h"

#define JSON_MAX_BYTES ((size_t)4 << 20)
#define FORMAT_NAME    "sst-lightfield"
#define REMEDY         "make the light field again"
#define OFFSET_MAX     1e4 /* spacings; a grid is at most 256 wide */

bool view_file_name_ok(const char *name)
{
    const size_t n = strlen(name);

    if (n < 1 || n > 255 || name[0] == '.')
        return false;
    for (size_t i = 0; i < n; i++) {
        if (name[i] == '/' || iscntrl((unsigned char)name[i]))
            return false;
    }
    return true;
}

static bool within(double v, double lo, double hi)
{
    return isfinite(v) && v >= lo && v <= hi;
}

static const char *view_fault(const struct sst_lightfield *lf, int k)
{
    static _Thread_local char text[96];
    const struct sst_view *v = &lf->views[k];
    const struct sst_lightfield_file *file = lf->files->view;
    const char *what = NULL;

    if (!v->present)
        return NULL;
    if (!within(v->bx, -OFFSET_MAX, OFFSET_MAX) || !within(v->by, -OFFSET_MAX, OFFSET_MAX))
        what = "bx or by is outside -10000..10000";
    else if (k == lf->ref_view && (v->bx != 0 || v->by != 0))
        what = "bx and by of the reference view must be 0";
    else if (!view_file_name_ok(file[k].name))
        what = "file is not a plain file name";
    for (int j = 0; !what && j < k; j++) {
        if (lf->views[j].present && !strcmp(file[j].name, file[k].name))
            what = "file is the same as another view's";
    }
    if (!what)
        return NULL;
    snprintf(text, sizeof(text), "views, row %d, col %d: %s", k / lf->cols, k % lf->cols, what);
    return text;
}

static const char *classes_fault(const struct sst_classes *c)
{
    if (c->count < 0 || c->count > SST_MAX_CLASSES)
        return "classes: more than 64";
    for (int i = 0; i < c->count; i++) {
        if (!c->names[i][0])
            return "classes: a name is empty";
        if (sst_classes_find(c, c->names[i]) != i + 1)
            return "classes: a name occurs twice";
    }
    return NULL;
}

const char *lightfield_fault(const struct sst_lightfield *lf)
{
    struct sst_lightfield copy = *lf;

    if (lf->rows < 1 || lf->cols < 1 || lf->rows > SST_MAX_VIEWS || lf->cols > SST_MAX_VIEWS ||
        lf->rows * lf->cols > SST_MAX_VIEWS)
        return "rows, cols: each must be at least 1 and their product at most 256";
    if (!lf->files)
        return "views: they have no files";
    if (lf->width < 1 || lf->height < 1 || lf->width > SST_IMAGE_MAX_SIDE || lf->height > SST_IMAGE_MAX_SIDE ||
        (size_t)lf->width * (size_t)lf->height > SST_IMAGE_MAX_PIXELS)
        return "width, height: each must be 1 to 32768";
    if (!within(lf->disp_min_px, -SST_DISP_ABS_MAX_PX, SST_DISP_ABS_MAX_PX))
        return "disp_min_px: outside -32768..32768";
    if (!within(lf->range_min_px, -SST_DISP_ABS_MAX_PX, SST_DISP_ABS_MAX_PX) ||
        !within(lf->range_max_px, lf->range_min_px, lf->range_min_px + SST_RANGE_MAX_PX))
        return "range_min_px, range_max_px: outside -32768..32768, min above max, or more than 1023 px apart";
    if (!within(lf->focal_px, 0, 1e9))
        return "focal_px: outside 0..1e9";
    if (!within(lf->spacing_mm, 0, 1e9))
        return "spacing_mm: outside 0..1e9";
    if (!within(lf->infinity_px, -SST_DISP_ABS_MAX_PX, SST_DISP_ABS_MAX_PX))
        return "infinity_px: outside -32768..32768";
    if (!within(lf->off_centre_px[0], -1e6, 1e6) || !within(lf->off_centre_px[1], -1e6, 1e6))
        return "off_centre_px: outside -1e6..1e6";
    if (!within(lf->skew_us, 0, 1e12))
        return "skew_us: outside 0..1e12";
    if (sst_lightfield_choose_ref(&copy))
        return "views: none";
    if (copy.ref_view != lf->ref_view)
        return "the reference view is not the present one nearest to the middle";
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const char *fault = view_fault(lf, k);

        if (fault)
            return fault;
    }
    return classes_fault(&lf->classes);
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

/* A list to which everything was added; else NULL. */
static json_t *whole(json_t *list, bool complete)
{
    if (complete)
        return list;
    json_decref(list);
    return NULL;
}

static json_t *views_to_json(const struct sst_lightfield *lf, char (*hashes)[65])
{
    json_t *views = json_array();
    bool complete = views != NULL;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const struct sst_view *v = &lf->views[k];
        const struct sst_lightfield_file *file = &lf->files->view[k];

        if (v->present)
            complete &=
                !json_array_append_new(views, json_pack("{s:i, s:i, s:f, s:f, s:s, s:s}", "row", k / lf->cols, "col",
                                                        k % lf->cols, "bx", v->bx, "by", v->by, "file", file->name,
                                                        "sha256", file->sha256[0] ? file->sha256 : hashes[k]));
    }
    return whole(views, complete);
}

static json_t *classes_to_json(const struct sst_classes *c)
{
    json_t *classes = json_array();
    bool complete = classes != NULL;

    for (int i = 0; i < c->count; i++)
        complete &=
            !json_array_append_new(classes, json_pack("{s:s, s:b}", "name", c->names[i], "ground", (int)c->ground[i]));
    return whole(classes, complete);
}

/* The corrected views. */
static json_t *correction_to_json(const struct sst_lightfield *lf)
{
    json_t *list = json_array();
    bool complete = list != NULL;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const struct sst_correction *c = &lf->correction[k];

        if (lf->views[k].present && !sst_correction_is_none(c))
            complete &= !json_array_append_new(
                list, json_pack("{s:i, s:i, s:f, s:f, s:f, s:f, s:[f, f, f], s:o*, s:o*}", "row", k / lf->cols, "col",
                                k % lf->cols, "right_px", c->shift_x_px, "down_px", c->shift_y_px, "roll_deg",
                                c->roll_deg, "scale", c->scale, "gain", c->gain[0], c->gain[1], c->gain[2], "falloff",
                                c->falloff != 0 ? json_real(c->falloff) : NULL, "exponent",
                                c->exponent != 1 ? json_real(c->exponent) : NULL));
    }
    return whole(list, complete);
}

static json_t *calibration_to_json(const struct sst_lightfield *lf, const char *sha256)
{
    const struct sst_rectified *r = lf->rectified;
    const double *m = r->rotation;

    return json_pack(
        "{s:s, s:s, s:s, s:i, s:f, s:f, s:[f, f, f, f, f, f, f, f, f], s:f, s:f, s:f, s:f, s:f, s:[f, f], s:f}", "file",
        SST_CALIBRATION_FILE, "sha256", sha256, "filter", sst_filter_name((enum sst_filter)lf->filter), "reference",
        r->reference, "cx", r->cx, "cy", r->cy, "rotation", m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8],
        "plane_mm", r->plane_mm, "out_rms_mm", r->out_rms_mm, "out_max_mm", r->out_max_mm, "lattice_rms_mm",
        r->lattice_rms_mm, "lattice_max_mm", r->lattice_max_mm, "step_mm", r->step_mm[0], r->step_mm[1], "skew_deg",
        r->skew_deg);
}

/* Where infinity is, and the principal point; with a calibration both follow from it. */
static int geometry_to_json(const struct sst_lightfield *lf, json_t *root)
{
    const double *off = lf->off_centre_px;

    if (lf->rectified)
        return 0;
    if (lf->infinity_known && (lf->infinity_px != 0
                                   ? json_object_set_new(root, "infinity_px", json_real(lf->infinity_px))
                                   : json_object_set_new(root, "parallel", json_true())))
        return -1;
    return (off[0] != 0 || off[1] != 0) &&
           json_object_set_new(root, "off_centre_px", json_pack("[f, f]", off[0], off[1]));
}

char *lightfield_to_json(const struct sst_lightfield *lf, char (*hashes)[65], const char *calibration_sha256)
{
    json_t *root = json_pack(
        "{s:s, s:i, s:i, s:i, s:i, s:i, s:f, s:f, s:f, s:f, s:f, s:f, s:b, s:b, s:s, s:s, s:o, s:o}", "format",
        FORMAT_NAME, "version", lf->rectified ? SST_LIGHTFIELD_VERSION : 1, "rows", lf->rows, "cols", lf->cols, "width",
        lf->width, "height", lf->height, "disp_min_px", lf->disp_min_px, "disp_steps_per_px", SST_DISP_SCALE,
        "range_min_px", lf->range_min_px, "range_max_px", lf->range_max_px, "focal_px", lf->focal_px, "spacing_mm",
        lf->spacing_mm, "disparity_given", (int)lf->files->external_disparity, "labels_given",
        (int)lf->files->external_labels, "source", lf->files->source, "history", lf->files->history, "classes",
        classes_to_json(&lf->classes), "views", views_to_json(lf, hashes));
    char *text = NULL;

    if (root &&
        ((lf->disparity_tested && json_object_set_new(root, "disparity_tested", json_true())) ||
         geometry_to_json(lf, root) ||
         (lf->skew_us > 0 && json_object_set_new(root, "skew_us", json_real(lf->skew_us))) ||
         (lf->samples.white &&
          json_object_set_new(root, "samples", json_pack("[i, i]", lf->samples.black, lf->samples.white))) ||
         (lf->files->judged && (json_object_set_new(root, "plausible", json_boolean(lf->files->plausible)) ||
                                json_object_set_new(root, "implausible", json_string(lf->files->implausible)))) ||
         (lf->correction && json_object_set_new(root, "correction", correction_to_json(lf))))) {
        json_decref(root);
        return NULL;
    }
    if (root &&
        (!lf->rectified || !json_object_set_new(root, "calibration", calibration_to_json(lf, calibration_sha256))))
        text = json_dumps(root, JSON_INDENT(1));
    json_decref(root);
    return text;
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

static int get_view(struct sst_json_reader *r, const struct sst_lightfield *lf)
{
    const int row = sst_json_int(r, "row", 0, lf->rows - 1);

    return row * lf->cols + sst_json_int(r, "col", 0, lf->cols - 1);
}

static void parse_view(struct sst_json_reader *r, size_t index SST_UNUSED, void *arg)
{
    struct sst_lightfield *lf = arg;
    struct sst_view v = { .present = true };
    struct sst_lightfield_file file;
    const int k = get_view(r, lf);

    v.bx = sst_json_double(r, "bx");
    v.by = sst_json_double(r, "by");
    sst_json_string(r, "file", file.name, sizeof(file.name));
    sst_json_hash(r, "sha256", file.sha256);
    if (!r->err && lf->views[k].present)
        sst_json_fault(r, "row, col", "occur twice");
    sst_json_finish(r);
    if (!r->err) {
        lf->views[k] = v;
        lf->files->view[k] = file;
    }
}

static void read_class(struct sst_json_reader *r, size_t index SST_UNUSED, void *arg)
{
    struct sst_lightfield *lf = arg;
    struct sst_classes *classes = &lf->classes;

    sst_json_string(r, "name", classes->names[classes->count], SST_CLASS_NAME_MAX);
    classes->ground[classes->count++] = sst_json_bool(r, "ground");
    sst_json_finish(r);
}

static int read_lists(struct sst_lightfield *lf, struct sst_json_reader *r)
{
    json_t *views = sst_json_array(r, "views", SST_MAX_VIEWS), *classes = sst_json_array(r, "classes", SST_MAX_CLASSES);

    lf->classes = (struct sst_classes){ 0 };
    sst_json_each(r, classes, "classes", read_class, lf);
    sst_json_each(r, views, "views", parse_view, lf);
    if (!r->err && sst_lightfield_choose_ref(lf))
        sst_json_fault(r, "views", "is empty");
    return r->err;
}

static bool all_finite(const double *v, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        if (!within(v[i], -1e9, 1e9))
            return false;
    }
    return true;
}

/* Parse how the calibration is used; sizes, focal length and spacing are the light field's. */
static int read_calibration(struct sst_lightfield *lf, const char *path, json_t *object)
{
    struct sst_json_reader r = { .path = path, .where = "calibration.", .remedy = REMEDY, .object = object };
    struct sst_rectified to = { .rows = lf->rows,
                                .cols = lf->cols,
                                .width = lf->width,
                                .height = lf->height,
                                .focal_px = lf->focal_px,
                                .spacing_mm = lf->spacing_mm };
    char file[32] = "", filter_name[32] = "";
    enum sst_filter filter = SST_FILTER_BILINEAR;

    sst_json_string(&r, "file", file, sizeof(file));
    sst_json_hash(&r, "sha256", lf->files->calibration_sha256);
    sst_json_string(&r, "filter", filter_name, sizeof(filter_name));
    to.reference = sst_json_int(&r, "reference", 0, lf->rows * lf->cols - 1);
    to.cx = sst_json_double(&r, "cx");
    to.cy = sst_json_double(&r, "cy");
    sst_json_doubles(&r, "rotation", to.rotation, 9);
    to.plane_mm = sst_json_double(&r, "plane_mm");
    to.out_rms_mm = sst_json_double(&r, "out_rms_mm");
    to.out_max_mm = sst_json_double(&r, "out_max_mm");
    to.lattice_rms_mm = sst_json_double(&r, "lattice_rms_mm");
    to.lattice_max_mm = sst_json_double(&r, "lattice_max_mm");
    sst_json_doubles(&r, "step_mm", to.step_mm, 2);
    to.skew_deg = sst_json_double(&r, "skew_deg");
    if (!r.err && strcmp(file, SST_CALIBRATION_FILE))
        sst_json_fault(&r, "file", "is not \"" SST_CALIBRATION_FILE "\"");
    if (!r.err && !sst_filter_find(&filter, filter_name))
        sst_json_fault(&r, "filter", "is not bilinear, bicubic or lanczos");
    if (!r.err && (!all_finite(to.rotation, 9) || !all_finite(to.step_mm, 2) || !all_finite(&to.cx, 2) ||
                   !within(to.plane_mm, 0, 1e9) || !(to.focal_px > 0) || !(to.spacing_mm > 0)))
        sst_json_fault(&r, "rotation, cx, cy, step_mm, plane_mm,", "focal_px or spacing_mm is out of range");
    sst_json_finish(&r);
    if (r.err)
        return r.err;
    lf->filter = (int)filter;
    lf->rectified = malloc(sizeof(*lf->rectified));
    if (!lf->rectified) {
        sst_log_error("no memory for the light field %s", path);
        return -ENOMEM;
    }
    *lf->rectified = to;
    rectified_geometry(lf);
    return 0;
}

static void read_view_correction(struct sst_json_reader *r, size_t index SST_UNUSED, void *arg)
{
    struct sst_lightfield *lf = arg;
    struct sst_correction c = sst_correction_none();
    const int k = get_view(r, lf);

    c.shift_x_px = sst_json_double(r, "right_px");
    c.shift_y_px = sst_json_double(r, "down_px");
    c.roll_deg = sst_json_double(r, "roll_deg");
    c.scale = sst_json_double(r, "scale");
    sst_json_doubles(r, "gain", c.gain, 3);
    if (json_object_get(r->object, "falloff"))
        c.falloff = sst_json_double(r, "falloff");
    if (json_object_get(r->object, "exponent"))
        c.exponent = sst_json_double(r, "exponent");
    if (!r->err && !lf->views[k].present)
        sst_json_fault(r, "row, col", "are those of no view");
    if (!r->err && !sst_correction_is_none(&lf->correction[k]))
        sst_json_fault(r, "row, col", "occur twice");
    if (!r->err && !sst_correction_valid(&c))
        sst_json_fault(r, "right_px, down_px, roll_deg, scale, gain, falloff, exponent:", "one is out of range");
    sst_json_finish(r);
    if (!r->err)
        lf->correction[k] = c;
}

static int read_correction(struct sst_lightfield *lf, struct sst_json_reader *r)
{
    json_t *list = sst_json_array(r, "correction", SST_MAX_VIEWS);

    if (r->err)
        return r->err;
    lf->correction = malloc((size_t)(lf->rows * lf->cols) * sizeof(*lf->correction));
    if (!lf->correction) {
        sst_log_error("no memory for the light field %s", r->path);
        return r->err = -ENOMEM;
    }
    for (int k = 0; k < lf->rows * lf->cols; k++)
        lf->correction[k] = sst_correction_none();
    sst_json_each(r, list, "correction", read_view_correction, lf);
    return r->err;
}

/* Parse the arguments of sst_lightfield_init(). */
static int read_head(struct sst_json_reader *r, int *rows, int *cols, int *version_out)
{
    char format[32] = "";
    int version;

    sst_json_string(r, "format", format, sizeof(format));
    if (!r->err && strcmp(format, FORMAT_NAME))
        sst_json_fault(r, "format", "is not \"" FORMAT_NAME "\"");
    version = sst_json_int(r, "version", 1, 1000000);
    if (!r->err && json_object_get(r->object, "kind")) {
        sst_log_error("%s is of a light field with a pose for every view, which this command does not read; `sst poses` "
                      "finds or refines its poses, `sst export colmap` or `nerfstudio` hands it to other programs",
                      r->path);
        r->err = -EBADMSG;
    }
    if (!r->err && version > SST_LIGHTFIELD_VERSION) {
        sst_log_error("%s: version %d is newer than %d, the newest that this program reads; update sst", r->path,
                      version, SST_LIGHTFIELD_VERSION);
        r->err = -EBADMSG;
    }
    *version_out = version;
    *rows = sst_json_int(r, "rows", 1, SST_MAX_VIEWS);
    *cols = sst_json_int(r, "cols", 1, SST_MAX_VIEWS);
    if (!r->err && *rows * *cols > SST_MAX_VIEWS)
        sst_json_fault(r, "rows, cols", "make more than 256 views");
    return r->err;
}

static int read_root(struct sst_lightfield *lf, struct sst_json_reader *r)
{
    int rows, cols, version;
    json_t *calibration = NULL;
    const char *what;

    if (read_head(r, &rows, &cols, &version))
        return r->err;
    if (sst_lightfield_init_files(lf, rows, cols)) {
        sst_log_error("no memory for the light field %s", r->path);
        return -ENOMEM;
    }
    lf->width = sst_json_int(r, "width", 1, SST_IMAGE_MAX_SIDE);
    lf->height = sst_json_int(r, "height", 1, SST_IMAGE_MAX_SIDE);
    lf->disp_min_px = sst_json_double(r, "disp_min_px");
    if (sst_json_double(r, "disp_steps_per_px") != SST_DISP_SCALE)
        sst_json_fault(r, "disp_steps_per_px", "is not 64");
    lf->range_min_px = sst_json_double(r, "range_min_px");
    lf->range_max_px = sst_json_double(r, "range_max_px");
    lf->focal_px = sst_json_double(r, "focal_px");
    lf->spacing_mm = sst_json_double(r, "spacing_mm");
    lf->files->external_disparity = sst_json_bool(r, "disparity_given");
    lf->disparity_tested = json_object_get(r->object, "disparity_tested") && sst_json_bool(r, "disparity_tested");
    lf->infinity_known = json_object_get(r->object, "parallel") && sst_json_bool(r, "parallel");
    if (json_object_get(r->object, "infinity_px")) {
        lf->infinity_px = sst_json_double(r, "infinity_px");
        if (lf->infinity_known && lf->infinity_px != 0)
            sst_json_fault(r, "infinity_px", "contradicts parallel");
        lf->infinity_known = true;
    }
    if (json_object_get(r->object, "off_centre_px"))
        sst_json_doubles(r, "off_centre_px", lf->off_centre_px, 2);
    lf->skew_us = json_object_get(r->object, "skew_us") ? sst_json_double(r, "skew_us") : 0;
    if (json_object_get(r->object, "samples"))
        sst_json_samples(r, "samples", &lf->samples);
    lf->files->external_labels = sst_json_bool(r, "labels_given");
    sst_json_string(r, "source", lf->files->source, sizeof(lf->files->source));
    sst_json_string(r, "history", lf->files->history, sizeof(lf->files->history));
    lf->files->judged = json_object_get(r->object, "plausible") != NULL;
    if (lf->files->judged) {
        lf->files->plausible = sst_json_bool(r, "plausible");
        sst_json_string(r, "implausible", lf->files->implausible, sizeof(lf->files->implausible));
    }
    if (version > 1)
        calibration = sst_json_field(r, "calibration");
    if (r->err || read_lists(lf, r) || (json_object_get(r->object, "correction") && read_correction(lf, r)))
        return r->err;
    sst_json_finish(r);
    if (!r->err && calibration)
        r->err = read_calibration(lf, r->path, calibration);
    what = r->err ? NULL : lightfield_fault(lf);
    if (what) {
        sst_log_error("%s: %s; make the light field again", r->path, what);
        r->err = -EBADMSG;
    }
    return r->err;
}

int lightfield_read_json(struct sst_lightfield *lf, const char *path)
{
    struct sst_json_reader r = { .path = path, .where = "", .remedy = REMEDY };
    struct sst_lightfield made = { 0 };
    int err = sst_json_load(&r.object, path, JSON_MAX_BYTES, REMEDY);

    if (err)
        return err;
    err = read_root(&made, &r);
    json_decref(r.object);
    if (err)
        sst_lightfield_fini(&made);
    else
        *lf = made;
    return err;
}
