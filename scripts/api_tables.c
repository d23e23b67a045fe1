/* Prints the tables of routes, of fields and of the configuration as JSON, for scripts/openapi.py and config_man.py. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <jansson.h>

#include "config/schema.h"
#include "daemon/publish/http.h"
#include "daemon/service/service.h"

static json_t *fields_json(const struct sst_field *row)
{
    static const char *const types[] = { "",       "bool",   "integer", "real",    "text", "name", "time",
                                         "choice", "spread", "object",  "pointer", "map",  "list", "json" };
    json_t *list = json_array();

    for (; row->type; row++) {
        json_t *names = json_array();

        for (size_t i = 0; row->names && i < row->count; i++)
            json_array_append_new(names, json_string(row->names[i]));
        json_array_append_new(list, json_pack("{s:s?, s:s, s:s, s:s?, s:s?, s:s?, s:o, s:i, s:b, s:o}", "key", row->key,
                                              "type", types[row->type], "item", types[row->item], "help", row->help,
                                              "metric", row->metric, "label", row->label, "names", names, "count",
                                              row->count_at ? 0 : (int)row->count, "nullable",
                                              row->nullable || row->given || row->type == SST_FIELD_POINTER, "of",
                                              row->of ? fields_json(row->of) : json_null()));
    }
    return list;
}

static json_t *keys_json(const struct sst_key *key, int n)
{
    json_t *list = json_array();

    for (; n > 0; n--, key++) {
        json_t *names = json_array();

        for (int i = 0; i < key->n_names; i++)
            json_array_append_new(names, json_string(key->names[i]));
        json_array_append_new(list, json_pack("{s:s, s:s, s:i, s:i, s:f, s:f, s:s?, s:s?, s:o, s:i, s:b, s:o}", "section",
                                              key->section, "name", key->name, "type", key->type, "kind", key->kind,
                                              "min", key->min, "max", key->max, "word", key->word, "standard",
                                              key->standard, "names", names, "reload", key->reload, "switches",
                                              key->switches, "fields", keys_json(key->fields, key->n_fields)));
    }
    return list;
}

int main(void)
{
    static const char *const roles[] = { "anyone", "view", "control" };
    json_t *list = json_array(), *events = json_array();
    const struct sst_route *routes;
    const struct sst_key *keys;
    int count;

    routes = sst_http_routes(&count);
    for (int i = 0; i < count; i++) {
        json_t *query = json_array();

        for (int k = 0; routes[i].query[k]; k++)
            json_array_append_new(query, json_string(routes[i].query[k]));
        json_array_append_new(list, json_pack("{s:s, s:s, s:s, s:s, s:o}", "method", routes[i].method, "path",
                                              routes[i].path, "role", roles[routes[i].role], "what", routes[i].what,
                                              "query", query));
    }
    for (int i = 1; i < sst_event_types_count; i++)
        json_array_append_new(events, json_string(sst_event_types[i]));
    keys = sst_schema(&count);
    return json_dumpf(json_pack("{s:o, s:o, s:o, s:o, s:o, s:s}", "routes", list, "status",
                                fields_json(sst_service_status_fields), "cameras",
                                fields_json(sst_service_cameras_fields), "keys", keys_json(keys, count), "events",
                                events, "version", SST_VERSION),
                      stdout, JSON_INDENT(1)) ||
           fflush(stdout);
}
