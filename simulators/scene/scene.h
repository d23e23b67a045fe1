/* simulators/scene/scene.h - procedural scenes with exact disparity, labels, and pictures behind every occluder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_SCENE_SCENE_H
#define SST_SIMULATORS_SCENE_SCENE_H

#include "pipeline/image/image.h"

#define SST_SCENE_MAX_OCCLUDERS 4

/** The scene `layers`: photographs in layers. Negative numbers: the seed decides. */
struct sst_layers_config {
    const char *photos; /* folder of pictures; NULL: procedural ones */
    const char *masks;  /* folder of label images of the same names, CamVid's classes; NULL: none */
    const char *kind;   /* of the occluder: leaves foliage branches slats mesh crowd; NULL or mixed: the seed decides */
    double cover_percent, noise, gain_percent;
    int jpeg; /* quality of the views' files; 0: PNG */
};

struct sst_scene_config {
    int width, height, rows, cols;
    uint64_t seed; /* varies positions and colours; the same seed gives the same bytes */
    double time_s; /* motion: the pedestrian walks by in 4 s, leaves sway in 2 s, periodically */
    int threads;
    void (*progress)(void *arg, double done); /* called by sst_scene_write() with 0..1, one call at a time; or NULL */
    void *progress_arg;
    struct sst_layers_config layers;
};

/** One see-through task: objects to hide and the focus behind them. */
struct sst_scene_occluder {
    char name[32];
    int label;        /* of the occluding object */
    int target_label; /* of the object behind it that is in focus */
    double focus_px;  /* disparity of the target, px per spacing */
};

struct sst_scene; /* opaque; read-only after create: any number of threads may render */

void sst_scene_config_defaults(struct sst_scene_config *cfg); /* 1000x750, 6x6, seed 1 */

/** NULL-terminated list: bush pedestrian transportation cell humvee cd-cases cat bust terrace; `layers`, which has
 * no surfaces, is not in it. */
const char *const *sst_scene_names(void);

/** @return 0, -EINVAL (unknown name or absurd size, logged), -ENOMEM. */
SST_MUST_CHECK int sst_scene_create(struct sst_scene **out, const char *name, const struct sst_scene_config *cfg);
void sst_scene_destroy(struct sst_scene *scene);

/** Disparity range over all views: the search range for `sst process`. */
void sst_scene_range(const struct sst_scene *scene, double *min_px, double *max_px);
double sst_scene_focal_px(const struct sst_scene *scene);

int sst_scene_occluder_count(const struct sst_scene *scene);
const struct sst_scene_occluder *sst_scene_occluder_at(const struct sst_scene *scene, int index);

/** Picture and maps of a view, initialised by the caller to the scene's size; NULL: not wanted. */
struct sst_scene_maps {
    struct sst_image *image;
    struct sst_map_f32 *disp; /* px per spacing at the pixel centre */
    struct sst_map_u8 *label; /* default class list */
};

/**
 * Render one view at offset (bx, by) from the reference view.
 *
 * @param hidden  bit i set: the objects of occluder i are hidden (truth behind it)
 * @return 0, -EINVAL (an output of another size), -ENOMEM.
 */
SST_MUST_CHECK int sst_scene_render(const struct sst_scene *scene, double bx, double by, unsigned hidden,
                                    const struct sst_scene_maps *out);

/** Write a whole light-field folder with LF/truth as design.md, 9 says. @return as sst_import(). */
SST_MUST_CHECK int sst_scene_write(const char *name, const struct sst_scene_config *cfg, const char *out, bool force);

#endif
