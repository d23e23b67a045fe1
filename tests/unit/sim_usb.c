/* tests/unit/sim_usb.c - the simulated USB tree: plugging, bandwidth, descriptors. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "simulators/devices/usb/usb_model.h"
#include "tests/test.h"

static char trace[4096]; /* events as words: "+1-1 b1-1:0 -1-1 ..." */

static void event(void *arg, int device, enum sst_sim_usb_event what, int interface)
{
    struct sst_sim_usb *usb = *(struct sst_sim_usb **)arg;
    const size_t at = strlen(trace);
    static const char sign[] = "+-bucrap";

    snprintf(trace + at, sizeof(trace) - at, "%c%s", sign[what], sst_sim_usb_device(usb, device)->path);
    if (what == SST_SIM_USB_BOUND || what == SST_SIM_USB_UNBOUND)
        snprintf(trace + strlen(trace), sizeof(trace) - strlen(trace), ":%d", interface);
    snprintf(trace + strlen(trace), sizeof(trace) - strlen(trace), " ");
}

static struct sst_sim_usb *tree(const char *layout, int cameras)
{
    static struct sst_sim_usb *usb;
    static const int sizes[][2] = { { 1280, 960 }, { 640, 480 } };
    const struct sst_sim_usb_config cfg = {
        .layout = layout, .cameras = cameras, .sizes = sizes, .size_count = 2, .arg = &usb, .event = event
    };

    trace[0] = '\0';
    assert_int_equal(sst_sim_usb_create(&usb, &cfg), 0);
    return usb;
}

static const char *happened(void)
{
    static char copy[sizeof(trace)];

    memcpy(copy, trace, sizeof(copy));
    trace[0] = '\0';
    return copy;
}

static void layouts_have_the_ports(void **state)
{
    struct sst_sim_usb *usb = tree("wide", 36);
    const struct sst_sim_usb_config bad = { .layout = "narrow", .cameras = 2 };
    const struct sst_sim_usb_device *d;
    struct sst_sim_usb *none;

    (void)state;
    assert_int_equal(sst_sim_usb_count(usb), 2 * 36);
    d = sst_sim_usb_device(usb, sst_sim_usb_camera(usb, 35));
    assert_string_equal(d->path, "36-1");
    assert_string_equal(d->serial, "SIM0035");
    assert_string_equal(d->controller, "0000:26:00.0");
    sst_sim_usb_destroy(usb);
    usb = tree("tight", 36); /* 2 root hubs, 2 * (3 + 9) hubs, 36 cameras */
    assert_int_equal(sst_sim_usb_count(usb), 2 + 24 + 36);
    d = sst_sim_usb_device(usb, sst_sim_usb_camera(usb, 35)); /* hub 8 is the first below the third */
    assert_string_equal(d->path, "1-3.1.4");
    assert_true(d->here && d->authorized && d->bound == 3);
    assert_int_equal(sst_sim_usb_at(usb, 1, d->address), sst_sim_usb_camera(usb, 35));
    sst_sim_usb_destroy(usb);
    assert_int_equal(sst_sim_usb_create(&none, &bad), -EINVAL);
}

/* "1-2.3", "usb1" */
static int device_at(const struct sst_sim_usb *usb, const char *path)
{
    int i = 0;

    while (strcmp(sst_sim_usb_device(usb, i)->path, path) != 0)
        assert_true(++i < sst_sim_usb_count(usb));
    return i;
}

static void a_hub_takes_all_below_along(void **state)
{
    struct sst_sim_usb *usb = tree("tight", 5); /* 1-1.1.1 .. 4, 1-1.2.1 */
    const int hub = device_at(usb, "1-1.2"), camera = sst_sim_usb_camera(usb, 4);
    const int address = sst_sim_usb_device(usb, camera)->address;

    (void)state;
    sst_sim_usb_plug(usb, hub, false);
    assert_string_equal(happened(), "u1-1.2.1:0 u1-1.2.1:1 -1-1.2.1 u2-1.2:0 -2-1.2 u1-1.2:0 -1-1.2 ");
    assert_false(sst_sim_usb_works(usb, camera));
    assert_true(sst_sim_usb_works(usb, sst_sim_usb_camera(usb, 3)));
    sst_sim_usb_plug(usb, camera, false); /* also pulled, unseen */
    assert_string_equal(happened(), "");
    sst_sim_usb_plug(usb, hub, true);
    assert_string_equal(happened(), "+1-1.2 b1-1.2:0 +2-1.2 b2-1.2:0 ");
    sst_sim_usb_plug(usb, camera, true);
    assert_string_equal(happened(), "+1-1.2.1 b1-1.2.1:0 b1-1.2.1:1 ");
    assert_true(sst_sim_usb_works(usb, camera));
    assert_int_not_equal(sst_sim_usb_device(usb, camera)->address, address);
    sst_sim_usb_destroy(usb);
}

static void rungs_are_told(void **state)
{
    struct sst_sim_usb *usb = tree("tight", 1);
    const int camera = sst_sim_usb_camera(usb, 0), hub = device_at(usb, "1-1.1");
    const int twin = device_at(usb, "2-1.1");
    const int address = sst_sim_usb_device(usb, camera)->address;

    (void)state;
    assert_int_equal(sst_sim_usb_reset(usb, camera), 0);
    assert_string_equal(happened(), "r1-1.1.1 u1-1.1.1:0 u1-1.1.1:1 b1-1.1.1:0 b1-1.1.1:1 ");
    assert_int_equal(sst_sim_usb_device(usb, camera)->address, address);
    assert_int_equal(sst_sim_usb_authorize(usb, camera, false), 0);
    assert_string_equal(happened(), "u1-1.1.1:0 u1-1.1.1:1 c1-1.1.1 ");
    assert_int_equal(sst_sim_usb_bind(usb, camera, 0, true), -ENODEV);
    assert_int_equal(sst_sim_usb_authorize(usb, camera, true), 0);
    assert_string_equal(happened(), "a1-1.1.1 b1-1.1.1:0 b1-1.1.1:1 c1-1.1.1 ");
    /* Power goes when both halves of the hub have switched it off. */
    assert_int_equal(sst_sim_usb_power(usb, hub, 1, false), 0);
    assert_true(sst_sim_usb_works(usb, camera));
    assert_int_equal(sst_sim_usb_power(usb, twin, 1, false), 0);
    assert_false(sst_sim_usb_works(usb, camera));
    happened();
    assert_int_equal(sst_sim_usb_power(usb, hub, 1, true), 0);
    assert_string_equal(happened(), "c1-1.1 p1-1.1.1 +1-1.1.1 b1-1.1.1:0 b1-1.1.1:1 ");
    sst_sim_usb_fault(usb, SST_SIM_USB_NO_PORT_POWER, true);
    assert_int_equal(sst_sim_usb_power(usb, hub, 1, false), -EPIPE);
    sst_sim_usb_fault(usb, SST_SIM_USB_RESET_FAILS, true);
    assert_int_equal(sst_sim_usb_reset(usb, camera), -ETIMEDOUT);
    assert_true(sst_sim_usb_works(usb, camera));
    assert_int_equal(sst_sim_usb_disable(usb, hub, 1, true), 0);
    assert_false(sst_sim_usb_works(usb, camera));
    assert_int_equal(sst_sim_usb_disable(usb, hub, 5, true), -EINVAL);
    sst_sim_usb_destroy(usb);
}

static void drivers_bind_and_let_go(void **state)
{
    struct sst_sim_usb *usb = tree("wide", 2);
    const int camera = sst_sim_usb_camera(usb, 1);

    (void)state;
    assert_int_equal(sst_sim_usb_bind(usb, camera, 0, true), -EBUSY);
    assert_int_equal(sst_sim_usb_bind(usb, camera, 0, false), 0);
    assert_false(sst_sim_usb_works(usb, camera));
    assert_int_equal(sst_sim_usb_bind(usb, camera, 0, false), -ENODEV);
    assert_int_equal(sst_sim_usb_bind(usb, camera, 2, true), -ENODEV);
    assert_int_equal(sst_sim_usb_bind(usb, camera, 0, true), 0);
    assert_true(sst_sim_usb_works(usb, camera));
    assert_string_equal(happened(), "u2-1:0 b2-1:0 ");
    sst_sim_usb_destroy(usb);
}

static void bandwidth_runs_out(void **state)
{
    struct sst_sim_usb *usb = tree("tight", 8);

    (void)state;
    /* 2083 ps a bit: 1024 bytes stuffed are 9557 bits, with overhead 20.6 us; 3072 bytes are 60.4 us. */
    assert_int_equal(sst_sim_usb_packet_us(480, 1024), 21);
    assert_int_equal(sst_sim_usb_packet_us(480, 3072), 61);
    assert_int_equal(sst_sim_usb_packet_us(12, 1023), 807);
    assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, 0), 0), 0);
    assert_int_equal(sst_sim_usb_device(usb, sst_sim_usb_camera(usb, 0))->alt, 11);
    assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, 1), 0), -ENOSPC);
    assert_int_equal(sst_sim_usb_device(usb, sst_sim_usb_camera(usb, 1))->alt, 0);
    /* Four of 1024 bytes a microframe fit into 100 us, five do not. */
    sst_sim_usb_stream_end(usb, sst_sim_usb_camera(usb, 0));
    for (int cam = 0; cam < 4; cam++)
        assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, cam), 8192000), 0);
    assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, 4), 8192000), -ENOSPC);
    assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, 4), 1000000), 0); /* alt 1: 128 bytes, 3.2 us */
    assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, 4), 30000000), -EIO); /* above 24.6 MB/s */
    sst_sim_usb_plug(usb, sst_sim_usb_camera(usb, 2), false); /* an unplugged camera releases its bandwidth */
    assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, 5), 7000000), 0);
    sst_sim_usb_destroy(usb);
    usb = tree("wide", 36);
    for (int cam = 0; cam < 36; cam++)
        assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, cam), 0), 0);
    sst_sim_usb_destroy(usb);
}

static void translators_carry_full_speed(void **state)
{
    struct sst_sim_usb *usb = tree("single-tt", 8);

    (void)state;
    assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, 0), 0), 0);
    assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, 1), 0), -ENOSPC); /* same hub */
    assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, 4), 0), 0);       /* the next */
    sst_sim_usb_destroy(usb);
    usb = tree("multi-tt", 8);
    for (int cam = 0; cam < 8; cam++)
        assert_int_equal(sst_sim_usb_stream(usb, sst_sim_usb_camera(usb, cam), 0), 0);
    sst_sim_usb_destroy(usb);
}

static int ask(struct sst_sim_usb *usb, int device, const uint8_t setup[8], uint8_t *data)
{
    return sst_sim_usb_control(usb, device, setup, data);
}

#define SETUP(...) ((const uint8_t[8]){ __VA_ARGS__ })

static void descriptors_are_whole(void **state)
{
    static const char *const layout[] = { "wide", "tight", "single-tt" };
    uint8_t out[4096];

    (void)state;
    for (size_t l = 0; l < ARRAY_LEN(layout); l++) {
        struct sst_sim_usb *usb = tree(layout[l], 2);

        for (int i = 0; i < sst_sim_usb_count(usb); i++) {
            const int bytes = sst_sim_usb_descriptors(usb, i, out, sizeof(out));
            int at = 18, alts = 0;

            assert_true(bytes > 18 && out[0] == 18 && out[1] == 1);
            assert_int_equal(out[20] | out[21] << 8, bytes - 18); /* wTotalLength */
            for (; at < bytes; at += out[at]) {
                assert_true(out[at] >= 2);
                alts += out[at + 1] == 4 && out[at + 2] == 1 && out[at + 3] > 0;
            }
            assert_int_equal(at, bytes);
            if (sst_sim_usb_device(usb, i)->kind == SST_SIM_USB_CAMERA)
                assert_int_equal(alts, l == 2 ? 5 : 11);
            assert_int_equal(sst_sim_usb_descriptors(usb, i, out, 40), bytes > 40 ? -ENOSPC : bytes);
        }
        sst_sim_usb_destroy(usb);
    }
}

static void control_transfers_answer(void **state)
{
    struct sst_sim_usb *usb = tree("tight", 2);
    const int camera = sst_sim_usb_camera(usb, 1), hub = device_at(usb, "1-1.1");
    const int twin = device_at(usb, "2-1.1");
    uint8_t data[256], triple[3];

    (void)state;
    assert_int_equal(ask(usb, camera, SETUP(0x80, 6, 3, 3, 9, 4, 255, 0), data), 2 + 2 * 7);
    assert_memory_equal(data,
                        "\x10\x03S\0I\0M\0"
                        "0\0"
                        "0\0"
                        "0\0"
                        "1",
                        15);
    assert_int_equal(ask(usb, camera, SETUP(0x80, 6, 0, 1, 0, 0, 8, 0), data), 8);
    assert_int_equal(ask(usb, camera, SETUP(0xa3, 0, 0, 0, 1, 0, 4, 0), data), -EPIPE); /* not a hub */
    assert_int_equal(sst_sim_usb_interface_class(usb, camera, 1, triple), 0);
    assert_memory_equal(triple, "\x0e\x02\0", 3);
    assert_int_equal(ask(usb, hub, SETUP(0xa0, 6, 0, 0x29, 0, 0, 15, 0), data), 9);
    assert_int_equal(data[2], 4);
    assert_int_equal(data[3] & 3, 1); /* power per port */
    assert_int_equal(ask(usb, hub, SETUP(0xa3, 0, 0, 0, 2, 0, 4, 0), data), 4);
    assert_memory_equal(data, "\x03\x05\0\0", 4); /* connected, enabled; power, high speed */
    assert_int_equal(ask(usb, hub, SETUP(0xa3, 0, 0, 0, 3, 0, 4, 0), data), 4);
    assert_memory_equal(data, "\x00\x01\0\0", 4); /* empty */
    assert_int_equal(ask(usb, hub, SETUP(0xa3, 0, 0, 0, 5, 0, 4, 0), data), -EPIPE);
    assert_int_equal(ask(usb, hub, SETUP(0x23, 1, 8, 0, 2, 0, 0, 0), data), 0);
    assert_int_equal(ask(usb, twin, SETUP(0x23, 1, 8, 0, 2, 0, 0, 0), data), 0);
    assert_false(sst_sim_usb_works(usb, camera));
    assert_int_equal(ask(usb, camera, SETUP(0x80, 6, 0, 1, 0, 0, 8, 0), data), -ENODEV);
    assert_int_equal(ask(usb, hub, SETUP(0x23, 3, 8, 0, 2, 0, 0, 0), data), 0);
    assert_true(sst_sim_usb_works(usb, camera));
    happened();
    assert_int_equal(ask(usb, hub, SETUP(0x23, 3, 4, 0, 2, 0, 0, 0), data), 0); /* port reset */
    assert_int_equal(strncmp(happened(), "r1-1.1.2 ", 9), 0);
    sst_sim_usb_destroy(usb);
}

static void a_still_camera_has_a_bus_and_no_driver(void **state)
{
    static const int sizes[][2] = { { 640, 480 } };
    struct sst_sim_usb_config cfg = { .layout = "tight", .cameras = 5, .still = "S1", .sizes = sizes, .size_count = 1 };
    const struct sst_sim_usb_device *d;
    struct sst_sim_usb *usb;
    uint8_t bytes[256], class[3];
    int still;

    (void)state;
    assert_int_equal(sst_sim_usb_create(&usb, &cfg), 0);
    still = sst_sim_usb_still(usb);
    d = sst_sim_usb_device(usb, still);
    assert_string_equal(d->path, "3-1");
    assert_string_equal(d->serial, "S1");
    assert_true(d->here && d->bound == 0 && d->interfaces == 1);
    assert_int_equal(sst_sim_usb_bind(usb, still, 0, true), -ENODEV);
    assert_int_equal(sst_sim_usb_interface_class(usb, still, 0, class), 0);
    assert_memory_equal(class, ((const uint8_t[]){ 6, 1, 1 }), 3);
    assert_int_equal(sst_sim_usb_descriptors(usb, still, bytes, sizeof(bytes)), 18 + 9 + 9 + 3 * 7);
    sst_sim_usb_plug(usb, still, false);
    assert_false(d->here);
    sst_sim_usb_plug(usb, still, true);
    assert_true(d->here && d->bound == 0);
    sst_sim_usb_destroy(usb);
    cfg.still = NULL;
    assert_int_equal(sst_sim_usb_create(&usb, &cfg), 0);
    assert_int_equal(sst_sim_usb_still(usb), -1);
    sst_sim_usb_destroy(usb);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(layouts_have_the_ports),
        cmocka_unit_test(a_hub_takes_all_below_along),
        cmocka_unit_test(rungs_are_told),
        cmocka_unit_test(drivers_bind_and_let_go),
        cmocka_unit_test(bandwidth_runs_out),
        cmocka_unit_test(translators_carry_full_speed),
        cmocka_unit_test(descriptors_are_whole),
        cmocka_unit_test(control_transfers_answer),
        cmocka_unit_test(a_still_camera_has_a_bus_and_no_driver),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
