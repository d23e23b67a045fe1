/* tests/quick.h - what has to be quick, on machines that are busy with other things too, or stand still for a while. */
#ifndef SST_TESTS_QUICK_H
#define SST_TESTS_QUICK_H

#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "base/base.h"
#include "base/clock.h"

#define QUICK_BEAT_NS    INT64_C(20000000)
#define QUICK_STILL_NS   INT64_C(100000000)
#define QUICK_PROCESSORS 16
#define QUICK_STILLS     1024
#define QUICK_LOADS      8192 /* beats: nearly three minutes */

struct quick_span {
    int64_t from_ns, to_ns;
};

/** A process beside the test, on one processor, that has next to nothing to do, and the times at which it could not do
 *  even that. A virtual machine can lose one of its processors for a while, with what runs there, and not the others.
 */
static struct quick_beat {
    _Atomic int64_t last_ns;
    _Atomic int n;
    struct quick_span still[QUICK_STILLS];
    /* The first one also looks how many threads of the whole machine want to run. */
    _Atomic uint32_t loads;
    struct {
        int64_t t_ns;
        int runnable;
    } load[QUICK_LOADS];
} * quick_beat;
static int quick_beats;

/** How many threads want to run, without the one that asks; 0 if it cannot be told. */
static inline int quick_runnable(void)
{
    FILE *f = fopen("/proc/loadavg", "re");
    int n = 0;

    if (f && fscanf(f, "%*s %*s %*s %d/", &n) != 1)
        n = 0;
    if (f)
        fclose(f);
    return n > 0 ? n - 1 : 0;
}

static inline void quick_watch(struct quick_beat *b, bool first, pid_t parent)
{
    int64_t now_ns, last_ns = b->last_ns;

    prctl(PR_SET_PDEATHSIG, SIGKILL);
    closefrom(0); /* nobody waits for the end of what this holds, too */
    while (getppid() == parent) {
        nanosleep(&(struct timespec){ .tv_nsec = QUICK_BEAT_NS }, NULL);
        now_ns = sst_clock_now_ns();
        if (now_ns - last_ns > QUICK_STILL_NS && b->n < QUICK_STILLS) {
            b->still[b->n] = (struct quick_span){ last_ns, now_ns };
            b->n++;
        }
        if (first) {
            b->load[b->loads % QUICK_LOADS].t_ns = now_ns;
            b->load[b->loads % QUICK_LOADS].runnable = quick_runnable();
            b->loads++;
        }
        b->last_ns = last_ns = now_ns;
    }
    _exit(0);
}

/* Before main(), while there are no threads; they go with the thread that called, the first. */
__attribute__((constructor)) static void quick_begin(void)
{
    struct quick_beat *b = (struct quick_beat *)mmap(NULL, QUICK_PROCESSORS * sizeof(*b), PROT_READ | PROT_WRITE,
                                                     MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    unsigned long all[32] = { 0 };
    const int bits = 8 * (int)sizeof(all[0]);
    const pid_t parent = getpid();

    if (b == MAP_FAILED)
        abort();
    quick_beat = b;
    if (syscall(SYS_sched_getaffinity, 0, sizeof(all), all) <= 0)
        all[0] = 1;
    for (int cpu = 0; cpu < (int)ARRAY_LEN(all) * bits && quick_beats < QUICK_PROCESSORS; cpu++) {
        unsigned long one[ARRAY_LEN(all)] = { 0 };
        pid_t child;

        if (!(all[cpu / bits] >> (cpu % bits) & 1))
            continue;
        b->last_ns = sst_clock_now_ns();
        child = fork();
        if (!child) {
            one[cpu / bits] = 1ul << (cpu % bits);
            (void)!syscall(SYS_sched_setaffinity, 0, sizeof(one), one);
            quick_watch(b, !quick_beats, parent);
        }
        if (child > 0) {
            b++;
            quick_beats++;
        }
    }
}

/** For how long the machine, or one of its processors, stood still between two moments, as far as processes that want
 *  nothing could tell. */
static inline int64_t quick_stood_still(int64_t from_ns, int64_t to_ns)
{
    int64_t sum_ns = 0, next_ns;

    for (int i = 0; i < 500; i++) {
        int behind = 0;

        for (int k = 0; k < quick_beats; k++)
            behind += quick_beat[k].last_ns < to_ns;
        if (!behind)
            break;
        nanosleep(&(struct timespec){ .tv_nsec = QUICK_BEAT_NS }, NULL);
    }
    /* What several of them saw counts once. */
    for (int64_t t_ns = from_ns; t_ns < to_ns; t_ns = next_ns) {
        bool still = false;

        next_ns = to_ns;
        for (int k = 0; k < quick_beats; k++) {
            for (int i = 0; i < quick_beat[k].n; i++) {
                const struct quick_span *s = &quick_beat[k].still[i];

                if (s->from_ns > t_ns && s->from_ns < next_ns)
                    next_ns = s->from_ns;
                if (s->to_ns > t_ns && s->to_ns < next_ns)
                    next_ns = s->to_ns;
                still |= s->from_ns <= t_ns && s->to_ns > t_ns;
            }
        }
        sum_ns += still ? next_ns - t_ns : 0;
    }
    return sum_ns;
}

/** How many threads wanted to run on each processor between two moments, on average; at least 1. */
static inline double quick_load(int64_t from_ns, int64_t to_ns)
{
    const long processors = sysconf(_SC_NPROCESSORS_ONLN);
    double sum = 0;
    int n = 0;

    for (int i = 0; i < QUICK_LOADS && i < (int)quick_beat->loads; i++) {
        if (quick_beat->load[i].t_ns >= from_ns && quick_beat->load[i].t_ns <= to_ns) {
            sum += quick_beat->load[i].runnable;
            n++;
        }
    }
    return n && processors > 0 && sum > (double)processors * n ? sum / (double)processors / n : 1;
}

/** How much longer a thread takes for its work than with a processor of its own: 1 on an idle machine. */
static inline double quick_slowness(void)
{
    const int64_t start_ns = sst_clock_now_ns();
    struct timespec from, now;
    int64_t cpu_ns;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &from);
    do {
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
        cpu_ns = (now.tv_sec - from.tv_sec) * INT64_C(1000000000) + now.tv_nsec - from.tv_nsec;
    } while (cpu_ns < 100000000);
    return (double)(sst_clock_now_ns() - start_ns) / (double)cpu_ns;
}

/**
 * Whether something took at most so long. Where it took longer, the time for which the machine stood still does not
 * count, and how busy it was (what kept it busy may have just ended) or is decides: it may take 3 times as many times
 * longer (work often waits more than once), and under a sanitizer 4 times longer still.
 */
static inline bool quick_enough(int64_t start_ns, int64_t limit_ns)
{
    const int64_t end_ns = sst_clock_now_ns();
    int64_t took_ns = end_ns - start_ns;
    double slowness, load;

    if (took_ns <= limit_ns)
        return true;
    took_ns -= quick_stood_still(start_ns, end_ns);
    slowness = quick_slowness();
    load = quick_load(start_ns, end_ns);
    slowness = load > slowness ? load : slowness;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    slowness *= 4;
#endif
    printf("took %.3f s and %.3f s in which the machine stood still, the limit is %.3f s, the machine is %.1f times "
           "slower than idle\n",
           (double)took_ns * 1e-9, (double)(end_ns - start_ns - took_ns) * 1e-9, (double)limit_ns * 1e-9, slowness);
    return took_ns <= limit_ns || (slowness > 1.3 && (double)took_ns <= 3 * slowness * (double)limit_ns);
}

#define assert_quick(start_ns, limit_ns) assert_true(quick_enough(start_ns, limit_ns))

#endif
