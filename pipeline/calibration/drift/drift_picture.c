/* Picture of the drift check: cameras in their grid, coloured by displacement, arrows for shifts, bars for pairs. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/calibration/drift/drift.h"
#include "pipeline/image/font.h"

#define CELL   112  /* px from camera to camera */
#define BOX    64   /* side of a camera */
#define TOP    40   /* for the heading */
#define BOTTOM 44   /* for the key */
#define ZOOM   30.0 /* arrows: px per px of shift */
#define BAR    6    /* width of a pair's bar */
#define LEAST  510  /* least width, for the key */

static const uint32_t paper = 0xFAFAF8, ink = 0x1E2024, grey = 0xBEC0C4, lost = 0x78146E, white = 0xFFFFFF;

/* Green at 0, yellow at the limit, red at four times it. */
static uint32_t colour_of(double off_px, double ok_px)
{
    static const double stop[3][3] = { { 62, 152, 84 }, { 236, 190, 50 }, { 204, 48, 40 } };
    const double t = off_px <= ok_px ? off_px / ok_px : 1 + fmin((off_px - ok_px) / (3 * ok_px), 1);
    const int i = t >= 1;
    uint32_t c = 0;

    for (int k = 0; k < 3; k++)
        c = c << 8 | (uint8_t)(stop[i][k] + (t - i) * (stop[i + 1][k] - stop[i][k]) + 0.5);
    return c;
}

/* A box of size w x h. */
static struct sst_rect at(int x, int y, int w, int h)
{
    return (struct sst_rect){ x, y, x + w, y + h };
}

static void fill(struct sst_image *out, struct sst_rect box, uint32_t c)
{
    sst_pen_fill(&(struct sst_pen){ out, c, 1 }, box);
}

static void text(struct sst_image *out, int x, int y, const char *s, uint32_t c)
{
    sst_pen_text(&(struct sst_pen){ out, c, 1 }, x, y, s);
}

static void text_middle(struct sst_image *out, int x, int y, const char *s, uint32_t c)
{
    text(out, x - (int)strlen(s) * SST_FONT_WIDTH / 2, y, s, c);
}

/* A line three pixels wide. */
static void line(struct sst_image *out, double x0, double y0, double x1, double y1)
{
    const int n = (int)ceil(fmax(fabs(x1 - x0), fabs(y1 - y0))) + 1;

    for (int i = 0; i <= n; i++)
        fill(out, at((int)floor(x0 + (x1 - x0) * i / n + 0.5) - 1, (int)floor(y0 + (y1 - y0) * i / n + 0.5) - 1, 3, 3), ink);
}

/* From the middle of a camera; longer ones end at its neighbours. */
static void arrow(struct sst_image *out, double x, double y, double dx, double dy)
{
    const double length = hypot(dx, dy), drawn = fmin(length, 0.75 * CELL);
    double ux, uy, tx, ty;

    if (length < 2) {
        fill(out, at((int)x - 1, (int)y - 1, 3, 3), ink);
        return;
    }
    ux = dx / length;
    uy = dy / length;
    tx = x + ux * drawn;
    ty = y + uy * drawn;
    line(out, x, y, tx, ty);
    if (drawn > 5) {
        line(out, tx, ty, tx - 6 * ux + 4 * uy, ty - 6 * uy - 4 * ux);
        line(out, tx, ty, tx - 6 * ux - 4 * uy, ty - 6 * uy + 4 * ux);
    }
}

static void draw_pair(struct sst_image *out, const struct sst_drift *check, const struct sst_drift_pair *p)
{
    const int x0 = p->a % check->cols * CELL + CELL / 2, y0 = p->a / check->cols * CELL + CELL / 2 + TOP;
    const int x1 = p->b % check->cols * CELL + CELL / 2, y1 = p->b / check->cols * CELL + CELL / 2 + TOP;
    uint32_t c = grey;

    if (p->state == SST_DRIFT_PAIR_MEASURED)
        c = colour_of(fabs(p->mean_px), check->ok_px);
    else if (p->state == SST_DRIFT_PAIR_LOST)
        c = lost;
    if (y0 == y1)
        fill(out, at(x0, y0 - BAR / 2, x1 - x0, BAR), c);
    else
        fill(out, at(x0 - BAR / 2, y0, BAR, y1 - y0), c);
}

static void draw_camera(struct sst_image *out, const struct sst_drift *check, int view)
{
    const struct sst_drift_camera *c = &check->camera[view];
    const int x = view % check->cols * CELL + CELL / 2, y = view / check->cols * CELL + CELL / 2 + TOP;
    char line_of[32];

    if (c->drifted)
        fill(out, at(x - BOX / 2 - 3, y - BOX / 2 - 3, BOX + 6, BOX + 6), ink);
    fill(out, at(x - BOX / 2, y - BOX / 2, BOX, BOX), c->lost ? lost : c->known ? colour_of(c->off_px, check->ok_px) : grey);
    snprintf(line_of, sizeof(line_of), "%02d_%02d", view / check->cols, view % check->cols);
    text_middle(out, x, y - BOX / 2 + 3, line_of, c->lost ? white : ink);
    if (c->lost)
        snprintf(line_of, sizeof(line_of), "LOST");
    else if (c->known)
        snprintf(line_of, sizeof(line_of), "%.2f PX", c->off_px);
    else
        snprintf(line_of, sizeof(line_of), "-");
    text_middle(out, x, y + BOX / 2 - 10, line_of, c->lost ? white : ink);
}

static void draw_key(struct sst_image *out, const struct sst_drift *check)
{
    const int y = out->height - BOTTOM + 8, width = 276;
    char value[32];

    for (int x = 0; x < width; x++)
        fill(out, at(12 + x, y, 1, 12), colour_of(4.0 * check->ok_px * x / width, check->ok_px));
    for (int i = 0; i <= 4; i++) {
        snprintf(value, sizeof(value), "%.2f", i * check->ok_px);
        text(out, 12 + width * i / 4 - (i ? i == 4 ? 24 : 12 : 0), y + 18, value, ink);
    }
    text(out, 12 + width + 16, y + 2, "PX OFF. ARROWS: SHIFTS TIMES 30.", ink);
    text(out, 12 + width + 16, y + 16, "FRAMED: DRIFTED. GREY: UNKNOWN.", ink);
}

int sst_drift_picture(struct sst_image *out, const struct sst_drift *check)
{
    char figures[96] = "NOTHING MEASURED";
    int err = sst_image_init(out, sst_max_int(check->cols * CELL, LEAST), check->rows * CELL + TOP + BOTTOM);

    if (err)
        return -ENOMEM;
    fill(out, at(0, 0, out->width, out->height), paper);
    sst_pen_text(&(struct sst_pen){ out, ink, 2 }, 12, 8, sst_drift_verdict_name(check->verdict));
    if (check->measured)
        snprintf(figures, sizeof(figures), "EPIPOLAR ERROR: MEAN %.3f P95 %.3f PX", check->mean_px, check->p95_px);
    text(out, 12, 27, figures, ink);
    for (int i = 0; i < check->pairs; i++)
        draw_pair(out, check, &check->pair[i]);
    for (int v = 0; v < check->rows * check->cols; v++)
        draw_camera(out, check, v);
    for (int v = 0; v < check->rows * check->cols; v++) {
        const struct sst_drift_camera *c = &check->camera[v];

        if (c->known)
            arrow(out, v % check->cols * CELL + CELL / 2, v / check->cols * CELL + CELL / 2 + TOP,
                  isnan(c->shift_x_px) ? 0 : ZOOM * c->shift_x_px, isnan(c->shift_y_px) ? 0 : ZOOM * c->shift_y_px);
    }
    draw_key(out, check);
    return 0;
}
