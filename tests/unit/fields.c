/* A table of fields gives the members of a structure as JSON and as metrics. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "daemon/fields/fields.h"
#include "tests/test.h"

struct cell {
    char name[8];
    uint64_t count[2];
    struct sst_spread ms;
};

struct all {
    bool on, given;
    int level, cells;
    float share[2];
    double rate, unknown;
    const char *word;
    int64_t time_ns;
    struct cell cell[3], *pointer, *null;
};

static const char *const levels[] = { "low", "high" };
static const char *const places[] = { "in", "out" };

#define IN struct cell
static const struct sst_field cell_fields[] = {
    SST_FIELD("name", TEXT, name, "Name"),
    SST_FIELD("", MAP, count, "Things by place", "things_total", .label = "place", SST_FIELD_COUNTS(places)),
    SST_FIELD("ms", SPREAD, ms, "Time", "cell_seconds", .per = 1e3),
    { 0 },
};
#undef IN

#define IN struct all
static const struct sst_field all_fields[] = {
    SST_FIELD("level", CHOICE, level, "Level", "level", .label = "level", SST_FIELD_NAMES(levels)),
    SST_FIELD("word", NAME, word, "Word"),
    SST_FIELD("time", TIME, time_ns, "Time"),
    SST_FIELD_GROUP("group", "Group", SST_FIELD("rate", REAL, rate, "Rate", "rate_hz"),
                    SST_FIELD("unknown", REAL, unknown, "Not known", "unknown"),
                    SST_FIELD(NULL, BOOL, on, "It is on", "on")),
    SST_FIELD_GROUP_IF("absent", given, "Not given", SST_FIELD("level", INTEGER, level, "Level", "given_level")),
    SST_FIELD("share", LIST, share, "Shares", .item = SST_FIELD_REAL, .count = 2, .stride = sizeof(float)),
    SST_FIELD("cells", LIST, cell, "Cells", .label = "cell", .of = cell_fields, .stride = sizeof(struct cell),
              .count_at = offsetof(struct all, cells)),
    SST_FIELD("one", POINTER, pointer, "This", .of = cell_fields),
    SST_FIELD("one", POINTER, null, "Or that", .of = cell_fields),
    { 0 },
};
#undef IN

static struct all example(void)
{
    return (struct all){ .on = true,
                         .level = 1,
                         .cells = 2,
                         .share = { 0.25, 0.75 },
                         .rate = 2.5,
                         .unknown = (double)NAN,
                         .word = "w",
                         .cell = { { "a", { 1, 2 }, { 1, 2, 3, 12, 4 } },
                                   { "b", { 3, 4 }, { (double)NAN, (double)NAN, (double)NAN, (double)NAN, 0 } } } };
}

static void members_are_those_of_the_table(void **state)
{
    const struct all all = example();
    json_t *o = sst_fields_json(all_fields, &all);
    char *text = json_dumps(o, JSON_COMPACT | JSON_REAL_PRECISION(6));

    (void)state;
    assert_string_equal(text,
                        "{\"level\":\"high\",\"word\":\"w\",\"time\":\"\",\"group\":{\"rate\":2.5,\"unknown\":null},"
                        "\"absent\":null,\"share\":[0.25,0.75],\"cells\":["
                        "{\"name\":\"a\",\"in\":1,\"out\":2,\"ms\":{\"p50\":1.0,\"p99\":2.0,\"max\":3.0}},"
                        "{\"name\":\"b\",\"in\":3,\"out\":4,\"ms\":{\"p50\":null,\"p99\":null,\"max\":null}}],"
                        "\"one\":null}");
    free(text);
    json_decref(o);
}

static void metrics_of_one_name_are_together(void **state)
{
    const struct all all = example();
    char *text = NULL;
    size_t size;
    FILE *f = open_memstream(&text, &size);

    (void)state;
    assert_non_null(f);
    sst_fields_metrics(f, all_fields, &all);
    assert_int_equal(fclose(f), 0);
    assert_string_equal(text,
                        "# HELP sst_level Level.\n# TYPE sst_level gauge\n"
                        "sst_level{level=\"low\"} 0\nsst_level{level=\"high\"} 1\n"
                        "# HELP sst_rate_hz Rate.\n# TYPE sst_rate_hz gauge\nsst_rate_hz 2.5\n"
                        "# HELP sst_on It is on.\n# TYPE sst_on gauge\nsst_on 1\n"
                        "# HELP sst_given_level Level.\n# TYPE sst_given_level gauge\nsst_given_level 1\n"
                        "# HELP sst_things_total Things by place.\n# TYPE sst_things_total counter\n"
                        "sst_things_total{cell=\"a\",place=\"in\"} 1\nsst_things_total{cell=\"a\",place=\"out\"} 2\n"
                        "sst_things_total{cell=\"b\",place=\"in\"} 3\nsst_things_total{cell=\"b\",place=\"out\"} 4\n"
                        "# HELP sst_cell_seconds Time.\n# TYPE sst_cell_seconds summary\n"
                        "sst_cell_seconds{cell=\"a\",quantile=\"0.5\"} 0.001\n"
                        "sst_cell_seconds{cell=\"a\",quantile=\"0.99\"} 0.002\n"
                        "sst_cell_seconds{cell=\"a\",quantile=\"1\"} 0.003\n"
                        "sst_cell_seconds_sum{cell=\"a\"} 0.012\nsst_cell_seconds_count{cell=\"a\"} 4\n"
                        "sst_cell_seconds{cell=\"b\",quantile=\"0.5\"} nan\n"
                        "sst_cell_seconds{cell=\"b\",quantile=\"0.99\"} nan\n"
                        "sst_cell_seconds{cell=\"b\",quantile=\"1\"} nan\n"
                        "sst_cell_seconds_count{cell=\"b\"} 0\n");
    free(text);
}

static void text_is_utf8(void **state)
{
    static const struct {
        const char *word, *json;
    } cases[] = { { "caf\xc3\xa9", "caf\xc3\xa9" },
                  { "caf\xc3", "caf" },
                  { "a\xff"
                    "bcde",
                    "?" },
                  { "\xf0\x9f\x98", "" } };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        const struct all all = { .word = cases[i].word };
        json_t *o = sst_fields_json(all_fields, &all);

        assert_string_equal(json_string_value(json_object_get(o, "word")), cases[i].json);
        json_decref(o);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(members_are_those_of_the_table),
        cmocka_unit_test(metrics_of_one_name_are_together),
        cmocka_unit_test(text_is_utf8),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
