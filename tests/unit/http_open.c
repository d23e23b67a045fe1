/* Opening: refusals and their messages, sockets that are in use or left over, tokens, TLS. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/http_fake.h"

#include <sys/resource.h>

static char said[SST_LOG_MAX];

static int open_quietly(const struct sst_http_config *cfg)
{
    char *before = sst_log_hold_errors(said);
    int err;

    said[0] = 0;
    err = sst_http_open(&server, cfg);
    sst_log_hold_errors(before);
    if (err)
        server = NULL;
    return err;
}

static void refuse(const struct sst_http_config *cfg, int err, const char *words)
{
    assert_int_equal(open_quietly(cfg), err);
    assert_contains(said, words);
}

static void port_in_use(void **state)
{
    struct sst_http_config cfg = config();
    char port[16];

    (void)state;
    serve(&cfg);
    cfg.port = sst_http_port(server);
    cfg.socket = NULL;
    snprintf(port, sizeof(port), "port %d", cfg.port);
    {
        struct sst_http *first = server;

        refuse(&cfg, -EADDRINUSE, port);
        assert_non_null(strstr(said, "web.port"));
        server = first;
    }
    assert_int_equal(ask("GET", "/healthz", "", NULL), 200);
}

/* With a control socket there is somebody to serve meanwhile. */
static void port_in_use_for_a_while(void **state)
{
    struct sst_http_config cfg = config();
    struct sst_http *first, *second = NULL;
    char why[SST_COUNTERS_PROBLEM] = "";
    int64_t end_ns;
    int port;

    (void)state;
    cfg.socket = NULL;
    /* Below the ports that the kernel gives away: nobody listens there for a while. */
    for (cfg.port = 20000 + (int)getpid() % 10000; open_quietly(&cfg); cfg.port++)
        assert_true(strstr(said, "in use") || strstr(said, "listens there"));
    first = server;
    port = sst_http_port(first);
    assert_int_equal(port, cfg.port);
    cfg = config();
    cfg.port = port;
    assert_int_equal(sst_http_open(&second, &cfg), 0);
    assert_int_equal(sst_http_port(second), 0);
    assert_true(sst_counters_problem(&fake_counters, why));
    assert_non_null(strstr(why, "web.address 127.0.0.1"));
    assert_int_equal(ask_on(connect_local(in_folder("control.sock")), "GET", "/api/v1/status", "", NULL), 200);
    sst_http_close(first);
    server = second;
    end_ns = sst_clock_now_ns() + 60000000000;
    while (sst_counters_problem(&fake_counters, why) && sst_clock_now_ns() < end_ns)
        nanosleep(&(struct timespec){ .tv_nsec = 50000000 }, NULL);
    assert_int_equal(sst_http_port(second), port);
    assert_int_equal(ask("GET", "/healthz", "", NULL), 200);
}

/* The library does not start, and does not close the socket either: it would listen on, for nobody. */
static void without_descriptors(void **state)
{
    struct sst_http_config cfg = config();
    const int fd = dup(0); /* all below are taken */
    struct rlimit before, one;

    (void)state;
    close(fd);
    cfg.socket = NULL;
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
    one = (struct rlimit){ .rlim_cur = (rlim_t)fd + 1, .rlim_max = before.rlim_max };
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &one), 0);
    refuse(&cfg, -EIO, "does not start");
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
    assert_int_equal(fcntl(fd, F_GETFD), -1);
}

static void socket_in_use(void **state)
{
    struct sst_http_config cfg = config();
    struct sst_http *first;
    char process[32];

    (void)state;
    serve(&cfg);
    first = server;
    snprintf(process, sizeof(process), "process %d", (int)getpid());
    refuse(&cfg, -EADDRINUSE, process);
    assert_non_null(strstr(said, in_folder("control.sock")));
    server = first;
    assert_int_equal(ask_on(connect_local(in_folder("control.sock")), "GET", "/api/v1/status", "", NULL), 200);
}

/* The socket of a killed service is replaced; a file that is no socket stays. */
static void left_over_socket(void **state)
{
    const struct sst_http_config cfg = config();
    struct sockaddr_un at = { .sun_family = AF_UNIX };
    const int old = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    FILE *f;

    (void)state;
    snprintf(at.sun_path, sizeof(at.sun_path), "%s", in_folder("control.sock"));
    assert_int_equal(bind(old, (struct sockaddr *)&at, sizeof(at)), 0);
    close(old);
    serve(&cfg);
    assert_int_equal(ask_on(connect_local(in_folder("control.sock")), "GET", "/api/v1/status", "", NULL), 200);
    /* somebody else's by now: stays when we go */
    unlink(at.sun_path);
    f = fopen(at.sun_path, "w");
    fclose(f);
    sst_http_close(server);
    server = NULL;
    assert_int_equal(access(at.sun_path, F_OK), 0);
    refuse(&cfg, -EEXIST, "not a socket");
}

static void given_socket(void **state)
{
    struct sst_http_config cfg = config();
    struct sockaddr_un at = { .sun_family = AF_UNIX };
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);

    (void)state;
    snprintf(at.sun_path, sizeof(at.sun_path), "%s", in_folder("control.sock"));
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof(at)), 0);
    assert_int_equal(listen(fd, 8), 0);
    cfg.socket_fd = fd;
    cfg.address = NULL;
    assert_int_equal(open_quietly(&cfg), 0);
    assert_int_equal(sst_http_port(server), 0);
    assert_int_equal(ask_on(connect_local(in_folder("control.sock")), "GET", "/api/v1/status", "", NULL), 200);
    sst_http_close(server);
    server = NULL;
    assert_int_equal(access(at.sun_path, F_OK), 0); /* its owner removes it */
}

static void addresses(void **state)
{
    struct sst_http_config cfg = config();

    (void)state;
    cfg.address = "0.0.0.0";
    refuse(&cfg, -EINVAL, "insecure");
    cfg.address = "::";
    refuse(&cfg, -EINVAL, "web.tls_certificate");
    cfg.address = "example.com";
    refuse(&cfg, -EINVAL, "numeric");
    cfg.address = "127.0.0.1";
    cfg.port = 65536;
    refuse(&cfg, -EINVAL, "65536");
    cfg.port = 0;
    cfg.token_file = NULL;
    refuse(&cfg, -EINVAL, "web.token_file");
    cfg = config();
    cfg.socket = "/nowhere/control.sock";
    refuse(&cfg, -ENOENT, "/nowhere/control.sock");
    cfg = config();
    cfg.address = "0.0.0.0";
    cfg.insecure = true;
    serve(&cfg);
    assert_int_equal(ask("GET", "/api/v1/status", with("Host: 127.0.0.1\r\n", bearer(view)), NULL), 200);
}

static void tokens(void **state)
{
    const struct sst_http_config cfg = config();
    char first[129];
    struct stat st;
    FILE *f;

    (void)state;
    serve(&cfg);
    assert_int_equal(strlen(control), 64);
    assert_int_equal(strlen(view), 64);
    assert_string_not_equal(control, view);
    strcpy(first, control);
    assert_int_equal(stat(in_folder("token"), &st), 0);
    assert_int_equal(st.st_mode & 0777, 0600);
    assert_int_equal(stat(in_folder("token.view"), &st), 0);
    assert_int_equal(st.st_mode & 0777, 0600);
    sst_http_close(server);
    serve(&cfg);
    assert_string_equal(control, first);
    sst_http_close(server);
    server = NULL;
    f = fopen(in_folder("token"), "w");
    fputs("short\n", f);
    fclose(f);
    refuse(&cfg, -EBADMSG, "remove it");
    f = fopen(in_folder("token"), "w");
    fclose(f);
    refuse(&cfg, -EBADMSG, "token");
}

/* By another program's TLS. */
static void tls(void **state)
{
    struct sst_http_config cfg = config();
    char command[600];
    int descriptors;
    FILE *f;

    (void)state;
    cfg.tls_certificate = in_folder("cert.pem");
    cfg.tls_key = in_folder("key.pem");
    refuse(&cfg, -ENOENT, "cert.pem");
    snprintf(command, sizeof(command),
             "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=localhost "
             "-addext subjectAltName=DNS:localhost -keyout %s/key.pem -out %s/cert.pem 2>/dev/null",
             folder, folder);
    if (system("openssl version >/dev/null 2>&1")) {
        print_message("openssl is not installed: TLS is not tried\n");
        skip();
    }
    assert_int_equal(system(command), 0);
    cfg.address = "0.0.0.0";
    serve(&cfg);
    snprintf(command, sizeof(command),
             "curl -s -o /dev/null -D - --cacert %s/cert.pem 'https://localhost:%d/?token=%s'", folder,
             sst_http_port(server), control);
    f = popen(command, "r");
    answer[fread(answer, 1, sizeof(answer) - 1, f)] = 0;
    pclose(f);
    assert_non_null(strstr(answer, "HTTP/1.1 303"));
    assert_non_null(strstr(answer, "; Secure"));
    assert_int_equal(ask("GET", "/healthz", "", NULL), 0); /* in the clear: no */
    sst_http_close(server);
    server = NULL;
    f = fopen(in_folder("key.pem"), "w");
    fputs("no key\n", f);
    fclose(f);
    cfg.tls_key = in_folder("key.pem");
    descriptors = count_entries("/proc/self/fd");
    for (int i = 0; i < 20; i++)
        refuse(&cfg, -EINVAL, "key.pem");
    assert_true(count_entries("/proc/self/fd") < descriptors + 10); /* sanitizers have one of their own at times */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(port_in_use, make_service, end_service),
        cmocka_unit_test_setup_teardown(port_in_use_for_a_while, make_service, end_service),
        cmocka_unit_test_setup_teardown(without_descriptors, make_service, end_service),
        cmocka_unit_test_setup_teardown(socket_in_use, make_service, end_service),
        cmocka_unit_test_setup_teardown(left_over_socket, make_service, end_service),
        cmocka_unit_test_setup_teardown(given_socket, make_service, end_service),
        cmocka_unit_test_setup_teardown(addresses, make_service, end_service),
        cmocka_unit_test_setup_teardown(tokens, make_service, end_service),
        cmocka_unit_test_setup_teardown(tls, make_service, end_service),
    };

    return http_tests(tests);
}
