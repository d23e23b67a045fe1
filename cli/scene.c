#include "simulators/scene/scene.h"

#include <string.h>

#include "cli/cli_internal.h"

static bool has_layer_options(const struct sst_layers_config *l)
{
    return l->photos || l->masks || l->kind || l->cover_percent >= 0 || l->noise >= 0 || l->gain_percent >= 0 ||
           l->jpeg >= 0;
}

static int check_options(const struct cli_command *cmd, const char *name, const struct sst_scene_config *cfg,
                         const char *out)
{
    if (!out)
        return cli_usage_error(cmd, "-o LF is missing");
    if (strcmp(name, "layers") && has_layer_options(&cfg->layers))
        return cli_usage_error(
            cmd, "--photos, --masks, --kind, --cover, --noise, --gain and --jpeg need the scene `layers`");
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
    const char *name, *out = NULL;
    int size[2], grid[2], r;
    bool force = false;

    sst_scene_config_defaults(&cfg);
    size[0] = cfg.width;
    size[1] = cfg.height;
    grid[0] = cfg.rows;
    grid[1] = cfg.cols;

    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &out, "LF", "light-field folder to make" },
        { "size", 0, CLI_SIZE, size, "WxH", "pixels of a view; 1000x750", 1, SST_IMAGE_MAX_SIDE },
        { "grid", 0, CLI_GRID, grid, "RxC", "rows and columns of views; 6x6", 1, 256 },
        { "seed", 0, CLI_SEED, &cfg.seed, "N", "random seed: moves and recolours objects; 1" },
        { "photos", 0, CLI_STRING, &cfg.layers.photos, "DIR", "layers: folder of pictures; procedural ones" },
        { "masks", 0, CLI_STRING, &cfg.layers.masks, "DIR", "layers: their label images, CamVid's classes" },
        { "kind", 0, CLI_STRING, &cfg.layers.kind, "NAME",
          "layers: leaves, foliage, branches, slats, mesh, crowd or mixed (default)", 0, 0, "leaves foliage branches slats mesh crowd mixed" },
        { "cover", 0, CLI_DOUBLE, &cfg.layers.cover_percent, "PCT", "layers: percent of the picture hidden; 30..80", 1,
          95 },
        { "noise", 0, CLI_DOUBLE, &cfg.layers.noise, "SD", "layers: noise of the views, levels; 0..4", 0, 50 },
        { "gain", 0, CLI_DOUBLE, &cfg.layers.gain_percent, "PCT", "layers: gain differs by up to this; 0..3", 0, 50 },
        { "jpeg", 0, CLI_INT, &cfg.layers.jpeg, "Q", "layers: quality of JPEG views, 0: PNG; 85..95 or PNG", 0, 100 },
        { "time", 0, CLI_DOUBLE, &cfg.time_s, "S", "seconds of motion; 0", -1e6, 1e6 },
        { "threads", 0, CLI_INT, &cfg.threads, "N", "threads; all processors", 1, 256 },
        { "force", 'f', CLI_FLAG, &force, NULL, "replace an existing folder" },
    };

    r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, &name, 1, 1);
    if (r == CLI_GO_ON)
        r = check_options(cmd, name, &cfg, out);
    if (r != CLI_GO_ON)
        return r;
    cfg.width = size[0];
    cfg.height = size[1];
    cfg.rows = grid[0];
    cfg.cols = grid[1];
    return make(name, &cfg, out, force);
}

const struct cli_command cli_scene = { "scene", run };
