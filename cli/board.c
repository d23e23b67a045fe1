/* sst board: calibration boards to print. */
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

const struct cli_command cli_board = {
    .name = "board",
    .usage = "BOARD -o FILE.svg|FILE.png [--dpi N]",
    .summary = "draw a calibration board to print at true scale",
    .detail =
        "BOARD is as for sst calibrate:\n"
        "  charuco:9x7:50mm:0.7[:4x4_50]      squares across x down, side of a square, marker in squares,\n"
        "                                     dictionary of OpenCV\n"
        "  aprilgrid:6x6:50mm:0.3[:bottom-up] tags across x down, side of a tag, gap in tags; bottom-up as Kalibr\n"
        "                                     numbers them\n"
        "  chessboard:10x7:25mm               squares; chessboard:9x6c:25mm counts inner corners\n"
        "  or the path of a Kalibr target file\n"
        "An SVG is in millimetres; a PNG rounds edges to dots. The white margin belongs to the board.",
    .example = "sst board charuco:9x7:30mm:0.7 -o board.svg\n  sst board aprilgrid:6x6:25mm:0.3 -o grid.png --dpi 600",
    .run = run,
};
