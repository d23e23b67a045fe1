/* pipeline/method/labels/labels.h - semantic labels of an image: network, entropy, high confidence map (HCSM). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_LABELS_LABELS_H
#define SST_PIPELINE_METHOD_LABELS_LABELS_H

#include "pipeline/image/classes.h"
#include "pipeline/image/image.h"
#include "pipeline/method/network/network.h"

/** Set labels to SST_LABEL_NONE unless entropy < eps_h. In place. Thread: any. */
void sst_hcsm(struct sst_map_u8 *label, const struct sst_map_f32 *entropy, double eps_h);

struct sst_epsilon_result {
    double eps_h, score, accuracy, coverage; /* score = accuracy^m * coverage at eps_h */
};

/**
 * The eps_h that maximises Acc^m * Cvg on one hand-labelled view (design.md, 5.1): an exact scan of all thresholds in
 * O(n log n), compared in the log domain; ties (to 1e-13) go to the smaller one.
 *
 * Over the N pixels whose truth is not 0 (the background is left out), where pixels are kept whose label is not 0 and
 * H < eps_h: TP = kept and right, FP = kept and wrong, FN = N - TP: all pixels not kept with the right label. So Acc = TP
 * / kept and Cvg = TP / N. Pixels of equal entropy enter together; eps_h lies halfway between the last entropy kept and
 * the first one dropped, or just above the last where all are kept.
 *
 * @param entropy  >= 0; INFINITY is never kept
 * @param m        >= 0
 * @return 0, -EBADMSG (sizes differ, NaN or negative entropy, no labelled pixel, no correct pixel at any threshold),
 *         -EINVAL (m), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_epsilon_search(struct sst_epsilon_result *out, const struct sst_map_u8 *label,
                                      const struct sst_map_f32 *entropy, const struct sst_map_u8 *truth, double m);

struct sst_segmenter; /* a segmentation network with its class list; one thread at a time */

/**
 * @param model    ONNX path of a network from 1 (luma) or 3 channels to one per class, described by its metadata or by
 * a YAML file beside it (pipeline/method/labels/model_info.h).
 * @param precision  of the network, see sst_network_open()
 * @param threads  at least 1
 * @return 0, -EBADMSG (also: a description that is missing or does not fit), -ENOMEM and the errors of
 * sst_network_open(); logged.
 */
SST_MUST_CHECK int sst_segmenter_open(struct sst_segmenter **out, const char *model, enum sst_precision precision,
                                      int threads);
void sst_segmenter_close(struct sst_segmenter *seg);

/**
 * Let a runner place the network's runs from now on, see sst_network_use_runner(); images are resampled and labels
 * brought to their size on the CPU.
 *
 * @param user  borrowed until the segmenter is closed; NULL: on the CPU
 */
void sst_segmenter_use_runner(struct sst_segmenter *seg, struct sst_runner_user *user);

struct sst_model_info;

struct sst_network;

/** The network's description, and the network. Owner: seg. */
const struct sst_model_info *sst_segmenter_info(const struct sst_segmenter *seg);
struct sst_network *sst_segmenter_network(const struct sst_segmenter *seg);
const struct sst_classes *sst_segmenter_classes(const struct sst_segmenter *seg);

/** The model's default entropy threshold. */
double sst_segmenter_eps_h(const struct sst_segmenter *seg);

/** How images are scaled and cut for the network. Zeroed: the default. */
struct sst_segment_config {
    double scale; /* side of the network's input over that side of the nominal size; 0: chosen by the image's size */
    bool windows; /* overlapping windows of the nominal size instead of one run */
};

/** Applies to all later images. @param cfg  scale 0 or 0.1 .. 16 */
void sst_segmenter_configure(struct sst_segmenter *seg, const struct sst_segment_config *cfg);

/**
 * Label one image.
 *
 * The network's input keeps the image's proportions, with sides that are multiples of 8; for a network of fixed size,
 * or fixed-size windows, the image is stretched to the nominal size. By default an image whose sides are 1 to 1.5 times
 * the sides of the nominal working size (by area) is not resized; others are resized to the nearer of the two limits:
 * objects then have the sizes that networks learn (measured: docs/measured/bench-labels.md). Windows are blended where
 * they overlap. Probabilities are upsampled along the edges of the image (upsample.c). Apart from label and entropy,
 * memory does not grow with the image unless prob is requested. Same bytes for any number of threads.
 *
 * @param label, entropy  out, initialised here, of the image's size; entropy may be NULL
 * @param prob  out, malloc'ed [classes][height][width] of the image's size, or NULL
 * @return 0, -EBADMSG (the network returned NaN or infinities), -EINVAL (it cannot run at this size), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_segment(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label,
                               struct sst_map_f32 *entropy, float **prob);

/** The labels of sst_segment() whose entropy is below sst_segmenter_eps_h() (HCSM); allocates nothing but the label map
 * after its first run for an image of that size. @param label  out, initialised here @return as sst_segment() */
SST_MUST_CHECK int sst_segment_hcsm(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label);

#endif
