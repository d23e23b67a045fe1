/* The connection to the broker; main thread only. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <mosquitto.h>

#include "base/clock.h"
#include "base/log.h"
#include "publishers/mqtt/mqtt_internal.h"

#define KEEPALIVE_S 30
#define LOOP_MS     100
#define WAIT_MIN_NS INT64_C(1000000000)
#define WAIT_MAX_NS INT64_C(60000000000)
#define GOOD_NS     INT64_C(30000000000) /* after a connection that lasted this long the first wait is the shortest */
#define BYE_NS      INT64_C(300000000)
#define WITHDRAW_NS INT64_C(10000000000) /* on a busy machine; an end of the program does not wait */

/* --- messages ----------------------------------------------------------------------------------------------------- */

static bool is_free(const struct mqtt *m)
{
    return m->up && m->in_flight < MQTT_IN_FLIGHT_MAX;
}

bool mqtt_publish_at(struct mqtt *m, const char *topic, const void *payload, size_t bytes, int qos, bool retain)
{
    if (!is_free(m) || bytes > INT32_MAX)
        return false;
    m->in_flight++; /* on_publish() may come before the return */
    if (mosquitto_publish(m->client, NULL, topic, (int)bytes, payload, qos, retain)) {
        m->in_flight--;
        return false;
    }
    return true;
}

bool mqtt_publish(struct mqtt *m, const char *topic, const void *payload, size_t bytes, int qos, bool retain)
{
    char whole[MQTT_TOPIC_MAX];

    if (snprintf(whole, sizeof(whole), "%s/%s", m->config->mqtt.topic, topic) >= (int)sizeof(whole))
        return true; /* never: it is not tried again */
    return mqtt_publish_at(m, whole, payload, bytes, qos, retain);
}

static void on_publish(struct mosquitto *client SST_UNUSED, void *arg, int id SST_UNUSED)
{
    struct mqtt *m = arg;

    m->in_flight = sst_max_int(m->in_flight - 1, 0); /* some may be of an earlier connection */
}

bool mqtt_subscribe(struct mqtt *m, const char *pattern)
{
    return !mosquitto_subscribe(m->client, NULL, pattern, 0);
}

static void on_message(struct mosquitto *client SST_UNUSED, void *arg, const struct mosquitto_message *message)
{
    struct mqtt *m = arg;
    const size_t n = strlen(m->config->mqtt.topic);

    if (m->stop)
        return;
    if (message->retain && message->payloadlen)
        mqtt_on_announced(m, message->topic);
    if (!strncmp(message->topic, m->config->mqtt.topic, n) && message->topic[n] == '/')
        mqtt_on_command(m, message->topic + n + 1, message->payload, (size_t)message->payloadlen, message->retain);
}

/* --- connection --------------------------------------------------------------------------------------------------- */

/* Once for each time without a connection. */
static void report_disconnected(struct mqtt *m, const char *why)
{
    const struct sst_config *c = m->config;

    if (!m->reported && !m->stop)
        sst_log_warning("mqtt: no connection to the broker at %s:%d: %s; retrying (mqtt: in sstd.yaml)", c->mqtt.host,
                        c->mqtt.port, why);
    m->reported = true;
}

static void lost(struct mqtt *m, const char *why)
{
    const int64_t now_ns = sst_clock_now_ns();

    report_disconnected(m, why);
    if (m->up && now_ns - m->up_ns > GOOD_NS)
        m->wait_ns = WAIT_MIN_NS;
    m->next_try_ns = now_ns + m->wait_ns;
    m->wait_ns = m->wait_ns * 2 > WAIT_MAX_NS ? WAIT_MAX_NS : m->wait_ns * 2;
    m->connecting = m->up = false;
    m->in_flight = 0;
    mqtt_topics_reset(m);
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
    struct mqtt *m = arg;
    char topic[MQTT_TOPIC_MAX], why[160];

    if (m->stop)
        return;
    if (code) { /* the broker ends the connection after this */
        snprintf(why, sizeof(why), "%s Check mqtt: user and password_file", mosquitto_connack_string(code));
        report_disconnected(m, why);
        return;
    }
    if (m->reported)
        sst_log_info("mqtt: connected to %s:%d", m->config->mqtt.host, m->config->mqtt.port);
    m->reported = false;
    m->up = true;
    m->up_ns = sst_clock_now_ns();
    for (int i = 0; i < 2; i++) {
        snprintf(topic, sizeof(topic), "%s/%s/set", m->config->mqtt.topic, i ? "focus" : "record");
        (void)mosquitto_subscribe(client, NULL, topic, 1); /* a broken connection shows in the loop */
    }
    mqtt_topics_begin(m);
}

static int make_client(struct mqtt *m)
{
    char topic[MQTT_TOPIC_MAX];

    m->client = mosquitto_new(NULL, true, m);
    if (!m->client)
        return -ENOMEM;
    snprintf(topic, sizeof(topic), "%s/available", m->config->mqtt.topic);
    mosquitto_connect_callback_set(m->client, on_connect);
    mosquitto_publish_callback_set(m->client, on_publish);
    mosquitto_message_callback_set(m->client, on_message);
    return mosquitto_will_set(m->client, topic, 7, "offline", 1, true) ? -ENOMEM : 0;
}

static void drop_client(struct mqtt *m)
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

static void try_connect(struct mqtt *m)
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

/* Remove what was announced under the old topics. */
static void withdraw(struct mqtt *m)
{
    const int64_t end_ns = sst_clock_now_ns() + WITHDRAW_NS;
    bool done = false;

    mqtt_withdraw(m);
    while (!(done && !mosquitto_want_write(m->client)) && !m->stop && sst_clock_now_ns() < end_ns) {
        done = mqtt_announce_step(m);
        if (mosquitto_loop(m->client, 20, 1))
            return; /* the next loop logs the reason */
    }
}

/* Subscribers get "offline" at once, not only when the broker misses the client. */
static void disconnect_politely(struct mqtt *m)
{
    const int64_t end_ns = sst_clock_now_ns() + BYE_NS;
    const int before = m->in_flight;

    if (!m->up)
        return;
    m->in_flight = 0; /* this one is always let through */
    if (!mqtt_publish(m, "available", "offline", 7, 0, true))
        return;
    m->in_flight += before;
    /* A connection that is closed with receipts unread is reset, and the broker publishes the last will, too. */
    while ((mosquitto_want_write(m->client) || m->in_flight) && sst_clock_now_ns() < end_ns)
        if (mosquitto_loop(m->client, 20, 1))
            return;
    (void)mosquitto_disconnect(m->client);
}

static void close_connection(struct mqtt *m)
{
    disconnect_politely(m);
    m->reported = true; /* it ends on purpose */
    lost(m, "");
    m->reported = false;
    drop_client(m);
}

void mqtt_configure(struct mqtt *m, struct sst_config *next)
{
    struct sst_config *before = m->config;

    if (m->up && (strcmp(before->mqtt.topic, next->mqtt.topic) != 0 ||
                  strcmp(before->mqtt.discovery, next->mqtt.discovery) != 0))
        withdraw(m);
    if (!same_connection(before, next))
        close_connection(m);
    m->config = next;
    free(before);
    memset(m->visit, 0, sizeof(m->visit)); /* the zones may be others */
    m->wanteds = 0;
    m->wait_ns = WAIT_MIN_NS;
    m->next_try_ns = 0;
    if (m->up)
        mqtt_topics_begin(m);
}

bool mqtt_step(struct mqtt *m, bool wanted)
{
    int err;

    if (!wanted) {
        if (m->client)
            close_connection(m);
        m->wait_ns = WAIT_MIN_NS;
        m->next_try_ns = 0;
        return false;
    }
    if (!m->connecting && sst_clock_now_ns() >= m->next_try_ns)
        try_connect(m);
    if (!m->connecting)
        return false;
    err = mosquitto_loop(m->client, LOOP_MS, 1);
    if (err)
        lost(m, reason(err));
    else if (m->up && !m->stop)
        mqtt_topics_step(m);
    return true;
}

void mqtt_init(struct mqtt *m)
{
    mosquitto_lib_init();
    m->wait_ns = WAIT_MIN_NS;
}

void mqtt_fini(struct mqtt *m)
{
    disconnect_politely(m);
    mqtt_topics_reset(m);
    drop_client(m);
    mosquitto_lib_cleanup();
}
