/* capture/evidence/evidence.h - signed manifests of exported videos: hashes of files, facts about them, and an Ed25519 signature. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_EVIDENCE_EVIDENCE_H
#define SST_CAPTURE_EVIDENCE_EVIDENCE_H

#include <jansson.h>
#include <stdbool.h>

#include "base/base.h"

/*
 * A manifest file is {"manifest": {...}, "key": PEM of the public key, "signature": Base64}. Signed is the text of `manifest`
 * with sorted keys and without blanks, as `jq -jcS .manifest` writes it; fractions, which programs write in different ways, are not
 * allowed. Its members: "format": SST_EVIDENCE_FORMAT, "files":
 * [{"name", "bytes", "sha256", "crc32", ...}], others as the maker likes. A case is a ZIP archive with SST_EVIDENCE_MANIFEST.
 */
#define SST_EVIDENCE_FORMAT   "sst-manifest-1"
#define SST_EVIDENCE_MANIFEST "manifest.json"
#define SST_EVIDENCE_PEM      256 /* bytes of a public key as PEM, at most */
#define SST_EVIDENCE_PRINT    65  /* bytes of a fingerprint: SHA-256 of the key's DER, as digits, and a 0 */

/**
 * Public key of the private key in a file, which is made at the first call: 0600, never replaced.
 * @return 0, -EBADMSG (the file has no such key), -ENOTSUP (built without GnuTLS), -ENOMEM, or of the file; logged
 */
SST_MUST_CHECK int sst_evidence_key(const char *path, char pem[SST_EVIDENCE_PEM], char print[SST_EVIDENCE_PRINT]);

/** Sign a manifest without fractions. @param key  path as of sst_evidence_key() @param manifest  its reference is taken @return the content of a
 *  manifest file, or NULL: logged */
json_t *sst_evidence_sign(const char *key, json_t *manifest);

/** Hashes of a file. */
struct sst_evidence_hash {
    int64_t bytes;
    char sha256[65];
    uint32_t crc32;
};

/** Read a part of an open file and compute its hashes. @param bytes  -1: up to its end @param wanted  asked once a MB;
 *  false: -ECANCELED. NULL: not asked @return also -EIO, -EBADMSG (it is shorter), -ENOTSUP, -ENOMEM; not logged */
struct sst_evidence_part {
    int fd;
    int64_t at, bytes;
    bool (*wanted)(void *arg);
    void *arg;
};
SST_MUST_CHECK int sst_evidence_hash(const struct sst_evidence_part *part, struct sst_evidence_hash *out);

/** Result of a verification. */
struct sst_verdict {
    bool good;
    char text[640];  /* one sentence: that it is as signed, or the first difference */
    int files;       /* that were compared */
    json_t *manifest; /* if its signature fits; owned by the caller */
    char print[SST_EVIDENCE_PRINT];
};

/**
 * Compare a video with the manifest beside it (NAME.json), all files of a manifest with those beside it, or a case (.zip) with
 * its own.
 * @param key  file of the expected public key (PEM); NULL: the key of the manifest is taken
 * @return 0 (also if it differs), or an error of reading, logged
 */
SST_MUST_CHECK int sst_evidence_verify(const char *path, const char *key, struct sst_verdict *out);

#endif
