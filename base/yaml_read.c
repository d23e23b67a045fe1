/* Typed values from the tree. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "base/yaml.h"

/* True for a non-empty scalar; else notes a fault that names the expected value. */
static bool has_text(struct sst_yaml *doc, const struct sst_yaml_node *node, const char *want)
{
    if (!node)
        return false;
    if (node->type == SST_YAML_SCALAR && *node->text)
        return true;
    sst_yaml_fault(doc, node, "must be %s, not %s", want,
                   node->type == SST_YAML_LIST  ? "a list"
                   : node->type == SST_YAML_MAP ? "a mapping"
                                                : "an empty value");
    return false;
}

/* Some YAML readers parse 012 as twelve, others as ten. */
static bool octal(const char *text)
{
    text += *text == '-' || *text == '+';
    return *text == '0' && isdigit((unsigned char)text[1]);
}

/* Only digits, signs, a point and an exponent: strtod alone would also accept "nan", "inf" and "0x1p3". */
static bool number(const struct sst_yaml_node *node, double *out)
{
    char *end;

    if (!node->plain || octal(node->text) || strspn(node->text, "0123456789+-.eE") != strlen(node->text))
        return false;
    *out = strtod(node->text, &end);
    return end != node->text && !*end && isfinite(*out);
}

bool sst_yaml_double(struct sst_yaml *doc, const struct sst_yaml_node *node, double min, double max, double *out)
{
    char want[80];
    double v;

    snprintf(want, sizeof(want), "a number in %.10g..%.10g", min, max);
    if (!has_text(doc, node, want))
        return false;
    if (!number(node, &v) || !(v >= min && v <= max)) {
        sst_yaml_fault(doc, node, "must be %s, not %s%.60s%s", want, node->plain ? "" : "\"", node->text,
                       node->plain ? "" : "\"");
        return false;
    }
    *out = v;
    return true;
}

bool sst_yaml_int(struct sst_yaml *doc, const struct sst_yaml_node *node, int min, int max, int *out)
{
    char want[80], *end;
    long v;

    snprintf(want, sizeof(want), "a whole number in %d..%d", min, max);
    if (!has_text(doc, node, want))
        return false;
    errno = 0;
    v = strtol(node->text, &end, 10);
    if (!node->plain || octal(node->text) || isspace((unsigned char)*node->text) || *end || errno || v < min ||
        v > max) {
        sst_yaml_fault(doc, node, "must be %s, not %s%.60s%s", want, node->plain ? "" : "\"", node->text,
                       node->plain ? "" : "\"");
        return false;
    }
    *out = (int)v;
    return true;
}

bool sst_yaml_bool(struct sst_yaml *doc, const struct sst_yaml_node *node, bool *out)
{
    static const char *const names[] = { "false", "true" };
    int v;

    if (node && !node->plain && node->type == SST_YAML_SCALAR) {
        sst_yaml_fault(doc, node, "must be true or false without quotes");
        return false;
    }
    if (!sst_yaml_choice(doc, node, names, 2, &v))
        return false;
    *out = v;
    return true;
}

bool sst_yaml_string(struct sst_yaml *doc, const struct sst_yaml_node *node, char *out, size_t size)
{
    if (!has_text(doc, node, "a string"))
        return false;
    if (strlen(node->text) >= size) {
        sst_yaml_fault(doc, node, "is longer than %zu bytes: %.60s; shorten it", size - 1, node->text);
        return false;
    }
    strcpy(out, node->text);
    return true;
}

bool sst_yaml_choice(struct sst_yaml *doc, const struct sst_yaml_node *node, const char *const *names, int n, int *out)
{
    char want[160] = "";

    for (int i = 0; i < n; i++)
        sst_text_add(want, sizeof(want), "%s%s", i == 0 ? "" : i + 1 < n ? ", " : " or ", names[i]);
    if (!has_text(doc, node, want))
        return false;
    for (int i = 0; i < n; i++) {
        if (!strcmp(node->text, names[i])) {
            *out = i;
            return true;
        }
    }
    sst_yaml_fault(doc, node, "must be %s, not %.60s", want, node->text);
    return false;
}

bool sst_yaml_doubles(struct sst_yaml *doc, const struct sst_yaml_node *node, double min, double max, double *out,
                      int n)
{
    const struct sst_yaml_node *child = node ? node->first : NULL;
    double v;
    bool ok = true;

    if (!node)
        return false;
    if (node->type == SST_YAML_SCALAR) {
        if (!sst_yaml_double(doc, node, min, max, &v))
            return false;
        for (int i = 0; i < n; i++)
            out[i] = v;
        return true;
    }
    if (node->type != SST_YAML_LIST || node->count != n) {
        sst_yaml_fault(doc, node, "must be a list of %d numbers in %.10g..%.10g, or one for all", n, min, max);
        return false;
    }
    for (int pass = 0; ok && pass < 2; pass++) { /* the first one only checks */
        child = node->first;
        for (int i = 0; i < n; i++, child = child->next) {
            if (!sst_yaml_double(doc, child, min, max, &v))
                ok = false;
            else if (pass)
                out[i] = v;
        }
    }
    return ok;
}
