/* Fuzz target: a recording of which one file is the input; its first byte says which. Checksums of lines are put right
 * first: with wrong ones nothing is read. All sets and frames are read, then the recording is resumed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>

#include <linux/videodev2.h>
#include <zlib.h>

#include "capture/recording/recording_internal.h"
#include "tests/fuzz/seeds.h"
#include "tests/synthetic_sets.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define FILES 4
#define SETS  6

static const char *const names[FILES] = { "recording.json", "sets.jsonl", "segments/000000.mkv", "removed.json" };
static uint8_t *original[FILES];
static size_t bytes[FILES];
static struct synthetic array = {
    .cameras = 3, .fourcc = V4L2_PIX_FMT_MJPEG, .width = 8, .height = 6, .bytes = 40, .period_ns = 100000000
};
static char dir[64];

static void remove_all(void)
{
    char path[SST_PATH_MAX];

    for (int i = 0; i < FILES; i++) {
        snprintf(path, sizeof(path), "%s/%s", dir, names[i]);
        (void)unlink(path);
    }
    snprintf(path, sizeof(path), "%s/segments", dir);
    (void)rmdir(path);
    (void)rmdir(dir);
}

static void make_folder(void)
{
    char path[SST_PATH_MAX], *folder = input_template();

    if (!mkdtemp(folder))
        abort();
    snprintf(dir, sizeof(dir), "%s", folder);
    snprintf(path, sizeof(path), "%s/segments", dir);
    (void)mkdir(path, 0777);
}

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char removed[] = "{\"before_segment\": 1, \"sets\": 2, \"t_ns\": 5000000000000, \"wall_ns\": 1}\n";
    struct sst_recorder_config cfg;
    struct sst_recorder *r;
    char path[SST_PATH_MAX];

    make_folder();
    remove_all(); /* the recorder makes it */
    synthetic_init(&array);
    cfg = synthetic_config(&array, dir);
    if (sst_recorder_open(&r, &cfg))
        abort();
    for (int i = 0; i < SETS; i++) {
        struct sst_frameset set;

        synthetic_set(&array, (uint64_t)i, &set);
        if (sst_recorder_write(r, &set))
            abort();
    }
    if (sst_recorder_close(r))
        abort();
    for (int i = 0; i < FILES; i++) {
        uint8_t *seed;

        snprintf(path, sizeof(path), "%s/%s", dir, names[i]);
        if (i < 3 && sst_file_read(path, 1 << 20, &original[i], &bytes[i]))
            abort();
        seed = malloc(bytes[i] + sizeof(removed) + 1);
        if (!seed)
            abort();
        seed[0] = (uint8_t)i;
        memcpy(seed + 1, i < 3 ? original[i] : (const uint8_t *)removed, i < 3 ? bytes[i] : strlen(removed));
        seed_write("recording", i, seed, 1 + (i < 3 ? bytes[i] : strlen(removed)));
        free(seed);
    }
    remove_all();
    return 0;
}

static void put_checksums(char *text, size_t n)
{
    static const char mark[] = ",\"crc\":\"";
    char *line = text;

    for (char *end; (end = memchr(line, '\n', n - (size_t)(line - text))); line = end + 1) {
        char *at = memmem(line, (size_t)(end - line), mark, strlen(mark)), hex[9];

        if (!at || end - at < (long)strlen(mark) + 8)
            continue;
        snprintf(hex, sizeof(hex), "%08lx", crc32(0, (const uint8_t *)line, (unsigned)(at - line)));
        memcpy(at + strlen(mark), hex, 8);
    }
}

static void write_files(int which, const uint8_t *data, size_t size)
{
    for (int i = 0; i < FILES; i++) {
        const size_t n = i == which ? size : bytes[i];
        uint8_t *copy = malloc(n + 1);
        char path[SST_PATH_MAX];
        FILE *f;

        if (!copy)
            abort();
        memcpy(copy, i == which ? data : original[i] ? original[i] : copy, n);
        if (i == 1)
            put_checksums((char *)copy, n);
        snprintf(path, sizeof(path), "%s/%s", dir, names[i]);
        (void)unlink(path);
        if (i == which || original[i]) {
            f = fopen(path, "wb");
            if (!f || (n && fwrite(copy, 1, n, f) != n) || fclose(f))
                abort();
        }
        free(copy);
    }
}

static void read_all(const struct sst_recording *r)
{
    const int n = sst_recording_sets(r);
    int64_t unlisted;

    (void)sst_recording_torn_bytes(r);
    (void)sst_recording_unlisted(r, &unlisted);
    for (int i = 0; i < n && i < 50; i++) {
        static struct sst_recording_set set;
        struct sst_recording_one one;
        char *line;
        int cam;

        if (sst_recording_check(r, i, &cam) && (cam < -1 || cam >= SST_CAMERAS_MAX))
            abort();
        if (!sst_recording_line(r, i, &line))
            free(line);
        if (sst_recording_set(r, i, &set))
            continue;
        for (cam = 0; cam < sst_recording_info(r)->cameras; cam++) {
            uint8_t *data;
            size_t size;

            if (!sst_recording_picture(r, &set, cam, &data, &size))
                free(data);
            if (sst_recording_frame_of(r, i, cam, &one))
                continue;
        }
    }
    if (!sst_recording_near(r, SYNTHETIC_WALL_NS, INT64_MAX, &(int){ 0 }) && n <= 0)
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sst_recorder_config cfg = synthetic_config(&array, dir);
    struct resume_point point;
    struct sst_recording *r;
    char path[SST_PATH_MAX];
    int fd;

    if (!size)
        return 0;
    make_folder();
    write_files(data[0] % FILES, data + 1, size - 1);
    if (!sst_recording_open(&r, dir)) {
        read_all(r);
        sst_recording_close(r);
    }
    snprintf(path, sizeof(path), "%s/%s", dir, names[1]);
    fd = open(path, O_RDWR | O_CLOEXEC);
    if (fd >= 0 && !resume_prepare(&point, &cfg, fd) && point.segment < 0)
        abort();
    if (fd >= 0)
        close(fd);
    remove_all();
    return 0;
}
