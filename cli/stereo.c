/* sst stereo: disparity of one rectified pair. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "cli/cli_internal.h"
#include "pipeline/image/codec.h"

#define PNG_MAX_PX 255 /* largest disparity in 16 bits */

/* 16-bit PNG: 256 steps per pixel, 0 unknown, as KITTI does; a known disparity of 0 becomes the smallest step. */
static int write_png16(const struct sst_map_f32 *disp, const char *path)
{
    struct sst_map_u16 out = { 0 };
    int err = sst_map_u16_init(&out, disp->width, disp->height);

    if (err)
        return err;
    for (int y = 0; y < out.height; y++) {
        const float *d = sst_map_f32_row(disp, y);

        for (int x = 0; x < out.width; x++) {
            const float q = d[x] * 256.0f + 0.5f;

            sst_map_u16_row(&out, y)[x] = (uint16_t)(q < 65536.0f ? fmaxf(q, 1.0f) : 0.0f);
        }
    }
    err = sst_map_u16_write_png(&out, path);
    sst_map_u16_fini(&out);
    return err;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct cli_matching m = CLI_MATCHING_DEFAULTS;
    const char *files[2], *out = NULL, *skip = NULL, *device = "cpu";
    double disp_max = NAN, disp_min = 0;
    bool raw = false;
    int device_memory = 0;
    const struct cli_option options[] = {
        { "output", 'o', CLI_FILE, &out, "FILE", "disparity map: .pfm (px, inf unknown) or 16-bit .png (1/256 px)" },
        { "max-disparity", 'm', CLI_DOUBLE, &disp_max, "N", "largest disparity searched, px", -9999, 9999 },
        { "min-disparity", 0, CLI_DOUBLE, &disp_min, "N", "smallest disparity searched, px (0)", -9999, 9999 },
        { "raw", 0, CLI_FLAG, &raw, NULL, "cheapest disparity of each pixel: no optimisation, no filling" },
        { "skip", 0, CLI_STRING, &skip, "LIST", "searches in part only: ranges (default), all or none" },
        { "device", 0, CLI_STRING, &device, "D",
          "where the features of the mccnn cost are computed: cpu (default), gpu, auto or a part of a device's name" },
        { "device-memory", 0, CLI_INT, &device_memory, "MIB", CLI_DEVICE_MEMORY_HELP, 1, 1 << 24 },
        CLI_MATCHING_OPTIONS(m),
    };
    struct sst_image left = { 0 }, right = { 0 };
    struct sst_map_f32 disp = { 0 };
    struct sst_runner_user *networks = NULL;
    struct sst_disparity_config cfg;
    char model[SST_PATH_MAX];
    int64_t start;
    int err, r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, files, 2, 2);

    if (r != CLI_GO_ON)
        return r;
    if (!out || isnan(disp_max))
        return cli_usage_error(cmd, "%s is missing", out ? "--max-disparity N" : "-o out.pfm");
    if (!sst_text_ends(out, ".pfm") && !sst_text_ends(out, ".png"))
        return cli_usage_error(cmd, "-o %s must end in .pfm or .png", out);
    if (sst_text_ends(out, ".png") && (disp_min < 0 || disp_max > PNG_MAX_PX))
        return cli_usage_error(cmd, "a .png holds disparities of 0..%d px; write -o out.pfm", PNG_MAX_PX);
    if (!raw && !m.cost && !m.model)
        m.cost = SST_COST_CENSUS; /* as sst_disparity_stereo() takes it: needs no network to be installed */
    err = cli_matching_config(&cfg, &m, model);
    if (!err) {
        r = cli_read_skips(cmd, "skip", skip, &(struct cli_skip){ "ranges", &cfg.skip_ranges }, 1);
        if (r != CLI_GO_ON)
            return r;
    }
    if (!err && strcmp(device, "cpu") && !(cfg.cost & SST_COST_MCCNN))
        return cli_usage_error(cmd, "--device %s: only the features of --cost mccnn or both are computed on a device",
                               device);
    err = err ? err : sst_network_device_open(&networks, device, (uint64_t)device_memory << 20);
    cfg.networks = networks;
    cfg.raw = raw;
    cfg.disp_min_px = disp_min;
    cfg.disp_max_px = disp_max;
    err = err ? err : sst_image_read_alike((struct sst_image *[]){ &left, &right }, files, 2);
    start = sst_clock_now_ns();
    err = err ? err : sst_disparity_stereo(&disp, &left, &right, &cfg);
    sst_log_info("matched in %.0f ms", (double)(sst_clock_now_ns() - start) * 1e-6);
    cli_network_report_device(networks);
    if (!err)
        err = sst_text_ends(out, ".pfm") ? sst_map_f32_write_pfm(&disp, out) : write_png16(&disp, out);
    sst_image_fini(&left);
    sst_image_fini(&right);
    sst_map_f32_fini(&disp);
    sst_network_device_close(networks);
    return cli_exit_code(err);
}

const struct cli_command cli_stereo = { "stereo", run };
