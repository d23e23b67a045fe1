/* Authentication: a user and a password, required before any other answer. */
#include "publishers/rtsp/rtsp_internal.h"

#include <string.h>
#include <time.h>

#define WRONG_MAX 6   /* of one connection; each leaves a nonce behind for half a minute */
#define PAUSE_MS  300 /* a connection has a thread of its own */
#define WRONG_KEY "sst-wrong"

/* The first request of most clients has no password and is no attempt; an attempt is slowed down. */
static void count_wrong(GstRTSPContext *ctx)
{
    const struct timespec pause = { .tv_nsec = PAUSE_MS * 1000000L };
    const int wrong = GPOINTER_TO_INT(g_object_get_data(G_OBJECT(ctx->client), WRONG_KEY)) + 1;
    gchar *header;

    g_object_set_data(G_OBJECT(ctx->client), WRONG_KEY, GINT_TO_POINTER(wrong));
    if (gst_rtsp_message_get_header(ctx->request, GST_RTSP_HDR_AUTHORIZATION, &header, 0) == GST_RTSP_OK) {
        if (wrong > 1) /* the first may answer the challenge of an earlier connection */
            rtsp_report_refused(gst_rtsp_connection_get_ip(ctx->conn));
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

    gst_rtsp_auth_set_supported_methods(auth, GST_RTSP_AUTH_BASIC | GST_RTSP_AUTH_DIGEST);
    gst_rtsp_auth_set_realm(auth, "sst");
    gst_rtsp_auth_add_basic(auth, basic, token);
    gst_rtsp_auth_add_digest(auth, login->user, login->password, token);
    gst_rtsp_server_set_auth(server, auth);
    g_free(basic);
    gst_rtsp_token_unref(token);
    g_object_unref(auth);
}
