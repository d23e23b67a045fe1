/* Loaded before a test of which tests/special.txt says that it has one thread: ends it when its own code starts
 * another. Libraries may (OpenBLAS does at its start): the thread sanitizer would not see into theirs. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dlfcn.h>
#include <errno.h>
#include <link.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*start)(void *), void *arg)
{
    int (*next)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    struct link_map *object = NULL;
    Dl_info info;

    *(void **)&next = dlsym(RTLD_NEXT, "pthread_create");
    /* The program itself has no name in the list of objects. */
    if (dladdr1((void *)(uintptr_t)start, &info, (void **)&object, RTLD_DL_LINKMAP) && object && !object->l_name[0]) {
        fprintf(stderr, "it starts a thread: take its line with one-thread out of tests/special.txt\n");
        exit(1);
    }
    return next ? next(thread, attributes, start, arg) : EAGAIN;
}
