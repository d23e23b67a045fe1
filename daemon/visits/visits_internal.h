/* daemon/visits/visits_internal.h - shared by the files of this folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_VISITS_VISITS_INTERNAL_H
#define SST_DAEMON_VISITS_VISITS_INTERNAL_H

#include <dirent.h>
#include <pthread.h>

#include "base/clock.h"
#include "base/file.h"
#include "daemon/visits/visits.h"

#define VISITS_LINES "visits.jsonl"
#define NAME_LENGTH  63
#define DAY         10                  /* characters of "2026-11-21", which names begin with */
#define WAITING     64                  /* jobs */
#define DAY_MOST    ((size_t)256 << 20) /* bytes of a day's lines */

struct job {
    char name[NAME_LENGTH + 1];
    int picture; /* enum sst_visit_picture; -1: a line */
    uint8_t *data;
    size_t bytes;
};

struct sst_visits {
    char dir[SST_PATH_MAX]; /* fixed after open */
    char start[SST_CLOCK_TEXT];
    pthread_t thread;
    bool failed;   /* writer's: the last file could not be written */
    int64_t bytes; /* under files: of all visits; and whether visits kept for good fill the share: */
    bool full;
    char begun[DAY + 1];   /* writer's: day of the last line */
    char swept[DAY + 1];   /* writer's: days before it have been removed */
    pthread_mutex_t files; /* held while files are written or removed */
    pthread_mutex_t lock;
    pthread_cond_t changed;
    /* under lock */
    struct job job[WAITING];
    int jobs, days;
    int64_t room_bytes; /* 0: the disk's */
    void (*report)(void *arg, int64_t bytes);
    void *report_arg;
    bool limited, relimited; /* there is a share; it is another one, or visits were deleted */
    bool stop, ended, steady; /* steady: is the wall clock */
};

/** Is this the name of a visit? Then it is the beginning of a file's name, too. */
bool visits_is_name(const char *text);

/** Path of a file in the folder of a day, which a name or a day begins with. @param file  NULL: of the folder */
SST_MUST_CHECK int visits_day_path(char out[SST_PATH_MAX], const struct sst_visits *v, const char *name,
                                   const char *file);

/** The days, the newest first. @param out  to free, with its elements @return number */
int visits_days(const struct sst_visits *v, struct dirent ***out);

int64_t visits_file_bytes(const char *path);

/** Endings of the pictures' files, by enum sst_visit_picture. */
extern const char *const visits_picture_files[2];

/** Path of a file of a visit. @param ending  behind its name */
SST_MUST_CHECK int visits_file_path(char out[SST_PATH_MAX], const struct sst_visits *v, const char *visit,
                                    const char *ending);

/** Is a visit kept for good? */
bool visits_is_kept(const struct sst_visits *v, const char *visit);

/** Text of a member; "" where there is none. */
const char *visits_text(const json_t *o, const char *key);

/** The last line of each visit of a day, by name. @return object, or NULL: out of memory */
json_t *visits_read_day(const struct sst_visits *v, const char *day);

/** Reviews of a day: {name: [user]}. @return object, empty without reviews or where the file cannot be read;
 * NULL: out of memory */
json_t *visits_reviewed(const struct sst_visits *v, const char *day);

/** Has a user reviewed it? @param user  NULL: anyone */
bool visits_is_reviewed(const json_t *reviewed, const char *name, const char *user);

/** Note that a user has reviewed visits, or not. Under files. @param names  keys are names of one day @return 0,
 * -EUSERS (some have been reviewed by too many users; the others are noted), or the error of the write */
SST_MUST_CHECK int visits_review(struct sst_visits *v, const json_t *names, const char *user, bool on);

/** Forget reviews of visits that are gone. Under files. */
void visits_forget_reviews(struct sst_visits *v, const char *day, const json_t *gone);

#endif
