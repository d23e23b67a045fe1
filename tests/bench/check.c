/* Times stages of the pipeline beside loops that load one part of the processor, in turn: check ROUNDS [NAME ...].
 * Prints CSV, a line for each round and part: CPU milliseconds. Everything runs on one thread, on a small bush made in
 * memory, so that a change of the machine's load changes stages and loops alike (scripts/bench_check.py). */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/method/disparity/disparity.h"
#include "pipeline/method/refine/refine.h"
#include "pipeline/method/render/render.h"
#include "simulators/scene/scene.h"

#define WIDTH        400
#define HEIGHT       300
#define MEMORY_BYTES ((size_t)48 << 20)
#define SCATTER      (1u << 20) /* entries of 4 bytes: 4 MiB, more than the second level of cache */

struct bench {
    struct sst_lightfield lf; /* with true maps */
    struct sst_scene *scene;
    struct sst_renderer *renderer;
    struct sst_render_config render;
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
    err = err ? err : sst_scene_render(b->scene, v->bx, v->by, 0, &v->image, &disp, &v->label);
    for (int i = 0; !err && i < WIDTH * HEIGHT; i++)
        sst_map_u16_row(&v->disp, i / WIDTH)[i % WIDTH] =
            sst_disp_q6(&b->lf, sst_map_f32_row(&disp, i / WIDTH)[i % WIDTH]);
    sst_map_f32_fini(&disp);
    v->present = true;
    return err;
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
    return err ? err : b->memory && b->scatter ? 0 : -ENOMEM;
}

static void bench_fini(struct bench *b)
{
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

static const struct {
    const char *name;
    int (*run)(struct bench *b);
} parts[] = {
    { "loop memory", loop_memory },         { "loop vector", loop_vector },
    { "loop scalar", loop_scalar },         { "loop scatter", loop_scatter },
    { "render refocus", render_refocus },   { "render see-through", render_see_through },
    { "render verified", render_verified }, { "render clear", render_clear },
    { "match pair", match_pair },           { "match preview", match_preview },
    { "match balanced", match_balanced },   { "refine labels", refine },
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
    return err;
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
