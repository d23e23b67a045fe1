/* Detection behind a simulated hedge: what is found and how often leaves raise an alarm, by all views (differences
 * first, then integrated), by one camera, and by plain refocusing (pictures integrated, then compared). One world a
 * run; the three see the same pictures. scripts/bench_watch.py runs many and writes docs/measured/bench-watch.md. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "pipeline/live/hidden/hidden.h"
#include "simulators/scene/hedge.h"
#include "simulators/scene/noise.h"

#define METHODS    3
#define THRESHOLDS 25
#define KEYS       64
#define LEARN_S    120.0 /* until the first person */
#define EVERY_S    360.0 /* one person in this time, on average */
#define AFTER_S    8.0   /* alarms this soon after a person are that person's */
#define NEAR       0.25  /* of the picture's width: an alarm this near to a person is that person's */

static const char *const names[METHODS] = { "array", "camera", "refocus" };

/* A track of a method until it has ended. */
struct seen {
    uint32_t key;
    double peak;
    bool reported, person;
};

struct method {
    struct sst_hidden *hidden;
    struct sst_hidden_input in;
    struct seen seen[KEYS];
    int count;
    double pass_peak; /* of the person that is there */
    bool pass_found;
    double delay_s;
    int found, alarms;
    int found_at[THRESHOLDS], alarms_at[THRESHOLDS];
    double cpu_s;
};

struct bench {
    struct sst_hedge_config cfg;
    struct sst_hedge *hedge;
    int views, focus_views;
    struct sst_image *image, focused;
    struct method method[METHODS];
    double disp_px, height_px, rate_hz, hours, alarms_per_hour, t_s;
    int passes;
    double visible, empty_s, draw_s;
    int64_t visible_sets, sets;
    struct sst_hedge_person person;
    bool there, walks;
    double from_s, to_s, ended_s, last_x;
    uint64_t seed;
};

static double threshold(int i)
{
    return 0.5 * pow(1.25, i);
}

static double cpu(void)
{
    struct timespec t;

    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* --- set-up ---------------------------------------------------------------------------------------------------------
 */

static int open_method(struct bench *b, int m)
{
    const int middle = (b->cfg.rows - 1) / 2 * b->cfg.cols + (b->cfg.cols - 1) / 2;
    struct sst_hidden_config cfg = { .views = m == 0 ? b->views : 1,
                                     .width = b->cfg.width,
                                     .height = b->cfg.height,
                                     .alarms_per_hour = b->alarms_per_hour,
                                     .threads = 1 };
    struct method *d = &b->method[m];

    for (int k = 0; k < cfg.views; k++) {
        cfg.used[k] = true;
        if (m == 0)
            sst_hedge_offset(b->hedge, k, &cfg.bx[k], &cfg.by[k]);
        d->in.image[k] = m == 0 ? &b->image[k] : m == 1 ? &b->image[middle] : &b->focused;
    }
    d->in.far_px = b->cfg.wall_px;
    d->in.front_px = b->cfg.near_px - b->cfg.spread_px;
    d->in.near_px = b->cfg.near_px;
    return sst_hidden_open(&d->hidden, &cfg);
}

static int open_bench(struct bench *b)
{
    int err;

    b->views = b->cfg.rows * b->cfg.cols;
    b->image = calloc((size_t)b->views, sizeof(*b->image));
    err = b->image ? sst_hedge_create(&b->hedge, &b->cfg) : -ENOMEM;
    err = err ? err : sst_image_init(&b->focused, b->cfg.width, b->cfg.height);
    for (int k = 0; k < b->views && !err; k++)
        err = sst_image_init(&b->image[k], b->cfg.width, b->cfg.height);
    for (int m = 0; m < METHODS && !err; m++)
        err = open_method(b, m);
    return err;
}

static void close_bench(struct bench *b)
{
    for (int k = 0; b->image && k < b->views; k++)
        sst_image_fini(&b->image[k]);
    free(b->image);
    sst_image_fini(&b->focused);
    for (int m = 0; m < METHODS; m++)
        sst_hidden_close(b->method[m].hidden);
    sst_hedge_destroy(b->hedge);
}

/* --- a set ----------------------------------------------------------------------------------------------------------
 */

static void next_person(struct bench *b)
{
    b->from_s = b->ended_s + AFTER_S + 15 + (EVERY_S - 60) * 2 * sst_random(&b->seed);
    b->walks = sst_random(&b->seed) < 0.5;
    b->to_s = b->from_s + (b->walks ? 24 : 40);
    b->person = (struct sst_hedge_person){ .x = b->cfg.width * sst_random_in(&b->seed, 0.15, 0.85),
                                       .foot = b->cfg.height * 0.93,
                                       .height = b->height_px,
                                       .disp_px = b->disp_px,
                                       .stride = 0.5,
                                       .clothes = (int)(sst_random_u64(&b->seed) >> 40) };
}

static void move_person(struct bench *b)
{
    const double done = (b->t_s - b->from_s) / (b->to_s - b->from_s);

    if (!b->walks)
        return;
    b->person.x = b->cfg.width * (-0.1 + 1.2 * done);
    b->person.stride = 5 * b->t_s;
}

/* The mean of all pictures, focused on the plane that the person is on. */
static void refocus(const struct bench *b)
{
    const int width = b->cfg.width, height = b->cfg.height;

    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < height; y++) {
            uint16_t sum[640] = { 0 };

            for (int k = 0; k < b->views; k++) {
                double bx, by;
                const uint8_t *row;
                int dx, x0, x1;

                sst_hedge_offset(b->hedge, k, &bx, &by);
                dx = (int)lround(b->disp_px * bx);
                x0 = sst_max_int(dx, 0);
                x1 = sst_min_int(width, width + dx);
                row = sst_image_row(&b->image[k], c, sst_clamp_int(y - (int)lround(b->disp_px * by), 0, height - 1));
                for (int x = 0; x < x0; x++)
                    sum[x] = (uint16_t)(sum[x] + row[0]);
                for (int x = x0; x < x1; x++)
                    sum[x] = (uint16_t)(sum[x] + row[x - dx]);
                for (int x = x1; x < width; x++)
                    sum[x] = (uint16_t)(sum[x] + row[width - 1]);
            }
            for (int x = 0; x < width; x++)
                sst_image_row(&b->focused, c, y)[x] = (uint8_t)(sum[x] / b->views);
        }
    }
}

/* --- counting -------------------------------------------------------------------------------------------------------
 */

static void end_track(struct bench *b, struct method *d, int i)
{
    const struct seen s = d->seen[i];

    d->seen[i] = d->seen[--d->count];
    if (s.person || b->t_s < LEARN_S)
        return;
    d->alarms += s.reported;
    for (int k = 0; k < THRESHOLDS; k++)
        d->alarms_at[k] += s.peak >= threshold(k);
}

static void note(struct bench *b, struct method *d)
{
    struct sst_hidden_thing thing[SST_HIDDEN_THINGS];
    const int n = sst_hidden_things(d->hidden, thing);
    const bool anybody = b->there || b->t_s - b->ended_s < AFTER_S;

    for (int i = 0; i < d->count; i++) {
        bool still = false;

        for (int k = 0; k < n; k++)
            still |= thing[k].key == d->seen[i].key;
        if (!still)
            end_track(b, d, i--);
    }
    for (int k = 0; k < n; k++) {
        const double x = (thing[k].x0 + thing[k].x1) / 2;
        const bool is_person = anybody && fabs(x - b->last_x) < NEAR * b->cfg.width;
        int at = 0;

        while (at < d->count && d->seen[at].key != thing[k].key)
            at++;
        if (at == KEYS)
            continue;
        if (at == d->count)
            d->seen[d->count++] = (struct seen){ .key = thing[k].key };
        d->seen[at].peak = fmax(d->seen[at].peak, thing[k].evidence);
        d->seen[at].reported |= thing[k].reported;
        d->seen[at].person |= is_person;
        if (!b->there || !is_person)
            continue;
        d->pass_peak = fmax(d->pass_peak, thing[k].evidence);
        if (thing[k].reported && !d->pass_found)
            d->delay_s += b->t_s - b->from_s;
        d->pass_found |= thing[k].reported;
    }
}

static void end_pass(struct bench *b)
{
    b->passes++;
    for (int m = 0; m < METHODS; m++) {
        struct method *d = &b->method[m];

        d->found += d->pass_found;
        for (int k = 0; k < THRESHOLDS; k++)
            d->found_at[k] += d->pass_peak >= threshold(k);
        d->pass_peak = 0;
        d->pass_found = false;
    }
}

static int run_set(struct bench *b)
{
    const double start = cpu();
    double at, visible = 0;
    int err = 0;

    b->there = b->t_s >= b->from_s && b->t_s < b->to_s;
    if (b->there) {
        move_person(b);
        b->last_x = b->person.x;
    }
    sst_hedge_draw(b->hedge, b->t_s, b->there ? &b->person : NULL, b->image, &visible);
    if (b->there && b->person.x > 0 && b->person.x < b->cfg.width) {
        b->visible += visible;
        b->visible_sets++;
    }
    at = cpu();
    b->draw_s += at - start;
    for (int m = 0; m < METHODS && !err; m++) {
        struct method *d = &b->method[m];

        if (m == 2)
            refocus(b);
        d->in.t_ns = (int64_t)((b->t_s + 1) * 1e9);
        err = sst_hidden_update(d->hidden, &d->in);
        d->cpu_s += cpu() - at;
        at = cpu();
        note(b, d);
    }
    b->empty_s += b->there || b->t_s < LEARN_S || b->t_s - b->ended_s < AFTER_S ? 0 : 1 / b->rate_hz;
    b->sets++;
    if (b->t_s >= b->to_s) {
        end_pass(b);
        b->ended_s = b->to_s;
        next_person(b);
    }
    return err;
}

/* --- output ---------------------------------------------------------------------------------------------------------
 */

static void print_curve(const char *name, const int *count)
{
    printf(", \"%s\": [", name);
    for (int k = 0; k < THRESHOLDS; k++)
        printf("%s%d", k ? ", " : "", count[k]);
    printf("]");
}

static void print(const struct bench *b)
{
    printf(
        "{\"cover\": %.3f, \"wind\": %g, \"light\": %g, \"noise\": %g, \"disp_px\": %g, \"hours\": %.3f, "
        "\"empty_hours\": %.4f, \"sets\": %lld, \"passes\": %d, \"visible\": %.3f, \"draw_ms\": %.2f, \"methods\": {",
        sst_hedge_cover(b->hedge), b->cfg.wind, b->cfg.light, b->cfg.noise, b->disp_px, b->t_s / 3600, b->empty_s / 3600,
        (long long)b->sets, b->passes, b->visible / fmax((double)b->visible_sets, 1),
        1000 * b->draw_s / (double)b->sets);
    for (int m = 0; m < METHODS; m++) {
        const struct method *d = &b->method[m];

        printf("%s\"%s\": {\"found\": %d, \"alarms\": %d, \"delay_s\": %.1f, \"ms\": %.2f, \"threshold\": %.1f",
               m ? ", " : "", names[m], d->found, d->alarms, d->delay_s / fmax(d->found, 1),
               1000 * d->cpu_s / (double)b->sets, sst_hidden_threshold(d->hidden));
        print_curve("found_at", d->found_at);
        print_curve("alarms_at", d->alarms_at);
        printf("}");
    }
    printf("}}\n");
}

static bool set_option(struct bench *b, const char *name, double v)
{
    struct sst_hedge_config *c = &b->cfg;
    struct {
        const char *name;
        double *value;
    } real[] = { { "cover", &c->cover },  { "wind", &c->wind },    { "light", &c->light },
                 { "noise", &c->noise },  { "near", &c->near_px }, { "spread", &c->spread_px },
                 { "wall", &c->wall_px }, { "disp", &b->disp_px }, { "height", &b->height_px },
                 { "rate", &b->rate_hz }, { "hours", &b->hours },  { "alarms", &b->alarms_per_hour } };

    for (size_t i = 0; i < ARRAY_LEN(real); i++) {
        if (!strcmp(name, real[i].name)) {
            *real[i].value = v;
            return true;
        }
    }
    if (!strcmp(name, "views"))
        c->rows = c->cols = (int)v;
    else if (!strcmp(name, "width"))
        c->height = 3 * (c->width = (int)v) / 4;
    else if (!strcmp(name, "seed"))
        c->seed = (uint64_t)v;
    else
        return false;
    return true;
}

int main(int argc, char **argv)
{
    struct bench *b = calloc(1, sizeof(*b));
    int err = b ? 0 : 1;

    if (!b)
        return 1;
    sst_hedge_config_defaults(&b->cfg);
    b->disp_px = 5;
    b->height_px = 60;
    b->rate_hz = 1;
    b->hours = 0.1;
    b->alarms_per_hour = 1;
    for (int i = 1; i + 1 < argc && !err; i += 2)
        err = !set_option(b, argv[i], strtod(argv[i + 1], NULL));
    if (err) {
        fprintf(stderr,
                "usage: watch [cover|wind|light|noise|near|spread|wall|disp|height|rate|hours|alarms|views|width|seed "
                "NUMBER] ...\n");
        free(b);
        return 2;
    }
    b->seed = b->cfg.seed * 7919 + 3;
    err = open_bench(b);
    b->ended_s = LEARN_S - 30;
    next_person(b);
    for (; b->t_s < 3600 * b->hours && !err; b->t_s += 1 / b->rate_hz)
        err = run_set(b);
    if (err)
        fprintf(stderr, "watch: %s\n", strerror(-err));
    else
        print(b);
    close_bench(b);
    free(b);
    return err != 0;
}
