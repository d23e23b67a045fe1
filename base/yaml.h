/* base/yaml.h - strict YAML reader: one small document as a tree; all faults are logged together, with
 * file:line:column. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_YAML_H
#define SST_BASE_YAML_H

#include <stdbool.h>

#include "base/base.h"

#define SST_YAML_MAX_BYTES  ((size_t)1 << 20)
#define SST_YAML_MAX_NODES  65536
#define SST_YAML_MAX_KEYS   1024 /* of one mapping */
#define SST_YAML_MAX_DEPTH  16
#define SST_YAML_MAX_FAULTS 20 /* shown; more are counted */

/* Of files of other programs. */
#define SST_YAML_FOREIGN_BYTES ((size_t)64 << 20)
#define SST_YAML_FOREIGN_LIST  32 /* elements of a list that are kept */

struct sst_yaml; /* one thread at a time */
struct sst_yaml_asked;

enum sst_yaml_type {
    SST_YAML_SCALAR = 0,
    SST_YAML_LIST = 1,
    SST_YAML_MAP = 2,
};

struct sst_yaml_node {
    enum sst_yaml_type type;
    int line, column; /* from 1 */
    const char *text; /* of a scalar, without control characters; else "" */
    bool plain;       /* a scalar without quotes */
    const char *key;  /* in a mapping; NULL in a list */
    int key_line, key_column;
    int count;                           /* children, also ones that are not kept */
    struct sst_yaml_node *first, *next;  /* child; sibling */
    struct sst_yaml_node *last, *parent; /* child; NULL for the root */
    bool again;                          /* duplicate of an earlier key of the mapping: noted as a fault */
    bool known;                          /* sst_yaml_get() was called for it */
    struct sst_yaml_asked *asked;        /* keys looked up in this mapping: suggestions for an unknown key */
};

/**
 * Parse one document of mappings, lists and scalars. Anchors, aliases, tags, keys that are not scalars, a second
 * document, control characters and documents beyond the limits above are refused. A duplicate key is a fault, which
 * sst_yaml_finish() logs with the others.
 *
 * @param name  of the file, for messages
 * @return 0, -EBADMSG, -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_yaml_parse(struct sst_yaml **out, const char *text, size_t size, const char *name);

/**
 * The same for a file of another program, which may hold much that is not read: up to SST_YAML_FOREIGN_BYTES; of a list
 * only the first SST_YAML_FOREIGN_LIST elements become nodes, `count` is the number of all; an alias is a copy of the value
 * with its anchor, as PyYAML writes values that occur twice. Merge keys (<<) are refused.
 */
SST_MUST_CHECK int sst_yaml_parse_foreign(struct sst_yaml **out, const char *text, size_t size, const char *name);
void sst_yaml_destroy(struct sst_yaml *doc);

/** True if the document has no content but comments. */
bool sst_yaml_empty(const struct sst_yaml *doc);

/** The name passed to sst_yaml_parse(). */
const char *sst_yaml_name(const struct sst_yaml *doc);

/** The document's top-level mapping; NULL, with a fault noted, if it is anything else. */
struct sst_yaml_node *sst_yaml_root(struct sst_yaml *doc);

/**
 * Value of a key, which counts as known from then on; NULL if map is NULL or lacks the key. The readers below accept
 * NULL: they return false, leave *out and note no fault, so that a missing key keeps its default.
 */
struct sst_yaml_node *sst_yaml_get(struct sst_yaml_node *map, const char *key);

/** Value of a required key, as sst_yaml_get(): a missing one is a fault. */
struct sst_yaml_node *sst_yaml_need(struct sst_yaml *doc, struct sst_yaml_node *map, const char *key);

/** Mark all keys of the mapping as known, because the user chooses their names. */
void sst_yaml_know_all(struct sst_yaml_node *map);

/** Mark all keys at any depth as known: the file belongs to another program and may contain more than is read. */
void sst_yaml_know_tree(struct sst_yaml_node *node);

/** Note a fault at a node. The message is "KEY TEXT"; the text is one clause with the remedy: "must be 0 or 1". */
void sst_yaml_fault(struct sst_yaml *doc, const struct sst_yaml_node *at, const char *fmt, ...) SST_PRINTF(3, 4);

/** Note that the text of a scalar names nothing that exists: "unknown WHAT `TEXT`; REMEDY". */
void sst_yaml_unknown(struct sst_yaml *doc, const struct sst_yaml_node *at, const char *what, const char *remedy);

/* Typed readers: true, or a fault noted (if the node exists) and *out untouched. Numbers and booleans are written
 * without quotes; NaN, infinities, hexadecimal numbers and numbers with leading zeros (octal to some readers) are
 * not accepted. */
bool sst_yaml_double(struct sst_yaml *doc, const struct sst_yaml_node *node, double min, double max, double *out);
bool sst_yaml_int(struct sst_yaml *doc, const struct sst_yaml_node *node, int min, int max, int *out);
bool sst_yaml_bool(struct sst_yaml *doc, const struct sst_yaml_node *node, bool *out);
/** Text of 1..size-1 bytes. */
bool sst_yaml_string(struct sst_yaml *doc, const struct sst_yaml_node *node, char *out, size_t size);
/** Index of the scalar's text among n names. */
bool sst_yaml_choice(struct sst_yaml *doc, const struct sst_yaml_node *node, const char *const *names, int n, int *out);
/** A list of n numbers, or one number for all of them. */
bool sst_yaml_doubles(struct sst_yaml *doc, const struct sst_yaml_node *node, double min, double max, double *out,
                      int n);

/**
 * Note every key that was never looked up, with the nearest known key, then log all faults in the order of the file,
 * one line each.
 * @return 0 or -EBADMSG (there was a fault)
 */
SST_MUST_CHECK int sst_yaml_finish(struct sst_yaml *doc);

#endif
