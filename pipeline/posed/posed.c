/* A posed light field in memory, and its validation. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/posed_internal.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/image/deep.h"

#define NUMBER_MAX   1e9  /* of scales and offsets */
#define TIME_MAX_S   1e9  /* thirty years */
#define UNIT_MISS    1e-6 /* of a unit vector's length */
#define LOOK_FORWARD 0.5  /* cosine to the mean direction of a view that looks forward */

static const double no_pose[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };

int sst_posed_init(struct sst_posed *posed, int count)
{
    if (count < 1 || count > SST_POSED_MAX_VIEWS)
        return -EINVAL;
    *posed = (struct sst_posed){ .count = count, .median_px = (double)NAN };
    posed->view = calloc((size_t)count, sizeof(*posed->view));
    if (!posed->view)
        return -ENOMEM;
    for (int k = 0; k < count; k++) {
        struct sst_posed_view *v = &posed->view[k];

        memcpy(v->camera.rotation, no_pose, sizeof(no_pose));
        for (int i = 0; i < 3; i++)
            v->camera.gain[i] = 1;
        v->time_s = (double)NAN;
    }
    return 0;
}

void sst_posed_fini(struct sst_posed *posed)
{
    free(posed->view);
    free(posed->points);
    free(posed->sights);
    for (int k = 0; posed->kept && k < posed->count; k++)
        sst_deep_fini(&posed->kept[k]);
    free(posed->kept);
    *posed = (struct sst_posed){ 0 };
}

int sst_posed_placed(const struct sst_posed *posed)
{
    int n = 0;

    for (int k = 0; k < posed->count; k++)
        n += posed->view[k].camera.known;
    return n;
}

void sst_posed_forward(const struct sst_posed *posed, double forward[3])
{
    double sum[3] = { 0, 0, 0 }, length;

    for (int k = 0; k < posed->count; k++) {
        const struct sst_calib_camera *c = &posed->view[k].camera;

        for (int i = 0; c->known && i < 3; i++)
            sum[i] += c->rotation[6 + i];
    }
    length = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
    for (int i = 0; i < 3; i++)
        forward[i] = length > 1e-9 ? sum[i] / length : i == 2;
}

int sst_posed_middle(const struct sst_posed *posed)
{
    const int placed = sst_posed_placed(posed);
    double mean[3] = { 0, 0, 0 }, forward[3], nearest = INFINITY;
    bool found_forward = false;
    int middle = -1;

    sst_posed_forward(posed, forward);
    for (int k = 0; k < posed->count; k++) {
        for (int i = 0; posed->view[k].camera.known && i < 3; i++)
            mean[i] += posed->view[k].camera.position_mm[i] / placed;
    }
    for (int k = 0; k < posed->count; k++) {
        const struct sst_calib_camera *c = &posed->view[k].camera;
        double off = 0, along = 0;
        bool ahead;

        if (!c->known)
            continue;
        for (int i = 0; i < 3; i++) {
            off += (c->position_mm[i] - mean[i]) * (c->position_mm[i] - mean[i]);
            along += c->rotation[6 + i] * forward[i];
        }
        ahead = along > LOOK_FORWARD;
        if (ahead < found_forward || (ahead == found_forward && off >= nearest))
            continue;
        found_forward = ahead;
        nearest = off;
        middle = k;
    }
    return middle;
}

/* --- validation --------------------------------------------------------------------------------------------------- */

static bool within(double v, double lo, double hi)
{
    return isfinite(v) && v >= lo && v <= hi;
}

static bool file_name_ok(const char *name)
{
    if (!name[0] || name[0] == '.')
        return false;
    for (const char *p = name; *p; p++) {
        if (*p == '/' || iscntrl((unsigned char)*p))
            return false;
    }
    return true;
}

static const char *view_fault(const struct sst_posed *posed, int k)
{
    const struct sst_posed_view *v = &posed->view[k];
    struct sst_calib_camera lens = v->camera;

    if (!v->name[0])
        return "name is empty";
    if (!file_name_ok(v->file))
        return "file is not a plain file name";
    if (!isnan(v->time_s) && !within(v->time_s, -TIME_MAX_S, TIME_MAX_S))
        return "time_s is outside -1e9..1e9";
    if (v->moment < 0)
        return "moment is below 0";
    for (int j = 0; j < k; j++) {
        if (!strcmp(posed->view[j].file, v->file))
            return "file is the same as another view's";
        if (!strcmp(posed->view[j].name, v->name))
            return "name is the same as another view's";
    }
    if (lens.known)
        return sst_camera_fault(&lens);
    memcpy(lens.rotation, no_pose, sizeof(no_pose));
    memset(lens.position_mm, 0, sizeof(lens.position_mm));
    return lens.fx != 0 ? sst_camera_fault(&lens) : NULL;
}

/* Of the points that have `seen` sights in all. */
static const char *sights_fault(const struct sst_posed *posed, int64_t seen)
{
    if (posed->sights && posed->sight_count != seen)
        return "points: the number of sights is not that of the points";
    for (int i = 0; posed->sights && i < posed->sight_count; i++) {
        const struct sst_posed_sight *s = &posed->sights[i];

        if (s->view < 0 || s->view >= posed->count || !within((double)s->x, -NUMBER_MAX, NUMBER_MAX) ||
            !within((double)s->y, -NUMBER_MAX, NUMBER_MAX))
            return "points: a sight is of no view, or its place is not finite";
    }
    return NULL;
}

static const char *world_fault(const struct sst_posed *posed)
{
    int64_t seen = 0;
    const double *up = posed->up, length = sqrt(up[0] * up[0] + up[1] * up[1] + up[2] * up[2]);

    if (length != 0 && !(fabs(length - 1) < UNIT_MISS))
        return "up: not a unit vector";
    if (posed->geographic && (!within(posed->latitude, -90, 90) || !within(posed->longitude, -360, 360) ||
                              !within(posed->altitude_m, -1e5, 1e7)))
        return "geographic: latitude, longitude or altitude_m is out of range";
    if (!within(posed->kelvin_scale, -NUMBER_MAX, NUMBER_MAX) || !within(posed->kelvin_offset, -NUMBER_MAX, NUMBER_MAX))
        return "kelvin: outside -1e9..1e9";
    if (!isnan(posed->median_px) && !within(posed->median_px, 0, NUMBER_MAX))
        return "median_px: outside 0..1e9";
    if (posed->point_count < 0 || posed->point_count > POSED_MAX_POINTS)
        return "points: more than 200000";
    for (int i = 0; i < posed->point_count; i++) {
        for (int j = 0; j < 3; j++) {
            if (!within(posed->points[i].at_mm[j], -SST_CALIB_LARGEST, SST_CALIB_LARGEST))
                return "points: a number is not finite or beyond 1e12";
        }
        if (posed->points[i].views < 0)
            return "points: a number of views is below 0";
        seen += posed->points[i].views;
    }
    return sights_fault(posed, seen);
}

const char *posed_fault(const struct sst_posed *posed)
{
    static _Thread_local char text[400];

    if (posed->count < 1 || posed->count > SST_POSED_MAX_VIEWS)
        return "views: there must be 1 to 1024";
    if (posed->width < 1 || posed->height < 1 || posed->width > SST_IMAGE_MAX_SIDE ||
        posed->height > SST_IMAGE_MAX_SIDE || (size_t)posed->width * (size_t)posed->height > SST_IMAGE_MAX_PIXELS)
        return "width, height: each must be 1 to 32768";
    if (posed->channels != 1 && posed->channels != 3)
        return "channels: neither 1 nor 3";
    if (posed->bits != 8 && posed->bits != 16)
        return "bits: neither 8 nor 16";
    if (posed->samples.white &&
        (posed->samples.black < 0 || posed->samples.black >= posed->samples.white || posed->samples.white > 65535))
        return "samples: not two ascending whole numbers in 0..65535";
    for (int k = 0; k < posed->count; k++) {
        const char *fault = view_fault(posed, k);

        if (fault) {
            snprintf(text, sizeof(text), "views[%d], %s: %s", k, posed->view[k].name, fault);
            return text;
        }
    }
    return world_fault(posed);
}
