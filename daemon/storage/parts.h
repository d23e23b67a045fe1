/* daemon/storage/parts.h - what the threads of storage share. Inside daemon/storage only.
 *
 * sst-record  writes sets (record.c)                waits for the disk
 * sst-keep    free space, limits, mending (keep.c)  waits for the disk
 * sst-export  snapshots and exports (jobs.c)        waits for the disk
 * sst-tar     downloads (download.c), one each      waits for the disk and for readers
 * sst-view    pictures of the last moments (view.c) never waits for a disk
 * sst-state   says how things stand (state.c)       never waits for either
 * Calls from outside only look at memory; the lock is never held while anything is waited for. */
#ifndef SST_DAEMON_STORAGE_PARTS_H
#define SST_DAEMON_STORAGE_PARTS_H

#include <pthread.h>

#include "daemon/storage/catalog.h"
#include "daemon/storage/storage.h"
#include "daemon/storage/triggers.h"
#include "daemon/storage/view.h"

#define SST_STORE_TEXT      512
#define SST_STORE_JOBS      4          /* that wait or run */
#define SST_STORE_PLANS     4          /* of videos, kept for the next part that is asked for */
#define SST_STORE_ANSWER_MS 800        /* that a call waits for a thread */
#define SST_STORE_GRACE_NS  100000000  /* and longer, where the machine may have stood still */
#define SST_STORE_HUNG_NS   5000000000 /* a disk that has been waited for longer hangs */

/** What the threads take from the configuration. */
struct sst_store_settings {
    enum sst_record_mode mode;
    bool view; /* the see-through view is recorded, too */
    struct sst_store_limits limits;
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
struct sst_store_want {
    bool armed; /* until a set behind the end has come */
    int64_t begin_ns, end_ns;
    char why[SST_STORE_WHY], zone[32], label[64];
};

/** What keeps sets from the disk. */
enum sst_store_trouble {
    SST_TROUBLE_NONE = 0,
    SST_TROUBLE_LIMIT_LOW = 1, /* LOW; from here on FULL */
    SST_TROUBLE_LIMIT = 2,
    SST_TROUBLE_HUNG = 3,
    SST_TROUBLE_WRITE = 4,
    SST_TROUBLE_FOLDER = 5,
};

struct sst_store_job;  /* jobs.c */
struct sst_store_plan; /* download.c */

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
    struct sst_store_settings settings;
    struct sst_recorder_track *tracks; /* [SST_CAMERAS_MAX], of settings.cameras */
    struct sst_catalog catalog;

    /* what is wanted */
    struct sst_watches watches;
    struct sst_store_want event, demand;
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
    bool ready;                   /* the folder is there, ours alone, and has been read */
    bool blocked;                 /* nothing may be written */
    int folder_err, write_err;    /* negative errno */
    enum sst_store_trouble limit; /* NONE, LIMIT_LOW, LIMIT */
    char folder_text[SST_STORE_TEXT], write_text[SST_STORE_TEXT], limit_text[SST_STORE_TEXT];
    int64_t free_bytes, used_bytes, checked_ns; /* checked: clock; 0: never */
    int64_t hand_bytes;                         /* that what is made by hand may take before the rest is spared */
    uint64_t removed[SST_STORE_KINDS], deleted; /* because of the limits; by hand */
    uint64_t shortened;                         /* segments of recordings whose rest stays, because of the limits */
    int64_t record_busy_ns, keep_busy_ns;       /* clock, since when the thread waits for the disk; 0: it does not */
    enum sst_storage_state state;
    enum sst_store_trouble trouble;
    char reason[SST_STORE_TEXT];

    struct sst_store_job *job[SST_STORE_JOBS]; /* in their order; the first is at work */
    int jobs;

    struct sst_store_plan *plan[SST_STORE_PLANS]; /* download.c; NULL: none */

    struct sst_outlet *outlet; /* of the main view; NULL: not yet */
    struct sst_view_shown shown;

    pthread_t thread[5];
};

void *sst_store_record_run(void *storage);
void *sst_store_keep_run(void *storage);
void *sst_store_jobs_run(void *storage);
void *sst_store_state_run(void *storage);
void *sst_store_view_run(void *storage);

/** The lock is held; waits for `wake` or `ms`, whichever comes first. */
void sst_store_wait_locked(struct sst_storage *s, int ms);
/** The same for `answered`, for whom to wait again if nothing has come. @return false: it is `until_ns`, and a bit */
bool sst_store_wait_answer_locked(struct sst_storage *s, int64_t until_ns);
/** The calling thread ends. */
void sst_store_thread_ends(struct sst_storage *s);
/** From here, or no longer, the thread waits for the disk. */
void sst_store_busy(struct sst_storage *s, int64_t *since_ns, bool busy);

/** What a call that needs the disk is to return now: 0, -ENOSPC, -EROFS, -EBUSY, -EIO. */
int sst_store_refusal_locked(const struct sst_storage *s);

/** A name for a new entry, which is ACTIVE in the catalog from then on. @param attempt  from 1 @return 0, -EEXIST
 * (another attempt may do), -ENOMEM */
SST_MUST_CHECK int sst_store_reserve(struct sst_storage *s, enum sst_store_kind kind, int64_t wall_ns, int attempt,
                                     const char *why, struct sst_store_entry *out);
/** Out of the folder and the catalog, because of the limits. sst-keep only. @return 0 or -errno: it stays, as KEPT */
int sst_store_remove(struct sst_storage *s, const struct sst_store_entry *entry);
/** The oldest segment of a recording goes, because of the limits. sst-keep only. @return 0, -ENODATA (it has no more
 * than must stay) and what sst_recording_shorten() returns: nothing of it went */
int sst_store_shorten(struct sst_storage *s, const struct sst_store_entry *entry);
/** What somebody deleted goes. sst-keep only. */
void sst_store_remove_doomed(struct sst_storage *s);

/** Plans of videos that nobody has asked for in a while go. */
void sst_store_plans_expire(struct sst_storage *s, int64_t now_ns);

/** Bytes of everything in the catalog. */
int64_t sst_store_used_locked(const struct sst_storage *s);

/** "motion in door", "Pedestrian in door", "motion". */
void sst_store_watch_text(char out[SST_STORE_WHY], const struct sst_watch *w);

/** Tracks of the cameras as they are now. @return [SST_CAMERAS_MAX] to free, or NULL: no memory */
struct sst_recorder_track *sst_store_tracks(struct sst_storage *s);

#endif
