/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "config/program.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/file.h"
#include "base/log.h"

#define EXIT_USAGE  2
#define EXIT_OUTPUT 4
#define EXIT_CONFIG 78 /* systemd does not start it again: RestartPreventExitStatus */

/* @return exit status after help or version */
static int printed(void)
{
    return sst_file_flush_output() ? EXIT_OUTPUT : EXIT_SUCCESS;
}

int sst_program_begin(struct sst_program *p, struct sst_config *config, int argc, char **argv)
{
    static const struct option options[] = {
        { "check", no_argument, NULL, 'k' },
        { "config", required_argument, NULL, 'c' },
        { "socket", required_argument, NULL, 's' },
        { "verbose", no_argument, NULL, 'v' },
        { "version", no_argument, NULL, 'V' },
        { "help", no_argument, NULL, 'h' },
        { NULL, 0, NULL, 0 },
    };
    int c, level = SST_LOG_WARNING;
    bool check = false;

    while ((c = getopt_long(argc, argv, "hv", options + !p->checks, NULL)) != -1) {
        switch (c) {
        case 'k':
            check = true;
            break;
        case 'c':
            p->config = optarg;
            break;
        case 's':
            p->socket = optarg;
            break;
        case 'v':
            level++;
            break;
        case 'V':
            printf("%s %s\n", p->name, SST_VERSION);
            return printed();
        case 'h':
            fputs(p->help, stdout);
            return printed();
        default:
            return EXIT_USAGE;
        }
    }
    if (optind < argc) {
        fprintf(stderr, "sst: error: %s has no argument %s; see %s --help\n", p->name, argv[optind], p->name);
        return EXIT_USAGE;
    }
    sst_log_set_level((enum sst_log_level)(level > SST_LOG_DEBUG ? SST_LOG_DEBUG : level));
    sst_log_use_journal(getenv("JOURNAL_STREAM") != NULL);
    sst_config_defaults(config);
    if (sst_config_read(config, p->config))
        return EXIT_CONFIG;
    if (check)
        return EXIT_SUCCESS;
    sst_log_never_wait();
    return SST_PROGRAM_GO_ON;
}
