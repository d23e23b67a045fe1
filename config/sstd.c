/* Configuration files, read in order over the defaults. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "config/sstd.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "base/stats.h"
#include "base/text.h"
#include "config/config_internal.h"

/* The parsed documents are kept until all faults are logged. */
struct files {
    char *path[2 + SST_CONFIG_FILES_MAX];
    struct sst_yaml *doc[2 + SST_CONFIG_FILES_MAX];
    int n;
};

static bool is_part(const char *name)
{
    return *name != '.' && sst_text_ends(name, ".yaml");
}

static int add_path(struct files *f, const char *path)
{
    if (f->n == 1 + SST_CONFIG_FILES_MAX) { /* one more for zones_file */
        sst_log_error("%s: more than %d files; merge some of them", path, SST_CONFIG_FILES_MAX);
        return -EBADMSG;
    }
    f->path[f->n] = strdup(path);
    if (!f->path[f->n])
        return -ENOMEM;
    f->n++;
    return 0;
}

/* Add the files of conf.d beside the file, if it exists. */
static int find_parts(struct files *f, const char *path)
{
    const size_t dir = (size_t)(sst_path_base(path) - path);
    char folder[SST_PATH_MAX], part[SST_PATH_MAX];
    const int first = f->n;
    struct dirent *entry;
    DIR *d;
    int err = 0;

    if (snprintf(folder, sizeof(folder), "%.*sconf.d", (int)dir, path) >= (int)sizeof(folder)) {
        sst_log_error("%s: the path is too long", path);
        return -EBADMSG;
    }
    d = opendir(folder);
    if (!d && errno == ENOENT)
        return 0;
    if (!d) {
        err = -errno;
        sst_log_error("cannot read %s: %s; it contains parts of the configuration", folder, strerror(-err));
        return err == -EACCES || err == -ENOMEM ? err : -EBADMSG;
    }
    while (!err && (entry = readdir(d))) {
        if (!is_part(entry->d_name))
            continue;
        err = sst_path_join(part, folder, entry->d_name);
        if (!err)
            err = add_path(f, part);
    }
    closedir(d);
    sst_stats_sort_strings(f->path + first, f->n - first);
    return err == -ENAMETOOLONG ? -EBADMSG : err;
}

static int parse(struct sst_yaml **doc, const char *path)
{
    uint8_t *text = NULL;
    size_t size;
    int err = sst_file_read_text(path, SST_YAML_MAX_BYTES, &text, &size);

    if (!err)
        err = sst_yaml_parse(doc, (const char *)text, size, path);
    free(text);
    return err == -ENOENT || err == -EACCES || err == -ENOMEM || !err ? err : -EBADMSG;
}

/* Read the zones drawn on the page, over zones of the other files. The file has nothing else: its writers get no hook.
 */
static int read_zones(struct config_load *load, struct files *f)
{
    const char *path = load->cfg->web.zones_file;
    int err;

    if (load->array_only || !*path || (!load->zones && !sst_path_exists(path)))
        return 0;
    f->path[f->n] = strdup(path);
    if (!f->path[f->n])
        return -ENOMEM;
    err = load->zones ? sst_yaml_parse(&f->doc[f->n], load->zones, strlen(load->zones), path)
                      : parse(&f->doc[f->n], path);
    if (!err)
        config_parse(load, f->doc[f->n], true);
    f->n++;
    return err == -ENOMEM || !err ? err : -EBADMSG;
}

/* Read every file and log all faults, also if other files have faults. */
static int read_all(struct config_load *load, struct files *f)
{
    int err = 0;

    for (int i = 0; i < f->n; i++) {
        const int bad = parse(&f->doc[i], f->path[i]);

        err = err ? err : bad;
        if (!bad)
            config_parse(load, f->doc[i], false);
    }
    if (!err)
        err = read_zones(load, f);
    if (!err) { /* checks between values need all files */
        config_check_array(load);
        if (!load->array_only)
            config_check_service(load);
    }
    for (int i = 0; i < f->n; i++) {
        const int bad = f->doc[i] ? sst_yaml_finish(f->doc[i]) : 0;

        err = err ? err : bad;
    }
    if (!err && !load->array_only)
        config_warn(load);
    return err;
}

static int load_all(struct sst_config *cfg, const char *path, bool array_only, const char *zones)
{
    struct config_load load = { .array_only = array_only, .zones = zones };
    struct files f = { .n = 0 };
    int err = 0;

    load.cfg = malloc(sizeof(*load.cfg));
    if (!load.cfg)
        return -ENOMEM;
    *load.cfg = *cfg;
    if (path || sst_path_exists(SST_CONFIG_PATH))
        err = add_path(&f, path ? path : SST_CONFIG_PATH);
    if (!err)
        err = find_parts(&f, path ? path : SST_CONFIG_PATH);
    if (!err)
        err = read_all(&load, &f);
    if (!err)
        *cfg = *load.cfg;
    for (int i = 0; i < f.n; i++) {
        sst_yaml_destroy(f.doc[i]);
        free(f.path[i]);
    }
    free(load.cfg);
    return err;
}

int config_load(struct sst_config *cfg, const char *path, bool array_only)
{
    return load_all(cfg, path, array_only, NULL);
}

int sst_config_read(struct sst_config *cfg, const char *path)
{
    return config_load(cfg, path, false);
}

int sst_config_try_zones(struct sst_config *cfg, const char *path, const char *zones)
{
    return load_all(cfg, path, false, zones);
}

void sst_config_defaults(struct sst_config *cfg)
{
    int count;
    const struct sst_key *keys = sst_schema(&count);

    memset(cfg, 0, sizeof(*cfg));
    for (int i = 0; i < count; i++)
        sst_key_set_default(&keys[i], cfg);
}

void sst_config_page(char out[512], const struct sst_config *cfg)
{
    const char *host = cfg->web.host[0] ? cfg->web.host : cfg->web.address, *url = cfg->web.url;
    const bool any = !strcmp(host, "0.0.0.0") || !strcmp(host, "::"), v6 = strchr(host, ':') != NULL;
    size_t n = strlen(url);
    char own[128] = "";

    while (n && url[n - 1] == '/')
        n--;
    if (any && !gethostname(own, sizeof(own) - 1))
        host = own;
    out[0] = 0;
    if (cfg->web.enabled && n)
        snprintf(out, 512, "%.*s", (int)n, url);
    else if (cfg->web.enabled && cfg->web.port && host[0])
        snprintf(out, 512, "http%s://%s%s%s:%d", cfg->web.tls_certificate[0] ? "s" : "", v6 && !any ? "[" : "", host,
                 v6 && !any ? "]" : "", cfg->web.port);
}
