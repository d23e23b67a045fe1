/* base/text.h - messages that are put together from parts. */
#ifndef SST_BASE_TEXT_H
#define SST_BASE_TEXT_H

#include "base/base.h"

/** Append to a text of `size` bytes, NUL included; what does not fit is left out. */
void sst_text_add(char *text, size_t size, const char *fmt, ...) SST_PRINTF(3, 4);

#endif
