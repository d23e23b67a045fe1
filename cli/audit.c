/* sst audit: who has changed, deleted, exported and downloaded what. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "cli/cli_internal.h"

static int print_line(void *arg, const char *line)
{
    const bool *json = arg;
    char time[40], name[80], address[100], action[80], object[300];
    json_t *o = *json ? NULL : json_loads(line, 0, NULL);

    if (*json) {
        printf("%s\n", line);
        return 0;
    }
    cli_text(o, "time", time, sizeof(time));
    cli_text(o, "name", name, sizeof(name));
    cli_text(o, "address", address, sizeof(address));
    cli_text(o, "action", action, sizeof(action));
    cli_text(o, "object", object, sizeof(object));
    json_decref(o);
    printf("%s  %-16s %-16s %-12s %s\n", time, name, address, action, object);
    return 0;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_client_service where = { 0 };
    struct sst_client *client;
    bool json = false;
    double last = 100;
    const struct cli_option options[] = {
        { "last", 'n', CLI_DOUBLE, &last, "N", "so many of the newest; default: 100", 1, 10000 },
        { "json", 0, CLI_FLAG, &json, NULL, "a line of JSON each, as the file has them" },
        CLI_SERVICE_OPTIONS(where),
    };
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    char path[64];
    int err;

    if (r != CLI_GO_ON)
        return r;
    err = sst_client_open(&client, &where);
    if (err)
        return cli_exit_code(err);
    snprintf(path, sizeof(path), "/api/v1/audit?limit=%d", (int)last);
    err = sst_client_lines(client, path, false, print_line, &json);
    sst_client_close(client);
    return cli_exit_code(err);
}

const struct cli_command cli_audit = { "audit", run };
