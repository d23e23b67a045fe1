/* Still cameras, simulated: detection, settings that are read back, files, and each fault by its name. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "drivers/still/still.h"
#include "tests/sim_session.h"
#include "tests/test.h"

#if defined(__SANITIZE_ADDRESS__)
/* The port of a camera that is gone is not closed by libgphoto2, whose part for USB is unloaded when leaks are looked
 * for. */
const char *__asan_default_options(void);
const char *__lsan_default_suppressions(void);

const char *__asan_default_options(void)
{
    return "fast_unwind_on_malloc=0";
}

const char *__lsan_default_suppressions(void)
{
    return "leak:libgphoto2_port.so\n";
}
#endif

/* More than a picture takes on a machine that is busy. */
#define QUIET_MS 3000

#define WORLD "simulators/scene/world/worlds/still-rig.yaml"

static char said[SST_LOG_MAX];

static struct sst_still_config config(void)
{
    struct sst_still_config cfg;

    sst_still_config_defaults(&cfg);
    cfg.focus = SST_STILL_FOCUS_MANUAL;
    cfg.card_ms = 4000;
    cfg.quiet_ms = 300;
    cfg.response_ms = 1500;
    return cfg;
}

static struct sst_still *open_camera(const struct sst_still_config *cfg)
{
    struct sst_still *s = NULL;

    assert_int_equal(sst_still_open(&s, cfg), 0);
    return s;
}

/** Open without success. @return the error; its text is in `said` */
static int refused(const struct sst_still_config *cfg)
{
    struct sst_still *s;
    int err;

    said[0] = 0;
    (void)sst_log_hold_errors(said);
    err = sst_still_open(&s, cfg);
    (void)sst_log_hold_errors(NULL);
    return err;
}

/** Capture with a fault. @return the error; its text is in `said` */
static int with_fault(struct sst_still *s, const char *fault)
{
    struct sst_still_shot shot;
    int err;

    assert_int_equal(session_fault(fault), 0);
    said[0] = 0;
    (void)sst_log_hold_errors(said);
    err = sst_still_capture(s, &shot);
    (void)sst_log_hold_errors(NULL);
    if (!err) {
        assert_int_equal(shot.files, 1);
        sst_still_release_files(s, &shot);
    }
    return err;
}

static void cameras_are_listed(void **state SST_UNUSED)
{
    struct sst_still_device *list;
    int count;

    assert_int_equal(sst_still_list(&list, &count), 0);
    assert_int_equal(count, 1);
    assert_string_equal(list[0].serial, "SST0001");
    assert_string_equal(list[0].port, "2-1");
    assert_string_equal(list[0].name, "sst SST Still Camera");
    assert_int_equal(list[0].error, 0);
    free(list);
}

static void settings_are_set_and_read_back(void **state SST_UNUSED)
{
    struct sst_still_config cfg = config();
    struct sst_still_state now;
    struct sst_still *s;

    cfg.camera = "SST0001";
    cfg.exposure = "1/125";
    cfg.aperture = "11";
    cfg.iso = "400";
    s = open_camera(&cfg);
    assert_string_equal(sst_still_serial(s), "SST0001");
    assert_string_equal(sst_still_port(s), "2-1");
    assert_contains(sst_still_settings(s), "exposure time 0.0080s, aperture f/11, ISO 400");
    assert_contains(sst_still_settings(s), "focus mode Manual");
    sst_still_state(s, &now);
    assert_int_equal(now.battery_percent, 80);
    assert_true(now.card_bytes > 60000000 && now.card_free_bytes > 60000000 && now.card_pictures > 100);
    sst_still_close(s);
    cfg.iso = "401000";
    assert_int_equal(refused(&cfg), -EINVAL);
    assert_contains(said, "choose one of 100, 200");
    cfg.iso = "800";
    assert_int_equal(session_fault("still.refuse=1"), 0);
    assert_int_equal(refused(&cfg), -EPERM);
    assert_contains(said, "refuses ISO 800 and keeps 400");
    cfg.camera = "SST0002";
    assert_int_equal(refused(&cfg), -ENODEV);
    assert_contains(said, "there are: SST0001 at 2-1");
}

static void exposures_give_files(void **state SST_UNUSED)
{
    struct sst_still_config cfg = config();
    struct sst_still_shot shot;
    struct sst_still *s;

    cfg.format = "1";
    s = open_camera(&cfg);
    assert_int_equal(sst_still_capture(s, &shot), 0);
    assert_int_equal(shot.files, 1);
    assert_false(shot.file[0].raw);
    assert_int_equal(shot.file[0].width, 320);
    assert_int_equal(shot.file[0].height, 240);
    sst_still_release_files(s, &shot);
    sst_still_close(s);
    cfg.format = "5";
    cfg.files = SST_STILL_BOTH;
    s = open_camera(&cfg);
    assert_int_equal(sst_still_capture(s, &shot), 0);
    assert_int_equal(shot.files, 2);
    assert_true(shot.file[0].raw && !shot.file[1].raw);
    assert_memory_equal(shot.file[0].data, "II*", 4);
    sst_still_release_files(s, &shot);
    sst_still_close(s);
}

static void faults_are_named_and_survived(void **state SST_UNUSED)
{
    struct sst_still_config cfg = config();
    struct sst_still_counters n;
    struct sst_still *s;

    cfg.format = "1";
    s = open_camera(&cfg);
    assert_int_equal(with_fault(s, "still.busy=300"), 0);
    sst_still_counters(s, &n);
    assert_int_equal(n.busy, 1);
    assert_int_equal(with_fault(s, "still.corrupt=1"), -EBADMSG);
    assert_contains(said, "is damaged on its card or by its cable");
    assert_int_equal(with_fault(s, "still.corrupt=2"), -EBADMSG);
    assert_int_equal(with_fault(s, "still.corrupt=3"), 0); /* a second download helps */
    assert_int_equal(with_fault(s, "still.unplug_download=200"), 0);
    assert_contains(said, "was unplugged or switched off");
    assert_int_equal(with_fault(s, "still.silence=1"), -ETIMEDOUT);
    assert_contains(said, "does not answer within 1500 ms");
    assert_int_equal(with_fault(s, "still.no_event=1"), -ETIMEDOUT);
    assert_contains(said, "announced 0 of 1 files within 4000 ms");
    assert_int_equal(with_fault(s, "still.battery=4"), -ENOMEDIUM);
    assert_contains(said, "is low: 4 %");
    assert_int_equal(session_fault("still.battery=0"), 0);
    usleep(2100000); /* libgphoto2 keeps read values for two seconds */
    assert_int_equal(with_fault(s, "still.card_full=1"), -ENOMEDIUM);
    assert_contains(said, "card of still camera SST0001 is full");
    assert_int_equal(with_fault(s, "still.card_full=0"), 0);
    sst_still_counters(s, &n);
    assert_true(n.reopened >= 3 && n.lost >= 1 && n.silent >= 2 && n.damaged >= 4);
    sst_still_close(s);
}

static void an_unplugged_camera_is_waited_for(void **state SST_UNUSED)
{
    struct sst_still_config cfg = config();
    struct sst_still *s;

    cfg.format = "1";
    cfg.reopen_ms = 300;
    s = open_camera(&cfg);
    assert_int_equal(with_fault(s, "still.unplug=1"), -ENODEV);
    assert_contains(said, "was unplugged or switched off");
    assert_int_equal(with_fault(s, "still.unplug=1"), -ENODEV);
    assert_contains(said, "is not back within 300 ms");
    assert_int_equal(with_fault(s, "still.unplug=0"), 0);
    sst_still_close(s);
}

/** A number in the session's status of the still camera. */
static int told(const char *name)
{
    char program[512], command[1024], text[64] = "";
    FILE *f;

    snprintf(command, sizeof(command), "%s status --json | tr ',{}' '\\n' | grep '\"%s\": *[0-9]' | tr -dc 0-9",
             session_program(program), name);
    f = popen(command, "r");
    assert_non_null(f);
    (void)!fgets(text, sizeof(text), f);
    pclose(f);
    return atoi(text);
}

/** Pictures that were exposed so far: the number in the name of the last one. */
static int exposed(void)
{
    return told("exposures");
}

/** Capture until it succeeds: announcements that are late fail. The file has to be of the last release. */
static void captures_the_last_exposure(struct sst_still *s)
{
    struct sst_still_shot shot;
    int err = -1;

    for (int i = 0; err && i < 20; i++)
        err = sst_still_capture(s, &shot);
    assert_int_equal(err, 0);
    assert_int_equal(shot.files, 1);
    assert_int_equal(atoi(shot.file[0].name + strlen("SST_")), exposed());
    sst_still_release_files(s, &shot);
}

static void press(void)
{
    const int files = told("files"); /* on the card */

    assert_int_equal(session_fault("still.press=1"), 0);
    for (int i = 0; i < 600 && told("files") == files; i++)
        usleep(100000);
}

static void files_of_other_releases_are_no_views(void **state SST_UNUSED)
{
    struct sst_still_config cfg = config();
    struct sst_still *s;

    cfg.format = "1";
    cfg.card_ms = 1500;
    cfg.quiet_ms = QUIET_MS;
    press(); /* announced to nobody: it is on the card */
    assert_int_equal(session_fault("still.late_event=1000"), 0);
    press(); /* announced when the camera is open, perhaps after a release */
    s = open_camera(&cfg);
    captures_the_last_exposure(s);
    press(); /* announced before a release */
    captures_the_last_exposure(s);
    for (int late_ms = 1700; late_ms < 4000;
         late_ms += 1600) { /* announced while a later one is waited for, or after */
        char fault[64];

        snprintf(fault, sizeof(fault), "still.late_event=%d", late_ms);
        assert_int_equal(session_fault(fault), 0);
        captures_the_last_exposure(s);
    }
    sst_still_close(s);
}

static void files_that_are_announced_until_they_are_downloaded(void **state SST_UNUSED)
{
    struct sst_still_config cfg = config();
    struct sst_still_counters count;
    struct sst_still *s;

    cfg.format = "1";
    cfg.keep = true;
    cfg.quiet_ms = QUIET_MS;
    assert_int_equal(session_fault("still.repeat=1"), 0);
    press();
    s = open_camera(&cfg);
    press();
    for (int i = 0; i < 3; i++)
        captures_the_last_exposure(s);
    sst_still_close(s);
    cfg.keep = false; /* some announcements come when their file is no longer on the card */
    s = open_camera(&cfg);
    for (int i = 0; i < 3; i++)
        captures_the_last_exposure(s);
    sst_still_counters(s, &count);
    assert_int_equal(count.lost, 0);
    sst_still_close(s);
    assert_int_equal(session_fault("still.repeat=0"), 0);
}

int main(int argc SST_UNUSED, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cameras_are_listed),
        cmocka_unit_test(settings_are_set_and_read_back),
        cmocka_unit_test(exposures_give_files),
        cmocka_unit_test(faults_are_named_and_survived),
        cmocka_unit_test(an_unplugged_camera_is_waited_for),
        cmocka_unit_test(files_of_other_releases_are_no_views),
        cmocka_unit_test(files_that_are_announced_until_they_are_downloaded),
    };
    int skipped;

    if (!WITH_GPHOTO2) {
        puts("built without libgphoto2");
        return 77;
    }
    skipped = session_enter_world(argv, WORLD);
    if (skipped)
        return skipped;
    return cmocka_run_group_tests_name("still camera", tests, NULL, NULL);
}
