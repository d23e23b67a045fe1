/* base/log_limit.h - warnings about network addresses: one a minute for each, which counts those in between. */
#ifndef SST_BASE_LOG_LIMIT_H
#define SST_BASE_LOG_LIMIT_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>

#include "base/base.h"

#define SST_LOG_LIMIT_ADDRESSES 16 /* at a time; all further ones share a line */

/** One thread. All but `what` is zero at first. */
struct sst_log_limit {
    const char *what; /* that the warnings are about: "hosts: connections that were refused" */
    struct sst_log_limit_address {
        uint8_t network[16]; /* as of base/brake.h */
        char text[64];
        int64_t since_ns; /* of the minute; 0: free */
        unsigned held;    /* left out since then */
    } address[SST_LOG_LIMIT_ADDRESSES + 1]; /* at last all others */
};

/** @param text  of the address @return true: the caller logs a line; false: it is counted */
bool sst_log_limit_due(struct sst_log_limit *l, const struct sockaddr *from, const char *text, int64_t now_ns);

/** Log what was counted in minutes that are over; to be called now and then. @param now_ns  INT64_MAX: all of it */
void sst_log_limit_work(struct sst_log_limit *l, int64_t now_ns);

#endif
