/* pipeline/kernels/class_prob.h - probabilities of classes from a network's result, the same bits on CPUs and devices.
 */
#ifndef SST_PIPELINE_KERNELS_CLASS_PROB_H
#define SST_PIPELINE_KERNELS_CLASS_PROB_H

#include <float.h>
#include <math.h>
#include <stdbool.h>

#include "pipeline/kernels/exp_neg.h"

#define SST_LOGIT_MOST        64.0F  /* below the largest one; what is farther below has probability 0 */
#define SST_PROBABILITY_LEAST 1e-30F /* less is 0: numbers below 2^-126 are, on some devices */

/** What a channel counts, before its share of the sum is known. @param most  the largest value of all channels */
static inline float sst_class_part(float value, float most, bool is_probability, float per_temperature)
{
    const float below = (most - value) * per_temperature;

    if (is_probability)
        return value < FLT_MIN ? 0 : value;
    return below < SST_LOGIT_MOST ? sst_exp_neg(below) : 0;
}

static inline float sst_class_share(float part, float sum)
{
    const float share = part / sum;

    return share < SST_PROBABILITY_LEAST ? 0 : share;
}

/**
 * Values of n channels to probabilities, in place.
 * @param per_temperature  of logits
 * @return false: some value is not finite, a probability is negative, or all of them are 0
 */
static inline bool sst_class_probabilities(float *p, int n, bool is_probability, float per_temperature)
{
    float most = -INFINITY, sum = 0;

    for (int c = 0; c < n; c++) {
        if (!isfinite(p[c]) || (is_probability && p[c] < 0))
            return false;
        most = p[c] > most ? p[c] : most;
    }
    for (int c = 0; c < n; c++) {
        p[c] = sst_class_part(p[c], most, is_probability, per_temperature);
        sum += p[c];
    }
    if (!(sum >= FLT_MIN && sum <= FLT_MAX))
        return false;
    for (int c = 0; c < n; c++)
        p[c] = sst_class_share(p[c], sum);
    return true;
}

#endif
