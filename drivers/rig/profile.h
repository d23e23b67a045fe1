/* drivers/rig/profile.h - what a motor drive's registers mean, read from config/profiles/NAME.yaml. */
#ifndef SST_DRIVERS_RIG_PROFILE_H
#define SST_DRIVERS_RIG_PROFILE_H

#include <stdbool.h>

#include "base/file.h"

#define SST_RIG_REGISTERS_MAX 64
#define SST_RIG_STEPS_MAX     24
#define SST_RIG_ALARMS_MAX    128
#define SST_RIG_WORD_MAX      48

enum sst_rig_table {
    SST_RIG_HOLDING = 0,
    SST_RIG_INPUT = 1,
    SST_RIG_COIL = 2,
    SST_RIG_DISCRETE = 3,
};

enum sst_rig_type {
    SST_RIG_U16 = 0,
    SST_RIG_S16 = 1,
    SST_RIG_U32 = 2,
    SST_RIG_S32 = 3,
    SST_RIG_BIT = 4, /* of coils and discrete inputs */
};

struct sst_rig_register {
    char name[SST_RIG_WORD_MAX];
    enum sst_rig_table table;
    enum sst_rig_type type;
    int address;
    bool low_first; /* of two registers the one with the low word comes first */
    bool read_back; /* reading shows what was written */
    double scale;   /* counts (or counts/s, counts/s2) of one unit of the raw value */
};

/** What the driver asks a drive. */
enum sst_rig_flag {
    SST_RIG_MOVING = 0,
    SST_RIG_IN_POSITION = 1,
    SST_RIG_HOMED = 2,
    SST_RIG_ALARM = 3,
    SST_RIG_ENABLED = 4, /* optional, as all that follow */
    SST_RIG_LIMIT_LOW = 5,
    SST_RIG_LIMIT_HIGH = 6,
    SST_RIG_ACKNOWLEDGE = 7, /* for wait steps */
    SST_RIG_FLAGS = 8,
};

struct sst_rig_bit {
    int reg; /* index; -1: this drive does not tell */
    unsigned mask, equals;
    bool inverted;
};

enum sst_rig_sequence {
    SST_RIG_SEQ_ENABLE = 0, /* optional */
    SST_RIG_SEQ_SETUP = 1,  /* optional: before each move, speed and the like */
    SST_RIG_SEQ_MOVE = 2,
    SST_RIG_SEQ_HOME = 3,
    SST_RIG_SEQ_STOP = 4,
    SST_RIG_SEQ_RESET = 5, /* alarms */
    SST_RIG_SEQUENCES = 6,
};

enum sst_rig_value {
    SST_RIG_NUMBER = 0,
    SST_RIG_TARGET = 1, /* counts */
    SST_RIG_SPEED = 2,  /* counts/s; the step is left out where the configuration gives none */
    SST_RIG_ACCEL = 3,  /* counts/s2; likewise */
};

struct sst_rig_step {
    enum { SST_RIG_WRITE = 0, SST_RIG_WAIT = 1, SST_RIG_PAUSE = 2 } what;
    int reg;                  /* write */
    enum sst_rig_value value; /* write */
    double number;            /* write */
    enum sst_rig_flag flag;   /* wait; write: shown by this flag, or SST_RIG_FLAGS */
    bool is;                  /* wait */
    int ms;                   /* wait: at most; pause */
};

struct sst_rig_profile {
    char path[SST_PATH_MAX], name[128], manual[256];
    bool tried; /* on hardware */
    int gap_ms; /* between two requests */
    int registers;
    struct sst_rig_register reg[SST_RIG_REGISTERS_MAX];
    int identity; /* register that tells what drive it is, or -1 */
    long identity_value;
    int position;   /* register of the true (else the counted) position */
    int alarm_code; /* register, or -1 */
    struct sst_rig_bit bit[SST_RIG_FLAGS];
    int steps[SST_RIG_SEQUENCES];
    struct sst_rig_step step[SST_RIG_SEQUENCES][SST_RIG_STEPS_MAX];
    int alarms;
    struct {
        long code;
        char text[96];
    } alarm[SST_RIG_ALARMS_MAX];
};

/**
 * Read a profile: a path (with a slash or .yaml), or a name that is looked for in $SST_PROFILES, beside the program and
 * in the installed share/sst/profiles.
 * @return 0, -ENOENT (the folders that were searched are named), -EBADMSG, -EACCES, -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_rig_profile_read(struct sst_rig_profile *out, const char *name);

/** "0x21 (following error)"; the code alone where the profile has no text. */
void sst_rig_profile_alarm(const struct sst_rig_profile *profile, long code, char *text, size_t size);

#endif
