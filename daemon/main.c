/* sstd: the service. Options, signals, notices to systemd; the rest is in daemon/service. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* pipe2 */
#include <errno.h>
#include <fcntl.h>
#include <malloc.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>
#include <unistd.h>
#if WITH_SYSTEMD
#include <systemd/sd-daemon.h>
#endif

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "config/program.h"
#include "daemon/service/service.h"

/* Memory that stays flat for months: threads come and go with clients, so there is no arena for each; and blocks from
 * this size on come from the system and go back to it whole, whatever lies beside them. Without it malloc() raises the
 * size as it goes (to 32 MiB), and holes stay between blocks of all sizes. */
#define ARENAS      4
#define LARGE_BYTES (256 * 1024)
#define TICK_MS     250
#define STOP_MS     1100 /* then the process ends, whatever hangs; its memory goes after that */
#define STATUS_NS   INT64_C(1000000000)
#define WATCHDOG_NS INT64_C(20000000000) /* progress is judged over this without a watchdog */

/* --- systemd, where there is one ---------------------------------------------------------------------------------- */

static void notify(const char *text)
{
#if WITH_SYSTEMD
    sd_notify(0, text);
#else
    (void)text;
#endif
}

/** The control socket, listening already; -1: none was handed over. */
static int activated_socket(void)
{
#if WITH_SYSTEMD
    const int n = sd_listen_fds(1);

    if (n > 1)
        sst_log_warning("systemd handed over %d sockets, the first is used: sstd.socket has one", n);
    return n > 0 ? SD_LISTEN_FDS_START : -1;
#else
    return -1;
#endif
}

/** Interval of the watchdog; 0: none is set. */
static int64_t watchdog_ns(void)
{
    uint64_t us = 0;

#if WITH_SYSTEMD
    if (sd_watchdog_enabled(1, &us) <= 0)
        us = 0;
#endif
    return (int64_t)us * 1000;
}

/* --- signals ------------------------------------------------------------------------------------------------------ */

static int signal_pipe[2];
static atomic_bool stop_asked; /* overtakes the pipe, which may be full of reloads */

static void on_alarm(int sig SST_UNUSED)
{
    static const char text[] = "sst: warning: something hangs; the process ends without it\n";
    struct pollfd log = { .fd = STDERR_FILENO, .events = POLLOUT };

    if (poll(&log, 1, 0) == 1 && write(STDERR_FILENO, text, sizeof(text) - 1) < 0) {
        /* no reader of the log: it may hang */
    }
    _exit(0);
}

/** From here on the process ends in time: even if its main thread is held up and does not read the signal. */
static void arm_end(void)
{
    static volatile sig_atomic_t armed;
    const struct itimerval end = { .it_value = { .tv_sec = STOP_MS / 1000, .tv_usec = STOP_MS % 1000 * 1000 } };

    if (armed)
        return;
    armed = 1;
    setitimer(ITIMER_REAL, &end, NULL); /* a system call and nothing else */
}

static void on_signal(int sig)
{
    const unsigned char c = (unsigned char)sig;
    const int err = errno;

    if (sig != SIGHUP) {
        stop_asked = true;
        arm_end();
    }
    if (write(signal_pipe[1], &c, 1) < 0) {
        /* full: thousands wait already */
    }
    errno = err;
}

/* The one thread in which signals are not blocked: nothing delays it, not even the start of the service. */
static void *wait_for_signals(void *arg SST_UNUSED)
{
    sst_thread_name("sst-signals");
    for (;;)
        pause();
    return NULL;
}

/**
 * Have signals go through a pipe. Handlers, not a mask and signalfd: libraries start threads before main() (OpenBLAS
 * does), which no mask reaches, and a signal without a handler that meets one ends the process at once.
 * In all threads of ours but one they are blocked. @return descriptor to read from, or -errno
 */
static int catch_signals(void)
{
    static const int sigs[] = { SIGTERM, SIGINT, SIGHUP };
    const struct sigaction act = { .sa_handler = on_signal }; /* no restart: not even systemd's silence keeps us */
    const struct sigaction end = { .sa_handler = on_alarm };
    pthread_t thread;
    sigset_t caught;
    int err;

    if (pipe2(signal_pipe, O_CLOEXEC | O_NONBLOCK))
        return -errno;
    sigemptyset(&caught);
    sigaddset(&caught, SIGALRM); /* the kernel would deliver it to the main thread, which may be blocked */
    sigaction(SIGALRM, &end, NULL);
    for (size_t i = 0; i < ARRAY_LEN(sigs); i++) {
        sigaddset(&caught, sigs[i]);
        sigaction(sigs[i], &act, NULL);
    }
    signal(SIGPIPE, SIG_IGN);
    pthread_sigmask(SIG_UNBLOCK, &caught, NULL);
    err = pthread_create(&thread, NULL, wait_for_signals, NULL);
    if (err)
        return -err;
    pthread_detach(thread);
    pthread_sigmask(SIG_BLOCK, &caught, NULL);
    return signal_pipe[0];
}

/* --- running ------------------------------------------------------------------------------------------------------ */

static void reload(struct sst_service *service)
{
    char text[96];

    snprintf(text, sizeof(text), "RELOADING=1\nMONOTONIC_USEC=%lld", (long long)(sst_clock_now_ns() / 1000));
    notify(text);
    if (sst_service_reload(service))
        sst_log_warning("the configuration was not applied, the old one stays");
    notify("READY=1");
}

/** Send the status line and the watchdog's sign of life to systemd. */
static void tick(struct sst_service *service, int64_t every_ns, int64_t *status_ns)
{
    const int64_t now_ns = sst_clock_now_ns();
    char status[512] = "", text[560];

    (void)sst_service_tick(service, status);
    if (now_ns - *status_ns >= STATUS_NS) {
        *status_ns = now_ns;
        snprintf(text, sizeof(text), "STATUS=%s", status);
        notify(text);
    }
    if (sst_service_alive(service, every_ns ? every_ns : WATCHDOG_NS))
        notify("WATCHDOG=1");
}

static void serve(struct sst_service *service, int signals)
{
    const int64_t every_ns = watchdog_ns();
    int64_t status_ns = 0;

    while (!stop_asked) {
        struct pollfd fd = { .fd = signals, .events = POLLIN };
        unsigned char waiting[256];
        bool asked = false;

        poll(&fd, 1, TICK_MS);
        while (read(signals, waiting, sizeof(waiting)) > 0) /* several reloads are one */
            asked = true;
        if (asked && !stop_asked)
            reload(service);
        if (!stop_asked)
            tick(service, every_ns, &status_ns);
    }
}

static int run(const struct sst_program *p, const struct sst_config *config)
{
    const struct sst_service_config cfg = { .path = p->config, .socket = p->socket, .socket_fd = activated_socket() };
    struct sst_service *service;
    const int signals = catch_signals();

    if (signals < 0) {
        sst_log_error("signals cannot be caught: %s", strerror(-signals));
        return EXIT_FAILURE;
    }
    if (sst_service_open(&service, config, &cfg))
        return EXIT_FAILURE;
    if (isatty(STDOUT_FILENO)) {
        char address[512];

        sst_service_address(service, address, sizeof(address));
        if (address[0])
            printf("the page: %s\n", address);
    }
    notify("READY=1");
    serve(service, signals);
    notify("STOPPING=1\nSTATUS=draining");
    if (!sst_service_stop(service))
        _exit(0);
    return EXIT_SUCCESS;
}

/* --- options ------------------------------------------------------------------------------------------------------ */

static const char help[] =
    "sstd [--config FILE] [--check] [--socket PATH] [-v]\n\n"
    "Captures from the camera array, shows the live see-through picture and records: the service behind sst status.\n\n"
    "  --config FILE   configuration; /etc/sst/sstd.yaml, and conf.d/*.yaml beside it\n"
    "  --check         check the configuration, print its faults, and exit (0: valid, 78: not)\n"
    "  --socket PATH   control socket instead of the configuration's\n"
    "  -v, --verbose   log more (twice: everything)\n"
    "      --version   print the version\n"
    "  -h, --help      this\n\n"
    "SIGHUP reads the configuration again, SIGTERM ends it within two seconds. See sstd(8), sstd.yaml(5).\n\n"
    "Example: sst-sim -- sstd --config my.yaml\n";

int main(int argc, char **argv)
{
    struct sst_program program = { .name = "sstd", .help = help, .checks = true };
    struct sst_config *config;
    int status;

    mallopt(M_ARENA_MAX, ARENAS);
    mallopt(M_MMAP_THRESHOLD, LARGE_BYTES);
    config = calloc(1, sizeof(*config));
    if (!config)
        return EXIT_FAILURE;
    status = sst_program_begin(&program, config, argc, argv);
    if (status == SST_PROGRAM_GO_ON)
        status = run(&program, config);
    free(config);
    return status;
}
