/* Registry of faults: names and values. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/devices_internal.h"
#include "simulators/devices/sysfs_internal.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SCOPES 16

struct scope {
    struct sim_fault_scope scope;
    double *values; /* [instances or 1][count] */
};

struct sim_faults {
    struct scope scopes[SCOPES];
    int count;
};

int sim_faults_create(struct sim_faults **out)
{
    struct sim_faults *f = calloc(1, sizeof(*f));

    if (!f)
        return -ENOMEM;
    *out = f;
    return 0;
}

void sim_faults_destroy(struct sim_faults *f)
{
    if (!f)
        return;
    for (int i = 0; i < f->count; i++)
        free(f->scopes[i].values);
    free(f);
}

int sim_faults_add(struct sim_faults *f, const struct sim_fault_scope *scope)
{
    struct scope *s = &f->scopes[f->count];

    if (f->count == SCOPES)
        return -ENOMEM;
    s->scope = *scope;
    s->values = calloc((size_t)(sst_max_int(scope->instances, 1) * scope->count), sizeof(double));
    return s->values ? f->count++ : -ENOMEM;
}

static double *value_at(const struct sim_faults *f, int scope, int instance, int fault)
{
    const struct scope *s = &f->scopes[scope];

    return &s->values[instance * s->scope.count + fault];
}

double sim_fault_value(const struct sim_faults *f, int scope, int instance, int fault)
{
    return *value_at(f, scope, instance, fault);
}

void sim_fault_reset(struct sim_faults *f, int scope, int instance, int fault)
{
    *value_at(f, scope, instance, fault) = 0;
}

SST_PRINTF(4, 5) static int refuse(int err, char *message, size_t size, const char *fmt, ...)
{
    va_list args;

    va_start(args, fmt);
    (void)vsnprintf(message, size, fmt, args);
    va_end(args);
    return err;
}

/* Parse the instances of "3." or "*.": *first .. *last. @return the rest of the name */
static const char *read_instance(const struct sim_fault_scope *scope, const char *name, int *first, int *last)
{
    char *end;
    long n;

    *first = *last = 0;
    if (!scope->instances)
        return name;
    if (name[0] == '*' && name[1] == '.') {
        *last = scope->instances - 1;
        return name + 2;
    }
    n = strtol(name, &end, 10);
    if (name[0] < '0' || name[0] > '9' || *end != '.' || n >= scope->instances)
        return NULL;
    *first = *last = (int)n;
    return end + 1;
}

static int find_fault(const struct sim_fault_scope *scope, const char *name, size_t bytes)
{
    for (int i = 0; i < scope->count; i++)
        if (strlen(scope->faults[i].name) == bytes && memcmp(scope->faults[i].name, name, bytes) == 0)
            return i;
    return -1;
}

int sim_faults_set(struct sim_faults *f, const char *text, char *message, size_t size)
{
    const char *equals = strchr(text, '=');
    char *end = NULL;
    const double value = equals ? strtod(equals + 1, &end) : 0;

    if (!equals || end == equals + 1 || *end || !isfinite(value))
        return refuse(-EINVAL, message, size, "fault '%s': write NAME=NUMBER", text);
    for (int i = 0; i < f->count; i++) {
        const struct sim_fault_scope *scope = &f->scopes[i].scope;
        const size_t head = strlen(scope->name);
        const char *name = text + head + 1;
        int first, last, k;

        if (strncmp(text, scope->name, head) != 0 || text[head] != '.')
            continue;
        name = read_instance(scope, name, &first, &last);
        if (!name)
            return refuse(-EINVAL, message, size, "fault '%s': write %s.N.NAME=NUMBER with N from 0 to %d, or *", text,
                          scope->name, scope->instances - 1);
        k = find_fault(scope, name, (size_t)(equals > name ? equals - name : 0));
        if (k < 0)
            break;
        if (value < scope->faults[k].min || value > scope->faults[k].max)
            return refuse(-ERANGE, message, size, "fault '%s': the value must lie in %.10g to %.10g", text,
                          scope->faults[k].min, scope->faults[k].max);
        for (int n = first; n <= last; n++) {
            const double old = *value_at(f, i, n, k);
            int err;

            *value_at(f, i, n, k) = value;
            err = scope->changed ? scope->changed(scope->arg, n, k, value) : 0;
            if (err) {
                *value_at(f, i, n, k) = old;
                return refuse(err, message, size, "fault '%s': %s", text, strerror(-err));
            }
        }
        return 0;
    }
    return refuse(-EINVAL, message, size, "unknown fault `%s`; `sst-sim fault --list` shows all", text);
}

void sim_faults_each(const struct sim_faults *f, void (*fn)(void *arg, const char *name, double value), void *arg)
{
    for (int i = 0; i < f->count; i++) {
        const struct sim_fault_scope *s = &f->scopes[i].scope;

        for (int n = 0; n < sst_max_int(s->instances, 1); n++)
            for (int k = 0; k < s->count; k++) {
                const double value = *value_at(f, i, n, k);
                char name[128];

                if (value == 0)
                    continue;
                if (s->instances)
                    (void)snprintf(name, sizeof(name), "%s.%d.%s", s->name, n, s->faults[k].name);
                else
                    (void)snprintf(name, sizeof(name), "%s.%s", s->name, s->faults[k].name);
                fn(arg, name, value);
            }
    }
}

static void print_value(void *arg, const char *name, double value)
{
    fprintf(arg, "%s=%g\n", name, value);
}

void sim_fault_scope_print(FILE *out, const struct sim_fault_scope *s)
{
    for (int k = 0; k < s->count; k++) {
        char name[96];

        (void)snprintf(name, sizeof(name), "%s.%s%s", s->name, s->instances ? "N." : "", s->faults[k].name);
        fprintf(out, "%-26s %.10g..%.10g  %s\n", name, s->faults[k].min, s->faults[k].max, s->faults[k].help);
    }
}

size_t sim_faults_list(const struct sim_faults *f, char *out, size_t size)
{
    FILE *text = fmemopen(out, size, "w");
    long before;

    out[0] = 0;
    if (!text)
        return 0;
    for (int i = 0; i < f->count; i++)
        sim_fault_scope_print(text, &f->scopes[i].scope);
    fprintf(text, "currently set:\n");
    before = ftell(text);
    sim_faults_each(f, print_value, text);
    if (ftell(text) == before)
        fprintf(text, "none\n");
    (void)fclose(text);
    return strlen(out);
}
