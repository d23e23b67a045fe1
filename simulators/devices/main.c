/* sst-sim: runs any program on simulated devices. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.h"
#include "simulators/devices/devices_internal.h"
#include "simulators/devices/sysfs_internal.h"

#define EXIT_USAGE  2
#define EXIT_INPUT  3
#define EXIT_OUTPUT 4
#define FAULTS_MAX 64

__asm__(".section .rodata\nsim_help: .incbin \"simulators/devices/help.txt\"\n.byte 0\n.previous");
extern const char sim_help[];

struct arguments {
    struct sim_options options;
    const char *faults[FAULTS_MAX];
    const char *serve, *join, *dir, *parameters;
    bool list, json;
};

static int usage(const char *text)
{
    fprintf(stderr, "sst-sim: error: %s; see 'sst-sim --help'\n", text);
    return EXIT_USAGE;
}

/* @return -1: not a port */
static int read_port(const char *text)
{
    char *end;
    const long port = strtol(text, &end, 10);

    return end == text || *end || port < 0 || port > 65535 ? -1 : (int)port;
}

/* @return 0, or exit status + 1 */
static int read_options(int argc, char **argv, struct arguments *a)
{
    struct sim_options *o = &a->options;
    const char **const texts[] = { &o->world, &o->cache, &o->wires.usb, &o->truth,     &o->stats,
                                   &a->serve, &a->join,  &a->dir,       &a->parameters };
    bool *const flags[] = { &o->wires.rig, &o->quiet, &a->list, &a->json, &o->at_once };
    static const struct option options[] = {
        { "world", required_argument }, /* the texts above */
        { "cache", required_argument },
        { "usb", required_argument },
        { "truth", required_argument },
        { "stats", required_argument },
        { "serve", required_argument },
        { "join", required_argument },
        { "dir", required_argument },
        { "parameters", required_argument },
        { "rig", no_argument }, /* the flags above */
        { "quiet", no_argument },
        { "list", no_argument },
        { "json", no_argument },
        { "at-once", no_argument },
        { "fault", required_argument, NULL, 'f' },
        { "rig-port", required_argument, NULL, 'p' },
        { "triggers", required_argument, NULL, 'T' },
        { "help", no_argument, NULL, 'h' },
        { NULL },
    };
    int c, index;

    while ((c = getopt_long(argc, argv, "+h", options, &index)) != -1) {
        switch (c) {
        case 0:
            if (index < (int)ARRAY_LEN(texts))
                *texts[index] = optarg;
            else
                *flags[index - (int)ARRAY_LEN(texts)] = true;
            break;
        case 'T':
            if (strcmp(optarg, "rows") != 0 && strcmp(optarg, "one") != 0)
                return usage("--triggers takes rows or one") + 1;
            o->wires.one_trigger = strcmp(optarg, "one") == 0;
            break;
        case 'p':
            o->wires.rig_port = read_port(optarg);
            if (o->wires.rig_port < 0)
                return usage("--rig-port takes 0 to 65535") + 1;
            break;
        case 'f':
            if (o->fault_count == FAULTS_MAX)
                return usage("too many --fault") + 1;
            a->faults[o->fault_count++] = optarg;
            break;
        case 'h':
            (void)fputs(sim_help, stdout);
            return 1;
        default:
            return usage("unknown option or a value is missing") + 1;
        }
    }
    o->faults = a->faults;
    return 0;
}

/* Exit codes as sst's: 3 for bad input, 4 for failed output, 1 for the rest. */
static int exit_status(int err)
{
    switch (-err) {
    case 0:
        return 0;
    case EEXIST:
    case ENOSPC:
    case EROFS:
    case EDQUOT:
        return EXIT_OUTPUT;
    case ENOMEM:
    case EMFILE:
    case ENFILE:
    case EAGAIN:
    case EIO:
        return EXIT_FAILURE;
    default:
        return EXIT_INPUT;
    }
}

/* --- a session ---------------------------------------------------------------------------------------------------- */

struct run {
    struct sim_command command;
    struct sim_server *server;
};

static void signalled(void *arg)
{
    struct run *run = arg;

    if (sim_command_signal(&run->command))
        sim_server_stop(run->server);
}

/* Each buffer's memory is a descriptor here. The command is already started and keeps its own limit. */
static void raise_limit(void)
{
    struct rlimit limit;

    if (getrlimit(RLIMIT_NOFILE, &limit) == 0) {
        limit.rlim_cur = limit.rlim_max;
        (void)setrlimit(RLIMIT_NOFILE, &limit);
    }
}

/* Serve a session in a folder, for a command or until a signal or 'stop'. @return exit status */
static int serve(struct sim_simulator *sim, const char *dir, char *const argv[])
{
    struct run run = { .command.signals = -1 };
    int err = sim_command_prepare(&run.command), status;

    err = err ? err : sim_simulator_start(sim, dir);
    if (!err && argv)
        err = sim_session_enter(dir);
    if (!err && argv && sim_command_start(&run.command, argv))
        run.command.status = err = 127;
    run.server = sim_simulator_server(sim);
    err = err ? err : sim_watch(run.server, run.command.signals, signalled, &run);
    if (!err) {
        raise_limit();
        err = sim_server_run(run.server);
    }
    status = err && !run.command.status ? exit_status(err) : run.command.status;
    sim_command_close(&run.command);
    return status;
}

/* The folder is removed at the end, so it must be new or empty. */
static int use_folder(const char *name, char dir[SST_PATH_MAX])
{
    if (!name)
        return sim_session_make(dir);
    if ((rmdir(name) < 0 && errno != ENOENT) || mkdir(name, 0700) < 0 || !realpath(name, dir)) {
        sst_log_error("cannot use session folder '%s': %s; give a new or an empty one", name, strerror(errno));
        return -EEXIST;
    }
    return 0;
}

static int run_session(const struct arguments *a, char *const argv[])
{
    struct sim_simulator *sim = NULL;
    char dir[SST_PATH_MAX];
    int status, err;

    /* Only while the world is prepared; later signals are blocked and handled by the event loop. */
    if (sst_file_clean_on_interrupt())
        return EXIT_FAILURE;
    err = sim_simulator_open(&sim, &a->options);
    if (err)
        return exit_status(err);
    err = use_folder(a->serve, dir);
    status = exit_status(err);
    if (!err) {
        status = serve(sim, dir, argv);
        sim_simulator_close(sim);
        sst_path_remove_tree(dir);
    } else {
        sim_simulator_close(sim);
    }
    return status;
}

static int join(const char *folder, char *const argv[])
{
    char dir[SST_PATH_MAX], answer[SST_SIM_PAYLOAD_MAX];

    if (!realpath(folder, dir)) {
        sst_log_error("session '%s': %s; start it with 'sst-sim --serve %s'", folder, strerror(errno), folder);
        return EXIT_INPUT;
    }
    if (sim_session_ask(dir, SST_SIM_STATUS, "", answer, sizeof(answer)) < 0 || sim_session_enter(dir))
        return EXIT_FAILURE;
    (void)execvp(argv[0], argv);
    sst_log_error("cannot run '%s': %s", argv[0], strerror(errno));
    return 127;
}

/* --- queries ------------------------------------------------------------------------------------------------------ */

static int set_faults(const char *dir, int argc, char **argv)
{
    char answer[SST_SIM_PAYLOAD_MAX];

    if (!argc)
        return usage("fault needs NAME=VALUE or --list");
    for (int i = 0; i < argc; i++) {
        const int err = sim_session_ask(dir, SST_SIM_FAULT, argv[i], answer, sizeof(answer));

        if (err < 0) {
            if (*answer)
                sst_log_error("%s", answer);
            return exit_status(err);
        }
    }
    return 0;
}

static int ask(const char *dir, unsigned op)
{
    char answer[SST_SIM_PAYLOAD_MAX] = "";
    const int err = sim_session_ask(dir, op, "", answer, sizeof(answer));

    if (err >= 0 && *answer)
        printf("%s%s", answer, answer[strlen(answer) - 1] == '\n' ? "" : "\n");
    return err < 0 ? exit_status(err) : 0;
}

/* Without a session: all faults. */
static int list_faults(void)
{
    const struct sim_fault_scope *const kinds[] = { &sim_world_faults, &sim_camera_faults, &sim_gpio_faults,
                                                    &sim_usb_faults,   &sim_hub_faults,    &sim_still_faults };

    for (size_t i = 0; i < ARRAY_LEN(kinds); i++)
        sim_fault_scope_print(stdout, kinds[i]);
    (void)fputs(sim_rig_faults, stdout);
    return 0;
}

static int status(const char *dir, bool json)
{
    char answer[SST_SIM_PAYLOAD_MAX] = "";
    json_t *all;
    int present = 0;
    size_t i;
    json_t *cam;

    if (json)
        return ask(dir, SST_SIM_STATUS);
    if (sim_session_ask(dir, SST_SIM_STATUS, "", answer, sizeof(answer)) < 0)
        return EXIT_FAILURE;
    all = json_loads(answer, 0, NULL);
    json_array_foreach(json_object_get(all, "cameras"), i, cam) present +=
        json_integer_value(json_object_get(cam, "node")) >= 0;
    printf("session %s: %d of %d cameras there, %lld frames made in %.1f s, %.1f %% of one core\n", dir, present,
           (int)json_array_size(json_object_get(all, "cameras")),
           (long long)json_integer_value(json_object_get(all, "frames")),
           json_real_value(json_object_get(all, "seconds")), json_real_value(json_object_get(all, "cpu_percent")));
    json_decref(all);
    return ask(dir, SST_SIM_FAULTS);
}

/* fault, status, stop */
static int question(int argc, char **argv)
{
    struct arguments a = { 0 };
    const char *verb = argv[0];
    int bad;

    bad = read_options(argc, argv, &a);
    if (bad)
        return bad - 1;
    if (!a.dir)
        a.dir = getenv(SST_SIM_DIR_ENV);
    if (!a.dir && a.list && strcmp(verb, "fault") == 0)
        return list_faults();
    if (!a.dir)
        return usage("not inside a session: give --dir DIR");
    argc -= optind;
    argv += optind;
    if (strcmp(verb, "fault") == 0)
        return a.list ? ask(a.dir, SST_SIM_FAULTS) : set_faults(a.dir, argc, argv);
    if (argc)
        return usage("too many arguments");
    return strcmp(verb, "status") == 0 ? status(a.dir, a.json) : ask(a.dir, SST_SIM_STOP);
}

static int dispatch(int argc, char **argv)
{
    struct arguments a = { 0 };
    int bad;

    if (argc > 1 && (strcmp(argv[1], "fault") == 0 || strcmp(argv[1], "status") == 0 || strcmp(argv[1], "stop") == 0))
        return question(argc - 1, argv + 1);
    bad = read_options(argc, argv, &a);
    if (bad)
        return bad - 1;
    if (optind > 1 && strcmp(argv[optind - 1], "--") != 0 && optind < argc)
        return usage("write -- before the command");
    bad = a.parameters ? sst_sim_world_parameters(a.options.world, a.parameters) : 0;
    if (bad)
        return exit_status(bad);
    if (a.parameters && !a.serve && !a.join && optind >= argc)
        return 0;
    if (a.serve)
        return optind < argc ? usage("--serve takes no command") : run_session(&a, NULL);
    if (optind >= argc)
        return usage("no command given");
    return a.join ? join(a.join, argv + optind) : run_session(&a, argv + optind);
}

int main(int argc, char **argv)
{
    const int code = dispatch(argc, argv);

    return sst_file_flush_output() && !code ? EXIT_OUTPUT : code;
}
