/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/eval/evaluation.h"

#define JSON_MAX_BYTES ((size_t)1 << 20)

static int bad(const char *path, int index, const char *key, const char *what)
{
    if (index >= 0)
        sst_log_error("%s: occluders[%d].%s %s; write the truth again", path, index, key, what);
    else
        sst_log_error("%s: %s %s; write the truth again", path, key, what);
    return -EBADMSG;
}

/* An occluder in the file; index -1: the file itself. */
struct entry {
    const json_t *object;
    const char *path;
    int index;
};

static int parse_text(char *out, size_t size, const struct entry *e, const char *key)
{
    const char *text = json_string_value(json_object_get(e->object, key));

    if (!text || !*text)
        return bad(e->path, e->index, key, "is missing or not a string");
    if (strlen(text) >= size || strchr(text, '/'))
        return bad(e->path, e->index, key, "is too long or has a slash");
    memcpy(out, text, strlen(text) + 1);
    return 0;
}

static int parse_number(double *out, const struct entry *e, const char *key)
{
    const json_t *value = json_object_get(e->object, key);

    if (!json_is_number(value))
        return bad(e->path, e->index, key, "is missing or not a number");
    *out = json_number_value(value);
    return 0;
}

static int parse_occluder(struct sst_truth_occluder *o, const struct entry *e)
{
    int err = parse_text(o->name, sizeof(o->name), e, "name");

    err = err ? err : parse_text(o->label, sizeof(o->label), e, "label");
    err = err ? err : parse_text(o->target, sizeof(o->target), e, "target");
    err = err ? err : parse_number(&o->focus_px, e, "focus_px");
    err = err ? err : parse_text(o->behind, sizeof(o->behind), e, "behind");
    err = err ? err : parse_text(o->mask, sizeof(o->mask), e, "mask");
    return err;
}

static int parse_occluders(struct sst_truth *t, const json_t *root, const char *path)
{
    const json_t *list = json_object_get(root, "occluders");
    const size_t n = json_array_size(list);

    if (list && !json_is_array(list))
        return bad(path, -1, "occluders", "is not a list");
    if (n > SST_TRUTH_MAX_OCCLUDERS)
        return bad(path, -1, "occluders", "has more than 16 entries");
    for (size_t i = 0; i < n; i++) {
        const int err = parse_occluder(&t->occluders[i], &(struct entry){ json_array_get(list, i), path, (int)i });

        if (err)
            return err;
    }
    t->count = (int)n;
    if (n == 0 && json_object_get(root, "focus_px")) {
        t->occluders[0] =
            (struct sst_truth_occluder){ .name = "occluder", .behind = "behind.png", .mask = "occluder.png" };
        t->count = 1;
        return parse_number(&t->occluders[0].focus_px, &(struct entry){ root, path, -1 }, "focus_px");
    }
    return 0;
}

static int parse_reference(struct sst_truth *t, const json_t *root, const char *path)
{
    const char *text = json_string_value(json_object_get(root, "reference"));
    int end = 0;

    if (!text || sscanf(text, "%3d_%3d%n", &t->ref_row, &t->ref_col, &end) != 2 || text[end] || t->ref_row < 0 ||
        t->ref_col < 0)
        return bad(path, -1, "reference", "is missing or not of the form rr_cc");
    return 0;
}

static int parse(struct sst_truth *t, const char *text, size_t size, const char *path)
{
    json_error_t error;
    json_t *root = json_loadb(text, size, JSON_REJECT_DUPLICATES, &error);
    int err;

    if (!root) {
        sst_log_error("%s: line %d: %s; write the truth again", path, error.line, error.text);
        return -EBADMSG;
    }
    err = parse_reference(t, root, path);
    err = err ? err : parse_occluders(t, root, path);
    json_decref(root);
    return err;
}

int sst_truth_read(struct sst_truth *truth, const char *dir)
{
    struct sst_truth read = { .described = true };
    char path[SST_PATH_MAX];
    uint8_t *text = NULL;
    size_t size;
    int err;

    if (!sst_path_is_dir(dir)) {
        sst_log_error("%s: no such folder; `sst scene` writes the truth of a light field to LF/truth", dir);
        return -ENOENT;
    }
    err = sst_path_join(path, dir, "truth.json");
    if (err)
        return err;
    if (!sst_path_exists(path)) {
        *truth = (struct sst_truth){ .described = false };
        return 0;
    }
    err = sst_file_read_text(path, JSON_MAX_BYTES, &text, &size);
    err = err ? err : parse(&read, (const char *)text, size, path);
    free(text);
    if (!err)
        *truth = read;
    return err;
}
