/* tests/unit/sim_gpio.c - simulated GPIO chips behave like the kernel's gpiolib, in both versions of its uAPI. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <linux/gpio.h>
#include <stdio.h>
#include <string.h>

#include "simulators/devices/gpio/gpio_model.h"
#include "tests/test.h"

#define US 1000LL

static int pins;     /* changes reported by the callback ... ... */
static int last_pin; /* ... and the last of them */
static bool last_level;
static int64_t last_t_ns;

static void pin(void *arg, int chip, int line, bool level, int64_t t_ns)
{
    (void)arg;
    if (chip == 1 && line != 3) {
        pins++;
        last_pin = line;
        last_level = level;
        last_t_ns = t_ns;
    }
}

/** gpiochip1 "trig": OUT0, OUT1, OUT2, IN0 (wired to OUT0), one unnamed line. */
static struct sst_sim_gpio *chips(void)
{
    static const char *const names[] = { "OUT0", "OUT1", "OUT2", "IN0", NULL }, *const other[] = { "PWR", NULL };
    static const struct sst_sim_gpio_chip chip[] = { { "gpiochip0", "other", 2, other },
                                                     { "gpiochip1", "trig", 5, names } };
    static const struct sst_sim_gpio_wire wire = { 1, 0, 1, 3 };
    const struct sst_sim_gpio_config cfg = {
        .chips = 2, .wires = 1, .chip = chip, .wire = &wire, .realtime_ns = 1000000, .seed = 7, .hooks = { .pin = pin }
    };
    struct sst_sim_gpio *gpio;

    pins = 0;
    assert_int_equal(sst_sim_gpio_create(&gpio, &cfg), 0);
    return gpio;
}

static struct sst_sim_gpio_file *open_chip(struct sst_sim_gpio *gpio)
{
    struct sst_sim_gpio_file *file;

    assert_int_equal(sst_sim_gpio_open(gpio, 1, &file), 0);
    return file;
}

static int ask(struct sst_sim_gpio_file *file, unsigned long request, void *arg, int64_t now_ns)
{
    struct sst_sim_gpio_file *opened;
    const int rc = sst_sim_gpio_ioctl(file, request, arg, &opened, now_ns);

    assert_null(opened);
    return rc;
}

/** A v2 request for lines with one set of flags; values of outputs in `values`. */
static int take(struct sst_sim_gpio_file *chip, const char *offsets, uint64_t flags, uint64_t values,
                struct sst_sim_gpio_file **out)
{
    struct gpio_v2_line_request request = { .num_lines = (uint32_t)strlen(offsets), .consumer = "test" };

    for (uint32_t i = 0; i < request.num_lines; i++)
        request.offsets[i] = (uint32_t)(offsets[i] - '0');
    request.config.flags = flags;
    if (flags & GPIO_V2_LINE_FLAG_OUTPUT) {
        request.config.num_attrs = 1;
        request.config.attrs[0].attr.id = GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES;
        request.config.attrs[0].attr.values = values;
        request.config.attrs[0].mask = UINT64_MAX;
    }
    return sst_sim_gpio_ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &request, out, 0);
}

static int set(struct sst_sim_gpio_file *lines, uint64_t mask, uint64_t bits, int64_t now_ns)
{
    struct gpio_v2_line_values values = { .bits = bits, .mask = mask };

    return ask(lines, GPIO_V2_LINE_SET_VALUES_IOCTL, &values, now_ns);
}

static uint64_t get(struct sst_sim_gpio_file *lines, uint64_t mask)
{
    struct gpio_v2_line_values values = { .mask = mask };

    assert_int_equal(ask(lines, GPIO_V2_LINE_GET_VALUES_IOCTL, &values, 0), 0);
    return values.bits;
}

static void tells_chip_and_lines(void **state)
{
    struct sst_sim_gpio *gpio = chips();
    struct sst_sim_gpio_file *chip = open_chip(gpio);
    struct gpiochip_info info;
    struct gpioline_info v1 = { .line_offset = 3 };
    struct gpio_v2_line_info v2 = { .offset = 5 };

    (void)state;
    assert_int_equal(ask(chip, GPIO_GET_CHIPINFO_IOCTL, &info, 0), 0);
    assert_string_equal(info.name, "gpiochip1");
    assert_string_equal(info.label, "trig");
    assert_int_equal(info.lines, 5);
    assert_int_equal(ask(chip, GPIO_GET_LINEINFO_IOCTL, &v1, 0), 0);
    assert_string_equal(v1.name, "IN0");
    assert_int_equal(v1.flags, 0);                                            /* free, input */
    assert_int_equal(ask(chip, GPIO_V2_GET_LINEINFO_IOCTL, &v2, 0), -EINVAL); /* past the end */
    v2.offset = 4;
    v2.padding[2] = 1;
    assert_int_equal(ask(chip, GPIO_V2_GET_LINEINFO_IOCTL, &v2, 0), -EINVAL);
    v2.padding[2] = 0;
    assert_int_equal(ask(chip, GPIO_V2_GET_LINEINFO_IOCTL, &v2, 0), 0);
    assert_string_equal(v2.name, "");
    assert_int_equal(v2.flags, GPIO_V2_LINE_FLAG_INPUT);
    assert_int_equal(ask(chip, GPIO_V2_LINE_GET_VALUES_IOCTL, &v2, 0), -EINVAL); /* not a request */
    assert_int_equal(sst_sim_gpio_line(gpio, 1, "OUT2"), 2);
    assert_int_equal(sst_sim_gpio_line(gpio, 0, "OUT2"), -1);
    sst_sim_gpio_destroy(gpio);
}

static void refuses_what_the_kernel_refuses(void **state)
{
    static const uint64_t bad[] = {
        GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_OUTPUT,
        GPIO_V2_LINE_FLAG_OUTPUT | GPIO_V2_LINE_FLAG_EDGE_RISING,
        GPIO_V2_LINE_FLAG_EDGE_RISING,
        GPIO_V2_LINE_FLAG_BIAS_PULL_UP,
        GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_OPEN_DRAIN,
        GPIO_V2_LINE_FLAG_OUTPUT | GPIO_V2_LINE_FLAG_OPEN_DRAIN | GPIO_V2_LINE_FLAG_OPEN_SOURCE,
        GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_BIAS_PULL_UP | GPIO_V2_LINE_FLAG_BIAS_DISABLED,
        GPIO_V2_LINE_FLAG_USED,
        1ULL << 40,
    };
    struct sst_sim_gpio *gpio = chips();
    struct sst_sim_gpio_file *chip = open_chip(gpio), *lines;
    struct gpiohandle_request v1 = { .lines = 65 };
    struct gpioevent_request event = { .lineoffset = 1, .handleflags = GPIOHANDLE_REQUEST_OUTPUT, .eventflags = 1 };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(bad); i++)
        assert_int_equal(take(chip, "0", bad[i], 0, &lines), -EINVAL);
    assert_int_equal(take(chip, "0", GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EVENT_CLOCK_HTE, 0, &lines),
                     -EOPNOTSUPP);
    assert_int_equal(take(chip, "", GPIO_V2_LINE_FLAG_INPUT, 0, &lines), -EINVAL);
    assert_int_equal(take(chip, "9", GPIO_V2_LINE_FLAG_INPUT, 0, &lines), -EINVAL);
    assert_int_equal(take(chip, "22", GPIO_V2_LINE_FLAG_INPUT, 0, &lines), -EBUSY);
    assert_int_equal(ask(chip, GPIO_GET_LINEHANDLE_IOCTL, &v1, 0), -EINVAL);
    assert_int_equal(ask(chip, GPIO_GET_LINEEVENT_IOCTL, &event, 0), -EINVAL);
    event.handleflags = GPIOHANDLE_REQUEST_INPUT;
    event.eventflags = 4;
    assert_int_equal(ask(chip, GPIO_GET_LINEEVENT_IOCTL, &event, 0), -EINVAL);
    /* Refused requests hold no lines. */
    assert_int_equal(take(chip, "0123", GPIO_V2_LINE_FLAG_INPUT, 0, &lines), 0);
    sst_sim_gpio_destroy(gpio);
}

static void outputs_move_together(void **state)
{
    struct sst_sim_gpio *gpio = chips();
    struct sst_sim_gpio_file *chip = open_chip(gpio), *lines, *inputs, *again;

    (void)state;
    assert_int_equal(take(chip, "012", GPIO_V2_LINE_FLAG_OUTPUT, 2, &lines), 0);
    assert_int_equal(pins, 1); /* OUT1 rose with the request */
    assert_int_equal(take(chip, "2", GPIO_V2_LINE_FLAG_INPUT, 0, &again), -EBUSY);
    assert_int_equal(set(lines, 7, 5, 42 * US), 0);
    assert_int_equal(pins, 4);
    assert_int_equal(last_pin, 2);
    assert_true(last_level);
    assert_int_equal(last_t_ns, 42 * US);
    assert_int_equal(get(lines, 7), 5);
    assert_int_equal(get(lines, 4), 4);
    assert_int_equal(set(lines, 1ULL << 5, 1, 0), -EINVAL); /* no line of this request */
    assert_int_equal(set(lines, 7, 5, 43 * US), 0);
    assert_int_equal(pins, 4); /* nothing changed */
    assert_int_equal(take(chip, "3", GPIO_V2_LINE_FLAG_INPUT, 0, &inputs), 0);
    assert_int_equal(get(inputs, 1), 1); /* wired to OUT0 */
    assert_int_equal(set(inputs, 1, 1, 0), -EPERM);
    sst_sim_gpio_close(lines, 44 * US);
    assert_int_equal(get(inputs, 1), 0); /* back at rest */
    assert_int_equal(pins, 6);
    sst_sim_gpio_destroy(gpio);
}

static void flags_change_what_values_mean(void **state)
{
    struct sst_sim_gpio *gpio = chips();
    struct sst_sim_gpio_file *chip = open_chip(gpio), *lines;
    struct gpio_v2_line_config config = { .flags = GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_BIAS_PULL_UP };
    struct gpio_v2_line_info info = { .offset = 1 };

    (void)state;
    assert_int_equal(take(chip, "1", GPIO_V2_LINE_FLAG_OUTPUT | GPIO_V2_LINE_FLAG_ACTIVE_LOW, 1, &lines), 0);
    assert_int_equal(pins, 0); /* active low: 1 is the low level */
    assert_int_equal(get(lines, 1), 1);
    assert_int_equal(set(lines, 1, 0, 1), 0);
    assert_true(last_level);
    /* As input it floats to its pull-up. */
    assert_int_equal(ask(lines, GPIO_V2_LINE_SET_CONFIG_IOCTL, &config, 2), 0);
    assert_int_equal(get(lines, 1), 1);
    assert_int_equal(ask(chip, GPIO_V2_GET_LINEINFO_IOCTL, &info, 0), 0);
    assert_int_equal(info.flags, GPIO_V2_LINE_FLAG_USED | config.flags);
    assert_string_equal(info.consumer, "test");
    sst_sim_gpio_close(lines, 3);
    /* An open drain releases the wire for 1. */
    assert_int_equal(take(chip, "1", GPIO_V2_LINE_FLAG_OUTPUT | GPIO_V2_LINE_FLAG_OPEN_DRAIN, 1, &lines), 0);
    assert_int_equal(get(lines, 1), 0);
    sst_sim_gpio_destroy(gpio);
}

static void edges_carry_time_and_count(void **state)
{
    struct sst_sim_gpio *gpio = chips();
    struct sst_sim_gpio_file *chip = open_chip(gpio), *out, *in;
    struct gpio_v2_line_event event[3];

    (void)state;
    assert_int_equal(take(chip, "0", GPIO_V2_LINE_FLAG_OUTPUT, 0, &out), 0);
    assert_int_equal(take(chip, "3", GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING, 0, &in), 0);
    assert_int_equal(sst_sim_gpio_read(in, event, sizeof(event)), -EAGAIN);
    for (int i = 0; i < 20; i++) {
        assert_int_equal(set(out, 1, 1, (2 * i + 1) * US), 0);
        assert_int_equal(set(out, 1, 0, (2 * i + 2) * US), 0);
    }
    assert_true(sst_sim_gpio_readable(in));
    assert_int_equal(sst_sim_gpio_read(in, event, sizeof(event[0]) - 1), -EINVAL);
    /* 16 entries: the four oldest are dropped and counted. */
    assert_int_equal(sst_sim_gpio_read(in, event, sizeof(event)), sizeof(event));
    for (uint32_t i = 0; i < 3; i++) {
        assert_int_equal(event[i].id, GPIO_V2_LINE_EVENT_RISING_EDGE);
        assert_int_equal(event[i].offset, 3);
        assert_int_equal(event[i].seqno, 5 + i);
        assert_int_equal(event[i].line_seqno, 5 + i);
        assert_int_equal(event[i].timestamp_ns, (2 * (4 + i) + 1) * US);
    }
    sst_sim_gpio_destroy(gpio);
}

static void debounce_waits_for_rest(void **state)
{
    struct sst_sim_gpio *gpio = chips();
    struct sst_sim_gpio_file *chip = open_chip(gpio), *out, *in;
    struct gpio_v2_line_request request = { .num_lines = 1, .offsets = { 3 } };
    struct gpio_v2_line_event event;

    (void)state;
    request.config.flags =
        GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING | GPIO_V2_LINE_FLAG_EVENT_CLOCK_REALTIME;
    request.config.num_attrs = 1;
    request.config.attrs[0].mask = 1;
    request.config.attrs[0].attr.id = GPIO_V2_LINE_ATTR_ID_DEBOUNCE;
    request.config.attrs[0].attr.debounce_period_us = 100;
    assert_int_equal(take(chip, "0", GPIO_V2_LINE_FLAG_OUTPUT, 0, &out), 0);
    assert_int_equal(sst_sim_gpio_ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &request, &in, 0), 0);
    assert_int_equal(sst_sim_gpio_due(gpio), INT64_MAX);
    assert_int_equal(set(out, 1, 1, 10 * US), 0);
    assert_int_equal(set(out, 1, 0, 50 * US), 0); /* a bounce */
    assert_int_equal(sst_sim_gpio_due(gpio), 150 * US);
    sst_sim_gpio_tick(gpio, 150 * US);
    assert_false(sst_sim_gpio_readable(in));
    assert_int_equal(set(out, 1, 1, 200 * US), 0);
    sst_sim_gpio_tick(gpio, 299 * US);
    assert_false(sst_sim_gpio_readable(in));
    sst_sim_gpio_tick(gpio, 300 * US);
    assert_int_equal(sst_sim_gpio_read(in, &event, sizeof(event)), sizeof(event));
    assert_int_equal(event.timestamp_ns, 300 * US + 1000000); /* realtime was asked for */
    sst_sim_gpio_destroy(gpio);
}

static void version_1_works_alike(void **state)
{
    struct sst_sim_gpio *gpio = chips();
    struct sst_sim_gpio_file *chip = open_chip(gpio), *out, *in;
    struct gpiohandle_request handle = { .lines = 2, .lineoffsets = { 1, 0 }, .flags = GPIOHANDLE_REQUEST_OUTPUT };
    struct gpioevent_request event = { .lineoffset = 3, .eventflags = GPIOEVENT_REQUEST_BOTH_EDGES };
    struct gpiohandle_data data = { .values = { 0, 1 } };
    struct gpioevent_data got[4];
    struct gpioline_info info = { .line_offset = 0 };

    (void)state;
    assert_int_equal(sst_sim_gpio_ioctl(chip, GPIO_GET_LINEHANDLE_IOCTL, &handle, &out, 0), 0);
    assert_int_equal(sst_sim_gpio_ioctl(chip, GPIO_GET_LINEEVENT_IOCTL, &event, &in, 0), 0);
    assert_int_equal(ask(out, GPIOHANDLE_SET_LINE_VALUES_IOCTL, &data, 5), 0);
    data.values[1] = 0;
    assert_int_equal(ask(out, GPIOHANDLE_SET_LINE_VALUES_IOCTL, &data, 9), 0);
    assert_int_equal(sst_sim_gpio_read(in, got, sizeof(got)), 2 * sizeof(got[0]));
    assert_int_equal(got[0].id, GPIOEVENT_EVENT_RISING_EDGE);
    assert_int_equal(got[0].timestamp, 5);
    assert_int_equal(got[1].id, GPIOEVENT_EVENT_FALLING_EDGE);
    assert_int_equal(got[1].timestamp, 9);
    assert_int_equal(ask(in, GPIOHANDLE_SET_LINE_VALUES_IOCTL, &data, 9), -EINVAL);
    assert_int_equal(ask(chip, GPIO_GET_LINEINFO_IOCTL, &info, 0), 0);
    assert_int_equal(info.flags, GPIOLINE_FLAG_KERNEL | GPIOLINE_FLAG_IS_OUT);
    assert_string_equal(info.consumer, "?");
    sst_sim_gpio_destroy(gpio);
}

static void watchers_hear_of_requests(void **state)
{
    struct sst_sim_gpio *gpio = chips();
    struct sst_sim_gpio_file *chip = open_chip(gpio), *watcher = open_chip(gpio), *lines;
    struct gpio_v2_line_info info = { .offset = 2 };
    struct gpioline_info v1 = { .line_offset = 1 };
    struct gpio_v2_line_info_changed changed;
    uint32_t offset = 2;

    (void)state;
    assert_int_equal(ask(watcher, GPIO_V2_GET_LINEINFO_WATCH_IOCTL, &info, 0), 0);
    assert_int_equal(ask(watcher, GPIO_V2_GET_LINEINFO_WATCH_IOCTL, &info, 0), -EBUSY);
    assert_int_equal(ask(watcher, GPIO_GET_LINEINFO_WATCH_IOCTL, &v1, 0), -EPERM); /* the other version */
    assert_int_equal(take(chip, "12", GPIO_V2_LINE_FLAG_OUTPUT, 0, &lines), 0);
    assert_int_equal(sst_sim_gpio_read(watcher, &changed, sizeof(changed)), sizeof(changed));
    assert_int_equal(changed.event_type, GPIO_V2_LINE_CHANGED_REQUESTED);
    assert_int_equal(changed.info.offset, 2);
    assert_true(changed.info.flags & GPIO_V2_LINE_FLAG_USED);
    sst_sim_gpio_close(lines, 77);
    assert_int_equal(sst_sim_gpio_read(watcher, &changed, sizeof(changed)), sizeof(changed));
    assert_int_equal(changed.event_type, GPIO_V2_LINE_CHANGED_RELEASED);
    assert_int_equal(changed.timestamp_ns, 77);
    assert_false(changed.info.flags & GPIO_V2_LINE_FLAG_USED);
    assert_int_equal(ask(watcher, GPIO_GET_LINEINFO_UNWATCH_IOCTL, &offset, 0), 0);
    assert_int_equal(ask(watcher, GPIO_GET_LINEINFO_UNWATCH_IOCTL, &offset, 0), -EBUSY);
    sst_sim_gpio_destroy(gpio);
}

static void faults_show(void **state)
{
    struct sst_sim_gpio *gpio = chips();
    struct sst_sim_gpio_file *chip = open_chip(gpio), *out, *in, *more;
    struct gpio_v2_line_event event[64];
    int bytes;

    (void)state;
    assert_int_equal(sst_sim_gpio_fault(gpio, 1, SST_SIM_GPIO_DENIED, 3, 0), -EINVAL);
    assert_int_equal(sst_sim_gpio_fault(gpio, 1, SST_SIM_GPIO_LOST_EDGES, 1.5, 0), -EINVAL);
    assert_int_equal(sst_sim_gpio_fault(gpio, 1, SST_SIM_GPIO_DENIED, 1, 0), 0);
    assert_int_equal(sst_sim_gpio_open(gpio, 1, &more), -EACCES);
    assert_int_equal(sst_sim_gpio_fault(gpio, 1, SST_SIM_GPIO_DENIED, 0, 0), 0);
    assert_int_equal(sst_sim_gpio_fault(gpio, 1, SST_SIM_GPIO_BUSY, 1, 0), 0);
    assert_int_equal(take(chip, "0", GPIO_V2_LINE_FLAG_OUTPUT, 0, &out), -EBUSY);
    assert_int_equal(sst_sim_gpio_fault(gpio, 1, SST_SIM_GPIO_BUSY, 0, 0), 0);
    assert_int_equal(take(chip, "0", GPIO_V2_LINE_FLAG_OUTPUT, 0, &out), 0);
    assert_int_equal(take(chip, "3", GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING, 0, &in), 0);
    /* Stuck: the value is accepted, the pin does not change. */
    assert_int_equal(sst_sim_gpio_fault(gpio, 1, SST_SIM_GPIO_STUCK, 1, 0), 0);
    assert_int_equal(set(out, 1, 1, 1), 0);
    assert_int_equal(pins, 0);
    assert_int_equal(get(out, 1), 0);
    assert_int_equal(sst_sim_gpio_fault(gpio, 1, SST_SIM_GPIO_STUCK, 0, 2), 0);
    assert_int_equal(get(out, 1), 1);
    assert_int_equal(set(out, 1, 0, 3), 0);
    /* Half of the edges are lost, the same ones each time. */
    assert_int_equal(sst_sim_gpio_read(in, event, sizeof(event)), sizeof(event[0]));
    assert_int_equal(sst_sim_gpio_fault(gpio, 1, SST_SIM_GPIO_LOST_EDGES, 0.5, 0), 0);
    for (int i = 0; i < 16; i++) {
        assert_int_equal(set(out, 1, 1, 4), 0);
        assert_int_equal(set(out, 1, 0, 4), 0);
    }
    bytes = sst_sim_gpio_read(in, event, sizeof(event));
    assert_in_range(bytes / (int)sizeof(event[0]), 3, 13);
    /* Vanished: open files return ENODEV, even after the chip's return. */
    assert_int_equal(set(out, 1, 1, 5), 0);
    assert_int_equal(sst_sim_gpio_fault(gpio, 1, SST_SIM_GPIO_VANISH, 1, 6), 0);
    assert_false(last_level);
    assert_int_equal(set(out, 1, 1, 7), -ENODEV);
    assert_int_equal(sst_sim_gpio_read(in, event, sizeof(event)), -ENODEV);
    assert_int_equal(sst_sim_gpio_open(gpio, 1, &more), -ENODEV);
    assert_int_equal(sst_sim_gpio_fault(gpio, 1, SST_SIM_GPIO_VANISH, 0, 8), 0);
    assert_int_equal(set(out, 1, 1, 9), -ENODEV);
    more = open_chip(gpio);
    assert_int_equal(take(more, "0", GPIO_V2_LINE_FLAG_OUTPUT, 0, &out), 0);
    sst_sim_gpio_destroy(gpio);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tells_chip_and_lines),
        cmocka_unit_test(refuses_what_the_kernel_refuses),
        cmocka_unit_test(outputs_move_together),
        cmocka_unit_test(flags_change_what_values_mean),
        cmocka_unit_test(edges_carry_time_and_count),
        cmocka_unit_test(debounce_waits_for_rest),
        cmocka_unit_test(version_1_works_alike),
        cmocka_unit_test(watchers_hear_of_requests),
        cmocka_unit_test(faults_show),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
