/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/method/disparity/disparity.h"

#define COMMON                                                                                                         \
    .disp_max_px = 127, .p1 = 14, .p2 = 90, .edge_step = 24, .fill = true, .joint = true, .neighbours = 12,            \
    .key_error = 5, .skip_ranges = true, .range_bytes = (size_t)512 << 20
#define SUPPORT                                                                                                        \
    .support_arm = 5, .support_tau = 18, .support_before = 1, .bilateral_tau = 8, .subpixel_steps = 3,                 \
    .subpixel_views = 12

/* One parameter set per preset for all inputs; chosen on simulated scenes and stereo pairs, see docs/. */
static const struct {
    const char *name;
    struct sst_disparity_config cfg;
} presets[] = {
    { "preview", { COMMON, .cost = SST_COST_CENSUS, .paths = 4, .range_error = 1, .scale = 2, .key_spacing = 3 } },
    { "balanced",
      { COMMON, SUPPORT, .cost = SST_COST_CENSUS, .paths = 4, .range_error = 1, .scale = 1, .rounds = 1,
        .guided_rounds = 1, .key_spacing = 3, .skip_hypotheses = true } },
    { "accurate",
      { COMMON, SUPPORT, .cost = SST_COST_BOTH, .census_suffices = true, .range_error = 0.1, .paths = 4, .scale = 1,
        .rounds = 2, .guided_holes = true, .guided_rounds = 3, .key_spacing = 3, .keys_in_texture = true } },
};

int sst_disparity_preset(struct sst_disparity_config *cfg, const char *preset)
{
    for (size_t i = 0; i < ARRAY_LEN(presets); i++) {
        if (!strcmp(presets[i].name, preset)) {
            *cfg = presets[i].cfg;
            return 0;
        }
    }
    sst_log_error("unknown preset `%s`; use preview, balanced or accurate", preset);
    return -EINVAL;
}
