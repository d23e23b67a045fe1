/* Matroska (RFC 9559) of constant-width parts, so that all places are known before the first byte is. */
#include "daemon/storage/storage_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "capture/recording/ebml.h"

#define CLUSTER_NS    1000000000
#define CLUSTER_BYTES ((int64_t)32 << 20)
#define MASTER_HEAD   12 /* id of four bytes, size of eight */
#define STAMP_BYTES   10
#define BLOCK_HEAD    14 /* id, size of eight, track of two, time of two, flags */
#define CUE_BYTES     28
#define EPOCH_NS      978307200000000000 /* 2001-01-01, from which Matroska counts */
#define ID_TRACKS     0x1654AE6Bu
#define ID_TRACK      0xAEu
#define ID_NUMBER     0xD7u

/* --- bytes -------------------------------------------------------------------------------------------------------- */

struct text {
    uint8_t data[SST_MATROSKA_TRACK_MAX];
    size_t n;
};

static size_t put_bytes(uint8_t *out, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        out[i] = (uint8_t)(value >> (8 * (bytes - 1 - i)));
    return (size_t)bytes;
}

static size_t put_id(uint8_t *out, uint32_t id)
{
    return put_bytes(out, id, id > 0xFFFFFF ? 4 : id > 0xFFFF ? 3 : id > 0xFF ? 2 : 1);
}

/* A size of eight bytes, whatever it is. */
static size_t put_size(uint8_t *out, uint64_t size)
{
    return put_bytes(out, size | (uint64_t)1 << 56, 8);
}

static size_t put_head(uint8_t *out, uint32_t id, uint64_t size)
{
    const size_t n = put_id(out, id);

    return n + put_size(out + n, size);
}

static void add(struct text *t, uint32_t id, const void *data, size_t n)
{
    if (t->n + 12 + n > sizeof(t->data))
        return; /* only texts of people are long: without them the file is as good */
    t->n += put_head(t->data + t->n, id, n);
    memcpy(t->data + t->n, data, n);
    t->n += n;
}

static void add_number(struct text *t, uint32_t id, uint64_t value)
{
    uint8_t number[8];

    put_bytes(number, value, 8);
    add(t, id, number, 8);
}

static void add_text(struct text *t, uint32_t id, const char *text)
{
    add(t, id, text, strlen(text));
}

/* --- tracks ------------------------------------------------------------------------------------------------------- */

void matroska_jpeg_track(struct matroska_track *out, int width, int height, const char *name)
{
    struct text video = { .n = 0 }, entry = { .n = 0 };

    add_number(&video, 0xB0, (uint64_t)width);
    add_number(&video, 0xBA, (uint64_t)height);
    add_number(&entry, ID_NUMBER, 1);
    add_number(&entry, 0x73C5, 1); /* TrackUID */
    add_number(&entry, 0x83, 1);   /* TrackType: video */
    add_number(&entry, 0x9C, 0);   /* FlagLacing */
    add_text(&entry, 0x86, "V_MJPEG");
    add_text(&entry, 0x536E, name);
    add(&entry, 0xE0, video.data, video.n);
    out->number = 1;
    out->bytes = put_head(out->entry, ID_TRACK, entry.n);
    memcpy(out->entry + out->bytes, entry.data, entry.n);
    out->bytes += entry.n;
}

/* The number of a TrackEntry; -1: it has none. */
static int64_t number_of(const uint8_t *data, size_t n)
{
    struct sst_ebml e;
    int64_t number = -1;

    while (n && !sst_ebml_head(data, n, &e) && e.size <= n - e.head) {
        if (e.id == ID_NUMBER && e.size && e.size <= 4) {
            number = 0;
            for (size_t i = 0; i < e.size; i++)
                number = number << 8 | data[e.head + i];
        }
        data += e.head + e.size;
        n -= e.head + (size_t)e.size;
    }
    return number;
}

int matroska_find_track(const uint8_t *data, size_t n, int number, struct matroska_track *out)
{
    struct sst_ebml e;
    bool inside = false;

    while (n && !sst_ebml_head(data, n, &e)) {
        const bool enter = e.id == SST_EBML_SEGMENT || e.id == ID_TRACKS;
        const size_t whole = enter ? e.head : e.head + (size_t)e.size;

        if (!enter && (e.size > n || whole > n))
            return -EBADMSG;
        if (e.id == SST_EBML_CLUSTER || (inside && e.id != ID_TRACK))
            return -ENOENT;
        inside |= e.id == ID_TRACKS;
        if (e.id == ID_TRACK && number_of(data + e.head, (size_t)e.size) == number) {
            if (whole > sizeof(out->entry))
                return -EBADMSG;
            memcpy(out->entry, data, whole);
            out->bytes = whole;
            out->number = number;
            return 0;
        }
        data += whole;
        n -= whole;
    }
    return -EBADMSG;
}

/* --- the file ----------------------------------------------------------------------------------------------------- */

struct cluster {
    size_t first, count; /* frames */
    int64_t bytes;       /* of its content */
};

static int64_t ms_of(const struct matroska_frame *frame, size_t i)
{
    return (frame[i].t_ns - frame[0].t_ns) / 1000000;
}

/* Every frame can be sought to a second, and its time in a cluster fits its 16 bits. */
static size_t make_clusters(struct cluster *c, const struct matroska_frame *frame, size_t count)
{
    size_t n = 0;

    for (size_t i = 0; i < count; i++) {
        if (!n || frame[i].t_ns - frame[c[n - 1].first].t_ns >= CLUSTER_NS || c[n - 1].bytes > CLUSTER_BYTES)
            c[n++] = (struct cluster){ .first = i, .bytes = STAMP_BYTES };
        c[n - 1].count++;
        c[n - 1].bytes += BLOCK_HEAD + frame[i].bytes;
    }
    return n;
}

static void write_info(struct text *out, const char *title, int64_t wall_ns, int64_t length_ms)
{
    const double duration = (double)length_ms;
    struct text info = { .n = 0 };
    uint64_t bits;

    memcpy(&bits, &duration, sizeof(bits));
    add_number(&info, 0x2AD7B1, 1000000); /* TimestampScale: ms */
    add_number(&info, 0x4489, bits);
    if (wall_ns > 0)
        add_number(&info, 0x4461, (uint64_t)(wall_ns - EPOCH_NS));
    add_text(&info, 0x7BA9, title);
    add_text(&info, 0x4D80, "sst");
    add_text(&info, 0x5741, "sst " SST_VERSION);
    add(out, 0x1549A966, info.data, info.n);
}

static void write_start(struct text *out, uint64_t segment_bytes)
{
    struct text head = { .n = 0 };

    add_number(&head, 0x4286, 1);
    add_number(&head, 0x42F7, 1);
    add_number(&head, 0x42F2, 4);
    add_number(&head, 0x42F3, 8);
    add_text(&head, 0x4282, "matroska");
    add_number(&head, 0x4287, 4);
    add_number(&head, 0x4285, 2);
    add(out, SST_EBML_HEAD, head.data, head.n);
    out->n += put_head(out->data + out->n, SST_EBML_SEGMENT, segment_bytes);
}

/* @param place  of the cluster in the segment */
static void plan_cue(struct spans *to, int track, int64_t ms, int64_t place)
{
    uint8_t cue[CUE_BYTES] = { 0xBB, 0x80 | (CUE_BYTES - 2), 0xB3, 0x88 };
    size_t n = 4;

    n += put_bytes(cue + n, (uint64_t)ms, 8);
    n += put_bytes(cue + n, 0xB78Eu, 2);
    n += put_bytes(cue + n, 0xF782u, 2);
    n += put_bytes(cue + n, (uint64_t)track, 2);
    n += put_bytes(cue + n, 0xF188u, 2);
    put_bytes(cue + n, (uint64_t)place, 8);
    spans_own(to, cue, sizeof(cue));
}

static void plan_cluster(struct spans *to, int track, const struct cluster *c, const struct matroska_frame *frame)
{
    const int64_t start_ms = ms_of(frame, c->first);
    uint8_t head[MASTER_HEAD + STAMP_BYTES];
    size_t n = put_head(head, SST_EBML_CLUSTER, (uint64_t)c->bytes);

    n += put_bytes(head + n, 0xE788u, 2);
    n += put_bytes(head + n, (uint64_t)start_ms, 8);
    spans_own(to, head, n);
    for (size_t i = c->first; i < c->first + c->count; i++) {
        uint8_t block[BLOCK_HEAD];

        n = put_head(block, SST_EBML_SIMPLE_BLOCK, (uint64_t)frame[i].bytes + BLOCK_HEAD - 9);
        n += put_bytes(block + n, (uint64_t)track | 0x4000, 2);
        n += put_bytes(block + n, (uint64_t)(ms_of(frame, i) - start_ms), 2);
        block[n++] = 0x80; /* each picture stands for itself */
        spans_own(to, block, n);
        spans_piece(to, frame[i].file, frame[i].offset, frame[i].bytes);
    }
}

/* How long it plays: the last picture stays as long as one does on average, a second at most. */
static int64_t length_ms(const struct matroska_frame *frame, size_t count)
{
    const int64_t last_ms = ms_of(frame, count - 1);

    const int64_t mean_ms = count > 1 ? last_ms / (int64_t)(count - 1) : 1;

    return last_ms + (mean_ms < 1000 ? mean_ms : 1000);
}

int matroska_plan(struct spans *to, const struct matroska_track *track, const char *title, int64_t wall_ns,
                  const struct matroska_frame *frame, size_t count)
{
    struct cluster *c = calloc(count ? count : 1, sizeof(*c));
    struct text start = { .n = 0 }, info = { .n = 0 };
    uint8_t head[MASTER_HEAD];
    int64_t place, all = 0;
    size_t clusters;

    if (!c || !count) {
        free(c);
        return count ? -ENOMEM : -ENODATA;
    }
    clusters = make_clusters(c, frame, count);
    write_info(&info, title, wall_ns, length_ms(frame, count));
    for (size_t i = 0; i < clusters; i++)
        all += MASTER_HEAD + c[i].bytes;
    place = (int64_t)(info.n + MASTER_HEAD + track->bytes + MASTER_HEAD + clusters * CUE_BYTES);
    write_start(&start, (uint64_t)(place + all));
    spans_own(to, start.data, start.n);
    spans_own(to, info.data, info.n);
    spans_own(to, head, put_head(head, ID_TRACKS, track->bytes));
    spans_own(to, track->entry, track->bytes);
    spans_own(to, head, put_head(head, 0x1C53BB6Bu, clusters * CUE_BYTES));
    for (size_t i = 0; i < clusters; i++) {
        plan_cue(to, track->number, ms_of(frame, c[i].first), place);
        place += MASTER_HEAD + c[i].bytes;
    }
    for (size_t i = 0; i < clusters; i++)
        plan_cluster(to, track->number, &c[i], frame);
    free(c);
    return spans_error(to);
}
