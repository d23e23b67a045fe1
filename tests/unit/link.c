/* capture/link: sets of two nodes arrive at a head, by datagrams and over TLS; each frame ends in one place. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/link_session.h"

static bool both_heard(const struct node *left, const struct node *right)
{
    return state(left).connected && state(right).connected && heard(0) && heard(1);
}

static bool both_sent(const struct node *left, const struct node *right)
{
    return all_sent(left) && all_sent(right);
}

static void open_nodes(struct node *left, struct node *right)
{
    open_node(left, "left", 0);
    open_node(right, "right", 1);
    UNTIL(both_heard(left, right));
}

/* The end of a test: all that was sent has arrived. @param report  out, of the head; may be NULL */
static void close_both(struct node *left, struct node *right, struct sst_capture_report *report)
{
    close_node(left);
    close_node(right);
    close_head(report);
    assert_int_equal(head.wrong, 0);
}

static void sets_of_two_nodes_become_one(void **state_ SST_UNUSED)
{
    struct node left, right;
    struct sst_capture_report report;

    open_head();
    open_nodes(&left, &right);
    right.count = 1000; /* it has counted for longer */
    both_capture(&left, &right, 30);
    UNTIL(both_sent(&left, &right) && head_frames() == state(&left).frames + state(&right).frames);
    assert_int_equal(peer(0).frames, 60);
    assert_int_equal(peer(1).frames, 60);
    assert_int_equal(peer(0).numbering.slips + peer(1).numbering.slips, 0);
    /* A camera that has no frame is not waited for. */
    capture_set(&left, now_tick, 1);
    capture_set(&right, now_tick++, -1);
    UNTIL(head_frames() == 123 && both_sent(&left, &right));
    for (int i = 0; i < 2; i++) {
        assert_int_equal(peer(i).unexplained, 0);
        assert_int_equal(peer(i).frames, peer(i).passed);
    }
    assert_int_equal(state(&left).bucket[SST_LINK_SENT], 61);
    assert_int_equal(state(&left).unexplained, 0);
    close_both(&left, &right, &report);
    assert_int_equal(head.complete, 30);
    assert_int_equal(report.unexplained, 0);
    assert_int_equal(report.sets.bucket[SST_BUCKET_SET], 123);
}

/* Unconfirmed sets at the end of a connection are accounted for when it is back: the sums of both sides agree.
 */
static void a_head_that_is_away_costs_a_gap_that_is_counted(void **state_ SST_UNUSED)
{
    struct node left, right;
    uint64_t received;

    queue = 4;
    open_head();
    open_nodes(&left, &right);
    queue = 64;
    for (int i = 0; i < 10; i++) {
        both_capture(&left, &right, 1);
        UNTIL(both_sent(&left, &right));
    }
    received = peer(0).frames;
    close_head(NULL);
    UNTIL(!state(&left).connected && !state(&right).connected);
    both_capture(&left, &right, 20); /* the queue holds 4 */
    assert_int_equal(state(&left).waiting, 4 * CAMERAS);
    assert_int_equal(state(&left).bucket[SST_LINK_AWAY] + state(&left).bucket[SST_LINK_DROPPED], 16 * CAMERAS);
    open_head();
    UNTIL(both_heard(&left, &right));
    both_capture(&left, &right, 10);
    UNTIL(both_sent(&left, &right));
    received += peer(0).frames;
    assert_int_equal(received, state(&left).bucket[SST_LINK_SENT]);
    assert_int_equal(state(&left).unexplained + state(&right).unexplained, 0);
    assert_int_equal(state(&left).frames, 40 * CAMERAS);
    assert_int_equal(state(&left).connections, 2);
    close_both(&left, &right, NULL);
}

static void a_node_that_missed_an_edge_is_put_right(void **state_ SST_UNUSED)
{
    struct node left, right;

    open_head();
    open_nodes(&left, &right);
    for (int i = 0; i < 30; i++, now_tick++) {
        capture_set(&left, now_tick, -1);
        if (i != 12 && i != 20)
            capture_set(&right, now_tick, -1);
        UNTIL(both_sent(&left, &right));
    }
    UNTIL(peer(1).numbering.slips == 2 && head_frames() == 116);
    assert_int_equal(peer(0).numbering.slips, 0);
    close_both(&left, &right, NULL);
    assert_int_equal(head.complete, 28);
}

/* Pictures in which nothing changes are named, not sent; the head takes their bytes from before. */
static void unchanged_pictures_are_not_sent(void **state_ SST_UNUSED)
{
    struct node left, right;
    uint64_t bytes;

    still = true;
    open_head();
    open_nodes(&left, &right);
    both_capture(&left, &right, 10);
    UNTIL(both_sent(&left, &right));
    bytes = state(&left).sent_bytes;
    both_capture(&left, &right, 20);
    UNTIL(both_sent(&left, &right) && head_frames() == 120);
    assert_true(state(&left).bucket[SST_LINK_UNCHANGED] >= 40);
    assert_int_equal(state(&left).bucket[SST_LINK_SENT] + state(&left).bucket[SST_LINK_UNCHANGED], 60);
    assert_int_equal(peer(0).unchanged, state(&left).bucket[SST_LINK_UNCHANGED]);
    assert_true(state(&left).sent_bytes - bytes < 20 * CAMERAS * 300); /* 512 bytes each else */
    close_both(&left, &right, NULL);
    still = false;
    assert_int_equal(head.complete, 30);
}

static void sets_go_by_datagrams(void **state_ SST_UNUSED)
{
    struct node left, right;
    struct sst_link_peer p;

    open_head();
    open_by_datagrams(&left, "left", 0);
    open_by_datagrams(&right, "right", 1);
    for (int i = 0; i < 40; i++) { /* one by one, as an array does */
        both_capture(&left, &right, 1);
        UNTIL(both_sent(&left, &right));
    }
    /* On a busy machine a part may come later than its set is waited for. */
    UNTIL(of_head(&head.sets) == 40 && head_frames() >= 150);
    p = peer(0);
    assert_int_equal(state(&left).bucket[SST_LINK_SENT], 80);
    if (WITH_ISAL) {
        assert_int_equal(state(&left).datagrams_reason[0], 0);
        assert_true(p.datagrams >= 40 && state(&left).sent_datagrams >= 40);
        assert_int_equal(p.refused + p.missed + p.missed_sets, 0);
    }
    close_both(&left, &right, NULL);
    assert_true(head.complete >= 35);
}

/* Either side may do without datagrams: pictures come over TLS, and the node says why. */
static void without_datagrams_sets_go_over_tls(void **state_ SST_UNUSED)
{
    struct node left, right;

    datagrams = false;
    open_head();
    open_node(&left, "left", 0);
    datagrams = true;
    open_node(&right, "right", 1);
    UNTIL(both_heard(&left, &right));
    both_capture(&left, &right, 20);
    UNTIL(both_sent(&left, &right) && head_frames() == 80);
    assert_false(state(&left).datagrams || state(&right).datagrams);
    assert_string_equal(state(&left).datagrams_reason, "hosts: datagrams is false");
    assert_contains(state(&right).datagrams_reason, WITH_ISAL ? "the head takes no datagrams" : "built without ISA-L");
    close_both(&left, &right, NULL);
}

/* The trigger rests: the connection stays. */
static void silence_of_the_trigger_ends_nothing(void **state_ SST_UNUSED)
{
    struct node left;

    open_head();
    open_node(&left, "left", 0);
    UNTIL(state(&left).connected);
    both_capture(&left, NULL, 3);
    usleep(3600000);
    assert_true(state(&left).connected);
    assert_int_equal(state(&left).connections, 1);
    assert_int_equal(peer(0).connections, 1);
    close_node(&left);
    close_head(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sets_of_two_nodes_become_one),
        cmocka_unit_test(a_head_that_is_away_costs_a_gap_that_is_counted),
        cmocka_unit_test(a_node_that_missed_an_edge_is_put_right),
        cmocka_unit_test(unchanged_pictures_are_not_sent),
        cmocka_unit_test(sets_go_by_datagrams),
        cmocka_unit_test(without_datagrams_sets_go_over_tls),
        cmocka_unit_test(silence_of_the_trigger_ends_nothing),
    };

    return link_session_run(tests);
}
