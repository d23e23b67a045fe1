#include <stdio.h>

#include "cli/cli.h"
#include "cli/lightfield_line.h"
#include "pipeline/lightfield/import.h"

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    const char *out = NULL, *args[2];
    bool force = false;
    int threads = 0, err;
    const struct cli_option options[] = {
        { "output", 'o', CLI_STRING, &out, "DST", "folder to make", 0, 0 },
        { "threads", 0, CLI_INT, &threads, "N", "threads (default: all processors)", 1, 256 },
        { "force", 'f', CLI_FLAG, &force, NULL, "replace an earlier export", 0, 0 },
    };
    struct sst_lightfield lf;
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, args, 2, 2);

    if (r != CLI_GO_ON)
        return r;
    if (!out)
        return cli_usage_error(cmd, "-o DST is missing");
    err = sst_export(args[0], args[1], out, force, threads);
    if (!err)
        err = sst_lightfield_load(&lf, args[1], 0, 1);
    if (err)
        return cli_exit_code(err);
    cli_print_lightfield(&lf, out);
    sst_lightfield_fini(&lf);
    return CLI_OK;
}

const struct cli_command cli_export = {
    .name = "export",
    .usage = "FORMAT LF -o DST [options]",
    .summary = "write a light field in another format",
    .detail = "formats:\n"
              "  stanford  out_rr_cc_y_x_.png with the positions of the cameras, and positions.cfg\n"
              "  hci       input_CamNNN.png, parameters.cfg and the disparity of each view as PFM",
    .example = "sst export hci scene.lf -o scene-hci",
    .run = run,
};
