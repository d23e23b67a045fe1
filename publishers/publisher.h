/* publishers/publisher.h - shared by the publisher programs: options, configuration, events of the service. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PUBLISHERS_PUBLISHER_H
#define SST_PUBLISHERS_PUBLISHER_H

#include <pthread.h>

#include "client/client.h"
#include "config/program.h"

#define SST_PUBLISHER_THREADS 4
#define SST_PUBLISHER_STOP_NS INT64_C(1800000000) /* least time that systemd gives them: TimeoutStopSec */

/** --help of a program, with a sentence. */
#define SST_PUBLISHER_HELP(program, what)                                                                              \
    program " [--config FILE] [--socket PATH] [-v]\n\n" what "\n\n"                                                    \
            "  --config FILE   configuration of the service; /etc/sst/sstd.yaml, and conf.d/*.yaml beside it\n"        \
            "  --socket PATH   control socket of the service instead of the configuration's\n"                         \
            "  -v, --verbose   log more (twice: everything)\n"                                                         \
            "      --version   print the version\n"                                                                    \
            "  -h, --help      this\n\n"                                                                               \
            "It follows each reload of the service, and waits while it is disabled in the configuration.\n"

/** A program that publishes pictures and events of the service, as a client of its API. */
struct sst_publisher {
    const char *name;                  /* "rtsp": in messages and reports */
    const char *program, *help;        /* "sst-rtsp", and its --help */
    const char *config_path;           /* NULL: the default */
    char socket[SST_CONFIG_TEXT_MAX];  /* of the service */
    struct sst_client_service service; /* the same, for sst_client_open() */
    pthread_t thread[SST_PUBLISHER_THREADS];
    int threads; /* of sst_publisher_start() */
};

/**
 * Parse the command line, set up log and signals, and read the configuration.
 *
 * @param p  name, program and help are set, all else is zero @param config  out, as read
 * @return SST_PROGRAM_GO_ON, or the exit status of the program
 */
int sst_publisher_begin(struct sst_publisher *p, struct sst_config *config, int argc, char **argv);

/** Start a thread, SST_PUBLISHER_THREADS at most. @return 0 or -errno; logged */
SST_MUST_CHECK int sst_publisher_start(struct sst_publisher *p, void *(*run)(void *), void *arg);

/** End the program with status 0: in an orderly way if all its threads, which know that they should, have ended by
 * then, else at once, as libraries must not be cleaned up under them. */
_Noreturn void sst_publisher_end(struct sst_publisher *p, int64_t until_ns);

/** Read the configuration again. @return true: a key that begins with one of `sections` (ends in NULL) has changed;
 *  false: none, or it cannot be read (logged) */
bool sst_publisher_changed(const struct sst_publisher *p, const struct sst_config *before, struct sst_config *out,
                           const char *const *sections);

/** sst_client_ask() that logs no error. @param why  out [SST_LOG_MAX], the error; NULL: not needed */
SST_MUST_CHECK int sst_publisher_ask(const struct sst_publisher *p, const char *path, const json_t *post, json_t **out,
                                     char *why);

/** Callbacks of sst_publisher_follow(), on its own thread. */
struct sst_publisher_listener {
    void (*connected)(void *arg, bool connected); /* true: also read the configuration again, it may be another one */
    void (*event)(void *arg, const json_t *event, const char *line);
    bool (*go_on)(void *arg); /* called about once a second */
    void *arg;
    bool kept; /* events from before the connection, too, as far as the service keeps them */
};

/** Receive the service's events until go_on() returns false. A service that is not there is logged once and tried again
 *  after 1, 2, 4 ... 30 s. */
void sst_publisher_follow(const struct sst_publisher *p, const struct sst_publisher_listener *listener);

#endif
