/* drivers/rig/rig_internal.h - private declarations of this folder; code outside of it includes the public headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_RIG_RIG_INTERNAL_H
#define SST_DRIVERS_RIG_RIG_INTERNAL_H

#include <stdatomic.h>
#include <stdbool.h>

#include "base/file.h"
#include "drivers/rig/rig.h"

/* --- profile: register map of a motor drive, read from config/profiles/NAME.yaml. --- */

#define SST_RIG_REGISTERS_MAX 64
#define SST_RIG_STEPS_MAX     24
#define SST_RIG_ALARMS_MAX    128
#define SST_RIG_WORD_MAX      48

enum rig_table {
    SST_RIG_HOLDING = 0,
    SST_RIG_INPUT = 1,
    SST_RIG_COIL = 2,
    SST_RIG_DISCRETE = 3,
};

enum rig_type {
    SST_RIG_U16 = 0,
    SST_RIG_S16 = 1,
    SST_RIG_U32 = 2,
    SST_RIG_S32 = 3,
    SST_RIG_BIT = 4, /* of coils and discrete inputs */
};

struct rig_register {
    char name[SST_RIG_WORD_MAX];
    enum rig_table table;
    enum rig_type type;
    int address;
    bool low_first; /* of two registers, the low word is first */
    bool read_back; /* can be read back after writing */
    double scale;   /* counts (or counts/s, counts/s2) of one unit of the raw value */
};

/** Status flags of a drive. */
enum rig_flag {
    SST_RIG_MOVING = 0,
    SST_RIG_IN_POSITION = 1,
    SST_RIG_HOMED = 2,
    SST_RIG_ALARM = 3,
    SST_RIG_ENABLED = 4, /* optional, like all that follow */
    SST_RIG_LIMIT_LOW = 5,
    SST_RIG_LIMIT_HIGH = 6,
    SST_RIG_ACKNOWLEDGE = 7, /* for wait steps */
    SST_RIG_FLAGS = 8,
};

struct rig_bit {
    int reg; /* index; -1: not available on this drive */
    unsigned mask, equals;
    bool inverted;
};

enum rig_sequence {
    SST_RIG_SEQ_ENABLE = 0, /* optional */
    SST_RIG_SEQ_SETUP = 1,  /* optional: before each move, speed and the like */
    SST_RIG_SEQ_MOVE = 2,
    SST_RIG_SEQ_HOME = 3,
    SST_RIG_SEQ_STOP = 4,
    SST_RIG_SEQ_RESET = 5, /* alarms */
    SST_RIG_SEQUENCES = 6,
};

enum rig_value {
    SST_RIG_NUMBER = 0,
    SST_RIG_TARGET = 1, /* counts */
    SST_RIG_SPEED = 2,  /* counts/s; the step is skipped if the configuration has no speed */
    SST_RIG_ACCEL = 3,  /* counts/s2; the step is skipped if the configuration has no acceleration */
};

struct rig_step {
    enum { SST_RIG_WRITE = 0, SST_RIG_WAIT = 1, SST_RIG_PAUSE = 2 } what;
    int reg;              /* write */
    enum rig_value value; /* write */
    double number;        /* write */
    enum rig_flag flag;   /* wait; write: confirmed by this flag, or SST_RIG_FLAGS */
    bool is;              /* wait */
    int ms;               /* wait: at most; pause */
};

struct rig_profile {
    char path[SST_PATH_MAX], name[128], manual[256];
    bool tried; /* on hardware */
    int gap_ms; /* between two requests */
    int registers;
    struct rig_register reg[SST_RIG_REGISTERS_MAX];
    int identity; /* register with the type of the drive, or -1 */
    long identity_value;
    int position;   /* register of the actual (else the commanded) position */
    int alarm_code; /* register, or -1 */
    struct rig_bit bit[SST_RIG_FLAGS];
    int steps[SST_RIG_SEQUENCES];
    struct rig_step step[SST_RIG_SEQUENCES][SST_RIG_STEPS_MAX];
    int alarms;
    struct {
        long code;
        char text[96];
    } alarm[SST_RIG_ALARMS_MAX];
};

/**
 * Read a profile: a path (with a slash or .yaml), or a name that is searched in $SST_PROFILES, beside the program and
 * in the installed share/sst/profiles.
 * @return 0, -ENOENT (with the searched folders), -EBADMSG, -EACCES, -ENOMEM; logged.
 */
SST_MUST_CHECK int rig_profile_read(struct rig_profile *out, const char *name);

/** "0x21 (following error)"; only the code if the profile has no text. */
void rig_profile_alarm(const struct rig_profile *profile, long code, char *text, size_t size);

/* --- bus: requests over Modbus TCP and RTU, one at a time, each with a deadline. Inside drivers/rig only. --- */

struct rig_bus; /* opaque; one thread at a time */

/**
 * Connect.
 * @param bus    "tcp:HOST:PORT" or "rtu:DEVICE,BAUD,8E1"
 * @param count  its requests and failures are counted there; outlives the bus
 * @return 0, -EINVAL (form of bus), -EMFILE (no low descriptor left), -EHOSTUNREACH, -ECONNREFUSED, -ENODEV, -EACCES,
 * -EBUSY (serial line in use), -ENOMEM, -ENOSYS (built without libmodbus); logged.
 */
SST_MUST_CHECK int rig_bus_open(struct rig_bus **out, const char *bus, int response_ms, int gap_ms,
                                struct sst_rig_counters *count);
void rig_bus_close(struct rig_bus *bus);

/** Registers or bits of a unit: 1 or 2 registers, or 1 bit (values 0 and 1). */
struct rig_place {
    int unit;
    enum rig_table table;
    int address, count;
};

/**
 * One request, tried once. Not logged: rig_bus_why() describes the failure.
 *
 * @return 0; no valid reply: -ETIMEDOUT, -EBADMSG (garbled, other unit), -ENOTCONN (line lost): call
 *         rig_bus_restore() before the next request; answered by an exception: -EAGAIN (busy: not carried out),
 *         -EINPROGRESS (accepted, takes longer), -EHOSTDOWN (a gateway got no reply of the drive), -EPROTO (unknown
 *         function, register or value), -EREMOTEIO (all others).
 */
SST_MUST_CHECK int rig_bus_read(struct rig_bus *bus, struct rig_place at, uint16_t *out);
SST_MUST_CHECK int rig_bus_write(struct rig_bus *bus, struct rig_place at, const uint16_t *values);

/** Cause of the last failed request, one clause. */
const char *rig_bus_why(const struct rig_bus *bus);

/**
 * Restore the bus after a failed request, so that a late reply cannot be mistaken for the next request's. TCP
 * reconnects; a serial line is read until it is silent and the unit has answered an echo, and reopened if it was lost.
 * @param cancel  read between attempts; true gives up
 * @return 0, or the error of the last attempt after reconnect_ms
 */
SST_MUST_CHECK int rig_bus_restore(struct rig_bus *bus, int reconnect_ms, const SST_ATOMIC(bool) * cancel);

/* --- drive: runs the profile of one axis: status, steps, read-back --- */

struct rig_status {
    bool flag[SST_RIG_FLAGS];
    int32_t um;
    long alarm; /* code; 0 without */
};

struct rig_axis {
    struct rig_status now; /* as last read */
    int32_t target_um;
    bool has_target;
};

struct sst_rig {
    struct sst_rig_config cfg;  /* fixed after open */
    struct rig_profile profile; /* fixed after open */
    struct rig_bus *bus;
    struct rig_axis axis[SST_RIG_AXES];
    struct sst_rig_counters count;
    bool moving, doubt; /* doubt: positions are unreliable until homing */
    bool hurry;         /* no retries: other axes wait */
    int64_t logged_ns;  /* last time a fault of the bus was logged; 0: never */
    SST_ATOMIC(bool) cancel;
};

/** "axis x (unit 1)" for messages. */
const char *rig_axis_name(const struct sst_rig *rig, int a, char text[32]);

/** Read flags, then position, with the configured number of retries. @return 0, -ETIMEDOUT, -EIO, -ECANCELED;
 * logged. */
SST_MUST_CHECK int rig_drive_status(struct sst_rig *rig, int a);

/** Value of the identity register, or -1 if the profile has none. */
SST_MUST_CHECK int rig_drive_identity(struct sst_rig *rig, int a, long *value);

/**
 * Run a sequence of the profile. A write without a reply is repeated only if read-back, or the flag that confirms it,
 * shows that it did not arrive; one that the drive acknowledges (exception 5) is done when read-back or the flag shows
 * it. A busy drive is asked again for reconnect_ms.
 * @param um  target of a move
 * @return 0, -ETIMEDOUT (a wait step, or the bus), -EIO, -ECANCELED (only before the first write); logged.
 */
SST_MUST_CHECK int rig_drive_run(struct sst_rig *rig, int a, enum rig_sequence which, int32_t um);

/** Sleep in steps that end early when the rig is cancelled. */
void rig_sleep_ms(struct sst_rig *rig, int ms);

#endif
