/* Export to other tools' formats; import_stanford.c and import_hci.c describe them. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/camera/format.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/jpeg_tables.h"
#include "pipeline/lightfield/lightfield_internal.h"

#define SENSOR_MM 35.0 /* HCI expresses the focal length by a sensor size; any value works, this is the benchmark's */

struct format {
    const char *name, *marker; /* marker: a file that identifies an export of this format */
    unsigned load;
    bool raw; /* exports the files with the cameras that took them, not rectified views */
    sst_work_fn *view;
    int (*rest)(const struct export_job *job);
};

/* Open a text file in the output's folder. */
static int open_text(struct sst_outfile *out, const struct export_job *job, const char *name)
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, job->out, name);

    return err ? err : sst_outfile_open(out, path);
}

/* --- stanford ----------------------------------------------------------------------------------------------------- */

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
    uint8_t *data = NULL;
    size_t size = 0;
    int err = 0;

    if (!v->present)
        return 0;
    if (!job->lf.calibration)
        err = read_view(&job->lf, k, job->cfg->dir, path, &data, &size);
    if (err)
        return err;
    snprintf(name, sizeof(name), "out_%02d_%02d_%.*f_%.*f_.%s", k / job->lf.cols, k % job->lf.cols, digits,
             v->by * unit, digits, v->bx * unit, !data || data[0] == 0x89 ? "png" : "jpg");
    err = sst_path_join(path, job->out, name);
    if (!err)
        err = data ? sst_jpeg_write(path, data, size) : sst_image_write_png(&v->image, path);
    free(data);
    return err;
}

static int stanford_rest(const struct export_job *job)
{
    const struct sst_lightfield *lf = &job->lf;
    struct sst_outfile out;
    int err = open_text(&out, job, "positions.cfg");

    if (err)
        return err;
    fprintf(out.stream, "[positions]\nspacing = %.17g\nspacing_mm = %.17g\n", position_unit(lf), lf->spacing_mm);
    if (lf->focal_px > 0)
        fprintf(out.stream, "focal_px = %.17g\n", lf->focal_px);
    if (lf->range_min_px < lf->range_max_px)
        fprintf(out.stream, "disp_min = %.17g\ndisp_max = %.17g\n", lf->range_min_px, lf->range_max_px);
    return sst_outfile_commit(&out);
}

/* --- hci ---------------------------------------------------------------------------------------------------------- */

static int hci_disparity(const struct export_job *job, int k, const char *name)
{
    const struct sst_map_u16 *disp = &job->lf.views[k].disp;
    char path[SST_PATH_MAX];
    struct sst_map_f32 map;
    int err = sst_path_join(path, job->out, name);

    if (!err)
        err = sst_map_f32_init(&map, disp->width, disp->height);
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
    char from[SST_PATH_MAX];
    struct sst_image img;
    uint8_t *data;
    size_t size;
    int err;

    if (job->lf.calibration)
        return sst_image_write_png(&job->lf.views[k].image, path);
    err = read_view(&job->lf, k, job->cfg->dir, from, &data, &size);
    if (err)
        return err;
    if (data[0] == 0x89) {
        err = sst_file_write(path, data, size);
    } else {
        err = sst_image_decode(&img, data, size, from);
        if (!err) {
            err = sst_image_write_png(&img, path);
            sst_image_fini(&img);
        }
    }
    free(data);
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
    if (!err)
        err = hci_image(job, k, path);
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

static int hci_rest(const struct export_job *job)
{
    const struct sst_lightfield *lf = &job->lf;
    const int centre = lf->rows / 2 * lf->cols + lf->cols / 2;
    struct sst_outfile out;
    int err = open_text(&out, job, "parameters.cfg");

    if (err)
        return err;
    fprintf(out.stream, "[intrinsics]\nimage_resolution_x_px = %d\nimage_resolution_y_px = %d\n", lf->width,
            lf->height);
    if (lf->focal_px > 0)
        fprintf(out.stream, "focal_length_mm = %.17g\nsensor_size_mm = %g\n",
                lf->focal_px * SENSOR_MM / sst_max_int(lf->width, lf->height), SENSOR_MM);
    fprintf(out.stream, "\n[extrinsics]\nnum_cams_x = %d\nnum_cams_y = %d\n", lf->cols, lf->rows);
    if (lf->spacing_mm > 0)
        fprintf(out.stream, "baseline_mm = %.17g\n", lf->spacing_mm);
    if (lf->range_min_px < lf->range_max_px)
        fprintf(out.stream, "\n[meta]\ndisp_min = %.17g\ndisp_max = %.17g\n", lf->range_min_px, lf->range_max_px);
    put_offsets(out.stream, lf);
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
    char path[SST_PATH_MAX], name[64], file[80];
    uint8_t *data;
    size_t size;
    int err;

    if (!job->lf.views[k].present)
        return 0;
    err = read_view(&job->lf, k, job->cfg->dir, path, &data, &size);
    if (err)
        return err;
    image_name(job, k, name);
    snprintf(file, sizeof(file), "images/%s", name);
    err = sst_path_join(path, job->out, file);
    if (!err)
        err = sst_jpeg_write(path, data, size);
    free(data);
    return err;
}

typedef int write_poses_fn(const struct sst_calib *calib, const char (*name)[64], const char *dir);

static int write_poses(const struct export_job *job, write_poses_fn *write, int coefficients)
{
    const int views = job->lf.rows * job->lf.cols;
    char(*name)[64] = calloc((size_t)views, sizeof(*name));
    struct sst_calib exact, fitted = { 0 };
    int err;

    if (!name) {
        sst_log_error("not enough memory to export the light field");
        return -ENOMEM;
    }
    for (int k = 0; k < views; k++)
        image_name(job, k, name[k]);
    err = export_cameras(&exact, &job->lf, job->cfg);
    if (!err) {
        if (coefficients)
            err = sst_calib_reduce(&fitted, &exact, coefficients, job->cfg->lossy, "nerfstudio");
        if (!err)
            err = write(coefficients ? &fitted : &exact, (const char(*)[64])name, job->out);
        sst_calib_fini(&exact);
        sst_calib_fini(&fitted);
    }
    free(name);
    return err;
}

static int colmap_rest(const struct export_job *job)
{
    return write_poses(job, colmap_write, 0);
}

static int nerfstudio_rest(const struct export_job *job)
{
    return write_poses(job, nerfstudio_write, 5);
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
        sst_log_error("unknown export format `%s`; use stanford, hci, colmap or nerfstudio", cfg->format);
        return -EINVAL;
    }
    if (!f->raw && (cfg->focal_px > 0 || cfg->spacing_mm > 0 || cfg->lossy)) {
        sst_log_error("--focal-px, --spacing-mm and --lossy belong to colmap and nerfstudio, not to %s", f->name);
        return -EINVAL;
    }
    err = sst_path_check_output(cfg->out, cfg->force, f->marker, inputs);
    if (!err)
        err = load(&job.lf, f, cfg->dir, threads);
    if (err)
        return err;
    err = sst_outdir_open(&folder, cfg->out, cfg->force);
    if (err)
        goto out;
    job.out = folder.temporary;
    if (f->raw)
        err = make_folder(job.out, "images");
    if (!err)
        err = sst_parallel_for(job.lf.rows * job.lf.cols, threads, f->view, &job);
    if (!err)
        err = f->rest(&job);
    err = sst_outdir_end(&folder, err);

out:
    sst_lightfield_fini(&job.lf);
    return err;
}
