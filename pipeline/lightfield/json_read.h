/* pipeline/lightfield/json_read.h - JSON files read field by field: the first fault is one sentence with file and field. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_JSON_READ_H
#define SST_PIPELINE_LIGHTFIELD_JSON_READ_H

#include <jansson.h>
#include <stdbool.h>

#include "pipeline/image/image.h"

#define SST_JSON_MAX_FIELDS 32 /* of the largest object */

/** State of reading one object; only its first fault is logged. */
struct sst_json_reader {
    const char *path, *where; /* where: "" or "views[3]." */
    const char *remedy;       /* end of the sentence */
    json_t *object;           /* borrowed */
    const char *known[SST_JSON_MAX_FIELDS]; /* names read so far */
    size_t n_known;
    int err; /* 0, -EBADMSG, or the caller's */
};

/** Parse a file whose root is an object. @param root  out, to release with json_decref()
 *  @return 0, -ENOENT, -EBADMSG, -EIO, -ENOMEM; logged */
SST_MUST_CHECK int sst_json_load(json_t **root, const char *path, size_t limit_bytes, const char *remedy);

/** Log the fault of a field ("is missing") and set err. */
void sst_json_fault(struct sst_json_reader *r, const char *field, const char *what);

/** Does the object have it? Not a fault, and not read by this. */
bool sst_json_has(const struct sst_json_reader *r, const char *field);

/* Values of fields that must be there. After a fault, a value of the type; strings and lists of numbers stay. */
json_t *sst_json_field(struct sst_json_reader *r, const char *field);
int sst_json_int(struct sst_json_reader *r, const char *field, int lo, int hi);
double sst_json_double(struct sst_json_reader *r, const char *field);
bool sst_json_bool(struct sst_json_reader *r, const char *field);
void sst_json_string(struct sst_json_reader *r, const char *field, char *out, size_t size);
json_t *sst_json_array(struct sst_json_reader *r, const char *field, size_t max);
void sst_json_doubles(struct sst_json_reader *r, const char *field, double *out, size_t n);

/** Two ascending whole numbers of 16 bits. */
void sst_json_samples(struct sst_json_reader *r, const char *field, struct sst_samples *out);

/** 64 lower-case hexadecimal digits. */
void sst_json_hash(struct sst_json_reader *r, const char *field, char out[65]);

/** A reader of an object in a field. @param where  of the faults in it: "calibration." */
struct sst_json_reader sst_json_inside(struct sst_json_reader *r, const char *field, const char *where);

/** Fault for fields that were not read: they would be lost when the file is written again. */
void sst_json_finish(struct sst_json_reader *r);

/** Read the objects of a list, each by itself, until one has a fault. @param name  of the list, for messages */
void sst_json_each(struct sst_json_reader *r, json_t *list, const char *name,
                   void (*read)(struct sst_json_reader *one, size_t index, void *arg), void *arg);

#endif
