/* libgpiod 1.x: outputs are one line handle, the loop-back line is a line event beside it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/trigger/trigger_internal.h"

#include <errno.h>
#include <gpiod.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define CONSUMER "sst-trigger"

struct trigger_chip {
    struct gpiod_chip *chip;
    struct gpiod_line_bulk outputs; /* empty until requested */
    struct gpiod_line *loopback;    /* NULL until requested */
};

int gpio_chip_open(struct trigger_chip **out, const char *path)
{
    struct trigger_chip *c = calloc(1, sizeof(*c));
    int err;

    if (!c)
        return -ENOMEM;
    c->chip = gpiod_chip_open(path);
    if (!c->chip) {
        err = -errno;
        free(c);
        return err;
    }
    *out = c;
    return 0;
}

const char *gpio_chip_label(const struct trigger_chip *c)
{
    return gpiod_chip_label(c->chip);
}

int gpio_chip_lines(const struct trigger_chip *c)
{
    return (int)gpiod_chip_num_lines(c->chip);
}

int gpio_chip_line(struct trigger_chip *c, unsigned offset, struct trigger_line *out)
{
    struct gpiod_line *line = gpiod_chip_get_line(c->chip, offset);
    const char *name, *consumer;

    if (!line || gpiod_line_update(line))
        return -errno;
    name = gpiod_line_name(line);
    consumer = gpiod_line_consumer(line);
    out->used = gpiod_line_is_used(line);
    snprintf(out->name, sizeof(out->name), "%s", name ? name : "");
    snprintf(out->consumer, sizeof(out->consumer), "%s", consumer ? consumer : "");
    return 0;
}

int gpio_chip_request(struct trigger_chip *c, const struct gpio_request *r)
{
    const int flags = r->active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
    const struct gpiod_line_request_config output = { CONSUMER, GPIOD_LINE_REQUEST_DIRECTION_OUTPUT, flags };
    const struct gpiod_line_request_config edges = { CONSUMER, GPIOD_LINE_REQUEST_EVENT_RISING_EDGE, flags };
    const int inactive[SST_GPIO_LINES_MAX] = { 0 };
    struct gpiod_line_bulk bulk;
    struct gpiod_line *loopback = NULL;

    gpiod_line_bulk_init(&bulk);
    for (int i = 0; i < r->outputs; i++) {
        struct gpiod_line *line = gpiod_chip_get_line(c->chip, r->output[i]);

        if (!line)
            return -errno;
        gpiod_line_bulk_add(&bulk, line);
    }
    if (r->loopback >= 0) {
        loopback = gpiod_chip_get_line(c->chip, (unsigned)r->loopback);
        if (!loopback || gpiod_line_request(loopback, &edges, 0))
            return -errno;
    }
    if (r->outputs && gpiod_line_request_bulk(&bulk, &output, inactive)) {
        const int err = -errno;

        if (loopback)
            gpiod_line_release(loopback);
        return err;
    }
    c->outputs = bulk;
    c->loopback = loopback;
    return 0;
}

int gpio_chip_set(struct trigger_chip *c, uint64_t active)
{
    int values[SST_GPIO_LINES_MAX];

    for (unsigned i = 0; i < c->outputs.num_lines; i++)
        values[i] = (int)(active >> i & 1);
    return gpiod_line_set_value_bulk(&c->outputs, values) ? -errno : 0;
}

static int64_t read_clock(clockid_t id)
{
    struct timespec ts;

    clock_gettime(id, &ts);
    return pulse_ns(ts.tv_sec, ts.tv_nsec);
}

int gpio_chip_edge(struct trigger_chip *c, int64_t timeout_ns, struct gpio_edge *out)
{
    const struct timespec timeout = { timeout_ns / 1000000000, timeout_ns % 1000000000 };
    struct gpiod_line_event event;
    const int ready = gpiod_line_event_wait(c->loopback, &timeout);

    if (ready <= 0)
        return ready < 0 ? -errno : 0;
    if (gpiod_line_event_read(c->loopback, &event))
        return -errno;
    out->t_ns = edge_monotonic(pulse_ns(event.ts.tv_sec, event.ts.tv_nsec), read_clock(CLOCK_MONOTONIC),
                               read_clock(CLOCK_REALTIME));
    out->sequence = 0;
    return 1;
}

void gpio_chip_close(struct trigger_chip *c)
{
    if (!c)
        return;
    gpiod_chip_close(c->chip); /* releases the lines */
    free(c);
}
