/* A wire between two lines of gpio-sim, which has none: copies the level of one to the other until SIGTERM, then prints
   how many pulses there were.   wire FROM/value TO/pull   (TO: "" only counts)
   It looks ten thousand times a second, but an emulator on a busy machine may stand still for longer than a pulse. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static volatile sig_atomic_t ended;

static void end(int sig)
{
    ended = sig;
}

int main(int argc, char **argv)
{
    const int from = argc == 3 ? open(argv[1], O_RDONLY) : -1;
    const int to = argc == 3 && argv[2][0] ? open(argv[2], O_WRONLY) : -1;
    char level, last = '0';
    long pulses = 0;

    if (from < 0 || (to < 0 && argv[2][0])) {
        perror("wire");
        return 1;
    }
    signal(SIGTERM, end);
    puts("wired");
    fflush(stdout);
    while (!ended && pread(from, &level, 1, 0) == 1) {
        if (level != last) {
            const char *pull = level == '1' ? "pull-up" : "pull-down";

            pulses += level == '1';
            last = level;
            if (to >= 0 && pwrite(to, pull, strlen(pull), 0) < 0) {
                perror("wire: pull");
                return 1;
            }
        }
        nanosleep(&(struct timespec){ .tv_nsec = 100000 }, NULL);
    }
    printf("%ld\n", pulses);
    return 0;
}
