/* A plugin of qemu-user that counts instructions by function of the program; at its end they go to standard error, most
 * first. `make build/arm64_profile.so`, then
 * qemu-aarch64 -plugin build/arm64_profile.so -L build-arm64/sysroot build-arm64/sst process ... */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/base.h"

/* Of qemu-plugin.h, version 1, which Debian does not package. */
typedef uint64_t qemu_plugin_id_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
struct qemu_info_t;
typedef void qemu_plugin_tb_fn(qemu_plugin_id_t id, struct qemu_plugin_tb *tb);
typedef void qemu_plugin_end_fn(qemu_plugin_id_t id, void *arg);
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id, qemu_plugin_tb_fn *fn);
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb *tb, int add_u64, void *count, uint64_t more);
void qemu_plugin_register_atexit_cb(qemu_plugin_id_t id, qemu_plugin_end_fn *fn, void *arg);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *tb);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *tb, size_t index);
const char *qemu_plugin_insn_symbol(const struct qemu_plugin_insn *insn);

extern int qemu_plugin_version;
int qemu_plugin_install(qemu_plugin_id_t id, const struct qemu_info_t *info, int argc, char **argv);
int qemu_plugin_version = 1;

#define FUNCTIONS 65536 /* at most */

static struct function {
    uint64_t count;
    char *name; /* NULL: free */
} functions[FUNCTIONS];

static uint64_t *count_of(const char *name)
{
    unsigned at = 0;

    for (const char *p = name; *p; p++)
        at = (at * 33 + (unsigned char)*p) % FUNCTIONS;
    while (functions[at].name && strcmp(functions[at].name, name))
        at = (at + 1) % FUNCTIONS;
    if (!functions[at].name)
        functions[at].name = strdup(name);
    return &functions[at].count;
}

/* Blocks of instructions begin and end within a function. */
static void translated(qemu_plugin_id_t id SST_UNUSED, struct qemu_plugin_tb *tb)
{
    const char *name = qemu_plugin_insn_symbol(qemu_plugin_tb_get_insn(tb, 0));

    qemu_plugin_register_vcpu_tb_exec_inline(tb, 0, count_of(name && *name ? name : "(libraries)"),
                                             qemu_plugin_tb_n_insns(tb));
}

static int by_count(const void *a, const void *b)
{
    const uint64_t x = ((const struct function *)a)->count, y = ((const struct function *)b)->count;

    return (x < y) - (x > y);
}

static void report(qemu_plugin_id_t id SST_UNUSED, void *arg SST_UNUSED)
{
    uint64_t all = 0;

    qsort(functions, FUNCTIONS, sizeof(functions[0]), by_count);
    for (int i = 0; i < FUNCTIONS; i++)
        all += functions[i].count;
    fprintf(stderr, "%12.2f million instructions\n", (double)all * 1e-6);
    for (int i = 0; i < 40 && functions[i].count; i++)
        fprintf(stderr, "%12.2f %5.1f %% %s\n", (double)functions[i].count * 1e-6,
                100 * (double)functions[i].count / (double)all, functions[i].name);
}

int qemu_plugin_install(qemu_plugin_id_t id, const struct qemu_info_t *info SST_UNUSED, int argc SST_UNUSED,
                        char **argv SST_UNUSED)
{
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, report, NULL);
    return 0;
}
