/* simulators/devices/session.h - a folder that programs find their devices by, and the command that runs in it. */
#ifndef SST_SIMULATORS_DEVICES_SESSION_H
#define SST_SIMULATORS_DEVICES_SESSION_H

#include <signal.h>
#include <stdbool.h>

#include "base/file.h"

/** Make a new folder for a session in $XDG_RUNTIME_DIR, /dev/shm or /tmp, for this user alone; folders there of
 * sessions that were killed are removed. @return 0 or -errno, logged. */
SST_MUST_CHECK int sst_sim_session_make(char dir[SST_PATH_MAX]);

/**
 * Set up this process's environment for programs of a session: SST_SIM_DIR and LD_PRELOAD.
 * @param further  another library to preload after ours, or NULL
 * @return 0, -ENOENT (the preload library is not where it should be) or -errno, logged.
 */
SST_MUST_CHECK int sst_sim_session_enter(const char *dir, const char *further);

/** The command that a session is there for. */
struct sst_sim_command {
    int pid;       /* and process group; 0: has ended */
    int signals;   /* signalfd: readable when sst_sim_command_signal() has something to do */
    bool terminal; /* it was given the terminal */
    int status;    /* exit status, 128 + signal */
    sigset_t mask; /* signals blocked before */
};

/** Block the signals that end programs, before there are threads, and have them and the end of children told by
 *  c->signals. @return 0 or -errno, logged. */
SST_MUST_CHECK int sst_sim_command_prepare(struct sst_sim_command *c);

/** Start argv in a process group of its own. @return 0, -ENOENT/-EACCES... (it cannot be executed) or -errno; logged.
 */
SST_MUST_CHECK int sst_sim_command_start(struct sst_sim_command *c, char *const argv[]);

/** Pass a signal on, or take the command's end. @return true: it has ended (or, without a command, a signal came). */
bool sst_sim_command_signal(struct sst_sim_command *c);

/** End a command that still runs, and give the terminal back. A zeroed struct is fine. */
void sst_sim_command_close(struct sst_sim_command *c);

/** Ask a session: see enum sst_sim_op. @param answer  out, [size], text. @return the answer's result or -errno. */
SST_MUST_CHECK int sst_sim_session_ask(const char *dir, unsigned op, const char *text, char *answer, size_t size);

#endif
