/* simulators/devices/ptp/ptp_model.c - sessions and transactions: command, data and response on the bulk endpoints. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/ptp/ptp_model.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "simulators/devices/ptp/ptp_internal.h"

#define PACKET        512
#define COLLECTED_MAX 4096 /* a value of a property; no files are received */
#define LOST_BYTES    256  /* fault "corrupt" 3 */

enum request {
    REQUEST_CANCEL = 0x64,
    REQUEST_RESET = 0x66,
    REQUEST_STATUS = 0x67,
};

/* --- faults ------------------------------------------------------------------------------------------------------- */

double ptp_fault(const struct sst_sim_ptp *p, enum sst_sim_ptp_fault fault)
{
    return p->cfg.fault(p->cfg.arg, fault);
}

double ptp_fault_take(struct sst_sim_ptp *p, enum sst_sim_ptp_fault fault)
{
    const double value = ptp_fault(p, fault);

    if (value > 0)
        p->cfg.spend(p->cfg.arg, fault);
    return value;
}

/* --- sending ------------------------------------------------------------------------------------------------------ */

static void start_container(struct ptp_bytes *b, enum ptp_container type, uint16_t code, uint32_t transaction)
{
    ptp_put(b, PTP_HEADER_BYTES, 4);
    ptp_put(b, type, 2);
    ptp_put(b, code, 2);
    ptp_put(b, transaction, 4);
}

static void set_length(struct ptp_bytes *b, size_t length)
{
    for (int i = 0; i < 4 && !b->failed; i++)
        b->data[i] = (uint8_t)(length >> 8 * i);
}

/** Takes the bytes. @return the phase, or NULL: no memory */
static struct ptp_phase *send_bytes(struct sst_sim_ptp *p, struct ptp_bytes *bytes)
{
    struct ptp_phase *phase = bytes->failed ? NULL : calloc(1, sizeof(*phase)), **link = &p->out;

    if (!phase) {
        ptp_free(bytes);
        return NULL;
    }
    phase->bytes = *bytes;
    while (*link)
        link = &(*link)->next;
    *link = phase;
    return phase;
}

static void drop_phase(struct sst_sim_ptp *p)
{
    struct ptp_phase *phase = p->out;

    p->out = phase->next;
    ptp_free(&phase->bytes);
    free(phase);
}

/** @param parameter  NULL: none */
static void respond(struct sst_sim_ptp *p, unsigned code, const uint32_t *parameter)
{
    struct ptp_bytes b = { .data = NULL };

    start_container(&b, PTP_RESPONSE, (uint16_t)code, p->command.transaction);
    if (parameter)
        ptp_put(&b, *parameter, 4);
    set_length(&b, b.size);
    (void)send_bytes(p, &b);
}

void ptp_event(struct sst_sim_ptp *p, uint16_t code, uint32_t parameter)
{
    struct ptp_bytes b = { .data = NULL };

    if (!p->open || p->events == PTP_EVENTS)
        return; /* nobody listens */
    start_container(&b, PTP_EVENT, code, PTP_ALL);
    ptp_put(&b, parameter, 4);
    set_length(&b, b.size);
    if (!b.failed)
        memcpy(p->event[p->events++], b.data, sizeof(p->event[0]));
    ptp_free(&b);
}

int sst_sim_ptp_event(struct sst_sim_ptp *p, uint8_t *out, size_t size)
{
    const size_t bytes = sizeof(p->event[0]);

    if (!p->events && ptp_fault(p, SST_SIM_PTP_REPEAT) > 0)
        for (int i = 0; i < p->card.files && !p->events; i++)
            if (!p->card.file[i].sent)
                ptp_event(p, PTP_EVENT_OBJECT_ADDED, p->card.file[i].handle);
    if (!p->events || size < bytes || p->silent)
        return -EAGAIN;
    memcpy(out, p->event[0], bytes);
    memmove(p->event[0], p->event[1], (size_t)--p->events * bytes);
    return (int)bytes;
}

int sst_sim_ptp_in(struct sst_sim_ptp *p, uint8_t *out, size_t size)
{
    struct ptp_phase *phase = p->out;
    size_t left, n;

    if (!phase || p->silent)
        return -EAGAIN;
    left = phase->bytes.size - phase->at;
    if (phase->object && phase->at > 0 && ptp_fault(p, SST_SIM_PTP_DOWNLOAD) > 0) {
        p->cfg.unplug(p->cfg.arg, (int)ptp_fault_take(p, SST_SIM_PTP_DOWNLOAD));
        p->silent = true; /* until it is plugged in again */
        return -EAGAIN;
    }
    n = left < size ? left : size;
    if (phase->object && phase->at == 0 && n == left && ptp_fault(p, SST_SIM_PTP_DOWNLOAD) > 0)
        n = n / 2; /* half of a small file */
    memcpy(out, phase->bytes.data + phase->at, n);
    phase->at += n;
    /* The host's buffer is full: if the last packet is full as well, an empty one follows. */
    if (phase->at == phase->bytes.size) {
        if (n == size && phase->bytes.size % PACKET == 0 && !phase->closing)
            phase->closing = true;
        else
            drop_phase(p);
    }
    return (int)n;
}

/* --- operations --------------------------------------------------------------------------------------------------- */

static const uint16_t operations[] = {
    PTP_GET_DEVICE_INFO, PTP_OPEN_SESSION,       PTP_CLOSE_SESSION,      PTP_GET_STORAGE_IDS, PTP_GET_STORAGE_INFO,
    PTP_GET_NUM_OBJECTS, PTP_GET_OBJECT_HANDLES, PTP_GET_OBJECT_INFO,    PTP_GET_OBJECT,      PTP_GET_THUMB,
    PTP_DELETE_OBJECT,   PTP_INITIATE_CAPTURE,   PTP_RESET_DEVICE,       PTP_GET_PROP_DESC,   PTP_GET_PROP_VALUE,
    PTP_SET_PROP_VALUE,  PTP_RESET_PROP_VALUE,   PTP_GET_PARTIAL_OBJECT,
};

static void put_device_info(const struct sst_sim_ptp *p, struct ptp_bytes *out)
{
    static const uint16_t events[] = { PTP_EVENT_OBJECT_ADDED, PTP_EVENT_OBJECT_REMOVED, PTP_EVENT_PROP_CHANGED,
                                       PTP_EVENT_STORE_FULL, PTP_EVENT_CAPTURE_COMPLETE };
    static const uint16_t formats[] = { PTP_FORMAT_JPEG, PTP_FORMAT_DNG };
    static const uint16_t images[] = { PTP_FORMAT_FOLDER, PTP_FORMAT_JPEG, PTP_FORMAT_DNG };

    ptp_put(out, 100, 2); /* version 1.00 of the standard, no vendor's extension */
    ptp_put(out, 0, 4);
    ptp_put(out, 0, 2);
    ptp_put_text(out, "");
    ptp_put(out, 0, 2); /* standard mode */
    ptp_put_codes(out, operations, ARRAY_LEN(operations));
    ptp_put_codes(out, events, ARRAY_LEN(events));
    ptp_put_codes(out, ptp_props_codes(), PTP_PROPERTIES);
    ptp_put_codes(out, formats, ARRAY_LEN(formats));
    ptp_put_codes(out, images, ARRAY_LEN(images));
    ptp_put_text(out, "sst");
    ptp_put_text(out, "SST Still Camera");
    ptp_put_text(out, "1.0");
    ptp_put_text(out, p->cfg.serial);
}

/** Data of GetObject and GetPartialObject. @param sent  out: bytes that the container announces */
static unsigned get_object(struct sst_sim_ptp *p, struct ptp_bytes *out, uint32_t *sent)
{
    const struct ptp_command *c = &p->command;
    struct ptp_file *f = ptp_card_find(&p->card, c->parameter[0]);
    size_t from = 0, bytes;

    if (!f)
        return PTP_INVALID_HANDLE;
    bytes = f->bytes;
    if (c->code == PTP_GET_PARTIAL_OBJECT) {
        from = c->parameter[1];
        if (from > f->bytes)
            return PTP_INVALID_PARAMETER;
        bytes = f->bytes - from < c->parameter[2] ? f->bytes - from : c->parameter[2];
    }
    *sent = (uint32_t)bytes;
    if (f->sent_short && bytes > LOST_BYTES) {
        bytes -= LOST_BYTES;
        f->sent_short = false;
    }
    f->sent = true;
    ptp_put_bytes(out, f->data + from, bytes);
    return PTP_OK;
}

/** @param data  data phase to send; empty: none. @param parameter  of the response; @return PTP response */
static unsigned execute(struct sst_sim_ptp *p, struct ptp_bytes *data, uint32_t *parameter, int64_t now_ns)
{
    const struct ptp_command *c = &p->command;
    const uint32_t *a = c->parameter;

    switch (c->code) {
    case PTP_GET_DEVICE_INFO:
        put_device_info(p, data);
        return PTP_OK;
    case PTP_OPEN_SESSION:
        if (!a[0])
            return PTP_INVALID_PARAMETER;
        if (p->open)
            return PTP_SESSION_ALREADY_OPEN;
        p->open = true;
        p->events = 0;
        return PTP_OK;
    case PTP_CLOSE_SESSION:
        p->open = false;
        return PTP_OK;
    case PTP_GET_STORAGE_IDS:
        ptp_put(data, 1, 4);
        ptp_put(data, PTP_STORAGE, 4);
        return PTP_OK;
    case PTP_GET_STORAGE_INFO:
        if (a[0] != PTP_STORAGE)
            return PTP_INVALID_STORAGE;
        ptp_card_storage(&p->card, ptp_fault(p, SST_SIM_PTP_CARD_FULL) > 0, data);
        return PTP_OK;
    case PTP_GET_NUM_OBJECTS:
        return ptp_card_list(&p->card, a[0], a[1], a[2], NULL, parameter);
    case PTP_GET_OBJECT_HANDLES:
        return ptp_card_list(&p->card, a[0], a[1], a[2], data, parameter);
    case PTP_GET_OBJECT_INFO:
        return ptp_card_info(&p->card, a[0], data);
    case PTP_GET_OBJECT:
    case PTP_GET_PARTIAL_OBJECT:
        return get_object(p, data, parameter);
    case PTP_GET_THUMB:
        return PTP_NO_THUMBNAIL;
    case PTP_DELETE_OBJECT:
        return ptp_card_delete(&p->card, a[0]);
    case PTP_INITIATE_CAPTURE:
        return a[0] && a[0] != PTP_STORAGE ? PTP_INVALID_STORAGE : ptp_shot_release(p, now_ns);
    case PTP_RESET_DEVICE:
    case PTP_RESET_PROP_VALUE:
        ptp_props_init(&p->props, &p->cfg);
        return PTP_OK;
    case PTP_GET_PROP_DESC:
        return ptp_props_describe(&p->props, (uint16_t)a[0], data);
    case PTP_GET_PROP_VALUE:
        return ptp_props_read(&p->props, (uint16_t)a[0], data);
    case PTP_SET_PROP_VALUE:
        if (ptp_fault_take(p, SST_SIM_PTP_REFUSE) > 0)
            return PTP_ACCESS_DENIED;
        return ptp_props_write(&p->props, (uint16_t)a[0], p->collected.data, p->collected.size);
    default:
        return PTP_OPERATION_NOT_SUPPORTED;
    }
}

/** The response has a parameter where the operation counts something. */
static bool counts(uint16_t code)
{
    return code == PTP_GET_NUM_OBJECTS || code == PTP_GET_PARTIAL_OBJECT;
}

static void transact(struct sst_sim_ptp *p, int64_t now_ns)
{
    const double battery = ptp_fault(p, SST_SIM_PTP_BATTERY);
    const uint16_t code = p->command.code;
    struct ptp_bytes data = { .data = NULL };
    uint32_t parameter = 0;
    unsigned response;

    ptp_props_set(&p->props, PTP_BATTERY_LEVEL, battery > 0 ? (uint32_t)battery : (uint32_t)p->cfg.battery_percent);
    if (ptp_fault(p, SST_SIM_PTP_DIAL) > 0)
        ptp_props_set(&p->props, PTP_EXPOSURE_TIME, (uint32_t)ptp_fault_take(p, SST_SIM_PTP_DIAL));
    start_container(&data, PTP_DATA, code, p->command.transaction);
    response = p->open || code == PTP_GET_DEVICE_INFO || code == PTP_OPEN_SESSION
                   ? execute(p, &data, &parameter, now_ns)
                   : PTP_SESSION_NOT_OPEN;
    if (data.failed)
        response = PTP_GENERAL_ERROR;
    if (response == PTP_OK && data.size > PTP_HEADER_BYTES) {
        const bool object = code == PTP_GET_OBJECT || code == PTP_GET_PARTIAL_OBJECT;
        struct ptp_phase *phase;

        set_length(&data, object ? PTP_HEADER_BYTES + parameter : data.size);
        phase = send_bytes(p, &data);
        if (phase)
            phase->object = object;
        else
            response = PTP_GENERAL_ERROR;
    } else {
        ptp_free(&data);
    }
    respond(p, response, response == PTP_OK && counts(code) ? &parameter : NULL);
    ptp_free(&p->collected);
}

/* --- receiving ---------------------------------------------------------------------------------------------------- */

static int take_command(struct sst_sim_ptp *p, const uint8_t *data, size_t bytes)
{
    struct ptp_command c = { .code = (uint16_t)ptp_get(data + 6, 2), .transaction = ptp_get(data + 8, 4) };

    if (bytes > PTP_HEADER_BYTES + 4 * PTP_PARAMETERS || (bytes - PTP_HEADER_BYTES) % 4)
        return -EPIPE;
    c.parameters = (int)((bytes - PTP_HEADER_BYTES) / 4);
    for (int i = 0; i < c.parameters; i++)
        c.parameter[i] = ptp_get(data + PTP_HEADER_BYTES + 4 * i, 4);
    p->command = c;
    return 0;
}

/** A data phase: values of properties, in one transfer. */
static int take_data(struct sst_sim_ptp *p, const uint8_t *data, size_t bytes)
{
    if (ptp_get(data + 6, 2) != p->command.code || bytes - PTP_HEADER_BYTES > COLLECTED_MAX)
        return -EPIPE;
    ptp_free(&p->collected);
    ptp_put_bytes(&p->collected, data + PTP_HEADER_BYTES, bytes - PTP_HEADER_BYTES);
    return p->collected.failed ? -EPIPE : 0;
}

int sst_sim_ptp_out(struct sst_sim_ptp *p, const uint8_t *data, size_t bytes, int64_t now_ns)
{
    const bool data_phase = p->collecting;

    p->collecting = false;
    if (!bytes)
        return 0; /* the end of a transfer of full packets */
    if (bytes < PTP_HEADER_BYTES || ptp_get(data, 4) != bytes ||
        ptp_get(data + 4, 2) != (data_phase ? PTP_DATA : PTP_COMMAND) ||
        (data_phase ? take_data(p, data, bytes) : take_command(p, data, bytes)))
        return -EPIPE;
    if (!data_phase)
        while (p->out)
            drop_phase(p); /* the host gave up the unread rest */
    if (!data_phase && ptp_fault(p, SST_SIM_PTP_SILENCE) > 0) {
        (void)ptp_fault_take(p, SST_SIM_PTP_SILENCE);
        p->silent = true;
    }
    p->collecting = !data_phase && p->command.code == PTP_SET_PROP_VALUE;
    if (!p->silent && !p->collecting)
        transact(p, now_ns);
    return 0;
}

void sst_sim_ptp_released(struct sst_sim_ptp *p)
{
    while (p->out)
        drop_phase(p);
    ptp_free(&p->collected);
    p->collecting = p->open = p->silent = false;
    p->events = 0;
}

int sst_sim_ptp_request(struct sst_sim_ptp *p, const uint8_t setup[8], uint8_t *data)
{
    const size_t room = (size_t)setup[6] | (size_t)setup[7] << 8;

    switch (setup[1]) {
    case REQUEST_STATUS:
        if (room < 4 || !(setup[0] & 0x80))
            return -EPIPE;
        memcpy(data, (const uint8_t[]){ 4, 0, PTP_OK & 0xff, PTP_OK >> 8 }, 4);
        return 4;
    case REQUEST_CANCEL:
        while (p->out)
            drop_phase(p);
        return (int)room;
    case REQUEST_RESET:
        sst_sim_ptp_released(p);
        return 0;
    default:
        return -EPIPE;
    }
}

/* --- create and destroy ------------------------------------------------------------------------------------------- */

int sst_sim_ptp_create(struct sst_sim_ptp **out, const struct sst_sim_ptp_config *cfg)
{
    struct sst_sim_ptp *p = calloc(1, sizeof(*p));

    if (!p)
        return -ENOMEM;
    p->cfg = *cfg;
    p->card = (struct ptp_card){
        .capacity = cfg->card_bytes, .width = cfg->width, .height = cfg->height, .next_handle = PTP_FIRST_PICTURE
    };
    ptp_props_init(&p->props, cfg);
    *out = p;
    return 0;
}

void sst_sim_ptp_destroy(struct sst_sim_ptp *p)
{
    if (!p)
        return;
    sst_sim_ptp_released(p);
    ptp_shot_fini(p);
    ptp_card_fini(&p->card);
    free(p);
}

int sst_sim_ptp_shots(const struct sst_sim_ptp *p)
{
    return p->shots;
}

int sst_sim_ptp_files(const struct sst_sim_ptp *p)
{
    return p->card.files;
}
