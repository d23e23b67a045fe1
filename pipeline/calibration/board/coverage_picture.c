/* Coverage as a picture: one tile for each camera at its grid position. */
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

static void put(struct sst_image *img, int x, int y, uint32_t colour)
{
    if (x < 0 || y < 0 || x >= img->width || y >= img->height)
        return;
    for (int c = 0; c < 3; c++)
        sst_image_row(img, c, y)[x] = (uint8_t)(colour >> (16 - 8 * c));
}

static void fill(struct sst_image *img, int x, int y, int width, int height, uint32_t colour)
{
    for (int j = y; j < y + height; j++) {
        for (int i = x; i < x + width; i++)
            put(img, i, j, colour);
    }
}

static void outline(struct sst_image *img, int x, int y, int width, int height, uint32_t colour)
{
    fill(img, x, y, width, 1, colour);
    fill(img, x, y + height - 1, width, 1, colour);
    fill(img, x, y, 1, height, colour);
    fill(img, x + width - 1, y, 1, height, colour);
}

static int text_width(const char *text, int zoom)
{
    return (int)strlen(text) * SST_FONT_WIDTH * zoom - zoom;
}

static void write(struct sst_image *img, int x, int y, const char *text, int zoom, uint32_t colour)
{
    for (int j = 0; j < SST_FONT_HEIGHT * zoom; j++) {
        for (int i = 0; i < text_width(text, zoom); i++) {
            if (sst_font_dot(text, i / zoom, j / zoom))
                put(img, x + i, y + j, colour);
        }
    }
}

/* Symbol of a tilted board: its near side is drawn longer. */
static void tilt_sign(struct sst_image *img, int x, int y, int size, int tilt, uint32_t colour)
{
    for (int j = 0; j < size; j++) {
        for (int i = 0; i < size; i++) {
            const double u = (i + 0.5) / size - 0.5, v = (j + 0.5) / size - 0.5;
            const double along = tilt == 1 ? u : tilt == 2 ? -u : tilt == 3 ? v : tilt == 4 ? -v : 0.5; /* to near */
            const double half = tilt ? 0.36 + 0.28 * along : 0.4, depth = tilt ? 0.26 : 0.4;
            const double across = tilt == 0 || tilt > 2 ? u : v, other = tilt == 0 || tilt > 2 ? v : u;

            if (fabs(across) <= half && fabs(other) <= depth)
                put(img, x + i, y + j, colour);
        }
    }
}

/* --- a tile ------------------------------------------------------------------------------------------------------ */

struct layout {
    int tile_width, tile_height, picture_width, picture_height, zoom, foot;
};

static void draw_cells(struct sst_image *img, int x0, int y0, const struct layout *l, const struct sst_coverage *c)
{
    for (int row = 0; row < SST_COVERAGE_CELLS; row++) {
        for (int col = 0; col < SST_COVERAGE_CELLS; col++) {
            const int left = col * l->picture_width / SST_COVERAGE_CELLS;
            const int top = row * l->picture_height / SST_COVERAGE_CELLS;
            const int right = (col + 1) * l->picture_width / SST_COVERAGE_CELLS;
            const int bottom = (row + 1) * l->picture_height / SST_COVERAGE_CELLS;
            const int n = c->cell[row][col];
            const uint32_t colour = !sst_coverage_cell_done(c, row, col) ? missing
                                                                         : covered[n < 20   ? 0
                                                                                   : n < 60 ? 1
                                                                                            : 2];

            fill(img, x0 + left, y0 + top, right - left - 1, bottom - top - 1, colour);
        }
    }
}

static void draw_corners(struct sst_image *img, int x0, int y0, const struct layout *l,
                         const struct sst_detections *all, int view)
{
    for (int i = 0; i < all->count; i++) {
        const struct sst_detection *d = &all->detection[i];

        for (int k = 0; d->view == view && k < d->corners; k++) {
            const double x = (d->corner[k].x + 0.5) * l->picture_width / all->width;
            const double y = (d->corner[k].y + 0.5) * l->picture_height / all->height;

            if (x >= 0 && y >= 0 && x < l->picture_width - 1 && y < l->picture_height - 1)
                put(img, x0 + (int)x, y0 + (int)y, dot);
        }
    }
}

/* Below the picture: tilts, then depth ratio and frames where there is room. */
static void draw_foot(struct sst_image *img, int x, int y, const struct layout *l, const struct sst_coverage *c)
{
    const int size = l->foot, high = y + (size - SST_FONT_HEIGHT * l->zoom) / 2;
    const double ratio = sst_coverage_depth_ratio(c);
    char text[32];
    int at = x;

    for (int i = 0; i < SST_COVERAGE_TILTS; i++, at += size + 2)
        tilt_sign(img, at, y, size, i, c->tilt[i] ? 0x4B8F5B : missing_ink);
    if (ratio > 0)
        snprintf(text, sizeof(text), "DEPTH %.1f", floor(10 * ratio) / 10);
    else
        snprintf(text, sizeof(text), "DEPTH -");
    at += 4;
    if (at + text_width(text, l->zoom) > x + l->picture_width)
        return;
    write(img, at, high, text, l->zoom, ratio >= SST_COVERAGE_RATIO ? faint : missing_ink);
    at += text_width(text, l->zoom) + 8;
    snprintf(text, sizeof(text), "%d FRAME%s", c->frames, c->frames == 1 ? "" : "S");
    if (at + text_width(text, l->zoom) <= x + l->picture_width)
        write(img, x + l->picture_width - text_width(text, l->zoom), high, text, l->zoom,
              c->frames >= SST_COVERAGE_FRAMES ? faint : missing_ink);
}

static void draw_tile(struct sst_image *img, int x, int y, const struct layout *l, const struct sst_detections *all,
                      const struct sst_coverage *c, int view)
{
    const int inner_x = x + PADDING, name_y = y + PADDING, line = SST_FONT_HEIGHT * l->zoom;
    const int picture_y = name_y + line + 5;
    char name[64], share[16];
    int room;

    fill(img, x, y, l->tile_width, l->tile_height, card);
    outline(img, x, y, l->tile_width, l->tile_height, frame);
    snprintf(share, sizeof(share), "%d of 100", (int)floor(100 * sst_coverage_share(&c[view]) + 1e-9));
    snprintf(name, sizeof(name), "%s", all->camera_name[view]);
    room = (l->picture_width - text_width(share, l->zoom) - 6) / (SST_FONT_WIDTH * l->zoom);
    if ((int)strlen(name) > room) /* keep the end: serials and ports begin alike */
        memmove(name, name + strlen(name) - (size_t)sst_max_int(room, 0), (size_t)sst_max_int(room, 0) + 1);
    write(img, inner_x, name_y, name, l->zoom, ink);
    write(img, inner_x + l->picture_width - text_width(share, l->zoom), name_y, share, l->zoom,
          sst_coverage_share(&c[view]) > 0.999 ? 0x2E7D43 : missing_ink);
    draw_cells(img, inner_x, picture_y, l, &c[view]);
    draw_corners(img, inner_x, picture_y, l, all, view);
    draw_foot(img, inner_x, picture_y + l->picture_height + 4, l, &c[view]);
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
    write(img, EDGE, EDGE, text, zoom, ink);
    snprintf(text, sizeof(text), "red is missing");
    if (2 * EDGE + text_width(text, zoom) + SST_FONT_WIDTH * zoom * 34 < img->width)
        write(img, img->width - EDGE - text_width(text, zoom), EDGE, text, zoom, missing_ink);
}

int sst_coverage_picture(struct sst_image *out, const struct sst_detections *all, const struct sst_coverage *coverage)
{
    const struct layout l = plan(all);
    const int err = sst_image_init(out, 2 * EDGE + all->cols * (l.tile_width + GAP) - GAP,
                                   2 * EDGE + HEADING + all->rows * (l.tile_height + GAP) - GAP);

    if (err)
        return err;
    fill(out, 0, 0, out->width, out->height, paper);
    draw_heading(out, all, coverage);
    for (int view = 0; view < all->rows * all->cols; view++) {
        const int x = EDGE + view % all->cols * (l.tile_width + GAP);
        const int y = EDGE + HEADING + view / all->cols * (l.tile_height + GAP);

        if (*all->camera_name[view])
            draw_tile(out, x, y, &l, all, coverage, view);
        else
            outline(out, x, y, l.tile_width, l.tile_height, hole);
    }
    return 0;
}
