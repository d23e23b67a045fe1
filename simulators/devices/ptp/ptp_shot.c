/* simulators/devices/ptp/ptp_shot.c - an exposure: release, mirror, exposure, files on the card, events. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "simulators/devices/ptp/ptp_internal.h"

#define MS            1000000LL
#define MIRROR_NS     (30000 * MS) /* a mirror that was lifted falls after this */
#define CUT_SHARE     2            /* fault "corrupt": half of the file is missing */
#define DAMAGED_BYTES 64

static bool wants(const struct sst_sim_ptp *p, enum ptp_files files)
{
    return ptp_props_value(&p->props, PTP_COMPRESSION) & files;
}

/** Bytes that the files of an exposure may need: the card is full before. */
static int64_t most_bytes(const struct sst_sim_ptp *p)
{
    const int64_t pixels = (int64_t)p->cfg.width * p->cfg.height;

    return (wants(p, PTP_FILES_JPEG) ? pixels : 0) + (wants(p, PTP_FILES_RAW) ? pixels + 4096 : 0);
}

static void start(struct sst_sim_ptp *p, int64_t now_ns)
{
    p->mirror_until_ns = 0;
    p->expose_ns = now_ns + p->cfg.lag_ms * MS;
}

unsigned ptp_shot_release(struct sst_sim_ptp *p, int64_t now_ns)
{
    const double busy_ms = ptp_fault_take(p, SST_SIM_PTP_BUSY);

    if (busy_ms > 0)
        p->busy_until_ns = now_ns + (int64_t)(busy_ms * MS);
    if (now_ns < p->busy_until_ns || p->expose_ns || p->taken_count >= (p->cfg.buffer ? PTP_BUFFER : 1))
        return PTP_DEVICE_BUSY;
    if (ptp_fault(p, SST_SIM_PTP_CARD_FULL) > 0 || ptp_card_free(&p->card) < most_bytes(p))
        return PTP_STORE_FULL;
    if (p->cfg.mirror_lockup && now_ns >= p->mirror_until_ns) {
        p->mirror_until_ns = now_ns + MIRROR_NS;
        return PTP_OK;
    }
    start(p, now_ns);
    return PTP_OK;
}

void sst_sim_ptp_press(struct sst_sim_ptp *p, int64_t now_ns)
{
    if (!p->expose_ns && p->taken_count < PTP_BUFFER)
        start(p, now_ns);
}

static void expose_file(struct sst_sim_ptp *p, const struct sst_sim_ptp_exposure *e, bool raw, struct ptp_taken *t)
{
    uint8_t *data;
    size_t bytes;

    if (p->cfg.expose(p->cfg.arg, e, raw, &data, &bytes))
        return;
    t->file[t->files].data = data;
    t->file[t->files].bytes = bytes;
    t->file[t->files++].raw = raw;
}

static void expose(struct sst_sim_ptp *p)
{
    const double f = ptp_props_value(&p->props, PTP_F_NUMBER) / 800.0;
    const struct sst_sim_ptp_exposure e = {
        .shot = ++p->shots,
        .t_ns = p->expose_ns,
        .time_s = ptp_props_value(&p->props, PTP_EXPOSURE_TIME) * 1e-4,
        .gain = ptp_props_value(&p->props, PTP_EXPOSURE_INDEX) / 100.0 / (f * f),
    };
    const int64_t written_ns = p->taken_count ? p->taken[p->taken_count - 1].due_ns : 0;
    const int64_t end_ns = p->expose_ns + (int64_t)(e.time_s * 1e9);
    struct ptp_taken *t = &p->taken[p->taken_count++];

    *t = (struct ptp_taken){ .shot = e.shot,
                             .due_ns = (written_ns > end_ns ? written_ns : end_ns) + p->cfg.write_ms * MS };
    if (wants(p, PTP_FILES_RAW))
        expose_file(p, &e, true, t);
    if (wants(p, PTP_FILES_JPEG))
        expose_file(p, &e, false, t);
    p->expose_ns = 0;
}

/** Fault "corrupt": of the file on the card, or of sending it. */
static void damage(struct ptp_file *f, int kind)
{
    if (kind == 1)
        f->bytes -= f->bytes / CUT_SHARE;
    else if (kind == 2)
        memset(f->data + f->bytes / 2, 0xff, f->bytes / 2 < DAMAGED_BYTES ? f->bytes / 2 : DAMAGED_BYTES);
    f->sent_short = kind == 3;
}

/** Now or, with fault "late_event", later. */
static void announce(struct sst_sim_ptp *p, uint16_t code, uint32_t parameter, int64_t due_ns)
{
    if (!due_ns || p->late_count == PTP_LATE) {
        ptp_event(p, code, parameter);
        return;
    }
    p->late[p->late_count].due_ns = due_ns;
    p->late[p->late_count].code = code;
    p->late[p->late_count++].parameter = parameter;
}

static void write_files(struct sst_sim_ptp *p)
{
    const struct ptp_taken t = p->taken[0];
    const int corrupt = t.files ? (int)ptp_fault_take(p, SST_SIM_PTP_CORRUPT) : 0;
    const bool mute = t.files && ptp_fault_take(p, SST_SIM_PTP_NO_EVENT) > 0;
    const double late_ms = t.files ? ptp_fault_take(p, SST_SIM_PTP_LATE_EVENT) : 0;
    const int64_t due_ns = late_ms > 0 ? t.due_ns + (int64_t)(late_ms * MS) : 0;

    for (int i = 0; i < t.files; i++) {
        struct ptp_file *f = ptp_card_add(&p->card, t.shot, t.file[i].raw, t.file[i].data, t.file[i].bytes);

        if (!f) {
            ptp_event(p, PTP_EVENT_STORE_FULL, PTP_STORAGE);
            continue;
        }
        damage(f, corrupt);
        p->cfg.stored(p->cfg.arg, t.shot, f->name, f->data, f->bytes);
        if (!mute)
            announce(p, PTP_EVENT_OBJECT_ADDED, f->handle, due_ns);
    }
    if (!mute)
        announce(p, PTP_EVENT_CAPTURE_COMPLETE, 0, due_ns);
    memmove(&p->taken[0], &p->taken[1], (size_t)--p->taken_count * sizeof(p->taken[0]));
}

int64_t sst_sim_ptp_due_ns(const struct sst_sim_ptp *p)
{
    int64_t due_ns = p->expose_ns ? p->expose_ns : INT64_MAX;

    if (p->taken_count && p->taken[0].due_ns < due_ns)
        due_ns = p->taken[0].due_ns;
    for (int i = 0; i < p->late_count; i++)
        if (p->late[i].due_ns < due_ns)
            due_ns = p->late[i].due_ns;
    return due_ns;
}

void sst_sim_ptp_tick(struct sst_sim_ptp *p, int64_t now_ns)
{
    int kept = 0;

    if (p->expose_ns && now_ns >= p->expose_ns)
        expose(p);
    while (p->taken_count && now_ns >= p->taken[0].due_ns)
        write_files(p);
    for (int i = 0; i < p->late_count; i++) {
        if (now_ns >= p->late[i].due_ns)
            ptp_event(p, p->late[i].code, p->late[i].parameter);
        else
            p->late[kept++] = p->late[i];
    }
    p->late_count = kept;
}

void ptp_shot_fini(struct sst_sim_ptp *p)
{
    for (int k = 0; k < p->taken_count; k++)
        for (int i = 0; i < p->taken[k].files; i++)
            free(p->taken[k].file[i].data);
    p->taken_count = 0;
}
