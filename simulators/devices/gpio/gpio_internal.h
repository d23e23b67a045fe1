/* simulators/devices/gpio/gpio_internal.h - shared by the files of the GPIO model only. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_GPIO_GPIO_INTERNAL_H
#define SST_SIMULATORS_DEVICES_GPIO_GPIO_INTERNAL_H

#include <linux/gpio.h>

#include "simulators/devices/gpio/gpio_model.h"

#define GPIO_EDGES (GPIO_V2_LINE_FLAG_EDGE_RISING | GPIO_V2_LINE_FLAG_EDGE_FALLING)
#define GPIO_BIASES                                                                                                    \
    (GPIO_V2_LINE_FLAG_BIAS_PULL_UP | GPIO_V2_LINE_FLAG_BIAS_PULL_DOWN | GPIO_V2_LINE_FLAG_BIAS_DISABLED)
#define GPIO_DRIVES (GPIO_V2_LINE_FLAG_OPEN_DRAIN | GPIO_V2_LINE_FLAG_OPEN_SOURCE)

enum gpio_file_kind {
    GPIO_FILE_CHIP = 0,
    GPIO_FILE_HANDLE = 1, /* v1 line handle */
    GPIO_FILE_EVENT = 2,  /* v1 line event */
    GPIO_FILE_LINES = 3,  /* v2 request */
};

struct gpio_line {
    char name[SST_SIM_GPIO_NAME];
    char consumer[SST_SIM_GPIO_NAME];
    struct sst_sim_gpio_file *owner;
    int net;
    uint64_t flags;       /* GPIO_V2_LINE_FLAG_* but USED */
    uint32_t debounce_us; /* 0: none */
    bool drive;           /* the level that an output drives */
    bool outside;         /* something outside of the machine drives the wire high */
    bool seen;            /* last level accepted by the edge detector */
    int64_t settle_ns;    /* time at which a different level is accepted; INT64_MAX: no pending change */
    uint32_t line_seqno;
};

struct gpio_chip {
    char name[SST_SIM_GPIO_NAME], label[SST_SIM_GPIO_NAME];
    int lines;
    struct gpio_line *line;
    double fault[SST_SIM_GPIO_FAULTS];
};

struct sst_sim_gpio_file {
    struct sst_sim_gpio *gpio;
    struct sst_sim_gpio_file *next;
    enum gpio_file_kind kind;
    int chip;
    bool gone;
    void *user;
    /* chips */
    int watch_abi;    /* uAPI version of the line-info events; 0: not yet known */
    uint8_t *watched; /* [lines] */
    /* requests */
    int lines;
    uint32_t offset[GPIO_V2_LINES_MAX];
    uint32_t seqno;
    /* events: struct gpio_v2_line_event of requests, struct gpio_v2_line_info_changed of chips */
    uint8_t *ring;
    size_t record;
    unsigned capacity, head, count;
};

struct sst_sim_gpio {
    struct gpio_chip chip[SST_SIM_GPIO_CHIPS];
    int chips, nets;
    bool *level;      /* [nets] */
    uint8_t *scratch; /* [3][nets] of gpio_settle() */
    int64_t realtime_ns;
    uint64_t random;
    struct sst_sim_gpio_hooks hooks;
    struct sst_sim_gpio_file *files;
};

/* --- gpio_model.c: lines, wires and events ------------------------------------------------------------------------ */

struct gpio_line *gpio_file_line(const struct sst_sim_gpio_file *file, int i);
SST_MUST_CHECK int gpio_file_create(struct sst_sim_gpio_file **out, struct sst_sim_gpio *gpio, int chip,
                                    enum gpio_file_kind kind, unsigned capacity);
/** Update the levels of all wires after a change of outputs, and generate the resulting edges. */
void gpio_settle(struct sst_sim_gpio *gpio, int64_t now_ns);
/** As programs see it. */
const char *gpio_shown_label(const struct sst_sim_gpio *gpio, int chip);
void gpio_line_info(const struct sst_sim_gpio *gpio, int chip, uint32_t offset, struct gpio_v2_line_info *out);
bool gpio_line_value(const struct sst_sim_gpio *gpio, const struct gpio_line *line); /* logical */

/* --- gpio_uapi1.c, gpio_uapi2.c: requests and configurations ------------------------------------------------------ */

void gpio_info_to_v1(const struct gpio_v2_line_info *info, struct gpioline_info *out);
SST_MUST_CHECK int gpio_v1_handle(struct sst_sim_gpio_file *chip, struct gpiohandle_request *request,
                                  struct sst_sim_gpio_file **opened, int64_t now_ns);
SST_MUST_CHECK int gpio_v1_event(struct sst_sim_gpio_file *chip, struct gpioevent_request *request,
                                 struct sst_sim_gpio_file **opened, int64_t now_ns);
SST_MUST_CHECK int gpio_v1_request_ioctl(struct sst_sim_gpio_file *file, unsigned long request, void *arg,
                                         int64_t now_ns);

/** Requested configuration of a line. */
struct gpio_want {
    uint64_t flags;
    uint32_t debounce_us;
    bool value; /* logical, of an output */
};

/** Request lines for a new file; all or none. @return 0, -EINVAL (offset), -EBUSY */
SST_MUST_CHECK int gpio_request_lines(struct sst_sim_gpio_file *file, const uint32_t *offsets, int lines,
                                      const char *consumer);
/** Apply the flags to the file's lines; watchers are notified of `what`. */
void gpio_apply(struct sst_sim_gpio_file *file, const struct gpio_want *want, uint32_t what, int64_t now_ns);

#endif
