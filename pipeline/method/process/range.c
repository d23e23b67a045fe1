/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>

#include "base/log.h"
#include "pipeline/method/process/process.h"

#define FARTHEST_PX 1e4 /* from 0 */

int sst_process_check_range(double min_px, double max_px)
{
    if (max_px > min_px && max_px - min_px + 1 <= SST_DISPARITY_MAX_STEPS && fabs(min_px) < FARTHEST_PX)
        return 0;
    sst_log_error(
        "the disparity range %g..%g px is invalid: it must be ascending and span at most %d px; give a part of "
        "it, or make the views smaller",
        min_px, max_px, SST_DISPARITY_MAX_STEPS - 1);
    return -EINVAL;
}
