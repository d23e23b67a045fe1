#!/bin/sh
# Writes the light fields for training: make_scenes.sh SST FOLDER SCENE...
# Seeds 100..120 are for training, 150..157 for choosing and fitting; 1..20 are left to tests and never written here.
# Existing light fields are kept.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
sst=$1 folder=$2
shift 2
mkdir -p "$folder"
for seed in $(seq 150 157) $(seq 100 120); do
    [ $((seed % 2)) -eq 0 ] && size=640x480 || size=480x360
    for scene; do
        out=$folder/$scene-$seed
        [ -e "$out" ] || "$sst" scene "$scene" -o "$out" --size $size --grid 2x2 --seed "$seed"
    done
done
