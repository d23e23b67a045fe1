/* Recordings that several hosts made of one array, as one: their sets are joined by trigger (capture/link/numbering.h).
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "base/log.h"
#include "base/mem.h"
#include "capture/link/numbering.h"
#include "capture/recording/recording_internal.h"

/* One set of one part, named. */
struct named {
    int64_t index;
    int part, set;
};

struct recording_join {
    int parts;
    struct sst_recording *part[RECORDING_PARTS_MAX];
    int base[RECORDING_PARTS_MAX]; /* number of its first camera */
    struct named *named;           /* in the order of index and part */
    int count, capacity;
    int *first; /* [sets + 1] of `named` */
};

/* --- common properties -------------------------------------------------------------------------------------------- */

static int differ(const struct sst_recording *a, const struct sst_recording *b, const char *what)
{
    sst_log_error("%s and %s have not been recorded of one array: their %s differ", a->dir, b->dir, what);
    return -EBADMSG;
}

static int merge_info(struct sst_recording *r, struct sst_recording *part)
{
    struct sst_recording_info *all = &r->info;
    const struct sst_recording_info *more = &part->info;
    const struct sst_recording *first = r->join->part[0];

    if (part == first) {
        *all = *more;
        return 0;
    }
    if (more->rows != all->rows || more->cols != all->cols)
        return differ(first, part, "grids");
    if (more->width != all->width || more->height != all->height || more->fourcc != all->fourcc)
        return differ(first, part, "sizes or formats of pictures");
    if (more->rate_hz <= 0 || more->rate_hz < 0.999 * all->rate_hz || more->rate_hz > 1.001 * all->rate_hz)
        return differ(first, part, "rates");
    for (int i = 0; i < more->cameras; i++) {
        for (int k = 0; k < all->cameras; k++)
            if (all->track[k].row == more->track[i].row && all->track[k].col == more->track[i].col) {
                sst_log_error(
                    "%s has the camera at row %d, col %d, and an earlier one has it, too: give each recording once",
                    part->dir, more->track[i].row, more->track[i].col);
                return -EBADMSG;
            }
    }
    memcpy(all->track + all->cameras, more->track, sizeof(more->track[0]) * (size_t)more->cameras);
    all->cameras += more->cameras;
    return 0;
}

/* --- naming ------------------------------------------------------------------------------------------------------- */

struct cursor {
    int next;     /* its next set */
    int session;  /* that it has joined with; -1: none */
    bool waiting; /* `edge` is of the next set, and not decided */
    struct sst_numbering_edge edge;
};

struct naming {
    struct recording_join *j;
    struct sst_numbering *numbering;
    struct cursor cursor[RECORDING_PARTS_MAX];
    struct sst_recording_set set; /* large */
    int64_t now_ns, period_ns;
};

/* Read the next set of a part that can be read. @return 0: there is none */
static int advance(struct naming *n, int part)
{
    const struct sst_recording *r = n->j->part[part];
    struct cursor *c = &n->cursor[part];

    for (; c->next < r->count; c->next++) {
        const int err = sst_recording_set(r, c->next, &n->set);

        if (err && err != -EBADMSG)
            return err;
        if (err)
            continue; /* damaged: it lacks */
        if (n->set.session != c->session)
            sst_numbering_join(n->numbering, part, (uint64_t)n->set.session + 1);
        c->session = n->set.session;
        c->edge = (struct sst_numbering_edge){ n->set.index, n->set.t_ns, n->set.wall_ns };
        c->waiting = true;
        return 1;
    }
    return 0;
}

/* Part with the oldest next set by its clock. @param among  parts; -1: none is left */
static int oldest(const struct naming *n, const bool *held)
{
    int best = -1;

    for (int i = 0; i < n->j->parts; i++)
        if (n->cursor[i].waiting && !held[i] && (best < 0 || n->cursor[i].edge.wall_ns < n->cursor[best].edge.wall_ns))
            best = i;
    return best;
}

static int note(struct naming *n, int part, uint64_t index)
{
    struct recording_join *j = n->j;

    if (!sst_mem_grow(&j->named, j->count, &j->capacity, sizeof(*j->named)))
        return -ENOMEM;
    j->named[j->count++] = (struct named){ (int64_t)index, part, n->cursor[part].next };
    return 0;
}

/* Name one set. @return 1, 0 (all are named), or an error */
static int name_one(struct naming *n, bool *held)
{
    const int part = oldest(n, held);
    struct sst_numbering_place place;
    enum sst_numbering_verdict verdict;
    struct cursor *c;
    int err;

    if (part < 0) { /* held ones can only be decided by time */
        bool any = false;

        for (int i = 0; i < n->j->parts; i++)
            any |= n->cursor[i].waiting;
        memset(held, 0, sizeof(*held) * RECORDING_PARTS_MAX);
        n->now_ns += n->period_ns;
        return any;
    }
    c = &n->cursor[part];
    if (c->edge.wall_ns > n->now_ns)
        n->now_ns = c->edge.wall_ns;
    /* The time of all is the wall clock: there is no other in recordings of several hosts. */
    verdict = sst_numbering_place(n->numbering, part, &c->edge, n->now_ns, &place);
    held[part] = verdict == SST_NUMBERING_HELD;
    if (held[part])
        return 1;
    memset(held, 0, sizeof(*held) * RECORDING_PARTS_MAX);
    err = verdict == SST_NUMBERING_PLACED ? note(n, part, place.index) : 0;
    c->waiting = false;
    c->next++;
    err = err ? err : advance(n, part);
    return err < 0 ? err : 1;
}

static int compare(const void *a, const void *b)
{
    const struct named *x = a, *y = b;

    return x->index != y->index ? (x->index > y->index) - (x->index < y->index) : x->part - y->part;
}

/* Sets of the same trigger become one. */
static int group(struct sst_recording *r)
{
    struct recording_join *j = r->join;

    qsort(j->named, (size_t)j->count, sizeof(*j->named), compare);
    j->first = calloc((size_t)j->count + 1, sizeof(*j->first));
    if (!j->first)
        return -ENOMEM;
    r->count = 0;
    for (int i = 0; i < j->count; i++)
        if (!i || j->named[i].index != j->named[i - 1].index)
            j->first[r->count++] = i;
    j->first[r->count] = j->count;
    return 0;
}

static void report(const struct naming *n)
{
    for (int i = 0; i < n->j->parts; i++) {
        struct sst_numbering_state s;

        sst_numbering_state(n->numbering, i, &s);
        if (s.slips)
            sst_log_warning("%s: its count of edges was off %llu times, and is corrected by its time stamps",
                            n->j->part[i]->dir, (unsigned long long)s.slips);
    }
}

static int name_all(struct sst_recording *r)
{
    struct naming *n = calloc(1, sizeof(*n));
    bool held[RECORDING_PARTS_MAX] = { false };
    int err = n ? 1 : -ENOMEM;

    if (err > 0) {
        n->j = r->join;
        n->period_ns = (int64_t)(1e9 / r->info.rate_hz);
        err = sst_numbering_create(&n->numbering, n->period_ns) ? -ENOMEM : 1;
    }
    for (int i = 0; err > 0 && i < r->join->parts; i++) {
        n->cursor[i].session = -1;
        err = sst_min_int(advance(n, i), 0) ? -EIO : 1;
    }
    while (err > 0)
        err = name_one(n, held);
    if (!err)
        report(n);
    if (n)
        sst_numbering_destroy(n->numbering);
    free(n);
    return err ? err : group(r);
}

/* --- as a recording ----------------------------------------------------------------------------------------------- */

int sst_recording_open_joined(struct sst_recording **out, const char *const *dirs, int count)
{
    struct sst_recording *r = calloc(1, sizeof(*r));
    int err = r ? 0 : -ENOMEM;

    if (count < 1 || count > RECORDING_PARTS_MAX) {
        sst_log_error("%d recordings cannot be joined; the maximum is %d", count, RECORDING_PARTS_MAX);
        err = -EINVAL;
    }
    if (!err) {
        r->fd = -1;
        r->join = calloc(1, sizeof(*r->join));
        r->dir = strdup(dirs[0]);
        err = r->join && r->dir ? 0 : -ENOMEM;
    }
    for (int i = 0; !err && i < count; i++) {
        struct recording_join *j = r->join;

        err = sst_recording_open(&j->part[i], dirs[i]);
        if (err)
            break;
        j->parts++;
        j->base[i] = i ? r->info.cameras : 0;
        err = merge_info(r, j->part[i]);
    }
    if (!err && r->info.rate_hz <= 0) {
        sst_log_error("%s does not say its rate, by which recordings are joined", r->dir);
        err = -EBADMSG;
    }
    err = err ? err : name_all(r);
    if (err)
        sst_recording_close(r);
    else
        *out = r;
    return err;
}

void join_close(struct recording_join *j)
{
    if (!j)
        return;
    for (int i = 0; i < j->parts; i++)
        sst_recording_close(j->part[i]);
    free(j->named);
    free(j->first);
    free(j);
}

/* Frames of a part at their places in the whole. Each host has a monotonic clock of its own: times are relative to the
 * edge. */
static void merge_set(struct sst_recording_set *all, const struct sst_recording_set *more, int base, int cameras)
{
    for (int cam = 0; cam < cameras; cam++) {
        struct sst_recording_frame *f = &all->frame[base + cam];

        *f = more->frame[cam];
        f->t_ns += all->t_ns - more->t_ns;
        f->arrival_ns += all->t_ns - more->t_ns;
    }
    all->present += more->present;
    all->edge = all->edge && more->edge;
}

/* Differences of the stamps to the edge, which each host took itself. */
static void measure_skew(struct sst_recording_set *set, int cameras)
{
    int64_t least = INT64_MAX, most = INT64_MIN;

    set->skew = (struct sst_skew){ .worst_cam = -1 };
    for (int cam = 0; cam < cameras; cam++) {
        const struct sst_recording_frame *f = &set->frame[cam];

        if (!f->present)
            continue;
        least = f->t_ns < least ? f->t_ns : least;
        if (f->t_ns > most) {
            most = f->t_ns;
            set->skew.worst_cam = cam;
        }
    }
    if (most > least) {
        set->skew.spread_ns = most - least;
        set->skew.from_edge_ns = set->edge ? most - set->t_ns : 0;
    }
}

int join_set(const struct sst_recording *r, int i, struct sst_recording_set *set)
{
    const struct recording_join *j = r->join;
    struct sst_recording_set *part = malloc(sizeof(*part));
    int err = part ? 0 : -ENOMEM;

    for (int k = j->first[i]; !err && k < j->first[i + 1]; k++) {
        const struct named *n = &j->named[k];

        err = sst_recording_set(j->part[n->part], n->set, part);
        if (!err && k == j->first[i]) {
            *set = *part;
            memset(set->frame, 0, sizeof(set->frame));
            set->present = 0;
            set->index = (uint64_t)n->index;
            set->joined = i;
        }
        if (!err)
            merge_set(set, part, j->base[n->part], j->part[n->part]->info.cameras);
    }
    if (!err)
        measure_skew(set, r->info.cameras);
    free(part);
    return err;
}

int join_frame(const struct sst_recording *r, const struct sst_recording_set *set, int cam, uint8_t **data)
{
    const struct recording_join *j = r->join;
    struct sst_recording_set *part = NULL;
    int err = -ENODATA;

    for (int k = j->first[set->joined]; k < j->first[set->joined + 1]; k++) {
        const struct named *n = &j->named[k];
        const struct sst_recording *from = j->part[n->part];

        if (cam < j->base[n->part] || cam >= j->base[n->part] + from->info.cameras)
            continue;
        part = malloc(sizeof(*part));
        err = part ? sst_recording_set(from, n->set, part) : -ENOMEM;
        err = err ? err : sst_recording_frame(from, part, cam - j->base[n->part], data);
    }
    free(part);
    return err;
}

/* {"joined": [{recording, number, line}]} */
int join_line(const struct sst_recording *r, int i, char **text)
{
    const struct recording_join *j = r->join;
    json_t *list = json_array(), *o;
    int err = 0;

    for (int k = j->first[i]; !err && k < j->first[i + 1]; k++) {
        const struct named *n = &j->named[k];
        char *line = NULL;

        err = sst_recording_line(j->part[n->part], n->set, &line);
        o = err ? NULL : json_loads(line, 0, NULL);
        if (!err && json_array_append_new(list, json_pack("{s:s, s:i, s:o}", "recording", j->part[n->part]->dir,
                                                          "number", n->set, "line", o)))
            err = -ENOMEM;
        free(line);
    }
    o = json_pack("{s:o}", "joined", list);
    *text = err || !o ? NULL : json_dumps(o, JSON_COMPACT);
    json_decref(o);
    return err ? err : *text ? 0 : -ENOMEM;
}
