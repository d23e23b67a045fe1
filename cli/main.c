/* sst: see through things with a camera array. One file per subcommand; this one finds it. */
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "cli/cli.h"

static const struct cli_command *const commands[] = {
    &cli_demo,
    &cli_scene,
    &cli_import,
    &cli_recording,
    &cli_export,
    &cli_rectify,
    &cli_process,
    &cli_render,
    &cli_sweep,
    &cli_stereo,
    &cli_segment,
    &cli_models,
    &cli_eval,
    &cli_board,
    &cli_capture,
    &cli_calibrate,
    &cli_cameras,
    &cli_identify,
    &cli_topology,
    &cli_plan,
    &cli_calibration,
    &cli_doctor,
    &cli_version,
};

static void usage(void)
{
    printf("sst - see through things with a camera array\n\nusage: sst COMMAND ...\n\ncommands:\n");
    for (size_t i = 0; i < ARRAY_LEN(commands); i++)
        printf("  %-11s %s\n", commands[i]->name, commands[i]->summary);
    printf("\n`sst COMMAND --help` explains a command with an example.\n\n"
           "exit codes: 0 success, 1 internal error, 2 usage, 3 input, 4 output, 5 missing part or model, 6 memory,\n"
           "            130 interrupted\n");
}

static void on_signal(int sig)
{
    if (sst_file_abort_all())
        _exit(sig == SIGINT ? CLI_INTERRUPTED : 128 + sig);
}

int main(int argc, char **argv)
{
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN); /* a file-size limit is an output error like a full disk */
    if (argc < 2) {
        usage();
        return CLI_USAGE;
    }
    if (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h") || !strcmp(argv[1], "help")) {
        usage();
        return CLI_OK;
    }
    if (!strcmp(argv[1], "--version"))
        argv[1] = (char *)"version";
    for (size_t i = 0; i < ARRAY_LEN(commands); i++) {
        if (!strcmp(argv[1], commands[i]->name))
            return commands[i]->run(commands[i], argc - 1, argv + 1);
    }
    sst_log_error("there is no command %s; `sst --help` lists them", argv[1]);
    return CLI_USAGE;
}
