/* base/histogram.h - counts of durations with percentiles to 1.6 %, in fixed memory. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_HISTOGRAM_H
#define SST_BASE_HISTOGRAM_H

#include "base/base.h"

#define SST_HISTOGRAM_BUCKETS (64 * 59) /* 64 for each power of two from 2^6 on */

/** Zeroed: empty. Values are counted in the bucket [lo, lo * (1 + 1/64)), exactly below 128. */
struct sst_histogram {
    uint64_t count, bucket[SST_HISTOGRAM_BUCKETS];
    int64_t min, max; /* exact; of an empty one 0 */
};

/** Negative values count as 0. */
void sst_histogram_add(struct sst_histogram *h, int64_t value);

/** Upper end of the bucket that holds the value of rank ceil(q * count), at most max; 0 if empty. @param q 0..1 */
int64_t sst_histogram_quantile(const struct sst_histogram *h, double q);

#endif
