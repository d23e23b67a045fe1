/* simulators/devices/ptp/ptp_card.c - files on the camera's card: DCIM/100SST and the pictures in it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "simulators/devices/ptp/ptp_internal.h"

#define DATE "20260101T000000"

int64_t ptp_card_free(const struct ptp_card *card)
{
    int64_t used = 0;

    for (int i = 0; i < card->files; i++)
        used += (int64_t)card->file[i].bytes;
    return used < card->capacity && card->files < PTP_FILES_MAX ? card->capacity - used : 0;
}

struct ptp_file *ptp_card_find(const struct ptp_card *card, uint32_t handle)
{
    for (int i = 0; i < card->files; i++)
        if (card->file[i].handle == handle)
            return &card->file[i];
    return NULL;
}

struct ptp_file *ptp_card_add(struct ptp_card *card, int number, bool raw, uint8_t *data, size_t bytes)
{
    struct ptp_file *f;

    if (card->files == PTP_FILES_MAX || !sst_mem_grow(&card->file, card->files, &card->room, sizeof(*card->file))) {
        free(data);
        return NULL;
    }
    f = &card->file[card->files++];
    *f = (struct ptp_file){
        .handle = card->next_handle++, .format = raw ? PTP_FORMAT_DNG : PTP_FORMAT_JPEG, .data = data, .bytes = bytes
    };
    snprintf(f->name, sizeof(f->name), "SST_%04u.%s", (unsigned)number % 10000, raw ? "DNG" : "JPG");
    return f;
}

unsigned ptp_card_delete(struct ptp_card *card, uint32_t handle)
{
    int kept = 0;

    if (handle != PTP_ALL && !ptp_card_find(card, handle))
        return handle == PTP_DCIM || handle == PTP_FOLDER ? PTP_ACCESS_DENIED : PTP_INVALID_HANDLE;
    for (int i = 0; i < card->files; i++) {
        if (handle == PTP_ALL || card->file[i].handle == handle)
            free(card->file[i].data);
        else
            card->file[kept++] = card->file[i];
    }
    card->files = kept;
    return PTP_OK;
}

/** An ObjectInfo dataset. */
static void put_info(const struct ptp_card *card, uint16_t format, size_t bytes, uint32_t parent, const char *name,
                     struct ptp_bytes *out)
{
    const bool folder = format == PTP_FORMAT_FOLDER;

    ptp_put(out, PTP_STORAGE, 4);
    ptp_put(out, format, 2);
    ptp_put(out, 0, 2); /* not protected */
    ptp_put(out, bytes, 4);
    ptp_put(out, 0, 2); /* no thumbnail: format, bytes, width, height */
    ptp_put(out, 0, 4);
    ptp_put(out, 0, 4);
    ptp_put(out, 0, 4);
    ptp_put(out, folder ? 0 : (uint64_t)card->width, 4);
    ptp_put(out, folder ? 0 : (uint64_t)card->height, 4);
    ptp_put(out, folder ? 0 : 24, 4);
    ptp_put(out, parent, 4);
    ptp_put(out, folder, 2); /* a generic folder */
    ptp_put(out, 0, 4);
    ptp_put(out, 0, 4);
    ptp_put_text(out, name);
    ptp_put_text(out, DATE);
    ptp_put_text(out, DATE);
    ptp_put_text(out, "");
}

unsigned ptp_card_info(const struct ptp_card *card, uint32_t handle, struct ptp_bytes *out)
{
    const struct ptp_file *f = ptp_card_find(card, handle);

    if (f)
        put_info(card, f->format, f->bytes, PTP_FOLDER, f->name, out);
    else if (handle == PTP_DCIM)
        put_info(card, PTP_FORMAT_FOLDER, 0, 0, "DCIM", out);
    else if (handle == PTP_FOLDER)
        put_info(card, PTP_FORMAT_FOLDER, 0, PTP_DCIM, "100SST", out);
    else
        return PTP_INVALID_HANDLE;
    return PTP_OK;
}

/** Is an object in what was asked for? parent 0: anywhere, PTP_ALL: the root. */
static bool is_listed(uint16_t own_format, uint32_t own_parent, uint32_t format, uint32_t parent)
{
    return (!format || format == PTP_ALL || format == own_format) &&
           (!parent || own_parent == (parent == PTP_ALL ? 0 : parent));
}

unsigned ptp_card_list(const struct ptp_card *card, uint32_t storage, uint32_t format, uint32_t parent,
                       struct ptp_bytes *out, uint32_t *count)
{
    struct ptp_bytes handles = { .data = NULL };

    *count = 0;
    if (storage != PTP_STORAGE && storage != PTP_ALL)
        return PTP_INVALID_STORAGE;
    for (uint32_t folder = PTP_DCIM; folder <= PTP_FOLDER; folder++)
        if (is_listed(PTP_FORMAT_FOLDER, folder == PTP_DCIM ? 0 : PTP_DCIM, format, parent))
            ptp_put(&handles, folder, 4);
    for (int i = 0; i < card->files; i++)
        if (is_listed(card->file[i].format, PTP_FOLDER, format, parent))
            ptp_put(&handles, card->file[i].handle, 4);
    *count = (uint32_t)(handles.size / 4);
    if (out) {
        ptp_put(out, *count, 4);
        ptp_put_bytes(out, handles.data, handles.size);
        out->failed |= handles.failed;
    }
    ptp_free(&handles);
    return PTP_OK;
}

void ptp_card_storage(const struct ptp_card *card, bool full, struct ptp_bytes *out)
{
    const int64_t left = full ? 0 : ptp_card_free(card);
    const int64_t picture = (int64_t)card->width * card->height;

    ptp_put(out, 4, 2); /* removable, RAM */
    ptp_put(out, 3, 2); /* DCF */
    ptp_put(out, 0, 2); /* read and write */
    ptp_put(out, (uint64_t)card->capacity, 8);
    ptp_put(out, (uint64_t)left, 8);
    ptp_put(out, (uint64_t)(left / picture), 4);
    ptp_put_text(out, "card");
    ptp_put_text(out, "SST");
}

void ptp_card_fini(struct ptp_card *card)
{
    (void)ptp_card_delete(card, PTP_ALL);
    free(card->file);
}
