/* drivers/grab/ladder: hand-worked timelines. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#include "drivers/grab/grab_internal.h"
#include "tests/test.h"

#define S        INT64_C(1000000000)
#define PATIENCE (2 * S)

static struct ladder fresh(bool usb, bool power)
{
    struct ladder l;

    ladder_init(&l, PATIENCE, usb, power);
    return l;
}

/* A camera that nothing helps: every rung in its order, each given its time, then longer and longer rests. */
static void climbs_every_rung_then_rests_longer(void **state SST_UNUSED)
{
    struct ladder l = fresh(true, true);
    int64_t t = 100 * S, rest_s = 1;

    assert_int_equal(ladder_step(&l, SST_LADDER_FAULT, t, true), SST_GRAB_RESTREAM);
    assert_int_equal(l.phase, SST_LADDER_WORKING);
    assert_int_equal(ladder_step(&l, SST_LADDER_FAULT, t, true), -1); /* at it already */
    for (int rung = SST_GRAB_RESTREAM; rung < SST_GRAB_POWER; rung++) {
        const int64_t wait = rung >= SST_GRAB_RESET ? PATIENCE + 3 * S : PATIENCE;

        t += S / 10;
        assert_int_equal(ladder_step(&l, SST_LADDER_DONE, t, true), -1);
        assert_int_equal(l.due_ns, t + wait);
        assert_int_equal(ladder_step(&l, SST_LADDER_TIME, t + wait - 1, true), -1);
        t += wait;
        assert_int_equal(ladder_step(&l, SST_LADDER_TIME, t, true), rung + 1);
    }
    /* Power switched, no frame: rest 1 s, open, 2 s, ... at most 60 s. */
    for (int i = 0; i<9; i++, rest_s = rest_s * 2> 60 ? 60 : rest_s * 2) {
        while (l.phase != SST_LADDER_RESTING) {
            (void)ladder_step(&l, SST_LADDER_DONE, t, true);
            t = l.due_ns;
            (void)ladder_step(&l, SST_LADDER_TIME, t, true);
        }
        assert_int_equal(l.rung, SST_GRAB_BACK_OFF);
        assert_int_equal(l.due_ns, t + rest_s * S);
        assert_int_equal(ladder_step(&l, SST_LADDER_FAULT, t, false), -1);
        assert_int_equal(ladder_step(&l, SST_LADDER_TIME, l.due_ns - 1, false), -1);
        t = l.due_ns;
        assert_int_equal(ladder_step(&l, SST_LADDER_TIME, t, false), SST_GRAB_REOPEN);
    }
    assert_int_equal(rest_s, 60);
}

static void leaves_out_what_makes_no_sense(void **state SST_UNUSED)
{
    struct ladder l = fresh(false, true);

    /* No stream is open and there is no USB: open, then rest. */
    assert_int_equal(ladder_step(&l, SST_LADDER_FAULT, 0, false), SST_GRAB_REOPEN);
    assert_int_equal(ladder_step(&l, SST_LADDER_FAILED, S, false), -1);
    assert_int_equal(l.due_ns, S + SST_LADDER_RETRY_NS);
    assert_int_equal(ladder_step(&l, SST_LADDER_TIME, l.due_ns, false), SST_GRAB_BACK_OFF);

    /* USB, and the port's power is not ours to switch. */
    l = fresh(true, false);
    l.rung = SST_GRAB_REAUTHORISE;
    assert_int_equal(ladder_step(&l, SST_LADDER_FAULT, S, true), SST_GRAB_BACK_OFF);
}

/* A frame ends the climb; a fault soon after goes on from there, one much later starts at the bottom. */
static void a_frame_ends_the_climb(void **state SST_UNUSED)
{
    struct ladder l = fresh(true, false);

    assert_int_equal(ladder_step(&l, SST_LADDER_FAULT, S, true), SST_GRAB_RESTREAM);
    (void)ladder_step(&l, SST_LADDER_DONE, S, true);
    assert_int_equal(ladder_step(&l, SST_LADDER_FRAME, 2 * S, true), -1);
    assert_int_equal(l.phase, SST_LADDER_QUIET);
    assert_int_equal(l.due_ns, 0);
    assert_int_equal(ladder_step(&l, SST_LADDER_FAULT, 3 * S, true), SST_GRAB_REOPEN);
    (void)ladder_step(&l, SST_LADDER_DONE, 3 * S, true);
    (void)ladder_step(&l, SST_LADDER_FRAME, 4 * S, true);
    (void)ladder_step(&l, SST_LADDER_FRAME, 14 * S - 1, true);
    assert_int_equal(l.rung, SST_GRAB_REOPEN);
    (void)ladder_step(&l, SST_LADDER_FRAME, 14 * S, true);
    assert_int_equal(l.rung, -1);
    assert_int_equal(ladder_step(&l, SST_LADDER_FAULT, 15 * S, true), SST_GRAB_RESTREAM);
}

static void refusal_rests_at_once(void **state SST_UNUSED)
{
    struct ladder l = fresh(true, true);

    assert_int_equal(ladder_step(&l, SST_LADDER_REFUSED, S, false), SST_GRAB_BACK_OFF);
    assert_int_equal(l.due_ns, 2 * S);
    assert_int_equal(ladder_step(&l, SST_LADDER_TIME, 2 * S, false), SST_GRAB_REOPEN);
    assert_int_equal(ladder_step(&l, SST_LADDER_REFUSED, 3 * S, false), SST_GRAB_BACK_OFF);
    assert_int_equal(l.due_ns, 5 * S);
}

/* Unplugged: all is forgotten, except where a reset makes it go and come. */
static void loss_is_expected_after_a_reset_only(void **state SST_UNUSED)
{
    struct ladder l = fresh(true, false);

    l.rung = SST_GRAB_REOPEN;
    assert_int_equal(ladder_step(&l, SST_LADDER_FAULT, S, true), SST_GRAB_RESET);
    assert_true(ladder_expects_loss(&l));
    (void)ladder_step(&l, SST_LADDER_LOST, S, false);
    assert_int_equal(l.rung, SST_GRAB_RESET);
    (void)ladder_step(&l, SST_LADDER_DONE, 2 * S, false);
    assert_true(ladder_expects_loss(&l));
    assert_int_equal(l.due_ns, 2 * S + PATIENCE + 3 * S);
    /* Back and opened: a frame is owed from then on. */
    (void)ladder_step(&l, SST_LADDER_OPENED, 3 * S, true);
    assert_int_equal(l.due_ns, 3 * S + PATIENCE);
    (void)ladder_step(&l, SST_LADDER_FRAME, 4 * S, true);
    assert_false(ladder_expects_loss(&l));
    (void)ladder_step(&l, SST_LADDER_LOST, 5 * S, false);
    assert_int_equal(l.rung, -1);
    assert_int_equal(l.phase, SST_LADDER_QUIET);
    assert_true(l.usb);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(climbs_every_rung_then_rests_longer),
        cmocka_unit_test(leaves_out_what_makes_no_sense),
        cmocka_unit_test(a_frame_ends_the_climb),
        cmocka_unit_test(refusal_rests_at_once),
        cmocka_unit_test(loss_is_expected_after_a_reset_only),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
