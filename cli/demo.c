/* sst demo: the service on simulated arrays; with --once the whole way from a scene to a see-through picture, with the
 * commands that a user would type. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "cli/cli_internal.h"
#include "pipeline/eval/evaluation.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/lightfield.h"
#include "pipeline/method/render/render.h"

#define MAX_ARGS 12
#define GAP      8 /* white pixels between the panels */
#define COLUMNS  3
#define PANELS   6

/* Show a command line, then run it in this process. @param device  for --device; NULL: without */
static int step_on(const struct cli_command *cmd, const char *const *args, const char *device)
{
    char *argv[MAX_ARGS + 3] = { (char *)(uintptr_t)cmd->name };
    int argc = 1;

    printf("$ sst %s", cmd->name);
    for (; args[argc - 1]; argc++) {
        printf(" %s", args[argc - 1]);
        argv[argc] = (char *)(uintptr_t)args[argc - 1];
    }
    if (device) {
        printf(" --device %s", device);
        argv[argc++] = (char *)(uintptr_t) "--device";
        argv[argc++] = (char *)(uintptr_t)device;
    }
    putchar('\n');
    fflush(stdout);
    return cmd->run(cmd, argc, argv);
}

static int step(const struct cli_command *cmd, const char *const *args)
{
    return step_on(cmd, args, NULL);
}

/* Pictures of one size in two rows on white. */
static int montage(const char *out, const char *const files[PANELS])
{
    struct sst_image panel = { 0 }, sheet = { 0 };
    int err = 0;

    for (int i = 0; !err && i < PANELS; i++) {
        sst_image_fini(&panel);
        err = sst_image_read(&panel, files[i]);
        if (!err && !sheet.width) {
            err = sst_image_init(&sheet, COLUMNS * (panel.width + GAP) - GAP,
                                 PANELS / COLUMNS * (panel.height + GAP) - GAP);
            if (!err)
                memset(sheet.plane[0], 255, 3 * sheet.stride * (size_t)sheet.height);
        }
        for (int c = 0; !err && c < 3; c++) {
            for (int y = 0; y < panel.height; y++)
                memcpy(sst_image_row(&sheet, c, i / COLUMNS * (panel.height + GAP) + y) +
                           i % COLUMNS * (panel.width + GAP),
                       sst_image_row(&panel, c, y), (size_t)panel.width);
        }
    }
    err = err ? err : sst_image_write_png(&sheet, out);
    sst_image_fini(&panel);
    sst_image_fini(&sheet);
    return err;
}

struct demo {
    const char *device; /* NULL: not given */
    char lf[SST_PATH_MAX], truth[SST_PATH_MAX], view[SST_PATH_MAX], behind[SST_PATH_MAX];
    char clear[SST_PATH_MAX], see_through[SST_PATH_MAX], refocus[SST_PATH_MAX], why[SST_PATH_MAX];
    char disparity[SST_PATH_MAX], sheet[SST_PATH_MAX];
};

static int name_files(struct demo *d, const char *out, const char *scene)
{
    int err = sst_path_join(d->lf, out, scene);

    err = err ? err : sst_path_join(d->truth, d->lf, "truth");
    err = err ? err : sst_path_join(d->behind, d->truth, "behind.png");
    err = err ? err : sst_path_join(d->see_through, out, "see-through.png");
    err = err ? err : sst_path_join(d->refocus, out, "refocus.png");
    err = err ? err : sst_path_join(d->clear, out, "clear.png");
    err = err ? err : sst_path_join(d->why, out, "why");
    err = err ? err : sst_path_join(d->disparity, d->why, "disparity.png");
    return err ? err : sst_path_join(d->sheet, out, "side-by-side.png");
}

/* A folder of an earlier run is replaced as a whole: nothing else may be in it. @return 0, -EEXIST (logged) */
static int check_own(const char *folder, const char *const *own)
{
    DIR *dir = opendir(folder);
    const struct dirent *e;
    int err = 0;

    while (dir && !err && (e = readdir(dir))) {
        int i = 0;

        while (own[i] && strcmp(own[i], e->d_name) != 0)
            i++;
        if (own[i] || !strcmp(e->d_name, ".") || !strcmp(e->d_name, ".."))
            continue;
        sst_log_error("%s is replaced, and %s in it is not of the demo; move that, or give another folder by -o", folder,
                      e->d_name);
        err = -EEXIST;
    }
    if (dir)
        closedir(dir);
    return err;
}

static int check_earlier(const struct demo *d)
{
    static const char *const lf[] = { "lightfield.json", "views", "truth", "disparity", "confidence", "entropy", "labels",
                                      "labels_hcsm", "labels_initial", NULL };
    static const char *const why[] = { "explain.json", "disparity.png", "confidence.png", "entropy.png", "labels.png",
                                       "labels_hcsm.png", "rays.png", "weight.png", "weight_depth.png", "weight_label.png",
                                       NULL };
    const int err = check_own(d->lf, lf);

    return err ? err : check_own(d->why, why);
}

/* Is there a gap in depth between what stands in front and the rest? */
static int has_gap(const struct demo *d, bool *found)
{
    struct sst_lightfield lf;
    struct sst_renderer *r = NULL;
    double cut;
    int err = sst_lightfield_load(&lf, d->lf, SST_LOAD_IMAGES | SST_LOAD_DISPARITY, 0);

    if (err)
        return err;
    err = sst_renderer_create(&r, &lf, 0);
    err = err ? err : sst_render_find_cut(r, &cut);
    *found = !err;
    sst_renderer_destroy(r);
    sst_lightfield_fini(&lf);
    return err == -ENODATA ? 0 : err;
}

/* "X,Y" of the occluder's pixel that is nearest to the middle of all its pixels. */
static int find_occluder(char *at, size_t size, const struct demo *d, const struct sst_truth *truth)
{
    struct sst_map_u8 mask = { 0 };
    char path[SST_PATH_MAX];
    double x_mean = 0, y_mean = 0, n = 0, nearest = INFINITY;
    int err = sst_path_join(path, d->truth, truth->occluders[0].mask);

    err = err ? err : sst_map_u8_read_png(&mask, path);
    for (int pass = 0; !err && pass < 2; pass++) {
        for (int y = 0; y < mask.height; y++) {
            for (int x = 0; x < mask.width; x++) {
                if (!sst_map_u8_row(&mask, y)[x])
                    continue;
                if (pass && hypot(x - x_mean / n, y - y_mean / n) < nearest) {
                    nearest = hypot(x - x_mean / n, y - y_mean / n);
                    snprintf(at, size, "%d,%d", x, y);
                } else if (!pass) {
                    x_mean += x;
                    y_mean += y;
                    n++;
                }
            }
        }
    }
    sst_map_u8_fini(&mask);
    return err;
}

static int run_clear(const struct demo *d, const struct sst_truth *truth)
{
    char at[32] = "";
    bool gap;
    int err = has_gap(d, &gap);

    err = err || gap ? err : find_occluder(at, sizeof(at), d, truth);
    if (!err) {
        const char *const by_cut[] = { d->lf, "--method", "clear", "-o", d->clear, NULL };
        const char *const by_pixel[] = { d->lf, "--method", "clear", "--remove-at", at, "-o", d->clear, NULL };

        return step_on(&cli_render, gap ? by_cut : by_pixel, d->device);
    }
    return cli_exit_code(err);
}

static int run_steps(struct demo *d, const char *scene, const char *preset, const char *size)
{
    const char *const make[] = { scene, "-o", d->lf, "--size", size, "--force", NULL };
    const char *const process[] = { d->lf, "--preset", preset, NULL };
    const char *const eval[] = { d->lf, "--truth", d->truth, NULL };
    struct sst_truth truth;
    char focus[32], name[32];
    int r = step(&cli_scene, make);

    if (r == CLI_OK)
        r = step_on(&cli_process, process, d->device);
    if (r == CLI_OK)
        r = cli_exit_code(sst_truth_read(&truth, d->truth));
    if (r == CLI_OK) {
        const char *const sst[] = {
            d->lf, "--focus", focus, "-o", d->see_through, "--explain", d->why, "--force", NULL
        }; /* replaces files of an earlier run */
        const char *const plain[] = { d->lf, "--focus", focus, "--method", "refocus", "-o", d->refocus, NULL };

        snprintf(focus, sizeof(focus), "%.2f", truth.occluders[0].focus_px);
        snprintf(name, sizeof(name), "views/%02d_%02d.png", truth.ref_row, truth.ref_col);
        r = cli_exit_code(sst_path_join(d->view, d->lf, name));
        r = r ? r : run_clear(d, &truth);
        r = r ? r : step_on(&cli_render, sst, d->device);
        r = r ? r : step_on(&cli_render, plain, d->device);
    }
    return r ? r : step(&cli_eval, eval);
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    const char *scene = NULL, *out = "sst-demo", *preset = "balanced", *size = "1000x750", *device = NULL;
    bool once = false;
    int port = 0;
    const struct cli_option options[] = {
        { "scene", 's', CLI_STRING, &scene, "NAME", "scene to see through (pedestrian; once: bush)", 0, 0,
          "pedestrian hedge bush transportation cell humvee cd-cases cat bust "
          "terrace" },
        { "once", 0, CLI_FLAG, &once, NULL, "one set, its pictures, and exit" },
        { "port", 0, CLI_INT, &port, "N", "of the page (8090, or as in a kept configuration)", 1, 65535 },
        { "output", 'o', CLI_MADE, &out, "DIR", "folder for all that is written (sst-demo)" },
        { "device", 0, CLI_STRING, &device, "D",
          "where pictures are rendered and labels computed: cpu, gpu, auto or a part of a device's name (cpu, or as in "
          "a kept configuration)",
          0, 0 },
        { "preset", 'p', CLI_STRING, &preset, "NAME", "once: preview, balanced (default) or accurate", 0, 0,
          CLI_PRESETS },
        { "size", 0, CLI_STRING, &size, "WxH", "once: pixels of a view (1000x750)" },
    };
    struct demo d;
    int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);

    if (r != CLI_GO_ON)
        return r;
    if (scene && (strchr(scene, '/') || !*scene))
        return cli_usage_error(cmd, "there is no scene %s", scene);
    if (once && scene && !strcmp(scene, "hedge"))
        return cli_usage_error(cmd, "the scene hedge is one of moving leaves, which --once does not show");
    if (!once)
        return cli_demo_live(scene ? scene : "pedestrian", out, port, device);
    scene = scene ? scene : "bush";
    d.device = device;
    r = cli_exit_code(name_files(&d, out, scene));
    r = r ? r : cli_exit_code(check_earlier(&d));
    r = r ? r : cli_exit_code(sst_path_make_dir(out));
    r = r ? r : run_steps(&d, scene, preset, size);
    if (r == CLI_OK) {
        const char *const panels[PANELS] = { d.view, d.clear, d.behind, d.refocus, d.see_through, d.disparity };

        r = cli_exit_code(montage(d.sheet, panels));
    }
    if (r == CLI_OK)
        printf("\nThe view in the middle, the clear picture, and what really is behind;\n"
               "plain refocusing, see-through at one focus, and the disparities:\n  %s\n",
               d.sheet);
    return r;
}

const struct cli_command cli_demo = { "demo", run };
