/* A wire between two network namespaces that loses, delays and reorders packets, or is cut, where the kernel has no
 * netem.
 *
 *   wire NS_A ADDRESS/BITS NS_B ADDRESS/BITS
 * makes an interface in each namespace (as of `ip netns add`) and carries Ethernet frames between them. Standard input
 * says how, a line each: `loss 0.02` (of each direction), `delay 25 25` (ms, and +- ms, each packet on its own, so that
 * they overtake each other), `cut 1`, `cut 0`. It ends with its input. Needs root. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <linux/if.h>
#include <linux/if_tun.h>
#include <poll.h>
#include <sched.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#define PACKETS 8192
#define BYTES   2048

struct packet {
    int64_t due_ns;
    int to, bytes;
    uint8_t data[BYTES];
};

static struct {
    int fd[2];
    double loss, delay_ms, jitter_ms;
    bool cut;
    struct packet *heap[PACKETS];
    int count;
    unsigned long long carried, lost, full;
} w;

static int64_t now_ns(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

/* An interface in a namespace; this process stays there, its descriptor works from anywhere. */
static int make_end(const char *ns, const char *address, int index)
{
    struct ifreq r = { .ifr_flags = IFF_TAP | IFF_NO_PI };
    char path[256], command[512];
    int fd, to;

    snprintf(path, sizeof(path), "/run/netns/%s", ns);
    to = open(path, O_RDONLY | O_CLOEXEC);
    if (to < 0 || setns(to, CLONE_NEWNET))
        fail(path);
    close(to);
    fd = open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
    snprintf(r.ifr_name, sizeof(r.ifr_name), "w%d-%d", index, (int)(getpid() % 100000));
    if (fd < 0 || ioctl(fd, TUNSETIFF, &r))
        fail("/dev/net/tun");
    snprintf(command, sizeof(command), "ip addr add %s dev %s && ip link set %s up && ip link set lo up", address,
             r.ifr_name, r.ifr_name);
    if (system(command))
        fail(command);
    return fd;
}

static void swap(int a, int b)
{
    struct packet *p = w.heap[a];

    w.heap[a] = w.heap[b];
    w.heap[b] = p;
}

static void push(struct packet *p)
{
    int i = w.count++;

    w.heap[i] = p;
    for (; i && w.heap[i]->due_ns < w.heap[(i - 1) / 2]->due_ns; i = (i - 1) / 2)
        swap(i, (i - 1) / 2);
}

static struct packet *pop(void)
{
    struct packet *p = w.heap[0];

    w.heap[0] = w.heap[--w.count];
    for (int i = 0, c; (c = 2 * i + 1) < w.count; i = c) {
        if (c + 1 < w.count && w.heap[c + 1]->due_ns < w.heap[c]->due_ns)
            c++;
        if (w.heap[i]->due_ns <= w.heap[c]->due_ns)
            break;
        swap(i, c);
    }
    return p;
}

static void take(int from)
{
    for (;;) {
        struct packet *p = w.count < PACKETS ? malloc(sizeof(*p)) : NULL;
        uint8_t away[BYTES];
        const ssize_t n = read(w.fd[from], p ? p->data : away, BYTES);

        if (n <= 0 || !p || w.cut || drand48() < w.loss) {
            w.full += n > 0 && !p;
            w.lost += n > 0 && p;
            free(p);
            if (n <= 0)
                return;
            continue;
        }
        p->bytes = (int)n;
        p->to = !from;
        p->due_ns = now_ns() + (int64_t)((w.delay_ms + (2 * drand48() - 1) * w.jitter_ms) * 1e6);
        push(p);
    }
}

static void give(void)
{
    while (w.count && w.heap[0]->due_ns <= now_ns()) {
        struct packet *p = pop();

        if (!w.cut && write(w.fd[p->to], p->data, (size_t)p->bytes) == p->bytes)
            w.carried++;
        free(p);
    }
}

static bool obey(void)
{
    char line[128];
    ssize_t n = 0;
    int cut;

    while (n < (ssize_t)sizeof(line) - 1) {
        const ssize_t r = read(0, line + n, 1);

        if (r <= 0)
            return false;
        if (line[n++] == '\n')
            break;
    }
    line[n] = 0;
    (void)(sscanf(line, "loss %lf", &w.loss) == 1 || sscanf(line, "delay %lf %lf", &w.delay_ms, &w.jitter_ms) == 2);
    if (sscanf(line, "cut %d", &cut) == 1)
        w.cut = cut;
    return true;
}

int main(int argc, char **argv)
{
    bool on = true;

    if (argc != 5) {
        fprintf(stderr, "usage: wire NS_A ADDRESS/BITS NS_B ADDRESS/BITS\n");
        return 2;
    }
    srand48(1);
    w.fd[0] = make_end(argv[1], argv[2], 0);
    w.fd[1] = make_end(argv[3], argv[4], 1);
    puts("up");
    fflush(stdout);
    while (on) {
        struct pollfd fds[3] = { { .fd = w.fd[0], .events = POLLIN },
                                 { .fd = w.fd[1], .events = POLLIN },
                                 { .events = POLLIN } };
        const int64_t wait_ns = w.count ? w.heap[0]->due_ns - now_ns() : INT64_C(1000000000);
        const struct timespec wait = { wait_ns > 0 ? wait_ns / 1000000000 : 0, wait_ns > 0 ? wait_ns % 1000000000 : 0 };

        if (ppoll(fds, 3, &wait, NULL) < 0)
            continue;
        take(0);
        take(1);
        give();
        if (fds[2].revents)
            on = obey();
    }
    printf("%llu carried, %llu lost, %llu had no room\n", w.carried, w.lost, w.full);
    return 0;
}
