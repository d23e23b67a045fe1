/* daemon/publish/publish_internal.h - private declarations of this folder; code outside of it includes the public
 * headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_PUBLISH_PUBLISH_INTERNAL_H
#define SST_DAEMON_PUBLISH_PUBLISH_INTERNAL_H

#if WITH_HTTPD
#include <microhttpd.h>
#endif
#include <netinet/in.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/socket.h>
#include <sys/types.h>

#include "base/base.h"
#include "base/brake.h"
#include "base/file.h"
#include "daemon/publish/http.h"
#include "daemon/publish/sessions_internal.h"

/* --- hooks_env: inside hooks: the environment that describes the event. --- */

/**
 * Environment for one event: ours without systemd's service variables, plus SST_....
 *
 * @param event  line of JSON, of sst_events_next()
 * @return ended by NULL; to free with hook_env_free(); NULL: no memory, or `event` is no such line
 */
char **hook_env(const char *event);
void hook_env_free(char **env);

/* --- http_internal: shared by the files of the HTTP server. --- */

struct MHD_Connection;
struct MHD_Daemon;
struct MHD_Response;

#define HTTP_HEADER_MAX   8192  /* bytes of a request's line and headers */
#define HTTP_BODY_MAX     65536 /* bytes of a request's body */
#define HTTP_NAME_MAX     128   /* characters of {a part} of a path */
#define HTTP_REQUEST_S    10    /* a request must have arrived this long after its connection */
#define HTTP_IDLE_S       10    /* a connection without a byte goes; sst_http_config.idle_s */
#define HTTP_KEEP_ALIVE_S 15    /* between signs of life on a silent event stream */
#define HTTP_WAIT_MS      200   /* longest wait in one piece: how fast stopping and a lost peer are noticed */

/* --- sockets (http_listen.c) -------------------------------------------------------------------------------------- */

/** A listening UNIX socket at `path`, and its identity, so that only this one is removed. */
struct http_unix {
    char path[108];
    dev_t dev;
    ino_t ino;
};

/** @param mode  of the socket; @param gid  its group, (gid_t)-1: as it comes. @return descriptor or negative errno */
SST_MUST_CHECK int http_listen_unix(struct http_unix *out, const char *path, mode_t mode, gid_t gid);
void http_unlink_unix(const struct http_unix *u);

/** @param open   an address that others can reach is fine
 *  @param quiet  failures are not logged
 *  @return descriptor or negative errno */
SST_MUST_CHECK int http_listen_tcp(const char *address, int port, bool open, bool quiet);
int http_socket_port(int fd);

/* --- pure parsing (http_parse.c) ---------------------------------------------------------------------------------- */

/** Does a path fit a pattern? @param name  out [HTTP_NAME_MAX + 1], the text in place of {name}; "" without one */
bool http_path_matches(const char *pattern, const char *path, char *name);

/** Split "host", "host:port", "[v6]:port". @param host  out [256], in small letters, without brackets and final dot
 *  @param port  out, -1: none @return false: malformed */
bool http_host_split(const char *text, char *host, int *port);

/** Host of "http://host:port/path". @param host  out [256] @return false: malformed */
bool http_url_host(const char *url, char *host);

#define HTTP_AUTHORITY 300
/** Path of a target, which may be in absolute form: "http://host:port/path". @param authority  out, "" without one */
const char *http_target_path(const char *target, char authority[HTTP_AUTHORITY]);

/** Is an Origin ("http://host:port") where a request with this Host goes? */
bool http_same_origin(const char *origin, const char *host);

/** The field `token` of a form. @param out  [HTTP_TOKEN_MAX + 1] @return false: there is none or it is no token */
bool http_form_token(const char *body, size_t size, char *out);

/** Is `etag` named in If-None-Match? */
bool http_etag_matches(const char *if_none_match, const char *etag);

enum http_range {
    HTTP_RANGE_WHOLE = 0, /* no range requested, or one to ignore: several, another unit, malformed */
    HTTP_RANGE_PART = 1,
    HTTP_RANGE_BEYOND = 2, /* no byte of it exists: 416 */
};

/** Evaluate a Range header (RFC 9110, 14.2) for `size` bytes; NULL: no header. @param first, bytes  out with PART */
enum http_range http_range_parse(const char *range, uint64_t size, uint64_t *first, uint64_t *bytes);

/** Does If-Range allow the Range? Only with exactly this strong etag. */
bool http_if_range(const char *if_range, const char *etag);

/** Is `type` (without parameters) the media type of a Content-Type? */
bool http_is_type(const char *content_type, const char *type);

/** A whole decimal number. @param max  9 or more @return false: not one, or above max */
bool http_number(const char *text, uint64_t max, uint64_t *out);

/* --- WebSocket frames (http_frames.c) ----------------------------------------------------------------------------- */

enum http_ws_op {
    HTTP_WS_CONTINUATION = 0,
    HTTP_WS_TEXT = 1,
    HTTP_WS_BINARY = 2,
    HTTP_WS_CLOSE = 8,
    HTTP_WS_PING = 9,
    HTTP_WS_PONG = 10,
};

/** Codes of closing. 4000 and more: an HTTP status above 4000. */
enum http_ws_code {
    HTTP_WS_GONE = 1001, /* the service ends, or the picture */
    HTTP_WS_PROTOCOL = 1002,
    HTTP_WS_UNSUPPORTED = 1003, /* binary */
    HTTP_WS_INVALID = 1007,     /* text that is not UTF-8 */
    HTTP_WS_POLICY = 1008,      /* a message other than "key", or too many messages */
    HTTP_WS_TOO_BIG = 1009,
    HTTP_WS_STATUS = 4000,
};

#define HTTP_WS_MAX  125 /* bytes of a client's message */
#define HTTP_WS_HEAD 10

struct http_ws_reader { /* zeroed at the beginning */
    uint8_t frame[6 + HTTP_WS_MAX];
    size_t have; /* bytes of frame */
    uint8_t text[HTTP_WS_MAX];
    size_t text_bytes;
    bool begun; /* a message in several frames */
};

struct http_ws_message { /* text, ping, pong or close; valid until the next call */
    int op;
    const uint8_t *data;
    size_t bytes;
};

/** Parse up to the end of one message. @param used  out, bytes of `data`
 *  @return 1: a message; 0: all are used; else minus the code to close with: no more calls then */
int http_ws_read(struct http_ws_reader *r, const uint8_t *data, size_t bytes, size_t *used, struct http_ws_message *out);

/** Head of a whole message from us. @return its bytes */
size_t http_ws_head(uint8_t out[HTTP_WS_HEAD], enum http_ws_op op, size_t bytes);

/* --- certificate and key (http_tls.c) ----------------------------------------------------------------------------- */

struct http_pair; /* counted; a connection keeps its pair as long as it lives */

struct http_tls {
    struct sst_counters *count; /* fixed after init */
    pthread_mutex_t reading;    /* held while files are read; then lock */
    /* under reading */
    char path[2][SST_PATH_MAX];  /* certificate, key */
    struct http_stamp stamp[2];  /* when they were read */
    struct http_stamp seen[2];   /* at the last check */
    int warned;                  /* expiry reported: 1 near, 2 past; 0: none */
    SST_ATOMIC(int64_t) look_ns; /* time of the next check */
    /* under lock */
    pthread_mutex_t lock;
    struct http_pair *pair; /* of new connections; NULL: no TLS. Changes under both */
};

void http_tls_init(struct http_tls *t, struct sst_counters *count);
void http_tls_fini(struct http_tls *t);

/** Read the first pair. @return 0, -ENOTSUP, -EINVAL and errors of sst_file_read(); logged */
SST_MUST_CHECK int http_tls_open(struct http_tls *t, const struct sst_http_config *cfg);

/** A reference to the newest pair, for starting the library; released by http_tls_end(). @return NULL: no TLS */
struct http_pair *http_tls_take(struct http_tls *t);
/** PEM text of the pair, not const because the library's interface lacks it. @return NULL if p is NULL */
void *http_tls_pem(const struct http_pair *p, bool key);

/** Use the newest pair for a new connection. @return a reference to release when the connection ends; may be NULL */
struct http_pair *http_tls_begin(struct http_tls *t, struct MHD_Connection *connection);
void http_tls_end(struct http_tls *t, struct http_pair *p);

/** Check every 20 s for changed files and a near expiry; report them as events. */
void http_tls_look(struct http_tls *t, struct sst_events *events, int64_t now_ns);

/* --- the server --------------------------------------------------------------------------------------------------- */

struct http_listener { /* the UNIX socket or TCP */
    struct sst_http *http;
    bool local;
    struct MHD_Daemon *daemon; /* fixed after open */
    SST_ATOMIC(int) clients;
};

struct http_connection { /* one connection; under sst_http.lock, deadline_ns by its own thread too */
    struct http_connection *next, **prev;
    int fd;
    struct http_pair *pair;          /* of TLS, or NULL */
    SST_ATOMIC(int64_t) deadline_ns; /* the request must be complete by then; INT64_MAX: it is complete */
    /* its own thread: where the path of the request was read, and its length there */
    uintptr_t uri_at;
    size_t uri_bytes;
};

struct http_videos { /* http_video.c */
    pthread_mutex_t lock;
    pthread_cond_t ended;
    /* under lock */
    struct http_video *first;
    int threads; /* of encoders and of viewers over WebSocket */
    bool closed; /* no more threads start */
};

struct http_health { /* the last answer of /healthz */
    pthread_mutex_t lock;
    /* under lock */
    int64_t until_ns; /* it is asked for again */
    bool ok;
    char text[80];
};

struct sst_http {
    /* fixed after open */
    struct sst_http_config cfg; /* numbers and api; its strings are valid during open only */
    struct sst_counters *count;
    char host[256], url_host[256], address[64];
    bool tls;
    struct http_unix unix_socket;
    struct http_listener tcp, local;
    struct http_auth auth;
    struct http_tls pairs;
    struct http_proxies proxies;
    struct http_audit audit;
    struct http_health health;
    struct http_videos videos;
    pthread_t reaper;
    bool reaping;
    /* under lock */
    pthread_mutex_t lock;
    pthread_cond_t wake;
    struct http_connection *links;
    int64_t flood_ns; /* when too many connections were last reported */
    int64_t again_ns; /* reaper thread only: when the address is tried again */
    /* atomic */
    SST_ATOMIC(bool) stopping;
    SST_ATOMIC(int) port;
    SST_ATOMIC(int) away; /* errno of an address that cannot be bound yet; 0: it is bound */
};

#define HTTP_COOKIE 32
/** Name of the cookie that holds the secret of a session. Cookies are shared by all ports of a host, so the port is in
 * it. */
void http_cookie(const struct sst_http *http, char out[HTTP_COOKIE]);

/** One request, on its connection's thread. */
struct http_request {
    struct sst_http *http;
    struct http_listener *listener;
    struct MHD_Connection *connection;
    struct http_connection *link;
    const struct sst_route *route;
    int index; /* of the route */
    int fd;
    bool local;   /* over the UNIX socket */
    bool replay;  /* below /replay: about the recording that is played */
    void *live;   /* argument of the verbs about pictures, while the request is handled */
    bool head;    /* method HEAD: the answer is sent without its body */
    bool hang_up; /* the connection ends after the answer */
    enum sst_role role;
    unsigned rights;                     /* enum sst_right */
    char authority[HTTP_AUTHORITY];      /* of a target in absolute form, in place of Host; "": none */
    char user[64];                       /* name of its token, or of a proxy's user; "": none */
    char name[HTTP_NAME_MAX + 1];        /* {a part} of the path */
    char who[96];                        /* the client, for messages */
    char session[HTTP_SESSION_NAME + 1]; /* session of its cookie, or id of its named token; "": none */
    char allow[24];                      /* answer 405: methods */
    int retry_s;                         /* answer 429: seconds until a retry */
    int silence_s;                       /* the answer ends when the client has read nothing for that long */
    char *data;                          /* body, with a NUL after it */
    size_t size, capacity;
    bool too_large;
    json_t *body; /* of POST with JSON: an object */
    struct http_watch *watch; /* viewer over WebSocket, until its thread has it; NULL: none */
    bool upgraded;            /* its thread has the connection */
};

typedef int http_handler_fn(struct http_request *q); /* queues an answer; MHD_YES or MHD_NO */

/** Check route, role and form of a request. @return -1: accepted; else an answer is queued */
int http_check(struct http_request *q, const char *path, const char *method, const char *version);

/** Is it a request of a page of another origin, which must not act through the browser of its reader? */
bool http_is_foreign(struct http_request *q);

/** True for pictures: their token may also be in the query or a password, which allow reading only. */
bool http_is_picture(const struct sst_route *route);

/** Text of an address, "unknown" without one. */
void http_name_address(const struct sockaddr *address, char *out, size_t size);
/** Fill in q->who from the address. */
void http_name_peer(struct http_request *q);

/** True above the limit of connections; reported as an event at intervals. */
bool http_crowded(struct http_request *q);

#if WITH_HTTPD
/* Callbacks of microhttpd (http_request.c); cls is a struct http_listener. */
enum MHD_Result http_on_request(void *cls, struct MHD_Connection *connection, const char *path, const char *method,
                                const char *version, const char *data, size_t *size, void **state);
void *http_on_uri(void *cls, const char *uri, struct MHD_Connection *connection);
void http_on_done(void *cls, struct MHD_Connection *connection, void **state, enum MHD_RequestTerminationCode how);
void http_on_connection(void *cls, struct MHD_Connection *connection, void **state,
                        enum MHD_ConnectionNotificationCode how);
#endif

/** Handler of a route; index as in sst_http_routes(). */
http_handler_fn *http_handler(int index);

const char *http_query(struct http_request *q, const char *name);  /* NULL: not there; "" without a value */
const char *http_header(struct http_request *q, const char *name); /* the same */

/* Answers (http_reply.c). Each adds the common headers and releases its arguments; MHD_YES or MHD_NO. */
int http_reply(struct http_request *q, int status, struct MHD_Response *response);
int http_reply_text(struct http_request *q, int status, const char *type, char *text);
int http_reply_error(struct http_request *q, int status, const char *fmt, ...) SST_PRINTF(3, 4);
/** The result of a call of the API; releases `out`. @param what  for errors without a sentence */
int http_reply_answer(struct http_request *q, int err, struct sst_api_answer *out, const char *what);
/** HTTP status of an error of the API. */
int http_status_of(int err);
/** A header of an answer. */
void http_set(struct MHD_Response *response, const char *name, const char *fmt, ...) SST_PRINTF(3, 4);

int http_do_stream(struct http_request *q, enum sst_api_picture kind, const char *name);   /* http_stream.c */
int http_do_snapshot(struct http_request *q, enum sst_api_picture kind, const char *name); /* http_stream.c */
int http_do_watch(struct http_request *q, enum sst_api_picture kind, const char *name);    /* http_watch.c */
int http_do_download(struct http_request *q);                                              /* http_download.c */
int http_do_events(struct http_request *q);                                                /* http_events.c */
int http_do_visits(struct http_request *q);
int http_do_visit_days(struct http_request *q);
int http_do_visit_picture(struct http_request *q, enum sst_visit_picture kind);
int http_do_listen(struct http_request *q);
int http_do_web(struct http_request *q, const char *file, bool redirect); /* http_web.c */
int http_do_login_form(struct http_request *q);
int http_do_login(struct http_request *q);
int http_do_logout(struct http_request *q);

#define HTTP_STREAMS_FULL "%d moving pictures are being watched already; close one, or raise web.streams"
/** A place among the moving pictures that are watched. @return false: there is none; counted as refused */
bool http_stream_begin(struct http_request *q);
/** The slot of a picture. @param answer  out, the error @return 0 or negative errno */
SST_MUST_CHECK int http_find_slot(struct http_request *q, enum sst_api_picture kind, const char *name,
                                  struct sst_slot **out, struct sst_api_answer *answer);

/* --- H.264 of pictures (http_video.c), and its viewers over WebSocket (http_watch.c) ------------------------------- */

struct http_video; /* of one slot, for all viewers */

/** One encoded picture; counted, read-only. */
struct http_unit {
    SST_ATOMIC(int) refs;
    bool key;
    uint64_t number; /* 1, 2, ... of its video */
    uint64_t set;
    int64_t wall_ns;
    int width, height;
    char codec[16], encoder[16];
    size_t bytes;
    uint8_t data[];
};

struct http_watcher {
    struct http_watcher *next;
    int wake; /* eventfd, written to with each unit and at the end */
};

void http_videos_init(struct http_videos *all);
void http_videos_fini(struct http_videos *all);
/** Wait for the end of all threads; viewers end when the server stops. */
void http_videos_await(struct http_videos *all);
/** Start a detached thread that calls http_thread_ended() last. @return 0, -ECANCELED, -EAGAIN */
SST_MUST_CHECK int http_thread_start(struct http_videos *all, void *(*body)(void *), void *arg);
void http_thread_ended(struct http_videos *all);

/** Watch the video of a slot; the first viewer starts its encoder, the last one ends it. @return NULL: no memory */
struct http_video *http_video_join(struct sst_http *http, struct sst_slot *slot, struct http_watcher *w);
void http_video_leave(struct http_video *v, struct http_watcher *w); /* NULL is fine */

/** The unit after number `after` (0: of a new viewer). @param key  in, only a key picture will do; out, that one is
 *  awaited, as the viewer has fallen behind @return a reference; NULL: not yet */
const struct http_unit *http_video_next(struct http_video *v, uint64_t after, bool *key);
void http_unit_unref(const struct http_unit *unit); /* NULL is fine */

/** Has encoding ended? @param why  out, one sentence */
bool http_video_over(struct http_video *v, char why[256]);

/** Release a viewer without a thread. NULL is fine. */
void http_watch_drop(struct http_watch *w);

int http_do_audit(struct http_request *q); /* http_access.c */
int http_do_tokens(struct http_request *q);
int http_do_token_add(struct http_request *q);
int http_do_token_change(struct http_request *q);

/** Count a wrong token of this client. @return status to refuse the request with; 0: none */
int http_wrong_token(struct http_request *q, int *retry_s);

/** Begin the silence of a client now: the library counts the time that a callback or handler waits, too, and would
 * close the connection before it sends the answer. */
void http_awake(struct MHD_Connection *connection, int silence_s);

/** Has the peer of a connection gone? */
bool http_peer_gone(int fd);

/* --- the page's files (made by the Makefile of daemon/web) -------------------------------------------------------- */

struct web_file {
    const char *name;
    const uint8_t *data, *end;
};
extern const struct web_file web_files[]; /* up to one without a name */

#endif
