/* base/word.h - which word of those that there are is meant by one that is not there. */
#ifndef SST_BASE_WORD_H
#define SST_BASE_WORD_H

#include "base/base.h"

#define SST_WORD_FAR 1000000

/** How far a wrong word is from one that exists: letters left out, too many, wrong or exchanged with the next; 1 where
 *  it only lacks the unit at the end ("rate" for "rate_hz"); SST_WORD_FAR: farther than slips go. */
int sst_word_distance(const char *wrong, const char *word);

/** The nearest of a list that ends in NULL, or NULL if none is near. */
const char *sst_word_nearest(const char *wrong, const char *const *words);

#endif
