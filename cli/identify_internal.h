/* cli/identify_internal.h - pictures of cameras of both kinds, to identify their positions. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CLI_IDENTIFY_INTERNAL_H
#define SST_CLI_IDENTIFY_INTERNAL_H

#include "capture/array/masks.h"
#include "cli/doctor_internal.h"

/* The first frames after a start are often damaged or not yet exposed. */
#define SKIP_FRAMES 2
#define PICTURE_NS  INT64_C(6000000000)

struct shot {
    struct sst_grab_device device; /* of a GenICam camera: its serial, name, and address as port */
    struct cli_place place;
    bool genicam;
    struct sst_image image; /* no plane: none received */
    int good;
    char why[256];
};

struct session {
    struct shot *shots; /* [SST_CAMERAS_MAX], V4L2 cameras in the order of ports, then GenICam cameras */
    int count;
    struct sst_masks *masks; /* of the shots; NULL: none */
    struct sst_masks_set *masked;
    bool connected[SST_CAMERAS_MAX]; /* positions, row by row, with a V4L2 camera that is there, asked for or not */
    /* of the running grab */
    struct sst_grab *grab;
    struct sst_genicam *genicam;
    int index[SST_CAMERAS_MAX], missing;
};

/** A running grab of either kind. */
struct identify_grab {
    int cameras;
    enum sst_grab_state (*state)(const struct session *s, int cam);
    int (*poll)(struct session *s); /* 100 ms at most; @return events or -errno */
};

/* identify.c: a frame becomes its camera's picture, unless the camera has one; reports of cameras. */
void identify_frame(struct session *s, struct sst_frame *f);
void identify_state(void *arg, int cam, enum sst_grab_state state, const char *why);

/** Wait until each camera of s->index has a picture or was refused, 6 s at most. @return 0 or -errno */
SST_MUST_CHECK int identify_wait(struct session *s, const struct identify_grab *grab);

/* identify_genicam.c */

/** Add bound GenICam cameras or, with a serial, id or address, the camera of that name; unbound cameras may belong to
 * another user.
 *  @return 0 or -errno */
SST_MUST_CHECK int identify_list_genicams(struct session *s, const struct sst_array_config *cfg, const char *serial,
                                          const char *port);

/** Take a picture of each GenICam camera, which runs on its own for it. A failure is recorded in its shot.
 *  @return 0 or -errno */
SST_MUST_CHECK int identify_genicams(struct session *s, const struct sst_array_config *cfg);

#endif
