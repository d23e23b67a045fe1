/* Calls and their answers, which come from the table answers.txt. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <arpa/inet.h>
#include <ctype.h>
#include <errno.h>
#include <ifaddrs.h>
#include <math.h>
#include <net/if.h>
#include <netpacket/packet.h>
#include <sha2.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "publishers/onvif/onvif_internal.h"

__asm__(".section .rodata\nonvif_answers: .incbin \"publishers/onvif/answers.txt\"\n.byte 0\n.previous");
extern const char onvif_answers[];

#define ANSWERS_MAX  128
#define PARTS_DEPTH  4    /* of values within values */
#define KBIT_LEAST   500  /* as publishers/rtsp/feed.c has them */
#define KBIT_MOST    8000 /* as there, too */
#define GOV_S        2    /* between key frames */
#define SCOPE        "onvif://www.onvif.org/"

/** One of answers.txt. */
struct answer {
    char service[8], name[48]; /* service "part": a value that other answers have */
    bool open;
    const char *text, *end;
};

static struct {
    /* fixed after answers_init() */
    struct answer answer[ANSWERS_MAX];
    int answers;
    struct onvif_device device;
} table;

static const char *const services[] = { [SOAP_NS_DEVICE] = "tds",
                                        [SOAP_NS_MEDIA] = "trt",
                                        [SOAP_NS_MEDIA2] = "tr2",
                                        [SOAP_NS_EVENTS] = "tev" };

/* --- begin -------------------------------------------------------------------------------------------------------- */

static int read_table(void)
{
    const char *at = strstr(onvif_answers, "\n== ");

    while (at) {
        struct answer *a = &table.answer[table.answers];
        const char *line = at + 1, *next;
        char open[8] = "";

        if (table.answers == ANSWERS_MAX || sscanf(line, "== %7s %47s%7[ a-z]", a->service, a->name, open) < 2)
            return -EINVAL;
        a->open = strstr(open, "open") != NULL;
        a->text = strchr(line, '\n') + 1;
        next = strstr(a->text - 1, "\n== ");
        a->end = next ? next + 1 : a->text + strlen(a->text);
        table.answers++;
        at = next;
    }
    return table.answers ? 0 : -EINVAL;
}

/* The same for this machine and port after each start: a name-based UUID (RFC 9562). */
static void make_uuid(struct onvif_device *d)
{
    char seed[128], line[64], hex[SHA256_DIGEST_STRING_LENGTH];

    snprintf(seed, sizeof(seed), "sst-onvif %s %d",
             *sst_file_line(line, sizeof(line), "/etc/machine-id") ? line : d->hostname, d->config->onvif.port);
    SHA256Data((const uint8_t *)seed, strlen(seed), hex);
    snprintf(d->uuid, sizeof(d->uuid), "%.8s-%.4s-5%.3s-a%.3s-%.12s", hex, hex + 8, hex + 13, hex + 17, hex + 20);
    snprintf(d->serial, sizeof(d->serial), "%.12s", hex + 20);
}

int answers_init(const struct sst_config *config, const char *user)
{
    struct onvif_device *d = &table.device;

    d->config = config;
    d->user = user;
    if (gethostname(d->hostname, sizeof(d->hostname) - 1) || !d->hostname[0])
        snprintf(d->hostname, sizeof(d->hostname), "sst");
    make_uuid(d);
    table.answers = 0;
    return read_table();
}

const struct onvif_device *answers_device(void)
{
    return &table.device;
}

static const struct answer *find(const char *service, const char *name)
{
    for (int i = 0; i < table.answers; i++)
        if (!strcmp(table.answer[i].service, service) && !strcmp(table.answer[i].name, name))
            return &table.answer[i];
    return NULL;
}

static const struct answer *find_call(const struct soap *s)
{
    const struct soap_node *n = &s->node[s->call];
    const char *service = n->ns < ARRAY_LEN(services) ? services[n->ns] : NULL;

    return service ? find(service, n->name) : NULL;
}

bool answers_is_open(const struct soap *s)
{
    const struct answer *a = find_call(s);

    return a && a->open;
}

/* --- values ------------------------------------------------------------------------------------------------------- */

/** The picture, as recorders are told. */
struct stream {
    int width, height, rate, kbit;
};

static struct stream measure(void)
{
    const struct sst_config *c = table.device.config;
    const bool h264 = c->rtsp.codec == SST_RTSP_H264;
    double rate = sst_array_sets_hz(&c->array), kbit;
    struct stream s;
    size_t bytes;

    picture_size(&s.width, &s.height, &bytes);
    s.width -= h264 ? s.width % 2 : 0; /* the encoder makes odd sizes even */
    s.height -= h264 ? s.height % 2 : 0;
    rate = c->live.rate_hz > 0 && c->live.rate_hz < rate ? c->live.rate_hz : rate;
    s.rate = rate < 1 ? 1 : (int)lround(rate > 1000 ? 1000 : rate);
    kbit = h264 ? (double)s.width * s.height / 200 : (double)bytes * 8 * s.rate / 1000;
    s.kbit = (int)sst_clamp_double(kbit, KBIT_LEAST, h264 ? KBIT_MOST : 1e6);
    return s;
}

/* A name as part of a scope. */
static void put_escaped(FILE *out, const char *text)
{
    for (; *text; text++)
        if (isalnum((unsigned char)*text) || strchr("-._~", *text))
            fputc(*text, out);
        else
            fprintf(out, "%%%02X", (unsigned char)*text);
}

/* @param element  between tags of a scope; false: separated by spaces */
static void put_scopes(FILE *out, bool element)
{
    static const char *const scopes[] = { "type/video_encoder", "type/Network_Video_Transmitter", "Profile/Streaming",
                                          "Profile/T",          "hardware/sst",                   "location/",
                                          "name/" };

    for (size_t i = 0; i < ARRAY_LEN(scopes); i++) {
        fprintf(out, "%s" SCOPE "%s",
                element ? "<tds:Scopes><tt:ScopeDef>Fixed</tt:ScopeDef><tt:ScopeItem>"
                : i     ? " "
                        : "",
                scopes[i]);
        if (i == ARRAY_LEN(scopes) - 1)
            put_escaped(out, table.device.config->onvif.name);
        fputs(element ? "</tt:ScopeItem></tds:Scopes>" : "", out);
    }
}

void answers_scopes(FILE *out)
{
    put_scopes(out, false);
}

static void put_time(FILE *out, int64_t wall_ns)
{
    char text[SST_CLOCK_TEXT];

    sst_clock_text(text, wall_ns);
    fputs(text, out);
}

/* Numbers of the picture and the clock. @return false: it is none */
static bool put_number(FILE *out, const char *name, const struct onvif_call *call)
{
    const struct sst_config *c = table.device.config;
    const time_t now = (time_t)(sst_clock_wall_ns() / 1000000000);
    const struct stream s = strspn(name, "WHRKG") ? measure() : (struct stream){ 0 };
    struct tm t;
    const struct {
        const char *name;
        int value;
    } *n, numbers[] = {
        { "WIDTH", s.width },
        { "HEIGHT", s.height },
        { "RATE", s.rate },
        { "KBIT", s.kbit },
        { "GOV", s.rate * GOV_S },
        { "PORT", call->port },
        { "RTSP_PORT", c->rtsp.port },
        { "PREFIX", call->prefix },
        { "HOUR", gmtime_r(&now, &t)->tm_hour },
        { "MINUTE", t.tm_min },
        { "SECOND", t.tm_sec },
        { "YEAR", t.tm_year + 1900 },
        { "MONTH", t.tm_mon + 1 },
        { "DAY", t.tm_mday },
    };

    for (n = numbers; n < numbers + ARRAY_LEN(numbers); n++)
        if (!strcmp(n->name, name)) {
            fprintf(out, "%d", n->value);
            return true;
        }
    return false;
}

/* @return false: it is none */
static bool put_text(FILE *out, const char *name, const struct onvif_call *call)
{
    const struct onvif_device *d = &table.device;
    const struct {
        const char *name, *value;
    } *t, texts[] = {
        { "NAME", d->config->onvif.name },
        { "VERSION", SST_VERSION },
        { "SERIAL", d->serial },
        { "UUID", d->uuid },
        { "HOSTNAME", d->hostname },
        { "USER", d->user },
        { "INTERFACE", call->interface },
        { "MAC", call->mac },
        { "LOCAL", call->local },
        { "SUBSCRIPTION", call->subscription },
        { "ENCODING", d->config->rtsp.codec == SST_RTSP_H264 ? "H264" : "JPEG" },
        { "DISCOVERY", d->config->onvif.discovery ? "Discoverable" : "NonDiscoverable" },
    };

    for (t = texts; t < texts + ARRAY_LEN(texts); t++)
        if (!strcmp(t->name, name)) {
            soap_put(out, t->value);
            return true;
        }
    return false;
}

/* The host of the stream: sst-rtsp may listen on one address alone. */
static void put_rtsp(FILE *out, const struct onvif_call *call)
{
    const struct sst_config *c = table.device.config;
    const bool any = !strcmp(c->rtsp.address, "0.0.0.0") || !strcmp(c->rtsp.address, "::");
    char host[ONVIF_HOST];

    http_host(host, any ? call->local : c->rtsp.address);
    fprintf(out, "rtsp://%s:%d/main", any && !c->onvif.host[0] ? call->host : host, c->rtsp.port);
}

static void put_value(FILE *out, const char *name, const struct onvif_call *call)
{
    if (!strcmp(name, "BASE"))
        fprintf(out, "http://%s:%d", call->host, call->port);
    else if (!strcmp(name, "RTSP"))
        put_rtsp(out, call);
    else if (!strcmp(name, "SCOPES"))
        put_scopes(out, true);
    else if (!strcmp(name, "NOW"))
        put_time(out, call->now_ns);
    else if (!strcmp(name, "UNTIL"))
        put_time(out, call->until_ns);
    else if (!strcmp(name, "MESSAGES"))
        fputs(call->messages ? call->messages : "", out);
    else if (!put_text(out, name, call) && !put_number(out, name, call))
        sst_log_error("onvif: no value %s", name);
}

static bool holds(const char *word, const struct onvif_call *call)
{
    const bool h264 = table.device.config->rtsp.codec == SST_RTSP_H264;
    const char *asked = soap_text(call->soap, call->soap->call, "IncludeCapability");

    if (!strcmp(word, "h264") || !strcmp(word, "jpeg"))
        return h264 == (word[0] == 'h');
    if (!strcmp(word, "caps"))
        return asked && (!strcmp(asked, "true") || !strcmp(asked, "1"));
    if (!strcmp(word, "user"))
        return table.device.user[0];
    return !strcmp(word, "v4") && !strchr(call->local, ':');
}

static void put_answer(FILE *out, const struct answer *a, const struct onvif_call *call, int depth);

static void put_line(FILE *out, const char *at, size_t n, const struct onvif_call *call, int depth)
{
    const char *end = at + n;

    while (at < end) {
        const char *begin = memchr(at, '@', (size_t)(end - at));
        const char *stop = begin ? memchr(begin + 1, '@', (size_t)(end - begin - 1)) : NULL;
        const struct answer *part;
        char name[32];

        fwrite(at, 1, (size_t)((stop ? begin : end) - at), out);
        if (!stop)
            return;
        snprintf(name, sizeof(name), "%.*s", (int)(stop - begin - 1), begin + 1);
        part = find("part", name);
        if (part)
            put_answer(out, part, call, depth + 1);
        else
            put_value(out, name, call);
        at = stop + 1;
    }
}

static void put_answer(FILE *out, const struct answer *a, const struct onvif_call *call, int depth)
{
    const char *line = a->text;

    while (line < a->end && depth < PARTS_DEPTH) {
        const char *end = memchr(line, '\n', (size_t)(a->end - line)), *at = line;
        char word[8] = "";
        int n = 0;

        end = end ? end : a->end;
        if (*line == '?' && sscanf(line, "?%7[a-z0-9] %n", word, &n) == 1)
            at = line + 2 + strlen(word); /* a space after it is part of the answer */
        if (!word[0] || holds(word, call))
            put_line(out, at, (size_t)(end - at), call, depth);
        line = end + 1;
    }
}

/* --- calls -------------------------------------------------------------------------------------------------------- */

static const struct soap_fault not_supported = { 500, "ter:ActionNotSupported", NULL,
                                                 "This device has no such call" };
static const struct soap_fault no_service = { 500, "ter:ActionNotSupported", "ter:NoSuchService",
                                              "This device has no such service: no imaging, no PTZ, no analytics" };
static const struct soap_fault no_profile = { 400, "ter:InvalidArgVal", "ter:NoProfile",
                                              "There is no such profile; the only one is main" };
static const struct soap_fault no_config = { 400, "ter:InvalidArgVal", "ter:NoConfig",
                                             "There is no such configuration" };
static const struct soap_fault no_stream = { 400, "ter:InvalidArgVal", "ter:InvalidStreamSetup",
                                             "Streams are unicast, over UDP or RTSP" };

static bool is_missing(const struct soap *s, const char *argument, const char *one, const char *other)
{
    const char *text = soap_text(s, s->call, argument);

    return text && *text && strcmp(text, one) != 0 && strcmp(text, other) != 0;
}

static const struct soap_fault *check_tokens(const struct soap *s)
{
    if (is_missing(s, "ProfileToken", "main", "main") ||
        (s->node[s->call].ns == SOAP_NS_MEDIA2 && is_missing(s, "Token", "main", "main")))
        return &no_profile;
    return is_missing(s, "ConfigurationToken", "main_source", "main_encoder") ? &no_config : NULL;
}

static const struct soap_fault *check_category(struct onvif_call *call)
{
    const char *category = soap_text(call->soap, call->soap->call, "Category");

    return category && *category && strcmp(category, "All") && strcmp(category, "Device") &&
                   strcmp(category, "Media") && strcmp(category, "Events")
               ? &no_service
               : NULL;
}

/* Of Media: StreamSetup/Stream and Transport/Protocol; of Media2: Protocol. */
static const struct soap_fault *check_stream(struct onvif_call *call)
{
    const struct soap *s = call->soap;
    const int setup = soap_child(s, s->call, "StreamSetup");
    const char *stream = soap_text(s, setup, "Stream"), *two = soap_text(s, s->call, "Protocol"),
               *one = soap_text(s, soap_child(s, setup, "Transport"), "Protocol");

    if ((stream && !strcmp(stream, "RTP-Multicast")) || (one && !strcmp(one, "HTTP")) ||
        (two && (strstr(two, "Multicast") || strstr(two, "Http") || !strcmp(two, "RTSPS"))))
        return &no_stream;
    return NULL;
}

static int prefix_of(const struct sockaddr *mask)
{
    return mask && mask->sa_family == AF_INET
               ? __builtin_popcount(((const struct sockaddr_in *)(const void *)mask)->sin_addr.s_addr)
               : 24;
}

/* The interface at which the client has reached this machine. */
static const struct soap_fault *find_interface(struct onvif_call *call)
{
    struct ifaddrs *all = NULL;
    char text[INET6_ADDRSTRLEN];

    snprintf(call->interface, sizeof(call->interface), "eth0");
    snprintf(call->mac, sizeof(call->mac), "00:00:00:00:00:00");
    call->prefix = 24;
    if (getifaddrs(&all))
        return NULL;
    for (const struct ifaddrs *i = all; i; i = i->ifa_next) {
        const void *a = i->ifa_addr;
        const int family = a ? i->ifa_addr->sa_family : AF_UNSPEC;

        if ((family != AF_INET && family != AF_INET6) ||
            !inet_ntop(family, family == AF_INET ? (const void *)&((const struct sockaddr_in *)a)->sin_addr
                                                 : (const void *)&((const struct sockaddr_in6 *)a)->sin6_addr,
                       text, sizeof(text)) ||
            strcmp(text, call->local) != 0)
            continue;
        snprintf(call->interface, sizeof(call->interface), "%.15s", i->ifa_name);
        call->prefix = prefix_of(i->ifa_netmask);
    }
    for (const struct ifaddrs *i = all; i; i = i->ifa_next) {
        const struct sockaddr_ll *l = (const void *)i->ifa_addr;

        if (l && l->sll_family == AF_PACKET && !strcmp(i->ifa_name, call->interface) && l->sll_halen == 6)
            snprintf(call->mac, sizeof(call->mac), "%02x:%02x:%02x:%02x:%02x:%02x", l->sll_addr[0], l->sll_addr[1],
                     l->sll_addr[2], l->sll_addr[3], l->sll_addr[4], l->sll_addr[5]);
    }
    freeifaddrs(all);
    return NULL;
}

static const struct {
    const char *name;
    const struct soap_fault *(*handle)(struct onvif_call *call);
} handlers[] = {
    { "GetCapabilities", check_category },     { "GetStreamUri", check_stream },
    { "GetNetworkInterfaces", find_interface }, { "CreatePullPointSubscription", events_create },
    { "PullMessages", events_pull },           { "Renew", events_renew },
    { "Unsubscribe", events_unsubscribe },
};

const struct soap_fault *answers_call(FILE *out, struct onvif_call *call)
{
    const struct soap *s = call->soap;
    const struct answer *a = find_call(s);
    const struct soap_fault *fault = a ? check_tokens(s) : &not_supported;

    for (size_t i = 0; !fault && i < ARRAY_LEN(handlers); i++)
        if (!strcmp(handlers[i].name, a->name))
            fault = handlers[i].handle(call);
    if (!fault && s->node[s->call].ns == SOAP_NS_EVENTS && !strcmp(a->name, "SetSynchronizationPoint"))
        fault = events_synchronize(call);
    if (fault)
        return fault;
    soap_begin(out, s);
    put_answer(out, a, call, 0);
    soap_end(out);
    free(call->messages);
    call->messages = NULL;
    return NULL;
}
