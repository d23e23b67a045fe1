#include "simulators/world/render.h"

#include <stdlib.h>

#include "simulators/scene/scene.h"

struct sst_sim_stage {
    const struct sst_sim_settings *settings;
    struct sst_sim_optics optics;
    struct sst_sim_camera camera[SST_CAMERAS_MAX];
    int frames;
};

int sst_sim_stage_open(struct sst_sim_stage **out, const struct sst_sim_settings *settings)
{
    struct sst_sim_stage *s = calloc(1, sizeof(*s));
    struct sst_scene_config cfg = { settings->width, settings->height, settings->rows, settings->cols,
                                    settings->seed, 0, 1, NULL, NULL };
    struct sst_scene *scene;

    if (!s)
        return -12;
    const int err = sst_scene_create(&scene, settings->scene, &cfg);
    if (err)
        return err;
    s->settings = settings;
    s->optics.focal_px = sst_scene_focal_px(scene);
    s->optics.spacing_mm = sst_scene_spacing_mm(scene);
    s->frames = 4;
    for (int i = 0; i < SST_CAMERAS_MAX; i++)
        sst_sim_camera_make(&s->camera[i], settings, &s->optics, i);
    sst_scene_destroy(scene);
    *out = s;
    return 0;
}

void sst_sim_stage_close(struct sst_sim_stage *s)
{
    free(s);
}

const struct sst_sim_optics *sst_sim_stage_optics(const struct sst_sim_stage *s) { return &s->optics; }
const struct sst_sim_camera *sst_sim_stage_camera(const struct sst_sim_stage *s, int cam) { return &s->camera[cam]; }
int sst_sim_stage_frames(const struct sst_sim_stage *s) { return s->frames; }

static int render(const struct sst_sim_stage *s, double bx, double by, int frame, struct sst_image *image)
{
    struct sst_scene_config cfg = { s->settings->width, s->settings->height, s->settings->rows, s->settings->cols,
                                    s->settings->seed, frame, 1, NULL, NULL };
    struct sst_scene *scene;
    int err = sst_scene_create(&scene, s->settings->scene, &cfg);

    if (err)
        return err;
    err = sst_scene_render(scene, bx, by, 0, image, NULL, NULL);
    sst_scene_destroy(scene);
    return err;
}

int sst_sim_stage_loop(const struct sst_sim_stage *s, int cam, sst_sim_picture_fn *fn, void *arg)
{
    struct sst_image image = { 0 };
    int err = sst_image_init(&image, s->settings->width, s->settings->height);

    for (int i = 0; i < s->frames && !err; i++) {
        err = render(s, cam % s->settings->cols - 2, cam / s->settings->cols - 2, i, &image);
        if (!err)
            err = fn(arg, i, &image);
    }
    sst_image_fini(&image);
    return err;
}

int sst_sim_stage_pose(const struct sst_sim_stage *s, const int32_t pose_um[3], int frame, struct sst_image *image)
{
    return render(s, pose_um[0] / 1000.0 / s->optics.spacing_mm - 2, pose_um[1] / 1000.0 / s->optics.spacing_mm - 2,
                  frame, image);
}
