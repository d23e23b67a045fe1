/* The process that serves RTSP, as it speaks with the service: one thread reads what the service sends, and says whose
 * pictures are watched. When the service is gone, so is the process, whatever its other threads do. */
#include "daemon/publish/rtsp_internal.h"

#if WITH_RTSP

#include <errno.h>
#include <fcntl.h>
#include <malloc.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"

#define LOOK_MS   10           /* between looks whether somebody watches */
#define UNUSED_NS 5000000000LL /* a picture that nobody has watched for so long is forgotten */
#define ARENAS    4            /* a thread for each client: memory would never come back */

enum state { FREE = 0, ASKED = 1, LIVE = 2 };

struct place {
    enum state state;
    enum sst_api_picture kind;
    char name[SST_RTSP_NAME];
    struct sst_outlet *outlet;
    bool watched;
    int waiting, err; /* threads that wait for the answer, and what it was */
    int64_t used_ns;
};

static struct {
    pthread_mutex_t saying; /* one message at a time */
    pthread_mutex_t lock;   /* of the places; saying comes after it */
    pthread_cond_t answered;
    struct place place[SST_RTSP_PLACES];
} process = { .saying = PTHREAD_MUTEX_INITIALIZER,
              .lock = PTHREAD_MUTEX_INITIALIZER,
              .answered = PTHREAD_COND_INITIALIZER };

/* Without the service there is nothing to do, nor to save. */
static void say(const struct rtsp_message *message)
{
    int err;

    pthread_mutex_lock(&process.saying);
    err = rtsp_link_send(SST_RTSP_LINK_FD, message, NULL, -1);
    pthread_mutex_unlock(&process.saying);
    if (err)
        _exit(0);
}

static void say_of(int place, enum rtsp_word word, int value)
{
    const struct rtsp_message m = { .word = word, .place = place, .value = value };

    say(&m);
}

void rtsp_say_wrong(const char *address)
{
    struct rtsp_message m = { .word = SST_RTSP_WRONG };

    strncpy(m.name, address, sizeof(m.name) - 1);
    say(&m);
}

void rtsp_say_clients(int clients)
{
    say_of(0, SST_RTSP_CLIENTS, clients);
}

/* --- places ------------------------------------------------------------------------------------------------------- */

static struct place *known_locked(enum sst_api_picture kind, const char *name)
{
    for (int i = 0; i < SST_RTSP_PLACES; i++) {
        struct place *p = &process.place[i];

        if (p->state != FREE && p->kind == kind && !strcmp(p->name, name))
            return p;
    }
    return NULL;
}

/* @return asked for; NULL: none is free */
static struct place *ask_locked(enum sst_api_picture kind, const char *name)
{
    struct rtsp_message m = { .word = SST_RTSP_FIND, .value = kind };
    struct place *p = NULL;

    for (int i = 0; i < SST_RTSP_PLACES && !p; i++)
        if (process.place[i].state == FREE && !process.place[i].waiting)
            p = &process.place[i];
    if (!p)
        return NULL;
    *p = (struct place){ .state = ASKED, .kind = kind };
    if (sst_outlet_create(&p->outlet)) {
        *p = (struct place){ .state = FREE };
        return NULL;
    }
    strcpy(p->name, name);
    strcpy(m.name, name);
    m.place = (int32_t)(p - process.place);
    say(&m);
    return p;
}

int rtsp_find(enum sst_api_picture kind, const char *name, struct sst_outlet **out)
{
    struct place *p;
    int err = -EOVERFLOW;

    if (strlen(name) >= SST_RTSP_NAME)
        return -ENOENT;
    pthread_mutex_lock(&process.lock);
    p = known_locked(kind, name);
    if (!p)
        p = ask_locked(kind, name);
    if (p) {
        p->waiting++;
        while (p->state == ASKED)
            pthread_cond_wait(&process.answered, &process.lock);
        p->waiting--;
        err = p->err;
        if (!err)
            *out = sst_outlet_ref(p->outlet);
    }
    pthread_mutex_unlock(&process.lock);
    return err;
}

/* Who holds the outlet, and even joins it just now, sees that it is over. */
static void drop_locked(struct place *p, int err)
{
    sst_outlet_shut(p->outlet);
    sst_outlet_unref(p->outlet);
    p->outlet = NULL;
    p->state = FREE;
    p->err = err;
}

static void look_locked(struct place *p, int64_t now_ns)
{
    const bool watched = sst_outlet_viewers(p->outlet) > 0;
    const int at = (int)(p - process.place);

    if (watched != p->watched)
        say_of(at, SST_RTSP_WATCH, watched);
    p->watched = watched;
    if (watched)
        p->used_ns = now_ns;
    if (now_ns - p->used_ns > UNUSED_NS) {
        drop_locked(p, -ENOENT);
        say_of(at, SST_RTSP_FORGET, 0);
    }
}

/* @return milliseconds to the next look; -1: nothing can change */
static int look(void)
{
    const int64_t now_ns = sst_clock_now_ns();
    int next_ms = -1;

    pthread_mutex_lock(&process.lock);
    for (int i = 0; i < SST_RTSP_PLACES; i++)
        if (process.place[i].state == LIVE) {
            look_locked(&process.place[i], now_ns);
            next_ms = LOOK_MS;
        }
    pthread_mutex_unlock(&process.lock);
    return next_ms;
}

/* --- what the service says ------------------------------------------------------------------------------------------
 */

static void found_locked(struct place *p, int err)
{
    if (p->state != ASKED)
        return;
    p->err = err;
    p->used_ns = sst_clock_now_ns();
    if (err)
        drop_locked(p, err);
    else
        p->state = LIVE;
    pthread_cond_broadcast(&process.answered);
}

static int take_picture_locked(struct place *p, const struct rtsp_message *m, uint8_t *jpeg)
{
    if (p->state == LIVE)
        return sst_outlet_put(p->outlet, jpeg, m->bytes, m->set, m->t_ns, m->wall_ns);
    free(jpeg); /* of what was here before */
    return 0;
}

static void take(const struct rtsp_message *m, uint8_t *data)
{
    struct place *p = &process.place[m->place];

    pthread_mutex_lock(&process.lock);
    if (m->word == SST_RTSP_FOUND) {
        found_locked(p, m->value);
    } else if (m->word == SST_RTSP_PICTURE) {
        if (take_picture_locked(p, m, data))
            sst_log_warning("rtsp: no memory for a picture; it is passed over");
    } else if (m->word == SST_RTSP_OVER && p->state == LIVE) {
        drop_locked(p, -ENOENT);
        say_of(m->place, SST_RTSP_FORGET, 0);
    }
    pthread_mutex_unlock(&process.lock);
}

static void hear(void)
{
    struct rtsp_message m;
    uint8_t *data = NULL;

    if (rtsp_link_read(SST_RTSP_LINK_FD, &m, sizeof(m), -1))
        _exit(0);
    if (m.bytes) {
        data = malloc(m.bytes);
        if (!data) {
            sst_log_error("rtsp: no memory for a picture of %u bytes", m.bytes);
            _exit(EXIT_FAILURE);
        }
        if (rtsp_link_read(SST_RTSP_LINK_FD, data, m.bytes, -1))
            _exit(0);
    }
    take(&m, data);
}

static void *listen_to_service(void *arg)
{
    struct pollfd fd = { .fd = SST_RTSP_LINK_FD, .events = POLLIN };

    (void)arg;
    sst_thread_name("rtsp-link");
    for (;;)
        if (poll(&fd, 1, look()) > 0)
            hear();
    return NULL;
}

/* --- begin -------------------------------------------------------------------------------------------------------- */

/* Memory that runs out is to be taken from here, not from what captures. */
static void go_first(void)
{
    static const char points[] = "500";
    const int fd = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);

    if (fd < 0)
        return;
    if (write(fd, points, sizeof(points) - 1) < 0)
        sst_log_debug("rtsp: oom_score_adj: %s", strerror(errno));
    close(fd);
}

int sst_rtsp_process(void)
{
    static struct rtsp_server server;
    struct rtsp_message settings;
    struct rtsp_login login;
    pthread_t thread;
    int err;

    sst_thread_name("sstd-rtsp");
    sst_log_use_journal(getenv("JOURNAL_STREAM") != NULL);
    signal(SIGPIPE, SIG_IGN);
    mallopt(M_ARENA_MAX, ARENAS);
    go_first();
    if (rtsp_link_init(SST_RTSP_LINK_FD) || rtsp_link_read(SST_RTSP_LINK_FD, &settings, sizeof(settings), -1) ||
        settings.word != SST_RTSP_SETTINGS || settings.bytes != sizeof(login) ||
        rtsp_link_read(SST_RTSP_LINK_FD, &login, sizeof(login), -1)) {
        sst_log_error("%s is for sstd itself: it serves RTSP where rtsp.enabled is true", SST_RTSP_PROCESS);
        return EXIT_FAILURE;
    }
    err = rtsp_server_open(&server, (enum sst_rtsp_codec)settings.value, &login);
    explicit_bzero(&login, sizeof(login));
    if (!err)
        err = -pthread_create(&thread, NULL, listen_to_service, NULL);
    say_of(0, SST_RTSP_READY, err);
    if (err)
        return EXIT_FAILURE;
    rtsp_server_run(&server);
}

#endif
