/* pipeline/live/scene/scene.h - disparities and labels of all views kept up to date: key views are matched and labelled
 * where something changed, the others take theirs from them. */
#ifndef SST_PIPELINE_LIVE_SCENE_SCENE_H
#define SST_PIPELINE_LIVE_SCENE_SCENE_H

#include "pipeline/live/frames/frames.h"

struct sst_live_scene; /* opaque; one thread */

/**
 * @param cfg  must stay
 * @param lf   images kept by frames.h; disparities, labels, classes are kept here. lf->disp_min_px is set once and
 * stays while the range stays.
 * @return 0, -ENOENT/-EBADMSG (model), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_live_scene_open(struct sst_live_scene **out, const struct sst_live_config *cfg,
                                       struct sst_lightfield *lf);
void sst_live_scene_close(struct sst_live_scene *s);

/**
 * Follow what changed in the views.
 *
 * The first set, and one in which nearly everything changed, is computed whole. Otherwise the changed tiles (with the
 * margin that matching needs) of the key views are matched, by their neighbours' pictures, in the range of disparities
 * that is known; the network labels the key views that changed (S4), filtered by entropy and refined by disparity; the
 * other views take disparity and label of the key views' pixels that land there, nearest surface first, and what no key
 * view sees from the surroundings that are farther away.
 *
 * @param changes  in: tiles whose picture changed; out: tiles whose picture, disparity or label changed
 * @param report   out, DISPARITY, LABELS (which runs beside it), REFINE and their counters, ready, whole; error_labels
 * in the update after a settle: labels that the background found off, of the tiles that it replaced
 * @return 0, -ECANCELED, -ENOMEM
 */
SST_MUST_CHECK int sst_live_scene_update(struct sst_live_scene *s, struct sst_live_changes *changes,
                                         struct sst_live_report *report);

/**
 * The background: while most of the scene stands still, a thread of low priority computes the whole light field as
 * `sst process --preset balanced` does, from a copy, and its maps replace the quick ones in tiles that have not changed
 * since. It runs once per state of the scene: a scene that stands still costs nothing afterwards. An estimated range
 * may become wider by it, never narrower.
 */
bool sst_live_scene_unsettled(struct sst_live_scene *s); /* any thread */
/** @param changes  out: tiles whose maps were replaced @return any was */
bool sst_live_scene_settle(struct sst_live_scene *s, struct sst_live_changes *changes);

void sst_live_scene_cancel(struct sst_live_scene *s);

#endif
