/* tests/fuzz/seeds.h - valid seed inputs, without which a fuzzer rarely gets past the first check; inputs as files, or
 * split into messages. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_FUZZ_SEEDS_H
#define SST_TESTS_FUZZ_SEEDS_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/base.h"

/* Called once before the corpus is read. */
int LLVMFuzzerInitialize(int *argc, char ***argv);

/** Write a seed into the corpus, the folder FUZZ_CORPUS; without it nothing happens. */
static inline void seed_write(const char *target SST_UNUSED, int i, const void *data, size_t n)
{
    const char *folder = getenv("FUZZ_CORPUS");
    char path[256];
    FILE *f;

    if (!folder)
        return;
    snprintf(path, sizeof(path), "%s/seed-%d", folder, i);
    f = fopen(path, "wb");
    if (!f)
        return;
    if (fwrite(data, 1, n, f) != n)
        fprintf(stderr, "%s: cannot be written\n", path);
    fclose(f);
}

/** A folder or file in memory: a disk would have a thousand inputs a second at most. @return mkdtemp()'s argument */
static inline char *input_template(void)
{
    static char name[40];

    snprintf(name, sizeof(name), "%s/sst-fuzz-XXXXXX", access("/dev/shm", W_OK) ? "/tmp" : "/dev/shm");
    return name;
}

/** Inputs of readers that want a path: a file without a name. @return its path, the same every time */
static inline const char *input_file(const uint8_t *data, size_t size)
{
    static char path[32];
    static int fd = -1;

    if (fd < 0) {
        char *name = input_template();

        fd = mkstemp(name);
        (void)unlink(name);
        snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
    }
    if (fd < 0 || ftruncate(fd, 0) || pwrite(fd, data, size, 0) != (ssize_t)size)
        abort();
    return path;
}

/* One of several messages in an input. */
struct input_message {
    int kind;      /* 0..3 */
    uint8_t *data; /* from the heap, so that the address sanitizer sees a byte too many */
    size_t bytes;
};

/** Write a message: kind and length in two bytes, then itself. @return bytes written */
static inline size_t input_put_message(uint8_t *out, int kind, const void *data, size_t bytes)
{
    out[0] = (uint8_t)(kind | (int)(bytes >> 8) << 2);
    out[1] = (uint8_t)bytes;
    memcpy(out + 2, data, bytes);
    return bytes + 2;
}

/** Cut the next message off; the last one ends with the input. @param m  in: zeroed, or the one before, which is freed
 *  @return false: there is none */
static inline bool input_next_message(struct input_message *m, const uint8_t **data, size_t *size)
{
    free(m->data);
    if (*size < 2)
        return false;
    m->kind = (*data)[0] % 4;
    m->bytes = (size_t)((*data)[0] >> 2) << 8 | (*data)[1];
    m->bytes = m->bytes < *size - 2 ? m->bytes : *size - 2;
    m->data = malloc(m->bytes ? m->bytes : 1);
    if (!m->data)
        abort();
    memcpy(m->data, *data + 2, m->bytes);
    *data += 2 + m->bytes;
    *size -= 2 + m->bytes;
    return true;
}

#endif
