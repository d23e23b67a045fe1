/* Image -> working size -> network -> probabilities at the network's resolution -> labels and entropy at the image's
 * size. The last step goes pixel by pixel, so that the probabilities of a large image exist only where the caller wants
 * them. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/labels/labels.h"
#include "pipeline/labels/model_info.h"
#include "pipeline/labels/resample.h"

struct sst_segmenter {
    struct sst_network *net;
    char *path;
    int threads;
    struct sst_model_info info;
};

/* An output that covers the image must have its proportions, and a size between a 64th and 8 times its own. */
static bool covers(int width, int height, int out_width, int out_height)
{
    const double x = (double)out_width / width, y = (double)out_height / height;

    return fabs(x - y) <= 3.0 / sst_min_int(width, height) && x >= 1.0 / 64 && x <= 8 && y >= 1.0 / 64;
}

/* A network for other pictures, or with another number of classes, is told at once and not at the first image. */
static int check_shape(struct sst_segmenter *seg)
{
    const struct sst_model_info *info = &seg->info;
    const int in = sst_network_in_channels(seg->net);
    int c, w, h, err;

    if (in != 3 && in != 1) {
        sst_log_error("model %s takes %d channels, neither the 3 of a colour image nor 1 of a grey one; use a"
                      " segmentation network",
                      seg->path, in);
        return -EBADMSG;
    }
    err = sst_network_out_shape(seg->net, info->width, info->height, &c, &w, &h);
    if (err)
        return err == -EINVAL ? -EBADMSG : err;
    if (c != info->channels) {
        sst_log_error("model %s gives %d channels for the %d classes that its description lists; correct the list",
                      seg->path, c, info->channels);
        return -EBADMSG;
    }
    if (!covers(info->width, info->height, w, h)) {
        sst_log_error("model %s gives %dx%d results for an image of %dx%d, which are no labels of its pixels; use a"
                      " segmentation network",
                      seg->path, w, h, info->width, info->height);
        return -EBADMSG;
    }
    return 0;
}

int sst_segmenter_open(struct sst_segmenter **out, const char *model, int threads)
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
        err = sst_network_open(&seg->net, model, threads);
    if (!err)
        err = sst_model_info_read(&seg->info, seg->net, model);
    if (!err)
        err = check_shape(seg);
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
    free(seg->path);
    free(seg);
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

double sst_segmenter_eps_h(const struct sst_segmenter *seg)
{
    return seg->info.eps_h;
}

/* --- one image ------------------------------------------------------------------------------------ */

/* A side of the working size: the image's proportions, the nominal area, multiples of 8; a strip is cut at four times
 * the longer nominal side. */
static int working_side(const struct sst_segmenter *seg, const struct sst_image *img, int side)
{
    const int w = seg->info.width, h = seg->info.height;
    const double scale = sqrt((double)w * h / ((double)img->width * img->height));

    return (int)sst_clamp_double(8 * round(side * scale / 8), 8, 4 * sst_max_int(w, h) / 8 * 8);
}

/* Logits or unnormalised probabilities of one pixel become probabilities; false if they cannot. */
static bool to_probabilities(float *p, int count, const struct sst_segmenter *seg)
{
    double max = -INFINITY, sum = 0;

    for (int c = 0; c < count; c++) {
        if (!isfinite(p[c]) || (seg->info.probabilities && p[c] < 0))
            return false;
        max = p[c] > max ? p[c] : max;
    }
    for (int c = 0; c < count; c++) {
        if (!seg->info.probabilities)
            p[c] = expf((float)((p[c] - max) / seg->info.temperature));
        sum += p[c];
    }
    if (!(sum > 0))
        return false;
    for (int c = 0; c < count; c++)
        p[c] = (float)(p[c] / sum);
    return true;
}

struct upsample {
    const struct sst_segmenter *seg;
    const float *small; /* [h][w][count] probabilities */
    int w, h, count;
    struct sst_map_u8 *label;
    struct sst_map_f32 *entropy; /* or NULL */
    float *prob;                 /* [count][height][width] or NULL */
    float *rows;                 /* [worker][w][count] */
};

/* Half-pixel centres: lower neighbour of output i among `from` samples, and the way to the next. */
static int neighbour(int i, int from, int to, float *part)
{
    const double at = sst_clamp_double((i + 0.5) * from / to - 0.5, 0, from - 1);
    const int lo = sst_max_int(sst_min_int((int)at, from - 2), 0);

    *part = (float)(at - lo);
    return lo;
}

static void store_pixel(const struct upsample *u, const float *p, int x, int y)
{
    const size_t plane = (size_t)u->label->width * (size_t)u->label->height;
    int top = 0;

    for (int c = 1; c < u->count; c++)
        top = p[c] > p[top] ? c : top;
    sst_map_u8_row(u->label, y)[x] = (uint8_t)(top + 1);
    if (u->entropy)
        sst_map_f32_row(u->entropy, y)[x] = sst_entropy(p, u->count);
    for (int c = 0; u->prob && c < u->count; c++)
        u->prob[(size_t)c * plane + (size_t)y * (size_t)u->label->width + (size_t)x] = p[c];
}

static int upsample_row(void *arg, int y, int worker)
{
    const struct upsample *u = arg;
    const size_t n = (size_t)u->w * (size_t)u->count;
    float *row = u->rows + (size_t)worker * n, part;
    const int y0 = neighbour(y, u->h, u->label->height, &part);
    const float *a = u->small + (size_t)y0 * n, *b = u->h > 1 ? a + n : a;

    for (size_t i = 0; i < n; i++)
        row[i] = a[i] + part * (b[i] - a[i]);
    for (int x = 0; x < u->label->width; x++) {
        const int x0 = neighbour(x, u->w, u->label->width, &part);
        const float *l = row + (size_t)x0 * (size_t)u->count, *r = u->w > 1 ? l + u->count : l;
        float p[SST_MAX_CLASSES], sum = 0;

        for (int c = 0; c < u->count; c++) {
            p[c] = l[c] + part * (r[c] - l[c]);
            sum += p[c];
        }
        for (int c = 0; c < u->count; c++)
            p[c] /= sum;
        store_pixel(u, p, x, y);
    }
    return 0;
}

/* [channels][h][w] network output to [h][w][classes] probabilities: those of channels that are one class add up. */
static int interleave(float *small, const float *out, int h, int w, const struct sst_segmenter *seg)
{
    const size_t plane = (size_t)h * (size_t)w, count = (size_t)seg->info.classes.count;
    const int channels = seg->info.channels;
    float p[SST_MODEL_MAX_CHANNELS];

    memset(small, 0, plane * count * sizeof(*small));
    for (size_t i = 0; i < plane; i++) {
        for (int c = 0; c < channels; c++)
            p[c] = out[(size_t)c * plane + i];
        if (!to_probabilities(p, channels, seg)) {
            sst_log_error(
                "model %s: its output at (%d, %d) is no probability (NaN, infinite or negative); use another model",
                seg->path, (int)(i % (size_t)w), (int)(i / (size_t)w));
            return -EBADMSG;
        }
        for (int c = 0; c < channels; c++)
            small[i * count + seg->info.class_of[c]] += p[c];
    }
    return 0;
}

/* The image as the network wants it; a grey one is the luma of the three planes, each brought to the same mean. */
static int make_input(float *in, int width, int height, const struct sst_image *img, const struct sst_segmenter *seg)
{
    const struct sst_model_info *info = &seg->info;
    const size_t plane = (size_t)width * (size_t)height;
    const bool grey = sst_network_in_channels(seg->net) == 1;
    const double mean[3] = { info->mean[0], info->mean[grey ? 0 : 1], info->mean[grey ? 0 : 2] };
    const double std[3] = { info->std[0], info->std[grey ? 0 : 1], info->std[grey ? 0 : 2] };
    struct sst_image swapped = *img;
    int err;

    if (info->bgr && !grey) {
        swapped.plane[0] = img->plane[2];
        swapped.plane[2] = img->plane[0];
    }
    err = sst_resample(in, width, height, &swapped, mean, std, seg->threads);
    for (size_t i = 0; !err && grey && i < plane; i++)
        in[i] = 0.299f * in[i] + 0.587f * in[plane + i] + 0.114f * in[2 * plane + i];
    return err;
}

/* Probabilities at the network's resolution, in u->small. */
static int run_network(struct sst_segmenter *seg, const struct sst_image *img, struct upsample *u)
{
    int width = working_side(seg, img, img->width), height = working_side(seg, img, img->height), channels, err;
    float *in, *out, *small;

    if (seg->info.fixed_size || !sst_network_accepts(seg->net, width, height)) {
        width = seg->info.width;
        height = seg->info.height;
    }
    err = sst_network_out_shape(seg->net, width, height, &channels, &u->w, &u->h);
    if (err)
        return err;
    u->count = seg->info.classes.count;
    in = sst_mem_alloc_raw((size_t)3 * (size_t)width * (size_t)height, sizeof(*in));
    out = sst_mem_alloc_raw((size_t)channels * (size_t)u->w * (size_t)u->h, sizeof(*out));
    small = sst_mem_alloc_raw((size_t)u->count * (size_t)u->w * (size_t)u->h, sizeof(*small));
    err = in && out && small ? make_input(in, width, height, img, seg) : -ENOMEM;
    if (err)
        sst_log_error("segmentation: not enough memory for an image of %d x %d", img->width, img->height);
    if (!err)
        err = sst_network_run(seg->net, in, width, height, out);
    if (!err)
        err = interleave(small, out, u->h, u->w, seg);
    sst_mem_free(in);
    sst_mem_free(out);
    if (err)
        sst_mem_free(small);
    else
        u->small = small;
    return err;
}

int sst_segment(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label,
                struct sst_map_f32 *entropy, float **prob)
{
    const size_t pixels = (size_t)img->width * (size_t)img->height;
    struct sst_map_u8 label_made = { 0 };
    struct sst_map_f32 entropy_made = { 0 };
    struct upsample u = { .seg = seg, .label = &label_made, .entropy = entropy ? &entropy_made : NULL };
    int err = run_network(seg, img, &u);

    if (err)
        return err;
    u.rows = sst_mem_alloc_raw((size_t)sst_thread_count(seg->threads) * (size_t)u.w * (size_t)u.count, sizeof(*u.rows));
    if (prob)
        u.prob = malloc((size_t)u.count * pixels * sizeof(*u.prob));
    err = u.rows && (!prob || u.prob) ? sst_map_u8_init(&label_made, img->width, img->height) : -ENOMEM;
    if (!err && entropy)
        err = sst_map_f32_init(&entropy_made, img->width, img->height);
    if (err)
        sst_log_error("segmentation: not enough memory for an image of %d x %d", img->width, img->height);
    else
        err = sst_parallel_for(img->height, seg->threads, upsample_row, &u);
    sst_mem_free((void *)(uintptr_t)u.small);
    sst_mem_free(u.rows);
    if (err) {
        sst_map_u8_fini(&label_made);
        sst_map_f32_fini(&entropy_made);
        free(u.prob);
        return err;
    }
    *label = label_made;
    if (entropy)
        *entropy = entropy_made;
    if (prob)
        *prob = u.prob;
    return 0;
}
