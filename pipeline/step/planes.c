/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/step/planes.h"

#include <errno.h>
#include <string.h>

void sst_step_plane_drop(struct sst_step_planes *p, struct sst_gpu *g, enum sst_step_plane plane)
{
    struct sst_step_places *s = &p->plane[plane];

    if (s->buffer)
        sst_gpu_buffer_destroy(g, s->buffer);
    s->buffer = NULL;
    s->places = 0;
    for (int i = 0; i < SST_PLANE_VIEWS; i++) {
        s->view[i].place = -1;
        s->view[i].current = false;
    }
}

void sst_step_planes_claim(struct sst_step_planes *p, struct sst_gpu *g, const void *of, int views,
                           const size_t *pixels)
{
    const bool same = p->of == of && p->views == views;

    p->turn++;
    for (int i = 0; i < SST_PLANES; i++) {
        const size_t n = pixels[i < SST_PLANE_MAP ? i : SST_PLANE_MAP] *
                         (i == SST_PLANE_FEATURES ? (size_t)SST_PLANE_FEATURE_WORDS : 1);

        if (!same || n != p->pixels[i])
            sst_step_plane_drop(p, g, (enum sst_step_plane)i);
        p->pixels[i] = n;
        for (int k = 0; i >= SST_PLANE_MAP && k < views; k++)
            sst_step_plane_mark(p, (enum sst_step_plane)i, k, false);
    }
    p->of = of;
    p->views = views;
}

void sst_step_plane_release(struct sst_step_planes *p, enum sst_step_plane plane, int view)
{
    struct sst_step_places *s = &p->plane[plane];

    if (s->buffer && s->view[view].place >= 0)
        s->place[s->view[view].place].used = p->turn - 1;
}

int sst_step_plane_used(const struct sst_step_planes *p, enum sst_step_plane plane)
{
    const struct sst_step_places *s = &p->plane[plane];
    int n = 0;

    for (int i = 0; i < s->places; i++)
        n += s->place[i].view >= 0 && s->place[i].used == p->turn;
    return n;
}

bool sst_step_planes_trim(struct sst_step_planes *p, struct sst_gpu *g, int but)
{
    bool any = false;

    for (int i = 0; i < SST_PLANES; i++) {
        if (i == but || !p->plane[i].buffer || sst_step_plane_used(p, (enum sst_step_plane)i))
            continue;
        sst_step_plane_drop(p, g, (enum sst_step_plane)i);
        any = true;
    }
    return any;
}

/* --- places ------------------------------------------------------------------------------------------------------- */

static struct sst_gpu_range range_of(struct sst_step_planes *p, struct sst_step_places *s, int place)
{
    s->place[place].used = p->turn;
    return (struct sst_gpu_range){ s->buffer, (size_t)place * s->bytes };
}

struct sst_gpu_range sst_step_plane_find(struct sst_step_planes *p, enum sst_step_plane plane, int view)
{
    struct sst_step_places *s = &p->plane[plane];

    return s->buffer && s->view[view].current ? range_of(p, s, s->view[view].place) : (struct sst_gpu_range){ 0 };
}

/* An empty place, or the place of the view that was used least recently. @return -1: all were used in this turn */
static int oldest_place(const struct sst_step_planes *p, const struct sst_step_places *s)
{
    int oldest = -1;

    for (int i = 0; i < s->places; i++) {
        if (s->place[i].view < 0)
            return i;
        if (s->place[i].used != p->turn && (oldest < 0 || s->place[i].used < s->place[oldest].used))
            oldest = i;
    }
    return oldest;
}

struct sst_gpu_range sst_step_plane_place(struct sst_step_planes *p, enum sst_step_plane plane, int view)
{
    struct sst_step_places *s = &p->plane[plane];
    int place = s->buffer ? s->view[view].place : -1;

    if (s->buffer && place < 0) {
        place = oldest_place(p, s);
        if (place >= 0 && s->place[place].view >= 0) {
            s->view[s->place[place].view].place = -1;
            s->view[s->place[place].view].current = false;
        }
    }
    if (place < 0)
        return (struct sst_gpu_range){ 0 };
    s->place[place].view = view;
    s->view[view].place = place;
    s->view[view].current = false;
    return range_of(p, s, place);
}

int sst_step_plane_create(struct sst_step_planes *p, struct sst_gpu *g, enum sst_step_plane plane, int least)
{
    struct sst_step_places *s = &p->plane[plane];
    const size_t bytes = (p->pixels[plane] * sizeof(uint32_t) + SST_GPU_ALIGN - 1) / SST_GPU_ALIGN * SST_GPU_ALIGN;
    int places = p->views > least ? p->views : least, err;

    sst_step_plane_drop(p, g, plane);
    s->bytes = bytes;
    do {
        err = sst_gpu_buffer_create(g, &s->buffer, (size_t)places * bytes);
        s->places = places;
        places = places / 2 > least ? places / 2 : least;
    } while (err == -ENOMEM && s->places > least);
    if (err) {
        s->buffer = NULL;
        s->places = 0;
    }
    for (int i = 0; i < SST_PLANE_VIEWS; i++)
        s->place[i].view = -1;
    return err;
}

void sst_step_plane_mark(struct sst_step_planes *p, enum sst_step_plane plane, int view, bool current)
{
    struct sst_step_places *s = &p->plane[plane];

    s->view[view].current = current && s->buffer && s->view[view].place >= 0;
}

/* --- words -------------------------------------------------------------------------------------------------------- */

static const uint8_t *row_or_none(const struct sst_map_u8 *map, int y)
{
    return map && map->data ? sst_map_u8_row(map, y) : NULL;
}

static void pack_colours(uint32_t *words, const struct sst_plane_source *from, int y)
{
    const uint8_t *r = sst_image_row(from->image, 0, y), *g = sst_image_row(from->image, 1, y);
    const uint8_t *b = sst_image_row(from->image, 2, y), *seen = row_or_none(from->seen, y);

    for (int x = 0; x < from->image->width; x++)
        words[x] = r[x] | (uint32_t)g[x] << 8 | (uint32_t)b[x] << 16 | 0xFF000000U;
    for (int x = 0; seen && x < from->image->width; x++)
        words[x] &= seen[x] ? UINT32_MAX : 0xFFFFFFU;
}

static void pack_map(uint32_t *words, const struct sst_plane_source *from, int y)
{
    const uint16_t *disp = sst_map_u16_row(from->disp, y);
    const uint8_t *confidence = row_or_none(from->confidence, y), *agreed = row_or_none(from->agreed, y);
    const uint8_t *checked = row_or_none(from->checked, y);

    for (int x = 0; x < from->disp->width; x++)
        words[x] = disp[x] | (confidence ? (uint32_t)confidence[x] << 16 : 0) |
                   (agreed && agreed[x] ? SST_MAP_AGREED : 0) |
                   (checked ? (uint32_t)checked[x] << SST_MAP_CHECK_SHIFT : 0);
}

static bool is_map(enum sst_step_plane plane)
{
    return plane == SST_PLANE_MAP || plane == SST_PLANE_BEFORE;
}

void sst_step_plane_shape(enum sst_step_plane plane, const struct sst_plane_source *from, int *rows, size_t *words)
{
    if (plane == SST_PLANE_FEATURES) {
        *rows = SST_PLANE_FEATURE_WORDS * from->height;
        *words = (size_t)from->width;
    } else {
        *rows = is_map(plane) ? from->disp->height : from->image->height;
        *words = (size_t)(is_map(plane) ? from->disp->width : from->image->width);
    }
}

void sst_step_plane_pack(uint32_t *words, enum sst_step_plane plane, const struct sst_plane_source *from, int first,
                         int rows)
{
    size_t width;
    int height;

    sst_step_plane_shape(plane, from, &height, &width);
    for (int y = first; y < first + rows; y++, words += width) {
        if (plane == SST_PLANE_FEATURES)
            memcpy(words, from->features + (size_t)y * from->feature_stride, width * sizeof(*words));
        else if (is_map(plane))
            pack_map(words, from, y);
        else
            pack_colours(words, from, y);
    }
}

void sst_step_map_unpack(const uint32_t *words, struct sst_map_u16 *disp, struct sst_map_u8 *confidence,
                         struct sst_map_u8 *agreed, struct sst_map_u8 *checked)
{
    const int width = disp ? disp->width : checked->width, height = disp ? disp->height : checked->height;

    for (int y = 0; y < height; y++, words += width) {
        uint16_t *d = disp ? sst_map_u16_row(disp, y) : NULL;
        uint8_t *c = confidence ? sst_map_u8_row(confidence, y) : NULL;
        uint8_t *a = agreed ? sst_map_u8_row(agreed, y) : NULL, *s = checked ? sst_map_u8_row(checked, y) : NULL;

        for (int x = 0; d && x < width; x++)
            d[x] = (uint16_t)words[x];
        for (int x = 0; c && x < width; x++)
            c[x] = (uint8_t)(words[x] >> 16);
        for (int x = 0; a && x < width; x++)
            a[x] = words[x] & SST_MAP_AGREED ? 255 : 0;
        for (int x = 0; s && x < width; x++)
            s[x] = (uint8_t)(words[x] >> SST_MAP_CHECK_SHIFT & 3);
    }
}
