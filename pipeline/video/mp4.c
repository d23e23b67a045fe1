/* MP4 files under their names; loader of mp4_libav.c, the part libsst-video.so: FFmpeg has more than a hundred
 * libraries. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/video/mp4.h"

#include <errno.h>
#include <stdlib.h>

#include "base/file.h"
#include "base/log.h"
#include "base/plugin.h"
#include "pipeline/video/video_internal.h"

struct sst_mp4 {
    struct sst_outfile out;
    struct video_encoder *encoder;
    struct sst_rect whole;
};

static void *load(const char *function)
{
    char why[256];
    void *loaded = sst_plugin_symbol("video", function, why);

    if (!loaded)
        sst_log_error("video needs libavformat: %s; the name of a folder gets pictures", why);
    return loaded;
}

/* Functions of the part; -ENOTSUP, logged, without it. */
static int encoder_open(struct video_encoder **out, const char *path, const struct sst_mp4_config *cfg,
                        char why[VIDEO_WHY])
{
    SST_PLUGIN_CALL(load, video_encoder_open, out, path, cfg, why);
}

static int encoder_put(struct video_encoder *v, const struct sst_image *img, struct sst_rect part, char why[VIDEO_WHY])
{
    SST_PLUGIN_CALL(load, video_encoder_put, v, img, part, why);
}

static int encoder_next(struct video_encoder *v, char why[VIDEO_WHY])
{
    SST_PLUGIN_CALL(load, video_encoder_next, v, why);
}

static int encoder_end(struct video_encoder *v, char why[VIDEO_WHY])
{
    SST_PLUGIN_CALL(load, video_encoder_end, v, why);
}

static void encoder_close(struct video_encoder *v)
{
    void (*loaded)(struct video_encoder *) = NULL;

    if (v)
        *(void **)&loaded = load("video_encoder_close");
    if (loaded)
        loaded(v);
}

static int judge(const struct sst_mp4 *m, int err, const char *why)
{
    if (err && why[0])
        sst_log_error("cannot write %s: %s", m->out.path, why);
    return err;
}

int sst_mp4_open(struct sst_mp4 **out, const char *path, const struct sst_mp4_config *cfg)
{
    char why[VIDEO_WHY] = "";
    struct sst_mp4 *m;
    int err;

    if (cfg->width < 2 || cfg->height < 2) {
        sst_log_error("a video of %d x %d pixels is not possible; write a folder of pictures instead", cfg->width,
                      cfg->height);
        return -EINVAL;
    }
    m = calloc(1, sizeof(*m));
    if (!m)
        return -ENOMEM;
    m->whole = (struct sst_rect){ .x1 = cfg->width & ~1, .y1 = cfg->height & ~1 };
    err = sst_outfile_open(&m->out, path);
    if (!err)
        err = judge(m, encoder_open(&m->encoder, m->out.temporary, cfg, why), why);
    if (err)
        sst_mp4_close(m);
    else
        *out = m;
    return err;
}

int sst_mp4_put(struct sst_mp4 *m, const struct sst_image *img, struct sst_rect part)
{
    char why[VIDEO_WHY] = "";

    return judge(m, encoder_put(m->encoder, img, part, why), why);
}

int sst_mp4_next(struct sst_mp4 *m)
{
    char why[VIDEO_WHY] = "";

    return judge(m, encoder_next(m->encoder, why), why);
}

int sst_mp4_add(struct sst_mp4 *m, const struct sst_image *img)
{
    /* Without an odd last column or row, which are not scaled into the others. */
    const struct sst_image even = { m->whole.x1, m->whole.y1, img->stride, { img->plane[0], img->plane[1], img->plane[2] } };
    const int err = sst_mp4_put(m, &even, m->whole);

    return err ? err : sst_mp4_next(m);
}

int sst_mp4_commit(struct sst_mp4 *m)
{
    char why[VIDEO_WHY] = "";
    const int err = judge(m, encoder_end(m->encoder, why), why);

    return err ? err : sst_outfile_commit(&m->out);
}

void sst_mp4_close(struct sst_mp4 *m)
{
    if (!m)
        return;
    encoder_close(m->encoder);
    sst_outfile_abort(&m->out);
    free(m);
}
