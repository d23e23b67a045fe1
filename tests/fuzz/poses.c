/* Fuzz target: poses of other programs. The first byte says which. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/posed/import/colmap_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

typedef int read_colmap_fn(struct colmap *c, const char *path);

static read_model_fn *const readers[] = { read_aos, read_nerfstudio, read_opensfm, read_geo, read_llff };
static read_colmap_fn *const colmap_readers[] = { colmap_text_cameras,   colmap_text_images,   colmap_text_points,
                                                  colmap_binary_cameras, colmap_binary_images, colmap_binary_points };

/* Integers and doubles of a binary seed, little-endian as the machine that fuzzes. */
static size_t add(uint8_t *to, size_t at, const void *data, size_t n)
{
    memcpy(to + at, data, n);
    return at + n;
}

static void seed_binary(void)
{
    const uint64_t one = 1, size[2] = { 64, 48 }, none = 0;
    const double lens[4] = { 70, 70, 32, 24 }, pose[7] = { 1, 0, 0, 0, 1, 2, 3 }, point[3] = { 0, 0, 5 }, error = 0.5;
    const uint32_t camera[2] = { 1, 1 }, image = 1, track[2] = { 1, 0 };
    uint8_t seed[256];
    size_t n = 1;

    seed[0] = 8;
    n = add(seed, add(seed, add(seed, add(seed, n, &one, 8), camera, 8), size, 16), lens, 32);
    seed_write("poses", 8, seed, n);
    seed[0] = 9;
    n = add(seed, add(seed, add(seed, add(seed, 1, &one, 8), &image, 4), pose, 56), &image, 4);
    n = add(seed, add(seed, n, "a.png", 6), &none, 8);
    seed_write("poses", 9, seed, n);
    seed[0] = 10;
    n = add(seed, add(seed, add(seed, add(seed, add(seed, 1, &one, 8), &one, 8), point, 24), "rgb", 3), &error, 8);
    n = add(seed, add(seed, n, &one, 8), track, 8);
    seed_write("poses", 10, seed, n);
}

/* A structure with IntrinsicMatrix alone. */
static void seed_matlab(void)
{
    const uint32_t head[] = { 14, 208, 6, 8, 2, 0, 5, 8, 1, 1, 1, 0, 0x40005, 24, 1, 24 }, matrix[] = { 14, 120, 6, 8, 6, 0, 5, 8, 3, 3, 1, 0, 9, 72 };
    const double k[9] = { 70, 0, 31, 0, 71, 25, 0, 0, 1 };
    const char name[24] = "IntrinsicMatrix";
    uint8_t seed[512] = { 11 };
    size_t n = 129;

    memcpy(seed + 1, "MATLAB 5.0", 10);
    memcpy(seed + 127, "IM", 2);
    n = add(seed, add(seed, add(seed, add(seed, n, head, sizeof(head)), name, 24), matrix, sizeof(matrix)), k, 72);
    seed_write("poses", 11, seed, n);
}

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char *const seeds[] = {
        "{\"images\":[{\"imagefile\":\"a.tiff\",\"M3x4\":[[1,0,0,\"2.5\"],[0,1,0,3],[0,0,1,35]]}]}",
        "{\"camera_model\":\"OPENCV\",\"w\":64,\"h\":48,\"fl_x\":70,\"fl_y\":70,\"cx\":32,\"cy\":24,\"k1\":0.1,"
        "\"applied_transform\":[[1,0,0,0],[0,1,0,0],[0,0,1,0]],\"frames\":[{\"file_path\":\"a.png\",\"transform_matrix\":"
        "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}",
        "[{\"cameras\":{\"c\":{\"projection_type\":\"brown\",\"width\":64,\"height\":48,\"focal_x\":1,\"focal_y\":1,\"c_x\":0,"
        "\"c_y\":0,\"k1\":0}},\"shots\":{\"a\":{\"camera\":\"c\",\"rotation\":[0,0,0.1],\"translation\":[1,2,3]}},"
        "\"reference_lla\":{\"latitude\":48,\"longitude\":14,\"altitude\":0},\"points\":{\"1\":{\"coordinates\":[0,0,5]}}}]",
        "EPSG:32633\na.png 450000 5350000 300 10 20 30 1 1\n# c\nb.png 450001 5350000 300 0 0 0\n",
        "\x93NUMPY\1",
        "1 OPENCV 64 48 70 70 32 24 0.1 0 0 0\n2 SIMPLE_PINHOLE 64 48 70 32 24\n",
        "1 1 0 0 0 1 2 3 1 a b.png\n1 2 -1\n2 1 0 0 0 1 2 3 1 c.png\n\n",
        "1 0 0 5 1 2 3 0.5 1 0 2 0\n",
    };
    char text[1024];

    for (int i = 0; i < (int)ARRAY_LEN(seeds); i++) {
        text[0] = (char)i;
        snprintf(text + 1, sizeof(text) - 1, "%s", seeds[i]);
        seed_write("poses", i, text, strlen(seeds[i]) + 1);
    }
    seed_binary();
    seed_matlab();
    return 0;
}

/* Accepted poses and points are finite. */
static void check(const struct model *m)
{
    for (int k = 0; k < m->count; k++) {
        const struct sst_calib_camera *c = &m->view[k].camera;

        for (int i = 0; i < 9; i++) {
            if (!isfinite(c->rotation[i]) || !isfinite(c->position_mm[i % 3]))
                abort();
        }
    }
    for (int i = 0; i < m->point_count; i++) {
        if (!isfinite(m->points[i].at_mm[0]))
            abort();
    }
}

static int fuzz_matlab(const uint8_t *data, size_t size)
{
    struct model_view v = { .width = 0 };

    if (matlab_is(data, size) && !matlab_lens(&v, data, size, "fuzz") &&
        (!(v.camera.fx > 0) || !isfinite(v.camera.cx)))
        abort();
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const struct sst_posed_import_config cfg = { .source = "fuzz", .pictures = "/nonexistent" };
    struct model m = { .cfg = &cfg, .path = "fuzz" };
    const size_t n = ARRAY_LEN(readers) + ARRAY_LEN(colmap_readers) + 1, which = size ? data[0] % n : 0;
    const char *path;
    int err;

    if (!size)
        return 0;
    if (which == n - 1)
        return fuzz_matlab(data + 1, size - 1);
    path = input_file(data + 1, size - 1);
    if (which < ARRAY_LEN(readers)) {
        err = readers[which](&m, path);
    } else {
        struct colmap_camera *camera;
        struct colmap c;

        camera = colmap_init(&c, &m) ? NULL : colmap_add_camera(&c);
        if (!camera)
            abort();
        *camera = (struct colmap_camera){ .id = 1, .width = 64, .height = 48, .lens = 1, .p = { 70, 70, 32, 24 } };
        err = colmap_readers[which - ARRAY_LEN(readers)](&c, path);
        colmap_fini(&c);
    }
    if (!err)
        check(&m);
    free(m.view);
    free(m.points);
    return 0;
}
