/* The register map of docs/use/rig.md and the Modbus function codes over it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "simulators/rig/rig_internal.h"

enum exception {
    ILLEGAL_FUNCTION = 1,
    ILLEGAL_ADDRESS = 2,
    ILLEGAL_VALUE = 3,
    ACKNOWLEDGE = 5,
    BUSY = 6,
};

#define HOLDING_COUNT 0x10
#define INPUT_COUNT   0x14
#define DEVICE_ID     0x5353
#define FIRMWARE      0x0100
#define BITS          16

/* A value of two registers, the high half first. */
static void split(uint16_t *r, uint32_t v)
{
    r[0] = (uint16_t)(v >> 16);
    r[1] = (uint16_t)v;
}

static void read_holding(const struct sim_axis *a, uint16_t r[HOLDING_COUNT])
{
    r[0] = a->control;
    r[1] = 0;
    split(r + 2, (uint32_t)a->target);
    split(r + 4, a->speed);
    split(r + 6, a->accel);
    r[8] = a->window;
    r[9] = a->following_limit;
    split(r + 10, (uint32_t)a->soft_low);
    split(r + 12, (uint32_t)a->soft_high);
    split(r + 14, a->home_speed);
}

static void read_input(const struct sim_axis *a, int unit, uint16_t r[INPUT_COUNT])
{
    const uint32_t actual = (uint32_t)(int32_t)lround(a->pos - a->offset); /* of the encoder */
    const uint32_t commanded = (uint32_t)(int32_t)lround(a->cmd - a->zero);

    memset(r, 0, INPUT_COUNT * sizeof(*r));
    r[0] = sim_axis_status(a);
    r[1] = a->alarm;
    split(r + 2, actual);
    split(r + 4, commanded);
    split(r + 6, commanded - actual);
    split(r + 8, (uint32_t)(int32_t)a->vel);
    r[16] = DEVICE_ID;
    r[17] = FIRMWARE;
    r[18] = (uint16_t)unit;
}

static uint32_t join(const uint16_t *r)
{
    return (uint32_t)r[0] << 16 | r[1];
}

/* Apply all registers; the control word takes effect last. @return 0, or an exception with nothing changed */
static int write_holding(struct sim_axis *a, const uint16_t r[HOLDING_COUNT])
{
    const uint32_t speed = join(r + 4), accel = join(r + 6), home_speed = join(r + 14);

    if (speed < 1 || speed > 2000000 || accel < 1000 || accel > 50000000 || home_speed < 1 || home_speed > 1000000 ||
        !r[8] || !r[9] || (int32_t)join(r + 10) > (int32_t)join(r + 12))
        return ILLEGAL_VALUE;
    a->target = (int32_t)join(r + 2);
    a->speed = speed;
    a->accel = accel;
    a->window = r[8];
    a->following_limit = r[9];
    a->soft_low = (int32_t)join(r + 10);
    a->soft_high = (int32_t)join(r + 12);
    a->home_speed = home_speed;
    return r[0] == a->control ? 0 : sim_axis_control(a, r[0]);
}

static unsigned word(const uint8_t *p)
{
    return (unsigned)p[0] << 8 | p[1];
}

static void put(uint8_t *p, unsigned v)
{
    p[0] = (uint8_t)(v >> 8);
    p[1] = (uint8_t)v;
}

static int answer_registers(struct sim_axis *a, int unit, const uint8_t *pdu, uint8_t *reply, size_t *n)
{
    const unsigned first = word(pdu + 1), count = word(pdu + 3), there = pdu[0] == 3 ? HOLDING_COUNT : INPUT_COUNT;
    uint16_t r[INPUT_COUNT];

    if (count < 1 || count > 125)
        return ILLEGAL_VALUE;
    if (first + count > there)
        return ILLEGAL_ADDRESS;
    if (pdu[0] == 3)
        read_holding(a, r);
    else
        read_input(a, unit, r);
    reply[1] = (uint8_t)(2 * count);
    for (unsigned i = 0; i < count; i++)
        put(reply + 2 + 2 * i, r[first + i]);
    *n = 2 + 2 * count;
    return 0;
}

/* Coils are the bits of the control word, discrete inputs the status word's. */
static int answer_bits(const struct sim_axis *a, const uint8_t *pdu, uint8_t *reply, size_t *n)
{
    const unsigned first = word(pdu + 1), count = word(pdu + 3);
    const unsigned bits = pdu[0] == 1 ? a->control : sim_axis_status(a);

    if (count < 1 || count > 2000)
        return ILLEGAL_VALUE;
    if (first + count > BITS)
        return ILLEGAL_ADDRESS;
    *n = 2 + (count + 7) / 8;
    reply[1] = (uint8_t)(*n - 2);
    for (unsigned i = 0; i + 2 < *n; i++)
        reply[2 + i] = (uint8_t)((bits >> first & ((1u << count) - 1)) >> 8 * i);
    return 0;
}

static int write_coil(struct sim_axis *a, const uint8_t *pdu)
{
    const unsigned bit = word(pdu + 1), value = word(pdu + 3);

    if (bit >= BITS)
        return ILLEGAL_ADDRESS;
    if (value != 0 && value != 0xFF00)
        return ILLEGAL_VALUE;
    return sim_axis_control(a, (uint16_t)((a->control & ~(1u << bit)) | (value ? 1u << bit : 0u)));
}

static int write_registers(struct sim_axis *a, unsigned first, unsigned count, const uint8_t *values)
{
    uint16_t r[HOLDING_COUNT];

    if (first + count > HOLDING_COUNT)
        return ILLEGAL_ADDRESS;
    read_holding(a, r);
    for (unsigned i = 0; i < count; i++)
        r[first + i] = (uint16_t)word(values + 2 * i);
    return write_holding(a, r);
}

/* @return 0 or an exception */
static int answer(struct sim_axis *a, const struct sim_query *q, uint8_t *reply, size_t *n)
{
    const uint8_t *pdu = q->pdu;

    if (q->size < 5)
        return ILLEGAL_VALUE;
    memcpy(reply, pdu, 5); /* the reply to a write */
    *n = 5;
    switch (pdu[0]) {
    case 1:
    case 2:
        return answer_bits(a, pdu, reply, n);
    case 3:
    case 4:
        return answer_registers(a, q->unit, pdu, reply, n);
    case 5:
        return write_coil(a, pdu);
    case 6:
        return write_registers(a, word(pdu + 1), 1, pdu + 3);
    case 8:
        return word(pdu + 1) ? ILLEGAL_FUNCTION : 0;
    case 16:
        if (q->size < 6 || word(pdu + 3) < 1 || word(pdu + 3) > 123 || pdu[5] != 2 * word(pdu + 3) ||
            q->size != 6u + pdu[5])
            return ILLEGAL_VALUE;
        return write_registers(a, word(pdu + 1), word(pdu + 3), pdu + 6);
    default:
        return ILLEGAL_FUNCTION;
    }
}

static bool is_write(uint8_t function)
{
    return function == 5 || function == 6 || function == 15 || function == 16;
}

/* Fault "busy": each write is refused that often before it is carried out. */
static bool refuses_busy(struct sim_when *busy)
{
    if (busy->every || busy->count++ < busy->left)
        return true;
    busy->count = 0;
    return false;
}

size_t sim_drives_answer(struct sim_drives *bus, int64_t t_ns, const struct sim_query *q,
                         uint8_t reply[SST_SIM_PDU_MAX])
{
    struct sim_axis *a = &bus->axis[q->unit - 1];
    size_t n = 0;
    int exception = 0;

    if (q->unit < 1 || q->unit > SST_SIM_AXES || q->size < 1)
        return 0;
    sim_axis_advance(a, t_ns);
    if (sim_strikes(&bus->faults.exception))
        exception = bus->faults.exception_code;
    if (!exception && is_write(q->pdu[0]) && refuses_busy(&bus->faults.busy))
        exception = BUSY;
    if (!exception)
        exception = answer(a, q, reply, &n);
    if (!exception && is_write(q->pdu[0]) && sim_strikes(&bus->faults.acknowledge))
        exception = ACKNOWLEDGE;
    if (!exception)
        return n;
    reply[0] = q->pdu[0] | 0x80;
    reply[1] = (uint8_t)exception;
    return 2;
}

size_t sim_request_size(const uint8_t *pdu, size_t have)
{
    if (have < 1)
        return 0;
    if (pdu[0] != 15 && pdu[0] != 16)
        return 5;
    return have < 6 ? 0 : 6u + pdu[5];
}
