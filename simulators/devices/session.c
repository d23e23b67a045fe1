/* Sessions: folder, environment, command, queries. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "simulators/devices/devices_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/log.h"
#include "simulators/devices/proto.h"

#define FOLDER  "sst-sim-"
#define PRELOAD "libsst-sim-preload.so"

/* True if the folder's sst-sim no longer listens because it was killed. A recent session may not listen yet. */
static bool is_dead(const char *dir)
{
    struct sockaddr_un name = { .sun_family = AF_UNIX };
    struct stat st;
    bool dead;
    int fd;

    if (stat(dir, &st) < 0 || st.st_uid != geteuid() || time(NULL) - st.st_mtime < 60 ||
        snprintf(name.sun_path, sizeof(name.sun_path), "%s/" SST_SIM_SOCKET, dir) >= (int)sizeof(name.sun_path))
        return false;
    fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    dead = fd >= 0 && connect(fd, (const struct sockaddr *)&name, sizeof(name)) < 0 && errno == ECONNREFUSED;
    if (fd >= 0)
        close(fd);
    return dead;
}

static void remove_dead(const char *parent)
{
    char pattern[SST_PATH_MAX];
    glob_t found;

    (void)snprintf(pattern, sizeof(pattern), "%s/" FOLDER "*", parent);
    if (glob(pattern, GLOB_NOSORT, NULL, &found) == 0)
        for (size_t i = 0; i < found.gl_pathc; i++)
            if (is_dead(found.gl_pathv[i]))
                sst_path_remove_tree(found.gl_pathv[i]);
    globfree(&found);
}

int sim_session_make(char dir[SST_PATH_MAX])
{
    const char *runtime = getenv("XDG_RUNTIME_DIR");

    /* A socket's path holds 107 characters. */
    if (!runtime || runtime[0] != '/' || strlen(runtime) > 64 || access(runtime, W_OK) < 0)
        runtime = access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp"; /* thousands of small files: avoid a disk */
    remove_dead(runtime);
    (void)snprintf(dir, SST_PATH_MAX, "%s/" FOLDER "XXXXXX", runtime);
    if (!mkdtemp(dir)) {
        const int err = -errno;

        sst_log_error("cannot create a session folder in '%s': %s", runtime, strerror(-err));
        return err;
    }
    return 0;
}

/* --- environment -------------------------------------------------------------------------------------------------- */

static int find_preload(char out[SST_PATH_MAX])
{
    int err = sst_path_beside_program(out, PRELOAD);

    if (!err && !sst_path_exists(out))
        err = sst_path_beside_program(out, "../" SST_PLUGINDIR "/" PRELOAD); /* installed location */
    if (!err && !sst_path_exists(out)) {
        err = sst_path_beside_program(out, "");
        sst_log_error("preload library '%s' is not beside the program in '%s'; build it with 'make'", PRELOAD, out);
        return err ? err : -ENOENT;
    }
    return err;
}

/* LD_PRELOAD cannot hold a path with a space or colon: such a library gets a link in the session's folder. */
static int name_preload(const char *dir, char path[SST_PATH_MAX])
{
    char name[SST_PATH_MAX];
    int err;

    if (!strpbrk(path, " :"))
        return 0;
    err = sst_path_join(name, dir, PRELOAD);
    if (!err && symlink(path, name) < 0 && errno != EEXIST)
        err = -errno;
    if (!err && strpbrk(name, " :"))
        err = -EINVAL;
    if (err)
        sst_log_error("preload library '%s' cannot be loaded from a path with a space or colon, nor as '%s' (%s); "
                      "set XDG_RUNTIME_DIR to another folder",
                      path, name, strerror(-err));
    else
        strcpy(path, name);
    return err;
}

#if defined(__SANITIZE_ADDRESS__)
/* Sanitized programs must accept a library that is loaded before the sanitizer's. */
static int allow_preload(void)
{
    const char *old = getenv("ASAN_OPTIONS");
    char text[1024];

    (void)snprintf(text, sizeof(text), "%s%sverify_asan_link_order=0", old ? old : "", old ? ":" : "");
    return setenv("ASAN_OPTIONS", text, 1) < 0 ? -errno : 0;
}
#else
static int allow_preload(void)
{
    return 0;
}
#endif

int sim_session_enter(const char *dir)
{
    const char *old = getenv("LD_PRELOAD");
    char preload[SST_PATH_MAX], all[2 * SST_PATH_MAX];
    int err = find_preload(preload);

    err = err ? err : name_preload(dir, preload);
    if (err)
        return err;
    if (snprintf(all, sizeof(all), "%s%s%s", preload, old && *old ? ":" : "", old ? old : "") >= (int)sizeof(all))
        return -ENAMETOOLONG;
    if (setenv("LD_PRELOAD", all, 1) < 0 || setenv(SST_SIM_DIR_ENV, dir, 1) < 0)
        err = -errno;
    return err ? err : allow_preload();
}

/* --- the command -------------------------------------------------------------------------------------------------- */

static void forwarded(sigset_t *set)
{
    sigemptyset(set);
    sigaddset(set, SIGINT);
    sigaddset(set, SIGTERM);
    sigaddset(set, SIGHUP);
    sigaddset(set, SIGQUIT);
    sigaddset(set, SIGUSR1);
    sigaddset(set, SIGUSR2);
}

/* Make a process group the terminal's foreground; this process may then be in the background and must not be
 * stopped. */
static void set_foreground(int group)
{
    sigset_t out, old;

    sigemptyset(&out);
    sigaddset(&out, SIGTTOU);
    (void)sigprocmask(SIG_BLOCK, &out, &old);
    (void)tcsetpgrp(STDIN_FILENO, group);
    (void)sigprocmask(SIG_SETMASK, &old, NULL);
}

static void run_child(char *const argv[], bool terminal, int report, const sigset_t *mask, pid_t parent)
{
    int err;

    (void)prctl(PR_SET_PDEATHSIG, SIGTERM); /* its devices are gone with the simulator */
    if (getppid() != parent)
        _exit(127);
    (void)setpgid(0, 0);
    if (terminal)
        set_foreground(getpid());
    (void)sigprocmask(SIG_SETMASK, mask, NULL);
    (void)execvp(argv[0], argv);
    err = errno;
    (void)!write(report, &err, sizeof(err));
    _exit(127);
}

int sim_command_prepare(struct sim_command *c)
{
    sigset_t set;
    int err;

    *c = (struct sim_command){ .signals = -1 };
    forwarded(&set);
    sigaddset(&set, SIGCHLD);
    if (sigprocmask(SIG_BLOCK, &set, &c->mask) == 0 &&
        (c->signals = signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK)) >= 0)
        return 0;
    err = -errno;
    sst_log_error("simulator: cannot create a signalfd: %s", strerror(-err));
    return err;
}

int sim_command_start(struct sim_command *c, char *const argv[])
{
    const pid_t self = getpid();
    int report[2], err = 0, why;

    if (pipe2(report, O_CLOEXEC) < 0)
        return -errno;
    c->terminal = isatty(STDIN_FILENO) && tcgetpgrp(STDIN_FILENO) == getpgrp();
    c->pid = fork();
    if (c->pid == 0)
        run_child(argv, c->terminal, report[1], &c->mask, self);
    if (c->pid < 0) {
        err = -errno;
        c->pid = 0;
    } else {
        (void)setpgid(c->pid, c->pid);
    }
    close(report[1]);
    if (!err && read(report[0], &why, sizeof(why)) == sizeof(why))
        err = -why;
    close(report[0]);
    if (err)
        sst_log_error("cannot run '%s': %s", argv[0], strerror(-err));
    return err;
}

/* Stopped from the terminal: return it to the shell, and continue together with the command. */
static void stop_together(const struct sim_command *c)
{
    if (!c->terminal)
        return;
    set_foreground(getpgrp());
    (void)raise(SIGSTOP);
    set_foreground(c->pid);
    (void)kill(-c->pid, SIGCONT);
}

static bool reap(struct sim_command *c)
{
    int status;

    if (!c->pid || waitpid(c->pid, &status, WNOHANG | WUNTRACED) != c->pid)
        return false;
    if (WIFSTOPPED(status)) {
        stop_together(c);
        return false;
    }
    c->status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    c->pid = 0;
    return true;
}

bool sim_command_signal(struct sim_command *c)
{
    struct signalfd_siginfo info;
    bool ended = false;

    while (read(c->signals, &info, sizeof(info)) == sizeof(info)) {
        if (info.ssi_signo == SIGCHLD)
            ended = reap(c) || ended;
        else if (c->pid)
            (void)kill(-c->pid, (int)info.ssi_signo);
        else if (info.ssi_signo != SIGUSR1 && info.ssi_signo != SIGUSR2)
            ended = true;
    }
    return ended;
}

void sim_command_close(struct sim_command *c)
{
    if (c->pid > 0) {
        (void)kill(-c->pid, SIGKILL);
        (void)waitpid(c->pid, NULL, 0);
    }
    if (c->terminal)
        set_foreground(getpgrp());
    if (c->signals > 0)
        close(c->signals);
    *c = (struct sim_command){ 0 };
}

/* --- queries ------------------------------------------------------------------------------------------------------ */

int sim_session_ask(const char *dir, unsigned op, const char *text, char *answer, size_t size)
{
    struct sockaddr_un name = { .sun_family = AF_UNIX };
    struct sst_sim_call call = { .op = op };
    struct sst_sim_answer head;
    struct iovec out[2] = { { &call, sizeof(call) }, { (void *)text, strlen(text) } };
    struct iovec in[2] = { { &head, sizeof(head) }, { answer, size - 1 } };
    struct msghdr msg = { .msg_iov = out, .msg_iovlen = 2 };
    const struct timeval limit = { .tv_sec = 20 };
    ssize_t n = 0;
    int err = 0, fd;

    if (snprintf(name.sun_path, sizeof(name.sun_path), "%s/" SST_SIM_SOCKET, dir) >= (int)sizeof(name.sun_path))
        return -ENAMETOOLONG;
    fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return -errno;
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
    (void)setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof(limit)); /* also limits connecting */
    if (connect(fd, (const struct sockaddr *)&name, sizeof(name)) < 0 || sendmsg(fd, &msg, MSG_NOSIGNAL) < 0)
        err = -errno;
    msg = (struct msghdr){ .msg_iov = in, .msg_iovlen = 2 };
    if (!err) {
        do
            n = recvmsg(fd, &msg, 0);
        while (n < 0 && errno == EINTR); /* with a timeout the call is not restarted automatically */
        err = n < 0 ? -errno : n < (ssize_t)sizeof(head) ? -EPIPE : 0;
    }
    close(fd);
    if (err) {
        sst_log_error("session '%s': no answer: %s; is its sst-sim still running?", dir, strerror(-err));
        return err;
    }
    answer[n - (ssize_t)sizeof(head)] = 0;
    return head.result;
}
