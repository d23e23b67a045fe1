/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/log.h"

#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static _Atomic int level_shown = SST_LOG_WARNING;
static atomic_bool journal, waits_never;
static pthread_mutex_t writing = PTHREAD_MUTEX_INITIALIZER;
static unsigned long lost; /* under writing */
static _Thread_local char *held, *copied;
static _Thread_local size_t copied_size;

char *sst_log_hold_errors(char *text)
{
    char *before = held;

    held = text;
    return before;
}

bool sst_log_holds_errors(void)
{
    return held;
}

void sst_log_copy_errors(char *text, size_t size)
{
    copied = text;
    copied_size = size;
    if (text)
        text[0] = 0;
}

void sst_log_use_journal(bool on)
{
    journal = on;
}

void sst_log_set_level(enum sst_log_level level)
{
    level_shown = level;
}

void sst_log_never_wait(void)
{
    waits_never = true;
}

/* One fprintf per line, so that lines of several threads do not mix. Pipes and sockets that are writable have room for one. */
static void write_line(const char *prefix, const char *name, const char *text)
{
    struct pollfd fd = { .fd = STDERR_FILENO, .events = POLLOUT };
    char gap[64] = "";

    if (!waits_never) {
        fprintf(stderr, "%ssst: %s: %s\n", prefix, name, text);
        return;
    }
    pthread_mutex_lock(&writing);
    if (poll(&fd, 1, 0) != 1 || !(fd.revents & POLLOUT)) {
        lost++;
    } else {
        if (lost)
            snprintf(gap, sizeof(gap), "%ssst: warning: %lu lines of the log are lost\n", prefix, lost);
        lost = 0;
        fprintf(stderr, "%s%ssst: %s: %s\n", gap, prefix, name, text);
    }
    pthread_mutex_unlock(&writing);
}

static void emit(enum sst_log_level level, const char *fmt, va_list args)
{
    static const char *const names[] = { "error", "warning", "info", "debug" };
    static const char *const prefixes[] = { "<3>", "<4>", "<6>", "<7>" };
    char text[SST_LOG_MAX];

    if ((int)level > level_shown)
        return;
    vsnprintf(text, sizeof(text), fmt, args);
    /* A file name may hold a line break or an escape sequence. */
    for (char *c = text; *c; c++) {
        if ((unsigned char)*c < ' ' || *c == 127)
            *c = '?';
    }
    if (level == SST_LOG_ERROR && copied) {
        const size_t used = strlen(copied);

        snprintf(copied + used, copied_size - used, "%s%s", used ? "; " : "", text);
    }
    if (level == SST_LOG_ERROR && held)
        memcpy(held, text, sizeof(text));
    else
        write_line(journal ? prefixes[level] : "", names[level], text);
}

#define DEFINE_LOG(name, level)                                                                                        \
    void sst_log_##name(const char *fmt, ...)                                                                          \
    {                                                                                                                  \
        va_list args;                                                                                                  \
                                                                                                                       \
        va_start(args, fmt);                                                                                           \
        emit(level, fmt, args);                                                                                        \
        va_end(args);                                                                                                  \
    }

DEFINE_LOG(error, SST_LOG_ERROR)
DEFINE_LOG(warning, SST_LOG_WARNING)
DEFINE_LOG(info, SST_LOG_INFO)
DEFINE_LOG(debug, SST_LOG_DEBUG)
