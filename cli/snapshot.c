/* sst snapshot: the picture of now, to a file or kept with its light field. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"
#include "cli/cli_internal.h"

#define JPEG "image/jpeg"
#define TAR  "application/x-tar"

/* Names of views and cameras, so that they can stand in an address. */
static bool is_name(const char *text)
{
    return *text && strlen(text) <= 64 &&
           strspn(text, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.") == strlen(text);
}

static bool is_camera(const char *text)
{
    int row, col, end = 0;

    return sscanf(text, "r%3dc%3d%n", &row, &col, &end) == 2 && !text[end];
}

/* Keep it in the service, and have a file of it if one is wanted. */
static int keep(struct sst_client *client, const char *file)
{
    json_t *nothing = json_object(), *answer = NULL;
    char name[100], path[200];
    bool tar;
    int err = nothing ? sst_client_json(client, "/api/v1/snapshot", nothing, &answer) : -ENOMEM;

    json_decref(nothing);
    if (err)
        return err;
    cli_text(answer, "name", name, sizeof(name));
    json_decref(answer);
    if (!is_name(name)) {
        sst_log_error("the service kept the moment, but its answer has no name");
        return -EPROTO;
    }
    printf("%s\n", name);
    if (!file)
        return 0;
    tar = sst_text_ends(file, ".tar");
    snprintf(path, sizeof(path), "/api/v1/download/%s%s", name, tar ? ".tar" : "");
    return sst_client_save(client, path, tar ? TAR : JPEG, file);
}

static int save(struct sst_client *client, const char *of, const char *file)
{
    char path[100];

    if (!of)
        snprintf(path, sizeof(path), "/snapshot");
    else
        snprintf(path, sizeof(path), "/snapshot/%s%s", is_camera(of) ? "camera/" : "", of);
    return sst_client_save(client, path, JPEG, file);
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_client_service where = { 0 };
    const char *file = NULL, *of = NULL;
    bool keep_it = false;
    const struct cli_option options[] = {
        { "output", 'o', CLI_FILE, &file, "FILE", "where the JPEG goes; with --keep FILE.tar: the light field" },
        { "of", 0, CLI_STRING, &of, "WHAT", "main (default) or another view, a camera (r0c5), labels, disparity" },
        { "keep", 0, CLI_FLAG, &keep_it, NULL, "the service keeps light field and picture; prints their name" },
        CLI_SERVICE_OPTIONS(where),
    };
    int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0), err;
    struct sst_client *client;

    if (r != CLI_GO_ON)
        return r;
    if (!file && !keep_it)
        return cli_usage_error(cmd, "an output is missing: -o FILE.jpg, or --keep");
    if (file && sst_text_ends(file, ".png"))
        return cli_usage_error(cmd, "pictures of the service are JPEG: -o FILE.jpg");
    if (of && keep_it)
        return cli_usage_error(cmd, "--keep keeps the whole light field and the main view: --of does not go with it");
    if (of && !is_name(of))
        return cli_usage_error(cmd, "--of %s is not a view, a camera, labels or disparity", of);
    err = sst_client_open(&client, &where);
    if (!err) {
        err = keep_it ? keep(client, file) : save(client, of, file);
        sst_client_close(client);
    }
    return cli_exit_code(err);
}

const struct cli_command cli_snapshot = { "snapshot", run };
