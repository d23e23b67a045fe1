/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/disparity/disparity.h"

/* Is a view present within `reach` rows and columns of another one for which `carried` (NULL: all of them) is false? */
static bool near_one(const struct sst_lightfield *lf, int view, int reach, const bool *carried)
{
    const int row = view / lf->cols, col = view % lf->cols;

    for (int r = sst_max_int(row - reach, 0); r <= sst_min_int(row + reach, lf->rows - 1); r++) {
        for (int c = sst_max_int(col - reach, 0); c <= sst_min_int(col + reach, lf->cols - 1); c++) {
            const int n = r * lf->cols + c;

            if (n != view && lf->views[n].present && (!carried || !carried[n]))
                return true;
        }
    }
    return false;
}

/* Has a view another one to be matched with: next to it, or two steps away in its row or column? */
static bool has_neighbour(const struct sst_lightfield *lf, int view)
{
    const int row = view / lf->cols, col = view % lf->cols;

    return near_one(lf, view, 1, NULL) || (row > 1 && lf->views[view - 2 * lf->cols].present) ||
           (row + 2 < lf->rows && lf->views[view + 2 * lf->cols].present) || (col > 1 && lf->views[view - 2].present) ||
           (col + 2 < lf->cols && lf->views[view + 2].present);
}

int sst_disparity_keys(const struct sst_lightfield *lf, int spacing, bool *carried)
{
    const int views = lf->rows * lf->cols, slope = spacing == 3 ? 1 : 2;
    const int phase = lf->ref_view % lf->cols + slope * (lf->ref_view / lf->cols);
    int keys = 0;

    for (int k = 0; k < views; k++)
        carried[k] = (k % lf->cols + slope * (k / lf->cols) - phase) % spacing != 0 || !has_neighbour(lf, k) ||
                     !lf->views[k].present;
    for (int k = 0; k < views; k++) {
        if (carried[k] && lf->views[k].present && has_neighbour(lf, k) && !near_one(lf, k, 1, carried))
            carried[k] = false;
        keys += !carried[k];
    }
    return keys;
}
