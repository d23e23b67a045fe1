/* Moments of `sst find`: views of each moment of a light field, light fields of one world. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/find_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"

#define INTERVAL_S  0.5
#define ORIGIN_MOST 1e-8 /* degrees: a millimetre */

static int last_moment(const struct sst_posed *posed)
{
    int last = 0;

    for (int k = 0; k < posed->count; k++)
        last = sst_max_int(last, posed->view[k].moment);
    return last;
}

/* Views of one moment and their mean time. @return 0, -ENOMEM; part->count is 0 where fewer than two are placed */
static int take_moment(struct sst_posed *part, double *time_s, const struct sst_posed *whole, int moment)
{
    struct sst_posed made;
    int n = 0, placed = 0;

    *part = *whole;
    part->count = part->point_count = part->sight_count = 0;
    part->points = NULL;
    part->sights = NULL;
    part->view = NULL;
    part->kept = NULL;
    *time_s = 0;
    for (int k = 0; k < whole->count; k++) {
        n += whole->view[k].moment == moment;
        placed += whole->view[k].moment == moment && whole->view[k].camera.known;
    }
    if (placed < 2)
        return 0;
    if (sst_posed_init(&made, n))
        return -ENOMEM;
    part->view = made.view;
    for (int k = 0; k < whole->count; k++) {
        if (whole->view[k].moment != moment)
            continue;
        *time_s += whole->view[k].time_s / n;
        part->view[part->count++] = whole->view[k];
    }
    return 0;
}

static int split(struct find_moments *m, const struct posed_scene *scene)
{
    const int last = last_moment(&scene->posed);
    int left_out = 0;

    for (int moment = 1; moment <= last; moment++) {
        struct sst_posed part;
        double time_s;

        if (take_moment(&part, &time_s, &scene->posed, moment))
            return -ENOMEM;
        if (!part.count) {
            left_out++;
            continue;
        }
        if (m->count == SST_FIND_MOMENTS) {
            sst_posed_fini(&part);
            sst_log_error("%s has more than %d moments; a search of persons who walk takes that many at most", scene->path,
                          SST_FIND_MOMENTS);
            return -EBADMSG;
        }
        m->path[m->count] = scene->path;
        m->number[m->count] = moment;
        m->part[m->count] = part;
        m->time_s[m->count++] = time_s;
    }
    if (m->count > 1 && left_out)
        sst_log_warning("%s: %d of %d moments have fewer than two placed views and are left out", scene->path, left_out,
                        last);
    return 0;
}

/* Poses that were found from pictures alone have axes of their own in each light field. */
static void check_axes(const struct find_moments *m)
{
    for (int i = 0; i < m->count; i++) {
        if (m->part[i].geographic || strncmp(m->part[i].history, "found", 5) != 0)
            continue;
        sst_log_warning("%s: its poses were found in axes of its own, which other moments share only if the array stood "
                        "still; if it moved, import the pictures of all moments as one light field (`sst import pictures "
                        "--moments PATTERN`) and find its poses by `sst poses LF --one-rig`",
                        m->path[i]);
        return;
    }
}

/* In which way a light field is of another world or camera than the first one. @return text for "%s differ in" or NULL */
static const char *difference(const struct sst_posed *own, const struct sst_posed *first)
{
    return own->channels != first->channels         ? "channels: one is grey, the other coloured"
           : own->bits != first->bits               ? "bits of their levels"
           : own->metric != first->metric           ? "unit: one is in metres, the other's is unknown"
           : own->geographic != first->geographic   ? "axes: one alone has a place on the earth"
                                                    : NULL;
}

static bool is_twice(const char *const *path, int i)
{
    for (int k = 0; k < i; k++) {
        if (cli_is_one_file(path[k], path[i]))
            return true;
    }
    return false;
}

static bool has_moments(const struct sst_posed *posed)
{
    for (int k = 1; k < posed->count; k++) {
        if (posed->view[k].moment != posed->view[0].moment)
            return true;
    }
    return false;
}

/* Loads the light fields, before anything is computed. */
static int load(struct find_moments *m, const char *const *path)
{
    for (; path[m->count]; m->count++) {
        struct sst_posed *own = &m->part[m->count];
        const struct sst_posed *first = &m->part[0];
        const int err = sst_posed_load(own, path[m->count]);

        if (err)
            return err;
        m->path[m->count] = path[m->count];
        m->time_s[m->count] = (double)NAN;
        if (is_twice(path, m->count)) {
            sst_log_error("%s is named twice; name each moment once", path[m->count]);
        } else if (difference(own, first)) {
            sst_log_error("%s and %s are no moments of one world, they differ in %s", path[0], path[m->count],
                          difference(own, first));
        } else if (path[1] && has_moments(own)) {
            sst_log_error("%s has several moments itself; search it alone, or name light fields of one moment each",
                          path[m->count]);
        } else if (own->geographic && (fabs(own->latitude - first->latitude) > ORIGIN_MOST ||
                                       fabs(own->longitude - first->longitude) > ORIGIN_MOST ||
                                       fabs(own->altitude_m - first->altitude_m) > 1e-3)) {
            sst_log_error("%s and %s have different origins of their axes; import the pictures of all moments as one light "
                          "field, `sst import ... --moments PATTERN`",
                          path[0], path[m->count]);
        } else if (sst_posed_placed(own) < 2) {
            sst_log_error("%s: %s placed, a moment needs two; `sst poses %s` finds poses", path[m->count],
                          sst_posed_placed(own) ? "one view alone is" : "no view is", path[m->count]);
        } else {
            continue;
        }
        m->count++;
        return -EBADMSG;
    }
    check_axes(m);
    return 0;
}

/* Times by the interval, or the light field's, which must rise. */
static void set_times(struct find_moments *m, double interval_s)
{
    bool known = interval_s <= 0;

    for (int i = 0; i < m->count; i++)
        known = known && isfinite(m->time_s[i]) && (i == 0 || m->time_s[i] > m->time_s[i - 1]);
    for (int i = m->count - 1; i >= 0; i--) {
        const int steps = m->number[i] ? m->number[i] - m->number[0] : i;

        m->time_s[i] = known ? m->time_s[i] - m->time_s[0] : steps * (interval_s > 0 ? interval_s : INTERVAL_S);
    }
}

/* Says that a light field is searched as one set although it has moments, before the ground is sought. */
static int check_single(const char *path)
{
    struct sst_posed posed;
    int *placed, moments = 0, of_two = 0, err = sst_posed_load(&posed, path);

    if (err)
        return err;
    placed = calloc((size_t)posed.count, sizeof(*placed));
    for (int k = 0; placed && k < posed.count; k++) {
        int first = 0;

        while (posed.view[first].moment != posed.view[k].moment)
            first++;
        moments += first == k;
        placed[first] += posed.view[k].camera.known;
        of_two += first != k && posed.view[k].camera.known && placed[first] == 2;
    }
    if (placed && moments > 1 && of_two < 2)
        sst_log_warning("%s: %d of its %d moments %s two placed views; all views are searched as one set, in which persons "
                        "who walk are blurred",
                        path, of_two, moments, of_two ? "alone has" : "have");
    err = placed ? 0 : -ENOMEM;
    if (err)
        sst_log_error("%s: not enough memory", path);
    free(placed);
    sst_posed_fini(&posed);
    return err;
}

int cli_find_moments_load(struct find_moments *m, const char *const *path)
{
    const int err = path[1] ? load(m, path) : check_single(path[0]);

    return err ? cli_exit_code(err) : CLI_GO_ON;
}

int cli_find_moments_open(struct find_moments *m, const struct posed_scene *scene, double interval_s)
{
    const bool several = m->count > 0;
    const int err = several ? 0 : split(m, scene);

    if (err == -ENOMEM)
        sst_log_error("%s: not enough memory", scene->path);
    if (!several && (err || m->count < 2))
        cli_find_moments_close(m);
    set_times(m, interval_s);
    return err ? cli_exit_code(err) : CLI_GO_ON;
}

void cli_find_moments_close(struct find_moments *m)
{
    for (int i = 0; i < m->count; i++)
        sst_posed_fini(&m->part[i]);
    m->count = 0;
}
