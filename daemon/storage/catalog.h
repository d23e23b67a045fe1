/* daemon/storage/catalog.h - what is in the folder: recordings, snapshots, exports; in memory and as files that say so.
 *
 * A recording of ours has storage.json beside its sets, written before the first set and again at the end; folders
 * without one are somebody else's and are neither counted nor touched. Snapshots and exports have one, too; those
 * without (a daemon was killed in between) are known by lightfield.json and count as the oldest. */
#ifndef SST_DAEMON_STORAGE_CATALOG_H
#define SST_DAEMON_STORAGE_CATALOG_H

#include <stdbool.h>

#include "base/file.h"

#define SST_STORE_NAME 64 /* bytes of a name with its end */
#define SST_STORE_WHY  112

enum sst_store_kind {
    SST_STORE_RECORDING = 0,
    SST_STORE_SNAPSHOT = 1,
    SST_STORE_EXPORT = 2,
    SST_STORE_KINDS = 3,
};

enum sst_store_stage {
    SST_STORE_DONE = 0,
    SST_STORE_ACTIVE = 1, /* being written here, or being made */
    SST_STORE_TORN = 2,   /* its daemon was killed: to be mended */
    SST_STORE_KEPT = 3,   /* cannot be mended or another process records there: left as it is */
};

struct sst_store_entry {
    enum sst_store_kind kind;
    enum sst_store_stage stage;
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
struct sst_catalog {
    struct sst_store_entry *entry;
    int count, capacity;
    uint64_t order; /* the highest given so far */
};

/** A copy is put in. @return 0, -ENOMEM */
SST_MUST_CHECK int sst_catalog_add(struct sst_catalog *c, const struct sst_store_entry *entry);
void sst_catalog_remove(struct sst_catalog *c, const char *name);
/** What is known of it anew, under its name; who reads it and whether it was deleted stays. Not there: nothing. */
void sst_catalog_update(struct sst_catalog *c, const struct sst_store_entry *entry);
/** NULL: not there. Valid until something is added or removed. */
struct sst_store_entry *sst_catalog_find(struct sst_catalog *c, const char *name);
void sst_catalog_fini(struct sst_catalog *c);

/** [A-Za-z0-9_-][A-Za-z0-9_.-]{0,62}: a name that was made here. */
bool sst_store_name_good(const char *name);

#define SST_STORE_SEGMENTS 2 /* the last ones of a recording that is being written always stay */

#define SST_STORE_ON_DEMAND "on demand" /* why of a recording that somebody asked for */

/** Snapshots, exports, recordings on demand: they outlive what is recorded without anybody. */
bool sst_store_by_hand(const struct sst_store_entry *entry);

/** "recording", "snapshot", "export". */
const char *sst_store_kind_name(enum sst_store_kind kind);

/** "", "snapshot-", "export-": what names of the kind begin with. */
const char *sst_store_prefix(enum sst_store_kind kind);

/** "2026-11-21T18-05-00Z" of a wall time after the kind's prefix, and "-2", "-3" ... as `attempt` grows from 1. */
void sst_store_name(char out[SST_STORE_NAME], enum sst_store_kind kind, int64_t wall_ns, int attempt);

/* --- on disk; these wait for it ----------------------------------------------------------------------------------- */

/** Write storage.json, whole. @param dir  of the entry @return 0 or an error of the output; logged */
SST_MUST_CHECK int sst_store_write(const char *dir, const struct sst_store_entry *entry);

/** Read storage.json: order, why, from, to, made, sets, gone, bytes, and DONE or TORN as stage. @return 0, -ENOENT (not
 *  ours), -EBADMSG, -EIO. Not logged. */
SST_MUST_CHECK int sst_store_read(const char *dir, struct sst_store_entry *entry);

/**
 * What a folder of recordings, snapshots or exports holds, left-overs of a killed daemon (*.tmp-*, empty folders with
 * names of ours) removed first.
 *
 * @param tidy  remove those
 * @param c     out, zeroed by the caller
 * @return 0, -ENOMEM or -errno of reading the folder; not logged
 */
SST_MUST_CHECK int sst_store_scan(const char *folder, enum sst_store_kind kind, bool tidy, struct sst_catalog *c);

/** Bytes of all files below a folder, in whole blocks of 4 KiB. */
int64_t sst_store_bytes(const char *dir);

/** Bring a torn recording into a state that says what it holds, and write its storage.json.
 *  @return 0, -ENODATA (it has no set), -EBUSY (another process records there), -EBADMSG, -EIO ...; logged */
SST_MUST_CHECK int sst_store_mend(const char *dir, struct sst_store_entry *entry);

/* --- which goes next ---------------------------------------------------------------------------------------------- */

struct sst_store_limits {
    int64_t quota_bytes, min_free_bytes; /* 0: none */
    int64_t max_age_ns, hand_max_age_ns; /* of what was recorded by itself and made by hand; 0: none */
    int64_t hand_bytes;                  /* up to this what was made by hand outlives the rest; 0: half of the room */
    int64_t margin_bytes; /* kept free of what quota and free space allow, for what is written meanwhile */
};

struct sst_store_room {
    int64_t used_bytes, free_bytes;
    int64_t waiting_bytes; /* of a set that waits for the quota to have room for it; 0: none does */
    int64_t wall_ns;
    bool clock_steady; /* the wall clock has not been stepped for a while: ages count */
};

enum sst_store_verdict {
    SST_STORE_FITS = 0,
    SST_STORE_TOO_OLD = 1,
    SST_STORE_TOO_MUCH = 2, /* for the quota or the free space */
    SST_STORE_NO_ROOM = 3,  /* likewise, and nothing is left to remove */
};

/** The room there is in all: the smaller of what quota and free space allow. */
int64_t sst_store_room_bytes(const struct sst_store_limits *limits, const struct sst_store_room *room);

/** What of it what was made by hand may take before the rest is spared. */
int64_t sst_store_hand_bytes(const struct sst_store_limits *limits, const struct sst_store_room *room);

/**
 * What is to be removed first. Beyond a limit that is the oldest that was recorded by itself; the oldest that was made
 * by hand, if that takes more than its part or nothing else is left. What is being downloaded goes after what is not,
 * and a recording that is being written last: of that, the oldest segment.
 * The newest by itself and the newest by hand never go by their age. What bears a time that cannot be (before 2026, in
 * the future, or an hour before something was begun that is older by its order) is as old as what was made next.
 * @param victim  out, index of it with TOO_OLD and TOO_MUCH
 */
enum sst_store_verdict sst_store_judge(const struct sst_catalog *c, const struct sst_store_limits *limits,
                                       const struct sst_store_room *room, int *victim);

#endif
