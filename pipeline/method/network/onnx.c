/* The subset of protocol buffers that ONNX needs (field numbers are those of onnx.proto). Names, attributes and
 * metadata point into the file; only the nodes' table and the constants are copied. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/onnx.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"

enum wire { WIRE_VARINT = 0, WIRE_64 = 1, WIRE_BYTES = 2, WIRE_32 = 5 };

/* Bytes of one number of each tensor type; 0: strings and unsupported types. */
static const uint8_t type_bytes[] = { 0, 4, 1, 1, 2, 2, 4, 8, 0, 1, 2, 8, 4, 8 };

struct field {
    unsigned number;
    enum wire wire;
    uint64_t value;            /* of the three number wires */
    struct sst_onnx_str bytes; /* of WIRE_BYTES */
};

static int damaged(const char *name, const char *what)
{
    sst_log_error("model %s: %s; the file is damaged, fetch or export it again", name, what);
    return -EBADMSG;
}

static bool read_varint(struct sst_onnx_str *s, uint64_t *out)
{
    uint64_t v = 0;

    for (unsigned shift = 0; shift < 64 && s->n; shift += 7) {
        const uint8_t byte = (uint8_t)*s->p;

        s->p++;
        s->n--;
        if (shift == 63 && byte > 1)
            return false;
        v |= (uint64_t)(byte & 0x7f) << shift;
        if (!(byte & 0x80)) {
            *out = v;
            return true;
        }
    }
    return false;
}

static bool read_fixed(struct sst_onnx_str *s, size_t bytes, uint64_t *out)
{
    uint64_t v = 0;

    if (s->n < bytes)
        return false;
    for (size_t i = 0; i < bytes; i++)
        v |= (uint64_t)(uint8_t)s->p[i] << (8 * i);
    s->p += bytes;
    s->n -= bytes;
    *out = v;
    return true;
}

/* The next field of a message: 1, 0 at its end, -EBADMSG. */
static int next_field(struct sst_onnx_str *s, struct field *f)
{
    uint64_t key, n;

    if (!s->n)
        return 0;
    if (!read_varint(s, &key) || key >> 3 == 0 || key >> 32)
        return -EBADMSG;
    *f = (struct field){ .number = (unsigned)(key >> 3), .wire = (enum wire)(key & 7) };
    switch (key & 7) {
    case WIRE_VARINT:
        return read_varint(s, &f->value) ? 1 : -EBADMSG;
    case WIRE_64:
        return read_fixed(s, 8, &f->value) ? 1 : -EBADMSG;
    case WIRE_32:
        return read_fixed(s, 4, &f->value) ? 1 : -EBADMSG;
    case WIRE_BYTES:
        if (!read_varint(s, &n) || n > s->n)
            return -EBADMSG;
        f->bytes = (struct sst_onnx_str){ s->p, (size_t)n };
        s->p += n;
        s->n -= (size_t)n;
        return 1;
    default: /* groups: never in ONNX */
        return -EBADMSG;
    }
}

static float bits_to_float(uint64_t bits)
{
    const uint32_t u = (uint32_t)bits;
    float f;

    memcpy(&f, &u, sizeof(f));
    return f;
}

/* A repeated number is encoded one by one or packed; store those that fit into out[0..room), count all. Where out is
 * NULL they are only counted. Wire is that of one number. */
static bool read_numbers(struct field *f, enum wire wire, void *out, int64_t room, int64_t *count)
{
    struct sst_onnx_str one = f->bytes;
    uint64_t v = f->value;

    if (f->wire == wire)
        one = (struct sst_onnx_str){ "", 0 };
    else if (f->wire != WIRE_BYTES)
        return false;
    else if (!one.n)
        return true;
    do {
        if (f->wire == WIRE_BYTES && !(wire == WIRE_32 ? read_fixed(&one, 4, &v) : read_varint(&one, &v)))
            return false;
        if (out && *count < room) {
            if (wire == WIRE_32)
                ((float *)out)[*count] = bits_to_float(v);
            else
                ((int64_t *)out)[*count] = (int64_t)v;
        }
        ++*count;
    } while (one.n);
    return true;
}

bool sst_onnx_str_same(struct sst_onnx_str a, struct sst_onnx_str b)
{
    return a.n == b.n && (!a.n || !memcmp(a.p, b.p, a.n));
}

bool sst_onnx_str_is(struct sst_onnx_str s, const char *text)
{
    return sst_onnx_str_same(s, (struct sst_onnx_str){ text, strlen(text) });
}

bool sst_onnx_is_constant(const struct sst_onnx *model, const struct sst_onnx_value *in)
{
    for (int i = 0; i < model->n_tensors; i++) {
        if (sst_onnx_str_same(model->tensors[i].name, in->name))
            return true;
    }
    return false;
}

/* Names appear in messages. */
static bool printable(struct sst_onnx_str s)
{
    for (size_t i = 0; i < s.n; i++) {
        if ((uint8_t)s.p[i] < 0x20 || s.p[i] == 0x7f)
            return false;
    }
    return true;
}

/* --- tensors -------------------------------------------------------------------------------------- */

struct tensor_parts {
    uint64_t type;
    int64_t n_dims, n_floats, n_ints;
    struct sst_onnx_str raw;
    bool has_raw, external;
};

static bool read_tensor_field(struct sst_onnx_tensor *t, struct tensor_parts *p, struct field *f)
{
    switch (f->number) {
    case 1:
        return read_numbers(f, WIRE_VARINT, t->dims, SST_ONNX_MAX_DIMS, &p->n_dims);
    case 2:
        p->type = f->value;
        return f->wire == WIRE_VARINT;
    case 4:
        return read_numbers(f, WIRE_32, t->f, t->count, &p->n_floats);
    case 7:
        return read_numbers(f, WIRE_VARINT, t->i, t->count, &p->n_ints);
    case 8:
        t->name = f->bytes;
        return f->wire == WIRE_BYTES && printable(f->bytes);
    case 9:
        p->raw = f->bytes;
        p->has_raw = true;
        return f->wire == WIRE_BYTES;
    case 13:
        p->external = true;
        return true;
    case 14:
        p->external |= f->value != 0;
        return f->wire == WIRE_VARINT;
    default:
        return true;
    }
}

static int read_tensor_fields(struct sst_onnx_tensor *t, struct tensor_parts *p, struct sst_onnx_str bytes)
{
    struct field f;
    int r;

    while ((r = next_field(&bytes, &f)) > 0) {
        if (!read_tensor_field(t, p, &f))
            return -EBADMSG;
    }
    return r;
}

static bool count_elements(struct sst_onnx_tensor *t)
{
    t->count = 1;
    for (int i = 0; i < t->n_dims; i++) {
        if (t->dims[i] < 0 || (t->dims[i] > 0 && t->count > SST_ONNX_MAX_ELEMENTS / t->dims[i]))
            return false;
        t->count *= t->dims[i];
    }
    return true;
}

static int fill_tensor(struct sst_onnx_tensor *t, const struct tensor_parts *p, struct sst_onnx_str bytes)
{
    const size_t size = p->type == SST_ONNX_FLOAT ? sizeof(*t->f) : sizeof(*t->i);
    void *data = malloc((size_t)t->count * size);
    struct tensor_parts again = { 0 };

    if (!data)
        return -ENOMEM;
    if (p->type == SST_ONNX_FLOAT)
        t->f = data;
    else
        t->i = data;
    if (p->has_raw)
        memcpy(data, p->raw.p, (size_t)t->count * size);
    else if (read_tensor_fields(t, &again, bytes))
        return -EBADMSG; /* not reached: the same bytes were parsed before */
    for (int64_t i = 0; t->f && i < t->count; i++) {
        if (!isfinite(t->f[i]))
            return -EDOM;
    }
    return 0;
}

int sst_onnx_tensor_read(struct sst_onnx_tensor *out, struct sst_onnx_str bytes, const char *name)
{
    struct sst_onnx_tensor t = { 0 };
    struct tensor_parts p = { 0 };
    int64_t stored;
    size_t width;
    int err = 0;

    if (read_tensor_fields(&t, &p, bytes))
        return damaged(name,
                       "a tensor ends early, holds a field of the wrong kind or has control characters in its name");
    if (p.external) {
        sst_log_error(
            "model %s: tensor %.*s keeps its data in another file, which is never opened; export the model with"
            " its weights inside",
            name, SST_ONNX_STR(t.name));
        return -EBADMSG;
    }
    t.n_dims = (int)(p.n_dims <= SST_ONNX_MAX_DIMS ? p.n_dims : 0);
    if (p.n_dims > SST_ONNX_MAX_DIMS || !count_elements(&t)) {
        sst_log_error(
            "model %s: tensor %.*s has a negative or too large dimension (at most %d dimensions, 2^28 numbers);"
            " the file is damaged",
            name, SST_ONNX_STR(t.name), SST_ONNX_MAX_DIMS);
        return -EBADMSG;
    }
    width = p.type < ARRAY_LEN(type_bytes) ? type_bytes[p.type] : 0;
    stored = p.type == SST_ONNX_FLOAT ? p.n_floats : p.type == SST_ONNX_INT64 ? p.n_ints : 0;
    if (!width || (p.has_raw ? stored || p.raw.n != (size_t)t.count * width : stored != t.count)) {
        sst_log_error("model %s: tensor %.*s does not hold the %lld numbers that its type and dimensions say; the file"
                      " is damaged",
                      name, SST_ONNX_STR(t.name), (long long)t.count);
        return -EBADMSG;
    }
    if ((p.type == SST_ONNX_FLOAT || p.type == SST_ONNX_INT64) && t.count)
        err = fill_tensor(&t, &p, bytes);
    if (err == -EDOM) {
        sst_log_error("model %s: tensor %.*s holds NaN or an infinity; train or export the model again", name,
                      SST_ONNX_STR(t.name));
        err = -EBADMSG;
    }
    if (err)
        sst_onnx_tensor_fini(&t);
    else
        *out = t;
    return err;
}

void sst_onnx_tensor_fini(struct sst_onnx_tensor *tensor)
{
    free(tensor->f);
    free(tensor->i);
    *tensor = (struct sst_onnx_tensor){ 0 };
}

/* --- attributes ----------------------------------------------------------------------------------- */

static int read_attr(struct sst_onnx_attr *a, struct sst_onnx_str *name, struct sst_onnx_str bytes)
{
    struct field f;
    int64_t n_ints = 0;
    int r, n = 0;

    *a = (struct sst_onnx_attr){ 0 };
    *name = (struct sst_onnx_str){ 0 };
    while ((r = next_field(&bytes, &f)) > 0) {
        if (n++ == SST_ONNX_MAX_FIELDS) /* attributes are searched repeatedly */
            return -EBADMSG;
        if (f.number == 1)
            *name = f.bytes;
        else if (f.number == 2)
            a->f = bits_to_float(f.value);
        else if (f.number == 3)
            a->i = (int64_t)f.value;
        else if (f.number == 4)
            a->s = f.bytes;
        else if (f.number == 5)
            a->tensor = f.bytes;
        else if (f.number == 8 && !read_numbers(&f, WIRE_VARINT, a->ints, SST_ONNX_MAX_DIMS, &n_ints))
            return -EBADMSG;
        else if (f.number == 6 || f.number == 11)
            return -ENOTSUP;
    }
    a->n_ints = n_ints > INT32_MAX ? INT32_MAX : (int)n_ints;
    return r;
}

bool sst_onnx_attr_find(const struct sst_onnx_node *node, const char *name, struct sst_onnx_attr *out)
{
    struct sst_onnx_str body = node->body, found;
    struct sst_onnx_attr a;
    struct field f;

    while (next_field(&body, &f) > 0) {
        if (f.number == 5 && !read_attr(&a, &found, f.bytes) && sst_onnx_str_is(found, name)) {
            *out = a;
            return true;
        }
    }
    return false;
}

int64_t sst_onnx_attr_int(const struct sst_onnx_node *node, const char *name, int64_t missing)
{
    struct sst_onnx_attr a;

    return sst_onnx_attr_find(node, name, &a) ? a.i : missing;
}

/* --- nodes, values, the whole --------------------------------------------------------------------- */

/* A table that doubles. */
struct table {
    void **rows;
    int *count, limit;
    size_t size;      /* of a row */
    const char *what; /* its rows are */
};

/* Make room for one more; NULL (logged) at its limit or without memory. */
static void *add(const struct table *t, const char *name, int *err)
{
    const int count = *t->count;

    if (count == t->limit) {
        sst_log_error("model %s: more than %d %s; larger networks are refused", name, t->limit, t->what);
        *err = -EBADMSG;
        return NULL;
    }
    if (!(count & (count - 1))) { /* 0 or a power of two: full */
        void *p = realloc(*t->rows, (size_t)(count ? 2 * count : 1) * t->size);

        if (!p) {
            *err = -ENOMEM;
            return NULL;
        }
        *t->rows = p;
    }
    ++*t->count;
    return memset((char *)*t->rows + (size_t)count * t->size, 0, t->size);
}

static int read_node_attr(struct sst_onnx_str bytes, const char *name)
{
    struct sst_onnx_tensor tensor;
    struct sst_onnx_str attr_name;
    struct sst_onnx_attr a;
    int err = read_attr(&a, &attr_name, bytes);

    if (err == -ENOTSUP) {
        sst_log_error(
            "model %s: a node holds a graph of its own (If, Loop, Scan), which cannot be run; export the network"
            " without control flow",
            name);
        return err;
    }
    if (err)
        return damaged(name, "an attribute ends early, holds a field of the wrong kind or more than 4096 of them");
    if (!a.tensor.n)
        return 0;
    err = sst_onnx_tensor_read(&tensor, a.tensor, name);
    if (!err)
        sst_onnx_tensor_fini(&tensor);
    return err;
}

static int read_node(struct sst_onnx *m, struct sst_onnx_str bytes, const char *name)
{
    struct sst_onnx_node *node;
    struct field f;
    int r, n_attrs = 0, err = 0;

    node =
        add(&(struct table){ (void **)&m->nodes, &m->n_nodes, SST_ONNX_MAX_NODES, sizeof(*node), "nodes" }, name, &err);
    if (!node)
        return err;
    node->body = bytes;
    while ((r = next_field(&bytes, &f)) > 0) {
        if (f.number <= 7 && f.number != 6 && (f.wire != WIRE_BYTES || (f.number != 5 && !printable(f.bytes))))
            return damaged(name, "a node holds a field of the wrong kind or a name with control characters");
        if ((f.number == 1 && node->n_in == SST_ONNX_MAX_INS) || (f.number == 2 && node->n_out == SST_ONNX_MAX_OUTS))
            return damaged(name, "a node has more inputs (32) or outputs (8) than the limit");
        if (f.number == 5 && n_attrs++ == SST_ONNX_MAX_ATTRS)
            return damaged(name, "a node has more than 64 attributes");
        if (f.number == 1)
            node->in[node->n_in++] = f.bytes;
        else if (f.number == 2)
            node->out[node->n_out++] = f.bytes;
        else if (f.number == 3)
            node->name = f.bytes;
        else if (f.number == 4)
            node->op = f.bytes;
        else if (f.number == 5 && (err = read_node_attr(f.bytes, name)))
            return err;
        else if (f.number == 7)
            node->domain = f.bytes;
    }
    return r ? damaged(name, "a node ends early") : 0;
}

/* Follow field numbers to a nested message; a missing one gives an empty message. */
static int descend(struct sst_onnx_str *bytes, unsigned number)
{
    struct sst_onnx_str found = { "", 0 };
    struct field f;
    int r;

    while ((r = next_field(bytes, &f)) > 0) {
        if (f.number == number && f.wire == WIRE_BYTES)
            found = f.bytes;
    }
    *bytes = found;
    return r;
}

static int read_value(struct sst_onnx_value *v, struct sst_onnx_str bytes, const char *name)
{
    struct sst_onnx_str label = bytes, type = bytes, tensor;
    struct field f;
    int r;

    /* ValueInfo.type.tensor_type holds elem_type and shape, which is a list of dim */
    if (descend(&label, 1) || descend(&type, 2) || descend(&type, 1))
        return damaged(name, "an input or output ends early");
    for (tensor = type; next_field(&tensor, &f) > 0;) {
        if (f.number == 1 && f.wire == WIRE_VARINT)
            v->type = f.value <= INT32_MAX ? (int)f.value : -1;
    }
    if (descend(&type, 2))
        return damaged(name, "an input or output ends early");
    v->name = label;
    while ((r = next_field(&type, &f)) > 0) {
        struct sst_onnx_str dim = f.bytes;
        struct field d;

        if (f.number != 1 || f.wire != WIRE_BYTES)
            continue;
        if (v->n_dims == SST_ONNX_MAX_DIMS)
            return damaged(name, "an input or output has more than 8 dimensions");
        while ((r = next_field(&dim, &d)) > 0) {
            if (d.number == 1 && d.wire == WIRE_VARINT)
                v->dims[v->n_dims] = (int64_t)d.value;
        }
        if (r || v->dims[v->n_dims] < 0 || v->dims[v->n_dims] > SST_ONNX_MAX_ELEMENTS)
            return damaged(name, "an input or output has an impossible dimension");
        v->n_dims++;
    }
    return r ? damaged(name, "an input or output ends early") : 0;
}

static int read_graph(struct sst_onnx *m, struct sst_onnx_str bytes, const char *name)
{
    struct field f;
    int r, err = 0;

    while (!err && (r = next_field(&bytes, &f)) > 0) {
        struct sst_onnx_tensor *t;
        struct sst_onnx_value *v;

        if (f.wire != WIRE_BYTES)
            continue;
        if (f.number == 1) {
            err = read_node(m, f.bytes, name);
        } else if (f.number == 5) {
            t = add(
                &(struct table){ (void **)&m->tensors, &m->n_tensors, SST_ONNX_MAX_TENSORS, sizeof(*t), "constants" },
                name, &err);
            if (t)
                err = sst_onnx_tensor_read(t, f.bytes, name);
        } else if (f.number == 11 || f.number == 12) {
            v = f.number == 11
                    ? add(&(struct table){ (void **)&m->ins, &m->n_ins, SST_ONNX_MAX_TENSORS, sizeof(*v), "inputs" },
                          name, &err)
                    : add(&(struct table){ (void **)&m->outs, &m->n_outs, SST_ONNX_MAX_TENSORS, sizeof(*v), "outputs" },
                          name, &err);
            if (v)
                err = read_value(v, f.bytes, name);
        } else if (f.number == 15) {
            return damaged(name, "it holds sparse constants, which are not read");
        }
    }
    if (err)
        return err;
    return r ? damaged(name, "the graph ends early") : 0;
}

static int read_metadata(struct sst_onnx *m, struct sst_onnx_str bytes, const char *name)
{
    struct sst_onnx_metadata *meta;
    int err = 0;

    meta = add(&(struct table){ (void **)&m->metadata, &m->n_metadata, SST_ONNX_MAX_METADATA, sizeof(*meta),
                                "metadata entries" },
               name, &err);
    if (!meta)
        return err;
    meta->key = meta->value = bytes;
    if (descend(&meta->key, 1) || descend(&meta->value, 2))
        return damaged(name, "a metadata entry ends early");
    return 0;
}

static int read_opset(struct sst_onnx *m, struct sst_onnx_str bytes, const char *name)
{
    struct sst_onnx_str domain = { "", 0 };
    struct field f;
    int64_t version = 0;
    int r;

    while ((r = next_field(&bytes, &f)) > 0) {
        if (f.number == 1 && f.wire == WIRE_BYTES)
            domain = f.bytes;
        else if (f.number == 2)
            version = (int64_t)f.value;
    }
    if (r)
        return damaged(name, "an operator set ends early");
    if (!domain.n || sst_onnx_str_is(domain, "ai.onnx"))
        m->opset = version;
    return 0;
}

static int read_model(struct sst_onnx *m, struct sst_onnx_str bytes, const char *name)
{
    bool graph = false;
    struct field f;
    int r, err = 0;

    while (!err && (r = next_field(&bytes, &f)) > 0) {
        if (f.wire != WIRE_BYTES)
            continue;
        if (f.number == 7) {
            if (graph)
                return damaged(name, "it holds two graphs");
            graph = true;
            err = read_graph(m, f.bytes, name);
        } else if (f.number == 8) {
            err = read_opset(m, f.bytes, name);
        } else if (f.number == 14) {
            err = read_metadata(m, f.bytes, name);
        }
    }
    if (err)
        return err;
    if (r)
        return damaged(name, "it ends early or is not an ONNX file");
    return graph && m->n_nodes ? 0 : damaged(name, "it holds no network");
}

int sst_onnx_parse(struct sst_onnx *out, const uint8_t *data, size_t size, const char *name)
{
    struct sst_onnx m = { 0 };
    int err;

    if (size > SST_ONNX_MAX_BYTES) {
        sst_log_error("model %s has %zu bytes; networks of more than 64 MiB are refused", name, size);
        return -EBADMSG;
    }
    err = read_model(&m, (struct sst_onnx_str){ (const char *)data, size }, name);
    if (err == -ENOMEM)
        sst_log_error("model %s: not enough memory to read it", name);
    if (err)
        sst_onnx_fini(&m);
    else
        *out = m;
    return err;
}

void sst_onnx_fini(struct sst_onnx *model)
{
    for (int i = 0; i < model->n_tensors; i++)
        sst_onnx_tensor_fini(&model->tensors[i]);
    free(model->nodes);
    free(model->tensors);
    free(model->ins);
    free(model->outs);
    free(model->metadata);
    *model = (struct sst_onnx){ 0 };
}
