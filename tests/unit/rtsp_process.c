/* The process that serves RTSP, as the service sees it: it begins, ends, hangs, lies, and leaves nothing behind. */
#include "tests/rtsp_bench.h"

#if WITH_RTSP

/* --- the process that serves ----------------------------------------------------------------------------------------
 */

/* Of this process's children, the one that serves RTSP; just started, it has no name for a moment. */
static pid_t process_of(void)
{
    char command[96];
    int pid = 0;

    snprintf(command, sizeof(command), "pgrep -P %d -x sstd-rtsp", (int)getpid());
    for (int t = 0; t < PATIENCE_MS && !pid; t += 50) {
        FILE *f = popen(command, "r");

        assert_non_null(f);
        if (fscanf(f, "%d", &pid) != 1)
            pid = 0;
        pclose(f);
        if (!pid)
            sleep_ms(50);
    }
    assert_true(pid > 0);
    return pid;
}

static int restarts(void)
{
    return (int)sst_rtsp_restarts(server);
}

static int entries_of(pid_t pid, const char *path)
{
    char command[64];
    FILE *f;
    int n = -1;

    snprintf(command, sizeof(command), "ls /proc/%d/%s | wc -l", (int)pid, path);
    f = popen(command, "r");
    if (f && fscanf(f, "%d", &n) != 1)
        n = -1;
    if (f)
        pclose(f);
    return n;
}

/* Clients that come, watch and vanish leave nothing behind. */
static void many_come_and_go(void **state)
{
    int fds = 0, now = 0;

    (void)state;
    serve(SST_RTSP_MJPEG);
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 200);
    for (int i = 0; i < 60; i++) {
        const struct linger reset = { .l_onoff = i % 2 };
        const int fd = stall();

        wait_for(viewers, 1);
        setsockopt(fd, SOL_SOCKET, SO_LINGER, &reset, sizeof(reset));
        close(fd);
        wait_for(viewers, 0);
        if (i == 10) {
            sleep_ms(1500); /* who has gone is kept for a moment */
            fds = entries_of(process_of(), "fd");
        }
    }
    for (int t = 0; t < PATIENCE_MS && (now = entries_of(process_of(), "fd")) > fds; t += 100)
        sleep_ms(100);
    print_message("%d descriptors after 10 clients, %d after 60\n", fds, now);
    assert_true(now <= fds);
    assert_int_equal(restarts(), 0);
}

/* Whoever watches is cut off, whoever comes is served as soon as there is a process again. */
static void a_process_that_ends(void **state)
{
    pid_t pid;
    FILE *f;

    (void)state;
    serve(SST_RTSP_MJPEG);
    pid = process_of();
    f = watch("", "/main", "tcp", "-f null -");
    wait_for(clients, 1);
    kill(pid, SIGABRT);
    wait_for(viewers, 0);
    pclose(f);
    reads_20("/main", "tcp");
    assert_int_equal(restarts(), 1);
    assert_int_not_equal(process_of(), pid);
}

static void a_process_that_hangs(void **state)
{
    pid_t pid;
    int fd;

    (void)state;
    serve(SST_RTSP_MJPEG);
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 200);
    fd = stall();
    pid = process_of();
    kill(pid, SIGSTOP);
    for (int n = 0; n < 200; n++) /* more than the way to it holds; nobody who makes pictures waits */
        show(n, WIDTH, HEIGHT);
    wait_for(restarts, 1);
    for (int t = 0; t < PATIENCE_MS && !kill(pid, 0); t += 20) /* it may take long to go */
        sleep_ms(20);
    assert_int_equal(kill(pid, 0), -1);
    close(fd);
    kill(process_of(), SIGSTOP);
    close_server();
}

#define LIE "SST_TEST_RTSP_LIE"

static const struct rtsp_message lies[] = {
    { .word = SST_RTSP_READY, .bytes = 1 << 30 },
    { .word = SST_RTSP_WATCH, .place = SST_RTSP_PLACES, .value = 1 },
    { .word = SST_RTSP_FORGET, .place = -1 },
    { .word = SST_RTSP_WATCH, .place = 5, .value = 1 }, /* nothing was found there */
    { .word = SST_RTSP_FIND, .value = SST_PICTURE_DISPARITY, .name = "main" },
    { .word = 99 },
};

/* As a process that a client has taken over might: the first one that finds the file, which says what to lie. */
static int lie(const char *file)
{
    struct rtsp_message m = { .word = SST_RTSP_READY };
    FILE *f = fopen(file, "r");
    int which = -1;

    if (!f || fscanf(f, "%d", &which) != 1 || unlink(file))
        return f ? 1 : sst_rtsp_process();
    fclose(f);
    if (rtsp_link_send(SST_RTSP_LINK_FD, &m, NULL, -1))
        return 1;
    return send(SST_RTSP_LINK_FD, &lies[which], sizeof(m), MSG_NOSIGNAL) < 0 || pause();
}

static void a_process_that_lies(void **state)
{
    char file[64];

    (void)state;
    snprintf(file, sizeof(file), "/tmp/sst-rtsp-%d.lie", (int)getpid());
    setenv(LIE, file, 1);
    for (size_t i = 0; i < ARRAY_LEN(lies); i++) {
        FILE *f = fopen(file, "w");

        assert_non_null(f);
        fprintf(f, "%zu\n", i);
        fclose(f);
        serve(SST_RTSP_MJPEG);
        wait_for(restarts, 1);
        if (i == 0) /* an honest one does its work */
            assert_int_equal(ask_once("DESCRIBE", "/main", ""), 200);
        wait_for(viewers, 0);
        close_server();
    }
    unsetenv(LIE);
}

/* --- opening and closing ---------------------------------------------------------------------------------------------
 */

static char said[SST_LOG_MAX];

static void refuse(const struct sst_rtsp_config *cfg, int err, const char *words)
{
    struct sst_rtsp *none = NULL;
    char *before = sst_log_hold_errors(said);
    const int got = sst_rtsp_open(&none, cfg);

    sst_log_hold_errors(before);
    assert_int_equal(got, err);
    assert_null(none);
    if (!strstr(said, words))
        fail_msg("no \"%s\" in \"%s\"", words, said);
}

/* Somebody else's port, and an address that is not there yet. */
static void what_is_waited_for(void **state)
{
    struct sst_rtsp_config cfg = config(SST_RTSP_MJPEG);
    struct sst_rtsp *second = NULL;
    char why[128] = "";
    int64_t end_ns;
    int port;

    (void)state;
    cfg.address = "192.0.2.1"; /* of documentation: nobody's */
    cfg.insecure = true;
    assert_int_equal(sst_rtsp_open(&second, &cfg), 0);
    assert_true(sst_rtsp_away(second, why, sizeof(why)));
    assert_non_null(strstr(why, "192.0.2.1"));
    sst_rtsp_close(second);
    cfg = config(SST_RTSP_MJPEG);
    /* Below those that the kernel gives away: nobody listens there for a while. */
    for (cfg.port = 20000 + (int)getpid() % 10000; !server; cfg.port++) {
        assert_int_equal(sst_rtsp_open(&server, &cfg), 0);
        if (!sst_rtsp_away(server, why, sizeof(why)))
            break;
        sst_rtsp_close(server);
        server = NULL;
    }
    port = sst_rtsp_port(server);
    assert_int_equal(port, cfg.port);
    assert_int_equal(sst_rtsp_open(&second, &cfg), 0);
    assert_true(sst_rtsp_away(second, why, sizeof(why)));
    assert_int_equal(sst_rtsp_clients(second), 0);
    sst_rtsp_close(server);
    server = second;
    end_ns = sst_clock_now_ns() + 60000000000;
    while (sst_rtsp_away(second, why, sizeof(why)) && sst_clock_now_ns() < end_ns)
        nanosleep(&(struct timespec){ .tv_nsec = 50000000 }, NULL);
    assert_false(sst_rtsp_away(second, why, sizeof(why)));
    assert_int_equal(sst_rtsp_port(second), port);
}

static void what_is_refused(void **state)
{
    struct sst_rtsp_config cfg = config(SST_RTSP_MJPEG);

    (void)state;
    cfg.address = "0.0.0.0";
    refuse(&cfg, -EINVAL, "rtsp.insecure");
    cfg.address = "localhost";
    refuse(&cfg, -EINVAL, "numeric");
    cfg = config(SST_RTSP_MJPEG);
    cfg.user = "nvr";
    refuse(&cfg, -EINVAL, "rtsp.password_file");
    cfg.password_file = "/nowhere/password";
    refuse(&cfg, -ENOENT, "/nowhere/password");
    cfg.password_file = write_password("\nword\n");
    refuse(&cfg, -EBADMSG, "first line");
    unlink(cfg.password_file);
}

static void opens_and_closes(void **state)
{
    int threads = 0, fds = 0, now = 0;

    (void)state;
    for (int i = 0; i < 10; i++) {
        FILE *f;

        serve(i % 2 ? SST_RTSP_H264 : SST_RTSP_MJPEG);
        f = watch("", "/main", i % 3 ? "tcp" : "udp", "-f null -");
        if (i < 8) /* also while it is being told what there is, and before */
            wait_for(clients, 1);
        close_server();
        pclose(f);
        assert_int_equal(viewers(), 0);
        if (i == 1) {
            sleep_ms(300);
            threads = entries_of(getpid(), "task");
            fds = entries_of(getpid(), "fd");
        }
    }
    for (int t = 0;
         t < PATIENCE_MS && ((now = entries_of(getpid(), "task")) > threads || entries_of(getpid(), "fd") > fds);
         t += 100)
        sleep_ms(100);
    print_message("%d threads before, %d after; %d descriptors before, %d after\n", threads, now, fds,
                  entries_of(getpid(), "fd"));
    assert_true(now <= threads);
    assert_true(entries_of(getpid(), "fd") <= fds);
}

#endif

int main(int argc, char **argv)
{
#if WITH_RTSP
    if (argc > 1 && !strcmp(argv[1], SST_RTSP_PROCESS))
        return getenv(LIE) ? lie(getenv(LIE)) : sst_rtsp_process();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_is_waited_for, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(what_is_refused, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(many_come_and_go, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(a_process_that_ends, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(a_process_that_hangs, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(a_process_that_lies, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(opens_and_closes, make_pictures, end_pictures),
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
