/* sst record: recordings of the service: start, stop, list, download, deletion. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "base/edit_distance.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "cli/cli_internal.h"

struct args {
    struct sst_client *client;
    double duration_s, ago_s; /* ago_s: negative, not given */
    int64_t ago_ns;           /* the moment of ago_s, by the service's clock */
    const char *name;         /* of the recording, snapshot or export; NULL: not given */
    const char *time, *recording, *output, *camera;
    bool json;
};

/* POST, and print the answer or the name in it. @param request  taken over @param name  out, or NULL */
static int post(const struct args *a, const char *path, json_t *request, char *name, size_t size)
{
    json_t *answer;
    char text[200];
    int err = request ? sst_client_json(a->client, path, request, &answer) : -ENOMEM;

    json_decref(request);
    if (err)
        return err;
    cli_text(answer, "name", text, sizeof(text));
    if (name)
        snprintf(name, size, "%s", text);
    if (a->json)
        return cli_print_json(answer) ? -ENOMEM : 0;
    if (*text)
        printf("%s\n", text);
    json_decref(answer);
    return 0;
}

static int start(const struct args *a)
{
    json_t *seconds = a->duration_s > 0 ? json_real(a->duration_s) : NULL;

    return post(a, "/api/v1/record", json_pack("{s:s, s:o*}", "action", "start", "seconds", seconds), NULL, 0);
}

static int stop(const struct args *a)
{
    return post(a, "/api/v1/record", json_pack("{s:s}", "action", "stop"), NULL, 0);
}

/* @param kind  of moments; NULL: recordings */
static void print_stored(const json_t *list, const char *kind)
{
    const json_t *one;
    size_t i;

    json_array_foreach(list, i, one)
    {
        const bool active = cli_number(one, "active") > 0;
        char name[100], from[40], to[40], why[200], size[CLI_SHORT];

        cli_text(one, "to", to, sizeof(to));
        cli_text(one, "why", why, sizeof(why));
        printf("%-32s %-24s %-24s %9.0f %9s  %s\n", cli_text(one, "name", name, sizeof(name)),
               cli_text(one, kind ? "time" : "from", from, sizeof(from)),
               kind     ? ""
               : active ? "now"
                        : to,
               kind ? 1 : cli_number(one, "sets"), cli_bytes_text(size, cli_number(one, "bytes")),
               !kind    ? why
               : active ? "being made"
                        : kind);
    }
}

static int list(const struct args *a)
{
    json_t *answer;
    int err = sst_client_json(a->client, "/api/v1/recordings", NULL, &answer);

    if (err)
        return err;
    if (a->json)
        return cli_print_json(answer) ? -ENOMEM : 0;
    if (json_array_size(cli_member(answer, "recordings")) + json_array_size(cli_member(answer, "snapshots")) +
        json_array_size(cli_member(answer, "exports")))
        printf("%-32s %-24s %-24s %9s %9s  %s\n", "NAME", "FROM", "TO", "SETS", "SIZE", "WHY");
    else
        printf("nothing is stored yet\n");
    print_stored(cli_member(answer, "recordings"), NULL);
    print_stored(cli_member(answer, "snapshots"), "snapshot");
    print_stored(cli_member(answer, "exports"), "export");
    json_decref(answer);
    return 0;
}

static int delete_one(const struct args *a)
{
    return post(a, "/api/v1/delete", json_pack("{s:s}", "name", a->name), NULL, 0);
}

/* FILE.tar is all of it, FILE.jpg the picture of a snapshot, else the video. */
static int download(const struct args *a)
{
    const bool tar = sst_text_ends(a->output, ".tar"), picture = sst_text_ends(a->output, ".jpg");
    char path[300];

    snprintf(path, sizeof(path), "/api/v1/download/%s%s%s%s", a->name, a->camera ? "." : "", a->camera ? a->camera : "",
             tar       ? ".tar"
             : picture ? ".jpg"
                       : ".mkv");
    return sst_client_save(a->client, path,
                           tar       ? "application/x-tar"
                           : picture ? "image/jpeg"
                                     : "video/x-matroska",
                           a->output);
}

/* The clock of the service counts: it may be on another machine. */
static int find_moment(struct args *a)
{
    json_t *status;
    char text[64];
    int err;

    if (a->ago_s < 0)
        return 0;
    err = sst_client_json(a->client, "/api/v1/status", NULL, &status);
    if (err)
        return err;
    if (!sst_clock_read(cli_text(status, "time", text, sizeof(text)), &a->ago_ns)) {
        sst_log_error("the service does not say its time: use --time instead of --ago");
        err = -EPROTO;
    }
    a->ago_ns -= (int64_t)(a->ago_s * 1e9);
    json_decref(status);
    return err;
}

static json_t *export_request(const struct args *a)
{
    char text[SST_CLOCK_TEXT];

    if (a->ago_s >= 0)
        sst_clock_text(text, a->ago_ns);
    return json_pack("{s:s, s:s*}", "time", a->ago_s >= 0 ? text : a->time, "recording", a->recording);
}

static int export_moment(const struct args *a)
{
    char name[200], path[300];
    int err = post(a, "/api/v1/export", export_request(a), name, sizeof(name));

    if (err || !a->output)
        return err;
    if (!*name || strpbrk(name, "/?#% ")) {
        sst_log_error("the service made a light field, but returned no name");
        return -EPROTO;
    }
    snprintf(path, sizeof(path), "/api/v1/download/%s.tar", name);
    return sst_client_save(a->client, path, "application/x-tar", a->output);
}

/* --- video for others --- */

static json_t *video_request(const struct args *a)
{
    char from[SST_CLOCK_TEXT], to[SST_CLOCK_TEXT];
    int64_t at_ns = a->ago_ns;

    if (a->name)
        return json_pack("{s:[s]}", "visits", a->name);
    if (a->time && !sst_clock_read(a->time, &at_ns)) {
        sst_log_error("--time %.40s is not a time; write 2026-11-21T18:05:00Z", a->time);
        return NULL;
    }
    sst_clock_text(from, at_ns);
    sst_clock_text(to, at_ns + (int64_t)(a->duration_s * 1e9));
    return json_pack("{s:s, s:s, s:s*}", "from", from, "to", to, "recording", a->recording);
}

/* Wait until it is made. @return 0, or why it is not; logged */
static int wait_for_video(const struct args *a, const char *name)
{
    for (;;) {
        const json_t *one;
        json_t *answer;
        char state[16] = "", other[100], why[300] = "";
        size_t i;
        int err = sst_client_json(a->client, "/api/v1/videos", NULL, &answer);

        if (err)
            return err;
        json_array_foreach(cli_member(answer, "videos"), i, one)
        {
            if (strcmp(cli_text(one, "name", other, sizeof(other)), name) != 0)
                continue;
            cli_text(one, "state", state, sizeof(state));
            cli_text(one, "error", why, sizeof(why));
            cli_progress((void *)"video", cli_number(one, "progress"));
        }
        json_decref(answer);
        if (strcmp(state, "waiting") != 0 && strcmp(state, "running") != 0) {
            cli_progress_end();
            if (!strcmp(state, "done"))
                return 0;
            sst_log_error("the video was not made: %s", *why ? why : "it was cancelled");
            return -ENODATA;
        }
        sst_clock_sleep_until(sst_clock_now_ns() + 300000000);
    }
}

/* FILE.mp4 and beside it FILE.json, the manifest; or FILE.zip. */
static int video(const struct args *a)
{
    const bool zip = sst_text_ends(a->output, ".zip");
    json_t *request = video_request(a), *answer;
    char name[100], path[200], manifest[SST_PATH_MAX];
    int err = request ? sst_client_json(a->client, "/api/v1/videos", request, &answer) : -EINVAL;

    json_decref(request);
    if (err)
        return err;
    cli_text(answer, "name", name, sizeof(name));
    json_decref(answer);
    err = wait_for_video(a, name);
    snprintf(path, sizeof(path), "/api/v1/download/%s%s", name, zip ? ".zip" : ".mp4");
    err = err ? err : sst_client_save(a->client, path, zip ? "application/zip" : "video/mp4", a->output);
    if (!err && !zip) {
        snprintf(path, sizeof(path), "/api/v1/download/%s.json", name);
        snprintf(manifest, sizeof(manifest), "%.*s.json", (int)strlen(a->output) - 4, a->output);
        err = sst_client_save(a->client, path, "application/json", manifest);
    }
    if (!err)
        printf("%s\n", name);
    return err;
}

static int save_key(const struct args *a)
{
    return sst_client_save(a->client, "/api/v1/signing-key.pem", "application/x-pem-file", a->output);
}

static const struct {
    const char *name;
    int (*run)(const struct args *a);
    bool named; /* of something that is kept */
} actions[] = { { "start", start, false },          { "stop", stop, false },        { "list", list, false },
                { "export", export_moment, false }, { "download", download, true }, { "delete", delete_one, true },
                { "video", video, false },          { "key", save_key, false } };

/* Can it stand in an address? */
static bool is_name(const char *text)
{
    return *text && strlen(text) < 64 &&
           strspn(text, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_") == strlen(text);
}

/* Options of a video, or of the key of its manifest. */
static int check_video(const struct cli_command *cmd, const struct args *a, bool key)
{
    const bool span = (a->time || a->ago_s >= 0) && a->duration_s > 0;

    if (a->camera || a->json || (key && (a->time || a->ago_s >= 0 || a->recording || a->duration_s > 0)))
        return cli_usage_error(cmd, key ? "key takes -o FILE.pem alone" : "--camera and --json do not belong to video");
    if (key)
        return a->output ? CLI_GO_ON : cli_usage_error(cmd, "missing -o FILE.pem");
    if (!a->output || (!sst_text_ends(a->output, ".mp4") && !sst_text_ends(a->output, ".zip")))
        return cli_usage_error(cmd, "missing -o FILE.mp4, or FILE.zip with a page and the manifest");
    if (!a->name == !span || (a->time && a->ago_s >= 0))
        return cli_usage_error(cmd, "missing what to show: a visit's name, or --time T (or --ago S) and --duration S");
    if (a->name && !is_name(a->name))
        return cli_usage_error(cmd, "%.64s is not the name of a visit", a->name);
    return CLI_GO_ON;
}

/* Options that do not go with the action. */
static int check(const struct cli_command *cmd, const struct args *a, const char *action)
{
    const bool exports = !strcmp(action, "export"), downloads = !strcmp(action, "download");
    const bool videos = !strcmp(action, "video"), key = !strcmp(action, "key");

    if (videos || key)
        return check_video(cmd, a, key);
    if (a->duration_s > 0 && strcmp(action, "start") != 0)
        return cli_usage_error(cmd, "--duration belongs to start and video, not to %s", action);
    if (!exports && (a->time || a->ago_s >= 0 || a->recording))
        return cli_usage_error(cmd, "--time, --ago and --recording belong to export and video, not to %s", action);
    if (!exports && !downloads && a->output)
        return cli_usage_error(cmd, "-o belongs to export, download, video and key, not to %s", action);
    if (!downloads && a->camera)
        return cli_usage_error(cmd, "--camera belongs to download, not to %s", action);
    if (downloads && !a->output)
        return cli_usage_error(cmd, "missing -o FILE.mkv (video), FILE.tar (all of it) or FILE.jpg (picture)");
    if (downloads && !sst_text_ends(a->output, ".mkv") && !sst_text_ends(a->output, ".tar") &&
        !sst_text_ends(a->output, ".jpg"))
        return cli_usage_error(cmd, "-o %s ends neither in .mkv (video) nor in .tar (all of it) nor in .jpg (picture)",
                               a->output);
    if (downloads && a->camera &&
        (!is_name(a->camera) || sst_text_ends(a->output, ".tar") || sst_text_ends(a->output, ".jpg")))
        return cli_usage_error(cmd, "--camera r0c5 needs -o FILE.mkv, the video of that camera");
    if (exports && a->time && a->ago_s >= 0)
        return cli_usage_error(cmd, "--time and --ago both name a moment; use one of them");
    if (exports && !a->time && a->ago_s < 0)
        return cli_usage_error(cmd, "missing the moment: --time 2026-11-21T18:05:00Z, or --ago 30 (seconds)");
    if (a->time && strlen(a->time) > 35)
        return cli_usage_error(cmd, "--time %.40s... is not a time; write 2026-11-21T18:05:00Z", a->time);
    return CLI_GO_ON;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_client_service where = { 0 };
    struct args a = { .ago_s = -1 };
    const char *words[2], *names[ARRAY_LEN(actions) + 1] = { NULL }, *action;
    const struct cli_option options[] = {
        { "duration", 0, CLI_DOUBLE, &a.duration_s, "S", "start: stop after this many seconds; video: its length", 0.1, 1e7 },
        { "time", 0, CLI_STRING, &a.time, "T", "export: the moment, UTC: 2026-11-21T18:05:00Z; video: its beginning" },
        { "ago", 0, CLI_DOUBLE, &a.ago_s, "S", "export, video: the same, this many seconds ago", 0, 1e9 },
        { "recording", 0, CLI_STRING, &a.recording, "NAME",
          "export, video: of this recording; default: the one that has the moment" },
        { "output", 'o', CLI_FILE, &a.output, "FILE",
          "export: also fetch the light field; download, video, key: the file to write" },
        { "camera", 0, CLI_STRING, &a.camera, "rRcC", "download: this camera's video; default: the see-through view" },
        { "json", 0, CLI_FLAG, &a.json, NULL, "the service's answer (docs/integrate/api.md)" },
        CLI_SERVICE_OPTIONS(where),
    };
    int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, words, 1, 2), err;

    if (r != CLI_GO_ON)
        return r;
    action = words[0];
    a.name = words[1];
    for (size_t i = 0; i < ARRAY_LEN(actions); i++) {
        if (strcmp(action, actions[i].name) != 0)
            continue;
        if (actions[i].named ? !a.name || !is_name(a.name) : a.name && strcmp(action, "video") != 0)
            return actions[i].named
                       ? cli_usage_error(cmd, "%s needs a NAME; `sst record list` prints the names", action)
                       : cli_usage_error(cmd, "%s takes no name: %s", action, a.name);
        r = check(cmd, &a, action);
        if (r != CLI_GO_ON)
            return r;
        err = sst_client_open(&a.client, &where);
        if (!err) {
            err = find_moment(&a);
            err = err ? err : actions[i].run(&a);
            sst_client_close(a.client);
        }
        return cli_exit_code(err);
    }
    for (size_t i = 0; i < ARRAY_LEN(actions); i++)
        names[i] = actions[i].name;
    return cli_usage_error(cmd, "unknown action %s;%s use start, stop, list, export, download, delete, video or key", action,
                           sst_edit_hint(action, names));
}

const struct cli_command cli_record = { "record", run };
