/* HTTP server: calls by POST, the picture by GET, access. A thread for each connection: one that waits for events, or
 * for its turn, delays no other. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <arpa/inet.h>
#include <errno.h>
#include <microhttpd.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "publishers/onvif/onvif_internal.h"

#define CONNECTIONS_MAX 64
#define ADDRESS_MAX     24 /* of one address */
#define IDLE_S          10
#define POOL_BYTES      16384
#define STACK_BYTES     (512 * 1024)

/** A request on its way. */
struct request {
    char *body;
    size_t bytes;
    bool large; /* more than is looked at */
};

static struct {
    /* fixed after start */
    struct sst_server *server;
    struct sst_login *login;
    struct MHD_Daemon *daemon;
    struct auth auth;
    atomic_int port;
} http;

static const struct soap_fault not_authorized = { 401, "ter:NotAuthorized", NULL,
                                                  "User and password are needed, and a clock that is right" };
static const struct soap_fault malformed = { 400, "ter:WellFormed", NULL, "This is no SOAP message" };
static const struct soap_fault too_large = { 400, "ter:WellFormed", NULL,
                                             "The message is too large, too deep, or has too many elements" };
static const struct soap_fault no_memory = { 500, "ter:OutofMemory", NULL, "There is no memory" };

int http_port(void)
{
    return atomic_load(&http.port);
}

void http_host(char out[ONVIF_HOST], const char *local)
{
    const char *named = http.server ? http.server->config.onvif.host : "";
    const char *host = named[0] ? named : local;
    const bool six = strchr(host, ':') != NULL && host[0] != '[';

    snprintf(out, ONVIF_HOST, "%s%s%s", six ? "[" : "", host, six ? "]" : "");
}

/* --- clients ------------------------------------------------------------------------------------------------------ */

/* A numeric address, of IPv4 also where the socket is of IPv6. */
static void write_address(char out[INET6_ADDRSTRLEN], const struct sockaddr *a)
{
    const struct sockaddr_in6 *six = (const void *)a;

    out[0] = 0;
    if (a->sa_family == AF_INET)
        (void)inet_ntop(AF_INET, &((const struct sockaddr_in *)(const void *)a)->sin_addr, out, INET6_ADDRSTRLEN);
    else if (a->sa_family == AF_INET6 && IN6_IS_ADDR_V4MAPPED(&six->sin6_addr))
        (void)inet_ntop(AF_INET, six->sin6_addr.s6_addr + 12, out, INET6_ADDRSTRLEN);
    else if (a->sa_family == AF_INET6)
        (void)inet_ntop(AF_INET6, &six->sin6_addr, out, INET6_ADDRSTRLEN);
}

static const struct sockaddr *peer_of(struct MHD_Connection *connection)
{
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);

    return info->client_addr;
}

static void find_local(char out[INET6_ADDRSTRLEN], struct MHD_Connection *connection)
{
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
    struct sockaddr_storage local = { 0 };
    socklen_t size = sizeof(local);

    (void)getsockname(info->connect_fd, (struct sockaddr *)&local, &size);
    write_address(out, (const struct sockaddr *)&local);
}

static void sleep_ns(int64_t ns)
{
    nanosleep(&(struct timespec){ .tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000 }, NULL);
}

/* @return -1: hang up, too many attempts of this address wait already; else the verdict */
static int judge(struct MHD_Connection *connection, const char *method, const char *path, const struct soap *soap)
{
    char address[INET6_ADDRSTRLEN];
    struct auth_request r = {
        .client = { .address = address,
                    .agent = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "User-Agent") },
        .method = method,
        .path = path,
        .authorization = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "Authorization"),
        .soap = soap,
    };
    const bool sends = r.authorization || (soap && soap_child(soap, soap->header, "Security") >= 0);
    enum sst_login_verdict verdict;
    int64_t wait_ns = 0;

    if (!http.login->user[0])
        return SST_LOGIN_RIGHT;
    sst_brake_network(peer_of(connection), r.client.network);
    write_address(address, peer_of(connection));
    if (sends)
        wait_ns = sst_login_turn(http.login, &r.client);
    if (wait_ns < 0)
        return -1;
    sleep_ns(wait_ns);
    verdict = auth_judge(&http.auth, &r, sst_clock_wall_ns());
    if (sst_login_note(http.login, &r.client, verdict))
        sleep_ns(SST_LOGIN_PAUSE_MS * INT64_C(1000000));
    return (int)verdict;
}

/* --- answers ------------------------------------------------------------------------------------------------------ */

/** An answer's head. */
struct head {
    unsigned status; /* 401 has a challenge */
    const char *type;
    bool stale; /* of a challenge: the password was right */
};

static void challenge(struct MHD_Connection *connection, struct MHD_Response *response, bool stale)
{
    char nonce[SST_LOGIN_NONCE], header[160];
    uint8_t network[16];

    sst_brake_network(peer_of(connection), network);
    sst_login_nonce(http.login, nonce, network);
    snprintf(header, sizeof(header), "Digest realm=\"" SST_LOGIN_REALM "\", qop=\"auth\", nonce=\"%s\", algorithm=MD5%s",
             nonce, stale ? ", stale=true" : "");
    (void)MHD_add_response_header(response, "WWW-Authenticate", header);
}

/* @param body  owned from then on; NULL: no memory */
static enum MHD_Result send_body(struct MHD_Connection *connection, const struct head *head, char *body, size_t bytes)
{
    struct MHD_Response *response =
        body ? MHD_create_response_from_buffer(bytes, body, MHD_RESPMEM_MUST_FREE) : NULL;
    enum MHD_Result result;

    if (!response) {
        free(body);
        return MHD_NO;
    }
    (void)MHD_add_response_header(response, "Content-Type", head->type);
    (void)MHD_add_response_header(response, "Cache-Control", "no-store");
    if (head->status == 401)
        challenge(connection, response, head->stale);
    if (head->status == 405)
        (void)MHD_add_response_header(response, "Allow", "GET, HEAD, POST");
    result = MHD_queue_response(connection, head->status, response);
    MHD_destroy_response(response);
    return result;
}

static enum MHD_Result send_text(struct MHD_Connection *connection, unsigned status, bool stale, const char *text)
{
    const struct head head = { .status = status, .type = "text/plain; charset=utf-8", .stale = stale };

    return send_body(connection, &head, strdup(text), strlen(text));
}

/* @return the refusal; NULL: the answer is written */
static const struct soap_fault *answer_call(struct MHD_Connection *connection, const char *path, const struct soap *s,
                                            FILE *out)
{
    struct onvif_call call = { .soap = s, .path = path, .port = http_port() };
    const struct soap_fault *fault;

    find_local(call.local, connection);
    http_host(call.host, call.local);
    fault = answers_call(out, &call);
    free(call.messages);
    return fault;
}

static enum MHD_Result on_post(struct MHD_Connection *connection, const char *path, struct request *r)
{
    struct head head = { .status = 200, .type = "application/soap+xml; charset=utf-8" };
    const struct soap_fault *fault = NULL;
    int verdict = SST_LOGIN_RIGHT, err;
    char *text = NULL;
    size_t bytes = 0;
    struct soap s;
    FILE *out = open_memstream(&text, &bytes);

    if (!out)
        return MHD_NO;
    err = r->large ? -E2BIG : soap_parse(&s, r->body ? r->body : "", r->bytes);
    if (err && !r->bytes) /* a client that keeps its message until it has a challenge */
        verdict = judge(connection, "POST", path, NULL);
    if (err && verdict == SST_LOGIN_RIGHT)
        fault = err == -E2BIG ? &too_large : err == -ENOMEM ? &no_memory : &malformed;
    else if (!answers_is_open(&s))
        verdict = judge(connection, "POST", path, &s);
    if (!fault && verdict != SST_LOGIN_RIGHT)
        fault = &not_authorized;
    if (!fault)
        fault = answer_call(connection, path, &s, out);
    if (fault) {
        soap_refuse(out, err ? NULL : &s, fault);
        head.status = (unsigned)fault->status;
        head.stale = verdict == SST_LOGIN_STALE || verdict == SST_LOGIN_STRAY;
    }
    if (!r->large)
        soap_free(&s);
    if (fclose(out) || verdict < 0) {
        free(text);
        return MHD_NO;
    }
    return send_body(connection, &head, text, bytes);
}

static enum MHD_Result on_get(struct MHD_Connection *connection, const char *method, const char *path)
{
    const struct head head = { .status = 200, .type = "image/jpeg" };
    const int verdict = judge(connection, method, path, NULL);
    uint8_t *data;
    size_t bytes;

    if (verdict < 0)
        return MHD_NO;
    if (verdict != SST_LOGIN_RIGHT)
        return send_text(connection, 401, verdict == SST_LOGIN_STALE || verdict == SST_LOGIN_STRAY,
                         "user and password are needed\n");
    if (picture_get(&data, &bytes))
        return send_text(connection, 503, false, "there is no picture yet\n");
    return send_body(connection, &head, (char *)data, bytes);
}

/* --- requests ----------------------------------------------------------------------------------------------------- */

static bool gather(struct request *r, const char *data, size_t bytes)
{
    char *body;

    if (r->large || r->bytes + bytes > ONVIF_BODY_MAX) {
        r->large = true;
        return true;
    }
    body = realloc(r->body, r->bytes + bytes);
    if (!body)
        return false;
    memcpy(body + r->bytes, data, bytes);
    r->body = body;
    r->bytes += bytes;
    return true;
}

static enum MHD_Result route(struct MHD_Connection *connection, const char *method, const char *path,
                             struct request *r)
{
    const bool get = !strcmp(method, "GET") || !strcmp(method, "HEAD"), post = !strcmp(method, "POST");

    if (!get && !post)
        return send_text(connection, 405, false, "GET, HEAD and POST are known\n");
    if (post && !strncmp(path, "/onvif/", strlen("/onvif/")))
        return on_post(connection, path, r);
    if (get && !strcmp(path, "/snapshot"))
        return on_get(connection, method, path);
    return send_text(connection, 404, false, "ONVIF is at /onvif/device_service, by POST; the picture at /snapshot\n");
}

static enum MHD_Result on_request(void *arg SST_UNUSED, struct MHD_Connection *connection, const char *path,
                                  const char *method, const char *version SST_UNUSED, const char *data, size_t *bytes,
                                  void **state)
{
    struct request *r = *state;
    enum MHD_Result result;

    if (!r) {
        *state = calloc(1, sizeof(*r));
        return *state ? MHD_YES : MHD_NO;
    }
    if (*bytes) {
        const bool gathered = gather(r, data, *bytes);

        *bytes = 0;
        return gathered ? MHD_YES : MHD_NO;
    }
    /* A wait for events or for a turn is not the client's idleness. */
    (void)MHD_set_connection_option(connection, MHD_CONNECTION_OPTION_TIMEOUT, 0u);
    result = route(connection, method, path, r);
    (void)MHD_set_connection_option(connection, MHD_CONNECTION_OPTION_TIMEOUT, (unsigned)IDLE_S);
    return result;
}

static void on_done(void *arg SST_UNUSED, struct MHD_Connection *connection SST_UNUSED, void **state,
                    enum MHD_RequestTerminationCode code SST_UNUSED)
{
    struct request *r = *state;

    if (r)
        free(r->body);
    free(r);
    *state = NULL;
}

/* Paths are compared as they are: no escapes are needed. */
static size_t keep_escapes(void *arg SST_UNUSED, struct MHD_Connection *connection SST_UNUSED, char *text)
{
    return strlen(text);
}

static void log_library(void *arg SST_UNUSED, const char *format, va_list args)
{
    char text[256];

    vsnprintf(text, sizeof(text), format, args);
    text[strcspn(text, "\n")] = 0;
    sst_log_debug("onvif: %s", text);
}

int http_start(struct sst_server *server, struct sst_login *login, int fd)
{
    const unsigned flags = MHD_USE_INTERNAL_POLLING_THREAD | MHD_USE_THREAD_PER_CONNECTION | MHD_USE_POLL |
                           MHD_USE_ITC | MHD_USE_ERROR_LOG;
    struct sockaddr_storage at = { 0 };
    socklen_t size = sizeof(at);

    http.server = server;
    http.login = login;
    auth_init(&http.auth, login);
    http.daemon = MHD_start_daemon(
        flags, 0, NULL, NULL, on_request, NULL, MHD_OPTION_EXTERNAL_LOGGER, log_library, NULL, MHD_OPTION_LISTEN_SOCKET,
        fd, MHD_OPTION_NOTIFY_COMPLETED, on_done, NULL, MHD_OPTION_UNESCAPE_CALLBACK, keep_escapes, NULL,
        MHD_OPTION_CONNECTION_LIMIT, (unsigned)CONNECTIONS_MAX, MHD_OPTION_PER_IP_CONNECTION_LIMIT,
        (unsigned)ADDRESS_MAX, MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)IDLE_S, MHD_OPTION_CONNECTION_MEMORY_LIMIT,
        (size_t)POOL_BYTES, MHD_OPTION_THREAD_STACK_SIZE, (size_t)STACK_BYTES, MHD_OPTION_END);
    if (!http.daemon) {
        sst_log_error("onvif: the HTTP server does not start");
        close(fd);
        return -EIO;
    }
    (void)getsockname(fd, (struct sockaddr *)&at, &size);
    atomic_store(&http.port, ntohs(at.ss_family == AF_INET6 ? ((struct sockaddr_in6 *)&at)->sin6_port
                                                            : ((struct sockaddr_in *)&at)->sin_port));
    return 0;
}

void http_stop(void)
{
    if (http.daemon)
        MHD_stop_daemon(http.daemon);
    http.daemon = NULL;
}
