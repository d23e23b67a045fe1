/* tests/match_network.h - light fields that are matched by the features of ow_feature_network(). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_MATCH_NETWORK_H
#define SST_TESTS_MATCH_NETWORK_H

#include <stdio.h>
#include <unistd.h>

#include "tests/match_field.h"
#include "tests/onnx_writer.h"

/* Ways to match with it. @return false: there is none of this number */
static inline bool match_config_learned(struct sst_disparity_config *cfg, int i, const char *path)
{
    assert_true(match_config(cfg, i == 1 ? 4 : 5)); /* in whole pixels, in halves */
    cfg->cost = i == 1 ? SST_COST_MCCNN : SST_COST_BOTH;
    cfg->model = path;
    cfg->precision = SST_PRECISION_F32;
    cfg->key_spacing = 1;
    cfg->rounds = 0;
    cfg->phase_step = i == 0 ? 1 : cfg->phase_step;
    cfg->frugal = i == 2;
    cfg->raw = i == 3;
    return i < 4;
}

#endif
