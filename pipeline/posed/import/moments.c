/* Moments of views by a pattern of their pictures' names; times in names. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/log.h"
#include "pipeline/posed/import/import_internal.h"

#define CAMERA "{camera}"
#define MOMENT "{moment}"

/* Parts of a name that the pattern names. */
struct parts {
    const char *camera, *moment;
    size_t camera_bytes, moment_bytes;
    bool failed[256][256]; /* parts of pattern and name, by the bytes that are left, that do not match */
};

/* `*` and the named parts match any text, as short as the rest allows. */
static bool match(const char *pattern, const char *name, struct parts *p)
{
    const bool camera = !strncmp(pattern, CAMERA, strlen(CAMERA)), moment = !strncmp(pattern, MOMENT, strlen(MOMENT));
    const char *rest = pattern + (camera ? strlen(CAMERA) : moment ? strlen(MOMENT) : 1);

    if (!*pattern || p->failed[strlen(pattern)][strlen(name)])
        return !*pattern && !*name;
    if (!camera && !moment && *pattern != '*')
        return *name == *pattern && match(rest, name + 1, p);
    for (size_t n = *pattern == '*' ? 0 : 1; n <= strlen(name); n++) {
        if (!match(rest, name + n, p))
            continue;
        if (camera) {
            p->camera = name;
            p->camera_bytes = n;
        } else if (moment) {
            p->moment = name;
            p->moment_bytes = n;
        }
        return true;
    }
    p->failed[strlen(pattern)][strlen(name)] = true;
    return false;
}

static int occurrences(const char *text, const char *word)
{
    int n = 0;

    for (; (text = strstr(text, word)); text++)
        n++;
    return n;
}

static int compare(const void *a, const void *b)
{
    return natural_order(a, b);
}

/* Number the distinct texts in their natural order, from 1. */
static int number(struct sst_posed *posed, char (*text)[256])
{
    char(*sorted)[256] = malloc((size_t)posed->count * sizeof(*sorted));
    int distinct = 0;

    if (!sorted)
        return -ENOMEM;
    memcpy(sorted, text, (size_t)posed->count * sizeof(*sorted));
    qsort(sorted, (size_t)posed->count, sizeof(*sorted), compare);
    for (int k = 0; k < posed->count; k++) {
        if (!k || strcmp(sorted[k], sorted[distinct - 1]))
            memmove(sorted[distinct++], sorted[k], sizeof(*sorted));
    }
    for (int k = 0; k < posed->count; k++) {
        for (int i = 0; i < distinct; i++) {
            if (!strcmp(sorted[i], text[k]))
                posed->view[k].moment = i + 1;
        }
    }
    free(sorted);
    return 0;
}

/* Seconds of a date and time in a name, as cameras write them: YYYYMMDD and HHMMSS with one character between. */
static bool find_time(double *time_s, const char *name)
{
    for (const char *p = name; strlen(p) >= 15; p++) {
        int v[6], bytes = 0;
        char between;

        if (strspn(p, "0123456789") < 8 || strspn(p + 9, "0123456789") < 6)
            continue;
        if (sscanf(p, "%4d%2d%2d%c%2d%2d%2d%n", &v[0], &v[1], &v[2], &between, &v[3], &v[4], &v[5], &bytes) == 7 &&
            bytes == 15 && strchr("_-T ", between) && v[0] >= 1990 && v[0] < 2100 && v[1] >= 1 && v[1] <= 12 && v[2] >= 1 &&
            v[2] <= 31 && v[3] < 24 && v[4] < 60 && v[5] < 60) {
            struct tm t = { .tm_year = v[0] - 1900, .tm_mon = v[1] - 1, .tm_mday = v[2], .tm_hour = v[3], .tm_min = v[4],
                            .tm_sec = v[5] };

            *time_s = (double)timegm(&t);
            return true;
        }
    }
    return false;
}

void times_set(struct sst_posed *posed)
{
    double first = 0, time_s = 0;

    for (int k = 0; k < posed->count; k++) {
        if (!find_time(&time_s, posed->view[k].name))
            return;
    }
    for (int k = 0; k < posed->count; k++) {
        (void)find_time(&time_s, posed->view[k].name);
        first = k ? first : time_s;
        posed->view[k].time_s = time_s - first;
    }
}

int moments_set(struct sst_posed *posed, const char *pattern)
{
    char(*text)[256];
    int err = 0;

    if (strstr(pattern, CAMERA MOMENT) || strstr(pattern, MOMENT CAMERA)) {
        sst_log_error("--moments %s: between " CAMERA " and " MOMENT " must be a text that ends the first, as in "
                      CAMERA "_" MOMENT, pattern);
        return -EINVAL;
    }
    if (occurrences(pattern, MOMENT) != 1 || occurrences(pattern, CAMERA) > 1 || strlen(pattern) > 255) {
        sst_log_error("--moments %s does not have " MOMENT " once, and " CAMERA " at most once", pattern);
        return -EINVAL;
    }
    text = calloc((size_t)posed->count, sizeof(*text));
    if (!text)
        return -ENOMEM;
    for (int k = 0; !err && k < posed->count; k++) {
        struct sst_posed_view *v = &posed->view[k];
        struct parts p = { .camera = "" };

        if (!match(pattern, v->name, &p)) {
            sst_log_error("the picture %s does not match --moments %s", v->name, pattern);
            err = -EBADMSG;
            break;
        }
        memcpy(text[k], p.moment, p.moment_bytes);
        if (p.camera_bytes)
            snprintf(v->camera.name, sizeof(v->camera.name), "%.*s", (int)p.camera_bytes, p.camera);
    }
    err = err ? err : number(posed, text);
    free(text);
    return err;
}
