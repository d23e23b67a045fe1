/* cli/find_internal.h - moments of `sst find`: sets of views of one light field, or light fields of one world. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CLI_FIND_INTERNAL_H
#define SST_CLI_FIND_INTERNAL_H

#include "cli/posed_internal.h"
#include "pipeline/posed/find/find.h"

struct find_moments {
    int count;                            /* 0: the light field is one set */
    const char *path[SST_FIND_MOMENTS];   /* light field of each moment */
    int number[SST_FIND_MOMENTS];         /* of the moment there; 0: the light field is one moment */
    double time_s[SST_FIND_MOMENTS];      /* since the first one */
    struct sst_posed part[SST_FIND_MOMENTS]; /* its views */
};

/**
 * Several light fields are a moment each: load them and check that they are of one world, before a surface is sought.
 *
 * @param m     zeroed; to be closed also after a failure
 * @param path  NULL at the end; one light field alone is left to cli_find_moments_open(), with a warning where its
 * moments have too few views
 * @return exit code, CLI_GO_ON; errors are logged
 */
int cli_find_moments_load(struct find_moments *m, const char *const *path);

/**
 * Moments of a search and their times. One light field has some where its views have moments and two or more of these
 * have two placed views or more; its own times are used where they rise.
 *
 * @param scene       of the only light field, or of one of several
 * @param interval_s  between moments; 0: the light field's times, or 0.5
 * @return exit code, CLI_GO_ON; errors are logged
 */
int cli_find_moments_open(struct find_moments *m, const struct posed_scene *scene, double interval_s);
void cli_find_moments_close(struct find_moments *m);

#endif
