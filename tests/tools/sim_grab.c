/* Grabs from a simulated camera by V4L2 calls of its own, reads each frame's strip, and prints one line per frame:
 *   camera trigger t_ns stamp_ns sequence flags bytes
 * usage: sim_grab DEVICE COUNT [FOURCC [WIDTHxHEIGHT [TRIGGER_MODE]]], or sim_grab --luma FILE WIDTHxHEIGHT
 * Exit status 0; 1: a frame without a good strip; 2: a call failed, its name and errno on standard error; 3: no frame
 * in a minute (-t MS before everything else: another limit). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <turbojpeg.h>

#include "tests/strip_read.h"

#define BUFFERS 16 /* more than a test wants frames of: none is lost while we stand still */

static int failed(const char *call)
{
    fprintf(stderr, "%s: %s\n", call, strerror(errno));
    return 2;
}

/* Luma of a frame: malloc'ed, width * height. */
static uint8_t *luma_of(const struct v4l2_pix_format *p, const uint8_t *data, size_t bytes)
{
    const size_t n = (size_t)p->width * p->height;
    uint8_t *luma = calloc(n, 1);

    if (luma && p->pixelformat == V4L2_PIX_FMT_MJPEG) {
        tjhandle tj = tjInitDecompress();

        /* also warnings: a frame must be wholly valid */
        if (tjDecompress2(tj, data, bytes, luma, (int)p->width, 0, (int)p->height, TJPF_GRAY, TJFLAG_STOPONWARNING)) {
            free(luma);
            luma = NULL;
        }
        tjDestroy(tj);
    } else if (luma) {
        const size_t step = p->sizeimage / n;

        for (size_t i = 0; i < n && (i + 1) * step <= bytes; i++)
            luma[i] = data[i * step + (p->pixelformat == V4L2_PIX_FMT_Y16)];
    }
    return luma;
}

static int print_frame(const uint8_t *luma, int width, int height, const struct v4l2_buffer *b)
{
    struct sst_sim_exposure e;

    if (!luma || strip_read(luma, (size_t)width, width, height, &e)) {
        printf("bad strip, sequence %u flags %x bytes %u\n", b->sequence, b->flags, b->bytesused);
        return 1;
    }
    printf("%d %llu %lld %lld %u %u %u\n", e.cam, (unsigned long long)e.trigger, (long long)e.t_ns,
           (long long)b->timestamp.tv_sec * 1000000000 + (long long)b->timestamp.tv_usec * 1000, b->sequence,
           b->flags & V4L2_BUF_FLAG_ERROR, b->bytesused);
    (void)fflush(stdout);
    return 0;
}

static int set_up(int fd, struct v4l2_format *f, int trigger, uint8_t *memory[BUFFERS], size_t *length)
{
    struct v4l2_requestbuffers r = { .count = BUFFERS,
                                     .type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
                                     .memory = V4L2_MEMORY_MMAP };
    struct v4l2_control c = { .id = V4L2_CID_CAMERA_CLASS_BASE + 0x1000, .value = trigger };

    if (ioctl(fd, VIDIOC_S_FMT, f))
        return failed("S_FMT");
    if (ioctl(fd, VIDIOC_S_CTRL, &c))
        return failed("S_CTRL");
    if (ioctl(fd, VIDIOC_REQBUFS, &r))
        return failed("REQBUFS");
    for (uint32_t i = 0; i < BUFFERS; i++) {
        struct v4l2_buffer b = { .index = i, .type = r.type, .memory = r.memory };

        if (ioctl(fd, VIDIOC_QUERYBUF, &b))
            return failed("QUERYBUF");
        *length = b.length;
        memory[i] = mmap(NULL, b.length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, b.m.offset);
        if (memory[i] == MAP_FAILED)
            return failed("mmap");
        if (ioctl(fd, VIDIOC_QBUF, &b))
            return failed("QBUF");
    }
    if (ioctl(fd, VIDIOC_STREAMON, &r.type))
        return failed("STREAMON");
    return 0;
}

static int grab(int fd, const struct v4l2_format *f, int count, int limit_ms, uint8_t *const memory[BUFFERS])
{
    int status = 0;

    for (int n = 0; n < count; n++) {
        struct pollfd p = { .fd = fd, .events = POLLIN };
        struct v4l2_buffer b = { .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP };
        uint8_t *luma;

        if (poll(&p, 1, limit_ms) != 1)
            return 3;
        if (ioctl(fd, VIDIOC_DQBUF, &b))
            return failed("DQBUF");
        luma = luma_of(&f->fmt.pix, memory[b.index], b.bytesused);
        if (print_frame(luma, (int)f->fmt.pix.width, (int)f->fmt.pix.height, &b))
            status = 1;
        free(luma);
        if (ioctl(fd, VIDIOC_QBUF, &b))
            return failed("QBUF");
    }
    return status;
}

static int read_luma(const char *path, int width, int height)
{
    const struct v4l2_buffer none = { 0 };
    uint8_t *luma = calloc((size_t)width, (size_t)height);
    FILE *in = fopen(path, "rb");
    int status = 2;

    if (in && luma && fread(luma, (size_t)width, (size_t)height, in) == (size_t)height)
        status = print_frame(luma, width, height, &none);
    if (in)
        (void)fclose(in);
    free(luma);
    return status;
}

int main(int argc, char **argv)
{
    struct v4l2_format f = { .type = V4L2_BUF_TYPE_VIDEO_CAPTURE };
    uint8_t *memory[BUFFERS] = { NULL };
    int width = 640, height = 480, fd, status, limit_ms = 60000;
    size_t length = 0;

    if (argc > 2 && strcmp(argv[1], "-t") == 0) {
        limit_ms = atoi(argv[2]);
        argc -= 2;
        argv += 2;
    }
    if (argc < 3)
        return 2;
    if (argc > 4 || strcmp(argv[1], "--luma") == 0)
        (void)sscanf(argv[argc > 4 ? 4 : 3], "%dx%d", &width, &height);
    if (strcmp(argv[1], "--luma") == 0)
        return read_luma(argv[2], width, height);
    f.fmt.pix.width = (uint32_t)width;
    f.fmt.pix.height = (uint32_t)height;
    f.fmt.pix.pixelformat = V4L2_PIX_FMT_MJPEG;
    if (argc > 3)
        memcpy(&f.fmt.pix.pixelformat, argv[3], 4);
    fd = open(argv[1], O_RDWR | O_CLOEXEC);
    if (fd < 0)
        return failed("open");
    status = set_up(fd, &f, argc > 5 ? atoi(argv[5]) : 0, memory, &length);
    if (!status)
        status = grab(fd, &f, atoi(argv[2]), limit_ms, memory);
    for (int i = 0; i < BUFFERS; i++)
        if (memory[i] && memory[i] != MAP_FAILED)
            (void)munmap(memory[i], length);
    (void)close(fd);
    return status;
}
