/* sst events: past events of the service, and new ones as they come. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "cli/cli_internal.h"

#define LAST 10 /* past events shown with --follow */

struct show {
    bool json;
    uint64_t last;    /* id of the newest that was read */
    int held;         /* lines held back: the last ones of a longer list */
    char *ring[LAST]; /* of these, by turns */
    bool hold;
    const char *type; /* NULL: all */
};

static int print_line(const struct show *s, const json_t *event, const char *line)
{
    char time[40], level[16], type[40], message[400];

    if (s->json) {
        printf("%s\n", line);
    } else {
        cli_text(event, "time", time, sizeof(time));
        cli_text(event, "level", level, sizeof(level));
        cli_text(event, "type", type, sizeof(type));
        cli_text(event, "message", message, sizeof(message));
        printf("%s  %-7s  %-14s %s\n", time, level, type, message);
    }
    return cli_flush() ? -EPIPE : 0;
}

static int on_line(void *arg, const char *line)
{
    struct show *s = arg;
    json_t *event = json_loads(line, 0, NULL);
    const json_t *id = cli_member(event, "id");
    char type[40];
    int err = 0;

    if (!json_is_integer(id) || json_integer_value(id) < 0) {
        sst_log_error("the service sent a line that is not an event: %.60s", line);
        err = -EPROTO;
    } else {
        s->last = (uint64_t)json_integer_value(id);
        if (s->type && strcmp(s->type, cli_text(event, "type", type, sizeof(type))) != 0) {
            /* of no interest */
        } else if (s->hold) {
            char *copy = strdup(line);

            free(s->ring[s->held % LAST]);
            s->ring[s->held++ % LAST] = copy;
            err = copy ? 0 : -ENOMEM;
        } else {
            err = print_line(s, event, line);
        }
    }
    json_decref(event);
    return err;
}

static int show_held(struct show *s)
{
    int err = 0;

    s->hold = false;
    for (int i = s->held > LAST ? s->held - LAST : 0; !err && i < s->held; i++)
        err = on_line(s, s->ring[i % LAST]);
    for (int i = 0; i < LAST; i++)
        free(s->ring[i]);
    return err;
}

/* Journal of the service, page by page. */
static int read_kept(struct sst_client *client, struct show *s)
{
    uint64_t before;
    int err;

    do {
        char path[80];

        before = s->last;
        snprintf(path, sizeof(path), "/api/v1/events?after=%" PRIu64, before);
        err = sst_client_lines(client, path, false, on_line, s);
    } while (!err && s->last > before);
    return err;
}

static int follow(struct sst_client *client, struct show *s)
{
    char path[80];
    int err;

    snprintf(path, sizeof(path), "/api/v1/events/stream?after=%" PRIu64, s->last);
    err = sst_client_lines(client, path, true, on_line, s);
    if (!err) {
        sst_log_error("the service ended the events: it stops or restarts; see `systemctl status sstd`");
        err = -ENOPKG;
    }
    return err;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_client_service where = { 0 };
    struct show s = { 0 };
    bool go_on = false;
    double after = -1;
    const struct cli_option options[] = {
        { "follow", 'f', CLI_FLAG, &go_on, NULL, "the last ten, and then all as they come" },
        { "after", 0, CLI_DOUBLE, &after, "ID", "events after this one; --follow then begins there", 0, 9e15 },
        { "type", 0, CLI_STRING, &s.type, "TYPE",
          "only of this type: camera-lost, record-start ... (docs/integrate/api.md)" },
        { "json", 0, CLI_FLAG, &s.json, NULL, "a line of JSON each, as the service sends them" },
        CLI_SERVICE_OPTIONS(where),
    };
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    struct sst_client *client;
    int err;

    if (r != CLI_GO_ON)
        return r;
    err = sst_client_open(&client, &where);
    if (err)
        return cli_exit_code(err);
    s.last = after > 0 ? (uint64_t)after : 0;
    s.hold = go_on && after < 0;
    err = read_kept(client, &s);
    err = err ? err : show_held(&s);
    if (!err && go_on)
        err = follow(client, &s);
    sst_client_close(client);
    return cli_exit_code(err);
}

const struct cli_command cli_events = { "events", run };
