/* Reviews: which users have seen to which visits, a small file of JSON in the folder of each day. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "daemon/visits/visits_internal.h"

#define FILE_NAME "reviewed.json"
#define FILE_MOST ((size_t)32 << 20)
#define USERS     32 /* of a visit */

json_t *visits_reviewed(const struct sst_visits *v, const char *day)
{
    char path[SST_PATH_MAX], why[SST_LOG_MAX] = "", *held;
    uint8_t *data = NULL;
    size_t size = 0;
    json_t *all = NULL;
    int err = visits_day_path(path, v, day, FILE_NAME);

    if (!err && !access(path, F_OK)) {
        held = sst_log_hold_errors(why);
        err = sst_file_read(path, FILE_MOST, &data, &size);
        sst_log_hold_errors(held);
        all = err ? NULL : json_loadb((const char *)data, size, 0, NULL);
        free(data);
    }
    if (json_is_object(all))
        return all;
    json_decref(all);
    return json_object();
}

/* @return the user's place in the list; -1: not in it */
static int place_of(const json_t *users, const char *user)
{
    const json_t *one;
    size_t i;

    json_array_foreach(users, i, one)
    {
        if (json_is_string(one) && !strcmp(json_string_value(one), user))
            return (int)i;
    }
    return -1;
}

bool visits_is_reviewed(const json_t *reviewed, const char *name, const char *user)
{
    const json_t *users = json_object_get(reviewed, name);

    return user ? place_of(users, user) >= 0 : json_array_size(users) > 0;
}

static int write_all(struct sst_visits *v, const char *day, json_t *all)
{
    char path[SST_PATH_MAX], *text = json_dumps(all, JSON_COMPACT | JSON_SORT_KEYS);
    int err = text ? visits_day_path(path, v, day, FILE_NAME) : -ENOMEM;
    const int64_t before = err ? 0 : visits_file_bytes(path);

    err = err ? err : sst_file_write(path, text, strlen(text));
    if (!err)
        v->bytes += visits_file_bytes(path) - before;
    free(text);
    return err;
}

int visits_review(struct sst_visits *v, const json_t *names, const char *user, bool on)
{
    json_t *all = NULL, *one;
    const char *name, *day = NULL;
    bool changed = false;
    int full = 0, err;

    json_object_foreach((json_t *)(uintptr_t)names, name, one)
    {
        json_t *users;
        int at;

        if (!all)
            all = visits_reviewed(v, day = name);
        users = json_object_get(all, name);
        at = place_of(users, user);
        if (!on && at >= 0)
            changed |=
                !(json_array_size(users) > 1 ? json_array_remove(users, (size_t)at) : json_object_del(all, name));
        if (!on || at >= 0)
            continue;
        if (!json_is_array(users)) {
            users = json_array();
            json_object_set_new(all, name, users);
        }
        if (json_array_size(users) >= USERS)
            full = -EUSERS;
        else
            changed |= !json_array_append_new(users, json_string(user));
    }
    err = changed ? write_all(v, day, all) : 0;
    json_decref(all);
    return err ? err : full;
}

void visits_forget_reviews(struct sst_visits *v, const char *day, const json_t *gone)
{
    json_t *all = visits_reviewed(v, day), *one;
    const char *name;
    bool changed = false;

    json_object_foreach((json_t *)(uintptr_t)gone, name, one) changed |= !json_object_del(all, name);
    if (changed && write_all(v, day, all))
        sst_log_warning("reviews of %s cannot be written: deleted visits stay in them", day);
    json_decref(all);
}
