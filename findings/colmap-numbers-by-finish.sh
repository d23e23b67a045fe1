#!/usr/bin/env bash
# COLMAP 3.8: the numbers of images and cameras in a database (IMAGE_ID, CAMERA_ID) follow neither the names of the files nor the order of
# reading, but the order in which threads finish with them: the same command numbers the same folder otherwise from run to run, and a large first
# picture comes last. With `--SiftExtraction.num_threads 1` they follow the names. A model made by hand must have the database's numbers.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack colmap=3.8-1 $(needed_by colmap)
/usr/bin/python3 - <<'P'
import numpy as np
from PIL import Image
rng = np.random.default_rng(1)
for name, w, h in (("a", 2400, 1800), ("b", 240, 180), ("c", 320, 240)): 
    noise = Image.fromarray(rng.integers(0, 255, (h // 6, w // 6, 3), dtype=np.uint8))
    noise.resize((w, h), Image.BICUBIC).save("pictures_%s.png" % name)
P
mkdir pictures && for n in a b c; do mv pictures_$n.png pictures/$n.png; done
export QT_QPA_PLATFORM=offscreen
for threads in 2 1; do
  colmap feature_extractor --database_path db$threads --image_path pictures --SiftExtraction.use_gpu 0 --SiftExtraction.num_threads $threads >log 2>&1
  /usr/bin/python3 -c 'import sqlite3, sys
print(sys.argv[2], "threads:", *(n for _, n in sorted(sqlite3.connect(sys.argv[1]).execute("select image_id, name from images"))))' db$threads $threads
done | tee seen
holds "with several threads the first picture is not number 1 where it takes longest" \
  awk '/^2/ && $3 == "a.png" { bad = 1 } /^1/ && $0 !~ /a.png b.png c.png/ { bad = 1 } END { exit bad || NR != 2 }' seen
# Seen: 2 threads: b.png c.png a.png; 1 threads: a.png b.png c.png
