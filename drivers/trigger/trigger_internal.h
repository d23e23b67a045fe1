/* drivers/trigger/trigger_internal.h - private declarations of this folder; code outside of it includes the public
 * headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_TRIGGER_TRIGGER_INTERNAL_H
#define SST_DRIVERS_TRIGGER_TRIGGER_INTERNAL_H

#include <stdbool.h>

#include "base/base.h"

/* --- gpio: access to a GPIO chip; one back end per libgpiod API. --- */

#define SST_GPIO_LINES_MAX 64
#define SST_GPIO_NAME_MAX  64
#define SST_GPIO_CHIP_MAX  256

struct trigger_chip; /* opaque; one thread at a time */

struct trigger_line {
    char name[SST_GPIO_NAME_MAX];     /* "" for unnamed lines */
    char consumer[SST_GPIO_NAME_MAX]; /* the program that holds it; "" if unknown */
    bool used;
};

/** Lines of one chip by offset. All outputs start inactive. */
struct gpio_request {
    int outputs;
    unsigned output[SST_GPIO_LINES_MAX];
    int loopback;    /* offset of an input with stamped rising (inactive to active) edges; -1: none */
    bool active_low; /* of all lines */
};

struct gpio_edge {
    int64_t t_ns;      /* CLOCK_MONOTONIC */
    uint32_t sequence; /* of the line's edges since the request, counted by the kernel from 1; 0: this API has none */
};

/* --- back end: gpio_v1.c, gpio_v2.c or, without libgpiod, gpio_none.c. Nothing is logged here. -------------------- */

/** Open by path. @return 0, -ENOENT, -EACCES, -ENOTTY (no GPIO chip), -ENOMEM, -ENOSYS (built without libgpiod). */
SST_MUST_CHECK int gpio_chip_open(struct trigger_chip **out, const char *path);
const char *gpio_chip_label(const struct trigger_chip *chip);
int gpio_chip_lines(const struct trigger_chip *chip);
SST_MUST_CHECK int gpio_chip_line(struct trigger_chip *chip, unsigned offset, struct trigger_line *out);

/** Request the lines until close; once per chip. @return 0, -EBUSY (a line is in use), -EINVAL, -errno. */
SST_MUST_CHECK int gpio_chip_request(struct trigger_chip *chip, const struct gpio_request *request);

/** Make output i of the request active where bit i of `active` is set, all in one ioctl. @return 0, -ENODEV, -EIO. */
SST_MUST_CHECK int gpio_chip_set(struct trigger_chip *chip, uint64_t active);

/** Wait up to timeout_ns (0: poll) for the next edge of the loop-back line.
 *  @return 1 (an edge), 0 (none), -ENODEV, -EIO, -EINTR. */
SST_MUST_CHECK int gpio_chip_edge(struct trigger_chip *chip, int64_t timeout_ns, struct gpio_edge *out);

/** NULL is fine. Lines are released; their level then depends on the hardware. */
void gpio_chip_close(struct trigger_chip *chip);

/* --- gpio.c: finds and checks chips ------------------------------------------------------------------------------- */

struct gpio_wanted {
    const char *chip; /* label, path in /dev, device in sysfs; "": the chip that has all the lines */
    int outputs;
    const char *output[SST_GPIO_LINES_MAX]; /* line name, or its offset in digits */
    const char *loopback;                   /* "": none */
    bool active_low;
};

struct gpio_listed {
    char path[SST_GPIO_NAME_MAX], label[SST_GPIO_NAME_MAX];
    int lines;
    int error; /* errno of opening it */
};

/** Find the one chip that `wanted` describes, and request its lines. @return 0, -ENODEV, -ENOTUNIQ (two chips match),
 *  -EACCES, -EINVAL, -EBUSY (with the line and its consumer); `why` gets one sentence. */
SST_MUST_CHECK int gpio_open(struct trigger_chip **chip, const struct gpio_wanted *wanted, char *why, size_t why_size);

/** Like open, but requests nothing, and `why` also names the chip on success. */
SST_MUST_CHECK int gpio_probe(const struct gpio_wanted *wanted, char *why, size_t why_size);

/* --- pulse: timing of a pulse train, without I/O: ticks, steps of a pulse. --- */

/** One change of lines. */
struct pulse_step {
    int64_t at_ns;   /* after the tick */
    uint64_t active; /* bit i: line i is active from then on */
};

/**
 * Line changes of one tick in order of time: lines of equal delay change together, and simultaneous rising and falling
 * edges are one step.
 *
 * @param step      out [2 * lines], the first one raises, the last one leaves all lines inactive
 * @param delay_us  [lines], 0..; lines 1..64, pulse_us > 0
 * @return number of steps
 */
int pulse_steps(struct pulse_step *step, const int *delay_us, int lines, int pulse_us);

/** Time of tick n, from the start of the train: rounding errors do not accumulate. */
int64_t tick_due_ns(int64_t start_ns, double rate_hz, uint64_t n);

/** The first tick from n on that is at most half a period late at now_ns. */
uint64_t tick_next(int64_t start_ns, double rate_hz, uint64_t n, int64_t now_ns);

/** An edge stamp on CLOCK_MONOTONIC. Kernels before 5.7 use CLOCK_REALTIME; the clock with a current reading
 *  nearer to the stamp is assumed. */
int64_t edge_monotonic(int64_t stamp_ns, int64_t monotonic_ns, int64_t realtime_ns);

static inline int64_t pulse_ns(int64_t s, int64_t ns)
{
    return s * 1000000000 + ns;
}

#endif
