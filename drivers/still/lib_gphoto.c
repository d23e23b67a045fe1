/* Calls of libgphoto2, each with its errors translated: the part libsst-gphoto.so, which uses nothing of the program.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <gphoto2/gphoto2-camera.h>

#include "drivers/still/still_internal.h"

#define MS 1000000LL

struct still_lib {
    Camera *camera;
    GPContext *context;
    int response_ms;
    int64_t called_ns; /* start of the last call */
    char said[256];
};

static int64_t now_ns(void)
{
    struct timespec t;

    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * (int64_t)1000000000 + t.tv_nsec;
}

/** Of several messages of a call the first one has the cause. */
static void on_error(GPContext *context SST_UNUSED, const char *text, void *data)
{
    struct still_lib *lib = data;

    if (lib->said[0])
        return;
    snprintf(lib->said, sizeof(lib->said), "%s", text);
    lib->said[strcspn(lib->said, "\r\n")] = 0;
}

const char *still_lib_said(const struct still_lib *lib)
{
    return lib ? lib->said : "";
}

/* --- errors ------------------------------------------------------------------------------------------------------- */

/** The camera's response stands only in the library's text: names of ISO 15740's responses. */
static int from_text(const char *said)
{
    static const struct {
        const char *words;
        int err;
    } answers[] = {
        { "Store Full", -ENOMEDIUM }, { "Store Not Available", -ENOMEDIUM }, { "Store Read Only", -ENOMEDIUM },
        { "Device Busy", -EBUSY },    { "Access Denied", -EPERM },           { "Invalid Device Prop", -EPERM },
        { "not supported", -EPERM },  { "Not Supported", -EPERM },
    };

    for (size_t i = 0; i < ARRAY_LEN(answers); i++)
        if (strstr(said, answers[i].words))
            return answers[i].err;
    return -EIO;
}

/** The last call took as long as a time-out. */
static bool was_slow(const struct still_lib *lib)
{
    return now_ns() - lib->called_ns >= lib->response_ms * MS;
}

static int translate(struct still_lib *lib, int result)
{
    if (result >= 0)
        return 0;
    if (!lib->said[0])
        snprintf(lib->said, sizeof(lib->said), "%s", gp_result_as_string(result));
    switch (result) {
    case GP_ERROR_CAMERA_BUSY:
        return -EBUSY;
    case GP_ERROR_TIMEOUT:
        return -ETIMEDOUT;
    case GP_ERROR_NO_SPACE:
        return -ENOMEDIUM;
    case GP_ERROR_NO_MEMORY:
        return -ENOMEM;
    case GP_ERROR_IO_USB_FIND:
    case GP_ERROR_MODEL_NOT_FOUND:
    case GP_ERROR_UNKNOWN_PORT:
        return -ENODEV;
    case GP_ERROR_IO_USB_CLAIM:
    case GP_ERROR_IO_LOCK:
        return -EBUSY;
    case GP_ERROR_NOT_SUPPORTED:
        return -EPERM;
    case GP_ERROR_IO: /* of a time-out as well, in some of its drivers */
        return was_slow(lib) ? -ETIMEDOUT : -EIO;
    default:
        return from_text(lib->said);
    }
}

/** Before each call: earlier messages belong to an earlier one. */
static struct still_lib *fresh(struct still_lib *lib)
{
    lib->said[0] = 0;
    lib->called_ns = now_ns();
    return lib;
}

/* --- open --------------------------------------------------------------------------------------------------------- */

/** Driver of the library for the camera at a port. */
static int find_driver(struct still_lib *lib, GPPortInfoList *ports, const char *port)
{
    CameraAbilitiesList *drivers = NULL;
    CameraList *found = NULL;
    CameraAbilities abilities;
    const char *model = NULL, *path;
    int rc = gp_abilities_list_new(&drivers);

    if (rc >= 0)
        rc = gp_abilities_list_load(drivers, lib->context);
    if (rc >= 0)
        rc = gp_list_new(&found);
    if (rc >= 0)
        rc = gp_abilities_list_detect(drivers, ports, found, lib->context);
    for (int i = 0; rc >= 0 && i < gp_list_count(found) && !model; i++)
        if (gp_list_get_value(found, i, &path) >= 0 && !strcmp(path, port))
            (void)gp_list_get_name(found, i, &model);
    if (rc >= 0 && !model)
        rc = GP_ERROR_MODEL_NOT_FOUND;
    if (rc >= 0)
        rc = gp_abilities_list_lookup_model(drivers, model);
    if (rc >= 0)
        rc = gp_abilities_list_get_abilities(drivers, rc, &abilities);
    if (rc >= 0)
        rc = gp_camera_set_abilities(lib->camera, abilities);
    if (found)
        gp_list_free(found);
    if (drivers)
        gp_abilities_list_free(drivers);
    return rc;
}

static int set_port(struct still_lib *lib, int bus, int address)
{
    GPPortInfoList *ports = NULL;
    GPPortInfo info;
    char port[32];
    int rc = gp_port_info_list_new(&ports);

    snprintf(port, sizeof(port), "usb:%03d,%03d", bus, address);
    if (rc >= 0)
        rc = gp_port_info_list_load(ports);
    if (rc >= 0)
        rc = find_driver(lib, ports, port);
    if (rc >= 0)
        rc = gp_port_info_list_lookup_path(ports, port);
    if (rc >= 0)
        rc = gp_port_info_list_get_info(ports, rc, &info);
    if (rc >= 0)
        rc = gp_camera_set_port_info(lib->camera, info);
    if (ports)
        gp_port_info_list_free(ports);
    return rc;
}

int still_lib_open(struct still_lib **out, int bus, int address, int response_ms)
{
    struct still_lib *lib = calloc(1, sizeof(*lib));
    int rc;

    if (!lib)
        return -ENOMEM;
    lib->response_ms = response_ms;
    lib->context = gp_context_new();
    if (!lib->context) {
        free(lib);
        return -ENOMEM;
    }
    gp_context_set_error_func(lib->context, on_error, lib);
    rc = gp_camera_new(&fresh(lib)->camera);
    if (rc >= 0)
        rc = set_port(lib, bus, address);
    if (rc >= 0)
        rc = gp_camera_init(lib->camera, lib->context);
    if (rc >= 0)
        rc = gp_port_set_timeout(lib->camera->port, response_ms);
    *out = lib;
    return translate(lib, rc);
}

void still_lib_close(struct still_lib *lib)
{
    if (!lib)
        return;
    if (lib->camera) {
        (void)gp_camera_exit(lib->camera, lib->context);
        gp_camera_unref(lib->camera);
    }
    gp_context_unref(lib->context);
    free(lib);
}

/* --- settings ----------------------------------------------------------------------------------------------------- */

static int get_widget(struct still_lib *lib, const char *name, CameraWidget **widget, CameraWidgetType *type)
{
    int rc = gp_camera_get_single_config(fresh(lib)->camera, name, widget, lib->context);

    /* Said of settings that it could not read as well. */
    if (rc == GP_ERROR_BAD_PARAMETERS || rc == GP_ERROR_NOT_SUPPORTED)
        return was_slow(lib) ? -ETIMEDOUT : -ENOENT;
    if (rc < 0)
        return translate(lib, rc);
    rc = gp_widget_get_type(*widget, type);
    if (rc < 0)
        gp_widget_free(*widget);
    return translate(lib, rc);
}

static int read_value(CameraWidget *widget, CameraWidgetType type, struct still_setting *out)
{
    const char *text = NULL;
    float number = 0;
    int on = 0, rc;

    switch (type) {
    case GP_WIDGET_RANGE:
        rc = gp_widget_get_value(widget, &number);
        snprintf(out->value, sizeof(out->value), "%g", (double)number);
        return rc;
    case GP_WIDGET_TOGGLE:
    case GP_WIDGET_DATE:
        rc = gp_widget_get_value(widget, &on);
        snprintf(out->value, sizeof(out->value), "%d", on);
        return rc;
    default:
        rc = gp_widget_get_value(widget, &text);
        snprintf(out->value, sizeof(out->value), "%s", text ? text : "");
        return rc;
    }
}

int still_lib_read(struct still_lib *lib, const char *name, struct still_setting *out)
{
    CameraWidgetType type;
    CameraWidget *widget;
    int err = get_widget(lib, name, &widget, &type);

    if (err)
        return err;
    out->choices = 0;
    err = translate(lib, read_value(widget, type, out));
    if (type == GP_WIDGET_RADIO || type == GP_WIDGET_MENU)
        out->choices = sst_clamp_int(gp_widget_count_choices(widget), 0, STILL_CHOICES);
    for (int i = 0; i < out->choices; i++) {
        const char *text = NULL;

        (void)gp_widget_get_choice(widget, i, &text);
        snprintf(out->choice[i], sizeof(out->choice[i]), "%s", text ? text : "");
    }
    gp_widget_free(widget);
    return err;
}

int still_lib_write(struct still_lib *lib, const char *name, const char *value)
{
    CameraWidgetType type;
    CameraWidget *widget;
    const float number = strtof(value, NULL);
    const int on = atoi(value);
    int rc, err = get_widget(lib, name, &widget, &type);

    if (err)
        return err;
    rc = gp_widget_set_value(widget, type == GP_WIDGET_RANGE    ? (const void *)&number
                                     : type == GP_WIDGET_TOGGLE ? (const void *)&on
                                                                : (const void *)value);
    if (rc >= 0)
        rc = gp_camera_set_single_config(lib->camera, name, widget, lib->context);
    gp_widget_free(widget);
    return translate(lib, rc);
}

int still_lib_storage(struct still_lib *lib, struct sst_still_state *state)
{
    CameraStorageInformation *info = NULL;
    int count = 0;
    const int rc = gp_camera_get_storageinfo(fresh(lib)->camera, &info, &count, lib->context);

    if (rc < 0)
        return rc == GP_ERROR_NOT_SUPPORTED ? 0 : translate(lib, rc);
    /* of the first card: the one that pictures go to */
    if (count > 0 && (info[0].fields & GP_STORAGEINFO_MAXCAPACITY))
        state->card_bytes = (int64_t)info[0].capacitykbytes * 1024;
    if (count > 0 && (info[0].fields & GP_STORAGEINFO_FREESPACEKBYTES))
        state->card_free_bytes = (int64_t)info[0].freekbytes * 1024;
    if (count > 0 && (info[0].fields & GP_STORAGEINFO_FREESPACEIMAGES))
        state->card_pictures = (int)info[0].freeimages;
    free(info);
    return 0;
}

/* --- exposures and files ------------------------------------------------------------------------------------------ */

int still_lib_release(struct still_lib *lib)
{
    return translate(lib, gp_camera_trigger_capture(fresh(lib)->camera, lib->context));
}

int still_lib_event(struct still_lib *lib, int timeout_ms, struct still_path *path)
{
    CameraEventType type = GP_EVENT_UNKNOWN;
    void *data = NULL;
    const int rc = gp_camera_wait_for_event(fresh(lib)->camera, timeout_ms, &type, &data, lib->context);
    int event = STILL_NOTHING;

    if (rc == GP_ERROR) /* an announcement that waited behind others: the camera has no such file any more */
        return STILL_OTHER;
    if (rc < 0)
        return translate(lib, rc);
    if (type == GP_EVENT_FILE_ADDED && data) {
        const CameraFilePath *added = data;

        snprintf(path->folder, sizeof(path->folder), "%.255s", added->folder);
        snprintf(path->name, sizeof(path->name), "%.63s", added->name);
        event = STILL_FILE;
    } else if (type == GP_EVENT_CAPTURE_COMPLETE) {
        event = STILL_COMPLETE;
    } else if (type != GP_EVENT_TIMEOUT) {
        event = STILL_OTHER;
    }
    free(data);
    return event;
}

#define DEPTH_MAX 8

/** Add the files of a folder and its subfolders. @return of the library */
static int list_folder(struct still_lib *lib, const char *folder, int depth, struct still_path **list, int *count)
{
    CameraList *names = NULL;
    const char *name;
    int rc = gp_list_new(&names), n;

    if (rc >= 0)
        rc = gp_camera_folder_list_files(lib->camera, folder, names, lib->context);
    n = rc >= 0 ? gp_list_count(names) : 0;
    if (n > 0) {
        struct still_path *more = realloc(*list, (size_t)(*count + n) * sizeof(*more));

        rc = more ? rc : GP_ERROR_NO_MEMORY;
        *list = more ? more : *list;
    }
    for (int i = 0; rc >= 0 && i < n; i++) {
        rc = gp_list_get_name(names, i, &name);
        if (rc < 0)
            break;
        snprintf((*list)[*count].folder, sizeof((*list)->folder), "%.255s", folder);
        snprintf((*list)[*count].name, sizeof((*list)->name), "%.63s", name);
        ++*count;
    }
    if (rc >= 0)
        rc = gp_list_reset(names);
    if (rc >= 0 && depth < DEPTH_MAX)
        rc = gp_camera_folder_list_folders(lib->camera, folder, names, lib->context);
    n = rc >= 0 ? gp_list_count(names) : 0;
    for (int i = 0; rc >= 0 && i < n; i++) {
        char path[256];

        rc = gp_list_get_name(names, i, &name);
        if (rc >= 0 && snprintf(path, sizeof(path), "%s/%s", folder[1] ? folder : "", name) < (int)sizeof(path))
            rc = list_folder(lib, path, depth + 1, list, count);
    }
    if (names)
        gp_list_free(names);
    return rc;
}

int still_lib_list(struct still_lib *lib, struct still_path **list, int *count)
{
    struct still_path *all = NULL;
    int n = 0;
    const int err = translate(fresh(lib), list_folder(lib, "/", 0, &all, &n));

    if (err) {
        free(all);
        return err;
    }
    *list = all;
    *count = n;
    return 0;
}

int still_lib_size(struct still_lib *lib, const struct still_path *path, size_t *bytes)
{
    CameraFileInfo info = { 0 };
    const int rc = gp_camera_file_get_info(fresh(lib)->camera, path->folder, path->name, &info, lib->context);

    if (rc >= 0)
        *bytes = info.file.fields & GP_FILE_INFO_SIZE ? (size_t)info.file.size : 0;
    return translate(lib, rc);
}

int still_lib_download(struct still_lib *lib, const struct still_path *path, uint8_t **data, size_t *bytes)
{
    CameraFile *file = NULL;
    const char *from = NULL;
    unsigned long size = 0;
    int rc = gp_file_new(&file), err;

    /* The library caches folders and files, damaged downloads included. */
    (void)gp_filesystem_reset(fresh(lib)->camera->fs);
    if (rc >= 0)
        rc = gp_camera_file_get(lib->camera, path->folder, path->name, GP_FILE_TYPE_NORMAL, file, lib->context);
    if (rc >= 0)
        rc = gp_file_get_data_and_size(file, &from, &size);
    err = translate(lib, rc);
    if (!err) {
        uint8_t *copy = malloc(size + 1);

        if (copy) {
            if (size)
                memcpy(copy, from, size);
            *data = copy;
            *bytes = size;
        } else {
            err = -ENOMEM;
        }
    }
    if (file)
        gp_file_unref(file);
    return err;
}

int still_lib_delete(struct still_lib *lib, const struct still_path *path)
{
    return translate(lib, gp_camera_file_delete(fresh(lib)->camera, path->folder, path->name, lib->context));
}
