/* Fuzz target: archives and manifests of videos for others, and subscriptions to notifications. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "capture/evidence/evidence.h"
#include "daemon/publish/push_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static char path[] = "/tmp/sst-fuzz-XXXXXX.zip";

static void clean_up(void)
{
    (void)unlink(path);
}

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    /* An archive of one empty manifest, and a subscription. */
    static const uint8_t zip[] = { 'P', 'K', 3,   4,   10,  0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   2,   0,   0,   0,
                                   2,   0,   0,   0,   13,  0,   0,   0,   'm', 'a', 'n', 'i', 'f', 'e', 's', 't', '.', 'j', 's', 'o', 'n', '{',
                                   '}', 'P', 'K', 1,   2,   10,  3,   10,  0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   2,
                                   0,   0,   0,   2,   0,   0,   0,   13,  0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,
                                   0,   0,   0,   0,   0,   'm', 'a', 'n', 'i', 'f', 'e', 's', 't', '.', 'j', 's', 'o', 'n', 'P', 'K', 5,   6,
                                   0,   0,   0,   0,   1,   0,   1,   0,   59,  0,   0,   0,   45,  0,   0,   0,   0,   0 };
    static const char subscription[] =
        "{\"endpoint\":\"https://fcm.googleapis.com/x\",\"p256dh\":\"BCVxsr7N_eNgVRqvHtD0zTZsEc6-VV-JvLexhqUzORcxaOzi6-AYWXvTBHm4bjyPjs7Vd8pZGH6S"
        "RpkNtoIAiw4\",\"auth\":\"BTBZMqHH6r4Tts7J_aSIgg\",\"labels\":[\"a\"],\"zones\":[],\"cool_down_s\":1}";

    seed_write("evidence", 0, zip, sizeof(zip));
    seed_write("evidence", 1, subscription, sizeof(subscription) - 1);
    atexit(clean_up);
    return close(mkstemps(path, 4));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const int fd = open(path, O_WRONLY | O_TRUNC | O_CLOEXEC);
    struct sst_push_settings settings = { .enabled = true };
    char said[SST_LOG_MAX], *held = sst_log_hold_errors(said), error[512], origin[300];
    json_t *o = json_loadb((const char *)data, size, 0, NULL);
    struct push_subscription s;
    struct sst_verdict v;

    if (fd < 0 || write(fd, data, size) != (ssize_t)size)
        abort();
    close(fd);
    if (!sst_evidence_verify(path, NULL, &v)) {
        if (v.good || !v.text[0]) /* nobody signed it */
            abort();
        json_decref(v.manifest);
    }
    if (push_subscription_of(o, &s, error) && !push_check_endpoint(&settings, s.endpoint, origin, error) &&
        strncmp(origin, "https://", 8) != 0)
        abort();
    json_decref(o);
    sst_log_hold_errors(held);
    return 0;
}
