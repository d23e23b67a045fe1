/* cli/capture.h - the subcommands of sst capture. */
#ifndef SST_CLI_CAPTURE_H
#define SST_CLI_CAPTURE_H

#include "cli/cli.h"

extern const struct cli_command cli_capture_array, cli_capture_rig;

#endif
