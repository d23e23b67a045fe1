/* cli/lightfield_line.h - one line about a light field, as `sst import` and `sst export` end with. */
#ifndef SST_CLI_LIGHTFIELD_LINE_H
#define SST_CLI_LIGHTFIELD_LINE_H

#include "pipeline/lightfield/lightfield.h"

/** Print "NAME: 36 views of 1024x640, grid 6x6, offsets ..., disparity ...". Only lightfield.json is needed. */
void cli_print_lightfield(const struct sst_lightfield *lf, const char *name);

#endif
