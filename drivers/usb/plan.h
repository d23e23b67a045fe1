/* drivers/usb/plan.h - will these cameras stream together? The kernel's bandwidth rules, before streaming. */
#ifndef SST_DRIVERS_USB_PLAN_H
#define SST_DRIVERS_USB_PLAN_H

#include "drivers/usb/usb.h"

SST_EXTERN_C_BEGIN

struct sst_usb_stream {
    int device;             /* index in the list of sst_usb_list() */
    int64_t needed_bytes_s; /* what the format and rate take at most; 0: unknown, as many MJPEG cameras say: worst case */
    int alt;                /* out: the setting that uvcvideo picks, or -1: none is large enough */
    double reserved_mbit;   /* out */
    int segment;            /* out: index of the segment that it loads most */
    bool fits;              /* out */
};

/** A piece of wire that streams share: a high-speed bus or transaction translator, or a SuperSpeed link. */
struct sst_usb_segment {
    char name[SST_USB_TEXT_MAX]; /* "high-speed bus of controller 0000:00:14.0", "hub 1-2 (TT)" */
    double limit_mbit, reserved_mbit;
    int streams;
    bool over; /* STREAMON of the last of them would fail with ENOSPC */
};

struct sst_usb_plan {
    struct sst_usb_segment *segments; /* to free with free() */
    int segment_count, over;
};

/** Reserve the streams in order; outputs are filled in `streams`. @return 0, -ENOMEM; a plan that does not fit is 0. */
SST_MUST_CHECK int sst_usb_plan(struct sst_usb_plan *out, const struct sst_usb_device *devices, int count,
                                struct sst_usb_stream *streams, int stream_count);

SST_EXTERN_C_END

#endif
