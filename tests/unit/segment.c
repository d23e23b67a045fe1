/* The segmenter: metadata, scaling of the image and of the probabilities, errors. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/labels/labels_internal.h"
#include "pipeline/method/labels/model_info.h"
#include "pipeline/method/network/model_path.h"
#include "tests/onnx_writer.h"
#include "tests/small.h"

struct entry {
    const char *key, *value;
};

/* Three classes with the normalised R, G and B as logits; one more class than channels with `channels` 4. */
/* The same with y = x + (the mean of windows of 64x48, brought back to 64x48): it runs at that size only. */
static bool fixed_size;

/* @param graph  taken */
static int open_graph(struct sst_segmenter **seg, struct ow_buf *graph, int opset, const struct entry *entries,
                      size_t n, int threads)
{
    char path[] = "/tmp/sst-segment-XXXXXX";
    struct ow_buf model = ow_model(graph, opset);
    const int fd = mkstemp(path);
    int err;

    for (size_t i = 0; i < n; i++)
        ow_metadata(&model, entries[i].key, entries[i].value);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, model.p, model.n), (ssize_t)model.n);
    close(fd);
    err = sst_segmenter_open(seg, path, SST_PRECISION_F32, threads);
    unlink(path);
    free(model.p);
    return err;
}

static int open_segmenter(struct sst_segmenter **seg, const struct entry *entries, size_t n, int channels, int threads)
{
    const float w[4 * 3] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };
    struct ow_buf graph = { 0 }, attrs = { 0 };

    ow_value(&graph, 11, "x", 3);
    ow_value(&graph, 12, "y", channels);
    ow_floats(&graph, "w", w, channels, 3, 1, 1);
    ow_attr_ints(&attrs, "kernel_shape", 2, 1, 1);
    ow_node(&graph, "Conv", "x w", fixed_size ? "c" : "y", &attrs);
    if (fixed_size) {
        const int64_t sizes[] = { 1, channels, 48, 64 };

        ow_attr_ints(&attrs, "kernel_shape", 2, 48, 64);
        ow_node(&graph, "AveragePool", "c", "p", &attrs);
        ow_int64s(&graph, "sizes", sizes, 4);
        ow_attr_str(&attrs, "mode", "linear");
        ow_node(&graph, "Resize", "p - - sizes", "r", &attrs);
        ow_node(&graph, "Add", "c r", "y", NULL);
    }
    return open_graph(seg, &graph, 11, entries, n, threads);
}

static struct sst_image new_image(int width, int height, int r, int g, int b)
{
    const int value[3] = { r, g, b };
    struct sst_image img;

    assert_int_equal(sst_image_init(&img, width, height), 0);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < height; y++)
            memset(sst_image_row(&img, c, y), value[c], (size_t)width);
    }
    return img;
}

static const struct entry good[] = {
    { "sst.classes", "Sky, Road,Tree" }, { "sst.ground", "road" },   { "sst.mean", "0.5,0.5,0.25" },
    { "sst.std", "0.25,0.5,0.25" },      { "sst.size", "64x48" },    { "sst.epsilon_h", "0.75" },
    { "sst.temperature", "2" },          { "sst.output", "logits" },
};

/* R = 255, G = 51, B = 0: logits (1 - 0.5)/0.25 = 2, (0.2 - 0.5)/0.5 = -0.6, -1; halved by the temperature. */
static void a_plain_image_gives_hand_worked_probabilities(void **state SST_UNUSED)
{
    const double sum = exp(1) + exp(-0.3) + exp(-0.5);
    const double p[3] = { exp(1) / sum, exp(-0.3) / sum, exp(-0.5) / sum };
    struct sst_image img = new_image(33, 17, 255, 51, 0);
    struct sst_segmenter *seg;
    struct sst_map_u8 label;
    struct sst_map_f32 entropy;
    float *prob;
    double h = 0;

    assert_int_equal(open_segmenter(&seg, good, ARRAY_LEN(good), 3, 1), 0);
    assert_int_equal(sst_segmenter_classes(seg)->count, 3);
    assert_string_equal(sst_segmenter_classes(seg)->names[1], "Road");
    assert_true(sst_segmenter_classes(seg)->ground[1] && !sst_segmenter_classes(seg)->ground[0]);
    assert_true(sst_segmenter_eps_h(seg) == 0.75);
    assert_int_equal(sst_segment(seg, &img, &label, &entropy, &prob), 0);
    for (int c = 0; c < 3; c++)
        h -= p[c] * log(p[c]);
    for (int i = 0; i < 33 * 17; i++) {
        assert_int_equal(sst_map_u8_row(&label, i / 33)[i % 33], 1);
        assert_true(fabs((double)sst_map_f32_row(&entropy, i / 33)[i % 33] - h) < 1e-5);
        for (int c = 0; c < 3; c++)
            assert_true(fabs((double)prob[c * 33 * 17 + i] - p[c]) < 1e-5);
    }
    free(prob);
    sst_map_u8_fini(&label);
    sst_map_f32_fini(&entropy);
    sst_image_fini(&img);
    sst_segmenter_close(seg);
}

/* Left half red, right half green: the border must come back where it was, at a size that is no multiple of anything.
 */
static void labels_come_back_in_place(void **state SST_UNUSED)
{
    struct sst_image img = new_image(1001, 203, 0, 0, 0);
    struct sst_segmenter *seg, *two;
    struct sst_map_u8 label, again;
    struct sst_map_f32 entropy;

    for (int y = 0; y < 203; y++) {
        memset(sst_image_row(&img, 0, y), 255, 500);
        memset(sst_image_row(&img, 1, y) + 500, 255, 501);
    }
    assert_int_equal(open_segmenter(&seg, good, 1, 3, 1), 0);
    assert_int_equal(open_segmenter(&two, good, 1, 3, 2), 0);
    assert_true(isinf(sst_segmenter_eps_h(seg)));
    assert_int_equal(sst_segment(seg, &img, &label, &entropy, NULL), 0);
    assert_int_equal(sst_segment(two, &img, &again, NULL, NULL), 0);
    for (int y = 0; y < 203; y++) {
        for (int x = 0; x < 1001; x++) {
            if (x < 498 || x >= 503)
                assert_int_equal(sst_map_u8_row(&label, y)[x], x < 500 ? 1 : 2);
        }
        assert_memory_equal(sst_map_u8_row(&label, y), sst_map_u8_row(&again, y), 1001);
        /* least certain at the border */
        assert_true(sst_map_f32_row(&entropy, y)[500] > sst_map_f32_row(&entropy, y)[10]);
    }
    sst_map_u8_fini(&label);
    sst_map_u8_fini(&again);
    sst_map_f32_fini(&entropy);
    sst_image_fini(&img);
    sst_segmenter_close(seg);
    sst_segmenter_close(two);
}

/* 100 samples in windows of 40 that share 10 and start at multiples of 4: spacing at most 40 - 10 - 4 = 26, so
 * 1 + ceil(60 / 26) = 4 windows, at 0, 20, 40, 60. Neighbours share 20 samples; the change takes the middle 10 of them:
 * between windows 0 and 1 from 25 to 35, with u = (at - 25) / 10. */
static void window_weights_have_known_values(void **state SST_UNUSED)
{
    const struct tiles t = tiles_plan(100, 40, 4), one = tiles_plan(40, 40, 8);

    assert_true(t.count == 4 && t.overlap == 10);
    for (int k = 0; k < 4; k++)
        assert_int_equal(tiles_start(&t, k), 20 * k);
    assert_true(tiles_weight(&t, 0, 0) == 1 && tiles_weight(&t, 0, 24) == 1 && tiles_weight(&t, 1, 4) == 0);
    /* sample 27: u = 0.25, 3/16 - 2/64 = 0.15625 */
    assert_true(fabs((double)tiles_weight(&t, 1, 7) - 0.15625) < 1e-7);
    assert_true(fabs((double)tiles_weight(&t, 0, 27) - 0.84375) < 1e-7);
    assert_true(tiles_weight(&t, 0, 35) == 0 && tiles_weight(&t, 1, 15) == 1);
    assert_true(one.count == 1 && tiles_start(&one, 0) == 0 && tiles_weight(&one, 0, 39) == 1);
}

static void window_weights_sum_to_one_everywhere(void **state SST_UNUSED)
{
    for (int unit = 1; unit <= 8; unit *= 2) {
        for (int total = unit; total < 700; total += unit) {
            for (int length = 8 * unit; length <= 16 * unit; length += unit) {
                const struct tiles t = tiles_plan(total, length, unit);
                double sum[700] = { 0 };

                assert_int_equal(tiles_start(&t, t.count - 1) + t.length, total);
                for (int k = 0; k < t.count; k++) {
                    const int start = tiles_start(&t, k);

                    assert_true(start % unit == 0 && (k == 0 || start - tiles_start(&t, k - 1) <= length - t.overlap));
                    for (int i = 0; i < t.length; i++) {
                        assert_true(tiles_weight(&t, k, i) >= 0);
                        sum[start + i] += (double)tiles_weight(&t, k, i);
                    }
                }
                for (int i = 0; i < total; i++)
                    assert_true(fabs(sum[i] - 1) < 1e-6);
            }
        }
    }
}

/* The network sees single pixels: windows must give the result of one run, wherever their borders lie. */
static void windows_leave_no_seams(void **state SST_UNUSED)
{
    static const int sizes[][2] = { { 300, 200 }, { 333, 77 }, { 3000, 40 }, { 40, 3000 }, { 64, 48 }, { 5, 5 } };
    struct sst_segmenter *seg;

    assert_int_equal(open_segmenter(&seg, good, ARRAY_LEN(good), 3, 2), 0);
    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        const int w = sizes[i][0], h = sizes[i][1];
        struct sst_image img = new_image(w, h, 0, 0, 90);
        struct sst_map_u8 label[2];
        struct sst_map_f32 entropy[2];

        for (int y = 0; y < h; y++) {
            for (int x = 0; x < w; x++) {
                sst_image_row(&img, 0, y)[x] = (uint8_t)(x * 255 / w);
                sst_image_row(&img, 1, y)[x] = (uint8_t)(y * 255 / h);
            }
        }
        for (int windows = 0; windows < 2; windows++) {
            sst_segmenter_configure(seg, &(struct sst_segment_config){ .scale = 3, .windows = windows });
            assert_int_equal(sst_segment(seg, &img, &label[windows], &entropy[windows], NULL), 0);
        }
        for (int y = 0; y < h; y++) {
            for (int x = 0; x < w; x++)
                assert_true(fabsf(sst_map_f32_row(&entropy[0], y)[x] - sst_map_f32_row(&entropy[1], y)[x]) < 1e-5f);
        }
        for (int windows = 0; windows < 2; windows++) {
            sst_map_u8_fini(&label[windows]);
            sst_map_f32_fini(&entropy[windows]);
        }
        sst_image_fini(&img);
    }
    sst_segmenter_close(seg);
}

/* One image gives one distribution: with windows its labels are the same everywhere. */
static void windows_of_a_plain_image_agree(void **state SST_UNUSED)
{
    struct sst_image img = new_image(517, 301, 200, 100, 30);
    struct sst_segmenter *seg;
    struct sst_map_u8 label;
    float *prob;

    assert_int_equal(open_segmenter(&seg, good, ARRAY_LEN(good), 3, 1), 0);
    sst_segmenter_configure(seg, &(struct sst_segment_config){ .scale = 5, .windows = true });
    assert_int_equal(sst_segment(seg, &img, &label, NULL, &prob), 0);
    for (int i = 0; i < 517 * 301; i++) {
        assert_int_equal(sst_map_u8_row(&label, i / 517)[i % 517], 1);
        for (int c = 0; c < 3; c++)
            assert_true(fabsf(prob[c * 517 * 301 + i] - prob[c * 517 * 301]) < 1e-6f);
    }
    free(prob);
    sst_map_u8_fini(&label);
    sst_image_fini(&img);
    sst_segmenter_close(seg);
}

/* Two cells with p = (1, 0) and (0.25, 0.75) over 16 pixels, black up to pixel 6 and white from pixel 7 on, which is
 * still nearer to the first cell: each pixel takes the distribution of the cell of its colour. The first cell is 32
 * levels from black (its mean holds one white pixel of eight), so exp(-3 * 32^2 / 800) = 0.021 of its weight is left;
 * of the other cell's only the floor, 0.001, over a distance that never more than makes up for it on the black side. */
static void upsampling_follows_the_picture(void **state SST_UNUSED)
{
    struct class_grid grid = { .width = 2, .height = 1, .count = 2, .values = class_grid_values(2) };
    struct sst_image img = new_image(16, 2, 0, 0, 0);
    struct upsample_memory memory = { 0 };
    struct sst_map_u8 label, alone;
    struct sst_map_f32 entropy;
    float cells[16] = { 1, 0, 0, 0, 0, 0, 0, 0, 0.25f, 0.75f }, prob[2 * 16 * 2];

    assert_int_equal(grid.values, 8);
    grid.cell = cells;
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < 2; y++)
            memset(sst_image_row(&img, c, y) + 7, 255, 9);
    }
    assert_int_equal(sst_map_u8_init(&label, 16, 2), 0);
    assert_int_equal(sst_map_u8_init(&alone, 16, 2), 0);
    assert_int_equal(sst_map_f32_init(&entropy, 16, 2), 0);
    assert_int_equal(labels_upsample(&(struct upsampled){ &label, &entropy, prob }, &grid, &img, 1, &memory), 0);
    assert_int_equal(labels_upsample(&(struct upsampled){ .label = &alone }, &grid, &img, 2, &memory), 0);
    for (int i = 0; i < 32; i++) {
        const bool white = i % 16 >= 7;

        assert_int_equal(sst_map_u8_row(&label, i / 16)[i % 16], white ? 2 : 1);
        assert_int_equal(sst_map_u8_row(&alone, i / 16)[i % 16], white ? 2 : 1);
        assert_true(fabs((double)prob[i] + (double)prob[32 + i] - 1) < 1e-6);
        assert_true(fabs((double)prob[i] - (white ? 0.25 : 1)) < 0.03);
        assert_true(!white || fabs((double)sst_map_f32_row(&entropy, i / 16)[i % 16] - 0.5623) < 0.05);
    }
    sst_map_u8_fini(&label);
    sst_map_u8_fini(&alone);
    upsample_memory_fini(&memory);
    sst_map_f32_fini(&entropy);
    sst_image_fini(&img);
}

static void networks_of_one_size_see_a_stretched_image(void **state SST_UNUSED)
{
    struct sst_image img = new_image(50, 200, 0, 0, 255);
    struct sst_segmenter *seg;
    struct sst_map_u8 label;

    fixed_size = true;
    assert_int_equal(open_segmenter(&seg, good, ARRAY_LEN(good), 3, 1), 0);
    fixed_size = false;
    assert_int_equal(sst_segment(seg, &img, &label, NULL, NULL), 0);
    assert_true(label.width == 50 && label.height == 200);
    for (int y = 0; y < 200; y++)
        assert_int_equal(sst_map_u8_row(&label, y)[y / 4], 3);
    sst_map_u8_fini(&label);
    sst_image_fini(&img);
    sst_segmenter_close(seg);
}

static void probabilities_are_taken_as_they_are(void **state SST_UNUSED)
{
    const struct entry entries[] = { good[0], { "sst.output", "probabilities" } };
    struct sst_image img = new_image(1, 1, 51, 153, 51), black = new_image(9, 9, 0, 0, 0);
    struct sst_segmenter *seg;
    struct sst_map_u8 label;
    struct sst_map_f32 entropy;
    float *prob;

    assert_int_equal(open_segmenter(&seg, entries, 2, 3, 1), 0);
    assert_int_equal(sst_segment(seg, &img, &label, &entropy, &prob), 0);
    assert_int_equal(label.data[0], 2);
    assert_true(fabs((double)prob[1] - 0.6) < 1e-6 && fabs((double)prob[0] - 0.2) < 1e-6);
    free(prob);
    sst_map_u8_fini(&label);
    sst_map_f32_fini(&entropy);
    /* all zero is no distribution */
    assert_int_equal(sst_segment(seg, &black, &label, &entropy, NULL), -EBADMSG);
    assert_null(label.data);
    sst_image_fini(&img);
    sst_image_fini(&black);
    sst_segmenter_close(seg);
}

/* --- ends of networks --------------------------------------------------------------------------------------------- */

/** Nodes behind the logits "c" (R, G, B): "OPERATOR ATTRIBUTE", ATTRIBUTE an axis, permutation, constant or "". */
struct ending {
    int opset;
    const char *nodes[3][2];
};

static int open_ending(struct sst_segmenter **seg, const struct ending *e, const struct entry *more)
{
    const struct entry entries[] = { { "sst.classes", "a,b,c" }, { "sst.size", "64x48" }, more ? *more : good[0] };
    const float w[3 * 3] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };
    struct ow_buf graph = { 0 }, attrs = { 0 };
    char in[2] = "c", out[2] = "d";
    int n = 0;

    while (n < 3 && e->nodes[n][0])
        n++;
    ow_value(&graph, 11, "x", 3);
    ow_value(&graph, 12, "y", 3);
    ow_floats(&graph, "w", w, 3, 3, 1, 1);
    ow_attr_ints(&attrs, "kernel_shape", 2, 1, 1);
    ow_node(&graph, "Conv", "x w", "c", &attrs);
    for (int i = 0; i < n; i++, in[0]++, out[0]++) {
        const char *op = e->nodes[i][0], *attribute = e->nodes[i][1];
        const float k = (float)atof(attribute);
        char with[] = "? k", from[] = "k ?";
        const char *ins = in;

        with[0] = from[2] = in[0];
        if (!strcmp(op, "Mul") || !strcmp(op, "Sub")) {
            ow_floats(&graph, "k", &k, 1, 0, 0, 0);
            ins = op[0] == 'M' ? with : from;
        } else if (!strcmp(op, "Transpose"))
            ow_attr_ints(&attrs, "perm", 4, attribute[0] - '0', attribute[1] - '0', attribute[2] - '0',
                         attribute[3] - '0');
        else if (!strcmp(op, "Cast"))
            ow_attr_int(&attrs, "to", 1);
        else if (*attribute)
            ow_attr_int(&attrs, "axis", atoi(attribute));
        ow_node(&graph, op, ins, i == n - 1 ? "y" : out, &attrs);
    }
    return open_graph(seg, &graph, e->opset, entries, 3, 1);
}

/* One softmax, in the network or after it: logits 1, 0.2 and 0 have the same probabilities. */
static void softmax_is_never_taken_twice(void **state SST_UNUSED)
{
    static const struct ending same[] = {
        { 13, { { "Identity", "" } } },
        { 13, { { "Softmax", "1" } } },
        { 13, { { "Softmax", "-3" }, { "Identity", "" } } },
        { 11, { { "Softmax", "1" } } },
        { 11, { { "Softmax", "" }, { "Identity", "" } } },
        { 13, { { "LogSoftmax", "1" } } },
        { 13, { { "Transpose", "0231" }, { "Softmax", "-1" }, { "Transpose", "0312" } } },
        { 11, { { "Transpose", "0231" }, { "Softmax", "3" }, { "Transpose", "0312" } } },
    };
    const double sum = exp(1) + exp(0.2) + 1, p[3] = { exp(1) / sum, exp(0.2) / sum, 1 / sum };
    struct sst_image img = new_image(64, 48, 255, 51, 0);

    for (size_t i = 0; i < ARRAY_LEN(same); i++) {
        const char *last = same[i].nodes[0][0];
        struct sst_segmenter *seg;
        struct sst_map_u8 label;
        float *prob;

        if (!WITH_OPENCV && i > 2)
            break;
        assert_int_equal(open_ending(&seg, &same[i], NULL), 0);
        assert_int_equal(sst_segmenter_info(seg)->probabilities, i != 0 && strcmp(last, "LogSoftmax") != 0);
        assert_int_equal(sst_segment(seg, &img, &label, NULL, &prob), 0);
        for (int c = 0; c < 3; c++) {
            if (fabs((double)prob[c * 64 * 48 + 1000] - p[c]) > 1e-5)
                fail_msg("ending %zu (%s): %g, not %g", i, last, (double)prob[c * 64 * 48 + 1000], p[c]);
        }
        free(prob);
        sst_map_u8_fini(&label);
        sst_segmenter_close(seg);
    }
    sst_image_fini(&img);
}

static void ends_that_contradict_are_named(void **state SST_UNUSED)
{
    static const struct entry logits = { "sst.output", "logits" }, shares = { "sst.output", "probabilities" };
    static const struct {
        struct ending ending;
        const struct entry *more;
        const char *said;
    } bad[] = {
        { { 13, { { "Softmax", "1" } } }, &logits, "ends in Softmax, so its values are probabilities" },
        { { 13, { { "LogSoftmax", "1" } } }, &shares, "ends in LogSoftmax, so its values are logarithms" },
        { { 13, { { "Softmax", "" } } }, NULL, "ends in Softmax, but not over the channels" },
        { { 11, { { "Softmax", "3" }, { "Identity", "" } } }, NULL, "not over the channels" },
        { { 13, { { "Softmax", "1" }, { "ArgMax", "1" }, { "Cast", "" } } }, NULL, "ends in ArgMax" },
        /* OpenCV */
        { { 13, { { "Softmax", "1" }, { "Mul", "255" } } }, NULL, "ends in Mul with a constant behind a softmax" },
        { { 13, { { "Sigmoid", "" }, { "Sub", "1" }, { "Identity", "" } } }, NULL, "ends in Sub with a constant" },
    };
    struct sst_segmenter *seg;
    char said[SST_LOG_MAX], *before;

    for (size_t i = 0; i < ARRAY_LEN(bad) - (WITH_OPENCV ? 0 : 2); i++) {
        before = sst_log_hold_errors(said);
        assert_int_equal(open_ending(&seg, &bad[i].ending, bad[i].more), -EBADMSG);
        sst_log_hold_errors(before);
        assert_contains(said, bad[i].said);
    }
    if (!WITH_OPENCV)
        return;
    before = sst_log_hold_errors(said); /* OpenCV would take another axis */
    assert_int_equal(
        open_ending(&seg,
                    &(struct ending){ 13, { { "Transpose", "0231" }, { "Softmax", "" }, { "Transpose", "0312" } } },
                    NULL),
        -ENOTSUP);
    sst_log_hold_errors(before);
    assert_contains(said, "without an axis");
}

/* The network's only channel is R - `less`, or the sigmoid of it. */
static int open_one(struct sst_segmenter **seg, const char *classes, const char *less, const char *last,
                    const char *output)
{
    const struct entry entries[] = {
        { "sst.classes", classes }, { "sst.size", "64x48" }, { "sst.mean", less }, { "sst.output", output }
    };
    const float w[3] = { 1, 0, 0 };
    struct ow_buf graph = { 0 }, attrs = { 0 };

    ow_value(&graph, 11, "x", 3);
    ow_value(&graph, 12, "y", 1);
    ow_floats(&graph, "w", w, 1, 3, 1, 1);
    ow_attr_ints(&attrs, "kernel_shape", 2, 1, 1);
    ow_node(&graph, "Conv", "x w", "c", &attrs);
    if (!strcmp(last, "Softmax"))
        ow_attr_int(&attrs, "axis", 1);
    ow_node(&graph, last, "c", "y", &attrs);
    return open_graph(seg, &graph, 13, entries, output ? 4 : 3, 1);
}

/* A softmax over one channel would be 1 everywhere. */
static void one_channel_stands_against_the_background(void **state SST_UNUSED)
{
    static const struct {
        const char *classes, *less, *last, *output;
        double person; /* where R is 1 */
    } nets[] = {
        { "person", "0,0,0", "Identity", NULL, 0.731058579 },
        { "person", "3,0,0", "Identity", "logits", 0.119202922 },
        { "sky,person", "3,0,0", "Identity", NULL, 0.119202922 },
        { "person", "0.75,0,0", "Identity", "probabilities", 0.25 },
        { "person", "3,0,0", "Sigmoid", NULL, 0.119202922 }, /* OpenCV */
        { "person", "3,0,0", "Sigmoid", "probabilities", 0.119202922 },
    };
    struct sst_image img = new_image(64, 48, 255, 0, 0);
    struct sst_segmenter *seg;
    struct sst_map_u8 label;
    struct sst_map_f32 entropy;
    char said[SST_LOG_MAX], *before;
    float *prob;

    for (size_t i = 0; i < ARRAY_LEN(nets); i++) {
        const double p = nets[i].person, h = -p * log(p) - (1 - p) * log(1 - p);

        if (!WITH_OPENCV && !strcmp(nets[i].last, "Sigmoid"))
            break;
        assert_int_equal(open_one(&seg, nets[i].classes, nets[i].less, nets[i].last, nets[i].output), 0);
        assert_int_equal(sst_segmenter_classes(seg)->count, 2);
        assert_string_equal(sst_segmenter_classes(seg)->names[0], i == 2 ? "sky" : "background");
        assert_string_equal(sst_segmenter_classes(seg)->names[1], "person");
        assert_int_equal(sst_segment(seg, &img, &label, &entropy, &prob), 0);
        assert_int_equal(label.data[0], p > 0.5 ? 2 : 1);
        assert_true(fabs((double)prob[64 * 48] - p) < 1e-6 && fabs((double)prob[0] - (1 - p)) < 1e-6);
        assert_true(fabs((double)entropy.data[0] - h) < 1e-5);
        free(prob);
        sst_map_u8_fini(&label);
        sst_map_f32_fini(&entropy);
        assert_int_equal(sst_segment_hcsm(seg, &img, &label), 0);
        assert_int_equal(label.data[0], p > 0.5 ? 2 : 1);
        sst_map_u8_fini(&label);
        sst_segmenter_close(seg);
    }
    before = sst_log_hold_errors(said);
    assert_int_equal(open_one(&seg, "person", "-1,0,0", "Identity", "probabilities"), 0);
    assert_int_equal(sst_segment(seg, &img, &label, NULL, NULL), -EBADMSG);
    assert_contains(said, "above 1");
    sst_segmenter_close(seg);
    assert_int_equal(open_one(&seg, "Background", "0,0,0", "Identity", NULL), -EBADMSG);
    assert_contains(said, "which is implied");
    assert_int_equal(open_one(&seg, "a,b,c", "0,0,0", "Identity", NULL), -EBADMSG);
    assert_contains(said, "gives 1 channel for the 3 classes");
    for (int i = 0; i < 2; i++) {
        assert_int_equal(open_one(&seg, i ? "sky,person" : "person", "0,0,0", "Softmax", NULL), -EBADMSG);
        assert_contains(said, "ends in Softmax over its only channel");
    }
    sst_log_hold_errors(before);
    sst_image_fini(&img);
}

static void unfit_models_are_refused(void **state SST_UNUSED)
{
    static const struct entry bad[] = {
        { "sst.classes", "" },           { "sst.classes", "a,b" },
        { "sst.classes", "a,a,b" },      { "sst.classes", "a,,b" },
        { "sst.ground", "Sea" },         { "sst.mean", "0.5,0.5" },
        { "sst.mean", "1,2,3,4" },       { "sst.std", "0,1,1" },
        { "sst.std", "nan,1,1" },        { "sst.size", "480" },
        { "sst.size", "480x360 or so" }, { "sst.size", "1x1" },
        { "sst.epsilon_h", "-1" },       { "sst.temperature", "0" },
        { "sst.output", "classes" },     { "sst.classes", "a,b,a name that is longer than any class" },
    };
    struct sst_segmenter *seg = NULL;

    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        const struct entry entries[] = { bad[i], good[0] }; /* the first of two equal keys counts */

        assert_int_equal(open_segmenter(&seg, entries, 2, 3, 1), -EBADMSG);
    }
    assert_int_equal(open_segmenter(&seg, good, 0, 3, 1), -EBADMSG); /* no classes at all */
    assert_int_equal(open_segmenter(&seg, good, ARRAY_LEN(good), 4, 1), -EBADMSG);
    assert_int_equal(sst_segmenter_open(&seg, "/nonexistent/model.onnx", SST_PRECISION_F32, 1), -ENOENT);
    assert_null(seg);
}

/* Shrinking 5 to 2: means of [0, 2.5) and [2.5, 5). Growing 2 to 4: 0, 1/4, 3/4, 1 of the way. */
static void resampling_has_known_values(void **state SST_UNUSED)
{
    struct sst_image img = new_image(5, 1, 0, 0, 0);
    struct sst_mem_kept kept = { 0 };
    float out[3 * 4];
    struct resampled to = { out, 2, 1, { 0, 0, 0.5 }, { 1, 1, 0.5 } };

    for (int c = 0; c < 3; c++)
        memcpy(sst_image_row(&img, c, 0), (const uint8_t[]){ 10, 20, 30, 40, 255 }, 5);
    assert_int_equal(resample_planes(&to, &img, 2, &kept), 0);
    assert_true(fabs((double)out[0] - (10 + 20 + 15) / 2.5 / 255) < 1e-6);
    assert_true(fabs((double)out[1] - (15 + 40 + 255) / 2.5 / 255) < 1e-6);
    assert_true(fabs((double)out[4] - ((10 + 20 + 15) / 2.5 / 255 - 0.5) / 0.5) < 1e-6);
    img.width = 2;
    to.width = 4;
    assert_int_equal(resample_planes(&to, &img, 1, &kept), 0);
    for (int i = 0; i < 4; i++)
        assert_true(fabs((double)out[i] - ((const double[]){ 10, 12.5, 17.5, 20 })[i] / 255) < 1e-6);
    img.width = 5;
    sst_image_fini(&img);
    sst_mem_kept_fini(&kept);
}

static void models_are_found_by_name(void **state SST_UNUSED)
{
    char dir[] = "/tmp/sst-models-XXXXXX", path[SST_PATH_MAX], found[SST_PATH_MAX] = "untouched";

    assert_non_null(mkdtemp(dir));
    assert_int_equal(sst_path_join(path, dir, "a.onnx"), 0);
    assert_int_equal(sst_file_write(path, "x", 1), 0);
    assert_int_equal(setenv("SST_MODELS", dir, 1), 0);
    assert_int_equal(sst_model_path(found, "b.onnx"), -ENOPKG);
    assert_string_equal(found, "untouched");
    assert_int_equal(sst_model_path(found, "a.onnx"), 0);
    assert_string_equal(found, path);
    unsetenv("SST_MODELS");
    assert_int_equal(sst_model_path(found, "a.onnx"), -ENOPKG);
    sst_path_remove_tree(dir);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plain_image_gives_hand_worked_probabilities),
        cmocka_unit_test(labels_come_back_in_place),
        cmocka_unit_test(window_weights_have_known_values),
        cmocka_unit_test(window_weights_sum_to_one_everywhere),
        serial_test(windows_leave_no_seams),
        serial_test(windows_of_a_plain_image_agree),
        cmocka_unit_test(upsampling_follows_the_picture),
        cmocka_unit_test(networks_of_one_size_see_a_stretched_image),
        cmocka_unit_test(probabilities_are_taken_as_they_are),
        cmocka_unit_test(softmax_is_never_taken_twice),
        cmocka_unit_test(ends_that_contradict_are_named),
        cmocka_unit_test(one_channel_stands_against_the_background),
        cmocka_unit_test(unfit_models_are_refused),
        cmocka_unit_test(resampling_has_known_values),
        cmocka_unit_test(models_are_found_by_name),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
