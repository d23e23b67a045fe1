/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/grab/grab_internal.h"

#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <linux/videodev2.h>
#include <string.h>

#include "base/text.h"

void control_name(char *out, size_t size, const char *title)
{
    size_t n = 0;
    bool gap = false;

    for (; *title && n + 2 < size; title++) {
        if (!isalnum((unsigned char)*title)) {
            gap = n > 0;
            continue;
        }
        if (gap)
            out[n++] = '_';
        gap = false;
        out[n++] = (char)tolower((unsigned char)*title);
    }
    out[n] = 0;
}

/* Enumerate the controls of the camera. @return 0, or -ENOENT with their names appended to `names` */
static int find(int fd, const char *name, struct v4l2_query_ext_ctrl *q, char *names, size_t size)
{
    const uint32_t next = V4L2_CTRL_FLAG_NEXT_CTRL;

    *names = 0;
    for (uint32_t id = next;; id = q->id | next) {
        char here[SST_GRAB_NAME_MAX];

        memset(q, 0, sizeof(*q));
        q->id = id;
        if (node_ioctl(fd, VIDIOC_QUERY_EXT_CTRL, q))
            return -ENOENT;
        if (q->type == V4L2_CTRL_TYPE_CTRL_CLASS || (q->flags & V4L2_CTRL_FLAG_DISABLED))
            continue;
        control_name(here, sizeof(here), q->name);
        if (!strcmp(here, name))
            return 0;
        sst_text_add(names, size, "%s%s", *names ? " " : "", here);
    }
}

static int transfer(int fd, unsigned long request, const struct v4l2_query_ext_ctrl *q, int64_t *value)
{
    struct v4l2_ext_control c = { .id = q->id };
    struct v4l2_ext_controls list = { .which = V4L2_CTRL_WHICH_CUR_VAL, .count = 1, .controls = &c };
    int err;

    if (q->type == V4L2_CTRL_TYPE_INTEGER64)
        c.value64 = *value;
    else
        c.value = (int32_t)*value;
    err = node_ioctl(fd, request, &list);
    if (!err && request == VIDIOC_G_EXT_CTRLS)
        *value = q->type == V4L2_CTRL_TYPE_INTEGER64 ? c.value64 : c.value;
    return err;
}

static bool is_mode(const struct v4l2_query_ext_ctrl *q)
{
    return q->type == V4L2_CTRL_TYPE_BOOLEAN || q->type == V4L2_CTRL_TYPE_MENU ||
           q->type == V4L2_CTRL_TYPE_INTEGER_MENU;
}

/* The first pass sets modes, the second one values. */
static void apply_pass(int fd, const struct sst_grab_control *control, int count, bool modes, char *why, size_t size)
{
    for (int i = 0; i < count; i++) {
        struct v4l2_query_ext_ctrl q;
        int64_t value = control[i].value;
        char names[512];
        int err = find(fd, control[i].name, &q, names, sizeof(names));

        if (err && modes)
            sst_text_add(why, size, "%sunknown control %s (available: %s)", *why ? "; " : "", control[i].name,
                         *names ? names : "none");
        if (err || is_mode(&q) != modes)
            continue;
        if (value < q.minimum || value > q.maximum)
            err = -ERANGE;
        else
            err = transfer(fd, VIDIOC_S_EXT_CTRLS, &q, &value);
        if (err == -ERANGE)
            sst_text_add(why, size, "%s%s cannot be %" PRId64 " (%" PRId64 "..%" PRId64 " step %" PRIu64 ")",
                         *why ? "; " : "", control[i].name, value, (int64_t)q.minimum, (int64_t)q.maximum,
                         (uint64_t)q.step);
        else if (err)
            sst_text_add(why, size, "%s%s cannot be set: %s", *why ? "; " : "", control[i].name, strerror(-err));
    }
}

static void compare(int fd, const struct sst_grab_control *control, int count, char *why, size_t size)
{
    for (int i = 0; i < count; i++) {
        struct v4l2_query_ext_ctrl q;
        char names[512];
        int64_t now = 0;

        if (find(fd, control[i].name, &q, names, sizeof(names)) || control[i].value < q.minimum ||
            control[i].value > q.maximum || (q.flags & V4L2_CTRL_FLAG_WRITE_ONLY))
            continue;
        if (!transfer(fd, VIDIOC_G_EXT_CTRLS, &q, &now) && now != control[i].value)
            sst_text_add(why, size, "%s%s reads back as %" PRId64 ", not %" PRId64, *why ? "; " : "", control[i].name,
                         now, control[i].value);
    }
}

void controls_apply(int fd, const struct sst_grab_control *control, int count, char *why, size_t size)
{
    *why = 0;
    apply_pass(fd, control, count, true, why, size);
    apply_pass(fd, control, count, false, why, size);
    compare(fd, control, count, why, size);
}
