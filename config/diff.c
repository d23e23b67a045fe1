/* Differences between two configurations, key by key, as text. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "config/schema.h"

struct diff {
    struct sst_config_change *list;
    int n, room;
    const struct sst_config *before, *after;
    char a[SST_KEY_TEXT_MAX], b[SST_KEY_TEXT_MAX];
};

static int add(struct diff *d, const char *key, enum sst_reload_class class_)
{
    struct sst_config_change *c;

    if (!sst_mem_grow(&d->list, d->n, &d->room, sizeof(*d->list)))
        return -ENOMEM;
    c = &d->list[d->n++];
    c->class_ = class_;
    snprintf(c->key, sizeof(c->key), "%s", key);
    snprintf(c->before, sizeof(c->before), "%.*s", (int)sizeof(c->before) - 1, d->a);
    snprintf(c->after, sizeof(c->after), "%.*s", (int)sizeof(c->after) - 1, d->b);
    return 0;
}

/* Elements in both lists are compared field by field, others are reported as a whole. */
static int compare_list(struct diff *d, const struct sst_key *list)
{
    const int n = sst_key_count(list, d->before), m = sst_key_count(list, d->after);
    const char *section = list->section;
    char name[96];
    int err = 0;

    for (int i = 0; !err && i < sst_max_int(n, m); i++) {
        const size_t at = list->offset + (size_t)i * list->stride;

        for (int f = 0; !err && i < n && i < m && f < list->n_fields; f++) {
            sst_key_text(&list->fields[f], (const char *)d->before + at, d->before, d->a);
            sst_key_text(&list->fields[f], (const char *)d->after + at, d->after, d->b);
            snprintf(name, sizeof(name), "%s%s%s[%d].%s", section, *section ? "." : "", list->name, i,
                     list->fields[f].name);
            if (strcmp(d->a, d->b) != 0)
                err = add(d, name, list->reload);
        }
        if (i < n && i < m)
            continue;
        *d->a = *d->b = 0;
        snprintf(name, sizeof(name), "%s%s%s[%d]", section, *section ? "." : "", list->name, i);
        sst_key_element_text(list, i < n ? d->before : d->after, i, i < n ? d->before : d->after, i < n ? d->a : d->b);
        err = err ? err : add(d, name, list->reload);
    }
    return err;
}

/* Reload class of a change from one value to another. */
static enum sst_reload_class class_of(const struct sst_key *key, const struct sst_config *a, const struct sst_config *b)
{
    const char *from = (const char *)a + key->offset, *to = (const char *)b + key->offset;

    return key->switches && !*from != !*to ? SST_RELOAD_DAEMON : key->reload;
}

static int compare(struct diff *d, const struct sst_key *key)
{
    char name[96];

    if (key->type == SST_KEY_LIST)
        return compare_list(d, key);
    sst_key_text(key, d->before, d->before, d->a);
    sst_key_text(key, d->after, d->after, d->b);
    if (!strcmp(d->a, d->b))
        return 0;
    snprintf(name, sizeof(name), "%s%s%s", key->section, *key->section ? "." : "", key->name);
    return add(d, name, class_of(key, d->before, d->after));
}

static bool is_counted(const struct sst_key *key)
{
    return (key->type == SST_KEY_TEXTS || key->type == SST_KEY_CONTROLS || key->type == SST_KEY_LIST) &&
           key->count_offset != SST_KEY_NO_COUNT;
}

void sst_config_keep(struct sst_config *to, const struct sst_config *running)
{
    int count;
    const struct sst_key *keys = sst_schema(&count);

    for (int i = 0; i < count; i++) {
        const struct sst_key *key = &keys[i];

        if (class_of(key, running, to) != SST_RELOAD_DAEMON)
            continue;
        memcpy((char *)to + key->offset, (const char *)running + key->offset, key->size);
        if (is_counted(key))
            memcpy((char *)to + key->count_offset, (const char *)running + key->count_offset, sizeof(int));
    }
}

int sst_config_diff(struct sst_config_change **out, const struct sst_config *before, const struct sst_config *after)
{
    struct diff *d = calloc(1, sizeof(*d));
    int count, n, err = 0;
    const struct sst_key *keys = sst_schema(&count);

    if (!d)
        return -ENOMEM;
    d->before = before;
    d->after = after;
    for (int i = 0; !err && i < count; i++)
        err = compare(d, &keys[i]);
    n = d->n;
    if (err)
        free(d->list);
    else
        *out = d->list; /* NULL where nothing differs */
    free(d);
    return err ? err : n;
}

const char *sst_reload_class_name(enum sst_reload_class class_)
{
    static const char *const names[] = { "live", "restart-camera", "restart-daemon", "restart-live" };

    return names[sst_clamp_int((int)class_, 0, (int)ARRAY_LEN(names) - 1)];
}
