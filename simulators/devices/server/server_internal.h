/* simulators/devices/server/server_internal.h - state of the server. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_SERVER_SERVER_INTERNAL_H
#define SST_SIMULATORS_DEVICES_SERVER_SERVER_INTERNAL_H

#include "simulators/devices/devices_internal.h"
#include "simulators/devices/sysfs_internal.h"
#include "simulators/devices/usb_internal.h"

#define SST_SIM_HANDLES_MAX 16384

/** Target of epoll's pointer: the first member of every event source. */
struct sim_source {
    void (*ready)(struct sim_server *s, struct sim_source *source, uint32_t events);
};

struct sim_conn {
    struct sim_source source;
    int fd;
    bool pending, dead;
    struct sim_request request;
    struct sim_timer delay; /* for sim_answer_at() */
    struct sim_server *server;
    int delayed_result;
    struct sim_conn *next;
    uint8_t data[SST_SIM_PAYLOAD_MAX];
};

struct sim_open_file {
    struct sim_source source;
    struct sim_handle handle; /* lent to the device */
    struct sim_node *node;    /* NULL: made by an ioctl */
    bool dead;
    struct sim_open_file *next_dead;
};

struct sim_node {
    char path[256];
    unsigned dev_major, dev_minor;
    const struct sim_ops *ops;
    void *device;
    struct sim_node *next;
};

struct sim_watched {
    struct sim_source source;
    void (*fn)(void *arg);
    void *arg;
    struct sim_watched *next;
};

struct sim_server {
    char dir[SST_PATH_MAX];
    struct session_control control;
    int epoll, listener, timerfd;
    int hangups; /* nested epoll of the open files' ends */
    bool stop;
    struct sim_source listener_source, timer_source, hangups_source;
    struct sim_conn *conns;
    struct sim_node *nodes;
    struct sim_watched *watched;
    struct sim_open_file **files; /* [file_slots]; NULL: free */
    int file_slots;
    uint32_t generation;
    struct sim_open_file *dead_files; /* freed once no event can point to them */
    struct sim_timer **heap;          /* [timers], earliest first */
    int timers, heap_room;
};

/* server_timer.c */
void sim_timers_fire(struct sim_server *s);
void sim_timers_arm(struct sim_server *s);

/* server_files.c */
struct sim_open_file *sim_file_find(struct sim_server *s, uint32_t id);
SST_MUST_CHECK int sim_file_open(struct sim_server *s, struct sim_request *r);
uint64_t sim_file_device(const struct sim_open_file *f);                /* major << 32 | minor; 0: none */
void sim_files_drop(struct sim_server *s, const struct sim_node *node); /* NULL: all */
void sim_files_free_dead(struct sim_server *s);

/* server_dev.c */
SST_MUST_CHECK int sim_dev_open(struct sim_server *s);
struct sim_node *sim_node_find(struct sim_server *s, const char *path);

/* server.c */
SST_MUST_CHECK int sim_source_add(int epoll, int fd, uint32_t events, struct sim_source *source);
void sim_requests_fail(struct sim_server *s, struct sim_handle *h, int err);

#endif
