/* sst verify: videos for others compared with their signed manifests. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>

#include "capture/evidence/evidence.h"
#include "cli/cli_internal.h"

static int print(const char *path, const struct sst_verdict *v, bool trusted, bool json)
{
    if (json)
        return cli_print_json(json_pack("{s:s, s:b, s:s, s:i, s:s, s:O*}", "file", path, "unchanged", v->good, "text",
                                        v->text, "files", v->files, "key", v->print, "manifest", v->manifest));
    printf("%s: %s%s\n", path, v->good ? "unchanged: " : "NOT AS SIGNED: ", v->text);
    if (v->good && !trusted)
        printf("signed by the key %s; --key compares it with the service's\n", v->print);
    return 0;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    const char *words[1], *key = NULL;
    bool json = false;
    const struct cli_option options[] = {
        { "key", 0, CLI_STRING, &key, "PEM", "public key that must have signed it, of `sst record key` from the service" },
        { "json", 0, CLI_FLAG, &json, NULL, "print JSON, with the manifest" },
    };
    struct sst_verdict v;
    int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, words, 1, 1), err;

    if (r != CLI_GO_ON)
        return r;
    err = sst_evidence_verify(words[0], key, &v);
    if (!err)
        r = print(words[0], &v, key != NULL, json);
    json_decref(v.manifest);
    return err ? cli_exit_code(err) : r > 0 ? r : v.good ? CLI_OK : CLI_INPUT;
}

const struct cli_command cli_verify = { "verify", run };
