/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/method/labels/labels.h"

void sst_hcsm(struct sst_map_u8 *label, const struct sst_map_f32 *entropy, double eps_h)
{
    for (int y = 0; y < label->height; y++) {
        const float *h = sst_map_f32_row(entropy, y);
        uint8_t *l = sst_map_u8_row(label, y);

        for (int x = 0; x < label->width; x++) {
            if (!((double)h[x] < eps_h))
                l[x] = SST_LABEL_NONE;
        }
    }
}

/* --- the threshold -------------------------------------------------------------------------------- */

/* Scores closer than this in the log domain are equal: far above the rounding of three logarithms, far below the effect
 * of one pixel in any image. */
#define SCORE_TIE 1e-13

/* One pixel with a label and a truth: the bits of its entropy (which order like the non-negative number) and whether
 * the label is right, in one sortable word. */
static uint64_t pack(float h, bool correct)
{
    uint32_t bits;

    h += 0.0f; /* -0 becomes 0 */
    memcpy(&bits, &h, sizeof(bits));
    return (uint64_t)bits << 1 | correct;
}

static float unpack(uint64_t packed)
{
    const uint32_t bits = (uint32_t)(packed >> 1);
    float h;

    memcpy(&h, &bits, sizeof(h));
    return h;
}

static int compare(const void *a, const void *b)
{
    const uint64_t u = *(const uint64_t *)a, v = *(const uint64_t *)b;

    return u < v ? -1 : u > v;
}

struct collected {
    uint64_t *packed;  /* [n] pixels that a threshold can keep */
    size_t n, n_truth; /* n_truth: pixels with a true label */
};

static int collect(struct collected *out, const struct sst_map_u8 *label, const struct sst_map_f32 *entropy,
                   const struct sst_map_u8 *truth)
{
    for (int y = 0; y < truth->height; y++) {
        const uint8_t *l = sst_map_u8_row(label, y), *t = sst_map_u8_row(truth, y);
        const float *h = sst_map_f32_row(entropy, y);

        for (int x = 0; x < truth->width; x++) {
            if (!(h[x] >= 0)) {
                sst_log_error("entropy threshold: the entropy at (%d, %d) is %g, not a number of at least 0; segment "
                              "the view again",
                              x, y, (double)h[x]);
                return -EBADMSG;
            }
            if (t[x] == SST_LABEL_NONE)
                continue;
            out->n_truth++;
            if (l[x] != SST_LABEL_NONE && isfinite(h[x]))
                out->packed[out->n++] = pack(h[x], l[x] == t[x]);
        }
    }
    return 0;
}

/* Try every prefix of the sorted pixels that ends between two different entropies. */
static struct sst_epsilon_result best_prefix(const struct collected *c, double m)
{
    const uint64_t *packed = c->packed;
    struct sst_epsilon_result best = { 0 };
    double best_log = -INFINITY;
    size_t correct = 0;

    for (size_t i = 0; i < c->n; i++) {
        const float h = unpack(packed[i]), next = i + 1 < c->n ? unpack(packed[i + 1]) : INFINITY;
        double accuracy, coverage, score;

        correct += packed[i] & 1;
        if (next == h || !correct)
            continue;
        accuracy = (double)correct / (double)(i + 1);
        coverage = (double)correct / (double)c->n_truth;
        score = m * log(accuracy) + log(coverage);
        if (!(score > best_log + SCORE_TIE))
            continue;
        best_log = score;
        /* The midpoint in double lies strictly above h and not above the next value. */
        best.eps_h = isfinite(next) ? ((double)h + (double)next) / 2 : (double)nextafterf(h, INFINITY);
        best.score = exp(score);
        best.accuracy = accuracy;
        best.coverage = coverage;
    }
    return best;
}

int sst_epsilon_search(struct sst_epsilon_result *out, const struct sst_map_u8 *label,
                       const struct sst_map_f32 *entropy, const struct sst_map_u8 *truth, double m)
{
    const size_t pixels = (size_t)truth->width * (size_t)truth->height;
    struct sst_epsilon_result best;
    struct collected c = { 0 };
    int err;

    if (label->width != truth->width || label->height != truth->height || entropy->width != truth->width ||
        entropy->height != truth->height) {
        sst_log_error(
            "entropy threshold: labels of %d x %d, entropy of %d x %d and truth of %d x %d differ; use maps of one"
            " view",
            label->width, label->height, entropy->width, entropy->height, truth->width, truth->height);
        return -EBADMSG;
    }
    if (!(m >= 0) || isinf(m)) {
        sst_log_error("entropy threshold: the exponent m is %g; it must be 0 or more", m);
        return -EINVAL;
    }
    c.packed = malloc((pixels + 1) * sizeof(*c.packed));
    if (!c.packed) {
        sst_log_error("entropy threshold: not enough memory for %zu pixels", pixels);
        return -ENOMEM;
    }
    err = collect(&c, label, entropy, truth);
    if (!err) {
        qsort(c.packed, c.n, sizeof(*c.packed), compare);
        best = best_prefix(&c, m);
        if (best.coverage > 0)
            *out = best;
        else
            err = -ENODATA;
    }
    free(c.packed);
    if (err == -ENODATA) {
        sst_log_error("entropy threshold: none of the %zu hand-labelled pixels has the correct label; check that the "
                      "hand labels are of this view and class list",
                      c.n_truth);
        err = -EBADMSG;
    }
    return err;
}
