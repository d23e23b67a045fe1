/* sst models: installed networks, their fitness for use, and the contents of one. */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "cli/cli_internal.h"
#include "pipeline/method/network/manifest.h"
#include "pipeline/method/network/model_path.h"

#define TABLE_WIDTH 120

/* --- installed networks ------------------------------------------------------------------------------------------ */

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
    one = cli_model_facts(path, entry);
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
    if (!err)
        err = print_list(list, json);
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
    if (!err)
        err = cli_model_inspect(path, json);
    return err && err != -ENOMEM && err != -ENOPKG ? CLI_INPUT : cli_exit_code(err);
}

const struct cli_command cli_models = { "models", run };
