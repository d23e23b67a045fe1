/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "daemon/publish/api.h"

/* Numbers, with their ranges. */
static const struct {
    const char *key;
    size_t member; /* of struct view_settings */
    double min, max;
    bool null;      /* may be null ... */
    double natural; /* ... which stands for this */
} numbers[] = {
    { "focus_px", offsetof(struct view_settings, render.focus_px), -1e4, 1e4, true, NAN },
    { "cut_px", offsetof(struct view_settings, render.cut_px), -1e4, 1e4, true, NAN },
    { "sigma_px", offsetof(struct view_settings, render.sigma_px), 0, 1e4, true, 0 },
    { "c1", offsetof(struct view_settings, render.c1), 0, 1, false, 0 },
    { "c2", offsetof(struct view_settings, render.c2), 0, 1, false, 0 },
    { "label_factor", offsetof(struct view_settings, render.label_factor), 1, 1e6, false, 0 },
    { "aperture", offsetof(struct view_settings, render.aperture), 0, 1e3, true, INFINITY },
};

static const char *const methods[] = { "refocus", "sst", "clear" };
_Static_assert((int)SST_LIVE_REFOCUS == (int)SST_RENDER_REFOCUS && (int)SST_LIVE_SST == (int)SST_RENDER_SST &&
                   (int)SST_LIVE_CLEAR == (int)SST_RENDER_CLEAR,
               "the configuration's methods are the renderer's");

static double *member_of(struct view_settings *s, size_t i)
{
    return (double *)(void *)((char *)s + numbers[i].member);
}

void view_settings_defaults(struct view_settings *s, const struct sst_live_settings *config)
{
    memset(s, 0, sizeof(*s));
    sst_render_config_defaults(&s->render);
    s->render.method = (enum sst_render_method)config->method;
    s->render.cut_px = config->cut_px;
    snprintf(s->remove_label, sizeof(s->remove_label), "%s", config->remove_label);
    s->outline = config->outline;
    s->tint = config->tint;
    s->outline_moving = config->outline_moving;
    s->keep_moving = config->keep_moving;
    s->render.focus_px = config->focus_px;
    s->render.sigma_px = config->sigma_px;
    s->render.c1 = config->c1;
    s->render.c2 = config->c2;
    s->render.label_factor = config->label_factor;
    s->render.verify = config->verify_rays ? SST_VERIFY_ON : SST_VERIFY_OFF;
    s->render.threads = config->threads;
}

static void follow_clear(struct view_settings *s, const struct sst_live_settings *from,
                         const struct sst_live_settings *to)
{
    if (from->method != to->method)
        s->render.method = (enum sst_render_method)to->method;
    if (from->cut_px != to->cut_px && !(isnan(from->cut_px) && isnan(to->cut_px)))
        s->render.cut_px = to->cut_px;
    if (strcmp(from->remove_label, to->remove_label) != 0)
        snprintf(s->remove_label, sizeof(s->remove_label), "%s", to->remove_label);
    if (from->outline != to->outline)
        s->outline = to->outline;
    if (from->tint != to->tint)
        s->tint = to->tint;
    if (from->outline_moving != to->outline_moving)
        s->outline_moving = to->outline_moving;
    if (from->keep_moving != to->keep_moving)
        s->keep_moving = to->keep_moving;
}

void view_settings_follow(struct view_settings *s, const struct sst_live_settings *from,
                          const struct sst_live_settings *to)
{
    follow_clear(s, from, to);
    if (from->focus_px != to->focus_px && !(isnan(from->focus_px) && isnan(to->focus_px))) {
        s->render.focus_px = to->focus_px;
        s->follow = false;
    }
    if (from->sigma_px != to->sigma_px)
        s->render.sigma_px = to->sigma_px;
    if (from->c1 != to->c1)
        s->render.c1 = to->c1;
    if (from->c2 != to->c2)
        s->render.c2 = to->c2;
    if (from->label_factor != to->label_factor)
        s->render.label_factor = to->label_factor;
    s->render.verify = to->verify_rays ? SST_VERIFY_ON : SST_VERIFY_OFF;
    s->render.threads = to->threads;
}

static int parse_number(struct view_settings *s, size_t i, const json_t *value, char error[512])
{
    const double v = json_number_value(value);

    if (json_is_null(value) && numbers[i].null) {
        *member_of(s, i) = numbers[i].natural;
        return 0;
    }
    if (!json_is_number(value) || !(v >= numbers[i].min && v <= numbers[i].max))
        return sst_api_refuse(error, -EINVAL, "%s must be a number from %.10g to %.10g%s", numbers[i].key, numbers[i].min,
                              numbers[i].max, numbers[i].null ? " or null" : "");
    *member_of(s, i) = v;
    return 0;
}

static int parse_method(struct view_settings *s, const json_t *value, char error[512])
{
    const char *text = json_string_value(value);

    for (size_t i = 0; text && i < ARRAY_LEN(methods); i++) {
        if (!strcmp(text, methods[i])) {
            s->render.method = (enum sst_render_method)i;
            return 0;
        }
    }
    return sst_api_refuse(error, -EINVAL, "method must be \"clear\", \"sst\" or \"refocus\"");
}

static int parse_label(char label[SST_CLASS_NAME_MAX], const char *key, const json_t *value, char error[512])
{
    const char *text = json_is_null(value) ? "" : json_string_value(value);

    if (!text || strlen(text) >= SST_CLASS_NAME_MAX)
        return sst_api_refuse(error, -EINVAL, "%s must be the name of a class, see /api/v1/labels, or \"\"", key);
    snprintf(label, SST_CLASS_NAME_MAX, "%s", text);
    return 0;
}

/* Switches. */
static const struct {
    const char *key;
    size_t member; /* of struct view_settings */
} flags[] = {
    { "follow", offsetof(struct view_settings, follow) },
    { "outline", offsetof(struct view_settings, outline) },
    { "tint", offsetof(struct view_settings, tint) },
    { "outline_moving", offsetof(struct view_settings, outline_moving) },
    { "keep_moving", offsetof(struct view_settings, keep_moving) },
};

static bool *flag_of(struct view_settings *s, size_t i)
{
    return (bool *)((char *)s + flags[i].member);
}

static int parse_flag(struct view_settings *s, const char *key, const json_t *value, char error[512])
{
    bool *flag = NULL;

    for (size_t i = 0; i < ARRAY_LEN(flags); i++)
        flag = strcmp(key, flags[i].key) != 0 ? flag : flag_of(s, i);
    assert(flag); /* all keys are known */
    if (!json_is_boolean(value))
        return sst_api_refuse(error, -EINVAL, "%s must be true or false", key);
    *flag = json_is_true(value);
    return 0;
}

static int parse_track(struct view_settings *s, const json_t *value, char error[512])
{
    const json_int_t id = json_integer_value(value);

    if (!json_is_integer(value) || id < 0 || id > UINT32_MAX)
        return sst_api_refuse(error, -EINVAL, "follow_track must be a track of /api/v1/tracks, or 0");
    s->follow_track = (uint32_t)id;
    return 0;
}

static int parse_member(struct view_settings *s, const char *key, const json_t *value, char error[512])
{
    for (size_t i = 0; i < ARRAY_LEN(numbers); i++)
        if (!strcmp(key, numbers[i].key))
            return parse_number(s, i, value, error);
    if (!strcmp(key, "method"))
        return parse_method(s, value, error);
    if (!strcmp(key, "focus_label"))
        return parse_label(s->focus_label, key, value, error);
    if (!strcmp(key, "remove_label"))
        return parse_label(s->remove_label, key, value, error);
    if (!strcmp(key, "follow_track"))
        return parse_track(s, value, error);
    return parse_flag(s, key, value, error);
}

int view_settings_take(struct view_settings *s, const json_t *from, char error[512])
{
    static const char *const known[] = { "method",   "cut_px",       "remove_label", "outline",      "tint",
                                         "focus_px", "focus_label",  "follow",       "sigma_px",     "c1",
                                         "c2",       "label_factor", "aperture",     "follow_track", "outline_moving",
                                         "keep_moving", NULL };
    struct view_settings to = *s;
    const char *key;
    json_t *value;

    if (!json_is_object(from))
        return sst_api_refuse(error, -EINVAL, "the settings of a view are an object, like {\"focus_px\": 12}");
    if (sst_api_members(from, known, error))
        return -EINVAL;
    if (json_object_get(from, "focus_px") || json_object_get(from, "focus_label") || json_object_get(from, "follow"))
        to.follow_track = 0; /* another focus ends following */
    json_object_foreach((json_t *)from, key, value)
    {
        const int err = parse_member(&to, key, value, error);

        if (err)
            return err;
    }
    *s = to;
    return 0;
}

json_t *view_settings_json(const struct view_settings *s)
{
    json_t *o = json_pack("{s:s, s:s, s:s, s:I}", "method", methods[s->render.method], "focus_label", s->focus_label,
                          "remove_label", s->remove_label, "follow_track", (json_int_t)s->follow_track);

    for (size_t i = 0; i < ARRAY_LEN(flags) && o; i++)
        json_object_set_new(o, flags[i].key, json_boolean(*flag_of((struct view_settings *)s, i)));

    for (size_t i = 0; i < ARRAY_LEN(numbers) && o; i++) {
        const double v = *member_of((struct view_settings *)s, i);
        const bool null = isnan(v) || isinf(v) || (numbers[i].null && v == numbers[i].natural);

        json_object_set_new(o, numbers[i].key, null ? json_null() : json_real(v));
    }
    return o;
}
