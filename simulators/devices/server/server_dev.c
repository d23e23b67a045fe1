/* The session's /dev: real entries as links, simulated nodes as small files that the preload library presents as
 * devices. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.h"
#include "simulators/devices/server/server_internal.h"

static bool hidden(const char *name)
{
    static const char *const kinds[] = { SST_SIM_OWN_KINDS };

    for (size_t i = 0; i < ARRAY_LEN(kinds); i++)
        if (strncmp(name, kinds[i], strlen(kinds[i])) == 0)
            return true;
    return name[0] == '.';
}

int sim_dev_open(struct sim_server *s)
{
    char path[SST_PATH_MAX], target[SST_PATH_MAX];
    int err = sst_path_join(path, s->dir, "dev");
    const size_t base = strlen(path);
    DIR *real = NULL;

    if (!err && mkdir(path, 0700) < 0 && errno != EEXIST)
        err = -errno;
    if (!err && !(real = opendir("/dev")))
        err = -errno;
    for (struct dirent *e; !err && (e = readdir(real));) {
        if (hidden(e->d_name))
            continue;
        if (snprintf(path + base, sizeof(path) - base, "/%s", e->d_name) < (int)(sizeof(path) - base) &&
            snprintf(target, sizeof(target), "/dev/%s", e->d_name) < (int)sizeof(target) && symlink(target, path) < 0 &&
            errno != EEXIST)
            err = -errno;
    }
    if (real)
        closedir(real);
    if (err)
        sst_log_error("cannot create dev/ in session folder '%s': %s", s->dir, strerror(-err));
    return err;
}

struct sim_node *sim_node_find(struct sim_server *s, const char *path)
{
    for (struct sim_node *n = s->nodes; n; n = n->next)
        if (strcmp(n->path, path) == 0)
            return n;
    return NULL;
}

int sim_make_parents(char *path, size_t base)
{
    for (char *p = path + base + 1; (p = strchr(p, '/')); p++) {
        bool failed;

        *p = 0;
        failed = mkdir(path, 0700) < 0 && errno != EEXIST;
        *p = '/';
        if (failed)
            return -errno;
    }
    return 0;
}

/* Path of a /dev entry in the session; its folders are created. */
static int place(struct sim_server *s, const char *path, char out[SST_PATH_MAX])
{
    if (snprintf(out, SST_PATH_MAX, "%s%s", s->dir, path) >= SST_PATH_MAX)
        return -ENAMETOOLONG;
    return sim_make_parents(out, strlen(s->dir) + strlen("/dev"));
}

static int write_node(struct sim_server *s, const struct sim_node *n)
{
    char path[SST_PATH_MAX], temporary[SST_PATH_MAX];
    int err = place(s, n->path, path);
    FILE *f;

    if (err)
        return err;
    /* the file appears whole: programs may read it at any time */
    if (snprintf(temporary, sizeof(temporary), "%s/.node", s->dir) >= (int)sizeof(temporary))
        return -ENAMETOOLONG;
    f = fopen(temporary, "w");
    if (!f)
        return -errno;
    if (fprintf(f, "%u %u\n", n->dev_major, n->dev_minor) < 0 || fchmod(fileno(f), S_ISVTX | 0600) < 0)
        err = -errno;
    if (fclose(f) != 0 && !err)
        err = -errno;
    if (!err && rename(temporary, path) < 0)
        err = -errno;
    return err;
}

int sim_node_add(struct sim_server *s, struct sim_node **node, const char *path, const struct sim_device *device)
{
    struct sim_node *n;
    int err = 0;

    if (sim_node_find(s, path))
        return -EEXIST;
    n = calloc(1, sizeof(*n));
    if (!n)
        return -ENOMEM;
    *n = (struct sim_node){
        .dev_major = device->dev_major, .dev_minor = device->dev_minor, .ops = device->ops, .device = device->arg
    };
    if (snprintf(n->path, sizeof(n->path), "%s", path) >= (int)sizeof(n->path))
        err = -ENAMETOOLONG;
    else if (strncmp(path, "/dev/", 5) == 0)
        err = write_node(s, n);
    if (err) {
        sst_log_error("cannot create device '%s' in session '%s': %s", path, s->dir, strerror(-err));
        free(n);
        return err;
    }
    n->next = s->nodes;
    s->nodes = n;
    *node = n;
    return 0;
}

void sim_node_remove(struct sim_server *s, struct sim_node *node)
{
    char path[SST_PATH_MAX];

    if (!node)
        return;
    SST_LIST_REMOVE(s->nodes, node);
    if (strncmp(node->path, "/dev/", 5) == 0 && place(s, node->path, path) == 0)
        (void)unlink(path);
    sim_files_drop(s, node);
    free(node);
}

int sim_link(struct sim_server *s, const char *path, const char *target)
{
    char entry[SST_PATH_MAX];
    int err = place(s, path, entry);

    if (err)
        return err;
    if (unlink(entry) < 0 && errno != ENOENT)
        return -errno;
    return target && symlink(target, entry) < 0 ? -errno : 0;
}
