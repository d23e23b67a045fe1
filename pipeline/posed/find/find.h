/* pipeline/posed/find/find.h - finds: places that stand out from forest and ground in the integral. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_FIND_FIND_H
#define SST_PIPELINE_POSED_FIND_FIND_H

#include "pipeline/posed/integral.h"

/** Connected pixels that stand out. */
struct sst_blob {
    struct sst_rect box; /* x1, y1: behind the last pixel */
    double x, y;         /* middle, weighted by the score */
    double score;        /* largest */
    int pixels;
};

enum sst_find_by {
    SST_FIND_CHOOSE,   /* integral for one channel, views for colour */
    SST_FIND_INTEGRAL, /* local score of the integral: warm bodies among cold leaves */
    SST_FIND_VIEWS,    /* Reed-Xiaoli score of each view, integrated: clothes among leaves and soil */
};

struct sst_find_config {
    enum sst_find_by by;
    int sign;         /* integral: 1: higher levels than around, -1: lower ones */
    double threshold; /* spreads; 0: by `alarms` */
    double alarms;    /* false finds a hectare that the background is expected to make; 0: the threshold's default */
    double coverage;  /* a place counts where at least this share of the most views see it */
    double window_m;  /* side of the window of means and spreads; lengths are in metres of the world */
    double least_m, most_m; /* diameter of a circle of a find's area */
    int least_views;        /* that show it: a leaf in the sun is seen by one; of few views at most half */
    double speed_m_s;       /* most of a walker, from moment to moment */
    int threads;
};

struct sst_find_config sst_find_defaults(void);

struct sst_found {
    struct sst_blob blob;       /* in the virtual picture */
    double at_mm[3];            /* on the surface, world axes; NAN: it has no place there */
    double size_m;              /* diameter of a circle of its area */
    double latitude, longitude; /* degrees; NAN where places are not geographic */
    int views;                  /* that show it, ... */
    int seen;                   /* ... of the views that look there */
    int best;                   /* view that shows it best; -1: none */
    double best_x, best_y;      /* px there */
    int moment;                 /* of the views; of several moments: the best view's, counted from 1 */
    double speed_m_s;           /* of several moments; 0: it stands */
    double heading_deg;         /* clockwise from north, or from the picture's top where places are not geographic; NAN: it stands */
};

/** Place of a find at one moment. */
struct sst_find_step {
    double at_mm[3];            /* NAN: not on the surface */
    double latitude, longitude; /* degrees; NAN where places are not geographic */
    double x, y;                /* px of the virtual picture */
    double score;               /* largest of this moment's own there; NAN: not covered */
    int views, seen;            /* as of finds */
    int best;                   /* view of this moment that shows it best; -1: none */
    double best_x, best_y;      /* px there */
};

/** Scene of a search: placed views of a folder, on a surface, as a virtual camera sees it. */
struct sst_find_scene {
    const struct sst_posed *posed;
    const char *dir;
    const struct sst_virtual *camera;
    const struct sst_surface *surface;
    double time_s; /* of several moments: of this one */
};

/** Finds, the highest score first, and maps of the virtual camera's size. */
struct sst_finds {
    struct sst_found *found; /* [count] */
    int count;
    int channels;
    struct sst_map_f32 integral[3]; /* [channels] means, levels; NAN: not seen */
    struct sst_map_f32 score;       /* NAN: not covered; of several moments: of ground cells, not pixels */
    struct sst_map_u16 views;
    double threshold; /* that was used */
    double alarms;    /* a hectare, that the background is expected to make at it; NAN: too few places to tell */
    double hectares;  /* of the surface that is covered */

    int moments;                /* 0: a search of one; then the rest is NULL */
    int middle;                 /* moment at which finds have their places and boxes */
    struct sst_finds *each;     /* [moments] maps of each, without finds; `integral` and `views` are there alone */
    struct sst_find_step *step; /* [count][moments] */
};
void sst_finds_fini(struct sst_finds *finds);

/** The same view with pixels of at least 2.5 cm on the surface, as a search wants them. */
struct sst_virtual sst_find_camera(const struct sst_virtual *camera, const struct sst_surface *surface);

/**
 * Find places on a surface that stand out (design/posed-find.md).
 *
 * @param out  out, initialised here; to be freed by sst_finds_fini() unless an error is returned
 * @return 0, -EINVAL (the camera does not meet the surface), -ENODATA (no view is placed), -EBADMSG (pictures that are
 * too small), -ENOMEM, or as
 * sst_posed_picture(); logged
 */
SST_MUST_CHECK int sst_posed_find(struct sst_finds *out, const struct sst_find_scene *scene,
                                  const struct sst_find_config *cfg);

/** Moments that a search of walkers takes, and how far, m, one may walk from the first to the last. */
#define SST_FIND_MOMENTS 32
#define SST_FIND_PATH_M  40.0

/**
 * Find persons, standing or walking straight at one speed, from moments of one world: scores of all moments are summed
 * along paths (design/posed-find.md).
 *
 * @param scene  [count] of rising times, with one camera and one surface
 * @param count  2 to SST_FIND_MOMENTS; from the first to the last moment at most SST_FIND_PATH_M at cfg->speed_m_s
 * @return as sst_posed_find(), -EINVAL also for counts and times; logged
 */
SST_MUST_CHECK int sst_posed_find_walkers(struct sst_finds *out, const struct sst_find_scene scene[], int count,
                                          const struct sst_find_config *cfg);

#endif
