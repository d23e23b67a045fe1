/* cli/shard_internal.h - pieces of work that processes share, and the campaigns made of them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CLI_SHARD_INTERNAL_H
#define SST_CLI_SHARD_INTERNAL_H

#include "base/file.h"
#include "cli/cli_internal.h"

/* --- shard: pieces of work that several processes share (docs/use/cluster.md). --- */

/** The options. */
struct cli_shard {
    const char *text; /* "I/N" or "auto"; NULL: nothing is shared */
    int index, count; /* out of cli_shard_read(): this process of how many, from 0 on */
    double lease_s;
    bool status, retry;
};

#define CLI_SHARD_DEFAULTS                                                                                             \
    {                                                                                                                  \
        .lease_s = 60                                                                                                  \
    }

/* Rows of an option table for a struct cli_shard s. */
#define CLI_SHARD_OPTIONS(s)                                                                                            \
    {                                                                                                                   \
        "shard",   0,     CLI_STRING,                                                                                   \
        &(s).text, "I/N", "share the work with other processes, as worker I of N; auto: as Slurm or mpirun numbers it"  \
    },                                                                                                                  \
        { "lease",      0,    CLI_DOUBLE,                                                                               \
          &(s).lease_s, "S",  "seconds after which a worker without a sign of life has ended (60)",                     \
          0.2,          86400 },                                                                                        \
        { "status", 0, CLI_FLAG, &(s).status, NULL, "show what is done, running, failed and waiting, and do nothing" }, \
    {                                                                                                                   \
        "retry", 0, CLI_FLAG, &(s).retry, NULL, "try failed pieces again"                                               \
    }

/** Names of the sharing options, for cli_shard_job(). */
#define CLI_SHARD_NAMES "shard", "lease", "status", "retry"

struct cli_pieces {
    int count;
    char *const *name;  /* as shown */
    char *const *state; /* folders of their claims (base/claim.h) */
    const char *job;    /* the work on each, as text; work done by another text is done again */
    /* Do piece i. @param again  a worker ended during it: its remains are to be removed  @return exit code */
    int (*run)(void *arg, int i, bool again);
    void *arg;
};

/** Read --shard. @return CLI_GO_ON or CLI_USAGE */
int cli_shard_read(const struct cli_command *cmd, struct cli_shard *s);

/**
 * Do the pieces that no other process does, this worker's share first, until every piece has ended, wherever.
 * @return CLI_OK if all are done; else the code of the first that failed here, or CLI_INPUT
 */
int cli_shard_run(const struct cli_shard *s, const struct cli_pieces *p);

/** Print the pieces done, running, failed and waiting. @return exit code */
int cli_shard_status(const struct cli_pieces *p, bool json);

/** A job's text: the version and all options but the named ones (ends in NULL), which do not change the result. */
void cli_shard_job(char *text, size_t size, const struct cli_command *cmd, const struct cli_option *options, size_t n,
                   const char *const *without);

/* --- batch: the pieces of a campaign, and its table. --- */

#define CLI_BATCH_LIGHTFIELD "lightfield"  /* of a piece's folder: the copy */
#define CLI_BATCH_REPORT     "process.json" /* of it as well */
#define CLI_BATCH_FIGURES    "figures.json" /* of a piece's folder without reports: its line of: */
#define CLI_BATCH_TABLE      "figures.csv" /* of the output folder */
#if WITH_AVFORMAT
#define CLI_BATCH_SWEEP "sweep.mp4"
#else
#define CLI_BATCH_SWEEP "sweep"
#endif

struct cli_batch_memory; /* batch_memory.c: open from piece to piece */

/** Work on each piece. */
struct cli_batch {
    const char *out, *preset, *model, *calib, *device;
    enum { BATCH_ALL = 0, BATCH_RECORDINGS = 1, BATCH_LIGHTFIELDS = 2 } from;
    int steps, every, threads, device_memory;
    bool no_labels, reads_only;
    struct cli_batch_written {
        bool clear, see_through, sweep, lightfield, reports;
    } write;
    struct cli_batch_memory *memory; /* NULL: not open yet */
    char states[SST_PATH_MAX], logs[SST_PATH_MAX];
};

struct cli_batch_piece {
    char *source; /* light field, or recording of which: */
    int set;      /* -1: a light field */
};

struct cli_batch_place {
    const char *name, *dir, *log; /* of a piece: name, folder that gets its results, log */
};

/** Make OUT/NAME, whole or not at all, with its log in logs/NAME.log. @param again  remove the remains of a killed
 * worker
 *  @return exit code */
int cli_batch_run_piece(struct cli_batch *b, const struct cli_batch_piece *piece, const char *name, bool again);

/** Fill the folder of a piece without a light field in it, in this process: the same pictures.
 *  @return exit code, its error logged */
int cli_batch_run_in_memory(struct cli_batch *b, const struct cli_batch_piece *piece,
                            const struct cli_batch_place *place);
void cli_batch_memory_close(struct cli_batch_memory *m); /* NULL is fine */

/** Replace the reports in a piece's folder by the figures alone. @return 0 or an error, logged */
SST_MUST_CHECK int cli_batch_keep_figures(const char *dir);

/** Write OUT/figures.csv from the commands' reports on finished pieces, or their figures. @return 0 or an error,
 * logged */
SST_MUST_CHECK int cli_batch_write_table(const char *out, char *const *name, int count);

#endif
