/* Still cameras on the bus: devices with an interface of the still image class, from sysfs. */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "base/mem.h"
#include "drivers/still/still.h"
#include "drivers/usb/usb.h"

#define DEVICES "/sys/bus/usb/devices"

/** A hexadecimal attribute of an interface, or -1. */
static int attribute(const char *interface, const char *name)
{
    char path[512], text[16] = "";
    FILE *f;

    snprintf(path, sizeof(path), DEVICES "/%.200s/%s", interface, name);
    f = fopen(path, "re");
    if (!f)
        return -1;
    if (!fgets(text, sizeof(text), f))
        text[0] = 0;
    fclose(f);
    return text[0] ? (int)strtol(text, NULL, 16) : -1;
}

/** Still image class, still image capture device, PTP. */
static bool is_ptp(const char *interface)
{
    return attribute(interface, "bInterfaceClass") == 6 && attribute(interface, "bInterfaceSubClass") == 1 &&
           attribute(interface, "bInterfaceProtocol") == 1;
}

/** True if a device has such an interface: "1-2.3:1.0" of "1-2.3". */
static bool has_ptp(const char *port)
{
    const size_t n = strlen(port);
    DIR *dir = opendir(DEVICES);
    bool found = false;

    for (struct dirent *e = dir ? readdir(dir) : NULL; e && !found; e = readdir(dir))
        found = !strncmp(e->d_name, port, n) && e->d_name[n] == ':' && is_ptp(e->d_name);
    if (dir)
        closedir(dir);
    return found;
}

static void describe(struct sst_still_device *out, const struct sst_usb_device *d)
{
    char node[64];

    *out = (struct sst_still_device){ .bus = d->bus, .address = d->address };
    snprintf(out->port, sizeof(out->port), "%s", d->port);
    snprintf(out->serial, sizeof(out->serial), "%s", d->serial);
    snprintf(out->name, sizeof(out->name), "%s%s%s", d->maker, d->maker[0] && d->name[0] ? " " : "", d->name);
    snprintf(node, sizeof(node), "/dev/bus/usb/%03d/%03d", d->bus, d->address);
    out->error = access(node, R_OK | W_OK) ? errno : 0;
}

int sst_still_list(struct sst_still_device **devices, int *count)
{
    struct sst_usb_device *all;
    struct sst_still_device *list;
    int total, n = 0, err = sst_usb_list(&all, &total);

    if (err)
        return err;
    list = calloc((size_t)total + 1, sizeof(*list));
    if (!list) {
        sst_log_error("no memory for a list of still cameras");
        free(all);
        return -ENOMEM;
    }
    for (int i = 0; i < total; i++)
        if (!all[i].hub && has_ptp(all[i].port))
            describe(&list[n++], &all[i]);
    free(all);
    *devices = list;
    *count = n;
    return 0;
}
