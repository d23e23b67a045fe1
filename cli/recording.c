/* sst recording: contents of a recording, skew of its cameras, and damage. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/log.h"
#include "base/stats.h"
#include "capture/recording/recording.h"
#include "cli/cli_internal.h"

#define MAX_NAMED 8                   /* cameras or sets named in one line */
#define TABLE     64                  /* bytes of a frame in the tables of a segment, at most, and between two frames */
#define HEAD      4096                /* bytes of a segment before its first frame, at most, and of each camera in them */
#define HEAD_CAM  512
#define AHEAD_NS  INT64_C(1000000000) /* clocks of several hosts agree better than this */

/* Frames of a segment that the index names. */
struct segment {
    int number, frames;
    int64_t bytes, widest; /* of all its sets; of the largest one */
    int64_t end, hole;     /* of the frames of the last set; bytes between sets that no line names */
    bool damaged, skipped; /* skipped: the line of the last set cannot be read */
};

struct summary {
    const struct sst_recording_info *info;
    int sets, complete, damaged, runs;
    int missing[SST_CAMERAS_MAX], bad[SST_CAMERAS_MAX];
    int arrival[SST_CAMERAS_MAX]; /* frames with the time of arrival as theirs */
    int ahead[SST_CAMERAS_MAX];   /* frames with a time later than their arrival */
    int64_t bytes, lost_before;
    int spreads, periods;       /* how many there are of: */
    int64_t *spread_ns;         /* sets with two frames or more */
    int64_t *period_ns;         /* from one set to the next of the same run */
    int worst[SST_CAMERAS_MAX]; /* sets in which the camera was the one farthest off */
    int gaps;                   /* periods of more than one and a half of the usual */
    int unlisted;               /* segments with frames that the index does not name */
    int64_t unlisted_bytes;     /* of such frames */
    bool index_lost;            /* they are more than a set that was being written */
    struct segment segment;     /* of the sets at work */
    json_t *damage;             /* [{"set":, "cam":}]; cam -1: the line */
};

/* After the last set of a segment: count its bytes that no line of the index names. A set that was being written may
 * leave some. */
static void end_segment(struct summary *s, const struct sst_recording *recording, int next)
{
    const struct segment *g = &s->segment;
    const int64_t size = g->frames && !g->damaged ? sst_recording_segment_size(recording, g->number) : -1;
    const int64_t unknown = size - g->bytes - (int64_t)TABLE * g->frames;
    const int64_t lost = size >= 0 && unknown > 2 * g->widest ? unknown : g->hole;

    if (lost) {
        s->unlisted++;
        s->unlisted_bytes += lost;
        s->index_lost = true;
    }
    s->segment = (struct segment){ .number = next };
}

/* Frames of sets lie one behind the other: a hole between them is a set without its line in the index. */
static void find_hole(struct summary *s, const struct sst_recording_set *set)
{
    struct segment *g = &s->segment;
    const int64_t most = g->end ? g->end + TABLE : HEAD + (int64_t)HEAD_CAM * s->info->cameras;
    int64_t begin = INT64_MAX, end = 0;

    for (int k = 0; k < s->info->cameras; k++) {
        const struct sst_recording_frame *f = &set->frame[k];

        if (!f->present || f->offset < 0)
            continue;
        begin = f->offset < begin ? f->offset : begin;
        end = f->offset + (int64_t)f->bytes > end ? f->offset + (int64_t)f->bytes : end;
    }
    if (!end)
        return;
    if (!g->skipped && begin > most)
        g->hole += begin - g->end;
    g->end = end;
    g->skipped = false;
}

static void add_set(struct summary *s, const struct sst_recording_set *set, bool damaged)
{
    int64_t bytes = 0;
    int good = 0;

    for (int k = 0; k < s->info->cameras; k++) {
        const struct sst_recording_frame *f = &set->frame[k];
        const bool bad = f->present && (f->faults & SST_FRAME_BAD);

        s->missing[k] += !f->present;
        s->bad[k] += bad;
        s->arrival[k] += f->present && f->faults & SST_FRAME_ARRIVAL;
        s->ahead[k] += f->present && f->t_ns - f->arrival_ns > AHEAD_NS;
        good += f->present && !bad;
        bytes += f->present ? (int64_t)f->bytes : 0;
        s->lost_before += f->present ? f->lost_before : 0;
    }
    s->complete += good == s->info->cameras && !damaged;
    s->bytes += bytes;
    s->segment.bytes += bytes;
    s->segment.widest = bytes > s->segment.widest ? bytes : s->segment.widest;
    s->segment.frames += set->present;
    if (set->present > 1)
        s->spread_ns[s->spreads++] = set->skew.spread_ns;
    if (set->skew.worst_cam >= 0 && set->skew.worst_cam < s->info->cameras)
        s->worst[set->skew.worst_cam]++;
}

static void count_gaps(struct summary *s)
{
    const double usual =
        s->info->rate_hz > 0 ? 1e9 / s->info->rate_hz : (double)sst_stats_percentile(s->period_ns, s->periods, 50);

    for (int i = 0; i < s->periods; i++)
        s->gaps += (double)s->period_ns[i] > 1.5 * usual;
}

static int note_damage(struct summary *s, int set, int cam)
{
    s->damaged++;
    return json_array_append_new(s->damage, json_pack("{s:i, s:i}", "set", set, "cam", cam)) ? -ENOMEM : 0;
}

/* All lines and the sizes of the segments, and with `verify` all bytes. */
static int scan(struct summary *s, const struct sst_recording *recording, bool verify)
{
    struct sst_recording_set set, before = { .session = -1 };
    int err = 0;

    for (int i = 0; !err && i < s->sets; i++) {
        int cam = -1;

        err = sst_recording_set(recording, i, &set);
        s->segment.skipped |= err != 0;
        if (!err) {
            if (set.segment != s->segment.number)
                end_segment(s, recording, set.segment);
            if (set.session == before.session)
                s->period_ns[s->periods++] = set.t_ns - before.t_ns;
            s->runs += set.session != before.session;
            before = set;
            find_hole(s, &set);
            err = verify ? sst_recording_check(recording, i, &cam) : sst_recording_check_size(recording, &set, &cam);
            add_set(s, &set, err == -EBADMSG);
        }
        s->segment.damaged |= err == -EBADMSG;
        if (err == -EBADMSG)
            err = note_damage(s, i, cam);
        else if (err)
            sst_log_error("cannot read set %d of %s; check the disk", i, sst_recording_dir(recording));
        if (verify)
            cli_progress((void *)(uintptr_t) "verify", (i + 1.0) / s->sets);
    }
    cli_progress_end();
    end_segment(s, recording, -1);
    sst_stats_sort_int64(s->spread_ns, s->spreads);
    sst_stats_sort_int64(s->period_ns, s->periods);
    count_gaps(s);
    return err;
}

/* --- output ------------------------------------------------------------------------------------------------- */

static int worst_camera(const struct summary *s)
{
    int k = 0;

    for (int i = 1; i < s->info->cameras; i++)
        k = s->worst[i] > s->worst[k] ? i : k;
    return s->worst[k] ? k : -1;
}

static void print_cameras(const struct summary *s, const char *what, const int *count)
{
    int named = 0;

    for (int k = 0; k < s->info->cameras; k++) {
        const struct sst_recorder_track *t = &s->info->track[k];

        if (!count[k] || named++ >= MAX_NAMED)
            continue;
        printf("%s r%02d c%02d %s: %d", named == 1 ? what : ",", t->row, t->col, t->serial[0] ? t->serial : t->port,
               count[k]);
    }
    if (named)
        printf("%s\n", named > MAX_NAMED ? ", ..." : "");
}

static void print_text(const struct summary *s, const struct sst_recording *recording, bool verify)
{
    const struct sst_recording_info *i = s->info;
    const int64_t period = sst_stats_percentile(s->period_ns, s->periods, 50);
    const int worst = worst_camera(s);
    char format[5];

    sst_recording_format_name(i->fourcc, format);
    printf("%s: %d cameras on %dx%d, %s %dx%d, nominal %g Hz\n", sst_recording_dir(recording), i->cameras, i->rows,
           i->cols, format, i->width, i->height, i->rate_hz);
    printf("sets      %d in %d runs, %d complete, %d with missing or bad frames, %.3f GB\n", s->sets, s->runs,
           s->complete, s->sets - s->damaged - s->complete, (double)s->bytes * 1e-9);
    if (sst_recording_removed(recording)->before_segment)
        printf("removed   the first %llu sets, to make room\n",
               (unsigned long long)sst_recording_removed(recording)->sets);
    printf("rate      %.3f Hz (median), %d gaps, longest distance %.3f s\n", period > 0 ? 1e9 / (double)period : 0,
           s->gaps, (double)sst_stats_percentile(s->period_ns, s->periods, 100) * 1e-9);
    printf("skew      p50 %.1f us, p99 %.1f us, max %.1f us",
           (double)sst_stats_percentile(s->spread_ns, s->spreads, 50) * 1e-3,
           (double)sst_stats_percentile(s->spread_ns, s->spreads, 99) * 1e-3,
           (double)sst_stats_percentile(s->spread_ns, s->spreads, 100) * 1e-3);
    if (worst >= 0 && sst_stats_percentile(s->spread_ns, s->spreads, 100) > 0)
        printf(", most often farthest off: r%02d c%02d", i->track[worst].row, i->track[worst].col);
    printf("\n");
    print_cameras(s, "missing  ", s->missing);
    print_cameras(s, "bad      ", s->bad);
    print_cameras(s, "arrival  (frames whose time is that of arrival: the driver's stamps were of no use)", s->arrival);
    print_cameras(s, "clock    (frames whose time is later than their arrival: stamps of another clock)", s->ahead);
    printf("damage    %d sets%s\n", s->damaged, verify ? "" : " (lines and sizes; --verify reads all frames)");
    for (int d = 0; d < s->damaged && d < MAX_NAMED; d++) {
        const json_t *one = json_array_get(s->damage, (size_t)d);
        const int cam = (int)json_integer_value(json_object_get(one, "cam"));

        printf("          set %d: %s", (int)json_integer_value(json_object_get(one, "set")), cam < 0 ? "its line" : "");
        if (cam >= 0)
            printf("camera r%02d c%02d", i->track[cam].row, i->track[cam].col);
        printf("\n");
    }
    if (s->unlisted)
        printf("unlisted  %lld bytes in %d segment%s that the index, sets.jsonl, does not name%s\n",
               (long long)s->unlisted_bytes, s->unlisted, s->unlisted > 1 ? "s" : "",
               s->index_lost ? "; restore it from a copy" : ": a set that was being written");
    if (sst_recording_torn_bytes(recording))
        printf("torn end  %lld bytes of a set that was being written\n",
               (long long)sst_recording_torn_bytes(recording));
}

static json_t *cameras_to_json(const struct summary *s)
{
    json_t *list = json_array();

    for (int k = 0; k < s->info->cameras; k++) {
        const struct sst_recorder_track *t = &s->info->track[k];

        (void)json_array_append_new(list, json_pack("{s:i, s:i, s:s, s:s, s:i, s:i, s:i, s:i, s:i}", "row", t->row,
                                                    "col", t->col, "serial", t->serial, "port", t->port, "missing",
                                                    s->missing[k], "bad", s->bad[k], "by_arrival", s->arrival[k],
                                                    "after_arrival", s->ahead[k], "farthest_off", s->worst[k]));
    }
    return list;
}

static int print_json(const struct summary *s, const struct sst_recording *recording, bool verify)
{
    const int64_t period = sst_stats_percentile(s->period_ns, s->periods, 50);
    char format[5];
    json_t *root;

    sst_recording_format_name(s->info->fourcc, format);
    root = json_pack("{s:i, s:i, s:i, s:s, s:i, s:i, s:f, s:i, s:i, s:i, s:i, s:I, s:I, s:f, s:i, s:f,"
                     " s:{s:f, s:f, s:f, s:i}, s:b, s:i, s:O, s:I, s:I, s:I, s:o}",
                     "rows", s->info->rows, "cols", s->info->cols, "cameras", s->info->cameras, "pixel_format", format,
                     "width", s->info->width, "height", s->info->height, "nominal_hz", s->info->rate_hz, "sets",
                     s->sets, "runs", s->runs, "complete", s->complete, "partial", s->sets - s->damaged - s->complete,
                     "bytes", (json_int_t)s->bytes, "lost_before", (json_int_t)s->lost_before, "median_hz",
                     period > 0 ? 1e9 / (double)period : 0.0, "gaps", s->gaps, "longest_s",
                     (double)sst_stats_percentile(s->period_ns, s->periods, 100) * 1e-9, "skew_us", "p50",
                     (double)sst_stats_percentile(s->spread_ns, s->spreads, 50) * 1e-3, "p99",
                     (double)sst_stats_percentile(s->spread_ns, s->spreads, 99) * 1e-3, "max",
                     (double)sst_stats_percentile(s->spread_ns, s->spreads, 100) * 1e-3, "worst_cam", worst_camera(s),
                     "verified", verify, "damaged", s->damaged, "damage", s->damage, "torn_bytes",
                     (json_int_t)sst_recording_torn_bytes(recording), "unlisted_bytes", (json_int_t)s->unlisted_bytes,
                     "removed_sets", (json_int_t)sst_recording_removed(recording)->sets, "tracks", cameras_to_json(s));
    return cli_dump_json(root, JSON_COMPACT) ? -ENOMEM : 0;
}

static int print(const struct sst_recording *recording, bool verify, bool json)
{
    const int n = sst_recording_sets(recording);
    struct summary s = { .info = sst_recording_info(recording), .sets = n, .damage = json_array() };
    int err = -ENOMEM;

    s.spread_ns = malloc(((size_t)n + 1) * sizeof(*s.spread_ns));
    s.period_ns = malloc(((size_t)n + 1) * sizeof(*s.period_ns));
    s.unlisted = sst_recording_unlisted(recording, &s.unlisted_bytes);
    s.index_lost = s.unlisted > 1 || (s.unlisted && !n);
    if (s.spread_ns && s.period_ns && s.damage)
        err = scan(&s, recording, verify);
    if (!err && json)
        err = print_json(&s, recording, verify);
    else if (!err)
        print_text(&s, recording, verify);
    if (!err && (s.damaged || s.index_lost))
        err = -EBADMSG; /* was printed; scripts go by the exit code */
    free(s.spread_ns);
    free(s.period_ns);
    json_decref(s.damage);
    return err;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    bool json = false, verify = false;
    const struct cli_option options[] = {
        { "verify", 0, CLI_FLAG, &verify, NULL, "read all frames and compare them with their checksums" },
        { "json", 0, CLI_FLAG, &json, NULL, "one JSON object" },
    };
    struct sst_recording *recording;
    const char *dir;
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, &dir, 1, 1);
    int err;

    if (r != CLI_GO_ON)
        return r;
    err = sst_recording_open(&recording, dir);
    if (!err) {
        err = print(recording, verify, json);
        sst_recording_close(recording);
    }
    return cli_exit_code(err);
}

const struct cli_command cli_recording = { "recording", run };
