/* World, server and devices: opened in order, closed in reverse; the session's control calls. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/devices_internal.h"
#include "simulators/devices/sysfs_internal.h"
#include "simulators/devices/usb_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "simulators/scene/world/settings.h"

struct sim_simulator {
    struct sim_options options;
    struct sst_sim_world *world;
    struct sim_faults *faults;
    struct sim_server *server;
    struct sim_wires *wires;
    struct sim_array *array;
    int64_t opened_ns, opened_cpu_ns;
};

/* --- control calls ------------------------------------------------------------------------------------------------ */

static void add_fault(void *arg, const char *name, double value)
{
    (void)json_object_set_new(arg, name, json_real(value));
}

/* Frames and CPU time since the devices were created. */
static json_t *figures(const struct sim_simulator *sim)
{
    const double wall = (double)(sst_clock_now_ns() - sim->opened_ns) * 1e-9;
    const double cpu = (double)(sst_clock_cpu_ns() - sim->opened_cpu_ns) * 1e-9;

    return json_pack("{s:I, s:f, s:f, s:f}", "frames", (json_int_t)sim_array_frames(sim->array), "seconds", wall,
                     "cpu_seconds", cpu, "cpu_percent", wall > 0 ? 100 * cpu / wall : 0.0);
}

static json_t *status(const struct sim_simulator *sim)
{
    json_t *all = figures(sim), *faults = json_object();

    if (!all || !faults) {
        json_decref(all);
        json_decref(faults);
        return NULL;
    }
    sim_faults_each(sim->faults, add_fault, faults);
    (void)json_object_set_new(all, "dir", json_string(sim_server_dir(sim->server)));
    (void)json_object_set_new(all, "faults", faults);
    (void)json_object_set_new(all, "cameras", sim_array_status(sim->array));
    if (sim->wires->rig)
        (void)json_object_set_new(all, "rig", sim_rig_status(sim->wires->rig));
    if (sim->wires->still)
        (void)json_object_set_new(all, "still", sim_still_status(sim->wires->still));
    return all;
}

static int answer_status(const struct sim_simulator *sim, struct sim_request *r)
{
    json_t *all = status(sim);
    size_t n = 0;

    if (all)
        n = json_dumpb(all, (char *)r->data, SST_SIM_PAYLOAD_MAX, JSON_COMPACT);
    json_decref(all);
    if (!n || n > SST_SIM_PAYLOAD_MAX)
        return -ENOMEM;
    r->out_bytes = (uint32_t)n;
    return 0;
}

static int set_fault(struct sim_simulator *sim, const char *text, char *message, size_t size)
{
    struct sst_sim_drive *rig = sim->wires->rig;

    if (rig && !strncmp(text, "rig.", 4))
        return sim_rig_fault(rig, text, message, size);
    return sim_faults_set(sim->faults, text, message, size);
}

static int answer_fault(struct sim_simulator *sim, struct sim_request *r)
{
    char text[256], message[512] = "";
    int err;

    if (r->bytes >= sizeof(text))
        return -EINVAL;
    memcpy(text, r->data, r->bytes);
    text[r->bytes] = 0;
    err = set_fault(sim, text, message, sizeof(message));
    r->out_bytes = (uint32_t)strlen(message);
    memcpy(r->data, message, r->out_bytes);
    return err;
}

static int answer_faults(const struct sim_simulator *sim, struct sim_request *r)
{
    size_t n = sim_faults_list(sim->faults, (char *)r->data, SST_SIM_PAYLOAD_MAX);

    if (sim->wires->rig)
        n += (size_t)snprintf((char *)r->data + n, SST_SIM_PAYLOAD_MAX - n, "%s", sim_rig_faults);
    r->out_bytes = (uint32_t)(n < SST_SIM_PAYLOAD_MAX ? n : SST_SIM_PAYLOAD_MAX - 1);
    return 0;
}

static int answer(void *arg, struct sim_request *r)
{
    struct sim_simulator *sim = arg;

    switch (r->call.op) {
    case SST_SIM_FAULT:
        return answer_fault(sim, r);
    case SST_SIM_FAULTS:
        return answer_faults(sim, r);
    case SST_SIM_STATUS:
        return answer_status(sim, r);
    default:
        sim_server_stop(sim->server);
        return 0;
    }
}

/* --- faults of the world ------------------------------------------------------------------------------------------ */

static const struct sim_fault world_faults[] = {
    { "board_pose", 0, SST_SIM_POSES_MAX, "the board stays in this pose, from 1; 0: by time, on a rig the first" },
};

const struct sim_fault_scope sim_world_faults = { .name = "world",
                                                  .faults = world_faults,
                                                  .count = ARRAY_LEN(world_faults) };

static int hold_board(void *arg, int instance SST_UNUSED, int fault SST_UNUSED, double value)
{
    struct sim_simulator *sim = arg;

    return sst_sim_world_hold(sim->world, (int)value);
}

static int add_world_faults(struct sim_simulator *sim)
{
    const int scope = sim_faults_add(sim->faults, &(struct sim_fault_scope){ .name = "world",
                                                                             .faults = world_faults,
                                                                             .count = ARRAY_LEN(world_faults),
                                                                             .changed = hold_board,
                                                                             .arg = sim });

    return sst_min_int(scope, 0);
}

/* --- open and close ----------------------------------------------------------------------------------------------- */

static int set_faults(struct sim_simulator *sim)
{
    for (int i = 0; i < sim->options.fault_count; i++) {
        char message[512];
        const int err = set_fault(sim, sim->options.faults[i], message, sizeof(message));

        if (err) {
            sst_log_error("%s", message);
            return err;
        }
    }
    return 0;
}

/* The drives carry the camera of a rig; cameras of an array would give the same picture at each pose. */
static int check_rig(const struct sim_options *options)
{
    const char *world = options->world ? options->world : "pedestrian";
    struct sst_sim_settings *settings = calloc(1, sizeof(*settings));
    int err = settings ? sst_sim_settings_read(settings, world) : -ENOMEM;

    if (!err && !settings->rig) {
        sst_log_error("--rig: world %s is an array of %dx%d cameras, whose pictures do not change with the pose of the "
                      "drives; use a world with `rig: true`, like rig.yaml",
                      world, settings->rows, settings->cols);
        err = -EINVAL;
    }
    free(settings);
    return err;
}

int sim_simulator_open(struct sim_simulator **out, const struct sim_options *options)
{
    struct sim_simulator *sim = calloc(1, sizeof(*sim));
    int err = -ENOMEM;

    if (!sim)
        return err;
    sim->options = *options;
    err = options->wires.rig ? check_rig(options) : 0;
    if (!err && options->at_once)
        err = sst_sim_world_open_at_once(&sim->world, options->world, options->cache);
    else if (!err)
        err = sst_sim_world_open(&sim->world, options->world, options->cache);
    err = err ? err : sim_faults_create(&sim->faults);
    err = err ? err : add_world_faults(sim);
    if (err)
        sim_simulator_close(sim);
    else
        *out = sim;
    return err;
}

/* The wall clock of the programs, where it is not the machine's. */
static int write_clock(const struct sim_simulator *sim, const char *dir)
{
    const struct sst_sim_host *host = &sst_sim_world_settings(sim->world)->host;
    char path[SST_PATH_MAX], text[128];
    int err;

    if (host->clock_offset_ms == 0 && host->clock_drift_ppm == 0)
        return 0;
    err = sst_path_join(path, dir, SST_SIM_CLOCK);
    snprintf(text, sizeof(text), "%lld %.6f %lld\n", (long long)(host->clock_offset_ms * 1e6), host->clock_drift_ppm,
             (long long)sst_clock_now_ns());
    return err ? err : sst_file_write(path, text, strlen(text));
}

int sim_simulator_start(struct sim_simulator *sim, const char *dir)
{
    const struct session_control control = { .arg = sim, .call = answer };
    int err = sim_server_open(&sim->server, dir, &control);

    err = err ? err : write_clock(sim, dir);
    if (!err)
        err = sim_wires_open(&sim->wires, &(struct sim_wires_config){ .options = sim->options.wires,
                                                                      .server = sim->server,
                                                                      .faults = sim->faults,
                                                                      .world = sim->world });
    if (!err)
        err = sim_array_open(&sim->array, &(struct sim_array_config){ .world = sim->world,
                                                                      .server = sim->server,
                                                                      .faults = sim->faults,
                                                                      .usb = sim->wires->usb->usb,
                                                                      .truth = sim->options.truth });
    err = err ? err : sim_wires_attach(sim->wires, sim->array);
    err = err ? err : set_faults(sim);
    if (err) {
        /* nothing was simulated: no figures */
        sim->options.quiet = true;
        sim->options.stats = NULL;
    }
    sim->opened_ns = sst_clock_now_ns();
    sim->opened_cpu_ns = sst_clock_cpu_ns();
    return err;
}

/* Report the simulation's own cost, so that it is not attributed to the programs under test. */
static void report_cost(const struct sim_simulator *sim)
{
    json_t *f = figures(sim);
    char *text = f ? json_dumps(f, JSON_INDENT(2)) : NULL;

    if (f && !sim->options.quiet)
        fprintf(stderr,
                "sst-sim: %lld frames made in %.1f s; the simulation itself used %.2f s of CPU, %.1f %% of one core\n",
                (long long)json_integer_value(json_object_get(f, "frames")),
                json_real_value(json_object_get(f, "seconds")), json_real_value(json_object_get(f, "cpu_seconds")),
                json_real_value(json_object_get(f, "cpu_percent")));
    if (text && sim->options.stats)
        (void)!sst_file_write(sim->options.stats, text, strlen(text));
    free(text);
    json_decref(f);
}

void sim_simulator_close(struct sim_simulator *sim)
{
    if (!sim)
        return;
    if (sim->array)
        report_cost(sim);
    sim_array_close(sim->array);
    sim_wires_close(sim->wires);
    sim_server_close(sim->server);
    sim_faults_destroy(sim->faults);
    sst_sim_world_close(sim->world);
    free(sim);
}

struct sim_server *sim_simulator_server(const struct sim_simulator *sim)
{
    return sim->server;
}
