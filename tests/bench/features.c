/* Error of learned matching features on a pair with truth: of the raw winner (no aggregation, no optimisation) and of
 * the whole chain. Prints one JSON object.
 *
 *   features LEFT RIGHT TRUTH.pfm MODEL.onnx f32|int8 SCALE     SCALE 2: matched at half size */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/eval/eval.h"
#include "pipeline/image/codec.h"
#include "pipeline/method/disparity/stage.h"

#define DISPARITIES 64 /* the truth of the Middlebury pairs lies within 0..63 px */
#define THREADS     2

struct pair {
    struct sst_image left, right;
    struct sst_map_f32 truth;
};

static int load(struct pair *p, char **files)
{
    int err = sst_image_read(&p->left, files[0]);

    err = err ? err : sst_image_read(&p->right, files[1]);
    return err ? err : sst_map_f32_read_pfm(&p->truth, files[2]);
}

/* Winner of each pixel's own costs, brought to the pair's size. */
static int winner(struct sst_map_f32 *out, const struct sst_descriptor *left, const struct sst_descriptor *right,
                  const struct pair *p, int scale)
{
    const struct sst_neighbour neighbour = { right, 1, 0 };
    struct sst_map_u16 disp = { 0 };
    struct sst_map_u8 confidence = { 0 };
    struct sst_volume v = { 0 };
    int err = sst_volume_init(&v, left->width, left->height, 0, DISPARITIES / scale);

    err = err ? err : sst_map_u16_init(&disp, left->width, left->height);
    err = err ? err : sst_map_u8_init(&confidence, left->width, left->height);
    if (!err) {
        sst_volume_fill(&v, left, &neighbour, 1);
        err = sst_volume_winner(&v, true, &disp, &confidence);
    }
    err = err ? err : sst_map_f32_init(out, p->left.width, p->left.height);
    for (int y = 0; !err && y < out->height; y++) {
        for (int x = 0; x < out->width; x++)
            sst_map_f32_row(out, y)[x] = (float)sst_map_u16_row(&disp, y / scale)[x / scale] / 64 * (float)scale;
    }
    sst_volume_fini(&v);
    sst_map_u16_fini(&disp);
    sst_map_u8_fini(&confidence);
    return err;
}

static int raw(struct sst_map_f32 *out, const struct pair *p, const struct sst_disparity_config *cfg)
{
    struct sst_descriptor left = { 0 }, right = { 0 };
    struct sst_network *net = NULL;
    int err = sst_network_open(&net, cfg->model, cfg->precision, THREADS);

    err = err ? err : sst_descriptor_init(&left, &p->left, cfg->scale, SST_COST_MCCNN, net);
    err = err ? err : sst_descriptor_init(&right, &p->right, cfg->scale, SST_COST_MCCNN, net);
    err = err ? err : winner(out, &left, &right, p, cfg->scale);
    sst_descriptor_fini(&left);
    sst_descriptor_fini(&right);
    sst_network_close(net);
    return err;
}

static int print(const char *name, const struct sst_map_f32 *disp, const struct pair *p)
{
    struct sst_disparity_error e;
    const int err = sst_eval_disparity(&e, disp, &p->truth, NULL);

    if (!err)
        printf("\"%s\": {\"bad1\": %.4f, \"bad2\": %.4f, \"bad4\": %.4f}", name, e.bad1, e.bad2, e.bad4);
    return err;
}

int main(int argc, char **argv)
{
    struct sst_map_f32 winners = { 0 }, chain = { 0 };
    struct sst_disparity_config cfg;
    struct pair p = { 0 };
    int err;

    if (argc != 7 || sst_disparity_preset(&cfg, "accurate")) {
        fprintf(stderr, "usage: features LEFT RIGHT TRUTH.pfm MODEL.onnx f32|int8 SCALE\n");
        return 2;
    }
    cfg.disp_max_px = DISPARITIES - 1;
    cfg.model = argv[4];
    cfg.precision = strcmp(argv[5], "int8") ? SST_PRECISION_F32 : SST_PRECISION_INT8;
    cfg.scale = atoi(argv[6]) == 2 ? 2 : 1;
    cfg.threads = THREADS;
    err = load(&p, argv + 1);
    err = err ? err : raw(&winners, &p, &cfg);
    err = err ? err : sst_disparity_stereo(&chain, &p.left, &p.right, &cfg);
    if (!err) {
        printf("{");
        err = print("raw", &winners, &p);
        printf(", ");
        err = err ? err : print("chain", &chain, &p);
        puts("}");
    }
    sst_map_f32_fini(&winners);
    sst_map_f32_fini(&chain);
    sst_image_fini(&p.left);
    sst_image_fini(&p.right);
    sst_map_f32_fini(&p.truth);
    return err ? 1 : 0;
}
