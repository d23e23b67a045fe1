/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/world/world_internal.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "simulators/flight/flight.h"

#define TURN      6.283185307179586
#define BAND_ROWS 16 /* rows with the same exposure time of a rolling shutter */

/* The hedge of all cameras, made for the first one: most of its time is the figure. */
struct sharing {
    pthread_mutex_t lock;
    struct sst_hedge *hedge; /* NULL: not made yet */
};

struct sim_stage {
    const struct sst_sim_settings *settings;
    struct sim_optics optics;
    struct sim_camera camera[SST_CAMERAS_MAX];
    struct sim_camera moved[SST_CAMERAS_MAX]; /* moving cameras after their move */
    struct sst_sim_board board;               /* with its poses */
    struct sst_scene_world first;             /* at the start of the loop */
    bool *moving;                             /* [surfaces] */
    int frames, steps;
    bool hedge, forest;
    struct sharing *sharing; /* of a hedge */
    bool empty;                 /* the scene is "board": boards are drawn over it */
    int fine;                   /* rendered pixels per pixel along each side: board edges need more than four samples */
    struct sst_scene_warp warp; /* of the rig's camera */
    struct sim_photo *photo;
};

/* --- the surfaces at a time --------------------------------------------------------------------------------------- */

/* The empty room, with the optics of another scene where the settings name one. */
static int build_room(const struct sim_stage *s, const struct sst_scene_config *cfg, struct sst_scene_world *w)
{
    const char *scene = s->settings->optics_scene;
    *w = (struct sst_scene_world){ .rng = cfg->seed,
                                   .focal = SST_SIM_BOARD_FOCAL,
                                   .spacing_mm = SST_SIM_BOARD_SPACING_MM };
    if (*scene && strcmp(scene, "board")) {
        struct sst_scene_world other;
        const int err = sst_scene_world_build(&other, scene, cfg);

        if (err)
            return err;
        w->focal = other.focal;
        w->spacing_mm = other.spacing_mm;
        w->shift = other.shift;
        sst_scene_world_fini(&other);
    }
    sim_board_room(w);
    return 0;
}

static int build(const struct sim_stage *s, int frame, double late_s, struct sst_scene_world *w)
{
    const struct sst_sim_settings *c = s->settings;
    struct sst_scene_config cfg;
    int err = 0;

    if (s->hedge) {
        *w = (struct sst_scene_world){ .focal = SST_HEDGE_FOCAL, .spacing_mm = SST_HEDGE_SPACING };
        return 0;
    }
    if (s->forest) {
        *w = (struct sst_scene_world){ .focal = SST_FOREST_FOCAL, .spacing_mm = SST_FOREST_SPACING };
        return 0;
    }
    sst_scene_config_defaults(&cfg);
    cfg.width = c->width;
    cfg.height = c->height;
    cfg.rows = c->rows;
    cfg.cols = c->cols;
    cfg.seed = c->seed;
    cfg.time_s = frame / c->rate_hz + late_s;
    err = s->empty ? build_room(s, &cfg, w) : sst_scene_world_build(w, c->scene, &cfg);
    if (!err && !s->empty && s->board.kind && s->board.poses)
        sim_board_add(w, &s->board, frame % s->board.poses);
    if (!err && w->failed) {
        sst_scene_world_fini(w);
        err = -ENOMEM;
    }
    return err;
}

/* Delay of the exposure of these rows after the first row. */
static double late_s(const struct sst_sim_settings *c, int row)
{
    return c->rolling ? row * c->line_us / 1e6 : 0;
}

/* Frames of a pass, and of the wind without anybody, which fills the rest of the loop again and again. */
static int pass_frames(const struct sim_stage *s)
{
    return (int)lround(SST_HEDGE_PASS_S * s->settings->rate_hz);
}

static int wind_frames(const struct sim_stage *s)
{
    return (int)lround(SST_HEDGE_PERIOD_S * s->settings->rate_hz);
}

/* Find moving surfaces; a loop without any change is one frame long. */
static int find_motion(struct sim_stage *s)
{
    const struct sst_sim_settings *c = s->settings;
    bool still = !(c->light_percent > 0) && !(c->full_well_e > 0) && !(s->empty && s->board.kind && s->board.poses > 1);

    s->moving = calloc((size_t)s->first.count + 1, sizeof(*s->moving));
    if (!s->moving)
        return -ENOMEM;
    if (s->hedge) {
        s->frames = pass_frames(s) + wind_frames(s);
        return 0;
    }
    if (s->forest) { /* walkers go there and back */
        s->frames = s->steps / 2 + 1;
        return 0;
    }
    for (int i = 0; i < 2 * s->frames; i++) {
        struct sst_scene_world w;
        const int err = build(s, i / 2, i & 1 ? late_s(c, c->height) : 0, &w);

        if (err)
            return err;
        sst_scene_world_compare(&s->first, &w, s->moving);
        sst_scene_world_fini(&w);
    }
    for (int i = 0; i < s->first.count; i++)
        still = still && !s->moving[i];
    for (int cam = 0; cam < SST_CAMERAS_MAX; cam++)
        still = still && !c->camera[cam].moves_at;
    if (still)
        s->frames = s->steps = 1;
    return 0;
}

/* --- mapping of a camera's pixels --------------------------------------------------------------------------------- */

static bool is_ideal(const struct sim_stage *s, const struct sim_camera *c)
{
    static const double none[5], straight[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };
    const struct sim_optics *o = &s->optics;

    for (int i = 0; i < 9; i++) {
        if (c->rotation[i] != straight[i] || (i < 5 && c->distortion[i] != none[i]))
            return false;
    }
    return c->fx == o->focal_px && c->fy == o->focal_px && c->cx == o->cx && c->cy == o->cy;
}

/* Position in the ideal picture of the camera's pixel (x, y). @return false: beyond the fold of the lens */
static bool ideal_position(const struct sim_optics *o, const struct sim_camera *c, double x, double y, double out[2])
{
    const double *r = c->rotation;
    double a, b, ray[3];

    if (!sim_camera_undistort(c, (x - c->cx) / c->fx, (y - c->cy) / c->fy, &a, &b))
        return false;
    for (int i = 0; i < 3; i++)
        ray[i] = r[i] * a + r[3 + i] * b + r[6 + i];
    if (!(ray[2] > 0))
        return false;
    out[0] = o->focal_px * ray[0] / ray[2] + o->cx;
    out[1] = o->focal_px * ray[1] / ray[2] + o->cy;
    return true;
}

/* Checks a lattice over the picture: if no lattice pixel folds, none between does. */
static int check_lens(const struct sim_stage *s, const struct sim_camera *camera, int cam)
{
    const int steps = 16;

    for (int i = 0; i <= steps; i++) {
        for (int j = 0; j <= steps; j++) {
            double at[2];

            if (ideal_position(&s->optics, camera, (s->settings->width - 1) * (double)i / steps,
                               (s->settings->height - 1) * (double)j / steps, at))
                continue;
            sst_log_error("the distortion or rotation of camera %d folds its picture over; choose smaller values", cam);
            return -EINVAL;
        }
    }
    return 0;
}

/* @return 0 (warp left alone for an ideal camera), -ENOMEM, -EINVAL */
static int make_warp(const struct sim_stage *s, const struct sim_camera *camera, struct sst_scene_warp *warp)
{
    const int fine = s->fine, width = s->settings->width * fine, height = s->settings->height * fine;
    int err = is_ideal(s, camera) ? 0 : sst_scene_warp_init(warp, width, height);

    for (int y = 0; warp->x && y < height; y++) {
        for (int x = 0; x < width; x++) {
            const size_t i = (size_t)y * (size_t)width + (size_t)x;
            double at[2];

            if (!ideal_position(&s->optics, camera, (x + 0.5) / fine - 0.5, (y + 0.5) / fine - 0.5, at))
                return -EINVAL;
            warp->x[i] = (float)((at[0] + 0.5) * fine - 0.5);
            warp->y[i] = (float)((at[1] + 0.5) * fine - 0.5);
        }
    }
    if (warp->x)
        sst_scene_warp_index(warp);
    return err;
}

/* Frames first .. last-1 of a camera. */
struct shooting {
    int cam;
    const struct sim_camera *camera;
    const struct sst_scene_warp *warp;
    double eye_mm[3];
    int first, last, threads;
    sim_picture_fn *fn;
    void *arg;
};

static void aim(const struct sim_stage *s, const struct shooting *t, struct sst_image *image,
                struct sst_scene_raster *out)
{
    const struct sim_optics *o = &s->optics;

    *out = (struct sst_scene_raster){
        .world = &s->first,
        .focal_px = o->focal_px * s->fine,
        .cx = (o->cx + 0.5) * s->fine - 0.5,
        .cy = (o->cy + 0.5) * s->fine - 0.5,
        .width = image->width,
        .height = image->height,
        .step_x = 1,
        .step_y = 1,
        .bx = t->eye_mm[0] / o->spacing_mm,
        .by = t->eye_mm[1] / o->spacing_mm,
        .eye_z_mm = t->eye_mm[2],
        .warp = t->warp->x ? t->warp : NULL,
        .image = image,
    };
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static void find_optics(struct sim_stage *s)
{
    const struct sst_sim_settings *c = s->settings;

    s->optics = (struct sim_optics){
        .focal_px = s->first.focal * c->width / 1000,
        .cx = (c->width - 1) / 2.0,
        .cy = (c->height - 1) / 2.0 + s->first.shift * c->width / 1000,
        .spacing_mm = s->first.spacing_mm,
    };
}

int sim_stage_open(struct sim_stage **out, const struct sst_sim_settings *settings)
{
    struct sim_stage *s = calloc(1, sizeof(*s));
    const int cams = settings->rig ? 1 : settings->rows * settings->cols;
    int err = -ENOMEM;

    if (!s)
        return err;
    s->settings = settings;
    s->empty = !strcmp(settings->scene, "board");
    s->fine = settings->board.kind && !s->empty ? 2 : 1;
    s->hedge = !strcmp(settings->scene, SIM_HEDGE);
    s->forest = !strcmp(settings->scene, SIM_FOREST);
    s->sharing = calloc(1, sizeof(*s->sharing));
    if (!s->sharing)
        goto fail;
    pthread_mutex_init(&s->sharing->lock, NULL);
    s->frames = s->steps = sst_max_int(1, (int)lround(settings->loop_s * settings->rate_hz));
    err = build(s, 0, 0, &s->first); /* without the board: its poses may depend on the scene's size */
    if (err)
        goto fail;
    find_optics(s);
    s->board = settings->board;
    if (s->board.seeded)
        sim_board_seed_poses(&s->board, settings, &s->first);
    sst_scene_world_fini(&s->first);
    err = build(s, 0, 0, &s->first);
    err = err ? err : find_motion(s);
    for (int cam = 0; cam < cams && !err; cam++) {
        const struct sst_sim_override *o = &settings->camera[cam];

        sim_camera_make(&s->camera[cam], settings, &s->optics, cam);
        s->moved[cam] = s->camera[cam];
        if (o->given & SST_SIM_MOVES)
            sim_camera_move(o->moves_at ? &s->moved[cam] : &s->camera[cam], settings, cam);
        err = check_lens(s, &s->camera[cam], cam);
        err = err ? err : check_lens(s, &s->moved[cam], cam);
    }
    err = err ? err : sim_photo_create(&s->photo, settings);
    if (!err && settings->rig)
        err = make_warp(s, &s->camera[0], &s->warp);
    if (err)
        goto fail;
    *out = s;
    return 0;

fail:
    sim_stage_close(s);
    return err;
}

void sim_stage_close(struct sim_stage *s)
{
    if (!s)
        return;
    free(s->photo);
    if (s->sharing) {
        sst_hedge_destroy(s->sharing->hedge);
        pthread_mutex_destroy(&s->sharing->lock);
        free(s->sharing);
    }
    sst_scene_warp_fini(&s->warp);
    sst_scene_world_fini(&s->first);
    free(s->moving);
    free(s);
}

const struct sim_optics *sim_stage_optics(const struct sim_stage *s)
{
    return &s->optics;
}

const struct sim_camera *sim_stage_camera(const struct sim_stage *s, int cam)
{
    return &s->camera[cam];
}

const struct sim_camera *sim_stage_moved(const struct sim_stage *s, int cam, int *at)
{
    *at = s->settings->camera[cam].moves_at;
    return *at ? &s->moved[cam] : NULL;
}

const struct sst_sim_board *sim_stage_board(const struct sim_stage *s)
{
    return &s->board;
}

int sim_stage_frames(const struct sim_stage *s)
{
    return s->frames;
}

int sim_stage_steps(const struct sim_stage *s)
{
    return s->steps;
}

int sim_stage_frame_at(const struct sim_stage *s, int step)
{
    const int pass = s->hedge ? pass_frames(s) : 0;

    if (s->forest)
        return sst_min_int(step, s->steps - step);
    return !s->hedge || step < pass ? step : pass + (step - pass) % wind_frames(s);
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

/*
 * Half the size, weights 1 3 3 1 of four pixels each way: a pixel's area and the blur of a lens, about half a pixel.
 * Unrealistically sharp edges would shift detected corners by up to a tenth of a pixel.
 */
static void soften(const struct sst_image *in, struct sst_image *out)
{
    static const int weight[4] = { 1, 3, 3, 1 };

    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < out->height; y++) {
            for (int x = 0; x < out->width; x++) {
                int sum = 32;

                for (int v = 0; v < 4; v++) {
                    const uint8_t *row = sst_image_row(in, c, sst_clamp_int(2 * y + v - 1, 0, in->height - 1));

                    for (int u = 0; u < 4; u++)
                        sum += weight[v] * weight[u] * row[sst_clamp_int(2 * x + u - 1, 0, in->width - 1)];
                }
                sst_image_row(out, c, y)[x] = (uint8_t)(sum / 64);
            }
        }
    }
}

/* From the rendered picture to the sensor's: in place, or from the large one if fine is 2. */
static void expose(const struct sim_stage *s, const struct shooting *t, int frame, const struct sst_image *fine,
                   struct sst_image *native)
{
    const struct sim_exposing e = {
        .camera = t->camera,
        .light = 1 + s->settings->light_percent / 100 * sin(TURN * frame / s->frames),
        .seed = s->settings->seed * 7919 + (uint64_t)(frame * SST_CAMERAS_MAX + t->cam),
    };

    if (s->fine == 2)
        soften(fine, native);
    sim_photo_expose(s->photo, &e, s->fine == 2 ? native : fine, native);
}

/* Draw all rows at once, or band by band for a rolling shutter. */
static int draw(const struct sim_stage *s, struct sst_scene_layers *layers, int frame)
{
    const int height = s->settings->height, step = s->settings->rolling ? BAND_ROWS : height;

    for (int y = 0; y < height; y += step) {
        struct sst_scene_world w;
        const int err = build(s, frame, late_s(s->settings, y), &w);

        if (err)
            return err;
        sst_scene_layers_draw(layers, &w, y * s->fine, sst_min_int(y + step, height) * s->fine);
        sst_scene_world_fini(&w);
    }
    return 0;
}

/* The board over the empty room. @return 0 or -ENOMEM */
static int draw_board(const struct sim_stage *s, const struct shooting *t, int frame, struct sst_image *image)
{
    const struct sim_board_view v = {
        .board = &s->board,
        .floor_mm = SST_SIM_BOARD_FLOOR_MM,
        .wall_mm = sim_board_wall_mm(s->first.focal),
        .pose = s->board.poses ? frame % s->board.poses : 0,
        .focal_px = s->optics.focal_px,
        .cx = s->optics.cx,
        .cy = s->optics.cy,
        .eye_mm = { t->eye_mm[0], t->eye_mm[1], t->eye_mm[2] },
        .warp = t->warp->x ? t->warp : NULL,
    };

    return s->empty && s->board.kind && s->board.poses ? sim_board_draw(&v, image) : 0;
}

static int shoot(const struct sim_stage *s, const struct shooting *t)
{
    struct sst_image fine = { 0 }, native = { 0 };
    struct sst_scene_layers *layers = NULL;
    struct sst_scene_raster r;
    int err = sst_image_init(&native, s->settings->width, s->settings->height);

    err = err ? err : sst_image_init(&fine, s->settings->width * s->fine, s->settings->height * s->fine);
    if (!err) {
        aim(s, t, &fine, &r);
        err = sst_scene_layers_create(&layers, &r, s->moving, t->threads);
    }
    for (int i = t->first; i < t->last && !err; i++) {
        err = draw(s, layers, i);
        err = err ? err : draw_board(s, t, i, &fine);
        if (err)
            break;
        expose(s, t, i, &fine, &native);
        err = t->fn(t->arg, i, &native);
    }
    sst_scene_layers_destroy(layers);
    sst_image_fini(&fine);
    sst_image_fini(&native);
    return err;
}

/* A hedge: a person passes in the first frames, the others have the wind alone. */
static int shoot_hedge(const struct sim_stage *s, const struct shooting *t)
{
    const struct sst_sim_settings *c = s->settings;
    const int pass = pass_frames(s);
    struct sst_hedge_config cfg = {
        .rows = c->rows, .cols = c->cols, .width = c->width, .height = c->height, .seed = c->seed
    };
    struct sst_hedge *hedge = NULL, *all = NULL;
    struct sst_image native = { 0 };
    int err = sst_image_init(&native, c->width, c->height);

    sst_hedge_scene_config(&cfg);
    pthread_mutex_lock(&s->sharing->lock);
    if (!err && !s->sharing->hedge)
        err = sst_hedge_create(&s->sharing->hedge, &cfg);
    all = s->sharing->hedge;
    pthread_mutex_unlock(&s->sharing->lock);
    err = err ? err : sst_hedge_share(&hedge, all);
    for (int i = t->first; i < t->last && !err; i++) {
        const double t_s = (i < pass ? i : i - pass) / c->rate_hz;
        const struct sst_hedge_person p = sst_hedge_passer_by(&cfg, t_s);

        sst_hedge_draw_view(hedge, t_s, i < pass ? &p : NULL, t->cam, &native);
        expose(s, t, i, &native, &native);
        err = t->fn(t->arg, i, &native);
    }
    sst_hedge_destroy(hedge);
    sst_image_fini(&native);
    return err;
}

static void forest_camera(struct sst_calib_camera *out, const struct sim_camera *c)
{
    *out = (struct sst_calib_camera){ .known = true, .fx = c->fx, .fy = c->fy, .cx = c->cx, .cy = c->cy };
    memcpy(out->rotation, c->rotation, sizeof(out->rotation));
    memcpy(out->position_mm, c->position_mm, sizeof(out->position_mm));
}

/* A forest without wind, and walkers. */
static int shoot_forest(const struct sim_stage *s, struct shooting *t)
{
    const struct sst_sim_settings *c = s->settings;
    const struct sst_flight_forest_config cfg = {
        .seed = c->seed,
        .high_m = c->forest_high_m,
        .trees = c->forest_trees,
        .half_m = { c->cols * s->optics.spacing_mm / 2000, c->rows * s->optics.spacing_mm / 2000 },
        .aspect = (double)c->height / c->width,
    };
    struct sst_flight_forest *forest = NULL;
    struct sst_calib_camera camera;
    struct sst_image native = { 0 };
    int err = sst_image_init(&native, c->width, c->height);

    t->camera = &s->camera[t->cam];
    forest_camera(&camera, t->camera);
    err = err ? err : sst_flight_forest_open(&forest, &cfg);
    for (int i = 0; i < s->frames && !err; i++) {
        err = sst_flight_forest_draw(forest, &camera, i / c->rate_hz, &native);
        if (!err)
            expose(s, t, i, &native, &native);
        err = err ? err : t->fn(t->arg, i, &native);
    }
    sst_flight_forest_close(forest);
    sst_image_fini(&native);
    return err;
}

/* Render a picture with the camera's own lens and position. */
static int shoot_from(const struct sim_stage *s, struct shooting *t, const struct sim_camera *camera)
{
    struct sst_scene_warp warp = { 0 };
    int err = t->first < t->last ? make_warp(s, camera, &warp) : 0;

    t->camera = camera;
    t->warp = &warp;
    memcpy(t->eye_mm, camera->position_mm, sizeof(t->eye_mm));
    if (!err && t->first < t->last)
        err = shoot(s, t);
    sst_scene_warp_fini(&warp);
    return err;
}

int sim_stage_loop(const struct sim_stage *s, int cam, sim_picture_fn *fn, void *arg)
{
    const int moves_at = s->settings->camera[cam].moves_at, change = moves_at ? moves_at : s->frames;
    struct shooting t = { .cam = cam, .last = change, .threads = 1, .fn = fn, .arg = arg };
    int err;

    if (s->hedge) {
        t.camera = &s->camera[cam];
        return shoot_hedge(s, &t);
    }
    if (s->forest)
        return shoot_forest(s, &t);
    err = shoot_from(s, &t, &s->camera[cam]);
    t.first = change;
    t.last = s->frames;
    return err ? err : shoot_from(s, &t, &s->moved[cam]);
}

int sim_stage_pose(const struct sim_stage *s, const int32_t pose_um[3], int frame, sim_picture_fn *fn, void *arg)
{
    struct shooting t = { .camera = &s->camera[0],
                          .warp = &s->warp,
                          .first = frame,
                          .last = frame + 1,
                          .threads = sst_thread_count(0),
                          .fn = fn,
                          .arg = arg };

    for (int i = 0; i < 3; i++)
        t.eye_mm[i] = s->camera[0].position_mm[i] + pose_um[i] / 1000.0;
    return shoot(s, &t);
}

int sim_stage_look(const struct sim_stage *s, int frame, const double eye_mm[3], struct sst_scene_warp *rays,
                   struct sst_map_f32 *depth, struct sst_map_u8 *label)
{
    const struct sim_optics *o = &s->optics;
    struct sst_scene_world w;
    const struct sst_scene_raster r = {
        .world = &w,
        .focal_px = o->focal_px,
        .cx = o->cx,
        .cy = o->cy,
        .width = rays->width,
        .height = rays->height,
        .step_x = 1,
        .step_y = 1,
        .bx = eye_mm[0] / o->spacing_mm,
        .by = eye_mm[1] / o->spacing_mm,
        .eye_z_mm = eye_mm[2],
        .warp = rays,
        .disp = depth,
        .label = label,
    };
    int err = s->hedge || s->forest ? -EINVAL : build(s, frame, 0, &w);

    if (err)
        return err;
    if (s->empty && s->board.kind && s->board.poses)
        sim_board_add(&w, &s->board, frame % s->board.poses);
    sst_scene_warp_index(rays);
    err = w.failed ? -ENOMEM : sst_scene_raster_run(&r);
    sst_scene_world_fini(&w);
    for (int y = 0; !err && depth && y < depth->height; y++) {
        float *row = sst_map_f32_row(depth, y);

        for (int x = 0; x < depth->width; x++) /* 1/Z so far, scaled as disparity */
            row[x] = row[x] > 0 ? (float)(o->focal_px * o->spacing_mm / row[x]) : 0;
    }
    return err;
}
