/* Values of one document, parsed by the table of keys and checked one by one. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <arpa/inet.h>
#include <math.h>
#include <string.h>

#include "config/config_internal.h"

#include "base/log.h"
#include "base/text.h"

/* Empty, as "live:" with all its keys commented out. */
static bool nothing(const struct sst_yaml_node *n)
{
    return n->type == SST_YAML_SCALAR && n->plain && !*n->text;
}

static bool is_address(const char *text)
{
    unsigned char bytes[16];

    return inet_pton(AF_INET, text, bytes) == 1 || inet_pton(AF_INET6, text, bytes) == 1;
}

/* Scheme and host, and perhaps port and path: links append their own parts. */
static bool is_url(const char *text)
{
    const size_t n = !strncmp(text, "https://", 8) ? 8 : !strncmp(text, "http://", 7) ? 7 : 0;

    for (const char *c = text; *c; c++)
        if (*c <= ' ' || *c >= 127 || strchr("\"<>\\^`{|}?#@", *c))
            return false;
    return n && text[n] && text[n] != '/' && text[n] != ':';
}

static void fault_event(struct sst_yaml *doc, const struct sst_yaml_node *n)
{
    char list[300] = "";

    for (int i = 1; i < sst_event_types_count; i++)
        sst_text_add(list, sizeof(list), "%s%s", i > 1 ? ", " : "", sst_event_types[i]);
    sst_yaml_fault(doc, n, "must be \"*\" or one of %s, not %.40s", list, n->text);
}

static bool is_event(const char *text)
{
    for (int i = 0; i < sst_event_types_count; i++)
        if (!strcmp(sst_event_types[i], text))
            return true;
    return false;
}

static bool right_kind(struct sst_yaml *doc, const struct sst_yaml_node *n, enum sst_text_kind kind)
{
    const size_t size = strlen(n->text);
    double x[SST_ZONE_POINTS], y[SST_ZONE_POINTS];
    int cells[2];

    switch (kind) {
    case SST_TEXT_ANY:
        return true;
    case SST_TEXT_NAME:
        if (strspn(n->text, "abcdefghijklmnopqrstuvwxyz0123456789_-") == size)
            return true;
        sst_yaml_fault(doc, n, "must be a name of a-z, 0-9, - and _, not %.60s", n->text);
        return false;
    case SST_TEXT_PATH:
    case SST_TEXT_FILE:
        if (*n->text == '/')
            return true;
        sst_yaml_fault(doc, n, "must be an absolute path such as /etc/sst/..., not %.60s", n->text);
        return false;
    case SST_TEXT_ADDRESS:
        if (is_address(n->text))
            return true;
        sst_yaml_fault(doc, n, "must be a numeric address such as 127.0.0.1, 0.0.0.0 or ::1, not %.60s", n->text);
        return false;
    case SST_TEXT_TOPIC:
        if (!strpbrk(n->text, "+# $") && n->text[0] != '/' && n->text[size - 1] != '/')
            return true;
        sst_yaml_fault(doc, n, "must be an MQTT topic without spaces, +, #, $ and outer slashes, not %.60s", n->text);
        return false;
    case SST_TEXT_EVENT:
        if (is_event(n->text))
            return true;
        fault_event(doc, n);
        return false;
    case SST_TEXT_URL:
        if (is_url(n->text))
            return true;
        sst_yaml_fault(doc, n, "must be an address such as https://cam.example/, without ? and #, not %.60s", n->text);
        return false;
    case SST_TEXT_POINTS:
        if (config_points(n->text, x, y))
            return true;
        sst_yaml_fault(doc, n,
                       "must be 3 to %d points \"x,y x,y x,y\" in fractions 0..1 of the picture that enclose an area, "
                       "or the 2 ends of a line, not %.60s",
                       SST_ZONE_POINTS, n->text);
        return false;
    case SST_TEXT_SPLIT:
        if (config_split(n->text, cells))
            return true;
        sst_yaml_fault(doc, n,
                       "must be rows x columns of cameras in a picture such as 2x2, or 1x4 side by side, at most %d, "
                       "not %.60s",
                       SST_CONFIG_PARTS_MAX, n->text);
        return false;
    }
    return false;
}

/* Other YAML readers parse these words as another type, and the user may mean that. */
static bool ambiguous(const struct sst_yaml_node *n)
{
    static const char *const words[] = { "null", "~", "yes", "no", "on", "off", "true", "false" };

    for (size_t i = 0; n && n->plain && i < ARRAY_LEN(words); i++)
        if (!strcasecmp(n->text, words[i]))
            return true;
    return false;
}

static bool parse_text(struct sst_yaml *doc, const struct sst_yaml_node *n, const struct sst_key *key, char *out,
                       size_t size)
{
    const bool optional = key->optional || (key->standard && !*key->standard);

    if (!n)
        return false;
    if (optional && n->type == SST_YAML_SCALAR && !n->plain && !*n->text) {
        *out = 0;
        return true;
    }
    if (ambiguous(n)) {
        sst_yaml_fault(doc, n, "must be a string: put %s in quotes%s", n->text,
                       optional ? ", or write \"\" for none" : "");
        return false;
    }
    if (n->type == SST_YAML_SCALAR && *n->text && !right_kind(doc, n, key->kind))
        return false;
    return sst_yaml_string(doc, n, out, size);
}

static bool is_word(const struct sst_yaml_node *n, const struct sst_key *key)
{
    return n && key->word && n->type == SST_YAML_SCALAR && !strcmp(n->text, key->word);
}

static void parse_number(struct sst_yaml *doc, const struct sst_yaml_node *n, const struct sst_key *key, void *out)
{
    if (key->type == SST_KEY_DOUBLE && is_word(n, key))
        memcpy(out, &key->word_value, sizeof(double));
    else if (key->type == SST_KEY_INT && is_word(n, key))
        *(int *)out = (int)key->word_value;
    else if (key->type == SST_KEY_DOUBLE || key->type == SST_KEY_DOUBLES)
        (void)sst_yaml_double(doc, n, key->min, key->max, out);
    else
        (void)sst_yaml_int(doc, n, (int)key->min, (int)key->max, out);
}

/* A single number stands for all; the required length of a list is known only after all files are read. */
static void parse_numbers(struct sst_yaml *doc, const struct sst_yaml_node *n, const struct sst_key *key, char *first)
{
    const int most = (int)(key->size / key->stride);
    const struct sst_yaml_node *c = n->first;

    if (n->type == SST_YAML_MAP || (n->type == SST_YAML_LIST && (n->count < 1 || n->count > most))) {
        sst_yaml_fault(doc, n, "must be one number or a list of 1 to %d numbers in %.10g..%.10g", most, key->min, key->max);
        return;
    }
    for (int i = 0; i < most; i++) {
        if (n->type == SST_YAML_SCALAR && i)
            memcpy(first + (size_t)i * key->stride, first, key->stride);
        else if (n->type == SST_YAML_SCALAR || c)
            parse_number(doc, n->type == SST_YAML_SCALAR ? n : c, key, first + (size_t)i * key->stride);
        c = c ? c->next : NULL;
    }
}

static void set_count(const struct sst_key *key, void *base, int n)
{
    if (key->count_offset != SST_KEY_NO_COUNT)
        memcpy((char *)base + key->count_offset, &n, sizeof(n));
}

/* Number of elements to read; anything but a list, and a list that is too long, is a fault. */
static int list_count(struct sst_yaml *doc, const struct sst_yaml_node *n, const struct sst_key *key)
{
    const int most = (int)(key->size / key->stride);

    if (n->type != SST_YAML_LIST) {
        sst_yaml_fault(doc, n, "must be a list; write [] for an empty one");
        return 0;
    }
    if (n->count > most)
        sst_yaml_fault(doc, n, "has %d entries, more than the limit of %d", n->count, most);
    return sst_min_int(n->count, most);
}

static void parse_texts(struct sst_yaml *doc, const struct sst_yaml_node *n, const struct sst_key *key, void *base)
{
    const int count = list_count(doc, n, key);
    const struct sst_yaml_node *c = n->first;
    char *first = (char *)base + key->offset;

    memset(first, 0, key->size);
    for (int i = 0; i < count; i++, c = c->next) {
        if (parse_text(doc, c, key, first + (size_t)i * key->stride, key->stride))
            for (int k = 0; key->count_offset != SST_KEY_NO_COUNT && k < i; k++)
                if (!strcmp(first + (size_t)k * key->stride, c->text))
                    sst_yaml_fault(doc, c, "lists %.60s twice", c->text);
    }
    set_count(key, base, count);
}

/* The controls of all files are combined, like keys. */
static void parse_controls(struct sst_yaml *doc, struct sst_yaml_node *n, struct sst_array_config *a)
{
    if (n->type != SST_YAML_MAP) {
        sst_yaml_fault(doc, n, "must be a mapping of control names (v4l2-ctl --list-ctrls) to numbers");
        return;
    }
    sst_yaml_know_all(n);
    for (struct sst_yaml_node *c = n->first; c; c = c->next) {
        double value;
        int i = 0;

        if (!*c->key || strlen(c->key) >= sizeof(a->control[0].name)) {
            sst_yaml_fault(doc, c, "is not a valid name of a control");
            continue;
        }
        if (!sst_yaml_double(doc, c, -9e15, 9e15, &value))
            continue;
        if (value != floor(value)) {
            sst_yaml_fault(doc, c, "must be a whole number");
            continue;
        }
        while (i < a->controls && strcmp(a->control[i].name, c->key) != 0)
            i++;
        if (i == SST_CONFIG_CONTROLS_MAX) {
            sst_yaml_fault(doc, c, "exceeds the limit of %d controls", SST_CONFIG_CONTROLS_MAX);
            return;
        }
        a->controls = sst_max_int(a->controls, i + 1);
        strcpy(a->control[i].name, c->key);
        a->control[i].value = (int64_t)value;
    }
}

static void parse_value(struct sst_yaml *doc, struct sst_yaml_node *n, const struct sst_key *key, void *base);

static void parse_list(struct sst_yaml *doc, const struct sst_yaml_node *n, const struct sst_key *key, void *base)
{
    const int count = list_count(doc, n, key);
    struct sst_yaml_node *c = n->first;

    memset((char *)base + key->offset, 0, key->size);
    for (int i = 0; i < count; i++, c = c->next) {
        char *element = (char *)base + key->offset + (size_t)i * key->stride;

        if (c->type != SST_YAML_MAP)
            sst_yaml_fault(doc, c, "must be a list of mappings such as - { %s: ... }", key->fields[0].name);
        for (int f = 0; f < key->n_fields; f++) {
            struct sst_yaml_node *value = sst_yaml_get(c, key->fields[f].name);

            sst_key_set_default(&key->fields[f], element);
            if (value)
                parse_value(doc, value, &key->fields[f], element);
            else if (c->type == SST_YAML_MAP && !key->fields[f].standard)
                sst_yaml_fault(doc, c, "lacks the key `%s`; add it", key->fields[f].name);
        }
    }
    set_count(key, base, count);
}

/* Convert the name of a format to its V4L2 code. */
static void parse_format(struct sst_yaml *doc, const struct sst_yaml_node *n, const struct sst_key *key, uint32_t *out)
{
    int index;

    if (sst_yaml_choice(doc, n, key->names, key->n_names, &index))
        *out = sst_array_format(key->names[index]);
}

static void parse_value(struct sst_yaml *doc, struct sst_yaml_node *n, const struct sst_key *key, void *base)
{
    void *p = (char *)base + key->offset;
    char name[SST_CONFIG_TEXT_MAX];

    switch (key->type) {
    case SST_KEY_BOOL:
        (void)sst_yaml_bool(doc, n, p);
        break;
    case SST_KEY_INT:
    case SST_KEY_DOUBLE:
        parse_number(doc, n, key, p);
        break;
    case SST_KEY_TEXT:
        (void)parse_text(doc, n, key, p, key->size);
        break;
    case SST_KEY_CHOICE:
        (void)sst_yaml_choice(doc, n, key->names, key->n_names, p);
        break;
    case SST_KEY_FORMAT:
        parse_format(doc, n, key, p);
        break;
    case SST_KEY_INTS:
    case SST_KEY_DOUBLES:
        parse_numbers(doc, n, key, p);
        break;
    case SST_KEY_TEXTS:
        parse_texts(doc, n, key, base);
        break;
    case SST_KEY_CONTROLS:
        parse_controls(doc, n, &((struct sst_config *)base)->array);
        break;
    case SST_KEY_LIST:
        parse_list(doc, n, key, base);
        break;
    case SST_KEY_LINE: /* resolved after all files are read */
    case SST_KEY_ZONE:
        (void)parse_text(doc, n, key, name, sizeof(name));
        break;
    }
}

static struct sst_yaml_node *find_section(struct sst_yaml *doc, struct sst_yaml_node *root, const char *name)
{
    struct sst_yaml_node *n = *name ? sst_yaml_get(root, name) : root;

    if (!n || n->type == SST_YAML_MAP || nothing(n))
        return n;
    sst_yaml_fault(doc, n, "must contain keys with values, such as \"key: value\"");
    return NULL;
}

/* Keys of earlier versions: a service starts with such keys after an upgrade, with a warning for each. */
static const struct {
    const char *section, *name, *instead;
} retired[] = {
    { "live", "skip_ranges", "all disparities of the range are searched" },
    { "live", "skip_views", "live pictures sum all rays" },
    { "live", "skip_tiles", "live pictures sum all rays" },
    { "live", "skip_error_db", "live pictures sum all rays" },
};

/* Siblings are compared here, since sst_yaml_get() would make a retired key a suggestion for misspelt ones. */
static void warn_retired(struct sst_yaml *doc, struct sst_yaml_node *root)
{
    for (size_t i = 0; i < ARRAY_LEN(retired); i++) {
        struct sst_yaml_node *section = sst_yaml_get(root, retired[i].section);

        for (struct sst_yaml_node *n = section && section->type == SST_YAML_MAP ? section->first : NULL; n;
             n = n->next) {
            if (n->again || strcmp(n->key, retired[i].name) != 0)
                continue;
            n->known = true;
            sst_log_warning("%s:%d:%d: %s: %s has no effect any more: %s; remove it", sst_yaml_name(doc), n->key_line,
                            n->key_column, retired[i].section, n->key, retired[i].instead);
        }
    }
}

void config_parse(struct config_load *load, struct sst_yaml *doc, bool zones_only)
{
    struct sst_yaml_node *root = sst_yaml_empty(doc) ? NULL : sst_yaml_root(doc), *section = NULL;
    const char *name = NULL;
    bool ignored = false;
    int count;
    const struct sst_key *keys = sst_schema(&count);

    if (!zones_only && !load->array_only)
        warn_retired(doc, root);
    for (int i = 0; root && i < count; i++) {
        struct sst_yaml_node *n;

        if (zones_only && strcmp(keys[i].name, "zones") != 0)
            continue;
        if (!name || strcmp(name, keys[i].section) != 0) {
            name = keys[i].section;
            section = find_section(doc, root, name);
            ignored = load->array_only && !sst_key_of_array(&keys[i]);
            if (ignored && *name)
                sst_yaml_know_tree(section);
        }
        n = sst_yaml_get(section, keys[i].name);
        if (n && ignored && !sst_key_places_masks(&keys[i])) {
            sst_yaml_know_tree(n);
        } else if (n) {
            load->at[i] = (struct config_place){ doc, n };
            parse_value(doc, n, &keys[i], load->cfg);
        }
    }
}
