/* pipeline/labels/labels.h - semantic labels of an image: network, entropy, high confidence map (HCSM). */
#ifndef SST_PIPELINE_LABELS_LABELS_H
#define SST_PIPELINE_LABELS_LABELS_H

#include "pipeline/image/image.h"
#include "pipeline/labels/classes.h"

SST_EXTERN_C_BEGIN

/** H = -sum p log p, natural log, 0 log 0 = 0. @param p [count], >= 0, sum 1. In 0 .. log(count). */
float sst_entropy(const float *p, int count);

/**
 * Map of labels and entropy from per-class probabilities.
 *
 * @param label    out: argmax + 1, ties to the smaller class
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
 * The eps_h that maximises Acc^m * Cvg on one hand-labelled view (DESIGN 5.1): all thresholds scanned exactly, O(n log n),
 * compared in the log domain, ties to the smaller one. Pixels whose truth is 0 (background) are left out.
 *
 * @return 0, -EBADMSG (sizes differ, no labelled pixel, no correct pixel at any threshold), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_epsilon_search(struct sst_epsilon_result *out, const struct sst_map_u8 *label,
                                      const struct sst_map_f32 *entropy, const struct sst_map_u8 *truth, double m);

struct sst_segmenter; /* a segmentation network with its class list; one thread at a time */

/** @param model  ONNX path. Class list, mean, scale, working size and eps_h come from its metadata. */
SST_MUST_CHECK int sst_segmenter_open(struct sst_segmenter **out, const char *model, int threads);
void sst_segmenter_close(struct sst_segmenter *seg);

const struct sst_classes *sst_segmenter_classes(const struct sst_segmenter *seg);

/** Default entropy threshold that the model carries. */
double sst_segmenter_eps_h(const struct sst_segmenter *seg);

/**
 * Label one image.
 *
 * @param label, entropy  out, initialised here, of the image's size; entropy may be NULL
 * @param prob  out, malloc'ed [classes][height][width] of the image's size, or NULL when not wanted
 */
SST_MUST_CHECK int sst_segment(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label,
                               struct sst_map_f32 *entropy, float **prob);

SST_EXTERN_C_END

#endif
