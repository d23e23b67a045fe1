/* COLMAP's models as text: one line a camera and point, two lines an image; lines with # are comments. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/posed/import/colmap_internal.h"

/* Lines of a file. */
struct lines {
    const struct model *m;
    char *text, *next; /* next: NULL at the end */
    char *at;          /* next character to read in the line */
    int number;        /* from 1 */
};

static int lines_open(struct lines *l, const struct model *m, const char *path)
{
    uint8_t *text;
    size_t size;
    const int err = sst_file_read(path, MODEL_BYTES, &text, &size);

    if (err)
        return err;
    *l = (struct lines){ .m = m, .text = (char *)text, .next = (char *)text + (strncmp((char *)text, "\xef\xbb\xbf", 3) ? 0 : 3) };
    return 0;
}

/* Cut the next line off. */
static bool next_line(struct lines *l)
{
    char *end;

    if (!l->next)
        return false;
    l->at = l->next;
    end = strchr(l->at, '\n');
    l->next = end ? end + 1 : NULL;
    if (end)
        *end = '\0';
    end = l->at + strlen(l->at);
    if (end > l->at && end[-1] == '\r')
        end[-1] = '\0';
    l->number++;
    return true;
}

/* The next line that is neither empty nor a comment. */
static bool next_entry(struct lines *l)
{
    while (next_line(l)) {
        const char *p = l->at + strspn(l->at, " \t");

        if (*p && *p != '#')
            return true;
    }
    return false;
}

static int line_fault(const struct lines *l, const char *what)
{
    sst_log_error("%s:%d: %s", l->m->path, l->number, what);
    return -EBADMSG;
}

static bool word(struct lines *l, char *out, size_t size)
{
    size_t n;

    l->at += strspn(l->at, " \t");
    n = strcspn(l->at, " \t");
    if (!n || n >= size)
        return false;
    memcpy(out, l->at, n);
    out[n] = '\0';
    l->at += n;
    return true;
}

static bool numbers(struct lines *l, double *out, int n)
{
    for (int i = 0; i < n; i++) {
        char *end;

        out[i] = strtod(l->at, &end);
        if (end == l->at || (*end && *end != ' ' && *end != '\t'))
            return false;
        l->at = end;
    }
    return true;
}

static bool whole(struct lines *l, int64_t *out, int n)
{
    for (int i = 0; i < n; i++) {
        double v;

        if (!numbers(l, &v, 1) || !(v >= -1 && v <= 9e15) || v != floor(v))
            return false;
        out[i] = (int64_t)v;
    }
    return true;
}

int colmap_text_cameras(struct colmap *c, const char *path)
{
    struct lines l;
    int err = lines_open(&l, c->m, path);

    if (err)
        return err;
    while (!err && next_entry(&l)) {
        struct colmap_camera *camera = colmap_add_camera(c);
        char lens[64];
        int64_t v[2];

        if (!camera) {
            err = -ENOMEM;
            break;
        }
        if (!whole(&l, &camera->id, 1) || !word(&l, lens, sizeof(lens)) || !whole(&l, v, 2)) {
            err = line_fault(&l, "this is no CAMERA_ID, MODEL, WIDTH, HEIGHT");
            break;
        }
        camera->width = v[0];
        camera->height = v[1];
        camera->lens = colmap_lens(lens);
        if (camera->lens < 0) {
            sst_log_error("%s:%d: the camera model `%s` is not known; undistort the pictures (`colmap image_undistorter`)",
                          path, l.number, lens);
            err = -EBADMSG;
        } else if (!numbers(&l, camera->p, colmap_parameters(camera->lens)) || l.at[strspn(l.at, " \t")]) {
            sst_log_error("%s:%d: %s has %d parameters, and they are numbers", path, l.number, lens,
                          colmap_parameters(camera->lens));
            err = -EBADMSG;
        }
    }
    free(l.text);
    return err;
}

/* Does a line begin as that of an image, and end in a name? */
static bool is_image(struct lines l)
{
    double v[8];
    int64_t id[2];

    return whole(&l, id, 1) && numbers(&l, v, 7) && whole(&l, id + 1, 1) && l.at[strspn(l.at, " \t")] && !numbers(&l, v, 1);
}

int colmap_text_images(struct colmap *c, const char *path)
{
    struct lines l;
    int err = lines_open(&l, c->m, path);

    if (err)
        return err;
    while (!err && next_entry(&l)) {
        struct colmap_image image;
        size_t n;

        if (!whole(&l, &image.id, 1) || !numbers(&l, image.q, 4) || !numbers(&l, image.t, 3) ||
            !whole(&l, &image.camera, 1)) {
            err = line_fault(&l, "this is no IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME; an image has two "
                                 "lines, of which the second may be empty");
            break;
        }
        l.at += strspn(l.at, " \t");
        n = strlen(l.at);
        while (n && strchr(" \t", l.at[n - 1]))
            n--;
        if (!n || n >= sizeof(image.name)) {
            err = line_fault(&l, n ? "the name is too long" : "there is no name");
            break;
        }
        memcpy(image.name, l.at, n);
        image.name[n] = '\0';
        err = colmap_add_image(c, &image);
        if (next_line(&l) && !err && is_image(l)) /* in place of its features */
            err = line_fault(&l, "this is a second image, where the features of the one before must be; an image has two "
                                 "lines, of which the second may be empty");
    }
    free(l.text);
    return err;
}

static uint64_t count_entries(const struct lines *l)
{
    uint64_t n = 0;

    for (const char *p = l->text; p; p = strchr(p, '\n')) {
        p += *p == '\n';
        p += strspn(p, " \t\r");
        n += *p && *p != '#' && *p != '\n';
    }
    return n;
}

static int read_point(struct lines *l, struct colmap *c, bool keep)
{
    struct colmap_point p = { .views = 0 };
    int64_t track[2];
    double head[8]; /* POINT3D_ID, X, Y, Z, R, G, B, ERROR */

    if (!numbers(l, head, 8))
        return line_fault(l, "this is no POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[]");
    memcpy(p.at, head + 1, sizeof(p.at));
    p.error = head[7];
    while (whole(l, track, 2)) {
        p.views++;
        colmap_observe(c, track[0], p.at);
    }
    if (l->at[strspn(l->at, " \t")])
        return line_fault(l, "its track is not pairs of whole numbers");
    return keep ? colmap_add_point(c, &p) : 0;
}

int colmap_text_points(struct colmap *c, const char *path)
{
    uint64_t count, i = 0;
    struct lines l;
    int err = lines_open(&l, c->m, path);

    if (err)
        return err;
    count = count_entries(&l);
    err = colmap_reserve(c, count);
    for (; !err && next_entry(&l); i++)
        err = read_point(&l, c, model_keeps_point(i, count));
    free(l.text);
    return err;
}
