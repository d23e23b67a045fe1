/* simulators/rig/wire.h - the simulated drives' requests and replies, and the faults on their way. No I/O. */
#ifndef SST_SIMULATORS_RIG_WIRE_H
#define SST_SIMULATORS_RIG_WIRE_H

#include "simulators/rig/model.h"

#define SST_SIM_PDU_MAX 253

/** When a fault of the wire strikes: the next `left` replies, or every `every`-th. */
struct sst_sim_when {
    int left, every, count;
};

struct sst_sim_wire_faults {
    struct sst_sim_when exception, noise, bad_crc, silence, late, wrong_unit, drop_bytes, disconnect;
    int exception_code, late_ms;
};

/** The three drives on one bus. */
struct sst_sim_drives {
    struct sst_sim_axis axis[SST_SIM_AXES]; /* unit a + 1 */
    struct sst_sim_wire_faults faults;
};

/** Does this fault strike the reply that is due now? Counts. */
bool sst_sim_strikes(struct sst_sim_when *when);

/**
 * Answer a request at t_ns.
 *
 * @param pdu    function code and data, without unit and checksum
 * @param reply  out
 * @return length of the reply; 0: no such unit
 */
size_t sst_sim_drives_answer(struct sst_sim_drives *bus, int unit, int64_t t_ns, const uint8_t *pdu, size_t size,
                             uint8_t reply[SST_SIM_PDU_MAX]);

/** Bytes that the data of a request has on a serial line, by what is there of it: function code first; 0: not yet
 * known. */
size_t sst_sim_request_size(const uint8_t *pdu, size_t have);

/** As sst_sim_drive_fault() of drive.h. */
SST_MUST_CHECK int sst_sim_drives_fault(struct sst_sim_drives *bus, const char *name, const char *value, char *error,
                                        size_t error_size);

#endif
