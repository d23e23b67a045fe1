/* Picture of the main view: one at a time is fetched, all clients of half a second share it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec_formats.h"
#include "publishers/onvif/onvif_internal.h"

#define SHARED_NS INT64_C(500000000)
#define TRY_NS    INT64_C(5000000000) /* between tries for the size */

static struct {
    struct sst_server *server; /* fixed after init */
    pthread_mutex_t turn;      /* held while a picture is fetched, which may take seconds */
    pthread_mutex_t lock;
    pthread_cond_t wanted;
    /* under lock */
    uint8_t *data;
    size_t bytes;
    int width, height; /* 0: not known */
    bool connected;
    int64_t at_ns;
} picture = { .turn = PTHREAD_MUTEX_INITIALIZER, .lock = PTHREAD_MUTEX_INITIALIZER };

void picture_init(struct sst_server *server)
{
    picture.server = server;
    sst_cond_init(&picture.wanted);
}

static bool go_on(void *arg SST_UNUSED)
{
    return !atomic_load(&picture.server->stop);
}

static void store(uint8_t *data, size_t bytes)
{
    int width, height;
    const int err = sst_jpeg_size(&width, &height, data, bytes, "picture");

    pthread_mutex_lock(&picture.lock);
    if (!err) {
        picture.width = width;
        picture.height = height;
    }
    free(picture.data);
    picture.data = data;
    picture.bytes = bytes;
    picture.at_ns = sst_clock_now_ns();
    pthread_mutex_unlock(&picture.lock);
}

/* With the turn. */
static int fetch(void)
{
    char held[SST_LOG_MAX] = "", *before = sst_log_hold_errors(held);
    struct sst_client *client = NULL;
    uint8_t *data = NULL;
    size_t bytes = 0;
    int err = sst_client_open(&client, &picture.server->publisher.service);

    if (!err) {
        sst_client_set_continue(client, go_on, NULL);
        err = sst_client_bytes(client, "/snapshot", &data, &bytes);
    }
    sst_client_close(client);
    if (!err)
        store(data, bytes);
    sst_log_hold_errors(before);
    return err;
}

/* @return false: it is too old */
static bool copy_newest(uint8_t **data, size_t *bytes)
{
    bool fresh;

    pthread_mutex_lock(&picture.lock);
    fresh = picture.data && sst_clock_now_ns() - picture.at_ns < SHARED_NS;
    *data = fresh ? malloc(picture.bytes) : NULL;
    if (*data)
        memcpy(*data, picture.data, picture.bytes);
    *bytes = picture.bytes;
    pthread_mutex_unlock(&picture.lock);
    return fresh;
}

int picture_get(uint8_t **data, size_t *bytes)
{
    int err = 0;

    pthread_mutex_lock(&picture.turn);
    if (!copy_newest(data, bytes)) {
        err = fetch();
        if (!err && !copy_newest(data, bytes))
            err = -ETIMEDOUT;
    }
    pthread_mutex_unlock(&picture.turn);
    return err ? err : *data ? 0 : -ENOMEM;
}

void picture_size(int *width, int *height, size_t *bytes)
{
    const struct sst_array_config *a = &picture.server->config.array;

    pthread_mutex_lock(&picture.lock);
    *width = picture.width ? picture.width : a->width;
    *height = picture.width ? picture.height : a->height;
    *bytes = picture.bytes ? picture.bytes : (size_t)*width * *height / 5; /* of JPEG, about */
    pthread_mutex_unlock(&picture.lock);
}

void picture_connected(bool connected)
{
    pthread_mutex_lock(&picture.lock);
    picture.connected = connected;
    picture.width = 0;
    pthread_cond_signal(&picture.wanted);
    pthread_mutex_unlock(&picture.lock);
}

void *picture_run(void *arg)
{
    const struct sst_server *s = arg;
    int64_t next_ns = 0;

    sst_thread_name("onvif-picture");
    while (!atomic_load(&s->stop)) {
        const int64_t now_ns = sst_clock_now_ns();
        bool wanted;

        pthread_mutex_lock(&picture.lock);
        wanted = picture.connected && !picture.width;
        if (!wanted || now_ns < next_ns) /* the stop is noticed within a second */
            (void)sst_cond_wait_until(&picture.wanted, &picture.lock, now_ns + INT64_C(1000000000));
        pthread_mutex_unlock(&picture.lock);
        if (!wanted || now_ns < next_ns)
            continue;
        pthread_mutex_lock(&picture.turn);
        (void)fetch();
        pthread_mutex_unlock(&picture.turn);
        next_ns = sst_clock_now_ns() + TRY_NS;
    }
    return NULL;
}
