/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <math.h>
#include <stdio.h>

#include "pipeline/lightfield/folder.h"

int cli_print_lightfield(const char *dir, const char *name)
{
    struct sst_lightfield lf;
    double x0 = 0, x1 = 0, y0 = 0, y1 = 0; /* the reference view is at 0, 0 */
    int count = 0, err = sst_lightfield_load(&lf, dir, 0, 1);

    if (err)
        return err;
    for (int k = 0; k < lf.rows * lf.cols; k++) {
        const struct sst_view *v = &lf.views[k];

        if (!v->present)
            continue;
        count++;
        x0 = fmin(x0, v->bx);
        x1 = fmax(x1, v->bx);
        y0 = fmin(y0, v->by);
        y1 = fmax(y1, v->by);
    }
    printf("%s: %d views of %dx%d, grid %dx%d, offsets x %.3f..%.3f, y %.3f..%.3f, disparity ", name, count, lf.width,
           lf.height, lf.rows, lf.cols, x0, x1, y0, y1);
    if (lf.range_min_px < lf.range_max_px)
        printf("%.3f..%.3f px per spacing%s", lf.range_min_px, lf.range_max_px,
               lf.files->external_disparity ? " (given)" : "");
    else
        printf("range unknown");
    if (lf.infinity_px != 0)
        printf(", infinity at %.3f px", lf.infinity_px);
    putchar('\n');
    sst_lightfield_fini(&lf);
    return 0;
}
