/* Poses of one light field whose moments are of one array: the world of all pictures, then the array's shape at each
 * moment. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/posed/solve/solve.h"

#define METRE_MM 1000.0

struct moments {
    struct sst_posed *whole;
    int count;                       /* of moments, numbered from 1 */
    struct sst_posed *part;          /* [count] */
    struct sst_posed_solved *solved; /* [count] */
    const char **dir;                /* [count] all the same */
    int *of;                         /* [count][views of a moment] view of the whole */
    int views;                       /* of a moment */
};

static int count_views(const struct sst_posed *posed, int moment)
{
    int n = 0;

    for (int k = 0; k < posed->count; k++)
        n += posed->view[k].moment == moment;
    return n;
}

static int check(struct moments *m, const char *dir)
{
    for (int k = 0; k < m->whole->count; k++) {
        m->count = sst_max_int(m->count, m->whole->view[k].moment);
        if (m->whole->view[k].moment < 1) {
            sst_log_error(
                "%s: %s is of no moment; --one-rig needs `sst import pictures --moments`, or several light fields", dir,
                m->whole->view[k].name);
            return -EBADMSG;
        }
    }
    m->views = count_views(m->whole, 1);
    for (int i = 1; i <= m->count; i++) {
        if (count_views(m->whole, i) != m->views) {
            sst_log_error("%s has %d pictures of moment %d and %d of moment 1; those of one array are as many", dir,
                          count_views(m->whole, i), i, m->views);
            return -EBADMSG;
        }
    }
    if (m->count > 1 && m->views > 1)
        return 0;
    sst_log_error("%s has %d moments of %d pictures; --one-rig needs two moments of two at least", dir, m->count,
                  m->views);
    return -EBADMSG;
}

/* Views of each moment, with the poses that the whole has found. */
static int split(struct moments *m, const char *dir)
{
    m->part = calloc((size_t)m->count, sizeof(*m->part));
    m->solved = calloc((size_t)m->count, sizeof(*m->solved));
    m->dir = calloc((size_t)m->count, sizeof(*m->dir));
    m->of = calloc((size_t)m->count * (size_t)m->views, sizeof(*m->of));
    if (!m->part || !m->solved || !m->dir || !m->of)
        return -ENOMEM;
    for (int i = 0; i < m->count; i++) {
        struct sst_posed *part = &m->part[i], made;
        int n = 0;

        if (sst_posed_init(&made, m->views))
            return -ENOMEM;
        *part = *m->whole;
        part->count = made.count;
        part->view = made.view;
        part->points = NULL;
        part->sights = NULL;
        part->point_count = part->sight_count = 0;
        m->dir[i] = dir;
        for (int k = 0; k < m->whole->count; k++) {
            if (m->whole->view[k].moment != i + 1)
                continue;
            m->of[i * m->views + n] = k;
            part->view[n++] = m->whole->view[k];
        }
        if (sst_posed_placed(part) < 2) {
            sst_log_error(
                "%s: the pictures of moment %d do not match those of the others, so its place is unknown; import "
                "each moment as a light field of its own and name them all",
                dir, i + 1);
            return -EDOM;
        }
    }
    return 0;
}

/* Points of the moments, their sights in views of the whole. */
static int merge_points(struct moments *m)
{
    struct sst_posed *whole = m->whole;
    struct sst_posed_point *points;
    struct sst_posed_sight *sights;
    size_t n = 0, seen = 0;

    for (int i = 0; i < m->count; i++) {
        n += (size_t)m->part[i].point_count;
        seen += (size_t)m->part[i].sight_count;
    }
    points = malloc(n * sizeof(*points) + 1);
    sights = malloc(seen * sizeof(*sights) + 1);
    if (!points || !sights) {
        free(points);
        free(sights);
        return -ENOMEM;
    }
    free(whole->points);
    free(whole->sights);
    whole->points = points;
    whole->sights = sights;
    whole->point_count = whole->sight_count = 0;
    for (int i = 0; i < m->count; i++) {
        for (int p = 0; p < m->part[i].point_count; p++)
            points[whole->point_count++] = m->part[i].points[p];
        for (int s = 0; s < m->part[i].sight_count; s++) {
            sights[whole->sight_count] = m->part[i].sights[s];
            sights[whole->sight_count++].view = m->of[i * m->views + m->part[i].sights[s].view];
        }
    }
    return 0;
}

/* The light field, its unit and figures: means of the moments'. */
static int merge(struct moments *m, const struct sst_posed_solve_config *cfg, bool given, struct sst_posed_solved *out)
{
    struct sst_posed *whole = m->whole;
    double spacing = 0, factor = 1;
    int err = merge_points(m);

    if (err)
        return err;
    out->placed = 0;
    out->median_px = out->p90_px = 0;
    for (int i = 0; i < m->count; i++) {
        for (int k = 0; k < m->views; k++) {
            whole->view[m->of[i * m->views + k]].camera = m->part[i].view[k].camera;
            out->doubtful[m->of[i * m->views + k]] = m->solved[i].doubtful[k];
            out->view_px[m->of[i * m->views + k]] = m->solved[i].view_px[k];
        }
        out->placed += m->solved[i].placed;
        out->median_px += m->solved[i].median_px / m->count;
        out->p90_px += m->solved[i].p90_px / m->count;
        spacing += m->solved[i].spacing_mm / m->count;
    }
    if (cfg->spacing_mm > 0 || !given)
        factor = (cfg->spacing_mm > 0 ? cfg->spacing_mm : METRE_MM) / spacing;
    for (int k = 0; k < whole->count; k++) {
        for (int i = 0; i < 3; i++)
            whole->view[k].camera.position_mm[i] *= factor;
    }
    for (int p = 0; p < whole->point_count; p++) {
        for (int i = 0; i < 3; i++)
            whole->points[p].at_mm[i] *= factor;
    }
    out->spacing_mm = spacing * factor;
    whole->median_px = out->median_px;
    snprintf(whole->history, sizeof(whole->history),
             "found %d of %d views by features of one rig at %d moments: median %.3f px", out->placed, whole->count,
             m->count, out->median_px);
    return 0;
}

int cli_poses_moments(struct sst_posed *posed, const char *dir, const struct sst_posed_solve_config *cfg,
                      struct sst_posed_solved *solved)
{
    struct moments m = { .whole = posed };
    struct sst_posed_solve_config one = *cfg;
    const bool given = sst_posed_placed(posed) > 1;
    int err = check(&m, dir);

    one.one_rig = false;
    if (!err)
        err = sst_posed_solve(posed, &dir, 1, &one, solved);
    if (!err)
        err = split(&m, dir);
    one.one_rig = true;
    one.spacing_mm = one.focal_px = 0; /* in the world, and with the lens, of the whole */
    one.search_focal = false;
    if (!err)
        err = sst_posed_solve(m.part, m.dir, m.count, &one, m.solved);
    if (!err)
        err = merge(&m, cfg, given, solved);
    if (err == -ENOMEM)
        sst_log_error("%s: not enough memory to find poses", dir);
    for (int i = 0; m.part && i < m.count; i++)
        sst_posed_fini(&m.part[i]);
    for (int i = 0; m.solved && i < m.count; i++)
        sst_posed_solved_fini(&m.solved[i]);
    free(m.part);
    free(m.solved);
    free(m.dir);
    free(m.of);
    return err;
}
