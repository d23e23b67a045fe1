/* Pictures on the surface, whole when a view or the surface has changed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/live/posed/posed_internal.h"

#include <errno.h>
#include <math.h>
#include <string.h>

void sst_liveposed_picture_fini(struct sst_liveposed_picture *picture)
{
    sst_image_fini(&picture->image);
    *picture = (struct sst_liveposed_picture){ 0 };
}

static bool same_surface(const struct sst_surface *a, const struct sst_surface *b)
{
    return !memcmp(a->normal, b->normal, sizeof(a->normal)) && !memcmp(&a->offset_mm, &b->offset_mm, sizeof(double));
}

/* Places on a surface, in place of the surface that was longest unused. */
static int find_places(struct sst_integral_places **out, struct sst_liveposed *p, const struct sst_surface *surface)
{
    struct posed_places *oldest = &p->places[0];
    int err;

    for (int i = 0; i < POSED_PLACES; i++) {
        struct posed_places *at = &p->places[i];

        if (at->places && same_surface(&at->surface, surface)) {
            at->used = p->serial;
            *out = at->places;
            return 0;
        }
        if (oldest->places && (!at->places || at->used < oldest->used))
            oldest = at;
    }
    sst_integral_places_destroy(oldest->places);
    oldest->places = NULL;
    err = sst_integral_places_create(&oldest->places, &p->camera, surface, &p->all, p->cfg->threads);
    oldest->surface = *surface;
    oldest->used = p->serial;
    *out = oldest->places;
    return err;
}

static int refocus(struct sst_deep *out, struct sst_liveposed *p, const struct sst_surface *surface,
                   const struct sst_integral_places *places)
{
    const struct sst_deep *picture[SST_MAX_VIEWS];
    int view[SST_MAX_VIEWS], n = 0, err = 0;

    if (!p->integral)
        err = sst_integral_create(&p->integral, &p->camera, surface, p->all.channels, p->cfg->threads);
    if (err)
        return err;
    sst_integral_restart(p->integral, NULL);
    for (int k = 0; k < p->now.count; k++) {
        if (!p->now.view[k].camera.known)
            continue;
        view[n] = k;
        picture[n++] = &p->picture[k];
    }
    err = sst_integral_add_at(p->integral, places, view, picture, n);
    return err ? err : sst_integral_levels(out, p->integral);
}

static double seen_of(const struct sst_map_u16 *views)
{
    int64_t n = 0;

    for (int y = 0; y < views->height; y++) {
        for (int x = 0; x < views->width; x++)
            n += sst_map_u16_row(views, y)[x] > 0;
    }
    return (double)n / ((double)views->width * views->height);
}

static int weighted(struct sst_deep *out, double *seen, struct sst_liveposed *p,
                    const struct sst_posed_render_config *cfg)
{
    struct sst_posed_rendered made;
    const int err = sst_posed_render(&made, &p->now, "live", cfg);

    if (err)
        return err;
    *seen = seen_of(&made.views);
    *out = made.levels;
    made.levels = (struct sst_deep){ 0 };
    sst_posed_rendered_fini(&made);
    return 0;
}

static bool is_of(const struct sst_liveposed_picture *picture, const struct sst_liveposed *p,
                  const struct sst_render_config *cfg)
{
    return picture->serial == p->serial && picture->method == cfg->method &&
           (picture->focus_px == cfg->focus_px || (isnan(picture->focus_px) && isnan(cfg->focus_px)));
}

/* A client's picture, kept for others too where it took long. */
static int keep(struct sst_liveposed_picture *to, const struct sst_liveposed_picture *from)
{
    const int width = from->image.width, height = from->image.height;
    struct sst_image copy;
    const int err = sst_image_init(&copy, width, height);

    if (err)
        return err;
    for (int i = 0; i < 3 * height; i++)
        memcpy(sst_image_row(&copy, i % 3, i / 3), sst_image_row(&from->image, i % 3, i / 3), (size_t)width);
    sst_liveposed_picture_fini(to);
    *to = *from;
    to->image = copy;
    return 0;
}

int sst_liveposed_render(struct sst_liveposed *p, struct sst_liveposed_picture *picture,
                         const struct sst_render_config *cfg, int64_t *rendered_px)
{
    const struct sst_surface surface = posed_surface(p, cfg->focus_px);
    struct sst_posed_render_config c = {
        .method = cfg->method == SST_RENDER_CLEAR ? SST_POSED_CLEAR : SST_POSED_THROUGH,
        .camera = p->camera,
        .surface = surface,
        .threads = p->cfg->threads,
        .compare_px = p->cfg->posed.compare_px,
        .near_mm = p->near_mm,
    };
    struct sst_integral_places *places;
    struct sst_image image = { 0 };
    struct sst_deep deep = { 0 };
    double seen = NAN;
    int err;

    *rendered_px = 0;
    if (!sst_posed_placed(&p->now) || (cfg->method != SST_RENDER_REFOCUS && !p->known))
        return -ENODATA;
    if (is_of(picture, p, cfg))
        return 0;
    if (is_of(&p->last, p, cfg)) {
        *rendered_px = (int64_t)p->last.image.width * p->last.image.height;
        return keep(picture, &p->last);
    }
    err = find_places(&places, p, &surface);
    c.places = places;
    if (!err && (cfg->method == SST_RENDER_REFOCUS || sst_posed_placed(&p->now) < 3))
        err = refocus(&deep, p, &surface, places);
    else if (!err)
        err = weighted(&deep, &seen, p, &c);
    err = err ? err : sst_deep_to_image(&image, &deep, (struct sst_samples){ 0 });
    sst_deep_fini(&deep);
    if (err == -ENOMEM)
        sst_log_error("live: no memory for a picture of %d x %d", p->camera.width, p->camera.height);
    if (err)
        return err;
    sst_image_fini(&picture->image);
    *picture = (struct sst_liveposed_picture){ image, p->serial, cfg->method, cfg->focus_px, seen };
    *rendered_px = (int64_t)image.width * image.height;
    return cfg->method == SST_RENDER_REFOCUS ? 0 : keep(&p->last, picture);
}
