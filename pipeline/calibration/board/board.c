/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/calibration/board/board.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "base/yaml.h"

#define SQUARES_MAX    100 /* along a side */
#define POINTS_MAX     10000
#define SIZE_MIN_MM    0.1
#define SIZE_MAX_MM    10000.0
#define YAML_MAX_BYTES 65536
#define APRIL_36H11    20
#define FORMS                                                                                                          \
    "boards are chessboard:10x7:25mm (squares; 9x6c counts inner corners), charuco:9x7:50mm:0.7[:4x4_50] (marker in "  \
    "squares), aprilgrid:6x6:50mm:0.3[:bottom-up] (gap in tags) or a Kalibr target file"

/* Indexed by OpenCV's dictionary number. */
static const struct {
    const char *name;
    int markers;
} dictionaries[] = {
    { "4x4_50", 50 },          { "4x4_100", 100 },      { "4x4_250", 250 },      { "4x4_1000", 1000 },
    { "5x5_50", 50 },          { "5x5_100", 100 },      { "5x5_250", 250 },      { "5x5_1000", 1000 },
    { "6x6_50", 50 },          { "6x6_100", 100 },      { "6x6_250", 250 },      { "6x6_1000", 1000 },
    { "7x7_50", 50 },          { "7x7_100", 100 },      { "7x7_250", 250 },      { "7x7_1000", 1000 },
    { "original", 1024 },      { "apriltag_16h5", 30 }, { "apriltag_25h9", 35 }, { "apriltag_36h10", 2320 },
    { "apriltag_36h11", 587 },
};

const char *sst_board_dictionary_name(int dictionary, int *markers)
{
    if (dictionary < 0 || dictionary >= (int)ARRAY_LEN(dictionaries))
        return NULL;
    if (markers)
        *markers = dictionaries[dictionary].markers;
    return dictionaries[dictionary].name;
}

int sst_board_dictionary(const struct sst_board *b, int *border)
{
    if (border)
        *border = b->kind == SST_BOARD_APRILGRID ? 2 : 1;
    return b->kind == SST_BOARD_APRILGRID ? APRIL_36H11 : b->dictionary;
}

/* --- points ------------------------------------------------------------------------------------------------------ */

int sst_board_points(const struct sst_board *b)
{
    return b->kind == SST_BOARD_APRILGRID ? 4 * b->cols * b->rows : (b->cols - 1) * (b->rows - 1);
}

void sst_board_point(const struct sst_board *b, int id, double out[2])
{
    if (b->kind == SST_BOARD_APRILGRID) {
        const int tag = id / 4, corner = id % 4;

        out[0] = b->square_mm * (tag % b->cols * (1 + b->marker) + (corner == 1 || corner == 2));
        out[1] = b->square_mm * (tag / b->cols * (1 + b->marker) + (corner >= 2));
    } else {
        out[0] = b->square_mm * (id % (b->cols - 1));
        out[1] = b->square_mm * (id / (b->cols - 1));
    }
}

double sst_board_pitch_mm(const struct sst_board *b)
{
    return b->kind == SST_BOARD_APRILGRID ? b->square_mm * fmin(b->marker, 1) : b->square_mm;
}

static void marker_at(struct sst_board_marker *m, double x, double y, double side, int turn)
{
    for (int k = 0; k < 4; k++) {
        const int at = (k + turn) % 4;

        m->corner[k][0] = x + side * (at == 1 || at == 2);
        m->corner[k][1] = y + side * (at >= 2);
    }
}

int sst_board_markers(struct sst_board_marker *out, const struct sst_board *b, bool other)
{
    const bool grid = b->kind == SST_BOARD_APRILGRID;
    const bool white_first = other && b->rows % 2 == 0;
    const double side = b->marker * b->square_mm, pitch = (1 + b->marker) * b->square_mm;
    int n = 0;

    for (int row = 0; row < b->rows && b->kind != SST_BOARD_CHESSBOARD; row++) {
        for (int col = 0; col < b->cols; col++) {
            if (!grid && ((row + col) % 2 == 0) != white_first)
                continue; /* black */
            if (out && grid) {
                out[n].number = b->bottom_up ? (b->rows - 1 - row) * b->cols + col : n;
                marker_at(&out[n], col * pitch, row * pitch, b->square_mm, b->bottom_up != other ? 2 : 0);
            } else if (out) {
                out[n].number = n;
                marker_at(&out[n], (col - 0.5) * b->square_mm - side / 2, (row - 0.5) * b->square_mm - side / 2, side,
                          0);
            }
            n++;
        }
    }
    return n;
}

/* --- text -------------------------------------------------------------------------------------------------------- */

static const char *board_fault(const struct sst_board *b)
{
    const bool chess = b->kind == SST_BOARD_CHESSBOARD, grid = b->kind == SST_BOARD_APRILGRID;
    const int least = chess ? 4 : grid ? 1 : 3;
    int markers = 0;

    if (b->cols < least || b->rows < least || b->cols > SQUARES_MAX || b->rows > SQUARES_MAX)
        return chess  ? "a chessboard has 4 to 100 squares along each side"
               : grid ? "an AprilGrid has 1 to 100 tags along each side"
                      : "a ChArUco board has 3 to 100 squares along each side";
    if (sst_board_points(b) < 8 && grid)
        return "an AprilGrid has at least 2 tags";
    if (sst_board_points(b) > POINTS_MAX)
        return "a board has at most 10000 points";
    if (!(b->square_mm >= SIZE_MIN_MM) || !(b->square_mm <= SIZE_MAX_MM))
        return "the size is not between 0.1 mm and 10 m";
    if (grid && !(b->marker >= 0.05 && b->marker <= 1))
        return "the gap between tags is not between 0.05 and 1 of a tag";
    if (b->kind == SST_BOARD_CHARUCO && !(b->marker >= 0.3 && b->marker <= 0.95))
        return "the markers are not between 0.3 and 0.95 of a square";
    if (!sst_board_dictionary_name(sst_board_dictionary(b, NULL), &markers))
        return "the dictionary is unknown";
    if (sst_board_markers(NULL, b, false) > markers || sst_board_markers(NULL, b, true) > markers)
        return "the dictionary has fewer markers than the board";
    return NULL;
}

/* "50mm", "5cm", "0.05m" to mm. */
static bool read_size(const char *text, double *mm)
{
    static const struct {
        const char *name;
        double mm;
    } units[] = { { "mm", 1 }, { "cm", 10 }, { "m", 1000 } };
    char *end;
    const double value = strtod(text, &end);

    for (size_t i = 0; i < ARRAY_LEN(units) && end > text && isfinite(value); i++) {
        if (!strcmp(end, units[i].name)) {
            *mm = value * units[i].mm;
            return true;
        }
    }
    return false;
}

static bool read_number(const char *text, double *out)
{
    char *end;

    *out = strtod(text, &end);
    return end > text && !*end && isfinite(*out);
}

/* "10x7", or for chessboards "9x6c": inner corners. */
static bool read_squares(struct sst_board *b, const char *text)
{
    int end = 0, corners = 0;

    if (!isdigit((unsigned char)*text) || strlen(text) > 9 || sscanf(text, "%4dx%n", &b->cols, &end) != 1 || !end ||
        !isdigit((unsigned char)text[end]))
        return false;
    text += end;
    end = 0;
    if (sscanf(text, "%4d%n", &b->rows, &end) != 1)
        return false;
    corners = b->kind == SST_BOARD_CHESSBOARD && text[end] == 'c';
    b->cols += corners;
    b->rows += corners;
    return !text[end + corners];
}

static bool read_last(struct sst_board *b, const char *text)
{
    if (b->kind == SST_BOARD_APRILGRID) {
        b->bottom_up = !strcmp(text, "bottom-up");
        return b->bottom_up;
    }
    for (size_t i = 0; i < ARRAY_LEN(dictionaries); i++) {
        if (!strcasecmp(text, dictionaries[i].name)) {
            b->dictionary = (int)i;
            return true;
        }
    }
    return false;
}

/* Parse the text. @return its fault, or NULL */
static const char *read_text(struct sst_board *b, const char *text)
{
    char copy[128], *part[5] = { NULL }, *rest = copy;
    int n = 0;

    if (strlen(text) >= sizeof(copy))
        return "it is too long";
    strcpy(copy, text);
    while (rest && n < 5)
        part[n++] = strsep(&rest, ":");
    b->kind = !strcmp(part[0], "chessboard")  ? SST_BOARD_CHESSBOARD
              : !strcmp(part[0], "charuco")   ? SST_BOARD_CHARUCO
              : !strcmp(part[0], "aprilgrid") ? SST_BOARD_APRILGRID
                                              : 0;
    if (!b->kind)
        return "its kind of board is unknown";
    if (rest || n < (b->kind == SST_BOARD_CHESSBOARD ? 3 : 4) || (n > 3 && b->kind == SST_BOARD_CHESSBOARD))
        return "it has too few or too many parts";
    if (!read_squares(b, part[1]))
        return "its second part is not COLUMNSxROWS";
    if (!read_size(part[2], &b->square_mm))
        return "its third part is not a length such as 50mm";
    if (n > 3 && !read_number(part[3], &b->marker))
        return "its fourth part is not a number";
    if (n > 4 && !read_last(b, part[4]))
        return b->kind == SST_BOARD_CHARUCO ? "its last part is not a dictionary such as 4x4_50, 5x5_100 or "
                                              "apriltag_36h11"
                                            : "its last part is not bottom-up";
    return board_fault(b);
}

/* --- Kalibr's target files --------------------------------------------------------------------------------------- */

static void read_grid(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_board *b)
{
    struct sst_yaml_node *offset = sst_yaml_get(root, "codeOffset");
    double size_m = 0;
    int first = 0;

    sst_yaml_int(doc, sst_yaml_need(doc, root, "tagCols"), 1, SQUARES_MAX, &b->cols);
    sst_yaml_int(doc, sst_yaml_need(doc, root, "tagRows"), 1, SQUARES_MAX, &b->rows);
    sst_yaml_double(doc, sst_yaml_need(doc, root, "tagSize"), SIZE_MIN_MM / 1000, SIZE_MAX_MM / 1000, &size_m);
    sst_yaml_double(doc, sst_yaml_need(doc, root, "tagSpacing"), 0.05, 1, &b->marker);
    if (sst_yaml_int(doc, offset, 0, INT32_MAX, &first) && first != 0)
        sst_yaml_fault(doc, offset, "is %d; boards here begin with tag 0, so print one with codeOffset 0", first);
    b->square_mm = size_m * 1000;
    b->bottom_up = true;
}

static void read_chessboard(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_board *b)
{
    struct sst_yaml_node *down = sst_yaml_need(doc, root, "rowSpacingMeters");
    double size_m = 0, down_m = 0;

    if (sst_yaml_int(doc, sst_yaml_need(doc, root, "targetCols"), 3, SQUARES_MAX - 1, &b->cols))
        b->cols++; /* from inner corners */
    if (sst_yaml_int(doc, sst_yaml_need(doc, root, "targetRows"), 3, SQUARES_MAX - 1, &b->rows))
        b->rows++;
    sst_yaml_double(doc, sst_yaml_need(doc, root, "colSpacingMeters"), SIZE_MIN_MM / 1000, SIZE_MAX_MM / 1000, &size_m);
    if (sst_yaml_double(doc, down, SIZE_MIN_MM / 1000, SIZE_MAX_MM / 1000, &down_m) && down_m != size_m)
        sst_yaml_fault(doc, down, "differs from colSpacingMeters; squares must be square");
    b->square_mm = size_m * 1000;
}

static int read_kalibr(struct sst_board *b, const char *path)
{
    static const char *const kinds[] = { "aprilgrid", "checkerboard" };
    struct sst_yaml_node *root;
    struct sst_yaml *doc = NULL;
    uint8_t *text = NULL;
    size_t size;
    int kind = -1, err = sst_file_read_text(path, YAML_MAX_BYTES, &text, &size);

    err = err ? err : sst_yaml_parse_foreign(&doc, (const char *)text, size, path);
    free(text);
    if (err)
        return err;
    root = sst_yaml_root(doc);
    if (sst_yaml_choice(doc, sst_yaml_need(doc, root, "target_type"), kinds, ARRAY_LEN(kinds), &kind)) {
        b->kind = kind ? SST_BOARD_CHESSBOARD : SST_BOARD_APRILGRID;
        if (kind)
            read_chessboard(doc, root, b);
        else
            read_grid(doc, root, b);
    } else if (root) {
        for (struct sst_yaml_node *n = root->first; n; n = n->next)
            n->known = true; /* the set of known keys depends on the kind */
    }
    err = sst_yaml_finish(doc);
    sst_yaml_destroy(doc);
    if (!err && board_fault(b)) {
        sst_log_error("%s: %s; correct the target", path, board_fault(b));
        err = -EBADMSG;
    }
    return err;
}

/* --- parse and format -------------------------------------------------------------------------------------------- */

int sst_board_parse(struct sst_board *out, const char *text)
{
    const bool file = sst_text_ends(text, ".yaml") || sst_text_ends(text, ".yml") ||
                      (sst_path_exists(text) && !sst_path_is_dir(text));
    struct sst_board b = { 0 };
    const char *fault;
    int err;

    if (file) {
        err = read_kalibr(&b, text);
        if (!err)
            *out = b;
        return err;
    }
    fault = read_text(&b, text);
    if (fault) {
        sst_log_error("board \"%s\": %s; " FORMS, text, fault);
        return -EINVAL;
    }
    *out = b;
    return 0;
}

/* The shortest decimal that parses back to the same number. */
static void format_number(char out[32], double value)
{
    for (int digits = 6; digits <= 17; digits++) {
        snprintf(out, 32, "%.*g", digits, value);
        if (strtod(out, NULL) == value)
            return;
    }
}

void sst_board_format(const struct sst_board *b, char out[128])
{
    const char *dictionary = sst_board_dictionary_name(b->dictionary, NULL);
    char size[32], marker[32];

    format_number(size, b->square_mm);
    format_number(marker, b->marker);
    if (b->kind == SST_BOARD_CHESSBOARD)
        snprintf(out, 128, "chessboard:%dx%d:%smm", b->cols, b->rows, size);
    else if (b->kind == SST_BOARD_CHARUCO)
        snprintf(out, 128, "charuco:%dx%d:%smm:%s%s%s", b->cols, b->rows, size, marker, b->dictionary ? ":" : "",
                 b->dictionary && dictionary ? dictionary : "");
    else
        snprintf(out, 128, "aprilgrid:%dx%d:%smm:%s%s", b->cols, b->rows, size, marker,
                 b->bottom_up ? ":bottom-up" : "");
}
