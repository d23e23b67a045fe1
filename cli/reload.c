/* sst reload: the service reads its configuration again, or reports the changes that this would make. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "cli/cli_internal.h"

static const char *meaning(const char *class_)
{
    if (!strcmp(class_, "live"))
        return "applies at once";
    if (!strcmp(class_, "restart-camera"))
        return "capturing restarts for a moment";
    if (!strcmp(class_, "restart-live"))
        return "the live picture restarts, capturing goes on";
    if (!strcmp(class_, "restart-daemon"))
        return "needs `systemctl restart sstd`";
    return class_;
}

static void print_changes(const json_t *answer, bool dry_run)
{
    const json_t *changes = cli_member(answer, "changes"), *one;
    size_t i;

    if (!json_array_size(changes)) {
        printf("nothing %s\n", dry_run ? "would change" : "changed");
        return;
    }
    json_array_foreach(changes, i, one)
    {
        char key[100], before[300], after[300], class_[40];

        cli_text(one, "before", before, sizeof(before));
        cli_text(one, "after", after, sizeof(after));
        cli_text(one, "takes", class_, sizeof(class_));
        printf("%-28s %s -> %s   (%s)\n", cli_text(one, "key", key, sizeof(key)), *before ? before : "\"\"",
               *after ? after : "\"\"", meaning(class_));
    }
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_client_service where = { 0 };
    bool dry_run = false, json = false;
    const struct cli_option options[] = {
        { "dry-run", 'n', CLI_FLAG, &dry_run, NULL, "print only the changes, and the parts that they restart" },
        { "json", 0, CLI_FLAG, &json, NULL, "the service's answer (docs/integrate/api.md)" },
        CLI_SERVICE_OPTIONS(where),
    };
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    json_t *request, *answer;
    int err;

    if (r != CLI_GO_ON)
        return r;
    request = json_pack("{s:b}", "dry_run", dry_run);
    err = request ? sst_client_ask(&where, "/api/v1/reload", request, &answer) : -ENOMEM;
    json_decref(request);
    if (err == -EBADMSG || err == -EBUSY) /* refused: nothing was changed, and the reason was logged */
        return CLI_INPUT;
    if (err)
        return cli_exit_code(err);
    if (json)
        return cli_print_json(answer);
    print_changes(answer, dry_run);
    json_decref(answer);
    return CLI_OK;
}

const struct cli_command cli_reload = { "reload", run };
