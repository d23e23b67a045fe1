/* tests/test.h - cmocka, with the headers that it needs before it, and one more assertion. */
#ifndef SST_TESTS_TEST_H
#define SST_TESTS_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "tests/traps.h"

/** The text has these words in it. */
#define assert_contains(text, words)                                                                                   \
    do {                                                                                                               \
        if (!strstr(text, words))                                                                                      \
            fail_msg("no '%s' in: %s", words, text);                                                                   \
    } while (0)

#endif
