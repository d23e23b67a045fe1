/* publishers/mqtt/mqtt_internal.h - parts of sst-mqtt: the service, the broker, topics, Home Assistant's discovery. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PUBLISHERS_MQTT_MQTT_INTERNAL_H
#define SST_PUBLISHERS_MQTT_MQTT_INTERNAL_H

#include <pthread.h>

#include "publishers/publisher.h"

/* Topics below mqtt.topic (docs/integrate/mqtt.md):
 * - available: online, offline (also by last will); retained; an offline that others publish is corrected
 * - status: short JSON, each 10 s and when something changes; retained
 * - camera/rRcC/state: as GET /api/v1/cameras has it; retained
 * - event/TYPE: events as they come, also the ones of a time without connection that are still kept
 * - zone/NAME/motion: ON, OFF; retained
 * - visit, zone/NAME/visit: data of the last visit event; retained
 * - visit/picture, zone/NAME/picture: its JPEG; retained
 * - visit/trigger, zone/NAME/trigger: came, gone
 * - visit/event, zone/NAME/event: JSON with event_type
 * - zone/NAME/visited, zone/NAME/label/LABEL: ON, OFF; retained
 * - picture: JPEG of the main view; retained
 * - record, record/set: ON, OFF
 * - focus, focus/set: px, or auto
 * - snapshot/set: ON */

#define MQTT_TOPIC_MAX     320
#define MQTT_IN_FLIGHT_MAX 32   /* messages that the broker has not acknowledged; no more are sent */
#define MQTT_EVENTS_MAX    1000 /* that wait for the broker; the oldest are dropped */

#define MQTT_VISITS_MAX    32  /* at a time; the service has no more tracks */
#define MQTT_LATER_MAX     512 /* messages of visits that wait */
#define MQTT_WANTED_MAX    8   /* pictures of visits that wait */
#define MQTT_VISIT_LETTERS "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"

struct mosquitto;

/** A present visitor. */
struct mqtt_visit {
    char name[64], label[32]; /* name "": none */
    uint32_t zones;           /* that it has been in, by their index */
};

/** A message below mqtt.topic that waits. */
struct mqtt_later {
    char *topic, *payload;
    bool retain;
};

/** A picture that is to be fetched. */
struct mqtt_wanted {
    char visit[64];
    uint32_t zones;
};

/** A retained message of the announcement. */
struct mqtt_message {
    char *topic, *payload;
    bool late; /* after Home Assistant had time for the ones before */
};

struct mqtt {
    /* fixed after begin */
    struct sst_publisher publisher;
    int wake;              /* eventfd: something for the main thread */
    SST_ATOMIC(bool) stop; /* by a signal */
    pthread_mutex_t lock;
    /* under lock */
    bool service_up;              /* the broker is connected only while it is */
    bool reload;                  /* the configuration may have changed */
    char *event[MQTT_EVENTS_MAX]; /* lines of JSON, a ring */
    int first_event, events;
    pthread_cond_t picture_wanted; /* for the thread that gets pictures */
    bool picture_asked, picture_ready;
    char picture_of[64]; /* visit; "": the main view */
    uint8_t *picture;    /* with picture_ready; NULL: there is none */
    size_t picture_bytes;
    /* main thread */
    struct sst_config *config;
    struct mosquitto *client; /* NULL: to be made */
    bool connecting, up;      /* up: the broker accepted the connection */
    bool reported;            /* why there is no connection */
    int in_flight;
    int64_t next_try_ns, wait_ns, up_ns;
    char id[40];                            /* of the client at the broker; "": to be made */
    bool shared_id;                         /* another program uses ours: from now on one that nobody else has */
    int short_lives;                        /* connections in a row that others ended soon */
    bool refused, version_311;              /* answers of the broker on this connection; the next one's protocol */
    size_t packet_max, learned_max;         /* bytes, 0: no limit; of this connection, of others that ended */
    size_t large;                           /* bytes of a large message that is not acknowledged; 0: none */
    int large_id, large_lost;               /* its, and connections in a row that ended with one */
    bool left_out, unaccepted;              /* was logged */
    bool online_due;                        /* to be published */
    int64_t online_ns;                      /* when it was last */
    bool state_changed;                     /* by an event: status and cameras are due */
    int64_t status_ns, picture_ns;          /* when they are due next */
    char camera_state[SST_CAMERAS_MAX][24]; /* as published */
    json_t *device;                         /* announcement; NULL: none */
    json_t *stale;                          /* {id: component} that the broker's announcement has beyond it */
    json_t *old;                            /* {topic: component}: announcements of single entities */
    struct mqtt_message *announcement;      /* to be sent, in order */
    int announcements, announced;
    int cameras;                            /* that are announced */
    bool asked;                             /* for retained announcements */
    int ask_id;                             /* of the subscription to them */
    int64_t announce_ns, late_ns;           /* when the list is made, when its late messages are due; INT64_MAX: not */
    bool withdrawn;                         /* nothing of this topic is left at the broker */
    struct mqtt_visit visit[MQTT_VISITS_MAX];
    struct mqtt_later later[MQTT_LATER_MAX]; /* a ring */
    int first_later, laters;
    struct mqtt_wanted wanted[MQTT_WANTED_MAX];
    int wanteds;
};

/* --- main.c: the service ------------------------------------------------------------------------------------------ */

/** The oldest event that waits, to free with free(); NULL: none. */
char *mqtt_next_event(struct mqtt *m);
/** Put it back: the broker did not accept it. */
void mqtt_return_event(struct mqtt *m, char *line);
/** Ask for a picture, or fetch it. @param visit  "": of the main view @return true: *data is one, to free with free(),
 * or NULL: the service has none */
bool mqtt_fetch_picture(struct mqtt *m, const char *visit, uint8_t **data, size_t *bytes);

/* --- connection.c: the broker ------------------------------------------------------------------------------------- */

void mqtt_init(struct mqtt *m);
/** Publish "offline", disconnect and free. */
void mqtt_fini(struct mqtt *m);
/** Do all due work, for 100 ms at most. @param wanted  a connection @return false: nothing to do for now */
bool mqtt_step(struct mqtt *m, bool wanted);
/** Follow another configuration, which it owns from then on. */
void mqtt_configure(struct mqtt *m, struct sst_config *next);

/** How a message is published: flags. */
enum mqtt_how {
    MQTT_RETAIN = 1,
    MQTT_SURE = 2, /* the broker acknowledges it */
};

/** Publish a message. @param topic  below mqtt.topic @param how  flags of enum mqtt_how @return false: not accepted; try again later */
bool mqtt_publish(struct mqtt *m, const char *topic, const void *payload, size_t bytes, unsigned how);
/** Publish a message by its whole topic, as mqtt_publish(). */
bool mqtt_publish_at(struct mqtt *m, const char *topic, const void *payload, size_t bytes, unsigned how);
/** Subscribe. @param id  out, for mqtt_on_subscribed() @return false: try again later */
bool mqtt_subscribe(struct mqtt *m, const char *pattern, int *id);

/* --- topics.c ----------------------------------------------------------------------------------------------------- */

void mqtt_topics_begin(struct mqtt *m); /* after connecting, or with another configuration */
void mqtt_topics_step(struct mqtt *m);  /* publish all that is due */
void mqtt_topics_reset(struct mqtt *m); /* the connection is gone */
void mqtt_on_command(struct mqtt *m, const char *topic, const void *payload, size_t bytes, bool retained);

/* --- visits.c ----------------------------------------------------------------------------------------------------- */

/** Labels of visits that have sensors in zones that name none. */
extern const char *const mqtt_labels[];
extern const int mqtt_labels_count;
/** Labels that have a sensor in a zone. @param out  [SST_ZONE_LABELS] @return their number */
int mqtt_zone_labels(const struct sst_zone *zone, const char **out);
/** Publish the visitors in the zones: after connecting, and with other zones. */
void mqtt_visits_begin(struct mqtt *m);
/** An event's data. */
void mqtt_on_visit(struct mqtt *m, const json_t *data);
/** Publish that a visit crossed a line. */
void mqtt_on_line(struct mqtt *m, const json_t *data);
/** Send messages that wait. @return true: none waits any more */
bool mqtt_visits_step(struct mqtt *m);
/** Fetch and send a picture of a visit. @return false: none is wanted */
bool mqtt_visits_picture(struct mqtt *m);

/* --- announce.c --------------------------------------------------------------------------------------------------- */

/** Announce the device: what the broker has of it is asked for first. */
void mqtt_announce_begin(struct mqtt *m);
/** The cameras may be others. @param cameras  answer of the API */
void mqtt_announce_cameras(struct mqtt *m, const json_t *cameras);
/** Send what is due. @return true: all is sent but what must wait */
bool mqtt_announce_step(struct mqtt *m);
/** Have the next calls of mqtt_announce_step() remove the announcement. @param all  and all retained messages */
void mqtt_announce_withdraw(struct mqtt *m, bool all);
/** The broker has answered a subscription. */
void mqtt_on_subscribed(struct mqtt *m, int id);
/** A retained message of the broker: of an announcement of this array it finds what is stale. */
void mqtt_on_announced(struct mqtt *m, const char *topic, const void *payload, size_t bytes);
void mqtt_announce_reset(struct mqtt *m);

/* --- discovery.c -------------------------------------------------------------------------------------------------- */

/** The array's name as one word, within topics. */
void mqtt_node(char out[128], const struct sst_config *config);
/** Announcement of the device with all its entities. @param cameras  answer of the API, or NULL @return NULL: no memory
 */
json_t *mqtt_device(const struct sst_config *config, const json_t *cameras);
void mqtt_messages_free(struct mqtt_message *list, int n);

#endif
