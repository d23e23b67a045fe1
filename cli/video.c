/* Loader of video_libav.c, the part libsst-video.so: FFmpeg has more than a hundred libraries. */
#include "cli/cli_internal.h"
#include "cli/render_internal.h"

#include <errno.h>

#include "base/log.h"
#include "base/plugin.h"

static void *load(const char *function)
{
    char why[256];
    void *loaded = sst_plugin_symbol("video", function, why);

    if (!loaded)
        sst_log_error("video needs libavformat: %s; install it and build again, or name a folder to get pictures", why);
    return loaded;
}

int video_open(struct video **out, const char *path, int width, int height, double fps)
{
    SST_PLUGIN_CALL(load, video_open, out, path, width, height, fps);
}

int video_add(struct video *v, const struct sst_image *img)
{
    SST_PLUGIN_CALL(load, video_add, v, img);
}

int video_commit(struct video *v)
{
    SST_PLUGIN_CALL(load, video_commit, v);
}

void video_close(struct video *v)
{
    void (*loaded)(struct video *) = NULL;

    if (v)
        *(void **)&loaded = load("video_close");
    if (loaded)
        loaded(v);
}
