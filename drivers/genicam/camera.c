/* One camera on a thread of its own, since every command to it may block: search, open, trigger, watch, open again. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "drivers/genicam/genicam_internal.h"

#define MS            INT64_C(1000000)
#define RETRY_NS      (500 * MS) /* to open again; doubles up to the next one */
#define RETRY_MAX_NS  (5000 * MS)
#define READ_NS       (1000 * MS) /* between readings of statistics and clock */
#define WAKE_UP_NS    (1500 * MS) /* from a start to its first frame, on top of the usual patience */

/* --- state -------------------------------------------------------------------------------------------------------- */

static void wake_poll(struct genicam_camera *cam)
{
    (void)eventfd_write(cam->array->wake_fd, 1);
}

static void log_state(const struct genicam_camera *cam, enum sst_grab_state state, const char *why)
{
    if (state == SST_GRAB_REFUSED)
        sst_log_error("%s: %s", cam->name, why);
    else if (state == SST_GRAB_ABSENT || state == SST_GRAB_RECOVERING ||
             (state == SST_GRAB_STREAMING && cam->down_ns))
        sst_log_warning("%s: %s", cam->name, why);
    else
        sst_log_info("%s: %s", cam->name, why);
}

static void set_state(struct genicam_camera *cam, enum sst_grab_state state, const char *why)
{
    enum sst_grab_state before;
    bool changed;

    pthread_mutex_lock(&cam->lock);
    before = cam->state;
    changed = before != state || strcmp(cam->why, why) != 0;
    if (changed) {
        cam->changed = true;
        cam->state = state;
        snprintf(cam->why, sizeof(cam->why), "%s", why);
    }
    pthread_mutex_unlock(&cam->lock);
    if (!changed)
        return;
    if (before == SST_GRAB_STREAMING)
        cam->down_ns = sst_clock_now_ns();
    log_state(cam, state, why);
    wake_poll(cam);
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static void on_lost(void *arg)
{
    struct genicam_camera *cam = arg;

    pthread_mutex_lock(&cam->lock);
    cam->lost = true;
    pthread_cond_signal(&cam->wake);
    pthread_mutex_unlock(&cam->lock);
}

static void identify(struct genicam_camera *cam, const struct sst_genicam_device *d)
{
    struct sst_grab_device *device = &cam->device;

    pthread_mutex_lock(&cam->lock);
    snprintf(device->node, sizeof(device->node), "%s", d->address);
    snprintf(device->name, sizeof(device->name), "%.31s %.31s", d->vendor, d->model);
    snprintf(device->driver, sizeof(device->driver), "%s", d->protocol);
    snprintf(device->serial, sizeof(device->serial), "%s", d->serial);
    snprintf(device->port, sizeof(device->port), "%s", d->address);
    pthread_mutex_unlock(&cam->lock);
}

static void open_camera(struct genicam_camera *cam)
{
    const struct genicam_lib_query query = { &cam->binding, &cam->array->cfg, cam->index };
    char why[GENICAM_WHY_MAX] = "", note[GENICAM_WHY_MAX] = "";
    struct sst_genicam_device device = { 0 };
    const int err = genicam_lib_open(&cam->lib, &query, &device, why, note);

    cam->retry_ns = sst_clock_now_ns() + cam->retry_pause_ns;
    cam->retry_pause_ns = 2 * cam->retry_pause_ns > RETRY_MAX_NS ? RETRY_MAX_NS : 2 * cam->retry_pause_ns;
    if (err == -ENODEV || err == -EIO) {
        set_state(cam, SST_GRAB_ABSENT,
                  "does not answer; it starts when it does: check its cable, power and address (sst cameras)");
        return;
    }
    if (err) {
        set_state(cam, SST_GRAB_REFUSED, *why ? why : strerror(-err));
        return;
    }
    identify(cam, &device);
    if (strcmp(note, cam->note) != 0) {
        memcpy(cam->note, note, sizeof(note));
        if (*note)
            sst_log_warning("%s: %s", cam->name, note);
    }
    if (cam->down_ns) {
        pthread_mutex_lock(&cam->lock);
        cam->counters.found_devices++;
        pthread_mutex_unlock(&cam->lock);
    }
    set_state(cam, SST_GRAB_READY, "ready");
}

static void close_camera(struct genicam_camera *cam, bool silent)
{
    pthread_mutex_lock(&cam->lock);
    cam->running = false;
    cam->lost = false;
    cam->fires = 0;
    cam->owed_ns = 0;
    cam->missing_before = cam->counters.packets_missing;
    cam->resent_before = cam->counters.packets_resent;
    cam->ptp = (struct sst_genicam_ptp){ 0 };
    pthread_mutex_unlock(&cam->lock);
    genicam_lib_close(cam->lib, silent);
    cam->lib = NULL;
}

static void start_camera(struct genicam_camera *cam)
{
    const struct genicam_lib_events events = { cam, genicam_receive, on_lost };
    char why[GENICAM_WHY_MAX] = "", text[96] = "streaming";
    int err;

    pthread_mutex_lock(&cam->lock);
    cam->ids = (struct genicam_ids){ 0 };
    cam->clock = (struct genicam_clock){ 0 };
    cam->hashed = false;
    cam->settle_ns = 0;
    cam->heard_ns = sst_clock_now_ns() + WAKE_UP_NS;
    cam->running = true;
    pthread_mutex_unlock(&cam->lock);
    err = genicam_lib_start(cam->lib, &events, why);
    if (err) {
        close_camera(cam, err == -EIO);
        set_state(cam, err == -EIO ? SST_GRAB_ABSENT : SST_GRAB_REFUSED, *why ? why : strerror(-err));
        return;
    }
    cam->read_ns = 0;
    cam->retry_pause_ns = RETRY_NS;
    if (cam->down_ns)
        snprintf(text, sizeof(text), "streaming again after %.1f s",
                 (double)(sst_clock_now_ns() - cam->down_ns) * 1e-9);
    set_state(cam, SST_GRAB_STREAMING, text);
    cam->down_ns = 0;
}

/* Close it; it is opened again at once. */
static void fail(struct genicam_camera *cam, const char *why, bool device)
{
    set_state(cam, SST_GRAB_RECOVERING, why);
    pthread_mutex_lock(&cam->lock);
    cam->counters.lost_devices += device;
    cam->counters.rung[SST_GRAB_REOPEN]++;
    pthread_mutex_unlock(&cam->lock);
    close_camera(cam, true);
    cam->retry_ns = 0;
    cam->retry_pause_ns = RETRY_NS;
}

/* --- watching ----------------------------------------------------------------------------------------------------- */

static int64_t patience_ns(const struct genicam_camera *cam)
{
    const struct sst_genicam_config *cfg = &cam->array->cfg;
    const int64_t stall_ns = cfg->stall_ms * MS;
    const int64_t three_ns = cfg->trigger == SST_GENICAM_FREE && cfg->rate_hz > 0 ? (int64_t)(3e9 / cfg->rate_hz) : 0;

    return stall_ns > three_ns ? stall_ns : three_ns;
}

/* Time at which it counts as silent; 0: nothing is due. */
static int64_t silent_at_locked(const struct genicam_camera *cam)
{
    if (!cam->running)
        return 0;
    if (cam->array->cfg.trigger != SST_GENICAM_FREE)
        return cam->owed_ns ? (cam->owed_ns > cam->heard_ns ? cam->owed_ns : cam->heard_ns) + patience_ns(cam) : 0;
    return cam->heard_ns + patience_ns(cam);
}

static int64_t due_locked(const struct genicam_camera *cam)
{
    const int64_t silent_ns = silent_at_locked(cam);
    int64_t due_ns = cam->lib ? cam->read_ns : cam->retry_ns;

    if (cam->lib && !cam->running && !cam->start)
        return INT64_MAX;
    if (silent_ns && silent_ns < due_ns)
        due_ns = silent_ns;
    return due_ns;
}

static void read_camera(struct genicam_camera *cam, int64_t now_ns)
{
    struct genicam_reading r = { 0 };

    cam->read_ns = now_ns + READ_NS;
    if (genicam_lib_read(cam->lib, &r))
        return; /* silence or a lost control follows, if it is gone */
    pthread_mutex_lock(&cam->lock);
    cam->counters.packets_missing = cam->missing_before + r.missing_packets;
    cam->counters.packets_resent = cam->resent_before + r.resent_packets;
    cam->ptp = r.ptp;
    if (r.latched)
        genicam_clock_add(&cam->clock, r.stamp_ns, r.seen_ns);
    pthread_mutex_unlock(&cam->lock);
}

static void watch(struct genicam_camera *cam)
{
    const int64_t now_ns = sst_clock_now_ns();
    int64_t silent_ns, heard_ns;
    bool lost, running, start;
    char why[96];

    pthread_mutex_lock(&cam->lock);
    silent_ns = silent_at_locked(cam);
    heard_ns = cam->heard_ns;
    lost = cam->lost;
    running = cam->running;
    start = cam->start;
    pthread_mutex_unlock(&cam->lock);
    if (lost) {
        fail(cam, "does not answer any more, its control is lost: check its cable and power", true);
    } else if (silent_ns && now_ns >= silent_ns) {
        snprintf(why, sizeof(why), "no frame for %.1f s", (double)(now_ns - heard_ns) * 1e-9);
        fail(cam, why, false);
    } else if (!cam->lib && now_ns >= cam->retry_ns) {
        open_camera(cam);
    } else if (cam->lib && start && !running) {
        start_camera(cam);
    } else if (cam->lib && running && now_ns >= cam->read_ns) {
        read_camera(cam, now_ns);
    }
}

/* @return false: it ends */
static bool wait_for_work(struct genicam_camera *cam, bool *fire)
{
    bool quit;

    pthread_mutex_lock(&cam->lock);
    while (!cam->quit && !cam->fires && !cam->lost && !(cam->lib && cam->start && !cam->running) &&
           sst_clock_now_ns() < due_locked(cam))
        (void)sst_cond_wait_until(&cam->wake, &cam->lock, due_locked(cam));
    quit = cam->quit;
    *fire = cam->fires > 0;
    cam->fires -= *fire;
    pthread_mutex_unlock(&cam->lock);
    return !quit;
}

static void *run(void *arg)
{
    struct genicam_camera *cam = arg;
    bool fire;

    sst_thread_name("sst-genicam");
    open_camera(cam);
    pthread_mutex_lock(&cam->lock);
    cam->tried = true;
    pthread_mutex_unlock(&cam->lock);
    while (wait_for_work(cam, &fire)) {
        if (fire && cam->lib && genicam_lib_trigger(cam->lib)) {
            /* its frame is missing from the set; silence or a lost control follows, if it is gone */
        }
        if (!fire)
            watch(cam);
    }
    close_camera(cam, false);
    return NULL;
}

/* --- for the array ------------------------------------------------------------------------------------------------ */

void genicam_camera_fire(struct genicam_camera *cam, int64_t t_ns, bool command)
{
    pthread_mutex_lock(&cam->lock);
    if (cam->running) {
        if (!cam->owed_ns && cam->heard_ns < t_ns)
            cam->owed_ns = t_ns;
        /* A command that waits longer would expose in the time of the next trigger. */
        cam->fires = command ? 1 : 0;
        if (command)
            pthread_cond_signal(&cam->wake);
    }
    pthread_mutex_unlock(&cam->lock);
}

int genicam_camera_create(struct genicam_camera *cam, struct sst_genicam *array, int index,
                          const struct sst_genicam_binding *binding)
{
    int err;

    cam->array = array;
    cam->index = index;
    cam->binding = *binding;
    cam->retry_pause_ns = RETRY_NS;
    snprintf(cam->name, sizeof(cam->name), "camera %s", *binding->id ? binding->id : binding->address);
    snprintf(cam->device.serial, sizeof(cam->device.serial), "%s", binding->id);
    snprintf(cam->device.port, sizeof(cam->device.port), "%s", binding->address);
    cam->shown = cam->device;
    pthread_mutex_init(&cam->lock, NULL);
    sst_cond_init(&cam->wake);
    err = -pthread_create(&cam->thread, NULL, run, cam);
    cam->threaded = !err;
    if (err)
        sst_log_error("%s: no thread: %s", cam->name, strerror(-err));
    return err;
}

void genicam_camera_destroy(struct genicam_camera *cam)
{
    if (!cam->array)
        return;
    if (cam->threaded)
        pthread_join(cam->thread, NULL);
    while (cam->first) { /* came after the last poll */
        struct genicam_slot *slot = cam->first;

        cam->first = slot->next;
        genicam_lib_release(slot);
    }
    pthread_cond_destroy(&cam->wake);
    pthread_mutex_destroy(&cam->lock);
}
