/* pipeline/gpu/shader_list.h - shaders, pipeline/kernels/<name>.comp, in one list for the enumeration, the declarations
 * and the table.
 *
 * X(NAME, name, buffers, structure of constants); buffers and structures: the headers of this folder.
 */
#ifndef SST_PIPELINE_GPU_SHADER_LIST_H
#define SST_PIPELINE_GPU_SHADER_LIST_H

#define SST_GPU_SHADER_LIST(X)                                                                                         \
    X(BLEND, blend, SST_GPU_BLEND_BUFFERS, sst_gpu_blend)                                                              \
    X(RECTIFY, rectify, SST_GPU_RECTIFY_BUFFERS, sst_gpu_rectify)                                                      \
    X(JPEG_RGB, jpeg_rgb, SST_GPU_JPEG_BUFFERS, sst_gpu_jpeg)                                                          \
    X(VERIFY_SHARE, verify_share, SST_GPU_SHARE_BUFFERS, sst_gpu_verify)                                               \
    X(VERIFY_SCREEN, verify_screen, SST_GPU_SCREEN_BUFFERS, sst_gpu_verify)                                            \
    X(VERIFY_UNEXPLAINED, verify_unexplained, SST_GPU_UNEXPLAINED_BUFFERS, sst_gpu_verify)                             \
    X(VERIFY_RAYS, verify_rays, SST_GPU_RAYS_BUFFERS, sst_gpu_verify)                                                  \
    X(VERIFY_MODE, verify_mode, SST_GPU_MODE_BUFFERS, sst_gpu_verify)                                                  \
    X(VERIFY_BLEND, verify_blend, SST_GPU_MIX_BUFFERS, sst_gpu_verify)                                                 \
    X(CLEAR_LAND, clear_land, SST_GPU_LAND_BUFFERS, sst_gpu_clear)                                                     \
    X(CLEAR_BLEND, clear_blend, SST_GPU_CLEAR_BUFFERS, sst_gpu_clear)                                                  \
    X(CLEAR_SURFACE, clear_surface, SST_GPU_SURFACE_BUFFERS, sst_gpu_clear)                                            \
    X(CLEAR_SAMPLE, clear_sample, SST_GPU_SAMPLE_BUFFERS, sst_gpu_clear_sample)                                        \
    X(HOLE_PULL, hole_pull, SST_GPU_HOLE_BUFFERS, sst_gpu_hole)                                                        \
    X(HOLE_PUSH, hole_push, SST_GPU_HOLE_BUFFERS, sst_gpu_hole)                                                        \
    X(CENSUS, census, SST_GPU_CENSUS_BUFFERS, sst_gpu_census)                                                          \
    X(MATCH_COST, match_cost, SST_GPU_COST_BUFFERS, sst_gpu_match)                                                     \
    X(FEATURE_COST, feature_cost, SST_GPU_FEATURE_BUFFERS, sst_gpu_features)                                           \
    X(SUPPORT_ARMS, support_arms, SST_GPU_ARMS_BUFFERS, sst_gpu_arms)                                                  \
    X(SUPPORT_SUM, support_sum, SST_GPU_SUPPORT_SUM_BUFFERS, sst_gpu_support)                                          \
    X(SUPPORT_MEAN, support_mean, SST_GPU_SUPPORT_MEAN_BUFFERS, sst_gpu_support)                                       \
    X(SGM_PATH, sgm_path, SST_GPU_SGM_BUFFERS, sst_gpu_sgm)                                                            \
    X(WINNER, winner, SST_GPU_WINNER_BUFFERS, sst_gpu_winner)                                                          \
    X(MEDIAN, median, SST_GPU_MEDIAN_BUFFERS, sst_gpu_median)                                                          \
    X(BILATERAL, bilateral, SST_GPU_BILATERAL_BUFFERS, sst_gpu_bilateral)                                              \
    X(HYPOTHESIS_COST, hypothesis_cost, SST_GPU_HYPOTHESIS_COST_BUFFERS, sst_gpu_hypothesis_cost)                      \
    X(HYPOTHESIS_PATH, hypothesis_path, SST_GPU_HYPOTHESIS_PATH_BUFFERS, sst_gpu_hypothesis_path)                      \
    X(HYPOTHESIS_CHOICE, hypothesis_choice, SST_GPU_HYPOTHESIS_CHOICE_BUFFERS, sst_gpu_hypothesis_choice)              \
    X(CONVERT, convert, SST_GPU_CONVERT_BUFFERS, sst_gpu_convert)                                                      \
    X(CHECK, check, SST_GPU_CHECK_BUFFERS, sst_gpu_check)                                                              \
    X(FILL_START, fill_start, SST_GPU_FILL_START_BUFFERS, sst_gpu_fill)                                                \
    X(FILL_PROJECT, fill_project, SST_GPU_FILL_PROJECT_BUFFERS, sst_gpu_project)                                       \
    X(FILL_TAKE, fill_take, SST_GPU_FILL_TAKE_BUFFERS, sst_gpu_fill)                                                   \
    X(FILL_ALONG, fill_along, SST_GPU_BACKGROUND_BUFFERS, sst_gpu_background)                                          \
    X(FILL_DOWN, fill_down, SST_GPU_BACKGROUND_BUFFERS, sst_gpu_background)                                            \
    X(CARRY_PROJECT, carry_project, SST_GPU_CARRY_PROJECT_BUFFERS, sst_gpu_carry)                                      \
    X(CARRY_CLOSE, carry_close, SST_GPU_CARRY_CLOSE_BUFFERS, sst_gpu_carry)                                            \
    X(SUBPIXEL_FIT, subpixel_fit, SST_GPU_SUBPIXEL_FIT_BUFFERS, sst_gpu_subpixel_fit)                                  \
    X(SUBPIXEL_WINDOW, subpixel_window, SST_GPU_SUBPIXEL_WINDOW_BUFFERS, sst_gpu_subpixel_window)                      \
    X(NET_CONV8, net_conv8, SST_GPU_NET_BUFFERS, sst_gpu_net_conv)                                                     \
    X(NET_CONV, net_conv, SST_GPU_NET_BUFFERS, sst_gpu_net_conv)                                                       \
    X(NET_MOVE, net_move, SST_GPU_NET_BUFFERS, sst_gpu_net_layer)                                                      \
    X(NET_RESIZE, net_resize, SST_GPU_NET_BUFFERS, sst_gpu_net_layer)                                                  \
    X(NET_POOL, net_pool, SST_GPU_NET_BUFFERS, sst_gpu_net_layer)                                                      \
    X(NET_UNIT, net_unit, SST_GPU_NET_BUFFERS, sst_gpu_net_layer)                                                      \
    X(LIMITS, limits, GPU_LIMITS_BUFFERS, gpu_limits)                                                                  \
    X(SWEEP_POINTS, sweep_points, SST_GPU_SWEEP_POINTS_BUFFERS, sst_gpu_sweep)                                         \
    X(SWEEP_GATHER, sweep_gather, SST_GPU_SWEEP_GATHER_BUFFERS, sst_gpu_sweep_gather)                                  \
    X(SWEEP_PEAKS, sweep_peaks, SST_GPU_SWEEP_PEAKS_BUFFERS, sst_gpu_sweep_peaks)                                      \
    X(SURFACE_ROWS, surface_rows, SST_GPU_SURFACE_ROWS_BUFFERS, sst_gpu_surface_rows)                                  \
    X(SURFACE_PROJECT, surface_project, SST_GPU_SURFACE_PROJECT_BUFFERS, sst_gpu_surface_project)                      \
    X(SURFACE_LIST, surface_list, SST_GPU_SURFACE_LIST_BUFFERS, sst_gpu_surface_list)

/** Variants: X(NAME, name, NAME and name of the shader that it is a variant of, word of SST_GPU_VARIANT, abilities that
 * it needs, abilities with which it is chosen, buffers, structure of constants); the fastest last. The step is compared
 * with the CPU once more for each variant (sst_run_fastest()). */
#define SST_GPU_VARIANT_LIST(X)                                                                                        \
    X(NET_CONV8_DOT, net_conv8_dot, NET_CONV8, net_conv8, "dot", SST_GPU_DOT, SST_GPU_DOT_FAST, SST_GPU_NET_BUFFERS,   \
      sst_gpu_net_conv)                                                                                                \
    X(NET_CONV8_MATRIX, net_conv8_matrix, NET_CONV8, net_conv8, "matrix", SST_GPU_MATRIX, SST_GPU_MATRIX_FAST,         \
      SST_GPU_NET_BUFFERS, sst_gpu_net_conv)                                                                           \
    X(SGM_PATH_SUBGROUP, sgm_path_subgroup, SGM_PATH, sgm_path, "subgroup", SST_GPU_SUBGROUP, SST_GPU_SUBGROUP,        \
      SST_GPU_SGM_BUFFERS, sst_gpu_sgm)                                                                                \
    X(HYPOTHESIS_PATH_SUBGROUP, hypothesis_path_subgroup, HYPOTHESIS_PATH, hypothesis_path, "subgroup",                \
      SST_GPU_SUBGROUP, SST_GPU_SUBGROUP, SST_GPU_HYPOTHESIS_PATH_BUFFERS, sst_gpu_hypothesis_path)                    \
    X(FEATURE_COST_DOT, feature_cost_dot, FEATURE_COST, feature_cost, "dot", SST_GPU_DOT, SST_GPU_DOT_FAST,            \
      SST_GPU_FEATURE_BUFFERS, sst_gpu_features)

#endif
