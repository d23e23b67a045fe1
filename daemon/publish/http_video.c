/* H.264 of picture streams: one encoder for all viewers of a slot, on a thread that lives as long as there are some.
 *
 * It encodes the newest picture when it is due, so nothing queues before it. The last units wait in a ring; a viewer that
 * falls out of it goes on at the next key picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/publish_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/video/h264.h"
#include "pipeline/image/jpeg_planes.h"

#define UNITS        8            /* in the ring */
#define BEHIND_MAX   4            /* units that a viewer may be behind */
#define KEY_BACK     3            /* of the last units one may be the key picture that a viewer goes on with */
#define KEY_NS       5000000000LL /* between key pictures, and ... */
#define KEY_UNITS    40           /* ... that many others; viewers get theirs on demand */
#define KEY_LEAST_NS 400000000LL  /* ... that viewers ask for */
#define REPEAT_NS    5000000000LL /* a still picture is shown again, as a sign of life */
#define WAIT_MS      50           /* for a picture: how fast a viewer that joins a still one is noticed */
#define PIXELS_BYTE  24           /* pixels for one byte of the limit */
#define BYTES_LEAST  4000

struct http_video {
    /* fixed after create */
    struct http_videos *all;
    struct sst_slot *slot;
    struct sst_counters *count;
    int64_t period_ns; /* between pictures, at least */
    /* under all->lock */
    struct http_video *next;
    int users;
    /* under lock */
    pthread_mutex_t lock;
    struct http_unit *ring[UNITS]; /* by number */
    uint64_t number;               /* of the last unit */
    struct http_watcher *watchers;
    char why[256]; /* why there are no more units; "": there are */
    /* atomic */
    SST_ATOMIC(bool) wanted; /* a key picture */
    /* its thread only */
    struct sst_h264 *h264;
    struct sst_h264_config config; /* of h264 */
    uint8_t *samples;
    size_t samples_bytes;
    uint64_t picture; /* number of the last one in the slot */
    int64_t due_ns, shown_ns, key_ns;
    int since_key; /* units */
};

/* --- pictures to units, the encoder's thread ---------------------------------------------------------------------- */

static void average(uint8_t *to, const uint8_t *a, const uint8_t *b, size_t n)
{
    for (size_t i = 0; i < n; i++)
        to[i] = (uint8_t)((a[i] + b[i] + 1) / 2);
}

/* Chroma of 4:2:2 and 4:4:4, reduced to 4:2:0 in its place. */
static void halve_chroma(uint8_t *plane, const struct sst_jpeg_planes *p)
{
    const size_t stride = p->stride[1], width = (size_t)p->chroma_width;

    for (int y = 0; y < p->height / 2; y++) {
        uint8_t *to = plane + (size_t)y * stride;
        const uint8_t *from = plane + (size_t)y * stride * (p->down == 1 ? 2 : 1);

        if (p->down == 1)
            average(to, from, from + stride, width);
        for (size_t x = 0; p->across == 1 && x < width / 2; x++)
            to[x] = (uint8_t)((to[2 * x] + to[2 * x + 1] + 1) / 2);
    }
}

/* @param out  valid until the next call @return 0; -EAGAIN: damaged, the next one may be fine; -ENOTSUP, -ENOMEM */
static int decode(struct http_video *v, const struct sst_jpeg *jpeg, struct sst_h264_picture *out, int size[2])
{
    struct sst_jpeg_planes p;
    size_t grey;
    int err = sst_jpeg_planes_read(&p, jpeg->data, jpeg->bytes, "picture");

    if (err)
        return err == -EBADMSG ? -EAGAIN : err;
    grey = p.count == 1 ? (size_t)p.width : 0; /* a row of no colour */
    if (p.bytes + grey > v->samples_bytes) {
        free(v->samples);
        v->samples = malloc(p.bytes + grey);
        v->samples_bytes = v->samples ? p.bytes + grey : 0;
    }
    if (!v->samples)
        return -ENOMEM;
    err = sst_jpeg_planes_decode(v->samples, &p, jpeg->data, jpeg->bytes, "picture");
    if (err)
        return err == -EBADMSG ? -EAGAIN : err;
    memset(v->samples + p.bytes, 128, grey);
    for (int i = 0; i < 3; i++) {
        out->plane[i] = v->samples + (i && grey ? p.bytes : p.at[i]);
        out->stride[i] = i && grey ? 0 : p.stride[i];
        if (i && !grey && (p.down == 1 || p.across == 1))
            halve_chroma(v->samples + p.at[i], &p);
    }
    size[0] = p.width & ~1;
    size[1] = p.height & ~1;
    return 0;
}

static int follow_size(struct http_video *v, const int size[2], char why[256])
{
    const int most = size[0] * size[1] / PIXELS_BYTE;
    int err;

    if (v->h264 && v->config.width == size[0] && v->config.height == size[1])
        return 0;
    sst_h264_close(v->h264);
    v->h264 = NULL;
    v->config = (struct sst_h264_config){ size[0], size[1], sst_max_int(most, BYTES_LEAST), true };
    err = sst_h264_open(&v->h264, &v->config, why);
    if (!err)
        sst_counters_set_encoder(v->count, sst_h264_name(v->h264));
    v->key_ns = 0;
    return err;
}

static void unref_unit(struct http_unit *u)
{
    if (u && atomic_fetch_sub(&u->refs, 1) == 1)
        free(u);
}

void http_unit_unref(const struct http_unit *unit)
{
    unref_unit((struct http_unit *)unit);
}

static void wake_locked(struct http_video *v)
{
    const uint64_t one = 1;

    for (struct http_watcher *w = v->watchers; w; w = w->next)
        (void)!write(w->wake, &one, sizeof(one));
}

static int put(struct http_video *v, const struct sst_jpeg *jpeg, const struct sst_h264_unit *made)
{
    struct http_unit *u = malloc(sizeof(*u) + made->bytes), **at, *before;

    if (!u)
        return -ENOMEM;
    *u = (struct http_unit){ .refs = 1,
                             .key = made->key,
                             .wall_ns = jpeg->wall_ns,
                             .set = jpeg->set,
                             .width = v->config.width,
                             .height = v->config.height,
                             .bytes = made->bytes };
    memcpy(u->codec, made->codec, sizeof(u->codec));
    snprintf(u->encoder, sizeof(u->encoder), "%s", sst_h264_name(v->h264));
    memcpy(u->data, made->data, made->bytes);
    pthread_mutex_lock(&v->lock);
    u->number = ++v->number;
    at = &v->ring[u->number % UNITS];
    before = *at;
    *at = u;
    if (u->key)
        atomic_store(&v->wanted, false);
    wake_locked(v);
    pthread_mutex_unlock(&v->lock);
    unref_unit(before);
    return 0;
}

/* @return 0; -EAGAIN: without this picture; else the end, and why */
static int encode(struct http_video *v, const struct sst_jpeg *jpeg, char why[256])
{
    const int64_t now_ns = sst_clock_now_ns();
    struct sst_h264_picture picture = { 0 };
    struct sst_h264_unit unit;
    int size[2], err = decode(v, jpeg, &picture, size);

    if (err == -ENOTSUP)
        snprintf(why, 256, "pictures with this sampling of colours are not encoded as H.264");
    err = err ? err : follow_size(v, size, why);
    if (err)
        return err;
    picture.key = !v->key_ns || (now_ns - v->key_ns > KEY_NS && v->since_key >= KEY_UNITS) ||
                  (atomic_load(&v->wanted) && now_ns - v->key_ns > KEY_LEAST_NS);
    err = sst_h264_encode(v->h264, &picture, &unit, why);
    if (err) {
        sst_log_warning("http: H.264: %s; the encoder is opened again", why);
        v->config.width = 0;
        return err == -ENOMEM ? err : -EAGAIN;
    }
    v->key_ns = unit.key ? now_ns : v->key_ns;
    v->since_key = unit.key ? 0 : v->since_key + 1;
    return put(v, jpeg, &unit);
}

static void pause_ms(int ms)
{
    (void)nanosleep(&(struct timespec){ .tv_nsec = ms * 1000000L }, NULL);
}

/* The picture to encode now: a newer one, or the same again for a viewer that needs it, or after a while. */
static const struct sst_jpeg *next_picture(struct http_video *v)
{
    int64_t now_ns = sst_clock_now_ns();
    const int64_t early_ns = v->due_ns - now_ns;
    const struct sst_jpeg *jpeg;
    bool again;

    if (early_ns > 0) {
        (void)nanosleep(&(struct timespec){ .tv_nsec = early_ns < 200000000 ? early_ns : 200000000 }, NULL);
        if (early_ns > 200000000)
            return NULL;
    }
    if (!sst_slot_wait(v->slot, v->picture, WAIT_MS) && sst_slot_is_shut(v->slot))
        pause_ms(WAIT_MS); /* its viewers leave */
    now_ns = sst_clock_now_ns();
    again = now_ns - v->shown_ns > REPEAT_NS || (atomic_load(&v->wanted) && now_ns - v->key_ns > KEY_LEAST_NS);
    jpeg = sst_slot_get(v->slot, again ? 0 : v->picture);
    if (!jpeg)
        return NULL;
    v->picture = jpeg->number;
    v->shown_ns = now_ns;
    /* Steps of one period, so that jitter of the source does not add up. */
    v->due_ns = v->due_ns + v->period_ns < now_ns - v->period_ns ? now_ns : v->due_ns + v->period_ns;
    return jpeg;
}

/* Has the encoder viewers left? Without viewers it is removed from the list, so that no viewer joins. */
static bool is_watched(struct http_video *v)
{
    struct http_video **at;
    bool watched;

    pthread_mutex_lock(&v->all->lock);
    watched = v->users > 0;
    for (at = &v->all->first; !watched && *at != v; at = &(*at)->next)
        ;
    if (!watched)
        *at = v->next;
    pthread_mutex_unlock(&v->all->lock);
    return watched;
}

static void destroy(struct http_video *v)
{
    for (int i = 0; i < UNITS; i++)
        unref_unit(v->ring[i]);
    sst_h264_close(v->h264);
    sst_slot_unref(v->slot);
    pthread_mutex_destroy(&v->lock);
    free(v->samples);
    free(v);
}

static void *run(void *arg)
{
    struct http_video *v = arg;
    struct http_videos *all = v->all;
    char why[256] = "", held[SST_LOG_MAX] = "";
    int err = 0;

    sst_thread_name("sst-h264");
    sst_log_hold_errors(held); /* damaged frames are counted by the capture */
    while (is_watched(v)) {
        const struct sst_jpeg *jpeg = err ? NULL : next_picture(v);

        if (err)
            pause_ms(WAIT_MS);
        if (!jpeg)
            continue;
        err = encode(v, jpeg, why);
        sst_slot_jpeg_unref(jpeg);
        err = err == -EAGAIN ? 0 : err;
        if (!err)
            continue;
        pthread_mutex_lock(&v->lock);
        snprintf(v->why, sizeof(v->why), "%s", why[0] ? why : "out of memory");
        wake_locked(v);
        pthread_mutex_unlock(&v->lock);
    }
    destroy(v);
    sst_log_hold_errors(NULL);
    http_thread_ended(all);
    return NULL;
}

/* --- viewers ------------------------------------------------------------------------------------------------------ */

void http_videos_init(struct http_videos *all)
{
    pthread_mutex_init(&all->lock, NULL);
    sst_cond_init(&all->ended);
}

void http_videos_fini(struct http_videos *all)
{
    pthread_cond_destroy(&all->ended);
    pthread_mutex_destroy(&all->lock);
}

void http_videos_await(struct http_videos *all)
{
    pthread_mutex_lock(&all->lock);
    all->closed = true;
    while (all->threads)
        (void)sst_cond_wait_until(&all->ended, &all->lock, sst_clock_now_ns() + 1000000000);
    pthread_mutex_unlock(&all->lock);
}

static int start_locked(struct http_videos *all, void *(*body)(void *), void *arg)
{
    pthread_t thread;
    const int err = all->closed ? -ECANCELED : -pthread_create(&thread, NULL, body, arg);

    if (err)
        return err;
    pthread_detach(thread);
    all->threads++;
    return 0;
}

int http_thread_start(struct http_videos *all, void *(*body)(void *), void *arg)
{
    int err;

    pthread_mutex_lock(&all->lock);
    err = start_locked(all, body, arg);
    pthread_mutex_unlock(&all->lock);
    return err;
}

void http_thread_ended(struct http_videos *all)
{
    pthread_mutex_lock(&all->lock);
    all->threads--;
    pthread_cond_broadcast(&all->ended);
    pthread_mutex_unlock(&all->lock);
}

static struct http_video *create_locked(struct sst_http *http, struct sst_slot *slot)
{
    struct http_video *v = calloc(1, sizeof(*v));

    if (!v)
        return NULL;
    v->all = &http->videos;
    v->slot = sst_slot_ref(slot);
    v->count = http->count;
    v->period_ns = http->cfg.stream_hz > 0 ? (int64_t)(1e9 / http->cfg.stream_hz) : 0;
    pthread_mutex_init(&v->lock, NULL);
    v->users = 1; /* before its thread looks */
    if (start_locked(v->all, run, v)) {
        destroy(v);
        return NULL;
    }
    v->next = v->all->first;
    v->all->first = v;
    return v;
}

struct http_video *http_video_join(struct sst_http *http, struct sst_slot *slot, struct http_watcher *w)
{
    struct http_videos *all = &http->videos;
    struct http_video *v;

    pthread_mutex_lock(&all->lock);
    for (v = all->first; v && v->slot != slot; v = v->next)
        ;
    if (v)
        v->users++;
    else
        v = create_locked(http, slot);
    pthread_mutex_unlock(&all->lock);
    if (!v)
        return NULL;
    pthread_mutex_lock(&v->lock);
    w->next = v->watchers;
    v->watchers = w;
    pthread_mutex_unlock(&v->lock);
    return v;
}

void http_video_leave(struct http_video *v, struct http_watcher *w)
{
    struct http_watcher **at;

    if (!v)
        return;
    pthread_mutex_lock(&v->lock);
    for (at = &v->watchers; *at != w; at = &(*at)->next)
        ;
    *at = w->next;
    pthread_mutex_unlock(&v->lock);
    pthread_mutex_lock(&v->all->lock);
    v->users--;
    pthread_mutex_unlock(&v->all->lock);
}

/* A key picture to go on with, unless it is late itself. */
static struct http_unit *find_key_locked(const struct http_video *v, uint64_t after)
{
    for (uint64_t n = v->number; n > after && n + KEY_BACK > v->number; n--)
        if (v->ring[n % UNITS]->key)
            return v->ring[n % UNITS];
    return NULL;
}

const struct http_unit *http_video_next(struct http_video *v, uint64_t after, bool *key)
{
    struct http_unit *u;

    pthread_mutex_lock(&v->lock);
    *key |= after && v->number > after + BEHIND_MAX;
    u = *key ? find_key_locked(v, after) : after < v->number ? v->ring[(after + 1) % UNITS] : NULL;
    if (u)
        atomic_fetch_add(&u->refs, 1);
    if (*key && !u)
        atomic_store(&v->wanted, true);
    *key &= !u;
    pthread_mutex_unlock(&v->lock);
    return u;
}

bool http_video_over(struct http_video *v, char why[256])
{
    bool over;

    pthread_mutex_lock(&v->lock);
    over = v->why[0] != 0;
    memcpy(why, v->why, sizeof(v->why));
    pthread_mutex_unlock(&v->lock);
    return over;
}
