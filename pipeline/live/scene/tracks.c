/* Tracks: a moving object in front of the background keeps its identity from set to set, also while something nearer
 * occludes it, while it passes another object, and while it stands so long that it has become background.
 *
 * Pieces of the foreground are assigned to the tracks that they fit best by predicted place, disparity and colours. A
 * track without a piece is judged by the disparities at its place: its own are still there (it stands), nearer ones are
 * (it is occluded), or neither (it has left). Boxes are in cells of the reference key. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/scene/scene_internal.h"

#define DISP_Q6     256.0 /* of one thing from set to set */
#define COLOUR      96.0  /* difference of mean colours that counts as much as a whole reach */
#define REACH       0.75  /* of the mean size: of the centre from where it is expected, ... */
#define REACH_SPEED 1.6   /* ... and of the own size per second since it was seen, as speeds change */
#define REACH_S     2.0
#define GAIN        0.6 /* of a piece's place and size against the predicted ones, */
#define GAIN_SPEED  0.3
#define GAIN_SIZE   0.3
#define SPEED_MOST  6.0  /* own widths per second */
#define JOIN        0.35 /* of the wider: pieces with a smaller gap to a track, at its disparity, are parts of it */
#define BEHIND_X    1.0  /* of the wider, and ... */
#define BEHIND_Y    2.0  /* ... of the longer side of the smaller: gap that a nearer surface hides: */
#define HIDES_Q6    256  /* nearer at least: leaves are not behind each other; */
#define HIDDEN      0.3  /* of the gap at least, */
#define SHOWN       0.35 /* and at most this of it shows a farther surface */
#define LEAST_CELLS 40   /* of a thing that appears */
#define THERE       0.35 /* fraction of its usual cells by which a thing without a piece is still there */
#define COVERED     0.4  /* of a box: behind something nearer */
#define NEARER_Q6   128
#define OUTSIDE     0.5
#define LOST_NS     INT64_C(1000000000)
#define COVERED_NS  INT64_C(6000000000)
#define STILL_NS    INT64_C(600000000000) /* without motion: part of the scene */
/* After a longer gap, of PAUSE_SETS intervals at least, the displacement is measured from the next piece on. */
#define PAUSE_NS      1e9
#define PAUSE_SETS    2.5
#define MOVING_SETS   3 /* a track is reported once seen in these sets, for MOVING_NS, and moved by: */
#define MOVING_NS     INT64_C(300000000)
#define MOVED         0.5 /* of its size, and */
#define LABEL_SETS    2   /* least number of sets with its most frequent label for a track to have that label; */
#define LABEL_SHARE   0.3 /* and their least share of its sets */
#define MOVED_UNKNOWN 1.5 /* without a label, with one that does not move, or at longer mean intervals than RARE_NS */
#define RARE_NS       5e8
#define UNKNOWN_SETS  6
#define UNKNOWN_SHARE 0.01 /* of the picture, at least */
/* A smaller object may be a twig, and needs its label in this number of sets and this share of all sets. */
#define SMALL_SHARE      0.002
#define SMALL_SETS       4
#define SMALL_LABEL      0.5
#define MOVED_CELLS      6.0
#define MOVED_Q6         160.0 /* or nearer or farther by this */
#define STRAIGHT         0.25  /* least ratio of displacement to path length, in the picture or in depth; */
#define STRAIGHT_UNKNOWN 0.6   /* without a label, or with one that does not move */

/* Of the usual class lists: CamVid, Cityscapes, ADE20K. */
static const char *const rooted[] = {
    "Sky",      "Building",   "Wall",         "House",          "Bridge",    "Pole",  "Road",  "Pavement",
    "Sidewalk", "Terrain",    "Ground",       "Floor",          "Earth",     "Fence", "Table", "Furniture",
    "Poster",   "SignSymbol", "Traffic sign", "Traffic light",  "Tree",      "Bush",  "Plant", "Vegetation",
    "Grass",    "Flag",       "Streetlight",  "VegetationMisc", "Misc_Text", "Sign",
};

void scene_tracks_init(struct scene_tracks *t, const struct sst_classes *classes)
{
    *t = (struct scene_tracks){ .next_id = 1 };
    for (size_t i = 0; i < ARRAY_LEN(rooted); i++) {
        const int label = sst_classes_find(classes, rooted[i]);

        if (label)
            t->motion[label] = SCENE_ROOTED;
    }
}

/* --- geometry ----------------------------------------------------------------------------------------------------- */

struct extent {
    double x, y, w, h; /* centre, size */
};

static struct extent extent_of(const struct sst_rect *r)
{
    return (struct extent){ 0.5 * (r->x0 + r->x1), 0.5 * (r->y0 + r->y1), r->x1 - r->x0, r->y1 - r->y0 };
}

static struct extent union_of(struct extent a, struct extent b)
{
    const double x0 = fmin(a.x - a.w / 2, b.x - b.w / 2), x1 = fmax(a.x + a.w / 2, b.x + b.w / 2);
    const double y0 = fmin(a.y - a.h / 2, b.y - b.h / 2), y1 = fmax(a.y + a.h / 2, b.y + b.h / 2);

    return (struct extent){ (x0 + x1) / 2, (y0 + y1) / 2, x1 - x0, y1 - y0 };
}

static struct extent extent_of_track(const struct scene_track *a)
{
    return (struct extent){ a->x, a->y, a->w, a->h };
}

static bool has_middle(struct extent a, struct extent b)
{
    return fabs(b.x - a.x) <= a.w / 2 && fabs(b.y - a.y) <= a.h / 2;
}

/* Side by side, or one above the other, with a narrow gap; or overlapping. */
static bool beside(struct extent a, struct extent b)
{
    const double gap_x = fabs(a.x - b.x) - (a.w + b.w) / 2, gap_y = fabs(a.y - b.y) - (a.h + b.h) / 2;
    const double room_x = JOIN * fmax(a.w, b.w), room_y = JOIN * fmax(a.h, b.h);

    return (gap_x <= room_x && -gap_y >= fmin(a.h, b.h) / 2) || (gap_y <= room_y && -gap_x >= fmin(a.w, b.w) / 2);
}

/* Surfaces at a place, as fractions of a box. */
struct place {
    double own, nearer, farther, outside;
};

static struct place look(struct extent at, double disp_q6, double nearer_q6, const struct sst_map_u16 *disp)
{
    const int x0 = (int)lround(at.x - at.w / 2), x1 = (int)lround(at.x + at.w / 2);
    const int y0 = (int)lround(at.y - at.h / 2), y1 = (int)lround(at.y + at.h / 2);
    const int rx0 = sst_max_int(x0, 0), rx1 = sst_min_int(x1, disp->width);
    const int ry0 = sst_max_int(y0, 0), ry1 = sst_min_int(y1, disp->height);
    const double all = fmax((double)(x1 - x0) * (y1 - y0), 1);
    int64_t own = 0, nearer = 0, farther = 0, in = 0;

    for (int y = ry0; y < ry1; y++) {
        const uint16_t *row = sst_map_u16_row(disp, y);

        for (int x = rx0; x < rx1; x++) {
            const double d = row[x] - disp_q6;

            in++;
            if (row[x] == SST_DISP_NONE)
                continue;
            own += fabs(d) <= NEARER_Q6;
            nearer += d > nearer_q6;
            farther += d < -NEARER_Q6;
        }
    }
    return (struct place){ (double)own / all, (double)nearer / all, (double)farther / all, 1 - (double)in / all };
}

struct span {
    double middle, size;
};

/* The gap between two boxes along one axis, and where they face each other along the other one. */
static struct span between(struct span a, struct span b)
{
    const double lower = fmin(a.middle + a.size / 2, b.middle + b.size / 2);
    const double upper = fmax(a.middle - a.size / 2, b.middle - b.size / 2);

    return (struct span){ (lower + upper) / 2, fmax(fabs(upper - lower), 1) };
}

/* Are two pieces of one disparity parts of a thing, the rest of which is behind something nearer? */
static bool joined_behind(struct extent a, struct extent b, double disp_q6, const struct sst_map_u16 *disp)
{
    const double gap_x = fabs(a.x - b.x) - (a.w + b.w) / 2, gap_y = fabs(a.y - b.y) - (a.h + b.h) / 2;
    struct span x, y;
    struct place at;

    if (gap_x > BEHIND_X * fmax(a.w, b.w) || gap_y > BEHIND_Y * fmin(fmax(a.w, a.h), fmax(b.w, b.h)))
        return false;
    x = between((struct span){ a.x, a.w }, (struct span){ b.x, b.w });
    y = between((struct span){ a.y, a.h }, (struct span){ b.y, b.h });
    at = look((struct extent){ .x = x.middle, .y = y.middle, .w = x.size, .h = y.size }, disp_q6, HIDES_Q6, disp);
    return at.nearer >= HIDDEN && at.farther <= SHOWN;
}

static bool is_one(struct extent a, struct extent b, double disp_q6, const struct sst_map_u16 *disp)
{
    return beside(a, b) || joined_behind(a, b, disp_q6, disp);
}

/* Pieces of a set, and the tracks that have them: -1: none. */
struct set {
    const struct scene_piece *piece;
    int pieces;
    int *owner; /* [pieces] */
    const struct sst_map_u16 *disp;
    double dt_s;
    int64_t t_ns;
};

/* --- assignment --------------------------------------------------------------------------------------------------- */

static double colour_distance(const struct scene_track *a, const struct scene_piece *p)
{
    double sum = 0;

    for (int half = 0; half < 2; half++)
        for (int c = 0; c < 3; c++)
            sum += fabs(a->colour[half][c] - p->colour[half][c]);
    return sum / 6;
}

/* How badly a piece fits a track's prediction; infinite: not at all. */
static double misfit(const struct scene_track *a, const struct scene_piece *p, int64_t t_ns)
{
    const struct extent e = extent_of(&p->at);
    const double speed = REACH_SPEED * sst_clamp_double((double)(t_ns - a->seen_ns) * 1e-9, 0, REACH_S);
    const double dx = fabs(e.x - a->x) / (REACH * 0.5 * (a->w + e.w) + speed * a->w);
    const double dy = fabs(e.y - a->y) / (REACH * 0.5 * (a->h + e.h) + speed * a->h);
    const double dd = fabs(p->disp_q6 - a->disp_q6) / DISP_Q6;

    return dx > 1 || dy > 1 || dd > 1 ? INFINITY : dx + dy + dd + colour_distance(a, p) / COLOUR;
}

/* The best pairs first. Ties: the older track, the first piece. */
static void assign(struct scene_tracks *t, const struct scene_piece *piece, int pieces, int64_t t_ns, int *owner)
{
    for (;;) {
        double best = INFINITY;
        int track = -1, of = -1;

        for (int i = 0; i < t->count; i++) {
            for (int k = 0; k < pieces && t->track[i].piece < 0; k++) {
                const double m = owner[k] < 0 ? misfit(&t->track[i], &piece[k], t_ns) : INFINITY;

                if (m < best) {
                    best = m;
                    track = i;
                    of = k;
                }
            }
        }
        if (track < 0)
            return;
        t->track[track].piece = of;
        owner[of] = track;
    }
}

/* --- tracks with a piece ------------------------------------------------------------------------------------------ */

static void move_to(struct scene_track *a, struct extent to, double dt_s)
{
    const double rx = to.x - a->x, ry = to.y - a->y, most = SPEED_MOST * fmax(a->w, a->h);

    a->x += GAIN * rx;
    a->y += GAIN * ry;
    if (dt_s > 0) {
        a->vx = sst_clamp_double(a->vx + GAIN_SPEED * rx / dt_s, -most, most);
        a->vy = sst_clamp_double(a->vy + GAIN_SPEED * ry / dt_s, -most, most);
    }
}

static void see(struct scene_track *a, struct extent at, int64_t t_ns)
{
    a->at[0] = at.x - at.w / 2;
    a->at[1] = at.y - at.h / 2;
    a->at[2] = at.x + at.w / 2;
    a->at[3] = at.y + at.h / 2;
    a->state = SST_LIVE_TRACK_SEEN;
    a->seen_ns = a->moved_ns = t_ns;
    a->sets++;
}

static void follow_piece(struct scene_track *a, const struct scene_piece *p, struct extent to, int64_t cells,
                         const struct set *set)
{
    move_to(a, to, set->dt_s);
    a->w += GAIN_SIZE * (to.w - a->w);
    a->h += GAIN_SIZE * (to.h - a->h);
    a->disp_q6 += GAIN * (p->disp_q6 - a->disp_q6);
    a->fill += GAIN_SIZE * ((double)cells / (to.w * to.h) - a->fill);
    for (int half = 0; half < 2; half++)
        for (int c = 0; c < 3; c++)
            a->colour[half][c] += (float)GAIN_SIZE * (p->colour[half][c] - a->colour[half][c]);
    if (p->label <= SST_MAX_CLASSES)
        a->votes[p->label]++;
    see(a, to, set->t_ns);
}

/* One piece of several tracks, which pass each other: they go on as they went, together within the piece. */
static void share_piece(struct scene_tracks *t, const struct scene_piece *p, const bool *shares, int64_t t_ns)
{
    const struct extent e = extent_of(&p->at);
    struct extent all = { 0, 0, 0, 0 };
    bool first = true;

    for (int i = 0; i < t->count; i++) {
        if (!shares[i])
            continue;
        all = first ? extent_of_track(&t->track[i]) : union_of(all, extent_of_track(&t->track[i]));
        first = false;
    }
    for (int i = 0; i < t->count; i++) {
        if (!shares[i])
            continue;
        t->track[i].x += GAIN * (e.x - all.x);
        t->track[i].y += GAIN * (e.y - all.y);
        see(&t->track[i], extent_of_track(&t->track[i]), t_ns);
    }
}

/* Follow the piece of track i with all others that are parts of it, or share it. */
static void follow(struct scene_tracks *t, int i, const struct set *set)
{
    const struct scene_piece *piece = set->piece;
    struct scene_track *a = &t->track[i];
    const struct scene_piece *own = &piece[a->piece];
    struct extent to = extent_of(&own->at);
    int64_t cells = own->cells;
    bool shares[SCENE_TRACKS] = { false };
    int sharing = 1;

    shares[i] = true;
    for (int k = 0; k < t->count; k++) {
        const struct scene_track *b = &t->track[k];

        if (b->piece >= 0 || !b->reported || !has_middle(to, extent_of_track(b)) ||
            fabs(b->disp_q6 - own->disp_q6) > DISP_Q6)
            continue;
        shares[k] = true;
        sharing++;
    }
    if (sharing > 1) {
        share_piece(t, own, shares, set->t_ns);
        for (int k = 0; k < t->count; k++)
            t->track[k].piece = shares[k] ? a->piece : t->track[k].piece;
        return;
    }
    for (int k = 0; k < set->pieces; k++) {
        const struct extent e = extent_of(&piece[k].at);

        if (set->owner[k] >= 0 || fabs(piece[k].disp_q6 - a->disp_q6) > DISP_Q6 / 2 ||
            !is_one(to, e, a->disp_q6, set->disp))
            continue;
        set->owner[k] = i;
        to = union_of(to, e);
        cells += piece[k].cells;
    }
    follow_piece(a, own, to, cells, set);
}

/* --- tracks without a piece --------------------------------------------------------------------------------------- */

/* @return false: it has left */
static bool wait_for(struct scene_track *a, const struct sst_map_u16 *disp, int64_t t_ns)
{
    struct place at = look(extent_of_track(a), a->disp_q6, NEARER_Q6, disp);

    if (at.outside > OUTSIDE)
        return false;
    if (a->state == SST_LIVE_TRACK_COVERED && at.nearer < COVERED) { /* it would be seen there: it waits at the edge */
        a->x = a->before_x;
        a->y = a->before_y;
        at = look(extent_of_track(a), a->disp_q6, NEARER_Q6, disp);
    }
    if (at.own >= THERE * a->fill) { /* it stands, and becomes background */
        a->vx = a->vy = 0;
        a->state = SST_LIVE_TRACK_STILL;
        a->seen_ns = t_ns;
        return t_ns - a->moved_ns < STILL_NS;
    }
    if (at.nearer >= COVERED) {
        a->state = SST_LIVE_TRACK_COVERED;
        return t_ns - a->seen_ns < COVERED_NS;
    }
    return t_ns - a->seen_ns < LOST_NS;
}

/* --- all ---------------------------------------------------------------------------------------------------------- */

static void predict(struct scene_tracks *t, double dt_s)
{
    for (int i = 0; i < t->count; i++) {
        struct scene_track *a = &t->track[i];

        a->before_x = a->x;
        a->before_y = a->y;
        a->before_q6 = a->disp_q6;
        a->x += a->vx * dt_s;
        a->y += a->vy * dt_s;
        a->piece = -1;
    }
}

static void add(struct scene_tracks *t, const struct scene_piece *p, struct extent e, int64_t cells, int64_t t_ns)
{
    struct scene_track *a = &t->track[t->count];

    if (t->count == SCENE_TRACKS || cells < LEAST_CELLS)
        return;
    *a = (struct scene_track){ .x = e.x,
                               .y = e.y,
                               .w = e.w,
                               .h = e.h,
                               .disp_q6 = p->disp_q6,
                               .fill = (double)cells / (e.w * e.h),
                               .from_x = e.x,
                               .from_y = e.y,
                               .from_q6 = p->disp_q6,
                               .before_x = e.x,
                               .before_y = e.y,
                               .before_q6 = p->disp_q6,
                               .first_ns = t_ns,
                               .way_ns = t_ns };
    memcpy(a->colour, p->colour, sizeof(a->colour));
    if (p->label <= SST_MAX_CLASSES)
        a->votes[p->label]++;
    see(a, e, t_ns);
    t->count++;
}

/* After a pause the piece may be of other leaves: measure the motion from here. */
static void start_again(struct scene_track *a, const struct scene_piece *p, int64_t t_ns)
{
    const struct extent e = extent_of(&p->at);

    a->x = a->from_x = a->before_x = e.x;
    a->y = a->from_y = a->before_y = e.y;
    a->disp_q6 = a->from_q6 = a->before_q6 = p->disp_q6;
    a->vx = a->vy = a->gone = a->gone_q6 = 0;
    a->way_ns = t_ns;
    a->sets = 0;
    memset(a->votes, 0, sizeof(a->votes));
}

/* New tracks of the pieces without one; pieces beside each other, at one disparity, are parts of one object. */
static void begin(struct scene_tracks *t, const struct set *set)
{
    const struct scene_piece *piece = set->piece;
    int *owner = set->owner;

    for (int i = 0; i < set->pieces; i++) {
        struct extent e = extent_of(&piece[i].at);
        int64_t cells = piece[i].cells;

        if (owner[i] >= 0)
            continue;
        for (int k = i + 1; k < set->pieces; k++) {
            const struct extent other = extent_of(&piece[k].at);

            if (owner[k] >= 0 || fabs((double)piece[k].disp_q6 - piece[i].disp_q6) > DISP_Q6 / 2 ||
                !is_one(e, other, piece[i].disp_q6, set->disp))
                continue;
            owner[k] = SCENE_TRACKS;
            e = union_of(e, other);
            cells += piece[k].cells;
        }
        add(t, &piece[i], e, cells, set->t_ns);
    }
}

static int most_votes(const struct scene_track *a)
{
    int best = 0;

    for (int i = 1; i <= SST_MAX_CLASSES; i++)
        best = a->votes[i] > (best ? a->votes[best] : 0) ? i : best;
    return a->votes[best] >= fmax(LABEL_SETS, LABEL_SHARE * a->sets) ? best : 0;
}

int scene_track_label(const struct scene_tracks *t, const struct scene_track *a)
{
    const int label = most_votes(a);

    return t->motion[label] == SCENE_MOBILE ? label : 0;
}

/* Is a track that is not reported yet part of one of the first `count`? */
static bool is_part(const struct scene_tracks *t, int count, const struct scene_track *a,
                    const struct sst_map_u16 *disp)
{
    for (int k = 0; k < count && !a->reported; k++)
        if (fabs(t->track[k].disp_q6 - a->disp_q6) <= DISP_Q6 / 2 &&
            is_one(extent_of_track(&t->track[k]), extent_of_track(a), a->disp_q6, disp))
            return true;
    return false;
}

/* Is it known as something that moves? A small one may be a twig that the network has seen something in once. */
static bool is_known(const struct scene_track *a, const struct scene_tracks *t, double picture)
{
    const int label = most_votes(a);

    if (!label || t->motion[label] != SCENE_MOBILE)
        return false;
    return a->w * a->h >= SMALL_SHARE * picture || a->votes[label] >= fmax(SMALL_SETS, SMALL_LABEL * a->sets);
}

/* Has it moved as things do, and not as leaves do? */
static bool moves(const struct scene_track *a, const struct scene_tracks *t, double picture)
{
    const double dx = a->x - a->from_x, dy = a->y - a->from_y, way = hypot(dx, dy);
    const bool known = is_known(a, t, picture);
    /* With long intervals between sets, swinging leaves are indistinguishable from motion in one direction. */
    const bool often = (double)(a->seen_ns - a->way_ns) <= RARE_NS * (double)(a->sets - 1);
    const double far = known && often ? MOVED : MOVED_UNKNOWN, deeper = fabs(a->disp_q6 - a->from_q6);

    if (a->sets < (known ? MOVING_SETS : UNKNOWN_SETS) || a->seen_ns - a->way_ns < MOVING_NS)
        return false;
    if (known && deeper >= fmax(MOVED_Q6 * far / MOVED, STRAIGHT * a->gone_q6))
        return true;
    if (way < (known ? STRAIGHT : STRAIGHT_UNKNOWN) * a->gone || (!known && a->w * a->h < UNKNOWN_SHARE * picture))
        return false;
    return fabs(dx) >= fmax(far * a->w, MOVED_CELLS) || fabs(dy) >= fmax(far * a->h, MOVED_CELLS);
}

/* Where time goes back all was seen just before this set, which itself is not over. */
static void start_times(struct scene_tracks *t, int64_t t_ns)
{
    for (int i = 0; i < t->count; i++) {
        struct scene_track *a = &t->track[i];
        int64_t *const all[] = { &a->first_ns, &a->seen_ns, &a->moved_ns, &a->way_ns };

        for (size_t k = 0; k < ARRAY_LEN(all); k++)
            *all[k] = *all[k] < t_ns ? *all[k] : t_ns - 1;
    }
}

void scene_tracks_update(struct scene_tracks *t, const struct scene_piece *piece, int pieces,
                         const struct sst_map_u16 *disp, int64_t t_ns)
{
    const double dt_s = t->count ? fmax((double)(t_ns - t->t_ns) * 1e-9, 0) : 0;
    int owner[SCENE_PIECES], kept = 0;
    const struct set set = { piece, pieces, owner, disp, dt_s, t_ns };

    if (t_ns < t->t_ns)
        start_times(t, t_ns);
    t->t_ns = t_ns;
    for (int k = 0; k < pieces; k++)
        owner[k] = -1;
    predict(t, fmin(dt_s, REACH_S));
    assign(t, piece, pieces, t_ns, owner);
    for (int i = 0; i < t->count; i++) {
        struct scene_track *a = &t->track[i];

        if (a->piece < 0 || a->seen_ns == t_ns)
            continue;
        if (!a->reported && (double)(t_ns - a->moved_ns) > fmax(PAUSE_NS, PAUSE_SETS * 1e9 * dt_s))
            start_again(a, &piece[a->piece], t_ns);
        follow(t, i, &set);
    }
    for (int i = 0; i < t->count; i++) {
        struct scene_track *a = &t->track[i];

        if ((a->piece < 0 && !wait_for(a, disp, t_ns)) || is_part(t, kept, a, disp))
            continue;
        a->gone += hypot(a->x - a->before_x, a->y - a->before_y);
        a->gone_q6 += fabs(a->disp_q6 - a->before_q6);
        /* Where it would be is no motion. */
        if (!a->reported && a->piece >= 0 && moves(a, t, (double)disp->width * disp->height)) {
            a->reported = true;
            a->id = t->next_id++;
        }
        t->track[kept++] = *a;
    }
    t->count = kept;
    begin(t, &set);
}

void scene_tracks_shift(struct scene_tracks *t, int by)
{
    for (int i = 0; i < t->count; i++) {
        t->track[i].disp_q6 += by;
        t->track[i].from_q6 += by;
    }
}

int scene_tracks_list(const struct scene_tracks *t, double disp_min_px, struct sst_live_track out[SST_LIVE_TRACKS])
{
    int n = 0;

    for (int i = 0; i < t->count; i++) {
        const struct scene_track *a = &t->track[i];

        if (!a->reported)
            continue;
        out[n++] = (struct sst_live_track){ .id = a->id,
                                            /* Until it is lost, its place is predicted. */
                                            .state = a->seen_ns < t->t_ns ? SST_LIVE_TRACK_COVERED : a->state,
                                            .label = scene_track_label(t, a),
                                            .x0 = 2 * (a->x - a->w / 2),
                                            .y0 = 2 * (a->y - a->h / 2),
                                            .x1 = 2 * (a->x + a->w / 2),
                                            .y1 = 2 * (a->y + a->h / 2),
                                            .at = { 2 * a->at[0], 2 * a->at[1], 2 * a->at[2], 2 * a->at[3] },
                                            .vx_px_s = 2 * a->vx,
                                            .vy_px_s = 2 * a->vy,
                                            .disp_px = disp_min_px + a->disp_q6 / SST_DISP_SCALE,
                                            .first_ns = a->first_ns,
                                            .seen_ns = a->seen_ns };
    }
    return n;
}
