/* Times kernels and stages of the pipeline beside loops that load one part of the processor, in turn: check ROUNDS
 * [NAME ...]. Prints CSV, a line for each round and part: CPU milliseconds. Everything runs on one thread, on a small
 * bush made in memory, so that a change of the machine's load changes stages and loops alike (scripts/bench_check.py).
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/image/classes.h"
#include "pipeline/image/codec.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/kernels/sha256.h"
#include "pipeline/live/live.h"
#include "pipeline/method/disparity/disparity.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/network/model_path.h"
#include "pipeline/method/refine/refine.h"
#include "pipeline/method/render/render.h"
#include "simulators/scene/scene.h"

#define WIDTH        400
#define HEIGHT       300
#define MEMORY_BYTES ((size_t)48 << 20)
#define LIVE_SIDE    4
#define LIVE_VIEWS   (LIVE_SIDE * LIVE_SIDE)
#define LIVE_TIMES   2
#define SCATTER      (1u << 20) /* entries of 4 bytes: 4 MiB, more than the second level of cache */

struct bench {
    struct sst_lightfield lf; /* with true maps */
    struct sst_scene *scene;
    struct sst_renderer *renderer;
    struct sst_render_config render;
    struct sst_segmenter *segmenter; /* NULL: no network */
    char folder[32];                 /* for save and load */
    struct sst_live *live;
    struct sst_livepicture *picture;
    struct sst_live_input in[LIVE_TIMES]; /* frames of a walker at two times */
    int sets;                             /* fed to live so far */
    struct sst_image out;
    uint64_t *memory;
    uint32_t *scatter;
    uint64_t sink; /* keeps the loops */
};

static int make_view(struct bench *b, struct sst_view *v)
{
    struct sst_map_f32 disp = { 0 };
    int err = sst_image_init(&v->image, WIDTH, HEIGHT);

    err = err ? err : sst_map_u16_init(&v->disp, WIDTH, HEIGHT);
    err = err ? err : sst_map_u8_init(&v->label, WIDTH, HEIGHT);
    err = err ? err : sst_map_f32_init(&disp, WIDTH, HEIGHT);
    err = err ? err
              : sst_scene_render(b->scene, v->bx, v->by, 0,
                                 &(struct sst_scene_maps){ .image = &v->image, .disp = &disp, .label = &v->label });
    for (int i = 0; !err && i < WIDTH * HEIGHT; i++)
        sst_map_u16_row(&v->disp, i / WIDTH)[i % WIDTH] =
            sst_disp_q6(&b->lf, sst_map_f32_row(&disp, i / WIDTH)[i % WIDTH]);
    sst_map_f32_fini(&disp);
    v->present = true;
    return err;
}

/* The frame of a camera at a time. */
static int make_frame(struct sst_live_input *in, const struct sst_scene *scene, int cam)
{
    struct sst_image image = { 0 };
    uint8_t *data = NULL;
    size_t bytes = 0;
    int err = sst_image_init(&image, WIDTH, HEIGHT);

    err = err ? err
              : sst_scene_render(scene, cam % LIVE_SIDE - (LIVE_SIDE - 1) / 2, cam / LIVE_SIDE - (LIVE_SIDE - 1) / 2, 0,
                                 &(struct sst_scene_maps){ .image = &image });
    err = err ? err : sst_image_encode_jpeg(&image, 80, &data, &bytes);
    in->frame[cam].data = data;
    in->frame[cam].bytes = bytes;
    sst_image_fini(&image);
    return err;
}

static int open_live(struct bench *b)
{
    struct sst_live_config cfg = { .rows = LIVE_SIDE,
                                   .cols = LIVE_SIDE,
                                   .fourcc = V4L2_PIX_FMT_MJPEG,
                                   .width = WIDTH,
                                   .height = HEIGHT,
                                   .threads = 1,
                                   .skip_change = true,
                                   .skip_labels = true };
    int err = 0;

    for (int t = 0; t < LIVE_TIMES && !err; t++) {
        struct sst_scene_config at;
        struct sst_scene *scene;

        sst_scene_config_defaults(&at);
        at.width = WIDTH;
        at.height = HEIGHT;
        at.rows = at.cols = LIVE_SIDE;
        at.time_s = 0.5 + 0.1 * t;
        err = sst_scene_create(&scene, "pedestrian", &at);
        if (err)
            return err;
        for (int cam = 0; cam < LIVE_VIEWS && !err; cam++)
            err = make_frame(&b->in[t], scene, cam);
        sst_scene_destroy(scene);
    }
    for (int k = 0; k < LIVE_VIEWS; k++)
        cfg.present[k] = true;
    err = err ? err : sst_live_open(&b->live, &cfg);
    return err ? err : sst_livepicture_create(&b->picture, b->live);
}

static int open_network(struct bench *b)
{
    char path[SST_PATH_MAX];

    return sst_model_find(path, "pspnet-small.onnx") ? 0
                                                     : sst_segmenter_open(&b->segmenter, path, SST_PRECISION_AUTO, 1);
}

static int bench_init(struct bench *b)
{
    struct sst_scene_config cfg;
    int err;

    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    err = sst_scene_create(&b->scene, "bush", &cfg);
    err = err ? err : sst_lightfield_init(&b->lf, cfg.rows, cfg.cols);
    if (err)
        return err;
    b->lf.width = WIDTH;
    b->lf.height = HEIGHT;
    sst_scene_range(b->scene, &b->lf.range_min_px, &b->lf.range_max_px);
    b->lf.disp_min_px = floor(b->lf.range_min_px);
    b->lf.classes = sst_classes_default;
    for (int k = 0; !err && k < cfg.rows * cfg.cols; k++)
        err = make_view(b, &b->lf.views[k]);
    err = err ? err : sst_renderer_create(&b->renderer, &b->lf, 1);
    err = err ? err : sst_image_init(&b->out, WIDTH, HEIGHT);
    b->memory = err ? NULL : sst_mem_alloc(MEMORY_BYTES, 1);
    b->scatter = err ? NULL : sst_mem_alloc(SCATTER, sizeof(*b->scatter));
    sst_render_config_defaults(&b->render);
    b->render.focus_px = sst_scene_occluder_at(b->scene, 0)->focus_px;
    b->render.threads = 1;
    b->render.verify = SST_VERIFY_OFF;
    err = err ? err : open_live(b);
    err = err ? err : open_network(b);
    snprintf(b->folder, sizeof(b->folder), "/tmp/sst-check-XXXXXX");
    if (!err && !mkdtemp(b->folder))
        err = -errno;
    return err ? err : b->memory && b->scatter ? 0 : -ENOMEM;
}

static void bench_fini(struct bench *b)
{
    if (b->folder[0])
        sst_path_remove_tree(b->folder);
    sst_livepicture_destroy(b->picture);
    sst_live_close(b->live);
    for (int i = 0; i < LIVE_TIMES * LIVE_VIEWS; i++)
        free((void *)b->in[i / LIVE_VIEWS].frame[i % LIVE_VIEWS].data);
    sst_segmenter_close(b->segmenter);
    sst_renderer_destroy(b->renderer);
    sst_image_fini(&b->out);
    sst_lightfield_fini(&b->lf);
    sst_scene_destroy(b->scene);
    sst_mem_free(b->memory);
    sst_mem_free(b->scatter);
}

/* --- reference loops ---------------------------------------------------------------------------------------------- */

/* Reads memory with many sums side by side: bound by its bandwidth. */
static int loop_memory(struct bench *b)
{
    uint64_t sum[16] = { 0 };

    for (int pass = 0; pass < 16; pass++) {
        for (size_t i = 0; i < MEMORY_BYTES / sizeof(uint64_t); i += 16) {
            for (size_t k = 0; k < 16; k++)
                sum[k] += b->memory[i + k] ^ (uint64_t)pass;
        }
    }
    for (size_t k = 0; k < 16; k++)
        b->sink += sum[k];
    return 0;
}

/* Integers side by side in the first level of cache. */
static int loop_vector(struct bench *b)
{
    uint16_t a[2048], c[2048];

    for (size_t k = 0; k < ARRAY_LEN(a); k++) {
        a[k] = (uint16_t)k;
        c[k] = (uint16_t)(7 * k);
    }
    for (int i = 0; i < 200000; i++) {
        for (size_t k = 0; k < ARRAY_LEN(a); k++)
            a[k] = (uint16_t)((a[k] ^ c[k]) + i);
    }
    for (size_t k = 0; k < ARRAY_LEN(a); k++)
        b->sink += a[k];
    return 0;
}

/* A chain of dependent operations. */
static int loop_scalar(struct bench *b)
{
    uint64_t x = 88172645463325252ull;

    for (int i = 0; i < 20000000; i++) {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
    }
    b->sink += x;
    return 0;
}

/* Updates at scattered places, beyond the second level of cache. */
static int loop_scatter(struct bench *b)
{
    uint32_t x = 12345;

    for (int i = 0; i < 20000000; i++) {
        x = x * 1664525u + 1013904223u;
        b->scatter[x >> 12]++;
    }
    return 0;
}

/* --- stages ------------------------------------------------------------------------------------------------------- */

static int render(struct bench *b, enum sst_render_method method, enum sst_render_verify verify, int times)
{
    struct sst_render_config cfg = b->render;
    int err = 0;

    cfg.method = method;
    cfg.verify = verify;
    if (method == SST_RENDER_CLEAR)
        err = sst_render_find_cut(b->renderer, &cfg.cut_px);
    for (int i = 0; !err && i < times; i++)
        err = sst_render(b->renderer, &cfg, &b->out, NULL);
    return err;
}

static int render_refocus(struct bench *b)
{
    return render(b, SST_RENDER_REFOCUS, SST_VERIFY_OFF, 16);
}

static int render_see_through(struct bench *b)
{
    return render(b, SST_RENDER_SST, SST_VERIFY_OFF, 8);
}

static int render_verified(struct bench *b)
{
    return render(b, SST_RENDER_SST, SST_VERIFY_ON, 1);
}

static int render_clear(struct bench *b)
{
    return render(b, SST_RENDER_CLEAR, SST_VERIFY_OFF, 2);
}

/* A copy of the first rows and columns of views, matched and forgotten. */
static int match(const struct bench *b, const char *preset, int rows, int cols)
{
    struct sst_disparity_config cfg;
    struct sst_lightfield lf = { 0 };
    int err = sst_lightfield_init(&lf, rows, cols);

    if (err)
        return err;
    lf.width = WIDTH;
    lf.height = HEIGHT;
    for (int k = 0; !err && k < rows * cols; k++) {
        lf.views[k].image = b->lf.views[k / cols * b->lf.cols + k % cols].image; /* borrowed */
        lf.views[k].present = true;
    }
    err = sst_disparity_preset(&cfg, preset);
    cfg.cost = SST_COST_CENSUS;
    cfg.disp_min_px = b->lf.range_min_px;
    cfg.disp_max_px = b->lf.range_max_px;
    cfg.threads = 1;
    err = err ? err : sst_disparity_lightfield(&lf, &cfg, NULL, NULL);
    for (int k = 0; k < rows * cols; k++)
        lf.views[k].image = (struct sst_image){ 0 };
    sst_lightfield_fini(&lf);
    return err;
}

static int match_pair(struct bench *b)
{
    return match(b, "balanced", 1, 2);
}

static int match_pair_preview(struct bench *b)
{
    int err = 0;

    for (int i = 0; !err && i < 4; i++)
        err = match(b, "preview", 1, 2);
    return err;
}

static int match_pair_accurate(struct bench *b)
{
    return match(b, "accurate", 1, 2);
}

static int match_preview(struct bench *b)
{
    return match(b, "preview", 4, 4);
}

static int match_balanced(struct bench *b)
{
    return match(b, "balanced", 3, 3);
}

/* The labels of every third row are forgotten and found again. */
static int refine(struct bench *b)
{
    struct sst_refine_config cfg;

    sst_refine_config_defaults(&cfg);
    cfg.threads = 1;
    for (int k = 0; k < 4; k++) {
        for (int y = 0; y < HEIGHT; y += 3)
            memset(sst_map_u8_row(&b->lf.views[k].label, y), 0, WIDTH);
    }
    return sst_refine_labels(&b->lf, &cfg, NULL);
}

/* Two views through the network; 1: there is none, nothing is measured. */
static int label(struct bench *b)
{
    int err = b->segmenter ? 0 : 1;

    for (int k = 0; !err && k < 2; k++) {
        struct sst_map_u8 map = { 0 };

        err = sst_segment_hcsm(b->segmenter, &b->lf.views[k].image, &map);
        sst_map_u8_fini(&map);
    }
    return err;
}

/* Views, disparities and labels of four views written as pictures, and read again. */
static int path_of(const struct bench *b, char path[SST_PATH_MAX], int k, const char *kind)
{
    char name[32];

    snprintf(name, sizeof(name), "%d-%s.png", k, kind);
    return sst_path_join(path, b->folder, name);
}

static int save(struct bench *b)
{
    char path[SST_PATH_MAX];
    int err = 0;

    for (int k = 0; !err && k < 4; k++) {
        const struct sst_view *v = &b->lf.views[k];

        err = path_of(b, path, k, "view");
        err = err ? err : sst_image_write_png(&v->image, path);
        err = err ? err : path_of(b, path, k, "disparity");
        err = err ? err : sst_map_u16_write_png(&v->disp, path);
        err = err ? err : path_of(b, path, k, "label");
        err = err ? err : sst_map_u8_write_png(&v->label, path, sst_classes_palette());
    }
    return err;
}

static int load(struct bench *b)
{
    char path[SST_PATH_MAX];
    int err = 0;

    for (int i = 0; !err && i < 16; i++) {
        struct sst_view v = { 0 };

        err = path_of(b, path, i % 4, "view");
        err = err ? err : sst_image_read(&v.image, path);
        err = err ? err : path_of(b, path, i % 4, "disparity");
        err = err ? err : sst_map_u16_read_png(&v.disp, path);
        err = err ? err : path_of(b, path, i % 4, "label");
        err = err ? err : sst_map_u8_read_png(&v.label, path);
        sst_image_fini(&v.image);
        sst_map_u16_fini(&v.disp);
        sst_map_u8_fini(&v.label);
    }
    return err;
}

static int hash(struct bench *b)
{
    char digits[SST_SHA256_HEX];

    sst_sha256_hex(digits, b->memory, MEMORY_BYTES);
    b->sink += (uint64_t)digits[0];
    return 0;
}

/* Sets in which a walker steps to and fro: from frames to clear pictures. */
static int live(struct bench *b)
{
    struct sst_live_report report;
    struct sst_render_config cfg = b->render;
    int err = 0;

    cfg.method = SST_RENDER_CLEAR;
    cfg.focus_px = cfg.cut_px = NAN;
    cfg.verify = SST_VERIFY_ON;
    for (int i = 0; i < 8 && !err; i++) {
        struct sst_live_input *in = &b->in[b->sets % LIVE_TIMES];
        const struct sst_image *image;
        int64_t px = 0;

        in->set = (uint64_t)b->sets;
        in->t_ns = 1 + INT64_C(100000000) * b->sets++;
        err = sst_live_update(b->live, in, &report);
        err = err || !report.ready ? err : sst_livepicture_render(b->picture, &cfg, &image, &px);
        b->sink += (uint64_t)px;
    }
    return err ? err : report.ready ? 0 : -ENODATA;
}

static uint32_t packed_at(const struct bench *b, int k, int x, int y)
{
    const struct sst_view *v = &b->lf.views[k];
    const int xv = sst_clamp_int(x, 0, WIDTH - 1), yv = sst_clamp_int(y, 0, HEIGHT - 1);
    const uint32_t code = 1 + (uint32_t)sst_map_u16_row(&v->disp, yv)[xv] / 260;

    return sst_image_row(&v->image, 0, yv)[xv] | (uint32_t)sst_image_row(&v->image, 1, yv)[xv] << 8 |
           (uint32_t)sst_image_row(&v->image, 2, yv)[xv] << 16 | code << 24;
}

#define PACKED_STRIDE (WIDTH + 3)
#define PACKED_PIXELS ((size_t)(HEIGHT + 3) * PACKED_STRIDE)
#define PACKED_VIEWS  13

/* A view with the margins that the kernel reads. @param t  where it is tested; NULL: the view that is */
static void pack(const struct bench *b, int k, uint32_t *pixels, struct sst_hypothesis_test *t)
{
    const double bx = b->lf.views[k].bx - b->lf.views[0].bx, by = b->lf.views[k].by - b->lf.views[0].by;
    const struct sst_packed_view packed = { pixels + PACKED_STRIDE + 1, PACKED_STRIDE };

    for (int y = -1; y < HEIGHT + 1; y++) {
        for (int x = -1; x < WIDTH + 2; x++)
            pixels[(y + 1) * PACKED_STRIDE + x + 1] = packed_at(b, k, x, y);
    }
    if (!k) {
        t->own = packed;
        return;
    }
    t->view[k - 1] = packed;
    t->x[k - 1] = (int32_t)(32768 - bx * b->lf.disp_min_px * 65536);
    t->y[k - 1] = (int32_t)(32768 - by * b->lf.disp_min_px * 65536);
    t->dx[k - 1] = (int32_t)(-bx * 1024);
    t->dy[k - 1] = (int32_t)(-by * 1024);
}

/* The costs of four hypotheses a pixel: the true disparity and three in front of it. */
static int hypotheses(struct bench *b)
{
    static uint8_t code[65536], count[WIDTH];
    static uint16_t cost[WIDTH * SST_HYPOTHESES], at[WIDTH * SST_HYPOTHESES];
    struct sst_hypothesis_test t = {
        .views = PACKED_VIEWS - 1, .width = WIDTH, .height = HEIGHT, .tolerance = 64, .similar = 12, .code = code
    };
    uint32_t *pixels = sst_mem_alloc(PACKED_VIEWS * PACKED_PIXELS, sizeof(*pixels));

    if (!pixels)
        return -ENOMEM;
    for (int d = 0; d < 65536; d++)
        code[d] = (uint8_t)(1 + d / 260);
    for (int k = 0; k < PACKED_VIEWS; k++)
        pack(b, k, pixels + (size_t)k * PACKED_PIXELS, &t);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            count[x] = 4;
            for (int i = 0; i < 4; i++)
                at[x * SST_HYPOTHESES + i] = (uint16_t)(sst_map_u16_row(&b->lf.views[0].disp, y)[x] + 96 * i);
        }
        sst_kernels_get()->hypothesis_cost_row(cost, at, count, &t, 0, y, WIDTH);
        b->sink += cost[0];
    }
    sst_mem_free(pixels);
    return 0;
}

static const struct {
    const char *name;
    int (*run)(struct bench *b);
} parts[] = {
    { "loop memory", loop_memory },
    { "loop vector", loop_vector },
    { "loop scalar", loop_scalar },
    { "loop scatter", loop_scatter },
    { "render refocus", render_refocus },
    { "render see-through", render_see_through },
    { "render verified", render_verified },
    { "render clear", render_clear },
    { "match pair", match_pair },
    { "match preview", match_preview },
    { "match balanced", match_balanced },
    { "refine labels", refine },
    { "match pair preview", match_pair_preview },
    { "match pair accurate", match_pair_accurate },
    { "hypothesis costs", hypotheses },
    { "live sets", live },
    { "label", label },
    { "save", save },
    { "load", load },
    { "hash", hash },
};

static bool wanted(const char *name, char *const *names, int count)
{
    for (int i = 0; i < count; i++) {
        if (!strcmp(names[i], name))
            return true;
    }
    return !count || !strncmp(name, "loop ", 5);
}

static int measure(struct bench *b, size_t part, int round)
{
    const int64_t start_ns = sst_clock_cpu_ns();
    const int err = parts[part].run(b);

    if (!err && round)
        printf("%s,%d,%.4f\n", parts[part].name, round, (double)(sst_clock_cpu_ns() - start_ns) * 1e-6);
    return sst_min_int(err, 0);
}

int main(int argc, char **argv)
{
    const int rounds = argc > 1 ? atoi(argv[1]) : 0;
    struct bench b = { 0 };
    int err;

    if (rounds < 1) {
        fprintf(stderr, "usage: check ROUNDS [NAME ...]: rounds >= 1; stages, all by default\n");
        return 2;
    }
    err = bench_init(&b);
    err = err ? err : save(&b); /* for load alone */
    printf("part,round,cpu_ms\n");
    for (int round = 0; !err && round <= rounds; round++) { /* the first one warms up */
        for (size_t i = 0; !err && i < ARRAY_LEN(parts); i++) {
            if (wanted(parts[i].name, argv + 2, argc - 2))
                err = measure(&b, i, round);
        }
    }
    if (err)
        sst_log_error("check bench: %s", strerror(-err));
    bench_fini(&b);
    return err ? 1 : 0;
}
