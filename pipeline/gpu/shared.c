#include "pipeline/gpu/shared.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/gpu/backoff.h"

struct sst_gpu_shared {
    char name[SST_GPU_NAME]; /* as asked for */
    struct sst_gpu_config cfg;
    pthread_mutex_t lock;
    /* under lock */
    struct sst_gpu *gpu; /* NULL: it failed, or was not opened again yet */
    struct sst_gpu_info info;
    int64_t opening; /* counts them */
    struct sst_gpu_backoff backoff;
    struct sst_gpu_user *users;
};

static int open_locked(struct sst_gpu_shared *s)
{
    const int err = sst_gpu_open(&s->gpu, s->name, &s->cfg);

    if (err) {
        s->gpu = NULL;
        return err;
    }
    s->opening++;
    s->info = *sst_gpu_get_info(s->gpu);
    return 0;
}

static void close_locked(struct sst_gpu_shared *s)
{
    if (!s->gpu)
        return;
    for (struct sst_gpu_user *u = s->users; u; u = u->next)
        u->drop(u->arg);
    sst_gpu_close(s->gpu);
    s->gpu = NULL;
}

/* Shaders are prepared once per opening. */
static int prepare_locked(struct sst_gpu_shared *s, struct sst_gpu_user *user)
{
    int err = 0;

    if (user->opening == s->opening)
        return 0;
    for (size_t i = 0; i < user->count && !err; i++)
        err = sst_gpu_prepare(s->gpu, user->shaders[i]);
    if (err)
        sst_log_error("the device `%s` cannot %s: %s; choose another --device", s->name, user->work,
                      sst_gpu_error(err));
    else
        user->opening = s->opening;
    return err;
}

int sst_gpu_shared_create(struct sst_gpu_shared **out, const char *name, uint64_t memory_bytes)
{
    struct sst_gpu_shared *s;
    int err;

    *out = NULL;
    if (!strcmp(name, "cpu"))
        return 0;
    s = calloc(1, sizeof(*s));
    if (!s) {
        sst_log_error("not enough memory for a device");
        return -ENOMEM;
    }
    pthread_mutex_init(&s->lock, NULL);
    s->cfg.memory_bytes = memory_bytes;
    snprintf(s->name, sizeof(s->name), "%s", name);
    err = open_locked(s);
    if (err) {
        sst_gpu_shared_destroy(s);
        return err == -ENOENT && !strcmp(name, "auto") ? 0 : err;
    }
    *out = s;
    return 0;
}

void sst_gpu_shared_destroy(struct sst_gpu_shared *s)
{
    if (!s)
        return;
    close_locked(s);
    pthread_mutex_destroy(&s->lock);
    free(s);
}

int sst_gpu_shared_join(struct sst_gpu_shared *s, struct sst_gpu_user *user)
{
    int err = 0;

    sst_gpu_shared_lock(s);
    user->opening = 0;
    if (!s->gpu)
        err = open_locked(s);
    err = err ? err : prepare_locked(s, user);
    if (!err) {
        user->next = s->users;
        s->users = user;
    }
    sst_gpu_shared_unlock(s);
    return err;
}

void sst_gpu_shared_leave(struct sst_gpu_shared *s, struct sst_gpu_user *user)
{
    sst_gpu_shared_lock(s);
    for (struct sst_gpu_user **at = &s->users; *at; at = &(*at)->next) {
        if (*at != user)
            continue;
        *at = user->next;
        if (s->gpu)
            user->drop(user->arg);
        break;
    }
    sst_gpu_shared_unlock(s);
}

void sst_gpu_shared_lock(struct sst_gpu_shared *s)
{
    pthread_mutex_lock(&s->lock);
}

void sst_gpu_shared_unlock(struct sst_gpu_shared *s)
{
    pthread_mutex_unlock(&s->lock);
}

const char *sst_gpu_shared_name(const struct sst_gpu_shared *s)
{
    return s->name;
}

const struct sst_gpu_info *sst_gpu_shared_info(const struct sst_gpu_shared *s)
{
    return &s->info;
}

struct sst_gpu *sst_gpu_shared_take(struct sst_gpu_shared *s, struct sst_gpu_user *user, int *err)
{
    *err = 0;
    if (sst_gpu_backoff_skips(&s->backoff))
        return NULL;
    if (!s->gpu)
        *err = open_locked(s);
    if (!*err)
        *err = prepare_locked(s, user);
    return *err ? NULL : s->gpu;
}

void sst_gpu_shared_succeed(struct sst_gpu_shared *s)
{
    sst_gpu_backoff_succeed(&s->backoff);
}

int sst_gpu_shared_fail(struct sst_gpu_shared *s)
{
    close_locked(s);
    return sst_gpu_backoff_fail(&s->backoff);
}

bool sst_gpu_shared_make_room(struct sst_gpu_shared *s, const struct sst_gpu_user *user)
{
    const uint64_t before = sst_gpu_free_bytes(s->gpu);

    for (struct sst_gpu_user *u = s->users; u; u = u->next) {
        if (u != user)
            u->drop(u->arg);
    }
    return sst_gpu_free_bytes(s->gpu) > before;
}

struct sst_gpu *sst_gpu_shared_device(struct sst_gpu_shared *s)
{
    return s->gpu;
}
