/* Recorder of one set at a time: bytes to the segment, sync if due, line to the manifest. A failure in between is
 * rolled back, so that the manifest never names more than the segments hold. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/recording/recorder.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <zlib.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "capture/recording/recording_internal.h"

#define RETRY_NS 500000000 /* between attempts while writing fails */

struct sst_recorder {
    /* fixed after open */
    struct sst_recorder_config cfg;
    struct sst_recorder_track *tracks;
    char dir[SST_PATH_MAX], manifest[SST_PATH_MAX], folder[SST_PATH_MAX]; /* folder: of the segments */
    int lock_fd; /* of the folder, locked against other recorders */
    int session;
    struct sync *sync; /* NULL: every set is synced here */
    /* the caller's thread only */
    int manifest_fd; /* -1 after a failure: opened again */
    int64_t manifest_bytes;
    struct segment_file *segment; /* NULL: the next set begins one */
    int number;                   /* of the segment, or of the next */
    int64_t segment_start_ns;
    bool watched; /* the sync thread knows the segment */
    int failing;  /* negative errno while writing fails */
    int64_t retry_ns;
    uint64_t dropped_in_row;
    int64_t offset[SST_CAMERAS_MAX];
    uint32_t crc32[SST_CAMERAS_MAX];
    struct sst_mem_kept views; /* pictures of the set's views, packed */
    char line[2 * MANIFEST_LINE_MAX];
};

void sst_recorder_config_defaults(struct sst_recorder_config *cfg)
{
    *cfg = (struct sst_recorder_config){ .segment_s = 60, .segment_bytes = (int64_t)1 << 30, .sync_s = 1 };
}

/* --- open --------------------------------------------------------------------------------------------------------- */

static int check_config(const struct sst_recorder_config *cfg)
{
    char format[5];
    const char *fault = NULL;

    sst_recording_format_name(cfg->fourcc, format);
    if (!cfg->dir || !cfg->dir[0] || !cfg->tracks)
        fault = "no folder or no cameras given";
    else if (cfg->rows < 1 || cfg->cols < 1 || cfg->rows > SST_CAMERAS_MAX || cfg->cols > SST_CAMERAS_MAX ||
             cfg->cameras < 1 || cfg->cameras > SST_CAMERAS_MAX || cfg->cameras > cfg->rows * cfg->cols)
        fault = "the grid does not hold the cameras";
    else if (cfg->width < 1 || cfg->height < 1 || cfg->width > 32768 || cfg->height > 32768)
        fault = "the size is outside 1x1 to 32768x32768";
    else if (!(cfg->rate_hz >= 0) || !isfinite(cfg->rate_hz) || !(cfg->spacing_mm >= 0) || !isfinite(cfg->spacing_mm))
        fault = "rate or spacing is below 0";
    else if (!(cfg->segment_s >= 0 && cfg->segment_s <= 86400) || cfg->segment_bytes < 0 ||
             !(cfg->sync_s >= 0 && cfg->sync_s <= 86400))
        fault = "segments or syncs are longer than a day, or below 0";
    for (int k = 0; !fault && k < cfg->cameras; k++) {
        if (cfg->tracks[k].row < 0 || cfg->tracks[k].row >= cfg->rows || cfg->tracks[k].col < 0 ||
            cfg->tracks[k].col >= cfg->cols)
            fault = "a camera is outside the grid";
        for (int i = 0; i < k; i++) {
            if (cfg->tracks[i].row == cfg->tracks[k].row && cfg->tracks[i].col == cfg->tracks[k].col)
                fault = "two cameras have the same row and col";
        }
    }
    if (!fault && !sst_recording_format_known(cfg->fourcc)) {
        sst_log_error("frames of format %s cannot be recorded; set MJPG, YUYV, GREY, Y16, RGB24 or 8-bit Bayer", format);
        return -EINVAL;
    }
    if (fault)
        sst_log_error("cannot record: %s", fault);
    return fault ? -EINVAL : 0;
}

/* Two recorders in one folder would truncate each other's sets. */
static int lock_folder(struct sst_recorder *r)
{
    int err;

    r->lock_fd = open(r->dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (r->lock_fd >= 0 && !flock(r->lock_fd, LOCK_EX | LOCK_NB))
        return 0;
    err = errno;
    if (r->lock_fd >= 0 && err != EWOULDBLOCK)
        return 0; /* a file system without locks */
    if (err == EWOULDBLOCK)
        sst_log_error("another process records into %s; stop it or name another folder", r->dir);
    else
        sst_log_error("cannot open the folder %s: %s", r->dir, strerror(err));
    return err == EWOULDBLOCK ? -EBUSY : -EIO;
}

static int open_manifest(struct sst_recorder *r, int flags)
{
    struct stat st;
    int err = 0;

    r->manifest_fd = open(r->manifest, O_RDWR | O_CLOEXEC | flags, 0666);
    if (r->manifest_fd < 0)
        return -errno;
    if (fstat(r->manifest_fd, &st))
        err = -errno;
    else if (st.st_size < r->manifest_bytes)
        err = -EIO; /* not the file that was written */
    else if (ftruncate(r->manifest_fd, r->manifest_bytes))
        err = -errno;
    if (err) {
        close(r->manifest_fd);
        r->manifest_fd = -1;
    }
    return err;
}

static int code_of(int err)
{
    switch (-err) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
        return -ENOSPC;
    case EROFS:
    case ENOMEM:
    case EINVAL:
    case ENOTSUP:
        return err;
    default:
        return -EIO;
    }
}

/* Begin a new recording, or find where to resume. */
static int open_files(struct sst_recorder *r)
{
    char info[SST_PATH_MAX];
    struct resume_point from;
    bool there;
    int err = sst_path_join(info, r->dir, "recording.json");

    if (err)
        return err;
    there = sst_path_exists(info);
    if (there ? !r->cfg.append : sst_path_exists(r->manifest)) {
        sst_log_error("%s already holds %s; name another folder%s", r->dir, there ? "a recording" : "sets.jsonl",
                      there ? " or append to it" : "");
        return -EEXIST;
    }
    if (!there)
        err = manifest_write_info(info, &r->cfg);
    if (err)
        return err;
    r->manifest_fd = open(r->manifest, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (r->manifest_fd < 0) {
        err = -errno;
        sst_log_error("cannot create %s: %s", r->manifest, strerror(-err));
        return code_of(err);
    }
    if (!there)
        return 0;
    err = resume_prepare(&from, &r->cfg, r->manifest_fd);
    if (err)
        return err;
    r->manifest_bytes = from.manifest_bytes;
    r->number = from.segment;
    r->session = from.session;
    return 0;
}

/* Sync the recording's folder, which names manifest and segments, and the one above, which names the recording. */
static int sync_names(const struct sst_recorder *r)
{
    char above[SST_PATH_MAX];
    int err = sync_folder(r->dir);

    if (!err && !sst_path_join(above, r->dir, ".."))
        err = sync_folder(above);
    if (err == -EACCES) /* the folder above may not be readable */
        err = 0;
    if (err)
        sst_log_error("cannot sync the folder %s: %s", r->dir, strerror(-err));
    return err ? code_of(err) : 0;
}

static int copy_config(struct sst_recorder *r, const struct sst_recorder_config *cfg)
{
    const size_t bytes = (size_t)cfg->cameras * sizeof(*r->tracks);
    struct sst_recorder_config defaults;
    int err = sst_path_join(r->dir, cfg->dir, NULL);

    err = err ? err : sst_path_join(r->manifest, cfg->dir, "sets.jsonl");
    err = err ? err : sst_path_join(r->folder, cfg->dir, "segments");
    if (err)
        return err;
    r->tracks = malloc(bytes);
    if (!r->tracks)
        return -ENOMEM;
    memcpy(r->tracks, cfg->tracks, bytes);
    sst_recorder_config_defaults(&defaults);
    r->cfg = *cfg;
    r->cfg.dir = r->dir;
    r->cfg.tracks = r->tracks;
    if (r->cfg.segment_s == 0)
        r->cfg.segment_s = defaults.segment_s;
    if (!r->cfg.segment_bytes)
        r->cfg.segment_bytes = defaults.segment_bytes;
    return 0;
}

int sst_recorder_open(struct sst_recorder **out, const struct sst_recorder_config *cfg)
{
    struct sst_recorder *r;
    int err = check_config(cfg);

    err = err ? err : segment_possible();
    if (err)
        return err;
    r = calloc(1, sizeof(*r));
    if (!r)
        return -ENOMEM;
    r->lock_fd = r->manifest_fd = -1;
    err = copy_config(r, cfg);
    err = err ? err : sst_path_make_dir(r->dir);
    err = err ? err : lock_folder(r);
    err = err ? err : open_files(r);
    err = err ? err : sst_path_make_dir(r->folder);
    err = err ? err : sync_names(r);
    if (!err && r->cfg.sync_s > 0)
        err = sync_start(&r->sync, r->folder, r->cfg.sync_s);
    if (err) {
        (void)sst_recorder_close(r); /* no set was written: nothing can be lost */
        return err;
    }
    *out = r;
    return 0;
}

/* --- segments ----------------------------------------------------------------------------------------------------- */

/* Time zero of a segment: no frame of its first set is before it. */
static int64_t earliest(const struct sst_frameset *set)
{
    int64_t t = set->t_ns;

    for (int k = 0; k < set->cameras; k++) {
        const struct sst_frame *f = set->frame[k];

        if (f && f->t_ns < t && f->t_ns >= set->t_ns - STAMP_SLACK_NS)
            t = f->t_ns;
    }
    return t;
}

static int finish_segment(struct sst_recorder *r)
{
    int err = 0;

    if (!r->segment)
        return 0;
    err = segment_finish(r->segment, !r->sync);
    if (err)
        sst_log_warning("cannot finish segment %06d of %s: %s; its sets are complete, but it has no index for seeking",
                        r->number, r->dir, strerror(-err));
    r->segment = NULL;
    r->number++;
    return err;
}

static bool segment_is_full(struct sst_recorder *r, const struct sst_frameset *set)
{
    if ((double)(set->t_ns - r->segment_start_ns) * 1e-9 < r->cfg.segment_s && r->segment->end < r->cfg.segment_bytes)
        return false;
    return !r->sync || sync_has_room(r->sync); /* else the disk is far behind: the segment continues */
}

static int begin_segment(struct sst_recorder *r, const struct sst_frameset *set)
{
    char path[SST_PATH_MAX];
    int err;

    r->segment_start_ns = earliest(set);
    r->watched = false;
    /* A file of the number could not be removed when the disk failed. */
    for (;; r->number++) {
        err = r->number > SEGMENT_NUMBER_MAX ? -ENOSPC : segment_path(path, r->dir, r->number);
        err = err ? err : segment_open(&r->segment, path, &r->cfg, r->segment_start_ns);
        if (err != -EEXIST)
            return err;
    }
}

/* --- sets --------------------------------------------------------------------------------------------------------- */

static int check_set(const struct sst_recorder *r, const struct sst_frameset *set)
{
    const char *fault = NULL;

    if (set->cameras != r->cfg.cameras)
        fault = "it has another number of cameras";
    for (int k = 0; !fault && k < set->cameras; k++) {
        const struct sst_frame *f = set->frame[k];

        if (!f)
            continue;
        if (f->cam != k)
            fault = "a frame is in another camera's place";
        else if (f->fourcc != r->cfg.fourcc)
            fault = "a frame has another format";
        else if (f->bytes > SST_SEGMENT_FRAME_MAX || f->stride > INT32_MAX)
            fault = "a frame is larger than 1 GiB";
    }
    if (fault)
        sst_log_error("cannot record set %llu: %s", (unsigned long long)set->index, fault);
    return fault ? -EINVAL : 0;
}

static int sync_here(int fd)
{
    return fdatasync(fd) ? -errno : 0;
}

static int add_set(struct sst_recorder *r, const struct sst_frameset *set)
{
    size_t n = 0;
    int err = r->manifest_fd < 0 ? open_manifest(r, 0) : 0;

    if (!err && !r->segment)
        err = begin_segment(r, set);
    err = err ? err : segment_add(r->segment, set, r->offset);
    if (!err && !r->sync)
        err = sync_here(r->segment->fd);
    if (!err && !r->sync && !r->watched)
        err = sync_folder(r->folder);
    if (err)
        return err;
    for (int k = 0; k < set->cameras; k++)
        r->crc32[k] = set->frame[k] ? (uint32_t)crc32_z(0, set->frame[k]->data, set->frame[k]->bytes) : 0;
    if (!r->watched)
        n = manifest_segment_line(r->line, r->number, r->session, r->segment_start_ns, set->wall_ns);
    n += manifest_set_line(r->line + n, set, r->offset, r->crc32);
    err = sst_file_write_at(r->manifest_fd, r->line, n, r->manifest_bytes);
    if (!err && !r->sync)
        err = sync_here(r->manifest_fd);
    if (!err && r->sync && !r->watched)
        err = sync_watch(r->sync, r->segment->fd, r->manifest_fd);
    if (err)
        return err;
    r->manifest_bytes += (int64_t)n;
    r->segment->kept = r->segment->end;
    r->watched = true;
    return 0;
}

/* Remove the written part of the set. The segment ends here: after a failed write or sync its state on disk is
 * unknown. */
static void roll_back(struct sst_recorder *r)
{
    if (r->manifest_fd >= 0) {
        if (ftruncate(r->manifest_fd, r->manifest_bytes))
            sst_log_debug("%s: %s; it is cut when it is opened again", r->manifest, strerror(errno));
        close(r->manifest_fd);
        r->manifest_fd = -1;
    }
    if (r->segment) {
        const bool kept = r->watched;

        segment_abandon(r->segment);
        r->segment = NULL;
        r->number += kept;
    }
}

static void report_failure(struct sst_recorder *r, int err)
{
    const int code = code_of(err);
    const char *remedy = code == -ENOSPC ? "free space there" : code == -EROFS ? "make it writable" : "check the disk";

    if (code != r->failing)
        sst_log_error("recording into %s has stopped: %s; %s; it then resumes by itself", r->dir, strerror(-err),
                      remedy);
    r->retry_ns = r->failing ? sst_clock_now_ns() + RETRY_NS : 0; /* a new segment may succeed at once */
    r->failing = code;
}

static void report_recovery(struct sst_recorder *r)
{
    if (r->failing)
        sst_log_warning("recording into %s resumed with segment %06d; %llu sets were lost", r->dir, r->number,
                        (unsigned long long)r->dropped_in_row);
    r->failing = 0;
    r->dropped_in_row = 0;
}

static int drop(struct sst_recorder *r)
{
    r->dropped_in_row++;
    return r->failing;
}

/* The set with the pictures of views on their own. @return it, or `set` where it has none; NULL: no memory */
static const struct sst_frameset *pack_views(struct sst_recorder *r, const struct sst_frameset *set)
{
    size_t bytes = 0;
    uint8_t *at;
    int n = 0;

    for (int k = 0; k < set->cameras; k++)
        bytes += set->frame[k] && set->frame[k]->row_bytes ? sst_frame_packed_bytes(set->frame[k]) : 0;
    if (!bytes)
        return set;
    at = sst_mem_keep(&r->views, sizeof(*set) + sizeof(struct sst_frame) * (size_t)set->cameras + bytes, 1);
    if (!at)
        return NULL;
    struct sst_frameset *packed = (void *)at;
    struct sst_frame *frame = (void *)(packed + 1);

    *packed = *set;
    at = (uint8_t *)(frame + set->cameras);
    for (int k = 0; k < set->cameras; k++)
        if (set->frame[k] && set->frame[k]->row_bytes) {
            at += sst_frame_pack(&frame[n], at, set->frame[k]);
            packed->frame[k] = &frame[n++];
        }
    return packed;
}

int sst_recorder_write(struct sst_recorder *r, const struct sst_frameset *set)
{
    int err = check_set(r, set);

    if (err)
        return err;
    set = pack_views(r, set);
    if (!set) {
        sst_log_error("no memory to record set with the pictures of %d cameras", r->cfg.cameras);
        return -ENOMEM;
    }
    if (r->failing && sst_clock_now_ns() < r->retry_ns)
        return drop(r);
    if (r->sync && sync_fetch_error(r->sync))
        roll_back(r); /* reported by the thread; a new segment from here on */
    if (r->segment && segment_is_full(r, set))
        (void)finish_segment(r); /* reported; the next segment shows whether the disk accepts writes */
    err = add_set(r, set);
    if (err) {
        roll_back(r);
        report_failure(r, err);
        return drop(r);
    }
    report_recovery(r);
    return 0;
}

void sst_recorder_set_segment_bytes(struct sst_recorder *r, int64_t bytes)
{
    struct sst_recorder_config defaults;

    sst_recorder_config_defaults(&defaults);
    r->cfg.segment_bytes = bytes > 0 ? bytes : defaults.segment_bytes;
}

int sst_recorder_close(struct sst_recorder *r)
{
    int err, sync_err;

    if (!r)
        return 0;
    err = finish_segment(r);
    sync_err = sync_stop(r->sync);
    if (r->manifest_fd >= 0)
        close(r->manifest_fd);
    if (r->lock_fd >= 0)
        close(r->lock_fd);
    sst_mem_kept_fini(&r->views);
    free(r->tracks);
    free(r);
    return err ? code_of(err) : sync_err ? code_of(sync_err) : 0;
}
