/* tests/test.h - cmocka, with the headers that it needs before it, the choice of tests by name, and one more assertion. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_TEST_H
#define SST_TESTS_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/traps.h"

/** Whether `names`, separated by spaces, has this name. */
static inline bool test_is_named(const char *names, const char *name)
{
    const size_t n = strlen(name);

    for (const char *at = names; (at = strstr(at, name)) != NULL; at += n)
        if ((at == names || at[-1] == ' ') && (at[n] == ' ' || at[n] == '\0'))
            return true;
    return false;
}

/** Runs a group of tests, or those alone that SST_TESTS names ("name name"). Returns cmocka's count of failures. */
static inline int test_run_group(const char *group, const struct CMUnitTest *tests, size_t n, CMFixtureFunction set_up,
                                 CMFixtureFunction tear_down)
{
    const char *names = getenv("SST_TESTS");
    struct CMUnitTest *chosen;
    size_t count = 0;
    int rc;

    if (!names)
        return _cmocka_run_group_tests(group, tests, n, set_up, tear_down);
    chosen = calloc(n, sizeof(*chosen));
    if (!chosen)
        return 1;
    for (size_t i = 0; i < n; i++)
        if (test_is_named(names, tests[i].name))
            chosen[count++] = tests[i];
    rc = count ? _cmocka_run_group_tests(group, chosen, count, set_up, tear_down) : 0;
    free(chosen);
    return rc;
}

#undef cmocka_run_group_tests
#define cmocka_run_group_tests(tests, set_up, tear_down)                                                               \
    test_run_group(#tests, tests, sizeof(tests) / sizeof((tests)[0]), set_up, tear_down)

/** The text has these words in it. */
#define assert_contains(text, words)                                                                                   \
    do {                                                                                                               \
        if (!strstr(text, words))                                                                                      \
            fail_msg("no '%s' in: %s", words, text);                                                                   \
    } while (0)

#endif
