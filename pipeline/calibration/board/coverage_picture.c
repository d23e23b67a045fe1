/* Coverage as a picture: one tile for each camera at its grid position. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/calibration/board/coverage.h"
#include "pipeline/image/font.h"

#define WIDEST   1600 /* px */
#define TILE_MAX 360
#define TILE_MIN 90
#define GAP      8
#define EDGE     16
#define PADDING  6
#define HEADING  (2 * SST_FONT_HEIGHT + 12) /* over the tiles */

static const uint32_t paper = 0xF3F4F6, card = 0xFFFFFF, frame = 0xD5D9DF, ink = 0x1F2933, faint = 0x7B8794;
static const uint32_t missing = 0xF2B8B5, missing_ink = 0xB3261E, hole = 0xE7EAEE, dot = 0x14488C;
static const uint32_t covered[3] = { 0xE3F1E6, 0xC9E6CF, 0xA9D6B3 }; /* a little, more, much */

/* --- drawing ----------------------------------------------------------------------------------------------------- */

static void fill(struct sst_image *img, struct sst_rect part, uint32_t colour)
{
    sst_pen_fill(&(struct sst_pen){ img, colour, 1 }, part);
}

static void outline(struct sst_image *img, struct sst_rect box, uint32_t colour)
{
    fill(img, (struct sst_rect){ box.x0, box.y0, box.x1, box.y0 + 1 }, colour);
    fill(img, (struct sst_rect){ box.x0, box.y1 - 1, box.x1, box.y1 }, colour);
    fill(img, (struct sst_rect){ box.x0, box.y0, box.x0 + 1, box.y1 }, colour);
    fill(img, (struct sst_rect){ box.x1 - 1, box.y0, box.x1, box.y1 }, colour);
}

static int text_width(const char *text, int zoom)
{
    return (int)strlen(text) * SST_FONT_WIDTH * zoom - zoom;
}

/* Symbol of a tilted board in a square: its near side is drawn longer. */
static void tilt_sign(struct sst_image *img, struct sst_rect square, int tilt, uint32_t colour)
{
    const struct sst_pen pen = { img, colour, 1 };
    const int size = square.x1 - square.x0;

    for (int j = 0; j < size; j++) {
        for (int i = 0; i < size; i++) {
            const double u = (i + 0.5) / size - 0.5, v = (j + 0.5) / size - 0.5;
            const double along = tilt == 1 ? u : tilt == 2 ? -u : tilt == 3 ? v : tilt == 4 ? -v : 0.5; /* to near */
            const double half = tilt ? 0.36 + 0.28 * along : 0.4, depth = tilt ? 0.26 : 0.4;
            const double across = tilt == 0 || tilt > 2 ? u : v, other = tilt == 0 || tilt > 2 ? v : u;

            if (fabs(across) <= half && fabs(other) <= depth)
                sst_pen_dot(&pen, square.x0 + i, square.y0 + j);
        }
    }
}

/* --- a tile ------------------------------------------------------------------------------------------------------ */

struct layout {
    int tile_width, tile_height, picture_width, picture_height, zoom, foot;
};

/* One camera's tile, from x, y on. */
struct tile {
    struct sst_image *img;
    const struct layout *l;
    const struct sst_detections *all;
    const struct sst_coverage *c;
    int view, x, y;
};

static void put_text(const struct tile *t, int x, int y, const char *text, uint32_t colour)
{
    sst_pen_text(&(struct sst_pen){ t->img, colour, t->l->zoom }, x, y, text);
}

static void draw_cells(const struct tile *t, int x0, int y0)
{
    const struct layout *l = t->l;

    for (int row = 0; row < SST_COVERAGE_CELLS; row++) {
        for (int col = 0; col < SST_COVERAGE_CELLS; col++) {
            const int left = col * l->picture_width / SST_COVERAGE_CELLS;
            const int top = row * l->picture_height / SST_COVERAGE_CELLS;
            const int right = (col + 1) * l->picture_width / SST_COVERAGE_CELLS;
            const int bottom = (row + 1) * l->picture_height / SST_COVERAGE_CELLS;
            const int n = t->c->cell[row][col];
            const uint32_t colour = !sst_coverage_cell_done(t->c, row, col) ? missing
                                                                         : covered[n < 20   ? 0
                                                                                   : n < 60 ? 1
                                                                                            : 2];

            fill(t->img, (struct sst_rect){ x0 + left, y0 + top, x0 + right - 1, y0 + bottom - 1 }, colour);
        }
    }
}

static void draw_corners(const struct tile *t, int x0, int y0)
{
    const struct sst_pen pen = { t->img, dot, 1 };
    const struct sst_detections *all = t->all;
    const struct layout *l = t->l;

    for (int i = 0; i < all->count; i++) {
        const struct sst_detection *d = &all->detection[i];

        for (int k = 0; d->view == t->view && k < d->corners; k++) {
            const double x = (d->corner[k].x + 0.5) * l->picture_width / all->width;
            const double y = (d->corner[k].y + 0.5) * l->picture_height / all->height;

            if (x >= 0 && y >= 0 && x < l->picture_width - 1 && y < l->picture_height - 1)
                sst_pen_dot(&pen, x0 + (int)x, y0 + (int)y);
        }
    }
}

/* Below the picture: tilts, then depth ratio and frames where there is room. */
static void draw_foot(const struct tile *t, int x, int y)
{
    const struct layout *l = t->l;
    const struct sst_coverage *c = t->c;
    const int size = l->foot, high = y + (size - SST_FONT_HEIGHT * l->zoom) / 2;
    const double ratio = sst_coverage_depth_ratio(c);
    char text[32];
    int at = x;

    for (int i = 0; i < SST_COVERAGE_TILTS; i++, at += size + 2)
        tilt_sign(t->img, (struct sst_rect){ at, y, at + size, y + size }, i, c->tilt[i] ? 0x4B8F5B : missing_ink);
    if (ratio > 0)
        snprintf(text, sizeof(text), "DEPTH %.1f", floor(10 * ratio) / 10);
    else
        snprintf(text, sizeof(text), "DEPTH -");
    at += 4;
    if (at + text_width(text, l->zoom) > x + l->picture_width)
        return;
    put_text(t, at, high, text, ratio >= SST_COVERAGE_RATIO ? faint : missing_ink);
    at += text_width(text, l->zoom) + 8;
    snprintf(text, sizeof(text), "%d FRAME%s", c->frames, c->frames == 1 ? "" : "S");
    if (at + text_width(text, l->zoom) <= x + l->picture_width)
        put_text(t, x + l->picture_width - text_width(text, l->zoom), high, text,
                 c->frames >= SST_COVERAGE_FRAMES ? faint : missing_ink);
}

static void draw_tile(const struct tile *t)
{
    const struct layout *l = t->l;
    const struct sst_rect box = { t->x, t->y, t->x + l->tile_width, t->y + l->tile_height };
    const double covered_share = sst_coverage_share(t->c);
    const int inner_x = t->x + PADDING, name_y = t->y + PADDING, line = SST_FONT_HEIGHT * l->zoom;
    const int picture_y = name_y + line + 5;
    char name[64], share[16];
    int room;

    fill(t->img, box, card);
    outline(t->img, box, frame);
    snprintf(share, sizeof(share), "%d of 100", (int)floor(100 * covered_share + 1e-9));
    snprintf(name, sizeof(name), "%s", t->all->camera_name[t->view]);
    room = (l->picture_width - text_width(share, l->zoom) - 6) / (SST_FONT_WIDTH * l->zoom);
    if ((int)strlen(name) > room) /* keep the end: serials and ports begin alike */
        memmove(name, name + strlen(name) - (size_t)sst_max_int(room, 0), (size_t)sst_max_int(room, 0) + 1);
    put_text(t, inner_x, name_y, name, ink);
    put_text(t, inner_x + l->picture_width - text_width(share, l->zoom), name_y, share,
             covered_share > 0.999 ? 0x2E7D43 : missing_ink);
    draw_cells(t, inner_x, picture_y);
    draw_corners(t, inner_x, picture_y);
    draw_foot(t, inner_x, picture_y + l->picture_height + 4);
}

/* --- the picture ------------------------------------------------------------------------------------------------- */

static struct layout plan(const struct sst_detections *all)
{
    /* Long columns of cameras: smaller tiles keep the picture below the size limit. */
    const int highest = (SST_IMAGE_MAX_SIDE - 4 * EDGE - HEADING) / all->rows - GAP;
    struct layout l;
    int other;

    l.tile_width = sst_clamp_int((WIDEST - 2 * EDGE + GAP) / all->cols - GAP, TILE_MIN, TILE_MAX);
    l.zoom = l.tile_width >= 300 && highest > TILE_MAX ? 2 : 1;
    l.picture_width = l.tile_width - 2 * PADDING;
    l.foot = SST_FONT_HEIGHT * l.zoom + 5;
    other = 2 * PADDING + SST_FONT_HEIGHT * l.zoom + 5 + 4 + l.foot;
    l.picture_height = sst_clamp_int((int)lround((double)l.picture_width * all->height / all->width), 20,
                                     sst_min_int(3 * l.picture_width, highest - other));
    l.tile_height = l.picture_height + other;
    return l;
}

static void draw_heading(struct sst_image *img, const struct sst_detections *all, const struct sst_coverage *coverage)
{
    const int zoom = img->width >= 500 ? 2 : 1;
    char text[128];
    int done = 0, cameras = 0;

    for (int view = 0; view < all->rows * all->cols; view++) {
        cameras += *all->camera_name[view] != 0;
        done += *all->camera_name[view] && sst_coverage_share(&coverage[view]) > 0.999;
    }
    snprintf(text, sizeof(text), "%d of %d cameras have seen enough", done, cameras);
    sst_pen_text(&(struct sst_pen){ img, ink, zoom }, EDGE, EDGE, text);
    snprintf(text, sizeof(text), "red is missing");
    if (2 * EDGE + text_width(text, zoom) + SST_FONT_WIDTH * zoom * 34 < img->width)
        sst_pen_text(&(struct sst_pen){ img, missing_ink, zoom }, img->width - EDGE - text_width(text, zoom), EDGE, text);
}

int sst_coverage_picture(struct sst_image *out, const struct sst_detections *all, const struct sst_coverage *coverage)
{
    const struct layout l = plan(all);
    const int err = sst_image_init(out, 2 * EDGE + all->cols * (l.tile_width + GAP) - GAP,
                                   2 * EDGE + HEADING + all->rows * (l.tile_height + GAP) - GAP);

    if (err)
        return err;
    fill(out, (struct sst_rect){ 0, 0, out->width, out->height }, paper);
    draw_heading(out, all, coverage);
    for (int view = 0; view < all->rows * all->cols; view++) {
        const int x = EDGE + view % all->cols * (l.tile_width + GAP);
        const int y = EDGE + HEADING + view / all->cols * (l.tile_height + GAP);

        if (*all->camera_name[view])
            draw_tile(&(struct tile){ out, &l, all, &coverage[view], view, x, y });
        else
            outline(out, (struct sst_rect){ x, y, x + l.tile_width, y + l.tile_height }, hole);
    }
    return 0;
}
