/* Fuzz target: the file of browsers' sessions. What is read from it is listed, and written again. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "base/file.h"
#include "daemon/publish/publish_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char seed[] =
        "[{\"secret\": \"0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef\", \"control\": true, "
        "\"tag\": "
        "-5808590958014384161, \"since_ns\": 1790000000000000000, \"seen_ns\": 1790000000000000000, \"address\": "
        "\"127.0.0.1\", \"agent\": \"x\"},\n {\"secret\": \"0123456789abcdef0123456789abcdef\", \"control\": false, "
        "\"tag\": 1, \"since_ns\": 0, \"seen_ns\": 9223372036854775807, \"address\": \"::1\", \"agent\": "
        "\"\\u00e4\"}]\n";

    seed_write("sessions", 0, seed, strlen(seed));
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct http_sessions s;
    char *folder = mkdtemp(input_template()), token[64], path[80];
    struct http_grant grant;
    FILE *f;

    if (!folder)
        abort();
    snprintf(token, sizeof(token), "%s/token", folder);
    snprintf(path, sizeof(path), "%s.sessions", token);
    f = fopen(path, "wb");
    if (!f || (size && fwrite(data, 1, size, f) != size) || fclose(f))
        abort();
    http_sessions_init(&s, token, "control", "view");
    for (int i = 0; i < HTTP_SESSIONS_MAX; i++)
        if (s.session[i].secret[0] && http_session_check(&s, s.session[i].secret, &grant) &&
            !http_session_lasts(&s, grant.session))
            abort();
    json_decref(http_sessions_json(&s, "", true));
    http_sessions_fini(&s);
    (void)unlink(path);
    (void)rmdir(folder);
    return 0;
}
