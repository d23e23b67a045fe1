#include "base/text.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void sst_text_add(char *text, size_t size, const char *fmt, ...)
{
    const size_t used = strlen(text);
    va_list args;

    va_start(args, fmt);
    vsnprintf(text + used, size - used, fmt, args);
    va_end(args);
}
