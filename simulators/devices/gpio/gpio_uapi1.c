/* simulators/devices/gpio/gpio_uapi1.c - version 1 of the GPIO uAPI: line handles and line events. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "simulators/devices/gpio/gpio_internal.h"

#define HANDLE_EVENTS 1  /* a handle queues none; a ring has at least one entry */
#define EVENT_EVENTS  16 /* the kernel's queue of a line event */

/** A flag of version 2, and its form in version 1 in a request and in a line's info; 0: there is none. */
static const struct {
    uint64_t v2;
    uint32_t request, info;
} flag_table[] = {
    { GPIO_V2_LINE_FLAG_USED, 0, GPIOLINE_FLAG_KERNEL },
    { GPIO_V2_LINE_FLAG_INPUT, GPIOHANDLE_REQUEST_INPUT, 0 },
    { GPIO_V2_LINE_FLAG_OUTPUT, GPIOHANDLE_REQUEST_OUTPUT, GPIOLINE_FLAG_IS_OUT },
    { GPIO_V2_LINE_FLAG_ACTIVE_LOW, GPIOHANDLE_REQUEST_ACTIVE_LOW, GPIOLINE_FLAG_ACTIVE_LOW },
    { GPIO_V2_LINE_FLAG_OPEN_DRAIN, GPIOHANDLE_REQUEST_OPEN_DRAIN, GPIOLINE_FLAG_OPEN_DRAIN },
    { GPIO_V2_LINE_FLAG_OPEN_SOURCE, GPIOHANDLE_REQUEST_OPEN_SOURCE, GPIOLINE_FLAG_OPEN_SOURCE },
    { GPIO_V2_LINE_FLAG_BIAS_PULL_UP, GPIOHANDLE_REQUEST_BIAS_PULL_UP, GPIOLINE_FLAG_BIAS_PULL_UP },
    { GPIO_V2_LINE_FLAG_BIAS_PULL_DOWN, GPIOHANDLE_REQUEST_BIAS_PULL_DOWN, GPIOLINE_FLAG_BIAS_PULL_DOWN },
    { GPIO_V2_LINE_FLAG_BIAS_DISABLED, GPIOHANDLE_REQUEST_BIAS_DISABLE, GPIOLINE_FLAG_BIAS_DISABLE },
};

void gpio_info_to_v1(const struct gpio_v2_line_info *info, struct gpioline_info *out)
{
    memset(out, 0, sizeof(*out));
    out->line_offset = info->offset;
    memcpy(out->name, info->name, sizeof(out->name));
    memcpy(out->consumer, info->consumer, sizeof(out->consumer));
    for (size_t i = 0; i < ARRAY_LEN(flag_table); i++)
        if (info->flags & flag_table[i].v2)
            out->flags |= flag_table[i].info;
}

/** @return 0 or -EINVAL: unknown or contradicting flags */
static int flags_from_v1(uint32_t flags, uint64_t *out)
{
    const uint32_t bias =
        flags & (GPIOHANDLE_REQUEST_BIAS_PULL_UP | GPIOHANDLE_REQUEST_BIAS_PULL_DOWN | GPIOHANDLE_REQUEST_BIAS_DISABLE);
    const uint32_t drive = flags & (GPIOHANDLE_REQUEST_OPEN_DRAIN | GPIOHANDLE_REQUEST_OPEN_SOURCE);
    const uint32_t direction = flags & (GPIOHANDLE_REQUEST_INPUT | GPIOHANDLE_REQUEST_OUTPUT);
    uint64_t v2 = 0;

    for (size_t i = 0; i < ARRAY_LEN(flag_table); i++) {
        if (flags & flag_table[i].request)
            v2 |= flag_table[i].v2;
        flags &= ~flag_table[i].request;
    }
    if (flags || (direction & (direction - 1)) || (bias & (bias - 1)) || (drive & (drive - 1)))
        return -EINVAL;
    if ((drive && !(direction & GPIOHANDLE_REQUEST_OUTPUT)) || (bias && !direction))
        return -EINVAL;
    *out = v2;
    return 0;
}

int gpio_v1_handle(struct sst_sim_gpio_file *chip, struct gpiohandle_request *request,
                   struct sst_sim_gpio_file **opened, int64_t now_ns)
{
    struct gpio_want want[GPIOHANDLES_MAX];
    struct sst_sim_gpio_file *file;
    uint64_t flags;
    int err;

    if (request->lines == 0 || request->lines > GPIOHANDLES_MAX || flags_from_v1(request->flags, &flags) < 0)
        return -EINVAL;
    err = gpio_file_create(&file, chip->gpio, chip->chip, GPIO_FILE_HANDLE, HANDLE_EVENTS);
    if (err)
        return err;
    request->consumer_label[sizeof(request->consumer_label) - 1] = '\0';
    err = gpio_request_lines(file, request->lineoffsets, (int)request->lines, request->consumer_label);
    if (err) {
        sst_sim_gpio_close(file, now_ns);
        return err;
    }
    for (uint32_t i = 0; i < request->lines; i++)
        want[i] = (struct gpio_want){ .flags = flags, .value = request->default_values[i] != 0 };
    gpio_apply(file, want, GPIOLINE_CHANGED_REQUESTED, now_ns);
    *opened = file;
    return 0;
}

int gpio_v1_event(struct sst_sim_gpio_file *chip, struct gpioevent_request *request, struct sst_sim_gpio_file **opened,
                  int64_t now_ns)
{
    struct gpio_want want = { 0 };
    struct sst_sim_gpio_file *file;
    int err;

    /* No edges on outputs; no drive flags, which only outputs have. */
    if ((request->handleflags & GPIOHANDLE_REQUEST_OUTPUT) || (request->eventflags & ~GPIOEVENT_REQUEST_BOTH_EDGES) ||
        flags_from_v1(request->handleflags | GPIOHANDLE_REQUEST_INPUT, &want.flags) < 0)
        return -EINVAL;
    if (request->eventflags & GPIOEVENT_REQUEST_RISING_EDGE)
        want.flags |= GPIO_V2_LINE_FLAG_EDGE_RISING;
    if (request->eventflags & GPIOEVENT_REQUEST_FALLING_EDGE)
        want.flags |= GPIO_V2_LINE_FLAG_EDGE_FALLING;
    err = gpio_file_create(&file, chip->gpio, chip->chip, GPIO_FILE_EVENT, EVENT_EVENTS);
    if (err)
        return err;
    request->consumer_label[sizeof(request->consumer_label) - 1] = '\0';
    err = gpio_request_lines(file, &request->lineoffset, 1, request->consumer_label);
    if (err) {
        sst_sim_gpio_close(file, now_ns);
        return err;
    }
    gpio_apply(file, &want, GPIOLINE_CHANGED_REQUESTED, now_ns);
    *opened = file;
    return 0;
}

static int set_values(struct sst_sim_gpio_file *file, const struct gpiohandle_data *data, int64_t now_ns)
{
    /* All lines of a handle have one direction. */
    if (!(gpio_file_line(file, 0)->flags & GPIO_V2_LINE_FLAG_OUTPUT))
        return -EPERM;
    for (int i = 0; i < file->lines; i++) {
        struct gpio_line *line = gpio_file_line(file, i);

        line->drive = (data->values[i] != 0) != ((line->flags & GPIO_V2_LINE_FLAG_ACTIVE_LOW) != 0);
    }
    gpio_settle(file->gpio, now_ns);
    return 0;
}

static int set_config(struct sst_sim_gpio_file *file, const struct gpiohandle_config *config, int64_t now_ns)
{
    struct gpio_want want[GPIOHANDLES_MAX];
    uint64_t flags;

    if (flags_from_v1(config->flags, &flags) < 0)
        return -EINVAL;
    for (int i = 0; i < file->lines; i++)
        want[i] = (struct gpio_want){ .flags = flags, .value = config->default_values[i] != 0 };
    gpio_apply(file, want, GPIOLINE_CHANGED_CONFIG, now_ns);
    return 0;
}

int gpio_v1_request_ioctl(struct sst_sim_gpio_file *file, unsigned long request, void *arg, int64_t now_ns)
{
    if (request == GPIOHANDLE_GET_LINE_VALUES_IOCTL) {
        struct gpiohandle_data *data = arg;

        memset(data, 0, sizeof(*data));
        for (int i = 0; i < file->lines; i++)
            data->values[i] = gpio_line_value(file->gpio, gpio_file_line(file, i));
        return 0;
    }
    if (file->kind == GPIO_FILE_HANDLE && request == GPIOHANDLE_SET_LINE_VALUES_IOCTL)
        return set_values(file, arg, now_ns);
    if (file->kind == GPIO_FILE_HANDLE && request == GPIOHANDLE_SET_CONFIG_IOCTL)
        return set_config(file, arg, now_ns);
    return -EINVAL;
}
