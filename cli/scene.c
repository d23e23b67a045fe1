/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/scene.h"

#include <string.h>

#include "cli/cli_internal.h"
#include "simulators/flight/flight.h"

static bool has_layer_options(const struct sst_layers_config *l)
{
    return l->photos || l->masks || l->kind || l->cover_percent >= 0 || l->noise >= 0 || l->gain_percent >= 0 ||
           l->jpeg >= 0;
}

/* --- flights ------------------------------------------------------------------------------------------------------ */

static bool is_flight(const char *name)
{
    const char *const *n = sst_flight_names();

    while (*n && strcmp(*n, name))
        n++;
    return *n != NULL;
}

static bool has_flight_options(const struct sst_flight_config *f)
{
    return f->moments > 1 || f->turn_deg != 0 || f->shake_deg > 0 || f->drift_mm > 0 || f->unplaced;
}

/* Options that scenes and flights share. */
static int share_options(const struct cli_command *cmd, const char *name, struct sst_flight_config *flight,
                         const struct sst_scene_config *cfg)
{
    const struct sst_layers_config *l = &cfg->layers;

    if (l->photos || l->masks || l->kind || l->noise >= 0 || l->gain_percent >= 0 || l->jpeg >= 0 || cfg->time_s != 0)
        return cli_usage_error(cmd, "%s has no --photos, --masks, --kind, --noise, --gain, --jpeg and --time", name);
    flight->seed = cfg->seed;
    flight->threads = cfg->threads;
    flight->cover = l->cover_percent;
    return CLI_GO_ON;
}

static int make_flight(const char *name, struct sst_flight_config *flight, const char *out, bool force)
{
    int err;

    flight->progress = cli_progress;
    flight->progress_arg = (char[]){ "flight" };
    err = sst_flight_write(name, flight, out, force);
    cli_progress_end();
    return err ? cli_exit_code(err) : cli_report_posed(out, out, false);
}

/* --- scenes ------------------------------------------------------------------------------------------------------- */

static int check_options(const struct cli_command *cmd, const char *name, const struct sst_scene_config *cfg,
                         const struct sst_flight_config *flight, const char *out)
{
    if (!out)
        return cli_usage_error(cmd, "-o LF is missing");
    if (strcmp(name, "layers") && has_layer_options(&cfg->layers))
        return cli_usage_error(
            cmd, "--photos, --masks, --kind, --cover, --noise, --gain and --jpeg need the scene `layers`");
    if (has_flight_options(flight))
        return cli_usage_error(
            cmd, "--moments, --turn, --shake, --drift and --unplaced need the scene `forest` or `flight`");
    if (cfg->layers.masks && !cfg->layers.photos)
        return cli_usage_error(cmd, "--masks needs --photos");
    return CLI_GO_ON;
}

static int make(const char *name, struct sst_scene_config *cfg, const char *out, bool force)
{
    int err;

    cfg->progress = cli_progress;
    cfg->progress_arg = (char[]){ "scene" };
    err = sst_scene_write(name, cfg, out, force);
    cli_progress_end();
    return cli_exit_code(err ? err : cli_print_lightfield(out, out));
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_scene_config cfg;
    struct sst_flight_config flight;
    const char *name, *out = NULL;
    int size[2] = { 0 }, grid[2] = { 0 }, r;
    bool force = false;

    sst_scene_config_defaults(&cfg);
    sst_flight_config_defaults(&flight);

    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &out, "LF", "light-field folder to make" },
        { "size", 0, CLI_SIZE, size, "WxH", "pixels of a view; 1000x750, of flights their camera's", 1,
          SST_IMAGE_MAX_SIDE },
        { "grid", 0, CLI_GRID, grid, "RxC",
          "rows and columns of views; 6x6; forest: cameras, 1x10; flight: lines x pictures, 1x30", 1, 256 },
        { "seed", 0, CLI_SEED, &cfg.seed, "N", "random seed: moves and recolours objects; 1" },
        { "photos", 0, CLI_STRING, &cfg.layers.photos, "DIR", "layers: folder of pictures; procedural ones" },
        { "masks", 0, CLI_STRING, &cfg.layers.masks, "DIR", "layers: their label images, CamVid's classes" },
        { "kind", 0, CLI_STRING, &cfg.layers.kind, "NAME",
          "layers: leaves, foliage, branches, slats, mesh, crowd or mixed (default)", 0, 0,
          "leaves foliage branches slats mesh crowd mixed" },
        { "cover", 0, CLI_DOUBLE, &cfg.layers.cover_percent, "PCT",
          "layers: percent of the picture hidden, 30..80; forest, flight: trees per 100 m2, about 8", 0, 95 },
        { "noise", 0, CLI_DOUBLE, &cfg.layers.noise, "SD", "layers: noise of the views, levels; 0..4", 0, 50 },
        { "gain", 0, CLI_DOUBLE, &cfg.layers.gain_percent, "PCT", "layers: gain differs by up to this; 0..3", 0, 50 },
        { "jpeg", 0, CLI_INT, &cfg.layers.jpeg, "Q", "layers: quality of JPEG views, 0: PNG; 85..95 or PNG", 0, 100 },
        { "time", 0, CLI_DOUBLE, &cfg.time_s, "S", "seconds of motion; 0", -1e6, 1e6 },
        { "moments", 0, CLI_INT, &flight.moments, "N", "forest: moments, 0.5 s apart; 1", 1, 100 },
        { "turn", 0, CLI_DOUBLE, &flight.turn_deg, "DEG",
          "forest, flight: error of the compass in the written poses; 0", -45, 45 },
        { "shake", 0, CLI_DOUBLE, &flight.shake_deg, "DEG", "... of each written rotation, about every axis; 0", 0,
          10 },
        { "drift", 0, CLI_DOUBLE, &flight.drift_mm, "MM", "... of each written position; 0", 0, 1e5 },
        { "unplaced", 0, CLI_FLAG, &flight.unplaced, NULL, "forest, flight: write no poses" },
        { "threads", 0, CLI_INT, &cfg.threads, "N", "threads; all processors", 1, 256 },
        { "force", 'f', CLI_FLAG, &force, NULL, "replace an existing folder" },
    };

    r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, &name, 1, 1);
    if (r != CLI_GO_ON)
        return r;
    if (is_flight(name) && out) {
        flight.width = size[0];
        flight.height = size[1];
        flight.rows = grid[0];
        flight.cols = grid[1];
        r = share_options(cmd, name, &flight, &cfg);
        return r == CLI_GO_ON ? make_flight(name, &flight, out, force) : r;
    }
    r = check_options(cmd, name, &cfg, &flight, out);
    if (r != CLI_GO_ON)
        return r;
    cfg.width = size[0] ? size[0] : cfg.width;
    cfg.height = size[1] ? size[1] : cfg.height;
    cfg.rows = grid[0] ? grid[0] : cfg.rows;
    cfg.cols = grid[1] ? grid[1] : cfg.cols;
    return make(name, &cfg, out, force);
}

const struct cli_command cli_scene = { "scene", run };
