/* Text of cv::FileStorage as plain YAML. Its YAML begins with a non-standard directive and has tags; its XML
 * is rewritten element by element into flow mappings. Line numbers are preserved for error messages. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/camera/format_parts.h"

#define MAX_DEPTH 12

static int no_memory(const char *name)
{
    sst_log_error("%s: not enough memory to read it", name);
    return -ENOMEM;
}

/* --- YAML and JSON: the text itself with blanks over foreign parts ------------------------------------------------ */

static char *plain_yaml(const char *text, size_t size)
{
    static const char tag[] = "!!opencv-";
    char *out = malloc(size + 1);

    if (!out)
        return NULL;
    memcpy(out, text, size);
    out[size] = 0;
    for (size_t i = 0; size >= 5 && !memcmp(text, "%YAML", 5) && i < size && out[i] != '\n'; i++)
        out[i] = ' ';
    for (size_t i = 0; i + sizeof(tag) - 1 <= size; i++) {
        if (memcmp(out + i, tag, sizeof(tag) - 1) != 0)
            continue;
        for (; i < size && out[i] > ' '; i++)
            out[i] = ' ';
    }
    return out;
}

/* --- XML ---------------------------------------------------------------------------------------------------------- */

struct xml {
    const char *at, *end, *begin, *name; /* name: the file's */
    FILE *out;
    int err;
};

static void refuse(struct xml *x, const char *what)
{
    int line = 1;

    if (x->err)
        return;
    for (const char *p = x->begin; p < x->at; p++)
        line += *p == '\n';
    sst_log_error("%s:%d: %s; only XML as OpenCV writes it is supported; save it again as YAML", x->name, line, what);
    x->err = -EBADMSG;
}

static void emit(struct xml *x, const char *text, size_t n)
{
    (void)fwrite(text, 1, n, x->out);
}

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

/* Skip blanks; line breaks are copied so that line numbers agree. */
static void skip_blanks(struct xml *x)
{
    for (; x->at < x->end && is_blank(*x->at); x->at++) {
        if (*x->at == '\n')
            emit(x, "\n", 1);
    }
}

static bool starts(const struct xml *x, const char *text)
{
    return (size_t)(x->end - x->at) >= strlen(text) && !memcmp(x->at, text, strlen(text));
}

/* Skip blanks, comments and declarations. */
static void skip_rest(struct xml *x)
{
    for (skip_blanks(x); !x->err && (starts(x, "<!--") || starts(x, "<?")); skip_blanks(x)) {
        const char *close = x->at[1] == '?' ? "?>" : "-->";

        while (x->at < x->end && !starts(x, close))
            x->at++;
        if (x->at == x->end)
            refuse(x, "a comment without an end");
        else
            x->at += strlen(close);
    }
}

static bool is_name(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.';
}

/* Parse the name of an opening or closing tag; `at` moves behind its '>', attributes are skipped. */
static size_t read_tag(struct xml *x, const char *open, const char **name)
{
    size_t n = 0;

    if (!starts(x, open)) {
        refuse(x, "a tag is missing here");
        return 0;
    }
    x->at += strlen(open);
    *name = x->at;
    while (x->at < x->end && is_name(*x->at))
        x->at++;
    n = (size_t)(x->at - *name);
    while (x->at < x->end && *x->at != '>' && *x->at != '<')
        x->at++;
    if (!n || n > 120 || x->at == x->end || *x->at != '>' || x->at[-1] == '/') {
        refuse(x, "an unusual tag");
        return 0;
    }
    x->at++;
    return n;
}

static bool is_numeric(const char *text, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        if (!strchr("0123456789+-.eE", text[i]) || !text[i])
            return false;
    }
    return n > 0;
}

/* Number of words between two tags; -1: not all are numbers. */
static int count_numbers(const char *p, const char *end)
{
    int words = 0;

    while (p < end) {
        const char *word = p;

        while (p < end && !is_blank(*p))
            p++;
        if (p > word && !is_numeric(word, (size_t)(p - word)))
            return -1;
        words += p > word;
        while (p < end && is_blank(*p))
            p++;
    }
    return words;
}

/* Emit the words between two tags: one number is a scalar, more are a list (the elements of a matrix), anything else
 * is a string, of which only names are of interest: quotation marks are dropped, entities stay as they are. */
static void put_words(struct xml *x)
{
    const char *end = x->at;
    bool has_word = false;
    int numbers;

    while (end < x->end && *end != '<')
        end++;
    if (end == x->end) {
        refuse(x, "a text without an end");
        return;
    }
    numbers = count_numbers(x->at, end);
    emit(x, numbers <= 0 ? "\"" : "[", numbers != 1);
    for (; x->at < end; x->at++) {
        if (numbers <= 0) {
            emit(x, is_blank(*x->at) ? " " : *x->at == '\\' ? "/" : x->at, *x->at != '"');
            continue;
        }
        if (is_blank(*x->at)) {
            emit(x, "\n", *x->at == '\n');
            continue;
        }
        if (has_word && is_blank(x->at[-1]))
            emit(x, ", ", 2);
        emit(x, x->at, 1);
        has_word = true;
    }
    emit(x, numbers <= 0 ? "\"" : "]", numbers != 1);
}

static void put_element(struct xml *x, bool listed, int depth);

/* Content of an element: elements named "_" (a list), other elements (a mapping), or words. */
static void put_content(struct xml *x, int depth)
{
    bool listed;

    skip_rest(x);
    if (x->err)
        return;
    if (!starts(x, "<") || starts(x, "</")) {
        put_words(x);
        return;
    }
    if (depth == MAX_DEPTH) {
        refuse(x, "elements are nested deeper than any camera's");
        return;
    }
    listed = starts(x, "<_>");
    emit(x, listed ? "[" : "{", 1);
    for (; !x->err && !starts(x, "</"); skip_rest(x)) {
        put_element(x, listed, depth);
        emit(x, ", ", 2);
    }
    emit(x, listed ? "]" : "}", 1);
}

static void put_element(struct xml *x, bool listed, int depth)
{
    const char *name = NULL, *closing = NULL;
    const size_t n = read_tag(x, "<", &name);
    size_t m;

    if (x->err)
        return;
    if (listed != (n == 1 && *name == '_')) {
        refuse(x, "elements of a list and others are mixed");
        return;
    }
    if (!listed) {
        emit(x, "\"", 1);
        emit(x, name, n);
        emit(x, "\": ", 3);
    }
    put_content(x, depth + 1);
    if (x->err)
        return;
    m = read_tag(x, "</", &closing);
    if (!x->err && (m != n || memcmp(name, closing, n) != 0))
        refuse(x, "a tag that closes another element");
}

static int from_xml(char **out, size_t *out_size, const char *text, size_t size, const char *name)
{
    struct xml x = { .at = text, .begin = text, .end = text + size, .name = name };
    const char *tag = NULL;
    char *made = NULL;
    size_t made_size, n;

    x.out = open_memstream(&made, &made_size);
    if (!x.out)
        return no_memory(name);
    skip_rest(&x);
    n = x.err ? 0 : read_tag(&x, "<", &tag);
    if (!x.err && (n != 14 || memcmp(tag, "opencv_storage", 14) != 0))
        refuse(&x, "the outermost element is not opencv_storage");
    if (!x.err)
        put_content(&x, 0);
    if (!x.err && read_tag(&x, "</", &tag) != 14)
        refuse(&x, "opencv_storage does not end");
    emit(&x, "\n", 1);
    if (fclose(x.out) && !x.err)
        x.err = no_memory(name);
    if (x.err) {
        free(made);
        return x.err;
    }
    *out = made;
    *out_size = made_size;
    return 0;
}

int sst_opencv_to_yaml(char **out, size_t *out_size, const char *text, size_t size, const char *name)
{
    char *made;

    if (size && *text == '<')
        return from_xml(out, out_size, text, size, name);
    made = plain_yaml(text, size);
    if (!made)
        return no_memory(name);
    *out = made;
    *out_size = size;
    return 0;
}
