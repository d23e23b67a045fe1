/* Authentication: a user and a password, required before any other answer. */
#include "publishers/rtsp/rtsp_internal.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <string.h>
#include <time.h>

#include "base/brake.h"
#include "base/clock.h"
#include "base/log.h"

#define WRONG_MAX 6   /* of one connection; each leaves a nonce behind for half a minute */
#define PAUSE_MS  300 /* a connection has a thread of its own */
#define WRONG_KEY "sst-wrong"

static struct sst_brake brake; /* as over HTTP, by address */

/* @return false: not known, as of no IP address */
static bool address_of(const GstRTSPContext *ctx, struct sockaddr_storage *out)
{
    const gchar *ip = gst_rtsp_connection_get_ip(ctx->conn);

    memset(out, 0, sizeof(*out));
    if (ip && inet_pton(AF_INET, ip, &((struct sockaddr_in *)out)->sin_addr) == 1)
        out->ss_family = AF_INET;
    else if (ip && inet_pton(AF_INET6, ip, &((struct sockaddr_in6 *)out)->sin6_addr) == 1)
        out->ss_family = AF_INET6;
    return out->ss_family != 0;
}

/* A password of an address that has guessed is not even looked at. */
static bool is_blocked(const GstRTSPContext *ctx)
{
    struct sockaddr_storage address;
    gchar *header;

    return gst_rtsp_message_get_header(ctx->request, GST_RTSP_HDR_AUTHORIZATION, &header, 0) == GST_RTSP_OK &&
           address_of(ctx, &address) && sst_brake_left(&brake, (struct sockaddr *)&address, sst_clock_now_ns()) > 0;
}

static void count_attempt(const GstRTSPContext *ctx)
{
    const gchar *ip = gst_rtsp_connection_get_ip(ctx->conn);
    struct sockaddr_storage address;
    bool first = false;
    int left_s = 0;

    rtsp_report_refused(ip);
    if (address_of(ctx, &address))
        left_s = sst_brake_wrong(&brake, (struct sockaddr *)&address, sst_clock_now_ns(), &first);
    if (first)
        sst_log_warning("rtsp: %s sent %d wrong passwords within a minute: it is hung up on for %d s", ip,
                        SST_BRAKE_WRONG + 1, left_s);
}

/* The first request of most clients has no password and is no attempt; an attempt is slowed down. */
static void count_wrong(GstRTSPContext *ctx)
{
    const struct timespec pause = { .tv_nsec = PAUSE_MS * 1000000L };
    const int wrong = GPOINTER_TO_INT(g_object_get_data(G_OBJECT(ctx->client), WRONG_KEY)) + 1;
    gchar *header;

    g_object_set_data(G_OBJECT(ctx->client), WRONG_KEY, GINT_TO_POINTER(wrong));
    if (gst_rtsp_message_get_header(ctx->request, GST_RTSP_HDR_AUTHORIZATION, &header, 0) == GST_RTSP_OK) {
        /* The first digest may answer the challenge of an earlier connection. */
        if (wrong > 1 || g_ascii_strncasecmp(header, "Digest", 6) != 0)
            count_attempt(ctx);
        nanosleep(&pause, NULL);
    }
    if (wrong >= WRONG_MAX)
        rtsp_disconnect(ctx->client);
}

static gboolean is_allowed(GstRTSPAuth *auth, GstRTSPContext *ctx)
{
    GstRTSPAuthClass *class = GST_RTSP_AUTH_GET_CLASS(auth);

    /* Clients use OPTIONS to see whether there is a server. */
    if (ctx->method == GST_RTSP_OPTIONS)
        return TRUE;
    if (!ctx->token && is_blocked(ctx)) {
        rtsp_disconnect(ctx->client);
        return FALSE;
    }
    if (!ctx->token)
        class->authenticate(auth, ctx);
    if (ctx->token)
        return TRUE;
    count_wrong(ctx);
    gst_rtsp_message_init_response(ctx->response, GST_RTSP_STS_UNAUTHORIZED,
                                   gst_rtsp_status_as_text(GST_RTSP_STS_UNAUTHORIZED), ctx->request);
    class->generate_authenticate_header(auth, ctx);
    gst_rtsp_client_send_message(ctx->client, ctx->session, ctx->response);
    return FALSE;
}

static gboolean check(GstRTSPAuth *auth, GstRTSPContext *ctx, const gchar *what)
{
    if (!strcmp(what, GST_RTSP_AUTH_CHECK_URL))
        return is_allowed(auth, ctx);
    /* Packets go to the address of the client, never to another one that it names. */
    return strcmp(what, GST_RTSP_AUTH_CHECK_TRANSPORT_CLIENT_SETTINGS) != 0;
}

static void class_init(gpointer class, gpointer data SST_UNUSED)
{
    ((GstRTSPAuthClass *)class)->check = check;
}

static GType auth_type(void)
{
    static gsize type;

    if (g_once_init_enter(&type))
        g_once_init_leave(&type,
                          g_type_register_static_simple(GST_TYPE_RTSP_AUTH, "SstRtspAuth", sizeof(GstRTSPAuthClass),
                                                        class_init, sizeof(GstRTSPAuth), NULL, (GTypeFlags)0));
    return type;
}

void rtsp_set_login(GstRTSPServer *server, const struct rtsp_login *login)
{
    GstRTSPAuth *auth = g_object_new(auth_type(), NULL);
    GstRTSPToken *token = gst_rtsp_token_new_empty();
    gchar *basic = gst_rtsp_auth_make_basic(login->user, login->password);

    sst_brake_init(&brake);
    gst_rtsp_auth_set_supported_methods(auth, GST_RTSP_AUTH_BASIC | GST_RTSP_AUTH_DIGEST);
    gst_rtsp_auth_set_realm(auth, "sst");
    gst_rtsp_auth_add_basic(auth, basic, token);
    gst_rtsp_auth_add_digest(auth, login->user, login->password, token);
    gst_rtsp_server_set_auth(server, auth);
    g_free(basic);
    gst_rtsp_token_unref(token);
    g_object_unref(auth);
}
