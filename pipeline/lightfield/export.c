/* Light fields in other tools' forms; import_stanford.c and import_hci.c say what those are. */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/import_plan.h"
#include "pipeline/lightfield/store.h"

#define SENSOR_MM 35.0 /* HCI gives the focal length by a sensor size; any will do, this is theirs */

struct job {
    struct sst_lightfield lf;
    const char *dir, *out; /* out: temporary folder */
};

struct format {
    const char *name, *marker; /* marker: the file that tells an export of this form */
    unsigned load;
    sst_work_fn *view;
    int (*rest)(const struct job *job);
};

/* Text in the making, with room for two lines of numbers for each of 256 views. */
struct text {
    char data[65536];
    size_t size;
};

static void add(struct text *t, const char *fmt, ...) SST_PRINTF(2, 3);

static void add(struct text *t, const char *fmt, ...)
{
    const size_t left = sizeof(t->data) - t->size;
    va_list args;
    int n;

    va_start(args, fmt);
    n = vsnprintf(t->data + t->size, left, fmt, args);
    va_end(args);
    if (n > 0)
        t->size += (size_t)n < left ? (size_t)n : left - 1;
}

static int write_text(const struct job *job, const char *name, const struct text *t)
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, job->out, name);

    return err ? err : sst_file_write(path, t->data, t->size);
}

static int read_view(const struct job *job, int k, char path[SST_PATH_MAX], uint8_t **data, size_t *size)
{
    char name[300], hash[65];
    int err;

    snprintf(name, sizeof(name), "views/%s", job->lf.views[k].file);
    err = sst_path_join(path, job->dir, name);
    if (!err)
        err = sst_file_read(path, SST_VIEW_FILE_MAX, data, size);
    if (err)
        return err;
    sst_sha256_hex(hash, *data, *size);
    if (!strcmp(hash, job->lf.views[k].sha256))
        return 0;
    sst_log_error("%s has changed since it was stored (its SHA-256 differs); import it again", path);
    free(*data);
    return -EBADMSG;
}

/* --- stanford ----------------------------------------------------------------------------------------------------- */

/* Positions in millimetres, or in spacings where those are not known. */
static double position_unit(const struct sst_lightfield *lf)
{
    return lf->spacing_mm > 0 ? lf->spacing_mm : 1.0;
}

static int stanford_view(void *arg, int k, int worker SST_UNUSED)
{
    const struct job *job = arg;
    const struct sst_view *v = &job->lf.views[k];
    const double unit = position_unit(&job->lf);
    /* Nine digits of a spacing, whatever its unit. */
    const int digits = sst_clamp_int(9 - (int)floor(log10(unit)), 6, 18);
    char path[SST_PATH_MAX], name[SST_NAME_MAX];
    uint8_t *data = NULL;
    size_t size;
    int err;

    if (!v->present)
        return 0;
    err = job->lf.calibration ? 0 : read_view(job, k, path, &data, &size);
    if (err)
        return err;
    snprintf(name, sizeof(name), "out_%02d_%02d_%.*f_%.*f_.%s", k / job->lf.cols, k % job->lf.cols, digits,
             v->by * unit, digits, v->bx * unit, !data || data[0] == 0x89 ? "png" : "jpg");
    err = sst_path_join(path, job->out, name);
    if (!err)
        err = data ? sst_file_write(path, data, size) : sst_image_write_png(&v->image, path);
    free(data);
    return err;
}

static int stanford_rest(const struct job *job)
{
    const struct sst_lightfield *lf = &job->lf;
    struct text t = { .size = 0 };

    add(&t, "[positions]\nspacing = %.17g\nspacing_mm = %.17g\n", position_unit(lf), lf->spacing_mm);
    if (lf->focal_px > 0)
        add(&t, "focal_px = %.17g\n", lf->focal_px);
    if (lf->range_min_px < lf->range_max_px)
        add(&t, "disp_min = %.17g\ndisp_max = %.17g\n", lf->range_min_px, lf->range_max_px);
    return write_text(job, "positions.cfg", &t);
}

/* --- hci ---------------------------------------------------------------------------------------------------------- */

static int hci_disparity(const struct job *job, int k, const char *name)
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

/* HCI's readers want PNG: other views are decoded, those in PNG are copied, rectified ones are as they were loaded. */
static int hci_view(void *arg, int k, int worker SST_UNUSED)
{
    const struct job *job = arg;
    char from[SST_PATH_MAX], path[SST_PATH_MAX], name[64];
    struct sst_image img;
    uint8_t *data = NULL;
    size_t size;
    int err;

    if (!job->lf.views[k].present)
        return 0;
    err = job->lf.calibration ? 0 : read_view(job, k, from, &data, &size);
    if (err)
        return err;
    snprintf(name, sizeof(name), "input_Cam%03d.png", k);
    err = sst_path_join(path, job->out, name);
    if (!err && !data) {
        err = sst_image_write_png(&job->lf.views[k].image, path);
    } else if (!err && data[0] == 0x89) {
        err = sst_file_write(path, data, size);
    } else if (!err) {
        err = sst_image_decode(&img, data, size, from);
        if (!err) {
            err = sst_image_write_png(&img, path);
            sst_image_fini(&img);
        }
    }
    free(data);
    snprintf(name, sizeof(name), "gt_disp_lowres_Cam%03d.pfm", k);
    return err || !job->lf.views[k].disp.data ? err : hci_disparity(job, k, name);
}

/* A camera off its place in the grid: HCI has no word for it, so it is noted in a section of our own. */
static void add_offsets(struct text *t, const struct sst_lightfield *lf)
{
    const int ref_row = lf->ref_view / lf->cols, ref_col = lf->ref_view % lf->cols;
    double worst = 0;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const struct sst_view *v = &lf->views[k];
        const double x = v->bx + ref_col, y = v->by + ref_row, off = hypot(x - k % lf->cols, y - k / lf->cols);

        if (!v->present || off == 0)
            continue;
        if (worst == 0)
            add(t, "\n[offsets]\n");
        add(t, "offset_x_%03d = %.17g\noffset_y_%03d = %.17g\n", k, x, k, y);
        worst = fmax(worst, off);
    }
    if (worst > 0.01)
        sst_log_warning("cameras are up to %.2f spacings off a regular grid, which readers of HCI's form do not know",
                        worst);
}

static int hci_rest(const struct job *job)
{
    const struct sst_lightfield *lf = &job->lf;
    const int centre = lf->rows / 2 * lf->cols + lf->cols / 2;
    struct text t = { .size = 0 };
    int err;

    add(&t, "[intrinsics]\nimage_resolution_x_px = %d\nimage_resolution_y_px = %d\n", lf->width, lf->height);
    if (lf->focal_px > 0)
        add(&t, "focal_length_mm = %.17g\nsensor_size_mm = %g\n",
            lf->focal_px * SENSOR_MM / sst_max_int(lf->width, lf->height), SENSOR_MM);
    add(&t, "\n[extrinsics]\nnum_cams_x = %d\nnum_cams_y = %d\n", lf->cols, lf->rows);
    if (lf->spacing_mm > 0)
        add(&t, "baseline_mm = %.17g\n", lf->spacing_mm);
    if (lf->range_min_px < lf->range_max_px)
        add(&t, "\n[meta]\ndisp_min = %.17g\ndisp_max = %.17g\n", lf->range_min_px, lf->range_max_px);
    add_offsets(&t, lf);
    err = write_text(job, "parameters.cfg", &t);
    return err || !lf->views[centre].disp.data ? err : hci_disparity(job, centre, "gt_disp_lowres.pfm");
}

/* ------------------------------------------------------------------------------------------------------------------ */

static const struct format formats[] = {
    { "stanford", "positions.cfg", 0, stanford_view, stanford_rest },
    { "hci", "parameters.cfg", SST_LOAD_DISPARITY, hci_view, hci_rest },
};

/* A calibrated light field is exported as the views that its raw frames make, with its images loaded. */
static int load(struct sst_lightfield *lf, const char *dir, unsigned what, int threads)
{
    int err = sst_lightfield_load(lf, dir, what, threads);

    if (err || !lf->calibration)
        return err;
    err = sst_lightfield_verify(lf, dir, threads);
    sst_lightfield_fini(lf);
    return err ? err : sst_lightfield_load(lf, dir, what | SST_LOAD_IMAGES, threads);
}

int sst_export(const char *format, const char *dir, const char *out, bool force, int threads)
{
    const char *const inputs[] = { dir, NULL };
    const struct format *f = formats;
    struct job job = { .dir = dir };
    struct sst_outdir folder;
    int err;

    while (f < formats + ARRAY_LEN(formats) && strcmp(f->name, format))
        f++;
    if (f == formats + ARRAY_LEN(formats)) {
        sst_log_error("there is no export format %s; it is stanford or hci", format);
        return -EINVAL;
    }
    threads = sst_thread_count(threads);
    err = sst_check_output(out, force, f->marker, inputs);
    if (!err)
        err = load(&job.lf, dir, f->load, threads);
    if (err)
        return err;
    err = sst_outdir_open(&folder, out, force);
    if (err)
        goto out;
    job.out = folder.temporary;
    err = sst_parallel_for(job.lf.rows * job.lf.cols, threads, f->view, &job);
    if (!err)
        err = f->rest(&job);
    if (err)
        sst_outdir_abort(&folder);
    else
        err = sst_outdir_commit(&folder);

out:
    sst_lightfield_fini(&job.lf);
    return err;
}
