#!/usr/bin/env bash
# Make the pictures of docs/ with the program itself: doc_pictures.sh [DATA]. Needs imagemagick for shrinking and joining.
# DATA holds lf-shop-6x6, lf-stanford-chess-6x6 and lf-hci-backgammon-6x6; without it only the simulated scenes are made.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/.."
data=${1:-../shared/data}
sst=build/sst
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p docs/pictures

for scene in bush pedestrian transportation humvee cat cell cd-cases; do
  $sst demo --scene "$scene" --once -o "$work/$scene" >/dev/null
  convert "$work/$scene/side-by-side.png" -resize 1000x -quality 82 "docs/pictures/$scene.jpg"
done

focus=$(sed -n 's/.*"focus_px": *\([0-9.]*\).*/\1/p' "$work/bush/bush/truth/truth.json" | head -n 1)
$sst render "$work/bush/bush" --focus "$focus" --explain "$work/why" -o "$work/seen.png"
montage "$work"/why/{disparity,labels_hcsm,labels,weight}.png -tile 2x2 -geometry 500x375+3+3 "$work/explain.png"
convert "$work/explain.png" -quality 85 docs/pictures/explain.jpg

table=$work/transportation/transportation
montage "$table"/{labels_initial,labels_hcsm,labels,truth}/02_02.png -tile 2x2 -geometry 500x375+3+3 "$work/table.png"
convert "$work/table.png" -quality 85 docs/pictures/refinement.jpg

$sst scene forest -o "$work/forest" --seed 4
for method in refocus clear; do
  $sst render "$work/forest" --near 25 --far 45 --view C5 --method $method -o "$work/forest-$method.png"
done
$sst find "$work/forest" --near 25 --far 45 --view C5 -o "$work/forest-finds"
montage "$work/forest/views/0005.png" "$work"/forest-{refocus,clear}.png "$work/forest-finds/finds.png" -tile 2x2 \
  -geometry 500x500+3+3 "$work/forest.png"
convert "$work/forest.png" -quality 82 docs/pictures/forest.jpg

real() { # name, format, folder, focus
  [ -d "$data/$3" ] || { echo "no $data/$3: docs/pictures/$1.jpg stays as it is"; return 0; }
  $sst import "$2" "$data/$3" -o "$work/$1"
  $sst process "$work/$1" --no-labels
  $sst render "$work/$1" --focus "$4" -o "$work/$1-sst.png" --explain "$work/$1-why"
  $sst render "$work/$1" --focus "$4" --method refocus -o "$work/$1-plain.png"
  local view
  view=$(ls "$work/$1/views"/02_02.*)
  montage "$view" "$work/$1-plain.png" "$work/$1-sst.png" "$work/$1-why/disparity.png" -tile 2x2 -geometry 500x+3+3 \
    "$work/$1.png"
  convert "$work/$1.png" -quality 82 "docs/pictures/$1.jpg"
}
real shop stanford lf-shop-6x6 5
real chess stanford lf-stanford-chess-6x6 0.5
real backgammon hci lf-hci-backgammon-6x6 -1.2
