/* sst-onvif without a network: XML of requests, values, passwords, every answer, events and subscriptions, discovery. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/test.h"

#include <stdio.h>

#ifndef WITH_ONVIF
#define WITH_ONVIF 0
#endif
#if WITH_ONVIF

#include <errno.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "publishers/onvif/onvif_internal.h"

#define SOAP   "http://www.w3.org/2003/05/soap-envelope"
#define TDS    "http://www.onvif.org/ver10/device/wsdl"
#define TRT    "http://www.onvif.org/ver10/media/wsdl"
#define TR2    "http://www.onvif.org/ver20/media/wsdl"
#define TEV    "http://www.onvif.org/ver10/events/wsdl"
#define WSNT   "http://docs.oasis-open.org/wsn/b-2"
#define WSD    "http://schemas.xmlsoap.org/ws/2005/04/discovery"
#define SECOND INT64_C(1000000000)

static struct sst_server server;
static struct sst_login login;
static struct auth auth;
static char path[64] = "/onvif/device_service";

/* The parts that need a network are not called here. */
int http_port(void)
{
    return 8000;
}

void http_host(char out[ONVIF_HOST], const char *local)
{
    snprintf(out, ONVIF_HOST, "%s", local);
}

/* --- XML ---------------------------------------------------------------------------------------------------------- */

static int parse(struct soap *s, const char *text)
{
    return soap_parse(s, text, strlen(text));
}

static void a_request_is_found(void **state)
{
    struct soap s;
    int token;

    (void)state;
    assert_int_equal(
        parse(&s, "<?xml version=\"1.0\"?><a:Envelope xmlns:a=\"" SOAP "\"><a:Header><b:Security xmlns:b=\"http://docs.oasis-open"
                  ".org/wss/2004/01/oasis-200401-wss-wssecurity-secext-1.0.xsd\"><b:UsernameToken><b:Username> me &amp; you\n"
                  "</b:Username><b:Password Type=\"x#PasswordDigest\">cXl6</b:Password></b:UsernameToken></b:Security>"
                  "</a:Header><a:Body><GetProfile xmlns=\"" TRT "\"> <ProfileToken>main</ProfileToken> tail</GetProfile>"
                  "</a:Body></a:Envelope>"),
        0);
    assert_int_equal(s.node[s.call].ns, SOAP_NS_MEDIA);
    assert_string_equal(s.node[s.call].name, "GetProfile");
    assert_string_equal(soap_text(&s, s.call, "ProfileToken"), "main");
    assert_null(soap_text(&s, s.call, "Other"));
    token = soap_child(&s, soap_child(&s, s.header, "Security"), "UsernameToken");
    assert_string_equal(soap_text(&s, token, "Username"), "me & you");
    assert_string_equal(s.node[soap_child(&s, token, "Password")].type, "x#PasswordDigest");
    soap_free(&s);
}

static void what_is_no_request(void **state)
{
    static const char *const texts[] = {
        "",
        "hello",
        "<a/>",
        "<Envelope><Body><x/></Body></Envelope>",
        "<e:Envelope xmlns:e=\"" SOAP "\"><e:Body/></e:Envelope>",
        "<e:Envelope xmlns:e=\"" SOAP "\"><e:Header/></e:Envelope>",
        "<e:Envelope xmlns:e=\"" SOAP "\"><e:Body><x></e:Body></e:Envelope>",
        "<!DOCTYPE a [<!ENTITY b \"c\">]><e:Envelope xmlns:e=\"" SOAP "\"><e:Body><x>&b;</x></e:Body></e:Envelope>",
        "<!DOCTYPE a SYSTEM \"file:///etc/passwd\"><e:Envelope xmlns:e=\"" SOAP "\"><e:Body><x/></e:Body></e:Envelope>",
        "<e:Envelope xmlns:e=\"" SOAP "\"><e:Body><x>&b;</x></e:Body></e:Envelope>",
    };
    struct soap s;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(texts); i++) {
        if (parse(&s, texts[i]) != -EBADMSG)
            fail_msg("accepted: %s", texts[i]);
        soap_free(&s);
    }
}

/* @param each  opened count times, then closed */
static int parse_many(const char *open, const char *close, int count)
{
    char *text = calloc(1, 65536);
    struct soap s;
    int err;

    strcpy(text, "<e:Envelope xmlns:e=\"" SOAP "\"><e:Body><x>");
    for (int i = 0; i < count; i++)
        strcat(text, open);
    for (int i = 0; i < count; i++)
        strcat(text, close);
    strcat(text, "</x></e:Body></e:Envelope>");
    err = parse(&s, text);
    soap_free(&s);
    free(text);
    return err;
}

static void requests_are_bounded(void **state)
{
    (void)state;
    assert_int_equal(parse_many("<a>", "</a>", SOAP_DEPTH - 3), 0);
    assert_int_equal(parse_many("<a>", "</a>", SOAP_DEPTH - 2), -E2BIG);
    assert_int_equal(parse_many("<a/>", "", SOAP_NODES - 3), 0);
    assert_int_equal(parse_many("<a/>", "", SOAP_NODES - 2), -E2BIG);
}

/* --- values ------------------------------------------------------------------------------------------------------- */

static void times_are_read(void **state)
{
    static const struct {
        const char *text;
        int64_t ms; /* -1: none */
    } times[] = {
        { "1970-01-01T00:00:00Z", 0 },
        { "2010-09-16T07:50:45Z", INT64_C(1284623445000) },
        { "2010-09-16T07:50:45.25Z", INT64_C(1284623445250) },
        { "2010-09-16T09:50:45+02:00", INT64_C(1284623445000) },
        { "2010-09-16T02:20:45.000000000-05:30", INT64_C(1284623445000) },
        { "2010-09-16T07:50:45", INT64_C(1284623445000) },
        { "2010-13-16T07:50:45Z", -1 },
        { "2010-09-16 07:50:45Z", -1 },
        { "2010-09-16T07:50:45ZZ", -1 },
        { "2010-09-16T07:50", -1 },
        { "", -1 },
    };
    static const struct {
        const char *text;
        int64_t ms;
    } durations[] = {
        { "PT1M", 60000 },      { "PT0S", 0 },  { "PT1.5S", 1500 }, { "P1DT2H3M4S", 93784000 }, { "P1M", INT64_C(2592000000) },
        { "P1Y", INT64_C(31536000000) }, { "PT", -1 }, { "P", -1 },        { "-PT1S", -1 },            { "PT1e9S", -1 },
        { "PT1S ", -1 },        { "60", -1 },   { "PT1M2H", -1 },   { "P900Y", -1 },
    };
    int64_t ns;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(times); i++)
        if (value_time(times[i].text, &ns) != (times[i].ms >= 0) || (times[i].ms >= 0 && ns != times[i].ms * 1000000))
            fail_msg("%s: %lld", times[i].text, (long long)ns);
    for (size_t i = 0; i < ARRAY_LEN(durations); i++)
        if (value_duration(durations[i].text, &ns) != (durations[i].ms >= 0) ||
            (durations[i].ms >= 0 && ns != durations[i].ms * 1000000))
            fail_msg("%s: %lld", durations[i].text, (long long)ns);
}

static void base64_is_read(void **state)
{
    uint8_t out[8];
    char text[16];

    (void)state;
    assert_int_equal(value_base64("Zm9vYg==", out, 8), 4); /* RFC 4648, 10 */
    assert_memory_equal(out, "foob", 4);
    assert_int_equal(value_base64("Zm9vYmFy", out, 8), 6);
    assert_int_equal(value_base64("Zm9vYmFyZm9vYmFy", out, 8), -1);
    assert_int_equal(value_base64("Zm=vYg==", out, 8), -1);
    assert_int_equal(value_base64("Zm9*", out, 8), -1);
    value_to_base64(text, (const uint8_t *)"fooba", 5);
    assert_string_equal(text, "Zm9vYmE=");
}

/* --- passwords ---------------------------------------------------------------------------------------------------- */

static enum sst_login_verdict judge(const char *user, const char *nonce, const char *created, const char *password,
                                    int64_t wall_ns)
{
    char text[2048];
    struct auth_request r = { .client = { .address = "192.0.2.1" }, .method = "POST", .path = "/x" };
    enum sst_login_verdict verdict;
    struct soap s;

    snprintf(text, sizeof(text),
             "<e:Envelope xmlns:e=\"" SOAP "\"><e:Header><Security><UsernameToken><Username>%s</Username><Password "
             "Type=\"t#%s\">%s</Password><Nonce>%s</Nonce><Created>%s</Created></UsernameToken></Security></e:Header>"
             "<e:Body><x/></e:Body></e:Envelope>",
             user, strchr(password, '=') ? "PasswordDigest" : "PasswordText", password, nonce, created);
    assert_int_equal(parse(&s, text), 0);
    r.soap = &s;
    verdict = auth_judge(&auth, &r, wall_ns);
    soap_free(&s);
    return verdict;
}

/* The example of ONVIF's Application Programmer's Guide. */
#define NONCE   "LKqI6G/AikKCQrN0zqZFlg=="
#define CREATED "2010-09-16T07:50:45Z"
#define DIGEST  "tuOSpGlFlIXsozq4HFNeeGeFLEI="
#define THEN_NS (INT64_C(1284623445) * SECOND)

static void open_login(const char *user, const char *password)
{
    memset(&login, 0, sizeof(login));
    login.section = "onvif";
    strcpy(login.user, user);
    strcpy(login.password, password);
    assert_int_equal(sst_login_open(&login), 0);
    auth_init(&auth, &login);
}

static void tokens_are_judged(void **state)
{
    (void)state;
    open_login("user", "userpassword");
    assert_int_equal(judge("user", NONCE, CREATED, DIGEST, THEN_NS), SST_LOGIN_RIGHT);
    assert_int_equal(judge("user", NONCE, CREATED, DIGEST, THEN_NS), SST_LOGIN_STALE); /* once */
    assert_int_equal(judge("user", "LKqI 6G/AikKCQrN0zqZFlg", CREATED, DIGEST, THEN_NS), SST_LOGIN_STALE); /* same bytes */
    assert_int_equal(judge("user", "LKqI6G/AikKCQrN0zqZFlh==", CREATED, DIGEST, THEN_NS), SST_LOGIN_STALE);
    auth_init(&auth, &login);
    assert_int_equal(judge("user", NONCE, CREATED, DIGEST, THEN_NS + ONVIF_CLOCK_S * SECOND), SST_LOGIN_RIGHT);
    auth_init(&auth, &login);
    assert_int_equal(judge("user", NONCE, CREATED, DIGEST, THEN_NS - ONVIF_CLOCK_S * SECOND), SST_LOGIN_RIGHT);
    /* Until its time is over it is not accepted again. */
    assert_int_equal(judge("user", NONCE, CREATED, DIGEST, THEN_NS + ONVIF_CLOCK_S * SECOND), SST_LOGIN_STALE);
    assert_int_equal(judge("user", NONCE, CREATED, DIGEST, THEN_NS + (ONVIF_CLOCK_S + 2) * SECOND), SST_LOGIN_STALE);
    assert_int_equal(judge("User", NONCE, CREATED, DIGEST, THEN_NS), SST_LOGIN_WRONG);
    assert_int_equal(judge("user", NONCE, "2010-09-16T07:50:46Z", DIGEST, THEN_NS), SST_LOGIN_WRONG);
    assert_int_equal(judge("", NONCE, CREATED, DIGEST, THEN_NS), SST_LOGIN_NONE);
    assert_int_equal(judge("user", "", CREATED, DIGEST, THEN_NS), SST_LOGIN_WRONG);
    assert_int_equal(judge("user", "*", CREATED, DIGEST, THEN_NS), SST_LOGIN_WRONG);
    assert_int_equal(judge("user", NONCE, CREATED, "userpassword", THEN_NS), SST_LOGIN_NONE); /* plain: not looked at */
}

static enum sst_login_verdict judge_header_at(const char *header, const char *at, int64_t wall_ns)
{
    const struct auth_request r = {
        .client = { .address = "192.0.2.1" }, .method = "GET", .path = at, .authorization = header
    };

    return auth_judge(&auth, &r, wall_ns);
}

static enum sst_login_verdict judge_header(const char *header, const char *at)
{
    return judge_header_at(header, at, THEN_NS);
}

static void digests_are_judged(void **state)
{
    char nonce[SST_LOGIN_NONCE], ha1[33], response[33], header[512], old[512];
    const uint8_t network[16] = { 0 };

    (void)state;
    open_login("user", "userpassword");
    assert_int_equal(judge_header(NULL, "/snapshot"), SST_LOGIN_NONE);
    assert_int_equal(judge_header("Basic dXNlcjp1c2VycGFzc3dvcmQ=", "/snapshot"), SST_LOGIN_NONE); /* not looked at */
    sst_login_nonce(&login, nonce, network);
    sst_login_ha1(&login, ha1);
    sst_login_digest(response, ha1, "GET:/snapshot?x=1", nonce, "00000001:abc:auth");
    snprintf(header, sizeof(header),
             "Digest username=\"user\", realm=\"sst\",nonce=\"%s\" , uri=\"/snapshot?x=1\", qop=auth, nc=00000001, "
             "cnonce=\"abc\", response=\"%s\", algorithm=MD5",
             nonce, response);
    assert_int_equal(judge_header(header, "/other"), SST_LOGIN_WRONG);
    assert_int_equal(judge_header(header, "/snapshot"), SST_LOGIN_RIGHT);
    assert_int_equal(judge_header(header, "/snapshot"), SST_LOGIN_STALE); /* once */
    assert_int_equal(judge_header_at(header, "/snapshot", THEN_NS + 86400 * SECOND), SST_LOGIN_STALE); /* also when the clock was set */
    sst_login_digest(response, ha1, "GET:http://h/snapshot", nonce, NULL);
    snprintf(old, sizeof(old),
             "digest username=\"user\",realm=\"sst\",nonce=\"%s\",uri=\"http://h/snapshot\",response=\"%s\"", nonce,
             response);
    old[0] = 'D';
    assert_int_equal(judge_header(old, "/snapshot"), SST_LOGIN_RIGHT);
    header[strlen(header) - 20] ^= 1;
    assert_int_equal(judge_header(header, "/snapshot"), SST_LOGIN_WRONG);
    strstr(header, "nonce=\"")[12] ^= 1;
    assert_int_equal(judge_header(header, "/snapshot"), SST_LOGIN_STRAY);
    assert_int_equal(judge_header("Digest ", "/snapshot"), SST_LOGIN_WRONG);
    login.user[0] = 0;
    assert_int_equal(judge_header(NULL, "/snapshot"), SST_LOGIN_RIGHT);
}

/* --- answers ------------------------------------------------------------------------------------------------------ */

static char *answer;
static size_t answer_bytes;

/* @return the fault's code, "" for an answer, which is in `answer` then */
static const char *call(const char *service, const char *name, const char *inner)
{
    struct onvif_call c = { .path = path, .local = "192.0.2.7", .host = "192.0.2.7", .port = 8000 };
    const struct soap_fault *fault;
    char text[4096];
    struct soap s;
    FILE *out;

    free(answer);
    snprintf(text, sizeof(text), "<e:Envelope xmlns:e=\"" SOAP "\"><e:Body><%s xmlns=\"%s\">%s</%s></e:Body></e:Envelope>",
             name, service, inner, name);
    assert_int_equal(parse(&s, text), 0);
    c.soap = &s;
    out = open_memstream(&answer, &answer_bytes);
    fault = answers_call(out, &c);
    fclose(out);
    if (!fault) { /* well formed, and nothing is left of the table's marks */
        struct soap a;
        const int err = soap_parse(&a, answer, answer_bytes);

        assert_true(!err || err == -E2BIG); /* longer than requests may be */
        soap_free(&a);
        assert_null(strchr(answer, '@'));
    }
    soap_free(&s);
    free(c.messages);
    return fault ? fault->detail ? fault->detail : fault->code : "";
}

static void expect(const char *words)
{
    if (!strstr(answer, words))
        fail_msg("no %s in %s", words, answer);
}

static int make_answers(void **state)
{
    (void)state;
    sst_config_defaults(&server.config);
    server.config.rtsp.enabled = true;
    server.config.array.width = 641;
    server.config.array.height = 480;
    strcpy(server.config.onvif.name, "Gate & <yard>");
    server.publisher.service.socket = "/nonexistent";
    pthread_mutex_init(&server.lock, NULL);
    pthread_cond_init(&server.changed, NULL);
    picture_init(&server);
    return answers_init(&server.config, "me");
}

static void every_call_is_answered(void **state)
{
    static const char *const calls[][2] = {
        { TDS, "GetSystemDateAndTime" }, { TDS, "GetServices" }, { TDS, "GetServiceCapabilities" },
        { TDS, "GetCapabilities" }, { TDS, "GetDeviceInformation" }, { TDS, "GetScopes" }, { TDS, "GetHostname" },
        { TDS, "GetWsdlUrl" }, { TDS, "GetEndpointReference" }, { TDS, "GetNetworkInterfaces" },
        { TDS, "GetNetworkProtocols" }, { TDS, "GetNetworkDefaultGateway" }, { TDS, "GetDNS" }, { TDS, "GetNTP" },
        { TDS, "GetDiscoveryMode" }, { TDS, "GetUsers" }, { TDS, "GetRelayOutputs" },
        { TRT, "GetServiceCapabilities" }, { TRT, "GetVideoSources" }, { TRT, "GetProfiles" }, { TRT, "GetProfile" },
        { TRT, "GetVideoSourceConfigurations" }, { TRT, "GetVideoSourceConfiguration" },
        { TRT, "GetVideoSourceConfigurationOptions" }, { TRT, "GetVideoEncoderConfigurations" },
        { TRT, "GetVideoEncoderConfiguration" }, { TRT, "GetVideoEncoderConfigurationOptions" },
        { TRT, "GetCompatibleVideoEncoderConfigurations" }, { TRT, "GetGuaranteedNumberOfVideoEncoderInstances" },
        { TRT, "GetStreamUri" }, { TRT, "GetSnapshotUri" }, { TRT, "SetSynchronizationPoint" },
        { TRT, "GetAudioSources" }, { TRT, "GetOSDs" }, { TR2, "GetServiceCapabilities" }, { TR2, "GetProfiles" },
        { TR2, "GetVideoSourceConfigurations" }, { TR2, "GetVideoEncoderConfigurations" },
        { TR2, "GetVideoEncoderConfigurationOptions" }, { TR2, "GetVideoEncoderInstances" }, { TR2, "GetStreamUri" },
        { TR2, "GetSnapshotUri" }, { TEV, "GetServiceCapabilities" }, { TEV, "GetEventProperties" },
    };

    (void)state;
    for (int jpeg = 0; jpeg < 2; jpeg++) {
        server.config.rtsp.codec = jpeg ? SST_RTSP_MJPEG : SST_RTSP_H264;
        for (size_t i = 0; i < ARRAY_LEN(calls); i++)
            if (*call(calls[i][0], calls[i][1], ""))
                fail_msg("%s is refused", calls[i][1]);
    }
    server.config.rtsp.codec = SST_RTSP_H264;
}

static void answers_have_values(void **state)
{
    (void)state;
    assert_string_equal(call(TRT, "GetProfiles", ""), "");
    expect("<tt:Name>Gate &amp; &lt;yard&gt;</tt:Name>");
    expect("<tt:Width>640</tt:Width><tt:Height>480</tt:Height>"); /* the encoder makes it even */
    expect("<tt:FrameRateLimit>10</tt:FrameRateLimit><tt:EncodingInterval>1</tt:EncodingInterval><tt:BitrateLimit>1536</");
    expect("<tt:Encoding>H264</tt:Encoding>");
    assert_string_equal(call(TRT, "GetStreamUri", "<ProfileToken>main</ProfileToken>"), "");
    expect("<tt:Uri>rtsp://127.0.0.1:8554/main</tt:Uri>"); /* where sst-rtsp listens */
    strcpy(server.config.rtsp.address, "0.0.0.0");
    assert_string_equal(call(TR2, "GetStreamUri", "<Protocol>RTSP</Protocol><ProfileToken>main</ProfileToken>"), "");
    expect("<tr2:Uri>rtsp://192.0.2.7:8554/main</tr2:Uri>");
    assert_string_equal(call(TDS, "GetServices", "<IncludeCapability>true</IncludeCapability>"), "");
    expect("UsernameToken=\"true\"");
    assert_string_equal(call(TDS, "GetServices", ""), "");
    assert_null(strstr(answer, "UsernameToken"));
    assert_string_equal(call(TDS, "GetScopes", ""), "");
    expect("onvif://www.onvif.org/name/Gate%20%26%20%3Cyard%3E<");
    assert_string_equal(call(TDS, "GetUsers", ""), "");
    expect("<tt:Username>me</tt:Username>");
    server.config.rtsp.codec = SST_RTSP_MJPEG;
    assert_string_equal(call(TR2, "GetProfiles", "<Type>All</Type>"), "");
    expect("<tt:Encoding>JPEG</tt:Encoding><tt:Resolution><tt:Width>641</tt:Width>");
    server.config.rtsp.codec = SST_RTSP_H264;
}

static void refusals_name_the_fault(void **state)
{
    (void)state;
    assert_string_equal(call(TDS, "SystemReboot", ""), "ter:ActionNotSupported");
    assert_string_equal(call("http://www.onvif.org/ver20/ptz/wsdl", "GetNodes", ""), "ter:ActionNotSupported");
    assert_string_equal(call(TDS, "GetCapabilities", "<Category>PTZ</Category>"), "ter:NoSuchService");
    assert_string_equal(call(TDS, "GetCapabilities", "<Category>Media</Category>"), "");
    assert_string_equal(call(TRT, "GetProfile", "<ProfileToken>other</ProfileToken>"), "ter:NoProfile");
    assert_string_equal(call(TR2, "GetProfiles", "<Token>other</Token>"), "ter:NoProfile");
    assert_string_equal(call(TRT, "GetVideoEncoderConfiguration", "<ConfigurationToken>x</ConfigurationToken>"),
                        "ter:NoConfig");
    assert_string_equal(call(TRT, "GetStreamUri", "<StreamSetup><Stream>RTP-Multicast</Stream></StreamSetup>"),
                        "ter:InvalidStreamSetup");
    assert_string_equal(call(TEV, "PullMessages", "<Timeout>PT0S</Timeout>"), "wsrf-rw:ResourceUnknownFault");
}

/* --- events ------------------------------------------------------------------------------------------------------- */

static void happen(const char *text)
{
    json_t *event = json_loads(text, 0, NULL);

    assert_non_null(event);
    events_on_event(event);
    json_decref(event);
}

static void set_zones(const char *first, const char *last)
{
    json_t *zones = json_pack("{s:[{s:s}, {s:s, s:b}, {s:s}]}", "zones", "name", first, "name", "tree", "mask", 1, "name", last);

    events_zones(zones);
    json_decref(zones);
}

static int make_events(void **state)
{
    (void)state;
    events_init(&server);
    set_zones("gate", "lawn");
    return make_answers(state);
}

static void subscribe(const char *inner)
{
    assert_string_equal(call(TEV, "CreatePullPointSubscription", inner), "");
    expect("http://192.0.2.7:8000/onvif/events/");
    snprintf(path, sizeof(path), "/onvif/events/%.16s", strstr(answer, "/onvif/events/") + strlen("/onvif/events/"));
}

/* @return messages */
static int pull(const char *inner)
{
    int n = 0;

    assert_string_equal(call(TEV, "PullMessages", inner), "");
    for (const char *at = answer; (at = strstr(at, "<wsnt:NotificationMessage>")) != NULL; at++)
        n++;
    return n;
}

#define VISIT(name, active, label, zones)                                                                              \
    "{\"type\": \"visit\", \"data\": {\"visit\": \"" name "\", \"active\": " active ", \"label\": \"" label            \
    "\", \"zones\": [" zones "]}}"

static void visits_are_motion_and_people(void **state)
{
    (void)state;
    subscribe("");
    assert_int_equal(pull(""), 5); /* three states, two zones, as they are now */
    expect("PropertyOperation=\"Initialized\"");
    assert_null(strstr(answer, "Value=\"true\""));
    assert_int_equal(pull(""), 0);
    happen(VISIT("v1", "true", "Car", "\"gate\", \"tree\""));
    assert_int_equal(pull(""), 3);
    expect("tns1:VideoSource/MotionAlarm</wsnt:Topic>");
    expect("tns1:RuleEngine/CellMotionDetector/Motion</wsnt:Topic>");
    expect("Name=\"IsMotion\" Value=\"true\"");
    expect("Name=\"Rule\" Value=\"gate\"/></tt:Source><tt:Data><tt:SimpleItem Name=\"IsInside\" Value=\"true\"");
    happen(VISIT("v2", "true", "Pedestrian", "\"lawn\""));
    assert_int_equal(pull(""), 2); /* motion as before */
    expect("PeopleDetect");
    happen(VISIT("v2", "false", "Pedestrian", "\"lawn\""));
    happen(VISIT("v1", "false", "Car", "\"gate\""));
    assert_int_equal(pull("<MessageLimit>2</MessageLimit>"), 2);
    assert_int_equal(pull("<MessageLimit>9</MessageLimit>"), 3);
    happen("{\"type\": \"line\", \"data\": {\"zone\": \"drive\", \"direction\": \"forward\", \"visit\": \"v9\"}}");
    assert_int_equal(pull(""), 1);
    expect("LineDetector/Crossed");
    happen("{\"type\": \"motion\", \"data\": {\"zone\": \"gate\", \"active\": true}}");
    assert_int_equal(pull(""), 2);
    events_disconnected(); /* nothing moves where the service has gone */
    assert_int_equal(pull(""), 2);
    expect("Name=\"State\" Value=\"false\"");
    assert_string_equal(call(TEV, "SetSynchronizationPoint", ""), "");
    assert_int_equal(pull(""), 5);
    happen(VISIT("v3", "true", "Car", "\"gate\""));
    assert_int_equal(pull(""), 3);
    set_zones("gate", "lawn"); /* a reload that changes no zones is no event */
    assert_int_equal(pull(""), 0);
    set_zones("gate", "yard");
    assert_int_equal(pull(""), 3);
    expect("Value=\"false\"");
    assert_string_equal(call(WSNT, "Unsubscribe", ""), "");
    assert_string_equal(call(TEV, "PullMessages", ""), "wsrf-rw:ResourceUnknownFault");
}

static void filters_choose_topics(void **state)
{
    (void)state;
    subscribe("<Filter><TopicExpression>tns1:RuleEngine/tns1:CellMotionDetector/tns1:Motion | tns1:VideoSource//.</TopicExpression>"
              "</Filter>");
    assert_int_equal(pull(""), 2);
    assert_string_equal(call(WSNT, "Unsubscribe", ""), "");
    subscribe("<Filter><TopicExpression>tns1:RuleEngine//.</TopicExpression></Filter>");
    assert_int_equal(pull(""), 4);
    assert_string_equal(call(WSNT, "Unsubscribe", ""), "");
    assert_string_equal(call(TEV, "CreatePullPointSubscription", "<Filter><TopicExpression>tns1:Audio//.</TopicExpression></Filter>"),
                        "wsnt:TopicNotSupportedFault");
    assert_string_equal(call(TEV, "CreatePullPointSubscription", "<Filter><TopicExpression>tns1:VideoSource/Motion</TopicExpression></Filter>"),
                        "wsnt:TopicNotSupportedFault");
    assert_string_equal(call(TEV, "CreatePullPointSubscription", "<InitialTerminationTime>soon</InitialTerminationTime>"),
                        "wsnt:UnacceptableInitialTerminationTimeFault");
    assert_string_equal(call(TEV, "CreatePullPointSubscription", "<InitialTerminationTime>2010-09-16T07:50:45Z</InitialTerminationTime>"),
                        "wsnt:UnacceptableInitialTerminationTimeFault");
}

static void subscriptions_are_bounded(void **state)
{
    char paths[17][sizeof(path)];
    int n = 0;

    (void)state;
    for (; n < 16; n++) {
        subscribe("");
        memcpy(paths[n], path, sizeof(path));
    }
    assert_string_equal(call(TEV, "CreatePullPointSubscription", ""), "wsnt:UnableToCreatePullPointFault");
    assert_string_equal(call(WSNT, "Renew", "<TerminationTime>PT10M</TerminationTime>"), "");
    assert_string_equal(call(WSNT, "Renew", "<TerminationTime>10 minutes</TerminationTime>"),
                        "wsnt:UnacceptableInitialTerminationTimeFault");
    for (int i = 0; i < 200; i++) /* the oldest messages go */
        happen("{\"type\": \"line\", \"data\": {\"zone\": \"drive\"}}");
    assert_int_equal(pull("<MessageLimit>1000</MessageLimit>"), 64);
    while (n--) {
        memcpy(path, paths[n], sizeof(path));
        assert_string_equal(call(WSNT, "Unsubscribe", ""), "");
        assert_string_equal(call(WSNT, "Unsubscribe", ""), "wsrf-rw:ResourceUnknownFault");
    }
    assert_int_equal(server.clients, 0);
}

static void *move(void *arg)
{
    (void)arg;
    usleep(100000);
    happen(VISIT("late", "true", "", ""));
    return NULL;
}

static void a_pull_waits(void **state)
{
    const int64_t start_ns = sst_clock_now_ns();
    pthread_t thread;

    (void)state;
    subscribe("");
    assert_int_equal(pull(""), 5);
    assert_int_equal(pthread_create(&thread, NULL, move, NULL), 0);
    assert_int_equal(pull("<Timeout>PT1M</Timeout><MessageLimit>9</MessageLimit>") > 0, true);
    pthread_join(thread, NULL);
    assert_true(sst_clock_now_ns() - start_ns < 59 * SECOND);
    (void)pull(""); /* the second of the two messages may have come after the first was taken */
    assert_int_equal(pull("<Timeout>PT0.05S</Timeout>"), 0);
}

/* --- discovery ---------------------------------------------------------------------------------------------------- */

static bool discover(const char *call_name, const char *inner)
{
    char text[2048];
    FILE *out;
    bool due;

    free(answer);
    snprintf(text, sizeof(text),
             "<e:Envelope xmlns:e=\"" SOAP "\" xmlns:a=\"http://schemas.xmlsoap.org/ws/2004/08/addressing\"><e:Header>"
             "<a:MessageID>uuid:1&lt;2</a:MessageID></e:Header><e:Body><%s xmlns=\"" WSD "\" "
             "xmlns:dn=\"http://www.onvif.org/ver10/network/wsdl\">%s</%s></e:Body></e:Envelope>",
             call_name, inner, call_name);
    out = open_memstream(&answer, &answer_bytes);
    due = discovery_answer(out, text, strlen(text), "192.0.2.7");
    fclose(out);
    return due;
}

static void probes_match(void **state)
{
    char text[256];

    (void)state;
    assert_true(discover("Probe", ""));
    expect("<a:RelatesTo>uuid:1&lt;2</a:RelatesTo>");
    expect("<d:XAddrs>http://192.0.2.7:8000/onvif/device_service</d:XAddrs>");
    expect("dn:NetworkVideoTransmitter");
    assert_true(discover("Probe", "<Types>dn:NetworkVideoTransmitter</Types><Scopes/>"));
    assert_true(discover("Probe", "<Types>tds:Device dn:NetworkVideoTransmitter</Types>"));
    assert_false(discover("Probe", "<Types>dn:NetworkVideoDisplay</Types>"));
    assert_false(discover("Probe", "<Types>wsdp:Device pub:Computer</Types>"));
    assert_true(discover("Probe", "<Scopes>onvif://www.onvif.org/Profile</Scopes>"));
    assert_true(discover("Probe", "<Scopes>onvif://www.onvif.org/Profile/T onvif://www.onvif.org/type/</Scopes>"));
    assert_false(discover("Probe", "<Scopes>onvif://www.onvif.org/Pro</Scopes>"));
    assert_false(discover("Probe", "<Scopes>onvif://www.onvif.org/location/mars</Scopes>"));
    snprintf(text, sizeof(text),
             "<a:EndpointReference><a:Address>urn:uuid:%s</a:Address></a:EndpointReference>", answers_device()->uuid);
    assert_true(discover("Resolve", text));
    expect("<d:ResolveMatch>");
    text[60] ^= 1;
    assert_false(discover("Resolve", text));
    assert_false(discover("Hello", text));
    assert_false(discovery_answer(stdout, "x", 1, "192.0.2.7"));
}

#endif

int main(void)
{
#if WITH_ONVIF
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_request_is_found),
        cmocka_unit_test(what_is_no_request),
        cmocka_unit_test(requests_are_bounded),
        cmocka_unit_test(times_are_read),
        cmocka_unit_test(base64_is_read),
        cmocka_unit_test(tokens_are_judged),
        cmocka_unit_test(digests_are_judged),
        cmocka_unit_test(every_call_is_answered),
        cmocka_unit_test(answers_have_values),
        cmocka_unit_test(refusals_name_the_fault),
        cmocka_unit_test(visits_are_motion_and_people),
        cmocka_unit_test(filters_choose_topics),
        cmocka_unit_test(subscriptions_are_bounded),
        cmocka_unit_test(a_pull_waits),
        cmocka_unit_test(probes_match),
    };
    const int failed = cmocka_run_group_tests(tests, make_events, NULL);

    free(answer);
    return failed;
#else
    puts("built without ONVIF");
    return 77;
#endif
}
