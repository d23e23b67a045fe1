/* `sst render` and `sst sweep` of light fields with a pose for every view. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "cli/posed_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/video/mp4.h"

#define CELSIUS      273.15
#define USUAL_SWEEP  0.1 /* of the surface's distance, to both sides */
#define JPEG_QUALITY 95

/* --- one picture ----------------------------------------------------------------------------------------------------
 */

/* Levels that become the 8 bits of pictures; white 0: all. */
static struct sst_samples stretch_of(const struct posed_scene *scene, const struct sst_posed_rendered *made)
{
    return made->levels.white == 255 ? (struct sst_samples){ 0, 0 } : scene->levels.white ? scene->levels : made->stretch;
}

static int write_8bit(const struct sst_deep *levels, struct sst_samples stretch, const char *out)
{
    struct sst_image image = { 0 };
    int err = sst_deep_to_image(&image, levels, stretch);

    if (err)
        sst_log_error("no memory for a picture of %d x %d", levels->width, levels->height);
    else if (cli_has_suffix(out, ".png"))
        err = sst_image_write_png(&image, out);
    else
        err = sst_image_write_jpeg(&image, out, JPEG_QUALITY);
    sst_image_fini(&image);
    return err;
}

/* Floats: levels, or degrees Celsius of thermal views. */
static int write_floats(struct sst_map_f32 *mean, const struct sst_posed *posed, const char *out)
{
    for (int y = 0; y < mean->height && posed->kelvin_scale > 0; y++) {
        float *row = sst_map_f32_row(mean, y);

        for (int x = 0; x < mean->width; x++)
            row[x] = (float)((double)row[x] * posed->kelvin_scale + posed->kelvin_offset - CELSIUS);
    }
    return sst_map_f32_write_pfm(mean, out);
}

static int write_views(const struct sst_map_u16 *views, const char *path)
{
    return sst_map_u16_write_png(views, path);
}

static double seen_percent(const struct sst_map_u16 *views)
{
    int64_t n = 0;

    for (int y = 0; y < views->height; y++) {
        for (int x = 0; x < views->width; x++)
            n += sst_map_u16_row(views, y)[x] > 0;
    }
    return 100.0 * (double)n / ((double)views->width * views->height);
}

static void report_ground(const struct posed_scene *scene, const char *out)
{
    const struct sst_posed_ground *ground = &scene->ground;

    if (ground->views)
        printf("%s: ground %.2f m in front of %s, tilted by %.1f degrees, found by %d views\n", out,
               ground->distance_mm * 1e-3, scene->view, ground->tilt_deg, ground->views);
    if (scene->mapped)
        printf("%s: terrain of a map, taken to the axes of the light field, %.2f to %.2f m about its altitude of %.2f m\n", out,
               scene->cfg.surface.low_mm * 1e-3, scene->cfg.surface.high_mm * 1e-3, scene->posed.altitude_m);
}

static void report(const struct posed_scene *scene, const struct sst_posed_rendered *made, const char *out,
                   struct sst_samples stretch)
{
    char text[100];

    report_ground(scene, out);
    if (stretch.white > 0)
        printf("%s: 8 bits, %s stretched over them; .png and .tif keep 16\n", out,
               cli_posed_levels(text, &scene->posed, stretch));
    if (cli_has_suffix(out, ".pfm"))
        printf("%s: %s\n", out, scene->posed.kelvin_scale > 0 ? "degrees Celsius" : "levels, not rounded");
    sst_log_info("%d of %d views, %.2f %% of the pixels are seen", sst_posed_placed(&scene->posed), scene->posed.count,
                 seen_percent(&made->views));
}

int cli_posed_render(struct posed_scene *scene, const struct render_args *a, const char *out, const char *valid)
{
    const int64_t start_ns = sst_clock_now_ns();
    struct sst_posed_rendered made = { 0 };
    struct sst_samples stretch = { 0, 0 };
    int err = sst_posed_render(&made, &scene->posed, scene->path, &scene->cfg);
    const double ms = (double)(sst_clock_now_ns() - start_ns) * 1e-6;

    if (!err) {
        if (cli_has_suffix(out, ".pfm"))
            err = write_floats(&made.mean[0], &scene->posed, out);
        else if (cli_has_suffix(out, ".tif") || cli_has_suffix(out, ".tiff") ||
                 (cli_has_suffix(out, ".png") && made.levels.white > 255))
            err = sst_deep_write(&made.levels, out);
        else
            err = write_8bit(&made.levels, stretch = stretch_of(scene, &made), out);
    }
    if (!err && valid)
        err = write_views(&made.views, valid);
    if (!err && !a->json) {
        report(scene, &made, out, stretch);
    } else if (!err) {
        json_t *root = cli_posed_scene_json(scene);

        json_object_update_new(root, json_pack("{s:s, s:f, s:f}", "output", out, "seen_percent",
                                               seen_percent(&made.views), "render_ms", ms));
        json_object_set_new(root, "stretch",
                            stretch.white > 0 ? json_pack("[i, i]", stretch.black, stretch.white) : json_null());
        cli_dump_json(root, JSON_INDENT(2));
    }
    sst_posed_rendered_fini(&made);
    return cli_exit_code(err);
}

/* --- sweep ----------------------------------------------------------------------------------------------------------
 */

static int frame_count(const struct posed_sweep *s)
{
    return s->bounce && s->steps > 2 ? 2 * s->steps - 2 : s->steps;
}

static double height_of(const struct posed_sweep *s, int frame)
{
    const int step = frame < s->steps ? frame : 2 * s->steps - 2 - frame;

    return s->steps > 1 ? s->from_m + (s->to_m - s->from_m) * step / (s->steps - 1) : s->from_m;
}

static int render_height(struct sst_posed_rendered *made, const struct posed_scene *scene, double height_m)
{
    struct sst_posed_render_config cfg = scene->cfg;

    cfg.surface = sst_surface_moved(&scene->cfg.surface, height_m * 1000);
    return sst_posed_render(made, &scene->posed, scene->path, &cfg);
}

/* Frames have the stretch of the first one, so that they do not flicker. */
static int write_frames(const struct posed_scene *scene, struct posed_sweep *s, const char *dir, struct sst_mp4 *video)
{
    struct sst_samples stretch = { 0, 0 };
    int err = 0;

    for (int i = 0; i < frame_count(s) && !err; i++) {
        struct sst_posed_rendered made = { 0 };
        char path[SST_PATH_MAX], name[32];

        cli_progress((void *)"sweep", (double)i / frame_count(s));
        err = render_height(&made, scene, height_of(s, i));
        snprintf(name, sizeof(name), "%04d.png", i);
        if (!err && video) {
            struct sst_image image = { 0 };

            stretch = i ? stretch : stretch_of(scene, &made);
            err = sst_deep_to_image(&image, &made.levels, stretch);
            err = err ? err : sst_mp4_add(video, &image);
            sst_image_fini(&image);
        } else if (!err) {
            err = sst_path_join(path, dir, name);
            err = err                       ? err
                  : made.levels.white > 255 ? sst_deep_write(&made.levels, path)
                                            : write_8bit(&made.levels, stretch, path);
        }
        sst_posed_rendered_fini(&made);
    }
    cli_progress_end();
    s->stretch = stretch;
    return err;
}

static json_t *describe(const struct posed_scene *scene, const struct posed_sweep *s)
{
    json_t *frames = json_array(), *root = cli_posed_scene_json(scene);

    for (int i = 0; i < frame_count(s); i++) {
        char name[32];

        snprintf(name, sizeof(name), "%04d.png", i);
        json_array_append_new(frames, json_pack("{s:s, s:f}", "file", name, "height_m", height_of(s, i)));
    }
    json_object_update_new(root, json_pack("{s:s, s:f, s:o}", "source", scene->path, "fps", s->fps, "frames", frames));
    return root;
}

static int write_folder(const struct posed_scene *scene, struct posed_sweep *s, bool force)
{
    struct sst_outdir dir;
    int err = sst_outdir_open(&dir, s->out, force);

    if (err)
        return err;
    err = write_frames(scene, s, dir.temporary, NULL);
    if (!err) {
        json_t *root = describe(scene, s);

        err = cli_write_json(root, dir.temporary, "sweep.json");
        json_decref(root);
    }
    return sst_outdir_end(&dir, err);
}

static int write_video(const struct posed_scene *scene, struct posed_sweep *s)
{
    const struct sst_mp4_config cfg = {
        .width = scene->cfg.camera.width, .height = scene->cfg.camera.height, .rate_hz = s->fps
    };
    struct sst_mp4 *v = NULL;
    int err = sst_mp4_open(&v, s->out, &cfg);

    if (!err)
        err = write_frames(scene, s, NULL, v);
    if (!err)
        err = sst_mp4_commit(v);
    sst_mp4_close(v);
    return err;
}

/* Distance of the surface in the middle of the picture, m; INFINITY: none is there. */
static double surface_distance(const struct posed_scene *scene)
{
    const struct sst_virtual *camera = &scene->cfg.camera;
    double ray[3];

    sst_virtual_ray(camera, (camera->width - 1) / 2.0, (camera->height - 1) / 2.0, ray);
    return sst_surface_meet(&scene->cfg.surface, camera->centre_mm, ray) * 1e-3;
}

/* A tenth of the surface's distance, below and above it. */
static void find_ends(const struct posed_scene *scene, struct posed_sweep *s)
{
    const double distance = surface_distance(scene);

    if (!isnan(s->from_m))
        return;
    s->to_m = isfinite(distance) ? USUAL_SWEEP * distance : 1;
    s->from_m = -s->to_m;
}

/* The surface, and the heights above it. */
static void report_sweep(const struct posed_scene *scene, const struct posed_sweep *s)
{
    const double distance = surface_distance(scene);
    char text[100];

    report_ground(scene, s->out);
    if (s->stretch.white > 0)
        printf("%s: 8 bits, %s stretched over them in all pictures\n", s->out,
               cli_posed_levels(text, &scene->posed, s->stretch));
    if (!scene->ground.views && isfinite(distance))
        printf("%s: %s %.2f m in front of %s\n", s->out,
               scene->cfg.surface.kind == SST_SURFACE_TERRAIN ? "terrain" : "plane", distance, scene->view);
    printf("%s: %d pictures, heights from %.2f to %.2f m above it\n", s->out, frame_count(s), s->from_m, s->to_m);
}

int cli_posed_sweep(struct posed_scene *scene, const struct render_args *a, struct posed_sweep *sweep)
{
    int err;

    find_ends(scene, sweep);
    err = cli_has_suffix(sweep->out, ".mp4") ? write_video(scene, sweep) : write_folder(scene, sweep, a->force);
    if (!err && !a->json) {
        report_sweep(scene, sweep);
    } else if (!err) {
        json_t *root = cli_posed_scene_json(scene);

        json_object_update_new(root, json_pack("{s:s, s:i, s:s, s:f, s:f}", "output", sweep->out, "frames",
                                               frame_count(sweep), "over", "height", "from_m", sweep->from_m, "to_m",
                                               sweep->to_m));
        json_object_set_new(root, "stretch", sweep->stretch.white > 0
                                                 ? json_pack("[i, i]", sweep->stretch.black, sweep->stretch.white)
                                                 : json_null());
        cli_dump_json(root, JSON_INDENT(2));
    }
    return cli_exit_code(err);
}
