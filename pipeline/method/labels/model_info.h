/* pipeline/method/labels/model_info.h - input and output of a segmentation network, from metadata or a YAML file. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_LABELS_MODEL_INFO_H
#define SST_PIPELINE_METHOD_LABELS_MODEL_INFO_H

#include "base/file.h"
#include "pipeline/image/classes.h"
#include "pipeline/method/network/network.h"

#define SST_MODEL_MAX_CHANNELS 256

struct sst_model_info {
    struct sst_classes classes;               /* the labels, after channels were joined by `labels` */
    int channels;                             /* of the network's output, and the background if that is implied */
    uint8_t class_of[SST_MODEL_MAX_CHANNELS]; /* channel -> index in classes */
    bool bgr;                                 /* order of a colour network's input channels */
    double mean[3], std[3];                   /* input channel c is (v / 255 - mean[c]) / std[c], v the 8-bit sample */
    double eps_h, temperature;
    int width, height; /* nominal working size */
    bool fixed_size;   /* the network accepts that size only; images are stretched to it */
    bool probabilities; /* the values of the output, else logits */
    bool background;    /* the output has one channel, which is channel 1: 0 is its rest, the background */
    char last_op[24];   /* Softmax or Sigmoid that ends the network; "": neither */
};

/**
 * The description of a network: each entry from the file beside it (FILE.yaml or FILE.onnx.yaml for FILE.onnx), else
 * from its metadata (sst.*), else the default. docs/integrate/formats.md lists both. If a file overrides metadata, a
 * debug message reports it.
 *
 * @param net   the network's metadata and its fixed input size count
 * @param path  of the network
 * @return 0, -EBADMSG (faults; of the YAML file with line and column, a sentence each), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_labels_model_info_read(struct sst_model_info *out, const struct sst_network *net,
                                              const char *path);

/** A YAML file in memory. */
struct sst_model_yaml {
    const char *text;
    size_t size;
    const char *name; /* for messages */
};

/** The same from the text of the YAML file; NULL: none. @param net  NULL: no metadata either */
SST_MUST_CHECK int sst_labels_model_info_parse(struct sst_model_info *out, const struct sst_network *net,
                                               const char *path, const struct sst_model_yaml *yaml);

/** The YAML file beside a network. @return 0, -ENOENT (none; not logged), -EBADMSG (both spellings), -ENAMETOOLONG */
SST_MUST_CHECK int sst_labels_model_sidecar(char out[SST_PATH_MAX], const char *path);

#endif
