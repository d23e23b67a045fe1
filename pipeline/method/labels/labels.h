/* pipeline/method/labels/labels.h - semantic labels of an image: network, entropy, high confidence map (HCSM). */
#ifndef SST_PIPELINE_METHOD_LABELS_LABELS_H
#define SST_PIPELINE_METHOD_LABELS_LABELS_H

#include "pipeline/image/classes.h"
#include "pipeline/image/image.h"
#include "pipeline/method/network/network.h"

/** Keep a label where entropy < eps_h, else SST_LABEL_NONE. Thread: any. In place. */
void sst_hcsm(struct sst_map_u8 *label, const struct sst_map_f32 *entropy, double eps_h);

struct sst_epsilon_result {
    double eps_h, score, accuracy, coverage; /* score = accuracy^m * coverage at eps_h */
};

/**
 * The eps_h that maximises Acc^m * Cvg on one hand-labelled view (DESIGN 5.1): all thresholds scanned exactly, O(n log
 * n), compared in the log domain, ties (to 1e-13 there) to the smaller one.
 *
 * Over the N pixels whose truth is not 0 (the background is left out), with those kept whose label is not 0 and H <
 * eps_h: TP = kept and right, FP = kept and wrong, FN = N - TP: all that are not kept with the right label. So Acc = TP
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
 * @return 0, -EBADMSG (also: a description that is missing or does not fit), -ENOMEM and what sst_network_open()
 * returns; logged.
 */
SST_MUST_CHECK int sst_segmenter_open(struct sst_segmenter **out, const char *model, enum sst_precision precision,
                                      int threads);
void sst_segmenter_close(struct sst_segmenter *seg);

struct sst_model_info;

struct sst_network;

/** What the network says of itself, and the network. Owner: seg. */
const struct sst_model_info *sst_segmenter_info(const struct sst_segmenter *seg);
struct sst_network *sst_segmenter_network(const struct sst_segmenter *seg);
const struct sst_classes *sst_segmenter_classes(const struct sst_segmenter *seg);

/** Default entropy threshold that the model carries. */
double sst_segmenter_eps_h(const struct sst_segmenter *seg);

/** How images meet the network. Zeroed: the default. */
struct sst_segment_config {
    double scale; /* sides of what the network sees over those of the nominal working size; 0: by the image's size */
    bool windows; /* overlapping windows of the nominal size instead of one run */
};

/** For all images from now on. @param cfg  scale 0 or 0.1 .. 16 */
void sst_segmenter_configure(struct sst_segmenter *seg, const struct sst_segment_config *cfg);

/**
 * Label one image.
 *
 * The network sees the image at its own proportions, sides multiples of 8; one of a fixed size, or with windows of
 * fixed sizes, sees it stretched to the nominal size. By default an image keeps its own pixels where their area is that
 * of the nominal working size with 1 to 1.5 times its sides, and is resized to the nearer of these two otherwise:
 * objects then have the sizes that networks learn (measured: docs/bench-labels.md). Windows are blended where they
 * overlap. Probabilities are brought back along the outlines of the image (upsample.h). Beyond label and entropy,
 * memory does not grow with the image unless prob is wanted. Same bytes for any number of threads.
 *
 * @param label, entropy  out, initialised here, of the image's size; entropy may be NULL
 * @param prob  out, malloc'ed [classes][height][width] of the image's size, or NULL when not wanted
 * @return 0, -EBADMSG (the network gave NaN or infinities), -EINVAL (it cannot run at this size), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_segment(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label,
                               struct sst_map_f32 *entropy, float **prob);

/** The labels of sst_segment() whose entropy is below sst_segmenter_eps_h() (HCSM); takes no memory but the label's
 * once it ran for an image of that size. @param label  out, initialised here @return as sst_segment() */
SST_MUST_CHECK int sst_segment_sure(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label);

#endif
