/* tests/rtsp_bench.h - sst-rtsp on a service with synthetic pictures, and clients: ffmpeg, and one that can misbehave.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_RTSP_BENCH_H
#define SST_TESTS_RTSP_BENCH_H

#ifndef _GNU_SOURCE
#define _GNU_SOURCE /* memmem */
#endif
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "config/sstd.h"
#include "daemon/publish/http.h"
#include "pipeline/image/codec.h"
#include "tests/free_port.h"
#include "tests/quick.h"
#include "tests/test.h"

#define WIDTH     320
#define HEIGHT    240
#define BAR       16 /* px; each picture shows its number by the place of a bar */
#define PLACES    (WIDTH / BAR)
#define PERIOD_MS 40

#define STRANGER 12345 /* a user that nobody is */

#define PATIENCE_MS 60000 /* with packets that come sooner or later */

static struct sst_slot *slot;
static struct sst_counters counters;
static struct sst_http *service;
static pid_t program; /* sst-rtsp; 0: does not run */
static int port;      /* its */
static char folder[64];
static gid_t
    looks; /* group that may only look at the service; with it sst-rtsp runs as a user of its own; 0: as this */
static pthread_t painter;
static atomic_bool painting;

/* --- the service -------------------------------------------------------------------------------------------------- */

static atomic_int reported_clients, reported_refusals;
static atomic_bool reported_problem;

static int find(void *arg, enum sst_api_picture kind, const char *name, struct sst_slot **out)
{
    (void)arg;
    if ((kind == SST_PICTURE_VIEW && strcmp(name, "main") && strcmp(name, "v1")) ||
        (kind == SST_PICTURE_CAMERA && strcmp(name, "r0c0")))
        return -ENOENT;
    *out = sst_slot_ref(slot);
    return 0;
}

static int give_status(void *arg, struct sst_api_answer *out)
{
    (void)arg;
    out->body = json_pack("{s:f}", "uptime_s", (double)sst_clock_now_ns() * 1e-9);
    return 0;
}

static int get_report(void *arg, const json_t *request, struct sst_api_answer *out)
{
    (void)arg;
    reported_clients = (int)json_integer_value(json_object_get(request, "clients"));
    reported_refusals += *json_string_value(json_object_get(request, "refused")) != 0;
    reported_problem = *json_string_value(json_object_get(request, "problem")) != 0;
    out->body = json_object();
    return 0;
}

static struct sst_api api = { .slot = find, .status = give_status, .publisher = get_report };

static const char *in_folder(const char *name)
{
    static char path[4][128];
    static int next;

    next = (next + 1) % 4;
    snprintf(path[next], sizeof(path[next]), "%s/%s", folder, name);
    return path[next];
}

static void open_service(void)
{
    const struct sst_http_config cfg = { .socket = in_folder("c.sock"),
                                         .socket_fd = -1,
                                         .clients = 64,
                                         .view_group = looks ? "video" : NULL,
                                         .streams = 0, /* the limit is not for sst-rtsp */
                                         .api = &api,
                                         .counters = &counters };

    assert_int_equal(sst_http_open(&service, &cfg), 0);
}

/* Red, with a blue bar at the number's place. */
static void show(int number, int width, int height)
{
    struct sst_image img;
    uint8_t *data;
    size_t bytes;

    assert_int_equal(sst_image_init(&img, width, height), 0);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const bool bar = x / BAR == number % PLACES;

            sst_image_row(&img, 0, y)[x] = bar ? 0 : 200;
            sst_image_row(&img, 1, y)[x] = 20;
            sst_image_row(&img, 2, y)[x] = bar ? 200 : 20;
        }
    assert_int_equal(sst_image_encode_jpeg(&img, 85, &data, &bytes), 0);
    sst_image_fini(&img);
    assert_int_equal(sst_slot_put(slot, data, bytes, (uint64_t)number, sst_clock_now_ns(), sst_clock_wall_ns()), 0);
}

static void sleep_ms(int ms)
{
    const struct timespec t = { .tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000L };

    nanosleep(&t, NULL);
}

static void *paint(void *arg)
{
    (void)arg;
    for (int n = 1; painting; n++) {
        show(n, WIDTH, HEIGHT);
        sleep_ms(PERIOD_MS);
    }
    return NULL;
}

static int start_painting(void)
{
    painting = true;
    return pthread_create(&painter, NULL, paint, NULL);
}

static int make_pictures(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/sst-rtsp-XXXXXX");
    if (!mkdtemp(folder) || sst_slot_create(&slot) || sst_events_create(&api.events, 16))
        return -1;
    sst_counters_init(&counters);
    reported_clients = reported_refusals = 0;
    reported_problem = false;
    open_service();
    return start_painting();
}

static void stop_painting(void)
{
    if (atomic_exchange(&painting, false))
        pthread_join(painter, NULL);
}

static const char *err_file(void)
{
    return in_folder("ffmpeg.err");
}

static void configure(enum sst_rtsp_codec codec, const char *more)
{
    FILE *f = fopen(in_folder("sstd.yaml"), "w");

    assert_non_null(f);
    fprintf(f, "control: {socket: %s, group: \"\"}\nrtsp: {enabled: true, port: %d, codec: %s%s}\n",
            in_folder("c.sock"), port, codec == SST_RTSP_H264 ? "h264" : "mjpeg", more);
    fclose(f);
}

static int try_connect(void)
{
    struct sockaddr_in at = { .sin_family = AF_INET, .sin_port = htons((uint16_t)port) };
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_true(fd >= 0);
    if (!connect(fd, (struct sockaddr *)&at, sizeof(at)))
        return fd;
    close(fd);
    return -1;
}

static void wait_for_server(void)
{
    int fd = -1;

    for (int t = 0; t < PATIENCE_MS && fd < 0; t += 20) {
        fd = try_connect();
        if (fd < 0)
            nanosleep(&(struct timespec){ .tv_nsec = 20000000 }, NULL);
    }
    assert_true(fd >= 0);
    close(fd);
}

static void start_program(void)
{
    const char *build = getenv("SST_BUILD");
    char path[256];

    snprintf(path, sizeof(path), "%s/sst-rtsp", build ? build : "build");
    program = fork();
    if (!program) {
        if (looks && (setgroups(1, &looks) || setgid(STRANGER) || setuid(STRANGER)))
            _exit(126);
        execl(path, path, "--config", in_folder("sstd.yaml"), (char *)NULL);
        _exit(127);
    }
    assert_true(program > 0);
}

static void serve_with(enum sst_rtsp_codec codec, const char *more)
{
    port = free_port();
    configure(codec, more);
    start_program();
    wait_for_server();
}

static void serve(enum sst_rtsp_codec codec)
{
    serve_with(codec, "");
}

static void close_server(void)
{
    const int64_t start_ns = sst_clock_now_ns();
    int status = -1;

    assert_int_equal(waitpid(program, &status, WNOHANG), 0); /* it still runs */
    kill(program, SIGTERM);
    assert_int_equal(waitpid(program, &status, 0), program);
    program = 0;
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    assert_quick(start_ns, 2500000000);
}

static int end_pictures(void **state)
{
    (void)state;
    if (program) {
        kill(program, SIGKILL);
        waitpid(program, NULL, 0);
        program = 0;
    }
    stop_painting();
    sst_slot_shut(slot);
    sst_http_close(service);
    sst_slot_unref(slot);
    sst_events_shut(api.events);
    sst_events_destroy(api.events);
    sst_counters_fini(&counters);
    sst_path_remove_tree(folder);
    return 0;
}

/* Until there are as many as wanted, on the busiest machine. What comes may go and come again while it begins. */
static void wait_for(int (*count)(void), int want)
{
    int now = count();

    for (int t = 0; t < PATIENCE_MS && now != want; t += 20) {
        sleep_ms(20);
        now = count();
    }
    assert_int_equal(now, want);
}

static int viewers(void)
{
    return sst_slot_clients(slot);
}

static int clients(void)
{
    return reported_clients;
}

/* --- other people's clients ----------------------------------------------------------------------------------------
 */

/* ffmpeg on rtsp://localhost:port/path with these arguments after it; its output is the decoded stream. */
static FILE *watch(const char *login, const char *path, const char *transport, const char *rest)
{
    char command[512];

    snprintf(command, sizeof(command),
             "exec timeout -s KILL 120 ffmpeg -nostdin -loglevel error -rtsp_transport %s -i "
             "rtsp://%s127.0.0.1:%d%s -an -fps_mode passthrough %s 2>%s",
             transport, login, port, path, rest, err_file());
    return popen(command, "r");
}

static int place_of_bar(const uint8_t *rgb)
{
    int place = -1;

    for (int i = 0; i < PLACES; i++) {
        const uint8_t *p = rgb + 3 * ((size_t)HEIGHT / 2 * WIDTH + (size_t)i * BAR + BAR / 2);

        if (p[2] > 150 && p[0] < 60 && place < 0)
            place = i;
        else if (abs(p[0] - 200) > 24 || abs(p[1] - 20) > 24 || abs(p[2] - 20) > 24)
            return -1; /* neither bar nor ground: damaged, or colours of the wrong range */
    }
    return place;
}

/* All pictures arrive whole, in their colours and in order. Where those who send, carry and read them have to wait for
 * a processor, some are shown again, many are left out, and what goes by UDP is lost: then they are read again. */
static void reads_20(const char *path, const char *transport)
{
    static uint8_t rgb[3 * WIDTH * HEIGHT];
    int good = 0, moved = 0;

    for (int again = 0; again < 5 && (good < 20 || moved < 10); again++) {
        FILE *f = watch("", path, transport, "-frames:v 20 -f rawvideo -pix_fmt rgb24 -");
        int last = -1, n = 0, place, rc;

        assert_non_null(f);
        good = moved = 0;
        for (; fread(rgb, sizeof(rgb), 1, f) == 1; n++) {
            place = place_of_bar(rgb);
            good += place >= 0;
            moved += place >= 0 && last >= 0 && (place - last + PLACES) % PLACES < PLACES / 2 && place != last;
            last = place;
        }
        rc = pclose(f);
        if (rc || n != 20 || good < 20 || moved < 10)
            print_message("%s by %s: ffmpeg ended with %#x after %d pictures, %d good, %d that moved on\n", path,
                          transport, rc, n, good, moved);
        assert_int_equal(rc, 0);
        assert_int_equal(n, 20);
        assert_true(good == 20 || !strcmp(transport, "udp")); /* nothing is lost by TCP */
    }
    assert_int_equal(good, 20);
    assert_true(moved >= 10);
}

/* --- a client of our own -------------------------------------------------------------------------------------------
 */

/* When there are too many, a socket that is shut. */
static int connect_server(void)
{
    const int fd = try_connect();

    return fd >= 0 ? fd : socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
}

static char answer[8192];

/* Pictures that came before the answer. @return bytes left */
static size_t skip_packets(size_t have)
{
    size_t packet;

    while (have >= 4 && answer[0] == '$' &&
           have >= (packet = 4 + ((size_t)(uint8_t)answer[2] << 8 | (uint8_t)answer[3]))) {
        have -= packet;
        memmove(answer, answer + packet, have);
    }
    answer[have] = 0;
    return have;
}

/* @return status; 0: the server hung up */
static int ask(int fd, const char *method, const char *path, const char *more)
{
    static int number;
    char text[1024];
    size_t have = 0;
    ssize_t n;
    int status = 0;

    snprintf(text, sizeof(text), "%s rtsp://127.0.0.1:%d%s RTSP/1.0\r\nCSeq: %d\r\n%s\r\n", method, port, path,
             ++number, more);
    answer[0] = 0;
    if (send(fd, text, strlen(text), MSG_NOSIGNAL) < 0)
        return 0;
    while ((answer[0] == '$' || !strstr(answer, "\r\n\r\n")) &&
           (n = recv(fd, answer + have, sizeof(answer) - 1 - have, 0)) > 0)
        have = skip_packets(have + (size_t)n);
    return sscanf(answer, "RTSP/1.0 %d", &status) == 1 ? status : 0;
}

static int ask_once(const char *method, const char *path, const char *more)
{
    const int fd = connect_server(), status = ask(fd, method, path, more);

    close(fd);
    return status;
}

static char *write_password(const char *text)
{
    static char path[96];
    FILE *f;

    snprintf(path, sizeof(path), "%s/password", folder);
    f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    fclose(f);
    assert_int_equal(chmod(path, 0600), 0);
    return path;
}

/* Watches by TCP and then never reads. */
static int stall(void)
{
    char more[128], session[64] = "";
    const int fd = connect_server(), small = 4096;
    const char *at;

    setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &small, sizeof(small));
    for (int t = 0; t < PATIENCE_MS && ask(fd, "DESCRIBE", "/main", "") == 503; t += 50)
        sleep_ms(50); /* the pipeline of the last one is just being stopped */
    assert_int_equal(ask(fd, "SETUP", "/main/stream=0", "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n"), 200);
    at = strstr(answer, "Session: ");
    assert_non_null(at);
    assert_int_equal(sscanf(at, "Session: %63[^;\r\n]", session), 1);
    snprintf(more, sizeof(more), "Session: %s\r\n", session);
    assert_int_equal(ask(fd, "PLAY", "/main", more), 200);
    return fd;
}

#endif
