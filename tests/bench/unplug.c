/* Unplug and replug simulated cameras at random, several at once, while the others stream: how long until each is back,
 * and does any other camera lose a frame? usage: build/bench/unplug [EVENTS [SEED]]   (1000 events take some minutes)
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "base/log.h"
#include "base/stats.h"
#include "simulators/scene/noise.h"
#include "tests/grab_rig.h"

#define CAMERAS   36
#define AWAY_MAX  6
#define TARGET_MS 2000

struct trial {
    struct rig rig;
    uint64_t seed;
    int64_t plugged_ns[CAMERAS]; /* 0: not waited for */
    bool away[CAMERAS];
    uint64_t lost_before[CAMERAS], bad_before[CAMERAS];
    int64_t *times_ns;
    int events, recovered, late;
    uint64_t harm_lost, harm_bad;
    int64_t polled_ns, pause_ns; /* longest time in which this program did not poll */
};

static int count_away(const struct trial *t)
{
    int n = 0;

    for (int i = 0; i < CAMERAS; i++)
        n += t->away[i];
    return n;
}

/* Frames lost by cameras that nobody touched: a camera's own losses end with its counting anew. */
static void take_harm(struct trial *t, int cam, bool touched)
{
    struct sst_grab_counters c;

    sst_grab_counters(t->rig.grab, cam, &c);
    if (!touched && c.lost > t->lost_before[cam])
        fprintf(stderr, "event %d: camera %d lost %d\n", t->events, cam, (int)(c.lost - t->lost_before[cam]));
    if (!touched) {
        t->harm_lost += c.lost - t->lost_before[cam];
        t->harm_bad += c.bad - t->bad_before[cam];
    }
    t->lost_before[cam] = c.lost;
    t->bad_before[cam] = c.bad;
}

static void watch(struct trial *t, int ms)
{
    const int64_t end_ns = sst_clock_now_ns() + ms * RIG_MS;
    int64_t now_ns;

    while ((now_ns = sst_clock_now_ns()) < end_ns && !sst_grab_poll(t->rig.grab, 5)) {
        if (t->polled_ns && now_ns - t->polled_ns > t->pause_ns)
            t->pause_ns = now_ns - t->polled_ns;
        t->polled_ns = now_ns;
        for (int i = 0; i < CAMERAS; i++) {
            const int64_t back_ns = t->rig.cam[i].back_ns;

            if (!t->plugged_ns[i] || back_ns < t->plugged_ns[i])
                continue;
            t->times_ns[t->recovered++] = back_ns - t->plugged_ns[i];
            t->plugged_ns[i] = 0;
        }
    }
}

static int event(struct trial *t)
{
    const int away = count_away(t), cam = (int)(sst_random_u64(&t->seed) % CAMERAS);
    bool plug_in = t->away[cam];

    if (!plug_in && (away >= AWAY_MAX || t->plugged_ns[cam]))
        return 0;
    for (int i = 0; i < CAMERAS; i++)
        take_harm(t, i, t->away[i] || t->plugged_ns[i] || i == cam);
    if (plug_in) {
        /* The camera may not have noticed yet that it was away. */
        t->rig.cam[cam].back_ns = 0;
        t->plugged_ns[cam] = sst_clock_now_ns();
    }
    if (rig_fault(plug_in ? "camera.%d.unplug=0" : "camera.%d.unplug=1", cam))
        return -1;
    t->away[cam] = !plug_in;
    t->events += plug_in;
    return 0;
}

static int report(struct trial *t)
{
    const int n = t->recovered;

    sst_stats_sort_int64(t->times_ns, n);
    for (int i = 0; i < n; i++)
        t->late += t->times_ns[i] > TARGET_MS * RIG_MS;
    printf("%d replugs, %d came back; ms until the first frame: p50 %.0f, p99 %.0f, max %.0f; over %d ms: %d\n",
           t->events, n, n ? (double)t->times_ns[n / 2] * 1e-6 : 0,
           n ? (double)t->times_ns[(n * 99 - 1) / 100] * 1e-6 : 0, n ? (double)t->times_ns[n - 1] * 1e-6 : 0, TARGET_MS,
           t->late);
    printf("frames of the other cameras: %llu lost, %llu bad; longest pause between two polls %.0f ms\n",
           (unsigned long long)t->harm_lost, (unsigned long long)t->harm_bad, (double)t->pause_ns * 1e-6);
    return n == t->events && !t->late && !t->harm_lost && !t->harm_bad ? 0 : 1;
}

int main(int argc, char **argv)
{
    static struct trial t;
    int wanted = argc > 1 ? atoi(argv[1]) : 1000, streaming;

    rig_enter_session(argv, "pedestrian");
    sst_log_set_level(SST_LOG_ERROR);
    t.seed = argc > 2 ? strtoull(argv[2], NULL, 0) : 1;
    t.times_ns = calloc((size_t)wanted + 1, sizeof(*t.times_ns));
    if (!t.times_ns || rig_config(&t.rig, CAMERAS))
        return 1;
    t.rig.cfg.buffers = 8; /* as sstd.yaml has it */
    streaming = rig_start(&t.rig);
    if (streaming != CAMERAS) {
        fprintf(stderr, "%d of %d cameras stream\n", streaming, CAMERAS);
        return 1;
    }
    watch(&t, 1000);
    while (t.events < wanted) {
        if (event(&t))
            return 1;
        watch(&t, 20 + (int)(sst_random_u64(&t.seed) % 300));
        if (isatty(STDERR_FILENO))
            fprintf(stderr, "\r%d of %d ", t.events, wanted);
    }
    watch(&t, 5000);
    streaming = report(&t);
    rig_stop(&t.rig);
    free(t.times_ns);
    return streaming;
}
