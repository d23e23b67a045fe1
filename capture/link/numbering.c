/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/link/numbering.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#define TICKS        256 /* triggers that are remembered */
#define SMOOTH       16
#define HOLD_PERIODS 3
#define HOLD_MOST_NS INT64_C(1000000000)
#define LIVE_NS      INT64_C(2000000000) /* a source that was not heard for longer is not waited for */
#define FAR_NS       LIVE_NS             /* plus a period: largest difference of clocks by which edges are named */
#define INDEX_MAX    (INT64_MAX / 4)     /* sums and differences of two, also of times, do not overflow */
#define T_MAX_NS     (INT64_MAX / 2 - INT64_C(3600000000000))
#define ANCHOR_STEP  256 /* the time of all moves by no more than this part of a period an edge */

struct tick {
    int64_t index, t_ns;
};

struct source {
    bool joined, placed, holds;
    uint64_t run;
    int64_t offset;  /* index less count */
    int64_t last;    /* its newest index */
    int64_t away_ns; /* its monotonic clock less ours, by the edges */
    int64_t heard_ns, held_ns;
    int64_t error_ns; /* the wall clock of its last edge less the common one */
    struct tick held; /* while it holds: where its own count and stamp put it */
    struct sst_numbering_state state;
};

struct sst_numbering {
    int64_t period_ns;
    struct tick tick[TICKS]; /* ring in the order of index and time */
    int first, count;
    int64_t newest_ns; /* when the newest tick was reported */
    struct source source[SST_NUMBERING_SOURCES];
};

int sst_numbering_create(struct sst_numbering **out, int64_t period_ns)
{
    struct sst_numbering *n;

    if (period_ns <= 0)
        return -EINVAL;
    n = calloc(1, sizeof(*n));
    if (!n)
        return -ENOMEM;
    n->period_ns = period_ns;
    *out = n;
    return 0;
}

void sst_numbering_destroy(struct sst_numbering *n)
{
    free(n);
}

/* --- ticks -------------------------------------------------------------------------------------------------------- */

static struct tick *tick_at(struct sst_numbering *n, int i)
{
    return &n->tick[(n->first + i) % TICKS];
}

static struct tick *newest(struct sst_numbering *n)
{
    return n->count ? tick_at(n, n->count - 1) : NULL;
}

static struct tick *find(struct sst_numbering *n, int64_t index)
{
    for (int i = n->count - 1; i >= 0 && tick_at(n, i)->index >= index; i--)
        if (tick_at(n, i)->index == index)
            return tick_at(n, i);
    return NULL;
}

static bool near(const struct sst_numbering *n, int64_t a_ns, int64_t b_ns)
{
    return llabs(a_ns - b_ns) < n->period_ns / 4;
}

/* The tick at a time; NULL: none */
static struct tick *find_near(struct sst_numbering *n, int64_t t_ns)
{
    for (int i = n->count - 1; i >= 0; i--)
        if (near(n, tick_at(n, i)->t_ns, t_ns))
            return tick_at(n, i);
    return NULL;
}

/* The index of a trigger that nobody has reported, but the one before or after it; 0: there is none such */
static int64_t unreported(struct sst_numbering *n, int64_t t_ns)
{
    const struct tick *before = find_near(n, t_ns - n->period_ns), *after = find_near(n, t_ns + n->period_ns);

    return before ? before->index + 1 : after ? after->index - 1 : 0;
}

static struct tick *add(struct sst_numbering *n, int64_t index, int64_t t_ns, int64_t now_ns)
{
    n->newest_ns = now_ns;
    if (n->count == TICKS)
        n->first = (n->first + 1) % TICKS;
    else
        n->count++;
    *newest(n) = (struct tick){ index, t_ns };
    return newest(n);
}

/* --- sources ------------------------------------------------------------------------------------------------------ */

void sst_numbering_join(struct sst_numbering *n, int source, uint64_t run)
{
    struct source *s = &n->source[source];

    if (s->run != run || !run)
        s->placed = false;
    if (!s->placed)
        s->last = -1;
    s->run = run;
    s->joined = true;
    s->holds = false;
}

void sst_numbering_leave(struct sst_numbering *n, int source)
{
    n->source[source].joined = n->source[source].holds = false;
}

static bool is_live(const struct source *s, int64_t now_ns)
{
    return s->joined && s->placed && now_ns - s->heard_ns < LIVE_NS;
}

/* Source of the common wall clock: this host, the last one, else the first that is heard. */
static bool is_anchor(const struct sst_numbering *n, const struct source *s, int64_t now_ns)
{
    if (is_live(&n->source[SST_NUMBERING_SOURCES - 1], now_ns))
        return s == &n->source[SST_NUMBERING_SOURCES - 1];
    for (int i = 0; i < SST_NUMBERING_SOURCES; i++)
        if (is_live(&n->source[i], now_ns))
            return s == &n->source[i];
    return false;
}

/* An edge of a source, on the common wall clock. */
struct heard {
    const struct sst_numbering_edge *edge;
    int64_t now_ns;
    struct sst_numbering_place *place; /* out */
};

static enum sst_numbering_verdict accept(struct sst_numbering *n, struct source *s, const struct tick *at, int64_t t_ns,
                                         const struct heard *h)
{
    const int64_t error_ns = h->edge->wall_ns - at->t_ns, most_ns = n->period_ns / ANCHOR_STEP;

    s->holds = false;
    s->heard_ns = h->now_ns;
    s->error_ns = error_ns;
    s->state.placed = true;
    s->state.residual_ns = t_ns - at->t_ns;
    if (is_anchor(n, s, h->now_ns)) {
        const int64_t step_ns = error_ns / SMOOTH;

        s->away_ns -= step_ns > most_ns ? most_ns : step_ns < -most_ns ? -most_ns : step_ns;
    } else {
        s->away_ns += s->state.residual_ns / SMOOTH;
    }
    s->state.clock_ns += error_ns / SMOOTH - s->state.clock_ns / SMOOTH;
    if (at->index <= s->last) /* an edge that it counted twice */
        return SST_NUMBERING_UNNAMED;
    s->last = at->index;
    *h->place = (struct sst_numbering_place){ (uint64_t)at->index, at->t_ns };
    return SST_NUMBERING_PLACED;
}

/* Another source that counts now; NULL: none */
static const struct source *live_one(const struct sst_numbering *n, const struct source *s, int64_t now_ns)
{
    for (int i = 0; i < SST_NUMBERING_SOURCES; i++)
        if (&n->source[i] != s && is_live(&n->source[i], now_ns))
            return &n->source[i];
    return NULL;
}

/* Place of an edge by its wall clock. While other sources count, a clock far from the common one places no edge: it would move
 * the common time. If their wall clocks were set meanwhile, the edge is compared with these. Without other sources a new common
 * time begins.
 * @param wall_ns  in, out: on the common clock @return false: no place */
static bool look_at_clock(struct sst_numbering *n, struct source *s, const struct heard *h, int64_t *wall_ns,
                          struct tick *at)
{
    const struct tick *last = newest(n);
    const struct source *other = live_one(n, s, h->now_ns);
    const double since_ns = (double)(h->now_ns - n->newest_ns), far_ns = (double)(FAR_NS + n->period_ns);
    double ahead_ns = (double)*wall_ns - (double)last->t_ns;
    int64_t k;

    if (fabs(ahead_ns - since_ns) > far_ns && other && llabs(other->error_ns) > FAR_NS &&
        !__builtin_sub_overflow(*wall_ns, other->error_ns, wall_ns))
        ahead_ns = (double)*wall_ns - (double)last->t_ns;
    if (fabs(ahead_ns - since_ns) > far_ns) {
        s->state.clock_ns = (int64_t)fmax(-9e18, fmin(ahead_ns - since_ns, 9e18));
        if (other || last->index > INDEX_MAX / 2 || since_ns < 0)
            return false;
        *at = (struct tick){ last->index + 1 + llround(since_ns / (double)n->period_ns), *wall_ns };
        n->count = 0;
        return true;
    }
    k = llround(ahead_ns / (double)n->period_ns);
    *at = (struct tick){ last->index + k, last->t_ns + k * n->period_ns };
    s->state.clock_ns = *wall_ns - at->t_ns;
    return near(n, *wall_ns, at->t_ns) && at->index >= 0 && at->index <= INDEX_MAX;
}

/* Name the edges of a source that has joined, by its wall clock. */
static enum sst_numbering_verdict name(struct sst_numbering *n, struct source *s, const struct heard *h)
{
    const struct sst_numbering_edge *edge = h->edge;
    struct tick at = { (int64_t)edge->count, edge->wall_ns }, *known;
    int64_t wall_ns = edge->wall_ns;
    const struct tick *last;

    s->heard_ns = h->now_ns;
    if (n->count) {
        if (!look_at_clock(n, s, h, &wall_ns, &at))
            return SST_NUMBERING_UNNAMED;
    }
    last = newest(n);
    s->offset = at.index - (int64_t)edge->count;
    known = find(n, at.index);
    s->away_ns = edge->t_ns - (known ? known->t_ns : wall_ns);
    s->placed = true;
    if (!known && last && at.index < last->index)
        known = &at; /* between ticks that others reported */
    else if (!known)
        known = add(n, at.index, wall_ns, h->now_ns);
    s->state.clock_ns = edge->wall_ns - known->t_ns;
    return accept(n, s, known, edge->t_ns - s->away_ns, h);
}

static void slip(struct source *s, int64_t by)
{
    s->offset += by;
    s->state.slips++;
    if (__builtin_add_overflow(s->state.slipped, by, &s->state.slipped))
        s->state.slipped = by > 0 ? INT64_MAX : INT64_MIN;
}

/* Does another source wait with the same edge? */
static bool others_agree(const struct sst_numbering *n, const struct source *s, const struct tick *at)
{
    for (int i = 0; i < SST_NUMBERING_SOURCES; i++) {
        const struct source *o = &n->source[i];

        if (o != s && o->joined && o->holds && o->held.index == at->index && near(n, o->held.t_ns, at->t_ns))
            return true;
    }
    return false;
}

/* The first to report a tick, and not when it was due: the trigger paused, or the source has missed edges. */
static bool must_wait(struct sst_numbering *n, struct source *s, const struct tick *at, int64_t now_ns)
{
    const int64_t hold_ns = HOLD_PERIODS * n->period_ns < HOLD_MOST_NS ? HOLD_PERIODS * n->period_ns : HOLD_MOST_NS;

    if (!s->holds) {
        s->holds = true;
        s->held = *at;
        s->held_ns = now_ns;
    }
    return live_one(n, s, now_ns) && !others_agree(n, s, at) && now_ns - s->held_ns < hold_ns;
}

enum sst_numbering_verdict sst_numbering_place(struct sst_numbering *n, int source,
                                               const struct sst_numbering_edge *edge, int64_t now_ns,
                                               struct sst_numbering_place *place)
{
    struct source *s = &n->source[source];
    const struct heard h = { edge, now_ns, place };
    struct tick at = { .index = 0 };
    struct tick *known, *last = newest(n);

    if (!s->placed)
        return name(n, s, &h);
    if (__builtin_add_overflow((int64_t)edge->count, s->offset, &at.index) || at.index > INDEX_MAX ||
        __builtin_sub_overflow(edge->t_ns, s->away_ns, &at.t_ns) || llabs(at.t_ns) > T_MAX_NS)
        return SST_NUMBERING_UNNAMED;
    known = find(n, at.index);
    if (known && near(n, known->t_ns, at.t_ns))
        return accept(n, s, known, at.t_ns, &h);
    known = find_near(n, at.t_ns);
    if (known) {
        slip(s, known->index - at.index);
        return accept(n, s, known, at.t_ns, &h);
    }
    if (at.index > last->index) {
        int64_t due_ns;
        const bool due = !__builtin_mul_overflow(at.index - last->index, n->period_ns, &due_ns) &&
                         !__builtin_add_overflow(due_ns, last->t_ns, &due_ns) && llabs(due_ns) <= T_MAX_NS &&
                         near(n, at.t_ns, due_ns);

        if (!due && must_wait(n, s, &at, now_ns))
            return SST_NUMBERING_HELD;
        if (at.t_ns > last->t_ns)
            return accept(n, s, add(n, at.index, at.t_ns, now_ns), at.t_ns, &h);
    } else if (at.t_ns > last->t_ns) {
        const int64_t k = llround((double)(at.t_ns - last->t_ns) / (double)n->period_ns);

        if (k > 0 && near(n, at.t_ns, last->t_ns + k * n->period_ns)) {
            slip(s, last->index + k - at.index);
            return accept(n, s, add(n, last->index + k, at.t_ns, now_ns), at.t_ns, &h);
        }
    } else if (at.t_ns < tick_at(n, 0)->t_ns || unreported(n, at.t_ns)) {
        const int64_t index = at.t_ns < tick_at(n, 0)->t_ns ? at.index : unreported(n, at.t_ns);

        if (index != at.index)
            slip(s, index - at.index);
        at.index = index;
        return accept(n, s, &at, at.t_ns, &h);
    }
    s->holds = false;
    s->heard_ns = now_ns;
    if (llabs(at.t_ns - last->t_ns) > LIVE_NS) { /* its clock jumped, or was it we who slept? */
        s->placed = false;
        s->state.renamed++;
        return name(n, s, &h);
    }
    return SST_NUMBERING_UNNAMED; /* between two triggers: an edge that the others have not seen */
}

void sst_numbering_state(const struct sst_numbering *n, int source, struct sst_numbering_state *out)
{
    *out = n->source[source].state;
    out->placed = n->source[source].placed;
}
