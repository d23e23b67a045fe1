/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/rig/rig_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"
#include "base/yaml.h"

#define PROFILE_MAX_BYTES ((size_t)256 << 10)

static const char *const table_names[] = { "holding", "input", "coil", "discrete" };
static const char *const type_names[] = { "u16", "s16", "u32", "s32", "bit" };
static const char *const flag_names[SST_RIG_FLAGS] = { "moving",  "in_position", "homed",      "alarm",
                                                       "enabled", "limit_low",   "limit_high", "acknowledge" };
static const char *const sequence_names[SST_RIG_SEQUENCES] = { "enable", "setup", "move", "home", "stop", "reset" };
static const char *const value_names[] = { "", "target", "speed", "acceleration" };

struct reader {
    struct rig_profile *p;
    struct sst_yaml *doc;
};

/* Addresses and bit patterns are hexadecimal in every manual; the YAML reader's numbers are decimal. */
static bool read_code(struct reader *r, const struct sst_yaml_node *node, long min, long max, long *out)
{
    char *end;
    long v;

    if (!node)
        return false;
    errno = 0;
    v = node->type == SST_YAML_SCALAR ? strtol(node->text, &end, strncmp(node->text, "0x", 2) ? 10 : 16) : 0;
    if (node->type != SST_YAML_SCALAR || end == node->text || *end || errno || v < min || v > max) {
        sst_yaml_fault(r->doc, node, "must be a whole number in %ld..%ld, 0x... or decimal", min, max);
        return false;
    }
    *out = v;
    return true;
}

static bool read_code_int(struct reader *r, const struct sst_yaml_node *node, long min, long max, int *out)
{
    long v;

    if (!read_code(r, node, min, max, &v))
        return false;
    *out = (int)v;
    return true;
}

static int find_register(const struct rig_profile *p, const char *name)
{
    for (int i = 0; i < p->registers; i++) {
        if (!strcmp(p->reg[i].name, name))
            return i;
    }
    return -1;
}

static void read_register_name(struct reader *r, const struct sst_yaml_node *node, int *out)
{
    char name[SST_RIG_WORD_MAX];
    int i;

    if (!sst_yaml_string(r->doc, node, name, sizeof(name)))
        return;
    i = find_register(r->p, name);
    if (i < 0)
        sst_yaml_unknown(r->doc, node, "register", "list it under registers");
    else
        *out = i;
}

static void read_register(struct reader *r, struct sst_yaml_node *node)
{
    struct rig_register *reg = &r->p->reg[r->p->registers];
    int table = 0, type = 0;
    bool bits;

    *reg = (struct rig_register){ .scale = 1, .read_back = true };
    if (r->p->registers == SST_RIG_REGISTERS_MAX || strlen(node->key) >= sizeof(reg->name)) {
        sst_yaml_fault(r->doc, node, "exceeds the limit of %d entries, or its name is longer than %d bytes",
                       SST_RIG_REGISTERS_MAX, SST_RIG_WORD_MAX - 1);
        return;
    }
    strcpy(reg->name, node->key);
    sst_yaml_choice(r->doc, sst_yaml_need(r->doc, node, "table"), table_names, ARRAY_LEN(table_names), &table);
    sst_yaml_choice(r->doc, sst_yaml_need(r->doc, node, "type"), type_names, ARRAY_LEN(type_names), &type);
    read_code_int(r, sst_yaml_need(r->doc, node, "address"), 0, 0xFFFF, &reg->address);
    sst_yaml_bool(r->doc, sst_yaml_get(node, "low_first"), &reg->low_first);
    sst_yaml_bool(r->doc, sst_yaml_get(node, "read_back"), &reg->read_back);
    sst_yaml_double(r->doc, sst_yaml_get(node, "scale"), 1e-6, 1e6, &reg->scale);
    reg->table = (enum rig_table)table;
    reg->type = (enum rig_type)type;
    bits = reg->table == SST_RIG_COIL || reg->table == SST_RIG_DISCRETE;
    if (bits != (reg->type == SST_RIG_BIT))
        sst_yaml_fault(r->doc, node, "must have the type bit if, and only if, it is a coil or discrete input");
    r->p->registers++;
}

static void read_flag(struct reader *r, struct sst_yaml_node *node, enum rig_flag flag)
{
    struct rig_bit *b = &r->p->bit[flag];
    int bit = -1, mask = 0, equals = 0;

    *b = (struct rig_bit){ .reg = -1 };
    if (!node)
        return;
    read_register_name(r, sst_yaml_need(r->doc, node, "register"), &b->reg);
    sst_yaml_bool(r->doc, sst_yaml_get(node, "inverted"), &b->inverted);
    if (b->reg >= 0 && r->p->reg[b->reg].type == SST_RIG_BIT) {
        b->mask = b->equals = 1;
        return;
    }
    if (sst_yaml_int(r->doc, sst_yaml_get(node, "bit"), 0, 31, &bit)) {
        b->mask = b->equals = 1u << bit;
    } else if (read_code_int(r, sst_yaml_get(node, "mask"), 1, INT32_MAX, &mask) &&
               read_code_int(r, sst_yaml_need(r->doc, node, "equals"), 0, INT32_MAX, &equals)) {
        b->mask = (unsigned)mask;
        b->equals = (unsigned)equals;
    } else {
        sst_yaml_fault(r->doc, node, "must have bit, or mask and equals");
    }
}

static void read_write_step(struct reader *r, struct sst_yaml_node *node, struct rig_step *s)
{
    struct sst_yaml_node *value = sst_yaml_need(r->doc, node, "value"), *shown = sst_yaml_get(node, "shown_by");
    int flag = SST_RIG_FLAGS;
    long number;

    s->what = SST_RIG_WRITE;
    read_register_name(r, sst_yaml_get(node, "write"), &s->reg);
    if (r->p->registers && (r->p->reg[s->reg].table == SST_RIG_INPUT || r->p->reg[s->reg].table == SST_RIG_DISCRETE))
        sst_yaml_fault(r->doc, node, "writes an input; only holding registers and coils can be written");
    for (int i = 1; value && i < (int)ARRAY_LEN(value_names); i++) {
        if (value->type == SST_YAML_SCALAR && !strcmp(value->text, value_names[i]))
            s->value = (enum rig_value)i;
    }
    if (value && s->value == SST_RIG_NUMBER && read_code(r, value, INT32_MIN, UINT32_MAX, &number))
        s->number = (double)number;
    sst_yaml_choice(r->doc, shown, flag_names, SST_RIG_FLAGS, &flag);
    s->flag = (enum rig_flag)flag;
}

static void read_step(struct reader *r, struct sst_yaml_node *node, struct rig_step *s)
{
    struct sst_yaml_node *wait = sst_yaml_get(node, "wait"), *pause = sst_yaml_get(node, "pause_ms");
    int flag = 0;

    *s = (struct rig_step){ .flag = SST_RIG_FLAGS };
    if (sst_yaml_get(node, "write")) {
        read_write_step(r, node, s);
    } else if (wait) {
        s->what = SST_RIG_WAIT;
        if (sst_yaml_choice(r->doc, wait, flag_names, SST_RIG_FLAGS, &flag) && r->p->bit[flag].reg < 0)
            sst_yaml_fault(r->doc, wait, "waits for a flag that is not listed under flags");
        s->flag = (enum rig_flag)flag;
        sst_yaml_bool(r->doc, sst_yaml_need(r->doc, node, "is"), &s->is);
        sst_yaml_int(r->doc, sst_yaml_need(r->doc, node, "within_ms"), 1, 60000, &s->ms);
    } else if (pause) {
        s->what = SST_RIG_PAUSE;
        sst_yaml_int(r->doc, pause, 1, 10000, &s->ms);
    } else {
        sst_yaml_fault(r->doc, node, "must be a step: write, wait or pause_ms");
    }
}

static void read_sequence(struct reader *r, struct sst_yaml_node *list, enum rig_sequence which)
{
    if (!list)
        return;
    if (list->type != SST_YAML_LIST || list->count > SST_RIG_STEPS_MAX) {
        sst_yaml_fault(r->doc, list, "must be a list of at most %d steps", SST_RIG_STEPS_MAX);
        return;
    }
    for (struct sst_yaml_node *n = list->first; n; n = n->next) {
        if (n->type == SST_YAML_MAP)
            read_step(r, n, &r->p->step[which][r->p->steps[which]++]);
        else
            sst_yaml_fault(r->doc, n, "must be a step, for example { write: control, value: 0x0001 }");
    }
}

static void read_alarms(struct reader *r, struct sst_yaml_node *map)
{
    if (!map)
        return;
    sst_yaml_know_all(map);
    for (struct sst_yaml_node *n = map->first; n; n = n->next) {
        char *end;
        const long code = n->key ? strtol(n->key, &end, 0) : 0;

        if (!n->key || end == n->key || *end || r->p->alarms == SST_RIG_ALARMS_MAX) {
            sst_yaml_fault(r->doc, n, "must be one of at most %d alarm codes, 0x... or decimal", SST_RIG_ALARMS_MAX);
            return;
        }
        r->p->alarm[r->p->alarms].code = code;
        if (sst_yaml_string(r->doc, n, r->p->alarm[r->p->alarms].text, sizeof(r->p->alarm[0].text)))
            r->p->alarms++;
    }
}

static void read_all(struct reader *r)
{
    struct rig_profile *p = r->p;
    struct sst_yaml_node *root = sst_yaml_root(r->doc), *n, *map;

    sst_yaml_string(r->doc, sst_yaml_need(r->doc, root, "name"), p->name, sizeof(p->name));
    sst_yaml_string(r->doc, sst_yaml_need(r->doc, root, "manual"), p->manual, sizeof(p->manual));
    sst_yaml_bool(r->doc, sst_yaml_need(r->doc, root, "tried_on_hardware"), &p->tried);
    sst_yaml_int(r->doc, sst_yaml_get(root, "gap_ms"), 0, 1000, &p->gap_ms);
    map = sst_yaml_need(r->doc, root, "registers");
    if (map)
        sst_yaml_know_all(map);
    for (n = map ? map->first : NULL; n; n = n->next) {
        if (n->type == SST_YAML_MAP && n->key)
            read_register(r, n);
        else
            sst_yaml_fault(r->doc, n, "must be a mapping with table, address and type");
    }
    p->identity = p->alarm_code = -1;
    n = sst_yaml_get(root, "identity");
    if (n) {
        read_register_name(r, sst_yaml_need(r->doc, n, "register"), &p->identity);
        read_code(r, sst_yaml_need(r->doc, n, "value"), 0, UINT32_MAX, &p->identity_value);
    }
    read_register_name(r, sst_yaml_need(r->doc, root, "position"), &p->position);
    read_register_name(r, sst_yaml_get(root, "alarm_code"), &p->alarm_code);
    map = sst_yaml_need(r->doc, root, "flags");
    for (int i = 0; i < SST_RIG_FLAGS; i++)
        read_flag(r, i < SST_RIG_ENABLED ? sst_yaml_need(r->doc, map, flag_names[i]) : sst_yaml_get(map, flag_names[i]),
                  (enum rig_flag)i);
    map = sst_yaml_need(r->doc, root, "sequences");
    for (int i = 0; i < SST_RIG_SEQUENCES; i++)
        read_sequence(r,
                      i > SST_RIG_SEQ_SETUP ? sst_yaml_need(r->doc, map, sequence_names[i])
                                            : sst_yaml_get(map, sequence_names[i]),
                      (enum rig_sequence)i);
    read_alarms(r, sst_yaml_get(root, "alarms"));
}

/* --- finding the file --------------------------------------------------------------------------------------------- */

static bool try_folder(char out[SST_PATH_MAX], const char *folder, const char *name)
{
    return folder && *folder && snprintf(out, SST_PATH_MAX, "%s/%s.yaml", folder, name) < SST_PATH_MAX &&
           sst_path_exists(out);
}

static bool try_beside_program(char out[SST_PATH_MAX], const char *below, const char *name)
{
    char folder[SST_PATH_MAX];

    return !sst_path_beside_program(folder, below) && try_folder(out, folder, name);
}

static int find_profile(char out[SST_PATH_MAX], const char *name)
{
    if (strchr(name, '/') || sst_text_ends(name, ".yaml"))
        return sst_path_join(out, name, NULL);
    if (try_folder(out, getenv("SST_PROFILES"), name) || try_beside_program(out, "../config/profiles", name) ||
        try_beside_program(out, "../share/sst/profiles", name) || try_folder(out, SST_DATADIR "/profiles", name))
        return 0;
    sst_log_error(
        "there is no drive profile %s in $SST_PROFILES, ../config/profiles or ../share/sst/profiles beside the "
        "program, or " SST_DATADIR "/profiles; name one of them, or the path of a .yaml file",
        name);
    return -ENOENT;
}

int rig_profile_read(struct rig_profile *out, const char *name)
{
    struct rig_profile *p = calloc(1, sizeof(*p));
    struct reader r = { .p = p };
    uint8_t *text = NULL;
    size_t size;
    int err;

    if (!p)
        return -ENOMEM;
    err = find_profile(p->path, name);
    err = err ? err : sst_file_read_text(p->path, PROFILE_MAX_BYTES, &text, &size);
    err = err ? err : sst_yaml_parse(&r.doc, (const char *)text, size, p->path);
    if (!err) {
        read_all(&r);
        err = sst_yaml_finish(r.doc);
        sst_yaml_destroy(r.doc);
    }
    if (!err)
        *out = *p;
    free(text);
    free(p);
    return err;
}

void rig_profile_alarm(const struct rig_profile *profile, long code, char *text, size_t size)
{
    for (int i = 0; i < profile->alarms; i++) {
        if (profile->alarm[i].code == code) {
            snprintf(text, size, "0x%02lX (%s)", (unsigned long)code, profile->alarm[i].text);
            return;
        }
    }
    snprintf(text, size, "0x%02lX (%s)", (unsigned long)code, "see the drive's manual");
}
