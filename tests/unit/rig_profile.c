/* Drive profiles: the ones that ship are read; faults are told with line and column. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "drivers/rig/rig_internal.h"
#include "tests/test.h"

static struct rig_profile profile;
static char said[SST_LOG_MAX];

static void every_profile_that_ships_is_read(void **state SST_UNUSED)
{
    DIR *dir = opendir("config/profiles");
    int n = 0;

    assert_non_null(dir);
    for (struct dirent *e = readdir(dir); e; e = readdir(dir)) {
        char path[300];

        if (e->d_name[0] == '.')
            continue;
        snprintf(path, sizeof(path), "config/profiles/%.200s", e->d_name);
        memset(&profile, 0, sizeof(profile));
        assert_int_equal(rig_profile_read(&profile, path), 0);
        assert_true(profile.steps[SST_RIG_SEQ_MOVE] > 0 && profile.steps[SST_RIG_SEQ_STOP] > 0);
        assert_true(profile.manual[0]);
        n++;
    }
    closedir(dir);
    assert_true(n >= 3);
}

static void registers_bits_and_steps(void **state SST_UNUSED)
{
    char text[128];

    assert_int_equal(rig_profile_read(&profile, "config/profiles/leadshine-pr.yaml"), 0);
    assert_int_equal(profile.reg[profile.position].address, 0x602C);
    assert_int_equal(profile.reg[profile.position].type, SST_RIG_S32);
    assert_int_equal(profile.bit[SST_RIG_IN_POSITION].mask, 0x30);
    assert_int_equal(profile.bit[SST_RIG_LIMIT_LOW].reg, -1);
    assert_int_equal(profile.identity, -1);
    assert_false(profile.tried);
    /* mode, target, trigger */
    assert_int_equal(profile.steps[SST_RIG_SEQ_MOVE], 3);
    assert_int_equal(profile.step[SST_RIG_SEQ_MOVE][1].value, SST_RIG_TARGET);
    assert_float_equal(profile.step[SST_RIG_SEQ_MOVE][2].number, 0x10, 0);
    assert_int_equal(profile.step[SST_RIG_SEQ_MOVE][2].flag, SST_RIG_MOVING);
    assert_false(profile.reg[profile.step[SST_RIG_SEQ_MOVE][2].reg].read_back);
    rig_profile_alarm(&profile, 0x02, text, sizeof(text));
    assert_string_equal(text, "0x02 (overvoltage)");
    rig_profile_alarm(&profile, 0x99, text, sizeof(text));
    assert_string_equal(text, "0x99 (see the drive's manual)");
}

/* A small whole profile in which one text is replaced by another. */
static void refuse(const char *from, const char *to, const char *words)
{
    static const char good[] = "name: n\nmanual: m\ntried_on_hardware: false\n"
                               "registers:\n"
                               "  s: { table: input, address: 0x10, type: u16 }\n"
                               "  p: { table: input, address: 0x11, type: s32 }\n"
                               "  c: { table: holding, address: 0, type: u16 }\n"
                               "position: p\n"
                               "flags:\n"
                               "  moving: { register: s, bit: 0 }\n"
                               "  in_position: { register: s, bit: 1 }\n"
                               "  homed: { register: s, bit: 2 }\n"
                               "  alarm: { register: s, mask: 0xF000, equals: 0x1000 }\n"
                               "sequences:\n"
                               "  move: [ { write: c, value: target } ]\n"
                               "  home: [ { write: c, value: 1 } ]\n"
                               "  stop: [ { write: c, value: 2 }, { wait: moving, is: false, within_ms: 5 } ]\n"
                               "  reset: [ { pause_ms: 5 } ]\n";
    const char *at = strstr(good, from);
    char path[] = "/tmp/sst-profile-XXXXXX.yaml", text[2048];
    const int fd = mkstemps(path, 5);
    int err;

    assert_non_null(at);
    snprintf(text, sizeof(text), "%.*s%s%s", (int)(at - good), good, to, at + strlen(from));
    assert_int_equal(write(fd, text, strlen(text)), (ssize_t)strlen(text));
    close(fd);
    said[0] = 0;
    (void)sst_log_hold_errors(said);
    err = rig_profile_read(&profile, path);
    (void)sst_log_hold_errors(NULL);
    unlink(path);
    assert_int_equal(err, words ? -EBADMSG : 0);
    if (words)
        assert_contains(said, words);
}

static void faults_are_told(void **state SST_UNUSED)
{
    refuse("name: n", "name: n", NULL);
    refuse("position: p\n", "", "position");
    refuse("position: p", "position: q", "unknown register `q`");
    refuse("address: 0x10,", "address: 0x10000,", "0..65535");
    refuse("type: u16 }\n  p:", "type: u64 }\n  p:", "u16, s16, u32, s32 or bit");
    refuse("table: input, address: 0x11, type: s32", "table: coil, address: 0x11, type: s32", "coil");
    refuse("{ register: s, bit: 0 }", "{ register: s }", "bit, or mask and equals");
    refuse("bit: 0", "bit: 0, colour: red", "colour");
    refuse("write: c, value: 1", "write: s, value: 1", "writes an input");
    refuse("write: c, value: 1", "write: c, value: onwards", "whole number");
    refuse("{ pause_ms: 5 }", "{ }", "must be a step");
    refuse("wait: moving", "wait: enabled", "not listed under flags");
    refuse("move: [ { write: c, value: target } ]", "move: 5", "list");
    refuse("flags:\n", "flaggs:\n", "flag");
    refuse("sequences:\n  move", "sequences:\n  dance: []\n  move", "dance");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_profile_that_ships_is_read),
        cmocka_unit_test(registers_bits_and_steps),
        cmocka_unit_test(faults_are_told),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
