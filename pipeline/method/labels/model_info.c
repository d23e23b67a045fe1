/* A network's description: the YAML file beside it first, then its own metadata for entries that the file lacks. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/labels/model_info.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/log.h"
#include "base/text.h"
#include "base/yaml.h"

#define MEAN_MAX 1000.0
#define STD_MIN  1e-6
#define STD_MAX  1e6
#define SIDE_MIN 8
#define SIDE_MAX 8192

struct reader {
    struct sst_model_info *info;
    const struct sst_network *net; /* or NULL */
    const char *path;
    struct sst_yaml *doc; /* or NULL */
    struct sst_yaml_node *root;
    char (*names)[SST_CLASS_NAME_MAX]; /* [SST_MODEL_MAX_CHANNELS], of the channels */
    bool range_255;
    int output; /* index of `outputs`, or -1 where the description does not say it */
};

static const char *const outputs[] = { "logits", "probabilities" };
static const char *const colours[] = { "rgb", "bgr" };
static const char *const ranges[] = { "0..1", "0..255" };

/* --- classes, for both sources ------------------------------------------------------------------------------------ */

/* Append a channel. @return NULL, or the rule that its name breaks */
static const char *add_channel(struct reader *r, const char *name, size_t n)
{
    struct sst_model_info *info = r->info;

    if (!n || n >= SST_CLASS_NAME_MAX || info->channels == SST_MODEL_MAX_CHANNELS)
        return "at most 256 names of 1 to 31 characters";
    memcpy(r->names[info->channels], name, n);
    r->names[info->channels][n] = 0;
    for (int i = 0; i < info->channels; i++) {
        if (!strcasecmp(r->names[i], r->names[info->channels]))
            return "a list of different names";
    }
    info->channels++;
    return NULL;
}

/* The label of a class name, added if new; 0 if the list is full. */
static int find_or_add(struct sst_classes *c, const char *name)
{
    const int label = sst_classes_find(c, name);

    if (label || c->count == SST_MAX_CLASSES)
        return label;
    strcpy(c->names[c->count], name);
    return ++c->count;
}

/* --- metadata ----------------------------------------------------------------------------------------------------- */

/* Value of a metadata entry, unless the YAML file sets it. */
static const char *metadata(const struct reader *r, const char *key)
{
    const char *value = r->net ? sst_network_metadata(r->net, key) : NULL;

    if (!value || !sst_yaml_get(r->root, key + strlen("sst.")))
        return value;
    sst_log_debug("model %s: the file beside it takes precedence over its metadata %s", r->path, key);
    return NULL;
}

static int bad_metadata(const struct reader *r, const char *key, const char *want)
{
    const char *value = sst_network_metadata(r->net, key);

    sst_log_error(
        "model %s: its metadata %s is %.80s; it must be %s: export it again, or set it in a YAML file beside it",
        r->path, key, value ? value : "missing", want);
    return -EBADMSG;
}

struct numbers {
    const char *key;
    double min, max;
    const char *want; /* for messages */
};

/* Exactly n numbers, separated by commas or blanks; a missing entry leaves the default. */
static int read_numbers(struct reader *r, double *out, int n, const struct numbers *of)
{
    const char *text = metadata(r, of->key);

    if (!text)
        return 0;
    for (int i = 0; i < n; i++) {
        char *end;
        const double v = strtod(text, &end);

        if (end == text || !(v >= of->min && v <= of->max))
            return bad_metadata(r, of->key, of->want);
        out[i] = v;
        text = end + strspn(end, ", ");
    }
    return *text ? bad_metadata(r, of->key, of->want) : 0;
}

/* One of two words; a missing entry leaves the default. */
static int read_word(struct reader *r, const char *key, const char *const words[2], const char *want, bool *second)
{
    const char *text = metadata(r, key);

    if (!text)
        return 0;
    if (strcmp(text, words[0]) != 0 && strcmp(text, words[1]) != 0)
        return bad_metadata(r, key, want);
    *second = !strcmp(text, words[1]);
    return 0;
}

/* The next name of a comma-separated list without the blanks around it: its length, or 0 at the end or where it is
 * empty. */
static size_t next_name(const char **list, const char **name)
{
    size_t n;

    *list += strspn(*list, " ");
    *name = *list;
    n = strcspn(*list, ",");
    *list += n + ((*list)[n] == ',');
    while (n && (*name)[n - 1] == ' ')
        n--;
    return n;
}

static int read_classes(struct reader *r)
{
    const char *key = "sst.classes", *list = metadata(r, key), *name;

    while (list && *list) {
        const size_t n = next_name(&list, &name);
        const char *fault = add_channel(r, name, n);

        if (fault)
            return bad_metadata(r, key, fault);
    }
    return 0;
}

static int no_classes(const struct reader *r)
{
    sst_log_error("model %s does not name the classes of its output: list them in a YAML file beside it"
                  " (docs/use/networks.md) or in its metadata sst.classes",
                  r->path);
    return -EBADMSG;
}

static int read_ground(struct reader *r)
{
    const char *key = "sst.ground", *list = metadata(r, key), *name;

    while (list && *list) {
        const size_t n = next_name(&list, &name);
        char text[SST_CLASS_NAME_MAX] = "";
        int label = 0;

        if (n && n < sizeof(text)) {
            memcpy(text, name, n);
            label = sst_classes_find(&r->info->classes, text);
        }
        if (!label)
            return bad_metadata(r, key, "a list of names from sst.classes");
        r->info->classes.ground[label - 1] = true;
    }
    return 0;
}

static bool parse_size(const char *text, int *width, int *height)
{
    int n = 0;

    return sscanf(text, "%5dx%5d%n", width, height, &n) == 2 && !text[n] && *width >= SIDE_MIN && *height >= SIDE_MIN &&
           *width <= SIDE_MAX && *height <= SIDE_MAX;
}

static int read_size(struct reader *r)
{
    const char *key = "sst.size", *text = metadata(r, key);
    int w, h;

    if (!text)
        return 0;
    if (!parse_size(text, &w, &h))
        return bad_metadata(r, key, "WxH with sides of 8..8192");
    r->info->width = w;
    r->info->height = h;
    return 0;
}

static int read_metadata(struct reader *r)
{
    static const struct numbers mean = { "sst.mean", -MEAN_MAX, MEAN_MAX, "three numbers in -1000..1000" };
    static const struct numbers std = { "sst.std", STD_MIN, STD_MAX, "three numbers in 1e-6..1e6" };
    static const struct numbers eps_h = { "sst.epsilon_h", 0, HUGE_VAL, "one number, 0 or more" };
    static const struct numbers temperature = { "sst.temperature", 1e-3, 1e3, "one number in 0.001..1000" };
    struct sst_model_info *info = r->info;
    int err = read_size(r);

    err = err ? err : read_numbers(r, info->mean, 3, &mean);
    if (!err && !sst_yaml_get(r->root, "scale"))
        err = read_numbers(r, info->std, 3, &std);
    err = err ? err : read_numbers(r, &info->eps_h, 1, &eps_h);
    err = err ? err : read_numbers(r, &info->temperature, 1, &temperature);
    err = err ? err : read_word(r, "sst.colour", colours, "rgb or bgr", &info->bgr);
    err = err ? err : read_word(r, "sst.range", ranges, "0..1 or 0..255", &r->range_255);
    if (!err && metadata(r, "sst.output")) {
        bool probabilities = false;

        err = read_word(r, "sst.output", outputs, "logits or probabilities", &probabilities);
        r->output = probabilities;
    }
    return err;
}

/* --- YAML --------------------------------------------------------------------------------------------------------- */

/* A mapping from channel numbers to names, in any order, must be complete. */
static const struct sst_yaml_node *numbered(struct reader *r, const struct sst_yaml_node *map, int channel)
{
    char key[12];

    snprintf(key, sizeof(key), "%d", channel);
    for (const struct sst_yaml_node *n = map->first; n; n = n->next) {
        if (!strcmp(n->key, key))
            return n;
    }
    sst_yaml_fault(r->doc, map, "has %d entries but none for channel %d; number them from 0", map->count, channel);
    return NULL;
}

static void yaml_classes(struct reader *r, struct sst_yaml_node *node)
{
    const struct sst_yaml_node *one = node ? node->first : NULL;
    char name[SST_CLASS_NAME_MAX];

    if (!node)
        return;
    if (node->type == SST_YAML_SCALAR || !node->count) {
        sst_yaml_fault(r->doc, node, "must be a list of names, one for each channel of the output");
        return;
    }
    sst_yaml_know_all(node);
    for (int i = 0; i < node->count; i++) {
        const char *fault;

        if (node->type == SST_YAML_MAP)
            one = numbered(r, node, i);
        if (!one || !sst_yaml_string(r->doc, one, name, sizeof(name)))
            return;
        fault = add_channel(r, name, strlen(name));
        if (fault) {
            sst_yaml_fault(r->doc, one, "must be %s; `%s` is not allowed", fault, name);
            return;
        }
        one = one->next;
    }
}

/* Map channels to classes; `labels` joins several channels into one class. */
static bool join_channels(struct reader *r, struct sst_yaml_node *labels)
{
    struct sst_model_info *info = r->info;
    bool ok = true;

    if (labels && labels->type != SST_YAML_MAP)
        sst_yaml_fault(r->doc, labels, "must have lines \"class name: label name\"");
    for (int i = 0; i < info->channels; i++) {
        const struct sst_yaml_node *to = sst_yaml_get(labels, r->names[i]);
        char name[SST_CLASS_NAME_MAX];
        int label;

        strcpy(name, r->names[i]);
        if (to && !sst_yaml_string(r->doc, to, name, sizeof(name)))
            continue;
        label = find_or_add(&info->classes, name);
        info->class_of[i] = (uint8_t)(label ? label - 1 : 0);
        ok &= label > 0;
    }
    return ok;
}

static void yaml_ground(struct reader *r, const struct sst_yaml_node *list)
{
    char name[SST_CLASS_NAME_MAX];

    if (list && list->type != SST_YAML_LIST)
        sst_yaml_fault(r->doc, list, "must be a list of class names");
    for (const struct sst_yaml_node *n = list ? list->first : NULL; n; n = n->next) {
        int label;

        if (!sst_yaml_string(r->doc, n, name, sizeof(name)))
            continue;
        label = sst_classes_find(&r->info->classes, name);
        if (label)
            r->info->classes.ground[label - 1] = true;
        else
            sst_yaml_fault(r->doc, n, "names the unknown class `%s`; correct its spelling", name);
    }
}

static void yaml_normalisation(struct reader *r)
{
    struct sst_yaml_node *std = sst_yaml_get(r->root, "std"), *scale = sst_yaml_get(r->root, "scale");
    double scales[3];

    sst_yaml_doubles(r->doc, sst_yaml_get(r->root, "mean"), -MEAN_MAX, MEAN_MAX, r->info->mean, 3);
    sst_yaml_doubles(r->doc, std, STD_MIN, STD_MAX, r->info->std, 3);
    if (std && scale)
        sst_yaml_fault(r->doc, scale, "and std set the same value (scale is 1 / std); keep one of them");
    if (sst_yaml_doubles(r->doc, scale, 1 / STD_MAX, 1 / STD_MIN, scales, 3)) {
        for (int c = 0; c < 3; c++)
            r->info->std[c] = 1 / scales[c];
    }
}

static void yaml_size(struct reader *r)
{
    const struct sst_yaml_node *node = sst_yaml_get(r->root, "size");
    char text[32];
    int w, h;

    if (!sst_yaml_string(r->doc, node, text, sizeof(text)))
        return;
    if (parse_size(text, &w, &h)) {
        r->info->width = w;
        r->info->height = h;
    } else {
        sst_yaml_fault(r->doc, node, "must be WIDTHxHEIGHT with sides of 8..8192, such as 480x360, not %s", text);
    }
}

/* All but the classes. */
static void read_yaml(struct reader *r)
{
    struct sst_model_info *info = r->info;
    int word;

    yaml_normalisation(r);
    yaml_size(r);
    sst_yaml_double(r->doc, sst_yaml_get(r->root, "temperature"), 1e-3, 1e3, &info->temperature);
    sst_yaml_double(r->doc, sst_yaml_get(r->root, "epsilon_h"), 0, 1e9, &info->eps_h);
    if (sst_yaml_choice(r->doc, sst_yaml_get(r->root, "output"), outputs, 2, &word))
        r->output = word;
    if (sst_yaml_choice(r->doc, sst_yaml_get(r->root, "colour"), colours, 2, &word))
        info->bgr = word == 1;
    if (sst_yaml_choice(r->doc, sst_yaml_get(r->root, "range"), ranges, 2, &word))
        r->range_255 = word == 1;
}

/* --- both --------------------------------------------------------------------------------------------------------- */

/* Mean and deviation are read in the units of `range` and stored in those of 0..1. */
static void settle_range(struct reader *r)
{
    for (int c = 0; r->range_255 && c < 3; c++) {
        r->info->mean[c] /= 255;
        r->info->std[c] /= 255;
    }
}

/* A network that ends in a softmax or sigmoid gives probabilities: a second softmax would bring them closer together. */
static int settle_output(struct reader *r)
{
    bool logarithm = false;
    const char *op = r->net ? sst_network_ends_in_probabilities(r->net, &logarithm) : NULL;

    if (op && r->output >= 0 && r->output == (int)logarithm) {
        sst_log_error("model %s ends in %s, so its values are %s, but its description says output: %s; leave output out",
                      r->path, op, logarithm ? "logarithms of probabilities, which are logits" : "probabilities",
                      outputs[r->output]);
        return -EBADMSG;
    }
    if (r->output < 0 && r->net && sst_network_ends_scaled(r->net)) {
        sst_log_error("model %s ends in %s with a constant behind a softmax or sigmoid: export it without, or describe "
                      "its values by output: logits or probabilities",
                      r->path, sst_network_ends_scaled(r->net));
        return -EBADMSG;
    }
    r->info->probabilities = r->output == 1 || (op && !logarithm);
    if (op && !logarithm) {
        snprintf(r->info->last_op, sizeof(r->info->last_op), "%s", op);
        sst_log_info("model %s ends in %s: its values are taken as probabilities", r->path, op);
    }
    return 0;
}

/* A network of fixed size runs at that size. */
static int settle_size(struct reader *r)
{
    const bool specified = sst_yaml_get(r->root, "size") || metadata(r, "sst.size");
    int w = 0, h = 0;

    if (r->net)
        sst_network_in_size(r->net, &w, &h);
    if (!w || !h)
        return 0;
    if (specified && (w != r->info->width || h != r->info->height)) {
        sst_log_error("model %s takes images of %dx%d only, but its description says size %dx%d; leave size out",
                      r->path, w, h, r->info->width, r->info->height);
        return -EBADMSG;
    }
    r->info->width = w;
    r->info->height = h;
    r->info->fixed_size = true;
    return 0;
}

/* One channel is a class against the rest: a softmax over it would be 1 everywhere. */
static int imply_background(struct reader *r)
{
    if (!strcasecmp(r->names[0], "background")) {
        sst_log_error("model %s: its only class is called %s, which is implied; name the class that its channel finds",
                      r->path, r->names[0]);
        return -EBADMSG;
    }
    strcpy(r->names[1], r->names[0]);
    strcpy(r->names[0], "background");
    r->info->channels = 2;
    r->info->background = true;
    return 0;
}

/* Read the channels' names from file or metadata and build the classes. */
static int read_channels(struct reader *r)
{
    struct sst_yaml_node *list = sst_yaml_get(r->root, "classes"), *labels = sst_yaml_get(r->root, "labels");
    const char *names = metadata(r, "sst.classes");
    int err = 0;

    if (list)
        yaml_classes(r, list);
    else if (names && *names)
        err = read_classes(r);
    else if (r->root)
        sst_yaml_need(r->doc, r->root, "classes");
    else if (!r->doc)
        err = no_classes(r);
    if (!err && r->info->channels == 1)
        err = imply_background(r);
    if (err)
        return err;
    if (!join_channels(r, labels)) {
        sst_log_error("model %s: its %d channels make more than 64 classes; join some with `labels` in a YAML file"
                      " beside it",
                      r->path, r->info->channels);
        return -EBADMSG;
    }
    yaml_ground(r, sst_yaml_get(r->root, "ground"));
    return list ? 0 : read_ground(r); /* its ground entry may name the metadata's classes */
}

int sst_labels_model_info_parse(struct sst_model_info *out, const struct sst_network *net, const char *path,
                                const struct sst_model_yaml *yaml)
{
    struct sst_model_info info = {
        .std = { 1, 1, 1 },
        .eps_h = INFINITY,
        .temperature = 1,
        .width = 480,
        .height = 360,
    };
    struct reader r = { .info = &info, .net = net, .path = path, .output = -1 };
    int err = yaml ? sst_yaml_parse(&r.doc, yaml->text, yaml->size, yaml->name) : 0;

    if (err)
        return err;
    r.names = calloc(SST_MODEL_MAX_CHANNELS + 1, sizeof(*r.names));
    if (!r.names) {
        sst_log_error("model %s: not enough memory to read its description", path);
        err = -ENOMEM;
    }
    if (!err && r.doc)
        r.root = sst_yaml_root(r.doc);
    err = err ? err : read_channels(&r);
    if (!err && r.root)
        read_yaml(&r);
    if (!err && r.doc)
        err = sst_yaml_finish(r.doc);
    err = err ? err : read_metadata(&r);
    err = err ? err : settle_size(&r);
    err = err ? err : settle_output(&r);
    settle_range(&r);
    sst_yaml_destroy(r.doc);
    free(r.names);
    if (!err)
        *out = info;
    return err;
}

/* --- the file beside a network ------------------------------------------------------------------------------------ */

int sst_labels_model_sidecar(char out[SST_PATH_MAX], const char *path)
{
    const size_t n = strlen(path), stem = sst_text_ends(path, ".onnx") ? n - 5 : n;
    char instead[SST_PATH_MAX], added[SST_PATH_MAX];

    if (n + sizeof(".yaml") > SST_PATH_MAX) {
        sst_log_error("%.80s...: the name is too long", path);
        return -ENAMETOOLONG;
    }
    snprintf(instead, sizeof(instead), "%.*s.yaml", (int)stem, path);
    snprintf(added, sizeof(added), "%.*s.yaml", (int)n, path);
    if (stem < n && sst_path_exists(instead) && sst_path_exists(added)) {
        sst_log_error("model %s has two descriptions beside it, %s and %s; remove one", path, instead, added);
        return -EBADMSG;
    }
    if (!sst_path_exists(instead) && !sst_path_exists(added))
        return -ENOENT;
    strcpy(out, sst_path_exists(added) ? added : instead);
    return 0;
}

int sst_labels_model_info_read(struct sst_model_info *out, const struct sst_network *net, const char *path)
{
    char sidecar[SST_PATH_MAX];
    uint8_t *text = NULL;
    size_t size = 0;
    int err = sst_labels_model_sidecar(sidecar, path);

    if (err == -ENOENT)
        return sst_labels_model_info_parse(out, net, path, NULL);
    err = err ? err : sst_file_read_text(sidecar, SST_YAML_MAX_BYTES, &text, &size);
    if (!err) {
        sst_log_debug("model %s: described by %s", path, sidecar);
        err = sst_labels_model_info_parse(out, net, path, &(struct sst_model_yaml){ (char *)text, size, sidecar });
    }
    free(text);
    return err;
}
