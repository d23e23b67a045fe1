/* Resets of a device in increasing strength: USB reset, re-authorisation, power of its hub port. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/log.h"
#include "drivers/usb/usb_internal.h"

#define DEVICES     "/sys/bus/usb/devices"
#define DEADLINE_MS 10000

struct write_job {
    char path[SST_PATH_MAX], text[2];
};

struct port_job {
    int bus, address, number;
    bool on;
};

static int write_text(void *arg)
{
    const struct write_job *job = arg;
    const int fd = open(job->path, O_WRONLY | O_CLOEXEC);
    int err = 0;

    if (fd < 0)
        return -errno;
    if (write(fd, job->text, strlen(job->text)) < 0)
        err = -errno;
    close(fd);
    return err;
}

static int write_attribute(const char *folder, const char *attribute, char digit)
{
    struct write_job job = { .text = { digit, 0 } };
    const int err = sst_path_join(job.path, folder, attribute);

    return err ? err : deadline_call(write_text, &job, sizeof(job), DEADLINE_MS);
}

static const char *remedy(int err)
{
    switch (-err) {
    case EACCES:
    case EPERM:
        return "; run as root or install systemd/60-sst.rules";
    case ETIMEDOUT:
        return "; the device or its hub hangs: unplug it";
    case ENODEV:
    case ENOENT:
        return "; nothing is plugged in there";
    case ENOSYS:
        return "; build with libusb-1.0-0-dev";
    default:
        return "";
    }
}

static int failed(const char *what, const char *port, int err)
{
    err = err == -EPERM ? -EACCES : err == -ENOENT ? -ENODEV : err;
    sst_log_warning("%s of USB port %s: %s%s", what, port, strerror(-err), remedy(err));
    return err;
}

static int device_folder(char folder[SST_PATH_MAX], const char *port)
{
    char hub[SST_USB_TEXT_MAX];
    int number;

    /* Ports come from the configuration: reject anything that contains a path. */
    return usb_split_port(port, hub, &number) ? -EINVAL : sst_path_join(folder, DEVICES, port);
}

static int reset_job(void *arg)
{
    const struct port_job *job = arg;

    return hub_reset_device(job->bus, job->address);
}

int sst_usb_reset(const char *port)
{
    char folder[SST_PATH_MAX];
    struct port_job job;
    int err = device_folder(folder, port);

    if (!err) {
        job = (struct port_job){ .bus = sysfs_int(folder, "busnum", 10, -1),
                                 .address = sysfs_int(folder, "devnum", 10, -1) };
        err = job.bus < 0 || job.address < 0 ? -ENODEV : deadline_call(reset_job, &job, sizeof(job), DEADLINE_MS);
    }
    return err ? failed("reset", port, err) : 0;
}

int sst_usb_reauthorise(const char *port)
{
    char folder[SST_PATH_MAX];
    int err = device_folder(folder, port);

    if (!err)
        err = write_attribute(folder, "authorized", '0');
    if (!err)
        err = write_attribute(folder, "authorized", '1');
    return err ? failed("re-authorising the device", port, err) : 0;
}

/* --- port power --------------------------------------------------------------------------------------------------- */

/* One port of one hub. */
struct power_port {
    char hub[SST_USB_TEXT_MAX];
    int number;
    char folder[SST_PATH_MAX]; /* of the port in sysfs */
    bool attribute;            /* sysfs has `disable` (Linux 6.0) */
};

/* Root hub usb1 has interface 1-0:1.0, hub 1-2 has 1-2:1.0. */
static int find_port(struct power_port *p)
{
    char name[4 * SST_USB_TEXT_MAX], disable[SST_PATH_MAX];
    int err;

    if (!strncmp(p->hub, "usb", 3))
        snprintf(name, sizeof(name), "%s/%s-0:1.0/%s-port%d", p->hub, p->hub + 3, p->hub, p->number);
    else
        snprintf(name, sizeof(name), "%s/%s:1.0/%s-port%d", p->hub, p->hub, p->hub, p->number);
    err = sst_path_join(p->folder, DEVICES, name);
    if (!err)
        err = sst_path_join(disable, p->folder, "disable");
    p->attribute = !err && sst_path_exists(disable);
    return err;
}

/* Port of the companion hub (USB 2 and 3) that shares connector and power. @return false: there is none */
static bool find_twin(struct power_port *twin, const struct power_port *port)
{
    char link[SST_PATH_MAX], target[SST_PATH_MAX];
    const char *name, *dash;
    ssize_t n;

    if (sst_path_join(link, port->folder, "peer") || (n = readlink(link, target, sizeof(target) - 1)) < 0)
        return false;
    target[n] = 0;
    name = sst_path_base(target);
    dash = strstr(name, "-port");
    if (!dash || (size_t)(dash - name) >= sizeof(twin->hub))
        return false;
    snprintf(twin->hub, sizeof(twin->hub), "%.*s", (int)(dash - name), name);
    twin->number = atoi(dash + 5);
    return !find_port(twin);
}

static int set_port_job(void *arg)
{
    const struct port_job *job = arg;

    return hub_set_port_power(job->bus, job->address, job->number, job->on);
}

static int hub_address(const struct power_port *p, struct port_job *job)
{
    char folder[SST_PATH_MAX];
    const int err = sst_path_join(folder, DEVICES, p->hub);

    if (err)
        return err;
    job->bus = sysfs_int(folder, "busnum", 10, -1);
    job->address = sysfs_int(folder, "devnum", 10, -1);
    job->number = p->number;
    return job->bus < 0 || job->address < 0 ? -ENODEV : 0;
}

static int switch_port(const struct power_port *p, bool on)
{
    struct port_job job = { .on = on };
    int err;

    if (p->attribute)
        return write_attribute(p->folder, "disable", on ? '0' : '1');
    err = hub_address(p, &job);
    return err ? err : deadline_call(set_port_job, &job, sizeof(job), DEADLINE_MS);
}

/* A hub that reports no switching is not tried; one that cannot be queried is. */
static int check_switching(const struct power_port *p)
{
    struct port_job job;
    enum sst_usb_switching how;
    const int err = hub_address(p, &job);

    if (err)
        return err;
    how = hub_switching(job.bus, job.address);
    return how == SST_USB_POWER_ALWAYS || how == SST_USB_POWER_GANGED ? -ENOTSUP : 0;
}

static void sleep_ms(int ms)
{
    struct timespec left = { ms / 1000, ms % 1000 * 1000000L };

    while (nanosleep(&left, &left) && errno == EINTR)
        ;
}

int sst_usb_power_cycle(const char *port, int off_ms)
{
    struct power_port half[2];
    int halves = 1, err = usb_split_port(port, half[0].hub, &half[0].number);

    if (!err)
        err = find_port(&half[0]);
    if (!err)
        err = check_switching(&half[0]);
    if (err)
        return failed("switching the power", port, err);
    halves += find_twin(&half[1], &half[0]);
    for (int i = 0; i < halves && !err; i++)
        err = switch_port(&half[i], false);
    if (!err)
        sleep_ms(off_ms);
    /* Always switch on again, also if only one of both was switched off. */
    for (int i = 0; i < halves; i++) {
        const int on = switch_port(&half[i], true);

        err = err ? err : on;
    }
    return err ? failed("switching the power", port, err) : 0;
}

enum sst_usb_switching sst_usb_hub_switching(const struct sst_usb_device *hub)
{
    return hub->hub ? hub_switching(hub->bus, hub->address) : SST_USB_POWER_UNKNOWN;
}
