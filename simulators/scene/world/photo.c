/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/world/world_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "simulators/scene/noise.h"

#define CODES   8192  /* resolution of linear light in the conversion to sRGB */
#define NORMALS 65536 /* table of normal random numbers; pixels pick entries at random */

struct sim_photo {
    double vignetting;
    float full_well, read_variance; /* electrons; full_well 0: no noise */
    float light[256];
    uint8_t code[CODES + 1];
    float normal[NORMALS];
};

/* sRGB (IEC 61966-2-1), 0..1. */
static double to_light(double v)
{
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

static double to_code(double light)
{
    return light <= 0.0031308 ? 12.92 * light : 1.055 * pow(light, 1 / 2.4) - 0.055;
}

void sim_light(struct sst_image *img, double factor)
{
    uint8_t table[256];

    for (int i = 0; i < 256; i++)
        table[i] = (uint8_t)(255 * to_code(fmin(1, factor * to_light(i / 255.0))) + 0.5);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < img->height; y++) {
            for (int x = 0; x < img->width; x++)
                sst_image_row(img, c, y)[x] = table[sst_image_row(img, c, y)[x]];
        }
    }
}

int sim_photo_create(struct sim_photo **out, const struct sst_sim_settings *s)
{
    struct sim_photo *p = calloc(1, sizeof(*p));
    uint64_t rng = s->seed ^ 0x6E6F697365ull;

    if (!p)
        return -ENOMEM;
    p->vignetting = s->vignetting;
    p->full_well = (float)s->full_well_e;
    p->read_variance = (float)(s->read_noise_e * s->read_noise_e);
    for (int i = 0; i < 256; i++)
        p->light[i] = (float)to_light(i / 255.0);
    for (int i = 0; i <= CODES; i++)
        p->code[i] = (uint8_t)(255 * to_code((double)i / CODES) + 0.5);
    for (int i = 0; i < NORMALS; i++)
        p->normal[i] = (float)sim_normal(&rng);
    *out = p;
    return 0;
}

static bool is_ideal(const struct sim_photo *p, const struct sim_exposing *e)
{
    return !(p->vignetting > 0) && !(p->full_well > 0) && e->light == 1 && e->camera->gain[0] == 1 &&
           e->camera->gain[1] == 1 && e->camera->gain[2] == 1;
}

/* One row of one colour. @param state  of the noise, never 0 */
static void expose_row(const struct sim_photo *p, const uint8_t *in, uint8_t *out, int width, const float *factor,
                       uint32_t *state)
{
    for (int x = 0; x < width; x++) {
        float light = p->light[in[x]] * factor[x];

        if (p->full_well > 0) {
            /* xorshift32 (Marsaglia 2003) */
            *state ^= *state << 13;
            *state ^= *state >> 17;
            *state ^= *state << 5;
            light += p->normal[*state % NORMALS] * sqrtf(light * p->full_well + p->read_variance) / p->full_well;
        }
        light = light < 0 ? 0 : light > 1 ? 1 : light;
        out[x] = p->code[(int)(light * CODES + 0.5f)];
    }
}

void sim_photo_expose(const struct sim_photo *p, const struct sim_exposing *e, const struct sst_image *in,
                      struct sst_image *out)
{
    const double half_x = in->width / 2.0, half_y = in->height / 2.0;
    float factor[SST_IMAGE_MAX_SIDE];
    uint64_t seed = e->seed;

    for (int c = 0; c < 3; c++) {
        uint32_t state = (uint32_t)sst_random_u64(&seed) | 1;

        for (int y = 0; y < in->height; y++) {
            const double dy = y - e->camera->cy;

            if (is_ideal(p, e)) {
                memmove(sst_image_row(out, c, y), sst_image_row(in, c, y), (size_t)in->width);
                continue;
            }
            for (int x = 0; x < in->width; x++) {
                const double dx = x - e->camera->cx;
                const double r2 = (dx * dx + dy * dy) / (half_x * half_x + half_y * half_y);

                factor[x] = (float)(e->light * e->camera->gain[c] * (1 - p->vignetting * r2));
            }
            expose_row(p, sst_image_row(in, c, y), sst_image_row(out, c, y), in->width, factor, &state);
        }
    }
}
