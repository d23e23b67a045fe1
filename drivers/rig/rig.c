/* Motions: all absolute, monitored until standstill, and stopped when in doubt. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/rig/rig.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/log.h"
#include "drivers/rig/rig_internal.h"

#define POLL_MS  5
#define STALL_NS 1000000000 /* no arrival and no progress for this time */

void sst_rig_config_defaults(struct sst_rig_config *cfg)
{
    *cfg = (struct sst_rig_config){
        .axes = 2,
        .response_ms = 300,
        .retries = 2,
        .reconnect_ms = 5000,
        .settle_ms = 200,
        .tolerance_um = 20,
    };
    for (int a = 0; a < SST_RIG_AXES; a++) {
        cfg->unit[a] = a + 1;
        cfg->travel_max_um[a] = 300000;
        cfg->um_per_count[a] = 1;
    }
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static int check_config(const struct sst_rig_config *cfg)
{
    const char *fault = NULL;

    if (cfg->axes < 1 || cfg->axes > SST_RIG_AXES)
        fault = "axes must be 1 to 3";
    else if (cfg->response_ms < 10 || cfg->response_ms > 10000 || cfg->retries < 0 || cfg->retries > 10)
        fault = "response time must be 10 to 10000 ms and retries 0 to 10";
    else if (cfg->reconnect_ms < 0 || cfg->settle_ms < 0 || cfg->tolerance_um < 1)
        fault = "reconnect and settle time must not be negative, the tolerance at least 1 um";
    else if (!(cfg->speed_mm_s >= 0) || !(cfg->accel_mm_s2 >= 0))
        fault = "speed and acceleration must not be negative";
    for (int a = 0; !fault && a < cfg->axes; a++) {
        if (cfg->unit[a] < 1 || cfg->unit[a] > 247)
            fault = "unit numbers must be 1 to 247";
        else if (cfg->travel_min_um[a] > cfg->travel_max_um[a])
            fault = "an axis' travel ends before it begins";
        else if (!(fabs(cfg->um_per_count[a]) >= 1e-4 && fabs(cfg->um_per_count[a]) <= 1e5))
            fault = "um per count must be 0.0001 to 100000, negative where the axis is mounted the other way round";
    }
    if (!fault)
        return 0;
    sst_log_error("rig: %s; correct the configuration", fault);
    return -EINVAL;
}

static int check_axis(struct sst_rig *rig, int a)
{
    const long want = rig->profile.identity_value;
    char name[32], alarm[128];
    long is;
    int err = rig_drive_identity(rig, a, &is);

    if (!err && rig->profile.identity >= 0 && is != want) {
        sst_log_error(
            "rig %s: %s identifies itself as 0x%04lX, not as 0x%04lX (%s); name the profile that fits the drive",
            rig->cfg.bus, rig_axis_name(rig, a, name), is, want, rig->profile.name);
        return -EPROTO;
    }
    err = err ? err : rig_drive_status(rig, a);
    if (!err && rig->axis[a].now.flag[SST_RIG_ALARM]) {
        rig_profile_alarm(&rig->profile, rig->axis[a].now.alarm, alarm, sizeof(alarm));
        sst_log_warning("rig: %s has alarm %s; homing clears it", rig_axis_name(rig, a, name), alarm);
        rig->doubt = true;
    }
    return err;
}

int sst_rig_open(struct sst_rig **out, const struct sst_rig_config *cfg)
{
    struct sst_rig *rig = calloc(1, sizeof(*rig));
    int err = rig ? check_config(cfg) : -ENOMEM;

    if (err) {
        free(rig);
        return err;
    }
    rig->cfg = *cfg;
    atomic_init(&rig->cancel, false);
    err = rig_profile_read(&rig->profile, cfg->profile);
    err = err ? err : rig_bus_open(&rig->bus, cfg->bus, cfg->response_ms, rig->profile.gap_ms, &rig->count);
    for (int a = 0; !err && a < cfg->axes; a++)
        err = check_axis(rig, a);
    if (!err) {
        *out = rig;
        return 0;
    }
    rig_bus_close(rig->bus);
    free(rig);
    return err;
}

void sst_rig_close(struct sst_rig *rig)
{
    if (!rig)
        return;
    if (rig->moving)
        (void)sst_rig_stop(rig);
    rig_bus_close(rig->bus);
    free(rig);
}

/* --- stopping ----------------------------------------------------------------------------------------------------- */

/* Run the sequence that stops an axis. */
static int stop_axis(struct sst_rig *rig, int a)
{
    rig->axis[a].has_target = false;
    return rig_drive_run(rig, a, SST_RIG_SEQ_STOP, 0);
}

int sst_rig_stop(struct sst_rig *rig)
{
    const bool cancel = atomic_exchange(&rig->cancel, false);
    bool stopped[SST_RIG_AXES] = { false };
    char unsaid[SST_LOG_MAX], *before = sst_log_hold_errors(unsaid);
    int err = 0;

    rig->moving = false;
    rig->count.stops++;
    /* An axis that does not answer must not delay the others: it is asked with patience after them. */
    rig->hurry = true;
    for (int a = 0; a < rig->cfg.axes; a++)
        stopped[a] = !stop_axis(rig, a);
    rig->hurry = false;
    (void)sst_log_hold_errors(before);
    for (int a = 0; a < rig->cfg.axes; a++) {
        const int e = stopped[a] ? 0 : stop_axis(rig, a);

        if (e && !err)
            err = e;
    }
    if (err)
        sst_log_error("rig %s: not every axis confirmed that it stopped; switch the drives off before you reach in",
                      rig->cfg.bus);
    if (cancel)
        atomic_store(&rig->cancel, true);
    return err;
}

/* Stop because of err; -ECANCELED ends the cancellation. @return err */
static int stop_for(struct sst_rig *rig, int err)
{
    if (err == -ECANCELED)
        atomic_store(&rig->cancel, false);
    (void)sst_rig_stop(rig);
    return err;
}

void sst_rig_cancel(struct sst_rig *rig)
{
    atomic_store(&rig->cancel, true);
}

/* Check for alarm, limit switch and lost home. @return 0 or the error of the motion; logged when first seen */
static int axis_fault(struct sst_rig *rig, int a)
{
    const struct rig_status *s = &rig->axis[a].now;
    char name[32], alarm[128];

    rig_axis_name(rig, a, name);
    if (s->flag[SST_RIG_LIMIT_LOW] || s->flag[SST_RIG_LIMIT_HIGH]) {
        rig->count.limits++;
        rig->doubt = true;
        sst_log_error(
            "rig: %s is at its %s limit switch, read %.3f mm; stopped; check the travel in the configuration and "
            "for obstacles",
            name, s->flag[SST_RIG_LIMIT_LOW] ? "lower" : "upper", s->um / 1000.0);
        return -ERANGE;
    }
    if (s->flag[SST_RIG_ALARM]) {
        rig->count.alarms++;
        rig->doubt = true;
        rig_profile_alarm(&rig->profile, s->alarm, alarm, sizeof(alarm));
        sst_log_error("rig: %s has alarm %s at %.3f mm; stopped; remove its cause, homing clears it", name, alarm,
                      s->um / 1000.0);
        return -EIO;
    }
    if (!s->flag[SST_RIG_HOMED]) {
        sst_log_error("rig: %s lost its position (power lost?); stopped; home it first", name);
        return -ENOTCONN;
    }
    return 0;
}

/* --- homing ------------------------------------------------------------------------------------------------------- */

bool sst_rig_homed(const struct sst_rig *rig)
{
    for (int a = 0; a < rig->cfg.axes; a++) {
        if (!rig->axis[a].now.flag[SST_RIG_HOMED])
            return false;
    }
    return !rig->doubt;
}

static int enable(struct sst_rig *rig, int a)
{
    if (rig->profile.bit[SST_RIG_ENABLED].reg >= 0 && rig->axis[a].now.flag[SST_RIG_ENABLED])
        return 0;
    return rig_drive_run(rig, a, SST_RIG_SEQ_ENABLE, 0);
}

static int wait_home(struct sst_rig *rig, int a, int64_t end_ns)
{
    const struct rig_status *s = &rig->axis[a].now;
    char name[32], alarm[128];

    for (;;) {
        const int err = rig_drive_status(rig, a);

        rig_axis_name(rig, a, name);
        if (err)
            return err;
        if (s->flag[SST_RIG_ALARM]) {
            rig->count.alarms++;
            rig_profile_alarm(&rig->profile, s->alarm, alarm, sizeof(alarm));
            sst_log_error("rig: %s has alarm %s while homing; remove its cause", name, alarm);
            return -EIO;
        }
        if (s->flag[SST_RIG_HOMED] && !s->flag[SST_RIG_MOVING])
            return 0;
        if (atomic_load(&rig->cancel))
            return -ECANCELED;
        if (sst_clock_now_ns() >= end_ns) {
            sst_log_error("rig: %s did not find its home in time; stopped; check the home switch", name);
            return -ETIMEDOUT;
        }
        rig_sleep_ms(rig, POLL_MS);
    }
}

static int home_axis(struct sst_rig *rig, int a, int64_t end_ns)
{
    int err = rig_drive_status(rig, a);

    rig->axis[a].has_target = false;
    if (!err && (rig->doubt || rig->axis[a].now.flag[SST_RIG_ALARM]))
        err = rig_drive_run(rig, a, SST_RIG_SEQ_RESET, 0);
    err = err ? err : rig_drive_status(rig, a);
    err = err ? err : enable(rig, a);
    err = err ? err : rig_drive_run(rig, a, SST_RIG_SEQ_SETUP, 0);
    err = err ? err : rig_drive_run(rig, a, SST_RIG_SEQ_HOME, 0);
    return err ? err : wait_home(rig, a, end_ns);
}

int sst_rig_home(struct sst_rig *rig, int timeout_ms)
{
    const int64_t end_ns = sst_clock_now_ns() + (int64_t)timeout_ms * 1000000;
    int err = 0;

    if (rig->moving)
        (void)sst_rig_stop(rig);
    rig->count.homings++;
    for (int a = rig->cfg.axes - 1; !err && a >= 0; a--)
        err = home_axis(rig, a, end_ns);
    if (err)
        return stop_for(rig, err);
    rig->doubt = false;
    return 0;
}

/* --- moving ------------------------------------------------------------------------------------------------------- */

static int check_target(const struct sst_rig *rig, const struct sst_rig_pos *target)
{
    for (int a = 0; a < rig->cfg.axes; a++) {
        if (target->um[a] >= rig->cfg.travel_min_um[a] && target->um[a] <= rig->cfg.travel_max_um[a])
            continue;
        sst_log_error("rig: %c = %.3f mm is outside the travel of %.3f to %.3f mm; nothing moved", 'x' + a,
                      target->um[a] / 1000.0, rig->cfg.travel_min_um[a] / 1000.0, rig->cfg.travel_max_um[a] / 1000.0);
        return -ERANGE;
    }
    return 0;
}

/* True if it is already at the target, in position and at standstill. */
static bool is_there(const struct sst_rig *rig, int a, int32_t um)
{
    const struct rig_axis *axis = &rig->axis[a];

    return axis->has_target && axis->target_um == um && axis->now.flag[SST_RIG_IN_POSITION] &&
           abs(axis->now.um - um) <= rig->cfg.tolerance_um;
}

static int move_axis(struct sst_rig *rig, int a, int32_t um)
{
    int err = rig_drive_status(rig, a);

    err = err ? err : axis_fault(rig, a);
    if (err || is_there(rig, a, um))
        return err;
    err = enable(rig, a);
    err = err ? err : rig_drive_run(rig, a, SST_RIG_SEQ_SETUP, 0);
    rig->axis[a].has_target = false;
    err = err ? err : rig_drive_run(rig, a, SST_RIG_SEQ_MOVE, um);
    rig->axis[a].target_um = um;
    rig->axis[a].has_target = !err;
    return err;
}

int sst_rig_move(struct sst_rig *rig, struct sst_rig_pos target)
{
    int err = check_target(rig, &target);

    if (err)
        return err;
    if (rig->moving)
        return -EBUSY;
    if (!sst_rig_homed(rig)) {
        sst_log_error("rig: the positions of the axes are unknown; home them first");
        return -ENOTCONN;
    }
    rig->moving = true;
    rig->count.moves++;
    for (int a = 0; !err && a < rig->cfg.axes; a++)
        err = move_axis(rig, a, target.um[a]);
    return err ? stop_for(rig, err) : 0;
}

/* State of an axis during a wait, besides its status. */
struct watch {
    int32_t last_um; /* position at its last progress */
    int64_t moved_ns;
    bool lied;
};

/* An axis is at standstill if two readings differ by no more than this. */
static int32_t still_um(const struct sst_rig *rig, int a)
{
    const double count = fabs(rig->cfg.um_per_count[a]);

    return (int32_t)fmax(ceil(1.5 * count), rig->cfg.tolerance_um / 4.0);
}

/* @param asked_ns  time before the status request: the status is not older, however long this process was stopped since
 * @return 1: arrived and at standstill; 0: not yet; or the error that stops the motion */
static int watch_axis(struct sst_rig *rig, int a, struct watch *w, int64_t asked_ns)
{
    const struct rig_axis *axis = &rig->axis[a];
    const struct rig_status *s = &axis->now;
    const bool in_position = s->flag[SST_RIG_IN_POSITION] && !s->flag[SST_RIG_MOVING];
    const int32_t off_um = abs(s->um - axis->target_um);
    char name[32];
    int err = axis_fault(rig, a);

    if (err)
        return err;
    rig_axis_name(rig, a, name);
    if (abs(s->um - w->last_um) > still_um(rig, a)) {
        if (in_position && off_um > rig->cfg.tolerance_um && abs(s->um - w->last_um) > rig->cfg.tolerance_um &&
            !w->lied) {
            sst_log_warning("rig: %s reports in-position at %.3f mm while it moves; its position is polled instead",
                            name, s->um / 1000.0);
            rig->count.lies++;
            w->lied = true;
        }
        w->last_um = s->um;
        w->moved_ns = sst_clock_now_ns();
        return 0;
    }
    if (in_position && off_um <= rig->cfg.tolerance_um)
        return 1;
    if (asked_ns - w->moved_ns < STALL_NS)
        return 0;
    rig->doubt = true;
    if (in_position) {
        rig->count.missed++;
        sst_log_error(
            "rig: %s reports in-position at %.3f mm but stands %d um from its target %.3f mm (lost steps?); it must "
            "be homed",
            name, s->um / 1000.0, off_um, axis->target_um / 1000.0);
    } else {
        rig->count.stalls++;
        sst_log_error("rig: %s stalled at %.3f mm on its way to %.3f mm; stopped; look for an obstacle, then home it",
                      name, s->um / 1000.0, axis->target_um / 1000.0);
    }
    return -EIO;
}

/* Read all axes. @return 1: all are at standstill at their targets; 0: not yet; or an error */
static int watch_all(struct sst_rig *rig, struct watch *w)
{
    int there = 1;

    for (int a = 0; a < rig->cfg.axes; a++) {
        const int64_t asked_ns = sst_clock_now_ns();
        int r = rig_drive_status(rig, a);

        if (!r)
            r = watch_axis(rig, a, &w[a], asked_ns);
        if (r < 0)
            return r;
        there &= r;
    }
    return there;
}

static int time_out(struct sst_rig *rig, int timeout_ms)
{
    for (int a = 0; a < rig->cfg.axes; a++) {
        const struct rig_axis *axis = &rig->axis[a];
        char name[32];

        if (abs(axis->now.um - axis->target_um) <= rig->cfg.tolerance_um && axis->now.flag[SST_RIG_IN_POSITION])
            continue;
        sst_log_error(
            "rig: %s has not arrived at %.3f mm within %d ms, it is at %.3f mm; stopped; is its speed too low?",
            rig_axis_name(rig, a, name), axis->target_um / 1000.0, timeout_ms, axis->now.um / 1000.0);
        return stop_for(rig, -ETIMEDOUT);
    }
    sst_log_error("rig: the axes do not come to rest within %d ms; stopped; damp the rig or give a larger tolerance",
                  timeout_ms);
    return stop_for(rig, -ETIMEDOUT);
}

int sst_rig_wait(struct sst_rig *rig, int timeout_ms)
{
    const int64_t end_ns = sst_clock_now_ns() + (int64_t)timeout_ms * 1000000;
    struct watch w[SST_RIG_AXES];
    int64_t since_ns = 0; /* since when all are at their targets; 0: not yet */

    for (int a = 0; a < rig->cfg.axes; a++)
        w[a] = (struct watch){ .last_um = rig->axis[a].now.um, .moved_ns = sst_clock_now_ns() };
    while (rig->moving) {
        const int r = watch_all(rig, w);
        const int64_t now_ns = sst_clock_now_ns();

        if (r == -ECANCELED || atomic_load(&rig->cancel))
            return stop_for(rig, -ECANCELED);
        if (r < 0)
            return stop_for(rig, r);
        since_ns = !r ? 0 : since_ns ? since_ns : now_ns;
        if (r && now_ns - since_ns >= (int64_t)rig->cfg.settle_ms * 1000000)
            rig->moving = false;
        else if (now_ns >= end_ns)
            return time_out(rig, timeout_ms);
        else
            rig_sleep_ms(rig, POLL_MS);
    }
    return 0;
}

int sst_rig_position(struct sst_rig *rig, struct sst_rig_pos *now)
{
    struct sst_rig_pos pos = { { 0 } };

    for (int a = 0; a < rig->cfg.axes; a++) {
        const int err = rig_drive_status(rig, a);

        if (err)
            return err;
        pos.um[a] = rig->axis[a].now.um;
    }
    *now = pos;
    return 0;
}

bool sst_rig_still(struct sst_rig *rig)
{
    if (rig->moving)
        return false;
    for (int a = 0; a < rig->cfg.axes; a++) {
        const int64_t now_ns = sst_clock_now_ns();
        struct watch w = { .last_um = rig->axis[a].now.um, .moved_ns = now_ns };

        if (!rig->axis[a].has_target || rig_drive_status(rig, a) || watch_axis(rig, a, &w, now_ns) != 1)
            return false;
    }
    return true;
}

void sst_rig_counters(const struct sst_rig *rig, struct sst_rig_counters *out)
{
    *out = rig->count;
}
