/* simulators/devices/usb/usb_descriptors.c - descriptors of hubs, UVC cameras and still cameras. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "simulators/devices/usb/usb_internal.h"

/* pid.codes reserves these numbers for private tests. */
#define VENDOR         0x1209
#define PRODUCT_CAMERA 0x0001
#define PRODUCT_HUB    0x0002
#define PRODUCT_HUB3   0x0003
#define PRODUCT_STILL  0x0004
#define VENDOR_LINUX   0x1d6b

#define VIDEO_CLASS    0x0e
#define STILL_CLASS    0x06
#define FRAME_INTERVAL 333333 /* 100 ns */

/** Writes consecutive descriptors; bytes that do not fit are still counted. */
struct writer {
    uint8_t *out;
    size_t size, at;
};

static void put(struct writer *w, unsigned value, int bytes)
{
    for (int i = 0; i < bytes; i++, w->at++)
        if (w->at < w->size)
            w->out[w->at] = (uint8_t)(value >> (8 * i));
}

static void put_bytes(struct writer *w, const uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++)
        put(w, bytes[i], 1);
}

#define PUT(w, ...) put_bytes(w, (const uint8_t[]){ __VA_ARGS__ }, sizeof((const uint8_t[]){ __VA_ARGS__ }))

/** Patch a length that was not known before. */
static void patch16(struct writer *w, size_t at, size_t value)
{
    struct writer there = { w->out, w->size, at };

    put(&there, (unsigned)value, 2);
}

static void device_descriptor(struct writer *w, const struct sst_sim_usb_device *d)
{
    const bool super = d->speed_mbit >= 5000;
    const bool camera = d->kind == SST_SIM_USB_CAMERA, root = d->kind == SST_SIM_USB_ROOT;
    const bool still = d->kind == SST_SIM_USB_STILL;

    PUT(w, 18, 1);
    put(w, super ? 0x0300 : 0x0200, 2);
    if (camera)
        PUT(w, 0xef, 0x02, 0x01, 64); /* interface association */
    else if (still)
        PUT(w, 0, 0, 0, 64); /* by interface */
    else
        PUT(w, 0x09, 0x00, super ? 3 : root || d->single_tt ? 1 : 2, super ? 9 : 64);
    put(w, root ? VENDOR_LINUX : VENDOR, 2);
    put(w,
        camera  ? PRODUCT_CAMERA
        : still ? PRODUCT_STILL
        : root  ? (super ? 3 : 2)
        : super ? PRODUCT_HUB3
                : PRODUCT_HUB,
        2);
    put(w, root ? 0x0601 : 0x0100, 2);
    PUT(w, 1, 2, camera || root || still ? 3 : 0, 1);
}

static void hub_configuration(struct writer *w, const struct sst_sim_usb_device *d)
{
    const bool super = d->speed_mbit >= 5000;

    PUT(w, 9, 4, 0, 0, 1, 0x09, 0x00, super || d->single_tt || d->kind == SST_SIM_USB_ROOT ? 0 : 1, 0);
    PUT(w, 7, 5, 0x81, 0x03, super ? 2 : 1, 0, super ? 8 : 12);
    if (super)
        PUT(w, 6, 0x30, 0, 0, 2, 0);
}

static void video_control(struct writer *w)
{
    PUT(w, 8, 0x0b, 0, 2, VIDEO_CLASS, 0x03, 0x00, 2);
    PUT(w, 9, 4, 0, 0, 1, VIDEO_CLASS, 0x01, 0x00, 0);
    PUT(w, 13, 0x24, 0x01, 0x10, 0x01, 52, 0, 0x00, 0x6c, 0xdc, 0x02, 1, 1);            /* header, UVC 1.1 */
    PUT(w, 18, 0x24, 0x02, 1, 0x01, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0x0a, 0x00, 0x00); /* sensor: exposure */
    PUT(w, 12, 0x24, 0x05, 2, 1, 0, 0, 2, 0x4b, 0x16, 0, 0);                            /* brightness, gain ... */
    PUT(w, 9, 0x24, 0x03, 3, 0x01, 0x01, 0, 2, 0);                                      /* output terminal */
    PUT(w, 7, 5, 0x83, 0x03, 16, 0, 6);
    PUT(w, 5, 0x25, 0x03, 16, 0);
}

/** One size of a format; bit rates and buffers for two bytes per pixel. */
static void video_frame(struct writer *w, int subtype, int index, int width, int height)
{
    const unsigned bytes = (unsigned)width * (unsigned)height * 2;

    PUT(w, 30, 0x24, (uint8_t)subtype, (uint8_t)index, 0);
    put(w, (unsigned)width, 2);
    put(w, (unsigned)height, 2);
    put(w, bytes * 8, 4);
    put(w, bytes * 8, 4);
    put(w, bytes, 4);
    put(w, FRAME_INTERVAL, 4);
    PUT(w, 1);
    put(w, FRAME_INTERVAL, 4);
}

static void video_formats(struct writer *w, const struct sst_sim_usb *usb)
{
    static const uint8_t yuy2[] = { 'Y', 'U', 'Y', '2', 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71 };
    const size_t start = w->at;

    PUT(w, 15, 0x24, 0x01, 2, 0, 0, 0x81, 0, 3, 0, 0, 0, 1, 0, 0);         /* header; its length is patched below */
    PUT(w, 11, 0x24, 0x06, 1, (uint8_t)usb->size_count, 1, 1, 0, 0, 0, 0); /* motion JPEG */
    for (int i = 0; i < usb->size_count; i++)
        video_frame(w, 0x07, i + 1, usb->sizes[i][0], usb->sizes[i][1]);
    PUT(w, 6, 0x24, 0x0d, 1, 1, 4);
    PUT(w, 27, 0x24, 0x04, 2, (uint8_t)usb->size_count); /* YUYV */
    put_bytes(w, yuy2, sizeof(yuy2));
    PUT(w, 16, 1, 0, 0, 0, 0);
    for (int i = 0; i < usb->size_count; i++)
        video_frame(w, 0x05, i + 1, usb->sizes[i][0], usb->sizes[i][1]);
    PUT(w, 6, 0x24, 0x0d, 1, 1, 4);
    patch16(w, start + 4, w->at - start);
}

static void camera_configuration(struct writer *w, const struct sst_sim_usb *usb, const struct sst_sim_usb_device *d)
{
    const struct sst_sim_usb_alt *alts;
    const int count = sst_sim_usb_alts(d->speed_mbit, &alts);

    video_control(w);
    PUT(w, 9, 4, 1, 0, 0, VIDEO_CLASS, 0x02, 0x00, 0);
    video_formats(w, usb);
    for (int i = 0; i < count; i++) {
        PUT(w, 9, 4, 1, (uint8_t)(i + 1), 1, VIDEO_CLASS, 0x02, 0x00, 0);
        PUT(w, 7, 5, 0x81, 0x05); /* isochronous, asynchronous */
        put(w, (unsigned)alts[i].packet | (unsigned)(alts[i].per_microframe - 1) << 11, 2);
        PUT(w, 1);
    }
}

/** Still image class, PTP: bulk in, bulk out, interrupt in. */
static void still_configuration(struct writer *w)
{
    PUT(w, 9, 4, 0, 0, 3, STILL_CLASS, 0x01, 0x01, 0);
    PUT(w, 7, 5, SST_SIM_USB_BULK_IN, 0x02);
    put(w, SST_SIM_USB_BULK_PACKET, 2);
    PUT(w, 0, 7, 5, SST_SIM_USB_BULK_OUT, 0x02);
    put(w, SST_SIM_USB_BULK_PACKET, 2);
    PUT(w, 0, 7, 5, SST_SIM_USB_INTERRUPT_IN, 0x03, 64, 0, 9);
}

int sst_sim_usb_descriptors(const struct sst_sim_usb *usb, int device, uint8_t *out, size_t size)
{
    const struct sst_sim_usb_device *d = &usb->device[device];
    const uint8_t self = d->kind == SST_SIM_USB_STILL ? 0xc0 : 0xe0, power = d->kind == SST_SIM_USB_CAMERA ? 250 : 0;
    struct writer w = { out, size, 0 };
    size_t start;

    device_descriptor(&w, d);
    start = w.at;
    PUT(&w, 9, 2, 0, 0, (uint8_t)d->interfaces, 1, 0, d->kind == SST_SIM_USB_CAMERA ? 0x80 : self, power);
    if (d->kind == SST_SIM_USB_CAMERA)
        camera_configuration(&w, usb, d);
    else if (d->kind == SST_SIM_USB_STILL)
        still_configuration(&w);
    else
        hub_configuration(&w, d);
    patch16(&w, start + 2, w.at - start);
    return w.at <= size ? (int)w.at : -ENOSPC;
}

int sst_sim_usb_interface_class(const struct sst_sim_usb *usb, int device, int interface, uint8_t triple[3])
{
    uint8_t bytes[4096];
    const int count = sst_sim_usb_descriptors(usb, device, bytes, sizeof(bytes));

    for (int at = 0; at < count; at += bytes[at]) {
        if (bytes[at + 1] == 4 && bytes[at + 2] == interface && bytes[at + 3] == 0) {
            memcpy(triple, bytes + at + 5, 3);
            return 0;
        }
    }
    return -EINVAL;
}
