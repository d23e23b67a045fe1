/* MJPEG into v4l2loopback nodes until SIGTERM: eight pictures in turn, also written to files 0..7 of the current
   folder. feed WIDTH HEIGHT RATE_HZ CUT_EVERY NODE...   (each CUT_EVERY-th frame ends early; 0: none) */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <fcntl.h>
#include <linux/videodev2.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <turbojpeg.h>
#include <unistd.h>

#include "base/base.h"

#define PICTURES 8

static volatile sig_atomic_t ended;

static void end(int sig)
{
    ended = sig;
}

/* A slope with a bar that moves: every picture has bytes, and a length, of its own. */
static unsigned char *picture(int n, int width, int height, unsigned long *bytes)
{
    unsigned char *grey = malloc((size_t)width * (size_t)height), *jpeg = NULL;
    tjhandle tj = tjInitCompress();
    char name[16];
    FILE *f;

    if (!grey || !tj)
        exit(1);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            grey[y * width + x] = (unsigned char)(x / (10 * (n + 1)) == n ? 255 : (x + y * (n + 1)) & 255);
    if (tjCompress2(tj, grey, width, 0, height, TJPF_GRAY, &jpeg, bytes, TJSAMP_GRAY, 80, 0))
        exit(1);
    snprintf(name, sizeof(name), "%d", n);
    f = fopen(name, "wb");
    if (!f || fwrite(jpeg, 1, *bytes, f) != *bytes || fclose(f))
        exit(1);
    tjDestroy(tj);
    free(grey);
    return jpeg;
}

static int node(const char *path, int width, int height)
{
    struct v4l2_format f = { .type = V4L2_BUF_TYPE_VIDEO_OUTPUT };
    const int fd = open(path, O_RDWR);

    f.fmt.pix = (struct v4l2_pix_format){ .width = (unsigned)width,
                                          .height = (unsigned)height,
                                          .pixelformat = V4L2_PIX_FMT_MJPEG,
                                          .field = V4L2_FIELD_NONE };
    if (fd < 0 || ioctl(fd, VIDIOC_S_FMT, &f)) {
        perror(path);
        exit(1);
    }
    return fd;
}

int main(int argc, char **argv)
{
    const int width = argc > 5 ? atoi(argv[1]) : 0, height = argc > 5 ? atoi(argv[2]) : 0, nodes = argc - 5;
    unsigned char *jpeg[PICTURES];
    unsigned long bytes[PICTURES];
    int fd[64], cut_every;
    struct timespec due;
    long period_ns;

    if (width < 16 || height < 16 || nodes > (int)ARRAY_LEN(fd))
        return 2;
    period_ns = (long)(1e9 / atof(argv[3]));
    cut_every = atoi(argv[4]);
    for (int i = 0; i < PICTURES; i++)
        jpeg[i] = picture(i, width, height, &bytes[i]);
    for (int i = 0; i < nodes; i++)
        fd[i] = node(argv[5 + i], width, height);
    signal(SIGTERM, end);
    puts("feeding");
    fflush(stdout);
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (int n = 0; !ended; n++) {
        const int i = n % PICTURES;
        const bool cut = cut_every && n % cut_every == cut_every - 1;

        for (int k = 0; k < nodes; k++) {
            if (write(fd[k], jpeg[i], cut ? bytes[i] / 2 : bytes[i]) < 0)
                perror(argv[5 + k]);
        }
        due.tv_nsec += period_ns;
        due.tv_sec += due.tv_nsec / 1000000000;
        due.tv_nsec %= 1000000000;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
    }
    return 0;
}
