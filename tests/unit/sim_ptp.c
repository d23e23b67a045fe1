/* tests/unit/sim_ptp.c - the simulated still camera's protocol: transactions, packets, settings, exposures, bad input.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "simulators/devices/ptp/ptp_internal.h"
#include "simulators/devices/ptp/ptp_model.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define MS 1000000LL

static double fault_value[SST_SIM_PTP_FAULTS];
static size_t picture_bytes = 5000;
static int unplugged_ms, exposed, stored_files;

static int expose(void *arg SST_UNUSED, const struct sst_sim_ptp_exposure *e, bool raw, uint8_t **data, size_t *bytes)
{
    exposed = e->shot;
    *bytes = picture_bytes;
    *data = malloc(*bytes);
    assert_non_null(*data);
    memset(*data, raw ? 'r' : 'j', *bytes);
    return 0;
}

static void stored(void *arg SST_UNUSED, int shot SST_UNUSED, const char *name SST_UNUSED,
                   const uint8_t *data SST_UNUSED, size_t bytes SST_UNUSED)
{
    stored_files++;
}

static double fault(void *arg SST_UNUSED, enum sst_sim_ptp_fault which)
{
    return fault_value[which];
}

static void spend(void *arg SST_UNUSED, enum sst_sim_ptp_fault which)
{
    fault_value[which] = 0;
}

static void unplug(void *arg SST_UNUSED, int ms)
{
    unplugged_ms = ms;
}

static struct sst_sim_ptp *camera(bool mirror)
{
    const struct sst_sim_ptp_config cfg = { .serial = "S1",
                                            .width = 64,
                                            .height = 32,
                                            .exposure_us = 5000,
                                            .card_bytes = 40000,
                                            .battery_percent = 70,
                                            .lag_ms = 10,
                                            .write_ms = 20,
                                            .mirror_lockup = mirror,
                                            .expose = expose,
                                            .stored = stored,
                                            .fault = fault,
                                            .spend = spend,
                                            .unplug = unplug };
    struct sst_sim_ptp *p;

    memset(fault_value, 0, sizeof(fault_value));
    exposed = stored_files = unplugged_ms = 0;
    picture_bytes = 5000;
    assert_int_equal(sst_sim_ptp_create(&p, &cfg), 0);
    return p;
}

static uint32_t transaction;

static int send_container(struct sst_sim_ptp *p, int type, uint16_t code, const void *payload, size_t bytes,
                          int64_t now_ns)
{
    struct ptp_bytes b = { .data = NULL };
    int err;

    ptp_put(&b, PTP_HEADER_BYTES + bytes, 4);
    ptp_put(&b, (uint64_t)type, 2);
    ptp_put(&b, code, 2);
    ptp_put(&b, transaction, 4);
    ptp_put_bytes(&b, payload, bytes);
    err = sst_sim_ptp_out(p, b.data, b.size, now_ns);
    ptp_free(&b);
    return err;
}

/** Read phases until the response. @param data  out, of the data phase, without its header; its size @return response
 */
static unsigned response(struct sst_sim_ptp *p, uint8_t *data, size_t *size)
{
    static uint8_t in[65536];
    int n = sst_sim_ptp_in(p, in, sizeof(in));

    *size = 0;
    assert_true(n >= PTP_HEADER_BYTES);
    if (ptp_get(in + 4, 2) == PTP_DATA) {
        assert_int_equal(ptp_get(in + 8, 4), transaction);
        *size = (size_t)n - PTP_HEADER_BYTES;
        memcpy(data, in + PTP_HEADER_BYTES, *size);
        n = sst_sim_ptp_in(p, in, sizeof(in));
        assert_true(n >= PTP_HEADER_BYTES);
    }
    assert_int_equal(ptp_get(in + 4, 2), PTP_RESPONSE);
    assert_int_equal(ptp_get(in + 8, 4), transaction);
    return ptp_get(in + 6, 2);
}

static uint8_t got[65536];
static size_t got_bytes;

static unsigned ask_at(struct sst_sim_ptp *p, uint16_t code, uint32_t a, uint32_t b, uint32_t c, int64_t now_ns)
{
    const uint32_t parameters[3] = { a, b, c };

    transaction++;
    assert_int_equal(send_container(p, PTP_COMMAND, code, parameters, sizeof(parameters), now_ns), 0);
    return response(p, got, &got_bytes);
}

static unsigned ask(struct sst_sim_ptp *p, uint16_t code, uint32_t a)
{
    return ask_at(p, code, a, 0, 0, 0);
}

static unsigned set(struct sst_sim_ptp *p, uint16_t code, uint32_t value, size_t bytes)
{
    const uint32_t parameter = code;

    transaction++;
    assert_int_equal(send_container(p, PTP_COMMAND, PTP_SET_PROP_VALUE, &parameter, 4, 0), 0);
    assert_int_equal(sst_sim_ptp_in(p, got, sizeof(got)), -EAGAIN); /* not before its data */
    assert_int_equal(send_container(p, PTP_DATA, PTP_SET_PROP_VALUE, &value, bytes, 0), 0);
    return response(p, got, &got_bytes);
}

/** Code of the next event, 0: none. */
static unsigned event(struct sst_sim_ptp *p, uint32_t *parameter)
{
    uint8_t in[64];
    const int n = sst_sim_ptp_event(p, in, sizeof(in));

    if (n == -EAGAIN)
        return 0;
    assert_int_equal(n, PTP_HEADER_BYTES + 4);
    *parameter = ptp_get(in + 12, 4);
    return ptp_get(in + 6, 2);
}

static void sessions_open_once(void **state SST_UNUSED)
{
    struct sst_sim_ptp *p = camera(false);

    assert_int_equal(ask(p, PTP_GET_DEVICE_INFO, 0), PTP_OK);
    assert_int_equal(ptp_get(got, 2), 100);
    assert_int_equal(ask(p, PTP_GET_STORAGE_IDS, 0), PTP_SESSION_NOT_OPEN);
    assert_int_equal(ask(p, PTP_OPEN_SESSION, 0), PTP_INVALID_PARAMETER);
    assert_int_equal(ask(p, PTP_OPEN_SESSION, 1), PTP_OK);
    assert_int_equal(ask(p, PTP_OPEN_SESSION, 1), PTP_SESSION_ALREADY_OPEN);
    assert_int_equal(ask(p, PTP_GET_STORAGE_IDS, 0), PTP_OK);
    assert_int_equal(ptp_get(got + 4, 4), PTP_STORAGE);
    assert_int_equal(ask(p, 0x1234, 0), PTP_OPERATION_NOT_SUPPORTED);
    sst_sim_ptp_released(p);
    assert_int_equal(ask(p, PTP_GET_STORAGE_IDS, 0), PTP_SESSION_NOT_OPEN);
    sst_sim_ptp_destroy(p);
}

static void settings_are_checked(void **state SST_UNUSED)
{
    struct sst_sim_ptp *p = camera(false);

    assert_int_equal(ask(p, PTP_OPEN_SESSION, 1), PTP_OK);
    assert_int_equal(set(p, PTP_EXPOSURE_INDEX, 400, 2), PTP_OK);
    assert_int_equal(ask(p, PTP_GET_PROP_VALUE, PTP_EXPOSURE_INDEX), PTP_OK);
    assert_int_equal(got_bytes, 2);
    assert_int_equal(ptp_get(got, 2), 400);
    assert_int_equal(set(p, PTP_EXPOSURE_INDEX, 401, 2), PTP_INVALID_PROP_VALUE);
    assert_int_equal(set(p, PTP_EXPOSURE_INDEX, 400, 4), PTP_INVALID_PROP_VALUE);
    assert_int_equal(set(p, PTP_BATTERY_LEVEL, 50, 1), PTP_ACCESS_DENIED);
    assert_int_equal(set(p, 0x5099, 50, 1), PTP_PROP_NOT_SUPPORTED);
    fault_value[SST_SIM_PTP_REFUSE] = 1;
    assert_int_equal(set(p, PTP_EXPOSURE_INDEX, 800, 2), PTP_ACCESS_DENIED);
    assert_int_equal(set(p, PTP_EXPOSURE_INDEX, 800, 2), PTP_OK);
    fault_value[SST_SIM_PTP_BATTERY] = 3;
    assert_int_equal(ask(p, PTP_GET_PROP_VALUE, PTP_BATTERY_LEVEL), PTP_OK);
    assert_int_equal(got[0], 3);
    sst_sim_ptp_destroy(p);
}

/** Release at 0, exposed at 10 ms, on the card after 5 ms of exposure and 20 ms of writing. */
static uint32_t picture(struct sst_sim_ptp *p)
{
    uint32_t handle = 0, none;

    assert_int_equal(ask_at(p, PTP_INITIATE_CAPTURE, 0, 0, 0, 0), PTP_OK);
    assert_int_equal(sst_sim_ptp_due_ns(p), 10 * MS);
    assert_int_equal(ask_at(p, PTP_INITIATE_CAPTURE, 0, 0, 0, 5 * MS), PTP_DEVICE_BUSY);
    sst_sim_ptp_tick(p, 10 * MS);
    assert_int_equal(sst_sim_ptp_due_ns(p), 35 * MS);
    assert_int_equal(event(p, &none), 0);
    sst_sim_ptp_tick(p, 35 * MS);
    assert_int_equal(event(p, &handle), PTP_EVENT_OBJECT_ADDED);
    assert_int_equal(event(p, &none), PTP_EVENT_CAPTURE_COMPLETE);
    assert_int_equal(event(p, &none), 0);
    return handle;
}

static void exposures_become_files(void **state SST_UNUSED)
{
    struct sst_sim_ptp *p = camera(false);
    uint32_t handle, count;

    assert_int_equal(ask(p, PTP_OPEN_SESSION, 1), PTP_OK);
    handle = picture(p);
    assert_int_equal(exposed, 1);
    assert_int_equal(stored_files, 1);
    assert_int_equal(ask_at(p, PTP_GET_OBJECT_HANDLES, PTP_ALL, 0, PTP_FOLDER, 0), PTP_OK);
    assert_int_equal(ptp_get(got, 4), 1);
    assert_int_equal(ptp_get(got + 4, 4), handle);
    assert_int_equal(ask_at(p, PTP_GET_OBJECT_HANDLES, PTP_ALL, 0, PTP_ALL, 0), PTP_OK);
    assert_int_equal(ptp_get(got + 4, 4), PTP_DCIM);
    assert_int_equal(ask(p, PTP_GET_OBJECT_INFO, handle), PTP_OK);
    assert_int_equal(ptp_get(got + 8, 4), 5000);
    assert_int_equal(ask(p, PTP_GET_OBJECT, handle), PTP_OK);
    assert_int_equal(got_bytes, 5000);
    assert_int_equal(ask_at(p, PTP_GET_PARTIAL_OBJECT, handle, 4990, 100, 0), PTP_OK);
    assert_int_equal(got_bytes, 10);
    assert_int_equal(ask_at(p, PTP_GET_PARTIAL_OBJECT, handle, 5001, 1, 0), PTP_INVALID_PARAMETER);
    assert_int_equal(ask(p, PTP_DELETE_OBJECT, PTP_DCIM), PTP_ACCESS_DENIED);
    assert_int_equal(ask(p, PTP_DELETE_OBJECT, handle), PTP_OK);
    assert_int_equal(ask(p, PTP_GET_OBJECT, handle), PTP_INVALID_HANDLE);
    assert_int_equal(set(p, PTP_COMPRESSION, PTP_FILES_BOTH, 1), PTP_OK);
    assert_int_equal(ask_at(p, PTP_INITIATE_CAPTURE, 0, 0, 0, 0), PTP_OK);
    sst_sim_ptp_tick(p, 10 * MS);
    sst_sim_ptp_tick(p, 35 * MS);
    assert_int_equal(event(p, &count), PTP_EVENT_OBJECT_ADDED);
    assert_int_equal(event(p, &count), PTP_EVENT_OBJECT_ADDED);
    assert_int_equal(sst_sim_ptp_files(p), 2);
    sst_sim_ptp_destroy(p);
}

/* A container of whole packets ends with an empty one, unless the host's buffer had room left. */
static void full_packets_are_followed_by_an_empty_one(void **state SST_UNUSED)
{
    struct sst_sim_ptp *p = camera(false);
    uint32_t handle;

    assert_int_equal(ask(p, PTP_OPEN_SESSION, 1), PTP_OK);
    picture_bytes = 2 * 512 - PTP_HEADER_BYTES;
    handle = picture(p);
    for (int size = 512; size <= 1024; size += 512) {
        transaction++;
        assert_int_equal(send_container(p, PTP_COMMAND, PTP_GET_OBJECT, &handle, 4, 0), 0);
        for (int at = 0; at < 1024; at += size)
            assert_int_equal(sst_sim_ptp_in(p, got, (size_t)size), size);
        assert_int_equal(sst_sim_ptp_in(p, got, 512), 0);
        assert_int_equal(sst_sim_ptp_in(p, got, 512), PTP_HEADER_BYTES); /* the response */
    }
    assert_int_equal(ask(p, PTP_GET_OBJECT, handle), PTP_OK); /* with room: none */
    sst_sim_ptp_destroy(p);
}

static void a_mirror_is_lifted_first(void **state SST_UNUSED)
{
    struct sst_sim_ptp *p = camera(true);

    assert_int_equal(ask(p, PTP_OPEN_SESSION, 1), PTP_OK);
    assert_int_equal(ask_at(p, PTP_INITIATE_CAPTURE, 0, 0, 0, 0), PTP_OK);
    assert_int_equal(sst_sim_ptp_due_ns(p), INT64_MAX);
    assert_int_equal(ask_at(p, PTP_INITIATE_CAPTURE, 0, 0, 0, 1000 * MS), PTP_OK);
    assert_int_equal(sst_sim_ptp_due_ns(p), 1010 * MS);
    sst_sim_ptp_destroy(p);
}

static void faults_happen_once(void **state SST_UNUSED)
{
    struct sst_sim_ptp *p = camera(false);
    uint32_t handle, none;

    assert_int_equal(ask(p, PTP_OPEN_SESSION, 1), PTP_OK);
    fault_value[SST_SIM_PTP_BUSY] = 100;
    assert_int_equal(ask_at(p, PTP_INITIATE_CAPTURE, 0, 0, 0, 0), PTP_DEVICE_BUSY);
    assert_int_equal(ask_at(p, PTP_INITIATE_CAPTURE, 0, 0, 0, 99 * MS), PTP_DEVICE_BUSY);
    fault_value[SST_SIM_PTP_CARD_FULL] = 1;
    assert_int_equal(ask_at(p, PTP_INITIATE_CAPTURE, 0, 0, 0, 100 * MS), PTP_STORE_FULL);
    fault_value[SST_SIM_PTP_CARD_FULL] = 0;
    p->busy_until_ns = 0;
    fault_value[SST_SIM_PTP_CORRUPT] = 1;
    handle = picture(p);
    assert_int_equal(ask(p, PTP_GET_OBJECT_INFO, handle), PTP_OK);
    assert_int_equal(ptp_get(got + 8, 4), 2500);
    fault_value[SST_SIM_PTP_CORRUPT] = 3;
    handle = picture(p);
    assert_int_equal(ask(p, PTP_GET_OBJECT, handle), PTP_OK);
    assert_int_equal(got_bytes, 5000 - 256);
    assert_int_equal(ask(p, PTP_GET_OBJECT, handle), PTP_OK);
    assert_int_equal(got_bytes, 5000);
    fault_value[SST_SIM_PTP_SILENCE] = 1;
    assert_int_equal(send_container(p, PTP_COMMAND, PTP_GET_STORAGE_IDS, NULL, 0, 0), 0);
    assert_int_equal(sst_sim_ptp_in(p, got, sizeof(got)), -EAGAIN);
    sst_sim_ptp_released(p);
    assert_int_equal(ask(p, PTP_OPEN_SESSION, 1), PTP_OK);
    fault_value[SST_SIM_PTP_DOWNLOAD] = 300;
    assert_int_equal(send_container(p, PTP_COMMAND, PTP_GET_OBJECT, &handle, 4, 0), 0);
    assert_int_equal(sst_sim_ptp_in(p, got, sizeof(got)), (5000 + PTP_HEADER_BYTES) / 2);
    assert_int_equal(sst_sim_ptp_in(p, got, sizeof(got)), -EAGAIN);
    assert_int_equal(unplugged_ms, 300);
    sst_sim_ptp_released(p);
    assert_int_equal(ask(p, PTP_OPEN_SESSION, 1), PTP_OK);
    fault_value[SST_SIM_PTP_NO_EVENT] = 1;
    assert_int_equal(ask_at(p, PTP_INITIATE_CAPTURE, 0, 0, 0, 0), PTP_OK);
    sst_sim_ptp_tick(p, 10 * MS);
    sst_sim_ptp_tick(p, 35 * MS);
    assert_int_equal(event(p, &none), 0);
    sst_sim_ptp_destroy(p);
}

/* 40000 bytes hold 8 pictures of 5000. */
static void a_card_becomes_full(void **state SST_UNUSED)
{
    struct sst_sim_ptp *p = camera(false);

    assert_int_equal(ask(p, PTP_OPEN_SESSION, 1), PTP_OK);
    for (int i = 0; i < 8; i++)
        (void)picture(p);
    assert_int_equal(ask_at(p, PTP_INITIATE_CAPTURE, 0, 0, 0, 0), PTP_STORE_FULL);
    assert_int_equal(ask(p, PTP_GET_STORAGE_INFO, PTP_STORAGE), PTP_OK);
    assert_int_equal(ptp_get(got + 14, 4), 0);
    assert_int_equal(ask(p, PTP_DELETE_OBJECT, PTP_ALL), PTP_OK);
    (void)picture(p);
    sst_sim_ptp_destroy(p);
}

static void malformed_containers_halt_the_endpoint(void **state SST_UNUSED)
{
    struct sst_sim_ptp *p = camera(false);
    uint8_t bytes[64] = { 12, 0, 0, 0, PTP_COMMAND, 0, 1, 0x10 };

    assert_int_equal(sst_sim_ptp_out(p, bytes, 11, 0), -EPIPE);
    assert_int_equal(sst_sim_ptp_out(p, bytes, 16, 0), -EPIPE); /* another length than it says */
    bytes[0] = 13;
    assert_int_equal(sst_sim_ptp_out(p, bytes, 13, 0), -EPIPE); /* half a parameter */
    bytes[0] = 36;
    assert_int_equal(sst_sim_ptp_out(p, bytes, 36, 0), -EPIPE); /* six of them */
    bytes[0] = 12;
    bytes[4] = PTP_DATA;
    assert_int_equal(sst_sim_ptp_out(p, bytes, 12, 0), -EPIPE); /* without a command */
    assert_int_equal(ask(p, PTP_GET_DEVICE_INFO, 0), PTP_OK);
    sst_sim_ptp_destroy(p);
}

static size_t random_below(uint64_t *seed, size_t limit)
{
    return (size_t)(sst_random(seed) * (double)limit);
}

/* Whatever arrives: no access out of bounds (the sanitizers tell), and a session can be opened afterwards. */
static void random_input_is_survived(void **state SST_UNUSED)
{
    struct sst_sim_ptp *p = camera(false);
    uint64_t seed = 7;

    for (int i = 0; i < 20000; i++) {
        uint8_t bytes[64];
        size_t n = random_below(&seed, sizeof(bytes) + 1);

        for (size_t k = 0; k < sizeof(bytes); k++)
            bytes[k] = (uint8_t)random_below(&seed, 256);
        if (i % 4) { /* most have a good header, and a code that exists */
            n = 12 + 4 * random_below(&seed, 6);
            memcpy(bytes, (const uint8_t[]){ (uint8_t)n, 0, 0, 0, (uint8_t)(1 + (i % 8 == 1)), 0 }, 6);
            bytes[6] = (uint8_t)(1 + random_below(&seed, 0x1c));
            bytes[7] = 0x10;
            bytes[12] = (uint8_t)random_below(&seed, 24);
            memset(bytes + 13, 0, 3);
        }
        (void)!sst_sim_ptp_out(p, bytes, n, i * MS);
        sst_sim_ptp_tick(p, i * MS);
        while (sst_sim_ptp_in(p, got, 1 + random_below(&seed, 2000)) >= 0)
            ;
        while (sst_sim_ptp_event(p, got, 64) >= 0)
            ;
    }
    sst_sim_ptp_released(p);
    assert_int_equal(ask(p, PTP_OPEN_SESSION, 1), PTP_OK);
    sst_sim_ptp_destroy(p);
}

static void raw_files_are_dng(void **state SST_UNUSED)
{
    uint8_t bayer[8 * 4], *dng;
    size_t bytes;

    for (size_t i = 0; i < sizeof(bayer); i++)
        bayer[i] = (uint8_t)i;
    assert_int_equal(sst_sim_ptp_dng(bayer, 8, 4, &dng, &bytes), 0);
    assert_memory_equal(dng, "II*\0\10\0\0\0", 8);
    assert_memory_equal(dng + bytes - sizeof(bayer), bayer, sizeof(bayer));
    for (unsigned i = 0, last = 0; i < ptp_get(dng + 8, 2); i++) { /* tags ascend; the strip is where its tag says */
        const uint8_t *tag = dng + 10 + 12 * i;

        assert_true(ptp_get(tag, 2) > last);
        last = ptp_get(tag, 2);
        if (last == 273)
            assert_int_equal(ptp_get(tag + 8, 4), bytes - sizeof(bayer));
    }
    free(dng);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sessions_open_once),       cmocka_unit_test(settings_are_checked),
        cmocka_unit_test(exposures_become_files),   cmocka_unit_test(full_packets_are_followed_by_an_empty_one),
        cmocka_unit_test(a_mirror_is_lifted_first), cmocka_unit_test(faults_happen_once),
        cmocka_unit_test(a_card_becomes_full),      cmocka_unit_test(malformed_containers_halt_the_endpoint),
        cmocka_unit_test(random_input_is_survived), cmocka_unit_test(raw_files_are_dng),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
