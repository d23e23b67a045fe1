/* tests/tools/sim_bus.c - GPIO by uAPI 2, libusb and libudev, as programs use them; for tests/system/sim_*.sh.
 * Prints a line for each thing found; exit 1: something is not as on a real system, 77: built without the library. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <poll.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>
#if WITH_USB
#include <libusb.h>
#endif
#if WITH_UDEV
#include <libudev.h>
#endif

#define PATIENCE_MS 60000 /* for a simulator that stands still for a while */

#define CHECK(what)                                                                                                    \
    do {                                                                                                               \
        if (!(what)) {                                                                                                 \
            printf("line %d: not so: %s (%s)\n", __LINE__, #what, strerror(errno));                                    \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

static int64_t now_ns(void)
{
    struct timespec t;

    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

/* --- GPIO --------------------------------------------------------------------------------------------------------- */

static int request(int chip, uint32_t offset, uint64_t flags)
{
    struct gpio_v2_line_request r = { .num_lines = 1, .offsets = { offset }, .consumer = "sim_bus" };

    r.config.flags = flags;
    return ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &r) < 0 ? -errno : r.fd;
}

static void set(int lines, int value)
{
    struct gpio_v2_line_values v = { .bits = (uint64_t)value, .mask = 1 };

    CHECK(ioctl(lines, GPIO_V2_LINE_SET_VALUES_IOCTL, &v) == 0);
}

static void *pulse_later(void *out)
{
    (void)usleep(100000);
    set(*(int *)out, 1);
    return NULL;
}

/** OUT is wired to IN. */
static int gpio(const char *path, uint32_t out_offset, uint32_t in_offset)
{
    const uint64_t edges = GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING | GPIO_V2_LINE_FLAG_EDGE_FALLING;
    const int chip = open(path, O_RDWR | O_CLOEXEC), in = request(chip, in_offset, edges);
    int out = request(chip, out_offset, GPIO_V2_LINE_FLAG_OUTPUT);
    struct pollfd p = { .fd = in, .events = POLLIN };
    struct gpio_v2_line_event event[8];
    int64_t before[6], after[6];
    pthread_t thread;

    CHECK(chip >= 0 && in >= 0 && out >= 0);
    CHECK(request(chip, out_offset, GPIO_V2_LINE_FLAG_OUTPUT) == -EBUSY);
    CHECK(ioctl(chip, GPIO_V2_GET_LINE_IOCTL, (void *)8) == -1 && errno == EFAULT);
    CHECK(poll(&p, 1, 0) == 0);
    for (int i = 0; i < 6; i++) {
        before[i] = now_ns();
        set(out, i % 2 == 0);
        after[i] = now_ns();
    }
    CHECK(poll(&p, 1, PATIENCE_MS) == 1 && p.revents == POLLIN);
    CHECK(read(in, event, 10) == -1 && errno == EINVAL);
    CHECK(read(in, event, sizeof(event)) == 6 * sizeof(event[0]));
    for (uint32_t i = 0; i < 6; i++) {
        CHECK(event[i].id == (i % 2 == 0 ? GPIO_V2_LINE_EVENT_RISING_EDGE : GPIO_V2_LINE_EVENT_FALLING_EDGE));
        CHECK((int64_t)event[i].timestamp_ns > before[i] && (int64_t)event[i].timestamp_ns < after[i]);
        CHECK(event[i].seqno == i + 1 && event[i].offset == in_offset);
    }
    CHECK(poll(&p, 1, 0) == 0);
    CHECK(fcntl(in, F_SETFL, O_NONBLOCK) == 0);
    CHECK(read(in, event, sizeof(event)) == -1 && errno == EAGAIN);
    CHECK(fcntl(in, F_SETFL, 0) == 0);
    CHECK(pthread_create(&thread, NULL, pulse_later, &out) == 0);
    CHECK(read(in, event, sizeof(event)) == sizeof(event[0])); /* waits */
    CHECK(pthread_join(thread, NULL) == 0);
    CHECK(close(out) == 0);
    CHECK(poll(&p, 1, PATIENCE_MS) == 1); /* released: the pin falls */
    /* A program can take a released interface again at once. */
    for (int i = 0; i < 2000; i++) {
        out = request(chip, out_offset, GPIO_V2_LINE_FLAG_OUTPUT);
        CHECK(out >= 0 && close(out) == 0);
    }
    printf("gpio ok\n");
    return 0;
}

/* --- libusb ------------------------------------------------------------------------------------------------------- */

#if WITH_USB
/** A device by its port path, "1.2" on bus 1. */
static libusb_device *find(libusb_device **list, const char *path)
{
    for (; *list; list++) {
        uint8_t ports[8];
        char text[64];
        const int n = libusb_get_port_numbers(*list, ports, 8);
        int at = snprintf(text, sizeof(text), "%d-", libusb_get_bus_number(*list));

        for (int i = 0; i < n; i++)
            at += snprintf(text + at, sizeof(text) - (size_t)at, "%s%d", i ? "." : "", ports[i]);
        if (strcmp(text, path) == 0)
            return *list;
    }
    return NULL;
}

static int usb(const char *path)
{
    libusb_context *context;
    libusb_device **list, *device;
    libusb_device_handle *h, *hub;
    struct libusb_device_descriptor descriptor;
    unsigned char text[64], status[4];
    char node[32];
    uint16_t port;
    int rc, fd;

    CHECK(libusb_init(&context) == 0);
    CHECK(libusb_get_device_list(context, &list) > 0);
    device = find(list, path);
    CHECK(device && libusb_open(device, &h) == 0);
    CHECK(libusb_get_string_descriptor_ascii(h, 3, text, sizeof(text)) == 7);
    printf("serial %s\n", text);
    CHECK(libusb_kernel_driver_active(h, 0) == 1);
    CHECK(libusb_claim_interface(h, 0) == LIBUSB_ERROR_BUSY);
    CHECK(libusb_detach_kernel_driver(h, 0) == 0);
    printf("node %s\n", access("/dev/video0", F_OK) == 0 ? "there" : "gone");
    CHECK(libusb_claim_interface(h, 0) == 0);
    CHECK(libusb_release_interface(h, 0) == 0);
    CHECK(libusb_attach_kernel_driver(h, 0) == 0);
    printf("node %s\n", access("/dev/video0", F_OK) == 0 ? "there" : "gone");
    CHECK(libusb_control_transfer(h, 0x80, 6, 0x0700, 0, text, 9, PATIENCE_MS) == LIBUSB_ERROR_PIPE);
    rc = libusb_reset_device(h);
    printf("reset %s\n", libusb_error_name(rc));
    port = libusb_get_port_number(device);
    CHECK(libusb_open(libusb_get_parent(device), &hub) == 0);
    CHECK(libusb_control_transfer(hub, 0xa3, 0, 0, port, status, 4, PATIENCE_MS) == 4);
    printf("port %02x%02x\n", status[1], status[0]);
    printf("power %s\n", libusb_error_name(libusb_control_transfer(hub, 0x23, 1, 8, port, NULL, 0, PATIENCE_MS)));
    libusb_close(hub);
    libusb_close(h);
    /* By an open file alone, as programs without the right to search do: the descriptors are the file's contents. */
    (void)snprintf(node, sizeof(node), "/dev/bus/usb/%03d/%03d", libusb_get_bus_number(device),
                   libusb_get_device_address(device));
    fd = open(node, O_RDWR | O_CLOEXEC);
    CHECK(fd >= 0 && libusb_wrap_sys_device(context, fd, &h) == 0);
    CHECK(libusb_get_device_descriptor(libusb_get_device(h), &descriptor) == 0 && descriptor.idVendor == 0x1209);
    libusb_close(h);
    CHECK(close(fd) == 0);
    libusb_free_device_list(list, 1);
    libusb_exit(context);
    return 0;
}
#else
static int usb(const char *path)
{
    (void)path;
    return 77;
}
#endif

/* --- libudev ------------------------------------------------------------------------------------------------------ */

#if WITH_UDEV
/** Say that it listens, then tell the events of a subsystem until one with this action has come, a minute at most. */
static int monitor(const char *subsystem, const char *last)
{
    struct udev *udev = udev_new();
    struct udev_monitor *m = udev_monitor_new_from_netlink(udev, "udev");
    const int64_t end = now_ns() + PATIENCE_MS * 1000000LL;
    bool done = false;

    CHECK(m && udev_monitor_filter_add_match_subsystem_devtype(m, subsystem, NULL) == 0);
    CHECK(udev_monitor_enable_receiving(m) == 0);
    printf("listening\n");
    (void)fflush(stdout);
    while (!done && now_ns() < end) {
        struct pollfd p = { .fd = udev_monitor_get_fd(m), .events = POLLIN };
        struct udev_device *d = poll(&p, 1, 100) > 0 ? udev_monitor_receive_device(m) : NULL;
        const char *serial = d ? udev_device_get_property_value(d, "ID_SERIAL_SHORT") : NULL;

        if (!d)
            continue;
        printf("%s %s %s\n", udev_device_get_action(d), udev_device_get_sysname(d), serial ? serial : "-");
        done = strcmp(udev_device_get_action(d), last) == 0;
        udev_device_unref(d);
    }
    udev_monitor_unref(m);
    udev_unref(udev);
    return !done;
}
#else
static int monitor(const char *subsystem, const char *last)
{
    (void)subsystem;
    (void)last;
    return 77;
}
#endif

int main(int argc, char **argv)
{
    (void)alarm(4 * PATIENCE_MS / 1000);
    if (argc == 5 && strcmp(argv[1], "gpio") == 0)
        return gpio(argv[2], (uint32_t)atoi(argv[3]), (uint32_t)atoi(argv[4]));
    if (argc == 3 && strcmp(argv[1], "usb") == 0)
        return usb(argv[2]);
    if (argc == 4 && strcmp(argv[1], "monitor") == 0)
        return monitor(argv[2], argv[3]);
    fprintf(stderr, "usage: sim_bus gpio CHIP OUT IN | usb PORT | monitor SUBSYSTEM LAST-ACTION\n");
    return 2;
}
