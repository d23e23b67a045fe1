/* base/border.h - border of a module for NaN and infinity: values that would cross it are counted, in checked builds
 * asserted. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_BORDER_H
#define SST_BASE_BORDER_H

#include <stddef.h>
#include <stdint.h>

/**
 * Check results that leave a module. Values that are no finite numbers end a sanitized build; otherwise they are counted,
 * and the first of the process is logged as a warning. Costs a pass over the values. Thread: any.
 *
 * @param what  the module's result, for the message  @return how many are not finite
 */
size_t sst_border_doubles(const char *what, const double *v, size_t n);

size_t sst_border_floats(const char *what, const float *v, size_t n);

/** Check floats with infinity for unknown, as sst_border_floats(): only NaN counts. */
size_t sst_border_unknown(const char *what, const float *v, size_t n);

/** Values counted since the start of the process. */
uint64_t sst_border_count(void);

#endif
