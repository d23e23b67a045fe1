/* simulators/devices/gpio/gpio_model.c - lines, wires, edges and open files. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/gpio/gpio_model.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "simulators/devices/gpio/gpio_internal.h"

#define DRIVER       "leds-gpio" /* consumer of the lines under the fault "busy" */
#define WATCH_EVENTS 32          /* the kernel's queue of line-info events */

static double random_unit(struct sst_sim_gpio *gpio)
{
    /* xorshift64*: the same seed must lose the same edges. */
    gpio->random ^= gpio->random >> 12;
    gpio->random ^= gpio->random << 25;
    gpio->random ^= gpio->random >> 27;
    return (double)((gpio->random * 0x2545f4914f6cdd1dULL) >> 11) * 0x1p-53;
}

/* --- events ------------------------------------------------------------------------------------------------------- */

/** Queue a record. A full queue of v2 events drops its oldest, all others drop the new one, as the kernel's do. */
static void push(struct sst_sim_gpio_file *file, const void *record)
{
    if (file->count == file->capacity) {
        if (file->kind != GPIO_FILE_LINES)
            return;
        file->head = (file->head + 1) % file->capacity;
        file->count--;
    }
    memcpy(file->ring + (file->head + file->count) % file->capacity * file->record, record, file->record);
    file->count++;
    if (file->gpio->hooks.wake)
        file->gpio->hooks.wake(file->gpio->hooks.arg, file);
}

static bool pin(const struct sst_sim_gpio *gpio, const struct gpio_line *line)
{
    return gpio->level[line->net];
}

bool gpio_line_value(const struct sst_sim_gpio *gpio, const struct gpio_line *line)
{
    return pin(gpio, line) != ((line->flags & GPIO_V2_LINE_FLAG_ACTIVE_LOW) != 0);
}

static void queue_edge(struct sst_sim_gpio *gpio, struct gpio_chip *chip, struct gpio_line *line, int64_t t_ns)
{
    struct sst_sim_gpio_file *file = line->owner;
    const bool rising = gpio_line_value(gpio, line);
    struct gpio_v2_line_event event = {
        .timestamp_ns = (uint64_t)t_ns,
        .id = rising ? GPIO_V2_LINE_EVENT_RISING_EDGE : GPIO_V2_LINE_EVENT_FALLING_EDGE,
        .offset = (uint32_t)(line - chip->line),
    };

    if (!(line->flags & (rising ? GPIO_V2_LINE_FLAG_EDGE_RISING : GPIO_V2_LINE_FLAG_EDGE_FALLING)))
        return;
    if (chip->fault[SST_SIM_GPIO_LOST_EDGES] > 0 && random_unit(gpio) < chip->fault[SST_SIM_GPIO_LOST_EDGES])
        return;
    if (line->flags & GPIO_V2_LINE_FLAG_EVENT_CLOCK_REALTIME)
        event.timestamp_ns += (uint64_t)gpio->realtime_ns;
    event.line_seqno = ++line->line_seqno;
    event.seqno = ++file->seqno;
    push(file, &event);
}

/** Start or restart edge detection from the current level. */
static void arm(struct sst_sim_gpio *gpio, struct gpio_line *line)
{
    line->seen = pin(gpio, line);
    line->settle_ns = INT64_MAX;
}

static void accept_level(struct sst_sim_gpio *gpio, struct gpio_chip *chip, struct gpio_line *line, int64_t t_ns)
{
    line->settle_ns = INT64_MAX;
    if (line->seen == pin(gpio, line))
        return;
    line->seen = pin(gpio, line);
    if (line->owner && (line->flags & GPIO_EDGES))
        queue_edge(gpio, chip, line, t_ns);
}

/** A pin changed: accepted at once without debouncing, else when it has been stable for the debounce time. */
static void pin_changed(struct sst_sim_gpio *gpio, int c, struct gpio_line *line, int64_t now_ns)
{
    struct gpio_chip *chip = &gpio->chip[c];

    if (line->debounce_us > 0)
        line->settle_ns = now_ns + (int64_t)line->debounce_us * 1000;
    else
        accept_level(gpio, chip, line, now_ns);
    if (gpio->hooks.pin)
        gpio->hooks.pin(gpio->hooks.arg, c, (int)(line - chip->line), pin(gpio, line), now_ns);
}

int64_t sst_sim_gpio_due(const struct sst_sim_gpio *gpio)
{
    int64_t due = INT64_MAX;

    for (int c = 0; c < gpio->chips; c++)
        for (int i = 0; i < gpio->chip[c].lines; i++)
            if (gpio->chip[c].line[i].settle_ns < due)
                due = gpio->chip[c].line[i].settle_ns;
    return due;
}

void sst_sim_gpio_tick(struct sst_sim_gpio *gpio, int64_t now_ns)
{
    for (int c = 0; c < gpio->chips; c++) {
        for (int i = 0; i < gpio->chip[c].lines; i++) {
            struct gpio_line *line = &gpio->chip[c].line[i];

            /* The kernel stamps a debounced edge at the end of the debounce time, not at its beginning. */
            if (line->settle_ns <= now_ns)
                accept_level(gpio, &gpio->chip[c], line, line->settle_ns);
        }
    }
}

/* --- wires -------------------------------------------------------------------------------------------------------- */

/** How a line drives its wire: 0, 1, or -1: not at all. */
static int drives(const struct gpio_line *line)
{
    if (!(line->flags & GPIO_V2_LINE_FLAG_OUTPUT))
        return -1;
    if (line->drive ? (line->flags & GPIO_V2_LINE_FLAG_OPEN_DRAIN) : (line->flags & GPIO_V2_LINE_FLAG_OPEN_SOURCE))
        return -1;
    return line->drive;
}

/** Level of every net from its drivers (low wins), then its pull-ups; low if undriven. */
static void net_levels(const struct sst_sim_gpio *gpio, uint8_t *strong, uint8_t *pulled)
{
    memset(strong, 2, (size_t)gpio->nets);
    memset(pulled, 0, (size_t)gpio->nets);
    for (int c = 0; c < gpio->chips; c++) {
        const struct gpio_chip *chip = &gpio->chip[c];

        for (int i = 0; i < chip->lines; i++) {
            const struct gpio_line *line = &chip->line[i];
            const int drive = drives(line);

            if (drive >= 0 && strong[line->net] != 0)
                strong[line->net] = (uint8_t)drive;
            if (line->outside && strong[line->net] != 0)
                strong[line->net] = 1;
            if (line->flags & GPIO_V2_LINE_FLAG_BIAS_PULL_UP)
                pulled[line->net] = 1;
        }
    }
}

/** A stuck output does not change its wire. */
static bool net_stuck(const struct sst_sim_gpio *gpio, int net)
{
    for (int c = 0; c < gpio->chips; c++) {
        if (gpio->chip[c].fault[SST_SIM_GPIO_STUCK] == 0)
            continue;
        for (int i = 0; i < gpio->chip[c].lines; i++)
            if (gpio->chip[c].line[i].net == net)
                return true;
    }
    return false;
}

void gpio_settle(struct sst_sim_gpio *gpio, int64_t now_ns)
{
    uint8_t *strong = gpio->scratch, *pulled = strong + gpio->nets, *changed = pulled + gpio->nets;

    net_levels(gpio, strong, pulled);
    for (int n = 0; n < gpio->nets; n++) {
        const bool level = strong[n] == 2 ? pulled[n] : strong[n];

        changed[n] = level != gpio->level[n] && !net_stuck(gpio, n);
        if (changed[n])
            gpio->level[n] = level;
    }
    for (int c = 0; c < gpio->chips; c++)
        for (int i = 0; i < gpio->chip[c].lines; i++)
            if (changed[gpio->chip[c].line[i].net])
                pin_changed(gpio, c, &gpio->chip[c].line[i], now_ns);
}

void sst_sim_gpio_drive(struct sst_sim_gpio *gpio, int chip, int line, bool high, int64_t now_ns)
{
    gpio->chip[chip].line[line].outside = high;
    gpio_settle(gpio, now_ns);
}

/* --- line info ---------------------------------------------------------------------------------------------------- */

/** The fault "busy" simulates a driver that has requested all named lines. */
static bool held_by_driver(const struct sst_sim_gpio *gpio, int chip, uint32_t offset)
{
    return gpio->chip[chip].fault[SST_SIM_GPIO_BUSY] != 0 && gpio->chip[chip].line[offset].name[0] != '\0';
}

static bool line_busy(const struct sst_sim_gpio *gpio, int chip, uint32_t offset)
{
    return gpio->chip[chip].line[offset].owner || held_by_driver(gpio, chip, offset);
}

/** The chip with fault "twin", which others resemble; NULL: none. */
static const struct gpio_chip *twin(const struct sst_sim_gpio *gpio)
{
    for (int i = 0; i < gpio->chips; i++)
        if (gpio->chip[i].fault[SST_SIM_GPIO_TWIN] > 0)
            return &gpio->chip[i];
    return NULL;
}

const char *gpio_shown_label(const struct sst_sim_gpio *gpio, int chip)
{
    const struct gpio_chip *as = twin(gpio);

    return as ? as->label : gpio->chip[chip].label;
}

/** With fault "twin" 2 that of the same line of the other chip; 3: line 1 has the name of line 0 as well. */
static const char *line_name(const struct sst_sim_gpio *gpio, int chip, uint32_t offset)
{
    const struct gpio_chip *as = twin(gpio);

    if (!as || as->fault[SST_SIM_GPIO_TWIN] < 2 || offset >= (uint32_t)as->lines)
        return gpio->chip[chip].line[offset].name;
    return as->line[as->fault[SST_SIM_GPIO_TWIN] > 2 && offset == 1 ? 0 : offset].name;
}

void gpio_line_info(const struct sst_sim_gpio *gpio, int chip, uint32_t offset, struct gpio_v2_line_info *out)
{
    const struct gpio_line *line = &gpio->chip[chip].line[offset];

    memset(out, 0, sizeof(*out));
    out->offset = offset;
    out->flags = line->flags;
    if (!(line->flags & GPIO_V2_LINE_FLAG_OUTPUT))
        out->flags |= GPIO_V2_LINE_FLAG_INPUT;
    memcpy(out->name, line_name(gpio, chip, offset), sizeof(out->name));
    if (line_busy(gpio, chip, offset)) {
        out->flags |= GPIO_V2_LINE_FLAG_USED;
        strcpy(out->consumer, line->owner ? line->consumer : DRIVER);
    }
    if (line->debounce_us > 0) {
        out->num_attrs = 1;
        out->attrs[0].id = GPIO_V2_LINE_ATTR_ID_DEBOUNCE;
        out->attrs[0].debounce_period_us = line->debounce_us;
    }
}

/** Notify the chip's watchers that a line was requested, released or configured. */
static void notify_watchers(struct sst_sim_gpio *gpio, int chip, uint32_t offset, uint32_t what, int64_t now_ns)
{
    struct gpio_v2_line_info_changed changed = { .timestamp_ns = (uint64_t)now_ns, .event_type = what };

    gpio_line_info(gpio, chip, offset, &changed.info);
    for (struct sst_sim_gpio_file *f = gpio->files; f; f = f->next)
        if (f->kind == GPIO_FILE_CHIP && f->chip == chip && !f->gone && f->watched[offset])
            push(f, &changed);
}

/* --- requesting, setting and releasing lines ---------------------------------------------------------------------- */

struct gpio_line *gpio_file_line(const struct sst_sim_gpio_file *file, int i)
{
    return &file->gpio->chip[file->chip].line[file->offset[i]];
}

int gpio_request_lines(struct sst_sim_gpio_file *file, const uint32_t *offsets, int lines, const char *consumer)
{
    struct gpio_chip *chip = &file->gpio->chip[file->chip];

    for (int i = 0; i < lines; i++) {
        int err = 0;

        if (offsets[i] >= (uint32_t)chip->lines)
            err = -EINVAL;
        else if (line_busy(file->gpio, file->chip, offsets[i]))
            err = -EBUSY;
        if (err) {
            for (int k = 0; k < i; k++)
                chip->line[offsets[k]].owner = NULL;
            return err;
        }
        chip->line[offsets[i]].owner = file;
    }
    for (int i = 0; i < lines; i++) {
        struct gpio_line *line = &chip->line[offsets[i]];

        file->offset[i] = offsets[i];
        memset(line->consumer, 0, sizeof(line->consumer));
        /* Users without a name are shown as "?". */
        memcpy(line->consumer, consumer[0] ? consumer : "?",
               strnlen(consumer[0] ? consumer : "?", sizeof(line->consumer) - 1));
        line->line_seqno = 0;
    }
    file->lines = lines;
    return 0;
}

void gpio_apply(struct sst_sim_gpio_file *file, const struct gpio_want *want, uint32_t what, int64_t now_ns)
{
    struct sst_sim_gpio *gpio = file->gpio;

    for (int i = 0; i < file->lines; i++) {
        struct gpio_line *line = gpio_file_line(file, i);
        const uint64_t direction = GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_OUTPUT;

        /* No direction requested: the line stays as it is. */
        line->flags = want[i].flags | (want[i].flags & direction ? 0 : line->flags & direction);
        line->debounce_us = want[i].debounce_us;
        if (want[i].flags & GPIO_V2_LINE_FLAG_OUTPUT)
            line->drive = want[i].value != ((line->flags & GPIO_V2_LINE_FLAG_ACTIVE_LOW) != 0);
        arm(gpio, line);
    }
    gpio_settle(gpio, now_ns);
    for (int i = 0; i < file->lines; i++)
        notify_watchers(gpio, file->chip, file->offset[i], what, now_ns);
}

static void release_lines(struct sst_sim_gpio_file *file, int count, int64_t now_ns)
{
    for (int i = 0; i < count; i++) {
        struct gpio_line *line = gpio_file_line(file, i);

        /* The direction stays, the pin returns to its idle level, as with a chip without memory. */
        line->owner = NULL;
        line->flags &= GPIO_V2_LINE_FLAG_OUTPUT;
        line->debounce_us = 0;
        line->drive = false;
        line->settle_ns = INT64_MAX;
    }
    gpio_settle(file->gpio, now_ns);
    for (int i = 0; i < count; i++)
        notify_watchers(file->gpio, file->chip, file->offset[i], GPIO_V2_LINE_CHANGED_RELEASED, now_ns);
}

/* --- files -------------------------------------------------------------------------------------------------------- */

int gpio_file_create(struct sst_sim_gpio_file **out, struct sst_sim_gpio *gpio, int chip, enum gpio_file_kind kind,
                     unsigned capacity)
{
    struct sst_sim_gpio_file *file = calloc(1, sizeof(*file));
    const bool is_chip = kind == GPIO_FILE_CHIP;

    if (!file)
        return -ENOMEM;
    file->record = is_chip ? sizeof(struct gpio_v2_line_info_changed) : sizeof(struct gpio_v2_line_event);
    file->capacity = capacity;
    file->ring = calloc(capacity, file->record);
    file->watched = is_chip ? calloc((size_t)gpio->chip[chip].lines, 1) : NULL;
    if (!file->ring || (is_chip && !file->watched)) {
        free(file->ring);
        free(file->watched);
        free(file);
        return -ENOMEM;
    }
    file->gpio = gpio;
    file->chip = chip;
    file->kind = kind;
    file->next = gpio->files;
    gpio->files = file;
    *out = file;
    return 0;
}

int sst_sim_gpio_open(struct sst_sim_gpio *gpio, int chip, struct sst_sim_gpio_file **out)
{
    if (chip < 0 || chip >= gpio->chips || gpio->chip[chip].fault[SST_SIM_GPIO_VANISH] != 0)
        return -ENODEV;
    if (gpio->chip[chip].fault[SST_SIM_GPIO_DENIED] != 0)
        return gpio->chip[chip].fault[SST_SIM_GPIO_DENIED] == 1 ? -EACCES : -EPERM;
    return gpio_file_create(out, gpio, chip, GPIO_FILE_CHIP, WATCH_EVENTS);
}

void sst_sim_gpio_close(struct sst_sim_gpio_file *file, int64_t now_ns)
{
    if (!file)
        return;
    if (file->kind != GPIO_FILE_CHIP && !file->gone)
        release_lines(file, file->lines, now_ns);
    SST_LIST_REMOVE(file->gpio->files, file);
    free(file->watched);
    free(file->ring);
    free(file);
}

bool sst_sim_gpio_readable(const struct sst_sim_gpio_file *file)
{
    return file->count > 0;
}

bool sst_sim_gpio_gone(const struct sst_sim_gpio_file *file)
{
    return file->gone;
}

void sst_sim_gpio_set_user(struct sst_sim_gpio_file *file, void *user)
{
    file->user = user;
}

void *sst_sim_gpio_user(const struct sst_sim_gpio_file *file)
{
    return file->user;
}

/** Dequeue the oldest record in the format of this file's uAPI version. */
static size_t pop(struct sst_sim_gpio_file *file, void *out)
{
    const uint8_t *record = file->ring + file->head * file->record;
    size_t bytes = file->record;

    if (file->kind == GPIO_FILE_EVENT) {
        const struct gpio_v2_line_event *event = (const void *)record;
        const struct gpioevent_data old = { .timestamp = event->timestamp_ns, .id = event->id };

        bytes = sizeof(old);
        memcpy(out, &old, bytes);
    } else if (file->kind == GPIO_FILE_CHIP && file->watch_abi == 1) {
        const struct gpio_v2_line_info_changed *changed = (const void *)record;
        struct gpioline_info_changed old = { .timestamp = changed->timestamp_ns, .event_type = changed->event_type };

        gpio_info_to_v1(&changed->info, &old.info);
        bytes = sizeof(old);
        memcpy(out, &old, bytes);
    } else {
        memcpy(out, record, bytes);
    }
    file->head = (file->head + 1) % file->capacity;
    file->count--;
    return bytes;
}

int sst_sim_gpio_read(struct sst_sim_gpio_file *file, void *out, size_t size)
{
    size_t done = 0, one = file->record;

    if (file->gone)
        return -ENODEV;
    if (file->kind == GPIO_FILE_HANDLE)
        return -EINVAL;
    if (file->kind == GPIO_FILE_EVENT)
        one = sizeof(struct gpioevent_data);
    else if (file->kind == GPIO_FILE_CHIP && file->watch_abi == 1)
        one = sizeof(struct gpioline_info_changed);
    if (size < one)
        return -EINVAL;
    while (file->count > 0 && size - done >= one)
        done += pop(file, (uint8_t *)out + done);
    return done > 0 ? (int)done : -EAGAIN;
}

/* --- create and destroy ------------------------------------------------------------------------------------------- */

int sst_sim_gpio_line(const struct sst_sim_gpio *gpio, int chip, const char *name)
{
    for (int i = 0; chip >= 0 && chip < gpio->chips && i < gpio->chip[chip].lines; i++)
        if (strcmp(gpio->chip[chip].line[i].name, name) == 0)
            return i;
    return -1;
}

/** Remove the chip: its outputs are released, its files are notified, its requests end. */
static void vanish(struct sst_sim_gpio *gpio, int chip, int64_t now_ns)
{
    for (struct sst_sim_gpio_file *f = gpio->files; f; f = f->next) {
        if (f->chip != chip || f->gone)
            continue;
        if (f->kind != GPIO_FILE_CHIP)
            release_lines(f, f->lines, now_ns);
        f->gone = true;
        if (gpio->hooks.wake)
            gpio->hooks.wake(gpio->hooks.arg, f);
    }
    for (int i = 0; i < gpio->chip[chip].lines; i++)
        gpio->chip[chip].line[i].flags = 0;
    gpio_settle(gpio, now_ns);
}

int sst_sim_gpio_fault(struct sst_sim_gpio *gpio, int chip, enum sst_sim_gpio_fault fault, double value, int64_t now_ns)
{
    static const double highest[SST_SIM_GPIO_FAULTS] = { 1, 2, 1, 1, 1, 3 };

    if (chip < 0 || chip >= gpio->chips || !(value >= 0 && value <= highest[fault]))
        return -EINVAL;
    if (fault != SST_SIM_GPIO_LOST_EDGES && value != (double)(int)value)
        return -EINVAL;
    if (fault == SST_SIM_GPIO_VANISH && value != 0 && gpio->chip[chip].fault[fault] == 0)
        vanish(gpio, chip, now_ns);
    gpio->chip[chip].fault[fault] = value;
    gpio_settle(gpio, now_ns);
    return 0;
}

static int copy_chip(struct gpio_chip *chip, const struct sst_sim_gpio_chip *from, int *nets)
{
    if (from->lines < 1 || from->lines > 512 || strlen(from->name) >= SST_SIM_GPIO_NAME ||
        strlen(from->label) >= SST_SIM_GPIO_NAME)
        return -EINVAL;
    chip->line = calloc((size_t)from->lines, sizeof(*chip->line));
    if (!chip->line)
        return -ENOMEM;
    strcpy(chip->name, from->name);
    strcpy(chip->label, from->label);
    chip->lines = from->lines;
    for (int i = 0; i < from->lines; i++) {
        chip->line[i].net = (*nets)++;
        chip->line[i].settle_ns = INT64_MAX;
        if (from->names[i])
            strncpy(chip->line[i].name, from->names[i], SST_SIM_GPIO_NAME - 1);
    }
    return 0;
}

static int wire(struct sst_sim_gpio *gpio, const struct sst_sim_gpio_wire *w)
{
    if (w->chip_a < 0 || w->chip_a >= gpio->chips || w->chip_b < 0 || w->chip_b >= gpio->chips)
        return -EINVAL;
    if (w->line_a < 0 || w->line_a >= gpio->chip[w->chip_a].lines || w->line_b < 0 ||
        w->line_b >= gpio->chip[w->chip_b].lines)
        return -EINVAL;
    const int keep = gpio->chip[w->chip_a].line[w->line_a].net, join = gpio->chip[w->chip_b].line[w->line_b].net;

    for (int c = 0; c < gpio->chips; c++)
        for (int i = 0; i < gpio->chip[c].lines; i++)
            if (gpio->chip[c].line[i].net == join)
                gpio->chip[c].line[i].net = keep;
    return 0;
}

int sst_sim_gpio_create(struct sst_sim_gpio **out, const struct sst_sim_gpio_config *cfg)
{
    struct sst_sim_gpio *gpio;
    int err = 0;

    if (cfg->chips < 1 || cfg->chips > SST_SIM_GPIO_CHIPS)
        return -EINVAL;
    gpio = calloc(1, sizeof(*gpio));
    if (!gpio)
        return -ENOMEM;
    gpio->hooks = cfg->hooks;
    gpio->realtime_ns = cfg->realtime_ns;
    gpio->random = cfg->seed * 2 + 1;
    for (; !err && gpio->chips < cfg->chips; gpio->chips++)
        err = copy_chip(&gpio->chip[gpio->chips], &cfg->chip[gpio->chips], &gpio->nets);
    for (int i = 0; !err && i < cfg->wires; i++)
        err = wire(gpio, &cfg->wire[i]);
    gpio->level = calloc((size_t)gpio->nets + 1, sizeof(*gpio->level));
    gpio->scratch = calloc(3, (size_t)gpio->nets + 1);
    if (!err && (!gpio->level || !gpio->scratch))
        err = -ENOMEM;
    if (err)
        sst_sim_gpio_destroy(gpio);
    else
        *out = gpio;
    return err;
}

void sst_sim_gpio_destroy(struct sst_sim_gpio *gpio)
{
    if (!gpio)
        return;
    gpio->hooks = (struct sst_sim_gpio_hooks){ 0 };
    while (gpio->files)
        sst_sim_gpio_close(gpio->files, 0);
    for (int c = 0; c < gpio->chips; c++)
        free(gpio->chip[c].line);
    free(gpio->scratch);
    free(gpio->level);
    free(gpio);
}
