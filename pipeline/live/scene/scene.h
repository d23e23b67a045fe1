/* pipeline/live/scene/scene.h - disparities and labels of all views: key views are matched and labelled where
 * something changed, and their maps are warped to the other views. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_SCENE_SCENE_H
#define SST_PIPELINE_LIVE_SCENE_SCENE_H

#include "pipeline/live/frames/frames.h"

struct sst_livescene; /* opaque; one thread */

/**
 * @param cfg  must outlive the object
 * @param lf   images are owned by frames.h; this object owns disparities, labels and classes. lf->disp_min_px changes
 *             only with the range.
 * @return 0, -ENOENT/-EBADMSG (model), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_livescene_open(struct sst_livescene **out, const struct sst_live_config *cfg,
                                      struct sst_lightfield *lf);
void sst_livescene_close(struct sst_livescene *s);

/**
 * Update the maps after changes in the views.
 *
 * The first set, and one in which nearly everything changed, is computed whole. Otherwise the changed tiles of the key
 * views (with the margin that matching needs) are matched against neighbouring views in the current range of
 * disparities. The network labels the key views that changed (S4); labels are filtered by entropy and refined by
 * disparity. The other views get disparity and label of the key pixels that are warped there, nearest surface first;
 * pixels that no key view sees are filled from the farther surroundings.
 *
 * While maps wait, the network runs for the next ones in sst_livescene_follow(), which is to be called after each
 * update.
 *
 * @param changes  in: tiles whose picture changed; out: tiles whose picture, disparity or label changed
 * @param in       time of the set, and `unseen`
 * @param report   out, DISPARITY, LABELS (which runs in parallel), REFINE and their counters, ready, whole; in the
 *                 update after a settle, error_labels: fraction of wrong labels in the tiles that the background
 * replaced
 * @return 0, -ECANCELED, -ENOMEM
 */
SST_MUST_CHECK int sst_livescene_update(struct sst_livescene *s, struct sst_liveframes_changes *changes,
                                        const struct sst_live_input *in, struct sst_live_report *report);

/** The rest of an update. @param report  of the update: network runs are added @return 0, -ECANCELED, -ENOMEM */
SST_MUST_CHECK int sst_livescene_follow(struct sst_livescene *s, struct sst_live_report *report);

/** As sst_live_tracks(). */
int sst_livescene_tracks(const struct sst_livescene *s, struct sst_live_track out[SST_LIVE_TRACKS]);

/** As sst_live_label_device(). */
bool sst_livescene_device(const struct sst_livescene *s, struct sst_network_device_report *out);

/** As sst_live_recognise(). */
int sst_livescene_recognise(struct sst_livescene *s, const struct sst_image *image, const double box[4]);

/**
 * The background: while most of the scene is static, a thread of low priority computes the whole light field as
 * `sst process --preset balanced` does, from a copy, and its maps replace the quick ones in tiles that have not changed
 * since. It runs once per state of the scene: a static scene costs nothing afterwards. It may widen an estimated range
 * but never narrows it.
 */
bool sst_livescene_unsettled(struct sst_livescene *s); /* any thread */
/** @param changes  out: tiles whose maps were replaced @return true if there are any */
bool sst_livescene_settle(struct sst_livescene *s, struct sst_liveframes_changes *changes);

void sst_livescene_cancel(struct sst_livescene *s);

#endif
