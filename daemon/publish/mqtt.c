/* The connection: one thread that never holds anybody up, and that can be left behind. */
#include "daemon/publish/publish_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"

#if WITH_MQTT
#include <mosquitto.h>
#include <poll.h>

#include "base/clock.h"
#include "base/thread.h"

#define KEEPALIVE_S 30
#define LOOP_MS     100
#define WAIT_MIN_NS INT64_C(1000000000)
#define WAIT_MAX_NS INT64_C(60000000000)
#define GOOD_NS     INT64_C(30000000000) /* a connection that lasted this long begins with the shortest wait again */
#define BYE_NS      INT64_C(300000000)
#define WITHDRAW_NS INT64_C(1000000000)

/* --- messages ----------------------------------------------------------------------------------------------------- */

bool mqtt_free(const struct sst_mqtt *m)
{
    return m->up && m->under_way < SST_MQTT_UNDER_WAY;
}

bool mqtt_tell_at(struct sst_mqtt *m, const char *topic, const void *payload, size_t bytes, int qos, bool retain)
{
    if (!mqtt_free(m) || bytes > INT32_MAX)
        return false;
    m->under_way++; /* on_publish() may come before the return */
    if (mosquitto_publish(m->client, NULL, topic, (int)bytes, payload, qos, retain)) {
        m->under_way--;
        return false;
    }
    pthread_mutex_lock(&m->lock);
    m->n.published++;
    pthread_mutex_unlock(&m->lock);
    return true;
}

bool mqtt_tell(struct sst_mqtt *m, const char *topic, const void *payload, size_t bytes, int qos, bool retain)
{
    char whole[SST_MQTT_TOPIC_MAX];

    if (snprintf(whole, sizeof(whole), "%s/%s", m->config->mqtt.topic, topic) >= (int)sizeof(whole))
        return true; /* never: it is not tried again */
    return mqtt_tell_at(m, whole, payload, bytes, qos, retain);
}

static void on_publish(struct mosquitto *client, void *arg, int id)
{
    struct sst_mqtt *m = arg;

    (void)client;
    (void)id;
    m->under_way = sst_max_int(m->under_way - 1, 0); /* some may be of an earlier connection */
}

bool mqtt_ask(struct sst_mqtt *m, const char *pattern)
{
    return !mosquitto_subscribe(m->client, NULL, pattern, 0);
}

static void on_message(struct mosquitto *client, void *arg, const struct mosquitto_message *message)
{
    struct sst_mqtt *m = arg;
    const size_t n = strlen(m->config->mqtt.topic);

    (void)client;
    if (m->stop)
        return;
    if (message->retain && message->payloadlen)
        mqtt_found(m, message->topic);
    if (!strncmp(message->topic, m->config->mqtt.topic, n) && message->topic[n] == '/')
        mqtt_command(m, message->topic + n + 1, message->payload, (size_t)message->payloadlen, message->retain);
}

/* --- connection --------------------------------------------------------------------------------------------------- */

/* Once for a time without connection. */
static void complain(struct sst_mqtt *m, const char *why)
{
    const struct sst_config *c = m->config;

    if (!m->told && !m->stop)
        sst_log_warning("mqtt: no connection to the broker at %s:%d: %s; tried again until there is one (mqtt: in "
                        "sstd.yaml)",
                        c->mqtt.host, c->mqtt.port, why);
    m->told = true;
}

static void lost(struct sst_mqtt *m, const char *why)
{
    const int64_t now_ns = sst_clock_now_ns();

    complain(m, why);
    if (m->up && now_ns - m->up_ns > GOOD_NS)
        m->wait_ns = WAIT_MIN_NS;
    m->next_try_ns = now_ns + m->wait_ns;
    m->wait_ns = m->wait_ns * 2 > WAIT_MAX_NS ? WAIT_MAX_NS : m->wait_ns * 2;
    m->connecting = m->up = false;
    m->under_way = 0;
    pthread_mutex_lock(&m->lock);
    m->n.connected = false;
    pthread_mutex_unlock(&m->lock);
    mqtt_forget(m);
}

/* Of an error of the library's, directly after it. */
static const char *reason(int err)
{
    return err == MOSQ_ERR_ERRNO ? strerror(errno)
           : err == MOSQ_ERR_TLS
               ? "TLS failed: it has no TLS on this port, or a certificate that mqtt: ca_file does not vouch for"
               : mosquitto_strerror(err);
}

static void on_connect(struct mosquitto *client, void *arg, int code)
{
    struct sst_mqtt *m = arg;
    char topic[SST_MQTT_TOPIC_MAX], why[160];

    if (m->stop)
        return;
    if (code) { /* the broker ends the connection after this */
        snprintf(why, sizeof(why), "%s Check mqtt: user and password_file", mosquitto_connack_string(code));
        complain(m, why);
        return;
    }
    if (m->told)
        sst_log_info("mqtt: connected to %s:%d", m->config->mqtt.host, m->config->mqtt.port);
    m->told = false;
    m->up = true;
    m->up_ns = sst_clock_now_ns();
    for (int i = 0; i < 2; i++) {
        snprintf(topic, sizeof(topic), "%s/%s/set", m->config->mqtt.topic, i ? "focus" : "record");
        (void)mosquitto_subscribe(client, NULL, topic, 1); /* a broken connection shows in the loop */
    }
    pthread_mutex_lock(&m->lock);
    m->n.connected = true;
    m->n.connects++;
    pthread_mutex_unlock(&m->lock);
    mqtt_greet(m);
}

static int make_client(struct sst_mqtt *m)
{
    char topic[SST_MQTT_TOPIC_MAX];

    m->client = mosquitto_new(NULL, true, m);
    if (!m->client)
        return -ENOMEM;
    snprintf(topic, sizeof(topic), "%s/available", m->config->mqtt.topic);
    mosquitto_connect_callback_set(m->client, on_connect);
    mosquitto_publish_callback_set(m->client, on_publish);
    mosquitto_message_callback_set(m->client, on_message);
    return mosquitto_will_set(m->client, topic, 7, "offline", 1, true) ? -ENOMEM : 0;
}

static void drop_client(struct sst_mqtt *m)
{
    if (m->client)
        mosquitto_destroy(m->client);
    m->client = NULL;
}

/* First line of a file. */
static int read_secret(char out[SST_CONFIG_TEXT_MAX], const char *path)
{
    FILE *f = fopen(path, "re");
    int err = f ? 0 : -errno;

    if (f && !fgets(out, SST_CONFIG_TEXT_MAX, f))
        err = ferror(f) ? -EIO : -ENODATA;
    if (!err)
        out[strcspn(out, "\r\n")] = 0;
    if (f)
        fclose(f);
    return err;
}

static void try_connect(struct sst_mqtt *m)
{
    const struct sst_config *c = m->config;
    char secret[SST_CONFIG_TEXT_MAX] = "", why[SST_CONFIG_TEXT_MAX + 80];
    int err = m->client ? 0 : make_client(m);

    if (err) {
        drop_client(m);
        lost(m, strerror(-err));
        return;
    }
    if (c->mqtt.password_file[0])
        err = read_secret(secret, c->mqtt.password_file);
    if (err) {
        snprintf(why, sizeof(why), "%s cannot be read: %s", c->mqtt.password_file, strerror(-err));
        lost(m, why);
        return;
    }
    if (c->mqtt.user[0])
        err = mosquitto_username_pw_set(m->client, c->mqtt.user, c->mqtt.password_file[0] ? secret : NULL);
    explicit_bzero(secret, sizeof(secret));
    if (!err && c->mqtt.ca_file[0])
        err = mosquitto_tls_set(m->client, c->mqtt.ca_file, NULL, NULL, NULL, NULL);
    if (err) {
        snprintf(why, sizeof(why), "%s: %s", c->mqtt.ca_file, mosquitto_strerror(err));
        lost(m, why);
        return;
    }
    err = mosquitto_connect_async(m->client, c->mqtt.host, c->mqtt.port, KEEPALIVE_S);
    if (err > 0)
        lost(m, reason(err));
    else
        m->connecting = true;
}

/* --- another configuration ---------------------------------------------------------------------------------------- */

static bool same_connection(const struct sst_config *a, const struct sst_config *b)
{
    return a->mqtt.enabled == b->mqtt.enabled && a->mqtt.port == b->mqtt.port && !strcmp(a->mqtt.host, b->mqtt.host) &&
           !strcmp(a->mqtt.user, b->mqtt.user) && !strcmp(a->mqtt.password_file, b->mqtt.password_file) &&
           !strcmp(a->mqtt.ca_file, b->mqtt.ca_file) && !strcmp(a->mqtt.topic, b->mqtt.topic);
}

/* What was announced is to be found under other topics from now on, or nowhere. */
static void withdraw(struct sst_mqtt *m)
{
    const int64_t end_ns = sst_clock_now_ns() + WITHDRAW_NS;
    bool told = false;

    mqtt_withdraw(m);
    while (!(told && !mosquitto_want_write(m->client)) && !m->stop && sst_clock_now_ns() < end_ns) {
        told = mqtt_hello(m);
        if (mosquitto_loop(m->client, 20, 1))
            return; /* the next loop says why */
    }
}

static void say_goodbye(struct sst_mqtt *m);

static void take_config(struct sst_mqtt *m)
{
    struct sst_config *next, *before = m->config;

    pthread_mutex_lock(&m->lock);
    next = m->next;
    m->next = NULL;
    pthread_mutex_unlock(&m->lock);
    if (!next)
        return;
    if (m->up && (strcmp(before->mqtt.topic, next->mqtt.topic) != 0 ||
                  strcmp(before->mqtt.discovery, next->mqtt.discovery) != 0))
        withdraw(m);
    if (!same_connection(before, next)) {
        say_goodbye(m);
        m->told = true; /* it goes because we want it */
        lost(m, "");
        m->told = false;
        drop_client(m);
    }
    m->config = next;
    free(before);
    m->wait_ns = WAIT_MIN_NS;
    m->next_try_ns = 0;
    if (m->up)
        mqtt_greet(m);
}

static void step(struct sst_mqtt *m)
{
    int err;

    take_config(m);
    if (!m->config->mqtt.enabled) {
        pthread_mutex_lock(&m->lock);
        while (!m->stop && !m->next)
            pthread_cond_wait(&m->changed, &m->lock);
        pthread_mutex_unlock(&m->lock);
        return;
    }
    if (!m->connecting && sst_clock_now_ns() >= m->next_try_ns)
        try_connect(m);
    if (!m->connecting) {
        poll(NULL, 0, LOOP_MS);
        return;
    }
    err = mosquitto_loop(m->client, LOOP_MS, 1);
    if (err) {
        lost(m, reason(err));
        return;
    }
    if (m->up && !m->stop)
        mqtt_due(m);
}

/* Those who subscribed learn it at once, instead of when the broker misses us. */
static void say_goodbye(struct sst_mqtt *m)
{
    const int64_t end_ns = sst_clock_now_ns() + BYE_NS;
    const int before = m->under_way;

    if (!m->up)
        return;
    m->under_way = 0; /* this one is always let through */
    if (!mqtt_tell(m, "available", "offline", 7, 0, true))
        return;
    m->under_way += before;
    /* A connection that is closed with receipts unread is reset, and the broker publishes the last will, too. */
    while ((mosquitto_want_write(m->client) || m->under_way) && sst_clock_now_ns() < end_ns)
        if (mosquitto_loop(m->client, 20, 1))
            return;
    (void)mosquitto_disconnect(m->client);
}

static void destroy(struct sst_mqtt *m)
{
    mqtt_forget(m);
    drop_client(m);
    mosquitto_lib_cleanup();
    pthread_cond_destroy(&m->changed);
    pthread_mutex_destroy(&m->lock);
    free(m->next);
    free(m->config);
    free(m);
}

static void *work(void *arg)
{
    struct sst_mqtt *m = arg;
    bool abandoned;

    while (!m->stop)
        step(m);
    say_goodbye(m);
    pthread_mutex_lock(&m->lock);
    m->done = true;
    abandoned = m->abandoned;
    pthread_cond_broadcast(&m->changed);
    pthread_mutex_unlock(&m->lock);
    if (abandoned)
        destroy(m);
    return NULL;
}

/* --- verbs -------------------------------------------------------------------------------------------------------- */

int sst_mqtt_open(struct sst_mqtt **out, const struct sst_mqtt_config *cfg)
{
    struct sst_mqtt *m;
    int err = -ENOMEM;

    if (!cfg->config->mqtt.host[0] || !cfg->config->mqtt.topic[0])
        return -EINVAL;
    m = calloc(1, sizeof(*m));
    if (!m)
        return -ENOMEM;
    pthread_mutex_init(&m->lock, NULL);
    sst_cond_init(&m->changed);
    mosquitto_lib_init();
    m->api = cfg->api;
    m->wait_ns = WAIT_MIN_NS;
    m->config = malloc(sizeof(*m->config));
    if (m->config) {
        *m->config = *cfg->config;
        err = -pthread_create(&m->thread, NULL, work, m);
    }
    if (err) {
        destroy(m);
        return err;
    }
    *out = m;
    return 0;
}

int sst_mqtt_configure(struct sst_mqtt *m, const struct sst_config *config)
{
    struct sst_config *next = malloc(sizeof(*next));

    if (!next)
        return -ENOMEM;
    *next = *config;
    pthread_mutex_lock(&m->lock);
    free(m->next);
    m->next = next;
    pthread_cond_broadcast(&m->changed);
    pthread_mutex_unlock(&m->lock);
    return 0;
}

void sst_mqtt_counters(struct sst_mqtt *m, struct sst_mqtt_counters *out)
{
    pthread_mutex_lock(&m->lock);
    *out = m->n;
    pthread_mutex_unlock(&m->lock);
}

void sst_mqtt_stop(struct sst_mqtt *m)
{
    if (!m)
        return;
    pthread_mutex_lock(&m->lock);
    m->stop = true;
    pthread_cond_broadcast(&m->changed);
    pthread_mutex_unlock(&m->lock);
}

bool sst_mqtt_close(struct sst_mqtt *m, int timeout_ms)
{
    const int64_t end_ns = sst_clock_now_ns() + timeout_ms * INT64_C(1000000);
    pthread_t thread;
    bool done;

    if (!m)
        return true;
    thread = m->thread;
    sst_mqtt_stop(m);
    pthread_mutex_lock(&m->lock);
    while (!m->done && sst_cond_wait_until(&m->changed, &m->lock, end_ns))
        ;
    done = m->done;
    m->abandoned = !done;
    pthread_mutex_unlock(&m->lock);
    if (!done) {
        pthread_detach(thread);
        return false;
    }
    pthread_join(thread, NULL);
    destroy(m);
    return true;
}

#else

int sst_mqtt_open(struct sst_mqtt **out, const struct sst_mqtt_config *cfg)
{
    *out = NULL;
    return sst_mqtt_configure(NULL, cfg->config);
}

int sst_mqtt_configure(struct sst_mqtt *m, const struct sst_config *config)
{
    (void)m;
    if (!config->mqtt.enabled)
        return 0;
    sst_log_error("mqtt: this program was built without libmosquitto; set mqtt: enabled: false");
    return -ENOTSUP;
}

void sst_mqtt_counters(struct sst_mqtt *m, struct sst_mqtt_counters *out)
{
    (void)m;
    *out = (struct sst_mqtt_counters){ 0 };
}

void sst_mqtt_stop(struct sst_mqtt *m)
{
    (void)m;
}

bool sst_mqtt_close(struct sst_mqtt *m, int timeout_ms)
{
    (void)m;
    (void)timeout_ms;
    return true;
}

#endif
