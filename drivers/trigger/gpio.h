/* drivers/trigger/gpio.h - what the trigger needs of a GPIO chip; one back end per libgpiod API speaks to the kernel.
 */
#ifndef SST_DRIVERS_TRIGGER_GPIO_H
#define SST_DRIVERS_TRIGGER_GPIO_H

#include <stdbool.h>

#include "base/base.h"

#define SST_GPIO_LINES_MAX 64
#define SST_GPIO_NAME_MAX  64

struct sst_gpio_chip; /* opaque; one thread at a time */

struct sst_gpio_line {
    char name[SST_GPIO_NAME_MAX];     /* "" for unnamed lines */
    char consumer[SST_GPIO_NAME_MAX]; /* who holds it; "" if nobody says so */
    bool used;
};

/** Lines of one chip by offset. All outputs start inactive. */
struct sst_gpio_request {
    int outputs;
    unsigned output[SST_GPIO_LINES_MAX];
    int loopback;    /* offset of an input whose rising (inactive to active) edges are stamped; -1: none */
    bool active_low; /* of all of them */
};

struct sst_gpio_edge {
    int64_t t_ns;      /* CLOCK_MONOTONIC */
    uint32_t sequence; /* of the line's edges since the request, counted by the kernel from 1; 0: this API has none */
};

/* --- back end: gpio_v1.c, gpio_v2.c or, without libgpiod, gpio_none.c. Nothing is logged here. -------------------- */

/** Open by path. @return 0, -ENOENT, -EACCES, -ENOTTY (no GPIO chip), -ENOMEM, -ENOSYS (built without libgpiod). */
SST_MUST_CHECK int sst_gpio_chip_open(struct sst_gpio_chip **out, const char *path);
const char *sst_gpio_chip_label(const struct sst_gpio_chip *chip);
int sst_gpio_chip_lines(const struct sst_gpio_chip *chip);
SST_MUST_CHECK int sst_gpio_chip_line(struct sst_gpio_chip *chip, unsigned offset, struct sst_gpio_line *out);

/** Hold the lines until close; once per chip. @return 0, -EBUSY (a line is in use), -EINVAL, -errno of the kernel. */
SST_MUST_CHECK int sst_gpio_chip_request(struct sst_gpio_chip *chip, const struct sst_gpio_request *request);

/** Make output i of the request active where bit i of `active` is set, all in one ioctl. @return 0, -ENODEV, -EIO. */
SST_MUST_CHECK int sst_gpio_chip_set(struct sst_gpio_chip *chip, uint64_t active);

/** Wait up to timeout_ns (0: only look) for the next edge of the loop-back line.
 *  @return 1 (an edge), 0 (none), -ENODEV, -EIO, -EINTR. */
SST_MUST_CHECK int sst_gpio_chip_edge(struct sst_gpio_chip *chip, int64_t timeout_ns, struct sst_gpio_edge *out);

/** NULL is fine. Lines are released; what level they keep is the hardware's choice. */
void sst_gpio_chip_close(struct sst_gpio_chip *chip);

/* --- gpio.c: finding and judging chips ---------------------------------------------------------------------------- */

struct sst_gpio_wanted {
    const char *chip; /* label; "": the chip that has all the lines */
    int outputs;
    const char *output[SST_GPIO_LINES_MAX]; /* line name, or its offset in digits */
    const char *loopback;                   /* "": none */
    bool active_low;
};

struct sst_gpio_listed {
    char path[SST_GPIO_NAME_MAX], label[SST_GPIO_NAME_MAX];
    int lines;
    int error; /* errno of opening it */
};

/** All GPIO chips there are, by number. *out to free with free(). @return count, or -ENOMEM, -ENOSYS. Logs nothing. */
SST_MUST_CHECK int sst_gpio_list(struct sst_gpio_listed **out);

/** Find the one chip that `wanted` describes, and its lines; nothing is requested.
 *  @return 0, -ENODEV, -ENOTUNIQ (two chips would do), -EACCES, -EINVAL, -ENOSYS; the sentence goes to `why`. */
SST_MUST_CHECK int sst_gpio_find(struct sst_gpio_chip **chip, struct sst_gpio_request *request,
                                 const struct sst_gpio_wanted *wanted, char *why, size_t why_size);

/** Find, and hold the lines. @return also -EBUSY (the line and its holder are named) */
SST_MUST_CHECK int sst_gpio_open(struct sst_gpio_chip **chip, const struct sst_gpio_wanted *wanted, char *why,
                                 size_t why_size);

/** As open, but nothing is held, and `why` also names the chip that would be taken. */
SST_MUST_CHECK int sst_gpio_probe(const struct sst_gpio_wanted *wanted, char *why, size_t why_size);

/** How to get the right to open a GPIO chip, from the owner and mode that `path` has. */
void sst_gpio_access_remedy(const char *path, char *text, size_t size);

#endif
