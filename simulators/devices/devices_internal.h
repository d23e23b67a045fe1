/* simulators/devices/devices_internal.h - common parts of the devices of a session: the server and its faults
 * (server/), the cameras as an array (camera/), and the files of this folder; code outside of it includes the public
 * headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_DEVICES_INTERNAL_H
#define SST_SIMULATORS_DEVICES_DEVICES_INTERNAL_H

#include <jansson.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>

#include "base/base.h"
#include "base/file.h"
#include "simulators/devices/proto.h"
#include "simulators/devices/usb/usb_model.h"
#include "simulators/rig/drive.h"
#include "simulators/scene/world/sim_world.h"

/* --- faults: faults that can be set by name while programs run. --- */

struct sim_faults; /* opaque; simulator's thread */

/** One fault; value 0 means off. */
struct sim_fault {
    const char *name; /* "late_ms" */
    double min, max;
    const char *help; /* one line, with the unit and the meaning of the value */
};

/** A kind of devices with faults. Tables are const and never freed. */
struct sim_fault_scope {
    const char *name;               /* "camera", "gpio", "usb" */
    const struct sim_fault *faults; /* [count] */
    int count;
    int instances; /* "camera.3.late_ms", "camera.*.late_ms"; 0: only one, "gpio.busy" */
    /** Called when a value is set, even to the same value; may be NULL. @return 0, or -errno: the value is not
     *  changed */
    int (*changed)(void *arg, int instance, int fault, double value);
    void *arg;
};

SST_MUST_CHECK int sim_faults_create(struct sim_faults **out);
void sim_faults_destroy(struct sim_faults *f);

/** @return the scope's number for sim_fault_value(), or -ENOMEM. */
SST_MUST_CHECK int sim_faults_add(struct sim_faults *f, const struct sim_fault_scope *scope);

/** Value of fault `fault` of an instance (0 if there is only one). */
double sim_fault_value(const struct sim_faults *f, int scope, int instance, int fault);

/** Set a value internally (a fault that ended by itself); `changed` is not called. */
void sim_fault_reset(struct sim_faults *f, int scope, int instance, int fault);

/**
 * "camera.3.late_ms=20", "camera.*.eio=0.1", "gpio.busy=1".
 * @param message  out, [size], on failure: one sentence with value and remedy
 * @return 0, -EINVAL (no such name), -ERANGE, or the error of `changed`.
 */
SST_MUST_CHECK int sim_faults_set(struct sim_faults *f, const char *text, char *message, size_t size);

/** A line for each fault of a kind of devices, with range and help. */
void sim_fault_scope_print(FILE *out, const struct sim_fault_scope *scope);

/** The kinds, without their devices. */
extern const struct sim_fault_scope sim_camera_faults, sim_gpio_faults, sim_usb_faults, sim_hub_faults,
    sim_still_faults, sim_world_faults;

/** All faults with range and help, then the values that are not 0, as text. @return bytes written, NUL left out. */
size_t sim_faults_list(const struct sim_faults *f, char *out, size_t size);

/** Call fn for each value that is not 0. */
void sim_faults_each(const struct sim_faults *f, void (*fn)(void *arg, const char *name, double value), void *arg);

/* --- server: the event loop of sst-sim: one thread that serves device files, calls and timers. --- */

/* Everything here runs on the thread that calls sim_server_run(). */
struct sim_server; /* opaque */
struct sim_node;   /* opaque: an entry in /dev */
struct sim_ops;

/* --- timers ------------------------------------------------------------------------------------------------------- */

/** In the caller's memory, zeroed before first use. `fire` may set the timer again. */
struct sim_timer {
    void (*fire)(void *arg);
    void *arg;
    int64_t due_ns;
    int slot; /* index in the server's heap; 0: not set */
};

/** Fire once at due_ns (CLOCK_MONOTONIC), immediately if that is past; a set timer is moved. @return 0 or -ENOMEM. */
SST_MUST_CHECK int sim_timer_set(struct sim_server *s, struct sim_timer *timer, int64_t due_ns);
void sim_timer_stop(struct sim_server *s, struct sim_timer *timer);

/* --- open device files -------------------------------------------------------------------------------------------- */

/** One open file of a program, shared by all its copies of the descriptor. */
struct sim_handle {
    struct sim_server *server;
    const struct sim_ops *ops;
    void *device;   /* argument of sim_node_add() or sim_handle_create() */
    void *state;    /* the device's, per open file */
    int open_flags; /* of open() */
    uint32_t id;
    int fd;      /* the simulator's end: data written here is read by the program */
    bool urgent; /* an out-of-band byte is pending at the program */
};

/** A call from a program. The device answers by its return value or later. */
struct sim_request {
    struct sst_sim_call call;
    struct sim_handle *handle; /* NULL if it was closed meanwhile */
    uint8_t *data;             /* [SST_SIM_PAYLOAD_MAX]: payload of the call, then of the answer */
    uint32_t bytes;            /* of the call's payload */
    int fd;                    /* descriptor of the call, or -1; the device may take ownership (and set -1) */
    /* answer */
    uint32_t out_bytes; /* of the payload; for ioctls: the argument, then its areas, laid out as in the call */
    uint32_t drain, out_flags;
    int out_fd;        /* descriptor to pass, or -1 */
    bool out_fd_close; /* close it after passing */
    uint64_t out_arg;
};

#define SST_SIM_LATER 0x40000000 /* returned by ops: sst_sim_answer() will be called for this request */

/** Operations of a device; each may be NULL (-ENOTTY, -ENODEV for map, -EINVAL for read and write, -ESPIPE). Return a
 *  negative errno, a result, or SST_SIM_LATER. On a negative result out_bytes is 0 unless set by the device. */
struct sim_ops {
    char letter;  /* of the class, in the descriptor's name: v V4L2, g GPIO, u USB, s attribute in /sys, n kernel events
                   */
    bool packets; /* reads preserve packet boundaries */
    int (*open)(struct sim_handle *h, struct sim_request *r); /* the answer is the new descriptor */
    void (*close)(struct sim_handle *h);                      /* last copy closed, or sim_handle_drop() */
    int (*ioctl)(struct sim_handle *h, struct sim_request *r);
    int (*map)(struct sim_handle *h, struct sim_request *r);
    int (*read)(struct sim_handle *h, struct sim_request *r);
    int (*write)(struct sim_handle *h, struct sim_request *r);
    int (*seek)(struct sim_handle *h, struct sim_request *r);    /* NULL: -ESPIPE */
    void (*cancel)(struct sim_handle *h, struct sim_request *r); /* cancel a pending request */
    void (*ready)(struct sim_handle *h); /* the program read the out-of-band byte: another may be due */
};

/** Answer a pending request. */
void sst_sim_answer(struct sim_server *s, struct sim_request *r, int result);

/** Answer no earlier than at due_ns: return this from an op. @return SST_SIM_LATER or -ENOMEM. */
int sim_answer_at(struct sim_server *s, struct sim_request *r, int result, int64_t due_ns);

/**
 * Create a file for an ioctl that returns one (GPIO lines): put *client_fd into the answer (out_fd, out_fd_close); in
 * the program the class's part of the preload library stores the number where the ioctl expects it.
 * @return 0 or -errno; ops->open is not called.
 */
SST_MUST_CHECK int sim_handle_create(struct sim_server *s, const struct sim_ops *ops, void *device,
                                     struct sim_handle **handle, int *client_fd);

/** Hang up: poll() in the program reports POLLERR|POLLHUP, every call fails with -ENODEV. Calls ops->close; pending
 *  calls of this handle are answered with -ENODEV. */
void sim_handle_drop(struct sim_handle *h);

/** A program's close() may be noticed late: drop the file if its last copy is closed. @return true: it was closed */
bool sim_handle_settle(struct sim_handle *h);

/** Make the file readable by more bytes, or raise POLLPRI. @return -EAGAIN: the program does not read, the socket is
 *  full */
SST_MUST_CHECK int sim_handle_readable(struct sim_handle *h, const void *data, size_t bytes);
void sim_handle_urgent(struct sim_handle *h);

/* --- entries in /dev ---------------------------------------------------------------------------------------------- */

/** A device behind a node: its operations and their argument, and its numbers. */
struct sim_device {
    const struct sim_ops *ops;
    void *arg;
    unsigned dev_major, dev_minor;
};

/**
 * Create a device node.
 *
 * @param path  "/dev/video0": created in the session's /dev; another absolute path: only opened through the preload
 *              library, without an entry in the file system
 * @return 0, -EEXIST, -ENOMEM or -errno of the file system.
 */
SST_MUST_CHECK int sim_node_add(struct sim_server *s, struct sim_node **node, const char *path,
                                const struct sim_device *device);

/** Remove a node and drop all its handles. NULL is fine. */
void sim_node_remove(struct sim_server *s, struct sim_node *node);

/** A link in the session's /dev: "/dev/v4l/by-id/x" to "../../video0"; target NULL removes it. @return 0 or -errno. */
SST_MUST_CHECK int sim_link(struct sim_server *s, const char *path, const char *target);

/** Create the parent folders of a path; its first `base` bytes exist. @return 0 or -errno */
SST_MUST_CHECK int sim_make_parents(char *path, size_t base);

/* --- the server --------------------------------------------------------------------------------------------------- */

/** Handler of the session's control calls; set by the main program. */
struct session_control {
    void *arg;
    /** SST_SIM_FAULT, FAULTS, STATUS, STOP. */
    int (*call)(void *arg, struct sim_request *r);
};

/** @param dir  session folder, exists, absolute. @return 0 or -errno, logged. */
SST_MUST_CHECK int sim_server_open(struct sim_server **out, const char *dir, const struct session_control *control);
/** Drops all handles, removes all nodes. NULL is fine. */
void sim_server_close(struct sim_server *s);
/** The session's folder. */
const char *sim_server_dir(const struct sim_server *s);

/** Call fn when fd is readable, as long as the server is open. The caller owns fd. @return 0 or -errno. */
SST_MUST_CHECK int sim_watch(struct sim_server *s, int fd, void (*fn)(void *arg), void *arg);

/** Serve until sim_server_stop(). @return 0 or -errno, logged. */
SST_MUST_CHECK int sim_server_run(struct sim_server *s);
void sim_server_stop(struct sim_server *s);

/* --- array: the array of simulated cameras: identity, exposure, bus. --- */

/* --- identity, shared by V4L2, USB and udev ----------------------------------------------------------------------- */

struct sim_identity {
    char serial[16];     /* "SIM0007" */
    char card[32];       /* name of the product and of the video node */
    char controller[32]; /* PCI address, "0000:00:14.0" */
    char port[32];       /* port path as in sysfs, "1-2.3": bus 1, port 2, hub port 3 */
    char bus_info[64];   /* as in V4L2, "usb-0000:00:14.0-2.3" */
    int bus;             /* USB bus number */
};

/** Identity of camera cam at its place in the USB tree. */
void sim_identity(const struct sst_sim_usb *usb, int cam, struct sim_identity *out);

/* --- the array ---------------------------------------------------------------------------------------------------- */

struct sim_array; /* opaque; simulator's thread */

/** Callbacks to the bus; set by the simulated USB, NULL members are not called. */
struct sim_bus {
    void *arg;
    /** A camera starts to stream. @return 0, or -ENOSPC if the bus has no bandwidth. rate in frames/s. */
    int (*reserve)(void *arg, int cam, uint32_t fourcc, int width, int height, double rate_hz);
    void (*release)(void *arg, int cam);
    /** A camera was plugged or unplugged by sim_array_plug(); node: N of its present or last /dev/videoN. */
    void (*plugged)(void *arg, int cam, bool present, int node);
    /** Fault "swap": another camera is in this position. */
    void (*swapped)(void *arg, int cam, int body);
    /** Pose of the camera's rig at a time. */
    void (*pose)(void *arg, int64_t t_ns, int32_t pose_um[3]);
};

struct sim_array_config {
    struct sst_sim_world *world; /* borrowed */
    struct sim_server *server;
    struct sim_faults *faults;
    const struct sst_sim_usb *usb; /* borrowed: the tree that the cameras are plugged into */
    const char *truth;             /* file of the truth log, JSON lines; NULL: none */
};

/** Create the cameras from /dev/video0 on. @return 0 or -errno, logged. */
SST_MUST_CHECK int sim_array_open(struct sim_array **out, const struct sim_array_config *cfg);
void sim_array_close(struct sim_array *a);

void sim_array_set_bus(struct sim_array *a, const struct sim_bus *bus);

int sim_array_cameras(const struct sim_array *a);
/** N of /dev/videoN, -1: unplugged. */
int sim_array_node(const struct sim_array *a, int cam);

/**
 * A rising edge on a trigger line at t_ns (CLOCK_MONOTONIC): cameras in trigger mode 1 expose after their delay.
 *
 * @param first, count  cameras wired to the line; for one line per row: row * cols, cols
 * @param trigger       index of the edge on its line; written into the frames
 */
void sim_array_edge(struct sim_array *a, int first, int count, uint64_t trigger, int64_t t_ns);

/** Unplug or plug a camera (also fault "camera.N.unplug"); its node gets the lowest free number. Unplugging drops the
 *  camera's handles. No change is fine. @return 0 or -errno. */
SST_MUST_CHECK int sim_array_plug(struct sim_array *a, int cam, bool present);

/** Rungs of the recovery ladder; each clears a fault "stall" up to its value. */
enum sim_rung {
    SST_SIM_RESTREAM = 1,
    SST_SIM_REOPEN = 2,
    SST_SIM_RESET = 3,       /* USB reset: the stream is lost, the node stays */
    SST_SIM_REAUTHORISE = 4, /* and the bus calls sim_array_plug() */
    SST_SIM_POWER = 5,
};
void sim_array_rung(struct sim_array *a, int cam, enum sim_rung rung);

/** The truth log, or NULL. */
FILE *sim_array_log(const struct sim_array *a);

/** Number of frames since open. */
uint64_t sim_array_frames(const struct sim_array *a);

/** Member "cameras" of the status: an array of objects, owned by the caller; NULL: out of memory. */
json_t *sim_array_status(const struct sim_array *a);

/* --- gpio_front: front end of the simulated GPIO chips in a session. --- */

struct sim_gpio_front; /* opaque; simulator's thread */

struct sim_gpio_front_config {
    struct sim_sysfs *sysfs;
    struct sim_faults *faults;
    int lines; /* trigger lines TRIG0.., 1..16 */
    uint64_t seed;
    void *arg;
    /** A trigger line rose. */
    void (*edge)(void *arg, int line, int64_t t_ns);
};

/**
 * Create the chips: gpiochip0 "sst-board", gpiochip1 "sst-trigger" with lines TRIG0.. and the input LOOP0 that is wired
 * to TRIG0. @return 0 or -errno, logged.
 */
SST_MUST_CHECK int sim_gpio_front_open(struct sim_gpio_front **out, const struct sim_gpio_front_config *cfg);
/** A generator outside of the machine raises all trigger lines for a moment. */
void sim_gpio_front_pulse(struct sim_gpio_front *front, int64_t t_ns);
void sim_gpio_front_close(struct sim_gpio_front *front);

/* --- rig: the motor rig of a session: simulated drives that move the world's camera. --- */

#define SST_SIM_RIG_LINK "/dev/serial/by-id/usb-sim_rig"

/**
 * Start the drives: Modbus RTU behind SST_SIM_RIG_LINK, Modbus TCP on 127.0.0.1.
 *
 * @param dir    of the session
 * @param port   0: any free one
 * @return 0, -EADDRINUSE, -ENAMETOOLONG, -ENOMEM or -errno; logged.
 */
SST_MUST_CHECK int sim_rig_open(struct sst_sim_drive **out, const char *dir, int port, uint64_t seed);
/** "rig.NAME=VALUE". @param message  out, [size], on failure @return 0 or -EINVAL */
SST_MUST_CHECK int sim_rig_fault(struct sst_sim_drive *rig, const char *text, char *message, size_t size);

/** All faults of the rig with help, for the list. */
extern const char sim_rig_faults[];

/** Member "rig" of the status; NULL: no memory. */
json_t *sim_rig_status(struct sst_sim_drive *rig);

/* --- session: the folder through which programs find their devices, and the command that runs in it. --- */

/** Create a folder for a session in $XDG_RUNTIME_DIR, /dev/shm or /tmp, accessible to this user only; folders of
 *  killed sessions are removed. @return 0 or -errno, logged. */
SST_MUST_CHECK int sim_session_make(char dir[SST_PATH_MAX]);

/**
 * Set up this process's environment for programs of a session: SST_SIM_DIR and LD_PRELOAD.
 * @return 0, -ENOENT (the preload library is missing) or -errno, logged.
 */
SST_MUST_CHECK int sim_session_enter(const char *dir);

/** The command that runs in a session. */
struct sim_command {
    int pid;       /* also its process group; 0: has ended */
    int signals;   /* signalfd: readable when sim_command_signal() has something to do */
    bool terminal; /* it is the terminal's foreground */
    int status;    /* exit status, 128 + signal */
    sigset_t mask; /* signals blocked before */
};

/**
 * Block terminating signals before any thread starts; they and the end of children are reported through c->signals.
 * @return 0 or -errno, logged.
 */
SST_MUST_CHECK int sim_command_prepare(struct sim_command *c);

/** Start argv in a process group of its own. @return 0, -ENOENT/-EACCES... (it cannot be executed) or -errno; logged.
 */
SST_MUST_CHECK int sim_command_start(struct sim_command *c, char *const argv[]);

/** Forward a signal, or collect the command's exit status. @return true: it has ended (or, without a command, a signal
 *  arrived). */
bool sim_command_signal(struct sim_command *c);

/** Terminate a running command and restore the terminal. A zeroed struct is fine. */
void sim_command_close(struct sim_command *c);

/** Send a control call to a session: see enum sst_sim_op. @param answer  out, [size], text. @return the answer's
 *  result or -errno. */
SST_MUST_CHECK int sim_session_ask(const char *dir, unsigned op, const char *text, char *answer, size_t size);

/* --- wires: connections of the cameras: USB, trigger lines, rig. --- */

struct sim_wires_options {
    const char *usb;  /* layout of the tree, sst_sim_usb_layout(); NULL: the first */
    bool one_trigger; /* TRIG0 exposes all cameras; else one line per row */
    bool rig;         /* a motor rig moves the camera */
    int rig_port;     /* their TCP port on 127.0.0.1; 0: any free one */
};

struct sim_wires_config {
    struct sim_wires_options options;
    struct sim_server *server;
    struct sim_faults *faults;
    struct sst_sim_world *world; /* borrowed */
};

#define SIM_TRIGGERS_MAX 16

/** Simulator's thread. */
struct sim_wires {
    struct sim_wires_config cfg;
    struct sim_sysfs *sysfs;
    struct sim_usb_front *usb;
    struct sim_gpio_front *gpio;
    struct sst_sim_drive *rig; /* NULL: none */
    struct sim_still *still;   /* NULL: none */
    struct sim_array *array;   /* NULL until attached */
    int rows, cols;
    uint64_t edges[SIM_TRIGGERS_MAX];
    struct sim_timer generator;
    double generator_hz; /* 0: none */
    uint64_t generated;  /* number of its last pulse, since the machine was booted */
};

/** Create /sys and the USB tree. @return 0 or -errno, logged. */
SST_MUST_CHECK int sim_wires_open(struct sim_wires **out, const struct sim_wires_config *cfg);

/** Connect the cameras, create the GPIO chips and start the drives. @return 0 or -errno, logged. */
SST_MUST_CHECK int sim_wires_attach(struct sim_wires *wires, struct sim_array *array);

/** After the array has been closed. NULL is fine. */
void sim_wires_close(struct sim_wires *wires);

/* --- simulator: world, server and all simulated devices. --- */

struct sim_options {
    const char *world, *cache; /* as in sst_sim_world_open() */
    const char *truth;         /* or NULL */
    const char *stats;         /* file for figures at the end, JSON; or NULL */
    struct sim_wires_options wires;
    const char *const *faults; /* [fault_count] initial "NAME=VALUE" */
    int fault_count;
    bool quiet;
    bool at_once; /* a world that is not in the cache is prepared in the background */
};

struct sim_simulator; /* opaque */

/** Open the world, which may take minutes. @return 0 or -errno, logged. */
SST_MUST_CHECK int sim_simulator_open(struct sim_simulator **out, const struct sim_options *options);
/** Create the devices in a session's folder. @return 0 or -errno, logged; then call close. */
SST_MUST_CHECK int sim_simulator_start(struct sim_simulator *sim, const char *dir);
/** Also reports the cost of the simulation. NULL is fine. */
void sim_simulator_close(struct sim_simulator *sim);
struct sim_server *sim_simulator_server(const struct sim_simulator *sim);

#endif
