/* Fuzz target: the simulated still camera's side of PTP. The first byte chooses a fault; transfers follow. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "simulators/devices/ptp/ptp_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define MS 1000000LL

static int expose(void *arg SST_UNUSED, const struct sst_sim_ptp_exposure *e SST_UNUSED, bool raw SST_UNUSED,
                  uint8_t **data, size_t *bytes)
{
    *bytes = 500;
    *data = calloc(*bytes, 1);
    return *data ? 0 : -ENOMEM;
}

static void stored(void *arg SST_UNUSED, int shot SST_UNUSED, const char *name SST_UNUSED,
                   const uint8_t *data SST_UNUSED, size_t bytes SST_UNUSED)
{
}

static double fault(void *arg, enum sst_sim_ptp_fault which)
{
    return *(const int *)arg == (int)which + 1;
}

static void spend(void *arg, enum sst_sim_ptp_fault which SST_UNUSED)
{
    *(int *)arg = 0;
}

static void unplug(void *arg SST_UNUSED, int ms SST_UNUSED)
{
}

static size_t add(uint8_t *out, int type, uint16_t code, const void *payload, size_t bytes)
{
    struct ptp_bytes b = { .data = NULL };
    size_t n;

    ptp_put(&b, PTP_HEADER_BYTES + bytes, 4);
    ptp_put(&b, (uint64_t)type, 2);
    ptp_put(&b, code, 2);
    ptp_put(&b, 1, 4);
    ptp_put_bytes(&b, payload, bytes);
    n = input_put_message(out, 0, b.data, b.size);
    ptp_free(&b);
    return n;
}

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const uint16_t codes[] = { PTP_GET_DEVICE_INFO,    PTP_OPEN_SESSION,     PTP_GET_STORAGE_IDS,
                                      PTP_GET_STORAGE_INFO,   PTP_INITIATE_CAPTURE, PTP_GET_NUM_OBJECTS,
                                      PTP_GET_OBJECT_HANDLES, PTP_GET_OBJECT_INFO,  PTP_GET_OBJECT,
                                      PTP_GET_PARTIAL_OBJECT, PTP_GET_THUMB,        PTP_DELETE_OBJECT,
                                      PTP_GET_PROP_DESC,      PTP_GET_PROP_VALUE,   PTP_SET_PROP_VALUE,
                                      PTP_RESET_PROP_VALUE,   PTP_RESET_DEVICE,     PTP_CLOSE_SESSION };
    const uint32_t firsts[] = { 1, PTP_STORAGE, PTP_ALL, PTP_EXPOSURE_TIME, PTP_COMPRESSION };

    for (int i = 0; i < (int)ARRAY_LEN(firsts); i++) {
        uint8_t seed[4096];
        size_t n = 1;

        seed[0] = (uint8_t)i;
        for (size_t k = 0; k < ARRAY_LEN(codes); k++) {
            const uint32_t parameters[3] = { codes[k] == PTP_OPEN_SESSION ? 1 : firsts[i], 0, 100 };

            n += add(seed + n, PTP_COMMAND, codes[k], parameters, sizeof(parameters));
            if (codes[k] == PTP_SET_PROP_VALUE)
                n += add(seed + n, PTP_DATA, codes[k], &parameters[2], 4);
        }
        seed_write("ptp", i, seed, n);
    }
    return 0;
}

static void drain(struct sst_sim_ptp *p)
{
    static uint8_t in[512];

    for (int i = 0; i < 64 && sst_sim_ptp_in(p, in, sizeof(in)) >= 0; i++)
        ;
    for (int i = 0; i < 64 && sst_sim_ptp_event(p, in, sizeof(in)) >= 0; i++)
        ;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int which = size ? data[0] % (SST_SIM_PTP_FAULTS + 1) : 0;
    const struct sst_sim_ptp_config cfg = { .serial = "S1",
                                            .width = 64,
                                            .height = 32,
                                            .exposure_us = 5000,
                                            .card_bytes = 40000,
                                            .battery_percent = 70,
                                            .lag_ms = 10,
                                            .write_ms = 20,
                                            .arg = &which,
                                            .mirror_lockup = size && data[0] & 128,
                                            .expose = expose,
                                            .stored = stored,
                                            .fault = fault,
                                            .spend = spend,
                                            .unplug = unplug };
    struct input_message transfer = { 0 };
    struct sst_sim_ptp *p;
    int64_t now_ns = 0;

    if (!size || sst_sim_ptp_create(&p, &cfg))
        return 0;
    data++;
    size--;
    while (input_next_message(&transfer, &data, &size)) {
        if (transfer.kind < 3 && sst_sim_ptp_out(p, transfer.data, transfer.bytes, now_ns)) {
            uint8_t answer[65536];

            if (transfer.bytes >= 8 && sst_sim_ptp_request(p, transfer.data, answer) > (int)sizeof(answer))
                abort();
        } else if (transfer.kind == 3) {
            sst_sim_ptp_released(p);
        }
        if (transfer.kind != 2)
            drain(p);
        now_ns += 40 * MS;
        if (sst_sim_ptp_due_ns(p) <= now_ns)
            sst_sim_ptp_tick(p, now_ns);
    }
    sst_sim_ptp_destroy(p);
    return 0;
}
