/* The strict YAML reader: trees with places, typed values, every fault with line and column, limits. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/yaml.h"
#include "tests/test.h"

static char said[SST_LOG_MAX]; /* the last error */

static int parse(struct sst_yaml **doc, const char *text)
{
    char *before = sst_log_hold_errors(said);
    const int err = sst_yaml_parse(doc, text, strlen(text), "t.yaml");

    sst_log_hold_errors(before);
    return err;
}

static int finish(struct sst_yaml *doc)
{
    char *before = sst_log_hold_errors(said);
    const int err = sst_yaml_finish(doc);

    sst_log_hold_errors(before);
    sst_yaml_destroy(doc);
    return err;
}

static void a_tree_has_places_and_typed_values(void **state SST_UNUSED)
{
    static const char *const colours[] = { "rgb", "bgr" };
    struct sst_yaml *doc;
    struct sst_yaml_node *root, *inner;
    double d = 0, three[3] = { 0 };
    char text[8] = "";
    bool yes = false;
    int n = 0, c = 0;

    assert_int_equal(parse(&doc, "# first\nn: -12\nd: 1.5e2\nyes: true\ninner:\n  text: 'a: b'\n  colour: bgr\n"
                                 "list: [1, .5,\n  -2]\nall: 7\n"),
                     0);
    root = sst_yaml_root(doc);
    assert_true(sst_yaml_int(doc, sst_yaml_get(root, "n"), -12, 0, &n) && n == -12);
    assert_true(sst_yaml_double(doc, sst_yaml_get(root, "d"), 0, 150, &d) && d == 150);
    assert_true(sst_yaml_bool(doc, sst_yaml_get(root, "yes"), &yes) && yes);
    inner = sst_yaml_need(doc, root, "inner");
    assert_true(sst_yaml_string(doc, sst_yaml_get(inner, "text"), text, sizeof(text)));
    assert_string_equal(text, "a: b");
    assert_int_equal(sst_yaml_get(inner, "text")->line, 6);
    assert_int_equal(sst_yaml_get(inner, "text")->column, 9);
    assert_true(sst_yaml_choice(doc, sst_yaml_get(inner, "colour"), colours, 2, &c) && c == 1);
    assert_true(sst_yaml_doubles(doc, sst_yaml_get(root, "list"), -2, 2, three, 3));
    assert_true(three[0] == 1 && three[1] == 0.5 && three[2] == -2);
    assert_int_equal(sst_yaml_get(root, "list")->last->line, 9);
    assert_true(sst_yaml_doubles(doc, sst_yaml_get(root, "all"), 0, 9, three, 3));
    assert_true(three[0] == 7 && three[2] == 7);
    /* a missing key keeps its default and is no fault */
    assert_false(sst_yaml_int(doc, sst_yaml_get(root, "none"), 0, 1, &n));
    assert_int_equal(n, -12);
    assert_int_equal(finish(doc), 0);
}

/* Each is one fault, at one place. */
static void faults_name_their_place(void **state SST_UNUSED)
{
    static const struct {
        const char *text, *said;
    } bad[] = {
        { "v: nan\n", "t.yaml:1:4: v must be a number in 0..10, not nan" },
        { "v: inf\n", "1:4: v must be a number" },
        { "v: 0x5\n", "1:4: v must be a number" },
        { "v: \"5\"\n", "1:4: v must be a number in 0..10, not \"5\"" },
        { "v: 11\n", "1:4: v must be a number" },
        { "v: 1e999\n", "1:4: v must be a number" },
        { "v:\n", "v must be a number in 0..10, not an empty value" },
        { "v: [1]\n", "1:4: v must be a number in 0..10, not a list" },
        { "v: {}\n", "1:4: v must be a number in 0..10, not a mapping" },
        { "v: 1\n\nw: 2\n", "3:1: unknown key `w`" },
        { "v: 1\nv: 2\n", "2:1: duplicate key `v`, first in line 1" },
        { "w: 1\n", "1:1: unknown key `w`" },
    };
    struct sst_yaml *doc;
    double v;

    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        v = -1;
        assert_int_equal(parse(&doc, bad[i].text), 0);
        sst_yaml_double(doc, sst_yaml_get(sst_yaml_root(doc), "v"), 0, 10, &v);
        assert_int_equal(finish(doc), -EBADMSG);
        assert_contains(said, bad[i].said);
        assert_true(v == -1 || strstr(bad[i].said, "unknown key") || strstr(bad[i].said, "duplicate key"));
    }
    assert_int_equal(parse(&doc, "w: 1\n"), 0);
    assert_null(sst_yaml_need(doc, sst_yaml_root(doc), "v"));
    sst_yaml_know_all(sst_yaml_root(doc));
    assert_int_equal(finish(doc), -EBADMSG);
    assert_contains(said, "1:1: lacks the key `v`");
    assert_int_equal(parse(&doc, "n: 2147483648\nm: 1.0\n"), 0);
    for (int n = 5, i = 0; i < 2; i++)
        assert_false(sst_yaml_int(doc, sst_yaml_get(sst_yaml_root(doc), i ? "m" : "n"), 0, 9, &n) || n != 5);
    assert_int_equal(finish(doc), -EBADMSG);
    assert_contains(said, "2:4: m must be a whole number in 0..9, not 1.0"); /* the last of the two */
}

/* A section that is there twice is one fault: the contents of the second are ignored. */
static void a_second_section_is_one_fault(void **state SST_UNUSED)
{
    static const char *const bad[] = { "web: { port: 1 }\nweb: { port: 2 }\n",
                                       "web: { port: 1 }\nweb: { prot: 2, address: { a: b } }\n",
                                       "web:\n  port: 1\nweb: [ { port: 2 } ]\n" };
    struct sst_yaml *doc;
    int n = 0;

    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        assert_int_equal(parse(&doc, bad[i]), 0);
        assert_true(sst_yaml_int(doc, sst_yaml_get(sst_yaml_get(sst_yaml_root(doc), "web"), "port"), 0, 9, &n));
        assert_int_equal(n, 1);
        assert_int_equal(finish(doc), -EBADMSG);
        assert_contains(said, "duplicate key `web`, first in line 1"); /* the last that was said */
    }
}

/* A wrong key is answered with the one that was most likely meant, if any is near. */
static void wrong_keys_are_answered_with_the_right_ones(void **state SST_UNUSED)
{
    static const struct {
        const char *key, *said;
    } wrong[] = {
        { "colz", "unknown key `colz`; did you mean `cols`?" },
        { "camera", "unknown key `camera`; did you mean `cameras`?" },
        { "clos", "unknown key `clos`; did you mean `cols`?" },    /* two exchanged */
        { "rate", "unknown key `rate`; did you mean `rate_hz`?" }, /* no unit */
        { "spacing_m", "unknown key `spacing_m`; did you mean `spacing_mm`?" },
        { "rows2x", "unknown key `rows2x`; correct its spelling" }, /* rows is there already */
        { "bandwidth", "unknown key `bandwidth`; correct its spelling or remove it" },
        { "c", "unknown key `c`; correct its spelling or remove it" },
    };

    for (size_t i = 0; i < ARRAY_LEN(wrong); i++) {
        static const char *const known[] = { "rows", "cols", "cameras", "rate_hz", "spacing_mm", "cols" };
        struct sst_yaml *doc;
        char text[64];

        snprintf(text, sizeof(text), "rows: 1\n%s: 1\n", wrong[i].key);
        assert_int_equal(parse(&doc, text), 0);
        for (size_t k = 0; k < ARRAY_LEN(known); k++)
            sst_yaml_get(sst_yaml_root(doc), known[k]);
        assert_int_equal(finish(doc), -EBADMSG);
        assert_contains(said, wrong[i].said);
    }
}

/* Faults that end the reading. */
static void what_is_not_plain_yaml_is_refused(void **state SST_UNUSED)
{
    static const struct {
        const char *text, *said;
    } bad[] = {
        { "a: &x 1\nb: *x\n", "1:4: an anchor" },
        { "a: 1\nb: *x\n", "2:4: an alias" },
        { "a: !!int 1\n", "1:4: an anchor (&name) or a tag" },
        { "? [a]\n: 1\n", "1:3: a key that is a list" },
        { "a: 1\n---\nb: 1\n", "2:1: a second document" },
        { "a: \"x\\ny\"\n", "1:4: a text with a line break" },
        { "a: \"x\\0y\"\n", "1:4: a text with a line break" },
        { "a: [1\nb: 2\n", "invalid YAML" },
        { "a: 1\n\tb: 2\n", "2:1: invalid YAML" },
        { "\x80\x80", "invalid YAML" },
        { "[[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]]\n", "1:17: nested deeper" },
    };
    struct sst_yaml *doc = NULL;
    char *large = malloc(SST_YAML_MAX_BYTES + 2);

    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        assert_int_equal(parse(&doc, bad[i].text), -EBADMSG);
        assert_contains(said, bad[i].said);
    }
    assert_non_null(large);
    memset(large, '#', SST_YAML_MAX_BYTES + 1);
    large[SST_YAML_MAX_BYTES + 1] = 0;
    assert_int_equal(parse(&doc, large), -EBADMSG);
    assert_contains(said, "1 MiB");
    for (size_t i = 0; i < SST_YAML_MAX_BYTES; i += 2)
        memcpy(large + i, i ? "1," : "[ ", 2);
    large[SST_YAML_MAX_BYTES - 2] = 0;
    assert_int_equal(parse(&doc, large), -EBADMSG);
    assert_contains(said, "65536");
    free(large);
    assert_null(doc);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(parse(&doc, i ? "" : "[1, 2]\n"), 0);
        assert_null(sst_yaml_root(doc));
        assert_int_equal(finish(doc), -EBADMSG);
        assert_contains(said, "1:1: the file must contain keys");
    }
}

/* Files of other programs: aliases are copies, long lists are not kept whole. */
static void foreign_files_hold_more(void **state SST_UNUSED)
{
    static const struct {
        const char *text, *said;
    } bad[] = {
        { "a: &x [1, *x]\n", "1:11: an alias (*name) inside of its own value" },
        { "a: *x\n", "1:4: an alias (*name) of a value that is not kept" },
        { "a: &x 1\n*x : 2\n", "2:1: an alias as a key" },
        { "a: &x {b: 1}\nc:\n  <<: *x\n", "3:3: a merge key" },
        { "a: !!int 1\n", "1:4: an anchor (&name) or a tag" },
        { "a: &a [x, x, x, x, x, x, x, x, x]\nb: &b [*a, *a, *a, *a, *a, *a, *a, *a, *a]\nc: &c [*b, *b, *b, *b, *b, "
          "*b, *b, *b, "
          "*b]\nd: &d [*c, *c, *c, *c, *c, *c, *c, *c, *c]\ne: &e [*d, *d, *d, *d, *d, *d, *d, *d, *d]\n",
          "65536" },
    };
    static const char text[] = "a: &x { k: [1, 2], t: \"s\" }\nb: *x\nl: [0, *x, { y: &z 5 }, *z]\n";
    struct sst_yaml_node *root, *n;
    struct sst_yaml *doc;
    double v[2];
    char many[400];
    int i;

    for (size_t k = 0; k < ARRAY_LEN(bad); k++) {
        said[0] = 0;
        sst_log_hold_errors(said);
        assert_int_equal(sst_yaml_parse_foreign(&doc, bad[k].text, strlen(bad[k].text), "t.yaml"), -EBADMSG);
        sst_log_hold_errors(NULL);
        assert_contains(said, bad[k].said);
    }
    assert_int_equal(sst_yaml_parse_foreign(&doc, text, strlen(text), "t.yaml"), 0);
    root = sst_yaml_root(doc);
    n = sst_yaml_get(root, "b");
    assert_true(sst_yaml_doubles(doc, sst_yaml_get(n, "k"), 0, 9, v, 2) && v[1] == 2);
    assert_string_equal(sst_yaml_get(n, "t")->text, "s");
    assert_false(sst_yaml_get(n, "t")->plain);
    assert_int_equal(n->line, 2);
    n = sst_yaml_get(root, "l");
    assert_int_equal(n->count, 4);
    assert_string_equal(n->last->text, "5");
    sst_yaml_destroy(doc);

    strcpy(many, "l: [[1");
    for (i = 1; i < 100; i++)
        strcat(many, i == 50 ? "],[1]" : i < 50 ? ",1" : ",1");
    strcat(many, "]\nk: 1\n");
    assert_int_equal(sst_yaml_parse_foreign(&doc, many, strlen(many), "t.yaml"), 0);
    n = sst_yaml_get(sst_yaml_root(doc), "l");
    assert_int_equal(n->count, 51);
    assert_int_equal(n->first->count, 50);
    i = 0;
    for (n = n->first->first; n; n = n->next)
        i++;
    assert_int_equal(i, SST_YAML_FOREIGN_LIST);
    assert_non_null(sst_yaml_get(sst_yaml_root(doc), "k"));
    sst_yaml_destroy(doc);
}

/* More faults than are shown: the last line counts the rest. */
static void all_faults_are_told(void **state SST_UNUSED)
{
    char text[512] = "";
    struct sst_yaml *doc;

    for (int i = 0; i < 25; i++)
        snprintf(text + strlen(text), sizeof(text) - strlen(text), "k%d: 1\n", i);
    assert_int_equal(parse(&doc, text), 0);
    assert_non_null(sst_yaml_root(doc));
    assert_int_equal(finish(doc), -EBADMSG);
    assert_contains(said, "t.yaml: 5 more faults");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_tree_has_places_and_typed_values),
        cmocka_unit_test(faults_name_their_place),
        cmocka_unit_test(a_second_section_is_one_fault),
        cmocka_unit_test(wrong_keys_are_answered_with_the_right_ones),
        cmocka_unit_test(what_is_not_plain_yaml_is_refused),
        cmocka_unit_test(all_faults_are_told),
        cmocka_unit_test(foreign_files_hold_more),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
