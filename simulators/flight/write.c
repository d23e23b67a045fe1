/* Posed light fields of simulated arrays and flights, with their truth. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "simulators/flight/flight_internal.h"

#define MOMENT_S 0.5 /* between moments of the array */
#define DRIFT_M  0.8 /* that the drone flies on in it */
#define REACH_M  9.0 /* of trees beyond the cameras' pictures */

/* Kinds of flights. */
static const struct kind {
    const char *name;
    int width, height, rows, cols;
    bool thermal;
    double focal_px, high_m, step_m,
        line_m;                 /* cameras or pictures step_m apart along x, rows or lines line_m along y */
    double tilt_deg, shake_deg; /* outermost cameras look inwards by tilt_deg; every one is turned a little */
    double trees, slope[2];
} kinds[] = {
    { "forest", 1024, 1024, 1, 10, false, 2180, 40, 1.0, 1.0, 9, 1.5, 9, { 0.02, -0.03 } },
    { "flight", 640, 512, 1, 30, true, 529, 35, 1.05, 8.0, 0, 0.4, 8.0, { 0.04, 0.06 } },
};

struct job {
    const struct kind *kind;
    const struct sst_flight_config *cfg;
    const char *dir;
    struct flight_world world;
    struct flight_mesh *walkers;      /* [moments] */
    int64_t (*shown)[FLIGHT_WALKERS]; /* [views]: samples of each walker that a view shows ... */
    int64_t (*whole)[FLIGHT_WALKERS]; /* ... and that it would without trees */
    struct sst_posed posed;           /* true poses */
    int per_moment;
    _Atomic int done;
};

void sst_flight_config_defaults(struct sst_flight_config *cfg)
{
    *cfg = (struct sst_flight_config){ .seed = 1, .moments = 1, .cover = -1 };
}

const char *const *sst_flight_names(void)
{
    static const char *names[ARRAY_LEN(kinds) + 1];

    for (size_t i = 0; i < ARRAY_LEN(kinds); i++)
        names[i] = kinds[i].name;
    return names;
}

/* --- cameras ------------------------------------------------------------------------------------------------------ */

static double normal(uint64_t *random)
{
    const double r = sqrt(-2 * log(1 - sst_random(random)));

    return r * cos(2 * M_PI * sst_random(random));
}

static void multiply(double out[9], const double a[9], const double b[9])
{
    for (int i = 0; i < 9; i++)
        out[i] = a[i / 3 * 3] * b[i % 3] + a[i / 3 * 3 + 1] * b[3 + i % 3] + a[i / 3 * 3 + 2] * b[6 + i % 3];
}

/* Turn a camera about its own axes, degrees. */
static void turn(double rotation[9], double x, double y, double z)
{
    const double v[3] = { x * M_PI / 180, y * M_PI / 180, z * M_PI / 180 };
    double by[9], out[9];

    sst_rotation_from_vector(v, by);
    multiply(out, by, rotation);
    memcpy(rotation, out, sizeof(out));
}

static void place_camera(struct job *j, int k, uint64_t *random)
{
    const struct kind *kind = j->kind;
    struct sst_posed_view *v = &j->posed.view[k];
    struct sst_calib_camera *cam = &v->camera;
    const int place = k % j->per_moment, cols = j->cfg->cols, rows = j->cfg->rows;
    const double along = place % cols - (cols - 1) / 2.0, across = place / cols - (rows - 1) / 2.0;
    const double inwards = cols > 1 ? kind->tilt_deg * along / ((cols - 1) / 2.0) : 0;
    const double down[9] = { 1, 0, 0, 0, -1, 0, 0, 0, -1 };
    /* A rod that bends; the wind on a drone. */
    const double high = kind->high_m + 0.2 * normal(random) - 0.01 * along * along * !kind->thermal;

    *cam = (struct sst_calib_camera){ .known = true, .fx = kind->focal_px * j->cfg->width / kind->width };
    const int moment = k / j->per_moment;

    v->moment = kind->thermal ? 0 : moment + 1;
    v->time_s = kind->thermal ? place * 0.3 : moment * MOMENT_S;
    cam->fy = cam->fx;
    cam->cx = (j->cfg->width - 1) / 2.0;
    cam->cy = (j->cfg->height - 1) / 2.0;
    memcpy(cam->rotation, down, sizeof(down));
    turn(cam->rotation, kind->shake_deg * normal(random), inwards + kind->shake_deg * normal(random),
         kind->shake_deg * normal(random));
    cam->position_mm[0] = 1000 * (along * kind->step_m + 0.03 * normal(random));
    cam->position_mm[1] = 1000 * (across * kind->line_m + moment * DRIFT_M + 0.03 * normal(random));
    cam->position_mm[2] = 1000 * high;
    snprintf(v->name, sizeof(v->name), kind->thermal ? "thermal %04d.png" : "C%d.png", k);
    snprintf(v->file, sizeof(v->file), "%04d.png", k);
    for (int i = 0; i < 3; i++)
        cam->gain[i] = 1;
}

/* All moments of the array have one rig, which flies on. */
static int place_cameras(struct job *j)
{
    const struct kind *kind = j->kind;
    const int moments = kind->thermal ? 1 : j->cfg->moments;
    uint64_t random = j->cfg->seed ^ 0x63616D73u;
    int err;

    j->per_moment = j->cfg->rows * j->cfg->cols;
    err = sst_posed_init(&j->posed, j->per_moment * moments);
    if (err)
        return err;
    j->posed.width = j->cfg->width;
    j->posed.height = j->cfg->height;
    j->posed.channels = kind->thermal ? 1 : 3;
    j->posed.bits = kind->thermal ? 16 : 8;
    j->posed.metric = true;
    j->posed.up[2] = 1;
    j->posed.median_px = NAN;
    if (kind->thermal) {
        j->posed.geographic = true;
        j->posed.latitude = 48.3;
        j->posed.longitude = 14.3;
        j->posed.altitude_m = 400;
        j->posed.kelvin_scale = FLIGHT_KELVIN_SCALE;
    }
    for (int k = 0; k < j->posed.count; k++) {
        place_camera(j, k, &random);
        if (k >= j->per_moment) {
            const struct sst_calib_camera *first = &j->posed.view[k % j->per_moment].camera;
            struct sst_calib_camera *cam = &j->posed.view[k].camera;

            *cam = *first;
            cam->position_mm[1] += 1000 * DRIFT_M * (k / j->per_moment);
        }
    }
    snprintf(j->posed.source, sizeof(j->posed.source), "simulated %s seed %llu", kind->name,
             (unsigned long long)j->cfg->seed);
    return 0;
}

/* Poses as a compass and a receiver give them. */
static void disturb(struct sst_posed *posed, const struct sst_flight_config *cfg)
{
    uint64_t random = cfg->seed ^ 0x636F6D70u;

    for (int k = 0; k < posed->count; k++) {
        struct sst_calib_camera *cam = &posed->view[k].camera;
        /* The world turned about the vertical, then the camera about its own axes. */
        const double a = cfg->turn_deg * M_PI / 180;
        const double yaw[9] = { cos(a), -sin(a), 0, sin(a), cos(a), 0, 0, 0, 1 };
        double out[9];

        multiply(out, cam->rotation, yaw);
        memcpy(cam->rotation, out, sizeof(out));
        turn(cam->rotation, cfg->shake_deg * normal(&random), cfg->shake_deg * normal(&random),
             cfg->shake_deg * normal(&random));
        for (int i = 0; i < 3; i++)
            cam->position_mm[i] += cfg->drift_mm * normal(&random);
        cam->known = !cfg->unplaced;
    }
}

/* --- world -------------------------------------------------------------------------------------------------------- */

static int make_world(struct job *j)
{
    const struct kind *kind = j->kind;
    const struct sst_flight_config *cfg = j->cfg;
    struct flight_world *w = &j->world;
    const double focal = kind->focal_px * cfg->width / kind->width;
    /* The pictures' half sizes on flat ground. */
    const double half_x = kind->high_m * cfg->width / focal / 2 + kind->step_m * (cfg->cols - 1) / 2.0;
    const double half_y = kind->high_m * cfg->height / focal / 2 + kind->line_m * (cfg->rows - 1) / 2.0;
    const int moments = j->posed.count / j->per_moment;
    const double reach = REACH_M + kind->high_m * sin(M_PI / 180 * (kind->tilt_deg + 3 * kind->shake_deg)),
                 flown = DRIFT_M * (moments - 1);
    int err;

    *w = (struct flight_world){ .seed = cfg->seed,
                                .thermal = kind->thermal,
                                .slope = { kind->slope[0], kind->slope[1] },
                                .extent = { -half_x - reach, -half_y - reach, half_x + reach, half_y + reach + flown },
                                .trees = cfg->cover >= 0 ? cfg->cover : kind->trees };
    flight_place_walkers(w, half_x * 0.45, half_y * 0.6);
    err = flight_world_init(w);
    j->walkers = calloc((size_t)moments, sizeof(*j->walkers));
    if (!err && !j->walkers)
        err = -ENOMEM;
    for (int m = 0; m < moments && !err; m++)
        err = flight_walkers_mesh(&j->walkers[m], w, m * MOMENT_S);
    return err;
}

/* --- files -------------------------------------------------------------------------------------------------------- */

static int save_picture(const struct sst_deep *deep, const char *path)
{
    struct sst_image image = { 0 };
    int err;

    if (deep->white != 255)
        return sst_deep_write(deep, path);
    err = sst_deep_to_image(&image, deep, (struct sst_samples){ 0 });
    err = err ? err : sst_image_write_png(&image, path);
    sst_image_fini(&image);
    return err;
}

static struct flight_picture picture_of(const struct job *j, int k, bool hide_trees)
{
    return (struct flight_picture){ .world = &j->world,
                                    .walkers = &j->walkers[k / j->per_moment],
                                    .camera = &j->posed.view[k].camera,
                                    .hide_trees = hide_trees,
                                    .noise_seed = (uint32_t)(hide_trees ? 0 : j->cfg->seed * 1000 + (uint64_t)k + 1) };
}

static int write_view(void *arg, int k, int worker SST_UNUSED)
{
    struct job *j = arg;
    const struct flight_picture p = picture_of(j, k, false), open = picture_of(j, k, true);
    char path[SST_PATH_MAX], name[300];
    struct sst_deep deep = { 0 };
    int err =
        sst_deep_init(&deep, j->posed.width, j->posed.height, j->posed.channels, j->posed.bits == 16 ? 65535 : 255);

    snprintf(name, sizeof(name), "views/%s", j->posed.view[k].file);
    err = err ? err : sst_path_join(path, j->dir, name);
    err = err ? err : flight_draw(&p, &deep, NULL);
    err = err ? err : save_picture(&deep, path);
    err = err ? err : flight_show(&p, deep.width, deep.height, j->shown[k]);
    err = err ? err : flight_show(&open, deep.width, deep.height, j->whole[k]);
    sst_deep_fini(&deep);
    if (j->cfg->progress)
        j->cfg->progress(j->cfg->progress_arg, (double)++j->done / (j->posed.count + 1));
    return err;
}

/* The middle view without trees, its depths, and depths of the ground. */
static int write_behind(struct job *j)
{
    const int k = sst_posed_middle(&j->posed);
    char path[SST_PATH_MAX];
    struct sst_deep deep = { 0 };
    struct sst_map_f32 depth = { 0 };
    int err =
        sst_deep_init(&deep, j->posed.width, j->posed.height, j->posed.channels, j->posed.bits == 16 ? 65535 : 255);

    err = err ? err : sst_map_f32_init(&depth, j->posed.width, j->posed.height);
    for (int trees = 0; trees < 2 && !err; trees++) {
        const struct flight_picture p = picture_of(j, k, !trees);

        err = flight_draw(&p, &deep, &depth);
        err = err ? err : sst_path_join(path, j->dir, trees ? "truth/depth.pfm" : "truth/floor.pfm");
        err = err ? err : sst_map_f32_write_pfm(&depth, path);
        if (!trees) {
            err = err ? err : sst_path_join(path, j->dir, "truth/behind.png");
            err = err ? err : save_picture(&deep, path);
        }
    }
    sst_deep_fini(&deep);
    sst_map_f32_fini(&depth);
    return err;
}

static int write_ground(const struct job *j)
{
    const struct flight_mesh *m = &j->world.mesh;
    struct sst_outfile file = { 0 };
    const int err = sst_outfile_open_in(&file, j->dir, "truth/ground.obj");

    if (err)
        return err;
    fputs("# ground of a simulated flight: metres, z up\n", file.stream);
    for (size_t i = 0; i < j->world.ground_vertices; i++)
        fprintf(file.stream, "v %.4f %.4f %.4f\n", m->vertex[i].x, m->vertex[i].y, m->vertex[i].z);
    for (size_t i = 0; i < j->world.ground_triangles; i++)
        fprintf(file.stream, "f %d %d %d\n", m->triangle[i].corner[0] + 1, m->triangle[i].corner[1] + 1,
                m->triangle[i].corner[2] + 1);
    return sst_outfile_commit(&file);
}

static json_t *numbers(const double *v, int count)
{
    json_t *list = json_array();

    for (int i = 0; i < count; i++)
        json_array_append_new(list, json_real(v[i]));
    return list;
}

/* Views that show at least a third of the walker's samples without trees. */
static int shown_by(const struct job *j, int moment, int walker)
{
    int views = 0;

    for (int k = moment * j->per_moment; k < (moment + 1) * j->per_moment; k++)
        views += j->whole[k][walker] > 0 && 3 * j->shown[k][walker] >= j->whole[k][walker];
    return views;
}

static json_t *truth_json(const struct job *j)
{
    json_t *cameras = json_array(), *walkers = json_array();

    for (int k = 0; k < j->posed.count; k++) {
        const struct sst_calib_camera *cam = &j->posed.view[k].camera;
        const double at[3] = { cam->position_mm[0] / 1000, cam->position_mm[1] / 1000, cam->position_mm[2] / 1000 };

        json_array_append_new(cameras, json_pack("{s:s, s:f, s:f, s:f, s:o, s:o}", "name", j->posed.view[k].name, "f",
                                                 cam->fx, "cx", cam->cx, "cy", cam->cy, "rotation",
                                                 numbers(cam->rotation, 9), "position_m", numbers(at, 3)));
    }
    for (int m = 0; m < j->posed.count / j->per_moment; m++) {
        for (int i = 0; i < j->world.walkers; i++) {
            const struct sst_vec3 at = flight_walker_at(&j->world, i, m * MOMENT_S);
            const double place[3] = { at.x, at.y, at.z };

            json_array_append_new(walkers, json_pack("{s:i, s:i, s:o, s:b, s:i}", "walker", i, "moment", m,
                                                     "position_m", numbers(place, 3), "lies", j->world.walker[i].lies,
                                                     "views", shown_by(j, m, i)));
        }
    }
    return json_pack("{s:s, s:o, s:o}", "middle", j->posed.view[sst_posed_middle(&j->posed)].name, "cameras", cameras,
                     "walkers", walkers);
}

static int write_truth(struct job *j)
{
    char path[SST_PATH_MAX];
    json_t *json = truth_json(j);
    char *text = json ? json_dumps(json, JSON_INDENT(1)) : NULL;
    int err = text ? sst_path_join(path, j->dir, "truth/truth.json") : -ENOMEM;

    err = err ? err : sst_file_write(path, text, strlen(text));
    free(text);
    json_decref(json);
    err = err ? err : write_ground(j);
    return err ? err : write_behind(j);
}

static int make_folders(const char *dir)
{
    static const char *const folders[] = { "views", "truth" };
    char path[SST_PATH_MAX];
    int err = 0;

    for (size_t i = 0; i < ARRAY_LEN(folders) && !err; i++) {
        err = sst_path_join(path, dir, folders[i]);
        err = err ? err : sst_path_make_dir(path);
    }
    return err;
}

static int write_all(struct job *j)
{
    int err = make_folders(j->dir);

    j->shown = calloc((size_t)j->posed.count, sizeof(*j->shown));
    j->whole = calloc((size_t)j->posed.count, sizeof(*j->whole));
    if (!err && (!j->shown || !j->whole))
        err = -ENOMEM;
    err = err ? err : make_world(j);
    err = err ? err : sst_parallel_for(j->posed.count, sst_thread_count(j->cfg->threads), write_view, j);
    err = err ? err : write_truth(j);
    if (!err) { /* after the truth: poses as they are written */
        disturb(&j->posed, j->cfg);
        err = sst_posed_write(&j->posed, j->dir);
    }
    for (int m = 0; j->walkers && m < j->posed.count / j->per_moment; m++)
        flight_mesh_fini(&j->walkers[m]);
    free(j->walkers);
    free(j->shown);
    free(j->whole);
    flight_world_fini(&j->world);
    return err;
}

static int choose(struct sst_flight_config *cfg, const struct kind *kind)
{
    cfg->width = cfg->width ? cfg->width : kind->width;
    cfg->height = cfg->height ? cfg->height : kind->height;
    cfg->rows = cfg->rows ? cfg->rows : kind->rows;
    cfg->cols = cfg->cols ? cfg->cols : kind->cols;
    cfg->moments = sst_max_int(cfg->moments, 1);
    if (cfg->width < 16 || cfg->height < 16 || cfg->width > 8192 || cfg->height > 8192 ||
        (int64_t)cfg->rows * cfg->cols * cfg->moments > SST_POSED_MAX_VIEWS) {
        sst_log_error("a flight has pictures of 16x16 to 8192x8192 and at most %d of them", SST_POSED_MAX_VIEWS);
        return -EINVAL;
    }
    return 0;
}

int sst_flight_write(const char *name, const struct sst_flight_config *cfg, const char *out, bool force)
{
    struct sst_flight_config chosen = *cfg;
    struct job j = { .cfg = &chosen };
    struct sst_outdir dir = { 0 };
    int err;

    for (size_t i = 0; i < ARRAY_LEN(kinds); i++) {
        if (!strcmp(kinds[i].name, name))
            j.kind = &kinds[i];
    }
    if (!j.kind) {
        sst_log_error("no flight named %s; there are forest and flight", name);
        return -EINVAL;
    }
    err = choose(&chosen, j.kind);
    err = err ? err : sst_path_check_output(out, force, "lightfield.json", (const char *const[]){ NULL });
    err = err ? err : place_cameras(&j);
    err = err ? err : sst_outdir_open(&dir, out, force);
    if (!err) {
        j.dir = dir.temporary;
        err = write_all(&j);
        if (err)
            sst_outdir_abort(&dir);
        else
            err = sst_outdir_commit(&dir);
    }
    sst_posed_fini(&j.posed);
    return err;
}
