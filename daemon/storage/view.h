/* daemon/storage/view.h - the see-through view beside the sets of a recording. Inside daemon/storage only.
 *
 * Its pictures come from the outlet of the main view, as JPEG: the thread sst-view keeps those of the last moments in
 * memory (pre-roll), and the recording thread writes them. */
#ifndef SST_DAEMON_STORAGE_VIEW_H
#define SST_DAEMON_STORAGE_VIEW_H

#include <stdio.h>

#include "daemon/slot/jpeg_slot.h"
#include "daemon/storage/catalog.h"

#define SST_VIEW_SHOWN_MAX   4096
#define SST_VIEW_SHOWN_BYTES ((size_t)64 << 20)

/** Pictures of the last moments; the oldest goes first. Under the storage's lock. Zeroed: none. */
struct sst_view_shown {
    const struct sst_jpeg *jpeg[SST_VIEW_SHOWN_MAX]; /* from `first` on, round about */
    int first, count;
    size_t bytes;
};

/** Take a reference over; those before keep_ns go, but for one: what was seen then. */
void sst_view_shown_add(struct sst_view_shown *s, const struct sst_jpeg *jpeg, int64_t keep_ns);
/** The first with a number above `after`, referenced; NULL: none. */
const struct sst_jpeg *sst_view_shown_next(struct sst_view_shown *s, uint64_t after);
/** The last that is not after t_ns, referenced; NULL: none. */
const struct sst_jpeg *sst_view_shown_at(struct sst_view_shown *s, int64_t t_ns);
void sst_view_shown_fini(struct sst_view_shown *s);

/** The files of a recording; zeroed: none. One thread. */
struct sst_view_files {
    int fd;                                 /* pictures; 0: none */
    FILE *index;                            /* NULL: none */
    int64_t at;                             /* end of the pictures */
    int64_t last_t_ns, last_at, last_bytes; /* of the last line */
    uint64_t last_set;
};

/** Make them in a recording's folder. @return 0 or -errno; logged. Waits for the disk. */
SST_MUST_CHECK int sst_view_begin(struct sst_view_files *f, const char *dir);
/** @param t_ns  when it is to be shown: its own time, or the recording's beginning @return 0 or -errno; not logged */
SST_MUST_CHECK int sst_view_write(struct sst_view_files *f, const struct sst_jpeg *jpeg, int64_t t_ns);
/** Close them; the last picture is shown until end_ns. @return 0 or the error that it met; not logged */
int sst_view_end(struct sst_view_files *f, int64_t end_ns, int64_t end_wall_ns);

#endif
