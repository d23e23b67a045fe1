/* The still camera of sst capture rig: options, configuration, report. */
#include <linux/videodev2.h>
#include <stdio.h>
#include <string.h>

#include "base/text.h"
#include "cli/cli_internal.h"

/* For the estimates before a capture: a camera of 24 megapixels. */
#define JPEG_BYTES 10000000
#define RAW_BYTES  30000000
#define SHOT_S     2.0

const char *cli_still_selected(const char *camera)
{
    if (!camera || strncmp(camera, "still", 5) != 0)
        return NULL;
    return camera[5] == ':' ? camera + 6 : camera[5] ? NULL : "";
}

int cli_still_check(const struct cli_command *cmd, const char *still, const struct cli_still_options *o)
{
    const char *option = o->files      ? "--files"
                         : o->exposure ? "--exposure"
                         : o->aperture ? "--aperture"
                         : o->iso      ? "--iso"
                         : o->focus    ? "--focus"
                                       : NULL;

    if (!still && option)
        return cli_usage_error(cmd, "%s sets a still camera; add --camera still, or use controls: in the configuration",
                               option);
    return CLI_GO_ON;
}

/* @return the index of a word, -1: none */
static int choose(const char *word, const char *const *words, int count)
{
    for (int i = 0; i < count; i++)
        if (!strcmp(word, words[i]))
            return i;
    return -1;
}

static void override(char *value, size_t size, const char *option)
{
    if (option)
        snprintf(value, size, "%s", option);
}

int cli_still_configure(const struct cli_command *cmd, const struct cli_still_options *o, const char *format,
                        struct sst_array_config *a, struct sst_scan_config *cfg)
{
    static const char *const files[] = { "jpeg", "raw", "raw+jpeg" };
    static const char *const focuses[] = { "leave", "manual", "locked" };
    const int kind = o->files ? choose(o->files, files, ARRAY_LEN(files)) : (int)a->still_files;
    const int focus = o->focus ? choose(o->focus, focuses, ARRAY_LEN(focuses)) : (int)a->still_focus;

    if (kind < 0)
        return cli_usage_error(cmd, "--files %s is none of jpeg, raw and raw+jpeg", o->files);
    if (focus < 0)
        return cli_usage_error(cmd, "--focus %s is none of manual, locked and leave", o->focus);
    a->still_files = (enum sst_config_files)kind;
    a->still_focus = (enum sst_config_focus)focus;
    override(a->still_exposure, sizeof(a->still_exposure), o->exposure);
    override(a->still_aperture, sizeof(a->still_aperture), o->aperture);
    override(a->still_iso, sizeof(a->still_iso), o->iso);
    override(a->still_format, sizeof(a->still_format), format);
    cfg->fourcc = kind == SST_CONFIG_RAW ? SST_SCAN_RAW : V4L2_PIX_FMT_MJPEG;
    cfg->width = cfg->height = 0;
    cfg->shot_s = SHOT_S + a->still_mirror_ms / 1000.0;
    cfg->view_bytes = (kind != SST_CONFIG_RAW ? JPEG_BYTES : 0) + (kind != SST_CONFIG_JPEG ? RAW_BYTES : 0);
    return CLI_GO_ON;
}

void cli_still_text(const struct sst_array_config *a, char *text, size_t size)
{
    static const char *const files[] = { "jpeg", "raw", "raw+jpeg" };
    static const char *const focuses[] = { "leave", "manual", "locked" };

    text[0] = 0;
    sst_text_add(text, size, "still,files=%s,exposure=%s,aperture=%s,iso=%s,format=%s,focus=%s", files[a->still_files],
                 a->still_exposure, a->still_aperture, a->still_iso, a->still_format, focuses[a->still_focus]);
}

void cli_still_config(struct sst_still_config *out, const struct sst_array_config *a, const char *camera, bool resumed,
                      const SST_ATOMIC(bool) * cancel)
{
    static const enum sst_still_files files[] = { SST_STILL_JPEG, SST_STILL_RAW, SST_STILL_BOTH };
    static const enum sst_still_focus focuses[] = { SST_STILL_FOCUS_LEAVE, SST_STILL_FOCUS_MANUAL,
                                                    SST_STILL_FOCUS_LOCKED };

    sst_still_config_defaults(out);
    out->camera = camera;
    out->exposure = a->still_exposure;
    out->aperture = a->still_aperture;
    out->iso = a->still_iso;
    out->format = a->still_format;
    out->focus = focuses[a->still_focus];
    out->focused = resumed;
    out->files = files[a->still_files];
    out->mirror_ms = a->still_mirror_ms;
    out->card_ms = a->still_card_ms;
    out->quiet_ms = a->still_quiet_ms;
    out->response_ms = a->still_response_ms;
    out->reopen_ms = a->still_reopen_ms;
    out->battery_percent = a->still_battery_percent;
    out->keep = a->still_keep;
    out->cancel = cancel;
}

json_t *cli_still_report(const struct sst_scan_still *still)
{
    json_t *all = sst_scan_still_state(still), *counts;
    struct sst_still_counters n;

    sst_scan_still_counters(still, &n);
    counts = json_pack("{s:i, s:i, s:i, s:i, s:i, s:i, s:i}", "exposures", n.exposures, "busy", n.busy, "silent",
                       n.silent, "lost", n.lost, "damaged", n.damaged, "refused", n.refused, "reopened", n.reopened);
    if (!all || !counts || json_object_update(all, counts)) {
        json_decref(all);
        all = NULL;
    }
    json_decref(counts);
    return all;
}

void cli_still_print(const json_t *report)
{
    static const struct {
        const char *key, *text;
    } counts[] = { { "busy", "waited for it" },    { "silent", "without an answer" }, { "lost", "transfers failed" },
                   { "damaged", "damaged files" }, { "refused", "settings refused" }, { "reopened", "opened again" } };
    const json_t *battery = json_object_get(report, "battery_percent");
    const json_t *free_bytes = json_object_get(report, "card_free_bytes");

    if (!battery)
        return;
    printf("still camera: %d exposures", (int)json_integer_value(json_object_get(report, "exposures")));
    for (size_t i = 0; i < ARRAY_LEN(counts); i++) {
        const int n = (int)json_integer_value(json_object_get(report, counts[i].key));

        if (n)
            printf(", %d %s", n, counts[i].text);
    }
    if (json_is_integer(battery))
        printf("; battery %d %%", (int)json_integer_value(battery));
    if (json_is_integer(free_bytes))
        printf("; card %.0f MB free", (double)json_integer_value(free_bytes) * 1e-6);
    printf("\n");
}
