/* base/log_limit: one line a minute for an address, with a count of the others, and no more addresses than are
 * remembered. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "base/log_limit.h"
#include "tests/test.h"

#define SECOND INT64_C(1000000000)

static struct sst_log_limit limit;
static FILE *said;
static int shown;

static int set_up(void **state SST_UNUSED)
{
    memset(&limit, 0, sizeof(limit));
    limit.what = "gate: refused";
    said = tmpfile();
    shown = dup(STDERR_FILENO);
    return said && shown >= 0 && dup2(fileno(said), STDERR_FILENO) >= 0 ? 0 : -1;
}

/* Lines logged since set_up(). */
static const char *log_text(void)
{
    static char text[65536];
    size_t n;

    dup2(shown, STDERR_FILENO);
    close(shown);
    rewind(said);
    n = fread(text, 1, sizeof(text) - 1, said);
    text[n] = 0;
    fclose(said);
    return text;
}

static bool due(const char *address, int64_t now_ns)
{
    struct sockaddr_in four = { .sin_family = AF_INET };
    struct sockaddr_in6 six = { .sin6_family = AF_INET6 };

    if (inet_pton(AF_INET, address, &four.sin_addr) == 1)
        return sst_log_limit_due(&limit, (const struct sockaddr *)&four, address, now_ns);
    assert_int_equal(inet_pton(AF_INET6, address, &six.sin6_addr), 1);
    return sst_log_limit_due(&limit, (const struct sockaddr *)&six, address, now_ns);
}

static void one_line_a_minute_and_a_count(void **state SST_UNUSED)
{
    int lines = 0;

    for (int i = 0; i < 150 * 600; i++) /* 10 minutes, 150 a second */
        lines += due("192.0.2.7", SECOND + i * SECOND / 150);
    assert_int_equal(lines, 1);
    sst_log_limit_work(&limit, 602 * SECOND);
    assert_string_equal(log_text(), "sst: warning: gate: refused: 8999 more of 192.0.2.7 within a minute\n"
                                    "sst: warning: gate: refused: 9000 more of 192.0.2.7 within a minute\n"
                                    "sst: warning: gate: refused: 9000 more of 192.0.2.7 within a minute\n"
                                    "sst: warning: gate: refused: 9000 more of 192.0.2.7 within a minute\n"
                                    "sst: warning: gate: refused: 9000 more of 192.0.2.7 within a minute\n"
                                    "sst: warning: gate: refused: 9000 more of 192.0.2.7 within a minute\n"
                                    "sst: warning: gate: refused: 9000 more of 192.0.2.7 within a minute\n"
                                    "sst: warning: gate: refused: 9000 more of 192.0.2.7 within a minute\n"
                                    "sst: warning: gate: refused: 9000 more of 192.0.2.7 within a minute\n"
                                    "sst: warning: gate: refused: 9000 more of 192.0.2.7 within a minute\n");
}

static void quiet_addresses_are_forgotten(void **state SST_UNUSED)
{
    assert_true(due("192.0.2.7", SECOND));
    assert_false(due("192.0.2.7", 2 * SECOND));
    assert_true(due("192.0.2.8", 2 * SECOND));
    assert_false(due("192.0.2.7", 61 * SECOND)); /* the number left out is logged, and counts for a minute */
    sst_log_limit_work(&limit, 121 * SECOND);
    sst_log_limit_work(&limit, 181 * SECOND);
    assert_true(due("192.0.2.7", 182 * SECOND));
    assert_false(due("192.0.2.7", 183 * SECOND));
    sst_log_limit_work(&limit, INT64_MAX);
    assert_string_equal(log_text(), "sst: warning: gate: refused: 1 more of 192.0.2.7 within a minute\n"
                                    "sst: warning: gate: refused: 1 more of 192.0.2.7 within a minute\n"
                                    "sst: warning: gate: refused: 1 more of 192.0.2.7 within a minute\n");
}

static void many_addresses_share_a_line(void **state SST_UNUSED)
{
    int lines = 0;
    char address[32];

    for (int i = 0; i < 1000; i++) {
        snprintf(address, sizeof(address), "10.0.%d.%d", i / 250, i % 250);
        lines += due(address, SECOND + i);
    }
    assert_int_equal(lines, SST_LOG_LIMIT_ADDRESSES + 1);
    assert_false(due("10.0.0.0", 2 * SECOND));
    /* Of IPv6 one client has a whole network. */
    sst_log_limit_work(&limit, 62 * SECOND);
    sst_log_limit_work(&limit, 200 * SECOND);
    lines = 0;
    for (int i = 0; i < 1000; i++) {
        snprintf(address, sizeof(address), "2001:db8::%x", i);
        lines += due(address, 201 * SECOND);
    }
    assert_int_equal(lines, 1);
    assert_string_equal(log_text(), "sst: warning: gate: refused: 1 more of 10.0.0.0 within a minute\n"
                                    "sst: warning: gate: refused: 983 more of other addresses within a minute\n");
}

/* Standard error without a reader holds no thread up; lost lines are counted in the next line that has room. */
static void lines_that_nobody_reads_are_lost(void **state SST_UNUSED)
{
    char text[8192], *line = text;
    int end[2], written = 0, n;
    unsigned long lost = 0;

    assert_int_equal(pipe2(end, O_CLOEXEC | O_NONBLOCK), 0);
    assert_true(fcntl(end[1], F_SETPIPE_SZ, 4096) >= 4096);
    assert_int_equal(fcntl(end[1], F_SETFL, 0), 0); /* as a journal's: writing waits */
    assert_true(dup2(end[1], STDERR_FILENO) >= 0);
    sst_log_never_wait();
    for (int i = 0; i < 1000; i++)
        sst_log_error("line %03d ..............................................................................", i);
    while ((n = (int)read(end[0], text, sizeof(text) - 1)) > 0)
        for (text[n] = 0, line = text; (line = strchr(line, '\n')); line++)
            written++;
    sst_log_error("the last");
    n = (int)read(end[0], text, sizeof(text) - 1);
    (void)log_text();
    assert_true(written > 0 && written < 1000 && n > 0);
    text[n] = 0;
    assert_int_equal(sscanf(text, "sst: warning: %lu lines of the log are lost\n", &lost), 1);
    assert_int_equal(lost, 1000 - written);
    assert_non_null(strstr(text, "lost\nsst: error: the last\n"));
    close(end[0]);
    close(end[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(one_line_a_minute_and_a_count, set_up),
        cmocka_unit_test_setup(quiet_addresses_are_forgotten, set_up),
        cmocka_unit_test_setup(many_addresses_share_a_line, set_up),
        cmocka_unit_test_setup(lines_that_nobody_reads_are_lost, set_up), /* the last test: it cannot be undone */
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
