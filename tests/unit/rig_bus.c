/* Requests on a serial line to a drive that answers late: each reading is of its own register. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* posix_openpt */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/rig/rig_internal.h"
#include "tests/test.h"

#define RESPONSE_MS 100

/** A drive's answer to function 8. */
enum echo {
    ECHOES = 0,
    REFUSES = 1,
    IGNORES = 2,
};

struct drive {
    int fd;
    enum echo echo;
    atomic_int late_ms; /* of the next reply */
    atomic_bool end;
    pthread_t thread;
    char line[64];
};

static void add_crc(uint8_t *frame, int n)
{
    unsigned crc = 0xFFFF;

    for (int i = 0; i < n; i++) {
        crc ^= frame[i];
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1;
    }
    frame[n] = (uint8_t)crc;
    frame[n + 1] = (uint8_t)(crc >> 8);
}

/* All requests have 8 bytes: function 3 reads one register, with its address as value, 6 writes one, 8 is echoed. */
static void *answer(void *arg)
{
    struct drive *d = arg;
    uint8_t in[8], out[8];
    int have = 0;

    while (!atomic_load(&d->end)) {
        struct pollfd p = { .fd = d->fd, .events = POLLIN };
        int n = 8, late_ms;

        if (poll(&p, 1, 20) <= 0 || read(d->fd, in + have, 1) != 1 || ++have < 8)
            continue;
        have = 0;
        memcpy(out, in, 8);
        if (in[1] == 3) {
            out[2] = 2;
            out[3] = in[2];
            out[4] = in[3];
            n = 7;
        } else if (in[1] == 8 && d->echo == REFUSES) {
            out[1] = 0x88;
            out[2] = 1;
            n = 5;
        } else if (in[1] == 8 && d->echo == IGNORES) {
            continue;
        }
        add_crc(out, n - 2);
        late_ms = atomic_exchange(&d->late_ms, 0);
        if (late_ms)
            usleep((unsigned)late_ms * 1000);
        assert_int_equal(write(d->fd, out, (size_t)n), n);
    }
    return NULL;
}

static struct rig_bus *connect_to(struct drive *d, enum echo echo, struct sst_rig_counters *count)
{
    struct rig_bus *bus;
    char name[96];

    memset(d, 0, sizeof(*d));
    d->echo = echo;
    d->fd = posix_openpt(O_RDWR | O_NOCTTY);
    assert_true(d->fd >= 0 && !grantpt(d->fd) && !unlockpt(d->fd) && !ptsname_r(d->fd, d->line, sizeof(d->line)));
    assert_int_equal(pthread_create(&d->thread, NULL, answer, d), 0);
    snprintf(name, sizeof(name), "rtu:%s,19200,8N1", d->line);
    assert_int_equal(rig_bus_open(&bus, name, RESPONSE_MS, 0, count), 0);
    return bus;
}

static void end(struct drive *d, struct rig_bus *bus)
{
    rig_bus_close(bus);
    atomic_store(&d->end, true);
    pthread_join(d->thread, NULL);
    close(d->fd);
}

/* As the drive's part does: restored after each failure, and tried again, which a machine that is busy may cause. */
static unsigned value_at(struct rig_bus *bus, int address)
{
    SST_ATOMIC(bool) cancel = false;
    uint16_t value = 0;
    int err = -1;

    for (int i = 0; err && i < 100; i++) {
        err = rig_bus_read(bus, (struct rig_place){ 1, SST_RIG_HOLDING, address, 1 }, &value);
        if (err)
            assert_int_equal(rig_bus_restore(bus, 1000, &cancel), 0);
    }
    assert_int_equal(err, 0);
    return value;
}

static void late_replies_shift_nothing(void **state SST_UNUSED)
{
    for (int echo = ECHOES; echo <= IGNORES; echo++) {
        for (int late_ms = 250; late_ms <= 450; late_ms += 100) {
            struct sst_rig_counters count = { 0 };
            struct drive d;
            struct rig_bus *bus = connect_to(&d, (enum echo)echo, &count);

            for (int address = 101; address <= 105; address++) {
                if (address == 102)
                    atomic_store(&d.late_ms, late_ms);
                assert_int_equal(value_at(bus, address), address);
            }
            assert_true(count.timeouts >= 1 && count.late >= 1);
            end(&d, bus);
        }
    }
}

static void a_late_reply_confirms_no_other_write(void **state SST_UNUSED)
{
    struct sst_rig_counters count = { 0 };
    SST_ATOMIC(bool) cancel = false;
    struct drive d;
    struct rig_bus *bus = connect_to(&d, ECHOES, &count);
    const uint16_t value = 7;

    atomic_store(&d.late_ms, 300);
    assert_int_equal(rig_bus_write(bus, (struct rig_place){ 1, SST_RIG_HOLDING, 5, 1 }, &value), -ETIMEDOUT);
    assert_int_equal(rig_bus_restore(bus, 1000, &cancel), 0);
    assert_int_equal(value_at(bus, 5), 5); /* the read-back is the register's */
    end(&d, bus);
}

static void input_before_a_request_is_discarded_and_counted(void **state SST_UNUSED)
{
    uint8_t reply[7] = { 1, 3, 2, 0xAB, 0xCD };
    struct sst_rig_counters count = { 0 };
    struct drive d;
    struct rig_bus *bus = connect_to(&d, ECHOES, &count);

    add_crc(reply, 5);
    assert_int_equal(value_at(bus, 1), 1);
    assert_int_equal(write(d.fd, reply, 7), 7);
    assert_int_equal(value_at(bus, 2), 2);
    assert_true(count.late >= 1);
    end(&d, bus);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(late_replies_shift_nothing),
        cmocka_unit_test(a_late_reply_confirms_no_other_write),
        cmocka_unit_test(input_before_a_request_is_discarded_and_counted),
    };

    if (!WITH_MODBUS) {
        puts("built without libmodbus");
        return 77;
    }
    return cmocka_run_group_tests_name("rig bus", tests, NULL, NULL);
}
