/* drivers/grab/camera.h - the state behind sst_grab, shared by its files. Only for drivers/grab. */
#ifndef SST_DRIVERS_GRAB_CAMERA_H
#define SST_DRIVERS_GRAB_CAMERA_H

#include <stdatomic.h>

#include "drivers/grab/devices.h"
#include "drivers/grab/job.h"
#include "drivers/grab/ladder.h"
#include "drivers/grab/stream.h"

/* What frames are compared with; forgotten when the stream starts anew. */
struct sst_history {
    bool any;
    uint32_t sequence;
    int64_t t_ns;
    uint64_t hash;
};

struct sst_camera {
    struct sst_grab_binding binding;
    struct sst_grab_device device; /* last known */
    int number;                    /* of its node; -1: absent */
    char name[2 * SST_GRAB_NAME_MAX];

    enum sst_grab_state state;
    struct sst_ladder ladder;
    struct camera_job *job;    /* works on this camera now; its stream, if any, is the job's meanwhile */
    struct sst_stream *stream; /* open, and not with a job */
    bool armed;                /* in the epoll set */
    bool running;              /* STREAMON was done */

    /* CLOCK_MONOTONIC; 0: none */
    int64_t job_end_ns; /* the job is given up then */
    int64_t open_ns;    /* open then, if it is there */
    int64_t rearm_ns;   /* back into the epoll set then */
    int64_t heard_ns;   /* last frame, or start */
    int64_t good_ns;    /* last good one, or start */
    int64_t owed_ns;    /* oldest trigger that no frame has followed */
    int64_t down_ns;    /* since when it does not stream */

    struct sst_history history;
    int bad_row;  /* bad frames one after another */
    bool wakes;   /* it is known that epoll is told of its frames */
    int eio_row;  /* failures of DQBUF one after another */
    int eio_well; /* frames without one until it is told again */
    struct sst_grab_counters counters;

    /* told already, so that a fault that stays is told once */
    char why[SST_WHY_MAX], note[SST_WHY_MAX], odd[SST_WHY_MAX], serial_seen[SST_GRAB_NAME_MAX];
    bool told_starved, told_stamp, told_hopeless;
};

struct sst_grab {
    struct sst_grab_config cfg; /* bindings are the cameras' own */
    struct sst_grab_events events;
    int epoll_fd, timer_fd, wake_fd;
    struct sst_jobs *jobs;
    struct sst_grab_watch *watch;
    bool started, closing;
    int64_t timer_ns; /* what timer_fd is set to; 0: nothing is due */
    int64_t judge_ns; /* no camera is taken for silent before */

    struct sst_grab_node *nodes; /* [SST_GRAB_NODES_MAX], in order */
    int node_count;
    bool scanning;
    unsigned changes, changes_at_scan; /* of the nodes: a scan that one of them overtook is void */
    int64_t scan_ns;                   /* when to scan next; 0: not needed */

    SST_ATOMIC(int64_t) fired_ns; /* sst_grab_expect(), not yet seen by the polling thread */
    struct sst_camera *camera;    /* [cfg.cameras] */
};

#define SST_MS INT64_C(1000000)

/* --- intake.c: frames --------------------------------------------------------------------------------------------- */

/** Serve a camera whose descriptor is ready. @param broken  epoll tells an error */
void sst_intake(struct sst_grab *grab, struct sst_camera *cam, bool broken);

/** Forget the past: the stream starts anew. */
void sst_intake_begin(struct sst_grab *grab, struct sst_camera *cam);

/** When the camera is to be looked at again for silence; 0: never as it is. */
int64_t sst_intake_due(const struct sst_grab *grab, const struct sst_camera *cam);

/** The due time has come: climb the ladder if it is silent and could have spoken. */
void sst_intake_silence(struct sst_grab *grab, struct sst_camera *cam, int64_t now_ns);

/* --- recovery.c: what is done to a camera, and by whom ------------------------------------------------------------ */

/** A node that is this camera's is there: open it. */
void sst_recovery_found(struct sst_grab *grab, struct sst_camera *cam, const struct sst_grab_node *node);

/** It is unplugged. */
void sst_recovery_lost(struct sst_grab *grab, struct sst_camera *cam);

/** Its stream broke or is silent; `why` is one sentence. */
void sst_recovery_fault(struct sst_grab *grab, struct sst_camera *cam, const char *why);

/** Start a camera that is ready. */
void sst_recovery_start(struct sst_grab *grab, struct sst_camera *cam);

/** Ladder, job and opening time-outs. */
void sst_recovery_time(struct sst_grab *grab, struct sst_camera *cam, int64_t now_ns);
int64_t sst_recovery_due(const struct sst_grab *grab, const struct sst_camera *cam);

/** Put it into the epoll set and take it out. */
void sst_recovery_arm(struct sst_grab *grab, struct sst_camera *cam);
void sst_recovery_disarm(struct sst_grab *grab, struct sst_camera *cam);

/** Close the camera's stream without waiting for that. */
void sst_recovery_drop(struct sst_grab *grab, struct sst_camera *cam);

/** Tell a change of state, once: by the log and the caller's event. */
void sst_camera_say(struct sst_grab *grab, struct sst_camera *cam, enum sst_grab_state state, const char *why);

/* --- plug.c: which node is which camera --------------------------------------------------------------------------- */

/** Read all there is to read from the watch. */
void sst_plug_events(struct sst_grab *grab);

/** Read the list of nodes here and now. @return 0 or -errno, logged. */
SST_MUST_CHECK int sst_plug_read(struct sst_grab *grab);

/** Read it again on a thread, now and then while a camera is missing, or events were lost. */
void sst_plug_time(struct sst_grab *grab, int64_t now_ns);
int64_t sst_plug_due(const struct sst_grab *grab);

/** Look for the node of every camera that has none. @return 0, or -ENOTUNIQ (two devices of one serial; logged) */
int sst_plug_assign(struct sst_grab *grab);

/** The node was found not to capture, or to be gone: do not take it again. */
void sst_plug_strike(struct sst_grab *grab, int number, bool gone);

#endif
