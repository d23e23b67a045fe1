/* Prints docs/man/sstd.yaml.5 from the table of keys: `make man`. */
#include <ctype.h>
#include <stdio.h>
#include <string.h>

#include "config/schema.h"

/* Print text in roff; characters that would start a request are escaped. */
static void print(const char *s)
{
    for (; *s; s++) {
        if (*s == '\\')
            fputs("\\e", stdout);
        else if (*s == '"')
            fputs("\\(dq", stdout);
        else if (*s == '-')
            fputs("\\-", stdout);
        else if (*s == '\'')
            fputs("\\(aq", stdout);
        else
            putchar(*s);
    }
}

static const char *unit(const char *name)
{
    static const char *const units[][2] = {
        { "_hz", "Hz" },       { "_ms", "ms" }, { "_us", "us" }, { "_mm_s", "mm/s" },
        { "_mm_s2", "mm/s2" }, { "_mm", "mm" }, { "_um", "um" }, { "_s", "seconds" },
        { "_gb", "GB" },       { "_mb", "MB" }, { "_px", "px" }, { "_days", "days" },
    };
    const size_t n = strlen(name);
    const char *best = NULL;
    size_t longest = 0;

    for (size_t i = 0; i < ARRAY_LEN(units); i++) {
        const size_t m = strlen(units[i][0]);

        if (m < n && m > longest && !strcmp(name + n - m, units[i][0])) {
            best = units[i][1];
            longest = m;
        }
    }
    return best;
}

static void print_type(const struct sst_key *k)
{
    static const char *const texts[] = {
        "text",  "text of a-z, 0-9, - and _", "path", "path of a file", "numeric address",
        "topic", "type of an event or \"*\"",     "points of a polygon"
    };

    switch (k->type) {
    case SST_KEY_BOOL:
        print("true or false");
        break;
    case SST_KEY_INT:
        printf("whole number, %.0f..%.0f", k->min, k->max);
        break;
    case SST_KEY_DOUBLE:
        printf("number, %g..%g", k->min, k->max);
        break;
    case SST_KEY_INTS:
    case SST_KEY_DOUBLES:
        printf("%snumber or list, %g..%g", k->type == SST_KEY_INTS ? "whole " : "", k->min, k->max);
        break;
    case SST_KEY_TEXT:
        print(texts[k->kind]);
        break;
    case SST_KEY_CHOICE:
    case SST_KEY_FORMAT:
        for (int i = 0; i < k->n_names; i++) {
            print(i == 0 ? "" : i + 1 < k->n_names ? ", " : " or ");
            print(k->names[i]);
        }
        break;
    case SST_KEY_TEXTS:
        print("list of texts");
        break;
    case SST_KEY_CONTROLS:
        print("mapping of names to whole numbers");
        break;
    case SST_KEY_LIST:
        print("list of mappings");
        break;
    case SST_KEY_LINE:
        print("name of a trigger line");
        break;
    case SST_KEY_ZONE:
        print("name of a zone");
        break;
    }
    if (k->word) {
        print(", or ");
        print(k->word);
    }
    if (unit(k->name))
        printf("; %s", unit(k->name));
}

static void print_key(const struct sst_key *k, bool field)
{
    static const char *const reload[] = { "applies at once", "restarts capturing", "needs a restart",
                                          "restarts the live picture" };
    char help[512];

    printf(".TP\n.B ");
    print(k->name);
    fputs("\n(", stdout);
    print_type(k);
    if (k->standard) {
        print("; default ");
        print(*k->standard ? k->standard : "\"\"");
    } else {
        print("; must be given");
    }
    if (!field && strcmp(k->section, "rig") != 0 && strcmp(k->section, "still") != 0) {
        print("; ");
        print(reload[k->reload]);
        if (k->switches)
            print("; set for the first time or removed: needs a restart");
    }
    fputs(")\n.br\n", stdout);
    snprintf(help, sizeof(help), "%s.", k->help);
    if (islower((unsigned char)help[0]) && help[strcspn(help, " :")] != ':') /* a value that is explained stays */
        help[0] = (char)toupper((unsigned char)help[0]);
    fputs("\\&", stdout);
    print(help);
    putchar('\n');
    if (!k->n_fields)
        return;
    puts("Keys of each:\n.RS");
    for (int i = 0; i < k->n_fields; i++)
        print_key(&k->fields[i], true);
    puts(".RE");
}

static void print_keys(void)
{
    const char *section = "";
    int count;
    const struct sst_key *keys = sst_schema(&count);

    for (int i = 0; i < count; i++) {
        const char *name = *keys[i].section ? keys[i].section : keys[i].name;

        if (strcmp(section, name) != 0) {
            section = name;
            printf(".SS %s\n", name);
            if (*keys[i].section) {
                print(sst_schema_section_help(name));
                putchar('\n');
            }
        }
        print_key(&keys[i], false);
    }
}

int main(void)
{
    puts(".\\\" Made by make man from config/schema.c.\n"
         ".TH SSTD.YAML 5 \"\" \"sst " SST_VERSION "\" \"File formats\"\n"
         ".SH NAME\nsstd.yaml \\- configuration of sstd and of the commands of sst that talk to devices\n"
         ".SH SYNOPSIS\n.B /etc/sst/sstd.yaml\n.br\n.B /etc/sst/conf.d/*.yaml\n"
         ".SH DESCRIPTION\n"
         "The file is YAML: sections with keys. After it the files of\n.I conf.d\n"
         "beside it whose names end in .yaml are read in the order of their names; a later file replaces values of "
         "earlier\n"
         "ones, key by key, lists as a whole (the\n.B controls\nof all files are combined). A key in no file has its\n"
         "default; an empty or missing file is fine. At last the zones of\n.B web: zones_file\n"
         "are read, if it exists, in place of those of the other files.\n.PP\n"
         "Parsing is strict. Unknown keys, values of a wrong type or out of range and contradictions between keys are\n"
         "all reported, each with file, line and column, and nothing is applied. Numbers and booleans are written\n"
         "without quotes; yes, no, on and off are not booleans, 012 is not a number. Strings that YAML may read as\n"
         "another type (no, null, ~) need quotes. Paths are absolute.\n.PP\n"
         ".B sst reload \\-\\-dry\\-run\nshows the effect of each changed key: it applies at once, restarts the live\n"
         "picture, restarts capturing for a moment, or needs\n.BR \"systemctl restart sstd\" .\n"
         ".B sst reload\napplies all changes or none.\n"
         ".SH KEYS");
    print_keys();
    puts(".SH EVENTS\nHooks may name:");
    for (int i = 1; i < sst_event_types_count; i++) {
        print(sst_event_types[i]);
        puts(i + 1 < sst_event_types_count ? "," : ".");
    }
    puts(".SH EXAMPLE\nA part that watches a gate and records people there:\n.PP\n.nf\n"
         "# /etc/sst/conf.d/50\\-gate.yaml\n"
         "zones:\n"
         "  \\- { name: gate, x0: 0.1, y0: 0.4, x1: 0.5, y1: 0.9 }\n"
         "storage:\n"
         "  mode: event\n"
         "  quota_gb: 200\n"
         "  record_on:\n"
         "    \\- { zone: gate, label: Pedestrian, share: 0.02 }\n"
         ".fi\n"
         ".SH SEE ALSO\n.BR sstd (8),\n.BR sst (1)");
    return fflush(stdout) || ferror(stdout) ? 1 : 0;
}
