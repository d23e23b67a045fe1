/* The bars that a calibration is held against, and the verdict. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/calibration/report/report_internal.h"

/* RMS alone is no evidence, as a lean model with few corners fits anything: the verdict needs the comparison of odd and
 * even frames too. Up to this difference they agree, whatever the uncertainties let expect. */
#define CROSS_HARMLESS_PX 0.1

static struct calib_bar *add(struct calib_figures *f, struct calib_bar bar)
{
    bar.state = !isfinite(bar.value)       ? SST_BAR_UNKNOWN
                : bar.value <= bar.stretch ? SST_BAR_STRETCH
                : bar.value <= bar.pass    ? SST_BAR_MET
                : bar.value <= bar.limit   ? SST_BAR_MISSED
                                           : SST_BAR_FAILED;
    f->bar[f->bars] = bar;
    return &f->bar[f->bars++];
}

static void at_camera(struct calib_bar *bar, const struct calib_figures *f, int view)
{
    if (view >= 0 && view < f->views)
        snprintf(bar->where, sizeof(bar->where), "camera %s", f->camera[view].name);
}

static double known_or_nan(double value)
{
    return value > 0 ? value : (double)NAN;
}

static void judge_residuals(struct calib_figures *f, const struct sst_solution *s)
{
    const double worst = f->worst_camera >= 0 ? s->calib.camera[f->worst_camera].rms_px : (double)NAN;
    const double all = (double)s->corners + s->outliers;

    at_camera(
        add(f, (struct calib_bar){ .key = "rms_camera",
                                   .what = "largest RMS per point of a camera, over its used corners",
                                   .unit = "px",
                                   .value = worst,
                                   .stretch = 0.15,
                                   .pass = 0.30,
                                   .limit = 0.60,
                                   .judged = true,
                                   .remedy =
                                       "look at its residuals: arrows that agree within a region mean a lens that the "
                                       "model does not fit (try 8 coefficients), arrows in all directions mean noise, "
                                       "blur or motion (more light, shorter exposure, focus)" }),
        f, f->worst_camera);
    add(f, (struct calib_bar){
               .key = "rms_over_expected",
               .what = "RMS over all corners less the RMS that corner noise lets expect, relative",
               .unit = "%",
               .value = s->predicted_rms_px > 0 && s->rms_px > 0 ? 100 * fabs(s->rms_px / s->predicted_rms_px - 1)
                                                                 : (double)NAN,
               .stretch = 2,
               .pass = 5,
               .limit = INFINITY,
               .remedy = "noise alone does not explain the residuals: see the systematic part, the worst frames and "
                         "whether the board is flat and measured right" });
    add(f, (struct calib_bar){ .key = "outliers",
                               .what = "corners left out as outliers",
                               .unit = "%",
                               .value = all > 0 ? 100 * s->outliers / all : (double)NAN,
                               .stretch = 1,
                               .pass = 3,
                               .limit = 3,
                               .judged = true,
                               .remedy = "the corners contradict each other: check that all cameras expose at the "
                                         "same moment, that none of them moved and that the board is rigid; the "
                                         "list of outliers says which pictures" });
    at_camera(
        add(f, (struct calib_bar){ .key = "systematic",
                                   .what = "systematic part of the residuals of a camera, largest: RMS of "
                                           "their means over regions, less what random ones leave",
                                   .unit = "px",
                                   .value = f->systematic_camera >= 0 ? f->camera[f->systematic_camera].systematic_px
                                                                      : (double)NAN,
                                   .stretch = 0.05,
                                   .pass = 0.10,
                                   .limit = 0.25,
                                   .judged = true,
                                   .remedy = "the lens model is too lean or the board is not what it is said "
                                             "to be: try 8 coefficients, measure the board" }),
        f, f->systematic_camera);
}

static void judge_cross(struct calib_figures *f, const struct sst_solution *s)
{
    const bool done = isfinite(s->cross_px);
    const double ratio = done && s->cross_expected_px > 0 ? s->cross_px / s->cross_expected_px : (double)NAN;

    at_camera(add(f, (struct calib_bar){ .key = "cross",
                                         .what = "odd against even frames: RMS difference over the central 80 % of "
                                                 "the picture, largest of all cameras",
                                         .unit = "px",
                                         .value = s->cross_px,
                                         .stretch = 0.1,
                                         .pass = 0.2,
                                         .limit = 0.4,
                                         .judged = done || !s->calib.rig, /* a rig's lens may have been given */
                                         .remedy = "two halves of the capture give different calibrations: take "
                                                   "more frames, with the board in all regions of the picture, "
                                                   "near and far, and tilted by 30 to 45 degrees" }),
              f, done ? s->cross_camera : -1);
    add(f, (struct calib_bar){ .key = "cross_over_expected",
                               .what = "that difference over the one that the uncertainties let expect",
                               .unit = "times",
                               .value = ratio,
                               .stretch = 1.5,
                               .pass = 2,
                               .limit = INFINITY, /* the worst of many cameras exceeds it by chance */
                               .judged = done && s->cross_px > CROSS_HARMLESS_PX,
                               .remedy = "the halves differ by more than corner noise explains: something moved "
                                         "during the capture, or the lens model does not fit" });
}

static void judge_geometry(struct calib_figures *f, const struct sst_solution *s)
{
    static const char remedy[] = "rows of the rectified views will not line up: look at this pair's cameras, their "
                                 "mounts and the frames that both see";
    const double carry = f->worst_carry >= 0 ? s->calib.camera[f->worst_carry].sigma_px : (double)NAN;
    struct calib_bar *bar;

    if (f->known < 2)
        return;
    at_camera(add(f, (struct calib_bar){ .key = "carry",
                                         .what = "expected error of carrying a pixel from the reference view to "
                                                 "another at the working range, RMS over its picture, largest",
                                         .unit = "px",
                                         .value = carry,
                                         .stretch = 0.05,
                                         .pass = 0.10,
                                         .limit = 0.25,
                                         .judged = true,
                                         .remedy = "the capture does not pin this camera down: take more frames "
                                                   "that it shares with others, near the working range and in "
                                                   "all regions of its picture" }),
              f, f->worst_carry);
    add(f, (struct calib_bar){ .key = "pairs_mean",
                               .what = "neighbours disagree across the line between them: mean over pairs of the "
                                       "magnitude of their mean",
                               .unit = "px",
                               .value = f->pair_mean_px,
                               .stretch = 0.05,
                               .pass = 0.10,
                               .limit = 0.20,
                               .judged = f->pairs > 0,
                               .remedy = remedy });
    add(f, (struct calib_bar){ .key = "pairs_p95",
                               .what = "likewise, 95 % of the regions of a picture (of 20 and more corners) below",
                               .unit = "px",
                               .value = f->pair_p95_px,
                               .stretch = 0.12,
                               .pass = 0.25,
                               .limit = 0.5,
                               .judged = isfinite(f->pair_p95_px),
                               .remedy = remedy });
    bar = add(f, (struct calib_bar){ .key = "pairs_max",
                                     .what = "likewise, the worst pair",
                                     .unit = "px",
                                     .value = f->pair_max_px,
                                     .stretch = 0.25,
                                     .pass = 0.5,
                                     .limit = 1,
                                     .judged = f->pairs > 0,
                                     .remedy = remedy });
    if (f->pairs)
        snprintf(bar->where, sizeof(bar->where), "cameras %s and %s", f->camera[f->pair_worst[0]].name,
                 f->camera[f->pair_worst[1]].name);
}

/* What was refused and solved nevertheless may fit well: cameras at each other's places, for one. */
static void judge_forced(struct calib_figures *f, int overridden)
{
    add(f, (struct calib_bar){ .key = "overridden",
                               .what = "reasons to refuse the calibration that were overridden",
                               .unit = "",
                               .value = overridden,
                               .stretch = 0,
                               .pass = 0,
                               .limit = INFINITY,
                               .judged = true,
                               .remedy = "the warnings say what to correct; then solve without --force" });
}

static void judge_rest(struct calib_figures *f, const struct sst_solution *s)
{
    struct calib_bar *bar =
        add(f, (struct calib_bar){ .key = "missing",
                                   .what = "cameras of the array without a calibration",
                                   .unit = "",
                                   .value = f->known ? f->missing : (double)NAN,
                                   .stretch = 0,
                                   .pass = 0,
                                   .limit = INFINITY,
                                   .judged = true,
                                   .remedy = "they see no board that another camera sees in the same frame: take "
                                             "frames in which they do" });

    for (int k = 0; k < f->views && f->missing; k++) {
        const size_t used = strlen(bar->where);

        if (f->camera[k].expected && !s->calib.camera[k].known)
            snprintf(bar->where + used, sizeof(bar->where) - used, "%s%s", used ? ", " : "", f->camera[k].name);
    }
    add(f, (struct calib_bar){ .key = "seconds",
                               .what = "time that solving took",
                               .unit = "s",
                               .value = known_or_nan(s->seconds),
                               .stretch = 15,
                               .pass = 60,
                               .limit = INFINITY,
                               .remedy = "" });
}

void calib_figures_judge(struct calib_figures *f, const struct sst_calib_report *report)
{
    const struct sst_solution *s = report->solution;

    judge_residuals(f, s);
    judge_cross(f, s);
    judge_geometry(f, s);
    judge_forced(f, report->overridden);
    judge_rest(f, s);
    f->verdict = SST_CALIB_GOOD;
    for (int i = 0; i < f->bars; i++) {
        if (!f->bar[i].judged)
            continue;
        if (f->bar[i].state == SST_BAR_FAILED)
            f->verdict = SST_CALIB_BAD;
        else if ((f->bar[i].state == SST_BAR_MISSED || f->bar[i].state == SST_BAR_UNKNOWN) &&
                 f->verdict == SST_CALIB_GOOD)
            f->verdict = SST_CALIB_USABLE;
    }
    if (!(s->rms_px > 0 || s->corners > 0) || !isfinite(s->rms_px) || !f->known)
        f->verdict = SST_CALIB_BAD;
}

const char *calib_verdict_word(enum calib_verdict verdict)
{
    static const char *const words[] = { "good", "usable", "do not use" };

    return words[verdict];
}

const char *calib_bar_word(enum calib_bar_state state)
{
    static const char *const words[] = { "unknown", "met easily", "met", "missed", "failed" };

    return words[state];
}

struct calib_number calib_bar_value(const struct calib_bar *bar)
{
    return bar->unit[0] || !isfinite(bar->value) ? calib_figure(bar->value) : calib_count((int64_t)bar->value);
}

bool calib_bar_reason(const struct calib_bar *bar, char out[640])
{
    const bool over = bar->state == SST_BAR_MISSED || bar->state == SST_BAR_FAILED;

    if (!bar->judged || !(over || bar->state == SST_BAR_UNKNOWN))
        return false;
    if (over)
        snprintf(out, 640, "%s: %s%s%s%s%s%s, above %g; %s.", bar->what, calib_bar_value(bar).text,
                 bar->unit[0] ? " " : "", bar->unit, bar->where[0] ? " (" : "", bar->where, bar->where[0] ? ")" : "",
                 bar->state == SST_BAR_FAILED ? bar->limit : bar->pass, bar->remedy);
    else
        snprintf(out, 640, "%s: unknown, so nothing confirms it%s.", bar->what,
                 strcmp(bar->key, "cross") ? "" : "; solve with cross-validation");
    return true;
}
