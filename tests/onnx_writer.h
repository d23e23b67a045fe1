/* tests/onnx_writer.h - writes small ONNX files byte by byte, so that tests need no other tool. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_ONNX_WRITER_H
#define SST_TESTS_ONNX_WRITER_H

#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/base.h"

struct ow_buf {
    uint8_t *p;
    size_t n, room;
};

static inline void ow_raw(struct ow_buf *b, const void *data, size_t n)
{
    if (b->n + n > b->room) {
        b->room = 2 * (b->n + n) + 64;
        b->p = (uint8_t *)realloc(b->p, b->room);
        if (!b->p)
            abort();
    }
    if (n)
        memcpy(b->p + b->n, data, n);
    b->n += n;
}

static inline void ow_varint(struct ow_buf *b, uint64_t v)
{
    do {
        const uint8_t byte = (uint8_t)((v & 0x7f) | (v > 0x7f ? 0x80 : 0));

        ow_raw(b, &byte, 1);
        v >>= 7;
    } while (v);
}

static inline void ow_int(struct ow_buf *b, unsigned field, int64_t v)
{
    ow_varint(b, (uint64_t)field << 3);
    ow_varint(b, (uint64_t)v);
}

static inline void ow_bytes(struct ow_buf *b, unsigned field, const void *data, size_t n)
{
    ow_varint(b, (uint64_t)field << 3 | 2);
    ow_varint(b, n);
    ow_raw(b, data, n);
}

static inline void ow_str(struct ow_buf *b, unsigned field, const char *s)
{
    ow_bytes(b, field, s, strlen(s));
}

/* Append a message and free it. */
static inline void ow_take(struct ow_buf *b, unsigned field, struct ow_buf *message)
{
    ow_bytes(b, field, message->p, message->n);
    free(message->p);
    *message = (struct ow_buf){ 0 };
}

/* --- attributes: collected in a buffer, handed to ow_node() --- */

static inline void ow_attr_ints(struct ow_buf *attrs, const char *name, int n, ...)
{
    struct ow_buf a = { 0 };
    va_list args;

    va_start(args, n);
    ow_str(&a, 1, name);
    for (int i = 0; i < n; i++)
        ow_int(&a, 8, va_arg(args, int));
    va_end(args);
    ow_int(&a, 20, 7);
    ow_take(attrs, 5, &a);
}

static inline void ow_attr_int(struct ow_buf *attrs, const char *name, int64_t v)
{
    struct ow_buf a = { 0 };

    ow_str(&a, 1, name);
    ow_int(&a, 3, v);
    ow_int(&a, 20, 2);
    ow_take(attrs, 5, &a);
}

static inline void ow_attr_float(struct ow_buf *attrs, const char *name, float v)
{
    struct ow_buf a = { 0 };

    ow_str(&a, 1, name);
    ow_varint(&a, 2 << 3 | 5);
    ow_raw(&a, &v, 4);
    ow_int(&a, 20, 1);
    ow_take(attrs, 5, &a);
}

static inline void ow_attr_str(struct ow_buf *attrs, const char *name, const char *v)
{
    struct ow_buf a = { 0 };

    ow_str(&a, 1, name);
    ow_str(&a, 4, v);
    ow_int(&a, 20, 3);
    ow_take(attrs, 5, &a);
}

/* --- the graph --- */

static inline void ow_names(struct ow_buf *b, unsigned field, const char *names)
{
    while (*names) {
        const size_t n = strcspn(names, " ");

        /* "-" stands for an input that is left out. */
        ow_bytes(b, field, names, n == 1 && *names == '-' ? 0 : n);
        names += n + (names[n] == ' ');
    }
}

/** @param ins, outs  names with one space between; @param attrs  taken, or NULL */
static inline void ow_node(struct ow_buf *graph, const char *op, const char *ins, const char *outs,
                           struct ow_buf *attrs)
{
    const char *dot = strchr(op, '.');
    struct ow_buf node = { 0 };

    ow_names(&node, 1, ins);
    ow_names(&node, 2, outs);
    ow_str(&node, 3, outs);
    ow_str(&node, 4, dot ? dot + 1 : op);
    if (dot)
        ow_bytes(&node, 7, op, (size_t)(dot - op));
    if (attrs) {
        ow_raw(&node, attrs->p, attrs->n);
        free(attrs->p);
        *attrs = (struct ow_buf){ 0 };
    }
    ow_take(graph, 1, &node);
}

/** Float constant of up to four dimensions; those that are 0 end the list. */
static inline void ow_floats(struct ow_buf *graph, const char *name, const float *data, int d0, int d1, int d2, int d3)
{
    const int dims[] = { d0, d1, d2, d3 };
    struct ow_buf t = { 0 };
    size_t n = 1;

    for (int i = 0; i < 4 && dims[i]; i++) {
        ow_int(&t, 1, dims[i]);
        n *= (size_t)dims[i];
    }
    ow_int(&t, 2, 1);
    ow_str(&t, 8, name);
    ow_bytes(&t, 9, data, n * sizeof(float));
    ow_take(graph, 5, &t);
}

/** One-dimensional int64 constant, in the packed int64_data form. */
static inline void ow_int64s(struct ow_buf *graph, const char *name, const int64_t *data, int n)
{
    struct ow_buf t = { 0 }, packed = { 0 };

    ow_int(&t, 1, n);
    ow_int(&t, 2, 7);
    for (int i = 0; i < n; i++)
        ow_varint(&packed, (uint64_t)data[i]);
    ow_take(&t, 7, &packed);
    ow_str(&t, 8, name);
    ow_take(graph, 5, &t);
}

/** Input (field 11) or output (12) 1 x channels x h x w with free sizes. */
static inline void ow_value(struct ow_buf *graph, unsigned field, const char *name, int channels)
{
    struct ow_buf value = { 0 }, type = { 0 }, tensor = { 0 }, shape = { 0 };

    for (int i = 0; i < 4; i++) {
        struct ow_buf dim = { 0 };

        if (i < 2)
            ow_int(&dim, 1, i ? channels : 1);
        else
            ow_str(&dim, 2, i == 2 ? "h" : "w");
        ow_take(&shape, 1, &dim);
    }
    ow_int(&tensor, 1, 1);
    ow_take(&tensor, 2, &shape);
    ow_take(&type, 1, &tensor);
    ow_str(&value, 1, name);
    ow_take(&value, 2, &type);
    ow_take(graph, field, &value);
}

static inline void ow_metadata(struct ow_buf *model, const char *key, const char *value)
{
    struct ow_buf m = { 0 };

    ow_str(&m, 1, key);
    ow_str(&m, 2, value);
    ow_take(model, 14, &m);
}

/** The model around a graph, which is taken. Metadata may be added to the result. */
static inline struct ow_buf ow_model(struct ow_buf *graph, int opset)
{
    struct ow_buf model = { 0 }, version = { 0 };

    ow_int(&model, 1, 7);
    ow_str(&version, 1, "");
    ow_int(&version, 2, opset);
    ow_take(&model, 8, &version);
    ow_str(graph, 2, "test");
    ow_take(&model, 7, graph);
    return model;
}

/* Write a network of features: one layer of 3x3, whose 64 channels are brought to unit length.
 * @param path  in and out: of mkstemp() @param radius  of the metadata; NULL: none */
static inline void ow_feature_network(char *path, const char *radius)
{
    struct ow_buf graph = { 0 }, attrs = { 0 }, model;
    const int fd = mkstemp(path);
    float w[64 * 9];

    for (int i = 0; i < 64 * 9; i++)
        w[i] = (float)(i * 7919 % 101) / 50 - 1;
    ow_floats(&graph, "w", w, 64, 1, 3, 3);
    ow_attr_ints(&attrs, "pads", 4, 1, 1, 1, 1);
    ow_node(&graph, "Conv", "x w", "c", &attrs);
    ow_attr_int(&attrs, "axis", 1);
    ow_attr_int(&attrs, "p", 2);
    ow_node(&graph, "LpNormalization", "c", "y", &attrs);
    ow_value(&graph, 11, "x", 1);
    ow_value(&graph, 12, "y", 64);
    model = ow_model(&graph, 11);
    if (radius)
        ow_metadata(&model, "sst.radius", radius);
    if (fd < 0 || write(fd, model.p, model.n) != (ssize_t)model.n)
        abort();
    close(fd);
    free(model.p);
}

#endif
