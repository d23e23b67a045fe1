/* pipeline/gpu/resident.h - what several kinds of work read of the views of a light field, on the device: it stays
 * there from one to the next. What is not there was never uploaded, made room for others, or has changed on the CPU.
 */
#ifndef SST_PIPELINE_GPU_RESIDENT_H
#define SST_PIPELINE_GPU_RESIDENT_H

#include "pipeline/gpu/gpu.h"

#define SST_GPU_RESIDENT_VIEWS 256

/* A view has a word a pixel of each. */
enum sst_gpu_resident {
    SST_GPU_RESIDENT_COLOURS = 0, /* R, G, B from the lowest byte up, 255 if the pixel counts */
    SST_GPU_RESIDENT_REDUCED = 1, /* likewise, at half of the size */
    SST_GPU_RESIDENT_MAPS = 2,    /* at the size that is matched: convert.h */
    SST_GPU_RESIDENTS
};

/** Under the lock of the device that is shared. */
struct sst_gpu_residents {
    const void *of; /* the light field; NULL: none */
    int scale;      /* of it, as it is matched: 1 or 2 */
    int64_t turn;   /* piece of work: what was found or created in it stays */
    struct sst_gpu_resident_plane {
        struct sst_gpu_buffer *buffer; /* NULL: not there */
        int64_t used;
    } plane[SST_GPU_RESIDENTS][SST_GPU_RESIDENT_VIEWS];
};

/** Whose views these are from now on; those of others are freed. @param g  the device, or NULL if there is none now */
void sst_gpu_resident_claim(struct sst_gpu_residents *r, struct sst_gpu *g, const void *of);

/** @return NULL: it is not there, or of another light field */
struct sst_gpu_buffer *sst_gpu_resident_find(struct sst_gpu_residents *r, const void *of, enum sst_gpu_resident which,
                                             int view);

/** Keep a buffer in the place of the old one, which is freed. @param b  this object's from now on */
void sst_gpu_resident_put(struct sst_gpu_residents *r, struct sst_gpu *g, enum sst_gpu_resident which, int view,
                          struct sst_gpu_buffer *b);

void sst_gpu_resident_drop(struct sst_gpu_residents *r, struct sst_gpu *g, enum sst_gpu_resident which, int view);

/** Free all that was not used in this turn. @return whether there was any */
bool sst_gpu_resident_drop_unused(struct sst_gpu_residents *r, struct sst_gpu *g);

#endif
