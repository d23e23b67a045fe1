/* tests/bounds.h - the largest error of a kernel or formula, held to its bound, and the line that `make bounds`
 * collects. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_BOUNDS_H
#define SST_TESTS_BOUNDS_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/base.h"
#include "tests/test.h"

struct bound {
    const char *name, *precision, *unit, *why; /* of the table; `why`: from where the bound is */
    double stated, worst;
    long cases;
    char input[160]; /* that caused the worst error */
};

/** An error that was seen, and what caused it. What is no number is beyond every bound. */
static inline void SST_PRINTF(3, 4) bound_note(struct bound *b, double error, const char *format, ...)
{
    va_list args;

    b->cases++;
    if (error <= b->worst)
        return;
    b->worst = isnan(error) ? INFINITY : error;
    va_start(args, format);
    vsnprintf(b->input, sizeof(b->input), format, args);
    va_end(args);
}

/** The same for |got - want| / (want's magnitude + floor). */
#define bound_relative(b, got, want, floor, ...)                                                                       \
    bound_note(b, (double)(fabsl((wide)(got) - (wide)(want)) / (fabsl((wide)(want)) + (floor))), __VA_ARGS__)

/** Fail if the bound is exceeded. With SST_BOUNDS=FILE the table's line is appended to that file. */
static inline void bound_end(const struct bound *b)
{
    const char *path = getenv("SST_BOUNDS");
    FILE *f = path ? fopen(path, "a") : NULL;

    assert_true(b->cases > 0 && (!path || f));
    if (f) {
        fprintf(f, "%s\t%s\t%.3g %s\t%s\t%.3g\t%ld\t%s\n", b->name, b->precision, b->stated, b->unit, b->why, b->worst,
                b->cases, b->input);
        assert_int_equal(fclose(f), 0);
    }
    if (!(b->worst <= b->stated))
        fail_msg("%s: error %g %s exceeds %g: %s", b->name, b->worst, b->unit, b->stated, b->input);
}

/** A line of the table of degenerate inputs. */
static inline void SST_PRINTF(2, 3) bound_case(const char *name, const char *format, ...)
{
    const char *path = getenv("SST_BOUNDS_CASES");
    FILE *f = path ? fopen(path, "a") : NULL;
    va_list args;

    assert_true(!path || f);
    if (!f)
        return;
    fprintf(f, "%s\t", name);
    va_start(args, format);
    vfprintf(f, format, args);
    va_end(args);
    fputc('\n', f);
    assert_int_equal(fclose(f), 0);
}

#endif
