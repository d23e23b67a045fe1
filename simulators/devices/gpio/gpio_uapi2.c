/* simulators/devices/gpio/gpio_uapi2.c - version 2 of the GPIO uAPI: line requests; and the ioctls of the chip itself.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "simulators/devices/gpio/gpio_internal.h"

#define EVENTS_PER_LINE 16 /* the kernel's queue unless the request says otherwise */

static bool all_zero(const uint32_t *words, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (words[i])
            return false;
    return true;
}

/* --- configurations ----------------------------------------------------------------------------------------------- */

/** The first attribute of a kind that applies to a line, or NULL. */
static const struct gpio_v2_line_attribute *attribute(const struct gpio_v2_line_config *config, uint32_t id, int line)
{
    for (uint32_t i = 0; i < config->num_attrs; i++)
        if (config->attrs[i].attr.id == id && (config->attrs[i].mask >> line & 1))
            return &config->attrs[i].attr;
    return NULL;
}

static int check_flags(uint64_t flags)
{
    const uint64_t known = GPIO_V2_LINE_FLAG_ACTIVE_LOW | GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_OUTPUT |
                           GPIO_EDGES | GPIO_DRIVES | GPIO_BIASES | GPIO_V2_LINE_FLAG_EVENT_CLOCK_REALTIME |
                           GPIO_V2_LINE_FLAG_EVENT_CLOCK_HTE;
    const uint64_t direction = flags & (GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_OUTPUT);
    const uint64_t bias = flags & GPIO_BIASES, drive = flags & GPIO_DRIVES;
    const uint64_t clock = flags & (GPIO_V2_LINE_FLAG_EVENT_CLOCK_REALTIME | GPIO_V2_LINE_FLAG_EVENT_CLOCK_HTE);

    if ((flags & ~known) || (direction & (direction - 1)) || (bias & (bias - 1)) || (drive & (drive - 1)) ||
        (clock & (clock - 1)))
        return -EINVAL;
    if (clock & GPIO_V2_LINE_FLAG_EVENT_CLOCK_HTE)
        return -EOPNOTSUPP; /* no hardware time-stamp engine here */
    if (((flags & GPIO_EDGES) && !(direction & GPIO_V2_LINE_FLAG_INPUT)) ||
        (drive && !(direction & GPIO_V2_LINE_FLAG_OUTPUT)) || (bias && !direction))
        return -EINVAL;
    return 0;
}

/** Parse the requested configuration of each line. @return 0, -EINVAL, -EOPNOTSUPP */
static int read_config(const struct gpio_v2_line_config *config, int lines, struct gpio_want *want)
{
    if (config->num_attrs > GPIO_V2_LINE_NUM_ATTRS_MAX || !all_zero(config->padding, ARRAY_LEN(config->padding)))
        return -EINVAL;
    for (int i = 0; i < lines; i++) {
        const struct gpio_v2_line_attribute *flags = attribute(config, GPIO_V2_LINE_ATTR_ID_FLAGS, i);
        const struct gpio_v2_line_attribute *values = attribute(config, GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES, i);
        const struct gpio_v2_line_attribute *debounce = attribute(config, GPIO_V2_LINE_ATTR_ID_DEBOUNCE, i);
        int err;

        want[i].flags = flags ? flags->flags : config->flags;
        want[i].debounce_us = debounce ? debounce->debounce_period_us : 0;
        want[i].value = values && (values->values >> i & 1);
        err = check_flags(want[i].flags);
        if (err)
            return err;
        if (want[i].debounce_us > 0 && !(want[i].flags & GPIO_V2_LINE_FLAG_INPUT))
            return -EINVAL;
    }
    return 0;
}

/* --- requests ----------------------------------------------------------------------------------------------------- */

static int request_lines(struct sst_sim_gpio_file *chip, struct gpio_v2_line_request *request,
                         struct sst_sim_gpio_file **opened, int64_t now_ns)
{
    struct gpio_want want[GPIO_V2_LINES_MAX];
    struct sst_sim_gpio_file *file;
    uint32_t events = request->event_buffer_size;
    int err;

    if (request->num_lines == 0 || request->num_lines > GPIO_V2_LINES_MAX ||
        !all_zero(request->padding, ARRAY_LEN(request->padding)))
        return -EINVAL;
    err = read_config(&request->config, (int)request->num_lines, want);
    if (err)
        return err;
    if (events == 0)
        events = request->num_lines * EVENTS_PER_LINE;
    else if (events > GPIO_V2_LINES_MAX * EVENTS_PER_LINE)
        events = GPIO_V2_LINES_MAX * EVENTS_PER_LINE;
    err = gpio_file_create(&file, chip->gpio, chip->chip, GPIO_FILE_LINES, events);
    if (err)
        return err;
    request->consumer[sizeof(request->consumer) - 1] = '\0';
    err = gpio_request_lines(file, request->offsets, (int)request->num_lines, request->consumer);
    if (err) {
        sst_sim_gpio_close(file, now_ns);
        return err;
    }
    gpio_apply(file, want, GPIO_V2_LINE_CHANGED_REQUESTED, now_ns);
    *opened = file;
    return 0;
}

static uint64_t lines_of(const struct sst_sim_gpio_file *file)
{
    return file->lines == 64 ? UINT64_MAX : (1ULL << file->lines) - 1;
}

static int get_values(const struct sst_sim_gpio_file *file, struct gpio_v2_line_values *values)
{
    if (!(values->mask & lines_of(file)))
        return -EINVAL;
    values->bits = 0;
    for (int i = 0; i < file->lines; i++)
        if ((values->mask >> i & 1) && gpio_line_value(file->gpio, gpio_file_line(file, i)))
            values->bits |= 1ULL << i;
    return 0;
}

/** All lines of the mask change at the same time, or none. */
static int set_values(struct sst_sim_gpio_file *file, const struct gpio_v2_line_values *values, int64_t now_ns)
{
    if (!(values->mask & lines_of(file)))
        return -EINVAL;
    for (int i = 0; i < file->lines; i++)
        if ((values->mask >> i & 1) && !(gpio_file_line(file, i)->flags & GPIO_V2_LINE_FLAG_OUTPUT))
            return -EPERM;
    for (int i = 0; i < file->lines; i++) {
        struct gpio_line *line = gpio_file_line(file, i);

        if (values->mask >> i & 1)
            line->drive = (values->bits >> i & 1) != ((line->flags & GPIO_V2_LINE_FLAG_ACTIVE_LOW) != 0);
    }
    gpio_settle(file->gpio, now_ns);
    return 0;
}

static int request_ioctl(struct sst_sim_gpio_file *file, unsigned long request, void *arg, int64_t now_ns)
{
    struct gpio_want want[GPIO_V2_LINES_MAX];
    int err;

    switch (request) {
    case GPIO_V2_LINE_GET_VALUES_IOCTL:
        return get_values(file, arg);
    case GPIO_V2_LINE_SET_VALUES_IOCTL:
        return set_values(file, arg, now_ns);
    case GPIO_V2_LINE_SET_CONFIG_IOCTL:
        err = read_config(arg, file->lines, want);
        if (!err)
            gpio_apply(file, want, GPIO_V2_LINE_CHANGED_CONFIG, now_ns);
        return err;
    default:
        return -EINVAL;
    }
}

/* --- the chip ----------------------------------------------------------------------------------------------------- */

/** Info of a line in either version, optionally starting a watch. */
static int line_info(struct sst_sim_gpio_file *file, int abi, bool watch, uint32_t offset, void *out)
{
    struct gpio_v2_line_info info;

    if (offset >= (uint32_t)file->gpio->chip[file->chip].lines)
        return -EINVAL;
    if (watch) {
        if (file->watch_abi && file->watch_abi != abi)
            return -EPERM; /* all events of a file have one format */
        if (file->watched[offset])
            return -EBUSY;
        file->watch_abi = abi;
        file->watched[offset] = 1;
    }
    gpio_line_info(file->gpio, file->chip, offset, &info);
    if (abi == 1)
        gpio_info_to_v1(&info, out);
    else
        memcpy(out, &info, sizeof(info));
    return 0;
}

static int unwatch(struct sst_sim_gpio_file *file, uint32_t offset)
{
    if (offset >= (uint32_t)file->gpio->chip[file->chip].lines)
        return -EINVAL;
    if (!file->watched[offset])
        return -EBUSY;
    file->watched[offset] = 0;
    return 0;
}

static int chip_info(const struct sst_sim_gpio_file *file, struct gpiochip_info *info)
{
    const struct gpio_chip *chip = &file->gpio->chip[file->chip];

    memset(info, 0, sizeof(*info));
    memcpy(info->name, chip->name, sizeof(info->name));
    memcpy(info->label, gpio_shown_label(file->gpio, file->chip), sizeof(info->label));
    info->lines = (uint32_t)chip->lines;
    return 0;
}

int sst_sim_gpio_ioctl(struct sst_sim_gpio_file *file, unsigned long request, void *arg,
                       struct sst_sim_gpio_file **opened, int64_t now_ns)
{
    struct gpioline_info *v1 = arg;
    struct gpio_v2_line_info *v2 = arg;

    *opened = NULL;
    if (file->gone)
        return -ENODEV;
    if (file->kind == GPIO_FILE_LINES)
        return request_ioctl(file, request, arg, now_ns);
    if (file->kind != GPIO_FILE_CHIP)
        return gpio_v1_request_ioctl(file, request, arg, now_ns);
    switch (request) {
    case GPIO_GET_CHIPINFO_IOCTL:
        return chip_info(file, arg);
    case GPIO_GET_LINEINFO_IOCTL:
    case GPIO_GET_LINEINFO_WATCH_IOCTL:
        return line_info(file, 1, request == GPIO_GET_LINEINFO_WATCH_IOCTL, v1->line_offset, arg);
    case GPIO_GET_LINEINFO_UNWATCH_IOCTL:
        return unwatch(file, *(const uint32_t *)arg);
    case GPIO_GET_LINEHANDLE_IOCTL:
        return gpio_v1_handle(file, arg, opened, now_ns);
    case GPIO_GET_LINEEVENT_IOCTL:
        return gpio_v1_event(file, arg, opened, now_ns);
    case GPIO_V2_GET_LINEINFO_IOCTL:
    case GPIO_V2_GET_LINEINFO_WATCH_IOCTL:
        if (!all_zero(v2->padding, ARRAY_LEN(v2->padding)))
            return -EINVAL;
        return line_info(file, 2, request == GPIO_V2_GET_LINEINFO_WATCH_IOCTL, v2->offset, arg);
    case GPIO_V2_GET_LINE_IOCTL:
        return request_lines(file, arg, opened, now_ns);
    default:
        return -EINVAL;
    }
}
