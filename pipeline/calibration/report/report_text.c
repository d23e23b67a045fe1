/* The report's summary for a terminal. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/calibration/report/report_internal.h"

static void errors(FILE *out, const struct sst_calibration_report *report, const struct report_figures *f)
{
    const struct sst_solution *s = report->solution;
    const double all = (double)s->corners + s->outliers;

    fprintf(out, "  %9s px  RMS per point over %s corners of %d camera%s in %d frames, both axes together\n",
            NUM(s->rms_px, 3), COUNT(s->corners), f->known, f->known == 1 ? "" : "s", f->used_frames);
    fprintf(out, "  %9s px  expected from corner noise of %s px per axis and %s unknowns\n",
            NUM0(s->predicted_rms_px, 3), NUM0(s->noise_px, 3), COUNT(s->states));
    fprintf(out, "  %9s %%   outliers: %s of %s corners rejected\n",
            NUM(all > 0 ? 100 * s->outliers / all : (double)NAN, 2), COUNT(s->outliers), COUNT((int64_t)all));
    if (isfinite(s->cv_px))
        fprintf(out,
                "  %9s px  cross-validation, odd against even frames, central 80 %%, worst camera (expected %s px)\n",
                NUM(s->cv_px, 2), NUM(s->cv_expected_px, 2));
    else
        fprintf(out, "  %9s     cross-validation (odd against even frames): not done\n", "-");
    if (f->worst_transfer >= 0) {
        char name[3 * sizeof(f->camera->title)];

        report_utf8(name, f->camera[f->worst_transfer].title);
        fprintf(out, "  %9s px  expected error of transferring a pixel from the reference view at %s mm, worst: %s\n",
                NUM(s->calib.camera[f->worst_transfer].sigma_px, 2), NUM0(s->calib.range_mm, 4), name);
    }
    if (f->pairs)
        fprintf(out, "  %9s px  epipolar error of neighbours, 95 %% of the regions of %d pair%s\n",
                FIGURE(f->pair_p95_px), f->pairs, f->pairs == 1 ? "" : "s");
}

static void worst(FILE *out, const struct sst_calibration_report *report, const struct report_figures *f)
{
    const struct sst_solution *s = report->solution;
    char a[3 * sizeof(f->camera->title)], b[3 * sizeof(f->camera->title)];

    if (f->worst_camera >= 0) {
        report_utf8(a, f->camera[f->worst_camera].title);
        fprintf(out, "  worst camera  %s: %s px RMS per point over %s corners\n", a,
                NUM(s->calib.camera[f->worst_camera].rms_px, 3), COUNT(s->calib.camera[f->worst_camera].corners));
    }
    if (f->worst_frame >= 0) {
        report_utf8(a, report->detections->frame_name[f->worst_frame]);
        fprintf(out, "  worst frame   %s: %s px RMS per point\n", a, NUM(s->frame[f->worst_frame].rms_px, 3));
    }
    if (s->weakest >= 0 && s->weakest < s->links) {
        const struct sst_solve_link *l = &s->link[s->weakest];

        report_utf8(a, f->camera[l->a].title);
        report_utf8(b, f->camera[l->b].title);
        fprintf(out, "  weakest link  %s - %s: %s corners in %s frames\n", a, b, COUNT(l->corners), COUNT(l->frames));
    }
    if (report->rectified)
        fprintf(out, "  array         spacing %s mm, off the lattice %s mm RMS, out of the plane %s mm RMS\n",
                NUM0(report->rectified->spacing_mm, 5), FIGURE(report->rectified->lattice_rms_mm),
                FIGURE(report->rectified->out_rms_mm));
    if (s->drive_residual_mm)
        fprintf(out, "  drives        %s mm RMS off the solved positions, scale %s, axes %s degrees from square\n",
                FIGURE(s->drive_rms_mm), NUM(s->drive_scale, 6), NUM(s->drive_skew_deg, 2));
    if (report->light)
        fprintf(out, "  light         cameras differ by %s %%, after correction by %s %%\n",
                NUM(100 * report->light->before, 2), NUM(100 * report->light->after, 2));
    fprintf(out, "  lens model    %d coefficients; %s iterations, %s s\n", s->lens, COUNT(s->iterations),
            NUM0(s->seconds, 2));
}

int sst_calibration_report_text(FILE *out, const struct sst_calibration_report *report)
{
    struct report_figures f;
    char reason[640], clean[3 * sizeof(reason)];
    int err = report_figures_init(&f, report);

    if (err)
        return err;
    fprintf(out, "calibration: %s\n", report_verdict_word(f.verdict));
    for (int state = CRITERION_FAILED; state >= CRITERION_UNKNOWN; state--) {
        for (int i = 0; i < f.criteria; i++) {
            if ((int)f.criterion[i].state != state || !report_criterion_reason(&f.criterion[i], reason))
                continue;
            report_utf8(clean, reason);
            fprintf(out, "  %s: %s\n", report_criterion_word(f.criterion[i].state), clean);
        }
    }
    errors(out, report, &f);
    worst(out, report, &f);
    report_figures_fini(&f);
    return 0;
}
