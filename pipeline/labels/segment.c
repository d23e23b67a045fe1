/* Image -> working size -> network -> probabilities at the network's resolution -> labels and entropy at the image's
 * size. The last step goes pixel by pixel, so that the probabilities of a large image exist only where the caller wants
 * them. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/labels/labels.h"
#include "pipeline/labels/resample.h"
#include "pipeline/network/network.h"

struct sst_segmenter {
    struct sst_network *net;
    char *path;
    int threads;
    struct sst_classes classes;
    double mean[3], std[3], eps_h, temperature;
    int width, height; /* nominal working size */
    bool probabilities;
};

/* --- metadata ------------------------------------------------------------------------------------- */

static int bad_metadata(const struct sst_segmenter *seg, const char *key, const char *want)
{
    const char *value = sst_network_metadata(seg->net, key);
    char shown[80];

    snprintf(shown, sizeof(shown), "%s", value ? value : "missing");
    for (char *p = shown; *p; p++)
        *p = (unsigned char)*p < ' ' ? '?' : *p; /* the file may come from anywhere */
    sst_log_error(
        "model %s: its metadata %s is %s; it must be %s: use a segmentation network exported for this program",
        seg->path, key, shown, want);
    return -EBADMSG;
}

/* Exactly n numbers from min to max, separated by commas or blanks; a missing entry leaves the default. */
static int read_numbers(struct sst_segmenter *seg, const char *key, double *out, int n, double min, double max,
                        const char *want)
{
    const char *text = sst_network_metadata(seg->net, key);

    if (!text)
        return 0;
    for (int i = 0; i < n; i++) {
        char *end;
        const double v = strtod(text, &end);

        if (end == text || !(v >= min && v <= max))
            return bad_metadata(seg, key, want);
        out[i] = v;
        text = end + strspn(end, ", ");
    }
    return *text ? bad_metadata(seg, key, want) : 0;
}

/* The next name of a comma-separated list without the blanks around it: its length, or 0 at the end or where it is
 * empty. */
static size_t next_name(const char **list, const char **name)
{
    size_t n;

    *list += strspn(*list, " ");
    *name = *list;
    n = strcspn(*list, ",");
    *list += n + ((*list)[n] == ',');
    while (n && (*name)[n - 1] == ' ')
        n--;
    return n;
}

static int read_classes(struct sst_segmenter *seg)
{
    const char *key = "sst.classes", *list = sst_network_metadata(seg->net, key), *name;
    struct sst_classes *c = &seg->classes;

    if (!list || !*list)
        return bad_metadata(seg, key, "the comma-separated names of the classes");
    while (*list) {
        const size_t n = next_name(&list, &name);

        if (!n || n >= SST_CLASS_NAME_MAX || c->count == SST_MAX_CLASSES)
            return bad_metadata(seg, key, "at most 64 names of 1 to 31 characters");
        memcpy(c->names[c->count], name, n);
        if (sst_classes_find(c, c->names[c->count]))
            return bad_metadata(seg, key, "a list of different names");
        c->count++;
    }
    return 0;
}

static int read_ground(struct sst_segmenter *seg)
{
    const char *key = "sst.ground", *list = sst_network_metadata(seg->net, key), *name;

    while (list && *list) {
        const size_t n = next_name(&list, &name);
        char text[SST_CLASS_NAME_MAX] = "";
        int label = 0;

        if (n && n < sizeof(text)) {
            memcpy(text, name, n);
            label = sst_classes_find(&seg->classes, text);
        }
        if (!label)
            return bad_metadata(seg, key, "a list of names from sst.classes");
        seg->classes.ground[label - 1] = true;
    }
    return 0;
}

static int read_size(struct sst_segmenter *seg)
{
    const char *key = "sst.size", *text = sst_network_metadata(seg->net, key);
    int n = 0;

    if (!text)
        return 0;
    if (sscanf(text, "%5dx%5d%n", &seg->width, &seg->height, &n) != 2 || text[n] || seg->width < 8 || seg->height < 8 ||
        seg->width > 8192 || seg->height > 8192)
        return bad_metadata(seg, key, "WxH with sides of 8..8192");
    return 0;
}

static int read_output(struct sst_segmenter *seg)
{
    const char *key = "sst.output", *text = sst_network_metadata(seg->net, key);

    seg->probabilities = text && !strcmp(text, "probabilities");
    if (text && !seg->probabilities && strcmp(text, "logits") != 0)
        return bad_metadata(seg, key, "logits or probabilities");
    return 0;
}

static int read_metadata(struct sst_segmenter *seg)
{
    int err = read_classes(seg);

    if (!err)
        err = read_ground(seg);
    if (!err)
        err = read_numbers(seg, "sst.mean", seg->mean, 3, -10, 10, "three numbers in -10..10");
    if (!err)
        err = read_numbers(seg, "sst.std", seg->std, 3, 1e-3, 1e3, "three numbers in 0.001..1000");
    if (!err)
        err = read_numbers(seg, "sst.epsilon_h", &seg->eps_h, 1, 0, HUGE_VAL, "one number, 0 or more");
    if (!err)
        err = read_numbers(seg, "sst.temperature", &seg->temperature, 1, 1e-3, 1e3, "one number in 0.001..1000");
    if (!err)
        err = read_size(seg);
    return err ? err : read_output(seg);
}

/* A network for other pictures, or with another number of classes, is told at once and not at the first image. */
static int check_shape(struct sst_segmenter *seg)
{
    int c, w, h, err;

    if (sst_network_in_channels(seg->net) != 3) {
        sst_log_error("model %s takes %d channels, not the 3 of a colour image; use a segmentation network", seg->path,
                      sst_network_in_channels(seg->net));
        return -EBADMSG;
    }
    err = sst_network_out_shape(seg->net, seg->width, seg->height, &c, &w, &h);
    if (err)
        return err == -EINVAL ? -EBADMSG : err;
    if (c != seg->classes.count) {
        sst_log_error("model %s gives %d channels for the %d classes that its metadata lists; export it again",
                      seg->path, c, seg->classes.count);
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
        .std = { 1, 1, 1 },
        .eps_h = INFINITY,
        .temperature = 1,
        .width = 480,
        .height = 360,
    };
    if (seg->path)
        err = sst_network_open(&seg->net, model, precision, threads);
    if (!err)
        err = read_metadata(seg);
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

const struct sst_classes *sst_segmenter_classes(const struct sst_segmenter *seg)
{
    return &seg->classes;
}

double sst_segmenter_eps_h(const struct sst_segmenter *seg)
{
    return seg->eps_h;
}

/* --- one image ------------------------------------------------------------------------------------ */

/* A side of the working size: the image's proportions, the nominal area, multiples of 8; a strip is cut at four times
 * the longer nominal side. */
static int working_side(const struct sst_segmenter *seg, const struct sst_image *img, int side)
{
    const double scale = sqrt((double)seg->width * seg->height / ((double)img->width * img->height));

    return (int)sst_clamp_double(8 * round(side * scale / 8), 8, 4 * sst_max_int(seg->width, seg->height) / 8 * 8);
}

/* Logits or unnormalised probabilities of one pixel become probabilities; false if they cannot. */
static bool to_probabilities(float *p, int count, const struct sst_segmenter *seg)
{
    double max = -INFINITY, sum = 0;

    for (int c = 0; c < count; c++) {
        if (!isfinite(p[c]) || (seg->probabilities && p[c] < 0))
            return false;
        max = p[c] > max ? p[c] : max;
    }
    for (int c = 0; c < count; c++) {
        if (!seg->probabilities)
            p[c] = expf((float)((p[c] - max) / seg->temperature));
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

/* [count][h][w] network output to [h][w][count] probabilities. */
static int interleave(float *small, const float *out, int count, int h, int w, const struct sst_segmenter *seg)
{
    const size_t plane = (size_t)h * (size_t)w;

    for (size_t i = 0; i < plane; i++) {
        float *p = small + i * (size_t)count;

        for (int c = 0; c < count; c++)
            p[c] = out[(size_t)c * plane + i];
        if (!to_probabilities(p, count, seg)) {
            sst_log_error(
                "model %s: its output at (%d, %d) is no probability (NaN, infinite or negative); use another model",
                seg->path, (int)(i % (size_t)w), (int)(i / (size_t)w));
            return -EBADMSG;
        }
    }
    return 0;
}

/* Probabilities at the network's resolution, in u->small. */
static int run_network(struct sst_segmenter *seg, const struct sst_image *img, struct upsample *u)
{
    int width = working_side(seg, img, img->width), height = working_side(seg, img, img->height), err;
    float *in, *out, *small;

    if (!sst_network_accepts(seg->net, width, height)) {
        width = seg->width;
        height = seg->height;
    }
    err = sst_network_out_shape(seg->net, width, height, &u->count, &u->w, &u->h);
    if (err)
        return err;
    in = sst_mem_alloc_raw((size_t)3 * (size_t)width * (size_t)height, sizeof(*in));
    out = sst_mem_alloc_raw((size_t)u->count * (size_t)u->w * (size_t)u->h, sizeof(*out));
    small = sst_mem_alloc_raw((size_t)u->count * (size_t)u->w * (size_t)u->h, sizeof(*small));
    err = in && out && small ? sst_resample(in, width, height, img, seg->mean, seg->std, seg->threads) : -ENOMEM;
    if (err)
        sst_log_error("segmentation: not enough memory for an image of %d x %d", img->width, img->height);
    if (!err)
        err = sst_network_run(seg->net, in, width, height, out);
    if (!err)
        err = interleave(small, out, u->count, u->h, u->w, seg);
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
