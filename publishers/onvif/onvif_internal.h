/* publishers/onvif/onvif_internal.h - parts of sst-onvif: SOAP, authentication, answers, events, discovery, and the HTTP
 * server. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PUBLISHERS_ONVIF_ONVIF_INTERNAL_H
#define SST_PUBLISHERS_ONVIF_ONVIF_INTERNAL_H

#include <jansson.h>
#include <netinet/in.h>
#include <stdatomic.h>
#include <stdio.h>

#include "publishers/login.h"
#include "publishers/server.h"

#define ONVIF_BODY_MAX     65536 /* bytes of a request */
#define ONVIF_HOST         300   /* characters of a host in an address, brackets of IPv6 included */
#define ONVIF_UUID         37    /* bytes, with the NUL */
#define ONVIF_CLOCK_S      300   /* by which the clock of a client may differ */
#define ONVIF_EVENTS_PATH  "/onvif/events/"
#define ONVIF_SUBSCRIPTION 17    /* bytes of the name of a subscription, with the NUL */

/* --- soap.c: XML of requests, bounded in depth and size; envelopes ------------------------------------------------ */

#define SOAP_NODES 256
#define SOAP_DEPTH 16

/** Namespaces by which calls and their parts are found. */
enum soap_ns {
    SOAP_NS_OTHER = 0,
    SOAP_NS_ENVELOPE = 1, /* SOAP 1.2, 1.1 */
    SOAP_NS_DEVICE = 2,
    SOAP_NS_MEDIA = 3,
    SOAP_NS_MEDIA2 = 4,
    SOAP_NS_EVENTS = 5, /* of ONVIF, and WS-BaseNotification */
    SOAP_NS_DISCOVERY = 6,
    SOAP_NS_ADDRESSING = 7,
    SOAP_NS_SECURITY = 8,
};

struct soap_node {
    enum soap_ns ns;
    const char *name, *text; /* without prefix; without the text of children */
    const char *type;        /* attribute Type; NULL: none */
    int parent, child, next; /* -1: none */
};

/** A request. */
struct soap {
    int nodes, header, call; /* the header; the first child of the body; -1: none */
    struct soap_node node[SOAP_NODES];
    char *arena; /* its texts */
    size_t used, room;
};

/** @return 0, -EBADMSG (no XML, no envelope, no call, a document type), -E2BIG (too deep, too many elements), -ENOMEM;
 *  soap_free() in each case */
SST_MUST_CHECK int soap_parse(struct soap *s, const void *data, size_t bytes);
void soap_free(struct soap *s);
/** Child of an element by its name. @param at  -1: none @return -1: none */
int soap_child(const struct soap *s, int at, const char *name);
/** Text of a child, without spaces around it. @param at  -1: none @return NULL: none */
const char *soap_text(const struct soap *s, int at, const char *name);

/** A refusal of a call. */
struct soap_fault {
    int status; /* of HTTP: 400 of the sender, 401, 500 of the receiver */
    const char *code, *detail, *reason; /* detail: code within the code, or NULL */
};

/** Write a text with the characters of XML replaced. */
void soap_put(FILE *out, const char *text);
/** Begin an answer. @param s  the request: its message is named if it names itself; NULL: none */
void soap_begin(FILE *out, const struct soap *s);
void soap_end(FILE *out);
/** Write a whole answer that is a refusal. */
void soap_refuse(FILE *out, const struct soap *s, const struct soap_fault *fault);

/* --- values.c: times of XML Schema, Base64 ------------------------------------------------------------------------ */

/** xs:dateTime; without a zone UTC. @return false: it is none */
bool value_time(const char *text, int64_t *wall_ns);
/** xs:duration; a year has 365 days, a month 30. @return false: it is none, or longer than a century */
bool value_duration(const char *text, int64_t *ns);
/** @return bytes; -1: no Base64, or more than room */
int value_base64(const char *text, uint8_t *out, int room);
void value_to_base64(char *out, const uint8_t *data, int bytes);

/* --- auth.c: Digest of HTTP and WS-UsernameToken ------------------------------------------------------------------ */

#define AUTH_TOKENS 4096

/** The newest proofs of the password that were used, so that none is accepted twice. */
struct auth {
    struct sst_login *login; /* fixed */
    char ha1[33];            /* fixed */
    pthread_mutex_t lock;
    /* under lock */
    uint8_t used[AUTH_TOKENS][16]; /* hashes */
    int next;
    int64_t clock_logged_ns;
};

/** A request that may have the right to an answer. */
struct auth_request {
    struct sst_login_client client;
    const char *method, *path;
    const char *authorization; /* header; NULL: none */
    const struct soap *soap;   /* NULL: none */
};

void auth_init(struct auth *a, struct sst_login *login);
/** @param wall_ns  now */
enum sst_login_verdict auth_judge(struct auth *a, const struct auth_request *r, int64_t wall_ns);

/* --- picture.c: picture of the main view -------------------------------------------------------------------------- */

/** Newest picture, at most half a second old. @param data  out, to free with free() @return 0, or as
 *  sst_client_bytes() */
SST_MUST_CHECK int picture_get(uint8_t **data, size_t *bytes);
/** Size of the pictures, as the service sends them; before it does, of the cameras. */
void picture_size(int *width, int *height, size_t *bytes);
/** The service is there, perhaps another one, or has gone. */
void picture_connected(bool connected);
void picture_init(struct sst_server *server);
/** Thread that asks for a picture until its size is known. @param server  struct sst_server */
void *picture_run(void *server);

/* --- answers.c: calls and their answers --------------------------------------------------------------------------- */

/** A call: its request, and values of its answer. */
struct onvif_call {
    const struct soap *soap;
    const char *path;
    char local[INET6_ADDRSTRLEN]; /* address at which the client has reached this machine */
    char host[ONVIF_HOST];        /* that addresses in the answer name */
    int port;                     /* of this program, in addresses */
    /* by the handler of a call */
    char interface[16], mac[18];
    int prefix;
    int64_t now_ns, until_ns; /* wall clock; end of a subscription */
    char subscription[ONVIF_SUBSCRIPTION];
    char *messages;
};

/** Fixed after answers_init(). */
struct onvif_device {
    const struct sst_config *config;
    char uuid[ONVIF_UUID], serial[13], hostname[64];
    const char *user; /* "": no password is required */
};

/** @return 0, -EINVAL (the table of answers is at fault) */
SST_MUST_CHECK int answers_init(const struct sst_config *config, const char *user);
const struct onvif_device *answers_device(void);
/** May everybody ask this? Also true where it is no call. */
bool answers_is_open(const struct soap *s);
/** Write the body of the answer. @return NULL, or the refusal: out is then to be thrown away */
const struct soap_fault *answers_call(FILE *out, struct onvif_call *call);
/** Write the scopes, separated by spaces. */
void answers_scopes(FILE *out);

/* --- events.c: events of the service as ONVIF's, and subscriptions ------------------------------------------------ */

void events_init(struct sst_server *server);
/** Follow the zones of the service. @param zones  answer of /api/v1/zones */
void events_zones(const json_t *zones);
/** The service has gone: nothing moves. */
void events_disconnected(void);
void events_on_event(const json_t *event);
/** End pulls that wait. */
void events_stop(void);
/** Handlers of calls. */
const struct soap_fault *events_create(struct onvif_call *call);
const struct soap_fault *events_pull(struct onvif_call *call);
const struct soap_fault *events_renew(struct onvif_call *call);
const struct soap_fault *events_unsubscribe(struct onvif_call *call);
const struct soap_fault *events_synchronize(struct onvif_call *call);

/* --- discovery.c: WS-Discovery ------------------------------------------------------------------------------------ */

/** Answer to a datagram. @param host  that it names @return false: none is due. Thread: any */
bool discovery_answer(FILE *out, const void *data, size_t bytes, const char *host);
/** Greet, answer, say goodbye, until the server is to stop. */
void discovery_run(const struct sst_server *server);

/* --- http.c ------------------------------------------------------------------------------------------------------- */

/** Serve on a listening socket, which is owned from then on. @return 0, -EIO; logged */
SST_MUST_CHECK int http_start(struct sst_server *server, struct sst_login *login, int fd);
/** The port that it listens on; 0: none yet. Thread: any */
int http_port(void);
/** Hang up on all clients. */
void http_stop(void);
/** Address with the brackets of IPv6, or onvif.host. */
void http_host(char out[ONVIF_HOST], const char *local);

#endif
