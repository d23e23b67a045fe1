/* client/client.h - client of the service's HTTP API: JSON, files, lines and picture streams, over its UNIX socket or
 * TCP. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CLIENT_CLIENT_H
#define SST_CLIENT_CLIENT_H

#include <stdbool.h>

#include <jansson.h>

#include "base/base.h"

#define SST_CLIENT_SOCKET "/run/sst/control.sock"

/** Where the service is; all NULL: its default socket. */
struct sst_client_service {
    const char *socket;     /* NULL: $SST_SOCKET, then SST_CLIENT_SOCKET */
    const char *url;        /* http://HOST:PORT or https://...; NULL: the socket */
    const char *token_file; /* of TCP */
    const char *ca;         /* certificates (PEM) that https trusts; NULL: the system's */
};

struct sst_client; /* opaque; one thread at a time */

/** @param where  its strings must outlive the client
 *  @return 0, -EINVAL, -ENOENT... (token file), -ENOTSUP (no libcurl), -ENOMEM; logged */
SST_MUST_CHECK int sst_client_open(struct sst_client **out, const struct sst_client_service *where);

/**
 * GET, or POST of `post` if it is not NULL.
 *
 * @param path  from "/", with its query
 * @param out   the answer, an object or array; the caller owns a reference
 * @return 0; -ENOPKG (no service there), -ETIMEDOUT (no answer within 15 s), -EACCES (no right), -EPROTO (not JSON),
 *         -ENOMEM; or by the status of the answer: -EBADMSG (400), -EACCES (401, 403), -ENOENT (404),
 *         -EBUSY (409, 429), -ENOTSUP (501), -ENODATA (503), -ENOSPC (507), -EPROTO (else). All logged in one sentence.
 */
SST_MUST_CHECK int sst_client_json(struct sst_client *client, const char *path, const json_t *post, json_t **out);

/** GET into a file, which appears whole or not at all. @param type  required Content-Type, "image/jpeg"
 *  @return as sst_client_json() (-EPROTO also: another type), and errors of sst_outfile_commit() */
SST_MUST_CHECK int sst_client_save(struct sst_client *client, const char *path, const char *type, const char *file);

/** GET into memory. @param data  out, to free with free() @return as sst_client_json() */
SST_MUST_CHECK int sst_client_bytes(struct sst_client *client, const char *path, uint8_t **data, size_t *bytes);

/** Receives a line without its end; a value other than 0 ends the transfer with it. */
typedef int sst_client_line_fn(void *arg, const char *line);

/** GET lines as they arrive, without a time limit if `endless`. @return as sst_client_json(); 0: the service ended it
 */
SST_MUST_CHECK int sst_client_lines(struct sst_client *client, const char *path, bool endless, sst_client_line_fn *fn,
                                    void *arg);

/** One picture of a stream. */
struct sst_client_picture {
    const uint8_t *data; /* JPEG; valid during the call */
    size_t bytes;
    uint64_t set;    /* X-Sst-Set: index of the trigger that it shows */
    int64_t wall_ns; /* X-Timestamp: time of the picture's set; 0: not given */
};

/** Receives a picture; a value other than 0 ends the transfer with it. */
typedef int sst_client_picture_fn(void *arg, const struct sst_client_picture *picture);

/** GET a multipart stream of JPEGs until it ends. @return as sst_client_json(); 0: the service ended it */
SST_MUST_CHECK int sst_client_stream(struct sst_client *client, const char *path, sst_client_picture_fn *fn, void *arg);

/** Called about once a second during each transfer; false ends it with -ECANCELED. */
typedef bool sst_client_continue_fn(void *arg);
void sst_client_set_continue(struct sst_client *client, sst_client_continue_fn *fn, void *arg);

void sst_client_close(struct sst_client *client); /* NULL is fine */

/** Open, call sst_client_json(), and close. */
SST_MUST_CHECK int sst_client_ask(const struct sst_client_service *where, const char *path, const json_t *post,
                                  json_t **out);

#endif
