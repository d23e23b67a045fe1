/* LLFF's poses_bounds.npy: a row of 17 numbers a picture, pictures in the order of their names. 15 are a matrix of 3 rows
 * and 5 columns: the camera's axes in the world (down, right, backwards), its centre, and height, width, focal length. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/posed/import/import_internal.h"

#define COLUMNS 17

/* Array of doubles [rows][COLUMNS] in a file. */
struct array {
    uint64_t rows;
    const uint8_t *data;
    size_t each; /* bytes of a number: 4 or 8 */
};

static bool word_at(const char *header, const char *key, const char **at)
{
    const char *p = strstr(header, key);

    *at = p ? p + strlen(key) : NULL;
    return p != NULL;
}

static const char *parse(struct array *a, const uint8_t *data, size_t size)
{
    char header[1024];
    unsigned long long rows, columns;
    const char *at;
    size_t n, begin;

    if (size < 12 || data[6] < 1 || data[6] > 3)
        return "it is too short, or of another version of the format";
    n = data[8] | (size_t)data[9] << 8;
    begin = 10;
    if (data[6] > 1) {
        n |= (size_t)data[10] << 16 | (size_t)data[11] << 24;
        begin = 12;
    }
    if (n >= sizeof(header) || n > size - begin)
        return "its header is cut off or too long";
    memcpy(header, data + begin, n);
    header[n] = '\0';
    if (strstr(header, "'<f8'"))
        a->each = 8;
    else if (strstr(header, "'<f4'"))
        a->each = 4;
    else
        return "its numbers are not little-endian floats";
    if (!word_at(header, "'fortran_order':", &at) || strncmp(at + strspn(at, " "), "False", 5))
        return "its order is not C's";
    if (!word_at(header, "'shape':", &at) || sscanf(at, " (%llu, %llu)", &rows, &columns) != 2 || columns != COLUMNS)
        return "its shape is not N rows of 17 numbers";
    if (rows != (size - begin - n) / (COLUMNS * a->each) || (size - begin - n) % (COLUMNS * a->each))
        return "its length is not that of its shape; it is damaged";
    a->rows = rows;
    a->data = data + begin + n;
    return NULL;
}

static void row(double out[COLUMNS], const struct array *a, uint64_t i)
{
    for (size_t j = 0; j < COLUMNS; j++) {
        const uint8_t *p = a->data + (i * COLUMNS + j) * a->each;
        float f;

        if (a->each == 8)
            memcpy(&out[j], p, 8);
        else
            memcpy(&f, p, 4);
        if (a->each == 4)
            out[j] = (double)f;
    }
}

static int place(struct model *m, struct model_view *v, const double p[COLUMNS])
{
    double R[9], t[3] = { 0, 0, 0 };
    const char *fault;

    for (int j = 0; j < 3; j++) {
        R[j] = p[5 * j + 1];      /* right */
        R[3 + j] = p[5 * j];      /* down */
        R[6 + j] = -p[5 * j + 2]; /* forward */
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            t[i] -= R[3 * i + j] * p[5 * j + 3];
    }
    fault = model_place(v, R, t);
    if (!fault && (!(p[4] >= 1 && p[4] <= SST_IMAGE_MAX_SIDE) || !(p[9] >= 1 && p[9] <= SST_IMAGE_MAX_SIDE)))
        fault = "height or width is not 1 to 32768";
    if (!fault && (!(p[15] > 0) || !(p[16] > p[15])))
        fault = "its bounds are not two ascending depths above 0";
    if (!fault) {
        v->height = (int)p[4];
        v->width = (int)p[9];
        fault = model_lens(v, (const double[4]){ p[14], p[14], p[9] / 2, p[4] / 2 }, NULL, 0);
    }
    return fault ? model_fault(m, v->name, fault) : 0;
}

/* Pictures beside the poses, or of the user's folder. */
static int list(struct model *m, const char *path)
{
    char dir[SST_PATH_MAX], images[SST_PATH_MAX];
    int err;

    if (m->cfg->pictures)
        return pictures_list(m, m->cfg->pictures);
    snprintf(dir, sizeof(dir), "%.*s", (int)(sst_path_base(path) - path), path);
    err = sst_path_join(images, dir[0] ? dir : ".", "images");
    return err ? err : pictures_list(m, sst_path_is_dir(images) ? images : dir[0] ? dir : ".");
}

static int read_rows(struct model *m, const char *path, const struct array *a)
{
    double p[COLUMNS];
    int err = list(m, path);

    if (!err && a->rows != (uint64_t)m->count) {
        sst_log_error("%s has poses of %llu pictures, but there are %d", path, (unsigned long long)a->rows, m->count);
        err = -EBADMSG;
    }
    for (int k = 0; !err && k < m->count; k++) {
        row(p, a, (uint64_t)k);
        err = place(m, &m->view[k], p);
    }
    return err;
}

int read_llff(struct model *m, const char *path)
{
    struct array a;
    const char *fault;
    uint8_t *data;
    size_t size;
    int err = sst_file_read(path, MODEL_BYTES, &data, &size);

    if (err)
        return err;
    m->format = "LLFF";
    m->path = path;
    fault = parse(&a, data, size);
    err = fault ? model_fault(m, "", fault) : read_rows(m, path, &a);
    free(data);
    return err;
}
