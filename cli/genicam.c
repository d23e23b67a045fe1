/* GenICam cameras: their list, and their part of sst doctor. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/text.h"
#include "cli/doctor_internal.h"

bool cli_is_genicam(const struct sst_config_camera *c, const struct sst_genicam_device *d)
{
    return c->kind == SST_CONFIG_GENICAM && (!*c->port || !strcmp(c->port, d->address)) &&
           (!*c->serial || !strcmp(c->serial, d->serial) || !strcmp(c->serial, d->id));
}

int cli_genicam_list(struct sst_genicam_device **devices, int *count)
{
    const int err = sst_genicam_list(devices, count);

    if (!err)
        return 0;
    *devices = NULL;
    *count = 0;
    return err == -ENOTSUP ? 0 : err;
}

struct cli_place cli_genicam_place(const struct sst_array_config *cfg, const struct sst_genicam_device *d)
{
    for (int k = 0; k < cfg->bound; k++)
        if (cli_is_genicam(&cfg->camera[k], d))
            return (struct cli_place){ cfg->camera[k].row, cfg->camera[k].col };
    return (struct cli_place){ -1, -1 };
}

json_t *cli_genicam_json(const struct sst_array_config *cfg, const struct sst_genicam_device *devices, int count)
{
    json_t *list = json_array();

    for (int i = 0; list && i < count; i++) {
        const struct sst_genicam_device *d = &devices[i];
        json_t *one = json_pack("{s:s, s:s, s:s, s:s, s:s, s:s}", "id", d->id, "vendor", d->vendor, "model", d->model,
                                "serial", d->serial, "port", d->address, "driver", d->protocol);

        if (!cli_place_json(one, cli_genicam_place(cfg, d)) || json_array_append_new(list, one)) {
            json_decref(list);
            list = NULL;
        }
    }
    return list;
}

void cli_genicam_print(const struct sst_array_config *cfg, const struct sst_genicam_device *devices, int count)
{
    char at[16];

    if (count)
        printf("\n%-6s %-30s %-14s %-16s %s\n", "PLACE", "GENICAM CAMERA", "SERIAL", "ADDRESS", "DRIVER");
    for (int i = 0; i < count; i++)
        printf("%-6s %-30s %-14s %-16s %s\n", cli_place_text(at, cli_genicam_place(cfg, &devices[i])), devices[i].id,
               *devices[i].serial ? devices[i].serial : "-", devices[i].address, devices[i].protocol);
}

/* --- sst doctor --------------------------------------------------------------------------------------------------- */

static const struct sst_genicam_device *device_of(const struct sst_config_camera *c,
                                                  const struct sst_genicam_device *devices, int count)
{
    for (int i = 0; i < count; i++)
        if (cli_is_genicam(c, &devices[i]))
            return &devices[i];
    return NULL;
}

struct clocks {
    int masters, slaves, others;
    int64_t worst_ns;
    char worst[SST_GENICAM_ID_MAX], other[SST_GENICAM_ID_MAX + 32], master[2][SST_GENICAM_ID_MAX];
};

static void add_clock(struct clocks *all, const struct sst_genicam_device *d, const struct sst_genicam_ptp *ptp)
{
    const int64_t off_ns = llabs(ptp->offset_ns);

    if (!strcmp(ptp->role, "Master")) {
        if (all->masters < 2)
            snprintf(all->master[all->masters], sizeof(all->master[0]), "%s", d->id);
        all->masters++;
    } else if (!strcmp(ptp->role, "Slave")) {
        all->slaves++;
        if (off_ns >= all->worst_ns) {
            all->worst_ns = off_ns;
            snprintf(all->worst, sizeof(all->worst), "%s", d->id);
        }
    } else {
        if (!all->others++)
            snprintf(all->other, sizeof(all->other), "%s (%s)", d->id, *ptp->role ? ptp->role : "without PTP");
    }
}

static void report_clocks(struct doctor *d, const struct clocks *c)
{
    if (c->masters > 1)
        doctor_add(d, DOCTOR_PROBLEM, "ptp",
                   "%d cameras are PTP masters, %s and %s among them, so that each has its own time: connect them to one "
                   "network, with one master that is better than they (ptp4l, or a switch)",
                   c->masters, c->master[0], c->master[1]);
    if (c->others)
        doctor_add(d, DOCTOR_WARNING, "ptp",
                   "%d cameras follow no PTP master, the first is %s: they need some seconds after their start, and a "
                   "network without a router between them and the master",
                   c->others, c->other);
    if (c->slaves && c->worst_ns > (int64_t)d->cfg->skew_limit_us * 1000)
        doctor_add(d, DOCTOR_WARNING, "ptp", "the clock of %s is %.1f us off the PTP master's, more than sets: "
                   "skew_limit_us: wait until it is synchronised, or use a switch that knows PTP",
                   c->worst, (double)c->worst_ns / 1e3);
    else if (c->slaves)
        doctor_add(d, DOCTOR_OK, "ptp", "%d cameras follow a PTP master%s, the farthest by %.1f us", c->slaves,
                   c->masters == 1 ? " among them" : "", (double)c->worst_ns / 1e3);
}

/* Packets of a frame come faster than a busy machine reads them; Aravis asks for room for one, the kernel has a limit. */
static void check_buffer(struct doctor *d)
{
    const struct sst_array_config *a = d->cfg;
    const char *format = sst_array_format_name(a->fourcc);
    const long frame = (long)a->width * a->height * (!strcmp(format, "Y16") ? 2 : !strcmp(format, "RGB24") ? 3 : 1);
    char line[32];
    long limit;

    limit = atol(sst_file_line(line, sizeof(line), "/proc/sys/net/core/rmem_max"));
    if (limit > 0 && limit < frame)
        doctor_add(d, DOCTOR_WARNING, "genicam",
                   "the kernel holds %ld bytes of received packets, a frame has %ld: on a busy machine packets are lost; "
                   "sysctl -w net.core.rmem_max=33554432, and put it into /etc/sysctl.d",
                   limit, frame);
}

void doctor_check_genicam(struct doctor *d)
{
    const struct sst_array_config *a = d->cfg;
    const int bound = sst_array_count(a, SST_CONFIG_GENICAM);
    struct sst_genicam_device *devices = NULL;
    struct clocks clocks = { 0 };
    char missing[200] = "";
    int count = 0, absent = 0, err;

    if (!bound)
        return;
    err = sst_genicam_list(&devices, &count);
    if (err) {
        doctor_add(d, DOCTOR_PROBLEM, "genicam",
                   "%d cameras of kind genicam are bound, but %s", bound,
                   err == -ENOTSUP ? "libsst-aravis.so is missing: install sst-genicam, or libaravis-dev and build again"
                                   : "cameras cannot be listed");
        return;
    }
    for (int i = 0; i < a->bound; i++) {
        const struct sst_config_camera *c = &a->camera[i];
        const struct sst_genicam_device *device = device_of(c, devices, count);
        struct sst_genicam_ptp ptp = { 0 };

        if (c->kind != SST_CONFIG_GENICAM)
            continue;
        if (!device && absent++ < 4)
            sst_text_add(missing, sizeof(missing), "%s%s", absent > 1 ? ", " : "", *c->serial ? c->serial : c->port);
        d->cameras += device != NULL;
        if (device && a->genicam.ptp && !sst_genicam_read_ptp(device, &ptp))
            add_clock(&clocks, device, &ptp);
    }
    free(devices);
    if (absent)
        doctor_add(d, DOCTOR_PROBLEM, "genicam",
                   "%d of %d GenICam cameras do not answer, %s%s: check cable, power and address (the host and a camera "
                   "need addresses of one network), and the firewall (UDP from port 3956)",
                   absent, bound, missing, absent > 4 ? " ..." : "");
    else
        doctor_add(d, DOCTOR_OK, "genicam", "all %d GenICam cameras of the configuration answer", bound);
    if (a->genicam.ptp)
        report_clocks(d, &clocks);
    check_buffer(d);
}
