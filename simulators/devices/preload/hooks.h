/* simulators/devices/preload/hooks.h - how a function of libc is stood in front of. */
#ifndef SST_SIMULATORS_DEVICES_PRELOAD_HOOKS_H
#define SST_SIMULATORS_DEVICES_PRELOAD_HOOKS_H

#define HOOK __attribute__((visibility("default")))

/* `next`: the function of that name that ours hides; looked up once. */
#define NEXT(type, name, ...)                                         \
    static type (*next)(__VA_ARGS__);                                 \
    if (!__atomic_load_n(&next, __ATOMIC_RELAXED)) {                  \
        void *symbol = dlsym(RTLD_NEXT, #name);                       \
        __atomic_store_n(&next, (type(*)(__VA_ARGS__))symbol, __ATOMIC_RELAXED); \
    }

#endif
