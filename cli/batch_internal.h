/* cli/batch_internal.h - what the files of `sst batch` share. */
#ifndef SST_CLI_BATCH_INTERNAL_H
#define SST_CLI_BATCH_INTERNAL_H

#include "cli/cli_internal.h"

/** What is done to each piece. */
struct batch {
    const char *out, *preset, *model, *calib;
    int steps, every, threads;
    bool no_labels, reads_only;
    char states[SST_PATH_MAX], logs[SST_PATH_MAX];
};

struct batch_piece {
    char *source; /* light field, or recording of which: */
    int set;      /* -1: a light field */
};

/** Make OUT/NAME, whole or not at all, with its log in logs/NAME.log. @param again  remove what a killed worker left
 *  @return exit code */
int batch_run_piece(const struct batch *b, const struct batch_piece *piece, const char *name, bool again);

/** Write OUT/figures.csv from what the commands have reported of the pieces that are done. @return 0 or an error,
 * logged */
SST_MUST_CHECK int batch_write_table(const char *out, char *const *name, int count);

#endif
