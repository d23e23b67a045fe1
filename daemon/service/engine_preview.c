/* Preview of a moment of a recording: the picture that was recorded of the main view, shown until views have their own. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

/* Recorded pictures are see-through, none is refocused. */
bool engine_preview_fits_locked(const struct live_engine *v, const struct view *e)
{
    return v->preview.data && e->settings.render.method != SST_RENDER_REFOCUS;
}

void engine_preview_show_locked(struct live_engine *v, struct view *e)
{
    const struct engine_preview *p = &v->preview;
    uint8_t *copy = engine_preview_fits_locked(v, e) ? malloc(p->bytes) : NULL;

    if (!copy)
        return;
    memcpy(copy, p->data, p->bytes);
    if (sst_slot_put(e->slot, copy, p->bytes, p->set, p->t_ns, p->wall_ns))
        return; /* no memory: the picture before stays */
}

void engine_preview(struct live_engine *v, struct engine_preview *preview)
{
    pthread_mutex_lock(&v->lock);
    free(v->preview.data);
    v->preview = *preview;
    for (int i = 0; i < VIEWS_MAX; i++)
        if (v->view[i].used)
            engine_preview_show_locked(v, &v->view[i]);
    pthread_mutex_unlock(&v->lock);
    preview->data = NULL;
}

void engine_preview_end(struct live_engine *v)
{
    pthread_mutex_lock(&v->lock);
    free(v->preview.data);
    v->preview.data = NULL;
    pthread_mutex_unlock(&v->lock);
}
