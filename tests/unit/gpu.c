/* pipeline/gpu/ and pictures on a device, on the dummy device: choice, limits, faults, what ends on the CPU; the cache
 * of pipelines and verdicts. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/gpu/gpu_internal.h"
#include "tests/folder.h"
#include "tests/gpu_field.h"
#include "tests/render_tests.h"
#include "tests/small.h"

static void test_names(void **state)
{
    char text[SST_LOG_MAX];
    struct sst_gpu *g;

    (void)state;
    sst_log_hold_errors(text);
    assert_int_equal(sst_gpu_open(&g, "dummy:lost", NULL), -EINVAL);
    assert_contains(text, "`lost` is not a list");
    assert_int_equal(sst_gpu_open(&g, "dummy:lost=1,late=2", NULL), -EINVAL);
    assert_int_equal(sst_gpu_open(&g, "dummy:lost=0", NULL), -EINVAL);
    assert_int_equal(sst_gpu_open(&g, "no such device", NULL), -ENOENT);
    assert_contains(text, "no device `no such device`");
    sst_log_hold_errors(NULL);
    assert_int_equal(sst_gpu_open(&g, "dummy:lost=1,memory=4", NULL), 0);
    assert_int_equal(sst_gpu_get_info(g)->memory_bytes, 4 << 20);
    assert_int_equal(sst_gpu_free_bytes(g), 3 << 20);
    sst_gpu_close(g);
    sst_gpu_close(NULL);
}

static void test_memory(void **state)
{
    const struct sst_gpu_config cfg = { .memory_bytes = 1000 };
    struct sst_gpu_buffer *a, *b;
    uint8_t data[4] = { 1, 2, 3, 4 };
    struct sst_gpu *g;

    (void)state;
    assert_int_equal(sst_gpu_open(&g, "dummy:buffer=1", &cfg), 0);
    assert_int_equal(sst_gpu_buffer_create(g, &a, 600), 0);
    assert_int_equal(sst_gpu_buffer_create(g, &b, 401), -ENOMEM);
    assert_int_equal(sst_gpu_buffer_create(g, &b, 400), 0);
    assert_int_equal(sst_gpu_free_bytes(g), 0);
    sst_gpu_buffer_destroy(g, b);
    assert_int_equal(sst_gpu_free_bytes(g), 400);
    assert_int_equal(sst_gpu_upload(g, a, 596, data, 4), 0);
    memset(data, 0, sizeof(data));
    assert_int_equal(sst_gpu_download(g, data, a, 597, 2), 0);
    assert_int_equal(data[0], 2);
    assert_int_equal(data[1], 3);
    sst_gpu_buffer_destroy(g, a);
    sst_gpu_buffer_destroy(g, NULL);
    sst_gpu_close(g);
}

/* A device that is lost stays so. */
static void test_faults(void **state)
{
    const int faults[] = { -ENODEV, -ETIMEDOUT };
    struct sst_gpu_buffer *b;
    struct sst_gpu *g;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(faults); i++) {
        assert_int_equal(sst_gpu_open(&g, i ? "dummy:timeout=1" : "dummy:lost=1", NULL), 0);
        assert_int_equal(sst_gpu_prepare(g, SST_GPU_LIMITS), 0);
        assert_int_equal(sst_gpu_buffer_create(g, &b, 4), 0);
        for (int again = 0; again < 2; again++)
            assert_int_equal(sst_gpu_dispatch(g, &(struct sst_gpu_work){ .shader = SST_GPU_LIMITS, .buffer = { b, b } }),
                             faults[i]);
        sst_gpu_buffer_destroy(g, b);
        assert_int_equal(sst_gpu_buffer_create(g, &b, 4), faults[i]);
        assert_int_equal(sst_gpu_wait(g), faults[i]);
        sst_gpu_close(g);
    }
}

/* --- variants ----------------------------------------------------------------------------------------------------- */

/* The shader that is chosen. @param of  shader or variant of it @param named  SST_GPU_VARIANT; NULL: unset */
static int chosen_of(enum sst_gpu_shader of, const char *device, const char *named)
{
    enum sst_gpu_shader out = SST_GPU_SHADERS;
    struct sst_gpu *g;
    int err;

    if (named)
        setenv("SST_GPU_VARIANT", named, 1);
    else
        unsetenv("SST_GPU_VARIANT");
    assert_int_equal(sst_gpu_open(&g, device, NULL), 0);
    err = sst_gpu_prepare_fastest(g, of, &out);
    sst_gpu_close(g);
    unsetenv("SST_GPU_VARIANT");
    return err ? err : (int)out;
}

static int chosen(const char *device, const char *named)
{
    return chosen_of(SST_GPU_NET_CONV8, device, named);
}

static void test_variants(void **state)
{
    static const struct {
        const char *device, *named;
        enum sst_gpu_shader want;
    } cases[] = {
        { "dummy", NULL, SST_GPU_NET_CONV8 },
        { "dummy", "dot", SST_GPU_NET_CONV8 },
        { "dummy:dot=1", NULL, SST_GPU_NET_CONV8_DOT },
        { "dummy:dot=1", "plain", SST_GPU_NET_CONV8 },
        { "dummy:dot=1", "matrix", SST_GPU_NET_CONV8 },
        { "dummy:dot=2", NULL, SST_GPU_NET_CONV8 }, /* slow */
        { "dummy:dot=2", "dot", SST_GPU_NET_CONV8_DOT },
        { "dummy:matrix=1", NULL, SST_GPU_NET_CONV8_MATRIX },
        { "dummy:dot=1,matrix=2", NULL, SST_GPU_NET_CONV8_DOT }, /* matrices are slow */
        { "dummy:dot=1,matrix=2", "matrix", SST_GPU_NET_CONV8_MATRIX },
        { "dummy:dot=1,matrix=1", NULL, SST_GPU_NET_CONV8_MATRIX },
        { "dummy:dot=1,matrix=1", "", SST_GPU_NET_CONV8_MATRIX },
        { "dummy:dot=1,matrix=1", "dot", SST_GPU_NET_CONV8_DOT },
        { "dummy:dot=1,matrix=1", "plain", SST_GPU_NET_CONV8 },
        { "dummy:dot=1,matrix=1", "no such one", SST_GPU_NET_CONV8 },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        print_message("%s, %s\n", cases[i].device, cases[i].named ? cases[i].named : "nothing named");
        assert_int_equal(chosen(cases[i].device, cases[i].named), cases[i].want);
    }
}

/* What a device has no ability for is no fault; its results are not asked for. */
static void test_abilities(void **state)
{
    struct sst_gpu *g;

    (void)state;
    assert_false(sst_gpu_is_variant(SST_GPU_NET_CONV8));
    assert_true(sst_gpu_is_variant(SST_GPU_NET_CONV8_DOT));
    assert_true(sst_gpu_is_variant(SST_GPU_NET_CONV8_MATRIX));
    assert_int_equal(sst_gpu_open(&g, "dummy:dot=1", NULL), 0);
    assert_true(sst_gpu_can(sst_gpu_get_info(g), SST_GPU_BLEND));
    assert_true(sst_gpu_can(sst_gpu_get_info(g), SST_GPU_NET_CONV8_DOT));
    assert_true(sst_gpu_is_fast(sst_gpu_get_info(g), SST_GPU_NET_CONV8_DOT));
    assert_false(sst_gpu_is_fast(sst_gpu_get_info(g), SST_GPU_NET_CONV8_MATRIX));
    assert_false(sst_gpu_is_fast(sst_gpu_get_info(g), SST_GPU_NET_CONV8));
    assert_false(sst_gpu_can(sst_gpu_get_info(g), SST_GPU_NET_CONV8_MATRIX));
    assert_int_equal(sst_gpu_prepare(g, SST_GPU_NET_CONV8_MATRIX), -ENOTSUP);
    assert_int_equal(sst_gpu_prepare(g, SST_GPU_NET_CONV8_DOT), 0);
    sst_gpu_close(g);
}

static void test_variants_of_matching(void **state)
{
    static const struct {
        const char *device, *named;
        enum sst_gpu_shader of, want;
    } cases[] = {
        { "dummy", NULL, SST_GPU_SGM_PATH, SST_GPU_SGM_PATH },
        { "dummy:subgroup=1", NULL, SST_GPU_SGM_PATH, SST_GPU_SGM_PATH_SUBGROUP },
        { "dummy:subgroup=1", "plain", SST_GPU_SGM_PATH, SST_GPU_SGM_PATH },
        { "dummy:subgroup=1", "dot", SST_GPU_SGM_PATH, SST_GPU_SGM_PATH },
        { "dummy:subgroup=1", NULL, SST_GPU_HYPOTHESIS_PATH, SST_GPU_HYPOTHESIS_PATH_SUBGROUP },
        { "dummy:subgroup=1", NULL, SST_GPU_FEATURE_COST, SST_GPU_FEATURE_COST },
        { "dummy:dot=1", NULL, SST_GPU_FEATURE_COST, SST_GPU_FEATURE_COST_DOT },
        { "dummy:dot=2", NULL, SST_GPU_FEATURE_COST, SST_GPU_FEATURE_COST },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        print_message("%s, %s\n", cases[i].device, cases[i].named ? cases[i].named : "nothing named");
        assert_int_equal(chosen_of(cases[i].of, cases[i].device, cases[i].named), cases[i].want);
    }
}

#if WITH_VULKAN
/* The binary of net_conv8_matrix, in words. */
static uint32_t *matrix_module(size_t *words)
{
    const struct gpu_spirv *s = gpu_spirvs;
    uint32_t *copy;

    while (strcmp(s->name, "net_conv8_matrix.spv"))
        s++;
    *words = (size_t)(s->end - s->begin) / sizeof(*copy);
    copy = malloc(*words * sizeof(*copy));
    assert_non_null(copy);
    memcpy(copy, s->begin, *words * sizeof(*copy));
    return copy;
}

/* The instruction that declares an id before `end`, of those that types of matrices refer to. */
static const uint32_t *declared(const uint32_t *code, size_t end, uint32_t id)
{
    for (size_t at = 5; at < end; at += code[at] >> 16) {
        const uint32_t op = code[at] & 0xFFFF;

        if ((op == 21 && code[at + 1] == id) || ((op == 43 || op == 50) && code[at + 2] == id))
            return code + at;
    }
    fail_msg("id %u is not declared", id);
    return NULL;
}

/* Types of matrices refer to a type of integers and to constants that stand in front of them. */
static void test_matrix_types(void **state)
{
    size_t words, types = 0;
    uint32_t *code = matrix_module(&words);

    (void)state;
    assert_int_equal(gpu_matrix_complete(code, words), 0);
    for (size_t at = 5; at < words; at += code[at] >> 16) {
        const uint32_t *operand = code + at + 1, *component;

        if ((code[at] & 0xFFFF) != 4456)
            continue;
        component = declared(code, at, operand[1]);
        assert_int_equal(component[0] & 0xFFFF, 21);
        assert_int_equal(component[3], 1); /* signed */
        for (int i = 2; i < 6; i++)
            assert_int_not_equal(declared(code, at, operand[i])[0] & 0xFFFF, 21);
        types |= (size_t)component[2] << (8 * declared(code, at, operand[5])[3]); /* bits, by use */
    }
    assert_int_equal(types, 8 | 8 << 8 | 32 << 16);
    assert_int_equal(gpu_matrix_complete(code, words), -EINVAL); /* it is complete */
    free(code);
}

static void test_damaged_modules(void **state)
{
    size_t words;
    uint32_t *code = matrix_module(&words), *copy = malloc(words * sizeof(*copy));

    (void)state;
    assert_int_equal(gpu_matrix_complete(code, 0), -EINVAL);
    assert_int_equal(gpu_matrix_complete(code, 5), -EINVAL);
    for (size_t at = 5; at < words; at += code[at] >> 16) {
        memcpy(copy, code, words * sizeof(*copy));
        if (code[at] >> 16 > 1) /* cut within an instruction */
            assert_int_equal(gpu_matrix_complete(copy, at + (code[at] >> 16) - 1), -EINVAL);
        copy[at] &= 0xFFFF;
        assert_int_equal(gpu_matrix_complete(copy, words), -EINVAL);
    }
    code[0]++;
    assert_int_equal(gpu_matrix_complete(code, words), -EINVAL);
    free(copy);
    free(code);
}

static void test_shapes(void **state)
{
    static const struct {
        struct sst_gpu_matrix shape;
        uint32_t invocations;
    } cases[] = {
        { { 16, 16, 32, 32 }, 128 }, { { 16, 16, 16, 64 }, 256 }, { { 8, 16, 32, 16 }, 128 },
        { { 8, 8, 32, 32 }, 512 },   { { 8, 8, 16, 8 }, 128 },    { { 8, 8, 16, 64 }, 1024 },
        { { 32, 8, 16, 32 }, 128 },  { { 16, 16, 64, 32 }, 128 }, { { 32, 32, 32, 32 }, 0 },
        { { 16, 16, 32, 8 }, 0 },    { { 8, 8, 8, 64 }, 0 },      { { 16, 16, 128, 32 }, 0 },
        { { 12, 16, 16, 32 }, 0 },   { { 16, 16, 6, 32 }, 0 },    { { 8, 2, 32, 8 }, 0 },
        { { 4, 4, 4, 64 }, 0 },      { { 0, 16, 16, 32 }, 0 },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++)
        assert_int_equal(gpu_matrix_invocations(&cases[i].shape), cases[i].invocations);
}
#endif

/* --- pictures ----------------------------------------------------------------------------------------------------- */

#define ROOM "a device needs room for the rays that it verifies: raise --device-memory, or use fewer or smaller views"
#define CRAMPED                                                                                                        \
    "what the maps explain needs room for some rows of all views, and its tables: raise --device-memory, "             \
    "or use fewer or smaller views"

/* Render the pictures from .. to - 1 on a device. @return how many were made there without a failure; -1: it is not
 * opened */
static int render_some(const char *device, int from, int to)
{
    struct sst_render_device_report report;
    struct sst_renderer *r;
    struct sst_lightfield lf;
    int err;

    field_init(&lf);
    assert_int_equal(sst_renderer_create(&r, &lf, 2), 0);
    err = sst_renderer_use_device(r, device, 0);
    for (int i = from; i < to && !err; i++) {
        struct field_picture p;

        field_render(&p, r, i);
        field_free(&p);
    }
    if (!err)
        assert_true(sst_renderer_device(r, &report));
    sst_renderer_destroy(r);
    field_fini(&lf);
    return err ? -1 : report.failures ? 0 : (int)report.pictures;
}

/* Pictures without verification. */
static bool blends(const char *name)
{
    return render_some(name, 0, 7) == 7;
}

static bool verifies(const char *name)
{
    return render_some(name, 7, 8) == 1;
}

/* All but clear ones. */
static bool sums(const char *name)
{
    return render_some(name, 0, FIELD_PICTURES - FIELD_CLEAR) == FIELD_PICTURES - FIELD_CLEAR;
}

/* Whatever fits on the device at once: the same bytes. */
static void test_pictures(void **state)
{
    static const struct {
        const char *name;
        uint64_t memory;
        int chunks, uploads; /* 0: any number */
        int in_parts;        /* clear pictures that are not there at once */
        int verified_on_cpu;
        const char *why_verified;
    } devices[] = {
        /* once, and once more with confidences */
        { "dummy", 0, 1, 16, 0, 0, "" },
        { "dummy:buffer=400", 0, 2, 0, FIELD_CLEAR, 0, "" }, /* several chunks, and bands of the picture */
        { "dummy:buffer=250", 0, 2, 0, FIELD_CLEAR, 0, "" },
        { "dummy:buffer=100", 0, 8, 16, 0, 1, CRAMPED },             /* one view each, and no part of a clear picture */
        { "dummy:memory=1", 0, 0, 0, FIELD_CLEAR, 1, CRAMPED },      /* views are replaced */
        { "dummy", (uint64_t)400 << 10, 0, 0, FIELD_CLEAR, 3, ROOM } /* one at a time, by the configuration */
    };
    struct sst_render_device_report report;
    struct sst_lightfield lf;

    (void)state;
    field_init(&lf);
    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        print_message("%s, %d KiB\n", devices[i].name, (int)(devices[i].memory >> 10));
        assert_int_equal(field_compare(&lf, devices[i].name, devices[i].memory, &report), 0);
        assert_int_equal(report.pictures, FIELD_PICTURES - report.on_cpu);
        assert_int_equal(report.in_parts, devices[i].in_parts);
        assert_int_equal(report.on_cpu, i && !devices[i].in_parts ? FIELD_CLEAR : 0);
        assert_int_equal(report.failures, 0);
        assert_int_equal(report.verified_on_cpu, devices[i].verified_on_cpu);
        assert_string_equal(report.why_verified, devices[i].why_verified);
        assert_string_equal(report.why,
                            report.on_cpu ? "not enough memory on the device for a part of a clear picture" : "");
        if (devices[i].chunks)
            assert_in_range(report.chunks, devices[i].chunks, 8);
        if (devices[i].uploads)
            assert_int_equal(report.uploads, devices[i].uploads);
        else
            assert_true(report.uploads > 24);
    }
    field_fini(&lf);
}

/* What a device fails at ends on the CPU with the same picture; then it is opened again. */
static void test_fallback(void **state)
{
    const int tests = render_tests();
    const struct {
        const char *fault;
        int at;
        const char *why;
        int pictures, failures;
    } devices[] = {
        { "lost", tests + 1, "the device is lost", 0, 4 },            /* always at the first picture: 0, 1, 3, 7 */
        { "timeout", tests + 3, "the device does not answer", 6, 6 }, /* every third, and in the test of verification */
        { "buffer", 55, "not enough memory on the device", 0, 4 },    /* not one view */
    };
    struct sst_render_device_report report;
    struct sst_lightfield lf;

    (void)state;
    field_init(&lf);
    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        char name[32];

        snprintf(name, sizeof(name), "dummy:%s=%d", devices[i].fault, devices[i].at);
        print_message("%s\n", name);
        assert_int_equal(field_compare(&lf, name, 0, &report), 0);
        assert_int_equal(report.pictures, devices[i].pictures);
        assert_int_equal(report.on_cpu, FIELD_PICTURES - devices[i].pictures);
        assert_int_equal(report.failures, devices[i].failures);
        assert_string_equal(report.why, devices[i].why);
    }
    field_fini(&lf);
}

/* A shader that is refused, and names that find no device. */
static void test_refused(void **state)
{
    char text[SST_LOG_MAX];
    struct sst_render_device_report report;
    struct sst_renderer *r;
    struct sst_lightfield lf;

    (void)state;
    field_init(&lf);
    assert_int_equal(sst_renderer_create(&r, &lf, 1), 0);
    sst_log_hold_errors(text);
    assert_int_equal(sst_renderer_use_device(r, "dummy:wrong=5", 0), -ENOTSUP);
    assert_int_equal(sst_renderer_use_device(r, "no such device", 0), -ENOENT);
    sst_log_hold_errors(NULL);
    assert_false(sst_renderer_device(r, &report));
    assert_int_equal(sst_renderer_use_device(r, "cpu", 0), 0);
    assert_false(sst_renderer_device(r, &report));
    sst_renderer_destroy(r);
    field_fini(&lf);
}

/* Where a shader of the clear picture is refused, that picture is the CPU's; the others are not. */
static void test_clear_refused(void **state)
{
    struct sst_render_device_report report;
    struct sst_lightfield lf;
    char name[32];

    (void)state;
    snprintf(name, sizeof(name), "dummy:wrong=%d", self_tests(sums) + 1);
    field_init(&lf);
    assert_int_equal(field_compare(&lf, name, 0, &report), 0);
    assert_int_equal(report.pictures, FIELD_PICTURES - FIELD_CLEAR);
    assert_int_equal(report.on_cpu, FIELD_CLEAR);
    assert_int_equal(report.failures, 0);
    assert_string_equal(report.why, "a shader is refused");
    field_fini(&lf);
}

/* Where the verification of rays is refused, it is the CPU's; the pictures are not. */
static void test_verify_refused(void **state)
{
    struct sst_render_device_report report;
    struct sst_lightfield lf;
    char name[32];

    (void)state;
    snprintf(name, sizeof(name), "dummy:wrong=%d", self_tests(blends) + 1);
    field_init(&lf);
    assert_int_equal(field_compare(&lf, name, 0, &report), 0);
    assert_int_equal(report.on_cpu, 0);
    assert_int_equal(report.failures, 0);
    assert_int_equal(report.verified_on_cpu, 3);
    assert_string_equal(report.why_verified, "a shader is refused");
    field_fini(&lf);
}

/* A device that is lost while it verifies rays: the picture is the CPU's. */
static void test_verify_lost(void **state)
{
    const int last = self_tests(verifies);
    struct sst_render_device_report report;
    struct sst_renderer *cpu, *gpu;
    struct sst_lightfield lf;

    (void)state;
    field_init(&lf);
    assert_int_equal(sst_renderer_create(&cpu, &lf, 2), 0);
    for (int i = 0; i < 6; i++) {
        struct field_picture want, got;
        char name[32];

        snprintf(name, sizeof(name), "dummy:%s=%d", i % 2 ? "lost" : "timeout", last - i);
        print_message("%s\n", name);
        assert_int_equal(sst_renderer_create(&gpu, &lf, 2), 0);
        assert_int_equal(sst_renderer_use_device(gpu, name, 0), 0);
        field_render(&want, cpu, 7);
        field_render(&got, gpu, 7);
        assert_int_equal(field_difference(&want, &got), 0);
        assert_true(sst_renderer_device(gpu, &report));
        assert_int_equal(report.on_cpu, 1);
        assert_int_equal(report.failures, 1);
        assert_string_equal(report.why, i % 2 ? "the device is lost" : "the device does not answer");
        field_free(&want);
        field_free(&got);
        sst_renderer_destroy(gpu);
    }
    sst_renderer_destroy(cpu);
    field_fini(&lf);
}

/* --- cache -------------------------------------------------------------------------------------------------------- */

static int count_files(const char *folder)
{
    DIR *d = opendir(folder);
    int n = 0;

    for (struct dirent *e; d && (e = readdir(d));)
        n += e->d_name[0] != '.';
    if (d)
        closedir(d);
    return n;
}

static void assert_cached(uint64_t key, const char *want)
{
    size_t bytes = 0;
    char *data = gpu_cache_read("pipelines", key, &bytes);

    if (!want) {
        assert_null(data);
        return;
    }
    assert_non_null(data);
    assert_int_equal(bytes, strlen(want));
    assert_memory_equal(data, want, bytes);
    free(data);
}

/* Write one byte of a file, or shorten the file to `at` bytes. */
static void damage(const char *path, long at, bool shorten)
{
    FILE *f = fopen(path, "r+b");

    int byte;

    assert_non_null(f);
    assert_int_equal(fseek(f, at, SEEK_SET), 0);
    byte = fgetc(f);
    assert_int_equal(fseek(f, at, SEEK_SET), 0);
    if (shorten)
        assert_int_equal(ftruncate(fileno(f), at), 0);
    else
        assert_int_equal(fputc(byte ^ 1, f), byte ^ 1);
    assert_int_equal(fclose(f), 0);
}

static void test_cache(void **state)
{
    const char *path = test_path("sst/pipelines-0000000000000007.bin"), *below = test_path("sst");
    uint8_t *large = calloc(1, GPU_CACHE_BYTES_MAX + 1);

    (void)state;
    setenv("XDG_CACHE_HOME", test_folder, 1);
    assert_cached(7, NULL);
    gpu_cache_write("pipelines", 7, "compiled", 8);
    assert_cached(7, "compiled");
    assert_cached(8, NULL);
    for (long at = 0; at < 40; at += 13) { /* magic, key, size or data */
        gpu_cache_write("pipelines", 7, "compiled", 8);
        damage(path, at, false);
        assert_cached(7, NULL);
        assert_false(sst_path_exists(path));
        gpu_cache_write("pipelines", 7, "compiled", 8);
        damage(path, at, true);
        assert_cached(7, NULL);
    }
    for (uint64_t key = 1; key <= GPU_CACHE_FILES + 3; key++)
        gpu_cache_write("pipelines", key, "x", 1);
    assert_int_equal(count_files(below), GPU_CACHE_FILES);
    assert_cached(GPU_CACHE_FILES + 3, "x");
    gpu_cache_write("pipelines", 99, large, GPU_CACHE_BYTES_MAX + 1);
    assert_cached(99, NULL);
    free(large);
}

/* A device with verdicts, as a back end opens it. */
static struct sst_gpu *open_known(bool test_again)
{
    struct sst_gpu *g;

    assert_int_equal(sst_gpu_open(&g, "dummy", &(struct sst_gpu_config){ .test_again = test_again }), 0);
    g->cache_key = 7;
    gpu_verdicts_open(g);
    return g;
}

static void assert_passed(const char *test, bool want)
{
    struct sst_gpu *g = open_known(false);

    assert_int_equal(sst_gpu_has_passed(g, test), want);
    sst_gpu_close(g);
}

static void note(const char *test, bool passed, bool again, int lost)
{
    struct sst_gpu *g = open_known(again);

    assert_true(!again || !sst_gpu_has_passed(g, test));
    sst_gpu_note_verdict(g, test, passed);
    g->lost = lost;
    sst_gpu_close(g);
}

/* Passes are kept for the same program, CPU and device; refusals are not, and a failure ends a pass. */
static void test_verdicts(void **state)
{
    struct sst_gpu *g, *other;
    char path[SST_PATH_MAX];

    (void)state;
    setenv("XDG_CACHE_HOME", test_folder, 1);
    g = open_known(false);
    snprintf(path, sizeof(path), "%s/verdicts-%016llx.bin", test_path("sst"), (unsigned long long)g->verdicts.key);
    sst_gpu_close(g);
    assert_false(sst_path_exists(path)); /* nothing new */
    note("step carrying", false, false, 0);
    assert_passed("step carrying", false);
    note("step carrying", true, false, 0);
    assert_passed("step carrying", true);
    assert_passed("step carry", false);
    assert_passed("carrying", false);
    note("blend", true, false, -ENODEV); /* of a device that is lost */
    assert_passed("blend", false);
    /* two at once keep the passes of both */
    g = open_known(false);
    other = open_known(false);
    sst_gpu_note_verdict(g, "blend", true);
    sst_gpu_note_verdict(other, "check", true);
    sst_gpu_close(g);
    sst_gpu_close(other);
    assert_passed("blend", true);
    assert_passed("check", true);
    /* tested again */
    note("blend", false, true, 0);
    assert_passed("blend", false);
    assert_passed("check", true);
    /* with other results of the CPU */
    setenv("ONEDNN_MAX_CPU_ISA", "SSE41", 1);
    assert_passed("check", false);
    unsetenv("ONEDNN_MAX_CPU_ISA");
    assert_passed("check", true);
    damage(path, 20, true);
    assert_passed("check", false);
    assert_false(sst_path_exists(path));
    /* the dummy device by itself */
    assert_int_equal(sst_gpu_open(&g, "dummy", NULL), 0);
    sst_gpu_note_verdict(g, "blend", true);
    assert_false(sst_gpu_has_passed(g, "blend"));
    sst_gpu_close(g);
}

/* Without a folder nothing is kept, and nothing fails. */
static void test_no_cache(void **state)
{
    (void)state;
    setenv("XDG_CACHE_HOME", "/proc/no such folder", 1);
    gpu_cache_write("pipelines", 7, "compiled", 8);
    assert_cached(7, NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_names),
        cmocka_unit_test(test_memory),
        serial_test(test_faults),
        cmocka_unit_test(test_variants),
        cmocka_unit_test(test_variants_of_matching),
        cmocka_unit_test(test_abilities),
#if WITH_VULKAN
        cmocka_unit_test(test_matrix_types),
        cmocka_unit_test(test_damaged_modules),
        cmocka_unit_test(test_shapes),
#endif
        serial_test(test_pictures),
        cmocka_unit_test(test_fallback),
        cmocka_unit_test(test_refused),
        serial_test(test_clear_refused),
        serial_test(test_verify_refused),
        serial_test(test_verify_lost),
        cmocka_unit_test_setup_teardown(test_cache, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(test_verdicts, test_folder_create, test_folder_remove),
        cmocka_unit_test(test_no_cache),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
