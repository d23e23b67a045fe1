/* Fuzz target: what the HTTP server takes apart itself: paths, hosts, origins, passwords, forms, tags, numbers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "daemon/publish/publish_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char *const seeds[] = {
        "/api/v1/views/v1/pick",  "cam.example:8090",     "[::1]:80",         "http://localhost:8090",
        "Basic dXNlcjp0b2tlbg==", "x=1&token=+abcdef+&y", "W/\"ab\", \"cd\"", "application/json; charset=utf-8",
        "/web/%2e%2e%00/token",   "18446744073709551615", "bytes=0-499",      "bytes=-18446744073709551616",
        "http://localhost/api/v1/status",
    };

    for (int i = 0; i < (int)ARRAY_LEN(seeds); i++)
        seed_write("http_parse", i, seeds[i], strlen(seeds[i]));
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const patterns[] = { "/", "/web/{file}", "/api/v1/views/{id}/pick" };
    char *text = malloc(size + 1), out[256], authority[HTTP_AUTHORITY];
    uint64_t number, first, bytes;
    int port;

    memcpy(text, data, size);
    text[size] = 0;
    for (size_t i = 0; i < ARRAY_LEN(patterns); i++) {
        if (http_path_matches(patterns[i], text, out) && (strchr(out, '/') || out[0] == '.'))
            abort();
    }
    if (*http_target_path(text, authority) != '/' && authority[0])
        abort();
    if (http_host_split(text, out, &port) && (!out[0] || strpbrk(out, "/@ ") || port == 0 || port > 65535))
        abort();
    if (http_same_origin(text, "localhost:8090") && !strstr(text, "8090"))
        abort();
    if (http_form_token(text, size, out) && strlen(out) > HTTP_TOKEN_MAX)
        abort();
    if (http_number(text, 65535, &number) && number > 65535)
        abort();
    if (http_range_parse(text, 1000, &first, &bytes) == HTTP_RANGE_PART &&
        (!bytes || first >= 1000 || bytes > 1000 - first))
        abort();
    (void)http_if_range(text, "\"ab\"");
    (void)http_etag_matches(text, "\"ab\"");
    (void)http_is_type(text, "application/json");
    free(text);
    return 0;
}
