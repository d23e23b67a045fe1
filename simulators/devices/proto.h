/* simulators/devices/proto.h - protocol between a program under sst-sim and the simulator. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_PROTO_H
#define SST_SIMULATORS_DEVICES_PROTO_H

#include "base/base.h"

/*
 * A session is a folder, given by the environment variable SST_SIM_DIR:
 *   control.sock  SEQPACKET; one call and one answer at a time on each connection, any number of connections
 *   dev/          the session's /dev: device nodes are small files "MAJOR MINOR\n" with the sticky bit set, everything
 *                 else is a link to the real entry
 *   clock         "OFFSET_NS DRIFT_PPM ORIGIN_NS\n": the wall clock of programs against the machine's; absent: the same
 *
 * A descriptor of a program is one end of a stream socket pair; the simulator keeps the other end. Unread bytes make it
 * readable for poll(); an out-of-band byte is POLLPRI; unplugging closes the simulator's end. The program's end is
 * bound to an abstract name "sst-sim/<class>/<handle>", so that any process that inherits or receives it (dup, fork,
 * exec, SCM_RIGHTS) can identify it.
 */
#define SST_SIM_DIR_ENV "SST_SIM_DIR"
#define SST_SIM_SOCKET  "control.sock"
#define SST_SIM_CLOCK   "clock"
#define SST_SIM_NAME    "sst-sim/" /* then one letter, '/', the handle in decimal */

#define SST_SIM_PAYLOAD_MAX 65536

/* Prefixes of the names in /dev that a session provides: the machine's own entries are hidden. */
#define SST_SIM_OWN_KINDS "video", "media", "v4l", "gpiochip", "bus", "serial"

enum sst_sim_op {
    SST_SIM_OPEN = 1,    /* payload: path; cmd: flags of open(); answer brings the descriptor */
    SST_SIM_IOCTL = 2,   /* cmd: request; arg: the argument's value; payload: argument, then areas it points to */
    SST_SIM_MAP = 3,     /* arg: offset; length; cmd: prot << 16 | flags; answer: descriptor, arg: offset in it */
    SST_SIM_CANCEL = 4,  /* a signal arrived: answer the pending call now with -EINTR. No answer of its own */
    SST_SIM_READY = 5,   /* the out-of-band byte was taken. No answer */
    SST_SIM_READ = 6,    /* length: wanted; answer: payload */
    SST_SIM_WRITE = 7,   /* payload */
    SST_SIM_STAT = 12,   /* answer's arg: major << 32 | minor */
    SST_SIM_SEEK = 13,   /* arg: offset, cmd: whence of lseek(); answer's arg: new position */
    SST_SIM_FAULT = 8,   /* payload: "NAME=VALUE"; answer's payload: message on failure */
    SST_SIM_FAULTS = 9,  /* answer's payload: all faults with values and help, as text */
    SST_SIM_STATUS = 10, /* answer's payload: JSON */
    SST_SIM_STOP = 11,   /* end a session that was started with --serve */
};

enum sst_sim_call_flag {
    SST_SIM_NONBLOCK = 1 << 0, /* the descriptor is O_NONBLOCK */
};

struct sst_sim_call {
    uint32_t op, cmd;
    uint32_t handle, flags;
    uint64_t arg, length;
};

/* Path that is opened in place of a netlink socket for kernel events. */
#define SST_SIM_UEVENTS "/uevents"

#define SST_SIM_USB_TRANSFER_MAX 4096  /* bytes that a control transfer carries */
#define SST_SIM_USB_BULK_MAX     16384 /* and one of another endpoint; libusb splits longer ones */

/** A USB transfer between program and simulator, followed by its data. */
struct sst_sim_usb_transfer {
    uint64_t user;    /* the program's identifier: address of its URB */
    uint8_t setup[8]; /* of control transfers */
    uint8_t type, endpoint;
    uint16_t flags;         /* USBDEVFS_URB_... */
    uint32_t length;        /* room for data of a bulk or interrupt transfer, or bytes that follow */
    int32_t status, actual; /* answer */
};

enum sst_sim_answer_flag {
    SST_SIM_TAKE_URGENT = 1 << 0, /* take the out-of-band byte from the descriptor, then send SST_SIM_READY */
};

struct sst_sim_answer {
    int32_t result; /* negative errno, or the result of the call */
    uint32_t drain; /* bytes to drain from the descriptor: their events are consumed */
    uint32_t flags, pid;
    uint64_t arg;
};

#endif
