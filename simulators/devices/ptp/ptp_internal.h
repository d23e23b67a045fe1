/* simulators/devices/ptp/ptp_internal.h - private declarations of this folder; code outside of it includes the
 * public header. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_PTP_PTP_INTERNAL_H
#define SST_SIMULATORS_DEVICES_PTP_PTP_INTERNAL_H

#include "simulators/devices/ptp/ptp_model.h"

/* --- codes of ISO 15740 ------------------------------------------------------------------------------------------- */

enum ptp_container {
    PTP_COMMAND = 1,
    PTP_DATA = 2,
    PTP_RESPONSE = 3,
    PTP_EVENT = 4,
};

enum ptp_operation {
    PTP_GET_DEVICE_INFO = 0x1001,
    PTP_OPEN_SESSION = 0x1002,
    PTP_CLOSE_SESSION = 0x1003,
    PTP_GET_STORAGE_IDS = 0x1004,
    PTP_GET_STORAGE_INFO = 0x1005,
    PTP_GET_NUM_OBJECTS = 0x1006,
    PTP_GET_OBJECT_HANDLES = 0x1007,
    PTP_GET_OBJECT_INFO = 0x1008,
    PTP_GET_OBJECT = 0x1009,
    PTP_GET_THUMB = 0x100a,
    PTP_DELETE_OBJECT = 0x100b,
    PTP_INITIATE_CAPTURE = 0x100e,
    PTP_RESET_DEVICE = 0x1010,
    PTP_GET_PROP_DESC = 0x1014,
    PTP_GET_PROP_VALUE = 0x1015,
    PTP_SET_PROP_VALUE = 0x1016,
    PTP_RESET_PROP_VALUE = 0x1017,
    PTP_GET_PARTIAL_OBJECT = 0x101b,
};

enum ptp_response {
    PTP_OK = 0x2001,
    PTP_GENERAL_ERROR = 0x2002,
    PTP_SESSION_NOT_OPEN = 0x2003,
    PTP_OPERATION_NOT_SUPPORTED = 0x2005,
    PTP_INVALID_STORAGE = 0x2008,
    PTP_INVALID_HANDLE = 0x2009,
    PTP_PROP_NOT_SUPPORTED = 0x200a,
    PTP_STORE_FULL = 0x200c,
    PTP_ACCESS_DENIED = 0x200f,
    PTP_NO_THUMBNAIL = 0x2010,
    PTP_DEVICE_BUSY = 0x2019,
    PTP_INVALID_PROP_VALUE = 0x201c,
    PTP_INVALID_PARAMETER = 0x201d,
    PTP_SESSION_ALREADY_OPEN = 0x201e,
};

enum ptp_event {
    PTP_EVENT_OBJECT_ADDED = 0x4002,
    PTP_EVENT_OBJECT_REMOVED = 0x4003,
    PTP_EVENT_PROP_CHANGED = 0x4006,
    PTP_EVENT_STORE_FULL = 0x400a,
    PTP_EVENT_CAPTURE_COMPLETE = 0x400d,
};

enum ptp_format {
    PTP_FORMAT_FOLDER = 0x3001,
    PTP_FORMAT_JPEG = 0x3801,
    PTP_FORMAT_DNG = 0x3811,
};

enum ptp_property {
    PTP_BATTERY_LEVEL = 0x5001,
    PTP_IMAGE_SIZE = 0x5003,
    PTP_COMPRESSION = 0x5004,
    PTP_F_NUMBER = 0x5007,
    PTP_FOCUS_MODE = 0x500a,
    PTP_EXPOSURE_TIME = 0x500d,
    PTP_EXPOSURE_MODE = 0x500e,
    PTP_EXPOSURE_INDEX = 0x500f,
};

/** Values of PTP_COMPRESSION, as a widespread vendor defines them. */
enum ptp_files {
    PTP_FILES_JPEG = 1,
    PTP_FILES_RAW = 4,
    PTP_FILES_BOTH = 5,
};

#define PTP_HEADER_BYTES 12
#define PTP_PARAMETERS   5
#define PTP_STORAGE      0x00010001u
#define PTP_ALL          0xffffffffu

/* --- bytes on the wire (ptp_wire.c) ------------------------------------------------------------------------------- */

/** A growing buffer, little-endian. */
struct ptp_bytes {
    uint8_t *data;
    size_t size;
    int room;
    bool failed; /* no memory */
};

void ptp_put(struct ptp_bytes *b, uint64_t value, int bytes);
void ptp_put_bytes(struct ptp_bytes *b, const uint8_t *data, size_t bytes);
/** A string of at most 254 ASCII characters: their number with the end, then UTF-16. "" is one zero. */
void ptp_put_text(struct ptp_bytes *b, const char *text);
/** An array of 16-bit numbers with its length. */
void ptp_put_codes(struct ptp_bytes *b, const uint16_t *codes, size_t count);
void ptp_free(struct ptp_bytes *b);

uint32_t ptp_get(const uint8_t *data, int bytes);

/* --- settings (ptp_props.c) --------------------------------------------------------------------------------------- */

#define PTP_PROPERTIES 8

struct ptp_props {
    uint32_t value[PTP_PROPERTIES]; /* in the order of the table */
    uint32_t exposure_time;         /* at power-on, 0.1 ms */
    char size_text[24];             /* "640x480" */
};

void ptp_props_init(struct ptp_props *props, const struct sst_sim_ptp_config *cfg);
const uint16_t *ptp_props_codes(void); /* [PTP_PROPERTIES] */
uint32_t ptp_props_value(const struct ptp_props *props, uint16_t code);
/** Data of GetDevicePropDesc, GetDevicePropValue. @return PTP response */
unsigned ptp_props_describe(const struct ptp_props *props, uint16_t code, struct ptp_bytes *out);
unsigned ptp_props_read(const struct ptp_props *props, uint16_t code, struct ptp_bytes *out);
unsigned ptp_props_write(struct ptp_props *props, uint16_t code, const uint8_t *data, size_t bytes);
/** Battery: the value is the camera's own. */
void ptp_props_set(struct ptp_props *props, uint16_t code, uint32_t value);

/* --- the card (ptp_card.c) ---------------------------------------------------------------------------------------- */

#define PTP_FILES_MAX     1000
#define PTP_DCIM          1u /* handle of the folder DCIM, and of the folder in it */
#define PTP_FOLDER        2u
#define PTP_FIRST_PICTURE 16u

struct ptp_file {
    uint32_t handle;
    uint16_t format;
    char name[16]; /* "SST_0001.JPG" */
    uint8_t *data;
    size_t bytes;
    bool sent_short; /* fault "corrupt" 3: the next download lacks its end */
    bool sent;       /* to a host */
};

struct ptp_card {
    int64_t capacity;
    int width, height;
    struct ptp_file *file; /* [files], oldest first */
    int files, room;
    uint32_t next_handle;
};

int64_t ptp_card_free(const struct ptp_card *card);
struct ptp_file *ptp_card_find(const struct ptp_card *card, uint32_t handle);
/** Takes data. @return the file, or NULL: no memory, data is freed */
struct ptp_file *ptp_card_add(struct ptp_card *card, int number, bool raw, uint8_t *data, size_t bytes);
/** @param handle  PTP_ALL: all files. @return PTP response */
unsigned ptp_card_delete(struct ptp_card *card, uint32_t handle);
unsigned ptp_card_info(const struct ptp_card *card, uint32_t handle, struct ptp_bytes *out);
/** Data of GetObjectHandles; NULL out: only counts. @return PTP response */
unsigned ptp_card_list(const struct ptp_card *card, uint32_t storage, uint32_t format, uint32_t parent,
                       struct ptp_bytes *out, uint32_t *count);
void ptp_card_storage(const struct ptp_card *card, bool full, struct ptp_bytes *out);
void ptp_card_fini(struct ptp_card *card);

/* --- the camera (ptp_model.c, ptp_shot.c) ------------------------------------------------------------------------- */

#define PTP_EVENTS 32
#define PTP_BUFFER 4 /* exposures that are not on the card yet */
#define PTP_LATE   8 /* announcements that come late */

/** An exposure that is written to the card. */
struct ptp_taken {
    int shot;
    int64_t due_ns; /* on the card */
    int files;
    struct {
        uint8_t *data;
        size_t bytes;
        bool raw;
    } file[2];
};

struct ptp_phase {
    struct ptp_bytes bytes; /* a container */
    size_t at;
    bool object;  /* the file of an object: may be unplugged in the middle */
    bool closing; /* all bytes are read, a packet of length 0 must end them */
    struct ptp_phase *next;
};

struct ptp_command {
    uint16_t code;
    uint32_t transaction, parameter[PTP_PARAMETERS];
    int parameters;
};

struct sst_sim_ptp {
    struct sst_sim_ptp_config cfg; /* fixed after create */
    struct ptp_props props;
    struct ptp_card card;
    /* the session */
    bool open, silent;
    struct ptp_command command; /* waits for its data phase if `collecting` */
    bool collecting;
    struct ptp_bytes collected;
    struct ptp_phase *out; /* phases to send, in order */
    uint8_t event[PTP_EVENTS][PTP_HEADER_BYTES + 4];
    int events;
    /* exposures */
    int64_t expose_ns; /* start of the exposure; 0: none was released */
    int64_t busy_until_ns, mirror_until_ns;
    int shots;
    struct ptp_taken taken[PTP_BUFFER]; /* oldest first */
    int taken_count;
    struct {
        int64_t due_ns;
        uint16_t code;
        uint32_t parameter;
    } late[PTP_LATE];
    int late_count;
};

void ptp_event(struct sst_sim_ptp *p, uint16_t code, uint32_t parameter);
double ptp_fault(const struct sst_sim_ptp *p, enum sst_sim_ptp_fault fault);
/** If the fault is set: spend it. @return its value before */
double ptp_fault_take(struct sst_sim_ptp *p, enum sst_sim_ptp_fault fault);

/** InitiateCapture. @return PTP response */
unsigned ptp_shot_release(struct sst_sim_ptp *p, int64_t now_ns);
void ptp_shot_fini(struct sst_sim_ptp *p);

#endif
