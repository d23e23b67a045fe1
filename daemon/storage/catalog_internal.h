/* daemon/storage/catalog_internal.h - catalog of the storage folder: its entries, their files, and the order of removal. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_STORAGE_CATALOG_INTERNAL_H
#define SST_DAEMON_STORAGE_CATALOG_INTERNAL_H

#include <stdbool.h>
#include <stdint.h>

#include "base/base.h"

/* --- catalog ---
 * list of the recordings, snapshots and exports in the storage folder.
 *
 * Our recordings have storage.json beside their sets, written before the first set and again at the end; folders
 * without one are foreign and are neither counted nor touched. Snapshots and exports have one, too; ones
 * without (a daemon was killed in between) are recognized by lightfield.json and count as the oldest. */

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
    SST_STORE_ACTIVE = 1, /* being written by this service */
    SST_STORE_TORN = 2,   /* its daemon was killed: to be repaired */
    SST_STORE_KEPT = 3,   /* cannot be repaired now, or another process records there */
};

struct store_entry {
    enum store_kind kind;
    enum store_stage stage;
    char name[SST_STORE_NAME];
    char why[SST_STORE_WHY]; /* of a recording */
    uint64_t order;          /* grows with each entry, whatever the clock; 0: unknown */
    int64_t from_ns, to_ns;  /* wall time of first and last set; 0: none */
    int64_t made_ns;         /* wall time when it was finished; 0: unknown */
    uint64_t sets;
    uint64_t gone;        /* of a recording: sets removed from its beginning, not among `sets`; UINT64_MAX: unknown */
    int64_t bytes;        /* on disk */
    bool picture;         /* of a snapshot: picture.jpg is there; of a recording: the see-through view was recorded */
    int64_t view_ns;      /* with `picture` of a recording: wall time from which on its view was rendered; 0: unknown */
    bool deleted_by_hand; /* a client deleted it: it is hidden from all others */
    int readers;          /* downloads that read it */
    int segments;         /* of the active recording, at the last scan; else 0 */
};

/** In their order; within one order by made_ns. Zeroed: empty. One thread at a time. */
struct catalog {
    struct store_entry *entry;
    int count, capacity;
    uint64_t order; /* the highest given so far */
};

/** Insert a copy. @return 0, -ENOMEM */
SST_MUST_CHECK int catalog_add(struct catalog *c, const struct store_entry *entry);
void catalog_remove(struct catalog *c, const char *name);
/** Refresh an entry by name; its readers and deletion mark are preserved. No-op if absent. */
void catalog_update(struct catalog *c, const struct store_entry *entry);
/** NULL: not there. Valid until something is added or removed. */
struct store_entry *catalog_find(struct catalog *c, const char *name);
void catalog_fini(struct catalog *c);

/** [A-Za-z0-9_-][A-Za-z0-9_.-]{0,62}: a name that was made here. */
bool store_name_good(const char *name);

#define SST_STORE_SEGMENTS 2 /* newest segments of the active recording that always stay */

#define SST_STORE_ON_DEMAND   "on demand" /* `why` of a recording that a client requested */
#define SST_STORE_REDUCED_WHY "reduced"   /* of one of some sets */

/** Snapshots, exports, recordings on demand: retention keeps them longer than automatic recordings. */
bool store_is_manual(const struct store_entry *entry);

/** Classes that are kept and removed apart from the others. */
enum store_class {
    SST_STORE_FULL = 0,    /* recorded automatically, every set */
    SST_STORE_REDUCED = 1, /* recorded automatically, some sets */
    SST_STORE_MANUAL = 2,  /* made on request */
    SST_STORE_CLASSES = 3,
};
enum store_class store_class_of(const struct store_entry *entry);

/** "", "snapshot-", "export-": prefix of names of the kind. */
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
 * List a folder of recordings, snapshots or exports, optionally after removing left-overs of a killed daemon (*.tmp-*,
 * empty folders with names of ours).
 *
 * @param tidy  remove the left-overs
 * @param c     out, zeroed by the caller
 * @return 0, -ENOMEM or -errno of reading the folder; not logged
 */
SST_MUST_CHECK int store_scan(const char *folder, enum store_kind kind, bool tidy, struct catalog *c);

/** Bytes of all files below a folder, in whole blocks of 4 KiB. */
int64_t store_bytes(const char *dir);

/** Repair a torn recording: remove half-written parts and write its storage.json.
 *  @return 0, -ENODATA (it has no set), -EBUSY (another process records there), -EBADMSG, -EIO ...; logged */
SST_MUST_CHECK int store_repair(const char *dir, struct store_entry *entry);

/* --- order of removal --------------------------------------------------------------------------------------------- */

struct store_limits {
    int64_t quota_bytes, min_free_bytes;   /* 0: none */
    int64_t max_age_ns[SST_STORE_CLASSES]; /* 0: none */
    int64_t manual_bytes;                  /* up to this entries made by hand are kept longer; 0: half of the room */
    int64_t reduced_bytes;                 /* up to this reduced recordings are kept longer; 0: a third */
    int64_t margin_bytes;                  /* kept free within quota and free space, for bytes written meanwhile */
};

struct store_room {
    int64_t used_bytes, free_bytes;
    int64_t waiting_bytes; /* of a set that waits for room in the quota; 0: none */
    int64_t wall_ns;
    bool clock_steady; /* no step of the wall clock for a while: ages count */
};

enum store_verdict {
    SST_STORE_FITS = 0,
    SST_STORE_TOO_OLD = 1,
    SST_STORE_TOO_MUCH = 2, /* for the quota or the free space */
    SST_STORE_NO_ROOM = 3,  /* and nothing is left to remove */
};

/** The total room, by the smaller of quota and free space. */
int64_t store_room_bytes(const struct store_limits *limits, const struct store_room *room);

/** Up to this many bytes, entries made by hand are removed last, and reduced recordings after full ones. */
int64_t store_manual_bytes(const struct store_limits *limits, const struct store_room *room);
int64_t store_reduced_bytes(const struct store_limits *limits, const struct store_room *room);

/** Most bytes of another video for downloads, with made_bytes of them already: the room within the limits, or a tenth
 *  of the room for all such videos; never the margin of the disk. */
int64_t store_download_bytes(const struct store_limits *limits, const struct store_room *room, int64_t made_bytes);

/**
 * Choose the next entry to remove. Beyond a limit it is the oldest full automatic recording; the oldest reduced one, or
 * the oldest entry made by hand, if that class exceeds its part or nothing else is left. Entries that are being
 * downloaded come after others, and the active recording last: it loses its oldest segment.
 * The newest of each class is never removed for its age. An entry with an impossible time (before 2026, in the future,
 * or an hour before the beginning of one that is older by its order) is as old as the next one.
 * @param victim  out, index of it with TOO_OLD and TOO_MUCH
 */
enum store_verdict store_judge(const struct catalog *c, const struct store_limits *limits,
                               const struct store_room *room, int *victim);

#endif
