/* sst calibrate --live: recording, status lines and coverage picture of a run; Ctrl-C ends it. */
#include <signal.h>
#include <stdio.h>

#include "cli/cli_internal.h"

struct live {
    struct sst_recorder *recorder; /* NULL: not recorded */
    const char *coverage;          /* picture to update, or NULL */
    int drawn;                     /* frames in it */
};

static struct sst_gather_live *running;

static void on_signal(int sig)
{
    (void)sig;
    if (running)
        sst_gather_live_stop(running);
}

static int on_frameset(void *arg, const struct sst_frameset *set)
{
    struct live *l = arg;

    return l->recorder ? sst_recorder_write(l->recorder, set) : 0;
}

static int on_status(void *arg, const struct sst_gather_status *s)
{
    struct live *l = arg;

    if (!s->accepted) {
        fprintf(stderr, "%d sets, and no camera has seen the board yet\n", s->framesets);
        return 0;
    }
    fprintf(stderr, "%d of %d sets accepted, coverage %.0f %%; camera %d,%d (%s) lacks most: %s\n", s->accepted,
            s->framesets, 100 * s->coverage, s->row, s->col, s->camera, s->missing[0] ? s->missing : "nothing");
    if (!l->coverage || l->drawn == s->accepted)
        return 0;
    l->drawn = s->accepted;
    return sst_gather_write_coverage(s->all, l->coverage);
}

int cli_calibrate_live(struct sst_gathered *out, int **frameset, const struct sst_gather_config *cfg,
                       struct sst_gather_live_config *config, const char *record, const char *coverage)
{
    struct live l = { .coverage = coverage };
    const struct sigaction act = { .sa_handler = on_signal };
    struct sst_gather_live *live = NULL;
    struct sst_recorder_config rec;
    struct sigaction old[2];
    int err, closed;

    config->frameset = on_frameset;
    config->status = on_status;
    config->arg = &l;
    err = sst_gather_live_open(&live, cfg, config);
    if (!err && record) {
        sst_recorder_config_defaults(&rec);
        rec.dir = record;
        err = cli_open_recorder(&l.recorder, config->array, &rec);
    }
    if (!err) {
        running = live;
        sigaction(SIGINT, &act, &old[0]);
        sigaction(SIGTERM, &act, &old[1]);
        err = sst_gather_live_run(live, out, frameset);
        sigaction(SIGINT, &old[0], NULL);
        sigaction(SIGTERM, &old[1], NULL);
        running = NULL;
    }
    sst_gather_live_close(live);
    closed = sst_recorder_close(l.recorder);
    return err ? err : closed;
}
