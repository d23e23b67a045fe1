/* Interposed libc functions that work on descriptors. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "simulators/devices/preload/preload_internal.h"

/* Convert a kernel result to a libc result with errno. */
static int libc_result(int result)
{
    if (result >= 0)
        return result;
    errno = -result;
    return -1;
}

/* --- open --------------------------------------------------------------------------------------------------------- */

/* @return true: *fd is the result, errno set if it is negative; false: call the next function with *path, which may
 * have changed */
static bool open_ours(int dirfd, const char **path, int flags, struct sim_path *p, int *fd)
{
    sim_path_resolve(dirfd, *path, !(flags & O_NOFOLLOW), p);
    if ((p->kind == SIM_PATH_NODE || (p->kind == SIM_PATH_ATTRIBUTE && (flags & O_ACCMODE) != O_RDONLY)) &&
        !(flags & O_PATH)) {
        *fd = libc_result(flags & O_DIRECTORY ? -ENOTDIR : sim_open_node(p->node, flags));
        return true;
    }
    if (p->kind == SIM_PATH_MISSING && !(flags & O_CREAT)) {
        *fd = libc_result(-ENOENT);
        return true;
    }
    if (p->kind != SIM_PATH_OTHER && (flags & O_ACCMODE) != O_RDONLY && sim_path_in_sysfs(p)) {
        *fd = libc_result(-EACCES); /* nothing else there can be written or created */
        return true;
    }
    if (p->kind != SIM_PATH_OTHER)
        *path = p->real;
    return false;
}

int sim_open_hook(int dirfd, const char *path, int flags, mode_t mode)
{
    struct sim_path p;
    int fd;

    if (open_ours(dirfd, &path, flags, &p, &fd))
        return fd;
    if (dirfd == AT_FDCWD)
        return sim_next()->open_(path, flags, mode);
    return sim_next()->openat_(dirfd, path, flags, mode);
}

#define MODE_OF(flags, mode)                                                                                           \
    mode_t mode = 0;                                                                                                   \
    if ((flags) & (O_CREAT | __O_TMPFILE)) {                                                                           \
        va_list args;                                                                                                  \
        va_start(args, flags);                                                                                         \
        mode = va_arg(args, mode_t);                                                                                   \
        va_end(args);                                                                                                  \
    }

HOOK int open(const char *path, int flags, ...)
{
    MODE_OF(flags, mode)
    return sim_open_hook(AT_FDCWD, path, flags, mode);
}

HOOK int open64(const char *path, int flags, ...)
{
    MODE_OF(flags, mode)
    return sim_open_hook(AT_FDCWD, path, flags | O_LARGEFILE, mode);
}

HOOK int openat(int dirfd, const char *path, int flags, ...)
{
    MODE_OF(flags, mode)
    return sim_open_hook(dirfd, path, flags, mode);
}

HOOK int openat64(int dirfd, const char *path, int flags, ...)
{
    MODE_OF(flags, mode)
    return sim_open_hook(dirfd, path, flags | O_LARGEFILE, mode);
}

/* Calls without a mode are replaced by these if the compiler checks them. */
#define OPEN_2_HOOK(name, large)                                                                                       \
    HOOK int name(const char *path, int flags);                                                                        \
    HOOK int name(const char *path, int flags)                                                                         \
    {                                                                                                                  \
        return sim_open_hook(AT_FDCWD, path, flags | (large), 0);                                                      \
    }
#define OPENAT_2_HOOK(name, large)                                                                                     \
    HOOK int name(int dirfd, const char *path, int flags);                                                             \
    HOOK int name(int dirfd, const char *path, int flags)                                                              \
    {                                                                                                                  \
        return sim_open_hook(dirfd, path, flags | (large), 0);                                                         \
    }

OPEN_2_HOOK(__open_2, 0)
OPEN_2_HOOK(__open64_2, O_LARGEFILE)
OPENAT_2_HOOK(__openat_2, 0)
OPENAT_2_HOOK(__openat64_2, O_LARGEFILE)

/* --- descriptors -------------------------------------------------------------------------------------------------- */

/* @return the class whose ioctls these are, or NULL: not ours. */
static const struct sim_class *class_of(int fd, struct sim_id *id)
{
    return sim_identify(fd, id) ? sim_class_find(id->letter) : NULL;
}

void sim_flush(int fd)
{
    const struct sim_class *class;
    struct sim_id id;

    if (sim_maybe(fd) && (class = class_of(fd, &id)) && class->late_writes) {
        struct sim_exchange x = { .call = { .op = SST_SIM_WRITE, .handle = id.handle }, .send_fd = -1 };

        (void)sim_exchange(&x); /* errors can no longer be reported */
    }
}

static int inherit(int from, int to)
{
    if (to >= 0 && sim_maybe(from))
        sim_mark(to);
    return to;
}

HOOK int close(int fd)
{
    if (sim_hidden(fd)) {
        errno = EBADF;
        return -1;
    }
    sim_flush(fd);
    return sim_next()->close_(fd);
}

HOOK int dup(int fd)
{
    NEXT(int, dup, int);
    return inherit(fd, next(fd));
}

HOOK int dup2(int fd, int to)
{
    NEXT(int, dup2, int, int);
    if (fd != to)
        sim_flush(to);
    return inherit(fd, next(fd, to));
}

HOOK int dup3(int fd, int to, int flags)
{
    NEXT(int, dup3, int, int, int);
    sim_flush(to);
    return inherit(fd, next(fd, to, flags));
}

#define FCNTL_HOOK(name)                                                                                               \
    HOOK int name(int fd, int command, ...)                                                                            \
    {                                                                                                                  \
        NEXT(int, name, int, int, ...);                                                                                \
        va_list args;                                                                                                  \
        int result;                                                                                                    \
        va_start(args, command);                                                                                       \
        result = next(fd, command, va_arg(args, void *));                                                              \
        va_end(args);                                                                                                  \
        return command == F_DUPFD || command == F_DUPFD_CLOEXEC ? inherit(fd, result) : result;                        \
    }

FCNTL_HOOK(fcntl)
FCNTL_HOOK(fcntl64)

/* --- ioctl, read, write, mmap ------------------------------------------------------------------------------------- */

static bool our_type(unsigned long request)
{
    for (int i = 0; i < sim_class_count; i++)
        if (sim_classes[i]->ioctl && (unsigned char)sim_classes[i]->ioctl_type == _IOC_TYPE(request))
            return true;
    return false;
}

HOOK int ioctl(int fd, unsigned long request, ...)
{
    const struct sim_class *class;
    struct sim_id id;
    va_list args;
    void *arg;

    va_start(args, request);
    arg = va_arg(args, void *);
    va_end(args);
    request &= 0xffffffff; /* some programs store it in an int */
    if (our_type(request) && (class = class_of(fd, &id)))
        return libc_result(class->ioctl && (unsigned char)class->ioctl_type == _IOC_TYPE(request)
                               ? class->ioctl(fd, &id, request, arg)
                               : -ENOTTY);
    return sim_next()->ioctl_(fd, request, arg);
}

static ssize_t transfer(int fd, const struct sim_id *id, uint32_t op, void *data, size_t bytes)
{
    const size_t part = bytes < SST_SIM_PAYLOAD_MAX ? bytes : SST_SIM_PAYLOAD_MAX;
    struct sim_exchange x = { .call = { .op = op, .handle = id->handle, .length = part }, .send_fd = -1 };
    int result;

    if (sim_next()->fcntl_(fd, F_GETFL) & O_NONBLOCK)
        x.call.flags |= SST_SIM_NONBLOCK;
    *(op == SST_SIM_WRITE ? &x.in[0] : &x.out[0]) = (struct iovec){ data, part };
    result = sim_exchange(&x);
    sim_settle(fd, id, &x.answer);
    return libc_result(result);
}

HOOK ssize_t read(int fd, void *data, size_t bytes)
{
    const struct sim_class *class;
    struct sim_id id;

    if (sim_maybe(fd) && (class = class_of(fd, &id)) && class->read_calls)
        return transfer(fd, &id, SST_SIM_READ, data, bytes);
    return sim_next()->read_(fd, data, bytes);
}

HOOK ssize_t __read_chk(int fd, void *data, size_t bytes, size_t room);
HOOK ssize_t __read_chk(int fd, void *data, size_t bytes, size_t room)
{
    NEXT(ssize_t, __read_chk, int, void *, size_t, size_t);

    return bytes <= room && sim_maybe(fd) ? read(fd, data, bytes) : next(fd, data, bytes, room);
}

HOOK ssize_t write(int fd, const void *data, size_t bytes)
{
    const struct sim_class *class;
    struct sim_id id;

    if (sim_maybe(fd) && (class = class_of(fd, &id)) && class->write_calls)
        return transfer(fd, &id, SST_SIM_WRITE, (void *)data, bytes);
    return sim_next()->write_(fd, data, bytes);
}

/* @return true: the file is ours, *position or errno is set */
static bool seek_ours(int fd, off_t offset, int whence, off_t *position)
{
    struct sim_exchange x = { .call = { .op = SST_SIM_SEEK, .cmd = (uint32_t)whence, .arg = (uint64_t)offset },
                              .send_fd = -1 };
    struct sim_id id;

    if (!sim_maybe(fd) || !sim_identify(fd, &id))
        return false;
    x.call.handle = id.handle;
    *position = libc_result(sim_exchange(&x)) < 0 ? -1 : (off_t)x.answer.arg;
    return true;
}

HOOK off_t lseek(int fd, off_t offset, int whence)
{
    NEXT(off_t, lseek, int, off_t, int);
    off_t position;

    return seek_ours(fd, offset, whence, &position) ? position : next(fd, offset, whence);
}

HOOK off64_t lseek64(int fd, off64_t offset, int whence)
{
    return lseek(fd, offset, whence);
}

HOOK void *mmap(void *address, size_t length, int prot, int flags, int fd, off_t offset)
{
    struct sim_exchange x;
    struct sim_id id;
    void *memory;
    int result;

    if (fd < 0 || (flags & MAP_ANONYMOUS) || !sim_identify(fd, &id))
        return sim_next()->mmap_(address, length, prot, flags, fd, offset);
    x = (struct sim_exchange){
        .call = { .op = SST_SIM_MAP,
                  .cmd = (uint32_t)prot << 16 | ((uint32_t)flags & 0xffff),
                  .handle = id.handle,
                  .arg = (uint64_t)offset,
                  .length = length },
        .send_fd = -1,
    };
    result = sim_exchange(&x);
    if (result < 0) {
        errno = -result;
        return MAP_FAILED;
    }
    memory = sim_next()->mmap_(address, length, prot, flags, x.fd, (off_t)x.answer.arg);
    (void)sim_next()->close_(x.fd);
    return memory;
}

HOOK void *mmap64(void *address, size_t length, int prot, int flags, int fd, off64_t offset)
{
    return mmap(address, length, prot, flags, fd, offset);
}

/* --- raw system calls, as libv4l2 makes them ---------------------------------------------------------------------- */

HOOK long syscall(long number, ...)
{
    long a[6];
    va_list args;

    va_start(args, number);
    for (int i = 0; i < 6; i++)
        a[i] = va_arg(args, long);
    va_end(args);
    if (sim_dir())
        switch (number) {
#ifdef SYS_open
        case SYS_open:
            return sim_open_hook(AT_FDCWD, (const char *)a[0], (int)a[1], (mode_t)a[2]);
#endif
        case SYS_openat:
            return sim_open_hook((int)a[0], (const char *)a[1], (int)a[2], (mode_t)a[3]);
        case SYS_ioctl:
            return ioctl((int)a[0], (unsigned long)a[1], a[2]);
        case SYS_read:
            return read((int)a[0], (void *)a[1], (size_t)a[2]);
        case SYS_write:
            return write((int)a[0], (const void *)a[1], (size_t)a[2]);
        case SYS_mmap:
            return (long)mmap((void *)a[0], (size_t)a[1], (int)a[2], (int)a[3], (int)a[4], (off_t)a[5]);
        default:
            break;
        }
    return sim_next()->syscall_(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}
