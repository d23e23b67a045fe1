/* Report of sst process about the pictures themselves: corrections, and whether they can be views of one scene. */
#include "cli/cli_internal.h"

#include <math.h>
#include <stdio.h>

#include "base/log.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/lightfield/parallax.h"
#include "pipeline/method/process/process.h"

json_t *cli_align_json(const struct sst_lightfield *lf, const struct sst_align_report *a, bool wanted)
{
    json_t *views = json_array();

    for (int k = 0; lf->correction && k < lf->rows * lf->cols; k++) {
        const struct sst_correction *c = &lf->correction[k];

        if (!sst_correction_is_none(c))
            json_array_append_new(views, json_pack("{s:i, s:i, s:f, s:f, s:f, s:f, s:[f, f, f], s:f, s:f}", "row",
                                                   k / lf->cols, "col", k % lf->cols, "right_px", c->shift_x_px,
                                                   "down_px", c->shift_y_px, "roll_deg", c->roll_deg, "scale", c->scale,
                                                   "gain", c->gain[0], c->gain[1], c->gain[2], "falloff", c->falloff,
                                                   "exponent", c->exponent));
    }
    return json_pack("{s:s, s:i, s:b, s:i, s:i, s:i, s:f, s:o, s:b, s:o, s:o, s:i, s:o, s:o, s:o, s:o, s:o}", "mode",
                     wanted ? "auto" : "off", "moved", a->moved, "contradictory", (int)a->contradictory, "lit", a->lit,
                     "faded", a->faded, "bent", a->bent, "worst_exponent", a->worst_exponent, "exponent_sigma",
                     cli_real_json(a->exponent_sigma), "bent_kept", (int)a->bent_kept, "worst_falloff",
                     cli_real_json(a->worst_falloff), "falloff_sigma", cli_real_json(a->falloff_sigma), "unmeasured",
                     a->unmeasured, "worst_px", cli_real_json(a->worst_px), "worst_gain", cli_real_json(a->worst_gain),
                     "sigma_px", cli_real_json(a->sigma_px), "gain_sigma", cli_real_json(a->gain_sigma), "views",
                     views);
}

void cli_print_align(const struct sst_align_report *a)
{
    if (a->moved)
        printf("%d views moved by up to %.2f px (sigma %.3f), ", a->moved, a->worst_px, a->sigma_px);
    if (a->lit)
        printf("the gains of %d views corrected by up to %.0f %% (sigma %.1f), ", a->lit, 100 * a->worst_gain,
               100 * a->gain_sigma);
    if (a->bent)
        printf("the gammas of %d views corrected by up to %.0f %% (sigma %.1f), ", a->bent, 100 * a->worst_exponent,
               100 * a->exponent_sigma);
    if (a->faded)
        printf("the fall-off of %d views corrected, up to %.0f %% of the light in the corners (sigma %.1f), ", a->faded,
               100 * a->worst_falloff, 100 * a->falloff_sigma);
    if (a->contradictory)
        printf("displacements not corrected, as matches contradict each other (a fence or rows of windows), ");
}

json_t *cli_levels_json(const struct sst_lightfield *lf, const char *dir)
{
    int before, after;

    if (sst_lightfield_levels(lf, dir, true, &before, &after) || !before)
        return json_null();
    return json_pack("{s:i, s:i, s:[i, i]}", "before", before, "after", after, "samples", lf->samples.black,
                     lf->samples.white ? lf->samples.white : 65535);
}

void cli_add_judgement(json_t *root, const struct sst_lightfield *lf, const struct sst_judgement *j)
{
    json_t *views = json_array();

    for (int k = 0; j->judged && k < lf->rows * lf->cols; k++) {
        if (lf->views[k].present)
            json_array_append_new(views, json_pack("{s:i, s:i, s:b, s:s, s:o}", "row", k / lf->cols, "col",
                                                   k % lf->cols, "plausible", j->view[k].fault == SST_VIEW_FINE,
                                                   "fault", sst_judge_fault_name(j->view[k].fault), "confirmed_percent",
                                                   cli_real_json(j->view[k].confirmed)));
    }
    json_object_set_new(root, "plausible", j->judged ? json_boolean(j->plausible) : json_null());
    json_object_set_new(root, "implausible", json_string(j->sentence));
    json_object_set_new(root, "views", views);
}

void cli_add_notices(json_t *root, const struct sst_lightfield *lf, const struct sst_notices *n)
{
    json_t *list = json_array(), *soft = json_array();

    for (int i = 0; i < n->count; i++)
        json_array_append_new(list, json_pack("{s:s, s:s}", "what", n->notice[i].what, "text", n->notice[i].text));
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (n->soft_view[k])
            json_array_append_new(soft, json_pack("{s:i, s:i}", "row", k / lf->cols, "col", k % lf->cols));
    }
    json_object_set_new(root, "noise_levels", json_real(n->noise_levels));
    json_object_set_new(root, "edge_px", cli_real_json(n->edge_px));
    json_object_set_new(root, "soft_views", soft);
    json_object_set_new(root, "soft_px", json_real(n->soft_px));
    json_object_set_new(root, "jpeg_quality", cli_real_json(n->jpeg_quality));
    json_object_set_new(root, "jpeg_views", json_integer(n->jpeg_views));
    json_object_set_new(root, "missing_views", json_integer(n->missing));
    json_object_set_new(root, "skew_us", json_real(n->skew_us));
    json_object_set_new(root, "noticed", list);
}
