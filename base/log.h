/* base/log.h - one-line messages to standard error, and the last error for callers that report it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_LOG_H
#define SST_BASE_LOG_H

#include <stdbool.h>

#include "base/base.h"

enum sst_log_level {
    SST_LOG_ERROR = 0,
    SST_LOG_WARNING = 1,
    SST_LOG_INFO = 2,
    SST_LOG_DEBUG = 3,
};

/** Show messages up to this level; the default is SST_LOG_WARNING. */
void sst_log_set_level(enum sst_log_level level);

/** Prefix lines with the level in the format of systemd's journal. */
void sst_log_use_journal(bool on);

/** Lose lines while standard error is not read, and count them in the next line, from this call on: for services, since a journal or
 *  terminal that hangs must not hold up their work. */
void sst_log_never_wait(void);

/**
 * Write one line "sst: error: ..." to standard error.
 *
 * An error is one sentence: the failure, its place (file, value), and the remedy. It is logged once, where the
 * outside world first shows the fault; callers only pass the errno on.  Thread: any.
 */
void sst_log_error(const char *fmt, ...) SST_PRINTF(1, 2);
void sst_log_warning(const char *fmt, ...) SST_PRINTF(1, 2);
void sst_log_info(const char *fmt, ...) SST_PRINTF(1, 2);
void sst_log_debug(const char *fmt, ...) SST_PRINTF(1, 2);

/* Longest line that is shown, with its NUL. */
#define SST_LOG_MAX 1024

/**
 * Store the last error of this thread in `text` [SST_LOG_MAX] instead of showing it; NULL shows errors again.
 * For work on several threads of which only one error is reported (base/thread.h).
 * @return the text set before, or NULL
 */
char *sst_log_hold_errors(char *text);

/** Does this thread hold its errors, so that the last one alone is read? */
bool sst_log_holds_errors(void);

/** Show the errors of this thread as usual, and also append them to `text`, separated by "; ", truncated to fit; NULL
 *  ends this. */
void sst_log_copy_errors(char *text, size_t size);

#endif
