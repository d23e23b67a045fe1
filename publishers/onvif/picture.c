/* Picture of the main view: one at a time is fetched, all clients of half a second share it. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/image/codec_formats.h"
#include "publishers/onvif/onvif_internal.h"

#define SHARED_NS INT64_C(500000000)
#define TRY_NS    INT64_C(5000000000) /* between tries for the size alone */

static struct {
    struct sst_server *server; /* fixed after init */
    pthread_mutex_t lock;
    /* under lock */
    uint8_t *data;
    size_t bytes;
    int width, height; /* 0: not known */
    int64_t at_ns, tried_ns;
} picture = { .lock = PTHREAD_MUTEX_INITIALIZER };

void picture_init(struct sst_server *server)
{
    picture.server = server;
}

static bool go_on(void *arg SST_UNUSED)
{
    return !atomic_load(&picture.server->stop);
}

static int fetch_locked(void)
{
    char held[SST_LOG_MAX] = "", *before = sst_log_hold_errors(held);
    struct sst_client *client = NULL;
    uint8_t *data = NULL;
    size_t bytes = 0;
    int err = sst_client_open(&client, &picture.server->publisher.service), width, height;

    picture.tried_ns = sst_clock_now_ns();
    if (!err) {
        sst_client_set_continue(client, go_on, NULL);
        err = sst_client_bytes(client, "/snapshot", &data, &bytes);
    }
    sst_client_close(client);
    if (!err && !sst_jpeg_size(&width, &height, data, bytes, "picture")) {
        picture.width = width;
        picture.height = height;
    }
    sst_log_hold_errors(before);
    if (err)
        return err;
    free(picture.data);
    picture.data = data;
    picture.bytes = bytes;
    picture.at_ns = sst_clock_now_ns();
    return 0;
}

int picture_get(uint8_t **data, size_t *bytes)
{
    int err = 0;

    pthread_mutex_lock(&picture.lock);
    if (!picture.data || sst_clock_now_ns() - picture.at_ns > SHARED_NS)
        err = fetch_locked();
    *data = err ? NULL : malloc(picture.bytes);
    if (*data) {
        memcpy(*data, picture.data, picture.bytes);
        *bytes = picture.bytes;
    } else if (!err) {
        err = -ENOMEM;
    }
    pthread_mutex_unlock(&picture.lock);
    return err;
}

void picture_size(int *width, int *height, size_t *bytes)
{
    const struct sst_array_config *a = &picture.server->config.array;

    pthread_mutex_lock(&picture.lock);
    if (!picture.width && (!picture.tried_ns || sst_clock_now_ns() - picture.tried_ns > TRY_NS))
        (void)fetch_locked();
    *width = picture.width ? picture.width : a->width;
    *height = picture.width ? picture.height : a->height;
    *bytes = picture.bytes ? picture.bytes : (size_t)*width * *height / 5; /* of JPEG, about */
    pthread_mutex_unlock(&picture.lock);
}

void picture_forget(void)
{
    pthread_mutex_lock(&picture.lock);
    picture.width = 0;
    picture.tried_ns = 0;
    pthread_mutex_unlock(&picture.lock);
}
