/* Meshes of a terrain as OBJ files, drawn onto a grid. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/image_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "pipeline/image/codec_formats.h"

#define MOST_EMPTY 64    /* times the area of the triangles that their extent may have */
#define MOST_AREA  1e290 /* m^2: a larger one is no ground, nor are products of lengths then numbers */
#define EDGE       1e-6  /* share of a triangle: samples on an edge belong to both */

struct vertex {
    double at[3];
};

struct triangle {
    int vertex[3];
};

struct mesh {
    const char *name;
    struct vertex *vertices;
    struct triangle *triangles;
    int vertex_count, vertex_room, triangle_count, triangle_room;
};

static int malformed(const struct mesh *m, int line, const char *what)
{
    sst_log_error("%s: line %d %s; export the terrain again as triangles", m->name, line, what);
    return -EBADMSG;
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

static int read_vertex(struct mesh *m, const char *at, int line)
{
    struct vertex v;
    char *end;

    for (int k = 0; k < 3; k++, at = end) {
        v.at[k] = strtod(at, &end);
        if (end == at || !isfinite(v.at[k]))
            return malformed(m, line, "is a vertex without three numbers");
    }
    if (!sst_mem_grow(&m->vertices, m->vertex_count, &m->vertex_room, sizeof(v)))
        return sst_image_size_error(-ENOMEM, m->name, 0, 0);
    m->vertices[m->vertex_count++] = v;
    return 0;
}

/* A polygon, as a fan of triangles. Indices count from 1, negative ones from the last vertex; "/" begins indices of
 * textures and normals. */
static int read_face(struct mesh *m, const char *at, const char *end, int line)
{
    struct triangle t = { { 0 } };

    for (int corner = 0;; corner++) {
        char *after;
        long v;

        at += strspn(at, " \t\r");
        if (at >= end)
            return corner >= 3 ? 0 : malformed(m, line, "is a face of less than three vertices");
        v = strtol(at, &after, 10);
        v = v < 0 ? m->vertex_count + v : v - 1;
        if (after == at || v < 0 || v >= m->vertex_count)
            return malformed(m, line, "is a face of a vertex that is not there");
        at = after + strcspn(after, " \t\r\n");
        if (corner > 2)
            t.vertex[1] = t.vertex[2];
        t.vertex[sst_min_int(corner, 2)] = (int)v;
        if (corner < 2)
            continue;
        if (!sst_mem_grow(&m->triangles, m->triangle_count, &m->triangle_room, sizeof(t)))
            return sst_image_size_error(-ENOMEM, m->name, 0, 0);
        m->triangles[m->triangle_count++] = t;
    }
}

static int read_lines(struct mesh *m, const char *text)
{
    int err = 0;

    for (int line = 1; !err && *text; line++) {
        const char *end = text + strcspn(text, "\n");

        if (text[0] == 'v' && (text[1] == ' ' || text[1] == '\t'))
            err = read_vertex(m, text + 2, line);
        else if (text[0] == 'f' && (text[1] == ' ' || text[1] == '\t'))
            err = read_face(m, text + 2, end, line);
        text = end + (*end == '\n');
    }
    return err;
}

/* --- the grid ----------------------------------------------------------------------------------------------------- */

static const double *corner(const struct mesh *m, const struct triangle *t, int k)
{
    return m->vertices[t->vertex[k]].at;
}

/* Twice the area in x and y; negative where the corners go clockwise. */
static double area2(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
}

/* Two triangles a cell: the step at which they have the area of the cells. @return -EBADMSG, logged: no terrain */
static int plan(struct sst_heights *h, const struct mesh *m)
{
    double low[2] = { INFINITY, INFINITY }, high[2] = { -INFINITY, -INFINITY }, area = 0, step;
    double cells[2];

    for (int i = 0; i < 3 * m->triangle_count; i++) {
        const double *at = corner(m, &m->triangles[i / 3], i % 3);

        for (int axis = 0; axis < 2; axis++) {
            low[axis] = fmin(low[axis], at[axis]);
            high[axis] = fmax(high[axis], at[axis]);
        }
    }
    for (int i = 0; i < m->triangle_count && high[0] - low[0] < MOST_AREA / fmax(high[1] - low[1], 1); i++) {
        const struct triangle *t = &m->triangles[i];

        area += fabs(area2(corner(m, t, 0), corner(m, t, 1), corner(m, t, 2))) / 2;
    }
    if (area <= 0 || (high[0] - low[0]) * (high[1] - low[1]) > MOST_EMPTY * area) {
        sst_log_error("%s is no terrain: its %d triangles cover no ground, z being upwards; export its mesh", m->name,
                      m->triangle_count);
        return -EBADMSG;
    }
    step = sqrt(2 * area / m->triangle_count);
    for (int axis = 0; axis < 2; axis++)
        cells[axis] = sst_clamp_double(rint((high[axis] - low[axis]) / step), 1, 1e9);
    if (cells[0] >= SST_IMAGE_MAX_SIDE || cells[1] >= SST_IMAGE_MAX_SIDE ||
        (cells[0] + 1) * (cells[1] + 1) > (double)SST_IMAGE_MAX_PIXELS)
        return sst_image_size_error(-EINVAL, m->name, (int64_t)cells[0] + 1, (int64_t)cells[1] + 1);
    h->x_mm = low[0];
    h->y_mm = high[1];
    h->step_x_mm = (high[0] - low[0]) / cells[0];
    h->step_y_mm = (low[1] - high[1]) / cells[1];
    return sst_map_f32_init(&h->mm, (int)cells[0] + 1, (int)cells[1] + 1)
               ? sst_image_size_error(-ENOMEM, m->name, (int64_t)cells[0] + 1, (int64_t)cells[1] + 1)
               : 0;
}

/* Heights of the samples in a triangle, row by row: each corner's share is linear along the row, and not negative
 * inside. */
static void draw(struct sst_heights *h, const double *a, const double *b, const double *c)
{
    const double *const at[3] = { a, b, c };
    const double whole = area2(a, b, c);
    const double top = (fmin(fmin(a[1], b[1]), c[1]) - h->y_mm) / h->step_y_mm;
    const double bottom = (fmax(fmax(a[1], b[1]), c[1]) - h->y_mm) / h->step_y_mm;
    const int y0 = (int)fmax(ceil(fmin(top, bottom) - EDGE), 0);
    const int y1 = (int)fmin(floor(fmax(top, bottom) + EDGE), h->mm.height - 1);

    for (int y = y0; y <= y1 && whole != 0; y++) {
        float *row = sst_map_f32_row(&h->mm, y);
        double share[3], slope[3], first = 0, last = h->mm.width - 1;

        for (int k = 0; k < 3; k++) {
            const double *p = at[(k + 1) % 3], *q = at[(k + 2) % 3];
            const double start[2] = { h->x_mm, h->y_mm + y * h->step_y_mm };

            share[k] = area2(start, p, q) / whole;
            slope[k] = (p[1] - q[1]) * h->step_x_mm / whole;
            if (slope[k] > 0)
                first = fmax(first, ceil((-EDGE - share[k]) / slope[k]));
            else if (slope[k] < 0)
                last = fmin(last, floor((-EDGE - share[k]) / slope[k]));
            else if (share[k] < -EDGE)
                last = -1;
        }
        for (int x = (int)fmin(first, h->mm.width); x <= last; x++) {
            const double z =
                (share[0] + x * slope[0]) * a[2] + (share[1] + x * slope[1]) * b[2] + (share[2] + x * slope[2]) * c[2];

            row[x] = isnan(row[x]) ? (float)z : fmaxf(row[x], (float)z);
        }
    }
}

int mesh_to_heights(struct sst_heights *out, const char *text, const char *name)
{
    struct mesh m = { .name = name };
    struct sst_heights made = { 0 };
    int err = read_lines(&m, text);

    err = err ? err : plan(&made, &m);
    for (int y = 0; !err && y < made.mm.height; y++) {
        for (int x = 0; x < made.mm.width; x++)
            sst_map_f32_row(&made.mm, y)[x] = NAN;
    }
    for (int i = 0; !err && i < m.triangle_count; i++) {
        const struct triangle *t = &m.triangles[i];

        draw(&made, corner(&m, t, 0), corner(&m, t, 1), corner(&m, t, 2));
    }
    free(m.vertices);
    free(m.triangles);
    if (!err)
        *out = made;
    return err;
}
