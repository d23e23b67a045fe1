/* pipeline/method/network/compat_dnnl.h - calls that differ between versions 2 and 3 of oneDNN, in the form of
 * version 3. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_NETWORK_COMPAT_DNNL_H
#define SST_PIPELINE_METHOD_NETWORK_COMPAT_DNNL_H

#include <stdbool.h>

#include <dnnl.h>

#include "base/base.h"

#if DNNL_VERSION_MAJOR < 3
/* Version 3's name; there the type is opaque. */
typedef const dnnl_memory_desc_t *const_dnnl_memory_desc_t;
#endif

/** An engine, its stream, and layouts: equal layouts are the same pointer. */
struct net_dnnl {
    dnnl_engine_t engine;
    dnnl_stream_t stream;
    const_dnnl_memory_desc_t *layouts;
    int n_layouts, layouts_room;
};

/** Dimensions of a tensor and how it is stored. */
struct net_dnnl_shape {
    int n;
    dnnl_dims_t dims;
    dnnl_data_type_t type;
    dnnl_format_tag_t tag;
};

/** A convolution, or a pooling, which has a kernel instead of weights and biases. Dilation 0 is none. */
struct net_dnnl_layer {
    dnnl_alg_kind_t algorithm;
    const_dnnl_memory_desc_t src, weights, bias, dst;
    dnnl_dims_t stride, kernel, dilation, before, after;
};

/** 0, -ENOMEM or -ENOTSUP. */
int net_dnnl_errno(dnnl_status_t status);

/** @return 0, -ENOMEM, -ENOTSUP. After a failure net_dnnl_close() is due, too. */
SST_MUST_CHECK int net_dnnl_open(struct net_dnnl *d);

/** Free the engine, its stream and all layouts. A zeroed one is fine. */
void net_dnnl_close(struct net_dnnl *d);

/* --- layouts; the results are valid until net_dnnl_close() --- */

SST_MUST_CHECK int net_dnnl_layout(struct net_dnnl *d, const_dnnl_memory_desc_t *out,
                                   const struct net_dnnl_shape *shape);

/** The layout that a primitive chose, by dnnl_query_src_md and others. */
SST_MUST_CHECK int net_dnnl_chosen(struct net_dnnl *d, const_dnnl_memory_desc_t *out, const_dnnl_primitive_desc_t pd,
                                   dnnl_query_t what);

/** The same layout of other elements of the same size. @return 0, -ENOMEM, -ENOTSUP (no layout known by a tag) */
SST_MUST_CHECK int net_dnnl_retyped(struct net_dnnl *d, const_dnnl_memory_desc_t *out, const_dnnl_memory_desc_t md,
                                    dnnl_data_type_t type);

dnnl_data_type_t net_dnnl_type(const_dnnl_memory_desc_t md);

/* --- primitives for inference; attr may be NULL --- */

SST_MUST_CHECK int net_dnnl_conv(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const struct net_dnnl_layer *l,
                                 const_dnnl_primitive_attr_t attr);
SST_MUST_CHECK int net_dnnl_pool(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const struct net_dnnl_layer *l,
                                 const_dnnl_primitive_attr_t attr);
SST_MUST_CHECK int net_dnnl_relu(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const_dnnl_memory_desc_t md,
                                 const_dnnl_primitive_attr_t attr);

/** Sum of two tensors of one layout. */
SST_MUST_CHECK int net_dnnl_add(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const_dnnl_memory_desc_t md,
                                const_dnnl_primitive_attr_t attr);

/** Concatenation of the channels of 1 to SST_ONNX_MAX_INS tensors. */
SST_MUST_CHECK int net_dnnl_concat(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, int n,
                                   const const_dnnl_memory_desc_t *mds, const_dnnl_primitive_attr_t attr);

/** True for a convolution as matrix products (with AVX2: large dilation): the order of its sums of floats depends on
 * the number of threads that it is described for. */
bool net_dnnl_splits_sums(const_dnnl_primitive_desc_t pd);

/* --- attributes --- */

SST_MUST_CHECK int net_dnnl_append_relu(dnnl_post_ops_t post);

/** Add scale times the numbers, of the given type, in the result's memory. */
SST_MUST_CHECK int net_dnnl_append_sum(dnnl_post_ops_t post, float scale, dnnl_data_type_t type);

/** Factor of a reorder. */
SST_MUST_CHECK int net_dnnl_scale_reorder(dnnl_primitive_attr_t attr, float factor);

/** Factors of a convolution's output channels. */
SST_MUST_CHECK int net_dnnl_scale_conv(dnnl_primitive_attr_t attr, const float *factors, int n, bool grouped);

/** Argument that brings the factors to a reorder (DNNL_ARG_FROM) or convolution (DNNL_ARG_WEIGHTS) as it runs; 0: it
 * has them already. */
int net_dnnl_scales_arg(int arg);

/** True if a convolution multiplies the bias by the factor too: (sum + bias) * factor, else sum * factor + bias. */
bool net_dnnl_scales_bias(void);

#endif
