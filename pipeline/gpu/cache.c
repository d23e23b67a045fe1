/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/gpu/gpu_internal.h"


struct header {
    char magic[8];
    uint64_t key, bytes, hash; /* of the data that follows */
};

static const char magic[8] = "sstpipe1";

uint64_t gpu_hash(uint64_t hash, const void *data, size_t bytes)
{
    const uint8_t *p = data;

    for (size_t i = 0; i < bytes; i++)
        hash = (hash ^ p[i]) * 1099511628211U;
    return hash;
}

/* The folder, created where it is missing. @return false: there is none */
static bool find_folder(char out[SST_PATH_MAX])
{
    const char *cache = getenv("XDG_CACHE_HOME"), *home = getenv("HOME");
    char parent[SST_PATH_MAX];

    if (cache && *cache == '/')
        snprintf(parent, sizeof(parent), "%s", cache);
    else if (!access("/var/cache/sst", W_OK))
        snprintf(parent, sizeof(parent), "/var/cache");
    else if (home && *home == '/')
        snprintf(parent, sizeof(parent), "%.*s/.cache", SST_PATH_MAX - 16, home);
    else
        return false;
    if (sst_path_join(out, parent, "sst"))
        return false;
    (void)mkdir(parent, 0700);
    (void)mkdir(out, 0700);
    return !access(out, W_OK);
}

static bool find_file(char out[SST_PATH_MAX], const char *kind, uint64_t key)
{
    char folder[SST_PATH_MAX], name[64];

    snprintf(name, sizeof(name), "%s-%016" PRIx64 ".bin", kind, key);
    return find_folder(folder) && !sst_path_join(out, folder, name);
}

static bool fits(const uint8_t *file, size_t size, uint64_t key)
{
    struct header h;

    if (size < sizeof(h))
        return false;
    memcpy(&h, file, sizeof(h));
    return !memcmp(h.magic, magic, sizeof(magic)) && h.key == key && h.bytes == size - sizeof(h) &&
           h.hash == gpu_hash(GPU_HASH_START, file + sizeof(h), size - sizeof(h));
}

void *gpu_cache_read(const char *kind, uint64_t key, size_t *bytes)
{
    char path[SST_PATH_MAX], text[SST_LOG_MAX], *const held = sst_log_hold_errors(text);
    uint8_t *file = NULL;
    size_t size = 0;
    const bool found = find_file(path, kind, key) && sst_path_exists(path);
    const int err = found ? sst_file_read(path, sizeof(struct header) + GPU_CACHE_BYTES_MAX, &file, &size) : -ENOENT;

    sst_log_hold_errors(held);
    if (!found)
        return NULL;
    if (err || !fits(file, size, key)) {
        free(file);
        sst_log_warning("%s is damaged and removed: shaders are compiled and tested again", path);
        (void)unlink(path);
        return NULL;
    }
    *bytes = size - sizeof(struct header);
    memmove(file, file + sizeof(struct header), *bytes);
    return file;
}

static int64_t changed_ns(const char *path)
{
    struct stat st;

    return stat(path, &st) ? 0 : st.st_mtim.tv_sec * (int64_t)1000000000 + st.st_mtim.tv_nsec;
}

/* Remove the oldest file of a kind if there are more than GPU_CACHE_FILES: a call adds at most one. */
static void remove_oldest(const char *folder, const char *kind)
{
    char oldest[SST_PATH_MAX] = "", path[SST_PATH_MAX];
    int64_t oldest_ns = INT64_MAX;
    DIR *d = opendir(folder);
    int n = 0;

    for (struct dirent *e; d && (e = readdir(d));) {
        if (strncmp(e->d_name, kind, strlen(kind)) || sst_path_join(path, folder, e->d_name))
            continue;
        n++;
        if (changed_ns(path) < oldest_ns) {
            oldest_ns = changed_ns(path);
            memcpy(oldest, path, sizeof(oldest));
        }
    }
    if (d)
        closedir(d);
    if (n > GPU_CACHE_FILES)
        (void)unlink(oldest);
}

void gpu_cache_write(const char *kind, uint64_t key, const void *data, size_t bytes)
{
    struct header h = { .key = key, .bytes = bytes, .hash = gpu_hash(GPU_HASH_START, data, bytes) };
    char path[SST_PATH_MAX], folder[SST_PATH_MAX], text[SST_LOG_MAX], *held;
    uint8_t *file;

    if (bytes > GPU_CACHE_BYTES_MAX || !find_folder(folder) || !find_file(path, kind, key))
        return;
    file = malloc(sizeof(h) + bytes);
    if (!file)
        return;
    memcpy(h.magic, magic, sizeof(magic));
    memcpy(file, &h, sizeof(h));
    memcpy(file + sizeof(h), data, bytes);
    held = sst_log_hold_errors(text);
    if (sst_file_write(path, file, sizeof(h) + bytes))
        sst_log_debug("%s are not kept: %s", kind, text);
    sst_log_hold_errors(held);
    free(file);
    remove_oldest(folder, kind);
}
