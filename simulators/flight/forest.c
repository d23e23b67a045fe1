/* The forest under an array of a simulated world. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "simulators/flight/flight_internal.h"

#define REACH_M 11.0 /* of trees beyond the cameras' pictures: tilted cameras see further */

struct sst_flight_forest {
    struct flight_world world;
    double high_m;
};

int sst_flight_forest_open(struct sst_flight_forest **out, const struct sst_flight_forest_config *cfg)
{
    struct sst_flight_forest *f = calloc(1, sizeof(*f));
    const double half = cfg->high_m * 500 / SST_FOREST_FOCAL;
    const double half_x = half + cfg->half_m[0], half_y = half * cfg->aspect + cfg->half_m[1];
    int err;

    if (!f)
        return -ENOMEM;
    f->high_m = cfg->high_m;
    f->world = (struct flight_world){ .seed = cfg->seed,
                                      .slope = { 0.02, -0.03 },
                                      .extent = { -half_x - REACH_M, -half_y - REACH_M, half_x + REACH_M,
                                                  half_y + REACH_M },
                                      .trees = cfg->trees };
    flight_place_walkers(&f->world, half * 0.45, half * cfg->aspect * 0.6);
    err = flight_world_init(&f->world);
    if (err)
        sst_flight_forest_close(f);
    else
        *out = f;
    return err;
}

void sst_flight_forest_close(struct sst_flight_forest *forest)
{
    if (!forest)
        return;
    flight_world_fini(&forest->world);
    free(forest);
}

int sst_flight_forest_draw(const struct sst_flight_forest *forest, const struct sst_calib_camera *camera,
                           double time_s, struct sst_image *image)
{
    struct sst_calib_camera cam = *camera;
    struct flight_mesh walkers;
    struct sst_deep deep = { 0 };
    const struct flight_picture p = { .world = &forest->world, .walkers = &walkers, .camera = &cam };
    int err = flight_walkers_mesh(&walkers, &forest->world, time_s);

    cam.position_mm[1] = -camera->position_mm[1];
    cam.position_mm[2] = 1000 * forest->high_m - camera->position_mm[2];
    for (int i = 0; i < 9; i++) /* of y north and z up */
        cam.rotation[i] = i % 3 ? -camera->rotation[i] : camera->rotation[i];
    err = err ? err : sst_deep_init(&deep, image->width, image->height, 3, 255);
    err = err ? err : flight_draw(&p, &deep, NULL);
    for (int i = 0; !err && i < 3 * image->height; i++) {
        const uint16_t *from = sst_map_u16_row(&deep.plane[i % 3], i / 3);
        uint8_t *to = sst_image_row(image, i % 3, i / 3);

        for (int x = 0; x < image->width; x++)
            to[x] = (uint8_t)from[x];
    }
    sst_deep_fini(&deep);
    flight_mesh_fini(&walkers);
    return err;
}
