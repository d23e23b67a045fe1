/* tests/reference/labels.h - design.md, 5.1, written down plainly. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_REFERENCE_LABELS_H
#define SST_TESTS_REFERENCE_LABELS_H

#include <stddef.h>

#include "tests/reference/wide.h"

/** H = -sum p log p, 0 log 0 = 0; p[i] lies `stride` floats after the last. */
static inline wide ref_entropy(const float *p, size_t stride, size_t n)
{
    wide h = 0;

    for (size_t i = 0; i < n; i++)
        h -= p[i * stride] > 0 ? (wide)p[i * stride] * logl((wide)p[i * stride]) : 0;
    return h;
}

/** Acc^m Cvg with Acc = TP / (TP + FP), Cvg = TP / N; 0 without a correct pixel. */
static inline wide ref_score(long tp, long kept, long all, wide m)
{
    return tp > 0 ? expl(m * logl((wide)tp / (wide)kept)) * ((wide)tp / (wide)all) : 0;
}

#endif
