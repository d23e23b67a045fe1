/* capture/recording/index.h - where the lines of a recording are. Inside capture/recording only. */
#ifndef SST_CAPTURE_RECORDING_INDEX_H
#define SST_CAPTURE_RECORDING_INDEX_H

#include "capture/recording/setlist.h"

struct sst_index_line {
    int64_t at;     /* first byte in sets.jsonl */
    uint32_t bytes; /* without the line's end */
    int segment, session;
    bool damaged; /* its checksum is wrong: a set of which nothing is known */
};

/* Fixed after open. */
struct sst_recording {
    char *dir;
    int fd; /* of sets.jsonl */
    struct sst_recording_info info;
    struct sst_recording_removed removed;
    struct sst_index_line *line; /* [count], one a set */
    int count, capacity;
    int segment, session; /* of the last segment's line; -1 and 0: none */
    int64_t good_bytes;   /* behind the last line that is whole */
    int64_t size;         /* as far as it was read */
};

#endif
