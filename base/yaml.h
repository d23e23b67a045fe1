/* base/yaml.h - strict YAML: a small document as a tree, faults with file:line:column, all of them told at once. */
#ifndef SST_BASE_YAML_H
#define SST_BASE_YAML_H

#include <stdbool.h>

#include "base/base.h"

#define SST_YAML_MAX_BYTES  ((size_t)1 << 20)
#define SST_YAML_MAX_NODES  65536
#define SST_YAML_MAX_KEYS   1024 /* of one mapping */
#define SST_YAML_MAX_DEPTH  16
#define SST_YAML_MAX_FAULTS 20 /* shown; more are counted */

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
    int count;                           /* children */
    struct sst_yaml_node *first, *next;  /* child; sibling */
    struct sst_yaml_node *last, *parent; /* child; NULL for the root */
    bool again;                          /* its mapping has the key twice: a fault, told when it was read */
    bool known;                          /* sst_yaml_get() asked for it */
    struct sst_yaml_asked *asked;        /* keys that it asked this mapping for: what a wrong one may have meant */
};

/**
 * Read one document: mappings, lists and scalars. Anchors, aliases, tags, keys that are no scalars, a second document,
 * control characters and what exceeds the limits above are refused; a key that occurs twice is a fault, told by
 * sst_yaml_finish() with the others.
 *
 * @param name  of the file, for messages
 * @return 0, -EBADMSG, -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_yaml_parse(struct sst_yaml **out, const char *text, size_t size, const char *name);
void sst_yaml_destroy(struct sst_yaml *doc);

/** Nothing but comments. */
bool sst_yaml_empty(const struct sst_yaml *doc);

/** The file's name, as it was given. */
const char *sst_yaml_name(const struct sst_yaml *doc);

/** The document's mapping; where it is anything else that is a fault, and NULL. */
struct sst_yaml_node *sst_yaml_root(struct sst_yaml *doc);

/**
 * Value of a key, which is a known one from then on; NULL where map is NULL or lacks it. The readers below take NULL:
 * they return false, leave *out and note no fault, so that a missing key keeps its default.
 */
struct sst_yaml_node *sst_yaml_get(struct sst_yaml_node *map, const char *key);

/** The same for a key that must be there: its lack is a fault. */
struct sst_yaml_node *sst_yaml_need(struct sst_yaml *doc, struct sst_yaml_node *map, const char *key);

/** All keys of the mapping below are known: they are names that the user chose. */
void sst_yaml_know_all(struct sst_yaml_node *map);

/** All keys at any depth below are known: the file is another program's, and may hold more than is read. */
void sst_yaml_know_tree(struct sst_yaml_node *node);

/** Note a fault at a node; `what` follows the key's name. The text is one clause, with the remedy. */
void sst_yaml_fault(struct sst_yaml *doc, const struct sst_yaml_node *at, const char *fmt, ...) SST_PRINTF(3, 4);

/* Typed readers: true, or a fault noted (where the node is there) and *out untouched. Numbers and booleans are written
 * without quotes; NaN, infinities, hexadecimal and what begins with a 0 too many (others read it as octal) are no
 * numbers here. */
bool sst_yaml_double(struct sst_yaml *doc, const struct sst_yaml_node *node, double min, double max, double *out);
bool sst_yaml_int(struct sst_yaml *doc, const struct sst_yaml_node *node, int min, int max, int *out);
bool sst_yaml_bool(struct sst_yaml *doc, const struct sst_yaml_node *node, bool *out);
/** Text of 1..size-1 bytes. */
bool sst_yaml_string(struct sst_yaml *doc, const struct sst_yaml_node *node, char *out, size_t size);
/** Index of the text among n names. */
bool sst_yaml_choice(struct sst_yaml *doc, const struct sst_yaml_node *node, const char *const *names, int n, int *out);
/** A list of n numbers, or one number that stands for all. */
bool sst_yaml_doubles(struct sst_yaml *doc, const struct sst_yaml_node *node, double min, double max, double *out,
                      int n);

/**
 * Note every key that was never asked for, with the nearest that was, then log all faults in the file's order, a line
 * each.
 * @return 0 or -EBADMSG (there was a fault)
 */
SST_MUST_CHECK int sst_yaml_finish(struct sst_yaml *doc);

#endif
