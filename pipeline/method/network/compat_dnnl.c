/* Both interfaces of oneDNN: version 2 has open descriptions of memory and operations, and factors of results that are
 * fixed as a primitive is made; version 3 has opaque handles, and factors of inputs that are arguments of each run. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/compat_dnnl.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/method/network/network_internal.h"

int net_dnnl_errno(dnnl_status_t status)
{
    switch (status) {
    case dnnl_success:
        return 0;
    case dnnl_out_of_memory:
        return -ENOMEM;
    default:
        return -ENOTSUP;
    }
}

/* --- differences ----------------------------------------------------------------------------------- */

#if DNNL_VERSION_MAJOR < 3

static void free_layout(const_dnnl_memory_desc_t md)
{
    free((void *)(uintptr_t)md);
}

static int copy_layout(const_dnnl_memory_desc_t *out, const_dnnl_memory_desc_t md)
{
    dnnl_memory_desc_t *copy = malloc(sizeof(*copy));

    if (!copy)
        return -ENOMEM;
    *copy = *md;
    *out = copy;
    return 0;
}

static int make_layout(const_dnnl_memory_desc_t *out, const struct net_dnnl_shape *s)
{
    dnnl_memory_desc_t md;
    const int err = net_dnnl_errno(dnnl_memory_desc_init_by_tag(&md, s->n, s->dims, s->type, s->tag));

    return err ? err : copy_layout(out, &md);
}

dnnl_data_type_t net_dnnl_type(const_dnnl_memory_desc_t md)
{
    return md->data_type;
}

static int retype(const_dnnl_memory_desc_t *out, const_dnnl_memory_desc_t md, dnnl_data_type_t type)
{
    dnnl_memory_desc_t other = *md;

    other.data_type = type;
    return copy_layout(out, &other);
}

bool net_dnnl_splits_sums(const_dnnl_primitive_desc_t pd)
{
    const char *name = NULL;

    return !dnnl_primitive_desc_query(pd, dnnl_query_impl_info_str, 0, (void *)&name) && strstr(name, "gemm");
}

static int describe(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const_dnnl_op_desc_t desc,
                    const_dnnl_primitive_attr_t attr)
{
    return net_dnnl_errno(dnnl_primitive_desc_create(pd, desc, attr, d->engine, NULL));
}

int net_dnnl_conv(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const struct net_dnnl_layer *l,
                  const_dnnl_primitive_attr_t attr)
{
    dnnl_convolution_desc_t desc;
    const int err = net_dnnl_errno(
        dnnl_dilated_convolution_forward_desc_init(&desc, dnnl_forward_inference, l->algorithm, l->src, l->weights,
                                                   l->bias, l->dst, l->stride, l->dilation, l->before, l->after));

    return err ? err : describe(d, pd, &desc, attr);
}

int net_dnnl_pool(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const struct net_dnnl_layer *l,
                  const_dnnl_primitive_attr_t attr)
{
    dnnl_pooling_v2_desc_t desc;
    const int err =
        net_dnnl_errno(dnnl_pooling_v2_forward_desc_init(&desc, dnnl_forward_inference, l->algorithm, l->src, l->dst,
                                                         l->stride, l->kernel, l->dilation, l->before, l->after));

    return err ? err : describe(d, pd, &desc, attr);
}

int net_dnnl_relu(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const_dnnl_memory_desc_t md,
                  const_dnnl_primitive_attr_t attr)
{
    dnnl_eltwise_desc_t desc;
    const int err =
        net_dnnl_errno(dnnl_eltwise_forward_desc_init(&desc, dnnl_forward_inference, dnnl_eltwise_relu, md, 0, 0));

    return err ? err : describe(d, pd, &desc, attr);
}

int net_dnnl_add(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const_dnnl_memory_desc_t md,
                 const_dnnl_primitive_attr_t attr)
{
    dnnl_binary_desc_t desc;
    const int err = net_dnnl_errno(dnnl_binary_desc_init(&desc, dnnl_binary_add, md, md, md));

    return err ? err : describe(d, pd, &desc, attr);
}

int net_dnnl_concat(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, int n, const const_dnnl_memory_desc_t *mds,
                    const_dnnl_primitive_attr_t attr)
{
    dnnl_memory_desc_t inputs[SST_ONNX_MAX_INS];

    for (int i = 0; i < n; i++)
        inputs[i] = *mds[i];
    return net_dnnl_errno(dnnl_concat_primitive_desc_create(pd, NULL, n, 1, inputs, attr, d->engine));
}

int net_dnnl_append_relu(dnnl_post_ops_t post)
{
    return net_dnnl_errno(dnnl_post_ops_append_eltwise(post, 1.0f, dnnl_eltwise_relu, 0.0f, 0.0f));
}

int net_dnnl_append_sum(dnnl_post_ops_t post, float scale, dnnl_data_type_t type)
{
    return net_dnnl_errno(dnnl_post_ops_append_sum_v2(post, scale, type));
}

int net_dnnl_scale_reorder(dnnl_primitive_attr_t attr, float factor)
{
    return net_dnnl_errno(dnnl_primitive_attr_set_output_scales(attr, 1, 0, &factor));
}

int net_dnnl_scale_conv(dnnl_primitive_attr_t attr, const float *factors, int n, bool grouped)
{
    (void)grouped;
    return net_dnnl_errno(dnnl_primitive_attr_set_output_scales(attr, n, 1 << 1, factors));
}

int net_dnnl_scales_arg(int arg)
{
    (void)arg;
    return 0;
}

bool net_dnnl_scales_bias(void)
{
    return true;
}

#else

static void free_layout(const_dnnl_memory_desc_t md)
{
    dnnl_memory_desc_destroy((dnnl_memory_desc_t)(uintptr_t)md);
}

static int copy_layout(const_dnnl_memory_desc_t *out, const_dnnl_memory_desc_t md)
{
    dnnl_memory_desc_t copy;
    const int err = net_dnnl_errno(dnnl_memory_desc_clone(&copy, md));

    if (!err)
        *out = copy;
    return err;
}

static int make_layout(const_dnnl_memory_desc_t *out, const struct net_dnnl_shape *s)
{
    dnnl_memory_desc_t md;
    const int err = net_dnnl_errno(dnnl_memory_desc_create_with_tag(&md, s->n, s->dims, s->type, s->tag));

    if (!err)
        *out = md;
    return err;
}

dnnl_data_type_t net_dnnl_type(const_dnnl_memory_desc_t md)
{
    dnnl_data_type_t type = dnnl_data_type_undef;

    return dnnl_memory_desc_query(md, dnnl_query_data_type, &type) ? dnnl_data_type_undef : type;
}

static int retype(const_dnnl_memory_desc_t *out, const_dnnl_memory_desc_t md, dnnl_data_type_t type)
{
    static const dnnl_format_tag_t tags[] = {
        dnnl_nhwc, dnnl_nchw, dnnl_nChw16c, dnnl_nChw32c, dnnl_nChw8c, dnnl_nChw4c
    };
    struct net_dnnl_shape s = { .n = 4, .type = net_dnnl_type(md) };
    dnnl_dims_t *dims;

    if (dnnl_memory_desc_query(md, dnnl_query_dims, &dims))
        return -ENOTSUP;
    for (int i = 0; i < s.n; i++)
        s.dims[i] = (*dims)[i];
    for (size_t i = 0; i < ARRAY_LEN(tags); i++) {
        const_dnnl_memory_desc_t same;
        bool found;
        int err;

        s.tag = tags[i];
        err = make_layout(&same, &s);
        if (err)
            return err;
        found = dnnl_memory_desc_equal(same, md);
        free_layout(same);
        if (found) {
            s.type = type;
            return make_layout(out, &s);
        }
    }
    return -ENOTSUP;
}

static const char *name_of(const_dnnl_primitive_desc_t pd)
{
    const char *name = "";

    return dnnl_primitive_desc_query(pd, dnnl_query_impl_info_str, 0, (void *)&name) ? "" : name;
}

bool net_dnnl_splits_sums(const_dnnl_primitive_desc_t pd)
{
    return strstr(name_of(pd), "gemm") || strstr(name_of(pd), "brg");
}

static int first_conv(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const struct net_dnnl_layer *l,
                      const_dnnl_primitive_attr_t attr)
{
    return net_dnnl_errno(dnnl_convolution_forward_primitive_desc_create(
        pd, d->engine, dnnl_forward_inference, l->algorithm, l->src, l->weights, l->bias, l->dst, l->stride,
        l->dilation, l->before, l->after, attr));
}

/* Floats: the convolution as products of blocks ("brg") sums in an order that depends on the number of threads. The
 * next one of the library's list, which version 2 uses, has one order; its plain loops are too slow. */
int net_dnnl_conv(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const struct net_dnnl_layer *l,
                  const_dnnl_primitive_attr_t attr)
{
    dnnl_primitive_desc_t other;
    int err = first_conv(d, pd, l, attr);

    if (err || net_dnnl_type(l->src) != dnnl_f32 || !strstr(name_of(*pd), "brg") || first_conv(d, &other, l, attr))
        return err;
    while (!err && strstr(name_of(other), "brg"))
        err = net_dnnl_errno(dnnl_primitive_desc_next_impl(other));
    if (err || strstr(name_of(other), "ref")) {
        dnnl_primitive_desc_destroy(other);
        return 0;
    }
    dnnl_primitive_desc_destroy(*pd);
    *pd = other;
    return 0;
}

int net_dnnl_pool(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const struct net_dnnl_layer *l,
                  const_dnnl_primitive_attr_t attr)
{
    return net_dnnl_errno(dnnl_pooling_forward_primitive_desc_create(pd, d->engine, dnnl_forward_inference,
                                                                     l->algorithm, l->src, l->dst, l->stride, l->kernel,
                                                                     l->dilation, l->before, l->after, attr));
}

int net_dnnl_relu(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const_dnnl_memory_desc_t md,
                  const_dnnl_primitive_attr_t attr)
{
    return net_dnnl_errno(dnnl_eltwise_forward_primitive_desc_create(pd, d->engine, dnnl_forward_inference,
                                                                     dnnl_eltwise_relu, md, md, 0, 0, attr));
}

int net_dnnl_add(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, const_dnnl_memory_desc_t md,
                 const_dnnl_primitive_attr_t attr)
{
    return net_dnnl_errno(dnnl_binary_primitive_desc_create(pd, d->engine, dnnl_binary_add, md, md, md, attr));
}

int net_dnnl_concat(const struct net_dnnl *d, dnnl_primitive_desc_t *pd, int n, const const_dnnl_memory_desc_t *mds,
                    const_dnnl_primitive_attr_t attr)
{
    return net_dnnl_errno(dnnl_concat_primitive_desc_create(pd, d->engine, NULL, n, 1, mds, attr));
}

int net_dnnl_append_relu(dnnl_post_ops_t post)
{
    return net_dnnl_errno(dnnl_post_ops_append_eltwise(post, dnnl_eltwise_relu, 0.0f, 0.0f));
}

int net_dnnl_append_sum(dnnl_post_ops_t post, float scale, dnnl_data_type_t type)
{
    return net_dnnl_errno(dnnl_post_ops_append_sum(post, scale, 0, type));
}

int net_dnnl_scale_reorder(dnnl_primitive_attr_t attr, float factor)
{
    (void)factor;
    return net_dnnl_errno(dnnl_primitive_attr_set_scales_mask(attr, DNNL_ARG_FROM, 0));
}

int net_dnnl_scale_conv(dnnl_primitive_attr_t attr, const float *factors, int n, bool grouped)
{
    (void)factors;
    (void)n;
    return net_dnnl_errno(
        dnnl_primitive_attr_set_scales_mask(attr, DNNL_ARG_WEIGHTS, grouped ? 1 << 0 | 1 << 1 : 1 << 0));
}

int net_dnnl_scales_arg(int arg)
{
    return DNNL_ARG_ATTR_SCALES | arg;
}

bool net_dnnl_scales_bias(void)
{
    return false;
}

#endif

/* --- the same on both ----------------------------------------------------------------------------- */

int net_dnnl_open(struct net_dnnl *d)
{
    const int err = net_dnnl_errno(dnnl_engine_create(&d->engine, dnnl_cpu, 0));

    return err ? err : net_dnnl_errno(dnnl_stream_create(&d->stream, d->engine, dnnl_stream_default_flags));
}

void net_dnnl_close(struct net_dnnl *d)
{
    dnnl_stream_destroy(d->stream);
    dnnl_engine_destroy(d->engine);
    for (int i = 0; i < d->n_layouts; i++)
        free_layout(d->layouts[i]);
    free(d->layouts);
    *d = (struct net_dnnl){ .engine = NULL };
}

/* Enter a layout, or free it if there is an equal one. */
static int enter(struct net_dnnl *d, const_dnnl_memory_desc_t *out, const_dnnl_memory_desc_t md)
{
    for (int i = 0; i < d->n_layouts; i++) {
        if (dnnl_memory_desc_equal(d->layouts[i], md)) {
            free_layout(md);
            *out = d->layouts[i];
            return 0;
        }
    }
    if (!sst_mem_grow(&d->layouts, d->n_layouts, &d->layouts_room, sizeof(*d->layouts))) {
        free_layout(md);
        return -ENOMEM;
    }
    d->layouts[d->n_layouts++] = md;
    *out = md;
    return 0;
}

int net_dnnl_layout(struct net_dnnl *d, const_dnnl_memory_desc_t *out, const struct net_dnnl_shape *shape)
{
    const_dnnl_memory_desc_t md;
    const int err = make_layout(&md, shape);

    return err ? err : enter(d, out, md);
}

int net_dnnl_chosen(struct net_dnnl *d, const_dnnl_memory_desc_t *out, const_dnnl_primitive_desc_t pd,
                    dnnl_query_t what)
{
    const_dnnl_memory_desc_t md;
    const int err = copy_layout(&md, dnnl_primitive_desc_query_md(pd, what, 0));

    return err ? err : enter(d, out, md);
}

int net_dnnl_retyped(struct net_dnnl *d, const_dnnl_memory_desc_t *out, const_dnnl_memory_desc_t md,
                     dnnl_data_type_t type)
{
    const_dnnl_memory_desc_t other;
    int err;

    if (net_dnnl_type(md) == type) {
        *out = md;
        return 0;
    }
    err = retype(&other, md, type);
    return err ? err : enter(d, out, other);
}
