/* Files that the camera announces, and their assignment to the exposure in progress.
 *
 * PTP names no release with a file. A file belongs to the last release only if it was neither on the card nor announced
 * before, and if nothing of an earlier release can still come: every earlier release has its files, and the camera
 * accepted this one at the first asking. Where that is not known (the first release of a session, one after a failure
 * or after a busy camera), files are listened for longer, and the last ones count: a camera announces files in the
 * order of its exposures.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "drivers/still/still_internal.h"

#define EVENT_MS 100
#define MS       1000000LL

static bool same_path(const struct still_path *a, const struct still_path *b)
{
    return !strcmp(a->name, b->name) && !strcmp(a->folder, b->folder);
}

static bool is_known(const struct sst_still *s, const struct still_path *path)
{
    for (int i = 0; i < s->known_count; i++)
        if (same_path(&s->known[i], path))
            return true;
    return false;
}

int still_know(struct sst_still *s, const struct still_path *path)
{
    if (is_known(s, path))
        return 0;
    if (!sst_mem_grow(&s->known, s->known_count, &s->known_room, sizeof(*s->known)))
        return still_failed(s, -ENOMEM, "noting a file");
    s->known[s->known_count++] = *path;
    return 0;
}

int still_card_read(struct sst_still *s)
{
    struct still_path *list = NULL;
    int count = 0, err;

    free(s->known);
    s->known = NULL;
    s->known_count = s->known_room = 0;
    err = still_lib_list(s->lib, &list, &count);
    if (err == -ENODEV || err == -ETIMEDOUT || err == -ENOMEM)
        return still_failed(s, err, "listing its card");
    if (err) { /* a camera without a card, or that does not list it while it is controlled */
        sst_log_debug("still camera %s does not list its card: %s", s->serial, still_lib_said(s->lib));
        return 0;
    }
    s->known = list;
    s->known_count = s->known_room = count;
    return 0;
}

static uint64_t fnv1a(const uint8_t *data, size_t bytes)
{
    uint64_t hash = 0xcbf29ce484222325;

    for (size_t i = 0; i < bytes; i++)
        hash = (hash ^ data[i]) * 0x100000001b3;
    return hash;
}

bool still_seen(const struct sst_still *s, const uint8_t *data, size_t bytes)
{
    const uint64_t hash = fnv1a(data, bytes);

    for (int i = 0; i < STILL_SEEN; i++)
        if (s->seen[i].bytes == bytes && s->seen[i].hash == hash)
            return true;
    return false;
}

void still_see(struct sst_still *s, const uint8_t *data, size_t bytes)
{
    s->seen[s->seen_next].bytes = bytes;
    s->seen[s->seen_next].hash = fnv1a(data, bytes);
    s->seen_next = (s->seen_next + 1) % STILL_SEEN;
}

/**
 * A file of no view: it stays on the card, and is downloaded once, since cameras announce some files until they are.
 * @return 1: it was announced before, 0 or -errno, logged
 */
static int pass_over(struct sst_still *s, const struct still_path *path)
{
    uint8_t *data = NULL;
    size_t bytes = 0;
    bool again;
    int err;

    for (int i = 0; i < s->done_count; i++)
        if (same_path(&s->done[i], path))
            return 1;
    err = still_lib_download(s->lib, path, &data, &bytes);
    if (err == -ENODEV || err == -ETIMEDOUT || err == -ENOMEM)
        return still_failed(s, err, path->name);
    if (err) {
        again = is_known(s, path);
        err = still_know(s, path);
    } else {
        again = still_seen(s, data, bytes);
        if (!again)
            still_see(s, data, bytes);
    }
    free(data);
    if (!again)
        sst_log_warning("still camera %s: %s belongs to no view; it stays on the card", s->serial, path->name);
    return err ? err : again;
}

int still_drain(struct sst_still *s, int timeout_ms, int64_t until_ns)
{
    const int64_t end_ns = sst_clock_now_ns() + s->cfg.card_ms * MS;
    int event = STILL_FILE, repeats = 0;

    while ((event != STILL_NOTHING && repeats <= STILL_SEEN && sst_clock_now_ns() < end_ns) ||
           sst_clock_now_ns() < until_ns) {
        struct still_path path;
        int again = 0;

        event = still_lib_event(s->lib, sst_clock_now_ns() < until_ns ? EVENT_MS : timeout_ms, &path);
        if (event < 0 || still_cancelled(s))
            return event < 0 ? still_failed(s, event, "asking for events") : -ECANCELED;
        if (event == STILL_FILE)
            again = pass_over(s, &path);
        if (again < 0)
            return again;
        repeats += again;
    }
    /* Files behind announcements that do not end may be of an earlier release. */
    if (event != STILL_NOTHING)
        s->unsure_ns = INT64_MAX;
    return 0;
}

/** @return 1: another file of the exposure, 0: no, or -errno, logged */
static int add_file(struct sst_still *s, const struct still_path *path, int wanted)
{
    if (is_known(s, path))
        return 0;
    for (int i = 0; i < s->paths; i++)
        if (same_path(&s->path[i], path))
            return 0;
    if (s->paths == wanted) {
        const struct still_path first = s->path[0];
        const int err = still_know(s, &first);

        if (err)
            return err;
        sst_log_warning("still camera %s: %s is of an earlier release and belongs to no view; it stays on the card",
                        s->serial, first.name);
        memmove(&s->path[0], &s->path[1], (size_t)--s->paths * sizeof(s->path[0]));
    }
    s->path[s->paths++] = *path;
    return 1;
}

int still_wait_files(struct sst_still *s, int wanted, int64_t release_ns)
{
    const int64_t end_ns = release_ns + s->cfg.card_ms * MS;
    int64_t sure_ns = release_ns < s->unsure_ns ? release_ns + s->cfg.quiet_ms * MS : 0;

    while (sst_clock_now_ns() < (s->paths < wanted ? end_ns : sure_ns) && !still_cancelled(s)) {
        struct still_path path;
        const bool full = s->paths == wanted;
        int added = 0, event = still_lib_event(s->lib, EVENT_MS, &path);

        if (event < 0)
            return still_failed(s, event, "waiting for the picture");
        if (event == STILL_FILE)
            added = add_file(s, &path, wanted);
        if (added < 0)
            return added;
        if (added && full && sure_ns < end_ns) /* two releases overlap: all of the last one have to come */
            sure_ns = end_ns;
        if (added && !full && s->paths == wanted && sst_clock_now_ns() < sure_ns)
            sst_log_info("still camera %s: watched until %d ms after this release, since files of an earlier one may "
                         "come first (still: quiet_ms)",
                         s->serial, s->cfg.quiet_ms);
    }
    if (still_cancelled(s))
        return -ECANCELED;
    if (s->paths == wanted)
        return 0;
    s->count.silent++;
    sst_log_error("still camera %s was released, but announced %d of %d files within %d ms; check its focus, mirror "
                  "lock-up and files settings, or raise still: card_ms",
                  s->serial, s->paths, wanted, s->cfg.card_ms);
    still_lib_close(s->lib);
    s->lib = NULL;
    return -ETIMEDOUT;
}
