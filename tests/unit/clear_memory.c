/* Memory of clear pictures: surfaces seen a moment ago, and their end. Maps are made by hand. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/picture/picture_internal.h"
#include "tests/test.h"

#define SIDE    64
#define WALL    100
#define WALKER  200
#define WALL_Q6 (5 * 64)
#define NEAR_Q6 (12 * 64)

/* One view of SIDE x SIDE; pixels are seen or not, with one level as colour. */
struct field {
    struct sst_lightfield lf;
    struct picture_memory memory;
    struct sst_image image;
    struct sst_map_u8 weight, support, kind;
    struct sst_map_u16 surface;
    uint64_t tiles[(SIDE / SST_LIVE_TILE) * (SIDE / SST_LIVE_TILE)], *stamp[SST_MAX_VIEWS];
    struct picture_merge in;
    int64_t t_ns;
};

static void open_field(struct field *f)
{
    static const int view[1] = { 0 };

    memset(f, 0, sizeof(*f));
    assert_int_equal(sst_lightfield_init(&f->lf, 1, 1), 0);
    f->lf.width = f->lf.height = SIDE;
    assert_int_equal(picture_memory_init(&f->memory, SIDE, SIDE), 0);
    assert_int_equal(sst_image_init(&f->image, SIDE, SIDE), 0);
    assert_int_equal(sst_map_u8_init(&f->weight, SIDE, SIDE), 0);
    assert_int_equal(sst_map_u8_init(&f->support, SIDE, SIDE), 0);
    assert_int_equal(sst_map_u8_init(&f->kind, SIDE, SIDE), 0);
    assert_int_equal(sst_map_u16_init(&f->surface, SIDE, SIDE), 0);
    f->stamp[0] = f->tiles;
    f->in = (struct picture_merge){ .lf = &f->lf,
                                    .threads = 2,
                                    .image = &f->image,
                                    .weight = &f->weight,
                                    .surface = &f->surface,
                                    .support = &f->support,
                                    .kind = &f->kind,
                                    .cut_q6 = 40 * 64,
                                    .views = 1,
                                    .view = view,
                                    .stamp = f->stamp,
                                    .tile = SST_LIVE_TILE,
                                    .tile_cols = SIDE / SST_LIVE_TILE };
}

static void close_field(struct field *f)
{
    picture_memory_fini(&f->memory);
    sst_image_fini(&f->image);
    sst_map_u8_fini(&f->weight);
    sst_map_u8_fini(&f->support);
    sst_map_u8_fini(&f->kind);
    sst_map_u16_fini(&f->surface);
    sst_lightfield_fini(&f->lf);
}

static void put(struct field *f, int x, int y, bool seen, int level, int disp_q6)
{
    for (int c = 0; c < 3; c++)
        sst_image_row(&f->image, c, y)[x] = (uint8_t)(seen ? level : 0);
    sst_map_u8_row(&f->weight, y)[x] = seen ? 255 : 0;
    sst_map_u8_row(&f->support, y)[x] = seen ? 16 * SST_RENDER_SUPPORT - 1 : 0;
    sst_map_u16_row(&f->surface, y)[x] = seen ? (uint16_t)disp_q6 : SST_DISP_NONE;
}

/* The wall, seen through every gap-th pixel of every gap-th row. */
static void wall_through_gaps(struct field *f, int gap)
{
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++)
            put(f, x, y, x % gap == 0 && y % gap == 0, WALL, WALL_Q6);
    }
}

/* Merge after some time; all tiles changed, or none. */
static void merge(struct field *f, double s, bool changed)
{
    f->t_ns += (int64_t)(s * 1e9);
    f->in.t_ns = f->t_ns;
    for (size_t i = 0; i < ARRAY_LEN(f->tiles) && changed; i++)
        f->tiles[i] = f->in.serial + 1;
    assert_int_equal(picture_memory_merge(&f->memory, &f->in), 0);
    f->in.serial += changed;
}

static int kinds(const struct field *f, int kind)
{
    int n = 0;

    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++)
            n += sst_map_u8_row(&f->kind, y)[x] == kind;
    }
    return n;
}

static void what_was_seen_through_a_gap_stays(void **state SST_UNUSED)
{
    struct field f;

    open_field(&f);
    wall_through_gaps(&f, 1);
    merge(&f, 0.1, true);
    assert_int_equal(kinds(&f, PICTURE_SEEN), SIDE * SIDE);
    wall_through_gaps(&f, 4);
    merge(&f, 0.25, true);
    assert_int_equal(kinds(&f, PICTURE_SEEN), SIDE * SIDE / 16);
    assert_int_equal(kinds(&f, PICTURE_REMEMBERED), SIDE * SIDE * 15 / 16);
    assert_int_equal(sst_image_row(&f.image, 1, 7)[9], WALL);
    assert_int_equal(sst_map_u8_row(&f.weight, 7)[9], 255);
    assert_float_equal(picture_memory_age_s(&f.memory, 9, 7), 0.25, 1e-6);
    assert_float_equal(picture_memory_age_s(&f.memory, 8, 8), 0, 1e-6);
    close_field(&f);
}

static void it_goes_within_a_second_where_views_change(void **state SST_UNUSED)
{
    struct field f;

    open_field(&f);
    wall_through_gaps(&f, 1);
    merge(&f, 0.1, true);
    for (int i = 0; i < 50; i++) { /* still: it may take as long as it likes */
        wall_through_gaps(&f, SIDE);
        merge(&f, 0.1, false);
    }
    assert_int_equal(kinds(&f, PICTURE_REMEMBERED), SIDE * SIDE - 1);
    for (int i = 0; i < 8; i++) {
        wall_through_gaps(&f, SIDE);
        merge(&f, 0.1, true);
        assert_int_equal(kinds(&f, PICTURE_REMEMBERED), SIDE * SIDE - 1);
    }
    wall_through_gaps(&f, SIDE);
    merge(&f, 0.15, true);
    assert_int_equal(kinds(&f, PICTURE_REMEMBERED), 0);
    assert_int_equal(kinds(&f, PICTURE_FILLED), SIDE * SIDE - 1);
    close_field(&f);
}

/* A wall that has been there for long stays for longer. */
static void what_is_settled_stays_longer(void **state SST_UNUSED)
{
    struct field f;

    open_field(&f);
    for (int i = 0; i < 40; i++) {
        wall_through_gaps(&f, 1);
        merge(&f, 0.1, true);
    }
    for (int i = 0; i < 100; i++) {
        wall_through_gaps(&f, 8);
        merge(&f, 0.1, true);
    }
    assert_int_equal(kinds(&f, PICTURE_REMEMBERED), SIDE * SIDE * 63 / 64);
    close_field(&f);
}

/* Somebody comes behind the leaves and is seen through gaps: the wall must not show between these; at the other end it
 * must stay. */
static void who_stands_behind_leaves_is_not_a_wall(void **state SST_UNUSED)
{
    struct field f;

    open_field(&f);
    wall_through_gaps(&f, 1);
    merge(&f, 0.1, true);
    wall_through_gaps(&f, 4);
    for (int y = 0; y < SIDE; y += 4) {
        for (int x = 0; x < SIDE / 2; x += 4)
            put(&f, x, y, true, WALKER, NEAR_Q6);
    }
    merge(&f, 0.1, true);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const int kind = sst_map_u8_row(&f.kind, y)[x];

            if (x % 4 == 0 && y % 4 == 0)
                assert_int_equal(kind, PICTURE_SEEN);
            else if (x < SIDE / 2 - 8)
                assert_int_equal(kind, PICTURE_FILLED);
            else if (x > SIDE / 2 + 8)
                assert_int_equal(kind, PICTURE_REMEMBERED);
        }
    }
    /* The walker leaves: where the wall is seen again, nothing of the walker stays. */
    wall_through_gaps(&f, 4);
    merge(&f, 0.1, true);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++)
            assert_int_not_equal(sst_image_row(&f.image, 0, y)[x], WALKER);
    }
    close_field(&f);
}

static void what_is_seen_replaces_what_was(void **state SST_UNUSED)
{
    struct field f;

    open_field(&f);
    wall_through_gaps(&f, 1);
    merge(&f, 0.1, true);
    put(&f, 20, 20, true, WALKER, NEAR_Q6); /* another surface */
    put(&f, 30, 30, true, WALKER, WALL_Q6); /* another colour */
    merge(&f, 0.1, true);
    assert_int_equal(sst_image_row(&f.image, 0, 20)[20], WALKER);
    assert_int_equal(sst_image_row(&f.image, 0, 30)[30], WALKER);
    put(&f, 20, 20, true, WALL, WALL_Q6); /* the surface behind is seen: it is not there any more */
    put(&f, 30, 30, false, 0, 0);
    merge(&f, 0.1, true);
    assert_int_equal(sst_image_row(&f.image, 0, 20)[20], WALL);
    assert_int_equal(sst_image_row(&f.image, 0, 30)[30], WALKER); /* one pixel; the next second takes it */
    close_field(&f);
}

/* A weak sighting does not replace a surface that many rays showed a moment ago; several do. */
static void weak_sightings_need_another(void **state SST_UNUSED)
{
    struct field f;
    int sets = 0;

    open_field(&f);
    wall_through_gaps(&f, 1);
    merge(&f, 0.1, true);
    do {
        wall_through_gaps(&f, 1);
        put(&f, 20, 20, true, WALKER, NEAR_Q6);
        sst_map_u8_row(&f.support, 20)[20] = 2 * SST_RENDER_SUPPORT;
        merge(&f, 0.1, true);
        sets++;
    } while (sst_image_row(&f.image, 0, 20)[20] == WALL && sets < 20);
    assert_in_range(sets, 2, 8);
    close_field(&f);
}

static void what_is_being_removed_is_not_remembered(void **state SST_UNUSED)
{
    struct sst_map_u8 removed = { 0 };
    struct field f;

    open_field(&f);
    assert_int_equal(sst_map_u8_init(&removed, SIDE, SIDE), 0);
    assert_int_equal(sst_map_u16_init(&f.lf.views[0].disp, SIDE, SIDE), 0);
    wall_through_gaps(&f, 1);
    for (int x = 0; x < 16; x++) {
        put(&f, x, 5, true, WALKER, NEAR_Q6);
        sst_map_u16_row(&f.lf.views[0].disp, 5)[x] = NEAR_Q6;
        sst_map_u8_row(&removed, 5)[x] = 255;
    }
    merge(&f, 0.1, true);
    f.in.lead = &f.lf.views[0];
    f.in.removed = &removed;
    wall_through_gaps(&f, SIDE);
    merge(&f, 0.1, false);
    assert_int_equal(kinds(&f, PICTURE_REMEMBERED), SIDE * SIDE - 1 - 16);
    f.in.cut_q6 = WALL_Q6 - 1; /* the cut moves behind the wall */
    wall_through_gaps(&f, SIDE);
    merge(&f, 0.1, false);
    assert_int_equal(kinds(&f, PICTURE_REMEMBERED), 0);
    sst_map_u8_fini(&removed);
    close_field(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_seen_through_a_gap_stays),
        cmocka_unit_test(it_goes_within_a_second_where_views_change),
        cmocka_unit_test(what_is_settled_stays_longer),
        cmocka_unit_test(who_stands_behind_leaves_is_not_a_wall),
        cmocka_unit_test(what_is_seen_replaces_what_was),
        cmocka_unit_test(weak_sightings_need_another),
        cmocka_unit_test(what_is_being_removed_is_not_remembered),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
