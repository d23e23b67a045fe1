/* sst status: state of the service, on one screen. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "cli/cli_internal.h"

#define TEXT      300
#define NOTICED_MAX 140 /* bytes of a sentence: one line */
#define NAMED_MAX 12 /* cameras named; more are counted */

static bool coloured(void)
{
    const char *no = getenv("NO_COLOR"), *term = getenv("TERM");

    return isatty(STDOUT_FILENO) && !(no && *no) && term && strcmp(term, "dumb") != 0;
}

/* --- lines ---------------------------------------------------------------------------------------------------------
 */

static void print_head(const json_t *s)
{
    char version[TEXT], state[TEXT], reason[TEXT], up[CLI_SHORT];
    const char *colour = "33"; /* yellow */

    cli_text(s, "state", state, sizeof(state));
    cli_text(s, "reason", reason, sizeof(reason));
    if (!strcmp(state, "capturing"))
        colour = "32"; /* green */
    else if (!strcmp(state, "failed"))
        colour = "31"; /* red */
    if (!coloured())
        printf("%s", *state ? state : "?");
    else
        printf("\033[1;%sm%s\033[0m", colour, *state ? state : "?");
    printf("%s%s (sst %s, up %s)\n", *reason ? ": " : "", reason, cli_text(s, "version", version, sizeof(version)),
           cli_duration_text(up, cli_number(s, "uptime_s")));
}

static bool streams(const json_t *cam)
{
    char state[TEXT];

    return !strcmp(cli_text(cam, "state", state, sizeof(state)), "streaming");
}

static bool alike(const json_t *a, const json_t *b)
{
    return json_equal(cli_member(a, "state"), cli_member(b, "state")) &&
           json_equal(cli_member(a, "reason"), cli_member(b, "reason"));
}

/* "r0c5, r0c6 and 3 more absent (unplugged)": the camera at `first`, and later ones in its state. */
static void print_alike(const json_t *list, size_t first)
{
    const json_t *like = json_array_get(list, first);
    char state[TEXT], name[TEXT], reason[TEXT];
    int n = 0;

    for (size_t i = first; i < json_array_size(list); i++) {
        const json_t *cam = json_array_get(list, i);

        if (alike(cam, like) && n++ < NAMED_MAX)
            printf("%s%s", n > 1 ? ", " : "", cli_text(cam, "name", name, sizeof(name)));
    }
    if (n > NAMED_MAX)
        printf(" and %d more", n - NAMED_MAX);
    cli_text(like, "state", state, sizeof(state));
    cli_text(like, "reason", reason, sizeof(reason));
    printf(" %s%s%s%s", state, *reason ? " (" : "", reason, *reason ? ")" : "");
}

/* "r0c5, r1c5 absent (unplugged); r3c2 recovering": cameras that do not stream, by reason. */
static void print_missing(const json_t *cameras)
{
    const json_t *list = cli_member(cameras, "cameras");
    bool any = false;

    for (size_t i = 0; i < json_array_size(list); i++) {
        const json_t *cam = json_array_get(list, i);
        bool shown = streams(cam);

        for (size_t k = 0; k < i && !shown; k++)
            shown = alike(json_array_get(list, k), cam);
        if (shown)
            continue;
        printf("%s", any ? "; " : "  missing    ");
        print_alike(list, i);
        any = true;
    }
    if (any)
        printf("\n");
}

static void print_capture(const json_t *s)
{
    const double sets = cli_number(s, "capture.sets"), complete = cli_number(s, "capture.complete");
    const double dropped = cli_number(s, "capture.dropped"), refused = cli_number(s, "capture.refused");
    char source[TEXT];

    printf("  capture    %.0f of %.0f cameras at %.1f Hz, trigger %s; %.0f sets", cli_number(s, "capture.present"),
           cli_number(s, "capture.cameras"), cli_number(s, "capture.rate_hz"),
           cli_text(s, "capture.trigger.source", source, sizeof(source)), sets);
    if (sets > 0)
        printf(", %.4g %% complete", 100 * complete / sets);
    if (dropped > 0)
        printf(", %.0f dropped", dropped);
    if (refused > 0)
        printf(", %.0f refused for want of memory", refused);
    printf("\n");
}

/* Frames that are in no set, by why. */
static void print_frames(const json_t *s)
{
    static const char *const why[] = { "late", "duplicate", "stray", "corrupt", "flagged", "dropped", "unexplained" };
    bool any = false;

    for (size_t i = 0; i < ARRAY_LEN(why); i++) {
        char path[64];
        double n;

        snprintf(path, sizeof(path), "capture.frames.%s", why[i]);
        n = cli_number(s, path);
        if (n > 0)
            printf("%s%.0f %s", any ? ", " : "  frames     not in a set: ", n, why[i]);
        any |= n > 0;
    }
    if (any)
        printf("; of %.0f\n", cli_number(s, "capture.frames.delivered"));
}

static void print_skew(const json_t *s)
{
    const double over = cli_number(s, "capture.skew_us.over");
    char worst[TEXT];

    if (isnan(cli_number(s, "capture.skew_us.p50")))
        return;
    printf("  skew       p50 %.0f us, p99 %.0f, max %.0f; limit %.0f", cli_number(s, "capture.skew_us.p50"),
           cli_number(s, "capture.skew_us.p99"), cli_number(s, "capture.skew_us.max"),
           cli_number(s, "capture.skew_us.limit"));
    cli_text(s, "capture.skew_us.worst", worst, sizeof(worst));
    if (over > 0)
        printf(", exceeded by %.0f sets", over);
    printf("%s%s\n", *worst ? "; farthest off: " : "", worst);
}

/* The device of the live picture, and the steps that fall back to the CPU. */
static void print_device(const json_t *s)
{
    const json_t *steps = cli_member(s, "live.device.stages_on_cpu");
    char name[SST_GPU_NAME], reason[512];

    if (!json_is_object(cli_member(s, "live.device")))
        return;
    cli_text(s, "live.device.reason", reason, sizeof(reason));
    printf("  device     %s%s: %.0f pictures, %.0f on the CPU instead%s%s; %.0f failures\n",
           cli_text(s, "live.device.name", name, sizeof(name)),
           cli_number(s, "live.device.failing") > 0 ? " FAILS" : "", cli_number(s, "live.device.pictures"),
           cli_number(s, "live.device.on_cpu"), *reason ? ": " : "", reason, cli_number(s, "live.device.failures"));
    if (json_is_object(cli_member(s, "live.device.labels"))) {
        cli_text(s, "live.device.labels.reason", reason, sizeof(reason));
        printf("             labels%s: %.0f runs of the network, %.0f on the CPU instead%s%s; %.0f failures\n",
               cli_number(s, "live.device.labels.failing") > 0 ? " FAIL" : "", cli_number(s, "live.device.labels.runs"),
               cli_number(s, "live.device.labels.on_cpu"), *reason ? ": " : "", reason,
               cli_number(s, "live.device.labels.failures"));
    }
    for (size_t i = 0; i < json_array_size(steps); i++)
        printf("%s%s", i ? ", " : "             on the CPU: ", json_string_value(json_array_get(steps, i)));
    if (json_array_size(steps))
        printf("\n");
}

/* Connections between several hosts of one array. */
static void print_hosts(const json_t *s)
{
    const json_t *nodes = cli_member(s, "hosts.nodes");
    char role[TEXT], name[TEXT], reason[TEXT];

    cli_text(s, "hosts.role", role, sizeof(role));
    if (!strcmp(role, "node")) {
        const bool connected = cli_number(s, "hosts.head.connected") > 0;

        cli_text(s, "hosts.head.reason", reason, sizeof(reason));
        printf("  head       %s %s%s%s; of %.0f frames %.0f dropped, %.0f while it was away\n",
               cli_text(s, "hosts.head.address", name, sizeof(name)), connected ? "connected" : "NOT CONNECTED",
               connected || !*reason ? "" : ": ", connected ? "" : reason, cli_number(s, "hosts.frames.captured"),
               cli_number(s, "hosts.frames.dropped"), cli_number(s, "hosts.frames.away"));
        cli_text(s, "hosts.datagrams.reason", reason, sizeof(reason));
        if (connected && !(cli_number(s, "hosts.datagrams.used") > 0))
            printf("             pictures go over TLS%s%s\n", *reason ? ": " : "", reason);
    }
    for (size_t i = 0; i < json_array_size(nodes); i++) {
        const json_t *node = json_array_get(nodes, i);
        const bool connected = cli_number(node, "connected") > 0;

        cli_text(node, "reason", reason, sizeof(reason));
        printf("  node       %s %s%s%s", cli_text(node, "name", name, sizeof(name)),
               connected ? "connected" : "NOT CONNECTED", connected || !*reason ? "" : ": ", connected ? "" : reason);
        if (connected)
            printf(", %.0f cameras, clock %+.1f ms, %.0f slips put right", cli_number(node, "cameras"),
                   cli_number(node, "clock_ms"), cli_number(node, "slips"));
        printf("\n");
    }
}

static void print_live(const json_t *s)
{
    const double focus = cli_number(s, "live.focus_px"), latency_ms = cli_number(s, "live.latency_ms.p50");
    char reason[TEXT], demand[TEXT];

    if (!(cli_number(s, "live.enabled") > 0)) {
        printf("  live       off\n");
        return;
    }
    if (!(cli_number(s, "live.ready") > 0)) {
        cli_text(s, "live.reason", reason, sizeof(reason));
        printf("  live       not ready%s%s; %.0f sets seen\n", *reason ? ": " : " yet", reason,
               cli_number(s, "live.sets"));
        return;
    }
    cli_text(s, "live.demand", demand, sizeof(demand));
    printf("  live       %.1f sets/s", cli_number(s, "live.rate_hz"));
    if (!strcmp(demand, "none"))
        printf(", as there are no viewers; one view is watched for changes");
    else if (!strcmp(demand, "events"))
        printf(", for events; there are no viewers");
    if (!isnan(latency_ms))
        printf(", latency p50 %.0f ms, p99 %.0f ms", latency_ms, cli_number(s, "live.latency_ms.p99"));
    printf("; %.3g %% of the scene changed", cli_number(s, "live.changed_percent"));
    if (cli_number(s, "live.settling") > 0)
        printf("; settling");
    if (!isnan(focus))
        printf("; focus %.4g px", focus);
    printf("\n");
}

/* Faults of the pictures; --json has the whole sentences. */
static void print_noticed(const json_t *s)
{
    const json_t *list = cli_member(s, "noticed");

    for (size_t i = 0; i < json_array_size(list); i++) {
        char text[2 * TEXT];

        cli_text(json_array_get(list, i), "text", text, sizeof(text));
        printf("  noticed    %.*s%s\n", NOTICED_MAX, text, strlen(text) > NOTICED_MAX ? " ..." : "");
    }
}

static void print_storage(const json_t *s)
{
    const double quota = cli_number(s, "storage.quota_bytes"), recordings = cli_number(s, "storage.recordings");
    char state[TEXT], reason[TEXT], dir[TEXT], oldest[TEXT], used[CLI_SHORT], of[CLI_SHORT], left[CLI_SHORT];

    cli_text(s, "storage.state", state, sizeof(state));
    if (!*state)
        return;
    cli_text(s, "storage.reason", reason, sizeof(reason));
    cli_text(s, "storage.oldest", oldest, sizeof(oldest));
    printf("  storage    %s: %s used%s%s, %s free in %s", state,
           cli_bytes_text(used, cli_number(s, "storage.used_bytes")), quota > 0 ? " of " : "",
           quota > 0 ? cli_bytes_text(of, quota) : "", cli_bytes_text(left, cli_number(s, "storage.free_bytes")),
           cli_text(s, "storage.dir", dir, sizeof(dir)));
    if (recordings > 0)
        printf("; %.0f recording%s", recordings, recordings > 1 ? "s" : "");
    printf("%s%s%s%s\n", recordings > 0 && *oldest ? " since " : "", recordings > 0 ? oldest : "", *reason ? "; " : "",
           reason);
}

static void print_recording(const json_t *s)
{
    const json_t *r = cli_member(s, "storage.recording");
    char mode[TEXT], name[TEXT], why[TEXT], since[TEXT];

    if (!r)
        return;
    cli_text(r, "mode", mode, sizeof(mode));
    if (!(cli_number(r, "active") > 0)) {
        printf("  recording  no (mode %s)\n", mode);
        return;
    }
    cli_text(r, "why", why, sizeof(why));
    printf("  recording  %s%s%s%s: %.0f sets since %s", cli_text(r, "name", name, sizeof(name)), *why ? " (" : "", why,
           *why ? ")" : "", cli_number(r, "sets"), cli_text(r, "since", since, sizeof(since)));
    if (cli_number(r, "dropped") > 0)
        printf("; %.0f sets LOST since the service started: the disk was too slow or full", cli_number(r, "dropped"));
    printf("\n");
}

static void print_process(const json_t *s)
{
    char memory[CLI_SHORT], until[TEXT];

    cli_text(s, "certificate.until", until, sizeof(until));
    if (*until)
        printf("  TLS        certificate until %.10s, %.0f days\n", until, cli_number(s, "certificate.days"));
    printf("  clients    %.0f on HTTP, %.0f moving pictures, %.0f on RTSP; %.0f requests",
           cli_number(s, "clients.http"), cli_number(s, "clients.streams"), cli_number(s, "clients.rtsp"),
           cli_number(s, "clients.requests"));
    if (cli_number(s, "clients.refused") > 0)
        printf(", %.0f refused", cli_number(s, "clients.refused"));
    printf("\n  process    %s of memory, %.0f %% of a processor\n",
           cli_bytes_text(memory, cli_number(s, "process.rss_bytes")), cli_number(s, "process.cpu_percent"));
}

static void print_status(const json_t *status, const json_t *cameras)
{
    print_head(status);
    print_capture(status);
    print_missing(cameras);
    print_frames(status);
    print_skew(status);
    print_hosts(status);
    print_live(status);
    print_noticed(status);
    print_device(status);
    print_storage(status);
    print_recording(status);
    print_process(status);
}

/* --- command -------------------------------------------------------------------------------------------------------
 */

/* @param failed  out, the service reports a failure */
static int show(const struct sst_client_service *where, bool json, bool clear, bool *failed)
{
    json_t *status = NULL, *cameras = NULL;
    struct sst_client *client;
    char state[TEXT];
    int err = sst_client_open(&client, where);

    if (err)
        return err;
    err = sst_client_json(client, "/api/v1/status", NULL, &status);
    if (!err && !json)
        err = sst_client_json(client, "/api/v1/cameras", NULL, &cameras);
    sst_client_close(client);
    if (!err) {
        *failed = !strcmp(cli_text(status, "state", state, sizeof(state)), "failed");
        if (clear)
            printf("\033[H\033[2J");
        if (json) {
            (void)json_dumpf(status, stdout, JSON_REAL_PRECISION(9) | JSON_COMPACT);
            printf("\n");
        } else {
            print_status(status, cameras);
        }
    }
    json_decref(cameras);
    json_decref(status);
    if (fflush(stdout) && !err) {
        sst_log_error("the status cannot be printed: %s", strerror(errno));
        err = -EPIPE;
    }
    return err;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_client_service where = { 0 };
    bool json = false, watch = false, failed = false;
    const struct cli_option options[] = {
        { "watch", 'w', CLI_FLAG, &watch, NULL, "again each second, also while the service is away" },
        { "json", 0, CLI_FLAG, &json, NULL, "the service's answer (docs/integrate/api.md), a line each time" },
        CLI_SERVICE_OPTIONS(where),
    };
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    int err;

    if (r != CLI_GO_ON)
        return r;
    for (;;) {
        err = show(&where, json, watch && !json && isatty(STDOUT_FILENO), &failed);
        if (!watch || (err && err != -ENOPKG && err != -ETIMEDOUT && err != -ENODATA))
            break;
        sleep(1);
    }
    return !err && failed ? CLI_INPUT : cli_exit_code(err);
}

const struct cli_command cli_status = {
    .name = "status",
    .usage = "[--watch] [--json]",
    .summary = "how the service is: cameras, live picture, storage, recording",
    .detail = "Exit code 0: the service answers; 3: it answers that it failed, and why; 5: none runs.",
    .example = "sst status --watch\n  sst status --json | jq .capture.skew_us",
    .run = run,
};
