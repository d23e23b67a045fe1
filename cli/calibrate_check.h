/* cli/calibrate_check.h - `sst calibrate --check`: is a light field's calibration still true? */
#ifndef SST_CLI_CALIBRATE_CHECK_H
#define SST_CLI_CALIBRATE_CHECK_H

#include "cli/cli.h"

/**
 * Check a light-field folder and print the verdict and its tables, or one JSON object.
 *
 * @param threads  0: all processors
 * @param picture  PNG of the grid to write, or NULL
 * @return CLI_OK (the calibration is fine), CLI_INPUT (it is not, or cannot be told: the sentence is on standard
 *         error), or what reading and writing return
 */
int cli_run_calibrate_check(const struct cli_command *cmd, const char *dir, bool json, int threads,
                            const char *picture);

#endif
