/* A posed light field as a folder: lightfield.json, views/, and the points beside it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "base/text.h"
#include "pipeline/kernels/sha256.h"
#include "pipeline/posed/posed_internal.h"

#define POINTS_MAGIC  "SSTPTS1\n"
#define SIGHTS_MAGIC  "SSTPTS2\n" /* of a file with sights behind the points */
#define POINTS_HEADER 16 /* bytes: magic and the count, 64 bits; all numbers little-endian */
#define POINT_BYTES   28 /* x, y, z as doubles, views in 32 bits */
#define SIGHT_BYTES   12 /* view in 32 bits, x, y as floats */
#define MOST_SIGHTS   4000000
#define POINTS_PREFIX "points-"
#define POINTS_END    ".bin"
#define PREFIX_DIGITS 16 /* of the hash in a name */

bool sst_posed_is(const char *dir)
{
    char path[SST_PATH_MAX], head[1024] = "";
    json_t *root = NULL;
    const char *kind;
    FILE *f;
    bool is;
    int fd = sst_path_join(path, dir, "lightfield.json") ? -1 : sst_file_open(path);

    if (fd < 0)
        return false;
    f = fdopen(fd, "rb");
    if (!f) {
        close(fd);
        return false;
    }
    root = json_loadf(f, 0, NULL);
    kind = json_string_value(json_object_get(root, "kind"));
    is = kind && !strcmp(kind, "posed");
    if (!root) { /* damaged: sst_posed_load() says where */
        rewind(f);
        is = fread(head, 1, sizeof(head) - 1, f) > 0 && strstr(head, "\"kind\": \"posed\"");
    }
    fclose(f);
    json_decref(root);
    return is;
}

/* --- points ------------------------------------------------------------------------------------------------------- */

static void put_bytes(uint8_t *out, uint64_t v, int n)
{
    for (int i = 0; i < n; i++)
        out[i] = (uint8_t)(v >> 8 * i);
}

static uint64_t get_bytes(const uint8_t *in, int n)
{
    uint64_t v = 0;

    for (int i = 0; i < n; i++)
        v |= (uint64_t)in[i] << 8 * i;
    return v;
}

static void put_sight(uint8_t *at, const struct sst_posed_sight *sight)
{
    uint32_t bits[2];

    memcpy(bits, &sight->x, sizeof(bits[0]));
    memcpy(bits + 1, &sight->y, sizeof(bits[1]));
    put_bytes(at, (uint32_t)sight->view, 4);
    put_bytes(at + 4, bits[0], 4);
    put_bytes(at + 8, bits[1], 4);
}

int points_write(struct points_file *file, const struct sst_posed *posed, const char *dir)
{
    const size_t n = (size_t)posed->point_count, sights = posed->sights ? (size_t)posed->sight_count : 0;
    const size_t size = POINTS_HEADER + n * POINT_BYTES + sights * SIGHT_BYTES;
    char path[SST_PATH_MAX];
    uint8_t *data;
    int err;

    *file = (struct points_file){ .count = posed->point_count };
    if (!n)
        return 0;
    data = malloc(size);
    if (!data) {
        sst_log_error("no memory for the points of %s", dir);
        return -ENOMEM;
    }
    memcpy(data, sights ? SIGHTS_MAGIC : POINTS_MAGIC, 8);
    put_bytes(data + 8, n, 8);
    for (size_t i = 0; i < n; i++) {
        uint8_t *at = data + POINTS_HEADER + i * POINT_BYTES;
        uint64_t bits[3];

        memcpy(bits, posed->points[i].at_mm, sizeof(bits));
        for (int j = 0; j < 3; j++)
            put_bytes(at + 8 * j, bits[j], 8);
        put_bytes(at + 24, (uint32_t)posed->points[i].views, 4);
    }
    for (size_t i = 0; i < sights; i++)
        put_sight(data + POINTS_HEADER + n * POINT_BYTES + i * SIGHT_BYTES, &posed->sights[i]);
    sst_sha256_hex(file->sha256, data, size);
    snprintf(file->name, sizeof(file->name), POINTS_PREFIX "%.*s" POINTS_END, PREFIX_DIGITS, file->sha256);
    err = sst_path_join(path, dir, file->name);
    err = err ? err : sst_file_write(path, data, size);
    free(data);
    return err;
}

/* @param data  of the first sight */
static int parse_sights(struct sst_posed *posed, const uint8_t *data, size_t count)
{
    posed->sights = calloc(count, sizeof(*posed->sights));
    if (!posed->sights)
        return -ENOMEM;
    posed->sight_count = (int)count;
    for (size_t i = 0; i < count; i++) {
        const uint8_t *at = data + i * SIGHT_BYTES;
        const uint32_t bits[2] = { (uint32_t)get_bytes(at + 4, 4), (uint32_t)get_bytes(at + 8, 4) };

        posed->sights[i].view = (int)(int32_t)get_bytes(at, 4);
        memcpy(&posed->sights[i].x, &bits[0], sizeof(bits[0]));
        memcpy(&posed->sights[i].y, &bits[1], sizeof(bits[1]));
    }
    return 0;
}

static int parse_points(struct sst_posed *posed, const uint8_t *data, int count)
{
    posed->points = calloc((size_t)count, sizeof(*posed->points));
    if (!posed->points)
        return -ENOMEM;
    posed->point_count = count;
    for (int i = 0; i < count; i++) {
        const uint8_t *at = data + POINTS_HEADER + (size_t)i * POINT_BYTES;
        uint64_t bits[3];

        for (int j = 0; j < 3; j++)
            bits[j] = get_bytes(at + 8 * j, 8);
        memcpy(posed->points[i].at_mm, bits, sizeof(bits));
        posed->points[i].views = (int)(int32_t)get_bytes(at + 24, 4);
    }
    return 0;
}

int points_read(struct sst_posed *posed, const struct points_file *file, const char *dir)
{
    const size_t expected = POINTS_HEADER + (size_t)file->count * POINT_BYTES;
    bool sights;
    char path[SST_PATH_MAX], hash[65];
    const char *what = NULL;
    uint8_t *data;
    size_t size;
    int err = sst_path_join(path, dir, file->name);

    err = err ? err : sst_file_read(path, expected + (size_t)MOST_SIGHTS * SIGHT_BYTES, &data, &size);
    if (err)
        return err;
    sst_sha256_hex(hash, data, size);
    sights = size > expected && (size - expected) % SIGHT_BYTES == 0;
    if ((size != expected && !sights) || memcmp(data, sights ? SIGHTS_MAGIC : POINTS_MAGIC, 8) || get_bytes(data + 8, 8) != (uint64_t)file->count)
        what = "is not of the number of points that lightfield.json names";
    else if (strcmp(hash, file->sha256))
        what = "has changed since it was stored (its SHA-256 differs)";
    if (!what)
        err = parse_points(posed, data, file->count);
    if (!what && !err && sights)
        err = parse_sights(posed, data + expected, (size - expected) / SIGHT_BYTES);
    free(data);
    if (what)
        sst_log_error("%s %s; import the pictures again", path, what);
    else if (err)
        sst_log_error("no memory for the points of %s", dir);
    return what ? -EBADMSG : err;
}

/* Points of poses that a save has replaced. */
static void remove_old_points(const char *dir, const struct points_file *current)
{
    char path[SST_PATH_MAX];
    struct dirent *e;
    DIR *d = opendir(dir);

    while (d && (e = readdir(d))) {
        if (!strncmp(e->d_name, POINTS_PREFIX, strlen(POINTS_PREFIX)) && sst_text_ends(e->d_name, POINTS_END) &&
            strcmp(e->d_name, current->name) && !sst_path_join(path, dir, e->d_name) && unlink(path))
            sst_log_warning("cannot remove %s, the points of earlier poses: %s", path, strerror(errno));
    }
    if (d)
        closedir(d);
}

/* --- the folder --------------------------------------------------------------------------------------------------- */

int sst_posed_load(struct sst_posed *posed, const char *dir)
{
    struct sst_posed made;
    struct points_file points;
    char path[SST_PATH_MAX];
    const char *fault;
    int err = sst_path_join(path, dir, "lightfield.json");

    if (err)
        return err;
    if (!sst_path_exists(path) && !sst_path_is_denied(path)) {
        sst_log_error("%s is not a light field: %s; make one with `sst import poses` or `sst import pictures`", dir,
                      sst_path_is_dir(dir)   ? "it has no lightfield.json"
                      : sst_path_exists(dir) ? "it is not a folder"
                                             : "there is no such folder");
        return -ENOENT;
    }
    err = posed_read_json(&made, &points, path);
    if (err)
        return err;
    err = points.count ? points_read(&made, &points, dir) : 0;
    fault = err ? NULL : posed_fault(&made);
    if (fault) {
        sst_log_error("%s/%s: %s; import the pictures again", dir, points.name, fault);
        err = -EBADMSG;
    }
    if (err)
        sst_posed_fini(&made);
    else
        *posed = made;
    return err;
}

int posed_read_view(char path[SST_PATH_MAX], uint8_t **data, size_t *size, const struct sst_posed_view *v,
                    const char *dir)
{
    char name[300];
    int err;

    snprintf(name, sizeof(name), "views/%s", v->file);
    err = sst_path_join(path, dir, name);
    return err ? err : sst_file_read(path, POSED_VIEW_BYTES, data, size);
}

static int hash_view(char out[65], const struct sst_posed_view *v, const char *dir)
{
    char path[SST_PATH_MAX];
    uint8_t *data;
    size_t size;
    const int err = posed_read_view(path, &data, &size, v, dir);

    if (err)
        return err;
    sst_sha256_hex(out, data, size);
    free(data);
    return 0;
}

static int write_files(struct points_file *points, const struct sst_posed *posed, const char *dir)
{
    const char *fault = posed_fault(posed);
    char path[SST_PATH_MAX], (*hashes)[65] = NULL, *json = NULL;
    int err = sst_path_join(path, dir, "lightfield.json");

    if (err)
        return err;
    if (fault) {
        sst_log_error("cannot write %s: %s", path, fault);
        return -EINVAL;
    }
    hashes = calloc((size_t)posed->count, sizeof(*hashes));
    if (!hashes)
        goto no_memory;
    for (int k = 0; !err && k < posed->count; k++)
        err = posed->view[k].sha256[0] ? 0 : hash_view(hashes[k], &posed->view[k], dir);
    err = err ? err : points_write(points, posed, dir);
    if (err)
        goto out;
    json = posed_to_json(posed, hashes, points);
    if (!json)
        goto no_memory;
    err = sst_file_write(path, json, strlen(json));

out:
    free(json);
    free(hashes);
    return err;

no_memory:
    sst_log_error("no memory to write %s, or a text in it is not UTF-8", path);
    err = -ENOMEM;
    goto out;
}

int sst_posed_write(const struct sst_posed *posed, const char *dir)
{
    struct points_file points;

    return write_files(&points, posed, dir);
}

int sst_posed_save(const struct sst_posed *posed, const char *dir)
{
    struct points_file points;
    const int err = write_files(&points, posed, dir);

    if (!err)
        remove_old_points(dir, &points);
    return err;
}
