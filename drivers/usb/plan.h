/*
 * drivers/usb/plan.h - will these cameras stream together? The kernel's bandwidth rules, before streaming.
 *
 * A camera that streams reserves its alternate setting's packet in every (micro)frame, used or not. What wires carry:
 * - High speed: the time of all packets of a microframe, worst-case bit stuffing included, is at most 80 %, 100 of
 *   125 us; as Linux adds it up for EHCI, where a controller has one high-speed bus. xHCI controllers add it up
 *   themselves. Those of Intel give each root port a bus of its own and reckon in blocks of 4 bytes (26 more a packet,
 * at most 80 % of 1607); Linux knows these sums because it must do them for an early one. Of others it is unknown, and
 * one bus for the whole controller is assumed, as the least that there must be: they may take more than planned.
 * - Full speed: 900 of 1000 us of a frame in a transaction translator of the nearest high-speed hub (one for all its
 *   ports, or one each), which takes time of the high-speed bus too.
 * - SuperSpeed: 90 % of a link of 5, 10 or 20 Gbit/s less its line coding, on each link up to the root port.
 * Interrupt endpoints (hubs, mice) and microphones are not counted: keep 10 % free for them.
 */
#ifndef SST_DRIVERS_USB_PLAN_H
#define SST_DRIVERS_USB_PLAN_H

#include "drivers/usb/usb.h"

struct sst_usb_stream {
    int device; /* index in the list of sst_usb_list() */
    int64_t
        needed_bytes_s;   /* what the format and rate take at most; 0: unknown, as many MJPEG cameras say: worst case */
    int alt;              /* out: the setting that uvcvideo picks, or -1: none is large enough, or none is known */
    double reserved_mbit; /* out: what it asks of its segment, overheads included; nothing if it streams in bulk */
    int segment;          /* out: index of the segment that it loads most */
    bool fits;            /* out */
};

/** A piece of wire that streams share: a high-speed bus or transaction translator, or a SuperSpeed link. */
struct sst_usb_segment {
    char name[SST_USB_TEXT_MAX];      /* "high-speed bus of controller 0000:00:14.0", "hub 1-2 (TT)" */
    double limit_mbit, reserved_mbit; /* reserved: by the streams that fit */
    int streams, refused;             /* STREAMON of the refused ones fails with ENOSPC */
};

struct sst_usb_plan {
    struct sst_usb_segment *segments; /* those that the streams use; to free with free() */
    int segment_count;
    int refused; /* streams */
};

/** What a raw format takes: all of w x h pixels at rate_hz; 0 for compressed and unknown formats. */
int64_t sst_usb_format_bytes_s(uint32_t fourcc, int width, int height, double rate_hz);

/** Reserve the streams in order, one that does not fit reserves nothing; outputs are filled in `streams`.
 *  @return 0, -ENOMEM; a plan that does not fit is 0. */
SST_MUST_CHECK int sst_usb_plan(struct sst_usb_plan *out, const struct sst_usb_device *devices, int count,
                                struct sst_usb_stream *streams, int stream_count);

#endif
