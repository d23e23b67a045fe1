/* pipeline/step/planes.h - views of a light field on a device, as planes of words that all steps and shaders read.
 *
 * A plane has a place for each view, as far as memory goes; the view that was used least recently gives its place up.
 * The layout of the words: pipeline/kernels/planes.glsl.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_STEP_PLANES_H
#define SST_PIPELINE_STEP_PLANES_H

#include "pipeline/gpu/gpu.h"
#include "pipeline/image/image.h"

#define SST_PLANE_VIEWS 256

enum sst_step_plane {
    SST_PLANE_COLOUR = 0,  /* R, G, B from the lowest byte up, 255 if the pixel counts */
    SST_PLANE_REDUCED = 1, /* the same at half of the size */
    SST_PLANE_MAP = 2,     /* at the size that is matched: disparity, confidence, SST_MAP_AGREED, result of the check */
    SST_PLANE_FEATURES = 3, /* [height][SST_PLANE_FEATURE_WORDS][width] of four components each */
    /* Of the step in work, of the size of maps: */
    SST_PLANE_BEFORE = 4,  /* SST_PLANE_MAP before the step changed it */
    SST_PLANE_DERIVED = 5, /* words that the step derives of other planes (struct sst_step) */
    SST_PLANES
};

#define SST_PLANE_FEATURE_WORDS 16

/* Bits of a word of SST_PLANE_MAP above 16 of the disparity and 8 of its confidence. */
#define SST_MAP_AGREED      (1U << 24) /* carried: the sources agree */
#define SST_MAP_CHECK_SHIFT 25         /* enum sst_disparity_check, 2 bits */

/** Part of a buffer. */
struct sst_gpu_range {
    struct sst_gpu_buffer *buffer; /* NULL: none */
    size_t offset;                 /* bytes, a multiple of SST_GPU_ALIGN */
};

/** Maps of a view on the host that a plane is made of; maps that the plane does not have may be NULL. */
struct sst_plane_source {
    const struct sst_image *image; /* at full size, or that of SST_PLANE_REDUCED for this */
    const struct sst_map_u8 *seen; /* NULL or without memory: every pixel counts */
    const struct sst_map_u16 *disp;
    const struct sst_map_u8 *confidence;
    const struct sst_map_u8 *agreed, *checked; /* NULL or without memory: 0 */
    const uint8_t *features;                   /* NULL: lost */
    size_t feature_stride;                     /* bytes of `width` words and what is between them and the next ones */
    int width, height;                         /* of the view, for features */
};

/** A plane of all views. */
struct sst_step_places {
    struct sst_gpu_buffer *buffer; /* NULL: no view has a place */
    size_t bytes;                  /* of a place */
    int places;
    struct {
        int view;     /* -1: none */
        int64_t used; /* turn */
    } place[SST_PLANE_VIEWS];
    struct {
        int place; /* -1: none */
        bool current;
    } view[SST_PLANE_VIEWS];
};

/** Under the lock of the device. */
struct sst_step_planes {
    const void *of;            /* the light field; NULL: none */
    int views;
    size_t pixels[SST_PLANES]; /* of a view */
    int64_t turn;              /* of the item in work: places that were used in it stay */
    struct sst_step_places plane[SST_PLANES];
};

/** Claim planes for a light field; planes of another one are freed, and of its own only colours stay current.
 * @param pixels  [SST_PLANE_MAP + 1] of a view */
void sst_step_planes_claim(struct sst_step_planes *p, struct sst_gpu *g, const void *of, int views,
                           const size_t *pixels);

/** Free a plane of all views. */
void sst_step_plane_drop(struct sst_step_planes *p, struct sst_gpu *g, enum sst_step_plane plane);

/** Free planes of which no place was used in this turn, and that are not `but`. @return whether there was any */
bool sst_step_planes_trim(struct sst_step_planes *p, struct sst_gpu *g, int but);

/** A view's words as the last step left them. They stay for this turn. @return without a buffer: they are not there */
struct sst_gpu_range sst_step_plane_find(struct sst_step_planes *p, enum sst_step_plane plane, int view);

/** A place for a view's words, which are not current. @return without a buffer: the plane has no memory, or all places
 * were used in this turn */
struct sst_gpu_range sst_step_plane_place(struct sst_step_planes *p, enum sst_step_plane plane, int view);

/** Allocate places for as many views as fit, `least` at least. @return 0 or an error of the device */
SST_MUST_CHECK int sst_step_plane_create(struct sst_step_planes *p, struct sst_gpu *g, enum sst_step_plane plane,
                                         int least);

/** The words of a view are current from now on, or not any more. */
void sst_step_plane_mark(struct sst_step_planes *p, enum sst_step_plane plane, int view, bool current);

/** Places that were used in this turn. */
int sst_step_plane_used(const struct sst_step_planes *p, enum sst_step_plane plane);

/** The item in work does not use a view's words any more: their place may be given up. */
void sst_step_plane_release(struct sst_step_planes *p, enum sst_step_plane plane, int view);

/** Rows of words of a plane, and the words of each. */
void sst_step_plane_shape(enum sst_step_plane plane, const struct sst_plane_source *from, int *rows, size_t *words);

/** Rows first .. first + rows - 1 of a plane, packed. @param words  out, those rows */
void sst_step_plane_pack(uint32_t *words, enum sst_step_plane plane, const struct sst_plane_source *from, int first,
                         int rows);

/** A map's words, unpacked to the maps that are not NULL. @param words  [height][width] */
void sst_step_map_unpack(const uint32_t *words, struct sst_map_u16 *disp, struct sst_map_u8 *confidence,
                         struct sst_map_u8 *agreed, struct sst_map_u8 *checked);

#endif
