/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#include "drivers/usb/usb_internal.h"

enum { CONFIGURATION = 2, INTERFACE = 4, ENDPOINT = 5, COMPANION = 0x30, CLASS_VIDEO = 14, SUBCLASS_STREAMING = 2 };
enum { CLASS_STILL = 6, SUBCLASS_CAPTURE = 1, PROTOCOL_PTP = 1 };
enum { ISOCHRONOUS = 1, BULK = 2 };

static int get16(const uint8_t *p)
{
    return p[0] | p[1] << 8;
}

/* USB 2.0 table 9-13: bits 10..0 are the size, bits 12..11 further transactions per microframe (high speed only). */
static void read_endpoint(struct sst_usb_alt *alt, const uint8_t *d, int speed_mbit)
{
    const int packet = get16(d + 4), frame_us = speed_mbit <= 12 ? 1000 : 125;
    const int exponent = d[6] >= 1 && d[6] <= 16 ? d[6] - 1 : 0;

    alt->isochronous = (d[3] & 3) == ISOCHRONOUS;
    alt->packet_bytes = (packet & 0x7ff) * (speed_mbit == 480 ? 1 + (packet >> 11 & 3) : 1);
    alt->interval_us = frame_us << exponent;
}

int usb_parse_alts(struct sst_usb_alt alt[SST_USB_ALTS_MAX], const uint8_t *data, size_t size, int speed_mbit)
{
    int n = 0, configurations = 0, interface = -1, setting = -1;
    bool here = false; /* the last endpoint belongs to the interface */

    for (size_t at = 0; at + 2 <= size && data[at] >= 2 && data[at] <= size - at; at += data[at]) {
        const uint8_t *d = data + at;

        if (d[1] == CONFIGURATION && ++configurations == 2)
            break; /* the kernel uses the first one */
        if (d[1] == INTERFACE && d[0] >= 9) {
            here = false;
            setting = -1;
            if (d[5] == CLASS_VIDEO && d[6] == SUBCLASS_STREAMING && (interface == -1 || interface == d[2])) {
                interface = d[2];
                setting = d[3];
            }
        } else if (d[1] == ENDPOINT && d[0] >= 7) {
            here = setting >= 0 && n < SST_USB_ALTS_MAX && (d[2] & 0x80) &&
                   ((d[3] & 3) == ISOCHRONOUS || (d[3] & 3) == BULK);
            if (here) {
                alt[n] = (struct sst_usb_alt){ .number = setting };
                read_endpoint(&alt[n++], d, speed_mbit);
            }
        } else if (d[1] == COMPANION && d[0] >= 6 && here && alt[n - 1].isochronous) {
            alt[n - 1].packet_bytes = get16(d + 4);
        }
    }
    return n;
}

bool usb_has_ptp(const uint8_t *data, size_t size)
{
    for (size_t at = 0; at + 9 <= size && data[at] >= 2; at += data[at]) {
        const uint8_t *d = data + at;

        if (d[1] == INTERFACE && d[5] == CLASS_STILL && d[6] == SUBCLASS_CAPTURE && d[7] == PROTOCOL_PTP)
            return true;
    }
    return false;
}
