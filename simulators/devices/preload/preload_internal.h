/* simulators/devices/preload/preload_internal.h - private declarations of this folder; code outside of it includes
 * the public headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_PRELOAD_PRELOAD_INTERNAL_H
#define SST_SIMULATORS_DEVICES_PRELOAD_PRELOAD_INTERNAL_H

#include <errno.h>
#include <stdbool.h>
#include <sys/types.h>
#include <sys/uio.h>

#include "simulators/devices/proto.h"

/* --- core: the part of the preload library shared by all device classes. --- */

/*
 * Loaded into any program: uses only libc, no allocation, no lock that could be held at a fork. Everything here may be
 * called from any thread. Functions return 0 or a result, or a negative errno.
 */

/** Identity of a device descriptor. */
struct sim_id {
    char letter; /* of the class */
    uint32_t handle;
};

/** True if fd is a device file of a session. */
bool sim_identify(int fd, struct sim_id *id);

/* The functions that the library interposes; resolved at load. */
struct sim_next {
    int (*open_)(const char *, int, ...);
    int (*openat_)(int, const char *, int, ...);
    int (*ioctl_)(int, unsigned long, ...);
    void *(*mmap_)(void *, size_t, int, int, int, off_t);
    ssize_t (*read_)(int, void *, size_t);
    ssize_t (*write_)(int, const void *, size_t);
    int (*close_)(int);
    int (*fcntl_)(int, int, ...);
    long (*syscall_)(long, ...);
};
const struct sim_next *sim_next(void);

/** Fast negative check for fds that were never our device files; sim_identify() decides. */
bool sim_maybe(int fd);

#define SIM_PARTS 6

/** One call and its answer. Unused parts have length 0. Bad pointers of the program are -EFAULT. */
struct sim_exchange {
    struct sst_sim_call call;
    struct iovec in[SIM_PARTS], out[SIM_PARTS]; /* payload of the call, and of the answer, in pieces */
    int send_fd;                                /* -1: none */
    struct sst_sim_answer answer;
    size_t got; /* bytes of the answer's payload */
    int fd;     /* that came with the answer, O_CLOEXEC; -1: none; the caller's */
};

/** @return the answer's result, or -errno. A signal without SA_RESTART ends it with -EINTR, as the kernel does. */
int sim_exchange(struct sim_exchange *x);

/** Update the descriptor's readiness from the answer. */
void sim_settle(int fd, const struct sim_id *id, const struct sst_sim_answer *answer);

/** A part of the program's memory that an ioctl's argument points to. */
struct sim_area {
    size_t pointer_at; /* offset of the pointer in the argument */
    size_t bytes;      /* 0: none */
};

/** An ioctl: its argument, and areas besides. */
struct sim_ioctl {
    unsigned long request;
    void *arg;
    const struct sim_area *areas;
    int count;
};

/**
 * An ioctl: sends the argument, sized by the request number, and the areas (at most SIM_PARTS - 1), and copies them
 * back.
 * @param fd  in: descriptor to send or -1; out: descriptor of the answer or -1; NULL: neither
 */
int sim_ioctl_areas(int device_fd, const struct sim_id *id, const struct sim_ioctl *call, int *fd);

/** Copy from the program's memory through a pointer that may be invalid. @return 0 or -EFAULT. */
int sim_peek(void *out, const void *from, size_t bytes);

/** Operations of a device class. The table is in classes.c. */
struct sim_class {
    char letter;
    char ioctl_type; /* _IOC_TYPE of its requests; others are -ENOTTY */
    /** NULL: no ioctls */
    int (*ioctl)(int fd, const struct sim_id *id, unsigned long request, void *arg);
    /** read() and write() ask the simulator (sim_ops) instead of the socket. */
    bool read_calls, write_calls;
    /** Data that libc's streams wrote without write() is still in the socket: before the descriptor closes, an empty
     *  write makes the simulator read it. */
    bool late_writes;
};

extern const struct sim_class *const sim_classes[];
extern const int sim_class_count;
const struct sim_class *sim_class_find(char letter);

/* --- paths (paths.c) ---------------------------------------------------------------------------------------------- */

#define SIM_PATH_MAX 4096

enum sim_path_kind {
    SIM_PATH_OTHER = 0,     /* not ours */
    SIM_PATH_NODE = 1,      /* device node of the session */
    SIM_PATH_PLAIN = 2,     /* another entry of the session's /dev: use `real` instead */
    SIM_PATH_MISSING = 3,   /* of a kind that the session provides, but missing */
    SIM_PATH_ATTRIBUTE = 4, /* writable sysfs attribute: as SIM_PATH_PLAIN for reading; writes go to the simulator */
};

struct sim_path {
    enum sim_path_kind kind;
    char real[SIM_PATH_MAX]; /* in the session's folder */
    char node[SIM_PATH_MAX]; /* of a node or attribute: its path, links followed */
    unsigned dev_major, dev_minor;
};

/** Resolve a path. dirfd as in openat(). */
void sim_path_resolve(int dirfd, const char *path, bool follow, struct sim_path *out);

/** True if a resolved path is in the session's /sys. */
bool sim_path_in_sysfs(const struct sim_path *path);

/** open() as programs see it. @return descriptor, or -1 with errno set */
int sim_open_hook(int dirfd, const char *path, int flags, mode_t mode);

/** Before fd closes: see late_writes. */
void sim_flush(int fd);

/** The path of a descriptor; false if it is unavailable or too long. */
bool sim_path_of(int fd, char out[SIM_PATH_MAX]);

/** Open a device file of the session. @param node  path as the simulator knows it  @return descriptor or -errno */
int sim_open_node(const char *node, int flags);

/** The session's folder, or NULL outside a session. */
const char *sim_dir(void);

/** True if fd is a connection to the simulator, which a program that closes all descriptors must not close. */
bool sim_hidden(int fd);

/** Mark fd as possibly ours. */
void sim_mark(int fd);

/* --- classes: one line for each class of devices. --- */

extern const struct sim_class sim_class_v4l2;      /* v4l2.c */
extern const struct sim_class sim_class_gpio;      /* gpio.c */
extern const struct sim_class sim_class_usb;       /* usb.c */
extern const struct sim_class sim_class_attribute; /* hooks_sysfs.c: attributes in /sys that are written */
extern const struct sim_class sim_class_uevent;    /* uevent.c: netlink sockets for kernel events */

/* --- hooks: interposing a function of libc. --- */

#define HOOK __attribute__((visibility("default")))

/* `next`: the interposed function; looked up once. */
#define NEXT(type, name, ...)                                                                                          \
    static type (*next)(__VA_ARGS__);                                                                                  \
    if (!__atomic_load_n(&next, __ATOMIC_RELAXED)) {                                                                   \
        void *symbol = dlsym(RTLD_NEXT, #name);                                                                        \
        __atomic_store_n(&next, (type(*)(__VA_ARGS__))symbol, __ATOMIC_RELAXED);                                       \
    }

#endif
