/* tests/match_network.h - a small network of features, and light fields that are matched with it. */
#ifndef SST_TESTS_MATCH_NETWORK_H
#define SST_TESTS_MATCH_NETWORK_H

#include <stdio.h>
#include <unistd.h>

#include "tests/match_field.h"
#include "tests/onnx_writer.h"

/* Write one layer of 3x3, whose 64 channels are brought to unit length. @param path  in and out: of mkstemp() */
static inline void match_write_network(char *path)
{
    struct ow_buf graph = { 0 }, attrs = { 0 }, model;
    const int fd = mkstemp(path);
    float w[64 * 9];

    assert_true(fd >= 0);
    for (int i = 0; i < 64 * 9; i++)
        w[i] = (float)(i * 7919 % 101) / 50 - 1;
    ow_floats(&graph, "w", w, 64, 1, 3, 3);
    ow_attr_ints(&attrs, "pads", 4, 1, 1, 1, 1);
    ow_node(&graph, "Conv", "x w", "c", &attrs);
    ow_attr_int(&attrs, "axis", 1);
    ow_attr_int(&attrs, "p", 2);
    ow_node(&graph, "LpNormalization", "c", "y", &attrs);
    ow_value(&graph, 11, "x", 1);
    ow_value(&graph, 12, "y", 64);
    model = ow_model(&graph, 11);
    ow_metadata(&model, "sst.radius", "1");
    assert_int_equal(write(fd, model.p, model.n), (ssize_t)model.n);
    close(fd);
    free(model.p);
}

/* Ways to match with it. @return false: there is none of this number */
static inline bool match_config_learned(struct sst_disparity_config *cfg, int i, const char *path)
{
    assert_true(match_config(cfg, i == 1 ? 4 : 5)); /* in whole pixels, in halves */
    cfg->cost = i == 1 ? SST_COST_MCCNN : SST_COST_BOTH;
    cfg->model = path;
    cfg->precision = SST_PRECISION_F32;
    cfg->key_spacing = 1;
    cfg->rounds = 0;
    cfg->phase_step = i == 0 ? 1 : cfg->phase_step;
    cfg->frugal = i == 2;
    cfg->raw = i == 3;
    return i < 4;
}

#endif
