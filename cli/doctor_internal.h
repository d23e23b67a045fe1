/* cli/doctor_internal.h - findings of sst doctor, and the checks that make them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CLI_DOCTOR_INTERNAL_H
#define SST_CLI_DOCTOR_INTERNAL_H

#include "cli/cli_internal.h"

/* --- doctor: findings of sst doctor, and the checks that make them. --- */

#define DOCTOR_FINDINGS_MAX 64

enum doctor_level {
    DOCTOR_OK = 0,
    DOCTOR_WARNING = 1, /* works, but not well or not in every case */
    DOCTOR_PROBLEM = 2, /* capture will fail; with --law: against docs/use/law.md */
    DOCTOR_NOTE = 3,    /* not judged */
};

struct doctor_finding {
    enum doctor_level level;
    const char *area; /* static */
    char text[1536];  /* one sentence with its remedy */
    const char *key;  /* of the configuration, "storage.max_age_days", static; NULL: none */
};

struct doctor {
    const struct sst_array_config *cfg;
    const char *config; /* its file; NULL: the installed one, if it exists */
    const char *folder; /* folder for recordings; NULL: not given */
    int cameras;        /* that will stream, for the sums */
    int count;
    struct doctor_finding finding[DOCTOR_FINDINGS_MAX];
};

void doctor_add(struct doctor *d, enum doctor_level level, const char *area, const char *fmt, ...) SST_PRINTF(4, 5);

/* doctor_devices.c */
void doctor_check_cameras(struct doctor *d);
void doctor_check_still(struct doctor *d);
/** GenICam cameras that are bound, and their clocks. */
void doctor_check_genicam(struct doctor *d);
void doctor_check_bandwidth(struct doctor *d);
void doctor_check_trigger(struct doctor *d);
void doctor_check_rig(struct doctor *d);

/* doctor_system.c */
void doctor_check_disk(struct doctor *d);
void doctor_check_limits(struct doctor *d);
void doctor_check_clock(struct doctor *d);
/** Of several hosts: certificates, and on a node whether the head can be reached. */
void doctor_check_hosts(struct doctor *d);
void doctor_check_uvcvideo(struct doctor *d);
void doctor_check_gpu(struct doctor *d);

/* doctor_law.c */
/** Retention and privacy of the whole configuration, age of stored items. @return 0, or as sst_config_read() */
SST_MUST_CHECK int doctor_check_law(struct doctor *d);

/* doctor_live.c */
/** Work of the live picture's device, and of the CPU. */
void doctor_check_live(struct doctor *d);
/** "labels, render": a list that ends with NULL. */
void cli_steps_text(char *out, size_t size, const char *const *steps);

#endif
