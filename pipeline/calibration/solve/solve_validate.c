/* Validation before and after the fit: each refusal is one sentence. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/log.h"
#include "pipeline/calibration/solve/solve_internal.h"

#define LEAST_FRAMES  4
#define REGIONS       5    /* of the picture, along each side */
#define LEAST_REGIONS 8    /* of the regions, with corners */
#define MOST_FOCAL    0.01 /* relative sigma of a focal length */

int solve_reject(const struct sst_solve_config *cfg, const char *fmt, ...)
{
    char text[SST_LOG_MAX];
    va_list args;

    va_start(args, fmt);
    vsnprintf(text, sizeof(text), fmt, args);
    va_end(args);
    if (!cfg->force) {
        sst_log_error("%s", text);
        return -EBADMSG;
    }
    sst_log_warning("%s", text);
    if (cfg->overridden)
        ++*cfg->overridden;
    return 0;
}

const char *solve_name(const struct sst_detections *all, int view, char out[128])
{
    snprintf(out, 128, "camera %.63s%s(row %d, column %d)", all->camera_name[view],
             all->camera_name[view][0] ? " " : "", view / all->cols, view % all->cols);
    return out;
}

static int check_frames(struct solve_case *c, const int *detections)
{
    int frames = 0, last = -1, blurred = c->all->outcome[SST_DETECT_BLURRED] + c->all->outcome[SST_DETECT_MOVING];
    const int least = c->p.keep_lens ? 1 : LEAST_FRAMES;
    char name[128];

    for (int i = 0; i < c->p.count; i++) {
        if (c->p.detection[i].used && c->p.detection[i].frame != last) {
            frames++;
            last = c->p.detection[i].frame;
        }
    }
    if (!frames) {
        sst_log_error("no frame shows the board: none of %d pictures has %d of its points; %s", c->p.count,
                      SOLVE_MIN_CORNERS,
                      blurred ? "many are blurred: more light, or hold the board still"
                              : "take frames with the board large in the pictures");
        return -EBADMSG;
    }
    if (frames < least && !c->p.rig)
        return solve_reject(c->cfg,
                            "only %d frame%s the board; at least %d are needed and 20 are recommended: take more",
                            frames, frames == 1 ? " shows" : "s show", least);
    for (int v = 0; v < c->p.views; v++) {
        if (c->all->camera_name[v][0] && !detections[v] &&
            solve_reject(c->cfg,
                         "%s has not seen the board in any of the %d frames: hold the board in front of it%s, or leave "
                         "the camera out",
                         solve_name(c->all, v, name), c->all->frames, blurred ? " (many pictures were blurred)" : ""))
            return -EBADMSG;
    }
    return 0;
}

static const char *where(int row, int col)
{
    static const char *const name[3][3] = { { "the upper left", "the top", "the upper right" },
                                            { "the left", "the middle", "the right" },
                                            { "the lower left", "the bottom", "the lower right" } };

    return name[row][col];
}

/* Regions of a camera's picture (a rig: of all views) with corners; too few leave its lens undetermined. */
static int check_regions(struct solve_case *c, int view)
{
    int seen[REGIONS][REGIONS] = { 0 }, third[3][3] = { 0 }, covered = 0, detections = 0, bare = 0;
    char name[128];

    for (int i = 0; i < c->p.count; i++) {
        const struct solve_detection *d = &c->p.detection[i];

        if (!d->used || (!c->p.rig && d->view != view))
            continue;
        detections++;
        for (int k = 0; k < d->corners; k++) {
            const double x = (d->corner[k].x + 0.5) / c->p.width, y = (d->corner[k].y + 0.5) / c->p.height;

            if (x < 0 || y < 0 || x >= 1 || y >= 1)
                continue;
            covered += !seen[(int)(y * REGIONS)][(int)(x * REGIONS)]++;
            third[(int)(y * 3)][(int)(x * 3)]++;
        }
    }
    if (!detections || covered >= LEAST_REGIONS)
        return 0;
    for (int i = 0; i < 9; i++) {
        if (third[i / 3][i % 3] < third[bare / 3][bare % 3])
            bare = i;
    }
    return solve_reject(c->cfg,
                        "the board was in only %d of %d regions of the picture of %s; at least %d are needed: hold it "
                        "also at %s of that picture",
                        covered, REGIONS * REGIONS, solve_name(c->all, view, name), LEAST_REGIONS,
                        where(bare / 3, bare % 3));
}

int solve_check_corners(struct solve_case *c)
{
    int *detections = calloc((size_t)c->p.views, sizeof(*detections)), err;

    if (!detections)
        return -ENOMEM;
    for (int i = 0; i < c->p.count; i++)
        detections[c->p.detection[i].view] += c->p.detection[i].used;
    err = check_frames(c, detections);
    for (int v = 0; v < (c->p.rig ? 1 : c->p.views) && !err && !c->p.keep_lens; v++)
        err = check_regions(c, v);
    free(detections);
    return err;
}

int solve_check_mirrored(struct solve_case *c)
{
    int err = 0;

    for (int v = 0; v < c->p.views && !err; v++) {
        int all = 0, mirrored = 0, first = -1;
        char name[128];

        for (int i = 0; i < c->p.count; i++) {
            struct solve_detection *d = &c->p.detection[i];

            if (d->view != v || !d->used)
                continue;
            all++;
            if (!c->single[i].mirrored)
                continue;
            mirrored++;
            first = first < 0 ? d->frame : first;
            d->used = false;
        }
        if (mirrored)
            err = solve_reject(c->cfg,
                               "%s sees the board mirrored in %d of %d frames, first in %s: its points are numbered "
                               "by columns instead of rows, or its picture is flipped; correct that and detect again",
                               solve_name(c->all, v, name), mirrored, all, c->all->frame_name[first]);
    }
    return err;
}

int solve_check_linked(struct solve_case *c)
{
    char text[512] = "", name[128];
    int apart = 0, length = 0;

    for (int v = 0; v < c->p.views; v++) {
        bool seen = false;

        for (int i = 0; i < c->p.count && !seen; i++)
            seen = c->p.detection[i].view == v && c->p.detection[i].corners >= SOLVE_MIN_CORNERS;
        if (!seen || c->p.camera[v].known)
            continue;
        if (length < 300)
            length += snprintf(text + length, sizeof(text) - (size_t)length, "%s%s", apart ? ", " : "",
                               solve_name(c->all, v, name));
        apart++;
    }
    return apart ? solve_reject(c->cfg,
                                "%d camera%s share%s no frame of the board with the reference or any camera linked "
                                "to it: %s%s; hold the board where they and their neighbours see it together",
                                apart, apart == 1 ? "" : "s", apart == 1 ? "s" : "", text, length >= 300 ? " ..." : "")
                 : 0;
}

/* The camera and the frame with most outliers. */
static void worst(const struct solve_case *c, int *view, double *view_share, int *frame, double *frame_share)
{
    *view = *frame = 0;
    *view_share = *frame_share = -1;
    for (int pass = 0; pass < 2; pass++) {
        for (int k = 0; k < (pass ? c->p.frames : c->p.views); k++) {
            int all = 0, out = 0;

            for (int i = 0; i < c->p.count; i++) {
                const struct solve_detection *d = &c->p.detection[i];

                if ((pass ? d->frame : d->view) != k || !c->single[i].known)
                    continue;
                all += d->corners;
                for (int n = 0; n < d->corners; n++)
                    out += d->corner[n].out;
            }
            if (all && (double)out / all > *(pass ? frame_share : view_share)) {
                *(pass ? frame_share : view_share) = (double)out / all;
                *(pass ? frame : view) = k;
            }
        }
    }
}

int solve_check_outliers(struct solve_case *c)
{
    const double most = c->cfg->max_outliers > 0 ? c->cfg->max_outliers : SOLVE_MOST_OUTLIERS;
    double view_share, frame_share, blur = 0;
    int all = 0, out = 0, view, frame, blurred = 0;
    char name[128], more[128] = "";

    for (int i = 0; i < c->p.count; i++) {
        all += c->p.detection[i].corners;
        for (int k = 0; k < c->p.detection[i].corners; k++)
            out += c->p.detection[i].corner[k].out;
        blurred += c->all->detection[i].blur_px > 2;
        blur = fmax(blur, c->all->detection[i].blur_px);
    }
    if (out <= most * all)
        return 0;
    worst(c, &view, &view_share, &frame, &frame_share);
    if (blurred)
        snprintf(more, sizeof(more), "; %d pictures are blurred, by up to %.1f px", blurred, blur);
    return solve_reject(
        c->cfg,
        "%.1f %% of the corners are outliers (further than %d times the noise of %.2g px); at most %.1f %% "
        "are allowed: most in %s (%.0f %% of its corners) and in frame %s (%.0f %%)%s; leave those "
        "out, or take them again with board and cameras at rest",
        100.0 * out / all, SOLVE_OUTLIER_SIGMA, c->sigma_px, 100 * most, solve_name(c->all, view, name),
        100 * view_share, c->all->frame_name[frame], 100 * frame_share, more);
}

/* Largest tilt of the boards that a camera saw (degrees), and ratio of the farthest to the nearest depth. */
static void variety(const struct solve_case *c, int view, double *slant_deg, double *ratio)
{
    double near = INFINITY, far = 0;

    *slant_deg = 0;
    for (int i = 0; i < c->p.count; i++) {
        const struct solve_detection *d = &c->p.detection[i];
        struct solve_pose board;

        if (!d->used || (!c->p.rig && d->view != view))
            continue;
        solve_relative(&c->p, d, &board);
        *slant_deg = fmax(*slant_deg, acos(sst_clamp_double(board.rotation[8], -1, 1)) * 180 / M_PI);
        near = fmin(near, board.shift[2]);
        far = fmax(far, board.shift[2]);
    }
    *ratio = near > 0 && far > 0 ? far / near : 1;
}

int solve_check_focal(struct solve_case *c, const struct solve_covariance *cov)
{
    double most = 0, slant, ratio;
    int view = -1;
    char name[128];

    for (int v = 0; v < c->p.views; v++) {
        const int at = cov->layout.lens[v];

        for (int k = 0; k < 2 && at >= 0; k++) {
            const double part = sqrt(fmax(cov->m[(size_t)(at + k) * (size_t)cov->size + (size_t)(at + k)], 0)) /
                                fmax(c->p.camera[v].lens[k], 1);

            if (part > most) {
                most = part;
                view = v;
            }
        }
    }
    if (view < 0 || !(most > MOST_FOCAL))
        return 0;
    variety(c, view, &slant, &ratio);
    return solve_reject(c->cfg,
                        "the focal length of %s is known only to %.1f %%, the limit is %g %%: its boards are tilted "
                        "by up to %.0f degrees and %.2g times as far as the nearest; show it boards tilted by 30 to "
                        "45 degrees, near and twice as far",
                        solve_name(c->all, view, name), 100 * most, 100 * MOST_FOCAL, slant, ratio);
}
