#define _GNU_SOURCE /* versionsort */
#include "drivers/trigger/trigger_internal.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <grp.h>
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

int gpio_list(struct gpio_listed **out)
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

/* @return the offset of a line name, or of digits if no line has that name; -ENODEV or the error of reading a line */
static int offset_of(struct trigger_chip *chip, const char *name)
{
    const int lines = gpio_chip_lines(chip);
    char *end;
    long number;

    for (int i = 0; i < lines; i++) {
        struct trigger_line line;
        const int err = gpio_chip_line(chip, (unsigned)i, &line);

        if (err)
            return err;
        if (!strcmp(line.name, name))
            return i;
    }
    number = strtol(name, &end, 10);
    return isdigit((unsigned char)*name) && !*end && number < lines ? (int)number : -ENODEV;
}

/* @return 0, or an error with the name of the line that caused it */
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
        request->output[i] = (unsigned)offset;
    }
    if (wanted->loopback[0]) {
        request->loopback = offset_of(chip, *missing = wanted->loopback);
        if (request->loopback < 0)
            return request->loopback;
    }
    return 0;
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

void gpio_access_remedy(const char *path, char *text, size_t size)
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

/* Explain why no chip matches. */
static int explain(const struct gpio_listed *list, int n, const struct gpio_wanted *wanted, char *why, size_t size)
{
    char remedy[256];

    for (int i = 0; i < n; i++) {
        if (list[i].error != EACCES && list[i].error != EPERM)
            continue;
        gpio_access_remedy(list[i].path, remedy, sizeof(remedy));
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
        snprintf(why, size, "no GPIO chip is labelled \"%s\"; available: ", wanted->chip);
    else
        snprintf(why, size, "no GPIO chip has line \"%s\" and all other configured lines; available: ",
                 wanted->outputs ? wanted->output[0] : wanted->loopback);
    list_chips(list, n, why, size);
    return -ENODEV;
}

/* Check one chip. @return 1 (it matches), 0 (it does not), or an error with `why` */
static int consider(struct gpio_listed *listed, struct trigger_chip **chip, struct gpio_request *request,
                    const struct gpio_wanted *wanted, char *why, size_t size)
{
    const char *missing = "";
    int err;

    if (listed->error || (wanted->chip[0] && strcmp(listed->label, wanted->chip)))
        return 0;
    err = gpio_chip_open(chip, listed->path);
    if (!err) {
        err = resolve(*chip, request, wanted, &missing);
        if (!err)
            return 1;
    } else {
        *chip = NULL;
    }
    if (err == -ENODEV && *chip && !wanted->chip[0]) {
        err = 0;
    } else if (err == -ENODEV && *chip) {
        snprintf(why, size, "chip %s \"%s\" has no line \"%s\"; its lines are ", listed->path, listed->label, missing);
        list_lines(*chip, why, size);
    } else {
        snprintf(why, size, "reading chip %s: %s", listed->path, strerror(-err));
    }
    gpio_chip_close(*chip);
    return err;
}

int gpio_find(struct trigger_chip **out, struct gpio_request *request, const struct gpio_wanted *wanted, char *why,
              size_t size)
{
    struct gpio_request other;
    struct trigger_chip *found = NULL, *chip;
    struct gpio_listed *list = NULL;
    int first = -1, err = 0, n = gpio_list(&list);

    if (n < 0) {
        snprintf(why, size,
                 n == -ENOSYS ? "this build has no libgpiod: build with libgpiod-dev, or set trigger source "
                                "software or free-run"
                              : "out of memory");
        return n;
    }
    for (int i = 0; i < n && !err; i++) {
        const int r = consider(&list[i], &chip, found ? &other : request, wanted, why, size);

        if (r == 1 && found) {
            snprintf(
                why, size,
                "both %s and %s have the configured lines: set the label of one as trigger chip, or unplug the other",
                list[first].path, list[i].path);
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
        err = explain(list, n, wanted, why, size);
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
    int err = gpio_find(&chip, &request, wanted, why, size);

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
    int err = gpio_find(&chip, &request, wanted, why, size);

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
