/* Cameras of the service as a grid of frame rates, seen from behind. */
#include <stdio.h>
#include <string.h>

#include "cli/cli_internal.h"

#define SIDE_MAX 256
#define TEXT     300

static const json_t *camera_at(const json_t *list, int row, int col)
{
    const json_t *cam;
    size_t i;

    json_array_foreach(list, i, cam)
    {
        if (cli_number(cam, "row") == row && cli_number(cam, "col") == col)
            return cam;
    }
    return NULL;
}

static bool streams(const json_t *cam)
{
    char state[TEXT];

    return !strcmp(cli_text(cam, "state", state, sizeof(state)), "streaming");
}

static void print_cell(const json_t *cam)
{
    char state[TEXT];

    if (!cam)
        printf(" %7s", "-");
    else if (streams(cam))
        printf(" %7.1f", cli_number(cam, "rate_hz"));
    else
        printf(" %7.7s", cli_text(cam, "state", state, sizeof(state)));
}

static void print_camera(const json_t *cam)
{
    char name[TEXT], state[TEXT], serial[TEXT], port[TEXT], reason[TEXT];

    cli_text(cam, "serial", serial, sizeof(serial));
    cli_text(cam, "port", port, sizeof(port));
    printf("%-8s %-11s %-14s %-10s %7.1f %9.0f %6.0f %6.0f  %s\n", cli_text(cam, "name", name, sizeof(name)),
           cli_text(cam, "state", state, sizeof(state)), *serial ? serial : "-", *port ? port : "-",
           cli_number(cam, "rate_hz"), cli_number(cam, "frames"), cli_number(cam, "bad"), cli_number(cam, "lost"),
           cli_text(cam, "reason", reason, sizeof(reason)));
}

static int side(const json_t *answer, const char *name)
{
    const double n = cli_number(answer, name);

    return n >= 1 && n <= SIDE_MAX ? (int)n : 0;
}

void cli_print_grid(const json_t *answer, bool all)
{
    const int rows = side(answer, "rows"), cols = side(answer, "cols");
    const json_t *list = cli_member(answer, "cameras"), *cam;
    int streaming = 0;
    bool header = false;
    size_t i;

    json_array_foreach(list, i, cam) streaming += streams(cam);
    printf("%d of %d cameras stream; frames per second, seen from behind:\n     ", streaming,
           (int)json_array_size(list));
    for (int col = 0; col < cols; col++)
        printf(" %5s%-2d", "c", col);
    printf("\n");
    for (int row = 0; row < rows; row++) {
        printf("r%-4d", row);
        for (int col = 0; col < cols; col++)
            print_cell(camera_at(list, row, col));
        printf("\n");
    }
    json_array_foreach(list, i, cam)
    {
        if (!all && streams(cam))
            continue;
        if (!header)
            printf("\n%-8s %-11s %-14s %-10s %7s %9s %6s %6s  %s\n", "CAMERA", "STATE", "SERIAL", "PORT", "RATE",
                   "FRAMES", "BAD", "LOST", "WHY");
        header = true;
        print_camera(cam);
    }
}
