/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/manifest.h"

#include <errno.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/kernels/sha256.h"

#define MANIFEST_MAX_BYTES ((size_t)1 << 20)

static int bad(const char *name, int i, const char *what)
{
    sst_log_error("%s: models[%d]: %s; correct it, or install the networks again", name, i, what);
    return -EBADMSG;
}

static const char *entry_fault(const struct sst_manifest *m, int i)
{
    const struct sst_manifest_entry *e = &m->entries[i];
    const char *key;
    json_t *value;
    size_t k;

    if (!*e->file || strchr(e->file, '/') || e->file[0] == '.')
        return "file is not a plain file name";
    for (k = 0; k < (size_t)i; k++) {
        if (!strcmp(m->entries[k].file, e->file))
            return "file is listed twice";
    }
    if (strcmp(e->kind, "labels") != 0 && strcmp(e->kind, "matching") != 0)
        return "kind is neither labels nor matching";
    if (e->bytes < 1)
        return "bytes is not positive";
    if (strlen(e->sha256) != 64 || strspn(e->sha256, "0123456789abcdef") != 64)
        return "sha256 is not 64 lower-case hexadecimal digits";
    json_object_foreach((json_t *)(uintptr_t)e->figures, key, value)
    {
        if (!json_is_number(value))
            return "figures holds something that is not a number";
    }
    return NULL;
}

static int read_entry(struct sst_manifest *m, json_t *object, const char *name)
{
    struct sst_manifest_entry *e = &m->entries[m->n];
    json_t *figures;
    json_int_t bytes;
    json_error_t error;
    const char *fault;

    if (json_unpack_ex(object, &error, JSON_STRICT, "{s:s, s:s, s:I, s:s, s:s, s:s, s:s, s:o}", "file", &e->file,
                       "kind", &e->kind, "bytes", &bytes, "sha256", &e->sha256, "licence", &e->licence, "training_data",
                       &e->training_data, "description", &e->description, "figures", &figures))
        return bad(name, m->n, error.text);
    if (!json_is_object(figures))
        return bad(name, m->n, "figures is not an object");
    e->bytes = bytes;
    e->figures = figures;
    fault = entry_fault(m, m->n);
    if (fault)
        return bad(name, m->n, fault);
    m->n++;
    return 0;
}

/* The list of a manifest of our format and version; NULL after a message, or with *other set for another format. */
static json_t *find_list(json_t *root, const char *name, bool *other)
{
    const json_t *format = json_object_get(root, "format");
    json_t *models = json_object_get(root, "models");

    *other = json_is_object(root) && (!json_is_string(format) || strcmp(json_string_value(format), "sst-models") != 0);
    if (*other)
        return NULL;
    if (!json_is_integer(json_object_get(root, "version")) || json_integer_value(json_object_get(root, "version")) != 1)
        sst_log_error(
            "%s: version is not 1, the only one that this program supports; install networks that belong to it", name);
    else if (!json_is_array(models) || json_array_size(models) > SST_MANIFEST_MAX_MODELS)
        sst_log_error("%s: models is not a list of at most 256 networks; correct it, or install the networks again",
                      name);
    else
        return models;
    return NULL;
}

static int parse_root(struct sst_manifest *m, const char *name)
{
    bool other;
    json_t *list = find_list(m->root, name, &other), *object;
    size_t i;
    int err = 0;

    if (!list)
        return other ? -ENOENT : -EBADMSG;
    m->entries = calloc(json_array_size(list) + 1, sizeof(*m->entries));
    if (!m->entries) {
        sst_log_error("%s: not enough memory to read it", name);
        return -ENOMEM;
    }
    json_array_foreach(list, i, object)
    {
        err = read_entry(m, object, name);
        if (err)
            break;
    }
    return err;
}

int sst_manifest_parse(struct sst_manifest *out, const char *text, size_t size, const char *name)
{
    struct sst_manifest m = { 0 };
    json_error_t e;
    int err;

    m.root = json_loadb(text, size, JSON_REJECT_DUPLICATES, &e);
    if (!m.root) {
        sst_log_error("%s:%d:%d: %s; correct it, or install the networks again", name, e.line, e.column, e.text);
        return -EBADMSG;
    }
    err = parse_root(&m, name);
    if (err)
        sst_manifest_fini(&m);
    else
        *out = m;
    return err;
}

void sst_manifest_fini(struct sst_manifest *manifest)
{
    free(manifest->entries);
    json_decref(manifest->root);
    *manifest = (struct sst_manifest){ 0 };
}

int sst_manifest_load(struct sst_manifest *out, const char *folder)
{
    char path[SST_PATH_MAX];
    uint8_t *text = NULL;
    size_t size;
    int err = sst_path_join(path, folder, SST_MANIFEST_NAME);

    if (err)
        return err;
    if (!sst_path_exists(path))
        return -ENOENT;
    err = sst_file_read_text(path, MANIFEST_MAX_BYTES, &text, &size);
    err = err ? err : sst_manifest_parse(out, (const char *)text, size, path);
    free(text);
    return err;
}

const struct sst_manifest_entry *sst_manifest_find(const struct sst_manifest *manifest, const char *file)
{
    for (int i = 0; i < manifest->n; i++) {
        if (!strcmp(manifest->entries[i].file, file))
            return &manifest->entries[i];
    }
    return NULL;
}

bool sst_manifest_matches(const struct sst_manifest_entry *entry, const uint8_t *data, size_t size)
{
    char hash[SST_SHA256_HEX];

    if ((uint64_t)entry->bytes != size)
        return false;
    sst_sha256_hex(hash, data, size);
    return !strcmp(hash, entry->sha256);
}

int sst_manifest_check(const char *path, const uint8_t *data, size_t size)
{
    const char *file = sst_path_base(path);
    const struct sst_manifest_entry *entry;
    struct sst_manifest manifest;
    char folder[SST_PATH_MAX];
    int err;

    if (file == path)
        strcpy(folder, ".");
    else
        snprintf(folder, sizeof(folder), "%.*s", (int)(file - path), path);
    err = sst_manifest_load(&manifest, folder);
    if (err)
        return err == -ENOENT ? 0 : err;
    entry = sst_manifest_find(&manifest, file);
    if (entry && !sst_manifest_matches(entry, data, size)) {
        sst_log_error("model %s is not the file that %s" SST_MANIFEST_NAME
                      " lists (another SHA-256): it is damaged or was"
                      " replaced; install the networks again",
                      path, file == path ? "" : folder);
        err = -EBADMSG;
    }
    sst_manifest_fini(&manifest);
    return err;
}
