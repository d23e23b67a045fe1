/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/world/settings.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/yaml.h"
#include "simulators/scene/scene.h"
#include "simulators/scene/world/world_internal.h"

#define SIDE_MAX   8192
#define FRAMES_MAX 1000
#define US_MAX     1e7
#define SCENES     "bush, pedestrian, transportation, cell, humvee, cd-cases, cat, bust, terrace, hedge, forest or board"
#define OPTICS     "bush, pedestrian, transportation, cell, humvee, cd-cases, cat, bust, terrace or board"

/* Scenes of surfaces, with which boards and any optics go together. */
static bool has_surfaces(const char *name)
{
    for (int i = 0; sst_scene_names()[i]; i++) {
        if (!strcmp(name, sst_scene_names()[i]))
            return true;
    }
    return !strcmp(name, "board");
}

static bool is_scene(const char *name)
{
    return has_surfaces(name) || !strcmp(name, SIM_HEDGE) || !strcmp(name, SIM_FOREST);
}

static void default_board(struct sst_sim_board *b)
{
    b->kind = SST_SIM_CHARUCO;
    b->cols = 9;
    b->rows = 7;
    b->square_mm = 50;
    b->marker = 0.7;
    b->poses = 20;
    b->seeded = true;
}

/* Whole periods of the scene's motion, so that the loop is seamless. */
static void default_loop(struct sst_sim_settings *s)
{
    const bool leaves = !strcmp(s->scene, "bush"), hedge = !strcmp(s->scene, SIM_HEDGE),
               forest = !strcmp(s->scene, SIM_FOREST);

    s->rate_hz = forest ? 2 : leaves || hedge ? 5 : s->board.kind ? 1 : 10;
    s->loop_s = hedge ? 60 : forest ? 8 : !strcmp(s->scene, "pedestrian") ? 4 : leaves ? 2 : 0.1;
    if (s->board.kind)
        s->loop_s = fmax(s->loop_s, s->board.poses / s->rate_hz);
}

/* Ten cameras on a rod, tilted and at unequal heights. */
static void default_forest(struct sst_sim_settings *s)
{
    s->rows = 1;
    s->cols = 10;
    s->height = 640;
    s->quality = 90;
    s->rotation_spread_deg = 1.5;
    s->position_spread_mm = 120;
    s->forest_high_m = 40;
    s->forest_trees = 9;
}

void sst_sim_settings_defaults(struct sst_sim_settings *s, const char *scene)
{
    memset(s, 0, sizeof(*s)); /* padding included: the bytes are the cache's key */
    snprintf(s->scene, sizeof(s->scene), "%s", scene);
    s->seed = 1;
    s->rows = s->cols = 6;
    s->split_rows = s->split_cols = 1;
    s->width = 640;
    s->height = 480;
    s->quality = 75;
    s->exposure_us = 5000;
    s->strip = true;
    s->line_us = 20;
    s->latency_us = 8000;
    if (!strcmp(scene, "board"))
        default_board(&s->board);
    if (!strcmp(scene, SIM_FOREST))
        default_forest(s);
    default_loop(s);
}

/* --- the file ----------------------------------------------------------------------------------------------------- */

/* "[a, b]" with whole numbers. */
static void read_pair(struct sst_yaml *doc, const struct sst_yaml_node *node, int min, int max, int *a, int *b)
{
    double v[2];

    if (!sst_yaml_doubles(doc, node, min, max, v, 2))
        return;
    if (v[0] != floor(v[0]) || v[1] != floor(v[1])) {
        sst_yaml_fault(doc, node, "must be two whole numbers");
        return;
    }
    *a = (int)v[0];
    *b = (int)v[1];
}

static void read_loop(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_sim_settings *s)
{
    sst_yaml_double(doc, sst_yaml_get(map, "seconds"), 0.01, 3600, &s->loop_s);
    sst_yaml_double(doc, sst_yaml_get(map, "rate_hz"), 0.1, 120, &s->rate_hz);
    if (s->loop_s * s->rate_hz > FRAMES_MAX)
        sst_yaml_fault(doc, map, "makes %.0f frames of each camera; the maximum is %d", s->loop_s * s->rate_hz,
                       FRAMES_MAX);
}

static void read_shutter(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_sim_settings *s)
{
    static const char *const kinds[] = { "global", "rolling" };
    int kind = 0;

    sst_yaml_choice(doc, sst_yaml_get(map, "kind"), kinds, 2, &kind);
    s->rolling = kind == 1;
    sst_yaml_double(doc, sst_yaml_get(map, "line_us"), 0, 100000, &s->line_us);
}

static void read_optics(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_sim_settings *s)
{
    struct sst_yaml_node *scene = sst_yaml_get(map, "scene");

    if (sst_yaml_string(doc, scene, s->optics_scene, sizeof(s->optics_scene))) {
        if (!has_surfaces(s->optics_scene))
            sst_yaml_fault(doc, scene, "is not a scene with optics of its own; choose " OPTICS);
        else if (strcmp(s->scene, "board"))
            sst_yaml_fault(doc, scene, "applies only to worlds of the scene board; others have their own optics");
    }
    sst_yaml_doubles(doc, sst_yaml_get(map, "distortion"), -10, 10, s->distortion, 5);
    sst_yaml_doubles(doc, sst_yaml_get(map, "distortion_spread"), 0, 10, s->distortion_spread, 5);
    sst_yaml_double(doc, sst_yaml_get(map, "focal_spread_percent"), 0, 20, &s->focal_spread_percent);
    sst_yaml_double(doc, sst_yaml_get(map, "principal_spread_px"), 0, 500, &s->principal_spread_px);
    sst_yaml_double(doc, sst_yaml_get(map, "vignetting"), 0, 1, &s->vignetting);
}

static void read_mounting(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_sim_settings *s)
{
    sst_yaml_double(doc, sst_yaml_get(map, "rotation_spread_deg"), 0, 20, &s->rotation_spread_deg);
    sst_yaml_double(doc, sst_yaml_get(map, "position_spread_mm"), 0, 1000, &s->position_spread_mm);
}

static void read_sensor(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_sim_settings *s)
{
    sst_yaml_double(doc, sst_yaml_get(map, "gain_spread_percent"), 0, 100, &s->gain_spread_percent);
    sst_yaml_double(doc, sst_yaml_get(map, "balance_spread_percent"), 0, 100, &s->balance_spread_percent);
    sst_yaml_double(doc, sst_yaml_get(map, "full_well_e"), 0, 1e7, &s->full_well_e);
    sst_yaml_double(doc, sst_yaml_get(map, "read_noise_e"), 0, 1e5, &s->read_noise_e);
}

static void read_timing(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_sim_settings *s)
{
    sst_yaml_double(doc, sst_yaml_get(map, "delay_us"), 0, US_MAX, &s->delay_us);
    sst_yaml_double(doc, sst_yaml_get(map, "delay_spread_us"), 0, US_MAX, &s->delay_spread_us);
    sst_yaml_double(doc, sst_yaml_get(map, "jitter_us"), 0, US_MAX, &s->jitter_us);
    sst_yaml_double(doc, sst_yaml_get(map, "latency_us"), 0, US_MAX, &s->latency_us);
    sst_yaml_double(doc, sst_yaml_get(map, "latency_spread_us"), 0, US_MAX, &s->latency_spread_us);
    sst_yaml_double(doc, sst_yaml_get(map, "phase_spread_us"), 0, US_MAX, &s->phase_spread_us);
    sst_yaml_double(doc, sst_yaml_get(map, "clock_offset_spread_us"), 0, US_MAX, &s->clock_offset_spread_us);
    sst_yaml_double(doc, sst_yaml_get(map, "clock_drift_spread_ppm"), 0, 1000, &s->clock_drift_spread_ppm);
}

/* A number: this many poses by the seed. A list: the poses themselves. */
static void read_poses(struct sst_yaml *doc, struct sst_yaml_node *node, struct sst_sim_board *b, bool alone)
{
    if (!node)
        return;
    if (node->type != SST_YAML_LIST) {
        b->seeded = sst_yaml_int(doc, node, 1, SST_SIM_POSES_MAX, &b->poses);
        return;
    }
    if (node->count < 1 || node->count > SST_SIM_POSES_MAX) {
        sst_yaml_fault(doc, node, "must have 1 to %d poses", SST_SIM_POSES_MAX);
        return;
    }
    b->seeded = false;
    b->poses = 0;
    for (struct sst_yaml_node *n = node->first; n; n = n->next) {
        struct sst_sim_pose *p = &b->pose[b->poses++];

        if (n->type != SST_YAML_MAP) {
            sst_yaml_fault(doc, n, "must be a pose: {position_mm: [x, y, z], rotation_deg: [x, y, z]}");
            continue;
        }
        sst_yaml_doubles(doc, sst_yaml_need(doc, n, "position_mm"), -1e6, 1e6, p->position_mm, 3);
        sst_yaml_doubles(doc, sst_yaml_get(n, "rotation_deg"), -360, 360, p->rotation_deg, 3);
        if (sst_yaml_double(doc, sst_yaml_get(n, "blur_px"), 0, 100, &p->blur_px) && !alone)
            sst_yaml_fault(doc, n, "has blur_px, which applies only to worlds of the scene board");
    }
}

static void read_board(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_sim_board *b, bool alone)
{
    static const char *const kinds[] = { "none", "chessboard", "charuco", "aprilgrid" };
    int kind = SST_SIM_CHARUCO, most;

    if (!map)
        return;
    default_board(b);
    sst_yaml_choice(doc, sst_yaml_get(map, "kind"), kinds, 4, &kind);
    b->kind = (enum sst_sim_board_kind)kind;
    if (b->kind == SST_SIM_APRILGRID) {
        b->cols = b->rows = 6;
        b->marker = 0.3;
    }
    read_pair(doc, sst_yaml_get(map, "squares"), 1, 50, &b->cols, &b->rows);
    sst_yaml_double(doc, sst_yaml_get(map, "square_mm"), 0.01, 1e4, &b->square_mm);
    sst_yaml_double(doc, sst_yaml_get(map, "marker"), 0.05, 0.95, &b->marker);
    read_poses(doc, sst_yaml_get(map, "poses"), b, alone);
    sst_yaml_bool(doc, sst_yaml_get(map, "fill"), &b->fill);
    if (b->fill && (!b->seeded || b->kind == SST_SIM_CHESSBOARD))
        sst_yaml_fault(doc, map, "has fill, which needs poses from the seed and a board that may be partly outside");
    most = b->kind == SST_SIM_CHARUCO ? 2 * SST_SIM_CHARUCO_MARKERS : SST_SIM_APRIL_TAGS;
    if (b->kind >= SST_SIM_CHARUCO && b->cols * b->rows > most)
        sst_yaml_fault(doc, map, "has %dx%d squares, but there are only markers for %d", b->cols, b->rows, most);
}

struct number {
    const char *key;
    enum sst_sim_given bit;
    double *out;
    int n;
    double min, max;
};

static void read_override(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_sim_override *o)
{
    const struct number numbers[] = {
        { "distortion", SST_SIM_DISTORTION, o->distortion, 5, -10, 10 },
        { "rotation_deg", SST_SIM_ROTATION, o->rotation_deg, 3, -45, 45 },
        { "position_mm", SST_SIM_POSITION, o->position_mm, 3, -1e5, 1e5 },
        { "focal_percent", SST_SIM_FOCAL, &o->focal_percent, 1, -50, 100 },
        { "principal_px", SST_SIM_PRINCIPAL, o->principal_px, 2, -SIDE_MAX, SIDE_MAX },
        { "gain", SST_SIM_GAIN, o->gain, 3, 0, 16 },
        { "delay_us", SST_SIM_DELAY, &o->delay_us, 1, 0, US_MAX },
        { "jitter_us", SST_SIM_JITTER, &o->jitter_us, 1, 0, US_MAX },
        { "latency_us", SST_SIM_LATENCY, &o->latency_us, 1, 0, US_MAX },
        { "phase_us", SST_SIM_PHASE, &o->phase_us, 1, 0, US_MAX },
        { "clock_offset_us", SST_SIM_OFFSET, &o->clock_offset_us, 1, -US_MAX, US_MAX },
        { "clock_drift_ppm", SST_SIM_DRIFT, &o->clock_drift_ppm, 1, -1000, 1000 },
    };

    for (size_t i = 0; i < ARRAY_LEN(numbers); i++) {
        const struct number *k = &numbers[i];

        if (sst_yaml_doubles(doc, sst_yaml_get(map, k->key), k->min, k->max, k->out, k->n))
            o->given |= k->bit;
    }
}

/* "moves": a change of pose from a frame of the loop on. */
static void read_moves(struct sst_yaml *doc, struct sst_yaml_node *map, const struct sst_sim_settings *s,
                       struct sst_sim_override *o)
{
    if (!map)
        return;
    if (map->type != SST_YAML_MAP)
        sst_yaml_fault(doc, map, "must be {at_pose: 10, rotation_deg: [x, y, z], position_mm: [x, y, z]}");
    if (s->rig)
        sst_yaml_fault(doc, map, "applies only to arrays; the camera of a rig stays as mounted");
    o->given |= SST_SIM_MOVES;
    sst_yaml_int(doc, sst_yaml_get(map, "at_pose"), 0, sst_max_int(1, (int)lround(s->loop_s * s->rate_hz)) - 1,
                 &o->moves_at);
    sst_yaml_doubles(doc, sst_yaml_get(map, "rotation_deg"), -45, 45, o->moves_deg, 3);
    sst_yaml_doubles(doc, sst_yaml_get(map, "position_mm"), -1e5, 1e5, o->moves_mm, 3);
}

static void read_cameras(struct sst_yaml *doc, struct sst_yaml_node *list, struct sst_sim_settings *s)
{
    const int cams = s->rig ? 1 : s->rows * s->cols;

    if (list && list->type != SST_YAML_LIST) {
        sst_yaml_fault(doc, list, "must be a list of cameras: - {camera: 0, ...}");
        return;
    }
    for (struct sst_yaml_node *n = list ? list->first : NULL; n; n = n->next) {
        int cam;

        if (n->type != SST_YAML_MAP)
            sst_yaml_fault(doc, n, "must be a camera: {camera: 0, ...}");
        else if (sst_yaml_int(doc, sst_yaml_need(doc, n, "camera"), 0, cams - 1, &cam)) {
            read_override(doc, n, &s->camera[cam]);
            read_moves(doc, sst_yaml_get(n, "moves"), s, &s->camera[cam]);
        }
    }
}

/* "faults": faults of the still camera, each before a given exposure; sst-sim knows the names. */
static void read_still_faults(struct sst_yaml *doc, struct sst_yaml_node *list, struct sst_sim_still *still)
{
    if (list && list->type != SST_YAML_LIST) {
        sst_yaml_fault(doc, list, "must be a list of faults: - {shot: 3, fault: busy, value: 500}");
        return;
    }
    for (struct sst_yaml_node *n = list ? list->first : NULL; n; n = n->next) {
        int shot = 1;
        double value = 1;

        if (n->type != SST_YAML_MAP) {
            sst_yaml_fault(doc, n, "must be a fault: {shot: 3, fault: busy, value: 500}");
            continue;
        }
        if (still->faults == SST_SIM_STILL_FAULTS_MAX) {
            sst_yaml_fault(doc, n, "is one too many; the maximum is %d", SST_SIM_STILL_FAULTS_MAX);
            return;
        }
        (void)sst_yaml_int(doc, sst_yaml_need(doc, n, "shot"), 1, 100000, &shot);
        (void)sst_yaml_string(doc, sst_yaml_need(doc, n, "fault"), still->fault[still->faults].name,
                              sizeof(still->fault[0].name));
        (void)sst_yaml_double(doc, sst_yaml_get(n, "value"), 0, 1e6, &value);
        still->fault[still->faults].shot = shot;
        still->fault[still->faults++].value = value;
    }
}

static void read_still(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_sim_settings *s)
{
    struct sst_sim_still *still = &s->still;

    if (!map)
        return;
    if (!s->rig)
        sst_yaml_fault(doc, map,
                       "applies only to worlds with `rig: true`: a still camera is in the place of its camera");
    *still = (struct sst_sim_still){
        .present = true, .serial = "SST0001", .battery_percent = 80, .card_mb = 64, .lag_ms = 60, .write_ms = 100
    };
    (void)sst_yaml_string(doc, sst_yaml_get(map, "serial"), still->serial, sizeof(still->serial));
    sst_yaml_int(doc, sst_yaml_get(map, "battery_percent"), 0, 100, &still->battery_percent);
    sst_yaml_int(doc, sst_yaml_get(map, "card_mb"), 1, 256, &still->card_mb);
    sst_yaml_int(doc, sst_yaml_get(map, "lag_ms"), 0, 10000, &still->lag_ms);
    sst_yaml_int(doc, sst_yaml_get(map, "write_ms"), 0, 60000, &still->write_ms);
    sst_yaml_bool(doc, sst_yaml_get(map, "mirror_lockup"), &still->mirror_lockup);
    sst_yaml_bool(doc, sst_yaml_get(map, "buffer"), &still->buffer);
    read_still_faults(doc, sst_yaml_get(map, "faults"), still);
}

static void read_size(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_sim_settings *s)
{
    struct sst_yaml_node *size = sst_yaml_get(root, "size"), *grid = sst_yaml_get(root, "grid");

    read_pair(doc, grid, 1, SST_CAMERAS_MAX, &s->rows, &s->cols);
    if (s->rows * s->cols > SST_CAMERAS_MAX) {
        sst_yaml_fault(doc, grid, "has %d cameras; the maximum is %d", s->rows * s->cols, SST_CAMERAS_MAX);
        s->rows = s->cols = 1;
    }
    read_pair(doc, size, 16, SIDE_MAX, &s->width, &s->height);
    if (s->width % 16 || s->height % 8)
        sst_yaml_fault(doc, size, "must be a multiple of 16 wide and of 8 high");
    else if (s->strip && 2 * strip_height(s->width) > s->height)
        sst_yaml_fault(doc, size,
                       "is too small for the strip of %d rows; choose a larger size or strip: "
                       "false",
                       strip_height(s->width));
}

static bool any(const double *v, int n)
{
    bool is = false;

    for (int i = 0; i < n; i++)
        is |= v[i] != 0;
    return is;
}

/* The hedge is drawn by ideal cameras of an array, and its wind repeats. */
static void check_hedge(struct sst_yaml *doc, struct sst_yaml_node *root, const struct sst_sim_settings *s)
{
    const double wind = SST_HEDGE_PERIOD_S * s->rate_hz, winds = s->loop_s / SST_HEDGE_PERIOD_S;
    bool turned = any(s->distortion, 5) || any(s->distortion_spread, 5) || s->focal_spread_percent > 0 ||
                  s->principal_spread_px > 0 || s->rotation_spread_deg > 0 || s->position_spread_mm > 0;

    for (int cam = 0; cam < SST_CAMERAS_MAX; cam++)
        turned |= s->camera[cam].given & (SST_SIM_DISTORTION | SST_SIM_ROTATION | SST_SIM_POSITION | SST_SIM_FOCAL |
                                          SST_SIM_PRINCIPAL | SST_SIM_MOVES);
    if (s->rig || s->board.kind || s->rolling || turned)
        sst_yaml_fault(
            doc, root,
            "has the scene hedge, which an array of ideal cameras sees: without rig, board, rolling shutter, "
            "distortion, other focal lengths and errors of mounting");
    if (s->width > SST_HEDGE_WIDTH_MAX)
        sst_yaml_fault(doc, root, "has the scene hedge, which is at most %d px wide", SST_HEDGE_WIDTH_MAX);
    if (fabs(wind - round(wind)) > 1e-9 || fabs(winds - round(winds)) > 1e-9 || s->loop_s < 3 * SST_HEDGE_PERIOD_S)
        sst_yaml_fault(
            doc, root,
            "has the scene hedge: its loop lasts 12 s or more in steps of 4 s, with a whole number of frames "
            "in 4 s");
}

static void read_forest(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_sim_settings *s)
{
    if (map && strcmp(s->scene, SIM_FOREST))
        sst_yaml_fault(doc, map, "applies only to worlds of the scene forest");
    sst_yaml_double(doc, sst_yaml_get(map, "high_m"), 5, 500, &s->forest_high_m);
    sst_yaml_double(doc, sst_yaml_get(map, "trees_per_100m2"), 0, 30, &s->forest_trees);
}

/* The forest is drawn by lenses without distortion. */
static void check_forest(struct sst_yaml *doc, struct sst_yaml_node *root, const struct sst_sim_settings *s)
{
    bool bent = any(s->distortion, 5) || any(s->distortion_spread, 5);

    for (int cam = 0; cam < SST_CAMERAS_MAX; cam++)
        bent |= (s->camera[cam].given & (SST_SIM_DISTORTION | SST_SIM_MOVES)) != 0;
    if (s->rig || s->board.kind || s->rolling || bent)
        sst_yaml_fault(doc, root,
                       "has the scene forest, which an array of lenses without distortion sees that does not move: "
                       "without rig, board, rolling shutter and moves");
}

/* A mapping below the root, if present. */
static struct sst_yaml_node *section(struct sst_yaml *doc, struct sst_yaml_node *root, const char *key)
{
    struct sst_yaml_node *node = sst_yaml_get(root, key);

    if (!node || node->type == SST_YAML_MAP)
        return node;
    sst_yaml_fault(doc, node, "must be a mapping of keys, one a line, indented below it");
    return NULL;
}

static void read_host(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_sim_settings *s)
{
    sst_yaml_double(doc, sst_yaml_get(map, "generator_hz"), 0.1, 120, &s->host.generator_hz);
    sst_yaml_double(doc, sst_yaml_get(map, "clock_offset_ms"), -1e6, 1e6, &s->host.clock_offset_ms);
    sst_yaml_double(doc, sst_yaml_get(map, "clock_drift_ppm"), -1000, 1000, &s->host.clock_drift_ppm);
}

static void read_split(struct sst_yaml *doc, struct sst_yaml_node *split, struct sst_sim_settings *s)
{
    read_pair(doc, split, 1, SST_SIM_SPLIT_MAX, &s->split_rows, &s->split_cols);
    if (s->split_rows * s->split_cols > SST_SIM_SPLIT_MAX || s->rows % s->split_rows || s->cols % s->split_cols ||
        (s->rig && s->split_rows * s->split_cols > 1))
        sst_yaml_fault(doc, split, "must divide the grid of %dx%d into boards of at most %d cameras", s->rows, s->cols,
                       SST_SIM_SPLIT_MAX);
}

static void read_all(struct sst_yaml *doc, struct sst_sim_settings *s)
{
    struct sst_yaml_node *root = sst_yaml_root(doc), *scene = sst_yaml_need(doc, root, "scene");
    char name[sizeof(s->scene)] = "pedestrian";
    int seed = 1;

    if (sst_yaml_string(doc, scene, name, sizeof(name)) && !is_scene(name))
        sst_yaml_fault(doc, scene, "is not a scene; choose " SCENES);
    sst_sim_settings_defaults(s, name);
    if (sst_yaml_int(doc, sst_yaml_get(root, "seed"), 0, INT32_MAX, &seed))
        s->seed = (uint64_t)seed;
    sst_yaml_bool(doc, sst_yaml_get(root, "strip"), &s->strip);
    sst_yaml_bool(doc, sst_yaml_get(root, "rig"), &s->rig);
    read_size(doc, root, s);
    read_board(doc, section(doc, root, "board"), &s->board, !strcmp(name, "board"));
    default_loop(s);
    read_loop(doc, section(doc, root, "loop"), s);
    sst_yaml_int(doc, sst_yaml_get(root, "jpeg_quality"), 20, 100, &s->quality);
    sst_yaml_int(doc, sst_yaml_get(root, "exposure_us"), 1, 1000000, &s->exposure_us);
    sst_yaml_double(doc, sst_yaml_get(root, "light_percent"), 0, 90, &s->light_percent);
    read_shutter(doc, section(doc, root, "shutter"), s);
    read_optics(doc, section(doc, root, "optics"), s);
    read_mounting(doc, section(doc, root, "mounting"), s);
    read_forest(doc, section(doc, root, "forest"), s);
    read_sensor(doc, section(doc, root, "sensor"), s);
    read_timing(doc, section(doc, root, "timing"), s);
    read_host(doc, section(doc, root, "host"), s);
    read_split(doc, sst_yaml_get(root, "split"), s);
    read_cameras(doc, sst_yaml_get(root, "cameras"), s);
    read_still(doc, section(doc, root, "still"), s);
    if (!strcmp(name, SIM_HEDGE))
        check_hedge(doc, root, s);
    if (!strcmp(name, SIM_FOREST))
        check_forest(doc, root, s);
}

int sst_sim_settings_read(struct sst_sim_settings *s, const char *world)
{
    struct sst_sim_settings *read;
    struct sst_yaml *doc;
    uint8_t *text;
    size_t size;
    int err;

    if (is_scene(world)) {
        sst_sim_settings_defaults(s, world);
        return 0;
    }
    if (!sst_path_exists(world)) {
        sst_log_error("unknown world `%s`; give the path of a world file, or a scene: " SCENES, world);
        return -EINVAL;
    }
    err = sst_file_read_text(world, SST_YAML_MAX_BYTES, &text, &size);
    if (err)
        return err;
    err = sst_yaml_parse(&doc, (const char *)text, size, world);
    free(text);
    if (err)
        return err;
    read = calloc(1, sizeof(*read));
    if (read) {
        read_all(doc, read);
        err = sst_yaml_finish(doc);
    } else {
        err = -ENOMEM;
    }
    if (!err)
        memcpy(s, read, sizeof(*s));
    free(read);
    sst_yaml_destroy(doc);
    return err;
}
