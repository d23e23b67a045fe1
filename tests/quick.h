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
#include <time.h>
#include <unistd.h>

#include "base/clock.h"

#define QUICK_BEAT_NS  INT64_C(20000000)
#define QUICK_STILL_NS INT64_C(100000000)

/** A process beside the test that has next to nothing to do, and the times at which it could not do even that. */
static struct quick_beat {
    _Atomic int64_t last_ns;
    _Atomic int n;
    struct {
        int64_t from_ns, to_ns;
    } still[256];
} * quick_beat;

/* Before main(), while there are no threads; it goes with the thread that called, the first. */
__attribute__((constructor)) static void quick_begin(void)
{
    struct quick_beat *b =
        (struct quick_beat *)mmap(NULL, sizeof(*b), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    const pid_t parent = getpid();
    int64_t now_ns, last_ns = sst_clock_now_ns();

    if (b == MAP_FAILED)
        abort();
    quick_beat = b;
    b->last_ns = last_ns;
    if (fork())
        return;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    closefrom(0); /* nobody waits for the end of what this holds, too */
    while (getppid() == parent) {
        nanosleep(&(struct timespec){ .tv_nsec = QUICK_BEAT_NS }, NULL);
        now_ns = sst_clock_now_ns();
        if (now_ns - last_ns > QUICK_STILL_NS && b->n < 256) {
            b->still[b->n].from_ns = last_ns;
            b->still[b->n].to_ns = now_ns;
            b->n++;
        }
        b->last_ns = last_ns = now_ns;
    }
    _exit(0);
}

/** For how long the machine stood still between two moments, as far as a process that wants nothing could tell. */
static inline int64_t quick_stood_still(int64_t from_ns, int64_t to_ns)
{
    int64_t sum_ns = 0;

    for (int i = 0; i < 500 && quick_beat->last_ns < to_ns; i++)
        nanosleep(&(struct timespec){ .tv_nsec = QUICK_BEAT_NS }, NULL);
    for (int i = 0; i < quick_beat->n; i++) {
        const int64_t a = quick_beat->still[i].from_ns, b = quick_beat->still[i].to_ns;

        if (b > from_ns && a < to_ns)
            sum_ns += (b < to_ns ? b : to_ns) - (a > from_ns ? a : from_ns);
    }
    return sum_ns;
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
 * count, and how busy it is decides: it may take 3 times as many times longer (work often waits more than once), and
 * under a sanitizer 4 times longer still.
 */
static inline bool quick_enough(int64_t start_ns, int64_t limit_ns)
{
    const int64_t end_ns = sst_clock_now_ns();
    int64_t took_ns = end_ns - start_ns;
    double slowness;

    if (took_ns <= limit_ns)
        return true;
    took_ns -= quick_stood_still(start_ns, end_ns);
    slowness = quick_slowness();
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
