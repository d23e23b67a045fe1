/* The RTSP server with pictures that are made up, read by ffmpeg and by clients that misbehave. */
#include "tests/rtsp_bench.h"

#if WITH_RTSP
#include <jpeglib.h>

/* --- who reads what there is -----------------------------------------------------------------------------------------
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
    sst_outlet_unref(outlet);
    assert_int_equal(sst_outlet_create(&outlet), 0);
    serve(SST_RTSP_H264);
    start_ns = sst_clock_now_ns();
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 503);
    assert_quick(start_ns, 6000000000);
    wait_for(viewers, 0);
}

static void passwords(void **state)
{
    struct sst_rtsp_config cfg = config(SST_RTSP_MJPEG);
    int fd, status = 401, asked = 0;

    (void)state;
    cfg.user = "nvr";
    cfg.password_file = write_password("sesame seed\nsecond line\n");
    assert_int_equal(sst_rtsp_open(&server, &cfg), 0);
    unlink(cfg.password_file);
    assert_int_equal(ask_once("OPTIONS", "/main", ""), 200);
    assert_int_equal(ask_once("DESCRIBE", "/main", ""), 401);
    assert_non_null(strstr(answer, "WWW-Authenticate: Digest"));
    assert_non_null(strstr(answer, "WWW-Authenticate: Basic"));
    assert_int_equal(ask_once("DESCRIBE", "/other", ""), 401); /* nor is it told what there is */
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
    assert_int_equal(status, 0); /* who only guesses is hung up on */
    assert_in_range(asked, 5, 8);
    close(fd);
    wait_for(viewers, 0);
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
    /* A request whose headers never end. */
    fd[0] = connect_server();
    start_ns = sst_clock_now_ns();
    (void)!send(fd[0], "DESCRIBE rtsp://127.0.0.1/main RTSP/1.0\r\n", 41, MSG_NOSIGNAL);
    while (send(fd[0], "X-Header: xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx\r\n", 65, MSG_NOSIGNAL) == 65)
        assert_quick(start_ns, 10000000000);
    close(fd[0]);
    start_ns = sst_clock_now_ns();
    for (int i = 0; i < 60; i++)
        fd[i] = connect_server();
    for (int t = 0; t < PATIENCE_MS && hung_up < 20; t += 20) { /* those beyond the limit, at once */
        sleep_ms(20);
        hung_up = 0;
        for (int i = 0; i < 60; i++)
            hung_up += poll(&(struct pollfd){ .fd = fd[i], .events = POLLIN }, 1, 0) > 0;
    }
    assert_true(hung_up >= 20);
    assert_true(hung_up <= 40 || sst_clock_now_ns() - start_ns > 4000000000); /* who asks nothing goes after 5 s */
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
    sst_outlet_shut(outlet);
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
    assert_int_equal(sst_rtsp_restarts(server), 0);
}

/* --- what RTP carries ------------------------------------------------------------------------------------------------
 */

struct form {
    int width, components, across, down;
    bool optimized, progressive;
    const char *why; /* NULL: fits */
};

static void encode(const struct form *form, uint8_t **data, unsigned long *bytes)
{
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr errors;
    uint8_t *row = calloc((size_t)form->width, 3);

    assert_non_null(row);
    for (int x = 0; x < form->width * 3; x++)
        row[x] = (uint8_t)(x * x);
    jpeg.err = jpeg_std_error(&errors);
    jpeg_create_compress(&jpeg);
    *data = NULL;
    jpeg_mem_dest(&jpeg, data, bytes);
    jpeg.image_width = (JDIMENSION)form->width;
    jpeg.image_height = 64;
    jpeg.input_components = form->components;
    jpeg.in_color_space = form->components == 3 ? JCS_RGB : JCS_GRAYSCALE;
    jpeg_set_defaults(&jpeg);
    jpeg.comp_info[0].h_samp_factor = form->across;
    jpeg.comp_info[0].v_samp_factor = form->down;
    jpeg.optimize_coding = form->optimized;
    if (form->progressive)
        jpeg_simple_progression(&jpeg);
    jpeg_start_compress(&jpeg, TRUE);
    while (jpeg.next_scanline < 64)
        jpeg_write_scanlines(&jpeg, &row, 1);
    jpeg_finish_compress(&jpeg);
    jpeg_destroy_compress(&jpeg);
    free(row);
}

static void forms_that_fit(void **state)
{
    static const struct form forms[] = {
        { 320, 3, 2, 2, false, false, NULL },     { 320, 3, 2, 1, false, false, NULL },
        { 2040, 3, 2, 2, false, false, NULL },    { 2041, 3, 2, 2, false, false, "2040" },
        { 320, 3, 1, 1, false, false, "4:2:0" },  { 320, 1, 1, 1, false, false, "colour" },
        { 320, 3, 2, 2, true, false, "Huffman" }, { 320, 3, 2, 2, false, true, "baseline" },
    };
    char why[96];

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(forms); i++) {
        unsigned long bytes = 0;
        uint8_t *data;
        bool fits;

        encode(&forms[i], &data, &bytes);
        why[0] = 0;
        fits = rtsp_jpeg_fits(data, bytes, why, sizeof(why));
        if (fits != !forms[i].why || (!fits && !strstr(why, forms[i].why)))
            fail_msg("form %zu: %d, \"%s\"", i, fits, why);
        for (unsigned long n = 0; n < 700 && n < bytes; n++) /* damaged ones do no harm */
            (void)rtsp_jpeg_fits(data, n, why, sizeof(why));
        free(data);
    }
    assert_false(rtsp_jpeg_fits((const uint8_t *)"hello", 5, why, sizeof(why)));
}

#endif

int main(int argc, char **argv)
{
#if WITH_RTSP
    if (argc > 1 && !strcmp(argv[1], SST_RTSP_PROCESS))
        return sst_rtsp_process();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(forms_that_fit),
        cmocka_unit_test_setup_teardown(what_is_not_there, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(mjpeg_is_read, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(h264_is_read, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(all_share_one_encoder, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(killed_clients_go, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(still_pictures_are_repeated, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(sizes_that_are_odd, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(without_pictures, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(passwords, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(nobody_waits_for_a_slow_one, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(garbage_and_floods, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(a_view_that_ends, make_pictures, end_pictures),
        cmocka_unit_test_setup_teardown(orders_that_are_odd, make_pictures, end_pictures),
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
