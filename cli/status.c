/* sst status: state of the service, on one screen. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "cli/cli_internal.h"

#define TEXT      512
#define SHORT_MAX 140 /* bytes of a sentence: one line */
#define NAMED_MAX 12  /* cameras named; more are counted */

/* --- lines -------------------------------------------------------------------------------------------------------- */

/* What is printed, in its order. */
__asm__(".section .rodata\nstatus_lines: .incbin \"cli/status.txt\"\n.byte 0\n.previous");
extern const char status_lines[];

static void print_list(const json_t *list)
{
    char text[TEXT];

    for (size_t i = 0; i < json_array_size(list); i++)
        printf("%s%s", i ? ", " : "", cli_text(json_array_get(list, i), "", text, sizeof(text)));
}

/* @param form  of the number or text; "": as it is */
static void print_member(const json_t *o, const char *path, const char *form)
{
    const json_t *member = cli_member(o, path);
    const double n = cli_number(o, path);
    char text[TEXT], brief[CLI_SHORT];

    cli_text(o, path, text, sizeof(text));
    if (json_is_array(member))
        print_list(member);
    else if (!strcmp(form, "bytes"))
        printf("%s", cli_bytes_text(brief, n));
    else if (!strcmp(form, "duration"))
        printf("%s", cli_duration_text(brief, n));
    else if (!strcmp(form, "short"))
        printf("%.*s%s", SHORT_MAX, text, strlen(text) > SHORT_MAX ? " ..." : "");
    else if (json_is_number(member))
        printf(*form ? form : "%.0f", n);
    else
        printf(*form == '%' && json_is_string(member) ? form : "%s", json_is_string(member) ? text : "?");
}

static bool holds(const json_t *o, const char *path, char operator, const char * word)
{
    const json_t *member = cli_member(o, path);
    const double n = cli_number(o, path);
    const char *text = json_string_value(member);
    const bool some = n > 0 || (text && *text) || json_is_object(member) || json_array_size(member);

    return operator== '?' ? some :
           operator== '!' ? !some
           :
           operator== '+' ? n > 1
           :
           operator== '#' ? !isnan(n)
                          : text && !strcmp(text, word);
}

/** @param some  out: true if anything is printed @return end: "" or the bracket that closes the text */
static const char *print_text(const json_t *o, const char *t, bool shown, bool *some)
{
    char path[64], word[16] = "";

    for (; *t && *t != ']'; t++) {
        *some |= shown && *t != '[';
        if (*t == '{') {
            (void)sscanf(t + 1, "%63[^:}]:%15[^}]", path, word);
            if (shown)
                print_member(o, path, word);
            t = strchr(t, '}');
            word[0] = 0;
        } else if (*t == '[') {
            const size_t n = strcspn(t + 1, "?!+#=");
            const char operator= t[1 + n];

            snprintf(path, sizeof(path), "%.*s", (int)n, t + 1);
            t += n + 2;
            if (operator== '=') {
                (void)sscanf(t, "%15[^?]", word);
                t = strchr(t, '?') + 1;
            }
            t = print_text(o, t, shown && holds(o, path, operator, word), some);
            word[0] = 0;
        } else if (shown) {
            putchar(*t);
        }
    }
    return t;
}

static void print_line(const json_t *o, const char *text)
{
    bool some = false;

    if (json_is_object(o))
        print_text(o, text, true, &some);
    if (some)
        putchar('\n');
}

/* --- state and cameras -------------------------------------------------------------------------------------------- */

static bool coloured(void)
{
    const char *no = getenv("NO_COLOR"), *term = getenv("TERM");

    return isatty(STDOUT_FILENO) && !(no && *no) && term && strcmp(term, "dumb") != 0;
}

static void print_state(const json_t *s)
{
    char state[TEXT];
    const char *colour = "33"; /* yellow */

    cli_text(s, "state", state, sizeof(state));
    if (!strcmp(state, "capturing"))
        colour = "32"; /* green */
    else if (!strcmp(state, "failed"))
        colour = "31"; /* red */
    if (!coloured())
        printf("%s", *state ? state : "?");
    else
        printf("\033[1;%sm%s\033[0m", colour, *state ? state : "?");
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

/* Frames that are in no set, by reason. */
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

/* "2; black: r0c0 24 %, r0c2 33 %": cameras whose frames have masks, and how much of each is black. */
static void print_masks(const json_t *s, const json_t *cameras)
{
    const json_t *list = cli_member(cameras, "cameras");
    const double masks = cli_number(s, "capture.privacy.masks"), withheld = cli_number(s, "capture.privacy.withheld");
    char name[TEXT];
    int n = 0;

    if (!(masks > 0))
        return;
    printf("  masks      %.0f; black: ", masks);
    for (size_t i = 0; i < json_array_size(list); i++) {
        const json_t *cam = json_array_get(list, i);
        const double share = cli_number(cam, "masked");

        if (share > 0 && n++ < NAMED_MAX)
            printf("%s%s %.2g %%", n > 1 ? ", " : "", cli_text(cam, "name", name, sizeof(name)), 100 * share);
    }
    if (n > NAMED_MAX)
        printf(" and parts of %d more", n - NAMED_MAX);
    printf("%s", n ? "" : "nothing of any camera");
    if (withheld > 0)
        printf("; %.0f damaged frames withheld", withheld);
    printf("\n");
}

static void print_status(json_t *status, const json_t *cameras)
{
    const double sets = cli_number(status, "capture.sets");
    char of[64], text[2048];

    if (sets > 0)
        json_object_set_new(json_object_get(status, "capture"), "complete_percent",
                            json_real(100 * cli_number(status, "capture.complete") / sets));
    print_state(status);
    for (const char *at = strstr(status_lines, "\n==="), *end; at; at = end) {
        const char *name = at + 4 + (at[4] == ' '), *from = strchr(name, '\n') + 1;
        const json_t *member;

        end = strstr(from, "\n===");
        snprintf(of, sizeof(of), "%.*s", (int)(from - 1 - name), name);
        snprintf(text, sizeof(text), "%.*s", end ? (int)(end - from) : (int)strcspn(from, "\n"), from);
        member = cli_member(status, of);
        if (!strcmp(of, "(missing)"))
            print_missing(cameras);
        if (!strcmp(of, "(frames)"))
            print_frames(status);
        if (!strcmp(of, "(masks)"))
            print_masks(status, cameras);
        for (size_t i = 0; i < json_array_size(member); i++)
            print_line(json_array_get(member, i), text);
        print_line(member, text);
    }
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
    return cli_flush() && !err ? -EPIPE : err;
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

const struct cli_command cli_status = { "status", run };
