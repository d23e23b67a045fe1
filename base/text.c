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

bool sst_text_ends(const char *text, const char *end)
{
    const size_t n = strlen(text), m = strlen(end);

    return n > m && !strcmp(text + n - m, end);
}
