/* drivers/grab/text.h - sentences put together piece by piece. Only for drivers/grab. */
#ifndef SST_DRIVERS_GRAB_TEXT_H
#define SST_DRIVERS_GRAB_TEXT_H

#include "base/base.h"

/** Append to a string in a buffer of `size`; what does not fit is cut off. */
void sst_text_add(char *text, size_t size, const char *fmt, ...) SST_PRINTF(3, 4);

#endif
