/* All figures of the report as one JSON object. */
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

json_t *report_json_text(const char *text)
{
    char clean[3 * 640 + 1];

    report_utf8(clean, text);
    return json_string(clean);
}

json_t *report_json_numbers(const double *values, int n)
{
    json_t *list = json_array();

    for (int i = 0; list && i < n; i++)
        json_array_append_new(list, report_json_number(values[i]));
    return list;
}

static json_t *name_of(const struct report_figures *f, int view)
{
    return view >= 0 ? report_json_text(f->camera[view].name) : json_null();
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
                            "judged", (int)b->judged, "where", b->where[0] ? report_json_text(b->where) : json_null(),
                            "reason", is_reason ? report_json_text(reason) : json_null()));
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
        o = json_pack("{s:o, s:i, s:i, s:b, s:i, s:i, s:i, s:o, s:o, s:o}", "name", report_json_text(g->name), "row",
                      k / calib->cols, "col", k % calib->cols, "known", (int)c->known, "pictures", g->frames, "corners",
                      c->corners, "outliers", g->outliers, "rms_px", positive(c->rms_px), "systematic_px",
                      report_json_number(g->systematic_px), "coverage_lacks",
                      g->lacking[0] ? report_json_text(g->lacking) : json_null());
        if (o && c->known) {
            sst_rotation_to_vector(c->rotation, rotation);
            json_object_set_new(o, "sigma_px", k == calib->reference ? json_real(0) : positive(c->sigma_px));
            json_object_set_new(o, "sigma_infinity_px", report_json_number(g->transfer_px[0]));
            json_object_set_new(o, "lens_sigma_px", report_json_number(g->lens_px));
            json_object_set_new(o, "focal_px", report_json_numbers((const double[]){ c->fx, c->fy }, 2));
            json_object_set_new(o, "centre_px", report_json_numbers((const double[]){ c->cx, c->cy }, 2));
            json_object_set_new(o, "lens", report_json_numbers(c->k, c->lens));
            json_object_set_new(o, "position_mm", report_json_numbers(c->position_mm, 3));
            json_object_set_new(o, "rotation_rad", report_json_numbers(rotation, 3));
            json_object_set_new(o, "lattice_off_mm", report_json_numbers(f->lattice_mm[k], 2));
            json_object_set_new(o, "out_of_plane_mm", report_json_number(f->centre_mm[k][2]));
            json_object_set_new(o, "reference", json_boolean(k == calib->reference));
            json_object_set_new(o, "plan_mm", report_json_numbers(f->centre_mm[k], 2));
            json_object_set_new(o, "gain", report_json_numbers(c->gain, 3));
            json_object_set_new(o, "falloff", report_json_numbers(c->falloff, 3));
            if (report->solution->drive_residual_mm)
                json_object_set_new(o, "drive_off_mm", report_json_numbers(report->solution->drive_residual_mm[k], 3));
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
        json_array_append_new(
            list, json_pack("{s:o, s:o}", "name", report_json_text(report->detections->frame_name[i]), "rms_px",
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
    json_t *o;

    if (!r)
        return json_null();
    o = json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "spacing_mm", positive(r->spacing_mm), "step_mm",
                  report_json_numbers(r->step_mm, 2), "skew_deg", report_json_number(r->skew_deg), "lattice_rms_mm",
                  report_json_number(r->lattice_rms_mm), "lattice_max_mm", report_json_number(r->lattice_max_mm),
                  "out_of_plane_rms_mm", report_json_number(r->out_rms_mm), "out_of_plane_max_mm",
                  report_json_number(r->out_max_mm), "focal_px", positive(r->focal_px), "plane_mm",
                  positive(r->plane_mm));
    sst_rotation_to_vector(r->rotation, turn);
    report_figures_angles(f, report, &mean_deg, &most_deg, &most);
    json_object_set_new(o, "rotation_rad", report_json_numbers(turn, 3));
    json_object_set_new(o, "turned_mean_deg", report_json_number(mean_deg));
    json_object_set_new(o, "turned_max_deg", report_json_number(most_deg));
    json_object_set_new(o, "turned_max_camera", name_of(f, most));
    return o;
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

/* Pictures by what was found in them. */
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
    if (!sum) /* of corners from a file only those with the board are known */
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

        json_array_append_new(
            list, json_pack("{s:o, s:i, s:o, s:i, s:o, s:o}", "camera", name_of(f, d->view), "view", d->view, "frame",
                            report_json_text(all->frame_name[d->frame]), "corner", d->corner[far->corner].id, "off_px",
                            report_json_number(far->px), "residual_px",
                            report_json_numbers(report->solution->view[far->detection].residual[far->corner], 2)));
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
                                              d->view, "frame", report_json_text(all->frame_name[d->frame]),
                                              "median_px", report_json_number(f->worst[i].px), "corners", d->corners,
                                              "outliers", report->solution->view[f->worst[i].detection].outliers));
    }
    return list;
}

/* What was calibrated, with what. */
static void add_origin(json_t *o, const struct sst_calib *calib)
{
    json_object_set_new(o, "version", json_string(SST_VERSION));
    json_object_set_new(
        o, "created", calib->created_wall_ns > 0 ? json_string(report_date(calib->created_wall_ns).text) : json_null());
    json_object_set_new(o, "rows", json_integer(calib->rows));
    json_object_set_new(o, "cols", json_integer(calib->cols));
    json_object_set_new(o, "width", json_integer(calib->width));
    json_object_set_new(o, "height", json_integer(calib->height));
    json_object_set_new(o, "poses_of_a_rig", json_boolean(calib->rig));
}

static void add_solution(json_t *o, const struct sst_solution *s)
{
    const double all = (double)s->corners + s->outliers;

    json_object_set_new(o, "rms_px", report_json_number(s->rms_px));
    json_object_set_new(o, "expected_rms_px", positive(s->predicted_rms_px));
    json_object_set_new(o, "noise_px", positive(s->noise_px));
    json_object_set_new(o, "corners", json_integer(s->corners));
    json_object_set_new(o, "outliers", json_integer(s->outliers));
    json_object_set_new(o, "outliers_percent", report_json_number(all > 0 ? 100 * s->outliers / all : (double)NAN));
    json_object_set_new(o, "cross_px", report_json_number(s->cv_px));
    json_object_set_new(o, "cross_expected_px", report_json_number(s->cv_expected_px));
    json_object_set_new(o, "held_out_px",
                        report_json_numbers((const double[]){ s->held_out_px[0] > 0 ? s->held_out_px[0] : (double)NAN,
                                                              s->held_out_px[1] > 0 ? s->held_out_px[1] : (double)NAN },
                                            2));
    json_object_set_new(o, "lens_coefficients", json_integer(s->lens));
    json_object_set_new(o, "source", report_json_text(s->calib.source));
    json_object_set_new(o, "board", report_json_text(s->calib.board));
    json_object_set_new(o, "board_warp_mm", report_json_numbers(s->warp_mm, 2));
    json_object_set_new(o, "range_mm", positive(s->calib.range_mm));
    json_object_set_new(o, "states", json_integer(s->states));
    json_object_set_new(o, "measurements", json_integer(s->measurements));
    json_object_set_new(o, "iterations", json_integer(s->iterations));
    json_object_set_new(o, "seconds", positive(s->seconds));
    json_object_set_new(o, "rcond", positive(s->rcond));
}

json_t *report_figures_json(const struct sst_calibration_report *report, const struct report_figures *f)
{
    const struct sst_solution *s = report->solution;
    json_t *o = json_object();

    if (!o)
        return NULL;

    json_object_set_new(o, "verdict", json_string(report_verdict_word(f->verdict)));
    json_object_set_new(o, "cameras_known", json_integer(f->known));
    json_object_set_new(o, "cameras_missing", json_integer(f->missing));
    json_object_set_new(o, "frames_used", json_integer(f->used_frames));
    add_solution(o, s);
    json_object_set_new(o, "cross_camera", isfinite(s->cv_px) ? name_of(f, s->cv_camera) : json_null());
    json_object_set_new(o, "worst_camera", name_of(f, f->worst_camera));
    json_object_set_new(o, "worst_frame",
                        f->worst_frame >= 0 ? report_json_text(report->detections->frame_name[f->worst_frame])
                                            : json_null());
    json_object_set_new(o, "weakest_link", link_of(s, f, s->weakest));
    json_object_set_new(o, "pairs",
                        json_pack("{s:i, s:o, s:o, s:o}", "count", f->pairs, "mean_px",
                                  report_json_number(f->pair_mean_px), "p95_px", report_json_number(f->pair_p95_px),
                                  "max_px", report_json_number(f->pair_max_px)));
    json_object_set_new(o, "bars", criteria(f));
    json_object_set_new(o, "residuals", residuals(f));
    json_object_set_new(o, "array", array(report, f));
    json_object_set_new(o, "light", light(report->light));
    json_object_set_new(o, "rig", rig(s));
    json_object_set_new(o, "cameras", cameras(report, f));
    json_object_set_new(o, "frames", frames(report));
    json_object_set_new(o, "links", links(s, f));
    json_object_set_new(o, "worst_pictures", worst_pictures(report, f));
    json_object_set_new(o, "outliers_known", json_integer(f->outliers));
    json_object_set_new(o, "outlier_list", outliers(report, f));
    json_object_set_new(o, "picture_outcomes", outcomes(report->detections));
    add_origin(o, &s->calib);
    return o;
}
