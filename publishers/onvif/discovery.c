/* WS-Discovery: Hello, Probe and Resolve, Bye, by UDP multicast on IPv4. Answers are few for each address, as anybody may
 * write another one's address on a datagram. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* struct in_pktinfo */
#include <arpa/inet.h>
#include <errno.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "publishers/onvif/onvif_internal.h"

#define GROUP         "239.255.255.250"
#define PORT          3702
#define DATAGRAM_MAX  8192
#define SECOND        INT64_C(1000000000)
#define DELAY_MOST_MS 250 /* the standard has 500: answers of many devices do not come at once */
#define PENDING_MAX   32
#define LINKS_MAX     32
#define SCAN_NS       (30 * SECOND) /* between looks for other interfaces */
#define WINDOW_NS     (10 * SECOND)
#define ADDRESS_MOST  10 /* answers to an address in a window */
#define TOTAL_MOST    100
#define ADDRESSES     64
#define WAIT_MS       1000
#define ID_MAX        256 /* characters of a message's name */

struct link {
    int index;
    struct in_addr address;
};

/** An answer that is due later. */
struct pending {
    int64_t due_ns; /* 0: free */
    struct sockaddr_in to;
    struct link from;
    char *text;
    size_t bytes;
};

static struct {
    int fd;
    struct link link[LINKS_MAX];
    int links;
    struct pending pending[PENDING_MAX];
    struct {
        in_addr_t address;
        int count;
    } asked[ADDRESSES];
    int total;
    int64_t window_ns, scan_ns;
    uint32_t instance; /* of the messages of one start */
    bool reported;
} net;

/* --- messages ----------------------------------------------------------------------------------------------------- */

static void put_id(FILE *out)
{
    uint8_t r[16] = { 0 };

    (void)!getentropy(r, sizeof(r)); /* a name that is not unique does no harm */
    fprintf(out, "urn:uuid:%02x%02x%02x%02x-%02x%02x-4%01x%02x-a%01x%02x-%02x%02x%02x%02x%02x%02x", r[0], r[1], r[2],
            r[3], r[4], r[5], r[6] & 15, r[7], r[8] & 15, r[9], r[10], r[11], r[12], r[13], r[14], r[15]);
}

static void put_head(FILE *out, const char *action, const char *relates, const char *to)
{
    static _Atomic uint32_t number;

    fprintf(out,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
            "<s:Envelope xmlns:s=\"http://www.w3.org/2003/05/soap-envelope\" "
            "xmlns:a=\"http://schemas.xmlsoap.org/ws/2004/08/addressing\" "
            "xmlns:d=\"http://schemas.xmlsoap.org/ws/2005/04/discovery\" "
            "xmlns:dn=\"http://www.onvif.org/ver10/network/wsdl\" "
            "xmlns:tds=\"http://www.onvif.org/ver10/device/wsdl\"><s:Header><a:MessageID>");
    put_id(out);
    fputs("</a:MessageID>", out);
    if (relates) {
        fputs("<a:RelatesTo>", out);
        soap_put(out, relates);
        fputs("</a:RelatesTo>", out);
    }
    fprintf(out,
            "<a:To>%s</a:To><a:Action>http://schemas.xmlsoap.org/ws/2005/04/discovery/%s</a:Action>"
            "<d:AppSequence InstanceId=\"%u\" MessageNumber=\"%u\"/></s:Header><s:Body>",
            to, action, net.instance, ++number);
}

static void put_endpoint(FILE *out)
{
    fprintf(out, "<a:EndpointReference><a:Address>urn:uuid:%s</a:Address></a:EndpointReference>",
            answers_device()->uuid);
}

/* Address, types and scopes of the device. */
static void put_device(FILE *out, const char *host)
{
    put_endpoint(out);
    fputs("<d:Types>dn:NetworkVideoTransmitter tds:Device</d:Types><d:Scopes>", out);
    answers_scopes(out);
    fprintf(out,
            "</d:Scopes><d:XAddrs>http://%s:%d/onvif/device_service</d:XAddrs><d:MetadataVersion>1</d:MetadataVersion>",
            host, http_port());
}

static void put_answer(FILE *out, const char *what, const char *relates, const char *host)
{
    char action[32];

    snprintf(action, sizeof(action), "%sMatches", what);
    put_head(out, action, relates, "http://schemas.xmlsoap.org/ws/2004/08/addressing/role/anonymous");
    fprintf(out, "<d:%sMatches><d:%sMatch>", what, what);
    put_device(out, host);
    fprintf(out, "</d:%sMatch></d:%sMatches></s:Body></s:Envelope>\n", what, what);
}

/* Do words, separated by spaces, all hold? */
static bool all_hold(const char *words, bool (*holds)(const char *word, size_t n))
{
    while (*words) {
        const size_t space = strspn(words, " \t\r\n"), n = strcspn(words + space, " \t\r\n");

        if (n && !holds(words + space, n))
            return false;
        words += space + n;
    }
    return true;
}

/* A type by its name: clients are careless about prefixes. */
static bool is_type(const char *word, size_t n)
{
    static const char *const types[] = { "NetworkVideoTransmitter", "Device" };
    const char *colon = memchr(word, ':', n);
    const size_t skip = colon ? (size_t)(colon - word) + 1 : 0;

    for (size_t i = 0; i < ARRAY_LEN(types); i++)
        if (strlen(types[i]) == n - skip && !memcmp(types[i], word + skip, n - skip))
            return true;
    return false;
}

/* A scope that is one of ours, or begins one at a slash. */
static bool is_scope(const char *word, size_t n)
{
    size_t bytes;
    char *text = NULL;
    FILE *out = open_memstream(&text, &bytes);
    bool found = false;

    if (!out)
        return false;
    fputc(' ', out);
    answers_scopes(out);
    fputc(' ', out);
    fclose(out);
    n -= n > 0 && word[n - 1] == '/';
    for (const char *at = text; !found && (at = strchr(at, ' ')) != NULL && at[1]; at++)
        found = strlen(at + 1) > n && !memcmp(at + 1, word, n) && strchr(" /", at[1 + n]);
    free(text);
    return found;
}

bool discovery_answer(FILE *out, const void *data, size_t bytes, const char *host)
{
    const char *id, *types, *scopes, *address, *name;
    char mine[ONVIF_UUID + 16];
    struct soap s;
    bool due = false;

    if (!soap_parse(&s, data, bytes) && s.node[s.call].ns == SOAP_NS_DISCOVERY) {
        name = s.node[s.call].name;
        id = soap_text(&s, s.header, "MessageID");
        types = soap_text(&s, s.call, "Types");
        scopes = soap_text(&s, s.call, "Scopes");
        address = soap_text(&s, soap_child(&s, s.call, "EndpointReference"), "Address");
        snprintf(mine, sizeof(mine), "urn:uuid:%s", answers_device()->uuid);
        due = id && *id && strlen(id) < ID_MAX &&
              (!strcmp(name, "Probe")     ? all_hold(types ? types : "", is_type) && all_hold(scopes ? scopes : "", is_scope)
               : !strcmp(name, "Resolve") ? address && !strcmp(address, mine)
                                          : false);
        if (due)
            put_answer(out, name, id, host);
    }
    soap_free(&s);
    return due;
}

/* --- interfaces --------------------------------------------------------------------------------------------------- */

/* Is the device reachable at this address of an interface? */
static bool is_ours(const struct sst_config *c, const struct ifaddrs *i)
{
    const char *listens = c->onvif.address;
    const bool any = !strcmp(listens, "0.0.0.0") || !strcmp(listens, "::");
    const struct sockaddr_in *a = (const void *)i->ifa_addr;
    struct in_addr one;

    if (!a || a->sin_family != AF_INET || !(i->ifa_flags & IFF_UP))
        return false;
    if (any)
        return !(i->ifa_flags & IFF_LOOPBACK) && (i->ifa_flags & IFF_MULTICAST);
    return inet_pton(AF_INET, listens, &one) == 1 && one.s_addr == a->sin_addr.s_addr;
}

static void send_to(const struct link *from, const struct sockaddr_in *to, const char *text, size_t bytes)
{
    struct in_pktinfo info = { .ipi_ifindex = from->index, .ipi_spec_dst = from->address };
    union {
        struct cmsghdr align;
        char room[CMSG_SPACE(sizeof(info))];
    } control = { 0 };
    struct iovec data = { .iov_base = (void *)(uintptr_t)text, .iov_len = bytes };
    struct msghdr m = { .msg_name = (void *)(uintptr_t)to,
                        .msg_namelen = sizeof(*to),
                        .msg_iov = &data,
                        .msg_iovlen = 1,
                        .msg_control = control.room,
                        .msg_controllen = sizeof(control.room) };
    struct cmsghdr *c = CMSG_FIRSTHDR(&m);

    c->cmsg_level = IPPROTO_IP;
    c->cmsg_type = IP_PKTINFO;
    c->cmsg_len = CMSG_LEN(sizeof(info));
    memcpy(CMSG_DATA(c), &info, sizeof(info));
    (void)sendmsg(net.fd, &m, MSG_DONTWAIT | MSG_NOSIGNAL);
}

static void link_host(char host[ONVIF_HOST], const struct link *l)
{
    char text[INET_ADDRSTRLEN];

    http_host(host, inet_ntop(AF_INET, &l->address, text, sizeof(text)) ? text : "127.0.0.1");
}

/* Hello or Bye to all of a link. */
static void announce(const struct link *l, bool hello)
{
    const struct sockaddr_in all = { .sin_family = AF_INET,
                                     .sin_port = htons(PORT),
                                     .sin_addr.s_addr = inet_addr(GROUP) };
    char *text = NULL, host[ONVIF_HOST];
    size_t bytes;
    FILE *out = open_memstream(&text, &bytes);

    if (!out)
        return;
    link_host(host, l);
    put_head(out, hello ? "Hello" : "Bye", NULL, "urn:schemas-xmlsoap-org:ws:2005:04:discovery");
    fprintf(out, "<d:%s>", hello ? "Hello" : "Bye");
    if (hello)
        put_device(out, host);
    else
        put_endpoint(out);
    fprintf(out, "</d:%s></s:Body></s:Envelope>\n", hello ? "Hello" : "Bye");
    fclose(out);
    send_to(l, &all, text, bytes);
    free(text);
}

static bool is_known(const struct link *l)
{
    for (int i = 0; i < net.links; i++)
        if (net.link[i].index == l->index && net.link[i].address.s_addr == l->address.s_addr)
            return true;
    return false;
}

/* Join the group on interfaces that have come, and greet there; forget interfaces that have gone. */
static void scan(const struct sst_config *c)
{
    struct link now[LINKS_MAX];
    struct ifaddrs *all = NULL;
    int links = 0;

    if (getifaddrs(&all))
        return;
    for (const struct ifaddrs *i = all; i; i = i->ifa_next) {
        struct link l = { 0 };
        struct ip_mreqn join = { .imr_multiaddr.s_addr = inet_addr(GROUP) };

        if (links == LINKS_MAX || !is_ours(c, i))
            continue;
        l.index = (int)if_nametoindex(i->ifa_name);
        l.address = ((const struct sockaddr_in *)(const void *)i->ifa_addr)->sin_addr;
        join.imr_ifindex = l.index;
        if (setsockopt(net.fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &join, sizeof(join)) && errno != EADDRINUSE)
            continue;
        now[links++] = l;
        if (!is_known(&l))
            announce(&l, true);
    }
    freeifaddrs(all);
    memcpy(net.link, now, (size_t)links * sizeof(now[0]));
    net.links = links;
}

static int open_socket(void)
{
    const struct sockaddr_in here = { .sin_family = AF_INET, .sin_port = htons(PORT) };
    const int one = 1, zero = 0, hops = 4;
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    int err;

    if (fd < 0)
        return -errno;
    /* Other programs of this machine may have the port as well: a multicast reaches every one. */
    if (!setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one)) &&
        !setsockopt(fd, IPPROTO_IP, IP_PKTINFO, &one, sizeof(one)) &&
        !setsockopt(fd, IPPROTO_IP, IP_MULTICAST_ALL, &zero, sizeof(zero)) &&
        !setsockopt(fd, IPPROTO_IP, IP_MULTICAST_TTL, &hops, sizeof(hops)) &&
        !bind(fd, (const struct sockaddr *)&here, sizeof(here)))
        return fd;
    err = -errno;
    close(fd);
    return err;
}

/* --- at work ------------------------------------------------------------------------------------------------------ */

/* @return false: this address, or all together, have had enough */
static bool may_answer(in_addr_t address, int64_t now_ns)
{
    int at = (int)(ntohl(address) * UINT32_C(2654435761) % ADDRESSES);

    if (now_ns - net.window_ns > WINDOW_NS) {
        memset(net.asked, 0, sizeof(net.asked));
        net.total = 0;
        net.window_ns = now_ns;
    }
    for (int i = 0; i < ADDRESSES && net.asked[at].count && net.asked[at].address != address; i++)
        at = (at + 1) % ADDRESSES;
    if (net.total == TOTAL_MOST || (net.asked[at].count && net.asked[at].address != address) ||
        net.asked[at].count == ADDRESS_MOST)
        return false;
    net.asked[at].address = address;
    net.asked[at].count++;
    net.total++;
    return true;
}

static void answer_later(const struct sockaddr_in *to, const struct link *from, const void *data, size_t bytes)
{
    const int64_t now_ns = sst_clock_now_ns();
    struct pending *p = NULL;
    char host[ONVIF_HOST];
    uint16_t delay = 0;
    FILE *out;
    bool due;

    for (int i = 0; i < PENDING_MAX && !p; i++)
        p = net.pending[i].due_ns ? NULL : &net.pending[i];
    out = p ? open_memstream(&p->text, &p->bytes) : NULL;
    if (!out)
        return;
    link_host(host, from);
    due = discovery_answer(out, data, bytes, host);
    fclose(out);
    if (!due || !may_answer(to->sin_addr.s_addr, now_ns)) {
        free(p->text);
        return;
    }
    (void)!getentropy(&delay, sizeof(delay));
    p->due_ns = now_ns + 1 + delay % (DELAY_MOST_MS + 1) * INT64_C(1000000);
    p->to = *to;
    p->from = *from;
}

static void receive(void)
{
    static char data[DATAGRAM_MAX];
    union {
        struct cmsghdr align;
        char room[256];
    } control;
    struct sockaddr_in to;
    struct iovec place = { .iov_base = data, .iov_len = sizeof(data) };
    struct msghdr m = { .msg_name = &to, .msg_iov = &place, .msg_iovlen = 1 };
    struct link from = { 0 };
    ssize_t n;

    m.msg_namelen = sizeof(to);
    m.msg_control = control.room;
    m.msg_controllen = sizeof(control.room);
    n = recvmsg(net.fd, &m, MSG_DONTWAIT);
    if (n <= 0 || m.msg_flags & MSG_TRUNC)
        return;
    for (struct cmsghdr *c = CMSG_FIRSTHDR(&m); c; c = CMSG_NXTHDR(&m, c)) {
        struct in_pktinfo info;

        if (c->cmsg_level != IPPROTO_IP || c->cmsg_type != IP_PKTINFO)
            continue;
        memcpy(&info, CMSG_DATA(c), sizeof(info));
        from = (struct link){ .index = info.ipi_ifindex, .address = info.ipi_spec_dst };
    }
    for (int i = 0; i < net.links; i++) /* the address of the device on this link */
        if (net.link[i].index == from.index) {
            answer_later(&to, &net.link[i], data, (size_t)n);
            return;
        }
}

/* Send answers that are due. @return ms to the next one, WAIT_MS at most */
static int send_due(void)
{
    const int64_t now_ns = sst_clock_now_ns();
    int64_t wait_ns = WAIT_MS * INT64_C(1000000);

    for (int i = 0; i < PENDING_MAX; i++) {
        struct pending *p = &net.pending[i];

        if (p->due_ns && p->due_ns <= now_ns) {
            send_to(&p->from, &p->to, p->text, p->bytes);
            free(p->text);
            *p = (struct pending){ 0 };
        } else if (p->due_ns && p->due_ns - now_ns < wait_ns) {
            wait_ns = p->due_ns - now_ns;
        }
    }
    return (int)((wait_ns + 999999) / 1000000);
}

/* The socket, once it is to be had. */
static bool is_open(void)
{
    if (net.fd < 0)
        net.fd = open_socket();
    if (net.fd < 0 && !net.reported) {
        sst_log_warning("onvif: UDP port %d: %s; recorders do not find the camera by searching until it is free", PORT,
                        strerror(-net.fd));
        net.reported = true;
    }
    return net.fd >= 0;
}

void discovery_run(const struct sst_server *s)
{
    sst_thread_name("onvif-discovery");
    net.fd = -1;
    net.instance = (uint32_t)(sst_clock_wall_ns() / SECOND);
    while (!atomic_load(&s->stop)) {
        const int64_t now_ns = sst_clock_now_ns();
        struct pollfd fd = { .events = POLLIN };

        if (http_port() && (!net.scan_ns || now_ns - net.scan_ns > SCAN_NS) && is_open()) {
            scan(&s->config);
            net.scan_ns = now_ns;
        }
        fd.fd = net.fd;
        if (poll(&fd, 1, send_due()) > 0)
            receive();
    }
    for (int i = 0; i < net.links; i++)
        announce(&net.link[i], false);
    for (int i = 0; i < PENDING_MAX; i++)
        free(net.pending[i].due_ns ? net.pending[i].text : NULL);
    if (net.fd >= 0)
        close(net.fd);
}
