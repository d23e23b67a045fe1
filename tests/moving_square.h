/* tests/moving_square.h - a small light field in which a square moves before a wall, followed by pipeline/live/scene.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_MOVING_SQUARE_H
#define SST_TESTS_MOVING_SQUARE_H

#include <stdlib.h>
#include <string.h>

#include "pipeline/live/scene/scene_internal.h"
#include "tests/test.h"

#define WIDTH   256
#define HEIGHT  192
#define TILES_X (WIDTH / SST_LIVE_TILE)
#define TILES_Y (HEIGHT / SST_LIVE_TILE)
#define TILES   (TILES_X * TILES_Y)
#define WALL_PX 4
#define NEAR_PX 12
#define SIDE_PX 60 /* of the square */

static SST_UNUSED uint8_t texture(int x, int y, int seed)
{
    uint32_t h = (uint32_t)(x + 1000) * 73856093u ^ (uint32_t)(y + 1000) * 19349663u ^ (uint32_t)seed * 83492791u;

    h ^= h >> 13;
    h *= 0x5bd1e995u;
    return (uint8_t)(40 + (h >> 15) % 176);
}

static SST_UNUSED bool in_square(int x, int y, int left)
{
    return x >= left && x < left + SIDE_PX && y >= 64 && y < 64 + SIDE_PX;
}

/* The square's left edge is at `left` in the reference view. @return disparity */
static SST_UNUSED int look(const struct sst_view *v, int x, int y, int left, uint8_t colour[3])
{
    const int bx = (int)v->bx, by = (int)v->by;
    const int xs = x + NEAR_PX * bx, ys = y + NEAR_PX * by, xw = x + WALL_PX * bx, yw = y + WALL_PX * by;
    const bool near = in_square(xs, ys, left);

    for (int c = 0; c < 3; c++) /* blocks of 2x2, so that half size still has texture */
        colour[c] = near ? texture((xs - left + 512) / 2, ys / 2, 10 + c) : texture((xw + 512) / 2, (yw + 512) / 2, c);
    return near ? NEAR_PX : WALL_PX;
}

struct field {
    struct sst_lightfield lf;
    struct sst_live_config cfg;
    struct sst_liveframes_changes changes;
    struct sst_livescene *scene;
    struct sst_live_report report;
};

/* Draw the scene; tiles that come out different are the changes. */
static SST_UNUSED void draw(struct field *f, int left)
{
    f->changes.changed = 0;
    f->changes.whole = false;
    for (int view = 0; view < f->lf.rows * f->lf.cols; view++) {
        struct sst_view *v = &f->lf.views[view];

        memset(f->changes.map[view], 0, TILES);
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                uint8_t colour[3];

                look(v, x, y, left, colour);
                for (int c = 0; c < 3; c++) {
                    uint8_t *at = &sst_image_row(&v->image, c, y)[x];

                    if (*at != colour[c])
                        f->changes.map[view][y / SST_LIVE_TILE * TILES_X + x / SST_LIVE_TILE] = 1;
                    *at = colour[c];
                }
            }
        }
        for (int i = 0; i < TILES; i++)
            f->changes.changed += f->changes.map[view][i];
    }
}

static SST_UNUSED void init_field(struct field *f, int rows, int cols)
{
    *f = (struct field){ .cfg = { .rows = rows,
                                  .cols = cols,
                                  .width = WIDTH,
                                  .height = HEIGHT,
                                  .range_min_px = 2,
                                  .range_max_px = 16,
                                  .threads = 2,
                                  .skip_change = true,
                                  .skip_labels = true } };
    assert_int_equal(sst_lightfield_init(&f->lf, rows, cols), 0);
    f->lf.width = WIDTH;
    f->lf.height = HEIGHT;
    f->changes.cols = TILES_X;
    f->changes.rows = TILES_Y;
    for (int view = 0; view < rows * cols; view++) {
        f->lf.views[view].present = true;
        assert_int_equal(sst_image_init(&f->lf.views[view].image, WIDTH, HEIGHT), 0);
        f->changes.map[view] = calloc(TILES, 1);
    }
}

static SST_UNUSED void open_field(struct field *f, int rows, int cols)
{
    init_field(f, rows, cols);
    assert_int_equal(sst_livescene_open(&f->scene, &f->cfg, &f->lf), 0);
}

static SST_UNUSED void close_field(struct field *f)
{
    sst_livescene_close(f->scene);
    for (int view = 0; view < f->lf.rows * f->lf.cols; view++)
        free(f->changes.map[view]);
    sst_lightfield_fini(&f->lf);
}

static SST_UNUSED void update(struct field *f)
{
    assert_int_equal(sst_livescene_update(f->scene, &f->changes, &(const struct sst_live_input){ 0 }, &f->report), 0);
}

/* Share of a view's pixels, in percent, that are off by more than 1 px. */
static SST_UNUSED double bad_share(const struct field *f, int view, int left)
{
    const struct sst_view *v = &f->lf.views[view];
    int bad = 0;

    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            uint8_t colour[3];
            const double d = sst_disp_px(&f->lf, sst_map_u16_row(&v->disp, y)[x]);

            bad += !(fabs(d - look(v, x, y, left, colour)) <= 1);
        }
    }
    return 100.0 * bad / (WIDTH * HEIGHT);
}

#endif
