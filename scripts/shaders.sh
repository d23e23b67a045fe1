#!/usr/bin/env bash
# shaders.sh NAME... : lists for C of the shaders pipeline/kernels/NAME.comp: X(NAME, name), and of the variants among them, which end with
# _dot, _matrix or _subgroup, V(NAME, name, NAME of the shader that it is a variant of, ABILITY, word of SST_GPU_VARIANT).
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
list() { # the list, its macro, the names
  printf '#define %s(%s)' "$1" "$2"
  for name in "${@:3}"; do
    of=${name%_*} word=${name##*_}
    [ "$2" = X ] && printf ' X(%s, %s)' "${name^^}" "$name" || printf ' V(%s, %s, %s, %s, "%s")' "${name^^}" "$name" "${of^^}" "${word^^}" "$word"
  done
  echo
}
plain=() variants=()
for name in "$@"; do
  case $name in *_dot|*_matrix|*_subgroup) variants+=("$name");; *) plain+=("$name");; esac
done
list SST_GPU_SHADER_LIST X "${plain[@]}"
list SST_GPU_VARIANT_LIST V "${variants[@]}"
