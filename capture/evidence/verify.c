/* Verification: signature first, then size and SHA-256 of each file. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "capture/evidence/evidence_internal.h"

#define MANIFEST_MOST ((size_t)4 << 20)

/* A verification: files are beside a manifest, or in an archive. */
struct check {
    char dir[SST_PATH_MAX];
    int archive; /* -1: none */
    struct evidence_entry *entry;
    int entries;
    struct sst_verdict *out;
};

/* Names come from foreign files: a terminal must not obey their control characters. */
static void make_plain(char *text)
{
    sst_text_make_utf8(text);
    for (; *text; text++) {
        const uint8_t c = (uint8_t)*text, next = (uint8_t)text[1];

        if (c < ' ' || c == 127)
            *text = '?';
        else if (c == 0xc2 && next >= 0x80 && next < 0xa0) /* U+0080..U+009F */
            text[0] = text[1] = '?';
    }
}

static SST_PRINTF(2, 3) int differs(struct sst_verdict *v, const char *fmt, ...)
{
    va_list args;

    va_start(args, fmt);
    vsnprintf(v->text, sizeof(v->text), fmt, args);
    va_end(args);
    make_plain(v->text);
    v->good = false;
    return 1;
}

static const char *text_of(const json_t *o, const char *key)
{
    const char *text = json_string_value(json_object_get(o, key));

    return text ? text : "";
}

/* --- the manifest ------------------------------------------------------------------------------------------------- */

/* @return 0, 1: the verdict is made, or an error, logged */
static int check_key(struct sst_verdict *out, const char *pem, const char *key_path)
{
    char wanted[SST_EVIDENCE_PRINT];
    uint8_t *data;
    size_t size;
    int err = evidence_print(pem, out->print);

    if (err == -EBADMSG)
        return differs(out, "the manifest has no Ed25519 key, so that nothing proves its origin");
    if (err || !key_path)
        return err;
    err = sst_file_read(key_path, MANIFEST_MOST, &data, &size);
    if (err)
        return err;
    err = evidence_print((const char *)data, wanted);
    free(data);
    if (err) {
        sst_log_error("%s is no Ed25519 public key; get it from the service: sst record key", key_path);
        return err;
    }
    if (strcmp(wanted, out->print) != 0)
        return differs(out, "another key signed it: %.16s..., and not %.16s... of %.128s", out->print, wanted, key_path);
    return 0;
}

static int check_manifest(struct sst_verdict *out, const uint8_t *data, size_t size, const char *key_path)
{
    json_t *root = json_loadb((const char *)data, size, JSON_REJECT_DUPLICATES, NULL);
    json_t *manifest = json_object_get(root, "manifest");
    char *text = manifest ? evidence_text(manifest) : NULL;
    int err;

    if (!json_is_object(manifest) || strcmp(text_of(manifest, "format"), SST_EVIDENCE_FORMAT) != 0 || !text)
        err = differs(out, "its manifest is none of this program, or damaged");
    else
        err = check_key(out, text_of(root, "key"), key_path);
    if (!err) {
        err = evidence_check(text_of(root, "key"), text, text_of(root, "signature"));
        if (err == -EKEYREJECTED || err == -EBADMSG)
            err = differs(out, "the manifest was changed after it was signed: its signature does not fit");
    }
    if (!err)
        out->manifest = json_incref(manifest);
    free(text);
    json_decref(root);
    return err;
}

/* --- files -------------------------------------------------------------------------------------------------------- */

/* Open a file of the manifest. @param close_it  out @return 0, -ENOENT, or another error; logged but for -ENOENT */
static int open_part(const struct check *c, const char *name, struct sst_evidence_part *part, bool *close_it)
{
    char path[SST_PATH_MAX];
    int err;

    *part = (struct sst_evidence_part){ .fd = c->archive, .bytes = -1 };
    *close_it = c->archive < 0;
    for (int i = 0; i < c->entries; i++) {
        if (strcmp(c->entry[i].name, name))
            continue;
        part->at = c->entry[i].at;
        part->bytes = c->entry[i].bytes;
        return 0;
    }
    if (c->archive >= 0 || strchr(name, '/'))
        return -ENOENT;
    err = sst_path_join(path, c->dir, name);
    part->fd = err ? err : sst_file_open(path);
    if (part->fd < 0 && part->fd != -ENOENT)
        sst_log_error("cannot read %s: %s", path, strerror(-part->fd));
    return part->fd < 0 ? part->fd : 0;
}

/* @param name  of the file now @return 0, 1: the verdict is made, or an error, logged */
static int check_file(const struct check *c, const json_t *file, const char *name)
{
    const char *sha256 = text_of(file, "sha256");
    const json_int_t bytes = json_integer_value(json_object_get(file, "bytes"));
    struct sst_evidence_part part;
    struct sst_evidence_hash hash;
    bool close_it;
    int err = open_part(c, name, &part, &close_it);

    if (err == -ENOENT)
        return differs(c->out, "%.128s is missing: the manifest names it", name);
    if (err)
        return err;
    err = sst_evidence_hash(&part, &hash);
    if (close_it)
        close(part.fd);
    if (err == -EBADMSG)
        return differs(c->out, "%.128s is cut off", name);
    if (err) {
        sst_log_error("cannot read %s: %s", name, strerror(-err));
        return err;
    }
    c->out->files++;
    if (hash.bytes != bytes)
        return differs(c->out, "%.128s was changed: it has %lld bytes, signed were %lld", name, (long long)hash.bytes,
                       (long long)bytes);
    if (strcmp(hash.sha256, sha256) != 0)
        return differs(c->out, "%.128s was changed: its SHA-256 is %.16s..., signed was %.16s...", name, hash.sha256,
                       sha256);
    return 0;
}

/* The entry of one file, by its name; a video that was renamed is the only one. @return NULL: none */
static const json_t *entry_of(const struct check *c, const char *name)
{
    const json_t *files = json_object_get(c->out->manifest, "files"), *file, *video = NULL;
    int videos = 0;
    size_t i;

    json_array_foreach(files, i, file)
    {
        if (!strcmp(name, text_of(file, "name")))
            return file;
        if (sst_text_ends(text_of(file, "name"), ".mp4")) {
            video = file;
            videos++;
        }
    }
    return videos == 1 ? video : NULL;
}

/* @param only  NULL: all files */
static int check_files(const struct check *c, const char *only)
{
    const json_t *file = only ? entry_of(c, only) : NULL;
    size_t i;
    int err = 0;

    if (only)
        return file ? check_file(c, file, only) : differs(c->out, "the manifest does not name %.128s", only);
    json_array_foreach(json_object_get(c->out->manifest, "files"), i, file)
        err = err ? err : check_file(c, file, text_of(file, "name"));
    for (int k = 0; !err && k < c->entries; k++) {
        bool named = !strcmp(c->entry[k].name, SST_EVIDENCE_MANIFEST);

        json_array_foreach(json_object_get(c->out->manifest, "files"), i, file)
            named |= !strcmp(c->entry[k].name, text_of(file, "name"));
        if (!named)
            err = differs(c->out, "%.128s was added: the manifest does not name it", c->entry[k].name);
    }
    return err;
}

static int read_archive(struct check *c, const char *path, uint8_t **data, size_t *size)
{
    const int n = c->archive < 0 ? c->archive : evidence_entries(c->archive, &c->entry);

    if (n == -EDOM)
        return differs(c->out, "another program packed this archive again, compressed: unpack it and verify its " SST_EVIDENCE_MANIFEST);
    if (n == -EBADMSG)
        return differs(c->out, "it is no whole ZIP archive, or has bytes that its list does not name");
    if (n < 0) {
        sst_log_error("cannot read %s: %s", path, strerror(-n));
        return n;
    }
    c->entries = n;
    for (int i = 0; i < n; i++) /* unpackers keep the last */
        for (int k = 0; k < i; k++)
            if (!strcmp(c->entry[k].name, c->entry[i].name))
                return differs(c->out, "%.128s is in it twice", c->entry[i].name);
    for (int i = 0; i < n; i++) {
        if (strcmp(c->entry[i].name, SST_EVIDENCE_MANIFEST) != 0 || c->entry[i].bytes > (int64_t)MANIFEST_MOST)
            continue;
        *size = (size_t)c->entry[i].bytes;
        *data = malloc(*size + 1);
        if (!*data)
            return -ENOMEM;
        return pread(c->archive, *data, *size, c->entry[i].at) == (ssize_t)*size
                   ? 0
                   : differs(c->out, "its " SST_EVIDENCE_MANIFEST " is cut off");
    }
    return differs(c->out, "it has no " SST_EVIDENCE_MANIFEST);
}

/* The manifest beside a video: NAME.json beside NAME.mp4. */
static int read_beside(struct check *c, const char *path, uint8_t **data, size_t *size)
{
    char manifest[SST_PATH_MAX];
    const char *base = sst_path_base(path), *dot = strrchr(base, '.');

    snprintf(c->dir, sizeof(c->dir), "%.*s", base == path ? 1 : (int)(base - path), base == path ? "." : path);
    snprintf(manifest, sizeof(manifest), "%.*s.json", dot ? (int)(dot - path) : (int)strlen(path), path);
    if (!sst_path_exists(path)) {
        sst_log_error("%s does not exist", path);
        return -ENOENT;
    }
    if (!sst_path_exists(manifest)) {
        sst_log_error("%s has no manifest beside it: %s is missing; the page saves it by Manifest beside the video", path,
                      sst_path_base(manifest));
        return -ENOENT;
    }
    return sst_file_read(manifest, MANIFEST_MOST, data, size);
}

int sst_evidence_verify(const char *path, const char *key, struct sst_verdict *out)
{
    const bool zip = sst_text_ends(path, ".zip"), alone = !zip && !sst_text_ends(path, ".json");
    struct check c = { .archive = -1, .out = out };
    uint8_t *data = NULL;
    size_t size = 0;
    int err;

    *out = (struct sst_verdict){ .good = false };
    if (zip)
        c.archive = sst_file_open(path);
    err = zip ? read_archive(&c, path, &data, &size) : read_beside(&c, path, &data, &size);
    err = err ? err : check_manifest(out, data, size, key);
    err = err ? err : check_files(&c, alone ? sst_path_base(path) : NULL);
    if (!err) {
        out->good = true;
        snprintf(out->text, sizeof(out->text), "%d file%s as signed on %.32s at %.128s by %.32s", out->files,
                 out->files == 1 ? " is" : "s are", text_of(out->manifest, "made"), text_of(out->manifest, "site"),
                 text_of(out->manifest, "program"));
        make_plain(out->text);
    }
    if (c.archive >= 0)
        close(c.archive);
    free(c.entry);
    free(data);
    if (err == -ENOTSUP)
        sst_log_error("verifying needs GnuTLS; install it and build again");
    return err > 0 ? 0 : err;
}
