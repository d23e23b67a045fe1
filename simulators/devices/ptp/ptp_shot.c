/* simulators/devices/ptp/ptp_shot.c - an exposure: release, mirror, exposure, files on the card, events. */
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

unsigned ptp_shot_release(struct sst_sim_ptp *p, int64_t now_ns)
{
    const double busy_ms = ptp_fault_take(p, SST_SIM_PTP_BUSY);

    if (busy_ms > 0)
        p->busy_until_ns = now_ns + (int64_t)(busy_ms * MS);
    if (now_ns < p->busy_until_ns || p->state != PTP_READY)
        return PTP_DEVICE_BUSY;
    if (ptp_fault(p, SST_SIM_PTP_CARD_FULL) > 0 || ptp_card_free(&p->card) < most_bytes(p))
        return PTP_STORE_FULL;
    if (p->cfg.mirror_lockup && now_ns >= p->mirror_until_ns) {
        p->mirror_until_ns = now_ns + MIRROR_NS;
        return PTP_OK;
    }
    p->mirror_until_ns = 0;
    p->state = PTP_RELEASED;
    p->due_ns = now_ns + p->cfg.lag_ms * MS;
    return PTP_OK;
}

static void expose_file(struct sst_sim_ptp *p, const struct sst_sim_ptp_exposure *e, bool raw)
{
    uint8_t *data;
    size_t bytes;

    if (p->cfg.expose(p->cfg.arg, e, raw, &data, &bytes))
        return;
    p->taken[p->taken_count].data = data;
    p->taken[p->taken_count].bytes = bytes;
    p->taken[p->taken_count++].raw = raw;
}

static void expose(struct sst_sim_ptp *p)
{
    const double f = ptp_props_value(&p->props, PTP_F_NUMBER) / 800.0;
    const struct sst_sim_ptp_exposure e = {
        .shot = ++p->shots,
        .t_ns = p->due_ns,
        .time_s = ptp_props_value(&p->props, PTP_EXPOSURE_TIME) * 1e-4,
        .gain = ptp_props_value(&p->props, PTP_EXPOSURE_INDEX) / 100.0 / (f * f),
    };

    p->taken_count = 0;
    if (wants(p, PTP_FILES_RAW))
        expose_file(p, &e, true);
    if (wants(p, PTP_FILES_JPEG))
        expose_file(p, &e, false);
    p->state = PTP_WRITING;
    p->due_ns += (int64_t)(e.time_s * 1e9) + p->cfg.write_ms * MS;
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

static void write_files(struct sst_sim_ptp *p)
{
    const int corrupt = p->taken_count ? (int)ptp_fault_take(p, SST_SIM_PTP_CORRUPT) : 0;
    const bool mute = p->taken_count && ptp_fault_take(p, SST_SIM_PTP_NO_EVENT) > 0;

    for (int i = 0; i < p->taken_count; i++) {
        struct ptp_file *f = ptp_card_add(&p->card, p->shots, p->taken[i].raw, p->taken[i].data, p->taken[i].bytes);

        if (!f) {
            ptp_event(p, PTP_EVENT_STORE_FULL, PTP_STORAGE);
            continue;
        }
        damage(f, corrupt);
        p->cfg.stored(p->cfg.arg, p->shots, f->name, f->data, f->bytes);
        if (!mute)
            ptp_event(p, PTP_EVENT_OBJECT_ADDED, f->handle);
    }
    p->taken_count = 0;
    if (!mute)
        ptp_event(p, PTP_EVENT_CAPTURE_COMPLETE, 0);
    p->state = PTP_READY;
}

int64_t sst_sim_ptp_due_ns(const struct sst_sim_ptp *p)
{
    return p->state == PTP_READY ? INT64_MAX : p->due_ns;
}

void sst_sim_ptp_tick(struct sst_sim_ptp *p, int64_t now_ns)
{
    if (p->state == PTP_RELEASED && now_ns >= p->due_ns)
        expose(p);
    if (p->state == PTP_WRITING && now_ns >= p->due_ns)
        write_files(p);
}

void ptp_shot_fini(struct sst_sim_ptp *p)
{
    for (int i = 0; i < p->taken_count; i++)
        free(p->taken[i].data);
    p->taken_count = 0;
}
