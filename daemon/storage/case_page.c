/* Page of a case: its videos, to be opened from an unpacked archive without a network. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/storage/case_internal.h"

#define HEAD                                                                                                           \
    "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\">"                                                      \
    "<meta name=\"viewport\" content=\"width=device-width\">\n<style>body{font:16px/1.5 system-ui,sans-serif;"         \
    "max-width:70rem;margin:2rem auto;padding:0 1rem}video{width:100%;background:#000}"                                \
    "code{overflow-wrap:anywhere;font-size:.85em}</style>\n"

/* Text of HTML. */
static void put(FILE *f, const char *text)
{
    static const char special[] = "&<>\"";
    static const char *const words[] = { "&amp;", "&lt;", "&gt;", "&quot;" };

    for (const char *c; *text; text++) {
        c = strchr(special, *text);
        if (c)
            fputs(words[c - special], f);
        else
            putc(*text, f);
    }
}

static void put_member(FILE *f, const json_t *file, const char *key)
{
    const char *text = json_string_value(json_object_get(file, key));

    put(f, text ? text : "");
}

char *case_page(const char *title, const char *site, const json_t *files)
{
    const json_t *file;
    char *text = NULL;
    size_t size, i;
    FILE *f = open_memstream(&text, &size);

    if (!f)
        return NULL;
    fputs(HEAD "<title>", f);
    put(f, title);
    fputs("</title>\n<h1>", f);
    put(f, title);
    fputs("</h1>\n<p>", f);
    put(f, site);
    fputs(". Left: what stood in front is removed; right: one camera, as it was recorded. Whether files were changed, "
          "<code>sst verify</code> tells from <code>" SST_EVIDENCE_MANIFEST "</code>, which is signed.</p>\n",
          f);
    json_array_foreach(files, i, file)
    {
        fputs("<h2>", f);
        put_member(f, file, "title");
        fputs("</h2>\n<video controls preload=\"metadata\" src=\"", f);
        put_member(f, file, "name");
        fputs("\"></video>\n<p>", f);
        put_member(f, file, "from");
        fputs(" to ", f);
        put_member(f, file, "to");
        fputs(", camera ", f);
        put_member(f, file, "camera");
        fputs("<br><code>SHA-256 ", f);
        put_member(f, file, "sha256");
        fputs("</code></p>\n", f);
    }
    return fclose(f) ? NULL : text;
}
