/* simulators/scene/world/loop.h - the prepared frames of all cameras: rendered once, kept in a file, mapped into memory. */
#ifndef SST_SIMULATORS_SCENE_WORLD_LOOP_H
#define SST_SIMULATORS_SCENE_WORLD_LOOP_H

#include "simulators/scene/world/jpeg.h"

#define SST_SIM_KEY_BYTES 32

/**
 * Render and encode all frames of one camera.
 *
 * @param frames  out, [number of frames]; data freed by the caller, also after a failure; zeroed before the call
 * @return 0 or a negative errno, logged.   Thread: several at a time, each with its own camera.
 */
typedef int sst_sim_render_fn(void *arg, int cam, struct sst_sim_jpeg *frames);

struct sst_sim_loop; /* opaque; read-only after open */

/**
 * Map the loop of this key, after rendering it and writing its file where the cache has none.
 *
 * @param folder  of the cache, made where missing
 * @param name    of the world, for progress on a terminal
 * @return 0, -ENOMEM, -EIO/-ENOSPC/-EROFS/-EACCES (cache), or what render returned; logged
 */
SST_MUST_CHECK int sst_sim_loop_open(struct sst_sim_loop **out, const char *folder,
                                     const uint8_t key[SST_SIM_KEY_BYTES], const char *name, int cams, int frames,
                                     sst_sim_render_fn *render, void *arg);
void sst_sim_loop_close(struct sst_sim_loop *loop);

/** A frame; its data stays the loop's and is only read. */
struct sst_sim_jpeg sst_sim_loop_frame(const struct sst_sim_loop *loop, int cam, int frame);

#endif
