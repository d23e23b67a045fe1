/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/step/runner.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/step/step_internal.h"

struct sst_runner {
    char name[SST_GPU_NAME]; /* as asked for */
    struct sst_gpu_config cfg;
    bool live;
    pthread_mutex_t lock;
    /* under lock */
    struct sst_gpu *gpu; /* NULL: it failed, or was not opened again yet */
    struct sst_gpu_info info;
    int64_t opening; /* counts them */
    struct runner_backoff backoff;
    struct sst_runner_user *users;
    struct runner_memory memory;
    struct runner_opener *opener; /* live: at work on opening it again */
    int err;                      /* live: of the first opening */
    char why[SST_LOG_MAX];        /* live: message of the last error */
};

static void note_opening(struct sst_runner *s)
{
    s->opening++;
    s->info = *sst_gpu_get_info(s->gpu);
}

static int open_locked(struct sst_runner *s)
{
    const int err = sst_gpu_open(&s->gpu, s->name, &s->cfg);

    if (err) {
        s->gpu = NULL;
        return err;
    }
    note_opening(s);
    return 0;
}

/* Open a live device again beside the work. @return 0, -EINPROGRESS, or an error */
static int open_beside_locked(struct sst_runner *s, struct sst_runner_user *user)
{
    const struct runner_opening what = { .name = s->name,
                                         .cfg = s->cfg,
                                         .steps = user->steps,
                                         .steps_needed = user->step_count,
                                         .step_count = user->step_count + user->steps_tested,
                                         .work = user->work };
    const int err = runner_open_beside(&s->opener, &what, &s->gpu, s->why);

    if (err)
        return err;
    note_opening(s);
    user->opening = s->opening;
    return 0;
}

void runner_memory_drop(struct runner_memory *m, struct sst_gpu *g)
{
    for (int i = 0; i < SST_PLANES; i++)
        sst_step_plane_drop(&m->planes, g, (enum sst_step_plane)i);
    for (int i = 0; i < SST_RUN_SCRATCH; i++) {
        sst_gpu_buffer_destroy(g, m->scratch[i].buffer);
        m->scratch[i] = (struct runner_scratch){ 0 };
    }
    sst_mem_kept_fini(&m->words);
}

static void drop(const struct sst_runner_user *user)
{
    if (user->drop)
        user->drop(user->arg);
}

static void close_locked(struct sst_runner *s)
{
    if (!s->gpu)
        return;
    for (struct sst_runner_user *u = s->users; u; u = u->next)
        drop(u);
    runner_memory_drop(&s->memory, s->gpu);
    sst_gpu_close(s->gpu);
    s->gpu = NULL;
}

/* Steps are compared once per opening. A device that is lost in the comparison of a variant is opened again without. */
static int check_steps_locked(struct sst_runner *s, struct sst_runner_user *user)
{
    const int deadly = sst_gpu_deadly();
    int err = 0;

    for (size_t i = 0; i < user->step_count && !err; i++)
        err = sst_step_check(user, s->gpu, &user->steps[i]);
    if (sst_gpu_deadly() == deadly || s->live)
        return err;
    close_locked(s);
    err = open_locked(s);
    return err ? err : check_steps_locked(s, user);
}

static int prepare_locked(struct sst_runner *s, struct sst_runner_user *user)
{
    int err;

    if (user->opening == s->opening)
        return 0;
    s->why[0] = 0;
    err = check_steps_locked(s, user);
    if (err && s->live)
        snprintf(s->why, sizeof(s->why), "the device `%.200s` cannot %s: %s", s->name, user->work, sst_gpu_error(err));
    else if (err == -ENOTSUP && !strcmp(s->name, "auto")) {
        sst_log_warning("%s cannot %s: %s; it is left to the CPU", s->info.name, user->work, sst_gpu_error(err));
        user->given_up = true;
        err = 0;
    } else if (err)
        sst_log_error("the device `%s` cannot %s: %s; choose another --device", s->name, user->work,
                      sst_gpu_error(err));
    else
        user->opening = s->opening;
    return err;
}

static struct sst_runner *create(const char *name, const struct sst_gpu_config *cfg)
{
    struct sst_runner *s = calloc(1, sizeof(*s));

    if (!s) {
        sst_log_error("not enough memory for a device");
        return NULL;
    }
    pthread_mutex_init(&s->lock, NULL);
    s->cfg = *cfg;
    snprintf(s->name, sizeof(s->name), "%s", name);
    return s;
}

/* @param live  errors are kept */
static int create_open(struct sst_runner **out, const char *name, const struct sst_gpu_config *cfg, bool live)
{
    struct sst_runner *s;
    char *before;
    int err;

    *out = NULL;
    if (!strcmp(name, "cpu"))
        return 0;
    s = create(name, cfg);
    if (!s)
        return -ENOMEM;
    s->live = live;
    before = live ? sst_log_hold_errors(s->why) : NULL;
    err = open_locked(s);
    if (live)
        sst_log_hold_errors(before);
    s->err = live ? err : 0;
    if (err && (!live || (err == -ENOENT && !strcmp(name, "auto")))) {
        sst_runner_destroy(s);
        return err == -ENOENT && !strcmp(name, "auto") ? 0 : err;
    }
    *out = s;
    return 0;
}

int sst_runner_create_live(struct sst_runner **out, const char *name, uint64_t memory_bytes, int percent)
{
    const struct sst_gpu_config cfg = { .memory_bytes = memory_bytes, .memory_percent = percent, .prompt = true };

    return create_open(out, name, &cfg, true);
}

int sst_runner_create(struct sst_runner **out, const char *name, uint64_t memory_bytes)
{
    return create_open(out, name, &(struct sst_gpu_config){ .memory_bytes = memory_bytes }, false);
}

int sst_runner_create_to_test(struct sst_runner **out, const char *name)
{
    return create_open(out, name, &(struct sst_gpu_config){ .test_again = true }, false);
}

void sst_runner_destroy(struct sst_runner *s)
{
    if (!s)
        return;
    runner_opener_destroy(s->opener);
    close_locked(s);
    pthread_mutex_destroy(&s->lock);
    free(s);
}

int sst_runner_join(struct sst_runner *s, struct sst_runner_user *user)
{
    int err = s->err;

    sst_runner_lock(s);
    user->opening = 0;
    user->runner = s;
    if (!s->gpu && !s->live)
        err = open_locked(s);
    err = err ? err : prepare_locked(s, user);
    if (!err || s->live) {
        user->next = s->users;
        s->users = user;
        if (err)
            snprintf(user->report.name, sizeof(user->report.name), "%s", s->name);
        else
            runner_note(user);
    }
    sst_runner_unlock(s);
    return err;
}

void sst_runner_leave(struct sst_runner *s, struct sst_runner_user *user)
{
    sst_runner_lock(s);
    for (struct sst_runner_user **at = &s->users; *at; at = &(*at)->next) {
        if (*at != user)
            continue;
        *at = user->next;
        if (s->gpu)
            drop(user);
        break;
    }
    sst_runner_unlock(s);
    if (user->owns_runner)
        sst_runner_destroy(s);
}

void sst_runner_lock(struct sst_runner *s)
{
    pthread_mutex_lock(&s->lock);
}

void sst_runner_unlock(struct sst_runner *s)
{
    pthread_mutex_unlock(&s->lock);
}

const char *sst_runner_name(const struct sst_runner *s)
{
    return s->name;
}

const struct sst_gpu_info *sst_runner_info(const struct sst_runner *s)
{
    return &s->info;
}

struct sst_gpu *sst_runner_take(struct sst_runner *s, struct sst_runner_user *user, int *err)
{
    *err = 0;
    s->memory.planes.turn++;
    if (user->given_up || runner_backoff_skips(&s->backoff))
        return NULL;
    if (!s->gpu)
        *err = s->live ? open_beside_locked(s, user) : open_locked(s);
    if (!*err)
        *err = prepare_locked(s, user);
    return *err || user->given_up ? NULL : s->gpu;
}

const char *sst_runner_why(const struct sst_runner *s)
{
    return s->why;
}

void sst_runner_succeed(struct sst_runner_user *user, const char *phrase)
{
    if (user->report.failing && user->runner->live)
        sst_log_info("%s: %s on the device again", user->report.name, phrase);
    user->report.failing = false;
    runner_backoff_succeed(&user->runner->backoff);
}

int sst_runner_fail(struct sst_runner *s)
{
    close_locked(s);
    return runner_backoff_fail(&s->backoff);
}

void sst_runner_report_failure(struct sst_runner_user *user, const char *phrase, int err, const char *why)
{
    struct sst_step_report *r = &user->report;
    const bool live = user->runner->live;
    const int skipped = sst_runner_fail(user->runner);

    why = *why ? why : sst_gpu_error(err);
    user->given_up = live && err == -ENOTSUP;
    if (!live)
        sst_log_warning("%s: %s; %s on the CPU, and the device is opened again after %d more", r->name, why, phrase,
                        skipped);
    else if (!r->failing)
        sst_log_warning("%s: %s; %s on the CPU%s", r->name, why, phrase,
                        user->given_up ? "" : ", and the device is tried again now and then");
    snprintf(r->failure, sizeof(r->failure), "%s", why);
    snprintf(r->why, sizeof(r->why), "%s", sst_gpu_error(err));
    r->failing = true;
    r->failures++;
}

bool sst_runner_is_live(const struct sst_runner *s)
{
    return s->live;
}

bool sst_runner_make_room(struct sst_runner *s, const struct sst_runner_user *user)
{
    const uint64_t before = sst_gpu_free_bytes(s->gpu);

    for (struct sst_runner_user *u = s->users; u; u = u->next) {
        if (u != user)
            drop(u);
    }
    runner_drop_scratch(&s->memory, s->gpu);
    sst_step_planes_trim(&s->memory.planes, s->gpu, -1);
    return sst_gpu_free_bytes(s->gpu) > before;
}

struct sst_step_planes *sst_runner_planes(struct sst_runner *s)
{
    return &s->memory.planes;
}

struct runner_memory *runner_memory_of(struct sst_runner *s)
{
    return &s->memory;
}

void runner_note(struct sst_runner_user *user)
{
    const struct sst_gpu_info *info = sst_runner_info(user->runner);

    snprintf(user->report.name, sizeof(user->report.name), "%s", info->name);
    snprintf(user->report.driver, sizeof(user->report.driver), "%s", info->driver);
}

struct sst_gpu *sst_runner_device(struct sst_runner *s)
{
    return s->gpu;
}
