/* Certificate and key: read, judged, and renewed while connections are open.
 *
 * microhttpd keeps the pair that it was started with. Each connection gets the newest one when it begins, before
 * its handshake, and keeps it until it ends; the pair goes with the last connection. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/publish_internal.h"

#if WITH_HTTPD

#include <errno.h>
#include <gnutls/x509.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"

#define PEM_MAX  (1 << 20)
#define CHECK_NS INT64_C(20000000000) /* files that have changed and then stood still this long are read */
#define DAY_S    86400
#define SOON_S   (14 * DAY_S) /* authorities that renew by themselves do so a month before */

struct http_pair {
    gnutls_certificate_credentials_t credentials;
    uint8_t *pem[2]; /* certificate, key */
    size_t bytes[2];
    int64_t from_s, until_s; /* since 1970 */
    int refs;                /* under http_tls.lock */
};

static void destroy(struct http_pair *p)
{
    if (p->credentials)
        gnutls_certificate_free_credentials(p->credentials);
    if (p->pem[1])
        explicit_bzero(p->pem[1], p->bytes[1]);
    free(p->pem[0]);
    free(p->pem[1]);
    free(p);
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

/* Some hold until the year 9999, which nanoseconds cannot count. */
static int64_t seconds(time_t t)
{
    return t < INT64_MAX / 1000000000 ? t : INT64_MAX / 1000000000;
}

/* When the first certificate, the server's own, holds. @return an error of GnuTLS */
static int read_times(struct http_pair *p)
{
    const gnutls_datum_t pem = { p->pem[0], (unsigned)p->bytes[0] };
    gnutls_x509_crt_t *list;
    unsigned n;
    int err = gnutls_x509_crt_list_import2(&list, &n, &pem, GNUTLS_X509_FMT_PEM, 0);

    if (err < 0)
        return err;
    p->from_s = seconds(gnutls_x509_crt_get_activation_time(list[0]));
    p->until_s = seconds(gnutls_x509_crt_get_expiration_time(list[0]));
    for (unsigned i = 0; i < n; i++)
        gnutls_x509_crt_deinit(list[i]);
    gnutls_free(list);
    return 0;
}

static int fit_together(struct http_pair *p, const char *certificate, const char *key)
{
    const gnutls_datum_t pem[2] = { { p->pem[0], (unsigned)p->bytes[0] }, { p->pem[1], (unsigned)p->bytes[1] } };
    int err = gnutls_certificate_allocate_credentials(&p->credentials);

    if (err < 0)
        return -ENOMEM;
    err = gnutls_certificate_set_x509_key_mem2(p->credentials, &pem[0], &pem[1], GNUTLS_X509_FMT_PEM, NULL, 0);
    if (err == GNUTLS_E_CERTIFICATE_KEY_MISMATCH)
        sst_log_error("web.tls_key %s is not the key of the certificate %s; give both files of one renewal", key,
                      certificate);
    else if (err < 0)
        sst_log_error("web.tls_key %s holds no key in PEM that can be used: %s; a passphrase must be removed", key,
                      gnutls_strerror(err));
    return err < 0 ? -EINVAL : 0;
}

static int read_pair(struct http_pair **out, const char *certificate, const char *key)
{
    struct http_pair *p = calloc(1, sizeof(*p));
    int err;

    if (!p)
        return -ENOMEM;
    p->refs = 1;
    err = sst_file_read_text(certificate, PEM_MAX, &p->pem[0], &p->bytes[0]);
    err = err ? err : sst_file_read_text(key, PEM_MAX, &p->pem[1], &p->bytes[1]);
    if (!err) {
        const int bad = read_times(p);

        if (bad)
            sst_log_error("web.tls_certificate %s holds no certificate in PEM (%s); name the whole chain "
                          "(fullchain.pem)",
                          certificate, gnutls_strerror(bad));
        err = bad ? -EINVAL : fit_together(p, certificate, key);
    }
    if (err)
        destroy(p);
    else
        *out = p;
    return err;
}

static bool same_pair(const struct http_pair *a, const struct http_pair *b)
{
    for (int i = 0; i < 2; i++)
        if (a->bytes[i] != b->bytes[i] || memcmp(a->pem[i], b->pem[i], a->bytes[i]) != 0)
            return false;
    return true;
}

/* Stamp of a file, by which a change shows; zeros without one. Links are followed: renewals often change links alone.
 */
static struct http_stamp stamp_of(const char *path)
{
    struct stat st;

    if (stat(path, &st))
        return (struct http_stamp){ .dev = 0 };
    return (struct http_stamp){ st.st_dev, st.st_ino, st.st_size,
                                (int64_t)st.st_mtim.tv_sec * 1000000000 + st.st_mtim.tv_nsec };
}

static bool same_stamp(const struct http_stamp *a, const struct http_stamp *b)
{
    return a->dev == b->dev && a->ino == b->ino && a->bytes == b->bytes && a->changed_ns == b->changed_ns;
}

/* --- pairs in use ------------------------------------------------------------------------------------------------- */

static void unref_locked(struct http_pair *p)
{
    if (p && !--p->refs)
        destroy(p);
}

struct http_pair *http_tls_begin(struct http_tls *t, struct MHD_Connection *connection)
{
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_GNUTLS_SESSION);
    struct http_pair *p;

    if (!info || !info->tls_session)
        return NULL;
    pthread_mutex_lock(&t->lock);
    p = t->pair;
    if (p && gnutls_credentials_set(info->tls_session, GNUTLS_CRD_CERTIFICATE, p->credentials) < 0)
        p = NULL; /* without memory: the connection has the pair of the start */
    if (p)
        p->refs++;
    pthread_mutex_unlock(&t->lock);
    return p;
}

void http_tls_end(struct http_tls *t, struct http_pair *p)
{
    pthread_mutex_lock(&t->lock);
    unref_locked(p);
    pthread_mutex_unlock(&t->lock);
}

static struct sst_http_certificate describe(const struct http_pair *p)
{
    return (struct sst_http_certificate){ p->from_s, p->until_s };
}

static void format_day(char out[SST_CLOCK_TEXT], int64_t s)
{
    sst_clock_text(out, s * 1000000000);
    out[strcspn(out, "T")] = 0;
}

/* An expired certificate is refused where a valid one is in use, else accepted: the clock may be wrong. */
static int judge_times(const struct http_pair *fresh, const struct http_pair *old, const char *certificate)
{
    const int64_t now_s = sst_clock_wall_ns() / 1000000000;
    char day[SST_CLOCK_TEXT];

    if (fresh->until_s <= now_s && old && old->until_s > now_s) {
        format_day(day, fresh->until_s);
        sst_log_error("web.tls_certificate %s ended on %s, the one in use has not: renew it", certificate, day);
        return -EINVAL;
    }
    if (fresh->from_s > now_s) {
        format_day(day, fresh->from_s);
        sst_log_warning("web.tls_certificate %s holds only from %s on; is the clock right?", certificate, day);
    }
    return 0;
}

/* The file work of renewing; under t->reading. @return as sst_http_renew() */
static int renew(struct http_tls *t, const char *certificate, const char *key, bool dry_run,
                 struct sst_http_certificate *out)
{
    const struct http_stamp stamp[2] = { stamp_of(certificate), stamp_of(key) };
    struct http_pair *fresh, *old;
    int err;

    if (!dry_run)
        memcpy(t->stamp, stamp, sizeof(stamp)); /* good or bad, they are not read again until they change */
    err = read_pair(&fresh, certificate, key);
    if (err)
        return err;
    pthread_mutex_lock(&t->lock);
    old = t->pair; /* changes under t->reading alone */
    pthread_mutex_unlock(&t->lock);
    err = old && same_pair(fresh, old) ? 0 : 1;
    if (err && judge_times(fresh, old, certificate))
        err = -EINVAL;
    if (err == 1)
        *out = describe(fresh);
    if (err >= 0 && !dry_run) {
        memmove(t->path[0], certificate, strlen(certificate) + 1);
        memmove(t->path[1], key, strlen(key) + 1);
    }
    if (err != 1 || dry_run) {
        destroy(fresh);
        return err;
    }
    pthread_mutex_lock(&t->lock);
    t->pair = fresh;
    atomic_store(&t->count->certificate_until_s, fresh->until_s);
    unref_locked(old);
    pthread_mutex_unlock(&t->lock);
    return 1;
}

int http_tls_open(struct http_tls *t, const struct sst_http_config *cfg)
{
    struct sst_http_certificate now;

    if (MHD_is_feature_supported(MHD_FEATURE_TLS) != MHD_YES) {
        sst_log_error("web.tls_certificate: this build of libmicrohttpd has no TLS");
        return -ENOTSUP;
    }
    if (!cfg->tls_key || !cfg->tls_key[0]) {
        sst_log_error("web.tls_key: name the file with the key of %s", cfg->tls_certificate);
        return -EINVAL;
    }
    if (strlen(cfg->tls_certificate) >= sizeof(t->path[0]) || strlen(cfg->tls_key) >= sizeof(t->path[1]))
        return -ENAMETOOLONG;
    return sst_min_int(renew(t, cfg->tls_certificate, cfg->tls_key, false, &now), 0);
}

struct http_pair *http_tls_take(struct http_tls *t)
{
    struct http_pair *p;

    pthread_mutex_lock(&t->lock);
    p = t->pair;
    if (p)
        p->refs++;
    pthread_mutex_unlock(&t->lock);
    return p;
}

void *http_tls_pem(const struct http_pair *p, bool key)
{
    return p ? p->pem[key] : NULL;
}

void http_tls_init(struct http_tls *t, struct sst_counters *count)
{
    t->count = count;
    pthread_mutex_init(&t->reading, NULL);
    pthread_mutex_init(&t->lock, NULL);
}

void http_tls_fini(struct http_tls *t)
{
    unref_locked(t->pair);
    pthread_mutex_destroy(&t->lock);
    pthread_mutex_destroy(&t->reading);
}

/* --- as time goes by ---------------------------------------------------------------------------------------------- */

static json_t *event_data(const char *state, int64_t until_s)
{
    char text[SST_CLOCK_TEXT] = "";

    if (until_s)
        sst_clock_text(text, until_s * 1000000000);
    return json_pack("{s:s, s:s}", "state", state, "until", text);
}

static void report_renewed(struct sst_events *events, const struct sst_http_certificate *c)
{
    char day[SST_CLOCK_TEXT];

    format_day(day, c->until_s);
    sst_events_emit(events, SST_EVENT_INFO, "certificate", event_data("renewed", c->until_s),
                    "new connections get the renewed certificate, which holds until %s", day);
}

/* Load files that have changed and are no longer being written. */
static void check_files(struct http_tls *t, struct sst_events *events)
{
    const struct http_stamp now[2] = { stamp_of(t->path[0]), stamp_of(t->path[1]) };
    const bool changed = !same_stamp(&now[0], &t->stamp[0]) || !same_stamp(&now[1], &t->stamp[1]);
    const bool stands = same_stamp(&now[0], &t->seen[0]) && same_stamp(&now[1], &t->seen[1]);
    struct sst_http_certificate c;
    char why[SST_LOG_MAX] = "";
    int done;

    memcpy(t->seen, now, sizeof(now));
    if (!changed || !stands)
        return;
    sst_log_hold_errors(why); /* the event has it */
    done = renew(t, t->path[0], t->path[1], false, &c);
    sst_log_hold_errors(NULL);
    if (done == 1)
        report_renewed(events, &c);
    else if (done < 0)
        sst_events_emit(events, SST_EVENT_WARNING, "certificate", event_data("refused", 0),
                        "the certificate in use stays: %.190s", why[0] ? why : strerror(-done));
}

/* One event when the end is near, one when it is reached, also after the clock was set. */
static void check_time(struct http_tls *t, const struct sst_http_certificate *c, struct sst_events *events)
{
    const int64_t left_s = c->until_s - sst_clock_wall_ns() / 1000000000;
    const int warned = left_s <= 0 ? 2 : left_s <= SOON_S ? 1 : 0;
    char day[SST_CLOCK_TEXT];

    format_day(day, c->until_s);
    if (warned > t->warned && warned == 2)
        sst_events_emit(events, SST_EVENT_ERROR, "certificate", event_data("expired", c->until_s),
                        "the certificate ended on %s: browsers refuse the page; renew web.tls_certificate", day);
    else if (warned > t->warned)
        sst_events_emit(
            events, SST_EVENT_WARNING, "certificate", event_data("expiring", c->until_s),
            "the certificate ends on %s, in less than %d days: renew web.tls_certificate, it is taken over by itself",
            day, (int)(left_s / DAY_S) + 1);
    t->warned = warned;
}

void http_tls_look(struct http_tls *t, struct sst_events *events, int64_t now_ns)
{
    struct sst_http_certificate c;

    if (now_ns < t->look_ns)
        return;
    t->look_ns = now_ns + CHECK_NS;
    pthread_mutex_lock(&t->reading);
    check_files(t, events);
    pthread_mutex_lock(&t->lock);
    c = describe(t->pair);
    pthread_mutex_unlock(&t->lock);
    check_time(t, &c, events);
    pthread_mutex_unlock(&t->reading);
}

/* --- verbs -------------------------------------------------------------------------------------------------------- */

bool sst_http_certificate(struct sst_http *http, struct sst_http_certificate *out)
{
    if (!http->tls)
        return false;
    pthread_mutex_lock(&http->pairs.lock);
    *out = describe(http->pairs.pair);
    pthread_mutex_unlock(&http->pairs.lock);
    return true;
}

int sst_http_renew(struct sst_http *http, const char *certificate, const char *key, bool dry_run,
                   struct sst_http_certificate *out)
{
    struct http_tls *t = &http->pairs;
    int done;

    if (!http->tls)
        return 0;
    if (strlen(certificate) >= sizeof(t->path[0]) || strlen(key) >= sizeof(t->path[1]))
        return -ENAMETOOLONG;
    pthread_mutex_lock(&t->reading);
    done = renew(t, certificate, key, dry_run, out);
    if (done == 1 && !dry_run)
        report_renewed(http->cfg.api->events, out);
    pthread_mutex_unlock(&t->reading);
    return done;
}

#else

#include "base/absent.h"

SST_ABSENT(bool, false, sst_http_certificate, struct sst_http *http, struct sst_http_certificate *out)
SST_ABSENT(int, 0, sst_http_renew, struct sst_http *http, const char *certificate, const char *key, bool dry_run,
           struct sst_http_certificate *out)

#endif
