/* Still cameras on the bus: devices with an interface of the still image class. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "base/mem.h"
#include "drivers/still/still.h"
#include "drivers/usb/usb.h"

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
        if (all[i].still)
            describe(&list[n++], &all[i]);
    free(all);
    *devices = list;
    *count = n;
    return 0;
}
