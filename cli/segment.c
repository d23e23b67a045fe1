/* sst segment: labels of images with one load of the network. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "base/stats.h"
#include "base/thread.h"
#include "cli/cli_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/network/model_path.h"

struct options {
    const char *model, *output, *prob, *entropy, *scale, *device;
    enum sst_precision precision;
    double eps_h; /* below 0: unset */
    struct sst_segment_config layout;
    bool hcsm, json;
    int threads, device_memory;
};

/* Images to label. */
struct inputs {
    char **paths;
    int count, room;
    bool batch; /* -o, --prob and --entropy name folders */
};

struct result {
    struct sst_map_u8 label;
    struct sst_map_f32 entropy;
    float *prob;
};

/* --- input images and result paths -------------------------------------------------------- */

static int add_path(struct inputs *in, const char *dir, const char *name)
{
    char path[SST_PATH_MAX];

    if (sst_path_join(path, dir, name))
        return -ENAMETOOLONG;
    if (!sst_mem_grow(&in->paths, in->count, &in->room, sizeof(*in->paths)))
        return -ENOMEM;
    in->paths[in->count] = strdup(path);
    return in->paths[in->count++] ? 0 : -ENOMEM;
}

/* The pictures of a folder, by name. */
static int add_folder(struct inputs *in, const char *dir)
{
    const int first = in->count;
    DIR *d = opendir(dir);
    const struct dirent *entry;
    int err = d ? 0 : -errno;

    while (!err && (entry = readdir(d))) {
        if (sst_image_is_picture(entry->d_name))
            err = add_path(in, dir, entry->d_name);
    }
    if (d)
        closedir(d);
    if (!err && in->count == first)
        err = -ENODATA;
    if (err)
        sst_log_error("%s: %s; give images or a folder with PNG, JPEG or TIFF files", dir,
                      err == -ENODATA ? "no PNG, JPEG or TIFF file in it" : strerror(-err));
    else
        sst_stats_sort_strings(in->paths + first, in->count - first);
    return err;
}

/* DIR/NAME without its ending, and `ending`. */
static int result_path(char out[SST_PATH_MAX], const char *dir, const char *image, const char *ending)
{
    const char *base = sst_path_base(image), *dot = strrchr(base, '.');
    const int n = dot && dot != base ? (int)(dot - base) : (int)strlen(base);

    if (snprintf(out, SST_PATH_MAX, "%s/%.*s%s", dir, n, base, ending) < SST_PATH_MAX)
        return 0;
    sst_log_error("%s: the path of the result in %s is too long; choose a shorter one", image, dir);
    return -ENAMETOOLONG;
}

/* Two images of one name would overwrite each other's result; one in that folder would be overwritten itself. */
static int check_names(const struct inputs *in, const char *dir)
{
    char **names = calloc((size_t)in->count, sizeof(*names)), path[SST_PATH_MAX];
    int err = names ? 0 : -ENOMEM;

    for (int i = 0; !err && i < in->count; i++) {
        err = result_path(path, dir, in->paths[i], ".png");
        err = err ? err : sst_path_check_keeps(path, in->paths[i]);
        names[i] = err ? NULL : strdup(path);
        err = err || names[i] ? err : -ENOMEM;
    }
    if (!err)
        sst_stats_sort_strings(names, in->count);
    for (int i = 1; !err && i < in->count; i++) {
        if (!strcmp(names[i - 1], names[i])) {
            sst_log_error(
                "%s would be written twice: two of the images have this name; label them one folder at a time",
                names[i]);
            err = -EINVAL;
        }
    }
    for (int i = 0; names && i < in->count; i++)
        free(names[i]);
    free(names);
    return err;
}

/* Results of one image: each is a file of its own. */
static int check_apart(const struct options *o)
{
    const char *const files[] = { o->output, o->prob, o->entropy };

    for (size_t i = 1; i < ARRAY_LEN(files); i++) {
        for (size_t k = 0; k < i; k++) {
            if (files[i] && files[k] && sst_path_is_same(files[i], files[k])) {
                sst_log_error("%s would be written twice; name a file for each of -o, --prob and --entropy", files[i]);
                return -EINVAL;
            }
        }
    }
    return 0;
}

static int find_inputs(struct inputs *in, const char *const *args, const struct options *o)
{
    int err = 0;

    for (; *args && !err; args++) {
        const bool folder = sst_path_is_dir(*args);

        err = folder ? add_folder(in, *args) : add_path(in, *args, NULL);
        in->batch |= folder;
    }
    in->batch |= in->count > 1 || sst_path_is_dir(o->output);
    if (!err && in->batch) {
        const char *const folders[] = { o->output, o->prob, o->entropy };

        err = check_names(in, o->output);
        for (size_t i = 0; i < ARRAY_LEN(folders) && !err; i++)
            err = folders[i] ? sst_path_make_dir(folders[i]) : 0;
    }
    return err || in->batch ? err : check_apart(o);
}

/* --- one image ------------------------------------------------------------------------------------ */

static void result_fini(struct result *r)
{
    sst_map_u8_fini(&r->label);
    sst_map_f32_fini(&r->entropy);
    free(r->prob);
    *r = (struct result){ 0 };
}

/* Now, in wall and CPU time. */
static void clocks(double ms[2])
{
    ms[0] = (double)sst_clock_now_ns() * 1e-6;
    ms[1] = (double)sst_clock_cpu_ns() * 1e-6;
}

static int label_image(struct result *out, double ms[2], struct sst_segmenter *seg, const char *path,
                       const struct options *o)
{
    double end[2];
    const bool hcsm = o->hcsm || o->eps_h >= 0;
    struct sst_image img = { 0 };
    int err = sst_image_read_upright(&img, path);

    clocks(ms);
    if (!err)
        err =
            sst_segment(seg, &img, &out->label, hcsm || o->entropy ? &out->entropy : NULL, o->prob ? &out->prob : NULL);
    clocks(end);
    for (int i = 0; i < 2; i++)
        ms[i] = end[i] - ms[i];
    if (!err && hcsm)
        sst_hcsm(&out->label, &out->entropy, o->eps_h >= 0 ? o->eps_h : sst_segmenter_eps_h(seg));
    sst_image_fini(&img);
    return err;
}

/* Path of a result: the named file, or one in the named folder. */
static int output_path(char out[SST_PATH_MAX], const char *named, const char *image, const char *ending, bool batch)
{
    return batch ? result_path(out, named, image, ending) : sst_path_join(out, named, NULL);
}

static int write_result(const struct result *r, int classes, const char *image, const struct options *o, bool batch)
{
    const size_t dims[3] = { (size_t)classes, (size_t)r->label.height, (size_t)r->label.width };
    char path[SST_PATH_MAX];
    int err = 0;

    if (o->prob) {
        err = output_path(path, o->prob, image, ".npy", batch);
        err = err ? err : sst_npy_write_f32(r->prob, dims, 3, path);
    }
    if (!err && o->entropy) {
        err = output_path(path, o->entropy, image, ".pfm", batch);
        err = err ? err : sst_map_f32_write_pfm(&r->entropy, path);
    }
    err = err ? err : output_path(path, o->output, image, ".png", batch);
    return err ? err : sst_map_u8_write_png(&r->label, path, sst_classes_palette());
}

/* Classes in percent of the pixels. */
static json_t *image_json(const struct sst_map_u8 *label, const struct sst_classes *classes, const char *image,
                          const double ms[2])
{
    json_t *found = json_object();
    int64_t pixels[256] = { 0 };

    for (int y = 0; y < label->height; y++) {
        const uint8_t *row = sst_map_u8_row(label, y);

        for (int x = 0; x < label->width; x++)
            pixels[row[x]]++;
    }
    for (int i = 0; i <= classes->count; i++) {
        if (pixels[i])
            json_object_set_new(found, sst_classes_name(classes, i),
                                json_real(100.0 * (double)pixels[i] / ((double)label->width * label->height)));
    }
    return json_pack("{s:s, s:i, s:i, s:f, s:f, s:o}", "image", image, "width", label->width, "height", label->height,
                     "ms", ms[0], "cpu_ms", ms[1], "percent", found);
}

/* --- the run ------------------------------------------------------------------------------------------ */

/* A damaged image is reported and the others are labelled; a full disk or lack of memory ends the run. */
static int label_all(json_t *list, struct sst_segmenter *seg, const struct inputs *in, const struct options *o)
{
    const struct sst_classes *classes = sst_segmenter_classes(seg);
    int first = 0;

    for (int i = 0; i < in->count; i++) {
        struct result r = { 0 };
        double ms[2] = { 0, 0 };
        int err;

        cli_progress((void *)(uintptr_t) "labels", (double)i / in->count);
        err = label_image(&r, ms, seg, in->paths[i], o);
        err = err ? err : write_result(&r, classes->count, in->paths[i], o, in->batch);
        json_array_append_new(list, err ? json_pack("{s:s, s:s}", "image", in->paths[i], "error", strerror(-err))
                                        : image_json(&r.label, classes, in->paths[i], ms));
        result_fini(&r);
        first = first ? first : err;
        if (err && cli_exit_code(err) != CLI_INPUT)
            break;
    }
    cli_progress_end();
    return first;
}

static int print_json(json_t *images, const char *model, double load_ms, struct sst_runner_user *device)
{
    json_t *root = json_pack("{s:s, s:f, s:o, s:O}", "model", model, "load_ms", load_ms, "device",
                             cli_network_device_json(device), "images", images);

    return cli_dump_json(root, JSON_INDENT(2) | JSON_REAL_PRECISION(6)) ? -ENOMEM : 0;
}

static int segment(const char *const *args, const struct options *o)
{
    const int64_t start_ns = sst_clock_now_ns();
    char path[SST_PATH_MAX];
    struct sst_runner_user *device = NULL;
    struct sst_segmenter *seg = NULL;
    struct inputs in = { 0 };
    json_t *images = json_array();
    double load_ms;
    int err, printed;

    err = o->model ? sst_model_resolve(path, o->model) : sst_model_path(path, "pspnet-small.onnx");
    err = err ? err : sst_network_device_open(&device, o->device, (uint64_t)o->device_memory << 20);
    err = err ? err : sst_segmenter_open(&seg, path, o->precision, sst_thread_count(o->threads));
    load_ms = (double)(sst_clock_now_ns() - start_ns) * 1e-6;
    err = err ? err : find_inputs(&in, args, o);
    if (!err) {
        sst_segmenter_configure(seg, &o->layout);
        sst_segmenter_use_runner(seg, device);
        err = label_all(images, seg, &in, o);
        printed = o->json ? print_json(images, path, load_ms, device) : 0;
        cli_network_report_device(device);
        err = err ? err : printed;
    }
    json_decref(images);
    for (int i = 0; i < in.count; i++)
        free(in.paths[i]);
    free(in.paths);
    sst_segmenter_close(seg);
    sst_network_device_close(device);
    return err;
}

static int read_scale(const struct cli_command *cmd, struct options *o)
{
    char *end;

    if (!o->scale || !strcmp(o->scale, "auto"))
        return CLI_GO_ON;
    o->layout.scale = strtod(o->scale, &end);
    if (end == o->scale || *end || !(o->layout.scale >= 0.1 && o->layout.scale <= 16))
        return cli_usage_error(cmd, "--scale %s is neither auto nor a number in 0.1..16", o->scale);
    return CLI_GO_ON;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct options o = { .eps_h = -1, .device = "cpu" };
    const char **args = calloc((size_t)argc + 1, sizeof(*args));
    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &o.output, "FILE|DIR", "labels as indexed PNG: class index + 1, 0 = unlabeled" },
        { "model", 'm', CLI_STRING, &o.model, "NAME", "installed network (see sst models) or ONNX file" },
        CLI_PRECISION_OPTION(o.precision),
        { "prob", 0, CLI_MADE, &o.prob, "FILE|DIR", "write the probabilities as .npy [class][y][x]" },
        { "entropy", 0, CLI_MADE, &o.entropy, "FILE|DIR", "write the entropy as .pfm" },
        { "hcsm", 0, CLI_FLAG, &o.hcsm, NULL, "drop labels above the model's entropy threshold" },
        { "epsilon-h", 0, CLI_DOUBLE, &o.eps_h, "V", "drop labels with an entropy not below V", 0, 1e9 },
        { "scale", 0, CLI_STRING, &o.scale, "S", "scale of the network's input: auto, or 1 = its nominal size" },
        { "tiles", 0, CLI_FLAG, &o.layout.windows, NULL, "overlapping windows of the network's nominal size" },
        { "device", 0, CLI_STRING, &o.device, "D",
          "where the network runs: cpu (default), gpu, auto (gpu if there is one) or a part of a device's name" },
        { "device-memory", 0, CLI_INT, &o.device_memory, "MIB", CLI_DEVICE_MEMORY_HELP, 1, 1 << 24 },
        { "json", 0, CLI_FLAG, &o.json, NULL, "print one JSON object: time and classes of each image" },
        { "threads", 't', CLI_INT, &o.threads, "N", "threads (0: all processors)", 0, 256 },
    };
    int r = args ? cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, args, 1, argc) : CLI_MEMORY;

    if (r == CLI_GO_ON)
        r = o.output ? read_scale(cmd, &o) : cli_usage_error(cmd, "-o FILE or -o DIR is missing");
    if (r == CLI_GO_ON)
        r = cli_exit_code(segment(args, &o));
    free(args);
    return r;
}

const struct cli_command cli_segment = { "segment", run };
