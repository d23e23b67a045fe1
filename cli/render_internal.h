/* cli/render_internal.h - options, input and output of rendered pictures, shared by the commands that render. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CLI_RENDER_INTERNAL_H
#define SST_CLI_RENDER_INTERNAL_H

#include "cli/cli_internal.h"
#include "pipeline/lightfield/lightfield.h"
#include "pipeline/method/render/render.h"

/* --- render_args: common parts of `sst render` and `sst sweep`: options of a picture, loading, output formats. --- */

struct render_args {
    struct sst_render_config cfg;
    enum { RENDER_AUTO = 0, RENDER_RAW = 1, RENDER_RECTIFIED = 2 } sampling;
    const char *label;                    /* as written */
    const char *remove_label, *remove_at; /* of the clear method */
    double cut;                           /* NaN: not given */
    bool focus_found;                     /* out of cli_render_open(): cfg.focus_px was NaN, and is the focus found */
    int pictures;                         /* to be rendered: `--sampling auto` depends on it */
    bool views_needed;                    /* rectified views are looked at besides */
    bool disparities_needed;              /* also by methods that do not use them */
    double f_stop;                        /* 0: not given */
    bool no_verify;                       /* altered views are accepted */
    const char *device;                   /* as written */
    const char *skip;                     /* as written; NULL: nothing is skipped */
    int device_memory;                    /* MiB; 0: not given */
    const char *levels;                   /* "LOW,HIGH" of 8-bit pictures of posed light fields of 16 bits */
    const char *utm;                      /* zone of a terrain's places */
    const char *surface, *view;           /* of posed light fields, as written; NULL: not given */
    double near_m, far_m;                 /* 0: not given */
    bool json, force;
};

#define RENDER_OPTIONS 34

/** The shared options, their values set to the defaults; pictures is 1. */
void cli_render_options(struct cli_option options[RENDER_OPTIONS], struct render_args *a);

/** Accept images that differ from their SHA-256. */
#define CLI_NO_VERIFY_OPTION(value)                                                                                    \
    {                                                                                                                  \
        "no-verify", 0, CLI_FLAG, &(value), NULL, "accept views whose bytes differ from the hash in lightfield.json",  \
            0, 0                                                                                                       \
    }

/** Other names of methods: see-through is sst. After cli_parse(). */
void cli_render_names(struct render_args *a);

/** Refuse options of light fields with a pose for every view. @return CLI_GO_ON or CLI_USAGE */
int cli_render_check_posed(const struct render_args *a, const struct cli_command *cmd, const char *path);

/** The method's name. */
const char *cli_render_method(const struct render_args *a);

/** `--verify-rays`, for an enum sst_render_verify. */
#define CLI_VERIFY_OPTION(value)                                                                                       \
    {                                                                                                                  \
        "verify-rays", 0, CLI_WORD, &(value), "W",                                                                     \
            "count rays whose colours agree at the focus: auto (default: where maps of preview are poor), on or off",  \
            0, 0, "off on auto"                                                                                        \
    }

/** A light field ready to render. */
struct render_input {
    const char *path;
    struct sst_lightfield lf;
    struct sst_renderer *renderer;
    bool rectified;             /* lf has raw frames, and rays are of rectified views */
    bool borrowed;              /* lf shares the data of another one */
    struct sst_map_u8 *removed; /* of --remove-at: [rows * cols]; NULL: not given */
};

/**
 * Check the options, load the data that the method needs, as raw frames or rectified, find the label and
 * the removal of the clear method, and turn the f-stop into a radius.
 * @return CLI_GO_ON, or the exit code of the failure, which was logged; then nothing is to be freed
 */
int cli_render_open(struct render_input *in, struct render_args *a, const struct cli_command *cmd, const char *path);
void cli_render_close(struct render_input *in);

/** A light field in memory, loaded with SST_LOAD_SOURCES and settled. */
struct render_loaded {
    const char *name; /* for messages */
    const struct sst_lightfield *lf;
    struct sst_runner *device; /* NULL: on no device */
};

/** cli_render_open() of a light field in memory. */
int cli_render_open_loaded(struct render_input *in, struct render_args *a, const struct cli_command *cmd,
                           const struct render_loaded *loaded);

/** `sst render` of a light field in memory to a PNG. @param report  out @return exit code */
int cli_render_loaded(const struct render_loaded *loaded, struct render_args *a, const char *out, json_t **report);

/** `sst sweep` over its focus. @return exit code */
int cli_sweep_loaded(const struct render_loaded *loaded, struct render_args *a, const char *out, int steps);

/** Report of the device, for `--json`; "cpu" without one. */
json_t *cli_render_device_json(const struct render_input *in);

/** One line of the log about it: a warning where pictures were rendered on the CPU instead. */
void cli_render_report_device(const struct render_input *in);

/** Report of skips and the error that they added, for `--json`; null without skips. */
json_t *cli_render_skips_json(const struct render_input *in, const struct render_args *a);

/** Print one line about it. @param out  the output's name */
void cli_render_report_skips(const struct render_input *in, const char *out);

/** Does the name end so (".png"), upper or lower case? */
bool cli_has_suffix(const char *path, const char *suffix);

/** Pictures of the maps and weights of the reference view, and of the rays of pixel x, y; see `sst render --help`. */
int cli_render_explain(const struct render_input *in, const struct render_args *a, const char *dir, int x, int y);

#endif
