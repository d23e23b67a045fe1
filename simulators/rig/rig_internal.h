/* simulators/rig/rig_internal.h - private declarations of this folder; code outside of it includes the public
 * headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_RIG_RIG_INTERNAL_H
#define SST_SIMULATORS_RIG_RIG_INTERNAL_H

#include <stdbool.h>

#include "base/base.h"

/* --- model: one servo axis: motion, homing, limits, alarms, faults; no I/O. --- */

#define SST_SIM_AXES  3
#define SST_SIM_TRACE 8192 /* ticks of 1 ms in the trace of true positions */

/** Status word (docs/use/rig.md). */
enum sim_status {
    SST_SIM_READY = 1 << 0, /* no alarm */
    SST_SIM_ENABLED = 1 << 1,
    SST_SIM_MOVING = 1 << 2,      /* a motion is commanded */
    SST_SIM_IN_POSITION = 1 << 3, /* commanded motion finished, deviation inside the window for 5 ms */
    SST_SIM_HOMED = 1 << 4,
    SST_SIM_HOMING = 1 << 5,
    SST_SIM_ALARM = 1 << 6,
    SST_SIM_LIMIT_LOW = 1 << 7,
    SST_SIM_LIMIT_HIGH = 1 << 8,
    SST_SIM_HOME_SWITCH = 1 << 9,
    SST_SIM_START_SEEN = 1 << 10, /* follows the start bit of the control word */
    SST_SIM_SOFT_LIMIT = 1 << 11, /* the last target was clamped to the soft limit */
};

/** Control word. */
enum axis_control {
    SST_SIM_CTL_ENABLE = 1 << 0,
    SST_SIM_CTL_START = 1 << 1, /* rising edge */
    SST_SIM_CTL_HOME = 1 << 2,  /* rising edge */
    SST_SIM_CTL_HALT = 1 << 3,  /* decelerate and hold */
    SST_SIM_CTL_RESET = 1 << 4, /* rising edge */
};

enum sim_alarm {
    SST_SIM_ALARM_NONE = 0,
    SST_SIM_ALARM_FOLLOWING = 0x21, /* deviation larger than register 0x0009 */
    SST_SIM_ALARM_LIMIT = 0x30,     /* a limit switch during positioning */
    SST_SIM_ALARM_HOMING = 0x35,    /* no home switch within the travel */
};

/** Faults of an axis. A one-shot fault is consumed by the motion or alarm that it caused. */
struct sim_axis_faults {
    bool stall, limit, lies; /* with the next motion */
    bool keep;               /* they stay until switched off */
    int lost_steps;          /* counts lost in the next motion */
};

struct sim_axis {
    /* settings, by register; counts are um */
    int32_t target, soft_low, soft_high;
    uint32_t speed, accel, home_speed; /* counts/s, counts/s2 */
    uint16_t window, following_limit, control;
    struct sim_axis_faults faults;

    /* state at t_ns */
    int64_t t_ns;
    int mode, phase;       /* mode; phase of homing */
    double cmd, vel;       /* commanded position and speed, mechanical um (0: index pulse) */
    double goal, cruise;   /* of the motion */
    double from;           /* start of the motion */
    double pos;            /* true mechanical position, um from the index pulse */
    double ring, ring_age; /* amplitude at arrival, um; seconds since */
    double lost;           /* steps that the motor lost, um */
    double zero, offset;   /* mechanical position of the command counter's 0, and of the encoder's */
    double stuck_at;       /* position while stuck */
    int settled_ticks;
    bool stuck, homed, enabled, pressed_low, pressed_high, soft_hit, start_seen;
    uint16_t alarm;
    double low_stop, high_stop, switch_at; /* mechanical positions; the home switch is on below switch_at */

    float trace[SST_SIM_TRACE]; /* true position by tick, ring */
    int64_t first_ns;           /* start of the trace */
};

/** Power on at t_ns, at a position chosen by the seed, not homed. */
void sim_axis_init(struct sim_axis *axis, int index, uint64_t seed, int64_t t_ns);

/** Advance the simulation to t_ns; earlier times are ignored. */
void sim_axis_advance(struct sim_axis *axis, int64_t t_ns);

/** True position at a time, um from the index pulse; the latest known for future times, the oldest for times before
 *  the trace. */
double sim_axis_position(struct sim_axis *axis, int64_t t_ns);

/** Write the control word at the current simulation time. @return 0 or a Modbus exception: 4 refused, 6 busy. */
int sim_axis_control(struct sim_axis *axis, uint16_t word);

uint16_t sim_axis_status(const struct sim_axis *axis);

void sim_axis_alarm(struct sim_axis *axis, uint16_t code);
/** Restart the drive: not homed, servo off, counters at 0 at the current position. */
void sim_axis_power_loss(struct sim_axis *axis);

/* --- wire: Modbus requests and replies of the simulated drives, and wire faults; no I/O. --- */

#define SST_SIM_PDU_MAX 253

/** Activation of a wire fault: the next `left` replies, or every `every`-th. */
struct sim_when {
    int left, every, count;
};

struct sim_wire_faults {
    struct sim_when exception, acknowledge, noise, bad_crc, silence, late, wrong_unit, drop_bytes, disconnect;
    struct sim_when busy; /* each write: how often it is refused, and was */
    int exception_code, late_ms;
};

/** The three drives on one bus. */
struct sim_drives {
    struct sim_axis axis[SST_SIM_AXES]; /* unit a + 1 */
    struct sim_wire_faults faults;
};

/** True if this fault applies to the current reply; counts. */
bool sim_strikes(struct sim_when *when);

struct sim_query {
    int unit;
    const uint8_t *adu, *pdu; /* the whole message; function code and data, without unit and checksum */
    size_t size;              /* of the PDU */
};

/** Answer a request at t_ns. @return length of the reply; 0: no such unit */
size_t sim_drives_answer(struct sim_drives *bus, int64_t t_ns, const struct sim_query *q,
                         uint8_t reply[SST_SIM_PDU_MAX]);

/** Size of a request's PDU on a serial line, from its first bytes, function code first; 0: not yet known. */
size_t sim_request_size(const uint8_t *pdu, size_t have);

/** As sst_sim_drive_fault(). */
SST_MUST_CHECK int sim_drives_fault(struct sim_drives *bus, const char *name, const char *value, char *error,
                                    size_t error_size);

#endif
