/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* close_range */
#include "publishers/server.h"

#include <linux/close_range.h>
#include <malloc.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"

#define RETRY_S   5           /* between tries for an address that is in use */
#define REPORT_NS 10000000000 /* the service drops a report that is three times as old */
#define ARENAS    4           /* of malloc: an arena for each thread of a client would grow for ever */

/* rtsp-events, rtsp-report */
static void name_thread(const struct sst_server *s, const char *work)
{
    char name[16];

    snprintf(name, sizeof(name), "%.8s-%.6s", s->publisher.name, work);
    sst_thread_name(name);
}

/* --- reports ------------------------------------------------------------------------------------------------------ */

static void changed_locked(struct sst_server *s)
{
    s->dirty = true;
    pthread_cond_signal(&s->changed);
}

void sst_server_report_refused(void *server, const char *address)
{
    struct sst_server *s = server;

    pthread_mutex_lock(&s->lock);
    snprintf(s->refused, sizeof(s->refused), "%s", address);
    changed_locked(s);
    pthread_mutex_unlock(&s->lock);
}

void sst_server_report_clients(struct sst_server *s, int clients)
{
    pthread_mutex_lock(&s->lock);
    if (clients != s->clients) {
        s->clients = clients;
        changed_locked(s);
    }
    pthread_mutex_unlock(&s->lock);
}

static void report_problem(struct sst_server *s, const char *problem)
{
    pthread_mutex_lock(&s->lock);
    snprintf(s->problem, sizeof(s->problem), "%s", problem);
    changed_locked(s);
    pthread_mutex_unlock(&s->lock);
}

static void *report(void *arg)
{
    struct sst_server *s = arg;
    json_t *request, *answer;

    name_thread(s, "report");
    while (!atomic_load(&s->stop)) {
        pthread_mutex_lock(&s->lock);
        if (!s->dirty && !atomic_load(&s->stop))
            (void)sst_cond_wait_until(&s->changed, &s->lock, sst_clock_now_ns() + REPORT_NS);
        request = json_pack("{s:s, s:i, s:i, s:s, s:s}", "name", s->publisher.name, "pid", (int)getpid(), "clients",
                            s->clients, "refused", s->refused, "problem", s->problem);
        s->refused[0] = 0;
        s->dirty = false;
        pthread_mutex_unlock(&s->lock);
        answer = NULL;
        if (request && !sst_publisher_ask(&s->publisher, "/api/v1/publishers", request, &answer, NULL))
            json_decref(answer);
        json_decref(request);
    }
    return NULL;
}

/* --- the service -------------------------------------------------------------------------------------------------- */

/* Another configuration is a new beginning: connections end, as they would with the old port or password. */
static void reload(struct sst_server *s)
{
    struct sst_config *now = calloc(1, sizeof(*now));

    if (now && sst_publisher_changed(&s->publisher, &s->config, now, s->sections)) {
        sst_log_info("%s: the configuration has changed", s->publisher.name);
        close_range(3, ~0u, CLOSE_RANGE_CLOEXEC); /* libraries do not */
        execv("/proc/self/exe", s->argv);
        _exit(EXIT_FAILURE); /* systemd starts it again */
    }
    free(now);
}

static void on_connected(void *arg, bool connected)
{
    struct sst_server *s = arg;

    if (connected) {
        reload(s);
        pthread_mutex_lock(&s->lock); /* a service that was started again knows nothing of us */
        changed_locked(s);
        pthread_mutex_unlock(&s->lock);
    }
    if (s->connected)
        s->connected(s->arg, connected);
}

static void on_event(void *arg, const json_t *event, const char *line SST_UNUSED)
{
    struct sst_server *s = arg;
    const char *type = json_string_value(json_object_get(event, "type"));

    if (type && !strcmp(type, "reload"))
        reload(s);
    if (s->event)
        s->event(s->arg, event);
}

static bool go_on(void *arg)
{
    return !atomic_load(&((struct sst_server *)arg)->stop);
}

static void *follow(void *arg)
{
    struct sst_server *s = arg;
    const struct sst_publisher_listener listener = { .connected = on_connected,
                                                     .event = on_event,
                                                     .go_on = go_on,
                                                     .arg = s };

    name_thread(s, "events");
    sst_publisher_follow(&s->publisher, &listener);
    return NULL;
}

/* --- begin, wait -------------------------------------------------------------------------------------------------- */

int sst_server_begin(struct sst_server *s, int argc, char **argv)
{
    const int done = sst_publisher_begin(&s->publisher, &s->config, argc, argv);
    sigset_t signals;

    if (done != SST_PROGRAM_GO_ON)
        return done;
    s->argv = argv;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    pthread_sigmask(SIG_BLOCK, &signals, NULL); /* of all threads: this one waits for them */
    mallopt(M_ARENA_MAX, ARENAS);
    pthread_mutex_init(&s->lock, NULL);
    sst_cond_init(&s->changed);
    return SST_PROGRAM_GO_ON;
}

int sst_server_start(struct sst_server *s, bool enabled, void *(*serve)(void *))
{
    int err = sst_publisher_start(&s->publisher, follow, s);

    if (!err && enabled)
        err = sst_publisher_start(&s->publisher, report, s);
    if (!err && enabled)
        err = sst_publisher_start(&s->publisher, serve, s);
    return err;
}

bool sst_server_open(struct sst_server *s, int (*open)(struct sst_server *s))
{
    char why[256] = "", held[SST_LOG_MAX];
    bool failed;

    sst_log_copy_errors(why, sizeof(why));
    failed = open(s);
    sst_log_copy_errors(NULL, 0);
    if (failed)
        sst_log_warning("%s: retrying every %d s", s->publisher.name, RETRY_S);
    while (failed) {
        report_problem(s, why);
        for (int i = 0; i < RETRY_S * 10 && !atomic_load(&s->stop); i++)
            nanosleep(&(struct timespec){ .tv_nsec = 100000000 }, NULL);
        if (atomic_load(&s->stop))
            return false;
        held[0] = 0;
        sst_log_hold_errors(held);
        failed = open(s);
        sst_log_hold_errors(NULL);
        snprintf(why, sizeof(why), "%.255s", failed ? held : "");
        if (!failed)
            sst_log_warning("%s: serves now", s->publisher.name);
    }
    report_problem(s, "");
    return true;
}

void sst_server_wait(struct sst_server *s)
{
    sigset_t signals;
    int sig;

    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    sigwait(&signals, &sig); /* disabled: a reload begins again */
    pthread_mutex_lock(&s->lock);
    atomic_store(&s->stop, true);
    pthread_cond_signal(&s->changed);
    pthread_mutex_unlock(&s->lock);
}
