/* Values of XML Schema: times, durations; Base64. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "publishers/onvif/onvif_internal.h"

#define SECOND INT64_C(1000000000)
#define MOST_S (INT64_C(100) * 365 * 86400)

/* @return false: another character, or out of range */
static bool digits(const char **at, int count, int least, int most, int *out)
{
    int v = 0;

    for (int i = 0; i < count; i++) {
        if (!isdigit((unsigned char)(*at)[i]))
            return false;
        v = v * 10 + ((*at)[i] - '0');
    }
    *at += count;
    *out = v;
    return v >= least && v <= most;
}

static bool skip(const char **at, char c)
{
    const bool there = **at == c;

    *at += there;
    return there;
}

/* The zone at the end of a time, in minutes. */
static bool zone(const char *at, int *minutes)
{
    const int sign = *at == '-' ? -1 : 1;
    int h, m;

    *minutes = 0;
    if (!*at || !strcmp(at, "Z"))
        return true;
    if (*at != '+' && *at != '-')
        return false;
    at++;
    if (!digits(&at, 2, 0, 14, &h) || !skip(&at, ':') || !digits(&at, 2, 0, 59, &m))
        return false;
    *minutes = sign * (h * 60 + m);
    return !*at;
}

bool value_time(const char *text, int64_t *wall_ns)
{
    struct tm t = { 0 };
    int64_t part = 0, digit = SECOND / 10;
    int minutes;

    if (!digits(&text, 4, 1970, 2200, &t.tm_year) || !skip(&text, '-') || !digits(&text, 2, 1, 12, &t.tm_mon) ||
        !skip(&text, '-') || !digits(&text, 2, 1, 31, &t.tm_mday) || !skip(&text, 'T') ||
        !digits(&text, 2, 0, 24, &t.tm_hour) || !skip(&text, ':') || !digits(&text, 2, 0, 59, &t.tm_min) ||
        !skip(&text, ':') || !digits(&text, 2, 0, 60, &t.tm_sec))
        return false;
    if (skip(&text, '.'))
        for (; isdigit((unsigned char)*text); text++, digit /= 10)
            part += (*text - '0') * digit;
    if (!zone(text, &minutes))
        return false;
    t.tm_year -= 1900;
    t.tm_mon -= 1;
    *wall_ns = ((int64_t)timegm(&t) - minutes * 60) * SECOND + part;
    return true;
}

/* A number and its unit. @return false: neither follows */
static bool amount(const char **at, char unit, double seconds, double *sum)
{
    char *end;
    double v;

    if (!isdigit((unsigned char)**at) && **at != '.')
        return true;
    v = strtod(*at, &end);
    if (end - *at > 16 || strspn(*at, "0123456789.") != (size_t)(end - *at))
        return false;
    if (*end != unit)
        return true;
    *at = end + 1;
    *sum += v * seconds;
    return true;
}

bool value_duration(const char *text, int64_t *ns)
{
    double s = 0;
    const char *begin;

    if (!skip(&text, 'P') || !*text)
        return false;
    if (!amount(&text, 'Y', 365 * 86400.0, &s) || !amount(&text, 'M', 30 * 86400.0, &s) ||
        !amount(&text, 'D', 86400, &s))
        return false;
    begin = text;
    if (skip(&text, 'T') && (!amount(&text, 'H', 3600, &s) || !amount(&text, 'M', 60, &s) ||
                             !amount(&text, 'S', 1, &s) || text == begin + 1))
        return false;
    if (*text || s > (double)MOST_S)
        return false;
    *ns = (int64_t)(s * 1e9);
    return true;
}

/* --- Base64 ------------------------------------------------------------------------------------------------------- */

static const char alphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

int value_base64(const char *text, uint8_t *out, int room)
{
    uint32_t bits = 0;
    int n = 0, have = 0;

    for (; *text && *text != '='; text++) {
        const char *at = strchr(alphabet, *text);

        if (isspace((unsigned char)*text))
            continue;
        if (!at)
            return -1;
        bits = bits << 6 | (uint32_t)(at - alphabet);
        have += 6;
        if (have < 8)
            continue;
        have -= 8;
        if (n == room)
            return -1;
        out[n++] = (uint8_t)(bits >> have);
    }
    return text[strspn(text, "= \r\n\t")] ? -1 : n;
}

void value_to_base64(char *out, const uint8_t *data, int bytes)
{
    for (int i = 0; i < bytes; i += 3) {
        const uint32_t v = (uint32_t)data[i] << 16 | (uint32_t)(i + 1 < bytes ? data[i + 1] : 0) << 8 |
                           (i + 2 < bytes ? data[i + 2] : 0);

        *out++ = alphabet[v >> 18];
        *out++ = alphabet[v >> 12 & 63];
        *out++ = i + 1 < bytes ? alphabet[v >> 6 & 63] : '=';
        *out++ = i + 2 < bytes ? alphabet[v & 63] : '=';
    }
    *out = 0;
}
