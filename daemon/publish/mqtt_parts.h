/* daemon/publish/mqtt_parts.h - inside mqtt: the connection, what is told, and the announcement for Home Assistant. */
#ifndef SST_DAEMON_PUBLISH_MQTT_PARTS_H
#define SST_DAEMON_PUBLISH_MQTT_PARTS_H

#include <pthread.h>

#include "daemon/publish/mqtt.h"

#define SST_MQTT_TOPIC_MAX 320
#define SST_MQTT_UNDER_WAY 32 /* messages that the broker has not taken yet; more are not handed over */

struct mosquitto;

/** A message that is told once after connecting. */
struct sst_mqtt_message {
    char *topic, *payload;
};

struct sst_mqtt {
    const struct sst_api *api; /* fixed after open */
    pthread_t thread;
    SST_ATOMIC(bool) stop;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    /* under lock */
    bool done, abandoned;
    struct sst_config *next; /* to be followed from now on, or NULL */
    struct sst_mqtt_counters n;
    /* thread only */
    struct sst_config *config;
    struct mosquitto *client; /* NULL: to be made */
    bool connecting, up;      /* the broker accepted us */
    bool told;                /* why there is no connection */
    int under_way;
    int64_t next_try_ns, wait_ns, up_ns;
    uint64_t seen;                          /* id of the last event told */
    bool unread_events;                     /* some that concern the state came: status and cameras are due */
    int64_t status_ns, picture_ns;          /* when they are due next */
    char camera_state[SST_CAMERAS_MAX][24]; /* as told */
    struct sst_mqtt_message *hello;         /* what is still to be told after connecting, in order */
    int hellos, hello_next;
    int cameras;               /* that are announced */
    bool asked;                /* for what is announced at the broker and should not be */
    struct sst_outlet *outlet; /* of the main view, or NULL */
    bool joined;
    uint64_t picture; /* number of the last one told */
};

/** Hand a message to the broker. @param topic  below mqtt.topic @return false: not taken; try again later */
bool sst_mqtt_tell(struct sst_mqtt *m, const char *topic, const void *payload, size_t bytes, int qos, bool retain);

/** The same with the whole topic. */
bool sst_mqtt_tell_at(struct sst_mqtt *m, const char *topic, const void *payload, size_t bytes, int qos, bool retain);

/** Have the broker tell what it holds below our place in Home Assistant's topics: sst_mqtt_found() gets it.
 *  @return false: not taken; try again later */
bool sst_mqtt_ask(struct sst_mqtt *m, const char *pattern);

/** May more be handed over? */
bool sst_mqtt_free(const struct sst_mqtt *m);

/* mqtt_topics.c */
void sst_mqtt_greet(struct sst_mqtt *m);  /* after connecting: what is due */
void sst_mqtt_due(struct sst_mqtt *m);    /* tell what is due */
void sst_mqtt_forget(struct sst_mqtt *m); /* the connection is gone */
/** Tell what is still to be told after connecting. @return true: all is told */
bool sst_mqtt_hello(struct sst_mqtt *m);
/** What is announced goes from the broker with the next calls of sst_mqtt_hello(). */
void sst_mqtt_withdraw(struct sst_mqtt *m);
/** An announcement that the broker holds: one that is none of ours any more goes. */
void sst_mqtt_found(struct sst_mqtt *m, const char *topic);
void sst_mqtt_command(struct sst_mqtt *m, const char *topic, const void *payload, size_t bytes, bool retained);
/** Short form of a status. NULL: no memory. */
json_t *sst_mqtt_short_status(const json_t *status);

/* mqtt_discovery.c */
/** The array's name as one word, within topics. */
void sst_mqtt_node(char out[128], const struct sst_config *config);
/** Announcement of everything, to free with sst_mqtt_messages_free(). @param cameras  answer of the API, or NULL
 *  @return number of messages, or -ENOMEM */
int sst_mqtt_announce(struct sst_mqtt_message **out, const struct sst_config *config, const json_t *cameras);
void sst_mqtt_messages_free(struct sst_mqtt_message *list, int n);

#endif
