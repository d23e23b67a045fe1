/* daemon/publish/http.h - HTTP server of API, pictures and web page, on a UNIX socket and, with a token, on TCP. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_PUBLISH_HTTP_H
#define SST_DAEMON_PUBLISH_HTTP_H

#include <stdbool.h>

#include "daemon/counters/counters.h"
#include "daemon/publish/api.h"

enum sst_role {
    SST_ROLE_ANYONE = 0,  /* only routes that reveal nothing: /healthz, /login */
    SST_ROLE_VIEW = 1,    /* reads */
    SST_ROLE_CONTROL = 2, /* changes the service's state */
};

struct sst_http; /* opaque; open and close on one thread */

struct sst_http_config {
    /* UNIX socket: the credentials of the peer decide */
    const char *socket;     /* path, created with mode 0660 (0666 with view_group), a stale one is replaced;
                                NULL: none */
    int socket_fd;          /* listening already, by socket activation; owned from then on; -1: none */
    const char *group;      /* may control; NULL: root and the process's own user alone */
    const char *view_group; /* may read; NULL: none */
    /* TCP */
    const char *address; /* numeric; NULL: no TCP */
    int port;            /* 0: any free port */
    const char *host;    /* further name allowed in Host, or NULL */
    const char *url;     /* address of the page, whose host is allowed, too, or NULL */
    const char
        *token_file; /* created with 256 random bits and mode 0600 if missing; PATH.view holds the read-only token */
    const char *const *proxy; /* numeric addresses of proxies that report their users */
    int proxies;
    const char *proxy_header; /* with the user's name; NULL: none */
    unsigned proxy_rights;    /* of these users: enum sst_right */
    const char *tls_certificate, *tls_key; /* PEM files; NULL: none */
    bool insecure;                         /* allow an address other than loopback without TLS */
    int clients, streams;                  /* limits */
    double stream_hz;                      /* at most this many pictures per second and stream; 0: no limit */
    int idle_s;                            /* a connection without a byte goes, streams after twice that; 0: 10 */
    const struct sst_api *api;             /* must outlive the server */
    struct sst_counters *counters;         /* must outlive the server */
};

/**
 * Start the server on its own threads.
 * @return 0, -EADDRINUSE (socket in use: logged with the owner if known), -EACCES, -EINVAL (an open address without TLS
 * or `insecure`; a bad address), -ENOENT (certificate), -ENOMEM; logged with the remedy. If a TCP address is in use
 * or does not exist yet, the server with a UNIX socket retries it and sets a problem in the counters; without one the
 * call returns -EADDRINUSE or -EADDRNOTAVAIL.
 */
SST_MUST_CHECK int sst_http_open(struct sst_http **out, const struct sst_http_config *cfg);

/** The TCP port that the server listens on; 0: none. */
int sst_http_port(const struct sst_http *http);

/** Validity of the HTTPS certificate; seconds since 1970. */
struct sst_http_certificate {
    int64_t from_s, until_s;
};

/** The certificate that new connections get. @return false: no TLS. Thread: any */
bool sst_http_certificate(struct sst_http *http, struct sst_http_certificate *out);

/**
 * Load certificate and key from their files for new connections; open ones keep theirs. Also happens automatically
 * within a minute after the files have changed. Events "certificate" report a new pair, refused files, and an expiry
 * that is near (14 days) or past.
 *
 * @param dry_run  only check the files
 * @param out      validity of the new certificate; unchanged if it is the same
 * @return 1: a new one; 0: the same, or no TLS; -ENOENT, -EACCES, -EINVAL (no PEM, key of another certificate, expired
 *         while the one in use has not) ...: the old pair stays; logged. Thread: any; reads files
 */
SST_MUST_CHECK int sst_http_renew(struct sst_http *http, const char *certificate, const char *key, bool dry_run,
                                  struct sst_http_certificate *out);

/** Start to shut down: calls that wait for pictures, events or disks return; sst_http_close() waits for the end. NULL
 *  is fine. */
void sst_http_stop(struct sst_http *http);

/** Ends all connections, within a second. NULL is fine. */
void sst_http_close(struct sst_http *http);

/* --- the table of routes, also read by tests and documentation --------------------------------------------------- */

#define SST_QUERY_MAX 8

struct sst_route {
    const char *method; /* "GET" (and HEAD), "POST" */
    const char *path;   /* "/api/v1/views/{id}" */
    enum sst_role role;
    const char *what; /* one line */
    const char *query[SST_QUERY_MAX + 1]; /* parameters; NULL ends them */
};

const struct sst_route *sst_http_routes(int *count);

#endif
