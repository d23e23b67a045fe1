/* pipeline/image: maps as PNG, whose compressed bytes zlib and libpng must take. */
#include <stdlib.h>
#include <string.h>

#include <png.h>

#include "base/file.h"
#include "pipeline/image/classes.h"
#include "pipeline/image/codec.h"
#include "tests/folder.h"
#include "tests/random.h"
#include "tests/test.h"

/* The file's samples by libpng, 16 bits big-endian. */
static void read_by_libpng(uint8_t *out, const char *path, int bit_depth, int color_type)
{
    FILE *f = fopen(path, "rb");
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);

    assert_non_null(f);
    if (setjmp(png_jmpbuf(png)))
        fail_msg("libpng refuses %s", path);
    png_init_io(png, f);
    png_set_crc_action(png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
    png_read_info(png, info);
    assert_int_equal(png_get_bit_depth(png, info), bit_depth);
    assert_int_equal(png_get_color_type(png, info), color_type);
    for (unsigned y = 0; y < png_get_image_height(png, info); y++)
        png_read_row(png, out + y * png_get_rowbytes(png, info), NULL);
    png_read_end(png, NULL);
    png_destroy_read_struct(&png, &info, NULL);
    fclose(f);
}

static void check_u8(const struct sst_map_u8 *map, const uint8_t (*palette)[3])
{
    const char *path = test_path("map.png");
    uint8_t *read = malloc((size_t)map->width * (size_t)map->height);
    struct sst_map_u8 back = { 0 };

    assert_int_equal(sst_map_u8_write_png(map, path, palette), 0);
    read_by_libpng(read, path, 8, palette ? PNG_COLOR_TYPE_PALETTE : PNG_COLOR_TYPE_GRAY);
    assert_int_equal(sst_map_u8_read_png(&back, path), 0);
    for (int y = 0; y < map->height; y++) {
        assert_memory_equal(read + (size_t)y * (size_t)map->width, sst_map_u8_row(map, y), (size_t)map->width);
        assert_memory_equal(sst_map_u8_row(&back, y), sst_map_u8_row(map, y), (size_t)map->width);
    }
    sst_map_u8_fini(&back);
    free(read);
}

static void check_u16(const struct sst_map_u16 *map)
{
    const char *path = test_path("map.png");
    uint8_t *read = malloc((size_t)map->width * (size_t)map->height * 2);
    struct sst_map_u16 back = { 0 };

    assert_int_equal(sst_map_u16_write_png(map, path), 0);
    read_by_libpng(read, path, 16, PNG_COLOR_TYPE_GRAY);
    assert_int_equal(sst_map_u16_read_png(&back, path), 0);
    for (int y = 0; y < map->height; y++) {
        const uint8_t *row = read + (size_t)y * (size_t)map->width * 2;

        assert_memory_equal(sst_map_u16_row(&back, y), sst_map_u16_row(map, y), (size_t)map->width * 2);
        for (int x = 0; x < map->width; x++)
            assert_int_equal(row[2 * x] << 8 | row[2 * x + 1], sst_map_u16_row(map, y)[x]);
    }
    sst_map_u16_fini(&back);
    free(read);
}

/* Runs of every length around those that a symbol has, of few values or many. */
static void runs_of_all_lengths_come_back(void **state SST_UNUSED)
{
    static const int values[] = { 1, 2, 3, 256 };
    uint64_t seed = 1;

    for (size_t i = 0; i < ARRAY_LEN(values); i++) {
        for (int width = 1; width < 700; width += width < 20 ? 1 : 97) {
            struct sst_map_u8 map;
            struct sst_map_u16 deep;
            int left = 0, value = 0;

            assert_int_equal(sst_map_u8_init(&map, width, 300), 0);
            assert_int_equal(sst_map_u16_init(&deep, width, 300), 0);
            for (int y = 0, most = 1; y < map.height; y++) {
                for (int x = 0; x < width; x++) {
                    if (!left--) {
                        left = (int)(sst_random(&seed) * most);
                        most = most % 600 + 1;
                        value = (int)(sst_random(&seed) * values[i]);
                    }
                    sst_map_u8_row(&map, y)[x] = (uint8_t)value;
                    sst_map_u16_row(&deep, y)[x] = (uint16_t)(value * 257 + y / 7);
                }
            }
            check_u8(&map, NULL);
            check_u8(&map, sst_classes_palette());
            check_u16(&deep);
            sst_map_u8_fini(&map);
            sst_map_u16_fini(&deep);
        }
    }
}

/* Counts that grow like Fibonacci's numbers make the longest words; several blocks. */
static void words_are_never_too_long(void **state SST_UNUSED)
{
    struct sst_map_u8 map;
    int value = 0, more = 1, last = 1, left = 1;

    assert_int_equal(sst_map_u8_init(&map, 1999, 251), 0);
    for (int y = 0; y < map.height; y++) {
        for (int x = 0; x < map.width; x++) {
            sst_map_u8_row(&map, y)[x] = x % 2 ? (uint8_t)value : (uint8_t)(255 - x % 4); /* no runs */
            if (x % 2 && !--left) {
                const int sum = more + last;

                last = more;
                more = sum < 40000 ? sum : 1;
                left = more;
                value = (value + 1) % 200;
            }
        }
    }
    check_u8(&map, sst_classes_palette());
    check_u8(&map, NULL);
    sst_map_u8_fini(&map);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(runs_of_all_lengths_come_back),
        cmocka_unit_test(words_are_never_too_long),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
