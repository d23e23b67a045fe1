/* Cryptography of Web Push: GnuTLS, and Nettle's P-256 for the agreement on a key, which GnuTLS offers since 3.8.2 only. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/push_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "daemon/publish/publish_internal.h"

static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";

void push_base64(char *out, const void *data, size_t n)
{
    const uint8_t *p = data;

    for (size_t i = 0; i < n; i += 3) {
        const uint32_t three = (uint32_t)p[i] << 16 | (i + 1 < n ? (uint32_t)p[i + 1] << 8 : 0) | (i + 2 < n ? p[i + 2] : 0);

        for (size_t k = 0; k < 4 && i + k <= n; k++)
            *out++ = digits[three >> (18 - 6 * k) & 63];
    }
    *out = 0;
}

bool push_from_base64(const char *text, uint8_t *out, size_t n)
{
    const size_t all = strcspn(text, "=");
    uint32_t bits = 0;
    size_t made = 0;
    int have = 0;

    if (all != (n * 4 + 2) / 3 || text[all + strspn(text + all, "=")])
        return false;
    for (size_t i = 0; i < all; i++) {
        const char c = text[i] == '+' ? '-' : text[i] == '/' ? '_' : text[i];
        const char *at = strchr(digits, c);

        if (!at)
            return false;
        bits = bits << 6 | (uint32_t)(at - digits);
        have += 6;
        if (have >= 8) {
            have -= 8;
            out[made++] = (uint8_t)(bits >> have);
        }
    }
    return made == n;
}

#if WITH_PUSH

#include <gnutls/abstract.h>
#include <gnutls/crypto.h>
#include <gnutls/gnutls.h>
#include <nettle/bignum.h>
#include <nettle/ecc-curve.h>
#include <nettle/ecc.h>

#define KEY_BYTES    4096
#define RECORD_BYTES 4096
#define TAG_BYTES    16

static int errno_of(int gnutls)
{
    return gnutls >= 0 ? 0 : gnutls == GNUTLS_E_MEMORY_ERROR ? -ENOMEM : -EBADMSG;
}

/* --- the service's key -------------------------------------------------------------------------------------------- */

static int make_key(const char *path)
{
    gnutls_x509_privkey_t key = NULL;
    gnutls_datum_t pem = { NULL, 0 };
    char *text;
    int err = errno_of(gnutls_x509_privkey_init(&key));

    err = err ? err : errno_of(gnutls_x509_privkey_generate(key, GNUTLS_PK_ECDSA, GNUTLS_CURVE_TO_BITS(GNUTLS_ECC_CURVE_SECP256R1), 0));
    err = err ? err : errno_of(gnutls_x509_privkey_export2_pkcs8(key, GNUTLS_X509_FMT_PEM, NULL, GNUTLS_PKCS_PLAIN, &pem));
    text = err ? NULL : strndup((const char *)pem.data, pem.size);
    err = err || text ? err : -ENOMEM;
    err = err ? err : http_write_private(path, text);
    free(text);
    gnutls_free(pem.data);
    gnutls_x509_privkey_deinit(key);
    if (err)
        sst_log_error("the key of notifications %s cannot be made: %s", path, strerror(-err));
    return err;
}

static int read_key(const char *path, gnutls_privkey_t *out)
{
    uint8_t *data;
    size_t size;
    int err = sst_file_read(path, KEY_BYTES, &data, &size);

    if (err)
        return err;
    err = errno_of(gnutls_privkey_init(out));
    if (!err) {
        const gnutls_datum_t pem = { data, (unsigned)size };

        err = errno_of(gnutls_privkey_import_x509_raw(*out, &pem, GNUTLS_X509_FMT_PEM, NULL, 0));
        if (err)
            gnutls_privkey_deinit(*out);
    }
    free(data);
    return err;
}

/* A number as PUSH_SECRET bytes; GnuTLS may give one more, or fewer. */
static void fixed(uint8_t *out, const gnutls_datum_t *n)
{
    const unsigned skip = n->size > PUSH_SECRET ? n->size - PUSH_SECRET : 0, size = n->size - skip;

    memset(out, 0, PUSH_SECRET);
    memcpy(out + PUSH_SECRET - size, n->data + skip, size);
}

int push_key(const char *path, uint8_t out[PUSH_POINT])
{
    gnutls_datum_t x = { NULL, 0 }, y = { NULL, 0 };
    gnutls_ecc_curve_t curve;
    gnutls_pubkey_t public = NULL;
    gnutls_privkey_t key;
    int err = sst_path_exists(path) ? 0 : make_key(path);

    err = err ? err : read_key(path, &key);
    if (err)
        return err;
    err = errno_of(gnutls_pubkey_init(&public));
    err = err ? err : errno_of(gnutls_pubkey_import_privkey(public, key, 0, 0));
    err = err ? err : errno_of(gnutls_pubkey_export_ecc_raw(public, &curve, &x, &y));
    if (!err && curve == GNUTLS_ECC_CURVE_SECP256R1) {
        out[0] = 4;
        fixed(out + 1, &x);
        fixed(out + 1 + PUSH_SECRET, &y);
    } else if (!err) {
        err = -EBADMSG;
    }
    gnutls_free(x.data);
    gnutls_free(y.data);
    gnutls_pubkey_deinit(public);
    gnutls_privkey_deinit(key);
    if (err)
        sst_log_error("%s has no key of P-256; move it away: a new one is made, and browsers subscribe again", path);
    return err;
}

/* --- tokens ------------------------------------------------------------------------------------------------------- */

/* Base64 of a JSON object. */
static int put_json(char *out, size_t size, json_t *o)
{
    char *text = o ? json_dumps(o, JSON_COMPACT) : NULL;
    const size_t n = text ? strlen(text) : 0;
    const bool fits = PUSH_BASE64(n) < size;

    if (text && fits)
        push_base64(out, text, n);
    free(text);
    json_decref(o);
    return !text ? -ENOMEM : fits ? 0 : -EMSGSIZE;
}

static int sign(const char *key_path, const char *text, uint8_t out[2 * PUSH_SECRET])
{
    const gnutls_datum_t data = { (unsigned char *)(uintptr_t)text, (unsigned)strlen(text) };
    gnutls_datum_t made = { NULL, 0 }, r = { NULL, 0 }, s = { NULL, 0 };
    gnutls_privkey_t key;
    int err = read_key(key_path, &key);

    if (err)
        return err;
    err = errno_of(gnutls_privkey_sign_data2(key, GNUTLS_SIGN_ECDSA_SHA256, 0, &data, &made));
    err = err ? err : errno_of(gnutls_decode_rs_value(&made, &r, &s));
    if (!err) {
        fixed(out, &r);
        fixed(out + PUSH_SECRET, &s);
    }
    gnutls_free(made.data);
    gnutls_free(r.data);
    gnutls_free(s.data);
    gnutls_privkey_deinit(key);
    return err;
}

int push_token(const char *key_path, const char *audience, const char *contact, int64_t until_s, char out[PUSH_TOKEN])
{
    uint8_t signature[2 * PUSH_SECRET];
    size_t n;
    int err = put_json(out, PUSH_TOKEN / 4, json_pack("{s:s, s:s}", "typ", "JWT", "alg", "ES256"));

    if (err)
        return err;
    n = strlen(out);
    out[n++] = '.';
    err = put_json(out + n, PUSH_TOKEN - n - PUSH_BASE64(sizeof(signature)) - 1,
                   json_pack("{s:s, s:I, s:s*}", "aud", audience, "exp", (json_int_t)until_s, "sub",
                             contact[0] ? contact : NULL));
    err = err ? err : sign(key_path, out, signature);
    if (err)
        return err;
    n = strlen(out);
    out[n++] = '.';
    push_base64(out + n, signature, sizeof(signature));
    return 0;
}

/* --- messages ----------------------------------------------------------------------------------------------------- */

static void random_bytes(void *arg SST_UNUSED, size_t n, uint8_t *out)
{
    if (gnutls_rnd(GNUTLS_RND_KEY, out, n) < 0)
        abort(); /* no source of randomness: nothing may be sent */
}

static void put_point(uint8_t out[PUSH_POINT], const struct ecc_point *p)
{
    mpz_t x, y;

    mpz_init(x);
    mpz_init(y);
    ecc_point_get(p, x, y);
    out[0] = 4;
    nettle_mpz_get_str_256(PUSH_SECRET, out + 1, x);
    nettle_mpz_get_str_256(PUSH_SECRET, out + 1 + PUSH_SECRET, y);
    mpz_clear(x);
    mpz_clear(y);
}

static bool read_point(struct ecc_point *p, const uint8_t in[PUSH_POINT])
{
    mpz_t x, y;
    bool good;

    nettle_mpz_init_set_str_256_u(x, PUSH_SECRET, in + 1);
    nettle_mpz_init_set_str_256_u(y, PUSH_SECRET, in + 1 + PUSH_SECRET);
    good = in[0] == 4 && ecc_point_set(p, x, y);
    mpz_clear(x);
    mpz_clear(y);
    return good;
}

bool push_point_good(const uint8_t point[PUSH_POINT])
{
    struct ecc_point p;
    bool good;

    ecc_point_init(&p, nettle_get_secp_256r1());
    good = read_point(&p, point);
    ecc_point_clear(&p);
    return good;
}

/* The sender's public point and the secret that both share: x of the product. */
static int agree(const uint8_t receiver[PUSH_POINT], const uint8_t *given, uint8_t public[PUSH_POINT], uint8_t shared[PUSH_SECRET])
{
    const struct ecc_curve *curve = nettle_get_secp_256r1();
    struct ecc_scalar secret;
    struct ecc_point p;
    uint8_t product[PUSH_POINT];
    int err = 0;

    ecc_scalar_init(&secret, curve);
    ecc_point_init(&p, curve);
    if (given) {
        mpz_t z;

        nettle_mpz_init_set_str_256_u(z, PUSH_SECRET, given);
        err = ecc_scalar_set(&secret, z) ? 0 : -EINVAL;
        mpz_clear(z);
    } else {
        ecc_scalar_random(&secret, NULL, random_bytes);
    }
    if (!err) {
        ecc_point_mul_g(&p, &secret);
        put_point(public, &p);
        err = read_point(&p, receiver) ? 0 : -EINVAL;
    }
    if (!err) {
        ecc_point_mul(&p, &secret, &p);
        put_point(product, &p);
        memcpy(shared, product + 1, PUSH_SECRET);
        gnutls_memset(product, 0, sizeof(product));
    }
    ecc_point_clear(&p);
    ecc_scalar_clear(&secret);
    return err;
}

/* HKDF of RFC 5869 with SHA-256. */
static int derive(const gnutls_datum_t *salt, const gnutls_datum_t *secret, const void *info, size_t info_bytes, const gnutls_datum_t *out)
{
    const gnutls_datum_t label = { (unsigned char *)(uintptr_t)info, (unsigned)info_bytes };
    uint8_t prk[32];
    const gnutls_datum_t key = { prk, sizeof(prk) };
    int err = errno_of(gnutls_hkdf_extract(GNUTLS_MAC_SHA256, secret, salt, prk));

    err = err ? err : errno_of(gnutls_hkdf_expand(GNUTLS_MAC_SHA256, &key, &label, out->data, out->size));
    gnutls_memset(prk, 0, sizeof(prk));
    return err;
}

/* Key and nonce of a message (RFC 8291, 3.4). */
static int derive_keys(const struct push_receiver *to, const uint8_t public[PUSH_POINT], const uint8_t shared[PUSH_SECRET],
                       const uint8_t salt[PUSH_SALT], uint8_t key_nonce[16 + 12])
{
    static const char info_key[] = "Content-Encoding: aes128gcm", info_nonce[] = "Content-Encoding: nonce";
    uint8_t info[14 + 2 * PUSH_POINT], ikm[32];
    const gnutls_datum_t auth = { (unsigned char *)(uintptr_t)to->auth, PUSH_AUTH };
    const gnutls_datum_t secret = { (unsigned char *)(uintptr_t)shared, PUSH_SECRET }, ikm_at = { ikm, sizeof(ikm) };
    const gnutls_datum_t salt_at = { (unsigned char *)(uintptr_t)salt, PUSH_SALT };
    const gnutls_datum_t key = { key_nonce, 16 }, nonce = { key_nonce + 16, 12 };
    int err;

    memcpy(info, "WebPush: info", 14);
    memcpy(info + 14, to->point, PUSH_POINT);
    memcpy(info + 14 + PUSH_POINT, public, PUSH_POINT);
    err = derive(&auth, &secret, info, sizeof(info), &ikm_at);
    err = err ? err : derive(&salt_at, &ikm_at, info_key, sizeof(info_key), &key);
    err = err ? err : derive(&salt_at, &ikm_at, info_nonce, sizeof(info_nonce), &nonce);
    gnutls_memset(ikm, 0, sizeof(ikm));
    return err;
}

static int seal(const uint8_t key_nonce[16 + 12], const char *text, uint8_t *out, size_t *bytes)
{
    const gnutls_datum_t key = { (unsigned char *)(uintptr_t)key_nonce, 16 };
    const size_t n = strlen(text);
    uint8_t plain[PUSH_TEXT_MOST + 1];
    gnutls_aead_cipher_hd_t cipher;
    int err = errno_of(gnutls_aead_cipher_init(&cipher, GNUTLS_CIPHER_AES_128_GCM, &key));

    if (err)
        return err;
    memcpy(plain, text, n);
    plain[n] = 2; /* the last record */
    err = errno_of(gnutls_aead_cipher_encrypt(cipher, key_nonce + 16, 12, NULL, 0, TAG_BYTES, plain, n + 1, out, bytes));
    gnutls_aead_cipher_deinit(cipher);
    return err;
}

int push_encrypt(const struct push_receiver *to, const char *text, const uint8_t *secret, const uint8_t *salt, uint8_t *out)
{
    uint8_t shared[PUSH_SECRET], key_nonce[16 + 12], *public = out + PUSH_SALT + 5;
    size_t bytes = PUSH_BODY_MOST - (PUSH_SALT + 5 + PUSH_POINT);
    int err;

    if (strlen(text) > PUSH_TEXT_MOST)
        return -EMSGSIZE;
    if (salt)
        memcpy(out, salt, PUSH_SALT);
    else
        random_bytes(NULL, PUSH_SALT, out);
    for (int i = 0; i < 4; i++)
        out[PUSH_SALT + i] = (uint8_t)(RECORD_BYTES >> (24 - 8 * i));
    out[PUSH_SALT + 4] = PUSH_POINT;
    err = agree(to->point, secret, public, shared);
    err = err ? err : derive_keys(to, public, shared, out, key_nonce);
    err = err ? err : seal(key_nonce, text, public + PUSH_POINT, &bytes);
    gnutls_memset(shared, 0, sizeof(shared));
    gnutls_memset(key_nonce, 0, sizeof(key_nonce));
    return err ? err : (int)(PUSH_SALT + 5 + PUSH_POINT + bytes);
}

#else

int push_key(const char *path SST_UNUSED, uint8_t out[PUSH_POINT] SST_UNUSED)
{
    return -ENOTSUP;
}

int push_token(const char *key_path SST_UNUSED, const char *audience SST_UNUSED, const char *contact SST_UNUSED,
               int64_t until_s SST_UNUSED, char out[PUSH_TOKEN] SST_UNUSED)
{
    return -ENOTSUP;
}

bool push_point_good(const uint8_t point[PUSH_POINT] SST_UNUSED)
{
    return false;
}

int push_encrypt(const struct push_receiver *to SST_UNUSED, const char *text SST_UNUSED, const uint8_t *secret SST_UNUSED,
                 const uint8_t *salt SST_UNUSED, uint8_t *out SST_UNUSED)
{
    return -ENOTSUP;
}

#endif
