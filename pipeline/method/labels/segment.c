/* Image -> working size -> network, whole or in windows -> probabilities at the network's resolution -> labels and
 * entropy at the image's size (upsample.c). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/border.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/kernels/exp_neg.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/labels/labels_internal.h"
#include "pipeline/method/labels/model_info.h"

struct sst_segmenter {
    struct sst_network *net;
    char *path;
    int threads;
    struct sst_model_info info;
    struct sst_segment_config cfg;
    /* kept from image to image */
    struct sst_mem_kept picture, window, out, cells, resample; /* see struct working, struct class_grid */
    struct upsample_memory upsample;
    struct sst_map_f32 entropy; /* of sst_segment_hcsm() */
};

/* An output that covers the image must have its proportions, and a size between a 64th and 8 times its own. */
static bool covers(int width, int height, int out_width, int out_height)
{
    const double x = (double)out_width / width, y = (double)out_height / height;

    return fabs(x - y) <= 3.0 / sst_min_int(width, height) && x >= 1.0 / 64 && x <= 8 && y >= 1.0 / 64;
}

/* Reject a network for other images, or with another number of classes, on opening instead of at the first image. */
static int check_shape(struct sst_segmenter *seg)
{
    struct sst_model_info *info = &seg->info;
    const int in = sst_network_in_channels(seg->net), listed = info->channels - info->background;
    const char *op;
    struct sst_shape out;
    bool logarithm;
    int c, err;

    if (in != 3 && in != 1) {
        sst_log_error("model %s takes %d channels, neither the 3 of a colour image nor 1 of a grey one; use a"
                      " segmentation network",
                      seg->path, in);
        return -EBADMSG;
    }
    err = sst_network_out_shape(seg->net, info->width, info->height, &out);
    if (err)
        return err == -EINVAL ? -EBADMSG : err;
    c = out.c;
    if (c == 1 && listed == 2) {
        info->background = true; /* named first */
    } else if (c != listed) {
        sst_log_error("model %s gives %d channel%s for the %d class%s that its description lists; correct the list",
                      seg->path, c, c == 1 ? "" : "s", listed, listed == 1 ? "" : "es");
        return -EBADMSG;
    }
    op = c == 1 ? sst_network_ends_in_probabilities(seg->net, &logarithm) : NULL;
    if (op && !strstr(op, "Sigmoid")) {
        sst_log_error("model %s ends in %s over its only channel, which is the same everywhere; export it up to its"
                      " logits, or with a sigmoid",
                      seg->path, op);
        return -EBADMSG;
    }
    if (!covers(info->width, info->height, out.w, out.h)) {
        sst_log_error("model %s gives %dx%d results for an image of %dx%d, which do not match its pixels; use a"
                      " segmentation network",
                      seg->path, out.w, out.h, info->width, info->height);
        return -EBADMSG;
    }
    return 0;
}

int sst_segmenter_open(struct sst_segmenter **out, const char *model, enum sst_precision precision, int threads)
{
    struct sst_segmenter *seg = malloc(sizeof(*seg));
    int err = -ENOMEM;

    if (!seg)
        return err;
    *seg = (struct sst_segmenter){
        .path = strdup(model),
        .threads = threads,
    };
    if (seg->path)
        err = sst_network_open(&seg->net, model, precision, threads);
    err = err ? err : sst_labels_model_info_read(&seg->info, seg->net, model);
    err = err ? err : check_shape(seg);
    if (err)
        sst_segmenter_close(seg);
    else
        *out = seg;
    return err;
}

void sst_segmenter_close(struct sst_segmenter *seg)
{
    if (!seg)
        return;
    sst_network_close(seg->net);
    sst_mem_kept_fini(&seg->picture);
    sst_mem_kept_fini(&seg->window);
    sst_mem_kept_fini(&seg->out);
    sst_mem_kept_fini(&seg->cells);
    sst_mem_kept_fini(&seg->resample);
    upsample_memory_fini(&seg->upsample);
    sst_map_f32_fini(&seg->entropy);
    free(seg->path);
    free(seg);
}

void sst_segmenter_use_runner(struct sst_segmenter *seg, struct sst_runner_user *user)
{
    sst_network_use_runner(seg->net, user);
}

const struct sst_model_info *sst_segmenter_info(const struct sst_segmenter *seg)
{
    return &seg->info;
}

struct sst_network *sst_segmenter_network(const struct sst_segmenter *seg)
{
    return seg->net;
}

const struct sst_classes *sst_segmenter_classes(const struct sst_segmenter *seg)
{
    return &seg->info.classes;
}

void sst_segmenter_configure(struct sst_segmenter *seg, const struct sst_segment_config *cfg)
{
    seg->cfg = *cfg;
}

double sst_segmenter_eps_h(const struct sst_segmenter *seg)
{
    return seg->info.eps_h;
}

/* --- one image ------------------------------------------------------------------------------------ */

#define UNIT       8   /* sides of working pictures and window origins are multiples of it */
#define MOST_SCALE 1.5 /* largest default scale of the nominal sides: docs/measured/bench-labels.md */
#define LONGEST    8   /* longest side of the working picture, in longer nominal sides */

static int out_of_memory(const struct sst_image *img)
{
    sst_log_error("segmentation: not enough memory for an image of %d x %d", img->width, img->height);
    return -ENOMEM;
}

/* The network's input, whole or by windows, and the destination of the windows' results. */
struct working {
    int width, height;                                      /* pixels */
    int window_width, window_height, out_width, out_height; /* of a window and of the network's result for it */
    struct tiles across, down;                              /* windows in cells of the result */
    float *picture, *window, *out; /* [3][height][width]; the part inside a window (NULL: all); its result */
};

/* Sides at the image's proportions: `scale` times the sides of the nominal area. */
static void working_size(struct working *w, const struct sst_segmenter *seg, const struct sst_image *img)
{
    const double nominal = (double)seg->info.width * seg->info.height, area = (double)img->width * img->height;
    const double longest = LONGEST * (double)sst_max_int(seg->info.width, seg->info.height);
    const double own = sst_clamp_double(sqrt(area / nominal), 1, MOST_SCALE);
    const double scale = fmin((seg->cfg.scale > 0 ? seg->cfg.scale : own) * sqrt(nominal / area),
                              longest / sst_max_int(img->width, img->height));

    w->width = sst_max_int(UNIT, UNIT * (int)lround(img->width * scale / UNIT));
    w->height = sst_max_int(UNIT, UNIT * (int)lround(img->height * scale / UNIT));
    if (seg->info.fixed_size || !sst_network_accepts(seg->net, w->width, w->height)) {
        w->width = seg->info.width;
        w->height = seg->info.height;
    }
}

/* Windows of the nominal size. Their result cells must be 1, 2, 4 or 8 pixels wide. */
static int plan_windows(struct working *w, struct sst_segmenter *seg)
{
    const int width = sst_min_int(w->width, seg->info.width / UNIT * UNIT);
    const int height = sst_min_int(w->height, seg->info.height / UNIT * UNIT);
    struct sst_shape out;
    const int err = sst_network_out_shape(seg->net, width, height, &out);

    if (err)
        return err;
    if (UNIT * out.w % width || UNIT * out.h % height || seg->info.fixed_size) {
        sst_log_warning("model %s cannot label in windows: %dx%d pixels give %dx%d; the image is processed as a whole",
                        seg->path, width, height, out.w, out.h);
        return 0;
    }
    w->window_width = width;
    w->window_height = height;
    w->out_width = out.w;
    w->out_height = out.h;
    w->across = tiles_plan(w->width / UNIT * (UNIT * out.w / width), out.w, UNIT * out.w / width);
    w->down = tiles_plan(w->height / UNIT * (UNIT * out.h / height), out.h, UNIT * out.h / height);
    return 0;
}

static int plan(struct working *w, struct sst_segmenter *seg, const struct sst_image *img)
{
    struct sst_shape out;
    int err;

    working_size(w, seg, img);
    if (seg->cfg.windows) {
        err = plan_windows(w, seg);
        if (err || w->across.count)
            return err;
    }
    w->window_width = w->width;
    w->window_height = w->height;
    err = sst_network_out_shape(seg->net, w->width, w->height, &out);
    if (err)
        return err;
    w->out_width = out.w;
    w->out_height = out.h;
    w->across = tiles_plan(w->out_width, w->out_width, 1);
    w->down = tiles_plan(w->out_height, w->out_height, 1);
    return 0;
}

/* The values of a cell, one for each channel; of one channel alone also its rest, the background. */
static void read_values(float *p, const float *out, size_t plane, const struct sst_model_info *info)
{
    const int first = info->background ? 1 : 0;

    for (int c = first; c < info->channels; c++)
        p[c] = out[(size_t)(c - first) * plane];
    if (info->background) {
        p[0] = info->probabilities ? 1 - p[1] : 0; /* exp(0) against exp(x): a sigmoid */
        if (p[0] < 0 && p[0] > -1e-4f)
            p[0] = 0; /* enlarging rounds */
    }
}

#define LOGIT_MOST        64.0F  /* below the largest one; a logit farther below has probability 0 */
#define PROBABILITY_LEAST 1e-30F /* less is 0 */

/* Values of the channels to probabilities, in place.
 * @return false: some value is not finite, a probability is negative, or all of them are 0 */
static bool to_probabilities(float *p, const struct sst_model_info *info)
{
    const float per_temperature = (float)(1 / info->temperature);
    float most = -INFINITY, sum = 0;

    for (int c = 0; c < info->channels; c++) {
        if (!isfinite(p[c]) || (info->probabilities && p[c] < 0))
            return false;
        most = p[c] > most ? p[c] : most;
    }
    for (int c = 0; c < info->channels; c++) {
        const float below = (most - p[c]) * per_temperature;

        if (info->probabilities)
            p[c] = p[c] < FLT_MIN ? 0 : p[c];
        else
            p[c] = below < LOGIT_MOST ? sst_exp_neg(below) : 0;
        sum += p[c];
    }
    if (!(sum >= FLT_MIN && sum <= FLT_MAX))
        return false;
    for (int c = 0; c < info->channels; c++) {
        const float share = p[c] / sum;

        p[c] = share < PROBABILITY_LEAST ? 0 : share;
    }
    return true;
}

/* Add the network's weighted result for window (i, j) to the grid; probabilities of channels of one class add up. */
static int add_window(struct class_grid *grid, const struct working *w, int i, int j, const struct sst_segmenter *seg)
{
    const size_t plane = (size_t)w->out_width * (size_t)w->out_height;
    const int x0 = tiles_start(&w->across, i), y0 = tiles_start(&w->down, j);
    float p[SST_MODEL_MAX_CHANNELS];

    for (int y = 0; y < w->out_height; y++) {
        const float down = tiles_weight(&w->down, j, y);
        float *row = grid->cell + ((size_t)(y0 + y) * (size_t)grid->width + (size_t)x0) * grid->values;

        for (int x = 0; x < w->out_width; x++) {
            const float weight = down * tiles_weight(&w->across, i, x);

            read_values(p, w->out + (size_t)y * (size_t)w->out_width + (size_t)x, plane, &seg->info);
            if (!to_probabilities(p, &seg->info)) {
                sst_log_error("model %s: its output at (%d, %d) is not a %s; %suse another model", seg->path, x0 + x,
                              y0 + y,
                              seg->info.probabilities ? "probability (NaN, infinite, negative, or above 1)"
                                                      : "logit (NaN or infinite)",
                              seg->info.probabilities ? "correct `output` in its description, or " : "");
                return -EBADMSG;
            }
            for (int c = 0; c < seg->info.channels; c++)
                row[(size_t)x * grid->values + seg->info.class_of[c]] += weight * p[c];
        }
    }
    return 0;
}

/* The image in the network's input format; grey is the luma of the three normalised planes. */
static int make_input(float *in, int width, int height, const struct sst_image *img, struct sst_segmenter *seg)
{
    const struct sst_model_info *info = &seg->info;
    const size_t plane = (size_t)width * (size_t)height;
    const bool grey = sst_network_in_channels(seg->net) == 1;
    const struct resampled to = { in,
                                  width,
                                  height,
                                  { info->mean[0], info->mean[grey ? 0 : 1], info->mean[grey ? 0 : 2] },
                                  { info->std[0], info->std[grey ? 0 : 1], info->std[grey ? 0 : 2] } };
    struct sst_image swapped = *img;
    int err;

    if (info->bgr && !grey) {
        swapped.plane[0] = img->plane[2];
        swapped.plane[2] = img->plane[0];
    }
    err = resample_planes(&to, &swapped, seg->threads, &seg->resample);
    for (size_t i = 0; !err && grey && i < plane; i++)
        in[i] = 0.299f * in[i] + 0.587f * in[plane + i] + 0.114f * in[2 * plane + i];
    return err;
}

/* Copy window (i, j) out of the whole picture. */
static void cut_window(const struct working *w, int i, int j)
{
    const int x0 = tiles_start(&w->across, i) * w->window_width / w->out_width;
    const int y0 = tiles_start(&w->down, j) * w->window_height / w->out_height;
    float *to = w->window;

    for (int c = 0; c < 3; c++) {
        for (int y = y0; y < y0 + w->window_height; y++, to += w->window_width)
            memcpy(to, w->picture + ((size_t)c * (size_t)w->height + (size_t)y) * (size_t)w->width + x0,
                   (size_t)w->window_width * sizeof(*to));
    }
}

static int run_windows(struct class_grid *grid, const struct working *w, struct sst_segmenter *seg)
{
    int err = 0;

    for (int j = 0; j < w->down.count && !err; j++) {
        for (int i = 0; i < w->across.count && !err; i++) {
            if (w->window)
                cut_window(w, i, j);
            err = sst_network_run(seg->net, w->window ? w->window : w->picture, w->window_width, w->window_height,
                                  w->out);
            err = err ? err : add_window(grid, w, i, j, seg);
        }
    }
    return err;
}

/* Distributions at the network's resolution. */
static int make_grid(struct class_grid *grid, struct sst_segmenter *seg, const struct sst_image *img)
{
    struct working w = { 0 };
    size_t cells;
    bool whole;
    int err = plan(&w, seg, img);

    if (err)
        return err;
    whole = w.window_width == w.width && w.window_height == w.height;
    *grid = (struct class_grid){ .width = w.across.total, .height = w.down.total, .count = seg->info.classes.count };
    grid->values = class_grid_values(grid->count);
    cells = grid->values * (size_t)grid->width * (size_t)grid->height;
    w.picture = sst_mem_keep(&seg->picture, (size_t)3 * (size_t)w.width * (size_t)w.height, sizeof(*w.picture));
    if (!whole)
        w.window =
            sst_mem_keep(&seg->window, (size_t)3 * (size_t)w.window_width * (size_t)w.window_height, sizeof(*w.window));
    w.out = sst_mem_keep(&seg->out, (size_t)seg->info.channels * (size_t)w.out_width * (size_t)w.out_height,
                         sizeof(*w.out));
    grid->cell = sst_mem_keep(&seg->cells, cells, sizeof(*grid->cell));
    if (grid->cell)
        memset(grid->cell, 0, cells * sizeof(*grid->cell));
    err = w.picture && (whole || w.window) && w.out && grid->cell ? 0 : -ENOMEM;
    err = err ? err : make_input(w.picture, w.width, w.height, img, seg);
    return err ? out_of_memory(img) : run_windows(grid, &w, seg);
}

int sst_segment(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label,
                struct sst_map_f32 *entropy, float **prob)
{
    const size_t values = (size_t)seg->info.classes.count * (size_t)img->width * (size_t)img->height;
    struct sst_map_u8 label_made = { 0 };
    struct sst_map_f32 entropy_made = { 0 };
    struct class_grid grid = { 0 };
    float *prob_made = prob ? malloc(values * sizeof(*prob_made)) : NULL;
    int err = prob && !prob_made ? -ENOMEM : sst_map_u8_init(&label_made, img->width, img->height);

    if (!err && entropy)
        err = sst_map_f32_init(&entropy_made, img->width, img->height);
    if (err) {
        err = out_of_memory(img);
        goto fail;
    }
    err = make_grid(&grid, seg, img);
    if (err)
        goto fail;
    err = labels_upsample(&(struct upsampled){ &label_made, entropy ? &entropy_made : NULL, prob_made }, &grid, img,
                          seg->threads, &seg->upsample);
    if (err) {
        err = out_of_memory(img);
        goto fail;
    }
    *label = label_made;
    if (entropy) {
        for (int y = 0; y < img->height; y++)
            sst_border_unknown("entropy of the labels", sst_map_f32_row(&entropy_made, y), (size_t)img->width);
        *entropy = entropy_made;
    }
    if (prob)
        *prob = prob_made;
    return 0;

fail:
    sst_map_u8_fini(&label_made);
    sst_map_f32_fini(&entropy_made);
    free(prob_made);
    return err;
}

static int upsample_hcsm(struct sst_segmenter *seg, struct class_grid *grid, const struct sst_image *img,
                         struct sst_map_u8 *label)
{
    struct sst_map_f32 *entropy = &seg->entropy;
    int err = 0;

    if (entropy->width != img->width || entropy->height != img->height) {
        sst_map_f32_fini(entropy);
        err = sst_map_f32_init(entropy, img->width, img->height);
    }
    if (!err)
        err = labels_upsample(&(struct upsampled){ label, entropy, NULL }, grid, img, seg->threads, &seg->upsample);
    if (!err)
        sst_hcsm(label, entropy, seg->info.eps_h);
    return err;
}

int sst_segment_hcsm(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label)
{
    struct sst_map_u8 made = { 0 };
    struct class_grid grid;
    int err = sst_map_u8_init(&made, img->width, img->height);

    if (err)
        return out_of_memory(img);
    err = make_grid(&grid, seg, img);
    if (err) {
        sst_map_u8_fini(&made);
        return err;
    }
    err = upsample_hcsm(seg, &grid, img, &made);
    if (err) {
        sst_map_u8_fini(&made);
        return out_of_memory(img);
    }
    *label = made;
    return 0;
}
