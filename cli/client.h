/* cli/client.h - the service as its clients see it: HTTP with JSON over its UNIX socket, or over TCP with a token. */
#ifndef SST_CLI_CLIENT_H
#define SST_CLI_CLIENT_H

#include <jansson.h>

#include "cli/cli.h"

#define CLI_SERVICE_SOCKET "/run/sst/control.sock"

/** Where the service is; all NULL: its default socket. */
struct cli_service {
    const char *socket;     /* NULL: $SST_SOCKET, then CLI_SERVICE_SOCKET */
    const char *url;        /* http://HOST:PORT or https://...; NULL: the socket */
    const char *token_file; /* of TCP */
    const char *ca;         /* certificates (PEM) that https trusts; NULL: the system's */
};

/* Rows for a table of options. */
#define CLI_SERVICE_OPTIONS(s)                                                                                           \
    {                                                                                                                    \
        "socket", 0, CLI_STRING, &(s).socket, "PATH", "the service's socket ($SST_SOCKET, " CLI_SERVICE_SOCKET ")", 0, 0 \
    },                                                                                                                   \
        { "url", 0, CLI_STRING, &(s).url, "URL", "the service on another machine: http://HOST:PORT or https://", 0, 0 }, \
        { "token-file", 0, CLI_STRING, &(s).token_file, "FILE", "with --url: file that holds the token", 0, 0 },         \
    {                                                                                                                    \
        "ca", 0, CLI_STRING, &(s).ca, "FILE", "with https: certificate to trust, PEM", 0, 0                              \
    }

struct cli_client; /* opaque; one thread at a time */

/** @param where  its strings must stay @return 0, -EINVAL, -ENOENT... (token file), -ENOTSUP (built without libcurl),
 *          -ENOMEM; logged */
SST_MUST_CHECK int cli_client_open(struct cli_client **out, const struct cli_service *where);

/**
 * Ask, or tell: GET, or POST of `post` where that is not NULL.
 *
 * @param path  from "/", with its query
 * @param out   the answer, an object or array; a reference of the caller's
 * @return 0; -ENOPKG (no service there), -ETIMEDOUT (it does not answer within 15 s), -EACCES (no right), -EPROTO (the
 *         answer is no JSON), -ENOMEM; or what the service answered: -EBADMSG (400), -EACCES (401, 403), -ENOENT (404),
 *         -EBUSY (409, 429), -ENOTSUP (501), -ENODATA (503), -ENOSPC (507), -EPROTO (else). All logged in one sentence.
 */
SST_MUST_CHECK int cli_client_json(struct cli_client *client, const char *path, const json_t *post, json_t **out);

/** GET into a file, which appears whole or not at all. @param type  what it must be, "image/jpeg"
 *  @return as above (-EPROTO also: something else), and what sst_outfile_commit() returns */
SST_MUST_CHECK int cli_client_save(struct cli_client *client, const char *path, const char *type, const char *file);

/** Receives a line without its end; another value than 0 ends the transfer with it. */
typedef int cli_line_fn(void *arg, const char *line);

/** GET lines as they come, for as long as they come if `endless`. @return as above; 0: the service ended it */
SST_MUST_CHECK int cli_client_lines(struct cli_client *client, const char *path, bool endless, cli_line_fn *fn,
                                    void *arg);

void cli_client_close(struct cli_client *client); /* NULL is fine */

/** Open, ask as cli_client_json() does, and close. */
SST_MUST_CHECK int cli_service_json(const struct cli_service *where, const char *path, const json_t *post,
                                    json_t **out);

/* --- reading and showing answers -----------------------------------------------------------------------------------
 */

/** Member by its path, "capture.skew_us.p50"; NULL: there is none. Borrowed. */
const json_t *cli_member(const json_t *object, const char *path);
/** Number (also of true and false); NaN: there is none. */
double cli_number(const json_t *object, const char *path);
/** Text for people: control characters are shown as '?', so that no name can drive the terminal. "" if there is none.
 */
const char *cli_text(const json_t *object, const char *path, char *buffer, size_t size);

#define CLI_SHORT 32
/** "1.5 GB"; "?" for NaN. @return buffer */
const char *cli_bytes_text(char buffer[CLI_SHORT], double bytes);
/** "2 d 03:04", "3:04:05", "12.5 s"; "?" for NaN. @return buffer */
const char *cli_duration_text(char buffer[CLI_SHORT], double seconds);

#endif
