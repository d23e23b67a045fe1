/* Subscriptions in a file that the service alone reads: its content suffices to send to the browsers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "daemon/publish/publish_internal.h"
#include "daemon/publish/push_internal.h"

#define FILE_MOST  ((size_t)1 << 20)
#define NAMES_MOST 16

/* @param name  of the member, for the sentence @return false: not an array of names */
static bool read_names(const json_t *list, const char *name, char out[PUSH_LIST], char error[512])
{
    const json_t *one;
    size_t i;

    out[0] = 0;
    if (list && (!json_is_array(list) || json_array_size(list) > NAMES_MOST)) {
        sst_api_refuse(error, -EINVAL, "%s must be an array of at most %d names", name, NAMES_MOST);
        return false;
    }
    json_array_foreach(list, i, one)
    {
        const char *text = json_string_value(one);

        if (!text || !*text || strchr(text, ',') || strlen(out) + strlen(text) + 3 > PUSH_LIST) {
            sst_api_refuse(error, -EINVAL, "%s has a name that is empty, too long or has a comma", name);
            return false;
        }
        sst_text_add(out, PUSH_LIST, "%s%s,", i ? "" : ",", text);
    }
    return true;
}

bool push_subscription_of(const json_t *o, struct push_subscription *out, char error[512])
{
    const char *endpoint = json_string_value(json_object_get(o, "endpoint"));
    const char *p256dh = json_string_value(json_object_get(o, "p256dh"));
    const char *auth = json_string_value(json_object_get(o, "auth"));
    const json_t *cool_down = json_object_get(o, "cool_down_s");

    *out = (struct push_subscription){ .cool_down_s = NAN };
    if (!endpoint || strlen(endpoint) >= PUSH_ENDPOINT || !p256dh || !auth ||
        !push_from_base64(p256dh, out->to.point, PUSH_POINT) || !push_from_base64(auth, out->to.auth, PUSH_AUTH) ||
        !push_point_good(out->to.point)) {
        sst_api_refuse(error, -EINVAL, "endpoint, p256dh and auth must be those of a subscription of the browser");
        return false;
    }
    snprintf(out->endpoint, sizeof(out->endpoint), "%s", endpoint);
    if (cool_down && !json_is_null(cool_down)) {
        out->cool_down_s = json_is_number(cool_down) ? json_number_value(cool_down) : -1;
        if (!(out->cool_down_s >= 0 && out->cool_down_s <= 86400)) {
            sst_api_refuse(error, -EINVAL, "cool_down_s must be a number from 0 to 86400");
            return false;
        }
    }
    return read_names(json_object_get(o, "labels"), "labels", out->labels, error) &&
           read_names(json_object_get(o, "zones"), "zones", out->zones, error);
}

static json_t *names_json(const char *names)
{
    json_t *list = json_array();

    for (const char *c = names + strspn(names, ","); *c; c += strspn(c, ",")) {
        const size_t n = strcspn(c, ",");

        json_array_append_new(list, json_stringn(c, n));
        c += n;
    }
    return list;
}

int push_read(const char *path, struct push_subscription *list)
{
    json_t *root, *one;
    char error[512];
    uint8_t *data;
    size_t size, i;
    int n = 0;

    if (!sst_path_exists(path) || sst_file_read(path, FILE_MOST, &data, &size))
        return 0;
    root = json_loadb((const char *)data, size, 0, NULL);
    free(data);
    if (!json_is_array(root))
        sst_log_warning("%s is damaged: browsers that subscribed to notifications must do it again", path);
    json_array_foreach(root, i, one)
    {
        if (n < SST_PUSH_MAX && push_subscription_of(one, &list[n], error))
            n++;
        else
            sst_log_warning("%s: a subscription is left out: %s", path, n < SST_PUSH_MAX ? error : "there are too many");
    }
    json_decref(root);
    return n;
}

int push_write(const char *path, const struct push_subscription *list, int count)
{
    json_t *root = json_array();
    char *text;
    int err;

    for (int i = 0; i < count; i++) {
        const struct push_subscription *s = &list[i];
        char point[PUSH_BASE64(PUSH_POINT)], auth[PUSH_BASE64(PUSH_AUTH)];

        push_base64(point, s->to.point, PUSH_POINT);
        push_base64(auth, s->to.auth, PUSH_AUTH);
        json_array_append_new(root, json_pack("{s:s, s:s, s:s, s:o, s:o, s:o}", "endpoint", s->endpoint, "p256dh", point,
                                              "auth", auth, "labels", names_json(s->labels), "zones",
                                              names_json(s->zones), "cool_down_s",
                                              isnan(s->cool_down_s) ? json_null() : json_real(s->cool_down_s)));
    }
    text = json_array_size(root) == (size_t)count ? json_dumps(root, JSON_INDENT(1)) : NULL;
    json_decref(root);
    err = text ? http_write_private(path, text) : -ENOMEM;
    free(text);
    return err;
}
