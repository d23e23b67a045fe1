/* sst batch: a campaign of light fields and recordings processed and rendered, shared by workers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/claim.h"
#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "cli/cli_internal.h"
#include "cli/shard_internal.h"

#define STATES ".state" /* of the output: a folder with the claim of each piece */
#define LOGS   "logs"

/* --- pieces of the campaign --------------------------------------------------------------------------------------- */

struct list {
    struct cli_batch_piece *piece;
    char **name, **state;
    int count, capacity[3];
};

static void free_list(struct list *l)
{
    for (int i = 0; i < l->count; i++) {
        free(l->piece[i].source);
        free(l->name[i]);
        free(l->state[i]);
    }
    free(l->piece);
    free(l->name);
    free(l->state);
}

static int log_oom(void)
{
    sst_log_error("not enough memory for the list of light fields");
    return -ENOMEM;
}

/* @param set  of a recording, or -1 */
static int add(struct list *l, const struct cli_batch *b, const char *source, const char *name, int set)
{
    char state[SST_PATH_MAX], shown[300];
    int err;

    if (set < 0)
        snprintf(shown, sizeof(shown), "%s", name);
    else
        snprintf(shown, sizeof(shown), "%s-%06d", name, set);
    err = sst_path_join(state, b->states, shown);
    if (err)
        return err;
    if (!sst_mem_grow(&l->piece, l->count, &l->capacity[0], sizeof(*l->piece)) ||
        !sst_mem_grow(&l->name, l->count, &l->capacity[1], sizeof(*l->name)) ||
        !sst_mem_grow(&l->state, l->count, &l->capacity[2], sizeof(*l->state)))
        return log_oom();
    l->piece[l->count] = (struct cli_batch_piece){ strdup(source), set };
    l->name[l->count] = strdup(shown);
    l->state[l->count] = strdup(state);
    l->count++;
    return l->piece[l->count - 1].source && l->name[l->count - 1] && l->state[l->count - 1] ? 0 : log_oom();
}

static int add_recording(struct list *l, const struct cli_batch *b, const char *source, const char *name)
{
    struct sst_recording *recording;
    int err = sst_recording_open(&recording, source), sets;

    if (err)
        return err;
    sets = sst_recording_sets(recording);
    sst_recording_close(recording);
    for (int i = 0; !err && i < sets; i += b->every)
        err = add(l, b, source, name, i);
    return err;
}

static bool holds(const char *dir, const char *file)
{
    char path[SST_PATH_MAX];

    return !sst_path_join(path, dir, file) && sst_path_exists(path);
}

/* A light field, a recording, or neither, or not of the kind asked for (*known stays). */
static int add_source(struct list *l, const struct cli_batch *b, const char *path, const char *name, bool *known)
{
    if (b->from != BATCH_RECORDINGS && holds(path, "lightfield.json")) {
        *known = true;
        return add(l, b, path, name, -1);
    }
    if (b->from != BATCH_LIGHTFIELDS && holds(path, "recording.json")) {
        *known = true;
        return add_recording(l, b, path, name);
    }
    return 0;
}

static int visible(const struct dirent *entry)
{
    return entry->d_name[0] != '.';
}

/* The folder itself, or all that lies in it, in the order of names. */
static int list_source(struct list *l, const struct cli_batch *b, char *source)
{
    struct dirent **entry = NULL;
    char path[SST_PATH_MAX], *whole = NULL;
    bool known = false;
    int n, err;

    for (size_t end = strlen(source); end > 1 && source[end - 1] == '/'; end--)
        source[end - 1] = 0;
    if (!strcmp(sst_path_base(source), ".") || !strcmp(sst_path_base(source), "..")) /* by its own name */
        whole = realpath(source, NULL);
    err = add_source(l, b, source, whole ? sst_path_base(whole) : sst_path_base(source), &known);
    free(whole);
    if (err || known)
        return err;
    n = scandir(source, &entry, visible, alphasort);
    if (n < 0) {
        err = -errno;
        sst_log_error("cannot read the folder %s: %s", source, strerror(errno));
        return err;
    }
    for (int i = 0; i < n; i++) {
        err = err ? err : sst_path_join(path, source, entry[i]->d_name);
        err = err ? err : add_source(l, b, path, entry[i]->d_name, &known);
        free(entry[i]);
    }
    free(entry);
    if (!err && !known) {
        if (b->from)
            sst_log_error("%s holds no %s; leave out --from", source,
                          b->from == BATCH_RECORDINGS ? "recordings (recording.json)"
                                                      : "light fields (lightfield.json)");
        else
            sst_log_error("%s holds neither light fields (lightfield.json) nor recordings (recording.json)", source);
        err = -ENOENT;
    }
    return err;
}

/* A folder, or the one that it will be made in. */
static void find_there(char there[SST_PATH_MAX], const char *out)
{
    size_t n = strlen(out);

    snprintf(there, SST_PATH_MAX, "%s", out);
    if (sst_path_exists(out))
        return;
    while (n > 1 && out[n - 1] == '/')
        n--;
    while (n > 0 && out[n - 1] != '/')
        n--;
    snprintf(there, SST_PATH_MAX, "%.*s", n ? (int)n : 1, n ? out : ".");
}

/* A file of an earlier output of a piece; without any, the output is refused. */
static const char *marker_of(const char *path)
{
    static const char *const markers[] = { CLI_BATCH_LIGHTFIELD, CLI_BATCH_REPORT, CLI_BATCH_FIGURES };

    for (size_t i = 0; i < ARRAY_LEN(markers); i++) {
        if (holds(path, markers[i]))
            return markers[i];
    }
    return markers[0];
}

/* Two sources of one name would have one output, some names are taken, and only an earlier output is replaced: not a
 * light field in the folder that the sources are in. */
static int check_names(const struct list *l, const char *out)
{
    static const char *const taken[] = { LOGS, STATES, CLI_BATCH_TABLE };
    char path[SST_PATH_MAX], there[SST_PATH_MAX];
    int err;

    find_there(there, out);
    for (int i = 0; i < l->count; i++) {
        if (l->piece[i].set < 0 && sst_path_is_inside(there, l->piece[i].source)) {
            sst_log_error("%s lies in %s, which it would hold a copy of; choose another -o", out, l->piece[i].source);
            return -EEXIST;
        }
        for (size_t k = 0; k < ARRAY_LEN(taken); k++) {
            if (!strcmp(l->name[i], taken[k])) {
                sst_log_error("%s would have the output %s, which is the campaign's own; rename it", l->piece[i].source,
                              l->name[i]);
                return -EEXIST;
            }
        }
        if (sst_path_join(path, out, l->name[i]))
            return -ENAMETOOLONG;
        err = sst_path_exists(path)
                  ? sst_path_check_output(path, true, marker_of(path), (const char *[]){ l->piece[i].source, NULL })
                  : 0;
        if (err)
            return err;
        for (int k = 0; k < i; k++) {
            if (!strcmp(l->name[i], l->name[k])) {
                sst_log_error("%s and %s would have the same output %s; rename one of them", l->piece[k].source,
                              l->piece[i].source, l->name[i]);
                return -EEXIST;
            }
        }
    }
    return 0;
}

/* --- running ------------------------------------------------------------------------------------------------------ */

struct run {
    struct cli_batch *b;
    const struct list *list;
};

static int run_piece(void *arg, int i, bool again)
{
    const struct run *run = arg;

    return cli_batch_run_piece(run->b, &run->list->piece[i], run->list->name[i], again);
}

static int name_folders(struct cli_batch *b)
{
    const int err = sst_path_join(b->states, b->out, STATES);

    return err ? err : sst_path_join(b->logs, b->out, LOGS);
}

static int make_folders(const struct cli_batch *b)
{
    int err = sst_path_make_dir(b->out);

    err = err ? err : sst_path_make_dir(b->states);
    return err ? err : sst_path_make_dir(b->logs);
}

static int run_all(struct cli_batch *b, const struct cli_shard *shard, const char **sources, const char *job, bool json)
{
    struct list list = { 0 };
    struct run run = { b, &list };
    int err = name_folders(b), r;

    for (int i = 0; !err && sources[i]; i++) {
        char source[SST_PATH_MAX];

        err = sst_path_join(source, sources[i], NULL);
        err = err ? err : list_source(&list, b, source);
    }
    if (!err && !b->reads_only) {
        err = check_names(&list, b->out);
        err = err ? err : make_folders(b);
    }
    r = cli_exit_code(err);
    if (!r) {
        const struct cli_pieces pieces = { list.count, list.name, list.state, job, run_piece, &run };

        r = shard->status ? cli_shard_status(&pieces, json) : cli_shard_run(shard, &pieces);
        if (!shard->status) {
            err = cli_batch_write_table(b->out, list.name, list.count);
            r = r ? r : cli_exit_code(err);
        }
    }
    if (!r && !shard->status)
        printf("%s: %d pieces; figures in %s/figures.csv\n", b->out, list.count, b->out);
    free_list(&list);
    return r;
}

/* Read `--write`; everything by default. */
static int read_written(const struct cli_command *cmd, struct cli_batch_written *w, const char *list)
{
    const struct cli_skip names[] = { { "clear", &w->clear },
                                      { "see-through", &w->see_through },
                                      { "sweep", &w->sweep },
                                      { "lightfield", &w->lightfield },
                                      { "reports", &w->reports } };
    const int r = cli_read_skips(cmd, "write", list ? list : "all", names, ARRAY_LEN(names));

    if (r == CLI_GO_ON && !strcmp(list ? list : "all", "none"))
        return cli_usage_error(cmd, "--write none leaves nothing to do");
    return r;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct cli_batch b = { .preset = "balanced", .device = "cpu", .steps = 20, .every = 1 };
    struct cli_shard shard = CLI_SHARD_DEFAULTS;
    const char *written = NULL;
    bool json = false;
    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &b.out, "DIR", "folder of the results; one of an earlier run is continued" },
        { "from", 0, CLI_WORD, &b.from, "KIND", "sources of this kind alone: recording or lightfield", BATCH_RECORDINGS,
          0, "recording lightfield" },
        { "write", 'w', CLI_STRING, &written, "LIST",
          "results: clear, see-through, sweep, lightfield, reports or all (default); without lightfield, in memory" },
        { "preset", 'p', CLI_STRING, &b.preset, "NAME", "of `sst process`: preview, balanced (default) or accurate", 0, 0, CLI_PRESETS },
        { "model", 0, CLI_STRING, &b.model, "NAME", "segmentation network: an installed one or an ONNX file" },
        { "no-labels", 0, CLI_FLAG, &b.no_labels, NULL, "disparity only" },
        { "steps", 0, CLI_INT, &b.steps, "N", "pictures of the sweep over the focus (20); 0: no sweep", 0, 9999 },
        { "every", 0, CLI_INT, &b.every, "N", "of recordings every N-th set (1)", 1, 1000000 },
        { "calib", 0, CLI_STRING, &b.calib, "FILE",
          "of recordings: the array's calibration; views are then rectified" },
        { "device", 0, CLI_STRING, &b.device, "D",
          "where views are matched, labelled and rendered: cpu (default), gpu, auto (gpu if there is one) or a part of "
          "a name" },
        { "device-memory", 0, CLI_INT, &b.device_memory, "MIB", CLI_DEVICE_MEMORY_HELP, 1, 1 << 24 },
        { "threads", 't', CLI_INT, &b.threads, "N", "threads; default: all processors", 1, 256 },
        CLI_SHARD_OPTIONS(shard),
        { "json", 0, CLI_FLAG, &json, NULL, "with --status: print one JSON object" },
    };
    static const char *const same[] = { CLI_SHARD_NAMES, "output", "from", "threads", "json", "device",
                                        "device-memory", NULL };
    const char **sources = calloc((size_t)argc + 1, sizeof(*sources));
    char job[SST_CLAIM_JOB];
    int r = sources ? cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, sources, 1, argc) : CLI_MEMORY;

    if (r == CLI_GO_ON && !b.out)
        r = cli_usage_error(cmd, "-o DIR is missing");
    if (r == CLI_GO_ON)
        r = read_written(cmd, &b.write, written);
    if (r == CLI_GO_ON && !shard.text) {
        shard.text = "1/1"; /* alone, and yet each piece only once */
    }
    if (r == CLI_GO_ON)
        r = cli_shard_read(cmd, &shard);
    if (r == CLI_GO_ON) {
        b.reads_only = shard.status;
        cli_shard_job(job, sizeof(job), cmd, options, ARRAY_LEN(options), same);
        r = run_all(&b, &shard, sources, job, json);
        cli_batch_memory_close(b.memory);
    }
    free(sources);
    return r;
}

const struct cli_command cli_batch = { "batch", run };
