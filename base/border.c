/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/border.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "base/base.h"
#include "base/log.h"

static atomic_uint_fast64_t counted;

static size_t count(const char *what, size_t bad)
{
    if (!bad)
        return 0;
    if (!atomic_fetch_add(&counted, bad))
        sst_log_warning("%s: %zu values are no finite numbers; please report this with the input", what, bad);
#ifdef SST_TRAPS
    abort();
#endif
    return bad;
}

/* By the bits: comparing a NaN is an exception of its own. */
size_t sst_border_doubles(const char *what, const double *v, size_t n)
{
    size_t bad = 0;

    for (size_t i = 0; i < n; i++) {
        uint64_t bits;

        memcpy(&bits, &v[i], sizeof(bits));
        bad += (bits >> 52 & 0x7FF) == 0x7FF;
    }
    return count(what, bad);
}

static size_t count_above(const char *what, const float *v, size_t n, uint32_t most)
{
    size_t bad = 0;

    for (size_t i = 0; i < n; i++) {
        uint32_t bits;

        memcpy(&bits, &v[i], sizeof(bits));
        bad += (bits & 0x7FFFFFFF) > most;
    }
    return count(what, bad);
}

size_t sst_border_floats(const char *what, const float *v, size_t n)
{
    return count_above(what, v, n, 0x7F7FFFFF);
}

size_t sst_border_unknown(const char *what, const float *v, size_t n)
{
    return count_above(what, v, n, 0x7F800000);
}

uint64_t sst_border_count(void)
{
    return atomic_load(&counted);
}

#ifdef SST_TRAPS
#include <fenv.h>

int feenableexcept(int exceptions); /* glibc declares it for _GNU_SOURCE alone */

/* Programs of a sanitized build, like its tests (tests/traps.h), if they are asked to: SST_TRAPS=all. */
static void __attribute__((constructor)) trap(void)
{
    const char *wanted = getenv("SST_TRAPS");

    if (wanted && !strcmp(wanted, "all"))
        feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
}
#endif
