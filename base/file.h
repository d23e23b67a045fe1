/* base/file.h - whole files read, files and folders written atomically: output appears complete or not at all. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_FILE_H
#define SST_BASE_FILE_H

#include <stdbool.h>
#include <stdio.h>

#include "base/base.h"

#define SST_PATH_MAX 4096

/** Join two path parts (the second may be NULL); -ENAMETOOLONG when it does not fit SST_PATH_MAX. */
SST_MUST_CHECK int sst_path_join(char out[SST_PATH_MAX], const char *dir, const char *name);

/** Last part of a path; points into it. */
const char *sst_path_base(const char *path);

/** The path `below` the program's own folder. @return 0, -ENOENT (unknown folder), -ENAMETOOLONG (logged) */
SST_MUST_CHECK int sst_path_beside_program(char out[SST_PATH_MAX], const char *below);

bool sst_path_exists(const char *path);
bool sst_path_is_dir(const char *path);
/** True for a path that the rights of its folder, or its own, keep from being read. */
bool sst_path_is_denied(const char *path);

/** Create a folder; an existing one is fine. @return 0 or an error as of sst_outfile_open(), logged. */
SST_MUST_CHECK int sst_path_make_dir(const char *path);

/** Open a regular file for reading; pipes and devices are not waited for. @return descriptor, -EISDIR, -EBADMSG (not a
 *  regular file) or -errno; not logged */
SST_MUST_CHECK int sst_file_open(const char *path);

/**
 * Read a regular file into one buffer, with a NUL after its end.
 *
 * @param data   out, to free with free()
 * @param limit_bytes  larger files are refused
 * @return 0, -ENOENT, -EISDIR, -EACCES, -EBADMSG (no regular file, or over the limit), -EIO. Logged.
 */
SST_MUST_CHECK int sst_file_read(const char *path, size_t limit_bytes, uint8_t **data, size_t *size);

/** Read a text in UTF-8 without its byte order mark. @return as sst_file_read(), also -EBADMSG for UTF-16 and UTF-32,
 *  logged */
SST_MUST_CHECK int sst_file_read_text(const char *path, size_t limit_bytes, uint8_t **text, size_t *size);

/** First line of a file, as far as it fits, without its end; "" if it cannot be read. Not logged. @return out */
const char *sst_file_line(char *out, size_t size, const char *path);

/**
 * A file that appears under its name only when committed: written beside it under a temporary name, synced, renamed.
 * "-" is not special. Abort and failures remove the temporary file.
 */
struct sst_outfile {
    FILE *stream;
    bool unsynced; /* set by the caller: a file that is made again if the machine loses it is not synced */
    char path[SST_PATH_MAX], temporary[SST_PATH_MAX];
};

/** @return 0, or -EIO/-ENOSPC/-EROFS/-EACCES, logged. */
SST_MUST_CHECK int sst_outfile_open(struct sst_outfile *out, const char *path);

/** The file of a name in a folder. @return as sst_outfile_open(), -ENAMETOOLONG, logged */
SST_MUST_CHECK int sst_outfile_open_in(struct sst_outfile *out, const char *dir, const char *name);

/** Flush, sync and rename; the folder is synced as well, unless it is one of an sst_outdir. On failure the old file
 * stays and the temporary one is removed. Always closes. Logged. */
SST_MUST_CHECK int sst_outfile_commit(struct sst_outfile *out);

/** Discard the output. A zeroed or committed object is fine. */
void sst_outfile_abort(struct sst_outfile *out);

/** Write all bytes at an offset of an open file. @return 0 or -errno, not logged */
SST_MUST_CHECK int sst_file_write_at(int fd, const void *data, size_t size, int64_t offset);

/** Write a whole buffer through an sst_outfile. */
SST_MUST_CHECK int sst_file_write(const char *path, const void *data, size_t size);

/**
 * A folder that appears under its name only when committed.
 *
 * Files are made inside `temporary`. Commit syncs them and renames; with `replace` an existing folder of that name is
 * swapped out and removed, else its existence is refused at open (-EEXIST, logged).
 */
struct sst_outdir {
    bool replace;
    bool synced; /* set by the caller: all files come from sst_outfile_commit() and need no second sync */
    char path[SST_PATH_MAX], temporary[SST_PATH_MAX];
};

SST_MUST_CHECK int sst_outdir_open(struct sst_outdir *out, const char *path, bool replace);
SST_MUST_CHECK int sst_outdir_commit(struct sst_outdir *out);

/** Sync its content, for callers that move it themselves. @return 0 or -errno, not logged */
SST_MUST_CHECK int sst_outdir_sync(const struct sst_outdir *out);
void sst_outdir_abort(struct sst_outdir *out);

/** Commit, or discard it after an error. @return err, else as sst_outdir_commit() */
SST_MUST_CHECK int sst_outdir_end(struct sst_outdir *out, int err);

/**
 * Refuse (logged) an output that cannot be made, before the work for it is done: its folder is missing or not writable, or a
 * file is wanted where there is a folder or a device. Whether it may be replaced is not checked.
 * @return 0, or as sst_outfile_open()
 */
SST_MUST_CHECK int sst_path_check_new(const char *path, bool file);

/** Whether the first lies in the second, or is it; links are followed. False where one does not exist. */
bool sst_path_is_inside(const char *inner, const char *outer);

/** Whether two names are of one file or folder, which need not exist yet: "a.png", "./a.png"; links are followed. */
bool sst_path_is_same(const char *a, const char *b);

/** Refuse a file to write that is this input, or a view or map of a light field that is. @return 0, -EINVAL, logged */
SST_MUST_CHECK int sst_path_check_keeps(const char *path, const char *input);

/** Refuse (logged) an output that cannot be made, exists already (without force), or would replace one of `inputs` (ends in NULL) or a folder that is not of this kind:
 *  with force, `out` may exist only if it is empty or holds a file named `marker`. @return 0, -EEXIST, -EINVAL, -EIO */
SST_MUST_CHECK int sst_path_check_output(const char *out, bool force, const char *marker, const char *const *inputs);

/** Refuse (logged) a file to write that cannot be made, or that exists already (without force). @return as
 *  sst_path_check_output() */
SST_MUST_CHECK int sst_path_check_file(const char *out, bool force);

/** Remove a folder and all below it; links are not followed. Missing is fine. */
void sst_path_remove_tree(const char *path);

/** Remove unfinished output of killed processes in a folder, or of the output `path`; no process may be writing
 *  there. */
void sst_path_remove_temporaries(const char *dir);
void sst_path_remove_temporaries_of(const char *path);

/** Copy a folder and all below it, without entries whose names begin with a dot. Only files and folders are copied, a
 *  file with the permissions of the original; links, pipes and devices are named in a warning. `from` itself may be a
 * link.
 *  On failure a part may be there. @param to  does not exist @return 0 or -errno, logged */
SST_MUST_CHECK int sst_path_copy_tree(const char *from, const char *to);

/**
 * Move `fresh` to `path`, atomically if the file system supports it; the former content of `path`, if any, is at
 * `fresh` afterwards.
 *
 * @return 0, or a negative errno with both unchanged (not logged).
 */
SST_MUST_CHECK int sst_path_swap(const char *fresh, const char *path);

/** Flush standard output. @return 0, -EIO: some of it is lost; logged once, but not where its reader has gone */
SST_MUST_CHECK int sst_file_flush_output(void);

/**
 * From now on SIGINT and SIGTERM, and SIGHUP and SIGQUIT unless they are ignored, remove all uncommitted output and end the
 * process with status 128 + signal, by SIGQUIT with a core; threads with output that fails meanwhile wait for the end. Call
 * it once, before other threads start.
 *
 * @return 0, or a negative errno if its thread cannot be started; logged.
 */
SST_MUST_CHECK int sst_file_clean_on_interrupt(void);

/** An interrupt also removes this file or folder, which exists; until sst_file_keep_on_interrupt(). */
void sst_file_remove_on_interrupt(const char *path);
void sst_file_keep_on_interrupt(const char *path);

/** Delay an interrupt between these two calls: for renames of which either all or none must happen. No output may be
 *  opened, committed, aborted or fail in between. */
void sst_file_hold_interrupt(void);
void sst_file_allow_interrupt(void);

#endif
