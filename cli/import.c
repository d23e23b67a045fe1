#include <math.h>
#include <string.h>

#include "cli/cli_internal.h"

#define RECORDINGS_MAX 16

static int import_folder(const struct sst_import_config *cfg)
{
    const int err = sst_import(cfg);

    return cli_exit_code(err ? err : cli_print_lightfield(cfg->out, cfg->out));
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    const char *calib = NULL, *filter = "bicubic", *prefer = NULL;
    struct sst_import_config cfg = { .range_min_px = (double)NAN, .range_max_px = (double)NAN };
    struct import_recording recording = { .import = &cfg };
    int grid[2] = { 0, 0 };
    double infinity_px = (double)NAN;
    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &cfg.out, "LF", "light-field folder to make" },
        { "grid", 0, CLI_GRID, grid, "RxC", "rows and columns; required for folder, lets the others have holes", 1,
          256 },
        { "spacing-px", 0, CLI_DOUBLE, &cfg.spacing_px, "P", "folder: focal length times spacing, stored as provenance",
          0, 1e12 },
        { "disparity", 0, CLI_STRING, &cfg.disparity_dir, "DIR",
          "folder: external disparity rr_cc.pfm, px per spacing, inf unknown" },
        { "labels", 0, CLI_STRING, &cfg.labels_dir, "DIR", "folder: external labels rr_cc.png, 0 unlabeled" },
        { "prefer", 0, CLI_STRING, &prefer, "KIND",
          "folder: jpeg (default) or raw: which files of views that have both; raw ones are developed",
          0, 0, "jpeg raw" },
        { "sets", 0, CLI_STRING, &recording.sets, "LIST",
          "recording: 0,5-9, first, last or all; more than one: LF/set-NNNNNN each" },
        { "allow-partial", 0, CLI_FLAG, &recording.allow_partial, NULL,
          "recording: sets may lack views; the light field then has holes" },
        { "range-min", 0, CLI_DOUBLE, &cfg.range_min_px, "D", "smallest disparity in the scene, px per spacing", -32768,
          32768 },
        { "range-max", 0, CLI_DOUBLE, &cfg.range_max_px, "D", "largest disparity in the scene", -32768, 32768 },
        { "infinity-px", 0, CLI_DOUBLE, &infinity_px, "D",
          "disparity of infinity; 0: parallel views, below 0: they converge", -32768, 32768 },
        { "calib", 0, CLI_STRING, &calib, "FILE",
          "recording, folder: the array's calibration; views are then rectified" },
        { "filter", 0, CLI_STRING, &filter, "F", "filter of --calib: bilinear, bicubic (default) or lanczos", 0, 0,
          "bilinear bicubic lanczos" },
        { "threads", 0, CLI_INT, &cfg.threads, "N", "threads (default: all processors)", 1, 256 },
        { "force", 'f', CLI_FLAG, &cfg.force, NULL, "replace an existing light field" },
    };
    struct sst_use_calibration use;
    const char *args[1 + RECORDINGS_MAX] = { NULL };
    int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, args, 2, 1 + RECORDINGS_MAX);

    if (r != CLI_GO_ON)
        return r;
    if (!cfg.out)
        return cli_usage_error(cmd, "-o LF is missing");
    if (isnan(cfg.range_min_px) != isnan(cfg.range_max_px))
        return cli_usage_error(cmd, "--range-min and --range-max must be given together");
    if (isnan(cfg.range_min_px))
        cfg.range_min_px = cfg.range_max_px = 0;
    if (strcmp(args[0], "recording") && args[2])
        return cli_usage_error(cmd, "one source at a time: %s; only recordings of several hosts are joined", args[2]);
    if (!strcmp(args[0], "recording") && (grid[0] || cfg.spacing_px > 0 || cfg.disparity_dir || cfg.labels_dir || !isnan(infinity_px)))
        return cli_usage_error(cmd, "--grid, --spacing-px, --disparity, --labels and --infinity-px do not apply to a "
                                    "recording, which has its own grid and spacing");
    if (strcmp(args[0], "recording") && (recording.sets || recording.allow_partial))
        return cli_usage_error(cmd, "--sets and --allow-partial belong to the format recording, not to %s", args[0]);
    if (!isnan(infinity_px))
        cfg.infinity_px = &infinity_px;
    if (prefer && (strcmp(args[0], "folder") || (strcmp(prefer, "jpeg") && strcmp(prefer, "raw"))))
        return cli_usage_error(cmd, "--prefer is jpeg or raw, of the format folder");
    cfg.prefer_raw = prefer && !strcmp(prefer, "raw");
    sst_use_calibration_defaults(&use);
    if (calib) {
        r = cli_use_calibration(&use, cmd, calib, filter);
        if (r != CLI_GO_ON)
            return r;
        cfg.calibration = &use;
    }
    cfg.format = args[0];
    cfg.source = args[1];
    recording.dirs = args + 1;
    while (recording.count < RECORDINGS_MAX && args[1 + recording.count])
        recording.count++;
    cfg.rows = grid[0];
    cfg.cols = grid[1];
    r = strcmp(cfg.format, "recording") ? import_folder(&cfg) : cli_run_import_recording(cmd, &recording);
    sst_use_calibration_fini(&use);
    return r;
}

const struct cli_command cli_import = { "import", run };
