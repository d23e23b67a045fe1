/* Checks of the bytes of a frame: the size of a raw frame, the marker structure of a JPEG. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <linux/videodev2.h>
#include <string.h>

#include "drivers/grab/grab.h"
#include "drivers/grab/grab_internal.h"

#define LEAD_MAX 256 /* bytes: headers of a camera's own before a JPEG are shorter */

/* JPEG markers, ITU T.81 table B.1. */
enum {
    MARK_TEM = 0x01,
    MARK_SOF0 = 0xc0,
    MARK_DHT = 0xc4,
    MARK_JPG = 0xc8,
    MARK_DAC = 0xcc,
    MARK_SOF15 = 0xcf,
    MARK_RST0 = 0xd0,
    MARK_RST7 = 0xd7,
    MARK_SOI = 0xd8,
    MARK_EOI = 0xd9,
    MARK_SOS = 0xda,
};

struct walk {
    const uint8_t *at, *end;
    int width, height;
    int *size;           /* out: of a frame header that does not fit only by its size */
    bool sized, scanned; /* a frame header and a scan were seen */
};

static unsigned be16(const uint8_t *p)
{
    return (unsigned)p[0] << 8 | p[1];
}

static bool is_frame_header(uint8_t mark)
{
    return mark >= MARK_SOF0 && mark <= MARK_SOF15 && mark != MARK_DHT && mark != MARK_JPG && mark != MARK_DAC;
}

/* Frame header with its length field at p: the length against the components, and the size of the picture. */
static unsigned check_frame_header(const struct walk *w, const uint8_t *p, size_t length)
{
    if (w->sized || length < 8 || length != 8 + 3 * (size_t)p[7] || p[7] < 1 || p[7] > 4)
        return SST_FRAME_MARKER;
    w->size[0] = (int)be16(p + 5);
    w->size[1] = (int)be16(p + 3);
    return w->size[0] == w->width && w->size[1] == w->height ? 0 : SST_FRAME_MARKER | SST_FRAME_UNFIT;
}

static bool scan_header_fits(const struct walk *w, const uint8_t *p, size_t length)
{
    return w->sized && length >= 6 && length == 6 + 2 * (size_t)p[2] && p[2] >= 1 && p[2] <= 4;
}

/* From the first byte of coded data to the marker that ends it: FF 00 is a stuffed byte, FF D0..D7 restarts. */
static void skip_scan(struct walk *w)
{
    while (w->at < w->end) {
        const uint8_t *ff = memchr(w->at, 0xff, (size_t)(w->end - w->at));

        if (!ff || w->end - ff < 2) {
            w->at = w->end;
            return;
        }
        w->at = ff;
        if (ff[1] == 0xff) /* fill byte */
            w->at++;
        else if (ff[1] == 0 || (ff[1] >= MARK_RST0 && ff[1] <= MARK_RST7))
            w->at += 2;
        else
            return;
    }
}

/* One marker segment, w->at on its length field. */
static unsigned walk_segment(struct walk *w, uint8_t mark)
{
    const uint8_t *p = w->at;
    size_t length;

    if (w->end - p < 2)
        return SST_FRAME_NO_EOI;
    length = be16(p);
    if (length < 2)
        return SST_FRAME_MARKER;
    if ((size_t)(w->end - p) < length)
        return SST_FRAME_NO_EOI;
    w->at += length;
    if (is_frame_header(mark)) {
        const unsigned faults = check_frame_header(w, p, length);

        if (faults)
            return faults;
        w->sized = true;
    } else if (mark == MARK_SOS) {
        if (!scan_header_fits(w, p, length))
            return SST_FRAME_MARKER;
        w->scanned = true;
        skip_scan(w);
    }
    return 0;
}

/* Huffman tables may be missing, as UVC allows; bytes after the end marker are padding. */
static unsigned check_jpeg(int width, int height, const uint8_t *data, size_t bytes, int size[2])
{
    struct walk w = { data + 2, data + bytes, width, height, size, false, false };

    if (bytes < 2 || data[0] != 0xff || data[1] != MARK_SOI)
        return SST_FRAME_NO_SOI;
    while (w.end - w.at >= 2) {
        const uint8_t mark = w.at[1];
        unsigned faults;

        if (w.at[0] != 0xff)
            return SST_FRAME_MARKER;
        if (mark == 0xff) {
            w.at++;
            continue;
        }
        w.at += 2;
        if (mark == MARK_EOI)
            return w.scanned ? 0 : SST_FRAME_MARKER;
        if (mark == MARK_TEM)
            continue;
        if (mark < MARK_SOF0 || (mark >= MARK_RST0 && mark <= MARK_SOI))
            return SST_FRAME_MARKER;
        faults = walk_segment(&w, mark);
        if (faults)
            return faults;
    }
    return SST_FRAME_NO_EOI;
}

static bool is_jpeg(uint32_t fourcc)
{
    return fourcc == V4L2_PIX_FMT_MJPEG || fourcc == V4L2_PIX_FMT_JPEG;
}

unsigned frame_check(const struct sst_frame *f, size_t lead, int size[2])
{
    const size_t bytes = f->bytes - lead;

    if (!bytes)
        return SST_FRAME_EMPTY;
    if (is_jpeg(f->fourcc))
        return check_jpeg(f->width, f->height, f->data + lead, bytes, size);
    return bytes < raw_bytes(f->fourcc, f->width, f->height, f->stride) ? SST_FRAME_SHORT : 0;
}

size_t frame_lead(uint32_t fourcc, const uint8_t *data, size_t bytes)
{
    if (!is_jpeg(fourcc) || (bytes >= 2 && data[0] == 0xff && data[1] == MARK_SOI))
        return 0;
    for (size_t i = 1; i < LEAD_MAX && i + 3 <= bytes; i++)
        if (data[i] == 0xff && data[i + 1] == MARK_SOI && data[i + 2] == 0xff)
            return i;
    return 0;
}
