/* Step 1: find the changed tiles of all views. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/live/frames/frames_internal.h"

#define SKIP_SETS    4        /* every view is scanned at least once in this number of sets, ... */
#define REST_SETS    50       /* ... after this number of sets in which nothing changed, ... */
#define REST_SKIP    16       /* ... in this number, ... */
#define REST_NS      120000000 /* ... or twice that where sets come faster than this */
#define FEW_SCANS    3        /* up to this number of scans, another thread costs more than it saves */
#define FEW_VIEWS    12       /* up to this number of views, all are scanned */
#define MOST_CHANGED 0.6      /* from this fraction of all tiles on, everything is accepted */

static void set_all_dirty(const struct sst_liveframes *f, struct live_view *v)
{
    memset(v->dirty, 1, (size_t)raw_tiles(f));
    v->verdict.changed = raw_tiles(f);
    v->verdict.whole = true;
}

void frames_reject(struct live_view *v, const struct decoder *d)
{
    v->refused = true;
    v->last_bytes = 0;
    v->verdict = (struct verdict){ 0 };
    snprintf(v->fault, sizeof(v->fault), "%.190s", decoder_fault(d));
}

static int scan_view(void *arg, int index, int worker)
{
    struct sst_liveframes *f = arg;
    const int k = f->list[index];
    struct live_view *v = &f->view[k];
    const struct decoder_frame frame = frame_of(f, k);
    int err;

    if (atomic_load(&f->cancelled))
        return -ECANCELED;
    v->looked = true;
    if (v->made && !f->all && v->last_bytes && frame.bytes == v->last_bytes &&
        !memcmp(frame.data, v->last, frame.bytes))
        return 0;
    err = decoder_read_means(f->decoder[worker], &frame, &v->watch.now, v->index.room ? &v->index : NULL);
    if (err == -EBADMSG) {
        frames_reject(v, f->decoder[worker]);
        return 0;
    }
    if (err && err != -ENOTSUP)
        return err;
    if (!err)
        v->verdict = detector_judge(&v->watch, v->dirty);
    else
        v->watch.now.planes = 0;
    if (err || !v->made || f->all)
        set_all_dirty(f, v);
    v->last_bytes = frame.bytes <= f->last_room ? frame.bytes : 0;
    if (v->last_bytes)
        memcpy(v->last, frame.data, v->last_bytes);
    return 0;
}

/* Every key view is scanned in this number of sets. */
static int key_sets(struct sst_liveframes *f)
{
    const int64_t since_ns = f->in->t_ns - f->t_ns, step_ns = since_ns < 2 * REST_NS ? since_ns : 2 * REST_NS;

    f->t_ns = f->in->t_ns;
    f->step_ns += (step_ns - f->step_ns) / 8;
    return f->rested < REST_SETS ? 1 : f->step_ns < REST_NS ? 4 : 2;
}

/* Views to scan first: all, or the key views and the ones in turn. */
static int first_views(struct sst_liveframes *f)
{
    const int rest = key_sets(f), sets = rest > 1 ? REST_SKIP * rest / 2 : SKIP_SETS;
    const int in_turn = (f->used - SST_LIVE_KEY_VIEWS + sets - 1) / sets;
    int n = 0, others = 0, keys = 0;

    for (int k = 0; k < f->views; k++) {
        struct live_view *v = &f->view[k];
        /* While the scene rests, key views in turn. The other views form a ring: `sets` steps of in_turn views cover
         * all of it. */
        const bool key = v->key && keys++ % rest == f->turn % rest;
        const bool turn = !v->key && v->used && (others++ / sst_max_int(in_turn, 1)) % sets == f->turn % sets;

        if (has_frame(f, k) && (f->all || f->used <= FEW_VIEWS || key || turn || !v->made || v->broken))
            f->list[n++] = k;
    }
    f->turn = (f->turn + 1) % (2 * REST_SKIP);
    return n;
}

static int other_views(struct sst_liveframes *f)
{
    int n = 0;

    for (int k = 0; k < f->views; k++) {
        if (has_frame(f, k) && !f->view[k].looked)
            f->list[n++] = k;
    }
    return n;
}

static bool any_changed(const struct sst_liveframes *f)
{
    for (int k = 0; k < f->views; k++) {
        if (f->view[k].verdict.changed)
            return true;
    }
    return false;
}

/* Has something changed that is not text in the frames? */
static bool scene_changed(const struct sst_liveframes *f)
{
    for (int k = 0; k < f->views; k++) {
        if (f->view[k].verdict.changed && !frames_burnt_alone(&f->burnt, f->view[k].dirty))
            return true;
    }
    return false;
}

static void learn_text(struct sst_liveframes *f)
{
    const uint8_t *changed[SST_MAX_VIEWS];
    int n = 0;

    for (int k = 0; k < f->views; k++) {
        const struct live_view *v = &f->view[k];

        if (v->looked && !v->refused && !v->verdict.whole)
            changed[n++] = v->dirty;
    }
    frames_burnt_learn(&f->burnt, changed, n);
}

static void leave_text(struct sst_liveframes *f)
{
    for (int k = 0; k < f->views; k++) {
        struct live_view *v = &f->view[k];
        const bool part = v->verdict.changed && !v->verdict.whole;
        const int left = part ? frames_burnt_leave(&f->burnt, v->dirty) : 0;

        v->verdict.changed -= left;
        if (left)
            v->last_bytes = 0; /* the same frame again differs from the stored tiles */
    }
}

/* True if the light changed, or so many tiles that accepting all is cheaper. All views have been scanned. */
static bool is_whole(const struct sst_liveframes *f)
{
    int looked = 0, lit = 0, over = 0;
    int64_t changed = 0;

    for (int k = 0; k < f->views; k++) {
        const struct live_view *v = &f->view[k];

        if (!v->looked || v->refused)
            continue;
        looked++;
        changed += v->verdict.changed;
        over += v->verdict.light > SST_DETECTOR_LIGHT;
        lit += v->verdict.light > SST_DETECTOR_LIGHT / 2;
    }
    return looked && ((over && 2 * lit > looked) || (double)changed > MOST_CHANGED * looked * raw_tiles(f));
}

int frames_scan(struct sst_liveframes *f)
{
    const bool read = frames_burnt_read(&f->burnt);
    bool changed;
    int n, err;

    if (!f->cfg->skip_change) {
        for (int k = 0; k < f->views; k++) {
            f->view[k].looked = has_frame(f, k);
            if (f->view[k].looked)
                set_all_dirty(f, &f->view[k]);
        }
        return 0;
    }
    n = first_views(f);
    err = sst_parallel_for(n, n > FEW_SCANS ? f->threads : 1, scan_view, f);
    changed = scene_changed(f);
    f->rested = changed ? 0 : sst_min_int(f->rested + 1, REST_SETS);
    if (!err && (changed || (read && any_changed(f))))
        err = sst_parallel_for(other_views(f), f->threads, scan_view, f);
    if (err)
        return err;
    if (!any_changed(f) || !is_whole(f)) {
        learn_text(f);
        if (!read)
            leave_text(f);
        else if (any_changed(f))
            frames_burnt_accepted(&f->burnt);
    } else {
        frames_burnt_accepted(&f->burnt);
        for (int k = 0; k < f->views; k++) {
            if (f->view[k].looked && !f->view[k].refused)
                set_all_dirty(f, &f->view[k]);
        }
    }
    return 0;
}
