/* sst doctor: checks of all that capturing needs; each finding is one sentence with its remedy. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"
#include "cli/doctor_internal.h"

#include <stdarg.h>
#include <stdio.h>

static const char *const level_names[] = { "OK", "WARNING", "PROBLEM", "NOTE" };

void doctor_add(struct doctor *d, enum doctor_level level, const char *area, const char *fmt, ...)
{
    struct doctor_finding *f;
    va_list args;

    if (d->count == DOCTOR_FINDINGS_MAX)
        return; /* never full: one finding per kind, not per camera */
    f = &d->finding[d->count++];
    f->level = level;
    f->area = area;
    f->key = NULL;
    va_start(args, fmt);
    vsnprintf(f->text, sizeof(f->text), fmt, args);
    va_end(args);
}

static int count(const struct doctor *d, enum doctor_level level)
{
    int n = 0;

    for (int i = 0; i < d->count; i++)
        n += d->finding[i].level == level;
    return n;
}

static int print_json(const struct doctor *d)
{
    json_t *findings = json_array();
    json_t *root = json_pack("{s:i, s:i, s:o}", "problems", count(d, DOCTOR_PROBLEM), "warnings",
                             count(d, DOCTOR_WARNING), "findings", findings);

    for (int i = 0; i < d->count; i++) {
        const struct doctor_finding *f = &d->finding[i];

        json_array_append_new(findings, json_pack("{s:s, s:s, s:o, s:s*}", "level", level_names[f->level], "area", f->area,
                                                  "text", cli_text_json(f->text), "key", f->key));
    }
    return cli_dump_json(root, JSON_INDENT(2));
}

static void print_text(const struct doctor *d)
{
    const int problems = count(d, DOCTOR_PROBLEM), warnings = count(d, DOCTOR_WARNING);

    for (int i = 0; i < d->count; i++)
        printf("%-8s %-10s %s%s%s%s\n", level_names[d->finding[i].level], d->finding[i].area, d->finding[i].text,
               d->finding[i].key ? "  [" : "", d->finding[i].key ? d->finding[i].key : "", d->finding[i].key ? "]" : "");
    printf("\n%d problem%s, %d warning%s\n", problems, problems == 1 ? "" : "s", warnings, warnings == 1 ? "" : "s");
}

/* All that capturing needs. */
static void check_capturing(struct doctor *d)
{
    if (d->cfg->role != SST_CONFIG_HEAD || d->cfg->bound) { /* a head may have no cameras */
        doctor_check_cameras(d);
        doctor_check_genicam(d);
        doctor_check_bandwidth(d);
        doctor_check_trigger(d);
    }
    doctor_check_still(d);
    doctor_check_rig(d);
    doctor_check_disk(d);
    doctor_check_limits(d);
    doctor_check_clock(d);
    doctor_check_hosts(d);
    doctor_check_uvcvideo(d);
    doctor_check_gpu(d);
    doctor_check_live(d);
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    static struct sst_array_config cfg; /* large */
    static struct doctor doctor;
    const char *config = NULL, *folder = NULL;
    bool json = false, law = false;
    const struct cli_option options[] = {
        { "config", 'c', CLI_STRING, &config, "FILE", "configuration (/etc/sst/sstd.yaml if it exists)" },
        { "output", 'o', CLI_STRING, &folder, "DIR", "folder of recordings; its write speed is measured for 1 s" },
        { "law", 0, CLI_FLAG, &law, NULL, "retention, access, encryption and masks, and the age of what is stored" },
        { "json", 0, CLI_FLAG, &json, NULL, "print one JSON object" },
    };
    int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    int err;

    if (r != CLI_GO_ON)
        return r;
    err = sst_array_config_read(&cfg, config);
    if (err)
        return cli_exit_code(err);
    doctor = (struct doctor){ .cfg = &cfg, .config = config, .folder = folder };
    if (law)
        err = doctor_check_law(&doctor);
    else
        check_capturing(&doctor);
    if (err)
        return cli_exit_code(err);
    r = CLI_OK;
    if (json)
        r = print_json(&doctor);
    else
        print_text(&doctor);
    return count(&doctor, DOCTOR_PROBLEM) ? CLI_INPUT : r;
}

const struct cli_command cli_doctor = { "doctor", run };
