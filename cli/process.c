/* sst process: labels and disparity for all views of a light field. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/claim.h"
#include "base/log.h"
#include "cli/cli_internal.h"
#include "cli/process_internal.h"
#include "cli/render_internal.h"
#include "cli/shard_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/kernels/sha256.h"
#include "pipeline/lightfield/external_maps.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/lightfield/parallax.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/method/disparity/device.h"
#include "pipeline/method/network/model_path.h"

/* --- work --------------------------------------------------------------------------------------------------------- */

/* Work on the light fields of the command line. */
struct job {
    struct cli_process p;
    const struct cli_shard *shard;
    char *const *dir; /* of the light fields */
    char **state;     /* of their claims */
    const char *text; /* of the job */
    bool split;       /* workers share views, not light fields */
    bool json;
};

/* A light field during the computation of its maps. */
struct computed {
    const struct job *job;
    struct cli_processed c;
};

#define STEPS     ".process-views"   /* folder of a light field: maps that workers exchange */
#define STATE     ".process"         /* folder of a light field: its claim by workers */
#define JSON_MOST ((size_t)64 << 20) /* bytes of a lightfield.json */

static void progress(void *arg SST_UNUSED, const char *stage, double done)
{
    cli_progress((void *)(uintptr_t)stage, done);
    if (done >= 1)
        cli_progress_end();
}

int cli_process_load(struct cli_processed *c, struct sst_share *share, unsigned what)
{
    const struct cli_process_wanted *w = &c->process->w;
    const int threads = c->process->cfg.threads;
    struct sst_lightfield json = { 0 };
    int err = sst_lightfield_load(&json, c->name, 0, threads);

    if (err)
        return err;
    what |= SST_LOAD_IMAGES | SST_LOAD_UNCORRECTED | (w->no_verify ? SST_LOAD_UNVERIFIED : 0);
    what |= json.files->external_labels && !w->labels_dir ? SST_LOAD_LABELS : 0;
    what |= json.files->external_disparity && !w->disparity_dir ? SST_LOAD_DISPARITY | SST_LOAD_CONFIDENCE : 0;
    sst_lightfield_fini(&json);
    err = sst_lightfield_shared_load(share, &c->lf, c->name, what, threads);
    if (!err && w->disparity_dir)
        err = sst_lightfield_read_disparity(&c->lf, w->disparity_dir, threads);
    if (!err && w->labels_dir)
        err = sst_lightfield_read_labels(&c->lf, w->labels_dir, threads);
    return err;
}

/* Compute the maps. */
static int compute(struct sst_lightfield *lf, struct sst_process_config *cfg, const char *hand_label,
                   struct sst_process_extras *extras, struct sst_process_report *report)
{
    struct sst_map_u8 truth = { 0 };
    int err = hand_label && cfg->model ? sst_map_u8_read_png(&truth, hand_label) : 0;

    cfg->hand_label = truth.data ? &truth : NULL;
    err = err ? err : sst_process(lf, cfg, extras, report);
    sst_map_u8_fini(&truth);
    return err;
}

int cli_process_describe(struct cli_processed *c)
{
    struct sst_process_report *report = &c->report;
    struct sst_lightfield *lf = &c->lf;
    double quality[SST_MAX_VIEWS];
    const int err = sst_lightfield_jpeg_quality(quality, lf, c->name);

    if (err)
        return err;
    sst_notice_jpeg_files(&report->notices, quality, lf->rows * lf->cols);
    sst_notice_describe(&report->notices, lf->rows, lf->cols);
    lf->files->judged = report->judgement.judged;
    lf->files->plausible = report->judgement.plausible;
    snprintf(lf->files->implausible, sizeof(lf->files->implausible), "%s", report->judgement.sentence);
    return 0;
}

/* Skips of the preset, unless the list says otherwise. */
static int read_skips(const struct cli_command *cmd, const char *list, struct sst_process_config *cfg)
{
    bool keys = cfg->disparity.key_spacing > 1 && !cfg->disparity.keys_in_texture;
    const struct cli_skip skips[] = { { "keys", &keys },
                                      { "ranges", &cfg->disparity.skip_ranges },
                                      { "hypotheses", &cfg->disparity.skip_hypotheses },
                                      { "labels", &cfg->skip_labels } };
    const int r = cli_read_skips(cmd, "skip", list, skips, ARRAY_LEN(skips));

    if (list) /* asked for, whatever the size */
        cfg->disparity.range_bytes = 0;
    if (list || keys) {
        cfg->disparity.key_spacing = keys ? 3 : 1;
        cfg->disparity.keys_in_texture = false;
    }
    return r;
}

int cli_process_open_devices(struct cli_process *p)
{
    int err = sst_runner_create(&p->device, p->w.device, (uint64_t)p->w.device_memory << 20);

    err = err ? err : sst_disparity_device_create(&p->cfg.disparity.runner, p->device);
    if (!err && ((!p->w.no_labels && !p->w.labels_dir) || p->cfg.disparity.cost & SST_COST_MCCNN))
        err = sst_network_device_open_on(&p->w.networks, p->device);
    p->cfg.networks = p->cfg.disparity.networks = p->w.networks;
    return err;
}

void cli_process_close_devices(struct cli_process *p)
{
    sst_network_device_close(p->w.networks);
    sst_disparity_device_destroy(p->cfg.disparity.runner);
    sst_runner_destroy(p->device);
}

int cli_process_compute(struct cli_processed *c, struct sst_share *share)
{
    const struct cli_process *p = c->process;
    const struct cli_process_wanted *w = &p->w;
    struct sst_lightfield_files *files = c->lf.files;
    struct sst_process_config cfg = p->cfg;
    char pspnet[SST_PATH_MAX];
    int err = 0;

    cfg.share = share;
    if (w->model || (!w->no_labels && !files->external_labels)) {
        err = w->model ? sst_model_resolve(pspnet, w->model) : sst_model_path(pspnet, "pspnet-small.onnx");
        if (!files->external_labels)
            cfg.model = pspnet;
    }
    if (!err) {
        snprintf(files->history, sizeof(files->history), "preset %s, labels %s, disparity %s", p->preset,
                 files->external_labels ? "given"
                 : w->no_labels         ? "none"
                                        : sst_path_base(cfg.model),
                 files->external_disparity ? "given" : "matched");
        cfg.keep_disparity = files->external_disparity;
        err = compute(&c->lf, &cfg, w->hand_label, &c->extras, &c->report);
    }
    cli_progress_end();
    return err;
}

void cli_processed_fini(struct cli_processed *c)
{
    sst_process_extras_fini(&c->extras);
    sst_lightfield_fini(&c->lf);
}

/* Store the maps and report. */
static int save(void *arg, int i SST_UNUSED, bool again)
{
    struct computed *computed = arg;
    struct cli_processed *c = &computed->c;
    const struct job *job = computed->job;
    struct sst_process_time clock = { 0, 0 }, saving;
    json_t *root = NULL;
    int err;

    if (again)
        sst_path_remove_temporaries(c->name);
    sst_process_lap(&clock);
    progress(NULL, "saving", 0.99);
    err = cli_process_describe(c);
    err = err ? err : sst_process_save(&c->lf, &c->extras, c->name, job->p.cfg.threads);
    saving = sst_process_lap(&clock);
    cli_progress_end();
    err = err ? err : cli_process_report(c, saving, job->json ? &root : NULL);
    if (root && job->p.w.several)
        json_object_set_new(root, "lightfield", cli_text_json(c->name));
    if (root && cli_dump_json(root, (job->p.w.several ? JSON_COMPACT : JSON_INDENT(2)) | JSON_REAL_PRECISION(6)))
        err = -ENOMEM;
    return cli_exit_code(err);
}

/* Of the workers that share the views, one saves. */
static int save_once(struct computed *c, int i)
{
    char *const *state = &c->job->state[i];
    const struct cli_pieces piece = { 1, &c->job->dir[i], state, c->job->text, save, c };

    return cli_shard_run(c->job->shard, &piece);
}

static int process_one(void *arg, int i, bool again)
{
    const struct job *job = arg;
    struct computed computed = { job, { .process = &job->p, .name = job->dir[i] } };
    struct cli_processed *c = &computed.c;
    struct sst_share *share = job->p.cfg.share;
    struct sst_process_time clock = { 0, 0 };
    int err, code;

    if (again)
        sst_path_remove_temporaries(c->name);
    sst_process_lap(&clock);
    err = cli_process_load(c, share, 0);
    c->load = sst_process_lap(&clock);
    err = err ? err : cli_process_compute(c, share);
    code = err ? cli_exit_code(err) : job->split ? save_once(&computed, i) : save(&computed, i, false);
    cli_processed_fini(c);
    return code;
}

static bool is_done(const struct job *job, int i)
{
    struct sst_claim_info info;

    return !sst_claim_look(&info, job->state[i]) && info.state == SST_CLAIM_DONE && !strcmp(info.job, job->text);
}

/* Meet the other workers in a folder. They share the work on these pictures: results left for other pictures are
 * computed again. @param steps  out, the folder */
static int meet(struct job *job, int i, char steps[SST_PATH_MAX])
{
    const struct cli_shard *shard = job->shard;
    char path[SST_PATH_MAX], text[SST_CLAIM_JOB], sha256[65];
    struct sst_lightfield json;
    uint8_t *data = NULL;
    size_t size;
    int err = sst_lightfield_load(&json, job->dir[i], 0, 1);

    if (err)
        return err;
    sst_lightfield_fini(&json);
    err = sst_path_join(path, job->dir[i], "lightfield.json");
    err = err ? err : sst_file_read(path, JSON_MOST, &data, &size);
    if (err)
        return err;
    sst_sha256_hex(sha256, data, size);
    free(data);
    snprintf(text, sizeof(text), "%.16s %.*s", sha256, (int)sizeof(text) - 18, job->text);
    err = sst_path_join(steps, job->dir[i], STEPS);
    return err ? err
               : sst_share_open(&job->p.cfg.share,
                                &(struct sst_share_config){ .dir = steps,
                                                            .job = text,
                                                            .index = shard->index,
                                                            .count = shard->count,
                                                            .lease_ms = (int)(shard->lease_s * 1000) });
}

/* Take the folder for this process alone; workers that share it wait. The lock goes with the process, whatever ends it.
 * Where folders cannot be locked, as on network file systems, nothing is kept apart.
 * @param fd  out, to be closed by the caller; -1: none @return 0, -EBUSY (logged) */
static int lock_folder(int *fd, const char *dir, bool shared)
{
    *fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (*fd < 0 || !flock(*fd, shared ? LOCK_SH : LOCK_EX | LOCK_NB) || errno != EWOULDBLOCK)
        return 0;
    close(*fd);
    *fd = -1;
    sst_log_error("%s: another process works on it; wait for its end, or share the work with --shard", dir);
    return -EBUSY;
}

static int process_locked(void *arg, int i, bool again)
{
    const struct job *job = arg;
    int fd, code = cli_exit_code(lock_folder(&fd, job->dir[i], job->shard->count));

    if (code)
        return code;
    if (!job->shard->count)
        sst_path_remove_tree(job->state[i]); /* of shared work, which this replaces */
    code = process_one(arg, i, again);
    if (fd >= 0)
        close(fd);
    return code;
}

/* With the other workers, view by view. Exchanged files are removed at the end. */
static int process_together(struct job *job, int i)
{
    char steps[SST_PATH_MAX], said[SST_LOG_MAX];
    int code;

    if (is_done(job, i))
        return CLI_OK;
    code = cli_exit_code(meet(job, i, steps));
    if (code)
        return code;
    sst_log_hold_errors(said);
    said[0] = 0;
    code = process_locked(job, i, false);
    sst_log_hold_errors(NULL);
    if (code && is_done(job, i)) /* the others have ended, and removed the files to read */
        code = CLI_OK;
    if (code && said[0])
        sst_log_error("%s", said);
    if (!code)
        sst_path_remove_tree(steps);
    sst_share_close(job->p.cfg.share);
    job->p.cfg.share = NULL;
    return code;
}

/* One after the other; one that fails does not keep the others from being processed. @return the first exit code */
static int process_all(struct job *job, int count)
{
    int code = CLI_OK;

    for (int i = 0; i < count; i++) {
        const int r = job->split ? process_together(job, i) : process_locked(job, i, false);

        code = code ? code : r;
    }
    return code;
}

static void free_names(char **name, int count)
{
    for (int i = 0; name && i < count; i++)
        free(name[i]);
    free(name);
}

/* Process the light fields of the command line, shared with other processes or alone. */
static int process_listed(struct job *job, int count)
{
    const struct cli_shard *shard = job->shard;
    char path[SST_PATH_MAX];
    int r;

    job->state = calloc((size_t)count, sizeof(*job->state));
    r = job->state ? CLI_OK : CLI_MEMORY;
    for (int i = 0; !r && i < count; i++) {
        r = cli_exit_code(sst_path_join(path, job->dir[i], STATE));
        job->state[i] = r ? NULL : strdup(path);
        r = r || job->state[i] ? r : CLI_MEMORY;
    }
    job->p.w.several = count > 1;
    if (!r) {
        const struct cli_pieces pieces = { count, job->dir, job->state, job->text, process_locked, job };

        r = shard->status                 ? cli_shard_status(&pieces, job->json)
            : shard->count && !job->split ? cli_shard_run(shard, &pieces)
                                          : process_all(job, count);
    }
    free_names(job->state, count);
    return r;
}

int cli_process_configure(const struct cli_command *cmd, struct cli_process *p, const struct cli_matching *m)
{
    struct sst_process_config *cfg = &p->cfg;
    struct cli_process_wanted *w = &p->w;
    int r;

    w->correct = cfg->align = !w->unaligned;
    r = cli_exit_code(cli_matching_config(&cfg->disparity, m, p->mccnn));
    if (r)
        return r;
    r = read_skips(cmd, w->skip, cfg);
    if (r != CLI_GO_ON)
        return r;
    sst_refine_config_defaults(&cfg->refinement);
    cfg->progress = progress;
    cfg->threads = cfg->disparity.threads;
    cfg->precision = cfg->disparity.precision;
    cfg->disparity.memory = (size_t)w->memory << 20;
    cfg->disparity.disp_min_px = isnan(w->range_min) ? 0 : w->range_min;
    cfg->disparity.disp_max_px = isnan(w->range_max) ? 0 : w->range_max;
    p->preset = m->preset;
    return CLI_GO_ON;
}

static int check_options(const struct cli_command *cmd, const struct job *job)
{
    const struct cli_process_wanted *w = &job->p.w;

    if (isnan(w->range_min) != isnan(w->range_max) || isgreaterequal(w->range_min, w->range_max))
        return cli_usage_error(cmd, "--range-min and --range-max must be given together, --range-min smaller");
    if (w->no_labels && (w->model || w->labels_dir || w->hand_label))
        return cli_usage_error(cmd, "--no-labels and --%s contradict each other",
                               w->model        ? "model"
                               : w->labels_dir ? "labels"
                                               : "hand-label");
    if (job->split && !job->shard->count)
        return cli_usage_error(cmd, "--split-views belongs to --shard");
    return CLI_GO_ON;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct cli_shard shard = CLI_SHARD_DEFAULTS;
    struct job job = { .p = CLI_PROCESS_DEFAULTS, .shard = &shard };
    struct cli_matching m = CLI_MATCHING_DEFAULTS;
    bool no_refine = false;
    const struct cli_option options[] = {
        CLI_MATCHING_OPTIONS(m),
        { "range-min", 0, CLI_DOUBLE, &job.p.w.range_min, "PX",
          "smallest disparity searched; default: the light field's, else estimated", -9999, 9999 },
        { "range-max", 0, CLI_DOUBLE, &job.p.w.range_max, "PX", "largest disparity searched", -9999, 9999 },
        { "labels", 0, CLI_STRING, &job.p.w.labels_dir, "DIR", "external label maps rr_cc.png, never recomputed" },
        { "disparity", 0, CLI_STRING, &job.p.w.disparity_dir, "DIR",
          "external disparities rr_cc.pfm, never recomputed" },
        { "model", 0, CLI_STRING, &job.p.w.model, "NAME", "segmentation network: an installed one or an ONNX file" },
        CLI_NO_VERIFY_OPTION(job.p.w.no_verify),
        { "no-labels", 0, CLI_FLAG, &job.p.w.no_labels, NULL, "disparity only" },
        { "epsilon-h", 0, CLI_DOUBLE, &job.p.cfg.eps_h, "V", "entropy threshold; default: the model's", 0, 1e9 },
        { "hand-label", 0, CLI_STRING, &job.p.w.hand_label, "FILE",
          "hand labels of the reference view, to optimise the threshold" },
        { "no-refine", 0, CLI_FLAG, &no_refine, NULL, "leave unlabeled rays unlabeled" },
        { "skip", 0, CLI_STRING, &job.p.w.skip, "LIST",
          "computations to do in part only: keys, ranges, hypotheses, labels, all or none" },
        { "align", 0, CLI_WORD, &job.p.w.unaligned, "WHEN",
          "auto: pictures that are displaced or have other gains are corrected; off: not", 0, 0, "auto off" },
        { "device", 0, CLI_STRING, &job.p.w.device, "D",
          "where views are labelled and matched: cpu (default), gpu, auto (gpu if there is one) or a part of "
          "a name" },
        { "device-memory", 0, CLI_INT, &job.p.w.device_memory, "MIB", CLI_DEVICE_MEMORY_HELP, 1, 1 << 24 },
        { "memory", 0, CLI_INT, &job.p.w.memory, "MIB",
          "memory of cost volumes and of the census of views that are matched: views that need more wait, one is "
          "matched "
          "always (default: 1536; 6144 where threads share no volume), and of a sweep's planes: scenes that need more "
          "are matched view by view (3072)",
          1, 1 << 24 },
        { "json", 0, CLI_FLAG, &job.json, NULL, "print one JSON object; of several light fields a line each" },
        CLI_SHARD_OPTIONS(shard),
        { "split-views", 0, CLI_FLAG, &job.split, NULL,
          "with --shard: workers share the views of each light field: for few large ones" },
    };
    static const char *const same[] = { CLI_SHARD_NAMES, "split-views",   "threads", "json",
                                        "device",        "device-memory", NULL };
    const char **dirs = calloc((size_t)argc, sizeof(*dirs));
    char text[SST_CLAIM_JOB];
    int count = 0, r = dirs ? cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, dirs, 1, argc) : CLI_MEMORY;

    if (r == CLI_GO_ON)
        r = cli_shard_read(cmd, &shard);
    if (r == CLI_GO_ON)
        r = check_options(cmd, &job);
    if (r == CLI_GO_ON)
        r = cli_process_configure(cmd, &job.p, &m);
    if (r == CLI_GO_ON) {
        cli_shard_job(text, sizeof(text), cmd, options, ARRAY_LEN(options), same);
        job.p.cfg.refine = !no_refine;
        while (count < argc && dirs[count])
            count++;
        job.dir = (char *const *)(uintptr_t)dirs;
        job.text = text;
        if (!shard.status)
            r = cli_exit_code(cli_process_open_devices(&job.p));
        r = r == CLI_GO_ON || r == CLI_OK ? process_listed(&job, count) : r;
        cli_process_close_devices(&job.p);
    }
    free(dirs);
    return r;
}

const struct cli_command cli_process = { "process", run };
