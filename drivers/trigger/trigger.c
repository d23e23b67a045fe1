/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/trigger/trigger.h"

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "drivers/trigger/trigger_internal.h"

#define PRIORITY       50
#define FINE_NS        2000000 /* the last part before a step is slept uninterrupted */
#define EDGES_WELL     20
#define EDGE_MARGIN_NS 300000    /* waiting for the loop-back edge ends this long before the next step */
#define EDGE_WAIT_NS   20000000  /* an edge is missing after this time, or half a period */
#define EDGE_EARLY_NS  100000    /* error of stamps converted from another clock */
#define STOP_CHECK_NS  50000000  /* external: a stop is noticed within this time */
#define RETRY_MIN_NS   100000000 /* a vanished chip is searched with back-off ... */
#define RETRY_MAX_NS   5000000000

struct sst_trigger {
    /* fixed after open */
    struct sst_trigger_config cfg;
    sst_trigger_edge_fn *edge;
    void *arg;
    struct pulse_step step[2 * SST_TRIGGER_LINES_MAX];
    int steps;
    pthread_t thread;
    bool threaded;
    /* under lock */
    pthread_mutex_t lock;
    pthread_cond_t wake, ended;
    double rate_hz;
    uint64_t count;
    int64_t start_ns;
    bool stop, quit;
    int error; /* error that ended the last train */
    struct sst_trigger_counters counters;
    /* atomic; changed under lock */
    _Atomic bool running, lost;
    _Atomic uint64_t skipped;
    /* trigger's thread only, once it runs */
    struct trigger_chip *chip;
    uint64_t index;
    uint32_t sequence;    /* of the last edge; 0: none yet */
    int edges_until_well; /* a missing edge was logged, and is logged again after this number of good ones */
};

void sst_trigger_config_defaults(struct sst_trigger_config *cfg)
{
    memset(cfg, 0, sizeof(*cfg));
    cfg->pulse_us = 1000;
}

/* --- sleeping ----------------------------------------------------------------------------------------------------- */

/* @return false: stopped before t_ns */
static bool wait_until_locked(struct sst_trigger *t, int64_t t_ns)
{
    while (!t->stop && !t->quit && sst_clock_now_ns() < t_ns - FINE_NS)
        (void)sst_cond_wait_until(&t->wake, &t->lock, t_ns - FINE_NS);
    if (t->stop || t->quit)
        return false;
    pthread_mutex_unlock(&t->lock);
    sst_clock_sleep_until(t_ns);
    pthread_mutex_lock(&t->lock);
    return !t->stop && !t->quit;
}

/* --- one pulse ---------------------------------------------------------------------------------------------------- */

/* Wait for the loop-back edge of this pulse until t_ns. @return 1, 0, or the error of the chip */
static int wait_for_edge(struct sst_trigger *t, struct sst_trigger_edge *edge, int64_t t_ns)
{
    struct gpio_edge got;

    for (;;) {
        const int64_t left_ns = t_ns - sst_clock_now_ns();
        const int r = gpio_chip_edge(t->chip, left_ns > 0 ? left_ns : 0, &got);

        if (r == -EINTR)
            continue;
        if (r <= 0)
            return r;
        if (got.sequence && t->sequence && got.sequence != t->sequence + 1) {
            pthread_mutex_lock(&t->lock);
            t->counters.edges_lost += got.sequence - t->sequence - 1;
            pthread_mutex_unlock(&t->lock);
        }
        t->sequence = got.sequence;
        /* A late edge of an earlier pulse does not belong to this one. */
        if (got.t_ns < edge->before_ns - EDGE_EARLY_NS)
            continue;
        edge->kernel_ns = got.t_ns;
        return 1;
    }
}

static void count_edge(struct sst_trigger *t, bool missing)
{
    if (missing && !t->edges_until_well)
        sst_log_warning("trigger: loop-back line %s reports no edge for tick %llu: check its wire, or remove "
                        "`loopback`; until then sets have the program's times",
                        t->cfg.loopback, (unsigned long long)t->index);
    if (!missing && t->edges_until_well == 1)
        sst_log_info("trigger: loop-back line %s reports edges again", t->cfg.loopback);
    if (!missing) {
        t->edges_until_well -= t->edges_until_well > 0;
        return;
    }
    t->edges_until_well = EDGES_WELL;
    pthread_mutex_lock(&t->lock);
    t->counters.edges_missing++;
    pthread_mutex_unlock(&t->lock);
}

/* Report as soon as the edge is known, which is before the pulse has ended. */
static void report_edge(struct sst_trigger *t, const struct sst_trigger_edge *edge)
{
    if (t->cfg.loopback[0])
        count_edge(t, !edge->kernel_ns);
    if (t->edge)
        t->edge(t->arg, edge);
    t->index++; /* even if the rest of the tick fails: no index is reported twice */
}

/* Times are relative to the first rise: a late tick keeps its pulse width. */
static int pulse(struct sst_trigger *t, struct sst_trigger_edge *edge, int64_t edge_wait_ns)
{
    const bool loopback = t->cfg.loopback[0];
    bool reported = false;
    int64_t base_ns = edge->due_ns - t->step[0].at_ns;
    int err;

    for (int i = 0; i < t->steps; i++) {
        const int64_t at_ns = base_ns + t->step[i].at_ns;

        if (loopback && i && !reported) {
            err = wait_for_edge(t, edge, at_ns - EDGE_MARGIN_NS);
            if (err < 0)
                return err;
            if (err) {
                report_edge(t, edge);
                reported = true;
            }
        }
        sst_clock_sleep_until(at_ns);
        if (!i)
            edge->before_ns = sst_clock_now_ns();
        err = gpio_chip_set(t->chip, t->step[i].active);
        if (!i) {
            edge->after_ns = sst_clock_now_ns();
            base_ns = edge->before_ns - t->step[0].at_ns;
        }
        if (err)
            return err;
        if (!i && !loopback) {
            report_edge(t, edge);
            reported = true;
        }
    }
    if (reported)
        return 0;
    err = wait_for_edge(t, edge, sst_clock_now_ns() + edge_wait_ns);
    if (err < 0)
        return err;
    report_edge(t, edge);
    return 0;
}

static int tick(struct sst_trigger *t, int64_t due_ns, int64_t edge_wait_ns)
{
    struct sst_trigger_edge edge = { .index = t->index, .due_ns = due_ns };
    int err = 0;

    if (t->cfg.source == SST_TRIGGER_SOFTWARE) {
        edge.before_ns = edge.after_ns = sst_clock_now_ns();
        report_edge(t, &edge);
    } else {
        edge.due_ns += t->step[0].at_ns;
        err = pulse(t, &edge, edge_wait_ns);
    }
    return err;
}

/* --- the thread --------------------------------------------------------------------------------------------------- */

static struct gpio_wanted wanted_lines(const struct sst_trigger_config *cfg)
{
    struct gpio_wanted wanted = {
        .chip = cfg->chip,
        .outputs = cfg->source == SST_TRIGGER_EXTERNAL ? 0 : cfg->lines,
        .loopback = cfg->loopback,
        .active_low = cfg->active_low,
    };

    for (int i = 0; i < wanted.outputs; i++)
        wanted.output[i] = cfg->line[i];
    return wanted;
}

static int open_chip(struct sst_trigger *t, char *why, size_t size)
{
    const struct gpio_wanted wanted = wanted_lines(&t->cfg);

    t->sequence = 0;
    return gpio_open(&t->chip, &wanted, why, size);
}

static void lose_chip_locked(struct sst_trigger *t, int err)
{
    if (!t->cfg.quiet)
        sst_log_error(
            "trigger: GPIO chip \"%s\" failed at tick %llu: %s; the pulse train is stopped until the chip is back",
            t->cfg.chip[0] ? t->cfg.chip : wanted_lines(&t->cfg).outputs ? t->cfg.line[0] : t->cfg.loopback,
            (unsigned long long)t->index, strerror(-err));
    gpio_chip_close(t->chip); /* also releases the lines, at the level of the last step */
    t->chip = NULL;
    t->counters.chip_lost++;
    t->lost = true;
}

/* Search once after each back-off, without the lock. */
static void find_chip_locked(struct sst_trigger *t)
{
    int64_t wait_ns = RETRY_MIN_NS;

    while (!t->quit) {
        char why[SST_LOG_MAX];
        const int64_t next_ns = sst_clock_now_ns() + wait_ns;

        while (!t->quit && sst_cond_wait_until(&t->wake, &t->lock, next_ns))
            ;
        if (t->quit)
            return;
        pthread_mutex_unlock(&t->lock);
        const int err = open_chip(t, why, sizeof(why));
        pthread_mutex_lock(&t->lock);
        if (!err) {
            t->counters.chip_found++;
            t->lost = false;
            if (!t->cfg.quiet)
                sst_log_warning("trigger: GPIO chip \"%s\" is back", gpio_chip_label(t->chip));
            return;
        }
        wait_ns = wait_ns * 2 > RETRY_MAX_NS ? RETRY_MAX_NS : wait_ns * 2;
    }
}

/* An edge that the kernel dropped, by its sequence numbers, is counted: the next one has the index that it would have. */
static void count_external(struct sst_trigger *t, const struct gpio_edge *got)
{
    const uint32_t lost = got->sequence && t->sequence ? got->sequence - t->sequence - 1 : 0;

    t->sequence = got->sequence;
    t->index += lost;
    pthread_mutex_lock(&t->lock);
    t->counters.edges_lost += lost;
    t->counters.fired++;
    pthread_mutex_unlock(&t->lock);
}

/* Report the edges of the input as they come. */
static int follow_edges_locked(struct sst_trigger *t)
{
    const int64_t start_ns = t->start_ns;
    uint64_t seen = 0;

    while (!t->stop && !t->quit && (!t->count || seen < t->count)) {
        struct gpio_edge got;
        int r;

        pthread_mutex_unlock(&t->lock);
        r = gpio_chip_edge(t->chip, STOP_CHECK_NS, &got);
        if (r == 1 && got.t_ns < start_ns) {
            t->sequence = got.sequence; /* from before the start */
        } else if (r == 1) {
            count_external(t, &got);
            report_edge(t, &(struct sst_trigger_edge){ .index = t->index,
                                                       .due_ns = got.t_ns,
                                                       .before_ns = got.t_ns,
                                                       .after_ns = got.t_ns,
                                                       .kernel_ns = got.t_ns });
            seen++;
        }
        pthread_mutex_lock(&t->lock);
        if (r < 0 && r != -EINTR)
            return r;
    }
    return 0;
}

static int run_train_locked(struct sst_trigger *t)
{
    const double rate_hz = t->rate_hz;
    const int64_t start_ns = t->start_ns, half_ns = (int64_t)(0.5e9 / rate_hz);
    const int64_t span_ns = t->steps ? t->step[t->steps - 1].at_ns : 0;
    const int64_t spare_ns = half_ns > span_ns / 2 ? half_ns - span_ns / 2 : 0;
    uint64_t fired = 0;

    for (uint64_t n = 0; !t->count || fired < t->count; n++) {
        const int64_t due_ns = tick_due_ns(start_ns, rate_hz, n);
        uint64_t next;
        int err;

        if (!wait_until_locked(t, due_ns))
            return 0;
        next = tick_next(start_ns, rate_hz, n, sst_clock_now_ns());
        if (next > n) {
            t->skipped += next - n;
            n = next - 1;
            continue;
        }
        pthread_mutex_unlock(&t->lock);
        err = tick(t, due_ns, spare_ns < EDGE_WAIT_NS ? spare_ns : EDGE_WAIT_NS);
        pthread_mutex_lock(&t->lock);
        if (err)
            return err;
        t->counters.fired++;
        fired++;
    }
    return 0;
}

static void *serve(void *arg)
{
    struct sst_trigger *t = arg;

    pthread_mutex_lock(&t->lock);
    while (!t->quit) {
        if (t->lost) {
            find_chip_locked(t);
        } else if (t->running) {
            t->error = t->cfg.source == SST_TRIGGER_EXTERNAL ? follow_edges_locked(t) : run_train_locked(t);
            if (t->error)
                lose_chip_locked(t, t->error);
            t->running = false;
            pthread_cond_broadcast(&t->ended);
        } else {
            pthread_cond_wait(&t->wake, &t->lock);
        }
    }
    t->running = false;
    pthread_cond_broadcast(&t->ended);
    pthread_mutex_unlock(&t->lock);
    return NULL;
}

/* Real-time priority keeps ticks in time on a busy machine; without the permission they are still absolute. */
static int start_thread(struct sst_trigger *t)
{
    const struct sched_param priority = { .sched_priority = PRIORITY };
    const int err = pthread_create(&t->thread, NULL, serve, t);

    if (err) {
        sst_log_error("trigger: no thread: %s", strerror(err));
        return -err;
    }
    t->threaded = true;
    if (pthread_setschedparam(t->thread, SCHED_FIFO, &priority))
        sst_log_info("trigger: no real-time priority (needs CAP_SYS_NICE or an rtprio limit of %d): on a busy machine "
                     "ticks may be late",
                     PRIORITY);
    return 0;
}

/* --- calls -------------------------------------------------------------------------------------------------------- */

/* @return 0 or -EINVAL with the reason */
static int check_config(const struct sst_trigger_config *cfg, char *why, size_t size)
{
    if (cfg->source == SST_TRIGGER_EXTERNAL && !cfg->loopback[0]) {
        snprintf(why, size, "no input is named: set `loopback` to the line that the edges come in on");
        return -EINVAL;
    }
    if (cfg->source != SST_TRIGGER_GPIO)
        return 0;
    if (cfg->lines < 1 || cfg->lines > SST_TRIGGER_LINES_MAX) {
        snprintf(why, size, "%d lines, not 1..%d: name the lines that expose the cameras", cfg->lines,
                 SST_TRIGGER_LINES_MAX);
        return -EINVAL;
    }
    if (cfg->pulse_us < 10 || cfg->pulse_us > 1000000) {
        snprintf(why, size, "a pulse of %d us is outside 10..1000000", cfg->pulse_us);
        return -EINVAL;
    }
    for (int i = 0; i < cfg->lines; i++) {
        if (cfg->delay_us[i] < 0 || cfg->delay_us[i] > 1000000) {
            snprintf(why, size, "line %s: a delay of %d us is outside 0..1000000", cfg->line[i], cfg->delay_us[i]);
            return -EINVAL;
        }
        for (int j = 0; j <= i; j++) {
            if (!strcmp(cfg->line[i], j < i ? cfg->line[j] : cfg->loopback)) {
                snprintf(why, size, "line %s is named twice", cfg->line[i]);
                return -EINVAL;
            }
        }
    }
    return 0;
}

static bool has_chip(const struct sst_trigger_config *cfg)
{
    return cfg->source == SST_TRIGGER_GPIO || cfg->source == SST_TRIGGER_EXTERNAL;
}

int sst_trigger_check(const struct sst_trigger_config *cfg, char *why, size_t size)
{
    const struct gpio_wanted wanted = wanted_lines(cfg);
    int err = check_config(cfg, why, size);

    if (!err && has_chip(cfg))
        err = gpio_probe(&wanted, why, size);
    else if (!err)
        snprintf(why, size, "no GPIO line is needed");
    return err;
}

int sst_trigger_open(struct sst_trigger **out, const struct sst_trigger_config *cfg, sst_trigger_edge_fn *edge,
                     void *arg)
{
    struct sst_trigger *t;
    char why[SST_LOG_MAX] = "";
    int err = check_config(cfg, why, sizeof(why));

    if (err) {
        sst_log_error("trigger: %s", why);
        return err;
    }
    t = calloc(1, sizeof(*t));
    if (!t) {
        sst_log_error("trigger: out of memory");
        return -ENOMEM;
    }
    pthread_mutex_init(&t->lock, NULL);
    sst_cond_init(&t->wake);
    sst_cond_init(&t->ended);
    t->cfg = *cfg;
    t->edge = edge;
    t->arg = arg;
    if (!has_chip(cfg))
        t->cfg.loopback[0] = 0;
    if (cfg->source == SST_TRIGGER_GPIO)
        t->steps = pulse_steps(t->step, cfg->delay_us, cfg->lines, cfg->pulse_us);
    if (has_chip(cfg)) {
        err = open_chip(t, why, sizeof(why));
        if (err)
            sst_log_error("trigger: %s", why);
    }
    if (!err && cfg->source != SST_TRIGGER_FREE_RUN)
        err = start_thread(t);
    if (err)
        sst_trigger_close(t);
    else
        *out = t;
    return err;
}

static int begin_locked(struct sst_trigger *t, double rate_hz, uint64_t count)
{
    if (t->running)
        return -EBUSY;
    if (t->lost)
        return -ENODEV;
    t->rate_hz = rate_hz;
    t->count = count;
    t->start_ns = sst_clock_now_ns();
    t->stop = false;
    t->error = 0;
    t->running = true;
    pthread_cond_signal(&t->wake);
    return 0;
}

/* Between two pulses the lines must be inactive for a short time. */
static bool too_fast(const struct sst_trigger *t, double rate_hz)
{
    return t->steps && (double)t->step[t->steps - 1].at_ns * rate_hz >= 1e9;
}

int sst_trigger_start(struct sst_trigger *t, double rate_hz, uint64_t count)
{
    int err;

    if (!(rate_hz >= 0.01 && rate_hz <= 1000)) {
        sst_log_error("trigger: a rate of %g/s is outside 0.01..1000", rate_hz);
        return -EINVAL;
    }
    if (too_fast(t, rate_hz)) {
        sst_log_error("trigger: the pulse with its delays lasts %lld us, longer than the period at %g/s: shorten it or "
                      "lower the rate",
                      (long long)(t->step[t->steps - 1].at_ns / 1000), rate_hz);
        return -EINVAL;
    }
    pthread_mutex_lock(&t->lock);
    err = begin_locked(t, rate_hz, count);
    pthread_mutex_unlock(&t->lock);
    return err;
}

int sst_trigger_fire(struct sst_trigger *t)
{
    int err = 0;

    if (!t->threaded)
        return 0;
    pthread_mutex_lock(&t->lock);
    err = begin_locked(t, too_fast(t, 10) ? 0.1 : 10, 1);
    if (!err) {
        while (t->running)
            pthread_cond_wait(&t->ended, &t->lock);
        err = t->error;
    }
    pthread_mutex_unlock(&t->lock);
    return err;
}

int sst_trigger_stop(struct sst_trigger *t)
{
    int err;

    pthread_mutex_lock(&t->lock);
    t->stop = true;
    pthread_cond_signal(&t->wake);
    if (!t->threaded)
        t->running = false;
    while (t->running)
        pthread_cond_wait(&t->ended, &t->lock);
    err = t->error;
    pthread_mutex_unlock(&t->lock);
    return err;
}

bool sst_trigger_idle(const struct sst_trigger *t)
{
    return !t->running;
}

uint64_t sst_trigger_skipped(const struct sst_trigger *t)
{
    return t->skipped;
}

void sst_trigger_counters(struct sst_trigger *t, struct sst_trigger_counters *out)
{
    pthread_mutex_lock(&t->lock);
    *out = t->counters;
    pthread_mutex_unlock(&t->lock);
}

void sst_trigger_close(struct sst_trigger *t)
{
    if (!t)
        return;
    if (t->threaded) {
        pthread_mutex_lock(&t->lock);
        t->quit = true;
        pthread_cond_broadcast(&t->wake);
        pthread_mutex_unlock(&t->lock);
        pthread_join(t->thread, NULL);
    }
    gpio_chip_close(t->chip);
    pthread_cond_destroy(&t->ended);
    pthread_cond_destroy(&t->wake);
    pthread_mutex_destroy(&t->lock);
    free(t);
}
