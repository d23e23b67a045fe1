/* base/text.h - texts composed of parts; their endings. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_TEXT_H
#define SST_BASE_TEXT_H

#include <stdbool.h>

#include "base/base.h"

/** Append to a text of `size` bytes, NUL included; the part that does not fit is left out. */
void sst_text_add(char *text, size_t size, const char *fmt, ...) SST_PRINTF(3, 4);

/** Does a text end so (".png") and is it longer? Case counts. */
bool sst_text_ends(const char *text, const char *end);

/** Names of devices and folders are arbitrary bytes, JSON holds UTF-8 only: in other text '?' replaces bytes that are
 * not ASCII. */
void sst_text_make_utf8(char *text);

/** Remove a character of UTF-8 that a limit has cut off at the end. */
void sst_text_end_whole(char *text);

#endif
