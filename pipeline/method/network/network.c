/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/network.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/method/network/graph.h"
#include "pipeline/method/network/manifest.h"
#include "pipeline/method/network/network_internal.h"
#include "pipeline/method/network/onnx.h"
#include "pipeline/method/network/opencv_net.h"

struct metadata {
    char *key, *value;
};

struct sst_network {
    /* fixed after open */
    char path[SST_PATH_MAX];
    int threads, in_channels, in_width, in_height, n_metadata;
    enum sst_precision precision; /* never auto */
    struct metadata *metadata;
    enum sst_network_values values; /* of the result */
    char last_op[24];               /* that makes them probabilities */
    struct sst_graph graph;         /* of the runner oneDNN */
    struct cv_net *cv;              /* of the runner OpenCV, else NULL */
    /* fixed after sst_network_use_runner() */
    struct sst_runner_user *user; /* NULL: none */
    uint64_t id;                       /* there */
    /* for the size used last */
    int width, height;
    struct sst_shape out;
    struct net_plan *plan; /* NULL: not needed yet, with a runner */
};

static char *copy_str(struct sst_onnx_str s)
{
    char *p = malloc(s.n + 1);

    if (p) {
        memcpy(p, s.n ? s.p : "", s.n);
        p[s.n] = 0;
    }
    return p;
}

static int copy_metadata(struct sst_network *net, const struct sst_onnx *model)
{
    net->metadata = calloc((size_t)model->n_metadata + 1, sizeof(*net->metadata));
    if (!net->metadata)
        return -ENOMEM;
    for (int i = 0; i < model->n_metadata; i++) {
        struct metadata *m = &net->metadata[net->n_metadata++];

        m->key = copy_str(model->metadata[i].key);
        m->value = copy_str(model->metadata[i].value);
        if (!m->key || !m->value)
            return -ENOMEM;
    }
    return 0;
}

/* The first input that is not a constant, or NULL. */
static const struct sst_onnx_value *find_input(const struct sst_onnx *model)
{
    for (int i = 0; i < model->n_ins; i++) {
        if (!sst_onnx_is_constant(model, &model->ins[i]))
            return &model->ins[i];
    }
    return NULL;
}

static int unfit(const struct sst_network *net, const char *what)
{
    sst_log_error("model %s: %s", net->path, what);
    return -EBADMSG;
}

/* The values of the result must say how probable each class is. */
static int check_ending(struct sst_network *net, const struct sst_onnx *model)
{
    struct sst_onnx_str op = { 0 };
    char what[224];

    net->values = sst_onnx_ending(model, &op);
    snprintf(net->last_op, sizeof(net->last_op), "%.*s", SST_ONNX_STR(op));
    if (net->values == SST_NETWORK_CLASSES) {
        snprintf(what, sizeof(what),
                 "it ends in %s: its output holds whole numbers of classes, not one value per class; export the network"
                 " up to its logits",
                 net->last_op);
        return unfit(net, what);
    }
    if (net->values == SST_NETWORK_OTHER_AXIS) {
        snprintf(what, sizeof(what),
                 "it ends in %s, but not over the channels, which are axis 1; export it with that axis, or up to its"
                 " logits",
                 net->last_op);
        return unfit(net, what);
    }
    return 0;
}

/* Input and output must be numeric images, channels first. */
static int check_ends(struct sst_network *net, const struct sst_onnx *model)
{
    const struct sst_onnx_value *in = find_input(model), *out = model->n_outs ? &model->outs[0] : NULL;
    int err = check_ending(net, model);

    if (err)
        return err;
    if (out && out->type != SST_ONNX_FLOAT && out->type != SST_ONNX_HALF && out->type != 0)
        return unfit(net, "its output holds whole numbers (classes, by an ArgMax at its end?), not one value per class;"
                          " export the network up to its logits");
    if (!in)
        return unfit(net, "it has no input; export the network with its image as the input");
    if (in->type != SST_ONNX_FLOAT && in->type != 0)
        return unfit(net, "its input is not of 32-bit floats; export it for float32 images");
    if (in->n_dims == 4 && in->dims[3] >= 1 && in->dims[3] <= 4 && (in->dims[1] == 0 || in->dims[1] > 4))
        return unfit(net, "its input is height x width x channels (NHWC); export it as channels x height x width"
                          " (NCHW)");
    if (in->n_dims != 4 || in->dims[0] > 1 || in->dims[1] < 1 || in->dims[1] > 4096)
        return unfit(net, "its input is not 1 x C x height x width with a fixed C of 1..4096; export it so");
    net->in_channels = (int)in->dims[1];
    if (in->dims[2] && in->dims[3]) {
        net->in_height = (int)in->dims[2];
        net->in_width = (int)in->dims[3];
    }
    return 0;
}

#if WITH_DNNL
/* Choose the precision of a network that oneDNN runs. */
static int choose_precision(struct sst_network *net)
{
    if (net->precision == SST_PRECISION_INT8 && !net->graph.range) {
        sst_log_error("model %s: it has no ranges to run on 8 bits; add them with models/quantise.py or use"
                      " --precision f32",
                      net->path);
        return -ENOTSUP;
    }
    if (net->precision == SST_PRECISION_AUTO)
        net->precision = net->graph.range && net_plan_int8_pays() ? SST_PRECISION_INT8 : SST_PRECISION_F32;
    return 0;
}
#endif

/* OpenCV reads such a node as if the file were of an older opset. */
static bool leaves_axis_out(const struct sst_onnx *model)
{
    struct sst_onnx_attr axis;

    for (int i = 0; model->opset >= 13 && i < model->n_nodes; i++) {
        const struct sst_onnx_node *node = &model->nodes[i];

        if ((sst_onnx_str_is(node->op, "Softmax") || sst_onnx_str_is(node->op, "LogSoftmax")) &&
            !sst_onnx_attr_find(node, "axis", &axis))
            return true;
    }
    return false;
}

static int open_opencv(struct sst_network *net, const struct sst_onnx *model, const uint8_t *data, size_t size,
                       const char *reason)
{
    char why[256];
    int err = -EINVAL;

    if (net->precision == SST_PRECISION_INT8) {
        sst_log_error("model %s: %s, and OpenCV runs networks on floats only; use --precision f32", net->path, reason);
        return -ENOTSUP;
    }
    net->precision = SST_PRECISION_F32;
    if (leaves_axis_out(model))
        strcpy(why, "it takes axis 1 for a Softmax without an axis, the last one since opset 13");
    else if (model->n_outs == 1)
        err = cv_net_open(&net->cv, data, size, why);
    else
        strcpy(why, "it has several outputs");
    if (!err) {
        sst_log_warning("model %s: %s, so OpenCV runs the network, several times slower", net->path, reason);
        return 0;
    }
    if (err == -ENOMEM)
        sst_log_error("model %s: not enough memory to read it", net->path);
    else
        sst_log_error("model %s: %s, and OpenCV cannot run the network either (%s); export it with plain layers",
                      net->path, reason, why);
    return err == -ENOMEM ? err : -ENOTSUP;
}

static int open_from_memory(struct sst_network *net, const uint8_t *data, size_t size)
{
    char reason[320] = "oneDNN is not built in";
    struct sst_onnx model;
    int err = sst_onnx_parse(&model, data, size, net->path);

    if (err)
        return err;
    err = copy_metadata(net, &model);
    if (err == -ENOMEM)
        sst_log_error("model %s: not enough memory to read it", net->path);
    err = err ? err : check_ends(net, &model);
    if (err)
        goto done;
#if WITH_DNNL
    char why[256] = "";

    err = sst_graph_build(&net->graph, &model, net->path, why);
    snprintf(reason, sizeof(reason), "%s is not supported on oneDNN", why);
#else
    err = -ENOTSUP;
#endif
    if (err == -ENOTSUP)
        err = open_opencv(net, &model, data, size, reason);
    else if (err == -ENOMEM)
        sst_log_error("model %s: not enough memory to read it", net->path);
done:
    sst_onnx_fini(&model);
    return err;
}

int sst_network_open(struct sst_network **out, const char *path, enum sst_precision precision, int threads)
{
    struct sst_network *net = calloc(1, sizeof(*net));
    uint8_t *data = NULL;
    size_t size;
    int err = -ENOMEM;

    if (!net)
        return err;
    net->threads = threads;
    net->precision = precision;
    err = sst_path_join(net->path, path, NULL);
    err = err ? err : sst_file_read(path, SST_ONNX_MAX_BYTES, &data, &size);
    err = err ? err : sst_manifest_check(path, data, size);
    err = err ? err : open_from_memory(net, data, size);
#if WITH_DNNL
    if (!err && !net->cv)
        err = choose_precision(net);
#endif
    free(data);
    if (err)
        sst_network_close(net);
    else
        *out = net;
    return err;
}

void sst_network_close(struct sst_network *net)
{
    if (!net)
        return;
#if WITH_DNNL
    net_plan_destroy(net->plan);
#endif
    cv_net_close(net->cv);
    sst_graph_fini(&net->graph);
    for (int i = 0; i < net->n_metadata; i++) {
        free(net->metadata[i].key);
        free(net->metadata[i].value);
    }
    free(net->metadata);
    free(net);
}

#if WITH_DNNL
/* FNV-1a, by words. */
static uint64_t hash_floats(uint64_t hash, const float *values, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        uint32_t word;

        memcpy(&word, &values[i], sizeof(word));
        hash = (hash ^ word) * 0x100000001b3;
    }
    return hash;
}

static uint64_t find_id(const struct sst_network *net)
{
    uint64_t hash = 0xcbf29ce484222325;

    for (const char *c = net->path; *c; c++)
        hash = (hash ^ (uint8_t)*c) * 0x100000001b3;
    for (int i = 0; i < net->graph.n_ops; i++) {
        const struct sst_op *op = &net->graph.ops[i];

        if (op->kind != SST_OP_CONV)
            continue;
        hash = hash_floats(hash, op->weights,
                           (size_t)op->channels * (size_t)op->group_in * (size_t)op->kernel[0] * (size_t)op->kernel[1]);
        hash = hash_floats(hash, op->bias, (size_t)op->channels);
    }
    return hash;
}
#endif

void sst_network_use_runner(struct sst_network *net, struct sst_runner_user *user)
{
    net->user = user;
#if WITH_DNNL
    if (user && !net->cv)
        net->id = find_id(net);
#endif
}

const char *sst_network_runner(const struct sst_network *net)
{
    return net->cv ? "opencv" : "onednn";
}

enum sst_precision sst_network_precision(const struct sst_network *net)
{
    return net->precision;
}

const char *sst_network_metadata(const struct sst_network *net, const char *key)
{
    for (int i = 0; i < net->n_metadata; i++) {
        if (!strcmp(net->metadata[i].key, key))
            return net->metadata[i].value;
    }
    return NULL;
}

const char *sst_network_ends_in_probabilities(const struct sst_network *net, bool *logarithm)
{
    *logarithm = net->values == SST_NETWORK_LOGARITHMS;
    return net->values == SST_NETWORK_PROBABILITIES || *logarithm ? net->last_op : NULL;
}

const char *sst_network_ends_scaled(const struct sst_network *net)
{
    return net->values == SST_NETWORK_SCALED ? net->last_op : NULL;
}

int sst_network_in_channels(const struct sst_network *net)
{
    return net->in_channels;
}

void sst_network_in_size(const struct sst_network *net, int *width, int *height)
{
    *width = net->in_width;
    *height = net->in_height;
}

/* --- one size at a time --------------------------------------------------------------------------- */

#if WITH_DNNL
static struct net_job job_of(struct sst_network *net, int width, int height)
{
    return (struct net_job){ .cfg = { &net->graph, net->path, width, height, net->threads, net->precision },
                             .plan = &net->plan,
                             .user = net->user,
                             .id = net->id };
}

/* With a runner, the plan is made when the CPU runs the network. */
static int plan_dnnl(struct sst_network *net, int width, int height)
{
    const struct net_job job = job_of(net, width, height);
    struct sst_shape *shapes = calloc((size_t)net->graph.n_values, sizeof(*shapes));
    int err = shapes ? sst_graph_shapes(&net->graph, width, height, shapes, net->path) : -ENOMEM;

    if (!err)
        net->out = shapes[net->graph.output];
    if (!err && !net->user)
        err = net_plan_create(&net->plan, &job.cfg);
    free(shapes);
    return err;
}

/* True if the network's last layer brings vectors to a length. */
static bool ends_in_norm(const struct sst_network *net)
{
    return net->graph.n_ops && net->graph.ops[net->graph.n_ops - 1].kind == SST_OP_NORMALIZE &&
           net->graph.ops[net->graph.n_ops - 1].out == net->graph.output;
}
#endif

bool sst_network_accepts(const struct sst_network *net, int width, int height)
{
    struct sst_shape *shapes;
    bool ok;

    if (net->cv)
        return true;
    shapes = calloc((size_t)net->graph.n_values, sizeof(*shapes));
    ok = shapes && !sst_graph_shapes(&net->graph, width, height, shapes, NULL);
    free(shapes);
    return ok;
}

/* @param result  out, of the shape net->out, which is set; owner: net */
static int run_opencv(struct sst_network *net, const float *in, int width, int height, const float **result)
{
    const struct cv_net_input input = { in, { net->in_channels, height, width }, net->threads };
    char why[256] = "";
    int shape[3], err;

    sst_run_note(net->user, 0, "OpenCV runs the network");
    err = cv_net_run(net->cv, &input, result, shape, why);
    if (err == -ENOMEM)
        sst_log_error("model %s: not enough memory for an image of %d x %d; use a smaller one", net->path, width,
                      height);
    else if (err)
        sst_log_error("model %s: OpenCV cannot run it on an image of %d x %d (%s); use another size or model",
                      net->path, width, height, why);
    else
        net->out = (struct sst_shape){ shape[0], shape[1], shape[2] };
    return err;
}

/* OpenCV reveals the shape of a result only by computing one. */
static int plan_opencv(struct sst_network *net, int width, int height)
{
    float *in = calloc((size_t)net->in_channels * (size_t)width, (size_t)height * sizeof(*in));
    const float *result;
    int err = in ? run_opencv(net, in, width, height, &result) : -ENOMEM;

    free(in);
    return err;
}

static int plan(struct sst_network *net, int width, int height)
{
    int err = -ENOTSUP; /* not reached: open found a runner */

    if (net->width == width && net->height == height)
        return 0;
    if (width < 1 || height < 1 || (int64_t)width * height > SST_ONNX_MAX_ELEMENTS / net->in_channels) {
        sst_log_error("model %s: an image of %d x %d is empty or too large", net->path, width, height);
        return -EINVAL;
    }
    net->width = net->height = 0;
#if WITH_DNNL
    net_plan_destroy(net->plan);
    net->plan = NULL;
    if (!net->cv)
        err = plan_dnnl(net, width, height);
#endif
    if (net->cv)
        err = plan_opencv(net, width, height);
    if (err)
        return err;
    net->width = width;
    net->height = height;
    return 0;
}

int sst_network_out_shape(struct sst_network *net, int width, int height, struct sst_shape *out)
{
    const int err = plan(net, width, height);

    if (!err)
        *out = net->out;
    return err;
}

int sst_network_run(struct sst_network *net, const float *in, int width, int height, float *out)
{
    int err = plan(net, width, height);

    if (err)
        return err;
    if (net->cv) {
        const float *result;

        err = run_opencv(net, in, width, height, &result);
        if (!err)
            memcpy(out, result, (size_t)net->out.c * (size_t)net->out.h * (size_t)net->out.w * sizeof(*out));
        return err;
    }
#if WITH_DNNL
    struct net_job job = job_of(net, width, height);

    job.in = in;
    job.out = out;
    err = net_job_run(&job);
#endif
    return err;
}

/* Via floats. */
static int run_rounded(struct sst_network *net, const struct sst_network_bytes *run)
{
    const size_t plane = (size_t)net->out.h * (size_t)net->out.w, c = (size_t)net->out.c;
    float *values = sst_mem_alloc_raw(plane * c, sizeof(*values));
    int err = values ? 0 : -ENOMEM;

    if (err)
        sst_log_error("model %s: not enough memory for an image of %d x %d; use a smaller one", net->path, run->width,
                      run->height);
    err = err ? err : sst_network_run(net, run->in, run->width, run->height, values);
    for (size_t i = 0; !err && i < plane * c; i++)
        run->out[i] = op_to_byte(values[i % c * plane + i / c] * run->factor);
    sst_mem_free(values);
    return err;
}

int sst_network_run_s8(struct sst_network *net, const struct sst_network_bytes *run)
{
    const int err = plan(net, run->width, run->height);

    if (err)
        return err;
#if WITH_DNNL
    if (!net->cv && ends_in_norm(net)) {
        struct net_job job = job_of(net, run->width, run->height);

        job.in = run->in;
        job.out_s8 = run->out;
        job.factor = run->factor;
        job.keeper = run->keeper;
        return net_job_run(&job);
    }
#endif
    return run_rounded(net, run);
}
