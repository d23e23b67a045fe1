/* Matches of descriptors: mutual best ones that are clearly better than the second. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"
#include "pipeline/posed/solve/solve_internal.h"

#define RATIO 0.85 /* of the best two distances */
#define ONE   512  /* length of a descriptor */
#define BAND  16   /* descriptors of a and ... */
#define BLOCK 64   /* ... of b that are multiplied at once, in the first cache */

/* Best products so far. */
struct best {
    int32_t product;
    int at;
};

struct band {
    struct best first[BAND];
    int32_t second[BAND];
};

/* Products of `count` descriptors of a, from the i-th on, with n of b from the j-th on. Equal ones: the first counts. */
static void note(struct band *band, struct best *back, const int32_t *product, const int from[2], const int size[2])
{
    for (int i = 0; i < size[0]; i++) {
        const int32_t *row = product + (ptrdiff_t)i * size[1];
        struct best *first = band->first + i, *column = back + from[1];
        int32_t second = band->second[i];

        for (int j = 0; j < size[1]; j++) {
            const int32_t v = row[j];

            if (v > second) {
                second = v > first->product ? first->product : v;
                if (v > first->product)
                    *first = (struct best){ v, from[1] + j };
            }
            if (v > column[j].product)
                column[j] = (struct best){ v, from[0] + i };
        }
        band->second[i] = second;
    }
}

int poses_descriptors_match(const struct cv_features *a, const struct cv_features *b, int (*match)[2], int *count)
{
    const struct sst_kernels *kernels = sst_kernels_get();
    struct best *back = malloc((size_t)b->count * sizeof(*back) + 1);
    struct best *best = malloc((size_t)a->count * sizeof(*best) + 1);
    int32_t *second = malloc((size_t)a->count * sizeof(*second) + 1);
    int found = 0;

    if (!back || !best || !second) {
        free(back);
        free(best);
        free(second);
        return -ENOMEM;
    }
    for (int j = 0; j < b->count; j++)
        back[j] = (struct best){ -1, -1 };
    for (int i = 0; i < a->count; i += BAND) {
        const int rows = sst_min_int(BAND, a->count - i);
        struct band band;

        for (int k = 0; k < rows; k++) {
            band.first[k] = (struct best){ -1, 0 };
            band.second[k] = -1;
        }
        for (int j = 0; j < b->count; j += BLOCK) {
            const int n = sst_min_int(BLOCK, b->count - j);
            int32_t product[BAND * BLOCK];

            kernels->feature_products(product, a->descriptor + (size_t)i * CV_DESCRIPTOR, (size_t)rows,
                                         b->descriptor + (size_t)j * CV_DESCRIPTOR, (size_t)n);
            note(&band, back, product, (const int[2]){ i, j }, (const int[2]){ rows, n });
        }
        for (int k = 0; k < rows; k++) {
            best[i + k] = band.first[k];
            second[i + k] = band.second[k];
        }
    }
    for (int i = 0; i < a->count && b->count > 1; i++) {
        const double nearest = ONE * ONE - best[i].product, next = ONE * ONE - second[i];

        if (back[best[i].at].at == i && nearest < RATIO * RATIO * next) {
            match[found][0] = i;
            match[found++][1] = best[i].at;
        }
    }
    *count = a->count > 1 ? found : 0;
    free(back);
    free(best);
    free(second);
    return 0;
}
