/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "simulators/scene/world/sim_world.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <sha2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/image/codec.h"
#include "simulators/scene/world/world_internal.h"

/* Key of a rendered frame. */
struct sim_made_key {
    int cam, frame;
    int32_t pose_um[3];
    uint32_t fourcc;
    int width, height;
    int light; /* exposure times gain relative to nominal, in 1/1024 */
};

/* --- frames that are rendered on demand --------------------------------------------------------------------------- */

struct item {
    struct sim_made_key key;
    struct sim_jpeg frame;
    uint64_t used;
};

struct shelf {
    struct item *items;
    int count, capacity;
};

struct sim_made {
    struct shelf *shelves; /* one per camera, which keeps lookups short */
    int cams;
    size_t bytes, budget;
    uint64_t clock;
};

/* @param budget_bytes  of all frames; the least recently used one is evicted first */
static int made_create(struct sim_made **out, int cams, size_t budget_bytes)
{
    struct sim_made *m = calloc(1, sizeof(*m));

    if (!m)
        return -ENOMEM;
    *m = (struct sim_made){ calloc((size_t)cams, sizeof(*m->shelves)), cams, 0, budget_bytes, 0 };
    if (!m->shelves) {
        free(m);
        return -ENOMEM;
    }
    *out = m;
    return 0;
}

static void made_destroy(struct sim_made *m)
{
    if (!m)
        return;
    for (int c = 0; c < m->cams; c++) {
        for (int i = 0; i < m->shelves[c].count; i++)
            free(m->shelves[c].items[i].frame.data);
        free(m->shelves[c].items);
    }
    free(m->shelves);
    free(m);
}

static bool same(const struct sim_made_key *a, const struct sim_made_key *b)
{
    return a->frame == b->frame && a->fourcc == b->fourcc && a->width == b->width && a->height == b->height &&
           a->light == b->light && !memcmp(a->pose_um, b->pose_um, sizeof(a->pose_um));
}

/* The frame of a key, or NULL; valid until the next call. A packed frame has scan = rest = 0. */
static const struct sim_jpeg *made_find(struct sim_made *m, const struct sim_made_key *key)
{
    const struct shelf *s = &m->shelves[key->cam];

    for (int i = 0; i < s->count; i++) {
        if (same(&s->items[i].key, key)) {
            s->items[i].used = ++m->clock;
            return &s->items[i].frame;
        }
    }
    return NULL;
}

static void drop_oldest(struct sim_made *m)
{
    struct shelf *from = NULL;
    int oldest = 0;

    for (int c = 0; c < m->cams; c++) {
        for (int i = 0; i < m->shelves[c].count; i++) {
            if (!from || m->shelves[c].items[i].used < from->items[oldest].used) {
                from = &m->shelves[c];
                oldest = i;
            }
        }
    }
    m->bytes -= from->items[oldest].frame.bytes;
    free(from->items[oldest].frame.data);
    from->items[oldest] = from->items[--from->count];
}

/* Store a frame; takes ownership of its data, even on failure. @return 0 or -ENOMEM */
static int made_keep(struct sim_made *m, const struct sim_made_key *key, const struct sim_jpeg *frame)
{
    struct shelf *s = &m->shelves[key->cam];

    while (m->bytes && m->bytes + frame->bytes > m->budget)
        drop_oldest(m);
    if (!sst_mem_grow(&s->items, s->count, &s->capacity, sizeof(*s->items))) {
        free(frame->data);
        return -ENOMEM;
    }
    s->items[s->count++] = (struct item){ *key, *frame, ++m->clock };
    m->bytes += frame->bytes;
    return 0;
}

/* --- the world ---------------------------------------------------------------------------------------------------- */

#define VERSION    3 /* part of the cache's key: increase it when the same settings give different bytes */
#define SIZES_MAX  4
#define MADE_BYTES ((size_t)256 << 20)
#define LIGHT_ONE  1024
#define TRIGGERS   64 /* triggers with a remembered loop frame */

struct sst_sim_world {
    struct sst_sim_settings settings;
    struct sim_stage *stage;
    struct sim_loop *loop; /* NULL on a rig */
    SST_ATOMIC(bool) ending; /* a loop that is being prepared is given up */
    struct sim_made *made;
    int cams, size_count;
    int held; /* the loop's frame that is held; -1: by time */
    int sizes[SIZES_MAX][2]; /* of a camera */
    int parts, device_sizes[SIZES_MAX][2]; /* cameras in the picture of a device, and sizes of these pictures */
    uint8_t *part;                         /* pictures of a device's cameras, [parts][part_bytes]; NULL: it is one */
    size_t part_bytes;
    struct {
        uint64_t trigger;
        int64_t t_ns;
        int frame;
    } shown[TRIGGERS];
    uint8_t *luma; /* of a strip */
};

/* --- opening ------------------------------------------------------------------------------------------------------ */

/* Native, 3/4, 1/2 and 1/4 of it: whole cells of 16x8 px and at least twice the strip's height. */
static void find_sizes(struct sst_sim_world *w)
{
    static const int quarters[SIZES_MAX] = { 4, 3, 2, 1 };

    for (int i = 0; i < SIZES_MAX; i++) {
        const int width = w->settings.width * quarters[i] / 4, height = w->settings.height * quarters[i] / 4;

        if (i && (width % 16 || height % 8 || w->settings.width * quarters[i] % 4 ||
                  w->settings.height * quarters[i] % 4 || 2 * strip_height(width) > height))
            continue;
        w->device_sizes[w->size_count][0] = width * w->settings.split_cols;
        w->device_sizes[w->size_count][1] = height * w->settings.split_rows;
        w->sizes[w->size_count][0] = width;
        w->sizes[w->size_count++][1] = height;
    }
}

static int make_parents(const char *path)
{
    char part[SST_PATH_MAX];

    for (const char *end = strchr(path + 1, '/'); end; end = strchr(end + 1, '/')) {
        snprintf(part, sizeof(part), "%.*s", (int)(end - path), path);
        const int err = sst_path_make_dir(part);

        if (err)
            return err;
    }
    return 0;
}

int sst_sim_world_cache(char out[SST_PATH_MAX], const char *cache)
{
    const char *base = getenv("XDG_CACHE_HOME"), *home = getenv("HOME");
    char dot[SST_PATH_MAX];
    int err;

    if (cache) {
        err = sst_path_join(out, cache, NULL);
    } else if (base && *base) {
        err = sst_path_join(out, base, "sst-sim");
    } else if (home && *home) {
        err = sst_path_join(dot, home, ".cache");
        err = err ? err : sst_path_join(out, dot, "sst-sim");
    } else {
        sst_log_error("no folder for prepared worlds; set HOME or XDG_CACHE_HOME");
        return -EINVAL;
    }
    return err ? err : make_parents(out);
}

struct encoding {
    const struct sst_sim_settings *settings;
    struct sim_jpeg *frames; /* the first one is the loop's frame `first` */
    int first;
};

static int encode(void *arg, int frame, const struct sst_image *image)
{
    const struct encoding *e = arg;

    return sim_jpeg_encode(image, e->settings->quality, e->settings->strip, &e->frames[frame - e->first]);
}

struct preparing {
    struct encoding e;
    const struct sst_sim_world *world;
    int most; /* frames */
};

#define ENOUGH (-ECANCELED)

static int encode_loop(void *arg, int frame, const struct sst_image *image)
{
    const struct preparing *p = arg;
    const int err = p->world->ending ? -EINTR : frame >= p->most ? ENOUGH : 0;

    return err ? err : encode((void *)(uintptr_t)&p->e, frame, image);
}

static int render_camera(void *arg, int cam, struct sim_jpeg *frames)
{
    const struct sst_sim_world *w = arg;
    struct preparing p = { { &w->settings, frames, 0 }, w, sim_stage_frames(w->stage) };

    return sim_stage_loop(w->stage, cam, encode_loop, &p);
}

static int render_first(void *arg, int cam, struct sim_jpeg *frames)
{
    const struct sst_sim_world *w = arg;
    struct preparing p = { { &w->settings, frames, 0 }, w, 1 };
    const int err = sim_stage_loop(w->stage, cam, encode_loop, &p);

    return err == ENOUGH ? 0 : err;
}

static int open_loop(struct sst_sim_world *w, const char *cache, bool at_once)
{
    uint8_t key[SHA256_DIGEST_LENGTH];
    const int version = VERSION;
    char folder[SST_PATH_MAX];
    SHA2_CTX hash;
    int err = sst_sim_world_cache(folder, cache);

    if (err)
        return err;
    SHA256Init(&hash);
    SHA256Update(&hash, (const uint8_t *)&version, sizeof(version));
    SHA256Update(&hash, (const uint8_t *)&w->settings, offsetof(struct sst_sim_settings, host));
    SHA256Final(key, &hash);
    return sim_loop_open(&w->loop, &(struct sim_loop_config){ folder, key, w->settings.scene, w->cams,
                                                              sim_stage_frames(w->stage), render_camera, w,
                                                              at_once ? render_first : NULL });
}

static int open_world(struct sst_sim_world **out, const char *world, const char *cache, bool at_once)
{
    struct sst_sim_world *w = calloc(1, sizeof(*w));
    int err = w ? sst_sim_settings_read(&w->settings, world ? world : "pedestrian") : -ENOMEM;

    err = err ? err : sim_stage_open(&w->stage, &w->settings);
    if (err)
        goto fail;
    w->cams = w->settings.rig ? 1 : w->settings.rows * w->settings.cols;
    (void)!sst_sim_world_hold(w, 0);
    find_sizes(w);
    w->luma = malloc((size_t)w->settings.width * (size_t)w->settings.height);
    w->parts = w->settings.split_rows * w->settings.split_cols;
    w->part_bytes = (size_t)w->settings.width * (size_t)w->settings.height * 2;
    w->part = w->parts > 1 ? malloc((size_t)w->parts * w->part_bytes) : NULL;
    err = w->luma && (w->part || w->parts == 1) ? made_create(&w->made, w->cams, MADE_BYTES) : -ENOMEM;
    if (!err && !w->settings.rig)
        err = open_loop(w, cache, at_once);
    if (err)
        goto fail;
    *out = w;
    return 0;

fail:
    sst_sim_world_close(w);
    return err;
}

int sst_sim_world_open(struct sst_sim_world **out, const char *world, const char *cache)
{
    return open_world(out, world, cache, false);
}

int sst_sim_world_open_at_once(struct sst_sim_world **out, const char *world, const char *cache)
{
    return open_world(out, world, cache, true);
}

void sst_sim_world_close(struct sst_sim_world *w)
{
    if (!w)
        return;
    w->ending = true;
    sim_loop_close(w->loop);
    made_destroy(w->made);
    sim_stage_close(w->stage);
    free(w->luma);
    free(w->part);
    free(w);
}

int sst_sim_world_cameras(const struct sst_sim_world *w)
{
    return w->cams / w->parts;
}

/* A camera of a device: boards lie in the grid row by row, and the cameras on each. */
static int camera_of(const struct sst_sim_world *w, int device, int part)
{
    const struct sst_sim_settings *s = &w->settings;
    const int across = s->cols / s->split_cols;

    return (device / across * s->split_rows + part / s->split_cols) * s->cols + device % across * s->split_cols +
           part % s->split_cols;
}

const struct sst_sim_settings *sst_sim_world_settings(const struct sst_sim_world *w)
{
    return &w->settings;
}

const struct sst_sim_timing *sst_sim_world_timing(const struct sst_sim_world *w, int cam)
{
    return &sim_stage_camera(w->stage, w->parts > 1 ? camera_of(w, cam, 0) : cam)->timing;
}

int sst_sim_world_sizes(const struct sst_sim_world *w, const int (**sizes)[2])
{
    *sizes = w->device_sizes;
    return w->size_count;
}

int sst_sim_world_hold(struct sst_sim_world *w, int pose)
{
    const struct sst_sim_board *board = sim_stage_board(w->stage);
    const int poses = board->kind ? board->poses : 0;

    if (pose < 0 || pose > sst_min_int(poses, sim_stage_frames(w->stage)))
        return -ERANGE;
    /* A rig takes much longer for its views than a pose lasts by time. */
    w->held = pose ? pose - 1 : w->settings.rig && poses ? 0 : -1;
    return 0;
}

int sst_sim_world_parameters(const char *world, const char *path)
{
    struct sst_sim_settings *settings = calloc(1, sizeof(*settings));
    const char *end = strrchr(path, '.');
    const bool yaml = end && !strcmp(end, ".yaml");
    struct sim_stage *stage = NULL;
    int err = settings ? sst_sim_settings_read(settings, world ? world : "pedestrian") : -ENOMEM;

    err = err ? err : sim_stage_open(&stage, settings);
    if (!err)
        err = yaml ? sim_truth_calib(settings, stage, path) : sim_truth_write(settings, stage, path);
    sim_stage_close(stage);
    free(settings);
    return err;
}

/* --- frames ------------------------------------------------------------------------------------------------------- */

/*
 * The loop's frame at a time. All cameras of one trigger show the same frame, although their exposures begin
 * microseconds apart and may be on both sides of a change: a camera within a quarter of a step uses the first one's
 * frame.
 */
static int frame_at(struct sst_sim_world *w, const struct sst_sim_exposure *e)
{
    const int64_t step_ns = (int64_t)(1e9 / w->settings.rate_hz);
    const int64_t now = e->t_ns / step_ns;
    const int steps = sim_stage_steps(w->stage);
    const int frame = sim_stage_frame_at(w->stage, (int)(((now % steps) + steps) % steps));
    const size_t slot = e->trigger % TRIGGERS;

    if (w->loop && !sim_loop_whole(w->loop))
        return 0;
    if (w->held >= 0)
        return w->held;

    if (w->shown[slot].t_ns && w->shown[slot].trigger == e->trigger &&
        llabs(w->shown[slot].t_ns - e->t_ns) < step_ns / 4)
        return w->shown[slot].frame;
    w->shown[slot].trigger = e->trigger;
    w->shown[slot].t_ns = e->t_ns;
    w->shown[slot].frame = frame;
    return frame;
}

/* The camera's frame at nominal exposure, native size, MJPEG. @return 0 or a negative errno */
static int native(struct sst_sim_world *w, const struct sim_made_key *wanted, struct sim_jpeg *out)
{
    struct sim_made_key key = *wanted;
    const struct sim_jpeg *found;
    struct encoding e;
    int err;

    if (w->loop) {
        *out = sim_loop_frame(w->loop, key.cam, key.frame);
        return 0;
    }
    key.fourcc = V4L2_PIX_FMT_MJPEG;
    key.width = w->settings.width;
    key.height = w->settings.height;
    key.light = LIGHT_ONE;
    found = made_find(w->made, &key);
    if (found) {
        *out = *found;
        return 0;
    }
    e = (struct encoding){ &w->settings, out, key.frame };
    err = sim_stage_pose(w->stage, key.pose_um, key.frame, encode, &e);
    return err ? err : made_keep(w->made, &key, out);
}

/* The slow path: decode, light, scale, encode or pack. */
static int make(struct sst_sim_world *w, const struct sim_made_key *key, struct sim_jpeg *out)
{
    const bool native_size = key->width == w->settings.width && key->height == w->settings.height;
    struct sst_image full = { 0 }, small = { 0 };
    struct sim_jpeg from;
    int err = native(w, key, &from);

    err = err ? err : sst_image_decode(&full, from.data, from.bytes, "a simulated frame");
    if (!err && key->light != LIGHT_ONE)
        sim_light(&full, (double)key->light / LIGHT_ONE);
    if (!err && !native_size && !(err = sst_image_init(&small, key->width, key->height)))
        sim_shrink(&full, &small);
    if (err)
        goto done;
    if (key->fourcc == V4L2_PIX_FMT_MJPEG) {
        err = sim_jpeg_encode(native_size ? &full : &small, w->settings.quality, w->settings.strip, out);
    } else {
        const size_t bytes = sim_format_bytes(key->fourcc, key->width, key->height);

        *out = (struct sim_jpeg){ .data = malloc(bytes), .bytes = (uint32_t)bytes };
        err = out->data ? 0 : -ENOMEM;
        if (!err)
            sim_pack(native_size ? &full : &small, key->fourcc, out->data);
    }
    err = err ? err : made_keep(w->made, key, out);

done:
    sst_image_fini(&small);
    sst_image_fini(&full);
    return err;
}

static bool offered(const struct sst_sim_world *w, uint32_t fourcc, int width, int height)
{
    if (fourcc != V4L2_PIX_FMT_MJPEG && !sim_format_bytes(fourcc, 2, 2))
        return false;
    for (int i = 0; i < w->size_count; i++) {
        if (w->sizes[i][0] == width && w->sizes[i][1] == height)
            return true;
    }
    return false;
}

static int deliver_packed(struct sst_sim_world *w, const struct sim_jpeg *frame, const struct sim_made_key *key,
                          const struct sst_sim_exposure *e, struct sst_sim_room out)
{
    if (out.bytes < frame->bytes)
        return -ENOSPC;
    memcpy(out.data, frame->data, frame->bytes);
    if (w->settings.strip) {
        strip_draw(w->luma, (size_t)key->width, key->width, e);
        sim_pack_luma(w->luma, key->width, strip_height(key->width), key->fourcc, out.data);
    }
    return 0;
}

static int camera_frame(struct sst_sim_world *w, const struct sst_sim_exposure *e, struct sst_sim_format format,
                        struct sst_sim_room out, size_t *bytes)
{
    const uint32_t fourcc = format.fourcc;
    const int width = format.width, height = format.height;
    const double light = e->gain * e->exposure_us / w->settings.exposure_us * LIGHT_ONE;
    struct sim_made_key key = { .cam = e->cam, .fourcc = fourcc, .width = width, .height = height };
    const struct sim_jpeg *found;
    struct sim_jpeg frame;
    int err;

    if (e->cam < 0 || e->cam >= w->cams || !offered(w, fourcc, width, height) || !(light >= 0))
        return -EINVAL;
    key.frame = frame_at(w, e);
    key.light = (int)sst_clamp_double(light + 0.5, 0, 1 << 24);
    if (w->settings.rig)
        memcpy(key.pose_um, e->pose_um, sizeof(key.pose_um));
    found = made_find(w->made, &key);
    if (found)
        frame = *found;
    else if (fourcc == V4L2_PIX_FMT_MJPEG && key.light == LIGHT_ONE && width == w->settings.width &&
             height == w->settings.height)
        err = native(w, &key, &frame);
    else
        err = make(w, &key, &frame);
    if (!found && err)
        return err;
    if (fourcc == V4L2_PIX_FMT_MJPEG)
        return sim_jpeg_copy(&frame, width, w->settings.strip ? e : NULL, out, bytes);
    err = deliver_packed(w, &frame, &key, e, out);
    if (!err)
        *bytes = frame.bytes;
    return err;
}

/* The picture of a device with several cameras. */
static int device_frame(struct sst_sim_world *w, const struct sst_sim_exposure *e, struct sst_sim_format format,
                        struct sst_sim_room out, size_t *bytes)
{
    const struct sst_sim_format one = { format.fourcc, format.width / w->settings.split_cols,
                                        format.height / w->settings.split_rows };
    const struct sim_mosaic m = { w->settings.split_rows, w->settings.split_cols, one.width, one.height,
                                  sim_format_bytes(one.fourcc, one.width, one.height) };
    struct sst_sim_room parts[SST_SIM_SPLIT_MAX];

    if (m.part_bytes && out.bytes < m.part_bytes * (size_t)w->parts)
        return -ENOSPC;
    for (int i = 0; i < w->parts; i++) {
        struct sst_sim_exposure exposure = *e;
        int err;

        exposure.cam = camera_of(w, e->cam, i);
        parts[i] = (struct sst_sim_room){ w->part + (size_t)i * w->part_bytes, w->part_bytes };
        err = camera_frame(w, &exposure, one, parts[i], &parts[i].bytes);
        if (err)
            return err;
        if (m.part_bytes)
            sim_mosaic_rows(out.data, parts[i].data, &m, i);
    }
    *bytes = m.part_bytes * (size_t)w->parts;
    return m.part_bytes ? 0 : sim_mosaic_jpeg(&m, parts, out, bytes);
}

int sst_sim_world_frame(struct sst_sim_world *w, const struct sst_sim_exposure *e, struct sst_sim_format format,
                        struct sst_sim_room out, size_t *bytes)
{
    if (e->cam < 0 || e->cam >= w->cams / w->parts)
        return -EINVAL;
    return w->parts > 1 ? device_frame(w, e, format, out, bytes) : camera_frame(w, e, format, out, bytes);
}
