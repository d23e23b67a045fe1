/* V4L2 in the program: arrays of controls, user buffers. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stddef.h>
#include <unistd.h>

#include "simulators/devices/preload/preload_internal.h"

/* User memory is filled here: the frame lies in a buffer of the simulator's. */
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
    int result = sim_ioctl_areas(fd, id, request, arg, NULL, 0, &memory);

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

/* Can the program's memory take the frame? The kernel would pin its pages here. */
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
    result = sim_ioctl_areas(fd, id, request, arg, NULL, 0, &memory);
    if (memory >= 0)
        (void)sim_next()->close_(memory);
    return result;
}

static int export_buffer(int fd, const struct sim_id *id, unsigned long request, void *arg)
{
    struct v4l2_exportbuffer *e = arg;
    int memory = -1;
    const int result = sim_ioctl_areas(fd, id, request, arg, NULL, 0, &memory);

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
    return sim_ioctl_areas(fd, id, request, arg,
                           &(struct sim_area){ .pointer_at = offsetof(struct v4l2_ext_controls, controls),
                                               .bytes = c.count * sizeof(struct v4l2_ext_control) },
                           c.count ? 1 : 0, NULL);
}

static int v4l2_ioctl(int fd, const struct sim_id *id, unsigned long request, void *arg)
{
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
        return sim_ioctl_areas(fd, id, request, arg, NULL, 0, NULL);
    }
}

const struct sim_class sim_class_v4l2 = {
    .letter = 'v',
    .ioctl_type = 'V',
    .ioctl = v4l2_ioctl,
    .read_calls = true,
    .write_calls = true,
};
