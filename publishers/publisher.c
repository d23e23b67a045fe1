/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* pthread_tryjoin_np */
#include "publishers/publisher.h"

#include <assert.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"

#define WAIT_MAX_S    30
#define JOIN_US       5000
#define SAME_START_NS INT64_C(2000000000) /* two readings of the start of one service differ by less */
#define EVENTS_PATH   "/api/v1/events/stream"

/* --- begin -------------------------------------------------------------------------------------------------------- */

int sst_publisher_begin(struct sst_publisher *p, struct sst_config *config, int argc, char **argv)
{
    struct sst_program program = { .name = p->program, .help = p->help };
    const int done = sst_program_begin(&program, config, argc, argv);

    if (done != SST_PROGRAM_GO_ON)
        return done;
    sst_thread_name(p->program);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGHUP, SIG_IGN);
    p->config_path = program.config;
    snprintf(p->socket, sizeof(p->socket), "%s", program.socket ? program.socket : config->control.socket);
    p->service.socket = p->socket;
    return SST_PROGRAM_GO_ON;
}

int sst_publisher_start(struct sst_publisher *p, void *(*run)(void *), void *arg)
{
    int err;

    assert(p->threads < SST_PUBLISHER_THREADS);
    err = -pthread_create(&p->thread[p->threads], NULL, run, arg);
    if (err)
        sst_log_error("%s: no thread: %s", p->name, strerror(-err));
    else
        p->threads++;
    return err;
}

void sst_publisher_end(struct sst_publisher *p, int64_t until_ns)
{
    while (p->threads) {
        if (!pthread_tryjoin_np(p->thread[p->threads - 1], NULL)) {
            p->threads--;
        } else if (sst_clock_now_ns() < until_ns) {
            usleep(JOIN_US);
        } else {
            fflush(NULL);
            _exit(EXIT_SUCCESS);
        }
    }
    exit(EXIT_SUCCESS);
}

bool sst_publisher_changed(const struct sst_publisher *p, const struct sst_config *before, struct sst_config *out,
                           const char *const *sections)
{
    struct sst_config_change *changes = NULL;
    bool changed = false;
    int n;

    sst_config_defaults(out);
    if (sst_config_read(out, p->config_path))
        return false;
    n = sst_config_diff(&changes, before, out);
    for (int i = 0; i < n; i++)
        for (int k = 0; sections[k]; k++)
            changed |= !strncmp(changes[i].key, sections[k], strlen(sections[k]));
    free(changes);
    return changed;
}

int sst_publisher_ask(const struct sst_publisher *p, const char *path, const json_t *post, json_t **out, char *why)
{
    char held[SST_LOG_MAX] = "", *before = sst_log_hold_errors(why ? why : held);
    const int err = sst_client_ask(&p->service, path, post, out);

    sst_log_hold_errors(before);
    return err;
}

/* --- events ------------------------------------------------------------------------------------------------------- */

struct follower {
    const struct sst_publisher *p;
    const struct sst_publisher_listener *listener;
    uint64_t seen;    /* id of the newest event */
    int64_t start_ns; /* of the service */
};

static int on_line(void *arg, const char *line)
{
    struct follower *f = arg;
    json_t *event = json_loads(line, 0, NULL);

    if (event) {
        f->seen = (uint64_t)json_integer_value(json_object_get(event, "id"));
        f->listener->event(f->listener->arg, event, line);
    }
    json_decref(event);
    return 0;
}

/* A service that was started again counts its events from 1. */
static int find_service(struct follower *f, struct sst_client *client)
{
    json_t *status = NULL;
    int64_t start_ns;
    const int err = sst_client_json(client, "/api/v1/status", NULL, &status);

    if (err)
        return err;
    start_ns = sst_clock_now_ns() - (int64_t)(json_number_value(json_object_get(status, "uptime_s")) * 1e9);
    json_decref(status);
    if (f->start_ns && llabs(start_ns - f->start_ns) > SAME_START_NS)
        f->seen = 0;
    f->start_ns = start_ns;
    return 0;
}

/* One connection, until it ends. @return true: there was one */
static bool listen_once(struct follower *f)
{
    const struct sst_publisher_listener *l = f->listener;
    struct sst_client *client = NULL;
    char path[64] = EVENTS_PATH;
    int err = sst_client_open(&client, &f->p->service);
    bool connected;

    if (!err) {
        sst_client_set_continue(client, l->go_on, l->arg);
        err = find_service(f, client);
    }
    connected = !err;
    if (connected) {
        l->connected(l->arg, true);
        if (l->kept || f->seen)
            snprintf(path, sizeof(path), "%s?after=%llu", EVENTS_PATH, (unsigned long long)f->seen);
        err = sst_client_lines(client, path, true, on_line, f);
        l->connected(l->arg, false);
    }
    sst_client_close(client);
    return connected;
}

void sst_publisher_follow(const struct sst_publisher *p, const struct sst_publisher_listener *listener)
{
    struct follower f = { .p = p, .listener = listener };
    bool reported = false;
    int wait_s = 1;

    while (listener->go_on(listener->arg)) {
        char held[SST_LOG_MAX] = "", *before = sst_log_hold_errors(held);
        const bool connected = listen_once(&f);

        sst_log_hold_errors(before);
        if (connected) {
            wait_s = 1;
            reported = false;
        }
        if (!reported && listener->go_on(listener->arg))
            sst_log_warning("%s: no connection to the service: %s; retrying", p->name, held[0] ? held : "it has ended");
        reported = true;
        for (int s = 0; s < wait_s && listener->go_on(listener->arg); s++)
            nanosleep(&(struct timespec){ .tv_sec = 1 }, NULL);
        wait_s = wait_s * 2 > WAIT_MAX_S ? WAIT_MAX_S : wait_s * 2;
    }
}
