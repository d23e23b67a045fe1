/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/recording/trim.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <jansson.h>

#include "base/log.h"
#include "capture/recording/recording_internal.h"

#define NAME        "removed.json"
#define FORMAT_NAME "sst-recording-removed"
#define BYTES_MAX   ((size_t)64 << 10)
#define BLOCK_BYTES 4096

/* --- removed.json ------------------------------------------------------------------------------------------------- */

/* @return 0 or -EBADMSG, not logged */
static int parse(const uint8_t *data, size_t size, struct sst_recording_removed *out)
{
    struct sst_recording_removed made = { 0 };
    json_t *root = json_loadb((const char *)data, size, JSON_REJECT_DUPLICATES, NULL);
    json_int_t sets, t_ns, wall_ns;
    const char *format;
    int version, err = -EBADMSG;

    if (root &&
        !json_unpack(root, "{s:s, s:i, s:i, s:I, s:I, s:I}", "format", &format, "version", &version, "before_segment",
                     &made.before_segment, "sets", &sets, "t_ns", &t_ns, "wall_ns", &wall_ns) &&
        !strcmp(format, FORMAT_NAME) && version == 1 && made.before_segment >= 0 && sets >= 0) {
        made.sets = (uint64_t)sets;
        made.t_ns = t_ns;
        made.wall_ns = wall_ns;
        *out = made;
        err = 0;
    }
    json_decref(root);
    return err;
}

/* --- segments ----------------------------------------------------------------------------------------------------- */

/* @param lowest  out, may be NULL; -1: none @return their number, or -errno */
static int count_segments(const char *dir, int *lowest)
{
    char folder[SST_PATH_MAX];
    const struct dirent *e;
    int least = -1, count = sst_path_join(folder, dir, "segments");
    DIR *d = count ? NULL : opendir(folder);

    if (!d)
        return count ? count : -errno;
    while ((e = readdir(d))) {
        int number, n = 0;

        if (sscanf(e->d_name, "%6d.mkv%n", &number, &n) != 1 || n != 10 || e->d_name[n] || number < 0)
            continue;
        least = least < 0 || number < least ? number : least;
        count++;
    }
    closedir(d);
    if (lowest)
        *lowest = least;
    return count;
}

int sst_recording_segments(const char *dir)
{
    const int count = count_segments(dir, NULL);

    return count < 0 ? 0 : count;
}

/* Find where the sets after a segment begin, and count the sets before. @return 0, -EBADMSG: there are none */
static int find_rest(FILE *list, int behind, struct sst_recording_removed *out)
{
    struct manifest_segment s = { 0 };
    uint64_t sets = 0;
    char *line = NULL;
    size_t capacity = 0;
    ssize_t n;
    int err = -EBADMSG;

    while (err && (n = getline(&line, &capacity, list)) > 0) {
        if (strncmp(line, "{\"segment\":", 11)) {
            sets++;
            continue;
        }
        if (line[n - 1] != '\n' || !manifest_line_whole(line, (size_t)n - 1) ||
            manifest_parse(line, (size_t)n - 1, 1, &s, NULL) || s.segment <= behind)
            continue;
        *out = (struct sst_recording_removed){
            .before_segment = s.segment, .sets = sets, .t_ns = s.start_ns, .wall_ns = s.wall_ns
        };
        err = 0;
    }
    if (err && ferror(list))
        err = -EIO;
    free(line);
    return err;
}

/* Find the sets after a segment in a recording's manifest. Not logged. */
static int rest_of(const char *dir, int behind, struct sst_recording_removed *out)
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, dir, "sets.jsonl");
    FILE *f = err ? NULL : fopen(path, "re");

    if (!err)
        err = f ? find_rest(f, behind, out) : -EIO;
    if (f)
        fclose(f);
    return err;
}

/* --- record of the removal ---------------------------------------------------------------------------------------- */

/* removed.json cannot be read: derive it from the first segment present. */
static void assume(const char *dir, const char *why, struct sst_recording_removed *out)
{
    struct sst_recording_removed made = { 0 };
    int lowest = 0;

    if (count_segments(dir, &lowest) <= 0 || lowest <= 0 || rest_of(dir, lowest - 1, &made))
        made = (struct sst_recording_removed){ 0 };
    made.assumed = true;
    if (made.before_segment)
        sst_log_warning("%s; assuming that everything before segment %06d, the first present, was removed to make "
                        "room: %llu sets",
                        why, made.before_segment, (unsigned long long)made.sets);
    else
        sst_log_warning("%s; assuming that nothing of the recording was removed", why);
    *out = made;
}

int sst_recording_read_removed(const char *dir, struct sst_recording_removed *out)
{
    char path[SST_PATH_MAX], why[SST_LOG_MAX] = "", *before;
    int err = sst_path_join(path, dir, NAME);
    uint8_t *data;
    size_t size;

    if (err || !sst_path_exists(path)) {
        if (!err)
            *out = (struct sst_recording_removed){ 0 };
        return err;
    }
    before = sst_log_hold_errors(why);
    err = sst_file_read(path, BYTES_MAX, &data, &size);
    sst_log_hold_errors(before);
    if (err == -EACCES || err == -ENOMEM) {
        sst_log_error("%s", why);
        return err;
    }
    if (!err) {
        err = parse(data, size, out);
        free(data);
        snprintf(why, sizeof(why), "%.900s is damaged", path);
    }
    if (err)
        assume(dir, why, out);
    return 0;
}

int sst_recording_write_removed(const char *dir, const struct sst_recording_removed *r)
{
    json_t *root = json_pack("{s:s, s:i, s:i, s:I, s:I, s:I}", "format", FORMAT_NAME, "version", 1, "before_segment",
                             r->before_segment, "sets", (json_int_t)r->sets, "t_ns", (json_int_t)r->t_ns, "wall_ns",
                             (json_int_t)r->wall_ns);
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, dir, NAME);

    err = err ? err : manifest_write_json(path, root);
    json_decref(root);
    return err;
}

/* --- making room -------------------------------------------------------------------------------------------------- */

int sst_recording_trim(const char *dir, int keep, struct sst_recording_removed *out, int64_t *bytes)
{
    struct sst_recording_removed made;
    char path[SST_PATH_MAX];
    struct stat st = { 0 };
    int lowest, err, count = count_segments(dir, &lowest);

    if (count < 0 || count <= keep)
        return count < 0 ? -EIO : -ENODATA;
    err = rest_of(dir, lowest, &made);
    if (err) {
        sst_log_error("cannot trim %s: its sets.jsonl names no set after segment %06d", dir, lowest);
        return err;
    }
    err = segment_path(path, dir, lowest);
    if (err)
        return err;
    (void)stat(path, &st);
    err = sst_recording_write_removed(dir, &made);
    if (err == -EDQUOT)
        err = -ENOSPC;
    if ((!err || err == -ENOSPC) && unlink(path) && errno != ENOENT) {
        sst_log_error("cannot remove %s: %s", path, strerror(errno));
        return errno == EROFS ? -EROFS : -EIO;
    }
    if (err == -ENOSPC)
        err = sst_recording_write_removed(dir, &made);
    if (!err) {
        *out = made;
        *bytes = (int64_t)(st.st_size + BLOCK_BYTES - 1) / BLOCK_BYTES * BLOCK_BYTES;
    }
    return err;
}
