/* sst topology: prints the tree of USB controllers, hubs and cameras. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>

#include "cli/cli_internal.h"

static const char *const switching_names[] = { "unknown", "none", "ganged", "ports" };
static const char *const switching_texts[] = { "no permission to query port power", "no port power switching",
                                               "switches all ports together", "switches each port" };

static json_t *device_json(const struct sst_usb_device *d, const struct sst_usb_device *list)
{
    json_t *alts = json_array();
    json_t *one =
        json_pack("{s:s, s:s?, s:s, s:i, s:i, s:i, s:b, s:i, s:i, s:o, s:o, s:o, s:s, s:o}", "port", d->port, "parent",
                  d->parent < 0 ? NULL : list[d->parent].port, "controller", d->controller, "bus", d->bus, "address",
                  d->address, "speed_mbit", d->speed_mbit, "hub", d->hub, "vendor", d->vendor, "product", d->product,
                  "maker", cli_text_json(d->maker), "name", cli_text_json(d->name), "serial", cli_text_json(d->serial),
                  "node", d->node, "settings", alts);

    for (int i = 0; i < d->alts; i++)
        json_array_append_new(alts, json_pack("{s:i, s:b, s:i, s:i}", "number", d->alt[i].number, "isochronous",
                                              d->alt[i].isochronous, "packet_bytes", d->alt[i].packet_bytes,
                                              "interval_us", d->alt[i].interval_us));
    if (d->hub) {
        json_object_set_new(one, "ports", json_integer(d->hub_ports));
        json_object_set_new(one, "single_tt", json_boolean(d->single_tt && d->speed_mbit == 480));
        json_object_set_new(one, "power_switching", json_string(switching_names[sst_usb_hub_switching(d)]));
    }
    return one;
}

static int print_json(const struct sst_usb_device *list, int n)
{
    json_t *devices = json_array();
    json_t *root = json_pack("{s:o}", "devices", devices);

    for (int i = 0; i < n; i++)
        json_array_append_new(devices, device_json(&list[i], list));
    return cli_dump_json(root, JSON_INDENT(2));
}

static void print_hub(const struct sst_usb_device *d)
{
    printf("%s, %d ports", d->parent < 0 ? "root hub" : "hub", d->hub_ports);
    if (d->parent >= 0 && d->speed_mbit == 480)
        printf(d->single_tt ? ", one translator" : ", a translator each");
    printf(", %s", switching_texts[sst_usb_hub_switching(d)]);
    if (d->parent >= 0)
        printf("  [%s %s]", d->maker, d->name);
    printf("\n");
}

static void print_device(const struct sst_usb_device *d)
{
    int largest = 0;

    for (int i = 0; i < d->alts; i++)
        largest = sst_max_int(largest, d->alt[i].packet_bytes);
    if (d->alts)
        printf("camera %s %s  %d settings up to %d bytes a packet", d->serial[0] ? d->serial : "without a serial",
               d->node[0] ? d->node : "without a node", d->alts, largest);
    else
        printf("%s", d->node[0] ? d->node : "device");
    printf("  [%s %s]\n", d->maker, d->name);
}

static void print_tree(const struct sst_usb_device *list, int n)
{
    if (!n)
        printf("this machine has no USB\n");
    for (int i = 0; i < n; i++) {
        const struct sst_usb_device *d = &list[i];
        int depth = 0;

        for (int up = d->parent; up >= 0; up = list[up].parent)
            depth++;
        if (d->parent < 0)
            printf("controller %s\n", d->controller);
        printf("%*s%-*s %5d Mbit/s  ", 2 * depth + 2, "", sst_max_int(16 - 2 * depth, 1), d->port, d->speed_mbit);
        if (d->hub)
            print_hub(d);
        else
            print_device(d);
    }
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_usb_device *list;
    bool json = false;
    const struct cli_option options[] = {
        { "json", 0, CLI_FLAG, &json, NULL, "print one JSON object" },
    };
    int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    int n, err;

    if (r != CLI_GO_ON)
        return r;
    r = CLI_OK;
    err = sst_usb_list(&list, &n);
    if (err)
        return cli_exit_code(err);
    if (json)
        r = print_json(list, n);
    else
        print_tree(list, n);
    free(list);
    return r;
}

const struct cli_command cli_topology = { "topology", run };
