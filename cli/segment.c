#include <stdlib.h>

#include "base/log.h"
#include "base/thread.h"
#include "cli/cli.h"
#include "cli/precision.h"
#include "pipeline/image/codec.h"
#include "pipeline/labels/labels.h"
#include "pipeline/network/model_path.h"

struct options {
    const char *image, *precision, *model, *labels, *prob, *entropy;
    double eps_h; /* below 0: not given */
    bool hcsm;
    int threads;
};

struct result {
    struct sst_map_u8 label;
    struct sst_map_f32 entropy;
    float *prob;
};

static int label_image(struct result *out, struct sst_segmenter *seg, const struct options *o)
{
    struct sst_image img = { 0 };
    int err = sst_image_read(&img, o->image);

    if (!err)
        err = sst_segment(seg, &img, &out->label, &out->entropy, o->prob ? &out->prob : NULL);
    if (!err && (o->hcsm || o->eps_h >= 0))
        sst_hcsm(&out->label, &out->entropy, o->eps_h >= 0 ? o->eps_h : sst_segmenter_eps_h(seg));
    sst_image_fini(&img);
    return err;
}

static int write_result(const struct result *r, const struct sst_segmenter *seg, const struct options *o)
{
    const size_t dims[3] = { (size_t)sst_segmenter_classes(seg)->count, (size_t)r->label.height,
                             (size_t)r->label.width };
    int err = 0;

    if (o->prob)
        err = sst_npy_write_f32(r->prob, dims, 3, o->prob);
    if (!err && o->entropy)
        err = sst_map_f32_write_pfm(&r->entropy, o->entropy);
    return err ? err : sst_map_u8_write_png(&r->label, o->labels, sst_classes_palette());
}

static int segment(const struct options *o)
{
    char path[SST_PATH_MAX];
    struct sst_segmenter *seg = NULL;
    struct result r = { 0 };
    enum sst_precision precision = SST_PRECISION_AUTO;
    int err = cli_precision(&precision, o->precision);

    if (!err)
        err = o->model ? sst_path_join(path, o->model, NULL) : sst_model_path(path, "pspnet-small.onnx");

    if (!err)
        err = sst_segmenter_open(&seg, path, precision, sst_thread_count(o->threads));
    if (!err)
        err = label_image(&r, seg, o);
    if (!err)
        err = write_result(&r, seg, o);
    sst_map_u8_fini(&r.label);
    sst_map_f32_fini(&r.entropy);
    free(r.prob);
    sst_segmenter_close(seg);
    return err;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct options o = { .eps_h = -1 };
    const struct cli_option options[] = {
        { "output", 'o', CLI_STRING, &o.labels, "FILE", "labels as an indexed PNG: class index + 1, 0 = unlabeled", 0,
          0 },
        { "model", 'm', CLI_STRING, &o.model, "FILE", "ONNX network (default: the one that ships)", 0, 0 },
        { "precision", 0, CLI_STRING, &o.precision, "NAME", CLI_PRECISION_HELP, 0, 0 },
        { "prob", 0, CLI_STRING, &o.prob, "FILE", "write the probabilities as .npy [class][y][x]", 0, 0 },
        { "entropy", 0, CLI_STRING, &o.entropy, "FILE", "write the entropy as .pfm", 0, 0 },
        { "hcsm", 0, CLI_FLAG, &o.hcsm, NULL, "drop labels above the model's entropy threshold", 0, 0 },
        { "epsilon-h", 0, CLI_DOUBLE, &o.eps_h, "V", "drop labels whose entropy is not below V", 0, 1e9 },
        { "threads", 't', CLI_INT, &o.threads, "N", "threads (0: all processors)", 0, 256 },
    };
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, &o.image, 1, 1);

    if (r != CLI_GO_ON)
        return r;
    if (!o.labels)
        return cli_usage_error(cmd, "-o FILE is missing");
    return cli_exit_code(segment(&o));
}

const struct cli_command cli_segment = {
    .name = "segment",
    .usage = "IMAGE -o labels.png [--model FILE] [--hcsm | --epsilon-h V]",
    .summary = "semantic labels of one image",
    .detail = "Without --hcsm and --epsilon-h every pixel gets its most probable class; with one of them, pixels whose "
              "label\n"
              "distribution has an entropy (natural log) at or above the threshold stay unlabeled.",
    .example = "sst segment view.png -o labels.png --hcsm --prob prob.npy",
    .run = run,
};
