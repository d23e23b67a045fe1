/* cli/places.h - which device sits where in the array, for commands that list cameras. */
#ifndef SST_CLI_PLACES_H
#define SST_CLI_PLACES_H

#include "config/array.h"
#include "drivers/grab/grab.h"

struct cli_place {
    int row, col; /* -1: the configuration has no place for it */
};

/**
 * Places of all devices: by `bind`, or without one in the order given, row by row.
 * @param place  out [count]
 */
void cli_places(struct cli_place *place, const struct sst_array_config *cfg, const struct sst_grab_device *devices,
                int count);

/** "r0c3", or "-". */
const char *cli_place_text(char text[16], struct cli_place place);

/** The grab's part of an array's configuration, for cameras that run on their own; bindings are left alone. */
void cli_grab_config(struct sst_grab_config *grab, const struct sst_array_config *cfg);

#endif
