/* pipeline/method/render/device.h - a device that renders pictures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_RENDER_DEVICE_H
#define SST_PIPELINE_METHOD_RENDER_DEVICE_H

#include "base/log.h"
#include "pipeline/method/render/render.h"
#include "pipeline/step/run.h"

/**
 * Render on a device from now on, where it has shaders for it; no picture may be rendered meanwhile.
 *
 * Pixels whose weights underflow are the CPU's; so are the verification of rays and the holes of clear pictures where a
 * device cannot hold what they need (docs/design/gpu.md). Rays from raw frames are resampled on the device for each
 * picture. Pictures differ from those of the CPU by at
 * most SST_GPU_BLEND_LEVELS levels (pipeline/gpu/blend.h, clear.h), except where rays are verified and the sum of
 * weights lies at a threshold. A device that fails is logged as a warning and counted; the picture is then rendered on
 * the CPU, and the device is tried again later.
 *
 * @param name          as of sst_gpu_open(), or "cpu": on no device; "auto" without a GPU as well
 * @param memory_bytes  that it may use of the device's memory; 0: three quarters. Views that do not fit are uploaded
 * again for each picture
 * @return 0, or as sst_gpu_open() and -ENOTSUP (its shader is refused); logged
 */
SST_MUST_CHECK int sst_renderer_use_device(struct sst_renderer *r, const char *name, uint64_t memory_bytes);

/** The same on a device that is open for other work. @param runner  lives longer; NULL: on no device */
SST_MUST_CHECK int sst_renderer_share_device(struct sst_renderer *r, struct sst_runner *runner);

#define SST_RENDER_STEPS 8

/** Steps of pictures on a device. One that differs from the CPU is not used: without the first one a device does not
 * render. */
extern const struct sst_step_shaders sst_render_steps[SST_RENDER_STEPS + 1];

/** A light field that changes in tiles while a device renders it. All is borrowed, and must outlive the renderer. */
struct sst_render_live {
    uint64_t *const *stamp;         /* [views] of [tile_rows][tile_cols]: serial number of a tile's last change */
    int tile, tile_cols, tile_rows; /* px of a tile's side; tiles */
    const uint64_t *since;          /* another value: everything changed (views came or left) */
};

/**
 * The same for a light field that changes: rows of tiles that changed are uploaded again. A wait for the device is
 * shorter (struct sst_gpu_config, `prompt`), and a device that cannot be opened now is tried again later, as one that
 * fails. Of failures in a row only the first is logged, and that the device works again. Networks share the device:
 * memory_bytes of 0 is SST_GPU_PICTURES_PERCENT of it.
 *
 * @return 0, also where there is no such device; -ENOMEM (logged)
 */
SST_MUST_CHECK int sst_renderer_use_live_device(struct sst_renderer *r, const char *name, uint64_t memory_bytes,
                                                const struct sst_render_live *live);

/** Work of a device. */
struct sst_render_device_report {
    char name[SST_GPU_NAME], driver[SST_GPU_NAME]; /* as asked for and "", if it was never opened */
    bool failing;              /* it failed at its last picture, or could not be opened, and is tried again later */
    char failure[SST_LOG_MAX]; /* the last one's reason; "": none */
    int64_t pictures;        /* made there */
    int64_t in_parts;        /* of them: clear pictures in bands of rows */
    int64_t verified_on_cpu; /* of them: their rays were verified on the CPU */
    char why_verified[192];  /* the last one of these */
    int64_t filled_on_cpu;   /* likewise: the holes of clear pictures were filled there */
    char why_filled[128];
    int64_t on_cpu;          /* others */
    int64_t failures;        /* times that the device failed */
    char why[128];           /* the last of on_cpu */
    int chunks;              /* that the views lie in, now */
    int64_t dispatches, uploads, upload_bytes;
    int64_t total_ns, upload_ns, download_ns; /* of pictures */
    int64_t rectified;                        /* views made there from raw frames */
    int64_t frames_ns;                        /* of upload_ns: frames decoded, and tables made, for them */
};

/** @return false: there is no device */
bool sst_renderer_device(struct sst_renderer *r, struct sst_render_device_report *out);

#endif
