/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/edit_distance.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#define WORD_MAX 60 /* longer ones are not compared */

/* Optimal string alignment. */
static int edits(const char *a, const char *b)
{
    const int n = (int)strlen(a), m = (int)strlen(b);
    int cost[3][WORD_MAX + 1]; /* rows i - 2, i - 1, i, reused in turn */

    for (int j = 0; j <= m; j++)
        cost[0][j] = j;
    for (int i = 1; i <= n; i++) {
        int *now = cost[i % 3];
        const int *last = cost[(i + 2) % 3], *before = cost[(i + 1) % 3];

        now[0] = i;
        for (int j = 1; j <= m; j++) {
            now[j] = sst_min_int(sst_min_int(last[j], now[j - 1]) + 1, last[j - 1] + (a[i - 1] != b[j - 1]));
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                now[j] = sst_min_int(now[j], before[j - 2] + 1);
        }
    }
    return cost[n % 3][m];
}

int sst_edit_distance(const char *wrong, const char *word)
{
    const size_t n = strlen(wrong);
    const bool unit = n > 1 && !strncmp(word, wrong, n) && word[n] == '_';
    const int most = (int)(n < 4 ? n / 2 : n < 9 ? 2 : 3);
    int distance;

    if (n >= WORD_MAX || strlen(word) >= WORD_MAX)
        return SST_EDIT_FAR;
    distance = unit ? 1 : edits(wrong, word);
    return distance <= most ? distance : SST_EDIT_FAR;
}

const char *sst_edit_nearest(const char *wrong, const char *const *words)
{
    const char *best = NULL;
    int least = SST_EDIT_FAR;

    for (; *words; words++) {
        const int distance = sst_edit_distance(wrong, *words);

        if (distance < least) {
            best = *words;
            least = distance;
        }
    }
    return best;
}

const char *sst_edit_hint(const char *wrong, const char *const *words)
{
    static _Thread_local char text[WORD_MAX + 32];
    const char *near = sst_edit_nearest(wrong, words);

    snprintf(text, sizeof(text), near ? " did you mean `%s`?" : "%s", near ? near : "");
    return text;
}
