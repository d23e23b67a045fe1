#include "simulators/world/settings.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "simulators/scene/scene.h"

void sst_sim_settings_defaults(struct sst_sim_settings *s, const char *scene)
{
    memset(s, 0, sizeof(*s)); /* also between the fields: the bytes are the cache's key */
    snprintf(s->scene, sizeof(s->scene), "%s", scene);
    s->seed = 1;
    s->rows = s->cols = 6;
    s->width = 640;
    s->height = 480;
    s->loop_s = !strcmp(scene, "pedestrian") ? 4 : !strcmp(scene, "bush") ? 2 : 0.1;
    s->rate_hz = 10;
    s->quality = 85;
    s->exposure_us = 5000;
    s->strip = true;
    s->line_us = 20;
    s->latency_us = 8000;
}

int sst_sim_settings_read(struct sst_sim_settings *s, const char *world)
{
    for (int i = 0; sst_scene_names()[i]; i++) {
        if (!strcmp(world, sst_scene_names()[i])) {
            sst_sim_settings_defaults(s, world);
            return 0;
        }
    }
    sst_log_error("there is no world %s; give the name of a scene", world);
    return -EINVAL;
}
