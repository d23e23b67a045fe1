/* cli/doctor.h - findings of sst doctor, and the checks that make them. */
#ifndef SST_CLI_DOCTOR_H
#define SST_CLI_DOCTOR_H

#include "cli/usb.h"
#include "config/array.h"

#define DOCTOR_FINDINGS_MAX 64

enum doctor_level {
    DOCTOR_OK = 0,
    DOCTOR_WARNING = 1, /* works, but not well or not in every case */
    DOCTOR_PROBLEM = 2, /* capture will fail */
};

struct doctor_finding {
    enum doctor_level level;
    const char *area; /* static */
    char text[640];   /* one sentence with its remedy */
};

struct doctor {
    const struct sst_array_config *cfg;
    const char *folder; /* where recordings will go; NULL: not told */
    int cameras;        /* that will stream, for the sums */
    int count;
    struct doctor_finding finding[DOCTOR_FINDINGS_MAX];
};

void doctor_say(struct doctor *d, enum doctor_level level, const char *area, const char *fmt, ...) SST_PRINTF(4, 5);

/* doctor_devices.c */
void doctor_check_cameras(struct doctor *d);
void doctor_check_bandwidth(struct doctor *d);
void doctor_check_trigger(struct doctor *d);
void doctor_check_rig(struct doctor *d);

/* doctor_system.c */
void doctor_check_disk(struct doctor *d);
void doctor_check_limits(struct doctor *d);
void doctor_check_clock(struct doctor *d);
void doctor_check_uvcvideo(struct doctor *d);

#endif
