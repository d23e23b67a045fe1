/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/live/scene/scene_internal.h"

/* One key for this number of views along rows and along columns. */
#define KEY_SPACING 3
/* Steps of half a pixel at half size: see-through weights resolve far coarser differences only. */
#define DIVISOR 2
/* Census between pixels in halves: as fine as the steps. */
#define PHASE_STEP 2
/* Penalties of the semi-global optimisation, equal to the preview preset's. */
#define PENALTY_1 14
#define PENALTY_2 90
#define EDGE_STEP 24
#define PATHS     4

static bool present_at(const struct sst_lightfield *lf, int row, int col)
{
    return row >= 0 && col >= 0 && row < lf->rows && col < lf->cols && lf->views[row * lf->cols + col].present;
}

int scene_neighbours(const struct sst_lightfield *lf, int view, int out[SST_SCENE_NEIGHBOURS])
{
    static const int sides[][2] = {
        { 0, -1 }, { 0, 1 }, { -1, 0 }, { 1, 0 }, { -1, -1 }, { -1, 1 }, { 1, -1 }, { 1, 1 }
    };
    int count = 0;

    for (int i = 0; i < (int)ARRAY_LEN(sides) && count < SST_SCENE_NEIGHBOURS; i++) {
        const int row = view / lf->cols + sides[i][0], col = view % lf->cols + sides[i][1];

        if (present_at(lf, row, col))
            out[count++] = row * lf->cols + col;
    }
    return count;
}

/* The present view with a neighbour that is nearest to a position, within reach; -1: none. Ties: the lower index. */
static int nearest_view(const struct sst_lightfield *lf, int row, int col, int reach)
{
    int best = -1, least = 0;

    for (int r = row - reach; r <= row + reach; r++) {
        for (int c = col - reach; c <= col + reach; c++) {
            const int distance = (r - row) * (r - row) + (c - col) * (c - col);
            int unused[SST_SCENE_NEIGHBOURS];

            if (!present_at(lf, r, c) || (best >= 0 && distance >= least))
                continue;
            if (scene_neighbours(lf, r * lf->cols + c, unused)) {
                best = r * lf->cols + c;
                least = distance;
            }
        }
    }
    return best;
}

static int add_key(int *views, int count, int view)
{
    for (int i = 0; i < count; i++) {
        if (views[i] == view)
            return count;
    }
    if (view < 0 || count == SST_SCENE_KEYS)
        return count;
    views[count] = view;
    return count + 1;
}

int scene_choose_keys(const struct sst_lightfield *lf, int views[SST_SCENE_KEYS])
{
    const int down = (lf->rows + KEY_SPACING - 1) / KEY_SPACING, across = (lf->cols + KEY_SPACING - 1) / KEY_SPACING;
    const int ref = lf->ref_view;
    /* If the reference has no present neighbour, use the nearest view that has one. */
    int count = add_key(views, 0, nearest_view(lf, ref / lf->cols, ref % lf->cols, sst_max_int(lf->rows, lf->cols)));

    for (int i = 0; i < down; i++) {
        for (int j = 0; j < across; j++)
            count = add_key(views, count,
                            nearest_view(lf, (2 * i + 1) * lf->rows / (2 * down), (2 * j + 1) * lf->cols / (2 * across),
                                         KEY_SPACING / 2));
    }
    return count;
}

static bool overlap(const struct sst_rect *a, const struct sst_rect *b)
{
    return a->x0 < b->x1 && b->x0 < a->x1 && a->y0 < b->y1 && b->y0 < a->y1;
}

static void join(struct sst_rect *a, const struct sst_rect *b)
{
    a->x0 = sst_min_int(a->x0, b->x0);
    a->y0 = sst_min_int(a->y0, b->y0);
    a->x1 = sst_max_int(a->x1, b->x1);
    a->y1 = sst_max_int(a->y1, b->y1);
}

/* Add a rectangle: joined with the ones that it overlaps, and with the last one when the list is full. */
static int add_rect(struct sst_rect *rects, int count, struct sst_rect r)
{
    for (int i = 0; i < count;) {
        if (!overlap(&rects[i], &r) && count < SST_SCENE_RECTS) {
            i++;
            continue;
        }
        join(&r, &rects[i]);
        rects[i] = rects[--count];
        i = 0;
    }
    rects[count] = r;
    return count + 1;
}

int scene_gather(struct sst_rect rects[SST_SCENE_RECTS], struct scene_dirty dirty, int rows, int width, int height)
{
    const int cols = dirty.cols;
    int count = 0;

    for (int y = 0; y < rows; y++) {
        for (int x = 0, end; x < cols; x = end + 1) {
            for (end = x; end < cols && dirty.tiles[y * cols + end] == 1; end++)
                ;
            if (end > x)
                count = add_rect(rects, count, (struct sst_rect){ x - 1, y - 1, end + 1, y + 2 });
        }
    }
    for (int i = 0; i < count; i++) {
        rects[i].x0 = sst_max_int(rects[i].x0 * SST_SCENE_CELLS, 0);
        rects[i].y0 = sst_max_int(rects[i].y0 * SST_SCENE_CELLS, 0);
        rects[i].x1 = sst_min_int(rects[i].x1 * SST_SCENE_CELLS, width);
        rects[i].y1 = sst_min_int(rects[i].y1 * SST_SCENE_CELLS, height);
    }
    return count;
}

double scene_disp_min(double min_px)
{
    return 2 * floor(min_px / 2);
}

int scene_matcher_init(struct scene_matcher *m, double min_px, double max_px, int width, int height)
{
    struct scene_matcher made = { 0 };
    const int first = (int)floor(min_px / 2), last = (int)ceil(max_px / 2);
    int err = sst_volume_init(&made.volume, width, height, first, (last - first) * DIVISOR + 1);

    made.volume.divisor = DIVISOR;
    made.volume.phase_step = PHASE_STEP;
    err = err ? err : sst_map_u16_init(&made.disp, width, height);
    if (err)
        scene_matcher_fini(&made);
    else
        *m = made;
    return err;
}

void scene_matcher_fini(struct scene_matcher *m)
{
    sst_volume_fini(&m->volume);
    sst_map_u16_fini(&m->disp);
}

/* The part of a picture inside a rectangle; borrowed. */
static struct sst_image part_of(const struct sst_image *img, const struct sst_rect *r)
{
    struct sst_image part = { .width = r->x1 - r->x0, .height = r->y1 - r->y0, .stride = img->stride };

    for (int c = 0; c < 3; c++)
        part.plane[c] = sst_image_row(img, c, r->y0) + r->x0;
    return part;
}

/* Copy changed tiles to the key's map; half-size disparities become full-size ones. */
static void store(struct scene_key *key, const struct sst_map_u16 *disp, const struct sst_descriptor *desc,
                  const struct sst_rect *r, struct scene_dirty dirty)
{
    for (int y = r->y0; y < r->y1; y++) {
        const uint16_t *from = sst_map_u16_row(disp, y - r->y0);
        const uint8_t *tiles = dirty.tiles + y / SST_SCENE_CELLS * dirty.cols;
        const uint8_t *seen = desc->seen.data ? sst_map_u8_row(&desc->seen, y) : NULL;
        uint16_t *to = sst_map_u16_row(&key->maps.disp, y);

        for (int x = r->x0; x < r->x1; x++) {
            if (tiles[x / SST_SCENE_CELLS])
                to[x] = seen && !seen[x] ? (uint16_t)SST_DISP_NONE : (uint16_t)(2 * from[x - r->x0]);
        }
    }
}

int scene_match(struct scene_matcher *m, const struct scene_pictures *pictures, struct scene_key *key,
                const struct sst_rect *rect, struct scene_dirty dirty)
{
    static const struct sst_disparity_config cfg = {
        .paths = PATHS, .p1 = PENALTY_1, .p2 = PENALTY_2, .edge_step = EDGE_STEP
    };
    const struct sst_lightfield *lf = pictures->lf;
    const struct sst_descriptor *desc = pictures->desc;
    const struct sst_view *v = &lf->views[key->view];
    const struct sst_image part = part_of(&desc[key->view].image, rect);
    struct sst_neighbour neighbours[SST_SCENE_NEIGHBOURS];
    struct sst_map_u16 disp = m->disp;
    int err;

    for (int i = 0; i < key->neighbours; i++) {
        const int n = key->neighbour[i];

        neighbours[i] = (struct sst_neighbour){ &desc[n], lf->views[n].bx - v->bx, lf->views[n].by - v->by };
    }
    disp.width = part.width;
    disp.height = part.height;
    sst_volume_window(&m->volume, rect->x0, rect->y0, part.width, part.height);
    sst_volume_fill(&m->volume, &desc[key->view], neighbours, key->neighbours);
    err = sst_disparity_sgm(&m->volume, &part, &cfg);
    err = err ? err : sst_volume_winner(&m->volume, false, &disp, NULL);
    err = err ? err : sst_disparity_median5(&disp, &m->volume.lines);
    if (!err)
        store(key, &disp, &desc[key->view], rect, dirty);
    return err;
}
