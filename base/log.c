/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/log.h"

#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

static _Atomic int level_shown = SST_LOG_WARNING;
static atomic_bool journal;
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

/* One fprintf per line, so that lines of several threads do not mix. */
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
        fprintf(stderr, "%ssst: %s: %s\n", journal ? prefixes[level] : "", names[level], text);
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
