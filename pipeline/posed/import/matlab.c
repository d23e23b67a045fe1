/* Lens of a MATLAB file of version 5: cameraParameters of the calibration app, or a structure of the same fields. An object's
 * fields are a structure within a stream of bytes within the file; matrices are stored column by column, and pixel centres
 * count from 1. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "base/log.h"
#include "pipeline/posed/import/import_internal.h"

#define FILE_BYTES   ((size_t)64 << 20)
#define HEADER_BYTES 128 /* text, version, and IM in little-endian files */
#define PACKED_MOST  1032 /* bytes that deflate makes of one */
#define DEPTH_MAX    24
#define FIELD_BYTES  64

/* Types of elements, and classes of matrices. */
enum {
    INT8 = 1,
    UINT8 = 2,
    INT16 = 3,
    UINT16 = 4,
    INT32 = 5,
    UINT32 = 6,
    SINGLE = 7,
    DOUBLE = 9,
    MATRIX = 14,
    COMPRESSED = 15,
    CLASS_STRUCT = 2,
};

struct element {
    uint32_t type;
    const uint8_t *data;
    size_t size;
};

/* Bytes with elements one after the other. */
struct stream {
    const uint8_t *data;
    size_t size, at;
};

/* Fields of cameraParameters. */
struct fields {
    double matrix[9], radial[3], tangential[2], size[2]; /* size: rows, columns */
    int radials;
    bool transposed; /* matrix is K, not IntrinsicMatrix, its transpose */
    bool has_matrix, has_size;
};

static uint32_t word(const uint8_t *p)
{
    return p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* Cut the next element off. Small elements, of up to 4 bytes, have type and size in one word. */
static bool next(struct stream *s, struct element *e)
{
    const size_t left = s->size - s->at;
    const uint8_t *p = s->data + s->at;
    size_t padded;

    if (left < 8)
        return false;
    if (word(p) >> 16) {
        *e = (struct element){ word(p) & 0xffff, p + 4, word(p) >> 16 };
        s->at += 8;
        return e->size <= 4;
    }
    *e = (struct element){ word(p), p + 8, word(p + 4) };
    if (e->size > left - 8)
        return false;
    padded = e->type == COMPRESSED ? e->size : (e->size + 7) / 8 * 8;
    s->at += 8 + (padded < left - 8 ? padded : left - 8);
    return true;
}

static int number_bytes(uint32_t type)
{
    return type == INT8 || type == UINT8 ? 1 : type == INT16 || type == UINT16 ? 2 : type == DOUBLE ? 8 : 4;
}

static double number(const uint8_t *p, uint32_t type)
{
    double d;
    float f;

    switch (type) {
    case INT8:
        return (int8_t)p[0];
    case UINT8:
        return p[0];
    case INT16:
        return (int16_t)(p[0] | p[1] << 8);
    case UINT16:
        return p[0] | p[1] << 8;
    case INT32:
        return (int32_t)word(p);
    case UINT32:
        return word(p);
    case SINGLE:
        memcpy(&f, p, sizeof(f));
        return (double)f;
    default:
        memcpy(&d, p, sizeof(d));
        return d;
    }
}

/* Numbers of a matrix. @return their count, at most max; 0: no numbers */
static int read_numbers(const struct element *matrix, double *out, int max)
{
    struct stream s = { .data = matrix->data, .size = matrix->size };
    struct element e;
    int n;

    for (int part = 0; part < 4; part++) { /* flags, dimensions, name, numbers */
        if (!next(&s, &e))
            return 0;
    }
    if (e.type < INT8 || (e.type > SINGLE && e.type != DOUBLE))
        return 0;
    n = e.size / (size_t)number_bytes(e.type) > (size_t)max ? max + 1 : (int)(e.size / (size_t)number_bytes(e.type));
    if (n > max)
        return 0;
    for (int i = 0; i < n; i++)
        out[i] = number(e.data + i * number_bytes(e.type), e.type);
    return n;
}

static void take_field(struct fields *f, const char *name, const struct element *value)
{
    if (!strcmp(name, "IntrinsicMatrix") || !strcmp(name, "K")) {
        f->has_matrix = read_numbers(value, f->matrix, 9) == 9;
        f->transposed = name[0] == 'K';
    } else if (!strcmp(name, "RadialDistortion")) {
        f->radials = read_numbers(value, f->radial, 3);
    } else if (!strcmp(name, "TangentialDistortion")) {
        (void)read_numbers(value, f->tangential, 2);
    } else if (!strcmp(name, "ImageSize")) {
        f->has_size = read_numbers(value, f->size, 2) == 2;
    }
}

static bool walk(struct fields *f, struct stream s, int depth);

/* @param s  after the flags */
static bool walk_struct(struct fields *f, struct stream s, int depth)
{
    struct element e, names;
    struct stream values;
    char name[FIELD_BYTES];
    size_t each;

    for (int part = 0; part < 3; part++) { /* dimensions, name, bytes of a field's name */
        if (!next(&s, &e))
            return false;
    }
    each = e.size == 4 ? word(e.data) : 0;
    if (!each || each > FIELD_BYTES || !next(&s, &names))
        return false;
    values = s;
    *f = (struct fields){ .radials = 0 };
    for (size_t i = 0; i < names.size / each && next(&s, &e); i++) {
        memcpy(name, names.data + i * each, each);
        name[each - 1] = '\0';
        if (e.type == MATRIX)
            take_field(f, name, &e);
    }
    return f->has_matrix || walk(f, values, depth + 1);
}

static bool walk_matrix(struct fields *f, const struct element *matrix, int depth)
{
    struct stream s = { .data = matrix->data, .size = matrix->size };
    struct element flags;

    if (!next(&s, &flags) || flags.type != UINT32 || flags.size < 4)
        return false;
    return (word(flags.data) & 0xff) == CLASS_STRUCT ? walk_struct(f, s, depth) : walk(f, s, depth + 1);
}

static bool walk_compressed(struct fields *f, const struct element *e, int depth)
{
    uLongf size = e->size > FILE_BYTES / PACKED_MOST ? FILE_BYTES : (e->size + 1) * PACKED_MOST;
    uint8_t *data = malloc(size);
    bool found = data && uncompress(data, &size, e->data, e->size) == Z_OK;

    if (found)
        found = walk(f, (struct stream){ .data = data, .size = size }, depth + 1);
    free(data);
    return found;
}

/* Search all elements for a structure with a camera's matrix. */
static bool walk(struct fields *f, struct stream s, int depth)
{
    struct element e;
    bool found = false;

    while (depth < DEPTH_MAX && !found && next(&s, &e)) {
        if (e.type == MATRIX)
            found = walk_matrix(f, &e, depth);
        else if (e.type == COMPRESSED && depth == 0)
            found = walk_compressed(f, &e, depth);
        else if (e.type == UINT8 && e.size > 8 && !memcmp(e.data, "\0\1IM", 4))
            found = walk(f, (struct stream){ .data = e.data + 8, .size = e.size - 8 }, depth + 1);
    }
    return found;
}

static const char *set_lens(struct model_view *v, const struct fields *f)
{
    const double *m = f->matrix; /* [fx 0 0; s fy 0; cx cy 1] by columns, or its transpose */
    const double skew = m[f->transposed ? 3 : 1];
    const double lens[4] = { m[0], m[4], m[f->transposed ? 6 : 2] - 0.5, m[f->transposed ? 7 : 5] - 0.5 };
    const double k[5] = { f->radial[0], f->radial[1], f->tangential[0], f->tangential[1], f->radial[2] };

    if (fabs(skew) > 1e-6)
        return "the lens has a skew, which ours has not; calibrate it without";
    if (f->has_size && (!(f->size[0] >= 1) || !(f->size[1] >= 1) || f->size[0] > SST_IMAGE_MAX_SIDE ||
                        f->size[1] > SST_IMAGE_MAX_SIDE))
        return "ImageSize is not 1 to 32768";
    v->height = f->has_size ? (int)f->size[0] : 0;
    v->width = f->has_size ? (int)f->size[1] : 0;
    return model_lens(v, lens, k, 5);
}

bool matlab_is(const uint8_t *data, size_t size)
{
    return size > HEADER_BYTES && !memcmp(data, "MATLAB ", 7);
}

int matlab_lens(struct model_view *v, const uint8_t *data, size_t size, const char *path)
{
    struct fields f = { .radials = 0 };
    const char *fault = NULL;

    if (memcmp(data, "MATLAB 5.0", 10) || memcmp(data + HEADER_BYTES - 2, "IM", 2))
        fault = "it is not of version 5 in little-endian; save it with -v7";
    else if (!walk(&f, (struct stream){ .data = data + HEADER_BYTES, .size = size - HEADER_BYTES }, 0))
        fault = "it has no cameraParameters with an IntrinsicMatrix";
    fault = fault ? fault : set_lens(v, &f);
    if (fault)
        sst_log_error("%s: %s", path, fault);
    return fault ? -EBADMSG : 0;
}
