/* tests/fuzz/seeds.h - valid seed inputs: without them a fuzzer rarely gets past the first check.
 */
#ifndef SST_TESTS_FUZZ_SEEDS_H
#define SST_TESTS_FUZZ_SEEDS_H

#include <stdio.h>

#include "base/base.h"

/* Called once by libFuzzer before the corpus is read. */
int LLVMFuzzerInitialize(int *argc, char ***argv);

/** Write a seed into the corpus that `make fuzz` made for a target; without such a folder nothing happens. */
static inline void seed_write(const char *target, int i, const void *data, size_t n)
{
    char path[256];
    FILE *f;

    snprintf(path, sizeof(path), "build/fuzz/corpus-%s/seed-%d", target, i);
    f = fopen(path, "wb");
    if (!f)
        return;
    if (fwrite(data, 1, n, f) != n)
        fprintf(stderr, "%s: cannot be written\n", path);
    fclose(f);
}

#endif
