/* What is found behind the foreground, as tracks beside those of what moves in front of the background: one identity
 * for a person who walks behind the leaves and comes out of them. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/live/hidden/hidden.h"
#include "pipeline/live/live_internal.h"

#define SAME_PX     3.0 /* disparities of one thing */
#define REMEMBER_NS INT64_C(6000000000)
#define PLACES      (2 * SST_LIVE_TRACKS)

/* A place at which a track was seen, to recognise it by. */
struct place {
    uint32_t id;
    double x0, y0, x1, y1, disp_px;
    int64_t seen_ns;
};

struct entry {
    uint32_t key, id; /* of the detection, of the track */
};

struct live_watch {
    struct sst_hidden *hidden;
    struct sst_hidden_thing thing[SST_HIDDEN_THINGS];
    struct entry entry[SST_HIDDEN_THINGS];
    int things, entries;
    struct {
        uint32_t from, to;
    } alias[SST_LIVE_TRACKS]; /* tracks in the open that are known under another id */
    int aliases;
    struct place place[PLACES]; /* of all tracks, also of those that have just gone */
    int places;
};

int live_watch_open(struct sst_live *live)
{
    struct sst_hidden_config *c;
    int err = -ENOMEM;

    if (!(live->cfg.alarms_per_hour > 0))
        return 0;
    live->watch = calloc(1, sizeof(*live->watch));
    c = calloc(1, sizeof(*c));
    if (live->watch && c) {
        *c = (struct sst_hidden_config){ .views = live->lf.rows * live->lf.cols,
                                         .width = live->lf.width,
                                         .height = live->lf.height,
                                         .alarms_per_hour = live->cfg.alarms_per_hour,
                                         .threads = live->cfg.threads };
        for (int k = 0; k < c->views; k++) {
            c->used[k] = live->lf.views[k].present;
            c->bx[k] = live->lf.views[k].bx;
            c->by[k] = live->lf.views[k].by;
        }
        err = sst_hidden_open(&live->watch->hidden, c);
    }
    free(c);
    if (err == -ENOMEM)
        sst_log_error("live: no memory to search for things behind leaves in %d views of %dx%d pixels",
                      live->lf.rows * live->lf.cols, live->lf.width, live->lf.height);
    if (err == -EINVAL) { /* pictures of this size are not searched */
        live_watch_close(live);
        err = 0;
    }
    return err;
}

void live_watch_close(struct sst_live *live)
{
    if (live->watch)
        sst_hidden_close(live->watch->hidden);
    free(live->watch);
    live->watch = NULL;
}

/* --- detection ------------------------------------------------------------------------------------------------------
 */

/* --- identities -----------------------------------------------------------------------------------------------------
 */

static bool is_same(const struct place *p, double x0, double y0, double x1, double y1, double disp_px)
{
    const double w = fmax(p->x1 - p->x0, x1 - x0), h = fmax(p->y1 - p->y0, y1 - y0);

    return fabs(p->x0 + p->x1 - x0 - x1) <= 2 * w && fabs(p->y0 + p->y1 - y0 - y1) <= 2 * h &&
           fabs(p->disp_px - disp_px) <= SAME_PX;
}

static void note_place(struct live_watch *w, const struct sst_live_track *t, int64_t t_ns)
{
    struct place *p = NULL;

    for (int i = 0; i < w->places && !p; i++)
        p = w->place[i].id == t->id ? &w->place[i] : NULL;
    if (!p && w->places == PLACES) {
        memmove(&w->place[0], &w->place[1], sizeof(*p) * --w->places);
    }
    p = p ? p : &w->place[w->places++];
    *p = (struct place){ t->id, t->x0, t->y0, t->x1, t->y1, t->disp_px, t_ns };
}

static void forget_places(struct live_watch *w, int64_t t_ns)
{
    int kept = 0;

    for (int i = 0; i < w->places; i++)
        if (t_ns - w->place[i].seen_ns <= REMEMBER_NS)
            w->place[kept++] = w->place[i];
    w->places = kept;
}

/* The track that was last seen at this place; 0: none. */
static uint32_t recognise(const struct live_watch *w, double x0, double y0, double x1, double y1, double disp_px)
{
    uint32_t id = 0;
    int64_t newest_ns = INT64_MIN;

    for (int i = 0; i < w->places; i++) {
        if (w->place[i].seen_ns <= newest_ns || !is_same(&w->place[i], x0, y0, x1, y1, disp_px))
            continue;
        newest_ns = w->place[i].seen_ns;
        id = w->place[i].id;
    }
    return id;
}

static uint32_t id_of(const struct live_watch *w, uint32_t key)
{
    for (int i = 0; i < w->entries; i++)
        if (w->entry[i].key == key)
            return w->entry[i].id;
    return 0;
}

static uint32_t known_as(const struct live_watch *w, uint32_t id)
{
    for (int i = 0; i < w->aliases; i++)
        if (w->alias[i].from == id)
            return w->alias[i].to;
    return id;
}

/* Entries of detections that have ended, aliases of tracks that have. */
static void forget_ended(struct live_watch *w, const struct sst_live_track *open, int n)
{
    int kept = 0;

    for (int i = 0; i < w->entries; i++)
        for (int k = 0; k < w->things; k++)
            if (w->thing[k].key == w->entry[i].key)
                w->entry[kept++] = w->entry[i];
    w->entries = kept;
    kept = 0;
    for (int i = 0; i < w->aliases; i++)
        for (int k = 0; k < n; k++)
            if (open[k].id == w->alias[i].from)
                w->alias[kept++] = w->alias[i];
    w->aliases = kept;
}

/* A track in the open that is new may have come out of the leaves. */
static void meet_open(struct live_watch *w, const struct sst_live_track *open, int n)
{
    for (int i = 0; i < n; i++) {
        bool known = false;
        uint32_t id;

        for (int k = 0; k < w->places; k++)
            known |= w->place[k].id == known_as(w, open[i].id);
        id = known ? 0 : recognise(w, open[i].x0, open[i].y0, open[i].x1, open[i].y1, open[i].disp_px);
        for (int k = 0; k < n; k++)
            id = k != i && known_as(w, open[k].id) == id ? 0 : id; /* it is another one, which is there, too */
        if (id && w->aliases < SST_LIVE_TRACKS) {
            w->alias[w->aliases].from = open[i].id;
            w->alias[w->aliases++].to = id;
        }
    }
}

/* A new detection behind the leaves gets the id of what was seen there, or a new one. */
static void meet_hidden(struct sst_live *live)
{
    struct live_watch *w = live->watch;

    for (int i = 0; i < w->things; i++) {
        const struct sst_hidden_thing *t = &w->thing[i];
        uint32_t id;

        if (!t->reported || id_of(w, t->key) || w->entries == SST_HIDDEN_THINGS)
            continue;
        id = recognise(w, t->x0, t->y0, t->x1, t->y1, t->disp_px);
        w->entry[w->entries++] = (struct entry){ t->key, id ? id : sst_livescene_new_track(live->scene) };
    }
}

int live_watch_update(struct sst_live *live, int64_t t_ns)
{
    const struct sst_lightfield *lf = &live->lf;
    struct live_watch *w = live->watch;
    struct sst_live_track open[SST_LIVE_TRACKS];
    struct sst_hidden_input in = { .t_ns = t_ns };
    int n, err;

    if (!w)
        return 0;
    if (live->ready && lf->views[lf->ref_view].disp.data && !isnan(live->min_px)) {
        in.far_px = live->min_px;
        in.near_px = live->max_px;
        in.disp = &lf->views[lf->ref_view].disp;
        in.disp_min_px = lf->disp_min_px;
        for (int k = 0; k < lf->rows * lf->cols; k++) {
            in.image[k] = lf->views[k].present && lf->views[k].image.plane[0] ? &lf->views[k].image : NULL;
            in.changed[k] = live->changes.map[k];
        }
        err = sst_hidden_update(w->hidden, &in);
        if (err)
            return err;
        w->things = sst_hidden_things(w->hidden, w->thing);
    }
    n = sst_livescene_tracks(live->scene, open);
    forget_ended(w, open, n);
    forget_places(w, t_ns);
    meet_open(w, open, n);
    meet_hidden(live);
    n = live_watch_tracks(live, open, n);
    for (int i = 0; i < n; i++)
        note_place(w, &open[i], t_ns);
    return 0;
}

static struct sst_live_track as_track(const struct sst_hidden_thing *t, uint32_t id)
{
    return (struct sst_live_track){ .id = id,
                                    .state = SST_LIVE_TRACK_SEEN,
                                    .hidden = true,
                                    .x0 = t->x0,
                                    .y0 = t->y0,
                                    .x1 = t->x1,
                                    .y1 = t->y1,
                                    .vx_px_s = t->vx_px_s,
                                    .vy_px_s = t->vy_px_s,
                                    .disp_px = t->disp_px,
                                    .first_ns = t->first_ns,
                                    .seen_ns = t->seen_ns };
}

int live_watch_tracks(const struct sst_live *live, struct sst_live_track track[SST_LIVE_TRACKS], int n)
{
    const struct live_watch *w = live->watch;

    for (int i = 0; i < n && w; i++)
        track[i].id = known_as(w, track[i].id);
    for (int i = 0; w && i < w->things; i++) {
        const uint32_t id = w->thing[i].reported ? id_of(w, w->thing[i].key) : 0;
        int at = 0;

        while (at < n && track[at].id != id)
            at++;
        if (!id || at == SST_LIVE_TRACKS || (at < n && track[at].state == SST_LIVE_TRACK_SEEN))
            continue;
        if (at < n) { /* covered, as its track knows, and seen through the leaves */
            const struct sst_live_track before = track[at];

            track[at] = as_track(&w->thing[i], id);
            track[at].label = before.label;
            track[at].first_ns = before.first_ns;
        } else {
            track[n++] = as_track(&w->thing[i], id);
        }
    }
    return n;
}
