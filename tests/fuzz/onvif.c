/* Fuzz target: bytes of strangers that sst-onvif reads: a SOAP message as request with its password and as datagram, a header of
 * Digest, and values. The first byte chooses. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#ifndef WITH_ONVIF
#define WITH_ONVIF 0
#endif
#if WITH_ONVIF

#include <errno.h>

#include "publishers/onvif/onvif_internal.h"

#define SOAP "<s:Envelope xmlns:s=\"http://www.w3.org/2003/05/soap-envelope\">"

static struct sst_server server;
static struct sst_login login = { .section = "onvif", .user = "me", .password = "sesame seed" };
static struct auth auth;

int http_port(void)
{
    return 8000;
}

void http_host(char out[ONVIF_HOST], const char *local)
{
    snprintf(out, ONVIF_HOST, "%.200s", local);
}

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char *const seeds[] = {
        "0" SOAP "<s:Header><Security xmlns=\"http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-secext-1.0.xsd\">"
        "<UsernameToken><Username>me</Username><Password Type=\"x#PasswordDigest\">tuOSpGlFlIXsozq4HFNeeGeFLEI=</Password>"
        "<Nonce>LKqI6G/AikKCQrN0zqZFlg==</Nonce><Created>2010-09-16T07:50:45Z</Created></UsernameToken></Security></s:Header>"
        "<s:Body><GetProfiles xmlns=\"http://www.onvif.org/ver10/media/wsdl\"/></s:Body></s:Envelope>",
        "0" SOAP "<s:Body><t:GetStreamUri xmlns:t=\"http://www.onvif.org/ver10/media/wsdl\"><t:StreamSetup><Stream>RTP-Unicast</Stream>"
        "<Transport><Protocol>UDP</Protocol></Transport></t:StreamSetup><t:ProfileToken>main</t:ProfileToken></t:GetStreamUri>"
        "</s:Body></s:Envelope>",
        "0" SOAP "<s:Body><CreatePullPointSubscription xmlns=\"http://www.onvif.org/ver10/events/wsdl\"><Filter><TopicExpression>"
        "tns1:RuleEngine//.|tns1:VideoSource/MotionAlarm</TopicExpression></Filter><InitialTerminationTime>PT1M"
        "</InitialTerminationTime></CreatePullPointSubscription></s:Body></s:Envelope>",
        "1" SOAP "<s:Header><a:MessageID xmlns:a=\"http://schemas.xmlsoap.org/ws/2004/08/addressing\">uuid:1</a:MessageID></s:Header>"
        "<s:Body><Probe xmlns=\"http://schemas.xmlsoap.org/ws/2005/04/discovery\"><Types>dn:NetworkVideoTransmitter</Types>"
        "<Scopes>onvif://www.onvif.org/Profile onvif://www.onvif.org/type/</Scopes></Probe></s:Body></s:Envelope>",
        "2Digest username=\"me\", realm=\"sst\", nonce=\"000007ddc0793162d5478b76aacffc43f392598f\", uri=\"/snapshot\", qop=auth, "
        "nc=00000001, cnonce=\"a\\\"b\", response=\"0123456789abcdef0123456789abcdef\"",
        "32026-11-29T10:00:00.5+01:00", "3P1Y2M3DT4H5M6.7S", "3TFRSQ==",
    };

    for (int i = 0; i < (int)ARRAY_LEN(seeds); i++)
        seed_write("onvif", i, seeds[i], strlen(seeds[i]));
    sst_config_defaults(&server.config);
    server.publisher.service.socket = "/nonexistent";
    pthread_mutex_init(&server.lock, NULL);
    pthread_cond_init(&server.changed, NULL);
    picture_init(&server);
    events_init(&server);
    events_stop(); /* a pull does not wait */
    if (sst_login_open(&login) || answers_init(&server.config, login.user))
        abort();
    auth_init(&auth, &login);
    return 0;
}

static void check_call(const char *data, size_t size)
{
    struct onvif_call call = { .path = "/onvif/events/x", .local = "192.0.2.1", .host = "192.0.2.1", .port = 8000 };
    struct auth_request r = { .client = { .address = "192.0.2.1" }, .method = "POST", .path = "/onvif/x" };
    char *text = NULL;
    size_t bytes;
    struct soap s;
    FILE *out;

    if (!soap_parse(&s, data, size)) {
        call.soap = r.soap = &s;
        if (auth_judge(&auth, &r, 0) == SST_LOGIN_RIGHT)
            abort(); /* nobody guesses it */
        out = open_memstream(&text, &bytes);
        if (!answers_call(out, &call)) {
            struct soap answer;
            int err;

            fflush(out);
            err = soap_parse(&answer, text, bytes);
            if (err && err != -E2BIG) /* whatever was asked, the answer is XML */
                abort();
            soap_free(&answer);
        }
        fclose(out);
        free(text);
        free(call.messages);
    }
    soap_free(&s);
}

static void check_datagram(const char *data, size_t size)
{
    char *text = NULL;
    size_t bytes;
    FILE *out = open_memstream(&text, &bytes);

    if (discovery_answer(out, data, size, "192.0.2.1")) {
        struct soap answer;

        fflush(out);
        if (soap_parse(&answer, text, bytes))
            abort();
        soap_free(&answer);
    }
    fclose(out);
    free(text);
}

static void check_values(const char *text)
{
    struct auth_request r = {
        .client = { .address = "192.0.2.1" }, .method = "GET", .path = "/snapshot", .authorization = text
    };
    uint8_t out[64];
    int64_t ns;

    if (value_duration(text, &ns) && ns < 0)
        abort();
    (void)value_time(text, &ns);
    if (value_base64(text, out, sizeof(out)) > (int)sizeof(out))
        abort();
    if (auth_judge(&auth, &r, 0) == SST_LOGIN_RIGHT)
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char *text = malloc(size + 1);

    memcpy(text, data, size);
    text[size] = 0;
    if (size && data[0] == '0')
        check_call(text + 1, size - 1);
    else if (size && data[0] == '1')
        check_datagram(text + 1, size - 1);
    else if (size)
        check_values(text + 1);
    free(text);
    return 0;
}

#else
int LLVMFuzzerTestOneInput(const uint8_t *data SST_UNUSED, size_t size SST_UNUSED)
{
    return 0;
}
#endif
