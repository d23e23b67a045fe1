/* COLMAP's models in binary: little-endian, without padding; a count, then that many entries. A count beyond the
 * length of its file is refused before memory is allocated. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/posed/import/colmap_internal.h"

#define IMAGE_BYTES 73 /* of an entry at least: with an empty name and no features */
#define POINT_BYTES 51 /* with an empty track */
#define FEATURE     24
#define TRACK       8

struct bytes {
    const struct model *m;
    uint8_t *data;
    size_t size, at;
    bool short_of; /* more was asked for than there is */
};

static int bytes_open(struct bytes *b, const struct model *m, const char *path)
{
    *b = (struct bytes){ .m = m };
    return sst_file_read(path, MODEL_BYTES, &b->data, &b->size);
}

static uint64_t whole(struct bytes *b, size_t n)
{
    uint64_t v = 0;

    if (n > b->size - b->at) {
        b->short_of = true;
        b->at = b->size;
        return 0;
    }
    for (size_t i = 0; i < n; i++)
        v |= (uint64_t)b->data[b->at + i] << 8 * i;
    b->at += n;
    return v;
}

static void numbers(struct bytes *b, double *out, int n)
{
    for (int i = 0; i < n; i++) {
        const uint64_t v = whole(b, 8);

        memcpy(&out[i], &v, 8);
    }
}

static void skip(struct bytes *b, uint64_t count, size_t each)
{
    if (count > (b->size - b->at) / each) {
        b->short_of = true;
        b->at = b->size;
    } else {
        b->at += (size_t)count * each;
    }
}

/* The count at the beginning. */
static int read_count(struct bytes *b, uint64_t *count, size_t least)
{
    *count = whole(b, 8);
    if (!b->short_of && *count <= (b->size - b->at) / least)
        return 0;
    if (b->short_of)
        sst_log_error("%s is too short for a file of COLMAP", b->m->path);
    else
        sst_log_error("%s names %llu entries, more than it can hold; it is damaged", b->m->path,
                      (unsigned long long)*count);
    return -EBADMSG;
}

static int check_end(const struct bytes *b, int err)
{
    if (!err && (b->short_of || b->at != b->size)) {
        sst_log_error("%s %s; it is damaged", b->m->path,
                      b->short_of ? "ends before its last entry" : "goes on after its last entry");
        err = -EBADMSG;
    }
    return err;
}

int colmap_binary_cameras(struct colmap *c, const char *path)
{
    struct bytes b;
    uint64_t count = 0;
    int err = bytes_open(&b, c->m, path);

    if (err)
        return err;
    err = read_count(&b, &count, 24);
    for (uint64_t i = 0; !err && !b.short_of && i < count; i++) {
        struct colmap_camera *camera = colmap_add_camera(c);

        if (!camera) {
            err = -ENOMEM;
            break;
        }
        camera->id = (int64_t)whole(&b, 4);
        camera->lens = (int)(int32_t)whole(&b, 4);
        camera->width = (int64_t)whole(&b, 8);
        camera->height = (int64_t)whole(&b, 8);
        if (!b.short_of && colmap_parameters(camera->lens) < 0) {
            sst_log_error("%s: the camera model number %d is not known", path, camera->lens);
            err = -EBADMSG;
        } else if (!b.short_of) {
            numbers(&b, camera->p, colmap_parameters(camera->lens));
        }
    }
    err = check_end(&b, err);
    free(b.data);
    return err;
}

static int read_image(struct bytes *b, struct colmap *c)
{
    struct colmap_image image;
    const uint8_t *name, *end;

    image.id = (int64_t)whole(b, 4);
    numbers(b, image.q, 4);
    numbers(b, image.t, 3);
    image.camera = (int64_t)whole(b, 4);
    name = b->data + b->at;
    end = memchr(name, 0, b->size - b->at);
    if (!end) {
        b->short_of = true;
        return 0;
    }
    if (end == name || (size_t)(end - name) >= sizeof(image.name))
        return model_fault(c->m, "", "a name is empty or too long");
    memcpy(image.name, name, (size_t)(end - name) + 1);
    b->at += (size_t)(end - name) + 1;
    skip(b, whole(b, 8), FEATURE);
    return b->short_of ? 0 : colmap_add_image(c, &image);
}

int colmap_binary_images(struct colmap *c, const char *path)
{
    struct bytes b;
    uint64_t count = 0;
    int err = bytes_open(&b, c->m, path);

    if (err)
        return err;
    err = read_count(&b, &count, IMAGE_BYTES);
    for (uint64_t i = 0; !err && !b.short_of && i < count; i++)
        err = read_image(&b, c);
    err = check_end(&b, err);
    free(b.data);
    return err;
}

static int read_point(struct bytes *b, struct colmap *c, bool keep)
{
    struct colmap_point p = { .views = 0 };
    uint64_t track;

    (void)whole(b, 8); /* its number */
    numbers(b, p.at, 3);
    (void)whole(b, 3); /* its colour */
    numbers(b, &p.error, 1);
    track = whole(b, 8);
    if (b->short_of || track > (b->size - b->at) / TRACK) {
        b->short_of = true;
        return 0;
    }
    for (uint64_t i = 0; i < track; i++) {
        const int64_t image = (int64_t)whole(b, 4);

        (void)whole(b, 4); /* the feature */
        colmap_observe(c, image, p.at);
    }
    p.views = track < INT32_MAX ? (int)track : INT32_MAX;
    return keep ? colmap_add_point(c, &p) : 0;
}

int colmap_binary_points(struct colmap *c, const char *path)
{
    struct bytes b;
    uint64_t count = 0;
    int err = bytes_open(&b, c->m, path);

    if (err)
        return err;
    err = read_count(&b, &count, POINT_BYTES);
    err = err ? err : colmap_reserve(c, count);
    for (uint64_t i = 0; !err && !b.short_of && i < count; i++)
        err = read_point(&b, c, model_keeps_point(i, count));
    err = check_end(&b, err);
    free(b.data);
    return err;
}
