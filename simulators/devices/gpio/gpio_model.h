/* simulators/devices/gpio/gpio_model.h - model of GPIO chips: uAPI v1 and v2, wires, faults; no I/O. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_GPIO_GPIO_MODEL_H
#define SST_SIMULATORS_DEVICES_GPIO_GPIO_MODEL_H

#include <stdbool.h>

#include "base/base.h"

#define SST_SIM_GPIO_CHIPS 4
#define SST_SIM_GPIO_NAME  32 /* as in <linux/gpio.h>, with the terminating zero */

struct sst_sim_gpio;      /* opaque; one thread; all times are ns on CLOCK_MONOTONIC and never go back */
struct sst_sim_gpio_file; /* an open chip or an open request for lines */

/** A wire that connects two lines to one net: one reads what the other drives. */
struct sst_sim_gpio_wire {
    int chip_a, line_a, chip_b, line_b;
};

struct sst_sim_gpio_chip {
    const char *name;         /* gpiochip0 */
    const char *label;        /* label by which programs select the chip */
    int lines;                /* 1..512 */
    const char *const *names; /* [lines]; NULL or "": an unnamed line */
};

enum sst_sim_gpio_fault {
    SST_SIM_GPIO_BUSY = 0,       /* 1: another driver holds the named lines: EBUSY */
    SST_SIM_GPIO_DENIED = 1,     /* 1: opening gives EACCES; 2: EPERM */
    SST_SIM_GPIO_VANISH = 2,     /* 1: the chip is gone: ENOENT, open files get ENODEV; 0: it is back */
    SST_SIM_GPIO_STUCK = 3,      /* 1: outputs accept values, but their pins do not follow */
    SST_SIM_GPIO_LOST_EDGES = 4, /* probability 0..1 that an edge event is lost before it is queued */
    SST_SIM_GPIO_TWIN =
        5, /* 1: the other chips have its label, 2: and its line names, 3: and two lines have one name */
    SST_SIM_GPIO_FAULTS = 6,
};

struct sst_sim_gpio_hooks {
    void *arg;
    /** A pin changed its level; `level` is that of the wire, regardless of active-low. */
    void (*pin)(void *arg, int chip, int line, bool level, int64_t t_ns);
    /** A file has become readable, or its chip has vanished. */
    void (*wake)(void *arg, struct sst_sim_gpio_file *file);
};

struct sst_sim_gpio_config {
    int chips, wires;
    const struct sst_sim_gpio_chip *chip; /* [chips]; copied */
    const struct sst_sim_gpio_wire *wire; /* [wires]; copied */
    int64_t realtime_ns;                  /* CLOCK_REALTIME minus CLOCK_MONOTONIC, for lines that ask for that clock */
    uint64_t seed;
    struct sst_sim_gpio_hooks hooks;
};

/** @return 0, -EINVAL (counts, a wire to a missing line), -ENOMEM */
SST_MUST_CHECK int sst_sim_gpio_create(struct sst_sim_gpio **out, const struct sst_sim_gpio_config *cfg);
void sst_sim_gpio_destroy(struct sst_sim_gpio *gpio); /* closes all open files */

/** Set a fault of one chip. @return 0 or -EINVAL (value) */
SST_MUST_CHECK int sst_sim_gpio_fault(struct sst_sim_gpio *gpio, int chip, enum sst_sim_gpio_fault fault, double value,
                                      int64_t now_ns);

/** Offset of a line by its name, or -1. */
int sst_sim_gpio_line(const struct sst_sim_gpio *gpio, int chip, const char *name);

/** Something outside of the machine drives a line's wire high, or lets it go. */
void sst_sim_gpio_drive(struct sst_sim_gpio *gpio, int chip, int line, bool high, int64_t now_ns);

/** Open a chip. @return 0, -ENODEV, -EACCES, -EPERM, -ENOMEM */
SST_MUST_CHECK int sst_sim_gpio_open(struct sst_sim_gpio *gpio, int chip, struct sst_sim_gpio_file **out);

/**
 * Handle an ioctl on a file as the kernel's gpiolib does.
 *
 * @param arg     of the request's size, in and out; the caller fills in the `fd` of a new request
 * @param opened  out: the new request file of GET_LINEHANDLE, GET_LINEEVENT and GET_LINE; else NULL
 * @return 0, -EINVAL, -EBUSY, -EPERM, -ENODEV, -ENOTTY, -EOPNOTSUPP, -ENOMEM
 */
SST_MUST_CHECK int sst_sim_gpio_ioctl(struct sst_sim_gpio_file *file, unsigned long request, void *arg,
                                      struct sst_sim_gpio_file **opened, int64_t now_ns);

/** Read as many whole events as fit. @return bytes, -EAGAIN (none now), -EINVAL (no room for one), -ENODEV (chip
 *  gone) */
SST_MUST_CHECK int sst_sim_gpio_read(struct sst_sim_gpio_file *file, void *out, size_t size);

/** True if a read would return an event now. */
bool sst_sim_gpio_readable(const struct sst_sim_gpio_file *file);
/** True if the chip is gone: the file can only be closed, even after the chip's return. */
bool sst_sim_gpio_gone(const struct sst_sim_gpio_file *file);

/** For the caller's own book-keeping. */
void sst_sim_gpio_set_user(struct sst_sim_gpio_file *file, void *user);
void *sst_sim_gpio_user(const struct sst_sim_gpio_file *file);

/** Close a file; the lines of a request are released and outputs return to their idle level. NULL is fine. */
void sst_sim_gpio_close(struct sst_sim_gpio_file *file, int64_t now_ns);

/** Time of the next sst_sim_gpio_tick() for debouncing; INT64_MAX: none. */
int64_t sst_sim_gpio_due(const struct sst_sim_gpio *gpio);
void sst_sim_gpio_tick(struct sst_sim_gpio *gpio, int64_t now_ns);

#endif
