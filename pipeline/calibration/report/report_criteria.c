/* The acceptance criteria of a calibration, and the verdict. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/calibration/report/report_internal.h"

#include "base/text.h"

/* Below this difference the halves of a cross-validation agree, whatever the uncertainties let expect. */
#define CROSS_HARMLESS_PX 0.1

#define PAIR_REMEDY                                                                                                    \
    "rows of the rectified views will not line up: look at this pair's cameras, their mounts and the frames that "     \
    "both see"

enum key {
    RMS_CAMERA,
    RMS_OVER_EXPECTED,
    OUTLIERS,
    SYSTEMATIC,
    CROSS,
    CROSS_OVER_EXPECTED,
    TRANSFER,
    PAIRS_MEAN,
    PAIRS_P95,
    PAIRS_MAX,
    OVERRIDDEN,
    MISSING,
    SECONDS,
};

/* A small RMS alone is no evidence, as a lean model with few corners fits anything: the verdict needs the
 * cross-validation too. */
static const struct report_criterion thresholds[] = {
    /* key, definition, unit, stretch, pass, limit, judged, remedy */
    [RMS_CAMERA] = { "rms_camera", "largest RMS per point of a camera, over its used corners", "px", 0.15, 0.30, 0.60,
                     true,
                     "look at its residuals: arrows that agree within a region mean a lens that the model "
                     "does not fit (try 8 coefficients), arrows in all directions mean noise, blur or "
                     "motion (more light, shorter exposure, focus)" },
    [RMS_OVER_EXPECTED] = { "rms_over_expected",
                            "RMS over all corners against the RMS expected from corner noise, relative", "%", 2, 5,
                            INFINITY, false, NULL },
    [OUTLIERS] = { "outliers", "corners rejected as outliers", "%", 1, 3, 3, true,
                   "the corners contradict each other: check that all cameras expose at the same moment, "
                   "that none of them moved and that the board is rigid; the list of outliers names the "
                   "pictures" },
    [SYSTEMATIC] = { "systematic",
                     "systematic part of the residuals, worst camera: RMS of their means over regions, less "
                     "what random residuals leave in a mean",
                     "px", 0.05, 0.10, 0.25, true,
                     "the lens model is too lean or the board differs from its description: try 8 "
                     "coefficients, measure the board" },
    [CROSS] = { "cross",
                "cross-validation, odd against even frames: RMS difference over the central 80 % of the "
                "picture, worst camera",
                "px", 0.1, 0.2, 0.4, false,
                "two halves of the capture give different calibrations: take more frames, with the board "
                "in all regions of the picture, near and far, and tilted by 30 to 45 degrees" },
    /* No limit: the worst of many cameras exceeds any by chance. */
    [CROSS_OVER_EXPECTED] = { "cross_over_expected", "that difference over the one expected from the uncertainties",
                              "times", 1.5, 2, INFINITY, false,
                              "the halves differ by more than corner noise explains: something moved during "
                              "the capture, or the lens model does not fit" },
    [TRANSFER] = { "carry",
                   "expected error of transferring a pixel from the reference view to another at the working "
                   "range, RMS over its picture, worst camera",
                   "px", 0.05, 0.10, 0.25, true,
                   "the capture does not determine this camera well: take more frames that it shares with "
                   "others, near the working range and in all regions of its picture" },
    [PAIRS_MEAN] = { "pairs_mean",
                     "epipolar error of neighbours (across the line between them): mean over pairs of the "
                     "magnitude of their mean",
                     "px", 0.05, 0.10, 0.20, false, PAIR_REMEDY },
    [PAIRS_P95] = { "pairs_p95",
                    "epipolar error of neighbours: 95 % of the regions of a picture (with 20 corners and more) are "
                    "below",
                    "px", 0.12, 0.25, 0.5, false, PAIR_REMEDY },
    [PAIRS_MAX] = { "pairs_max", "epipolar error of neighbours: the worst pair", "px", 0.25, 0.5, 1, false,
                    PAIR_REMEDY },
    /* Input accepted by --force may fit well nevertheless: two swapped cameras, for example. */
    [OVERRIDDEN] = { "overridden", "reasons to refuse the calibration that were overridden", "", 0, 0, INFINITY, true,
                     "the warnings name what to correct; then solve without --force" },
    [MISSING] = { "missing", "cameras of the array without a calibration", "", 0, 0, INFINITY, true,
                  "they see no board that another camera sees in the same frame: take frames in which they "
                  "do" },
    [SECONDS] = { "seconds", "time that solving took", "s", 15, 60, INFINITY, false, NULL },
};

static struct report_criterion *add(struct report_figures *f, enum key key, double value)
{
    struct report_criterion c = thresholds[key];

    c.value = value;
    c.state = !isfinite(value)     ? CRITERION_UNKNOWN
              : value <= c.stretch ? CRITERION_STRETCH
              : value <= c.pass    ? CRITERION_MET
              : value <= c.limit   ? CRITERION_MISSED
                                   : CRITERION_FAILED;
    f->criterion[f->criteria] = c;
    return &f->criterion[f->criteria++];
}

static struct report_criterion *add_of_camera(struct report_figures *f, enum key key, double value, int view)
{
    struct report_criterion *c = add(f, key, value);

    if (view >= 0 && view < f->views)
        snprintf(c->where, sizeof(c->where), "camera %s", f->camera[view].title);
    return c;
}

static void judge_residuals(struct report_figures *f, const struct sst_solution *s)
{
    const double all = (double)s->corners + s->outliers, expected = s->predicted_rms_px;

    add_of_camera(f, RMS_CAMERA, f->worst_camera >= 0 ? s->calib.camera[f->worst_camera].rms_px : (double)NAN,
                  f->worst_camera);
    add(f, RMS_OVER_EXPECTED, expected > 0 && s->rms_px > 0 ? 100 * fabs(s->rms_px / expected - 1) : (double)NAN);
    add(f, OUTLIERS, all > 0 ? 100 * s->outliers / all : (double)NAN);
    add_of_camera(f, SYSTEMATIC,
                  f->systematic_camera >= 0 ? f->camera[f->systematic_camera].systematic_px : (double)NAN,
                  f->systematic_camera);
}

static void judge_cross(struct report_figures *f, const struct sst_solution *s)
{
    const bool done = isfinite(s->cv_px);
    const double ratio = done && s->cv_expected_px > 0 ? s->cv_px / s->cv_expected_px : (double)NAN;

    add_of_camera(f, CROSS, s->cv_px, done ? s->cv_camera : -1)->judged =
        done || !s->calib.rig; /* a rig's lens may have been given */
    add(f, CROSS_OVER_EXPECTED, ratio)->judged = done && s->cv_px > CROSS_HARMLESS_PX;
}

static void judge_geometry(struct report_figures *f, const struct sst_solution *s)
{
    struct report_criterion *c;

    if (f->known < 2)
        return;
    add_of_camera(f, TRANSFER, f->worst_transfer >= 0 ? s->calib.camera[f->worst_transfer].sigma_px : (double)NAN,
                  f->worst_transfer);
    add(f, PAIRS_MEAN, f->pair_mean_px)->judged = f->pairs > 0;
    add(f, PAIRS_P95, f->pair_p95_px)->judged = isfinite(f->pair_p95_px);
    c = add(f, PAIRS_MAX, f->pair_max_px);
    c->judged = f->pairs > 0;
    if (f->pairs)
        snprintf(c->where, sizeof(c->where), "cameras %s and %s", f->camera[f->pair_worst[0]].title,
                 f->camera[f->pair_worst[1]].title);
}

static void judge_missing(struct report_figures *f, const struct sst_solution *s)
{
    struct report_criterion *c = add(f, MISSING, f->known ? f->missing : (double)NAN);

    for (int k = 0; k < f->views && f->missing; k++) {
        if (f->camera[k].expected && !s->calib.camera[k].known)
            sst_text_add(c->where, sizeof(c->where), "%s%s", *c->where ? ", " : "", f->camera[k].title);
    }
}

void report_figures_judge(struct report_figures *f, const struct sst_calibration_report *report)
{
    const struct sst_solution *s = report->solution;

    judge_residuals(f, s);
    judge_cross(f, s);
    judge_geometry(f, s);
    add(f, OVERRIDDEN, report->overridden);
    judge_missing(f, s);
    add(f, SECONDS, s->seconds > 0 ? s->seconds : (double)NAN);
    f->verdict = VERDICT_GOOD;
    for (int i = 0; i < f->criteria; i++) {
        const struct report_criterion *c = &f->criterion[i];

        if (!c->judged)
            continue;
        if (c->state == CRITERION_FAILED)
            f->verdict = VERDICT_BAD;
        else if ((c->state == CRITERION_MISSED || c->state == CRITERION_UNKNOWN) && f->verdict == VERDICT_GOOD)
            f->verdict = VERDICT_USABLE;
    }
    if (!(s->rms_px > 0 || s->corners > 0) || !isfinite(s->rms_px) || !f->known)
        f->verdict = VERDICT_BAD;
}

const char *report_verdict_word(enum report_verdict verdict)
{
    static const char *const words[] = { "good", "usable", "do not use" };

    return words[verdict];
}

const char *report_criterion_word(enum criterion_state state)
{
    static const char *const words[] = { "unknown", "met easily", "met", "missed", "failed" };

    return words[state];
}

bool report_criterion_reason(const struct report_criterion *c, char out[640])
{
    const bool over = c->state == CRITERION_MISSED || c->state == CRITERION_FAILED;

    if (!c->judged || !(over || c->state == CRITERION_UNKNOWN))
        return false;
    if (over)
        snprintf(out, 640, "%s: %s%s%s%s%s%s, above %g; %s.", c->what,
                 c->unit[0] ? FIGURE(c->value) : COUNT((int64_t)c->value), c->unit[0] ? " " : "", c->unit,
                 c->where[0] ? " (" : "", c->where, c->where[0] ? ")" : "",
                 c->state == CRITERION_FAILED ? c->limit : c->pass, c->remedy);
    else
        snprintf(out, 640, "%s: unknown, so nothing confirms it%s.", c->what,
                 strcmp(c->key, "cross") ? "" : "; solve with cross-validation");
    return true;
}
