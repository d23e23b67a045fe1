/* daemon/counters/counters.h - counters and problems of the publishers (HTTP, RTSP, ONVIF), for status and metrics. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_COUNTERS_COUNTERS_H
#define SST_DAEMON_COUNTERS_COUNTERS_H

#include <pthread.h>
#include <stdbool.h>

#include "base/base.h"

enum sst_counters_publisher {
    SST_COUNTERS_HTTP = 0, /* part of the service */
    SST_COUNTERS_RTSP = 1, /* a separate program, which reports to the service */
    SST_COUNTERS_ONVIF = 2, /* the same */
    SST_COUNTERS_PUBLISHERS = 3,
};

#define SST_COUNTERS_PROBLEM 256

/** Since the start; written by HTTP, any thread. */
struct sst_counters {
    /* atomic */
    SST_ATOMIC(uint64_t) requests, refused; /* refused: wrong or no token, role, host, method, too large, too many */
    SST_ATOMIC(uint64_t) bytes;             /* sent */
    SST_ATOMIC(uint64_t) skipped;           /* frames that slow viewers did not get */
    SST_ATOMIC(uint64_t) slow;              /* downloads of slow clients, ended to free their slots for others */
    SST_ATOMIC(int) clients, streams, listeners; /* now; listeners: of the event stream */
    SST_ATOMIC(int) videos;                      /* streams that get H.264 */
    SST_ATOMIC(int64_t) certificate_until_s;     /* end of the certificate of HTTPS, since 1970; 0: none */
    /* under lock */
    pthread_mutex_t lock;
    char encoder[16]; /* of H.264, the last one that was opened; "": none yet */
    struct {
        char problem[SST_COUNTERS_PROBLEM]; /* why it does not publish; "": it publishes */
        int clients, pid;
        unsigned restarts;
        int64_t until_ns; /* the report expires then; 0: there is none, or it never expires */
    } publisher[SST_COUNTERS_PUBLISHERS];
};

void sst_counters_init(struct sst_counters *c);
void sst_counters_fini(struct sst_counters *c);

/** Set why a part of the service does not publish. @param problem  "": it publishes */
void sst_counters_set_problem(struct sst_counters *c, enum sst_counters_publisher publisher, const char *problem);

/** Name and get the encoder of H.264. */
void sst_counters_set_encoder(struct sst_counters *c, const char *name);
void sst_counters_encoder(struct sst_counters *c, char out[16]);

/** Store the report of a program; it expires after 30 s. A new `pid` counts as a restart. */
void sst_counters_report(struct sst_counters *c, enum sst_counters_publisher publisher, int pid, int clients,
                         const char *problem);

/** Number of clients of a program, from its last report. @param restarts  out */
int sst_counters_clients(struct sst_counters *c, enum sst_counters_publisher publisher, unsigned *restarts);

/** The first problem of any publisher. @param out  unchanged if there is none @return false: none */
bool sst_counters_problem(struct sst_counters *c, char out[SST_COUNTERS_PROBLEM]);

#endif
