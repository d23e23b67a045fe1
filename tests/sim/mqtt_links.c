/* sst-mqtt and faults between it and brokers: links that die unnoticed, limits of size, MQTT 3.1.1 alone, a
 * client id that is used twice. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>

#include "tests/mqtt_session.h"

#define LINKS   32
#define LARGE   400000
#define LIMIT   300000
#define LEVEL_5 5

/* --- a link to the broker ----------------------------------------------------------------------------------------- */

static struct {
    int to;        /* port of the broker */
    bool refuse_5; /* hangs up on MQTT 5 */
    atomic_bool stop;
    int listen, fd[LINKS][2]; /* client, broker; client -1: dead, the broker sees it open */
    int links;
    atomic_int cut; /* links up to here are to die */
    pthread_t thread;
} net;

/* Level of the protocol in CONNECT, after a length of one or two bytes. */
static int level(const uint8_t *data, ssize_t n)
{
    const ssize_t at = n > 1 && data[1] & 0x80 ? 9 : 8;

    return n > at ? data[at] : 0;
}

static void accept_link(void)
{
    const struct sockaddr_in a = here(net.to);
    const int client = accept(net.listen, NULL, NULL), to = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    uint8_t head[16];

    assert_true(client >= 0 && to >= 0 && net.links < LINKS);
    if ((net.refuse_5 && level(head, recv(client, head, sizeof(head), MSG_PEEK)) == LEVEL_5) ||
        connect(to, (const struct sockaddr *)&a, sizeof(a))) {
        close(client);
        close(to);
        return;
    }
    net.fd[net.links][0] = client;
    net.fd[net.links++][1] = to;
}

static void carry(int link, int from)
{
    static char data[65536];
    const ssize_t n = recv(net.fd[link][from], data, sizeof(data), 0);

    if (n > 0 && send(net.fd[link][!from], data, (size_t)n, MSG_NOSIGNAL) == n)
        return;
    for (int i = 0; i < 2; i++) {
        close(net.fd[link][i]);
        net.fd[link][i] = -1;
    }
}

static void *run_net(void *arg)
{
    const struct linger reset = { .l_onoff = 1 };

    (void)arg;
    while (!net.stop) {
        struct pollfd fd[2 * LINKS + 1] = { { .fd = net.listen, .events = POLLIN } };

        for (int i = 0; i < net.links; i++) {
            if (i < net.cut && net.fd[i][0] >= 0) {
                setsockopt(net.fd[i][0], SOL_SOCKET, SO_LINGER, &reset, sizeof(reset));
                close(net.fd[i][0]);
                net.fd[i][0] = -1;
            }
            for (int k = 0; k < 2; k++)
                fd[1 + 2 * i + k] = (struct pollfd){ .fd = net.fd[i][0] < 0 ? -1 : net.fd[i][k], .events = POLLIN };
        }
        if (poll(fd, 1 + 2 * (nfds_t)net.links, 10) <= 0)
            continue;
        for (int i = 0, n = net.links; i < 2 * n; i++)
            if (fd[1 + i].revents && net.fd[i / 2][i % 2] >= 0)
                carry(i / 2, i % 2);
        if (fd[0].revents)
            accept_link();
    }
    return NULL;
}

/* From now on sst-mqtt reaches the broker through the link. */
static void open_net(bool refuse_5)
{
    struct sockaddr_in a;
    const int one = 1;

    memset(&net, 0, sizeof(net));
    net.to = port;
    net.refuse_5 = refuse_5;
    cfg.mqtt.port = free_port();
    a = here(cfg.mqtt.port);
    net.listen = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    setsockopt(net.listen, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one));
    assert_int_equal(bind(net.listen, (struct sockaddr *)&a, sizeof(a)), 0);
    assert_int_equal(listen(net.listen, 8), 0);
    assert_int_equal(pthread_create(&net.thread, NULL, run_net, NULL), 0);
}

static void close_net(void)
{
    net.stop = true;
    pthread_join(net.thread, NULL);
    close(net.listen);
    for (int i = 0; i < 2 * net.links; i++)
        if (net.fd[i / 2][i % 2] >= 0)
            close(net.fd[i / 2][i % 2]);
}

/* --- messages ----------------------------------------------------------------------------------------------------- */

static void expect_logged(const char *words)
{
    for (int i = 0; i < PATIENCE && !strstr(read_text("mqtt.log"), words); i++)
        usleep(10000);
    if (!strstr(read_text("mqtt.log"), words))
        fail_msg("not logged: %s", words);
}

static void expect_more(const char *words, int n)
{
    for (int i = 0; i < PATIENCE && heard(words, NULL) <= n; i++)
        usleep(10000);
    if (heard(words, NULL) <= n)
        fail_msg("heard %d times, not more: %s", n, words);
}

static void show(size_t bytes)
{
    static unsigned number;
    uint8_t *data = malloc(bytes);

    assert_non_null(data);
    memset(data, 'x', bytes);
    snprintf((char *)data, bytes, "JPEG%u", number++);
    assert_int_equal(sst_slot_put(slot, data, bytes, number, number, number), 0);
}

/* An event arrives, and of the picture nothing. */
static void expect_all_but_the_picture(const char *zone)
{
    char words[64];

    sst_events_emit(api.events, SST_EVENT_INFO, "motion", json_pack("{s:s, s:b}", "zone", zone, "active", 1), "moves");
    snprintf(words, sizeof(words), "sst/zone/%s/motion ON", zone);
    expect_heard(words, NULL);
    assert_int_equal(heard("sst/picture", NULL), 0);
}

/* --- tests -------------------------------------------------------------------------------------------------------- */

/* Of a connection that has died unnoticed the last will comes before the next "online": the id is the same. One that
 * comes after all is answered. */
static void a_late_will_does_not_stay(void **state)
{
    char line[2048];
    int n = 0;

    (void)state;
    start_broker("allow_anonymous true");
    subscribe();
    open_net(false);
    open_mqtt();
    expect_count("sst/available online", 1);
    net.cut = 1;
    /* Twice where its receipt was lost with the connection: it is sent again, as MQTT says, before the new one. */
    expect_more("sst/available online", 1);
    expect_heard("sst/available", line);
    assert_string_equal(line, "sst/available online");
    assert_int_equal(heard("sst/available offline", NULL), 1); /* at once, not when the broker misses the client */
    for (int i = 0; i < 2; i++) {
        n = heard("sst/available online", NULL);
        publish("sst/available", "offline", true);
        expect_more("sst/available online", n);
    }
    n = heard("sst/available online", NULL);
    close_mqtt();
    expect_count("sst/available offline", 4);
    usleep(300000);
    assert_int_equal(heard("sst/available online", NULL), n); /* its own is meant */
    close_net();
}

static void large_pictures_are_left_out(void **state)
{
    static const char *const limits[] = { "max_packet_size", "message_size_limit" };
    char more[64];

    (void)state;
    cfg.mqtt.picture_s = 0.2;
    for (int i = 0; i < 2; i++) {
        snprintf(more, sizeof(more), "allow_anonymous true\n%s %d", limits[i], LIMIT);
        unlink(test_path("broker.log"));
        unlink(test_path("mqtt.log"));
        unlink(test_path("heard"));
        start_broker(more);
        subscribe();
        show(LARGE);
        open_mqtt();
        expect_logged("is left out");
        expect_all_but_the_picture("gate");
        assert_int_equal(connects(), 1);
        assert_ptr_equal(strstr(strstr(read_text("mqtt.log"), "is left out") + 1, "is left out"), NULL);
        show(LIMIT / 4); /* smaller ones come */
        expect_heard("sst/picture JPEG", NULL);
        close_mqtt();
        end(&subscriber);
        end(&broker);
    }
}

/* MQTT 3.1.1 names no limit: a message that ends the connection twice is left out. */
static void brokers_of_mqtt_3_1_1(void **state)
{
    char more[64];
    int n;

    (void)state;
    cfg.mqtt.picture_s = 0.2;
    snprintf(more, sizeof(more), "allow_anonymous true\nmax_packet_size %d", LIMIT);
    start_broker(more);
    subscribe();
    show(LARGE);
    open_net(true);
    open_mqtt();
    expect_logged("is left out");
    expect_all_but_the_picture("gate");
    n = connects();
    assert_in_range(n, 2, 4);
    expect_all_but_the_picture("door");
    assert_int_equal(connects(), n);
    close_mqtt();
    close_net();
}

/* Two arrays of one topic at one machine do not end each other's connections for ever. */
static void two_of_one_id(void **state)
{
    pid_t first;
    int n = 0, quiet = 0;

    (void)state;
    start_broker("allow_anonymous true");
    subscribe();
    open_mqtt();
    expect_count("sst/available online", 1);
    first = program;
    open_mqtt();
    expect_logged("another array with this mqtt: topic");
    for (int i = 0; i < PATIENCE && quiet < 300; i++, quiet++) {
        if (connects() != n)
            quiet = 0;
        n = connects();
        usleep(10000);
    }
    assert_int_equal(quiet, 300);
    close_mqtt();
    end(&first);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        MQTT_TEST(a_late_will_does_not_stay),
        MQTT_TEST(large_pictures_are_left_out),
        MQTT_TEST(brokers_of_mqtt_3_1_1),
        MQTT_TEST(two_of_one_id),
    };

    if (mqtt_missing())
        return 77;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
