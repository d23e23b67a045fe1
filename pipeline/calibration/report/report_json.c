/* All figures of the report as one JSON object. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/calibration/report/report_internal.h"

json_t *report_json_number(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

/* For figures of which 0 means unknown. */
static json_t *positive(double value)
{
    return value > 0 ? report_json_number(value) : json_null();
}

static json_t *text_of(const char *text)
{
    char clean[3 * 640 + 1];

    report_utf8(clean, text);
    return json_string(clean);
}

static json_t *numbers(const double *values, int n)
{
    json_t *list = json_array();

    for (int i = 0; list && i < n; i++)
        json_array_append_new(list, report_json_number(values[i]));
    return list;
}

static json_t *name_of(const struct report_figures *f, int view)
{
    return view >= 0 ? text_of(f->camera[view].name) : json_null();
}

static json_t *criteria(const struct report_figures *f)
{
    json_t *list = json_array();

    for (int i = 0; list && i < f->criteria; i++) {
        const struct report_criterion *b = &f->criterion[i];
        char reason[640];
        const bool is_reason = report_criterion_reason(b, reason);

        json_array_append_new(
            list, json_pack("{s:s, s:s, s:s, s:o, s:o, s:o, s:s, s:b, s:o, s:o}", "key", b->key, "definition", b->what,
                            "unit", b->unit, "value", report_json_number(b->value), "bar", report_json_number(b->pass),
                            "easily", report_json_number(b->stretch), "state", report_criterion_word(b->state),
                            "judged", (int)b->judged, "where", b->where[0] ? text_of(b->where) : json_null(), "reason",
                            is_reason ? text_of(reason) : json_null()));
    }
    return list;
}

static json_t *cameras(const struct sst_calibration_report *report, const struct report_figures *f)
{
    const struct sst_calib *calib = &report->solution->calib;
    json_t *list = json_array();

    for (int k = 0; list && k < f->views; k++) {
        const struct sst_calib_camera *c = &calib->camera[k];
        const struct report_camera *g = &f->camera[k];
        double rotation[3];
        json_t *o;

        if (!g->expected)
            continue;
        o = json_pack("{s:o, s:i, s:i, s:b, s:i, s:i, s:i, s:o, s:o, s:o}", "name", text_of(g->name), "row",
                      k / calib->cols, "col", k % calib->cols, "known", (int)c->known, "pictures", g->frames, "corners",
                      c->corners, "outliers", g->outliers, "rms_px", positive(c->rms_px), "systematic_px",
                      report_json_number(g->systematic_px), "coverage_lacks",
                      g->lacking[0] ? text_of(g->lacking) : json_null());
        if (o && c->known) {
            sst_rotation_to_vector(c->rotation, rotation);
            json_object_update_new(
                o,
                json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:b, s:o, s:o, s:o}", "sigma_px",
                          k == calib->reference ? json_real(0) : positive(c->sigma_px), "sigma_infinity_px",
                          report_json_number(g->transfer_px[0]), "lens_sigma_px", report_json_number(g->lens_px),
                          "focal_px", numbers((const double[]){ c->fx, c->fy }, 2), "centre_px",
                          numbers((const double[]){ c->cx, c->cy }, 2), "lens", numbers(c->k, c->lens), "position_mm",
                          numbers(c->position_mm, 3), "rotation_rad", numbers(rotation, 3), "lattice_off_mm",
                          numbers(f->lattice_mm[k], 2), "out_of_plane_mm", report_json_number(f->centre_mm[k][2]),
                          "reference", k == calib->reference, "plan_mm", numbers(f->centre_mm[k], 2), "gain",
                          numbers(c->gain, 3), "falloff", numbers(c->falloff, 3)));
            if (report->solution->drive_residual_mm)
                json_object_set_new(o, "drive_off_mm", numbers(report->solution->drive_residual_mm[k], 3));
        }
        json_array_append_new(list, o);
    }
    return list;
}

static json_t *frames(const struct sst_calibration_report *report)
{
    const struct sst_solution *s = report->solution;
    json_t *list = json_array();

    for (int i = 0; list && s->frame && i < report->detections->frames; i++)
        json_array_append_new(list,
                              json_pack("{s:o, s:o}", "name", text_of(report->detections->frame_name[i]), "rms_px",
                                        s->frame[i].known ? report_json_number(s->frame[i].rms_px) : json_null()));
    return list;
}

static json_t *link_of(const struct sst_solution *s, const struct report_figures *f, int index)
{
    const struct sst_solve_link *l = index >= 0 && index < s->links ? &s->link[index] : NULL;

    return l ? json_pack("{s:o, s:o, s:i, s:i, s:b, s:[i, i]}", "a", name_of(f, l->a), "b", name_of(f, l->b), "frames",
                         l->frames, "corners", l->corners, "tree", (int)l->tree, "views", l->a, l->b)
             : json_null();
}

static json_t *links(const struct sst_solution *s, const struct report_figures *f)
{
    json_t *list = json_array();

    for (int i = 0; list && i < s->links; i++)
        json_array_append_new(list, link_of(s, f, i));
    return list;
}

static json_t *array(const struct sst_calibration_report *report, const struct report_figures *f)
{
    const struct sst_rectified *r = report->rectified;
    double turn[3], mean_deg, most_deg;
    int most;

    if (!r)
        return json_null();
    sst_rotation_to_vector(r->rotation, turn);
    report_figures_angles(f, report, &mean_deg, &most_deg, &most);
    return json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "spacing_mm",
                     positive(r->spacing_mm), "step_mm", numbers(r->step_mm, 2), "skew_deg",
                     report_json_number(r->skew_deg), "lattice_rms_mm", report_json_number(r->lattice_rms_mm),
                     "lattice_max_mm", report_json_number(r->lattice_max_mm), "out_of_plane_rms_mm",
                     report_json_number(r->out_rms_mm), "out_of_plane_max_mm", report_json_number(r->out_max_mm),
                     "focal_px", positive(r->focal_px), "plane_mm", positive(r->plane_mm), "rotation_rad",
                     numbers(turn, 3), "turned_mean_deg", report_json_number(mean_deg), "turned_max_deg",
                     report_json_number(most_deg), "turned_max_camera", name_of(f, most));
}

static json_t *light(const struct sst_photometric_report *l)
{
    if (!l)
        return json_null();
    return json_pack("{s:i, s:i, s:o, s:o, s:o, s:o}", "samples", l->samples, "cameras", l->cameras, "before",
                     report_json_number(l->before), "after", report_json_number(l->after), "worst_falloff",
                     report_json_number(l->worst_falloff), "worst_gain", report_json_number(l->worst_gain));
}

static json_t *rig(const struct sst_solution *s)
{
    if (!s->drive_residual_mm)
        return json_null();
    return json_pack("{s:o, s:o, s:o}", "rms_mm", report_json_number(s->drive_rms_mm), "scale",
                     report_json_number(s->drive_scale), "skew_deg", report_json_number(s->drive_skew_deg));
}

static json_t *share(int64_t count, int64_t all)
{
    return report_json_number(all > 0 ? (double)count / (double)all : (double)NAN);
}

static json_t *residuals(const struct report_figures *f)
{
    json_t *bins = json_array();

    for (int i = 0; bins && i < REPORT_BINS; i++)
        json_array_append_new(bins, json_integer(f->bin[i]));
    return json_pack("{s:I, s:o, s:o, s:o, s:i, s:i, s:o, s:o, s:o, s:o, s:I}", "residuals", (json_int_t)f->samples,
                     "within_1", share(f->within[0], f->samples), "within_2", share(f->within[1], f->samples),
                     "within_3", share(f->within[2], f->samples), "regions", f->regions, "regions_not_random",
                     f->regions_off, "direction_z", report_json_number(f->direction_z), "systematic_px",
                     report_json_number(f->systematic_px), "systematic_camera", name_of(f, f->systematic_camera),
                     "histogram", bins, "beyond", (json_int_t)(f->below + f->above));
}

/* Pictures by the result of their detection. */
static json_t *outcomes(const struct sst_detections *all)
{
    static const char *const keys[] = { "with_board", "without_board", "too_few_points",
                                        "blurred",    "in_motion",     "other_board" };
    json_t *o = json_object();
    int sum = 0;

    for (size_t i = 0; o && i < ARRAY_LEN(keys); i++) {
        json_object_set_new(o, keys[i], json_integer(all->outcome[i]));
        sum += all->outcome[i];
    }
    if (!sum) /* of corners from a file only pictures with the board are known */
        json_object_set_new(o, keys[0], json_integer(all->count));
    return o;
}

static json_t *outliers(const struct sst_calibration_report *report, const struct report_figures *f)
{
    const struct sst_detections *all = report->detections;
    json_t *list = json_array();

    for (int i = 0; list && i < f->listed; i++) {
        const struct report_outlier *far = &f->outlier[i];
        const struct sst_detection *d = &all->detection[far->detection];

        json_array_append_new(list,
                              json_pack("{s:o, s:i, s:o, s:i, s:o, s:o}", "camera", name_of(f, d->view), "view",
                                        d->view, "frame", text_of(all->frame_name[d->frame]), "corner",
                                        d->corner[far->corner].id, "off_px", report_json_number(far->px), "residual_px",
                                        numbers(report->solution->view[far->detection].residual[far->corner], 2)));
    }
    return list;
}

static json_t *worst_pictures(const struct sst_calibration_report *report, const struct report_figures *f)
{
    const struct sst_detections *all = report->detections;
    json_t *list = json_array();

    for (int i = 0; list && i < f->worst_count; i++) {
        const struct sst_detection *d = &all->detection[f->worst[i].detection];

        json_array_append_new(list, json_pack("{s:o, s:i, s:o, s:o, s:i, s:i}", "camera", name_of(f, d->view), "view",
                                              d->view, "frame", text_of(all->frame_name[d->frame]), "median_px",
                                              report_json_number(f->worst[i].px), "corners", d->corners, "outliers",
                                              report->solution->view[f->worst[i].detection].outliers));
    }
    return list;
}

/* The calibrated array, and the means. */
static json_t *origin(const struct sst_calib *calib)
{
    const bool dated = calib->created_wall_ns > 0;

    return json_pack("{s:s, s:o, s:i, s:i, s:i, s:i, s:b}", "version", SST_VERSION, "created",
                     dated ? json_string(report_date(calib->created_wall_ns).text) : json_null(), "rows", calib->rows,
                     "cols", calib->cols, "width", calib->width, "height", calib->height, "poses_of_a_rig",
                     (int)calib->rig);
}

static json_t *held_out(const double px[2])
{
    return json_pack("[o, o]", positive(px[0]), positive(px[1]));
}

static json_t *solution(const struct sst_solution *s)
{
    const double all = (double)s->corners + s->outliers;

    return json_pack("{s:o, s:o, s:o, s:i, s:i, s:o, s:o, s:o, s:o, s:i, s:o, s:o, s:o, s:o, s:i, s:i, s:i, s:o, s:o}",
                     "rms_px", report_json_number(s->rms_px), "expected_rms_px", positive(s->predicted_rms_px),
                     "noise_px", positive(s->noise_px), "corners", s->corners, "outliers", s->outliers,
                     "outliers_percent", report_json_number(all > 0 ? 100 * s->outliers / all : (double)NAN),
                     "cross_px", report_json_number(s->cv_px), "cross_expected_px",
                     report_json_number(s->cv_expected_px), "held_out_px", held_out(s->held_out_px),
                     "lens_coefficients", s->lens, "source", text_of(s->calib.source), "board", text_of(s->calib.board),
                     "board_warp_mm", numbers(s->warp_mm, 2), "range_mm", positive(s->calib.range_mm), "states",
                     s->states, "measurements", s->measurements, "iterations", s->iterations, "seconds",
                     positive(s->seconds), "rcond", positive(s->rcond));
}

static json_t *pairs(const struct report_figures *f)
{
    return json_pack("{s:i, s:o, s:o, s:o}", "count", f->pairs, "mean_px", report_json_number(f->pair_mean_px),
                     "p95_px", report_json_number(f->pair_p95_px), "max_px", report_json_number(f->pair_max_px));
}

json_t *report_figures_json(const struct sst_calibration_report *report, const struct report_figures *f)
{
    const struct sst_solution *s = report->solution;
    const char *worst_frame = f->worst_frame >= 0 ? report->detections->frame_name[f->worst_frame] : NULL;
    json_t *o = json_pack("{s:s, s:i, s:i, s:i}", "verdict", report_verdict_word(f->verdict), "cameras_known", f->known,
                          "cameras_missing", f->missing, "frames_used", f->used_frames);

    json_object_update_new(o, solution(s));
    json_object_update_new(
        o, json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:i, s:o, s:o}",
                     "cross_camera", isfinite(s->cv_px) ? name_of(f, s->cv_camera) : json_null(), "worst_camera",
                     name_of(f, f->worst_camera), "worst_frame", worst_frame ? text_of(worst_frame) : json_null(),
                     "weakest_link", link_of(s, f, s->weakest), "pairs", pairs(f), "bars", criteria(f), "residuals",
                     residuals(f), "array", array(report, f), "light", light(report->light), "rig", rig(s), "cameras",
                     cameras(report, f), "frames", frames(report), "links", links(s, f), "worst_pictures",
                     worst_pictures(report, f), "outliers_known", f->outliers, "outlier_list", outliers(report, f),
                     "picture_outcomes", outcomes(report->detections)));
    json_object_update_new(o, origin(&s->calib));
    return o;
}
