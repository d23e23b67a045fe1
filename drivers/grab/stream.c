/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/grab/grab_internal.h"
#include "drivers/grab/parts_internal.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/mem.h"
#include "base/text.h"

enum slot_place {
    SLOT_IDLE = 0,   /* neither */
    SLOT_QUEUED = 1, /* with the driver */
    SLOT_LENT = 2,   /* with the receiver */
};

struct slot {
    struct sst_frame frame; /* its pool points to the slot */
    struct grab_stream *stream;
    uint32_t index;
    enum slot_place place; /* under lock */
    uint8_t *map;
    size_t map_bytes;
    struct sst_frame *part;    /* [parts]; NULL: its frame is one camera's */
    struct sst_mem_kept *room; /* [parts] */
    int parts_lent;            /* under lock */
};

struct grab_stream {
    /* fixed after open */
    int fd, count, parts;
    uint32_t type; /* of its buffers */
    bool in_turn;  /* buffers must be queued in the order of their numbers */
    struct slot slot[SST_STREAM_BUFFERS_MAX];
    /* under lock */
    pthread_mutex_t lock;
    bool live;   /* streaming: released buffers are queued at once */
    bool closed; /* the descriptor is closed */
    int next; /* in turn: the buffer to queue next */
    int queued;
    int64_t ready_ns; /* since when any is queued */
    int lent;
    /* the owner's */
    int64_t start_ns;
};

/* --- open and close ----------------------------------------------------------------------------------------------- */

static void destroy(struct grab_stream *s)
{
    for (int i = 0; i < s->count; i++) {
        if (s->slot[i].map)
            munmap(s->slot[i].map, s->slot[i].map_bytes);
        for (int k = 0; s->slot[i].room && k < s->parts; k++)
            sst_mem_kept_fini(&s->slot[i].room[k]);
        free(s->slot[i].part);
        free(s->slot[i].room);
    }
    pthread_mutex_destroy(&s->lock);
    free(s);
}

/* An ioctl about a buffer, of either API. @param planes  [VIDEO_MAX_PLANES], the first is filled in for both */
static int buffer_ioctl(const struct grab_stream *s, unsigned long request, struct v4l2_buffer *b,
                        struct v4l2_plane *planes)
{
    int err;

    b->type = s->type;
    b->memory = V4L2_MEMORY_MMAP;
    memset(planes, 0, VIDEO_MAX_PLANES * sizeof(*planes));
    if (s->type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE) {
        b->m.planes = planes;
        b->length = VIDEO_MAX_PLANES;
    }
    err = node_ioctl(s->fd, request, b);
    if (s->type == V4L2_BUF_TYPE_VIDEO_CAPTURE)
        planes[0] = (struct v4l2_plane){ .length = b->length, .bytesused = b->bytesused, .m.mem_offset = b->m.offset };
    return err;
}

static int map_buffer(struct grab_stream *s, int index)
{
    struct slot *slot = &s->slot[index];
    struct v4l2_buffer b = { .index = (uint32_t)index };
    struct v4l2_plane planes[VIDEO_MAX_PLANES];
    const int err = buffer_ioctl(s, VIDIOC_QUERYBUF, &b, planes);
    void *map;

    if (err)
        return err;
    map = mmap(NULL, planes[0].length, PROT_READ | PROT_WRITE, MAP_SHARED, s->fd, planes[0].m.mem_offset);
    if (map == MAP_FAILED)
        return -errno;
    slot->map = map;
    slot->map_bytes = planes[0].length;
    return 0;
}

static int make_parts(struct grab_stream *s, struct slot *slot)
{
    if (s->parts == 1)
        return 0;
    slot->part = calloc((size_t)s->parts, sizeof(*slot->part));
    slot->room = calloc((size_t)s->parts, sizeof(*slot->room));
    return slot->part && slot->room ? 0 : -ENOMEM;
}

static int map_buffers(struct grab_stream *s, const struct sst_grab_config *cfg, int cam, size_t stride, char *why)
{
    struct v4l2_requestbuffers r = { .count = (uint32_t)cfg->buffers,
                                     .type = s->type,
                                     .memory = V4L2_MEMORY_MMAP };
    int err = node_ioctl(s->fd, VIDIOC_REQBUFS, &r);

    if (!err && (r.count < 2 || r.count > SST_STREAM_BUFFERS_MAX))
        err = -ENOMEM;
    if (err) {
        snprintf(why, SST_WHY_MAX, "cannot allocate %d buffers: %s", cfg->buffers,
                 err == -EBUSY ? "another program streams from it; `sst cameras` says which" : strerror(-err));
        return err;
    }
    for (int i = 0; i < (int)r.count; i++) {
        struct slot *slot = &s->slot[i];

        s->count = i + 1;
        slot->stream = s;
        slot->index = (uint32_t)i;
        err = map_buffer(s, i);
        err = err ? err : make_parts(s, slot);
        if (err) {
            snprintf(why, SST_WHY_MAX, "cannot map buffer %d: %s", i, strerror(-err));
            return err;
        }
        slot->frame = (struct sst_frame){ .cam = cam,
                                          .fourcc = cfg->fourcc,
                                          .width = cfg->width,
                                          .height = cfg->height,
                                          .stride = stride,
                                          .data = slot->map,
                                          .pool = slot };
    }
    return 0;
}

static int open_node(struct sst_grab_device *device, char *why)
{
    const int fd = node_open(device);

    if (fd == -EACCES || fd == -EPERM)
        snprintf(why, SST_WHY_MAX, "no permission to open %s; add this user to the group of the node (video)",
                 device->node);
    else if (fd < 0)
        snprintf(why, SST_WHY_MAX, "cannot open %s: %s", device->node, strerror(-fd));
    return fd;
}

static int set_up(struct grab_stream *s, const struct sst_grab_device *device, const struct sst_grab_config *cfg,
                  int cam, char *why, char *note)
{
    char controls[SST_WHY_MAX];
    size_t stride = 0;
    int err = format_set(s->fd, cfg, &stride, note, SST_WHY_MAX);

    if (err) {
        if (*note)
            snprintf(why, SST_WHY_MAX, "%s", note);
        else if (err == -EBUSY)
            snprintf(why, SST_WHY_MAX, "another program streams from it; `sst cameras` says which");
        else
            snprintf(why, SST_WHY_MAX, "its driver does not accept a format, size or rate: %s", strerror(-err));
        *note = 0;
        return err;
    }
    controls_apply(s->fd, cfg->control, cfg->controls, controls, sizeof(controls));
    if (*controls)
        sst_text_add(note, SST_WHY_MAX, "%s%s", *note ? "; " : "", controls);
    if (*note)
        sst_text_add(note, SST_WHY_MAX, " [%s]", device->node);
    return map_buffers(s, cfg, cam, stride, why);
}

int stream_open(struct grab_stream **out, struct sst_grab_device *device, const struct sst_grab_config *cfg, int cam,
                char *why, char *note)
{
    struct grab_stream *s = calloc(1, sizeof(*s));
    int err;

    *why = *note = 0;
    if (!s) {
        snprintf(why, SST_WHY_MAX, "no memory for its stream");
        return -ENOMEM;
    }
    pthread_mutex_init(&s->lock, NULL);
    s->fd = open_node(device, why);
    if (s->fd < 0) {
        err = s->fd;
        s->closed = true;
        destroy(s);
        return err;
    }
    s->parts = sst_max_int(cfg->split.rows * cfg->split.cols, 1);
    s->type = node_type(s->fd);
    /* libcamera's V4L2 layer hands buffers out in the order of their numbers, whichever was filled. */
    s->in_turn = !strcmp(device->driver, "libcamera");
    err = set_up(s, device, cfg, cam, why, note);
    if (err)
        stream_close(s);
    else
        *out = s;
    return err;
}

void stream_close(struct grab_stream *s)
{
    struct v4l2_requestbuffers none = { .memory = V4L2_MEMORY_MMAP };
    bool last;

    if (!s)
        return;
    stream_stop(s);
    none.type = s->type;
    /* A mapped buffer keeps the file and the driver's queue open after close(): release the queue first. */
    (void)node_ioctl(s->fd, VIDIOC_REQBUFS, &none);
    close(s->fd);
    pthread_mutex_lock(&s->lock);
    s->closed = true;
    last = !s->lent;
    pthread_mutex_unlock(&s->lock);
    if (last)
        destroy(s);
}

/* --- streaming ---------------------------------------------------------------------------------------------------- */

static int queue_locked(struct grab_stream *s, struct slot *slot)
{
    struct v4l2_buffer b = { .index = slot->index };
    struct v4l2_plane planes[VIDEO_MAX_PLANES];
    const int err = buffer_ioctl(s, VIDIOC_QBUF, &b, planes);

    slot->place = err ? SLOT_IDLE : SLOT_QUEUED;
    if (!err && !s->queued++)
        s->ready_ns = sst_clock_now_ns();
    return err;
}

/* Queue buffers from the next one on, up to one that is not idle. @return 0 or the driver's error */
static int queue_in_turn_locked(struct grab_stream *s)
{
    int err = 0;

    for (int i = 0; !err && i < s->count && s->slot[s->next].place == SLOT_IDLE; i++) {
        err = queue_locked(s, &s->slot[s->next]);
        s->next = err ? s->next : (s->next + 1) % s->count;
    }
    return err;
}

/* Also buffers that the driver refused before: it may accept them now. A driver that accepts none is detected as
 * silent. */
static void queue_idle_locked(struct grab_stream *s)
{
    if (s->in_turn) {
        (void)queue_in_turn_locked(s);
        return;
    }
    for (int i = 0; i < s->count; i++) {
        if (s->slot[i].place == SLOT_IDLE)
            (void)queue_locked(s, &s->slot[i]);
    }
}

int stream_start(struct grab_stream *s, char *why)
{
    int type = (int)s->type, err = 0;

    pthread_mutex_lock(&s->lock);
    s->next = 0;
    if (s->in_turn)
        err = queue_in_turn_locked(s);
    for (int i = 0; !err && !s->in_turn && i < s->count; i++) {
        if (s->slot[i].place == SLOT_IDLE)
            err = queue_locked(s, &s->slot[i]);
    }
    pthread_mutex_unlock(&s->lock);
    s->start_ns = sst_clock_now_ns();
    err = err ? err : node_ioctl(s->fd, VIDIOC_STREAMON, &type);
    if (err == -ENOSPC)
        snprintf(why, SST_WHY_MAX,
                 "no USB bandwidth is left for it (the error is not about a disk); `sst plan` shows what fits, move it "
                 "to another controller or lower size, rate or number of cameras");
    else if (err)
        snprintf(why, SST_WHY_MAX, "streaming does not start: %s", strerror(-err));
    pthread_mutex_lock(&s->lock);
    s->live = !err;
    /* Released between the loop above and here. */
    if (s->live)
        queue_idle_locked(s);
    pthread_mutex_unlock(&s->lock);
    return err;
}

void stream_detach(struct grab_stream *s)
{
    pthread_mutex_lock(&s->lock);
    s->live = false;
    pthread_mutex_unlock(&s->lock);
}

void stream_stop(struct grab_stream *s)
{
    int type = (int)s->type;

    stream_detach(s);
    /* A disconnected camera fails here; nothing is left to stop then. */
    (void)node_ioctl(s->fd, VIDIOC_STREAMOFF, &type);
    pthread_mutex_lock(&s->lock);
    s->queued = 0;
    for (int i = 0; i < s->count; i++) {
        if (s->slot[i].place == SLOT_QUEUED)
            s->slot[i].place = SLOT_IDLE;
    }
    pthread_mutex_unlock(&s->lock);
}

int stream_fd(const struct grab_stream *s)
{
    return s->fd;
}

int64_t stream_start_ns(const struct grab_stream *s)
{
    return s->start_ns;
}

int stream_queued(struct grab_stream *s)
{
    int queued;

    pthread_mutex_lock(&s->lock);
    queued = s->queued;
    pthread_mutex_unlock(&s->lock);
    return queued;
}

int64_t stream_ready_ns(struct grab_stream *s)
{
    int64_t ready_ns;

    pthread_mutex_lock(&s->lock);
    ready_ns = s->queued ? s->ready_ns : 0;
    pthread_mutex_unlock(&s->lock);
    return ready_ns;
}

int stream_lent(struct grab_stream *s)
{
    int lent;

    pthread_mutex_lock(&s->lock);
    lent = s->lent;
    pthread_mutex_unlock(&s->lock);
    return lent;
}

int stream_dequeue(struct grab_stream *s, struct sst_frame **out, struct stream_stamp *stamp)
{
    struct v4l2_buffer b = { 0 };
    struct v4l2_plane planes[VIDEO_MAX_PLANES];
    const int err = buffer_ioctl(s, VIDIOC_DQBUF, &b, planes);
    size_t bytes, begin; /* filled, and of these before the picture */
    struct sst_frame *frame;
    struct slot *slot;
    bool lent;

    if (err)
        return err;
    if (b.index >= (uint32_t)s->count)
        return -EIO;
    slot = &s->slot[b.index];
    pthread_mutex_lock(&s->lock);
    /* v4l2loopback may return a buffer that was not queued; the receiver keeps its frame, and the gap in the sequence
     * shows the loss. */
    lent = slot->place == SLOT_LENT;
    if (!lent) {
        s->queued -= slot->place == SLOT_QUEUED;
        s->lent++;
        slot->place = SLOT_LENT;
    }
    pthread_mutex_unlock(&s->lock);
    if (lent)
        return -EAGAIN;
    frame = &slot->frame;
    bytes = planes[0].bytesused < slot->map_bytes ? planes[0].bytesused : slot->map_bytes;
    begin = planes[0].data_offset < bytes ? planes[0].data_offset : bytes;
    frame->data = slot->map + begin;
    frame->bytes = bytes - begin;
    frame->sequence = b.sequence;
    frame->arrival_ns = sst_clock_now_ns();
    frame->faults = b.flags & V4L2_BUF_FLAG_ERROR ? SST_FRAME_FLAGGED : 0;
    frame->lost_before = 0;
    stamp->monotonic = (b.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    stamp->end_of_frame = (b.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) != V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    if (!stamp->monotonic)
        frame->faults |= SST_FRAME_ARRIVAL;
    stamp->field = b.field;
    frame->t_ns = stamp->monotonic ? (int64_t)b.timestamp.tv_sec * 1000000000 + (int64_t)b.timestamp.tv_usec * 1000
                                   : frame->arrival_ns;
    *out = frame;
    return 0;
}

void stream_release(struct sst_frame *frame)
{
    struct slot *slot = frame->pool;
    struct grab_stream *s = slot->stream;
    bool last;

    pthread_mutex_lock(&s->lock);
    if (slot->parts_lent > 1) {
        slot->parts_lent--;
        pthread_mutex_unlock(&s->lock);
        return;
    }
    slot->parts_lent = 0;
    slot->place = SLOT_IDLE;
    s->lent--;
    if (s->live)
        queue_idle_locked(s);
    last = s->closed && !s->lent;
    pthread_mutex_unlock(&s->lock);
    if (last)
        destroy(s);
}

struct sst_frame *stream_parts(const struct sst_frame *whole)
{
    return ((struct slot *)whole->pool)->part;
}

uint8_t *stream_part_room(const struct sst_frame *whole, int part, size_t bytes)
{
    return sst_mem_keep(&((struct slot *)whole->pool)->room[part], bytes, 1);
}

void stream_lend_parts(const struct sst_frame *whole, int count)
{
    struct slot *slot = whole->pool;

    pthread_mutex_lock(&slot->stream->lock);
    slot->parts_lent = count;
    pthread_mutex_unlock(&slot->stream->lock);
}
