/* cli/rectify.h - a calibration on the command line, as `sst rectify` and `sst import` take it. */
#ifndef SST_CLI_RECTIFY_H
#define SST_CLI_RECTIFY_H

#include "cli/cli.h"
#include "pipeline/lightfield/calibrated.h"

/** Read a calibration and the name of a filter into what sst_use_calibration_defaults() began.
 *  @return CLI_GO_ON (free with sst_use_calibration_fini()) or an exit code; the sentence was printed. */
int cli_use_calibration(struct sst_use_calibration *use, const struct cli_command *cmd, const char *path,
                        const char *filter);

#endif
