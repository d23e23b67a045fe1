/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/recording/recording_internal.h"

#include <assert.h>
#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>
#include <zlib.h>

#define OFFSET_MAX ((json_int_t)1 << 60)
#define CRC_BYTES  18 /* ,"crc":"01234567"} */

/* --- writing lines: no memory is asked for ------------------------------------------------------------------------ */

static SST_PRINTF(3, 4) size_t put(char *out, size_t at, const char *fmt, ...)
{
    va_list args;
    int n;

    va_start(args, fmt);
    n = vsnprintf(out + at, MANIFEST_LINE_MAX - at, fmt, args);
    va_end(args);
    assert(n >= 0 && at + (size_t)n < MANIFEST_LINE_MAX); /* the buffer holds the longest line */
    return at + (size_t)n;
}

static uint32_t crc_of(const char *data, size_t n)
{
    return (uint32_t)crc32_z(0, (const uint8_t *)data, n);
}

static size_t put_end(char *out, size_t at)
{
    return put(out, at, ",\"crc\":\"%08" PRIx32 "\"}\n", crc_of(out, at));
}

size_t manifest_segment_line(char *out, int segment, int session, int64_t start_ns, int64_t wall_ns)
{
    const size_t at = put(out, 0, "{\"segment\":%d,\"session\":%d,\"start_ns\":%" PRId64 ",\"wall_ns\":%" PRId64,
                          segment, session, start_ns, wall_ns);

    return put_end(out, at);
}

const char *const manifest_columns[MANIFEST_COLUMNS] = {
    "cam", "sequence", "lost_before", "from_set_ns", "arrival_ns", "offset", "bytes", "stride", "faults", "crc32",
};

size_t manifest_set_line(char *out, const struct sst_frameset *set, const int64_t *offset, const uint32_t *crc32)
{
    const char *comma = "";
    size_t at = put(out, 0,
                    "{\"set\":%" PRIu64 ",\"t_ns\":%" PRId64 ",\"wall_ns\":%" PRId64
                    ",\"edge\":%s,\"spread_ns\":%" PRId64 ",\"from_edge_ns\":%" PRId64 ",\"worst_cam\":%d,\"frames\":[",
                    set->index, set->t_ns, set->wall_ns, set->edge ? "true" : "false", set->skew.spread_ns,
                    set->skew.from_edge_ns, set->skew.worst_cam);

    for (int k = 0; k < set->cameras; k++) {
        const struct sst_frame *f = set->frame[k];

        if (!f)
            continue;
        at = put(out, at, "%s[%d,%" PRIu32 ",%" PRIu32 ",%" PRId64 ",%" PRId64 ",%" PRId64 ",%zu,%zu,%u,%" PRIu32 "]",
                 comma, k, f->sequence, f->lost_before, f->t_ns - set->t_ns, f->arrival_ns - f->t_ns, offset[k],
                 f->bytes, f->stride, f->faults, crc32[k]);
        comma = ",";
    }
    at = put(out, at, "],\"missing\":[");
    comma = "";
    for (int k = 0; k < set->cameras; k++) {
        if (!set->frame[k]) {
            at = put(out, at, "%s%d", comma, k);
            comma = ",";
        }
    }
    at = put(out, at, "]");
    return put_end(out, at);
}

/* --- reading lines ------------------------------------------------------------------------------------------------ */

bool manifest_line_whole(const char *line, size_t n)
{
    char end[CRC_BYTES + 1];

    if (n <= CRC_BYTES)
        return false;
    snprintf(end, sizeof(end), ",\"crc\":\"%08" PRIx32 "\"}", crc_of(line, n - CRC_BYTES));
    return !memcmp(line + n - CRC_BYTES, end, CRC_BYTES);
}

static int read_frame(const json_t *row, int cameras, struct sst_recording_set *set)
{
    json_int_t v[MANIFEST_COLUMNS];
    struct sst_recording_frame *f;

    if (json_array_size(row) != MANIFEST_COLUMNS)
        return -EBADMSG;
    for (size_t i = 0; i < MANIFEST_COLUMNS; i++) {
        if (!json_is_integer(json_array_get(row, i)))
            return -EBADMSG;
        v[i] = json_integer_value(json_array_get(row, i));
    }
    if (v[0] < 0 || v[0] >= cameras || set->frame[v[0]].present || v[1] < 0 || v[1] > UINT32_MAX || v[2] < 0 ||
        v[2] > UINT32_MAX || v[5] < -1 || v[5] > OFFSET_MAX || v[6] < 0 || v[6] > INT32_MAX || v[7] < 0 ||
        v[7] > INT32_MAX || v[8] < 0 || v[8] > UINT16_MAX || v[9] < 0 || v[9] > UINT32_MAX || (v[5] < 0) != (v[6] == 0))
        return -EBADMSG;
    f = &set->frame[v[0]];
    *f = (struct sst_recording_frame){
        .present = true,
        .sequence = (uint32_t)v[1],
        .lost_before = (uint32_t)v[2],
        .offset = v[5],
        .bytes = (size_t)v[6],
        .stride = (size_t)v[7],
        .faults = (unsigned)v[8],
        .crc32 = (uint32_t)v[9],
    };
    if (__builtin_add_overflow((int64_t)v[3], set->t_ns, &f->t_ns) ||
        __builtin_add_overflow((int64_t)v[4], f->t_ns, &f->arrival_ns))
        return -EBADMSG;
    set->present++;
    return 0;
}

static int read_set(json_t *root, int cameras, struct sst_recording_set *out)
{
    struct sst_recording_set set = { 0 };
    json_t *frames, *missing, *row;
    json_int_t index, t, wall, spread, from_edge;
    int edge, err = 0;
    size_t i;

    if (json_unpack(root, "{s:I, s:I, s:I, s:b, s:I, s:I, s:i, s:o, s:o}", "set", &index, "t_ns", &t, "wall_ns", &wall,
                    "edge", &edge, "spread_ns", &spread, "from_edge_ns", &from_edge, "worst_cam", &set.skew.worst_cam,
                    "frames", &frames, "missing", &missing))
        return -EBADMSG;
    set.index = (uint64_t)index;
    set.t_ns = t;
    set.wall_ns = wall;
    set.edge = edge;
    set.skew.spread_ns = spread;
    set.skew.from_edge_ns = from_edge;
    json_array_foreach(frames, i, row) err = err ? err : read_frame(row, cameras, &set);
    if (!json_is_array(frames) || set.present + (int)json_array_size(missing) != cameras)
        err = -EBADMSG;
    if (!err && out)
        *out = set;
    return err;
}

int manifest_parse(const char *line, size_t n, int cameras, struct manifest_segment *segment,
                   struct sst_recording_set *set)
{
    struct manifest_segment s;
    json_int_t start, wall;
    json_t *root;
    int result = 1;

    if (n > 7 && !memcmp(line, "{\"set\":", 7) && !set)
        return 1;
    root = json_loadb(line, n, JSON_REJECT_DUPLICATES, NULL);
    if (!root)
        return -EBADMSG;
    if (json_object_get(root, "set")) {
        const int err = read_set(root, cameras, set);

        result = err ? err : 1;
    } else if (json_unpack(root, "{s:i, s:i, s:I, s:I}", "segment", &s.segment, "session", &s.session, "start_ns",
                           &start, "wall_ns", &wall) ||
               s.segment < 0 || s.segment > SEGMENT_NUMBER_MAX || s.session < 0 ||
               s.session > s.segment) { /* each session has a segment */
        result = -EBADMSG;
    } else {
        s.start_ns = start;
        s.wall_ns = wall;
        *segment = s;
        result = 0;
    }
    json_decref(root);
    return result;
}

int manifest_parse_frame(const char *line, int cam, int64_t *wall_ns, struct sst_recording_frame *out)
{
    struct sst_recording_frame f = { .offset = -1 };
    int64_t t_ns, wall, from_ns, arrival_ns, bytes, stride;
    const char *row = strstr(line, ",\"frames\":[");
    int k = -1;

    if (sscanf(line, "{\"set\":%*20[0-9],\"t_ns\":%20" SCNd64 ",\"wall_ns\":%20" SCNd64, &t_ns, &wall) != 2 || !row)
        return -EBADMSG;
    for (row += 11; *row == '[' && k < cam; row = *row == ',' ? row + 1 : row) {
        k = atoi(row + 1);
        if (k == cam && sscanf(row,
                               "[%*d,%" SCNu32 ",%" SCNu32 ",%20" SCNd64 ",%20" SCNd64 ",%20" SCNd64 ",%20" SCNd64
                               ",%20" SCNd64 ",%u,%" SCNu32 "]",
                               &f.sequence, &f.lost_before, &from_ns, &arrival_ns, &f.offset, &bytes, &stride,
                               &f.faults, &f.crc32) != 9)
            return -EBADMSG;
        row = strchr(row, ']');
        if (!row)
            return -EBADMSG;
        row++;
    }
    f.present = k == cam;
    if (f.present && (f.offset < -1 || f.offset > OFFSET_MAX || bytes < 0 || bytes > INT32_MAX || stride < 0 ||
                      stride > INT32_MAX || __builtin_add_overflow(from_ns, t_ns, &f.t_ns)))
        return -EBADMSG;
    if (f.present) {
        f.bytes = (size_t)bytes;
        f.stride = (size_t)stride;
    }
    *wall_ns = wall;
    *out = f;
    return 0;
}

int segment_path(char out[SST_PATH_MAX], const char *dir, int number)
{
    char name[32];

    snprintf(name, sizeof(name), "segments/%06d.mkv", number);
    return sst_path_join(out, dir, name);
}
