/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/rig/rig_internal.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <time.h>

#include "base/clock.h"
#include "base/log.h"

#define POLL_MS     5
#define BUSY_MS     10          /* first pause before a busy drive is asked again; each one doubles */
#define BUSY_MAX_MS 320         /* longest pause */
#define HURRY_MS    200         /* for a busy drive while other axes wait */
#define LOG_NS      10000000000 /* between two warnings about faults that were recovered */

const char *rig_axis_name(const struct sst_rig *rig, int a, char text[32])
{
    snprintf(text, 32, "axis %c (unit %d)", 'x' + a, rig->cfg.unit[a]);
    return text;
}

void rig_sleep_ms(struct sst_rig *rig, int ms)
{
    const int64_t end_ns = sst_clock_now_ns() + (int64_t)ms * 1000000;

    for (;;) {
        const int64_t left_ns = end_ns - sst_clock_now_ns(), part_ns = left_ns < 20000000 ? left_ns : 20000000;
        const struct timespec t = { .tv_nsec = part_ns };

        if (left_ns <= 0 || atomic_load(&rig->cancel))
            return;
        (void)nanosleep(&t, NULL);
    }
}

/* --- requests, retried -------------------------------------------------------------------------------------------- */

static int registers_of(const struct rig_register *reg)
{
    return reg->type == SST_RIG_U32 || reg->type == SST_RIG_S32 ? 2 : 1;
}

/* Log a fault that a retry may fix. A bad cable causes them all the time: they are counted, and logged rarely. */
static void log_fault(struct sst_rig *rig, int a, const char *doing, const char *reg)
{
    const int64_t now_ns = sst_clock_now_ns();
    const bool again = rig->logged_ns && now_ns - rig->logged_ns < LOG_NS;
    char name[32];

    (again ? sst_log_debug : sst_log_warning)("rig %s: %s: %s while %s %s; retrying", rig->cfg.bus,
                                              rig_axis_name(rig, a, name), rig_bus_why(rig->bus), doing, reg);
    if (!again)
        rig->logged_ns = now_ns;
}

static int give_up(struct sst_rig *rig, int a, const char *doing, const char *reg, int err)
{
    char name[32];

    rig_axis_name(rig, a, name);
    if (err == -EAGAIN || err == -EINPROGRESS)
        sst_log_error("rig %s: %s: %s while %s %s, for %d ms; let the drive finish, or raise reconnect_ms",
                      rig->cfg.bus, name, rig_bus_why(rig->bus), doing, reg, rig->cfg.reconnect_ms);
    else
        sst_log_error("rig %s: %s: %s while %s %s; check cable, unit number and the drive's profile %s", rig->cfg.bus,
                      name, rig_bus_why(rig->bus), doing, reg, rig->profile.path);
    return err == -ETIMEDOUT ? -ETIMEDOUT : err == -EPROTO ? -EPROTO : -EIO;
}

/* Tries of one request, "reading" or "writing" a register. */
struct tries {
    const char *doing, *reg;
    int left, pause_ms;
    int64_t busy_end_ns; /* 0: the drive was not busy yet */
};

static struct tries tries_of(const struct sst_rig *rig, const char *doing, const struct rig_register *reg)
{
    return (struct tries){
        .doing = doing, .reg = reg->name, .left = rig->hurry ? 0 : rig->cfg.retries, .pause_ms = BUSY_MS
    };
}

static struct rig_place place_of(const struct sst_rig *rig, int a, const struct rig_register *reg)
{
    return (struct rig_place){ rig->cfg.unit[a], reg->table, reg->address, registers_of(reg) };
}

static int64_t patience_end_ns(const struct sst_rig *rig)
{
    return sst_clock_now_ns() + (rig->hurry ? HURRY_MS : rig->cfg.reconnect_ms) * (int64_t)1000000;
}

/* Prepare the retry of a request. @return 0: retry; else the error to give up with */
static int before_retry(struct sst_rig *rig, int a, struct tries *t, int err)
{
    int again = 0;

    if (err == -EPROTO || err == -EREMOTEIO)
        return err;
    if (err == -EAGAIN) { /* "busy" of the standard: not a fault */
        if (!t->busy_end_ns)
            t->busy_end_ns = patience_end_ns(rig);
        else if (sst_clock_now_ns() >= t->busy_end_ns)
            return err;
        rig_sleep_ms(rig, t->pause_ms);
        t->pause_ms = sst_min_int(2 * t->pause_ms, BUSY_MAX_MS);
        return atomic_load(&rig->cancel) ? -ECANCELED : 0;
    }
    log_fault(rig, a, t->doing, t->reg);
    if (err != -EHOSTDOWN)
        again = rig_bus_restore(rig->bus, rig->cfg.reconnect_ms, &rig->cancel);
    return again ? again : t->left-- > 0 ? 0 : err;
}

/* As read_words(), without a message of its end. */
static int try_read(struct sst_rig *rig, int a, const struct rig_register *reg, uint16_t out[2])
{
    struct tries t = tries_of(rig, "reading", reg);
    int err, again;

    do {
        err = rig_bus_read(rig->bus, place_of(rig, a, reg), out);
        if (!err)
            return 0;
        if (err == -EINPROGRESS) /* it takes a while: ask again */
            err = -EAGAIN;
        again = before_retry(rig, a, &t, err);
    } while (!again);
    return again == -ECANCELED || atomic_load(&rig->cancel) ? -ECANCELED : err;
}

static int read_words(struct sst_rig *rig, int a, const struct rig_register *reg, uint16_t out[2])
{
    const int err = try_read(rig, a, reg, out);

    return err && err != -ECANCELED ? give_up(rig, a, "reading", reg->name, err) : err;
}

static double value_of(const struct rig_register *reg, const uint16_t words[2])
{
    const uint32_t both = reg->low_first ? (uint32_t)words[1] << 16 | words[0] : (uint32_t)words[0] << 16 | words[1];

    switch (reg->type) {
    case SST_RIG_S16:
        return (int16_t)words[0];
    case SST_RIG_U32:
        return both;
    case SST_RIG_S32:
        return (int32_t)both;
    case SST_RIG_U16:
    case SST_RIG_BIT:
        break;
    }
    return words[0];
}

/* @return 0 or -ERANGE */
static int words_of(const struct rig_register *reg, double value, uint16_t words[2])
{
    static const double limits[][2] = {
        { 0, 65535 }, { -32768, 65535 }, { 0, 4294967295.0 }, { -2147483648.0, 4294967295.0 }, { 0, 1 }
    };
    uint32_t both;

    if (!(value >= limits[reg->type][0] && value <= limits[reg->type][1]))
        return -ERANGE;
    both = (uint32_t)llround(value);
    words[0] = (uint16_t)(reg->low_first || registers_of(reg) == 1 ? both & 0xFFFF : both >> 16);
    words[1] = (uint16_t)(reg->low_first ? both >> 16 : both & 0xFFFF);
    return 0;
}

/* --- status ------------------------------------------------------------------------------------------------------- */

static int read_flags(struct sst_rig *rig, int a, bool out[SST_RIG_FLAGS])
{
    const struct rig_profile *p = &rig->profile;
    bool have[SST_RIG_REGISTERS_MAX] = { false };
    uint32_t value[SST_RIG_REGISTERS_MAX];

    for (int i = 0; i < SST_RIG_FLAGS; i++) {
        const struct rig_bit *b = &p->bit[i];
        uint16_t words[2];

        out[i] = false;
        if (b->reg < 0)
            continue;
        if (!have[b->reg]) {
            const int err = read_words(rig, a, &p->reg[b->reg], words);

            if (err)
                return err;
            value[b->reg] = (uint32_t)(int64_t)value_of(&p->reg[b->reg], words);
            have[b->reg] = true;
        }
        out[i] = ((value[b->reg] & b->mask) == b->equals) != b->inverted;
    }
    return 0;
}

static int32_t um_of(const struct sst_rig *rig, int a, double counts)
{
    return (int32_t)lround(sst_clamp_double(counts * rig->cfg.um_per_count[a], -2e9, 2e9));
}

int rig_drive_status(struct sst_rig *rig, int a)
{
    const struct rig_profile *p = &rig->profile;
    struct rig_status now = { .alarm = 0 };
    uint16_t words[2];
    int err = read_flags(rig, a, now.flag);

    err = err ? err : read_words(rig, a, &p->reg[p->position], words);
    if (err)
        return err;
    now.um = um_of(rig, a, value_of(&p->reg[p->position], words) * p->reg[p->position].scale);
    if (now.flag[SST_RIG_ALARM] && p->alarm_code >= 0 && !read_words(rig, a, &p->reg[p->alarm_code], words))
        now.alarm = (long)value_of(&p->reg[p->alarm_code], words);
    rig->axis[a].now = now;
    return 0;
}

int rig_drive_identity(struct sst_rig *rig, int a, long *value)
{
    const struct rig_profile *p = &rig->profile;
    uint16_t words[2];
    int err;

    *value = -1;
    if (p->identity < 0)
        return 0;
    err = read_words(rig, a, &p->reg[p->identity], words);
    if (!err)
        *value = (long)value_of(&p->reg[p->identity], words);
    return err;
}

/* --- sequences ---------------------------------------------------------------------------------------------------- */

/* Check whether a write without a reply arrived. @return 1, 0, or -ETIMEDOUT: unknown */
static int arrived(struct sst_rig *rig, int a, const struct rig_step *step, const uint16_t words[2])
{
    const struct rig_register *reg = &rig->profile.reg[step->reg];
    bool flag[SST_RIG_FLAGS];
    uint16_t back[2];

    if (reg->read_back) {
        if (try_read(rig, a, reg, back))
            return -ETIMEDOUT;
        return back[0] == words[0] && (registers_of(reg) == 1 || back[1] == words[1]);
    }
    if (step->flag < SST_RIG_FLAGS && !read_flags(rig, a, flag))
        return flag[step->flag];
    return -ETIMEDOUT;
}

/* An acknowledged write (exception 5) was accepted: wait until its effect is seen, where that is possible. */
static int wait_effect(struct sst_rig *rig, int a, const struct rig_step *step, const uint16_t words[2])
{
    const struct rig_register *reg = &rig->profile.reg[step->reg];
    const int64_t end_ns = patience_end_ns(rig);

    while (reg->read_back || step->flag < SST_RIG_FLAGS) {
        const int there = arrived(rig, a, step, words);

        if (there > 0)
            return 0;
        if (there < 0 || sst_clock_now_ns() >= end_ns || atomic_load(&rig->cancel))
            return give_up(rig, a, "waiting for the effect of writing", reg->name, there < 0 ? there : -EINPROGRESS);
        rig_sleep_ms(rig, POLL_MS);
    }
    return 0;
}

static int write_words(struct sst_rig *rig, int a, const struct rig_step *step, const uint16_t words[2])
{
    const struct rig_register *reg = &rig->profile.reg[step->reg];
    struct tries t = tries_of(rig, "writing", reg);
    int err, again, there = 0;

    do {
        err = rig_bus_write(rig->bus, place_of(rig, a, reg), words);
        if (!err)
            return 0;
        if (err == -EINPROGRESS)
            return wait_effect(rig, a, step, words);
        again = before_retry(rig, a, &t, err);
        if (err == -EAGAIN) /* not carried out */
            continue;
        if (!again || again == err)
            there = err == -EPROTO || err == -EREMOTEIO ? 0 : arrived(rig, a, step, words);
        if (there > 0)
            return 0;
    } while (!again && !there);
    return again == -ECANCELED && err == -EAGAIN ? -ECANCELED : give_up(rig, a, "writing", reg->name, err);
}

static int run_write(struct sst_rig *rig, int a, const struct rig_step *step, int32_t um)
{
    const struct rig_register *reg = &rig->profile.reg[step->reg];
    const double counts_per_mm = 1000.0 / fabs(rig->cfg.um_per_count[a]);
    const double values[] = {
        [SST_RIG_NUMBER] = step->number,
        [SST_RIG_TARGET] = round(um / rig->cfg.um_per_count[a]) / reg->scale,
        [SST_RIG_SPEED] = rig->cfg.speed_mm_s * counts_per_mm / reg->scale,
        [SST_RIG_ACCEL] = rig->cfg.accel_mm_s2 * counts_per_mm / reg->scale,
    };
    const double value = values[step->value];
    uint16_t words[2];
    char name[32];

    if (step->value >= SST_RIG_SPEED && value <= 0)
        return 0;
    if (words_of(reg, round(value), words)) {
        sst_log_error("rig: %s: %.0f does not fit its register %s; check um per count, speed and travel",
                      rig_axis_name(rig, a, name), value, reg->name);
        return -EIO;
    }
    return write_words(rig, a, step, words);
}

static int run_wait(struct sst_rig *rig, int a, const struct rig_step *step)
{
    static const char *const names[SST_RIG_FLAGS] = { "moving",  "in position", "homed",      "alarm",
                                                      "enabled", "limit low",   "limit high", "acknowledge" };
    const int64_t end_ns = sst_clock_now_ns() + (int64_t)step->ms * 1000000;
    bool flag[SST_RIG_FLAGS];
    char name[32];

    for (;;) {
        const int err = read_flags(rig, a, flag);

        if (err)
            return err;
        if (flag[step->flag] == step->is)
            return 0;
        if (sst_clock_now_ns() >= end_ns)
            break;
        rig_sleep_ms(rig, POLL_MS);
    }
    sst_log_error("rig: %s did not report '%s' as %s within %d ms; check the drive", rig_axis_name(rig, a, name),
                  names[step->flag], step->is ? "true" : "false", step->ms);
    return -ETIMEDOUT;
}

int rig_drive_run(struct sst_rig *rig, int a, enum rig_sequence which, int32_t um)
{
    int err = 0;

    for (int i = 0; !err && i < rig->profile.steps[which]; i++) {
        const struct rig_step *step = &rig->profile.step[which][i];

        switch (step->what) {
        case SST_RIG_WRITE:
            err = run_write(rig, a, step, um);
            break;
        case SST_RIG_WAIT:
            err = run_wait(rig, a, step);
            break;
        case SST_RIG_PAUSE:
            rig_sleep_ms(rig, step->ms);
            break;
        }
    }
    return err;
}
