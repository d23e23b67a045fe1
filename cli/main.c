/* sst: the command line. One file per subcommand; this one dispatches. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <malloc.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "base/edit_distance.h"
#include "base/file.h"
#include "base/log.h"
#include "cli/cli_internal.h"
#include "cli/shard_internal.h"

#define LARGE_BYTES (32 << 20)  /* blocks from here on are the system's again when they are freed */
#define KEPT_BYTES  (256 << 20) /* freed memory that is kept at most */

static const struct cli_command *const commands[] = {
    &cli_demo,     &cli_scene,  &cli_import,      &cli_poses,   &cli_recording, &cli_export,  &cli_rectify,
    &cli_process,  &cli_batch,  &cli_render,      &cli_sweep,   &cli_find,      &cli_stereo,  &cli_segment,
    &cli_models,   &cli_eval,   &cli_board,       &cli_capture, &cli_calibrate, &cli_cameras, &cli_identify,
    &cli_topology, &cli_plan,   &cli_calibration, &cli_doctor,  &cli_status,    &cli_events,  &cli_snapshot,
    &cli_record,   &cli_verify, &cli_reload,      &cli_token,   &cli_audit,     &cli_version,
};

static void usage(void)
{
    printf("sst - see through things with a camera array\n\nusage: sst COMMAND ...\n\ncommands:\n");
    for (size_t i = 0; i < ARRAY_LEN(commands); i++)
        printf("  %-11s %s\n", commands[i]->name, cli_manual(commands[i])->summary);
    printf(
        "\n`sst COMMAND --help` explains a command with an example.\n\n"
        "exit codes: 0 success, 1 internal error, 2 usage, 3 input, 4 output, 5 missing part or model, or no service,\n"
        "            6 memory, 130 interrupted\n");
}

/* Describe all commands as lines of JSON: see CLI_DESCRIBE. */
static int describe(void)
{
    char word[] = CLI_DESCRIBE;
    int r = CLI_OK;

    for (size_t i = 0; !r && i < ARRAY_LEN(commands); i++)
        r = commands[i]->run(commands[i], 2, (char *[]){ NULL, word, NULL });
    return r;
}

/* Memory that one step of a command frees is the next one's: the system clears each page before it gives it. */
static void keep_memory(void)
{
    mallopt(M_ARENA_MAX, 1);
    mallopt(M_MMAP_THRESHOLD, LARGE_BYTES);
    mallopt(M_TRIM_THRESHOLD, KEPT_BYTES);
}

static int dispatch(int argc, char **argv)
{
    const char *names[ARRAY_LEN(commands) + 1] = { NULL };

    if (argc < 2) {
        usage();
        return CLI_USAGE;
    }
    if (argc == 3 && !strcmp(argv[1], "help")) {
        argv[1] = argv[2];
        argv[2] = (char *)"--help";
    }
    if (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h") || !strcmp(argv[1], "help")) {
        usage();
        return CLI_OK;
    }
    if (!strcmp(argv[1], CLI_DESCRIBE))
        return describe();
    if (!strcmp(argv[1], "--version"))
        argv[1] = (char *)"version";
    for (size_t i = 0; i < ARRAY_LEN(commands); i++) {
        if (!strcmp(argv[1], commands[i]->name))
            return commands[i]->run(commands[i], argc - 1, argv + 1);
    }
    for (size_t i = 0; i < ARRAY_LEN(commands); i++)
        names[i] = commands[i]->name;
    sst_log_error("unknown command `%s`;%s `sst --help` lists the commands", argv[1], sst_edit_hint(argv[1], names));
    return CLI_USAGE;
}

int main(int argc, char **argv)
{
    int code;

    keep_memory();
    if (sst_file_clean_on_interrupt())
        return CLI_MEMORY;
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN); /* a file-size limit is an output error like a full disk */
    code = dispatch(argc, argv);
    /* Commands take any failure to print a report for a lack of memory. */
    return cli_flush() && (code == CLI_OK || code == CLI_MEMORY) ? CLI_OUTPUT : code;
}
