/* Pictures of the maps: labels over the lead view, and disparities by colour. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>

#include "pipeline/live/live_internal.h"

#define LABEL_STEP   2 /* pixels counted for a label's disparity: every second of every second row */
#define LABEL_SHARE  (1 / 2000.0)
#define COLOUR_SHARE 160 /* of 256: opacity of a label's colour */
#define COLOURS      256

int sst_livepicture_label_disparity(const struct sst_live *live, int label, double *disp_px)
{
    const int lead = sst_render_lead_view(&live->lf);
    const struct sst_view *v = lead < 0 ? NULL : &live->lf.views[lead];
    uint32_t count[SST_BLEND_COLUMNS] = { 0 }, total = 0, below = 0;
    int c = 0;

    if (!live->ready || !v || !v->label.data || label < 1 || label > 255)
        return -ENODATA;
    for (int y = 0; y < v->disp.height; y += LABEL_STEP) {
        const uint16_t *d = sst_map_u16_row(&v->disp, y);
        const uint8_t *l = sst_map_u8_row(&v->label, y);

        for (int x = 0; x < v->disp.width; x += LABEL_STEP) {
            if (l[x] == label && d[x] != SST_DISP_NONE) {
                count[d[x] >> SST_BLEND_COLUMN_SHIFT]++;
                total++;
            }
        }
    }
    if (!total || total < LABEL_SHARE * v->disp.width * v->disp.height / (LABEL_STEP * LABEL_STEP))
        return -ENODATA;
    while (2 * (below + count[c]) < total)
        below += count[c++];
    /* Interpolated inside the column of 1/4 px. */
    *disp_px =
        live->lf.disp_min_px + (c + (0.5 * total - below) / count[c]) * (1 << SST_BLEND_COLUMN_SHIFT) / SST_DISP_SCALE;
    return 0;
}

/* --- colours ------------------------------------------------------------------------------------------------------ */

static uint8_t srgb(double linear)
{
    const double v = sst_clamp_double(linear, 0, 1);

    return (uint8_t)(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055) + 0.5);
}

/* A colour of Oklab (Ottosson 2020): lightness 0..1, and chroma at an angle. */
static void oklch(uint8_t rgb[3], double lightness, double chroma, double angle)
{
    const double a = chroma * cos(angle), b = chroma * sin(angle);
    const double l = pow(lightness + 0.3963377774 * a + 0.2158037573 * b, 3);
    const double m = pow(lightness - 0.1055613458 * a - 0.0638541728 * b, 3);
    const double s = pow(lightness - 0.0894841775 * a - 1.2914855480 * b, 3);

    rgb[0] = srgb(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s);
    rgb[1] = srgb(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s);
    rgb[2] = srgb(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s);
}

/* Far to near: from a dark violet over blue, green to a light yellow; lightness grows evenly, so that steps of
 * disparity look alike anywhere, in print, and with red-green colour blindness. */
static void colour_scale(uint8_t rgb[COLOURS][3])
{
    for (int i = 0; i < COLOURS; i++) {
        const double t = i / (COLOURS - 1.0);

        oklch(rgb[i], 0.28 + 0.65 * t, 0.12 + 0.05 * t, (310 - 205 * t) * M_PI / 180);
    }
}

static void paint_labels(const struct sst_view *v, struct sst_image *out)
{
    const uint8_t(*palette)[3] = sst_classes_palette();

    for (int y = 0; y < out->height; y++) {
        const uint8_t *label = sst_map_u8_row(&v->label, y);

        for (int c = 0; c < 3; c++) {
            const uint8_t *in = sst_image_row(&v->image, c, y);
            uint8_t *to = sst_image_row(out, c, y);

            for (int x = 0; x < out->width; x++)
                to[x] = label[x] ? (uint8_t)((palette[label[x]][c] * COLOUR_SHARE + in[x] * (256 - COLOUR_SHARE)) >> 8)
                                 : in[x] / 2;
        }
    }
}

static void paint_disparities(const struct sst_lightfield *lf, const struct sst_view *v, double min_px, double max_px,
                              struct sst_image *out)
{
    const double scale = (COLOURS - 1) / fmax(max_px - min_px, 1 / SST_DISP_SCALE);
    uint8_t rgb[COLOURS][3];

    colour_scale(rgb);
    for (int y = 0; y < out->height; y++) {
        const uint16_t *d = sst_map_u16_row(&v->disp, y);

        for (int x = 0; x < out->width; x++) {
            const double at = sst_clamp_double((sst_disp_px(lf, d[x]) - min_px) * scale, 0, COLOURS - 1);

            for (int c = 0; c < 3; c++)
                sst_image_row(out, c, y)[x] = d[x] == SST_DISP_NONE ? 0 : rgb[(int)at][c];
        }
    }
}

int sst_livepicture_overlay(struct sst_live *live, enum sst_livepicture_overlay kind, struct sst_image *out)
{
    const int lead = sst_render_lead_view(&live->lf);
    const struct sst_view *v = lead < 0 ? NULL : &live->lf.views[lead];
    double min_px, max_px;

    if (!live->ready || live->posed || !v || !v->image.plane[0] || !sst_live_range(live, &min_px, &max_px))
        return -ENODATA;
    if (kind == SST_LIVE_LABELS_PICTURE && !v->label.data)
        return -ENODATA;
    if (kind == SST_LIVE_LABELS_PICTURE)
        paint_labels(v, out);
    else
        paint_disparities(&live->lf, v, min_px, max_px, out);
    return 0;
}
