/* libgpiod 2.x: outputs and the loop-back line are one line request. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/trigger/trigger_internal.h"

#include <errno.h>
#include <gpiod.h>
#include <stdio.h>
#include <stdlib.h>

#define CONSUMER "sst-trigger"

struct trigger_chip {
    struct gpiod_chip *chip;
    struct gpiod_chip_info *info;
    struct gpiod_line_request *request;     /* NULL until requested */
    struct gpiod_edge_event_buffer *events; /* of one event; NULL until requested */
    unsigned output[SST_GPIO_LINES_MAX];
    int outputs;
};

int gpio_chip_open(struct trigger_chip **out, const char *path)
{
    struct trigger_chip *c = calloc(1, sizeof(*c));
    int err;

    if (!c)
        return -ENOMEM;
    c->chip = gpiod_chip_open(path);
    if (c->chip)
        c->info = gpiod_chip_get_info(c->chip);
    if (!c->info) {
        err = -errno;
        gpio_chip_close(c);
        return err;
    }
    *out = c;
    return 0;
}

const char *gpio_chip_label(const struct trigger_chip *c)
{
    return gpiod_chip_info_get_label(c->info);
}

int gpio_chip_lines(const struct trigger_chip *c)
{
    return (int)gpiod_chip_info_get_num_lines(c->info);
}

int gpio_chip_line(struct trigger_chip *c, unsigned offset, struct trigger_line *out)
{
    struct gpiod_line_info *info = gpiod_chip_get_line_info(c->chip, offset);
    const char *name, *consumer;

    if (!info)
        return -errno;
    name = gpiod_line_info_get_name(info);
    consumer = gpiod_line_info_get_consumer(info);
    out->used = gpiod_line_info_is_used(info);
    snprintf(out->name, sizeof(out->name), "%s", name ? name : "");
    snprintf(out->consumer, sizeof(out->consumer), "%s", consumer ? consumer : "");
    gpiod_line_info_free(info);
    return 0;
}

/* Outputs and input in one configuration, hence one ioctl. */
static int configure(struct gpiod_line_config *config, struct gpiod_line_settings *settings,
                     const struct gpio_request *r)
{
    const unsigned loopback = (unsigned)r->loopback;

    gpiod_line_settings_set_active_low(settings, r->active_low);
    if (r->outputs && (gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_OUTPUT) ||
                       gpiod_line_settings_set_output_value(settings, GPIOD_LINE_VALUE_INACTIVE) ||
                       gpiod_line_config_add_line_settings(config, r->output, (size_t)r->outputs, settings)))
        return -errno;
    if (r->loopback < 0)
        return 0;
    if (gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_INPUT) ||
        gpiod_line_settings_set_edge_detection(settings, GPIOD_LINE_EDGE_RISING) ||
        gpiod_line_settings_set_event_clock(settings, GPIOD_LINE_CLOCK_MONOTONIC) ||
        gpiod_line_config_add_line_settings(config, &loopback, 1, settings))
        return -errno;
    return 0;
}

int gpio_chip_request(struct trigger_chip *c, const struct gpio_request *r)
{
    struct gpiod_line_settings *settings = gpiod_line_settings_new();
    struct gpiod_line_config *config = gpiod_line_config_new();
    struct gpiod_request_config *how = gpiod_request_config_new();
    struct gpiod_edge_event_buffer *events = gpiod_edge_event_buffer_new(1);
    int err = -ENOMEM;

    if (!settings || !config || !how || !events)
        goto out;
    err = configure(config, settings, r);
    if (err)
        goto out;
    gpiod_request_config_set_consumer(how, CONSUMER);
    c->request = gpiod_chip_request_lines(c->chip, how, config);
    if (!c->request) {
        err = -errno;
        goto out;
    }
    c->events = events;
    events = NULL;
    c->outputs = r->outputs;
    for (int i = 0; i < r->outputs; i++)
        c->output[i] = r->output[i];
out:
    gpiod_edge_event_buffer_free(events);
    gpiod_request_config_free(how);
    gpiod_line_config_free(config);
    gpiod_line_settings_free(settings);
    return err;
}

int gpio_chip_set(struct trigger_chip *c, uint64_t active)
{
    enum gpiod_line_value values[SST_GPIO_LINES_MAX];

    for (int i = 0; i < c->outputs; i++)
        values[i] = active >> i & 1 ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
    return gpiod_line_request_set_values_subset(c->request, (size_t)c->outputs, c->output, values) ? -errno : 0;
}

int gpio_chip_edge(struct trigger_chip *c, int64_t timeout_ns, struct gpio_edge *out)
{
    const int ready = gpiod_line_request_wait_edge_events(c->request, timeout_ns);
    struct gpiod_edge_event *event;
    int got;

    if (ready <= 0)
        return ready < 0 ? -errno : 0;
    got = gpiod_line_request_read_edge_events(c->request, c->events, 1);
    if (got <= 0)
        return got < 0 ? -errno : 0;
    event = gpiod_edge_event_buffer_get_event(c->events, 0);
    out->t_ns = (int64_t)gpiod_edge_event_get_timestamp_ns(event);
    out->sequence = (uint32_t)gpiod_edge_event_get_line_seqno(event);
    return 1;
}

void gpio_chip_close(struct trigger_chip *c)
{
    if (!c)
        return;
    gpiod_edge_event_buffer_free(c->events);
    gpiod_line_request_release(c->request);
    gpiod_chip_info_free(c->info);
    gpiod_chip_close(c->chip);
    free(c);
}
