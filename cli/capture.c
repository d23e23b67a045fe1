/* sst capture: dispatches to the kind of capture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <stdio.h>
#include <string.h>

#include "base/edit_distance.h"

static const struct cli_command *const kinds[] = { &cli_capture_array, &cli_capture_rig };

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    for (size_t i = 0; argc > 1 && i < ARRAY_LEN(kinds); i++) {
        if (!strcmp(argv[1], kinds[i]->name + strlen("capture ")))
            return kinds[i]->run(kinds[i], argc - 1, argv + 1);
    }
    if (argc == 2 && !strcmp(argv[1], CLI_DESCRIBE)) {
        int r = CLI_OK;

        for (size_t i = 0; !r && i < ARRAY_LEN(kinds); i++)
            r = kinds[i]->run(kinds[i], argc, argv);
        return r;
    }
    if (argc > 1 && strcmp(argv[1], "--help") != 0 && strcmp(argv[1], "-h") != 0)
        return cli_usage_error(cmd, "unknown kind of capture `%s`;%s use array or rig", argv[1],
                               sst_edit_hint(argv[1], (const char *const[]){ "array", "rig", NULL }));
    printf("sst capture - %s\n\nusage: sst capture KIND ...\n\nkinds:\n", cli_manual(cmd)->summary);
    for (size_t i = 0; i < ARRAY_LEN(kinds); i++)
        printf("  %-10s %s\n", kinds[i]->name + strlen("capture "), cli_manual(kinds[i])->summary);
    printf("\n`sst capture KIND --help` explains one with an example.\n\nexample:\n  %s\n", cli_manual(cmd)->example);
    return argc > 1 ? CLI_OK : CLI_USAGE;
}

const struct cli_command cli_capture = { "capture", run };
