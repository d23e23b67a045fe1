/* Hooks: arguments of a program, which no shell sees, limits of time and number, and stopping. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "daemon/publish/hooks.h"
#include "daemon/publish/publish_internal.h"
#include "tests/folder.h"
#include "tests/quick.h"
#include "tests/test.h"

static struct sst_events *events;
static struct sst_hooks *hooks;

static int setup(void **state)
{
    assert_int_equal(sst_events_create(&events, 256), 0);
    return test_folder_create(state);
}

static int teardown(void **state)
{
    sst_hooks_close(hooks);
    hooks = NULL;
    sst_events_destroy(events);
    return test_folder_remove(state);
}

/* One hook that gives a script to the shell; $0 is the test's folder, $1 the argument. */
static struct sst_hook script(const char *event, const char *text, const char *argument)
{
    struct sst_hook h = { .argv = { "/bin/sh", "-c" } };

    snprintf(h.event, sizeof(h.event), "%s", event);
    snprintf(h.argv[2], sizeof(h.argv[2]), "%s", text);
    snprintf(h.argv[3], sizeof(h.argv[3]), "%s", test_folder);
    snprintf(h.argv[4], sizeof(h.argv[4]), "%s", argument);
    return h;
}

static void open_hooks(const struct sst_hook *hook, int n, int limit_ms)
{
    const struct sst_hooks_config cfg = { .events = events, .hook = hook, .hooks = n, .limit_ms = limit_ms };

    assert_int_equal(sst_hooks_open(&hooks, &cfg), 0);
}

static struct sst_hooks_counters counters(void)
{
    struct sst_hooks_counters n;

    sst_hooks_counters(hooks, &n);
    return n;
}

/* Until that many have been run and none runs. */
static struct sst_hooks_counters wait_for(uint64_t run)
{
    struct sst_hooks_counters n = counters();

    for (int i = 0; i < 6000 && (n.run < run || n.running || n.waiting); i++) {
        usleep(10000);
        n = counters();
    }
    assert_int_equal(n.run, run);
    assert_int_equal(n.running, 0);
    return n;
}

/* Until the next call. */
static const char *content(const char *name)
{
    static char text[16384];
    FILE *f = fopen(test_path("%s", name), "r");

    assert_non_null(f);
    text[fread(text, 1, sizeof(text) - 1, f)] = 0;
    fclose(f);
    return text;
}

static void expect_line(const char *text, const char *line)
{
    const size_t n = strlen(line);

    for (const char *at = text; (at = strstr(at, line)); at++)
        if ((at == text || at[-1] == '\n') && at[n] == '\n')
            return;
    fail_msg("no line '%s' in:\n%s", line, text);
}

static void a_program_is_told_what_happened(void **state)
{
    const struct sst_hook h[] = {
        script("motion",
               "env >$0/env; ls /proc/self/fd >$0/fds; cat >$0/in; cut -d' ' -f5 /proc/$$/stat >$0/group; "
               "echo $$ >>$0/group; printf %s \"$1\" >$0/arg; trap >$0/traps",
               "$(touch boom); `touch boom`"),
        script("label", "touch $0/boom", ""),
    };
    const char *text, *second;

    (void)state;
    setenv("NOTIFY_SOCKET", "/nowhere", 1);
    setenv("SST_STALE", "1", 1);
    setenv("TEST_SECRET", "1", 1);
    open_hooks(h, 2, 0);
    sst_events_emit(events, SST_EVENT_INFO, "motion",
                    json_pack("{s:s, s:f, s:b, s:i, s:{s:i}, s:s, s:n}", "zone", "gate", "share", 0.25, "active", 1,
                              "free-bytes", 7, "nested", "a", 1, "message", "not this", "nothing"),
                    "something moves; touch boom");
    assert_int_equal(wait_for(1).failed, 0);
    text = content("env");
    expect_line(text, "SST_EVENT=motion");
    expect_line(text, "SST_LEVEL=info");
    expect_line(text, "SST_ID=1");
    expect_line(text, "SST_MESSAGE=something moves; touch boom");
    expect_line(text, "SST_ZONE=gate");
    expect_line(text, "SST_SHARE=0.25");
    expect_line(text, "SST_ACTIVE=true");
    expect_line(text, "SST_FREE_BYTES=7");
    expect_line(text, "SST_NESTED={\"a\":1}");
    expect_line(text, "SST_NOTHING=null");
    assert_non_null(strstr(text, "SST_TIME=20"));
    assert_non_null(strstr(text, "SST_DATA={\""));
    assert_non_null(strstr(text, "PATH="));
    assert_null(strstr(text, "NOTIFY_SOCKET"));
    assert_null(strstr(text, "SST_STALE"));
    assert_null(strstr(text, "TEST_SECRET"));
    text = content("fds"); /* 3 is the folder that ls reads */
    assert_string_equal(text, "0\n1\n2\n3\n");
    text = content("in");
    assert_string_equal(text, "");
    text = content("group");
    second = strchr(text, '\n');
    assert_non_null(second);
    assert_int_equal(atoi(text), atoi(second + 1));
    text = content("arg");
    assert_string_equal(text, "$(touch boom); `touch boom`");
    assert_false(sst_path_exists(test_path("boom")) || sst_path_exists("boom"));
}

static void what_is_no_event_makes_no_environment(void **state)
{
    (void)state;
    assert_null(hook_env("[1]"));
    assert_null(hook_env("{"));
    assert_null(hook_env("{\"type\": \"x\"}"));
}

/* The process with the number in this file is gone, or waits for init to reap it. */
static void expect_gone(const char *name)
{
    char path[64], state_of = 'R';
    FILE *f;

    snprintf(path, sizeof(path), "/proc/%d/stat", atoi(content(name)));
    for (int k = 0; k < 6000 && state_of != 'Z' && (f = fopen(path, "r")); k++) {
        if (fscanf(f, "%*d %*s %c", &state_of) != 1)
            state_of = 'R';
        fclose(f);
        usleep(10000);
    }
    assert_true(state_of == 'Z' || access(path, F_OK));
}

/* Also what it started, in its group; and what a program left behind that ended by itself. A shell that does not come
 * so far within the limit, on a busy machine, is followed by another. */
static void programs_are_killed_with_their_groups(void **state)
{
    const struct sst_hook left = script("motion", "sleep 600 & echo $! >$0/left; wait", "");
    const struct sst_hook behind = script("label", "sleep 600 & echo $! >$0/behind", "");
    struct sst_hooks_counters n;
    uint64_t runs = 0;
    int64_t start;

    (void)state;
    open_hooks(&behind, 1, 60000);
    sst_events_emit(events, SST_EVENT_INFO, "label", NULL, "label");
    n = wait_for(1);
    assert_int_equal(n.killed + n.failed, 0);
    expect_gone("behind");
    sst_hooks_close(hooks);
    open_hooks(&left, 1, 3000);
    do {
        start = sst_clock_now_ns();
        sst_events_emit(events, SST_EVENT_INFO, "motion", NULL, "moves");
        n = wait_for(++runs);
        assert_true(sst_clock_now_ns() - start > INT64_C(3000000000));
        assert_quick(start, INT64_C(6000000000));
        assert_int_equal(n.killed, runs);
        assert_int_equal(n.failed, runs);
    } while (runs < 10 && (access(test_path("left"), F_OK) || !content("left")[0]));
    expect_gone("left");
}

/* As daemons do: a session of its own, and a parent that ends; at the program's end, at its limit and at closing. */
static void what_left_its_group_is_killed_too(void **state)
{
    static const char away[] = "setsid sh -c 'sleep 600 & echo $! >'$0'/%s.part; mv '$0'/%s.part '$0'/%s; wait' & "
                               "while [ ! -e $0/%s ]; do sleep 0.01; done%s";
    static const char *const ends[][2] = { { "motion", "" }, { "label", "; sleep 600" }, { "skew", "; sleep 600" } };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(ends); i++) {
        const bool limit = i == 1;
        const char *name = ends[i][0];
        struct sst_hook hook;
        char text[400];
        uint64_t runs = 0;

        snprintf(text, sizeof(text), away, name, name, name, name, ends[i][1]);
        hook = script(name, text, "");
        open_hooks(&hook, 1, limit ? 2000 : 60000);
        do { /* a machine that is busy may not come so far within the limit */
            sst_events_emit(events, SST_EVENT_INFO, name, NULL, "%s", name);
            if (i < 2)
                (void)wait_for(++runs);
            for (int k = 0; i == 2 && k < 6000 && access(test_path(name), F_OK); k++)
                usleep(10000);
        } while (access(test_path(name), F_OK) && runs < 10);
        if (i == 2)
            sst_hooks_close(hooks);
        expect_gone(name);
        if (i < 2)
            sst_hooks_close(hooks);
        hooks = NULL;
    }
}

static void the_queue_is_bounded_and_closing_quick(void **state)
{
    const struct sst_hook h = script("*", "sleep 60", "");
    struct sst_hooks_counters n = { 0 };
    int64_t start;

    (void)state;
    open_hooks(&h, 1, 0);
    for (int i = 0; i < 100; i++)
        sst_events_emit(events, SST_EVENT_INFO, "skew", NULL, "skew %d", i);
    for (int i = 0; i < 6000 && n.dropped < 32; i++) {
        usleep(10000);
        n = counters();
    }
    assert_true(n.running <= SST_HOOKS_AT_ONCE && n.waiting <= SST_HOOKS_WAITING);
    assert_true(n.dropped >= 32 && n.dropped <= 36);
    start = sst_clock_now_ns();
    sst_hooks_close(hooks);
    hooks = NULL;
    assert_quick(start, 1000000000);
}

/* Settings are replaced while programs run; a failing one is told once, and when it succeeds again. */
static void a_status_is_told_once(void **state)
{
    struct sst_hook h = script("motion", "test -e $0/good", "");
    struct sst_hook missing = { .event = "label", .argv = { "/nonexistent/program" } };
    char said[4096] = "";
    FILE *kept = tmpfile(), *good;
    const int before = dup(2);
    struct sst_hook both[2] = { h, missing };

    (void)state;
    assert_non_null(kept);
    dup2(fileno(kept), 2);
    open_hooks(both, 2, 0);
    for (uint64_t i = 1; i <= 6; i++) {
        if (i == 4) {
            good = fopen(test_path("good"), "w");
            fclose(good);
        }
        sst_events_emit(events, SST_EVENT_INFO, i == 6 ? "label" : "motion", NULL, "event");
        (void)wait_for(i);
    }
    assert_int_equal(counters().failed, 4);
    sst_hooks_configure(hooks, &h, 0);
    sst_events_emit(events, SST_EVENT_INFO, "motion", NULL, "nobody listens");
    usleep(100000);
    assert_int_equal(counters().run, 6);
    dup2(before, 2);
    close(before);
    rewind(kept);
    said[fread(said, 1, sizeof(said) - 1, kept)] = 0;
    fclose(kept);
    for (int i = 0; i < 3; i++) {
        static const char *const words[] = { "of motion ended with status 1", "of motion succeeds again",
                                             "hook /nonexistent/program of label cannot be run: No such file" };
        const char *at = strstr(said, words[i]);

        if (!at || strstr(at + 1, words[i]))
            fail_msg("not once '%s' in: %s", words[i], said);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_program_is_told_what_happened, setup, teardown),
        cmocka_unit_test_setup_teardown(what_is_no_event_makes_no_environment, setup, teardown),
        cmocka_unit_test_setup_teardown(programs_are_killed_with_their_groups, setup, teardown),
        cmocka_unit_test_setup_teardown(what_left_its_group_is_killed_too, setup, teardown),
        cmocka_unit_test_setup_teardown(the_queue_is_bounded_and_closing_quick, setup, teardown),
        cmocka_unit_test_setup_teardown(a_status_is_told_once, setup, teardown),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
