/* simulators/devices/gpio_front.c - front end of the GPIO model as /dev/gpiochipN. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/devices_internal.h"
#include "simulators/devices/sysfs_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>

#include "base/clock.h"
#include "base/log.h"
#include "simulators/devices/gpio/gpio_model.h"

#define CHIPS         2
#define TRIGGER_CHIP  1
#define TRIGGER_MAX   16
#define TRIGGER_LINES (TRIGGER_MAX + 8) /* LOOP0, spare lines and nameless ones after the triggers */
#define CHARDEV_MAJOR 254
#define PULSE_NS      1000 /* of a generator outside */
#define READERS       8    /* most threads waiting for one file's events */

struct chip {
    struct sim_gpio_front *front;
    int number;
    struct sim_node *node; /* NULL: vanished */
};

/** A program's open file: a chip, or requested lines. */
struct open_file {
    struct open_file *next;
    struct sim_gpio_front *front;
    struct sim_handle *handle;
    struct sst_sim_gpio_file *file;
    bool signalled; /* the socket holds a byte that signals events */
    struct sim_request *waiting[READERS];
    int readers;
};

struct sim_gpio_front {
    struct sim_gpio_front_config cfg;
    struct sst_sim_gpio *gpio;
    struct chip chip[CHIPS];
    struct open_file *files;
    struct sim_timer debounce;
};

static const struct sim_ops chip_ops, lines_ops;
static const char *const labels[CHIPS] = { "sst-board", "sst-trigger" };

/* --- reading ------------------------------------------------------------------------------------------------------ */

/** @return bytes or -errno; updates the byte in the socket */
static int read_now(struct open_file *f, struct sim_request *r)
{
    const size_t want = r->call.length < SST_SIM_PAYLOAD_MAX ? r->call.length : SST_SIM_PAYLOAD_MAX;
    const int n = sst_sim_gpio_read(f->file, r->data, want);

    r->out_bytes = n > 0 ? (uint32_t)n : 0;
    if (f->signalled && !sst_sim_gpio_readable(f->file)) {
        r->drain = 1;
        f->signalled = false;
    }
    return n;
}

/** Events arrived: waiting readers dequeue them; the rest is signalled to poll(). */
static void wake(void *arg SST_UNUSED, struct sst_sim_gpio_file *file)
{
    struct open_file *f = sst_sim_gpio_user(file);

    while (f && f->readers > 0 && sst_sim_gpio_readable(file)) {
        struct sim_request *r = f->waiting[0];

        memmove(f->waiting, f->waiting + 1, (size_t)--f->readers * sizeof(f->waiting[0]));
        sst_sim_answer(f->handle->server, r, read_now(f, r));
    }
    if (f && !f->signalled && sst_sim_gpio_readable(file))
        f->signalled = sim_handle_readable(f->handle, "", 1) == 0;
}

static int file_read(struct sim_handle *h, struct sim_request *r)
{
    struct open_file *f = h->state;
    const int n = read_now(f, r);

    if (n != -EAGAIN || (r->call.flags & SST_SIM_NONBLOCK))
        return n;
    if (f->readers == READERS)
        return -ENOMEM;
    f->waiting[f->readers++] = r;
    return SST_SIM_LATER;
}

static void file_cancel(struct sim_handle *h, struct sim_request *r)
{
    struct open_file *f = h->state;

    for (int i = 0; i < f->readers; i++)
        if (f->waiting[i] == r)
            f->waiting[i--] = f->waiting[--f->readers];
}

/* --- files -------------------------------------------------------------------------------------------------------- */

static void after_call(struct sim_gpio_front *front)
{
    const int64_t due = sst_sim_gpio_due(front->gpio);

    if (due == INT64_MAX)
        sim_timer_stop(front->cfg.sysfs->server, &front->debounce);
    else if (sim_timer_set(front->cfg.sysfs->server, &front->debounce, due) < 0)
        sst_log_warning("GPIO: debouncing is late: out of memory");
}

static void debounce_over(void *arg)
{
    struct sim_gpio_front *front = arg;

    sst_sim_gpio_tick(front->gpio, sst_clock_now_ns());
    after_call(front);
}

/** Attach a model's file to a program's handle. On failure the file is closed. */
static int attach(struct sim_gpio_front *front, struct sim_handle *h, struct sst_sim_gpio_file *file)
{
    struct open_file *f = calloc(1, sizeof(*f));

    if (!f) {
        sst_sim_gpio_close(file, sst_clock_now_ns());
        return -ENOMEM;
    }
    *f = (struct open_file){ .front = front, .handle = h, .file = file, .next = front->files };
    front->files = f;
    h->state = f;
    sst_sim_gpio_set_user(file, f);
    return 0;
}

static int chip_open(struct sim_handle *h, struct sim_request *r SST_UNUSED)
{
    struct chip *chip = h->device;
    struct sst_sim_gpio_file *file;
    const int err = sst_sim_gpio_open(chip->front->gpio, chip->number, &file);

    return err ? err : attach(chip->front, h, file);
}

static void file_close(struct sim_handle *h)
{
    struct open_file *f = h->state;

    if (!f)
        return; /* its lines were never requested */
    SST_LIST_REMOVE(f->front->files, f);
    sst_sim_gpio_set_user(f->file, NULL);
    sst_sim_gpio_close(f->file, sst_clock_now_ns());
    after_call(f->front);
    free(f);
}

static int answer_file(struct open_file *chip, struct sst_sim_gpio_file *file, struct sim_request *r)
{
    struct sim_handle *h;
    int fd, err = sim_handle_create(chip->handle->server, &lines_ops, NULL, &h, &fd);

    if (err) {
        sst_sim_gpio_close(file, sst_clock_now_ns());
        return err;
    }
    r->out_fd = fd;
    r->out_fd_close = true;
    err = attach(chip->front, h, file);
    if (err)
        sim_handle_drop(h);
    return err;
}

static int file_ioctl(struct sim_handle *h, struct sim_request *r)
{
    struct open_file *f = h->state;
    struct sst_sim_gpio_file *opened;
    int result;

    if (r->bytes < _IOC_SIZE(r->call.cmd))
        return -EINVAL;
    result = sst_sim_gpio_ioctl(f->file, r->call.cmd, r->data, &opened, sst_clock_now_ns());
    if (result == 0 && opened)
        result = answer_file(f, opened, r);
    if (result == 0)
        r->out_bytes = _IOC_SIZE(r->call.cmd);
    after_call(f->front);
    return result;
}

static const struct sim_ops chip_ops = {
    .letter = 'g', .open = chip_open, .close = file_close, .ioctl = file_ioctl, .read = file_read, .cancel = file_cancel
};
static const struct sim_ops lines_ops = {
    .letter = 'g', .close = file_close, .ioctl = file_ioctl, .read = file_read, .cancel = file_cancel
};

/* --- trigger ------------------------------------------------------------------------------------------------------ */

static void pin(void *arg, int chip, int line, bool level, int64_t t_ns)
{
    struct sim_gpio_front *front = arg;

    if (chip == TRIGGER_CHIP && line < front->cfg.lines && level)
        front->cfg.edge(front->cfg.arg, line, t_ns);
}

void sim_gpio_front_pulse(struct sim_gpio_front *front, int64_t t_ns)
{
    for (int high = 1; high >= 0; high--) {
        for (int i = 0; i < front->cfg.lines; i++)
            sst_sim_gpio_drive(front->gpio, TRIGGER_CHIP, i, high, t_ns + (high ? 0 : PULSE_NS));
    }
    after_call(front);
}

/* --- chips in /dev and /sys --------------------------------------------------------------------------------------- */

static void show_in_sysfs(struct chip *chip, bool present)
{
    struct sim_sysfs *fs = chip->front->cfg.sysfs;
    struct sim_props props = { .bytes = 0 }, udev = { .bytes = 0 };
    char dir[128], name[32], number[32], id[32];

    snprintf(dir, sizeof(dir), "/sys/devices/pci0000:00/0000:00:1f.0/gpiochip%d", chip->number);
    snprintf(name, sizeof(name), "gpiochip%d", chip->number);
    snprintf(number, sizeof(number), "%d:%d", CHARDEV_MAJOR, chip->number);
    snprintf(id, sizeof(id), "c%d:%d", CHARDEV_MAJOR, chip->number);
    sim_props_add(&props, "MAJOR=%d\nMINOR=%d\nDEVNAME=%s", CHARDEV_MAJOR, chip->number, name);
    if (present) {
        sim_sysfs_attr(fs, dir, "dev", "%s", number);
        sim_sysfs_bytes(fs, dir, "uevent", props.text, props.bytes);
        sim_sysfs_link(fs, dir, "subsystem", "/sys/bus/gpio");
        sim_sysfs_link(fs, "/sys/bus/gpio/devices", name, dir);
        sim_sysfs_link(fs, "/sys/dev/char", number, dir);
    } else {
        sim_sysfs_remove(fs, "/sys/bus/gpio/devices", name);
        sim_sysfs_remove(fs, "/sys/dev/char", number);
        sim_sysfs_remove(fs, dir, "");
    }
    sim_props_add(&props, "SUBSYSTEM=gpio");
    sim_uevent(fs, present ? "add" : "remove", dir + strlen("/sys"), &props, id, &udev);
}

static int appear(struct chip *chip)
{
    char path[64];
    int err;

    snprintf(path, sizeof(path), "/dev/gpiochip%d", chip->number);
    err = sim_node_add(chip->front->cfg.sysfs->server, &chip->node, path,
                       &(struct sim_device){ &chip_ops, chip, CHARDEV_MAJOR, (unsigned)chip->number });
    if (!err)
        show_in_sysfs(chip, true);
    return err;
}

/** The chip is gone: hang up the programs' files. */
static void hang_up(struct chip *chip)
{
    sim_node_remove(chip->front->cfg.sysfs->server, chip->node);
    chip->node = NULL;
    show_in_sysfs(chip, false);
    for (struct open_file *f = chip->front->files, *next; f; f = next) {
        next = f->next;

        if (sst_sim_gpio_gone(f->file))
            sim_handle_drop(f->handle);
    }
}

/* --- faults: all of the trigger chip ------------------------------------------------------------------------------ */

static const struct sim_fault faults[SST_SIM_GPIO_FAULTS] = {
    [SST_SIM_GPIO_BUSY] = { "busy", 0, 1, "1: another driver holds the named lines of sst-trigger (EBUSY)" },
    [SST_SIM_GPIO_DENIED] = { "denied", 0, 2, "opening sst-trigger gives 1: EACCES, 2: EPERM" },
    [SST_SIM_GPIO_VANISH] = { "vanish", 0, 1, "1: sst-trigger is gone (ENODEV), 0: it is back" },
    [SST_SIM_GPIO_STUCK] = { "stuck", 0, 1, "1: outputs of sst-trigger take values, their pins do not follow" },
    [SST_SIM_GPIO_TWIN] = { "twin", 0, 3,
                            "1: sst-board is labelled sst-trigger, 2: and its lines have the names of the other's, 3: "
                            "and "
                            "line 1 has the name of line 0" },
    [SST_SIM_GPIO_LOST_EDGES] = { "lost_edges", 0, 1, "probability that an edge event of an input is lost" },
};

const struct sim_fault_scope sim_gpio_faults = { .name = "gpio", .faults = faults, .count = SST_SIM_GPIO_FAULTS };

static int fault_changed(void *arg, int instance SST_UNUSED, int fault, double value)
{
    struct sim_gpio_front *front = arg;
    struct chip *chip = &front->chip[TRIGGER_CHIP];
    int err = sst_sim_gpio_fault(front->gpio, TRIGGER_CHIP, (enum sst_sim_gpio_fault)fault, value, sst_clock_now_ns());

    if (!err && fault == SST_SIM_GPIO_VANISH) {
        if (value != 0 && chip->node)
            hang_up(chip);
        else if (value == 0 && !chip->node)
            err = appear(chip);
    }
    after_call(front);
    return err;
}

/* --- open and close ----------------------------------------------------------------------------------------------- */

static int create_model(struct sim_gpio_front *front)
{
    static const char *const board[] = { "PWR_LED", "FAN", NULL, "DOOR", NULL, NULL, NULL, NULL };
    char triggers[TRIGGER_MAX][SST_SIM_GPIO_NAME];
    const char *names[TRIGGER_LINES] = { NULL };
    const int n = front->cfg.lines;
    const struct sst_sim_gpio_wire wire = { TRIGGER_CHIP, 0, TRIGGER_CHIP, n };
    const struct sst_sim_gpio_chip chip[CHIPS] = { { "gpiochip0", labels[0], (int)ARRAY_LEN(board), board },
                                                   { "gpiochip1", labels[1], n + 8, names } };
    struct timespec real;

    (void)clock_gettime(CLOCK_REALTIME, &real);
    for (int i = 0; i < n; i++) {
        snprintf(triggers[i], sizeof(triggers[i]), "TRIG%d", i);
        names[i] = triggers[i];
    }
    names[n] = "LOOP0";
    names[n + 1] = "STROBE";
    names[n + 2] = "AUX0";
    names[n + 3] = "AUX1";
    return sst_sim_gpio_create(&front->gpio,
                               &(struct sst_sim_gpio_config){
                                   .chips = CHIPS,
                                   .wires = 1,
                                   .chip = chip,
                                   .wire = &wire,
                                   .realtime_ns = real.tv_sec * 1000000000LL + real.tv_nsec - sst_clock_now_ns(),
                                   .seed = front->cfg.seed,
                                   .hooks = { .arg = front, .pin = pin, .wake = wake },
                               });
}

int sim_gpio_front_open(struct sim_gpio_front **out, const struct sim_gpio_front_config *cfg)
{
    struct sim_gpio_front *front;
    int err;

    if (cfg->lines < 1 || cfg->lines > TRIGGER_MAX) {
        sst_log_error("GPIO: %d trigger lines; 1 to %d are possible", cfg->lines, TRIGGER_MAX);
        return -EINVAL;
    }
    front = calloc(1, sizeof(*front));
    if (!front)
        return -ENOMEM;
    front->cfg = *cfg;
    front->debounce = (struct sim_timer){ .fire = debounce_over, .arg = front };
    err = create_model(front);
    for (int i = 0; !err && i < CHIPS; i++) {
        front->chip[i] = (struct chip){ .front = front, .number = i };
        err = appear(&front->chip[i]);
    }
    if (!err) {
        struct sim_fault_scope scope = sim_gpio_faults;

        scope.changed = fault_changed;
        scope.arg = front;
        err = sst_min_int(sim_faults_add(cfg->faults, &scope), 0);
    }
    if (err) {
        sst_log_error("GPIO: cannot create the simulated chips: %s", strerror(-err));
        sim_gpio_front_close(front);
        return err;
    }
    *out = front;
    return 0;
}

void sim_gpio_front_close(struct sim_gpio_front *front)
{
    if (!front)
        return;
    for (int i = 0; i < CHIPS; i++)
        if (front->chip[i].node)
            sim_node_remove(front->cfg.sysfs->server, front->chip[i].node);
    while (front->files)
        sim_handle_drop(front->files->handle);
    sim_timer_stop(front->cfg.sysfs->server, &front->debounce);
    sst_sim_gpio_destroy(front->gpio);
    free(front);
}
