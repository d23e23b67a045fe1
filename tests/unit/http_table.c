/* The table of routes and docs/integrate/api.md name exactly the same; texts of clients are taken apart rightly. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "daemon/publish/publish_internal.h"
#include "tests/test.h"

static const char *const roles[] = { "anyone", "view", "control" };

/* Table lines of docs/integrate/api.md: | `METHOD /path?query`, `METHOD /path` or `/path` | role | ... */
static int check_line(char *line, const struct sst_route *routes, int count, int *seen)
{
    char *role = strstr(line, "` |"), *end, *code = line;
    char method[8] = "";
    int named = 0;

    if (!role)
        return 0;
    *role = 0;
    role += 4;
    end = strchr(role, ' ');
    assert_non_null(end);
    *end = 0;
    while ((code = strchr(code, '`'))) {
        char *path = ++code;

        end = code + strcspn(code, "`");
        code = *end ? end + 1 : end;
        *end = 0;
        if (*path != '/') {
            assert_int_equal(sscanf(path, "%7s", method), 1);
            path = strchr(path, ' ');
            assert_non_null(path);
            path++;
        }
        path[strcspn(path, "?")] = 0;
        for (int i = 0; i < count; i++) {
            if (strcmp(routes[i].path, path) || strcmp(routes[i].method, method))
                continue;
            assert_string_equal(role, roles[routes[i].role]);
            seen[i]++;
            named++;
            path = NULL;
            break;
        }
        if (path)
            fail_msg("docs/integrate/api.md has %s %s, which is no route", method, path);
    }
    return named;
}

static void document_is_the_table(void **state)
{
    FILE *f = fopen("docs/integrate/api.md", "r");
    int seen[96] = { 0 }, count, named = 0;
    const struct sst_route *routes;
    char line[1024];

    (void)state;
    assert_non_null(f);
    routes = sst_http_routes(&count);
    assert_in_range(count, 1, ARRAY_LEN(seen));
    while (fgets(line, sizeof(line), f)) {
        if (!strncmp(line, "| `", 3))
            named += check_line(line, routes, count, seen);
    }
    fclose(f);
    for (int i = 0; i < count; i++) {
        if (seen[i] != 1)
            fail_msg("docs/integrate/api.md names %s %s %d times", routes[i].method, routes[i].path, seen[i]);
    }
    assert_int_equal(named, count);
}

static void paths(void **state)
{
    char name[HTTP_NAME_MAX + 1];
    char longest[HTTP_NAME_MAX + 2];

    (void)state;
    assert_true(http_path_matches("/", "/", name));
    assert_false(http_path_matches("/", "", name));
    assert_true(http_path_matches("/a/{x}/b", "/a/c.d-1_/b", name));
    assert_string_equal(name, "c.d-1_");
    assert_false(http_path_matches("/a/{x}/b", "/a//b", name));
    assert_false(http_path_matches("/a/{x}", "/a/b/c", name));
    assert_false(http_path_matches("/a/{x}", "/a/..", name));
    assert_false(http_path_matches("/a/{x}", "/a/b ", name));
    memset(longest, 'a', sizeof(longest));
    longest[HTTP_NAME_MAX + 1] = 0;
    assert_false(http_path_matches("{x}", longest, name));
    longest[HTTP_NAME_MAX] = 0;
    assert_true(http_path_matches("{x}", longest, name));
}

static void hosts(void **state)
{
    static const struct {
        const char *text, *host; /* NULL: malformed */
        int port;
    } cases[] = {
        { "a", "a", -1 },       { "A.b:1", "a.b", 1 },
        { "[::1]", "::1", -1 }, { "[::FFFF:1.2.3.4]:65535", "::ffff:1.2.3.4", 65535 },
        { "a.", "a", -1 },      { "", NULL, 0 },
        { ":80", NULL, 0 },     { "a:", NULL, 0 },
        { "a:0", NULL, 0 },     { "a:65536", NULL, 0 },
        { "a:8x", NULL, 0 },    { "[::1", NULL, 0 },
        { "[]", NULL, 0 },      { "a b", NULL, 0 },
        { "a/b", NULL, 0 },     { "u@a", NULL, 0 },
        { "[::1]x", NULL, 0 },  { "a:18446744073709551617", NULL, 0 },
    };
    char host[256];
    int port;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        assert_int_equal(http_host_split(cases[i].text, host, &port), cases[i].host != NULL);
        if (cases[i].host) {
            assert_string_equal(host, cases[i].host);
            assert_int_equal(port, cases[i].port);
        }
    }
    assert_true(http_same_origin("http://a", "a:80"));
    assert_true(http_same_origin("https://a:443", "a"));
    assert_false(http_same_origin("https://a", "a:80"));
    assert_false(http_same_origin("ftp://a", "a"));
    assert_false(http_same_origin("http://a/", "a"));
}

static void texts(void **state)
{
    static const struct {
        const char *body, *token;
    } forms[] = { { "token=abc", "abc" }, { "x=1&token=+a-b_+&y=2", "a-b_" },
                  { "token=", NULL },     { "token=a%20b", NULL },
                  { "xtoken=a", NULL },   { "", NULL },
                  { "&", NULL },          { "&&token=a", "a" },
                  { "toke", NULL } };
    char out[HTTP_TOKEN_MAX + 1];
    uint64_t n;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(forms); i++) {
        assert_int_equal(http_form_token(forms[i].body, strlen(forms[i].body), out), forms[i].token != NULL);
        if (forms[i].token)
            assert_string_equal(out, forms[i].token);
    }
    assert_true(http_etag_matches("W/\"a\", \"b\"", "\"b\""));
    assert_true(http_etag_matches("W/\"a\"", "\"a\""));
    assert_true(http_etag_matches("*", "\"a\""));
    assert_false(http_etag_matches("\"ab\"", "\"a\""));
    assert_false(http_etag_matches("", "\"a\""));
    assert_true(http_number("18446744073709551615", UINT64_MAX, &n) && n == UINT64_MAX);
    assert_false(http_number("18446744073709551616", UINT64_MAX, &n));
    assert_true(http_number("1000", 1000, &n) && n == 1000);
    assert_false(http_number("1001", 1000, &n));
    assert_false(http_number("", 1000, &n));
    assert_false(http_number("-1", 1000, &n));
    assert_false(http_number("1 ", 1000, &n));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(document_is_the_table),
        cmocka_unit_test(paths),
        cmocka_unit_test(hosts),
        cmocka_unit_test(texts),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
