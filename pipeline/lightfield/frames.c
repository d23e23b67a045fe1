/* Raw frames of views, some of them files that are decoded when they are needed. */
#include <errno.h>

#include "base/log.h"
#include "pipeline/camera/calib.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/lightfield_internal.h"

bool sst_view_has_frame(const struct sst_view *v)
{
    return v->image.plane[0] || v->encoded;
}

/* Name of a view in messages. */
static const char *name_of(const struct sst_lightfield *lf, int view)
{
    return lf->files ? lf->files->view[view].name : "frame";
}

int sst_lightfield_decode_frame(struct sst_image *out, const struct sst_lightfield *lf, int view)
{
    const struct sst_view *v = &lf->views[view];

    return sst_image_decode(out, v->encoded, v->encoded_bytes, name_of(lf, view));
}

int sst_lightfield_put_frame(uint8_t *rgbx, size_t stride, const struct sst_lightfield *lf, int view)
{
    const struct sst_view *v = &lf->views[view];
    const struct sst_calib *calib = lf->calibration;
    struct sst_image decoded = { 0 };
    int err = v->encoded ? sst_lightfield_decode_frame(&decoded, lf, view) : 0;

    if (!err && v->encoded && (decoded.width != calib->width || decoded.height != calib->height)) {
        sst_log_error("%s has %dx%d pixels instead of %dx%d; write it again", name_of(lf, view), decoded.width,
                      decoded.height, calib->width, calib->height);
        err = -EBADMSG;
    }
    if (!err)
        sst_image_put_rgbx(rgbx, stride, v->encoded ? &decoded : v->original.plane[0] ? &v->original : &v->image);
    sst_image_fini(&decoded);
    return err;
}
