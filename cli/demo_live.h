/* cli/demo_live.h - sst demo: sstd on simulated arrays, with its page. */
#ifndef SST_CLI_DEMO_LIVE_H
#define SST_CLI_DEMO_LIVE_H

#define CLI_DEMO_SCENES 4

struct cli_demo_live {
    const char *out;                    /* folder */
    const char *scene[CLI_DEMO_SCENES]; /* ends with NULL, or full */
    int port;                           /* of the first scene's page; the next ones follow */
};

/** Run until interrupted. @return exit code */
int cli_demo_live(const struct cli_demo_live *demo);

#endif
