/* base/stats: orders, medians and quantiles of hand-worked values; none, one, NaN. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "base/stats.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define NONE ((double)NAN)

static void numbers_sort_upwards_and_nan_last(void **state SST_UNUSED)
{
    double d[] = { 2, NONE, -1, (double)INFINITY, -1, NONE, -(double)INFINITY };
    float f[] = { 1.5f, NAN, -2, 0 };
    int i[] = { 3, -2147483647 - 1, 2147483647, 0 };
    int64_t l[] = { INT64_MAX, 1, INT64_MIN, -1 };

    sst_stats_sort_double(d, 7);
    assert_true(d[0] == -(double)INFINITY && d[1] == -1 && d[2] == -1 && d[3] == 2 && d[4] == (double)INFINITY);
    assert_true(isnan(d[5]) && isnan(d[6]));
    sst_stats_sort_float(f, 4);
    assert_true(f[0] == -2 && f[1] == 0 && f[2] == 1.5f && isnan(f[3]));
    sst_stats_sort_int(i, 4);
    assert_true(i[0] == -2147483647 - 1 && i[1] == 0 && i[2] == 3 && i[3] == 2147483647);
    sst_stats_sort_int64(l, 4);
    assert_true(l[0] == INT64_MIN && l[1] == -1 && l[2] == 1 && l[3] == INT64_MAX);
    sst_stats_sort_double(NULL, 0);
}

static void strings_sort_by_bytes(void **state SST_UNUSED)
{
    char ten[] = "10", nine[] = "9", empty[] = "", upper[] = "B", lower[] = "a";
    char *v[] = { lower, nine, upper, ten, empty };

    sst_stats_sort_strings(v, 5);
    assert_true(v[0] == empty && v[1] == ten && v[2] == nine && v[3] == upper && v[4] == lower);
}

static void the_upper_median_has_rank_half_n(void **state SST_UNUSED)
{
    double odd[] = { 5, 1, 4, 2, 3 }, even[] = { 9, 7, 1, 3 }, same[] = { 2, 2, 2, 2 }, one[] = { 7 };
    double half[] = { NONE, 4, NONE, 3 }, few[] = { 1, NONE, 5, 2, NONE }, all[] = { NONE };
    float f[] = { 9, 7, 1, 3 }, g[] = { NAN, 4, 6 };

    assert_true(sst_stats_upper_median(odd, 5) == 3);
    assert_true(sst_stats_upper_median(even, 4) == 7);
    assert_true(sst_stats_upper_median(same, 4) == 2);
    assert_true(sst_stats_upper_median(one, 1) == 7);
    assert_true(sst_stats_upper_median(NULL, 0) == 0);
    assert_true(sst_stats_upper_median(few, 5) == 5); /* 1, 2, 5, NaN, NaN */
    assert_true(isnan(sst_stats_upper_median(half, 4)));
    assert_true(isnan(sst_stats_upper_median(all, 1)));
    assert_true(sst_stats_upper_median_float(f, 4) == 7);
    assert_true(sst_stats_upper_median_float(g, 3) == 6);
    assert_true(sst_stats_upper_median_float(NULL, 0) == 0);
}

/* Against sorting, for all sizes and many ties. */
static void selection_agrees_with_sorting(void **state SST_UNUSED)
{
    uint64_t seed = 1;

    for (int n = 1; n < 300; n++) {
        double a[300], b[300];
        float f[300];

        for (int i = 0; i < n; i++) {
            const uint64_t r = sst_random_u64(&seed);

            a[i] = b[i] = r % 31 ? (double)(r >> 16 & (n % 2 ? 7u : 0xffffu)) : NONE;
            f[i] = (float)a[i];
        }
        sst_stats_sort_double(b, n);
        if (isnan(b[n / 2])) {
            assert_true(isnan(sst_stats_upper_median(a, n)) && isnan(sst_stats_upper_median_float(f, n)));
            continue;
        }
        assert_true(sst_stats_upper_median(a, n) == b[n / 2]);
        assert_true(sst_stats_upper_median_float(f, n) == (float)b[n / 2]);
    }
}

static void the_median_is_the_mean_of_two(void **state SST_UNUSED)
{
    double odd[] = { 5, 1, 4 }, even[] = { 9, 7, 1, 3 }, two[] = { 1, 2 }, one[] = { -1 }, some[] = { NONE, 1, 2 };
    double far[] = { -1e308, 1e308 };

    assert_true(sst_stats_median(odd, 3) == 4);
    assert_true(sst_stats_median(even, 4) == 5);
    assert_true(sst_stats_median(two, 2) == 1.5);
    assert_true(sst_stats_median(one, 1) == -1);
    assert_true(sst_stats_median(NULL, 0) == 0);
    assert_true(sst_stats_median(some, 3) == 2); /* 1, 2, NaN */
    assert_true(sst_stats_median(far, 1) == -1e308);
}

static void quantiles_have_the_ranks_that_they_name(void **state SST_UNUSED)
{
    double v[] = { 4, 1, 3, 2 }, with[] = { NONE, 1, 2 };
    float f[] = { 4, 1, 3, 2 };
    const int64_t sorted[] = { 1, 2, 3, 4 };

    /* round(share * 3): 0, 1.5 up to 2, 0.45, 2.85, 3 */
    assert_true(sst_stats_quantile(v, 4, 0) == 1 && sst_stats_quantile(v, 4, 0.5) == 3);
    assert_true(sst_stats_quantile(v, 4, 0.15) == 1 && sst_stats_quantile(v, 4, 0.95) == 4);
    assert_true(sst_stats_quantile(v, 4, 1) == 4 && sst_stats_quantile(&(double){ 1 }, 1, 0.7) == 1);
    assert_true(sst_stats_quantile(NULL, 0, 0.5) == 0 && isnan(sst_stats_quantile(with, 3, 1)));
    /* floor(share * 4): 0, 2, 0, 3, 4 cut to 3 */
    assert_true(sst_stats_quantile_float(f, 4, 0) == 1 && sst_stats_quantile_float(f, 4, 0.5) == 3);
    assert_true(sst_stats_quantile_float(f, 4, 0.24) == 1 && sst_stats_quantile_float(f, 4, 0.75) == 4);
    assert_true(sst_stats_quantile_float(f, 4, 1) == 4 && sst_stats_quantile_float(&(float){ 1 }, 1, 1) == 1);
    assert_true(sst_stats_quantile_float(NULL, 0, 0.5) == 0);
    /* ceil(percent * 4 / 100) - 1: 0, 0, 1, 1, 3 */
    assert_int_equal(sst_stats_percentile(sorted, 4, 1), 1);
    assert_int_equal(sst_stats_percentile(sorted, 4, 25), 1);
    assert_int_equal(sst_stats_percentile(sorted, 4, 26), 2);
    assert_int_equal(sst_stats_percentile(sorted, 4, 50), 2);
    assert_int_equal(sst_stats_percentile(sorted, 4, 99), 4);
    assert_int_equal(sst_stats_percentile(sorted, 4, 100), 4);
    assert_int_equal(sst_stats_percentile(sorted, 1, 50), 1);
    assert_int_equal(sst_stats_percentile(NULL, 0, 50), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_sort_upwards_and_nan_last), cmocka_unit_test(strings_sort_by_bytes),
        cmocka_unit_test(the_upper_median_has_rank_half_n),  cmocka_unit_test(selection_agrees_with_sorting),
        cmocka_unit_test(the_median_is_the_mean_of_two),     cmocka_unit_test(quantiles_have_the_ranks_that_they_name),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
