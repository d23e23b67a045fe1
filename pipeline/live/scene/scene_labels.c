#include "pipeline/live/scene/scene_internal.h"

int scene_segment(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label)
{
    return sst_segment_sure(seg, img, label);
}
