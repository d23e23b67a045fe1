/* The winner of the matching costs alone, and which networks may make features. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/method/disparity/stage.h"
#include "simulators/scene/noise.h"
#include "tests/onnx_writer.h"
#include "tests/test.h"

#define WIDTH    80
#define HEIGHT   24
#define MIN_PX   (-20) /* with MAX_PX more than 48 px: whole steps */
#define MAX_PX   30
#define SHIFT_PX 6

struct pair {
    struct sst_image left, right;
};

/* Noise, shifted by SHIFT_PX, with noise of its own in each view: matching alone makes mistakes. */
static struct pair new_pair(void)
{
    struct pair p;
    uint64_t seed = 7;

    assert_int_equal(sst_image_init(&p.left, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_image_init(&p.right, WIDTH, HEIGHT), 0);
    for (int i = 0; i < 3 * WIDTH * HEIGHT; i++) {
        const int x = i % WIDTH, y = i / WIDTH % HEIGHT, c = i / WIDTH / HEIGHT;
        const uint64_t r = sst_random_u64(&seed);

        sst_image_row(&p.left, c, y)[x] = (uint8_t)((r & 127) + (r >> 8 & 127));
        if (x >= SHIFT_PX)
            sst_image_row(&p.right, c, y)[x - SHIFT_PX] = (uint8_t)((r & 127) + (r >> 16 & 127));
    }
    return p;
}

static struct sst_disparity_config raw_config(void)
{
    struct sst_disparity_config cfg;

    assert_int_equal(sst_disparity_preset(&cfg, "balanced"), 0);
    cfg.disp_min_px = MIN_PX;
    cfg.disp_max_px = MAX_PX;
    cfg.raw = true;
    cfg.threads = 2;
    return cfg;
}

static struct sst_map_f32 match(const struct pair *p, const struct sst_disparity_config *cfg)
{
    struct sst_map_f32 disp;

    assert_int_equal(sst_disparity_stereo(&disp, &p->left, &p->right, cfg), 0);
    return disp;
}

static int differences(const struct sst_map_f32 *a, const struct sst_map_f32 *b)
{
    int n = 0;

    for (int i = 0; i < WIDTH * HEIGHT; i++)
        n += sst_map_f32_row(a, i / WIDTH)[i % WIDTH] != sst_map_f32_row(b, i / WIDTH)[i % WIDTH];
    return n;
}

/* Compared with the two steps that are left, done by hand; the whole chain mends most of the mistakes. */
static void raw_is_the_cheapest(void **state SST_UNUSED)
{
    struct sst_disparity_config cfg = raw_config();
    struct pair p = new_pair();
    struct sst_map_f32 raw = match(&p, &cfg), chain;
    struct sst_descriptor a, b;
    struct sst_neighbour right = { &b, 1, 0 };
    struct sst_volume v;
    struct sst_map_u16 q6;
    struct sst_map_u8 confidence;
    int wrong_raw = 0, wrong_chain = 0;

    assert_int_equal(sst_map_u16_init(&q6, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&confidence, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_descriptor_init(&a, &p.left, 1, SST_COST_CENSUS, NULL), 0);
    assert_int_equal(sst_descriptor_init(&b, &p.right, 1, SST_COST_CENSUS, NULL), 0);
    assert_int_equal(sst_volume_init(&v, WIDTH, HEIGHT, MIN_PX, MAX_PX - MIN_PX + 1), 0);
    sst_volume_fill(&v, &a, &right, 1);
    assert_int_equal(sst_volume_winner(&v, true, &q6, &confidence), 0);
    cfg.raw = false;
    chain = match(&p, &cfg);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const int x = i % WIDTH, y = i / WIDTH;
        const float d = sst_map_f32_row(&raw, y)[x];

        assert_true(d == MIN_PX + (float)sst_map_u16_row(&q6, y)[x] / 64);
        wrong_raw += d < SHIFT_PX - 1 || d > SHIFT_PX + 1;
        wrong_chain += sst_map_f32_row(&chain, y)[x] < SHIFT_PX - 1 || sst_map_f32_row(&chain, y)[x] > SHIFT_PX + 1;
    }
    if (wrong_chain * 4 > wrong_raw || !wrong_raw)
        fail_msg("%d of %d pixels are wrong raw, %d after the chain", wrong_raw, WIDTH * HEIGHT, wrong_chain);
    sst_map_u8_fini(&confidence);
    sst_map_u16_fini(&q6);
    sst_volume_fini(&v);
    sst_descriptor_fini(&a);
    sst_descriptor_fini(&b);
    sst_map_f32_fini(&raw);
    sst_map_f32_fini(&chain);
    sst_image_fini(&p.left);
    sst_image_fini(&p.right);
}

static void raw_ignores_the_rest_of_the_chain(void **state SST_UNUSED)
{
    struct sst_disparity_config cfg = raw_config();
    struct pair p = new_pair();
    struct sst_map_f32 want = match(&p, &cfg), got;

    cfg.paths = 8;
    cfg.p1 = 1;
    cfg.support_arm = cfg.support_after = cfg.bilateral_tau = 0;
    cfg.joint = cfg.fill = false;
    cfg.threads = 1;
    got = match(&p, &cfg);
    assert_int_equal(differences(&got, &want), 0);
    sst_map_f32_fini(&want);
    sst_map_f32_fini(&got);
    sst_image_fini(&p.left);
    sst_image_fini(&p.right);
}

/* One 1x1 convolution of zeros from `in` to `out` channels, every `stride`-th pixel, in a file. */
static void write_network(const char *path, int in, int out, int stride)
{
    struct ow_buf graph = { 0 }, attrs = { 0 }, model;
    float *zeros = calloc((size_t)in * (size_t)out, sizeof(*zeros));
    FILE *f = fopen(path, "wb");

    assert_non_null(zeros);
    assert_non_null(f);
    ow_attr_ints(&attrs, "kernel_shape", 2, 1, 1);
    ow_attr_ints(&attrs, "strides", 2, stride, stride);
    ow_floats(&graph, "w", zeros, out, in, 1, 1);
    ow_value(&graph, 11, "x", in);
    ow_node(&graph, "Conv", "x w", "y", &attrs);
    ow_value(&graph, 12, "y", out);
    model = ow_model(&graph, 11);
    assert_int_equal(fwrite(model.p, 1, model.n, f), model.n);
    assert_int_equal(fclose(f), 0);
    free(model.p);
    free(zeros);
}

/* Three channels in would be read beyond the luma; other sizes out beyond the features. */
static void networks_of_other_shapes_are_refused(void **state SST_UNUSED)
{
    static const struct {
        int in, out, stride, want;
    } cases[] = {
        { 1, 64, 1, 0 }, { 3, 64, 1, -EBADMSG }, { 1, 63, 1, -EBADMSG }, { 1, 128, 1, -EBADMSG }, { 1, 64, 2, -EBADMSG }
    };
    char path[] = "/tmp/sst-matching-XXXXXX";
    struct sst_disparity_config cfg = raw_config();
    struct pair p;
    int fd;

    if (!WITH_DNNL && !WITH_OPENCV) {
        print_message("this build runs no networks\n");
        skip();
    }
    p = new_pair();
    fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    cfg.cost = SST_COST_MCCNN;
    cfg.model = path;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct sst_map_f32 disp = { 0 };

        write_network(path, cases[i].in, cases[i].out, cases[i].stride);
        assert_int_equal(sst_disparity_stereo(&disp, &p.left, &p.right, &cfg), cases[i].want);
        assert_true(!disp.data == (cases[i].want != 0));
        sst_map_f32_fini(&disp);
    }
    unlink(path);
    sst_image_fini(&p.left);
    sst_image_fini(&p.right);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(raw_is_the_cheapest),
        cmocka_unit_test(raw_ignores_the_rest_of_the_chain),
        cmocka_unit_test(networks_of_other_shapes_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
