/* tests/link_session.h - head and nodes in one process, over TLS on the loopback; the test makes the sets. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_LINK_SESSION_H
#define SST_TESTS_LINK_SESSION_H

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/link/link_internal.h"
#include "tests/folder.h"
#include "tests/free_port.h"

#define CAMERAS 2
#define PERIOD  INT64_C(200000000) /* of edges by their stamps; they come much faster here */

static int port;
static int queue = 64;
static bool datagrams = true;
static bool still; /* all pictures are the same */

/* --- the head ----------------------------------------------------------------------------------------------------- */

static struct {
    struct sst_link_head *link;
    struct sst_capture *capture;
    struct sst_array_config array;
    pthread_t thread;
    pthread_mutex_t lock;
    uint64_t frames, sets, complete;
    uint64_t wrong; /* frames that are not what the node sent */
} head = { .lock = PTHREAD_MUTEX_INITIALIZER };

/* A frame's bytes say which set and camera it is of. */
static inline size_t make_bytes(uint8_t *out, uint64_t count, int cam)
{
    const size_t bytes = still ? 32 * 16 : 400 + 100 * (size_t)cam;

    for (size_t i = 0; i < bytes; i++)
        out[i] = (uint8_t)((still ? 0 : count * 7) + (uint64_t)cam * 31 + i);
    return bytes;
}

static inline int on_set(void *arg SST_UNUSED, const struct sst_frameset *set)
{
    pthread_mutex_lock(&head.lock);
    head.sets++;
    head.complete += set->present == set->cameras;
    for (int i = 0; i < set->cameras; i++) {
        const struct sst_frame *f = set->frame[i];
        uint8_t want[1024];

        if (!f)
            continue;
        head.frames++;
        head.wrong +=
            f->bytes != make_bytes(want, f->sequence, i / 2) || memcmp(f->data, want, f->bytes) != 0 || f->cam != i;
    }
    pthread_mutex_unlock(&head.lock);
    return 0;
}

static inline void on_host(void *arg, const char *name SST_UNUSED, bool connected, const char *why SST_UNUSED)
{
    int *count = arg;

    pthread_mutex_lock(&head.lock);
    count[connected]++;
    pthread_mutex_unlock(&head.lock);
}

static int seen_by_head[2], seen_by_node[2]; /* ends, begins of connections */

static inline void configure(struct sst_array_config *a, const char *name)
{
    sst_array_config_defaults(a);
    a->rows = 2;
    a->cols = 2;
    a->fourcc = sst_array_format("GREY");
    a->width = 32;
    a->height = 16;
    a->trigger_hz = 1e9 / (double)PERIOD;
    a->hosts.port = port;
    a->hosts.queue = queue;
    a->hosts.datagrams = datagrams;
    a->hosts.skip_unchanged = still;
    strcpy(a->hosts.head, "127.0.0.1");
    strcpy(a->hosts.address, "127.0.0.1");
    snprintf(a->hosts.ca, sizeof(a->hosts.ca), "%s/ca.pem", test_folder);
    snprintf(a->hosts.certificate, sizeof(a->hosts.certificate), "%s/%s.pem", test_folder, name);
    snprintf(a->hosts.key, sizeof(a->hosts.key), "%s/%s.key", test_folder, name);
}

static inline void *run_head(void *arg SST_UNUSED)
{
    assert_int_equal(sst_capture_run(head.capture, 0), 0);
    return NULL;
}

static inline void open_head(void)
{
    const struct sst_capture_events events = { .set = on_set, .quiet = true };
    struct sst_link_head_config cfg = { .array = &head.array, .arg = seen_by_head, .event = on_host };
    struct sst_source source;

    configure(&head.array, "head");
    head.array.role = SST_CONFIG_HEAD;
    head.array.hosts.nodes = 2;
    strcpy(head.array.hosts.node[0], "left");
    strcpy(head.array.hosts.node[1], "right");
    head.sets = head.frames = head.complete = head.wrong = 0;
    assert_int_equal(sst_link_head_open(&head.link, &cfg, &head.array), 0);
    source = sst_link_head_source(head.link);
    assert_int_equal(sst_capture_open_source(&head.capture, &head.array, &source, &events), 0);
    assert_int_equal(pthread_create(&head.thread, NULL, run_head, NULL), 0);
}

static inline void close_head(struct sst_capture_report *report)
{
    sst_capture_stop(head.capture);
    pthread_join(head.thread, NULL);
    if (report)
        sst_capture_report(head.capture, report);
    sst_capture_close(head.capture);
    sst_link_head_close(head.link);
}

static inline struct sst_link_peer peer(int node)
{
    struct sst_link_peer all[SST_NUMBERING_SOURCES];
    const int n = sst_link_head_peers(head.link, all);

    assert_true(node < n);
    for (int i = 0; i < n; i++) {
        json_decref(all[i].reported);
        all[i].reported = NULL;
    }
    return all[node];
}

/* The head knows which cameras of a node are streaming: sets wait for these. */
static inline bool heard(int node)
{
    struct sst_link_peer all[SST_NUMBERING_SOURCES];
    const int n = sst_link_head_peers(head.link, all);
    bool reported = false;

    for (int i = 0; i < n; i++) {
        reported |= i == node && all[i].connected && all[i].reported;
        json_decref(all[i].reported);
    }
    return reported;
}

/* --- nodes -------------------------------------------------------------------------------------------------------- */

struct node {
    struct sst_array_config array;
    struct sst_ring *ring;
    struct sst_link_node *link;
    uint64_t count; /* of edges */
};

static inline void open_node_as(struct node *n, const char *name, const char *certificate, int col)
{
    memset(n, 0, sizeof(*n));
    configure(&n->array, certificate);
    n->array.role = SST_CONFIG_NODE;
    n->array.bound = CAMERAS;
    for (int i = 0; i < CAMERAS; i++) {
        n->array.camera[i] = (struct sst_config_camera){ .row = i, .col = col };
        snprintf(n->array.camera[i].serial, sizeof(n->array.camera[i].serial), "%s%d", name, i);
    }
    assert_int_equal(sst_ring_create(&n->ring, 1 << 20), 0);
    assert_int_equal(sst_link_node_open(&n->link, &(struct sst_link_node_config){ .array = &n->array,
                                                                                  .ring = n->ring,
                                                                                  .arg = seen_by_node,
                                                                                  .event = on_host }),
                     0);
    sst_link_node_cameras(n->link, &n->array);
    for (int i = 0; i < CAMERAS; i++)
        sst_link_node_camera(n->link, i, SST_GRAB_STREAMING, "", NULL);
}

static inline void open_node(struct node *n, const char *name, int col)
{
    open_node_as(n, name, name, col);
}

static inline void close_node(struct node *n)
{
    sst_link_node_close(n->link);
    sst_ring_destroy(n->ring);
}

/* A set of edge `tick`, as capture passes it on. @param missing  a camera without a frame; -1: none */
static inline void capture_set(struct node *n, uint64_t tick, int missing)
{
    static int64_t origin_ns;
    uint8_t bytes[CAMERAS][1024];
    struct sst_frame frame[CAMERAS];
    struct sst_frameset set = { .index = n->count++, .edge = true, .cameras = CAMERAS };

    if (!origin_ns)
        origin_ns = sst_clock_now_ns();
    set.t_ns = origin_ns + (int64_t)tick * PERIOD;
    set.wall_ns = set.t_ns + sst_clock_wall_ns() - sst_clock_now_ns();
    for (int i = 0; i < CAMERAS; i++) {
        frame[i] = (struct sst_frame){ .cam = i,
                                       .fourcc = n->array.fourcc,
                                       .width = 32,
                                       .height = 16,
                                       .stride = 32,
                                       .sequence = (uint32_t)tick,
                                       .t_ns = set.t_ns + 1000 * i,
                                       .arrival_ns = set.t_ns + 5000 };
        frame[i].bytes = make_bytes(bytes[i], tick, i);
        frame[i].data = bytes[i];
        if (i != missing)
            set.frame[i] = &frame[i];
        set.present += i != missing;
    }
    assert_int_equal(sst_ring_put(n->ring, &set), 0);
    sst_link_node_set(n->link, &set);
}

/* --- waiting ------------------------------------------------------------------------------------------------------ */

#define UNTIL(condition)                                                                                               \
    do {                                                                                                               \
        const int64_t end_ns = sst_clock_now_ns() + INT64_C(60000000000);                                              \
        while (!(condition) && sst_clock_now_ns() < end_ns)                                                            \
            usleep(2000);                                                                                              \
        assert_true(condition);                                                                                        \
    } while (0)

static inline struct sst_link_node_state state(const struct node *n)
{
    struct sst_link_node_state s;

    sst_link_node_state(n->link, &s);
    return s;
}

static inline bool all_sent(const struct node *n)
{
    const struct sst_link_node_state s = state(n);

    return s.connected && !s.waiting;
}

static inline uint64_t of_head(const uint64_t *count)
{
    uint64_t n;

    pthread_mutex_lock(&head.lock);
    n = *count;
    pthread_mutex_unlock(&head.lock);
    return n;
}

static inline uint64_t head_frames(void)
{
    return of_head(&head.frames);
}

static uint64_t now_tick; /* edges of a program go on over all its tests */

static inline void both_capture(struct node *a, struct node *b, int sets)
{
    for (int i = 0; i < sets; i++, now_tick++) {
        capture_set(a, now_tick, -1);
        if (b)
            capture_set(b, now_tick, -1);
        usleep(2000);
    }
}

/* A node whose sets go by datagrams, where this build can. */
static inline void open_by_datagrams(struct node *n, const char *name, int col)
{
    open_node(n, name, col);
    UNTIL(state(n).connected && (state(n).datagrams || !sst_pieces_built()));
}

/* --- certificates ------------------------------------------------------------------------------------------------- */

static inline void shell(const char *text)
{
    char command[2048];

    snprintf(command, sizeof(command), "cd '%s' && { %s ; } 2>/dev/null", test_folder, text);
    if (system(command))
        fail_msg("%s", text);
}

static inline int link_set_up(void **state_ SST_UNUSED)
{
    if (test_folder_create(NULL))
        return -1;
    port = free_port();
    sst_log_set_level(SST_LOG_ERROR);
    shell("openssl req -x509 -newkey ed25519 -noenc -keyout ca.key -out ca.pem -days 2 -subj /CN=array; "
          "openssl req -x509 -newkey ed25519 -noenc -keyout stranger.key -out stranger.pem -days 2 -subj /CN=right; "
          "for h in head left right third; do"
          "  openssl req -newkey ed25519 -noenc -keyout $h.key -out $h.csr -subj /CN=$h;"
          "  openssl x509 -req -in $h.csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 -out $h.pem; done");
    return 0;
}

static inline int link_missing(void)
{
    puts("built without GnuTLS: hosts are not connected");
    return 77;
}

/** Of main(): run an array of tests in a folder with the certificates of the hosts. */
#define link_session_run(tests)                                                                                        \
    (WITH_HTTPD ? cmocka_run_group_tests(tests, link_set_up, test_folder_remove) : link_missing())

#endif
