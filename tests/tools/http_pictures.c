/* A server that shows made-up pictures: http_pictures FOLDER VIEWERS SECONDS HZ BYTES; tells its port, waits for
 * its viewers, and prints its costs at its end: "cpu PERCENT, PICTURES pictures, SKIPPED skipped". BYTES 0: JPEGs with a square
 * that walks, half as wide while FOLDER/small exists, of an hour ago while FOLDER/past does. With FOLDER/cert.pem and key.pem over TLS; SIGTERM ends it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "daemon/publish/http.h"
#include "pipeline/image/codec.h"

static struct sst_slot *slot;

static int give_status(void *arg, struct sst_api_answer *out)
{
    (void)arg;
    out->body = json_pack("{s:s}", "state", "capturing");
    return 0;
}

static int give_outlet(void *arg, enum sst_api_picture kind, const char *name, struct sst_slot **out)
{
    (void)arg;
    (void)kind;
    if (!strcmp(name, "none"))
        return -ENOENT;
    *out = sst_slot_ref(slot);
    return 0;
}

static int give_nothing(void *arg, struct sst_api_answer *out)
{
    (void)arg;
    (void)out;
    return -ENOTSUP;
}

static int find_nothing(void *arg, const struct sst_visits_query *query, struct sst_api_answer *out)
{
    (void)query;
    return give_nothing(arg, out);
}

static int take_nothing(void *arg, bool dry_run, struct sst_api_answer *out)
{
    (void)dry_run;
    return give_nothing(arg, out);
}

static int make_nothing(void *arg, const char *client, const json_t *settings, struct sst_api_answer *out)
{
    (void)client;
    (void)settings;
    return give_nothing(arg, out);
}

static const char *folder;
static volatile sig_atomic_t ended;

static void end(int number)
{
    (void)number;
    ended = 1;
}

static const char *file(char *path, const char *name)
{
    snprintf(path, 600, "%s/%s", folder, name);
    return path;
}

static int draw(int number, uint8_t **data, size_t *bytes)
{
    char path[600];
    const int width = access(file(path, "small"), F_OK) ? 320 : 160, left = 8 * number % (width - 48);
    struct sst_image image;
    int err = sst_image_init(&image, width, 240);

    if (err)
        return err;
    for (int y = 0; y < 240; y++)
        for (int x = 0; x < width; x++)
            for (int c = 0; c < 3; c++)
                image.plane[c][(size_t)y * image.stride + (size_t)x] =
                    (uint8_t)(x >= left && x < left + 48 && y >= 48 && y < 96 ? 60 * c + 120 : (x + y) / 3);
    err = sst_image_encode_jpeg(&image, 90, data, bytes);
    sst_image_fini(&image);
    return err;
}

/* A machine that stood still does not show all that it has missed at once. */
static int show_all(double seconds, double hz, size_t bytes)
{
    const int64_t period_ns = (int64_t)(1e9 / hz);
    const struct timespec period = { .tv_sec = period_ns / 1000000000, .tv_nsec = period_ns % 1000000000 };
    const int pictures = (int)(seconds * hz);
    uint8_t *data;

    for (int i = 1; i <= pictures && !ended; i++) {
        size_t size = bytes;
        int64_t wall_ns = bytes ? 0 : sst_clock_wall_ns();
        char path[600];

        data = bytes ? malloc(bytes) : NULL;
        if (data)
            memset(data, i, bytes);
        else if (bytes || draw(i, &data, &size))
            return -ENOMEM;
        wall_ns -= wall_ns && !access(file(path, "past"), F_OK) ? INT64_C(3600000000000) : 0;
        if (sst_slot_put(slot, data, size, (uint64_t)i, sst_clock_now_ns(), wall_ns))
            return -ENOMEM;
        nanosleep(&period, NULL);
    }
    return 0;
}

int main(int argc, char **argv)
{
    struct sst_api api = { .status = give_status,
                           .cameras = give_nothing,
                           .labels = give_nothing,
                           .views = give_nothing,
                           .recordings = give_nothing,
                           .tracks = give_nothing,
                           .zones = give_nothing,
                           .cases = give_nothing,
                           .push = give_nothing,
                           .replay = give_nothing,
                           .visits = find_nothing,
                           .view_create = make_nothing,
                           .reload = take_nothing,
                           .slot = give_outlet };
    struct sst_counters c;
    struct sst_http_config cfg = {
        .socket_fd = -1, .address = "127.0.0.1", .clients = 64, .streams = 32, .api = &api, .counters = &c
    };
    struct sst_http *http;
    char token_file[600], certificate[600], key[600];
    int64_t cpu_ns, start_ns;

    sst_counters_init(&c);
    if (argc != 6 || sst_slot_create(&slot) || sst_events_create(&api.events, 16))
        return 1;
    folder = argv[1];
    signal(SIGTERM, end);
    cfg.token_file = file(token_file, "token");
    if (!access(file(certificate, "cert.pem"), F_OK)) {
        cfg.tls_certificate = certificate;
        cfg.tls_key = file(key, "key.pem");
    }
    if (sst_http_open(&http, &cfg))
        return 1;
    printf("%d\n", sst_http_port(http));
    fflush(stdout);
    while (sst_slot_clients(slot) < atoi(argv[2]) && !ended)
        nanosleep(&(struct timespec){ .tv_nsec = 10000000 }, NULL);
    cpu_ns = sst_clock_cpu_ns();
    start_ns = sst_clock_now_ns();
    if (show_all(atof(argv[3]), atof(argv[4]), (size_t)atol(argv[5])))
        return 1;
    printf("cpu %.1f, %d pictures, %llu skipped\n",
           100.0 * (double)(sst_clock_cpu_ns() - cpu_ns) / (double)(sst_clock_now_ns() - start_ns),
           (int)(atof(argv[3]) * atof(argv[4])), (unsigned long long)c.skipped);
    sst_slot_shut(slot);
    sst_http_close(http);
    sst_slot_unref(slot);
    sst_events_shut(api.events);
    sst_events_destroy(api.events);
    return 0;
}
