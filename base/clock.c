/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _XOPEN_SOURCE 700 /* strptime */
#include "base/clock.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define STEP_NS   2000000000
#define STEADY_NS 600000000000

static int64_t read_ns(clockid_t id)
{
    struct timespec ts;

    clock_gettime(id, &ts);
    return (int64_t)ts.tv_sec * 1000000000 + ts.tv_nsec;
}

int64_t sst_clock_now_ns(void)
{
    return read_ns(CLOCK_MONOTONIC);
}

void sst_clock_sleep_until(int64_t t_ns)
{
    const struct timespec t = { .tv_sec = t_ns / 1000000000, .tv_nsec = t_ns % 1000000000 };

    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR)
        ;
}

int64_t sst_clock_cpu_ns(void)
{
    return read_ns(CLOCK_PROCESS_CPUTIME_ID);
}

int64_t sst_clock_wall_ns(void)
{
    return read_ns(CLOCK_REALTIME);
}

bool sst_clock_is_steady(struct sst_clock_watch *w)
{
    const int64_t now_ns = sst_clock_now_ns(), offset_ns = sst_clock_wall_ns() - now_ns;

    if (!w->since_ns || llabs(offset_ns - w->offset_ns) > STEP_NS)
        w->since_ns = now_ns;
    w->offset_ns = offset_ns;
    return now_ns - w->since_ns > STEADY_NS;
}

void sst_clock_text(char out[SST_CLOCK_TEXT], int64_t wall_ns)
{
    int64_t s = wall_ns / 1000000000, ns = wall_ns % 1000000000;
    struct tm tm = { 0 };
    char day[24];
    time_t t;

    if (ns < 0) {
        ns += 1000000000;
        s--;
    }
    t = (time_t)s;
    gmtime_r(&t, &tm);
    strftime(day, sizeof(day), "%Y-%m-%dT%H:%M:%S", &tm);
    snprintf(out, SST_CLOCK_TEXT, "%s.%03dZ", day, (int)(ns / 1000000));
}

static int days_of(int year, int month)
{
    static const int days[] = { 31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31 };

    if (month < 1 || month > 12)
        return 0;
    return days[month - 1] + (month == 2 && (year % 4 ? 0 : year % 100 ? 1 : year % 400 == 0));
}

bool sst_clock_begins_with_day(const char *text)
{
    static const char form[] = "dddd-dd-dd";
    int day;

    for (int i = 0; form[i]; i++) {
        if (form[i] == 'd' ? text[i] < '0' || text[i] > '9' : text[i] != form[i])
            return false;
    }
    day = atoi(text + 8);
    return day > 0 && day <= days_of(atoi(text), atoi(text + 5));
}

bool sst_clock_read(const char *text, int64_t *wall_ns)
{
    struct tm tm = { 0 };
    const char *end = text ? strptime(text, "%Y-%m-%dT%H:%M:%S", &tm) : NULL;
    double fraction = 0;
    char *after;

    if (!end)
        return false;
    if (*end == '.') {
        fraction = strtod(end, &after);
        end = after;
    }
    if (strcmp(end, "Z") || !(fraction >= 0 && fraction < 1) || tm.tm_year < 70 || tm.tm_year > 200 ||
        tm.tm_mday > days_of(tm.tm_year + 1900, tm.tm_mon + 1)) /* timegm() would carry it into the next month */
        return false;
    *wall_ns = (int64_t)timegm(&tm) * 1000000000 + (int64_t)(fraction * 1e9);
    return true;
}
