/* Cholesky's factorisation within the skyline of a symmetric matrix, in a fixed order of operations. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/posed/solve/solve_internal.h"

static size_t skyline_size(const int *first, int n)
{
    size_t size = 0;

    for (int i = 0; i < n; i++)
        size += (size_t)(i + 1 - first[i]);
    return size;
}

int poses_skyline_init(struct poses_skyline *m, const int *first, int n)
{
    size_t at = 0;

    *m = (struct poses_skyline){ .n = n };
    m->first = malloc((size_t)n * sizeof(*m->first) + 1);
    m->row = malloc((size_t)n * sizeof(*m->row) + 1);
    m->pool = calloc(skyline_size(first, n) + 1, sizeof(*m->pool));
    if (!m->first || !m->row || !m->pool) {
        poses_skyline_fini(m);
        return -ENOMEM;
    }
    for (int i = 0; i < n; i++) {
        m->first[i] = first[i];
        m->row[i] = m->pool + at - first[i]; /* addressed from the first column on */
        at += (size_t)(i + 1 - first[i]);
    }
    return 0;
}

void poses_skyline_fini(struct poses_skyline *m)
{
    free(m->first);
    free(m->row);
    free(m->pool);
    *m = (struct poses_skyline){ 0 };
}

void poses_skyline_clear(struct poses_skyline *m)
{
    memset(m->pool, 0, skyline_size(m->first, m->n) * sizeof(*m->pool));
}

size_t poses_skyline_size(const struct poses_skyline *m)
{
    return skyline_size(m->first, m->n);
}

void poses_skyline_add(struct poses_skyline *to, const struct poses_skyline *m)
{
    const size_t size = poses_skyline_size(m);

    for (size_t i = 0; i < size; i++)
        to->pool[i] += m->pool[i];
}

/* Four sums, for instructions on four numbers. */
static double dot(const double *a, const double *b, int from, int to)
{
    double part[4] = { 0 }, rest = 0;
    int k = from;

    for (; k + 4 <= to; k += 4) {
        for (int s = 0; s < 4; s++)
            part[s] += a[k + s] * b[k + s];
    }
    for (; k < to; k++)
        rest += a[k] * b[k];
    return (part[0] + part[1]) + (part[2] + part[3]) + rest;
}

bool poses_skyline_factor(struct poses_skyline *m)
{
    for (int i = 0; i < m->n; i++) {
        double *row = m->row[i];

        for (int j = m->first[i]; j <= i; j++) {
            const double *other = m->row[j];
            const double sum = row[j] - dot(row, other, sst_max_int(m->first[i], m->first[j]), j);

            if (j < i) {
                row[j] = sum / other[j];
            } else {
                if (!(sum > 0) || !isfinite(sum))
                    return false;
                row[i] = sqrt(sum);
            }
        }
    }
    return true;
}

void poses_skyline_substitute(const struct poses_skyline *m, double *x)
{
    for (int i = 0; i < m->n; i++)
        x[i] = (x[i] - dot(m->row[i], x, m->first[i], i)) / m->row[i][i];
    for (int i = m->n - 1; i >= 0; i--) {
        x[i] /= m->row[i][i];
        for (int j = m->first[i]; j < i; j++)
            x[j] -= m->row[i][j] * x[i];
    }
}
