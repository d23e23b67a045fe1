/* The report's summary for a terminal. */
#include <math.h>

#include "pipeline/calibration/report/report_internal.h"

static void errors(FILE *out, const struct sst_calib_report *report, const struct calib_figures *f)
{
    const struct sst_solution *s = report->solution;
    const double all = (double)s->corners + s->outliers;

    fprintf(out, "  %9s px  RMS per point over %s corners of %d camera%s in %d frames, both axes together\n",
            SST_NUM(s->rms_px, 3), SST_COUNT(s->corners), f->known, f->known == 1 ? "" : "s", f->used_frames);
    fprintf(out, "  %9s px  is what corner noise of %s px per axis and %s unknowns let expect\n",
            SST_NUM0(s->predicted_rms_px, 3), SST_NUM0(s->noise_px, 3), SST_COUNT(s->states));
    fprintf(out, "  %9s %%   outliers: %s of %s corners left out\n",
            SST_NUM(all > 0 ? 100 * s->outliers / all : (double)NAN, 2), SST_COUNT(s->outliers),
            SST_COUNT((int64_t)all));
    if (isfinite(s->cross_px))
        fprintf(out, "  %9s px  odd against even frames, RMS over the central 80 %%, worst camera (expected %s px)\n",
                SST_NUM(s->cross_px, 2), SST_NUM(s->cross_expected_px, 2));
    else
        fprintf(out, "  %9s     odd against even frames: not done\n", "-");
    if (f->worst_carry >= 0) {
        char name[3 * sizeof(f->camera->name)];

        calib_utf8(name, f->camera[f->worst_carry].name);
        fprintf(out, "  %9s px  expected error of carrying a pixel from the reference view at %s mm, worst: %s\n",
                SST_NUM(s->calib.camera[f->worst_carry].sigma_px, 2), SST_NUM0(s->calib.range_mm, 4), name);
    }
    if (f->pairs)
        fprintf(out, "  %9s px  neighbours line up across the line between them, 95 %% of the regions of %d pair%s\n",
                SST_FIGURE(f->pair_p95_px), f->pairs, f->pairs == 1 ? "" : "s");
}

static void worst(FILE *out, const struct sst_calib_report *report, const struct calib_figures *f)
{
    const struct sst_solution *s = report->solution;
    char a[3 * 64], b[3 * 64];

    if (f->worst_camera >= 0) {
        calib_utf8(a, f->camera[f->worst_camera].name);
        fprintf(out, "  worst camera  %s: %s px RMS per point over %s corners\n", a,
                SST_NUM(s->calib.camera[f->worst_camera].rms_px, 3),
                SST_COUNT(s->calib.camera[f->worst_camera].corners));
    }
    if (f->worst_frame >= 0) {
        calib_utf8(a, report->detections->frame_name[f->worst_frame]);
        fprintf(out, "  worst frame   %s: %s px RMS per point\n", a, SST_NUM(s->frame[f->worst_frame].rms_px, 3));
    }
    if (s->weakest >= 0 && s->weakest < s->links) {
        const struct sst_solve_link *l = &s->link[s->weakest];

        calib_utf8(a, f->camera[l->a].name);
        calib_utf8(b, f->camera[l->b].name);
        fprintf(out, "  weakest link  %s - %s: %s corners in %s frames\n", a, b, SST_COUNT(l->corners),
                SST_COUNT(l->frames));
    }
    if (report->rectified)
        fprintf(out, "  array         spacing %s mm, off the lattice %s mm RMS, out of the plane %s mm RMS\n",
                SST_NUM0(report->rectified->spacing_mm, 5), SST_FIGURE(report->rectified->lattice_rms_mm),
                SST_FIGURE(report->rectified->out_rms_mm));
    if (s->drive_residual_mm)
        fprintf(out, "  drives        %s mm RMS beside the solved places, scale %s, axes %s degrees from square\n",
                SST_FIGURE(s->drive_rms_mm), SST_NUM(s->drive_scale, 6), SST_NUM(s->drive_skew_deg, 2));
    if (report->light)
        fprintf(out, "  light         cameras differ by %s %%, corrected %s %%\n",
                SST_NUM(100 * report->light->before, 2), SST_NUM(100 * report->light->after, 2));
    fprintf(out, "  lens model    %d coefficients; %s iterations, %s s\n", s->lens, SST_COUNT(s->iterations),
            SST_NUM0(s->seconds, 2));
}

int sst_calib_report_text(FILE *out, const struct sst_calib_report *report)
{
    struct calib_figures f;
    char reason[640], clean[3 * sizeof(reason)];
    int err = calib_figures_init(&f, report);

    if (err)
        return err;
    fprintf(out, "calibration: %s\n", calib_verdict_word(f.verdict));
    for (int state = SST_BAR_FAILED; state >= SST_BAR_UNKNOWN; state--) {
        for (int i = 0; i < f.bars; i++) {
            if ((int)f.bar[i].state != state || !calib_bar_reason(&f.bar[i], reason))
                continue;
            calib_utf8(clean, reason);
            fprintf(out, "  %s: %s\n", calib_bar_word(f.bar[i].state), clean);
        }
    }
    errors(out, report, &f);
    worst(out, report, &f);
    calib_figures_fini(&f);
    return 0;
}
