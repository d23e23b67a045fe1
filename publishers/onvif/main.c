/* sst-onvif: offers the stream of sst-rtsp as an ONVIF camera: discovery, profiles, addresses, snapshots, events. It starts
 * itself again when its part of the configuration has changed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "publishers/onvif/onvif_internal.h"

static struct sst_server server;
static struct sst_login login = { .report = sst_server_report_refused, .arg = &server };

/* Zones are asked of the service: they may have been drawn on its page. */
static void on_connected(void *arg SST_UNUSED, bool connected)
{
    json_t *zones = NULL;

    picture_connected(connected);
    if (!connected)
        events_disconnected();
    else if (!sst_publisher_ask(&server.publisher, "/api/v1/zones", NULL, &zones, NULL))
        events_zones(zones);
    json_decref(zones);
}

static void on_event(void *arg, const json_t *event)
{
    const char *type = json_string_value(json_object_get(event, "type"));

    if (type && !strcmp(type, "reload"))
        on_connected(arg, true);
    else
        events_on_event(event);
}

static int open_server(struct sst_server *s)
{
    const struct sst_config *c = &s->config;
    const bool own = c->onvif.user[0];
    int fd, err = sst_login_read(&login, own ? "onvif" : "rtsp", own ? c->onvif.user : c->rtsp.user,
                                 own ? c->onvif.password_file : c->rtsp.password_file);

    login.section = "onvif";
    err = err ? err : sst_login_open(&login);
    err = err ? err : answers_init(c, login.user);
    if (err)
        return err;
    fd = sst_login_listen("onvif", c->onvif.address, c->onvif.port);
    return fd < 0 ? fd : http_start(s, &login, fd);
}

static void *serve(void *arg)
{
    struct sst_server *s = arg;

    sst_thread_name("onvif-server");
    if (!sst_server_open(s, open_server))
        return NULL;
    if (s->config.onvif.discovery)
        discovery_run(s);
    while (!atomic_load(&s->stop))
        nanosleep(&(struct timespec){ .tv_sec = 1 }, NULL);
    http_stop();
    return NULL;
}

int main(int argc, char **argv)
{
    static const char *const sections[] = { "onvif.",  "rtsp.",          "array.", "cameras.",
                                            "live.rate_hz", "control.socket", NULL };
    int done;

    server.publisher = (struct sst_publisher){
        .name = "onvif",
        .program = "sst-onvif",
        .help = SST_PUBLISHER_HELP("sst-onvif", "Offers the RTSP stream of sstd to video recorders as an ONVIF camera.")
    };
    server.sections = sections;
    server.connected = on_connected;
    server.event = on_event;
    done = sst_server_begin(&server, argc, argv);
    if (done != SST_PROGRAM_GO_ON)
        return done;
    picture_init(&server);
    events_init(&server);
    if (sst_server_start(&server, server.config.onvif.enabled, serve) ||
        (server.config.onvif.enabled && sst_publisher_start(&server.publisher, picture_run, &server)))
        return EXIT_FAILURE;
    sst_server_wait(&server);
    events_stop();
    sst_publisher_end(&server.publisher, sst_clock_now_ns() + SST_PUBLISHER_STOP_NS);
}
