/* tests/sim_session.h - runs a test program on simulated devices and sets faults of them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_SIM_SESSION_H
#define SST_TESTS_SIM_SESSION_H

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static inline const char *session_program(char path[512])
{
    const char *build = getenv("SST_BUILD");

    snprintf(path, 512, "%s/sst-sim", build ? build : "build");
    return path;
}

/** "gpio.busy=1". @return 0 when it is set */
static inline int session_fault(const char *fault)
{
    char program[512], command[1024];

    snprintf(command, sizeof(command), "%s fault %s", session_program(program), fault);
    return system(command);
}

/** Outside a session: run this program once more, inside one of a world. @return 0 inside, else the exit code */
static inline int session_enter_world(char **argv, const char *world)
{
    char program[512];

    if (getenv("SST_SIM_DIR"))
        return 0;
    if (access(session_program(program), X_OK)) {
        printf("%s is not built\n", program);
        return 77;
    }
    execl(program, "sst-sim", "--quiet", "--rig-port", "0", "--world", world, "--", argv[0], (char *)NULL);
    perror(program);
    return 1;
}

/** The same with a whole array. */
static inline int session_enter(char **argv)
{
    return session_enter_world(argv, "simulators/scene/world/worlds/quick.yaml");
}

#endif
