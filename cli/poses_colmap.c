/* Poses of a light field's pictures by an installed COLMAP. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/posed/import/import.h"
#include "pipeline/posed/solve/solve.h"

#define METRE_MM         1000.0
#define ENV              "/usr/bin/env"
#define OFFSCREEN        "QT_QPA_PLATFORM=offscreen" /* COLMAP opens a window system even without windows */
#define NOT_FOUND        127
#define EXHAUSTIVE_VIEWS 100 /* more are matched in the order of names */
#define MODELS           10  /* of which the largest is read */

struct colmap {
    char pictures[SST_PATH_MAX], database[SST_PATH_MAX], sparse[SST_PATH_MAX], log[SST_PATH_MAX], lf[SST_PATH_MAX];
};

static int paths(struct colmap *c, const char *dir, const char *work)
{
    int err = sst_path_join(c->pictures, dir, "views");

    err = err ? err : sst_path_join(c->database, work, "database.db");
    err = err ? err : sst_path_join(c->sparse, work, "sparse");
    err = err ? err : sst_path_join(c->log, work, "log");
    return err ? err : sst_path_join(c->lf, work, "lightfield");
}

/* Run one of COLMAP's commands. */
static int colmap(const struct colmap *c, const char *const argv[])
{
    const int code = cli_run_program(argv, NULL, c->log);

    if (!code)
        return 0;
    if (code == NOT_FOUND) {
        sst_log_error(
            "--with colmap: there is no program `colmap`; install it (apt-get install colmap), or find poses without");
        return -ENOTSUP;
    }
    if (code < 0)
        return code;
    sst_log_error("colmap %s failed with code %d", argv[3], code);
    return -EDOM;
}

static int extract_and_map(const struct colmap *c, const struct sst_posed *posed,
                           const struct sst_posed_solve_config *cfg)
{
    const bool known = cfg->focal_px > 0;
    char lens[100];
    int err;

    snprintf(lens, sizeof(lens), "%.17g,%.17g,%.17g", cfg->focal_px, posed->width / 2.0, posed->height / 2.0);
    err = colmap(c, (const char *const[]){
                        ENV, OFFSCREEN, "colmap", "feature_extractor", "--database_path", c->database, "--image_path",
                        c->pictures, "--ImageReader.single_camera", "1", "--ImageReader.camera_model",
                        cfg->free_lens ? "SIMPLE_RADIAL" : "SIMPLE_PINHOLE", "--SiftExtraction.use_gpu", "0",
                        known && !cfg->free_lens ? "--ImageReader.camera_params" : NULL, lens, NULL });
    if (!err)
        err = colmap(
            c, (const char *const[]){ ENV, OFFSCREEN, "colmap",
                                      posed->count > EXHAUSTIVE_VIEWS ? "sequential_matcher" : "exhaustive_matcher",
                                      "--database_path", c->database, "--SiftMatching.use_gpu", "0", NULL });
    if (!err)
        err = sst_path_make_dir(c->sparse);
    if (!err)
        err = colmap(c, (const char *const[]){ ENV, OFFSCREEN, "colmap", "mapper", "--database_path", c->database,
                                               "--image_path", c->pictures, "--output_path", c->sparse,
                                               "--Mapper.ba_refine_focal_length", known && !cfg->free_lens ? "0" : "1",
                                               NULL });
    return err;
}

/* The largest of the models that COLMAP leaves, as a light field. */
static int read_largest(struct sst_posed *best, const struct colmap *c)
{
    int most = 0;

    for (int k = 0; k < MODELS; k++) {
        char name[8], model[SST_PATH_MAX];
        struct sst_posed posed = { 0 };
        int err;

        snprintf(name, sizeof(name), "%d", k);
        err = sst_path_join(model, c->sparse, name);
        if (err)
            return err;
        if (!sst_path_is_dir(model))
            break;
        err = sst_posed_import(
            &(struct sst_posed_import_config){ .source = model, .pictures = c->pictures, .out = c->lf, .force = true });
        if (!err)
            err = sst_posed_load(&posed, c->lf);
        if (err)
            return err;
        if (sst_posed_placed(&posed) > most) {
            sst_posed_fini(best);
            *best = posed;
            most = sst_posed_placed(best);
        } else {
            sst_posed_fini(&posed);
        }
    }
    if (most > 1)
        return 0;
    sst_log_error("colmap places no view; its pictures may not overlap enough");
    return -EDOM;
}

/* Poses and points of the model, views by the names of files, with `unit` mm between neighbours on average. */
static void adopt(struct sst_posed *posed, struct sst_posed *model, double unit)
{
    double factor;

    for (int k = 0; k < posed->count; k++) {
        posed->view[k].camera.known = false;
        for (int m = 0; m < model->count; m++) {
            if (strcmp(posed->view[k].file, model->view[m].name) != 0)
                continue;
            posed->view[k].camera = model->view[m].camera;
        }
    }
    factor = unit / sst_posed_spacing(posed);
    for (int k = 0; k < posed->count; k++) {
        for (int i = 0; i < 3; i++)
            posed->view[k].camera.position_mm[i] *= factor;
    }
    for (int p = 0; p < model->point_count; p++) {
        for (int i = 0; i < 3; i++)
            model->points[p].at_mm[i] *= factor;
    }
    free(posed->points);
    free(posed->sights);
    posed->sights = NULL;
    posed->sight_count = 0;
    posed->points = model->points;
    posed->point_count = model->point_count;
    model->points = NULL;
    posed->median_px = model->median_px;
    posed->geographic = false;
    memset(posed->up, 0, sizeof(posed->up));
    snprintf(posed->history, sizeof(posed->history), "found %d of %d views by COLMAP", sst_posed_placed(posed),
             posed->count);
}

int cli_poses_colmap(struct sst_posed *posed, const char *dir, const struct sst_posed_solve_config *cfg)
{
    struct sst_posed model = { 0 };
    struct sst_outdir work;
    char path[SST_PATH_MAX];
    struct colmap c;
    int err = sst_path_join(path, dir, "colmap");

    err = err ? err : sst_outdir_open(&work, path, true);
    if (err)
        return err;
    err = paths(&c, dir, work.temporary);
    if (!err)
        err = extract_and_map(&c, posed, cfg);
    if (!err)
        err = read_largest(&model, &c);
    if (!err) {
        adopt(posed, &model, cfg->spacing_mm > 0 ? cfg->spacing_mm : METRE_MM);
        posed->metric = cfg->spacing_mm > 0;
    }
    sst_posed_fini(&model);
    sst_outdir_abort(&work);
    return err;
}
