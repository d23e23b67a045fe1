/* The shaders `sgm_path` and `winner`: their references by those of kernels, and their self-tests. */

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"

/* --- references --------------------------------------------------------------------------------------------------- */

/* What the shader is given, and two entries of L with their margins: the last pixel's, this pixel's. */
struct given {
    const struct sst_gpu_sgm *push;
    const struct sst_gpu_tile *tiles;
    const uint32_t *pixel;
    const uint8_t *cost;
    uint16_t *sum, p1[256], p2[256], *line, *other;
    uint32_t *state;
    int dx, dy;
};

static size_t cell_of(const struct sst_gpu_tile *t, int x, int y)
{
    return 4 * (size_t)t->quad + ((size_t)(y - t->top) * (size_t)t->pitch + (size_t)(x - t->left)) * (size_t)t->nd;
}

/* The last pixel's L as one of another tile: steps that it did not have are far. */
static void change_tile(struct given *in, const struct sst_gpu_tile *from, const struct sst_gpu_tile *to)
{
    const uint16_t *was = in->line + SST_SGM_PAD;
    uint16_t *now = in->other + SST_SGM_PAD, *swap = in->line;

    for (int d = -1; d <= to->nd; d++) {
        const int before = to->first + d - from->first;
        const bool has = d >= 0 && d < to->nd && before >= 0 && before < from->nd;

        now[d] = has ? was[before] : SST_SGM_FAR;
    }
    now[-2] = was[-2];
    in->line = in->other;
    in->other = swap;
}

/* The L that the rows before these left for a column, as those of a tile of its own. */
static struct sst_gpu_tile load(struct given *in, int x)
{
    const uint32_t *from = in->state + (size_t)(in->push->load + x) * (in->push->all + 3);
    const uint32_t *window = from + in->push->all;
    uint16_t *to = in->line + SST_SGM_PAD;

    for (uint32_t d = window[0]; d < window[1]; d++)
        to[d - window[0]] = (uint16_t)from[d];
    to[-2] = (uint16_t)window[2];
    return (struct sst_gpu_tile){ .first = (int32_t)window[0], .nd = (int32_t)(window[1] - window[0]) };
}

static void store(const struct given *in, const struct sst_gpu_tile *t, int x)
{
    uint32_t *to = in->state + (size_t)(in->push->store + x) * (in->push->all + 3);
    const uint16_t *from = in->line + SST_SGM_PAD;

    for (int d = 0; d < t->nd; d++)
        to[t->first + d] = from[d];
    to[in->push->all] = (uint32_t)t->first;
    to[in->push->all + 1] = (uint32_t)(t->first + t->nd);
    to[in->push->all + 2] = from[-2];
}

/* @param goes_on  from the rows before these, if that is wanted */
static void follow(struct given *in, int x, int y, bool goes_on)
{
    const struct sst_gpu_sgm *p = in->push;
    const struct sst_gpu_tile *last = NULL;
    struct sst_gpu_tile loaded;
    int before = (y - in->dy) * p->width + x - in->dx;

    if (goes_on && p->load >= 0 && x - in->dx >= 0 && x - in->dx < p->width) {
        loaded = load(in, x - in->dx);
        last = &loaded;
    }
    for (; x >= 0 && y >= p->top && x < p->width && y < p->bottom; x += in->dx, y += in->dy) {
        const int tile = (y - p->top) / p->tile_height * p->columns + x / p->tile_width;
        const struct sst_gpu_tile *t = &in->tiles[tile];
        const size_t nd = (size_t)t->nd, entry = nd + 2 * SST_SGM_PAD, at = cell_of(t, x, y);
        const uint8_t step =
            last ? (uint8_t)gpu_colour_step(in->pixel[y * p->width + x], in->pixel[before]) : (uint8_t)0;

        if (!last)
            memset(in->line, 0, entry * sizeof(*in->line));
        else if (last != t)
            change_tile(in, last, t);
        sst_sgm_along_rows_ref(in->line, in->sum + at, in->cost + at, 0, &step, 0, in->p1, in->p2, 1, p->first, 1, 1,
                               nd);
        memcpy(in->line, in->line + entry, entry * sizeof(*in->line));
        if (p->store >= 0 && in->dy && y == (in->dy > 0 ? p->bottom - 1 : p->top))
            store(in, t, x);
        before = y * p->width + x;
        last = t;
    }
}

/* All paths of a direction, from the sides that they come from. */
static void follow_all(struct given *in, int way)
{
    const struct sst_gpu_sgm *p = in->push;
    int left, row;

    sst_gpu_way(way, &in->dx, &in->dy);
    left = in->dx > 0 ? 0 : p->width - 1;
    row = in->dy > 0 ? p->top : p->bottom - 1;
    for (int i = 0; i < sst_gpu_sgm_paths(p, way); i++) {
        if (!in->dy)
            follow(in, left, p->top + i, false);
        else if (i < p->width)
            follow(in, i, row, true);
        else
            follow(in, left, row + in->dy * (i - p->width + 1), false);
    }
}

void sgm_path_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_sgm *p = push;
    const uint32_t *table = buffer[SST_GPU_SGM_TABLE];
    const size_t entry = SST_GPU_MATCH_STEPS + 2 * SST_SGM_PAD;
    uint16_t *lines = calloc(6 * entry, sizeof(*lines));
    struct given in = { .push = p,
                        .tiles = buffer[SST_GPU_SGM_TILES],
                        .pixel = buffer[SST_GPU_SGM_PIXELS],
                        .cost = buffer[SST_GPU_SGM_COST],
                        .sum = buffer[SST_GPU_SGM_SUM],
                        .state = buffer[SST_GPU_SGM_STATE] };

    assert(lines);
    in.line = lines;
    in.other = lines + 3 * entry;
    for (int i = 0; i < 256; i++) {
        in.p1[i] = (uint16_t)table[i];
        in.p2[i] = (uint16_t)(table[i] >> 16);
    }
    for (int i = p->way; i < p->way + p->ways; i++)
        follow_all(&in, i);
    free(lines);
}

/* The result at one pixel. */
static uint32_t result_of(const struct sst_gpu_winner *p, const struct sst_gpu_tile *t, const uint16_t *sum)
{
    uint16_t best, second;
    int offset = 0, gap, disp;

    sst_winner_row_ref(&best, &second, sum, (size_t)t->nd, 1, (size_t)t->steps);
    if (best > 0 && best + 1 < t->steps)
        offset = sst_parabola_q6(sum[best - 1], sum[best], sum[best + 1]);
    disp = (best * 64 + offset + p->divisor / 2) / p->divisor + t->first * 64 / p->divisor;
    gap = second - sum[best];
    return (uint32_t)disp | (uint32_t)(gap > 0 ? 255 * gap / (gap + 128) : 0) << 16;
}

void winner_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_winner *p = push;
    uint32_t *out = buffer[SST_GPU_WINNER_OUT];
    uint16_t wide[SST_GPU_MATCH_STEPS];

    for (uint32_t i = 0; i < groups[2]; i++) {
        const struct sst_gpu_tile *t = (const struct sst_gpu_tile *)buffer[SST_GPU_WINNER_TILES] + i;

        for (int y = t->y0; y < t->y0 + t->height; y++) {
            for (int x = t->x0; x < t->x0 + t->width; x++) {
                const size_t at = cell_of(t, x, y);
                const uint16_t *sum = (const uint16_t *)buffer[SST_GPU_WINNER_SUM] + at;

                for (size_t d = 0; p->from_cost && d < (size_t)t->nd; d++)
                    wide[d] = ((const uint8_t *)buffer[SST_GPU_WINNER_COST])[at + d];
                out[(y - p->top) * p->width + x] = result_of(p, t, p->from_cost ? wide : sum);
            }
        }
    }
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  21
#define TEST_TOP    2
#define TEST_HEIGHT 9
#define TEST_COLUMN 11 /* width of a tile */
#define TEST_ROW    5  /* its height */
#define TEST_TILES  4
#define TEST_STEPS  264 /* more than a group does at once */
#define TEST_CELLS  ((size_t)(TEST_HEIGHT + 4) * (TEST_WIDTH + 4) * TEST_STEPS)
#define TEST_PIXELS ((size_t)TEST_WIDTH * (TEST_TOP + TEST_HEIGHT + 1))

struct test {
    struct sst_gpu_sgm push;
    struct sst_gpu_tile tile[TEST_TILES];
    uint32_t pixel[TEST_PIXELS], table[256], out[TEST_WIDTH * TEST_HEIGHT];
    uint8_t cost[TEST_CELLS];
    uint16_t sum[TEST_CELLS];
    uint32_t state[2 * TEST_WIDTH][TEST_STEPS + 3];
};

/* Tiles with a pixel around them, and windows that begin and end elsewhere, if there are several; else one with these
 * steps. */
static void set_tiles(struct test *t, bool several, int steps)
{
    static const int window[TEST_TILES][2] = { { 0, 96 }, { 64, 160 }, { 80, 64 }, { 32, 232 } };
    const int width = several ? TEST_COLUMN : TEST_WIDTH, height = several ? TEST_ROW : TEST_HEIGHT;
    uint32_t cells = 0;

    t->push = (struct sst_gpu_sgm){ .width = TEST_WIDTH,
                                    .top = TEST_TOP,
                                    .bottom = TEST_TOP + TEST_HEIGHT,
                                    .tile_width = width,
                                    .tile_height = height,
                                    .columns = several ? 2 : 1,
                                    .load = -1,
                                    .store = -1,
                                    .all = TEST_STEPS };
    for (int i = 0; i < TEST_TILES; i++) {
        const int x0 = several ? i % 2 * width : 0, y0 = several ? i / 2 * height : 0;
        struct sst_gpu_tile made = { .x0 = x0,
                                     .y0 = TEST_TOP + y0,
                                     .width = sst_min_int(width, TEST_WIDTH - x0),
                                     .height = sst_min_int(height, TEST_HEIGHT - y0),
                                     .left = x0 - several,
                                     .top = TEST_TOP + y0 - several,
                                     .first = several ? window[i][0] : 0,
                                     .nd = several ? window[i][1] : steps,
                                     .quad = cells / 4 };

        made.steps = made.nd - 3;
        made.pitch = made.width + 2 * several;
        made.rows = made.height + 2 * several;
        cells += (uint32_t)(made.pitch * made.rows * made.nd);
        assert(!several || cells <= TEST_CELLS);
        t->tile[i] = made;
    }
}

/* Costs with a minimum that wanders, noise, and runs of equal ones. */
static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 3;

    for (size_t i = 0; t && i < TEST_CELLS; i++) {
        const size_t x = i / TEST_STEPS, d = i % TEST_STEPS, wanted = x * 37 % TEST_STEPS;
        const size_t off = d > wanted ? d - wanted : wanted - d;

        t->cost[i] = (uint8_t)(gpu_random(&state) % 5 ? (off < 50 ? 4 * off : 200) : gpu_random(&state) % 256);
    }
    for (size_t i = 0; t && i < TEST_PIXELS; i++)
        t->pixel[i] = gpu_random(&state);
    for (uint32_t i = 0; t && i < 256; i++)
        t->table[i] = (20 + i % 7) | (400 - i) << 16;
    return t;
}

/* One direction; the sums, or what is left of the paths, are kept for the next one. */
static int run_direction(struct sst_gpu *g, struct test *t, enum sst_gpu_shader shader, bool keep_state)
{
    const void *const initial[SST_GPU_BUFFERS] = { t->tile, t->pixel, t->table, t->cost, t->sum, t->state };
    const size_t bytes[SST_GPU_BUFFERS] = { sizeof(t->tile), sizeof(t->pixel), sizeof(t->table),
                                            sizeof(t->cost), sizeof(t->sum),   sizeof(t->state) };
    const struct sst_gpu_work work = { .shader = shader,
                                       .push = &t->push,
                                       .groups = { sst_gpu_sgm_groups(&t->push), (uint32_t)t->push.ways, 1 } };

    return gpu_compare(g, &work, initial, bytes, keep_state ? SST_GPU_SGM_STATE : SST_GPU_SGM_SUM,
                       keep_state ? (void *)t->state : t->sum);
}

/* @param steps  of a view that is one tile */
static int test_paths(struct sst_gpu *g, enum sst_gpu_shader shader, int steps)
{
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    for (int several = 0; several < 2 && !err; several++) {
        set_tiles(t, several, steps);
        t->push.ways = 1;
        for (int i = 0; i < SST_GPU_WAYS && !err; i++) {
            t->push.way = i;
            t->push.first = !i;
            err = run_direction(g, t, shader, false);
        }
        t->push.way = 1; /* several at once, added to those */
        t->push.ways = SST_GPU_WAYS - 1;
        err = err ? err : run_direction(g, t, shader, false);
        t->push.ways = 1;
        for (int i = 0; i < 4 && !err; i++) { /* left after all rows, which go on from there: as of other ones */
            static const int ways[4] = { 5, 2, 4, 7 };

            t->push.way = ways[i];
            t->push.load = -1;
            t->push.store = TEST_WIDTH;
            err = run_direction(g, t, shader, true);
            t->push.load = TEST_WIDTH;
            t->push.store = 0;
            err = err ? err : run_direction(g, t, shader, true);
        }
    }
    free(t);
    return err;
}

int sgm_path_self_test(struct sst_gpu *g)
{
    return test_paths(g, SST_GPU_SGM_PATH, TEST_STEPS);
}

int sgm_path_subgroup_self_test(struct sst_gpu *g)
{
    const int err = test_paths(g, SST_GPU_SGM_PATH_SUBGROUP, SST_GPU_SGM_SUBGROUP_STEPS);

    return err ? err : test_paths(g, SST_GPU_SGM_PATH_SUBGROUP, 100);
}

static int run_winner(struct sst_gpu *g, struct test *t, bool from_cost)
{
    const struct sst_gpu_winner push = { TEST_WIDTH, TEST_TOP, from_cost ? 4 : 1, from_cost };
    const void *const initial[SST_GPU_BUFFERS] = { t->tile, t->sum, t->cost, t->out };
    const size_t bytes[SST_GPU_BUFFERS] = { sizeof(t->tile), sizeof(t->sum), sizeof(t->cost), sizeof(t->out) };
    const struct sst_gpu_work work = { .shader = SST_GPU_WINNER,
                                       .push = &push,
                                       .groups = { TEST_ROW, gpu_groups(TEST_COLUMN, SST_GPU_WINNER_PIXELS),
                                                   TEST_TILES } };

    return gpu_compare(g, &work, initial, bytes, SST_GPU_WINNER_OUT, NULL);
}

int winner_self_test(struct sst_gpu *g)
{
    struct test *t = make_test();
    uint32_t state = 9;
    int err = t ? 0 : -ENOMEM;

    if (!err)
        set_tiles(t, true, TEST_STEPS);
    for (size_t i = 0; i < TEST_CELLS && !err; i++) /* many are equal, some the largest there is */
        t->sum[i] = (uint16_t)(i / TEST_STEPS % 5 ? 100 + gpu_random(&state) % 50 : 65535 - gpu_random(&state) % 2);
    for (int from_cost = 0; from_cost < 2 && !err; from_cost++)
        err = run_winner(g, t, from_cost);
    free(t);
    return err;
}
