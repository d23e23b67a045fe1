/* Visits of somebody who passes behind a hedge again and again, as a service makes them that gets few sets a second:
 * how many there are of each passage, and how far away they say that the passer-by was.
 *
 *   passages [name value ...]
 *
 * rate 3 (sets/s) seed 1 (of the hedge) passages 4 gap 24 (s between them; each begins at another phase of the wind)
 * first 40 (s without anybody, in which the search behind leaves learns) wind 1 width 640 trace 0 (1: tracks of every
 * set) model pspnet-small. Prints one line a visit and a summary as JSON. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <linux/videodev2.h>

#include "base/log.h"
#include "base/stats.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/live/live.h"
#include "pipeline/method/network/model_path.h"
#include "simulators/scene/hedge.h"

#define SIDE    6
#define VIEWS   (SIDE * SIDE)
#define QUALITY 75
#define AFTER_S 6.0  /* a visit this soon after a passage is of it */
#define RIGHT   0.15 /* of a distance */
#define POINTS  64
#define EMPTY   64 /* sets without anybody that are kept: the wind repeats */

/* Frames of a set. */
struct frames {
    uint8_t *jpeg[VIEWS]; /* owned */
    size_t bytes[VIEWS];
    int64_t wind_us; /* time in the wind's period */
};

struct bench {
    double rate, seed, passages, gap, first, wind, width, trace;
    const char *model;
    struct sst_hedge_config cfg;
    struct sst_hedge *hedge;
    struct sst_image image[VIEWS];
    struct frames empty[EMPTY];
    int empties;
    struct sst_live *live;
    struct live_engine *engine;
    struct sst_use_calibration calibration; /* distances are known */
    uint64_t last;                          /* event */
    int64_t sets;
    int right, split, wrong, alone, missed; /* passages */
    int now, visits, near;                  /* passage, its visits, the ones at its distance */
};

static double cycle_s(const struct bench *b)
{
    /* Passages begin at phases of the wind that are an odd part of its period apart. */
    return SST_HEDGE_PASS_S + b->gap + 0.37 * SST_HEDGE_PERIOD_S;
}

static bool set_option(struct bench *b, const char *name, const char *value)
{
    struct {
        const char *name;
        double *value;
    } real[] = { { "rate", &b->rate },   { "seed", &b->seed }, { "passages", &b->passages }, { "gap", &b->gap },
                 { "first", &b->first }, { "wind", &b->wind }, { "width", &b->width },       { "trace", &b->trace } };

    for (size_t i = 0; i < ARRAY_LEN(real); i++) {
        if (!strcmp(name, real[i].name)) {
            *real[i].value = strtod(value, NULL);
            return true;
        }
    }
    if (strcmp(name, "model"))
        return false;
    b->model = value;
    return true;
}

static int open_engine(struct bench *b)
{
    struct live_engine *v = b->engine = calloc(1, sizeof(*v));
    int err;

    if (!v)
        return -ENOMEM;
    pthread_mutex_init(&v->lock, NULL);
    sst_config_defaults(&v->config);
    v->classes = sst_live_lightfield(b->live)->classes;
    v->state.width = b->cfg.width;
    v->state.height = b->cfg.height;
    v->state.focal_px = SST_HEDGE_FOCAL * b->cfg.width / 1000.0;
    v->state.spacing_mm = SST_HEDGE_SPACING;
    v->live_config.calibration = &b->calibration;
    err = sst_events_create(&v->events, 1024);
    return err ? err : sst_visits_open(&v->kept, "", 0);
}

static int open_bench(struct bench *b)
{
    struct sst_live_config cfg = { .rows = SIDE,
                                   .cols = SIDE,
                                   .fourcc = V4L2_PIX_FMT_MJPEG,
                                   .precision = SST_PRECISION_AUTO,
                                   .threads = 1,
                                   .skip_change = true,
                                   .skip_labels = true,
                                   .alarms_per_hour = 1 };
    char model[SST_PATH_MAX];
    int err = strcmp(b->model, "none") ? sst_model_resolve(model, b->model) : 0;

    cfg.model = strcmp(b->model, "none") ? model : NULL;
    cfg.width = (int)b->width;
    cfg.height = 3 * cfg.width / 4;
    b->cfg = (struct sst_hedge_config){
        .rows = SIDE, .cols = SIDE, .width = cfg.width, .height = cfg.height, .seed = (uint64_t)b->seed
    };
    sst_hedge_scene_config(&b->cfg);
    b->cfg.wind = b->wind;
    err = err ? err : sst_hedge_create(&b->hedge, &b->cfg);
    for (int k = 0; k < VIEWS && !err; k++) {
        cfg.present[k] = true;
        err = sst_image_init(&b->image[k], cfg.width, cfg.height);
    }
    err = err ? err : sst_live_open(&b->live, &cfg);
    return err ? err : open_engine(b);
}

static void free_frames(struct frames *f)
{
    for (int k = 0; k < VIEWS; k++)
        free(f->jpeg[k]);
}

static void close_bench(struct bench *b)
{
    if (b->engine) {
        sst_visits_close(b->engine->kept, 5000);
        sst_events_destroy(b->engine->events);
        pthread_mutex_destroy(&b->engine->lock);
    }
    free(b->engine);
    sst_live_close(b->live);
    for (int i = 0; i < b->empties; i++)
        free_frames(&b->empty[i]);
    for (int k = 0; k < VIEWS; k++)
        sst_image_fini(&b->image[k]);
    sst_hedge_destroy(b->hedge);
}

/* --- results ------------------------------------------------------------------------------------------------
 */

static double number_of(const json_t *data, const char *key)
{
    return json_number_value(json_object_get(data, key));
}

/* Of the places that it has been seen at. */
static double median_m(const json_t *data)
{
    const json_t *path = json_object_get(data, "path"), *p;
    double m[POINTS + 2];
    size_t i, n = 0;

    json_array_foreach(path, i, p)
    {
        if (n < ARRAY_LEN(m))
            m[n++] = json_number_value(json_array_get(p, 3));
    }
    if (!n)
        return NAN;
    sst_stats_sort_double(m, (int)n);
    return m[n / 2];
}

/* Visits that have ended. */
static void note_visits(struct bench *b, double t_s)
{
    const double true_m = b->engine->state.focal_px * SST_HEDGE_SPACING / 1000 / (b->cfg.width / 64.0);
    char *text;

    while (sst_events_next(b->engine->events, b->last, &b->last, &text)) {
        json_t *event = json_loads(text, 0, NULL);
        const json_t *data = json_object_get(event, "data");
        const char *type = json_string_value(json_object_get(event, "type"));

        if (type && !strcmp(type, "visit") && json_is_false(json_object_get(data, "active"))) {
            const double m = median_m(data);

            b->visits++;
            b->near += fabs(m - true_m) <= RIGHT * true_m;
            printf("passage %d: visit ends %.1f s after its begin, lasted %.1f s, %s%s, %.1f m (nearest %.1f, last "
                   "%.1f; true %.1f)\n",
                   b->now, t_s, number_of(data, "seconds"), json_string_value(json_object_get(data, "label")),
                   json_is_true(json_object_get(data, "hidden")) ? " hidden" : "", m, number_of(data, "nearest_m"),
                   number_of(data, "distance_m"), true_m);
        }
        json_decref(event);
        free(text);
    }
}

static void end_passage(struct bench *b)
{
    if (b->now) {
        b->right += b->visits == 1 && b->near == 1;
        b->split += b->visits > 1;
        b->wrong += b->visits == 1 && !b->near;
        b->missed += !b->visits;
        printf("passage %d: %d visits, %d at its distance\n", b->now, b->visits, b->near);
    } else {
        b->alone += b->visits;
    }
    b->visits = b->near = 0;
}

static void trace(const struct bench *b, double t_s)
{
    static const char *const states[] = { "seen", "covered", "still" };
    const struct sst_hedge_person p = sst_hedge_passer_by(&b->cfg, t_s);
    const bool there = b->now && t_s < SST_HEDGE_PASS_S;
    struct sst_live_track track[SST_LIVE_TRACKS];
    const int n = sst_live_tracks(b->live, track);

    printf("%8.2f s", t_s);
    if (there)
        printf(" person %.0f..%.0f", p.x - p.height / 5, p.x + p.height / 5);
    printf("\n");
    for (int i = 0; i < n; i++)
        printf("  %u %s %s%s %.0f..%.0f, %.0f..%.0f px, disparity %.2f px, %.0f px/s\n", track[i].id,
               sst_classes_name(&b->engine->classes, track[i].label), states[track[i].state],
               track[i].hidden ? " hidden" : "", track[i].x0, track[i].x1, track[i].y0, track[i].y1, track[i].disp_px,
               track[i].vx_px_s);
}

/* --- a set ----------------------------------------------------------------------------------------------------------
 */

static int draw(struct bench *b, double at_s, const struct sst_hedge_person *p, struct frames *f)
{
    int err = 0;

    sst_hedge_draw(b->hedge, at_s, p, b->image, NULL);
    for (int k = 0; k < VIEWS && !err; k++)
        err = sst_image_encode_jpeg(&b->image[k], QUALITY, &f->jpeg[k], &f->bytes[k]);
    return err;
}

/* The frames without anybody, kept if there is room. @param other  used if there is none */
static int draw_empty(struct bench *b, double at_s, struct frames *other, const struct frames **out)
{
    const int64_t wind_us = llround(fmod(at_s, SST_HEDGE_PERIOD_S) * 1e6);
    struct frames *f = b->empties < EMPTY ? &b->empty[b->empties] : other;

    for (int i = 0; i < b->empties; i++) {
        if (b->empty[i].wind_us == wind_us) {
            *out = &b->empty[i];
            return 0;
        }
    }
    b->empties += f != other;
    f->wind_us = wind_us;
    *out = f;
    return draw(b, at_s, NULL, f);
}

static int update(struct bench *b, double at_s, double t_s, const struct frames *f)
{
    struct sst_live_input in = { .set = (uint64_t)b->sets++, .t_ns = (int64_t)((at_s + 1) * 1e9) };
    struct sst_live_report *report = calloc(1, sizeof(*report));
    struct sst_live_track track[SST_LIVE_TRACKS];
    int err = report ? 0 : -ENOMEM;

    for (int k = 0; k < VIEWS; k++) {
        in.frame[k].data = f->jpeg[k];
        in.frame[k].bytes = f->bytes[k];
    }
    err = err ? err : sst_live_update(b->live, &in, report);
    free(report);
    if (err)
        return err;
    b->engine->set_t_ns = in.t_ns;
    b->engine->set_wall_ns = INT64_C(1795600000000000000) + in.t_ns;
    engine_visits_follow(b->engine, track, sst_live_tracks(b->live, track));
    note_visits(b, t_s);
    if (b->trace > 0)
        trace(b, t_s);
    return 0;
}

/* @param t_s  since the passage began */
static int run_set(struct bench *b, double at_s, double t_s)
{
    const struct sst_hedge_person p = sst_hedge_passer_by(&b->cfg, t_s);
    struct frames own = { .wind_us = 0 };
    const struct frames *f = &own;
    int err;

    if (b->now && t_s < SST_HEDGE_PASS_S)
        err = draw(b, at_s, &p, &own);
    else
        err = draw_empty(b, at_s, &own, &f);
    err = err ? err : update(b, at_s, t_s, f);
    free_frames(&own);
    return err;
}

static int run(struct bench *b)
{
    const double end_s = b->first + b->passages * cycle_s(b);
    int err = 0;

    for (double at_s = 0; at_s < end_s && !err; at_s = (double)b->sets / b->rate) {
        const int passage = at_s < b->first ? 0 : 1 + (int)((at_s - b->first) / cycle_s(b));

        if (passage != b->now)
            end_passage(b);
        b->now = passage;
        err = run_set(b, at_s, passage ? at_s - b->first - (passage - 1) * cycle_s(b) : at_s - b->first);
    }
    if (!err)
        end_passage(b);
    return err;
}

int main(int argc, char **argv)
{
    struct bench b = {
        .rate = 3, .seed = 1, .passages = 4, .gap = 24, .first = 40, .wind = 1, .width = 640, .model = "pspnet-small"
    };
    int err = 0;

    for (int i = 1; i < argc && !err; i += 2)
        err = i + 1 == argc || !set_option(&b, argv[i], argv[i + 1]);
    if (err) {
        fprintf(stderr, "usage: passages [rate|seed|passages|gap|first|wind|width|trace NUMBER] [model NAME] ...\n");
        return 2;
    }
    setvbuf(stdout, NULL, _IOLBF, 0);
    err = open_bench(&b);
    err = err ? err : run(&b);
    if (err)
        fprintf(stderr, "passages: %s\n", strerror(-err));
    else
        printf(
            "{\"rate\": %g, \"seed\": %g, \"sets\": %lld, \"passages\": %g, \"right\": %d, \"split\": %d, \"wrong\": "
            "%d, \"missed\": %d, \"before\": %d}\n",
            b.rate, b.seed, (long long)b.sets, b.passages, b.right, b.split, b.wrong, b.missed, b.alone);
    close_bench(&b);
    return err != 0;
}
