/* Programs that a command starts, and their log. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/log.h"
#include "cli/cli_internal.h"

pid_t cli_start_program(const char *const argv[], const char *out, const char *log)
{
    pid_t pid;

    fflush(stdout);
    pid = fork();
    if (pid)
        return pid < 0 ? -errno : pid;
    prctl(PR_SET_PDEATHSIG, SIGTERM); /* a command that is killed leaves nothing behind */
    setpgid(0, 0);
    if (!freopen(log, "a", stderr) || !freopen("/dev/null", "r", stdin))
        _exit(127);
    if (out ? !freopen(out, "w", stdout) : dup2(2, 1) < 0)
        _exit(127);
    signal(SIGPIPE, SIG_DFL);
    execv(argv[0], (char *const *)(uintptr_t)argv);
    _exit(127);
}

int cli_run_program(const char *const argv[], const char *out, const char *log)
{
    const pid_t pid = cli_start_program(argv, out, log);
    int status;

    if (pid < 0)
        return pid;
    while (waitpid(pid, &status, 0) < 0) {
        if (errno != EINTR)
            return -errno;
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

void cli_last_error(const char *log, char *out, size_t size)
{
    static const char prefix[] = "sst: error: ";
    char line[SST_LOG_MAX];
    FILE *f = fopen(log, "re");

    out[0] = 0;
    while (f && fgets(line, sizeof(line), f))
        if (!strncmp(line, prefix, strlen(prefix)))
            snprintf(out, size, "%s", line + strlen(prefix));
    if (f)
        fclose(f);
    out[strcspn(out, "\n")] = 0;
}
