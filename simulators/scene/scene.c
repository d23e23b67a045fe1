/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/stats.h"
#include "simulators/scene/scene_internal.h"

#define PROBE_WIDTH  320 /* points per side probed for ranges and focal planes */
#define PROBE_HEIGHT 240

static const char *const names[] = {
    "bush", "pedestrian", "transportation", "cell", "humvee", "cd-cases", "cat", "bust", "terrace", NULL
};

static build_fn *const builders[] = { build_bush,     build_pedestrian, build_transportation, build_cell, build_humvee,
                                      build_cd_cases, build_cat,        build_bust,           build_terrace };

void sst_scene_config_defaults(struct sst_scene_config *cfg)
{
    *cfg = (struct sst_scene_config){ .width = 1000, .height = 750, .rows = 6, .cols = 6, .seed = 1 };
    cfg->layers = (struct sst_layers_config){ .cover_percent = -1, .noise = -1, .gain_percent = -1, .jpeg = -1 };
}

const char *const *sst_scene_names(void)
{
    return names;
}

static int find(const char *name)
{
    for (int i = 0; names[i]; i++) {
        if (!strcmp(names[i], name))
            return i;
    }
    sst_log_error("unknown scene `%s`; choose bush, pedestrian, transportation, cell, humvee, cd-cases, cat, bust, "
                  "terrace or layers",
                  name);
    return -EINVAL;
}

static int check(const struct sst_scene_config *c)
{
    if (c->width < 1 || c->height < 1 || c->width > SST_IMAGE_MAX_SIDE || c->height > SST_IMAGE_MAX_SIDE ||
        (size_t)c->width * (size_t)c->height > SST_IMAGE_MAX_PIXELS) {
        sst_log_error("scene size %dx%d is out of range; choose sides of 1 to %d pixels", c->width, c->height,
                      SST_IMAGE_MAX_SIDE);
        return -EINVAL;
    }
    if (c->rows < 1 || c->cols < 1 || c->rows > SST_SCENE_MAX_VIEWS || c->cols > SST_SCENE_MAX_VIEWS / c->rows) {
        sst_log_error("grid %dx%d is out of range; choose at most %d views", c->rows, c->cols, SST_SCENE_MAX_VIEWS);
        return -EINVAL;
    }
    if (!(fabs(c->time_s) <= 1e6)) {
        sst_log_error("scene time %g s is out of range; choose at most a million seconds", c->time_s);
        return -EINVAL;
    }
    return 0;
}

/* Raster settings of one view with all outputs NULL. */
static void scene_raster(const struct sst_scene *s, double bx, double by, unsigned hidden, struct sst_scene_raster *out)
{
    *out = (struct sst_scene_raster){
        .world = &s->world,
        .focal_px = sst_scene_focal_px(s),
        .cx = (s->cfg.width - 1) / 2.0,
        .cy = (s->cfg.height - 1) / 2.0 + s->world.shift * s->cfg.width / 1000,
        .width = s->cfg.width,
        .height = s->cfg.height,
        .step_x = 1,
        .step_y = 1,
        .bx = bx,
        .by = by,
        .hidden = hidden,
    };
}

/* --- ranges and focal planes -------------------------------------------------------------------------------------- */

struct probe {
    struct sst_map_f32 disp;
    struct sst_map_u8 label, owner;
};

static void probe_fini(struct probe *p)
{
    sst_map_f32_fini(&p->disp);
    sst_map_u8_fini(&p->label);
    sst_map_u8_fini(&p->owner);
}

/* Truth on a lattice of points spread evenly over the picture. */
static int probe_view(const struct sst_scene *s, double bx, double by, unsigned hidden, struct probe *p)
{
    struct sst_scene_raster r;
    int err = sst_map_f32_init(&p->disp, PROBE_WIDTH, PROBE_HEIGHT);

    err = err ? err : sst_map_u8_init(&p->label, PROBE_WIDTH, PROBE_HEIGHT);
    err = err ? err : sst_map_u8_init(&p->owner, PROBE_WIDTH, PROBE_HEIGHT);
    if (err)
        return err;
    scene_raster(s, bx, by, hidden, &r);
    r.step_x = (double)r.width / PROBE_WIDTH;
    r.step_y = (double)r.height / PROBE_HEIGHT;
    r.cx -= 0.5 * r.step_x - 0.5; /* the first point is half a step inside the picture's edge */
    r.cy -= 0.5 * r.step_y - 0.5;
    r.width = PROBE_WIDTH;
    r.height = PROBE_HEIGHT;
    r.disp = &p->disp;
    r.label = &p->label;
    r.owner = &p->owner;
    return sst_scene_raster_run(&r);
}

/* The true disparities of a view of layers, at all pixels. */
static int photo_view(const struct sst_scene *s, double bx, double by, struct probe *p)
{
    const int err = sst_map_f32_init(&p->disp, s->cfg.width, s->cfg.height);

    return err ? err
               : photo_render(s->photo, (const double[2]){ bx, by }, false,
                              &(struct sst_scene_maps){ .disp = &p->disp }, NULL);
}

/* The extremes are visible from the corners of the grid; half a pixel of margin covers surfaces between the points. */
static int find_range(struct sst_scene *s)
{
    const int ref_row = (s->cfg.rows - 1) / 2, ref_col = (s->cfg.cols - 1) / 2;
    double lo = HUGE_VAL, hi = 0;

    for (int i = 0; i < 5; i++) {
        const double bx = i == 4 ? 0 : (i & 1 ? s->cfg.cols - 1 : 0) - ref_col;
        const double by = i == 4 ? 0 : (i & 2 ? s->cfg.rows - 1 : 0) - ref_row;
        struct probe p = { 0 };
        const int err = s->photo ? photo_view(s, bx, by, &p) : probe_view(s, bx, by, 0, &p);

        for (int y = 0; !err && y < p.disp.height; y++) {
            for (int x = 0; x < p.disp.width; x++) {
                lo = fmin(lo, sst_map_f32_row(&p.disp, y)[x]);
                hi = fmax(hi, sst_map_f32_row(&p.disp, y)[x]);
            }
        }
        probe_fini(&p);
        if (err)
            return err;
    }
    s->range_min_px = fmax(0, floor(lo - 0.5));
    s->range_max_px = ceil(hi + 0.5);
    return 0;
}

/*
 * Median disparity of the target behind the occluder; if it is not visible there, of the whole target, else of
 * everything.
 */
static double median_behind(const struct probe *front, const struct probe *behind, unsigned bit, int target,
                            float *buffer)
{
    int n = 0;

    for (int wanted = 2; wanted >= 0 && !n; wanted--) {
        for (int y = 0; y < PROBE_HEIGHT; y++) {
            for (int x = 0; x < PROBE_WIDTH; x++) {
                const bool on_target = sst_map_u8_row(&behind->label, y)[x] == target;
                const bool covered = sst_map_u8_row(&front->owner, y)[x] & bit;

                if ((wanted < 1 || on_target) && (wanted < 2 || covered))
                    buffer[n++] = sst_map_f32_row(&behind->disp, y)[x];
            }
        }
    }
    sst_stats_sort_float(buffer, n);
    return buffer[n / 2];
}

static int find_focus(struct sst_scene *s)
{
    float *buffer = sst_mem_alloc_raw((size_t)PROBE_WIDTH * PROBE_HEIGHT, sizeof(*buffer));
    struct probe front = { 0 };
    int err = buffer ? probe_view(s, 0, 0, 0, &front) : -ENOMEM;

    for (int i = 0; i < s->world.occluder_count && !err; i++) {
        struct sst_scene_occluder *o = &s->world.occluders[i];
        struct probe behind = { 0 };

        err = probe_view(s, 0, 0, 1u << i, &behind);
        if (!err)
            o->focus_px = median_behind(&front, &behind, 1u << i, o->target_label, buffer);
        probe_fini(&behind);
    }
    probe_fini(&front);
    sst_mem_free(buffer);
    return err;
}

/* --- public functions --------------------------------------------------------------------------------------------- */

int sst_scene_world_build(struct sst_scene_world *w, const char *name, const struct sst_scene_config *cfg)
{
    const int which = find(name), longest = sst_max_int(cfg->rows, cfg->cols) - 1;
    const int err = which < 0 ? which : check(cfg);

    if (err)
        return err;
    *w = (struct sst_scene_world){ .rng = cfg->seed, .time_s = cfg->time_s };
    builders[which](w);
    /* A finer grid divides the same aperture, so that it stays inside the scene and above the ground. */
    w->spacing_mm *= longest > 5 ? 5.0 / longest : 1;
    if (!w->failed)
        return 0;
    sst_scene_world_fini(w);
    return -ENOMEM;
}

void sst_scene_world_fini(struct sst_scene_world *w)
{
    free(w->surfaces);
    *w = (struct sst_scene_world){ 0 };
}

/* --- layers of photographs ---------------------------------------------------------------------------------------- */

/* The nearest sprite covers the part of its plane that all views see, at most. */
static int check_photo(const struct sst_scene_config *c)
{
    const double margin = 2.0 * sst_max_int(c->rows, c->cols) * (c->width / 480.0 * PHOTO_DISP_MAX + 8);

    if (c->width < 32 || c->height < 32 || (c->width + margin) * (c->height + margin) > 1 << 26) {
        sst_log_error("layers of %dx%d pixels in %dx%d views are out of range; choose --size 640x480 and --grid 6x6",
                      c->width, c->height, c->rows, c->cols);
        return -EINVAL;
    }
    return 0;
}

static int create_photo(struct sst_scene *s, const struct sst_scene_config *cfg)
{
    int err = check(cfg);

    err = err ? err : check_photo(cfg);
    s->world = (struct sst_scene_world){ .focal = 1200, .spacing_mm = 50, .occluder_count = 1 };
    err = err ? err : photo_scene_create(&s->photo, cfg, (cfg->rows - 1) / 2, (cfg->cols - 1) / 2);
    if (err)
        return err;
    s->world.occluders[0] = (struct sst_scene_occluder){ .name = "front",
                                                         .label = s->photo->front_label,
                                                         .target_label = s->photo->target_label,
                                                         .focus_px = s->photo->focus_px };
    return 0;
}

/* --- public functions --------------------------------------------------------------------------------------------- */

int sst_scene_create(struct sst_scene **out, const char *name, const struct sst_scene_config *cfg)
{
    struct sst_scene *s = calloc(1, sizeof(*s));
    const bool photo = !strcmp(name, "layers");
    int err = !s ? -ENOMEM : photo ? create_photo(s, cfg) : sst_scene_world_build(&s->world, name, cfg);

    if (!err) {
        s->cfg = *cfg;
        err = find_range(s);
    }
    if (!err && !photo)
        err = find_focus(s);
    if (err)
        sst_scene_destroy(s);
    else
        *out = s;
    return err;
}

void sst_scene_destroy(struct sst_scene *s)
{
    if (!s)
        return;
    sst_scene_world_fini(&s->world);
    photo_scene_destroy(s->photo);
    free(s);
}

void sst_scene_range(const struct sst_scene *s, double *min_px, double *max_px)
{
    *min_px = s->range_min_px;
    *max_px = s->range_max_px;
}

double sst_scene_focal_px(const struct sst_scene *s)
{
    return s->world.focal * s->cfg.width / 1000;
}

int sst_scene_occluder_count(const struct sst_scene *s)
{
    return s->world.occluder_count;
}

const struct sst_scene_occluder *sst_scene_occluder_at(const struct sst_scene *s, int index)
{
    return index >= 0 && index < s->world.occluder_count ? &s->world.occluders[index] : NULL;
}

int sst_scene_render(const struct sst_scene *s, double bx, double by, unsigned hidden, const struct sst_scene_maps *out)
{
    struct sst_image *image = out->image;
    struct sst_map_f32 *disp = out->disp;
    struct sst_map_u8 *label = out->label;
    const int w = s->cfg.width, h = s->cfg.height;
    struct sst_scene_raster r;

    if ((image && (image->width != w || image->height != h)) || (disp && (disp->width != w || disp->height != h)) ||
        (label && (label->width != w || label->height != h)))
        return -EINVAL;
    if (s->photo)
        return photo_render(s->photo, (const double[2]){ bx, by }, hidden & 1, out, NULL);
    scene_raster(s, bx, by, hidden, &r);
    r.image = image;
    r.disp = disp;
    r.label = label;
    return sst_scene_raster_run(&r);
}

int scene_mask(const struct sst_scene *scene, int occluder, struct sst_map_u8 *mask)
{
    struct sst_scene_raster r;
    int err;

    if (scene->photo)
        return photo_render(scene->photo, (const double[2]){ 0, 0 }, false,
                            &(struct sst_scene_maps){ NULL, NULL, NULL }, mask);
    scene_raster(scene, 0, 0, 0, &r);
    r.owner = mask;
    err = sst_scene_raster_run(&r);
    for (int y = 0; y < mask->height && !err; y++) {
        uint8_t *row = sst_map_u8_row(mask, y);

        for (int x = 0; x < mask->width; x++)
            row[x] = row[x] & 1u << occluder ? 255 : 0;
    }
    return err;
}
