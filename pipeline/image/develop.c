/* LibRaw, loaded when it is first used: few captures have raw files. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/develop.h"

#include <errno.h>

#include "base/log.h"

#if WITH_RAW
#include <dlfcn.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include <libraw/libraw.h>

#include "pipeline/image/codec_formats.h"

#define FUNCTIONS(X)                                                                                                   \
    X(libraw_init)                                                                                                     \
    X(libraw_set_dataerror_handler)                                                                                    \
    X(libraw_open_buffer)                                                                                              \
    X(libraw_unpack)                                                                                                   \
    X(libraw_dcraw_process)                                                                                            \
    X(libraw_dcraw_make_mem_image)                                                                                     \
    X(libraw_dcraw_clear_mem)                                                                                          \
    X(libraw_strerror)                                                                                                 \
    X(libraw_close)

static struct {
#define X(name) __typeof__(&(name)) name;
    FUNCTIONS(X)
#undef X
} raw; /* fixed after load() */
static bool loaded;
static pthread_once_t once = PTHREAD_ONCE_INIT;

static void load(void)
{
    void *library = dlopen(SST_RAW_LIBRARY, RTLD_NOW | RTLD_LOCAL);

    if (!library) {
        sst_log_warning("cannot load %s: %s; install the package that has it", SST_RAW_LIBRARY, dlerror());
        return;
    }
    loaded = true;
#define X(name)                                                                                                        \
    *(void **)&raw.name = dlsym(library, #name);                                                                       \
    loaded = loaded && raw.name;
    FUNCTIONS(X)
#undef X
}

bool sst_image_can_develop(void)
{
    pthread_once(&once, load);
    return loaded;
}

static int copy_image(struct sst_image *img, const libraw_processed_image_t *from)
{
    int err;

    if (from->type != LIBRAW_IMAGE_BITMAP || from->bits != 8 || from->colors != 3)
        return -EBADMSG;
    err = sst_image_init(img, from->width, from->height);
    for (int y = 0; !err && y < img->height; y++) {
        const uint8_t *row = from->data + (size_t)y * (size_t)img->width * 3;

        for (int c = 0; c < 3; c++)
            for (int x = 0; x < img->width; x++)
                sst_image_row(img, c, y)[x] = row[3 * x + c];
    }
    return err;
}

#if LIBRAW_MAJOR_VERSION == 0 && LIBRAW_MINOR_VERSION < 22
typedef int offset_type;
#else
typedef INT64 offset_type;
#endif

static void on_fault(void *faults, const char *file SST_UNUSED, const offset_type offset SST_UNUSED)
{
    ++*(int *)faults;
}

/* Nothing is chosen by a picture's content: the views of one camera, equally exposed, stay alike. By LibRaw's defaults
 * highlights are clipped, and noise reduction and corrections of the exposure are off. */
static void set_parameters(libraw_data_t *r)
{
    r->params.use_camera_wb = 1;
    r->params.use_auto_wb = 0;
    r->params.no_auto_bright = 1;
    r->params.adjust_maximum_thr = 0; /* else the brightest sample is white, from 0.75 of the white level on */
    r->params.user_flip = 0;
    r->params.output_color = 1; /* sRGB, with its curve */
    r->params.gamm[0] = 1 / 2.4;
    r->params.gamm[1] = 12.92;
}

/* Where the file has no white balance LibRaw measures one in the picture: instead, daylight's by the camera's
 * matrix. */
static void fix_balance(libraw_data_t *r, const char *name)
{
    static atomic_bool warned;

    if (r->color.cam_mul[0] > 1e-5f && r->color.cam_mul[2] > 1e-5f)
        return;
    r->params.use_camera_wb = 0;
    if (!atomic_exchange(&warned, true))
        sst_log_warning("%s has no white balance of its camera; it, and any other without, gets that of daylight",
                        name);
}

struct file {
    const uint8_t *data;
    size_t size;
    const char *name;
};

/* @param why  out: a clause, or NULL: the error is logged */
static int develop(libraw_data_t *r, struct sst_image *img, const struct file *file, const char **why)
{
    libraw_processed_image_t *picture;
    int err, faults = 0, rc;

    raw.libraw_set_dataerror_handler(r, on_fault, &faults);
    set_parameters(r);
    rc = raw.libraw_open_buffer(r, (void *)file->data, file->size);
    if (!rc && (r->sizes.raw_width > SST_IMAGE_MAX_SIDE || r->sizes.raw_height > SST_IMAGE_MAX_SIDE ||
                (size_t)r->sizes.raw_width * r->sizes.raw_height > SST_IMAGE_MAX_PIXELS))
        return sst_image_size_error(-EINVAL, file->name, r->sizes.raw_width, r->sizes.raw_height);
    rc = rc ? rc : raw.libraw_unpack(r);
    if (!rc && faults) /* it is unpacked as far as it goes */
        rc = LIBRAW_IO_ERROR;
    *why = rc ? raw.libraw_strerror(rc) : "its samples are floating-point numbers";
    if (!rc && r->color.fmaximum > 0) /* LibRaw scales them by the largest */
        return -EBADMSG;
    if (!rc) {
        fix_balance(r, file->name);
        rc = raw.libraw_dcraw_process(r);
        *why = raw.libraw_strerror(rc);
    }
    if (rc)
        return rc == LIBRAW_UNSUFFICIENT_MEMORY ? -ENOMEM : -EBADMSG;
    picture = raw.libraw_dcraw_make_mem_image(r, &rc);
    *why = rc ? raw.libraw_strerror(rc) : "no picture of three colours";
    err = picture ? copy_image(img, picture) : -EBADMSG;
    if (picture)
        raw.libraw_dcraw_clear_mem(picture);
    return err;
}

int sst_image_develop(struct sst_image *img, const uint8_t *data, size_t size, const char *name)
{
    libraw_data_t *r = sst_image_can_develop() ? raw.libraw_init(0) : NULL;
    const char *why = NULL;
    int err;

    if (!loaded) {
        sst_log_error("%s cannot be developed without LibRaw; install it, or use files: raw+jpeg", name);
        return -ENOPKG;
    }
    err = r ? develop(r, img, &(struct file){ data, size, name }, &why) : -ENOMEM;
    if (err == -ENOMEM)
        sst_log_error("%s: not enough memory to develop it", name);
    else if (err && why)
        sst_log_error("%s cannot be developed: %s; it is damaged, or LibRaw does not know its camera", name, why);
    if (r)
        raw.libraw_close(r);
    return err;
}
#else
bool sst_image_can_develop(void)
{
    return false;
}

int sst_image_develop(struct sst_image *img SST_UNUSED, const uint8_t *data SST_UNUSED, size_t size SST_UNUSED,
                      const char *name)
{
    sst_log_error("%s cannot be developed: sst was built without LibRaw; install libraw-dev and build again, or use "
                  "files: raw+jpeg",
                  name);
    return -ENOPKG;
}
#endif
