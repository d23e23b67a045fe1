/* cli/cli_internal.h - private declarations of this folder; code outside of it includes the public headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CLI_CLI_INTERNAL_H
#define SST_CLI_CLI_INTERNAL_H

#include <jansson.h>
#include <stdbool.h>
#include <sys/types.h>

#include "base/base.h"
#include "base/file.h"
#include "capture/calibration/gather.h"
#include "capture/recording/recorder.h"
#include "capture/recording/recording.h"
#include "capture/rig/rig_still.h"
#include "client/client.h"
#include "config/array.h"
#include "drivers/genicam/genicam.h"
#include "drivers/grab/grab.h"
#include "drivers/usb/plan.h"
#include "pipeline/image/image.h"
#include "pipeline/lightfield/import.h"
#include "pipeline/lightfield/lightfield.h"
#include "pipeline/method/disparity/disparity.h"
#include "pipeline/method/network/device.h"
#include "pipeline/method/network/network.h"
#include "pipeline/method/refine/refine.h"
#include "pipeline/method/render/render.h"
#include "pipeline/posed/import/import.h"

/* --- cli: common parts of the subcommands of sst: the command table, options, exit codes, progress. --- */

/** Exit codes, as documented in `sst --help` and sst(1). */
enum cli_exit {
    CLI_OK = 0,
    CLI_INTERNAL = 1, /* a bug or a failure with no better place */
    CLI_USAGE = 2,    /* unknown option or argument, value outside its range */
    CLI_INPUT = 3,    /* an input is missing, damaged or does not fit */
    CLI_OUTPUT = 4,   /* an output cannot be written; nothing half-written is left */
    CLI_MISSING = 5,  /* an optional part or a model is missing from this build or machine, or no service runs */
    CLI_MEMORY = 6,
    CLI_INTERRUPTED = 130,
};

/** Exit code for a negative errno of a module (0 gives CLI_OK). */
int cli_exit_code(int err);

enum cli_type {
    CLI_FLAG = 0,   /* bool *: set true */
    CLI_INT = 1,    /* int * within min..max */
    CLI_DOUBLE = 2, /* double * within min..max; "inf" is read when max is infinite */
    CLI_STRING = 3, /* const char ** */
    CLI_SIZE = 4,   /* int[2]: "WxH" (width, height) within min..max each */
    CLI_GRID = 5,   /* int[2]: "RxC" (rows, columns) within min..max each */
    CLI_SEED = 6,   /* uint64_t * */
    CLI_AUTO = 7,   /* double *: as CLI_DOUBLE, or "auto": NaN */
    CLI_FILE = 8,   /* const char **: a file to write; ... */
    CLI_MADE = 9,   /* const char **: a folder, or either, to make: refused at once where it cannot be */
    CLI_WORD = 10,  /* int * or an enum: min for the first of `words`, one more for the next ... */
};

struct cli_option {
    const char *name; /* long name, without dashes */
    char letter;      /* short form, or 0 */
    enum cli_type type;
    void *value;
    const char *meta;  /* name of the value in help, NULL for flags */
    const char *help;  /* one line */
    double min, max;   /* of numbers; both 0 (left out): no limit */
    const char *words; /* of text: the values, between blanks, for the completion; NULL: any */
};

struct cli_command {
    const char *name;
    int (*run)(const struct cli_command *cmd, int argc, char **argv); /* exit code */
};

/** Texts of a command, made from cli/commands.txt. */
struct cli_manual {
    const char *name;
    const char *usage;   /* arguments after "sst NAME", e.g. "LF --focus D -o out.png" */
    const char *summary; /* one line for the list of commands */
    const char *detail;  /* more lines for --help, or NULL */
    const char *example; /* a command line that works, or several */
};

extern const struct cli_manual cli_manuals[]; /* the last has no name */
const struct cli_manual *cli_manual(const struct cli_command *cmd);

#define CLI_DESCRIBE "--describe"

/** Result of cli_parse() to continue; any other is the exit code. */
#define CLI_GO_ON (-1)

/** An argument that starts with '-' but is a number is a value ("--focus -1.5"), not an option. */
bool cli_is_option(const char *arg);

/**
 * Read options and positional arguments (before, after or between options; "--" ends options). --help, -v/--verbose and
 * -q/--quiet are added to every command. CLI_DESCRIBE as the only argument prints the command and its options as a line
 * of JSON {name, usage, summary, detail, example, options: [{name, letter, type, meta, help, words}]}, from which the
 * man page and the shell completion are generated.
 *
 * @param positional  out, n_min..n_max arguments, the rest NULL
 * @return CLI_GO_ON, CLI_OK (help was printed) or CLI_USAGE (the error was printed)
 */
int cli_parse(const struct cli_command *cmd, const struct cli_option *options, size_t n_options, int argc, char **argv,
              const char **positional, int n_min, int n_max);

/** Log a usage error with the command's name: "sst: error: render: ..." */
int cli_usage_error(const struct cli_command *cmd, const char *fmt, ...) SST_PRINTF(2, 3);
/** Are two paths one file or folder, which exists? */
bool cli_is_one_file(const char *a, const char *b);
/** Two whole numbers of 0 or more in decimal digits, such as "500,375"; above 999999999: INT_MAX. @return the text is a pair */
bool cli_read_pair(const char *text, char between, int pair[2]);

/** One kind of work that a command may skip (design.md, 5.5), or of another list of names. */
struct cli_skip {
    const char *name;
    bool *on; /* holds the default; out */
};

#define CLI_SKIP_TEXT 200 /* bytes of a list of all names */

/**
 * Read `--skip LIST` and the like: names separated by commas, which replace the defaults, or `all` or `none`.
 *
 * @param option  its name
 * @param list  NULL: the defaults stay
 * @return CLI_GO_ON, or an exit code after an error message that lists the names
 */
int cli_read_skips(const struct cli_command *cmd, const char *option, const char *list, const struct cli_skip *skips,
                   size_t count);

/** Flush standard output. @return CLI_OK, CLI_OUTPUT: some of it is lost; logged once, but not where its reader has gone. */
int cli_flush(void);

/** Print an object on standard output with jansson's flags and a newline, and release it. @param root  NULL: out of
 *  memory @return exit code */
int cli_dump_json(json_t *root, size_t flags);
/** Print an object as cli_dump_json(), indented, 9 digits per number. */
int cli_print_json(json_t *root);

/** A number; null if it is not finite. */
json_t *cli_real_json(double v);

/** A figure in a column of a table; a dash if it is not finite. */
void cli_print_cell(double v, int width, int digits);

/** Write an object as a file of a folder, whole or not at all. @return 0, -ENOMEM, or an error of the output; logged */
SST_MUST_CHECK int cli_write_json(const json_t *root, const char *dir, const char *name);

/** Progress bar with remaining time; only on a terminal, and only after a second. */
void cli_progress(void *title, double done);
void cli_progress_end(void);

extern const struct cli_command cli_audit, cli_batch, cli_board, cli_calibrate, cli_calibration, cli_cameras, cli_capture,
    cli_demo, cli_doctor, cli_eval, cli_events, cli_export, cli_identify, cli_import, cli_models, cli_plan, cli_poses, cli_process,
    cli_record, cli_recording, cli_rectify, cli_reload, cli_render, cli_scene, cli_segment, cli_snapshot, cli_status,
    cli_find, cli_stereo, cli_sweep, cli_token, cli_topology, cli_verify, cli_version;

/* --- child: programs that a command starts. --- */

/**
 * Start a program in a process group of its own, which ends when this process does.
 * @param out  file that gets its output; NULL: the log
 * @param log  file to which its messages are appended
 * @return its process, or -errno; exit code 127: it cannot be run
 */
pid_t cli_start_program(const char *const argv[], const char *out, const char *log);

/** Run a program to its end, as cli_start_program(). @return its exit code, 128 + the signal that ended it, or -errno
 */
int cli_run_program(const char *const argv[], const char *out, const char *log);

/** The last error that an `sst` program wrote to a log; "": none. */
void cli_last_error(const char *log, char *out, size_t size);

/* --- client: options that name the service, and its answers shown to people. --- */

/* Rows for a table of options. */
#define CLI_SERVICE_OPTIONS(s)                                                                                         \
    { "socket", 0, CLI_STRING, &(s).socket, "PATH", "the service's socket ($SST_SOCKET, " SST_CLIENT_SOCKET ")" },     \
        { "url", 0, CLI_STRING, &(s).url, "URL", "the service on another machine: http://HOST:PORT or https://" },     \
        { "token-file", 0, CLI_STRING, &(s).token_file, "FILE", "with --url: file that holds the token" },             \
    {                                                                                                                  \
        "ca", 0, CLI_STRING, &(s).ca, "FILE", "with https: certificate to trust, PEM"                                  \
    }

/* --- reading and showing answers ---------------------------------------------------------------------------------- */

/** Member by its path, "capture.skew_us.p50"; NULL: there is none. Borrowed. */
const json_t *cli_member(const json_t *object, const char *path);
/** Number (also of true and false); NaN: there is none. */
double cli_number(const json_t *object, const char *path);
/** Text for people: control characters are shown as '?', so that no name can drive the terminal. "" if there is none.
 */
const char *cli_text(const json_t *object, const char *path, char *buffer, size_t size);

#define CLI_SHORT 32
/** "1.5 GB"; "?" for NaN. @return buffer */
const char *cli_bytes_text(char buffer[CLI_SHORT], double bytes);
/** "2 d 03:04", "3:04:05", "12.5 s"; "?" for NaN. @return buffer */
const char *cli_duration_text(char buffer[CLI_SHORT], double seconds);

/* --- capture: the subcommands of sst capture. --- */

/** Enter the properties of an opened array (sst_capture_open) in cfg, and open the recorder. Errors of
 *  sst_recorder_open(). */
SST_MUST_CHECK int cli_open_recorder(struct sst_recorder **out, const struct sst_array_config *array,
                                     struct sst_recorder_config *cfg);

extern const struct cli_command cli_capture_array, cli_capture_rig;

/* --- demo_live: sst demo: sstd on simulated arrays, with its page. --- */

/** Run until interrupted. @param out  folder @param port  of the page; 0: 8090, or of a kept configuration
 *  @return exit code */
int cli_demo_live(const char *scene, const char *out, int port, const char *device);

/* --- usb: the cameras of a configuration on the USB tree, and the plan of their bandwidth. --- */

struct cli_usb {
    struct sst_usb_device *devices;
    int count;
    struct sst_usb_stream *streams; /* a camera each, in the order of `bind`, else of the tree */
    int stream_count;
    int64_t needed_bytes_s; /* of each; 0: unknown */
    struct sst_usb_plan plan;
};

/** List devices, choose the cameras that cfg binds (all without `bind`), plan them. @return 0 or -errno,
 * logged. */
SST_MUST_CHECK int cli_usb_open(struct cli_usb *usb, const struct sst_array_config *cfg);
void cli_usb_close(struct cli_usb *usb); /* a zeroed one is fine */

/**
 * Remedies for refused cameras, in sentences: a free port elsewhere, less data from each camera.
 * @param text  out, "" if all fit
 */
void cli_usb_advise(const struct cli_usb *usb, const struct sst_array_config *cfg, char *text, size_t size);

/** A text of a device, which may end within a character. */
json_t *cli_text_json(const char *text);

/** Is this the device that a configuration binds to a position? If a binding has both, the serial has priority, as in
 *  drivers/grab. */
bool cli_is_bound(const struct sst_config_camera *c, const char *serial, const char *port);

/** True if that GenICam camera is that one of the configuration. */
bool cli_is_genicam(const struct sst_config_camera *c, const struct sst_genicam_device *device);
/** Its place in the array; -1, -1: none. */
struct cli_place cli_genicam_place(const struct sst_array_config *cfg, const struct sst_genicam_device *device);

/** sst_genicam_list(), none without Aravis. *devices to free with free(). @return 0 or -ENOMEM */
SST_MUST_CHECK int cli_genicam_list(struct sst_genicam_device **devices, int *count);
/** As JSON and as a table, with the places that the configuration gives them. @return NULL: no memory */
json_t *cli_genicam_json(const struct sst_array_config *cfg, const struct sst_genicam_device *devices, int count);
void cli_genicam_print(const struct sst_array_config *cfg, const struct sst_genicam_device *devices, int count);

/** True if that node, of a list after sst_grab_select(), is that camera. */
bool cli_is_node(const struct sst_config_camera *c, const struct sst_grab_device *device);

/* --- lightfield_line: one line about a light field, as `sst import` and `sst export` end with. --- */

/** Print "NAME: 36 views of 1024x640, grid 6x6, offsets ..., disparity ..." of the light field in a folder. Only
 *  lightfield.json is read. @return 0 or its error; logged */
SST_MUST_CHECK int cli_print_lightfield(const char *dir, const char *name);

/* --- posed light fields: import_posed.c, posed_line.c. --- */

struct sst_posed;

/** Arguments of `sst import poses` and `sst import pictures`. */
struct cli_import_posed {
    struct sst_posed_import_config cfg;
    const char *format; /* "poses" or "pictures" */
    const char *kelvin; /* "SCALE,OFFSET"; NULL: not thermal */
    int unit;           /* 1: mm, 2: m; 0: the source's */
    bool json;
};

/** @return exit code */
int cli_import_posed(const struct cli_command *cmd, const struct cli_import_posed *args);

/** Description of a posed light field: views, placed, size, bits, metric, extent of the centres, source. */
json_t *cli_posed_json(const struct sst_posed *posed);

/** Print it, or one line, of the light field in a folder. @return exit code */
int cli_report_posed(const char *dir, const char *name, bool json);

/* --- poses by another program: poses_colmap.c. --- */

struct sst_posed_solve_config;
struct sst_posed_solved;

/**
 * Poses of a light field's pictures by COLMAP, which runs in a temporary folder of the light field.
 * @param posed  in and out; unchanged on failure
 * @return 0, -ENOTSUP (it is not installed), -EDOM (it places no view), or of its model; logged
 */
SST_MUST_CHECK int cli_poses_colmap(struct sst_posed *posed, const char *dir, const struct sst_posed_solve_config *cfg);

/** Find the poses of a light field with the moments of one array: its shape is shared. @return as sst_posed_solve() */
SST_MUST_CHECK int cli_poses_moments(struct sst_posed *posed, const char *dir, const struct sst_posed_solve_config *cfg,
                                     struct sst_posed_solved *solved);

/* --- networks on a device: network_device.c. d may be NULL: no device. --- */

#define CLI_DEVICE_MEMORY_HELP "memory of the device to use at most (three quarters of it)"

/** Report of the device, for `--json`; "cpu" without one. */
json_t *cli_network_device_json(struct sst_runner_user *d);

/** One line of the log about it: a warning where a network ran on the CPU instead. */
void cli_network_report_device(struct sst_runner_user *d);

/* --- matching: the option --precision of commands that run networks, and the matching options that `sst stereo` and
 * `sst process` share. --- */

/** Option for an enum sst_precision. */
#define CLI_PRECISION_OPTION(value)                                                                                    \
    {                                                                                                                  \
        "precision", 0, CLI_WORD, &(value), "NAME",                                                                    \
            "networks on f32 or int8 numbers; default: int8 where the file has it and it is faster",                   \
            SST_PRECISION_F32, 0, "f32 int8"                                                                           \
    }

/** Options of the user; unset numbers keep the preset's values. */
struct cli_matching {
    const char *preset, *model;
    enum sst_cost cost; /* 0: the preset's */
    enum sst_precision precision;
    int paths, p1, p2, rounds, scale, threads;
    bool no_fill, pairs;
};

#define CLI_MATCHING_DEFAULTS                                                                                          \
    {                                                                                                                  \
        .preset = "balanced", .paths = -1, .p1 = -1, .p2 = -1, .rounds = -1, .scale = -1                               \
    }

/* Rows of an option table for a struct cli_matching m. */
#define CLI_PRESETS "preview balanced accurate"
#define CLI_MATCHING_OPTIONS(m)                                                                                        \
    { "preset", 'p', CLI_STRING, &(m).preset, "NAME", "preview, balanced (default) or accurate", 0, 0, CLI_PRESETS },  \
        { "cost",          0, CLI_WORD,           &(m).cost, "NAME", "matching cost: census, mccnn or both",           \
          SST_COST_CENSUS, 0, "census mccnn both" },                                                                   \
        { "mccnn-model", 0, CLI_STRING, &(m).model, "NAME", "features network of the mccnn cost" },                    \
        CLI_PRECISION_OPTION((m).precision),                                                                           \
        { "paths", 0, CLI_INT, &(m).paths, "N", "directions of the optimisation: 4 or 8", 4, 8 },                      \
        { "p1", 0, CLI_INT, &(m).p1, "N", "penalty of a disparity step of 1 px", 1, SST_DISPARITY_MAX_PENALTY },       \
        { "p2", 0, CLI_INT, &(m).p2, "N", "penalty of a larger step", 1, SST_DISPARITY_MAX_PENALTY },                  \
        { "rounds", 0,                                                                                                 \
          CLI_INT,  &(m).rounds,                                                                                       \
          "N",      "of testing surfaces where they are visible (6 views and more)",                                   \
          0,        SST_DISPARITY_MAX_ROUNDS },                                                                        \
        { "scale", 0, CLI_INT, &(m).scale, "N", "match at full (1) or half size (2)", 1, 2 },                          \
        { "pairs", 0, CLI_FLAG, &(m).pairs, NULL, "match horizontal and vertical neighbours apart and fuse the maps",  \
          0,       0 },                                                                                                \
        { "no-fill", 0, CLI_FLAG, &(m).no_fill, NULL, "skip the multi-view check and filling" },                       \
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

/* --- places: which device sits where in the array, for commands that list cameras. --- */

struct cli_place {
    int row, col; /* -1: the configuration has no place for it */
};

/**
 * Places of all devices: by `bind`, or without one in the order given, row by row.
 * @param place  out [count]
 */
void cli_places(struct cli_place *place, const struct sst_array_config *cfg, const struct sst_grab_device *devices,
                int count);

/** Add "row" and "col" if the device has a position. @return `object`; NULL: out of memory, `object` was released or
 *  NULL */
json_t *cli_place_json(json_t *object, struct cli_place place);

/** "r0c3", or "-". */
const char *cli_place_text(char text[16], struct cli_place place);

/** The grab's part of an array's configuration, for cameras that run on their own; bindings are left alone. */
void cli_grab_config(struct sst_grab_config *grab, const struct sst_array_config *cfg);

/* --- rectify: a calibration on the command line, as `sst rectify` and `sst import` take it. --- */

/** Read a calibration and the name of a filter into the structure begun by sst_use_calibration_defaults().
 *  @return CLI_GO_ON (free with sst_use_calibration_fini()) or an exit code; the sentence was printed. */
int cli_use_calibration(struct sst_use_calibration *use, const struct cli_command *cmd, const char *path,
                        const char *filter);

#endif
