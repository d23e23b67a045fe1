/* pipeline/image/npz.h - NumPy's .npz: a ZIP archive of named arrays, which `numpy.load` reads. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_NPZ_H
#define SST_PIPELINE_IMAGE_NPZ_H

#include "base/file.h"

#define SST_NPZ_ARRAYS 32 /* most arrays of a file */
#define SST_NPZ_DIMS   4

/** An array: its elements in C order, in the byte order of this machine. */
struct sst_npz_array {
    const char *name;  /* plain ASCII, at most 23 characters */
    const char *type;  /* NumPy's, without byte order: "u1", "u2", "i4", "i8", "f4", "f8", "b1", "U32" (UCS-4) */
    int n_dims;        /* 0 (a scalar) to SST_NPZ_DIMS */
    size_t dims[SST_NPZ_DIMS];
};

/** Place of an array in the archive. */
struct sst_npz_entry {
    char file[32]; /* name with .npy */
    uint64_t at, bytes;
    uint32_t crc32;
};

/** An archive that is written: stored arrays one after the other, dated 1980, so that equal arrays make equal bytes. */
struct sst_npz {
    struct sst_outfile out;
    struct sst_npz_entry entry[SST_NPZ_ARRAYS];
    int count;
    uint64_t at;   /* bytes written */
    uint64_t left; /* data bytes that the array at work still needs */
};

/** @return as sst_outfile_open() */
SST_MUST_CHECK int sst_npz_open(struct sst_npz *npz, const char *path);

/** Begin an array, of which sst_npz_put() then writes all bytes. @return 0, -EINVAL (name, type, sizes), -EIO, -ENOSPC; logged */
SST_MUST_CHECK int sst_npz_begin(struct sst_npz *npz, const struct sst_npz_array *array);

/** Add bytes to the array at work, no more than it needs. @return as sst_npz_begin() */
SST_MUST_CHECK int sst_npz_put(struct sst_npz *npz, const void *data, size_t bytes);

/** Add a whole array. @return as sst_npz_begin() */
SST_MUST_CHECK int sst_npz_add(struct sst_npz *npz, const struct sst_npz_array *array, const void *data);

/** Add an array of texts (UTF-8), shape [count]. @param texts  rows `stride` bytes apart @return as sst_npz_begin(), -ENOMEM */
SST_MUST_CHECK int sst_npz_add_texts(struct sst_npz *npz, const char *name, const char *texts, size_t stride, size_t count);

/** Write the directory after an array that is whole, and rename; or discard the file after an error.
 *  @return err, else as sst_outfile_commit() */
SST_MUST_CHECK int sst_npz_end(struct sst_npz *npz, int err);

#endif
