/* JSON files: parsing, and fields with their faults. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/lightfield/json_read.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"

int sst_json_load(json_t **root, const char *path, size_t limit_bytes, const char *remedy)
{
    json_error_t e;
    json_t *made;
    uint8_t *text;
    size_t size;
    const int err = sst_file_read_text(path, limit_bytes, &text, &size);

    if (err)
        return err;
    made = json_loadb((const char *)text, size, JSON_REJECT_DUPLICATES, &e);
    free(text);
    if (json_is_object(made)) {
        *root = made;
        return 0;
    }
    if (made)
        sst_log_error("%s is not a JSON object; %s", path, remedy);
    else
        sst_log_error("%s:%d:%d: %s; %s", path, e.line, e.column, e.text, remedy);
    json_decref(made);
    return -EBADMSG;
}

bool sst_json_has(const struct sst_json_reader *r, const char *field)
{
    return json_object_get(r->object, field) != NULL;
}

void sst_json_fault(struct sst_json_reader *r, const char *field, const char *what)
{
    if (!r->err)
        sst_log_error("%s: %s%s %s; %s", r->path, r->where, field, what, r->remedy);
    r->err = -EBADMSG;
}

json_t *sst_json_field(struct sst_json_reader *r, const char *field)
{
    json_t *v = json_object_get(r->object, field);

    assert(r->n_known < SST_JSON_MAX_FIELDS);
    r->known[r->n_known++] = field;
    if (!v)
        sst_json_fault(r, field, "is missing");
    return v;
}

int sst_json_int(struct sst_json_reader *r, const char *field, int lo, int hi)
{
    json_t *v = sst_json_field(r, field);
    char what[64];

    if (v && json_is_integer(v) && json_integer_value(v) >= lo && json_integer_value(v) <= hi)
        return (int)json_integer_value(v);
    snprintf(what, sizeof(what), "is not a whole number in %d..%d", lo, hi);
    sst_json_fault(r, field, what);
    return lo;
}

double sst_json_double(struct sst_json_reader *r, const char *field)
{
    json_t *v = sst_json_field(r, field);

    if (!json_is_number(v))
        sst_json_fault(r, field, "is not a number");
    return json_number_value(v);
}

bool sst_json_bool(struct sst_json_reader *r, const char *field)
{
    json_t *v = sst_json_field(r, field);

    if (!json_is_boolean(v))
        sst_json_fault(r, field, "is not true or false");
    return json_is_true(v);
}

void sst_json_string(struct sst_json_reader *r, const char *field, char *out, size_t size)
{
    json_t *v = sst_json_field(r, field);
    char what[64];

    if (!json_is_string(v) || json_string_length(v) >= size) {
        snprintf(what, sizeof(what), "is not a string of at most %zu bytes", size - 1);
        sst_json_fault(r, field, what);
        return;
    }
    memcpy(out, json_string_value(v), json_string_length(v) + 1);
}

json_t *sst_json_array(struct sst_json_reader *r, const char *field, size_t max)
{
    json_t *v = sst_json_field(r, field);
    char what[64];

    if (json_is_array(v) && json_array_size(v) <= max)
        return v;
    snprintf(what, sizeof(what), "is not a list of at most %zu", max);
    sst_json_fault(r, field, what);
    return NULL;
}

void sst_json_finish(struct sst_json_reader *r)
{
    const char *key;
    json_t *value;

    json_object_foreach(r->object, key, value)
    {
        size_t i = 0;

        while (i < r->n_known && strcmp(r->known[i], key))
            i++;
        if (i == r->n_known)
            sst_json_fault(r, key, "is a field that this version does not know");
    }
}

void sst_json_hash(struct sst_json_reader *r, const char *field, char out[65])
{
    sst_json_string(r, field, out, 65);
    if (!r->err && (strlen(out) != 64 || strspn(out, "0123456789abcdef") != 64))
        sst_json_fault(r, field, "is not 64 lower-case hexadecimal digits");
}

struct sst_json_reader sst_json_inside(struct sst_json_reader *r, const char *field, const char *where)
{
    struct sst_json_reader inner = { .path = r->path, .where = where, .remedy = r->remedy };

    inner.object = sst_json_field(r, field);
    if (!r->err && !json_is_object(inner.object))
        sst_json_fault(r, field, "is not an object");
    inner.err = r->err;
    return inner;
}

void sst_json_each(struct sst_json_reader *r, json_t *list, const char *name,
                   void (*read)(struct sst_json_reader *one, size_t index, void *arg), void *arg)
{
    char where[64];

    for (size_t i = 0; !r->err && i < json_array_size(list); i++) {
        struct sst_json_reader one = { .path = r->path, .where = where, .remedy = r->remedy };

        one.object = json_array_get(list, i);
        snprintf(where, sizeof(where), "%s[%zu].", name, i);
        if (json_is_object(one.object))
            read(&one, i, arg);
        else
            sst_json_fault(&one, "it", "is not an object");
        r->err = one.err;
    }
}

void sst_json_doubles(struct sst_json_reader *r, const char *field, double *out, size_t n)
{
    const json_t *list = sst_json_array(r, field, n);

    if (!r->err && json_array_size(list) != n)
        sst_json_fault(r, field, "is too short");
    for (size_t i = 0; !r->err && i < n; i++) {
        if (!json_is_number(json_array_get(list, i)))
            sst_json_fault(r, field, "has an element that is not a number");
        out[i] = json_number_value(json_array_get(list, i));
    }
}

void sst_json_samples(struct sst_json_reader *r, const char *field, struct sst_samples *out)
{
    double v[2] = { 0, 0 };

    sst_json_doubles(r, field, v, 2);
    if (!r->err && !(v[0] >= 0 && v[0] < v[1] && v[1] <= 65535 && v[0] == floor(v[0]) && v[1] == floor(v[1])))
        sst_json_fault(r, field, "are not two ascending whole numbers in 0..65535");
    if (!r->err)
        *out = (struct sst_samples){ (int)v[0], (int)v[1] };
}
