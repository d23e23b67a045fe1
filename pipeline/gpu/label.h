/* pipeline/gpu/label.h - shaders of labels that views exchange: `vote`, the label that most of a few views see on the
 * surface of a pixel; `label_carry`, labels carried to a view that has none; `label_fill`, what is left of it;
 * `label_input`, what a network of colour images reads; `label_grid`, cells from its result; `label_cells`, labels of
 * pixels from them; and `label_keep`, which writes what these and the shaders of refine.h leave into the view, for
 * those that follow.
 *
 * Numbers of the first three are integers, and equal those of process_vote_labels() and process_carry_labels() on every
 * device. label_input, label_grid and label_cells compute in floats what sst_segment() and labels_upsample() do, by
 * their operations in their order, and quotients in whole numbers: the same bytes, but that entropies below 1e-30 may
 * be off by 1e-30 where devices have no smaller numbers than 2^-126. Groups of 32 x 8 pixels.
 */
#ifndef SST_PIPELINE_GPU_LABEL_H
#define SST_PIPELINE_GPU_LABEL_H

#include "pipeline/gpu/check.h"

#define SST_GPU_VOTERS 4

/** A view is uint32_t[2 or 3][height][width], or has some of its rows only. The first plane is that of the shaders of
 * refine.h. */
enum sst_gpu_label_plane {
    SST_GPU_PLANE_LABELS = 0,    /* disparity | label << 16; between votes also the label that was elected << 24 */
    SST_GPU_PLANE_COLOURS = 1,   /* R | G << 8 | B << 16 | valid << 24 */
    SST_GPU_PLANE_ENTROPIES = 2, /* bits of floats */
};

struct sst_gpu_vote {
    int32_t width, height, count;               /* of voters beside the view itself */
    struct sst_gpu_shift shift[SST_GPU_VOTERS]; /* from the view's pixels to the voter's */
    int32_t rows[SST_GPU_VOTERS];               /* of the voter: surfaces of the view are nowhere else in its picture */
};

enum sst_gpu_vote_buffer {
    SST_GPU_VOTE_OWN = 0,
    SST_GPU_VOTE_VOTERS = 1, /* SST_GPU_VOTERS buffers, the nearest view first; those beyond count: any */
    SST_GPU_VOTE_OUT = 5,    /* out, uint32_t[height][width] */
    SST_GPU_VOTE_BUFFERS
};

/** `label_carry`, from the nearest source that shows the surface of a pixel and has a label there; buffers as of
 * `vote`. */
struct sst_gpu_label_carry {
    int32_t width, height, count;
    uint32_t flags; /* enum sst_gpu_carry_flag */
    struct sst_gpu_shift shift[SST_GPU_VOTERS];
    int32_t rows[SST_GPU_VOTERS];
};

enum sst_gpu_carry_flag {
    SST_GPU_CARRY_ENTROPIES = 1, /* of the sources, too, in a second plane of the output, infinite without */
    SST_GPU_CARRY_MORE = 2,      /* pixels that the output has a label of stay as they are */
};

/** `label_fill`: pixels without a label get that of the most similar colour, then of the nearest disparity, among the
 * first labelled pixels in eight directions, up to SST_GPU_FILL_REACH pixels away; without any, that of the labelled
 * pixel to their left or right whose disparity is nearer to theirs. Those that are not valid get none. */
#define SST_GPU_FILL_REACH 64

struct sst_gpu_label_fill {
    int32_t width, height;
};

enum sst_gpu_label_fill_buffer {
    SST_GPU_LABEL_FILL_OWN = 0,
    SST_GPU_LABEL_FILL_FROM = 1, /* uint32_t[height][width] */
    SST_GPU_LABEL_FILL_OUT = 2,  /* out, likewise */
    SST_GPU_LABEL_FILL_BUFFERS
};

/** `label_input`, a pixel of the input an invocation. Tables are those of `label_grid`. */
struct sst_gpu_label_input {
    int32_t width, height, in_width, in_height;
    uint32_t to;                   /* first word of the input, float[3][in_height][in_width] */
    uint32_t across, across_words; /* words of the tables: first one, words a column of the input */
    uint32_t down, down_words;
    uint32_t channel[3]; /* of the view, 0: R, whose sample times `scale` less `shift` a plane holds */
    float scale[3], shift[3];
};

enum sst_gpu_label_input_buffer {
    SST_GPU_LABEL_INPUT_VIEW = 0, /* SST_GPU_PLANE_COLOURS */
    SST_GPU_LABEL_INPUT_TABLES = 1,
    SST_GPU_LABEL_INPUT_TO = 2, /* out */
    SST_GPU_LABEL_INPUT_BUFFERS
};

/**
 * `label_grid`, a cell an invocation. Tables are words; a column or row of the grid has a mean over `first` and the
 * pixels after it, in words: first, number of pixels, their weights as bits of floats. A result that is no probability
 * sets the word `invalid`.
 */
struct sst_gpu_label_grid {
    int32_t width, height, grid_width, grid_height, channels, classes;
    uint32_t from;                 /* first word of the network's result, float[channels][grid_height][grid_width] */
    uint32_t across, across_words; /* words of the tables: first one, words a column */
    uint32_t down, down_words;
    uint32_t class_of, invalid; /* uint32_t[channels]: class that a channel adds to; 0 */
    uint32_t is_probability;    /* else logits */
    float per_temperature;      /* of these */
};

enum sst_gpu_label_grid_buffer {
    SST_GPU_LABEL_GRID_VIEW = 0,   /* SST_GPU_PLANE_COLOURS */
    SST_GPU_LABEL_GRID_TABLES = 1, /* in and out */
    SST_GPU_LABEL_GRID_FROM = 2,
    SST_GPU_LABEL_GRID_CELLS = 3, /* out */
    SST_GPU_LABEL_GRID_BUFFERS
};

/** `label_cells`. A cell is float[classes + 5]: probabilities, 1, its mean R, G, B, and its most probable class + 1 as
 * an uint32_t. */
struct sst_gpu_label_cells {
    int32_t width, height, grid_width, grid_height, classes;
    float limit;        /* labels whose entropy is not below it are 0; not with entropies */
    uint32_t entropies; /* not 0: are wanted, in a second plane of the output */
};

/** A column or row of the view: the cell at or before it, and the weights of the one before, it, and two after it. */
struct sst_gpu_label_place {
    uint32_t first;
    float weight[4];
};

enum sst_gpu_label_cells_buffer {
    SST_GPU_LABEL_CELLS_VIEW = 0, /* SST_GPU_PLANE_COLOURS */
    SST_GPU_LABEL_CELLS_CELLS = 1,
    SST_GPU_LABEL_CELLS_PLACES = 2, /* struct sst_gpu_label_place[width + height] */
    SST_GPU_LABEL_CELLS_OUT = 3,    /* out, uint32_t[height][width]; then bits of floats, likewise */
    SST_GPU_LABEL_CELLS_BUFFERS
};

/** `label_keep`, a pixel an invocation. */
struct sst_gpu_label_keep {
    int32_t width, height;
    uint32_t way;       /* enum sst_gpu_keep */
    uint32_t entropies; /* with SST_GPU_KEEP_WORDS, not 0: of a second plane */
    uint32_t pitch;     /* with SST_GPU_KEEP_BYTES: of a row, a multiple of 4 */
    float limit;        /* with SST_GPU_KEEP_SURE */
};

enum sst_gpu_keep {
    SST_GPU_KEEP_WORDS = 0,   /* labels, a word a pixel; none where the colour is not valid */
    SST_GPU_KEEP_BYTES = 1,   /* labels, a byte a pixel */
    SST_GPU_KEEP_SURE = 2,    /* those of the view whose entropy is below the limit; the others are 0 */
    SST_GPU_KEEP_ELECTED = 3, /* of a vote, a word a pixel: beside those of the view, which others still read */
    SST_GPU_KEEP_TAKEN = 4,   /* those that were elected become those of the view */
};

enum sst_gpu_label_keep_buffer {
    SST_GPU_LABEL_KEEP_VIEW = 0, /* in and out */
    SST_GPU_LABEL_KEEP_FROM = 1, /* not read with SST_GPU_KEEP_SURE, SST_GPU_KEEP_TAKEN: any */
    SST_GPU_LABEL_KEEP_BUFFERS
};

#endif
