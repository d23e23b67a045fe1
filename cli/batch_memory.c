/* Pieces of a campaign in memory: from the frames of a set, or the views of a folder, to the pictures asked for. The
 * device, the networks and the recording stay open from piece to piece. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "capture/recording/lightfields.h"
#include "cli/cli_internal.h"
#include "cli/process_internal.h"
#include "cli/render_internal.h"
#include "cli/shard_internal.h"
#include "pipeline/method/labels/labels.h"

struct cli_batch_memory {
    struct cli_process process;
    struct sst_use_calibration use;
    const struct sst_use_calibration *calibration; /* NULL: none */
    struct sst_recording *recording;               /* the last one */
};

struct piece {
    const struct cli_batch *b;
    const char *dir; /* that gets the results */
    struct cli_processed c;
    char error[SST_LOG_MAX]; /* the last one; "": none */
};

static bool needs_labels(const struct cli_batch *b)
{
    return !b->no_labels && (b->write.see_through || b->write.sweep || b->write.reports);
}

static int open_memory(struct cli_batch_memory *m, const struct cli_batch *b)
{
    struct cli_matching matching = CLI_MATCHING_DEFAULTS;
    struct cli_process *p = &m->process;
    int r;

    *p = (struct cli_process)CLI_PROCESS_DEFAULTS;
    p->w.device = b->device;
    p->w.device_memory = b->device_memory;
    p->w.no_labels = !needs_labels(b);
    p->w.model = p->w.no_labels ? NULL : b->model;
    matching.preset = b->preset;
    matching.threads = b->threads;
    r = cli_process_configure(&cli_batch, p, &matching);
    sst_use_calibration_defaults(&m->use);
    if (r == CLI_GO_ON && b->calib) {
        r = cli_use_calibration(&m->use, &cli_batch, b->calib, "bicubic");
        m->calibration = r == CLI_GO_ON ? &m->use : NULL;
    }
    if (r != CLI_GO_ON)
        return r;
    p->cfg.segmenters = calloc((size_t)p->cfg.threads, sizeof(*p->cfg.segmenters));
    return p->cfg.segmenters ? cli_exit_code(cli_process_open_devices(p)) : CLI_MEMORY;
}

void cli_batch_memory_close(struct cli_batch_memory *m)
{
    if (!m)
        return;
    for (int i = 0; m->process.cfg.segmenters && i < m->process.cfg.threads; i++)
        sst_segmenter_close(m->process.cfg.segmenters[i]);
    free(m->process.cfg.segmenters);
    cli_process_close_devices(&m->process);
    sst_use_calibration_fini(&m->use);
    sst_recording_close(m->recording);
    free(m);
}

static int open_recording(struct cli_batch_memory *m, const char *source)
{
    if (m->recording && !strcmp(sst_recording_dir(m->recording), source))
        return 0;
    sst_recording_close(m->recording);
    m->recording = NULL;
    return sst_recording_open(&m->recording, source);
}

static int load(struct piece *p, struct cli_batch_memory *m, const struct cli_batch_piece *from)
{
    int err;

    if (from->set < 0)
        return cli_process_load(&p->c, NULL, SST_LOAD_SOURCES);
    err = open_recording(m, from->source);
    return err ? err
               : sst_recording_to_memory(&p->c.lf, m->recording,
                                         &(struct sst_lightfields_config){ .out = p->c.name,
                                                                           .sets = &from->set,
                                                                           .count = 1,
                                                                           .allow_partial = true,
                                                                           .calibration = m->calibration,
                                                                           .threads = p->b->threads });
}

static int write_report(const struct piece *p, json_t *report, const char *name)
{
    const int err = cli_write_json(report, p->dir, name);

    json_decref(report);
    return err;
}

static int process(struct piece *p, struct cli_batch_memory *m, const struct cli_batch_piece *from)
{
    struct sst_process_time clock = { 0, 0 };
    json_t *report = NULL;
    int err;

    sst_process_lap(&clock);
    err = load(p, m, from);
    p->c.load = sst_process_lap(&clock);
    err = err ? err : cli_process_compute(&p->c, NULL);
    err = err ? err : sst_lightfield_settle(&p->c.lf, p->b->threads);
    err = err ? err : cli_process_describe(&p->c);
    err = err ? err : cli_process_report(&p->c, (struct sst_process_time){ 0, 0 }, &report);
    err = err ? err : write_report(p, report, "process.json");
    return cli_exit_code(err);
}

static struct render_loaded loaded(const struct piece *p)
{
    return (struct render_loaded){ p->c.name, &p->c.lf, p->c.process->device };
}

static void picture_options(const struct piece *p, struct render_args *a, enum sst_render_method method)
{
    struct cli_option options[RENDER_OPTIONS]; /* for their defaults */

    cli_render_options(options, a);
    a->cfg.method = method;
    a->cfg.focus_px = NAN;
    a->cfg.threads = p->b->threads;
    a->device = p->b->device;
}

/* A picture and its report, NAME.png and NAME.json. */
static int render(const struct piece *p, enum sst_render_method method, const char *name)
{
    const struct render_loaded l = loaded(p);
    char picture[SST_PATH_MAX], file[32];
    struct render_args a;
    json_t *report = NULL;
    int code;

    picture_options(p, &a, method);
    snprintf(file, sizeof(file), "%s.png", name);
    code = cli_exit_code(sst_path_join(picture, p->dir, file));
    code = code ? code : cli_render_loaded(&l, &a, picture, &report);
    snprintf(file, sizeof(file), "%s.json", name);
    return code ? code : cli_exit_code(write_report(p, report, file));
}

/* A picture without the foreground, where there is one. */
static int render_clear(const struct piece *p)
{
    const int code = render(p, SST_RENDER_CLEAR, "clear");

    if (code != CLI_INPUT)
        return code;
    sst_log_warning("%s: no clear picture: %s", p->c.name, p->error);
    return CLI_OK;
}

static int sweep(const struct piece *p)
{
    const struct render_loaded l = loaded(p);
    char path[SST_PATH_MAX];
    struct render_args a;
    const int code = cli_exit_code(sst_path_join(path, p->dir, CLI_BATCH_SWEEP));

    picture_options(p, &a, SST_RENDER_SST);
    return code || !p->b->steps ? code : cli_sweep_loaded(&l, &a, path, p->b->steps);
}

static int run(struct piece *p, struct cli_batch_memory *m, const struct cli_batch_piece *from)
{
    const struct cli_batch_written *w = &p->b->write;
    int code = process(p, m, from);

    code = code || !w->clear ? code : render_clear(p);
    code = code || !w->see_through ? code : render(p, SST_RENDER_SST, "see-through");
    return code || !w->sweep ? code : sweep(p);
}

/* Let messages go to a log. @return the descriptor for log_end(), or -errno */
static int log_begin(const char *log)
{
    const int fd = open(log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    int before = fd < 0 ? -errno : fcntl(2, F_DUPFD_CLOEXEC, 3);

    fflush(stderr);
    if (fd >= 0 && (before < 0 || dup2(fd, 2) < 0))
        before = -errno;
    if (fd >= 0)
        close(fd);
    return before;
}

static void log_end(int before)
{
    fflush(stderr);
    dup2(before, 2);
    close(before);
}

int cli_batch_run_in_memory(struct cli_batch *b, const struct cli_batch_piece *from, const struct cli_batch_place *place)
{
    struct piece p = { .b = b, .dir = place->dir };
    char *held;
    const int before = log_begin(place->log);
    int code = CLI_OK;

    if (before < 0) {
        sst_log_error("cannot write %s: %s", place->log, strerror(-before));
        return CLI_OUTPUT;
    }
    held = sst_log_hold_errors(p.error);
    if (!b->memory) {
        b->memory = calloc(1, sizeof(*b->memory));
        code = b->memory ? open_memory(b->memory, b) : CLI_MEMORY;
        if (code) { /* the next piece begins again */
            cli_batch_memory_close(b->memory);
            b->memory = NULL;
        }
    }
    if (!code) {
        p.c.process = &b->memory->process;
        p.c.name = from->set < 0 ? from->source : place->name;
        code = run(&p, b->memory, from);
        cli_processed_fini(&p.c);
    }
    sst_log_hold_errors(held);
    if (code)
        fprintf(stderr, "sst: error: %s\n", p.error);
    log_end(before);
    if (code)
        sst_log_error("%s: %s", place->name, p.error[0] ? p.error : "it failed without a message");
    return code;
}
