/* pipeline/posed/solve/solve_internal.h - declarations shared by the files that find poses. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_SOLVE_SOLVE_INTERNAL_H
#define SST_PIPELINE_POSED_SOLVE_SOLVE_INTERNAL_H

#include "pipeline/camera/numbers.h"
#include "pipeline/posed/solve/opencv_features.h"
#include "pipeline/posed/solve/solve.h"

#define POSES_FEATURES   2500 /* of a picture */
#define POSES_MIN_PAIR   25   /* matches of two pictures that one epipolar geometry explains */
#define POSES_MIN_SIGHTS 12   /* of a placed view */
#define POSES_MANY_VIEWS 30   /* up to here an order of views is sought, above, neighbours */

/* Ideal pixels: of a pinhole with the common focal length, about its principal point; x right, y down. */

/** Two pictures with matches that one epipolar geometry explains. */
struct poses_pair {
    int a, b, count;
    int (*match)[2];      /* [count] features of a and b. Owned. */
    double similarity[4]; /* b = (s -r; r s) a + t in ideal px: s, r, t */
    double share;         /* of matches within 12 px of it */
};

/** A point seen in a view, in ideal pixels. */
struct poses_sight {
    int view, track;
    double x, y;
};

/** Tracks and their sights, by track. */
struct poses_tracks {
    int tracks, sights;
    int *first; /* [tracks + 1] of sight */
    struct poses_sight *sight;
};

/** Poses, points and the shared lens: x = focal a (1 + k1 r2). */
struct poses_model {
    int views, tracks;
    double (*rotation)[9];
    double (*centre)[3];
    double (*point)[3];
    double focal, k1;
};

/** A light field while its poses are found. */
struct poses_scene {
    struct sst_posed *posed;
    const char *dir;
    int views;
    struct cv_features *feature; /* [views] positions in ideal px */
    double (*middle)[2];         /* [views] principal point, px */
    struct poses_pair *pair;
    int pairs;
    bool *linked; /* [views] in the largest group of pictures that match each other */
    int used;     /* views of that group */
    struct poses_tracks few;
    struct poses_model model; /* of `few`, once it is found; unit: mean distance of neighbours */
    double unit_mm;           /* of the model, where poses are given */
    bool line;                /* the views stand on a line */
    bool along;               /* ... in their order, by the centres that are found */
    bool *placed;             /* [views] by sights, or by the rig alone */
    int *order, *named; /* [views] place in the order of names of each view, and the reverse, while views are in another
                           order (poses_scene_arrange()); NULL: views are in the order of names */
    struct sst_posed_view *in_names_order; /* meanwhile, the light field's own array */
    double focal;             /* of ideal px */
    bool focal_known;
    double free_focal; /* by matches alone, where the focal length is known; 0: not found */
    double focal_doubt; /* of the one that was found, relative: how far it may be off; 0: it was given */
    bool lenses; /* ideal px are of the views' own lenses, else of pinholes */
    bool warm;   /* if features find no poses, warm places may refine given ones: failures are not logged */
};

/* --- matches.c ---------------------------------------------------------------------------------------------------- */

/** Levels of a picture as floats, 0 to 255; free() them. */
typedef int poses_levels_fn(void *arg, int view, float **level);

/** Features of all pictures. @return 0 or an error, logged */
SST_MUST_CHECK int poses_scene_detect(struct poses_scene *scene, poses_levels_fn *levels, void *arg, int threads);
/** Matches of the stronger features of all pairs, which are not verified. @param alike  out, [views][views], symmetric,
 *  added to. @return 0 or an error, logged */
SST_MUST_CHECK int poses_scene_compare(const struct poses_scene *scene, int *alike, int threads);
/** Pairs that match, and the group that they link. @return 0 or an error, logged */
SST_MUST_CHECK int poses_scene_match(struct poses_scene *scene, int threads);
/** Levels of a light field's pictures; arg: its struct poses_scene. */
int poses_levels(void *arg, int view, float **level);
/** Forget matches and poses, keep features. */
void poses_scene_unmatch(struct poses_scene *scene);
void poses_scene_fini(struct poses_scene *scene);

/* --- order.c ------------------------------------------------------------------------------------------------------ */

/** Order in which views match the next ones best; the order of names where this matches as well. Views without matches
 *  are the last. @param order  out, [views]. @param alike  [views][views] matches, symmetric. @return 0, -ENOMEM */
SST_MUST_CHECK int poses_order(int *order, const int *alike, int views);
/** Order of placed views along the line on which they stand, with about equal distances. @param order  out, [views]
 *  @return false: they do not */
SST_MUST_CHECK bool poses_line_order(int *order, const struct poses_scene *scene);
/** Bring the views of a scene with features into another order, also once more. @return 0, -ENOMEM */
SST_MUST_CHECK int poses_scene_arrange(struct poses_scene *scene, const int *order);
/** Back to the order of names, with the result, which may be empty. @return 0, -ENOMEM */
SST_MUST_CHECK int poses_scene_restore(struct poses_scene *scene, struct sst_posed_solved *solved);

/* --- descriptors.c ------------------------------------------------------------------------------------------------ */

/** Pairs of features that are each other's best and clearly better than the second: 0.85 of the distances.
 *  @param match  out, room for a's features. @param count  out. @return 0, -ENOMEM */
SST_MUST_CHECK int poses_descriptors_match(const struct cv_features *a, const struct cv_features *b, int (*match)[2],
                                           int *count);

/* --- tracks.c ----------------------------------------------------------------------------------------------------- */

/** Tracks of linked views through their pairs; tracks that see a picture twice are dropped. @return 0, -ENOMEM */
SST_MUST_CHECK int poses_tracks_make(struct poses_tracks *out, const struct poses_scene *scene);
/** The longest tracks, spread over cells of an 8x8 grid of each picture. @param most  tracks. @return 0, -ENOMEM */
SST_MUST_CHECK int poses_tracks_choose(struct poses_tracks *out, const struct poses_tracks *in,
                                       const struct poses_scene *scene, int most);
void poses_tracks_fini(struct poses_tracks *tracks);

/* --- start.c ------------------------------------------------------------------------------------------------------ */

SST_MUST_CHECK int poses_model_init(struct poses_model *model, int views, int tracks);
SST_MUST_CHECK int poses_model_copy(struct poses_model *out, const struct poses_model *in);
void poses_model_fini(struct poses_model *model);

/** Linked views at equal distances on a line, in their order: shifts that differ from the common one are tilts.
 *  @return false: the pictures do not move along a line */
bool poses_start_line(struct poses_model *model, const struct poses_scene *scene);
/** Linked views at one place: shifts are tilts. */
void poses_start_turns(struct poses_model *model, const struct poses_scene *scene);
/** Linked views beside and above each other that look the same way: shifts are motion. */
void poses_start_plane(struct poses_model *model, const struct poses_scene *scene);
/** Points on their first rays, all at one depth. */
void poses_far_points(struct poses_model *model, const struct poses_tracks *tracks);
/** Points where rays of the placed views meet; beside or behind the cameras, on a plane at the usual depth. */
void poses_triangulate(struct poses_model *model, const struct poses_tracks *tracks);
/** The other start that pictures of narrow angle suggest as well: near for far, motion to the other side, tilts that
 *  make up for it. @return false: views are so far apart that there is none; the model may have changed */
bool poses_reverse(struct poses_model *model, const struct poses_tracks *tracks, const bool *linked);
/** Scale the model so that the mean distance of neighbours is one. @return the mean distance before */
double poses_normalise(struct poses_model *model, const bool *linked);
/** Mean distance of neighbours. @param order  [views] indices of views; NULL: as they are */
double poses_spacing(const struct poses_model *model, const bool *linked, const int *order);

/* --- adjust.c ----------------------------------------------------------------------------------------------------- */

/** Prior of a view. */
struct poses_prior {
    double rotation[9], centre[3];
    double sigma_angle, sigma_centre; /* rad and the model's unit; 0: none */
    double axis[3], sigma_axis;       /* about this axis of the world, the angle's is larger: a compass; 0: it is not */
};

struct poses_adjust {
    double sigma_px; /* of Cauchy's loss */
    int rounds;      /* at most */
    int threads;     /* 0: one */
    bool free_focal, free_k1;
    bool still;                      /* centres stay: rotations alone */
    double focal_prior, focal_sigma; /* of the logarithm; 0: none */
    double line_along, line_across;  /* sigma of neighbours' distances on a line, in spacings; 0: no line */
    const struct poses_prior *prior; /* [views], or NULL */
    const bool *linked;              /* [views] */
};

#define POSES_LINE_ALONG  0.05 /* sigma of distances of neighbours on a line, of their mean */
#define POSES_LINE_ACROSS 0.1

/** Adjust views, points and lens to the sights. @param cost  out, the robust loss of the sights alone
 *  @return 0, -ENOMEM */
SST_MUST_CHECK int poses_adjust(struct poses_model *model, const struct poses_tracks *tracks,
                                const struct poses_adjust *how, double *cost);
/** Distance of each sight from its point's projection, px; behind the camera: infinite. @param px  out [sights] */
void poses_residuals(const struct poses_model *model, const struct poses_tracks *tracks, double *px);
double poses_median(const struct poses_model *model, const struct poses_tracks *tracks);

/* --- find.c ------------------------------------------------------------------------------------------------------- */

/** Find the poses of a scene that has been matched: its model and views that are placed. @return 0, -EDOM, -ENOMEM */
SST_MUST_CHECK int poses_find(struct poses_scene *scene, const struct sst_posed_solve_config *cfg);
/** The last adjustments, from wide to narrow, of scene->model; then views that too few sights support are dropped. */
SST_MUST_CHECK int poses_finish(struct poses_scene *scene, const struct poses_adjust *how, double widest_px);

/** Log that features find no poses, unless warm places may do it. @return -EDOM */
int poses_failed(const struct poses_scene *scene, const char *why);

/** @return 0, -EDOM (fewer than two views are placed, which have neither axes nor a unit; logged) */
SST_MUST_CHECK int poses_check_placed(const struct poses_scene *scene);

/* --- rig.c -------------------------------------------------------------------------------------------------------- */

/** Solve scenes of one rig again with the median of their relative poses as a prior; scenes that agree on fewer than
 *  two views stay as they are. @return 0, -EBADMSG, -ENOMEM */
SST_MUST_CHECK int poses_share_rig(struct poses_scene *scene, int count, const struct sst_posed_solve_config *cfg);

/* --- result.c ----------------------------------------------------------------------------------------------------- */

/** Views, points and history of the scene's light field, and figures about it. @return 0, -ENOMEM */
SST_MUST_CHECK int poses_report(struct poses_scene *scene, const struct sst_posed_solve_config *cfg,
                                struct sst_posed_solved *solved);

/* --- skyline.c ---------------------------------------------------------------------------------------------------- */

/** Symmetric matrix, the lower half by rows from the first column that is not 0. */
struct poses_skyline {
    int n;
    int *first;   /* [n] */
    double **row; /* [n] row[i][j] of first[i] <= j <= i */
    double *pool;
};

/** Zeroed. @param first  [n], copied. @return 0, -ENOMEM */
SST_MUST_CHECK int poses_skyline_init(struct poses_skyline *m, const int *first, int n);
void poses_skyline_fini(struct poses_skyline *m);
void poses_skyline_clear(struct poses_skyline *m);
/** Numbers that are stored. */
size_t poses_skyline_size(const struct poses_skyline *m);
/** Add a matrix of the same skyline. */
void poses_skyline_add(struct poses_skyline *to, const struct poses_skyline *m);
/** Cholesky's factor in place. @return false: not positive definite */
bool poses_skyline_factor(struct poses_skyline *m);
/** Solve by the factor. @param x  in: right side; out */
void poses_skyline_substitute(const struct poses_skyline *m, double *x);

#endif
