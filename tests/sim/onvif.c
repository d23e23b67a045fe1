/* sst-onvif beside a service that answers: visits reach a subscriber, guesses and floods are limited, its end waits for
 * nobody. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sha1.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "daemon/publish/http.h"
#include "tests/folder.h"
#include "tests/free_port.h"
#include "tests/quick.h"

#ifndef WITH_ONVIF
#define WITH_ONVIF 0
#endif

#define MEDIA    "http://www.onvif.org/ver10/media/wsdl"
#define EVENTS   "http://www.onvif.org/ver10/events/wsdl"
#define PATIENCE 6000 /* looks, 10 ms apart */
#define PASSWORD "sesame seed"

static struct sst_http *http;
static struct sst_counters counters;
static struct sst_slot *slot;
static pid_t program;
static int port;
static _Atomic int subscribers, refusals;
static _Thread_local char answer[262144];

/* --- the service -------------------------------------------------------------------------------------------------- */

static int give_status(void *arg, struct sst_api_answer *out)
{
    (void)arg;
    out->body = json_pack("{s:f}", "uptime_s", (double)sst_clock_now_ns() * 1e-9);
    return 0;
}

static int give_zones(void *arg, struct sst_api_answer *out)
{
    (void)arg;
    out->body = json_pack("{s:[{s:s}]}", "zones", "name", "gate");
    return 0;
}

static int get_report(void *arg, const json_t *request, struct sst_api_answer *out)
{
    (void)arg;
    subscribers = (int)json_integer_value(json_object_get(request, "clients"));
    refusals += *json_string_value(json_object_get(request, "refused")) != 0;
    out->body = json_object();
    return 0;
}

static int find(void *arg, enum sst_api_picture kind, const char *name, struct sst_slot **out)
{
    (void)arg;
    (void)kind;
    (void)name;
    *out = sst_slot_ref(slot);
    return 0;
}

static struct sst_api api = { .slot = find, .status = give_status, .zones = give_zones, .publisher = get_report };

/* --- requests ----------------------------------------------------------------------------------------------------- */

static int connect_program(void)
{
    const struct sockaddr_in a = { .sin_family = AF_INET,
                                   .sin_port = htons((uint16_t)port),
                                   .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    const struct timeval patience = { .tv_sec = 60 };
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    if (!connect(fd, (const struct sockaddr *)&a, sizeof(a)))
        return fd;
    close(fd);
    return -1;
}

static void base64(char *out, const uint8_t *data, size_t n)
{
    static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

    for (size_t i = 0; i < n; i += 3) {
        const uint32_t v = (uint32_t)data[i] << 16 | (uint32_t)(i + 1 < n ? data[i + 1] : 0) << 8 |
                           (i + 2 < n ? data[i + 2] : 0);

        for (int k = 0; k < 4; k++)
            *out++ = i + (size_t)k > n ? '=' : letters[v >> (18 - 6 * k) & 63];
    }
    *out = 0;
}

/* @param password  NULL: none @return status; 0: hung up */
static int ask(const char *agent, const char *path, const char *password, const char *call)
{
    static _Atomic int number;
    const int fd = connect_program();
    char text[4096], token[1024] = "", body[2048], nonce[16], nonce64[32], digest64[64], created[SST_CLOCK_TEXT];
    uint8_t hash[SHA1_DIGEST_LENGTH];
    size_t have = 0;
    ssize_t n;
    int status = 0;

    if (fd < 0)
        return 0;
    if (password) {
        snprintf(nonce, sizeof(nonce), "nonce %d", ++number);
        base64(nonce64, (const uint8_t *)nonce, strlen(nonce));
        sst_clock_text(created, sst_clock_wall_ns());
        snprintf(text, sizeof(text), "%s%s%s", nonce, created, password);
        {
            SHA1_CTX context;

            SHA1Init(&context);
            SHA1Update(&context, (const uint8_t *)text, strlen(text));
            SHA1Final(hash, &context);
        }
        base64(digest64, hash, sizeof(hash));
        snprintf(token, sizeof(token),
                 "<Security><UsernameToken><Username>nvr</Username><Password>%s</Password><Nonce>%s</Nonce><Created>%s"
                 "</Created></UsernameToken></Security>",
                 digest64, nonce64, created);
    }
    snprintf(body, sizeof(body),
             "<e:Envelope xmlns:e=\"http://www.w3.org/2003/05/soap-envelope\"><e:Header>%s</e:Header><e:Body>%s</e:Body>"
             "</e:Envelope>",
             token, call);
    snprintf(text, sizeof(text),
             "POST %s HTTP/1.1\r\nHost: a\r\nUser-Agent: %s\r\nConnection: close\r\nContent-Length: %zu\r\n\r\n%s", path,
             agent, strlen(body), body);
    if (send(fd, text, strlen(text), MSG_NOSIGNAL) == (ssize_t)strlen(text))
        while (have < sizeof(answer) - 1 && (n = recv(fd, answer + have, sizeof(answer) - 1 - have, 0)) > 0)
            have += (size_t)n;
    answer[have] = 0;
    close(fd);
    return sscanf(answer, "HTTP/1.1 %d", &status) == 1 ? status : 0;
}

static int profiles(const char *agent, const char *password)
{
    return ask(agent, "/onvif/media_service", password, "<GetProfiles xmlns=\"" MEDIA "\"/>");
}

static void subscribe(char path[64])
{
    assert_int_equal(ask("nvr", "/onvif/event_service", PASSWORD, "<CreatePullPointSubscription xmlns=\"" EVENTS "\"/>"),
                     200);
    snprintf(path, 64, "/onvif/events/%.16s", strstr(answer, "/onvif/events/") + strlen("/onvif/events/"));
}

static int pull(const char *path, const char *timeout)
{
    char call[256];

    snprintf(call, sizeof(call),
             "<PullMessages xmlns=\"" EVENTS "\"><Timeout>%s</Timeout><MessageLimit>50</MessageLimit></PullMessages>",
             timeout);
    return ask("nvr", path, PASSWORD, call);
}

/* --- set-up ------------------------------------------------------------------------------------------------------- */

static const char *read_log(void)
{
    static char text[65536];
    FILE *f = fopen(test_path("log"), "r");

    text[f ? fread(text, 1, sizeof(text) - 1, f) : 0] = 0;
    if (f)
        fclose(f);
    return text;
}

static int start(void **state)
{
    const struct sst_http_config c = { .socket_fd = -1, .clients = 16, .streams = 4, .api = &api, .counters = &counters };
    struct sst_http_config cfg = c;
    const char *build = getenv("SST_BUILD");
    char path[SST_PATH_MAX], config[SST_PATH_MAX];
    FILE *f;

    (void)state;
    assert_int_equal(test_folder_create(NULL), 0);
    port = free_port();
    subscribers = refusals = 0;
    assert_int_equal(sst_events_create(&api.events, 64), 0);
    assert_int_equal(sst_slot_create(&slot), 0);
    sst_counters_init(&counters);
    cfg.socket = test_path("c.sock");
    assert_int_equal(sst_http_open(&http, &cfg), 0);
    f = fopen(test_path("password"), "w");
    fputs(PASSWORD "\n", f);
    fclose(f);
    f = fopen(test_path("sstd.yaml"), "w");
    fprintf(f,
            "control: {socket: %s/c.sock, group: \"\"}\n"
            "rtsp: {enabled: true, user: nvr, password_file: %s/password}\nonvif: {enabled: true, port: %d, discovery: false}\n",
            test_folder, test_folder, port);
    fclose(f);
    snprintf(path, sizeof(path), "%s/sst-onvif", build ? build : "build");
    snprintf(config, sizeof(config), "%s/sstd.yaml", test_folder);
    program = fork();
    if (!program) {
        const int log = open(test_path("log"), O_WRONLY | O_CREAT | O_APPEND, 0600);

        dup2(log, 2);
        execl(path, path, "--config", config, (char *)NULL);
        _exit(127);
    }
    for (int i = 0; i < PATIENCE; i++) {
        if (profiles("nvr", PASSWORD) == 200)
            return 0;
        usleep(10000);
    }
    fail_msg("sst-onvif does not answer: %s", read_log());
    return -1;
}

static void end_program(int64_t limit_ns)
{
    const int64_t start_ns = sst_clock_now_ns();
    int ended = -1;

    kill(program, SIGTERM);
    assert_int_equal(waitpid(program, &ended, 0), program);
    assert_quick(start_ns, limit_ns);
    assert_int_equal(ended, 0);
    program = 0;
}

static int stop(void **state)
{
    (void)state;
    if (program > 0) {
        kill(program, SIGKILL);
        waitpid(program, NULL, 0);
    }
    program = 0;
    sst_slot_shut(slot);
    sst_events_shut(api.events);
    sst_http_close(http);
    sst_slot_unref(slot);
    sst_counters_fini(&counters);
    sst_events_destroy(api.events);
    return test_folder_remove(NULL);
}

/* --- tests -------------------------------------------------------------------------------------------------------- */

static void *visit(void *arg)
{
    usleep(200000);
    sst_events_emit(arg, SST_EVENT_INFO, "visit",
                    json_pack("{s:s, s:b, s:s, s:[s]}", "visit", "v1", "active", 1, "label", "Pedestrian", "zones", "gate"),
                    "a visit");
    return NULL;
}

static void visits_reach_a_subscriber(void **state)
{
    pthread_t thread;
    char path[64];
    bool people = false, inside = false;

    (void)state;
    subscribe(path);
    for (int i = 0; i < PATIENCE && subscribers != 1; i++)
        usleep(10000);
    assert_int_equal(subscribers, 1);
    /* The zone is known once the program has asked the service. */
    for (int i = 0; i < PATIENCE && !strstr(answer, "Value=\"gate\""); i++) {
        assert_int_equal(ask("nvr", path, PASSWORD, "<SetSynchronizationPoint xmlns=\"" EVENTS "\"/>"), 200);
        assert_int_equal(pull(path, "PT0S"), 200);
        usleep(10000);
    }
    assert_int_equal(pull(path, "PT0S"), 200);
    assert_int_equal(pthread_create(&thread, NULL, visit, api.events), 0);
    for (int i = 0; i < 5 && !(people && inside); i++) {
        assert_int_equal(pull(path, "PT1M"), 200);
        people |= strstr(answer, "PeopleDetect") && strstr(answer, "Name=\"State\" Value=\"true\"");
        inside |= strstr(answer, "Name=\"IsInside\" Value=\"true\"") != NULL;
    }
    pthread_join(thread, NULL);
    assert_true(people && inside);
    end_program(3000000000);
}

static void *wait_for_events(void *path)
{
    (void)pull(path, "PT1M");
    return NULL;
}

static void its_end_waits_for_nobody(void **state)
{
    pthread_t thread;
    char path[64];

    (void)state;
    subscribe(path);
    assert_int_equal(pull(path, "PT0S"), 200);
    assert_int_equal(pthread_create(&thread, NULL, wait_for_events, path), 0);
    usleep(300000);
    end_program(3000000000);
    pthread_join(thread, NULL);
}

static void *guess(void *arg)
{
    *(int *)arg = profiles("thief", "sesame");
    return NULL;
}

static void guesses_are_limited(void **state)
{
    pthread_t thread[3];
    int status[3], hung_up = 0;

    (void)state;
    for (int i = 0; i < 11; i++)
        assert_int_equal(profiles("thief", "sesame"), 401);
    assert_non_null(strstr(read_log(), "sent 11 wrong passwords within a minute"));
    /* One is looked at each 4 s, one more may wait, others are hung up on. */
    for (int i = 0; i < 3; i++)
        assert_int_equal(pthread_create(&thread[i], NULL, guess, &status[i]), 0);
    for (int i = 0; i < 3; i++) {
        pthread_join(thread[i], NULL);
        hung_up += status[i] == 0;
    }
    assert_true(hung_up > 0);
    assert_int_equal(profiles("nvr", PASSWORD), 200); /* a program that had it before is not delayed */
    assert_int_equal(ask("x", "/onvif/device_service", NULL,
                         "<GetSystemDateAndTime xmlns=\"http://www.onvif.org/ver10/device/wsdl\"/>"),
                     200);
    for (int i = 0; i < PATIENCE && !refusals; i++)
        usleep(10000);
    assert_true(refusals > 0);
}

static void floods_are_refused(void **state)
{
    static const char head[] = "POST /onvif/x HTTP/1.1\r\nHost: a\r\nContent-Length: 200000\r\n\r\n";
    static char kilobyte[1024];
    int fd[40], open_now = 0;
    ssize_t n;

    (void)state;
    fd[0] = connect_program();
    assert_true(fd[0] >= 0 && send(fd[0], head, strlen(head), MSG_NOSIGNAL) > 0);
    for (int i = 0; i < 200 && send(fd[0], kilobyte, sizeof(kilobyte), MSG_NOSIGNAL) > 0; i++)
        ;
    (void)!send(fd[0], kilobyte, 200000 - 200 * 1024 > 0 ? 200000 - 200 * 1024 : 0, MSG_NOSIGNAL);
    n = recv(fd[0], answer, sizeof(answer) - 1, 0);
    answer[n > 0 ? n : 0] = 0;
    assert_true(n <= 0 || strstr(answer, "400 Bad Request"));
    close(fd[0]);
    for (int i = 0; i < 40; i++)
        fd[i] = connect_program();
    for (int i = 0; i < 40; i++) { /* of one address some are closed at once */
        const struct timeval moment = { .tv_usec = 50000 };

        setsockopt(fd[i], SOL_SOCKET, SO_RCVTIMEO, &moment, sizeof(moment));
        n = recv(fd[i], answer, 1, 0);
        open_now += n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
        close(fd[i]);
    }
    assert_in_range(open_now, 1, 24);
    for (int i = 0; i < PATIENCE && profiles("nvr", PASSWORD) != 200; i++)
        usleep(10000);
    assert_int_equal(profiles("nvr", PASSWORD), 200);
    assert_int_equal(ask("nvr", "/else", PASSWORD, "<a/>"), 404);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(visits_reach_a_subscriber, start, stop),
        cmocka_unit_test_setup_teardown(its_end_waits_for_nobody, start, stop),
        cmocka_unit_test_setup_teardown(guesses_are_limited, start, stop),
        cmocka_unit_test_setup_teardown(floods_are_refused, start, stop),
    };

    if (!WITH_ONVIF) {
        puts("built without ONVIF");
        return 77;
    }
    signal(SIGPIPE, SIG_IGN);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
