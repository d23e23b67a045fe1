/* cli/cameras.h - the service's cameras, shown to people. */
#ifndef SST_CLI_CAMERAS_H
#define SST_CLI_CAMERAS_H

#include "cli/client.h"

/** The grid, then those that do not stream and why; `all`: a line for each. @param answer  of GET /api/v1/cameras */
void cli_print_grid(const json_t *answer, bool all);

#endif
