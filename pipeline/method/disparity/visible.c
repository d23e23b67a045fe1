/*
 * The second pass (design.md, 5.7). The first one compares windows, which at a gap between leaves hold more leaf than
 * gap: its maps let thin things grow and close what is between them. Here each pixel has a few hypotheses, the surfaces
 * around it, those that other views project onto it and those that a sweep finds (around.c), and each hypothesis is
 * tested pixel by pixel against the views around, of which those count in which nothing nearer hides it. What the
 * colours cannot decide, the semi-global optimisation over the hypotheses does.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "pipeline/method/disparity/visible_internal.h"

static void add_counted(struct visible_pass *p, int k)
{
    p->all.hypotheses += p->counted[k].hypotheses;
    p->all.skipped += p->counted[k].skipped;
    p->all.samples += p->counted[k].samples;
    p->all.changed += p->counted[k].changed;
    p->counted[k] = (struct visible_counted){ 0 };
}

static void report_skipped(const struct visible_pass *p)
{
    struct sst_disparity_report *report = p->in->report;

    if (report && p->all.hypotheses)
        report->hypotheses_skipped = 100 * (double)p->all.skipped / (double)p->all.hypotheses;
    if (report && p->all.samples)
        report->hypotheses_error = 100 * (double)p->all.changed / (double)p->all.samples;
}

void visible_adopt(const struct sst_visible_views *in)
{
    size_t n = 0;

    for (int k = 0; k < in->count; k++)
        n = in->view[k].image ? (size_t)in->view[k].disp->width * (size_t)in->view[k].disp->height : n;
    sst_run_adopt(in->runner, in, in->count, n);
}

static int one_round(struct visible_pass *p)
{
    const struct sst_visible_views *in = p->in;
    const int err = visible_test(p, in->runner);

    for (int k = 0; k < in->count; k++) {
        if (!err && p->out[k].data) {
            memcpy(in->view[k].disp->data, p->out[k].data, p->out[k].stride * (size_t)p->out[k].height);
            memcpy(in->view[k].confidence->data, p->confidence[k].data,
                   p->confidence[k].stride * (size_t)p->confidence[k].height);
        }
        sst_map_u16_fini(&p->out[k]);
        sst_map_u8_fini(&p->confidence[k]);
        add_counted(p, k);
    }
    return err;
}

/* Rounds over maps of which the depth codes tell. */
static int all_rounds(struct visible_pass *p, int rounds)
{
    int err = 0;

    visible_adopt(p->in);
    for (int i = 0; !err && i < rounds; i++) {
        err = i ? visible_pass_code(p) : 0;
        err = err ? err : one_round(p);
    }
    return err;
}

int sst_disparity_visible(const struct sst_visible_views *in, int rounds, int threads)
{
    struct visible_pass p = { .in = in, .threads = threads };
    int err = visible_pass_init(&p);

    visible_adopt(in);
    err = err ? err : visible_sweep(&p, in->runner);
    err = err ? err : all_rounds(&p, rounds);
    if (!err)
        report_skipped(&p);
    visible_pass_fini(&p);
    return err;
}

int sst_disparity_repair(struct sst_visible_views *in, struct sst_map_u8 *agreed, bool carry, int rounds, int threads)
{
    struct visible_pass p = { .in = in, .threads = threads };
    int err = carry ? sst_disparity_carry(in, NULL, threads) : 0;

    err = err ? err : visible_pass_init(&p);
    visible_adopt(in);
    err = err ? err : visible_sweep(&p, in->runner);
    err = err ? err : all_rounds(&p, rounds);
    for (int k = 0; k < in->count; k++)
        in->view[k].agreed = &agreed[k];
    err = err || !carry ? err : sst_disparity_carry(in, NULL, threads);
    err = err ? err : visible_pass_code(&p);
    in->repair = true;
    err = err ? err : all_rounds(&p, rounds);
    if (!err)
        report_skipped(&p);
    visible_pass_fini(&p);
    return err;
}
