/* SOAP: requests parsed by expat into a bounded tree, without document types and so without entities of others; envelopes
 * of answers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <errno.h>
#include <expat.h>
#include <stdlib.h>
#include <string.h>

#include "publishers/onvif/onvif_internal.h"

#define SEPARATOR '\n' /* between namespace and name: never part of either */

static const struct {
    const char *uri;
    enum soap_ns ns;
} namespaces[] = {
    { "http://www.w3.org/2003/05/soap-envelope", SOAP_NS_ENVELOPE },
    { "http://schemas.xmlsoap.org/soap/envelope/", SOAP_NS_ENVELOPE },
    { "http://www.onvif.org/ver10/device/wsdl", SOAP_NS_DEVICE },
    { "http://www.onvif.org/ver10/media/wsdl", SOAP_NS_MEDIA },
    { "http://www.onvif.org/ver20/media/wsdl", SOAP_NS_MEDIA2 },
    { "http://www.onvif.org/ver10/events/wsdl", SOAP_NS_EVENTS },
    { "http://docs.oasis-open.org/wsn/b-2", SOAP_NS_EVENTS },
    { "http://schemas.xmlsoap.org/ws/2005/04/discovery", SOAP_NS_DISCOVERY },
    { "http://schemas.xmlsoap.org/ws/2004/08/addressing", SOAP_NS_ADDRESSING },
    { "http://www.w3.org/2005/08/addressing", SOAP_NS_ADDRESSING },
    { "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-secext-1.0.xsd", SOAP_NS_SECURITY },
};

/** A parser at work. */
struct reading {
    struct soap *s;
    XML_Parser parser;
    int at, depth;      /* the open element, -1: none */
    size_t text, bytes; /* of the open element: its place in the arena */
    int err;
};

static void stop(struct reading *r, int err)
{
    if (!r->err)
        r->err = err;
    XML_StopParser(r->parser, XML_FALSE);
}

/* @return NULL: no room; the arena holds all that a document of its size can have */
static char *keep(struct soap *s, const char *text, size_t n)
{
    char *at = s->arena + s->used;

    if (n >= s->room - s->used)
        return NULL;
    memcpy(at, text, n);
    at[n] = 0;
    s->used += n + 1;
    return at;
}

static enum soap_ns find_namespace(const char *uri, size_t n)
{
    for (size_t i = 0; i < ARRAY_LEN(namespaces); i++)
        if (strlen(namespaces[i].uri) == n && !memcmp(namespaces[i].uri, uri, n))
            return namespaces[i].ns;
    return SOAP_NS_OTHER;
}

/* The text so far belongs to the open element, unless that has had children; else its place is used again. */
static void end_text(struct reading *r)
{
    struct soap_node *n = r->at < 0 ? NULL : &r->s->node[r->at];
    char *text = r->s->arena + r->text;

    r->s->used = r->text;
    if (!n || n->child >= 0 || n->text[0])
        return;
    while (r->bytes && isspace((unsigned char)text[r->bytes - 1]))
        r->bytes--;
    for (; r->bytes && isspace((unsigned char)*text); text++)
        r->bytes--;
    text[r->bytes] = 0;
    n->text = text;
    r->s->used = (size_t)(text - r->s->arena) + r->bytes + 1;
}

static void begin_text(struct reading *r)
{
    r->text = r->s->used;
    r->bytes = 0;
}

static void on_start(void *arg, const XML_Char *name, const XML_Char **attributes)
{
    struct reading *r = arg;
    struct soap *s = r->s;
    const char *local = strrchr(name, SEPARATOR), *type = NULL;
    struct soap_node *n = &s->node[s->nodes];
    int *link;

    if (r->err || r->depth == SOAP_DEPTH || s->nodes == SOAP_NODES) {
        stop(r, -E2BIG);
        return;
    }
    end_text(r);
    for (int i = 0; attributes[i]; i += 2)
        if (!strcmp(attributes[i], "Type"))
            type = attributes[i + 1];
    *n = (struct soap_node){ .ns = local ? find_namespace(name, (size_t)(local - name)) : SOAP_NS_OTHER,
                             .text = "",
                             .parent = r->at,
                             .child = -1,
                             .next = -1 };
    local = local ? local + 1 : name;
    n->name = s->used < s->room ? keep(s, local, strlen(local)) : NULL;
    n->type = type && n->name ? keep(s, type, strlen(type)) : NULL;
    if (!n->name || (type && !n->type)) {
        stop(r, -E2BIG);
        return;
    }
    if (r->at >= 0) {
        for (link = &s->node[r->at].child; *link >= 0; link = &s->node[*link].next)
            ;
        *link = s->nodes;
    }
    r->at = s->nodes++;
    r->depth++;
    begin_text(r);
}

static void on_end(void *arg, const XML_Char *name SST_UNUSED)
{
    struct reading *r = arg;

    if (r->err) /* a stopped parser still ends an element that is empty */
        return;
    end_text(r);
    r->at = r->s->node[r->at].parent;
    r->depth--;
    begin_text(r);
}

static void on_text(void *arg, const XML_Char *text, int bytes)
{
    struct reading *r = arg;

    if (r->err || r->at < 0)
        return;
    if (r->text + r->bytes + (size_t)bytes + 1 >= r->s->room) {
        stop(r, -E2BIG);
        return;
    }
    memcpy(r->s->arena + r->text + r->bytes, text, (size_t)bytes);
    r->bytes += (size_t)bytes;
}

static void on_document_type(void *arg, const XML_Char *name SST_UNUSED, const XML_Char *system SST_UNUSED,
                             const XML_Char *public SST_UNUSED, int internal SST_UNUSED)
{
    stop(arg, -EBADMSG);
}

static int find_call(struct soap *s)
{
    const int body = soap_child(s, 0, "Body");

    if (strcmp(s->node[0].name, "Envelope") != 0 || s->node[0].ns != SOAP_NS_ENVELOPE || body < 0)
        return -EBADMSG;
    s->header = soap_child(s, 0, "Header");
    s->call = s->node[body].child;
    return s->call < 0 ? -EBADMSG : 0;
}

int soap_parse(struct soap *s, const void *data, size_t bytes)
{
    struct reading r = { .s = s, .at = -1 };

    *s = (struct soap){ .header = -1, .call = -1, .room = 2 * bytes + SOAP_NODES * 8 };
    s->arena = malloc(s->room);
    r.parser = s->arena ? XML_ParserCreateNS(NULL, SEPARATOR) : NULL;
    if (!r.parser)
        return -ENOMEM;
    XML_SetUserData(r.parser, &r);
    XML_SetElementHandler(r.parser, on_start, on_end);
    XML_SetCharacterDataHandler(r.parser, on_text);
    XML_SetStartDoctypeDeclHandler(r.parser, on_document_type);
    if (XML_Parse(r.parser, data, (int)bytes, 1) != XML_STATUS_OK && !r.err)
        r.err = XML_GetErrorCode(r.parser) == XML_ERROR_NO_MEMORY ? -ENOMEM : -EBADMSG;
    XML_ParserFree(r.parser);
    return r.err ? r.err : find_call(s);
}

void soap_free(struct soap *s)
{
    free(s->arena);
    s->arena = NULL;
}

int soap_child(const struct soap *s, int at, const char *name)
{
    int i = at < 0 ? -1 : s->node[at].child;

    while (i >= 0 && strcmp(s->node[i].name, name) != 0)
        i = s->node[i].next;
    return i;
}

const char *soap_text(const struct soap *s, int at, const char *name)
{
    const int i = soap_child(s, at, name);

    return i < 0 ? NULL : s->node[i].text;
}

/* --- answers ------------------------------------------------------------------------------------------------------ */

void soap_put(FILE *out, const char *text)
{
    for (; *text; text++) {
        switch (*text) {
        case '&': fputs("&amp;", out); break;
        case '<': fputs("&lt;", out); break;
        case '>': fputs("&gt;", out); break;
        case '"': fputs("&quot;", out); break;
        default:
            if ((unsigned char)*text >= ' ') /* others are no characters of XML, or spaces */
                fputc(*text, out);
        }
    }
}

void soap_begin(FILE *out, const struct soap *s)
{
    const char *id = s ? soap_text(s, s->header, "MessageID") : NULL;
    const char *action = s ? soap_text(s, s->header, "Action") : NULL;

    fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
          "<s:Envelope xmlns:s=\"http://www.w3.org/2003/05/soap-envelope\" "
          "xmlns:wsa=\"http://www.w3.org/2005/08/addressing\" "
          "xmlns:tt=\"http://www.onvif.org/ver10/schema\" "
          "xmlns:tds=\"http://www.onvif.org/ver10/device/wsdl\" "
          "xmlns:trt=\"http://www.onvif.org/ver10/media/wsdl\" "
          "xmlns:tr2=\"http://www.onvif.org/ver20/media/wsdl\" "
          "xmlns:tev=\"http://www.onvif.org/ver10/events/wsdl\" "
          "xmlns:wsnt=\"http://docs.oasis-open.org/wsn/b-2\" "
          "xmlns:wstop=\"http://docs.oasis-open.org/wsn/t-1\" "
          "xmlns:tns1=\"http://www.onvif.org/ver10/topics\" "
          "xmlns:xs=\"http://www.w3.org/2001/XMLSchema\" "
          "xmlns:wsrf-rw=\"http://docs.oasis-open.org/wsrf/rw-2\" "
          "xmlns:ter=\"http://www.onvif.org/ver10/error\">",
          out);
    if (id && action && *action) {
        fputs("<s:Header><wsa:Action>", out);
        soap_put(out, action);
        fputs("Response</wsa:Action><wsa:RelatesTo>", out);
        soap_put(out, id);
        fputs("</wsa:RelatesTo></s:Header>", out);
    }
    fputs("<s:Body>", out);
}

void soap_end(FILE *out)
{
    fputs("</s:Body></s:Envelope>\n", out);
}

void soap_refuse(FILE *out, const struct soap *s, const struct soap_fault *fault)
{
    soap_begin(out, s);
    fprintf(out, "<s:Fault><s:Code><s:Value>s:%s</s:Value><s:Subcode><s:Value>%s</s:Value>",
            fault->status == 500 ? "Receiver" : "Sender", fault->code);
    if (fault->detail)
        fprintf(out, "<s:Subcode><s:Value>%s</s:Value></s:Subcode>", fault->detail);
    fprintf(out, "</s:Subcode></s:Code><s:Reason><s:Text xml:lang=\"en\">%s</s:Text></s:Reason></s:Fault>",
            fault->reason);
    soap_end(out);
}
