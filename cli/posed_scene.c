/* Light fields with a pose for every view, opened for rendering: their camera and surface. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"
#include "cli/posed_internal.h"
#include "pipeline/posed/find/sharpen.h"
#include "pipeline/posed/picture.h"

#define FEW_VIEWS    6     /* below, agreement on the ground is often less than on the canopy */
#define MANY_WARM    0.006 /* sharpness of warm places from which on these tell the ground's distance and tilt */
#define WARM_NEARER  0.9   /* ... least ratio of their distance to the distance of agreement */
#define WARM_FARTHER 1.1   /* ... and where they are fewer, */
#define FEW_AGREE    0.003 /* if a smaller share of pixels agrees */
#define METRE_MM     1000.0
#define CELSIUS      273.15
#define FARTHER_MESH 3   /* times as far below the camera with z upwards: it is down */
#define DEEPEST_MM   5e6 /* below the camera: lower heights are no ground but a number for unknown ones */
#define NADIR        "nadir"
#define ZERO_MISS    0.1 /* of the distance: where the ground is not at z = 0 */
#define KEEP_BYTES   1e9 /* of views that are read once, for the ground and for all pictures */
#define NADIR_PIXELS 3e7 /* at most, of a picture of a whole flight */

struct known_option {
    const char *name;
    char letter;
    bool flag;
};

static const struct known_option *find_option(const char *arg, size_t length)
{
    static const struct known_option known[] = {
        { "method", 'm', false }, { "output", 'o', false },  { "valid", 0, false },  { "surface", 0, false },
        { "utm", 0, false },      { "levels", 0, false },    { "view", 0, false },   { "near", 0, false },
        { "far", 0, false },      { "threads", 't', false }, { "json", 0, true },    { "force", 0, true },
        { "over", 0, false },     { "from", 0, false },      { "to", 0, false },     { "steps", 'n', false },
        { "fps", 0, false },      { "bounce", 0, true },     { "quiet", 'q', true }, { "verbose", 'v', true },
    };

    for (size_t i = 0; i < ARRAY_LEN(known); i++) {
        const struct known_option *o = &known[i];

        if (arg[1] == '-' ? strlen(o->name) + 2 == length && !strncmp(arg + 2, o->name, length - 2)
                          : arg[1] == o->letter)
            return o;
    }
    return NULL;
}

/* Options that lattices alone have are refused. The arguments were parsed before: values are there. */
static int check_options(const struct cli_command *cmd, char **argv)
{
    for (; *argv && strcmp(*argv, "--"); argv++) {
        const char *arg = *argv;
        const size_t length = arg[1] == '-' ? strcspn(arg, "=") : 2;
        const struct known_option *o;

        if (!cli_is_option(arg))
            continue;
        o = find_option(arg, length);
        if (!o)
            return cli_usage_error(cmd, "%.*s has no effect on a light field with a pose for every view", (int)length,
                                   arg);
        if (!o->flag && !arg[length])
            argv++; /* the value */
    }
    return CLI_GO_ON;
}

/* --- camera ---------------------------------------------------------------------------------------------------------
 */

/* Is a view's name `name`, with or without its ending? */
static bool named(const struct sst_posed_view *view, const char *name)
{
    const char *dot = strrchr(view->name, '.');

    return !strcmp(view->name, name) ||
           (dot && strlen(name) == (size_t)(dot - view->name) && !strncmp(view->name, name, strlen(name)));
}

static int find_view(int *view, const struct posed_scene *scene, const struct cli_command *cmd, const char *name)
{
    const struct sst_posed *posed = &scene->posed;
    char list[160] = "";

    *view = sst_posed_middle(posed);
    if (!name || !strcmp(name, NADIR))
        return CLI_GO_ON;
    for (int i = 0; i < posed->count; i++) {
        if (named(&posed->view[i], name)) {
            *view = i;
            if (posed->view[i].camera.known)
                return CLI_GO_ON;
            return cli_usage_error(cmd, "the view %s of %s is not placed; `sst poses` finds poses", name, scene->path);
        }
        sst_text_add(list, sizeof(list), "%s%s", i ? ", " : "", posed->view[i].name);
    }
    return cli_usage_error(cmd, "--view %s is neither " NADIR " nor a view of %s: %s%s", name, scene->path, list,
                           strlen(list) == sizeof(list) - 1 ? " ..." : "");
}

/* --- surface --------------------------------------------------------------------------------------------------------
 */

/* Numbers between commas. @return how many, -1: text that is none */
static int read_numbers(double *number, int most, const char *text)
{
    int n = 0;

    for (char *end; n < most; n++, text = end + 1) {
        number[n] = strtod(text, &end);
        if (end == text || !isfinite(number[n]) || fabs(number[n]) > 1e9)
            return -1;
        if (!*end)
            return n + 1;
        if (*end != ',')
            return -1;
    }
    return -1;
}

static bool vector_known(const double v[3])
{
    return v[0] != 0 || v[1] != 0 || v[2] != 0;
}

static int read_plane(struct posed_scene *scene, const struct cli_command *cmd, const char *text, bool level)
{
    const struct sst_virtual *camera = &scene->cfg.camera;
    double v[9], normal[3], point[3];
    const int n = read_numbers(v, 9, text);

    if (n == 1 && v[0] > 0) {
        level = level && vector_known(scene->posed.up);
        for (int i = 0; i < 3; i++) {
            normal[i] = level ? scene->posed.up[i] : -camera->rotation[6 + i];
            point[i] = camera->centre_mm[i] - v[0] * METRE_MM * normal[i];
        }
    } else if (n == 4 && hypot(hypot(v[0], v[1]), v[2]) > 1e-9) {
        const double length = hypot(hypot(v[0], v[1]), v[2]);
        const double above = v[0] * camera->centre_mm[0] + v[1] * camera->centre_mm[1] + v[2] * camera->centre_mm[2];
        const double sign = above < v[3] * METRE_MM ? -1 : 1; /* the normal is towards the camera */

        for (int i = 0; i < 3; i++) {
            normal[i] = sign * v[i];
            point[i] = v[i] * v[3] * METRE_MM / (length * length);
        }
    } else if (n == 9) {
        for (int i = 0; i < 9; i++)
            v[i] *= METRE_MM;
        if (!sst_surface_plane_of(&scene->cfg.surface, (const double(*)[3])v, camera->centre_mm))
            return cli_usage_error(cmd, "--surface plane:%s: the three points are on a line", text);
        return CLI_GO_ON;
    } else {
        return cli_usage_error(cmd,
                               "--surface plane:%s is neither a distance Z nor a normal and its offset NX,NY,NZ,D nor "
                               "three points X,Y,Z,X,Y,Z,X,Y,Z, in metres",
                               text);
    }
    scene->cfg.surface = sst_surface_plane(normal, point);
    return CLI_GO_ON;
}

/* Terrain above the camera is in other axes; a camera beside it may look at it. */
static int check_terrain(const struct posed_scene *scene, const char *path)
{
    const struct sst_surface *s = &scene->cfg.surface;
    const struct sst_heights *h = &scene->heights;
    double at[3] = { 0, 0, 0 };

    for (int i = 0; i < 3; i++) {
        at[0] += s->along[0][i] * scene->cfg.camera.centre_mm[i];
        at[1] += s->along[1][i] * scene->cfg.camera.centre_mm[i];
        at[2] += s->normal[i] * scene->cfg.camera.centre_mm[i];
    }
    if (at[2] < s->low_mm) {
        sst_log_error(
            "%s has heights of %.2f to %.2f m, all above the camera, which is at %.2f m; heights are above the "
            "zero of the light field's axes",
            path, s->low_mm / METRE_MM, s->high_mm / METRE_MM, at[2] / METRE_MM);
        return CLI_INPUT;
    }
    if (at[2] - s->low_mm > DEEPEST_MM)
        sst_log_warning("%s has heights down to %.0f m; if these stand for unknown ones, say so in the file "
                        "(gdal_edit.py -a_nodata %.0f FILE), or leave them out of a mesh",
                        path, s->low_mm / METRE_MM, s->low_mm / METRE_MM);
    for (int k = 0; k < 2; k++) {
        const double from = k ? h->y_mm : h->x_mm;
        const double to = from + (k ? h->step_y_mm * (h->mm.height - 1) : h->step_x_mm * (h->mm.width - 1));

        if (at[k] < fmin(from, to) || at[k] > fmax(from, to))
            sst_log_warning("%s covers %c from %.1f to %.1f m, and the camera is beside that, at %.1f m", path, 'x' + k,
                            fmin(from, to) / METRE_MM, fmax(from, to) / METRE_MM, at[k] / METRE_MM);
    }
    return CLI_GO_ON;
}

/* Turn a mesh of AOS, which has the axes of the poses, z down: heights with z upwards would be above the camera or much
 * farther below it. @return turned */
static bool turn_mesh(struct posed_scene *scene, const char *path)
{
    const struct sst_surface *s = &scene->cfg.surface;
    const double *up = scene->posed.up, middle = (s->low_mm + s->high_mm) / 2;
    struct sst_heights *h = &scene->heights;
    double height = 0;

    for (int i = 0; i < 3; i++)
        height += up[i] * scene->cfg.camera.centre_mm[i];
    if (!cli_has_suffix(path, ".obj") || up[2] > -0.99 || height + middle <= 0 ||
        (height - middle > 0 && height - middle < FARTHER_MESH * (height + middle)))
        return false;
    for (int y = 0; y < h->mm.height; y++) {
        float *row = sst_map_f32_row(&h->mm, y);

        for (int x = 0; x < h->mm.width; x++)
            row[x] = -row[x];
    }
    h->y_mm = -h->y_mm;
    h->step_y_mm = -h->step_y_mm;
    sst_log_warning("%s: z is read as downwards, as in the poses: so it is %.1f m below the camera, else %.1f m", path,
                    (height + middle) / METRE_MM, (height - middle) / METRE_MM);
    return true;
}

static int read_terrain(struct posed_scene *scene, const char *path, const char *utm)
{
    int err = sst_heights_read(&scene->heights, path);

    err = err ? err : sst_terrain_place(&scene->heights, &scene->mapped, &scene->posed, utm, path);
    if (err)
        return cli_exit_code(err);
    if (scene->heights.mm.width < 2 || scene->heights.mm.height < 2) {
        sst_log_error("%s has %d x %d heights; terrain is the surface between heights, so it needs 2 x 2 at least",
                      path, scene->heights.mm.width, scene->heights.mm.height);
        return CLI_INPUT;
    }
    err = sst_surface_terrain(&scene->cfg.surface, &scene->heights, scene->posed.up);
    if (!err && turn_mesh(scene, path))
        err = sst_surface_terrain(&scene->cfg.surface, &scene->heights, scene->posed.up);
    if (err)
        sst_log_error("%s: the direction of gravity is along the world's x axis, where terrain has no axes", path);
    return err ? cli_exit_code(-EBADMSG) : check_terrain(scene, path);
}

/* Thermal pictures of which a few patches agree tell no tilt, and may agree on the canopy: the plane on which warm
 * places are sharpest is the ground, if they are many and it is the same or a farther surface. */
static int prefer_warmth(struct posed_scene *scene, int threads)
{
    struct sst_posed_ground *ground = &scene->ground;
    const struct sst_virtual *camera = &scene->cfg.camera;
    struct sst_sharpened warm;
    double away;
    int err;

    if (!ground->weak || scene->posed.channels != 1)
        return 0;
    err = sst_posed_sharpen(&scene->posed, scene->path,
                            &(struct sst_sharpen_config){ .look = true, .threads = threads }, &warm);
    if (err)
        return err == -ENODATA ? 0 : err;
    away = sst_surface_meet(&warm.plane, camera->centre_mm, camera->rotation + 6);
    if (!isfinite(away) || away < WARM_NEARER * ground->distance_mm ||
        (warm.before < MANY_WARM &&
         (away < WARM_FARTHER * ground->distance_mm || ground->four[ground->chosen] >= FEW_AGREE)))
        return 0;
    ground->plane = warm.plane;
    ground->distance_mm = away;
    ground->tilt_deg = warm.tilt_deg;
    return 0;
}

/* AOS's worlds have their ground at z = 0: the ground that is found far from there may be the canopy. */
static void compare_with_zero(const struct posed_scene *scene)
{
    const struct sst_virtual *camera = &scene->cfg.camera;
    const double *up = scene->posed.up;
    double height = 0, along = 0;

    if (strncmp(scene->posed.source, "AOS", 3) != 0)
        return;
    for (int i = 0; i < 3; i++) {
        height += up[i] * camera->centre_mm[i];
        along -= up[i] * camera->rotation[6 + i];
    }
    if (height > 0 && along > 0.5 && fabs(scene->ground.distance_mm / (height / along) - 1) > ZERO_MISS)
        sst_log_warning(
            "%s: the ground is found %.2f m in front of the camera, but z = 0, the ground of AOS's poses, is "
            "%.2f m away; if what is found is the canopy, give --surface plane:%.2f",
            scene->path, scene->ground.distance_mm / METRE_MM, height / along / METRE_MM, height / along / METRE_MM);
}

static int find_ground(struct posed_scene *scene, const struct render_args *a)
{
    const struct sst_ground_config cfg = { .near_mm = a->near_m * METRE_MM,
                                           .far_mm = a->far_m * METRE_MM,
                                           .threads = a->cfg.threads };
    int err = sst_posed_ground(&scene->ground, &scene->posed, scene->path, &scene->cfg.camera, &cfg);

    if (!err && !(a->near_m > 0) && !(a->far_m > 0))
        err = prefer_warmth(scene, a->cfg.threads);
    scene->cfg.surface = scene->ground.plane;
    if (!err)
        compare_with_zero(scene);
    if (!err && scene->ground.views < FEW_VIEWS && !(a->near_m > 0))
        sst_log_warning("%s: %d views alone tell ground from canopy poorly: is the ground %.2f m away? If that is the "
                        "canopy, give --near or --surface plane:Z",
                        scene->path, scene->ground.views, scene->ground.distance_mm / METRE_MM);
    return err ? cli_exit_code(err == -ENODATA || err == -EINVAL ? -EBADMSG : err) : CLI_GO_ON;
}

static int find_surface(struct posed_scene *scene, const struct cli_command *cmd, const struct render_args *a)
{
    const char *text = a->surface ? a->surface : "ground";
    const bool nadir = a->view && !strcmp(a->view, NADIR);
    const bool terrain = cli_has_suffix(text, ".tif") || cli_has_suffix(text, ".tiff") || cli_has_suffix(text, ".obj");

    if (a->utm && !terrain)
        return cli_usage_error(cmd, "--utm is of --surface with a terrain file");
    if (!strcmp(text, "ground"))
        return find_ground(scene, a);
    if (a->near_m > 0 || a->far_m > 0)
        return cli_usage_error(cmd, "--near and --far are limits of --surface ground");
    if (!strncmp(text, "plane:", 6))
        return read_plane(scene, cmd, text + 6, nadir);
    if (terrain)
        return read_terrain(scene, text, a->utm);
    return cli_usage_error(cmd, "--surface %s is neither ground nor plane:... nor a terrain file (.tif, .obj)", text);
}

/* "LOW,HIGH" */
static int read_levels(struct posed_scene *scene, const struct cli_command *cmd, const char *text)
{
    double v[2];

    if (!text)
        return CLI_GO_ON;
    if (scene->posed.bits != 16)
        return cli_usage_error(cmd, "--levels is of pictures of 16 bits; those of %s have 8", scene->path);
    if (read_numbers(v, 2, text) != 2 || !(v[0] >= 0 && v[0] < v[1] && v[1] <= 65535) || v[0] != floor(v[0]) ||
        v[1] != floor(v[1]))
        return cli_usage_error(cmd, "--levels %s is not two ascending whole numbers of 0 to 65535, as 7000,7400", text);
    scene->levels = (struct sst_samples){ (int)v[0], (int)v[1] };
    return CLI_GO_ON;
}

const char *cli_posed_levels(char text[100], const struct sst_posed *posed, struct sst_samples stretch)
{
    snprintf(text, 100, "levels %d to %d", stretch.black, stretch.white);
    if (posed->kelvin_scale > 0)
        sst_text_add(text, 100, " (%.1f to %.1f degrees Celsius)",
                     stretch.black * posed->kelvin_scale + posed->kelvin_offset - CELSIUS,
                     stretch.white * posed->kelvin_scale + posed->kelvin_offset - CELSIUS);
    return text;
}

/* --- all ------------------------------------------------------------------------------------------------------------
 */

int cli_posed_open(struct posed_scene *scene, const struct cli_command *cmd, const struct render_args *a,
                   const char *path, char **argv)
{
    struct posed_scene s = { .path = path };
    int view, r = check_options(cmd, argv), err;

    if (r != CLI_GO_ON)
        return r;
    if (a->near_m > 0 && a->far_m > 0 && a->near_m >= a->far_m)
        return cli_usage_error(cmd, "--near %g is not nearer than --far %g", a->near_m, a->far_m);
    err = sst_posed_load(&s.posed, path);
    if (err)
        return cli_exit_code(err);
    sst_posed_keep(&s.posed, KEEP_BYTES);
    if (!sst_posed_placed(&s.posed)) {
        sst_log_error("%s: none of the %d views is placed; `sst poses %s` finds poses", path, s.posed.count, path);
        r = CLI_INPUT;
    }
    if (r == CLI_GO_ON)
        r = read_levels(&s, cmd, a->levels);
    if (r == CLI_GO_ON)
        r = find_view(&view, &s, cmd, a->view);
    if (r == CLI_GO_ON) {
        s.cfg.camera = sst_virtual_of_view(&s.posed, view);
        s.cfg.threads = a->cfg.threads;
        s.cfg.method =
            (const enum sst_posed_method[]){ SST_POSED_REFOCUS, SST_POSED_THROUGH, SST_POSED_CLEAR }[a->cfg.method];
        r = find_surface(&s, cmd, a);
    }
    if (r == CLI_GO_ON && a->view && !strcmp(a->view, NADIR)) {
        if (!vector_known(s.posed.up)) {
            memcpy(s.posed.up, s.cfg.surface.normal, sizeof(s.posed.up));
            sst_log_warning("%s: the direction of gravity is unknown: nadir looks straight at the surface", path);
        }
        err = sst_virtual_nadir(&s.cfg.camera, &s.posed, &s.cfg.surface, NADIR_PIXELS);
        r = err ? cli_exit_code(err == -EINVAL ? -EBADMSG : err) : CLI_GO_ON;
        s.view = NADIR;
    } else if (r == CLI_GO_ON) {
        s.view = s.posed.view[view].name;
    }
    if (r != CLI_GO_ON) {
        cli_posed_close(&s);
        return r;
    }
    *scene = s;
    if (s.cfg.surface.heights) /* terrain, which has moved with it */
        scene->cfg.surface.heights = &scene->heights;
    return r;
}

void cli_posed_close(struct posed_scene *scene)
{
    sst_posed_fini(&scene->posed);
    sst_heights_fini(&scene->heights);
}

json_t *cli_posed_scene_json(const struct posed_scene *scene)
{
    const struct sst_surface *s = &scene->cfg.surface;
    json_t *surface;

    if (s->kind == SST_SURFACE_TERRAIN)
        surface = json_pack("{s:s, s:f, s:f, s:f}", "kind", "terrain", "low_m", s->low_mm / METRE_MM, "high_m",
                            s->high_mm / METRE_MM, "raised_m", s->offset_mm / METRE_MM);
    else
        surface = json_pack("{s:s, s:[f, f, f], s:f}", "kind", scene->ground.views ? "ground" : "plane", "normal",
                            s->normal[0], s->normal[1], s->normal[2], "offset_m", s->offset_mm / METRE_MM);
    if (scene->ground.views)
        json_object_update_new(surface,
                               json_pack("{s:f, s:f, s:i, s:f}", "distance_m", scene->ground.distance_mm / METRE_MM,
                                         "tilt_deg", scene->ground.tilt_deg, "compared_views", scene->ground.views,
                                         "agreeing_percent", 100 * scene->ground.four[scene->ground.chosen]));
    return json_pack("{s:s, s:s, s:i, s:i, s:i, s:o}", "method",
                     (const char *[]){ "refocus", "see-through", "clear" }[scene->cfg.method], "view", scene->view,
                     "width", scene->cfg.camera.width, "height", scene->cfg.camera.height, "views",
                     sst_posed_placed(&scene->posed), "surface", surface);
}
