/* The shaders of label refinement: their self-tests, each on what the references of the steps before it leave. */
#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/gpu/refine.h"

#define TEST_WIDTH  43
#define TEST_HEIGHT 37
#define TEST_PIXELS (TEST_WIDTH * TEST_HEIGHT)
#define TEST_RADIUS 10
#define TEST_PITCH  ((TEST_WIDTH + 3) / 4 * 4)
#define TEST_BINS   1200 /* of disparities of pixels without a label */
#define TEST_NONE   0xFFFFU
#define OBJECT      3 /* labels */
#define OTHER       34
#define GROUND      40
#define CORNERS     4
#define TALL_WIDTH  9
#define TALL_HEIGHT 1100

static const uint32_t objects[2] = { 1U << (OBJECT - 1), 1U << (OTHER - 33) }, grounds[2] = { 0, 1U << (GROUND - 33) };

struct test {
    uint32_t view[TEST_PIXELS], table[TEST_BINS][2], seen[4];
    struct sst_gpu_refine_ground ground[SST_GPU_REFINE_LABELS];
    struct sst_gpu_refine_choice choice[TEST_PIXELS];
    uint32_t mask[TEST_PIXELS][2], columns[TEST_PIXELS];
    int32_t hull[CORNERS][2];
    struct sst_gpu_refine_sums sums[TEST_PIXELS];
    struct sst_surface_plane planes[TEST_PIXELS];
    struct sst_gpu_refine_region regions[SST_GPU_REFINE_LABELS];
    float normals[TEST_PIXELS][4];
    struct sst_gpu_refine_mean means[SST_GPU_REFINE_LABELS];
    uint8_t out[TEST_PITCH * TEST_HEIGHT];
};

/* Rows of a view that are worked on. */
struct band {
    int top, rows;
};

#define BANDS 2
static const struct band bands[BANDS] = { { 0, TEST_HEIGHT }, { 13, 15 } };

/* With the rows that windows reach. */
static struct band around(struct band b)
{
    const int top = sst_max_int(b.top - TEST_RADIUS, 0), end = sst_min_int(b.top + b.rows + TEST_RADIUS, TEST_HEIGHT);

    return (struct band){ top, end - top };
}

static struct sst_gpu_refine_mask mask_push(struct band b)
{
    return (struct sst_gpu_refine_mask){
        TEST_WIDTH, TEST_HEIGHT, { 0, 1U << (GROUND - 33) }, { 0, 1U << (GROUND - 33) }, b.top, b.rows
    };
}

static struct sst_gpu_refine_columns columns_push(struct band b)
{
    return (struct sst_gpu_refine_columns){ TEST_WIDTH, TEST_HEIGHT, OTHER, b.top, b.rows };
}

static struct sst_gpu_refine_window window_push(struct band b)
{
    const struct band all = around(b);

    return (struct sst_gpu_refine_window){ TEST_WIDTH, TEST_HEIGHT, TEST_RADIUS, all.top, all.rows };
}

#define COMPETE 3

/* Which label competes, with the columns of OTHER or as one that is absent. */
static struct sst_gpu_refine_compete compete_push(int i, struct band b)
{
    static const uint32_t labels[COMPETE] = { OBJECT, OTHER, GROUND }, corners[COMPETE] = { 0, CORNERS, CORNERS };

    return (struct sst_gpu_refine_compete){ TEST_WIDTH, TEST_HEIGHT, labels[i], labels[i] == GROUND,
                                            corners[i], 1,           b.top,     b.rows };
}

static struct sst_gpu_refine_normals normals_push(struct band b)
{
    return (struct sst_gpu_refine_normals){ TEST_WIDTH,
                                            TEST_HEIGHT,
                                            TEST_RADIUS,
                                            { objects[0] | grounds[0], objects[1] | grounds[1] },
                                            { grounds[0], grounds[1] },
                                            { 320, 21, 18, 2.5F, 1.5F },
                                            b.top,
                                            b.rows,
                                            around(b).top };
}

/* A slanted floor with noise, an upright thing in front, something far nearer and steeper; gaps in labels and
 * disparities. */
static void make_view(struct test *t)
{
    uint32_t state = 21;

    for (int i = 0; i < TEST_PIXELS; i++) {
        const int x = i % TEST_WIDTH, y = i / TEST_WIDTH;
        const bool thing = x > 14 && x < 26 && y < 24, steep = x >= 36, known = gpu_random(&state) % 3;
        const uint32_t noise = gpu_random(&state) % 12;
        const uint32_t q = noise + (thing ? 900U : steep ? 60000U - 1200U * (uint32_t)y : 700U + 9U * (uint32_t)y);
        const uint32_t label = thing ? OTHER : steep ? OBJECT : GROUND;

        t->view[i] = (gpu_random(&state) % 17 && (known || !steep) ? q : TEST_NONE) | (known ? label << 16 : 0);
    }
    for (int q = 0; q < TEST_BINS; q++) {
        const bool common = q > 650 && q < 1000;

        t->table[q][0] = common || q % 5 == 0 ? objects[0] : 0;
        t->table[q][1] = common || q % 3 == 0 ? objects[1] | grounds[1] : 0;
    }
    t->ground[GROUND - 1] = (struct sst_gpu_refine_ground){
        { 0xFFF00000U, 0xFFFFFFFFU }, { 9U << 24, 0 }, { 706U << 24, 706U >> 8 }, { 80U << 24, 80U >> 8 }
    };
    for (int i = 0; i < CORNERS; i++) {
        t->hull[i][0] = i % 2 ? 25 : 15;
        t->hull[i][1] = i / 2 ? 23 : 0;
    }
}

static void run(gpu_reference_fn *reference, const void *push, void *const *buffer)
{
    reference(push, buffer, (const uint32_t[3]){ 1, 1, 1 });
}

/* The steps before the one under test, of a band. @param steps  how many of the seven @return NULL: no memory */
static struct test *make_band(int steps, struct band b)
{
    const struct sst_gpu_refine_mask mask = mask_push(b);
    const struct sst_gpu_refine_columns columns = columns_push(b);
    const struct sst_gpu_refine_window window = window_push(b);
    const struct sst_gpu_refine_normals normals = normals_push(b);
    struct test *t = calloc(1, sizeof(*t));

    if (!t)
        return NULL;
    make_view(t);
    if (steps > 0)
        run(refine_mask_reference, &mask, (void *const[]){ t->view, t->table, t->ground, t->seen, t->choice, t->mask });
    if (steps > 1)
        run(refine_columns_reference, &columns, (void *const[]){ t->view, t->columns });
    for (int i = 0; steps > 2 && i < COMPETE; i++) {
        const struct sst_gpu_refine_compete compete = compete_push(i, b);

        run(refine_compete_reference, &compete, (void *const[]){ t->mask, t->columns, t->hull, t->choice });
    }
    if (steps > 3)
        run(refine_sums_reference, &window, (void *const[]){ t->view, t->sums });
    if (steps > 4)
        run(refine_planes_reference, &window, (void *const[]){ t->sums, t->planes });
    if (steps > 5)
        run(refine_normals_reference, &normals, (void *const[]){ t->view, t->mask, t->planes, t->regions, t->normals });
    for (int i = 0; i < SST_GPU_REFINE_LABELS; i++)
        t->means[i] = (struct sst_gpu_refine_mean){ { i % 2 ? 0.1F : -0.3F, 0.4F, 0.8F }, i != OBJECT - 1 };
    return t;
}

static struct test *make_test(int steps)
{
    return make_band(steps, bands[0]);
}

static struct sst_gpu_work work_of(enum sst_gpu_shader shader, const void *push, uint32_t x, uint32_t y)
{
    return (struct sst_gpu_work){ .shader = shader, .push = push, .groups = { x, y, 1 } };
}

static struct sst_gpu_work plane_work(enum sst_gpu_shader shader, const void *push)
{
    return work_of(shader, push, gpu_groups(TEST_WIDTH, SST_GPU_REFINE_WIDTH),
                   gpu_groups(TEST_HEIGHT, SST_GPU_REFINE_HEIGHT));
}

static struct sst_gpu_work count_work(enum sst_gpu_shader shader, const void *push)
{
    return work_of(shader, push, gpu_groups(TEST_WIDTH, SST_GPU_REFINE_WIDTH),
                   gpu_groups(TEST_HEIGHT, SST_GPU_REFINE_COUNT_HEIGHT));
}

int refine_count_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_refine_count push = { TEST_WIDTH, TEST_HEIGHT, 3, 2000 };
    const struct sst_gpu_work work = count_work(SST_GPU_REFINE_COUNT, &push);
    const size_t bytes = push.labels * push.bins * sizeof(uint32_t);
    struct test *t = make_test(0);
    uint32_t *counts = calloc(bytes, 1);
    const int err = t && counts
                        ? gpu_compare(g, &work, (const void *const[]){ t->view, counts },
                                      (const size_t[]){ sizeof(t->view), bytes }, SST_GPU_REFINE_COUNT_COUNTS, NULL)
                        : -ENOMEM;

    free(counts);
    free(t);
    return err;
}

/* --- grounds ------------------------------------------------------------------------------------------------------ */

#define FAR_PIXELS 16384 /* in long rows and columns, whose sums need 64 bits */
#define FIT_BINS   1024

static struct sst_gpu_refine_fit fit_push(int width, int height)
{
    return (struct sst_gpu_refine_fit){
        width,     height,  { objects[0] | grounds[0], objects[1] | grounds[1] }, { 40U << 24, 40U >> 8 },
        124369502, FIT_BINS
    };
}

/* Sums in place, from which a ground's are carried into the upper half. */
static int compare_sums(struct sst_gpu *g, const struct test *t, const uint32_t *view, int width, int height)
{
    const struct sst_gpu_refine_fit push = fit_push(width, height);
    const struct sst_gpu_work work = work_of(SST_GPU_REFINE_GROUND_SUMS, &push, gpu_groups(width, SST_GPU_REFINE_WIDTH),
                                             gpu_groups(height, SST_GPU_REFINE_HEIGHT));
    struct sst_gpu_refine_ground_sums sums[SST_GPU_REFINE_LABELS] = { { { 0 } } };

    sums[GROUND - 1] = (struct sst_gpu_refine_ground_sums){ .n = { UINT32_MAX, 7 }, .yd = { UINT32_MAX - 9, 0 } };
    return gpu_compare(
        g, &work, (const void *const[]){ view, t->ground, sums },
        (const size_t[]){ (size_t)width * (size_t)height * sizeof(*view), sizeof(t->ground), sizeof(sums) },
        SST_GPU_REFINE_GROUND_SUMS_OUT, NULL);
}

int refine_ground_sums_self_test(struct sst_gpu *g)
{
    struct test *t = make_test(0);
    uint32_t *far = calloc(FAR_PIXELS, sizeof(*far));
    int err = t && far ? compare_sums(g, t, t->view, TEST_WIDTH, TEST_HEIGHT) : -ENOMEM;

    for (int i = 0; far && i < FAR_PIXELS; i++)
        far[i] = (uint32_t)(i % 3 ? OBJECT : OTHER) << 16 | (uint32_t)(i * 7 % 65521);
    for (int i = 0; t && i < SST_GPU_REFINE_LABELS; i++)
        t->ground[i] = (struct sst_gpu_refine_ground){ { 0 }, { 0 }, { 0 }, { 0x12345678, 0xE0 } };
    err = err ? err : compare_sums(g, t, far, FAR_PIXELS, 1);
    err = err ? err : compare_sums(g, t, far, 1, FAR_PIXELS);
    err = err ? err : compare_sums(g, t, far, FAR_PIXELS / 16, 16);
    free(far);
    free(t);
    return err;
}

static size_t misses_bytes(const struct sst_gpu_refine_fit *push)
{
    return (size_t)__builtin_popcountll(sst_gpu_whole(push->labels)) * FIT_BINS * sizeof(uint32_t);
}

int refine_ground_misses_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_refine_fit push = fit_push(TEST_WIDTH, TEST_HEIGHT);
    const struct sst_gpu_work work = count_work(SST_GPU_REFINE_GROUND_MISSES, &push);
    uint32_t *misses = calloc(misses_bytes(&push), 1);
    struct test *t = make_test(0);
    int err = -ENOMEM;

    if (t && misses) {
        t->ground[OTHER - 1].b[1] = 1U << 19; /* beyond all bins, but in the first row */
        err = gpu_compare(g, &work, (const void *const[]){ t->view, t->ground, misses },
                          (const size_t[]){ sizeof(t->view), sizeof(t->ground), misses_bytes(&push) },
                          SST_GPU_REFINE_GROUND_MISSES_OUT, NULL);
    }
    free(misses);
    free(t);
    return err;
}

/* Medians at both ends, below the least limit, on the border of two parts, and of nothing. */
int refine_ground_limit_self_test(struct sst_gpu *g)
{
    static const uint32_t bins[][2] = { { FIT_BINS - 1, 0 }, { 255, 256 }, { 3, 4 } };
    struct sst_gpu_refine_fit push = fit_push(TEST_WIDTH, TEST_HEIGHT);
    const size_t bytes = 5 * FIT_BINS * sizeof(uint32_t);
    uint32_t *misses = calloc(bytes, 1), state = 3;
    struct test *t = make_test(0);
    int err = -ENOMEM;

    push.labels[0] |= 1;
    push.labels[1] |= 1U << 31;
    if (t && misses) {
        const struct sst_gpu_work work = work_of(SST_GPU_REFINE_GROUND_LIMIT, &push, 5, 1);

        for (int i = 0; i < 1000; i++)
            misses[gpu_random(&state) % FIT_BINS]++;
        for (size_t i = 0; i < ARRAY_LEN(bins); i++) {
            misses[(i + 1) * FIT_BINS + bins[i][0]] = 12;
            misses[(i + 1) * FIT_BINS + bins[i][1]] = 11 + (uint32_t)i;
        }
        err = gpu_compare(g, &work, (const void *const[]){ misses, t->ground },
                          (const size_t[]){ bytes, sizeof(t->ground) }, SST_GPU_REFINE_GROUND_LIMIT_GROUNDS, NULL);
    }
    free(misses);
    free(t);
    return err;
}

/* --- the rest ----------------------------------------------------------------------------------------------------- */

int refine_extents_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_refine_extents push = { TEST_WIDTH, TEST_HEIGHT, GROUND };
    const struct sst_gpu_work work = work_of(SST_GPU_REFINE_EXTENTS, &push, TEST_HEIGHT, 1);
    uint32_t extents[GROUND * TEST_HEIGHT] = { 0 };
    struct test *t = make_test(0);
    const int err =
        t ? gpu_compare(g, &work, (const void *const[]){ t->view, extents },
                        (const size_t[]){ sizeof(t->view), sizeof(extents) }, SST_GPU_REFINE_EXTENTS_OUT, NULL)
          : -ENOMEM;

    free(t);
    return err;
}

/* A self-test of whole views and bands. */
static int test_bands(struct sst_gpu *g, int (*test)(struct sst_gpu *g, struct test *t, struct band b), int steps)
{
    int err = 0;

    for (int i = 0; i < BANDS && !err; i++) {
        struct test *t = make_band(steps, bands[i]);

        err = t ? test(g, t, bands[i]) : -ENOMEM;
        free(t);
    }
    return err;
}

static int test_mask(struct sst_gpu *g, struct test *t, struct band b)
{
    const struct sst_gpu_refine_mask push = mask_push(b);
    const struct sst_gpu_work work = plane_work(SST_GPU_REFINE_MASK, &push);

    return gpu_compare(g, &work, (const void *const[]){ t->view, t->table, t->ground, t->seen, t->choice, t->mask },
                       (const size_t[]){ sizeof(t->view), sizeof(t->table), sizeof(t->ground), sizeof(t->seen),
                                         sizeof(t->choice), sizeof(t->mask) },
                       SST_GPU_REFINE_MASK_MASK, NULL);
}

int refine_mask_self_test(struct sst_gpu *g)
{
    return test_bands(g, test_mask, 0);
}

static int test_columns(struct sst_gpu *g, struct test *t, struct band b)
{
    const struct sst_gpu_refine_columns push = columns_push(b);
    const struct sst_gpu_work work =
        work_of(SST_GPU_REFINE_COLUMNS, &push, gpu_groups(TEST_WIDTH, SST_GPU_REFINE_COLUMN_GROUP), 1);

    return gpu_compare(g, &work, (const void *const[]){ t->view, t->columns },
                       (const size_t[]){ sizeof(t->view), sizeof(t->columns) }, SST_GPU_REFINE_COLUMNS_OUT, NULL);
}

/* Columns that are higher than a bit for every row of a slice: with the label here and there, once, and without it. */
static int test_tall_columns(struct sst_gpu *g)
{
    const struct sst_gpu_refine_columns push = { TALL_WIDTH, TALL_HEIGHT, OTHER, 70, TALL_HEIGHT - 90 };
    const struct sst_gpu_work work =
        work_of(SST_GPU_REFINE_COLUMNS, &push, gpu_groups(TALL_WIDTH, SST_GPU_REFINE_COLUMN_GROUP), 1);
    const size_t bytes = (size_t)TALL_WIDTH * TALL_HEIGHT * sizeof(uint32_t);
    uint32_t *view = calloc(bytes, 1), *columns = calloc(bytes, 1), state = 5;
    int err = -ENOMEM;

    for (int i = 0; view && i < TALL_WIDTH * TALL_HEIGHT; i++) {
        const int x = i % TALL_WIDTH, y = i / TALL_WIDTH;

        if (x == TALL_WIDTH - 2 ? y == 500 : x < TALL_WIDTH - 2 && gpu_random(&state) % 150 == 0)
            view[i] = OTHER << 16;
    }
    if (view && columns)
        err = gpu_compare(g, &work, (const void *const[]){ view, columns }, (const size_t[]){ bytes, bytes },
                          SST_GPU_REFINE_COLUMNS_OUT, NULL);
    free(columns);
    free(view);
    return err;
}

int refine_columns_self_test(struct sst_gpu *g)
{
    const int err = test_bands(g, test_columns, 0);

    return err ? err : test_tall_columns(g);
}

static int test_compete(struct sst_gpu *g, struct test *t, struct band b)
{
    int err = 0;

    for (int i = 0; i < COMPETE && !err; i++) {
        const struct sst_gpu_refine_compete push = compete_push(i, b);
        const struct sst_gpu_work work = plane_work(SST_GPU_REFINE_COMPETE, &push);

        err = gpu_compare(g, &work, (const void *const[]){ t->mask, t->columns, t->hull, t->choice },
                          (const size_t[]){ sizeof(t->mask), sizeof(t->columns), sizeof(t->hull), sizeof(t->choice) },
                          SST_GPU_REFINE_COMPETE_CHOICE, t->choice);
    }
    return err;
}

int refine_compete_self_test(struct sst_gpu *g)
{
    return test_bands(g, test_compete, 2);
}

static int test_sums(struct sst_gpu *g, struct test *t, struct band b)
{
    const struct sst_gpu_refine_window push = window_push(b);
    const struct sst_gpu_work work = plane_work(SST_GPU_REFINE_SUMS, &push);

    return gpu_compare(g, &work, (const void *const[]){ t->view, t->sums },
                       (const size_t[]){ sizeof(t->view), sizeof(t->sums) }, SST_GPU_REFINE_SUMS_OUT, NULL);
}

int refine_sums_self_test(struct sst_gpu *g)
{
    return test_bands(g, test_sums, 0);
}

static int test_planes(struct sst_gpu *g, struct test *t, struct band b)
{
    const struct sst_gpu_refine_window push = window_push(b);
    const struct sst_gpu_work work = plane_work(SST_GPU_REFINE_PLANES, &push);

    return gpu_compare(g, &work, (const void *const[]){ t->sums, t->planes },
                       (const size_t[]){ sizeof(t->sums), sizeof(t->planes) }, SST_GPU_REFINE_PLANES_OUT, NULL);
}

int refine_planes_self_test(struct sst_gpu *g)
{
    return test_bands(g, test_planes, 4);
}

static int test_normals(struct sst_gpu *g, struct test *t, struct band b)
{
    const struct sst_gpu_refine_normals push = normals_push(b);
    const struct sst_gpu_work work = plane_work(SST_GPU_REFINE_NORMALS, &push);

    return gpu_compare(
        g, &work, (const void *const[]){ t->view, t->mask, t->planes, t->regions, t->normals },
        (const size_t[]){ sizeof(t->view), sizeof(t->mask), sizeof(t->planes), sizeof(t->regions), sizeof(t->normals) },
        SST_GPU_REFINE_NORMALS_OUT, NULL);
}

int refine_normals_self_test(struct sst_gpu *g)
{
    return test_bands(g, test_normals, 5);
}

static int test_assign(struct sst_gpu *g, struct test *t, struct band b)
{
    const struct sst_gpu_refine_assign push = { TEST_WIDTH, TEST_HEIGHT, 1, 10, 1, 1, b.top, b.rows };
    const struct sst_gpu_work work =
        work_of(SST_GPU_REFINE_ASSIGN, &push, gpu_groups(TEST_PITCH / 4, SST_GPU_REFINE_WIDTH),
                gpu_groups(TEST_HEIGHT, SST_GPU_REFINE_HEIGHT));

    return gpu_compare(g, &work, (const void *const[]){ t->view, t->mask, t->choice, t->normals, t->means, t->out },
                       (const size_t[]){ sizeof(t->view), sizeof(t->mask), sizeof(t->choice), sizeof(t->normals),
                                         sizeof(t->means), sizeof(t->out) },
                       SST_GPU_REFINE_ASSIGN_OUT, NULL);
}

int refine_assign_self_test(struct sst_gpu *g)
{
    return test_bands(g, test_assign, 6);
}
