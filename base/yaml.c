/* Tree of a document, built from libyaml's events; a construct that is not allowed ends parsing at once. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/yaml.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <yaml.h>

#include "base/edit_distance.h"
#include "base/log.h"
#include "base/mem.h"

struct fault {
    int line, column;
    char text[480];
};

struct sst_yaml_asked {
    struct sst_yaml_asked *next;
    char key[];
};

struct sst_yaml {
    char *name;
    struct sst_yaml_node *root;
    int n_nodes, n_faults; /* n_faults may exceed the capacity of faults */
    struct fault faults[SST_YAML_MAX_FAULTS];
};

struct anchor {
    char *name;
    const struct sst_yaml_node *node;
};

/* State of parsing: the open containers, and the key of the next value. */
struct builder {
    struct sst_yaml *doc;
    bool foreign;
    struct anchor *anchor;
    int n_anchors, room;
    int left_out;               /* depth in an element of a list that is not kept */
    struct sst_yaml_node *open; /* innermost, or NULL */
    int depth, documents;
    char *key;
    int key_line, key_column;
    bool again; /* `key` is a duplicate */
};

/* --- faults ------------------------------------------------------------------------------------------------------- */

static void SST_PRINTF(4, 5) note(struct sst_yaml *doc, int line, int column, const char *fmt, ...)
{
    struct fault *f;
    va_list args;

    if (doc->n_faults++ >= SST_YAML_MAX_FAULTS)
        return;
    f = &doc->faults[doc->n_faults - 1];
    f->line = line;
    f->column = column;
    va_start(args, fmt);
    vsnprintf(f->text, sizeof(f->text), fmt, args);
    va_end(args);
}

void sst_yaml_fault(struct sst_yaml *doc, const struct sst_yaml_node *at, const char *fmt, ...)
{
    const struct sst_yaml_node *named = at;
    char what[400];
    va_list args;

    va_start(args, fmt);
    vsnprintf(what, sizeof(what), fmt, args);
    va_end(args);
    while (named && !named->key)
        named = named->parent; /* elements of a list are reported under the list's key */
    note(doc, at ? at->line : 1, at ? at->column : 1, "%.60s%s%s", named ? named->key : "", named ? " " : "", what);
}

void sst_yaml_unknown(struct sst_yaml *doc, const struct sst_yaml_node *at, const char *what, const char *remedy)
{
    note(doc, at->line, at->column, "unknown %s `%.60s`; %s", what, at->text, remedy);
}

static int by_position(const void *a, const void *b)
{
    const struct fault *f = a, *g = b;

    return f->line != g->line ? (f->line > g->line) - (f->line < g->line)
                              : (f->column > g->column) - (f->column < g->column);
}

static int log_faults(struct sst_yaml *doc)
{
    const int shown = sst_min_int(doc->n_faults, SST_YAML_MAX_FAULTS);

    if (!shown)
        return 0;
    qsort(doc->faults, (size_t)shown, sizeof(doc->faults[0]), by_position);
    for (int i = 0; i < shown; i++)
        sst_log_error("%s:%d:%d: %s", doc->name, doc->faults[i].line, doc->faults[i].column, doc->faults[i].text);
    if (doc->n_faults > shown)
        sst_log_error("%s: %d more faults; correct these first", doc->name, doc->n_faults - shown);
    return -EBADMSG;
}

/* --- tree --------------------------------------------------------------------------------------------------------- */

static void free_node(struct sst_yaml_node *node)
{
    while (node) {
        struct sst_yaml_node *next = node->next;

        free_node(node->first); /* no deeper than SST_YAML_MAX_DEPTH */
        while (node->asked) {
            struct sst_yaml_asked *asked = node->asked;

            node->asked = asked->next;
            free(asked);
        }
        free((char *)(uintptr_t)node->text);
        free((char *)(uintptr_t)node->key);
        free(node);
        node = next;
    }
}

void sst_yaml_destroy(struct sst_yaml *doc)
{
    if (!doc)
        return;
    free_node(doc->root);
    free(doc->name);
    free(doc);
}

/* Note a fault that ends parsing. */
static int refuse(struct builder *b, const yaml_event_t *e, const char *what)
{
    note(b->doc, (int)e->start_mark.line + 1, (int)e->start_mark.column + 1, "%s", what);
    return -EBADMSG;
}

static bool clean(const yaml_char_t *text, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        if (text[i] < 0x20 || text[i] == 0x7f)
            return false;
    }
    return true;
}

static char *copy(const yaml_char_t *text, size_t n)
{
    char *p = malloc(n + 1);

    if (p) {
        memcpy(p, text, n);
        p[n] = 0;
    }
    return p;
}

static const struct sst_yaml_node *find(const struct sst_yaml_node *map, const char *key)
{
    const struct sst_yaml_node *n = map->first;

    while (n && strcmp(n->key, key) != 0)
        n = n->next;
    return n;
}

/* Append a node to the open container; it owns `text`, also on failure. */
static int append(struct builder *b, const yaml_event_t *e, enum sst_yaml_type type, char *text, bool plain)
{
    struct sst_yaml_node *node = calloc(1, sizeof(*node)), *parent = b->open;

    if (!node || !text) {
        free(node);
        free(text);
        return -ENOMEM;
    }
    *node = (struct sst_yaml_node){
        .type = type,
        .line = (int)e->start_mark.line + 1,
        .column = (int)e->start_mark.column + 1,
        .text = text,
        .plain = plain,
        .key = b->key,
        .key_line = b->key_line,
        .key_column = b->key_column,
        .again = b->again,
        .parent = parent,
    };
    b->key = NULL;
    b->again = false;
    if (!parent)
        b->doc->root = node;
    else if (parent->last)
        parent->last->next = node;
    else
        parent->first = node;
    if (parent) {
        parent->last = node;
        parent->count++;
    }
    if (type != SST_YAML_SCALAR)
        b->open = node;
    return 0;
}

static int add_key(struct builder *b, const yaml_event_t *e)
{
    b->key = copy(e->data.scalar.value, e->data.scalar.length);
    b->key_line = (int)e->start_mark.line + 1;
    b->key_column = (int)e->start_mark.column + 1;
    if (!b->key)
        return -ENOMEM;
    if (b->foreign && !strcmp(b->key, "<<"))
        return refuse(b, e, "a merge key (<<); write its keys out");
    if (b->open->count == SST_YAML_MAX_KEYS)
        return refuse(b, e, "a mapping with more than 1024 keys; split it");
    if (find(b->open, b->key)) {
        note(b->doc, b->key_line, b->key_column, "duplicate key `%.60s`, first in line %d; keep one of them", b->key,
             find(b->open, b->key)->key_line);
        b->again = true;
    }
    return 0;
}

static int add_scalar(struct builder *b, const yaml_event_t *e)
{
    if (!clean(e->data.scalar.value, e->data.scalar.length))
        return refuse(b, e, "a text with a line break or another control character; write it in one line");
    if (b->open && b->open->type == SST_YAML_MAP && !b->key)
        return add_key(b, e);
    return append(b, e, SST_YAML_SCALAR, copy(e->data.scalar.value, e->data.scalar.length),
                  e->data.scalar.style == YAML_PLAIN_SCALAR_STYLE);
}

static int add_container(struct builder *b, const yaml_event_t *e, enum sst_yaml_type type)
{
    if (b->open && b->open->type == SST_YAML_MAP && !b->key)
        return refuse(b, e, "a key that is a list or a mapping; write it as plain text");
    if (b->depth == SST_YAML_MAX_DEPTH)
        return refuse(b, e, "nested deeper than the limit of 16 levels");
    b->depth++;
    return append(b, e, type, calloc(1, 1), false);
}

/* Names the node that was appended last. */
static int add_anchor(struct builder *b, const struct sst_yaml_node *node, const yaml_char_t *name)
{
    char *kept =
        sst_mem_grow(&b->anchor, b->n_anchors, &b->room, sizeof(*b->anchor)) ? strdup((const char *)name) : NULL;

    if (!kept)
        return -ENOMEM;
    b->anchor[b->n_anchors++] = (struct anchor){ kept, node };
    return 0;
}

/* Append a copy of a node and all below it, which is no deeper than SST_YAML_MAX_DEPTH. */
static int add_copy(struct builder *b, const yaml_event_t *e, const struct sst_yaml_node *node)
{
    struct sst_yaml_node *made, *parent = b->open;
    int err;

    if (b->doc->n_nodes++ == SST_YAML_MAX_NODES)
        return refuse(b, e, "more than the limit of 65536 keys and values");
    if (node->type != SST_YAML_SCALAR && b->depth == SST_YAML_MAX_DEPTH)
        return refuse(b, e, "nested deeper than the limit of 16 levels");
    err = append(b, e, node->type, strdup(node->text), node->plain);
    if (err || node->type == SST_YAML_SCALAR)
        return err;
    made = b->open;
    b->depth++;
    for (const struct sst_yaml_node *n = node->first; n && !err; n = n->next) {
        b->key = n->key ? strdup(n->key) : NULL;
        b->key_line = n->key_line;
        b->key_column = n->key_column;
        b->again = n->again;
        err = n->key && !b->key ? -ENOMEM : add_copy(b, e, n);
    }
    made->count = node->count;
    b->depth--;
    b->open = parent;
    return err;
}

static int add_alias(struct builder *b, const yaml_event_t *e)
{
    const char *name = (const char *)e->data.alias.anchor;
    int i = b->n_anchors - 1;

    if (!b->foreign)
        return refuse(b, e, "an alias (*name); write the value out");
    if (!b->open || (b->open->type == SST_YAML_MAP && !b->key))
        return refuse(b, e, "an alias as a key; write it as plain text");
    while (i >= 0 && strcmp(b->anchor[i].name, name) != 0)
        i--;
    if (i < 0)
        return refuse(b, e, "an alias (*name) of a value that is not kept; write the value out");
    for (const struct sst_yaml_node *n = b->open; n; n = n->parent) {
        if (n == b->anchor[i].node)
            return refuse(b, e, "an alias (*name) inside of its own value; write the value out");
    }
    return add_copy(b, e, b->anchor[i].node);
}

/* Count the elements of a long list of another program's file, without keeping them. @return whether the event is done
 */
static bool leave_out(struct builder *b, yaml_event_type_t type)
{
    const bool starts = type == YAML_SEQUENCE_START_EVENT || type == YAML_MAPPING_START_EVENT;
    const bool ends = type == YAML_SEQUENCE_END_EVENT || type == YAML_MAPPING_END_EVENT;

    if (b->left_out) {
        b->left_out += starts - ends;
        return true;
    }
    if (!b->foreign || ends || !b->open || b->open->type != SST_YAML_LIST || b->open->count < SST_YAML_FOREIGN_LIST)
        return false;
    b->open->count += b->open->count < INT32_MAX;
    b->left_out = starts;
    return true;
}

static int handle_event(struct builder *b, const yaml_event_t *e)
{
    const yaml_char_t *anchor = NULL, *tag = NULL;
    struct sst_yaml_node *parent = b->open;
    int err;

    if (leave_out(b, e->type))
        return 0;
    switch (e->type) {
    case YAML_ALIAS_EVENT:
        return add_alias(b, e);
    case YAML_SCALAR_EVENT:
        anchor = e->data.scalar.anchor;
        tag = e->data.scalar.tag;
        break;
    case YAML_SEQUENCE_START_EVENT:
        anchor = e->data.sequence_start.anchor;
        tag = e->data.sequence_start.tag;
        break;
    case YAML_MAPPING_START_EVENT:
        anchor = e->data.mapping_start.anchor;
        tag = e->data.mapping_start.tag;
        break;
    case YAML_SEQUENCE_END_EVENT:
    case YAML_MAPPING_END_EVENT:
        b->depth--;
        b->open = b->open->parent;
        return 0;
    case YAML_DOCUMENT_START_EVENT:
        return b->documents++ ? refuse(b, e, "a second document begins here; write one document per file") : 0;
    default:
        return 0;
    }
    if ((anchor && !b->foreign) || tag)
        return refuse(b, e, "an anchor (&name) or a tag (!name); write the plain value");
    if (b->doc->n_nodes++ == SST_YAML_MAX_NODES)
        return refuse(b, e, "more than the limit of 65536 keys and values");
    err = e->type == YAML_SCALAR_EVENT
              ? add_scalar(b, e)
              : add_container(b, e, e->type == YAML_MAPPING_START_EVENT ? SST_YAML_MAP : SST_YAML_LIST);
    if (!err && anchor && !b->key) /* of a value: a key is no node */
        err = add_anchor(b, parent ? parent->last : b->doc->root, anchor);
    return err;
}

static int syntax_fault(struct sst_yaml *doc, const yaml_parser_t *p)
{
    if (p->error == YAML_MEMORY_ERROR)
        return -ENOMEM;
    note(doc, (int)p->problem_mark.line + 1, (int)p->problem_mark.column + 1, "invalid YAML: %s%s%s; correct this line",
         p->problem ? p->problem : "unreadable", p->context ? " " : "", p->context ? p->context : "");
    return -EBADMSG;
}

static int read_events(struct sst_yaml *doc, yaml_parser_t *parser, bool foreign)
{
    struct builder b = { .doc = doc, .foreign = foreign };
    bool end = false;
    int err = 0;

    while (!err && !end) {
        yaml_event_t e;

        if (!yaml_parser_parse(parser, &e)) {
            err = syntax_fault(doc, parser);
            break;
        }
        end = e.type == YAML_STREAM_END_EVENT;
        err = handle_event(&b, &e);
        yaml_event_delete(&e);
    }
    free(b.key);
    while (b.n_anchors)
        free(b.anchor[--b.n_anchors].name);
    free(b.anchor);
    return err;
}

static int parse(struct sst_yaml **out, const char *text, size_t size, const char *name, bool foreign)
{
    const size_t limit = foreign ? SST_YAML_FOREIGN_BYTES : SST_YAML_MAX_BYTES;
    struct sst_yaml *doc;
    yaml_parser_t parser;
    int err = -ENOMEM;

    if (size > limit) {
        sst_log_error("%s has %zu bytes; the limit for YAML files is %zu MiB", name, size, limit >> 20);
        return -EBADMSG;
    }
    doc = calloc(1, sizeof(*doc));
    if (doc)
        doc->name = strdup(name);
    if (doc && doc->name && yaml_parser_initialize(&parser)) {
        yaml_parser_set_input_string(&parser, (const unsigned char *)text, size);
        err = read_events(doc, &parser, foreign);
        yaml_parser_delete(&parser);
    }
    if (err == -ENOMEM)
        sst_log_error("%s: not enough memory to read it", name);
    else if (err)
        err = log_faults(doc);
    if (err)
        sst_yaml_destroy(doc);
    else
        *out = doc;
    return err;
}

int sst_yaml_parse(struct sst_yaml **out, const char *text, size_t size, const char *name)
{
    return parse(out, text, size, name, false);
}

int sst_yaml_parse_foreign(struct sst_yaml **out, const char *text, size_t size, const char *name)
{
    return parse(out, text, size, name, true);
}

bool sst_yaml_empty(const struct sst_yaml *doc)
{
    const struct sst_yaml_node *r = doc->root;

    return !r || (r->type == SST_YAML_SCALAR && r->plain && !*r->text);
}

const char *sst_yaml_name(const struct sst_yaml *doc)
{
    return doc->name;
}

struct sst_yaml_node *sst_yaml_root(struct sst_yaml *doc)
{
    if (doc->root && doc->root->type == SST_YAML_MAP)
        return doc->root;
    sst_yaml_fault(doc, doc->root, "the file must contain keys with values, such as \"key: value\"");
    return NULL;
}

/* Without memory an unknown key is reported without a suggestion. */
static void remember(struct sst_yaml_node *map, const char *key)
{
    const size_t size = strlen(key) + 1;
    struct sst_yaml_asked *asked;

    for (asked = map->asked; asked; asked = asked->next) {
        if (!strcmp(asked->key, key))
            return;
    }
    asked = malloc(sizeof(*asked) + size);
    if (!asked)
        return;
    memcpy(asked->key, key, size);
    asked->next = map->asked;
    map->asked = asked;
}

struct sst_yaml_node *sst_yaml_get(struct sst_yaml_node *map, const char *key)
{
    struct sst_yaml_node *found = NULL;

    if (!map || map->type != SST_YAML_MAP)
        return NULL;
    remember(map, key);
    for (struct sst_yaml_node *n = map->first; n; n = n->next) {
        if (strcmp(n->key, key) != 0)
            continue;
        n->known = true;
        found = found ? found : n;
    }
    return found;
}

struct sst_yaml_node *sst_yaml_need(struct sst_yaml *doc, struct sst_yaml_node *map, const char *key)
{
    struct sst_yaml_node *node = sst_yaml_get(map, key);

    if (map && !node)
        sst_yaml_fault(doc, map, "lacks the key `%s`; add it", key);
    return node;
}

void sst_yaml_know_all(struct sst_yaml_node *map)
{
    for (struct sst_yaml_node *n = map ? map->first : NULL; n; n = n->next)
        n->known = true;
}

void sst_yaml_know_tree(struct sst_yaml_node *node)
{
    for (struct sst_yaml_node *n = node ? node->first : NULL; n; n = n->next) {
        n->known = true;
        sst_yaml_know_tree(n); /* no deeper than SST_YAML_MAX_DEPTH */
    }
}

/* The known key nearest to a misspelt one, among the ones that the mapping does not have yet. */
static const char *suggestion(const struct sst_yaml_node *map, const char *key)
{
    const char *best = NULL;
    int least = SST_EDIT_FAR;

    for (const struct sst_yaml_asked *a = map->asked; a; a = a->next) {
        const int distance = find(map, a->key) ? SST_EDIT_FAR : sst_edit_distance(key, a->key);

        if (distance < least || (best && distance == least && strcmp(a->key, best) < 0)) {
            best = a->key;
            least = distance;
        }
    }
    return best;
}

static void note_unknown(struct sst_yaml *doc, const struct sst_yaml_node *node)
{
    for (const struct sst_yaml_node *n = node->first; n; n = n->next) {
        if (n->again)
            continue; /* reported as a duplicate; its content was never read */
        if (node->type == SST_YAML_MAP && !n->known) {
            const char *best = suggestion(node, n->key);

            if (best)
                note(doc, n->key_line, n->key_column, "unknown key `%.60s`; did you mean `%s`?", n->key, best);
            else
                note(doc, n->key_line, n->key_column, "unknown key `%.60s`; correct its spelling or remove it", n->key);
        } else {
            note_unknown(doc, n);
        }
    }
}

int sst_yaml_finish(struct sst_yaml *doc)
{
    if (doc->root && doc->root->type == SST_YAML_MAP)
        note_unknown(doc, doc->root);
    return log_faults(doc);
}
