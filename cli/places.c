/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <stdio.h>
#include <string.h>

#include "capture/array/capture.h"

bool cli_is_bound(const struct sst_config_camera *c, const char *serial, const char *port)
{
    if (c->kind != SST_CONFIG_V4L2)
        return false;
    return *c->serial ? !strcmp(c->serial, serial) : *c->port && !strcmp(c->port, port);
}

bool cli_is_node(const struct sst_config_camera *c, const struct sst_grab_device *d)
{
    return cli_is_bound(c, d->serial, d->port) && (c->node ? c->node == d->nth : !*d->left_out);
}

void cli_places(struct cli_place *place, const struct sst_array_config *cfg, const struct sst_grab_device *devices,
                int count)
{
    for (int i = 0; i < count; i++) {
        place[i] = (struct cli_place){ -1, -1 };
        if (!cfg->bound && !*devices[i].left_out && i < cfg->rows * cfg->cols)
            sst_array_place(cfg, i, &place[i].row, &place[i].col);
        for (int k = 0; k < cfg->bound; k++) {
            if (cli_is_node(&cfg->camera[k], &devices[i]))
                place[i] = (struct cli_place){ cfg->camera[k].row, cfg->camera[k].col };
        }
    }
}

json_t *cli_place_json(json_t *object, struct cli_place place)
{
    if (object && place.row >= 0 &&
        (json_object_set_new(object, "row", json_integer(place.row)) ||
         json_object_set_new(object, "col", json_integer(place.col)))) {
        json_decref(object);
        return NULL;
    }
    return object;
}

const char *cli_place_text(char text[16], struct cli_place place)
{
    if (place.row < 0)
        return "-";
    snprintf(text, 16, "r%dc%d", place.row, place.col);
    return text;
}

void cli_grab_config(struct sst_grab_config *grab, const struct sst_array_config *cfg)
{
    struct sst_grab_config whole;

    sst_capture_grab_config(&whole, cfg);
    sst_grab_config_defaults(grab);
    grab->fourcc = cfg->fourcc;
    grab->width = cfg->width;
    grab->height = cfg->height;
    grab->split = whole.split;
    grab->cutter = whole.cutter;
    grab->rate_hz = cfg->rate_hz;
    grab->stall_ms = cfg->stall_ms;
    /* Cameras in triggered mode would not send frames. */
    for (int i = 0; i < cfg->controls; i++) {
        if (strcmp(cfg->control[i].name, "trigger_mode") != 0)
            continue;
        snprintf(grab->control[0].name, sizeof(grab->control[0].name), "%s", cfg->control[i].name);
        grab->controls = 1;
    }
}
