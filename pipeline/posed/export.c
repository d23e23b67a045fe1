/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/export.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/camera/numbers.h"
#include "pipeline/image/deep.h"
#include "pipeline/image/jpeg_tables.h"
#include "pipeline/kernels/sha256.h"
#include "pipeline/lightfield/export_poses.h"
#include "pipeline/posed/posed_internal.h"

struct job {
    const struct sst_export_config *cfg;
    struct sst_posed posed;
    struct sst_export_point *point; /* [points] */
    struct sst_export_sight *sight;
    int *first; /* [points]: sight that gives the colour; -1: none */
    int points;
    char (*name)[SST_EXPORT_NAME]; /* [views] */
    const char *out;               /* temporary folder */
};

static const struct {
    const char *name, *marker; /* marker: a file that identifies an export of this format */
    int (*write)(const struct sst_export_cameras *cameras, const char *dir);
} formats[] = {
    { "colmap", "sparse/0/cameras.txt", sst_export_colmap },
    { "nerfstudio", "transforms.json", sst_export_nerfstudio },
};

static bool is_taken(const struct job *job, int view)
{
    for (int k = 0; k < view; k++) {
        if (!strcmp(job->name[k], job->name[view]))
            return true;
    }
    return false;
}

/* COLMAP ends a name at a blank, and its subfolders would be folders of ours. */
static void set_name(struct job *job, int k)
{
    const struct sst_posed_view *v = &job->posed.view[k];
    char *name = job->name[k];

    snprintf(name, SST_EXPORT_NAME, "%s", v->name);
    for (char *p = name; *p; p++) {
        if ((unsigned char)*p <= ' ' || strchr("/\\\"", *p))
            *p = '_';
    }
    if (is_taken(job, k))
        snprintf(name, SST_EXPORT_NAME, "view_%.200s", v->file);
}

/* --- points ------------------------------------------------------------------------------------------------------- */

/* Points with their sights in placed views; sights in others are left out. */
static int points_init(struct job *job)
{
    const struct sst_posed *posed = &job->posed;
    int kept = 0;

    job->point = calloc((size_t)posed->point_count + 1, sizeof(*job->point));
    job->first = malloc((size_t)posed->point_count * sizeof(*job->first) + 1);
    job->sight = malloc((size_t)posed->sight_count * sizeof(*job->sight) + 1);
    if (!job->point || !job->first || !job->sight)
        return -ENOMEM;
    job->points = posed->point_count;
    for (int i = 0, s = 0; i < job->points; i++) {
        struct sst_export_point *p = &job->point[i];
        double sum = 0;

        *p = (struct sst_export_point){ .error_px = -1, .rgb = { 128, 128, 128 } };
        memcpy(p->at_mm, posed->points[i].at_mm, sizeof(p->at_mm));
        job->first[i] = -1;
        for (int end = s + posed->points[i].views; posed->sights && s < end; s++) {
            const struct sst_posed_sight *from = &posed->sights[s];
            const struct sst_calib_camera *cam = &posed->view[from->view].camera;
            double at[3], x, y;

            if (!cam->known)
                continue;
            for (int j = 0; j < 3; j++)
                at[j] = p->at_mm[j] - cam->position_mm[j];
            sst_numbers_apply3(cam->rotation, at, at);
            sst_camera_distort(cam, at[0] / at[2], at[1] / at[2], &x, &y);
            sum += hypot(x - (double)from->x, y - (double)from->y);
            job->first[i] = p->sights ? job->first[i] : kept;
            job->sight[kept++] = (struct sst_export_sight){ from->view, (double)from->x, (double)from->y };
            p->error_px = sum / ++p->sights;
        }
    }
    return 0;
}

/* Colours of the points that a view shows first. */
static int take_colours(const struct job *job, int view, const uint8_t *data, size_t size)
{
    struct sst_image image = { 0 };
    struct sst_deep deep = { 0 };
    int err = sst_deep_decode(&deep, data, size, job->posed.view[view].file);

    err = err ? err : sst_deep_to_image(&image, &deep, deep.white == 255              ? (struct sst_samples){ 0 }
                                                  : job->posed.samples.white ? job->posed.samples
                                                                             : sst_deep_stretch(&deep));
    for (int i = 0; !err && i < job->points; i++) {
        const struct sst_export_sight *s = &job->sight[sst_max_int(job->first[i], 0)];

        for (int c = 0; job->first[i] >= 0 && s->view == view && c < 3; c++)
            job->point[i].rgb[c] = sst_image_row(&image, c, sst_clamp_int((int)lround(s->y), 0, image.height - 1))
                [sst_clamp_int((int)lround(s->x), 0, image.width - 1)];
    }
    sst_image_fini(&image);
    sst_deep_fini(&deep);
    return err;
}

static int copy_view(void *arg, int k, int worker SST_UNUSED)
{
    const struct job *job = arg;
    const struct sst_posed_view *v = &job->posed.view[k];
    char from[SST_PATH_MAX], to[SST_PATH_MAX], name[SST_EXPORT_NAME + 16], hash[65];
    uint8_t *data;
    size_t size;
    int err;

    if (!v->camera.known)
        return 0;
    snprintf(name, sizeof(name), "images/%s", job->name[k]);
    err = sst_path_join(to, job->out, name);
    err = err ? err : posed_read_view(from, &data, &size, v, job->cfg->dir);
    if (err)
        return err;
    sst_sha256_hex(hash, data, size);
    if (v->sha256[0] && strcmp(hash, v->sha256)) {
        sst_log_error(
            "%s differs from its SHA-256 in lightfield.json: it is damaged or was changed; import the pictures again",
            from);
        err = -EBADMSG;
    }
    err = err ? err : sst_jpeg_write(to, data, size);
    if (!err && job->points)
        err = take_colours(job, k, data, size);
    free(data);
    return err;
}

/* One camera that was moved, or several. */
static bool one_lens(const struct sst_posed *posed, int reference)
{
    const struct sst_calib_camera *a = &posed->view[reference].camera;

    for (int k = 0; k < posed->count; k++) {
        const struct sst_calib_camera *b = &posed->view[k].camera;

        if (b->known &&
            (a->fx != b->fx || a->fy != b->fy || a->cx != b->cx || a->cy != b->cy || memcmp(a->k, b->k, sizeof(a->k))))
            return false;
    }
    return true;
}

static bool one_moment(const struct sst_posed *posed)
{
    for (int k = 0; k < posed->count; k++) {
        if (!posed->view[k].moment || posed->view[k].moment != posed->view[0].moment)
            return false;
    }
    return true;
}

static int write_cameras(const struct job *job, int (*write)(const struct sst_export_cameras *cameras, const char *dir))
{
    const struct sst_posed *posed = &job->posed;
    struct sst_calib calib = { .rows = 1, .cols = posed->count, .width = posed->width, .height = posed->height };
    int err;

    calib.camera = calloc((size_t)posed->count, sizeof(*calib.camera));
    if (!calib.camera)
        return -ENOMEM;
    for (int k = 0; k < posed->count; k++)
        calib.camera[k] = posed->view[k].camera;
    calib.reference = sst_posed_middle(posed);
    calib.rig = one_lens(posed, calib.reference);
    err = write(&(struct sst_export_cameras){ .calib = &calib,
                                              .name = (const char(*)[SST_EXPORT_NAME])job->name,
                                              .array = one_moment(posed),
                                              .point = job->point,
                                              .sight = job->sight,
                                              .points = job->points,
                                              .lossy = job->cfg->lossy },
                job->out);
    free(calib.camera);
    return err;
}

static int fill(struct job *job, int (*write)(const struct sst_export_cameras *cameras, const char *dir))
{
    char images[SST_PATH_MAX];
    int err = sst_path_join(images, job->out, "images");

    err = err ? err : sst_path_make_dir(images);
    if (err)
        return err;
    job->name = calloc((size_t)job->posed.count, sizeof(*job->name));
    if (!job->name)
        return -ENOMEM;
    for (int k = 0; k < job->posed.count; k++)
        set_name(job, k);
    if (write == sst_export_colmap && job->posed.point_count)
        err = points_init(job);
    err = err ? err : sst_parallel_for(job->posed.count, sst_thread_count(job->cfg->threads), copy_view, job);
    err = err ? err : write_cameras(job, write);
    free(job->name);
    free(job->point);
    free(job->first);
    free(job->sight);
    return err;
}

int sst_posed_export(const struct sst_export_config *cfg)
{
    const char *const inputs[] = { cfg->dir, NULL };
    struct job job = { .cfg = cfg };
    struct sst_outdir out;
    size_t f = 0;
    int placed, err;

    while (f < ARRAY_LEN(formats) && strcmp(formats[f].name, cfg->format))
        f++;
    if (f == ARRAY_LEN(formats)) {
        sst_log_error(
            "a light field with a pose for every view has no rows and columns, which the format %s needs; use "
            "colmap or nerfstudio",
            cfg->format);
        return -EINVAL;
    }
    if (cfg->focal_px > 0 || cfg->spacing_mm > 0 || cfg->focus_mm > 0 || cfg->infinity_px) {
        sst_log_error("%s has a lens and a pose for every view; leave out --focal-px, --spacing-mm, --focus-mm and "
                      "--infinity-px",
                      cfg->dir);
        return -EINVAL;
    }
    err = sst_path_check_output(cfg->out, cfg->force, formats[f].marker, inputs);
    err = err ? err : sst_posed_load(&job.posed, cfg->dir);
    if (err)
        return err;
    placed = sst_posed_placed(&job.posed);
    if (!placed) {
        sst_log_error("no view of %s has a pose; find poses with `sst poses` first", cfg->dir);
        err = -EBADMSG;
    } else {
        if (placed < job.posed.count)
            sst_log_warning("%s: %d views without a pose are left out", cfg->dir, job.posed.count - placed);
        err = sst_outdir_open(&out, cfg->out, cfg->force);
    }
    if (!err) {
        job.out = out.temporary;
        err = fill(&job, formats[f].write);
        if (err == -ENOMEM)
            sst_log_error("not enough memory to export %s", cfg->dir);
        err = sst_outdir_end(&out, err);
    }
    sst_posed_fini(&job.posed);
    return err;
}
