/* Keys and signatures: Ed25519 (RFC 8032) by GnuTLS. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <zlib.h>

#include "base/file.h"
#include "base/log.h"
#include "capture/evidence/evidence_internal.h"
#include "pipeline/kernels/sha256.h"

#define KEY_BYTES   4096
#define PIECE_BYTES ((size_t)1 << 20)

char *evidence_text(const json_t *manifest)
{
    return json_dumps(manifest, JSON_COMPACT | JSON_SORT_KEYS);
}

#if WITH_HTTPD

#include <gnutls/abstract.h>
#include <gnutls/crypto.h>
#include <gnutls/gnutls.h>

static int errno_of(int gnutls)
{
    return gnutls >= 0 ? 0 : gnutls == GNUTLS_E_MEMORY_ERROR ? -ENOMEM : -EBADMSG;
}

/* --- the private key ---------------------------------------------------------------------------------------------- */

/* Link, not rename: of two programs that make a key at once the first counts. */
static int write_key(const char *path, const gnutls_datum_t *pem)
{
    char fresh[SST_PATH_MAX + 16];
    int fd, err = 0;

    snprintf(fresh, sizeof(fresh), "%s.%ld", path, (long)getpid());
    (void)unlink(fresh);
    fd = open(fresh, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0)
        return -errno;
    errno = 0;
    if (write(fd, pem->data, pem->size) != (ssize_t)pem->size || fsync(fd))
        err = errno ? -errno : -ENOSPC;
    close(fd);
    if (!err && link(fresh, path) && errno != EEXIST)
        err = -errno;
    (void)unlink(fresh);
    return err;
}

static int make_key(const char *path)
{
    gnutls_x509_privkey_t key = NULL;
    gnutls_datum_t pem = { NULL, 0 };
    int err = errno_of(gnutls_x509_privkey_init(&key));

    err = err ? err : errno_of(gnutls_x509_privkey_generate(key, GNUTLS_PK_EDDSA_ED25519, 0, 0));
    err = err ? err : errno_of(gnutls_x509_privkey_export2_pkcs8(key, GNUTLS_X509_FMT_PEM, NULL, GNUTLS_PKCS_PLAIN, &pem));
    err = err ? err : write_key(path, &pem);
    if (pem.data)
        gnutls_memset(pem.data, 0, pem.size);
    gnutls_free(pem.data);
    gnutls_x509_privkey_deinit(key);
    if (err)
        sst_log_error("the signing key %s cannot be made: %s", path, strerror(-err));
    return err;
}

static int read_key(const char *path, gnutls_privkey_t *out)
{
    gnutls_datum_t pem;
    uint8_t *data;
    size_t size;
    int err = sst_path_exists(path) ? 0 : make_key(path);

    err = err ? err : sst_file_read(path, KEY_BYTES, &data, &size);
    if (err)
        return err;
    pem = (gnutls_datum_t){ data, (unsigned)size };
    err = errno_of(gnutls_privkey_init(out));
    if (!err) {
        err = errno_of(gnutls_privkey_import_x509_raw(*out, &pem, GNUTLS_X509_FMT_PEM, NULL, 0));
        if (err)
            gnutls_privkey_deinit(*out);
    }
    gnutls_memset(data, 0, size);
    free(data);
    if (err)
        sst_log_error("%s is no private key; restore it, or move it away: a new one is made then", path);
    return err;
}

static int export_public(gnutls_privkey_t key, char pem[SST_EVIDENCE_PEM])
{
    gnutls_pubkey_t public = NULL;
    gnutls_datum_t text = { NULL, 0 };
    int err = errno_of(gnutls_pubkey_init(&public));

    err = err ? err : errno_of(gnutls_pubkey_import_privkey(public, key, 0, 0));
    err = err ? err : errno_of(gnutls_pubkey_export2(public, GNUTLS_X509_FMT_PEM, &text));
    if (!err && text.size >= SST_EVIDENCE_PEM)
        err = -EBADMSG;
    if (!err) {
        memcpy(pem, text.data, text.size);
        pem[text.size] = 0;
    }
    gnutls_free(text.data);
    gnutls_pubkey_deinit(public);
    return err;
}

int sst_evidence_key(const char *path, char pem[SST_EVIDENCE_PEM], char print[SST_EVIDENCE_PRINT])
{
    gnutls_privkey_t key;
    int err = read_key(path, &key);

    if (err)
        return err;
    err = export_public(key, pem);
    gnutls_privkey_deinit(key);
    err = err ? err : evidence_print(pem, print);
    if (err)
        sst_log_error("%s has no key that can sign: %s", path, strerror(-err));
    return err;
}

/* --- signatures --------------------------------------------------------------------------------------------------- */

static int sign(gnutls_privkey_t key, const char *text, json_t **out)
{
    const gnutls_datum_t data = { (unsigned char *)(uintptr_t)text, (unsigned)strlen(text) };
    gnutls_datum_t made = { NULL, 0 }, base64 = { NULL, 0 };
    int err = errno_of(gnutls_privkey_sign_data2(key, GNUTLS_SIGN_EDDSA_ED25519, 0, &data, &made));

    err = err ? err : errno_of(gnutls_base64_encode2(&made, &base64));
    if (!err)
        *out = json_stringn((const char *)base64.data, base64.size);
    gnutls_free(made.data);
    gnutls_free(base64.data);
    return err || *out ? err : -ENOMEM;
}

static bool has_fraction(json_t *o)
{
    const char *key;
    bool found = json_is_real(o);
    json_t *one;
    size_t i;

    json_object_foreach(o, key, one)
        found |= has_fraction(one);
    json_array_foreach(o, i, one)
        found |= has_fraction(one);
    return found;
}

json_t *sst_evidence_sign(const char *path, json_t *manifest)
{
    char pem[SST_EVIDENCE_PEM], *text = evidence_text(manifest);
    json_t *signature = NULL;
    gnutls_privkey_t key;
    int err = text ? read_key(path, &key) : -ENOMEM;

    assert(!has_fraction(manifest));
    if (!err) {
        err = export_public(key, pem);
        err = err ? err : sign(key, text, &signature);
        gnutls_privkey_deinit(key);
        if (err)
            sst_log_error("%s cannot sign: %s", path, strerror(-err));
    }
    free(text);
    if (err) {
        json_decref(manifest);
        return NULL;
    }
    return json_pack("{s:o, s:s, s:o}", "manifest", manifest, "key", pem, "signature", signature);
}

static int import_public(const char *pem, gnutls_pubkey_t *out)
{
    const gnutls_datum_t data = { (unsigned char *)(uintptr_t)pem, (unsigned)strlen(pem) };
    int err = errno_of(gnutls_pubkey_init(out));

    if (err)
        return err;
    err = errno_of(gnutls_pubkey_import(*out, &data, GNUTLS_X509_FMT_PEM));
    if (!err && gnutls_pubkey_get_pk_algorithm(*out, NULL) != GNUTLS_PK_EDDSA_ED25519)
        err = -EBADMSG;
    if (err)
        gnutls_pubkey_deinit(*out);
    return err;
}

int evidence_print(const char *pem, char print[SST_EVIDENCE_PRINT])
{
    gnutls_datum_t der = { NULL, 0 };
    gnutls_pubkey_t key;
    int err = import_public(pem, &key);

    if (err)
        return err;
    err = errno_of(gnutls_pubkey_export2(key, GNUTLS_X509_FMT_DER, &der));
    if (!err)
        sst_sha256_hex(print, der.data, der.size);
    gnutls_free(der.data);
    gnutls_pubkey_deinit(key);
    return err;
}

int evidence_check(const char *pem, const char *text, const char *signature)
{
    const gnutls_datum_t data = { (unsigned char *)(uintptr_t)text, (unsigned)strlen(text) };
    const gnutls_datum_t base64 = { (unsigned char *)(uintptr_t)signature, (unsigned)strlen(signature) };
    gnutls_datum_t made = { NULL, 0 };
    gnutls_pubkey_t key;
    int err = import_public(pem, &key);

    if (err)
        return err;
    err = errno_of(gnutls_base64_decode2(&base64, &made));
    if (!err && gnutls_pubkey_verify_data2(key, GNUTLS_SIGN_EDDSA_ED25519, 0, &data, &made) < 0)
        err = -EKEYREJECTED;
    gnutls_free(made.data);
    gnutls_pubkey_deinit(key);
    return err;
}

/* --- hashes ------------------------------------------------------------------------------------------------------- */

static int read_part(const struct sst_evidence_part *p, gnutls_hash_hd_t hash, struct sst_evidence_hash *out)
{
    uint8_t *piece = malloc(PIECE_BYTES);
    int err = piece ? 0 : -ENOMEM;

    while (!err && out->bytes != p->bytes) {
        const int64_t left = p->bytes < 0 ? INT64_MAX : p->bytes - out->bytes;
        const size_t want = left < (int64_t)PIECE_BYTES ? (size_t)left : PIECE_BYTES;
        const ssize_t n = p->wanted && !p->wanted(p->arg) ? -2 : pread(p->fd, piece, want, p->at + out->bytes);

        if (n < 0 && (n == -2 || errno != EINTR))
            err = n == -2 ? -ECANCELED : -errno;
        if (!n && p->bytes >= 0)
            err = -EBADMSG;
        if (!n)
            break;
        if (n > 0) {
            gnutls_hash(hash, piece, (size_t)n);
            out->crc32 = (uint32_t)crc32(out->crc32, piece, (unsigned)n);
            out->bytes += n;
        }
    }
    free(piece);
    return err;
}

int sst_evidence_hash(const struct sst_evidence_part *part, struct sst_evidence_hash *out)
{
    uint8_t digest[32];
    gnutls_hash_hd_t hash;
    int err;

    *out = (struct sst_evidence_hash){ .crc32 = (uint32_t)crc32(0, NULL, 0) };
    if (gnutls_hash_init(&hash, GNUTLS_DIG_SHA256) < 0)
        return -ENOMEM;
    err = read_part(part, hash, out);
    gnutls_hash_deinit(hash, digest);
    for (size_t i = 0; i < sizeof(digest); i++)
        snprintf(out->sha256 + 2 * i, 3, "%02x", digest[i]);
    return err;
}

#else

int sst_evidence_key(const char *path SST_UNUSED, char pem[SST_EVIDENCE_PEM] SST_UNUSED,
                     char print[SST_EVIDENCE_PRINT] SST_UNUSED)
{
    sst_log_error("signing needs GnuTLS; install it and build again");
    return -ENOTSUP;
}

json_t *sst_evidence_sign(const char *path SST_UNUSED, json_t *manifest)
{
    sst_log_error("signing needs GnuTLS; install it and build again");
    json_decref(manifest);
    return NULL;
}

int evidence_print(const char *pem SST_UNUSED, char print[SST_EVIDENCE_PRINT] SST_UNUSED)
{
    return -ENOTSUP;
}

int evidence_check(const char *pem SST_UNUSED, const char *text SST_UNUSED, const char *signature SST_UNUSED)
{
    return -ENOTSUP;
}

int sst_evidence_hash(const struct sst_evidence_part *part SST_UNUSED, struct sst_evidence_hash *out SST_UNUSED)
{
    return -ENOTSUP;
}

#endif
