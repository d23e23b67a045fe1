/* Networks on a device: plans stay on it, those that were used least recently give way to new ones.
 *
 * A device that fails is closed. The network in work and the next ones then run on the CPU, as in
 * pipeline/method/render/device.c, also where it serves live pictures (`live`). */
#include "pipeline/method/network/device.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/method/network/network_internal.h"

#define MOST_PLANS 16

/** A network of a size and precision. */
struct entry {
    uint64_t id;
    enum sst_precision precision;
    int width, height;
    struct net_device_plan *plan; /* NULL: refused */
    char why[NET_DEVICE_WHY];     /* if so */
    int64_t used;                 /* turn in which it was used last */
};

struct sst_network_device {
    struct sst_runner *shared;
    bool owns_shared; /* opened by this one, and closed with it */
    bool live;
    struct sst_runner_user user;
    /* under the lock of shared */
    struct sst_gpu *gpu; /* in work */
    bool given_up;       /* live: it computes something else, and is not opened again */
    bool noted;          /* live: that a network is the CPU's */
    struct entry entry[MOST_PLANS];
    int entries;
    int64_t turn;
    struct sst_network_device_report report;
};

#if WITH_DNNL
/* --- opening and failing ------------------------------------------------------------------------------------------ */

static void remove_entry(struct sst_network_device *d, int i)
{
    net_device_plan_destroy(d->entry[i].plan);
    d->entry[i] = d->entry[--d->entries];
}

static void drop(void *arg)
{
    struct sst_network_device *d = arg;

    while (d->entries)
        remove_entry(d, 0);
}

static void note_name(struct sst_network_device *d)
{
    const struct sst_gpu_info *info = sst_runner_info(d->shared);

    snprintf(d->report.name, sizeof(d->report.name), "%s", info->name);
    snprintf(d->report.driver, sizeof(d->report.driver), "%s", info->driver);
}

static struct sst_network_device *create(struct sst_runner *shared)
{
    /* A device must run the first ones; a network that needs others is refused if they are. */
    static const enum sst_gpu_shader shaders[] = { SST_GPU_NET_CONV8, SST_GPU_NET_CONV, SST_GPU_NET_MOVE,
                                                   SST_GPU_NET_RESIZE, SST_GPU_NET_POOL };
    struct sst_network_device *d = calloc(1, sizeof(*d));

    if (!d) {
        sst_log_error("not enough memory for a device");
        return NULL;
    }
    d->shared = shared;
    d->user = (struct sst_runner_user){
        .shaders = shaders, .count = 2, .tested = ARRAY_LEN(shaders) - 2, .work = "run networks", .drop = drop, .arg = d
    };
    return d;
}

int sst_network_device_open_on(struct sst_network_device **out, struct sst_runner *shared)
{
    struct sst_network_device *d;
    int err;

    *out = NULL;
    if (!shared)
        return 0;
    d = create(shared);
    if (!d)
        return -ENOMEM;
    err = sst_runner_join(shared, &d->user);
    if (err) {
        free(d);
        return err;
    }
    note_name(d);
    *out = d;
    return 0;
}

int sst_network_device_open(struct sst_network_device **out, const char *name, uint64_t memory_bytes)
{
    struct sst_runner *shared;
    int err = sst_runner_create(&shared, name, memory_bytes);

    *out = NULL;
    err = err ? err : sst_network_device_open_on(out, shared);
    if (err)
        sst_runner_destroy(shared);
    else if (*out)
        (*out)->owns_shared = true;
    return err;
}

void sst_network_device_close(struct sst_network_device *d)
{
    if (!d)
        return;
    sst_runner_leave(d->shared, &d->user);
    if (d->owns_shared)
        sst_runner_destroy(d->shared);
    free(d);
}

/* Note that a network runs on the CPU, and why. */
static void note_cpu(struct sst_network_device *d, const char *why)
{
    d->report.on_cpu++;
    snprintf(d->report.why, sizeof(d->report.why), "%s", why);
}

/* After an error of the device: close it, and leave it alone for some runs. @param why  "": the error's own */
static void fail(struct sst_network_device *d, int err, const char *why)
{
    const int skipped = sst_runner_fail(d->shared);

    why = *why ? why : sst_gpu_error(err);
    d->given_up = d->live && err == -ENOTSUP;
    if (!d->live)
        sst_log_warning("%s: %s; the network runs on the CPU, and the device is opened again after %d more runs",
                        d->report.name, why, skipped);
    else if (!d->report.failing)
        sst_log_warning("%s: %s; live labels are computed on the CPU%s", d->report.name, why,
                        d->given_up ? "" : ", and the device is tried again now and then");
    snprintf(d->report.failure, sizeof(d->report.failure), "%s", why);
    d->report.failing = true;
    d->report.failures++;
}

static void note_success(struct sst_network_device *d)
{
    if (d->report.failing && d->live)
        sst_log_info("%s: live labels are computed on the device again", d->report.name);
    d->report.failing = false;
    sst_runner_succeed(d->shared);
}

/* True if the device may be tried; else the run is noted as one for the CPU. */
static bool may_try(struct sst_network_device *d)
{
    int err = -ENOTSUP;

    d->gpu = d->given_up ? NULL : sst_runner_take(d->shared, &d->user, &err);
    if (d->gpu) {
        note_name(d);
        return true;
    }
    if (err && err != -EINPROGRESS && !d->given_up)
        fail(d, err, sst_runner_why(d->shared));
    if (err)
        note_cpu(d, err == -EINPROGRESS ? "the device is being opened" : sst_gpu_error(err));
    else
        d->report.on_cpu++;
    return false;
}

int sst_network_device_open_live(struct sst_network_device **out, const char *name, uint64_t memory_bytes)
{
    struct sst_runner *shared;
    struct sst_network_device *d;
    int err = sst_runner_create_live(&shared, name, memory_bytes, SST_GPU_LABELS_PERCENT);

    *out = NULL;
    if (err || !shared)
        return err;
    d = create(shared);
    if (!d) {
        sst_runner_destroy(shared);
        return -ENOMEM;
    }
    d->owns_shared = d->live = true;
    snprintf(d->report.name, sizeof(d->report.name), "%s", name);
    err = sst_runner_join(shared, &d->user);
    sst_runner_lock(shared);
    if (err)
        fail(d, err, sst_runner_why(shared));
    else
        note_name(d);
    sst_runner_unlock(shared);
    *out = d;
    return 0;
}

/* --- plans -------------------------------------------------------------------------------------------------------- */

static struct entry *find_entry(struct sst_network_device *d, const struct net_device_job *job)
{
    for (int i = 0; i < d->entries; i++) {
        struct entry *e = &d->entry[i];

        if (e->id == job->id && e->width == job->width && e->height == job->height && e->precision == job->precision)
            return e;
    }
    return NULL;
}

/* Free the plan that was used least recently, or any one that was refused. @return false: there is none */
static bool remove_oldest(struct sst_network_device *d)
{
    int oldest = 0;

    if (!d->entries)
        return false;
    for (int i = 1; i < d->entries; i++) {
        if (d->entry[i].used < d->entry[oldest].used)
            oldest = i;
    }
    remove_entry(d, oldest);
    return true;
}

/* Plan a network; one that the device does not hold or compute is remembered as refused. */
static int create_plan(struct sst_network_device *d, struct entry *e, const struct net_device_job *job)
{
    struct sst_shape *shapes = calloc((size_t)job->graph->n_values, sizeof(*shapes));
    int err = shapes ? sst_graph_shapes(job->graph, job->width, job->height, shapes, NULL) : -ENOMEM;

    if (!err) {
        do
            err = net_device_plan_create(&e->plan, d->gpu, job->graph, shapes, job->precision, e->why);
        while (err == -ENOMEM && (remove_oldest(d) || sst_runner_make_room(d->shared, &d->user)));
        if (!err && net_device_plan_conv8(e->plan))
            snprintf(d->report.conv8, sizeof(d->report.conv8), "%s", net_device_plan_conv8(e->plan));
    }
    free(shapes);
    if (err == -ENOMEM)
        snprintf(e->why, sizeof(e->why), "a network of %d x %d pixels does not fit into the device's memory",
                 job->width, job->height);
    return err == -ENOMEM || err == -ENOTSUP ? 0 : err;
}

/* The entry of a network, planned or refused. */
static int make_entry(struct sst_network_device *d, struct entry **out, const struct net_device_job *job)
{
    struct entry made = { .id = job->id, .precision = job->precision, .width = job->width, .height = job->height };
    int err;

    *out = find_entry(d, job);
    if (*out)
        return 0;
    err = create_plan(d, &made, job);
    if (err)
        return err;
    if (d->entries == MOST_PLANS)
        (void)remove_oldest(d);
    *out = &d->entry[d->entries++];
    **out = made;
    return 0;
}

/* @return 0, 1 (the CPU must run it; noted), or an error of the device */
static int run(struct sst_network_device *d, const struct net_device_job *job)
{
    struct net_device_times times = { 0 };
    const int64_t start_ns = sst_clock_now_ns();
    struct entry *e;
    int err = make_entry(d, &e, job);

    if (err)
        return err;
    e->used = ++d->turn;
    if (!e->plan || net_device_plan_has_s8(e->plan) != !job->out) {
        note_cpu(d, e->plan ? "a normalisation whose result is wanted in floats, or another one in bytes" : e->why);
        if (d->live && !d->noted)
            sst_log_warning("%s: %s; live labels are computed on the CPU", d->report.name, d->report.why);
        d->noted = true;
        return 1;
    }
    err = net_device_plan_run(e->plan, job->in, job->out ? (void *)job->out : job->out_s8, job->factor, job->keeper,
                              &times);
    d->report.dispatches += times.dispatches;
    if (err == -ENOMEM) {
        note_cpu(d, sst_gpu_error(err));
        return 1;
    }
    if (err)
        return err;
    d->report.runs++;
    d->report.fed += times.fed;
    d->report.kept += times.kept;
    d->report.upload_ns += times.upload_ns;
    d->report.download_ns += times.download_ns;
    d->report.total_ns += sst_clock_now_ns() - start_ns - times.kept_ns;
    return 0;
}

bool net_device_run(struct sst_network_device *d, const struct net_device_job *job)
{
    int err;

    sst_runner_lock(d->shared);
    err = may_try(d) ? run(d, job) : 1;
    if (err < 0) {
        fail(d, err, "");
        note_cpu(d, sst_gpu_error(err));
    } else if (!err) {
        note_success(d);
    }
    sst_runner_unlock(d->shared);
    return !err;
}

void net_device_note_cpu(struct sst_network_device *d, const char *why)
{
    sst_runner_lock(d->shared);
    note_cpu(d, why);
    sst_runner_unlock(d->shared);
}

void sst_network_device_get_report(struct sst_network_device *d, struct sst_network_device_report *out)
{
    sst_runner_lock(d->shared);
    *out = d->report;
    out->memory_bytes = 0;
    out->plans = 0;
    for (int i = 0; i < d->entries; i++) {
        if (d->entry[i].plan) {
            out->plans++;
            out->memory_bytes += (int64_t)net_device_plan_bytes(d->entry[i].plan);
        }
    }
    sst_runner_unlock(d->shared);
}

void sst_network_device_clear_report(struct sst_network_device *d)
{
    struct sst_network_device_report *r = &d->report;

    sst_runner_lock(d->shared);
    r->runs = r->fed = r->kept = r->on_cpu = r->failures = r->dispatches = r->total_ns = r->upload_ns = r->download_ns =
        0;
    sst_runner_unlock(d->shared);
}
#else
int sst_network_device_open(struct sst_network_device **out, const char *name, uint64_t memory_bytes SST_UNUSED)
{
    *out = NULL;
    if (!strcmp(name, "cpu") || !strcmp(name, "auto"))
        return 0;
    sst_log_error("device `%s`: this build has no oneDNN, whose plans networks on a device need; leave out --device",
                  name);
    return -ENOTSUP;
}

int sst_network_device_open_on(struct sst_network_device **out, struct sst_runner *shared)
{
    *out = NULL;
    return shared ? sst_network_device_open(out, sst_runner_name(shared), 0) : 0;
}

int sst_network_device_open_live(struct sst_network_device **out, const char *name, uint64_t memory_bytes SST_UNUSED)
{
    *out = NULL;
    if (strcmp(name, "cpu") != 0 && strcmp(name, "auto") != 0)
        sst_log_warning("device `%s`: this build has no oneDNN, whose plans networks on a device need; live labels are "
                        "computed on the CPU",
                        name);
    return 0;
}

void sst_network_device_close(struct sst_network_device *d SST_UNUSED)
{
}

void net_device_note_cpu(struct sst_network_device *d SST_UNUSED, const char *why SST_UNUSED)
{
}

bool net_device_run(struct sst_network_device *d SST_UNUSED, const struct net_device_job *job SST_UNUSED)
{
    return false;
}

void sst_network_device_get_report(struct sst_network_device *d, struct sst_network_device_report *out)
{
    *out = d->report;
}

void sst_network_device_clear_report(struct sst_network_device *d SST_UNUSED)
{
}
#endif
