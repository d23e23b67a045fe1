/* cli/posed_internal.h - pictures of light fields with a pose for every view: the part of `sst render` and `sst sweep`.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CLI_POSED_INTERNAL_H
#define SST_CLI_POSED_INTERNAL_H

#include "cli/cli_internal.h"
#include "cli/render_internal.h"
#include "pipeline/posed/ground.h"
#include "pipeline/posed/render.h"
#include "pipeline/posed/terrain.h"

/** An open light field, the virtual camera and the surface. */
struct posed_scene {
    const char *path;
    struct sst_posed posed;
    struct sst_heights heights; /* of terrain */
    struct sst_samples levels;  /* of --levels; white 0: found */
    bool mapped;                /* the terrain's places came from a map */
    struct sst_posed_ground ground;   /* views is 0: not sought */
    struct sst_posed_render_config cfg;
    const char *view; /* the camera's: a view's name, or "nadir" */
};

/**
 * Check options and load the light field, find the camera and the surface.
 * @param argv  of the command: options that have no effect on posed light fields are refused
 * @return CLI_GO_ON, or the exit code of the failure, which was logged; then nothing is to be freed
 */
int cli_posed_open(struct posed_scene *scene, const struct cli_command *cmd, const struct render_args *a,
                   const char *path, char **argv);
void cli_posed_close(struct posed_scene *scene);

/** Render one picture. @param sink  .png, .jpg, .tif or .pfm; exit codes as of commands */
int cli_posed_render(struct posed_scene *scene, const struct render_args *a, const char *out, const char *valid);

/** "levels 7000 to 7400", and the degrees where they are known. @return text */
const char *cli_posed_levels(char text[100], const struct sst_posed *posed, struct sst_samples stretch);

/** What the picture shows, for --json. */
json_t *cli_posed_scene_json(const struct posed_scene *scene);

/** A sweep of the whole surface: heights in metres above the surface that was asked for. */
struct posed_sweep {
    double from_m, to_m; /* NAN: the usual range */
    int steps;
    bool bounce;
    double fps;
    const char *out;
    struct sst_samples stretch; /* out: of 16 bits in a video; white 0: none */
};
int cli_posed_sweep(struct posed_scene *scene, const struct render_args *a, struct posed_sweep *sweep);

#endif
