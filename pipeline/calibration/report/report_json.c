/* All figures of the report as one JSON object. */
#include <jansson.h>
#include <math.h>

#include "base/log.h"
#include "pipeline/calibration/report/report_internal.h"

static json_t *real(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

/* 0 is how such figures say that they are unknown. */
static json_t *real0(double value)
{
    return value > 0 ? real(value) : json_null();
}

static json_t *text(const char *s)
{
    char clean[3 * 640 + 1];

    calib_utf8(clean, s);
    return json_string(clean);
}

static json_t *reals(const double *v, int n)
{
    json_t *list = json_array();

    for (int i = 0; list && i < n; i++)
        json_array_append_new(list, real(v[i]));
    return list;
}

static json_t *name_of(const struct calib_figures *f, int view)
{
    return view >= 0 ? text(f->camera[view].name) : json_null();
}

static json_t *bars(const struct calib_figures *f)
{
    json_t *list = json_array();

    for (int i = 0; list && i < f->bars; i++) {
        const struct calib_bar *b = &f->bar[i];
        char reason[640];
        const bool is_reason = calib_bar_reason(b, reason);

        json_array_append_new(list,
                              json_pack("{s:s, s:s, s:s, s:o, s:o, s:o, s:s, s:b, s:o, s:o}", "key", b->key,
                                        "definition", b->what, "unit", b->unit, "value", real(b->value), "bar",
                                        real(b->pass), "easily", real(b->stretch), "state", calib_bar_word(b->state),
                                        "judged", (int)b->judged, "where", b->where[0] ? text(b->where) : json_null(),
                                        "reason", is_reason ? text(reason) : json_null()));
    }
    return list;
}

static json_t *cameras(const struct sst_calib_report *report, const struct calib_figures *f)
{
    const struct sst_calib *calib = &report->solution->calib;
    json_t *list = json_array();

    for (int k = 0; list && k < f->views; k++) {
        const struct sst_calib_camera *c = &calib->camera[k];
        const struct calib_camera_figures *g = &f->camera[k];
        double rotation[3];
        json_t *o;

        if (!g->expected)
            continue;
        o = json_pack("{s:o, s:i, s:i, s:b, s:i, s:i, s:i, s:o, s:o, s:o}", "name", text(g->name), "row",
                      k / calib->cols, "col", k % calib->cols, "known", (int)c->known, "pictures", g->frames, "corners",
                      c->corners, "outliers", g->outliers, "rms_px", real0(c->rms_px), "systematic_px",
                      real(g->systematic_px), "coverage_lacks", g->lacking[0] ? text(g->lacking) : json_null());
        if (o && c->known) {
            sst_rotation_to_vector(c->rotation, rotation);
            json_object_set_new(o, "sigma_px", k == calib->reference ? json_real(0) : real0(c->sigma_px));
            json_object_set_new(o, "sigma_infinity_px", real(g->carry_px[0]));
            json_object_set_new(o, "lens_sigma_px", real(g->lens_px));
            json_object_set_new(o, "focal_px", reals((const double[]){ c->fx, c->fy }, 2));
            json_object_set_new(o, "centre_px", reals((const double[]){ c->cx, c->cy }, 2));
            json_object_set_new(o, "lens", reals(c->k, c->lens));
            json_object_set_new(o, "position_mm", reals(c->position_mm, 3));
            json_object_set_new(o, "rotation_rad", reals(rotation, 3));
            json_object_set_new(o, "lattice_off_mm", reals(f->lattice_mm[k], 2));
            json_object_set_new(o, "out_of_plane_mm", real(f->centre_mm[k][2]));
        }
        json_array_append_new(list, o);
    }
    return list;
}

static json_t *frames(const struct sst_calib_report *report)
{
    const struct sst_solution *s = report->solution;
    json_t *list = json_array();

    for (int i = 0; list && s->frame && i < report->detections->frames; i++)
        json_array_append_new(list, json_pack("{s:o, s:o}", "name", text(report->detections->frame_name[i]), "rms_px",
                                              s->frame[i].known ? real(s->frame[i].rms_px) : json_null()));
    return list;
}

static json_t *link_of(const struct sst_solution *s, const struct calib_figures *f, int index)
{
    const struct sst_solve_link *l = index >= 0 && index < s->links ? &s->link[index] : NULL;

    return l ? json_pack("{s:o, s:o, s:i, s:i, s:b}", "a", name_of(f, l->a), "b", name_of(f, l->b), "frames", l->frames,
                         "corners", l->corners, "tree", (int)l->tree)
             : json_null();
}

static json_t *links(const struct sst_solution *s, const struct calib_figures *f)
{
    json_t *list = json_array();

    for (int i = 0; list && i < s->links; i++)
        json_array_append_new(list, link_of(s, f, i));
    return list;
}

static json_t *array(const struct sst_rectified *r)
{
    if (!r)
        return json_null();
    return json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "spacing_mm", real0(r->spacing_mm), "step_mm",
                     reals(r->step_mm, 2), "skew_deg", real(r->skew_deg), "lattice_rms_mm", real(r->lattice_rms_mm),
                     "lattice_max_mm", real(r->lattice_max_mm), "out_of_plane_rms_mm", real(r->out_rms_mm),
                     "out_of_plane_max_mm", real(r->out_max_mm), "focal_px", real0(r->focal_px), "plane_mm",
                     real0(r->plane_mm));
}

static json_t *light(const struct sst_light_report *l)
{
    if (!l)
        return json_null();
    return json_pack("{s:i, s:i, s:o, s:o, s:o, s:o}", "samples", l->samples, "cameras", l->cameras, "before",
                     real(l->before), "after", real(l->after), "worst_falloff", real(l->worst_falloff), "worst_gain",
                     real(l->worst_gain));
}

static json_t *rig(const struct sst_solution *s)
{
    if (!s->drive_residual_mm)
        return json_null();
    return json_pack("{s:o, s:o, s:o}", "rms_mm", real(s->drive_rms_mm), "scale", real(s->drive_scale), "skew_deg",
                     real(s->drive_skew_deg));
}

static json_t *spread(const struct calib_figures *f)
{
    const double n = (double)f->samples;

    return json_pack("{s:I, s:o, s:o, s:o, s:i, s:i, s:o, s:o, s:o}", "residuals", (json_int_t)f->samples, "within_1",
                     real(n > 0 ? (double)f->within[0] / n : (double)NAN), "within_2",
                     real(n > 0 ? (double)f->within[1] / n : (double)NAN), "within_3",
                     real(n > 0 ? (double)f->within[2] / n : (double)NAN), "regions", f->regions, "regions_not_random",
                     f->regions_off, "direction_z", real(f->direction_z), "systematic_px", real(f->systematic_px),
                     "systematic_camera", name_of(f, f->systematic_camera));
}

static void add_solution(json_t *o, const struct sst_solution *s)
{
    const double all = (double)s->corners + s->outliers;

    json_object_set_new(o, "rms_px", real(s->rms_px));
    json_object_set_new(o, "expected_rms_px", real0(s->predicted_rms_px));
    json_object_set_new(o, "noise_px", real0(s->noise_px));
    json_object_set_new(o, "corners", json_integer(s->corners));
    json_object_set_new(o, "outliers", json_integer(s->outliers));
    json_object_set_new(o, "outliers_percent", real(all > 0 ? 100 * s->outliers / all : (double)NAN));
    json_object_set_new(o, "cross_px", real(s->cross_px));
    json_object_set_new(o, "cross_expected_px", real(s->cross_expected_px));
    json_object_set_new(o, "held_out_px",
                        reals((const double[]){ s->held_out_px[0] > 0 ? s->held_out_px[0] : (double)NAN,
                                                s->held_out_px[1] > 0 ? s->held_out_px[1] : (double)NAN },
                              2));
    json_object_set_new(o, "lens_coefficients", json_integer(s->lens));
    json_object_set_new(o, "source", text(s->calib.source));
    json_object_set_new(o, "board", text(s->calib.board));
    json_object_set_new(o, "board_warp_mm", reals(s->warp_mm, 2));
    json_object_set_new(o, "range_mm", real0(s->calib.range_mm));
    json_object_set_new(o, "states", json_integer(s->states));
    json_object_set_new(o, "measurements", json_integer(s->measurements));
    json_object_set_new(o, "iterations", json_integer(s->iterations));
    json_object_set_new(o, "seconds", real0(s->seconds));
    json_object_set_new(o, "rcond", real0(s->rcond));
}

static void add_figures(json_t *o, const struct sst_calib_report *report, const struct calib_figures *f)
{
    const struct sst_solution *s = report->solution;

    json_object_set_new(o, "verdict", json_string(calib_verdict_word(f->verdict)));
    json_object_set_new(o, "cameras_known", json_integer(f->known));
    json_object_set_new(o, "cameras_missing", json_integer(f->missing));
    json_object_set_new(o, "frames_used", json_integer(f->used_frames));
    add_solution(o, s);
    json_object_set_new(o, "cross_camera", isfinite(s->cross_px) ? name_of(f, s->cross_camera) : json_null());
    json_object_set_new(o, "worst_camera", name_of(f, f->worst_camera));
    json_object_set_new(o, "worst_frame",
                        f->worst_frame >= 0 ? text(report->detections->frame_name[f->worst_frame]) : json_null());
    json_object_set_new(o, "weakest_link", link_of(s, f, s->weakest));
    json_object_set_new(o, "pairs",
                        json_pack("{s:i, s:o, s:o, s:o}", "count", f->pairs, "mean_px", real(f->pair_mean_px), "p95_px",
                                  real(f->pair_p95_px), "max_px", real(f->pair_max_px)));
    json_object_set_new(o, "bars", bars(f));
    json_object_set_new(o, "residuals", spread(f));
    json_object_set_new(o, "array", array(report->rectified));
    json_object_set_new(o, "light", light(report->light));
    json_object_set_new(o, "rig", rig(s));
    json_object_set_new(o, "cameras", cameras(report, f));
    json_object_set_new(o, "frames", frames(report));
    json_object_set_new(o, "links", links(s, f));
}

char *sst_calib_report_json(const struct sst_calib_report *report)
{
    struct calib_figures f;
    json_t *o;
    char *out;

    if (calib_figures_init(&f, report))
        return NULL;
    o = json_object();
    if (o)
        add_figures(o, report, &f);
    out = o ? json_dumps(o, JSON_INDENT(1) | JSON_REAL_PRECISION(12)) : NULL;
    if (!out)
        sst_log_error("no memory for the report as JSON; close other programs");
    json_decref(o);
    calib_figures_fini(&f);
    return out;
}
