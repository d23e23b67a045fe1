/* V4L2 in the program: arrays of controls, user buffers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>

#include "simulators/devices/preload/preload_internal.h"

/* Copies a frame from the simulator's buffer to user memory. */
static int fill_user(const struct v4l2_buffer *b, int fd)
{
    uint32_t done = 0;

    while (done < b->bytesused) {
        const ssize_t n = pread(fd, (char *)b->m.userptr + done, b->bytesused - done, (off_t)done);

        if (n <= 0)
            return n < 0 ? -errno : -EIO;
        done += (uint32_t)n;
    }
    return 0;
}

static int dequeue(int fd, const struct sim_id *id, unsigned long request, void *arg)
{
    int memory = -1;
    int result = sim_ioctl_areas(fd, id, &(struct sim_ioctl){ request, arg, NULL, 0 }, &memory);

    if (memory >= 0) {
        const int saved = errno;
        const int err = result < 0 ? 0 : fill_user(arg, memory);

        errno = saved;
        if (err)
            result = err;
        (void)sim_next()->close_(memory);
    }
    return result;
}

/* Check that the program's buffer is writable, where the kernel would pin its pages. */
static int check_user(const struct v4l2_buffer *b)
{
    char byte;
    const char *memory = (const char *)b->m.userptr;

    if (!b->length)
        return 0; /* refused by the simulator */
    return sim_peek(&byte, memory, 1) || sim_peek(&byte, memory + b->length - 1, 1) ? -EFAULT : 0;
}

static int enqueue(int fd, const struct sim_id *id, unsigned long request, void *arg)
{
    struct v4l2_buffer b;
    int memory = -1, result;

    if (sim_peek(&b, arg, sizeof(b)))
        return -EFAULT;
    if (b.type == V4L2_BUF_TYPE_VIDEO_CAPTURE && b.memory == V4L2_MEMORY_USERPTR && check_user(&b))
        return -EFAULT;
    if (b.type == V4L2_BUF_TYPE_VIDEO_CAPTURE && b.memory == V4L2_MEMORY_DMABUF)
        memory = b.m.fd < 0 ? -1 : b.m.fd;
    result = sim_ioctl_areas(fd, id, &(struct sim_ioctl){ request, arg, NULL, 0 }, &memory);
    if (memory >= 0)
        (void)sim_next()->close_(memory);
    return result;
}

static int export_buffer(int fd, const struct sim_id *id, unsigned long request, void *arg)
{
    struct v4l2_exportbuffer *e = arg;
    int memory = -1;
    const int result = sim_ioctl_areas(fd, id, &(struct sim_ioctl){ request, arg, NULL, 0 }, &memory);

    if (result < 0)
        return result;
    if (!(e->flags & O_CLOEXEC))
        (void)sim_next()->fcntl_(memory, F_SETFD, 0);
    e->fd = memory;
    return result;
}

static int controls(int fd, const struct sim_id *id, unsigned long request, void *arg)
{
    struct v4l2_ext_controls c;

    if (sim_peek(&c, arg, sizeof(c)))
        return -EFAULT;
    if (c.count > V4L2_CID_MAX_CTRLS)
        return -EINVAL;
    return sim_ioctl_areas(
        fd, id,
        &(struct sim_ioctl){ request, arg,
                             &(struct sim_area){ .pointer_at = offsetof(struct v4l2_ext_controls, controls),
                                                 .bytes = c.count * sizeof(struct v4l2_ext_control) },
                             c.count ? 1 : 0 },
        NULL);
}

/* --- the multi-planar API: translated to the layout of the other one, with its own type --- */

static int planar_buffer(int fd, const struct sim_id *id, unsigned long request, struct v4l2_buffer *b)
{
    struct v4l2_buffer one = *b;
    struct v4l2_plane plane;
    int result;

    if (b->memory != V4L2_MEMORY_MMAP || !b->length)
        return -EINVAL;
    if (sim_peek(&plane, b->m.planes, sizeof(plane)))
        return -EFAULT;
    one.m.userptr = 0;
    one.length = 0;
    result = sim_ioctl_areas(fd, id, &(struct sim_ioctl){ request, &one, NULL, 0 }, NULL);
    if (result < 0)
        return result;
    plane = (struct v4l2_plane){ .bytesused = one.bytesused, .length = one.length, .m.mem_offset = one.m.offset };
    memcpy(b->m.planes, &plane, sizeof(plane));
    one.m.planes = b->m.planes;
    one.length = 1;
    one.bytesused = 0;
    *b = one;
    return result;
}

static int planar_format(int fd, const struct sim_id *id, unsigned long request, struct v4l2_format *f)
{
    const struct v4l2_pix_format_mplane in = f->fmt.pix_mp;
    struct v4l2_format one = { .type = f->type };
    struct v4l2_pix_format *p = &one.fmt.pix;
    int result;

    *p = (struct v4l2_pix_format){ in.width, in.height, in.pixelformat, in.field };
    result = sim_ioctl_areas(fd, id, &(struct sim_ioctl){ request, &one, NULL, 0 }, NULL);
    if (result < 0)
        return result;
    memset(&f->fmt, 0, sizeof(f->fmt));
    f->fmt.pix_mp = (struct v4l2_pix_format_mplane){ .width = p->width,
                                                     .height = p->height,
                                                     .pixelformat = p->pixelformat,
                                                     .field = p->field,
                                                     .colorspace = p->colorspace,
                                                     .num_planes = 1,
                                                     .plane_fmt[0] = { p->sizeimage, p->bytesperline, { 0 } } };
    return result;
}

/* Buffers and formats of the multi-planar API, which begin with other members. */
static bool is_planar(unsigned long request, const void *arg)
{
    struct v4l2_buffer b;
    uint32_t type;

    switch (request) {
    case VIDIOC_QUERYBUF:
    case VIDIOC_QBUF:
    case VIDIOC_PREPARE_BUF:
    case VIDIOC_DQBUF:
        return !sim_peek(&b, arg, sizeof(b)) && b.type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
    case VIDIOC_G_FMT:
    case VIDIOC_S_FMT:
    case VIDIOC_TRY_FMT:
        return !sim_peek(&type, arg, sizeof(type)) && type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
    default:
        return false;
    }
}

static int v4l2_ioctl(int fd, const struct sim_id *id, unsigned long request, void *arg)
{
    if (is_planar(request, arg))
        return request == VIDIOC_G_FMT || request == VIDIOC_S_FMT || request == VIDIOC_TRY_FMT
                   ? planar_format(fd, id, request, arg)
                   : planar_buffer(fd, id, request, arg);
    switch (request) {
    case VIDIOC_QBUF:
    case VIDIOC_PREPARE_BUF:
        return enqueue(fd, id, request, arg);
    case VIDIOC_DQBUF:
        return dequeue(fd, id, request, arg);
    case VIDIOC_EXPBUF:
        return export_buffer(fd, id, request, arg);
    case VIDIOC_G_EXT_CTRLS:
    case VIDIOC_S_EXT_CTRLS:
    case VIDIOC_TRY_EXT_CTRLS:
        return controls(fd, id, request, arg);
    default:
        return sim_ioctl_areas(fd, id, &(struct sim_ioctl){ request, arg, NULL, 0 }, NULL);
    }
}

const struct sim_class sim_class_v4l2 = {
    .letter = 'v',
    .ioctl_type = 'V',
    .ioctl = v4l2_ioctl,
    .read_calls = true,
    .write_calls = true,
};
