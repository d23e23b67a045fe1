#define _GNU_SOURCE /* close_range */
/* sst-rtsp: serves the pictures of the service as RTSP streams. It receives them over the service's HTTP API, reports
 * its clients there, and starts itself again when the rtsp section of the configuration has changed. */
#include "publishers/rtsp/rtsp_internal.h"

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
#include "publishers/publisher.h"

#define RETRY_S   5           /* between tries for an address that is in use */
#define REPORT_NS 10000000000 /* the service drops a report that is three times as old */
#define ARENAS    4           /* of malloc: an arena for each thread of a client would grow for ever */

static struct {
    /* fixed after main() has begun */
    struct sst_publisher publisher;
    struct sst_config config;
    char **argv;
    atomic_bool stop;
    /* under lock */
    pthread_mutex_t lock;
    pthread_cond_t changed;
    bool dirty; /* to be reported at once */
    int clients;
    char refused[64];  /* address of the last wrong password; "": none since the last report */
    char problem[256]; /* why nothing is served; "": it is */
} state = { .lock = PTHREAD_MUTEX_INITIALIZER };

/* --- reports ------------------------------------------------------------------------------------------------------ */

void rtsp_report_refused(const char *address)
{
    sst_log_warning("rtsp: %s sent a wrong user or password", address);
    pthread_mutex_lock(&state.lock);
    snprintf(state.refused, sizeof(state.refused), "%s", address);
    state.dirty = true;
    pthread_cond_signal(&state.changed);
    pthread_mutex_unlock(&state.lock);
}

void rtsp_report_clients(int clients)
{
    pthread_mutex_lock(&state.lock);
    if (clients != state.clients) {
        state.clients = clients;
        state.dirty = true;
        pthread_cond_signal(&state.changed);
    }
    pthread_mutex_unlock(&state.lock);
}

static void report_problem(const char *problem)
{
    pthread_mutex_lock(&state.lock);
    snprintf(state.problem, sizeof(state.problem), "%s", problem);
    state.dirty = true;
    pthread_cond_signal(&state.changed);
    pthread_mutex_unlock(&state.lock);
}

static void *report(void *arg SST_UNUSED)
{
    json_t *request, *answer;

    sst_thread_name("rtsp-report");
    while (!atomic_load(&state.stop)) {
        pthread_mutex_lock(&state.lock);
        if (!state.dirty && !atomic_load(&state.stop))
            (void)sst_cond_wait_until(&state.changed, &state.lock, sst_clock_now_ns() + REPORT_NS);
        request = json_pack("{s:s, s:i, s:i, s:s, s:s}", "name", state.publisher.name, "pid", (int)getpid(), "clients",
                            state.clients, "refused", state.refused, "problem", state.problem);
        state.refused[0] = 0;
        state.dirty = false;
        pthread_mutex_unlock(&state.lock);
        answer = NULL;
        if (request && !sst_publisher_ask(&state.publisher, "/api/v1/publishers", request, &answer, NULL))
            json_decref(answer);
        json_decref(request);
    }
    return NULL;
}

/* --- the service -------------------------------------------------------------------------------------------------- */

/* Another configuration is a new beginning: connections end, as they would with the old port or password. */
static void reload(void)
{
    static const char *const sections[] = { "rtsp.", "control.socket", NULL };
    struct sst_config *now = calloc(1, sizeof(*now));

    if (now && sst_publisher_changed(&state.publisher, &state.config, now, sections)) {
        sst_log_info("rtsp: the configuration has changed");
        close_range(3, ~0u, CLOSE_RANGE_CLOEXEC); /* libraries do not */
        execv("/proc/self/exe", state.argv);
        _exit(EXIT_FAILURE); /* systemd starts it again */
    }
    free(now);
}

static void on_connected(void *arg SST_UNUSED, bool connected)
{
    if (!connected)
        return;
    reload();
    pthread_mutex_lock(&state.lock); /* a service that was started again knows nothing of us */
    state.dirty = true;
    pthread_cond_signal(&state.changed);
    pthread_mutex_unlock(&state.lock);
}

static void on_event(void *arg SST_UNUSED, const json_t *event, const char *line SST_UNUSED)
{
    const char *type = json_string_value(json_object_get(event, "type"));

    if (type && !strcmp(type, "reload"))
        reload();
}

static bool go_on(void *arg SST_UNUSED)
{
    return !atomic_load(&state.stop);
}

static void *follow(void *arg SST_UNUSED)
{
    static const struct sst_publisher_listener listener = { .connected = on_connected,
                                                            .event = on_event,
                                                            .go_on = go_on };

    sst_thread_name("rtsp-events");
    sst_publisher_follow(&state.publisher, &listener);
    return NULL;
}

/* --- begin -------------------------------------------------------------------------------------------------------- */

static int open_server(struct rtsp_server *server)
{
    struct rtsp_login login;
    int fd, err = rtsp_load_plugins(state.config.rtsp.codec);

    err = err ? err : rtsp_read_login(&login, &state.config);
    if (err)
        return err;
    fd = rtsp_listen(&state.config);
    err = fd < 0 ? fd : rtsp_server_open(server, state.config.rtsp.codec, &login, fd);
    explicit_bzero(&login, sizeof(login));
    return err;
}

/* Open the server, or retry until it has all it needs: logged once, and part of the service's status meanwhile. */
static void *serve(void *arg SST_UNUSED)
{
    static struct rtsp_server server;
    char why[256] = "", held[SST_LOG_MAX];
    bool failed;

    sst_log_copy_errors(why, sizeof(why));
    sst_thread_name("rtsp-server");
    failed = open_server(&server);
    sst_log_copy_errors(NULL, 0);
    if (failed)
        sst_log_warning("rtsp: retrying every %d s", RETRY_S);
    while (failed) {
        report_problem(why);
        for (int i = 0; i < RETRY_S * 10 && !atomic_load(&state.stop); i++)
            nanosleep(&(struct timespec){ .tv_nsec = 100000000 }, NULL);
        if (atomic_load(&state.stop))
            return NULL;
        held[0] = 0;
        sst_log_hold_errors(held);
        failed = open_server(&server);
        sst_log_hold_errors(NULL);
        snprintf(why, sizeof(why), "%.255s", failed ? held : "");
        if (!failed)
            sst_log_warning("rtsp: listens on %s, port %d now", state.config.rtsp.address, state.config.rtsp.port);
    }
    report_problem("");
    rtsp_server_run(&server, &state.stop);
    return NULL;
}

/* Viewers are hung up on, pipelines and streams end, and then the process: not under threads that still work. */
static void end(void)
{
    const int64_t until_ns = sst_clock_now_ns() + SST_PUBLISHER_STOP_NS;

    pthread_mutex_lock(&state.lock);
    atomic_store(&state.stop, true);
    pthread_cond_signal(&state.changed);
    pthread_mutex_unlock(&state.lock);
    if (!rtsp_pictures_end(until_ns))
        _exit(EXIT_SUCCESS); /* the service hangs */
    sst_publisher_end(&state.publisher, until_ns);
}

int main(int argc, char **argv)
{
    sigset_t signals;
    int sig, done;

    state.publisher = (struct sst_publisher){
        .name = "rtsp",
        .program = "sst-rtsp",
        .help = SST_PUBLISHER_HELP("sst-rtsp", "Serves the pictures of sstd to video recorders as RTSP streams.")
    };
    done = sst_publisher_begin(&state.publisher, &state.config, argc, argv);
    if (done != SST_PROGRAM_GO_ON)
        return done;
    state.argv = argv;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    pthread_sigmask(SIG_BLOCK, &signals, NULL); /* of all threads: this one waits for them */
    mallopt(M_ARENA_MAX, ARENAS);
    sst_cond_init(&state.changed);
    rtsp_pictures_init(&state.publisher.service);
    if (sst_publisher_start(&state.publisher, follow, NULL))
        return EXIT_FAILURE;
    if (state.config.rtsp.enabled &&
        (sst_publisher_start(&state.publisher, report, NULL) || sst_publisher_start(&state.publisher, serve, NULL)))
        return EXIT_FAILURE;
    sigwait(&signals, &sig); /* disabled: a reload begins again */
    end();
}
