/* pipeline/image/png_pack.c: the bytes of a file are those of its map alone. */
#include <stdlib.h>
#include <string.h>

#include "pipeline/image/image_internal.h"
#include "tests/test.h"

#define WIDTH  211
#define HEIGHT 97

/* Leave this number in the memory that the next calls have on their stack. */
__attribute__((noinline)) static void leave_behind(uint16_t number)
{
    volatile uint16_t stack[150000];

    for (size_t i = 0; i < ARRAY_LEN(stack); i++)
        stack[i] = number;
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
        if (!png_pack_map(&file, &bytes, &map)) {
            if (!WITH_ISAL)
                skip();
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

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(what_lies_in_memory_changes_nothing) };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
