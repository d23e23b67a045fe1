/* drivers/rig/bus.h - requests over Modbus TCP and RTU, one at a time, each with a deadline. Inside drivers/rig only.
 */
#ifndef SST_DRIVERS_RIG_BUS_H
#define SST_DRIVERS_RIG_BUS_H

#include "drivers/rig/profile.h"
#include "drivers/rig/rig.h"

struct sst_rig_bus; /* opaque; one thread at a time */

/**
 * Connect.
 * @param bus  "tcp:HOST:PORT" or "rtu:DEVICE,BAUD,8E1"
 * @return 0, -EINVAL (form of bus), -EMFILE (no low descriptor left), -EHOSTUNREACH, -ECONNREFUSED, -ENODEV, -EACCES,
 * -EBUSY (serial line in use), -ENOMEM, -ENOSYS (built without libmodbus); logged.
 */
SST_MUST_CHECK int sst_rig_bus_open(struct sst_rig_bus **out, const char *bus, int response_ms, int gap_ms);
void sst_rig_bus_close(struct sst_rig_bus *bus);

/**
 * One request, tried once. Not logged: sst_rig_bus_why() says what happened.
 *
 * @param count  1 or 2 registers, or 1 bit (values 0 and 1)
 * @return 0; nothing or nothing usable came: -ETIMEDOUT, -EBADMSG (garbled, other unit), -ENOTCONN (line lost): call
 *         sst_rig_bus_restore() before the next request; the drive refused: -EAGAIN (busy), -EPROTO (unknown function,
 *         register or value), -EREMOTEIO (all other exceptions).
 */
SST_MUST_CHECK int sst_rig_bus_read(struct sst_rig_bus *bus, int unit, enum sst_rig_table table, int address, int count,
                                    uint16_t *out);
SST_MUST_CHECK int sst_rig_bus_write(struct sst_rig_bus *bus, int unit, enum sst_rig_table table, int address,
                                     int count, const uint16_t *values);

/** What the last failed request met, one clause. */
const char *sst_rig_bus_why(const struct sst_rig_bus *bus);

/**
 * After a failed request: no late reply can be taken for that of the next one. TCP connects anew; a serial line is read
 * until it is silent, and opened anew where it was lost.
 * @param cancelled  asked between attempts; true gives up
 * @return 0, or the error of the last attempt after reconnect_ms
 */
SST_MUST_CHECK int sst_rig_bus_restore(struct sst_rig_bus *bus, int reconnect_ms, bool (*cancelled)(void *arg),
                                       void *arg);

void sst_rig_bus_counters(const struct sst_rig_bus *bus, struct sst_rig_counters *out);

#endif
