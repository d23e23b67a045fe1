/* The connection to the broker; main thread only. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <mosquitto.h>
#include <mqtt_protocol.h>

#include "base/clock.h"
#include "base/log.h"
#include "publishers/mqtt/mqtt_internal.h"

#define KEEPALIVE_S  30
#define LARGE_BYTES  65536
#define HEADER_BYTES 16   /* of a packet, beside topic and payload */
#define REFUSED      0x80 /* reason codes from here on, of MQTT 5 */
#define SHORT_LIVES  3
#define LOOP_MS      100
#define WAIT_MIN_NS  INT64_C(1000000000)
#define WAIT_MAX_NS  INT64_C(60000000000)
#define GOOD_NS      INT64_C(30000000000) /* after a connection that lasted this long the first wait is the shortest */
#define BYE_NS       INT64_C(300000000)
#define WITHDRAW_NS  INT64_C(10000000000) /* on a busy machine; an end of the program does not wait */

/* --- messages ----------------------------------------------------------------------------------------------------- */

/* A large message goes alone: if the connection ends with it, nothing else is lost. */
static bool is_free(const struct mqtt *m)
{
    return m->up && m->in_flight < MQTT_IN_FLIGHT_MAX && !m->large;
}

/* The broker would end the connection, and again with the next one. */
static bool is_too_large(struct mqtt *m, const char *topic, size_t bytes)
{
    const size_t packet = bytes + strlen(topic) + HEADER_BYTES;
    const bool told = m->packet_max && packet > m->packet_max;

    if (!told && !(m->learned_max && packet > m->learned_max))
        return false;
    if (!m->left_out)
        sst_log_warning("mqtt: %s is left out as long as it is larger than %s: it has %zu bytes, of %zu; raise the "
                        "broker's limit (mosquitto: max_packet_size, message_size_limit), or lower live: jpeg_quality",
                        topic, told ? "the broker accepts" : "what ended the connection twice", bytes,
                        told ? m->packet_max : m->learned_max);
    m->left_out = true;
    return true;
}

bool mqtt_publish_at(struct mqtt *m, const char *topic, const void *payload, size_t bytes, unsigned how)
{
    const bool large = bytes >= LARGE_BYTES;
    int id = 0;

    if (!is_free(m) || bytes > INT32_MAX)
        return false;
    if (is_too_large(m, topic, bytes))
        return true; /* it is not tried again */
    m->in_flight++;  /* on_publish() may come before the return */
    /* Only acknowledged messages have arrived. */
    if (mosquitto_publish(m->client, &id, topic, (int)bytes, payload, large || how & MQTT_SURE ? 1 : 0,
                          (how & MQTT_RETAIN) != 0)) {
        m->in_flight--;
        return false;
    }
    if (large) {
        m->large = bytes + strlen(topic) + HEADER_BYTES;
        m->large_id = id;
    }
    return true;
}

bool mqtt_publish(struct mqtt *m, const char *topic, const void *payload, size_t bytes, unsigned how)
{
    char whole[MQTT_TOPIC_MAX];

    if (snprintf(whole, sizeof(whole), "%s/%s", m->config->mqtt.topic, topic) >= (int)sizeof(whole))
        return true; /* never: it is not tried again */
    return mqtt_publish_at(m, whole, payload, bytes, how);
}

static void on_publish(struct mosquitto *client SST_UNUSED, void *arg, int id, int code,
                       const mosquitto_property *properties SST_UNUSED)
{
    struct mqtt *m = arg;

    m->in_flight = sst_max_int(m->in_flight - 1, 0); /* some may be of an earlier connection */
    if (code >= REFUSED && !m->unaccepted) {
        sst_log_warning("mqtt: the broker refuses a message: %s%s", mosquitto_reason_string(code),
                        code == MQTT_RC_NOT_AUTHORIZED ? " Its acl_file must allow what docs/integrate/mqtt.md lists"
                                                       : "");
        m->unaccepted = true;
    }
    if (!m->large || id != m->large_id)
        return;
    if (code == MQTT_RC_PACKET_TOO_LARGE)
        m->learned_max = m->large - 1;
    m->large = 0;
    m->large_lost = 0;
}

bool mqtt_subscribe(struct mqtt *m, const char *pattern, int *id)
{
    return !mosquitto_subscribe(m->client, id, pattern, 0);
}

static void on_subscribe(struct mosquitto *client SST_UNUSED, void *arg, int id, int count SST_UNUSED,
                         const int *granted SST_UNUSED)
{
    mqtt_on_subscribed(arg, id);
}

static void on_message(struct mosquitto *client SST_UNUSED, void *arg, const struct mosquitto_message *message)
{
    struct mqtt *m = arg;
    const size_t n = strlen(m->config->mqtt.topic);

    if (m->stop)
        return;
    if (message->retain && message->payloadlen)
        mqtt_on_announced(m, message->topic, message->payload, (size_t)message->payloadlen);
    if (strncmp(message->topic, m->config->mqtt.topic, n) != 0 || message->topic[n] != '/')
        return;
    if (strcmp(message->topic + n + 1, "available") != 0)
        mqtt_on_command(m, message->topic + n + 1, message->payload, (size_t)message->payloadlen, message->retain);
    else if (message->payloadlen == 7 && !memcmp(message->payload, "offline", 7))
        m->online_due = true; /* such as the last will of a connection that died unnoticed */
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

/* Two programs of one id would end each other's connections for ever. */
static void avoid_other(struct mqtt *m, const char *what)
{
    sst_log_warning(
        "mqtt: %s client id %s: another array with this mqtt: topic needs one of its own; this one continues "
        "with another id",
        what, m->id);
    m->shared_id = true;
    m->id[0] = 0;
}

static void drop_client(struct mqtt *m)
{
    if (m->client)
        mosquitto_destroy(m->client);
    m->client = NULL;
}

/* Does a large message end connections? The library would send it again with the next one, whose messages are for us to
 * choose. */
static void lose_large(struct mqtt *m)
{
    if (!m->large)
        return;
    if (++m->large_lost >= 2)
        m->learned_max = m->large / 4 * 3;
    m->large = 0;
    drop_client(m);
}

static void lost(struct mqtt *m, const char *why)
{
    const int64_t now_ns = sst_clock_now_ns();

    report_disconnected(m, why);
    if (m->up && now_ns - m->up_ns > GOOD_NS)
        m->wait_ns = WAIT_MIN_NS;
    if (m->up && now_ns - m->up_ns > 2 * WAIT_MAX_NS)
        m->short_lives = 0;
    m->next_try_ns = now_ns + m->wait_ns;
    m->wait_ns = m->wait_ns * 2 > WAIT_MAX_NS ? WAIT_MAX_NS : m->wait_ns * 2;
    m->connecting = m->up = m->refused = false;
    m->in_flight = 0;
    lose_large(m);
    mqtt_topics_reset(m);
}

/* The broker has ended the connection, or there is none. A broker that does not know MQTT 5 may say so or just hang up.
 */
static void cut(struct mqtt *m, int err, const char *why)
{
    const bool hung_up = err == MOSQ_ERR_CONN_LOST || err == MOSQ_ERR_PROTOCOL;

    if (!m->up && hung_up && !m->refused) {
        m->version_311 = !m->version_311;
        if (m->version_311) {
            m->connecting = false; /* once more at once */
            return;
        }
    }
    if (m->up && hung_up && !m->large && !m->shared_id && ++m->short_lives >= SHORT_LIVES)
        avoid_other(m, "the broker keeps ending connections of");
    lost(m, why);
}

/* Of an error of the library's, directly after it. */
static const char *reason(int err)
{
    return err == MOSQ_ERR_ERRNO ? strerror(errno)
           : err == MOSQ_ERR_TLS
               ? "TLS failed: it has no TLS on this port, or a certificate that mqtt: ca_file does not vouch for"
               : mosquitto_strerror(err);
}

static void on_connect(struct mosquitto *client, void *arg, int code, int flags SST_UNUSED,
                       const mosquitto_property *properties)
{
    static const char *const topics[] = { "record/set", "focus/set", "snapshot/set", "available" };
    struct mqtt *m = arg;
    char topic[MQTT_TOPIC_MAX], why[160];
    uint32_t most = 0;

    if (m->stop)
        return;
    if (!m->version_311 && (code == MQTT_RC_UNSUPPORTED_PROTOCOL_VERSION || code == CONNACK_REFUSED_PROTOCOL_VERSION))
        return; /* the broker ends the connection after this */
    if (code) {
        m->refused = true;
        snprintf(why, sizeof(why), "%s Check mqtt: user and password_file",
                 m->version_311 ? mosquitto_connack_string(code) : mosquitto_reason_string(code));
        report_disconnected(m, why);
        return;
    }
    if (m->reported)
        sst_log_info("mqtt: connected to %s:%d", m->config->mqtt.host, m->config->mqtt.port);
    m->reported = false;
    m->up = true;
    m->up_ns = sst_clock_now_ns();
    (void)mosquitto_property_read_int32(properties, MQTT_PROP_MAXIMUM_PACKET_SIZE, &most, false);
    m->packet_max = most;
    mqtt_topics_begin(m);
    for (size_t i = 0; i < ARRAY_LEN(topics); i++) { /* "available" after "online": an answer */
        snprintf(topic, sizeof(topic), "%s/%s", m->config->mqtt.topic, topics[i]);
        (void)mosquitto_subscribe(client, NULL, topic, 1); /* a broken connection shows in the loop */
    }
}

/* The next loop finds the connection ended. */
static void on_disconnect(struct mosquitto *client SST_UNUSED, void *arg, int code,
                          const mosquitto_property *properties SST_UNUSED)
{
    struct mqtt *m = arg;

    if (code == MQTT_RC_SESSION_TAKEN_OVER && !m->stop && !m->shared_id)
        avoid_other(m, "somebody else connects with");
}

/* One id for each topic of this installation: a new connection replaces one that has died unnoticed, with its will. */
static void make_id(struct mqtt *m)
{
    char text[64] = "", host[64] = "";
    uint64_t hash = UINT64_C(14695981039346656037); /* FNV-1a */
    FILE *f = fopen("/etc/machine-id", "re");

    if (f && !fgets(text, sizeof(text), f))
        text[0] = 0;
    if (f)
        fclose(f);
    if (!text[0] && gethostname(host, sizeof(host) - 1))
        host[0] = 0;
    for (const char *part[] = { text, host, m->config->mqtt.topic, NULL }, **p = part; *p; p++)
        for (const char *c = *p; *c; c++)
            hash = (hash ^ (uint8_t)*c) * UINT64_C(1099511628211);
    if (m->shared_id)
        hash ^= (uint64_t)getpid() << 32 ^ (uint64_t)sst_clock_wall_ns();
    snprintf(m->id, sizeof(m->id), "sst%016llx", (unsigned long long)hash); /* letters and digits, 23 at most */
}

static int make_client(struct mqtt *m)
{
    char topic[MQTT_TOPIC_MAX];

    if (!m->id[0])
        make_id(m);
    m->client = mosquitto_new(m->id, true, m);
    if (!m->client)
        return -ENOMEM;
    snprintf(topic, sizeof(topic), "%s/available", m->config->mqtt.topic);
    mosquitto_connect_v5_callback_set(m->client, on_connect);
    mosquitto_disconnect_v5_callback_set(m->client, on_disconnect);
    mosquitto_publish_v5_callback_set(m->client, on_publish);
    mosquitto_message_callback_set(m->client, on_message);
    mosquitto_subscribe_callback_set(m->client, on_subscribe);
    return mosquitto_will_set(m->client, topic, 7, "offline", 1, true) ? -ENOMEM : 0;
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
    if (!err && !strncmp(out, "\xef\xbb\xbf", 3)) /* Windows' editors begin UTF-8 with it */
        memmove(out, out + 3, strlen(out + 3) + 1);
    if (f)
        fclose(f);
    return err;
}

static void try_connect(struct mqtt *m)
{
    const struct sst_config *c = m->config;
    char secret[SST_CONFIG_TEXT_MAX] = "", why[SST_CONFIG_TEXT_MAX + 80];
    int err;

    if (!m->id[0])
        drop_client(m);
    err = m->client ? 0 : make_client(m);
    if (!err && mosquitto_int_option(m->client, MOSQ_OPT_PROTOCOL_VERSION,
                                     m->version_311 ? MQTT_PROTOCOL_V311 : MQTT_PROTOCOL_V5))
        err = -EINVAL;
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

/* Remove the announcement under the old topics, and with `all` all that is retained. */
static void withdraw(struct mqtt *m, bool all)
{
    const int64_t end_ns = sst_clock_now_ns() + WITHDRAW_NS;
    bool done = false;

    mqtt_announce_withdraw(m, all);
    m->withdrawn = all;
    /* Until the broker has them: the connection may be closed next, and what it has not read is lost then. */
    while (!(done && !m->in_flight && !mosquitto_want_write(m->client)) && !m->stop && sst_clock_now_ns() < end_ns) {
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
    m->large = 0;
    if (!m->withdrawn && !mqtt_publish(m, "available", "offline", 7, MQTT_RETAIN))
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
    const bool gone = !next->mqtt.enabled || strcmp(before->mqtt.topic, next->mqtt.topic) != 0;

    if (m->up && (gone || strcmp(before->mqtt.discovery, next->mqtt.discovery) != 0))
        withdraw(m, gone);
    if (!same_connection(before, next)) {
        close_connection(m);
        m->id[0] = 0;
        m->shared_id = m->version_311 = false;
        m->short_lives = 0;
        m->withdrawn = false;
    }
    m->learned_max = 0;
    m->large_lost = 0;
    m->left_out = m->unaccepted = false;
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
        cut(m, err, reason(err));
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
