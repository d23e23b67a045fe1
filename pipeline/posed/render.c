#include "pipeline/posed/render.h"

#include <errno.h>

#include "base/log.h"
#include "pipeline/posed/clear.h"
#include "pipeline/posed/integral.h"

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
    const int err = cfg->method == SST_POSED_REFOCUS ? refocus(&made, posed, dir, cfg)
                                                     : sst_posed_render_weighted(&made, posed, dir, cfg);

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
