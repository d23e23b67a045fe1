/* WebSocket frames (RFC 6455): parser of a client's frames, of which each is small, and heads of ours. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include <jansson.h>

#include "daemon/publish/publish_internal.h"

#define OPCODE   0x0f
#define RESERVED 0x70
#define FINAL    0x80
#define MASKED   0x80
#define CONTROL  0x08

static bool is_utf8(const uint8_t *text, size_t bytes)
{
    json_t *parsed = json_stringn((const char *)text, bytes); /* NULL: it is not */
    const bool valid = parsed != NULL;

    json_decref(parsed);
    return valid;
}

/* Codes that a peer may send (7.4). */
static bool is_code(int code)
{
    return (code >= 1000 && code <= 1003) || (code >= 1007 && code <= 1014) || (code >= 3000 && code <= 4999);
}

/* The first two bytes of a frame. @return 0, or the code to close with */
static int check_head(const struct http_ws_reader *r)
{
    const int op = r->frame[0] & OPCODE, length = r->frame[1] & ~MASKED;
    const bool final = r->frame[0] & FINAL;

    if ((r->frame[0] & RESERVED) || !(r->frame[1] & MASKED))
        return HTTP_WS_PROTOCOL;
    if (op > HTTP_WS_PONG || (op > HTTP_WS_BINARY && op < HTTP_WS_CLOSE))
        return HTTP_WS_PROTOCOL;
    if (op & CONTROL)
        return !final || length > HTTP_WS_MAX ? HTTP_WS_PROTOCOL : 0;
    if ((op == HTTP_WS_CONTINUATION) != r->begun)
        return HTTP_WS_PROTOCOL;
    if (op == HTTP_WS_BINARY)
        return HTTP_WS_UNSUPPORTED;
    return length > HTTP_WS_MAX || r->text_bytes + (size_t)length > HTTP_WS_MAX ? HTTP_WS_TOO_BIG : 0;
}

/* @return 1: a message, or minus the code to close with */
static int take_control(int op, const uint8_t *data, size_t bytes)
{
    if (op != HTTP_WS_CLOSE || !bytes)
        return 1;
    if (bytes == 1 || !is_code(data[0] << 8 | data[1]))
        return -HTTP_WS_PROTOCOL;
    return is_utf8(data + 2, bytes - 2) ? 1 : -HTTP_WS_INVALID;
}

/* A whole frame. @return 1: a message; 0: the message goes on; or minus the code to close with */
static int take_frame(struct http_ws_reader *r, struct http_ws_message *out)
{
    const int op = r->frame[0] & OPCODE;
    const size_t bytes = r->frame[1] & ~MASKED;
    uint8_t *data = r->frame + 6;

    for (size_t i = 0; i < bytes; i++)
        data[i] ^= r->frame[2 + i % 4];
    *out = (struct http_ws_message){ .op = op, .data = data, .bytes = bytes };
    if (op & CONTROL)
        return take_control(op, data, bytes);
    memcpy(r->text + r->text_bytes, data, bytes);
    r->text_bytes += bytes;
    r->begun = !(r->frame[0] & FINAL);
    if (r->begun)
        return 0;
    *out = (struct http_ws_message){ .op = HTTP_WS_TEXT, .data = r->text, .bytes = r->text_bytes };
    r->text_bytes = 0;
    return is_utf8(out->data, out->bytes) ? 1 : -HTTP_WS_INVALID;
}

int http_ws_read(struct http_ws_reader *r, const uint8_t *data, size_t bytes, size_t *used, struct http_ws_message *out)
{
    int done = 0;

    for (*used = 0; *used < bytes && !done;) {
        r->frame[r->have++] = data[(*used)++];
        if (r->have == 2)
            done = -check_head(r);
        if (done || r->have < 2 || r->have < 6 + (size_t)(r->frame[1] & ~MASKED))
            continue;
        r->have = 0;
        done = take_frame(r, out);
    }
    return done;
}

size_t http_ws_head(uint8_t out[HTTP_WS_HEAD], enum http_ws_op op, size_t bytes)
{
    const size_t more = bytes < 126 ? 0 : bytes < 65536 ? 2 : 8;

    out[0] = (uint8_t)(FINAL | op);
    out[1] = (uint8_t)(more == 0 ? bytes : more == 2 ? 126 : 127);
    for (size_t i = 0; i < more; i++)
        out[2 + i] = (uint8_t)((uint64_t)bytes >> 8 * (more - 1 - i));
    return 2 + more;
}
