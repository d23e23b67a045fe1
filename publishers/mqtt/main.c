/* sst-mqtt: publishes state, events and pictures of the service at an MQTT broker, and carries out commands from there.
 * The main thread talks to the broker; one thread receives the service's events, another one its pictures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "publishers/mqtt/mqtt_internal.h"

#define WAIT_MS  1000
#define RETRY_MS 100 /* while a connection is wanted and there is none */

static struct mqtt mqtt = { .lock = PTHREAD_MUTEX_INITIALIZER, .picture_wanted = PTHREAD_COND_INITIALIZER };

static void wake(struct mqtt *m)
{
    const uint64_t one = 1;
    const int err = errno;

    (void)!write(m->wake, &one, sizeof(one));
    errno = err;
}

static void on_signal(int sig SST_UNUSED)
{
    mqtt.stop = true;
    wake(&mqtt);
}

/* --- events ------------------------------------------------------------------------------------------------------- */

static void drop_oldest_locked(struct mqtt *m)
{
    free(m->event[m->first_event]);
    m->first_event = (m->first_event + 1) % MQTT_EVENTS_MAX;
    m->events--;
}

static void on_event(void *arg, const json_t *event, const char *line)
{
    struct mqtt *m = arg;
    const char *type = json_string_value(json_object_get(event, "type"));
    char *copy = strdup(line);

    pthread_mutex_lock(&m->lock);
    if (copy && m->events == MQTT_EVENTS_MAX)
        drop_oldest_locked(m);
    if (copy)
        m->event[(m->first_event + m->events++) % MQTT_EVENTS_MAX] = copy;
    m->reload = m->reload || (type && !strcmp(type, "reload"));
    pthread_mutex_unlock(&m->lock);
    wake(m);
}

char *mqtt_next_event(struct mqtt *m)
{
    char *line = NULL;

    pthread_mutex_lock(&m->lock);
    if (m->events) {
        line = m->event[m->first_event];
        m->event[m->first_event] = NULL;
        drop_oldest_locked(m);
    }
    pthread_mutex_unlock(&m->lock);
    return line;
}

void mqtt_return_event(struct mqtt *m, char *line)
{
    pthread_mutex_lock(&m->lock);
    if (m->events < MQTT_EVENTS_MAX) {
        m->first_event = (m->first_event + MQTT_EVENTS_MAX - 1) % MQTT_EVENTS_MAX;
        m->event[m->first_event] = line;
        m->events++;
        line = NULL;
    }
    pthread_mutex_unlock(&m->lock);
    free(line);
}

static void on_connected(void *arg, bool connected)
{
    struct mqtt *m = arg;

    pthread_mutex_lock(&m->lock);
    m->service_up = connected;
    m->reload = m->reload || connected;
    pthread_mutex_unlock(&m->lock);
    wake(m);
}

static bool go_on(void *arg)
{
    return !((struct mqtt *)arg)->stop;
}

static void *follow(void *arg)
{
    const struct sst_publisher_listener listener = {
        .connected = on_connected, .event = on_event, .go_on = go_on, .arg = arg, .kept = true
    };

    sst_thread_name("mqtt-events");
    sst_publisher_follow(&((struct mqtt *)arg)->publisher, &listener);
    return NULL;
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

/* Picture of a visit: the clear one, or, where it was not kept, the camera's. */
static void get_picture(struct mqtt *m, const char *visit, uint8_t **data, size_t *bytes)
{
    static const char *const kinds[] = { "seen", "camera" };
    char held[SST_LOG_MAX] = "", path[128] = "/snapshot";
    struct sst_client *client = NULL;
    int err;

    sst_log_hold_errors(held);
    err = sst_client_open(&client, &m->publisher.service);
    if (!err)
        sst_client_set_continue(client, go_on, m);
    for (int i = 0; !err && i < (*visit ? 2 : 1); i++) {
        if (*visit)
            snprintf(path, sizeof(path), "/api/v1/visits/%.63s/%s", visit, kinds[i]);
        if (!sst_client_bytes(client, path, data, bytes))
            break;
        *data = NULL;
    }
    sst_client_close(client);
    sst_log_hold_errors(NULL);
}

/* A picture may take seconds, and is rendered only for this request. */
static void *get_pictures(void *arg)
{
    struct mqtt *m = arg;
    char visit[64];
    uint8_t *data;
    size_t bytes;

    sst_thread_name("mqtt-picture");
    for (;;) {
        pthread_mutex_lock(&m->lock);
        while (!m->picture_asked && !m->stop)
            pthread_cond_wait(&m->picture_wanted, &m->lock);
        if (m->stop)
            break;
        memcpy(visit, m->picture_of, sizeof(visit));
        pthread_mutex_unlock(&m->lock);
        data = NULL;
        bytes = 0;
        get_picture(m, visit, &data, &bytes);
        pthread_mutex_lock(&m->lock);
        m->picture_asked = false;
        m->picture_ready = true;
        m->picture = data;
        m->picture_bytes = bytes;
        pthread_mutex_unlock(&m->lock);
    }
    pthread_mutex_unlock(&m->lock);
    return NULL;
}

bool mqtt_fetch_picture(struct mqtt *m, const char *visit, uint8_t **data, size_t *bytes)
{
    bool ready;

    pthread_mutex_lock(&m->lock);
    ready = m->picture_ready && !strcmp(m->picture_of, visit);
    if (m->picture_ready && !ready) { /* nobody wants it any more */
        free(m->picture);
        m->picture_ready = false;
    }
    if (ready) {
        *data = m->picture;
        *bytes = m->picture_bytes;
        m->picture_ready = false;
    } else if (!m->picture_asked) {
        m->picture_asked = true;
        snprintf(m->picture_of, sizeof(m->picture_of), "%s", visit);
        pthread_cond_signal(&m->picture_wanted);
    }
    pthread_mutex_unlock(&m->lock);
    return ready;
}

/* --- main --------------------------------------------------------------------------------------------------------- */

static void reload(struct mqtt *m)
{
    static const char *const sections[] = { "mqtt.", "zones", "array.", NULL };
    struct sst_config *next = calloc(1, sizeof(*next));

    if (next && sst_publisher_changed(&m->publisher, m->config, next, sections))
        mqtt_configure(m, next);
    else
        free(next);
}

static void run(struct mqtt *m)
{
    struct pollfd fd = { .fd = m->wake, .events = POLLIN };
    bool up, changed;
    uint64_t count;

    while (!m->stop) {
        pthread_mutex_lock(&m->lock);
        up = m->service_up;
        changed = m->reload;
        m->reload = false;
        pthread_mutex_unlock(&m->lock);
        if (changed)
            reload(m);
        if (mqtt_step(m, up && m->config->mqtt.enabled))
            continue;
        if (poll(&fd, 1, up && m->config->mqtt.enabled ? RETRY_MS : WAIT_MS) > 0)
            (void)!read(m->wake, &count, sizeof(count));
    }
}

int main(int argc, char **argv)
{
    const struct sigaction act = { .sa_handler = on_signal };
    struct mqtt *m = &mqtt;
    int64_t stop_ns;
    int done;

    m->config = calloc(1, sizeof(*m->config));
    m->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (!m->config || m->wake < 0)
        return EXIT_FAILURE;
    sigaction(SIGTERM, &act, NULL); /* first: the service may end at once */
    sigaction(SIGINT, &act, NULL);
    m->publisher = (struct sst_publisher){
        .name = "mqtt",
        .program = "sst-mqtt",
        .help = SST_PUBLISHER_HELP("sst-mqtt", "Publishes state, events and pictures of sstd at an MQTT broker.")
    };
    done = sst_publisher_begin(&m->publisher, m->config, argc, argv);
    if (done != SST_PROGRAM_GO_ON)
        return done;
    mqtt_init(m);
    if (sst_publisher_start(&m->publisher, follow, m) || sst_publisher_start(&m->publisher, get_pictures, m))
        return EXIT_FAILURE;
    run(m);
    stop_ns = sst_clock_now_ns();
    mqtt_fini(m);
    pthread_mutex_lock(&m->lock);
    pthread_cond_signal(&m->picture_wanted);
    pthread_mutex_unlock(&m->lock);
    sst_publisher_end(&m->publisher, stop_ns + SST_PUBLISHER_STOP_NS);
}
