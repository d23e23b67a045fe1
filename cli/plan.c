/* sst plan: predicts which cameras can stream together, and the rates of live pictures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "cli/plan_internal.h"

#define ADVICE_MAX 1024

static json_t *camera_json(const struct cli_usb *u, const struct sst_usb_stream *s)
{
    const struct sst_usb_device *d = &u->devices[s->device];

    return json_pack("{s:s, s:o, s:s, s:i, s:i, s:f, s:s, s:b}", "port", d->port, "serial", cli_text_json(d->serial),
                     "node", d->node, "speed_mbit", d->speed_mbit, "setting", s->alt, "reserved_mbit", s->reserved_mbit,
                     "segment", u->plan.segments[s->segment].name, "fits", s->fits);
}

static int print_json(const struct cli_usb *u, const struct sst_array_config *cfg, const char *advice)
{
    json_t *cameras = json_array(), *segments = json_array(), *root;
    const char *format = sst_array_format_name(cfg->fourcc);

    for (int i = 0; i < u->stream_count; i++)
        json_array_append_new(cameras, camera_json(u, &u->streams[i]));
    for (int i = 0; i < u->plan.segment_count; i++) {
        const struct sst_usb_segment *s = &u->plan.segments[i];

        json_array_append_new(segments,
                              json_pack("{s:s, s:f, s:f, s:i, s:i}", "name", s->name, "reserved_mbit", s->reserved_mbit,
                                        "limit_mbit", s->limit_mbit, "cameras", s->streams, "refused", s->refused));
    }
    root = json_pack("{s:s?, s:i, s:i, s:s, s:f, s:I, s:i, s:o, s:o, s:s}", "format", format, "width", cfg->width,
                     "height", cfg->height, "split", cfg->split, "rate_hz", cfg->rate_hz, "needed_bytes_s",
                     (json_int_t)u->needed_bytes_s, "refused", u->plan.refused, "cameras", cameras, "segments",
                     segments, "advice", advice);
    return cli_dump_json(root, JSON_INDENT(2));
}

static void print_text(const struct cli_usb *u, const struct sst_array_config *cfg, const char *advice)
{
    const char *format = sst_array_format_name(cfg->fourcc);
    int split[2];
    const int parts = sst_array_split(cfg, split);

    if (parts > 1)
        printf("%d devices with %s cameras each, ", u->stream_count, cfg->split);
    else
        printf("%d cameras, ", u->stream_count);
    printf("%s %dx%d at %g/s: ", format ? format : "?", split[1] * cfg->width, split[0] * cfg->height, cfg->rate_hz);
    if (u->needed_bytes_s)
        printf("%.1f MB/s each\n", (double)u->needed_bytes_s / 1e6);
    else
        printf("compressed, so each is assumed to request its largest packets\n");
    printf("\n%-52s %9s %9s %8s %8s\n", "wire", "Mbit/s", "of", "cameras", "refused");
    for (int i = 0; i < u->plan.segment_count; i++) {
        const struct sst_usb_segment *s = &u->plan.segments[i];

        printf("%-52s %9.1f %9.1f %8d %8d\n", s->name, s->reserved_mbit, s->limit_mbit, s->streams, s->refused);
    }
    printf("\n%-12s %-20s %-14s %7s %9s\n", "port", "serial", "node", "setting", "Mbit/s");
    for (int i = 0; i < u->stream_count; i++) {
        const struct sst_usb_stream *s = &u->streams[i];
        const struct sst_usb_device *d = &u->devices[s->device];

        printf("%-12s %-20s %-14s %7d %9.1f  %s\n", d->port, d->serial, d->node, s->alt, s->reserved_mbit,
               s->fits ? "fits" : "refused: \"No space left on device\" at its start");
    }
    if (*advice)
        printf("\n%s\n", advice);
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    static struct sst_array_config cfg; /* large */
    const char *config = NULL, *format = NULL;
    char advice[ADVICE_MAX];
    int size[2] = { 0 };
    double rate_hz = 0;
    bool json = false, live = false;
    struct cli_usb usb;
    const struct cli_option options[] = {
        { "config", 'c', CLI_STRING, &config, "FILE", "configuration (/etc/sst/sstd.yaml if it exists)" },
        { "format", 'f', CLI_STRING, &format, "F", "instead of the configured one: MJPEG YUYV GREY ..." },
        { "size", 0, CLI_SIZE, size, "WxH", "instead of the configured one", 1, 16384 },
        { "rate", 'r', CLI_DOUBLE, &rate_hz, "R", "frames/s, instead of the configured ones", 0.01, 1000 },
        { "live", 0, CLI_FLAG, &live, NULL, "rates of live pictures on this machine, of cameras with live: poses" },
        { "json", 0, CLI_FLAG, &json, NULL, "print one JSON object" },
    };
    int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    int err;

    if (r != CLI_GO_ON)
        return r;
    if (live && (format || rate_hz > 0))
        return cli_usage_error(cmd, "--format and --rate are of USB, not of --live");
    if (live)
        return plan_live(config, size, json);
    err = sst_array_config_read(&cfg, config);
    if (err)
        return cli_exit_code(err);
    if (format && !sst_array_format(format))
        return cli_usage_error(cmd, "unknown --format %s; choose MJPEG, YUYV, GREY, Y16 or four characters", format);
    cfg.fourcc = format ? sst_array_format(format) : cfg.fourcc;
    cfg.width = size[0] ? size[0] : cfg.width;
    cfg.height = size[1] ? size[1] : cfg.height;
    cfg.rate_hz = rate_hz > 0 ? rate_hz : cfg.rate_hz;
    err = cli_usb_open(&usb, &cfg);
    if (err)
        return cli_exit_code(err);
    if (!usb.stream_count) {
        sst_log_error("plan: none of %d USB devices is %s; `sst topology` shows what is plugged in", usb.count,
                      cfg.bound ? "a camera of the configuration" : "a camera");
        cli_usb_close(&usb);
        return CLI_INPUT;
    }
    cli_usb_advise(&usb, &cfg, advice, sizeof(advice));
    r = CLI_OK;
    if (json)
        r = print_json(&usb, &cfg, advice);
    else
        print_text(&usb, &cfg, advice);
    if (usb.plan.refused)
        r = CLI_INPUT;
    cli_usb_close(&usb);
    return r;
}

const struct cli_command cli_plan = { "plan", run };
