/* cli/cli.h - what the subcommands of sst share: the command table, options, exit codes, progress. */
#ifndef SST_CLI_CLI_H
#define SST_CLI_CLI_H

#include <stdbool.h>

#include <jansson.h>

#include "base/base.h"

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

/** Exit code of a negative errno that a module returned (0 gives CLI_OK). */
int cli_exit_code(int err);

enum cli_type {
    CLI_FLAG = 0,   /* bool *: set true */
    CLI_INT = 1,    /* int * within min..max */
    CLI_DOUBLE = 2, /* double * within min..max; "inf" is read when max is infinite */
    CLI_STRING = 3, /* const char ** */
    CLI_SIZE = 4,   /* int[2]: "WxH" (width, height) within min..max each */
    CLI_GRID = 5,   /* int[2]: "RxC" (rows, columns) within min..max each */
    CLI_SEED = 6,   /* uint64_t * */
};

struct cli_option {
    const char *name; /* long name, without dashes */
    char letter;      /* short form, or 0 */
    enum cli_type type;
    void *value;
    const char *meta; /* name of the value in help, NULL for flags */
    const char *help; /* one line */
    double min, max;  /* of numbers; both 0: no limit */
};

struct cli_command {
    const char *name;
    const char *usage;   /* arguments after "sst NAME", e.g. "LF --focus D -o out.png" */
    const char *summary; /* one line, for the list */
    const char *detail;  /* more lines for --help, or NULL */
    const char *example; /* a command line that works, or several */
    int (*run)(const struct cli_command *cmd, int argc, char **argv); /* exit code */
};

#define CLI_DESCRIBE "--describe"

/** What cli_parse() tells: go on, or return this code. */
#define CLI_GO_ON (-1)

/**
 * Read options and positional arguments (before, after or between options; "--" ends options). --help, -v/--verbose and
 * -q/--quiet are added to every command. CLI_DESCRIBE as the only argument prints the command and its options as a line
 * of JSON {name, usage, summary, detail, example, options: [{name, letter, type, meta, help}]}: the man page and the
 * completion of shells are made from it.
 *
 * @param positional  out, exactly n_min..n_max of them, the rest NULL
 * @return CLI_GO_ON, CLI_OK (help was printed) or CLI_USAGE (the sentence was printed)
 */
int cli_parse(const struct cli_command *cmd, const struct cli_option *options, size_t n_options, int argc, char **argv,
              const char **positional, int n_min, int n_max);

/** Name the command in a usage error: "sst: error: render: ..." */
int cli_usage_error(const struct cli_command *cmd, const char *fmt, ...) SST_PRINTF(2, 3);

/** Print an object on standard output, 9 digits a number, and give it back. @param root  NULL: there was no memory for
 * it
 *  @return exit code */
int cli_print_json(json_t *root);

/** Progress bar with remaining time on a terminal, nothing elsewhere. Shown only after a second. */
void cli_progress(void *title, double done);
void cli_progress_end(void);

extern const struct cli_command cli_board, cli_calibrate, cli_calibration, cli_cameras, cli_capture, cli_demo,
    cli_doctor, cli_eval, cli_events, cli_export, cli_identify, cli_import, cli_models, cli_plan, cli_process,
    cli_record, cli_recording, cli_rectify, cli_reload, cli_render, cli_scene, cli_segment, cli_snapshot, cli_status,
    cli_stereo, cli_sweep, cli_topology, cli_version;

#endif
