/* Values of keys as text; parsed defaults. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "config/schema.h"

/* Output text, truncated at SST_KEY_TEXT_MAX bytes. */
struct text {
    char *out;
    size_t used;
};

static void add(struct text *t, const char *what)
{
    const size_t n = strnlen(what, SST_KEY_TEXT_MAX - 1 - t->used);

    memcpy(t->out + t->used, what, n);
    t->used += n;
    t->out[t->used] = 0;
}

/* The shortest decimal that parses to the same value. */
static void add_double(struct text *t, double v)
{
    char text[40];

    for (int digits = 6; digits <= 17; digits++) {
        snprintf(text, sizeof(text), "%.*g", digits, v);
        if (strtod(text, NULL) == v)
            break;
    }
    add(t, text);
}

static void add_int(struct text *t, int64_t v)
{
    char text[24];

    snprintf(text, sizeof(text), "%lld", (long long)v);
    add(t, text);
}

/* Without quotes only if every YAML reader parses it as a string. */
static void add_text(struct text *t, const char *s)
{
    static const char *const taken[] = { "y", "n", "yes", "no", "on", "off", "true", "false", "null" };
    bool plain = strspn(s, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ/") > 0 &&
                 strspn(s, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./@") == strlen(s);

    for (size_t i = 0; i < ARRAY_LEN(taken); i++)
        plain = plain && strcasecmp(s, taken[i]) != 0;
    if (plain) {
        add(t, s);
        return;
    }
    add(t, "\"");
    for (; *s; s++) {
        if (*s == '"' || *s == '\\')
            add(t, "\\");
        add(t, (char[]){ *s, 0 });
    }
    add(t, "\"");
}

static const void *at(const struct sst_key *key, const void *base)
{
    return (const char *)base + key->offset;
}

int sst_key_count(const struct sst_key *key, const void *base)
{
    const int most = (int)(key->size / key->stride);
    int n = 0;

    if (key->count_offset != SST_KEY_NO_COUNT) {
        memcpy(&n, (const char *)base + key->count_offset, sizeof(n));
        return sst_clamp_int(n, 0, most);
    }
    while (n < most && ((const char *)at(key, base))[(size_t)n * key->stride])
        n++;
    return n;
}

static void add_number(struct text *t, const struct sst_key *key, const void *p)
{
    const bool whole = key->type == SST_KEY_INT || key->type == SST_KEY_INTS;
    const double v = whole ? *(const int *)p : *(const double *)p;

    if (key->word && (v == key->word_value || (isnan(v) && isnan(key->word_value))))
        add(t, key->word);
    else if (whole)
        add_int(t, *(const int *)p);
    else
        add_double(t, v);
}

static void add_list(struct text *t, const struct sst_key *key, const void *base)
{
    const char *first = at(key, base);
    int n = sst_key_count(key, base), same = 1;

    if (key->type == SST_KEY_INTS || key->type == SST_KEY_DOUBLES) {
        n = sst_max_int(n, 1);
        while (same < n && !memcmp(first, first + (size_t)same * key->stride, key->stride))
            same++;
        if (same == n) { /* one number for all */
            add_number(t, key, first);
            return;
        }
    }
    add(t, "[");
    for (int i = 0; i < n; i++) {
        add(t, i ? ", " : "");
        if (key->type == SST_KEY_TEXTS)
            add_text(t, first + (size_t)i * key->stride);
        else
            add_number(t, key, first + (size_t)i * key->stride);
    }
    add(t, "]");
}

static void add_controls(struct text *t, const struct sst_array_config *a)
{
    add(t, a->controls ? "{ " : "{}");
    for (int i = 0; i < a->controls; i++) {
        add(t, i ? ", " : "");
        add_text(t, a->control[i].name);
        add(t, ": ");
        add_int(t, a->control[i].value);
    }
    add(t, a->controls ? " }" : "");
}

static void add_value(struct text *t, const struct sst_key *key, const void *base, const struct sst_config *cfg)
{
    const void *p = at(key, base);
    const char *name;
    int i;

    switch (key->type) {
    case SST_KEY_BOOL:
        add(t, *(const bool *)p ? "true" : "false");
        break;
    case SST_KEY_INT:
    case SST_KEY_DOUBLE:
        add_number(t, key, p);
        break;
    case SST_KEY_TEXT:
        add_text(t, p);
        break;
    case SST_KEY_CHOICE:
        i = *(const int *)p;
        add(t, i >= 0 && i < key->n_names ? key->names[i] : "");
        break;
    case SST_KEY_FORMAT:
        name = sst_array_format_name(*(const uint32_t *)p);
        add(t, name ? name : "");
        break;
    case SST_KEY_CONTROLS:
        add_controls(t, &cfg->array);
        break;
    case SST_KEY_LINE:
        i = *(const int *)p;
        add_text(t, i >= 0 && i < cfg->array.lines ? cfg->array.line[i] : "");
        break;
    case SST_KEY_ZONE:
        i = *(const int *)p;
        add_text(t, i >= 0 && i < cfg->zones ? cfg->zone[i].name : "");
        break;
    case SST_KEY_INTS:
    case SST_KEY_DOUBLES:
    case SST_KEY_TEXTS:
        add_list(t, key, base);
        break;
    case SST_KEY_LIST:
        break;
    }
}

void sst_key_text(const struct sst_key *key, const void *base, const struct sst_config *cfg, char *out)
{
    struct text t = { .out = out };

    *out = 0;
    add_value(&t, key, base, cfg);
}

void sst_key_element_text(const struct sst_key *list, const void *base, int i, const struct sst_config *cfg, char *out)
{
    const char *element = (const char *)at(list, base) + (size_t)i * list->stride;
    struct text t = { .out = out };
    bool first = true;

    *out = 0;
    add(&t, "{");
    for (int k = 0; k < list->n_fields; k++) {
        const struct sst_key *f = &list->fields[k];
        const size_t start = t.used;
        size_t value;

        add(&t, first ? " " : ", ");
        add(&t, f->name);
        add(&t, ": ");
        value = t.used;
        add_value(&t, f, element, cfg);
        if (f->standard && !strcmp(out + value, *f->standard ? f->standard : "\"\"")) {
            t.used = start;
            out[start] = 0;
        } else {
            first = false;
        }
    }
    add(&t, first ? "}" : " }");
}

static void set_numbers(const struct sst_key *key, void *base)
{
    const char *s = key->standard + (*key->standard == '[');
    const size_t n = key->size / key->stride;

    for (size_t i = 0; i < n; i++) {
        char *end, *p = (char *)base + key->offset + i * key->stride;
        const double v = strtod(s, &end);
        const int whole = (int)v;

        if (key->type == SST_KEY_INTS)
            memcpy(p, &whole, sizeof(whole));
        else
            memcpy(p, &v, sizeof(v));
        if (*end == ',') /* else the last one is used for the rest */
            s = end + 1;
    }
}

void sst_key_set_default(const struct sst_key *key, void *base)
{
    void *p = (char *)base + key->offset;
    const char *s = key->standard ? key->standard : "";
    const bool word = key->word && !strcmp(s, key->word);
    int i = 0;

    memset(p, 0, key->size);
    switch (key->type) {
    case SST_KEY_BOOL:
        *(bool *)p = !strcmp(s, "true");
        break;
    case SST_KEY_INT:
        *(int *)p = word ? (int)key->word_value : (int)strtol(s, NULL, 10);
        break;
    case SST_KEY_DOUBLE:
        *(double *)p = word ? key->word_value : strtod(s, NULL);
        break;
    case SST_KEY_TEXT:
        snprintf(p, key->size, "%s", s);
        break;
    case SST_KEY_CHOICE:
        while (i < key->n_names && strcmp(key->names[i], s) != 0)
            i++;
        memcpy(p, &i, sizeof(i));
        break;
    case SST_KEY_FORMAT:
        *(uint32_t *)p = sst_array_format(s);
        break;
    case SST_KEY_INTS:
    case SST_KEY_DOUBLES:
        set_numbers(key, base);
        break;
    case SST_KEY_LINE:
    case SST_KEY_ZONE:
        *(int *)p = -1;
        break;
    case SST_KEY_TEXTS:
    case SST_KEY_CONTROLS:
    case SST_KEY_LIST:
        if (key->count_offset != SST_KEY_NO_COUNT)
            memset((char *)base + key->count_offset, 0, sizeof(int));
        break;
    }
}
