/* Authentication: a user and a password, required before any other answer. A nonce names its time and is signed for the
 * client's address, so that each answer to one of this process is known for the guess that it may be, on whatever
 * connection, and none has to be remembered. */
#include "publishers/rtsp/rtsp_internal.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>

#include "base/brake.h"
#include "base/clock.h"
#include "base/log.h"

#define REALM     "sst"
#define WRONG_MAX 6   /* of one connection, in a row */
#define PAUSE_MS  300 /* a connection has a thread of its own */
#define NONCE     41  /* 8 digits of the time, 32 of the signature, NUL */
#define NONCE_S   300 /* a client that has asked its user for the password is back by then */
#define VIEWERS   64
#define LOGIN_KEY "sst-login"
#define SECRET    32

/** Of one connection. */
struct login_state {
    uint8_t network[16];
    int wrong;   /* refused requests since the last right one */
    bool proven; /* it has sent the right password and does not wait for the attempts of others */
};

enum verdict {
    LOGIN_NONE = 0, /* no password was sent: the first request of most clients */
    LOGIN_RIGHT = 1,
    LOGIN_STALE = 2, /* right, with a nonce that is too old */
    LOGIN_WRONG = 3,
    LOGIN_STRAY = 4, /* answers a nonce of another process, as after a restart: not looked at */
};

static struct {
    /* fixed after rtsp_set_login() */
    uint8_t secret[SECRET];
    char user[64], basic[65], ha1[33]; /* signature of Basic's credentials; MD5 of Digest */
    struct sst_brake wrong;            /* as over HTTP, by address, or by viewer */
    struct sst_brake stray;
    /* under lock */
    pthread_mutex_t lock;
    uint8_t viewer[VIEWERS][16]; /* address and program of clients with the right password, a ring */
    int next;
} at = { .lock = PTHREAD_MUTEX_INITIALIZER };

/* --- nonces ------------------------------------------------------------------------------------------------------- */

/* @param out  [65] hexadecimal */
static void sign(char *out, const void *data, size_t bytes, const char *text)
{
    GHmac *hmac = g_hmac_new(G_CHECKSUM_SHA256, at.secret, SECRET);

    g_hmac_update(hmac, data, (gssize)bytes);
    g_hmac_update(hmac, (const guchar *)text, -1);
    snprintf(out, 65, "%s", g_hmac_get_string(hmac));
    g_hmac_unref(hmac);
}

static uint32_t now_s(void)
{
    return (uint32_t)(sst_clock_now_ns() / 1000000000);
}

static void make_nonce(char out[NONCE], uint32_t at_s, const uint8_t network[16])
{
    char signature[65];

    snprintf(out, NONCE, "%08x", (unsigned)at_s);
    sign(signature, network, 16, out);
    snprintf(out + 8, NONCE - 8, "%.32s", signature);
}

/* @return false: not of this process, or another address's */
static bool read_nonce(const char *nonce, const uint8_t network[16], bool *old)
{
    char ours[NONCE];
    unsigned at_s;

    if (strlen(nonce) != NONCE - 1 || sscanf(nonce, "%8x", &at_s) != 1)
        return false;
    make_nonce(ours, at_s, network);
    *old = now_s() - at_s > NONCE_S;
    return !strcmp(ours, nonce);
}

/* --- passwords ---------------------------------------------------------------------------------------------------- */

static const char *param(const GstRTSPAuthCredential *c, const char *name)
{
    for (GstRTSPAuthParam **p = c->params; p && *p; p++)
        if (!g_ascii_strcasecmp((*p)->name, name) && (*p)->value)
            return (*p)->value;
    return NULL;
}

static enum verdict judge_digest(const struct login_state *s, const GstRTSPContext *ctx, const GstRTSPAuthCredential *c)
{
    const char *user = param(c, "username"), *realm = param(c, "realm"), *nonce = param(c, "nonce"),
               *uri = param(c, "uri"), *response = param(c, "response");
    gchar *want;
    bool old, right;

    if (nonce && !read_nonce(nonce, s->network, &old))
        return LOGIN_STRAY;
    if (!user || !realm || !nonce || !uri || !response)
        return LOGIN_WRONG;
    want =
        gst_rtsp_generate_digest_auth_response_from_md5(NULL, gst_rtsp_method_as_text(ctx->method), at.ha1, uri, nonce);
    right = !strcmp(user, at.user) && !strcmp(realm, REALM) && want && !g_ascii_strcasecmp(want, response);
    g_free(want);
    if (!right)
        return LOGIN_WRONG;
    return old && !s->proven ? LOGIN_STALE : LOGIN_RIGHT;
}

/* One password of a request: a list would be as many guesses. */
static enum verdict judge(const struct login_state *s, const GstRTSPContext *ctx)
{
    GstRTSPAuthCredential **given = gst_rtsp_message_parse_auth_credentials(ctx->request, GST_RTSP_HDR_AUTHORIZATION);
    const GstRTSPAuthCredential *c = given ? given[0] : NULL;
    enum verdict verdict = LOGIN_WRONG;
    char signature[65];

    if (c && c->scheme == GST_RTSP_AUTH_DIGEST) {
        verdict = judge_digest(s, ctx, c);
    } else if (c && c->scheme == GST_RTSP_AUTH_BASIC && c->authorization) {
        sign(signature, "", 0, c->authorization);
        verdict = strcmp(signature, at.basic) ? LOGIN_WRONG : LOGIN_RIGHT;
    }
    gst_rtsp_auth_credentials_free(given);
    return verdict;
}

/* --- guessing clients --------------------------------------------------------------------------------------------- */

/* All clients of an address share its attempts, but a program that has had the right password before: a guessing client
 * beside it does not cut it off. */
static void identify(const struct login_state *s, const GstRTSPContext *ctx, uint8_t who[16], bool remember)
{
    gchar *agent = NULL;
    char signature[65];
    bool known = false;

    (void)gst_rtsp_message_get_header(ctx->request, GST_RTSP_HDR_USER_AGENT, &agent, 0);
    sign(signature, s->network, 16, agent ? agent : "");
    pthread_mutex_lock(&at.lock);
    for (int i = 0; i < VIEWERS && !known; i++)
        known = !memcmp(at.viewer[i], signature, 16);
    if (remember && !known) {
        memcpy(at.viewer[at.next], signature, 16);
        at.next = (at.next + 1) % VIEWERS;
        known = true;
    }
    pthread_mutex_unlock(&at.lock);
    memcpy(who, known ? (const uint8_t *)signature : s->network, 16);
}

static void sleep_ns(int64_t ns)
{
    const struct timespec pause = { .tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000 };

    nanosleep(&pause, NULL);
}

/* An address that has guessed waits its turn. @return false: too many of it do already */
static bool wait_turn(const struct login_state *s, const GstRTSPContext *ctx)
{
    uint8_t who[16];
    int64_t wait_ns;

    if (s->proven)
        return true;
    identify(s, ctx, who, false);
    wait_ns = sst_brake_turn(&at.wrong, who, sst_clock_now_ns());
    if (wait_ns > 0) {
        rtsp_set_busy(ctx->client);
        sleep_ns(wait_ns);
    }
    return wait_ns >= 0;
}

static void count_attempt(const struct login_state *s, const GstRTSPContext *ctx)
{
    const gchar *ip = gst_rtsp_connection_get_ip(ctx->conn);
    bool first = false;
    uint8_t who[16];
    int left_s;

    rtsp_report_refused(ip ? ip : "unknown");
    identify(s, ctx, who, false);
    left_s = sst_brake_wrong(&at.wrong, who, sst_clock_now_ns(), &first);
    if (first)
        sst_log_warning("rtsp: %s sent %d wrong passwords within a minute: for %d s one each %d s is looked at", ip,
                        SST_BRAKE_WRONG + 1, left_s, SST_BRAKE_TURN_S);
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
    char nonce[NONCE];
    gchar *digest;

    gst_rtsp_message_init_response(ctx->response, GST_RTSP_STS_UNAUTHORIZED,
                                   gst_rtsp_status_as_text(GST_RTSP_STS_UNAUTHORIZED), ctx->request);
    make_nonce(nonce, now_s(), s->network);
    digest = g_strdup_printf("Digest realm=\"" REALM "\", nonce=\"%s\"%s", nonce, stale ? ", stale=true" : "");
    gst_rtsp_message_add_header(ctx->response, GST_RTSP_HDR_WWW_AUTHENTICATE, "Basic realm=\"" REALM "\"");
    gst_rtsp_message_take_header(ctx->response, GST_RTSP_HDR_WWW_AUTHENTICATE, digest);
    gst_rtsp_client_send_message(ctx->client, ctx->session, ctx->response);
}

static gboolean is_allowed(GstRTSPContext *ctx)
{
    struct login_state *s = state_of(ctx);
    enum verdict verdict = LOGIN_NONE;
    uint8_t who[16];
    bool counted;
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
    if (verdict == LOGIN_RIGHT) {
        identify(s, ctx, who, true);
        s->proven = true;
        s->wrong = 0;
        return TRUE;
    }
    /* A few strays a minute are free: every client sends one after a restart. */
    if (verdict == LOGIN_WRONG ||
        (verdict == LOGIN_STRAY && sst_brake_wrong(&at.stray, s->network, sst_clock_now_ns(), &counted) > 0))
        count_attempt(s, ctx);
    if (verdict == LOGIN_WRONG || verdict == LOGIN_STRAY)
        sleep_ns(PAUSE_MS * INT64_C(1000000)); /* an attempt is slowed down */
    if (++s->wrong >= WRONG_MAX)
        rtsp_disconnect(ctx->client);
    refuse(s, ctx, verdict == LOGIN_STALE);
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

int rtsp_set_login(GstRTSPServer *server, const struct rtsp_login *login)
{
    GstRTSPAuth *auth;
    gchar *basic, *digest, *ha1;

    if (getentropy(at.secret, SECRET)) {
        const int err = -errno;

        sst_log_error("rtsp: no random numbers: %s", strerror(-err));
        return err;
    }
    basic = gst_rtsp_auth_make_basic(login->user, login->password);
    digest = g_strdup_printf("%s:" REALM ":%s", login->user, login->password);
    ha1 = g_compute_checksum_for_string(G_CHECKSUM_MD5, digest, -1);
    snprintf(at.user, sizeof(at.user), "%s", login->user);
    snprintf(at.ha1, sizeof(at.ha1), "%s", ha1);
    sign(at.basic, "", 0, basic);
    explicit_bzero(basic, strlen(basic));
    explicit_bzero(digest, strlen(digest));
    g_free(basic);
    g_free(digest);
    g_free(ha1);
    sst_brake_init(&at.wrong);
    sst_brake_init(&at.stray);
    auth = g_object_new(auth_type(), NULL);
    gst_rtsp_server_set_auth(server, auth);
    g_object_unref(auth);
    return 0;
}
