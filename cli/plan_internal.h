/* cli/plan_internal.h - the part of `sst plan` about live pictures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CLI_PLAN_INTERNAL_H
#define SST_CLI_PLAN_INTERNAL_H

#include "cli/cli_internal.h"
#include "config/sstd.h"

/** Measure and print the rates of live pictures of cameras with live: poses. @param size  0: as configured
 *  @return exit code */
int plan_live(const char *path, const int size[2], bool json);

#endif
