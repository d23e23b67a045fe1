/* sst-rtsp: serves the pictures of the service as RTSP streams. It receives them over the service's HTTP API, reports
 * its clients there, and starts itself again when the rtsp section of the configuration has changed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "publishers/rtsp/rtsp_internal.h"

#include <stdlib.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/thread.h"
#include "publishers/server.h"

static struct sst_server server;
static struct rtsp_server rtsp;
static struct sst_login login = { .report = sst_server_report_refused, .arg = &server };

void rtsp_report_clients(int clients)
{
    sst_server_report_clients(&server, clients);
}

static int open_server(struct sst_server *s)
{
    const struct sst_config *c = &s->config;
    int fd, err = rtsp_load_plugins(c->rtsp.codec);

    err = err ? err : sst_login_read(&login, "rtsp", c->rtsp.user, c->rtsp.password_file);
    if (err)
        return err;
    fd = sst_login_listen("rtsp", c->rtsp.address, c->rtsp.port);
    return fd < 0 ? fd : rtsp_server_open(&rtsp, c->rtsp.codec, &login, fd);
}

static void *serve(void *arg)
{
    struct sst_server *s = arg;

    sst_thread_name("rtsp-server");
    if (sst_server_open(s, open_server))
        rtsp_server_run(&rtsp, &s->stop);
    return NULL;
}

int main(int argc, char **argv)
{
    static const char *const sections[] = { "rtsp.", "control.socket", NULL };
    int64_t until_ns;
    int done;

    server.publisher = (struct sst_publisher){
        .name = "rtsp",
        .program = "sst-rtsp",
        .help = SST_PUBLISHER_HELP("sst-rtsp", "Serves the pictures of sstd to video recorders as RTSP streams.")
    };
    server.sections = sections;
    done = sst_server_begin(&server, argc, argv);
    if (done != SST_PROGRAM_GO_ON)
        return done;
    rtsp_pictures_init(&server.publisher.service);
    if (sst_server_start(&server, server.config.rtsp.enabled, serve))
        return EXIT_FAILURE;
    sst_server_wait(&server);
    /* Viewers are hung up on, pipelines and streams end, and then the process: not under threads that still work. */
    until_ns = sst_clock_now_ns() + SST_PUBLISHER_STOP_NS;
    if (!rtsp_pictures_end(until_ns))
        _exit(EXIT_SUCCESS); /* the service hangs */
    sst_publisher_end(&server.publisher, until_ns);
}
