/* drivers/grab/ladder.h - what to try next on a camera that brings no frames. A pure state machine. */
#ifndef SST_DRIVERS_GRAB_LADDER_H
#define SST_DRIVERS_GRAB_LADDER_H

#include <stdbool.h>

#include "drivers/grab/grab.h"

#define SST_LADDER_RETRY_NS INT64_C(200000000)      /* pause after a rung that could not be carried out */
#define SST_LADDER_SETTLE_NS INT64_C(10000000000)   /* a camera that falters again sooner goes on where it was */
#define SST_LADDER_BACK_OFF_NS INT64_C(1000000000)  /* the first one; each next is twice as long ... */
#define SST_LADDER_BACK_OFF_MAX_NS INT64_C(60000000000) /* ... up to this */

enum sst_ladder_event {
    SST_LADDER_OPENED = 0,  /* started at plug-in or by the user: a frame is owed */
    SST_LADDER_FRAME = 1,   /* a frame came, good or bad */
    SST_LADDER_FAULT = 2,   /* a frame is overdue, or the stream broke */
    SST_LADDER_DONE = 3,    /* the rung was carried out */
    SST_LADDER_FAILED = 4,  /* it, or opening, could not be carried out */
    SST_LADDER_REFUSED = 5, /* the camera is there and cannot do what is asked: no rung cures that */
    SST_LADDER_TIME = 6,    /* due_ns has come */
    SST_LADDER_LOST = 7,    /* unplugged */
};

enum sst_ladder_phase {
    SST_LADDER_QUIET = 0,   /* frames flow, or no camera is there */
    SST_LADDER_WORKING = 1, /* a rung is being carried out */
    SST_LADDER_WAITING = 2, /* for a frame, until due_ns */
    SST_LADDER_RESTING = 3, /* backing off until due_ns */
};

struct sst_ladder {
    /* fixed after init */
    int64_t patience_ns; /* from a start to its first frame */
    bool usb;            /* the camera has a USB port: reset and authorisation make sense */
    bool port_power;
    /* the state */
    enum sst_ladder_phase phase;
    int rung;        /* last one tried; -1: none since all was well */
    int64_t due_ns;  /* wants SST_LADDER_TIME then; 0: never */
    int64_t well_ns; /* since when frames flow */
    int64_t back_off_ns;
};

void sst_ladder_init(struct sst_ladder *ladder, int64_t patience_ns, bool usb, bool port_power);

/**
 * Take an event at now_ns.
 *
 * @param streaming  the stream is open, so that restarting it can be tried
 * @return the rung (sst_grab_rung) to carry out now and to answer with DONE, FAILED or REFUSED, or -1: nothing.
 *         SST_GRAB_BACK_OFF: close the camera and do nothing; no answer is wanted.
 */
int sst_ladder_step(struct sst_ladder *ladder, enum sst_ladder_event event, int64_t now_ns, bool streaming);

/** Is the camera's going away what a rung is for? Then it is to be opened again when it is back. */
bool sst_ladder_expects_loss(const struct sst_ladder *ladder);

#endif
