/* drivers/usb on the simulated tree: the list, resets that really take the camera away and bring it back, and refusals.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "drivers/usb/usb.h"
#include "tests/sim_session.h"
#include "tests/test.h"

#define PATIENCE 1200 /* looks, 50 ms apart, for events that come on any machine, sooner or later */

static void set_fault(const char *fault)
{
    assert_int_equal(session_fault(fault), 0);
}

/* The device at a port, or the first with this serial. @return false: away */
static bool look(struct sst_usb_device *out, const char *port, const char *serial)
{
    struct sst_usb_device *list;
    bool found = false;
    int n;

    assert_int_equal(sst_usb_list(&list, &n), 0);
    for (int i = 0; i < n && !found; i++) {
        found = (port && !strcmp(list[i].port, port)) || (serial && !strcmp(list[i].serial, serial));
        if (found)
            *out = list[i];
    }
    free(list);
    return found;
}

static bool wait_for_node(const char *port, struct sst_usb_device *d)
{
    for (int i = 0; i < PATIENCE; i++) {
        if (look(d, port, NULL) && d->node[0] && !access(d->node, F_OK))
            return true;
        usleep(50000);
    }
    return false;
}

/* libusb starts at the beginning of a device's node. */
static void need_usbfs(const struct sst_usb_device *d)
{
    char node[64];
    int fd;

    if (!WITH_USB) {
        print_message("built without libusb\n");
        skip();
    }
    snprintf(node, sizeof(node), "/dev/bus/usb/%03d/%03d", d->bus, d->address);
    fd = open(node, O_RDWR | O_CLOEXEC);
    assert_true(fd >= 0 && lseek(fd, 0, SEEK_SET) == 0);
    close(fd);
}

static void cameras_are_listed_with_serials_and_nodes(void **state SST_UNUSED)
{
    struct sst_usb_device d, hub;

    assert_true(look(&d, NULL, "SIM0000"));
    assert_int_equal(d.speed_mbit, 480);
    assert_true(d.node[0] && d.alts > 1 && d.parent >= 0 && !d.hub && d.controller[0]);
    assert_true(look(&hub, "usb1", NULL));
    assert_true(hub.hub && hub.hub_ports > 0 && hub.parent == -1);
}

static void reauthorised_camera_comes_back(void **state SST_UNUSED)
{
    struct sst_usb_device d;
    char port[SST_USB_TEXT_MAX];

    assert_true(look(&d, NULL, "SIM0001"));
    strcpy(port, d.port);
    assert_int_equal(sst_usb_reauthorise(port), 0);
    assert_true(wait_for_node(port, &d));
    assert_string_equal(d.serial, "SIM0001");
}

static void reset_camera_stays_and_failed_resets_are_told(void **state SST_UNUSED)
{
    struct sst_usb_device d;
    char port[SST_USB_TEXT_MAX];

    assert_true(look(&d, NULL, "SIM0002"));
    strcpy(port, d.port);
    need_usbfs(&d);
    assert_int_equal(sst_usb_reset(port), 0);
    assert_true(wait_for_node(port, &d));
    set_fault("usb.reset_fails=1");
    assert_true(sst_usb_reset(port) < 0);
    set_fault("usb.reset_fails=0");
    assert_int_equal(sst_usb_reset(port), 0);
}

static void port_power_takes_the_camera_away_and_brings_it_back(void **state SST_UNUSED)
{
    struct sst_usb_device d;
    char port[SST_USB_TEXT_MAX];
    int before;

    assert_true(look(&d, NULL, "SIM0003"));
    strcpy(port, d.port);
    before = d.address;
    assert_int_equal(sst_usb_power_cycle(port, 50), 0);
    assert_true(wait_for_node(port, &d));
    assert_string_equal(d.serial, "SIM0003");
    assert_true(d.address != before); /* enumerated anew */
    need_usbfs(&d);                   /* to ask the hub */
    set_fault("usb.no_port_power=1");
    assert_int_equal(sst_usb_power_cycle(port, 50), -ENOTSUP);
    set_fault("usb.no_port_power=0");
}

static void unplugged_port_has_nothing_to_reset(void **state SST_UNUSED)
{
    struct sst_usb_device d;
    char port[SST_USB_TEXT_MAX];

    assert_true(look(&d, NULL, "SIM0004"));
    strcpy(port, d.port);
    set_fault("camera.4.unplug=1");
    for (int i = 0; i < PATIENCE && look(&d, port, NULL); i++)
        usleep(50000);
    assert_int_equal(sst_usb_reset(port), -ENODEV);
    assert_int_equal(sst_usb_reauthorise(port), -ENODEV);
    set_fault("camera.4.unplug=0");
    assert_true(wait_for_node(port, &d));
}

int main(int argc SST_UNUSED, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cameras_are_listed_with_serials_and_nodes),
        cmocka_unit_test(reauthorised_camera_comes_back),
        cmocka_unit_test(reset_camera_stays_and_failed_resets_are_told),
        cmocka_unit_test(port_power_takes_the_camera_away_and_brings_it_back),
        cmocka_unit_test(unplugged_port_has_nothing_to_reset),
    };
    int skipped;

    skipped = session_enter(argv);
    if (skipped)
        return skipped;
    return cmocka_run_group_tests_name("USB on a simulated tree", tests, NULL, NULL);
}
