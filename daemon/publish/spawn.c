#define _GNU_SOURCE /* posix_spawn_file_actions_addclosefrom_np */

#include "daemon/publish/publish_internal.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>

static int set_descriptors(posix_spawn_file_actions_t *files, const int *fd, int fds)
{
    int err = 0;

    for (int i = 0; i < fds && !err; i++)
        err = fd[i] < 0 ? posix_spawn_file_actions_addopen(files, i, "/dev/null", O_RDONLY, 0)
                        : posix_spawn_file_actions_adddup2(files, fd[i], i);
    return err ? err : posix_spawn_file_actions_addclosefrom_np(files, fds);
}

static int set_attributes(posix_spawnattr_t *attr)
{
    sigset_t none, all;
    int err;

    sigemptyset(&none);
    sigfillset(&all);
    err = posix_spawnattr_setpgroup(attr, 0);
    err = err ? err : posix_spawnattr_setsigmask(attr, &none);
    err = err ? err : posix_spawnattr_setsigdefault(attr, &all);
    return err ? err
               : posix_spawnattr_setflags(attr, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
}

int spawn_program(pid_t *pid, char *const argv[], char *const env[], const int *fd, int fds)
{
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attr;
    int err = posix_spawn_file_actions_init(&files);

    if (err)
        return -err;
    err = posix_spawnattr_init(&attr);
    if (!err) {
        err = set_descriptors(&files, fd, fds);
        err = err ? err : set_attributes(&attr);
        err = err ? err : posix_spawn(pid, argv[0], &files, &attr, argv, env);
        posix_spawnattr_destroy(&attr);
    }
    posix_spawn_file_actions_destroy(&files);
    return -err;
}
