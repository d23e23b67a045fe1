/* Settings of the camera: their names in cameras, the choice that a text stands for, setting and reading back.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/log.h"
#include "base/text.h"
#include "drivers/still/still_internal.h"

#define NAMES     3
#define TOLERANCE 0.03 /* cameras round 1/60 s to 0.0166 */
#define LIST_MAX  400

enum setting {
    EXPOSURE = 0,
    APERTURE = 1,
    ISO = 2,
    FORMAT = 3,
    FOCUS = 4,
};

static const struct {
    const char *what, *option, *name[NAMES]; /* of libgphoto2's settings, by maker */
} settings[STILL_SETTINGS] = {
    [EXPOSURE] = { "exposure time", "exposure", { "shutterspeed", "shutterspeed2", "exptime" } },
    [APERTURE] = { "aperture", "aperture", { "aperture", "f-number" } },
    [ISO] = { "ISO", "iso", { "iso" } },
    [FORMAT] = { "format", "format", { "imageformat", "imagequality" } },
    [FOCUS] = { "focus mode", "focus", { "focusmode", "focusmode2" } },
};

/* --- choices ------------------------------------------------------------------------------------------------------ */

/** "f/8", "1/125", "0.0050s", "ISO 400", "Unknown value 0004"; false: no number, or more than one. */
static bool number_of(const char *text, double *out)
{
    static const char *const heads[] = { "f/", "F", "ISO ", "Unknown value " };
    bool hexadecimal = false;
    char *end;
    double v;

    for (size_t i = 0; i < ARRAY_LEN(heads); i++)
        if (!strncasecmp(text, heads[i], strlen(heads[i])) && isdigit((unsigned char)text[strlen(heads[i])])) {
            text += strlen(heads[i]);
            hexadecimal = heads[i][0] == 'U';
            break;
        }
    if (!isdigit((unsigned char)*text) && *text != '.')
        return false;
    v = hexadecimal ? (double)strtol(text, &end, 16) : strtod(text, &end);
    if (*end == '/' && isdigit((unsigned char)end[1])) {
        const double below = strtod(end + 1, &end);

        if (below == 0)
            return false;
        v /= below;
    }
    end += *end == 's' || *end == '"';
    while (isspace((unsigned char)*end))
        end++;
    *out = v;
    return !*end && isfinite(v);
}

int still_choice_find(const struct still_setting *setting, const char *text)
{
    double wanted, v, best = TOLERANCE;
    int found = -1;

    for (int i = 0; i < setting->choices; i++)
        if (!strcasecmp(setting->choice[i], text))
            return i;
    if (!number_of(text, &wanted) || wanted <= 0)
        return -1;
    for (int i = 0; i < setting->choices; i++) {
        const double off = number_of(setting->choice[i], &v) ? fabs(v - wanted) / wanted : INFINITY;

        if (off < best) {
            best = off;
            found = i;
        }
    }
    return found;
}

/** Words that start or are the manual focus modes of cameras: "Manual", "MF", "MF (fixed)". */
static int find_focus(const struct still_setting *setting, bool automatic)
{
    static const char *const manual[] = { "Manual", "MF" };
    static const char *const automatics[] = { "Automatic", "One Shot", "AF-S", "AF-A", "Single" };
    const char *const *words = automatic ? automatics : manual;
    const size_t count = automatic ? ARRAY_LEN(automatics) : ARRAY_LEN(manual);

    for (size_t w = 0; w < count; w++)
        for (int i = 0; i < setting->choices; i++)
            if (!strncasecmp(setting->choice[i], words[w], strlen(words[w])))
                return i;
    return -1;
}

static void list_choices(const struct still_setting *setting, char *out, size_t size)
{
    out[0] = 0;
    for (int i = 0; i < setting->choices; i++) {
        if (strlen(out) + strlen(setting->choice[i]) + 16 > size) {
            sst_text_add(out, size, " ...");
            break;
        }
        sst_text_add(out, size, "%s%s", i ? ", " : "", setting->choice[i]);
    }
}

/* --- one setting -------------------------------------------------------------------------------------------------- */

/** Read a setting by the name that this camera has for it. @return 0, -ENOENT, or an error of the library, logged */
static int read_setting(struct sst_still *s, int which, struct still_setting *out)
{
    int err = -ENOENT;

    if (s->setting_name[which]) {
        err = still_lib_read(s->lib, s->setting_name[which], out);
        if (err == -ENOENT) /* it was there */
            err = -EIO;
    } else {
        for (int i = 0; err == -ENOENT && i < NAMES && settings[which].name[i]; i++) {
            err = still_lib_read(s->lib, settings[which].name[i], out);
            if (!err)
                s->setting_name[which] = settings[which].name[i];
        }
    }
    return !err || err == -ENOENT ? err : still_failed(s, err, "reading a setting");
}

/** @return the choice, -1: none; any text is fine where the camera has no list. */
static int find_choice(const struct sst_still *s, int which, const struct still_setting *now, bool automatic)
{
    return which == FOCUS ? find_focus(now, automatic) : still_choice_find(now, s->wanted[which]);
}

/** @param said  message of the library; "": the camera accepted it without effect */
static int refused(struct sst_still *s, int which, const char *value, const char *said)
{
    struct still_setting now = { .value = "another one" };
    char list[LIST_MAX];
    const int err = still_lib_read(s->lib, s->setting_name[which], &now);

    if (err)
        return still_failed(s, err, "reading a setting");
    list_choices(&now, list, sizeof(list));
    s->count.refused++;
    sst_log_error(
        "still camera %s refuses %s %s and keeps %s%s%s; turn its mode dial to M, or choose another value%s%s",
        s->serial, settings[which].what, value, now.value, said[0] ? ": " : "", said, list[0] ? " of " : "", list);
    return -EPERM;
}

/** Set a choice and read it back, which takes some cameras a moment. */
static int set_choice(struct sst_still *s, int which, const char *value, struct still_setting *now)
{
    int err = still_lib_write(s->lib, s->setting_name[which], value);

    for (int i = 0; err == -EBUSY && i < 20 && !still_cancelled(s); i++) {
        still_sleep_ms(100);
        err = still_lib_write(s->lib, s->setting_name[which], value);
    }
    if (err == -EPERM || err == -EIO) { /* libgphoto2 has one error for all answers of the camera */
        char said[256];

        snprintf(said, sizeof(said), "%s", still_lib_said(s->lib));
        return refused(s, which, value, said);
    }
    if (err)
        return still_failed(s, err, "changing a setting");
    for (int i = 0; i < 20 && !still_cancelled(s); i++) {
        err = read_setting(s, which, now);
        if (err || !strcmp(now->value, value))
            return err;
        still_sleep_ms(100);
    }
    return still_cancelled(s) ? -ECANCELED : refused(s, which, value, "");
}

static int apply(struct sst_still *s, int which, bool automatic)
{
    struct still_setting now;
    int err = read_setting(s, which, &now), choice;
    char list[LIST_MAX];

    if (err == -ENOENT) {
        sst_log_error("still camera %s has no setting for the %s; set it on the camera and leave out still: %s",
                      s->serial, settings[which].what, settings[which].option);
        return -EINVAL;
    }
    if (err)
        return err;
    choice = find_choice(s, which, &now, automatic);
    if (choice < 0 && (now.choices || which == FOCUS)) {
        list_choices(&now, list, sizeof(list));
        sst_log_error("still camera %s has no %s `%s`; choose one of %s", s->serial, settings[which].what,
                      which == FOCUS ? automatic ? "automatic" : "manual" : s->wanted[which], list);
        return -EINVAL;
    }
    if (!strcmp(now.value, choice < 0 ? s->wanted[which] : now.choice[choice]))
        return 0;
    return set_choice(s, which, choice < 0 ? s->wanted[which] : now.choice[choice], &now);
}

/* --- all ---------------------------------------------------------------------------------------------------------- */

int still_settings_focus(struct sst_still *s, bool automatic)
{
    return apply(s, FOCUS, automatic);
}

int still_settings_apply(struct sst_still *s)
{
    struct still_setting now;
    char text[sizeof(s->settings)] = "";
    int err = 0;

    for (int i = 0; !err && i < STILL_SETTINGS; i++)
        if (i == FOCUS ? s->cfg.focus != SST_STILL_FOCUS_LEAVE : s->wanted[i][0])
            err = apply(s, i, false);
    for (int i = 0; !err && i < STILL_SETTINGS; i++) {
        err = read_setting(s, i, &now);
        if (!err)
            sst_text_add(text, sizeof(text), "%s%s %s", text[0] ? ", " : "", settings[i].what, now.value);
        err = err == -ENOENT ? 0 : err;
    }
    if (!err)
        memcpy(s->settings, text, sizeof(text));
    return err;
}

int still_settings_status(struct sst_still *s)
{
    struct sst_still_state state = {
        .battery_percent = -1, .card_bytes = -1, .card_free_bytes = -1, .card_pictures = -1
    };
    struct still_setting now;
    int err = still_lib_read(s->lib, "batterylevel", &now);
    double percent;

    if (!err && strchr(now.value, '%')) {
        *strchr(now.value, '%') = 0;
        if (number_of(now.value, &percent))
            state.battery_percent = sst_clamp_int((int)lround(fmin(percent, 100)), 0, 100);
    }
    err = err == -ENOENT ? 0 : err;
    err = err ? err : still_lib_storage(s->lib, &state);
    if (err)
        return still_failed(s, err, "asking for battery and card");
    s->state = state;
    return 0;
}
