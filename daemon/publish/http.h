/* daemon/publish/http.h - the API, the pictures and the page over HTTP: on a UNIX socket, and on TCP with a token. */
#ifndef SST_DAEMON_PUBLISH_HTTP_H
#define SST_DAEMON_PUBLISH_HTTP_H

#include <stdbool.h>

#include "daemon/counters/counters.h"
#include "daemon/publish/api.h"

enum sst_role {
    SST_ROLE_ANYONE = 0,  /* only what reveals nothing: /healthz, /login */
    SST_ROLE_VIEW = 1,    /* reads */
    SST_ROLE_CONTROL = 2, /* changes the service's state */
};

struct sst_http; /* opaque; open and close on one thread */

struct sst_http_config {
    /* UNIX socket: the credentials of the peer decide */
    const char *socket;     /* path, made 0660 (0666 with view_group), a stale one is replaced;
                                NULL: none */
    int socket_fd;          /* listening already, by socket activation; owned from then on; -1: none */
    const char *group;      /* may control; NULL: root and the process's own user alone */
    const char *view_group; /* may read; NULL: none */
    /* TCP */
    const char *address; /* numeric; NULL: no TCP */
    int port;            /* 0: any that is free */
    const char *host;    /* further name allowed in Host, or NULL */
    const char
        *token_file; /* made with 256 random bits and mode 0600 if missing; PATH.view holds the one for looking */
    const char *tls_certificate, *tls_key; /* PEM files; NULL: none */
    bool insecure;                         /* an address other than loopback without TLS is refused without this */
    int clients, streams;                  /* limits */
    double stream_hz;                      /* pictures per second for each stream at most; 0: as they come */
    const struct sst_api *api;             /* must stay */
    struct sst_counters *counters;         /* must stay */
};

/**
 * Serve from now on, on threads of its own.
 * @return 0, -EADDRINUSE (socket in use: logged with the owner if known), -EACCES, -EINVAL (an open address without TLS
 * or `insecure`; a bad address), -ENOENT (certificate), -ENOMEM; logged with the remedy. A TCP address that is in use
 * or not there yet is waited for, where there is a UNIX socket, and is a problem in the counters; without one it is
 * -EADDRINUSE or -EADDRNOTAVAIL.
 */
SST_MUST_CHECK int sst_http_open(struct sst_http **out, const struct sst_http_config *cfg);

/** The port listened on; 0: none. */
int sst_http_port(const struct sst_http *http);

/** Of HTTPS, as it stands in the certificate; seconds since 1970. */
struct sst_http_certificate {
    int64_t from_s, until_s;
};

/** The certificate that new connections get. @return false: no TLS. Thread: any */
bool sst_http_certificate(struct sst_http *http, struct sst_http_certificate *out);

/**
 * Load certificate and key from their files for new connections; open ones keep theirs. Also happens by itself within a
 * minute after the files have changed. Events "certificate" report it, files that were refused, and an end that is near
 * (14 days) or reached.
 *
 * @param dry_run  only judge them
 * @param out      of the new one, where it is another
 * @return 1: another one; 0: the same, or no TLS; -ENOENT, -EACCES, -EINVAL (no PEM, not the certificate's key, ended
 *         while the one in use has not) ...: the old pair stays; logged. Thread: any; reads files
 */
SST_MUST_CHECK int sst_http_renew(struct sst_http *http, const char *certificate, const char *key, bool dry_run,
                                  struct sst_http_certificate *out);

/** Begin to end: what waits for pictures, events and disks leaves; sst_http_close() waits for it. NULL is fine. */
void sst_http_stop(struct sst_http *http);

/** Ends all connections, within a second. NULL is fine. */
void sst_http_close(struct sst_http *http);

/* --- the table of routes, which tests and the documentation walk -------------------------------------------------- */

struct sst_route {
    const char *method; /* "GET" (and HEAD), "POST" */
    const char *path;   /* "/api/v1/views/{id}" */
    enum sst_role role;
    const char *what; /* one line */
};

const struct sst_route *sst_http_routes(int *count);

#endif
