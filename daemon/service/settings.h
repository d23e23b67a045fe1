/* daemon/service/settings.h - what one viewer wants to see, as it stands in JSON (docs/api.md). */
#ifndef SST_DAEMON_SERVICE_SETTINGS_H
#define SST_DAEMON_SERVICE_SETTINGS_H

#include <jansson.h>

#include "config/sstd.h"
#include "pipeline/method/render/render.h"

struct sst_view_settings {
    struct sst_render_config render; /* focus_px NaN: the default focus; focus_label is found by name when rendering */
    char focus_label[SST_CLASS_NAME_MAX]; /* "": none */
    bool follow;                          /* the focus follows that label */
};

void sst_view_settings_defaults(struct sst_view_settings *s, const struct sst_live_settings *config);

/** What another configuration changes of the defaults; the rest stays as somebody may have set it meanwhile. */
void sst_view_settings_follow(struct sst_view_settings *s, const struct sst_live_settings *from,
                              const struct sst_live_settings *to);

/**
 * Take over the members of an object; those that are not there stay.
 * @param error  out, one sentence on failure
 * @return 0, -EINVAL (s untouched)
 */
SST_MUST_CHECK int sst_view_settings_take(struct sst_view_settings *s, const json_t *from, char error[512]);

/** NULL: no memory. */
json_t *sst_view_settings_json(const struct sst_view_settings *s);

#endif
