/* sst token: named tokens of the service, through it or in its file. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/edit_distance.h"
#include "base/log.h"
#include "capture/access/access.h"
#include "cli/cli_internal.h"
#include "config/sstd.h"

struct args {
    struct sst_client_service where;
    const char *config, *name, *expires;
    unsigned rights;
    int64_t expires_s; /* from now; 0: never */
    bool offline, json;
    char path[SST_PATH_MAX]; /* of the file, offline */
};

/* --- the service's file ------------------------------------------------------------------------------------------- */

static int find_file(struct args *a)
{
    struct sst_config *cfg = calloc(1, sizeof(*cfg));
    int err = cfg ? 0 : -ENOMEM;

    if (!err) {
        sst_config_defaults(cfg);
        err = sst_config_read(cfg, a->config);
    }
    if (!err)
        snprintf(a->path, sizeof(a->path), "%s.named", cfg->web.token_file);
    free(cfg);
    return err;
}

/* Audit line of a change to the file without the service. The change stays where the line cannot be written. */
static void note(const struct args *a, const char *object)
{
    char path[SST_PATH_MAX], name[32];
    const struct sst_audit line = { .name = name, .address = "file", .action = "tokens", .object = object };

    snprintf(name, sizeof(name), "uid %u", (unsigned)getuid());
    snprintf(path, sizeof(path), "%.*s.audit", (int)(strlen(a->path) - strlen(".named")), a->path);
    if (sst_audit_write(path, &line))
        sst_log_warning("audit log %s cannot be written", path);
}

/* Ask the service; where none runs, and none was named, its file is the answer. @return 1: the file */
static int ask(struct args *a, const char *path, json_t *request, json_t **out)
{
    const bool named = a->where.socket || a->where.url || getenv("SST_SOCKET");
    char held[SST_LOG_MAX] = "";
    int err = 1;

    if (!a->offline) {
        sst_log_hold_errors(held);
        err = sst_client_ask(&a->where, path, request, out);
        sst_log_hold_errors(NULL);
    }
    json_decref(request);
    if (err == -ENOPKG && !named)
        err = 1;
    if (err < 0)
        sst_log_error("%s", held);
    if (err == 1 && find_file(a))
        return -EBADMSG;
    return err;
}

static int refuse(int err, const char *error)
{
    sst_log_error("token: %s", error);
    return err;
}

/* --- actions ------------------------------------------------------------------------------------------------------ */

static int add(struct args *a)
{
    struct sst_access_token token = { .rights = a->rights };
    char secret[SST_ACCESS_SECRET], error[256], object[128], rights[SST_ACCESS_TEXT];
    json_t *answer = NULL;
    int err = ask(a, "/api/v1/tokens",
                  json_pack("{s:s, s:o, s:o}", "name", a->name, "rights", sst_access_rights_json(a->rights), "expires_s",
                            a->expires_s ? json_integer(a->expires_s) : json_null()),
                  &answer);

    if (err == 1) {
        snprintf(token.name, sizeof(token.name), "%s", strlen(a->name) <= SST_ACCESS_NAME ? a->name : "");
        token.expires_s = a->expires_s ? sst_clock_wall_ns() / 1000000000 + a->expires_s : 0;
        err = sst_access_add(a->path, &token, secret, error);
        if (err)
            return refuse(err, error);
        snprintf(object, sizeof(object), "add %s %s", token.name, sst_access_rights_text(a->rights, rights));
        note(a, object);
        answer = json_pack("{s:s, s:s}", "name", token.name, "token", secret);
    }
    if (err)
        return err;
    if (a->json)
        return cli_print_json(answer) ? -ENOMEM : 0;
    printf("%s\n", json_string_value(json_object_get(answer, "token")));
    json_decref(answer);
    return 0;
}

static int revoke_one(struct args *a)
{
    char error[256], object[128], path[128];
    json_t *answer = NULL;
    int err;

    snprintf(path, sizeof(path), "/api/v1/tokens/%.64s", a->name);
    err = ask(a, path, json_pack("{s:b}", "revoke", 1), &answer);
    json_decref(answer);
    if (err != 1)
        return err;
    err = sst_access_revoke(a->path, a->name, error);
    if (err)
        return refuse(err, error);
    snprintf(object, sizeof(object), "revoke %.32s", a->name);
    note(a, object);
    return 0;
}

static void print_one(const json_t *t)
{
    const json_t *rights = json_object_get(t, "rights"), *word;
    char text[64] = "", name[64], expires[40];
    unsigned bits = 0;
    size_t i;

    json_array_foreach(rights, i, word)
    {
        bits |= json_is_string(word) ? sst_access_right(json_string_value(word), json_string_length(word)) : 0;
    }
    cli_text(t, "name", name, sizeof(name));
    cli_text(t, "expires", expires, sizeof(expires));
    printf("%-20s %-36s %s%s\n", name, sst_access_rights_text(bits, text), *expires ? expires : "never",
           json_is_true(json_object_get(t, "expired")) ? "  expired" : "");
}

static int list(struct args *a)
{
    struct sst_access_list all;
    json_t *answer = NULL, *one;
    char error[256];
    size_t i;
    int err = ask(a, "/api/v1/tokens", NULL, &answer);

    if (err == 1) {
        err = sst_access_read(&all, a->path, error);
        if (err)
            return refuse(err, error);
        answer = json_pack("{s:o}", "tokens", sst_access_json(&all, sst_clock_wall_ns() / 1000000000));
    }
    if (err)
        return err;
    if (a->json)
        return cli_print_json(answer) ? -ENOMEM : 0;
    if (json_array_size(json_object_get(answer, "tokens")))
        printf("%-20s %-36s %s\n", "name", "rights", "expires");
    json_array_foreach(json_object_get(answer, "tokens"), i, one)
    {
        print_one(one);
    }
    json_decref(answer);
    return 0;
}

/* --- command line ------------------------------------------------------------------------------------------------- */

/* "30d", "12h", "90m"; "never" is 0. @return false: none of these */
static bool read_span(const char *text, int64_t *out)
{
    char *end;
    const double n = strtod(text, &end);
    const double unit = *end == 'd' ? 86400 : *end == 'h' ? 3600 : *end == 'm' ? 60 : 0;

    *out = 0;
    if (!strcmp(text, "never"))
        return true;
    if (end == text || !(n > 0) || unit == 0 || end[1] || !(n * unit <= INT32_MAX) || n * unit < 1)
        return false;
    *out = (int64_t)(n * unit);
    return true;
}

static const struct {
    const char *name;
    int (*run)(struct args *a);
    bool named;
} actions[] = { { "add", add, true }, { "list", list, false }, { "revoke", revoke_one, true } };

/* @return CLI_GO_ON, or the exit code of an error of usage */
static int check(const struct cli_command *cmd, struct args *a, const char *action, const char *rights)
{
    const bool adds = !strcmp(action, "add");

    if (!adds && (rights || a->expires))
        return cli_usage_error(cmd, "%s belongs to add", rights ? "--rights" : "--expires");
    if (!adds)
        return CLI_GO_ON;
    if (!rights)
        return cli_usage_error(cmd, "add needs --rights, one or more of view, snapshot, recordings, control");
    a->rights = sst_access_rights(rights);
    if (!a->rights)
        return cli_usage_error(cmd, "--rights %s: use one or more of view, snapshot, recordings, control, separated by commas",
                               rights);
    if (a->expires && !read_span(a->expires, &a->expires_s))
        return cli_usage_error(cmd, "--expires %s: give days, hours or minutes like 30d, 12h, 90m, or never", a->expires);
    return CLI_GO_ON;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    const char *words[2], *rights = NULL, *names[ARRAY_LEN(actions) + 1] = { NULL };
    struct args a = { 0 };
    const struct cli_option options[] = {
        { "rights", 0, CLI_STRING, &rights, "LIST", "add: view, snapshot, recordings, control; separated by commas" },
        { "expires", 0, CLI_STRING, &a.expires, "TIME", "add: from now, like 30d, 12h, 90m; default: never" },
        { "config", 0, CLI_FILE, &a.config, "FILE", "without the service: change the file of this configuration" },
        { "json", 0, CLI_FLAG, &a.json, NULL, "the service's answer (docs/integrate/api.md)" },
        CLI_SERVICE_OPTIONS(a.where),
    };
    int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, words, 1, 2);

    if (r != CLI_GO_ON)
        return r;
    a.name = words[1];
    a.offline = a.config != NULL;
    for (size_t i = 0; i < ARRAY_LEN(actions); i++) {
        names[i] = actions[i].name;
        if (strcmp(words[0], actions[i].name) != 0)
            continue;
        if (actions[i].named != (a.name != NULL))
            return a.name ? cli_usage_error(cmd, "%s takes no name: %s", words[0], a.name)
                          : cli_usage_error(cmd, "%s needs a NAME", words[0]);
        if (a.name && (!*a.name || a.name[strspn(a.name, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.")]))
            return cli_usage_error(cmd, "%s: a name has letters, digits, - _ .", a.name);
        r = check(cmd, &a, words[0], rights);
        return r != CLI_GO_ON ? r : cli_exit_code(actions[i].run(&a));
    }
    return cli_usage_error(cmd, "unknown action %s;%s use add, list or revoke", words[0],
                           sst_edit_hint(words[0], names));
}

const struct cli_command cli_token = { "token", run };
