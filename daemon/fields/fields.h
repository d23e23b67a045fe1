/* daemon/fields/fields.h - tables of fields: members of a structure as JSON and as metrics, with their help. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_FIELDS_FIELDS_H
#define SST_DAEMON_FIELDS_FIELDS_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "base/base.h"

enum sst_field_type {
    SST_FIELD_END = 0, /* of a table: a zeroed row */
    SST_FIELD_BOOL = 1,
    SST_FIELD_INTEGER = 2,  /* of 4 or 8 bytes */
    SST_FIELD_REAL = 3,     /* double or float; not finite: null, and NaN: no metric */
    SST_FIELD_TEXT = 4,     /* an array of char */
    SST_FIELD_NAME = 5,     /* const char * */
    SST_FIELD_TIME = 6,     /* int64_t, wall time in ns; 0: "" */
    SST_FIELD_CHOICE = 7,   /* int: index of `names` */
    SST_FIELD_SPREAD = 8,   /* struct sst_spread: an object of p50, p99, max */
    SST_FIELD_OBJECT = 9,   /* a structure with the table `of` */
    SST_FIELD_POINTER = 10, /* to such a structure; NULL: null */
    SST_FIELD_MAP = 11,     /* an array with an element for each of `names` */
    SST_FIELD_LIST = 12,    /* an array */
    SST_FIELD_JSON = 13,    /* json_t *, an object, borrowed; NULL: null */
};

/** Percentiles of a measurement. NaN: null; a NaN sum: not known. */
struct sst_spread {
    double p50, p99, max, sum;
    uint64_t count;
};

/** One row of a table, which ends with a zeroed row. Of rows with the same key the one that is not null counts. */
struct sst_field {
    const char *key; /* "": members of a map or spread belong to the object around it; NULL: a metric alone */
    enum sst_field_type type;
    size_t at, size;    /* in the structure */
    const char *help;   /* for people: one clause without a full stop */
    const char *metric; /* its name without "sst_"; a counter ends in "_total"; NULL: none */
    double per;         /* units of the value in one of the metric, 1e3 of ms; 0: the same */
    /* Label of the metric: of a map its name, of a list's element its first member, else the key. A choice with a label
     * has a sample 0 or 1 for each name. */
    const char *label;
    const char *const *names;
    size_t count, stride;       /* of names or elements; from element to element */
    size_t count_at;            /* of the int that is the number of a list's elements; 0: it is `count` */
    enum sst_field_type item;   /* of elements that are plain values of `stride` bytes; 0: they have a table */
    const struct sst_field *of; /* of a structure or element */
    size_t given;               /* of the bool without which the member is null; 0: none. Metrics ignore it */
    bool nullable;              /* may be null for another reason */
};

/* Rows of tables about the structure IN; behind the named arguments: help, metric and so on. */
#define SST_FIELD(key_, type_, member, ...)                                                                            \
    { .key = key_, .type = SST_FIELD_##type_, .at = offsetof(IN, member), .size = sizeof(((IN *)0)->member),           \
      __VA_ARGS__ }
#define SST_FIELD_NAMES(array)  .names = array, ARRAY_LEN(array)
#define SST_FIELD_COUNTS(array) .item = SST_FIELD_INTEGER, SST_FIELD_NAMES(array), sizeof(uint64_t)
#define SST_FIELD_TABLE(...)    (const struct sst_field[]){ __VA_ARGS__, { 0 } }
/** An object with members of the same structure. */
#define SST_FIELD_GROUP(key_, help_, ...)                                                                              \
    { .key = key_, .type = SST_FIELD_OBJECT, .help = help_, .of = SST_FIELD_TABLE(__VA_ARGS__) }
/** The same; null unless a bool of the structure is true. */
#define SST_FIELD_GROUP_IF(key_, given_, help_, ...)                                                                   \
    { .key = key_, .type = SST_FIELD_OBJECT, .help = help_, .of = SST_FIELD_TABLE(__VA_ARGS__),                        \
      .given = offsetof(IN, given_) }

/** Members of a structure as an object. Text that is not UTF-8 is "?". @return NULL: no memory */
json_t *sst_fields_json(const struct sst_field *table, const void *structure);

/** Metrics of a structure in Prometheus' text format 0.0.4. Rows with one name of a metric must follow each other. */
void sst_fields_metrics(FILE *f, const struct sst_field *table, const void *structure);

#endif
