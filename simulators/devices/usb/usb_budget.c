/* simulators/devices/usb/usb_budget.c - periodic bandwidth of buses and transaction translators. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "simulators/devices/usb/usb_internal.h"

/* Periodic transfers may take 80 % of a microframe, which is 125 us, and 90 % of a frame, which is 1000 us. */
#define HIGH_LIMIT_US 100
#define FULL_LIMIT_US 900

int sst_sim_usb_alts(int speed_mbit, const struct sst_sim_usb_alt **alts)
{
    static const struct sst_sim_usb_alt high[] = { { 128, 1 }, { 256, 1 },  { 384, 1 }, { 512, 1 },
                                                   { 640, 1 }, { 800, 1 },  { 944, 1 }, { 1024, 1 },
                                                   { 800, 2 }, { 1024, 2 }, { 1024, 3 } };
    static const struct sst_sim_usb_alt full[] = { { 128, 1 }, { 256, 1 }, { 512, 1 }, { 768, 1 }, { 1023, 1 } };

    *alts = speed_mbit >= 480 ? high : full;
    return speed_mbit >= 480 ? (int)ARRAY_LEN(high) : (int)ARRAY_LEN(full);
}

int sst_sim_usb_packet_us(int speed_mbit, int bytes)
{
    /* USB 2.0, 5.11.3, isochronous input, in picoseconds. Bit stuffing makes bytes up to 7/6 longer: 7 * 8 / 6 bits. */
    const int64_t bits = 7 * 8 * (int64_t)bytes / 6;
    int64_t ps;

    if (speed_mbit >= 480)
        ps = 38 * 8 * 2083 + 2083 * (3 + bits) + 5000; /* 5 ns: host delay */
    else
        ps = 7268000 + 8354 * (31 + 10 * bits) + 1000000; /* 83.54 ns per bit; 1 us: host delay */
    return (int)((ps + 999999) / 1000000);
}

static int reserved_us(const struct sst_sim_usb_device *d)
{
    const struct sst_sim_usb_alt *alts;

    if (d->alt == 0)
        return 0;
    (void)sst_sim_usb_alts(d->speed_mbit, &alts);
    return sst_sim_usb_packet_us(d->speed_mbit, alts[d->alt - 1].packet * alts[d->alt - 1].per_microframe);
}

/** True if both share one transaction translator, of the hub or of the port. */
static bool same_translator(const struct sst_sim_usb *usb, const struct sst_sim_usb_device *a,
                            const struct sst_sim_usb_device *b)
{
    return a->parent == b->parent && (usb->device[a->parent].single_tt || a->port == b->port);
}

/** @return true if a camera with this setting fits beside the streaming ones. */
static bool fits(struct sst_sim_usb *usb, const struct sst_sim_usb_device *d)
{
    int sum_us = 0;

    for (int i = 0; i < usb->count; i++) {
        const struct sst_sim_usb_device *other = &usb->device[i];

        if (other->kind != SST_SIM_USB_CAMERA || other->bus != d->bus || other->speed_mbit != d->speed_mbit)
            continue;
        if (d->speed_mbit < 480 && !same_translator(usb, d, other))
            continue;
        sum_us += reserved_us(other);
    }
    return sum_us <= (d->speed_mbit >= 480 ? HIGH_LIMIT_US : FULL_LIMIT_US);
}

int sst_sim_usb_stream(struct sst_sim_usb *usb, int device, int64_t bytes_s)
{
    struct sst_sim_usb_device *d = &usb->device[device];
    const struct sst_sim_usb_alt *alts;
    const int count = sst_sim_usb_alts(d->speed_mbit, &alts), before = d->alt;
    const int per_s = d->speed_mbit >= 480 ? 8000 : 1000;
    int alt = bytes_s > 0 ? 1 : count;

    if (!sst_sim_usb_works(usb, device))
        return -ENODEV;
    while (alt <= count && (int64_t)alts[alt - 1].packet * alts[alt - 1].per_microframe * per_s < bytes_s)
        alt++;
    if (alt > count)
        return -EIO;
    d->alt = alt;
    if (!fits(usb, d)) {
        d->alt = before;
        return -ENOSPC;
    }
    return 0;
}

void sst_sim_usb_stream_end(struct sst_sim_usb *usb, int device)
{
    usb->device[device].alt = 0;
}
