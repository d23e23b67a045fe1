/* Notifications: test vectors of RFC 8291, addresses, stored subscriptions, and a push service on this machine. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "daemon/publish/push_internal.h"
#include "tests/test.h"

#if WITH_PUSH
#include <gnutls/abstract.h>
#include <gnutls/crypto.h>
#include <nettle/bignum.h>
#include <nettle/ecc-curve.h>
#include <nettle/ecc.h>

/* RFC 8291, appendix A. */
#define TEXT       "When I grow up, I want to be a watermelon"
#define UA_PRIVATE "q1dXpw3UpT5VOmu_cf_v6ih07Aems3njxI-JWgLcM94"
#define UA_PUBLIC  "BCVxsr7N_eNgVRqvHtD0zTZsEc6-VV-JvLexhqUzORcxaOzi6-AYWXvTBHm4bjyPjs7Vd8pZGH6SRpkNtoIAiw4"
#define AUTH       "BTBZMqHH6r4Tts7J_aSIgg"
#define AS_PRIVATE "yfWPiYE-n46HLnH0KqZOF1fJJU3MYrct3AELtAQ-oRw"
#define SALT       "DGv6ra1nlYgDCS1FRnbzlw"
#define BODY                                                                                                           \
    "DGv6ra1nlYgDCS1FRnbzlwAAEABBBP4z9KsN6nGRTbVYI_c7VJSPQTBtkgcy27mlmlMoZIIgDll6e3vCYLocInmYWAmS6TlzAC8wEqKK6PBru3jl" \
    "7A_yl95bQpu6cVPTpK4Mqgkf1CXztLVBSt2Ks3oZwbuwXPXLWyouBWLVWGNWQexSgSxsj_Qulcy4a-fN"

static char folder[] = "/tmp/sst-push-XXXXXX";

static const char *in(const char *name)
{
    static char path[4][SST_PATH_MAX];
    static int next;

    next = (next + 1) % 4;
    assert_int_equal(sst_path_join(path[next], folder, name), 0);
    return path[next];
}

static struct push_receiver receiver(void)
{
    struct push_receiver to;

    assert_true(push_from_base64(UA_PUBLIC, to.point, PUSH_POINT));
    assert_true(push_from_base64(AUTH, to.auth, PUSH_AUTH));
    return to;
}

static void messages_are_those_of_the_rfc(void **state)
{
    const struct push_receiver to = receiver();
    uint8_t secret[PUSH_SECRET], salt[PUSH_SALT], body[PUSH_BODY_MOST], other[PUSH_BODY_MOST];
    char text[PUSH_BASE64(PUSH_BODY_MOST)];
    int n;

    (void)state;
    assert_true(push_from_base64(AS_PRIVATE, secret, sizeof(secret)) && push_from_base64(SALT, salt, sizeof(salt)));
    n = push_encrypt(&to, TEXT, secret, salt, body);
    assert_int_equal(n, 144);
    push_base64(text, body, (size_t)n);
    assert_string_equal(text, BODY);
    /* Without given ones they are random. */
    assert_int_equal(push_encrypt(&to, TEXT, NULL, NULL, body), 144);
    assert_int_equal(push_encrypt(&to, TEXT, NULL, NULL, other), 144);
    assert_memory_not_equal(body, other, 16);
    assert_memory_not_equal(body + 21, other + 21, 65);
}

static void base64_is_that_of_addresses(void **state)
{
    static const struct {
        const char *bytes, *text;
    } all[] = { { "", "" }, { "f", "Zg" }, { "fo", "Zm8" }, { "foo", "Zm9v" }, { "foob", "Zm9vYg" }, { "\xff\xfe\xfd", "__79" } };
    uint8_t got[8];
    char text[16];

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(all); i++) {
        const size_t n = strlen(all[i].bytes);

        push_base64(text, all[i].bytes, n);
        assert_string_equal(text, all[i].text);
        assert_true(push_from_base64(text, got, n));
        assert_memory_equal(got, all[i].bytes, n);
        assert_false(push_from_base64(text, got, n + 1));
    }
    assert_true(push_from_base64("Zg==", got, 1));
    assert_true(push_from_base64("//79", got, 3));
    assert_false(push_from_base64("Z=g=", got, 1));
    assert_false(push_from_base64("Z*", got, 1));
}

static void points_are_checked(void **state)
{
    struct push_receiver to = receiver();

    (void)state;
    assert_true(push_point_good(to.point));
    to.point[40] ^= 1;
    assert_false(push_point_good(to.point)); /* not on the curve */
    to.point[40] ^= 1;
    to.point[0] = 2;
    assert_false(push_point_good(to.point));
}

static void addresses_are_limited(void **state)
{
    static const struct {
        const char *endpoint, *origin; /* NULL: refused */
    } all[] = {
        { "https://fcm.googleapis.com/fcm/send/abc:APA91", "https://fcm.googleapis.com" },
        { "https://updates.push.services.mozilla.com/wpush/v2/gAAA", "https://updates.push.services.mozilla.com" },
        { "https://web.push.apple.com:443/x", "https://web.push.apple.com:443" },
        { "http://fcm.googleapis.com/x", NULL },
        { "https://evilfcm.googleapis.com.example/x", NULL },
        { "https://notfcm.googleapis.com/x", NULL },
        { "https://fcm.googleapis.com@127.0.0.1/x", NULL },
        { "https://127.0.0.1/x", NULL },
        { "https://[::1]/x", NULL },
        { "https://fcm.googleapis.com\r\nX: y/", NULL },
        { "https://", NULL },
        { "ftp://fcm.googleapis.com/", NULL },
    };
    static const struct {
        const char *address;
        bool private_;
    } hosts[] = {
        { "8.8.8.8", false }, { "127.0.0.1", true }, { "10.1.2.3", true }, { "172.15.0.1", false }, { "172.16.0.1", true },
        { "172.31.255.255", true }, { "172.32.0.1", false }, { "192.168.1.1", true }, { "169.254.169.254", true }, { "100.64.0.1", true },
        { "0.0.0.0", true }, { "224.0.0.1", true }, { "255.255.255.255", true }, { "198.18.0.1", true }, { "198.20.0.1", false },
        { "2a00:1450:4001:80e::200a", false }, { "2600::1", false }, { "::1", true }, { "::", true }, { "fe80::1", true }, { "fd00::1", true },
        { "::ffff:127.0.0.1", true }, { "::ffff:8.8.8.8", false }, { "64:ff9b::a00:1", true }, { "64:ff9b::808:808", false },
        { "2002:7f00:1::", true }, { "2001:db8::1", true }, { "ff02::1", true },
    };
    struct sst_push_settings s = { .enabled = true };
    char origin[300], error[512];

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(all); i++) {
        const int err = push_check_endpoint(&s, all[i].endpoint, origin, error);

        if (err != (all[i].origin ? 0 : -EINVAL))
            fail_msg("%s: %d", all[i].endpoint, err);
        if (!err)
            assert_string_equal(origin, all[i].origin);
    }
    s.hosts = 1;
    strcpy(s.host[0], "push.example");
    assert_int_equal(push_check_endpoint(&s, "https://a.push.example/x", origin, error), 0);
    assert_int_equal(push_check_endpoint(&s, "https://fcm.googleapis.com/x", origin, error), -EINVAL);
    assert_non_null(strstr(error, "push: hosts"));
    for (size_t i = 0; i < ARRAY_LEN(hosts); i++) {
        struct sockaddr_in v4 = { .sin_family = AF_INET };
        struct sockaddr_in6 v6 = { .sin6_family = AF_INET6 };
        const bool six = strchr(hosts[i].address, ':');

        assert_int_equal(six ? inet_pton(AF_INET6, hosts[i].address, &v6.sin6_addr) : inet_pton(AF_INET, hosts[i].address, &v4.sin_addr), 1);
        if (push_is_private(six ? (struct sockaddr *)&v6 : (struct sockaddr *)&v4) != hosts[i].private_)
            fail_msg("%s is taken to be %s", hosts[i].address, hosts[i].private_ ? "public" : "private");
    }
}

/* --- a push service ----------------------------------------------------------------------------------------------- */

static pid_t server;
static int port;

static void start_server(void)
{
    char line[SST_PATH_MAX * 3], text[16];

    snprintf(line, sizeof(line),
             "cd %s && openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=localhost "
             "-addext subjectAltName=DNS:localhost,IP:127.0.0.1 -keyout key.pem -out cert.pem 2>/dev/null",
             folder);
    assert_int_equal(system(line), 0);
    server = fork();
    if (!server) {
        execl("/usr/bin/python3", "python3", "tests/push_server.py", folder, in("cert.pem"), in("key.pem"), NULL);
        _exit(127);
    }
    for (int i = 0; i < 6000 && !port; i++) {
        port = atoi(sst_file_line(text, sizeof(text), in("port")));
        usleep(10000);
    }
    assert_true(port > 0);
}

static int end_server(void **state)
{
    char line[SST_PATH_MAX];

    (void)state;
    if (server > 0) {
        kill(server, SIGKILL);
        waitpid(server, NULL, 0);
    }
    snprintf(line, sizeof(line), "rm -rf %s", folder);
    return system(line);
}

static void endpoint(char out[100], const char *path)
{
    snprintf(out, 100, "https://localhost:%d/%s", port, path);
}

static json_t *subscription(const char *path, const char *label, const char *zone)
{
    char where[100];

    endpoint(where, path);
    return json_pack("{s:s, s:s, s:s, s:o, s:o, s:i}", "endpoint", where, "p256dh", UA_PUBLIC, "auth", AUTH, "labels",
                     label ? json_pack("[s]", label) : json_array(), "zones", zone ? json_pack("[s]", zone) : json_array(),
                     "cool_down_s", 0);
}

static void subscribe(struct sst_push *p, json_t *o)
{
    char error[512];

    if (sst_push_change(p, o, error))
        fail_msg("%s", error);
    json_decref(o);
}

static int64_t number(struct sst_push *p, const char *key)
{
    json_t *o = sst_push_state(p);
    const int64_t n = json_integer_value(json_object_get(o, key));

    json_decref(o);
    return n;
}

static void wait_for(struct sst_push *p, const char *key, int64_t want)
{
    const int64_t end_ns = sst_clock_now_ns() + 120000000000;

    while (number(p, key) != want) {
        if (sst_clock_now_ns() > end_ns)
            fail_msg("%s is %lld, not %lld", key, (long long)number(p, key), (long long)want);
        usleep(5000);
    }
}

/* The request of a number. */
static json_t *request(int n)
{
    char name[32];
    json_t *o;

    snprintf(name, sizeof(name), "%d.json", n);
    o = json_load_file(in(name), 0, NULL);
    assert_non_null(o);
    return o;
}

static const char *header(const json_t *o, const char *name)
{
    const char *text = json_string_value(json_object_get(json_object_get(o, "headers"), name));

    return text ? text : "";
}

static void hkdf(const uint8_t *salt, const uint8_t *secret, const void *info, size_t n, uint8_t *out, size_t bytes)
{
    uint8_t prk[32];
    const gnutls_datum_t salt_at = { (uint8_t *)(uintptr_t)salt, 16 }, secret_at = { (uint8_t *)(uintptr_t)secret, 32 }, prk_at = { prk, 32 },
                         info_at = { (uint8_t *)(uintptr_t)info, (unsigned)n };

    assert_int_equal(gnutls_hkdf_extract(GNUTLS_MAC_SHA256, &secret_at, &salt_at, prk), 0);
    assert_int_equal(gnutls_hkdf_expand(GNUTLS_MAC_SHA256, &prk_at, &info_at, out, bytes), 0);
}

/* As a browser does: by its private key. @return the message, to release */
static json_t *decrypt(int n)
{
    const struct push_receiver to = receiver();
    uint8_t *body, secret[32], shared[32], ikm[32], key[16], nonce[12], plain[PUSH_BODY_MOST], info[144];
    size_t size, bytes = sizeof(plain);
    const gnutls_datum_t key_at = { key, 16 };
    gnutls_aead_cipher_hd_t cipher;
    struct ecc_scalar scalar;
    struct ecc_point point;
    char name[32];
    mpz_t x, y;
    json_t *o;

    snprintf(name, sizeof(name), "%d.body", n);
    assert_int_equal(sst_file_read(in(name), PUSH_BODY_MOST, &body, &size), 0);
    assert_true(size > 86 + 17 && body[20] == 65 && push_from_base64(UA_PRIVATE, secret, 32));
    ecc_scalar_init(&scalar, nettle_get_secp_256r1());
    ecc_point_init(&point, nettle_get_secp_256r1());
    nettle_mpz_init_set_str_256_u(x, 32, secret);
    assert_int_equal(ecc_scalar_set(&scalar, x), 1);
    nettle_mpz_set_str_256_u(x, 32, body + 22);
    nettle_mpz_init_set_str_256_u(y, 32, body + 54);
    assert_int_equal(ecc_point_set(&point, x, y), 1);
    ecc_point_mul(&point, &scalar, &point);
    ecc_point_get(&point, x, y);
    nettle_mpz_get_str_256(32, shared, x);
    mpz_clear(x);
    mpz_clear(y);
    ecc_point_clear(&point);
    ecc_scalar_clear(&scalar);
    memcpy(info, "WebPush: info", 14);
    memcpy(info + 14, to.point, 65);
    memcpy(info + 79, body + 21, 65);
    hkdf(to.auth, shared, info, 144, ikm, 32);
    hkdf(body, ikm, "Content-Encoding: aes128gcm", 28, key, 16);
    hkdf(body, ikm, "Content-Encoding: nonce", 24, nonce, 12);
    assert_int_equal(gnutls_aead_cipher_init(&cipher, GNUTLS_CIPHER_AES_128_GCM, &key_at), 0);
    assert_int_equal(gnutls_aead_cipher_decrypt(cipher, nonce, 12, NULL, 0, 16, body + 86, size - 86, plain, &bytes), 0);
    gnutls_aead_cipher_deinit(cipher);
    free(body);
    assert_int_equal(plain[bytes - 1], 2);
    o = json_loadb((char *)plain, bytes - 1, 0, NULL);
    assert_non_null(o);
    return o;
}

/* "vapid t=TOKEN, k=KEY": the token is signed by the key, for this origin, and not for long. */
static void check_vapid(const char *text, const char *key, const char *audience)
{
    uint8_t point[65], signature[64], claims[300];
    char token[1024], got[128], *dot, *last;
    gnutls_datum_t x = { point + 1, 32 }, y = { point + 33, 32 }, r = { signature, 32 }, s = { signature + 32, 32 }, made, data;
    gnutls_pubkey_t public;
    json_t *o;

    assert_int_equal(sscanf(text, "vapid t=%1023[^,], k=%127s", token, got), 2);
    assert_string_equal(got, key);
    assert_true(push_from_base64(key, point, 65));
    last = strrchr(token, '.');
    assert_true(push_from_base64(last + 1, signature, 64));
    *last = 0;
    data = (gnutls_datum_t){ (uint8_t *)token, (unsigned)strlen(token) };
    assert_int_equal(gnutls_pubkey_init(&public), 0);
    assert_int_equal(gnutls_pubkey_import_ecc_raw(public, GNUTLS_ECC_CURVE_SECP256R1, &x, &y), 0);
    assert_int_equal(gnutls_encode_rs_value(&made, &r, &s), 0);
    assert_true(gnutls_pubkey_verify_data2(public, GNUTLS_SIGN_ECDSA_SHA256, 0, &data, &made) >= 0);
    gnutls_free(made.data);
    gnutls_pubkey_deinit(public);
    dot = strchr(token, '.');
    assert_true(push_from_base64(dot + 1, claims, strlen(dot + 1) * 3 / 4));
    o = json_loadb((char *)claims, strlen(dot + 1) * 3 / 4, 0, NULL);
    assert_string_equal(json_string_value(json_object_get(o, "aud")), audience);
    assert_string_equal(json_string_value(json_object_get(o, "sub")), "mailto:guard@example.org");
    assert_in_range(json_integer_value(json_object_get(o, "exp")), time(NULL) + 3600, time(NULL) + 24 * 3600);
    json_decref(o);
}

static void emit(struct sst_events *events, const char *visit, const char *label, const char *zone, bool active)
{
    sst_events_emit(events, SST_EVENT_INFO, "visit", json_pack("{s:s, s:b, s:s, s:o}", "visit", visit, "active", active, "label", label, "zones", zone ? json_pack("[s]", zone) : json_array()),
                    "%s came", label);
}

static void check_message(int n, const char *path, const char *title)
{
    json_t *o = decrypt(n), *r = request(n);

    assert_string_equal(json_string_value(json_object_get(r, "path")), path);
    assert_string_equal(json_string_value(json_object_get(o, "title")), title);
    json_decref(o);
    json_decref(r);
}

static struct sst_push_settings settings(void)
{
    struct sst_push_settings s = { .enabled = true, .hosts = 1, .private_hosts = true, .cool_down_s = 3600 };

    strcpy(s.host[0], "localhost");
    strcpy(s.contact, "mailto:guard@example.org");
    snprintf(s.ca_file, sizeof(s.ca_file), "%s", in("cert.pem"));
    return s;
}

static void emit_line(struct sst_events *events, const char *visit, const char *zone)
{
    sst_events_emit(events, SST_EVENT_INFO, "line", json_pack("{s:s, s:s, s:s, s:s}", "visit", visit, "label", "Pedestrian", "zone", zone, "direction", "forward"),
                    "Pedestrian crossed %s forward", zone);
}

/* A visit and a crossing each, then nothing for an hour. @param n  number of the first request */
static void check_cool_downs(struct sst_push *p, struct sst_events *events, int n)
{
    json_t *o = subscription("lines/201", NULL, "drive");
    char where[100];

    json_object_set_new(o, "cool_down_s", json_integer(3600));
    subscribe(p, o);
    emit(events, "w1", "Pedestrian", "drive", true);
    emit_line(events, "w1", "drive");
    emit_line(events, "w1", "drive");
    emit_line(events, "w2", "drive");
    emit(events, "w2", "Pedestrian", "drive", true);
    wait_for(p, "sent", 2);
    check_message(n, "/lines/201", "Pedestrian in drive");
    check_message(n + 1, "/lines/201", "Pedestrian crossed drive forward");
    endpoint(where, "lines/201");
    subscribe(p, json_pack("{s:s, s:b}", "endpoint", where, "test", 1));
    wait_for(p, "sent", 3);
    check_message(n + 2, "/lines/201", "Notifications work");
}

static void visits_reach_browsers(void **state)
{
    struct sst_push_settings set;
    struct sst_events *events;
    struct sst_push *p;
    char where[100], audience[64], error[512];
    struct stat st;
    json_t *o, *key;

    (void)state;
    start_server();
    set = settings();
    const struct sst_push_config cfg = { .beside = in("token"), .settings = &set, .site = "Yard", .page = "https://cam.example/yard" };
    struct sst_push_config opened = cfg;

    assert_int_equal(sst_events_create(&events, 64), 0);
    opened.events = events;
    emit(events, "before", "Pedestrian", "gate", true); /* nobody is told of the past */
    assert_int_equal(sst_push_open(&p, &opened), 0);
    subscribe(p, subscription("all/201", NULL, NULL));
    subscribe(p, subscription("persons/201", "Pedestrian", "gate"));
    key = sst_push_state(p);
    assert_true(json_is_true(json_object_get(key, "supported")));
    assert_int_equal(stat(in("push.json"), &st), 0);
    assert_int_equal(st.st_mode & 0777, 0600);
    assert_int_equal(stat(in("push-key.pem"), &st), 0);
    assert_int_equal(st.st_mode & 0777, 0600);
    /* Of a car one browser hears, of a person in the zone both, of the end of a visit none. */
    emit(events, "v1", "Car", "street", true);
    wait_for(p, "sent", 1);
    emit(events, "v1", "Car", "street", false);
    emit(events, "v2", "Pedestrian", "gate", true);
    wait_for(p, "sent", 3);
    emit(events, "v2", "Pedestrian", "gate", true); /* again, of the same */
    o = request(0);
    assert_string_equal(header(o, "content-encoding"), "aes128gcm");
    assert_string_equal(header(o, "urgency"), "high");
    assert_string_equal(header(o, "ttl"), "600");
    snprintf(audience, sizeof(audience), "https://localhost:%d", port);
    check_vapid(header(o, "authorization"), json_string_value(json_object_get(key, "key")), audience);
    json_decref(o);
    json_decref(key);
    check_message(0, "/all/201", "Car in street");
    check_message(1, "/all/201", "Pedestrian in gate");
    check_message(2, "/persons/201", "Pedestrian in gate");
    o = decrypt(2);
    assert_string_equal(json_string_value(json_object_get(o, "body")), "Yard: Pedestrian came");
    assert_string_equal(json_string_value(json_object_get(o, "url")), "https://cam.example/yard/#visit=v2");
    assert_string_equal(json_string_value(json_object_get(o, "picture")), "/api/v1/visits/v2/seen");
    json_decref(o);
    emit_line(events, "v2", "gate");
    wait_for(p, "sent", 4);
    check_message(3, "/persons/201", "Pedestrian crossed gate forward");
    /* One that is gone is removed, and stays so; a busy service is tried again. */
    subscribe(p, subscription("old/410", NULL, NULL));
    subscribe(p, subscription("busy/503-201", "Dog", NULL));
    wait_for(p, "subscriptions", 4);
    emit(events, "v3", "Dog", NULL, true);
    wait_for(p, "subscriptions", 3);
    wait_for(p, "sent", 6);
    assert_int_equal(number(p, "failed"), 0);
    /* The cool-down of the configuration, where the browser has none of its own. */
    o = subscription("busy/503-201", "Dog", NULL);
    json_object_set_new(o, "cool_down_s", json_null());
    subscribe(p, o);
    emit(events, "v4", "Dog", NULL, true);
    wait_for(p, "sent", 7); /* of all/201 alone */
    /* Labels that come late. */
    emit(events, "v5", "", "gate", true);
    wait_for(p, "sent", 8);
    emit(events, "v5", "Pedestrian", "gate", false);
    wait_for(p, "sent", 9);
    check_message(10, "/persons/201", "Pedestrian in gate");
    /* Another filter, a test, the end. */
    endpoint(where, "all/201");
    subscribe(p, json_pack("{s:s, s:b}", "endpoint", where, "test", 1));
    wait_for(p, "sent", 10);
    subscribe(p, json_pack("{s:s, s:b}", "endpoint", where, "delete", 1));
    o = json_pack("{s:s, s:b}", "endpoint", where, "delete", 1);
    assert_int_equal(sst_push_change(p, o, error), -ENOENT);
    json_decref(o);
    wait_for(p, "subscriptions", 2);
    sst_push_close(p);
    assert_int_equal(sst_push_open(&p, &opened), 0);
    assert_int_equal(number(p, "subscriptions"), 2);
    check_cool_downs(p, events, 12);
    /* Without leave nothing connects to this machine, whatever its name says. */
    set.private_hosts = false;
    sst_push_configure(p, &set, "Yard");
    endpoint(where, "persons/201");
    subscribe(p, json_pack("{s:s, s:b}", "endpoint", where, "test", 1));
    wait_for(p, "failed", 1);
    set.enabled = false;
    sst_push_configure(p, &set, "Yard");
    o = sst_push_state(p);
    assert_false(json_is_true(json_object_get(o, "supported")));
    json_decref(o);
    o = json_pack("{s:s, s:b}", "endpoint", where, "test", 1);
    assert_int_equal(sst_push_change(p, o, error), -ENOTSUP); /* nothing is sent any more */
    json_decref(o);
    sst_push_close(p);
    assert_int_equal(access(in("15.json"), F_OK), -1);
    sst_events_shut(events);
    sst_events_destroy(events);
}

static void subscriptions_are_limited(void **state)
{
    const struct sst_push_settings set = settings();
    struct sst_push_config cfg = { .beside = in("more/token"), .settings = &set, .site = "", .page = "" };
    struct sst_push *p;
    char path[32], error[512];
    json_t *o;

    (void)state;
    assert_int_equal(mkdir(in("more"), 0700), 0);
    assert_int_equal(sst_file_write(in("more/push.json"), "[{\"endpoint\":", 13), 0); /* damaged */
    assert_int_equal(sst_events_create(&cfg.events, 16), 0);
    assert_int_equal(sst_push_open(&p, &cfg), 0);
    for (int i = 0; i <= SST_PUSH_MAX; i++) {
        snprintf(path, sizeof(path), "%d/201", i);
        o = subscription(path, NULL, NULL);
        assert_int_equal(sst_push_change(p, o, error), i < SST_PUSH_MAX ? 0 : -EOVERFLOW);
        json_decref(o);
    }
    static const char *const bad[] = { "{\"auth\": \"x\"}", "{\"p256dh\": \"BCVx\"}", "{\"endpoint\": \"https://example.org/\"}", "{\"labels\": [\"a,b\"]}", "{\"zones\": \"x\"}", "{\"cool_down_s\": -1}" };

    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        json_t *change = json_loads(bad[i], 0, NULL);

        o = subscription("0/201", NULL, NULL);
        json_object_update(o, change);
        if (sst_push_change(p, o, error) != -EINVAL)
            fail_msg("accepted: %s", bad[i]);
        json_decref(change);
        json_decref(o);
    }
    sst_push_close(p);
    sst_events_shut(cfg.events);
    sst_events_destroy(cfg.events);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(messages_are_those_of_the_rfc), cmocka_unit_test(base64_is_that_of_addresses),
        cmocka_unit_test(points_are_checked),            cmocka_unit_test(addresses_are_limited),
        cmocka_unit_test(visits_reach_browsers),         cmocka_unit_test(subscriptions_are_limited),
    };

    if (!mkdtemp(folder))
        return 1;
    return cmocka_run_group_tests(tests, NULL, end_server);
}

#else

int main(void)
{
    puts("built without libcurl, GnuTLS or Nettle");
    return 77;
}

#endif
