/* cli/process_internal.h - processing of light fields, of folders by `sst process` and in memory by `sst batch`. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CLI_PROCESS_INTERNAL_H
#define SST_CLI_PROCESS_INTERNAL_H

#include "cli/cli_internal.h"
#include "pipeline/method/process/process.h"

/** Options of the command line beyond the matching. */
struct cli_process_wanted {
    const char *model, *hand_label, *labels_dir, *disparity_dir, *skip, *device;
    int memory, device_memory; /* MiB; 0: not given */
    struct sst_runner_user *networks;
    double range_min, range_max;
    bool no_labels, no_verify;
    int unaligned;         /* 1: `align` is off */
    bool correct, several; /* of `align`; more than one light field */
};

/** Work on each light field. */
struct cli_process {
    struct sst_process_config cfg;
    struct cli_process_wanted w;
    const char *preset;
    struct sst_runner *device;
    char mccnn[SST_PATH_MAX];
};

#define CLI_PROCESS_DEFAULTS                                                                                           \
    {                                                                                                                  \
        .cfg = { .eps_h = -1, .accuracy_weight = 4, .refine = true, .skip_labels = true },                             \
        .w = { .device = "cpu", .range_min = NAN, .range_max = NAN },                                                  \
    }

/** A light field and its report. */
struct cli_processed {
    const struct cli_process *process;
    const char *name; /* its folder, or a name for messages */
    struct sst_lightfield lf;
    struct sst_process_extras extras;
    struct sst_process_report report;
    struct sst_process_time load;
};

/** Read the options together. @return CLI_GO_ON or an exit code */
int cli_process_configure(const struct cli_command *cmd, struct cli_process *p, const struct cli_matching *m);

/** One opening of the device, for matching, and for networks where there are any. */
SST_MUST_CHECK int cli_process_open_devices(struct cli_process *p);
void cli_process_close_devices(struct cli_process *p);

/** Load a light field from its folder with its external maps or the options'. @param what  data to load besides the
 * views */
SST_MUST_CHECK int cli_process_load(struct cli_processed *c, struct sst_share *share, unsigned what);

/** Compute the maps of a loaded light field. @param share  or NULL */
SST_MUST_CHECK int cli_process_compute(struct cli_processed *c, struct sst_share *share);

/** Complete the report and the light field's own account with what its files, in folder `name`, show. */
SST_MUST_CHECK int cli_process_describe(struct cli_processed *c);

void cli_processed_fini(struct cli_processed *c);

/** Log warnings, and print the report, or set *out to it. @param out  or NULL @return 0, -ENOMEM */
SST_MUST_CHECK int cli_process_report(const struct cli_processed *c, struct sst_process_time saving, json_t **out);

#endif
