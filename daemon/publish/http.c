/* The server: sockets, threads, limits.
 *
 * Each connection has a thread; their number is limited (web.clients). A stream waits for its next picture, and a slow
 * call delays its own client alone. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/publish_internal.h"

#include <errno.h>

#include "base/log.h"

#if WITH_HTTPD

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/thread.h"

#define AGAIN_S     5           /* between tries for an address that is not to be had yet */
#define SPARE       4           /* connections above the limit, to be refused with an answer */
#define POOL_BYTES  (32 * 1024) /* of a connection, for its headers both ways */
#define STACK_BYTES (2 * 1024 * 1024)

static _Thread_local char library_error[256]; /* of the library, the last one on this thread */

/* TLS 1.2 and 1.3 with forward secrecy and authenticated encryption, in the order of the service. */
#define TLS_PRIORITIES                                                                                                 \
    "NORMAL:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2:-KX-ALL:+ECDHE-ECDSA:+ECDHE-RSA:+DHE-RSA:-CIPHER-ALL:+AES-256-GCM:"    \
    "+CHACHA20-POLY1305:+AES-128-GCM:-MAC-ALL:+AEAD:%SERVER_PRECEDENCE"

static void log_library(void *cls SST_UNUSED, const char *fmt, va_list args)
{
    vsnprintf(library_error, sizeof(library_error), fmt, args);
    library_error[strcspn(library_error, "\n")] = 0;
    sst_log_debug("http: %s", library_error);
}

/* "%00" stays as it is: a NUL would end the path before the rest of it is checked. */
static size_t unescape(void *cls SST_UNUSED, struct MHD_Connection *connection SST_UNUSED, char *text)
{
    return strstr(text, "%00") ? strlen(text) : MHD_http_unescape(text);
}

/* A library that does not start closes its socket after most of its errors, but not after all. The number may
 * have been reused by then. */
static void close_if_left(int fd, const struct stat *was)
{
    struct stat is;

    if (!fstat(fd, &is) && is.st_dev == was->st_dev && is.st_ino == was->st_ino)
        close(fd);
}

/* Serve on a listening socket, which it owns from then on. */
static int serve(struct http_listener *listener, int fd, bool tls)
{
    const unsigned flags = MHD_USE_INTERNAL_POLLING_THREAD | MHD_USE_THREAD_PER_CONNECTION | MHD_USE_POLL |
                           MHD_USE_ITC | MHD_USE_ERROR_LOG | (tls ? MHD_USE_TLS : 0) |
                           (MHD_is_feature_supported(MHD_FEATURE_UPGRADE) == MHD_YES ? MHD_ALLOW_UPGRADE : 0);
    const unsigned clients = (unsigned)listener->http->cfg.clients, idle_s = (unsigned)listener->http->cfg.idle_s;
    struct http_pair *pair = tls ? http_tls_take(&listener->http->pairs) : NULL; /* it may be renewed meanwhile */
    const struct MHD_OptionItem secure[] = {
        { tls ? MHD_OPTION_HTTPS_MEM_CERT : MHD_OPTION_END, 0, http_tls_pem(pair, false) },
        { MHD_OPTION_HTTPS_MEM_KEY, 0, http_tls_pem(pair, true) },
        { MHD_OPTION_HTTPS_PRIORITIES, 0, (void *)(uintptr_t)TLS_PRIORITIES },
        { MHD_OPTION_END, 0, NULL },
    };
    struct stat socket = { 0 };

    (void)fstat(fd, &socket);
    library_error[0] = 0;
    /* The first option, so that errors of the others reach our log. */
    listener->daemon = MHD_start_daemon(
        flags, 0, NULL, NULL, http_on_request, listener, MHD_OPTION_EXTERNAL_LOGGER, log_library, NULL,
        MHD_OPTION_LISTEN_SOCKET, fd, MHD_OPTION_NOTIFY_COMPLETED, http_on_done, listener, MHD_OPTION_URI_LOG_CALLBACK,
        http_on_uri, NULL, MHD_OPTION_NOTIFY_CONNECTION, http_on_connection, listener, MHD_OPTION_UNESCAPE_CALLBACK,
        unescape, NULL, MHD_OPTION_CONNECTION_LIMIT, clients + SPARE, MHD_OPTION_PER_IP_CONNECTION_LIMIT,
        listener->local ? 0 : (clients + 3) / 4 * 3, MHD_OPTION_CONNECTION_TIMEOUT, idle_s,
        MHD_OPTION_CONNECTION_MEMORY_LIMIT, (size_t)POOL_BYTES, MHD_OPTION_THREAD_STACK_SIZE, (size_t)STACK_BYTES,
        MHD_OPTION_STRICT_FOR_CLIENT, 1, MHD_OPTION_ARRAY, secure, MHD_OPTION_END);
    http_tls_end(&listener->http->pairs, pair);
    if (listener->daemon)
        return 0;
    close_if_left(fd, &socket);
    return -EIO;
}

static int open_local(struct sst_http *http)
{
    const struct sst_http_config *cfg = &http->cfg;
    /* With 0660 members of view_group could not connect; the credentials of each peer decide in either case. */
    const mode_t mode = http->auth.view_group != (gid_t)-1 ? 0666 : 0660;
    int fd = cfg->socket_fd, err;

    if (fd < 0 && !cfg->socket)
        return 0;
    if (fd < 0)
        fd = http_listen_unix(&http->unix_socket, cfg->socket, mode, http->auth.group);
    if (fd < 0)
        return fd;
    err = serve(&http->local, fd, false);
    if (err)
        sst_log_error("control socket: libmicrohttpd does not start: %s", library_error);
    return err;
}

static int listen_tcp(struct sst_http *http, bool quiet)
{
    const int fd = http_listen_tcp(http->address, http->cfg.port, http->tls || http->cfg.insecure, quiet);
    int before, err;

    if (fd < 0)
        return fd;
    before = atomic_exchange(&http->port, http_socket_port(fd)); /* requests may come at once */
    err = serve(&http->tcp, fd, http->tls);
    if (err)
        atomic_store(&http->port, before);
    if (err && !quiet)
        sst_log_error("web: libmicrohttpd does not start: %s", library_error);
    return err;
}

/* @param err  errno; 0: it is bound */
static void set_unbound(struct sst_http *http, int err)
{
    char why[SST_COUNTERS_PROBLEM] = "";

    if (err)
        snprintf(why, sizeof(why), "web.address %s, port %d: %s; tried again", http->address, http->cfg.port,
                 strerror(err));
    atomic_store(&http->away, err);
    sst_counters_set_problem(http->count, SST_COUNTERS_HTTP, why);
}

/* Called by the reaper: bind the address that was not available. */
static void listen_again(struct sst_http *http, int64_t now_ns)
{
    int err;

    if (!atomic_load(&http->away) || now_ns < http->again_ns)
        return;
    http->again_ns = now_ns + AGAIN_S * 1000000000LL;
    err = listen_tcp(http, true);
    set_unbound(http, -err); /* the reason may be another one by now */
    if (!err)
        sst_log_info("web: listens on %s, port %d now", http->address, sst_http_port(http));
}

static int open_tcp(struct sst_http *http)
{
    const struct sst_http_config *cfg = &http->cfg;
    int err = 0;

    if (!cfg->address)
        return 0;
    http->tls = cfg->tls_certificate && cfg->tls_certificate[0];
    if (http->tls)
        err = http_tls_open(&http->pairs, cfg);
    if (err)
        return err;
    err = listen_tcp(http, false);
    if ((err != -EADDRINUSE && err != -EADDRNOTAVAIL) || !http->local.daemon)
        return err;
    set_unbound(http, -err);
    sst_log_warning("web: retrying every %d s; the rest of the service runs without its page", AGAIN_S);
    return 0;
}

/* Disconnects slow requests, as the library only notices silence; follows changed files of a certificate. */
static void *reap(void *arg)
{
    struct sst_http *http = arg;
    int64_t now_ns;

    pthread_mutex_lock(&http->lock);
    while (!atomic_load(&http->stopping)) {
        (void)sst_cond_wait_until(&http->wake, &http->lock, sst_clock_now_ns() + 1000000000);
        now_ns = sst_clock_now_ns();
        for (struct http_connection *l = http->links; l; l = l->next) {
            if (now_ns > atomic_load(&l->deadline_ns))
                shutdown(l->fd, SHUT_RDWR);
        }
        pthread_mutex_unlock(&http->lock);
        if (http->tls)
            http_tls_look(&http->pairs, http->cfg.api->events, now_ns);
        listen_again(http, now_ns);
        pthread_mutex_lock(&http->lock);
    }
    pthread_mutex_unlock(&http->lock);
    return NULL;
}

static void copy(char *out, size_t size, const char *text)
{
    snprintf(out, size, "%s", text ? text : "");
}

/* The parts of which one must not see the other half made: then threads are started with all signals blocked, so that
 * the program's handlers run where it expects them. */
static int start(struct sst_http *http)
{
    sigset_t all, before;
    int err;

    sigfillset(&all);
    pthread_sigmask(SIG_BLOCK, &all, &before);
    err = open_local(http);
    err = err ? err : open_tcp(http);
    if (!err) {
        err = -pthread_create(&http->reaper, NULL, reap, http);
        http->reaping = !err;
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return err;
}

int sst_http_open(struct sst_http **out, const struct sst_http_config *cfg)
{
    struct sst_http *http;
    int err;

    if (!cfg->api || !cfg->counters || cfg->clients < 1 || cfg->streams < 0)
        return -EINVAL;
    http = calloc(1, sizeof(*http));
    if (!http)
        return -ENOMEM;
    http->cfg = *cfg;
    http->cfg.idle_s = cfg->idle_s > 0 ? cfg->idle_s : HTTP_IDLE_S;
    http->count = cfg->counters;
    http->tcp = (struct http_listener){ .http = http };
    http->local = (struct http_listener){ .http = http, .local = true };
    copy(http->host, sizeof(http->host), cfg->host);
    if (!cfg->url || !http_url_host(cfg->url, http->url_host))
        http->url_host[0] = 0;
    copy(http->address, sizeof(http->address), cfg->address);
    http_proxies_init(&http->proxies, cfg);
    http_audit_init(&http->audit, cfg->token_file);
    err = http_auth_init(&http->auth, cfg);
    if (err) {
        free(http);
        return err;
    }
    pthread_mutex_init(&http->lock, NULL);
    pthread_mutex_init(&http->health.lock, NULL);
    http_tls_init(&http->pairs, http->count);
    http_videos_init(&http->videos);
    sst_cond_init(&http->wake);
    err = start(http);
    if (err)
        sst_http_close(http);
    else
        *out = http;
    return err;
}

int sst_http_port(const struct sst_http *http)
{
    return atomic_load(&http->port);
}

void sst_http_stop(struct sst_http *http)
{
    if (!http)
        return;
    pthread_mutex_lock(&http->lock);
    atomic_store(&http->stopping, true);
    pthread_cond_broadcast(&http->wake);
    pthread_mutex_unlock(&http->lock);
}

void sst_http_close(struct sst_http *http)
{
    if (!http)
        return;
    sst_http_stop(http);
    http_unlink_unix(&http->unix_socket);
    if (http->reaping)
        pthread_join(http->reaper, NULL);
    http_videos_await(&http->videos); /* the library must not end before upgraded connections */
    if (http->tcp.daemon)
        MHD_stop_daemon(http->tcp.daemon);
    if (http->local.daemon)
        MHD_stop_daemon(http->local.daemon);
    http_auth_fini(&http->auth);
    pthread_mutex_destroy(&http->audit.lock);
    http_tls_fini(&http->pairs);
    http_videos_fini(&http->videos);
    pthread_cond_destroy(&http->wake);
    pthread_mutex_destroy(&http->health.lock);
    pthread_mutex_destroy(&http->lock);
    free(http);
}

#else

#include "base/absent.h"

int sst_http_open(struct sst_http **out SST_UNUSED, const struct sst_http_config *cfg SST_UNUSED)
{
    sst_log_error("this build has no HTTP: build it with libmicrohttpd, or set web.enabled: false");
    return -ENOTSUP;
}

SST_ABSENT(int, 0, sst_http_port, const struct sst_http *http)
SST_ABSENT(void, , sst_http_stop, struct sst_http *http)
SST_ABSENT(void, , sst_http_close, struct sst_http *http)

#endif
