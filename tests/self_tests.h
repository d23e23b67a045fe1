/* tests/self_tests.h - how many dispatches a device has in the self-tests of a kind of work. */
#ifndef SST_TESTS_SELF_TESTS_H
#define SST_TESTS_SELF_TESTS_H

#include <stdbool.h>
#include <stdio.h>

#include "base/log.h"

/** The device can be opened for this work. */
typedef bool self_tests_fn(const char *name);

/* Dispatches of the self-tests that the dummy device passes as it is opened: faults count on from there. */
static inline int self_tests(self_tests_fn *opens)
{
    int refused = 0, opened = 8192; /* a loss at this dispatch fails the opening; at this one it does not */
    char text[SST_LOG_MAX];

    sst_log_hold_errors(text);
    while (opened - refused > 1) {
        const int at = (refused + opened) / 2;
        char name[32];

        snprintf(name, sizeof(name), "dummy:lost=%d", at);
        if (opens(name))
            opened = at;
        else
            refused = at;
    }
    sst_log_hold_errors(NULL);
    return refused;
}

#endif
