/* sst import poses, sst import pictures: light fields with a pose for every view. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/posed/import/import.h"

/* "SCALE,OFFSET" */
static int parse_kelvin(struct sst_posed_import_config *cfg, const struct cli_command *cmd, const char *text)
{
    char *end;

    cfg->kelvin_scale = strtod(text, &end);
    if (end != text && *end == ',') {
        const char *offset = end + 1;

        cfg->kelvin_offset = strtod(offset, &end);
        if (end != offset && !*end && cfg->kelvin_scale > 0 && cfg->kelvin_scale <= 1e6 && cfg->kelvin_offset >= -1e6 &&
            cfg->kelvin_offset <= 1e6)
            return CLI_GO_ON;
    }
    return cli_usage_error(cmd, "--kelvin %s is not SCALE,OFFSET such as 0.04,0: kelvin = level x SCALE + OFFSET", text);
}

int cli_import_posed(const struct cli_command *cmd, const struct cli_import_posed *args)
{
    struct sst_posed_import_config cfg = args->cfg;
    const bool pictures = !strcmp(args->format, "pictures");
    int r = args->kelvin ? parse_kelvin(&cfg, cmd, args->kelvin) : CLI_GO_ON;

    if (r != CLI_GO_ON)
        return r;
    if (pictures && (cfg.pictures || args->unit))
        return cli_usage_error(cmd, "--pictures and --unit belong to the format poses, not to pictures");
    cfg.unit_mm = args->unit == 1 ? 1 : args->unit == 2 ? 1000 : 0;
    r = pictures ? sst_posed_import_pictures(&cfg) : sst_posed_import(&cfg);
    return r ? cli_exit_code(r) : cli_report_posed(cfg.out, cfg.out, args->json);
}
