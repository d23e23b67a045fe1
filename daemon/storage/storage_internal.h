/* daemon/storage/storage_internal.h - what the files of this folder share; code outside of it includes the public
 * headers. */
#ifndef SST_DAEMON_STORAGE_STORAGE_INTERNAL_H
#define SST_DAEMON_STORAGE_STORAGE_INTERNAL_H

#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>

#include "base/base.h"
#include "base/file.h"
#include "config/sstd.h"
#include "daemon/slot/jpeg_slot.h"
#include "daemon/storage/storage.h"

/* --- catalog ---
 * what is in the folder: recordings, snapshots, exports; in memory and as files that say so.
 *
 * A recording of ours has storage.json beside its sets, written before the first set and again at the end; folders
 * without one are somebody else's and are neither counted nor touched. Snapshots and exports have one, too; those
 * without (a daemon was killed in between) are known by lightfield.json and count as the oldest. */

#define SST_STORE_NAME 64 /* bytes of a name with its end */
#define SST_STORE_WHY  112

enum store_kind {
    SST_STORE_RECORDING = 0,
    SST_STORE_SNAPSHOT = 1,
    SST_STORE_EXPORT = 2,
    SST_STORE_KINDS = 3,
};

enum store_stage {
    SST_STORE_DONE = 0,
    SST_STORE_ACTIVE = 1, /* being written here, or being made */
    SST_STORE_TORN = 2,   /* its daemon was killed: to be mended */
    SST_STORE_KEPT = 3,   /* cannot be mended or another process records there: left as it is */
};

struct store_entry {
    enum store_kind kind;
    enum store_stage stage;
    char name[SST_STORE_NAME];
    char why[SST_STORE_WHY]; /* of a recording */
    uint64_t order;          /* grows with each that is made, whatever clocks say; 0: not known */
    int64_t from_ns, to_ns;  /* wall time of first and last set; 0: none */
    int64_t made_ns;         /* wall time when it was finished; 0: not known */
    uint64_t sets;
    uint64_t gone; /* of a recording: sets removed of its beginning, no longer among `sets`; UINT64_MAX: not known */
    int64_t bytes; /* on disk */
    bool picture;  /* of a snapshot: picture.jpg is there; of a recording: the see-through view was recorded */
    bool doomed;   /* somebody deleted it: it is no longer there for anybody else */
    int readers;   /* downloads of it at work */
    int segments;  /* of a recording that is being written, as last looked at; else 0 */
};

/** In their order; those of the same order by made_ns. Zeroed: empty. One thread at a time. */
struct catalog {
    struct store_entry *entry;
    int count, capacity;
    uint64_t order; /* the highest given so far */
};

/** A copy is put in. @return 0, -ENOMEM */
SST_MUST_CHECK int catalog_add(struct catalog *c, const struct store_entry *entry);
void catalog_remove(struct catalog *c, const char *name);
/** What is known of it anew, under its name; who reads it and whether it was deleted stays. Not there: nothing. */
void catalog_update(struct catalog *c, const struct store_entry *entry);
/** NULL: not there. Valid until something is added or removed. */
struct store_entry *catalog_find(struct catalog *c, const char *name);
void catalog_fini(struct catalog *c);

/** [A-Za-z0-9_-][A-Za-z0-9_.-]{0,62}: a name that was made here. */
bool store_name_good(const char *name);

#define SST_STORE_SEGMENTS 2 /* the last ones of a recording that is being written always stay */

#define SST_STORE_ON_DEMAND "on demand" /* why of a recording that somebody asked for */

/** Snapshots, exports, recordings on demand: they outlive what is recorded without anybody. */
bool store_by_hand(const struct store_entry *entry);

/** "recording", "snapshot", "export". */
const char *store_kind_name(enum store_kind kind);

/** "", "snapshot-", "export-": what names of the kind begin with. */
const char *store_prefix(enum store_kind kind);

/** "2026-11-21T18-05-00Z" of a wall time after the kind's prefix, and "-2", "-3" ... as `attempt` grows from 1. */
void store_name(char out[SST_STORE_NAME], enum store_kind kind, int64_t wall_ns, int attempt);

/* --- on disk; these wait for it ----------------------------------------------------------------------------------- */

/** Write storage.json, whole. @param dir  of the entry @return 0 or an error of the output; logged */
SST_MUST_CHECK int store_write(const char *dir, const struct store_entry *entry);

/** Read storage.json: order, why, from, to, made, sets, gone, bytes, and DONE or TORN as stage. @return 0, -ENOENT (not
 *  ours), -EBADMSG, -EIO. Not logged. */
SST_MUST_CHECK int store_read(const char *dir, struct store_entry *entry);

/**
 * What a folder of recordings, snapshots or exports holds, left-overs of a killed daemon (*.tmp-*, empty folders with
 * names of ours) removed first.
 *
 * @param tidy  remove those
 * @param c     out, zeroed by the caller
 * @return 0, -ENOMEM or -errno of reading the folder; not logged
 */
SST_MUST_CHECK int store_scan(const char *folder, enum store_kind kind, bool tidy, struct catalog *c);

/** Bytes of all files below a folder, in whole blocks of 4 KiB. */
int64_t store_bytes(const char *dir);

/** Bring a torn recording into a state that says what it holds, and write its storage.json.
 *  @return 0, -ENODATA (it has no set), -EBUSY (another process records there), -EBADMSG, -EIO ...; logged */
SST_MUST_CHECK int store_mend(const char *dir, struct store_entry *entry);

/* --- which goes next ---------------------------------------------------------------------------------------------- */

struct store_limits {
    int64_t quota_bytes, min_free_bytes; /* 0: none */
    int64_t max_age_ns, hand_max_age_ns; /* of what was recorded by itself and made by hand; 0: none */
    int64_t hand_bytes;                  /* up to this what was made by hand outlives the rest; 0: half of the room */
    int64_t margin_bytes; /* kept free of what quota and free space allow, for what is written meanwhile */
};

struct store_room {
    int64_t used_bytes, free_bytes;
    int64_t waiting_bytes; /* of a set that waits for the quota to have room for it; 0: none does */
    int64_t wall_ns;
    bool clock_steady; /* the wall clock has not been stepped for a while: ages count */
};

enum store_verdict {
    SST_STORE_FITS = 0,
    SST_STORE_TOO_OLD = 1,
    SST_STORE_TOO_MUCH = 2, /* for the quota or the free space */
    SST_STORE_NO_ROOM = 3,  /* likewise, and nothing is left to remove */
};

/** The room there is in all: the smaller of what quota and free space allow. */
int64_t store_room_bytes(const struct store_limits *limits, const struct store_room *room);

/** What of it what was made by hand may take before the rest is spared. */
int64_t store_hand_bytes(const struct store_limits *limits, const struct store_room *room);

/**
 * What is to be removed first. Beyond a limit that is the oldest that was recorded by itself; the oldest that was made
 * by hand, if that takes more than its part or nothing else is left. What is being downloaded goes after what is not,
 * and a recording that is being written last: of that, the oldest segment.
 * The newest by itself and the newest by hand never go by their age. What bears a time that cannot be (before 2026, in
 * the future, or an hour before something was begun that is older by its order) is as old as what was made next.
 * @param victim  out, index of it with TOO_OLD and TOO_MUCH
 */
enum store_verdict store_judge(const struct catalog *c, const struct store_limits *limits,
                               const struct store_room *room, int *victim);

/* --- spans ---
 * a file that is a plan: bytes of its own and pieces of files, one after the other.
 *
 * What is downloaded (archives, videos) is never made as a file: its plan is, so that its length is known beforehand
 * and any part of it can be sent. */

struct file_span {
    int64_t at;     /* first byte in the whole */
    int64_t offset; /* of it in the file, or in `own` */
    int file;       /* -1: of `own` */
};

/** Zeroed: empty. Growing fails silently and for good: spans_error() tells. One thread while it is made; then any
 *  number may send. */
struct spans {
    struct file_span *span;
    size_t count, capacity;
    uint8_t *own;
    size_t own_bytes, own_capacity;
    char **path; /* of files, below the folder that is given to send */
    int files, files_capacity;
    int64_t bytes; /* of the whole */
    uint64_t tag;  /* of all that was planned, also spans_mark(): another content has another one */
    bool failed;
};

void spans_fini(struct spans *s);

/** Bytes of its own, copied. */
void spans_own(struct spans *s, const void *data, size_t n);
/** Another file from which pieces are taken. @param path  copied @return its number */
int spans_file(struct spans *s, const char *path);
/** n bytes of a file from an offset. */
void spans_piece(struct spans *s, int file, int64_t offset, int64_t n);
/** What else tells one content from another (times, sizes). */
void spans_mark(struct spans *s, const void *data, size_t n);

/** @return 0, -ENOMEM: something of it is missing */
SST_MUST_CHECK int spans_error(const struct spans *s);

/** Open a file below a folder for reading, as sending does: no link on the way is followed, and nothing is waited for
 *  that is no file. @return descriptor or negative errno */
SST_MUST_CHECK int spans_open(int folder, const char *path);

/** Takes all n bytes. @return 0, or a negative errno that ends the sending. */
typedef int spans_fn(void *arg, const void *data, size_t n);

/**
 * Hand on n bytes from `first` on.
 *
 * @param folder  of the files; links below it are not followed
 * @param first   first + n is at most s->bytes
 * @return 0, what fn returned, -EBADMSG (a file is shorter than planned), -ENOENT (it is gone), -ENOMEM or -errno of
 *         reading; not logged. Waits for the disk.
 */
SST_MUST_CHECK int spans_send(const struct spans *s, int folder, int64_t first, int64_t n, spans_fn *fn, void *arg);

/* --- matroska: the plan of a Matroska file with one track, of frames that lie in other files. --- */

#define SST_MATROSKA_TRACK_MAX 4096 /* bytes of a track's description */

struct matroska_frame {
    int64_t t_ns;   /* any clock; not before the frame's before it */
    int64_t offset; /* first byte in its file */
    uint32_t bytes;
    int file; /* of the plan */
};

struct matroska_track {
    int number;                            /* 1 .. 16382 */
    uint8_t entry[SST_MATROSKA_TRACK_MAX]; /* the element TrackEntry, whole, of this number */
    size_t bytes;
};

/** Describe a track of JPEG pictures. @param name  for people */
void matroska_jpeg_track(struct matroska_track *out, int width, int height, const char *name);

/**
 * Copy the description of a track out of the first bytes of a Matroska file.
 * @return 0, -ENOENT (no such track), -EBADMSG (no Matroska, torn, or a description that is too long); not logged
 */
SST_MUST_CHECK int matroska_find_track(const uint8_t *data, size_t n, int number, struct matroska_track *out);

/**
 * Plan the file: head with duration and an index to seek by, then the frames, a cluster a second. The same arguments
 * give the same bytes.
 *
 * @param to       their files were added before
 * @param wall_ns  of the first frame
 * @return 0, -ENODATA (count is 0), -ENOMEM
 */
SST_MUST_CHECK int matroska_plan(struct spans *to, const struct matroska_track *track, const char *title,
                                 int64_t wall_ns, const struct matroska_frame *frame, size_t count);

/* --- triggers: when something is seen for long enough to be told and recorded. No input or output. --- */

/* Something is seen when its share is reached, and still seen down to half of that. What is seen begins when that was
 * so for begin_s, and ends when it was not for end_s, in two sets at least; sets that say otherwise meanwhile take as
 * much time off again, and one odd set never changes anything. */
#define SST_WATCH_BEGIN_S 0.3
#define SST_WATCH_END_S   1.0
#define SST_WATCH_KEEPS   0.5
#define SST_WATCH_SHARE   0.02 /* of zones that no trigger names */
/* Changes that come again and again are told as one: each that begins within the first of these after the last one was
 * told to have ended doubles how long nothing must be seen for that, up to the second. Labels are told each time. */
#define SST_WATCH_AGAIN_NS 10000000000
#define SST_WATCH_HOLD_NS  60000000000
#define SST_WATCHES_MAX    (SST_TRIGGERS_MAX + SST_ZONES_MAX)

/** Something looked for: a change or a label, in a zone or in the whole picture. */
struct sst_watch {
    char zone[32], label[64]; /* "": the whole picture; any change */
    int trigger;              /* of the configuration: recording follows it; -1: it is only told */
    int index;                /* of the zone in what was seen; -1: the whole picture */
    double share;
    double begin_s, end_s; /* above 0; else those above */
    /* what is seen: recordings follow it */
    bool active;
    int sets;          /* in a row that speak for the other state, but for odd ones */
    int64_t t_ns;      /* set.t_ns of the last set */
    int64_t since_ns;  /* of the first set for the other state */
    int64_t weight_ns; /* time that speaks for it */
    int64_t begin_ns;  /* first set of the active state */
    int64_t last_ns;   /* last set that reached what keeps it */
    /* what is told of it */
    bool told;
    int64_t told_ns; /* begin_ns when it was told to have begun; when to have ended */
    int64_t hold_ns; /* nothing is seen for so long before it is told to have ended */
    int times;       /* it became active since it was told to have begun */
    bool was_active; /* at the last look */
    double peak;     /* largest share since then */
};

struct watches {
    int count;
    struct sst_watch watch[SST_WATCHES_MAX];
};

/** The configuration's triggers, and changes in every zone that none of them names. Nothing is active. */
void watches_init(struct watches *w, const struct sst_config *config);

/** A value in a set; NaN counts as 0. @return true: active changed */
bool watch_update(struct sst_watch *w, double value, int64_t t_ns);

/** After an update: is it to be told to have begun or ended (w->told)?  @return true: that changed */
bool watch_tell(struct sst_watch *w, double value, int64_t t_ns);

/** How something stands goes on under other settings. */
void watch_go_on(struct sst_watch *w, const struct sst_watch *before);

/* --- view ---
 * the see-through view beside the sets of a recording. Inside daemon/storage only.
 *
 * Its pictures come from the outlet of the main view, as JPEG: the thread sst-view keeps those of the last moments in
 * memory (pre-roll), and the recording thread writes them. */

#define SST_VIEW_SHOWN_MAX   4096
#define SST_VIEW_SHOWN_BYTES ((size_t)64 << 20)

/** Pictures of the last moments; the oldest goes first. Under the storage's lock. Zeroed: none. */
struct view_shown {
    const struct sst_jpeg *jpeg[SST_VIEW_SHOWN_MAX]; /* from `first` on, round about */
    int first, count;
    size_t bytes;
};

/** Take a reference over; those before keep_ns go, but for one: what was seen then. */
void view_shown_add(struct view_shown *s, const struct sst_jpeg *jpeg, int64_t keep_ns);
/** The first with a number above `after`, referenced; NULL: none. */
const struct sst_jpeg *view_shown_next(struct view_shown *s, uint64_t after);
/** The last that is not after t_ns, referenced; NULL: none. */
const struct sst_jpeg *view_shown_at(struct view_shown *s, int64_t t_ns);
void view_shown_fini(struct view_shown *s);

/** The files of a recording; zeroed: none. One thread. */
struct view_files {
    int fd;                                 /* pictures; 0: none */
    FILE *index;                            /* NULL: none */
    int64_t at;                             /* end of the pictures */
    int64_t last_t_ns, last_at, last_bytes; /* of the last line */
    uint64_t last_set;
};

/** Make them in a recording's folder. @return 0 or -errno; logged. Waits for the disk. */
SST_MUST_CHECK int view_begin(struct view_files *f, const char *dir);
/** @param t_ns  when it is to be shown: its own time, or the recording's beginning @return 0 or -errno; not logged */
SST_MUST_CHECK int view_write(struct view_files *f, const struct sst_jpeg *jpeg, int64_t t_ns);
/** Close them; the last picture is shown until end_ns. @return 0 or the error that it met; not logged */
int view_end(struct view_files *f, int64_t end_ns, int64_t end_wall_ns);

/* --- parts ---
 * what the threads of storage share. Inside daemon/storage only.
 *
 * sst-record  writes sets (record.c)                waits for the disk
 * sst-keep    free space, limits, mending (keep.c)  waits for the disk
 * sst-export  snapshots and exports (jobs.c)        waits for the disk
 * sst-tar     downloads (download.c), one each      waits for the disk and for readers
 * sst-view    pictures of the last moments (view.c) never waits for a disk
 * sst-state   says how things stand (state.c)       never waits for either
 * Calls from outside only look at memory; the lock is never held while anything is waited for. */

#define SST_STORE_TEXT      512
#define SST_STORE_JOBS      4          /* that wait or run */
#define SST_STORE_PLANS     4          /* of videos, kept for the next part that is asked for */
#define SST_STORE_ANSWER_MS 800        /* that a call waits for a thread */
#define SST_STORE_GRACE_NS  100000000  /* and longer, where the machine may have stood still */
#define SST_STORE_HUNG_NS   5000000000 /* a disk that has been waited for longer hangs */

/** What the threads take from the configuration. */
struct store_settings {
    enum sst_record_mode mode;
    bool view; /* the see-through view is recorded, too */
    struct store_limits limits;
    double segment_s, sync_s;
    int64_t preroll_ns, postroll_ns;
    double rate_hz, spacing_mm;
    int rows, cols, cameras;
    uint32_t fourcc;
    int width, height;
    unsigned opening; /* of the array: a recording is of one; 0: it was never open */
    char calibration[SST_CONFIG_TEXT_MAX];
    double plane_mm;
};

/** Sets that somebody wants recorded, by their time. */
struct store_want {
    bool armed; /* until a set behind the end has come */
    int64_t begin_ns, end_ns;
    char why[SST_STORE_WHY], zone[32], label[64];
};

/** What keeps sets from the disk. */
enum store_trouble {
    SST_TROUBLE_NONE = 0,
    SST_TROUBLE_LIMIT_LOW = 1, /* LOW; from here on FULL */
    SST_TROUBLE_LIMIT = 2,
    SST_TROUBLE_HUNG = 3,
    SST_TROUBLE_WRITE = 4,
    SST_TROUBLE_FOLDER = 5,
};

struct store_job;  /* jobs.c */
struct store_plan; /* download.c */

struct sst_storage {
    /* fixed after open */
    struct sst_ring *ring;
    struct sst_events *events;
    char dir[SST_PATH_MAX], folder[SST_STORE_KINDS][SST_PATH_MAX];

    pthread_mutex_t lock;
    pthread_cond_t wake;     /* something is to be done */
    pthread_cond_t answered; /* something was done */
    /* under lock */
    bool stop;
    int64_t stop_ns; /* what the ring holds is written until then */
    int threads;     /* that run, downloads among them */
    int downloads;
    struct store_settings settings;
    struct sst_recorder_track *tracks; /* [SST_CAMERAS_MAX], of settings.cameras */
    struct catalog catalog;

    /* what is wanted */
    struct watches watches;
    struct store_want event, demand;
    bool wanted;            /* sets are to be recorded now */
    int64_t seen_ns;        /* clock, at the last look; 0: none */
    uint64_t asked, answer; /* requests to record; the last one answered ... */
    int answer_err;         /* ... like this */

    /* the recording that is being written */
    char take[SST_STORE_NAME], take_why[SST_STORE_WHY]; /* "": none */
    uint64_t take_sets, dropped;                        /* dropped: since open */
    bool take_lost;                                     /* its folder is no longer there */
    int64_t waiting_bytes;                              /* of a set that the quota has no room for just now; 0: none */
    int64_t part_bytes; /* the largest piece that is removed at once, a tenth of the room; 0: not yet known */

    /* how things stand */
    bool ready;                /* the folder is there, ours alone, and has been read */
    bool blocked;              /* nothing may be written */
    int folder_err, write_err; /* negative errno */
    enum store_trouble limit;  /* NONE, LIMIT_LOW, LIMIT */
    char folder_text[SST_STORE_TEXT], write_text[SST_STORE_TEXT], limit_text[SST_STORE_TEXT];
    int64_t free_bytes, used_bytes, checked_ns; /* checked: clock; 0: never */
    int64_t hand_bytes;                         /* that what is made by hand may take before the rest is spared */
    uint64_t removed[SST_STORE_KINDS], deleted; /* because of the limits; by hand */
    uint64_t shortened;                         /* segments of recordings whose rest stays, because of the limits */
    int64_t record_busy_ns, keep_busy_ns;       /* clock, since when the thread waits for the disk; 0: it does not */
    enum sst_storage_state state;
    enum store_trouble trouble;
    char reason[SST_STORE_TEXT];

    struct store_job *job[SST_STORE_JOBS]; /* in their order; the first is at work */
    int jobs;

    struct store_plan *plan[SST_STORE_PLANS]; /* download.c; NULL: none */

    struct sst_outlet *outlet; /* of the main view; NULL: not yet */
    struct view_shown shown;

    pthread_t thread[5];
};

void *store_record_run(void *storage);
void *store_keep_run(void *storage);
void *store_jobs_run(void *storage);
void *store_state_run(void *storage);
void *store_view_run(void *storage);

/** The lock is held; waits for `wake` or `ms`, whichever comes first. */
void store_wait_locked(struct sst_storage *s, int ms);
/** The same for `answered`, for whom to wait again if nothing has come. @return false: it is `until_ns`, and a bit */
bool store_wait_answer_locked(struct sst_storage *s, int64_t until_ns);
/** The calling thread ends. */
void store_thread_ends(struct sst_storage *s);
/** From here, or no longer, the thread waits for the disk. */
void store_busy(struct sst_storage *s, int64_t *since_ns, bool busy);

/** What a call that needs the disk is to return now: 0, -ENOSPC, -EROFS, -EBUSY, -EIO. */
int store_refusal_locked(const struct sst_storage *s);

/** A name for a new entry, which is ACTIVE in the catalog from then on. @param attempt  from 1 @return 0, -EEXIST
 * (another attempt may do), -ENOMEM */
SST_MUST_CHECK int store_reserve(struct sst_storage *s, enum store_kind kind, int64_t wall_ns, int attempt,
                                 const char *why, struct store_entry *out);
/** Out of the folder and the catalog, because of the limits. sst-keep only. @return 0 or -errno: it stays, as KEPT */
int store_remove(struct sst_storage *s, const struct store_entry *entry);
/** The oldest segment of a recording goes, because of the limits. sst-keep only. @return 0, -ENODATA (it has no more
 * than must stay) and what sst_recording_shorten() returns: nothing of it went */
int store_shorten(struct sst_storage *s, const struct store_entry *entry);
/** What somebody deleted goes. sst-keep only. */
void store_remove_doomed(struct sst_storage *s);

/** Plans of videos that nobody has asked for in a while go. */
void store_plans_expire(struct sst_storage *s, int64_t now_ns);

/** Bytes of everything in the catalog. */
int64_t store_used_locked(const struct sst_storage *s);

/** "motion in door", "Pedestrian in door", "motion". */
void store_watch_text(char out[SST_STORE_WHY], const struct sst_watch *w);

/** Tracks of the cameras as they are now. @return [SST_CAMERAS_MAX] to free, or NULL: no memory */
struct sst_recorder_track *store_tracks(struct sst_storage *s);

/* --- tar: a folder as a tar archive. --- */

/**
 * Plan the archive (POSIX ustar) of a folder's regular files and folders as they are now, in the order of their names;
 * links and devices are left out.
 *
 * @param to    zeroed by the caller; its paths are below the folder
 * @param fd    of the folder, stays the caller's
 * @param name  that it has in the archive, without '/'; NAME/views/00_00.jpg of all files must fit 100 bytes
 * @return 0, -ENAMETOOLONG, -ENOMEM or -errno of reading; not logged.
 */
SST_MUST_CHECK int tar_plan(struct spans *to, int fd, const char *name);

/* --- video: a recording as a file that plays: one camera, or the see-through view. --- */

/* The see-through view of a recording: pictures one after the other, and a line of JSON for each. */
#define SST_VIDEO_PICTURES "view.mjpeg"
#define SST_VIDEO_INDEX    "view.jsonl"
#define SST_VIDEO_LINE_MAX 256

/** A picture of the view, as its line says. */
struct video_line {
    int64_t t_ns, wall_ns; /* of its set */
    uint64_t set;          /* index of the trigger */
    int64_t offset;        /* in SST_VIDEO_PICTURES */
    int64_t bytes;
};

/** Write a line with its end. @return its bytes */
size_t video_write_line(char out[SST_VIDEO_LINE_MAX], const struct video_line *line);
/** @return false: it is none, or torn */
bool video_read_line(const char *text, struct video_line *line);

/**
 * Plan the video of a camera: every frame that its recording holds of it, bytes untouched. A recording that is being
 * written gives what it holds by now.
 *
 * @param to   zeroed by the caller; its paths are below dir
 * @param dir  of the recording
 * @return 0, -ENOENT (no such camera, or no recording), -ENODATA (no frame of it), -EBADMSG, -EIO, -ENOMEM; logged by
 *         what reads recordings. Waits for the disk.
 */
SST_MUST_CHECK int video_plan_camera(struct spans *to, const char *dir, int row, int col);

/** Likewise the see-through view. @return as above; -ENOENT: none was recorded */
SST_MUST_CHECK int video_plan_view(struct spans *to, const char *dir);

#endif
