/* capture/link: a node and a head in one process, over TLS on the loopback: sets arrive, each frame ends in one place.
 */
#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/link/link_internal.h"
#include "tests/folder.h"
#include "tests/test.h"

#define CAMERAS 2
#define PORT    (21000 + getpid() % 1000) /* below those that the system gives */
#define PERIOD  INT64_C(200000000)        /* of edges by their stamps; they come much faster here */

static char certificates[64];
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
    int lost, found;
} head = { .lock = PTHREAD_MUTEX_INITIALIZER };

/* A frame's bytes say which set and camera it is of. */
static size_t make_bytes(uint8_t *out, uint64_t count, int cam)
{
    const size_t bytes = still ? 32 * 16 : 400 + 100 * (size_t)cam;

    for (size_t i = 0; i < bytes; i++)
        out[i] = (uint8_t)((still ? 0 : count * 7) + (uint64_t)cam * 31 + i);
    return bytes;
}

static int on_set(void *arg SST_UNUSED, const struct sst_frameset *set)
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

static void on_host(void *arg, const char *name SST_UNUSED, bool connected, const char *why SST_UNUSED)
{
    int *count = arg;

    pthread_mutex_lock(&head.lock);
    count[connected]++;
    pthread_mutex_unlock(&head.lock);
}

static int seen_by_head[2], seen_by_node[2]; /* ends, begins of connections */

static void configure(struct sst_array_config *a, const char *name)
{
    sst_array_config_defaults(a);
    a->rows = 2;
    a->cols = 2;
    a->fourcc = sst_array_format("GREY");
    a->width = 32;
    a->height = 16;
    a->trigger_hz = 1e9 / (double)PERIOD;
    a->hosts.port = PORT;
    a->hosts.queue = queue;
    a->hosts.datagrams = datagrams;
    a->hosts.skip_unchanged = still;
    strcpy(a->hosts.head, "127.0.0.1");
    strcpy(a->hosts.address, "127.0.0.1");
    snprintf(a->hosts.ca, sizeof(a->hosts.ca), "%s/ca.pem", certificates);
    snprintf(a->hosts.certificate, sizeof(a->hosts.certificate), "%s/%s.pem", certificates, name);
    snprintf(a->hosts.key, sizeof(a->hosts.key), "%s/%s.key", certificates, name);
}

static void *run_head(void *arg SST_UNUSED)
{
    assert_int_equal(sst_capture_run(head.capture, 0), 0);
    return NULL;
}

static void open_head(void)
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

static void close_head(struct sst_capture_report *report)
{
    sst_capture_stop(head.capture);
    pthread_join(head.thread, NULL);
    if (report)
        sst_capture_report(head.capture, report);
    sst_capture_close(head.capture);
    sst_link_head_close(head.link);
}

static struct sst_link_peer peer(int node)
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
static bool heard(int node)
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

static void open_node_as(struct node *n, const char *name, const char *certificate, int col)
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

static void open_node(struct node *n, const char *name, int col)
{
    open_node_as(n, name, name, col);
}

static void close_node(struct node *n)
{
    sst_link_node_close(n->link);
    sst_ring_destroy(n->ring);
}

/* A set of edge `tick`, as capture passes it on. @param missing  a camera without a frame; -1: none */
static void capture_set(struct node *n, uint64_t tick, int missing)
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

static struct sst_link_node_state state(const struct node *n)
{
    struct sst_link_node_state s;

    sst_link_node_state(n->link, &s);
    return s;
}

static bool all_sent(const struct node *n)
{
    const struct sst_link_node_state s = state(n);

    return s.connected && !s.waiting;
}

static uint64_t of_head(const uint64_t *count)
{
    uint64_t n;

    pthread_mutex_lock(&head.lock);
    n = *count;
    pthread_mutex_unlock(&head.lock);
    return n;
}

static uint64_t head_frames(void)
{
    return of_head(&head.frames);
}

/* --- tests -------------------------------------------------------------------------------------------------------- */

static uint64_t now_tick; /* edges of this program go on over all tests */

static void both_capture(struct node *a, struct node *b, int sets)
{
    for (int i = 0; i < sets; i++, now_tick++) {
        capture_set(a, now_tick, -1);
        if (b)
            capture_set(b, now_tick, -1);
        usleep(2000);
    }
}

static void sets_of_two_nodes_become_one(void **state_ SST_UNUSED)
{
    struct node left, right;
    struct sst_capture_report report;

    open_head();
    open_node(&left, "left", 0);
    open_node(&right, "right", 1);
    right.count = 1000; /* it has counted for longer */
    UNTIL(state(&left).connected && state(&right).connected && heard(0) && heard(1));
    both_capture(&left, &right, 30);
    UNTIL(all_sent(&left) && all_sent(&right) && head_frames() == state(&left).frames + state(&right).frames);
    assert_int_equal(peer(0).frames, 60);
    assert_int_equal(peer(1).frames, 60);
    assert_int_equal(peer(0).numbering.slips + peer(1).numbering.slips, 0);
    /* A camera that has no frame is not waited for. */
    capture_set(&left, now_tick, 1);
    capture_set(&right, now_tick++, -1);
    UNTIL(head_frames() == 123 && all_sent(&left) && all_sent(&right));
    for (int i = 0; i < 2; i++) {
        assert_int_equal(peer(i).unexplained, 0);
        assert_int_equal(peer(i).frames, peer(i).passed);
    }
    assert_int_equal(state(&left).bucket[SST_LINK_SENT], 61);
    assert_int_equal(state(&left).unexplained, 0);
    close_node(&left);
    close_node(&right);
    close_head(&report);
    assert_int_equal(head.wrong, 0);
    assert_int_equal(head.complete, 30);
    assert_int_equal(report.unexplained, 0);
    assert_int_equal(report.sets.bucket[SST_BUCKET_SET], 123);
}

/* What was sent and not confirmed when a connection ends is told apart when it is back: the sums of both sides agree.
 */
static void a_head_that_is_away_costs_a_gap_that_is_counted(void **state_ SST_UNUSED)
{
    struct node left, right;
    uint64_t received;

    queue = 4;
    open_head();
    open_node(&left, "left", 0);
    open_node(&right, "right", 1);
    queue = 64;
    UNTIL(state(&left).connected && state(&right).connected && heard(0) && heard(1));
    for (int i = 0; i < 10; i++) {
        both_capture(&left, &right, 1);
        UNTIL(all_sent(&left) && all_sent(&right));
    }
    received = peer(0).frames;
    close_head(NULL);
    UNTIL(!state(&left).connected && !state(&right).connected);
    both_capture(&left, &right, 20); /* the queue holds 4 */
    assert_int_equal(state(&left).waiting, 4 * CAMERAS);
    assert_int_equal(state(&left).bucket[SST_LINK_AWAY] + state(&left).bucket[SST_LINK_DROPPED], 16 * CAMERAS);
    open_head();
    UNTIL(state(&left).connected && state(&right).connected && heard(0) && heard(1));
    both_capture(&left, &right, 10);
    UNTIL(all_sent(&left) && all_sent(&right));
    received += peer(0).frames;
    assert_int_equal(received, state(&left).bucket[SST_LINK_SENT]);
    assert_int_equal(state(&left).unexplained + state(&right).unexplained, 0);
    assert_int_equal(state(&left).frames, 40 * CAMERAS);
    assert_int_equal(state(&left).connections, 2);
    close_node(&left);
    close_node(&right);
    close_head(NULL);
    assert_int_equal(head.wrong, 0);
}

static void a_node_that_missed_an_edge_is_put_right(void **state_ SST_UNUSED)
{
    struct node left, right;

    open_head();
    open_node(&left, "left", 0);
    open_node(&right, "right", 1);
    UNTIL(state(&left).connected && state(&right).connected && heard(0) && heard(1));
    for (int i = 0; i < 30; i++, now_tick++) {
        capture_set(&left, now_tick, -1);
        if (i != 12 && i != 20)
            capture_set(&right, now_tick, -1);
        UNTIL(all_sent(&left) && all_sent(&right));
    }
    UNTIL(peer(1).numbering.slips == 2 && head_frames() == 116);
    assert_int_equal(peer(0).numbering.slips, 0);
    close_node(&left);
    close_node(&right);
    close_head(NULL);
    assert_int_equal(head.wrong, 0);
    assert_int_equal(head.complete, 28);
}

static const char *refusal(const struct node *n)
{
    static char text[256];
    const struct sst_link_node_state s = state(n);

    memcpy(text, s.reason, sizeof(text));
    return text;
}

/* Pictures in which nothing changes are named, not sent; the head takes their bytes from before. */
static void unchanged_pictures_are_not_sent(void **state_ SST_UNUSED)
{
    struct node left, right;
    uint64_t bytes;

    still = true;
    open_head();
    open_node(&left, "left", 0);
    open_node(&right, "right", 1);
    UNTIL(state(&left).connected && state(&right).connected && heard(0) && heard(1));
    both_capture(&left, &right, 10);
    UNTIL(all_sent(&left) && all_sent(&right));
    bytes = state(&left).sent_bytes;
    both_capture(&left, &right, 20);
    UNTIL(all_sent(&left) && all_sent(&right) && head_frames() == 120);
    assert_true(state(&left).bucket[SST_LINK_UNCHANGED] >= 40);
    assert_int_equal(state(&left).bucket[SST_LINK_SENT] + state(&left).bucket[SST_LINK_UNCHANGED], 60);
    assert_int_equal(peer(0).unchanged, state(&left).bucket[SST_LINK_UNCHANGED]);
    assert_true(state(&left).sent_bytes - bytes < 20 * CAMERAS * 300); /* 512 bytes each else */
    close_node(&left);
    close_node(&right);
    close_head(NULL);
    still = false;
    assert_int_equal(head.wrong, 0);
    assert_int_equal(head.complete, 30);
}

/* A node whose sets go by datagrams, where this build can. */
static void open_by_datagrams(struct node *n, const char *name, int col)
{
    open_node(n, name, col);
    UNTIL(state(n).connected && (state(n).datagrams || !WITH_ISAL));
}

static void sets_go_by_datagrams(void **state_ SST_UNUSED)
{
    struct node left, right;
    struct sst_link_peer p;

    open_head();
    open_by_datagrams(&left, "left", 0);
    open_by_datagrams(&right, "right", 1);
    for (int i = 0; i < 40; i++) { /* one by one, as an array does */
        both_capture(&left, &right, 1);
        UNTIL(all_sent(&left) && all_sent(&right));
    }
    /* On a busy machine a part may come later than its set is waited for. */
    UNTIL(of_head(&head.sets) == 40 && head_frames() >= 150);
    p = peer(0);
    assert_int_equal(state(&left).bucket[SST_LINK_SENT], 80);
    if (WITH_ISAL) {
        assert_int_equal(state(&left).datagrams_reason[0], 0);
        assert_true(p.datagrams >= 40 && state(&left).sent_datagrams >= 40);
        assert_int_equal(p.refused + p.missed + p.missed_sets, 0);
    }
    close_node(&left);
    close_node(&right);
    close_head(NULL);
    assert_int_equal(head.wrong, 0);
    assert_true(head.complete >= 35);
}

/* Either side may do without datagrams: pictures come over TLS, and the node says why. */
static void without_datagrams_sets_go_over_tls(void **state_ SST_UNUSED)
{
    struct node left, right;

    datagrams = false;
    open_head();
    open_node(&left, "left", 0);
    datagrams = true;
    open_node(&right, "right", 1);
    UNTIL(state(&left).connected && state(&right).connected && heard(0) && heard(1));
    both_capture(&left, &right, 20);
    UNTIL(all_sent(&left) && all_sent(&right) && head_frames() == 80);
    assert_false(state(&left).datagrams || state(&right).datagrams);
    assert_string_equal(state(&left).datagrams_reason, "hosts: datagrams is false");
    assert_contains(state(&right).datagrams_reason, WITH_ISAL ? "the head takes no datagrams" : "built without ISA-L");
    close_node(&left);
    close_node(&right);
    close_head(NULL);
    assert_int_equal(head.wrong, 0);
}

static struct link_credentials *credentials_of(const char *name)
{
    struct sst_array_config a;
    struct link_credentials *c;

    configure(&a, name);
    assert_int_equal(link_credentials_create(&c, &a), 0);
    return c;
}

#if WITH_ISAL

/* @return it has shaken hands; false: it was refused, or a second went by */
static bool shake_hands(struct link_dtls **d, struct link_credentials *c)
{
    const int64_t end_ns = sst_clock_now_ns() + INT64_C(1000000000);
    char why[256] = "";
    int err;

    assert_int_equal(link_dtls_open(d, "127.0.0.1", PORT, c), 0);
    while (!(err = link_dtls_work(*d, why)) && !link_dtls_ready(*d) && sst_clock_now_ns() < end_ns)
        usleep(2000);
    return !err && link_dtls_ready(*d);
}

/* Datagrams of anybody at the head's port, of hosts that are not of the array, and of a node in the name of another
 * one: sets of the others go on. */
static void datagrams_of_others_do_no_harm(void **state_ SST_UNUSED)
{
    struct link_credentials *third = credentials_of("third"), *stranger = credentials_of("stranger"),
                            *right = credentials_of("right");
    uint8_t bytes[SST_PIECE_HEAD + SST_PIECE_BYTES];
    struct link_dtls *d = NULL;
    bool shaken = false;
    struct sockaddr_storage to;
    struct node left, other;
    unsigned size;
    int fd;

    open_head();
    open_by_datagrams(&left, "left", 0);
    /* Noise, and things that begin like a ClientHello. */
    assert_int_equal(link_address("127.0.0.1", PORT, &to, &size), 0);
    fd = socket(AF_INET, SOCK_DGRAM, 0);
    assert_true(fd >= 0);
    srand(1);
    for (int i = 0; i < 2000; i++) {
        for (size_t k = 0; k < sizeof(bytes); k++)
            bytes[k] = (uint8_t)rand();
        if (i % 2) {
            const uint8_t hello[14] = { 22, 254, 253, 0, 0, 0, 0, 0, 0, 0, 0, (uint8_t)(i % 3), 100, 1 };

            memcpy(bytes, hello, sizeof(hello));
        }
        (void)sendto(fd, bytes, (size_t)(rand() % (int)sizeof(bytes)), 0, (const struct sockaddr *)&to, size);
    }
    close(fd);
    both_capture(&left, NULL, 3);
    UNTIL(all_sent(&left) && head_frames() == 6);
    /* A certificate of another authority, and one that is not of the list: the head takes no datagram of either. */
    memset(bytes, 0, sizeof(bytes));
    sst_piece_put(bytes, &(struct sst_piece){ .session = 1, .seq = 4, .bytes = 100, .index = 0, .parity = 2 });
    for (int i = 0; i < 2; i++) {
        if (shake_hands(&d, i ? third : stranger) && link_dtls_send(d, bytes, SST_PIECE_HEAD + 100)) {
            /* refused: as it should be */
        }
        link_dtls_close(d);
    }
    /* A node of the list, with numbers that are not of its connection. */
    open_by_datagrams(&other, "right", 1);
    for (int i = 0; i < 30 && !shaken; i++) { /* a machine with much else to do takes longer than a second */
        shaken = shake_hands(&d, right);
        if (!shaken)
            link_dtls_close(d);
    }
    assert_true(shaken);
    for (int i = 0; i < 50; i++)
        assert_int_equal(link_dtls_send(d, bytes, sizeof(bytes)), 0);
    UNTIL(peer(1).refused == 50);
    assert_int_equal(peer(0).refused, 0);
    link_dtls_close(d);
    both_capture(&left, &other, 10);
    /* On a busy machine a part may come later than its set is waited for. */
    UNTIL(all_sent(&left) && all_sent(&other) && of_head(&head.sets) == 13 && head_frames() >= 42);
    assert_int_equal(state(&left).connections, 1);
    close_node(&left);
    close_node(&other);
    close_head(NULL);
    assert_int_equal(head.wrong, 0);
    link_credentials_destroy(third);
    link_credentials_destroy(stranger);
    link_credentials_destroy(right);
}

#endif

/* The trigger rests: the connection stays. */
static void silence_of_the_trigger_ends_nothing(void **state_ SST_UNUSED)
{
    struct node left;

    open_head();
    open_node(&left, "left", 0);
    UNTIL(state(&left).connected);
    both_capture(&left, NULL, 3);
    usleep(3600000);
    assert_true(state(&left).connected);
    assert_int_equal(state(&left).connections, 1);
    assert_int_equal(peer(0).connections, 1);
    close_node(&left);
    close_head(NULL);
}

static void who_is_not_of_the_array_is_refused(void **state_ SST_UNUSED)
{
    struct node left, other;

    open_head();
    open_node(&left, "left", 0);
    UNTIL(state(&left).connected);
    open_node_as(&other, "right", "stranger", 1); /* signed by another authority */
    UNTIL(refusal(&other)[0]);
    assert_false(state(&other).connected);
    close_node(&other);
    open_node_as(&other, "third", "third", 1); /* signed, and not in the head's list */
    UNTIL(strstr(refusal(&other), "not among the head's hosts: nodes"));
    close_node(&other);
    open_node(&other, "right", 0); /* cameras where there are some */
    UNTIL(strstr(refusal(&other), "has a camera of left already"));
    close_node(&other);
    open_node(&other, "right", 2);
    UNTIL(strstr(refusal(&other), "outside the grid of 2x2"));
    close_node(&other);
    assert_true(state(&left).connected);
    close_node(&left);
    close_head(NULL);
}

/* --- strangers ---------------------------------------------------------------------------------------------------- */

enum manner { SILENT = 0, HALF_A_RECORD = 1, GREETING = 2, MANY_ADDRESSES = 3, MANNERS = 4 };

#define CROWD 200 /* connections of strangers at a time, more than the head has room for */

static struct {
    enum manner manner;
    struct link_stream stream[CROWD];
    struct link_credentials *credentials;
    _Atomic int opened;
    _Atomic bool stop;
} crowd;

/* @param host  last byte of 127.0.0.x, where it comes from @return the descriptor of a connection to the head */
static int connect_from(int host)
{
    struct sockaddr_in from = { .sin_family = AF_INET, .sin_addr.s_addr = htonl(0x7f000000u + (unsigned)host) };
    struct sockaddr_storage to;
    unsigned size;
    const int fd = socket(AF_INET, SOCK_STREAM, 0);

    assert_true(fd >= 0);
    assert_int_equal(bind(fd, (const struct sockaddr *)&from, sizeof(from)), 0);
    assert_int_equal(link_address("127.0.0.1", PORT, &to, &size), 0);
    assert_int_equal(connect(fd, (const struct sockaddr *)&to, size), 0);
    link_socket_prepare(fd);
    return fd;
}

static void *crowd_in(void *arg SST_UNUSED)
{
    static const uint8_t half[] = { 22, 3, 1, 2, 0, 1 };
    char why[256];

    for (int i = 0; !crowd.stop; i++) {
        struct link_stream *s = &crowd.stream[i % CROWD];

        if (i >= CROWD)
            link_stream_close(s);
        assert_int_equal(link_stream_open(s, connect_from(crowd.manner == MANY_ADDRESSES ? 2 + i % 250 : 1),
                                          crowd.credentials, false, 1 << 16),
                         0);
        if (crowd.manner == HALF_A_RECORD && send(s->fd, half, sizeof(half), MSG_NOSIGNAL) < 0)
            continue; /* the head has closed it */
        if (crowd.manner >= GREETING && link_stream_work(s, why))
            continue;
        crowd.opened++;
        if (i >= CROWD)
            usleep(20000);
    }
    for (int i = 0; i < CROWD; i++)
        link_stream_close(&crowd.stream[i]);
    return NULL;
}

/* A right certificate is shown, and a HELLO sent: is it answered? @return 1, 0 (not yet), -1: the connection has ended
 */
static int is_answered(struct link_stream *s)
{
    enum message_type type;
    const uint8_t *data;
    size_t bytes;
    char why[256];

    if (!s->sent_bytes && s->ready && !link_stream_waiting(s))
        assert_int_equal(link_stream_add_json(s, MESSAGE_HELLO, json_object()), 0);
    if (link_stream_work(s, why))
        return -1;
    return s->ready && link_stream_next(s, &type, &data, &bytes) == 1 && type == MESSAGE_WELCOME;
}

/* As many nodes as there can be connect at once, from one address. @return how many were served */
static int nodes_served(struct link_credentials *credentials)
{
    struct link_stream s[LINK_NODES - 1];
    int result[LINK_NODES - 1] = { 0 }, left = LINK_NODES - 1, served = 0;
    const int64_t end_ns = sst_clock_now_ns() + INT64_C(60000000000);

    for (int i = 0; i < LINK_NODES - 1; i++)
        assert_int_equal(link_stream_open(&s[i], connect_from(1), credentials, false, 1 << 16), 0);
    while (left && sst_clock_now_ns() < end_ns) {
        for (int i = 0; i < LINK_NODES - 1; i++) {
            if (result[i])
                continue;
            result[i] = is_answered(&s[i]);
            left -= result[i] != 0;
        }
        usleep(500);
    }
    for (int i = 0; i < LINK_NODES - 1; i++) {
        served += result[i] == 1;
        link_stream_close(&s[i]);
    }
    return served;
}

/* --- what is logged --- */

static FILE *said;
static int shown;

static void hear(void)
{
    said = tmpfile();
    shown = dup(STDERR_FILENO);
    assert_true(said && shown >= 0 && dup2(fileno(said), STDERR_FILENO) >= 0);
    sst_log_set_level(SST_LOG_WARNING);
}

/* @return lines since hear() */
static int heard_lines(void)
{
    int lines = 0;

    sst_log_set_level(SST_LOG_ERROR);
    assert_true(dup2(shown, STDERR_FILENO) >= 0);
    close(shown);
    rewind(said);
    for (int c; (c = fgetc(said)) != EOF;)
        lines += c == '\n';
    fclose(said);
    return lines;
}

/* Whatever strangers do at the head's port, nodes are served, and the log stays readable. */
static void strangers_keep_nobody_out(void **state_ SST_UNUSED)
{
    struct link_credentials *right = credentials_of("left");
    struct node left;
    int served[MANNERS] = { 0 }, lines;

    crowd.credentials = credentials_of("stranger");
    hear();
    open_head();
    for (int manner = SILENT; manner < MANNERS; manner++) {
        pthread_t thread;

        crowd.manner = (enum manner)manner;
        crowd.opened = 0;
        crowd.stop = false;
        assert_int_equal(pthread_create(&thread, NULL, crowd_in, NULL), 0);
        UNTIL(crowd.opened >= CROWD);
        for (int i = 0; i < 3; i++) /* where the machine stands still in between, a handshake is dropped */
            served[manner] += nodes_served(right);
        open_node(&left, "left", 0);
        UNTIL(state(&left).connected);
        close_node(&left);
        crowd.stop = true;
        pthread_join(thread, NULL);
    }
    close_head(NULL);
    lines = heard_lines();
    for (int manner = SILENT; manner < MANNERS; manner++)
        if (served[manner] < 2 * (LINK_NODES - 1))
            fail_msg("manner %d: %d of %d were served", manner, served[manner], 3 * (LINK_NODES - 1));
    if (lines > 120) /* one for each of 17 addresses, and what was left out; so in each minute */
        fail_msg("%d lines", lines);
    link_credentials_destroy(crowd.credentials);
    link_credentials_destroy(right);
}

#if WITH_ISAL

/* Handshakes for datagrams from strangers who pass the cookie: finished ones, and ones that stop in the middle. */
static void handshakes_of_strangers_keep_nobody_out(void **state_ SST_UNUSED)
{
    struct link_credentials *stranger = credentials_of("stranger");
    struct link_dtls *half[CROWD], *d;
    struct node left;
    int finished = 0, lines;
    char why[256];

    hear();
    open_head();
    for (int i = 0; i < 20; i++) {
        finished += shake_hands(&d, stranger);
        link_dtls_close(d);
    }
    for (int i = 0; i < CROWD; i++) {
        assert_int_equal(link_dtls_open(&half[i], "127.0.0.1", PORT, stranger), 0);
        for (int k = 0; k < 3 && !link_dtls_work(half[i], why); k++) /* a hello, and one with the cookie */
            usleep(1000);
    }
    open_by_datagrams(&left, "left", 0);
    both_capture(&left, NULL, 3);
    UNTIL(all_sent(&left) && of_head(&head.sets) == 3);
    for (int i = 0; i < CROWD; i++)
        link_dtls_close(half[i]);
    close_node(&left);
    close_head(NULL);
    lines = heard_lines();
    if (lines > 12)
        fail_msg("%d lines, %d handshakes", lines, finished);
    link_credentials_destroy(stranger);
}

#endif

static void a_node_refuses_who_is_not_the_head(void **state_ SST_UNUSED)
{
    struct node left;

    open_head();
    open_node(&left, "left", 0);
    UNTIL(state(&left).connected);
    close_node(&left);
    memset(&left, 0, sizeof(left));
    configure(&left.array, "left");
    strcpy(left.array.hosts.head_name, "another");
    left.array.bound = 1;
    assert_int_equal(sst_ring_create(&left.ring, 1 << 16), 0);
    assert_int_equal(
        sst_link_node_open(&left.link, &(struct sst_link_node_config){ .array = &left.array, .ring = left.ring }), 0);
    sst_link_node_cameras(left.link, &left.array);
    UNTIL(strstr(refusal(&left), "its certificate is of \"head\", not of \"another\""));
    close_node(&left);
    close_head(NULL);
}

static void certificates_that_are_not_there_are_named(void **state_ SST_UNUSED)
{
    struct sst_link_node *n;
    struct sst_array_config a;
    char why[SST_LOG_MAX] = "";

    configure(&a, "nobody");
    sst_log_hold_errors(why);
    assert_int_equal(sst_link_node_open(&n, &(struct sst_link_node_config){ .array = &a }), -EINVAL);
    sst_log_hold_errors(NULL);
    assert_contains(why, "nobody.pem");
}

/* --- certificates ------------------------------------------------------------------------------------------------- */

static void shell(const char *text)
{
    char command[2048];

    snprintf(command, sizeof(command), "cd '%s' && { %s ; } 2>/dev/null", certificates, text);
    if (system(command))
        fail_msg("%s", text);
}

static int set_up(void **state_ SST_UNUSED)
{
    if (test_folder_create(NULL))
        return -1;
    memcpy(certificates, test_folder, sizeof(test_folder));
    shell("openssl req -x509 -newkey ed25519 -noenc -keyout ca.key -out ca.pem -days 2 -subj /CN=array; "
          "openssl req -x509 -newkey ed25519 -noenc -keyout stranger.key -out stranger.pem -days 2 -subj /CN=right; "
          "for h in head left right third; do"
          "  openssl req -newkey ed25519 -noenc -keyout $h.key -out $h.csr -subj /CN=$h;"
          "  openssl x509 -req -in $h.csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 -out $h.pem; done");
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sets_of_two_nodes_become_one),
        cmocka_unit_test(a_head_that_is_away_costs_a_gap_that_is_counted),
        cmocka_unit_test(a_node_that_missed_an_edge_is_put_right),
        cmocka_unit_test(unchanged_pictures_are_not_sent),
        cmocka_unit_test(sets_go_by_datagrams),
        cmocka_unit_test(without_datagrams_sets_go_over_tls),
#if WITH_ISAL
        cmocka_unit_test(datagrams_of_others_do_no_harm),
#endif
        cmocka_unit_test(silence_of_the_trigger_ends_nothing),
        cmocka_unit_test(who_is_not_of_the_array_is_refused),
        cmocka_unit_test(strangers_keep_nobody_out),
#if WITH_ISAL
        cmocka_unit_test(handshakes_of_strangers_keep_nobody_out),
#endif
        cmocka_unit_test(a_node_refuses_who_is_not_the_head),
        cmocka_unit_test(certificates_that_are_not_there_are_named),
    };

    if (!WITH_HTTPD) {
        printf("built without GnuTLS: hosts are not connected\n");
        return 77;
    }
    sst_log_set_level(SST_LOG_ERROR);
    return cmocka_run_group_tests(tests, set_up, test_folder_remove);
}
