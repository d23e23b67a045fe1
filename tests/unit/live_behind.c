/* pipeline/live/picture/behind.c: of cells behind leaves that move, those that show what they have shown are rendered a
 * third as often, until something changes there; pipeline/live/picture/memory.c remembers them as much longer. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/picture/picture_internal.h"
#include "tests/live_shown.h"
#include "tests/small.h"

#define WIDTH   256
#define HEIGHT  96
#define COLS    (WIDTH / SST_RENDER_CELL_WIDTH)
#define ROWS    (HEIGHT / SST_RENDER_CELL_HEIGHT)
#define CELLS   (COLS * ROWS)
#define STEP_NS INT64_C(500000000) /* then a cell that changes is rendered in one set of TURNS */
#define TURNS   3
#define SLOW    (3 * TURNS)
#define STARTED 24 /* sets in which all planes are tried, and every second one renders a cell */
#define LEVEL   1  /* of votes that are counted for a cell, and how many of them: */
#define VOTES   8

struct bench {
    struct shown s;
    struct picture_behind behind;
    struct picture_memory memory;
    struct sst_map_u8 weight; /* 0: the maps show nothing */
    int64_t t_ns;
    int rendered[CELLS]; /* sets in which it was up to date */
};

static void open_bench(struct bench *b)
{
    *b = (struct bench){ .t_ns = 1000000000 };
    show(&b->s, "bush", WIDTH, HEIGHT, 3, false);
    take(&b->s, b->t_ns);
    b->s.live->cfg.skip_change = true;
    b->s.live->low_confidence = true;
    assert_int_equal(sst_map_u8_init(&b->weight, WIDTH, HEIGHT), 0);
    for (int y = 0; y < HEIGHT; y++)
        memset(sst_map_u8_row(&b->weight, y), 0, WIDTH);
    assert_int_equal(picture_memory_init(&b->memory, WIDTH, HEIGHT), 0);
    for (int i = 0; i < PICTURE_VOTE_LEVELS; i++)
        memset(b->memory.level[i], 0, sizeof(*b->memory.level[i]) * (size_t)(b->memory.cols[i] * b->memory.rows[i]));
}

static void close_bench(struct bench *b)
{
    picture_behind_fini(&b->behind);
    picture_memory_fini(&b->memory);
    sst_map_u8_fini(&b->weight);
    hide(&b->s);
}

/* Sets in which the first tiles of all views change: all, or a few. There is one plane, so that none is tried. */
static void run(struct bench *b, int sets, int tiles)
{
    struct sst_live *live = b->s.live;

    memset(b->rendered, 0, sizeof(b->rendered));
    for (int n = 0; n < sets; n++) {
        for (int k = 0; k < 9; k++)
            memset(b->s.changes.map[k], 1, (size_t)tiles);
        b->t_ns += STEP_NS;
        take(&b->s, b->t_ns);
        live->focus.focus_px = live->min_px = 5;
        assert_true(picture_behind_render(&b->behind, live, &live->lf.views[live->lf.ref_view].image, &b->weight, 6));
        assert_int_equal(b->behind.planned, 1);
        for (int i = 0; i < CELLS; i++)
            b->rendered[i] += !b->behind.cell[i].stale;
        picture_behind_explore(&b->behind, &b->memory);
    }
}

static int all_tiles(const struct bench *b)
{
    return b->s.changes.cols * b->s.changes.rows;
}

/* Some pixels of a cell are unchanged, or changed: in the first and last votes of the cell. */
static void vote(struct bench *b, int at, int same, int changed)
{
    struct picture_votes *v = b->memory.level[LEVEL] + at / COLS * b->memory.cols[LEVEL] + at % COLS * VOTES;

    v[0].same = (uint16_t)(same / 2);
    v[VOTES - 1].same = (uint16_t)(same - same / 2);
    v[0].changed = (uint16_t)(changed / 2);
    v[VOTES - 1].changed = (uint16_t)(changed - changed / 2);
}

static void what_stays_is_rendered_a_third_as_often(void **state)
{
    struct bench b;

    (void)state;
    open_bench(&b);
    run(&b, 1, all_tiles(&b));
    for (int i = 0; i < CELLS; i++)
        assert_int_equal(b.rendered[i], 1);
    run(&b, STARTED - 1, all_tiles(&b));
    for (int i = 0; i < CELLS; i++)
        assert_in_range(b.rendered[i], STARTED / 2 - 1, STARTED / 2);
    run(&b, SLOW, all_tiles(&b)); /* each at its turn */
    run(&b, 2 * SLOW, all_tiles(&b));
    for (int i = 0; i < CELLS; i++) {
        assert_int_equal(b.rendered[i], 2);
        assert_int_equal(picture_behind_slowness(&b.behind, i), SLOW / TURNS);
    }
    close_bench(&b);
}

/* Three renderings have to show the same first. */
static void cells_begin_as_all_others(void **state)
{
    struct bench b;

    (void)state;
    open_bench(&b);
    run(&b, 4, all_tiles(&b));
    assert_int_equal(picture_behind_slowness(&b.behind, 0), 1);
    run(&b, 1, all_tiles(&b));
    assert_int_equal(picture_behind_slowness(&b.behind, 0), SLOW / TURNS);
    close_bench(&b);
}

/* A changed cell and its neighbours are rendered as often as any until they stay again. */
static void what_changes_wakes_its_neighbours(void **state)
{
    const int at = 5 * COLS + 2;
    struct bench b;

    (void)state;
    open_bench(&b);
    run(&b, STARTED + SLOW, all_tiles(&b));
    vote(&b, at, 24, 8); /* a quarter is not enough */
    run(&b, 1, all_tiles(&b));
    assert_int_equal(picture_behind_slowness(&b.behind, at), SLOW / TURNS);
    vote(&b, at, 0, 7); /* nor are few pixels */
    run(&b, 1, all_tiles(&b));
    assert_int_equal(picture_behind_slowness(&b.behind, at), SLOW / TURNS);
    vote(&b, at, 23, 8);
    run(&b, 1, all_tiles(&b));
    for (int i = 0; i < CELLS; i++) {
        const bool near = abs(i / COLS - at / COLS) <= 1 && abs(i % COLS - at % COLS) <= 1;

        assert_int_equal(picture_behind_slowness(&b.behind, i), near ? 1 : SLOW / TURNS);
    }
    vote(&b, at, 0, 0);
    run(&b, SLOW, all_tiles(&b));
    for (int i = 0; i < CELLS; i++) {
        const bool near = abs(i / COLS - at / COLS) <= 1 && abs(i % COLS - at % COLS) <= 1;

        assert_int_equal(b.rendered[i], near ? SLOW / TURNS : 1);
        assert_int_equal(picture_behind_slowness(&b.behind, i), SLOW / TURNS);
    }
    close_bench(&b);
}

/* Where few cells change that is something else than leaves: they are rendered as soon as any. */
static void what_moves_alone_is_not_slow(void **state)
{
    struct bench b;

    (void)state;
    open_bench(&b);
    run(&b, STARTED + SLOW, all_tiles(&b));
    run(&b, SLOW, 1); /* until all cells are up to date */
    run(&b, SLOW, 1);
    assert_int_equal(b.rendered[0], SLOW / TURNS);
    assert_int_equal(b.rendered[CELLS - 1], SLOW); /* it stays as it is */
    for (int i = 0; i < CELLS; i++)
        assert_int_equal(picture_behind_slowness(&b.behind, i), 1);
    close_bench(&b);
}

/* In exact mode all cells are rendered whatever has changed. */
static void exact_pictures_show_all(void **state)
{
    struct bench b;

    (void)state;
    open_bench(&b);
    b.s.live->cfg.skip_change = false;
    run(&b, STARTED + SLOW, all_tiles(&b));
    for (int i = 0; i < CELLS; i++)
        assert_int_equal(b.rendered[i], STARTED + SLOW);
    close_bench(&b);
}

/* --- memory ------------------------------------------------------------------------------------------------------- */

/* Time for which an unseen pixel with always changing rays is remembered. */
static int remembered_ms(struct bench *b, int at)
{
    const struct sst_live *live = b->s.live;
    const int x = at % COLS * SST_RENDER_CELL_WIDTH, y = at / COLS * SST_RENDER_CELL_HEIGHT;
    struct picture_pixel *p = b->memory.pixel + (size_t)y * WIDTH + x;
    struct sst_map_u8 support = { 0 }, kind = { 0 };
    struct sst_map_u16 surface = { 0 };
    struct sst_image image = { 0 };
    int ms = 0;

    assert_int_equal(sst_image_init(&image, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u16_init(&surface, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&support, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&kind, WIDTH, HEIGHT), 0);
    picture_memory_forget(&b->memory);
    for (int row = 0; row < HEIGHT; row++) {
        uint16_t *to = sst_map_u16_row(&surface, row);

        for (int col = 0; col < WIDTH; col++)
            to[col] = SST_DISP_NONE;
    }
    for (int n = 0; n < 50; n++, ms += 100) {
        const struct picture_merge in = { .lf = &live->lf,
                                          .t_ns = 1 + n * INT64_C(100000000),
                                          .threads = 1,
                                          .image = &image,
                                          .weight = &b->weight,
                                          .surface = &surface,
                                          .support = &support,
                                          .kind = &kind,
                                          .behind = &b->behind,
                                          .cut_q6 = SST_DISP_NONE,
                                          .views = live->sampled,
                                          .view = live->sample,
                                          .stamp = live->stamp,
                                          .tile = SST_LIVE_TILE,
                                          .tile_cols = b->s.changes.cols };

        for (int row = 0; row < HEIGHT; row++)
            memset(sst_map_u8_row(&b->weight, row), 0, WIDTH);
        memset(b->behind.agreed.data, 0, b->behind.agreed.stride * HEIGHT); /* nothing is found there, either */
        assert_int_equal(picture_memory_merge(&b->memory, &in), 0);
        if (!n)
            *p = (struct picture_pixel){ .support = 200, .disp = 64 };
        else if (p->disp == SST_DISP_NONE)
            break;
    }
    sst_image_fini(&image);
    sst_map_u16_fini(&surface);
    sst_map_u8_fini(&support);
    sst_map_u8_fini(&kind);
    return ms;
}

static void what_is_rendered_seldom_is_remembered_longer(void **state)
{
    const int at = 5 * COLS + 2;
    struct bench b;

    (void)state;
    open_bench(&b);
    run(&b, STARTED, all_tiles(&b));
    assert_int_equal(remembered_ms(&b, at), 2700);
    b.behind.cell[at].calm = 0;
    assert_int_equal(remembered_ms(&b, at), 900);
    assert_int_equal(remembered_ms(&b, at + 1), 2700);
    close_bench(&b);
}

/* --- sets without maps of their own ------------------------------------------------------------------------------- */

/* The leaves move on, the maps do not. */
static void move_leaves(struct shown *s)
{
    struct sst_lightfield *lf = &s->live->lf;
    struct sst_map_u16 disp[9] = { 0 };

    for (int k = 0; k < 9; k++) {
        assert_int_equal(sst_map_u16_init(&disp[k], WIDTH, HEIGHT), 0);
        memcpy(disp[k].data, lf->views[k].disp.data, disp[k].stride * HEIGHT);
    }
    set_scene(s, "bush", 0.4);
    for (int k = 0; k < 9; k++) {
        memcpy(lf->views[k].disp.data, disp[k].data, disp[k].stride * HEIGHT);
        sst_map_u16_fini(&disp[k]);
    }
}

/* The clear picture after the leaves have moved. @param image  out, initialised here */
static void show_moved(struct sst_image *image, int threads)
{
    const struct sst_image *shown = NULL;
    struct sst_render_config cfg;
    struct sst_livepicture *p;
    struct shown s;
    int64_t anew;

    show(&s, "bush", WIDTH, HEIGHT, 3, false);
    s.live->cfg.threads = threads;
    s.live->cfg.skip_change = s.live->low_confidence = true;
    take(&s, 1000000000);
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    sst_render_config_defaults(&cfg);
    cfg.method = SST_RENDER_CLEAR;
    cfg.cut_px = floor((s.live->min_px + s.live->max_px) / 2);
    assert_int_equal(sst_livepicture_render(p, &cfg, &shown, &anew), 0);
    move_leaves(&s);
    s.live->late = true;
    take(&s, 1100000000);
    assert_int_equal(sst_livepicture_render(p, &cfg, &shown, &anew), 0);
    assert_true(anew > 0);
    assert_int_equal(sst_image_init(image, WIDTH, HEIGHT), 0);
    for (int c = 0; c < 3; c++)
        memcpy(image->plane[c], shown->plane[c], image->stride * HEIGHT);
    sst_livepicture_destroy(p);
    hide(&s);
}

static void late_maps_are_the_same_for_all_threads(void **state SST_UNUSED)
{
    struct sst_image one = { 0 }, two = { 0 };

    show_moved(&one, 1);
    show_moved(&two, 2);
    assert_true(same_image(&one, &two));
    sst_image_fini(&one);
    sst_image_fini(&two);
}

/* Working memory of a merge. */
struct merging {
    struct sst_image image;
    struct sst_map_u16 surface;
    struct sst_map_u8 weight, support, kind;
};

static void init_merging(struct merging *m, struct picture_memory *memory)
{
    assert_int_equal(sst_image_init(&m->image, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u16_init(&m->surface, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&m->weight, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&m->support, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&m->kind, WIDTH, HEIGHT), 0);
    for (int y = 0; y < HEIGHT; y++) {
        memset(sst_map_u8_row(&m->weight, y), 0, WIDTH);
        memset(sst_map_u8_row(&m->support, y), 0, WIDTH);
        memset(sst_map_u16_row(&m->surface, y), 0xFF, WIDTH * sizeof(uint16_t));
    }
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        memory->pixel[i] =
            (struct picture_pixel){ .rgb = { 9, 9, 9 }, .support = 32, .disp = 64, .seen_ms = 1, .since_ms = 1 };
}

static void fini_merging(struct merging *m)
{
    sst_image_fini(&m->image);
    sst_map_u16_fini(&m->surface);
    sst_map_u8_fini(&m->weight);
    sst_map_u8_fini(&m->support);
    sst_map_u8_fini(&m->kind);
}

/* Until the next maps, pixels that the last maps show keep their colour if they have long had it, and rays that agree
 * decide the others: where somebody walked a moment ago, the wall is seen again. */
static void late_maps_keep_what_they_have_seen(void **state SST_UNUSED)
{
    struct merging m = { 0 };
    struct picture_merge in;
    struct bench b;

    open_bench(&b);
    for (int y = 0; y < HEIGHT; y++)
        memset(sst_map_u8_row(&b.weight, y), 255, WIDTH / 2);
    run(&b, 2, all_tiles(&b));
    b.s.live->late = true;
    for (int y = 0; y < HEIGHT; y++)
        memset(sst_map_u8_row(&b.weight, y), 0, WIDTH);
    b.t_ns += STEP_NS;
    take(&b.s, b.t_ns);
    assert_true(picture_behind_render(&b.behind, b.s.live, &b.s.live->lf.views[0].image, &b.weight, 6));
    for (int i = 0; i < CELLS; i++)
        assert_int_equal(b.behind.cell[i].holes > 0, i % COLS >= COLS / 2);
    init_merging(&m, &b.memory);
    b.memory.started = true;
    b.memory.start_ns = b.memory.last_ns = b.t_ns - 4000000000;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        b.memory.pixel[i].seen_ms = 3900;
        b.memory.pixel[i].since_ms = i / WIDTH < HEIGHT / 2 ? 100 : 3800; /* above: long there */
    }
    for (int y = 0; y < HEIGHT; y++) { /* rays agree on another colour everywhere */
        memset(sst_map_u8_row(&b.behind.agreed, y), 255, WIDTH);
        for (int c = 0; c < 3; c++)
            memset(sst_image_row(&b.behind.image, c, y), 200, WIDTH);
    }
    in = (struct picture_merge){ .lf = &b.s.live->lf,
                                 .t_ns = b.t_ns,
                                 .threads = 1,
                                 .image = &m.image,
                                 .weight = &m.weight,
                                 .surface = &m.surface,
                                 .support = &m.support,
                                 .kind = &m.kind,
                                 .behind = &b.behind,
                                 .cut_q6 = 6 * 64,
                                 .stamp = b.s.live->stamp,
                                 .tile = SST_LIVE_TILE,
                                 .tile_cols = b.s.changes.cols };
    assert_int_equal(picture_memory_merge(&b.memory, &in), 0);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const bool keeps = i % WIDTH < WIDTH / 2 && i / WIDTH < HEIGHT / 2;

        assert_int_equal(sst_image_row(&m.image, 1, i / WIDTH)[i % WIDTH], keeps ? 9 : 200);
        assert_int_equal(sst_map_u8_row(&m.kind, i / WIDTH)[i % WIDTH], keeps ? PICTURE_REMEMBERED : PICTURE_SEEN);
    }
    fini_merging(&m);
    close_bench(&b);
}

/* A memory of one surface, seen 1 ms after its start, and a picture 200 ms after it. */
static void merge_at_200_ms(struct picture_memory *memory, struct merging *m)
{
    const struct sst_lightfield lf = { .width = WIDTH, .height = HEIGHT };
    const struct picture_merge in = { .lf = &lf,
                                      .t_ns = 200000000,
                                      .threads = 1,
                                      .image = &m->image,
                                      .weight = &m->weight,
                                      .surface = &m->surface,
                                      .support = &m->support,
                                      .kind = &m->kind,
                                      .cut_q6 = 60 * 64,
                                      .tile = SST_LIVE_TILE,
                                      .tile_cols = 1 };

    memory->started = true;
    assert_int_equal(picture_memory_merge(memory, &in), 0);
}

/* Pixels x0 .. x1 - 1, y0 .. y1 - 1 of a picture. */
static void paint(struct merging *m, const int box[4], uint8_t level, uint16_t disp, int rays)
{
    for (int y = box[1]; y < box[3]; y++) {
        for (int x = box[0]; x < box[2]; x++) {
            for (int c = 0; c < 3; c++)
                sst_image_row(&m->image, c, y)[x] = level;
            sst_map_u8_row(&m->weight, y)[x] = rays ? 255 : 0;
            sst_map_u8_row(&m->support, y)[x] = (uint8_t)(rays * SST_RENDER_SUPPORT);
            sst_map_u16_row(&m->surface, y)[x] = disp;
        }
    }
}

static const int everywhere[4] = { 0, 0, WIDTH, HEIGHT };

/* A person behind leaves is seen by few rays, as is a leaf that agrees by chance; but all around has changed, too. */
static void few_rays_decide_together(void **state SST_UNUSED)
{
    struct picture_memory memory;
    struct merging m = { 0 };

    assert_int_equal(picture_memory_init(&memory, WIDTH, HEIGHT), 0);
    init_merging(&m, &memory);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        memory.pixel[i].support = 64;
    paint(&m, everywhere, 9, 64, 2);
    paint(&m, (int[]){ 20, 20, 24, 24 }, 200, 64, 2);
    paint(&m, (int[]){ 60, 16, 84, 48 }, 200, 64, 2);
    merge_at_200_ms(&memory, &m);
    assert_int_equal(sst_image_row(&m.image, 1, 22)[22], 9);
    assert_int_equal(memory.pixel[22 * WIDTH + 22].support, 64 - 2 * SST_RENDER_SUPPORT);
    assert_int_equal(sst_image_row(&m.image, 1, 32)[72], 200);
    assert_int_equal(memory.pixel[32 * WIDTH + 72].rgb[1], 200);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        assert_int_equal(sst_map_u8_row(&m.kind, i / WIDTH)[i % WIDTH], PICTURE_SEEN);
    fini_merging(&m);
    picture_memory_fini(&memory);
}

/* The memory of a hole's pixels goes where another surface has come around it since, or other colours come now, as of a
 * person at a wall; it stays beside an old surface. */
static void holes_follow_what_has_come(void **state SST_UNUSED)
{
    static const struct {
        uint16_t disp;        /* around the hole now, ... */
        uint8_t before;       /* ... level at it before, 0: another surface; it is 100 now */
        enum picture_kind is; /* the hole */
    } cases[] = { { 640, 0, PICTURE_FILLED },
                  { 64, 100, PICTURE_REMEMBERED },
                  { 640, 100, PICTURE_REMEMBERED },
                  { 64, 40, PICTURE_FILLED } };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct picture_memory memory;
        struct merging m = { 0 };

        assert_int_equal(picture_memory_init(&memory, WIDTH, HEIGHT), 0);
        init_merging(&m, &memory);
        for (int k = 0; k < WIDTH * HEIGHT && cases[i].before; k++) {
            memory.pixel[k] = (struct picture_pixel){ .disp = cases[i].disp, .seen_ms = 1, .since_ms = 1 };
            memset(memory.pixel[k].rgb, cases[i].before, 3);
        }
        memory.pixel[32 * WIDTH + 62] =
            (struct picture_pixel){ .rgb = { 9, 9, 9 }, .support = 32, .disp = 64, .seen_ms = 100, .since_ms = 1 };
        paint(&m, everywhere, 100, cases[i].disp, 6);
        paint(&m, (int[]){ 62, 32, 63, 33 }, 0, SST_DISP_NONE, 0);
        merge_at_200_ms(&memory, &m);
        assert_int_equal(sst_map_u8_row(&m.kind, 32)[62], cases[i].is);
        fini_merging(&m);
        picture_memory_fini(&memory);
    }
}

/* A colour of the leaves needs more rays that agree on it than a colour of the scene behind. */
static void colours_of_leaves_need_more_rays(void **state SST_UNUSED)
{
    int count[2] = { 0 }, strict[2] = { 0 }, known = 0, again = 0;
    uint8_t before[PICTURE_BEHIND_COLOURS];
    struct sst_image image = { 0 };
    const struct sst_lightfield *lf;
    const struct sst_view *v;
    double cut_px;
    struct bench b;

    open_bench(&b);
    lf = &b.s.live->lf;
    v = &lf->views[lf->ref_view];
    cut_px = (b.s.live->min_px + b.s.live->max_px) / 2;
    b.s.live->focus.focus_px = b.s.live->min_px;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        sst_map_u8_row(&b.weight, i / WIDTH)[i % WIDTH] =
            sst_disp_px(lf, sst_map_u16_row(&v->disp, i / WIDTH)[i % WIDTH]) > cut_px ? 0 : 255;
    assert_int_equal(sst_image_init(&image, WIDTH, HEIGHT), 0);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < HEIGHT; y++)
            memcpy(sst_image_row(&image, c, y), sst_image_row(&v->image, c, y), WIDTH);
    }
    assert_true(picture_behind_render(&b.behind, b.s.live, &image, &b.weight, cut_px));
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const bool front = !sst_map_u8_row(&b.weight, i / WIDTH)[i % WIDTH];

        count[front]++;
        strict[front] += b.behind.least[picture_behind_colour(sst_image_row(&v->image, 0, i / WIDTH)[i % WIDTH],
                                                              sst_image_row(&v->image, 1, i / WIDTH)[i % WIDTH],
                                                              sst_image_row(&v->image, 2, i / WIDTH)[i % WIDTH])] > 48;
    }
    print_message("of %d, %d pixels in front and behind %d, %d have a strict colour\n", count[1], count[0], strict[1],
                  strict[0]);
    assert_true(count[0] > 100 && count[1] > 100);
    assert_true(strict[1] > 0.8 * count[1] && strict[0] < 0.2 * count[0]);
    /* The reference camera's last picture, all white, is of a while ago: another view shows the leaves. */
    b.s.live->present[lf->ref_view] = false;
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < HEIGHT; y++)
            memset(sst_image_row(&v->image, c, y), 255, WIDTH);
    }
    memcpy(before, b.behind.least, sizeof(before));
    assert_true(picture_behind_render(&b.behind, b.s.live, &image, &b.weight, cut_px));
    for (int i = 0; i < PICTURE_BEHIND_COLOURS; i++) {
        known += before[i] > 48;
        again += before[i] > 48 && b.behind.least[i] > 48;
    }
    print_message("%d of %d strict colours by another view\n", again, known);
    assert_true(b.behind.least[picture_behind_colour(255, 255, 255)] == 48 && again > 0.8 * known);
    sst_image_fini(&image);
    close_bench(&b);
}

/* Pictures that need maps wait for them, unless their settings change. */
static void see_through_waits_for_maps(void **state SST_UNUSED)
{
    const struct sst_image *image = NULL;
    struct sst_render_config cfg;
    struct sst_livepicture *p;
    struct shown s;
    int64_t anew;

    show(&s, "bush", WIDTH, HEIGHT, 3, false);
    s.live->cfg.skip_change = s.live->low_confidence = true;
    take(&s, 1000000000);
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    sst_render_config_defaults(&cfg);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &anew), 0);
    move_leaves(&s);
    s.live->late = true;
    take(&s, 1100000000);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &anew), 0);
    assert_int_equal(anew, 0);
    cfg.focus_px = s.live->min_px;
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &anew), 0);
    assert_int_equal(anew, WIDTH * HEIGHT);
    s.live->late = false;
    take(&s, 1200000000);
    set_scene(&s, "bush", 0.8);
    take(&s, 1300000000);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &anew), 0);
    assert_true(anew > 0);
    sst_livepicture_destroy(p);
    hide(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_stays_is_rendered_a_third_as_often),
        cmocka_unit_test(cells_begin_as_all_others),
        cmocka_unit_test(what_changes_wakes_its_neighbours),
        cmocka_unit_test(what_moves_alone_is_not_slow),
        cmocka_unit_test(exact_pictures_show_all),
        cmocka_unit_test(what_is_rendered_seldom_is_remembered_longer),
        thread_test(late_maps_are_the_same_for_all_threads),
        serial_test(late_maps_keep_what_they_have_seen),
        cmocka_unit_test(few_rays_decide_together),
        cmocka_unit_test(holes_follow_what_has_come),
        cmocka_unit_test(colours_of_leaves_need_more_rays),
        serial_test(see_through_waits_for_maps),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
