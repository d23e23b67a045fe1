/* sst doctor --law: retention and privacy of a configuration, age of stored items; docs/use/law.md explains. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <arpa/inet.h>
#include <dirent.h>
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <time.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "capture/access/access.h"
#include "capture/array/masks.h"
#include "cli/cli_internal.h"
#include "cli/doctor_internal.h"
#include "config/sstd.h"

#define AREA_KEEP   "retention"
#define AREA_STORED "stored"
#define AREA_ACCESS "access"
#define AREA_LOG    "audit log"
#define AREA_NET    "network"
#define AREA_MASKS  "masks"
#define AREA_DISK   "disk"
#define AREA_NOTICE "notice"

#define DAY_NS    INT64_C(86400000000000)
#define ABOUT_MAX ((size_t)1 << 16)
#define NAMED_MAX 5 /* in a sentence */

struct at {
    const char *area, *key; /* static; the key may be NULL */
};
#define AT(area, key) ((struct at){ area, key })

static void add(struct doctor *d, enum doctor_level level, struct at at, const char *fmt, ...) SST_PRINTF(4, 5);
static void add(struct doctor *d, enum doctor_level level, struct at at, const char *fmt, ...)
{
    char text[1400];
    va_list args;

    va_start(args, fmt);
    vsnprintf(text, sizeof(text), fmt, args);
    va_end(args);
    doctor_add(d, level, at.area, "%s", text);
    if (d->count)
        d->finding[d->count - 1].key = at.key;
}

/* --- retention ---------------------------------------------------------------------------------------------------- */

/* Limit of age; without one, a finding of the level `without`. */
static void judge_days(struct doctor *d, const char *key, const char *what, double days, enum doctor_level without)
{
    if (days > 0)
        add(d, DOCTOR_OK, AT(AREA_KEEP, key), "%s are deleted after %g days", what, days);
    else
        add(d, without, AT(AREA_KEEP, key), "%s have no limit of age: they stay until the disk or the quota is full; set %s",
            what, key);
}

static void check_retention(struct doctor *d, const struct sst_config *c)
{
    const bool records = c->storage.mode != SST_RECORD_OFF;

    if (records || c->storage.max_age_days > 0)
        judge_days(d, "storage.max_age_days", "automatic recordings", c->storage.max_age_days, DOCTOR_PROBLEM);
    else
        add(d, DOCTOR_OK, AT(AREA_KEEP, "storage.mode"), "nothing is recorded automatically");
    if (c->storage.reduced != SST_REDUCED_OFF)
        judge_days(d, "storage.reduced_max_age_days", "reduced recordings", c->storage.reduced_max_age_days,
                   DOCTOR_PROBLEM);
    judge_days(d, "storage.by_hand_max_age_days", "recordings on demand, snapshots and exports",
               c->storage.by_hand_max_age_days, DOCTOR_WARNING);
    if (c->storage.visits_days > 0)
        add(d, DOCTOR_OK, AT(AREA_KEEP, "storage.visits_days"),
            "visits and their pictures are deleted after %d days, those that a user keeps excepted", c->storage.visits_days);
    else
        add(d, DOCTOR_OK, AT(AREA_KEEP, "storage.visits_days"), "visits are not kept");
}

/* --- stored items ------------------------------------------------------------------------------------------------- */

enum item_kind {
    ITEM_AUTOMATIC = 0,
    ITEM_REDUCED = 1,
    ITEM_BY_HAND = 2,
    ITEM_KINDS = 3,
};

struct oldest {
    char name[256];
    int64_t ns; /* 0: none */
    int count;
};

static void note_oldest(struct oldest *o, const char *name, int64_t ns)
{
    o->count++;
    if (ns > 0 && (!o->ns || ns < o->ns)) {
        snprintf(o->name, sizeof(o->name), "%s", name);
        o->ns = ns;
    }
}

/* End of an item by its storage.json, 0 for a recording at work. @return whether it is an item */
static bool read_item(const char *dir, const char *name, enum item_kind *kind, int64_t *end_ns)
{
    char path[SST_PATH_MAX], about[SST_PATH_MAX];
    uint8_t *text = NULL;
    size_t size = 0;
    json_t *o;
    bool item;

    if (sst_path_join(path, dir, name) || sst_path_join(about, path, "storage.json") || !sst_path_exists(about) ||
        sst_file_read(about, ABOUT_MAX, &text, &size))
        return false;
    o = json_loadb((const char *)text, size, 0, NULL);
    free(text);
    item = json_is_object(o);
    if (item) {
        const char *why = json_string_value(json_object_get(o, "why"));
        const int64_t to = json_integer_value(json_object_get(o, "to_ns"));
        const int64_t made = json_integer_value(json_object_get(o, "made_ns"));

        *kind = why && !strcmp(why, "on demand") ? ITEM_BY_HAND
                : why && !strcmp(why, "reduced") ? ITEM_REDUCED
                                                 : ITEM_AUTOMATIC;
        *end_ns = !json_is_true(json_object_get(o, "finished")) ? 0 : to > 0 ? to : made;
    }
    json_decref(o);
    return item;
}

/* @return 0, or the errno of opening the folder */
static int scan(const char *root, const char *folder, struct oldest oldest[ITEM_KINDS])
{
    char dir[SST_PATH_MAX];
    const struct dirent *e;
    DIR *list;

    if (sst_path_join(dir, root, folder))
        return ENAMETOOLONG;
    list = opendir(dir);
    if (!list)
        return errno;
    while ((e = readdir(list)) != NULL) {
        enum item_kind kind;
        int64_t ns = 0;

        if (e->d_name[0] != '.' && read_item(dir, e->d_name, &kind, &ns))
            note_oldest(&oldest[strcmp(folder, "recordings") ? ITEM_BY_HAND : kind], e->d_name, ns);
    }
    closedir(list);
    return 0;
}

/* Visits that a user keeps stay when their day is removed. */
static bool has_kept(const char *dir, const char *day)
{
    char path[SST_PATH_MAX];
    const struct dirent *e;
    bool kept = false;
    DIR *list = sst_path_join(path, dir, day) ? NULL : opendir(path);

    while (list && !kept && (e = readdir(list)) != NULL) {
        const size_t n = strlen(e->d_name);

        kept = n > 5 && !strcmp(e->d_name + n - 5, "-keep");
    }
    if (list)
        closedir(list);
    return kept;
}

/* Folders of visits are named by their day. */
static int scan_visits(const char *root, struct oldest *o)
{
    char dir[SST_PATH_MAX];
    const struct dirent *e;
    DIR *list;

    if (sst_path_join(dir, root, "visits"))
        return ENAMETOOLONG;
    list = opendir(dir);
    if (!list)
        return errno;
    while ((e = readdir(list)) != NULL) {
        struct tm day = { 0 };

        if (sscanf(e->d_name, "%4d-%2d-%2d", &day.tm_year, &day.tm_mon, &day.tm_mday) != 3 ||
            has_kept(dir, e->d_name))
            continue;
        day.tm_year -= 1900;
        day.tm_mon--;
        day.tm_mday++; /* its end */
        note_oldest(o, e->d_name, (int64_t)timegm(&day) * 1000000000);
    }
    closedir(list);
    return 0;
}

/* A day more is fine: retention works in steps, and a service may have been off. */
static void judge_oldest(struct doctor *d, const struct oldest *o, const char *what, double days, const char *key)
{
    const double age = o->ns ? (double)(sst_clock_wall_ns() - o->ns) / (double)DAY_NS : 0;

    if (!o->count)
        return;
    if (!o->ns)
        add(d, DOCTOR_OK, AT(AREA_STORED, key), "%s: %d, none of them finished", what, o->count);
    else if (days > 0 && age > days + 1)
        add(d, DOCTOR_PROBLEM, AT(AREA_STORED, key),
            "%s ended %.1f days ago, and %s should be gone after %g: does the service run (sst status), and is its clock right?",
            o->name, age, what, days);
    else
        add(d, days > 0 || age < 1 ? DOCTOR_OK : DOCTOR_WARNING, AT(AREA_STORED, key), "%s: %d, the oldest (%s) ended %.1f days ago",
            what, o->count, o->name, age);
}

static void check_stored(struct doctor *d, const struct sst_config *c)
{
    static const char *const kinds[] = { "recordings", "snapshots", "exports" };
    static struct oldest oldest[ITEM_KINDS], visits;
    struct stat st;
    int err = 0;

    if (stat(c->storage.dir, &st)) {
        add(d, errno == ENOENT ? DOCTOR_OK : DOCTOR_WARNING, AT(AREA_STORED, "storage.dir"), "%s: %s; nothing stored was judged",
            c->storage.dir, strerror(errno));
        return;
    }
    if (st.st_mode & (S_IROTH | S_IXOTH))
        add(d, DOCTOR_WARNING, AT(AREA_STORED, "storage.dir"),
            "%s can be entered or listed by every user of this host (mode %04o): chmod o-rwx %s", c->storage.dir,
            (unsigned)st.st_mode & 07777u, c->storage.dir);
    for (size_t i = 0; i < ARRAY_LEN(kinds); i++) {
        const int e = scan(c->storage.dir, kinds[i], oldest);

        err = e && e != ENOENT ? e : err;
    }
    if (scan_visits(c->storage.dir, &visits) == EACCES)
        err = EACCES;
    if (err)
        add(d, DOCTOR_WARNING, AT(AREA_STORED, "storage.dir"),
            "%s cannot be read whole (%s), so the age of what is stored is not known: run this as root or as the service's user",
            c->storage.dir, strerror(err));
    judge_oldest(d, &oldest[ITEM_AUTOMATIC], "automatic recordings", c->storage.max_age_days, "storage.max_age_days");
    judge_oldest(d, &oldest[ITEM_REDUCED], "reduced recordings", c->storage.reduced_max_age_days,
                 "storage.reduced_max_age_days");
    judge_oldest(d, &oldest[ITEM_BY_HAND], "recordings on demand, snapshots and exports", c->storage.by_hand_max_age_days,
                 "storage.by_hand_max_age_days");
    judge_oldest(d, &visits, "days of visits", c->storage.visits_days, "storage.visits_days");
}

/* --- access ------------------------------------------------------------------------------------------------------- */

static void check_file(struct doctor *d, const char *path, const char *what)
{
    struct stat st;

    if (!stat(path, &st) && st.st_mode & (S_IRWXG | S_IRWXO))
        add(d, DOCTOR_PROBLEM, AT(AREA_ACCESS, "web.token_file"), "%s %s is open to other users (mode %04o): chmod 600 %s", what,
            path, (unsigned)st.st_mode & 07777u, path);
}

static void check_tokens(struct doctor *d, const struct sst_config *c)
{
    static struct sst_access_list list; /* large */
    char path[SST_PATH_MAX], error[256], endless[400] = "";
    int n = 0, control = 0, expired = 0, err;

    snprintf(path, sizeof(path), "%s.named", c->web.token_file);
    err = sst_access_read(&list, path, error);
    if (err) {
        add(d, DOCTOR_WARNING, AT(AREA_ACCESS, "web.token_file"), "named tokens were not judged: %s", error);
        return;
    }
    for (int i = 0; i < list.tokens; i++) {
        const struct sst_access_token *t = &list.token[i];

        control += (t->rights & SST_RIGHT_CONTROL) != 0;
        expired += t->expires_s && t->expires_s <= sst_clock_wall_ns() / 1000000000;
        if (t->expires_s)
            continue;
        if (n++ < NAMED_MAX)
            snprintf(endless + strlen(endless), sizeof(endless) - strlen(endless), "%s%s", n > 1 ? ", " : "", t->name);
    }
    if (!list.tokens)
        add(d, DOCTOR_WARNING, AT(AREA_ACCESS, "web.token_file"),
            "there are no named tokens, so the audit log cannot tell users of the common tokens apart: sst token add NAME "
            "--rights view --expires 365d");
    else
        add(d, n ? DOCTOR_WARNING : DOCTOR_OK, AT(AREA_ACCESS, "web.token_file"),
            "named tokens: %d, with control: %d, expired: %d%s%s%s%s", list.tokens, control, expired,
            n ? "; without an end: " : "", endless, n > NAMED_MAX ? " ..." : "",
            n ? " (sst token revoke, then add with --expires)" : "");
}

static void check_access(struct doctor *d, const struct sst_config *c)
{
    char path[SST_PATH_MAX];

    if (c->web.enabled) {
        check_file(d, c->web.token_file, "the control token");
        snprintf(path, sizeof(path), "%s.view", c->web.token_file);
        check_file(d, path, "the view token");
        check_tokens(d, c);
    }
    for (int i = 0; i < c->proxy.rights && c->proxy.addresses; i++)
        if (!strcmp(c->proxy.right[i], "control"))
            add(d, DOCTOR_WARNING, AT(AREA_ACCESS, "proxy.rights"), "every user that the proxy logs in may control the service: "
                "leave out control unless all of them must");
    if (c->control.group[0])
        add(d, DOCTOR_OK, AT(AREA_ACCESS, "control.group"), "members of the group %s control the service on this host",
            c->control.group);
}

static void check_audit(struct doctor *d, const struct sst_config *c)
{
    char path[SST_PATH_MAX];
    struct stat st;

    snprintf(path, sizeof(path), "%s.audit", c->web.token_file);
    if (!c->web.token_file[0])
        add(d, DOCTOR_PROBLEM, AT(AREA_LOG, "web.token_file"), "there is no audit log, since web: token_file is empty");
    else if (!stat(path, &st) && st.st_mode & (S_IRWXG | S_IRWXO))
        add(d, DOCTOR_PROBLEM, AT(AREA_LOG, "web.token_file"), "%s is open to other users (mode %04o): chmod 600 %s", path,
            (unsigned)st.st_mode & 07777u, path);
    else if (!stat(path, &st))
        add(d, DOCTOR_OK, AT(AREA_LOG, "web.token_file"), "%s has %lld bytes; the log begins again after 2 MB, copy it if you must keep it",
            path, (long long)st.st_size);
    else
        add(d, errno == ENOENT ? DOCTOR_OK : DOCTOR_WARNING, AT(AREA_LOG, "web.token_file"), "%s: %s", path,
            errno == ENOENT ? "nothing was noted yet" : strerror(errno));
}

/* --- network ------------------------------------------------------------------------------------------------------ */

static bool is_loopback(const char *address)
{
    struct in_addr v4; /* a name may begin with a number, too */

    return (!strncmp(address, "127.", 4) && inet_pton(AF_INET, address, &v4) == 1) || !strcmp(address, "::1") ||
           !strcasecmp(address, "localhost");
}

static void check_network(struct doctor *d, const struct sst_config *c)
{
    if (!c->web.enabled || is_loopback(c->web.address))
        add(d, DOCTOR_OK, AT(AREA_NET, "web.address"), "the page is reached on this host alone%s", c->web.enabled ? "" : "'s socket");
    else if (c->web.tls_certificate[0])
        add(d, DOCTOR_OK, AT(AREA_NET, "web.tls_certificate"), "the page is open to the network at %s, encrypted by TLS", c->web.address);
    else
        add(d, DOCTOR_PROBLEM, AT(AREA_NET, "web.insecure"),
            "pictures and tokens cross the network unencrypted at %s: set web: tls_certificate and tls_key", c->web.address);
    if (c->rtsp.enabled && !is_loopback(c->rtsp.address))
        add(d, c->rtsp.user[0] ? DOCTOR_WARNING : DOCTOR_PROBLEM, AT(AREA_NET, "rtsp.address"),
            "RTSP at %s is not encrypted%s: keep it in a network of its own, or behind a VPN", c->rtsp.address,
            c->rtsp.user[0] ? "" : " and needs no password (rtsp: user, password_file)");
    if (c->onvif.enabled && !is_loopback(c->onvif.address))
        add(d, c->onvif.user[0] || c->rtsp.user[0] ? DOCTOR_WARNING : DOCTOR_PROBLEM, AT(AREA_NET, "onvif.address"),
            "ONVIF at %s is not encrypted%s: keep it in a network of its own", c->onvif.address,
            c->onvif.user[0] || c->rtsp.user[0] ? "" : " and needs no password");
    if (c->mqtt.enabled && !is_loopback(c->mqtt.host))
        add(d, c->mqtt.ca_file[0] ? DOCTOR_OK : DOCTOR_PROBLEM, AT(AREA_NET, c->mqtt.ca_file[0] ? "mqtt.picture_s" : "mqtt.ca_file"),
            "events%s go to the broker %s%s", c->mqtt.picture_s > 0 ? " and pictures" : "", c->mqtt.host,
            c->mqtt.ca_file[0] ? ", encrypted by TLS; what it keeps is not judged here" : " unencrypted: set mqtt: ca_file");
    if (c->hooks)
        add(d, DOCTOR_NOTE, AT(AREA_NET, "hooks"), "%d hooks run programs of yours: what they send and keep is not judged here", c->hooks);
    if (c->push.enabled)
        add(d, DOCTOR_NOTE, AT(AREA_NET, "push.enabled"),
            "notifications go through the push services of browsers' makers, encrypted; to allow none, set push: enabled: false");
}

/* --- masks, notices ----------------------------------------------------------------------------------------------- */

static void check_masks(struct doctor *d, const struct sst_config *c)
{
    char why[SST_LOG_MAX] = "";
    struct sst_masks *masks = NULL;
    int err, cameras = 0;

    if (!c->array.masks) {
        add(d, DOCTOR_WARNING, AT(AREA_MASKS, "privacy.masks"),
            "no privacy mask is set: look in the picture of every camera, and behind the hedge in the see-through picture, for "
            "places of others (docs/use/masks.md)");
        return;
    }
    sst_log_hold_errors(why);
    err = sst_masks_create(&masks, &c->array);
    sst_log_hold_errors(NULL);
    for (int i = 0; !err && i < c->array.bound; i++)
        cameras += sst_masks_share(masks, i) > 0;
    sst_masks_destroy(masks);
    if (err)
        add(d, DOCTOR_PROBLEM, AT(AREA_MASKS, "privacy.masks"), "masks cannot be placed, so nothing is captured: %s", why);
    else if (c->array.bound && !cameras)
        add(d, DOCTOR_WARNING, AT(AREA_MASKS, "privacy.masks"), "%d masks are set and cover nothing of any camera", c->array.masks);
    else
        add(d, DOCTOR_OK, AT(AREA_MASKS, "privacy.masks"), "%d masks are set%s", c->array.masks,
            c->array.bound ? "" : "; how much they cover is in `sst status` while the service runs");
}

static void add_notices(struct doctor *d, const struct sst_config *c)
{
    if (!c->site[0])
        add(d, DOCTOR_WARNING, AT(AREA_NOTICE, "site"), "videos for others name this machine and not the place: set site");
    add(d, DOCTOR_NOTE, AT(AREA_NOTICE, NULL),
        "the sign at the entrance is not judged: who films, why, for how long, where to ask (docs/use/law.md has a text)");
    add(d, DOCTOR_NOTE, AT(AREA_DISK, NULL),
        "encryption of the disk below %s is not judged: a stolen disk shows what is on it unless it is encrypted (LUKS)",
        c->storage.dir);
    add(d, DOCTOR_NOTE, AT(AREA_NOTICE, NULL),
        "whether filming here is allowed at all is not judged: this is no legal advice, and no lawyer has read it");
}

int doctor_check_law(struct doctor *d)
{
    struct sst_config *c = calloc(1, sizeof(*c));
    int err = c ? 0 : -ENOMEM;

    if (!err) {
        sst_config_defaults(c);
        err = sst_config_read(c, d->config);
    }
    if (!err) {
        check_retention(d, c);
        check_stored(d, c);
        check_access(d, c);
        check_audit(d, c);
        check_network(d, c);
        check_masks(d, c);
        add_notices(d, c);
    }
    free(c);
    return err;
}
