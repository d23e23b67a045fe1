/* config/sstd.h - the configuration of sstd: /etc/sst/sstd.yaml and the files of conf.d beside it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CONFIG_SSTD_H
#define SST_CONFIG_SSTD_H

#include "config/array.h"

#define SST_ZONES_MAX    16
#define SST_HOOKS_MAX    16
#define SST_HOOK_ARGS    16
#define SST_TRIGGERS_MAX 32

#define SST_ZONE_POINTS 16
#define SST_ZONE_LABELS 8

/** Crossings of a line that count. Forward: to the right-hand side, seen along the line from its first point. */
enum sst_line_direction {
    SST_LINE_BOTH = 0,
    SST_LINE_FORWARD = 1,
    SST_LINE_BACKWARD = 2,
};

/** A region of the reference view, or a line across it, in fractions 0..1 of its width and height. */
struct sst_zone {
    char name[32];         /* [a-z0-9_-]+ */
    double x0, y0, x1, y1; /* a rectangle; */
    char points[SST_CONFIG_TEXT_MAX]; /* or a polygon, "x,y x,y x,y", or a line, "x,y x,y"; sst_zone_corners() gives all */
    double near_px, far_px;           /* limits of its depth; INFINITY, -INFINITY: none */
    char labels[SST_ZONE_LABELS][32]; /* of visits; ends at ""; none: all */
    bool mask;                        /* its inside is ignored */
    bool line;                        /* two points; a visitor that crosses it has been in the zone */
    enum sst_line_direction direction; /* of a line */
};

/** Trigger of event recording: something changes in a zone, a label covers a fraction of it, or a visit lasts. */
struct sst_record_trigger {
    int zone;              /* index; -1: the whole picture */
    char label[64];        /* "": any change */
    bool visit;            /* of tracked objects; share does not matter */
    double share;          /* fraction of the zone that changes or has the label, 0..1 */
    double begin_s, end_s; /* duration of the condition to start an event, of its absence to end it */
};

enum sst_record_mode {
    SST_RECORD_OFF = 0, /* on demand only */
    SST_RECORD_CONTINUOUS = 1,
    SST_RECORD_EVENT = 2,
};

/** Automatic recordings of less than every set, while no other recording is made. */
enum sst_reduced_mode {
    SST_REDUCED_OFF = 0,
    SST_REDUCED_VIEW = 1,    /* the main view, and a set a minute */
    SST_REDUCED_CHANGED = 2, /* every Nth set if something changed since the one before, and a set a minute */
    SST_REDUCED_SETS = 3,    /* every Nth set */
    SST_REDUCED_TILES = 4,   /* as CHANGED, of each set only differences from the last whole one, one a minute */
};

enum sst_rtsp_codec {
    SST_RTSP_H264 = 0,
    SST_RTSP_MJPEG = 1,
};

struct sst_hook {
    char event[64];                                /* type, "*" for all; see daemon/events/events.h */
    char argv[SST_HOOK_ARGS][SST_CONFIG_TEXT_MAX]; /* no shell; argv[0] is an absolute path; ends at "" */
};

/** Values of enum sst_render_method. */
enum sst_live_method {
    SST_LIVE_REFOCUS = 0,
    SST_LIVE_SST = 1,
    SST_LIVE_CLEAR = 2,
};

struct sst_live_settings { /* live: */
    bool enabled;
    char calibration[SST_CONFIG_TEXT_MAX]; /* "": views are not rectified */
    double plane_mm;                       /* of rectification; negative: as in the calibration */
    char poses[SST_CONFIG_TEXT_MAX];       /* of cameras that stand anywhere: a calibration or a posed light field; "":
                                              the array is a lattice */
    double surface_m;                      /* with poses: distance of the plane; 0: the ground, found between ... */
    double near_m, far_m;                  /* ... these distances; 0: the points of the light field's scene decide */
    double fit_every_min;                  /* the ground is found again; 0: at the start and on demand */
    int compare_px;                        /* width of the pictures by which views are compared, about */
    char model[SST_CONFIG_TEXT_MAX];       /* segmentation network; "": the installed one */
    int black_level, white_level;          /* of 16-bit frames, that are shown black and white; white 0: found */
    double range_min_px, range_max_px;     /* disparities searched; equal: estimated */
    double rate_hz;                        /* maximum number of sets processed per second; 0: no limit */
    int threads;                           /* 0: all processors */
    bool skip_change, skip_labels;         /* S1, S4 of design.md, 5.5 */
    char device[SST_CONFIG_TEXT_MAX];      /* of pictures and labels: "cpu", "auto", "gpu" or a name */
    int device_memory_mb;                  /* that it may use; 0: three quarters */
    enum sst_live_method method;           /* of the main view, and at first of the others, as all below */
    double cut_px;                         /* clear: nearer surfaces are removed; NaN: found automatically */
    char remove_label[32];                 /* clear: surfaces with this label, too; "": none */
    bool outline_moving, keep_moving;      /* clear: outlines of removed tracks; no track is removed */
    bool demo_labels;                      /* labels of simulated scenes alone are offered, too */
    bool outline, tint;                    /* clear: outlines of removed objects; old pixels tinted */
    double focus_px;                       /* of the main view at the start; NaN: behind the foreground */
    double sigma_px, c1, c2, label_factor; /* of the renderer; its defaults */
    double hidden_alarms_per_hour; /* false visits accepted of things behind leaves; 0: they are not searched */
    bool verify_rays; /* where maps have low confidence, weight rays by whether their colours agree at the focus */
    int jpeg_quality;
};

#define SST_PUSH_HOSTS 16

/** Notifications of browsers without an open page. */
struct sst_push_settings {
    bool enabled;
    int hosts; /* push services that are allowed; 0: the known ones */
    char host[SST_PUSH_HOSTS][128];
    bool private_hosts;                 /* may have addresses of private networks */
    char ca_file[SST_CONFIG_TEXT_MAX];  /* ""; the system's authorities */
    char contact[128];                  /* mailto: or https:, for the push services; "" */
    double cool_down_s;                 /* between messages to a browser */
};

struct sst_config {
    struct sst_array_config array; /* array: cameras: trigger: sets: rig: */
    char site[128];                /* name of the place, burnt into videos; "": the machine's name */
    struct sst_live_settings live;
    int zones; /* zones: */
    struct sst_zone zone[SST_ZONES_MAX];
    struct {                              /* control: */
        char socket[SST_CONFIG_TEXT_MAX]; /* /run/sst/control.sock */
        char group[64];                   /* its members may control; "": only root and the daemon's user */
        char view_group[64];              /* sst-view; its members may view; "": none */
    } control;
    struct { /* web: */
        bool enabled;
        char address[64]; /* 127.0.0.1 */
        int port;
        char host[256]; /* additional host name under which it is reached (allow-list of Host); "" */
        char url[SST_CONFIG_TEXT_MAX];        /* address of the page in links, such as a proxy's; "": made of the others */
        char token_file[SST_CONFIG_TEXT_MAX]; /* created at the first start, 0600; beside it TOKEN_FILE.view for viewing
                                               */
        char zones_file[SST_CONFIG_TEXT_MAX]; /* written by the service; "": zones cannot be drawn */
        char tls_certificate[SST_CONFIG_TEXT_MAX], tls_key[SST_CONFIG_TEXT_MAX];
        bool insecure;        /* allow a non-loopback address without TLS */
        int clients, streams; /* maximum connections; maximum video streams among them */
        double stream_hz;     /* maximum pictures per second of each stream */
        int views;            /* maximum clients with their own settings */
    } web;
    struct { /* proxy: */
        char address[SST_CONFIG_PROXIES][64];
        int addresses;
        char user_header[64], right[4][16];
        int rights;
    } proxy;
    struct { /* rtsp: */
        bool enabled;
        char address[64];
        int port;
        enum sst_rtsp_codec codec;
        bool insecure; /* allow a non-loopback address without a password */
        char user[64], password_file[SST_CONFIG_TEXT_MAX];
    } rtsp;
    struct { /* onvif: */
        bool enabled;
        char address[64];
        int port;
        char host[256]; /* that its answers name; "": the address at which the client has reached it */
        char name[64];
        char user[64], password_file[SST_CONFIG_TEXT_MAX]; /* "": those of rtsp */
        bool discovery;
    } onvif;
    struct {                           /* storage: */
        char dir[SST_CONFIG_TEXT_MAX]; /* /var/lib/sst */
        enum sst_record_mode mode;
        double quota_gb, min_free_gb, max_age_days; /* 0: no limit */
        double by_hand_gb, by_hand_max_age_days;    /* of recordings on demand; 0: half of the space; no limit */
        bool record_view;                           /* also record the main view */
        enum sst_reduced_mode reduced;
        int reduced_every; /* N of the reduced modes */
        double reduced_gb, reduced_max_age_days; /* 0: a third of the space; no limit */
        int visits_days;                            /* 0: none are kept */
        double segment_s, sync_s;
        double preroll_s, postroll_s;
        int ring_mb;  /* memory for the most recent sets */
        int triggers; /* record_on: */
        struct sst_record_trigger trigger[SST_TRIGGERS_MAX];
    } storage;
    struct { /* mqtt: */
        bool enabled;
        char host[256];
        int port;
        char user[64], password_file[SST_CONFIG_TEXT_MAX], ca_file[SST_CONFIG_TEXT_MAX];
        bool insecure;       /* allow a host other than this one without TLS */
        char topic[128];     /* sst */
        char discovery[128]; /* homeassistant; "": none */
        double picture_s;    /* minimum time between pictures of the main view; 0: none */
    } mqtt;
    struct sst_push_settings push;
    int hooks; /* hooks: */
    struct sst_hook hook[SST_HOOKS_MAX];
};

/** Effect of a change of a key. */
enum sst_reload_class {
    SST_RELOAD_LIVE = 0,    /* applies at once */
    SST_RELOAD_CAMERAS = 1, /* restarts capturing for a moment, and the live picture */
    SST_RELOAD_DAEMON = 2,  /* needs a restart of the service; until then the old value stays in effect */
    SST_RELOAD_PICTURE = 3, /* restarts the live picture, capturing continues */
};

/** A key with different values. */
struct sst_config_change {
    char key[96];                                                 /* "cameras.rate_hz", "zones[1].x0", "cameras.bind" */
    char before[SST_CONFIG_TEXT_MAX], after[SST_CONFIG_TEXT_MAX]; /* as written in YAML; keys contain no secrets */
    enum sst_reload_class class_;
};

void sst_config_defaults(struct sst_config *cfg);

/**
 * Read `path` and then, in the order of their names, the *.yaml of conf.d beside it over the values in cfg (see
 * sst_config_defaults()); a later file overrides key by key, lists as a whole. Strict: all faults of all files are
 * logged, with file:line:column. At last web.zones_file, if it exists, which may have `zones` alone.
 *
 * @param path  NULL: /etc/sst/sstd.yaml, and without it the defaults (conf.d is read in both cases)
 * @return 0, -ENOENT/-EACCES, -EBADMSG, -ENOMEM; cfg untouched on failure.
 */
SST_MUST_CHECK int sst_config_read(struct sst_config *cfg, const char *path);

/** Check the configuration with `zones` in place of web.zones_file, which is not read: would the service accept them?
 *  @param zones  text of such a file */
SST_MUST_CHECK int sst_config_try_zones(struct sst_config *cfg, const char *path, const char *zones);

/** Address of the page for links, without a final slash: web.url, or made of host or address, port and TLS. @param
 *  out  [512]; "": there is no page, or its address is not known */
void sst_config_page(char out[512], const struct sst_config *cfg);

/** The text of web.zones_file for zones. @return to free with free(); NULL: no memory */
char *sst_zones_text(const struct sst_zone *zone, int zones);

/** Corners of a zone, in fractions of the picture. @param x, y  out, [SST_ZONE_POINTS]
 *  @return number of corners, 2: the ends of a line; 0: `points` is neither line nor polygon */
int sst_zone_corners(const struct sst_zone *zone, double *x, double *y);

/** Changes from one configuration to the other, in the order of the file. *out to free with free().
 *  @return number of changes, or -ENOMEM */
SST_MUST_CHECK int sst_config_diff(struct sst_config_change **out, const struct sst_config *before,
                                   const struct sst_config *after);

/** Copy the values of `running` that only a restart can change to `to`, so that a reload can apply it. */
void sst_config_keep(struct sst_config *to, const struct sst_config *running);

/** "live", "restart-camera", "restart-daemon", "restart-live". */
const char *sst_reload_class_name(enum sst_reload_class class_);

#endif
