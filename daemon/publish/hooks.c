/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* posix_spawn_file_actions_addclosefrom_np */
/* Thread of the hooks: it waits for an event, the end of a program, or the request to stop.
 *
 * Programs are killed with their groups. A process that a program starts in a session of its own becomes a child of
 * this process when its parent ends (PR_SET_CHILD_SUBREAPER), and is killed when no program runs that may have started
 * it.
 */
#include "daemon/publish/hooks.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "daemon/publish/publish_internal.h"

/* --- programs ----------------------------------------------------------------------------------------------------- */

static int set_descriptors(posix_spawn_file_actions_t *files, const int *fd, int fds)
{
    int err = 0;

    for (int i = 0; i < fds && !err; i++)
        err = fd[i] < 0 ? posix_spawn_file_actions_addopen(files, i, "/dev/null", O_RDONLY, 0)
                        : posix_spawn_file_actions_adddup2(files, fd[i], i);
    return err ? err : posix_spawn_file_actions_addclosefrom_np(files, fds);
}

static int set_attributes(posix_spawnattr_t *attr)
{
    sigset_t none, all;
    int err;

    sigemptyset(&none);
    sigfillset(&all);
    err = posix_spawnattr_setpgroup(attr, 0);
    err = err ? err : posix_spawnattr_setsigmask(attr, &none);
    err = err ? err : posix_spawnattr_setsigdefault(attr, &all);
    return err ? err
               : posix_spawnattr_setflags(attr, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
}

/*
 * Start the program argv[0] as a process group of its own, so that Ctrl-C on a terminal is for the service alone, with
 * signals as usual.
 *
 * @param fd   [fds]; descriptors to become 0, 1 ...; none may be below its new number, except 2, standard error; -1:
 *             /dev/null to read. All others are closed
 * @param env  environ, or another one
 * @return 0, or a negative errno, also if the program itself cannot be run. Thread: any
 */
static int spawn_program(pid_t *pid, char *const argv[], char *const env[], const int *fd, int fds)
{
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attr;
    int err = posix_spawn_file_actions_init(&files);

    if (err)
        return -err;
    err = posix_spawnattr_init(&attr);
    if (!err) {
        err = set_descriptors(&files, fd, fds);
        err = err ? err : set_attributes(&attr);
        err = err ? err : posix_spawn(pid, argv[0], &files, &attr, argv, env);
        posix_spawnattr_destroy(&attr);
    }
    posix_spawn_file_actions_destroy(&files);
    return -err;
}

/* --- hooks -------------------------------------------------------------------------------------------------------- */

#define LIMIT_MS 30000
#define CHECK_MS 20   /* between checks of running programs */
#define CLOSE_MS 400  /* killed programs are waited for this long: the disk may hold one */
#define UNKNOWN  (-1) /* status of a program that has not run */

struct run {
    struct sst_hook hook;
    int index;        /* of the hook; -1: another one has its place since */
    char *event;      /* line of JSON */
    pid_t pid;        /* 0: waits */
    uint64_t started; /* as in /proc/PID/stat */
    int64_t end_ns;
    bool killed;
};

struct sst_hooks {
    struct sst_events *events; /* fixed after open */
    int limit_ms;
    int wake;        /* eventfd */
    uint64_t opened; /* as in /proc/PID/stat: children that are older are none of hooks */
    pthread_t thread;
    atomic_bool stop;
    pthread_mutex_t lock;
    /* under lock */
    struct sst_hook hook[SST_HOOKS_MAX];
    int hooks;
    int status[SST_HOOKS_MAX]; /* last one logged */
    unsigned generation;       /* of the settings */
    struct sst_hooks_counters n;
    /* thread only */
    struct run run[SST_HOOKS_AT_ONCE];     /* pid 0: free */
    struct run waiting[SST_HOOKS_WAITING]; /* oldest first */
    int n_waiting;
    uint64_t seen; /* id of the last event */
    bool orphans;  /* a program has ended and may have left some */
};

static void wake(void *arg)
{
    const struct sst_hooks *h = arg;
    const uint64_t one = 1;

    if (write(h->wake, &one, sizeof(one)) < 0)
        return; /* full: it is awake already */
}

/* --- starting and ending ------------------------------------------------------------------------------------------ */

/* Logged when it differs from the last time, so that a hook that always fails does not fill the journal. */
static void log_result(struct sst_hooks *h, const struct run *r, int status, const char *what)
{
    bool changed = false, first = false;

    pthread_mutex_lock(&h->lock);
    h->n.failed += status != 0;
    if (r->index >= 0) {
        first = h->status[r->index] == UNKNOWN;
        changed = h->status[r->index] != status;
        h->status[r->index] = status;
    }
    pthread_mutex_unlock(&h->lock);
    if (changed && status)
        sst_log_warning("hook %s of %s %s; logged again when that changes", r->hook.argv[0], r->hook.event, what);
    else if (changed && !first)
        sst_log_warning("hook %s of %s succeeds again", r->hook.argv[0], r->hook.event);
}

/* Now, as the start of a process in /proc/PID/stat. */
static uint64_t boot_ticks(void)
{
    const uint64_t hz = (uint64_t)sysconf(_SC_CLK_TCK);
    struct timespec t;

    (void)clock_gettime(CLOCK_BOOTTIME, &t);
    return (uint64_t)t.tv_sec * hz + (uint64_t)t.tv_nsec * hz / 1000000000;
}

static void start(struct sst_hooks *h, struct run *r)
{
    char *argv[SST_HOOK_ARGS + 1] = { 0 }, **env = hook_env(r->event), what[160];
    int err = -ENOMEM;

    r->started = boot_ticks();
    for (int i = 0; i < SST_HOOK_ARGS && r->hook.argv[i][0]; i++)
        argv[i] = r->hook.argv[i];
    if (env)
        err = spawn_program(&r->pid, argv, env, (const int[]){ -1, 2, 2 }, 3);
    hook_env_free(env);
    free(r->event);
    r->event = NULL;
    /* Counted together with its state: a reader never sees a run without one. */
    if (err) {
        r->pid = 0;
        snprintf(what, sizeof(what), "cannot be run: %s", strerror(-err));
        log_result(h, r, err - 1, what);
    }
    pthread_mutex_lock(&h->lock);
    h->n.run++;
    h->n.running += !err;
    pthread_mutex_unlock(&h->lock);
    r->end_ns = sst_clock_now_ns() + (int64_t)h->limit_ms * 1000000;
}

/* A program ended: it is not reaped yet, so that the number of its group is not reused. */
static void end(struct sst_hooks *h, struct run *r)
{
    const pid_t pid = r->pid;
    char what[160];
    int status = 0;

    kill(-pid, SIGKILL); /* processes that it left behind */
    while (waitpid(pid, &status, 0) < 0 && errno == EINTR)
        ;
    r->pid = 0;
    h->orphans = true;
    if (r->killed)
        snprintf(what, sizeof(what), "was killed: it had not ended after %g s", h->limit_ms / 1000.0);
    else if (WIFSIGNALED(status))
        snprintf(what, sizeof(what), "ended by signal %d", WTERMSIG(status));
    else
        snprintf(what, sizeof(what), "ended with status %d", WEXITSTATUS(status));
    log_result(h, r, status, what);
}

static void check_run(struct sst_hooks *h, struct run *r)
{
    siginfo_t info = { .si_pid = 0 };
    const int err = waitid(P_PID, (id_t)r->pid, &info, WEXITED | WNOHANG | WNOWAIT);

    if (!err && info.si_pid) {
        end(h, r);
    } else if (err && errno == ECHILD) { /* reaped elsewhere: its exit status is not known */
        r->pid = 0;
    } else if (!r->killed && sst_clock_now_ns() > r->end_ns) {
        r->killed = true;
        kill(-r->pid, SIGKILL);
        pthread_mutex_lock(&h->lock);
        h->n.killed++;
        pthread_mutex_unlock(&h->lock);
    }
}

/* @return the start of a child of this process, 0: it is none */
static uint64_t child_start(const char *pid)
{
    unsigned long long started = 0;
    char path[64], text[512];
    const char *rest;
    int parent = 0;
    size_t n;
    FILE *f;

    snprintf(path, sizeof(path), "/proc/%.20s/stat", pid);
    f = fopen(path, "re");
    if (!f)
        return 0; /* it has ended */
    n = fread(text, 1, sizeof(text) - 1, f);
    fclose(f);
    text[n] = 0;
    rest = strrchr(text, ')'); /* behind the name, which may have anything in it */
    if (!rest ||
        sscanf(rest + 1, " %*c %d %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %llu", &parent,
               &started) != 2 ||
        parent != getpid())
        return 0;
    return started;
}

/* Is it the program of a run, or started since one began that goes on? */
static bool may_live(const struct sst_hooks *h, pid_t pid, uint64_t started)
{
    for (int i = 0; i < SST_HOOKS_AT_ONCE; i++)
        if (h->run[i].pid && (h->run[i].pid == pid || h->run[i].started <= started))
            return true;
    return started < h->opened;
}

/* Kill processes left behind by programs that ended. Their own children are there the next time. @return some were
 * there */
static bool kill_orphans(const struct sst_hooks *h)
{
    DIR *dir = opendir("/proc");
    const struct dirent *e;
    bool found = false;

    while (dir && (e = readdir(dir))) {
        const pid_t pid = atoi(e->d_name);
        const uint64_t started = pid > 0 ? child_start(e->d_name) : 0;

        if (!started || may_live(h, pid, started))
            continue;
        kill(pid, SIGKILL);
        waitpid(pid, NULL, WNOHANG);
        found = true;
    }
    if (dir)
        closedir(dir);
    return found;
}

/* --- events ------------------------------------------------------------------------------------------------------- */

/* @return these are the first */
static bool drop(struct sst_hooks *h, uint64_t runs)
{
    bool first;

    pthread_mutex_lock(&h->lock);
    first = !h->n.dropped;
    h->n.dropped += runs;
    pthread_mutex_unlock(&h->lock);
    return first;
}

static void enqueue(struct sst_hooks *h, const struct sst_hook *hook, int index, const char *event)
{
    struct run *r = &h->waiting[h->n_waiting];
    char *copy = h->n_waiting < SST_HOOKS_WAITING ? strdup(event) : NULL;

    if (!copy) {
        if (drop(h, 1))
            sst_log_warning("hooks: more than %d programs wait to be run; further ones are dropped and counted. Let "
                            "them end sooner, or listen to the event stream",
                            SST_HOOKS_WAITING);
        return;
    }
    *r = (struct run){ .hook = *hook, .index = index, .event = copy };
    h->n_waiting++;
}

static void start_hooks(struct sst_hooks *h, const char *event)
{
    json_t *o = json_loads(event, 0, NULL);
    const char *type = json_string_value(json_object_get(o, "type"));
    struct sst_hook hook;
    bool mine;

    for (int i = 0; type && i < SST_HOOKS_MAX; i++) {
        pthread_mutex_lock(&h->lock);
        mine = i < h->hooks && (!strcmp(h->hook[i].event, "*") || !strcmp(h->hook[i].event, type));
        if (mine)
            hook = h->hook[i];
        pthread_mutex_unlock(&h->lock);
        if (mine)
            enqueue(h, &hook, i, event);
    }
    json_decref(o);
}

static void handle_events(struct sst_hooks *h)
{
    uint64_t id;
    char *event;

    while (!h->stop && sst_events_next(h->events, h->seen, &id, &event)) {
        if (id > h->seen + 1 && drop(h, id - h->seen - 1))
            sst_log_warning("hooks: events came faster than they are kept; those without a hook's run are counted");
        h->seen = id;
        start_hooks(h, event);
        free(event);
    }
}

/* Waiting runs of removed hooks are dropped; running ones no longer stand for a hook. */
static void follow_settings(struct sst_hooks *h, unsigned *generation)
{
    unsigned now;

    pthread_mutex_lock(&h->lock);
    now = h->generation;
    pthread_mutex_unlock(&h->lock);
    if (now == *generation)
        return;
    *generation = now;
    for (int i = 0; i < SST_HOOKS_AT_ONCE; i++)
        h->run[i].index = -1;
    for (int i = 0; i < h->n_waiting; i++)
        free(h->waiting[i].event);
    h->n_waiting = 0;
}

/* @return programs that run or must be killed */
static int handle_runs(struct sst_hooks *h)
{
    int running = 0;

    for (int i = 0; i < SST_HOOKS_AT_ONCE; i++) {
        struct run *r = &h->run[i];

        if (r->pid)
            check_run(h, r);
        while (!r->pid && h->n_waiting && !h->stop) {
            *r = h->waiting[0];
            memmove(h->waiting, h->waiting + 1, (size_t)--h->n_waiting * sizeof(h->waiting[0]));
            start(h, r);
        }
        running += r->pid != 0;
    }
    pthread_mutex_lock(&h->lock);
    h->n.running = running;
    h->n.waiting = h->n_waiting;
    pthread_mutex_unlock(&h->lock);
    if (h->orphans)
        h->orphans = kill_orphans(h);
    return running + h->orphans;
}

static void kill_all(struct sst_hooks *h)
{
    const int64_t end_ns = sst_clock_now_ns() + CLOSE_MS * INT64_C(1000000);

    for (int i = 0; i < SST_HOOKS_AT_ONCE; i++)
        if (h->run[i].pid) {
            h->run[i].index = -1;
            kill(-h->run[i].pid, SIGKILL);
        }
    while (handle_runs(h) && sst_clock_now_ns() < end_ns)
        poll(NULL, 0, CHECK_MS);
    for (int i = 0; i < h->n_waiting; i++)
        free(h->waiting[i].event);
}

static void *work(void *arg)
{
    struct sst_hooks *h = arg;
    struct pollfd fd = { .fd = h->wake, .events = POLLIN };
    unsigned generation = 0;
    uint64_t count;

    sst_thread_name("sst-hooks");
    while (!h->stop) {
        follow_settings(h, &generation);
        handle_events(h);
        if (poll(&fd, 1, handle_runs(h) ? CHECK_MS : -1) > 0 && read(h->wake, &count, sizeof(count)) < 0)
            continue; /* taken already */
    }
    kill_all(h);
    return NULL;
}

/* --- verbs -------------------------------------------------------------------------------------------------------- */

static void set(struct sst_hooks *h, const struct sst_hook *hook, int hooks)
{
    pthread_mutex_lock(&h->lock);
    h->hooks = sst_clamp_int(hooks, 0, SST_HOOKS_MAX);
    memcpy(h->hook, hook, (size_t)h->hooks * sizeof(*hook));
    for (int i = 0; i < SST_HOOKS_MAX; i++)
        h->status[i] = UNKNOWN;
    pthread_mutex_unlock(&h->lock);
}

int sst_hooks_open(struct sst_hooks **out, const struct sst_hooks_config *cfg)
{
    struct sst_hooks *h;
    int err = -ENOMEM;

    if (cfg->hooks < 0 || cfg->hooks > SST_HOOKS_MAX || cfg->limit_ms < 0)
        return -EINVAL;
    h = calloc(1, sizeof(*h));
    if (!h)
        return -ENOMEM;
    pthread_mutex_init(&h->lock, NULL);
    h->events = cfg->events;
    h->limit_ms = cfg->limit_ms ? cfg->limit_ms : LIMIT_MS;
    h->opened = boot_ticks();
    if (prctl(PR_SET_CHILD_SUBREAPER, 1))
        sst_log_warning("hooks: what a program starts in a session of its own may outlive it: %s", strerror(errno));
    set(h, cfg->hook, cfg->hooks);
    h->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (h->wake < 0)
        goto fail;
    err = sst_events_watch(h->events, wake, h);
    if (err)
        goto fail;
    err = -pthread_create(&h->thread, NULL, work, h);
    if (err) {
        sst_events_unwatch(h->events, wake, h);
        goto fail;
    }
    *out = h;
    return 0;

fail:
    if (h->wake >= 0)
        close(h->wake);
    pthread_mutex_destroy(&h->lock);
    free(h);
    return err;
}

void sst_hooks_configure(struct sst_hooks *h, const struct sst_hook *hook, int hooks)
{
    set(h, hook, hooks);
    pthread_mutex_lock(&h->lock);
    h->generation++;
    pthread_mutex_unlock(&h->lock);
    wake(h);
}

void sst_hooks_counters(struct sst_hooks *h, struct sst_hooks_counters *out)
{
    pthread_mutex_lock(&h->lock);
    *out = h->n;
    pthread_mutex_unlock(&h->lock);
}

void sst_hooks_stop(struct sst_hooks *h)
{
    if (!h)
        return;
    h->stop = true;
    wake(h);
}

void sst_hooks_close(struct sst_hooks *h)
{
    if (!h)
        return;
    sst_hooks_stop(h);
    pthread_join(h->thread, NULL);
    sst_events_unwatch(h->events, wake, h);
    close(h->wake);
    pthread_mutex_destroy(&h->lock);
    free(h);
}
