/* Bus of the rig: libmodbus with bounded recovery; its own one replays writes and may never return, so it stays off. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/rig/rig_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/select.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"

#if WITH_MODBUS
#include <modbus.h>

#define BYTE_TIMEOUT_US 100000
#define RETRY_NS        100000000
#define DRAIN_MAX_NS    2000000000
#define ECHO_RESPONSES  4 /* response times in which an echo comes, behind a late reply */
#define ECHO_BYTES      8

struct rig_bus {
    modbus_t *ctx;
    bool serial, open;
    int response_ms, gap_ms;
    int unit;        /* of the last request */
    unsigned echo;   /* data of the last echo */
    int64_t last_ns; /* end of the last request */
    char name[SST_RIG_TEXT_MAX], why[128];
    char device[SST_RIG_TEXT_MAX]; /* or host */
    struct sst_rig_counters *count;
};

static void sleep_ns(int64_t ns)
{
    const struct timespec t = { .tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000 };

    if (ns > 0)
        (void)nanosleep(&t, NULL);
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static int bad_name(const char *bus)
{
    sst_log_error("the rig's bus %.80s is not of the form tcp:HOST:PORT or rtu:DEVICE,BAUD,8E1", bus);
    return -EINVAL;
}

static int make_tcp(struct rig_bus *b)
{
    const char *port = strrchr(b->name, ':'), *host = b->name + 4;
    int n = (int)(port - host);
    char *end;

    if (n > 2 && host[0] == '[' && host[n - 1] == ']') { /* as in addresses of the web: [fd00::5]:502 */
        host++;
        n -= 2;
    }
    snprintf(b->device, sizeof(b->device), "%.*s", n, host);
    if (!b->device[0] || strtol(port + 1, &end, 10) < 1 || strtol(port + 1, &end, 10) > 65535 || *end)
        return bad_name(b->name);
    b->ctx = modbus_new_tcp_pi(b->device, port + 1);
    return b->ctx ? 0 : -ENOMEM;
}

static int make_rtu(struct rig_bus *b)
{
    int baud = 0, data = 0, stop = 0, n = 0;
    char parity[2] = "";
    const char *comma = strchr(b->name, ',');

    if (!comma || sscanf(comma, ",%7d,%1d%1[EON]%1d%n", &baud, &data, parity, &stop, &n) != 4 || comma[n] ||
        baud < 300 || (data != 7 && data != 8) || (stop != 1 && stop != 2))
        return bad_name(b->name);
    snprintf(b->device, sizeof(b->device), "%.*s", (int)(comma - (b->name + 4)), b->name + 4);
    b->serial = true;
    b->ctx = modbus_new_rtu(b->device, baud, parity[0], data, stop);
    return b->ctx ? 0 : -ENOMEM;
}

/* libmodbus 3.1.6 and some later versions put the descriptor into an fd_set without a check: it must be below
 * FD_SETSIZE, and that must be known before they open it. */
static int check_descriptors(struct rig_bus *b)
{
    const int fd = open("/dev/null", O_RDONLY | O_CLOEXEC);

    if (fd >= 0)
        close(fd);
    if (fd >= 0 && fd < FD_SETSIZE - 8)
        return 0;
    snprintf(b->why, sizeof(b->why), "no descriptor below %d is free; open the rig before the cameras", FD_SETSIZE);
    return -EMFILE;
}

static int connect_errno(int e)
{
    switch (e) {
    case ECONNREFUSED:
    case EACCES:
    case EBUSY:
    case EMFILE:
    case ENOMEM:
        return -e;
    case ENOENT:
    case ENODEV:
    case ENXIO:
    case EIO:
    case ENOTTY:
    case EPERM:
        return -ENODEV;
    default:
        return -EHOSTUNREACH;
    }
}

/* libmodbus reports a host that is not found as a refused connection. */
static void explain_host(struct rig_bus *b)
{
    struct addrinfo *list = NULL;
    const int rc = getaddrinfo(b->device, NULL, NULL, &list);

    if (rc)
        snprintf(b->why, sizeof(b->why), "host %.60s: %.50s", b->device, gai_strerror(rc));
    else
        freeaddrinfo(list);
}

static int connect_once(struct rig_bus *b)
{
    int err = check_descriptors(b), fd;

    if (err)
        return err;
    errno = 0;
    if (modbus_connect(b->ctx)) {
        err = connect_errno(errno);
        snprintf(b->why, sizeof(b->why), "%s", errno ? modbus_strerror(errno) : "no connection");
        if (err == -ECONNREFUSED && !b->serial)
            explain_host(b);
        return err;
    }
    fd = modbus_get_socket(b->ctx);
    if (fd >= FD_SETSIZE)
        err = check_descriptors(b);
    /* Two programs on one serial line would read each other's replies. The lock ends with the process. */
    if (!err && b->serial && flock(fd, LOCK_EX | LOCK_NB) && errno == EWOULDBLOCK) {
        err = -EBUSY;
        snprintf(b->why, sizeof(b->why), "another program uses it");
    }
    if (err) {
        modbus_close(b->ctx);
        return err;
    }
    b->open = true;
    return 0;
}

int rig_bus_open(struct rig_bus **out, const char *bus, int response_ms, int gap_ms, struct sst_rig_counters *count)
{
    struct rig_bus *b = calloc(1, sizeof(*b));
    int err;

    if (!b)
        return -ENOMEM;
    b->response_ms = response_ms;
    b->gap_ms = gap_ms;
    b->count = count;
    if (snprintf(b->name, sizeof(b->name), "%s", bus) >= (int)sizeof(b->name))
        err = bad_name(bus);
    else if (!strncmp(bus, "tcp:", 4) && strrchr(bus, ':') > bus + 4)
        err = make_tcp(b);
    else if (!strncmp(bus, "rtu:", 4))
        err = make_rtu(b);
    else
        err = bad_name(bus);
    if (err)
        goto fail;
    (void)modbus_set_error_recovery(b->ctx, MODBUS_ERROR_RECOVERY_NONE);
    (void)modbus_set_response_timeout(b->ctx, (uint32_t)response_ms / 1000, (uint32_t)(response_ms % 1000) * 1000);
    (void)modbus_set_byte_timeout(b->ctx, 0, BYTE_TIMEOUT_US);
    err = connect_once(b);
    if (err) {
        sst_log_error("rig %s: cannot connect: %s; check cable, power and the bus in the configuration", b->name,
                      b->why);
        goto fail;
    }
    *out = b;
    return 0;

fail:
    rig_bus_close(b);
    return err;
}

void rig_bus_close(struct rig_bus *b)
{
    if (!b)
        return;
    if (b->open)
        modbus_close(b->ctx);
    modbus_free(b->ctx);
    free(b);
}

/* --- requests ----------------------------------------------------------------------------------------------------- */

static int exception(struct rig_bus *b, int code)
{
    b->count->exceptions++;
    snprintf(b->why, sizeof(b->why), "exception %d (%s)", code, modbus_strerror(MODBUS_ENOBASE + code));
    switch (code) {
    case MODBUS_EXCEPTION_ILLEGAL_FUNCTION:
    case MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS:
    case MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE:
        return -EPROTO;
    case MODBUS_EXCEPTION_ACKNOWLEDGE:
        return -EINPROGRESS;
    case MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY:
    case MODBUS_EXCEPTION_GATEWAY_PATH:
        return -EAGAIN;
    case MODBUS_EXCEPTION_GATEWAY_TARGET:
        return -EHOSTDOWN;
    default:
        return -EREMOTEIO;
    }
}

static int request_errno(struct rig_bus *b, int e)
{
    if (e > MODBUS_ENOBASE && e < MODBUS_ENOBASE + MODBUS_EXCEPTION_MAX)
        return exception(b, e - MODBUS_ENOBASE);
    if (e == ETIMEDOUT) {
        b->count->timeouts++;
        snprintf(b->why, sizeof(b->why), "no reply within %d ms", b->response_ms);
        return -ETIMEDOUT;
    }
    if (e >= MODBUS_ENOBASE) {
        b->count->garbled++;
        snprintf(b->why, sizeof(b->why), "a garbled reply (%s)", modbus_strerror(e));
        return -EBADMSG;
    }
    b->count->lost++;
    snprintf(b->why, sizeof(b->why), "the line is lost (%s)", strerror(e));
    return -ENOTCONN;
}

/* Discard input since the last reply: a late reply is none to the next request. @return false: line lost */
static bool discard(struct rig_bus *b)
{
    struct pollfd p = { .fd = modbus_get_socket(b->ctx), .events = POLLIN };
    char rubbish[256];
    bool late = false;

    while (poll(&p, 1, 0) > 0) {
        if (read(p.fd, rubbish, sizeof(rubbish)) <= 0)
            return false;
        late = true;
    }
    b->count->late += late;
    return true;
}

static int begin(struct rig_bus *b, int unit)
{
    if (!b->open) {
        snprintf(b->why, sizeof(b->why), "the line is lost");
        return -ENOTCONN;
    }
    sleep_ns(b->last_ns + (int64_t)b->gap_ms * 1000000 - sst_clock_now_ns());
    if (b->serial && !discard(b)) {
        b->count->lost++;
        snprintf(b->why, sizeof(b->why), "the line is lost");
        return -ENOTCONN;
    }
    b->count->requests++;
    b->unit = unit;
    return modbus_set_slave(b->ctx, unit) ? -EINVAL : 0;
}

int rig_bus_read(struct rig_bus *b, struct rig_place at, uint16_t *out)
{
    /* Large enough for any reply. */
    uint16_t words[MODBUS_MAX_READ_REGISTERS + 3] = { 0 };
    uint8_t bits[MODBUS_MAX_READ_BITS] = { 0 };
    int n = -1, err = begin(b, at.unit);

    if (err)
        return err;
    switch (at.table) {
    case SST_RIG_HOLDING:
        n = modbus_read_registers(b->ctx, at.address, at.count, words);
        break;
    case SST_RIG_INPUT:
        n = modbus_read_input_registers(b->ctx, at.address, at.count, words);
        break;
    case SST_RIG_COIL:
        n = modbus_read_bits(b->ctx, at.address, at.count, bits);
        break;
    case SST_RIG_DISCRETE:
        n = modbus_read_input_bits(b->ctx, at.address, at.count, bits);
        break;
    }
    err = errno;
    b->last_ns = sst_clock_now_ns();
    if (n != at.count)
        return request_errno(b, n < 0 ? err : EMBBADDATA);
    for (int i = 0; i < at.count; i++)
        out[i] = at.table == SST_RIG_COIL || at.table == SST_RIG_DISCRETE ? bits[i] : words[i];
    return 0;
}

int rig_bus_write(struct rig_bus *b, struct rig_place at, const uint16_t *values)
{
    int n, err = begin(b, at.unit);

    if (err)
        return err;
    if (at.table == SST_RIG_COIL)
        n = modbus_write_bit(b->ctx, at.address, values[0]);
    else
        n = at.count == 1 ? modbus_write_register(b->ctx, at.address, values[0])
                          : modbus_write_registers(b->ctx, at.address, at.count, values);
    err = errno;
    b->last_ns = sst_clock_now_ns();
    return n == at.count ? 0 : request_errno(b, n < 0 ? err : EMBBADDATA);
}

const char *rig_bus_why(const struct rig_bus *b)
{
    return b->why;
}

/* --- after a failure ---------------------------------------------------------------------------------------------- */

/* Read until the line is silent for one response time. @return 0 or -ENOTCONN */
static int drain(struct rig_bus *b)
{
    const int64_t end_ns = sst_clock_now_ns() + DRAIN_MAX_NS;
    struct pollfd p = { .fd = modbus_get_socket(b->ctx), .events = POLLIN };
    char rubbish[256];

    while (sst_clock_now_ns() < end_ns) {
        const int n = poll(&p, 1, b->response_ms);

        if (!n || (n < 0 && errno == EINTR))
            return 0;
        if (n < 0 || read(p.fd, rubbish, sizeof(rubbish)) <= 0)
            return -ENOTCONN;
    }
    return 0;
}

static unsigned crc16(const uint8_t *data, int n)
{
    unsigned crc = 0xFFFF;

    for (int i = 0; i < n; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1;
    }
    return crc;
}

static bool has_crc(const uint8_t *frame, int n)
{
    return crc16(frame, n - 2) == (unsigned)(frame[n - 2] | frame[n - 1] << 8);
}

/* Are the last bytes the answer to an echo: the same bytes, or an exception to its function? */
static bool is_echo(const uint8_t *in, int n, const uint8_t *request)
{
    if (n >= ECHO_BYTES && !memcmp(in + n - ECHO_BYTES, request, ECHO_BYTES))
        return true;
    return n >= 5 && in[n - 5] == request[0] && in[n - 4] == (request[1] | 0x80) && has_crc(in + n - 5, 5);
}

/*
 * A reply on a serial line does not name its request. A drive answers in the order of its requests, so that
 * after the answer to an echo (function 8/0 with new data, which no other request has) no earlier one is to come.
 * Drives without function 8 answer with an exception; silent ones are given the time.
 * @return 0 or -ENOTCONN
 */
static int echo(struct rig_bus *b)
{
    const unsigned data = ++b->echo & 0xFFFF;
    uint8_t request[ECHO_BYTES] = { (uint8_t)b->unit, 8, 0, 0, (uint8_t)(data >> 8), (uint8_t)data }, in[256];
    struct pollfd p = { .fd = modbus_get_socket(b->ctx), .events = POLLIN };
    const int64_t end_ns = sst_clock_now_ns() + ECHO_RESPONSES * (int64_t)b->response_ms * 1000000;
    const unsigned crc = crc16(request, ECHO_BYTES - 2);
    int n = 0;

    request[6] = (uint8_t)crc;
    request[7] = (uint8_t)(crc >> 8);
    sleep_ns(b->last_ns + (int64_t)b->gap_ms * 1000000 - sst_clock_now_ns());
    b->count->requests++;
    if (write(p.fd, request, sizeof(request)) != sizeof(request))
        return -ENOTCONN;
    while (sst_clock_now_ns() < end_ns && !is_echo(in, n, request)) {
        const int64_t left_ms = (end_ns - sst_clock_now_ns()) / 1000000;

        if (poll(&p, 1, (int)left_ms + 1) <= 0)
            continue;
        if (n == (int)sizeof(in)) { /* keep a possible start of the answer */
            memmove(in, in + n - ECHO_BYTES, ECHO_BYTES);
            n = ECHO_BYTES;
        }
        if (read(p.fd, in + n, 1) != 1)
            return -ENOTCONN;
        n++;
    }
    b->last_ns = sst_clock_now_ns();
    b->count->late += n > (is_echo(in, n, request) ? ECHO_BYTES : 0);
    return 0;
}

int rig_bus_restore(struct rig_bus *b, int reconnect_ms, const SST_ATOMIC(bool) * cancel)
{
    const int64_t end_ns = sst_clock_now_ns() + (int64_t)reconnect_ms * 1000000;
    bool logged = false;
    int err;

    if (b->open && b->serial && !drain(b) && !echo(b))
        return 0;
    if (b->open)
        modbus_close(b->ctx);
    b->open = false;
    for (;;) {
        err = connect_once(b);
        if (!err)
            break;
        if (!logged)
            sst_log_warning("rig %s: connection lost, cannot reconnect: %s; retrying for %d ms", b->name, b->why,
                            reconnect_ms);
        logged = true;
        if (sst_clock_now_ns() >= end_ns || atomic_load(cancel))
            return err;
        sleep_ns(RETRY_NS);
    }
    b->count->reconnects++;
    if (logged)
        sst_log_warning("rig %s: reconnected", b->name);
    return 0;
}

#else

#include "base/absent.h"

int rig_bus_open(struct rig_bus **out SST_UNUSED, const char *bus, int response_ms SST_UNUSED, int gap_ms SST_UNUSED,
                 struct sst_rig_counters *count SST_UNUSED)
{
    sst_log_error("rig %s: this sst was built without libmodbus; install libmodbus-dev and build again", bus);
    return -ENOSYS;
}

/* Never called: without open there is no bus. */
SST_ABSENT(void, , rig_bus_close, struct rig_bus *b)
SST_ABSENT(int, -ENOSYS, rig_bus_read, struct rig_bus *b, struct rig_place at, uint16_t *out)
SST_ABSENT(int, -ENOSYS, rig_bus_write, struct rig_bus *b, struct rig_place at, const uint16_t *values)
SST_ABSENT(const char *, "built without libmodbus", rig_bus_why, const struct rig_bus *b)
SST_ABSENT(int, -ENOSYS, rig_bus_restore, struct rig_bus *b, int reconnect_ms, const SST_ATOMIC(bool) * cancel)

#endif
