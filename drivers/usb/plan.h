/*
 * drivers/usb/plan.h - plan of the USB bandwidth: which cameras can stream together, by the kernel's rules.
 *
 * A streaming camera reserves the packet of its alternate setting in every (micro)frame, used or not. Limits of the
 * wires:
 * - High speed: the time of all packets of a microframe, worst-case bit stuffing included, is at most 80 %, 100 of
 *   125 us; as Linux computes it for EHCI, where a controller has one high-speed bus. xHCI controllers compute it
 *   themselves. Intel's have one bus per root port and count in blocks of 4 bytes (26 more per packet, at most
 *   80 % of 1607); the formula is known from Linux, which applies it for an early controller. For other controllers it
 *   is unknown; one bus for the whole controller is assumed, so they may carry more than planned.
 * - Full speed: 900 of 1000 us of a frame in a transaction translator of the nearest high-speed hub (one for all its
 *   ports, or one each), which also uses time of the high-speed bus.
 * - SuperSpeed: 90 % of a link of 5, 10 or 20 Gbit/s less its line coding, on each link up to the root port.
 * Interrupt endpoints (hubs, mice) and microphones are not counted: keep 10 % free for them.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_USB_PLAN_H
#define SST_DRIVERS_USB_PLAN_H

#include "drivers/usb/usb.h"

struct sst_usb_stream {
    int device;             /* index in the list of sst_usb_list() */
    int64_t needed_bytes_s; /* maximum of format and rate; 0: unknown (many MJPEG cameras report the worst case) */
    int alt;                /* out: the setting that uvcvideo selects, or -1: none is large enough or known */
    double reserved_mbit;   /* out: reserved on its segment, with overhead; 0 for bulk streaming */
    int segment;            /* out: index of the segment that it loads most */
    bool fits;              /* out */
};

/** A piece of wire that streams share: a high-speed bus or transaction translator, or a SuperSpeed link. */
struct sst_usb_segment {
    char name[SST_USB_TEXT_MAX];      /* "high-speed bus of controller 0000:00:14.0", "hub 1-2 (TT)" */
    double limit_mbit, reserved_mbit; /* reserved: by the streams that fit */
    int streams, refused;             /* STREAMON of the refused ones fails with ENOSPC */
};

struct sst_usb_plan {
    struct sst_usb_segment *segments; /* used by the streams; to free with free() */
    int segment_count;
    int refused; /* streams */
};

/** Data rate of a raw format with w x h pixels at rate_hz; 0 for compressed and unknown formats. */
int64_t sst_usb_format_bytes_s(uint32_t fourcc, int width, int height, double rate_hz);

/** Reserve bandwidth for the streams in order; one that does not fit reserves nothing. Fills the outputs of `streams`.
 *  @return 0 (also if not all fit), -ENOMEM */
SST_MUST_CHECK int sst_usb_plan(struct sst_usb_plan *out, const struct sst_usb_device *devices, int count,
                                struct sst_usb_stream *streams, int stream_count);

#endif
