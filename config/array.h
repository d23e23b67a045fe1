/* config/array.h - configuration of the array and of capturing: the keys that both sst capture and sstd read. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CONFIG_ARRAY_H
#define SST_CONFIG_ARRAY_H

#include <stdbool.h>

#include "base/frame.h"

#define SST_CONFIG_TEXT_MAX     256
#define SST_CONFIG_PROXIES      8
#define SST_CONFIG_CONTROLS_MAX 32
#define SST_CONFIG_LINES_MAX    64
#define SST_CONFIG_PARTS_MAX    16    /* cameras in a picture */
#define SST_CONFIG_SIDE_MAX     16384 /* px of a picture */

enum sst_config_source {
    SST_CONFIG_GPIO = 0,
    SST_CONFIG_SOFTWARE = 1,
    SST_CONFIG_FREE_RUN = 2,
    SST_CONFIG_EXTERNAL = 3, /* edges of another host's trigger on the input `loopback` */
};

/** Driver of a camera. */
enum sst_config_kind {
    SST_CONFIG_V4L2 = 0,
    SST_CONFIG_GENICAM = 1, /* GigE Vision, USB3 Vision */
};

/** Start of an exposure of GenICam cameras, at the array's trigger. */
enum sst_config_genicam {
    SST_CONFIG_WIRE = 0,
    SST_CONFIG_COMMAND = 1, /* of the camera's own software trigger */
    SST_CONFIG_ACTION = 2,  /* one datagram for all */
    SST_CONFIG_NONE = 3,    /* they run on their own */
};

/** Files of a still camera. */
enum sst_config_files {
    SST_CONFIG_JPEG = 0,
    SST_CONFIG_RAW = 1,
    SST_CONFIG_RAW_JPEG = 2,
};

enum sst_config_focus {
    SST_CONFIG_FOCUS_LEAVE = 0,
    SST_CONFIG_FOCUS_MANUAL = 1,
    SST_CONFIG_FOCUS_LOCKED = 2,
};

/** Role of a host in the array (docs/use/hosts.md). */
enum sst_config_role {
    SST_CONFIG_SINGLE = 0, /* the only one */
    SST_CONFIG_NODE = 1,   /* captures some of the cameras and sends their sets to the head */
    SST_CONFIG_HEAD = 2,   /* assembles the sets of all nodes, and of cameras of its own */
};

#define SST_CONFIG_NODES_MAX 16
#define SST_CONFIG_MASKS_MAX 16
#define SST_MASK_POINTS      16

/** A region that is black in frames before anything else reads them: of one camera's frames, or of the reference view
 *  between two depths, in the frames of all cameras. */
struct sst_config_mask {
    char name[32];         /* [a-z0-9_-]+ */
    int row, col;          /* of the camera; both -1: the reference view */
    double x0, y0, x1, y1; /* a rectangle, in fractions of width and height; */
    char points[SST_CONFIG_TEXT_MAX]; /* or a polygon, "x,y x,y x,y"; sst_mask_corners() gives both */
    double near_px, far_px;           /* of the reference view: disparities where it begins and ends; near INFINITY: none */
};

struct sst_config_camera {
    int row, col;
    enum sst_config_kind kind;
    char serial[64], port[64]; /* either one; of a GenICam camera its serial or Vendor-Model-Serial, and its address */
    int node;                  /* which of its video nodes, from 1; 0: the first that fits */
    int line;                  /* index of the trigger line that exposes it */
};

struct sst_array_config {
    enum sst_config_role role;
    /* array: */
    int rows, cols;
    double spacing_mm;
    /* cameras: */
    uint32_t fourcc;
    int width, height, buffers, stall_ms;
    char split[8]; /* "RxC": cameras of width x height in the picture of each device; "": 1x1 */
    double rate_hz;
    bool port_power, check_frozen;
    int controls;
    struct {
        char name[64];
        int64_t value;
    } control[SST_CONFIG_CONTROLS_MAX];
    int bound; /* cameras given by `bind`; 0: all connected cameras by port, in grid order */
    struct sst_config_camera camera[SST_CAMERAS_MAX];
    /* trigger: */
    enum sst_config_source source;
    char chip[256];
    int lines;
    char line[SST_CONFIG_LINES_MAX][64];
    int delay_us[SST_CONFIG_LINES_MAX];
    char loopback[64];
    bool active_low;
    int pulse_us;
    double trigger_hz;
    struct { /* genicam: */
        enum sst_config_genicam trigger;
        char line[64], pixel_format[64];
        double exposure_us, gain; /* 0 and NaN: unchanged */
        int packet_bytes, packet_delay_ns;
        bool resend, ptp;
        int device_key, group_key, group_mask, action_delay_us;
        char action_address[64];
    } genicam;
    /* sets: */
    int window_us; /* a frame within this time of the trigger (plus delay) belongs to it; 0: 0.4 of the period */
    int wait_ms;   /* a set closes this long after its trigger, complete or not; 0: 2.5 periods, at least 250 ms */
    int skew_limit_us;
    /* rig: */
    char rig_bus[SST_CONFIG_TEXT_MAX], rig_profile[SST_CONFIG_TEXT_MAX];
    int rig_axes, rig_unit[3];
    double rig_travel_min_mm[3], rig_travel_max_mm[3], rig_um_per_count[3], rig_tolerance_um;
    double rig_speed_mm_s, rig_accel_mm_s2; /* 0: setting of the drives */
    int rig_response_ms, rig_retries, rig_reconnect_ms, rig_settle_ms;
    /* still: "" leaves a setting as the camera has it */
    char still_exposure[64], still_aperture[64], still_iso[64], still_format[64];
    enum sst_config_files still_files;
    enum sst_config_focus still_focus;
    int still_mirror_ms, still_card_ms, still_quiet_ms, still_response_ms, still_reopen_ms, still_battery_percent;
    bool still_keep;
    struct { /* hosts: */
        char head[64], head_name[64]; /* of a node: where the head is, the name in its certificate */
        char address[64];             /* of a head: to listen on */
        int port;
        int nodes; /* of a head: names in the certificates of its nodes */
        char node[SST_CONFIG_NODES_MAX][64];
        char ca[SST_CONFIG_TEXT_MAX], certificate[SST_CONFIG_TEXT_MAX], key[SST_CONFIG_TEXT_MAX];
        bool datagrams; /* pictures go by datagrams, where both hosts can; else over TLS */
        int parity;     /* of a node: datagrams more than needed, in percent */
        int queue;      /* of a node: sets that wait to be sent */
        bool skip_unchanged;
    } hosts;
    /* privacy: */
    int masks;
    struct sst_config_mask mask[SST_CONFIG_MASKS_MAX];
    char mask_calibration[SST_CONFIG_TEXT_MAX]; /* live.calibration, if a mask is of the reference view; "" */
    int64_t mask_stamp;                         /* of that file: another one when it is written again; 0: none */
};

/** Number of bound cameras of a kind. */
int sst_array_count(const struct sst_array_config *cfg, enum sst_config_kind kind);

/** One trigger exposes all cameras: of this host, or of all hosts. Timer ticks expose only GenICam cameras. */
bool sst_array_triggered(const struct sst_array_config *cfg);

/** Sets per second, as configured. */
static inline double sst_array_sets_hz(const struct sst_array_config *cfg)
{
    return cfg->source == SST_CONFIG_FREE_RUN && cfg->role != SST_CONFIG_HEAD ? cfg->rate_hz : cfg->trigger_hz;
}

/** Corners of a mask, in fractions of the picture. @param x, y  out, [SST_MASK_POINTS]
 *  @return number of corners; 0: `points` is no polygon */
int sst_mask_corners(const struct sst_config_mask *mask, double *x, double *y);

/** Whether both mask the same regions by the same calibration. */
bool sst_array_same_masks(const struct sst_array_config *a, const struct sst_array_config *b);

void sst_array_config_defaults(struct sst_array_config *cfg);

/** Rows and columns of cameras in the picture of a device. @return their number */
int sst_array_split(const struct sst_array_config *cfg, int split[2]);

/**
 * Position in the grid of camera n, from 0, in the order of devices and of parts within each: row by row, and of split
 * pictures in blocks of their form where the grid divides into them.
 */
void sst_array_place(const struct sst_array_config *cfg, int n, int *row, int *col);

/** Why pictures of this format and size cannot be split: one sentence. @return false: they can */
bool sst_array_split_fault(const struct sst_array_config *cfg, char *why, size_t size);

/**
 * Read a configuration file (YAML; config/sstd.yaml explains every key) and the parts of conf.d beside it over the
 * defaults, like sst_config_read(); keys of the service are allowed and ignored.
 *
 * @param path  NULL: /etc/sst/sstd.yaml if it exists, else the defaults (conf.d is read in both cases)
 * @return 0, -ENOENT/-EACCES, -EBADMSG (all faults logged with file:line:column), -ENOMEM; cfg untouched on failure.
 */
SST_MUST_CHECK int sst_array_config_read(struct sst_array_config *cfg, const char *path);

/** V4L2 pixel format of a name ("MJPEG", "YUYV", "GREY", "Y16", "RGGB8" ...) or its four characters; 0: unknown. */
uint32_t sst_array_format(const char *name);
/** The name of a format; NULL: not supported. */
const char *sst_array_format_name(uint32_t fourcc);

#endif
