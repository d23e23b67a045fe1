/* Shards, pieces of work that several processes share on one machine or many: each is claimed, done once, and taken
 * over from a process that ended without finishing it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/claim.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "cli/cli_internal.h"
#include "cli/shard_internal.h"

#define MOST_ATTEMPTS 3 /* a piece that ended this many workers is not tried again */
#define POLL_NS       (200 * INT64_C(1000000))

/* Variables in which schedulers give a process its number, how many there are, and the first number and the step of
 * arrays (NULL: 0 and 1). */
static const struct rank {
    const char *index, *count, *first, *step;
} ranks[] = {
    { "SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", "SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_STEP" },
    { "SLURM_PROCID", "SLURM_NTASKS", NULL, NULL },
    { "OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", NULL, NULL },
    { "PMIX_RANK", "PMIX_SIZE", NULL, NULL },
    { "PMI_RANK", "PMI_SIZE", NULL, NULL },
};

/* A whole number from 0 on. @return false: unset or something else */
static bool read_number(const char *name, int *out)
{
    const char *text = name ? getenv(name) : NULL;
    char *end;
    long v;

    if (!text)
        return false;
    errno = 0;
    v = strtol(text, &end, 10);
    if (end == text || *end || errno || v < 0 || v > INT32_MAX)
        return false;
    *out = (int)v;
    return true;
}

static int read_rank(const struct cli_command *cmd, struct cli_shard *s)
{
    for (size_t i = 0; i < ARRAY_LEN(ranks); i++) {
        int first = 0, step = 1;

        if (!read_number(ranks[i].index, &s->index) || !read_number(ranks[i].count, &s->count) || s->count < 1)
            continue;
        (void)read_number(ranks[i].first, &first);
        (void)read_number(ranks[i].step, &step);
        s->index = (s->index - first) / sst_max_int(step, 1) % s->count; /* lists such as 1,3,17 have gaps */
        s->index = sst_max_int(s->index, 0);
        return CLI_GO_ON;
    }
    return cli_usage_error(cmd, "--shard auto: neither Slurm nor mpirun has set this process's number "
                                "(SLURM_ARRAY_TASK_ID and the like); use --shard I/N");
}

int cli_shard_read(const struct cli_command *cmd, struct cli_shard *s)
{
    int part[2];

    if (!s->text) {
        if (s->retry)
            return cli_usage_error(cmd, "--retry belongs to --shard");
        return CLI_GO_ON;
    }
    if (!strcmp(s->text, "auto"))
        return read_rank(cmd, s);
    if (!cli_read_pair(s->text, '/', part) || part[0] < 1 || part[0] > part[1])
        return cli_usage_error(cmd, "--shard %s is neither I/N, with I from 1 to N, nor auto", s->text);
    s->index = part[0] - 1;
    s->count = part[1];
    return CLI_GO_ON;
}

/* --- working ------------------------------------------------------------------------------------------------------ */

struct work {
    const struct cli_shard *s;
    const struct cli_pieces *p;
    int lease_ms;
    struct piece {
        struct sst_claim_watch watch;
        int64_t failed_ns; /* when it failed, as first seen; 0: it had not */
        bool seen, ended;
    } * piece;
    int failed, code; /* pieces; exit code of the first that failed here */
};

/* Ended for this worker? With --retry, pieces that had failed before are not, unless another worker has tried again. */
static bool is_ended(struct work *w, struct piece *piece, const struct sst_claim_info *info)
{
    if (!piece->seen && info->state == SST_CLAIM_FAILED)
        piece->failed_ns = info->touched_ns;
    piece->seen = true;
    if (strcmp(info->job, w->p->job) || info->state < SST_CLAIM_DONE)
        return false;
    if (info->state == SST_CLAIM_FAILED && w->s->retry && info->touched_ns == piece->failed_ns)
        return false;
    w->failed += info->state == SST_CLAIM_FAILED;
    return true;
}

/* Do a piece that this process holds. */
static int do_piece(struct work *w, int i, struct sst_claim *claim, int before)
{
    char error[SST_LOG_MAX] = "";
    int code, err;

    if (before >= MOST_ATTEMPTS) {
        snprintf(error, sizeof(error), "%d workers ended while they did it, perhaps for lack of memory", before);
        sst_log_error("%s: %s; see their logs, then --retry", w->p->name[i], error);
        code = CLI_INTERNAL;
    } else {
        sst_log_copy_errors(error, sizeof(error));
        code = w->p->run(w->p->arg, i, before > 0);
        sst_log_copy_errors(NULL, 0);
    }
    if (code && !error[0])
        snprintf(error, sizeof(error), "it ended with code %d", code);
    fflush(stdout);
    err = sst_claim_end(claim, code ? error : NULL);
    if (code) {
        w->failed++;
        w->code = w->code ? w->code : code;
    }
    return err == -ESTALE ? 0 : err;
}

/* @return 1: done or failed here; 0: ended, or held by another process (*held); or an error */
static int try_piece(struct work *w, int i, bool *held)
{
    struct piece *piece = &w->piece[i];
    struct sst_claim_info info;
    struct sst_claim *claim;
    bool expired;
    int err;

    if (piece->ended)
        return 0;
    err = sst_claim_look(&info, w->p->state[i]);
    if (err)
        return err;
    piece->ended = is_ended(w, piece, &info);
    if (piece->ended)
        return 0;
    expired = sst_claim_expired(&piece->watch, &info, w->lease_ms);
    if (info.state == SST_CLAIM_HELD && !expired) {
        *held = true;
        return 0;
    }
    err = sst_claim_take(&claim, w->p->state[i], &info, w->p->job, w->lease_ms);
    if (err == -EBUSY) {
        *held = true;
        return 0;
    }
    if (err)
        return err;
    if (expired)
        sst_log_warning("%s: %s has given no sign of life for %.0f s: taken over", w->p->name[i], info.worker,
                        w->lease_ms * 1e-3);
    piece->ended = true;
    err = do_piece(w, i, claim, expired ? sst_claim_attempts(claim) - 1 : 0);
    return err ? err : 1;
}

/* The process's own share first, then the rest of the others'. */
static int try_all(struct work *w, int *done, bool *held)
{
    int err = 0;

    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; !err && i < w->p->count; i++) {
            if ((i % w->s->count == w->s->index) != (pass == 0))
                continue;
            err = try_piece(w, i, held);
            if (err > 0) {
                *done += err;
                err = 0;
            }
        }
    }
    return err;
}

int cli_shard_run(const struct cli_shard *s, const struct cli_pieces *p)
{
    struct work w = { s, p, (int)(s->lease_s * 1000), calloc((size_t)p->count, sizeof(*w.piece)), 0, 0 };
    int done, total = 0, err = w.piece ? 0 : -ENOMEM;
    bool held = true;

    while (!err && held) {
        done = 0;
        held = false;
        err = try_all(&w, &done, &held);
        total += done;
        if (!err && held && !done)
            nanosleep(&(struct timespec){ .tv_nsec = POLL_NS }, NULL);
    }
    free(w.piece);
    if (err)
        return cli_exit_code(err);
    sst_log_info("%d of %d pieces done by this worker", total, p->count);
    if (w.failed)
        sst_log_error("%d of %d pieces failed: --status names them, --retry tries them again", w.failed, p->count);
    return w.code ? w.code : w.failed ? CLI_INPUT : CLI_OK;
}

/* --- status ------------------------------------------------------------------------------------------------------- */

static const char *const state_names[] = { "waiting", "running", "done", "failed" };

struct summary {
    int count[ARRAY_LEN(state_names)];
    double seconds; /* sum over finished pieces */
};

/* Time left, from the mean of finished pieces and the workers that run; NaN: unknown. */
static double time_left(const struct summary *t)
{
    const int running = t->count[SST_CLAIM_HELD], done = t->count[SST_CLAIM_DONE];
    const double waiting = t->count[SST_CLAIM_FREE] + running / 2.0; /* running ones are half done on average */

    if (!t->count[SST_CLAIM_FREE] && !running)
        return 0;
    return done && running ? t->seconds / done * waiting / running : NAN;
}

static json_t *piece_json(const char *name, const struct sst_claim_info *info)
{
    json_t *o = json_pack("{s:o, s:s}", "name", cli_text_json(name), "state", state_names[info->state]);

    if (info->state != SST_CLAIM_FREE)
        json_object_set_new(o, "worker", cli_text_json(info->worker));
    if (info->state >= SST_CLAIM_DONE)
        json_object_set_new(o, "seconds", json_real(info->seconds));
    if (info->state == SST_CLAIM_FAILED)
        json_object_set_new(o, "error", cli_text_json(info->error));
    return o;
}

static void print_piece(const char *name, const struct sst_claim_info *info)
{
    const double silent_s = (double)(sst_clock_wall_ns() - info->touched_ns) * 1e-9;
    char shown[CLI_SHORT];

    printf("%-8s %s", state_names[info->state], name);
    if (info->state == SST_CLAIM_HELD)
        printf("  on %s, last sign of life %s ago", info->worker, cli_duration_text(shown, fmax(silent_s, 0)));
    else if (info->state == SST_CLAIM_DONE)
        printf("  in %s on %s", cli_duration_text(shown, info->seconds), info->worker);
    else if (info->state == SST_CLAIM_FAILED)
        printf("  on %s: %s", info->worker, info->error);
    putchar('\n');
}

int cli_shard_status(const struct cli_pieces *p, bool json)
{
    struct summary sum = { 0 };
    json_t *list = json_array();
    char left[CLI_SHORT];
    double left_s;

    for (int i = 0; i < p->count; i++) {
        struct sst_claim_info info;
        const int err = sst_claim_look(&info, p->state[i]);

        if (err) {
            json_decref(list);
            return cli_exit_code(err);
        }
        sum.count[info.state]++;
        sum.seconds += info.state == SST_CLAIM_DONE ? info.seconds : 0;
        if (json)
            json_array_append_new(list, piece_json(p->name[i], &info));
        else
            print_piece(p->name[i], &info);
    }
    left_s = time_left(&sum);
    if (json)
        return cli_print_json(json_pack("{s:o, s:i, s:i, s:i, s:i, s:o}", "pieces", list, "done",
                                        sum.count[SST_CLAIM_DONE], "running", sum.count[SST_CLAIM_HELD], "failed",
                                        sum.count[SST_CLAIM_FAILED], "waiting", sum.count[SST_CLAIM_FREE], "left_s",
                                        cli_real_json(left_s)));
    json_decref(list);
    printf("%d pieces: %d done, %d running, %d failed, %d waiting", p->count, sum.count[SST_CLAIM_DONE],
           sum.count[SST_CLAIM_HELD], sum.count[SST_CLAIM_FAILED], sum.count[SST_CLAIM_FREE]);
    if (left_s > 0)
        printf("; about %s left", cli_duration_text(left, left_s));
    putchar('\n');
    return CLI_OK;
}

/* --- the job's text ----------------------------------------------------------------------------------------------- */

static void add_value(char *text, size_t size, const struct cli_option *o)
{
    const char *string = o->type == CLI_STRING ? *(const char **)o->value : NULL;

    if (o->type == CLI_FLAG && *(bool *)o->value)
        sst_text_add(text, size, " --%s", o->name);
    else if (o->type == CLI_INT)
        sst_text_add(text, size, " --%s %d", o->name, *(int *)o->value);
    else if (o->type == CLI_DOUBLE || o->type == CLI_AUTO)
        sst_text_add(text, size, " --%s %.17g", o->name, *(double *)o->value);
    else if (string)
        sst_text_add(text, size, " --%s %s", o->name, string);
}

void cli_shard_job(char *text, size_t size, const struct cli_command *cmd, const struct cli_option *options, size_t n,
                   const char *const *without)
{
    snprintf(text, size, "sst %s %s", SST_VERSION, cmd->name);
    for (size_t i = 0; i < n; i++) {
        bool counts = true;

        for (const char *const *w = without; *w; w++)
            counts = counts && strcmp(*w, options[i].name) != 0;
        if (counts)
            add_value(text, size, &options[i]);
    }
    for (char *c = text; *c; c++) /* one line */
        *c = *c == '\n' ? ' ' : *c;
}
