/* Model of the drives' motion in ticks of 1 ms: a trapezoidal profile of the command, and the mechanics that follow. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/rig/rig_internal.h"

#include <math.h>

#include "simulators/scene/noise.h"

#define TICK_NS           1000000
#define TICK_S            1e-3
#define IDLE_TICKS        300    /* after this long at rest the state no longer changes */
#define INDEX_UM          2000.0 /* distance of index pulses: the screw's lead */
#define RING_HZ           25.0   /* vibration of the frame after an arrival ... */
#define RING_TAU_S        0.03   /* ... and its decay time */
#define RING_PER_ACCEL    2e-5   /* um for each um/s2 of deceleration */
#define IN_POSITION_TICKS 5

enum mode { IDLE = 0, POSITIONING = 1, HOMING = 2, HALTING = 3 };
enum homing { SEEK_SWITCH = 0, LEAVE_SWITCH = 1, SEEK_INDEX = 2 };

void sim_axis_init(struct sim_axis *axis, int index, uint64_t seed, int64_t t_ns)
{
    static const double travel_um[SST_SIM_AXES] = { 400000, 400000, 100000 };
    uint64_t state = seed * SST_SIM_AXES + (uint64_t)index;
    const uint64_t random = sst_random_u64(&state);

    *axis = (struct sim_axis){
        .soft_low = -1000,
        .soft_high = (int32_t)travel_um[index] + 1000,
        .speed = 100000,
        .accel = 1000000,
        .home_speed = 50000,
        .window = 10,
        .following_limit = 2000,
        .t_ns = t_ns,
        .first_ns = t_ns,
        .low_stop = -5000,
        .high_stop = travel_um[index] + 5000,
        .switch_at = -500,
        .pos = 1000.0 + (double)(random % 4000),
    };
    axis->cmd = axis->goal = axis->zero = axis->offset = axis->pos;
    for (int i = 0; i < SST_SIM_TRACE; i++)
        axis->trace[i] = (float)axis->pos;
    axis->settled_ticks = IDLE_TICKS;
}

/* --- commands ----------------------------------------------------------------------------------------------------- */

static void begin(struct sim_axis *axis, enum mode mode, double goal, double cruise)
{
    axis->mode = (int)mode;
    axis->from = axis->cmd;
    axis->goal = goal;
    axis->cruise = cruise;
    axis->settled_ticks = 0;
    axis->ring = 0;
}

static void end(struct sim_axis *axis, enum mode mode)
{
    begin(axis, mode, axis->cmd, axis->cruise);
    axis->vel = 0;
}

static void halt(struct sim_axis *axis)
{
    if (axis->mode == IDLE)
        return;
    begin(axis, HALTING, axis->cmd + axis->vel * fabs(axis->vel) / (2.0 * axis->accel), fabs(axis->vel));
}

void sim_axis_alarm(struct sim_axis *axis, uint16_t code)
{
    axis->alarm = code;
    axis->cmd = axis->pos - axis->lost;
    end(axis, IDLE);
}

void sim_axis_power_loss(struct sim_axis *axis)
{
    axis->homed = axis->enabled = axis->stuck = axis->start_seen = axis->soft_hit = false;
    axis->control = 0;
    axis->alarm = 0;
    axis->lost = 0;
    axis->cmd = axis->zero = axis->offset = axis->pos;
    end(axis, IDLE);
}

static void reset(struct sim_axis *axis)
{
    axis->alarm = 0;
    axis->stuck = axis->pressed_low = axis->pressed_high = false;
    axis->cmd = axis->pos - axis->lost;
    end(axis, IDLE);
}

static int start_positioning(struct sim_axis *axis)
{
    const int32_t target = axis->target < axis->soft_low    ? axis->soft_low
                           : axis->target > axis->soft_high ? axis->soft_high
                                                            : axis->target;

    if (axis->alarm || !axis->enabled || !axis->homed)
        return 4;
    if (axis->mode == HOMING)
        return 6;
    axis->soft_hit = target != axis->target;
    begin(axis, POSITIONING, axis->zero + target, axis->speed);
    return 0;
}

static int start_homing(struct sim_axis *axis)
{
    if (axis->alarm || !axis->enabled)
        return 4;
    if (axis->mode == HOMING)
        return 6;
    axis->homed = false;
    axis->phase = SEEK_SWITCH;
    begin(axis, HOMING, axis->low_stop - 1000 - axis->lost, axis->home_speed);
    return 0;
}

int sim_axis_control(struct sim_axis *axis, uint16_t word)
{
    const uint16_t rising = word & (uint16_t)~axis->control;
    int err = 0;

    if (rising & SST_SIM_CTL_RESET)
        reset(axis);
    axis->enabled = word & SST_SIM_CTL_ENABLE && !axis->alarm;
    if (!axis->enabled && axis->mode != IDLE)
        end(axis, IDLE);
    if (word & SST_SIM_CTL_HALT)
        halt(axis);
    else if (rising & SST_SIM_CTL_HOME)
        err = start_homing(axis);
    else if (rising & SST_SIM_CTL_START)
        err = start_positioning(axis);
    if (err)
        return err;
    axis->start_seen = word & SST_SIM_CTL_START;
    axis->control = word;
    return 0;
}

/* --- motion ------------------------------------------------------------------------------------------------------- */

/* One tick of the trapezoid towards the goal; true on arrival. */
static bool step_profile(struct sim_axis *axis)
{
    const double left = axis->goal - axis->cmd, dir = left < 0 ? -1 : 1, a = axis->accel, dv = a * TICK_S;
    double v = axis->vel * dir;
    /* The speed from which the remaining distance suffices to stop, in ticks. */
    const double brake = sqrt(2 * a * fabs(left) + dv * dv / 4) - dv / 2;

    v = fmin(fmin(v + dv, axis->cruise), fmax(brake, v - dv));
    if (fabs(left) <= fmax(v, dv) * TICK_S) {
        axis->cmd = axis->goal;
        axis->vel = 0;
        return true;
    }
    axis->vel = v * dir;
    axis->cmd += axis->vel * TICK_S;
    return false;
}

static void arrive(struct sim_axis *axis)
{
    axis->ring = axis->mode == POSITIONING && fabs(axis->goal - axis->from) > 1 ? RING_PER_ACCEL * axis->accel : 0;
    axis->ring_age = 0;
    axis->mode = IDLE;
    axis->settled_ticks = 0;
    if (!axis->faults.keep)
        axis->faults.lies = false;
}

static void step_homing(struct sim_axis *axis)
{
    const double slow = fmax(axis->home_speed / 10.0, 1);
    const bool on = axis->pos < axis->switch_at, arrived = step_profile(axis);

    if (axis->phase == SEEK_SWITCH && on) {
        axis->phase = LEAVE_SWITCH;
        axis->vel = 0;
        begin(axis, HOMING, axis->switch_at - axis->lost + INDEX_UM, slow);
    } else if (axis->phase == LEAVE_SWITCH && !on) {
        /* The next index pulse is at mechanical 0, less than one lead away. */
        axis->phase = SEEK_INDEX;
        begin(axis, HOMING, -axis->lost, slow);
    } else if (arrived && axis->phase == SEEK_INDEX) {
        axis->zero = axis->cmd;
        axis->offset = axis->pos;
        axis->homed = true;
        axis->mode = IDLE;
        axis->ring = 0;
    } else if (arrived) {
        sim_axis_alarm(axis, SST_SIM_ALARM_HOMING);
    }
}

/* Progress of the motion, 0..1. */
static double progress(const struct sim_axis *axis)
{
    const double way = axis->goal - axis->from;

    return fabs(way) < 1 ? 1 : (axis->cmd - axis->from) / way;
}

static void meddle(struct sim_axis *axis)
{
    struct sim_axis_faults *f = &axis->faults;

    if (axis->mode == IDLE || progress(axis) < 0.5 || fabs(axis->goal - axis->from) < 100)
        return;
    if (f->stall && !axis->stuck) {
        axis->stuck = true;
        axis->stuck_at = axis->pos;
        f->stall = f->keep;
    }
    if (f->limit) {
        if (axis->vel < 0)
            axis->pressed_low = true;
        else
            axis->pressed_high = true;
        f->limit = f->keep;
    }
    if (f->lost_steps) {
        axis->lost -= f->lost_steps;
        f->lost_steps = 0;
    }
}

static void step_mechanics(struct sim_axis *axis)
{
    double ring = 0;

    if (axis->ring > 0) {
        axis->ring_age += TICK_S;
        ring = axis->ring * exp(-axis->ring_age / RING_TAU_S) * sin(2 * 3.14159265358979 * RING_HZ * axis->ring_age);
    }
    axis->pos = axis->stuck
                    ? axis->stuck_at
                    : sst_clamp_double(axis->cmd + axis->lost + ring, axis->low_stop - 500, axis->high_stop + 500);
    if (axis->mode == POSITIONING &&
        (axis->pressed_low || axis->pressed_high || axis->pos <= axis->low_stop || axis->pos >= axis->high_stop))
        sim_axis_alarm(axis, SST_SIM_ALARM_LIMIT);
    /* Lost steps go unnoticed: the drive controls its own count. */
    if (fabs(axis->cmd + axis->lost - axis->pos) > axis->following_limit)
        sim_axis_alarm(axis, SST_SIM_ALARM_FOLLOWING);
    if (axis->mode == IDLE && fabs(axis->cmd + axis->lost - axis->pos) <= axis->window) {
        if (axis->settled_ticks < IDLE_TICKS)
            axis->settled_ticks++;
    } else {
        axis->settled_ticks = 0;
    }
}

static void tick(struct sim_axis *axis)
{
    if (axis->mode == HOMING) {
        step_homing(axis);
    } else if (axis->mode != IDLE && step_profile(axis)) {
        arrive(axis);
    }
    meddle(axis);
    step_mechanics(axis);
}

static size_t slot(const struct sim_axis *axis, int64_t t_ns)
{
    return (size_t)((t_ns - axis->first_ns) / TICK_NS) % SST_SIM_TRACE;
}

void sim_axis_advance(struct sim_axis *axis, int64_t t_ns)
{
    while (axis->t_ns + TICK_NS <= t_ns) {
        const int64_t ticks = (t_ns - axis->t_ns) / TICK_NS;

        /* At rest for long: the trace holds a single position, however long the rest lasts. */
        if (axis->mode == IDLE && !axis->stuck && axis->settled_ticks == IDLE_TICKS && ticks > SST_SIM_TRACE)
            axis->t_ns += (ticks - SST_SIM_TRACE) * TICK_NS;
        tick(axis);
        axis->t_ns += TICK_NS;
        axis->trace[slot(axis, axis->t_ns)] = (float)axis->pos;
    }
}

double sim_axis_position(struct sim_axis *axis, int64_t t_ns)
{
    const int64_t oldest = axis->t_ns - (int64_t)(SST_SIM_TRACE - 2) * TICK_NS;
    double part;

    sim_axis_advance(axis, t_ns);
    if (t_ns >= axis->t_ns)
        return axis->pos;
    if (t_ns < oldest || t_ns < axis->first_ns)
        t_ns = oldest > axis->first_ns ? oldest : axis->first_ns;
    part = (double)((t_ns - axis->first_ns) % TICK_NS) / TICK_NS;
    return axis->trace[slot(axis, t_ns)] * (1 - part) + axis->trace[slot(axis, t_ns + TICK_NS)] * part;
}

/* --- readings ----------------------------------------------------------------------------------------------------- */

uint16_t sim_axis_status(const struct sim_axis *axis)
{
    const bool lies = axis->faults.lies && axis->mode == POSITIONING && progress(axis) > 0.3;
    const bool moving = axis->mode != IDLE && !lies;
    unsigned word = 0;

    word |= axis->alarm ? SST_SIM_ALARM : SST_SIM_READY;
    word |= axis->enabled && !axis->alarm ? SST_SIM_ENABLED : 0u;
    word |= moving ? SST_SIM_MOVING : 0u;
    word |= lies || axis->settled_ticks >= IN_POSITION_TICKS ? SST_SIM_IN_POSITION : 0u;
    word |= axis->homed ? SST_SIM_HOMED : 0u;
    word |= axis->mode == HOMING ? SST_SIM_HOMING : 0u;
    word |= axis->pressed_low || axis->pos <= axis->low_stop ? SST_SIM_LIMIT_LOW : 0u;
    word |= axis->pressed_high || axis->pos >= axis->high_stop ? SST_SIM_LIMIT_HIGH : 0u;
    word |= axis->pos < axis->switch_at ? SST_SIM_HOME_SWITCH : 0u;
    word |= axis->start_seen ? SST_SIM_START_SEEN : 0u;
    word |= axis->soft_hit ? SST_SIM_SOFT_LIMIT : 0u;
    return (uint16_t)word;
}
