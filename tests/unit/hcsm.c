/* HCSM and the search for its threshold. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/labels/labels.h"
#include "tests/test.h"

/* Entropies below, at and above the threshold, and one that is infinite. */
static void labels_below_the_threshold_are_kept(void **state SST_UNUSED)
{
    const float h[] = { 0.1f, 0.5f, 0.7f, INFINITY };
    struct sst_map_u8 label;
    struct sst_map_f32 entropy;

    assert_int_equal(sst_map_u8_init(&label, 4, 1), 0);
    assert_int_equal(sst_map_f32_init(&entropy, 4, 1), 0);
    memset(label.data, 3, 4);
    memcpy(entropy.data, h, sizeof(h));
    sst_hcsm(&label, &entropy, 0.5);
    assert_memory_equal(label.data, ((const uint8_t[]){ 3, 0, 0, 0 }), 4);
    sst_map_u8_fini(&label);
    sst_map_f32_fini(&entropy);
}

struct maps {
    struct sst_map_u8 label, truth;
    struct sst_map_f32 entropy;
};

static struct maps make_maps(int n, const uint8_t *label, const uint8_t *truth, const float *entropy)
{
    struct maps m;

    assert_int_equal(sst_map_u8_init(&m.label, n, 1), 0);
    assert_int_equal(sst_map_u8_init(&m.truth, n, 1), 0);
    assert_int_equal(sst_map_f32_init(&m.entropy, n, 1), 0);
    memcpy(m.label.data, label, (size_t)n);
    memcpy(m.truth.data, truth, (size_t)n);
    memcpy(m.entropy.data, entropy, (size_t)n * sizeof(float));
    return m;
}

static void free_maps(struct maps *m)
{
    sst_map_u8_fini(&m->label);
    sst_map_u8_fini(&m->truth);
    sst_map_f32_fini(&m->entropy);
}

/* Sorted by entropy: right, right, wrong, right | the background pixel (truth 0) does not count. N = 4, m = 4:
 * 1 pixel 1 * 1/4 = 0.25; 2 pixels 1 * 2/4 = 0.5; 3 pixels (2/3)^4 2/4 = 0.0988; 4 pixels (3/4)^4 3/4 = 0.237.
 * m = 0 is coverage alone: all four. */
static void search_finds_the_hand_worked_threshold(void **state SST_UNUSED)
{
    const uint8_t label[] = { 3, 1, 2, 2, 5 }, truth[] = { 3, 1, 1, 2, 0 };
    const float entropy[] = { 0.2f, 0.1f, 0.4f, 0.8f, 0.3f };
    struct maps m = make_maps(5, label, truth, entropy);
    struct sst_epsilon_result r;

    assert_int_equal(sst_epsilon_search(&r, &m.label, &m.entropy, &m.truth, 4), 0);
    assert_true(fabs(r.score - 0.5) < 1e-12 && r.accuracy == 1 && r.coverage == 0.5);
    assert_true(r.eps_h > (double)0.2f && r.eps_h <= (double)0.4f);
    assert_int_equal(sst_epsilon_search(&r, &m.label, &m.entropy, &m.truth, 0), 0);
    assert_true(r.accuracy == 0.75 && r.coverage == 0.75 && r.eps_h > (double)0.8f);
    free_maps(&m);
}

static void search_refuses_what_has_no_answer(void **state SST_UNUSED)
{
    const uint8_t label[] = { 1, 2 }, wrong[] = { 2, 1 }, none[] = { 0, 0 };
    const float entropy[] = { 0.1f, 0.2f }, nan[] = { 0.1f, NAN };
    struct sst_epsilon_result r = { .eps_h = 42 };
    struct maps m = make_maps(2, label, wrong, entropy);

    assert_int_equal(sst_epsilon_search(&r, &m.label, &m.entropy, &m.truth, 4), -EBADMSG);
    memcpy(m.truth.data, none, 2);
    assert_int_equal(sst_epsilon_search(&r, &m.label, &m.entropy, &m.truth, 4), -EBADMSG);
    memcpy(m.truth.data, label, 2);
    assert_int_equal(sst_epsilon_search(&r, &m.label, &m.entropy, &m.truth, NAN), -EINVAL);
    memcpy(m.entropy.data, nan, sizeof(nan));
    assert_int_equal(sst_epsilon_search(&r, &m.label, &m.entropy, &m.truth, 4), -EBADMSG);
    m.truth.width = 1;
    assert_int_equal(sst_epsilon_search(&r, &m.label, &m.entropy, &m.truth, 4), -EBADMSG);
    assert_true(r.eps_h == 42);
    m.truth.width = 2;
    free_maps(&m);
}

/* a score as the fraction correct^(m+1) / kept^m, exactly: true where a is above b */
static bool above(int a_correct, int a_kept, int b_correct, int b_kept, int m)
{
    unsigned __int128 left = (unsigned)a_correct, right = (unsigned)b_correct;

    for (int i = 0; i < m; i++) {
        left *= (unsigned)a_correct * (unsigned)b_kept;
        right *= (unsigned)b_correct * (unsigned)a_kept;
    }
    return left > right;
}

/* Every threshold that any pixel offers, recounted for each. */
static void brute_force(const struct maps *m, int exponent, int *correct_out, int *kept_out)
{
    int best_correct = 0, best_kept = 1;
    float best_top = INFINITY;

    for (int i = 0; i < m->label.width; i++) {
        int correct = 0, kept = 0;

        for (int k = 0; k < m->label.width; k++) {
            if (!m->truth.data[k] || !m->label.data[k] || m->entropy.data[k] > m->entropy.data[i])
                continue;
            kept++;
            correct += m->label.data[k] == m->truth.data[k];
        }
        if (!kept)
            continue;
        if (above(correct, kept, best_correct, best_kept, exponent) ||
            (!above(best_correct, best_kept, correct, kept, exponent) && m->entropy.data[i] < best_top)) {
            best_correct = correct;
            best_kept = kept;
            best_top = m->entropy.data[i];
        }
    }
    *correct_out = best_correct;
    *kept_out = best_kept;
}

static void search_equals_brute_force_on_data_with_ties(void **state SST_UNUSED)
{
    enum { N = 40 };

    srand(7);
    for (int round = 0; round < 2000; round++) {
        const int levels = 1 + rand() % 30, classes = 1 + rand() % 3, exponent = rand() % 6;
        uint8_t label[N], truth[N];
        float entropy[N];
        struct sst_epsilon_result r;
        struct maps m;
        int correct, kept, labelled = 0, got_kept = 0, got_correct = 0;

        for (int i = 0; i < N; i++) {
            label[i] = (uint8_t)(rand() % 8 ? 1 + rand() % classes : 0);
            truth[i] = (uint8_t)(rand() % 5 ? 1 + rand() % classes : 0);
            entropy[i] = (float)(rand() % levels) * 0.1f;
            labelled += truth[i] != 0;
        }
        m = make_maps(N, label, truth, entropy);
        brute_force(&m, exponent, &correct, &kept);
        assert_int_equal(sst_epsilon_search(&r, &m.label, &m.entropy, &m.truth, exponent), correct ? 0 : -EBADMSG);
        if (correct) {
            assert_true(r.coverage == (double)correct / labelled && r.accuracy == (double)correct / kept);
            sst_hcsm(&m.label, &m.entropy, r.eps_h); /* the threshold keeps just that prefix */
            for (int i = 0; i < N; i++) {
                got_kept += truth[i] && m.label.data[i];
                got_correct += truth[i] && m.label.data[i] == truth[i];
            }
            assert_int_equal(got_kept, kept);
            assert_int_equal(got_correct, correct);
        }
        free_maps(&m);
    }
}

/* Neighbouring floats: the threshold must still lie between them. */
static void search_separates_neighbouring_values(void **state SST_UNUSED)
{
    const float h = 0.1f, up = nextafterf(h, 1);
    const uint8_t label[] = { 1, 1 }, truth[] = { 1, 2 };
    const float entropy[] = { h, up };
    struct maps m = make_maps(2, label, truth, entropy);
    struct sst_epsilon_result r;

    assert_int_equal(sst_epsilon_search(&r, &m.label, &m.entropy, &m.truth, 4), 0);
    assert_true((double)h < r.eps_h && r.eps_h <= (double)up);
    free_maps(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(labels_below_the_threshold_are_kept),
        cmocka_unit_test(search_finds_the_hand_worked_threshold),
        cmocka_unit_test(search_refuses_what_has_no_answer),
        cmocka_unit_test(search_equals_brute_force_on_data_with_ties),
        cmocka_unit_test(search_separates_neighbouring_values),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
