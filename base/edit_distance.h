/* base/edit_distance.h - edit distance, to suggest the known word nearest to a misspelt one. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_EDIT_DISTANCE_H
#define SST_BASE_EDIT_DISTANCE_H

#include "base/base.h"

#define SST_EDIT_FAR 1000000

/** Number of edits between a misspelt word and a known one: missing, extra, wrong or transposed letters; 1 if only the
 *  unit at the end is missing ("rate" for "rate_hz"); SST_EDIT_FAR: too different. */
int sst_edit_distance(const char *wrong, const char *word);

/** The nearest word of a list that ends in NULL; NULL if all are too different. */
const char *sst_edit_nearest(const char *wrong, const char *const *words);

/** For the message about an unknown word: " did you mean `X`?" of the nearest one, or "". Valid until the thread's next call. */
const char *sst_edit_hint(const char *wrong, const char *const *words);

#endif
