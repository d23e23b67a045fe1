/* base/log_limit.h - warnings about network addresses: one a minute for each address, with a count of the others. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_LOG_LIMIT_H
#define SST_BASE_LOG_LIMIT_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>

#include "base/base.h"

#define SST_LOG_LIMIT_ADDRESSES 16 /* at a time; all further ones share a line */

/** Used by one thread. All fields but `what` begin as zero. */
struct sst_log_limit {
    const char *what; /* subject of the warnings: "hosts: connections that were refused" */
    struct sst_log_limit_address {
        uint8_t network[16]; /* as of base/brake.h */
        char text[64];
        int64_t since_ns; /* of the minute; 0: free */
        unsigned held;    /* left out since then */
    } address[SST_LOG_LIMIT_ADDRESSES + 1]; /* the last one: all other addresses */
};

/** @param text  of the address @return true: the caller logs a line; false: it is counted */
bool sst_log_limit_due(struct sst_log_limit *l, const struct sockaddr *from, const char *text, int64_t now_ns);

/** Log the counts of minutes that have ended; called from the loop that owns it. @param now_ns  INT64_MAX: all counts */
void sst_log_limit_work(struct sst_log_limit *l, int64_t now_ns);

#endif
