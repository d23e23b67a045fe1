/* drivers/still/still.h - a still camera over USB (PTP, by libgphoto2): settings, exposures, files to the host. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_STILL_STILL_H
#define SST_DRIVERS_STILL_STILL_H

#include <stdbool.h>

#include "base/base.h"

#define SST_STILL_TEXT_MAX  64
#define SST_STILL_FILES_MAX 2 /* of an exposure: raw, JPEG */

struct sst_still; /* opaque; one thread at a time */

/** A still camera on the bus. */
struct sst_still_device {
    char port[SST_STILL_TEXT_MAX];   /* "1-2.3" as in sysfs */
    char serial[SST_STILL_TEXT_MAX]; /* of its USB descriptor; "" none */
    char name[2 * SST_STILL_TEXT_MAX];
    int bus, address; /* as in /dev/bus/usb */
    int error;        /* errno with which its device file cannot be opened; 0: it can */
};

/** All devices with a PTP interface (USB class 6/1/1), from sysfs only: nothing is opened. *devices to free with
 * free().
 *  @return 0, -ENOMEM or -EIO, logged */
SST_MUST_CHECK int sst_still_list(struct sst_still_device **devices, int *count);

/** Files of an exposure. */
enum sst_still_files {
    SST_STILL_JPEG = 1,
    SST_STILL_RAW = 2,
    SST_STILL_BOTH = 3,
};

enum sst_still_focus {
    SST_STILL_FOCUS_LEAVE = 0,  /* as the camera is set */
    SST_STILL_FOCUS_MANUAL = 1, /* as the lens is set */
    SST_STILL_FOCUS_LOCKED = 2, /* automatic for one exposure that is discarded, manual from then on */
};

struct sst_still_config {
    const char *camera;   /* serial or port; NULL or "": the only one */
    const char *exposure; /* time: "1/125", "0.5"; settings: NULL or "": as the camera is set */
    const char *aperture; /* "8" or "f/8" */
    const char *iso;      /* "100" */
    const char *format;   /* one of the camera's own names for the quality of its pictures */
    enum sst_still_focus focus;
    bool focused; /* locked: it was focused before, only set manual */
    enum sst_still_files files;
    int mirror_ms;       /* 0: no lock-up; else a release lifts the mirror and another one, this much later, exposes */
    int card_ms;         /* from a release until the files are written, and the longest time of being busy */
    int quiet_ms;        /* where an earlier release is possible, files are waited for that long; 0: card_ms */
    int response_ms;     /* time-out of an answer over USB */
    int reopen_ms;       /* time for a camera that was unplugged, or hangs, to come back */
    int battery_percent; /* no exposure with less */
    bool keep;           /* files stay on the card after sst_still_release_files() */
    const SST_ATOMIC(bool) * cancel; /* ends waiting; may be NULL */
};

void sst_still_config_defaults(struct sst_still_config *cfg);

/** -1: the camera does not report it. */
struct sst_still_state {
    int battery_percent;
    int64_t card_bytes, card_free_bytes;
    int card_pictures; /* that still fit */
};

/** A file of an exposure, complete and checked. */
struct sst_still_file {
    char name[SST_STILL_TEXT_MAX]; /* on the camera */
    bool raw;
    uint8_t *data; /* [bytes] */
    size_t bytes;
    int width, height; /* of a JPEG; raw: 0 */
};

struct sst_still_shot {
    int64_t release_ns; /* CLOCK_MONOTONIC; the exposure starts later */
    int files;
    struct sst_still_file file[SST_STILL_FILES_MAX]; /* the raw file first; valid until sst_still_release_files() */
};

struct sst_still_counters {
    int exposures;
    int busy;    /* releases that had to wait for the camera */
    int silent;  /* answers and files that did not come in time */
    int lost;    /* unplugged, or USB failed */
    int damaged; /* downloads with missing or damaged bytes */
    int refused; /* settings */
    int reopened;
};

/**
 * Open the camera, apply the settings and read them back.
 *
 * Every step is bounded: an answer by response_ms (the first one, by libgphoto2, by some 20 s), the rest by the times
 * of the configuration.
 *
 * @return 0, -ENODEV (none, or several: they are listed), -EACCES, -EBUSY (another program has it), -EPERM (it refuses
 * a setting), -EINVAL (it has no such setting or choice: they are listed), -ETIMEDOUT, -EIO, -ENOPKG (built without
 *  libgphoto2), -ECANCELED; logged.
 */
SST_MUST_CHECK int sst_still_open(struct sst_still **out, const struct sst_still_config *cfg);

/** Serial by PTP or, if it has none, by USB; "" none. Port as in sysfs. Valid until close. */
const char *sst_still_serial(const struct sst_still *still);
const char *sst_still_port(const struct sst_still *still);
/** The settings as the camera reports them: "exposure 0.0080s, aperture f/8, ...". */
const char *sst_still_settings(const struct sst_still *still);
void sst_still_state(const struct sst_still *still, struct sst_still_state *out); /* before the last exposure */
void sst_still_counters(const struct sst_still *still, struct sst_still_counters *out);

/**
 * Expose, wait for the files, download and check them. A camera that was lost is opened again; files that it had
 * announced before are then downloaded. A download that fails is repeated once. Files of other releases, also of
 * another program or an earlier capture, are never given: they stay on the card. The first exposure after
 * opening, after a failure or a busy camera lasts quiet_ms, since files of an earlier release may still come.
 *
 * @return 0, -EBUSY, -ETIMEDOUT (no files, no answers), -ENODEV (did not come back), -EIO, -EBADMSG (damaged file, or
 *  other files than asked for), -EPERM, -EINVAL (a setting changed and cannot be set back), -ENOMEDIUM (card full or
 *  missing, battery low: a person is needed), -ENOMEM, -ECANCELED; logged.
 */
SST_MUST_CHECK int sst_still_capture(struct sst_still *still, struct sst_still_shot *shot);

/** Free the files of the last exposure; unless they are to be kept, also on the camera's card. */
void sst_still_release_files(struct sst_still *still, struct sst_still_shot *shot);

/** NULL is fine. */
void sst_still_close(struct sst_still *still);

/**
 * Check a JPEG: it ends where its headers say, and decodes without a warning.
 * @return 0 or -EBADMSG; not logged
 */
SST_MUST_CHECK int sst_still_check_jpeg(const uint8_t *data, size_t bytes, int *width, int *height);

#endif
