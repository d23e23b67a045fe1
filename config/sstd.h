/* config/sstd.h - everything that sstd is told: /etc/sst/sstd.yaml and the files of conf.d beside it. */
#ifndef SST_CONFIG_SSTD_H
#define SST_CONFIG_SSTD_H

#include "config/array.h"

#define SST_ZONES_MAX    16
#define SST_HOOKS_MAX    16
#define SST_HOOK_ARGS    16
#define SST_TRIGGERS_MAX 32

/** A part of the reference view, in shares 0..1 of its width and height. */
struct sst_zone {
    char name[32]; /* [a-z0-9_-]+ */
    double x0, y0, x1, y1;
};

/** When to record on event: something changes in a zone, or a label covers a share of it. */
struct sst_record_trigger {
    int zone;              /* index; -1: the whole picture */
    char label[64];        /* "": any change */
    double share;          /* of the zone that changes or bears the label, 0..1 */
    double begin_s, end_s; /* it must be so for this long to begin; it must not for this long to end */
};

enum sst_record_mode {
    SST_RECORD_OFF = 0, /* when asked for */
    SST_RECORD_CONTINUOUS = 1,
    SST_RECORD_EVENT = 2,
};

enum sst_rtsp_codec {
    SST_RTSP_H264 = 0,
    SST_RTSP_MJPEG = 1,
};

struct sst_hook {
    char event[64];                                /* type, "*" for all; see daemon/events/events.h */
    char argv[SST_HOOK_ARGS][SST_CONFIG_TEXT_MAX]; /* no shell; argv[0] is an absolute path; ends at "" */
};

struct sst_live_settings { /* live: */
    bool enabled;
    char calibration[SST_CONFIG_TEXT_MAX]; /* "": views are as the cameras saw them */
    double plane_mm;                       /* of rectification; negative: the calibration's */
    char model[SST_CONFIG_TEXT_MAX];       /* segmentation network; "": the one that ships */
    double range_min_px, range_max_px;     /* disparities searched; equal: estimated */
    double rate_hz;                        /* sets processed per second at most; 0: as the machine allows */
    int threads;                           /* 0: all processors */
    bool skip_change, skip_labels;         /* S1, S4 of DESIGN 5.5 */
    double focus_px;                       /* of the main view at the start; NaN: behind what is in front */
    double sigma_px, c1, c2, label_factor; /* of the renderer; its defaults */
    bool verify_rays;                      /* where maps are poor, rays count whose colours agree at the focus */
    int jpeg_quality;
};

struct sst_config {
    struct sst_array_config array; /* array: cameras: trigger: sets: rig: */
    struct sst_live_settings live;
    int zones; /* zones: */
    struct sst_zone zone[SST_ZONES_MAX];
    struct {                              /* control: */
        char socket[SST_CONFIG_TEXT_MAX]; /* /run/sst/control.sock */
        char group[64];                   /* whose members may control; "" root and the daemon's user alone */
        char view_group[64];              /* whose members may look; "" none */
    } control;
    struct { /* web: */
        bool enabled;
        char address[64]; /* 127.0.0.1 */
        int port;
        char host[256]; /* further name under which it is reached (allow-list of Host); "" */
        char
            token_file[SST_CONFIG_TEXT_MAX]; /* made at the first start, 0600; next to it TOKEN_FILE.view for looking */
        char tls_certificate[SST_CONFIG_TEXT_MAX], tls_key[SST_CONFIG_TEXT_MAX];
        bool insecure;        /* another address than loopback without TLS */
        int clients, streams; /* connections, of them pictures that move */
        double stream_hz;     /* pictures per second for each of them at most */
        int views;            /* views with settings of their own at a time */
    } web;
    struct { /* rtsp: */
        bool enabled;
        char address[64];
        int port;
        enum sst_rtsp_codec codec;
        bool insecure; /* another address than loopback without a password */
        char user[64], password_file[SST_CONFIG_TEXT_MAX];
    } rtsp;
    struct {                           /* storage: */
        char dir[SST_CONFIG_TEXT_MAX]; /* /var/lib/sst */
        enum sst_record_mode mode;
        double quota_gb, min_free_gb, max_age_days; /* 0: no limit */
        double by_hand_gb, by_hand_max_age_days;    /* of what somebody asked for; 0: half of the room; no limit */
        bool record_view;                           /* the main view as well */
        double segment_s, sync_s;
        double preroll_s, postroll_s;
        int ring_mb;  /* memory that holds the sets of the last moments */
        int triggers; /* record_on: */
        struct sst_record_trigger trigger[SST_TRIGGERS_MAX];
    } storage;
    struct { /* mqtt: */
        bool enabled;
        char host[256];
        int port;
        char user[64], password_file[SST_CONFIG_TEXT_MAX], ca_file[SST_CONFIG_TEXT_MAX];
        char topic[128];     /* sst */
        char discovery[128]; /* homeassistant; "": none */
        double picture_s;    /* a picture of the main view at most this often; 0: none */
    } mqtt;
    int hooks; /* hooks: */
    struct sst_hook hook[SST_HOOKS_MAX];
};

/** What a change of a key takes. */
enum sst_reload_class {
    SST_RELOAD_LIVE = 0,    /* applies at once */
    SST_RELOAD_CAMERAS = 1, /* capturing starts anew, for a moment, and the live picture with it */
    SST_RELOAD_DAEMON = 2,  /* needs a restart of the service; until then the old value holds */
    SST_RELOAD_PICTURE = 3, /* the live picture starts anew, capturing goes on */
};

/** A key whose value differs. */
struct sst_config_change {
    char key[96];                                                 /* "cameras.rate_hz", "zones[1].x0", "cameras.bind" */
    char before[SST_CONFIG_TEXT_MAX], after[SST_CONFIG_TEXT_MAX]; /* as written in YAML; secrets do not stand in keys */
    enum sst_reload_class class_;
};

void sst_config_defaults(struct sst_config *cfg);

/**
 * Read over what cfg holds (see sst_config_defaults()) `path` and then, in the order of their names, the *.yaml of
 * conf.d beside it; a later file overrides key by key, lists as a whole. The same keys as sst capture reads; strict:
 * all faults of all files are logged, with file:line:column.
 *
 * @param path  NULL: /etc/sst/sstd.yaml, and without that the defaults (conf.d is read all the same)
 * @return 0, -ENOENT/-EACCES, -EBADMSG, -ENOMEM; cfg untouched on failure.
 */
SST_MUST_CHECK int sst_config_read(struct sst_config *cfg, const char *path);

/** What going from one configuration to the other would change, in the order of the file. *out to free with free().
 *  @return number of changes, or -ENOMEM */
SST_MUST_CHECK int sst_config_diff(struct sst_config_change **out, const struct sst_config *before,
                                   const struct sst_config *after);

/** Give `to` the values of `running` where another one takes a restart: what a reload may apply. */
void sst_config_keep(struct sst_config *to, const struct sst_config *running);

/** "live", "restart-camera", "restart-daemon", "restart-live". */
const char *sst_reload_class_name(enum sst_reload_class class_);

#endif
