/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* versionsort */
#include "drivers/trigger/trigger_internal.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <grp.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/text.h"

/* Links beside the nodes (old names of a chip) are skipped. */
static int is_chip(const struct dirent *e)
{
    return !strncmp(e->d_name, "gpiochip", 8) && isdigit((unsigned char)e->d_name[8]) && e->d_type != DT_LNK &&
           strlen(e->d_name) <= 32;
}

/* The nodes in /dev, by their numbers: GPIO chips do not depend on udev. */
static int scan(struct gpio_listed **out)
{
    struct dirent **entry = NULL;
    const int n = scandir("/dev", &entry, is_chip, versionsort);
    struct gpio_listed *list = n > 0 ? calloc((size_t)n, sizeof(*list)) : NULL;

    for (int i = 0; i < n; i++) {
        if (list)
            snprintf(list[i].path, sizeof(list[i].path), "/dev/%.32s", entry[i]->d_name);
        free(entry[i]);
    }
    free(entry);
    *out = list;
    return n > 0 && !list ? -ENOMEM : sst_max_int(n, 0);
}

/* All GPIO chips by number. *out to free with free(). @return count, or -ENOMEM. Logs nothing. */
static int find_chips(struct gpio_listed **out)
{
    struct gpio_listed *list;
    const int n = WITH_GPIOD ? scan(&list) : -ENOSYS;

    for (int i = 0; i < n; i++) {
        struct trigger_chip *chip;
        const int err = gpio_chip_open(&chip, list[i].path);

        list[i].error = -err;
        if (err)
            continue;
        snprintf(list[i].label, sizeof(list[i].label), "%s", gpio_chip_label(chip));
        list[i].lines = gpio_chip_lines(chip);
        gpio_chip_close(chip);
    }
    if (n >= 0)
        *out = list;
    return n;
}

/* @return the offset of a line name, or of digits if no line has that name; -ENODEV, -ENOTUNIQ (several lines have it)
 * or the error of reading a line */
static int offset_of(struct trigger_chip *chip, const char *name)
{
    const int lines = gpio_chip_lines(chip);
    int found = -1;
    char *end;
    long number;

    for (int i = 0; i < lines; i++) {
        struct trigger_line line;
        const int err = gpio_chip_line(chip, (unsigned)i, &line);

        if (err)
            return err;
        if (!strcmp(line.name, name) && found >= 0)
            return -ENOTUNIQ;
        if (!strcmp(line.name, name))
            found = i;
    }
    if (found >= 0)
        return found;
    number = strtol(name, &end, 10);
    return isdigit((unsigned char)*name) && !*end && number < lines ? (int)number : -ENODEV;
}

static bool is_taken(const struct gpio_request *request, int outputs, int offset)
{
    for (int i = 0; i < outputs; i++)
        if ((int)request->output[i] == offset)
            return true;
    return false;
}

/* @return 0, or an error with the name of the line that caused it; -EEXIST: another name has its offset */
static int resolve(struct trigger_chip *chip, struct gpio_request *request, const struct gpio_wanted *wanted,
                   const char **missing)
{
    request->outputs = wanted->outputs;
    request->active_low = wanted->active_low;
    request->loopback = -1;
    for (int i = 0; i < wanted->outputs; i++) {
        const int offset = offset_of(chip, *missing = wanted->output[i]);

        if (offset < 0)
            return offset;
        if (is_taken(request, i, offset))
            return -EEXIST;
        request->output[i] = (unsigned)offset;
    }
    if (wanted->loopback[0]) {
        request->loopback = offset_of(chip, *missing = wanted->loopback);
        if (request->loopback < 0)
            return request->loopback;
    }
    return is_taken(request, request->outputs, request->loopback) ? -EEXIST : 0;
}

static void list_lines(struct trigger_chip *chip, char *text, size_t size)
{
    const int lines = gpio_chip_lines(chip);
    const char *comma = "";
    struct trigger_line line;

    for (int i = 0; i < lines && strlen(text) + 80 < size; i++) {
        if (gpio_chip_line(chip, (unsigned)i, &line) || !line.name[0])
            continue;
        sst_text_add(text, size, "%s%s", comma, line.name);
        comma = ", ";
    }
    sst_text_add(text, size, *comma ? "" : "without names: give offsets 0..%d", lines - 1);
}

static void list_chips(const struct gpio_listed *list, int n, char *text, size_t size)
{
    for (int i = 0; i < n; i++) {
        if (list[i].error)
            sst_text_add(text, size, "%s%s (%s)", i ? ", " : "", list[i].path, strerror(list[i].error));
        else
            sst_text_add(text, size, "%s%s \"%s\"", i ? ", " : "", list[i].path, list[i].label);
    }
}

/* How to get the permission to open a GPIO chip, from the owner and mode of `path`. */
static void access_remedy(const char *path, char *text, size_t size)
{
    struct stat st;
    const struct group *group = stat(path, &st) ? NULL : getgrgid(st.st_gid);

    if (group && st.st_gid && (st.st_mode & 0060) == 0060)
        snprintf(text, size, "it belongs to group %s: add the user to it (adduser USER %s) and log in again",
                 group->gr_name, group->gr_name);
    else
        snprintf(text, size,
                 "only root may open it: install systemd/60-sst.rules, which gives GPIO chips to group gpio, "
                 "and add the user to that group");
}

/* The device of a chip in sysfs; its last part is the chip, with a number that changes. @return false: unknown */
static bool device_of(const char *path, char device[PATH_MAX])
{
    char link[SST_GPIO_NAME_MAX + 32];

    snprintf(link, sizeof(link), "/sys/bus/gpio/devices/%s", strrchr(path, '/') + 1);
    return realpath(link, device);
}

/* Is the chip given by its label, its path in /dev, or its device in sysfs: a path, or the name of one of its parts? */
static bool is_wanted(const struct gpio_listed *listed, const char *wanted)
{
    char path[PATH_MAX], device[PATH_MAX], part[SST_GPIO_CHIP_MAX + 2];
    size_t n;

    if (!wanted[0] || !strcmp(listed->label, wanted))
        return true;
    if (wanted[0] != '/') {
        snprintf(part, sizeof(part), "/%s/", wanted);
        if (!device_of(listed->path, device))
            return false;
        n = strlen(device);
        return strstr(device, part) || (n >= strlen(wanted) && !strcmp(device + n - strlen(wanted), wanted) &&
                                        device[n - strlen(wanted) - 1] == '/');
    }
    if (!realpath(wanted, path))
        return false;
    if (!strcmp(path, listed->path))
        return true;
    n = strlen(path);
    return device_of(listed->path, device) && !strncmp(device, path, n) && (device[n] == '/' || !device[n]);
}

/* Explain why no chip matches. */
static int explain(const struct gpio_listed *list, int n, const struct gpio_wanted *wanted, char *why, size_t size)
{
    char remedy[256];

    for (int i = 0; i < n; i++) {
        if (list[i].error != EACCES && list[i].error != EPERM)
            continue;
        access_remedy(list[i].path, remedy, sizeof(remedy));
        snprintf(why, size, "no permission to open %s: %s", list[i].path, remedy);
        return -EACCES;
    }
    if (!n) {
        snprintf(why, size,
                 "this machine has no GPIO chip (/dev/gpiochip*): connect it or load its driver, or set "
                 "trigger source software or free-run");
        return -ENODEV;
    }
    if (wanted->chip[0])
        snprintf(why, size, "no GPIO chip has the label, path or device \"%s\"; available: ", wanted->chip);
    else
        snprintf(why, size, "no GPIO chip has line \"%s\" and all other configured lines; available: ",
                 wanted->outputs ? wanted->output[0] : wanted->loopback);
    list_chips(list, n, why, size);
    return -ENODEV;
}

/* Explain why a chip that was named does not do. */
static void refuse(struct trigger_chip *chip, const struct gpio_listed *listed, const char *line, int err, char *why,
                   size_t size)
{
    if (err == -ENOTUNIQ) {
        sst_text_add(why, size, "%schip %s \"%s\" has several lines \"%s\": give the offset of one, in digits",
                     why[0] ? "; " : "", listed->path, listed->label, line);
        return;
    }
    if (err == -EEXIST) {
        sst_text_add(why, size, "%sline \"%s\" of chip %s \"%s\" is given twice, by its name and its offset",
                     why[0] ? "; " : "", line, listed->path, listed->label);
        return;
    }
    sst_text_add(why, size, "%schip %s \"%s\" has no line \"%s\"; its lines are ", why[0] ? "; " : "", listed->path,
                 listed->label, line);
    list_lines(chip, why, size);
}

/* Check one chip. @return 1 (it has the lines), 0 (it does not: if it was named, `why` is added to), or an error with
 * `why` */
static int consider(struct gpio_listed *listed, struct trigger_chip **out, struct gpio_request *request,
                    const struct gpio_wanted *wanted, char *why, size_t size)
{
    struct trigger_chip *chip = NULL;
    const char *missing = "";
    int err;

    if (listed->error || !is_wanted(listed, wanted->chip))
        return 0;
    err = gpio_chip_open(&chip, listed->path);
    if (!err)
        err = resolve(chip, request, wanted, &missing);
    if (!err) {
        *out = chip;
        return 1;
    }
    if (chip && (err == -ENOTUNIQ || err == -EEXIST || (err == -ENODEV && wanted->chip[0])))
        refuse(chip, listed, missing, err, why, size);
    if (chip && (err == -ENOTUNIQ || err == -EEXIST || err == -ENODEV))
        err = 0;
    else
        snprintf(why, size, "reading chip %s: %s", listed->path, strerror(-err));
    gpio_chip_close(chip);
    return err;
}

/* Name both chips, and their devices where these differ. */
static void say_both(const struct gpio_listed *a, const struct gpio_listed *b, char *why, size_t size)
{
    char first[PATH_MAX], second[PATH_MAX];
    bool known = device_of(a->path, first) && device_of(b->path, second);

    if (known) { /* without the part for the chip: its number changes */
        *strrchr(first, '/') = 0;
        *strrchr(second, '/') = 0;
        known = strcmp(first, second) != 0;
    }
    snprintf(why, size, "both %s and %s have the configured lines: set one of these paths as trigger chip", a->path,
             b->path);
    if (known)
        sst_text_add(why, size, ", or its device, which stays the same after a restart: %s or %s", first, second);
}

/* Find the one chip that is wanted, and its lines; nothing is requested. @return as gpio_open() */
static int find_wanted(struct trigger_chip **out, struct gpio_request *request, const struct gpio_wanted *wanted,
                       char *why, size_t size)
{
    struct gpio_request other;
    struct trigger_chip *found = NULL, *chip = NULL;
    struct gpio_listed *list = NULL;
    int first = -1, err = 0, n = find_chips(&list);

    if (n < 0) {
        snprintf(why, size,
                 n == -ENOSYS ? "this build has no libgpiod: build with libgpiod-dev, or set trigger source "
                                "software or free-run"
                              : "out of memory");
        return n;
    }
    why[0] = 0;
    for (int i = 0; i < n && !err; i++) {
        const int r = consider(&list[i], &chip, found ? &other : request, wanted, why, size);

        if (r == 1 && found) {
            say_both(&list[first], &list[i], why, size);
            gpio_chip_close(chip);
            err = -ENOTUNIQ;
        } else if (r == 1) {
            found = chip;
            first = i;
        } else {
            err = r;
        }
    }
    if (!err && !found)
        err = why[0] ? -ENODEV : explain(list, n, wanted, why, size);
    if (err)
        gpio_chip_close(found);
    else
        *out = found;
    free(list);
    return err;
}

/* Find the line in use, and its consumer. @return -EBUSY, or 0 if none seems to be */
static int name_holder(struct trigger_chip *chip, const struct gpio_request *r, char *why, size_t size)
{
    struct trigger_line line;

    for (int i = 0; i <= r->outputs; i++) {
        const int offset = i < r->outputs ? (int)r->output[i] : r->loopback;

        if (offset < 0 || gpio_chip_line(chip, (unsigned)offset, &line) || !line.used)
            continue;
        snprintf(why, size,
                 "line %s (offset %d) of chip \"%s\" is in use by \"%s\": end that program, or choose another "
                 "line",
                 line.name[0] ? line.name : "without a name", offset, gpio_chip_label(chip),
                 line.consumer[0] ? line.consumer : "the kernel");
        return -EBUSY;
    }
    return 0;
}

int gpio_probe(const struct gpio_wanted *wanted, char *why, size_t size)
{
    struct gpio_request request;
    struct trigger_chip *chip;
    int err = find_wanted(&chip, &request, wanted, why, size);

    if (err)
        return err;
    err = name_holder(chip, &request, why, size);
    if (!err)
        snprintf(why, size, "chip \"%s\" has all %d lines, and they are free", gpio_chip_label(chip),
                 request.outputs + (request.loopback >= 0));
    gpio_chip_close(chip);
    return err;
}

int gpio_open(struct trigger_chip **out, const struct gpio_wanted *wanted, char *why, size_t size)
{
    struct trigger_chip *chip;
    struct gpio_request request;
    int err = find_wanted(&chip, &request, wanted, why, size);

    if (err)
        return err;
    err = gpio_chip_request(chip, &request);
    if (!err) {
        *out = chip;
        return 0;
    }
    if (err == -EBUSY) {
        if (!name_holder(chip, &request, why, size))
            snprintf(why, size, "a line of chip \"%s\" was in use a moment ago: try again", gpio_chip_label(chip));
    } else if (err == -EPERM || err == -EACCES) {
        snprintf(why, size,
                 "no permission to request the lines of chip \"%s\": they are reserved or the system denies it (%s)",
                 gpio_chip_label(chip), strerror(-err));
    } else {
        snprintf(why, size, "requesting the lines of chip \"%s\": %s%s", gpio_chip_label(chip), strerror(-err),
                 request.loopback >= 0 ? "; the loop-back line must be able to report edges (interrupts)" : "");
    }
    gpio_chip_close(chip);
    return err == -EPERM ? -EACCES : err;
}
