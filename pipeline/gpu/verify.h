/* pipeline/gpu/verify.h - the shaders verify_*: rays of a picture verified by the agreement of their colours
 * (pipeline/method/render/verify.h).
 *
 * In the order of their dispatches: verify_share finds what fraction of each pixel the maps leave to votes, views that
 * one buffer cannot hold in several dispatches; verify_screen closes cells of 64x8 pixels, those of the rows from ..
 * to - 1 (from a multiple of 8), whose rays the maps explain (SST_VERIFY_AUTO). Then for some rows at a time:
 * verify_rays samples the rays and their votes, again in several dispatches; verify_unexplained sums up what the maps
 * do not explain (SST_VERIFY_AUTO); verify_mode finds the colour with most votes, and how near rays are to it;
 * verify_blend applies that to the picture of `blend`.
 *
 * All give the bits of their references: sums are whole numbers, or of floats in a fixed order, and quotients are
 * rounded to the nearest number. So pictures differ from the reference as those of `blend` do.
 */
#ifndef SST_PIPELINE_GPU_VERIFY_H
#define SST_PIPELINE_GPU_VERIFY_H

#include "pipeline/gpu/blend.h"

#define SST_GPU_VERIFY_AROUND 8   /* views around another at most */
#define SST_GPU_VERIFY_VIEWS  256 /* of a picture at most */

/* Structures have the layout of pipeline/kernels/verify_*.comp (std430). */

/** A view around another one: a point moves by bx, by pixels to it per pixel of disparity. */
struct sst_gpu_verify_near {
    float bx, by;
    uint32_t view, zero;
};

/** A view of verify_screen and verify_unexplained, with the views around it. */
struct sst_gpu_verify_view {
    struct sst_gpu_blend_view at;
    uint32_t around, zero[3];
    struct sst_gpu_verify_near near[SST_GPU_VERIFY_AROUND];
};

/** Cells of the picture, a word each, [height / 8, rounded up][width / 64, rounded up]. */
enum sst_gpu_verify_cell {
    SST_GPU_CELL_WANTED = 1, /* in */
    SST_GPU_CELL_OPEN = 2,   /* out: a pixel is left to votes */
    SST_GPU_CELL_BELOW = 4,  /* out: ... one with SST_GPU_PIXEL_BELOW, which has no colour to mix with */
};

/** Constants of all. Pixels are those of the rows blend.top .. blend.top + blend.rows - 1 (blend.top a multiple of 8);
 * rays are held of the rows from - 1 .. to that the picture has, in `rays` pixels. */
struct sst_gpu_verify {
    struct sst_gpu_blend blend; /* flags: FIRST and LAST of verify_share, BY_LABEL of verify_rays */
    int32_t height;
    int32_t from, to; /* rows that are verified */
    int32_t nearest;  /* largest stored disparity that does not end in front ... */
    int32_t levels;   /* of colours that agree */
    uint32_t count;   /* views of the picture */
    uint32_t rays;
    uint32_t explained; /* of verify_blend: not 0: unexplained rays count */
    float all;          /* sum of the apertures of all views */
    float scale, most;  /* as in struct sst_voting */
    float doubt_step;   /* SST_VERIFY_DOUBT_STEP of pipeline/kernels/verify_ref.h */
};

/** Buffers, by binding. Planes follow each other. */
enum sst_gpu_verify_share_buffer {
    SST_GPU_SHARE_PARAMS = 0, /* struct sst_gpu_blend_params, with the place of each view among all of the picture */
    SST_GPU_SHARE_DISP = 1,   /* as of blend.h */
    SST_GPU_SHARE_SUMS = 2,   /* in: sums of weights in the fourth plane */
    SST_GPU_SHARE_OUT = 3,    /* in: of blend */
    SST_GPU_SHARE_SHARE = 4, /* in and out, float [3][rows * width]: the fraction, 0..1; between dispatches apertures of
                                all rays, of those that end in front */
    SST_GPU_SHARE_CELLS = 5, /* in and out */
};

/** A group is a cell. */
enum sst_gpu_verify_screen_buffer {
    SST_GPU_SCREEN_VIEWS = 0, /* struct sst_gpu_verify_view[count] */
    SST_GPU_SCREEN_PIXELS = 1,
    SST_GPU_SCREEN_DISP = 2,
    SST_GPU_SCREEN_VALID = 3,
    SST_GPU_SCREEN_DISP_PX = 4, /* float [65535] disparities in pixels, by what is stored */
    SST_GPU_SCREEN_SHARE = 5,   /* in and out: becomes 0 in cells that are closed */
    SST_GPU_SCREEN_CELLS = 6,   /* in and out */
};

/** The first six as of verify_screen. */
enum sst_gpu_verify_unexplained_buffer {
    SST_GPU_UNEXPLAINED_TOTALS = 6, /* out, the second plane: apertures of unexplained rays */
};

enum sst_gpu_verify_rays_buffer {
    SST_GPU_RAYS_PARAMS = 0, /* as of verify_share */
    SST_GPU_RAYS_PIXELS = 1,
    SST_GPU_RAYS_DISP = 2,
    SST_GPU_RAYS_VALID = 3,
    SST_GPU_RAYS_TABLE = 4,
    SST_GPU_RAYS_CONFIDENCE = 5, /* a byte each; not read without SST_GPU_VIEW_CONFIDENCE */
    SST_GPU_RAYS_SHARE = 6,
    SST_GPU_RAYS_RAYS =
        7, /* out, uint32_t [count][rays]: R, G, B, votes (0: no ray), of pixels around one with a share */
};

enum sst_gpu_verify_mode_buffer {
    SST_GPU_MODE_SHARE = 0,
    SST_GPU_MODE_RAYS = 1,
    SST_GPU_MODE_NEAR = 2, /* out, uint32_t [count / 2, rounded up][rays]: weights of two views' rays, the first in the
                              lower half */
    SST_GPU_MODE_TOTALS = 3, /* out, float [2][rays]: the first plane: all votes of the pixel */
};

enum sst_gpu_verify_blend_buffer {
    SST_GPU_MIX_SHARE = 0,
    SST_GPU_MIX_RAYS = 1,
    SST_GPU_MIX_NEAR = 2,
    SST_GPU_MIX_TOTALS = 3,
    SST_GPU_MIX_OUT = 4, /* in and out: of blend */
};

#endif
