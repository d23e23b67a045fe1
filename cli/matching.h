/* cli/matching.h - the matching options that `sst stereo` and `sst process` share. */
#ifndef SST_CLI_MATCHING_H
#define SST_CLI_MATCHING_H

#include "cli/cli.h"
#include "cli/precision.h"
#include "pipeline/method/disparity/disparity.h"

/** What the user said; unset numbers keep the preset's values. */
struct cli_matching {
    const char *preset, *cost, *model, *precision;
    int paths, p1, p2, scale, threads;
    bool no_fill, pairs;
};

#define CLI_MATCHING_DEFAULTS                                                                                          \
    {                                                                                                                  \
        .preset = "balanced", .paths = -1, .p1 = -1, .p2 = -1, .scale = -1                                             \
    }

/* Rows of an option table for a struct cli_matching m. */
#define CLI_MATCHING_OPTIONS(m)                                                                                        \
    { "preset", 'p', CLI_STRING, &(m).preset, "NAME", "preview, balanced (default) or accurate", 0, 0 },               \
        { "cost", 0, CLI_STRING, &(m).cost, "NAME", "matching cost: census, mccnn or both", 0, 0 },                    \
        { "mccnn-model", 0, CLI_STRING, &(m).model, "NAME", "features network of the mccnn cost", 0, 0 },              \
        { "precision", 0, CLI_STRING, &(m).precision, "NAME", CLI_PRECISION_HELP, 0, 0 },                              \
        { "paths", 0, CLI_INT, &(m).paths, "N", "directions of the optimisation: 4 or 8", 4, 8 },                      \
        { "p1", 0, CLI_INT, &(m).p1, "N", "penalty of a disparity step of 1 px", 1, SST_DISPARITY_MAX_PENALTY },       \
        { "p2", 0, CLI_INT, &(m).p2, "N", "penalty of a larger step", 1, SST_DISPARITY_MAX_PENALTY },                  \
        { "scale", 0, CLI_INT, &(m).scale, "N", "match at full (1) or half size (2)", 1, 2 },                          \
        { "pairs", 0, CLI_FLAG, &(m).pairs, NULL, "match horizontal and vertical neighbours apart and fuse the maps",  \
          0,       0 },                                                                                                \
        { "no-fill", 0, CLI_FLAG, &(m).no_fill, NULL, "skip the multi-view check and filling", 0, 0 },                 \
    {                                                                                                                  \
        "threads", 't', CLI_INT, &(m).threads, "N", "threads; default: all processors", 1, 256                         \
    }

/**
 * The configuration that the options ask for; the range is left to the caller.
 * @param model_path  storage of the default network's path
 * @return 0 or a negative errno, logged
 */
SST_MUST_CHECK int cli_matching_config(struct sst_disparity_config *cfg, const struct cli_matching *m,
                                       char model_path[SST_PATH_MAX]);

#endif
