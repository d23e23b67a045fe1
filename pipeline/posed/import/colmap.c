/* Models of COLMAP: cameras, images and points. Pixel centres are at halves; poses take points from the world into the
 * camera's axes: x right, y down, z forward. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/import/colmap_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"

/* Parameters of the lens models, by the numbers that binary files have. */
static const struct {
    const char *name;
    int parameters;
    bool pinhole; /* with OpenCV's distortion, or less */
} lenses[] = {
    { "SIMPLE_PINHOLE", 3, true }, /* f cx cy */
    { "PINHOLE", 4, true },        /* fx fy cx cy */
    { "SIMPLE_RADIAL", 4, true },  /* f cx cy k1 */
    { "RADIAL", 5, true },         /* f cx cy k1 k2 */
    { "OPENCV", 8, true },         /* fx fy cx cy k1 k2 p1 p2 */
    { "OPENCV_FISHEYE", 8, false },
    { "FULL_OPENCV", 12, true }, /* ... k3 k4 k5 k6 */
    { "FOV", 5, false },
    { "SIMPLE_RADIAL_FISHEYE", 4, false },
    { "RADIAL_FISHEYE", 5, false },
    { "THIN_PRISM_FISHEYE", 12, false },
    { "RAD_TAN_THIN_PRISM_FISHEYE", 16, false },
};

int colmap_lens(const char *name)
{
    for (size_t i = 0; i < ARRAY_LEN(lenses); i++) {
        if (!strcmp(lenses[i].name, name))
            return (int)i;
    }
    return -1;
}

int colmap_parameters(int64_t lens)
{
    return lens < 0 || lens >= (int64_t)ARRAY_LEN(lenses) ? -1 : lenses[lens].parameters;
}

int colmap_init(struct colmap *c, struct model *m)
{
    *c = (struct colmap){ .m = m };
    c->id = calloc(SST_POSED_MAX_VIEWS, sizeof(*c->id));
    c->view_of = calloc(COLMAP_IDS, sizeof(*c->view_of));
    return c->id && c->view_of ? 0 : -ENOMEM;
}

void colmap_fini(struct colmap *c)
{
    free(c->camera);
    free(c->error);
    free(c->id);
    free(c->view_of);
}

struct colmap_camera *colmap_add_camera(struct colmap *c)
{
    if (!sst_mem_grow(&c->camera, c->cameras, &c->capacity, sizeof(*c->camera))) {
        sst_log_error("not enough memory to import %s", c->m->path);
        return NULL;
    }
    c->camera[c->cameras] = (struct colmap_camera){ .lens = -1 };
    return &c->camera[c->cameras++];
}

static const char *set_lens(struct model_view *v, const struct colmap_camera *from)
{
    static _Thread_local char text[120];
    const double *p = from->p;
    const bool one = lenses[from->lens].parameters == 3 || !strcmp(lenses[from->lens].name, "SIMPLE_RADIAL") ||
                     !strcmp(lenses[from->lens].name, "RADIAL"); /* one focal length */
    const double lens[4] = { p[0], p[one ? 0 : 1], p[one ? 1 : 2], p[one ? 2 : 3] };
    const int used = one ? 3 : 4;
    const char *fault;

    if (!lenses[from->lens].pinhole) {
        snprintf(text, sizeof(text), "the camera model %s is not one of a pinhole with OpenCV's distortion; undistort it",
                 lenses[from->lens].name);
        return text;
    }
    if (from->width < 1 || from->height < 1 || from->width > SST_IMAGE_MAX_SIDE || from->height > SST_IMAGE_MAX_SIDE)
        return "its camera's width or height is not 1 to 32768";
    v->width = (int)from->width;
    v->height = (int)from->height;
    fault = model_lens(v, lens, p + used, lenses[from->lens].parameters - used);
    snprintf(v->camera.name, sizeof(v->camera.name), "%lld", (long long)from->id);
    return fault;
}

/* Of a unit quaternion, w first; its length may be off by rounding. */
static bool rotation_of(double R[9], const double q[4])
{
    const double n = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    double w, x, y, z;

    if (!(fabs(n - 1) < 1e-2))
        return false;
    w = q[0] / n;
    x = q[1] / n;
    y = q[2] / n;
    z = q[3] / n;
    memcpy(R,
           (const double[9]){ 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),
                              1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x),
                              1 - 2 * (x * x + y * y) },
           9 * sizeof(*R));
    return true;
}

int colmap_add_image(struct colmap *c, const struct colmap_image *image)
{
    struct model_view *v = model_add(c->m, image->name);
    const struct colmap_camera *camera = NULL;
    double R[9];
    const char *fault;

    if (!v)
        return -EBADMSG;
    for (int i = 0; i < c->cameras && !camera; i++) {
        if (c->camera[i].id == image->camera)
            camera = &c->camera[i];
    }
    if (!camera)
        return model_fault(c->m, image->name, "its camera is not in the list of cameras");
    if (!rotation_of(R, image->q))
        return model_fault(c->m, image->name, "its quaternion is not of length 1");
    fault = model_place(v, R, image->t);
    fault = fault ? fault : set_lens(v, camera);
    if (fault)
        return model_fault(c->m, image->name, fault);
    c->id[c->m->count - 1] = image->id;
    if (image->id >= 0 && image->id < COLMAP_IDS)
        c->view_of[image->id] = c->m->count;
    return 0;
}

int colmap_view(const struct colmap *c, int64_t id)
{
    if (id >= 0 && id < COLMAP_IDS) /* as they usually are */
        return c->view_of[id] - 1;
    for (int k = 0; k < c->m->count; k++) {
        if (c->id[k] == id)
            return k;
    }
    return -1;
}

void colmap_observe(struct colmap *c, int64_t image, const double at[3])
{
    const int view = colmap_view(c, image);

    if (view >= 0)
        model_observe(c->m, &c->m->view[view].camera, at);
}

int colmap_add_point(struct colmap *c, const struct colmap_point *p)
{
    for (int i = 0; i < 3; i++) {
        if (!(fabs(p->at[i]) <= SST_CALIB_LARGEST / METRE_MM))
            return model_fault(c->m, "", "a point's place is not finite or beyond 1e9");
    }
    if (p->error >= 0 && isfinite(p->error) && c->errors < POSED_MAX_POINTS)
        c->error[c->errors++] = p->error;
    if (c->m->point_count < POSED_MAX_POINTS) {
        struct sst_posed_point *to = &c->m->points[c->m->point_count++];

        memcpy(to->at_mm, p->at, sizeof(to->at_mm));
        to->views = p->views;
    }
    return 0;
}

int colmap_reserve(struct colmap *c, uint64_t count)
{
    int err = model_reserve_points(c->m, count);

    if (err || !count)
        return err;
    c->error = calloc(count < POSED_MAX_POINTS ? (size_t)count : POSED_MAX_POINTS, sizeof(*c->error));
    if (!c->error) {
        sst_log_error("not enough memory for the points of %s", c->m->path);
        err = -ENOMEM;
    }
    return err;
}

static int compare_errors(const void *a, const void *b)
{
    const double p = *(const double *)a, q = *(const double *)b;

    return (p > q) - (p < q);
}

static int read_files(struct colmap *c, const char *dir)
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, dir, "cameras.bin");
    const bool binary = !err && sst_path_exists(path);
    static const struct {
        const char *name;
        int (*text)(struct colmap *c, const char *path);
        int (*binary)(struct colmap *c, const char *path);
    } files[] = { { "cameras", colmap_text_cameras, colmap_binary_cameras },
                  { "images", colmap_text_images, colmap_binary_images },
                  { "points3D", colmap_text_points, colmap_binary_points } };

    for (size_t i = 0; !err && i < ARRAY_LEN(files); i++) {
        char name[32];

        snprintf(name, sizeof(name), "%s.%s", files[i].name, binary ? "bin" : "txt");
        err = sst_path_join(path, dir, name);
        if (err || (i == 2 && !sst_path_exists(path))) /* poses need no points */
            continue;
        c->m->path = path;
        err = (binary ? files[i].binary : files[i].text)(c, path);
    }
    c->m->path = dir;
    return err;
}

int read_colmap(struct model *m, const char *path)
{
    struct colmap c;
    int err = 0;

    m->format = "COLMAP";
    if (colmap_init(&c, m)) {
        sst_log_error("not enough memory to import %s", path);
        err = -ENOMEM;
    }
    err = err ? err : read_files(&c, path);
    if (c.errors) {
        qsort(c.error, (size_t)c.errors, sizeof(*c.error), compare_errors);
        if (c.error[c.errors - 1] > 0)
            m->median_px = c.error[c.errors / 2];
    }
    colmap_fini(&c);
    return err;
}
