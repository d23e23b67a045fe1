#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/blend.h"
#include "pipeline/gpu/carry.h"
#include "pipeline/gpu/check.h"
#include "pipeline/gpu/clear_sample.h"
#include "pipeline/gpu/convert.h"
#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/gpu/hole.h"
#include "pipeline/gpu/hypotheses.h"
#include "pipeline/gpu/jpeg_rgb.h"
#include "pipeline/gpu/label.h"
#include "pipeline/gpu/match.h"
#include "pipeline/gpu/net.h"
#include "pipeline/gpu/rectify.h"
#include "pipeline/gpu/refine.h"
#include "pipeline/gpu/subpixel.h"
#include "pipeline/gpu/surfaces.h"
#include "pipeline/gpu/sweep.h"
#include "pipeline/gpu/verify.h"

const struct gpu_shader gpu_shaders[SST_GPU_SHADERS] = {
    [SST_GPU_BLEND] = { "blend", SST_GPU_BLEND_BUFFERS, sizeof(struct sst_gpu_blend), blend_reference,
                        blend_self_test },
    [SST_GPU_CLEAR_LAND] = { "clear_land", SST_GPU_LAND_BUFFERS, sizeof(struct sst_gpu_clear), clear_land_reference,
                             clear_land_self_test },
    [SST_GPU_CLEAR_BLEND] = { "clear_blend", SST_GPU_CLEAR_BUFFERS, sizeof(struct sst_gpu_clear), clear_blend_reference,
                              clear_blend_self_test },
    [SST_GPU_CLEAR_SURFACE] = { "clear_surface", SST_GPU_SURFACE_BUFFERS, sizeof(struct sst_gpu_clear),
                                clear_surface_reference, clear_surface_self_test },
    [SST_GPU_CLEAR_SAMPLE] = { "clear_sample", SST_GPU_SAMPLE_BUFFERS, sizeof(struct sst_gpu_clear_sample),
                               clear_sample_reference, clear_sample_self_test },
    [SST_GPU_HOLE_PULL] = { "hole_pull", SST_GPU_HOLE_BUFFERS, sizeof(struct sst_gpu_hole), hole_pull_reference,
                            hole_pull_self_test },
    [SST_GPU_HOLE_PUSH] = { "hole_push", SST_GPU_HOLE_BUFFERS, sizeof(struct sst_gpu_hole), hole_push_reference,
                            hole_push_self_test },
    [SST_GPU_SGM_PATH] = { "sgm_path", SST_GPU_SGM_BUFFERS, sizeof(struct sst_gpu_sgm), sgm_path_reference,
                           sgm_path_self_test },
    [SST_GPU_WINNER] = { "winner", SST_GPU_WINNER_BUFFERS, sizeof(struct sst_gpu_winner), winner_reference,
                         winner_self_test },
    [SST_GPU_CENSUS] = { "census", SST_GPU_CENSUS_BUFFERS, sizeof(struct sst_gpu_census), census_reference,
                         census_self_test },
    [SST_GPU_MATCH_COST] = { "match_cost", SST_GPU_COST_BUFFERS, sizeof(struct sst_gpu_match), match_cost_reference,
                             match_cost_self_test },
    [SST_GPU_FEATURE_COST] = { "feature_cost", SST_GPU_FEATURE_BUFFERS, sizeof(struct sst_gpu_features),
                               feature_cost_reference, feature_cost_self_test },
    [SST_GPU_SUPPORT_ARMS] = { "support_arms", SST_GPU_ARMS_BUFFERS, sizeof(struct sst_gpu_arms),
                               support_arms_reference, support_arms_self_test },
    [SST_GPU_SUPPORT_SUM] = { "support_sum", SST_GPU_SUPPORT_SUM_BUFFERS, sizeof(struct sst_gpu_support),
                              support_sum_reference, support_sum_self_test },
    [SST_GPU_SUPPORT_MEAN] = { "support_mean", SST_GPU_SUPPORT_MEAN_BUFFERS, sizeof(struct sst_gpu_support),
                               support_mean_reference, support_mean_self_test },
    [SST_GPU_MEDIAN] = { "median", SST_GPU_MEDIAN_BUFFERS, sizeof(struct sst_gpu_median), median_reference,
                         median_self_test },
    [SST_GPU_BILATERAL] = { "bilateral", SST_GPU_BILATERAL_BUFFERS, sizeof(struct sst_gpu_bilateral),
                            bilateral_reference, bilateral_self_test },
    [SST_GPU_HYPOTHESIS_COST] = { "hypothesis_cost", SST_GPU_HYPOTHESIS_COST_BUFFERS,
                                  sizeof(struct sst_gpu_hypothesis_cost), hypothesis_cost_reference,
                                  hypothesis_cost_self_test },
    [SST_GPU_HYPOTHESIS_PATH] = { "hypothesis_path", SST_GPU_HYPOTHESIS_PATH_BUFFERS,
                                  sizeof(struct sst_gpu_hypothesis_path), hypothesis_path_reference,
                                  hypothesis_path_self_test },
    [SST_GPU_HYPOTHESIS_CHOICE] = { "hypothesis_choice", SST_GPU_HYPOTHESIS_CHOICE_BUFFERS,
                                    sizeof(struct sst_gpu_hypothesis_choice), hypothesis_choice_reference,
                                    hypothesis_choice_self_test },
    [SST_GPU_CHECK] = { "check", SST_GPU_CHECK_BUFFERS, sizeof(struct sst_gpu_check), check_reference,
                        check_self_test },
    [SST_GPU_FILL_START] = { "fill_start", SST_GPU_FILL_START_BUFFERS, sizeof(struct sst_gpu_fill),
                             fill_start_reference, fill_start_self_test },
    [SST_GPU_FILL_PROJECT] = { "fill_project", SST_GPU_FILL_PROJECT_BUFFERS, sizeof(struct sst_gpu_project),
                               fill_project_reference, fill_project_self_test },
    [SST_GPU_FILL_TAKE] = { "fill_take", SST_GPU_FILL_TAKE_BUFFERS, sizeof(struct sst_gpu_fill), fill_take_reference,
                            fill_take_self_test },
    [SST_GPU_FILL_ALONG] = { "fill_along", SST_GPU_BACKGROUND_BUFFERS, sizeof(struct sst_gpu_background),
                             fill_along_reference, fill_along_self_test },
    [SST_GPU_FILL_DOWN] = { "fill_down", SST_GPU_BACKGROUND_BUFFERS, sizeof(struct sst_gpu_background),
                            fill_down_reference, fill_down_self_test },
    [SST_GPU_SUBPIXEL_FIT] = { "subpixel_fit", SST_GPU_SUBPIXEL_FIT_BUFFERS, sizeof(struct sst_gpu_subpixel_fit),
                               subpixel_fit_reference, subpixel_fit_self_test },
    [SST_GPU_SUBPIXEL_WINDOW] = { "subpixel_window", SST_GPU_SUBPIXEL_WINDOW_BUFFERS,
                                  sizeof(struct sst_gpu_subpixel_window), subpixel_window_reference,
                                  subpixel_window_self_test },
    [SST_GPU_SWEEP_POINTS] = { "sweep_points", SST_GPU_SWEEP_POINTS_BUFFERS, sizeof(struct sst_gpu_sweep),
                               sweep_points_reference, sweep_points_self_test },
    [SST_GPU_SWEEP_GATHER] = { "sweep_gather", SST_GPU_SWEEP_GATHER_BUFFERS, sizeof(struct sst_gpu_sweep_gather),
                               sweep_gather_reference, sweep_gather_self_test },
    [SST_GPU_SWEEP_PEAKS] = { "sweep_peaks", SST_GPU_SWEEP_PEAKS_BUFFERS, sizeof(struct sst_gpu_sweep_peaks),
                              sweep_peaks_reference, sweep_peaks_self_test },
    [SST_GPU_SURFACE_START] = { "surface_start", SST_GPU_SURFACE_START_BUFFERS, sizeof(struct sst_gpu_surface_start),
                                surface_start_reference, surface_start_self_test },
    [SST_GPU_SURFACE_PROJECT] = { "surface_project", SST_GPU_SURFACE_PROJECT_BUFFERS,
                                  sizeof(struct sst_gpu_surface_project), surface_project_reference,
                                  surface_project_self_test },
    [SST_GPU_SURFACE_LIST] = { "surface_list", SST_GPU_SURFACE_LIST_BUFFERS, sizeof(struct sst_gpu_surface_list),
                               surface_list_reference, surface_list_self_test },
    [SST_GPU_CARRY_START] = { "carry_start", SST_GPU_CARRY_START_BUFFERS, sizeof(struct sst_gpu_carry),
                              carry_start_reference, carry_start_self_test },
    [SST_GPU_CARRY_PROJECT] = { "carry_project", SST_GPU_CARRY_PROJECT_BUFFERS, sizeof(struct sst_gpu_carry),
                                carry_project_reference, carry_project_self_test },
    [SST_GPU_CARRY_CLOSE] = { "carry_close", SST_GPU_CARRY_CLOSE_BUFFERS, sizeof(struct sst_gpu_carry),
                              carry_close_reference, carry_close_self_test },
    [SST_GPU_NET_CONV8] = { "net_conv8", SST_GPU_NET_BUFFERS, sizeof(struct sst_gpu_net_conv), net_conv8_reference,
                            net_conv8_self_test },
    [SST_GPU_NET_CONV] = { "net_conv", SST_GPU_NET_BUFFERS, sizeof(struct sst_gpu_net_conv), net_conv_reference,
                           net_conv_self_test },
    [SST_GPU_NET_MOVE] = { "net_move", SST_GPU_NET_BUFFERS, sizeof(struct sst_gpu_net_layer), net_move_reference,
                           net_move_self_test },
    [SST_GPU_NET_RESIZE] = { "net_resize", SST_GPU_NET_BUFFERS, sizeof(struct sst_gpu_net_layer), net_resize_reference,
                             net_resize_self_test },
    [SST_GPU_NET_POOL] = { "net_pool", SST_GPU_NET_BUFFERS, sizeof(struct sst_gpu_net_layer), net_pool_reference,
                           net_pool_self_test },
    [SST_GPU_NET_UNIT] = { "net_unit", SST_GPU_NET_BUFFERS, sizeof(struct sst_gpu_net_layer), net_unit_reference,
                           net_unit_self_test },
    [SST_GPU_NET_CONV8_DOT] = { "net_conv8_dot", SST_GPU_NET_BUFFERS, sizeof(struct sst_gpu_net_conv),
                                net_conv8_reference, net_conv8_dot_self_test, SST_GPU_DOT, SST_GPU_DOT_FAST,
                                SST_GPU_NET_CONV8, "dot" },
    [SST_GPU_NET_CONV8_MATRIX] = { "net_conv8_matrix", SST_GPU_NET_BUFFERS, sizeof(struct sst_gpu_net_conv),
                                   net_conv8_reference, net_conv8_matrix_self_test, SST_GPU_MATRIX, SST_GPU_MATRIX_FAST,
                                   SST_GPU_NET_CONV8, "matrix" },
    [SST_GPU_SGM_PATH_SUBGROUP] = { "sgm_path_subgroup", SST_GPU_SGM_BUFFERS, sizeof(struct sst_gpu_sgm),
                                    sgm_path_reference, sgm_path_subgroup_self_test, SST_GPU_SUBGROUP, SST_GPU_SUBGROUP,
                                    SST_GPU_SGM_PATH, "subgroup" },
    [SST_GPU_HYPOTHESIS_PATH_SUBGROUP] = { "hypothesis_path_subgroup", SST_GPU_HYPOTHESIS_PATH_BUFFERS,
                                           sizeof(struct sst_gpu_hypothesis_path), hypothesis_path_reference,
                                           hypothesis_path_subgroup_self_test, SST_GPU_SUBGROUP, SST_GPU_SUBGROUP,
                                           SST_GPU_HYPOTHESIS_PATH, "subgroup" },
    [SST_GPU_FEATURE_COST_DOT] = { "feature_cost_dot", SST_GPU_FEATURE_BUFFERS, sizeof(struct sst_gpu_features),
                                   feature_cost_reference, feature_cost_dot_self_test, SST_GPU_DOT, SST_GPU_DOT_FAST,
                                   SST_GPU_FEATURE_COST, "dot" },
    [SST_GPU_RECTIFY] = { "rectify", SST_GPU_RECTIFY_BUFFERS, sizeof(struct sst_gpu_rectify), rectify_reference,
                          rectify_self_test },
    [SST_GPU_CONVERT] = { "convert", SST_GPU_CONVERT_BUFFERS, sizeof(struct sst_gpu_convert), convert_reference,
                          convert_self_test },
    [SST_GPU_LABEL_KEEP] = { "label_keep", SST_GPU_LABEL_KEEP_BUFFERS, sizeof(struct sst_gpu_label_keep),
                             label_keep_reference, label_keep_self_test },
    [SST_GPU_LABEL_GRID] = { "label_grid", SST_GPU_LABEL_GRID_BUFFERS, sizeof(struct sst_gpu_label_grid),
                             label_grid_reference, label_grid_self_test },
    [SST_GPU_LABEL_INPUT] = { "label_input", SST_GPU_LABEL_INPUT_BUFFERS, sizeof(struct sst_gpu_label_input),
                              label_input_reference, label_input_self_test },
    [SST_GPU_JPEG_RGB] = { "jpeg_rgb", SST_GPU_JPEG_BUFFERS, sizeof(struct sst_gpu_jpeg), jpeg_rgb_reference,
                           jpeg_rgb_self_test },
    [SST_GPU_REFINE_MASK] = { "refine_mask", SST_GPU_REFINE_MASK_BUFFERS, sizeof(struct sst_gpu_refine_mask),
                              refine_mask_reference, refine_mask_self_test },
    [SST_GPU_REFINE_COLUMNS] = { "refine_columns", SST_GPU_REFINE_COLUMNS_BUFFERS,
                                 sizeof(struct sst_gpu_refine_columns), refine_columns_reference,
                                 refine_columns_self_test },
    [SST_GPU_REFINE_COMPETE] = { "refine_compete", SST_GPU_REFINE_COMPETE_BUFFERS,
                                 sizeof(struct sst_gpu_refine_compete), refine_compete_reference,
                                 refine_compete_self_test },
    [SST_GPU_REFINE_SUMS] = { "refine_sums", SST_GPU_REFINE_SUMS_BUFFERS, sizeof(struct sst_gpu_refine_window),
                              refine_sums_reference, refine_sums_self_test },
    [SST_GPU_REFINE_PLANES] = { "refine_planes", SST_GPU_REFINE_PLANES_BUFFERS, sizeof(struct sst_gpu_refine_window),
                                refine_planes_reference, refine_planes_self_test },
    [SST_GPU_REFINE_NORMALS] = { "refine_normals", SST_GPU_REFINE_NORMALS_BUFFERS,
                                 sizeof(struct sst_gpu_refine_normals), refine_normals_reference,
                                 refine_normals_self_test },
    [SST_GPU_REFINE_ASSIGN] = { "refine_assign", SST_GPU_REFINE_ASSIGN_BUFFERS, sizeof(struct sst_gpu_refine_assign),
                                refine_assign_reference, refine_assign_self_test },
    [SST_GPU_REFINE_COUNT] = { "refine_count", SST_GPU_REFINE_COUNT_BUFFERS, sizeof(struct sst_gpu_refine_count),
                               refine_count_reference, refine_count_self_test },
    [SST_GPU_REFINE_GROUND_SUMS] = { "refine_ground_sums", SST_GPU_REFINE_GROUND_SUMS_BUFFERS,
                                     sizeof(struct sst_gpu_refine_fit), refine_ground_sums_reference,
                                     refine_ground_sums_self_test },
    [SST_GPU_REFINE_GROUND_MISSES] = { "refine_ground_misses", SST_GPU_REFINE_GROUND_MISSES_BUFFERS,
                                       sizeof(struct sst_gpu_refine_fit), refine_ground_misses_reference,
                                       refine_ground_misses_self_test },
    [SST_GPU_REFINE_GROUND_LIMIT] = { "refine_ground_limit", SST_GPU_REFINE_GROUND_LIMIT_BUFFERS,
                                      sizeof(struct sst_gpu_refine_fit), refine_ground_limit_reference,
                                      refine_ground_limit_self_test },
    [SST_GPU_REFINE_EXTENTS] = { "refine_extents", SST_GPU_REFINE_EXTENTS_BUFFERS,
                                 sizeof(struct sst_gpu_refine_extents), refine_extents_reference,
                                 refine_extents_self_test },
    [SST_GPU_VOTE] = { "vote", SST_GPU_VOTE_BUFFERS, sizeof(struct sst_gpu_vote), vote_reference, vote_self_test },
    [SST_GPU_LABEL_CARRY] = { "label_carry", SST_GPU_VOTE_BUFFERS, sizeof(struct sst_gpu_label_carry),
                              label_carry_reference, label_carry_self_test },
    [SST_GPU_LABEL_FILL] = { "label_fill", SST_GPU_LABEL_FILL_BUFFERS, sizeof(struct sst_gpu_label_fill),
                             label_fill_reference, label_fill_self_test },
    [SST_GPU_LABEL_CELLS] = { "label_cells", SST_GPU_LABEL_CELLS_BUFFERS, sizeof(struct sst_gpu_label_cells),
                              label_cells_reference, label_cells_self_test },
    [SST_GPU_VERIFY_SHARE] = { "verify_share", SST_GPU_SHARE_BUFFERS, sizeof(struct sst_gpu_verify),
                               verify_share_reference, verify_share_self_test },
    [SST_GPU_VERIFY_SCREEN] = { "verify_screen", SST_GPU_SCREEN_BUFFERS, sizeof(struct sst_gpu_verify),
                                verify_screen_reference, verify_screen_self_test },
    [SST_GPU_VERIFY_UNEXPLAINED] = { "verify_unexplained", SST_GPU_UNEXPLAINED_BUFFERS, sizeof(struct sst_gpu_verify),
                                     verify_unexplained_reference, verify_unexplained_self_test },
    [SST_GPU_VERIFY_RAYS] = { "verify_rays", SST_GPU_RAYS_BUFFERS, sizeof(struct sst_gpu_verify), verify_rays_reference,
                              verify_rays_self_test },
    [SST_GPU_VERIFY_MODE] = { "verify_mode", SST_GPU_MODE_BUFFERS, sizeof(struct sst_gpu_verify), verify_mode_reference,
                              verify_mode_self_test },
    [SST_GPU_VERIFY_BLEND] = { "verify_blend", SST_GPU_MIX_BUFFERS, sizeof(struct sst_gpu_verify),
                               verify_blend_reference, verify_blend_self_test },
    [SST_GPU_LIMITS] = { "limits", GPU_LIMITS_BUFFERS, sizeof(struct gpu_limits), limits_reference, limits_self_test },
};

bool sst_gpu_is_variant(enum sst_gpu_shader shader)
{
    return gpu_shaders[shader].needs != 0;
}

bool sst_gpu_can(const struct sst_gpu_info *info, enum sst_gpu_shader shader)
{
    const uint32_t needs = gpu_shaders[shader].needs;

    return (info->abilities & needs) == needs;
}

bool sst_gpu_is_fast(const struct sst_gpu_info *info, enum sst_gpu_shader shader)
{
    return sst_gpu_is_variant(shader) && sst_gpu_can(info, shader) && info->abilities & gpu_shaders[shader].fast;
}

const char *sst_gpu_shader_name(enum sst_gpu_shader shader)
{
    return gpu_shaders[shader].name;
}

static void free_all(uint8_t *one[SST_GPU_BUFFERS], uint8_t *other[SST_GPU_BUFFERS])
{
    for (int i = 0; i < SST_GPU_BUFFERS; i++) {
        free(one[i]);
        free(other[i]);
        one[i] = other[i] = NULL;
    }
}

int gpu_run_both(struct sst_gpu *g, const struct sst_gpu_work *work, const void *const *initial, const size_t *bytes,
                 uint8_t *on_device[SST_GPU_BUFFERS], uint8_t *on_host[SST_GPU_BUFFERS])
{
    const struct gpu_shader *shader = &gpu_shaders[work->shader];
    struct sst_gpu_work run = *work;
    void *buffer[SST_GPU_BUFFERS];
    int err = 0;

    memset(run.buffer, 0, sizeof(run.buffer));
    for (int i = 0; i < SST_GPU_BUFFERS; i++)
        on_device[i] = on_host[i] = NULL;
    for (int i = 0; i < shader->buffers && !err; i++) {
        on_device[i] = malloc(bytes[i]);
        buffer[i] = on_host[i] = malloc(bytes[i]);
        err = on_device[i] && on_host[i] ? sst_gpu_buffer_create(g, &run.buffer[i], bytes[i]) : -ENOMEM;
        if (!err)
            err = sst_gpu_upload(g, run.buffer[i], 0, initial[i], bytes[i]);
        if (!err)
            memcpy(on_host[i], initial[i], bytes[i]);
    }
    if (!err)
        err = sst_gpu_dispatch(g, &run);
    for (int i = 0; i < shader->buffers && !err; i++)
        err = sst_gpu_download(g, on_device[i], run.buffer[i], 0, bytes[i]);
    for (int i = 0; i < SST_GPU_BUFFERS; i++)
        sst_gpu_buffer_destroy(g, run.buffer[i]);
    if (err)
        free_all(on_device, on_host);
    else
        shader->reference(work->push, buffer, work->groups);
    return err;
}

int gpu_compare(struct sst_gpu *g, const struct sst_gpu_work *work, const void *const *initial, const size_t *bytes,
                int out, void *keep)
{
    uint8_t *device[SST_GPU_BUFFERS], *host[SST_GPU_BUFFERS];
    int err = gpu_run_both(g, work, initial, bytes, device, host);

    if (err)
        return err;
    for (int i = 0; i < gpu_shaders[work->shader].buffers; i++)
        err = memcmp(device[i], host[i], bytes[i]) ? -ENOTSUP : err;
    if (keep)
        memcpy(keep, host[out], bytes[out]);
    free_all(device, host);
    return err;
}
