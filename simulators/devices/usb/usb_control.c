/* simulators/devices/usb/usb_control.c - control transfers: standard requests, and requests of hubs. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "simulators/devices/usb/usb_internal.h"

#define LANGUAGE 0x0409

enum {
    GET_STATUS = 0,
    CLEAR_FEATURE = 1,
    SET_FEATURE = 3,
    GET_DESCRIPTOR = 6,
    GET_CONFIGURATION = 8,
    GET_INTERFACE = 10,

    DESCRIPTOR_DEVICE = 1,
    DESCRIPTOR_CONFIGURATION = 2,
    DESCRIPTOR_STRING = 3,
    DESCRIPTOR_QUALIFIER = 6,
    DESCRIPTOR_HUB = 0x29,
    DESCRIPTOR_HUB3 = 0x2a,

    PORT_RESET = 4,
    PORT_POWER = 8,
    FIRST_CHANGE = 16, /* C_PORT_CONNECTION .. C_PORT_RESET */
    LAST_CHANGE = 20,
};

struct setup {
    uint8_t type, request;
    int value, index, length;
};

/** Return at most the requested length of the data. */
static int reply(const struct setup *s, uint8_t *data, const uint8_t *from, int bytes)
{
    const int count = sst_min_int(bytes, s->length);

    memcpy(data, from, (size_t)count);
    return count;
}

static int reply_string(const struct sst_sim_usb_device *d, const struct setup *s, uint8_t *data)
{
    const char *text[] = { NULL, sst_sim_usb_maker(d), sst_sim_usb_product(d), d->serial };
    const int which = s->value & 0xff;
    uint8_t out[2 + 2 * SST_SIM_USB_TEXT] = { 4, DESCRIPTOR_STRING, LANGUAGE & 0xff, LANGUAGE >> 8 };

    if (which > 3)
        return -EPIPE;
    if (which > 0) {
        const size_t length = strlen(text[which]);

        for (size_t i = 0; i < length; i++) {
            out[2 + 2 * i] = (uint8_t)text[which][i];
            out[3 + 2 * i] = 0;
        }
        out[0] = (uint8_t)(2 + 2 * length);
    }
    return reply(s, data, out, out[0]);
}

static int reply_descriptor(const struct sst_sim_usb *usb, int device, const struct setup *s, uint8_t *data)
{
    const struct sst_sim_usb_device *d = &usb->device[device];
    uint8_t all[4096], qualifier[10] = { 10, DESCRIPTOR_QUALIFIER };
    const int bytes = sst_sim_usb_descriptors(usb, device, all, sizeof(all));

    if (bytes < 0)
        return -EPIPE;
    switch (s->value >> 8) {
    case DESCRIPTOR_DEVICE:
        return reply(s, data, all, 18);
    case DESCRIPTOR_CONFIGURATION:
        return s->value & 0xff ? -EPIPE : reply(s, data, all + 18, bytes - 18);
    case DESCRIPTOR_STRING:
        return reply_string(d, s, data);
    case DESCRIPTOR_QUALIFIER:
        if (d->speed_mbit != 480)
            return -EPIPE;                 /* no other speed to describe */
        memcpy(qualifier + 2, all + 2, 6); /* the same as at full speed */
        qualifier[8] = 1;
        return reply(s, data, qualifier, sizeof(qualifier));
    default:
        return -EPIPE;
    }
}

/* --- hubs --------------------------------------------------------------------------------------------------------- */

static int reply_hub_descriptor(const struct sst_sim_usb *usb, const struct sst_sim_usb_device *d,
                                const struct setup *s, uint8_t *data)
{
    /* Power and over-current per port, or no switching at all. */
    const uint8_t switching = usb->fault[SST_SIM_USB_NO_PORT_POWER] ? 0x0a : 0x09;
    const uint8_t super[12] = { 12, DESCRIPTOR_HUB3, (uint8_t)d->ports, switching, 0, 10 };
    /* Two masks with one bit per port plus one: all ports are removable and switched individually. */
    const uint8_t mask = d->ports < 8 ? 1 : 2;
    uint8_t high[11] = { (uint8_t)(7 + 2 * mask), DESCRIPTOR_HUB, (uint8_t)d->ports, switching, 0, 10, 100 };

    if (d->speed_mbit >= 5000)
        return s->value >> 8 == DESCRIPTOR_HUB3 ? reply(s, data, super, sizeof(super)) : -EPIPE;
    if (s->value >> 8 != DESCRIPTOR_HUB)
        return -EPIPE;
    memset(high + 7 + mask, 0xff, mask);
    return reply(s, data, high, high[0]);
}

static int reply_port_status(const struct sst_sim_usb *usb, int hub, const struct setup *s, uint8_t *data)
{
    const struct sst_sim_usb_device *h = &usb->device[hub];
    const int port = s->index & 0xff;
    unsigned status = 0;
    int child;

    if (port < 1 || port > h->ports)
        return -EPIPE;
    child = sst_sim_usb_child(usb, hub, port);
    if (!h->off[port])
        status |= h->speed_mbit >= 5000 ? 0x0200 : 0x0100;
    if (child >= 0 && usb->device[child].here) {
        status |= 0x0003; /* connected, enabled */
        if (h->speed_mbit < 5000 && usb->device[child].speed_mbit == 480)
            status |= 0x0400;
    }
    return reply(s, data, (const uint8_t[]){ (uint8_t)status, (uint8_t)(status >> 8), 0, 0 }, 4);
}

static int port_feature(struct sst_sim_usb *usb, int hub, const struct setup *s)
{
    const int port = s->index & 0xff;
    const bool set = s->request == SET_FEATURE;
    int child;

    if (port < 1 || port > usb->device[hub].ports)
        return -EPIPE;
    if (s->value == PORT_POWER)
        return sst_sim_usb_power(usb, hub, port, set);
    if (s->value == PORT_RESET && set) {
        child = sst_sim_usb_child(usb, hub, port);
        return child >= 0 && usb->device[child].here ? sst_sim_usb_reset(usb, child) : 0;
    }
    /* Changes are handled at once, so there is none to clear. */
    return !set && s->value >= FIRST_CHANGE && s->value <= LAST_CHANGE ? 0 : -EPIPE;
}

static int hub_request(struct sst_sim_usb *usb, int device, const struct setup *s, uint8_t *data)
{
    if (s->type == 0xa0 && s->request == GET_DESCRIPTOR)
        return reply_hub_descriptor(usb, &usb->device[device], s, data);
    if (s->type == 0xa0 && s->request == GET_STATUS)
        return reply(s, data, (const uint8_t[]){ 0, 0, 0, 0 }, 4);
    if (s->type == 0xa3 && s->request == GET_STATUS)
        return reply_port_status(usb, device, s, data);
    if (s->type == 0x23 && (s->request == SET_FEATURE || s->request == CLEAR_FEATURE))
        return port_feature(usb, device, s);
    return -EPIPE;
}

int sst_sim_usb_control(struct sst_sim_usb *usb, int device, const uint8_t setup[8], uint8_t *data)
{
    const struct setup s = { setup[0], setup[1], setup[2] | setup[3] << 8, setup[4] | setup[5] << 8,
                             setup[6] | setup[7] << 8 };
    const struct sst_sim_usb_device *d = &usb->device[device];
    const bool hub = d->kind == SST_SIM_USB_HUB || d->kind == SST_SIM_USB_ROOT;

    if (!d->here)
        return -ENODEV;
    if ((s.type & 0x60) == 0x20 && hub)
        return hub_request(usb, device, &s, data);
    if (s.type == 0x80 && s.request == GET_DESCRIPTOR)
        return reply_descriptor(usb, device, &s, data);
    if (s.request == GET_STATUS && (s.type & 0xfc) == 0x80) /* all but cameras are self-powered */
        return reply(&s, data, (const uint8_t[]){ d->kind != SST_SIM_USB_CAMERA && s.type == 0x80, 0 }, 2);
    if (s.type == 0x80 && s.request == GET_CONFIGURATION)
        return reply(&s, data, (const uint8_t[]){ d->authorized ? 1 : 0 }, 1);
    if (s.type == 0x81 && s.request == GET_INTERFACE && s.index < d->interfaces)
        return reply(&s, data, (const uint8_t[]){ s.index == 1 ? (uint8_t)d->alt : 0 }, 1);
    return -EPIPE;
}
