/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/plugin.h"

#include <dlfcn.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"

/* Folders relative to the program's: in the build, installed in bin/ or sbin/, a bench and a test in the build. */
static const char *const folders[] = { "", "../" SST_PLUGINDIR "/", "../", "../../" };

void *sst_plugin_symbol(const char *name, const char *symbol, char why[256])
{
    char exe[SST_PATH_MAX] = "", path[SST_PATH_MAX + 300];
    void *library = NULL, *function;

    if (readlink("/proc/self/exe", exe, sizeof(exe) - 1) < 0 || !strrchr(exe, '/')) {
        snprintf(why, 256, "the program does not find its own folder");
        return NULL;
    }
    strrchr(exe, '/')[1] = 0;
    snprintf(why, 256, "libsst-%s.so is neither beside the program nor in ../" SST_PLUGINDIR "%s", name,
             !strcmp(name, "opencv") ? "; Debian's package sst-opencv has it"
             : !strcmp(name, "aravis") ? "; Debian's package sst-genicam has it"
             : !strcmp(name, "video")  ? "; Debian's package sst-video has it"
                                       : "");
    for (size_t i = 0; i < ARRAY_LEN(folders) && !library; i++) {
        (void)snprintf(path, sizeof(path), "%s%slibsst-%s.so", exe, folders[i], name);
        if (access(path, F_OK))
            continue;
        library = dlopen(path, RTLD_NOW | RTLD_LOCAL); /* stays loaded: the same one each time */
        if (!library)
            snprintf(why, 256, "cannot load libsst-%s.so: %s", name, dlerror());
    }
    function = library ? dlsym(library, symbol) : NULL;
    if (library && !function)
        snprintf(why, 256, "libsst-%s.so is of another version: %s is missing", name, symbol);
    return function;
}
