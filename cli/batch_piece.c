/* Piece of a campaign. With a light field in its output it is made by the commands that a user would type, each a
 * process of its own, so that one that crashes or runs out of memory ends nothing else; without one, in memory. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "cli/cli_internal.h"
#include "cli/shard_internal.h"

#define MAX_ARGS 24

struct step {
    const char *argv[MAX_ARGS];
    int argc;
};

struct piece {
    const struct cli_batch *b;
    const char *name;
    char log[SST_PATH_MAX], sst[SST_PATH_MAX], threads[16], device_memory[16];
    struct sst_outdir out;
    char lf[SST_PATH_MAX];
};

static void add(struct step *s, const char *arg)
{
    if (s->argc < MAX_ARGS - 1) /* one that is cut is refused by the command */
        s->argv[s->argc++] = arg;
}

static void add_option(struct step *s, const char *name, const char *value)
{
    if (value) {
        add(s, name);
        add(s, value);
    }
}

static struct step begin(const struct piece *p, const char *command, const char *argument)
{
    struct step s = { 0 };

    add(&s, p->sst);
    add(&s, command);
    add(&s, argument);
    if (p->b->threads && strcmp(command, "eval") != 0)
        add_option(&s, "--threads", p->threads);
    return s;
}

static void add_device(const struct piece *p, struct step *s)
{
    if (strcmp(p->b->device, "cpu") != 0)
        add_option(s, "--device", p->b->device);
    if (p->b->device_memory)
        add_option(s, "--device-memory", p->device_memory);
}

/* Run a command; its report becomes the file `report` of the output, or goes to the log. */
static int run_step(const struct piece *p, struct step *s, const char *report)
{
    char path[SST_PATH_MAX] = "", error[SST_LOG_MAX];
    int code = report ? cli_exit_code(sst_path_join(path, p->out.temporary, report)) : CLI_OK;

    if (code)
        return code;
    s->argv[s->argc] = NULL;
    code = cli_run_program(s->argv, report ? path : NULL, p->log);
    if (code < 0) {
        sst_log_error("%s: cannot start %s: %s", p->name, s->argv[0], strerror(-code));
        return CLI_INTERNAL;
    }
    if (!code)
        return CLI_OK;
    cli_last_error(p->log, error, sizeof(error));
    if (code > 128)
        sst_log_error("%s: `sst %s` was ended by signal %d; see %s", p->name, s->argv[1], code - 128, p->log);
    else
        sst_log_error("%s: `sst %s`: %s", p->name, s->argv[1], error[0] ? error : "it failed without a message");
    return code > 128 ? CLI_INTERNAL : code;
}

static int fetch(struct piece *p, const struct cli_batch_piece *from)
{
    char set[16];
    struct step s;

    if (from->set < 0)
        return cli_exit_code(sst_path_copy_tree(from->source, p->lf));
    snprintf(set, sizeof(set), "%d", from->set);
    s = begin(p, "import", "recording");
    add(&s, from->source);
    add_option(&s, "--sets", set);
    add_option(&s, "--calib", p->b->calib);
    add_option(&s, "-o", p->lf);
    add(&s, "--allow-partial");
    return run_step(p, &s, NULL);
}

static int process(const struct piece *p)
{
    struct step s = begin(p, "process", p->lf);

    add_device(p, &s);
    add_option(&s, "--preset", p->b->preset);
    add_option(&s, "--model", p->b->model);
    if (p->b->no_labels)
        add(&s, "--no-labels");
    add(&s, "--json");
    return run_step(p, &s, CLI_BATCH_REPORT);
}

/* A picture and its report, NAME.png and NAME.json. */
static int render(const struct piece *p, const char *method, const char *name)
{
    struct step s = begin(p, "render", p->lf);
    char picture[SST_PATH_MAX], file[32], report[32];
    int code;

    snprintf(file, sizeof(file), "%s.png", name);
    snprintf(report, sizeof(report), "%s.json", name);
    code = cli_exit_code(sst_path_join(picture, p->out.temporary, file));
    if (code)
        return code;
    add_device(p, &s);
    add_option(&s, "--method", method);
    add_option(&s, "-o", picture);
    add(&s, "--json");
    return run_step(p, &s, report);
}

/* A picture without the foreground, where there is one. */
static int render_clear(const struct piece *p)
{
    char error[SST_LOG_MAX], shown[SST_LOG_MAX], *before = sst_log_hold_errors(shown);
    const int code = render(p, "clear", "clear");

    sst_log_hold_errors(before);
    if (code != CLI_INPUT) {
        if (code)
            sst_log_error("%s", shown);
        return code;
    }
    cli_last_error(p->log, error, sizeof(error));
    sst_log_warning("%s: no clear picture: %s", p->name, error);
    return CLI_OK;
}

static int sweep(const struct piece *p)
{
    struct step s = begin(p, "sweep", p->lf);
    char path[SST_PATH_MAX], steps[16];
    int code;

    code = cli_exit_code(sst_path_join(path, p->out.temporary, CLI_BATCH_SWEEP));
    if (code || !p->b->steps)
        return code;
    add_device(p, &s);
    snprintf(steps, sizeof(steps), "%d", p->b->steps);
    add_option(&s, "--steps", steps);
    add_option(&s, "-o", path);
    return run_step(p, &s, NULL);
}

static int evaluate(const struct piece *p)
{
    struct step s = begin(p, "eval", p->lf);
    char truth[SST_PATH_MAX];
    const int code = cli_exit_code(sst_path_join(truth, p->lf, "truth"));

    if (code || !sst_path_is_dir(truth))
        return code;
    add_option(&s, "--truth", truth);
    add(&s, "--json");
    return run_step(p, &s, "eval.json");
}

/* Each command a process of its own. */
static int run_commands(struct piece *p, const struct cli_batch_piece *from)
{
    const struct cli_batch_written *w = &p->b->write;
    int code = fetch(p, from);

    code = code ? code : process(p);
    code = code || !w->clear ? code : render_clear(p);
    code = code || !w->see_through ? code : render(p, "sst", "see-through");
    code = code || !w->sweep ? code : sweep(p);
    return code || !w->reports ? code : evaluate(p);
}

int cli_batch_run_piece(struct cli_batch *b, const struct cli_batch_piece *piece, const char *name, bool again)
{
    struct piece p = { .b = b, .name = name };
    char out[SST_PATH_MAX], file[SST_PATH_MAX];
    int err, code;

    snprintf(p.threads, sizeof(p.threads), "%d", b->threads);
    snprintf(p.device_memory, sizeof(p.device_memory), "%d", b->device_memory);
    snprintf(file, sizeof(file), "%s.log", name);
    err = sst_path_beside_program(p.sst, "sst");
    err = err ? err : sst_path_join(p.log, b->logs, file);
    err = err ? err : sst_path_join(out, b->out, name);
    if (err)
        return cli_exit_code(err);
    (void)unlink(p.log);
    if (again)
        sst_path_remove_temporaries_of(out);
    err = sst_outdir_open(&p.out, out, true);
    err = err ? err : sst_path_join(p.lf, p.out.temporary, CLI_BATCH_LIGHTFIELD);
    if (err)
        return cli_exit_code(err);
    code = b->write.lightfield
               ? run_commands(&p, piece)
               : cli_batch_run_in_memory(b, piece, &(struct cli_batch_place){ name, p.out.temporary, p.log });
    if (!code && !b->write.reports)
        code = cli_exit_code(cli_batch_keep_figures(p.out.temporary));
    if (code) {
        sst_outdir_abort(&p.out);
        return code;
    }
    return cli_exit_code(sst_outdir_commit(&p.out));
}
