/* The RTSP server as the service sees it: one thread that hands pictures to the process and starts it again. */
#include "daemon/publish/rtsp_parts.h"

#include <errno.h>

#include "base/log.h"

#if WITH_RTSP

#include <ctype.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/thread.h"

#define LOOK_MS   5             /* between looks for new pictures, while somebody may watch */
#define IDLE_MS   1000          /* likewise for other things */
#define HUNG_NS   20000000000LL /* without a sign of life */
#define START_NS  20000000000LL /* from the start to the first one */
#define AGAIN_MS  500           /* to the first restart; twice as long each time that it does not last */
#define AGAIN_MAX 30000
#define LASTS_NS  60000000000LL
#define TELL_NS   60000000000LL
#define WAIT_MS   5000 /* for an address that is not to be had yet */

/** A picture that the process knows. */
struct place {
    struct sst_outlet *outlet; /* NULL: free */
    uint64_t number;           /* of the last one sent */
    bool watched, over;
};

struct sst_rtsp {
    /* fixed after open */
    const struct sst_api *api;
    enum sst_rtsp_codec codec;
    struct rtsp_login login;
    char address[64];
    int wake;
    pthread_t thread;
    bool started;
    /* atomic */
    atomic_bool closing;
    atomic_int clients, port;
    atomic_int away; /* errno of the address that is not to be had yet; 0: it is */
    atomic_uint restarts;
    /* the opening thread's, then the thread's alone */
    int listener; /* -1: none */
    pid_t pid;    /* 0: there is no process */
    pid_t late;   /* one that was killed and has not ended yet; 0: none */
    int link;
    bool ready;
    int64_t begun_ns, heard_ns, told_ns;
    int places; /* taken */
    struct place place[SST_RTSP_PLACES];
};

/* --- what the process says ---------------------------------------------------------------------------------------- */

static int say(struct sst_rtsp *rtsp, const struct rtsp_message *message, const void *data)
{
    return rtsp_link_send(rtsp->link, message, data, rtsp->wake);
}

static void watch(struct place *p, bool watched)
{
    if (p->watched == watched)
        return;
    p->watched = watched;
    p->number = 0; /* who comes again is shown what there is */
    if (watched)
        sst_outlet_join(p->outlet);
    else
        sst_outlet_leave(p->outlet);
}

static void forget(struct sst_rtsp *rtsp, struct place *p)
{
    if (!p->outlet)
        return;
    watch(p, false);
    sst_outlet_unref(p->outlet);
    *p = (struct place){ .outlet = NULL };
    rtsp->places--;
}

static int find(struct sst_rtsp *rtsp, const struct rtsp_message *m, struct place *p)
{
    struct rtsp_message answer = { .word = SST_RTSP_FOUND, .place = m->place };

    if (p->outlet || (m->value != SST_PICTURE_VIEW && m->value != SST_PICTURE_CAMERA))
        return -EPROTO;
    answer.value = rtsp->api->outlet(rtsp->api->arg, (enum sst_api_picture)m->value, m->name, &p->outlet);
    if (answer.value)
        p->outlet = NULL;
    else
        rtsp->places++;
    return say(rtsp, &answer, NULL);
}

static void tell_wrong(struct sst_rtsp *rtsp, const char *who)
{
    const int64_t now_ns = sst_clock_now_ns();

    for (const char *c = who; *c; c++)
        if (!isxdigit((unsigned char)*c) && !strchr(".:%", *c))
            return;
    if (!rtsp->api->events || (rtsp->told_ns && now_ns - rtsp->told_ns < TELL_NS))
        return;
    rtsp->told_ns = now_ns;
    sst_events_emit(rtsp->api->events, SST_EVENT_WARNING, "client",
                    json_pack("{s:s, s:s}", "reason", "wrong password", "address", who),
                    "%s sent a wrong user or password over RTSP", who);
}

/* Clients of the process may have got hold of it: what it says is checked. */
static int hear(struct sst_rtsp *rtsp)
{
    struct rtsp_message m;
    const int err = rtsp_link_read(rtsp->link, &m, sizeof(m), rtsp->wake);
    struct place *p;

    if (err)
        return err;
    if (m.bytes || m.place < 0 || m.place >= SST_RTSP_PLACES || !memchr(m.name, 0, sizeof(m.name)))
        return -EPROTO;
    rtsp->heard_ns = sst_clock_now_ns();
    p = &rtsp->place[m.place];
    switch (m.word) {
    case SST_RTSP_READY:
        rtsp->ready = !m.value;
        return m.value < 0 ? m.value : 0;
    case SST_RTSP_FIND:
        return find(rtsp, &m, p);
    case SST_RTSP_WATCH:
        if (!p->outlet)
            return -EPROTO;
        watch(p, m.value);
        return 0;
    case SST_RTSP_FORGET:
        forget(rtsp, p);
        return 0;
    case SST_RTSP_CLIENTS:
        atomic_store(&rtsp->clients, m.value);
        return 0;
    case SST_RTSP_WRONG:
        tell_wrong(rtsp, m.name);
        return 0;
    default:
        return -EPROTO;
    }
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

static int show(struct sst_rtsp *rtsp, int at)
{
    struct place *p = &rtsp->place[at];
    struct rtsp_message m = { .word = SST_RTSP_OVER, .place = at };
    const struct sst_jpeg *jpeg;
    int err;

    if (!p->outlet || p->over)
        return 0;
    if (sst_outlet_is_shut(p->outlet)) {
        p->over = true;
        return say(rtsp, &m, NULL);
    }
    jpeg = p->watched ? sst_outlet_get(p->outlet, p->number) : NULL;
    if (!jpeg)
        return 0;
    p->number = jpeg->number;
    m = (struct rtsp_message){ .word = SST_RTSP_PICTURE,
                               .place = at,
                               .bytes = (uint32_t)jpeg->bytes,
                               .set = jpeg->set,
                               .t_ns = jpeg->t_ns,
                               .wall_ns = jpeg->wall_ns };
    err = jpeg->bytes <= SST_RTSP_PICTURE_MAX ? say(rtsp, &m, jpeg->data) : 0;
    sst_jpeg_unref(jpeg);
    return err;
}

/* Hear what was said, or show what is new. @return 0; -errno: the process is of no more use */
static int step(struct sst_rtsp *rtsp)
{
    struct pollfd fds[] = { { .fd = rtsp->link, .events = POLLIN }, { .fd = rtsp->wake, .events = POLLIN } };
    int err = 0;

    (void)poll(fds, 2, rtsp->places ? LOOK_MS : IDLE_MS);
    if (fds[0].revents)
        err = hear(rtsp);
    else if (sst_clock_now_ns() - rtsp->heard_ns > (rtsp->ready ? HUNG_NS : START_NS))
        err = -ETIMEDOUT;
    for (int i = 0; i < SST_RTSP_PLACES && !err && rtsp->places; i++)
        err = show(rtsp, i);
    if (rtsp->late && rtsp_reap(rtsp->late))
        rtsp->late = 0;
    return err;
}

/* --- the process -------------------------------------------------------------------------------------------------- */

static int begin(struct sst_rtsp *rtsp)
{
    const struct rtsp_message settings = { .word = SST_RTSP_SETTINGS,
                                           .value = (int32_t)rtsp->codec,
                                           .bytes = sizeof(rtsp->login) };
    int err;

    rtsp->ready = false;
    rtsp->begun_ns = rtsp->heard_ns = sst_clock_now_ns();
    err = rtsp_spawn(&rtsp->pid, &rtsp->link, rtsp->listener);
    if (err) {
        rtsp->pid = 0;
        return err;
    }
    return say(rtsp, &settings, &rtsp->login);
}

static void end(struct sst_rtsp *rtsp, char *how, size_t room)
{
    for (int i = 0; i < SST_RTSP_PLACES; i++)
        forget(rtsp, &rtsp->place[i]);
    atomic_store(&rtsp->clients, 0);
    if (!rtsp->pid) {
        snprintf(how, room, "cannot be started");
        return;
    }
    close(rtsp->link);
    if (!rtsp_kill(rtsp->pid, how, room))
        rtsp->late = rtsp->pid;
    rtsp->pid = 0;
}

static const char *what(int err, const char *how)
{
    return err == -ETIMEDOUT ? "hung and was killed" : err == -EPROTO ? "made no sense and was killed" : how;
}

/* Unless all is to end. */
static void pause_for(struct sst_rtsp *rtsp, int ms)
{
    struct pollfd fd = { .fd = rtsp->wake, .events = POLLIN };

    (void)poll(&fd, 1, ms);
}

/* Until the address is there, or all ends. */
static int wait_for_address(struct sst_rtsp *rtsp)
{
    int port = 0;

    while (rtsp->listener < 0) {
        pause_for(rtsp, WAIT_MS);
        if (atomic_load(&rtsp->closing))
            return 0;
        rtsp->listener = rtsp_listen(rtsp->address, atomic_load(&rtsp->port), true, &port);
        atomic_store(&rtsp->away, rtsp->listener < 0 ? -rtsp->listener : 0); /* for another reason by now, perhaps */
    }
    atomic_store(&rtsp->port, port);
    sst_log_info("rtsp: listens on %s, port %d now", rtsp->address, port);
    return begin(rtsp);
}

static void *run(void *arg)
{
    struct sst_rtsp *rtsp = arg;
    int err = 0, pause_ms = AGAIN_MS;
    char how[96];

    sst_thread_name("rtsp");
    if (rtsp->listener < 0)
        err = wait_for_address(rtsp);
    for (;;) {
        while (!err && !atomic_load(&rtsp->closing))
            err = step(rtsp);
        end(rtsp, how, sizeof(how));
        if (atomic_load(&rtsp->closing))
            return NULL;
        pause_ms = sst_clock_now_ns() - rtsp->begun_ns > LASTS_NS ? AGAIN_MS : pause_ms;
        sst_log_warning(
            "rtsp: the process that serves viewers %s; it starts again in %g s, the rest of the service goes on",
            what(err, how), pause_ms / 1000.0);
        pause_for(rtsp, pause_ms);
        pause_ms = sst_min_int(2 * pause_ms, AGAIN_MAX);
        atomic_fetch_add(&rtsp->restarts, 1);
        err = begin(rtsp);
    }
}

/* --- open, close -------------------------------------------------------------------------------------------------- */

static int begin_first(struct sst_rtsp *rtsp)
{
    char how[96];
    int err = begin(rtsp);

    while (!err && !rtsp->ready)
        err = step(rtsp);
    if (!err || err == -ENOTSUP) /* it said what is missing */
        return err;
    end(rtsp, how, sizeof(how));
    sst_log_error("rtsp: the process that serves viewers %s (%s); set rtsp.enabled: false to do without",
                  what(err, how), strerror(-err));
    return -EIO;
}

static void await(struct sst_rtsp *rtsp)
{
    atomic_store(&rtsp->away, -rtsp->listener);
    sst_log_warning("rtsp: tried again every %d s; all else goes on", WAIT_MS / 1000);
}

int sst_rtsp_open(struct sst_rtsp **out, const struct sst_rtsp_config *cfg)
{
    struct rtsp_login login;
    struct sst_rtsp *rtsp;
    int port = 0, err = rtsp_check(&login, cfg);

    if (err)
        return err;
    rtsp = calloc(1, sizeof(*rtsp));
    if (!rtsp)
        return -ENOMEM;
    rtsp->api = cfg->api;
    rtsp->codec = cfg->codec;
    rtsp->login = login;
    rtsp->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    snprintf(rtsp->address, sizeof(rtsp->address), "%s", cfg->address);
    rtsp->listener = rtsp_listen(cfg->address, cfg->port, false, &port);
    atomic_store(&rtsp->port, rtsp->listener < 0 ? cfg->port : port);
    if (rtsp->wake < 0)
        err = -ENOMEM;
    else if (rtsp->listener == -EADDRINUSE || rtsp->listener == -EADDRNOTAVAIL)
        await(rtsp);
    else
        err = rtsp->listener < 0 ? rtsp->listener : begin_first(rtsp);
    if (!err) {
        err = -pthread_create(&rtsp->thread, NULL, run, rtsp);
        rtsp->started = !err;
        if (err)
            sst_log_error("rtsp: no thread: %s", strerror(-err));
    }
    if (err)
        sst_rtsp_close(rtsp);
    else
        *out = rtsp;
    return err;
}

int sst_rtsp_port(const struct sst_rtsp *rtsp)
{
    return atomic_load(&rtsp->port);
}

bool sst_rtsp_away(struct sst_rtsp *rtsp, char *why, size_t room)
{
    const int err = atomic_load(&rtsp->away);

    if (err)
        snprintf(why, room, "rtsp.address %s, port %d: %s", rtsp->address, atomic_load(&rtsp->port), strerror(err));
    return err != 0;
}

int sst_rtsp_clients(struct sst_rtsp *rtsp)
{
    return atomic_load(&rtsp->clients);
}

unsigned sst_rtsp_restarts(struct sst_rtsp *rtsp)
{
    return atomic_load(&rtsp->restarts);
}

void sst_rtsp_stop(struct sst_rtsp *rtsp)
{
    const uint64_t one = 1;

    if (!rtsp)
        return;
    atomic_store(&rtsp->closing, true);
    (void)!write(rtsp->wake, &one, sizeof(one));
}

void sst_rtsp_close(struct sst_rtsp *rtsp)
{
    char how[96];

    if (!rtsp)
        return;
    sst_rtsp_stop(rtsp);
    if (rtsp->started) {
        pthread_join(rtsp->thread, NULL);
    } else {
        end(rtsp, how, sizeof(how));
    }
    if (rtsp->late && !rtsp_reap(rtsp->late))
        sst_log_debug("rtsp: a process that was killed has still not ended");
    if (rtsp->listener >= 0)
        close(rtsp->listener);
    if (rtsp->wake >= 0)
        close(rtsp->wake);
    explicit_bzero(&rtsp->login, sizeof(rtsp->login));
    free(rtsp);
}

#else

int sst_rtsp_process(void)
{
    return 1;
}

int sst_rtsp_open(struct sst_rtsp **out, const struct sst_rtsp_config *cfg)
{
    (void)out;
    (void)cfg;
    sst_log_error(
        "this build has no RTSP: install libgstrtspserver-1.0-dev and build again, or set rtsp.enabled: false");
    return -ENOTSUP;
}

int sst_rtsp_port(const struct sst_rtsp *rtsp)
{
    (void)rtsp;
    return 0;
}

bool sst_rtsp_away(struct sst_rtsp *rtsp, char *why, size_t room)
{
    (void)rtsp;
    (void)why;
    (void)room;
    return false;
}

int sst_rtsp_clients(struct sst_rtsp *rtsp)
{
    (void)rtsp;
    return 0;
}

unsigned sst_rtsp_restarts(struct sst_rtsp *rtsp)
{
    (void)rtsp;
    return 0;
}

void sst_rtsp_stop(struct sst_rtsp *rtsp)
{
    (void)rtsp;
}

void sst_rtsp_close(struct sst_rtsp *rtsp)
{
    (void)rtsp;
}

#endif
