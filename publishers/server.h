/* publishers/server.h - publisher that listens for clients: reports to the service, and begins again when its part of
 * the configuration has changed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PUBLISHERS_SERVER_H
#define SST_PUBLISHERS_SERVER_H

#include <stdatomic.h>

#include "publishers/publisher.h"

struct sst_server {
    /* fixed after sst_server_begin() */
    struct sst_publisher publisher; /* name, program, help: set before */
    struct sst_config config;
    char **argv;
    const char *const *sections; /* of the configuration that it reads, ends in NULL; set before */
    /* set before, or NULL: callbacks on the thread of events */
    void (*connected)(void *arg, bool connected);
    void (*event)(void *arg, const json_t *event);
    void *arg;
    atomic_bool stop;
    /* under lock */
    pthread_mutex_t lock;
    pthread_cond_t changed;
    bool dirty; /* to be reported at once */
    int clients;
    char refused[64];  /* address of the last wrong password; "": none since the last report */
    char problem[256]; /* why nothing is served; "": it is */
};

/** sst_publisher_begin(), with SIGTERM and SIGINT blocked: the main thread waits for them in sst_server_wait(). */
int sst_server_begin(struct sst_server *s, int argc, char **argv);

/** Follow the service and, if `enabled`, report to it and call open() until it succeeds, then run(). A disabled one
 * waits for another configuration. @return 0 or -errno; logged */
SST_MUST_CHECK int sst_server_start(struct sst_server *s, bool enabled, void *(*serve)(void *));

/** Try until it succeeds, or the program is to end: a failure is logged once, and part of the service's status.
 *  @param open  0 or -errno, logged @return false: the program is to end */
bool sst_server_open(struct sst_server *s, int (*open)(struct sst_server *s));

/** Until the program is to end; then `stop` is set. */
void sst_server_wait(struct sst_server *s);

/** A client sent a wrong password. @param s  struct sst_server. Thread: any */
void sst_server_report_refused(void *s, const char *address);
/** The number of clients. Thread: any */
void sst_server_report_clients(struct sst_server *s, int clients);

#endif
