/* simulators/devices/ptp/ptp_model.h - model of a still camera that speaks PTP (ISO 15740) over USB; no I/O. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_PTP_PTP_MODEL_H
#define SST_SIMULATORS_DEVICES_PTP_PTP_MODEL_H

#include <stdbool.h>

#include "base/base.h"

struct sst_sim_ptp; /* opaque; one thread */

/** Faults of the camera; a value of 0 is none. */
enum sst_sim_ptp_fault {
    SST_SIM_PTP_BUSY = 0,       /* the next request to capture, and more within this time in ms after it: DeviceBusy */
    SST_SIM_PTP_CARD_FULL = 1,  /* 1: the card has no space */
    SST_SIM_PTP_BATTERY = 2,    /* level of the battery in percent */
    SST_SIM_PTP_REFUSE = 3,     /* this many settings are refused: AccessDenied */
    SST_SIM_PTP_CORRUPT = 4,    /* the next file: 1 its end is missing on the card, 2 bytes are wrong on the card,
                                   3 fewer bytes are sent than announced, once */
    SST_SIM_PTP_SILENCE = 5,    /* 1: no answers until the interface is released or reset */
    SST_SIM_PTP_DOWNLOAD = 6,   /* unplugged in the middle of the next download, for this time in ms */
    SST_SIM_PTP_NO_EVENT = 7,   /* this many pictures are not announced by events */
    SST_SIM_PTP_DIAL = 8,       /* the exposure time is set at the camera itself, in 0.1 ms */
    SST_SIM_PTP_LATE_EVENT = 9, /* the next picture is announced this time in ms after it is on the card */
    SST_SIM_PTP_REPEAT = 10,    /* 1: files are announced again and again until they are downloaded */
    SST_SIM_PTP_FAULTS = 11,
};

/** Conditions of an exposure. */
struct sst_sim_ptp_exposure {
    int shot;      /* from 1 */
    int64_t t_ns;  /* start of exposure, CLOCK_MONOTONIC */
    double time_s; /* exposure time */
    double gain;   /* of sensitivity and aperture, 1 at ISO 100 and f/8 */
};

struct sst_sim_ptp_config {
    const char *serial;
    int width, height;   /* of a picture */
    int exposure_us;     /* exposure time at power-on */
    int64_t card_bytes;  /* capacity */
    int battery_percent; /* at power-on */
    int lag_ms;          /* from the release to the exposure */
    int write_ms;        /* from the exposure to the file on the card */
    bool mirror_lockup;  /* the first release lifts the mirror, the second one exposes */
    bool buffer;         /* releases while earlier pictures are written, up to 4 */
    void *arg;
    /** The file of an exposure. @param data  out, to free with free() @return 0 or -errno */
    int (*expose)(void *arg, const struct sst_sim_ptp_exposure *exposure, bool raw, uint8_t **data, size_t *bytes);
    /** A file is on the card. */
    void (*stored)(void *arg, int shot, const char *name, const uint8_t *data, size_t bytes);
    double (*fault)(void *arg, enum sst_sim_ptp_fault fault);
    void (*spend)(void *arg, enum sst_sim_ptp_fault fault); /* it happened: count it down, or end it */
    void (*unplug)(void *arg, int ms);                      /* for this time, from now on */
};

SST_MUST_CHECK int sst_sim_ptp_create(struct sst_sim_ptp **out, const struct sst_sim_ptp_config *cfg);
/** NULL is fine. */
void sst_sim_ptp_destroy(struct sst_sim_ptp *p);

/** A transfer arrived at the bulk endpoint. @return 0, or -EPIPE: no PTP container, the endpoint halts */
SST_MUST_CHECK int sst_sim_ptp_out(struct sst_sim_ptp *p, const uint8_t *data, size_t bytes, int64_t now_ns);
/** The next bytes of the bulk endpoint. @return bytes, less than size at the end of a phase; -EAGAIN: none */
SST_MUST_CHECK int sst_sim_ptp_in(struct sst_sim_ptp *p, uint8_t *out, size_t size);
/** The next event of the interrupt endpoint, @return as of the bulk endpoint. */
SST_MUST_CHECK int sst_sim_ptp_event(struct sst_sim_ptp *p, uint8_t *out, size_t size);
/** A class request: cancel, reset, status. @param data  [wLength] @return bytes of the answer, or -EPIPE */
SST_MUST_CHECK int sst_sim_ptp_request(struct sst_sim_ptp *p, const uint8_t setup[8], uint8_t *data);
/** The host let go of the interface: the session and transfers in flight end; the card and the settings stay. */
void sst_sim_ptp_released(struct sst_sim_ptp *p);

/** Somebody presses the button on the camera, unless an exposure starts already. */
void sst_sim_ptp_press(struct sst_sim_ptp *p, int64_t now_ns);

/** When sst_sim_ptp_tick() is due; INT64_MAX: nothing is going on. */
int64_t sst_sim_ptp_due_ns(const struct sst_sim_ptp *p);
/** Go on with an exposure. Events and data may be there afterwards. */
void sst_sim_ptp_tick(struct sst_sim_ptp *p, int64_t now_ns);

/** Exposures so far, and files on the card. */
int sst_sim_ptp_shots(const struct sst_sim_ptp *p);
int sst_sim_ptp_files(const struct sst_sim_ptp *p);

/**
 * A raw file as cameras write them: an uncompressed DNG of 8-bit Bayer samples (RGGB) in sRGB's curve, with the table
 * that makes them linear.
 *
 * @param out  to free with free() @return 0 or -ENOMEM
 */
SST_MUST_CHECK int sst_sim_ptp_dng(const uint8_t *bayer, int width, int height, uint8_t **out, size_t *bytes);

#endif
