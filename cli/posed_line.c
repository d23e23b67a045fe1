/* One line, or an object, about a posed light field. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <math.h>
#include <stdio.h>

#include "pipeline/posed/posed.h"

#define METRE_MM 1000.0

/* Extent of the centres along each axis, m. */
static void extent(double m[3], const struct sst_posed *posed)
{
    for (int i = 0; i < 3; i++) {
        double lo = INFINITY, hi = -INFINITY;

        for (int k = 0; k < posed->count; k++) {
            const struct sst_calib_camera *c = &posed->view[k].camera;

            if (c->known) {
                lo = fmin(lo, c->position_mm[i]);
                hi = fmax(hi, c->position_mm[i]);
            }
        }
        m[i] = lo <= hi ? (hi - lo) / METRE_MM : 0;
    }
}

static int moments(const struct sst_posed *posed)
{
    int most = 0;

    for (int k = 0; k < posed->count; k++)
        most = sst_max_int(most, posed->view[k].moment);
    return most;
}

json_t *cli_posed_json(const struct sst_posed *posed)
{
    double m[3];

    extent(m, posed);
    return json_pack("{s:s, s:i, s:i, s:i, s:i, s:i, s:i, s:b, s:[f, f, f], s:i, s:o, s:i, s:b, s:b, s:s, s:s}", "kind",
                     "posed", "views", posed->count, "placed", sst_posed_placed(posed), "width", posed->width, "height",
                     posed->height, "channels", posed->channels, "bits", posed->bits, "metric", (int)posed->metric,
                     "extent_m", m[0], m[1], m[2], "points", posed->point_count, "median_px",
                     cli_real_json(posed->median_px), "moments", moments(posed), "thermal", posed->kelvin_scale != 0,
                     "geographic", (int)posed->geographic, "source", posed->source, "history", posed->history);
}

static void print_line(const struct sst_posed *posed, const char *name)
{
    const int placed = sst_posed_placed(posed);
    double m[3];

    extent(m, posed);
    printf("%s: %d views of %dx%d, %s of %d bits%s, %d placed", name, posed->count, posed->width, posed->height,
           posed->channels == 1 ? "grey" : "colour", posed->bits, posed->kelvin_scale != 0 ? " (thermal)" : "", placed);
    if (placed)
        printf(", centres over %.3f x %.3f x %.3f %s", m[0], m[1], m[2], posed->metric ? "m" : "(unit unknown)");
    if (moments(posed))
        printf(", %d moments", moments(posed));
    if (posed->point_count)
        printf(", %d points", posed->point_count);
    if (!isnan(posed->median_px))
        printf(", median %.2f px", posed->median_px);
    if (posed->geographic)
        printf(", at %.6f, %.6f", posed->latitude, posed->longitude);
    printf(", %s\n", posed->source);
}

int cli_report_posed(const char *dir, const char *name, bool json)
{
    struct sst_posed posed;
    const int err = sst_posed_load(&posed, dir);
    int r = CLI_OK;

    if (err)
        return cli_exit_code(err);
    if (json)
        r = cli_print_json(cli_posed_json(&posed));
    else
        print_line(&posed, name);
    sst_posed_fini(&posed);
    return r;
}
