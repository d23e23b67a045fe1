/* Fuzz target: the lines of a day's visits, listed in every way, kept, deleted. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "base/file.h"
#include "daemon/visits/visits.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char seed[] =
        "{\"visit\": \"2026-11-21T18-05-00Z-1\", \"from\": \"2026-11-21T18:05:00.123Z\", \"to\": "
        "\"2026-11-21T18:05:09.000Z\", \"label\": \"Person\", \"zones\": [\"door\"], \"zone\": \"door\", \"active\": "
        "false}\n"
        "{\"visit\": \"2026-11-21T18-05-00Z-2\", \"from\": \"2026-11-21T18:06:00.123Z\", \"to\": null, \"labels\": "
        "{\"Cat\": 0.5}}\n{\"visit\": \"2026-11-21T18-05-00Z-1\", \"fr";

    seed_write("visits", 0, seed, strlen(seed));
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const struct sst_visits_query queries[] = {
        { .limit = 1000 },
        { .from = "2026-11-21T18:05", .to = "2026-11-21T18:06:30.000Z", .label = "Person", .zone = "door", .limit = 1 },
        { .after = "2026-11-21", .user = "view", .reviewed = -1, .limit = 2 },
    };
    char *folder = mkdtemp(input_template()), day[64], file[96];
    struct sst_visits *v;
    FILE *f;

    if (!folder)
        abort();
    snprintf(day, sizeof(day), "%s/2026-11-21", folder);
    snprintf(file, sizeof(file), "%s/visits.jsonl", day);
    (void)mkdir(day, 0777);
    f = fopen(file, "wb");
    if (!f || (size && fwrite(data, 1, size, f) != size) || fclose(f))
        abort();
    if (sst_visits_open(&v, folder, 36500))
        abort();
    for (size_t i = 0; i < ARRAY_LEN(queries); i++) {
        json_t *list = sst_visits_list(v, &queries[i]), *one;
        size_t k;

        json_array_foreach(list, k, one)
        {
            const char *name = json_string_value(json_object_get(one, "visit"));

            if (!name || strchr(name, '/') || name[0] == '.')
                abort();
        }
        json_decref(list);
    }
    json_decref(sst_visits_days(v, &queries[0], 60));
    json_decref(sst_visits_days(v, &queries[1], -60));
    sst_visits_close(v, 1000);
    (void)unlink(file);
    (void)rmdir(day);
    (void)rmdir(folder);
    return 0;
}
