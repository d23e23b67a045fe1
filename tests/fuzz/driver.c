/* Runs a fuzz target without libFuzzer: first its seeds and tests/fuzz/corpus/NAME, then mutations of these for
 * FUZZ_SECONDS (20). Coverage is not measured, so that the objects of the sanitized tests serve here, too; `make fuzz`
 * has libFuzzer. An input that crashes, leaks, hangs or allocates too much is kept as build/fuzz/NAME-found.
 *
 *   tests/fuzz/NAME [FILE...]     the files alone, to repeat what was found
 *   FUZZ_SEED                     of the mutations; the clock by default */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* program_invocation_short_name */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <sanitizer/lsan_interface.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "simulators/scene/noise.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
/* In every sanitizer, but not in gcc's headers. */
int __sanitizer_install_malloc_and_free_hooks(void (*on_malloc)(const volatile void *, size_t),
                                              void (*on_free)(const volatile void *));
/* A target whose seeds are files alone has none. */
__attribute__((weak)) int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    return 0;
}

#define INPUT_MAX    65536
#define ALLOC_MAX    ((size_t)512 << 20) /* of one allocation */
#define TICK_S       5                   /* of processor time */
#define HANG_TICKS   6
#define INPUTS_MAX   4096
#define MUTATIONS    8
#define GROWTH_MAX   256
#define MESSAGES_MAX 16384
#define HEX_MAX      4096

static struct input {
    uint8_t *data;
    size_t size;
} pool[INPUTS_MAX];
static int pooled;
static uint64_t random_state;

/* Shared with the parent, which tells what the child died of. */
static struct {
    uint8_t data[INPUT_MAX];
    size_t size;
    uint64_t runs;
    bool busy; /* in the target */
} * state;
static int messages; /* file: standard error of the child */
static uint64_t ticked;
static int ticks;
static _Atomic int mallocs, frees;

/* --- the child ---------------------------------------------------------------------------------------------------- */

static void fail(const char *why)
{
    dprintf(STDERR_FILENO, "FAIL: %s\n", why);
    _exit(1);
}

static void on_tick(int signal SST_UNUSED)
{
    if (!state->busy || state->runs != ticked)
        ticks = 0;
    else if (++ticks == HANG_TICKS)
        fail("half a minute of processor time for one input");
    ticked = state->runs;
}

static void on_malloc(const volatile void *p SST_UNUSED, size_t bytes)
{
    if (state->busy && bytes > ALLOC_MAX)
        fail("more than 512 MB in one allocation");
    mallocs++;
}

static void on_free(const volatile void *p)
{
    frees += p != NULL;
}

static void run(const uint8_t *data, size_t size)
{
    /* Of its own size: an access beyond it is found. */
    uint8_t *copy = malloc(size ? size : 1);
    int before;

    if (!copy)
        fail("no memory");
    memcpy(copy, data, size);
    memcpy(state->data, data, size);
    state->size = size;
    before = mallocs - frees;
    state->busy = true;
    LLVMFuzzerTestOneInput(copy, size);
    if (mallocs - frees > before && __lsan_do_recoverable_leak_check()) /* or a library keeps it */
        fail("a leak");
    state->busy = false;
    free(copy);
    if (!(++state->runs % 1024) && ftruncate(messages, 0))
        fail("messages cannot be dropped");
}

/* --- inputs ------------------------------------------------------------------------------------------------------- */

static int pool_file(const char *path)
{
    uint8_t *data;
    size_t size;
    int err = sst_file_read(path, INPUT_MAX, &data, &size);

    if (err)
        return err;
    if (pooled < INPUTS_MAX)
        pool[pooled++] = (struct input){ data, size };
    else
        free(data);
    return 0;
}

/* In the order of their names: the same seed gives the same inputs. */
static void pool_folder(const char *path)
{
    struct dirent **list;
    const int n = scandir(path, &list, NULL, alphasort);

    for (int i = 0; i < n; i++) {
        char file[SST_PATH_MAX];

        if (list[i]->d_name[0] != '.' && (sst_path_join(file, path, list[i]->d_name) || pool_file(file)))
            fprintf(stderr, "%s/%s cannot be read\n", path, list[i]->d_name);
        free(list[i]);
    }
    if (n >= 0)
        free(list);
}

static void remove_folder(const char *path)
{
    DIR *d = opendir(path);

    for (struct dirent *e; d && (e = readdir(d));)
        if (e->d_name[0] != '.')
            (void)unlinkat(dirfd(d), e->d_name, 0);
    if (d)
        closedir(d);
    (void)rmdir(path);
}

/* --- mutations ---------------------------------------------------------------------------------------------------- */

static size_t below(size_t n)
{
    return n ? (size_t)(sst_random_u64(&random_state) % n) : 0;
}

static const uint64_t numbers[] = { 0,           1,           2,           7,         8,          63,
                                    64,          127,         128,         255,       256,        1023,
                                    4095,        32767,       32768,       65535,     65536,      0x7fffffff,
                                    0x80000000u, 0xffffffffu, 0x100000000, INT64_MAX, UINT64_MAX, 1ull << 63,
                                    1ull << 62,  1000000000 };
static const char *const words[] = { "0",
                                     "-1",
                                     "1",
                                     "255",
                                     "256",
                                     "65536",
                                     "2147483647",
                                     "-2147483648",
                                     "1e9",
                                     "1e308",
                                     "-0.0",
                                     "nan",
                                     "inf",
                                     "1e-320",
                                     "9223372036854775807",
                                     "null",
                                     "true",
                                     "[]",
                                     "{}",
                                     "\"\"",
                                     "\"../a\"",
                                     "99999999999999999999" };

struct text {
    uint8_t *data;
    size_t size, room;
};

/* Replace `cut` bytes at `at` by others. */
static void put_bytes(struct text *t, size_t at, size_t cut, const uint8_t *with, size_t n)
{
    if (t->size - cut + n > t->room)
        return;
    memmove(t->data + at + n, t->data + at + cut, t->size - at - cut);
    if (n)
        memcpy(t->data + at, with, n);
    t->size += n - cut;
}

static bool is_word(uint8_t c)
{
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' || c == '-' ||
           c == '+';
}

/* The word or number around a place. @return its bytes; 0: there is none */
static size_t word_at(const struct text *t, size_t *at)
{
    size_t n = 0;

    while (*at < t->size && !is_word(t->data[*at]))
        ++*at;
    while (*at && *at < t->size && is_word(t->data[*at - 1]))
        --*at;
    while (*at + n < t->size && is_word(t->data[*at + n]))
        n++;
    return n;
}

static void put_number(struct text *t)
{
    const size_t n = (size_t)1 << below(4);
    const uint64_t value = numbers[below(ARRAY_LEN(numbers))] + below(3) - 1;
    const bool big = below(2);
    const size_t at = t->size >= n ? below(t->size - n + 1) : 0;

    for (size_t i = 0; t->size >= n && i < n; i++)
        t->data[at + i] = (uint8_t)(value >> 8 * (big ? n - 1 - i : i));
}

static void mutate(struct text *t)
{
    const struct input *other = &pool[below((size_t)pooled)];
    const size_t at = below(t->size + 1), most = t->size - at;
    size_t n = below(most < GROWTH_MAX ? most + 1 : below(8) ? GROWTH_MAX : most + 1);
    uint8_t bytes[GROWTH_MAX];

    switch (below(11)) {
    case 0:
        if (most)
            t->data[at] ^= (uint8_t)(1 << below(8));
        return;
    case 1:
        if (most)
            t->data[at] = (uint8_t)below(256);
        return;
    case 2:
        n = 1 + below(8);
        for (size_t i = 0; i < n; i++)
            bytes[i] = (uint8_t)below(256);
        put_bytes(t, at, 0, bytes, n);
        return;
    case 3:
        put_bytes(t, at, n, NULL, 0);
        return;
    case 4: { /* a part of it, twice or over another one */
        const size_t from = below(t->size + 1);

        n = sst_min_int((int)(t->size - from), (int)below(GROWTH_MAX));
        memcpy(bytes, t->data + from, n);
        put_bytes(t, at, below(2) ? 0 : n < most ? n : most, bytes, n);
        return;
    }
    case 5: { /* of another input, mostly from the same place */
        const size_t from = below(4) ? (at < other->size ? at : 0) : below(other->size + 1);
        const size_t take = below(other->size - from + 1);

        put_bytes(t, at, below(2) ? 0 : n, other->data + from, take);
        return;
    }
    case 6:
    case 7:
        put_number(t);
        return;
    case 8:
    case 9: { /* a word, by a number or by another word */
        const char *word = words[below(ARRAY_LEN(words))];
        size_t to = at, from = below(t->size + 1), old = word_at(t, &to);

        n = word_at(t, &from);
        if (below(2) && n && n < sizeof(bytes)) {
            memcpy(bytes, t->data + from, n);
            put_bytes(t, to, old, bytes, n);
        } else if (old) {
            put_bytes(t, to, old, (const uint8_t *)word, strlen(word));
        }
        return;
    }
    default:
        if (!below(4))
            t->size = at;
    }
}

static void run_mutations(int64_t until_ns)
{
    static uint8_t room[INPUT_MAX];
    struct text t = { .data = room, .room = sizeof(room) };

    while (pooled && sst_clock_now_ns() < until_ns) {
        const struct input *from = &pool[below((size_t)pooled)];

        t.size = from->size;
        memcpy(t.data, from->data, from->size);
        for (size_t n = 1 + below(MUTATIONS); n; n--)
            mutate(&t);
        run(t.data, t.size);
    }
}

/* --- beginning and end -------------------------------------------------------------------------------------------- */

static int run_child(bool files_alone)
{
    const char *seconds = getenv("FUZZ_SECONDS");
    const struct itimerval tick = { { TICK_S, 0 }, { TICK_S, 0 } };

    if (dup2(messages, STDERR_FILENO) < 0)
        return 1;
    signal(SIGPROF, on_tick);
    setitimer(ITIMER_PROF, &tick, NULL);
    __sanitizer_install_malloc_and_free_hooks(on_malloc, on_free);
    for (int i = 0; i < pooled; i++)
        run(pool[i].data, pool[i].size);
    if (!files_alone)
        run_mutations(sst_clock_now_ns() + (int64_t)(seconds ? atoi(seconds) : 20) * 1000000000);
    return 0;
}

static void tell(const char *name)
{
    static char text[MESSAGES_MAX];
    const off_t end = lseek(messages, 0, SEEK_END), at = end > MESSAGES_MAX ? end - MESSAGES_MAX : 0;
    const ssize_t n = pread(messages, text, sizeof(text), at);
    char path[256];
    FILE *f;

    printf("%.*s\n", n > 0 ? (int)n : 0, text);
    if (!state->busy)
        return;
    snprintf(path, sizeof(path), "build/fuzz/%s-found", name);
    f = fopen(path, "wb");
    if (f && fwrite(state->data, 1, state->size, f) == state->size)
        printf("FAIL: the input is %s; its first bytes:\n", path);
    if (f)
        fclose(f);
    for (size_t i = 0; i < state->size && i < HEX_MAX; i++)
        printf("%02x%s", state->data[i], (i + 1) % 64 ? "" : "\n");
    printf("\n");
}

static void gather(int argc, char **argv, const char *name)
{
    char folder[] = "/tmp/sst-fuzz-XXXXXX", corpus[256];

    if (!mkdtemp(folder) || setenv("FUZZ_CORPUS", folder, 1))
        exit(1);
    LLVMFuzzerInitialize(&argc, &argv);
    snprintf(corpus, sizeof(corpus), "tests/fuzz/corpus/%s", name);
    if (argc == 1)
        pool_folder(folder);
    if (argc == 1 && sst_path_exists(corpus))
        pool_folder(corpus);
    remove_folder(folder);
    for (int i = 1; i < argc; i++)
        if (pool_file(argv[i])) {
            fprintf(stderr, "%s cannot be read\n", argv[i]);
            exit(1);
        }
}

int main(int argc, char **argv)
{
    const char *name = program_invocation_short_name, *seed = getenv("FUZZ_SEED");
    char *file = input_template();
    int status = 1;
    pid_t child;

    (void)mkdir("build", 0777);
    (void)mkdir("build/fuzz", 0777);
    random_state = seed ? strtoull(seed, NULL, 10) : (uint64_t)sst_clock_wall_ns();
    state = mmap(NULL, sizeof(*state), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    messages = mkostemp(file, O_APPEND | O_CLOEXEC);
    (void)unlink(file);
    if (state == MAP_FAILED || messages < 0)
        return 1;
    gather(argc, argv, name);
    printf("%s: FUZZ_SEED=%llu, %d inputs\n", name, (unsigned long long)random_state, pooled);
    fflush(stdout);
    child = fork();
    if (!child)
        status = run_child(argc > 1);
    for (int i = 0; i < pooled; i++)
        free(pool[i].data);
    if (!child)
        return status; /* through the check for leaks */
    if (child < 0 || waitpid(child, &status, 0) != child || status) {
        tell(name);
        return 1;
    }
    printf("%s: %llu inputs without a fault\n", name, (unsigned long long)state->runs);
    return 0;
}
