/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#include "pipeline/method/network/network_internal.h"

/* Lowest offset where a span overlaps none of those already placed (marked) with overlapping lifetimes. Each attempt
 * either succeeds or moves past a conflicting one. */
static size_t find_place(const struct net_span *spans, int n, const struct net_span *s)
{
    size_t at = 0;

    for (int i = 0; i < n; i++) {
        const struct net_span *o = &spans[i];

        if (o->placed && o->first <= s->last && s->first <= o->last && at < o->offset + o->bytes &&
            o->offset < at + s->bytes) {
            at = o->offset + o->bytes;
            i = -1;
        }
    }
    return at;
}

/* Largest first, each at the lowest free offset: near optimal for chains and residual blocks. */
size_t net_place(struct net_span *spans, int n)
{
    size_t total = 0;

    for (int i = 0; i < n; i++)
        spans[i].placed = false;
    for (;;) {
        struct net_span *s = NULL;

        for (int i = 0; i < n; i++) {
            if (!spans[i].placed && spans[i].first >= 0 && (!s || spans[i].bytes > s->bytes))
                s = &spans[i];
        }
        if (!s)
            return total;
        s->offset = find_place(spans, n, s);
        s->placed = true;
        if (s->offset + s->bytes > total)
            total = s->offset + s->bytes;
    }
}
