/* Answers of the service, read with a doubt about each member and shown to people. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cli/cli_internal.h"

const json_t *cli_member(const json_t *object, const char *path)
{
    while (object && *path) {
        const size_t n = strcspn(path, ".");
        char key[64];

        if (n >= sizeof(key))
            return NULL;
        memcpy(key, path, n);
        key[n] = 0;
        object = json_object_get(object, key);
        path += n + (path[n] == '.');
    }
    return object;
}

double cli_number(const json_t *object, const char *path)
{
    const json_t *member = cli_member(object, path);

    if (json_is_boolean(member))
        return json_is_true(member);
    return json_is_number(member) ? json_number_value(member) : (double)NAN;
}

const char *cli_text(const json_t *object, const char *path, char *buffer, size_t size)
{
    const char *text = json_string_value(cli_member(object, path));

    snprintf(buffer, size, "%s", text ? text : "");
    for (char *c = buffer; *c; c++) {
        if ((unsigned char)*c < ' ' || *c == 127)
            *c = '?';
        else if ((unsigned char)*c == 0xc2 && (unsigned char)c[1] >= 0x80 && (unsigned char)c[1] < 0xa0)
            c[0] = c[1] = '?'; /* U+0080..U+009F are control characters, too */
    }
    return buffer;
}

const char *cli_bytes_text(char buffer[CLI_SHORT], double bytes)
{
    static const char *const unit[] = { "B", "kB", "MB", "GB", "TB", "PB" };
    size_t i = 0;

    if (isnan(bytes))
        return strcpy(buffer, "?");
    for (; fabs(bytes) >= 999.5 && i + 1 < ARRAY_LEN(unit); i++)
        bytes /= 1000;
    snprintf(buffer, CLI_SHORT, i && fabs(bytes) < 99.95 ? "%.1f %s" : "%.0f %s", bytes, unit[i]);
    return buffer;
}

const char *cli_duration_text(char buffer[CLI_SHORT], double seconds)
{
    const double whole = floor(seconds), in_day = fmod(whole, 86400);
    const int h = (int)(in_day / 3600), m = (int)(fmod(in_day, 3600) / 60), s = (int)fmod(in_day, 60);

    if (!(fabs(seconds) < 1e11))
        return strcpy(buffer, "?");
    if (seconds < 60)
        snprintf(buffer, CLI_SHORT, "%.1f s", seconds);
    else if (seconds < 86400)
        snprintf(buffer, CLI_SHORT, "%d:%02d:%02d", h, m, s);
    else
        snprintf(buffer, CLI_SHORT, "%.0f d %02d:%02d", floor(whole / 86400), h, m);
    return buffer;
}
