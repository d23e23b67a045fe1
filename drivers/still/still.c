/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/still/still.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <time.h>

#include "base/clock.h"
#include "base/log.h"
#include "drivers/still/still_internal.h"

#define BUSY_MS     100 /* between two tries */
#define SILENT_MS   50  /* announcements of the camera come within this time */
#define MS          1000000LL
#define DOWNLOADS   2
#define LOW_PERCENT 20 /* of the battery: worth a warning */

bool still_cancelled(const struct sst_still *s)
{
    return s->cfg.cancel && atomic_load(s->cfg.cancel);
}

void still_sleep_ms(int ms)
{
    struct timespec left = { ms / 1000, ms % 1000 * 1000000L };

    while (nanosleep(&left, &left) && errno == EINTR)
        ;
}

/* --- release ------------------------------------------------------------------------------------------------------ */

/**
 * Release; a busy camera is asked again until card_ms. Files announced meanwhile are of an earlier release, and
 * cannot be told from files announced just before it accepts this one.
 */
static int release(struct sst_still *s, const char *what, int64_t *release_ns)
{
    const int64_t end_ns = sst_clock_now_ns() + s->cfg.card_ms * MS;
    bool waited = false;
    int err;

    for (;;) {
        *release_ns = sst_clock_now_ns();
        err = still_lib_release(s->lib);
        if (err != -EBUSY || still_cancelled(s))
            break;
        s->unsure_ns = INT64_MAX;
        if (!waited) {
            waited = true;
            s->count.busy++;
            sst_log_warning("still camera %s is busy and does not release; it is asked again for %d ms", s->serial,
                            s->cfg.card_ms);
        }
        if (sst_clock_now_ns() >= end_ns)
            break;
        err = still_drain(s, BUSY_MS, 0);
        if (err)
            return err;
    }
    if (err && still_cancelled(s))
        return -ECANCELED;
    if (err == -EBUSY) {
        sst_log_error("still camera %s stays busy for more than %d ms; wait for its card, close its menus, or raise "
                      "still: card_ms",
                      s->serial, s->cfg.card_ms);
        return err;
    }
    return err ? still_failed(s, err, what) : 0;
}

/** With mirror lock-up the first release only lifts the mirror; its vibration has to fade. */
static int expose(struct sst_still *s, int64_t *release_ns)
{
    const int64_t left_ns = s->unsure_ns - sst_clock_now_ns();
    int err =
        still_drain(s, SILENT_MS, left_ns <= s->cfg.quiet_ms * MS / 2 ? s->unsure_ns : 0); /* shorter than to watch */

    if (!err && s->cfg.mirror_ms > 0) {
        err = release(s, "lifting the mirror", release_ns);
        if (!err)
            still_sleep_ms(s->cfg.mirror_ms);
    }
    err = err ? err : release(s, "releasing", release_ns);
    s->count.exposures += !err;
    return err;
}

static int files_wanted(const struct sst_still *s)
{
    return s->cfg.files == SST_STILL_BOTH ? 2 : 1;
}

/* --- download ----------------------------------------------------------------------------------------------------- */

static bool is_jpeg(const char *name)
{
    const char *end = strrchr(name, '.');

    return end && (!strcasecmp(end, ".jpg") || !strcasecmp(end, ".jpeg"));
}

/** @return 0, -EBADMSG (damaged, logged) or an error of the library, logged */
static int download(struct sst_still *s, const struct still_path *path, struct sst_still_file *out)
{
    struct sst_still_file f = { .raw = !is_jpeg(path->name) };
    size_t announced = 0;
    int err;

    snprintf(f.name, sizeof(f.name), "%s", path->name);
    err = still_lib_size(s->lib, path, &announced);
    err = err ? err : still_lib_download(s->lib, path, &f.data, &f.bytes);
    if (err)
        return still_failed(s, err, path->name);
    if (announced && f.bytes != announced) {
        sst_log_warning("still camera %s: %s has %zu bytes, %zu arrived; it is downloaded again", s->serial, f.name,
                        announced, f.bytes);
        err = -EBADMSG;
    } else if (!f.raw && sst_still_check_jpeg(f.data, f.bytes, &f.width, &f.height)) {
        sst_log_warning("still camera %s: %s is no complete JPEG; it is downloaded again", s->serial, f.name);
        err = -EBADMSG;
    }
    if (err) {
        s->count.damaged++;
        free(f.data);
        return err;
    }
    *out = f;
    return 0;
}

/** A camera that was lost meanwhile is opened again: the file is on its card. */
static int fetch(struct sst_still *s, const struct still_path *path, struct sst_still_file *out)
{
    int err = -EIO;

    for (int i = 0; i < DOWNLOADS && err && !still_cancelled(s); i++) {
        err = still_reopen(s);
        if (err)
            return err;
        err = download(s, path, out);
        if (err == -ENOMEM)
            return err;
    }
    if (still_cancelled(s))
        return -ECANCELED;
    if (err == -EBADMSG)
        sst_log_error("still camera %s: %s is damaged on its card or by its cable; exchange them if it happens again",
                      s->serial, path->name);
    return err;
}

static void free_files(struct sst_still_shot *shot)
{
    for (int i = 0; i < shot->files; i++)
        free(shot->file[i].data);
    shot->files = 0;
}

/** @return 0, -EAGAIN (files that were downloaded before under other names are left out of s->path) or -errno, logged
 */
static int fetch_all(struct sst_still *s, struct sst_still_shot *shot)
{
    const int announced = s->paths;
    int err = 0;

    for (int i = 0; i < s->paths;) {
        struct sst_still_file f;
        const int at = is_jpeg(s->path[i].name) ? shot->files : 0;

        err = fetch(s, &s->path[i], &f);
        if (err)
            return err;
        if (still_seen(s, f.data, f.bytes)) {
            sst_log_warning("still camera %s: %s is a picture of an earlier release again; it belongs to no view",
                            s->serial, f.name);
            free(f.data);
            memmove(&s->path[i], &s->path[i + 1], (size_t)(--s->paths - i) * sizeof(s->path[i]));
            continue;
        }
        if (at == 0 && shot->files)
            shot->file[1] = shot->file[0];
        shot->file[at] = f;
        shot->files++;
        i++;
    }
    if (s->paths < announced) {
        free_files(shot);
        return -EAGAIN;
    }
    for (int i = 0; i < shot->files; i++)
        still_see(s, shot->file[i].data, shot->file[i].bytes);
    return 0;
}

/** Did the camera deliver what was asked for? */
static int check_files(const struct sst_still *s, const struct sst_still_shot *shot)
{
    unsigned kinds = 0;

    for (int i = 0; i < shot->files; i++)
        kinds |= shot->file[i].raw ? SST_STILL_RAW : SST_STILL_JPEG;
    if (kinds == (unsigned)s->cfg.files)
        return 0;
    sst_log_error("still camera %s delivers %s%s%s, but still: files asks for %s; set its format to that, by still: "
                  "format or on the camera",
                  s->serial, shot->file[0].name, shot->files > 1 ? " and " : "",
                  shot->files > 1 ? shot->file[1].name : "",
                  s->cfg.files == SST_STILL_JPEG  ? "jpeg"
                  : s->cfg.files == SST_STILL_RAW ? "raw"
                                                  : "raw+jpeg");
    return -EINVAL;
}

/* --- exposures ---------------------------------------------------------------------------------------------------- */

static int check_state(struct sst_still *s)
{
    int err = still_settings_status(s);

    if (err)
        return err;
    if (s->state.battery_percent >= 0 && s->state.battery_percent < s->cfg.battery_percent) {
        sst_log_error("the battery of still camera %s is low: %d %%, at least %d %% are needed; charge or exchange it, "
                      "then run the same command to resume",
                      s->serial, s->state.battery_percent, s->cfg.battery_percent);
        return -ENOMEDIUM;
    }
    if (s->state.battery_percent >= 0 && s->state.battery_percent < LOW_PERCENT && !s->low) {
        s->low = true;
        sst_log_warning("the battery of still camera %s is at %d %%; at less than %d %% the capture stops", s->serial,
                        s->state.battery_percent, s->cfg.battery_percent);
    }
    if (s->state.card_pictures == 0 || s->state.card_free_bytes == 0) {
        sst_log_error("the card of still camera %s is full; empty or exchange it, then run the same command to resume",
                      s->serial);
        return -ENOMEDIUM;
    }
    return 0;
}

/** Open if it was lost, and check that it is as it was set. */
static int ready(struct sst_still *s)
{
    int err = still_reopen(s);

    err = err ? err : still_settings_apply(s);
    return err ? err : check_state(s);
}

/** Release, and wait until all files are announced. */
static int shoot(struct sst_still *s, int64_t *release_ns)
{
    int err = expose(s, release_ns);

    err = err ? err : still_wait_files(s, files_wanted(s), *release_ns);
    s->unsure_ns = err ? sst_clock_now_ns() + s->cfg.quiet_ms * MS : 0;
    return err;
}

int sst_still_capture(struct sst_still *s, struct sst_still_shot *shot)
{
    struct sst_still_shot new = { .files = 0 };
    int err = ready(s);

    s->paths = 0;
    err = err ? err : shoot(s, &new.release_ns);
    err = err ? err : fetch_all(s, &new);
    while (err == -EAGAIN) {
        err = still_wait_files(s, files_wanted(s), new.release_ns);
        err = err ? err : fetch_all(s, &new);
    }
    err = err ? err : check_files(s, &new);
    if (err) {
        sst_still_release_files(s, &new);
        return err;
    }
    *shot = new;
    return 0;
}

void sst_still_release_files(struct sst_still *s, struct sst_still_shot *shot)
{
    free_files(shot);
    s->done_count = 0;
    for (int i = 0; i < s->paths && s->lib; i++) {
        const int err = s->cfg.keep ? -EEXIST : still_lib_delete(s->lib, &s->path[i]);

        if (!err) {
            s->done[s->done_count++] = s->path[i];
            continue;
        }
        if (!s->cfg.keep)
            sst_log_warning("still camera %s: %s stays on its card: %s", s->serial, s->path[i].name,
                            still_lib_said(s->lib));
        if (still_know(s, &s->path[i]))
            s->unsure_ns = INT64_MAX;
    }
    s->paths = 0;
}

/** One exposure in automatic mode focuses; it is discarded, and the lens stays as it is. */
static int lock_focus(struct sst_still *s)
{
    struct sst_still_shot none = { .files = 0 };
    const bool keep = s->cfg.keep;
    int64_t release_ns;
    int err = still_settings_focus(s, true);

    err = err ? err : check_state(s);
    err = err ? err : shoot(s, &release_ns);
    s->cfg.keep = false;
    sst_still_release_files(s, &none);
    s->cfg.keep = keep;
    return err;
}

/* --- open and close ----------------------------------------------------------------------------------------------- */

void sst_still_config_defaults(struct sst_still_config *cfg)
{
    *cfg = (struct sst_still_config){
        .files = SST_STILL_JPEG,
        .card_ms = 20000,
        .response_ms = 10000,
        .reopen_ms = 20000,
        .battery_percent = 5,
    };
}

static void copy_texts(struct sst_still *s, const struct sst_still_config *cfg)
{
    const char *const texts[STILL_SETTINGS] = { cfg->exposure, cfg->aperture, cfg->iso, cfg->format };

    s->cfg = *cfg;
    if (!s->cfg.quiet_ms)
        s->cfg.quiet_ms = s->cfg.card_ms;
    for (int i = 0; i < STILL_SETTINGS; i++)
        snprintf(s->wanted[i], sizeof(s->wanted[i]), "%s", texts[i] ? texts[i] : "");
}

int sst_still_open(struct sst_still **out, const struct sst_still_config *cfg)
{
    struct sst_still *s = calloc(1, sizeof(*s));
    int err;

    if (!s)
        return -ENOMEM;
    copy_texts(s, cfg);
    err = still_find(s);
    s->unsure_ns = sst_clock_now_ns() + s->cfg.quiet_ms * MS;
    err = err ? err : still_settings_apply(s);
    if (!err && cfg->focus == SST_STILL_FOCUS_LOCKED && !cfg->focused) {
        err = lock_focus(s);
        err = err ? err : still_settings_apply(s);
    }
    err = err ? err : still_settings_status(s);
    if (err) {
        sst_still_close(s);
        return err;
    }
    s->cfg.camera = NULL; /* the caller's */
    *out = s;
    return 0;
}

const char *sst_still_serial(const struct sst_still *s)
{
    return s->serial;
}

const char *sst_still_port(const struct sst_still *s)
{
    return s->port;
}

const char *sst_still_settings(const struct sst_still *s)
{
    return s->settings;
}

void sst_still_state(const struct sst_still *s, struct sst_still_state *out)
{
    *out = s->state;
}

void sst_still_counters(const struct sst_still *s, struct sst_still_counters *out)
{
    *out = s->count;
}

void sst_still_close(struct sst_still *s)
{
    if (!s)
        return;
    still_lib_close(s->lib);
    free(s->known);
    free(s);
}
