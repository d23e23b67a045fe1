/* Rates of live pictures of an array without a lattice: the live pipeline runs on invented pictures that change wholly
 * from set to set. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "base/thread.h"
#include "cli/plan_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/live/live.h"
#include "pipeline/posed/array.h"

#define SETS         2    /* of different pictures, one after the other */
#define BLOB_PX      6    /* size of shapes in the pictures: leaves */
#define JPEG_QUALITY 85
#define CLEAR_HZ     1.0  /* rate at which clear pictures are worth showing */
#define BUSY         1.5  /* time over processor time from which on other programs have it */
#define USUAL_M      40.0 /* distance of the surface where only points of the scene know it */

struct plan {
    const struct sst_config *config;
    struct sst_posed poses; /* at the size of a try */
    uint8_t *data[SETS];
    size_t bytes[SETS], stride;
    int64_t kb; /* of memory at the start */
};

struct trial {
    enum sst_render_method method;
    int width, height, compare_px;
    double ms, cpu_ms, memory_mb;
};

/* --- pictures ----------------------------------------------------------------------------------------------------- */

static uint32_t hash(uint32_t v)
{
    v = (v ^ v >> 16) * 0x7feb352d;
    v = (v ^ v >> 15) * 0x846ca68b;
    return v ^ v >> 16;
}

static int make_picture(struct plan *p, int set, int width, int height, bool grey)
{
    struct sst_image image;
    int err = sst_image_init(&image, width, height);

    for (int i = 0; i < 3 * height && !err; i++) {
        uint8_t *row = sst_image_row(&image, i % 3, i / 3);

        for (int x = 0; x < width; x++)
            row[x] = (uint8_t)(60 + hash((uint32_t)(x / BLOB_PX + i / 3 / BLOB_PX * 4099 + set * 65537)) % 140);
    }
    if (!err && !grey)
        err = sst_image_encode_jpeg(&image, JPEG_QUALITY, &p->data[set], &p->bytes[set]);
    if (!err && grey) {
        p->stride = (size_t)width;
        p->bytes[set] = p->stride * (size_t)height;
        p->data[set] = malloc(p->bytes[set]);
        err = p->data[set] ? 0 : -ENOMEM;
        for (int y = 0; y < height && !err; y++)
            memcpy(p->data[set] + p->stride * (size_t)y, sst_image_row(&image, 1, y), p->stride);
    }
    sst_image_fini(&image);
    return err;
}

static int64_t memory_kb(void)
{
    struct rusage usage;

    return getrusage(RUSAGE_SELF, &usage) ? 0 : usage.ru_maxrss;
}

/* --- one size and kind of picture --------------------------------------------------------------------------------- */

static struct sst_live_config describe(const struct plan *p, const struct trial *t, bool grey)
{
    const struct sst_live_settings *l = &p->config->live;
    const struct sst_array_config *a = &p->config->array;
    const double between = l->near_m > 0 && l->far_m > 0 ? sqrt(l->near_m * l->far_m) : USUAL_M;
    struct sst_live_config c = {
        .rows = a->rows,
        .cols = a->cols,
        .fourcc = grey ? V4L2_PIX_FMT_GREY : V4L2_PIX_FMT_MJPEG,
        .width = t->width,
        .height = t->height,
        .posed = { &p->poses, 1000 * (l->surface_m > 0 ? l->surface_m : between), 1000 * l->near_m, 1000 * l->far_m, 0,
                   t->compare_px },
        .threads = l->threads,
    };

    for (int k = 0; k < a->rows * a->cols; k++)
        c.present[k] = !a->bound;
    for (int i = 0; i < a->bound; i++)
        c.present[a->camera[i].row * a->cols + a->camera[i].col] = true;
    return c;
}

/* The last set counts. Before it another one warms the memory, which matters where a set takes milliseconds. */
static int run_sets(struct trial *t, struct sst_live *live, const struct plan *p)
{
    struct sst_livepicture *picture = NULL;
    struct sst_render_config cfg;
    int err = sst_livepicture_create(&picture, live);

    sst_render_config_defaults(&cfg);
    cfg.method = t->method;
    cfg.focus_px = sst_live_default_focus(live);
    for (int set = t->method == SST_RENDER_REFOCUS ? 0 : SETS - 1; set < SETS && !err; set++) {
        const int64_t start_ns = sst_clock_now_ns(), cpu_ns = sst_clock_cpu_ns();
        struct sst_live_input in = { .set = (uint64_t)set + 1, .t_ns = set + 1 };
        struct sst_live_report report;
        const struct sst_image *image;
        int64_t px;

        for (int k = 0; k < p->poses.count; k++) {
            in.frame[k].data = p->data[set];
            in.frame[k].bytes = p->bytes[set];
            in.frame[k].stride = p->stride;
        }
        err = sst_live_update(live, &in, &report);
        err = err ? err : sst_livepicture_render(picture, &cfg, &image, &px);
        t->ms = (double)(sst_clock_now_ns() - start_ns) / 1e6;
        t->cpu_ms = (double)(sst_clock_cpu_ns() - cpu_ns) / 1e6;
    }
    sst_livepicture_destroy(picture);
    return err;
}

static int try_it(struct trial *t, struct plan *p)
{
    const struct sst_array_config *a = &p->config->array;
    const bool grey = a->fourcc == V4L2_PIX_FMT_GREY || a->fourcc == V4L2_PIX_FMT_Y16;
    const struct sst_posed_array array = { a->rows, a->cols, t->width, t->height, grey ? 1 : 3 };
    struct sst_live *live = NULL;
    int err = sst_posed_array_read(&p->poses, p->config->live.poses, &array);

    for (int set = 0; set < SETS && !err; set++)
        err = make_picture(p, set, t->width, t->height, grey);
    if (!err) {
        const struct sst_live_config c = describe(p, t, grey);

        err = sst_live_open(&live, &c);
    }
    err = err ? err : run_sets(t, live, p);
    t->memory_mb = (double)(memory_kb() - p->kb) / 1024;
    sst_live_close(live);
    for (int set = 0; set < SETS; set++) {
        free(p->data[set]);
        p->data[set] = NULL;
    }
    sst_posed_fini(&p->poses);
    return err;
}

/* --- report ------------------------------------------------------------------------------------------------------- */

static const char *name_of(const struct trial *t)
{
    return t->method == SST_RENDER_REFOCUS ? "refocus" : "see-through, clear";
}

/* Width of the compared pictures: views' pixels are joined by whole numbers. */
static int compared_width(int width, int compare_px)
{
    return width / sst_max_int(1, (int)lround((double)width / compare_px));
}

/* Whether clear pictures of the configured size come fast enough, or with which setting they would. */
static void advise(char *text, size_t size, const struct trial *trial, int n, const struct sst_config *c)
{
    const struct trial *best = NULL, *own = NULL;

    for (int i = 0; i < n; i++) {
        const struct trial *t = &trial[i];

        if (t->method == SST_RENDER_REFOCUS)
            continue;
        if (t->width == c->array.width && t->compare_px == compared_width(t->width, c->live.compare_px))
            own = t;
        if (1000 / t->ms >= CLEAR_HZ && (!best || t->width > best->width ||
                                         (t->width == best->width && t->compare_px > best->compare_px)))
            best = t;
    }
    if (own && 1000 / own->ms >= CLEAR_HZ)
        snprintf(text, size, "Clear pictures fit: %.1f sets/s as configured.", 1000 / own->ms);
    else if (best)
        snprintf(text, size, "Clear pictures are slower than %g set/s as configured: set live: compare_px: %d%s.",
                 CLEAR_HZ, best->compare_px,
                 best->width < c->array.width ? " and cameras: width and height to half" : "");
    else
        snprintf(text, size, "Clear pictures do not fit this machine; method: refocus does.");
    if (n && trial[n - 1].ms > BUSY * trial[n - 1].cpu_ms)
        sst_text_add(text, size, " Other programs had the processor meanwhile: try again when they have ended.");
}

static int report(const struct trial *trial, int n, const struct sst_config *c, bool json)
{
    const struct sst_array_config *a = &c->array;
    const int cameras = a->bound ? a->bound : a->rows * a->cols, threads = sst_thread_count(c->live.threads);
    json_t *list = json_array();
    char advice[256];

    advise(advice, sizeof(advice), trial, n, c);
    if (!json)
        printf("live pictures of %d cameras on %d threads; sets that change everywhere\n\n%-20s %-11s %8s %8s %8s %8s %8s\n",
               cameras, threads, "picture", "size", "compared", "ms/set", "CPU ms", "sets/s", "MB");
    for (int i = 0; i < n; i++) {
        const struct trial *t = &trial[i];
        char size[32], compared[16] = "";

        snprintf(size, sizeof(size), "%dx%d", t->width, t->height);
        if (t->method != SST_RENDER_REFOCUS)
            snprintf(compared, sizeof(compared), "%d", t->compare_px);
        if (!json)
            printf("%-20s %-11s %8s %8.0f %8.0f %8.1f %8.0f\n", name_of(t), size, compared, t->ms, t->cpu_ms,
                   1000 / t->ms, t->memory_mb);
        json_array_append_new(list, json_pack("{s:s, s:i, s:i, s:i, s:f, s:f, s:f, s:f}", "picture", name_of(t), "width",
                                              t->width, "height", t->height, "compare_px",
                                              t->method == SST_RENDER_REFOCUS ? 0 : t->compare_px, "ms", t->ms,
                                              "cpu_ms", t->cpu_ms, "rate_hz", 1000 / t->ms, "memory_mb", t->memory_mb));
    }
    if (json)
        return cli_dump_json(json_pack("{s:i, s:i, s:o, s:s}", "cameras", cameras, "threads", threads, "live", list,
                                       "advice", advice),
                             JSON_INDENT(2));
    json_decref(list);
    printf("\n%s\n", advice);
    return CLI_OK;
}

static const int compared[] = { 256, 384, 512 };

#define TRIALS (2 * (2 + ARRAY_LEN(compared)))

/* Half the size first, since only the maximum of memory is known; sizes whose half is odd have none. @return number */
static int choose(struct trial trial[TRIALS], const struct sst_config *c)
{
    int n = 0;

    for (int half = c->array.width % 4 == 0 && c->array.height % 4 == 0; half >= 0; half--) {
        const struct trial t = { .method = SST_RENDER_REFOCUS,
                                 .width = c->array.width >> half,
                                 .height = c->array.height >> half };
        const int first = n;

        trial[n++] = t;
        for (size_t i = 0; i <= ARRAY_LEN(compared); i++) {
            const int px = i < ARRAY_LEN(compared) ? compared[i] : c->live.compare_px;
            bool known = false;

            for (int k = first; k < n; k++)
                known |= trial[k].compare_px == compared_width(t.width, px);
            if (known)
                continue;
            trial[n] = t;
            trial[n].method = SST_RENDER_CLEAR;
            trial[n++].compare_px = compared_width(t.width, px);
        }
    }
    return n;
}

int plan_live(const char *path, const int size[2], bool json)
{
    static struct sst_config config; /* large */
    struct trial trial[TRIALS];
    struct plan p = { .config = &config };
    int n, err;

    sst_config_defaults(&config);
    err = sst_config_read(&config, path);
    if (err)
        return cli_exit_code(err);
    if (!config.live.poses[0]) {
        sst_log_error("plan: --live is of cameras with live: poses, which the configuration does not have; lattices do "
                      "not need it (docs/use/drones.md, 6)");
        return CLI_INPUT;
    }
    config.array.width = size[0] ? size[0] : config.array.width;
    config.array.height = size[1] ? size[1] : config.array.height;
    p.kb = memory_kb();
    n = choose(trial, &config);
    for (int i = 0; i < n && !err; i++)
        err = try_it(&trial[i], &p);
    return err ? cli_exit_code(err) : report(trial, n, &config, json);
}
