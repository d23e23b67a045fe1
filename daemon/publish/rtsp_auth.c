/* Who may look: a user and a password, asked for before anything is told. */
#include "daemon/publish/rtsp_internal.h"

#if WITH_RTSP

#include <string.h>
#include <time.h>

#define WRONG_MAX 6   /* of one connection; each leaves a nonce behind for half a minute */
#define PAUSE_MS  300 /* a connection has a thread of its own */
#define WRONG_KEY "sst-wrong"

/* The first request of most clients has no password and is no attempt; who guesses is given time to think. */
static void count_wrong(GstRTSPContext *ctx)
{
    const struct timespec pause = { .tv_nsec = PAUSE_MS * 1000000L };
    const int wrong = GPOINTER_TO_INT(g_object_get_data(G_OBJECT(ctx->client), WRONG_KEY)) + 1;
    gchar *header;

    g_object_set_data(G_OBJECT(ctx->client), WRONG_KEY, GINT_TO_POINTER(wrong));
    if (gst_rtsp_message_get_header(ctx->request, GST_RTSP_HDR_AUTHORIZATION, &header, 0) == GST_RTSP_OK) {
        if (wrong > 1) /* the first may be an answer to an earlier connection's question */
            rtsp_say_wrong(gst_rtsp_connection_get_ip(ctx->conn));
        nanosleep(&pause, NULL);
    }
    if (wrong >= WRONG_MAX)
        rtsp_send_away(ctx->client);
}

static gboolean let_in(GstRTSPAuth *auth, GstRTSPContext *ctx)
{
    GstRTSPAuthClass *class = GST_RTSP_AUTH_GET_CLASS(auth);

    /* Clients ask for the methods to see whether anybody is there. */
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
        return let_in(auth, ctx);
    /* Packets go to who asks, wherever he says that they should go. */
    return strcmp(what, GST_RTSP_AUTH_CHECK_TRANSPORT_CLIENT_SETTINGS) != 0;
}

static void class_init(gpointer class, gpointer data)
{
    (void)data;
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

void rtsp_auth_set(GstRTSPServer *server, const struct rtsp_login *login)
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

#endif
