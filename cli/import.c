/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "capture/recording/lightfields.h"
#include "cli/cli_internal.h"

struct import_recording {
    const char *const *dirs; /* [count] of one recording, or of several hosts' recordings */
    int count;
    const struct sst_import_config *import; /* as for the other formats; without grid, spacing and external maps */
    const char *sets;                       /* "0,5-9", "all", "first", "last"; NULL: the only one there is */
    bool allow_partial;
    const char *poses; /* of cameras that stand anywhere; NULL: a lattice */
};

/* --- recordings --------------------------------------------------------------------------------------------------- */

/* Numbers and ranges, each set once, in the order of recording. */
static int choose_listed(const char *text, bool *chosen, int n)
{
    for (const char *p = text;; p++) {
        char *end;
        long from, to;

        errno = 0;
        from = to = strtol(p, &end, 10);
        if (end == p || *p == '-' || *p == '+' || *p == ' ')
            return -EINVAL;
        if (*end == '-') {
            p = end + 1;
            to = strtol(p, &end, 10);
            if (end == p || *p == '-' || *p == '+' || *p == ' ')
                return -EINVAL;
        }
        if (errno || from > to || (*end && *end != ','))
            return -EINVAL;
        if (to >= n)
            return -ERANGE;
        for (long i = from; i <= to; i++)
            chosen[i] = true;
        if (!*end)
            return 0;
        p = end;
    }
}

static int choose(const struct cli_command *cmd, const struct import_recording *args, int n, int *sets, int *count)
{
    bool *chosen = calloc((size_t)n, sizeof(*chosen));
    int err = chosen ? 0 : -ENOMEM;

    if (!err && args->sets && !strcmp(args->sets, "all"))
        memset(chosen, 1, (size_t)n * sizeof(*chosen));
    else if (!err && (!args->sets || !strcmp(args->sets, "first")))
        chosen[0] = true;
    else if (!err && !strcmp(args->sets, "last"))
        chosen[n - 1] = true;
    else if (!err)
        err = choose_listed(args->sets, chosen, n);
    *count = 0;
    for (int i = 0; !err && i < n; i++) {
        if (chosen[i])
            sets[(*count)++] = i;
    }
    free(chosen);
    if (err == -ERANGE)
        return cli_usage_error(cmd, "--sets %s: %s has sets 0 to %d", args->sets, args->import->source, n - 1);
    if (err == -EINVAL)
        return cli_usage_error(cmd, "--sets %s is not a list such as 0,5-9, nor all, first or last", args->sets);
    return err ? cli_exit_code(err) : CLI_GO_ON;
}

static int read_poses(struct sst_posed *out, const struct import_recording *args,
                      const struct sst_recording *recording)
{
    const struct sst_recording_info *info = sst_recording_info(recording);
    const struct sst_posed_array array = { info->rows, info->cols, info->width, info->height, 3 };

    return args->poses ? sst_posed_array_read(out, args->poses, &array) : 0;
}

static int report(const struct import_recording *args)
{
    const char *out = args->import->out;

    return args->poses ? cli_report_posed(out, out, false) : cli_exit_code(cli_print_lightfield(out, out));
}

static int make(const struct cli_command *cmd, const struct import_recording *args,
                const struct sst_recording *recording)
{
    const int n = sst_recording_sets(recording);
    struct sst_lightfields_config cfg = {
        .out = args->import->out,
        .allow_partial = args->allow_partial,
        .force = args->import->force,
        .range_min_px = args->import->range_min_px,
        .range_max_px = args->import->range_max_px,
        .threads = args->import->threads,
        .calibration = args->import->calibration,
        .progress = cli_progress,
        .progress_arg = (void *)(uintptr_t) "import",
    };
    struct sst_posed poses = { 0 };
    int *sets, err, r;

    if (!n) {
        sst_log_error("%s holds no set; record some first", args->import->source);
        return CLI_INPUT;
    }
    if (!args->sets && n > 1)
        return cli_usage_error(cmd, "%s has %d sets; choose with --sets first, 0,5-9 or all", args->import->source, n);
    sets = malloc((size_t)n * sizeof(*sets));
    if (!sets)
        return CLI_MEMORY;
    r = choose(cmd, args, n, sets, &cfg.count);
    if (r != CLI_GO_ON) {
        free(sets);
        return r;
    }
    cfg.sets = sets;
    cfg.each = cfg.count > 1 || (args->sets && !strcmp(args->sets, "all"));
    cfg.poses = args->poses ? &poses : NULL;
    err = read_poses(&poses, args, recording);
    err = err ? err : sst_recording_to_lightfields(recording, &cfg);
    cli_progress_end();
    sst_posed_fini(&poses);
    if (!err && cfg.each)
        printf("%s: %d light fields, %s/set-%06d to %s/set-%06d\n", args->import->out, cfg.count, args->import->out,
               sets[0], args->import->out, sets[cfg.count - 1]);
    free(sets);
    return err || cfg.each ? cli_exit_code(err) : report(args);
}

static int run_recording(const struct cli_command *cmd, const struct import_recording *args)
{
    struct sst_recording *recording;
    const int err = args->count > 1 ? sst_recording_open_joined(&recording, args->dirs, args->count)
                                    : sst_recording_open(&recording, args->import->source);
    int code;

    if (err)
        return cli_exit_code(err);
    code = make(cmd, args, recording);
    sst_recording_close(recording);
    return code;
}

/* --- the command -------------------------------------------------------------------------------------------------- */

#define RECORDINGS_MAX 16

static int import_folder(const struct sst_import_config *cfg)
{
    const int err = sst_import(cfg);

    return cli_exit_code(err ? err : cli_print_lightfield(cfg->out, cfg->out));
}

/* "R,C,RxC" */
static bool read_part(const char *text, int part[4])
{
    int end = 0;

    return sscanf(text, "%4d,%4d,%4dx%4d%n", &part[0], &part[1], &part[2], &part[3], &end) == 4 && !text[end] &&
           part[0] >= 0 && part[1] >= 0 && part[2] > 0 && part[3] > 0;
}

/* Options of formats of lattices. */
struct lattice_options {
    const char *calib, *filter, *prefer, *part;
    int grid[2];
    double infinity_px;
};

static int check_lattice(struct sst_import_config *cfg, const struct cli_command *cmd, const struct lattice_options *a,
                         const struct import_recording *recording, const char *const *args)
{
    if (isnan(cfg->range_min_px) != isnan(cfg->range_max_px))
        return cli_usage_error(cmd, "--range-min and --range-max must be given together");
    if (isnan(cfg->range_min_px))
        cfg->range_min_px = cfg->range_max_px = 0;
    if (strcmp(args[0], "recording") && args[2])
        return cli_usage_error(cmd, "one source at a time: %s; only recordings of several hosts are joined", args[2]);
    if (!strcmp(args[0], "recording") &&
        (a->grid[0] || a->part || cfg->spacing_px > 0 || cfg->disparity_dir || cfg->labels_dir || !isnan(a->infinity_px)))
        return cli_usage_error(cmd, "--grid, --part, --spacing-px, --disparity, --labels and --infinity-px do not apply to a "
                                    "recording, which has its own grid and spacing");
    if (strcmp(args[0], "recording") && (recording->sets || recording->allow_partial || recording->poses))
        return cli_usage_error(cmd, "--sets, --allow-partial and --poses belong to the format recording, not to %s",
                               args[0]);
    if (a->calib && recording->poses)
        return cli_usage_error(cmd, "--calib is for a lattice, --poses for cameras that stand anywhere; give either");
    if (a->part && !read_part(a->part, cfg->part))
        return cli_usage_error(cmd, "--part %s is not first row, first column, rows x columns, such as 1,1,6x6", a->part);
    if (!isnan(a->infinity_px))
        cfg->infinity_px = &a->infinity_px;
    if (a->prefer && (strcmp(args[0], "folder") || (strcmp(a->prefer, "jpeg") && strcmp(a->prefer, "raw"))))
        return cli_usage_error(cmd, "--prefer is jpeg or raw, of the format folder");
    cfg->prefer_raw = a->prefer && !strcmp(a->prefer, "raw");
    return CLI_GO_ON;
}

/* Posed light fields: the options of lattices do not apply. */
static int import_posed(struct cli_import_posed *posed, const struct cli_command *cmd, const struct lattice_options *a,
                        const struct import_recording *recording, const char *const *args)
{
    const struct sst_import_config *cfg = recording->import;

    if (a->grid[0] || a->part || a->prefer || a->calib || !isnan(a->infinity_px) || cfg->spacing_px > 0 ||
        cfg->disparity_dir || cfg->labels_dir || recording->sets || recording->allow_partial || recording->poses || !isnan(cfg->range_min_px) ||
        !isnan(cfg->range_max_px) || args[2])
        return cli_usage_error(cmd, "an option or argument does not apply to %s; `sst import --help` names those that do",
                               args[0]);
    posed->format = args[0];
    posed->cfg.source = args[1];
    posed->cfg.out = cfg->out;
    posed->cfg.force = cfg->force;
    posed->cfg.threads = cfg->threads;
    return cli_import_posed(cmd, posed);
}

/* Options of posed light fields do not apply to other formats. */
static int check_not_posed(const struct cli_command *cmd, const struct cli_import_posed *p, const char *format)
{
    if (!p->cfg.pictures && p->cfg.focal_px == 0 && p->cfg.fov_deg == 0 && !p->cfg.lens && !p->cfg.moments && !p->kelvin &&
        !p->unit && !p->json)
        return CLI_GO_ON;
    return cli_usage_error(cmd, "--pictures, --focal, --fov, --lens, --moments, --kelvin, --unit and --json belong to the "
                                "formats poses and pictures, not to %s",
                           format);
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct lattice_options a = { .filter = "bicubic", .infinity_px = (double)NAN };
    struct sst_import_config cfg = { .range_min_px = (double)NAN, .range_max_px = (double)NAN };
    struct import_recording recording = { .import = &cfg };
    struct cli_import_posed posed = { .unit = 0 };
    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &cfg.out, "LF", "light-field folder to make" },
        { "grid", 0, CLI_GRID, a.grid, "RxC", "rows and columns; required for folder, lets the others have holes", 1,
          256 },
        { "part", 0, CLI_STRING, &a.part, "R,C,RxC", "first row and column, rows and columns of the grid to use; all" },
        { "spacing-px", 0, CLI_DOUBLE, &cfg.spacing_px, "P", "folder: focal length times spacing, stored as provenance",
          0, 1e12 },
        { "disparity", 0, CLI_STRING, &cfg.disparity_dir, "DIR",
          "folder: external disparity rr_cc.pfm, px per spacing, inf unknown" },
        { "labels", 0, CLI_STRING, &cfg.labels_dir, "DIR", "folder: external labels rr_cc.png, 0 unlabeled" },
        { "prefer", 0, CLI_STRING, &a.prefer, "KIND",
          "folder: jpeg (default) or raw: which files of views that have both; raw ones are developed", 0, 0,
          "jpeg raw" },
        { "sets", 0, CLI_STRING, &recording.sets, "LIST",
          "recording: 0,5-9, first, last or all; more than one: LF/set-NNNNNN each" },
        { "allow-partial", 0, CLI_FLAG, &recording.allow_partial, NULL,
          "recording: sets may lack views; the light field then has holes" },
        { "poses", 0, CLI_STRING, &recording.poses, "FILE",
          "recording: poses of cameras that stand anywhere, a calibration or a posed light field; LF is a posed one" },
        { "range-min", 0, CLI_DOUBLE, &cfg.range_min_px, "D", "smallest disparity in the scene, px per spacing", -32768,
          32768 },
        { "range-max", 0, CLI_DOUBLE, &cfg.range_max_px, "D", "largest disparity in the scene", -32768, 32768 },
        { "infinity-px", 0, CLI_DOUBLE, &a.infinity_px, "D",
          "disparity of infinity; 0: parallel views, below 0: they converge", -32768, 32768 },
        { "calib", 0, CLI_STRING, &a.calib, "FILE",
          "recording, folder: the array's calibration; views are then rectified" },
        { "filter", 0, CLI_STRING, &a.filter, "F", "filter of --calib: bilinear, bicubic (default) or lanczos", 0, 0,
          "bilinear bicubic lanczos" },
        { "pictures", 0, CLI_STRING, &posed.cfg.pictures, "DIR", "poses: folder of the pictures, if not beside them" },
        { "focal", 0, CLI_DOUBLE, &posed.cfg.focal_px, "PX", "poses, pictures: focal length where the source has none", 1,
          1e7 },
        { "fov", 0, CLI_DOUBLE, &posed.cfg.fov_deg, "DEG", "... or the angle of view across the width", 0.1, 179 },
        { "lens", 0, CLI_STRING, &posed.cfg.lens, "FILE", "... or a calibration of the camera, also MATLAB's cameraParameters" },
        { "moments", 0, CLI_STRING, &posed.cfg.moments, "PATTERN",
          "poses, pictures: moments in the names, \"{camera}_{moment}.jpg\"; * is any text" },
        { "kelvin", 0, CLI_STRING, &posed.kelvin, "SCALE,OFFSET", "poses, pictures: kelvin = level x SCALE + OFFSET" },
        { "unit", 0, CLI_WORD, &posed.unit, "U", "poses: unit of the source's lengths, mm or m", 1, 0, "mm m" },
        { "json", 0, CLI_FLAG, &posed.json, NULL, "poses, pictures: describe the light field as JSON" },
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
    if (!strcmp(args[0], "poses") || !strcmp(args[0], "pictures"))
        return import_posed(&posed, cmd, &a, &recording, args);
    r = check_not_posed(cmd, &posed, args[0]);
    if (r == CLI_GO_ON)
        r = check_lattice(&cfg, cmd, &a, &recording, args);
    if (r != CLI_GO_ON)
        return r;
    sst_use_calibration_defaults(&use);
    if (a.calib) {
        r = cli_use_calibration(&use, cmd, a.calib, a.filter);
        if (r != CLI_GO_ON)
            return r;
        cfg.calibration = &use;
    }
    cfg.format = args[0];
    cfg.source = args[1];
    recording.dirs = args + 1;
    while (recording.count < RECORDINGS_MAX && args[1 + recording.count])
        recording.count++;
    cfg.rows = a.grid[0];
    cfg.cols = a.grid[1];
    r = strcmp(cfg.format, "recording") ? import_folder(&cfg) : run_recording(cmd, &recording);
    sst_use_calibration_fini(&use);
    return r;
}

const struct cli_command cli_import = { "import", run };
