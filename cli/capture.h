/* cli/capture.h - the subcommands of sst capture. */
#ifndef SST_CLI_CAPTURE_H
#define SST_CLI_CAPTURE_H

#include "cli/cli.h"
#include "config/array.h"
#include "capture/recording/recorder.h"

/** Say of an opened array (sst_capture_open) what a recording of it must know, in cfg, and open the recorder. The same
 *  errors. */
SST_MUST_CHECK int cli_open_recorder(struct sst_recorder **out, const struct sst_array_config *array,
                                     struct sst_recorder_config *cfg);

extern const struct cli_command cli_capture_array, cli_capture_rig;

#endif
