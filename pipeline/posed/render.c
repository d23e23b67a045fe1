/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/render.h"

#include <errno.h>

#include "base/log.h"
#include "pipeline/posed/integral.h"
#include "pipeline/posed/surface_internal.h"

bool posed_any(const struct sst_map_u16 *views)
{
    for (int y = 0; y < views->height; y++) {
        for (int x = 0; x < views->width; x++) {
            if (sst_map_u16_row(views, y)[x])
                return true;
        }
    }
    return false;
}

int posed_stretch(struct sst_samples *out, const struct sst_deep *levels, const struct sst_map_u16 *views)
{
    struct sst_deep filled;
    int err = sst_deep_init(&filled, levels->width, levels->height, levels->channels, levels->white);

    if (err)
        return err;
    for (int c = 0; c < levels->channels; c++) {
        uint16_t last = 0;

        for (int pass = 0; pass < 2; pass++) { /* the second one fills pixels before the first seen one */
            for (int y = 0; y < levels->height; y++) {
                for (int x = 0; x < levels->width; x++) {
                    last = sst_map_u16_row(views, y)[x] ? sst_map_u16_row(&levels->plane[c], y)[x] : last;
                    sst_map_u16_row(&filled.plane[c], y)[x] = last;
                }
            }
        }
    }
    *out = sst_deep_stretch(&filled);
    sst_deep_fini(&filled);
    return 0;
}

static int refocus(struct sst_posed_rendered *out, const struct sst_posed *posed, const char *dir,
                   const struct sst_posed_render_config *cfg)
{
    struct sst_integral *integral = NULL;
    int err = sst_integral_create(&integral, &cfg->camera, &cfg->surface, posed->channels, cfg->threads);
    const bool made = !err;

    if (!err)
        err = sst_integral_add_all(integral, posed, dir);
    if (made && err)
        goto end; /* which was logged */
    err = err ? err : sst_integral_levels(&out->levels, integral);
    for (int c = 0; c < posed->channels && !err; c++)
        err = sst_integral_means(&out->mean[c], integral, c);
    err = err ? err : sst_integral_views(&out->views, integral);
    out->seen = !err && posed_any(&out->views);
    err = err ? err : posed_stretch(&out->stretch, &out->levels, &out->views);
    if (err)
        sst_log_error("no memory for a picture of %d x %d", cfg->camera.width, cfg->camera.height);
end:
    sst_integral_destroy(integral);
    return err;
}

int sst_posed_render(struct sst_posed_rendered *out, const struct sst_posed *posed, const char *dir,
                     const struct sst_posed_render_config *cfg)
{
    struct sst_posed_rendered made = { 0 };
    int err =
        cfg->method == SST_POSED_REFOCUS ? refocus(&made, posed, dir, cfg) : render_weighted(&made, posed, dir, cfg);

    if (!err && !made.seen) {
        sst_log_error("%s: no view and the camera see the same part of the surface: it is beside or behind them", dir);
        err = -ENODATA;
    }
    if (err)
        sst_posed_rendered_fini(&made);
    else
        *out = made;
    return err;
}

void sst_posed_rendered_fini(struct sst_posed_rendered *rendered)
{
    sst_deep_fini(&rendered->levels);
    sst_map_u16_fini(&rendered->views);
    for (int c = 0; c < 3; c++)
        sst_map_f32_fini(&rendered->mean[c]);
}
