/* Verdicts of comparisons with the CPU that a device has passed, kept beside its pipelines: a device that is known opens
 * without them.
 *
 * They hold for one device, driver, build of the program, CPU and choice of variants: a file of another key is not
 * read. Refusals are not kept, and are found again. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* dl_iterate_phdr, environ */
#include <elf.h>
#include <link.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/gpu/gpu_internal.h"

#define KIND "verdicts"

/* --- the key ------------------------------------------------------------------------------------------------------ */

static uint64_t hash_text(uint64_t hash, const char *text)
{
    return gpu_hash(hash, text, strlen(text) + 1);
}

/* The linker's hash of an object's contents. */
static bool hash_build_id(uint64_t *hash, const struct dl_phdr_info *object)
{
    bool found = false;

    for (int i = 0; i < object->dlpi_phnum; i++) {
        const uint8_t *at = (const void *)(object->dlpi_addr + object->dlpi_phdr[i].p_vaddr);
        const uint8_t *end = at + object->dlpi_phdr[i].p_memsz;

        while (object->dlpi_phdr[i].p_type == PT_NOTE && at + sizeof(ElfW(Nhdr)) <= end) {
            ElfW(Nhdr) note;
            const uint8_t *name = at + sizeof(note), *id;

            memcpy(&note, at, sizeof(note));
            id = name + (note.n_namesz + 3) / 4 * 4;
            if (note.n_type == NT_GNU_BUILD_ID && note.n_namesz == 4 && !memcmp(name, "GNU", 4)) {
                *hash = gpu_hash(*hash, id, note.n_descsz);
                found = true;
            }
            at = id + (note.n_descsz + 3) / 4 * 4;
        }
    }
    return found;
}

/* The program, and libraries that compute for it. */
static int hash_object(struct dl_phdr_info *object, size_t size SST_UNUSED, void *arg)
{
    uint64_t *const hash = arg;
    const bool program = !*object->dlpi_name;

    if (!program && !strstr(object->dlpi_name, "/libdnnl.") && !strstr(object->dlpi_name, "/libm."))
        return 0;
    return !hash_build_id(hash, object) && program; /* without one it cannot be told from another build */
}

/* Variables on which results of the CPU, of variants and of software devices depend. */
static uint64_t hash_environment(void)
{
    static const char *const names[] = { "SST_CPU=", "SST_GPU_VARIANT=", "DNNL_", "ONEDNN_", "LP_", "GALLIVM_" };
    uint64_t all = 0;

    for (char *const *e = environ; e && *e; e++) {
        for (size_t i = 0; i < ARRAY_LEN(names); i++) {
            if (!strncmp(*e, names[i], strlen(names[i])))
                all ^= hash_text(GPU_HASH_START, *e); /* in any order */
        }
    }
    return all;
}

/* The first processor. */
static uint64_t hash_cpu(uint64_t hash)
{
    static const char *const names[] = { "model name", "flags", "CPU implementer", "CPU part", "Features" };
    FILE *f = fopen("/proc/cpuinfo", "re");
    char *line = NULL;
    size_t size = 0;

    while (f && getline(&line, &size, f) > 1) {
        for (size_t i = 0; i < ARRAY_LEN(names); i++) {
            if (!strncmp(line, names[i], strlen(names[i])))
                hash = hash_text(hash, line);
        }
    }
    free(line);
    if (f)
        fclose(f);
    return hash;
}

static uint64_t key_of(const struct sst_gpu *g)
{
    const uint64_t environment = hash_environment();
    uint64_t key = g->cache_key;

    if (!key || dl_iterate_phdr(hash_object, &key))
        return 0;
    key = hash_text(hash_text(key, g->info.name), g->info.driver);
    key = gpu_hash(key, &g->info.abilities, sizeof(g->info.abilities));
    key = gpu_hash(key, &g->info.matrix, sizeof(g->info.matrix));
    return gpu_hash(hash_cpu(key), &environment, sizeof(environment));
}

/* --- lists: "\nname\nname\n" -------------------------------------------------------------------------------------- */

static bool has(const char *list, const char *name)
{
    const size_t n = strlen(name);

    for (const char *at = list; at && (at = strstr(at, name)); at++) {
        if (at > list && at[-1] == '\n' && at[n] == '\n')
            return true;
    }
    return false;
}

static void add(char **list, const char *name)
{
    const size_t before = *list ? strlen(*list) : 1, n = strlen(name);
    char *longer = has(*list, name) ? NULL : realloc(*list, before + n + 2);

    if (!longer) /* there, or to be compared again */
        return;
    longer[0] = '\n';
    memcpy(longer + before, name, n);
    memcpy(longer + before + n, "\n", 2);
    *list = longer;
}

/* Add the names of a file that are not in `but`. */
static void add_kept(char **list, uint64_t key, const char *but)
{
    size_t bytes = 0;
    char *const kept = gpu_cache_read(KIND, key, &bytes), *at = kept;
    char *const end = kept && bytes && kept[bytes - 1] == '\n' ? kept + bytes : kept;

    while (at < end) {
        char *const stop = memchr(at, '\n', (size_t)(end - at));

        *stop = 0;
        if (*at && !has(but, at))
            add(list, at);
        at = stop + 1;
    }
    free(kept);
}

/* ------------------------------------------------------------------------------------------------------------------ */

void gpu_verdicts_open(struct sst_gpu *g)
{
    g->verdicts.key = key_of(g);
    if (g->verdicts.key && !g->cfg.test_again)
        add_kept(&g->verdicts.passed, g->verdicts.key, NULL);
}

void gpu_verdicts_close(struct sst_gpu *g)
{
    struct gpu_verdicts *v = &g->verdicts;

    if (v->changed && v->key && !g->lost) {
        add_kept(&v->passed, v->key, v->failed); /* of others meanwhile */
        if (v->passed)
            gpu_cache_write(KIND, v->key, v->passed, strlen(v->passed));
    }
    free(v->passed);
    free(v->failed);
}

bool sst_gpu_has_passed(const struct sst_gpu *g, const char *name)
{
    return has(g->verdicts.passed, name) || gpu_dummy_is_known(g);
}

void sst_gpu_note_verdict(struct sst_gpu *g, const char *name, bool passed)
{
    if (!g->verdicts.key || (passed && sst_gpu_has_passed(g, name)))
        return;
    add(passed ? &g->verdicts.passed : &g->verdicts.failed, name);
    g->verdicts.changed = true;
}
