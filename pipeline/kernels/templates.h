/* pipeline/kernels/templates.h - every kernel template, compiled by each level's .c with KERNEL(name) set. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/agree_tmpl.h"
#include "pipeline/kernels/bilateral_tmpl.h"
#include "pipeline/kernels/blend_finish_tmpl.h"
#include "pipeline/kernels/blend_tmpl.h"
#include "pipeline/kernels/cell_land_tmpl.h"
#include "pipeline/kernels/census_tmpl.h"
#include "pipeline/kernels/cheapest_tmpl.h"
#include "pipeline/kernels/class_row_tmpl.h"
#include "pipeline/kernels/clear_blend_tmpl.h"
#include "pipeline/kernels/clear_take_tmpl.h"
#include "pipeline/kernels/clear_tmpl.h"
#include "pipeline/kernels/consensus_tmpl.h"
#include "pipeline/kernels/conv_tiles_tmpl.h"
#include "pipeline/kernels/correlate_places_tmpl.h"
#include "pipeline/kernels/enlarge_row_tmpl.h"
#include "pipeline/kernels/feature_cost_tmpl.h"
#include "pipeline/kernels/feature_products_tmpl.h"
#include "pipeline/kernels/guide_cells_tmpl.h"
#include "pipeline/kernels/hypothesis_cost_tmpl.h"
#include "pipeline/kernels/hypothesis_path_tmpl.h"
#include "pipeline/kernels/land_row_tmpl.h"
#include "pipeline/kernels/level_row_tmpl.h"
#include "pipeline/kernels/light_row_tmpl.h"
#include "pipeline/kernels/median_tmpl.h"
#include "pipeline/kernels/median_votes_tmpl.h"
#include "pipeline/kernels/place_row_tmpl.h"
#include "pipeline/kernels/resample_row_tmpl.h"
#include "pipeline/kernels/score_tmpl.h"
#include "pipeline/kernels/sgm_tmpl.h"
#include "pipeline/kernels/sha256_tmpl.h"
#include "pipeline/kernels/shown_row_tmpl.h"
#include "pipeline/kernels/split_row_tmpl.h"
#include "pipeline/kernels/subpixel_tmpl.h"
#include "pipeline/kernels/support_tmpl.h"
#include "pipeline/kernels/transpose_tmpl.h"
#include "pipeline/kernels/warped_row_tmpl.h"
#include "pipeline/kernels/window_tmpl.h"
#include "pipeline/kernels/winner_tmpl.h"

void KERNEL(sst_kernels_fill)(struct sst_kernels *k);

void KERNEL(sst_kernels_fill)(struct sst_kernels *k)
{
#define X(name) k->name = KERNEL(name);
    SST_KERNEL_LIST(X)
#undef X
}
