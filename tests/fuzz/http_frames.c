/* Fuzz target: WebSocket frames of a client, in pieces of any size. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "daemon/publish/publish_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const struct {
        const char *data;
        size_t bytes;
    } seeds[] = {
        { "\x81\x83\1\2\3\4jgz", 9 },                                 /* "key" */
        { "\x8a\x84\0\0\0\0\0\0\0\1\x89\x80\0\0\0\0", 16 },           /* a pong, a ping */
        { "\x01\x81\0\0\0\0k\x00\x81\0\0\0\0e\x80\x81\0\0\0\0y", 21 }, /* in pieces */
        { "\x88\x82\0\0\0\0\x03\xe8", 8 },                             /* a close */
    };

    for (int i = 0; i < (int)ARRAY_LEN(seeds); i++)
        seed_write("http_frames", i, seeds[i].data, seeds[i].bytes);
    return 0;
}

/* @return the first code, or how many messages came */
static int parse(const uint8_t *data, size_t size, size_t piece)
{
    struct http_ws_reader r = { 0 };
    struct http_ws_message m;
    int messages = 0;

    for (size_t at = 0, used; at < size; at += used) {
        const size_t left = size - at;
        const int done = http_ws_read(&r, data + at, left < piece ? left : piece, &used, &m);

        if (!used || r.have >= sizeof(r.frame) || r.text_bytes > HTTP_WS_MAX)
            abort();
        if (done < 0)
            return done;
        if (done && (m.bytes > HTTP_WS_MAX || (m.op != HTTP_WS_TEXT && m.op < HTTP_WS_CLOSE)))
            abort();
        messages += done;
    }
    return messages;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const int whole = parse(data, size, size);

    if (parse(data, size, 1) != whole || parse(data, size, 7) != whole)
        abort();
    return 0;
}
