/* Authentication of RTSP clients: a user and a password, required before any other answer. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "publishers/rtsp/rtsp_internal.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/log.h"
#include "publishers/login.h"

#define WRONG_MAX 6 /* of one connection, in a row */
#define LOGIN_KEY "sst-login"

/** Of one connection. */
struct login_state {
    uint8_t network[16];
    int wrong;   /* refused requests since the last right one */
    bool proven; /* it has sent the right password and does not wait for the attempts of others */
};

static struct {
    /* fixed after rtsp_set_login() */
    struct sst_login *login;
    char basic[65], ha1[33]; /* signature of Basic's credentials; MD5 of Digest */
} at;

/* --- passwords ---------------------------------------------------------------------------------------------------- */

static const char *param(const GstRTSPAuthCredential *c, const char *name)
{
    for (GstRTSPAuthParam **p = c->params; p && *p; p++)
        if (!g_ascii_strcasecmp((*p)->name, name) && (*p)->value)
            return (*p)->value;
    return NULL;
}

static enum sst_login_verdict judge_digest(const struct login_state *s, const GstRTSPContext *ctx,
                                           const GstRTSPAuthCredential *c)
{
    const char *user = param(c, "username"), *realm = param(c, "realm"), *nonce = param(c, "nonce"),
               *uri = param(c, "uri"), *response = param(c, "response");
    gchar *want;
    bool old, right;

    if (nonce && !sst_login_nonce_is_ours(at.login, nonce, s->network, &old))
        return SST_LOGIN_STRAY;
    if (!user || !realm || !nonce || !uri || !response)
        return SST_LOGIN_WRONG;
    want =
        gst_rtsp_generate_digest_auth_response_from_md5(NULL, gst_rtsp_method_as_text(ctx->method), at.ha1, uri, nonce);
    right = !strcmp(user, at.login->user) && !strcmp(realm, SST_LOGIN_REALM) && want &&
            !g_ascii_strcasecmp(want, response);
    g_free(want);
    if (!right)
        return SST_LOGIN_WRONG;
    return old && !s->proven ? SST_LOGIN_STALE : SST_LOGIN_RIGHT;
}

/* One password of a request: a list would be as many guesses. */
static enum sst_login_verdict judge(const struct login_state *s, const GstRTSPContext *ctx)
{
    GstRTSPAuthCredential **given = gst_rtsp_message_parse_auth_credentials(ctx->request, GST_RTSP_HDR_AUTHORIZATION);
    const GstRTSPAuthCredential *c = given ? given[0] : NULL;
    enum sst_login_verdict verdict = SST_LOGIN_WRONG;
    char signature[65];

    if (c && c->scheme == GST_RTSP_AUTH_DIGEST) {
        verdict = judge_digest(s, ctx, c);
    } else if (c && c->scheme == GST_RTSP_AUTH_BASIC && c->authorization) {
        sst_login_sign(at.login, signature, "", 0, c->authorization);
        verdict = strcmp(signature, at.basic) ? SST_LOGIN_WRONG : SST_LOGIN_RIGHT;
    }
    gst_rtsp_auth_credentials_free(given);
    return verdict;
}

/* --- guessing clients --------------------------------------------------------------------------------------------- */

static struct sst_login_client client_of(const struct login_state *s, const GstRTSPContext *ctx)
{
    struct sst_login_client c = { .address = gst_rtsp_connection_get_ip(ctx->conn) };
    gchar *agent = NULL;

    (void)gst_rtsp_message_get_header(ctx->request, GST_RTSP_HDR_USER_AGENT, &agent, 0);
    c.agent = agent;
    c.address = c.address ? c.address : "unknown";
    memcpy(c.network, s->network, 16);
    return c;
}

static void sleep_ns(int64_t ns)
{
    const struct timespec pause = { .tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000 };

    nanosleep(&pause, NULL);
}

/* An address that has guessed waits its turn. @return false: too many of it do already */
static bool wait_turn(const struct login_state *s, const GstRTSPContext *ctx)
{
    const struct sst_login_client client = client_of(s, ctx);
    int64_t wait_ns;

    if (s->proven)
        return true;
    wait_ns = sst_login_turn(at.login, &client);
    if (wait_ns > 0) {
        rtsp_set_busy(ctx->client);
        sleep_ns(wait_ns);
    }
    return wait_ns >= 0;
}

/* --- requests ----------------------------------------------------------------------------------------------------- */

static struct login_state *state_of(const GstRTSPContext *ctx)
{
    struct login_state *s = g_object_get_data(G_OBJECT(ctx->client), LOGIN_KEY);
    const gchar *ip = gst_rtsp_connection_get_ip(ctx->conn);
    struct sockaddr_storage address = { 0 };

    if (s)
        return s;
    s = g_new0(struct login_state, 1);
    if (ip && inet_pton(AF_INET, ip, &((struct sockaddr_in *)&address)->sin_addr) == 1)
        address.ss_family = AF_INET;
    else if (ip && inet_pton(AF_INET6, ip, &((struct sockaddr_in6 *)&address)->sin6_addr) == 1)
        address.ss_family = AF_INET6;
    sst_brake_network((struct sockaddr *)&address, s->network);
    g_object_set_data_full(G_OBJECT(ctx->client), LOGIN_KEY, s, g_free);
    return s;
}

static void refuse(struct login_state *s, GstRTSPContext *ctx, bool stale)
{
    char nonce[SST_LOGIN_NONCE];
    gchar *digest;

    gst_rtsp_message_init_response(ctx->response, GST_RTSP_STS_UNAUTHORIZED,
                                   gst_rtsp_status_as_text(GST_RTSP_STS_UNAUTHORIZED), ctx->request);
    sst_login_nonce(at.login, nonce, s->network);
    digest =
        g_strdup_printf("Digest realm=\"" SST_LOGIN_REALM "\", nonce=\"%s\"%s", nonce, stale ? ", stale=true" : "");
    gst_rtsp_message_add_header(ctx->response, GST_RTSP_HDR_WWW_AUTHENTICATE,
                                "Basic realm=\"" SST_LOGIN_REALM "\"");
    gst_rtsp_message_take_header(ctx->response, GST_RTSP_HDR_WWW_AUTHENTICATE, digest);
    gst_rtsp_client_send_message(ctx->client, ctx->session, ctx->response);
}

static gboolean is_allowed(GstRTSPContext *ctx)
{
    struct login_state *s = state_of(ctx);
    enum sst_login_verdict verdict = SST_LOGIN_NONE;
    struct sst_login_client client;
    gchar *header;

    /* Clients use OPTIONS to see whether there is a server. */
    if (ctx->method == GST_RTSP_OPTIONS)
        return TRUE;
    if (gst_rtsp_message_get_header(ctx->request, GST_RTSP_HDR_AUTHORIZATION, &header, 0) == GST_RTSP_OK) {
        if (!wait_turn(s, ctx)) {
            rtsp_disconnect(ctx->client);
            return FALSE;
        }
        verdict = judge(s, ctx);
    }
    client = client_of(s, ctx);
    if (sst_login_note(at.login, &client, verdict))
        sleep_ns(SST_LOGIN_PAUSE_MS * INT64_C(1000000));
    if (verdict == SST_LOGIN_RIGHT) {
        s->proven = true;
        s->wrong = 0;
        return TRUE;
    }
    if (++s->wrong >= WRONG_MAX)
        rtsp_disconnect(ctx->client);
    refuse(s, ctx, verdict == SST_LOGIN_STALE);
    return FALSE;
}

static gboolean check(GstRTSPAuth *auth SST_UNUSED, GstRTSPContext *ctx, const gchar *what)
{
    if (!strcmp(what, GST_RTSP_AUTH_CHECK_URL))
        return is_allowed(ctx);
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

int rtsp_set_login(GstRTSPServer *server, struct sst_login *login)
{
    const int err = sst_login_open(login);
    GstRTSPAuth *auth;
    gchar *basic;

    if (err)
        return err;
    at.login = login;
    basic = gst_rtsp_auth_make_basic(login->user, login->password);
    sst_login_sign(login, at.basic, "", 0, basic);
    sst_login_ha1(login, at.ha1);
    explicit_bzero(basic, strlen(basic));
    explicit_bzero(login->password, sizeof(login->password));
    g_free(basic);
    auth = g_object_new(auth_type(), NULL);
    gst_rtsp_server_set_auth(server, auth);
    g_object_unref(auth);
    return 0;
}
