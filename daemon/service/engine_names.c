/* Names of tracks that the network has not labelled: a person by size and motion. And the tracks that clear pictures
 * remove.
 *
 * Height at disparity d: h = h_px * B / d, B the camera spacing (from Z = f * B / d). Speeds by the same factor. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/text.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#define LOW_M     1.2 /* height of a person */
#define TALL_M    2.2
#define UPRIGHT   1.15 /* height to width, at least: arms and legs of a walker, and cells of a search behind leaves */
#define SLOW_M_S  0.3
#define FAST_M_S  3.0
#define LEAST_NS  INT64_C(1000000000) /* of the walk that a speed is measured on */
#define LEAST     4                   /* sets that fit */
#define SHARE     0.5                 /* of all sets with a known size */
#define EDGE_PX   3                   /* a box at an edge of the picture has no known size */
#define GAIN      0.3                 /* of a new size against the mean of the former */

/* Names of the class of persons in the usual lists. */
static const char *const persons[] = { "Pedestrian", "Person", "person" };

static int person_label(const struct live_engine *v)
{
    int label = 0;

    for (size_t i = 0; i < ARRAY_LEN(persons) && !label; i++)
        label = sst_classes_find(&v->classes, persons[i]);
    return label;
}

static struct sized *sized_of(struct live_engine *v, const struct sst_live_track *t)
{
    for (int i = 0; i < v->sizeds; i++)
        if (v->sized[i].id == t->id)
            return &v->sized[i];
    if (v->sizeds == SST_LIVE_TRACKS)
        return NULL;
    v->sized[v->sizeds] = (struct sized){ .id = t->id, .height_m = NAN, .speed_m_s = NAN };
    return &v->sized[v->sizeds++];
}

/* Size and speed of a track that is seen in this set. */
static void measure(struct live_engine *v, struct sized *a, const struct sst_live_track *t, int64_t t_ns)
{
    const double m = v->state.spacing_mm / 1000 / t->disp_px, x_m = (t->x0 + t->x1) / 2 * m;
    const double height_m = (t->y1 - t->y0) * m, width_m = (t->x1 - t->x0) * m;
    const bool whole = t->y0 > EDGE_PX && t->y1 < v->state.height - EDGE_PX && t->x0 > EDGE_PX &&
                       t->x1 < v->state.width - EDGE_PX;

    if (!a->from_ns) {
        a->from_ns = t_ns;
        a->from_m = x_m;
    } else if (t_ns - a->from_ns >= LEAST_NS) {
        a->speed_m_s = fabs(x_m - a->from_m) / ((double)(t_ns - a->from_ns) / 1e9);
        a->walked |= a->speed_m_s >= SLOW_M_S && a->speed_m_s <= FAST_M_S;
        a->ran |= a->speed_m_s > FAST_M_S;
        a->from_ns = t_ns;
        a->from_m = x_m;
    }
    if (!whole)
        return;
    a->height_m = isnan(a->height_m) ? height_m : a->height_m + GAIN * (height_m - a->height_m);
    a->sets++;
    a->fits += a->height_m >= LOW_M && a->height_m <= TALL_M && height_m >= UPRIGHT * width_m;
}

static bool is_person(const struct sized *a)
{
    return a->walked && !a->ran && a->fits >= LEAST && a->fits >= SHARE * a->sets;
}

/* Remove the sizes of tracks that have gone. */
static void forget_gone(struct live_engine *v, const struct sst_live_track *track, int n)
{
    int kept = 0;

    for (int i = 0; i < v->sizeds; i++) {
        bool there = false;

        for (int k = 0; k < n; k++)
            there |= track[k].id == v->sized[i].id;
        if (there)
            v->sized[kept++] = v->sized[i];
    }
    v->sizeds = kept;
}

void engine_names_follow(struct live_engine *v, struct sst_live_track *track, int n)
{
    const bool metric = v->live && v->live_config.calibration && v->state.spacing_mm > 0;

    forget_gone(v, track, n);
    for (int i = 0; i < n; i++) {
        struct sst_live_track *t = &track[i];
        struct sized *a = sized_of(v, t);

        if (!a)
            continue;
        if (metric && t->disp_px > 0 && t->state == SST_LIVE_TRACK_SEEN)
            measure(v, a, t, v->set_t_ns);
        a->by_size = !t->label && is_person(a) && person_label(v);
        t->label = a->by_size ? person_label(v) : t->label;
    }
}

const struct sized *engine_sized(const struct live_engine *v, uint32_t id)
{
    for (int i = 0; i < v->sizeds; i++)
        if (v->sized[i].id == id)
            return &v->sized[i];
    return NULL;
}

const char *engine_named_by(const struct live_engine *v, const struct sst_live_track *t)
{
    const struct sized *a = engine_sized(v, t->id);

    return !t->label ? "" : a && a->by_size ? "size and motion" : "network";
}

/* --- removed from clear pictures ---------------------------------------------------------------------------------- */

/* "person" of a label's name, in the words of a sentence. */
static void word_of(char out[SST_CLASS_NAME_MAX], const char *label)
{
    bool person = false;

    for (size_t i = 0; i < ARRAY_LEN(persons); i++)
        person |= !strcmp(label, persons[i]);
    snprintf(out, SST_CLASS_NAME_MAX, "%s", person ? "person" : *label ? label : "moving thing");
    if (*out >= 'A' && *out <= 'Z')
        *out = (char)(*out - 'A' + 'a');
}

/* "1 person removed, 4.4 m"; "3 moving things removed, the nearest 4.4 m" */
static void describe(char out[192], const struct engine_removed *removed, int n)
{
    const struct engine_removed *nearest = &removed[0];
    char word[SST_CLASS_NAME_MAX];
    bool same = true;

    for (int i = 1; i < n; i++) {
        nearest = removed[i].disparity_px > nearest->disparity_px ? &removed[i] : nearest;
        same &= !strcmp(removed[i].name, removed[0].name);
    }
    word_of(word, same ? removed[0].name : "");
    snprintf(out, 192, "%d %s%s removed", n, word, n > 1 ? "s" : "");
    if (!isnan(nearest->distance_m))
        sst_text_add(out, 192, ", %s%.1f m", n > 1 ? "the nearest " : "", nearest->distance_m);
    sst_text_add(out, 192, ": the clear picture is without %s; keep_moving of the view brings %s back",
                 n > 1 ? "them" : "it", n > 1 ? "them" : "it");
}

void engine_removed_locked(struct live_engine *v)
{
    struct engine_state *s = &v->state;

    s->removed_count = 0;
    for (int i = 0; i < v->tracks; i++) {
        const struct sst_live_track *t = &v->track[i];
        struct engine_removed *to = &s->removed[s->removed_count];

        if (!isgreater(t->disp_px, s->cut_px))
            continue;
        *to = (struct engine_removed){ .track = t->id,
                                       .disparity_px = t->disp_px,
                                       .distance_m = engine_distance_m(v, t->disp_px) };
        snprintf(to->name, sizeof(to->name), "%s", engine_label_name(v, t->label));
        s->removed_count++;
    }
    s->removed_text[0] = 0;
    if (s->removed_count)
        describe(s->removed_text, s->removed, s->removed_count);
}
