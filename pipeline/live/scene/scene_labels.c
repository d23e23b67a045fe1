#include "pipeline/live/scene/scene_parts.h"

int sst_scene_segment(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label)
{
    return sst_segment_sure(seg, img, label);
}
