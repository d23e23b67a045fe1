/* Server of GStreamer: connections, limits, and workarounds for its library. Pipelines are in feed.c. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "publishers/rtsp/rtsp_internal.h"

#include <errno.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"

#define CLIENTS_MAX     16            /* that watch */
#define SESSIONS_MAX    4             /* of one connection */
#define CONNECTIONS_MAX 32            /* including ones that only ask */
#define IDLE_NS         5000000000LL  /* a connection that neither watches nor asks is closed */
#define STUCK_NS        30000000000LL /* a connection that was reset and is still there after this never ends */
#define REAP_MS         200
#define FLOOD_BYTES     262144 /* from one client between two checks; requests and receipts are a few hundred */
#define BODY_MAX        4096
#define FAREWELL_MS     1000
#define LOG_NS          60000000000LL
#define END_NS          500000000LL /* for the ends of connections when the program ends */
#define CLIENT_KEY      "sst-client"

/** Of one connection. Sessions are found in its own pool alone: the library would let a connection command another
 * one's, and ends the process when pictures are then to go where no channel was agreed. */
struct client {
    _Atomic int64_t since_ns; /* of its begin, or of the last answer */
    atomic_bool busy;         /* an answer takes a while */
    GstRTSPSessionPool *sessions;
    /* the server's thread alone */
    uint64_t bytes;   /* received at the last check */
    int64_t reset_ns; /* when it was reset; 0: not yet */
};

/* The elements of GStreamer that are needed, and their Debian packages. */
static const struct {
    const char *plugin, *element, *package;
    bool h264;
} parts[] = {
    { "coreelements", "queue", "libgstreamer1.0-0", false },
    { "app", "appsrc", "gstreamer1.0-plugins-base", false },
    { "udp", "multiudpsink", "gstreamer1.0-plugins-good", false },
    { "rtpmanager", "rtpbin", "gstreamer1.0-plugins-good", false },
    { "rtp", "rtpjpegpay", "gstreamer1.0-plugins-good", false },
    { "jpeg", "jpegdec", "gstreamer1.0-plugins-good", true },
    { "videoconvertscale", "videoconvertscale", "gstreamer1.0-plugins-base", true },
    { "x264", "x264enc", "gstreamer1.0-plugins-ugly", true },
};

/* Warnings of the library, mostly about clients that vanish: one line a minute. */
static void on_library_log(const gchar *domain, GLogLevelFlags level SST_UNUSED, const gchar *text,
                           gpointer arg SST_UNUSED)
{
    static _Atomic int64_t logged_ns;
    const int64_t now_ns = sst_clock_now_ns();
    int64_t before_ns = atomic_load(&logged_ns);

    if ((!before_ns || now_ns - before_ns > LOG_NS) && atomic_compare_exchange_strong(&logged_ns, &before_ns, now_ns))
        sst_log_warning("rtsp: %s: %s", domain ? domain : "GLib", text);
}

int rtsp_load_plugins(enum sst_rtsp_codec codec)
{
    GError *error = NULL;

    /* Only these plugins are loaded: without a home to keep its registry in, the library would load all that are
     * installed at each start, hundreds perhaps. */
    setenv("GST_REGISTRY_DISABLE", "yes", 0);
    g_log_set_default_handler(on_library_log, NULL);
    if (!gst_init_check(NULL, NULL, &error)) {
        sst_log_error("rtsp: GStreamer does not start: %s", error ? error->message : "no reason given");
        g_clear_error(&error);
        return -ENOTSUP;
    }
    for (size_t i = 0; i < ARRAY_LEN(parts); i++) {
        GstElementFactory *factory;
        GstPlugin *plugin;
        char path[512];

        if (parts[i].h264 && codec != SST_RTSP_H264)
            continue;
        snprintf(path, sizeof(path), "%s/libgst%s.so", SST_GST_PLUGINS, parts[i].plugin);
        plugin = gst_plugin_load_file(path, NULL);
        factory = plugin ? gst_element_factory_find(parts[i].element) : NULL;
        if (plugin)
            gst_object_unref(plugin);
        if (!factory) {
            sst_log_error("rtsp: element %s of GStreamer is missing; install %s%s", parts[i].element, parts[i].package,
                          parts[i].h264 ? ", or set rtsp.codec: mjpeg" : "");
            return -ENOTSUP;
        }
        gst_object_unref(factory);
    }
    return 0;
}

/* --- clients ----------------------------------------------------------------------------------------------------- */

static GSocket *socket_of(GstRTSPClient *client)
{
    GstRTSPConnection *connection = gst_rtsp_client_get_connection(client);

    return connection ? gst_rtsp_connection_get_read_socket(connection) : NULL;
}

void rtsp_disconnect(GstRTSPClient *client)
{
    const struct sockaddr none = { .sa_family = AF_UNSPEC };
    GSocket *socket = socket_of(client);

    if (socket)
        (void)!connect(g_socket_get_fd(socket), &none, sizeof(none));
}

static uint64_t received(GstRTSPClient *client)
{
    GSocket *socket = socket_of(client);
    struct tcp_info info = { 0 };
    socklen_t size = sizeof(info);

    if (!socket || getsockopt(g_socket_get_fd(socket), IPPROTO_TCP, TCP_INFO, &info, &size))
        return 0;
    return info.tcpi_bytes_received;
}

static struct client *client_of(GstRTSPClient *client)
{
    return g_object_get_data(G_OBJECT(client), CLIENT_KEY);
}

static GstRTSPFilterResult check_over(GstRTSPSession *session SST_UNUSED, GstRTSPSessionMedia *media, gpointer over)
{
    *(bool *)over |= rtsp_feed_is_over(gst_rtsp_session_media_get_media(media));
    return GST_RTSP_FILTER_KEEP;
}

static GstRTSPFilterResult check_session(GstRTSPSessionPool *pool SST_UNUSED, GstRTSPSession *session, gpointer over)
{
    g_list_free_full(gst_rtsp_session_filter(session, check_over, over), g_object_unref);
    return GST_RTSP_FILTER_KEEP;
}

static GstRTSPFilterResult check_client(GstRTSPServer *server SST_UNUSED, GstRTSPClient *client, gpointer watching)
{
    struct client *c = client_of(client);
    const uint64_t bytes = received(client);
    const int64_t now_ns = sst_clock_now_ns();
    const guint sessions = gst_rtsp_session_pool_get_n_sessions(c->sessions);
    bool over = false;

    gst_rtsp_session_pool_cleanup(c->sessions);
    g_list_free_full(gst_rtsp_session_pool_filter(c->sessions, check_session, &over), g_object_unref);
    *(guint *)watching += sessions;
    if (bytes > c->bytes + FLOOD_BYTES || over || (!sessions && !c->busy && now_ns - c->since_ns > IDLE_NS)) {
        rtsp_disconnect(client);
        c->reset_ns = c->reset_ns ? c->reset_ns : now_ns;
    }
    c->bytes = bytes;
    if (c->reset_ns && now_ns - c->reset_ns > STUCK_NS) {
        sst_log_error("rtsp: a connection that was reset does not end; the program ends, to be started again");
        _exit(EXIT_FAILURE);
    }
    return GST_RTSP_FILTER_KEEP;
}

static gboolean check_clients(gpointer arg)
{
    struct rtsp_server *rtsp = arg;
    guint watching = 0;

    g_list_free_full(gst_rtsp_server_client_filter(rtsp->server, check_client, &watching), g_object_unref);
    rtsp_report_clients((int)watching);
    return G_SOURCE_CONTINUE;
}

void rtsp_set_busy(GstRTSPClient *client)
{
    atomic_store(&client_of(client)->busy, true);
}

static GstRTSPStatusCode before_describe(GstRTSPClient *client, GstRTSPContext *ctx, gpointer arg)
{
    rtsp_set_busy(client);
    return rtsp_mount(arg, ctx->uri->abspath);
}

static GstRTSPFilterResult count(GstRTSPServer *server SST_UNUSED, GstRTSPClient *client, gpointer sessions)
{
    *(guint *)sessions += gst_rtsp_session_pool_get_n_sessions(client_of(client)->sessions);
    return GST_RTSP_FILTER_KEEP;
}

/* A stream is set up once: after a second SETUP the library would still send to the first address. */
static GstRTSPStatusCode before_setup(GstRTSPClient *client, GstRTSPContext *ctx, gpointer arg)
{
    struct rtsp_server *rtsp = arg;
    guint sessions = 0;

    if (ctx->session)
        return GST_RTSP_STS_METHOD_NOT_VALID_IN_THIS_STATE;
    g_list_free_full(gst_rtsp_server_client_filter(rtsp->server, count, &sessions), g_object_unref);
    if (sessions >= CLIENTS_MAX)
        return GST_RTSP_STS_SERVICE_UNAVAILABLE;
    rtsp_set_busy(client);
    return GST_RTSP_STS_OK;
}

static void on_play(GstRTSPClient *client SST_UNUSED, GstRTSPContext *ctx, gpointer arg SST_UNUSED)
{
    if (ctx->sessmedia)
        rtsp_feed_refresh(gst_rtsp_session_media_get_media(ctx->sessmedia));
}

static GstRTSPFilterResult detach(GstRTSPSession *session SST_UNUSED, GstRTSPSessionMedia *media,
                                  gpointer arg SST_UNUSED)
{
    gst_rtsp_session_media_set_state(media, GST_STATE_NULL);
    return GST_RTSP_FILTER_REMOVE;
}

static GstRTSPFilterResult end_session(GstRTSPSessionPool *pool SST_UNUSED, GstRTSPSession *session,
                                       gpointer arg SST_UNUSED)
{
    g_list_free_full(gst_rtsp_session_filter(session, detach, NULL), g_object_unref);
    return GST_RTSP_FILTER_REMOVE;
}

static gboolean end_keep(gpointer arg SST_UNUSED)
{
    return G_SOURCE_REMOVE;
}

/* The library passes packets to a client without holding a reference, and aborts if the client is gone by then: it is
 * detached from its streams first, and kept while a packet on its way may need it. */
static void keep_for_a_moment(struct rtsp_server *rtsp, GstRTSPClient *client)
{
    GSource *source = g_timeout_source_new(FAREWELL_MS);

    g_source_set_callback(source, end_keep, g_object_ref(client), g_object_unref);
    g_source_attach(source, rtsp->context);
    g_source_unref(source);
}

/* The library would keep the empty session until its time-out; it counts towards the limit. */
static void on_close(GstRTSPClient *client, gpointer arg)
{
    keep_for_a_moment(arg, client);
    g_list_free_full(gst_rtsp_session_pool_filter(client_of(client)->sessions, end_session, NULL), g_object_unref);
}

static void on_answer(GstRTSPClient *client, GstRTSPContext *ctx SST_UNUSED, GstRTSPMessage *message SST_UNUSED,
                      gpointer arg SST_UNUSED)
{
    struct client *c = client_of(client);

    atomic_store(&c->since_ns, sst_clock_now_ns());
    atomic_store(&c->busy, false);
}

static void client_free(gpointer arg)
{
    struct client *c = arg;

    g_object_unref(c->sessions);
    g_free(c);
}

static void on_connect(GstRTSPServer *server, GstRTSPClient *client, gpointer arg)
{
    GList *others = gst_rtsp_server_client_filter(server, NULL, NULL);
    struct client *c = g_new0(struct client, 1);

    c->since_ns = sst_clock_now_ns();
    c->sessions = gst_rtsp_session_pool_new();
    gst_rtsp_session_pool_set_max_sessions(c->sessions, SESSIONS_MAX);
    gst_rtsp_client_set_session_pool(client, c->sessions);
    g_object_set_data_full(G_OBJECT(client), CLIENT_KEY, c, client_free);
    g_signal_connect(client, "pre-describe-request", G_CALLBACK(before_describe), arg);
    g_signal_connect(client, "pre-setup-request", G_CALLBACK(before_setup), arg);
    g_signal_connect(client, "play-request", G_CALLBACK(on_play), NULL);
    g_signal_connect(client, "send-message", G_CALLBACK(on_answer), NULL);
    g_signal_connect(client, "closed", G_CALLBACK(on_close), arg);
    if (g_list_length(others) >= CONNECTIONS_MAX)
        rtsp_disconnect(client);
    g_list_free_full(others, g_object_unref);
}

/* --- open, run ---------------------------------------------------------------------------------------------------- */

static int listen_on(struct rtsp_server *rtsp, int fd)
{
    GError *error = NULL;
    GSocket *socket = g_socket_new_from_fd(fd, &error);
    GSource *source;

    if (!socket) {
        sst_log_error("rtsp: %s", error->message);
        g_error_free(error);
        return -EIO;
    }
    source = g_socket_create_source(socket, G_IO_IN, NULL);
    g_source_set_callback(source, G_SOURCE_FUNC(gst_rtsp_server_io_func), rtsp->server, NULL);
    g_source_attach(source, rtsp->context); /* which holds references to both */
    g_source_unref(source);
    g_object_unref(socket);
    return 0;
}

int rtsp_server_open(struct rtsp_server *rtsp, enum sst_rtsp_codec codec, struct sst_login *login, int fd)
{
    GstRTSPThreadPool *threads;
    GSource *reaper;
    int err;

    rtsp->codec = codec;
    pthread_mutex_init(&rtsp->lock, NULL);
    rtsp->factories = g_ptr_array_new();
    rtsp->context = g_main_context_new();
    rtsp->server = gst_rtsp_server_new();
    rtsp->mounts = gst_rtsp_server_get_mount_points(rtsp->server);
    gst_rtsp_server_set_content_length_limit(rtsp->server, BODY_MAX);
    /* A thread for each connection: one that waits for a frame delays no other. */
    threads = gst_rtsp_server_get_thread_pool(rtsp->server);
    gst_rtsp_thread_pool_set_max_threads(threads, CONNECTIONS_MAX);
    g_object_unref(threads);
    g_signal_connect(rtsp->server, "client-connected", G_CALLBACK(on_connect), rtsp);
    reaper = g_timeout_source_new(REAP_MS);
    g_source_set_callback(reaper, check_clients, rtsp, NULL);
    g_source_attach(reaper, rtsp->context);
    g_source_unref(reaper);
    err = login->user[0] ? rtsp_set_login(rtsp->server, login) : 0;
    return err ? err : listen_on(rtsp, fd);
}

static GstRTSPFilterResult hang_up(GstRTSPServer *server SST_UNUSED, GstRTSPClient *client, gpointer left)
{
    rtsp_disconnect(client);
    *(bool *)left = true;
    return GST_RTSP_FILTER_KEEP;
}

void rtsp_server_run(struct rtsp_server *rtsp, const atomic_bool *stop)
{
    int64_t until_ns;
    bool left = true;

    g_main_context_push_thread_default(rtsp->context);
    while (!atomic_load(stop)) /* the reaper wakes it */
        g_main_context_iteration(rtsp->context, TRUE);
    until_ns = sst_clock_now_ns() + END_NS;
    while (left && sst_clock_now_ns() < until_ns) {
        left = false;
        (void)gst_rtsp_server_client_filter(rtsp->server, hang_up, &left);
        while (g_main_context_iteration(rtsp->context, FALSE))
            ;
        g_usleep(10000);
    }
    g_main_context_pop_thread_default(rtsp->context);
}
