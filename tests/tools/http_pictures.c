/* A server that shows made-up pictures: http_pictures FOLDER VIEWERS SECONDS HZ BYTES; tells its port, waits for
 * its viewers, and prints its costs at its end: "cpu PERCENT, PICTURES pictures, SKIPPED skipped". */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "daemon/publish/http.h"

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
    (void)name;
    *out = sst_slot_ref(slot);
    return 0;
}

static int give_nothing(void *arg, struct sst_api_answer *out)
{
    (void)arg;
    (void)out;
    return -ENOTSUP;
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

/* A machine that stood still does not show all that it has missed at once. */
static int show_all(double seconds, double hz, size_t bytes)
{
    const int64_t period_ns = (int64_t)(1e9 / hz);
    const struct timespec period = { .tv_sec = period_ns / 1000000000, .tv_nsec = period_ns % 1000000000 };
    const int pictures = (int)(seconds * hz);
    uint8_t *data;

    for (int i = 1; i <= pictures; i++) {
        data = malloc(bytes);
        if (!data)
            return -ENOMEM;
        memset(data, i, bytes);
        if (sst_slot_put(slot, data, bytes, (uint64_t)i, sst_clock_now_ns(), 0))
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
                           .view_create = make_nothing,
                           .reload = take_nothing,
                           .slot = give_outlet };
    struct sst_counters c;
    struct sst_http_config cfg = {
        .socket_fd = -1, .address = "127.0.0.1", .clients = 64, .streams = 32, .api = &api, .counters = &c
    };
    struct sst_http *http;
    char token_file[512];
    int64_t cpu_ns, start_ns;

    sst_counters_init(&c);
    if (argc != 6 || sst_slot_create(&slot) || sst_events_create(&api.events, 16))
        return 1;
    snprintf(token_file, sizeof(token_file), "%s/token", argv[1]);
    cfg.token_file = token_file;
    if (sst_http_open(&http, &cfg))
        return 1;
    printf("%d\n", sst_http_port(http));
    fflush(stdout);
    while (sst_slot_clients(slot) < atoi(argv[2]))
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
