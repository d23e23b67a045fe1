/* Buffers of a simulated camera: the semantics of the kernel's videobuf2, with each buffer's memory in a memfd. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "simulators/devices/camera/camera_internal.h"

#define OFFSET_SHIFT 26 /* mmap offsets of buffers lie this far apart; larger than any buffer */
#define CAPABILITIES                                                                                                   \
    (V4L2_BUF_CAP_SUPPORTS_MMAP | V4L2_BUF_CAP_SUPPORTS_USERPTR | V4L2_BUF_CAP_SUPPORTS_DMABUF |                       \
     V4L2_BUF_CAP_SUPPORTS_ORPHANED_BUFS)

/* --- memory ------------------------------------------------------------------------------------------------------- */

static size_t whole_pages(uint32_t bytes)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);

    return (bytes + page - 1) / page * page;
}

static void buffer_free(struct sim_buffer *b)
{
    if (b->data)
        (void)munmap(b->data, whole_pages(b->length));
    if (b->memory >= 0)
        close(b->memory); /* programs that map it keep it */
    if (b->dmabuf >= 0)
        close(b->dmabuf);
    *b = (struct sim_buffer){ .memory = -1, .dmabuf = -1 };
}

static int buffer_make(struct sim_buffer *b, uint32_t bytes)
{
    const size_t room = whole_pages(bytes);
    void *data = MAP_FAILED;

    *b = (struct sim_buffer){ .length = bytes, .user_length = bytes, .field = V4L2_FIELD_NONE, .dmabuf = -1, .dmabuf_number = -1 };
    b->memory = memfd_create("sst-sim-frame", MFD_CLOEXEC);
    if (b->memory >= 0 && ftruncate(b->memory, (off_t)room) == 0)
        data = mmap(NULL, room, PROT_READ | PROT_WRITE, MAP_SHARED, b->memory, 0);
    if (data == MAP_FAILED) {
        buffer_free(b);
        return -ENOMEM;
    }
    b->data = data;
    return 0;
}

/* @return number of buffers created, or -ENOMEM if none */
static int make_buffers(struct sim_queue *q, uint32_t count, uint32_t bytes)
{
    uint32_t made = 0;

    while (made < count && q->count < SST_SIM_CAM_BUFFERS && buffer_make(&q->buffer[q->count], bytes) == 0) {
        q->count++;
        made++;
    }
    return made ? (int)made : -ENOMEM;
}

static void free_buffers(struct sim_queue *q)
{
    for (uint32_t i = 0; i < q->count; i++)
        buffer_free(&q->buffer[i]);
    q->count = q->memory = 0;
    q->queued_count = q->done_count = 0;
}

/* --- lists -------------------------------------------------------------------------------------------------------- */

static uint32_t shift(uint32_t *list, int *count)
{
    const uint32_t first = list[0];

    (*count)--;
    memmove(list, list + 1, (size_t)*count * sizeof(*list));
    return first;
}

/* --- buffer state ------------------------------------------------------------------------------------------------- */

uint32_t sim_cam_type(const struct sim_cam *cam)
{
    return sim_cam_fault(cam, SST_SIM_FAULT_MPLANE) > 0 ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE
                                                        : V4L2_BUF_TYPE_VIDEO_CAPTURE;
}

/* Its type is the caller's. */
static void describe(const struct sim_queue *q, uint32_t index, struct v4l2_buffer *out)
{
    const struct sim_buffer *b = &q->buffer[index];
    int64_t us = b->stamp_ns / 1000;

    *out = (struct v4l2_buffer){ .index = index,
                                 .type = out->type,
                                 .memory = q->memory,
                                 .field = b->field,
                                 .length = b->length,
                                 .bytesused = b->bytesused,
                                 .sequence = b->sequence,
                                 .flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE };
    out->timestamp.tv_sec = us / 1000000 - (us % 1000000 < 0);
    out->timestamp.tv_usec = us % 1000000 + (us % 1000000 < 0 ? 1000000 : 0);
    switch (q->memory) {
    case V4L2_MEMORY_MMAP:
        out->m.offset = index << OFFSET_SHIFT;
        break;
    case V4L2_MEMORY_USERPTR:
        out->m.userptr = b->userptr;
        out->length = b->user_length;
        break;
    default:
        out->m.fd = b->dmabuf_number;
        out->length = b->user_length;
    }
    if (b->mapped)
        out->flags |= V4L2_BUF_FLAG_MAPPED;
    if (b->prepared)
        out->flags |= V4L2_BUF_FLAG_PREPARED;
    if (b->state == SST_SIM_BUFFER_QUEUED)
        out->flags |= V4L2_BUF_FLAG_QUEUED;
    if (b->state == SST_SIM_BUFFER_DONE)
        out->flags |= V4L2_BUF_FLAG_DONE | (b->error ? V4L2_BUF_FLAG_ERROR : 0);
}

/* --- frames ------------------------------------------------------------------------------------------------------- */

struct sim_buffer *sim_cam_queue_next(struct sim_cam *cam)
{
    struct sim_queue *q = &cam->queue;

    return q->streaming && q->queued_count ? &q->buffer[q->queued[0]] : NULL;
}

/* Dequeue the oldest frame and answer DQBUF. */
static void dequeue(struct sim_cam *cam, struct sim_request *r)
{
    struct v4l2_buffer *out = (struct v4l2_buffer *)r->data;
    struct sim_queue *q = &cam->queue;
    const uint32_t filled = shift(q->done, &q->done_count);
    const uint32_t index = sim_cam_fault(cam, SST_SIM_FAULT_LIBCAMERA) > 0 ? q->turn : filled;
    struct sim_buffer *b = &q->buffer[index];

    q->turn = (q->turn + 1) % q->count;

    describe(q, index, out);
    out->flags &= ~(uint32_t)V4L2_BUF_FLAG_DONE;
    r->out_bytes = sizeof(*out);
    b->state = SST_SIM_BUFFER_DEQUEUED;
    b->error = false;
    if (q->memory == V4L2_MEMORY_USERPTR)
        r->out_fd = b->memory;
    if (b->dmabuf >= 0)
        close(b->dmabuf);
    b->dmabuf = -1;
}

void sim_cam_queue_done(struct sim_cam *cam)
{
    struct sim_queue *q = &cam->queue;
    const uint32_t index = shift(q->queued, &q->queued_count);
    struct sim_request *waiter = q->waiter;

    q->buffer[index].state = SST_SIM_BUFFER_DONE;
    q->buffer[index].prepared = false;
    q->done[q->done_count++] = index;
    if (waiter) {
        q->waiter = NULL;
        dequeue(cam, waiter);
        sst_sim_answer(cam->server, waiter, 0);
    } else if (q->owner) {
        /* One byte for each finished frame. 32 always fit. */
        (void)!sim_handle_readable(q->owner->handle, "", 1);
    }
}

void sim_cam_queue_stop(struct sim_cam *cam, struct sim_request *r)
{
    struct sim_queue *q = &cam->queue;
    struct sim_request *waiter = q->waiter;

    if (q->streaming)
        sim_cam_stop(cam);
    q->streaming = false;
    if (r)
        r->drain = (uint32_t)q->done_count;
    q->queued_count = q->done_count = 0;
    for (uint32_t i = 0; i < q->count; i++) {
        q->buffer[i].state = SST_SIM_BUFFER_DEQUEUED;
        q->buffer[i].prepared = q->buffer[i].error = false;
    }
    q->waiter = NULL;
    if (waiter)
        sst_sim_answer(cam->server, waiter, -EINVAL);
}

void sim_cam_queue_free(struct sim_cam *cam)
{
    sim_cam_queue_stop(cam, NULL);
    free_buffers(&cam->queue);
    cam->queue.owner = NULL;
}

/* --- ioctls ------------------------------------------------------------------------------------------------------- */

/* True if another file owns the buffers. It may have been closed just now. */
static bool taken(const struct sim_queue *q, const struct sim_open *o)
{
    return q->owner && q->owner != o && !sim_handle_settle(q->owner->handle);
}

static bool wrong_type(const struct sim_cam *cam, uint32_t type)
{
    return type != sim_cam_type(cam);
}

static bool wrong_memory(uint32_t memory)
{
    return memory != V4L2_MEMORY_MMAP && memory != V4L2_MEMORY_USERPTR && memory != V4L2_MEMORY_DMABUF;
}

static int request_buffers(struct sim_cam *cam, struct sim_open *o, struct sim_request *r)
{
    struct v4l2_requestbuffers *a = (struct v4l2_requestbuffers *)r->data;
    struct sim_queue *q = &cam->queue;
    int made = 0;

    if (wrong_type(cam, a->type) || wrong_memory(a->memory))
        return -EINVAL;
    a->capabilities = CAPABILITIES;
    a->flags = 0;
    memset(a->reserved, 0, sizeof(a->reserved));
    if (taken(q, o) || q->streaming || sim_cam_fault(cam, SST_SIM_FAULT_BUSY) > 0)
        return -EBUSY;
    sim_cam_queue_stop(cam, r);
    free_buffers(q);
    q->owner = NULL;
    if (a->count) {
        made = make_buffers(q, a->count, cam->format.sizeimage);
        if (made < 0)
            return made;
        q->memory = a->memory;
        q->owner = o;
    }
    a->count = (uint32_t)made;
    return 0;
}

static int create_buffers(struct sim_cam *cam, struct sim_open *o, struct sim_request *r)
{
    struct v4l2_create_buffers *a = (struct v4l2_create_buffers *)r->data;
    struct sim_queue *q = &cam->queue;
    const uint32_t bytes = a->format.fmt.pix.sizeimage;
    int made;

    if (wrong_type(cam, a->format.type) || wrong_memory(a->memory))
        return -EINVAL;
    a->index = q->count;
    a->capabilities = CAPABILITIES;
    a->flags = 0;
    memset(a->reserved, 0, sizeof(a->reserved));
    if (!a->count)
        return 0;
    if (taken(q, o))
        return -EBUSY;
    if (q->count == SST_SIM_CAM_BUFFERS)
        return -ENOBUFS;
    if ((q->count && q->memory != a->memory) || bytes < cam->format.sizeimage || bytes > 1u << OFFSET_SHIFT)
        return -EINVAL;
    made = make_buffers(q, a->count, bytes);
    if (made < 0)
        return made;
    q->memory = a->memory;
    q->owner = o;
    a->count = (uint32_t)made;
    return 0;
}

static int query_buffer(struct sim_cam *cam, struct v4l2_buffer *a)
{
    struct sim_queue *q = &cam->queue;

    if (wrong_type(cam, a->type) || a->index >= q->count)
        return -EINVAL;
    describe(q, a->index, a);
    return 0;
}

/* Accept the program's memory for a frame. */
static int accept_memory(const struct sim_cam *cam, struct sim_buffer *b, const struct v4l2_buffer *a,
                         struct sim_request *r)
{
    struct stat st;

    if (a->memory == V4L2_MEMORY_USERPTR) {
        if (a->length < cam->format.sizeimage)
            return -EINVAL;
        b->userptr = a->m.userptr;
        b->user_length = a->length;
    } else if (a->memory == V4L2_MEMORY_DMABUF) {
        if (r->fd < 0 || fstat(r->fd, &st) < 0 || !S_ISREG(st.st_mode) || st.st_size < (off_t)a->length ||
            (a->length ? a->length : st.st_size) < (off_t)cam->format.sizeimage)
            return -EINVAL;
        if (b->dmabuf >= 0)
            close(b->dmabuf);
        b->dmabuf = r->fd;
        r->fd = -1;
        b->dmabuf_number = a->m.fd;
        b->user_length = a->length ? a->length : (uint32_t)st.st_size;
    }
    return 0;
}

static int queue_buffer(struct sim_cam *cam, struct sim_open *o, struct sim_request *r, bool prepare)
{
    struct v4l2_buffer *a = (struct v4l2_buffer *)r->data;
    struct sim_queue *q = &cam->queue;
    struct sim_buffer *b;
    int err;

    if (taken(q, o))
        return -EBUSY;
    if (wrong_type(cam, a->type) || a->index >= q->count || a->memory != q->memory)
        return -EINVAL;
    b = &q->buffer[a->index];
    if (a->flags & V4L2_BUF_FLAG_REQUEST_FD)
        return prepare ? -EINVAL : -EBADR;
    if (b->state != SST_SIM_BUFFER_DEQUEUED || (prepare && b->prepared))
        return -EINVAL;
    err = b->prepared ? 0 : accept_memory(cam, b, a, r);
    if (err)
        return err;
    if (prepare) {
        b->prepared = true;
    } else {
        b->state = SST_SIM_BUFFER_QUEUED;
        b->prepared = false;
        q->queued[q->queued_count++] = a->index;
    }
    describe(q, a->index, a);
    return 0;
}

static int dequeue_buffer(struct sim_cam *cam, struct sim_open *o, struct sim_request *r)
{
    const struct v4l2_buffer *a = (const struct v4l2_buffer *)r->data;
    struct sim_queue *q = &cam->queue;

    if (taken(q, o))
        return -EBUSY;
    if (wrong_type(cam, a->type) || !q->streaming || (q->count && a->memory != q->memory))
        return -EINVAL;
    if (q->waiter)
        return -EBUSY; /* another thread waits for a frame */
    if (sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_EIO)))
        return -EIO;
    if (q->done_count) {
        dequeue(cam, r);
        r->drain = 1;
        return 0;
    }
    if (r->call.flags & SST_SIM_NONBLOCK)
        return -EAGAIN;
    q->waiter = r;
    return SST_SIM_LATER;
}

static int export_buffer(struct sim_cam *cam, struct sim_open *o, struct sim_request *r)
{
    struct sim_queue *q = &cam->queue;
    const struct v4l2_exportbuffer *a = (const struct v4l2_exportbuffer *)r->data;

    if (taken(q, o))
        return -EBUSY;
    if (wrong_type(cam, a->type) || q->memory != V4L2_MEMORY_MMAP || a->index >= q->count || a->plane ||
        (a->flags & ~(uint32_t)(O_CLOEXEC | O_ACCMODE)))
        return -EINVAL;
    r->out_fd = q->buffer[a->index].memory;
    return 0;
}

static int stream_on(struct sim_cam *cam, struct sim_open *o, int type)
{
    struct sim_queue *q = &cam->queue;
    int err;

    if (taken(q, o))
        return -EBUSY;
    if (wrong_type(cam, (uint32_t)type) || !q->count)
        return -EINVAL;
    if (q->streaming)
        return 0;
    q->streaming = true;
    q->turn = 0;
    err = sim_cam_start(cam);
    if (err)
        q->streaming = false;
    return err;
}

static int stream_off(struct sim_cam *cam, struct sim_open *o, struct sim_request *r, int type)
{
    if (taken(&cam->queue, o))
        return -EBUSY;
    if (wrong_type(cam, (uint32_t)type))
        return -EINVAL;
    sim_cam_queue_stop(cam, r);
    sim_array_rung(cam->array, cam->index, SST_SIM_RESTREAM);
    return 0;
}

int sim_cam_queue_ioctl(struct sim_cam *cam, struct sim_open *o, struct sim_request *r)
{
    int type;

    memcpy(&type, r->data, sizeof(type));
    switch (r->call.cmd) {
    case VIDIOC_DQBUF:
        return dequeue_buffer(cam, o, r);
    case VIDIOC_EXPBUF:
        return export_buffer(cam, o, r);
    case VIDIOC_STREAMON:
        return stream_on(cam, o, type);
    case VIDIOC_STREAMOFF:
        return stream_off(cam, o, r, type);
    case VIDIOC_REQBUFS:
        return request_buffers(cam, o, r);
    case VIDIOC_CREATE_BUFS:
        return create_buffers(cam, o, r);
    case VIDIOC_QUERYBUF:
        return query_buffer(cam, (struct v4l2_buffer *)r->data);
    case VIDIOC_QBUF:
        return queue_buffer(cam, o, r, false);
    case VIDIOC_PREPARE_BUF:
        return queue_buffer(cam, o, r, true);
    default:
        return -ENOTTY;
    }
}

int sim_cam_queue_map(struct sim_cam *cam, struct sim_request *r)
{
    const uint64_t index = r->call.arg >> OFFSET_SHIFT;
    const int prot = (int)(r->call.cmd >> 16), flags = (int)(r->call.cmd & 0xffff);
    struct sim_queue *q = &cam->queue;
    struct sim_buffer *b;

    if (q->memory != V4L2_MEMORY_MMAP || index >= q->count || (r->call.arg & ((1u << OFFSET_SHIFT) - 1)))
        return -EINVAL;
    b = &q->buffer[index];
    if (!(flags & MAP_SHARED) || !(prot & PROT_READ) || r->call.length > whole_pages(b->length))
        return -EINVAL;
    b->mapped = true;
    r->out_fd = b->memory;
    return 0;
}
