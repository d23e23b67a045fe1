/* config/schema.h - the table of all keys of sstd.yaml: source of parsing, defaults, reload classes and the manual page,
 * which explains each as docs/man/keys.txt does. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CONFIG_SCHEMA_H
#define SST_CONFIG_SCHEMA_H

#include "config/sstd.h"

enum sst_key_type {
    SST_KEY_BOOL = 0,
    SST_KEY_INT = 1,
    SST_KEY_DOUBLE = 2,
    SST_KEY_TEXT = 3,
    SST_KEY_CHOICE = 4, /* enumeration: index of the name */
    SST_KEY_FORMAT = 5, /* pixel format by name */
    SST_KEY_INTS = 6,   /* a list of numbers, or one number for all */
    SST_KEY_DOUBLES = 7,
    SST_KEY_TEXTS = 8,    /* a list of texts */
    SST_KEY_CONTROLS = 9, /* a mapping from camera controls to whole numbers */
    SST_KEY_LIST = 10,    /* a list of mappings */
    SST_KEY_LINE = 11,    /* int: index of a trigger line, written as its name */
    SST_KEY_ZONE = 12,    /* int: index of a zone, written as its name */
};

/** Kinds of text. */
enum sst_text_kind {
    SST_TEXT_ANY = 0,
    SST_TEXT_NAME = 1,    /* [a-z0-9_-]+ */
    SST_TEXT_PATH = 2,    /* absolute, since a service has no meaningful working folder */
    SST_TEXT_FILE = 3,    /* the same, of a file that should exist */
    SST_TEXT_ADDRESS = 4, /* numeric, IPv4 or IPv6 */
    SST_TEXT_TOPIC = 5,   /* MQTT topic without wildcards */
    SST_TEXT_EVENT = 6,   /* type of an event, or "*" */
    SST_TEXT_POINTS = 7,  /* "x,y x,y x,y": a polygon, or a line, in fractions of the picture */
    SST_TEXT_URL = 8,     /* http://... or https://..., without query and fragment */
    SST_TEXT_SPLIT = 9,   /* "2x2": rows and columns of cameras in a picture */
};

#define SST_KEY_NO_COUNT ((size_t)-1)

struct sst_key {
    const char *section; /* "cameras"; "" at the top and in the mappings of a list */
    const char *name;    /* ends with the unit: rate_hz */
    enum sst_key_type type;
    size_t offset, size;  /* of the value in struct sst_config, or in the element of a list */
    const char *standard; /* default as written in YAML; NULL: required (only in the mappings of a list) */
    double min, max;      /* numbers */
    const char *word;     /* a word for a special number, or NULL */
    double word_value;
    const char *const *names; /* choices */
    int n_names;
    enum sst_text_kind kind; /* texts */
    bool optional;           /* a text may be "" though that is not its default */
    size_t count_offset; /* lists: how many there are (of numbers: are used), an int; SST_KEY_NO_COUNT: ends at "" */
    size_t stride;       /* lists: bytes of an element */
    const struct sst_key *fields; /* lists of mappings: keys of one */
    int n_fields;
    enum sst_reload_class reload;
    bool switches; /* setting or removing the text needs a restart, whatever `reload` is for other changes */
};

#define SST_CONFIG_KEYS_MAX 224 /* keys at most */

/** All keys in the order of the file, grouped by section. */
const struct sst_key *sst_schema(int *count);

/** Index of "section.key" or "key"; it must exist. */
int sst_schema_index(const char *dotted);

/** True if the key belongs to struct sst_array_config. */
bool sst_key_of_array(const struct sst_key *key);

/** True for live.calibration, which masks of the reference view need in every program that captures. */
bool sst_key_places_masks(const struct sst_key *key);

/** Types of events that hooks may name, "*" first (daemon/events/events.h). */
extern const char *const sst_event_types[];
extern const int sst_event_types_count;

/** Names of the pixel formats that the pipeline reads, as in v4l2-ctl. */
#define SST_FORMATS 9
extern const char *const sst_format_names[SST_FORMATS];

/** Maximum size of a value as text: 16 arguments of 255 bytes with quotes and escapes. */
#define SST_KEY_TEXT_MAX 16384

/** Set a key to its default. @param base  struct sst_config, or the element of a list */
void sst_key_set_default(const struct sst_key *key, void *base);

/** A value as written in YAML (not of SST_KEY_LIST). @param cfg  names lines and zones @param out  [SST_KEY_TEXT_MAX]
 */
void sst_key_text(const struct sst_key *key, const void *base, const struct sst_config *cfg, char *out);

/** An element of a list of mappings, as { key: value, ... } without fields at their defaults. */
void sst_key_element_text(const struct sst_key *list, const void *base, int i, const struct sst_config *cfg, char *out);

/** Number of elements of a list; of a list of numbers, the number in use. */
int sst_key_count(const struct sst_key *key, const void *base);

#endif
