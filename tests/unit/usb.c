/* drivers/usb: the tree read from files laid out like sysfs, descriptors, port names, bandwidth sums worked by hand. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "drivers/usb/plan.h"
#include "drivers/usb/usb_internal.h"
#include "simulators/scene/noise.h"
#include "tests/quick.h"
#include "tests/test.h"

/* --- a tree in files ---------------------------------------------------------------------------------------------- */

static char root[64];

/* Writes root/path with all folders above it. */
static void put(const char *path, const void *data, size_t size)
{
    char full[512];
    FILE *f;

    snprintf(full, sizeof(full), "%s/%s", root, path);
    for (char *slash = strchr(full + 1, '/'); slash; slash = strchr(slash + 1, '/')) {
        *slash = 0;
        (void)mkdir(full, 0755);
        *slash = '/';
    }
    f = fopen(full, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(data, 1, size, f), size);
    assert_int_equal(fclose(f), 0);
}

struct fake {
    const char *folder; /* below devices/ */
    const char *bus, *devnum, *speed, *device_class, *protocol, *maxchild, *maker, *name, *serial;
};

static void put_device(const struct fake *d)
{
    const struct {
        const char *name, *value;
    } attribute[] = { { "busnum", d->bus },
                      { "devnum", d->devnum },
                      { "speed", d->speed },
                      { "maxchild", d->maxchild },
                      { "bDeviceClass", d->device_class },
                      { "bDeviceProtocol", d->protocol },
                      { "idVendor", "1d6b" },
                      { "idProduct", "0102" },
                      { "manufacturer", d->maker },
                      { "product", d->name },
                      { "serial", d->serial } };
    char path[256], link[256], target[256];

    for (size_t i = 0; i < ARRAY_LEN(attribute); i++) {
        char text[80];

        if (!attribute[i].value)
            continue;
        snprintf(path, sizeof(path), "devices/%s/%s", d->folder, attribute[i].name);
        snprintf(text, sizeof(text), "%s\n", attribute[i].value);
        put(path, text, strlen(text));
    }
    snprintf(link, sizeof(link), "%s/bus/usb/devices/%s", root, sst_path_base(d->folder));
    snprintf(target, sizeof(target), "../../../devices/%s", d->folder);
    assert_int_equal(symlink(target, link), 0);
}

/* Device and configuration, control interface, then streaming settings 0 (none), 1: 512, 2: 3 x 1024 every 2nd. */
static const uint8_t
    camera_descriptors[] = {
        18,   1,    0,    2, 0xef, 2,    1, 64,   0x6b, 0x1d, 2,    1, 0,    1,  1,    2,    3,    1,
        9,    2,    0,    0, 2,    1,    0, 0x80, 250,  9,    4,    0, 0,    1,  14,   1,    0,    0,
        7,    5,    0x83, 3, 16,   0,    6, /* interrupt endpoint of the control interface: not ours */
        9,    4,    1,    0, 0,    14,   2, 0,    0,    14,   0x24, 1, 1,    77, 0,    0x81, 0,    5,
        0,    0,    0,    1, 0,    9,    4, 1,    1,    1,    14,   2, 0,    0,  7,    5,    0x81, 5,
        0x00, 0x02, 1,    9, 4,    1,    2, 1,    14,   2,    0,    0, 7,    5,  0x81, 5,    0x00, 0x14,
        2,    9,    4,    2, 1,    1,    1, 2,    0,    0,    7,    5, 0x84, 5,  0x64, 0x00, 4, /* the microphone */
        9,    2,    0,    0, 2,    2,    0, 0x80, 250,  9,    4,    1, 3,    1,  14,   2,    0,    0,
        7,    5,    0x81, 5, 0x00, 0x04, 1, /* another configuration */
    };

static int make_tree(void **state SST_UNUSED)
{
    static const struct fake tree[] = {
        { "pci0000:00/0000:00:14.0/usb1", "1", "1", "480", "09", "01", "4", "Linux 6.1.0 xhci-hcd", "xHCI",
          "0000:00:14.0" },
        { "pci0000:00/0000:00:14.0/usb2", "2", "1", "5000", "09", "03", "4", "Linux 6.1.0 xhci-hcd", "xHCI", NULL },
        { "pci0000:00/0000:00:14.0/usb1/1-2", "1", "3", "480", "09", "02", "4", "Acme", "Hub", NULL },
        { "pci0000:00/0000:00:14.0/usb1/1-2/1-2.10", "1", "9", "480", "ef", "01", NULL, "Acme", "Camera", "SN7" },
        { "pci0000:00/0000:00:14.0/usb1/1-2/1-2.3", "1", "12", "1.5", "00", "00", NULL, NULL, "Mouse", NULL },
        { "platform/soc/10.ehci/usb10", "10", "1", "480", "09", "00", "1", "Linux 6.1.0 ehci_hcd", "EHCI", NULL },
    };

    strcpy(root, "/tmp/sst-usb-XXXXXX");
    if (!mkdtemp(root))
        return -1;
    put("bus/usb/devices/.keep", "", 0);
    for (size_t i = 0; i < ARRAY_LEN(tree); i++)
        put_device(&tree[i]);
    put("devices/pci0000:00/0000:00:14.0/vendor", "0x8086\n", 7);
    put("devices/pci0000:00/0000:00:14.0/usb1/1-2/1-2.10/descriptors", camera_descriptors, sizeof(camera_descriptors));
    put("bus/usb/devices/1-2.10:1.0/video4linux/video7/index", "1\n", 2);
    put("bus/usb/devices/1-2.10:1.0/video4linux/video6/index", "0\n", 2);
    return 0;
}

static int remove_tree(void **state SST_UNUSED)
{
    sst_path_remove_tree(root);
    return 0;
}

static void tree_is_read_parents_first(void **state SST_UNUSED)
{
    static const char *const order[] = { "usb1", "1-2", "1-2.3", "1-2.10", "usb2", "usb10" };
    static const int parent[] = { -1, 0, 1, 1, -1, -1 };
    struct sst_usb_device *d;
    int n;

    assert_int_equal(usb_scan(&d, &n, root), 0);
    assert_int_equal(n, 6);
    for (int i = 0; i < n; i++) {
        assert_string_equal(d[i].port, order[i]);
        assert_int_equal(d[i].parent, parent[i]);
    }
    assert_string_equal(d[0].controller, "0000:00:14.0");
    assert_string_equal(d[3].controller, "0000:00:14.0");
    assert_string_equal(d[5].controller, "10.ehci");
    assert_true(d[3].port_buses && !d[5].port_buses);
    assert_true(d[0].single_tt && !d[1].single_tt);
    assert_true(d[1].hub && d[1].hub_ports == 4);
    assert_int_equal(d[2].speed_mbit, 1);
    assert_int_equal(d[4].speed_mbit, 5000);
    assert_string_equal(d[3].serial, "SN7");
    assert_string_equal(d[3].node, "/dev/video6");
    assert_string_equal(d[2].maker, "");
    assert_int_equal(d[3].vendor, 0x1d6b);
    assert_int_equal(d[3].address, 9);
    assert_int_equal(d[3].alts, 2);
    assert_int_equal(d[3].alt[1].packet_bytes, 3072);
    free(d);
}

static void machine_without_usb_has_no_devices(void **state SST_UNUSED)
{
    struct sst_usb_device *d;
    int n = -1;

    assert_int_equal(usb_scan(&d, &n, "/nowhere"), 0);
    assert_int_equal(n, 0);
    free(d);
}

/* --- descriptors -------------------------------------------------------------------------------------------------- */

static void settings_of_the_streaming_interface(void **state SST_UNUSED)
{
    struct sst_usb_alt alt[SST_USB_ALTS_MAX];

    assert_int_equal(usb_parse_alts(alt, camera_descriptors, sizeof(camera_descriptors), 480), 2);
    assert_int_equal(alt[0].number, 1);
    assert_true(alt[0].isochronous);
    assert_int_equal(alt[0].packet_bytes, 512);
    assert_int_equal(alt[0].interval_us, 125);
    assert_int_equal(alt[1].number, 2);
    assert_int_equal(alt[1].packet_bytes, 3072);
    assert_int_equal(alt[1].interval_us, 250);
}

static void superspeed_packets_come_from_the_companion(void **state SST_UNUSED)
{
    static const uint8_t d[] = {
        9, 4, 1, 1, 1, 14, 2, 0, 0, 7, 5, 0x81, 5, 0x00, 0x04, 1, 6, 0x30, 10, 2, 0x00, 0x84
    }; /* 33792 bytes per interval */
    struct sst_usb_alt alt[SST_USB_ALTS_MAX];

    assert_int_equal(usb_parse_alts(alt, d, sizeof(d), 5000), 1);
    assert_int_equal(alt[0].packet_bytes, 33792);
}

/* Whatever the bytes are: no endless loop, nothing read behind the end (the buffer is exactly as long as told). */
static void damaged_descriptors_end_the_walk(void **state SST_UNUSED)
{
    struct sst_usb_alt alt[SST_USB_ALTS_MAX];
    uint64_t seed = 1;

    for (size_t size = 0; size <= sizeof(camera_descriptors); size++) {
        uint8_t *copy = malloc(size + 1);

        assert_non_null(copy);
        memcpy(copy, camera_descriptors, size);
        copy = realloc(copy, size ? size : 1);
        assert_in_range(usb_parse_alts(alt, copy, size, 480), 0, 2);
        for (int i = 0; i < 50 && size; i++) {
            copy[sst_random_u64(&seed) % size] = (uint8_t)sst_random_u64(&seed);
            assert_in_range(usb_parse_alts(alt, copy, size, 5000), 0, SST_USB_ALTS_MAX);
        }
        free(copy);
    }
}

static void ports_are_compared_by_their_numbers(void **state SST_UNUSED)
{
    static const char *const order[] = {
        "usb1", "1-1", "1-1.2", "1-1.10", "1-2", "usb2", "2-1", "usb10", "10-1", "lost"
    };
    char hub[SST_USB_TEXT_MAX];
    int number;

    for (size_t i = 0; i + 1 < ARRAY_LEN(order); i++) {
        assert_true(usb_compare_ports(order[i], order[i + 1]) < 0);
        assert_true(usb_compare_ports(order[i + 1], order[i]) > 0);
    }
    assert_int_equal(usb_split_port("3-1.4.2", hub, &number), 0);
    assert_string_equal(hub, "3-1.4");
    assert_int_equal(number, 2);
    assert_int_equal(usb_split_port("3-1", hub, &number), 0);
    assert_string_equal(hub, "usb3");
    assert_int_equal(number, 1);
    assert_int_equal(usb_split_port("usb3", hub, &number), -EINVAL);
    assert_int_equal(usb_split_port("../../etc", hub, &number), -EINVAL);
    assert_int_equal(usb_split_port("3-1/authorized", hub, &number), -EINVAL);
    assert_int_equal(usb_split_port("", hub, &number), -EINVAL);
}

/* --- plans -------------------------------------------------------------------------------------------------------- */

#define DEVICES 64

struct bench {
    struct sst_usb_device d[DEVICES];
    struct sst_usb_stream s[DEVICES];
    int n, streams;
    struct sst_usb_plan plan;
};

static int add(struct bench *b, const char *port, int parent, int speed, bool hub, bool port_buses)
{
    struct sst_usb_device *d = &b->d[b->n];

    memset(d, 0, sizeof(*d));
    snprintf(d->port, sizeof(d->port), "%.60s", port);
    strcpy(d->controller, "0000:00:14.0");
    d->parent = parent;
    d->bus = atoi(!strncmp(port, "usb", 3) ? port + 3 : port);
    d->speed_mbit = speed;
    d->hub = hub;
    d->port_buses = port_buses;
    return b->n++;
}

/* A camera on the next port of a hub, with settings of these packets; it will stream. */
static void add_camera(struct bench *b, int hub, int speed, int number, int64_t needed, const int *packets, int n)
{
    const struct sst_usb_device *up = &b->d[hub];
    char port[96];
    int i;

    if (up->parent < 0)
        snprintf(port, sizeof(port), "%d-%d", up->bus, number);
    else
        snprintf(port, sizeof(port), "%s.%d", up->port, number);
    i = add(b, port, hub, speed, false, up->port_buses);
    b->d[i].alts = n;
    for (int k = 0; k < n; k++)
        b->d[i].alt[k] = (struct sst_usb_alt){ k + 1, true, packets[k], speed < 480 ? 1000 : 125 };
    b->s[b->streams++] = (struct sst_usb_stream){ .device = i, .needed_bytes_s = needed };
}

static int make_plan(struct bench *b)
{
    assert_int_equal(sst_usb_plan(&b->plan, b->d, b->n, b->s, b->streams), 0);
    return b->streams - b->plan.refused;
}

static bool same(double a, double b)
{
    return a - b < 1e-6 && b - a < 1e-6;
}

/* How many of 16 cameras with one setting of this packet fit behind one hub. */
static int fit(int packet, bool port_buses, double *reserved_mbit)
{
    struct bench b = { .n = 0 };
    int hub, fits;

    add(&b, "usb1", -1, 480, true, port_buses);
    hub = add(&b, "1-1", 0, 480, true, port_buses);
    for (int i = 1; i <= 16; i++)
        add_camera(&b, hub, 480, i, 0, &packet, 1);
    fits = make_plan(&b);
    assert_int_equal(b.plan.segment_count, 1);
    assert_int_equal(b.plan.segments[0].streams, fits);
    assert_int_equal(b.plan.segments[0].refused, 16 - fits);
    for (int i = 0; i < 16; i++)
        assert_int_equal(b.s[i].fits, i < fits);
    if (reserved_mbit)
        *reserved_mbit = b.plan.segments[0].reserved_mbit;
    free(b.plan.segments);
    return fits;
}

/*
 * By the time of packets, of which 100 us are to be had:
 *   3072 B: 7*8*3072/6 = 28672 bits, (38*8 + 3 + 28672) * 2.083 ns + 5 ns = 60.4 us, 61 with rounding: one
 *   1024 B: 9557 bits, 20.55 us, 21: four (84 us), a fifth would make 105
 *    512 B: 4778 bits, 10.6 us, 11: nine (99 us)
 * Bytes alone (6000 of 7500 in a microframe) would promise 1, 5 and 11.
 */
static void high_speed_bus_holds_what_its_time_allows(void **state SST_UNUSED)
{
    double mbit;

    assert_int_equal(fit(3072, false, &mbit), 1);
    assert_true(same(mbit, 61 * 480 / 125.0));
    assert_int_equal(fit(1024, false, NULL), 4);
    assert_int_equal(fit(512, false, &mbit), 9);
    assert_true(same(mbit, 9 * 11 * 480 / 125.0));
}

/* In blocks of 4 bytes, of which 80 % of 1607, 1285, are to be had: 768 + 3*26 = 846; 256 + 26 = 282; 128 + 26 = 154.
 */
static void ports_of_intel_hold_what_their_blocks_allow(void **state SST_UNUSED)
{
    double mbit;

    assert_int_equal(fit(3072, true, NULL), 1);
    assert_int_equal(fit(1024, true, NULL), 4);
    assert_int_equal(fit(512, true, &mbit), 8);
    assert_true(same(mbit, 8 * 154 * 480 / 1607.0));
}

static void root_ports_share_a_bus_or_have_one_each(void **state SST_UNUSED)
{
    const int packet = 3072;

    for (int port_buses = 0; port_buses < 2; port_buses++) {
        struct bench b = { .n = 0 };

        add(&b, "usb3", -1, 480, true, port_buses);
        for (int i = 1; i <= 4; i++)
            add_camera(&b, 0, 480, i, 0, &packet, 1);
        assert_int_equal(make_plan(&b), port_buses ? 4 : 1);
        assert_int_equal(b.plan.segment_count, port_buses ? 4 : 1);
        assert_string_equal(b.plan.segments[0].name, port_buses ? "high-speed port 3-1 of controller 0000:00:14.0"
                                                                : "high-speed bus of controller 0000:00:14.0");
        free(b.plan.segments);
    }
}

/*
 * 640x480 YUYV at 10/s: 6 144 000 bytes/s, 768 a microframe, and 12 of the payload's header: 780, so 800 is taken. At
 * 30/s 2304 + 12: 3072. A camera of which nothing is known asks for its largest.
 */
static void setting_is_the_smallest_that_carries_the_format(void **state SST_UNUSED)
{
    static const int packets[] = { 128, 512, 1024, 800, 3072 };
    struct bench b = { .n = 0 };
    int root_hub[4];

    for (int i = 0; i < 4; i++) {
        char port[8];

        snprintf(port, sizeof(port), "usb%d", i + 1);
        root_hub[i] = add(&b, port, -1, 480, true, false);
    }
    add_camera(&b, root_hub[0], 480, 1, sst_usb_format_bytes_s(0x56595559, 640, 480, 10), packets, 5);
    add_camera(&b, root_hub[1], 480, 1, sst_usb_format_bytes_s(0x56595559, 640, 480, 30), packets, 5);
    add_camera(&b, root_hub[2], 480, 1, sst_usb_format_bytes_s(0x47504a4d, 640, 480, 30), packets, 5);
    add_camera(&b, root_hub[3], 480, 1, sst_usb_format_bytes_s(0x56595559, 1920, 1080, 30), packets, 5);
    assert_int_equal(b.s[0].needed_bytes_s, 6144000);
    assert_int_equal(b.s[2].needed_bytes_s, 0);
    assert_int_equal(make_plan(&b), 3);
    assert_int_equal(b.s[0].alt, 4);
    assert_int_equal(b.s[1].alt, 5);
    assert_int_equal(b.s[2].alt, 5);
    assert_int_equal(b.s[3].alt, -1);
    assert_false(b.s[3].fits);
    assert_int_equal(b.plan.segments[b.s[3].segment].refused, 1);
    assert_int_equal(b.plan.segments[b.s[3].segment].streams, 0);
    free(b.plan.segments);
}

/* A refused stream reserves nothing: the small one after it still fits (61 + 2 * 21 > 100, 61 + 21 + 11 = 93). */
static void later_smaller_streams_may_fit(void **state SST_UNUSED)
{
    static const int big = 3072, middle = 1024, small = 512;
    struct bench b = { .n = 0 };

    add(&b, "usb1", -1, 480, true, false);
    add_camera(&b, 0, 480, 1, 0, &big, 1);
    add_camera(&b, 0, 480, 2, 0, &middle, 1);
    add_camera(&b, 0, 480, 3, 0, &middle, 1);
    add_camera(&b, 0, 480, 4, 0, &small, 1);
    assert_int_equal(make_plan(&b), 3);
    assert_true(b.s[1].fits && !b.s[2].fits && b.s[3].fits);
    assert_true(same(b.plan.segments[0].reserved_mbit, 93 * 480 / 125.0));
    free(b.plan.segments);
}

/*
 * Full speed, 1023 bytes: 9548 bits, 8.354 * (31 + 95480) / 1000 us + 8.268 us = 806.2 us, 807 of 900: one per
 * translator. A hub with one translator carries one camera, a hub with one for each port carries all three.
 */
static void full_speed_cameras_share_a_translator(void **state SST_UNUSED)
{
    const int packet = 1023;

    for (int single = 0; single < 2; single++) {
        struct bench b = { .n = 0 };
        int hub;

        add(&b, "usb1", -1, 480, true, false);
        hub = add(&b, "1-1", 0, 480, true, false);
        b.d[hub].single_tt = single;
        for (int i = 1; i <= 3; i++)
            add_camera(&b, hub, 12, i, 0, &packet, 1);
        assert_int_equal(make_plan(&b), single ? 1 : 3);
        assert_string_equal(b.plan.segments[0].name, single ? "hub 1-1 (TT)" : "hub 1-1 port 1 (TT)");
        assert_true(same(b.plan.segments[0].reserved_mbit, 807 * 12 / 1000.0));
        assert_string_equal(b.plan.segments[1].name, "high-speed bus of controller 0000:00:14.0");
        /* 188 bytes of each in a microframe of the bus above: 1754 bits, 4.3 us, 5 */
        assert_true(same(b.plan.segments[1].reserved_mbit, (single ? 1 : 3) * 5 * 480 / 125.0));
        free(b.plan.segments);
    }
}

/* Intel: 125 blocks for each translator in use, however many streams it has. */
static void translators_of_intel_take_a_fixed_share(void **state SST_UNUSED)
{
    const int packet = 300;
    struct bench b = { .n = 0 };
    int hub;

    add(&b, "usb1", -1, 480, true, true);
    hub = add(&b, "1-1", 0, 480, true, true);
    b.d[hub].single_tt = true;
    add_camera(&b, hub, 12, 1, 0, &packet, 1);
    add_camera(&b, hub, 12, 2, 0, &packet, 1);
    assert_int_equal(make_plan(&b), 2);
    assert_true(same(b.plan.segments[1].reserved_mbit, 125 * 480 / 1607.0));
    free(b.plan.segments);
}

/*
 * SuperSpeed at 5 Gbit/s: 3906 blocks of 16 bytes, 90 % to be had. 33 packets of 1024: 33 * (64 + 8) + 32 = 2408
 * blocks, 2466 Mbit/s of 3600. Two cameras behind one hub: the link of the hub carries one. At 10 Gbit/s three.
 */
static void superspeed_links_are_shared_up_to_the_root(void **state SST_UNUSED)
{
    const int packet = 33 * 1024;

    for (int speed = 5000; speed <= 10000; speed += 5000) {
        struct bench b = { .n = 0 };
        int hub;

        add(&b, "usb2", -1, speed, true, false);
        hub = add(&b, "2-1", 0, speed, true, false);
        for (int i = 1; i <= 4; i++)
            add_camera(&b, hub, 5000, i, 0, &packet, 1);
        assert_int_equal(make_plan(&b), speed == 5000 ? 1 : 3);
        assert_int_equal(b.plan.segment_count, 5); /* four links and the hub's own */
        assert_string_equal(b.plan.segments[0].name, "SuperSpeed link of port 2-1.1");
        assert_true(same(b.plan.segments[0].reserved_mbit, 2408 * 1.024));
        assert_string_equal(b.plan.segments[1].name, "SuperSpeed port 2-1 of controller 0000:00:14.0");
        assert_string_equal(b.plan.segments[b.s[3].segment].name, "SuperSpeed port 2-1 of controller 0000:00:14.0");
        free(b.plan.segments);
    }
}

static void bulk_and_unreadable_cameras(void **state SST_UNUSED)
{
    const int packet = 512;
    struct bench b = { .n = 0 };

    add(&b, "usb1", -1, 480, true, false);
    for (int i = 1; i <= 3; i++)
        add_camera(&b, 0, 480, i, 0, &packet, 1);
    b.d[1].alt[0].isochronous = false;
    b.d[2].alts = b.d[3].alts = 0;
    assert_int_equal(make_plan(&b), 2);
    assert_true(b.s[0].fits && b.s[0].reserved_mbit == 0);
    assert_true(b.s[1].fits);
    assert_true(same(b.s[1].reserved_mbit, 61 * 480 / 125.0));
    assert_false(b.s[2].fits);
    free(b.plan.segments);
}

/* --- deadlines ---------------------------------------------------------------------------------------------------- */

static _Atomic bool hangs;
static _Atomic int ended;

static int wait_and_return(void *arg)
{
    while (*(bool *)arg && hangs)
        usleep(1000);
    ended++;
    return -EIO;
}

static void calls_are_waited_for_no_longer_than_agreed(void **state SST_UNUSED)
{
    const bool at_once = false, never = true;
    int64_t start_ns;

    assert_int_equal(deadline_call(wait_and_return, &at_once, sizeof(at_once), 60000), -EIO);
    hangs = true;
    start_ns = sst_clock_now_ns();
    assert_int_equal(deadline_call(wait_and_return, &never, sizeof(never), 20), -ETIMEDOUT);
    assert_quick(start_ns, 400000000);
    assert_int_equal(ended, 1);
    hangs = false;
    for (int i = 0; i < 60000 && ended < 2; i++)
        usleep(1000);
    assert_int_equal(ended, 2);
    usleep(100000); /* its thread frees its memory */
}

static void resets_of_nothing_are_refused(void **state SST_UNUSED)
{
    assert_int_equal(sst_usb_reset("usb1"), -EINVAL);
    assert_int_equal(sst_usb_reauthorise("../1-1"), -EINVAL);
    assert_int_equal(sst_usb_power_cycle("", 10), -EINVAL);
    assert_int_equal(sst_usb_reset("97-1"), -ENODEV);
    assert_int_equal(sst_usb_reauthorise("97-1"), -ENODEV);
    assert_int_equal(sst_usb_power_cycle("97-1", 10), -ENODEV);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(tree_is_read_parents_first, make_tree, remove_tree),
        cmocka_unit_test(machine_without_usb_has_no_devices),
        cmocka_unit_test(settings_of_the_streaming_interface),
        cmocka_unit_test(superspeed_packets_come_from_the_companion),
        cmocka_unit_test(damaged_descriptors_end_the_walk),
        cmocka_unit_test(ports_are_compared_by_their_numbers),
        cmocka_unit_test(high_speed_bus_holds_what_its_time_allows),
        cmocka_unit_test(ports_of_intel_hold_what_their_blocks_allow),
        cmocka_unit_test(root_ports_share_a_bus_or_have_one_each),
        cmocka_unit_test(setting_is_the_smallest_that_carries_the_format),
        cmocka_unit_test(later_smaller_streams_may_fit),
        cmocka_unit_test(full_speed_cameras_share_a_translator),
        cmocka_unit_test(translators_of_intel_take_a_fixed_share),
        cmocka_unit_test(superspeed_links_are_shared_up_to_the_root),
        cmocka_unit_test(bulk_and_unreadable_cameras),
        cmocka_unit_test(calls_are_waited_for_no_longer_than_agreed),
        cmocka_unit_test(resets_of_nothing_are_refused),
    };

    return cmocka_run_group_tests_name("usb", tests, NULL, NULL);
}
