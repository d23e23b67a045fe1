/* sst models: installed networks, their fitness for use, and the contents of one. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"
#include "cli/cli_internal.h"
#include "pipeline/kernels/sha256.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/labels/model_info.h"
#include "pipeline/method/network/graph.h"
#include "pipeline/method/network/manifest.h"
#include "pipeline/method/network/model_path.h"
#include "pipeline/method/network/onnx.h"

/* --- facts about one network -------------------------------------------------------------------------------------- */

#define KIND_METADATA "sst.kind"
#define KIND_MATCHING "mccnn-features" /* value of the entry KIND_METADATA */

/* External text as a JSON string; if it is not UTF-8, non-ASCII bytes become '?'. */
static json_t *json_text(const char *text)
{
    json_t *made = json_string(text);
    char plain[SST_PATH_MAX];

    if (made)
        return made;
    snprintf(plain, sizeof(plain), "%s", text);
    for (char *c = plain; *c; c++)
        *c = (unsigned char)*c > 126 ? '?' : *c;
    return json_string(plain);
}

/* --- the list ----------------------------------------------------------------------------------------------------- */

static const char *kind_of(const struct sst_network *net)
{
    const char *kind = sst_network_metadata(net, KIND_METADATA);

    return kind && !strcmp(kind, KIND_MATCHING) ? "matching" : "labels";
}

/* Open a network like the commands that use it: 0 and its runner, or an error with its message held back. */
static int try_open(json_t *o, const char *path)
{
    struct sst_network *net = NULL;
    struct sst_model_info info;
    int err = sst_network_open(&net, path, SST_PRECISION_AUTO, 1);

    if (err)
        return err;
    json_object_set_new(o, "kind", json_string(kind_of(net)));
    json_object_set_new(o, "runner", json_string(sst_network_runner(net)));
    if (sst_network_metadata(net, SST_RANGES_KEY))
        json_array_append_new(json_object_get(o, "precision"), json_string("int8"));
    if (strcmp(kind_of(net), "labels") == 0) {
        err = sst_labels_model_info_read(&info, net, path);
        if (!err)
            json_object_set_new(o, "classes", json_integer(info.classes.count));
    }
    sst_network_close(net);
    return err;
}

static int check_file(json_t *o, const char *path, const struct sst_manifest_entry *entry, const char **status)
{
    uint8_t *data = NULL;
    size_t size = 0;
    int err;

    if (!sst_path_exists(path)) {
        *status = "missing";
        sst_log_error("listed in the manifest, but missing; install the networks again");
        return -ENOENT;
    }
    *status = "unreadable";
    err = sst_file_read(path, SST_ONNX_MAX_BYTES, &data, &size);
    if (err)
        return err;
    json_object_set_new(o, "bytes", json_integer((json_int_t)size));
    if (entry && !sst_manifest_matches(entry, data, size)) {
        *status = "hash mismatch";
        sst_log_error("differs from the file that the manifest lists; install the networks again");
        err = -EBADMSG;
    }
    free(data);
    return err ? err : try_open(o, path);
}

static void add_entry(json_t *o, const struct sst_manifest_entry *e)
{
    json_object_update_new(o, json_pack("{s:s, s:s, s:s, s:s, s:o}", "kind", e->kind, "licence", e->licence,
                                        "training_data", e->training_data, "description", e->description, "figures",
                                        json_deep_copy(e->figures)));
}

/* Strip the file name, which the list already shows, from a reason. */
static const char *bare_reason(const char *reason, const char *path)
{
    const size_t n = strlen(path);

    if (!strncmp(reason, "model ", 6) && !strncmp(reason + 6, path, n))
        reason += 6 + n;
    return reason + strspn(reason, ": ");
}

/* One line of the list. Nothing is logged: a fault is the reason. @return NULL without memory */
static json_t *facts_of(const char *path, const struct sst_manifest_entry *entry)
{
    const char *file = sst_path_base(path), *status = "";
    char reason[SST_LOG_MAX] = "", folder[SST_PATH_MAX], *before;
    json_t *o;
    int err;

    snprintf(folder, sizeof(folder), "%.*s", file > path ? (int)(file - path - 1) : 0, path);
    o = json_pack("{s:o, s:o, s:i, s:[s], s:s, s:b, s:b}", "file", json_text(file), "folder", json_text(folder),
                  "bytes", 0, "precision", "f32", "kind", "", "listed", entry != NULL, "shadowed", false);
    if (!o)
        return NULL;
    before = sst_log_hold_errors(reason);
    err = check_file(o, path, entry, &status);
    sst_log_hold_errors(before);
    if (entry)
        add_entry(o, entry);
    json_object_set_new(o, "status", json_string(err ? status : "ok"));
    if (err)
        json_object_set_new(o, "reason", json_text(bare_reason(reason, path)));
    return o;
}

/* --- one network -------------------------------------------------------------------------------------------------- */

/* "image 1 x 3 x ? x ?" */
static json_t *value_text(const struct sst_onnx_value *v)
{
    char text[320];

    snprintf(text, sizeof(text), "%.*s", SST_ONNX_STR(v->name));
    for (int i = 0; i < v->n_dims; i++) {
        if (v->dims[i])
            sst_text_add(text, sizeof(text), "%s%lld", i ? " x " : " ", (long long)v->dims[i]);
        else
            sst_text_add(text, sizeof(text), "%s?", i ? " x " : " ");
    }
    return json_text(text);
}

static void add_summary(json_t *o, const struct sst_onnx *model)
{
    json_t *ops = json_object(), *inputs = json_array(), *outputs = json_array();
    struct sst_summary s;

    sst_onnx_summary(&s, model);
    for (int i = 0; i < s.n_ops; i++)
        json_object_set_new(ops, s.ops[i].name, json_integer(s.ops[i].count));
    for (int i = 0; i < model->n_ins; i++) {
        if (!sst_onnx_is_constant(model, &model->ins[i]))
            json_array_append_new(inputs, value_text(&model->ins[i]));
    }
    for (int i = 0; i < model->n_outs; i++)
        json_array_append_new(outputs, value_text(&model->outs[i]));
    json_object_update_new(o, json_pack("{s:I, s:I, s:I, s:o, s:o, s:o}", "opset", (json_int_t)s.opset, "parameters",
                                        (json_int_t)s.parameters, "nodes", (json_int_t)s.n_nodes, "operators", ops,
                                        "inputs", inputs, "outputs", outputs));
}

/* Size, hash and content of the file, without running it. */
static int read_facts(json_t *o, const char *path, bool *matching)
{
    char hash[SST_SHA256_HEX];
    struct sst_onnx model;
    uint8_t *data = NULL;
    size_t size;
    int err = sst_file_read(path, SST_ONNX_MAX_BYTES, &data, &size);

    if (err)
        return err;
    json_object_set_new(o, "bytes", json_integer((json_int_t)size));
    sst_sha256_hex(hash, data, size);
    json_object_set_new(o, "sha256", json_string(hash));
    err = sst_manifest_check(path, data, size);
    err = err ? err : sst_onnx_parse(&model, data, size, path);
    if (!err) {
        add_summary(o, &model);
        for (int i = 0; i < model.n_metadata; i++)
            *matching |= sst_onnx_str_is(model.metadata[i].key, KIND_METADATA) &&
                         sst_onnx_str_is(model.metadata[i].value, KIND_MATCHING);
        sst_onnx_fini(&model);
    }
    free(data);
    return err;
}

static void add_info(json_t *o, const struct sst_model_info *info)
{
    json_t *names = json_array(), *ground = json_array();

    for (int i = 0; i < info->classes.count; i++) {
        json_array_append_new(names, json_text(info->classes.names[i]));
        if (info->classes.ground[i])
            json_array_append_new(ground, json_text(info->classes.names[i]));
    }
    json_object_update_new(o, json_pack("{s:o, s:o, s:i, s:s, s:[f, f, f], s:[f, f, f], s:[i, i], s:b, s:s, s:f, s:o}",
                                        "classes", names, "ground", ground, "channels",
                                        info->channels - info->background, "colour", info->bgr ? "bgr" : "rgb", "mean",
                                        info->mean[0], info->mean[1], info->mean[2], "std", info->std[0], info->std[1],
                                        info->std[2], "size", info->width, info->height, "fixed_size", info->fixed_size,
                                        "output", info->probabilities ? "probabilities" : "logits", "temperature",
                                        info->temperature, "epsilon_h", cli_real_json(info->eps_h)));
    if (info->last_op[0])
        json_object_set_new(o, "ends_in", json_text(info->last_op));
}

static int shape_of(json_t *o, struct sst_network *net, int width, int height)
{
    struct sst_shape out;
    const int err = sst_network_out_shape(net, width, height, &out);

    if (!err)
        json_object_update_new(o, json_pack("{s:s, s:[i, i], s:[i, i, i]}", "runner", sst_network_runner(net),
                                            "runs_at", width, height, "gives", out.c, out.w, out.h));
    return err;
}

/* Open it like the commands that use it, which finds its faults. */
static int use_facts(json_t *o, const char *path, bool matching)
{
    char sidecar[SST_PATH_MAX];
    struct sst_segmenter *seg = NULL;
    struct sst_network *net = NULL;
    int err;

    json_object_set_new(o, "kind", json_string(matching ? "matching" : "labels"));
    if (matching) {
        err = sst_network_open(&net, path, SST_PRECISION_AUTO, 1);
        err = err ? err : shape_of(o, net, 640, 480);
        sst_network_close(net);
        return err;
    }
    err = sst_segmenter_open(&seg, path, SST_PRECISION_AUTO, 1);
    if (!err) {
        const struct sst_model_info *info = sst_segmenter_info(seg);

        add_info(o, info);
        if (!sst_labels_model_sidecar(sidecar, path))
            json_object_set_new(o, "described_by", json_text(sidecar));
        err = shape_of(o, sst_segmenter_network(seg), info->width, info->height);
    }
    sst_segmenter_close(seg);
    return err;
}

static void print_line(const json_t *o, const char *title, const char *key)
{
    json_t *v = json_object_get(o, key), *one;
    const char *name;
    size_t i;

    if (!v || (json_is_array(v) && !json_array_size(v)))
        return;
    printf("  %-13s", title);
    if (json_is_string(v))
        printf(" %s", json_string_value(v));
    else if (json_is_real(v))
        printf(" %.6g", json_real_value(v));
    else if (json_is_integer(v))
        printf(" %" JSON_INTEGER_FORMAT, json_integer_value(v));
    json_array_foreach(v, i, one)
    {
        if (json_is_string(one))
            printf("%s %s", i ? "," : "", json_string_value(one));
        else
            printf("%s%.4g", i ? " x " : " ", json_number_value(one));
    }
    json_object_foreach(v, name, one)
    {
        printf(" %s %" JSON_INTEGER_FORMAT, name, json_integer_value(one));
    }
    putchar('\n');
}

static int inspect_model(const char *path, bool json)
{
    static const char *const lines[][2] = {
        { "bytes", "bytes" },         { "sha256", "sha256" },   { "input", "inputs" },
        { "output", "outputs" },      { "opset", "opset" },     { "parameters", "parameters" },
        { "operators", "operators" }, { "kind", "kind" },       { "described by", "described_by" },
        { "runner", "runner" },       { "runs at", "runs_at" }, { "gives c,w,h", "gives" },
        { "classes", "classes" },     { "ground", "ground" },   { "ends in", "ends_in" },
        { "values are", "output" },   { "colour", "colour" },   { "temperature", "temperature" },
        { "epsilon_h", "epsilon_h" },
    };
    const size_t n_file = 7;
    json_t *o = json_pack("{s:o}", "file", json_text(path));
    bool matching = false;
    int err = o ? read_facts(o, path, &matching) : -ENOMEM;

    if (!json && !err) {
        printf("%s\n", path);
        for (size_t i = 0; i < n_file; i++)
            print_line(o, lines[i][0], lines[i][1]);
        fflush(stdout);
    }
    err = err ? err : use_facts(o, path, matching);
    for (size_t i = n_file; !json && !err && i < ARRAY_LEN(lines); i++)
        print_line(o, lines[i][0], lines[i][1]);
    if (json && !err)
        return cli_dump_json(o, JSON_INDENT(2) | JSON_REAL_PRECISION(6)) ? -ENOMEM : 0;
    json_decref(o);
    return err;
}

/* --- the command -------------------------------------------------------------------------------------------------- */

#define TABLE_WIDTH 120

/* --- installed networks ------------------------------------------------------------------------------------------- */

static int onnx_only(const struct dirent *d)
{
    return sst_text_ends(d->d_name, ".onnx");
}

static bool has_name(const json_t *list, const char *name)
{
    const json_t *one;
    size_t i;

    json_array_foreach((json_t *)(uintptr_t)list, i, one)
    {
        if (!strcmp(json_string_value(json_object_get(one, "file")), name))
            return true;
    }
    return false;
}

/* Facts of one file as a JSON object appended to list. */
static int add_model(json_t *list, const char *folder, const char *file, const struct sst_manifest *manifest)
{
    const struct sst_manifest_entry *entry = manifest ? sst_manifest_find(manifest, file) : NULL;
    char path[SST_PATH_MAX];
    json_t *one;
    int err = sst_path_join(path, folder, file);

    if (err)
        return err;
    one = facts_of(path, entry);
    if (!one)
        return -ENOMEM;
    if (has_name(list, file))
        json_object_set_new(one, "shadowed", json_true());
    return json_array_append_new(list, one) ? -ENOMEM : 0;
}

static int add_folder(json_t *list, const char *folder)
{
    struct sst_manifest manifest = { 0 };
    struct dirent **names = NULL;
    int err = sst_manifest_load(&manifest, folder), n = scandir(folder, &names, onnx_only, alphasort);

    if (err == -ENOMEM)
        n = sst_max_int(n, 0);
    else
        err = 0; /* a broken manifest was logged; the networks of its folder report it as well */
    for (int i = 0; i < n; i++) {
        err = err ? err : add_model(list, folder, names[i]->d_name, &manifest);
        free(names[i]);
    }
    free(names);
    for (int i = 0; !err && i < manifest.n; i++) {
        if (!has_name(list, manifest.entries[i].file))
            err = add_model(list, folder, manifest.entries[i].file, &manifest);
    }
    sst_manifest_fini(&manifest);
    return err;
}

/* --- the table ---------------------------------------------------------------------------------------------------- */

static const char *text_of(const json_t *one, const char *key)
{
    const char *text = json_string_value(json_object_get(one, key));

    return text ? text : "";
}

static void join_figures(char *out, size_t size, const json_t *one)
{
    const char *key;
    json_t *value;

    *out = 0;
    json_object_foreach(json_object_get(one, "figures"), key, value)
        sst_text_add(out, size, "%s%s %.4g", *out ? ", " : "", key, json_number_value(value));
}

static void join_names(char *out, size_t size, const json_t *list)
{
    const json_t *one;
    size_t i;

    *out = 0;
    json_array_foreach((json_t *)(uintptr_t)list, i, one)
        sst_text_add(out, size, "%s%s", i ? "," : "", json_string_value(one));
}

/* A line of the table; longer text ends in dots. */
static void print_row(const json_t *one)
{
    const json_int_t bytes = json_integer_value(json_object_get(one, "bytes"));
    const char *status = json_is_true(json_object_get(one, "shadowed")) ? "shadowed" : text_of(one, "status");
    char line[1024], what[700], name[64], precision[64];

    snprintf(name, sizeof(name), "%.*s", (int)(strlen(text_of(one, "file")) - 5), text_of(one, "file"));
    join_names(precision, sizeof(precision), json_object_get(one, "precision"));
    if (!strcmp(text_of(one, "status"), "ok"))
        join_figures(what, sizeof(what), one);
    else
        snprintf(what, sizeof(what), "%s", text_of(one, "reason"));
    snprintf(line, sizeof(line), "  %-20s %-9s %-9s %9.2f  %-13s %s", name, text_of(one, "kind"), precision,
             (double)bytes / (1 << 20), status, what);
    if (strlen(line) > TABLE_WIDTH)
        strcpy(line + TABLE_WIDTH - 3, "...");
    puts(line);
}

static int print_list(json_t *list, bool json)
{
    const char *folder = "";
    json_t *one;
    size_t i;

    if (json)
        return cli_dump_json(json_pack("{s:O}", "models", list), JSON_INDENT(2) | JSON_REAL_PRECISION(6)) ? -ENOMEM : 0;
    if (!json_array_size(list))
        puts("no networks are installed; set SST_MODELS to a folder of ONNX files, or install the shipped ones");
    else
        printf("  %-20s %-9s %-9s %9s  %-13s %s\n", "NAME", "KIND", "PRECISION", "MiB", "STATUS", "FIGURES");
    json_array_foreach(list, i, one)
    {
        if (strcmp(folder, text_of(one, "folder")) != 0) {
            folder = text_of(one, "folder");
            printf("%s\n", folder);
        }
        print_row(one);
    }
    return 0;
}

static int list_models(bool json)
{
    struct sst_model_folders folders;
    json_t *list = json_array();
    int err = list ? 0 : -ENOMEM;

    sst_model_folders(&folders);
    for (int i = 0; !err && i < folders.n; i++)
        err = add_folder(list, folders.path[i]);
    err = err ? err : print_list(list, json);
    json_decref(list);
    return err;
}

/* --- command ------------------------------------------------------------------------------------------------------ */

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    const char *file = NULL;
    bool json = false;
    const struct cli_option options[] = {
        { "json", 0, CLI_FLAG, &json, NULL, "print one JSON object" },
    };
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, &file, 0, 1);
    char path[SST_PATH_MAX];
    int err;

    if (r != CLI_GO_ON)
        return r;
    if (!file)
        return cli_exit_code(list_models(json));
    err = sst_model_resolve(path, file);
    err = err ? err : inspect_model(path, json);
    return err && err != -ENOMEM && err != -ENOPKG ? CLI_INPUT : cli_exit_code(err);
}

const struct cli_command cli_models = { "models", run };
