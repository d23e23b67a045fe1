/* The person behind a hedge: flat shapes, or for the scene of worlds a figure that is rendered once in each of the
 * phases of a stride and drawn like a board. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "pipeline/image/classes.h"
#include "simulators/scene/scene_internal.h"

#define PHASES      8
#define TALL        352 /* px of a figure's pictures */
#define WIDE        232
#define FIGURE_MM   1760.0 /* from the ground to the hair */
#define FIGURE_Z_MM 7700.0
#define CAMERA_MM   2000.0 /* above the ground */
#define SWING_RAD   0.48
#define OPAQUE      0xFF000000u

struct hedge_figure {
    uint32_t colour[PHASES][TALL * WIDE]; /* 0xAABBGGRR; A: 255 or 0 */
};

/* --- the figure --------------------------------------------------------------------------------------------------- */

static void dress(struct figure *f, double stride)
{
    *f = (struct figure){
        .base = vec3(0, CAMERA_MM, FIGURE_Z_MM),
        .scale = 1,
        .yaw = 1.45,
        .stride = SWING_RAD * sin(stride),
        .skin = material(sst_scene_paint_fbm, 0xb98262, 0xd9a684, 60),
        .face = material(paint_face, 0xcf9c7a, 0x2b1d16, 40),
        .shirt = material(paint_cloth, 0xa23327, 0xd6b48e, 110),
        .trousers = { paint_cloth, rgb_hex(0x27364f), rgb_hex(0x52678a), 34, 2, NULL },
        .shoes = material(sst_scene_paint_fbm, 0x3a2a20, 0x6e5340, 40),
    };
}

static int render_phase(uint32_t *out, int phase)
{
    struct sst_scene_world w = { .rng = 1, .focal = SST_HEDGE_FOCAL, .spacing_mm = SST_HEDGE_SPACING };
    struct sst_image image = { 0 };
    struct sst_map_u8 label = { 0 };
    struct figure f;
    int err = sst_image_init(&image, WIDE, TALL);

    err = err ? err : sst_map_u8_init(&label, WIDE, TALL);
    sst_scene_begin(&w, SST_LABEL_PEDESTRIAN, 0);
    dress(&f, 2 * M_PI * phase / PHASES);
    add_figure(&w, &f);
    if (!err) {
        const double focal_px = TALL / FIGURE_MM * FIGURE_Z_MM;
        const struct sst_scene_raster r = { .world = &w,
                                            .focal_px = focal_px,
                                            .cx = (WIDE - 1) / 2.0,
                                            .cy = TALL - 1 - focal_px * CAMERA_MM / FIGURE_Z_MM,
                                            .width = WIDE,
                                            .height = TALL,
                                            .step_x = 1,
                                            .step_y = 1,
                                            .image = &image,
                                            .label = &label };

        err = w.failed ? -ENOMEM : sst_scene_raster_run(&r);
    }
    for (int y = 0; y < TALL && !err; y++)
        for (int x = 0; x < WIDE; x++)
            out[y * WIDE + x] =
                sst_map_u8_row(&label, y)[x]
                    ? OPAQUE | hedge_colour(sst_image_row(&image, 0, y)[x], sst_image_row(&image, 1, y)[x],
                                            sst_image_row(&image, 2, y)[x])
                    : 0;
    sst_scene_world_fini(&w);
    sst_image_fini(&image);
    sst_map_u8_fini(&label);
    return err;
}

int hedge_figure_create(struct hedge_figure **out)
{
    struct hedge_figure *f = malloc(sizeof(*f));
    int err = f ? 0 : -ENOMEM;

    for (int i = 0; i < PHASES && !err; i++)
        err = render_phase(f->colour[i], i);
    if (err)
        free(f);
    else
        *out = f;
    return err;
}

/* Opacity and colour of the figure at (u, v), as flat_at(). */
static bool figure_at(const struct hedge_figure *f, const struct sst_hedge_person *p, double u, double v, double rgb[3])
{
    const int phase = (int)((llround(p->stride / (2 * M_PI) * PHASES) % PHASES + PHASES) % PHASES);
    const int x = (int)floor(u * TALL + WIDE / 2.0), y = (int)floor(v * TALL);
    const uint32_t c = x >= 0 && x < WIDE && y >= 0 && y < TALL ? f->colour[phase][y * WIDE + x] : 0;

    for (int k = 0; k < 3; k++)
        rgb[k] = c >> 8 * k & 255;
    return c & OPAQUE;
}

/* --- flat shapes -------------------------------------------------------------------------------------------------- */

/* The colour of a person at (u, v): u across, -0.5..0.5 of the height, v down, 0..1. @return false: nothing there */
static bool flat_at(const struct sst_hedge_person *p, double u, double v, double rgb[3])
{
    const uint32_t k = (uint32_t)p->clothes * 2654435761u;
    const double swing = 0.1 * sin(p->stride);
    const double head = hypot(u / 0.055, (v - 0.075) / 0.075), bent = (v - 0.5) * 2;
    const bool shirt = v > 0.15 && v < 0.53 && fabs(u) < 0.13 - 0.03 * (v - 0.15);
    const bool arm = v > 0.18 && v < 0.5 && fabs(fabs(u) - 0.145) < 0.03;
    const bool legs =
        v >= 0.5 && v <= 1 && (fabs(u - 0.06 + swing * bent) < 0.052 || fabs(u + 0.06 - swing * bent) < 0.052);

    if (head < 1) {
        for (int c = 0; c < 3; c++)
            rgb[c] = v < 0.05 ? 45 : (double[]){ 190, 150, 125 }[c];
        return true;
    }
    if (!shirt && !arm && !legs)
        return false;
    for (int c = 0; c < 3; c++)
        rgb[c] = (legs ? 30 : 25) + ((k >> (legs ? 8 * c + 3 : 8 * c)) & 255) * (legs ? 0.45 : 0.8);
    if (shirt && fmod(v * 40, 2) < 1)
        rgb[0] = rgb[0] * 0.85 + 10;
    return true;
}

/* --- drawing ------------------------------------------------------------------------------------------------------ */

static bool person_at(const struct hedge_figure *f, const struct sst_hedge_person *p, double u, double v, double rgb[3])
{
    return f ? figure_at(f, p, u, v, rgb) : flat_at(p, u, v, rgb);
}

static uint32_t colour_of(const struct hedge_canvas *c, const double rgb[3])
{
    return hedge_colour(c->light * rgb[0], c->light * rgb[1], c->light * rgb[2]);
}

void hedge_person_draw(const struct hedge_canvas *c, const struct sst_hedge_person *p, double bx, double by)
{
    const double x = p->x - p->disp_px * bx, y = p->foot - p->height - p->disp_px * by;
    const double half = p->height / (c->figure ? 3 : 4);
    const int x0 = sst_max_int((int)ceil(x - half), 0);
    const int x1 = sst_min_int((int)floor(x + half), c->width - 1);
    double rgb[3];

    for (int py = sst_max_int((int)ceil(y), 0); py < sst_min_int((int)floor(y + p->height), c->height); py++)
        for (int px = x0; px <= x1; px++)
            if (person_at(c->figure, p, (px - x) / p->height, (py - y) / p->height, rgb))
                c->px[py * c->width + px] = colour_of(c, rgb);
}

double hedge_person_seen(const struct hedge_canvas *c, const struct sst_hedge_person *p)
{
    int64_t all = 0, seen = 0;
    const double x = p->x, y = p->foot - p->height;
    double rgb[3];

    for (int py = 0; py < c->height; py++) {
        for (int px = 0; px < c->width; px++) {
            if (!person_at(c->figure, p, (px - x) / p->height, (py - y) / p->height, rgb))
                continue;
            all++;
            seen += c->px[py * c->width + px] == colour_of(c, rgb);
        }
    }
    return all ? (double)seen / (double)all : 0;
}
