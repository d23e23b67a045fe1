/* Descriptions of networks (YAML beside them, metadata inside them) and manifests. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/labels/model_info.h"
#include "pipeline/method/network/manifest.h"
#include "tests/folder.h"
#include "tests/onnx_writer.h"
#include "tests/test.h"

static char said[SST_LOG_MAX]; /* the last error */
static int parse(struct sst_model_info *info, const char *yaml)
{
    char *before = sst_log_hold_errors(said);
    const int err = sst_labels_model_info_parse(info, NULL, "m.onnx", &(struct sst_model_yaml){ yaml, strlen(yaml), "m.yaml" });

    sst_log_hold_errors(before);
    return err;
}

static void write_file(const char *name, const void *data, size_t n)
{
    assert_int_equal(sst_file_write(test_path("%s", name), data, n), 0);
}

/* y = x in `channels` channels, of a fixed size where height is not 0. */
static struct ow_buf identity_net(int channels, int height, int width, const char *classes)
{
    float w[16] = { 0 };
    struct ow_buf g = { 0 }, value = { 0 }, type = { 0 }, tensor = { 0 }, shape = { 0 }, model;

    for (int i = 0; i < channels; i++)
        w[i * channels + i] = 1;
    if (height) {
        const int dims[] = { 1, channels, height, width };

        for (int i = 0; i < 4; i++) {
            struct ow_buf dim = { 0 };

            ow_int(&dim, 1, dims[i]);
            ow_take(&shape, 1, &dim);
        }
        ow_int(&tensor, 1, 1);
        ow_take(&tensor, 2, &shape);
        ow_take(&type, 1, &tensor);
        ow_str(&value, 1, "x");
        ow_take(&value, 2, &type);
        ow_take(&g, 11, &value);
    } else {
        ow_value(&g, 11, "x", channels);
    }
    ow_value(&g, 12, "y", channels);
    ow_floats(&g, "w", w, channels, channels, 1, 1);
    ow_node(&g, "Conv", "x w", "y", NULL);
    model = ow_model(&g, 13);
    if (classes)
        ow_metadata(&model, "sst.classes", classes);
    return model;
}

static int open_net(struct sst_segmenter **seg, struct ow_buf model, const char *yaml)
{
    char *before;
    int err;

    write_file("m.onnx", model.p, model.n);
    free(model.p);
    remove(test_path("m.yaml"));
    if (yaml)
        write_file("m.yaml", yaml, strlen(yaml));
    before = sst_log_hold_errors(said);
    err = sst_segmenter_open(seg, test_path("m.onnx"), SST_PRECISION_F32, 1);
    sst_log_hold_errors(before);
    return err;
}

static void every_key_is_read(void **state SST_UNUSED)
{
    struct sst_model_info info;

    assert_int_equal(parse(&info, "classes: [Road, rider, person, pole]\nlabels: {rider: person}\nground: [road]\n"
                                  "mean: [51, 102, 153]\nscale: 0.02\nrange: 0..255\ncolour: bgr\nsize: 512x256\n"
                                  "output: probabilities\nepsilon_h: 0.5\ntemperature: 2\n"),
                     0);
    assert_int_equal(info.channels, 4);
    assert_int_equal(info.classes.count, 3);
    assert_string_equal(info.classes.names[1], "person");
    assert_true(info.class_of[0] == 0 && info.class_of[1] == 1 && info.class_of[2] == 1 && info.class_of[3] == 2);
    assert_true(info.classes.ground[0] && !info.classes.ground[1]);
    /* in the units of 0..1: 51 / 255 and 1 / 0.02 / 255 */
    assert_true(fabs(info.mean[0] - 0.2) < 1e-12 && fabs(info.mean[2] - 0.6) < 1e-12);
    assert_true(fabs(info.std[1] - 50 / 255.0) < 1e-12);
    assert_true(info.bgr && info.probabilities && info.width == 512 && info.height == 256);
    assert_true(info.eps_h == 0.5 && info.temperature == 2 && !info.fixed_size);
    assert_int_equal(parse(&info, "classes: {1: b, 0: a}\n"), 0);
    assert_string_equal(info.classes.names[0], "a");
    assert_true(info.mean[0] == 0 && info.std[2] == 1 && isinf(info.eps_h) && info.width == 480);
}

static void faults_of_descriptions(void **state SST_UNUSED)
{
    static const struct {
        const char *text, *said;
    } bad[] = {
        { "", "m.yaml:1:1: the file must contain keys" },
        { "mean: 1\n", "m.yaml:1:1: lacks the key `classes`" },
        { "classes: road\n", "1:10: classes must be a list of names" },
        { "classes: []\n", "classes must be a list of names" },
        { "classes: [a, A]\n", "1:14: classes must be a list of different names; `A` is not allowed" },
        { "classes: {0: a, 2: b}\n", "2 entries but none for channel 1" },
        { "classes: [a, a name that is longer than any class may be]\n", "1:14: classes is longer than 31 bytes" },
        { "classes: [a]\nground: [b]\n", "2:10: ground names the unknown class `b`" },
        { "classes: [a]\nlabels: {b: c}\n", "2:10: unknown key `b`" },
        { "classes: [a]\nmean: [1, 2]\n", "2:7: mean must be a list of 3 numbers" },
        { "classes: [a]\nmean: [1, .nan, 2]\n", "2:11: mean must be a number" },
        { "classes: [a]\nstd: 0\n", "2:6: std must be a number in 1e-06..1000000, not 0" },
        { "classes: [a]\nstd: 1\nscale: 1\n", "3:8: scale and std set the same value" },
        { "classes: [a]\nsize: 480\n", "2:7: size must be WIDTHxHEIGHT" },
        { "classes: [a]\nsize: 4x4\n", "2:7: size must be WIDTHxHEIGHT" },
        { "classes: [a]\noutput: softmax\n", "2:9: output must be logits or probabilities, not softmax" },
        { "classes: [a]\ncolour: grey\n", "2:9: colour must be rgb or bgr, not grey" },
        { "classes: [a]\nrange: 255\n", "2:8: range must be 0..1 or 0..255, not 255" },
        { "classes: [a]\ntemperature: 0\n", "2:14: temperature must be a number" },
        { "classes: [a]\nepsilon_h: -1\n", "2:12: epsilon_h must be a number" },
    };
    struct sst_model_info info = { .channels = -7 };
    char many[4096] = "classes: [";

    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        assert_int_equal(parse(&info, bad[i].text), -EBADMSG);
        assert_contains(said, bad[i].said);
    }
    for (int i = 0; i < 65; i++)
        snprintf(many + strlen(many), sizeof(many) - strlen(many), "c%d, ", i);
    strcat(many, "]\n");
    assert_int_equal(parse(&info, many), -EBADMSG);
    assert_contains(said, "65 channels make more than 64 classes");
    assert_int_equal(info.channels, -7); /* untouched */
    strcat(many, "labels: {c64: c0}\n");
    assert_int_equal(parse(&info, many), 0);
    assert_true(info.channels == 65 && info.classes.count == 64 && info.class_of[64] == 0);
}

/* The file beside the network wins over the network's own entries, one by one. */
static void the_file_beside_wins(void **state SST_UNUSED)
{
    struct sst_segmenter *seg;

    assert_int_equal(open_net(&seg, identity_net(3, 0, 0, "Sky, Road, Tree"), "temperature: 3\nground: [Road]\n"), 0);
    assert_string_equal(sst_segmenter_classes(seg)->names[2], "Tree");
    assert_true(sst_segmenter_info(seg)->temperature == 3 && sst_segmenter_classes(seg)->ground[1]);
    sst_segmenter_close(seg);
    assert_int_equal(open_net(&seg, identity_net(3, 0, 0, "Sky, Road, Tree"), "classes: [a, b, c]\n"), 0);
    assert_string_equal(sst_segmenter_classes(seg)->names[0], "a");
    sst_segmenter_close(seg);
    assert_int_equal(open_net(&seg, identity_net(3, 0, 0, "Sky, Road, Tree"), NULL), 0);
    assert_string_equal(sst_segmenter_classes(seg)->names[0], "Sky");
    sst_segmenter_close(seg);
    write_file("m.onnx.yaml", "classes: [a]\n", 13);
    assert_int_equal(open_net(&seg, identity_net(3, 0, 0, NULL), "classes: [a, b, c]\n"), -EBADMSG);
    assert_contains(said, "two descriptions");
    assert_int_equal(open_net(&seg, identity_net(3, 0, 0, NULL), NULL), -EBADMSG);
    assert_contains(said, "3 channels for the 1 class ");
    write_file("m.onnx.yaml", "", 0);
    assert_int_equal(open_net(&seg, identity_net(3, 0, 0, NULL), NULL), -EBADMSG);
    remove(test_path("m.onnx.yaml"));
    assert_int_equal(open_net(&seg, identity_net(3, 0, 0, NULL), NULL), -EBADMSG);
    assert_contains(said, "does not name the classes");
    assert_int_equal(open_net(&seg, identity_net(4, 0, 0, "a,b,c,d"), NULL), -EBADMSG);
    assert_contains(said, "takes 4 channels");
}

static struct sst_image plain_image(int r, int g, int b)
{
    const int value[3] = { r, g, b };
    struct sst_image img;

    assert_int_equal(sst_image_init(&img, 40, 30), 0);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < 30; y++)
            memset(sst_image_row(&img, c, y), value[c], 40);
    }
    return img;
}

/* Input channels are B, G, R minus 10, 20, 30, over 51: (110 - 10) / 51, (71 - 20) / 51, (30 - 30) / 51; as
 * probabilities they are 100 : 51 : 0, and the first and the last channel are one class. */
static void colours_ranges_and_joined_channels(void **state SST_UNUSED)
{
    struct sst_image img = plain_image(30, 71, 110);
    struct sst_segmenter *seg;
    struct sst_map_u8 label;
    float *prob;

    assert_int_equal(open_net(&seg, identity_net(3, 16, 24, NULL),
                              "classes: [a, b, c]\nlabels: {c: a}\nmean: [10, 20, 30]\nstd: 51\nrange: 0..255\n"
                              "colour: bgr\noutput: probabilities\n"),
                     0);
    assert_true(sst_segmenter_info(seg)->fixed_size);
    assert_true(sst_segmenter_info(seg)->width == 24 && sst_segmenter_info(seg)->height == 16);
    assert_int_equal(sst_segmenter_classes(seg)->count, 2);
    assert_int_equal(sst_segment(seg, &img, &label, NULL, &prob), 0);
    for (int i = 0; i < 40 * 30; i++) {
        assert_int_equal(sst_map_u8_row(&label, i / 40)[i % 40], 1);
        assert_true(fabs((double)prob[i] - 100.0 / 151) < 1e-5);
        assert_true(fabs((double)prob[1200 + i] - 51.0 / 151) < 1e-5);
    }
    free(prob);
    sst_map_u8_fini(&label);
    sst_segmenter_close(seg);
    assert_int_equal(open_net(&seg, identity_net(3, 16, 24, NULL), "classes: [a, b, c]\nsize: 48x32\n"), -EBADMSG);
    assert_contains(said, "24x16 only");
    sst_image_fini(&img);
}

/* The luma of (255, 0, 0) is 0.299; minus 0.1, over 0.5. */
static void grey_networks_see_the_luma(void **state SST_UNUSED)
{
    const float w[2] = { 1, 0 }, b[2] = { 0, 0.1f };
    struct sst_image img = plain_image(255, 0, 0);
    struct ow_buf g = { 0 };
    struct sst_segmenter *seg;
    struct sst_map_u8 label;
    float *prob;

    ow_value(&g, 11, "x", 1);
    ow_value(&g, 12, "y", 2);
    ow_floats(&g, "w", w, 2, 1, 1, 1);
    ow_floats(&g, "b", b, 2, 0, 0, 0);
    ow_node(&g, "Conv", "x w b", "y", NULL);
    assert_int_equal(
        open_net(&seg, ow_model(&g, 13), "classes: [bright, dark]\nmean: 0.1\nstd: 0.5\noutput: probabilities\n"), 0);
    assert_int_equal(sst_segment(seg, &img, &label, NULL, &prob), 0);
    assert_true(fabs((double)prob[0] - 0.398 / 0.498) < 1e-5);
    assert_int_equal(label.data[0], 1);
    free(prob);
    sst_map_u8_fini(&label);
    sst_segmenter_close(seg);
    sst_image_fini(&img);
}

/* --- ends that no segmentation network has --- */

static int open_ends(const int in_dims[4], int in_type, int out_type)
{
    const float w[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };
    struct sst_segmenter *seg;
    struct ow_buf g = { 0 };

    for (int end = 0; end < 2; end++) {
        struct ow_buf value = { 0 }, type = { 0 }, tensor = { 0 }, shape = { 0 };

        for (int i = 0; i < 4; i++) {
            struct ow_buf dim = { 0 };

            ow_int(&dim, 1, in_dims[i]);
            ow_take(&shape, 1, &dim);
        }
        ow_int(&tensor, 1, end ? out_type : in_type);
        ow_take(&tensor, 2, &shape);
        ow_take(&type, 1, &tensor);
        ow_str(&value, 1, end ? "y" : "x");
        ow_take(&value, 2, &type);
        ow_take(&g, end ? 12 : 11, &value);
    }
    ow_floats(&g, "w", w, 3, 3, 1, 1);
    ow_node(&g, "Conv", "x w", "y", NULL);
    return open_net(&seg, ow_model(&g, 13), "classes: [a, b, c]\n");
}

static void other_ends_are_refused_with_the_reason(void **state SST_UNUSED)
{
    const int nchw[4] = { 1, 3, 32, 48 }, nhwc[4] = { 1, 32, 48, 3 }, batch[4] = { 8, 3, 32, 48 };

    assert_int_equal(open_ends(nchw, 1, 7), -EBADMSG);
    assert_contains(said, "ArgMax");
    assert_int_equal(open_ends(nhwc, 1, 1), -EBADMSG);
    assert_contains(said, "NHWC");
    assert_int_equal(open_ends(nchw, 2, 1), -EBADMSG);
    assert_contains(said, "32-bit floats");
    assert_int_equal(open_ends(batch, 1, 1), -EBADMSG);
    assert_contains(said, "1 x C x height x width");
}

/* One result for the whole image. */
static void classifiers_are_refused(void **state SST_UNUSED)
{
    struct sst_segmenter *seg;
    struct ow_buf g = { 0 };

    ow_value(&g, 11, "x", 3);
    ow_value(&g, 12, "y", 3);
    ow_node(&g, "GlobalAveragePool", "x", "y", NULL);
    assert_int_equal(open_net(&seg, ow_model(&g, 13), "classes: [a, b, c]\nsize: 160x120\n"), -EBADMSG);
    assert_contains(said, "1x1 results for an image of 160x120");
}

/* --- manifests --- */

#define ENTRY(file, kind, bytes, sha, figure)                                                                          \
    "{\"file\": \"" file "\", \"kind\": \"" kind "\", \"bytes\": " bytes ", \"sha256\": \"" sha                        \
    "\", \"licence\": \"l\","                                                                                          \
    " \"training_data\": \"t\", \"description\": \"d\", \"figures\": {\"miou\": " figure "}}"
#define MANIFEST(entries) "{\"format\": \"sst-models\", \"version\": 1, \"models\": [" entries "]}"
/* SHA-256 of "abc", from FIPS 180-2 */
#define ABC "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"

static void manifests_are_checked(void **state SST_UNUSED)
{
    static const struct {
        const char *text, *said;
    } bad[] = {
        { "{\"format\": \"sst-models\",\n \"version\": 1,, }", "t:2:15: " },
        { "{\"format\": \"sst-models\", \"version\": 2, \"models\": []}", "version is not 1" },
        { "{\"format\": \"sst-models\", \"version\": 1}", "models is not a list" },
        { "[]", "version is not 1" },
        { MANIFEST("{}"), "models[0]: " },
        { MANIFEST("3"), "models[0]: " },
        { MANIFEST(ENTRY("a", "labels", "3", ABC, "1") "," ENTRY("a", "labels", "3", ABC, "1")),
          "models[1]: file is listed twice" },
        { MANIFEST(ENTRY("../a", "labels", "3", ABC, "1")), "plain file name" },
        { MANIFEST(ENTRY("a", "net", "3", ABC, "1")), "kind" },
        { MANIFEST(ENTRY("a", "labels", "0", ABC, "1")), "bytes" },
        { MANIFEST(ENTRY("a", "labels", "3", "abc", "1")), "sha256" },
        { MANIFEST(ENTRY("a", "labels", "3", ABC, "\"x\"")), "figures" },
    };
    const char *good = MANIFEST(ENTRY("a.onnx", "matching", "3", ABC, "1.5"));
    struct sst_manifest m;
    char *before;

    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        before = sst_log_hold_errors(said);
        assert_int_equal(sst_manifest_parse(&m, bad[i].text, strlen(bad[i].text), "t"), -EBADMSG);
        sst_log_hold_errors(before);
        assert_contains(said, bad[i].said);
    }
    assert_int_equal(sst_manifest_parse(&m, "{\"name\": \"a web page\"}", 22, "t"), -ENOENT);
    assert_int_equal(sst_manifest_parse(&m, good, strlen(good), "t"), 0);
    assert_int_equal(m.n, 1);
    assert_null(sst_manifest_find(&m, "b.onnx"));
    assert_true(sst_manifest_matches(sst_manifest_find(&m, "a.onnx"), (const uint8_t *)"abc", 3));
    assert_false(sst_manifest_matches(sst_manifest_find(&m, "a.onnx"), (const uint8_t *)"abd", 3));
    assert_false(sst_manifest_matches(sst_manifest_find(&m, "a.onnx"), (const uint8_t *)"abcd", 4));
    sst_manifest_fini(&m);
}

/* A listed file must be the one that is listed; others are free. */
static void listed_networks_must_be_themselves(void **state SST_UNUSED)
{
    const char *text = MANIFEST(ENTRY("m.onnx", "labels", "3", ABC, "1"));
    const char *other = MANIFEST(ENTRY("n.onnx", "labels", "3", ABC, "1"));
    struct sst_segmenter *seg;

    write_file(SST_MANIFEST_NAME, text, strlen(text));
    assert_int_equal(open_net(&seg, identity_net(3, 0, 0, "a,b,c"), NULL), -EBADMSG);
    assert_contains(said, "another SHA-256");
    assert_contains(said, "install the networks again");
    write_file(SST_MANIFEST_NAME, other, strlen(other));
    assert_int_equal(open_net(&seg, identity_net(3, 0, 0, "a,b,c"), NULL), 0);
    sst_segmenter_close(seg);
    write_file(SST_MANIFEST_NAME, "{\n\"x\"", 5);
    assert_int_equal(open_net(&seg, identity_net(3, 0, 0, "a,b,c"), NULL), -EBADMSG);
    assert_contains(said, "manifest.json:2:");
    remove(test_path(SST_MANIFEST_NAME));
}

/* Shipped networks equal the list of the manifest. */
static void the_manifest_that_ships_is_right(void **state SST_UNUSED)
{
    struct sst_manifest m;

    assert_int_equal(sst_manifest_load(&m, "models"), 0);
    assert_true(m.n >= 2);
    for (int i = 0; i < m.n; i++) {
        char path[SST_PATH_MAX];
        uint8_t *data;
        size_t size;

        assert_int_equal(sst_path_join(path, "models", m.entries[i].file), 0);
        assert_int_equal(sst_file_read(path, (size_t)64 << 20, &data, &size), 0);
        if (!sst_manifest_matches(&m.entries[i], data, size))
            fail_msg("%s is not the file that the manifest lists; run models/manifest.py", path);
        free(data);
    }
    sst_manifest_fini(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_key_is_read),
        cmocka_unit_test(faults_of_descriptions),
        cmocka_unit_test(the_file_beside_wins),
        cmocka_unit_test(colours_ranges_and_joined_channels),
        cmocka_unit_test(grey_networks_see_the_luma),
        cmocka_unit_test(other_ends_are_refused_with_the_reason),
        cmocka_unit_test(classifiers_are_refused),
        cmocka_unit_test(manifests_are_checked),
        cmocka_unit_test(listed_networks_must_be_themselves),
        cmocka_unit_test(the_manifest_that_ships_is_right),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
