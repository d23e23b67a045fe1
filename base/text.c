/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/text.h"

#include <jansson.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void sst_text_add(char *text, size_t size, const char *fmt, ...)
{
    const size_t used = strlen(text);
    va_list args;

    va_start(args, fmt);
    vsnprintf(text + used, size - used, fmt, args);
    va_end(args);
}

bool sst_text_ends(const char *text, const char *end)
{
    const size_t n = strlen(text), m = strlen(end);

    return n > m && !strcmp(text + n - m, end);
}

void sst_text_make_utf8(char *text)
{
    json_t *probe = json_string(text);

    for (; !probe && *text; text++)
        *text = (unsigned char)*text < 0x80 ? *text : '?';
    json_decref(probe);
}

void sst_text_end_whole(char *text)
{
    const size_t n = strlen(text);
    size_t first = n;
    uint8_t lead;

    while (first > 0 && ((uint8_t)text[first - 1] & 0xc0) == 0x80)
        first--;
    lead = first ? (uint8_t)text[first - 1] : 0;
    if (lead >= 0xc0 && n - (first - 1) < (lead >= 0xf0 ? 4u : lead >= 0xe0 ? 3u : 2u))
        text[first - 1] = 0;
}
