/* capture/link/numbering.h - one numbering of triggers for several hosts, each of which counts the same edges. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_LINK_NUMBERING_H
#define SST_CAPTURE_LINK_NUMBERING_H

#include <stdbool.h>

#include "base/base.h"

/*
 * A source (a host) counts the edges of the trigger that all share, from an unknown one on. Its edges are named once,
 * when it joins, by the wall clock; from then on its count alone says which trigger a set belongs to. Time stamps only
 * check it: the stamps that several hosts give one edge differ as their monotonic clocks do, which hardly changes from
 * one edge to the next. An edge with a stamp whole periods beside the others' was counted wrongly: the source's
 * numbering is corrected before the set is placed. Thus a source that lost edges is distinguished from a trigger that
 * paused, which all sources see.
 */

#define SST_NUMBERING_SOURCES 17

struct sst_numbering; /* opaque; one thread at a time */

/** An edge as its source counted it. */
struct sst_numbering_edge {
    uint64_t count;
    int64_t t_ns;    /* of the source's CLOCK_MONOTONIC */
    int64_t wall_ns; /* its wall clock then, less the lead of this host's over CLOCK_MONOTONIC */
};

/** An edge as all sources name it. */
struct sst_numbering_place {
    uint64_t index;
    int64_t t_ns; /* on this host's CLOCK_MONOTONIC */
};

enum sst_numbering_verdict {
    SST_NUMBERING_PLACED = 0,
    SST_NUMBERING_HELD = 1,    /* undecided until another source reports or some periods pass: ask again */
    SST_NUMBERING_UNNAMED = 2, /* it belongs to no trigger, or the source's clock is too wrong to name it */
};

struct sst_numbering_state {
    bool placed;         /* its edges have been named */
    uint64_t slips;      /* corrections of its numbering */
    int64_t slipped;     /* edges that these corrections amount to: positive: it had missed some */
    uint64_t renamed;    /* times that it was named by the clock again, since its stamps jumped */
    int64_t clock_ns;    /* its wall clock less this host's, by the edges, smoothed; 0 until placed */
    int64_t residual_ns; /* stamp of its last edge less the others', their clocks' difference subtracted */
};

/** @param period_ns  of the trigger, > 0 @return 0, -EINVAL, -ENOMEM */
SST_MUST_CHECK int sst_numbering_create(struct sst_numbering **out, int64_t period_ns);
/** NULL is fine. */
void sst_numbering_destroy(struct sst_numbering *n);

/** A source joins. @param run  names its counting: with the one of before its numbering goes on */
void sst_numbering_join(struct sst_numbering *n, int source, uint64_t run);
/** It is not waited for until it joins again. */
void sst_numbering_leave(struct sst_numbering *n, int source);

/**
 * Name an edge. One source's come in the order of their counts; a held one is asked for again before the next.
 *
 * @param place  out, if placed
 */
enum sst_numbering_verdict sst_numbering_place(struct sst_numbering *n, int source,
                                               const struct sst_numbering_edge *edge, int64_t now_ns,
                                               struct sst_numbering_place *place);

void sst_numbering_state(const struct sst_numbering *n, int source, struct sst_numbering_state *out);

#endif
