/* Controls of a simulated camera, by the rules of the kernel's control framework. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "simulators/devices/camera/camera_internal.h"

#define CLASS_OF(id)     ((id)&0x0fff0000u)
#define CID_TRIGGER_MODE (V4L2_CID_CAMERA_CLASS_BASE + 0x1000)

static const char *const line_menu[] = { "Disabled", "50 Hz", "60 Hz", "Auto" };
static const char *const exposure_menu[] = { NULL, "Manual Mode", NULL, "Aperture Priority Mode" };
static const char *const trigger_menu[] = { "Free Run", "External Edge" };

/* In ascending order of id; enum sim_control_index names some of them. */
static const struct sim_control_def defs[] = {
    { V4L2_CID_USER_CLASS, V4L2_CTRL_TYPE_CTRL_CLASS, "User Controls", 0, 0, 0, 0, NULL },
    { V4L2_CID_BRIGHTNESS, V4L2_CTRL_TYPE_INTEGER, "Brightness", -64, 64, 1, 0, NULL },
    { V4L2_CID_CONTRAST, V4L2_CTRL_TYPE_INTEGER, "Contrast", 0, 64, 1, 32, NULL },
    { V4L2_CID_SATURATION, V4L2_CTRL_TYPE_INTEGER, "Saturation", 0, 128, 1, 64, NULL },
    [SST_SIM_CONTROL_AUTO_WHITE] = { V4L2_CID_AUTO_WHITE_BALANCE, V4L2_CTRL_TYPE_BOOLEAN, "White Balance, Automatic", 0,
                                     1, 1, 1, NULL },
    [SST_SIM_CONTROL_GAIN] = { V4L2_CID_GAIN, V4L2_CTRL_TYPE_INTEGER, "Gain", 10, 400, 1, 100, NULL },
    { V4L2_CID_POWER_LINE_FREQUENCY, V4L2_CTRL_TYPE_MENU, "Power Line Frequency", 0, 3, 1, 1, line_menu },
    [SST_SIM_CONTROL_WHITE] = { V4L2_CID_WHITE_BALANCE_TEMPERATURE, V4L2_CTRL_TYPE_INTEGER, "White Balance Temperature",
                                2800, 6500, 10, 4600, NULL },
    { V4L2_CID_CAMERA_CLASS, V4L2_CTRL_TYPE_CTRL_CLASS, "Camera Controls", 0, 0, 0, 0, NULL },
    [SST_SIM_CONTROL_AUTO_EXPOSURE] = { V4L2_CID_EXPOSURE_AUTO, V4L2_CTRL_TYPE_MENU, "Auto Exposure", 0, 3, 1, 3,
                                        exposure_menu },
    [SST_SIM_CONTROL_EXPOSURE] = { V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CTRL_TYPE_INTEGER, "Exposure Time, Absolute", 1,
                                   5000, 1, 50, NULL },
    [SST_SIM_CONTROL_TRIGGER] = { CID_TRIGGER_MODE, V4L2_CTRL_TYPE_MENU, "Trigger Mode", 0, 1, 1, 0, trigger_menu },
};
#define COUNT ((int)ARRAY_LEN(defs))
_Static_assert(ARRAY_LEN(defs) <= SST_SIM_CAM_CONTROLS, "room for the controls");

void sim_cam_controls_reset(struct sim_cam *cam)
{
    for (int i = 0; i < COUNT; i++)
        cam->control[i] = defs[i].value;
}

int sim_cam_control_find(uint32_t id)
{
    for (int i = 0; i < COUNT; i++)
        if (defs[i].id == id)
            return i;
    return -1;
}

/* A value under automatic control is inactive. */
static uint32_t flags_of(const struct sim_cam *cam, int i)
{
    if (defs[i].type == V4L2_CTRL_TYPE_CTRL_CLASS)
        return V4L2_CTRL_FLAG_READ_ONLY | V4L2_CTRL_FLAG_WRITE_ONLY;
    if ((i == SST_SIM_CONTROL_WHITE && cam->control[SST_SIM_CONTROL_AUTO_WHITE]) ||
        (i == SST_SIM_CONTROL_EXPOSURE && cam->control[SST_SIM_CONTROL_AUTO_EXPOSURE] != V4L2_EXPOSURE_MANUAL))
        return V4L2_CTRL_FLAG_INACTIVE;
    return i == SST_SIM_CONTROL_AUTO_WHITE || i == SST_SIM_CONTROL_AUTO_EXPOSURE ? V4L2_CTRL_FLAG_UPDATE : 0;
}

void sim_cam_control_state(const struct sim_cam *cam, int control, uint32_t changes, struct v4l2_event *out)
{
    const struct sim_control_def *d = &defs[control];

    out->type = V4L2_EVENT_CTRL;
    out->id = d->id;
    out->u.ctrl = (struct v4l2_event_ctrl){ .changes = changes,
                                            .type = d->type,
                                            .value = cam->control[control],
                                            .flags = flags_of(cam, control),
                                            .minimum = d->min,
                                            .maximum = d->max,
                                            .step = d->step,
                                            .default_value = d->value };
}

/* --- queries ------------------------------------------------------------------------------------------------------ */

/* Resolve an id with "next" flags to a control, or -1. */
static int find_query(uint32_t id)
{
    const uint32_t next = V4L2_CTRL_FLAG_NEXT_CTRL | V4L2_CTRL_FLAG_NEXT_COMPOUND;

    if (!(id & next))
        return sim_cam_control_find(id);
    if (!(id & V4L2_CTRL_FLAG_NEXT_CTRL))
        return -1; /* there are no compound ones */
    for (int i = 0; i < COUNT; i++)
        if (defs[i].id > (id & ~next))
            return i;
    return -1;
}

static int query(const struct sim_cam *cam, struct v4l2_query_ext_ctrl *q)
{
    const int i = find_query(q->id);
    const struct sim_control_def *d = &defs[i < 0 ? 0 : i];

    if (i < 0)
        return -EINVAL;
    *q = (struct v4l2_query_ext_ctrl){ .id = d->id,
                                       .type = d->type,
                                       .minimum = d->min,
                                       .maximum = d->max,
                                       .step = (uint64_t)d->step,
                                       .default_value = d->value,
                                       .flags = flags_of(cam, i) };
    (void)snprintf(q->name, sizeof(q->name), "%s", d->name);
    if (d->type != V4L2_CTRL_TYPE_CTRL_CLASS) {
        q->elem_size = sizeof(int32_t);
        q->elems = 1;
    }
    return 0;
}

static int query_short(const struct sim_cam *cam, struct v4l2_queryctrl *q)
{
    struct v4l2_query_ext_ctrl e = { .id = q->id };

    if (query(cam, &e))
        return -EINVAL;
    *q = (struct v4l2_queryctrl){ .id = e.id,
                                  .type = e.type,
                                  .minimum = (int32_t)e.minimum,
                                  .maximum = (int32_t)e.maximum,
                                  .step = (int32_t)e.step,
                                  .default_value = (int32_t)e.default_value,
                                  .flags = e.flags };
    memcpy(q->name, e.name, sizeof(q->name));
    return 0;
}

static int query_menu(struct v4l2_querymenu *q)
{
    const int i = sim_cam_control_find(q->id);

    if (i < 0 || !defs[i].menu || q->index > (uint32_t)defs[i].max || !defs[i].menu[q->index])
        return -EINVAL;
    *q = (struct v4l2_querymenu){ .id = q->id, .index = q->index };
    (void)snprintf((char *)q->name, sizeof(q->name), "%s", defs[i].menu[q->index]);
    return 0;
}

/* --- values ------------------------------------------------------------------------------------------------------- */

/* Clamp a value to the control's range, as the kernel does. @return 0, -ERANGE or -EINVAL (menus) */
static int fit(const struct sim_control_def *d, int32_t *value)
{
    if (d->type == V4L2_CTRL_TYPE_BOOLEAN) {
        *value = *value != 0;
    } else if (d->menu) {
        if (*value < d->min || *value > d->max)
            return -ERANGE;
        if (!d->menu[*value])
            return -EINVAL;
    } else {
        const int64_t steps = ((int64_t)sst_clamp_int(*value, d->min, d->max) - d->min + d->step / 2) / d->step;

        *value = sst_min_int((int32_t)(d->min + steps * d->step), d->max);
    }
    return 0;
}

/* Set a validated value. */
static void apply(struct sim_cam *cam, const struct sim_open *by, int i, int32_t value)
{
    int other = -1;

    if (cam->control[i] == value || sim_cam_fault(cam, SST_SIM_FAULT_CONTROL_STUCK) > 0)
        return;
    cam->control[i] = value;
    sim_cam_control_event(cam, by, i, V4L2_EVENT_CTRL_CH_VALUE);
    if (i == SST_SIM_CONTROL_AUTO_WHITE)
        other = SST_SIM_CONTROL_WHITE;
    if (i == SST_SIM_CONTROL_AUTO_EXPOSURE)
        other = SST_SIM_CONTROL_EXPOSURE;
    if (other >= 0)
        sim_cam_control_event(cam, NULL, other, V4L2_EVENT_CTRL_CH_FLAGS);
    if (i == SST_SIM_CONTROL_TRIGGER)
        sim_cam_retime(cam);
}

static int get_short(const struct sim_cam *cam, struct v4l2_control *c)
{
    const int i = sim_cam_control_find(c->id);

    if (i < 0)
        return -EINVAL;
    if (flags_of(cam, i) & V4L2_CTRL_FLAG_WRITE_ONLY)
        return -EACCES;
    c->value = cam->control[i];
    return 0;
}

static int set_short(struct sim_cam *cam, const struct sim_open *by, struct v4l2_control *c)
{
    const int i = sim_cam_control_find(c->id);
    int err;

    if (i < 0)
        return -EINVAL;
    if (flags_of(cam, i) & V4L2_CTRL_FLAG_READ_ONLY)
        return -EACCES;
    err = fit(&defs[i], &c->value);
    if (!err)
        apply(cam, by, i, c->value);
    return err;
}

/* --- extended controls -------------------------------------------------------------------------------------------- */

/* Index of a control that check_ids() has validated. */
static int place_of(const struct v4l2_ext_control *c)
{
    return sst_max_int(sim_cam_control_find(c->id), 0);
}

static bool get_only(uint32_t which)
{
    return which == V4L2_CTRL_WHICH_DEF_VAL;
}

/* Check that all controls exist and belong to the requested class. @return 0, or -EINVAL with *bad set to the first
 * invalid one */
static int check_ids(const struct v4l2_ext_controls *c, const struct v4l2_ext_control *list, uint32_t *bad)
{
    const bool classed = c->which != V4L2_CTRL_WHICH_CUR_VAL && !get_only(c->which);

    if (!c->count)
        return classed && sim_cam_control_find(c->which | 1) < 0 ? -EINVAL : 0;
    for (*bad = 0; *bad < c->count; ++*bad)
        if (sim_cam_control_find(list[*bad].id) < 0 || (classed && CLASS_OF(list[*bad].id) != c->which))
            return -EINVAL;
    return 0;
}

static int get_several(const struct sim_cam *cam, struct v4l2_ext_controls *c, struct v4l2_ext_control *list)
{
    uint32_t bad;
    const int err = check_ids(c, list, &bad);

    c->error_idx = c->count;
    if (err)
        return err;
    for (uint32_t n = 0; n < c->count; n++)
        if (flags_of(cam, place_of(&list[n])) & V4L2_CTRL_FLAG_WRITE_ONLY)
            return -EACCES;
    for (uint32_t n = 0; n < c->count; n++) {
        const int i = place_of(&list[n]);

        list[n].value = get_only(c->which) ? defs[i].value : cam->control[i];
    }
    return 0;
}

/* All controls are checked before any is set. error_idx is the invalid one; for S_EXT_CTRLS it only means that none
 * was set. */
static int set_several(struct sim_cam *cam, const struct sim_open *by, struct v4l2_ext_controls *c,
                       struct v4l2_ext_control *list, bool set)
{
    uint32_t bad = c->count;
    int err = get_only(c->which) ? -EINVAL : check_ids(c, list, &bad);

    for (uint32_t n = 0; !err && n < c->count; n++) {
        const int i = place_of(&list[n]);
        int32_t value = list[n].value;

        bad = n;
        err = flags_of(cam, i) & V4L2_CTRL_FLAG_READ_ONLY ? -EACCES : fit(&defs[i], &value);
        list[n].value = value;
    }
    c->error_idx = err && !set ? bad : c->count;
    for (uint32_t n = 0; !err && set && n < c->count; n++)
        apply(cam, by, place_of(&list[n]), list[n].value);
    return err;
}

static int several(struct sim_cam *cam, const struct sim_open *by, struct sim_request *r)
{
    struct v4l2_ext_controls *c = (struct v4l2_ext_controls *)r->data;
    struct v4l2_ext_control *list = (struct v4l2_ext_control *)(r->data + sizeof(*c));
    const size_t bytes = sizeof(*c) + c->count * sizeof(*list);

    if (r->bytes < bytes || c->count > V4L2_CID_MAX_CTRLS)
        return -EINVAL;
    c->reserved[0] = 0;
    r->out_bytes = (uint32_t)bytes; /* copied back on failure too: error_idx */
    if (c->which == V4L2_CTRL_WHICH_REQUEST_VAL) {
        c->error_idx = c->count;
        return -EINVAL;
    }
    if (r->call.cmd == VIDIOC_G_EXT_CTRLS)
        return get_several(cam, c, list);
    return set_several(cam, by, c, list, r->call.cmd == VIDIOC_S_EXT_CTRLS);
}

int sim_cam_controls_ioctl(struct sim_cam *cam, struct sim_open *o, struct sim_request *r)
{
    void *a = r->data;

    switch (r->call.cmd) {
    case VIDIOC_QUERYCTRL:
        return query_short(cam, a);
    case VIDIOC_QUERY_EXT_CTRL:
        return query(cam, a);
    case VIDIOC_QUERYMENU:
        return query_menu(a);
    case VIDIOC_G_CTRL:
        return get_short(cam, a);
    case VIDIOC_S_CTRL:
        return set_short(cam, o, a);
    case VIDIOC_G_EXT_CTRLS:
    case VIDIOC_S_EXT_CTRLS:
    case VIDIOC_TRY_EXT_CTRLS:
        return several(cam, o, r);
    default:
        return -ENOTTY;
    }
}
