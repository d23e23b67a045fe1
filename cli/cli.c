/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/edit_distance.h"
#include "base/file.h"
#include "base/log.h"
#include "base/text.h"

int cli_exit_code(int err)
{
    switch (-err) {
    case 0:
        return CLI_OK;
    case EINVAL:
    case ERANGE:
        return CLI_USAGE;
    case ENOENT:
    case EBADMSG:
    case EDOM: /* a fit not determined by the data */
    case EISDIR:
    case ENOTDIR:
    case EACCES:
    case ENODATA:
    case ENODEV:
    case ENOTUNIQ:
    case EBUSY:
    case EPERM:
    case EHOSTUNREACH:
    case ECONNREFUSED:
    case ENAMETOOLONG:
    case ELOOP:
        return CLI_INPUT;
    case EIO:
    case ENOSPC:
    case EDQUOT:
    case EROFS:
    case EFBIG:
    case EEXIST:
    case EPIPE:
        return CLI_OUTPUT;
    case ENOTSUP:
    case ENOPKG:
        return CLI_MISSING;
    case ENOMEM:
        return CLI_MEMORY;
    case EINTR:
        return CLI_INTERRUPTED;
    default:
        return CLI_INTERNAL;
    }
}

int cli_usage_error(const struct cli_command *cmd, const char *fmt, ...)
{
    char text[768];
    va_list args;

    va_start(args, fmt);
    vsnprintf(text, sizeof(text), fmt, args);
    va_end(args);
    sst_log_error("%s: %s; see `sst %s --help`", cmd->name, text, cmd->name);
    return CLI_USAGE;
}

const struct cli_manual *cli_manual(const struct cli_command *cmd)
{
    const struct cli_manual *m = cli_manuals;

    while (strcmp(m->name, cmd->name) != 0)
        m++;
    return m;
}

static void print_help(const struct cli_command *cmd, const struct cli_option *options, size_t n)
{
    const struct cli_manual *m = cli_manual(cmd);

    printf("sst %s - %s\n\nusage: sst %s %s\n", m->name, m->summary, m->name, m->usage);
    if (m->detail)
        printf("\n%s\n", m->detail);
    printf("\noptions:\n");
    for (size_t i = 0; i < n; i++) {
        char left[64];

        snprintf(left, sizeof(left), "%s%c%s--%s%s%s", options[i].letter ? "-" : "  ",
                 options[i].letter ? options[i].letter : ' ', options[i].letter ? ", " : " ", options[i].name,
                 options[i].meta ? " " : "", options[i].meta ? options[i].meta : "");
        printf("  %-28s %s\n", left, options[i].help);
    }
    printf("  %-28s %s\n  %-28s %s\n  %-28s %s\n", "-v, --verbose", "log more", "-q, --quiet", "log errors only",
           "-h, --help", "show this help");
    printf("\nexample:\n  %s\n", m->example);
}

/* Machine-readable description: see CLI_DESCRIBE. */
static int describe(const struct cli_command *cmd, const struct cli_option *options, size_t n)
{
    static const char *const type[] = { "flag", "int", "number", "text", "size", "grid", "seed", "number or auto",
                                       "text", "text", "text" };
    const struct cli_manual *m = cli_manual(cmd);
    json_t *list = json_array();
    json_t *root = json_pack("{s:s, s:s, s:s, s:s?, s:s, s:o}", "name", m->name, "usage", m->usage, "summary", m->summary,
                             "detail", m->detail, "example", m->example, "options", list);

    for (size_t i = 0; i < n; i++)
        (void)json_array_append_new(list,
                                    json_pack("{s:s, s:s%, s:s, s:s?, s:s, s:s?}", "name", options[i].name, "letter",
                                              &options[i].letter, (size_t)(options[i].letter != 0), "type",
                                              type[options[i].type], "meta", options[i].meta, "help", options[i].help, "words",
                                              options[i].words));
    return cli_dump_json(root, JSON_COMPACT);
}

static bool in_range(const struct cli_option *o, double v)
{
    return (o->min == 0 && o->max == 0) || (v >= o->min && v <= o->max);
}

static int set_pair(const struct cli_command *cmd, const struct cli_option *o, const char *text)
{
    long a, b;
    char *end;

    errno = 0;
    a = strtol(text, &end, 10);
    if (end == text || *end != 'x')
        goto bad;
    text = end + 1;
    b = strtol(text, &end, 10);
    if (end == text || *end || errno)
        goto bad;
    if (!in_range(o, (double)a) || !in_range(o, (double)b))
        return cli_usage_error(cmd, "--%s %ldx%ld is outside %.10g..%.10g on each side", o->name, a, b, o->min, o->max);
    ((int *)o->value)[0] = (int)a;
    ((int *)o->value)[1] = (int)b;
    return CLI_GO_ON;

bad:
    return cli_usage_error(cmd, "--%s expects %s, for example %s", o->name, o->meta,
                           o->type == CLI_SIZE ? "1000x750" : "6x6");
}

/* Find a value among the option's words. Of texts alone one that is nearly a word is refused; the command itself reports
 * other faults of it. */
static int read_word(const struct cli_command *cmd, const struct cli_option *o, const char *text)
{
    char words[256] = "", list[256] = "", *word[33] = { NULL }, *rest = NULL;
    const char *near;
    int n = 0;

    snprintf(words, sizeof(words), "%s", o->words ? o->words : "");
    for (; n < 32 && (word[n] = strtok_r(n ? NULL : words, " ", &rest)); n++) {
        if (o->type == CLI_WORD && !strcasecmp(text, word[n])) {
            *(int *)o->value = (int)o->min + n;
            return CLI_GO_ON;
        }
    }
    near = sst_edit_nearest(text, (const char *const *)word);
    if (near && strcmp(near, text) && strlen(text) > 2) /* `km` is no misspelt `mm` */
        return cli_usage_error(cmd, "unknown --%s `%s`; did you mean `%s`? choose from %s", o->name, text, near, o->words);
    if (o->type != CLI_WORD)
        return CLI_GO_ON;
    for (int i = 0; i < n; i++)
        sst_text_add(list, sizeof(list), "%s%s", !i ? "" : i + 1 == n ? " or " : ", ", word[i]);
    return cli_usage_error(cmd, "unknown --%s `%s`; use %s", o->name, text, list);
}

/* Digits, perhaps with a sign: strtod() alone would also accept 1e3 and 0x10. */
static int set_int(const struct cli_command *cmd, const struct cli_option *o, const char *text)
{
    const char *digits = text + (*text == '-' || *text == '+');
    const bool any = o->min == 0 && o->max == 0;
    const double min = any ? -INT_MAX : o->min, max = any ? INT_MAX : o->max;
    double v;

    if (!*digits || digits[strspn(digits, "0123456789")])
        return cli_usage_error(cmd, "--%s %s is not a whole number in decimal digits", o->name, text);
    v = strtod(text, NULL);
    if (!(v >= min && v <= max))
        return cli_usage_error(cmd, "--%s %s is outside %.0f..%.0f", o->name, text, min, max);
    *(int *)o->value = (int)v;
    return CLI_GO_ON;
}

bool cli_is_one_file(const char *a, const char *b)
{
    struct stat x, y;

    return !stat(a, &x) && !stat(b, &y) && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}

bool cli_read_pair(const char *text, char between, int pair[2])
{
    for (int i = 0; i < 2; i++) {
        const size_t digits = strspn(text, "0123456789");

        if (!digits)
            return false;
        pair[i] = digits > 9 ? INT_MAX : atoi(text);
        text += digits;
        if (!i && *text++ != between)
            return false;
    }
    return !*text;
}

static int set_value(const struct cli_command *cmd, const struct cli_option *o, const char *text)
{
    char *end = NULL;
    double v;

    switch (o->type) {
    case CLI_FLAG:
        *(bool *)o->value = true;
        return CLI_GO_ON;
    case CLI_STRING:
        *(const char **)o->value = text;
        return read_word(cmd, o, text);
    case CLI_WORD:
        return read_word(cmd, o, text);
    case CLI_FILE:
    case CLI_MADE:
        *(const char **)o->value = text;
        return CLI_GO_ON;
    case CLI_SIZE:
    case CLI_GRID:
        return set_pair(cmd, o, text);
    case CLI_SEED:
        errno = 0;
        *(uint64_t *)o->value = strtoull(text, &end, 0);
        if (end == text || *end || errno || *text == '-')
            return cli_usage_error(cmd, "--%s %s is not a whole number of at most 64 bits", o->name, text);
        return CLI_GO_ON;
    case CLI_AUTO:
        if (!strcasecmp(text, "auto")) {
            *(double *)o->value = NAN;
            return CLI_GO_ON;
        }
        break;
    case CLI_INT:
        return set_int(cmd, o, text);
    case CLI_DOUBLE:
        break;
    }
    v = strtod(text, &end);
    if (end == text || *end || isnan(v) || strpbrk(text, "xX"))
        return cli_usage_error(cmd, "--%s %s is not a number", o->name, text);
    if (!in_range(o, v))
        return cli_usage_error(cmd, "--%s %s is outside %.10g..%.10g", o->name, text, o->min, o->max);
    *(double *)o->value = v;
    return CLI_GO_ON;
}

static const struct cli_option *find(const struct cli_option *options, size_t n, const char *name, size_t len,
                                     char letter)
{
    for (size_t i = 0; i < n; i++) {
        if (name ? strlen(options[i].name) == len && !memcmp(options[i].name, name, len) : options[i].letter == letter)
            return &options[i];
    }
    return NULL;
}

static const char *output_of(const struct cli_option *o)
{
    return o->type == CLI_FILE || o->type == CLI_MADE ? *(const char **)o->value : NULL;
}

/* Outputs that are given, before any work is done: none can fail, is an input, or equals another one. */
static int check_outputs(const struct cli_command *cmd, const struct cli_option *options, size_t n,
                         const char *const *inputs, int n_inputs)
{
    for (size_t i = 0; i < n; i++) {
        const char *path = output_of(&options[i]);
        int err = path ? sst_path_check_new(path, options[i].type == CLI_FILE) : 0;

        for (int k = 0; path && !err && k < n_inputs; k++)
            err = sst_path_check_keeps(path, inputs[k]);
        if (err)
            return cli_exit_code(err);
        for (size_t k = 0; path && k < i; k++) {
            if ((options[i].type == CLI_FILE || options[k].type == CLI_FILE) && output_of(&options[k]) &&
                sst_path_is_same(path, output_of(&options[k])))
                return cli_usage_error(cmd, "--%s and --%s are both %s", options[k].name, options[i].name, path);
        }
    }
    return CLI_GO_ON;
}

static int unknown_option(const struct cli_command *cmd, const struct cli_option *options, size_t n, const char *arg)
{
    const char *near = NULL;
    char name[64];
    int least = SST_EDIT_FAR;

    snprintf(name, sizeof(name), "%.*s", (int)strcspn(arg + 1 + (arg[1] == '-'), "="), arg + 1 + (arg[1] == '-'));
    for (size_t i = 0; arg[1] == '-' && i < n; i++) {
        const int distance = sst_edit_distance(name, options[i].name);

        if (distance < least) {
            near = options[i].name;
            least = distance;
        }
    }
    if (!near)
        return cli_usage_error(cmd, "unknown option %s", arg);
    sst_log_error("%s: unknown option %s; did you mean --%s? `sst %s --help` lists them", cmd->name, arg, near,
                  cmd->name);
    return CLI_USAGE;
}

bool cli_is_option(const char *arg)
{
    return arg[0] == '-' && arg[1] && !(arg[1] == '.' || (arg[1] >= '0' && arg[1] <= '9') || !strncmp(arg, "-inf", 4));
}

int cli_parse(const struct cli_command *cmd, const struct cli_option *options, size_t n_options, int argc, char **argv,
              const char **positional, int n_min, int n_max)
{
    bool help = false, verbose = false, quiet = false, only_positional = false;
    const struct cli_option common[] = {
        { .name = "help", .letter = 'h', .value = &help },
        { .name = "verbose", .letter = 'v', .value = &verbose },
        { .name = "quiet", .letter = 'q', .value = &quiet },
    };
    int n = 0;

    if (argc == 2 && !strcmp(argv[1], CLI_DESCRIBE))
        return describe(cmd, options, n_options);
    for (int i = 0; i < n_max; i++)
        positional[i] = NULL;
    for (int i = 1; i < argc; i++) {
        const char *arg = argv[i], *value = NULL;
        const struct cli_option *o;
        int r;

        if (!only_positional && !strcmp(arg, "--")) {
            only_positional = true;
            continue;
        }
        if (only_positional || !cli_is_option(arg)) {
            if (n == n_max)
                return cli_usage_error(cmd, "too many arguments: %s", arg);
            positional[n++] = arg;
            continue;
        }
        if (arg[1] == '-') {
            const char *eq = strchr(arg, '=');
            const size_t len = eq ? (size_t)(eq - arg - 2) : strlen(arg + 2);

            o = find(options, n_options, arg + 2, len, 0);
            if (!o)
                o = find(common, ARRAY_LEN(common), arg + 2, len, 0);
            value = eq ? eq + 1 : NULL;
        } else {
            o = find(options, n_options, NULL, 0, arg[1]);
            if (!o)
                o = find(common, ARRAY_LEN(common), NULL, 0, arg[1]);
            value = arg[2] ? arg + 2 : NULL;
        }
        if (!o)
            return unknown_option(cmd, options, n_options, arg);
        if (o->type == CLI_FLAG ? value != NULL : !value && i + 1 == argc)
            return cli_usage_error(cmd, "--%s %s", o->name, value ? "takes no value" : "needs a value");
        if (o->type != CLI_FLAG && !value)
            value = argv[++i];
        r = set_value(cmd, o, value);
        if (r != CLI_GO_ON)
            return r;
    }
    if (help) {
        print_help(cmd, options, n_options);
        return CLI_OK;
    }
    sst_log_set_level(quiet ? SST_LOG_ERROR : verbose ? SST_LOG_INFO : SST_LOG_WARNING);
    if (n < n_min) {
        const char *usage = cli_manual(cmd)->usage;

        return cli_usage_error(cmd, "an argument is missing: sst %s %.*s%s", cmd->name, (int)strcspn(usage, "\n"), usage,
                               strchr(usage, '\n') ? " ..." : "");
    }
    return check_outputs(cmd, options, n_options, positional, n);
}

json_t *cli_real_json(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

int cli_write_json(const json_t *root, const char *dir, const char *name)
{
    struct sst_outfile out;
    const int err = root ? sst_outfile_open_in(&out, dir, name) : -ENOMEM;

    if (err)
        return err;
    json_dumpf(root, out.stream, JSON_INDENT(2));
    fputc('\n', out.stream);
    return sst_outfile_commit(&out);
}

void cli_print_cell(double v, int width, int digits)
{
    if (isfinite(v))
        printf(" %*.*f", width, digits, v);
    else
        printf(" %*s", width, "-");
}

static int64_t progress_start_ns;
static bool progress_shown;

void cli_progress(void *title, double done)
{
    const int64_t now = sst_clock_now_ns();
    const int width = 30, full = (int)(sst_clamp_double(done, 0, 1) * width);
    double left_s;

    if (!isatty(STDERR_FILENO))
        return;
    if (!progress_start_ns)
        progress_start_ns = now;
    if (now - progress_start_ns < 1000000000 || done <= 0)
        return;
    left_s = (double)(now - progress_start_ns) * 1e-9 * (1 - done) / done;
    fprintf(stderr, "\r%-12s [%.*s%*s] %3.0f %%, %.0f s left \033[K", (const char *)title, full,
            "##############################", width - full, "", done * 100, left_s);
    progress_shown = true;
}

void cli_progress_end(void)
{
    if (progress_shown)
        fprintf(stderr, "\r\033[K");
    progress_shown = false;
    progress_start_ns = 0;
}

int cli_flush(void)
{
    return sst_file_flush_output() ? CLI_OUTPUT : CLI_OK;
}

int cli_dump_json(json_t *root, size_t flags)
{
    char *text = root ? json_dumps(root, flags) : NULL;

    json_decref(root);
    if (!text)
        return CLI_MEMORY;
    (void)puts(text);
    free(text);
    return cli_flush();
}

int cli_print_json(json_t *root)
{
    return cli_dump_json(root, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
}
