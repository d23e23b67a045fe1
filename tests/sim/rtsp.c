/* sst-rtsp on synthetic pictures: read by ffmpeg and by clients that misbehave; reloads, a port in use, the service's
 * end. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/rtsp_bench.h"

#if WITH_RTSP

/* --- readers and streams -----------------------------------------------------------------------------------------
 */

static void h264_is_read(void **state)
{
    (void)state;
    serve(SST_RTSP_H264);
    reads_20("/main", "tcp");
    reads_20("/view/v1", "udp");
    wait_for(viewers, 0);
    close_server();
}

static void mjpeg_is_read(void **state)
{
    (void)state;
    serve(SST_RTSP_MJPEG);
    reads_20("/camera/r0c0", "tcp");
    reads_20("/main", "udp");
    wait_for(viewers, 0);
    close_server();
}

static void all_share_one_encoder(void **state)
{
    FILE *f[4];

    (void)state;
    stop_painting(); /* a picture a second: none has his before all are there */
    show(1, WIDTH, HEIGHT);
    serve(SST_RTSP_H264);
    for (int i = 0; i < 4; i++)
        f[i] = watch("", i % 2 ? "/main?who=1" : "/main", i < 2 ? "tcp" : "udp", "-frames:v 100 -f null -");
    wait_for(clients, 4);
    assert_int_equal(viewers(), 1);
    assert_int_equal(start_painting(), 0);
    for (int i = 0; i < 4; i++)
        assert_int_equal(pclose(f[i]), 0);
    wait_for(clients, 0);
    wait_for(viewers, 0);
}

static void killed_clients_go(void **state)
{
    static const char *const transports[] = { "tcp", "udp" };

    (void)state;
    serve(SST_RTSP_MJPEG);
    for (int i = 0; i < 2; i++) {
        FILE *f = watch("", "/main", transports[i], "-f null - & echo $!; exec >&-; wait");
        int pid;

        /* The shell tells the pid of `timeout`, which alone goes; its child is in its group. */
        assert_int_equal(fscanf(f, "%d", &pid), 1);
        wait_for(clients, 1);
        sleep_ms(500);
        kill(-pid, SIGKILL);
        kill(pid, SIGKILL);
        pclose(f);
        wait_for(clients, 0);
        wait_for(viewers, 0);
    }
}

static void still_pictures_are_repeated(void **state)
{
    FILE *f;
    int64_t start_ns;

    (void)state;
    stop_painting();
    show(1, WIDTH, HEIGHT);
    serve(SST_RTSP_H264);
    start_ns = sst_clock_now_ns();
    f = watch("", "/main", "tcp", "-frames:v 4 -f null -");
    assert_int_equal(pclose(f), 0);
    print_message("4 still pictures after %lld ms\n", (long long)(sst_clock_now_ns() - start_ns) / 1000000);
}

static void sizes_that_are_odd(void **state)
{
    FILE *f;
    int bytes = 0;

    (void)state;
    stop_painting();
    show(1, 333, 241);
    serve(SST_RTSP_H264);
    f = watch("", "/main", "tcp", "-frames:v 2 -f rawvideo -pix_fmt rgb24 - | wc -c");
    assert_int_equal(fscanf(f, "%d", &bytes), 1);
    pclose(f);
    assert_int_equal(bytes, 2 * 3 * 332 * 240);
}

static void what_is_not_there(void **state)
{
    static const char *const paths[] = { "/",         "/other",      "/view/",    "/view/v2",  "/camera/r9c9",
                                         "/main/../", "/view/%2e./", "/camera/*", "/view/v1/x" };

    (void)state;
    serve(SST_RTSP_MJPEG);
    for (size_t i = 0; i < ARRAY_LEN(paths); i++)
        if (ask_once("DESCRIBE", paths[i], "") != 404)
            fail_msg("%s: %.60s", paths[i], answer);
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 200);
    assert_int_equal(ask_once("OPTIONS", "*", ""), 200);
    assert_int_not_equal(ask_once("ANNOUNCE", "/main", "Content-Type: application/sdp\r\nContent-Length: 0\r\n"), 200);
    wait_for(viewers, 0);
}

static void without_pictures(void **state)
{
    int64_t start_ns;

    (void)state;
    stop_painting();
    sst_slot_unref(slot);
    assert_int_equal(sst_slot_create(&slot), 0);
    serve(SST_RTSP_H264);
    start_ns = sst_clock_now_ns();
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 503);
    assert_quick(start_ns, 6000000000);
    wait_for(viewers, 0);
}

static void passwords(void **state)
{
    char more[256];
    const char *file;
    int fd, status = 401, asked = 0;

    (void)state;
    file = write_password("sesame seed\nsecond line\n");
    snprintf(more, sizeof(more), ", user: nvr, password_file: %s", file);
    serve_with(SST_RTSP_MJPEG, more);
    unlink(file);
    assert_int_equal(ask_once("OPTIONS", "/main", ""), 200);
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 401);
    assert_non_null(strstr(answer, "WWW-Authenticate: Digest"));
    assert_non_null(strstr(answer, "WWW-Authenticate: Basic"));
    assert_int_equal(ask_once("DESCRIBE", "/other", ""), 401); /* nor does it get the list of streams */
    assert_int_equal(ask_once("SETUP", "/main/stream=0", ""), 401);
    assert_int_equal(ask_once("DESCRIBE", "/main", "Authorization: Basic bnZyOnNlc2FtZSBzZWVk\r\n"), 200);
    assert_int_equal(ask_once("DESCRIBE", "/other", "Authorization: Basic bnZyOnNlc2FtZSBzZWVk\r\n"), 404);
    assert_int_equal(ask_once("DESCRIBE", "/main", "Authorization: Basic bnZyOnNlc2FtZQ==\r\n"), 401);
    assert_int_equal(ask_once("DESCRIBE", "/main", "Authorization: Digest x\r\n"), 401);
    assert_int_equal(ask_once("DESCRIBE", "/main", "Authorization: \r\n"), 401);
    assert_int_equal(pclose(watch("nvr:sesame%20seed@", "/main", "tcp", "-frames:v 3 -f null -")), 0); /* Digest */
    assert_int_not_equal(pclose(watch("nvr:sesame@", "/main", "tcp", "-frames:v 3 -f null -")), 0);
    fd = connect_server();
    for (; status == 401; asked++)
        status = ask(fd, "DESCRIBE", "/main", "Authorization: Basic bnZyOnNlc2FtZQ==\r\n");
    assert_int_equal(status, 0); /* a client that guesses is hung up on */
    assert_in_range(asked, 5, 8);
    close(fd);
    for (int t = 0; t < PATIENCE_MS && !reported_refusals; t += 20)
        sleep_ms(20);
    assert_true(reported_refusals > 0);
    wait_for(viewers, 0);
}

static void short_passwords(void **state)
{
    char more[256];

    (void)state;
    snprintf(more, sizeof(more), ", user: nvr, password_file: %s", write_password("sesame7\n"));
    port = free_port();
    configure(SST_RTSP_MJPEG, more);
    start_program();
    for (int t = 0; t < PATIENCE_MS && !reported_problem; t += 20)
        sleep_ms(20);
    assert_true(reported_problem);
    assert_int_equal(try_connect(), -1);
}

struct viewer {
    int fd, packets; /* the same by TCP */
    char session[192];
};

/* @param login  a line; "": none is needed */
static void begin_viewer(struct viewer *v, bool udp, const char *login)
{
    struct sockaddr_in a = { .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    char more[256], id[64];
    const int own = free_port() & ~1;

    v->fd = v->packets = connect_server();
    snprintf(more, sizeof(more), "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n%s", login);
    if (udp) {
        v->packets = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
        a.sin_port = htons((uint16_t)own);
        assert_int_equal(bind(v->packets, (struct sockaddr *)&a, sizeof(a)), 0);
        snprintf(more, sizeof(more), "Transport: RTP/AVP;unicast;client_port=%d-%d\r\n%s", own, own + 1, login);
    }
    assert_int_equal(ask(v->fd, "DESCRIBE", "/main", login), 200);
    assert_int_equal(ask(v->fd, "SETUP", "/main/stream=0", more), 200);
    assert_non_null(strstr(answer, "Session: "));
    assert_int_equal(sscanf(strstr(answer, "Session: "), "Session: %63[^;\r\n]", id), 1);
    snprintf(v->session, sizeof(v->session), "Session: %s\r\n%s", id, login);
}

static void order(const struct viewer *v, const char *method)
{
    assert_int_equal(ask(v->fd, method, "/main", v->session), 200);
}

#define GUESSES 14 /* at a time, of which ten are free */

static const char right[] = "Authorization: Basic bnZyOnNlc2FtZSBzZWVk\r\n";
static const char wrong[] = "Authorization: Basic bnZyOnNlc2FtZQ==\r\n";

static void serve_login(void)
{
    char more[256];

    snprintf(more, sizeof(more), ", user: nvr, password_file: %s", write_password("sesame seed\n"));
    serve_with(SST_RTSP_MJPEG, more);
}

/* A digest that is wrong. @param nonce  NULL: of a connection that is closed now */
static const char *digest(const char *nonce)
{
    static char header[256];
    char made[80] = "";

    if (!nonce) {
        assert_int_equal(ask_once("DESCRIBE", "/main", ""), 401);
        assert_non_null(strstr(answer, "nonce=\""));
        assert_int_equal(sscanf(strstr(answer, "nonce=\""), "nonce=\"%79[^\"]", made), 1);
    }
    snprintf(header, sizeof(header),
             "Authorization: Digest username=\"nvr\", realm=\"sst\", nonce=\"%s\", uri=\"rtsp://127.0.0.1/main\", "
             "response=\"0123456789abcdef0123456789abcdef\"\r\n",
             nonce ? nonce : made);
    return header;
}

/* As many as that at once, each on a connection of its own. @return number that were refused, not hung up on */
static int guess_at_once(const char *header)
{
    int fd[GUESSES], status, refused = 0;
    char text[1024];

    for (int i = 0; i < GUESSES; i++) {
        fd[i] = connect_server();
        snprintf(text, sizeof(text), "DESCRIBE rtsp://127.0.0.1:%d/main RTSP/1.0\r\nCSeq: 1\r\n%s\r\n", port, header);
        (void)!send(fd[i], text, strlen(text), MSG_NOSIGNAL);
    }
    for (int i = 0; i < GUESSES; i++) {
        const ssize_t n = recv(fd[i], text, sizeof(text) - 1, 0);

        text[n > 0 ? n : 0] = 0;
        refused += sscanf(text, "RTSP/1.0 %d", &status) == 1 && status == 401;
        close(fd[i]);
    }
    return refused;
}

/* By whatever way, ten a minute are looked at, and then one each 4 s, of which two can wait. The right password is one
 * of these; a viewer that was there before does not wait, and one that is connected stays. */
static void guesses_are_counted(void **state)
{
    struct viewer v;
    int status = 0, refused;

    (void)state;
    for (int i = 0; i < 2; i++) {
        const char *header;

        serve_login();
        begin_viewer(&v, false, right);
        order(&v, "PLAY");
        assert_int_equal(pclose(watch("nvr:sesame%20seed@", "/main", "tcp", "-frames:v 1 -f null -")), 0);
        header = i ? digest(NULL) : wrong;
        reported_refusals = 0;
        (void)guess_at_once(header);
        refused = guess_at_once(header);
        assert_in_range(refused, 0, GUESSES / 2); /* more than two after 4 s alone, on a busy machine */
        for (int t = 0; t < PATIENCE_MS && !reported_refusals; t += 20)
            sleep_ms(20);
        assert_true(reported_refusals > 0);
        assert_int_equal(pclose(watch("nvr:sesame%20seed@", "/main", "tcp", "-frames:v 1 -f null -")), 0);
        order(&v, "GET_PARAMETER");
        close(v.fd);
        if (!i) {
            close_server();
            continue;
        }
        for (int t = 0; t < PATIENCE_MS && status != 200; t += 20) {
            status = ask_once("DESCRIBE", "/main", right);
            sleep_ms(20);
        }
        assert_int_equal(status, 200);
        close_server();
    }
}

/* Clients answer the challenge of the program before it was started again. */
static void nonces_of_a_restart_are_free(void **state)
{
    const char *header;

    (void)state;
    serve_login();
    header = digest("0000000f0123456789abcdef0123456789abcdef");
    assert_int_equal(ask_once("DESCRIBE", "/main", header), 401);
    assert_non_null(strstr(answer, "nonce="));
    sleep_ms(200);
    assert_int_equal(reported_refusals, 0);
    (void)guess_at_once(header); /* but not to whoever does nothing else */
    for (int t = 0; t < PATIENCE_MS && !reported_refusals; t += 20)
        sleep_ms(20);
    assert_true(reported_refusals > 0);
}

/* --- pauses ------------------------------------------------------------------------------------------------------- */

/* Bytes that have come by now, through the connection or beside it. */
static size_t drain(int fd)
{
    static char space[65536];
    size_t bytes = 0;
    ssize_t n;

    while ((n = recv(fd, space, sizeof(space), MSG_DONTWAIT)) > 0)
        bytes += (size_t)n;
    return bytes;
}

#define FLOWING 4000 /* bytes; reports are less in a minute */

static void flows(int fd)
{
    size_t bytes = 0;

    for (int t = 0; t < PATIENCE_MS && bytes < FLOWING; t += 20) {
        bytes += drain(fd);
        sleep_ms(20);
    }
    assert_true(bytes >= FLOWING);
}

static void stands(int fd)
{
    size_t bytes = FLOWING;

    for (int t = 0; t < PATIENCE_MS && bytes >= FLOWING / 8; t += 300) { /* packets on their way, first */
        sleep_ms(300);
        bytes = drain(fd);
    }
    assert_true(bytes < FLOWING / 8);
}

static void pauses_end(void **state)
{
    struct viewer a, b;

    (void)state;
    for (int i = 0; i < 2; i++) {
        serve(i ? SST_RTSP_H264 : SST_RTSP_MJPEG);
        begin_viewer(&a, i, "");
        order(&a, "PLAY");
        flows(a.packets);
        order(&a, "PAUSE");
        stands(a.packets);
        order(&a, "GET_PARAMETER");
        order(&a, "PLAY");
        flows(a.packets);
        order(&a, "PAUSE");
        assert_int_equal(ask(a.fd, "PAUSE", "/main", a.session), 455); /* as RFC 2326 has it */
        stands(a.packets);
        order(&a, "PLAY");
        order(&a, "PLAY");
        flows(a.packets);
        order(&a, "PAUSE");
        stands(a.packets);
        begin_viewer(&b, !i, ""); /* while the first pauses */
        order(&b, "PLAY");
        flows(b.packets);
        stands(a.packets);
        order(&a, "PLAY");
        flows(a.packets);
        order(&a, "PAUSE");
        order(&b, "PAUSE");
        stands(b.packets);
        order(&b, "TEARDOWN");
        order(&a, "PLAY");
        flows(a.packets);
        order(&a, "PAUSE");
        order(&a, "TEARDOWN");
        close(a.fd);
        close(b.fd);
        close(i ? a.packets : b.packets);
        wait_for(clients, 0);
        wait_for(viewers, 0);
        close_server();
    }
}

/* As the unit runs it: it needs to look, and to report. */
static void a_user_of_its_own(void **state)
{
    const struct group *video = getgrnam("video");

    (void)state;
    if (geteuid() || !video) {
        print_message("%s: another user is not tried\n", video ? "not root" : "there is no group `video`");
        skip();
    }
    sst_http_close(service);
    looks = video->gr_gid;
    open_service();
    assert_int_equal(chmod(folder, 0755), 0);
    serve(SST_RTSP_MJPEG);
    reads_20("/main", "tcp");
    wait_for(clients, 0); /* which it has reported */
    close_server();
    looks = 0;
}

static void nobody_waits_for_a_slow_one(void **state)
{
    int fd[3];

    (void)state;
    serve(SST_RTSP_MJPEG);
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 200);
    for (int i = 0; i < 3; i++)
        fd[i] = stall();
    reads_20("/main", "tcp");
    reads_20("/main", "udp");
    close_server();
    for (int i = 0; i < 3; i++)
        close(fd[i]);
}

static void garbage_and_floods(void **state)
{
    static char noise[65536];
    int fd[60], hung_up = 0;
    int64_t start_ns;
    unsigned seed = 7;

    (void)state;
    serve(SST_RTSP_MJPEG);
    for (size_t i = 0; i < sizeof(noise); i++)
        noise[i] = (char)(rand_r(&seed) >> 8);
    for (int i = 0; i < 8; i++) {
        fd[0] = connect_server();
        (void)!send(fd[0], noise + i * 1000, 1000, MSG_NOSIGNAL);
        close(fd[0]);
    }
    /* A request with headers that never end. */
    fd[0] = connect_server();
    start_ns = sst_clock_now_ns();
    (void)!send(fd[0], "DESCRIBE rtsp://127.0.0.1/main RTSP/1.0\r\n", 41, MSG_NOSIGNAL);
    while (send(fd[0], "X-Header: xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx\r\n", 65, MSG_NOSIGNAL) == 65)
        assert_quick(start_ns, 10000000000);
    close(fd[0]);
    start_ns = sst_clock_now_ns();
    for (int i = 0; i < 60; i++)
        fd[i] = connect_server();
    for (int t = 0; t < PATIENCE_MS && hung_up < 20; t += 20) { /* connections beyond the limit, at once */
        sleep_ms(20);
        hung_up = 0;
        for (int i = 0; i < 60; i++)
            hung_up += poll(&(struct pollfd){ .fd = fd[i], .events = POLLIN }, 1, 0) > 0;
    }
    assert_true(hung_up >= 20);
    assert_true(hung_up <= 40 || sst_clock_now_ns() - start_ns > 4000000000); /* a silent connection ends after 5 s */
    for (int i = 0; i < 60; i++)
        close(fd[i]);
    for (int t = 0, answered = 0; t < PATIENCE_MS && answered < 10; t += 50) { /* they go one after the other */
        answered = ask_once("OPTIONS", "*", "") == 200 ? answered + 1 : 0;
        sleep_ms(50);
    }
    reads_20("/main", "tcp");
}

static void a_view_that_ends(void **state)
{
    FILE *f;
    int64_t start_ns;

    (void)state;
    serve(SST_RTSP_MJPEG);
    f = watch("", "/view/v1", "tcp", "-f null -");
    wait_for(clients, 1);
    sleep_ms(500);
    stop_painting();
    start_ns = sst_clock_now_ns();
    sst_slot_shut(slot);
    pclose(f);
    assert_quick(start_ns, 5000000000);
    wait_for(clients, 0);
    wait_for(viewers, 0);
}

/* What a session of 1.22 of the library was open to: another connection that commands it ended the process, and a
 * second place to send to was never forgotten. */
static void orders_that_are_odd(void **state)
{
    static const char *const methods[] = { "PLAY", "PAUSE", "TEARDOWN", "GET_PARAMETER", "SET_PARAMETER", "SETUP" };
    static const char to[] = "Transport: RTP/AVP/TCP;unicast;interleaved=2-3\r\n";
    char more[256], session[64] = "", *at;
    int fd, other;

    (void)state;
    serve(SST_RTSP_MJPEG);
    fd = connect_server();
    assert_int_equal(ask(fd, "DESCRIBE", "/main", ""), 200);
    assert_int_equal(ask(fd, "SETUP", "/main/stream=0", to), 200);
    at = strstr(answer, "Session: ");
    assert_non_null(at);
    assert_int_equal(sscanf(at, "Session: %63[^;\r\n]", session), 1);
    snprintf(more, sizeof(more), "Session: %s\r\n%s", session, to);
    for (size_t i = 0; i < ARRAY_LEN(methods); i++) {
        const bool setup = !strcmp(methods[i], "SETUP");

        other = connect_server();
        assert_int_equal(ask(other, methods[i], setup ? "/main/stream=0" : "/main", more), 454);
        close(other);
    }
    assert_int_equal(ask(fd, "SETUP", "/main/stream=0", more), 455);
    wait_for(clients, 1);
    assert_int_equal(ask(fd, "PLAY", "/main", more), 200);
    close(fd);
    wait_for(clients, 0);
    wait_for(viewers, 0);
    close_server();
}

/* --- the service and its configuration ---------------------------------------------------------------------------- */

static int descriptors(void)
{
    char command[64];
    FILE *f;
    int n = -1;

    snprintf(command, sizeof(command), "ls /proc/%d/fd | wc -l", (int)program);
    f = popen(command, "r");
    assert_non_null(f);
    assert_int_equal(fscanf(f, "%d", &n), 1);
    pclose(f);
    return n;
}

/* Clients that come, watch and vanish leave nothing behind. */
static void many_come_and_go(void **state)
{
    int before = 0, now = 0;

    (void)state;
    serve(SST_RTSP_MJPEG);
    for (int i = 0; i < 40; i++) {
        const struct linger reset = { .l_onoff = i % 2 };
        const int fd = stall();

        setsockopt(fd, SOL_SOCKET, SO_LINGER, &reset, sizeof(reset));
        close(fd);
        wait_for(clients, 0);
        if (i == 10) {
            wait_for(viewers, 0);
            sleep_ms(1500); /* the library keeps a client for a moment */
            before = descriptors();
        }
    }
    wait_for(viewers, 0);
    for (int t = 0; t < PATIENCE_MS && (now = descriptors()) > before; t += 100)
        sleep_ms(100);
    assert_true(now <= before);
    close_server();
}

static void a_port_in_use_is_retried(void **state)
{
    struct sockaddr_in a = { .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    (void)state;
    port = free_port();
    a.sin_port = htons((uint16_t)port);
    assert_int_equal(bind(fd, (struct sockaddr *)&a, sizeof(a)), 0);
    assert_int_equal(listen(fd, 1), 0);
    configure(SST_RTSP_MJPEG, "");
    start_program();
    for (int t = 0; t < PATIENCE_MS && !reported_problem; t += 20)
        sleep_ms(20);
    assert_true(reported_problem);
    close(fd);
    for (int t = 0; t < PATIENCE_MS && reported_problem; t += 20)
        sleep_ms(20);
    assert_false(reported_problem);
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 200);
    close_server();
}

/* Another port, none, and a codec that is the same: only changes end connections. */
static void a_reload_is_followed(void **state)
{
    const int first = free_port();
    int fd;

    (void)state;
    port = first;
    configure(SST_RTSP_MJPEG, "");
    start_program();
    wait_for_server();
    fd = connect_server();
    assert_int_equal(ask(fd, "DESCRIBE", "/main", ""), 200);
    sst_events_emit(api.events, SST_EVENT_INFO, "reload", NULL, "nothing has changed");
    sleep_ms(500);
    assert_int_equal(ask(fd, "DESCRIBE", "/main", ""), 200);
    port = free_port();
    configure(SST_RTSP_H264, "");
    sst_events_emit(api.events, SST_EVENT_INFO, "reload", NULL, "another port");
    wait_for_server();
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 200);
    assert_non_null(strstr(answer, "H264"));
    port = first;
    assert_int_equal(try_connect(), -1);
    close(fd);
    close_server();
}

static void the_service_may_come_later_and_go(void **state)
{
    FILE *f;

    (void)state;
    sst_http_close(service);
    service = NULL;
    serve(SST_RTSP_MJPEG);
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 503);
    open_service();
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 200);
    f = watch("", "/main", "tcp", "-f null -");
    wait_for(clients, 1);
    sst_http_close(service);
    pclose(f); /* its stream has ended */
    open_service();
    reads_20("/main", "tcp");
    close_server();
}

#endif

int main(int argc, char **argv)
{
#if WITH_RTSP
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_is_not_there, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(mjpeg_is_read, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(h264_is_read, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(all_share_one_encoder, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(killed_clients_go, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(still_pictures_are_repeated, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(sizes_that_are_odd, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(without_pictures, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(passwords, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(short_passwords, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(guesses_are_counted, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(nonces_of_a_restart_are_free, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(pauses_end, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(a_user_of_its_own, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(nobody_waits_for_a_slow_one, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(garbage_and_floods, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(a_view_that_ends, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(orders_that_are_odd, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(many_come_and_go, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(a_port_in_use_is_retried, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(a_reload_is_followed, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(the_service_may_come_later_and_go, make_pictures, end_pictures),
    };

    if (system("ffmpeg -version >/dev/null 2>&1")) {
        puts("ffmpeg is not installed");
        return 77;
    }
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
#else
    (void)argc;
    (void)argv;
    puts("this build has no RTSP");
    return 77;
#endif
}
