/* Export to other tools' formats; import_stanford.c and import_hci.c describe them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/edit_distance.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/jpeg_tables.h"
#include "pipeline/lightfield/export_poses.h"
#include "pipeline/lightfield/lightfield_internal.h"

#define SENSOR_MM 35.0  /* HCI expresses the focal length by a sensor size; any value works, this is the benchmark's */
#define FSTOP     100.0 /* everything is sharp */

struct format {
    const char *name, *marker; /* marker: a file that identifies an export of this format */
    unsigned load;
    bool raw; /* exports the files with the cameras that took them, not rectified views */
    sst_work_fn *view;
    int (*rest)(const struct export_job *job);
};

/* --- stanford ----------------------------------------------------------------------------------------------------- */

/* For our own import; the formats have no place for it. */
static void put_off_centre(FILE *f, const struct sst_lightfield *lf)
{
    if (lf->off_centre_px[0] != 0 || lf->off_centre_px[1] != 0)
        fprintf(f, "\n[principal]\noff_centre_x_px = %.17g\noff_centre_y_px = %.17g\n", lf->off_centre_px[0],
                lf->off_centre_px[1]);
}

/* Positions in millimetres, or in spacings if the spacing is unknown. */
static double position_unit(const struct sst_lightfield *lf)
{
    return lf->spacing_mm > 0 ? lf->spacing_mm : 1.0;
}

static int stanford_view(void *arg, int k, int worker SST_UNUSED)
{
    const struct export_job *job = arg;
    const struct sst_view *v = &job->lf.views[k];
    const double unit = position_unit(&job->lf);
    /* Nine significant digits of a spacing in any unit. */
    const int digits = sst_clamp_int(9 - (int)floor(log10(unit)), 6, 18);
    char path[SST_PATH_MAX], name[SST_NAME_MAX];
    struct view_file file = { .data = NULL };
    int err = 0;

    if (!v->present)
        return 0;
    if (!job->lf.calibration)
        err = read_view(&file, &job->lf, k, job->cfg->dir);
    if (err)
        return err;
    snprintf(name, sizeof(name), "out_%02d_%02d_%.*f_%.*f_%s", k / job->lf.cols, k % job->lf.cols, digits,
             v->by * unit, digits, v->bx * unit, file.data ? sst_image_ending(file.data, file.size) : ".png");
    err = sst_path_join(path, job->out, name);
    if (!err)
        err = file.data ? sst_jpeg_write(path, file.data, file.size) : sst_image_write_png(&v->image, path);
    free(file.data);
    return err;
}

static int stanford_rest(const struct export_job *job)
{
    const struct sst_lightfield *lf = &job->lf;
    struct sst_outfile out;
    int err = sst_outfile_open_in(&out, job->out, "positions.cfg");

    if (err)
        return err;
    fprintf(out.stream, "[positions]\nspacing = %.17g\nspacing_mm = %.17g\n", position_unit(lf), lf->spacing_mm);
    if (lf->focal_px > 0)
        fprintf(out.stream, "focal_px = %.17g\n", lf->focal_px);
    if (lf->range_min_px < lf->range_max_px)
        fprintf(out.stream, "disp_min = %.17g\ndisp_max = %.17g\n", lf->range_min_px, lf->range_max_px);
    if (lf->infinity_known)
        fprintf(out.stream, "infinity_px = %.17g\n", lf->infinity_px);
    put_off_centre(out.stream, lf);
    return sst_outfile_commit(&out);
}

/* --- hci ---------------------------------------------------------------------------------------------------------- */

static int hci_disparity(const struct export_job *job, int k, const char *name)
{
    const struct sst_map_u16 *disp = &job->lf.views[k].disp;
    char path[SST_PATH_MAX];
    struct sst_map_f32 map;
    int err = sst_path_join(path, job->out, name);

    err = err ? err : sst_map_f32_init(&map, disp->width, disp->height);
    if (err)
        return err;
    for (int y = 0; y < disp->height; y++) {
        const uint16_t *in = sst_map_u16_row(disp, y);
        float *out = sst_map_f32_row(&map, y);

        for (int x = 0; x < disp->width; x++)
            out[x] = in[x] == SST_DISP_NONE ? INFINITY : (float)sst_disp_px(&job->lf, in[x]);
    }
    err = sst_map_f32_write_pfm(&map, path);
    sst_map_f32_fini(&map);
    return err;
}

/* HCI readers require PNG: other views are decoded, PNG files are copied. */
static int hci_image(const struct export_job *job, int k, const char *path)
{
    struct view_file file;
    struct sst_image img;
    int err;

    if (job->lf.calibration)
        return sst_image_write_png(&job->lf.views[k].image, path);
    err = read_view(&file, &job->lf, k, job->cfg->dir);
    if (err)
        return err;
    if (file.data[0] == 0x89) {
        err = sst_file_write(path, file.data, file.size);
    } else {
        err = sst_image_decode(&img, file.data, file.size, file.path);
        if (!err) {
            err = sst_image_write_png(&img, path);
            sst_image_fini(&img);
        }
    }
    free(file.data);
    return err;
}

static int hci_view(void *arg, int k, int worker SST_UNUSED)
{
    const struct export_job *job = arg;
    char path[SST_PATH_MAX], name[64];
    int err;

    if (!job->lf.views[k].present)
        return 0;
    snprintf(name, sizeof(name), "input_Cam%03d.png", k);
    err = sst_path_join(path, job->out, name);
    err = err ? err : hci_image(job, k, path);
    snprintf(name, sizeof(name), "gt_disp_lowres_Cam%03d.pfm", k);
    return err || !job->lf.views[k].disp.data ? err : hci_disparity(job, k, name);
}

/* HCI cannot express a camera off its grid position; a section of our own records it. */
static void put_offsets(FILE *f, const struct sst_lightfield *lf)
{
    const int ref_row = lf->ref_view / lf->cols, ref_col = lf->ref_view % lf->cols;
    double worst = 0;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const struct sst_view *v = &lf->views[k];
        const double x = v->bx + ref_col, y = v->by + ref_row, off = hypot(x - k % lf->cols, y - k / lf->cols);

        if (!v->present || off == 0)
            continue;
        if (worst == 0)
            fputs("\n[offsets]\n", f);
        fprintf(f, "offset_x_%03d = %.17g\noffset_y_%03d = %.17g\n", k, x, k, y);
        worst = fmax(worst, off);
    }
    if (worst > 0.01)
        sst_log_warning("cameras are up to %.2f spacings off a regular grid, which the HCI format cannot express",
                        worst);
}

/* Principal points of a converging grid are in the middle for a camera in the middle. */
static bool hci_centred(const struct sst_lightfield *lf)
{
    return lf->off_centre_px[0] == ((lf->cols - 1) / 2.0 - lf->ref_view % lf->cols) * lf->infinity_px &&
           lf->off_centre_px[1] == ((lf->rows - 1) / 2.0 - lf->ref_view / lf->cols) * lf->infinity_px;
}

/* Readers need every key of the benchmark, in this form; 0 stands for unknown values. */
static void put_hci(FILE *f, const struct sst_lightfield *lf)
{
    const double fb = lf->focal_px * lf->spacing_mm;
    const bool focus_known = lf->infinity_known && (lf->infinity_px == 0 || fb > 0);
    const double focus_m = !focus_known           ? 0
                           : lf->infinity_px == 0 ? HCI_FOCUS_INFINITE_M
                                                  : -fb / lf->infinity_px / 1000;
    const double lo = lf->range_min_px, hi = lf->range_max_px;

    fprintf(f,
            "[intrinsics]\nfocal_length_mm = %.17g\nimage_resolution_x_px = %d\nimage_resolution_y_px = %d\n"
            "sensor_size_mm = %g\nfstop = %g\n",
            lf->focal_px * SENSOR_MM / sst_max_int(lf->width, lf->height), lf->width, lf->height, SENSOR_MM, FSTOP);
    fprintf(f,
            "\n[extrinsics]\nnum_cams_x = %d\nnum_cams_y = %d\nbaseline_mm = %.17g\nfocus_distance_m = %.17g\n"
            "center_cam_x_m = 0.0\ncenter_cam_y_m = 0.0\ncenter_cam_z_m = 0.0\ncenter_cam_rx_rad = 0.0\n"
            "center_cam_ry_rad = 0.0\ncenter_cam_rz_rad = 0.0\n",
            lf->cols, lf->rows, lf->spacing_mm, focus_m);
    fprintf(f,
            "\n[meta]\nscene = lightfield\ncategory = other\ndate = unknown\nversion = 1\nauthors = unknown\n"
            "contact = unknown\ndisp_min = %.17g\ndisp_max = %.17g\nfrustum_disp_min = %.17g\n"
            "frustum_disp_max = %.17g\ndepth_map_scale = 1.0\n",
            lo, hi, lo, hi);
    put_offsets(f, lf);
    if (!hci_centred(lf))
        put_off_centre(f, lf);
    if (!(lf->focal_px > 0) || !(lf->spacing_mm > 0) || !focus_known)
        sst_log_warning("parameters.cfg has %s%s%s0 for what is not known, so that its readers make no depths of "
                        "disparities; add --focal-px, --spacing-mm, --focus-mm or --infinity-px",
                        lf->focal_px > 0 ? "" : "focal_length_mm ", lf->spacing_mm > 0 ? "" : "baseline_mm ",
                        focus_known ? "" : "focus_distance_m ");
}

static int hci_rest(const struct export_job *job)
{
    const struct sst_lightfield *lf = &job->lf;
    const int centre = lf->rows / 2 * lf->cols + lf->cols / 2;
    struct sst_outfile out;
    int err = sst_outfile_open_in(&out, job->out, "parameters.cfg");

    if (err)
        return err;
    put_hci(out.stream, lf);
    err = sst_outfile_commit(&out);
    return err || !lf->views[centre].disp.data ? err : hci_disparity(job, centre, "gt_disp_lowres.pfm");
}

/* --- colmap, nerfstudio: the files as they are, and the cameras that made them ------------------------------------ */

static void image_name(const struct export_job *job, int view, char out[64])
{
    const char *file = job->lf.files->view[view].name, *dot = strrchr(file, '.');
    char place[16];

    sst_view_name(&job->lf, view, place); /* not the original name: COLMAP allows no blanks */
    snprintf(out, 64, "%s%.8s", place, dot && !strpbrk(dot, " \t\\") ? dot : "");
}

static int posed_view(void *arg, int k, int worker SST_UNUSED)
{
    const struct export_job *job = arg;
    char path[SST_PATH_MAX], name[64], to[80];
    struct view_file file;
    int err;

    if (!job->lf.views[k].present)
        return 0;
    err = read_view(&file, &job->lf, k, job->cfg->dir);
    if (err)
        return err;
    image_name(job, k, name);
    snprintf(to, sizeof(to), "images/%s", name);
    err = sst_path_join(path, job->out, to);
    err = err ? err : sst_jpeg_write(path, file.data, file.size);
    free(file.data);
    return err;
}

static int write_poses(const struct export_job *job, int (*write)(const struct sst_export_cameras *cameras, const char *dir))
{
    const int views = job->lf.rows * job->lf.cols;
    char(*name)[SST_EXPORT_NAME] = calloc((size_t)views, sizeof(*name));
    struct sst_calib calib;
    int err;

    if (!name) {
        sst_log_error("not enough memory to export the light field");
        return -ENOMEM;
    }
    for (int k = 0; k < views; k++)
        image_name(job, k, name[k]);
    err = export_cameras(&calib, &job->lf, job->cfg->dir);
    if (!err) {
        err = write(&(struct sst_export_cameras){ .calib = &calib,
                                                  .name = (const char(*)[SST_EXPORT_NAME])name,
                                                  .array = true,
                                                  .lossy = job->cfg->lossy },
                    job->out);
        sst_calib_fini(&calib);
    }
    free(name);
    return err;
}

static int colmap_rest(const struct export_job *job)
{
    return write_poses(job, sst_export_colmap);
}

static int nerfstudio_rest(const struct export_job *job)
{
    return write_poses(job, sst_export_nerfstudio);
}

/* ------------------------------------------------------------------------------------------------------------------ */

static const struct format formats[] = {
    { "stanford", "positions.cfg", 0, false, stanford_view, stanford_rest },
    { "hci", "parameters.cfg", SST_LOAD_DISPARITY, false, hci_view, hci_rest },
    { "colmap", "sparse/0/cameras.txt", 0, true, posed_view, colmap_rest },
    { "nerfstudio", "transforms.json", 0, true, posed_view, nerfstudio_rest },
};

/* Formats without lens models get rectified views when the files are raw frames. */
static int load(struct sst_lightfield *lf, const struct format *f, const char *dir, int threads)
{
    int err = sst_lightfield_load(lf, dir, f->load, threads);

    if (err || f->raw || !lf->calibration)
        return err;
    sst_lightfield_fini(lf);
    return sst_lightfield_load(lf, dir, f->load | SST_LOAD_IMAGES, threads);
}

/* Values of the user for cameras of which the light field knows nothing. */
static int replace_geometry(struct sst_lightfield *lf, const struct sst_export_config *cfg)
{
    const bool converges = cfg->focus_mm > 0 && isfinite(cfg->focus_mm);

    if (lf->calibration && (cfg->focal_px > 0 || cfg->spacing_mm > 0 || cfg->focus_mm > 0 || cfg->infinity_px)) {
        sst_log_error("the light field has a calibration; leave out --focal-px, --spacing-mm, --focus-mm and "
                      "--infinity-px");
        return -EINVAL;
    }
    if (cfg->focal_px > 0)
        lf->focal_px = cfg->focal_px;
    if (cfg->spacing_mm > 0)
        lf->spacing_mm = cfg->spacing_mm;
    if (converges && (!(lf->focal_px > 0) || !(lf->spacing_mm > 0))) {
        sst_log_error("--focus-mm needs the focal length and the camera spacing, one of which is unknown; add "
                      "--focal-px and --spacing-mm, or use --infinity-px");
        return -EBADMSG;
    }
    if (cfg->infinity_px)
        lf->infinity_px = *cfg->infinity_px;
    else if (cfg->focus_mm > 0)
        lf->infinity_px = converges ? -lf->focal_px * lf->spacing_mm / cfg->focus_mm : 0;
    lf->infinity_known |= cfg->infinity_px || cfg->focus_mm > 0;
    return 0;
}

int sst_export(const struct sst_export_config *cfg)
{
    const char *const inputs[] = { cfg->dir, NULL };
    const int threads = sst_thread_count(cfg->threads);
    struct export_job job = { .cfg = cfg };
    const struct format *f = formats;
    struct sst_outdir folder;
    int err;

    while (f < formats + ARRAY_LEN(formats) && strcmp(f->name, cfg->format))
        f++;
    if (f == formats + ARRAY_LEN(formats)) {
        sst_log_error(
            "unknown export format `%s`;%s use stanford, hci, colmap, nerfstudio or npz", cfg->format,
            sst_edit_hint(cfg->format, (const char *const[]){ "stanford", "hci", "colmap", "nerfstudio", "npz", NULL }));
        return -EINVAL;
    }
    if (strcmp(f->name, "nerfstudio") && cfg->lossy) {
        sst_log_error("--lossy belongs to nerfstudio, not to %s", f->name);
        return -EINVAL;
    }
    err = sst_path_check_output(cfg->out, cfg->force, f->marker, inputs);
    err = err ? err : load(&job.lf, f, cfg->dir, threads);
    if (err)
        return err;
    err = replace_geometry(&job.lf, cfg);
    if (err)
        goto out;
    err = sst_outdir_open(&folder, cfg->out, cfg->force);
    if (err)
        goto out;
    job.out = folder.temporary;
    if (f->raw)
        err = make_folder(job.out, "images");
    err = err ? err : sst_parallel_for(job.lf.rows * job.lf.cols, threads, f->view, &job);
    err = err ? err : f->rest(&job);
    err = sst_outdir_end(&folder, err);

out:
    sst_lightfield_fini(&job.lf);
    return err;
}
