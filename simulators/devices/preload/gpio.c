/* simulators/devices/preload/gpio.c - GPIO in the program: requests that return a descriptor. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <linux/gpio.h>
#include <stddef.h>
#include <string.h>

#include "simulators/devices/preload/preload_internal.h"

/* @return offset of `fd` in the argument of a line request, or 0 */
static size_t fd_at(unsigned long request)
{
    switch (request) {
    case GPIO_GET_LINEHANDLE_IOCTL:
        return offsetof(struct gpiohandle_request, fd);
    case GPIO_GET_LINEEVENT_IOCTL:
        return offsetof(struct gpioevent_request, fd);
    case GPIO_V2_GET_LINE_IOCTL:
        return offsetof(struct gpio_v2_line_request, fd);
    default:
        return 0;
    }
}

static int gpio_ioctl(int fd, const struct sim_id *id, unsigned long request, void *arg)
{
    const size_t at = fd_at(request);
    int lines = -1, result;

    if (!at)
        return sim_ioctl_areas(fd, id, &(struct sim_ioctl){ request, arg, NULL, 0 }, NULL);
    result = sim_ioctl_areas(fd, id, &(struct sim_ioctl){ request, arg, NULL, 0 }, &lines);
    if (result < 0) {
        if (lines >= 0)
            (void)sim_next()->close_(lines);
        return result;
    }
    if (lines < 0)
        return -EMFILE;
    sim_mark(lines);
    memcpy((char *)arg + at, &lines, sizeof(lines));
    return result;
}

const struct sim_class sim_class_gpio = {
    .letter = 'g',
    .ioctl_type = (char)0xb4,
    .ioctl = gpio_ioctl,
    .read_calls = true,
};
