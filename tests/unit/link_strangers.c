/* Strangers at a head's port, and refusals; nodes of the array are served meanwhile. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdatomic.h>

#include "tests/link_session.h"
#include "tests/small.h"

static const char *refusal(const struct node *n)
{
    static char text[256];
    const struct sst_link_node_state s = state(n);

    memcpy(text, s.reason, sizeof(text));
    return text;
}

static struct link_credentials *credentials_of(const char *name)
{
    struct sst_array_config a;
    struct link_credentials *c;

    configure(&a, name);
    assert_int_equal(link_credentials_create(&c, &a), 0);
    return c;
}

#if WITH_ISAL

/* @return it has shaken hands; false: it was refused, or a second went by */
static bool shake_hands(struct link_dtls **d, struct link_credentials *c)
{
    const int64_t end_ns = sst_clock_now_ns() + INT64_C(1000000000);
    char why[256] = "";
    int err;

    assert_int_equal(link_dtls_open(d, "127.0.0.1", port, c), 0);
    while (!(err = link_dtls_work(*d, why)) && !link_dtls_ready(*d) && sst_clock_now_ns() < end_ns)
        usleep(2000);
    return !err && link_dtls_ready(*d);
}

/* Datagrams of anybody at the head's port, of hosts that are not of the array, and of a node in the name of another
 * one: sets of the others go on. */
static void datagrams_of_others_do_no_harm(void **state_ SST_UNUSED)
{
    struct link_credentials *third = credentials_of("third"), *stranger = credentials_of("stranger"),
                            *right = credentials_of("right");
    uint8_t bytes[SST_PIECE_HEAD + SST_PIECE_BYTES];
    struct link_dtls *d = NULL;
    bool shaken = false;
    struct sockaddr_storage to;
    struct node left, other;
    unsigned size;
    int fd;

    open_head();
    open_by_datagrams(&left, "left", 0);
    /* Noise, and things that begin like a ClientHello. */
    assert_int_equal(link_address("127.0.0.1", port, &to, &size), 0);
    fd = socket(AF_INET, SOCK_DGRAM, 0);
    assert_true(fd >= 0);
    srand(1);
    for (int i = 0; i < 2000; i++) {
        for (size_t k = 0; k < sizeof(bytes); k++)
            bytes[k] = (uint8_t)rand();
        if (i % 2) {
            const uint8_t hello[14] = { 22, 254, 253, 0, 0, 0, 0, 0, 0, 0, 0, (uint8_t)(i % 3), 100, 1 };

            memcpy(bytes, hello, sizeof(hello));
        }
        (void)sendto(fd, bytes, (size_t)(rand() % (int)sizeof(bytes)), 0, (const struct sockaddr *)&to, size);
    }
    close(fd);
    both_capture(&left, NULL, 3);
    UNTIL(all_sent(&left) && head_frames() == 6);
    /* A certificate of another authority, and one that is not of the list: the head takes no datagram of either. */
    memset(bytes, 0, sizeof(bytes));
    sst_piece_put(bytes, &(struct sst_piece){ .session = 1, .seq = 4, .bytes = 100, .index = 0, .parity = 2 });
    for (int i = 0; i < 2; i++) {
        if (shake_hands(&d, i ? third : stranger) && link_dtls_send(d, bytes, SST_PIECE_HEAD + 100)) {
            /* refused: as it should be */
        }
        link_dtls_close(d);
    }
    /* A node of the list, with numbers that are not of its connection. */
    open_by_datagrams(&other, "right", 1);
    for (int i = 0; i < 30 && !shaken; i++) { /* a machine with much else to do takes longer than a second */
        shaken = shake_hands(&d, right);
        if (!shaken)
            link_dtls_close(d);
    }
    assert_true(shaken);
    for (int i = 0; i < 50; i++)
        assert_int_equal(link_dtls_send(d, bytes, sizeof(bytes)), 0);
    UNTIL(peer(1).refused == 50);
    assert_int_equal(peer(0).refused, 0);
    link_dtls_close(d);
    both_capture(&left, &other, 10);
    /* On a busy machine a part may come later than its set is waited for. */
    UNTIL(all_sent(&left) && all_sent(&other) && of_head(&head.sets) == 13 && head_frames() >= 42);
    assert_int_equal(state(&left).connections, 1);
    close_node(&left);
    close_node(&other);
    close_head(NULL);
    assert_int_equal(head.wrong, 0);
    link_credentials_destroy(third);
    link_credentials_destroy(stranger);
    link_credentials_destroy(right);
}

#endif

static void who_is_not_of_the_array_is_refused(void **state_ SST_UNUSED)
{
    struct node left, other;

    open_head();
    open_node(&left, "left", 0);
    UNTIL(state(&left).connected);
    open_node_as(&other, "right", "stranger", 1); /* signed by another authority */
    UNTIL(refusal(&other)[0]);
    assert_false(state(&other).connected);
    close_node(&other);
    open_node_as(&other, "third", "third", 1); /* signed, and not in the head's list */
    UNTIL(strstr(refusal(&other), "not among the head's hosts: nodes"));
    close_node(&other);
    open_node(&other, "right", 0); /* cameras where there are some */
    UNTIL(strstr(refusal(&other), "has a camera of left already"));
    close_node(&other);
    open_node(&other, "right", 2);
    UNTIL(strstr(refusal(&other), "outside the grid of 2x2"));
    close_node(&other);
    assert_true(state(&left).connected);
    close_node(&left);
    close_head(NULL);
}

/* --- strangers ---------------------------------------------------------------------------------------------------- */

enum manner { SILENT = 0, HALF_A_RECORD = 1, GREETING = 2, MANY_ADDRESSES = 3, MANNERS = 4 };

#define CROWD 200 /* connections of strangers at a time, more than the head has room for */

static struct {
    enum manner manner;
    struct link_stream stream[CROWD];
    struct link_credentials *credentials;
    _Atomic int opened;
    _Atomic bool stop;
} crowd;

/* @param host  last byte of 127.0.0.x, where it comes from @return the descriptor of a connection to the head */
static int connect_from(int host)
{
    struct sockaddr_in from = { .sin_family = AF_INET, .sin_addr.s_addr = htonl(0x7f000000u + (unsigned)host) };
    struct sockaddr_storage to;
    unsigned size;
    const int fd = socket(AF_INET, SOCK_STREAM, 0);

    assert_true(fd >= 0);
    assert_int_equal(bind(fd, (const struct sockaddr *)&from, sizeof(from)), 0);
    assert_int_equal(link_address("127.0.0.1", port, &to, &size), 0);
    assert_int_equal(connect(fd, (const struct sockaddr *)&to, size), 0);
    link_socket_prepare(fd);
    return fd;
}

static void *crowd_in(void *arg SST_UNUSED)
{
    static const uint8_t half[] = { 22, 3, 1, 2, 0, 1 };
    char why[256];

    for (int i = 0; !crowd.stop; i++) {
        struct link_stream *s = &crowd.stream[i % CROWD];

        if (i >= CROWD)
            link_stream_close(s);
        assert_int_equal(link_stream_open(s, connect_from(crowd.manner == MANY_ADDRESSES ? 2 + i % 250 : 1),
                                          crowd.credentials, false, 1 << 16),
                         0);
        if (crowd.manner == HALF_A_RECORD && send(s->fd, half, sizeof(half), MSG_NOSIGNAL) < 0)
            continue; /* the head has closed it */
        if (crowd.manner >= GREETING && link_stream_work(s, why))
            continue;
        crowd.opened++;
        if (i >= CROWD)
            usleep(20000);
    }
    for (int i = 0; i < CROWD; i++)
        link_stream_close(&crowd.stream[i]);
    return NULL;
}

/* A right certificate is shown, and a HELLO sent: is it answered? @return 1, 0 (not yet), -1: the connection has ended
 */
static int is_answered(struct link_stream *s)
{
    enum message_type type;
    const uint8_t *data;
    size_t bytes;
    char why[256];

    if (!s->sent_bytes && s->ready && !link_stream_waiting(s))
        assert_int_equal(link_stream_add_json(s, MESSAGE_HELLO, json_object()), 0);
    if (link_stream_work(s, why))
        return -1;
    return s->ready && link_stream_next(s, &type, &data, &bytes) == 1 && type == MESSAGE_WELCOME;
}

/* As many nodes as there can be connect at once, from one address. @return how many were served */
static int nodes_served(struct link_credentials *credentials)
{
    struct link_stream s[LINK_NODES - 1];
    int result[LINK_NODES - 1] = { 0 }, left = LINK_NODES - 1, served = 0;
    const int64_t end_ns = sst_clock_now_ns() + INT64_C(60000000000);

    for (int i = 0; i < LINK_NODES - 1; i++)
        assert_int_equal(link_stream_open(&s[i], connect_from(1), credentials, false, 1 << 16), 0);
    while (left && sst_clock_now_ns() < end_ns) {
        for (int i = 0; i < LINK_NODES - 1; i++) {
            if (result[i])
                continue;
            result[i] = is_answered(&s[i]);
            left -= result[i] != 0;
        }
        usleep(500);
    }
    for (int i = 0; i < LINK_NODES - 1; i++) {
        served += result[i] == 1;
        link_stream_close(&s[i]);
    }
    return served;
}

/* --- log ---------------------------------------------------------------------------------------------------------- */

static FILE *said;
static int shown;

static void hear(void)
{
    said = tmpfile();
    shown = dup(STDERR_FILENO);
    assert_true(said && shown >= 0 && dup2(fileno(said), STDERR_FILENO) >= 0);
    sst_log_set_level(SST_LOG_WARNING);
}

/* @return lines since hear() */
static int heard_lines(void)
{
    int lines = 0;

    sst_log_set_level(SST_LOG_ERROR);
    assert_true(dup2(shown, STDERR_FILENO) >= 0);
    close(shown);
    rewind(said);
    for (int c; (c = fgetc(said)) != EOF;)
        lines += c == '\n';
    fclose(said);
    return lines;
}

/* Whatever strangers do at the head's port, nodes are served, and the log stays readable. */
static void strangers_keep_nobody_out(void **state_ SST_UNUSED)
{
    struct link_credentials *right = credentials_of("left");
    struct node left;
    int served[MANNERS] = { 0 }, lines;

    crowd.credentials = credentials_of("stranger");
    hear();
    open_head();
    for (int manner = SILENT; manner < MANNERS; manner++) {
        pthread_t thread;

        crowd.manner = (enum manner)manner;
        crowd.opened = 0;
        crowd.stop = false;
        assert_int_equal(pthread_create(&thread, NULL, crowd_in, NULL), 0);
        UNTIL(crowd.opened >= CROWD);
        for (int i = 0; i < 3; i++) /* where the machine stands still in between, a handshake is dropped */
            served[manner] += nodes_served(right);
        open_node(&left, "left", 0);
        UNTIL(state(&left).connected);
        close_node(&left);
        crowd.stop = true;
        pthread_join(thread, NULL);
    }
    close_head(NULL);
    lines = heard_lines();
    for (int manner = SILENT; manner < MANNERS; manner++)
        if (served[manner] < 2 * (LINK_NODES - 1))
            fail_msg("manner %d: %d of %d were served", manner, served[manner], 3 * (LINK_NODES - 1));
    if (lines > 120) /* one for each of 17 addresses, and the number left out; so in each minute */
        fail_msg("%d lines", lines);
    link_credentials_destroy(crowd.credentials);
    link_credentials_destroy(right);
}

#if WITH_ISAL

/* Handshakes for datagrams from strangers that pass the cookie: finished ones, and ones that stop in the middle. */
static void handshakes_of_strangers_keep_nobody_out(void **state_ SST_UNUSED)
{
    struct link_credentials *stranger = credentials_of("stranger");
    struct link_dtls *half[CROWD], *d;
    struct node left;
    int finished = 0, lines;
    char why[256];

    hear();
    open_head();
    for (int i = 0; i < 20; i++) {
        finished += shake_hands(&d, stranger);
        link_dtls_close(d);
    }
    for (int i = 0; i < CROWD; i++) {
        assert_int_equal(link_dtls_open(&half[i], "127.0.0.1", port, stranger), 0);
        for (int k = 0; k < 3 && !link_dtls_work(half[i], why); k++) /* a hello, and one with the cookie */
            usleep(1000);
    }
    open_by_datagrams(&left, "left", 0);
    both_capture(&left, NULL, 3);
    UNTIL(all_sent(&left) && of_head(&head.sets) == 3);
    for (int i = 0; i < CROWD; i++)
        link_dtls_close(half[i]);
    close_node(&left);
    close_head(NULL);
    lines = heard_lines();
    if (lines > 12)
        fail_msg("%d lines, %d handshakes", lines, finished);
    link_credentials_destroy(stranger);
}

#endif

static void a_node_refuses_who_is_not_the_head(void **state_ SST_UNUSED)
{
    struct node left;

    open_head();
    open_node(&left, "left", 0);
    UNTIL(state(&left).connected);
    close_node(&left);
    memset(&left, 0, sizeof(left));
    configure(&left.array, "left");
    strcpy(left.array.hosts.head_name, "another");
    left.array.bound = 1;
    assert_int_equal(sst_ring_create(&left.ring, 1 << 16), 0);
    assert_int_equal(
        sst_link_node_open(&left.link, &(struct sst_link_node_config){ .array = &left.array, .ring = left.ring }), 0);
    sst_link_node_cameras(left.link, &left.array);
    UNTIL(strstr(refusal(&left), "its certificate is of \"head\", not of \"another\""));
    close_node(&left);
    close_head(NULL);
}

static void certificates_that_are_not_there_are_named(void **state_ SST_UNUSED)
{
    struct sst_link_node *n;
    struct sst_array_config a;
    char why[SST_LOG_MAX] = "";

    configure(&a, "nobody");
    sst_log_hold_errors(why);
    assert_int_equal(sst_link_node_open(&n, &(struct sst_link_node_config){ .array = &a }), -EINVAL);
    sst_log_hold_errors(NULL);
    assert_contains(why, "nobody.pem");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
#if WITH_ISAL
        cmocka_unit_test(datagrams_of_others_do_no_harm),
#endif
        cmocka_unit_test(who_is_not_of_the_array_is_refused),
        serial_test(strangers_keep_nobody_out),
#if WITH_ISAL
        cmocka_unit_test(handshakes_of_strangers_keep_nobody_out),
#endif
        cmocka_unit_test(a_node_refuses_who_is_not_the_head),
        cmocka_unit_test(certificates_that_are_not_there_are_named),
    };

    return link_session_run(tests);
}
