/* sst board: calibration boards to print. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>

#include "base/text.h"
#include "cli/cli_internal.h"
#include "pipeline/calibration/board/print.h"

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    const char *text, *out = NULL;
    struct sst_print print = { 0 };
    struct sst_board board;
    double dpi = 300;
    char name[128];
    int err, r;

    const struct cli_option options[] = {
        { "output", 'o', CLI_FILE, &out, "FILE", "picture to write: .svg or .png" },
        { "dpi", 0, CLI_DOUBLE, &dpi, "N", "dots per inch of a PNG; 300", 10, 2400 },
    };

    r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, &text, 1, 1);
    if (r != CLI_GO_ON)
        return r;
    if (!out || (!sst_text_ends(out, ".svg") && !sst_text_ends(out, ".png")))
        return cli_usage_error(cmd, "-o FILE is missing: -o board.svg or -o board.png");
    err = sst_board_parse(&board, text);
    if (err)
        return err == -EINVAL ? CLI_USAGE : cli_exit_code(err);
    sst_board_format(&board, name);
    err = sst_print_board(&print, &board);
    if (!err)
        err =
            sst_text_ends(out, ".svg") ? sst_print_write_svg(&print, name, out) : sst_print_write_png(&print, dpi, out);
    if (!err)
        printf("%s: %s, %.4g x %.4g mm with its margin; print at 100 %%, then measure a %s: it must be %.4g mm\n", out,
               name, print.width_mm, print.height_mm, board.kind == SST_BOARD_APRILGRID ? "tag" : "square",
               board.square_mm);
    sst_print_fini(&print);
    return cli_exit_code(err);
}

const struct cli_command cli_board = { "board", run };
