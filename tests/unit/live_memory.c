/* The live path takes no memory from set to set: what it needs it has after the first sets. malloc() is counted, of
 * libraries too; what is left (the decoder's and the encoder's small pools, the picture that is shown) is small and
 * does not grow. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <malloc.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "base/mem.h"
#include "pipeline/image/codec.h"
#include "pipeline/live/live.h"
#include "tests/test.h"

#define SIDE     3
#define VIEWS    (SIDE * SIDE)
#define WIDTH    192
#define HEIGHT   160
#define MOMENTS  8 /* of a square that walks to and fro before a wall */
#define WALL_PX  4
#define NEAR_PX  10
#define SQUARE   48
#define LARGE    ((size_t)20000) /* bytes: less than a picture's plane, more than the pools */
#define GROWN_MB 2.0

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
#define COUNTED false /* malloc() is theirs */
#else
#define COUNTED true
#endif

/* --- counting ----------------------------------------------------------------------------------------------------- */

static atomic_long blocks, large;
static atomic_size_t large_most;

#if COUNTED
extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);

static void note(size_t bytes)
{
    blocks++;
    if (bytes < LARGE)
        return;
    large++;
    if (bytes > large_most)
        large_most = bytes;
}

void *malloc(size_t bytes)
{
    note(bytes);
    return __libc_malloc(bytes);
}

void *calloc(size_t count, size_t size)
{
    note(count * size); /* no counted sum overflows */
    return __libc_calloc(count, size);
}

void *realloc(void *p, size_t bytes)
{
    note(bytes);
    return __libc_realloc(p, bytes);
}

void *aligned_alloc(size_t align, size_t bytes)
{
    note(bytes);
    return __libc_memalign(align, bytes);
}

int posix_memalign(void **out, size_t align, size_t bytes)
{
    void *p = __libc_memalign(align, bytes);

    note(bytes);
    if (!p)
        return ENOMEM;
    *out = p;
    return 0;
}
#endif

static double in_use_mb(void)
{
    const struct mallinfo2 m = mallinfo2();

    return (double)(m.uordblks + m.hblkhd) / 1e6;
}

static double resident_mb(void)
{
    unsigned long pages = 0;
    FILE *f = fopen("/proc/self/statm", "r");

    assert_non_null(f);
    assert_int_equal(fscanf(f, "%*u %lu", &pages), 1);
    fclose(f);
    return (double)pages * (double)sysconf(_SC_PAGESIZE) / 1e6;
}

/* --- pictures of the cameras -------------------------------------------------------------------------------------- */

static uint8_t *jpeg[MOMENTS][VIEWS];
static size_t bytes[MOMENTS][VIEWS];

static uint8_t texture(int x, int y, int seed)
{
    uint32_t h =
        (uint32_t)(x + 1000) / 3 * 73856093u ^ (uint32_t)(y + 1000) / 3 * 19349663u ^ (uint32_t)seed * 83492791u;

    h ^= h >> 13;
    h *= 0x5bd1e995u;
    return (uint8_t)(40 + (h >> 15) % 176);
}

static void draw(struct sst_image *img, int view, int left)
{
    const int bx = view % SIDE - 1, by = view / SIDE - 1;

    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                const int xs = x + NEAR_PX * bx - left, ys = y + NEAR_PX * by - 56;
                const bool near = xs >= 0 && xs < SQUARE && ys >= 0 && ys < SQUARE;

                sst_image_row(img, c, y)[x] =
                    near ? texture(xs, ys, 9 + c) : texture(x + WALL_PX * bx, y + WALL_PX * by, c);
            }
        }
    }
}

static int expose(void **state SST_UNUSED)
{
    struct sst_image img = { 0 };
    int err = sst_image_init(&img, WIDTH, HEIGHT);

    for (int i = 0; i < MOMENTS && !err; i++) {
        for (int view = 0; view < VIEWS && !err; view++) {
            draw(&img, view, 40 + 6 * (i < MOMENTS / 2 ? i : MOMENTS - i));
            err = sst_image_encode_jpeg(&img, 85, &jpeg[i][view], &bytes[i][view]);
        }
    }
    sst_image_fini(&img);
    return err;
}

static int forget(void **state SST_UNUSED)
{
    for (int i = 0; i < MOMENTS * VIEWS; i++)
        free(jpeg[i / VIEWS][i % VIEWS]);
    return 0;
}

/* --- the live path ------------------------------------------------------------------------------------------------ */

struct path {
    struct sst_live_config cfg;
    struct sst_live *live;
    struct sst_livepicture *picture;
    struct sst_jpeg_encoder *encoder;
    struct sst_live_input in;
    struct sst_live_report report;
};

static void open_path(struct path *p, bool labels, bool skip)
{
    *p = (struct path){ .cfg = { .rows = SIDE,
                                 .cols = SIDE,
                                 .fourcc = V4L2_PIX_FMT_MJPEG,
                                 .width = WIDTH,
                                 .height = HEIGHT,
                                 .range_min_px = 2,
                                 .range_max_px = 14,
                                 .threads = 2,
                                 .skip_change = skip,
                                 .skip_labels = true } };
    for (int view = 0; view < VIEWS; view++)
        p->cfg.present[view] = true;
    if (labels && WITH_DNNL)
        p->cfg.model = "models/pspnet-small.onnx";
    assert_int_equal(sst_live_open(&p->live, &p->cfg), 0);
    assert_int_equal(sst_livepicture_create(&p->picture, p->live), 0);
    assert_int_equal(sst_jpeg_encoder_create(&p->encoder), 0);
}

static void close_path(struct path *p)
{
    sst_jpeg_encoder_destroy(p->encoder);
    sst_livepicture_destroy(p->picture);
    sst_live_close(p->live);
}

/* One set, up to the bytes of the picture. */
static void step(struct path *p)
{
    const int moment = (int)(p->in.set % MOMENTS);
    struct sst_render_config render;
    const struct sst_image *image;
    const uint8_t *data;
    int64_t anew;
    size_t size;

    p->in.set++;
    p->in.t_ns += 100000000;
    for (int view = 0; view < VIEWS; view++) {
        p->in.frame[view].data = jpeg[moment][view];
        p->in.frame[view].bytes = bytes[moment][view];
    }
    assert_int_equal(sst_live_update(p->live, &p->in, &p->report), 0);
    assert_true(p->report.ready && p->report.tiles_changed > 0);
    sst_render_config_defaults(&render);
    render.focus_px = WALL_PX;
    assert_int_equal(sst_livepicture_render(p->picture, &render, &image, &anew), 0);
    assert_true(anew > 0);
    assert_int_equal(sst_jpeg_encoder_run(p->encoder, image, 85, &data, &size), 0);
    assert_true(size > 100);
}

static void walk(struct path *p, int sets)
{
    for (int i = 0; i < sets; i++)
        step(p);
}

/* Sets, and as many again: no blocks of a picture's size are taken, as many small ones as before, and none stays. */
static void stays_flat(bool labels, bool skip, int sets)
{
    struct path p;
    double used_mb, rss_mb;
    long first, second;

    open_path(&p, labels, skip);
    walk(&p, sets); /* everything has been needed once */
    used_mb = in_use_mb();
    rss_mb = resident_mb();
    large = 0;
    large_most = 0;
    first = blocks;
    walk(&p, sets);
    first = blocks - first;
    second = blocks;
    walk(&p, sets);
    second = blocks - second;
    used_mb = in_use_mb() - used_mb;
    rss_mb = resident_mb() - rss_mb;
    if (getenv("SST_VERBOSE"))
        printf("%.1f and %.1f blocks a set, %ld large (at most %zu bytes); %+.3f MB in use, %+.3f MB resident\n",
               (double)first / sets, (double)second / sets, (long)large, (size_t)large_most, used_mb, rss_mb);
    close_path(&p);
    if (!COUNTED)
        return;
    assert_true(8 * large <= 2 * sets); /* a worker may meet the largest frame late */
    assert_true(first > 0);
    assert_true((double)second <= 1.02 * (double)first + 10);
    assert_true(used_mb < GROWN_MB / 10);
    assert_true(rss_mb < GROWN_MB);
}

static void what_moves_takes_no_memory(void **state SST_UNUSED)
{
    stays_flat(false, true, 5 * MOMENTS);
}

static void everything_anew_takes_no_memory(void **state SST_UNUSED)
{
    stays_flat(false, false, 2 * MOMENTS);
}

static void labels_take_no_memory(void **state SST_UNUSED)
{
    stays_flat(true, true, MOMENTS);
}

/* --- memory that is kept ------------------------------------------------------------------------------------------ */

static void kept_memory_grows_and_never_shrinks(void **state SST_UNUSED)
{
    struct sst_mem_kept kept = { 0 };
    void *first = sst_mem_keep(&kept, 10, 8), *second;
    size_t room;

    assert_non_null(first);
    assert_int_equal((uintptr_t)first % SST_ALIGN, 0);
    assert_ptr_equal(sst_mem_keep(&kept, 1, 8), first);
    assert_ptr_equal(sst_mem_keep(&kept, 0, 8), first);
    assert_null(sst_mem_keep(&kept, SIZE_MAX, 2));
    if (COUNTED) /* a sanitizer ends there */
        assert_null(sst_mem_keep(&kept, SIZE_MAX / 4, 1));
    assert_ptr_equal(kept.data, first); /* earlier maps stay */
    second = sst_mem_keep(&kept, 11, 8);
    assert_non_null(second);
    memset(second, 1, 88);
    room = kept.bytes;
    assert_true(room >= 120); /* half as much again */
    assert_ptr_equal(sst_mem_keep(&kept, room, 1), second);
    sst_mem_kept_fini(&kept);
    assert_null(kept.data);
    assert_non_null(sst_mem_keep(&kept, 0, 1)); /* nothing is a fine amount */
    sst_mem_kept_fini(&kept);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kept_memory_grows_and_never_shrinks),
        cmocka_unit_test(what_moves_takes_no_memory),
        cmocka_unit_test(everything_anew_takes_no_memory),
        cmocka_unit_test(labels_take_no_memory),
    };

    return cmocka_run_group_tests(tests, expose, forget);
}
