/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/rig/rig_still.h"

#include <ctype.h>
#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "pipeline/image/develop.h"

struct sst_scan_still {
    struct sst_still *still;
    bool raw_only;
    struct sst_still_shot shot;
    struct sst_frame frame;
    struct sst_scan_original original;
    char extension[16];
    uint32_t sequence;
};

/* --- as a camera of a rig ----------------------------------------------------------------------------------------- */

/** The part of a name behind its last dot, in lower case; "raw" if there is none. */
static void set_extension(struct sst_scan_still *s, const char *name)
{
    const char *dot = strrchr(name, '.');

    snprintf(s->extension, sizeof(s->extension), "%s", dot && dot[1] ? dot + 1 : "raw");
    for (char *c = s->extension; *c; c++)
        *c = isalnum((unsigned char)*c) ? (char)tolower((unsigned char)*c) : '_';
}

/** The JPEG is the view; of a raw file alone the store develops one. */
static void fill_frame(struct sst_scan_still *s)
{
    const struct sst_still_file *view = &s->shot.file[s->shot.files - 1];

    s->frame = (struct sst_frame){
        .fourcc = s->raw_only ? SST_SCAN_RAW : V4L2_PIX_FMT_MJPEG,
        .width = view->width,
        .height = view->height,
        .data = view->data,
        .bytes = view->bytes,
        .sequence = s->sequence++,
        .t_ns = s->shot.release_ns,
        .arrival_ns = sst_clock_now_ns(),
    };
    if (s->shot.file[0].raw) {
        set_extension(s, s->shot.file[0].name);
        s->original = (struct sst_scan_original){ .extension = s->extension,
                                                  .data = s->shot.file[0].data,
                                                  .bytes = s->shot.file[0].bytes };
    }
}

/* Every step of an exposure has a time-out of its own, by the configuration of the camera. */
static int expose(void *arg, int64_t after_ns, int timeout_ms SST_UNUSED, struct sst_frame **frame)
{
    struct sst_scan_still *s = arg;
    int err;

    sst_clock_sleep_until(after_ns);
    err = sst_still_capture(s->still, &s->shot);
    if (err)
        return err;
    fill_frame(s);
    *frame = &s->frame;
    return 0;
}

static void release(void *arg, struct sst_frame *frame SST_UNUSED)
{
    struct sst_scan_still *s = arg;

    s->original = (struct sst_scan_original){ .data = NULL };
    sst_still_release_files(s->still, &s->shot);
}

static const struct sst_scan_original *original(void *arg)
{
    const struct sst_scan_still *s = arg;

    return s->original.data ? &s->original : NULL;
}

static json_t *state(void *arg)
{
    return sst_scan_still_state(arg);
}

/* --- reports ------------------------------------------------------------------------------------------------------ */

static json_t *number_or_null(int64_t value)
{
    return value < 0 ? json_null() : json_integer(value);
}

json_t *sst_scan_still_state(const struct sst_scan_still *s)
{
    struct sst_still_state now;

    sst_still_state(s->still, &now);
    return json_pack("{s:o, s:o, s:o, s:o}", "battery_percent", number_or_null(now.battery_percent), "card_bytes",
                     number_or_null(now.card_bytes), "card_free_bytes", number_or_null(now.card_free_bytes),
                     "card_pictures", number_or_null(now.card_pictures));
}

static void log_camera(const struct sst_scan_still *s)
{
    struct sst_still_state now;
    char text[160] = "";

    sst_still_state(s->still, &now);
    if (now.battery_percent >= 0)
        sst_text_add(text, sizeof(text), "; battery %d %%", now.battery_percent);
    if (now.card_free_bytes >= 0)
        sst_text_add(text, sizeof(text), "; card %.0f of %.0f MB free", (double)now.card_free_bytes * 1e-6,
                     (double)now.card_bytes * 1e-6);
    if (now.card_pictures >= 0)
        sst_text_add(text, sizeof(text), ", space for %d pictures", now.card_pictures);
    sst_log_info("still camera %s at %s: %s%s", sst_still_serial(s->still), sst_still_port(s->still),
                 sst_still_settings(s->still), text);
}

void sst_scan_still_counters(const struct sst_scan_still *s, struct sst_still_counters *out)
{
    sst_still_counters(s->still, out);
}

/* --- open and close ----------------------------------------------------------------------------------------------- */

int sst_scan_still_open(struct sst_scan_still **out, const struct sst_still_config *cfg, struct sst_scan_camera *camera)
{
    struct sst_scan_still *s;
    int err;

    if (cfg->files == SST_STILL_RAW && !sst_image_can_develop()) {
        sst_log_error("files: raw needs LibRaw to develop the views, which is not there; install libraw-dev and build "
                      "again, or use raw+jpeg");
        return -ENOPKG;
    }
    s = calloc(1, sizeof(*s));
    if (!s)
        return -ENOMEM;
    s->raw_only = cfg->files == SST_STILL_RAW;
    err = sst_still_open(&s->still, cfg);
    if (err) {
        sst_scan_still_close(s);
        return err;
    }
    log_camera(s);
    *camera = (struct sst_scan_camera){ .arg = s,
                                        .expose = expose,
                                        .release = release,
                                        .serial = sst_still_serial(s->still),
                                        .port = sst_still_port(s->still),
                                        .original = original,
                                        .state = state };
    *out = s;
    return 0;
}

void sst_scan_still_close(struct sst_scan_still *s)
{
    if (!s)
        return;
    if (s->still)
        sst_still_release_files(s->still, &s->shot);
    sst_still_close(s->still);
    free(s);
}
