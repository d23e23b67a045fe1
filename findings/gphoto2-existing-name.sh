#!/usr/bin/env bash
# gphoto2 2.5.28: where the file of `--capture-image-and-download` exists and nobody answers the question whether to overwrite it, the old
# file stays, the new picture stays on the camera, a series ends, and the status is 0. A script that goes by the status takes
# the old file for the picture. `--get-all-files` ends with 1 in the same place. --force-overwrite, or a name with a number, cannot meet it.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack gphoto2=2.5.28-2 libgphoto2-6=2.5.30-1 libgphoto2-port12=2.5.30-1 libgphoto2-dev=2.5.30-1 libcdk5nc6 libaa1 libpopt0
cat >captures.c <<'C'
/* The library's own driver "Directory Browse" (a folder as a camera) that captures: the picture is the file in the folder. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <gphoto2/gphoto2.h>
#include <string.h>

int gp_camera_get_abilities(Camera *camera, CameraAbilities *abilities)
{
    int (*next)(Camera *, CameraAbilities *) = dlsym(RTLD_NEXT, "gp_camera_get_abilities");
    const int rc = next(camera, abilities);

    abilities->operations |= GP_OPERATION_CAPTURE_IMAGE;
    return rc;
}

int gp_camera_capture(Camera *camera, CameraCaptureType type, CameraFilePath *path, GPContext *context)
{
    strcpy(path->folder, "/");
    strcpy(path->name, "new.jpg");
    return GP_OK;
}

int gp_camera_file_delete(Camera *camera, const char *folder, const char *file, GPContext *context)
{
    return GP_OK; /* there for the next capture */
}
C
gcc -O1 -w -shared -fPIC -I"$root/usr/include/gphoto2" -I"$root/usr/include" captures.c -o captures.so -ldl
export CAMLIBS=$(echo "$lib"/libgphoto2/*/) IOLIBS=$(echo "$lib"/libgphoto2_port/*/)
mkdir camera && echo new >camera/new.jpg
shoot() { env LD_PRELOAD="$tmp/captures.so" gphoto2 --camera 'Directory Browse' --port "disk:$tmp/camera" "$@" </dev/null >log 2>&1; }
{
  shoot --capture-image-and-download --filename a.jpg && rc=0 || rc=$?; echo "a new name: status $rc, file: $(cat a.jpg)"
  echo old >a.jpg
  shoot --capture-image-and-download --filename a.jpg && rc=0 || rc=$?; echo "an existing name: status $rc, file: $(cat a.jpg)"
  shoot --force-overwrite --capture-image-and-download --filename a.jpg && rc=0 || rc=$?; echo "--force-overwrite: status $rc, file: $(cat a.jpg)"
} | tee seen
printf '%s\n' 'a new name: status 0, file: new' 'an existing name: status 0, file: old' '--force-overwrite: status 0, file: new' >expected
holds "a capture whose file exists ends with status 0 and without the picture" cmp -s seen expected
# Seen: these three lines
