#include "cli/cli_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "capture/recording/lightfields.h"

/* Numbers and ranges, each set once, in the order of recording. */
static int choose_listed(const char *text, bool *chosen, int n)
{
    for (const char *p = text;; p++) {
        char *end;
        long from, to;

        errno = 0;
        from = to = strtol(p, &end, 10);
        if (end == p || *p == '-' || *p == '+' || *p == ' ')
            return -EINVAL;
        if (*end == '-') {
            p = end + 1;
            to = strtol(p, &end, 10);
            if (end == p || *p == '-' || *p == '+' || *p == ' ')
                return -EINVAL;
        }
        if (errno || from > to || (*end && *end != ','))
            return -EINVAL;
        if (to >= n)
            return -ERANGE;
        for (long i = from; i <= to; i++)
            chosen[i] = true;
        if (!*end)
            return 0;
        p = end;
    }
}

static int choose(const struct cli_command *cmd, const struct import_recording *args, int n, int *sets, int *count)
{
    bool *chosen = calloc((size_t)n, sizeof(*chosen));
    int err = chosen ? 0 : -ENOMEM;

    if (!err && args->sets && !strcmp(args->sets, "all"))
        memset(chosen, 1, (size_t)n * sizeof(*chosen));
    else if (!err && (!args->sets || !strcmp(args->sets, "first")))
        chosen[0] = true;
    else if (!err && !strcmp(args->sets, "last"))
        chosen[n - 1] = true;
    else if (!err)
        err = choose_listed(args->sets, chosen, n);
    *count = 0;
    for (int i = 0; !err && i < n; i++) {
        if (chosen[i])
            sets[(*count)++] = i;
    }
    free(chosen);
    if (err == -ERANGE)
        return cli_usage_error(cmd, "--sets %s: %s has sets 0 to %d", args->sets, args->import->source, n - 1);
    if (err == -EINVAL)
        return cli_usage_error(cmd, "--sets %s is not a list such as 0,5-9, nor all, first or last", args->sets);
    return err ? cli_exit_code(err) : CLI_GO_ON;
}

static int make(const struct cli_command *cmd, const struct import_recording *args,
                const struct sst_recording *recording)
{
    const int n = sst_recording_sets(recording);
    struct sst_lightfields_config cfg = {
        .out = args->import->out,
        .allow_partial = args->allow_partial,
        .force = args->import->force,
        .range_min_px = args->import->range_min_px,
        .range_max_px = args->import->range_max_px,
        .threads = args->import->threads,
        .calibration = args->import->calibration,
        .progress = cli_progress,
        .progress_arg = (void *)(uintptr_t) "import",
    };
    int *sets, err, r;

    if (!n) {
        sst_log_error("%s holds no set; record some first", args->import->source);
        return CLI_INPUT;
    }
    if (!args->sets && n > 1)
        return cli_usage_error(cmd, "%s has %d sets; choose with --sets first, 0,5-9 or all", args->import->source, n);
    sets = malloc((size_t)n * sizeof(*sets));
    if (!sets)
        return CLI_MEMORY;
    r = choose(cmd, args, n, sets, &cfg.count);
    if (r != CLI_GO_ON) {
        free(sets);
        return r;
    }
    cfg.sets = sets;
    cfg.each = cfg.count > 1 || (args->sets && !strcmp(args->sets, "all"));
    err = sst_recording_to_lightfields(recording, &cfg);
    cli_progress_end();
    if (!err && cfg.each)
        printf("%s: %d light fields, %s/set-%06d to %s/set-%06d\n", args->import->out, cfg.count, args->import->out,
               sets[0], args->import->out, sets[cfg.count - 1]);
    free(sets);
    if (!err && !cfg.each)
        err = cli_print_lightfield(args->import->out, args->import->out);
    return cli_exit_code(err);
}

int cli_run_import_recording(const struct cli_command *cmd, const struct import_recording *args)
{
    struct sst_recording *recording;
    const int err = args->count > 1 ? sst_recording_open_joined(&recording, args->dirs, args->count)
                                    : sst_recording_open(&recording, args->import->source);
    int code;

    if (err)
        return cli_exit_code(err);
    code = make(cmd, args, recording);
    sst_recording_close(recording);
    return code;
}
