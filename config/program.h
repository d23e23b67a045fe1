/* config/program.h - beginning of sstd and of its publishers: options, log, configuration. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CONFIG_PROGRAM_H
#define SST_CONFIG_PROGRAM_H

#include "config/sstd.h"

#define SST_PROGRAM_GO_ON (-1)

struct sst_program {
    const char *name, *help;
    bool checks;                 /* --check ends it after the configuration is read */
    const char *config, *socket; /* out: of the command line; NULL: the defaults */
};

/** Parse the command line, set up the log, and read the configuration. @param config  out
 *  @return SST_PROGRAM_GO_ON, or the exit status of the program */
int sst_program_begin(struct sst_program *p, struct sst_config *config, int argc, char **argv);

#endif
