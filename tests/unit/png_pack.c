/* PNG packing: the bytes of a file depend on its map alone. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "pipeline/image/image_internal.h"
#include "tests/test.h"

#define WIDTH  211
#define HEIGHT 97
#define PLACES ((size_t)8000)
#define STEP   ((size_t)1 << 16)
#define STACK  ((size_t)1 << 20)

/* Leave this number in the memory that the next calls have on their stack. */
__attribute__((noinline)) static void leave_behind(uint16_t number)
{
    volatile uint16_t stack[150000];

    for (size_t i = 0; i < ARRAY_LEN(stack); i++)
        stack[i] = number;
}

static void left_out(void)
{
    print_message("built without ISA-L: files of maps are libpng's\n");
    skip();
}

static void what_lies_in_memory_changes_nothing(void **state)
{
    static const uint8_t palette[256][3];
    static uint8_t labels[HEIGHT][WIDTH];
    const struct png_map map = {
        .data = labels, .stride = WIDTH, .width = WIDTH, .height = HEIGHT, .palette = palette
    };
    uint8_t *first = NULL;
    size_t size = 0;

    (void)state;
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++)
            labels[y][x] = (uint8_t)((x / 7 * 31 + y / 5 * 17) % 13);
    }
    for (uint16_t number = 0; number < 20; number++) {
        uint8_t *file;
        size_t bytes;

        leave_behind(number);
        if (!WITH_ISAL || !png_pack_map(&file, &bytes, &map)) {
            if (!WITH_ISAL)
                left_out();
            fail_msg("not packed");
        }
        if (first) {
            assert_int_equal(bytes, size);
            assert_memory_equal(file, first, size);
            free(file);
        } else {
            first = file;
            size = bytes;
        }
    }
    free(first);
}

struct packed {
    const struct png_map *map;
    uint8_t *file;
    size_t bytes;
};

static void *pack(void *arg)
{
    struct packed *p = arg;

    assert_true(WITH_ISAL && png_pack_map(&p->file, &p->bytes, p->map));
    return NULL;
}

/* In threads whose stacks lie 64 KiB apart, and with blocks of that size that are kept, so that the next ones lie
 * elsewhere. */
static void where_it_lies_changes_nothing(void **state)
{
    static uint8_t confidences[40][64];
    static void *kept[PLACES];
    const struct png_map map = { .data = confidences, .stride = 64, .width = 64, .height = 40 };
    uint8_t *stacks =
        mmap(NULL, PLACES * STEP + STACK, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    struct packed first = { &map, NULL, 0 };
    pthread_attr_t attr;
    size_t others = 0;

    (void)state;
    if (!WITH_ISAL)
        left_out();
    assert_ptr_not_equal(stacks, MAP_FAILED);
    for (int y = 0; y < 40; y++) {
        for (int x = 0; x < 64; x++)
            confidences[y][x] = (uint8_t)(x > 14 || y ? (x * x + 7 * y) / 9 % 90 : 0);
    }
    pack(&first);
    assert_int_equal(pthread_attr_init(&attr), 0);
    for (size_t i = 0; i < PLACES; i++) {
        struct packed next = { &map, NULL, 0 };
        pthread_t thread;

        kept[i] = malloc(STEP);
        assert_int_equal(pthread_attr_setstack(&attr, stacks + i * STEP, STACK), 0);
        assert_int_equal(pthread_create(&thread, &attr, pack, &next), 0);
        assert_int_equal(pthread_join(thread, NULL), 0);
        others += next.bytes != first.bytes || memcmp(next.file, first.file, first.bytes);
        free(next.file);
        if (i % 64 == 0)
            madvise(stacks, i * STEP, MADV_DONTNEED);
    }
    for (size_t i = 0; i < PLACES; i++)
        free(kept[i]);
    free(first.file);
    pthread_attr_destroy(&attr);
    munmap(stacks, PLACES * STEP + STACK);
    assert_int_equal(others, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(what_lies_in_memory_changes_nothing),
                                        cmocka_unit_test(where_it_lies_changes_nothing) };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
