/* Pictures of an import: found by the names in a source, or listed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "base/log.h"
#include "base/mem.h"
#include "pipeline/posed/import/import_internal.h"

#define MAX_DEPTH  8    /* of subfolders */
#define LISTED_MAX 8192 /* pictures of a folder */

static const char *const endings[] = { ".png", ".jpg", ".jpeg", ".tif", ".tiff",
                                       ".PNG", ".JPG", ".JPEG", ".TIF", ".TIFF" };

static bool is_picture(const char *name)
{
    const char *end = strrchr(name, '.');

    for (size_t i = 0; end && i < ARRAY_LEN(endings) / 2; i++) {
        if (!strcasecmp(end, endings[i]))
            return true;
    }
    return false;
}

int natural_order(const char *a, const char *b)
{
    const char *p = a, *q = b;

    while (*p && *q) {
        if (isdigit((unsigned char)*p) && isdigit((unsigned char)*q)) {
            size_t n, o;

            p += strspn(p, "0");
            q += strspn(q, "0");
            n = strspn(p, "0123456789");
            o = strspn(q, "0123456789");
            if (n != o)
                return n < o ? -1 : 1;
            for (; n; n--, p++, q++) {
                if (*p != *q)
                    return *p < *q ? -1 : 1;
            }
        } else if (*p != *q) {
            return (unsigned char)*p < (unsigned char)*q ? -1 : 1;
        } else {
            p++;
            q++;
        }
    }
    return *p || *q ? (*p ? 1 : -1) : strcmp(a, b);
}

static bool is_file(const char *path)
{
    struct stat s;

    return !stat(path, &s) && S_ISREG(s.st_mode);
}

/* --- by name ------------------------------------------------------------------------------------------------------ */

/* File of a name, or of its stem with another ending, below a folder. */
static bool find_below(char path[SST_PATH_MAX], const char *dir, const char *name)
{
    char other[MODEL_NAME + 8];
    const char *dot = strrchr(name, '.');
    const int stem = dot && !strchr(dot, '/') && is_picture(name) ? (int)(dot - name) : (int)strlen(name);

    if (!sst_path_join(path, dir, name) && is_file(path))
        return true;
    for (size_t i = 0; i < ARRAY_LEN(endings); i++) {
        snprintf(other, sizeof(other), "%.*s%s", stem, name, endings[i]);
        if (!sst_path_join(path, dir, other) && is_file(path))
            return true;
    }
    return false;
}

static bool find_in(char path[SST_PATH_MAX], const char *dir, const char *name)
{
    return name[0] == '/' ? find_below(path, "", name + strspn(name, "/")) || find_below(path, dir, sst_path_base(name))
                          : find_below(path, dir, name) || find_below(path, dir, sst_path_base(name));
}

/* Folder of the pictures: the user's, or the first folder beside the poses that has the first picture. */
static int choose_folder(char dir[SST_PATH_MAX], const struct model *m, const char *path)
{
    static const char *const beside[] = { "",          "images",    "Images",       "pictures",
                                          "../images", "../Images", "../../images", ".." };
    char file[SST_PATH_MAX], base[SST_PATH_MAX];

    if (m->cfg->pictures) {
        if (!sst_path_is_dir(m->cfg->pictures)) {
            sst_log_error("%s is not a folder; name the folder of the pictures with --pictures", m->cfg->pictures);
            return -ENOENT;
        }
        return sst_path_join(dir, m->cfg->pictures, NULL);
    }
    if (sst_path_join(base, path, NULL))
        return -ENAMETOOLONG;
    if (!sst_path_is_dir(base)) {
        char *slash = strrchr(base, '/');

        snprintf(slash ? slash + (slash == base) : base, 2, "%s", slash ? "" : ".");
    }
    for (size_t i = 0; i < ARRAY_LEN(beside); i++) {
        if (!sst_path_join(dir, base, beside[i][0] ? beside[i] : NULL) && find_in(file, dir, m->view[0].name))
            return 0;
    }
    sst_log_error("%s: there is no picture `%s` beside the poses; name the folder of the pictures with --pictures",
                  path, m->view[0].name);
    return -ENOENT;
}

/* A picture that was found with another ending has it in its name. */
static void take_name(struct model_view *v)
{
    char *base = v->name + (sst_path_base(v->name) - v->name);
    const char *found = sst_path_base(v->path);

    if (strlen(found) < sizeof(v->name) - (size_t)(base - v->name))
        memcpy(base, found, strlen(found) + 1);
}

static int find_views(struct model *m, const char *dir)
{
    for (int k = 0; k < m->count; k++) {
        struct model_view *v = &m->view[k];

        if (!find_in(v->path, dir, v->name)) {
            sst_log_error("%s has a pose of `%s`, but %s has no such picture; add it, or remove its pose",
                          m->cfg->source, v->name, dir);
            return -ENOENT;
        }
        take_name(v);
        for (int j = 0; j < k; j++) {
            if (strcmp(m->view[j].path, v->path))
                continue;
            sst_log_error("%s has two poses of the picture %s; remove one", m->cfg->source, v->path);
            return -EBADMSG;
        }
    }
    return 0;
}

/* --- by folder ---------------------------------------------------------------------------------------------------- */

struct listing {
    char (*path)[SST_PATH_MAX];
    int count, capacity;
    int folders; /* depth of subfolders to enter */
};

static int list(struct listing *l, const char *dir, int depth)
{
    char path[SST_PATH_MAX];
    struct dirent *e;
    int err = 0;
    DIR *d = opendir(dir);

    if (!d) {
        sst_log_error("cannot read the folder %s: %s", dir, strerror(errno));
        return -ENOENT;
    }
    while (!err && (e = readdir(d))) {
        if (e->d_name[0] == '.')
            continue;
        err = sst_path_join(path, dir, e->d_name);
        if (!err && is_picture(e->d_name) && is_file(path)) {
            if (l->count == LISTED_MAX) {
                sst_log_error("%s has more than %d pictures; name a folder with fewer", dir, LISTED_MAX);
                err = -EBADMSG;
            } else if (sst_mem_grow(&l->path, l->count, &l->capacity, sizeof(*l->path)))
                memcpy(l->path[l->count++], path, SST_PATH_MAX);
            else
                err = -ENOMEM;
        } else if (!err && depth < l->folders && sst_path_is_dir(path)) {
            err = list(l, path, depth + 1);
        }
    }
    closedir(d);
    return err;
}

static int compare(const void *a, const void *b)
{
    return natural_order(a, b);
}

static int list_sorted(struct listing *l, const char *dir)
{
    const int err = list(l, dir, 0);

    if (err == -ENOMEM)
        sst_log_error("not enough memory to list %s", dir);
    if (!err && l->count)
        qsort(l->path, (size_t)l->count, sizeof(*l->path), compare);
    return err;
}

/* Pictures in the folders of the posed ones. */
static int add_unplaced(struct model *m)
{
    const int posed = m->count;
    int err = 0;

    for (int k = 0; !err && k < posed; k++) {
        const int bytes = (int)(sst_path_base(m->view[k].path) - m->view[k].path);
        char dir[SST_PATH_MAX];
        struct listing l = { .folders = 0 };
        bool seen = false;

        for (int j = 0; j < k && !seen; j++)
            seen = sst_path_base(m->view[j].path) - m->view[j].path == bytes &&
                   !strncmp(m->view[j].path, m->view[k].path, (size_t)bytes);
        if (seen)
            continue;
        snprintf(dir, sizeof(dir), "%.*s", bytes > 1 ? bytes - 1 : 1, bytes ? m->view[k].path : ".");
        err = list_sorted(&l, dir);
        for (int i = 0; !err && i < l.count; i++) {
            char name[MODEL_NAME];
            struct model_view *v;
            bool used = false;

            for (int j = 0; j < posed && !used; j++)
                used = !strcmp(sst_path_base(m->view[j].path), sst_path_base(l.path[i])) &&
                       !strncmp(m->view[j].path, m->view[k].path, (size_t)bytes);
            if (used)
                continue;
            if (m->count == SST_POSED_MAX_VIEWS) {
                m->other++;
                continue;
            }
            /* with the folders that the source names */
            snprintf(name, sizeof(name), "%.*s%s", (int)(sst_path_base(m->view[k].name) - m->view[k].name),
                     m->view[k].name, sst_path_base(l.path[i]));
            v = model_add(m, name);
            if (v)
                memcpy(v->path, l.path[i], SST_PATH_MAX);
            err = v ? 0 : -ENOMEM;
        }
        free(l.path);
    }
    return err;
}

/* Programs on Windows write `images\C0.png`. */
static void mend_slashes(struct model *m)
{
    for (int k = 0; k < m->count; k++) {
        char *at = strchr(m->view[k].name, '/') ? NULL : strchr(m->view[k].name, '\\');

        for (; at; at = strchr(at, '\\'))
            *at = '/';
    }
}

int pictures_find(struct model *m, const char *path)
{
    char dir[SST_PATH_MAX];
    int err;

    if (m->view[0].path[0]) /* the source has none of its own names */
        return 0;
    mend_slashes(m);
    err = choose_folder(dir, m, path);
    err = err ? err : find_views(m, dir);
    return err ? err : add_unplaced(m);
}

int pictures_list(struct model *m, const char *dir)
{
    struct listing l = { .folders = MAX_DEPTH };
    int err = list_sorted(&l, dir);

    if (!err && !l.count) {
        sst_log_error("%s has no PNG, JPEG or TIFF picture; name their folder", dir);
        err = -EBADMSG;
    }
    for (int i = 0; !err && i < l.count; i++) {
        const char *name = l.path[i] + strlen(dir);
        struct model_view *v = model_add(m, name + strspn(name, "/"));

        if (v)
            memcpy(v->path, l.path[i], SST_PATH_MAX);
        err = v ? 0 : -EBADMSG;
    }
    free(l.path);
    return err;
}
