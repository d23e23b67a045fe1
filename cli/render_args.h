/* cli/render_args.h - what `sst render` and `sst sweep` share: the options of a picture, loading, output formats. */
#ifndef SST_CLI_RENDER_ARGS_H
#define SST_CLI_RENDER_ARGS_H

#include "cli/cli.h"
#include "pipeline/method/render/render.h"

struct render_args {
    struct sst_render_config cfg;
    const char *label, *method, *range, *unsupported, *sampling, *verify; /* as written */
    int pictures;      /* that will be rendered: what `--sampling auto` goes by */
    bool views_needed; /* rectified views are looked at besides */
    double f_stop;     /* 0: not given */
    bool json, force;
};

#define RENDER_OPTIONS 20

/** The shared options, their values set to the defaults; pictures is 1. */
void cli_render_options(struct cli_option options[RENDER_OPTIONS], struct render_args *a);

/** What `--verify-rays` says. */
#define CLI_VERIFY_OPTION(value)                                                                                       \
    {                                                                                                                  \
        "verify-rays", 0, CLI_STRING, &(value), "W",                                                                   \
            "count rays whose colours agree at the focus: auto (default: where the maps are poor), on or off", 0, 0    \
    }

/** Read that word. @return CLI_GO_ON or CLI_USAGE (the sentence was printed) */
int cli_read_verify(enum sst_render_verify *verify, const char *word, const struct cli_command *cmd);

/** A light field ready to render. */
struct render_input {
    const char *path;
    struct sst_lightfield lf;
    struct sst_renderer *renderer;
};

/**
 * Read the words among the options, load what the method needs, as raw frames or rectified, find the label and turn the
 * f-stop into a radius.
 * @return CLI_GO_ON, or the exit code of the failure, which was logged; then nothing is to be freed
 */
int cli_render_open(struct render_input *in, struct render_args *a, const struct cli_command *cmd, const char *path);
void cli_render_close(struct render_input *in);

/** Does the name end so (".png"), upper or lower case? */
bool cli_has_suffix(const char *path, const char *suffix);

/** PNG or JPEG by the name's ending, which the caller has checked. */
int cli_write_picture(const struct sst_image *img, const char *path);

/** Pictures of the maps and weights of the reference view, and of the rays of pixel x, y; see `sst render --help`. */
int cli_render_explain(const struct render_input *in, const struct render_args *a, const char *dir, int x, int y);

#endif
