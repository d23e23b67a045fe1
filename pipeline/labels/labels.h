/* pipeline/labels/labels.h - semantic labels of an image: network, entropy, high confidence map (HCSM). */
#ifndef SST_PIPELINE_LABELS_LABELS_H
#define SST_PIPELINE_LABELS_LABELS_H

#include "pipeline/image/image.h"
#include "pipeline/labels/classes.h"
#include "pipeline/network/network.h"

SST_EXTERN_C_BEGIN

/**
 * H = -sum p log p, natural log, 0 log 0 = 0 (DESIGN 5.1). In 0 .. log(count); for near-certain pixels the largest p is
 * taken as 1 - (sum of the others), so that entropies down to 1e-38 stay apart.
 *
 * @param p  [count], >= 0, sum 1; where one is NaN, negative or above 2 the result is INFINITY, which no threshold
 * keeps
 */
float sst_entropy(const float *p, int count);

/**
 * Map of labels and entropy from per-class probabilities.
 *
 * @param label    out: argmax + 1, ties to the smaller class; SST_LABEL_NONE where the entropy is infinite
 * @param entropy  out, or NULL
 * @param prob     in [count][height][width]
 */
void sst_labels_from_prob(struct sst_map_u8 *label, struct sst_map_f32 *entropy, const float *prob, int count);

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
 * @param model    ONNX path of a network from 3 channels to one per class. Its metadata: sst.classes and sst.ground
 *                 (comma-separated names; ground may be missing), sst.mean and sst.std (three numbers for R, G, B in
 * 0..1; 0 and 1), sst.size (WxH of the nominal working size; 480x360), sst.epsilon_h (infinite), sst.temperature
 * (divides the logits; 1), sst.output (logits or probabilities; logits).
 * @param precision  of the network, see sst_network_open()
 * @param threads  at least 1
 * @return 0, -EBADMSG (also: metadata that do not fit), -ENOMEM and what sst_network_open() returns; logged.
 */
SST_MUST_CHECK int sst_segmenter_open(struct sst_segmenter **out, const char *model, enum sst_precision precision,
                                      int threads);
void sst_segmenter_close(struct sst_segmenter *seg);

const struct sst_classes *sst_segmenter_classes(const struct sst_segmenter *seg);

/** Default entropy threshold that the model carries. */
double sst_segmenter_eps_h(const struct sst_segmenter *seg);

/**
 * Label one image.
 *
 * The network sees the image at its own proportions with the area of the nominal working size, sides multiples of 8;
 * one with windows of fixed sizes sees it stretched to the nominal size. Its probabilities (softmax first) are brought
 * back bilinearly and normalised again. Beyond label and entropy, memory does not grow with the image unless prob is
 * wanted. Same bytes for any number of threads.
 *
 * @param label, entropy  out, initialised here, of the image's size; entropy may be NULL
 * @param prob  out, malloc'ed [classes][height][width] of the image's size, or NULL when not wanted
 * @return 0, -EBADMSG (the network gave NaN or infinities), -EINVAL (it cannot run at this size), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_segment(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label,
                               struct sst_map_f32 *entropy, float **prob);

SST_EXTERN_C_END

#endif
