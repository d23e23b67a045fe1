/* Pictures for layered scenes: files of a folder or procedural ones, and the objects in them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/image/classes.h"
#include "pipeline/image/codec.h"
#include "simulators/scene/scene_internal.h"

#define PHOTOS         24   /* of one scene */
#define LEAVES         4096 /* places kept */
#define SIDE_MIN       32
#define WIDTH_MAX      1000 /* larger pictures are halved */
#define OBJECT_MIN     300  /* pixels */
#define OBJECTS_MAX    256
#define CAMVID_CLASSES 11

/* --- files -------------------------------------------------------------------------------------------------------- */

static int is_picture(const struct dirent *e)
{
    return sst_image_is_picture(e->d_name);
}

/* Label of a stored class: CamVid's classes in its order are the first of the default list. */
static void to_labels(struct sst_map_u8 *map)
{
    for (int y = 0; y < map->height; y++) {
        uint8_t *row = sst_map_u8_row(map, y);

        for (int x = 0; x < map->width; x++)
            row[x] = row[x] < CAMVID_CLASSES ? (uint8_t)(row[x] + 1) : SST_LABEL_NONE;
    }
}

static int read_mask(struct photo *p, const char *masks, const char *name)
{
    char path[SST_PATH_MAX];
    const int stem = (int)(strrchr(name, '.') - name);
    int err;

    if (snprintf(path, sizeof(path), "%s/%.*s.png", masks, stem, name) >= (int)sizeof(path))
        return -ENAMETOOLONG;
    err = sst_map_u8_read_png(&p->label, path);
    if (err)
        return err;
    if (p->label.width != p->image.width || p->label.height != p->image.height) {
        sst_log_error("%s: %dx%d pixels, but its picture has %dx%d; give label images of the same pictures", path,
                      p->label.width, p->label.height, p->image.width, p->image.height);
        return -EBADMSG;
    }
    to_labels(&p->label);
    return 0;
}

static int halve(struct photo *p)
{
    struct sst_image image = { 0 };
    struct sst_map_u8 label = { 0 };
    int err = sst_image_halve(&image, &p->image);

    if (!err && p->label.data)
        err = sst_map_u8_init(&label, image.width, image.height);
    if (err) {
        sst_image_fini(&image);
        return err;
    }
    for (int y = 0; y < label.height; y++) {
        for (int x = 0; x < label.width; x++)
            sst_map_u8_row(&label, y)[x] = sst_map_u8_row(&p->label, sst_min_int(2 * y, p->label.height - 1))[2 * x];
    }
    sst_image_fini(&p->image);
    sst_map_u8_fini(&p->label);
    *p = (struct photo){ image, label };
    return 0;
}

static int read_photo(struct photo *p, const struct sst_layers_config *cfg, const char *name)
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, cfg->photos, name);

    err = err ? err : sst_image_read(&p->image, path);
    if (!err && (p->image.width < SIDE_MIN || p->image.height < SIDE_MIN)) {
        sst_log_error("%s: %dx%d pixels are too few for a texture; give pictures of at least %dx%d", path,
                      p->image.width, p->image.height, SIDE_MIN, SIDE_MIN);
        err = -EBADMSG;
    }
    if (!err && cfg->masks)
        err = read_mask(p, cfg->masks, name);
    while (!err && p->image.width > WIDTH_MAX && p->image.height >= 2 * SIDE_MIN)
        err = halve(p);
    return err;
}

/* The first `n` of a random order of the folder's pictures. */
static int read_photos(struct photo_library *lib, const struct sst_layers_config *cfg, uint64_t *rng)
{
    struct dirent **names = NULL;
    const int n = scandir(cfg->photos, &names, is_picture, alphasort);
    int err = n < 0 ? -errno : n == 0 ? -ENOENT : 0;

    if (err)
        sst_log_error("%s: %s; give a folder with PNG, JPEG or TIFF pictures", cfg->photos,
                      n == 0 ? "no PNG, JPEG or TIFF file in it" : strerror(-err));
    for (int i = 0; i < sst_min_int(n, PHOTOS) && !err; i++) {
        const int other = i + (int)(sst_random(rng) * (n - i));
        struct dirent *swap = names[i];

        names[i] = names[other];
        names[other] = swap;
        err = read_photo(&lib->photos[lib->count++], cfg, names[i]->d_name);
    }
    for (int i = 0; i < n; i++)
        free(names[i]);
    free(names);
    return err;
}

/* --- procedural pictures ------------------------------------------------------------------------------------------ */

static uint8_t byte_of(double v)
{
    return (uint8_t)sst_clamp_double(v + 0.5, 0, 255);
}

/* Label of a procedural picture: wall above, road below, trees in patches, objects as upright ellipses. */
static int paint_label(int x, int y, uint32_t seed)
{
    const struct sst_vec3 p = { x / 70.0, y / 70.0, 0 };
    const int cell = x / 80;
    const double h = 40 + sst_noise_hash(cell, 1, 0, seed) % 90, foot = 230 + sst_noise_hash(cell, 2, 0, seed) % 100;
    const double u = (x % 80 - 40) / (16.0 + sst_noise_hash(cell, 3, 0, seed) % 20), v = (y - foot + h / 2) / (h / 2);

    if (u * u + v * v < 1)
        return sst_noise_hash(cell, 4, 0, seed) & 1 ? SST_LABEL_PEDESTRIAN : SST_LABEL_CAR;
    if (sst_noise_fbm(p, 2, seed + 50) > 0.58F)
        return SST_LABEL_TREE;
    return y > 250 ? SST_LABEL_ROAD : SST_LABEL_BUILDING;
}

static int paint_photo(struct photo *p, uint32_t seed)
{
    int err = sst_image_init(&p->image, 480, 360);

    err = err ? err : sst_map_u8_init(&p->label, 480, 360);
    for (int y = 0; !err && y < 360; y++) {
        for (int x = 0; x < 480; x++) {
            const int label = paint_label(x, y, seed);
            const uint32_t part = (uint32_t)label * 31 + (label == SST_LABEL_CAR || label == SST_LABEL_PEDESTRIAN
                                                              ? (uint32_t)(x / 80) * 977
                                                              : (uint32_t)(x / 120) * 13 + (uint32_t)(y / 90) * 7);
            const double grain = label == SST_LABEL_TREE ? 5 : 14;
            const double f = sst_noise_fbm((struct sst_vec3){ x / grain, y / grain, 0 }, 4, seed + part);

            sst_map_u8_row(&p->label, y)[x] = (uint8_t)label;
            for (int c = 0; c < 3; c++) {
                const double base = 40 + sst_noise_hash((int32_t)part, c, 9, seed) % 150;
                const double tint = sst_noise((struct sst_vec3){ x / 23.0, y / 23.0, 0 }, seed + 7u * (uint32_t)c);

                sst_image_row(&p->image, c, y)[x] = byte_of(base + 150 * (f - 0.5) + 40 * (tint - 0.5));
            }
        }
    }
    return err;
}

/* --- objects ------------------------------------------------------------------------------------------------------ */

static bool is_object(int label)
{
    return label == SST_LABEL_CAR || label == SST_LABEL_PEDESTRIAN || label == SST_LABEL_BICYCLIST;
}

/* Pixels reached from the first, in the order of the search. */
struct region {
    int *at;
    int count, x0, x1, y0, y1;
};

static void flood(struct region *r, const struct sst_map_u8 *label, uint8_t *seen, int start)
{
    static const int step[4][2] = { { 1, 0 }, { -1, 0 }, { 0, 1 }, { 0, -1 } };
    const int w = label->width, class = sst_map_u8_row(label, start / w)[start % w];

    *r = (struct region){ .at = r->at, .count = 1, .x0 = w, .y0 = label->height };
    r->at[0] = start;
    seen[start] = 1;
    for (int i = 0; i < r->count; i++) {
        const int x = r->at[i] % w, y = r->at[i] / w;

        r->x0 = sst_min_int(r->x0, x);
        r->x1 = sst_max_int(r->x1, x + 1);
        r->y0 = sst_min_int(r->y0, y);
        r->y1 = sst_max_int(r->y1, y + 1);
        for (int k = 0; k < 4; k++) {
            const int nx = x + step[k][0], ny = y + step[k][1];

            if (nx < 0 || ny < 0 || nx >= w || ny >= label->height || seen[ny * w + nx] ||
                sst_map_u8_row(label, ny)[nx] != class)
                continue;
            seen[ny * w + nx] = 1;
            r->at[r->count++] = ny * w + nx;
        }
    }
}

/* Keep a region that lies inside the picture and fills a good part of its box. */
static int keep_object(struct photo_library *lib, const struct photo *p, const struct region *r)
{
    const int w = r->x1 - r->x0, h = r->y1 - r->y0, stride = p->label.width;
    struct photo_object *o = &lib->objects[lib->object_count];
    int err;

    if (lib->object_count == OBJECTS_MAX || r->count < OBJECT_MIN || r->count * 3 < w * h || r->x0 == 0 ||
        r->x1 == stride)
        return 0;
    *o = (struct photo_object){
        .photo = p, .label = sst_map_u8_row(&p->label, r->at[0] / stride)[r->at[0] % stride], .x = r->x0, .y = r->y0
    };
    err = sst_map_u8_init(&o->mask, w, h);
    if (err)
        return err;
    for (int i = 0; i < r->count; i++)
        sst_map_u8_row(&o->mask, r->at[i] / stride - r->y0)[r->at[i] % stride - r->x0] = 255;
    lib->object_count++;
    return 0;
}

static int find_objects(struct photo_library *lib, const struct photo *p)
{
    const int n = p->label.width * p->label.height;
    uint8_t *seen = calloc((size_t)n, 1);
    struct region r = { .at = malloc((size_t)n * sizeof(int)) };
    int err = seen && r.at ? 0 : -ENOMEM;

    for (int i = 0; i < n && !err; i++) {
        const int label = sst_map_u8_row(&p->label, i / p->label.width)[i % p->label.width];

        if (seen[i] || !is_object(label))
            continue;
        flood(&r, &p->label, seen, i);
        err = keep_object(lib, p, &r);
    }
    free(r.at);
    free(seen);
    return err;
}

static int by_area(const void *a, const void *b)
{
    const struct photo_object *o = a, *p = b;
    const int d = p->mask.width * p->mask.height - o->mask.width * o->mask.height;

    return d ? d : o->photo != p->photo ? (o->photo < p->photo ? -1 : 1) : o->y != p->y ? o->y - p->y : o->x - p->x;
}

static void find_leaves(struct photo_library *lib, uint64_t *rng, bool any)
{
    for (int i = 0; i < 40 * LEAVES && lib->leaf_count < LEAVES; i++) {
        const struct photo *p = &lib->photos[(int)(sst_random(rng) * lib->count)];
        const int x = (int)(sst_random(rng) * p->image.width), y = (int)(sst_random(rng) * p->image.height);

        if (any || (p->label.data && sst_map_u8_row(&p->label, y)[x] == SST_LABEL_TREE))
            lib->leaves[lib->leaf_count++] = (struct photo_point){ p, x, y };
    }
}

/* --- public ------------------------------------------------------------------------------------------------------- */

int photo_library_init(struct photo_library *lib, const struct sst_layers_config *cfg, uint64_t seed)
{
    uint64_t rng = seed;
    int err;

    *lib = (struct photo_library){ .photos = calloc(PHOTOS, sizeof(*lib->photos)),
                                   .objects = calloc(OBJECTS_MAX, sizeof(*lib->objects)),
                                   .leaves = calloc(LEAVES, sizeof(*lib->leaves)) };
    err = lib->photos && lib->objects && lib->leaves ? 0 : -ENOMEM;
    if (!err && cfg->photos)
        err = read_photos(lib, cfg, &rng);
    while (!err && !cfg->photos && lib->count < PHOTOS / 3)
        err = paint_photo(&lib->photos[lib->count++], (uint32_t)sst_random_u64(&rng));
    for (int i = 0; i < lib->count && !err; i++)
        err = lib->photos[i].label.data ? find_objects(lib, &lib->photos[i]) : 0;
    if (err) {
        photo_library_fini(lib);
        return err;
    }
    if (lib->object_count)
        qsort(lib->objects, (size_t)lib->object_count, sizeof(*lib->objects), by_area);
    find_leaves(lib, &rng, false);
    if (lib->leaf_count < LEAVES / 16)
        find_leaves(lib, &rng, true);
    return 0;
}

void photo_library_fini(struct photo_library *lib)
{
    for (int i = 0; i < lib->object_count; i++)
        sst_map_u8_fini(&lib->objects[i].mask);
    for (int i = 0; i < lib->count; i++) {
        sst_map_u8_fini(&lib->photos[i].label);
        sst_image_fini(&lib->photos[i].image);
    }
    free(lib->leaves);
    free(lib->objects);
    free(lib->photos);
    *lib = (struct photo_library){ 0 };
}
