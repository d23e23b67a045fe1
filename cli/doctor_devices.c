/* Checks of cameras, USB, trigger lines and the rig's bus. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <grp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/text.h"
#include "capture/array/capture.h"
#include "cli/cli_internal.h"
#include "cli/doctor_internal.h"
#include "drivers/grab/grab.h"
#include "drivers/still/still.h"
#include "drivers/trigger/trigger.h"

#define LIST_MAX 200

/* Names joined by commas; names that do not fit are only counted. */
struct names {
    char text[LIST_MAX];
    int count, shown;
};

static void add_name(struct names *n, const char *name)
{
    const size_t used = strlen(n->text);

    if (n->shown == n->count++ && used + strlen(name) + 24 < sizeof(n->text)) {
        sst_text_add(n->text, sizeof(n->text), "%s%s", used ? ", " : "", name);
        n->shown++;
    }
}

static const char *text_of(struct names *n)
{
    if (n->shown < n->count)
        sst_text_add(n->text, sizeof(n->text), " and %d more", n->count - n->shown);
    n->shown = n->count;
    return n->text;
}

/* Remedy for a missing permission: "adduser USER video", or another one. */
static void remedy_of_rights(const char *node, char *text, size_t size)
{
    struct stat st;
    const struct group *group = stat(node, &st) ? NULL : getgrgid(st.st_gid);

    if (group && st.st_gid && (st.st_mode & 0060) == 0060)
        snprintf(text, size, "add the user to group %s (adduser USER %s) and log in again", group->gr_name,
                 group->gr_name);
    else
        snprintf(text, size, "install systemd/60-sst.rules, which gives it to a group");
}

/* --- cameras ------------------------------------------------------------------------------------------------------ */

static void check_answers(struct doctor *d, const struct sst_grab_device *list, int n)
{
    struct names denied = { .count = 0 }, silent = { .count = 0 };
    const char *node = "";
    char remedy[160];
    int error = 0;

    for (int i = 0; i < n; i++) {
        if (list[i].error == EACCES || list[i].error == EPERM) {
            add_name(&denied, list[i].node);
            node = list[i].node;
        } else if (list[i].error) {
            add_name(&silent, list[i].node);
            error = list[i].error;
        }
    }
    if (denied.count) {
        remedy_of_rights(node, remedy, sizeof(remedy));
        doctor_add(d, DOCTOR_PROBLEM, "rights", "no permission to open %s: %s", text_of(&denied), remedy);
    }
    if (silent.count)
        doctor_add(d, DOCTOR_PROBLEM, "cameras", "cannot open %s (%s): unplug and plug it in again", text_of(&silent),
                   strerror(error));
    if (n && !denied.count && !silent.count)
        doctor_add(d, DOCTOR_OK, "rights", "%d camera%s can be opened", n, n == 1 ? "" : "s");
}

static void check_serials(struct doctor *d, const struct sst_grab_device *list, int n)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i && list[i].serial[0]; j++) {
            if (strcmp(list[i].serial, list[j].serial))
                continue;
            doctor_add(d, DOCTOR_WARNING, "cameras",
                       "the cameras on ports %s and %s both have serial %s: bind them by port", list[j].port,
                       list[i].port, list[i].serial);
            return; /* one pair is enough */
        }
    }
}

static int devices_of(const struct sst_config_camera *c, const struct sst_grab_device *list, int n)
{
    int found = 0;

    for (int i = 0; i < n; i++)
        found += cli_is_node(c, &list[i]);
    return found;
}

static void check_places(struct doctor *d, const struct sst_grab_device *list, int n, int all)
{
    struct names missing = { .count = 0 }, twice = { .count = 0 };

    const int bound = sst_array_count(d->cfg, SST_CONFIG_V4L2);

    for (int b = 0; b < d->cfg->bound; b++) {
        const struct sst_config_camera *c = &d->cfg->camera[b];
        const int found = devices_of(c, list, all);
        char name[96];

        if (c->kind != SST_CONFIG_V4L2)
            continue;
        snprintf(name, sizeof(name), "r%dc%d (%s %s)", c->row, c->col, c->serial[0] ? "serial" : "port",
                 c->serial[0] ? c->serial : c->port);
        if (!found)
            add_name(&missing, name);
        if (found > 1)
            add_name(&twice, name);
        d->cameras += found > 0;
    }
    if (missing.count)
        doctor_add(d, DOCTOR_PROBLEM, "cameras",
                   "%d of %d cameras are missing, %s: plug them in, or correct `bind` (`sst cameras` lists the "
                   "connected ones)",
                   missing.count, bound, text_of(&missing));
    if (twice.count)
        doctor_add(d, DOCTOR_PROBLEM, "cameras", "several cameras have the serial of %s: bind them by port",
                   text_of(&twice));
    if (bound && !missing.count && !twice.count)
        doctor_add(d, DOCTOR_OK, "cameras", "all %d cameras of the configuration are connected", bound);
    if (n > bound)
        doctor_add(d, DOCTOR_OK, "cameras", "%d more cameras are plugged in than the configuration binds",
                   n - bound);
}

void doctor_check_cameras(struct doctor *d)
{
    const int places = d->cfg->rows * d->cfg->cols;
    struct sst_grab_device *list = NULL;
    int n = 0, all = 0, err = sst_grab_list(&list, &all);

    if (err) {
        doctor_add(d, DOCTOR_PROBLEM, "cameras", "listing cameras: %s", strerror(-err));
        return;
    }
    n = sst_grab_select(list, all, d->cfg->fourcc);
    check_answers(d, list, n);
    check_serials(d, list, n);
    if (sst_grab_list_parts(&list, &n, &all, sst_capture_split(d->cfg))) {
        doctor_add(d, DOCTOR_PROBLEM, "cameras", "no memory for a list of cameras");
        free(list);
        return;
    }
    if (d->cfg->bound) {
        check_places(d, list, n, all);
    } else {
        d->cameras = sst_min_int(n, places);
        if (!n)
            doctor_add(d, DOCTOR_PROBLEM, "cameras", "no camera is connected: plug one in, and see `sst topology`");
        else if (n < places)
            doctor_add(d, DOCTOR_WARNING, "cameras",
                       "%d cameras for %dx%d positions: the last positions stay empty; bind cameras to positions, or "
                       "correct rows and cols",
                       n, d->cfg->rows, d->cfg->cols);
        else
            doctor_add(d, DOCTOR_OK, "cameras", "%d cameras for %dx%d positions, in the order of their ports", n,
                       d->cfg->rows, d->cfg->cols);
    }
    free(list);
}

/* --- still cameras: for the rig, so that none is fine ------------------------------------------------------------- */

void doctor_check_still(struct doctor *d)
{
    struct names denied = { .count = 0 };
    struct sst_still_device *list;
    char node[64] = "", remedy[160];
    int n;

    if (sst_still_list(&list, &n)) {
        doctor_add(d, DOCTOR_PROBLEM, "still", "still cameras cannot be listed (see above)");
        return;
    }
    for (int i = 0; i < n; i++) {
        if (!list[i].error)
            continue;
        snprintf(node, sizeof(node), "/dev/bus/usb/%03d/%03d", list[i].bus, list[i].address);
        add_name(&denied, node);
    }
    free(list);
    if (denied.count) {
        remedy_of_rights(node, remedy, sizeof(remedy));
        doctor_add(d, DOCTOR_PROBLEM, "still", "no permission to open still camera %s: %s", text_of(&denied), remedy);
    } else if (n && !WITH_GPHOTO2) {
        doctor_add(d, DOCTOR_WARNING, "still",
                   "a still camera is connected, but sst is built without libgphoto2: install libgphoto2-dev and build "
                   "again");
    } else if (n) {
        doctor_add(d, DOCTOR_OK, "still", "%d still camera%s can be opened", n, n == 1 ? "" : "s");
    }
}

/* --- USB ---------------------------------------------------------------------------------------------------------- */

/* True for a camera without a driver. */
static void check_nodes(struct doctor *d, const struct cli_usb *u)
{
    struct names idle = { .count = 0 };

    for (int i = 0; i < u->count; i++) {
        if (u->devices[i].alts && !u->devices[i].node[0])
            add_name(&idle, u->devices[i].port);
    }
    if (idle.count)
        doctor_add(d, DOCTOR_WARNING, "cameras",
                   "%d cameras have no /dev/video node (ports %s): load their driver (modprobe uvcvideo), or check "
                   "`dmesg` for why it rejects them",
                   idle.count, text_of(&idle));
}

/* Permissions for recovery: the device node for a reset, sysfs for the next steps. */
static void check_recovery(struct doctor *d, const struct cli_usb *u)
{
    struct names denied = { .count = 0 };

    for (int i = 0; i < u->stream_count; i++) {
        const struct sst_usb_device *dev = &u->devices[u->streams[i].device];
        char node[64];

        snprintf(node, sizeof(node), "/dev/bus/usb/%03d/%03d", dev->bus, dev->address);
        if (access(node, W_OK))
            add_name(&denied, node);
    }
    if (denied.count)
        doctor_add(d, DOCTOR_WARNING, "rights",
                   "no permission to reset cameras that hang (%s): install systemd/60-sst.rules; without it recovery "
                   "ends at reopening them",
                   text_of(&denied));
    else if (u->stream_count)
        doctor_add(d, DOCTOR_OK, "rights", "cameras that hang can be reset over USB");
}

void doctor_check_bandwidth(struct doctor *d)
{
    char advice[400];
    struct cli_usb usb;

    if (cli_usb_open(&usb, d->cfg)) {
        doctor_add(d, DOCTOR_PROBLEM, "bandwidth", "the USB tree cannot be read (see above)");
        return;
    }
    check_nodes(d, &usb);
    check_recovery(d, &usb);
    cli_usb_advise(&usb, d->cfg, advice, sizeof(advice));
    if (usb.plan.refused)
        doctor_add(d, DOCTOR_PROBLEM, "bandwidth",
                   "USB has no bandwidth for %d of %d cameras (`sst plan` shows which): %s", usb.plan.refused,
                   usb.stream_count, advice);
    else if (usb.stream_count)
        doctor_add(d, DOCTOR_OK, "bandwidth", "USB carries all %d cameras", usb.stream_count);
    cli_usb_close(&usb);
}

/* --- trigger and rig ---------------------------------------------------------------------------------------------- */

void doctor_check_trigger(struct doctor *d)
{
    struct sst_trigger_config cfg;
    char why[500];

    sst_capture_trigger_config(&cfg, d->cfg);
    if (sst_trigger_check(&cfg, why, sizeof(why)))
        doctor_add(d, DOCTOR_PROBLEM, "trigger", "%s", why);
    else
        doctor_add(d, DOCTOR_OK, "trigger", "%s", why);
}

/* Only a serial line is checked; `sst capture rig` reports a drive on the network. */
void doctor_check_rig(struct doctor *d)
{
    char path[SST_CONFIG_TEXT_MAX], remedy[160];

    if (strncmp(d->cfg->rig_bus, "rtu:", 4))
        return;
    snprintf(path, sizeof(path), "%.*s", (int)strcspn(d->cfg->rig_bus + 4, ","), d->cfg->rig_bus + 4);
    if (!access(path, R_OK | W_OK)) {
        doctor_add(d, DOCTOR_OK, "rig", "serial line %s can be opened", path);
    } else if (errno == EACCES) {
        remedy_of_rights(path, remedy, sizeof(remedy));
        doctor_add(d, DOCTOR_PROBLEM, "rig", "no permission to open serial line %s: %s", path, remedy);
    } else {
        doctor_add(d, DOCTOR_PROBLEM, "rig", "serial line %s: %s: plug the adapter in, or correct the rig's bus", path,
                   strerror(errno));
    }
}
