/* Pure parsers for text from clients; no side effects. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "daemon/publish/publish_internal.h"

static bool name_char(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.';
}

bool http_path_matches(const char *pattern, const char *path, char *name)
{
    size_t n = 0;

    name[0] = 0;
    while (*pattern && *pattern != '{') {
        if (*pattern++ != *path++)
            return false;
    }
    if (!*pattern)
        return !*path;
    while (name_char(path[n]))
        n++;
    if (!n || n > HTTP_NAME_MAX || path[0] == '.')
        return false;
    pattern = strchr(pattern, '}') + 1;
    if (strcmp(pattern, path + n))
        return false;
    memcpy(name, path, n);
    name[n] = 0;
    return true;
}

static bool port_of(const char *text, int *port)
{
    uint64_t value;

    if (!*text) {
        *port = -1;
        return true;
    }
    if (*text != ':' || !http_number(text + 1, 65535, &value) || !value)
        return false;
    *port = (int)value;
    return true;
}

bool http_host_split(const char *text, char *host, int *port)
{
    const bool v6 = *text == '[';
    size_t n = 0;

    text += v6;
    while (text[n] && (v6 ? isxdigit((unsigned char)text[n]) || text[n] == ':' || text[n] == '.' : name_char(text[n])))
        n++;
    if (!n || n > 255 || (v6 && text[n] != ']') || !port_of(text + n + v6, port))
        return false;
    for (size_t i = 0; i < n; i++)
        host[i] = (char)tolower((unsigned char)text[i]);
    n -= !v6 && n > 1 && host[n - 1] == '.';
    host[n] = 0;
    return true;
}

bool http_url_host(const char *url, char *host)
{
    const char *at = strstr(url, "://");
    char text[300];
    int port;

    return at && snprintf(text, sizeof(text), "%.*s", (int)strcspn(at + 3, "/"), at + 3) < (int)sizeof(text) &&
           http_host_split(text, host, &port);
}

const char *http_target_path(const char *target, char authority[HTTP_AUTHORITY])
{
    const size_t scheme = !strncasecmp(target, "http://", 7) ? 7 : !strncasecmp(target, "https://", 8) ? 8 : 0;
    const char *path = target + scheme + strcspn(target + scheme, "/");

    authority[0] = 0;
    if (!scheme || path == target + scheme)
        return target;
    snprintf(authority, HTTP_AUTHORITY, "%.*s", (int)(path - target - scheme), target + scheme);
    return *path ? path : "/";
}

bool http_same_origin(const char *origin, const char *host)
{
    const bool tls = !strncmp(origin, "https://", 8);
    const int usual = tls ? 443 : 80;
    char a[256], b[256];
    int port_a, port_b;

    if (!tls && strncmp(origin, "http://", 7))
        return false;
    if (!http_host_split(origin + (tls ? 8 : 7), a, &port_a) || !http_host_split(host, b, &port_b))
        return false;
    return !strcmp(a, b) && (port_a < 0 ? usual : port_a) == (port_b < 0 ? usual : port_b);
}

bool http_form_token(const char *body, size_t size, char *out)
{
    const char *end = body + size, *at = body, *stop;

    while (at < end && (end - at < 6 || memcmp(at, "token=", 6))) {
        at = memchr(at, '&', (size_t)(end - at));
        if (!at)
            return false;
        at++;
    }
    if (end - at < 6)
        return false;
    at += 6;
    stop = memchr(at, '&', (size_t)(end - at));
    stop = stop ? stop : end;
    /* '+' is a blank: pasted along. */
    while (at < stop && *at == '+')
        at++;
    while (stop > at && stop[-1] == '+')
        stop--;
    if (stop == at || stop - at > HTTP_TOKEN_MAX)
        return false;
    for (const char *c = at; c < stop; c++) {
        if (!name_char(*c))
            return false;
    }
    memcpy(out, at, (size_t)(stop - at));
    out[stop - at] = 0;
    return true;
}

bool http_etag_matches(const char *if_none_match, const char *etag)
{
    const size_t n = strlen(etag);

    if (!strcmp(if_none_match, "*"))
        return true;
    while (*if_none_match) {
        if_none_match += strspn(if_none_match, " \t,");
        if (!strncmp(if_none_match, "W/", 2))
            if_none_match += 2;
        if (!strncmp(if_none_match, etag, n) && strchr(" \t,", if_none_match[n]))
            return true;
        if_none_match += strcspn(if_none_match, ",");
    }
    return false;
}

bool http_is_type(const char *content_type, const char *type)
{
    const size_t n = strlen(type);

    return !strncasecmp(content_type, type, n) && strchr("; \t", content_type[n]); /* the NUL counts */
}

/* The digits at the start; ERANGE: too large, the largest value. @return behind them */
static const char *read_place(const char *text, uint64_t *value)
{
    char *end = (char *)(uintptr_t)text;

    errno = 0;
    *value = isdigit((unsigned char)*text) ? strtoull(text, &end, 10) : 0;
    return end;
}

bool http_number(const char *text, uint64_t max, uint64_t *out)
{
    uint64_t value;

    if (!*text || *read_place(text, &value) || value > max || errno == ERANGE)
        return false;
    *out = value;
    return true;
}

enum http_range http_range_parse(const char *range, uint64_t size, uint64_t *first, uint64_t *bytes)
{
    uint64_t from = 0, to = UINT64_MAX;
    const char *at, *end;

    if (!range || strncasecmp(range, "bytes=", 6))
        return HTTP_RANGE_WHOLE;
    at = range + 6 + strspn(range + 6, " \t");
    end = read_place(at, &from);
    if (*end != '-')
        return HTTP_RANGE_WHOLE;
    range = read_place(end + 1, &to);
    if (range[strspn(range, " \t")] || (end == at && range == end + 1)) /* a comma: several */
        return HTTP_RANGE_WHOLE;
    if (end == at) { /* the last `to` bytes */
        if (!to)
            return HTTP_RANGE_BEYOND;
        if (!size)
            return HTTP_RANGE_WHOLE;
        *bytes = to < size ? to : size;
        *first = size - *bytes;
        return HTTP_RANGE_PART;
    }
    if (range == end + 1)
        to = UINT64_MAX;
    else if (to < from)
        return HTTP_RANGE_WHOLE;
    if (from >= size)
        return HTTP_RANGE_BEYOND;
    *first = from;
    *bytes = (to < size ? to + 1 : size) - from;
    return HTTP_RANGE_PART;
}

bool http_if_range(const char *if_range, const char *etag)
{
    return if_range[0] == '"' && !strcmp(if_range, etag);
}
