/* Pictures straight from raw frames against rectifying first: raw [WIDTH HEIGHT [THREADS]]. Prints what each step takes
 * and both ways' times for one picture and a sweep of 20, of 1, 4 and all 36 views; and how near to the exact picture
 * they come. Medians of 5, processor time of all threads together. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/raw_field.h"

#include "base/clock.h"
#include "base/stats.h"

#define ROUNDS 5

static int threads = 1;

static double median(double *ms)
{
    return sst_stats_upper_median(ms, ROUNDS);
}

static double since(int64_t start_ns)
{
    return (double)(sst_clock_cpu_ns() - start_ns) * 1e-6;
}

/* One view: its map, its frame made ready, and rectified as a whole. */
static int time_steps(const struct raw_field *f, double step_ms[3])
{
    double ms[3][ROUNDS];
    struct sst_image out = { 0 };
    struct sst_map_u8 valid = { 0 };
    int err = sst_image_init(&out, f->raw.width, f->raw.height);

    err = err ? err : sst_map_u8_init(&valid, f->raw.width, f->raw.height);
    for (int i = 0; i < ROUNDS && !err; i++) {
        struct sst_rectify_map *map = NULL;
        struct sst_sampler *sampler = NULL;
        const enum sst_filter filter = (enum sst_filter)f->raw.filter;
        int64_t t = sst_clock_cpu_ns();

        err = sst_rectify_map_create(&map, f->raw.rectified, f->raw.calibration, 8);
        ms[0][i] = since(t);
        t = sst_clock_cpu_ns();
        err = err ? err : sst_sampler_create(&sampler, map, filter, &f->raw.views[8].image);
        ms[1][i] = since(t);
        t = sst_clock_cpu_ns();
        err = err ? err : sst_rectify_view(&(struct sst_rectified_view){ &out, &valid }, map, filter, &f->raw.views[8].image);
        ms[2][i] = since(t);
        sst_sampler_destroy(sampler);
        sst_rectify_map_destroy(map);
    }
    for (int i = 0; i < 3 && !err; i++)
        step_ms[i] = median(ms[i]);
    sst_image_fini(&out);
    sst_map_u8_fini(&valid);
    return err;
}

static int time_render(struct sst_renderer *r, const struct sst_render_config *cfg, struct sst_image *out, double *each)
{
    double ms[ROUNDS];
    int err = sst_render(r, cfg, out, NULL);

    for (int i = 0; i < ROUNDS && !err; i++) {
        const int64_t t = sst_clock_cpu_ns();

        err = sst_render(r, cfg, out, NULL);
        ms[i] = since(t);
    }
    *each = median(ms);
    return err;
}

static double psnr(const struct sst_image *a, const struct sst_image *b, const double *exact)
{
    const int mx = a->width / 6, my = a->height / 6;
    double sum = 0;
    size_t n = 0;

    for (int c = 0; c < 3; c++) {
        for (int y = my; y < a->height - my; y++) {
            for (int x = mx; x < a->width - mx; x++, n++) {
                const size_t i = ((size_t)c * (size_t)a->height + (size_t)y) * (size_t)a->width + (size_t)x;
                const double d = sst_image_row(a, c, y)[x] - (b ? sst_image_row(b, c, y)[x] : exact[i]);

                sum += d * d;
            }
        }
    }
    return 10 * log10(255 * 255 / fmax(sum / (double)n, 1e-9));
}

static int compare(const struct raw_field *f, int views, const double step_ms[3], bool exact_too)
{
    struct sst_renderer *r[2] = { NULL, NULL };
    struct sst_image out[2] = { { 0 }, { 0 } };
    struct sst_render_config cfg;
    const int all = f->raw.rows * f->raw.cols;
    const size_t values = 3 * (size_t)f->raw.width * (size_t)f->raw.height;
    double each[2] = { 0, 0 }, *exact = malloc(values * sizeof(*exact));
    int err = exact ? 0 : -1;

    sst_render_config_defaults(&cfg);
    cfg.method = SST_RENDER_REFOCUS;
    cfg.focus_px = 12.37;
    cfg.threads = threads;
    cfg.max_views = views;
    cfg.view_bx = views == 4 ? 0.5 : 0;
    cfg.view_by = cfg.view_bx;
    cfg.aperture = views == 1 ? 0.2 : views == 4 ? 0.9 : INFINITY;
    for (int i = 0; i < 2 && !err; i++) {
        err = sst_renderer_create(&r[i], i ? &f->rectified : &f->raw, threads);
        err = err ? err : sst_image_init(&out[i], f->raw.width, f->raw.height);
        err = err ? err : time_render(r[i], &cfg, &out[i], &each[i]);
    }
    for (int pictures = 1; pictures <= 20 && !err; pictures += 19)
        printf("%2d views, %2d pictures: raw %7.1f ms, rectified %7.1f ms (%7.1f ms if only those views were); a "
               "picture %.2f and %.2f ms\n",
               views, pictures, views * (step_ms[0] + step_ms[1]) + pictures * each[0],
               all * (step_ms[0] + step_ms[2]) + pictures * each[1],
               views * (step_ms[0] + step_ms[2]) + pictures * each[1], each[0], each[1]);
    if (!err && exact_too) {
        err = raw_field_truth(f, &cfg, exact);
        if (!err)
            printf("%2d views: PSNR raw against rectified %.2f dB; against the exact picture: raw %.2f, rectified %.2f "
                   "dB\n",
                   views, psnr(&out[0], &out[1], NULL), psnr(&out[0], NULL, exact), psnr(&out[1], NULL, exact));
    }
    for (int i = 0; i < 2; i++) {
        sst_renderer_destroy(r[i]);
        sst_image_fini(&out[i]);
    }
    free(exact);
    return err;
}

int main(int argc, char **argv)
{
    const int width = argc > 2 ? atoi(argv[1]) : 1000, height = argc > 2 ? atoi(argv[2]) : 750;
    static const int views[] = { 1, 4, 36 };
    struct sst_sim_settings s;
    struct raw_field f;
    double step_ms[3];
    int err;

    threads = argc > 3 ? atoi(argv[3]) : 1;
    raw_field_settings(&s, "pedestrian", 6, 6, width / 16 * 16, height / 8 * 8, 4);
    err = raw_field_make(&f, &s);
    err = err ? err : time_steps(&f, step_ms);
    if (!err)
        printf("%dx%d, filter %s, %d threads; one view on one thread: map %.2f ms, frame made ready %.2f ms, rectified "
               "%.2f ms\n",
               f.raw.width, f.raw.height, sst_filter_name((enum sst_filter)f.raw.filter), threads, step_ms[0],
               step_ms[1], step_ms[2]);
    for (size_t i = 0; i < 3 && !err; i++)
        err = compare(&f, views[i], step_ms, true);
    raw_field_free(&f);
    return err ? 1 : 0;
}
