/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/rig/rig_camera.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "base/thread.h"
#include "capture/array/capture.h"

#define POLL_MS       20
#define START_MS      5000
#define FIRE_AGAIN_NS 1500000000 /* a trigger without a frame is fired again after this */

struct sst_scan_grab {
    pthread_t thread;
    bool running;
    struct sst_grab *grab;       /* camera thread, except release and expect */
    struct sst_trigger *trigger; /* caller's thread; NULL: free run */
    const atomic_bool *cancel;
    struct sst_grab_binding binding;
    struct sst_grab_device device; /* fixed after open */

    pthread_mutex_t lock;
    pthread_cond_t arrived;
    /* under lock */
    bool stop, wanted;
    int64_t after_ns;
    struct sst_frame *got;
    uint64_t bad; /* damaged frames since `wanted` */
    enum sst_grab_state state;
    char why[160]; /* of the state */
    struct sst_grab_counters count;
};

/* --- camera thread ------------------------------------------------------------------------------------------------ */

static void on_frame(void *arg, struct sst_frame *frame)
{
    struct sst_scan_grab *g = arg;
    bool keep;

    pthread_mutex_lock(&g->lock);
    /* A picture that repeats the one before was not exposed at this position. */
    keep = g->wanted && !g->got && frame->t_ns >= g->after_ns;
    if (keep && frame->faults) {
        g->bad++;
        keep = false;
    }
    if (keep) {
        g->got = frame;
        g->wanted = false;
        pthread_cond_signal(&g->arrived);
    }
    pthread_mutex_unlock(&g->lock);
    if (!keep)
        sst_grab_release(g->grab, frame);
}

static void on_state(void *arg, int cam SST_UNUSED, enum sst_grab_state state, const char *why)
{
    struct sst_scan_grab *g = arg;

    pthread_mutex_lock(&g->lock);
    g->state = state;
    snprintf(g->why, sizeof(g->why), "%s", why ? why : "");
    pthread_mutex_unlock(&g->lock);
}

static void *poll_camera(void *arg)
{
    struct sst_scan_grab *g = arg;
    bool stop = false;
    int err = sst_grab_start(g->grab);

    while (err >= 0 && !stop) {
        struct sst_grab_counters count;

        err = sst_grab_poll(g->grab, POLL_MS);
        sst_grab_counters(g->grab, 0, &count);
        pthread_mutex_lock(&g->lock);
        stop = g->stop;
        g->count = count;
        pthread_mutex_unlock(&g->lock);
    }
    if (err < 0)
        sst_log_error("camera %s: the stream ended: %s", g->device.node, strerror(-err));
    return NULL;
}

/* --- frames ------------------------------------------------------------------------------------------------------- */

/* Wait until then or for POLL_MS, whichever is shorter. Under lock. @return a frame is available */
static bool wait_locked(struct sst_scan_grab *g, int64_t end_ns)
{
    const int64_t now_ns = sst_clock_now_ns(), until_ns = now_ns + POLL_MS * 1000000;
    const int64_t t_ns = end_ns < until_ns ? end_ns : until_ns;

    if (!g->got && t_ns > now_ns)
        (void)sst_cond_wait_until(&g->arrived, &g->lock, t_ns);
    return g->got != NULL;
}

static bool cancelled(const struct sst_scan_grab *g)
{
    return g->cancel && atomic_load(g->cancel);
}

static int fire(struct sst_scan_grab *g)
{
    const int64_t t_ns = sst_clock_now_ns();
    const int err = sst_trigger_fire(g->trigger);

    if (!err)
        sst_grab_expect(g->grab, t_ns);
    return err;
}

static int expose(void *arg, int64_t after_ns, int timeout_ms, struct sst_frame **frame)
{
    struct sst_scan_grab *g = arg;
    const int64_t end_ns = after_ns + (int64_t)timeout_ms * 1000000;
    int64_t fire_ns = after_ns;
    enum sst_grab_state state;
    uint64_t bad;
    char why[160];
    int err = 0;

    pthread_mutex_lock(&g->lock);
    g->after_ns = after_ns;
    g->bad = 0;
    g->wanted = true;
    while (!err && !wait_locked(g, end_ns)) {
        const int64_t now_ns = sst_clock_now_ns();

        if (cancelled(g))
            err = -ECANCELED;
        else if (now_ns >= end_ns)
            err = g->state == SST_GRAB_ABSENT ? -ENODEV : -ETIMEDOUT;
        if (err || !g->trigger || now_ns + POLL_MS * 1000000 < fire_ns)
            continue;
        pthread_mutex_unlock(&g->lock);
        sst_clock_sleep_until(fire_ns);
        err = fire(g);
        fire_ns = sst_clock_now_ns() + FIRE_AGAIN_NS;
        pthread_mutex_lock(&g->lock);
    }
    g->wanted = false;
    if (g->got) {
        *frame = g->got;
        g->got = NULL;
        err = 0;
    }
    state = g->state;
    bad = g->bad;
    memcpy(why, g->why, sizeof(why));
    pthread_mutex_unlock(&g->lock);
    if (err == -ETIMEDOUT || err == -ENODEV)
        sst_log_error("camera %s at %s delivered no good frame within %d ms, %llu damaged ones%s%s; check its cable "
                      "and lighting, and its trigger if it has one",
                      g->binding.serial[0] ? g->binding.serial : g->device.node, g->device.port, timeout_ms,
                      (unsigned long long)bad, state == SST_GRAB_STREAMING ? "" : ": ",
                      state == SST_GRAB_STREAMING ? "" : why);
    return err;
}

static void release(void *arg, struct sst_frame *frame)
{
    struct sst_scan_grab *g = arg;

    sst_grab_release(g->grab, frame);
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static int choose(struct sst_scan_grab *g, const char *which, uint32_t fourcc)
{
    struct sst_grab_device *devices;
    char list[512] = "";
    int count, found = -1, matches = 0, err = sst_grab_list(&devices, &count);

    if (err)
        return err;
    count = sst_grab_select(devices, count, fourcc);
    for (int i = 0; i < count; i++) {
        sst_text_add(list, sizeof(list), "%s%s at %s", i ? ", " : "",
                     devices[i].serial[0] ? devices[i].serial : "no serial", devices[i].port);
        if (which && strcmp(which, devices[i].serial) != 0 && strcmp(which, devices[i].port) != 0)
            continue;
        found = i;
        matches++;
    }
    if (matches == 1) {
        g->device = devices[found];
        memcpy(g->binding.serial, g->device.serial, sizeof(g->binding.serial));
        memcpy(g->binding.port, g->device.port, sizeof(g->binding.port));
    } else {
        sst_log_error("%s%s; connected: %s%s; select one by serial or port with --camera",
                      which ? "no single camera matches " : "no camera is selected", which ? which : "",
                      count ? "" : "none", list);
    }
    free(devices);
    return matches == 1 ? 0 : -ENODEV;
}

static int open_grab(struct sst_scan_grab *g, const struct sst_array_config *a)
{
    const struct sst_grab_events events = { .arg = g, .frame = on_frame, .state = on_state };
    struct sst_grab_config cfg;

    sst_capture_grab_config(&cfg, a);
    cfg.cameras = 1;
    cfg.bindings = &g->binding;
    cfg.check_frozen = true; /* a repeated picture is not a view */
    return sst_grab_open(&g->grab, &cfg, &events);
}

/* Wait until the camera streams or reports an error: there is no use in waiting for one that refuses. */
static int wait_streaming(struct sst_scan_grab *g)
{
    const int64_t end_ns = sst_clock_now_ns() + START_MS * (int64_t)1000000;
    enum sst_grab_state state = SST_GRAB_READY;
    char why[160];

    while (sst_clock_now_ns() < end_ns && !cancelled(g)) {
        pthread_mutex_lock(&g->lock);
        state = g->state;
        memcpy(why, g->why, sizeof(why));
        pthread_mutex_unlock(&g->lock);
        if (state == SST_GRAB_STREAMING)
            return 0;
        if (state == SST_GRAB_REFUSED)
            break;
        sst_clock_sleep_until(sst_clock_now_ns() + POLL_MS * 1000000);
    }
    if (cancelled(g))
        return -EINTR;
    sst_log_error("camera %s at %s does not stream: %s", g->device.node, g->device.port, why);
    return -ENODEV;
}

int sst_scan_grab_open(struct sst_scan_grab **out, const struct sst_array_config *array, const char *which,
                       const atomic_bool *cancel, struct sst_scan_camera *camera)
{
    struct sst_scan_grab *g = calloc(1, sizeof(*g));
    struct sst_trigger_config trigger;
    int split[2], err;

    if (!g)
        return -ENOMEM;
    if (sst_array_split(array, split) > 1) {
        sst_log_error("a rig carries one camera, and cameras: split %s has several in each picture; leave it out, or "
                      "record the array with `sst capture array`",
                      array->split);
        free(g);
        return -EINVAL;
    }
    g->cancel = cancel;
    g->state = SST_GRAB_READY;
    pthread_mutex_init(&g->lock, NULL);
    sst_cond_init(&g->arrived);
    err = choose(g, which, array->fourcc);
    err = err ? err : open_grab(g, array);
    if (!err && array->source == SST_CONFIG_GPIO) {
        sst_capture_trigger_config(&trigger, array);
        err = sst_trigger_open(&g->trigger, &trigger, NULL, NULL);
    }
    if (!err) {
        err = -pthread_create(&g->thread, NULL, poll_camera, g);
        g->running = !err;
    }
    err = err ? err : wait_streaming(g);
    if (err) {
        sst_scan_grab_close(g);
        return err;
    }
    *camera = (struct sst_scan_camera){
        .arg = g, .expose = expose, .release = release, .serial = g->device.serial, .port = g->device.port
    };
    *out = g;
    return 0;
}

void sst_scan_grab_counters(const struct sst_scan_grab *grab, struct sst_grab_counters *out)
{
    struct sst_scan_grab *g = (struct sst_scan_grab *)grab;

    pthread_mutex_lock(&g->lock);
    *out = g->count;
    pthread_mutex_unlock(&g->lock);
}

void sst_scan_grab_close(struct sst_scan_grab *g)
{
    if (!g)
        return;
    pthread_mutex_lock(&g->lock);
    g->stop = true;
    g->wanted = false;
    pthread_mutex_unlock(&g->lock);
    if (g->running)
        pthread_join(g->thread, NULL);
    if (g->got)
        sst_grab_release(g->grab, g->got);
    sst_trigger_close(g->trigger);
    sst_grab_close(g->grab);
    pthread_cond_destroy(&g->arrived);
    pthread_mutex_destroy(&g->lock);
    free(g);
}
