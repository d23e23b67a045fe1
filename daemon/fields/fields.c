/* Tables of fields as JSON and as metrics. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <assert.h>
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "daemon/fields/fields.h"

#define DEPTH_MAX 8

static int64_t integer_at(size_t size, const char *at)
{
    int32_t small;
    int64_t n;

    if (size == sizeof(small))
        return memcpy(&small, at, sizeof(small)), small;
    assert(size == sizeof(n));
    return memcpy(&n, at, sizeof(n)), n;
}

static double real_at(size_t size, const char *at)
{
    float small;
    double v;

    if (size == sizeof(small))
        return memcpy(&small, at, sizeof(small)), (double)small;
    assert(size == sizeof(v));
    return memcpy(&v, at, sizeof(v)), v;
}

static const void *pointer_at(const char *at)
{
    const void *p;

    return memcpy(&p, at, sizeof(p)), p;
}

static size_t length(const struct sst_field *f, const char *base)
{
    return f->count_at ? (size_t)integer_at(sizeof(int), base + f->count_at) : f->count;
}

/* --- JSON --------------------------------------------------------------------------------------------------------- */

static json_t *real_json(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

static json_t *time_json(int64_t wall_ns)
{
    char text[SST_CLOCK_TEXT] = "";

    if (wall_ns)
        sst_clock_text(text, wall_ns);
    return json_string(text);
}

/* Text from outside may end within a character, or be none. */
static json_t *text_json(const char *text)
{
    const size_t n = strlen(text);
    json_t *json = NULL;

    for (size_t cut = 0; !json && cut < 4 && cut <= n; cut++)
        json = json_stringn(text, n - cut);
    return json ? json : json_string("?");
}

static json_t *value_json(const struct sst_field *f, const char *base);

static json_t *element_json(const struct sst_field *f, const char *at)
{
    return f->item ? value_json(&(struct sst_field){ .type = f->item, .size = f->stride }, at)
                   : sst_fields_json(f->of, at);
}

/** @return false: no memory, or there is no value */
static bool set_member(json_t *o, const char *key, json_t *value)
{
    if (json_is_null(value) && json_object_get(o, key))
        return true;
    return !json_object_set_new(o, key, value);
}

/** Add the members of a row to an object. */
static bool add_members(json_t *o, const struct sst_field *f, const char *base)
{
    const char *at = base + f->at;
    const struct sst_spread *s = (const void *)at;
    bool good = true;

    if (f->type == SST_FIELD_SPREAD)
        return set_member(o, "p50", real_json(s->p50)) && set_member(o, "p99", real_json(s->p99)) &&
               set_member(o, "max", real_json(s->max));
    for (size_t i = 0; f->type == SST_FIELD_MAP && i < f->count && good; i++)
        good = set_member(o, f->names[i], element_json(f, at + i * f->stride));
    for (const struct sst_field *row = f->type == SST_FIELD_OBJECT ? f->of : NULL; row && row->type && good; row++)
        if (row->key)
            good = row->key[0] ? set_member(o, row->key, value_json(row, at)) : add_members(o, row, at);
    return good;
}

static json_t *object_json(const struct sst_field *f, const char *base)
{
    json_t *o = json_object();

    if (o && add_members(o, f, base))
        return o;
    json_decref(o);
    return NULL;
}

static json_t *list_json(const struct sst_field *f, const char *base)
{
    json_t *list = json_array();
    int err = 0;

    for (size_t i = 0; i < length(f, base) && !err; i++)
        err = json_array_append_new(list, element_json(f, base + f->at + i * f->stride));
    if (!err)
        return list;
    json_decref(list);
    return NULL;
}

static json_t *value_json(const struct sst_field *f, const char *base)
{
    const char *at = base + f->at;

    if (f->given && !*(const bool *)(base + f->given))
        return json_null();
    switch (f->type) {
    case SST_FIELD_BOOL:
        return json_boolean(*(const bool *)at);
    case SST_FIELD_INTEGER:
        return json_integer(integer_at(f->size, at));
    case SST_FIELD_REAL:
        return real_json(real_at(f->size, at));
    case SST_FIELD_TEXT:
        return text_json(at);
    case SST_FIELD_NAME:
        return text_json(pointer_at(at));
    case SST_FIELD_TIME:
        return time_json(integer_at(f->size, at));
    case SST_FIELD_CHOICE:
        return json_string(f->names[integer_at(f->size, at)]);
    case SST_FIELD_SPREAD:
    case SST_FIELD_OBJECT:
    case SST_FIELD_MAP:
        return object_json(f, base);
    case SST_FIELD_POINTER:
        return pointer_at(at) ? sst_fields_json(f->of, pointer_at(at)) : json_null();
    case SST_FIELD_LIST:
        return list_json(f, base);
    case SST_FIELD_JSON:
        return pointer_at(at) ? json_incref((json_t *)(uintptr_t)pointer_at(at)) : json_null();
    case SST_FIELD_END:
        break;
    }
    return NULL;
}

json_t *sst_fields_json(const struct sst_field *table, const void *structure)
{
    return object_json(&(struct sst_field){ .type = SST_FIELD_OBJECT, .of = table }, structure);
}

/* --- metrics ------------------------------------------------------------------------------------------------------ */

struct writer {
    FILE *f;
    const struct sst_field *chain[DEPTH_MAX]; /* from a row of the first table to the row that is written */
    int depth;
    const char *last; /* the metric that was written last */
};

/** Write the name of a sample. @param labels  end in a comma, or are "" @param label  one more; NULL: none */
static void write_name(const struct writer *w, const char *suffix, const char *labels, const char *label,
                       const char *value)
{
    fprintf(w->f, "sst_%s%s", w->last, suffix);
    if (label)
        fprintf(w->f, "{%s%s=\"%s\"}", labels, label, value);
    else if (labels[0])
        fprintf(w->f, "{%.*s}", (int)strlen(labels) - 1, labels);
    fputc(' ', w->f);
}

static void write_real(const struct writer *w, double v, double per)
{
    fprintf(w->f, per > 0 ? "%.9g\n" : "%.17g\n", per > 0 ? v / per : v);
}

static void write_value(const struct writer *w, enum sst_field_type type, size_t size, const char *at, double per)
{
    if (type == SST_FIELD_REAL)
        write_real(w, real_at(size, at), per);
    else
        fprintf(w->f, "%lld\n",
                type == SST_FIELD_BOOL ? (long long)*(const bool *)at : (long long)integer_at(size, at));
}

static void write_spread(const struct writer *w, const struct sst_field *f, const struct sst_spread *s,
                         const char *labels)
{
    write_name(w, "", labels, "quantile", "0.5");
    write_real(w, s->p50, f->per);
    write_name(w, "", labels, "quantile", "0.99");
    write_real(w, s->p99, f->per);
    write_name(w, "", labels, "quantile", "1");
    write_real(w, s->max, f->per);
    if (!isnan(s->sum)) {
        write_name(w, "_sum", labels, NULL, NULL);
        write_real(w, s->sum, f->per);
    }
    write_name(w, "_count", labels, NULL, NULL);
    fprintf(w->f, "%llu\n", (unsigned long long)s->count);
}

static void write_head(struct writer *w, const struct sst_field *f)
{
    const size_t n = strlen(f->metric);
    const bool counter = n > 6 && !strcmp(f->metric + n - 6, "_total");

    if (!w->last || strcmp(w->last, f->metric) != 0)
        fprintf(w->f, "# HELP sst_%s %s.\n# TYPE sst_%s %s\n", f->metric, f->help, f->metric,
                f->type == SST_FIELD_SPREAD ? "summary"
                : counter                   ? "counter"
                                            : "gauge");
    w->last = f->metric;
}

/** The samples of a row in one structure. */
static void write_row(struct writer *w, const struct sst_field *f, const char *base, const char *labels)
{
    const char *at = base + f->at;

    if (f->type == SST_FIELD_REAL && isnan(real_at(f->size, at)))
        return;
    write_head(w, f);
    if (f->type == SST_FIELD_SPREAD) {
        write_spread(w, f, (const void *)at, labels);
    } else if (f->type == SST_FIELD_MAP) {
        for (size_t i = 0; i < f->count; i++) {
            write_name(w, "", labels, f->label, f->names[i]);
            write_value(w, f->item, f->stride, at + i * f->stride, f->per);
        }
    } else if (f->type == SST_FIELD_CHOICE) {
        for (size_t i = 0; i < f->count; i++) {
            write_name(w, "", labels, f->label, f->names[i]);
            fprintf(w->f, "%d\n", integer_at(f->size, at) == (int64_t)i);
        }
    } else {
        write_name(w, "", labels, f->label, f->key);
        write_value(w, f->type, f->size, at, f->per);
    }
}

/** @param level  of the chain @param base  structure of the row there */
static void write_samples(struct writer *w, int level, const char *base, const char *labels)
{
    const struct sst_field *f = w->chain[level];
    const char *at = base + f->at;
    char all[256];

    if (level == w->depth - 1)
        write_row(w, f, base, labels);
    else if (f->type == SST_FIELD_OBJECT)
        write_samples(w, level + 1, at, labels);
    else if (f->type == SST_FIELD_POINTER && pointer_at(at))
        write_samples(w, level + 1, pointer_at(at), labels);
    for (size_t i = 0; level < w->depth - 1 && i < length(f, base); i++, at += f->stride) {
        snprintf(all, sizeof(all), "%s%s=\"%s\",", labels, f->label,
                 f->type == SST_FIELD_MAP ? f->names[i] : at + f->of->at);
        write_samples(w, level + 1, at, all);
    }
}

static void write_table(struct writer *w, const struct sst_field *table, const void *structure)
{
    assert(w->depth < DEPTH_MAX);
    for (const struct sst_field *row = table; row->type; row++) {
        w->chain[w->depth++] = row;
        if (row->of)
            write_table(w, row->of, structure);
        else if (row->metric)
            write_samples(w, 0, structure, "");
        w->depth--;
    }
}

void sst_fields_metrics(FILE *f, const struct sst_field *table, const void *structure)
{
    struct writer w = { .f = f };

    write_table(&w, table, structure);
}
