/* The folder of an import: pictures copied and checked, views with their names and lenses. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"
#include "base/thread.h"
#include "pipeline/camera/format.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/deep.h"
#include "pipeline/kernels/sha256.h"
#include "pipeline/posed/import/import_internal.h"

#define NAMED 3 /* damaged pictures, each by its fault */

/* Properties of a picture's file. */
struct picture {
    char *damaged; /* the fault of a picture without a pose, which is left out; NULL: none */
    int width, height, channels, bits;
    struct sst_samples stretch; /* of 16 bits */
    uint8_t orientation;        /* EXIF's, which is not applied */
    char end[8];
    char sha256[65];
};

struct job {
    const struct model *m;
    const char *out;         /* temporary folder */
    struct picture *picture; /* [views] */
};

/* Decode all of a picture, to refuse a damaged one now. */
static int inspect(struct picture *p, const uint8_t *data, size_t size, const char *path)
{
    struct sst_deep deep;
    const int err = sst_deep_decode(&deep, data, size, path);

    if (err)
        return err;
    p->width = deep.width;
    p->height = deep.height;
    p->channels = deep.channels;
    p->bits = deep.white > 255 ? 16 : 8;
    if (p->bits == 16)
        p->stretch = sst_deep_stretch(&deep);
    sst_deep_fini(&deep);
    p->orientation = (uint8_t)sst_image_orientation(data, size);
    snprintf(p->end, sizeof(p->end), "%s", data[0] == 0x89 ? ".png" : sst_image_is_jpeg(data, size) ? ".jpg" : ".tif");
    return 0;
}

static int view_file(char path[SST_PATH_MAX], const char *out, int k, const char *end)
{
    char name[48];

    snprintf(name, sizeof(name), "views/%04d%s", k, end);
    return sst_path_join(path, out, name);
}

/* Read and check a picture; a damaged one is named, and refused only if it has a pose. */
static int read_picture(struct picture *p, uint8_t **data, size_t *size, const struct model_view *v)
{
    char text[SST_LOG_MAX] = "", *before = sst_log_hold_errors(text);
    int err = sst_file_read(v->path, POSED_VIEW_BYTES, data, size);

    if (!err) {
        err = inspect(p, *data, *size, v->path);
        if (err)
            free(*data);
    }
    sst_log_hold_errors(before);
    if (!err)
        return 0;
    if (err == -ENOMEM || v->camera.known) {
        sst_log_error("%s", text);
        return err;
    }
    p->damaged = strdup(text);
    return p->damaged ? 0 : -ENOMEM;
}

static int copy_view(void *arg, int k, int worker SST_UNUSED)
{
    const struct job *job = arg;
    struct picture *p = &job->picture[k];
    char to[SST_PATH_MAX];
    uint8_t *data;
    size_t size;
    int err = read_picture(p, &data, &size, &job->m->view[k]);

    if (err || p->damaged)
        return err;
    sst_sha256_hex(p->sha256, data, size);
    err = view_file(to, job->out, k, p->end);
    err = err ? err : sst_file_write(to, data, size);
    free(data);
    return err;
}

/* --- views that stay ---------------------------------------------------------------------------------------------- */

static bool alike(const struct picture *a, const struct picture *b)
{
    return a->width == b->width && a->height == b->height && a->channels == b->channels && a->bits == b->bits;
}

static const char *kind_text(char text[64], const struct picture *p)
{
    snprintf(text, 64, "%dx%d pixels, %s of %d bits", p->width, p->height, p->channels == 1 ? "grey" : "colour", p->bits);
    return text;
}

/* First posed picture, else the first one. @return -1: none can be read */
static int first_of(const struct model *m, const struct job *job)
{
    int first = -1;

    for (int k = m->count - 1; k >= 0; k--) {
        if (!job->picture[k].damaged && (m->view[k].camera.known || first < 0 || !m->view[first].camera.known))
            first = k;
    }
    return first;
}

/* Pictures that are left out, the first ones by name. */
static void warn_damaged(const struct model *m, const struct job *job)
{
    int n = 0;

    for (int k = 0; k < m->count; k++) {
        if (job->picture[k].damaged && n++ < NAMED)
            sst_log_warning("%s; it has no pose, and is left out", job->picture[k].damaged);
    }
    if (n > NAMED)
        sst_log_warning("%s: %d pictures more cannot be read and are left out", m->cfg->source, n - NAMED);
}

/* Pictures without a pose that differ from the posed ones are no views: they are removed from the model. */
static int choose_views(struct model *m, struct job *job)
{
    const int first = first_of(m, job);
    int kept = 0;
    char a[64], b[64];

    if (first < 0) {
        sst_log_error("%s; %s has no picture that can be read", job->picture[0].damaged, m->cfg->source);
        return -EBADMSG;
    }
    warn_damaged(m, job);
    for (int k = 0; k < m->count; k++) {
        const bool same = job->picture[k].damaged || alike(&job->picture[k], &job->picture[first]);

        if (!same && (m->view[k].camera.known || !m->view[first].camera.known)) {
            sst_log_error("%s has %s, but %s has %s; all pictures must be of one kind", m->view[k].path,
                          kind_text(a, &job->picture[k]), m->view[first].path, kind_text(b, &job->picture[first]));
            return -EBADMSG;
        }
        m->other += !same;
    }
    for (int k = 0; k < m->count; k++) {
        char from[SST_PATH_MAX], to[SST_PATH_MAX];
        int err = view_file(from, job->out, k, job->picture[k].end);

        if (job->picture[k].damaged)
            continue;
        if (!err && !alike(&job->picture[k], &job->picture[first])) {
            remove(from);
            continue;
        }
        err = err ? err : view_file(to, job->out, kept, job->picture[k].end);
        if (err || (kept != k && rename(from, to))) {
            sst_log_error("cannot rename %s: %s", from, strerror(errno));
            return -EIO;
        }
        if (kept != k) {
            free(job->picture[kept].damaged);
            m->view[kept] = m->view[k];
            job->picture[kept] = job->picture[k];
            job->picture[k].damaged = NULL;
        }
        kept++;
    }
    m->count = kept;
    return 0;
}

/* --- names -------------------------------------------------------------------------------------------------------- */

static int compare_texts(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* Names without folders where they differ so, else with the folders that are not the same for all. */
static int set_names(struct sst_posed *posed, const struct model *m)
{
    const char **base = calloc((size_t)m->count, sizeof(*base));
    size_t common = 0;
    bool twice = false;

    if (!base)
        return -ENOMEM;
    for (int k = 0; k < m->count; k++)
        base[k] = sst_path_base(m->view[k].name);
    qsort(base, (size_t)m->count, sizeof(*base), compare_texts);
    for (int k = 1; k < m->count; k++)
        twice |= !strcmp(base[k - 1], base[k]);
    free(base);
    if (twice) {
        common = strlen(m->view[0].name);
        for (int k = 1; k < m->count; k++) {
            for (size_t i = 0; i < common; i++) {
                if (m->view[k].name[i] != m->view[0].name[i])
                    common = i;
            }
        }
        while (common && m->view[0].name[common - 1] != '/')
            common--;
    }
    for (int k = 0; k < m->count; k++) {
        const char *name = twice ? m->view[k].name + common : sst_path_base(m->view[k].name);

        if (strlen(name) >= sizeof(posed->view[k].name))
            return model_fault(m, name, "the name is longer than 255 bytes; rename the picture");
        memcpy(posed->view[k].name, name, strlen(name) + 1);
        sst_text_make_utf8(posed->view[k].name);
    }
    return 0;
}

/* --- lenses ------------------------------------------------------------------------------------------------------- */

/* Lens of the user's calibration file. */
static int read_lens(struct model_view *lens, const char *path, const struct picture *p)
{
    const struct sst_calib_format_config how = { .rows = 1, .cols = 1, .width = p->width, .height = p->height };
    const struct sst_calib_format *format;
    struct sst_calib calib;
    uint8_t *data;
    size_t size;
    int err = sst_file_read(path, SST_CALIB_FILE_MAX, &data, &size);

    if (err)
        return err;
    if (matlab_is(data, size)) {
        err = matlab_lens(lens, data, size, path);
        free(data);
        return err;
    }
    free(data);
    format = sst_calib_format_of(path);
    if (format && !format->read)
        sst_log_error("%s: lenses of the format %s are not read", path, format->name);
    if (!format || !format->read)
        return -EBADMSG;
    err = format->read(&calib, path, &how);
    if (err)
        return err;
    lens->camera = calib.camera[calib.reference];
    lens->width = calib.width;
    lens->height = calib.height;
    sst_calib_fini(&calib);
    return 0;
}

/* The lens of the user's options, for a source that has none. */
static int given_lens(struct sst_calib_camera *lens, const struct model *m, const struct picture *p)
{
    const struct sst_posed_import_config *cfg = m->cfg;
    const double pi = 3.14159265358979323846;
    struct model_view read = { .width = 0 };
    int err = cfg->lens ? read_lens(&read, cfg->lens, p) : 0;

    if (err)
        return err;
    if (read.width && (read.width != p->width || read.height != p->height)) {
        sst_log_error("%s is of pictures of %dx%d pixels, these have %dx%d", cfg->lens, read.width, read.height, p->width,
                      p->height);
        return -EBADMSG;
    }
    *lens = read.camera;
    if (cfg->focal_px > 0 || cfg->fov_deg > 0) {
        lens->fx = lens->fy = cfg->focal_px > 0 ? cfg->focal_px : p->width / 2.0 / tan(cfg->fov_deg * pi / 360);
        lens->cx = (p->width - 1) / 2.0;
        lens->cy = (p->height - 1) / 2.0;
    }
    return 0;
}

static void take_lens(struct sst_calib_camera *to, const struct sst_calib_camera *from)
{
    to->fx = from->fx;
    to->fy = from->fy;
    to->cx = from->cx;
    to->cy = from->cy;
    to->lens = from->lens;
    memcpy(to->k, from->k, sizeof(to->k));
}

/* Pictures without a pose get the lens that all posed ones share. */
static void share_lens(struct model *m)
{
    const struct sst_calib_camera *shared = NULL;

    for (int k = 0; k < m->count; k++) {
        const struct sst_calib_camera *c = &m->view[k].camera;

        if (!c->known)
            continue;
        if (shared && (c->fx != shared->fx || c->fy != shared->fy || c->cx != shared->cx || c->cy != shared->cy ||
                       memcmp(c->k, shared->k, sizeof(c->k))))
            return;
        shared = c;
    }
    for (int k = 0; shared && k < m->count; k++) {
        if (!m->view[k].camera.known)
            take_lens(&m->view[k].camera, shared);
    }
}

/* The lens of a source that has angles alone. */
static const char *lens_of_angle(struct model_view *v, const struct picture *p)
{
    const double fx = p->width / 2.0 / tan(v->angle[0] / 2), fy = v->angle[1] > 0 ? p->height / 2.0 / tan(v->angle[1] / 2) : fx;

    return model_lens(v, (const double[4]){ fx, fy, p->width / 2.0, p->height / 2.0 }, NULL, 0);
}

static int set_lenses(struct model *m, const struct picture *picture)
{
    struct sst_calib_camera given;
    bool own = false, needed = false;
    int err;

    for (int k = 0; k < m->count; k++) {
        const bool angle = m->view[k].camera.fx == 0 && m->view[k].angle[0] > 0;
        const char *fault = angle ? lens_of_angle(&m->view[k], &picture[k]) : NULL;

        if (fault)
            return model_fault(m, m->view[k].name, fault);
        own |= m->view[k].camera.fx != 0;
        needed |= m->view[k].camera.known && m->view[k].camera.fx == 0;
    }
    if (own && !needed && (m->cfg->lens || m->cfg->focal_px > 0 || m->cfg->fov_deg > 0)) {
        sst_log_error("%s has lenses of its own; leave out --focal, --fov and --lens", m->cfg->source);
        return -EINVAL;
    }
    err = own && !needed ? 0 : given_lens(&given, m, picture);
    if (err)
        return err;
    if (needed && given.fx == 0) {
        sst_log_error("%s has poses without a focal length; add --focal PX, --fov DEG (across the width) or --lens FILE",
                      m->cfg->source);
        return -EINVAL;
    }
    for (int k = 0; k < m->count; k++) {
        struct model_view *v = &m->view[k];

        if (v->camera.fx == 0 && (needed || !own))
            take_lens(&v->camera, &given);
        if (v->width && (v->width != picture[k].width || v->height != picture[k].height)) {
            sst_log_error("%s has %dx%d pixels, but its lens in %s is of pictures of %dx%d; use the pictures of the poses",
                          v->path, picture[k].width, picture[k].height, m->cfg->source, v->width, v->height);
            return -EBADMSG;
        }
    }
    if (own)
        share_lens(m);
    return 0;
}

/* --- the folder --------------------------------------------------------------------------------------------------- */

static void set_world(struct sst_posed *posed, struct model *m)
{
    const struct sst_posed_import_config *cfg = m->cfg;
    const double unit_mm = cfg->unit_mm > 0 ? cfg->unit_mm : m->unit_mm;

    posed->metric = m->metric || cfg->unit_mm > 0;
    memcpy(posed->up, m->up, sizeof(posed->up));
    posed->geographic = m->geographic;
    posed->latitude = m->latitude;
    posed->longitude = m->longitude;
    posed->altitude_m = m->altitude_m;
    posed->kelvin_scale = cfg->kelvin_scale;
    posed->kelvin_offset = cfg->kelvin_offset;
    posed->median_px = m->median_px;
    snprintf(posed->source, sizeof(posed->source), "%s import of %.900s", m->format, cfg->source);
    sst_text_make_utf8(posed->source);
    if (sst_posed_placed(posed))
        snprintf(posed->history, sizeof(posed->history), "poses of %s", m->format);
    posed->points = m->points;
    posed->point_count = m->point_count;
    m->points = NULL;
    for (int i = 0; i < posed->point_count; i++) {
        for (int j = 0; j < 3; j++)
            posed->points[i].at_mm[j] *= unit_mm;
    }
    for (int k = 0; k < posed->count; k++) {
        for (int i = 0; i < 3; i++)
            posed->view[k].camera.position_mm[i] *= unit_mm;
    }
}

static int finish(struct model *m, const struct job *job)
{
    struct sst_posed posed;
    int err;

    if (m->cfg->kelvin_scale != 0 && job->picture[0].channels == 3) {
        sst_log_error("--kelvin is of thermal pictures, which have one channel; those of %s are colour; leave it out, or "
                      "name the folder of the thermal ones",
                      m->cfg->source);
        return -EINVAL;
    }
    err = sst_posed_init(&posed, m->count);
    if (err)
        return err;
    posed.width = job->picture[0].width;
    posed.height = job->picture[0].height;
    posed.channels = job->picture[0].channels;
    posed.bits = job->picture[0].bits;
    posed.samples = job->picture[0].stretch;
    err = set_names(&posed, m);
    for (int k = 0; k < m->count; k++) {
        struct sst_posed_view *v = &posed.view[k];

        posed.samples.black = sst_min_int(posed.samples.black, job->picture[k].stretch.black);
        posed.samples.white = sst_max_int(posed.samples.white, job->picture[k].stretch.white);

        v->camera = m->view[k].camera;
        snprintf(v->file, sizeof(v->file), "%04d%s", k, job->picture[k].end);
        memcpy(v->sha256, job->picture[k].sha256, sizeof(v->sha256));
    }
    if (!err)
        times_set(&posed);
    if (!err && m->cfg->moments)
        err = moments_set(&posed, m->cfg->moments);
    if (!err) {
        set_world(&posed, m);
        err = sst_posed_write(&posed, job->out);
        err = err == -EINVAL ? -EBADMSG : err; /* a fault of the source */
    }
    sst_posed_fini(&posed);
    return err;
}

/* Poses are of the pixels as they are stored. */
static void warn_orientations(const struct model *m, const struct picture *picture)
{
    const char **name = calloc((size_t)m->count, sizeof(*name));
    uint8_t *orientation = calloc((size_t)m->count, 1);

    for (int k = 0; name && orientation && k < m->count; k++) {
        name[k] = m->view[k].name;
        orientation[k] = picture[k].orientation;
    }
    if (name && orientation)
        sst_image_warn_orientations(m->cfg->source, name, orientation, m->count);
    free(name);
    free(orientation);
}

static int fill(struct model *m, const char *out)
{
    struct job job = { .m = m, .out = out };
    const int count = m->count; /* some may be left out */
    char views[SST_PATH_MAX];
    int err = sst_path_join(views, out, "views");

    err = err ? err : sst_path_make_dir(views);
    if (err)
        return err;
    job.picture = calloc((size_t)m->count, sizeof(*job.picture));
    if (!job.picture)
        return -ENOMEM;
    err = sst_parallel_for(m->count, sst_thread_count(m->cfg->threads), copy_view, &job);
    err = err ? err : choose_views(m, &job);
    err = err ? err : set_lenses(m, job.picture);
    err = err ? err : finish(m, &job);
    if (!err)
        warn_orientations(m, job.picture);
    for (int k = 0; k < count; k++)
        free(job.picture[k].damaged);
    free(job.picture);
    return err;
}

static void warn(const struct model *m)
{
    int unplaced = 0;

    for (int k = 0; k < m->count; k++)
        unplaced += !m->view[k].camera.known;
    if (unplaced && unplaced < m->count)
        sst_log_warning("%s: %d pictures have no pose; they are views that are not placed", m->cfg->source, unplaced);
    if (m->other)
        sst_log_warning("%s: %d pictures without a pose are of another size or kind, or more than %d, and are left out",
                        m->cfg->source, m->other, SST_POSED_MAX_VIEWS);
}

int model_write(struct model *m)
{
    struct sst_outdir out;
    int err = sst_outdir_open(&out, m->cfg->out, m->cfg->force);

    if (err)
        return err;
    out.synced = true;
    err = fill(m, out.temporary);
    if (err == -ENOMEM)
        sst_log_error("not enough memory to import %s", m->cfg->source);
    err = sst_outdir_end(&out, err);
    if (!err)
        warn(m);
    return err;
}
