/* simulators/devices/server_internal.h - shared by the parts of the server. */
#ifndef SST_SIMULATORS_DEVICES_SERVER_INTERNAL_H
#define SST_SIMULATORS_DEVICES_SERVER_INTERNAL_H

#include "base/file.h"
#include "simulators/devices/server.h"

#define SST_SIM_HANDLES_MAX 16384

/** What epoll's pointer points to: the first member of everything that is waited for. */
struct sst_sim_source {
    void (*ready)(struct sst_sim_server *s, struct sst_sim_source *source, uint32_t events);
};

struct sst_sim_conn {
    struct sst_sim_source source;
    int fd;
    bool pending, dead;
    struct sst_sim_request request;
    struct sst_sim_timer delay; /* for sst_sim_answer_at() */
    struct sst_sim_server *server;
    int delayed_result;
    struct sst_sim_conn *next;
    uint8_t data[SST_SIM_PAYLOAD_MAX];
};

struct sst_sim_open_file {
    struct sst_sim_source source;
    struct sst_sim_handle handle; /* lent to the device */
    struct sst_sim_node *node;    /* NULL: made by an ioctl */
    bool dead;
    struct sst_sim_open_file *next_dead;
};

struct sst_sim_node {
    char path[256];
    unsigned dev_major, dev_minor;
    const struct sst_sim_ops *ops;
    void *device;
    struct sst_sim_node *next;
};

struct sst_sim_watched {
    struct sst_sim_source source;
    int fd;
    void (*fn)(void *arg);
    void *arg;
    struct sst_sim_watched *next;
};

struct sst_sim_server {
    char dir[SST_PATH_MAX];
    struct sst_sim_control control;
    int epoll, listener, timerfd;
    int hangups; /* epoll of the open files' ends, in the other */
    bool stop;
    struct sst_sim_source listener_source, timer_source, hangups_source;
    struct sst_sim_conn *conns;
    struct sst_sim_node *nodes;
    struct sst_sim_watched *watched;
    struct sst_sim_open_file **files; /* [file_slots]; NULL: free */
    int file_slots;
    uint32_t generation;
    struct sst_sim_open_file *dead_files; /* freed when no event can point to them */
    struct sst_sim_timer **heap;          /* [timers], earliest first */
    int timers, heap_room;
};

/* server_timer.c */
void sst_sim_timers_fire(struct sst_sim_server *s);
void sst_sim_timers_arm(struct sst_sim_server *s);

/* server_files.c */
struct sst_sim_open_file *sst_sim_file_find(struct sst_sim_server *s, uint32_t id);
SST_MUST_CHECK int sst_sim_file_open(struct sst_sim_server *s, struct sst_sim_request *r);
uint64_t sst_sim_file_device(const struct sst_sim_open_file *f); /* major << 32 | minor; 0: none */
void sst_sim_files_drop(struct sst_sim_server *s, const struct sst_sim_node *node); /* NULL: all */
void sst_sim_files_free_dead(struct sst_sim_server *s);

/* server_dev.c */
SST_MUST_CHECK int sst_sim_dev_open(struct sst_sim_server *s);
struct sst_sim_node *sst_sim_node_find(struct sst_sim_server *s, const char *path);

/* server.c */
SST_MUST_CHECK int sst_sim_source_add(int epoll, int fd, uint32_t events, struct sst_sim_source *source);
void sst_sim_requests_fail(struct sst_sim_server *s, struct sst_sim_handle *h, int err);

#endif
