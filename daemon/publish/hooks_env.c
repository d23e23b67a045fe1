/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/publish_internal.h"

#include <ctype.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#define VARIABLES_MAX 1024 /* of all */
#define VALUE_MAX     8192 /* bytes; longer values are left out: the kernel limits the environment */

extern char **environ;

struct env {
    char **list;
    int n;
    int fixed; /* of ours; the rest is the event's */
};

static int add(struct env *e, const char *name, const char *value)
{
    const size_t size = strlen(name) + 1 + strlen(value) + 1;
    char *text;

    if (e->n == VARIABLES_MAX || strlen(value) > VALUE_MAX)
        return 0;
    text = malloc(size);
    if (!text)
        return -1;
    snprintf(text, size, "%s=%s", name, value);
    e->list[e->n++] = text;
    return 0;
}

/* Variables of the service's environment that programs need; secrets and systemd's variables are not for them. */
static bool is_inherited(const char *variable)
{
    static const char *const names[] = { "PATH=", "HOME=", "USER=", "LOGNAME=", "SHELL=",
                                         "LANG=", "LC_",   "TZ=",   "TMPDIR=" };

    for (size_t i = 0; i < ARRAY_LEN(names); i++)
        if (!strncmp(variable, names[i], strlen(names[i])))
            return true;
    return false;
}

static int add_inherited(struct env *e)
{
    for (char **v = environ; v && *v && e->n < VARIABLES_MAX / 2; v++) {
        if (!is_inherited(*v))
            continue;
        e->list[e->n] = strdup(*v);
        if (!e->list[e->n])
            return -1;
        e->n++;
    }
    e->fixed = e->n;
    return 0;
}

/* A name that is there already stays: "message" in data does not replace the event's. */
static bool has(const struct env *e, const char *name)
{
    const size_t n = strlen(name);

    for (int i = e->fixed; i < e->n; i++)
        if (!strncmp(e->list[i], name, n) && e->list[i][n] == '=')
            return true;
    return false;
}

static int add_json(struct env *e, const char *key, const json_t *value)
{
    char name[64], *text;
    size_t n = 4;
    int err;

    strcpy(name, "SST_");
    for (; *key && n < sizeof(name) - 1; key++)
        name[n++] = isalnum((unsigned char)*key) ? (char)toupper((unsigned char)*key) : '_';
    name[n] = 0;
    if (has(e, name))
        return 0;
    if (json_is_string(value))
        return add(e, name, json_string_value(value));
    text = json_dumps(value, JSON_COMPACT | JSON_ENCODE_ANY | JSON_REAL_PRECISION(9));
    if (!text)
        return -1;
    err = add(e, name, text);
    free(text);
    return err;
}

static int add_event(struct env *e, const json_t *o)
{
    static const char *const members[][2] = { { "type", "event" }, { "level", "level" }, { "message", "message" },
                                              { "time", "time" },  { "id", "id" },       { "data", "data" } };
    const char *key;
    json_t *value;
    int err = 0;

    for (size_t i = 0; !err && i < ARRAY_LEN(members); i++) {
        value = json_object_get(o, members[i][0]);
        err = value ? add_json(e, members[i][1], value) : -1;
    }
    json_object_foreach(json_object_get(o, "data"), key, value) err = err ? err : add_json(e, key, value);
    return err;
}

char **hook_env(const char *event)
{
    json_t *o = json_loads(event, 0, NULL);
    struct env e = { .list = calloc(VARIABLES_MAX + 1, sizeof(*e.list)) };

    if (!o || !e.list || add_inherited(&e) || add_event(&e, o)) {
        hook_env_free(e.list);
        e.list = NULL;
    }
    json_decref(o);
    return e.list;
}

void hook_env_free(char **env)
{
    for (int i = 0; env && env[i]; i++)
        free(env[i]);
    free(env);
}
