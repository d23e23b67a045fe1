/* cli/precision.h - the option --precision of commands that run networks. */
#ifndef SST_CLI_PRECISION_H
#define SST_CLI_PRECISION_H

#include "pipeline/method/network/network.h"

#define CLI_PRECISION_HELP "networks on f32 or int8 numbers; default: int8 where file and processor have it"

/** @param name  f32 or int8; NULL leaves *out alone. @return 0 or -EINVAL, logged */
SST_MUST_CHECK int cli_precision(enum sst_precision *out, const char *name);

#endif
