/* Raw frames of views, some of them files that are decoded when they are needed. */
#include <errno.h>

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

    if (v->encoded)
        return sst_image_decode_rgbx(
            &(struct sst_rgbx){ rgbx, stride, lf->calibration->width, lf->calibration->height }, v->encoded,
            v->encoded_bytes, name_of(lf, view));
    sst_image_put_rgbx(rgbx, stride, v->original.plane[0] ? &v->original : &v->image);
    return 0;
}
