/* tests/refine_field.h - small light fields whose labels a device must refine as the CPU does. */
#ifndef SST_TESTS_REFINE_FIELD_H
#define SST_TESTS_REFINE_FIELD_H

#include <math.h>
#include <stdlib.h>

#include "pipeline/kernels/class_prob.h"
#include "pipeline/method/labels/labels_internal.h"
#include "pipeline/method/labels/model_info.h"
#include "pipeline/method/process/process_internal.h"
#include "pipeline/method/refine/refine.h"
#include "tests/random.h"
#include "tests/self_tests.h"
#include "tests/test.h"

static inline bool refine_opens(const char *name)
{
    struct sst_refine_device *d = NULL;
    struct sst_runner *shared;
    bool opened;

    if (sst_runner_create(&shared, name, 0))
        return false;
    opened = !sst_refine_device_create(&d, shared);
    sst_refine_device_destroy(d);
    sst_runner_destroy(shared);
    return opened;
}

static inline int refine_self_tests(void)
{
    static int found;

    found = found ? found : self_tests(refine_opens);
    return found;
}

/* Label and disparity (1/64 px) of a pixel: a table that rises from row 25 on, with two things on it of nearly the same
 * disparities, and leaves of two kinds before the wall behind. */
static inline uint8_t refine_truth(int x, int y, double *q)
{
    const bool horse = x > 20 && x < 34 && y > 12 && y<44, bicycle = x> 50 && x < 70 && y > 20 && y < 50;

    *q = 340;
    if (x > 74 && y < 30)
        return (*q = 900 + 40 * ((x / 3 + y / 2) % 3), (x / 3 + y / 2) % 2 ? SST_LABEL_MOTORCYCLE : SST_LABEL_BICYCLE);
    if (horse)
        return (*q = 520, SST_LABEL_HORSE);
    if (bicycle)
        return (*q = 530, SST_LABEL_BICYCLE);
    if (y > 25)
        return (*q = 340 + 9 * (y - 25), SST_LABEL_TABLE);
    return SST_LABEL_BUILDING;
}

/* The last view is absent, one has no label at all, another one no disparities. */
static inline void refine_init(struct sst_lightfield *lf, int rows, int cols, int width, int height)
{
    uint64_t seed = 7;

    assert_int_equal(sst_lightfield_init(lf, rows, cols), 0);
    lf->width = width;
    lf->height = height;
    lf->focal_px = 120;
    lf->disp_min_px = 1.5;
    lf->classes = sst_classes_default;
    for (int k = 0; k < rows * cols - 1; k++) {
        struct sst_view *v = &lf->views[k];

        v->present = true;
        v->bx = k % cols - (cols - 1) / 2 + 0.01 * (k % 4);
        v->by = k / cols - (rows - 1) / 2 - 0.02 * (k % 3);
        assert_int_equal(sst_image_init(&v->image, width, height), 0);
        assert_int_equal(sst_map_u16_init(&v->disp, width, height), 0);
        assert_int_equal(sst_map_u8_init(&v->label, width, height), 0);
        for (int i = 0; i < width * height; i++) {
            const int x = i % width, y = i / width;
            double q;
            const uint8_t label = refine_truth(x + k % 3, y, &q);
            const bool known = sst_random(&seed) > 0.03 && k != 2;

            for (int c = 0; c < 3; c++)
                sst_image_row(&v->image, c, y)[x] = (uint8_t)(label * 9 + c * 5 + (int)(sst_random(&seed) * 30));
            sst_map_u16_row(&v->disp, y)[x] = (uint16_t)(known ? q + 6 * test_normal(&seed) : (double)SST_DISP_NONE);
            sst_map_u8_row(&v->label, y)[x] = sst_random(&seed) < 0.45 && k != 1 ? label : SST_LABEL_NONE;
        }
    }
    assert_int_equal(sst_map_u8_init(&lf->views[0].valid, width, height), 0);
    for (int y = 0; y < height; y++)
        memset(sst_map_u8_row(&lf->views[0].valid, y) + y % 7, 255, (size_t)(width - 9 - y % 7));
    sst_map_u8_row(&lf->views[0].label, 3)[4] = 200; /* outside the class list: stays */
}

/* Configurations that use different parts of the device. @return false: there is none of this number */
static inline bool refine_config(struct sst_refine_config *cfg, int i)
{
    sst_refine_config_defaults(cfg);
    cfg->threads = 2;
    cfg->min_pixels = 20;
    switch (i) {
    case 0:
        break;
    case 1: /* normals decide */
        cfg->ground_plane = false;
        cfg->p_distance = 0.5;
        cfg->tau = 0.3;
        break;
    case 2:
        cfg->ground_plane = false;
        cfg->p_normal = 0;
        break;
    case 3: /* all distances alike */
        cfg->ground_plane = false;
        cfg->p_distance = 0;
        cfg->normal_window = 33;
        break;
    case 4: /* few candidates */
        cfg->eps_d = 0.2;
        cfg->matcher_sigma_px = 0;
        break;
    default:
        return false;
    }
    return true;
}

/* Two light fields with labels of their own; the rest is borrowed. */
static inline void refine_copy(struct sst_lightfield copy[2], const struct sst_lightfield *lf)
{
    const size_t views = (size_t)(lf->rows * lf->cols);

    for (int i = 0; i < 2; i++) {
        copy[i] = *lf;
        copy[i].views = calloc(views, sizeof(*copy[i].views));
        assert_non_null(copy[i].views);
        for (size_t k = 0; k < views; k++) {
            struct sst_map_u8 *label = &copy[i].views[k].label;

            copy[i].views[k] = lf->views[k];
            if (!lf->views[k].label.data)
                continue;
            *label = (struct sst_map_u8){ 0 };
            assert_int_equal(sst_map_u8_init(label, lf->width, lf->height), 0);
            for (int y = 0; y < lf->height; y++)
                memcpy(sst_map_u8_row(label, y), sst_map_u8_row(&lf->views[k].label, y), (size_t)lf->width);
        }
    }
}

/* Their labels are the same, and others than at first in at least `least` rows. */
static inline void refine_assert_same(struct sst_lightfield copy[2], const struct sst_lightfield *lf, int least)
{
    int changed = 0;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        for (int y = 0; lf->views[k].present && y < lf->height; y++) {
            const uint8_t *want = sst_map_u8_row(&copy[1].views[k].label, y);

            assert_memory_equal(sst_map_u8_row(&copy[0].views[k].label, y), want, (size_t)lf->width);
            changed += memcmp(want, sst_map_u8_row(&lf->views[k].label, y), (size_t)lf->width) != 0;
        }
        for (int i = 0; i < 2; i++)
            sst_map_u8_fini(&copy[i].views[k].label);
    }
    assert_true(changed >= least);
    free(copy[0].views);
    free(copy[1].views);
}

/* Refine on a device and on the CPU, which must give the same bytes; the light field stays as it is. */
static inline void refine_compare(const struct sst_lightfield *lf, const struct sst_refine_config *cfg,
                                  struct sst_refine_device_report *report)
{
    struct sst_refine_config cpu = *cfg;
    struct sst_lightfield copy[2];

    refine_copy(copy, lf);
    cpu.device = NULL;
    assert_int_equal(sst_refine_labels(&copy[0], cfg, NULL), 0);
    assert_int_equal(sst_refine_labels(&copy[1], &cpu, NULL), 0);
    sst_refine_device_forget(cfg->device); /* the next light field has other views */
    sst_refine_device_report(cfg->device, report);
    refine_assert_same(copy, lf, 50);
}

/* Vote on a device and on the CPU, likewise. */
static inline void vote_compare(const struct sst_lightfield *lf, const bool *skip, struct sst_refine_device *device,
                                struct sst_refine_device_report *report)
{
    struct sst_lightfield copy[2];

    refine_copy(copy, lf);
    assert_int_equal(process_vote_labels(&copy[0], skip, NULL, 2, device), 0);
    assert_int_equal(process_vote_labels(&copy[1], skip, NULL, 2, NULL), 0);
    sst_refine_device_forget(device); /* the next light field has other views */
    sst_refine_device_report(device, report);
    refine_assert_same(copy, lf, 20);
}

/* Carry labels from the views that are not among `carried`, with entropies of them, then without, filled, on a device
 * and on the CPU, likewise, and what is measured of it. */
static inline void carry_compare(const struct sst_lightfield *lf, const bool *carried, int ref,
                                 struct sst_refine_device *device, struct sst_refine_device_report *report)
{
    const size_t views = (size_t)(lf->rows * lf->cols);
    struct sst_map_f32 *entropy[2];
    struct sst_lightfield copy[2];
    double error[2];

    refine_copy(copy, lf);
    for (int i = 0; i < 2; i++) {
        const struct process_carry c = { &copy[i], carried, NULL, 2, i ? NULL : device };

        entropy[i] = calloc(views, sizeof(*entropy[i]));
        assert_non_null(entropy[i]);
        for (size_t k = 0; k < views; k++) {
            if (!lf->views[k].present || carried[k])
                continue;
            assert_int_equal(sst_map_f32_init(&entropy[i][k], lf->width, lf->height), 0);
            for (int at = 0; at < lf->width * lf->height; at++)
                sst_map_f32_row(&entropy[i][k], at / lf->width)[at % lf->width] = (float)at / (float)(k + 3);
        }
        assert_int_equal(process_carry_labels(&c, entropy[i], false), 0);
        assert_int_equal(process_carry_error(&c, ref, &error[i]), 0);
    }
    assert_false(isnan(error[0]));
    assert_true(error[0] == error[1]);
    for (size_t k = 0; k < views; k++) {
        for (int y = 0; lf->views[k].present && y < lf->height; y++) {
            const size_t width = (size_t)lf->width;

            assert_memory_equal(sst_map_f32_row(&entropy[0][k], y), sst_map_f32_row(&entropy[1][k], y), 4 * width);
            assert_memory_equal(sst_map_u8_row(&copy[0].views[k].label, y), sst_map_u8_row(&copy[1].views[k].label, y),
                                width);
        }
        for (int i = 0; i < 2; i++)
            sst_map_f32_fini(&entropy[i][k]);
    }
    for (int i = 0; i < 2; i++) {
        const struct process_carry c = { &copy[i], carried, NULL, 2, i ? NULL : device };

        assert_int_equal(process_carry_labels(&c, NULL, true), 0);
        free(entropy[i]);
    }
    sst_refine_device_forget(device);
    sst_refine_device_report(device, report);
    refine_assert_same(copy, lf, 20);
}

#define ENLARGE_LIMIT 1.1

/* Probabilities of 12 classes in cells, from sure ones to doubtful ones. */
static inline void enlarge_cells(struct class_grid *grid)
{
    uint64_t seed = 5;

    *grid = (struct class_grid){ .width = 13, .height = 9, .count = 12, .values = class_grid_values(12) };
    grid->cell = calloc(13 * 9 * grid->values, sizeof(*grid->cell));
    assert_non_null(grid->cell);
    for (int i = 0; i < 13 * 9; i++) {
        float *cell = grid->cell + (size_t)i * grid->values, sum = 0;
        const double sure = pow(10, -8 * sst_random(&seed));

        for (int c = 0; c < 12; c++)
            sum += cell[c] = (float)(sst_random(&seed) * (c == (i / 5) % 12 ? 1 : sure));
        for (int c = 0; c < 12; c++)
            cell[c] /= sum;
    }
}

/* Labels of a view from cells, with entropies and by the threshold, on a device and on the CPU, likewise. */
static inline void enlarge_compare(const struct sst_lightfield *lf, int view, struct sst_refine_device *device,
                                   struct sst_refine_device_report *report)
{
    struct sst_refine_enlarge how = { device, lf, view };
    const struct sst_image *image = &lf->views[view].image;
    struct sst_map_f32 entropy[2] = { { 0 }, { 0 } };
    struct upsample_memory memory = { 0 };
    struct sst_map_u8 label[3] = { { 0 }, { 0 }, { 0 } };
    struct sst_label_cells cells;
    struct class_grid grid;
    int kept = 0;

    enlarge_cells(&grid);
    for (int i = 0; i < 3; i++)
        assert_int_equal(sst_map_u8_init(&label[i], lf->width, lf->height), 0);
    for (int i = 0; i < 2; i++)
        assert_int_equal(sst_map_f32_init(&entropy[i], lf->width, lf->height), 0);
    assert_int_equal(labels_pack_cells(&cells, &grid, image, 1, &memory), 0);
    if (sst_refine_device_enlarge(&how, &cells, &label[0], &entropy[0], ENLARGE_LIMIT) &&
        sst_refine_device_enlarge(&how, &cells, &label[2], NULL, ENLARGE_LIMIT)) {
        assert_int_equal(labels_upsample(&label[1], &entropy[1], NULL, &grid, image, 1, &memory), 0);
        for (int y = 0; y < lf->height; y++) {
            const uint8_t *want = sst_map_u8_row(&label[1], y), *low = sst_map_u8_row(&label[2], y);
            const float *h = sst_map_f32_row(&entropy[1], y);

            assert_memory_equal(sst_map_u8_row(&label[0], y), want, (size_t)lf->width);
            assert_memory_equal(sst_map_f32_row(&entropy[0], y), h, 4 * (size_t)lf->width);
            for (int x = 0; x < lf->width; x++) {
                assert_int_equal(low[x], (double)h[x] < ENLARGE_LIMIT ? want[x] : SST_LABEL_NONE);
                kept += low[x] != SST_LABEL_NONE;
            }
        }
        print_message("%d of %d labels kept\n", kept, lf->width * lf->height);
        assert_in_range(kept, lf->width * lf->height / 5, lf->width * lf->height * 4 / 5);
    }
    for (int i = 0; i < 3; i++)
        sst_map_u8_fini(&label[i]);
    for (int i = 0; i < 2; i++)
        sst_map_f32_fini(&entropy[i]);
    upsample_memory_fini(&memory);
    free(grid.cell);
    sst_refine_device_forget(device);
    sst_refine_device_report(device, report);
}

#define FINISH_CHANNELS 14 /* of 12 classes */
#define FINISH_ACROSS   13
#define FINISH_DOWN     9
#define INPUT_WIDTH     104 /* wider than the picture, and lower */
#define INPUT_HEIGHT    32

/* A network's logits, whose words start at the second one, and what is done with them. */
struct finish_result {
    struct sst_label_result result;
    struct sst_model_info info;
    struct upsample_memory memory;
    float logit[FINISH_CHANNELS * FINISH_ACROSS * FINISH_DOWN + 1];
};

static inline void finish_init(struct finish_result *f, const struct sst_lightfield *lf)
{
    uint64_t seed = 21;

    *f = (struct finish_result){ .info = { .channels = FINISH_CHANNELS,
                                           .temperature = 1.7,
                                           .bgr = true,
                                           .mean = { 0.485, 0.456, 0.406 },
                                           .std = { 0.229, 0.224, 0.225 } } };
    f->info.classes.count = 12;
    for (int c = 0; c < FINISH_CHANNELS; c++)
        f->info.class_of[c] = (uint8_t)(c % 12);
    for (size_t i = 0; i < ARRAY_LEN(f->logit); i++)
        f->logit[i] = (float)(sst_random(&seed) * (i % 3 ? 9 : 200) - 30);
    f->result.grid = (struct sst_gpu_label_grid){
        .width = lf->width, .height = lf->height, .grid_width = FINISH_ACROSS, .grid_height = FINISH_DOWN
    };
    f->result.input = (struct sst_gpu_label_input){
        .width = lf->width, .height = lf->height, .in_width = INPUT_WIDTH, .in_height = INPUT_HEIGHT
    };
    assert_int_equal(labels_pack_tables(&f->result, &f->info, &f->memory), 0);
}

/* The input of a network that lies on a device, made there: that of the CPU. */
static inline bool feed_run(struct finish_result *f, const struct sst_lightfield *lf, int view,
                            struct sst_runner *shared, struct sst_refine_device *device)
{
    enum { INPUT = 3 * INPUT_WIDTH * INPUT_HEIGHT };
    const struct sst_refine_enlarge how = { device, lf, view };
    const struct sst_image *image = &lf->views[view].image;
    struct sst_image swapped = *image;
    struct sst_mem_kept kept = { 0 };
    struct sst_gpu_buffer *to = NULL;
    float *want = calloc(INPUT, sizeof(*want)), *got = calloc(INPUT, sizeof(*got));
    struct sst_gpu *g;
    bool fed;

    swapped.plane[0] = image->plane[2];
    swapped.plane[2] = image->plane[0];
    assert_true(want && got);
    assert_int_equal(resample_planes(want, INPUT_WIDTH, INPUT_HEIGHT, &swapped, f->info.mean, f->info.std, 1, &kept),
                     0);
    sst_runner_lock(shared);
    g = sst_runner_device(shared);
    assert_non_null(g);
    assert_int_equal(sst_gpu_buffer_create(g, &to, (INPUT + 2) * sizeof(*got)), 0);
    fed = sst_refine_device_feed((void *)&how, g, to, 2, &f->result, true);
    if (fed) {
        assert_int_equal(sst_gpu_wait(g), 0);
        assert_int_equal(sst_gpu_download(g, got, to, 2 * sizeof(*got), INPUT * sizeof(*got)), 0);
        assert_memory_equal(got, want, INPUT * sizeof(*got));
    }
    sst_gpu_buffer_destroy(g, to);
    sst_runner_unlock(shared);
    sst_mem_kept_fini(&kept);
    free(want);
    free(got);
    return fed;
}

/* Labels and entropies of a view from a result that lies on a device. @return sst_refine_device_finish() */
static inline bool finish_run(struct finish_result *f, const struct sst_lightfield *lf, int view,
                              struct sst_runner *shared, struct sst_refine_device *device, struct sst_map_u8 *label,
                              struct sst_map_f32 *entropy)
{
    struct sst_refine_enlarge how = { device, lf, view };
    struct sst_gpu_buffer *from = NULL;
    struct sst_gpu *g;
    bool done;

    sst_runner_lock(shared);
    g = sst_runner_device(shared);
    assert_non_null(g);
    assert_int_equal(sst_gpu_buffer_create(g, &from, sizeof(f->logit)), 0);
    assert_int_equal(sst_gpu_upload(g, from, 0, f->logit, sizeof(f->logit)), 0);
    done = sst_refine_device_finish(&how, g, from, 1, &f->result, label, entropy, ENLARGE_LIMIT);
    sst_gpu_buffer_destroy(g, from);
    sst_runner_unlock(shared);
    return done;
}

/* The same on the CPU. */
static inline void finish_expect(const struct finish_result *f, const struct sst_image *image, struct sst_map_u8 *label,
                                 struct sst_map_f32 *entropy)
{
    enum { CELLS = FINISH_ACROSS * FINISH_DOWN };
    struct class_grid grid = {
        .width = FINISH_ACROSS, .height = FINISH_DOWN, .count = 12, .values = class_grid_values(12)
    };
    struct upsample_memory memory = { 0 };
    float p[FINISH_CHANNELS];

    grid.cell = calloc(CELLS * grid.values, sizeof(*grid.cell));
    assert_non_null(grid.cell);
    for (size_t i = 0; i < CELLS; i++) {
        for (size_t c = 0; c < FINISH_CHANNELS; c++)
            p[c] = f->logit[1 + c * CELLS + i];
        assert_true(sst_class_probabilities(p, FINISH_CHANNELS, false, (float)(1 / f->info.temperature)));
        for (size_t c = 0; c < FINISH_CHANNELS; c++)
            grid.cell[i * grid.values + f->info.class_of[c]] += p[c];
    }
    assert_int_equal(labels_upsample(label, entropy, NULL, &grid, image, 1, &memory), 0);
    upsample_memory_fini(&memory);
    free(grid.cell);
}

/* Input and cells do not go through the host: of two views the colours are uploaded, and the tables once. */
static inline void finish_compare(const struct sst_lightfield *lf, struct sst_runner *shared,
                                  struct sst_refine_device *device, struct sst_refine_device_report *report)
{
    struct sst_map_f32 entropy[2] = { { 0 }, { 0 } };
    struct sst_map_u8 label[2] = { { 0 }, { 0 } };
    struct finish_result f;

    finish_init(&f, lf);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(sst_map_u8_init(&label[i], lf->width, lf->height), 0);
        assert_int_equal(sst_map_f32_init(&entropy[i], lf->width, lf->height), 0);
    }
    for (int view = 0; view < 2; view++) {
        finish_expect(&f, &lf->views[view].image, &label[1], &entropy[1]);
        if (!feed_run(&f, lf, view, shared, device) ||
            !finish_run(&f, lf, view, shared, device, &label[0], &entropy[0]))
            break;
        for (int y = 0; y < lf->height; y++) {
            assert_memory_equal(sst_map_u8_row(&label[0], y), sst_map_u8_row(&label[1], y), (size_t)lf->width);
            assert_memory_equal(sst_map_f32_row(&entropy[0], y), sst_map_f32_row(&entropy[1], y),
                                4 * (size_t)lf->width);
        }
    }
    sst_refine_device_report(device, report);
    if (report->finished == 2)
        assert_int_equal(report->upload_bytes, 2 * 4 * lf->width * lf->height + (int)f.result.tables_bytes);
    f.logit[40] = NAN;
    assert_false(finish_run(&f, lf, 0, shared, device, &label[0], &entropy[0]));
    for (int i = 0; i < 2; i++) {
        sst_map_u8_fini(&label[i]);
        sst_map_f32_fini(&entropy[i]);
    }
    upsample_memory_fini(&f.memory);
    sst_refine_device_forget(device);
}

#endif
