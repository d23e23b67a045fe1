/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "config/sstd.h"
#include "simulators/scene/scene.h"
#include "simulators/scene/world/settings.h"
#include "simulators/scene/world/sim_world.h"

#define STEP_MS   200
#define READY_S   600 /* a slow machine prepares a world of leaves for minutes */
#define SETTLED_S 60  /* from the first picture: it is saved again until it has settled */
#define END_MS    3000
#define REPORT_NS INT64_C(10000000000)

#define PORT         8090
#define SCENE_HEDGE  "hedge" /* of worlds alone */
#define CONFIG_BYTES (1 << 20)

/* Configuration of an array with six trigger lines and a loop-back wire. Grid and size are the world's.
 */
static const char config_text[] = "# sstd on a simulated array: sst-sim --world %s -- sstd --config %s\n"
                                  "array: {rows: %d, cols: %d}\n"
                                  "cameras:\n"
                                  "  width: %d\n"
                                  "  height: %d\n"
                                  "  check_frozen: false # moments of the simulated scene come again\n"
                                  "  controls: {trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}\n"
                                  "live: {demo_labels: true, calibration: \"%s\"%s%s%s} # the simulator's truth: distances in metres\n"
                                  "trigger:\n"
                                  "  source: gpio\n"
                                  "  chip: sst-trigger\n"
                                  "  lines: [TRIG0, TRIG1, TRIG2, TRIG3, TRIG4, TRIG5]\n"
                                  "  loopback: LOOP0\n"
                                  "  rate_hz: %g\n"
                                  "control: {socket: \"%s\", group: \"\"}\n"
                                  "web: {port: %d, token_file: \"%s\", zones_file: \"%s\"}\n"
                                  "storage: {dir: \"%s\", ring_mb: 192, quota_gb: 2%s}\n";

/* A person behind the hedge is recorded, also without viewers. */
static const char watched_text[] = ", mode: event, record_on: [{visit: true}], preroll_s: 6, postroll_s: 4";

/* The machine-readable strip of simulated pictures is for tests. */
static const char world_text[] = "# A scene of simulated devices: sst-sim --world %s\nscene: %s\nstrip: false\n";

/* Clients of the service. They wait while they are disabled in its configuration. */
static const char *const publishers[] = { "sst-rtsp", "sst-mqtt", "sst-onvif" };

struct site {
    const char *scene;
    int port;
    pid_t pid;                              /* of sst-sim, and group; 0: does not run */
    pid_t publisher[ARRAY_LEN(publishers)]; /* 0: not built, or ended */
    bool settled;                           /* the service does not expect the saved picture to become better */
    char world[SST_PATH_MAX], config[SST_PATH_MAX], calibration[SST_PATH_MAX], socket[SST_PATH_MAX],
        token[SST_PATH_MAX], zones[SST_PATH_MAX], storage[SST_PATH_MAX], log[SST_PATH_MAX], picture[SST_PATH_MAX];
};

static volatile sig_atomic_t interrupted;

static void on_signal(int sig)
{
    (void)sig;
    interrupted = 1;
}

static int name_files(struct site *s, const char *dir)
{
    const struct {
        char *path;
        const char *ending;
    } files[] = { { s->world, "-world.yaml" }, { s->config, ".yaml" }, { s->calibration, "-calibration.yaml" },
                  { s->socket, ".sock" },      { s->token, ".token" }, { s->zones, "-zones.yaml" },
                  { s->storage, "" },          { s->log, ".log" },     { s->picture, ".jpg" } };
    char name[128];
    int err = 0;

    for (size_t i = 0; i < ARRAY_LEN(files) && !err; i++) {
        snprintf(name, sizeof(name), "%s%s", s->scene, files[i].ending);
        err = sst_path_join(files[i].path, dir, name);
    }
    if (!err && strlen(s->socket) >= 108) {
        sst_log_error("%s is too long for a socket's name: choose a shorter folder with -o", s->socket);
        err = -ENAMETOOLONG;
    }
    return err;
}

/** A file of before stays, since it may have been edited; said where it differs. @param text  printf() format */
__attribute__((format(printf, 2, 3))) static int write_first(const char *path, const char *text, ...)
{
    uint8_t *kept = NULL;
    char *fresh = NULL;
    size_t size;
    va_list args;
    FILE *memory;
    int err;

    memory = open_memstream(&fresh, &size);
    if (!memory)
        return -ENOMEM;
    va_start(args, text);
    vfprintf(memory, text, args);
    va_end(args);
    err = fclose(memory) ? -ENOMEM : 0;
    if (!err && sst_path_exists(path)) {
        err = sst_file_read_text(path, CONFIG_BYTES, &kept, &size);
        if (!err && strcmp((const char *)kept, fresh))
            printf("%s: kept as it is; delete it to start from the original\n", path);
    } else if (!err) {
        err = sst_file_write(path, fresh, strlen(fresh));
    }
    free(kept);
    free(fresh);
    return err;
}

/** Write missing files, and read the configuration, where the user may have moved page, socket and token.
 *  @param port  0: of the configuration @param device  NULL: of the configuration */
static int prepare(struct site *s, int port, const char *device)
{
    const bool kept = sst_path_exists(s->config);
    struct sst_config *cfg = malloc(sizeof(*cfg));
    struct sst_sim_settings *world = malloc(sizeof(*world));
    int err = cfg && world ? 0 : -ENOMEM;

    err = err ? err : write_first(s->world, world_text, s->world, s->scene);
    err = err ? err : sst_sim_settings_read(world, s->world);
    err = err ? err : sst_sim_world_parameters(s->world, s->calibration);
    err = err ? err
              : write_first(s->config, config_text, s->world, s->config, world->rows, world->cols, world->width,
                            world->height, s->calibration, device ? ", device: \"" : "", device ? device : "",
                            device ? "\"" : "", world->rate_hz, s->socket, port ? port : PORT, s->token, s->zones,
                            s->storage, strcmp(s->scene, SCENE_HEDGE) ? "" : watched_text);
    if (!err) {
        sst_config_defaults(cfg);
        err = sst_config_read(cfg, s->config);
    }
    if (!err && kept && port && port != cfg->web.port) {
        sst_log_error("%s, which is kept, has web.port %d; change it there, or use --port %d", s->config, cfg->web.port,
                      cfg->web.port);
        err = -EINVAL;
    }
    if (!err && kept && device && strcmp(device, cfg->live.device)) {
        sst_log_error("%s, which is kept, has live.device %s; change it there, or leave out --device", s->config,
                      cfg->live.device);
        err = -EINVAL;
    }
    if (!err && !(cfg->web.enabled && cfg->web.port)) {
        sst_log_error("%s %s; the demo needs a page with a fixed port", s->config,
                      cfg->web.enabled ? "has web.port 0" : "disables the page (web.enabled)");
        err = -EINVAL;
    }
    if (!err) {
        s->port = cfg->web.port;
        memcpy(s->socket, cfg->control.socket, sizeof(cfg->control.socket));
        memcpy(s->token, cfg->web.token_file, sizeof(cfg->web.token_file));
    }
    free(world);
    free(cfg);
    return err;
}

/** Check a port before minutes of preparation: the service would run without a page, and the printed address would be
 *  another program's. @return 0, -EBUSY, or an errno; logged */
static int try_port(int port)
{
    const struct sockaddr_in at = { .sin_family = AF_INET,
                                    .sin_port = htons((uint16_t)port),
                                    .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), yes = 1;
    int err = fd < 0 ? -errno : 0;

    if (!err && setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes)))
        err = -errno;
    if (!err && bind(fd, (const struct sockaddr *)&at, sizeof(at)))
        err = -errno;
    if (fd >= 0)
        close(fd);
    if (err)
        sst_log_error("no page can be served at port %d: %s; choose another one with --port%s", port, strerror(-err),
                      err == -EADDRINUSE ? ", or end the demo or service that has it" : "");
    return err == -EADDRINUSE ? -EBUSY : err;
}

/** A program beside this one, or where it is installed. @return 0, -ENOENT */
static int find_program(char out[SST_PATH_MAX], const char *name)
{
    char installed[64];

    if (!sst_path_beside_program(out, name) && !access(out, X_OK))
        return 0;
    snprintf(installed, sizeof(installed), "../sbin/%s", name);
    return sst_path_beside_program(out, installed) || access(out, X_OK) ? -ENOENT : 0;
}

static int need_program(char out[SST_PATH_MAX], const char *name)
{
    if (!find_program(out, name))
        return 0;
    sst_log_error("%s is not beside sst: build it (make), or install it (make install, Debian's package %s)", name,
                  name);
    return -ENOPKG;
}

static int start(struct site *s)
{
    char sim[SST_PATH_MAX], daemon[SST_PATH_MAX], program[SST_PATH_MAX];
    const char *const service[] = { sim,  "--at-once", "--world",  s->world,  "--",
                                    daemon, "--config",  s->config, NULL };
    const char *const publisher[] = { program, "--config", s->config, NULL };
    int err = need_program(sim, "sst-sim");

    err = err ? err : need_program(daemon, "sstd");
    if (err)
        return err;
    (void)unlink(s->log);
    s->pid = cli_start_program(service, NULL, s->log);
    if (s->pid < 0) {
        err = s->pid;
        s->pid = 0;
    }
    for (size_t i = 0; i < ARRAY_LEN(publishers) && !err; i++)
        if (!find_program(program, publishers[i]))
            s->publisher[i] = sst_max_int(cli_start_program(publisher, NULL, s->log), 0);
    return err;
}

/** @return it still runs */
static bool runs(struct site *s)
{
    int status;

    if (s->pid && waitpid(s->pid, &status, WNOHANG) == s->pid)
        s->pid = 0;
    return s->pid != 0;
}

static void stop(struct site *s)
{
    const int64_t end_ns = sst_clock_now_ns() + END_MS * INT64_C(1000000);

    for (size_t i = 0; i < ARRAY_LEN(publishers); i++) {
        if (!s->publisher[i])
            continue;
        kill(s->publisher[i], SIGTERM);
        waitpid(s->publisher[i], NULL, 0);
    }
    if (!s->pid)
        return;
    kill(s->pid, SIGTERM);
    while (runs(s) && sst_clock_now_ns() < end_ns)
        nanosleep(&(struct timespec){ .tv_nsec = 20000000 }, NULL);
    if (s->pid) {
        kill(-s->pid, SIGKILL);
        waitpid(s->pid, NULL, 0);
    }
}

static void report_end(const struct site *s)
{
    char said[512];

    cli_last_error(s->log, said, sizeof(said));
    sst_log_error("the service on %s ended: %s%s%s", s->scene, said[0] ? said : "see ", said[0] ? "; all in " : "",
                  s->log);
}

/** Ask without a word on standard error: the service may not be there yet. */
static json_t *status(const struct site *s)
{
    const struct sst_client_service where = { .socket = s->socket };
    char held[SST_LOG_MAX];
    json_t *out = NULL;

    if (access(s->socket, F_OK))
        return NULL;
    sst_log_hold_errors(held);
    if (sst_client_ask(&where, "/api/v1/status", NULL, &out))
        out = NULL;
    sst_log_hold_errors(NULL);
    return out;
}

/** The service's present see-through picture, into a file. The request is a viewer, for which the service computes.
 *  @param settled  out: the service does not expect it to become better @return 0, -EAGAIN: not yet */
static int save_picture(const struct site *s, bool *settled)
{
    const struct sst_client_service where = { .socket = s->socket };
    struct sst_client *client = NULL;
    char held[SST_LOG_MAX];
    json_t *o = status(s);
    const json_t *ready = o ? cli_member(o, "live.ready") : NULL;
    int err = json_is_true(ready) ? 0 : -EAGAIN;

    *settled = o && json_is_false(cli_member(o, "live.settling"));
    json_decref(o);
    if (err)
        return err;
    sst_log_hold_errors(held);
    err = sst_client_open(&client, &where);
    err = err ? err : sst_client_save(client, "/snapshot", "image/jpeg", s->picture);
    sst_client_close(client);
    sst_log_hold_errors(NULL);
    return err ? -EAGAIN : 0;
}

/** Bytes of the files directly in a folder; 0 if it cannot be read. */
static int64_t folder_bytes(const char *path)
{
    DIR *dir = opendir(path);
    const struct dirent *e;
    struct stat st;
    int64_t sum = 0;

    while (dir && (e = readdir(dir)))
        if (!fstatat(dirfd(dir), e->d_name, &st, AT_SYMLINK_NOFOLLOW) && S_ISREG(st.st_mode))
            sum += st.st_size;
    if (dir)
        closedir(dir);
    return sum;
}

static void print_address(const struct site *s, double seconds)
{
    const char *between = " ";
    char token[128], cache[SST_PATH_MAX];

    printf("%s: seen through after %.0f s\n  page           http://127.0.0.1:%d/?token=%s\n  picture        %s\n"
           "  status         sst status --socket %s\n  configuration  %s, kept when edited\n",
           s->scene, seconds, s->port, sst_file_line(token, sizeof(token), s->token), s->picture,
           s->socket, s->config);
    if (!sst_sim_world_cache(cache, NULL))
        printf("  prepared       %s, %.0f MB for all scenes seen so far; may be deleted\n", cache,
               (double)folder_bytes(cache) / 1e6);
    printf("Other scenes: sst demo --scene");
    for (const char *const *other = sst_scene_names(); *other; other++) {
        if (!strcmp(*other, s->scene))
            continue;
        printf("%s%s", between, *other);
        between = "|";
    }
    printf("%s\n", strcmp(s->scene, SCENE_HEDGE) ? "|" SCENE_HEDGE : "");
    fflush(stdout);
}

/** Cameras of the world that are prepared, by the simulator's messages. @return 0..1; 1: also if it was in the cache */
static double prepared(const struct site *s)
{
    char line[256], name[128];
    FILE *f = fopen(s->log, "re");
    int done = 0, all = 0, now, of;

    while (f && fgets(line, sizeof(line), f))
        if (sscanf(line, "preparing the world %127[^:]: %d of %d cameras", name, &now, &of) == 3 && of > 0) {
            done = sst_max_int(done, now);
            all = of;
        }
    if (f)
        fclose(f);
    return all ? (double)done / all : 1;
}

/** Start a site and wait for its first picture. @return 0, -EINTR, -ECHILD (it ended; logged), -ETIMEDOUT (logged) */
static int bring_up(struct site *s)
{
    const int64_t start_ns = sst_clock_now_ns();
    int64_t reported_ns = start_ns, now_ns = start_ns;
    int err = start(s);

    if (err)
        return err;
    printf("%s: starting the simulated cameras and the service\n", s->scene);
    fflush(stdout);
    while (save_picture(s, &s->settled)) {
        now_ns = sst_clock_now_ns();
        if (interrupted)
            return -EINTR;
        if (!runs(s)) {
            report_end(s);
            return -ECHILD;
        }
        if (now_ns - start_ns > READY_S * INT64_C(1000000000)) {
            sst_log_error("no picture of %s within %d s: see %s", s->scene, READY_S, s->log);
            return -ETIMEDOUT;
        }
        if (now_ns - reported_ns > REPORT_NS) {
            char said[512];

            reported_ns = now_ns;
            cli_last_error(s->log, said, sizeof(said));
            printf("  %.0f s ... %s\n", (double)(now_ns - start_ns) / 1e9, said);
            fflush(stdout);
        }
        nanosleep(&(struct timespec){ .tv_nsec = STEP_MS * 1000000 }, NULL);
    }
    print_address(s, (double)(sst_clock_now_ns() - start_ns) / 1e9);
    return 0;
}

/** Show how far a new world is, and save the picture until it is as good as the page's. */
static void follow_start(struct site *s, double *done)
{
    static char title[] = "preparing the rest of the scene";
    const double before = *done;

    if (*done < 1) {
        *done = prepared(s);
        cli_progress(title, *done);
    }
    if (before < 1 && *done >= 1) {
        cli_progress_end();
        printf("The scene is prepared: it moves now.\n");
        fflush(stdout);
    }
    if (*done >= 1 && !s->settled)
        (void)save_picture(s, &s->settled);
}

static int watch(struct site *s)
{
    const int64_t start_ns = sst_clock_now_ns();
    double done = prepared(s);
    const bool is_new = done < 1;

    printf("%sCtrl-C ends it.\n", is_new ? "The scene stands still until all of it is prepared, once.\n" : "");
    fflush(stdout);
    while (!interrupted) {
        if (!runs(s)) {
            report_end(s);
            return CLI_INTERNAL;
        }
        if (done < 1 || sst_clock_now_ns() - start_ns < SETTLED_S * INT64_C(1000000000))
            follow_start(s, &done);
        nanosleep(&(struct timespec){ .tv_nsec = STEP_MS * 1000000 }, NULL);
    }
    if (done < 1)
        cli_progress_end();
    return CLI_OK;
}

/* Before anything is written. */
static int check_scene(const char *scene)
{
    bool known = !strcmp(scene, SCENE_HEDGE) || !strcmp(scene, "board");
    char names[256] = SCENE_HEDGE;

    for (const char *const *name = sst_scene_names(); *name; name++) {
        known |= !strcmp(scene, *name);
        sst_text_add(names, sizeof(names), ", %s", *name);
    }
    if (!known)
        sst_log_error("there is no scene %s; choose from %s", scene, names);
    return known ? 0 : -EINVAL;
}

int cli_demo_live(const char *scene, const char *out, int port, const char *device)
{
    const struct sigaction act = { .sa_handler = on_signal };
    struct site *s = calloc(1, sizeof(*s));
    char dir[PATH_MAX];
    int err = s ? check_scene(scene) : -ENOMEM, code;

    if (!err) {
        s->scene = scene;
        err = name_files(s, out);
    }
    if (!err && !sst_path_exists(s->config))
        err = try_port(port ? port : PORT); /* before anything is written */
    err = err ? err : sst_path_make_dir(out);
    if (!err && !realpath(out, dir))
        err = -errno;
    err = err ? err : name_files(s, dir);
    err = err ? err : prepare(s, port, device);
    err = err ? err : try_port(s->port);
    sigaction(SIGINT, &act, NULL);
    sigaction(SIGTERM, &act, NULL);
    err = err ? err : bring_up(s);
    code = err == -EINTR ? CLI_OK : err == -ECHILD || err == -ETIMEDOUT ? CLI_INTERNAL : cli_exit_code(err);
    code = err ? code : watch(s);
    if (s)
        stop(s);
    free(s);
    return code;
}
