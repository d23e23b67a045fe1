/* sha256: published values, an independent library at every length around the blocks, every level. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <sha2.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "pipeline/kernels/sha256.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

/* FIPS 180-2, appendix B. */
static void published_values(void **state SST_UNUSED)
{
    char hash[SST_SHA256_HEX];

    sst_sha256_hex(hash, "abc", 3);
    assert_string_equal(hash, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    sst_sha256_hex(hash, "", 0);
    assert_string_equal(hash, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    sst_sha256_hex(hash, "abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", 56);
    assert_string_equal(hash, "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

static void lengths_equal_the_library(void **state SST_UNUSED)
{
    uint64_t seed = 7;

    for (size_t n = 1; n < 300; n++) {
        uint8_t *data = guard_random(n, &seed);
        char got[SST_SHA256_HEX], want[SHA256_DIGEST_STRING_LENGTH];

        sst_sha256_hex(got, data, n);
        assert_string_equal(got, SHA256Data(data, n, want));
        guard_free_all();
    }
}

static void levels_equal_the_reference(void **state SST_UNUSED)
{
    uint64_t seed = 8;

    for (int level = 0; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k))
            continue;
        for (size_t blocks = 0; blocks < 5; blocks++) {
            uint8_t *data = guard_random(64 * blocks + !blocks, &seed);
            uint32_t *got = guard_random(8 * sizeof(*got), &seed), want[8];

            memcpy(want, got, sizeof(want));
            sst_sha256_blocks_ref(want, data, blocks);
            k.sha256_blocks(got, data, blocks);
            assert_memory_equal(got, want, sizeof(want));
            guard_free_all();
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(published_values),
        cmocka_unit_test(lengths_equal_the_library),
        cmocka_unit_test(levels_equal_the_reference),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
