/* Fuzz target: recording.json, and single lines of sets.jsonl. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "capture/recording/recording_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define CAMERAS 3

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    const struct sst_recorder_track track[CAMERAS] = { { 0, 0, "A", "1-1", "n" },
                                                       { 0, 1, "B", "", "" },
                                                       { 1, 0, "C", "", "" } };
    struct sst_frame frame[CAMERAS] = { { .bytes = 40, .t_ns = 5000000001000, .arrival_ns = 5000000002000 } };
    struct sst_frameset set = { .index = 7,
                                .t_ns = 5000000000000,
                                .wall_ns = 1700000000000000000,
                                .edge = true,
                                .cameras = CAMERAS,
                                .skew = { 3999, -2000, 0 },
                                .frame = { &frame[0], NULL, &frame[2] } };
    const int64_t offset[SST_CAMERAS_MAX] = { 100, -1, 200 };
    const uint32_t crc[SST_CAMERAS_MAX] = { 1, 2, 3 };
    struct sst_recorder_config cfg;
    char text[MANIFEST_LINE_MAX], path[64];
    FILE *f;
    size_t n;

    frame[2] = frame[0];
    frame[2].cam = 2;
    n = manifest_set_line(text, &set, offset, crc);
    seed_write("record_lines", 0, text, n - 1);
    n = manifest_segment_line(text, 3, 1, set.t_ns, set.wall_ns);
    seed_write("record_lines", 1, text, n - 1);
    sst_recorder_config_defaults(&cfg);
    cfg.rows = cfg.cols = 2;
    cfg.cameras = CAMERAS;
    cfg.tracks = track;
    cfg.fourcc = sst_recording_format_parse("MJPG");
    cfg.width = 8;
    cfg.height = 6;
    cfg.rate_hz = 10;
    snprintf(path, sizeof(path), "/tmp/sst-fuzz-%d.json", (int)getpid());
    if (manifest_write_info(path, &cfg) || !(f = fopen(path, "rb")))
        return 0;
    n = fread(text, 1, sizeof(text), f);
    fclose(f);
    (void)unlink(path);
    seed_write("record_lines", 2, text, n);
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct manifest_segment segment;
    struct sst_recording_set set;
    struct sst_recording_info info;
    struct sst_recording_frame frame;
    char *line = malloc(size + 1);
    int64_t wall_ns;
    int kind;

    if (!line)
        abort();
    memcpy(line, data, size);
    line[size] = 0;
    (void)manifest_line_whole(line, size);
    kind = manifest_parse(line, size, CAMERAS, &segment, &set);
    if (kind == 1)
        for (int i = 0; i < CAMERAS; i++)
            if (set.frame[i].present && (set.frame[i].offset < -1 || set.frame[i].bytes > INT32_MAX))
                abort();
    if (manifest_parse(line, size, SST_CAMERAS_MAX, &segment, NULL) > 1)
        abort();
    for (int cam = 0; cam < CAMERAS; cam++)
        if (!manifest_parse_frame(line, cam, &wall_ns, &frame) && frame.present && frame.bytes > INT32_MAX)
            abort();
    free(line);
    if (!manifest_read_info(input_file(data, size), &info) &&
        (info.cameras < 1 || info.cameras > SST_CAMERAS_MAX || info.width < 1 || info.height < 1))
        abort();
    return 0;
}
