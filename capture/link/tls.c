/* Certificates, sessions and identity of the other side, for TLS and DTLS connections of hosts. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/link/link_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"

#if WITH_HTTPD

#include <gnutls/gnutls.h>
#include <gnutls/x509.h>

/* Both sides are ours. GnuTLS has no DTLS 1.3. */
#define PRIORITY_STREAM "SECURE128:-VERS-ALL:+VERS-TLS1.3"
#define PRIORITY_DATAGRAMS                                                                                             \
    "SECURE128:-VERS-ALL:+VERS-DTLS1.2:-KX-ALL:+ECDHE-ECDSA:+ECDHE-RSA:-MAC-ALL:+AEAD:-CIPHER-ALL:+AES-128-GCM:"       \
    "+AES-256-GCM:+CHACHA20-POLY1305"

struct link_credentials {
    gnutls_certificate_credentials_t x509;
};

static int refuse(const char *key, const char *path, int err)
{
    sst_log_error("hosts.%s %s: %s; docs/use/hosts.md says how certificates are made", key, path, gnutls_strerror(err));
    return -EINVAL;
}

int link_credentials_create(struct link_credentials **out, const struct sst_array_config *array)
{
    struct link_credentials *c = calloc(1, sizeof(*c));
    int n, err;

    if (!c || gnutls_certificate_allocate_credentials(&c->x509) < 0) {
        free(c);
        return -ENOMEM;
    }
    n = gnutls_certificate_set_x509_trust_file(c->x509, array->hosts.ca, GNUTLS_X509_FMT_PEM);
    err = n <= 0 ? refuse("ca", array->hosts.ca, n ? n : GNUTLS_E_NO_CERTIFICATE_FOUND) : 0;
    if (!err) {
        n = gnutls_certificate_set_x509_key_file(c->x509, array->hosts.certificate, array->hosts.key,
                                                 GNUTLS_X509_FMT_PEM);
        err = n < 0 ? refuse(n == GNUTLS_E_FILE_ERROR && !sst_path_exists(array->hosts.key) ? "key" : "certificate",
                             array->hosts.certificate, n)
                    : 0;
    }
    if (err)
        link_credentials_destroy(c);
    else
        *out = c;
    return err;
}

void link_credentials_destroy(struct link_credentials *c)
{
    if (!c)
        return;
    gnutls_certificate_free_credentials(c->x509);
    free(c);
}

int link_session_create(struct gnutls_session_int **out, struct link_credentials *credentials, bool server,
                        bool datagrams)
{
    /* A set is hundreds of datagrams that overtake each other, more than the 64 of GnuTLS's window against replay.
     * Repeated datagrams are recognised by their number in their set, and datagrams older than the awaited sets are
     * dropped. A certificate is sent whatever the head asks for: with DTLS 1.2 GnuTLS holds back one of ed25519. */
    const unsigned flags = (server ? GNUTLS_SERVER : GNUTLS_CLIENT | GNUTLS_FORCE_CLIENT_CERT) | GNUTLS_NONBLOCK |
                           GNUTLS_NO_SIGNAL | (datagrams ? GNUTLS_DATAGRAM | GNUTLS_NO_REPLAY_PROTECTION : 0);
    gnutls_session_t s;

    if (gnutls_init(&s, flags) < 0)
        return -ENOMEM;
    if (gnutls_priority_set_direct(s, datagrams ? PRIORITY_DATAGRAMS : PRIORITY_STREAM, NULL) < 0 ||
        gnutls_credentials_set(s, GNUTLS_CRD_CERTIFICATE, credentials->x509) < 0) {
        gnutls_deinit(s);
        return -ENOMEM;
    }
    if (server)
        gnutls_certificate_server_set_request(s, GNUTLS_CERT_REQUIRE);
    *out = s;
    return 0;
}

int link_session_verify(struct gnutls_session_int *s, char name[64], char why[256])
{
    unsigned status = 0, n = 0;
    const gnutls_datum_t *list;
    gnutls_x509_crt_t certificate;
    gnutls_datum_t text;
    size_t size = 64;
    int err = gnutls_certificate_verify_peers2(s, &status);

    if (err < 0 || status) {
        if (err < 0 || gnutls_certificate_verification_status_print(status, GNUTLS_CRT_X509, &text, 0) < 0) {
            snprintf(why, 256, "its certificate cannot be verified: %s", gnutls_strerror(err));
        } else {
            snprintf(why, 256, "%.*s", (int)text.size, text.data);
            gnutls_free(text.data);
        }
        return -EACCES;
    }
    list = gnutls_certificate_get_peers(s, &n);
    if (!list || !n || gnutls_x509_crt_init(&certificate) < 0)
        return -EACCES;
    err = gnutls_x509_crt_import(certificate, &list[0], GNUTLS_X509_FMT_DER);
    if (err >= 0)
        err = gnutls_x509_crt_get_dn_by_oid(certificate, GNUTLS_OID_X520_COMMON_NAME, 0, 0, name, &size);
    gnutls_x509_crt_deinit(certificate);
    if (err < 0) {
        snprintf(why, 256, "its certificate has no common name: %s", gnutls_strerror(err));
        return -EACCES;
    }
    return 0;
}

int link_session_judge(long n, char why[256])
{
    if (n == GNUTLS_E_AGAIN || n == GNUTLS_E_INTERRUPTED || !gnutls_error_is_fatal((int)n))
        return 0;
    snprintf(why, 256, "%s",
             n == GNUTLS_E_PREMATURE_TERMINATION                    ? "the connection was closed"
             : n == GNUTLS_E_PULL_ERROR || n == GNUTLS_E_PUSH_ERROR ? "the connection was reset"
                                                                    : gnutls_strerror((int)n));
    return n == GNUTLS_E_CERTIFICATE_REQUIRED || n == GNUTLS_E_NO_CERTIFICATE_FOUND ? -EACCES : -ECONNRESET;
}

#else

int link_credentials_create(struct link_credentials **out SST_UNUSED, const struct sst_array_config *array SST_UNUSED)
{
    sst_log_error("role: this build has no GnuTLS, by which hosts are connected: build with libmicrohttpd-dev and "
                  "libgnutls28-dev");
    return -ENOSYS;
}

void link_credentials_destroy(struct link_credentials *c SST_UNUSED)
{
}

#endif
