/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "cli/find_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/posed/picture.h"

#define METRE_MM 1000.0
#define CROP     96 /* px around a find, of the integral and of the view that shows it best */
#define ENLARGED 3
#define CENTRED  32768 /* level of a view's median in the integral of one channel */
#define SHOWN    9999 /* finds with a picture of their own */

struct search {
    struct posed_scene scene;
    struct render_args args; /* of the surface and the view */
    struct sst_find_config cfg;
    const char *by, *out, *path;
    const char *paths[SST_FIND_MOMENTS + 1]; /* all; `path` has the view and the ground */
    struct find_moments moments;
    double interval_s;
    bool json, force, dark;
    struct sst_finds finds;
    struct sst_samples stretch[2]; /* of the integral's pictures and of the views'; white 0: 8 bits as they are */
};

/* --- finds as text and JSON ----------------------------------------------------------------------------------------
 */

/* Views of a moment, or of the light field that is one set. */
static const struct sst_posed *posed_of(const struct search *s, int m)
{
    return s->finds.moments ? &s->moments.part[m] : &s->scene.posed;
}

static const struct sst_finds *maps_of(const struct search *s, int m)
{
    return s->finds.moments ? &s->finds.each[m] : &s->finds;
}

static const struct sst_find_step *step_of(const struct search *s, int i, int m)
{
    return &s->finds.step[i * s->finds.moments + m];
}

static const char *best_name(const struct search *s, const struct sst_found *f)
{
    return f->best >= 0 ? posed_of(s, f->moment - 1)->view[f->best].name : NULL;
}

static json_t *step_json(const struct search *s, int i, int m)
{
    const struct sst_find_step *step = step_of(s, i, m);
    json_t *json = json_pack("{s:f, s:[o, o, o], s:[f, f], s:o, s:i, s:i}", "time_s", s->moments.time_s[m], "position_m",
                             cli_real_json(step->at_mm[0] / METRE_MM), cli_real_json(step->at_mm[1] / METRE_MM),
                             cli_real_json(step->at_mm[2] / METRE_MM), "pixel", step->x, step->y, "score",
                             cli_real_json(step->score), "views", step->views, "looking", step->seen);

    if (!isnan(step->latitude))
        json_object_update_new(json, json_pack("{s:f, s:f}", "latitude", step->latitude, "longitude", step->longitude));
    if (step->best >= 0)
        json_object_update_new(json, json_pack("{s:s, s:[f, f]}", "best_view", posed_of(s, m)->view[step->best].name,
                                               "best_pixel", step->best_x, step->best_y));
    return json;
}

static json_t *found_json(const struct search *s, const struct sst_found *f)
{
    const char *best = best_name(s, f);
    json_t *json =
        json_pack("{s:f, s:[f, f], s:[i, i, i, i], s:[o, o, o], s:f, s:i, s:i}", "score", f->blob.score, "pixel",
                  f->blob.x, f->blob.y, "box", f->blob.box.x0, f->blob.box.y0, f->blob.box.x1, f->blob.box.y1,
                  "position_m", cli_real_json(f->at_mm[0] / METRE_MM), cli_real_json(f->at_mm[1] / METRE_MM),
                  cli_real_json(f->at_mm[2] / METRE_MM), "size_m", f->size_m, "views", f->views, "looking", f->seen);

    if (!isnan(f->latitude))
        json_object_update_new(json, json_pack("{s:f, s:f}", "latitude", f->latitude, "longitude", f->longitude));
    if (best)
        json_object_update_new(json, json_pack("{s:s, s:[f, f], s:i}", "best_view", best, "best_pixel", f->best_x,
                                               f->best_y, "moment", f->moment));
    if (s->finds.moments) {
        json_t *path = json_array();

        for (int m = 0; m < s->finds.moments; m++)
            json_array_append_new(path, step_json(s, (int)(f - s->finds.found), m));
        json_object_update_new(json, json_pack("{s:f, s:o, s:o}", "speed_m_s", f->speed_m_s, "heading_deg",
                                               cli_real_json(f->heading_deg), "path", path));
    }
    return json;
}

static json_t *moments_json(const struct search *s)
{
    json_t *moments = json_array();

    for (int m = 0; m < s->finds.moments; m++) {
        json_t *moment = json_pack("{s:s, s:f, s:i}", "lightfield", s->moments.path[m], "time_s", s->moments.time_s[m],
                                   "views", sst_posed_placed(posed_of(s, m)));

        if (s->moments.number[m])
            json_object_set_new(moment, "moment", json_integer(s->moments.number[m]));
        json_array_append_new(moments, moment);
    }
    return moments;
}

static json_t *search_json(const struct search *s)
{
    json_t *finds = json_array(), *json;

    for (int i = 0; i < s->finds.count; i++)
        json_array_append_new(finds, found_json(s, &s->finds.found[i]));
    json = json_pack("{s:s, s:o, s:f, s:f, s:b, s:o}", "lightfield", s->path, "scene", cli_posed_scene_json(&s->scene),
                     "threshold", s->finds.threshold, "hectares", s->finds.hectares, "metric", s->scene.posed.metric,
                     "finds", finds);
    if (json && s->stretch[0].white)
        json_object_set_new(json, "levels",
                            json_pack("{s:[i, i], s:[i, i]}", "integral",
                                      s->stretch[0].black - (s->finds.channels == 1 ? CENTRED : 0),
                                      s->stretch[0].white - (s->finds.channels == 1 ? CENTRED : 0), "views",
                                      s->stretch[1].black, s->stretch[1].white));
    if (json && s->finds.moments)
        json_object_set_new(json, "moments", moments_json(s));
    if (json && !isnan(s->finds.alarms))
        json_object_set_new(json, "expected_false_per_hectare", json_real(s->finds.alarms));
    return json;
}

/* RFC 7946: points in longitude and latitude, lines of finds that walk. */
static json_t *geometry(const struct search *s, int i)
{
    const struct sst_found *f = &s->finds.found[i];
    json_t *line = json_array();

    if (!(f->speed_m_s > 0)) {
        json_decref(line);
        return json_pack("{s:s, s:[f, f]}", "type", "Point", "coordinates", f->longitude, f->latitude);
    }
    for (int m = 0; m < s->finds.moments; m++) {
        const struct sst_find_step *step = step_of(s, i, m);

        if (!isnan(step->latitude))
            json_array_append_new(line, json_pack("[f, f]", step->longitude, step->latitude));
    }
    if (json_array_size(line) > 1)
        return json_pack("{s:s, s:o}", "type", "LineString", "coordinates", line);
    json_decref(line);
    return json_pack("{s:s, s:[f, f]}", "type", "Point", "coordinates", f->longitude, f->latitude);
}

static json_t *geojson(const struct search *s)
{
    json_t *features = json_array();

    for (int i = 0; i < s->finds.count; i++) {
        const struct sst_found *f = &s->finds.found[i];

        if (!isnan(f->latitude))
            json_array_append_new(features, json_pack("{s:s, s:o, s:o}", "type", "Feature", "geometry", geometry(s, i),
                                                      "properties", found_json(s, f)));
    }
    return json_pack("{s:s, s:o}", "type", "FeatureCollection", "features", features);
}

static int write_json(json_t *json, const char *dir, const char *name)
{
    char path[SST_PATH_MAX], *text = json ? json_dumps(json, JSON_INDENT(1)) : NULL;
    int err = text ? sst_path_join(path, dir, name) : -ENOMEM;

    if (!text)
        sst_log_error("%s cannot be written: not enough memory, or a name in it is not UTF-8", name);
    err = err ? err : sst_file_write(path, text, strlen(text));
    free(text);
    json_decref(json);
    return err;
}

/* Levels of one channel are less their view's median in the integral. */
static void print_stretches(const struct search *s)
{
    const struct sst_posed *posed = &s->scene.posed;
    const int middle = s->finds.channels == 1 ? CENTRED : 0;
    const double scale = posed->kelvin_scale;
    char text[100];

    if (!s->stretch[0].white)
        return;
    printf("finds.png: black to white are levels %d to %d%s", s->stretch[0].black - middle, s->stretch[0].white - middle,
           middle ? " about each view's median" : "");
    if (middle && scale > 0)
        printf(" (%+.1f to %+.1f degrees)", (s->stretch[0].black - middle) * scale, (s->stretch[0].white - middle) * scale);
    if (s->stretch[1].white)
        printf("; of views %s", cli_posed_levels(text, posed, s->stretch[1]));
    putchar('\n');
}

static void print_table(const struct search *s)
{
    const char *unit = s->scene.posed.metric ? "m" : "units";

    if (s->scene.ground.views)
        printf("ground %.2f %s in front of %s, tilted by %.1f degrees, found by %d views\n",
               s->scene.ground.distance_mm / METRE_MM, unit, s->scene.view, s->scene.ground.tilt_deg,
               s->scene.ground.views);
    printf("%d %s on %.3g %s, threshold %.2f spreads", s->finds.count, s->finds.count == 1 ? "find" : "finds",
           s->scene.posed.metric ? s->finds.hectares : s->finds.hectares * 1e4,
           s->scene.posed.metric ? "ha" : "square units", s->finds.threshold);
    if (!isnan(s->finds.alarms) && s->cfg.alarms > 0)
        printf(", the background is expected to make %.2g a hectare", s->finds.alarms);
    if (s->finds.moments)
        printf(", %d moments in %.3g s", s->finds.moments, s->moments.time_s[s->finds.moments - 1]);
    putchar('\n');
    print_stretches(s);
    for (int i = 0; i < s->finds.count; i++) {
        const struct sst_found *f = &s->finds.found[i];

        printf("%3d  score %5.1f  at %.2f, %.2f, %.2f %s", i + 1, f->blob.score, f->at_mm[0] / METRE_MM,
               f->at_mm[1] / METRE_MM, f->at_mm[2] / METRE_MM, unit);
        if (!isnan(f->latitude))
            printf(" (%.7f, %.7f)", f->latitude, f->longitude);
        printf("  size %.2f %s  shown by %d of %d views", f->size_m, unit, f->views, f->seen);
        if (f->best >= 0)
            printf(", best by %s", best_name(s, f));
        if (f->speed_m_s > 0)
            printf("  walks %.1f %s/s towards %.0f degrees", f->speed_m_s, unit, f->heading_deg);
        else if (s->finds.moments)
            printf("  stands");
        putchar('\n');
    }
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

/* A level of the integral; where no view sees the surface, the one that most of it has. */
static uint16_t level_at(const struct search *s, const struct sst_map_f32 *map, int x, int y, double middle)
{
    const double scale = s->finds.channels == 3 && s->scene.posed.bits == 8 ? 257 : 1;
    const double v = (double)sst_map_f32_row(map, y)[x];

    return (uint16_t)fmin(fmax((isnan(v) ? middle : v) * scale + 0.5, 0), 65535);
}

static double mean_of(const struct sst_map_f32 *map)
{
    double sum = 0, n = 0;

    for (int y = 0; y < map->height; y++) {
        for (int x = 0; x < map->width; x++) {
            const double v = (double)sst_map_f32_row(map, y)[x];

            sum += isnan(v) ? 0 : v;
            n += !isnan(v);
        }
    }
    return n > 0 ? sum / n : 0;
}

static int stretch_view(const struct search *s, struct sst_samples *all, int m, int view)
{
    struct sst_deep picture = { 0 };
    struct sst_samples own;
    const int err = sst_posed_picture(&picture, posed_of(s, m), s->finds.moments ? s->moments.path[m] : s->path, view);

    if (err)
        return err;
    own = sst_deep_stretch(&picture);
    all->black = sst_min_int(all->black, own.black);
    all->white = sst_max_int(all->white, own.white);
    sst_deep_fini(&picture);
    return 0;
}

/* Levels of all views that are shown. */
static int stretch_views(struct search *s)
{
    struct sst_samples all = { 65535, 0 };
    int err = 0;

    for (int m = 0; m < sst_max_int(s->finds.moments, 1) && !err; m++) {
        bool done[SST_POSED_MAX_VIEWS] = { false };

        for (int i = 0; i < s->finds.count && i < SHOWN && !err; i++) {
            const int view = s->finds.moments ? step_of(s, i, m)->best : s->finds.found[i].best;

            if (view < 0 || done[view])
                continue;
            done[view] = true;
            err = stretch_view(s, &all, m, view);
        }
    }
    s->stretch[1] = all.white ? all : (struct sst_samples){ 0, 0 };
    return err;
}

/* One stretch of all pictures of the integral, and one of all views: colours of 8 bits are shown as they are. */
static int choose_stretches(struct search *s, const struct sst_deep *integral)
{
    const struct sst_posed *posed = &s->scene.posed;

    if (posed->bits == 8 && posed->channels == 3)
        return 0;
    s->stretch[0] = sst_deep_stretch(integral);
    s->stretch[1] = s->scene.levels.white ? s->scene.levels : posed->samples;
    return s->stretch[1].white ? 0 : stretch_views(s);
}

/* The integral, stretched as the pixels that views see ask for; the others are black. */
static int picture_of_integral(struct sst_image *out, struct search *s, int m)
{
    const struct sst_finds *maps = maps_of(s, m);
    const int w = maps->score.width, h = maps->score.height;
    struct sst_deep levels = { 0 };
    int err = sst_deep_init(&levels, w, h, s->finds.channels, 65535);

    for (int c = 0; c < s->finds.channels && !err; c++) {
        const double middle = mean_of(&maps->integral[c]);

        for (int i = 0; i < w * h; i++)
            sst_map_u16_row(&levels.plane[c], i / w)[i % w] = level_at(s, &maps->integral[c], i % w, i / w, middle);
    }
    if (!err && m == s->finds.middle) /* the first that is made */
        err = choose_stretches(s, &levels);
    err = err ? err : sst_deep_to_image(out, &levels, s->stretch[0]);
    sst_deep_fini(&levels);
    for (int i = 0; !err && i < w * h; i++) {
        for (int c = 0; c < 3 && !sst_map_u16_row(&maps->views, i / w)[i % w]; c++)
            sst_image_row(out, c, i / w)[i % w] = 0;
    }
    return err;
}

static void put(struct sst_image *image, int x, int y, const uint8_t rgb[3])
{
    for (int c = 0; c < 3 && x >= 0 && y >= 0 && x < image->width && y < image->height; c++)
        sst_image_row(image, c, y)[x] = rgb[c];
}

/* A frame one pixel wide, `margin` outside a box. */
static void frame(struct sst_image *image, struct sst_rect box, int margin)
{
    static const uint8_t yellow[3] = { 255, 214, 0 };

    for (int x = box.x0 - margin; x < box.x1 + margin; x++) {
        put(image, x, box.y0 - margin, yellow);
        put(image, x, box.y1 + margin - 1, yellow);
    }
    for (int y = box.y0 - margin; y < box.y1 + margin; y++) {
        put(image, box.x0 - margin, y, yellow);
        put(image, box.x1 + margin - 1, y, yellow);
    }
}

/* CROP pixels around a place, enlarged, into a picture from a pixel on. */
static void crop(struct sst_image *to, const int at[2], const struct sst_image *from, double x, double y)
{
    const int x0 = (int)floor(x + 0.5) - CROP / 2, y0 = (int)floor(y + 0.5) - CROP / 2;

    for (int c = 0; c < 3; c++) {
        for (int r = 0; r < CROP * ENLARGED; r++) {
            for (int k = 0; k < CROP * ENLARGED; k++) {
                const int at_x = x0 + k / ENLARGED, at_y = y0 + r / ENLARGED;
                const bool inside = at_x >= 0 && at_y >= 0 && at_x < from->width && at_y < from->height;

                sst_image_row(to, c, at[1] + r)[at[0] + k] = inside ? sst_image_row(from, c, at_y)[at_x] : 0;
            }
        }
    }
}

/* A view around a pixel of it. */
static int crop_view(struct sst_image *to, const int at[2], const struct search *s, int m, const struct sst_find_step *step)
{
    struct sst_image image = { 0 };
    struct sst_deep picture = { 0 };
    int err;

    err = sst_posed_picture(&picture, posed_of(s, m), s->finds.moments ? s->moments.path[m] : s->path, step->best);
    err = err ? err : sst_deep_to_image(&image, &picture, s->stretch[1]);
    if (!err)
        crop(to, at, &image, step->best_x, step->best_y);
    sst_deep_fini(&picture);
    sst_image_fini(&image);
    return err;
}

/* Pictures of a find: in the integral, and beside it in the view that shows it best; of several moments a column each,
 * the view below the integral, centred on the path. @param integral  [moments] */
static int write_find(const struct search *s, const struct sst_image *integral, int i, const char *dir)
{
    const struct sst_found *f = &s->finds.found[i];
    const int side = CROP * ENLARGED, moments = s->finds.moments;
    struct sst_image strip = { 0 };
    char name[64], path[SST_PATH_MAX];
    int err = sst_image_init(&strip, moments ? moments * side : 2 * side, moments ? 2 * side : side);

    snprintf(name, sizeof(name), "find-%02d.png", i + 1);
    if (!err && !moments)
        crop(&strip, (int[]){ 0, 0 }, integral, f->blob.x, f->blob.y);
    if (!err && !moments && f->best >= 0)
        err = crop_view(&strip, (int[]){ side, 0 }, s, 0,
                        &(struct sst_find_step){ .best = f->best, .best_x = f->best_x, .best_y = f->best_y });
    for (int m = 0; m < moments && !err; m++) {
        const struct sst_find_step *step = step_of(s, i, m);

        if (!isnan(step->at_mm[0]))
            crop(&strip, (int[]){ m * side, 0 }, &integral[m], step->x, step->y);
        if (step->best >= 0)
            err = crop_view(&strip, (int[]){ m * side, side }, s, m, step);
    }
    err = err ? err : sst_path_join(path, dir, name);
    err = err ? err : sst_image_write_png(&strip, path);
    sst_image_fini(&strip);
    return err;
}

/* Dots from step to step of a path. */
static void draw_path(struct sst_image *image, const struct search *s, int i)
{
    static const uint8_t yellow[3] = { 255, 214, 0 };

    for (int m = 0; m + 1 < s->finds.moments && s->finds.found[i].speed_m_s > 0; m++) {
        const struct sst_find_step *a = step_of(s, i, m), *b = step_of(s, i, m + 1);
        const double length = hypot(b->x - a->x, b->y - a->y);

        for (double t = 0; t <= length && length < image->width + image->height; t++)
            put(image, (int)lround(a->x + (b->x - a->x) * t / fmax(length, 1)),
                (int)lround(a->y + (b->y - a->y) * t / fmax(length, 1)), yellow);
    }
}

static int write_folder(struct search *s, const char *dir)
{
    const int count = sst_max_int(s->finds.moments, 1), middle = s->finds.middle;
    struct sst_image integral[SST_FIND_MOMENTS] = { { 0 } };
    char path[SST_PATH_MAX];
    int err = picture_of_integral(&integral[middle], s, middle);

    for (int m = 0; m < count && !err; m++)
        err = m == middle ? 0 : picture_of_integral(&integral[m], s, m);
    for (int i = 0; i < s->finds.count && i < SHOWN && !err; i++)
        err = write_find(s, integral, i, dir);
    for (int i = 0; i < s->finds.count && !err; i++) {
        draw_path(&integral[middle], s, i);
        frame(&integral[middle], s->finds.found[i].blob.box, 4);
    }
    err = err ? err : sst_path_join(path, dir, "finds.png");
    err = err ? err : sst_image_write_png(&integral[middle], path);
    err = err ? err : write_json(search_json(s), dir, "finds.json");
    if (!err && posed_of(s, middle)->geographic)
        err = write_json(geojson(s), dir, "finds.geojson");
    for (int m = 0; m < count; m++)
        sst_image_fini(&integral[m]);
    return err;
}

static int write_out(struct search *s)
{
    struct sst_outdir dir = { 0 };
    int err = sst_outdir_open(&dir, s->out, s->force);

    if (err)
        return err;
    err = write_folder(s, dir.temporary);
    if (err) {
        sst_outdir_abort(&dir);
        return err;
    }
    return sst_outdir_commit(&dir);
}

/* --- command ------------------------------------------------------------------------------------------------------ */

static int search(const struct cli_command *cmd, struct search *s)
{
    const struct sst_find_scene scene = { &s->scene.posed, s->path, &s->scene.cfg.camera, &s->scene.cfg.surface, 0 };
    struct sst_find_scene moment[SST_FIND_MOMENTS];
    int err;

    if (s->dark && (s->cfg.by == SST_FIND_VIEWS || (s->cfg.by == SST_FIND_CHOOSE && s->scene.posed.channels == 3)))
        return cli_usage_error(
            cmd, "--dark seeks by the integral; colour views are searched by their scores: add --by integral");
    if (s->cfg.alarms > 0 &&
        (s->cfg.by == SST_FIND_VIEWS || (s->cfg.by == SST_FIND_CHOOSE && s->scene.posed.channels == 3)))
        return cli_usage_error(
            cmd, "--alarms is for --by integral: scores by views do not tell how often the background reaches them");
    s->scene.cfg.camera = sst_find_camera(&s->scene.cfg.camera, &s->scene.cfg.surface);
    s->cfg.sign = s->dark ? -1 : 1;
    s->cfg.threads = s->args.cfg.threads;
    for (int m = 0; m < s->moments.count; m++)
        moment[m] = (struct sst_find_scene){ &s->moments.part[m], s->moments.path[m], scene.camera, scene.surface,
                                             s->moments.time_s[m] };
    err = s->moments.count ? sst_posed_find_walkers(&s->finds, moment, s->moments.count, &s->cfg)
                           : sst_posed_find(&s->finds, &scene, &s->cfg);
    if (!err && !s->finds.count && s->finds.hectares * 1e4 < s->cfg.most_m * s->cfg.most_m)
        sst_log_warning("%s: the ground that is seen is smaller than the largest find, --most %g %s; its lengths may be of another "
                        "unit: see --unit of the import, or `sst poses --spacing`",
                        s->path, s->cfg.most_m, s->scene.posed.metric ? "m" : "units");
    if (!err && s->out)
        err = write_out(s);
    if (!err && s->json)
        err = cli_print_json(search_json(s));
    else if (!err)
        print_table(s);
    sst_finds_fini(&s->finds);
    return cli_exit_code(err == -ENODATA || err == -EINVAL ? -EBADMSG : err);
}

/* A light field that cannot be read: its loading says why. */
static bool is_denied(const char *dir)
{
    char path[SST_PATH_MAX];

    return !sst_path_join(path, dir, "lightfield.json") && sst_path_is_denied(path);
}

/* Light fields with poses; the middle one's view and ground are used. */
static int check_paths(struct search *s)
{
    int n = 0;

    for (; s->paths[n]; n++) {
        if (!sst_path_is_dir(s->paths[n])) {
            sst_log_error("%s: there is no such folder", s->paths[n]);
            return CLI_INPUT;
        }
        if (!sst_posed_is(s->paths[n]) && !is_denied(s->paths[n])) {
            sst_log_error("%s is no light field with a pose for every view; `sst import poses` or `pictures` makes one",
                          s->paths[n]);
            return CLI_INPUT;
        }
    }
    s->path = s->paths[n / 2];
    return CLI_GO_ON;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct search s = { .cfg = sst_find_defaults() };
    int r;
    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &s.out, "DIR",
          "folder to make: finds.json, finds.png, find-01.png ..., finds.geojson" },
        { "surface", 0, CLI_STRING, &s.args.surface, "S",
          "ground (found, default), plane:Z, plane:NX,NY,NZ,D, three points plane:X,Y,Z,... or a terrain file" },
        { "view", 0, CLI_STRING, &s.args.view, "NAME", "the view to look from (the middle one), or nadir" },
        { "levels", 0, CLI_STRING, &s.args.levels, "LOW,HIGH",
          "16 bits: the levels that become black and white in the pictures of views (found)" },
        { "utm", 0, CLI_STRING, &s.args.utm, "ZONE", "UTM zone of a terrain file that does not name it, as 33N" },
        { "near", 0, CLI_DOUBLE, &s.args.near_m, "M", "the ground is sought from this distance on", 1e-3, 1e6 },
        { "far", 0, CLI_DOUBLE, &s.args.far_m, "M", "... up to this one", 1e-3, 1e6 },
        { "by", 0, CLI_STRING, &s.by, "WAY", "integral (default of one channel) or views (default of colour)", 0, 0,
          "integral views" },
        { "dark", 0, CLI_FLAG, &s.dark, NULL, "integral: lower levels than around are sought, not higher ones" },
        { "threshold", 0, CLI_DOUBLE, &s.cfg.threshold, "T", "spreads; 4.5 by the integral, 7 by views, twice as many for several moments", 0.5, 1e3 },
        { "alarms", 0, CLI_DOUBLE, &s.cfg.alarms, "N", "... or the false finds a hectare that the background may make",
          1e-6, 1e6 },
        { "coverage", 0, CLI_DOUBLE, &s.cfg.coverage, "SHARE",
          "places count that this share of the most views see (0.5)", 0, 1 },
        { "least-views", 0, CLI_INT, &s.cfg.least_views, "N", "views that show a find (3)", 1, 4 },
        { "interval", 0, CLI_DOUBLE, &s.interval_s, "S", "seconds between moments (the light field's times, or 0.5)", 1e-3,
          1e3 },
        { "speed", 0, CLI_DOUBLE, &s.cfg.speed_m_s, "M", "fastest walk that is sought, m/s (2.5); 0: standing persons",
          0, 10 },
        { "least", 0, CLI_DOUBLE, &s.cfg.least_m, "M", "smallest find: diameter of a circle of its area (0.15)", 0,
          1e3 },
        { "most", 0, CLI_DOUBLE, &s.cfg.most_m, "M", "largest find (3.5)", 0, 1e4 },
        { "json", 0, CLI_FLAG, &s.json, NULL, "print one JSON object" },
        { "threads", 0, CLI_INT, &s.args.cfg.threads, "N", "threads; all processors", 1, 256 },
        { "force", 'f', CLI_FLAG, &s.force, NULL, "replace an existing folder" },
    };

    r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, s.paths, 1, SST_FIND_MOMENTS);
    if (r != CLI_GO_ON)
        return r;
    if (s.cfg.threshold > 0 && s.cfg.alarms > 0)
        return cli_usage_error(cmd, "--threshold and --alarms exclude each other");
    if (s.cfg.least_m >= s.cfg.most_m)
        return cli_usage_error(cmd, "--least %g is not below --most %g", s.cfg.least_m, s.cfg.most_m);
    r = check_paths(&s);
    if (r != CLI_GO_ON)
        return r;
    if (s.by)
        s.cfg.by = !strcmp(s.by, "views") ? SST_FIND_VIEWS : SST_FIND_INTEGRAL;
    if (s.out && sst_path_check_output(s.out, s.force, "finds.json", s.paths))
        return CLI_USAGE;
    r = cli_find_moments_load(&s.moments, s.paths);
    if (r == CLI_GO_ON)
        r = cli_posed_open(&s.scene, cmd, &s.args, s.path, (char *[]){ NULL });
    if (r == CLI_GO_ON) {
        r = cli_find_moments_open(&s.moments, &s.scene, s.interval_s);
        if (r == CLI_GO_ON)
            r = search(cmd, &s);
        cli_posed_close(&s.scene);
    }
    cli_find_moments_close(&s.moments);
    return r;
}

const struct cli_command cli_find = { "find", run };
