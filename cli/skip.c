/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include "cli/cli_internal.h"

/* The skip that the first n characters of a list name, or NULL. */
static const struct cli_skip *find(const struct cli_skip *skips, size_t count, const char *name, size_t n)
{
    for (size_t i = 0; i < count; i++) {
        if (strlen(skips[i].name) == n && !memcmp(skips[i].name, name, n))
            return &skips[i];
    }
    return NULL;
}

/* "a, b or none" */
static const char *names(char text[CLI_SKIP_TEXT], const struct cli_skip *skips, size_t count)
{
    size_t used = 0;

    text[0] = 0;
    for (size_t i = 0; i < count && used < CLI_SKIP_TEXT; i++)
        used += (size_t)snprintf(text + used, CLI_SKIP_TEXT - used, "%s, ", skips[i].name);
    if (used < CLI_SKIP_TEXT)
        snprintf(text + used, CLI_SKIP_TEXT - used, "all or none");
    return text;
}

int cli_read_skips(const struct cli_command *cmd, const char *option, const char *list, const struct cli_skip *skips,
                   size_t count)
{
    const bool all = list && !strcmp(list, "all");
    char text[CLI_SKIP_TEXT];

    if (!list)
        return CLI_GO_ON;
    for (size_t i = 0; i < count; i++)
        *skips[i].on = all;
    if (all || !strcmp(list, "none"))
        return CLI_GO_ON;
    for (const char *at = list;; at++) {
        const size_t n = strcspn(at, ",");
        const struct cli_skip *skip = find(skips, count, at, n);

        if (!skip)
            return cli_usage_error(cmd, "--%s %s: unknown `%.*s`; use %s", option, list, (int)n, at,
                                   names(text, skips, count));
        *skip->on = true;
        at += n;
        if (!*at)
            return CLI_GO_ON;
    }
}
