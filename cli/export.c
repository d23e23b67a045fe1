/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <math.h>
#include <string.h>

#include "pipeline/posed/export.h"
#include "pipeline/posed/posed.h"

/* One file, of light fields of both kinds. */
static int run_npz(const struct cli_command *cmd, const struct sst_export_config *cfg)
{
    const bool posed = sst_posed_is(cfg->dir);
    int err;

    if (cfg->focal_px > 0 || cfg->spacing_mm > 0 || cfg->focus_mm > 0 || cfg->infinity_px || cfg->lossy)
        return cli_usage_error(cmd, "npz has what the light field knows; --focal-px, --spacing-mm, --focus-mm, --infinity-px and "
                                    "--lossy belong to other formats");
    if (posed && cfg->maps)
        return cli_usage_error(cmd, "--maps: a light field with a pose for every view has no maps");
    err = sst_path_check_file(cfg->out, cfg->force);
    err = err ? err : posed ? sst_posed_export_npz(cfg) : sst_export_npz(cfg);
    if (err)
        return cli_exit_code(err);
    return posed ? cli_report_posed(cfg->dir, cfg->out, false) : cli_exit_code(cli_print_lightfield(cfg->dir, cfg->out));
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_export_config cfg = { 0 };
    const char *args[2];
    double infinity_px = (double)NAN;
    int err;
    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &cfg.out, "DST", "folder to make; npz: file" },
        { "focal-px", 0, CLI_DOUBLE, &cfg.focal_px, "F", "focal length if LF has none", 1e-3, 1e7 },
        { "spacing-mm", 0, CLI_DOUBLE, &cfg.spacing_mm, "B", "camera spacing if LF has none", 1e-6, 1e6 },
        { "focus-mm", 0, CLI_DOUBLE, &cfg.focus_mm, "Z",
          "distance at which the views converge (disparity 0) if LF has none; inf: parallel", 1e-3, (double)INFINITY },
        { "infinity-px", 0, CLI_DOUBLE, &infinity_px, "D",
          "instead: disparity of infinity; 0: parallel, below 0: converging", -32768, 32768 },
        { "lossy", 0, CLI_FLAG, &cfg.lossy, NULL, "nerfstudio: accept lenses that its model misses by over 0.05 px" },
        { "maps", 0, CLI_FLAG, &cfg.maps, NULL, "npz: maps and cameras alone, without views" },
        { "threads", 0, CLI_INT, &cfg.threads, "N", "threads (default: all processors)", 1, 256 },
        { "force", 'f', CLI_FLAG, &cfg.force, NULL, "replace an earlier export" },
    };
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, args, 2, 2);

    if (r != CLI_GO_ON)
        return r;
    if (!cfg.out)
        return cli_usage_error(cmd, "-o DST is missing");
    if (!isnan(infinity_px) && cfg.focus_mm > 0)
        return cli_usage_error(cmd, "--focus-mm and --infinity-px say the same; give one");
    if (!isnan(infinity_px))
        cfg.infinity_px = &infinity_px;
    cfg.format = args[0];
    cfg.dir = args[1];
    if (!strcmp(cfg.format, "npz"))
        return run_npz(cmd, &cfg);
    if (cfg.maps)
        return cli_usage_error(cmd, "--maps belongs to npz");
    if (sst_posed_is(cfg.dir)) {
        err = sst_posed_export(&cfg);
        return err ? cli_exit_code(err) : cli_report_posed(cfg.dir, cfg.out, false);
    }
    err = sst_export(&cfg);
    return cli_exit_code(err ? err : cli_print_lightfield(cfg.dir, cfg.out));
}

const struct cli_command cli_export = { "export", run };
