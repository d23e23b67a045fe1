/* Light-field folder of a scene, with its truth. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/file.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/method/process/process.h"
#include "simulators/scene/scene_internal.h"

#define FILE_NAME_MAX 64

struct job {
    const struct sst_scene *scene;
    const struct sst_lightfield *lf;
    const char *dir;
    int views, count; /* jobs below `views` are views, the others occluders */
    _Atomic int done;
};

/* dir/folder/name */
static int path_of(char out[SST_PATH_MAX], const char *dir, const char *folder, const char *name)
{
    char sub[SST_PATH_MAX];
    const int err = sst_path_join(sub, dir, folder);

    return err ? err : sst_path_join(out, sub, name);
}

static int make_folder(const char *dir, const char *folder)
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, dir, folder);

    if (!err && mkdir(path, 0777)) {
        err = -errno;
        sst_log_error("cannot create %s: error %d; check the disk and its permissions", path, -err);
    }
    return err;
}

static int write_view(const struct job *j, int view)
{
    const struct sst_scene_config *c = &j->scene->cfg;
    const struct sst_view *v = &j->lf->views[view];
    char name[16], file[FILE_NAME_MAX], path[SST_PATH_MAX];
    struct sst_image image = { 0 };
    struct sst_map_f32 disp = { 0 };
    struct sst_map_u8 label = { 0 };
    const int quality = j->scene->photo ? j->scene->photo->jpeg : 0;
    int err;

    sst_view_name(j->lf, view, name);
    if ((err = sst_image_init(&image, c->width, c->height)) || (err = sst_map_f32_init(&disp, c->width, c->height)) ||
        (err = sst_map_u8_init(&label, c->width, c->height)) ||
        (err = sst_scene_render(j->scene, v->bx, v->by, 0,
                                &(struct sst_scene_maps){ .image = &image, .disp = &disp, .label = &label })))
        goto done;
    if (j->scene->photo)
        photo_expose(j->scene->photo, &image, view, view == j->lf->ref_view);
    if ((err = path_of(path, j->dir, "views", j->lf->files->view[view].name)) ||
        (err = quality ? sst_image_write_jpeg(&image, path, quality) : sst_image_write_png(&image, path)))
        goto done;
    snprintf(file, sizeof(file), "%s.pfm", name);
    if ((err = path_of(path, j->dir, "truth", file)) || (err = sst_map_f32_write_pfm(&disp, path)))
        goto done;
    snprintf(file, sizeof(file), "%s.png", name);
    if ((err = path_of(path, j->dir, "truth", file)) ||
        (err = sst_map_u8_write_png(&label, path, sst_classes_palette())))
        goto done;

done:
    sst_map_u8_fini(&label);
    sst_map_f32_fini(&disp);
    sst_image_fini(&image);
    return err;
}

/* Write the pair behind<suffix>.png and occluder<suffix>.png. */
static int write_pair(const struct job *j, const char *suffix, const struct sst_image *behind,
                      const struct sst_map_u8 *mask)
{
    char file[FILE_NAME_MAX], path[SST_PATH_MAX];
    int err;

    snprintf(file, sizeof(file), "behind%s.png", suffix);
    if ((err = path_of(path, j->dir, "truth", file)) || (err = sst_image_write_png(behind, path)))
        return err;
    snprintf(file, sizeof(file), "occluder%s.png", suffix);
    if ((err = path_of(path, j->dir, "truth", file)))
        return err;
    return sst_map_u8_write_png(mask, path, NULL);
}

static int write_occluder(const struct job *j, int index)
{
    const struct sst_scene_config *c = &j->scene->cfg;
    char suffix[FILE_NAME_MAX / 2 + 2];
    struct sst_image behind = { 0 };
    struct sst_map_u8 mask = { 0 };
    int err;

    if ((err = sst_image_init(&behind, c->width, c->height)) || (err = sst_map_u8_init(&mask, c->width, c->height)) ||
        (err = sst_scene_render(j->scene, 0, 0, 1u << index, &(struct sst_scene_maps){ .image = &behind })) ||
        (err = scene_mask(j->scene, index, &mask)))
        goto done;
    snprintf(suffix, sizeof(suffix), "_%s", sst_scene_occluder_at(j->scene, index)->name);
    err = write_pair(j, suffix, &behind, &mask);
    if (!err && index == 0)
        err = write_pair(j, "", &behind, &mask);

done:
    sst_map_u8_fini(&mask);
    sst_image_fini(&behind);
    return err;
}

static int run_job(void *arg, int index, int worker)
{
    struct job *j = arg;
    const struct sst_scene_config *c = &j->scene->cfg;
    const int err = index < j->views ? write_view(j, index) : write_occluder(j, index - j->views);
    const int done = ++j->done;

    if (worker == 0 && c->progress) /* one thread reports progress for all */
        c->progress(c->progress_arg, (double)done / j->count);
    return err;
}

static int write_truth_json(const struct job *j, const char *name)
{
    const struct sst_scene *s = j->scene;
    json_t *list = json_array(), *root;
    char reference[16], seed[24], path[SST_PATH_MAX];
    char *text = NULL;
    int err;

    for (int i = 0; i < s->world.occluder_count; i++) {
        const struct sst_scene_occluder *o = &s->world.occluders[i];
        char behind[FILE_NAME_MAX], mask[FILE_NAME_MAX];

        snprintf(behind, sizeof(behind), "behind_%s.png", o->name);
        snprintf(mask, sizeof(mask), "occluder_%s.png", o->name);
        json_array_append_new(list, json_pack("{s:s, s:s, s:s, s:f, s:s, s:s}", "name", o->name, "label",
                                              sst_classes_name(&sst_classes_default, o->label), "target",
                                              sst_classes_name(&sst_classes_default, o->target_label), "focus_px",
                                              o->focus_px, "behind", behind, "mask", mask));
    }
    sst_view_name(j->lf, j->lf->ref_view, reference);
    snprintf(seed, sizeof(seed), "%llu", (unsigned long long)s->cfg.seed);
    /* The seed is a string: JSON numbers keep only 53 bits in most parsers. */
    root = json_pack("{s:s, s:s, s:s, s:f, s:[f, f], s:o}", "scene", name, "seed", seed, "reference", reference,
                     "focus_px", s->world.occluders[0].focus_px, "range_px", s->range_min_px, s->range_max_px,
                     "occluders", list);
    if (root && s->photo)
        json_object_set_new(root, "layers",
                            json_pack("{s:s, s:f, s:f, s:f, s:i, s:f}", "kind", s->photo->kind, "cover_percent",
                                      s->photo->cover_percent, "noise", s->photo->noise, "gain_percent",
                                      s->photo->gain_percent, "jpeg", s->photo->jpeg, "edge_px", s->photo->edge_px));
    if (root)
        text = json_dumps(root, JSON_INDENT(2));
    err = text ? path_of(path, j->dir, "truth", "truth.json") : -ENOMEM;
    err = err ? err : sst_file_write(path, text, strlen(text));
    free(text);
    json_decref(root);
    return err;
}

static int describe(struct sst_lightfield *lf, const struct sst_scene *s, const char *name)
{
    const int err = sst_lightfield_init_files(lf, s->cfg.rows, s->cfg.cols);

    if (err)
        return err;
    lf->width = s->cfg.width;
    lf->height = s->cfg.height;
    lf->range_min_px = s->range_min_px;
    lf->range_max_px = s->range_max_px;
    lf->focal_px = sst_scene_focal_px(s);
    lf->spacing_mm = s->world.spacing_mm;
    lf->infinity_known = true;
    lf->classes = sst_classes_default;
    snprintf(lf->files->source, sizeof(lf->files->source), "scene %s seed %llu", name, (unsigned long long)s->cfg.seed);
    for (int view = 0; view < lf->rows * lf->cols; view++) {
        char file[16];

        sst_view_name(lf, view, file);
        lf->views[view].present = true;
        snprintf(lf->files->view[view].name, sizeof(lf->files->view[view].name), "%s.%s", file,
                 s->photo && s->photo->jpeg ? "jpg" : "png");
    }
    return 0;
}

int sst_scene_write(const char *name, const struct sst_scene_config *cfg, const char *out, bool force)
{
    const int threads = sst_thread_count(cfg->threads);
    struct sst_scene *scene = NULL;
    struct sst_lightfield lf = { 0 };
    struct sst_outdir dir = { 0 };
    struct job j = { .lf = &lf };
    int err = sst_scene_create(&scene, name, cfg);

    if (err)
        return err;
    j.scene = scene;
    j.views = cfg->rows * cfg->cols;
    j.count = j.views + sst_scene_occluder_count(scene);
    if ((err = describe(&lf, scene, name)) || (err = sst_process_check_range(lf.range_min_px, lf.range_max_px)) ||
        (err = sst_path_check_output(out, force, "lightfield.json", (const char *const[]){ NULL })) ||
        (err = sst_outdir_open(&dir, out, force)))
        goto done;
    j.dir = dir.temporary;
    if ((err = make_folder(dir.temporary, "views")) || (err = make_folder(dir.temporary, "truth")) ||
        (err = sst_parallel_for(j.count, threads, run_job, &j)) || (err = write_truth_json(&j, name)) ||
        (err = sst_lightfield_write(&lf, dir.temporary, threads)))
        goto done;
    err = sst_outdir_commit(&dir);

done:
    if (err)
        sst_outdir_abort(&dir);
    sst_lightfield_fini(&lf);
    sst_scene_destroy(scene);
    return err;
}
