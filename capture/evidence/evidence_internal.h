/* capture/evidence/evidence_internal.h - private declarations of this folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_EVIDENCE_EVIDENCE_INTERNAL_H
#define SST_CAPTURE_EVIDENCE_EVIDENCE_INTERNAL_H

#include "capture/evidence/evidence.h"

/** Text that is signed; to free with free(). NULL: no memory */
char *evidence_text(const json_t *manifest);

/** Fingerprint of a public key. @param pem  with any text around it @return 0, -EBADMSG, -ENOTSUP, -ENOMEM; not logged */
SST_MUST_CHECK int evidence_print(const char *pem, char print[SST_EVIDENCE_PRINT]);

/** Check a signature. @param signature  Base64 @return 0, -EKEYREJECTED, -EBADMSG (key or signature malformed),
 *  -ENOTSUP, -ENOMEM; not logged */
SST_MUST_CHECK int evidence_check(const char *pem, const char *text, const char *signature);

/** A file of an archive. */
struct evidence_entry {
    char name[128];
    int64_t at, bytes; /* of its content in the archive */
};

/** List the files of a ZIP archive without compression, which is these files one after the other and nothing else. @param
 *  out  to free with free() @return number, -EBADMSG (no such archive), -EDOM (compressed), -EIO, -ENOMEM; not logged */
SST_MUST_CHECK int evidence_entries(int fd, struct evidence_entry **out);

#endif
