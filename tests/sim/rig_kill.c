/*
 * sst capture rig, killed with SIGKILL at random moments and started again, on simulated drives and cameras: a line of
 * the manifest never lies, and in the end every view fits its line, by the strip in its picture. Argument: how
 * many kills; more than 10 take a whole grid of 36 views. Runs itself in sst-sim.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <jansson.h>
#include <sha2.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "pipeline/image/codec.h"
#include "tests/strip_read.h"

#define KILLS       3
#define RUN_LIMIT_S 120

static char dir[64], bus[64];
static int rows = 2, cols = 3;

static void fail(const char *what, const char *where)
{
    fprintf(stderr, "FAIL: %s: %s (kept: %s)\n", what, where, dir);
    exit(1);
}

/* A session with one small camera and the drives on a free port, told by the session's status. */
static void enter_session(char **argv)
{
    const char *build = getenv("SST_BUILD") ? getenv("SST_BUILD") : "build";
    char path[512];
    const char *const args[] = { path,    "--quiet",    "--world", "simulators/scene/world/worlds/small-rig.yaml",
                                 "--rig", "--rig-port", "0",       "--",
                                 argv[0], argv[1],      NULL };

    snprintf(path, sizeof(path), "%s/sst-sim", build);
    if (!WITH_MODBUS || !WITH_UDEV || access(path, X_OK)) {
        puts("built without libmodbus, libudev or the simulator");
        exit(77);
    }
    execv(path, (char *const *)(uintptr_t)args);
    fail("exec", path);
}

static void read_bus(void)
{
    const char *build = getenv("SST_BUILD") ? getenv("SST_BUILD") : "build";
    char command[600];
    const char *tcp;
    json_t *status;
    FILE *p;

    snprintf(command, sizeof(command), "LD_PRELOAD= %s/sst-sim status --json", build);
    p = popen(command, "r");
    status = p ? json_loadf(p, JSON_DISABLE_EOF_CHECK, NULL) : NULL;
    tcp = json_string_value(json_object_get(json_object_get(status, "rig"), "tcp"));
    if (!tcp)
        fail("no rig in the status of", command);
    snprintf(bus, sizeof(bus), "%s", tcp);
    json_decref(status);
    (void)pclose(p);
}

static pid_t start_capture(void)
{
    const char *build = getenv("SST_BUILD") ? getenv("SST_BUILD") : "build";
    char path[512], grid[16];
    const pid_t pid = fork();

    if (pid)
        return pid;
    snprintf(path, sizeof(path), "%s/sst", build);
    snprintf(grid, sizeof(grid), "%dx%d", rows, cols);
    (void)!freopen("/dev/null", "w", stdout);
    execl(path, path, "capture", "rig", "--grid", grid, "--pitch", "3mm", "--backlash", "0.3", "--bus", bus,
          "--profile", "sst-sim", "--camera", "SIM0000", "--size", "320x240", "--speed", "300", "--accel", "2000",
          "--settle", "20", "--guard", "5", "-o", dir, (char *)NULL);
    _exit(127);
}

/* @return exit status, or -1: it ran too long, or a signal ended it */
static int end_of(pid_t pid, int64_t until_ns)
{
    const struct timespec step = { .tv_nsec = 5000000 };
    int status;

    while (waitpid(pid, &status, WNOHANG) == 0) {
        if (sst_clock_now_ns() >= until_ns) {
            kill(pid, SIGKILL);
            (void)waitpid(pid, &status, 0);
            return -1;
        }
        (void)nanosleep(&step, NULL);
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* --- files on disk ------------------------------------------------------------------------------------------------ */

static void check_hash(const char *file, const char *sha256)
{
    char path[256], hash[SHA256_DIGEST_STRING_LENGTH];

    snprintf(path, sizeof(path), "%s/views/%s", dir, file);
    if (!SHA256File(path, hash) || strcmp(hash, sha256) != 0)
        fail("a view is not what its line says", path);
}

static void check_strip(json_t *line, const char *file)
{
    struct sst_image image = { 0 };
    struct sst_sim_exposure e;
    char path[256];

    snprintf(path, sizeof(path), "%s/views/%s", dir, file);
    if (sst_image_read(&image, path) || strip_read(image.plane[1], image.stride, image.width, image.height, &e))
        fail("no picture with a strip", path);
    for (size_t a = 0; a < 2; a++) {
        const json_int_t read = json_integer_value(json_array_get(json_object_get(line, "read_um"), a));

        if (llabs(read - e.pose_um[a]) > 10)
            fail("taken at another pose than its line says", path);
    }
    if (e.cam != 0 || llabs(json_integer_value(json_object_get(line, "t_ns")) - e.t_ns) > 2000000)
        fail("another camera or time than its line says", path);
    sst_image_fini(&image);
}

/* Every whole line is true. @return views that have one */
static int check_manifest(bool strips)
{
    bool seen[256] = { false };
    char path[256], *text;
    uint8_t *data;
    size_t size;
    int views = 0;

    snprintf(path, sizeof(path), "%s/capture.jsonl", dir);
    if (!sst_path_exists(path))
        return 0;
    if (sst_file_read(path, (size_t)1 << 20, &data, &size))
        fail("cannot read", path);
    text = (char *)data;
    for (char *end; (end = strchr(text, '\n')); text = end + 1) {
        json_t *line = json_loadb(text, (size_t)(end - text), 0, NULL);
        const char *file = json_string_value(json_object_get(line, "file"));
        const json_int_t view = json_integer_value(json_object_get(line, "view"));

        if (!line)
            fail("a broken line in the middle of", path);
        if (file) {
            check_hash(file, json_string_value(json_object_get(line, "sha256")));
            if (strips)
                check_strip(line, file);
            views += !seen[view];
            seen[view] = true;
        }
        json_decref(line);
    }
    free(data);
    return views;
}

static void finish(void)
{
    char path[256];
    const int rc = end_of(start_capture(), sst_clock_now_ns() + RUN_LIMIT_S * INT64_C(1000000000));

    if (rc)
        fail("the last run did not complete", rc < 0 ? "time" : "exit status");
    if (check_manifest(true) != rows * cols)
        fail("views are missing in", "the manifest");
    snprintf(path, sizeof(path), "%s/lightfield.json", dir);
    if (!sst_path_exists(path))
        fail("no", path);
    sst_path_remove_tree(dir);
}

int main(int argc, char **argv)
{
    const int kills = argc > 1 ? atoi(argv[1]) : KILLS;
    int killed = 0, captures = 1, before = 0;
    unsigned seed = (unsigned)time(NULL);

    if (!getenv("SST_SIM_DIR"))
        enter_session(argv);
    if (kills > 10)
        rows = cols = 6;
    printf("seed %u\n", seed);
    (void)fflush(stdout);
    read_bus();
    strcpy(dir, "/tmp/sst-rig-kill-XXXXXX");
    if (!mkdtemp(dir))
        fail("no folder", dir);
    while (killed < kills) {
        const int64_t life_ns = (100 + rand_r(&seed) % 1900) * INT64_C(1000000);
        const int rc = end_of(start_capture(), sst_clock_now_ns() + life_ns);
        const int views = check_manifest(false);

        if (rc > 0)
            fail("a run ended by itself", "not complete");
        if (views < before)
            fail("views were lost in", dir);
        before = views;
        if (rc == 0) { /* complete: another one */
            finish();
            before = 0;
            captures++;
        } else {
            killed++;
        }
    }
    finish();
    printf("%d kills in %d captures of %d views\n", killed, captures, rows * cols);
    return 0;
}
