/* Cost volume of one view in tiles, each with the range of disparities that a coarser map leaves open. Paths of the
 * optimisation go from tile to tile: where the window of disparities changes, what the last one did not have is far. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "pipeline/method/disparity/stage.h"

/* The coarse map is searched this far around a tile, and its disparities are right within this; px of the view. */
#define AROUND 8
#define MARGIN 6

static size_t padded(int steps)
{
    return ((size_t)steps + 31) / 32 * 32;
}

/* Smallest and largest coarse disparity around a tile, in px of the view. @return whether there is one */
static bool coarse_range(const struct sst_coarse *c, const struct sst_tile *t, double *low, double *high)
{
    const struct sst_map_u16 *map = c->disp_q6;
    const int f = c->factor, x0 = sst_max_int(t->x0 - AROUND, 0) / f, y0 = sst_max_int(t->y0 - AROUND, 0) / f;
    const int x1 = sst_min_int((t->x0 + t->width - 1 + AROUND) / f, map->width - 1);
    const int y1 = sst_min_int((t->y0 + t->height - 1 + AROUND) / f, map->height - 1);
    int least = SST_DISP_NONE, most = 0;

    for (int y = y0; y <= y1; y++) {
        const uint16_t *d = sst_map_u16_row(map, y);

        for (int x = x0; x <= x1; x++) {
            least = sst_min_int(least, d[x]);
            most = d[x] == SST_DISP_NONE ? most : sst_max_int(most, d[x]);
        }
    }
    *low = f * (c->disp_min + least / 64.0);
    *high = f * (c->disp_min + most / 64.0);
    return least <= most;
}

/* The window of disparities of a tile: as much of the whole range as its registers hold. */
static void set_window(struct sst_tile *t, const struct sst_tiles *all, const struct sst_coarse *coarse)
{
    const int range = (all->steps - 1) / all->divisor;
    int first = 0, last = range;
    double low, high;

    if (coarse && coarse_range(coarse, t, &low, &high)) {
        first = sst_clamp_int((int)floor(low) - MARGIN - all->disp_min, 0, range);
        last = sst_clamp_int((int)ceil(high) + MARGIN - all->disp_min, first, range);
    }
    t->steps_padded = padded((last - first) * all->divisor + 1);
    t->steps = sst_min_int((int)t->steps_padded, all->steps);
    t->first = sst_min_int(first, (all->steps - t->steps + all->divisor - 1) / all->divisor);
    t->steps = sst_min_int(t->steps, all->steps - t->first * all->divisor);
}

int sst_tiles_init(struct sst_tiles *all, int width, int top, int height, const struct sst_volume *shape,
                   const struct sst_coarse *coarse)
{
    size_t cells = 0;

    all->columns = (width + SST_TILE_WIDTH - 1) / SST_TILE_WIDTH;
    all->rows = (height + SST_TILE_HEIGHT - 1) / SST_TILE_HEIGHT;
    all->disp_min = shape->disp_min;
    all->steps = shape->steps;
    all->divisor = shape->divisor;
    all->tile = sst_mem_keep(&all->memory[0], (size_t)all->columns * (size_t)all->rows, sizeof(*all->tile));
    if (!all->tile)
        return -ENOMEM;
    for (int i = 0; i < all->columns * all->rows; i++) {
        struct sst_tile *t = &all->tile[i];

        t->x0 = i % all->columns * SST_TILE_WIDTH;
        t->y0 = top + i / all->columns * SST_TILE_HEIGHT;
        t->width = sst_min_int(SST_TILE_WIDTH, width - t->x0);
        t->height = sst_min_int(SST_TILE_HEIGHT, top + height - t->y0);
        set_window(t, all, coarse);
        t->cells = cells;
        cells += (size_t)t->width * (size_t)t->height * t->steps_padded;
    }
    /* One block: of the smaller half alone each page would be a fault of its own. */
    all->sum = sst_mem_keep(&all->memory[1], cells, sizeof(*all->sum) + sizeof(*all->cost));
    all->cost = (uint8_t *)(all->sum + cells);
    return all->sum ? 0 : -ENOMEM;
}

int sst_tiles_fill(struct sst_tiles *all, const struct sst_tile *t, struct sst_volume *v,
                   const struct sst_descriptor *ref, const struct sst_neighbour *neighbours, int count,
                   const struct sst_support *support, int rounds)
{
    const int halo = SST_TILE_HALO(rounds), left = sst_max_int(t->x0 - halo, 0), top = sst_max_int(t->y0 - halo, 0);
    const int right = sst_min_int(t->x0 + t->width + halo, ref->width);
    const int bottom = sst_min_int(t->y0 + t->height + halo, ref->height);
    const size_t row = (size_t)t->width * t->steps_padded;
    int err;

    v->disp_min = all->disp_min + t->first;
    v->steps = t->steps;
    v->steps_padded = t->steps_padded;
    sst_volume_window(v, left, top, right - left, bottom - top);
    if (!rounds && count == 1 && sst_volume_fill_left(v, ref, neighbours, all->cost + t->cells, (size_t)t->width))
        return 0;
    sst_volume_fill(v, ref, neighbours, count);
    err = sst_disparity_support_aggregate(v, support, rounds);
    for (int y = t->y0; !err && y < t->y0 + t->height; y++) {
        const size_t at = (size_t)(y - top) * v->width_padded + (size_t)(t->x0 - left);

        memcpy(all->cost + sst_tile_cells(t, y), v->cost + at * t->steps_padded, row);
    }
    return err;
}

int sst_tiles_winner(const struct sst_tiles *all, const struct sst_tile *t, struct sst_map_u16 *disp_q6,
                     struct sst_map_u8 *confidence, struct sst_mem_kept *scratch)
{
    struct sst_map_u16 disp = { t->width, t->height, disp_q6->stride, sst_map_u16_row(disp_q6, t->y0) + t->x0 };
    struct sst_map_u8 conf = { 0 };
    struct sst_volume v = { .width = t->width,
                            .height = t->height,
                            .width_padded = (size_t)t->width,
                            .steps = t->steps,
                            .steps_padded = t->steps_padded,
                            .divisor = all->divisor,
                            .sum = all->sum + t->cells,
                            .lines = *scratch };
    int err;

    if (confidence)
        conf =
            (struct sst_map_u8){ t->width, t->height, confidence->stride, sst_map_u8_row(confidence, t->y0) + t->x0 };
    err = sst_volume_winner(&v, false, &disp, confidence ? &conf : NULL);
    *scratch = v.lines;
    for (int y = 0; !err && t->first && y < t->height; y++) {
        uint16_t *d = sst_map_u16_row(&disp, y);

        for (int x = 0; x < t->width; x++)
            d[x] = (uint16_t)(d[x] + 64 * t->first);
    }
    return err;
}

double sst_tiles_share(const struct sst_tiles *all)
{
    double searched = 0, whole = 0;

    for (int i = 0; i < all->columns * all->rows; i++) {
        const double pixels = (double)all->tile[i].width * all->tile[i].height;

        searched += pixels * all->tile[i].steps;
        whole += pixels * all->steps;
    }
    return searched / whole;
}

void sst_tiles_fini(struct sst_tiles *all)
{
    for (size_t i = 0; i < ARRAY_LEN(all->memory); i++)
        sst_mem_kept_fini(&all->memory[i]);
    *all = (struct sst_tiles){ 0 };
}

/* A pixel's path costs, as those of a tile whose window begins `shift` steps later: see sst_sgm_across_row_fn. */
static void move_window(uint16_t *to, size_t to_steps, const uint16_t *from, size_t from_steps, int shift)
{
    const int begin = sst_clamp_int(-shift, 0, (int)to_steps);
    const int end = sst_clamp_int((int)from_steps - shift, begin, (int)to_steps);

    for (int d = 0; d < begin; d++)
        to[d] = SST_SGM_FAR;
    if (end > begin)
        memcpy(to + begin, from + begin + shift, (size_t)(end - begin) * sizeof(*to));
    for (int d = end; d < (int)to_steps; d++)
        to[d] = SST_SGM_FAR;
    to[-2] = from[-2];
    to[-1] = to[to_steps] = SST_SGM_FAR;
}

static size_t entry_of(const struct sst_tile *t)
{
    return t->steps_padded + 2 * SST_SGM_PAD;
}

static int steps_between(const struct sst_tiles *all, const struct sst_tile *to, const struct sst_tile *from)
{
    return (to->first - from->first) * all->divisor;
}

/* Rows y .. y + rows - 1 of a row of tiles. */
struct rows_of_tiles {
    const struct sst_tile *tile; /* [columns] */
    int y, rows, width;
    const uint8_t *penalty; /* [rows][width] */
    uint16_t *lines;        /* two times SST_SGM_ROWS rows of paths, of `line` elements each */
    size_t line;
};

/* Paths along rows through a row of tiles. */
static void paths_through(struct sst_tiles *all, const struct rows_of_tiles *in,
                          const struct sst_disparity_sgm_penalties *p, int dir)
{
    const struct sst_tile *last = NULL;
    const int rows = in->rows;

    for (int i = 0; i < all->columns; i++) {
        const struct sst_tile *t = &in->tile[dir > 0 ? i : all->columns - 1 - i];
        const size_t entry = entry_of(t), n = (size_t)t->width, at = sst_tile_cells(t, in->y);
        uint16_t *own = in->lines + (size_t)(i % 2) * SST_SGM_ROWS * in->line;
        const uint16_t *from = in->lines + (size_t)((i + 1) % 2) * SST_SGM_ROWS * in->line;

        for (size_t r = 0; r < (size_t)rows; r++) {
            uint16_t *before = own + (r * (n + 2) + (dir > 0 ? 0 : n + 1)) * entry;

            if (last)
                move_window(before + SST_SGM_PAD, t->steps_padded,
                            from +
                                (r * ((size_t)last->width + 2) + (dir > 0 ? (size_t)last->width : 1)) * entry_of(last) +
                                SST_SGM_PAD,
                            last->steps_padded, steps_between(all, t, last));
            else
                memset(before, 0, entry * sizeof(*before));
        }
        sst_kernels_get()->sgm_along_rows(own, all->sum + at, all->cost + at, n * t->steps_padded, in->penalty + t->x0,
                                          (size_t)in->width, p->p1, p->p2, dir, dir > 0, (size_t)rows, n,
                                          t->steps_padded);
        last = t;
    }
}

static size_t line_elements(const struct sst_tiles *all)
{
    return (SST_TILE_WIDTH + 2) * (padded(all->steps) + 2 * SST_SGM_PAD);
}

int sst_tiles_paths_along(struct sst_tiles *all, const struct sst_image *img,
                          const struct sst_disparity_sgm_penalties *p, int row, struct sst_mem_kept *scratch)
{
    const size_t line = line_elements(all);
    const struct sst_tile *first = &all->tile[(size_t)row * (size_t)all->columns];
    const int w = img->width;
    uint16_t *lines = sst_mem_keep(scratch, (2 * line + (size_t)w) * SST_SGM_ROWS, sizeof(*lines));
    uint8_t *penalty = (uint8_t *)(lines + 2 * SST_SGM_ROWS * line);

    if (!lines)
        return -ENOMEM;
    for (int y = first->y0; y < first->y0 + first->height; y += SST_SGM_ROWS) {
        const int rows = sst_min_int(SST_SGM_ROWS, first->y0 + first->height - y);

        for (int dir = 1; dir >= -1; dir -= 2) {
            for (int r = 0; r < rows; r++) {
                uint8_t *to = penalty + (size_t)r * (size_t)w;

                to[dir > 0 ? 0 : w - 1] = 0;
                sst_disparity_colour_step(to + (dir > 0), img, (struct sst_pixel){ dir > 0, y + r },
                                          (struct sst_pixel){ dir < 0, y + r }, w - 1);
            }
            paths_through(all, &(struct rows_of_tiles){ first, y, rows, w, penalty, lines, line }, p, dir);
        }
    }
    return 0;
}

/* A row of paths as the next tile's. */
static void move_line(uint16_t *to, const struct sst_tile *t, const uint16_t *from, const struct sst_tile *last,
                      int shift)
{
    for (size_t x = 1; x <= (size_t)t->width; x++)
        move_window(to + x * entry_of(t) + SST_SGM_PAD, t->steps_padded, from + x * entry_of(last) + SST_SGM_PAD,
                    last->steps_padded, shift);
}

int sst_tiles_paths_down(struct sst_tiles *all, const struct sst_image *img,
                         const struct sst_disparity_sgm_penalties *p, int column, struct sst_mem_kept *scratch)
{
    const size_t line = line_elements(all);
    uint16_t *lines = sst_mem_keep(scratch, 2 * line + SST_TILE_WIDTH, sizeof(*lines));
    uint8_t *penalty = (uint8_t *)(lines + 2 * line);

    if (!lines)
        return -ENOMEM;
    for (int dir = 1; dir >= -1; dir -= 2) {
        const struct sst_tile *last = NULL;
        uint16_t *now = lines, *before = lines + line, *swap;

        memset(before, 0, line * sizeof(*before));
        for (int i = 0; i < all->rows; i++) {
            const struct sst_tile *t = &all->tile[(dir > 0 ? i : all->rows - 1 - i) * all->columns + column];

            if (last && (t->first != last->first || t->steps_padded != last->steps_padded)) {
                move_line(now, t, before, last, steps_between(all, t, last));
                swap = now, now = before, before = swap;
            }
            for (int j = 0; j < t->height; j++) {
                const int y = t->y0 + (dir > 0 ? j : t->height - 1 - j);
                const size_t at = sst_tile_cells(t, y);

                if (y - dir >= 0 && y - dir < img->height)
                    sst_disparity_colour_step(penalty, img, (struct sst_pixel){ t->x0, y },
                                              (struct sst_pixel){ t->x0, y - dir }, t->width);
                else
                    memset(penalty, 0, (size_t)t->width);
                sst_kernels_get()->sgm_across_row(now, before, all->sum + at, all->cost + at, penalty, p->p1, p->p2, 0,
                                                  0, (size_t)t->width, t->steps_padded);
                swap = now, now = before, before = swap;
            }
            last = t;
        }
    }
    return 0;
}
