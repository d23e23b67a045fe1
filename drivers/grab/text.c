#include "drivers/grab/grab_internal.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void text_add(char *text, size_t size, const char *fmt, ...)
{
    const size_t used = strnlen(text, size);
    va_list args;

    if (used == size)
        return;
    va_start(args, fmt);
    vsnprintf(text + used, size - used, fmt, args);
    va_end(args);
}
