/* simulators/devices/ptp/ptp_props.c - settings of the camera: values, choices, and access. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include "simulators/devices/ptp/ptp_internal.h"

#define CHOICES 16

enum data_type {
    TYPE_UINT8 = 2,
    TYPE_UINT16 = 4,
    TYPE_UINT32 = 6,
    TYPE_TEXT = 0xffff,
};

static const struct property {
    uint16_t code, type;
    bool writable;
    uint32_t standard;
    uint32_t choice[CHOICES]; /* up to the first 0; none: 0 to 100 */
} properties[PTP_PROPERTIES] = {
    { PTP_BATTERY_LEVEL, TYPE_UINT8, false, 100 },
    { PTP_IMAGE_SIZE, TYPE_TEXT, false, 0 },
    { PTP_COMPRESSION, TYPE_UINT8, true, PTP_FILES_JPEG, { PTP_FILES_JPEG, PTP_FILES_RAW, PTP_FILES_BOTH } },
    { PTP_F_NUMBER, TYPE_UINT16, true, 800, { 280, 400, 560, 800, 1100, 1600, 2200 } },
    { PTP_FOCUS_MODE, TYPE_UINT16, true, 2, { 1, 2 } }, /* manual, automatic */
    { PTP_EXPOSURE_TIME, TYPE_UINT32, true, 0, { 10, 20, 40, 50, 80, 100, 166, 333, 666, 1250, 2500, 5000, 10000 } },
    { PTP_EXPOSURE_MODE, TYPE_UINT16, true, 1, { 1, 2 } },
    { PTP_EXPOSURE_INDEX, TYPE_UINT16, true, 100, { 100, 200, 400, 800, 1600, 3200 } },
};

static int find(uint16_t code)
{
    for (int i = 0; i < PTP_PROPERTIES; i++)
        if (properties[i].code == code)
            return i;
    return -1;
}

static int bytes_of(const struct property *p)
{
    return p->type == TYPE_UINT8 ? 1 : p->type == TYPE_UINT16 ? 2 : 4;
}

static int choices_of(const struct property *p)
{
    int n = 0;

    while (n < CHOICES && p->choice[n])
        n++;
    return n;
}

void ptp_props_init(struct ptp_props *props, const struct sst_sim_ptp_config *cfg)
{
    *props = (struct ptp_props){ .exposure_time = (uint32_t)sst_max_int(cfg->exposure_us / 100, 1) };
    for (int i = 0; i < PTP_PROPERTIES; i++)
        props->value[i] = properties[i].standard;
    ptp_props_set(props, PTP_EXPOSURE_TIME, props->exposure_time);
    ptp_props_set(props, PTP_BATTERY_LEVEL, (uint32_t)cfg->battery_percent);
    snprintf(props->size_text, sizeof(props->size_text), "%dx%d", cfg->width, cfg->height);
}

const uint16_t *ptp_props_codes(void)
{
    static uint16_t codes[PTP_PROPERTIES];

    for (int i = 0; i < PTP_PROPERTIES; i++)
        codes[i] = properties[i].code;
    return codes;
}

uint32_t ptp_props_value(const struct ptp_props *props, uint16_t code)
{
    const int i = find(code);

    return i < 0 ? 0 : props->value[i];
}

void ptp_props_set(struct ptp_props *props, uint16_t code, uint32_t value)
{
    const int i = find(code);

    if (i >= 0)
        props->value[i] = value;
}

static void put_value(const struct ptp_props *props, const struct property *p, uint32_t value, struct ptp_bytes *out)
{
    if (p->type == TYPE_TEXT)
        ptp_put_text(out, props->size_text);
    else
        ptp_put(out, value, bytes_of(p));
}

/** The power-on exposure time is a choice also where the table has another one. */
static bool extra_choice(const struct ptp_props *props, const struct property *p)
{
    for (int i = 0; i < choices_of(p); i++)
        if (p->choice[i] == props->exposure_time)
            return false;
    return p->code == PTP_EXPOSURE_TIME;
}

unsigned ptp_props_describe(const struct ptp_props *props, uint16_t code, struct ptp_bytes *out)
{
    const int i = find(code);
    const struct property *p = &properties[sst_max_int(i, 0)];
    const int n = choices_of(p);
    const bool extra = extra_choice(props, p);

    if (i < 0)
        return PTP_PROP_NOT_SUPPORTED;
    ptp_put(out, p->code, 2);
    ptp_put(out, p->type, 2);
    ptp_put(out, p->writable, 1);
    put_value(props, p, p->code == PTP_EXPOSURE_TIME ? props->exposure_time : p->standard, out);
    put_value(props, p, props->value[i], out);
    if (p->type == TYPE_TEXT) {
        ptp_put(out, 2, 1); /* an enumeration of one */
        ptp_put(out, 1, 2);
        put_value(props, p, 0, out);
    } else if (!n) {
        ptp_put(out, 1, 1); /* a range: first, last, step */
        put_value(props, p, 0, out);
        put_value(props, p, 100, out);
        put_value(props, p, 1, out);
    } else {
        ptp_put(out, 2, 1);
        ptp_put(out, (uint64_t)(n + extra), 2);
        for (int k = 0; k < n; k++)
            put_value(props, p, p->choice[k], out);
        if (extra)
            put_value(props, p, props->exposure_time, out);
    }
    return PTP_OK;
}

unsigned ptp_props_read(const struct ptp_props *props, uint16_t code, struct ptp_bytes *out)
{
    const int i = find(code);

    if (i < 0)
        return PTP_PROP_NOT_SUPPORTED;
    put_value(props, &properties[i], props->value[i], out);
    return PTP_OK;
}

unsigned ptp_props_write(struct ptp_props *props, uint16_t code, const uint8_t *data, size_t bytes)
{
    const int i = find(code);
    const struct property *p = &properties[sst_max_int(i, 0)];
    uint32_t value;
    bool known;

    if (i < 0)
        return PTP_PROP_NOT_SUPPORTED;
    if (!p->writable)
        return PTP_ACCESS_DENIED;
    if (bytes != (size_t)bytes_of(p))
        return PTP_INVALID_PROP_VALUE;
    value = ptp_get(data, bytes_of(p));
    known = extra_choice(props, p) && value == props->exposure_time;
    for (int k = 0; k < choices_of(p); k++)
        known |= p->choice[k] == value;
    if (!known)
        return PTP_INVALID_PROP_VALUE;
    props->value[i] = value;
    return PTP_OK;
}
