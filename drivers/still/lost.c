/* Finding and opening a camera, and opening it again after it was unplugged or hung. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "drivers/still/still_internal.h"
#include "drivers/usb/usb.h"

#define LOOK_MS 100
#define LOOKS   3

static const char *name_of(const struct sst_still *s)
{
    return s->serial[0] ? s->serial : s->port;
}

/** Is it listed where it was opened? A device that is plugged in again has another address. */
static bool is_listed(const struct sst_still *s)
{
    struct sst_still_device *list;
    bool found = false;
    int count;

    if (sst_still_list(&list, &count))
        return false;
    for (int i = 0; i < count; i++)
        found |= list[i].bus == s->bus && list[i].address == s->address;
    free(list);
    return found;
}

/** The kernel ends transfers a moment before it takes the device off its list. */
static bool is_plugged(const struct sst_still *s)
{
    bool listed = is_listed(s);

    for (int i = 0; i < LOOKS && listed; i++) {
        still_sleep_ms(LOOK_MS);
        listed = is_listed(s);
    }
    return listed;
}

int still_failed(struct sst_still *s, int err, const char *what)
{
    const char *said = still_lib_said(s->lib);

    if (still_cancelled(s)) /* the signal may have ended the transfer */
        return -ECANCELED;
    switch (err) {
    case -ETIMEDOUT:
        s->count.silent++;
        sst_log_error("still camera %s does not answer within %d ms (%s); it is closed and opened again; if that does "
                      "not help, switch it off and on",
                      name_of(s), s->cfg.response_ms, what);
        break;
    case -EBUSY:
        s->count.busy++;
        sst_log_error("still camera %s is busy (%s); close menus and other programs that use it", name_of(s), what);
        return err;
    case -ENOMEDIUM:
        sst_log_error("still camera %s has no space on its card or no card (%s: %s); empty or exchange the card, then "
                      "run the same command to resume",
                      name_of(s), what, said);
        return err;
    case -EPERM:
    case -EACCES:
        sst_log_error("still camera %s refuses (%s: %s); check its mode dial and its menus", name_of(s), what, said);
        return err;
    case -ENOMEM:
        sst_log_error("still camera %s: not enough memory (%s)", name_of(s), what);
        return err;
    case -ECANCELED:
        return err;
    default:
        s->count.lost++;
        if (is_plugged(s))
            sst_log_error(
                "a transfer over USB from still camera %s failed (%s: %s); it is closed and opened again; if it "
                "happens again, exchange its cable",
                name_of(s), what, said);
        else
            sst_log_error("still camera %s was unplugged or switched off (%s); check its cable, its power and its "
                          "automatic switching off",
                          name_of(s), what);
        break;
    }
    still_lib_close(s->lib);
    s->lib = NULL;
    return err;
}

/* --- finding ------------------------------------------------------------------------------------------------------ */

static int list_none(const struct sst_still_device *list, int count, const char *wanted, int matches)
{
    char text[512] = "";

    for (int i = 0; i < count; i++)
        sst_text_add(text, sizeof(text), "%s%s at %s (%s)", i ? ", " : "",
                     list[i].serial[0] ? list[i].serial : "no serial", list[i].port, list[i].name);
    if (!count)
        sst_log_error("no still camera is connected; plug it in, switch it on and set it to PTP");
    else if (matches > 1)
        sst_log_error("%d still cameras match; select one of them by serial or port: %s", matches, text);
    else
        sst_log_error("no still camera %s is connected; there are: %s", wanted, text);
    return -ENODEV;
}

static int open_failed(const struct sst_still_device *d, int err, const char *said)
{
    const char *who = d->serial[0] ? d->serial : d->port;

    switch (err) {
    case -ENOPKG:
        sst_log_error("still cameras need libgphoto2: %s; install libgphoto2-dev and build again",
                      WITH_GPHOTO2 ? said : "sst was built without it");
        return err;
    case -EACCES:
        sst_log_error(
            "no permission to open still camera %s (/dev/bus/usb/%03d/%03d); install systemd/60-sst.rules and "
            "add the user to group video, or run as root",
            who, d->bus, d->address);
        return err;
    case -EBUSY:
        sst_log_error("another program uses still camera %s (%s); close file managers and photo programs that opened "
                      "it, such as gvfs-gphoto2-volume-monitor",
                      who, said);
        return err;
    case -ENOMEM:
        sst_log_error("still camera %s: not enough memory", who);
        return err;
    default:
        sst_log_error("still camera %s cannot be opened: %s; switch it off and on", who,
                      said[0] ? said : strerror(-err));
        return err;
    }
}

/** PTP's serial number, which cameras have that do not give one by USB. */
static void read_serial(struct sst_still *s, const struct sst_still_device *d)
{
    struct still_setting now;

    memcpy(s->port, d->port, sizeof(s->port));
    memcpy(s->serial, d->serial, sizeof(s->serial));
    if (!still_lib_read(s->lib, "serialnumber", &now) && now.value[0] && strcmp(now.value, "None") != 0)
        memcpy(s->serial, now.value, sizeof(s->serial));
}

static int open_device(struct sst_still *s, const struct sst_still_device *d)
{
    int err = d->error == EACCES || d->error == EPERM ? -EACCES : 0;

    err = err ? err : still_lib_open(&s->lib, d->bus, d->address, s->cfg.response_ms);
    if (!err) {
        s->bus = d->bus;
        s->address = d->address;
        read_serial(s, d);
        return still_card_read(s);
    }
    err = open_failed(d, err, still_lib_said(s->lib));
    still_lib_close(s->lib);
    s->lib = NULL;
    return err;
}

/** Cameras without a serial by USB: open each and look at PTP's. */
static int search_serial(struct sst_still *s, const struct sst_still_device *list, int count, const char *wanted)
{
    for (int i = 0; i < count; i++) {
        if (list[i].serial[0] || open_device(s, &list[i]))
            continue;
        if (!strcmp(s->serial, wanted))
            return 0;
        still_lib_close(s->lib);
        s->lib = NULL;
    }
    return list_none(list, count, wanted, 0);
}

int still_find(struct sst_still *s)
{
    const char *wanted = s->cfg.camera ? s->cfg.camera : "";
    struct sst_still_device *list;
    int count, found = -1, matches = 0, err = sst_still_list(&list, &count);

    if (err)
        return err;
    for (int i = 0; i < count; i++) {
        if (wanted[0] && strcmp(wanted, list[i].serial) != 0 && strcmp(wanted, list[i].port) != 0)
            continue;
        found = i;
        matches++;
    }
    if (matches == 1)
        err = open_device(s, &list[found]);
    else if (matches || !wanted[0])
        err = list_none(list, count, wanted, matches);
    else
        err = search_serial(s, list, count, wanted);
    free(list);
    return err;
}

/* --- again -------------------------------------------------------------------------------------------------------- */

/** The camera that was open: at its port, or by its serial at another one. */
static bool is_back(const struct sst_still *s, struct sst_still_device *out)
{
    struct sst_still_device *list;
    bool found = false;
    int count;

    if (sst_still_list(&list, &count))
        return false;
    for (int i = 0; i < count && !found; i++) {
        found = list[i].serial[0] ? !strcmp(list[i].serial, s->serial) : !strcmp(list[i].port, s->port);
        *out = list[i];
    }
    free(list);
    return found;
}

int still_reopen(struct sst_still *s)
{
    const int64_t end_ns = sst_clock_now_ns() + s->cfg.reopen_ms * (int64_t)1000000;
    char *before, said[SST_LOG_MAX] = "it is not plugged in";
    struct sst_still_device d;
    bool reset = false;
    int err = -ENODEV;

    if (s->lib)
        return 0;
    while (err && !still_cancelled(s)) {
        if (is_back(s, &d)) {
            before = sst_log_hold_errors(said);
            err = open_device(s, &d);
            if (err && err != -ENODEV && !reset) {
                reset = true;
                (void)!sst_usb_reset(d.port);
            }
            (void)sst_log_hold_errors(before);
        }
        if (!err || sst_clock_now_ns() > end_ns)
            break;
        still_sleep_ms(LOOK_MS);
    }
    if (still_cancelled(s))
        return -ECANCELED;
    if (err) {
        sst_log_error("still camera %s is not back within %d ms (%.300s); check its cable and switch it off and on",
                      name_of(s), s->cfg.reopen_ms, said);
        return -ENODEV;
    }
    s->count.reopened++;
    sst_log_info("still camera %s is back and open again", name_of(s));
    return 0;
}
