/* Forest of a flight: uneven ground, trees of trunk and leaves, walkers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "simulators/flight/flight_internal.h"

#define CELL        0.5  /* m, of the ground's triangles */
#define BUMP        0.6  /* m, height of the ground's bumps */
#define BUMP_SIZE   9.0  /* m */
#define CROWN_LOW   0.35 /* of the tree's height: where leaves begin */
#define LEAVES      3200 /* clumps of leaves of a tree that branches could carry ... */
#define BRANCH      0.7  /* m: ... of which gaps of about this size have none */
#define LEAFY       0.56 /* least noise where there are leaves */
#define LEAF_LEAST  0.04 /* m, half side of a clump */
#define LEAF_MOST   0.12
#define TREE_LEAST  9.0 /* m */
#define TREE_MOST   15.0
#define TRUNK_SIDES 6
#define BALL_RINGS  6
#define BALL_SIDES  10

/* --- meshes ------------------------------------------------------------------------------------------------------- */

static bool grow(void **items, size_t *room, size_t count, size_t size)
{
    void *more;

    if (count < *room)
        return true;
    more = realloc(*items, (2 * *room + 1024) * size);
    if (!more)
        return false;
    *items = more;
    *room = 2 * *room + 1024;
    return true;
}

static int32_t add_vertex(struct flight_mesh *m, struct sst_vec3 at)
{
    if (!grow((void **)&m->vertex, &m->vertex_room, m->vertices, sizeof(*m->vertex))) {
        m->failed = true;
        return 0;
    }
    m->vertex[m->vertices] = at;
    return (int32_t)m->vertices++;
}

static void add_triangle(struct flight_mesh *m, struct flight_triangle t)
{
    if (!grow((void **)&m->triangle, &m->triangle_room, m->triangles, sizeof(*m->triangle)))
        m->failed = true;
    if (!m->failed)
        m->triangle[m->triangles++] = t;
}

/* Light from above on a triangle, whichever way it turns. */
static uint8_t shade_of(const struct flight_mesh *m, const int32_t corner[3])
{
    const struct sst_vec3 a = m->vertex[corner[0]], b = m->vertex[corner[1]], c = m->vertex[corner[2]];
    const double ux = b.x - a.x, uy = b.y - a.y, uz = b.z - a.z, vx = c.x - a.x, vy = c.y - a.y, vz = c.z - a.z;
    const double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    const double length = sqrt(nx * nx + ny * ny + nz * nz);
    const double up = length > 0 ? fabs(nz) / length : 1, side = length > 0 ? fabs(nx) / length : 0;

    return (uint8_t)(255 * (0.45 + 0.4 * up + 0.15 * side));
}

static void add_shaded(struct flight_mesh *m, struct flight_triangle t)
{
    if (!m->failed) {
        t.shade = shade_of(m, t.corner);
        add_triangle(m, t);
    }
}

static void add_quad(struct flight_mesh *m, struct flight_triangle t, const int32_t corner[4])
{
    for (int i = 0; i < 2; i++) {
        t.corner[0] = corner[0];
        t.corner[1] = corner[1 + i];
        t.corner[2] = corner[2 + i];
        add_shaded(m, t);
    }
}

void flight_mesh_fini(struct flight_mesh *mesh)
{
    free(mesh->vertex);
    free(mesh->triangle);
    *mesh = (struct flight_mesh){ 0 };
}

/* --- ground and trees --------------------------------------------------------------------------------------------- */

double flight_ground(const struct flight_world *w, double x, double y)
{
    const struct sst_vec3 p = { x / BUMP_SIZE, y / BUMP_SIZE, 0 };

    return BUMP * (sst_noise_fbm(p, 3, (uint32_t)w->seed) - 0.5) + w->slope[0] * x + w->slope[1] * y;
}

static void add_ground(struct flight_world *w)
{
    const int cols = (int)ceil((w->extent[2] - w->extent[0]) / CELL),
              rows = (int)ceil((w->extent[3] - w->extent[1]) / CELL);
    const int32_t first = (int32_t)w->mesh.vertices;

    for (int r = 0; r <= rows; r++) {
        for (int c = 0; c <= cols; c++) {
            const double x = w->extent[0] + c * CELL, y = w->extent[1] + r * CELL;

            add_vertex(&w->mesh, (struct sst_vec3){ x, y, flight_ground(w, x, y) });
        }
    }
    for (int r = 0; r < rows; r++) {
        for (int c = 0; c < cols; c++) {
            const int32_t at = first + r * (cols + 1) + c;
            const int32_t corner[4] = { at, at + 1, at + cols + 2, at + cols + 1 };

            add_quad(&w->mesh, (struct flight_triangle){ .matter = GROUND }, corner);
        }
    }
}

static void add_trunk(struct flight_mesh *m, struct sst_vec3 foot, double height)
{
    int32_t ring[2][TRUNK_SIDES];

    for (int level = 0; level < 2; level++) {
        const double radius = level ? 0.03 : 0.012 * height;

        for (int i = 0; i < TRUNK_SIDES; i++) {
            const double a = 2 * M_PI * i / TRUNK_SIDES;

            ring[level][i] = add_vertex(m, (struct sst_vec3){ foot.x + radius * cos(a), foot.y + radius * sin(a),
                                                              foot.z + level * height - 0.2 * !level });
        }
    }
    for (int i = 0; i < TRUNK_SIDES; i++) {
        const int next = (i + 1) % TRUNK_SIDES;
        const int32_t corner[4] = { ring[0][i], ring[0][next], ring[1][next], ring[1][i] };

        add_quad(m, (struct flight_triangle){ .matter = BARK, .rgb = { 92, 74, 58 }, .tree = true }, corner);
    }
}

/* A clump of leaves: a square that is turned anyhow. */
static void add_leaf(struct flight_mesh *m, uint64_t *random, struct sst_vec3 at, const uint8_t rgb[3])
{
    const double half = sst_random_in(random, LEAF_LEAST, LEAF_MOST), light = sst_random_in(random, 0.65, 1.2);
    const struct sst_vec3 u = sst_random_vec(random, 1), other = sst_random_vec(random, 1);
    const double length = sqrt(u.x * u.x + u.y * u.y + u.z * u.z) + 1e-9;
    const struct sst_vec3 a = { half * u.x / length, half * u.y / length, half * u.z / length };
    struct sst_vec3 b = { u.y * other.z - u.z * other.y, u.z * other.x - u.x * other.z, u.x * other.y - u.y * other.x };
    const double across = sqrt(b.x * b.x + b.y * b.y + b.z * b.z) + 1e-9;
    struct flight_triangle t = { .matter = LEAF, .tree = true };
    int32_t corner[4];

    b = (struct sst_vec3){ half * b.x / across, half * b.y / across, half * b.z / across };
    for (int i = 0; i < 3; i++)
        t.rgb[i] = (uint8_t)sst_clamp_int((int)(rgb[i] * light), 0, 255);
    for (int i = 0; i < 4; i++) {
        const int su = i == 1 || i == 2 ? 1 : -1, sv = i > 1 ? 1 : -1;

        corner[i] = add_vertex(
            m, (struct sst_vec3){ at.x + su * a.x + sv * b.x, at.y + su * a.y + sv * b.y, at.z + su * a.z + sv * b.z });
    }
    add_quad(m, t, corner);
}

static void add_tree(struct flight_world *w, uint64_t *random, double x, double y)
{
    const double height = sst_random_in(random, TREE_LEAST, TREE_MOST),
                 wide = height * sst_random_in(random, 0.14, 0.22);
    const struct sst_vec3 foot = { x, y, flight_ground(w, x, y) };
    const double hue = sst_random_in(random, -18, 18);
    const uint8_t rgb[3] = { (uint8_t)(72 + hue), (uint8_t)(102 + hue / 2), 44 };

    add_trunk(&w->mesh, foot, height);
    for (int i = 0; i < LEAVES; i++) {
        const double up = sst_random(random), angle = sst_random_in(random, 0, 2 * M_PI);
        /* A cone that is round below; leaves are denser outside, where there is light. */
        const double reach = wide * fmin(1.25 * (1 - up), 0.6 + 2 * up) * sqrt(sst_random_in(random, 0.15, 1));

        const struct sst_vec3 at = { x + reach * cos(angle), y + reach * sin(angle),
                                     foot.z + height * (CROWN_LOW + (1 - CROWN_LOW) * up) };
        const struct sst_vec3 branch = { at.x / BRANCH, at.y / BRANCH, at.z / (2 * BRANCH) };

        if (sst_noise_fbm(branch, 2, (uint32_t)w->seed + 3) >= LEAFY)
            add_leaf(&w->mesh, random, at, rgb);
    }
}

int flight_world_init(struct flight_world *w)
{
    const double area = (w->extent[2] - w->extent[0]) * (w->extent[3] - w->extent[1]);
    uint64_t random = w->seed ^ 0x7265657473u;

    add_ground(w);
    w->ground_vertices = w->mesh.vertices;
    w->ground_triangles = w->mesh.triangles;
    for (int i = 0; i < (int)(area * w->trees / 100) && !w->mesh.failed; i++) {
        const double x = sst_random_in(&random, w->extent[0], w->extent[2]);
        const double y = sst_random_in(&random, w->extent[1], w->extent[3]);

        add_tree(w, &random, x, y);
    }
    return w->mesh.failed ? -ENOMEM : 0;
}

void flight_world_fini(struct flight_world *w)
{
    flight_mesh_fini(&w->mesh);
}

/* --- walkers ------------------------------------------------------------------------------------------------------ */

struct sst_vec3 flight_walker_at(const struct flight_world *w, int walker, double time_s)
{
    const struct flight_walker *p = &w->walker[walker];
    const double x = p->start.x + time_s * p->speed * cos(p->heading),
                 y = p->start.y + time_s * p->speed * sin(p->heading);

    return (struct sst_vec3){ x, y, flight_ground(w, x, y) };
}

void flight_place_walkers(struct flight_world *w, double half_x, double half_y)
{
    static const uint8_t clothes[2][3] = { { 236, 236, 232 }, { 44, 66, 168 } };
    uint64_t random = w->seed ^ 0x77616C6Bu;

    w->walkers = FLIGHT_WALKERS;
    for (int k = 0; k < w->walkers; k++) {
        struct flight_walker *p = &w->walker[k];

        p->start.x = sst_random_in(&random, -half_x, half_x);
        p->start.y = sst_random_in(&random, -half_y, half_y);
        p->heading = sst_random_in(&random, -M_PI, M_PI);
        p->lies = w->thermal && k % 2;
        p->speed = p->lies || w->thermal ? 0 : sst_random_in(&random, 0.8, 1.4);
        memcpy(p->rgb, clothes[k % 2], sizeof(p->rgb));
    }
}

/* Body of a walker with feet at the origin that looks along x; axes of an ellipsoid, m. */
static const struct part {
    struct sst_vec3 middle, radius;
    enum flight_matter matter;
} parts[] = {
    { { 0.02, 0, 1.64 }, { 0.11, 0.09, 0.13 }, SKIN },      { { 0, 0, 1.20 }, { 0.14, 0.23, 0.34 }, CLOTH },
    { { 0.10, 0.27, 1.12 }, { 0.16, 0.06, 0.26 }, CLOTH },  { { -0.10, -0.27, 1.12 }, { 0.16, 0.06, 0.26 }, CLOTH },
    { { 0.16, -0.10, 0.45 }, { 0.14, 0.09, 0.46 }, CLOTH }, { { -0.16, 0.10, 0.45 }, { 0.14, 0.09, 0.46 }, CLOTH },
};

static struct sst_vec3 placed(const struct flight_walker *p, struct sst_vec3 foot, struct sst_vec3 q)
{
    const double c = cos(p->heading), s = sin(p->heading);

    if (p->lies) /* on the back, feet at the foot's place, head along the heading */
        q = (struct sst_vec3){ q.z - 0.9, q.y, q.x + 0.2 };
    return (struct sst_vec3){ foot.x + c * q.x - s * q.y, foot.y + s * q.x + c * q.y, foot.z + q.z };
}

static void add_part(struct flight_mesh *m, const struct flight_walker *p, struct sst_vec3 foot,
                     const struct part *part)
{
    struct flight_triangle t = { .matter = (uint8_t)part->matter, .rgb = { 205, 165, 140 } };
    int32_t at[BALL_RINGS + 1][BALL_SIDES];

    for (int i = 0; part->matter == CLOTH && i < 3; i++)
        t.rgb[i] = p->rgb[i];
    for (int r = 0; r <= BALL_RINGS; r++) {
        for (int i = 0; i < BALL_SIDES; i++) {
            const double up = M_PI * r / BALL_RINGS, round = 2 * M_PI * i / BALL_SIDES;
            const struct sst_vec3 q = { part->middle.x + part->radius.x * sin(up) * cos(round),
                                        part->middle.y + part->radius.y * sin(up) * sin(round),
                                        part->middle.z + part->radius.z * cos(up) };

            at[r][i] = add_vertex(m, placed(p, foot, q));
        }
    }
    for (int r = 0; r < BALL_RINGS; r++) {
        for (int i = 0; i < BALL_SIDES; i++) {
            const int next = (i + 1) % BALL_SIDES;
            const int32_t corner[4] = { at[r][i], at[r][next], at[r + 1][next], at[r + 1][i] };

            add_quad(m, t, corner);
        }
    }
}

int flight_walkers_mesh(struct flight_mesh *out, const struct flight_world *w, double time_s)
{
    *out = (struct flight_mesh){ 0 };
    for (int k = 0; k < w->walkers; k++) {
        const struct sst_vec3 foot = flight_walker_at(w, k, time_s);

        for (size_t i = 0; i < ARRAY_LEN(parts); i++)
            add_part(out, &w->walker[k], foot, &parts[i]);
    }
    return out->failed ? -ENOMEM : 0;
}
