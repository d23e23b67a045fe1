/* cli/import_recording.h - `sst import recording`: sets of a recording as light fields. */
#ifndef SST_CLI_IMPORT_RECORDING_H
#define SST_CLI_IMPORT_RECORDING_H

#include "cli/cli.h"

struct sst_use_calibration;

struct import_recording {
    const char *source, *out;
    const char *sets; /* "0,5-9", "all", "first", "last"; NULL: the only one there is */
    bool allow_partial, force;
    double range_min_px, range_max_px;
    const struct sst_use_calibration *calibration; /* or NULL */
    int threads;
};

/** @return exit code; the sentence was printed. */
int cli_run_import_recording(const struct cli_command *cmd, const struct import_recording *args);

#endif
