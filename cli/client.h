/* cli/client.h - options that name the service, and its answers shown to people. */
#ifndef SST_CLI_CLIENT_H
#define SST_CLI_CLIENT_H

#include <jansson.h>

#include "cli/cli.h"
#include "client/client.h"

/* Rows for a table of options. */
#define CLI_SERVICE_OPTIONS(s)                                                                                           \
    {                                                                                                                    \
        "socket", 0, CLI_STRING, &(s).socket, "PATH", "the service's socket ($SST_SOCKET, " SST_CLIENT_SOCKET ")", 0, 0  \
    },                                                                                                                   \
        { "url", 0, CLI_STRING, &(s).url, "URL", "the service on another machine: http://HOST:PORT or https://", 0, 0 }, \
        { "token-file", 0, CLI_STRING, &(s).token_file, "FILE", "with --url: file that holds the token", 0, 0 },         \
    {                                                                                                                    \
        "ca", 0, CLI_STRING, &(s).ca, "FILE", "with https: certificate to trust, PEM", 0, 0                              \
    }

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
