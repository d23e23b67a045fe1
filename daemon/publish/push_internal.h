/* daemon/publish/push_internal.h - private declarations of push*.c. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_PUBLISH_PUSH_INTERNAL_H
#define SST_DAEMON_PUBLISH_PUSH_INTERNAL_H

#include <stdbool.h>

#include "daemon/publish/push.h"

/* --- push_crypto.c: keys, tokens and encrypted messages --- */

#define PUSH_POINT      65 /* bytes of an uncompressed point of P-256 */
#define PUSH_SECRET     32
#define PUSH_AUTH       16
#define PUSH_SALT       16
#define PUSH_TEXT_MOST  3000
#define PUSH_BODY_MOST  4096 /* which push services accept */
#define PUSH_TOKEN      1024
#define PUSH_BASE64(n)  (((n) * 4 + 2) / 3 + 1) /* bytes of the text, with its end */

/** Base64 for addresses (RFC 4648, 5), without padding. @param out  [PUSH_BASE64(n)] */
void push_base64(char *out, const void *data, size_t n);
/** @return true: the text is just n bytes, with or without padding */
bool push_from_base64(const char *text, uint8_t *out, size_t n);

/** Public key of the private one in a file, which is made if it is missing. @return 0 or -errno; logged */
SST_MUST_CHECK int push_key(const char *path, uint8_t out[PUSH_POINT]);

/** A token of RFC 8292. @param audience  origin of the endpoint @param contact  mailto: or https:; "": none @return 0 or
 *  -errno; not logged */
SST_MUST_CHECK int push_token(const char *key_path, const char *audience, const char *contact, int64_t until_s,
                              char out[PUSH_TOKEN]);

/** Keys of a receiver. */
struct push_receiver {
    uint8_t point[PUSH_POINT], auth[PUSH_AUTH];
};

/** Is it a point of the curve? */
bool push_point_good(const uint8_t point[PUSH_POINT]);

/**
 * Encrypt a message (RFC 8291, aes128gcm of RFC 8188, one record).
 * @param secret, salt  NULL: random; given by tests alone @param out  [PUSH_BODY_MOST] @return bytes or -errno; not logged
 */
SST_MUST_CHECK int push_encrypt(const struct push_receiver *to, const char *text, const uint8_t *secret,
                                const uint8_t *salt, uint8_t *out);

/* --- push_store.c: subscriptions on disk --- */

#define PUSH_ENDPOINT 1024
#define PUSH_LIST     512 /* bytes of a filter: names, each between commas; "": all */

struct push_subscription {
    char endpoint[PUSH_ENDPOINT];
    struct push_receiver to;
    char labels[PUSH_LIST], zones[PUSH_LIST];
    double cool_down_s;
    /* since the start */
    int64_t told_ns, line_ns; /* clock of the last message about a visit and a crossing; 0: none */
    char visit[64];           /* of the last message about a visit */
};

/** @param list  [SST_PUSH_MAX] @return number; damaged entries are left out, logged */
int push_read(const char *path, struct push_subscription *list);
SST_MUST_CHECK int push_write(const char *path, const struct push_subscription *list, int count);
/** {endpoint, p256dh, auth, labels, zones, cool_down_s} @return false: `error` is a sentence */
bool push_subscription_of(const json_t *o, struct push_subscription *out, char error[512]);

/* --- push_address.c: where messages may go --- */

/** Check an address. @param origin  out, its scheme and authority; host  out, its host without port @return 0, -EINVAL, -EACCES;
 *  `error` is a sentence */
SST_MUST_CHECK int push_check_endpoint(const struct sst_push_settings *s, const char *endpoint, char origin[300],
                                       char error[512]);
struct sockaddr;
/** Is it an address of this machine or of a private or special network (RFC 6890)? */
bool push_is_private(const struct sockaddr *address);

/* --- push_send.c: one request --- */

/** A message as it is sent. */
struct push_message {
    const char *endpoint, *authorization; /* "vapid t=..., k=..." */
    const uint8_t *body;
    size_t bytes;
    int ttl_s;
    const struct sst_push_settings *settings;
    bool (*go_on)(void *arg);
    void *arg;
};

/** POST it. @param retry_s  out: seconds that the server asks to wait; 0: none @return status of the answer, or -errno;
 *  why  out, with an error */
SST_MUST_CHECK int push_send(const struct push_message *m, int *retry_s, char why[160]);

#endif
