/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/storage/storage_internal.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static struct event_trigger *add(struct event_triggers *w, const struct sst_config *config, int zone)
{
    struct event_trigger *made = &w->list[w->count++];

    *made = (struct event_trigger){ .trigger = -1, .index = zone, .share = EVENT_TRIGGER_SHARE };
    if (zone >= 0)
        snprintf(made->zone, sizeof(made->zone), "%s", config->zone[zone].name);
    return made;
}

void event_triggers_init(struct event_triggers *w, const struct sst_config *config)
{
    bool named[SST_ZONES_MAX] = { false };

    memset(w, 0, sizeof(*w));
    for (int i = 0; i < config->storage.triggers && i < SST_TRIGGERS_MAX; i++) {
        const struct sst_record_trigger *t = &config->storage.trigger[i];
        const int zone = t->zone < config->zones ? t->zone : -1;
        struct event_trigger *made = add(w, config, zone);

        made->trigger = i;
        made->share = t->share;
        made->begin_s = t->begin_s;
        made->end_s = t->end_s;
        snprintf(made->label, sizeof(made->label), "%s", t->label);
        made->visit = t->visit;
        if (zone >= 0 && !t->label[0] && !t->visit)
            named[zone] = true;
    }
    for (int i = 0; i < config->zones && i < SST_ZONES_MAX; i++) {
        if (!named[i] && !config->zone[i].mask && !config->zone[i].line)
            add(w, config, i);
    }
}

static int64_t end_ns(const struct event_trigger *w)
{
    return llround((w->end_s > 0 ? w->end_s : EVENT_TRIGGER_END_S) * 1e9);
}

bool event_trigger_update(struct event_trigger *w, double value, int64_t t_ns)
{
    /* A share of 0 means any value above 0. NaN counts as 0: comparisons with it are false. */
    const bool reached = value > 0 && value >= w->share;
    const bool kept = value > 0 && value >= EVENT_TRIGGER_KEEPS * w->share;
    const bool other = w->active ? !kept : reached;
    const int64_t step_ns = t_ns > w->t_ns ? t_ns - w->t_ns : 0; /* never negative */
    const int64_t begin_ns = llround((w->begin_s > 0 ? w->begin_s : EVENT_TRIGGER_BEGIN_S) * 1e9);

    w->t_ns = t_ns;
    if (w->active && kept)
        w->last_ns = t_ns;
    if (!other) {
        w->weight_ns -= step_ns;
        if (w->weight_ns < 0)
            w->sets = 0;
        return false;
    }
    if (!w->sets++) {
        w->since_ns = t_ns;
        w->weight_ns = 0;
    } else {
        w->weight_ns += step_ns;
    }
    if (w->sets < 2 || w->weight_ns < (w->active ? end_ns(w) : begin_ns))
        return false;
    w->active = !w->active;
    if (w->active) {
        w->begin_ns = w->since_ns;
        w->last_ns = t_ns;
    }
    w->sets = 0;
    return true;
}

static int64_t longer(int64_t hold_ns)
{
    return hold_ns < EVENT_TRIGGER_HOLD_NS / 2 ? 2 * hold_ns : EVENT_TRIGGER_HOLD_NS;
}

bool event_trigger_report(struct event_trigger *w, double value, int64_t t_ns)
{
    const bool came = w->active && !w->was_active;

    w->was_active = w->active;
    if (!w->reported) {
        if (!w->active)
            return false;
        if (!w->label[0] && w->reported_ns && w->begin_ns - w->reported_ns < EVENT_TRIGGER_AGAIN_NS)
            w->hold_ns = longer(w->hold_ns > end_ns(w) ? w->hold_ns : end_ns(w));
        else
            w->hold_ns = 0;
        w->reported = true;
        w->reported_ns = w->begin_ns;
        w->times = 1;
        w->peak = value;
        return true;
    }
    w->times += came;
    w->peak = value > w->peak ? value : w->peak;
    if (w->active || t_ns - w->last_ns < w->hold_ns)
        return false;
    w->reported = false;
    w->reported_ns = t_ns;
    return true;
}

void event_trigger_continue(struct event_trigger *w, const struct event_trigger *before)
{
    const struct event_trigger set = *w;

    *w = *before;
    w->trigger = set.trigger;
    w->index = set.index;
    w->share = set.share;
    w->begin_s = set.begin_s;
    w->end_s = set.end_s;
}
