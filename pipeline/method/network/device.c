/* Networks on a device: plans stay on it, those that were used least recently give way to new ones. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/device.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/method/network/device_internal.h"

#define MOST_PLANS 16

/** A network of a size and precision. */
struct entry {
    uint64_t id;
    enum sst_precision precision;
    int width, height;
    struct net_device_plan *plan; /* NULL: refused */
    char why[NET_DEVICE_WHY];     /* if so */
    size_t weights, activations;  /* bytes on the device; activations share their memory */
    int64_t used;                 /* turn in which it was used last */
};

struct device {
    struct sst_runner_user user; /* first */
    /* under the lock of the runner */
    struct entry entry[MOST_PLANS];
    int entries;
    const struct net_device_plan *in_work; /* NULL: none; not freed */
    int64_t turn;
    struct sst_network_device_report report; /* kept, conv8 */
};

#if WITH_DNNL
/* --- plans -------------------------------------------------------------------------------------------------------- */

static void remove_entry(struct device *d, int i)
{
    net_device_plan_destroy(d->entry[i].plan);
    d->entry[i] = d->entry[--d->entries];
}

static void drop(void *arg)
{
    struct device *d = arg;

    for (int i = d->entries - 1; i >= 0; i--) {
        if (!d->in_work || d->entry[i].plan != d->in_work)
            remove_entry(d, i);
    }
}

static void remove_oldest(struct device *d)
{
    int oldest = 0;

    for (int i = 1; i < d->entries; i++) {
        if (d->entry[i].used < d->entry[oldest].used)
            oldest = i;
    }
    remove_entry(d, oldest);
}

/* The entry of a network, planned or refused. */
static struct entry *find_entry(struct sst_run *r, struct device *d, const struct net_job *job)
{
    const struct net_plan_config *cfg = &job->cfg;
    struct entry made = { .id = job->id, .precision = cfg->precision, .width = cfg->width, .height = cfg->height };

    for (int i = 0; i < d->entries; i++) {
        struct entry *e = &d->entry[i];

        if (e->id == job->id && e->width == cfg->width && e->height == cfg->height && e->precision == cfg->precision)
            return e;
    }
    if (d->entries == MOST_PLANS)
        remove_oldest(d);
    made.plan = net_device_plan_create(r, cfg, made.why);
    if (made.plan)
        net_device_plan_bytes(made.plan, &made.weights, &made.activations);
    d->entry[d->entries] = made;
    return &d->entry[d->entries++];
}

static void run_planned(struct sst_run *r, struct device *d, struct net_job *job)
{
    struct entry *e = find_entry(r, d, job);

    e->used = ++d->turn;
    d->in_work = e->plan;
    if (!e->plan)
        sst_run_leave(r, e->why);
    else if (net_device_plan_has_s8(e->plan) != !job->out)
        sst_run_leave(r, "a normalisation whose result is wanted in floats, or another one in bytes");
    else
        net_device_plan_run(e->plan, r, job);
    d->report.kept += job->kept;
    if (d->in_work && net_device_plan_conv8(d->in_work))
        snprintf(d->report.conv8, sizeof(d->report.conv8), "%s", net_device_plan_conv8(d->in_work));
    d->in_work = NULL;
}

/* --- the step ----------------------------------------------------------------------------------------------------- */

static bool wants(const void *job SST_UNUSED, int item SST_UNUSED)
{
    return true;
}

static int run_on_cpu(void *arg, int item, int worker SST_UNUSED)
{
    struct net_job *job = (struct net_job *)arg + item;
    int err = *job->plan ? 0 : net_plan_create(job->plan, &job->cfg);

    if (err)
        return err;
    err = job->out ? net_plan_run(*job->plan, job->in, job->out)
                   : net_plan_run_s8(*job->plan, job->in, job->factor, job->out_s8);
    if (err)
        sst_log_error("model %s: oneDNN failed to run it; use another model", job->cfg.name);
    return err;
}

static void dispatch(struct sst_run *r, void *arg, int item)
{
    struct net_job *job = (struct net_job *)arg + item;
    char why[NET_DEVICE_WHY];
    struct net_device_plan *p;

    if (job->user) {
        run_planned(r, (struct device *)job->user, job);
        return;
    }
    p = net_device_plan_create(r, &job->cfg, why);
    if (p)
        net_device_plan_run(p, r, job);
    net_device_plan_destroy(p);
}

static const struct sst_step step = { .name = "networks",
                                      .wants = wants,
                                      .cpu = run_on_cpu,
                                      .same = net_sample_same,
                                      .sample = net_sample,
                                      .seeds = NET_SAMPLE_SEEDS,
                                      .sample_free = net_sample_free };

static const struct sst_step_shaders steps[] = { { &step, dispatch, NULL, NULL }, { NULL, NULL, NULL, NULL } };

int net_job_run(struct net_job *job)
{
    return sst_run(job->user, &step, job, 1, &(struct sst_run_options){ .threads = 1, .block = 1 });
}
#else
static const struct sst_step_shaders steps[1];

static void drop(void *arg SST_UNUSED)
{
}
#endif

/* --- opening ------------------------------------------------------------------------------------------------------ */

static struct device *create(const char *phrase)
{
    struct device *d = calloc(1, sizeof(*d));

    if (!d) {
        sst_log_error("not enough memory for a device");
        return NULL;
    }
    d->user = (struct sst_runner_user){
        .steps = steps, .step_count = 1, .work = "run networks", .phrase = phrase, .drop = drop, .arg = d
    };
    return d;
}

int sst_network_device_open_on(struct sst_runner_user **out, struct sst_runner *shared)
{
    struct device *d;
    int err;

    *out = NULL;
    if (!shared || (!WITH_DNNL && !strcmp(sst_runner_name(shared), "auto")))
        return 0;
    if (!WITH_DNNL) {
        sst_log_error("device `%s`: this build has no oneDNN, whose plans networks on a device need; leave out "
                      "--device",
                      sst_runner_name(shared));
        return -ENOTSUP;
    }
    d = create("the network runs");
    if (!d)
        return -ENOMEM;
    err = sst_runner_join(shared, &d->user);
    if (err)
        free(d);
    else
        *out = &d->user;
    return err;
}

int sst_network_device_open(struct sst_runner_user **out, const char *name, uint64_t memory_bytes)
{
    struct sst_runner *runner;
    int err = sst_runner_create(&runner, name, memory_bytes);

    *out = NULL;
    err = err ? err : sst_network_device_open_on(out, runner);
    if (*out)
        (*out)->owns_runner = true;
    else
        sst_runner_destroy(runner);
    return err;
}

int sst_network_device_open_live(struct sst_runner_user **out, const char *name, uint64_t memory_bytes)
{
    static const char phrase[] = "live labels are computed";
    struct sst_runner *runner;
    struct device *d;
    int err = sst_runner_create_live(&runner, name, memory_bytes, SST_GPU_LABELS_PERCENT);

    *out = NULL;
    if (err || !runner)
        return err;
    if (!WITH_DNNL && strcmp(name, "auto"))
        sst_log_warning("device `%s`: this build has no oneDNN, whose plans networks on a device need; %s on the CPU",
                        name, phrase);
    d = WITH_DNNL ? create(phrase) : NULL;
    if (!d) {
        sst_runner_destroy(runner);
        return WITH_DNNL ? -ENOMEM : 0;
    }
    d->user.owns_runner = true;
    err = sst_runner_join(runner, &d->user);
    sst_runner_lock(runner);
    if (err)
        sst_runner_report_failure(&d->user, phrase, err, sst_runner_why(runner));
    sst_runner_unlock(runner);
    *out = &d->user;
    return 0;
}

void sst_network_device_close(struct sst_runner_user *user)
{
    if (user)
        sst_runner_leave(user->runner, user);
    free(user);
}

/* --- report ------------------------------------------------------------------------------------------------------- */

void sst_network_device_get_report(struct sst_runner_user *user, struct sst_network_device_report *out)
{
    const struct device *d = (struct device *)user;
    size_t weights = 0, activations = 0;

    sst_runner_lock(user->runner);
    *out = d->report;
    out->step = user->report;
    out->runs = user->report.items[0].device;
    out->on_cpu = user->report.items[0].on_cpu;
    for (int i = 0; i < d->entries; i++) {
        out->plans += d->entry[i].plan != NULL;
        weights += d->entry[i].weights;
        if (d->entry[i].activations > activations)
            activations = d->entry[i].activations;
    }
    out->memory_bytes = (int64_t)(weights + activations);
    sst_runner_unlock(user->runner);
}

void sst_network_device_clear_report(struct sst_runner_user *user)
{
    struct sst_step_report *of = &user->report;

    sst_runner_lock(user->runner);
    ((struct device *)user)->report.kept = 0;
    of->items[0] = (struct sst_step_items){ 0 };
    of->failures = of->dispatches = of->total_ns = of->upload_ns = of->download_ns = 0;
    sst_runner_unlock(user->runner);
}
