/* Faults by name and value, as docs/use/rig.md lists them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "simulators/rig/rig_internal.h"

bool sim_strikes(struct sim_when *when)
{
    if (when->every)
        return ++when->count % when->every == 0;
    if (!when->left)
        return false;
    when->left--;
    return true;
}

static bool number(const char *text, char **end, int max, int *out)
{
    long v;

    errno = 0;
    v = strtol(text, end, 0);
    if (*end == text || errno || v < 0 || v > max)
        return false;
    *out = (int)v;
    return true;
}

/* off | once | always | N (the next N) | 1/N (every Nth) */
static bool parse_when(const char *text, struct sim_when *out)
{
    struct sim_when w = { 0 };
    char *end;

    if (!strcmp(text, "off")) {
        *out = w;
        return true;
    }
    if (!strcmp(text, "once")) {
        w.left = 1;
    } else if (!strcmp(text, "always")) {
        w.every = 1;
    } else if (!strncmp(text, "1/", 2)) {
        if (!number(text + 2, &end, 1000000, &w.every) || *end || !w.every)
            return false;
    } else if (!number(text, &end, 1000000, &w.left) || *end) {
        return false;
    }
    *out = w;
    return true;
}

/* NUMBER[:WHEN], or off */
static bool parse_number_when(const char *text, int max, int *number_out, struct sim_when *out)
{
    char *end;
    int n;

    if (!strcmp(text, "off")) {
        *out = (struct sim_when){ 0 };
        return true;
    }
    if (!number(text, &end, max, &n) || (*end && *end != ':') || !parse_when(*end ? end + 1 : "once", out))
        return false;
    *number_out = n;
    return true;
}

static struct sim_axis *parse_axis(struct sim_drives *bus, const char *text, const char **rest)
{
    const int axis = text[0] - 'x';

    if (axis < 0 || axis >= SST_SIM_AXES || (text[1] && text[1] != ':'))
        return NULL;
    *rest = text[1] ? text + 2 : "";
    return &bus->axis[axis];
}

static bool set_axis_fault(struct sim_drives *bus, const char *name, const char *value)
{
    const char *rest;
    struct sim_axis *a;
    char *end;
    int n = 0;

    if (!strcmp(value, "off")) {
        for (int i = 0; i < SST_SIM_AXES; i++)
            bus->axis[i].faults = (struct sim_axis_faults){ 0 };
        return true;
    }
    a = parse_axis(bus, value, &rest);
    if (!a)
        return false;
    if (!strcmp(name, "alarm")) {
        if (*rest && (!number(rest, &end, 0xFFFF, &n) || *end))
            return false;
        sim_axis_alarm(a, (uint16_t)(n ? n : SST_SIM_ALARM_FOLLOWING));
        return true;
    }
    if (!strcmp(name, "power_loss")) {
        sim_axis_power_loss(a);
        return !*rest;
    }
    if (!strcmp(name, "lost_steps")) {
        if (*rest && (!number(rest, &end, 1000000, &n) || *end))
            return false;
        a->faults.lost_steps = n ? n : 500;
        return true;
    }
    if (*rest && strcmp(rest, "always") != 0)
        return false;
    a->faults.keep = *rest != 0;
    a->faults.stall |= !strcmp(name, "stall");
    a->faults.limit |= !strcmp(name, "limit");
    a->faults.lies |= !strcmp(name, "in_position_lies");
    return true;
}

static bool is_axis_fault(const char *name)
{
    static const char *const names[] = { "stall", "limit", "alarm", "lost_steps", "power_loss", "in_position_lies" };

    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        if (!strcmp(name, names[i]))
            return true;
    }
    return false;
}

static struct sim_when *wire_fault(struct sim_wire_faults *f, const char *name)
{
    const struct {
        const char *name;
        struct sim_when *when;
    } all[] = {
        { "noise", &f->noise },
        { "bad_crc", &f->bad_crc },
        { "silence", &f->silence },
        { "acknowledge", &f->acknowledge },
        { "busy", &f->busy },
        { "wrong_unit", &f->wrong_unit },
        { "drop_bytes", &f->drop_bytes },
        { "disconnect", &f->disconnect },
    };

    for (size_t i = 0; i < ARRAY_LEN(all); i++) {
        if (!strcmp(name, all[i].name))
            return all[i].when;
    }
    return NULL;
}

int sim_drives_fault(struct sim_drives *bus, const char *name, const char *value, char *error, size_t error_size)
{
    struct sim_wire_faults *f = &bus->faults;
    struct sim_when *when = wire_fault(f, name);
    const char *want = "off, once, always, N or 1/N";
    bool ok;

    if (when) {
        ok = parse_when(value, when);
    } else if (!strcmp(name, "exception")) {
        want = "CODE[:WHEN], for example 2 or 6:1/20; codes 1 to 11";
        ok = parse_number_when(value, 11, &f->exception_code, &f->exception);
    } else if (!strcmp(name, "late_ms")) {
        want = "MS[:WHEN], for example 300:always";
        ok = parse_number_when(value, 10000, &f->late_ms, &f->late);
    } else if (is_axis_fault(name)) {
        want = "off, or an axis x, y or z, for example x, x:always (stall, limit, in_position_lies), x:0x21 (alarm), "
               "x:500 (lost_steps)";
        ok = set_axis_fault(bus, name, value);
    } else {
        snprintf(error, error_size,
                 "unknown rig fault `%.40s`; choose exception, acknowledge, busy, late_ms, noise, bad_crc, silence, "
                 "wrong_unit, drop_bytes, disconnect, stall, limit, alarm, lost_steps, power_loss, in_position_lies",
                 name);
        return -EINVAL;
    }
    if (ok)
        return 0;
    snprintf(error, error_size, "fault %s takes %s, not %.40s", name, want, value);
    return -EINVAL;
}
