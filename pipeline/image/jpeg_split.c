/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/jpeg_split.h"

#include <errno.h>
#include <setjmp.h>
#include <stdlib.h>

#include "base/mem.h"
#include "base/text.h"
#include "pipeline/image/jpeg_means.h"

struct sst_jpeg_split {
    struct jpeg_decompress_struct d;
    struct jpeg_error_mgr errors;
    jmp_buf escape;
    struct sst_jpeg_means *means;
    struct sst_jpeg_index index;
    struct sst_mem_kept mcus, blocks; /* index; means, which nobody needs here */
    struct sst_jpeg_bytes jpeg;
    struct sst_jpeg_grid grid;
};

static void on_error(j_common_ptr c)
{
    longjmp(((struct sst_jpeg_split *)c->client_data)->escape, 1);
}

static void on_message(j_common_ptr c, int level)
{
    (void)c;
    (void)level;
}

int sst_jpeg_split_create(struct sst_jpeg_split **out)
{
    struct sst_jpeg_split *s = calloc(1, sizeof(*s));

    if (!s)
        return -ENOMEM;
    if (sst_jpeg_means_create(&s->means)) {
        free(s);
        return -ENOMEM;
    }
    s->d.err = jpeg_std_error(&s->errors);
    s->d.client_data = s;
    s->errors.error_exit = on_error;
    s->errors.emit_message = on_message;
    if (setjmp(s->escape)) {
        sst_jpeg_means_destroy(s->means);
        free(s);
        return -ENOMEM;
    }
    jpeg_create_decompress(&s->d);
    *out = s;
    return 0;
}

void sst_jpeg_split_destroy(struct sst_jpeg_split *s)
{
    if (!s)
        return;
    jpeg_destroy_decompress(&s->d);
    sst_jpeg_means_destroy(s->means);
    sst_mem_kept_fini(&s->mcus);
    sst_mem_kept_fini(&s->blocks);
    free(s);
}

/* Memory for the index and means of a picture with this header. */
static int make_room(struct sst_jpeg_split *s, int16_t *means[3])
{
    const size_t across = ((size_t)s->d.image_width + 7) / 8, down = ((size_t)s->d.image_height + 7) / 8;
    size_t blocks = 0;

    for (int i = 0; i < s->d.num_components && i < 3; i++)
        blocks += (size_t)s->d.comp_info[i].width_in_blocks * s->d.comp_info[i].height_in_blocks;
    means[0] = sst_mem_keep(&s->blocks, blocks, sizeof(*means[0]));
    s->index = (struct sst_jpeg_index){ .room = across * down + 1 };
    s->index.mcu = sst_mem_keep(&s->mcus, s->index.room, sizeof(*s->index.mcu));
    if (!means[0] || !s->index.mcu)
        return -ENOMEM;
    for (int i = 1; i < 3 && i < s->d.num_components; i++)
        means[i] =
            means[i - 1] + (size_t)s->d.comp_info[i - 1].width_in_blocks * s->d.comp_info[i - 1].height_in_blocks;
    return 0;
}

/* Cameras begin at an edge of blocks; the last ones may end within one. */
static int check_edges(const struct sst_jpeg_split *s, char *why, size_t size)
{
    const struct sst_jpeg_grid *g = &s->grid;
    const int width = s->index.mcu_width, height = s->index.mcu_height;

    if ((g->cols == 1 || g->width % width == 0) && (g->rows == 1 || g->height % height == 0))
        return 0;
    *why = 0;
    sst_text_add(why, size,
                 "its JPEGs are made of blocks of %dx%d pixels, and cameras of %dx%d do not begin at their edges; set "
                 "cameras: width and height to multiples of them, or another format",
                 width, height, g->width, g->height);
    return -EINVAL;
}

static int read_header(struct sst_jpeg_split *s)
{
    jpeg_mem_src(&s->d, s->jpeg.data, (unsigned long)s->jpeg.bytes);
    (void)jpeg_read_header(&s->d, TRUE);
    return (int)s->d.image_width == s->grid.cols * s->grid.width &&
                   (int)s->d.image_height == s->grid.rows * s->grid.height
               ? 0
               : -EBADMSG;
}

/* May escape. */
static int read_blocks(struct sst_jpeg_split *s, char *why, size_t size)
{
    int16_t *means[3] = { NULL };
    int err = read_header(s);

    err = err ? err : make_room(s, means);
    err = err ? err : sst_jpeg_means_read(s->means, &s->d, means, &s->index);
    if (err == -ENOTSUP) {
        *why = 0;
        sst_text_add(why, size,
                     "its JPEGs are not of the baseline kind (one scan of Huffman code), which alone can be cut into "
                     "cameras; set cameras: format to another one");
        return -EINVAL;
    }
    if (!err && !s->index.valid)
        err = -EBADMSG;
    return err ? err : check_edges(s, why, size);
}

int sst_jpeg_split_read(struct sst_jpeg_split *s, struct sst_jpeg_bytes jpeg, const struct sst_jpeg_grid *grid,
                        char *why, size_t size)
{
    int err;

    s->jpeg = jpeg;
    s->grid = *grid;
    s->index.valid = false;
    if (setjmp(s->escape)) {
        jpeg_abort_decompress(&s->d);
        s->index.valid = false;
        return -EBADMSG;
    }
    err = read_blocks(s, why, size);
    jpeg_abort_decompress(&s->d);
    if (err)
        s->index.valid = false;
    return err;
}

int sst_jpeg_split_cut(struct sst_jpeg_split *s, int part, struct sst_jpeg_bytes *out)
{
    const struct sst_jpeg_grid *g = &s->grid;
    const int width = s->index.mcu_width, height = s->index.mcu_height;
    struct sst_jpeg_part box;
    int x, y, err;

    if (!s->index.valid)
        return -EBADMSG;
    x = part % g->cols * g->width;
    y = part / g->cols * g->height;
    box = (struct sst_jpeg_part){ x / width, y / height, (x + g->width + width - 1) / width,
                                  (y + g->height + height - 1) / height };
    if (setjmp(s->escape)) {
        jpeg_abort_decompress(&s->d);
        return -EBADMSG;
    }
    err = read_header(s);
    err = err ? err
              : sst_jpeg_cut(s->means, &(struct sst_jpeg_frame){ s->jpeg.data, &s->d, &s->index }, &box, &out->data,
                             &out->bytes);
    jpeg_abort_decompress(&s->d);
    return err;
}
