/* tests/http_fake.h - a fake service behind the real HTTP server, and a client that can misbehave. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_HTTP_FAKE_H
#define SST_TESTS_HTTP_FAKE_H

#ifndef _GNU_SOURCE
#define _GNU_SOURCE /* asprintf */
#endif

#include <arpa/inet.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "daemon/publish/http.h"
#include "tests/test.h"

#define DEADLINE_MS 60000

static char folder[64];                         /* of this test; removed at its end */
static SST_UNUSED char control[129], view[129]; /* tokens */
static atomic_int api_calls;
static atomic_int api_sleep_ms;
static const char *fake_state = "capturing";
static struct sst_slot *fake_outlet;
static struct sst_api fake;
static struct sst_counters fake_counters;
static struct sst_http *server;

/* --- the service ------------------------------------------------------------------------------------------------- */

static int fake_answer(struct sst_api_answer *out, const char *what)
{
    const struct timespec t = { .tv_sec = api_sleep_ms / 1000, .tv_nsec = api_sleep_ms % 1000 * 1000000L };

    if (api_sleep_ms)
        nanosleep(&t, NULL);
    api_calls++;
    out->body = json_pack("{s:s, s:s}", "what", what, "state", fake_state);
    return 0;
}

#define FAKE_PLAIN(name)                                                                                               \
    static int fake_##name(void *arg, struct sst_api_answer *out)                                                      \
    {                                                                                                                  \
        (void)arg;                                                                                                     \
        return fake_answer(out, #name);                                                                                \
    }
#define FAKE_BODY(name)                                                                                                \
    static int fake_##name(void *arg, const json_t *body, struct sst_api_answer *out)                                  \
    {                                                                                                                  \
        const json_t *fail = json_object_get(body, "fail");                                                            \
                                                                                                                       \
        (void)arg;                                                                                                     \
        if (!json_is_object(body))                                                                                     \
            abort();                                                                                                   \
        if (!fail)                                                                                                     \
            return fake_answer(out, #name);                                                                            \
        snprintf(out->error, sizeof(out->error), "asked to fail");                                                     \
        return (int)json_integer_value(fail);                                                                          \
    }
FAKE_PLAIN(status)
FAKE_PLAIN(cameras)
FAKE_PLAIN(labels)
FAKE_PLAIN(tracks)
FAKE_PLAIN(views)
FAKE_PLAIN(recordings)
FAKE_PLAIN(cases)
FAKE_PLAIN(push)
FAKE_PLAIN(zones)
FAKE_PLAIN(masks)
FAKE_PLAIN(calibration_check)
FAKE_BODY(record)
FAKE_BODY(zones_change)
FAKE_BODY(snapshot)
FAKE_BODY(export_)
FAKE_BODY(delete_)
FAKE_BODY(case_create)
FAKE_BODY(push_change)
FAKE_BODY(publisher)
FAKE_PLAIN(replay)
FAKE_BODY(replay_change)

static bool fake_plays;

static void *fake_replay_take(void *arg)
{
    return fake_plays ? arg : NULL;
}

static void fake_replay_release(void *arg)
{
    (void)arg;
}

static char fake_client[96]; /* of the last request about a view */

static int fake_view_create(void *arg, const char *client, const json_t *body, struct sst_api_answer *out)
{
    snprintf(fake_client, sizeof(fake_client), "%s", client);
    return fake_record(arg, body, out);
}

static int fake_view_change(void *arg, const char *client, const char *id, const json_t *body,
                            struct sst_api_answer *out)
{
    (void)arg;
    snprintf(fake_client, sizeof(fake_client), "%s", client);
    return strcmp(id, "main") && strcmp(id, "v1") ? -ENOENT : fake_record(NULL, body, out);
}

static int fake_pick(void *arg, const char *id, double x, double y, struct sst_api_answer *out)
{
    (void)arg;
    (void)id;
    out->body = json_pack("{s:f, s:f}", "x", x, "y", y);
    return 0;
}

static int fake_visits(void *arg, const struct sst_visits_query *query, struct sst_api_answer *out)
{
    (void)arg;
    out->body = json_pack("{s:i, s:s?, s:s?, s:s?, s:s?, s:s?, s:s?, s:s?, s:i}", "limit", query->limit, "from",
                          query->from, "to", query->to, "label", query->label, "zone", query->zone, "before",
                          query->before, "after", query->after, "user", query->user, "reviewed", query->reviewed);
    return 0;
}

static int fake_visit_days(void *arg, const struct sst_visits_query *query, int offset_min, struct sst_api_answer *out)
{
    (void)arg;
    out->body = json_pack("{s:s?, s:i}", "from", query->from, "offset_min", offset_min);
    return 0;
}

static int fake_visit_change(void *arg, const char *visit, const char *user, const json_t *body,
                             struct sst_api_answer *out)
{
    (void)arg;
    if (visit && strcmp(visit, "v1") != 0)
        return -ENOENT;
    out->body = json_pack("{s:s, s:O}", "user", user, "body", body);
    return 0;
}

static int fake_visit_picture(void *arg, const char *visit, enum sst_visit_picture kind, uint8_t **data, size_t *size)
{
    (void)arg;
    *data = NULL;
    if (strcmp(visit, "v1"))
        return -ENOENT;
    *data = (uint8_t *)strdup(kind == SST_VISIT_CAMERA ? "camera" : "seen");
    *size = strlen((char *)*data);
    return 0;
}

static int fake_reload(void *arg, bool dry_run, struct sst_api_answer *out)
{
    (void)arg;
    return fake_answer(out, dry_run ? "dry" : "reload");
}

static int fake_case_change(void *arg, const char *name, const json_t *body, struct sst_api_answer *out)
{
    (void)name;
    return fake_delete_(arg, body, out);
}

static int fake_signing_key(void *arg, char **pem)
{
    (void)arg;
    *pem = strdup("-----BEGIN PUBLIC KEY-----\n");
    return 0;
}

static int fake_metrics(void *arg, char **text)
{
    (void)arg;
    *text = strdup("# TYPE sst_sets_total counter\nsst_sets_total 5\n");
    return 0;
}

static int fake_find(void *arg, enum sst_api_picture kind, const char *name, struct sst_slot **out)
{
    (void)arg;
    if ((kind == SST_PICTURE_VIEW && strcmp(name, "main") && strcmp(name, "v1")) ||
        (kind == SST_PICTURE_CAMERA && strcmp(name, "r0c0")))
        return -ENOENT;
    *out = sst_slot_ref(fake_outlet);
    return 0;
}

/* --- downloads: of these names and sizes, byte i is fake_byte(i) --- */

static const struct fake_file {
    const char *name;
    int64_t bytes, given; /* given: the rest cannot be read */
    const char *tag;      /* "": it grows */
    int err;
} fake_files[] = {
    { "picture.jpg", 10, 10, "00000000000000aa", 0 },
    { "empty.mkv", 0, 0, "00000000000000bb", 0 },
    { "big.mkv", 3000000, 3000000, "00000000000000cc", 0 },
    { "growing.mkv", 1000, 1000, "", 0 },
    { "short.mkv", 100000, 70000, "00000000000000dd", 0 },
    { "huge.mkv", 300000000, 300000000, "00000000000000ee", 0 },
    { "gone.mkv", 0, 0, "", -ENOENT },
    { "made.mkv", 0, 0, "", -EINPROGRESS }, /* for ever */
    { "full.mkv", 0, 0, "", -ENOSPC },
    { "torn.mkv", 0, 0, "", -EIO },
    { "busy.tar", 0, 0, "", -EBUSY },
};
static atomic_int fake_open, fake_asked;

static SST_UNUSED uint8_t fake_byte(int64_t i)
{
    return (uint8_t)(i * 7 + i / 251);
}

struct fake_open_file {
    struct sst_download d;
    const struct fake_file *file;
};

static ssize_t fake_read(struct sst_download *d, int64_t at, void *out, size_t n)
{
    const int64_t left = ((struct fake_open_file *)d)->file->given - at;

    for (size_t i = 0; i < n && (int64_t)i < left; i++)
        ((uint8_t *)out)[i] = fake_byte(at + (int64_t)i);
    return left <= 0 ? -EBADMSG : left < (int64_t)n ? (ssize_t)left : (ssize_t)n;
}

static void fake_close(struct sst_download *d)
{
    free(d);
    fake_open--;
}

static int fake_download(void *arg, const char *name, struct sst_download **out)
{
    const struct timespec t = { .tv_nsec = 1000000 };
    struct fake_open_file *o;

    (void)arg;
    fake_asked++;
    for (size_t i = 0; i < ARRAY_LEN(fake_files); i++) {
        const struct fake_file *f = &fake_files[i];

        if (strcmp(name, f->name))
            continue;
        if (f->err) {
            nanosleep(&t, NULL);
            return f->err;
        }
        if (fake_open >= SST_DOWNLOADS_MAX)
            return -EMFILE;
        o = calloc(1, sizeof(*o));
        if (!o)
            abort();
        o->file = f;
        o->d = (struct sst_download){ .bytes = f->bytes, .read = fake_read, .close = fake_close };
        o->d.type = i ? "video/x-matroska" : "image/jpeg";
        strcpy(o->d.tag, f->tag);
        *out = &o->d;
        fake_open++;
        return 0;
    }
    return -ENOENT;
}

/* A picture of this many bytes whose every byte tells its number. */
static SST_UNUSED void show(uint64_t number, size_t bytes)
{
    uint8_t *data = malloc(bytes);
    struct timespec now;

    assert_non_null(data);
    memset(data, (int)(number & 0xff), bytes);
    clock_gettime(CLOCK_REALTIME, &now);
    assert_int_equal(
        sst_slot_put(fake_outlet, data, bytes, number, sst_clock_now_ns(), now.tv_sec * 1000000000LL + now.tv_nsec), 0);
}

/* --- the server ----------------------------------------------------------------------------------------------------
 */

static const char *in_folder(const char *name)
{
    static char paths[8][128];
    static int next;

    next = (next + 1) % 8;
    snprintf(paths[next], sizeof(paths[next]), "%s/%s", folder, name);
    return paths[next];
}

static struct sst_http_config config(void)
{
    static char token_file[128], path[128];

    snprintf(token_file, sizeof(token_file), "%s/token", folder);
    snprintf(path, sizeof(path), "%s/control.sock", folder);
    return (struct sst_http_config){ .socket = path,
                                     .socket_fd = -1,
                                     .address = "127.0.0.1",
                                     .token_file = token_file,
                                     .clients = 64,
                                     .streams = 12,
                                     .api = &fake,
                                     .counters = &fake_counters };
}

static void read_word(const char *path, char *out)
{
    FILE *f = fopen(path, "r");

    assert_non_null(f);
    assert_int_equal(fscanf(f, "%128s", out), 1);
    fclose(f);
}

static SST_UNUSED void serve(const struct sst_http_config *cfg)
{
    sst_counters_init(&fake_counters);
    assert_int_equal(sst_http_open(&server, cfg), 0);
    read_word(in_folder("token"), control);
    read_word(in_folder("token.view"), view);
}

static int make_service(void **state)
{
    (void)state;
    snprintf(folder, sizeof(folder), "/tmp/sst-http-XXXXXX");
    if (!mkdtemp(folder) || sst_events_create(&fake.events, 256) || sst_slot_create(&fake_outlet))
        return -1;
    fake = (struct sst_api){ .status = fake_status,
                             .cameras = fake_cameras,
                             .labels = fake_labels,
                             .tracks = fake_tracks,
                             .visits = fake_visits,
                             .visit_days = fake_visit_days,
                             .visit_change = fake_visit_change,
                             .visit_picture = fake_visit_picture,
                             .metrics = fake_metrics,
                             .views = fake_views,
                             .view_create = fake_view_create,
                             .view_change = fake_view_change,
                             .pick = fake_pick,
                             .view_remove = fake_view_change,
                             .reload = fake_reload,
                             .zones = fake_zones,
                             .masks = fake_masks,
                             .zones_change = fake_zones_change,
                             .record = fake_record,
                             .snapshot = fake_snapshot,
                             .recordings = fake_recordings,
                             .export_ = fake_export_,
                             .delete_ = fake_delete_,
                             .publisher = fake_publisher,
                             .cases = fake_cases,
                             .case_create = fake_case_create,
                             .case_change = fake_case_change,
                             .signing_key = fake_signing_key,
                             .push = fake_push,
                             .push_change = fake_push_change,
                             .calibration_check = fake_calibration_check,
                             .slot = fake_find,
                             .download = fake_download,
                             .replayed = &fake,
                             .replay = fake_replay,
                             .replay_change = fake_replay_change,
                             .replay_take = fake_replay_take,
                             .replay_release = fake_replay_release,
                             .events = fake.events };
    sst_counters_init(&fake_counters);
    fake_state = "capturing";
    api_sleep_ms = 0;
    api_calls = 0;
    return 0;
}

static int end_service(void **state)
{
    static const char *const names[] = { "token",       "token.view",    "token.sessions", "token.named",
                                         "token.audit", "token.audit.1", "control.sock",   "cert.pem",
                                         "key.pem" };

    (void)state;
    sst_http_close(server);
    server = NULL;
    sst_slot_unref(fake_outlet);
    sst_events_shut(fake.events);
    sst_events_destroy(fake.events);
    sst_counters_fini(&fake_counters);
    for (size_t i = 0; i < ARRAY_LEN(names); i++)
        unlink(in_folder(names[i]));
    return rmdir(folder);
}

/* --- the client ----------------------------------------------------------------------------------------------------
 */

static SST_UNUSED int connect_tcp(void)
{
    struct sockaddr_in at = { .sin_family = AF_INET, .sin_port = htons((uint16_t)sst_http_port(server)) };
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_true(fd >= 0);
    if (connect(fd, (struct sockaddr *)&at, sizeof(at))) {
        close(fd);
        return -1;
    }
    return fd;
}

static SST_UNUSED int connect_local(const char *path)
{
    struct sockaddr_un at = { .sun_family = AF_UNIX };
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);

    snprintf(at.sun_path, sizeof(at.sun_path), "%s", path);
    if (fd >= 0 && connect(fd, (struct sockaddr *)&at, sizeof(at))) {
        close(fd);
        return -1;
    }
    return fd;
}

static SST_UNUSED bool send_all(int fd, const char *data, size_t bytes)
{
    while (bytes) {
        const ssize_t n = send(fd, data, bytes, MSG_NOSIGNAL);

        if (n <= 0)
            return false;
        data += n;
        bytes -= (size_t)n;
    }
    return true;
}

/* All that comes until the end, or `max`. @return bytes; text ends with NUL */
static SST_UNUSED size_t receive(int fd, char *text, size_t max)
{
    size_t have = 0;
    ssize_t n;

    while (have + 1 < max && (n = recv(fd, text + have, max - 1 - have, 0)) > 0)
        have += (size_t)n;
    text[have] = 0;
    return have;
}

static char answer[1 << 18]; /* of the last request, head and body */

/* One request on a connection of its own, closed afterwards. `more`: headers, each with \r\n. @return status; 0: none
 */
static SST_UNUSED int ask_on(int fd, const char *method, const char *target, const char *more, const char *body)
{
    char *text = NULL;
    int n, status = 0;

    answer[0] = 0;
    if (fd < 0)
        return 0;
    n = body ? asprintf(&text, "%s %s HTTP/1.1\r\n%s%sConnection: close\r\nContent-Length: %zu\r\n\r\n%s", method,
                        target, strstr(more, "Host:") ? "" : "Host: localhost\r\n", more, strlen(body), body)
             : asprintf(&text, "%s %s HTTP/1.1\r\n%s%sConnection: close\r\n\r\n", method, target,
                        strstr(more, "Host:") ? "" : "Host: localhost\r\n", more);
    assert_true(n > 0);
    send_all(fd, text, (size_t)n); /* what is refused early need not take it all */
    free(text);
    receive(fd, answer, sizeof(answer));
    close(fd);
    return sscanf(answer, "HTTP/1.%*d %d", &status) == 1 ? status : 0;
}

static SST_UNUSED int ask(const char *method, const char *target, const char *more, const char *body)
{
    return ask_on(connect_tcp(), method, target, more, body);
}

/* "Authorization: Bearer ...\r\n" */
static SST_UNUSED const char *bearer(const char *token)
{
    static _Thread_local char text[256];

    snprintf(text, sizeof(text), "Authorization: Bearer %s\r\n", token);
    return text;
}

static SST_NOINLINE SST_UNUSED const char *with(const char *a, const char *b)
{
    static char text[4][1024];
    static int next;

    next = (next + 1) % 4;
    snprintf(text[next], sizeof(text[next]), "%s%s", a, b);
    return text[next];
}

#define JSON "Content-Type: application/json\r\n"

/* The path of a route with its {part} filled in. */
static SST_UNUSED const char *example(const struct sst_route *route)
{
    static char path[256];
    const char *open = strchr(route->path, '{');
    const char *part;

    if (!open)
        return route->path;
    part = !strncmp(open, "{file}", 6)     ? "index.html"
           : !strncmp(open, "{camera}", 8) ? "r0c0"
           : !strncmp(open, "{name}", 6)   ? "picture.jpg"
                                           : "v1";
    snprintf(path, sizeof(path), "%.*s%s%s", (int)(open - route->path), route->path, part, strchr(open, '}') + 1);
    return path;
}

static SST_UNUSED int count_entries(const char *path)
{
    DIR *d = opendir(path);
    int n = 0;

    if (!d)
        return -1;
    while (readdir(d))
        n++;
    closedir(d);
    return n;
}

static SST_UNUSED void sleep_ms(int ms)
{
    const struct timespec t = { .tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000L };

    nanosleep(&t, NULL);
}

#define http_tests(tests) (WITH_HTTPD ? cmocka_run_group_tests(tests, NULL, NULL) : no_http())

static SST_UNUSED int no_http(void)
{
    puts("this build has no HTTP server");
    return 77;
}

#endif
