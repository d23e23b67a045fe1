/* One pair by one cost volume: the parts of the optimisation add up to the whole, threads change nothing, and known
 * disparities are found at any range. */
#include <math.h>
#include <string.h>

#include "pipeline/method/disparity/stage.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define WIDTH    150
#define HEIGHT   110 /* more than two bands */
#define SHIFT_PX 6

struct images {
    struct sst_image left, right;
};

/* Noise, shifted by SHIFT_PX. */
static struct images new_pair(int width, int height)
{
    struct images p;
    uint64_t seed = 7;

    assert_int_equal(sst_image_init(&p.left, width, height), 0);
    assert_int_equal(sst_image_init(&p.right, width, height), 0);
    for (int i = 0; i < 3 * width * height; i++) {
        const int x = i % width, y = i / width % height, c = i / width / height;
        const uint64_t r = sst_random_u64(&seed);

        sst_image_row(&p.left, c, y)[x] = (uint8_t)r;
        sst_image_row(&p.right, c, y)[x >= SHIFT_PX ? x - SHIFT_PX : width - 1 - x] = (uint8_t)r;
    }
    return p;
}

static void free_pair(struct images *p)
{
    sst_image_fini(&p->left);
    sst_image_fini(&p->right);
}

/* A volume of random costs. */
static struct sst_volume new_volume(void)
{
    struct sst_volume v;
    uint64_t seed = 3;

    assert_int_equal(sst_volume_init(&v, WIDTH, HEIGHT, 0, 40), 0);
    for (size_t i = 0; i < v.pixels * v.steps_padded; i++)
        v.cost[i] = (uint8_t)(sst_random_u64(&seed) % 256);
    return v;
}

static void sum_parts(struct sst_volume *v, const struct sst_image *img, const struct sst_disparity_sgm_penalties *p,
                      int paths)
{
    struct sst_mem_kept lines = { 0 };

    for (int y = 0; y < HEIGHT; y++)
        assert_int_equal(sst_disparity_sgm_row(v, img, p, y, &lines), 0);
    for (int x = 0; paths == 4 && x < WIDTH; x += 47)
        assert_int_equal(sst_disparity_sgm_columns(v, img, p, x, sst_min_int(x + 47, WIDTH), &lines), 0);
    for (int dir = 1; paths == 8 && dir >= -1; dir -= 2)
        assert_int_equal(sst_disparity_sgm_slanted(v, img, p, dir, 0, &lines), 0);
    sst_mem_kept_fini(&lines);
}

static void parts_add_up(void **state SST_UNUSED)
{
    struct images p = new_pair(WIDTH, HEIGHT);

    for (int paths = 4; paths <= 8; paths += 4) {
        struct sst_volume whole = new_volume(), parts = new_volume();
        struct sst_disparity_config cfg;
        struct sst_disparity_sgm_penalties penalties;

        assert_int_equal(sst_disparity_preset(&cfg, "balanced"), 0);
        cfg.one_volume = true;
        cfg.paths = paths;
        assert_int_equal(sst_disparity_sgm(&whole, &p.left, &cfg), 0);
        sst_disparity_sgm_penalties_init(&penalties, &cfg);
        sum_parts(&parts, &p.left, &penalties, paths);
        for (size_t y = 0; y < HEIGHT; y++)
            assert_memory_equal(whole.sum + y * whole.width_padded * whole.steps_padded,
                                parts.sum + y * parts.width_padded * parts.steps_padded,
                                WIDTH * whole.steps_padded * sizeof(*whole.sum));
        sst_volume_fini(&whole);
        sst_volume_fini(&parts);
    }
    free_pair(&p);
}

static struct sst_map_f32 match(const struct images *p, const struct sst_disparity_config *cfg)
{
    struct sst_map_f32 disp;

    assert_int_equal(sst_disparity_stereo(&disp, &p->left, &p->right, cfg), 0);
    return disp;
}

static void threads_change_nothing(void **state SST_UNUSED)
{
    struct images p = new_pair(WIDTH, HEIGHT);

    for (int paths = 4; paths <= 8; paths += 4) {
        struct sst_disparity_config cfg;
        struct sst_map_f32 one, three;

        assert_int_equal(sst_disparity_preset(&cfg, "balanced"), 0);
        cfg.one_volume = true;
        cfg.disp_max_px = 63;
        cfg.paths = paths;
        cfg.threads = 1;
        one = match(&p, &cfg);
        cfg.threads = 3;
        three = match(&p, &cfg);
        for (int y = 0; y < HEIGHT; y++)
            assert_memory_equal(sst_map_f32_row(&one, y), sst_map_f32_row(&three, y), WIDTH * sizeof(float));
        sst_map_f32_fini(&one);
        sst_map_f32_fini(&three);
    }
    free_pair(&p);
}

/* Ranges of quarter, half and whole steps, of both signs, and some that leave the image; images smaller than a block.
 */
static void finds_the_shift(void **state SST_UNUSED)
{
    static const struct {
        int width, height;
        double min_px, max_px;
        bool found;
    } cases[] = {
        { WIDTH, HEIGHT, 0, 63, true },   { WIDTH, HEIGHT, 0, 40, true },       { WIDTH, HEIGHT, -5, 12, true },
        { WIDTH, HEIGHT, -60, 20, true }, { WIDTH, HEIGHT, 0, 400, true },      { WIDTH, HEIGHT, 200, 300, false },
        { 40, 7, 0, 63, true },           { WIDTH, HEIGHT, -300, -200, false },
    };

    for (size_t i = 0; i < 2 * ARRAY_LEN(cases); i++) {
        struct images p = new_pair(cases[i / 2].width, cases[i / 2].height);
        struct sst_disparity_config cfg;
        struct sst_map_f32 disp;
        int good = 0;

        assert_int_equal(sst_disparity_preset(&cfg, i % 2 ? "preview" : "balanced"), 0);
        cfg.one_volume = true;
        cfg.disp_min_px = cases[i / 2].min_px;
        cfg.disp_max_px = cases[i / 2].max_px;
        disp = match(&p, &cfg);
        for (int k = 0; k < disp.width * disp.height; k++)
            good += fabsf(sst_map_f32_row(&disp, k / disp.width)[k % disp.width] - SHIFT_PX) < 1.0f;
        if (cases[i / 2].found)
            assert_true(good > disp.width * disp.height * 8 / 10);
        sst_map_f32_fini(&disp);
        free_pair(&p);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parts_add_up),
        cmocka_unit_test(threads_change_nothing),
        cmocka_unit_test(finds_the_shift),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
