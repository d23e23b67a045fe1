/* Costs of the checks of every frame: marker walk, hash, and the other way to find frozen pictures, comparing with a
 * kept copy. usage: build/bench/frames [frame.jpg] */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <turbojpeg.h>

#include "base/clock.h"
#include "base/file.h"
#include "drivers/grab/grab_internal.h"

#define FRAMES 64 /* as many cameras' worth: together larger than a cache */
#define ROUNDS 10

static volatile uint64_t sink;

static unsigned char *make(unsigned long *bytes, int *width, int *height)
{
    uint8_t *rgb = malloc(1920 * 1080 * 3);
    unsigned char *jpeg = NULL;
    tjhandle tj = tjInitCompress();

    *width = 1920;
    *height = 1080;
    for (size_t i = 0; i < 1920 * 1080 * 3; i++) {
        const size_t x = i / 3 % 1920, y = i / 3 / 1920;

        rgb[i] = (uint8_t)((x * y >> 7) + (i * 2654435761u >> 28));
    }
    if (tjCompress2(tj, rgb, 1920, 0, 1080, TJPF_RGB, &jpeg, bytes, TJSAMP_422, 85, 0))
        exit(1);
    tjDestroy(tj);
    free(rgb);
    return jpeg;
}

static void report(const char *name, int64_t begin_ns, size_t bytes)
{
    const double ns = (double)(sst_clock_now_ns() - begin_ns) / (FRAMES * ROUNDS);

    printf("%-24s %8.1f us a frame, %6.2f GB/s\n", name, ns * 1e-3, (double)bytes / ns);
}

int main(int argc, char **argv)
{
    int size[2];
    unsigned long jpeg_bytes = 0;
    unsigned char *jpeg = NULL;
    size_t bytes = 0;
    uint8_t *frames, *kept;
    int width = 0, height = 0;
    int64_t begin;

    if (argc > 1) {
        if (sst_file_read(argv[1], 1 << 26, &jpeg, &bytes) ||
            tjDecompressHeader(tjInitDecompress(), jpeg, bytes, &width, &height))
            return 1;
    } else {
        jpeg = make(&jpeg_bytes, &width, &height);
        bytes = jpeg_bytes;
    }
    frames = malloc(FRAMES * bytes);
    kept = malloc(FRAMES * bytes);
    for (int i = 0; i < FRAMES; i++)
        memcpy(frames + (size_t)i * bytes, jpeg, bytes);
    memset(kept, 0, FRAMES * bytes);
    printf("%dx%d, %zu bytes, faults %u\n", width, height, bytes,
           frame_check(&(struct sst_frame){ .fourcc = V4L2_PIX_FMT_MJPEG,
                                            .width = width,
                                            .height = height,
                                            .stride = 0,
                                            .data = frames,
                                            .bytes = bytes },
                       0, size));
    begin = sst_clock_now_ns();
    for (int i = 0; i < FRAMES * ROUNDS; i++)
        sink += frame_check(&(struct sst_frame){ .fourcc = V4L2_PIX_FMT_MJPEG,
                                                 .width = width,
                                                 .height = height,
                                                 .stride = 0,
                                                 .data = frames + (size_t)(i % FRAMES) * bytes,
                                                 .bytes = bytes },
                            0, size);
    report("marker walk", begin, bytes);
    begin = sst_clock_now_ns();
    for (int i = 0; i < FRAMES * ROUNDS; i++)
        sink += sst_grab_hash(frames + (size_t)(i % FRAMES) * bytes, bytes);
    report("hash", begin, bytes);
    begin = sst_clock_now_ns();
    for (int i = 0; i < FRAMES * ROUNDS; i++) {
        const size_t at = (size_t)(i % FRAMES) * bytes;

        /* Frames that differ do so early; the copy has the costs. */
        sink += (uint64_t)memcmp(kept + at, frames + at, 1024);
        memcpy(kept + at, frames + at, bytes);
    }
    report("compare and keep a copy", begin, bytes);
    return 0;
}
