#include "cli/cli_internal.h"

#include <errno.h>
#include <limits.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"

#define STEP_MS   200
#define READY_S   600 /* a slow machine prepares a world of leaves for minutes */
#define END_MS    3000
#define REPORT_NS INT64_C(10000000000)

/* What integrators would write for an array with six trigger lines and a loop-back wire. */
static const char config_text[] = "# sstd on a simulated 6x6 array: sst-sim --world %s -- sstd --config %s\n"
                                  "array: {rows: 6, cols: 6}\n"
                                  "cameras:\n"
                                  "  check_frozen: false # moments of the simulated scene come again\n"
                                  "  controls: {trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}\n"
                                  "trigger:\n"
                                  "  source: gpio\n"
                                  "  chip: sst-trigger\n"
                                  "  lines: [TRIG0, TRIG1, TRIG2, TRIG3, TRIG4, TRIG5]\n"
                                  "  loopback: LOOP0\n"
                                  "  rate_hz: 10\n"
                                  "control: {socket: \"%s\", group: \"\"}\n"
                                  "web: {port: %d, token_file: \"%s\"}\n"
                                  "storage: {dir: \"%s\", ring_mb: 192, quota_gb: 2}\n";

/* The machine-readable strip of simulated pictures is for tests. */
static const char world_text[] = "# A scene of simulated devices: sst-sim --world %s\nscene: %s\nstrip: false\n";

/* Clients of the service. They wait while they are disabled in its configuration. */
static const char *const publishers[] = { "sst-rtsp", "sst-mqtt" };

struct site {
    const char *scene;
    int port;
    pid_t pid;                              /* of sst-sim, and group; 0: does not run */
    pid_t publisher[ARRAY_LEN(publishers)]; /* 0: not built, or ended */
    char world[SST_PATH_MAX], config[SST_PATH_MAX], socket[SST_PATH_MAX], token[SST_PATH_MAX], storage[SST_PATH_MAX],
        log[SST_PATH_MAX], picture[SST_PATH_MAX];
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
    } files[] = { { s->world, "-world.yaml" }, { s->config, ".yaml" }, { s->socket, ".sock" }, { s->token, ".token" },
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

static int write_files(const struct site *s)
{
    struct sst_outfile file;
    int err = sst_outfile_open(&file, s->world);

    if (err)
        return err;
    fprintf(file.stream, world_text, s->world, s->scene);
    err = sst_outfile_commit(&file);
    err = err ? err : sst_outfile_open(&file, s->config);
    if (err)
        return err;
    fprintf(file.stream, config_text, s->world, s->config, s->socket, s->port, s->token, s->storage);
    return sst_outfile_commit(&file);
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
    sst_log_error("%s is not beside sst: build it (make) or install it (make install)", name);
    return -ENOPKG;
}

/** Start a program in a process group of its own, with its output in the log. @return its process, or -errno */
static pid_t start_program(const struct site *s, const char *const argv[])
{
    pid_t pid;

    fflush(stdout);
    pid = fork();
    if (pid)
        return pid < 0 ? -errno : pid;
    prctl(PR_SET_PDEATHSIG, SIGTERM); /* a demo that is killed leaves nothing behind */
    setpgid(0, 0);
    if (!freopen(s->log, "a", stderr) || !freopen("/dev/null", "r", stdin) || dup2(2, 1) < 0)
        _exit(127);
    signal(SIGPIPE, SIG_DFL);
    execv(argv[0], (char *const *)(uintptr_t)argv);
    _exit(127);
}

static int start(struct site *s)
{
    char sim[SST_PATH_MAX], daemon[SST_PATH_MAX], program[SST_PATH_MAX];
    const char *const service[] = { sim, "--world", s->world, "--", daemon, "--config", s->config, NULL };
    const char *const publisher[] = { program, "--config", s->config, NULL };
    int err = need_program(sim, "sst-sim");

    err = err ? err : need_program(daemon, "sstd");
    err = err ? err : write_files(s);
    if (err)
        return err;
    (void)unlink(s->log);
    s->pid = start_program(s, service);
    if (s->pid < 0) {
        err = s->pid;
        s->pid = 0;
    }
    for (size_t i = 0; i < ARRAY_LEN(publishers) && !err; i++)
        if (!find_program(program, publishers[i]))
            s->publisher[i] = sst_max_int(start_program(s, publisher), 0);
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

/** Last line of what the programs said. */
static void report_end(const struct site *s)
{
    static const char prefix[] = "sst: error: ";
    const char *said;
    char line[512], last[512] = "";
    FILE *f = fopen(s->log, "re");

    while (f && fgets(line, sizeof(line), f))
        if (strstr(line, "error"))
            memcpy(last, line, sizeof(last));
    if (f)
        fclose(f);
    last[strcspn(last, "\n")] = 0;
    said = last + (strncmp(last, prefix, strlen(prefix)) ? 0 : strlen(prefix));
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

/** The service's first see-through picture, into a file. @return 0, -EAGAIN: not yet */
static int first_picture(const struct site *s)
{
    const struct sst_client_service where = { .socket = s->socket };
    struct sst_client *client = NULL;
    char held[SST_LOG_MAX];
    json_t *o = status(s);
    const json_t *ready = o ? cli_member(o, "live.ready") : NULL;
    int err = json_is_true(ready) ? 0 : -EAGAIN;

    json_decref(o);
    if (err)
        return err;
    sst_log_hold_errors(held);
    err = sst_client_open(&client, &where);
    if (!err)
        err = sst_client_save(client, "/snapshot", "image/jpeg", s->picture);
    sst_client_close(client);
    sst_log_hold_errors(NULL);
    return err ? -EAGAIN : 0;
}

static void print_address(const struct site *s, double seconds)
{
    char token[128] = "";
    FILE *f = fopen(s->token, "re");

    if (f && !fgets(token, sizeof(token), f))
        token[0] = 0;
    if (f)
        fclose(f);
    token[strcspn(token, "\n")] = 0;
    printf("%s: seen through after %.0f s\n  page     http://127.0.0.1:%d/?token=%s\n  picture  %s\n"
           "  status   sst status --socket %s\n",
           s->scene, seconds, s->port, token, s->picture, s->socket);
    fflush(stdout);
}

/** Start a site and wait for its first picture. @return 0, -EINTR, -ECHILD (it ended; logged), -ETIMEDOUT (logged) */
static int bring_up(struct site *s)
{
    const int64_t start_ns = sst_clock_now_ns();
    int64_t reported_ns = start_ns;
    int err = start(s);

    if (err)
        return err;
    printf("%s: starting 36 simulated cameras and the service (a world that is new here is prepared first)\n",
           s->scene);
    fflush(stdout);
    while (first_picture(s)) {
        const int64_t now_ns = sst_clock_now_ns();

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
            reported_ns = now_ns;
            printf("  %.0f s ...\n", (double)(now_ns - start_ns) / 1e9);
            fflush(stdout);
        }
        nanosleep(&(struct timespec){ .tv_nsec = STEP_MS * 1000000 }, NULL);
    }
    print_address(s, (double)(sst_clock_now_ns() - start_ns) / 1e9);
    return 0;
}

static int watch_sites(struct site *sites, int n)
{
    while (!interrupted) {
        for (int i = 0; i < n; i++)
            if (!runs(&sites[i])) {
                report_end(&sites[i]);
                return CLI_INTERNAL;
            }
        nanosleep(&(struct timespec){ .tv_nsec = STEP_MS * 1000000 }, NULL);
    }
    return CLI_OK;
}

int cli_demo_live(const struct cli_demo_live *demo)
{
    const struct sigaction act = { .sa_handler = on_signal };
    struct site *sites = calloc(CLI_DEMO_SCENES, sizeof(*sites));
    char dir[PATH_MAX];
    int n = 0, err = sites ? 0 : -ENOMEM, code;

    for (int i = 0; i < CLI_DEMO_SCENES && demo->scene[i] && !err; i++)
        err = try_port(demo->port + i);
    err = err ? err : sst_path_make_dir(demo->out);
    if (!err && !realpath(demo->out, dir))
        err = -errno;
    sigaction(SIGINT, &act, NULL);
    sigaction(SIGTERM, &act, NULL);
    for (int i = 0; i < CLI_DEMO_SCENES && demo->scene[i] && !err; i++) {
        struct site *s = &sites[n++];

        s->scene = demo->scene[i];
        s->port = demo->port + i;
        err = name_files(s, dir);
        err = err ? err : bring_up(s);
    }
    code = err == -EINTR ? CLI_OK : err == -ECHILD || err == -ETIMEDOUT ? CLI_INTERNAL : cli_exit_code(err);
    if (!err) {
        printf("Ctrl-C ends it.\n");
        fflush(stdout);
        code = watch_sites(sites, n);
    }
    for (int i = n - 1; i >= 0; i--)
        stop(&sites[i]);
    free(sites);
    return code;
}
