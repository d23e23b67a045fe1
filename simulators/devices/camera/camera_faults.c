/* Faults of a camera. */
#include "simulators/devices/camera/camera_internal.h"

const struct sim_fault sim_cam_faults[SST_SIM_FAULTS_OF_CAMERA] = {
    [SST_SIM_FAULT_UNPLUG] = { "unplug", 0, 1, "1: away, 0: back, perhaps as another /dev/videoN" },
    [SST_SIM_FAULT_EIO] = { "eio", 0, 1, "share of DQBUF calls that fail with EIO; the frame stays for the next call" },
    [SST_SIM_FAULT_ERROR_FLAG] = { "error_flag", 0, 1, "share of frames with V4L2_BUF_FLAG_ERROR" },
    [SST_SIM_FAULT_GAP] = { "gap", 0, 1, "share of frames lost on the way: the sequence shows a gap" },
    [SST_SIM_FAULT_LATE_MS] = { "late_ms", 0, 60000, "frames are done this many ms later" },
    [SST_SIM_FAULT_LATE_P] = { "late_p", 0, 1, "share of frames that late_ms concerns; 0: all" },
    [SST_SIM_FAULT_DUPLICATE] = { "duplicate", 0, 1,
                                  "share of frames that come twice, the second stamped 500 us later" },
    [SST_SIM_FAULT_FROZEN] = { "frozen", 0, 1, "1: the same picture for ever, with new stamps" },
    [SST_SIM_FAULT_TRUNCATED] = { "truncated", 0, 1, "share of frames that end in the middle" },
    [SST_SIM_FAULT_CORRUPT_SOI] = { "corrupt_soi", 0, 1, "share of frames whose first two bytes are wrong" },
    [SST_SIM_FAULT_CORRUPT_EOI] = { "corrupt_eoi", 0, 1, "share of frames whose last two bytes are wrong" },
    [SST_SIM_FAULT_CORRUPT_MID] = { "corrupt_mid", 0, 1, "share of frames with 16 bytes of the middle overwritten" },
    [SST_SIM_FAULT_SHORT] = { "short", 0, 1, "share of frames of 32 bytes" },
    [SST_SIM_FAULT_STALL] = { "stall", 0, 5,
                              "no frames until: 1 restream, 2 reopen, 3 USB reset, 4 re-authorise, 5 power" },
    [SST_SIM_FAULT_BUSY] = { "busy", 0, 1, "1: S_FMT and REQBUFS fail with EBUSY" },
    [SST_SIM_FAULT_NOSPACE] = { "nospace", 0, 1, "1: STREAMON fails with ENOSPC" },
    [SST_SIM_FAULT_SEQUENCE_WRAP] = { "sequence_wrap", 0, 1, "1: the sequence goes on from 2^32 - 8" },
    [SST_SIM_FAULT_TIME_WRAP] = { "time_wrap", 0, 1, "1: stamps go on from 2^31 - 2 s and wrap to -2^31 s" },
    [SST_SIM_FAULT_BACKWARDS] = { "backwards", 0, 1, "share of frames stamped a second too early" },
    [SST_SIM_FAULT_CLOCK_STEP_US] = { "clock_step_us", -1e9, 1e9, "added to the stamps" },
    [SST_SIM_FAULT_SWAP] = { "swap", -255, 255, "the camera behind this cable is number N + VALUE" },
    [SST_SIM_FAULT_CONTROL_STUCK] = { "control_stuck", 0, 1, "1: S_CTRL succeeds and changes nothing" },
    [SST_SIM_FAULT_OTHER_SIZE] = { "other_size", 0, 1, "share of frames whose JPEG header says 8 lines more" },
    [SST_SIM_FAULT_NO_TABLES] = { "no_tables", 0, 1, "share of frames without Huffman tables" },
    [SST_SIM_FAULT_LEAD] = { "lead", 0, 64, "bytes of something else before each frame" },
    [SST_SIM_FAULT_FIELD] = { "field", 0, 19, "enum v4l2_field that buffers have, and plus 10 formats too; 0: progressive" },
    [SST_SIM_FAULT_PARM_ERRNO] = { "parm_errno", 0, 133, "S_PARM fails with this errno" },
    [SST_SIM_FAULT_MPLANE] = { "mplane", 0, 1, "1: the node has the multi-planar API alone, with one plane" },
    [SST_SIM_FAULT_SAME_STAMP] = { "same_stamp", 0, 1, "1: the stamp of the first frame for all" },
    [SST_SIM_FAULT_SLOW_OPEN_MS] = { "slow_open_ms", 0, 60000, "open() takes this long" },
};

const struct sim_fault_scope sim_camera_faults = {
    .name = "camera", .faults = sim_cam_faults, .count = SST_SIM_FAULTS_OF_CAMERA, .instances = 1
};
