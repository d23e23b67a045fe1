#!/usr/bin/env bash
# `sst import poses`, `sst import pictures`: output lines, and bad sources, each refused in one sentence.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
python=${PYTHON:-/usr/bin/python3}
"$python" -c 'import json' 2>/dev/null || skip "python3 is absent"

"$sst" scene bush -o scene --grid 2x4 --size 96x64 >out 2>err || fail "scene: $(cat err)"
mkdir pictures
i=0
for p in scene/views/*; do i=$((i + 1)); cp "$p" "pictures/leaf $i.png"; done

# make.py DIR [FAULT]: sources of eight views in the folder, with a fault
cat >make.py <<'PY'
import json, math, os, struct, sys
dir, fault = sys.argv[1], (sys.argv[2:] + [""])[0]
os.makedirs(dir, exist_ok=True)
at = lambda name: os.path.join(dir, name)
names = [f"leaf {i + 1}.png" for i in range(8)]
centres = [[0.1 * i, 0.02 * (i % 2), 0.0] for i in range(8)]
one = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]

def colmap():
    lens = {"fisheye": "OPENCV_FISHEYE 96 64 90 90 48 32 0 0 0 0", "focal": "PINHOLE 96 64 1e9 90 48 32",
            "width": "PINHOLE 0 64 90 90 48 32", "short": "PINHOLE 96 64 90 90 48", "unheard": "MOEBIUS 96 64 1",
            "negative": "PINHOLE 96 64 -90 90 48 32", "size": "PINHOLE 192 128 90 90 96 64"}
    open(at("cameras.txt"), "w").write(("\ufeff" if fault == "bom" else "") + "1 " + lens.get(fault, "PINHOLE 96 64 90 90 48 32") + "\n")
    with open(at("images.txt"), "w") as f:
        for i, c in enumerate(centres):
            q = "nan 0 0 0" if fault == "nan" and i == 3 else "2 0 0 0" if fault == "quaternion" else "1 0 0 0"
            name = names[0] if fault == "twice" and i == 5 else "gone.png" if fault == "gone" and i == 5 else names[i]
            camera = 2 if fault == "camera" else 1
            f.write(f"{i + 1} {q} {-c[0]} {-c[1]} {'1e300' if fault == 'far' else -c[2]} {camera} {name}\n" + ("" if fault == "lines" else "\n"))
        for i in range(1017 if fault == "many" else 0):
            f.write(f"{i + 9} 1 0 0 0 0 0 0 1 more {i}.png\n\n")
    z = -2 if fault == "behind" else 2
    with open(at("points3D.txt"), "w") as f:
        for i in range(20):
            f.write(f"{i} {0.03 * i} 0 {'inf' if fault == 'point' else z} 1 2 3 0.5 1 0 2 0 8 0\n")

def binary():
    cameras = struct.pack("<QIiQQ4d", 1, 1, 99 if fault == "model" else 1, 96, 64, 90, 90, 48, 32)
    images = struct.pack("<Q", 8)
    for i, c in enumerate(centres):
        images += struct.pack("<I7dI", i + 1, 1, 0, 0, 0, -c[0], -c[1], 0, 1) + names[i].encode() + b"\0"
        images += struct.pack("<Q", 2**61 if fault == "features" and i == 2 else 0)
    points = struct.pack("<Q", 2**60 if fault == "count" else 1) + struct.pack("<Q3d3sdQ", 1, 0, 0, 2, b"abc", .5, 2**59 if fault == "track" else 0)
    if fault == "cut":
        images = images[:-100]
    if fault == "longer":
        images += b"x"
    if fault == "empty":
        cameras = b""
    for name, data in ("cameras", cameras), ("images", images), ("points3D", points):
        open(at(name + ".bin"), "wb").write(data)

def aos():
    views = []
    for i, c in enumerate(centres):
        R = [r[:] for r in one]
        if fault == "mirror": R[0][0] = -1
        if fault == "scale": R = [[2.5 * v for v in r] for r in R]
        if fault == "shear": R[0][1] = 0.2
        z = 5 if fault == "away" else -5
        M = [R[j] + [-sum(R[j][l] * (c[:2] + [z])[l] for l in range(3))] for j in range(3)]
        if fault == "short": M[2].pop()
        if fault == "word": M[1][1] = "one"
        views.append({"imagefile": names[0] if fault == "twice" else names[i], "M3x4": M})
    if fault == "unnamed": del views[7]["imagefile"]
    json.dump({"images": views[0] if fault == "object" else [] if fault == "empty" else views}, open(at("poses.json"), "w"))
    if fault == "text": open(at("poses.json"), "a").write("}")

def nerf():
    frames = [{"file_path": n, "transform_matrix": [[1, 0, 0, c[0]], [0, -1, 0, c[1]], [0, 0, -1, c[2]], [0, 0, 0, 2 if fault == "row" else 1]]}
              for n, c in zip(names, centres)]
    if fault == "angle": # of the NeRF paper, written on Windows
        for f in frames: f["file_path"] = "train\\" + f["file_path"][:-4]
        json.dump({"camera_angle_x": 2 * math.atan(48 / 90), "frames": frames}, open(at("transforms.json"), "w"))
        return
    json.dump({"camera_model": "OPENCV_FISHEYE" if fault == "fisheye" else "OPENCV", "w": 96, "h": 64, "fl_x": 90, "k4": .1 if fault == "k4" else 0,
               "k1": "much" if fault == "k1" else 0, "cx": [48] if fault == "cx" else None, "applied_transform": [1] if fault == "applied" else [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]],
               "frames": {} if fault == "object" else frames}, open(at("transforms.json"), "w"))

def sfm():
    shots = {n: {"camera": "b" if fault == "camera" else "a", "rotation": [500 if fault == "degrees" else 0, 0, 0], "translation": [-c[0], 0, 0]}
             for n, c in zip(names, centres)}
    points = {str(i): {"coordinates": [.1 * i, 0, -3 if fault == "behind" else 3]} for i in range(9)}
    small = [{"cameras": {}, "shots": {"gone.png": {}}}] if fault == "small" else []
    json.dump(small + [{"cameras": {"a": {"projection_type": "spherical" if fault == "sphere" else "perspective", "width": 96, "height": 64, "focal": 1e-9 if fault == "focal" else .9, "k1": "much" if fault == "k1" else 0, "k2": 0}},
                "shots": [] if fault == "list" else shots, "points": [1] if fault == "points" else points}], open(at("reconstruction.json"), "w"))

def geo():
    pitch = {"dji": -90, "up": 180, "turn": 7000}.get(fault, 0)
    with open(at("geo.txt"), "w") as f:
        if fault != "first":
            f.write({"srs": "EPSG:31468", "proj": "+proj=lcc +lat_0=1", "swapped": "EPSG:4326"}.get(fault, "EPSG:32633") + "\n")
        for i, n in enumerate(names):
            x, y = (14.3, 48.3) if fault == "degrees" else (450000 + (i if fault != "place" else 0), 5350000)
            f.write(f"{n.replace(' ', '_')}{',' if fault == 'comma' else ' '}{x} {y}" + ("" if fault == "angles" else f" 300 0 {'x' if fault == 'word' else pitch} 0") + "\n")

def llff():
    shape = {"shape": "(8, 15)", "rows": "(9, 17)"}.get(fault, "(8, 17)")
    head = ("{'descr': '%s', 'fortran_order': False, 'shape': %s, }\n" % ("<i8" if fault == "type" else "<f8", shape)).encode()
    data = b"\x93NUMPY\1\0" + struct.pack("<H", len(head)) + head
    for c in centres:
        data += struct.pack("<17d", 0, 1, 0, c[0], 64, 1, 0, 0, c[1], 96, 0, 0, -1 if fault != "axes" else 1, c[2], 90, 1, 9)
    open(at("poses_bounds.npy"), "wb").write(data[:-8] if fault == "cut" else data)

def mrcal():
    model = {"spline": "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=18_fov_x_deg=170"}.get(fault, "LENSMODEL_PINHOLE")
    for n, c in zip(names, centres):
        open(at(n.replace("png", "cameramodel")), "w").write(
            "{ 'lensmodel': '%s',\n 'intrinsics': [ 90, 90, 47.5, 31.5,%s],\n 'extrinsics': [ 0, 0, 0, %g, 0, %s ],\n 'imagersize': [ 96, 64 ] }\n"
            % (model, " 1" if fault == "many" else "", -c[0], "nan" if fault == "nan" else "0"))

{"colmap": colmap, "binary": binary, "aos": aos, "nerf": nerf, "sfm": sfm, "geo": geo, "llff": llff, "mrcal": mrcal}[os.path.basename(dir).split("-")[0]]()
PY

make() { "$python" make.py "$@" || fail "make.py $*"; }
# bad WORDS SOURCE [FAULT] [OPTIONS...]: the source with a fault is refused
bad() {
  local words=$1 source=$2-$3
  shift 3
  make "$source" "${source#*-}"
  want 3 "$words" import poses "$source" --pictures pictures "$@" -o bad.lf
}

# --- imports -------------------------------------------------------------------------------------------------------
for kind in colmap binary nerf sfm llff mrcal; do
  make $kind
  "$sst" import poses $kind --pictures pictures -o $kind.lf >out 2>err || fail "$kind: $(cat err)"
  grep -q '^'$kind'.lf: 8 views of 96x64, colour of 8 bits, 8 placed, centres over 0.700 x 0.0[0-9]* x 0.000 ' out || fail "$kind: $(cat out)"
done
# A mark of byte order; an angle in place of a focal length, backslashes; a smaller reconstruction before the one that counts.
for kind in colmap-bom nerf-angle sfm-small; do
  make $kind ${kind#*-}
  "$sst" import poses $kind --pictures pictures -o $kind.lf >out 2>err || fail "$kind: $(cat err)"
  grep -q '8 views of 96x64, .* 8 placed, centres over 0.700 ' out || fail "$kind: $(cat out)"
done
grep -q '"fx": \(90\.0\|89.9999\)' nerf-angle.lf/lightfield.json || fail "nerf-angle: $(grep '"fx"' nerf-angle.lf/lightfield.json)"
make aos
"$sst" import poses aos/poses.json --pictures pictures -o aos.lf --focal 90 --json >out 2>err || fail "aos: $(cat err)"
"$python" - <<'PY' || fail "import --json: $(cat out)"
import json
o = json.load(open("out"))
assert o["views"] == o["placed"] == 8 and o["metric"] and not o["thermal"] and o["bits"] == 8 and o["kind"] == "posed", o
assert abs(o["extent_m"][0] - 0.7) < 1e-9 and o["source"].startswith("AOS import of aos/poses.json"), o
lf = json.load(open("aos.lf/lightfield.json"))
assert lf["version"] == 3 and lf["up"] == [0, 0, -1], lf
assert lf["views"][0]["name"] == "leaf 1.png" and lf["views"][0]["lens"]["cx"] == 47.5, lf["views"][0]
PY
"$sst" scene flight -o thermal --grid 1x2 --size 96x64 --unplaced -q >out 2>err || fail "scene: $(cat err)"
"$sst" import pictures thermal/views -o warm.lf --kelvin 0.04,-3 --json >out 2>err || fail "warm: $(cat err)"
"$python" - <<'PY' || fail "--kelvin: $(cat out)"
import json
o, lf = json.load(open("out")), json.load(open("warm.lf/lightfield.json"))
assert o["thermal"] and o["bits"] == 16 and lf["kelvin"] == [0.04, -3], (o, lf)
PY
# A mesh with the axes of AOS's poses, z down, is the terrain of the one with z upwards.
"$python" - <<'PY'
at = [(x, y) for y in range(-6, 7, 3) for x in range(-6, 7, 3)]
faces = [(a, a + 1, a + 5) for r in range(4) for a in range(5 * r + 1, 5 * r + 5)] + [(a + 1, a + 6, a + 5) for r in range(4) for a in range(5 * r + 1, 5 * r + 5)]
for name, sign in ("up", 1), ("down", -1):
    with open(name + ".obj", "w") as f:
        f.writelines(f"v {x} {sign * y} {sign * (4 + .05 * x + .02 * y):.3f}\n" for x, y in at)
        f.writelines("f %d %d %d\n" % t for t in faces)
PY
for z in up down; do
  "$sst" render aos.lf --method refocus --surface $z.obj -o mesh-$z.png >out 2>err-$z || fail "mesh, $z: $(cat err-$z)"
done
[ ! -s err-up ] && grep -q 'down.obj: z is read as downwards' err-down && cmp -s mesh-up.png mesh-down.png ||
  fail "a mesh with z down: $(cat err-up err-down)"
cmp -s "pictures/leaf 3.png" aos.lf/views/0002.png || fail "a picture is not copied byte for byte"
# A flight writes its poses again and again: the last file counts.
mkdir -p flight/poses && cp -r pictures flight/images
sed 's/"M3x4": \[\[1, 0, 0, -0.0\]/"M3x4": [[1, 0, 0, "7"]/' aos/poses.json >flight/poses/9.json && cp aos/poses.json flight/poses/10.json
"$sst" import poses flight -o flight.lf --focal 90 >out 2>err || fail "flight: $(cat err)"
grep -q '8 placed, centres over 0.700 x' out || fail "flight: $(cat out)"
mv flight/poses/9.json flight/poses/11.json
"$sst" import poses flight/poses -o flight.lf --focal 90 --force >out 2>err || fail "flight: $(cat err)"
grep -q '8 placed, centres over 7.700 x' out || fail "flight, changed: $(cat out)"
make geo
mkdir low && for i in 1 2 3 4 5 6 7 8; do cp "pictures/leaf $i.png" low/leaf_$i.png; done
"$sst" import poses geo --pictures low --fov 56 -o geo.lf >out 2>err || fail "geo: $(cat err)"
grep -q 'at 48\.[0-9]*, 14\.3' out || fail "geo: $(cat out)"

# Pictures without a pose are views that are not placed, pictures of another size none.
cp -r pictures more && cp "pictures/leaf 1.png" more/extra.png
"$sst" scene bush -o other --grid 1x2 --size 64x64 >/dev/null 2>&1 && cp other/views/00_00.png more/zoom.png
"$sst" import poses colmap --pictures more -o more.lf >out 2>err || fail "more: $(cat err)"
grep -q '9 views .* 8 placed' out && grep -q '1 pictures have no pose' err && grep -q '1 pictures without a pose are of another size' err ||
  fail "pictures without a pose: $(cat out err)"

echo no picture >more/broken.png
"$sst" import poses colmap --pictures more -o more.lf --force >out 2>err || fail "a damaged picture without a pose: $(cat err)"
grep -q 'more/broken.png .*has no pose, and is left out' err && grep -q '9 views' out && ! grep -q error: err || fail "damaged: $(cat out err)"

mkdir broken && for i in 1 2 3 4 5; do echo no picture >broken/$i.png; done
want 3 "broken/1.png .*; broken has no picture that can be read" import pictures broken -o bad.lf
[ ! -e bad.lf ] || fail "an import that was refused left a folder"
for i in 1 2 3 4 5; do cp broken/$i.png more/broken$i.png; done
"$sst" import poses colmap --pictures more -o more.lf --force >out 2>err || fail "damaged pictures without a pose: $(cat err)"
grep -q 'more: 3 pictures more cannot be read\|colmap: 3 pictures more cannot be read' err || fail "many damaged: $(cat err)"

"$sst" import pictures pictures -o plain.lf --moments 'leaf {moment}.png' >out 2>err || fail "pictures: $(cat err)"
grep -q '8 views .* 0 placed, 8 moments' out || fail "pictures: $(cat out)"
"$python" -c 'import json; v = json.load(open("plain.lf/lightfield.json"))["views"]; assert "lens" not in v[0] and v[6]["moment"] == 7, v' || fail "plain.lf"
want 3 "a pose" process plain.lf
want 2 "rows and columns" export hci colmap.lf -o bad
want 2 "leave out" export colmap colmap.lf -o bad --focal-px 7
want 3 "no view of plain.lf has a pose" export colmap plain.lf -o bad
want 3 "is a light field already" import poses scene -o bad.lf --focal 9
for program in process rectify; do
  case $program in rectify) args="--calib none.yaml -o bad";; *) args=;; esac
  "$sst" $program colmap.lf $args >out 2>err && fail "$program of a posed light field"
  [ "$(wc -l <err)" -eq 1 ] || fail "$program: $(cat err)"
done

# --- bad sources ----------------------------------------------------------------------------------------------------
bad "has no such picture" colmap gone
bad "not finite\|not of length" colmap nan
bad "not of length 1" colmap quaternion
bad "beyond 1e12" colmap far
bad "two poses of" colmap twice
bad "OPENCV_FISHEYE is not one" colmap fisheye
bad "camera model .MOEBIUS" colmap unheard
bad "focal length" colmap focal
bad "focal length" colmap negative
bad "1 to 32768" colmap width
bad "4 parameters" colmap short
bad "not in the list of cameras" colmap camera
bad "more than 1024 views" colmap many
bad "look away from the points" colmap behind
bad "point's place" colmap point
bad "of pictures of 192x128" colmap size
bad "number 99 is not known" binary model
bad "more than it can hold" binary count
bad "ends before" binary features
bad "ends before" binary track
bad "damaged" binary cut
bad "goes on after" binary longer
bad "too short" binary empty
bad "mirrored" aos mirror --focal 90
bad "scaled by 2.5" aos scale --focal 90
bad "not a rotation" aos shear --focal 90
bad "look away from the ground" aos away --focal 90
bad "two poses" aos twice --focal 90
bad "3 rows of 4 numbers" aos short --focal 90
bad "3 rows of 4 numbers" aos word --focal 90
bad "imagefile is missing" aos unnamed --focal 90
bad "not a list" aos object --focal 90
bad "no pose of any picture" aos empty --focal 90
bad "poses.json:1:" aos text --focal 90
bad "frames is not a list" nerf object
bad "OPENCV_FISHEYE is not one" nerf fisheye
bad "k4 is not 0" nerf k4
bad "last row" nerf row
bad "k1 is not a number" nerf k1
bad "cx is not a number" nerf cx
bad "applied_transform" nerf applied
bad "spherical is not one" sfm sphere
bad "not in the list of cameras" sfm camera
bad "radians" sfm degrees
bad "look away" sfm behind
bad "k1 is not a number" sfm k1
bad "focal length is below 1 px" sfm focal
bad "points is not an object" sfm points
bad "not an object" sfm list
bad "first line .EPSG:31468" geo srs --focal 90
bad "first line .leaf_1.png.*EPSG:4326" geo first --focal 90
bad "first line .+proj=lcc" geo proj --focal 90
bad "longitude and latitude" geo swapped --focal 90
bad "add 90" geo dji --focal 90
bad "look up" geo up --focal 90
bad "yaw, pitch and roll are needed" geo angles --focal 90
bad "not a number" geo word --focal 90
bad "separated by blanks" geo comma --focal 90
bad "beyond 360 degrees" geo turn --focal 90
bad "no place in the zone of UTM; degrees" geo degrees --focal 90
bad "all poses are at one place" geo place --focal 90
bad "second image, where the features" colmap lines
bad "17 numbers" llff shape
bad "length is not" llff rows
bad "floats" llff type
bad "length is not" llff cut
bad "mirrored" llff axes
bad "SPLINED.* is not LENSMODEL" mrcal spline
bad "as many numbers" mrcal many
bad "6 numbers" mrcal nan
want 2 "focal length; add --focal" import poses aos --pictures pictures -o bad.lf
want 2 "lenses of its own" import poses colmap --pictures pictures -o bad.lf --focal 90
want 2 "say the same" import poses aos --pictures pictures -o bad.lf --focal 90 --fov 40
want 2 "those of pictures are colour" import pictures pictures -o bad.lf --kelvin 0.04,0
want 2 "unknown --unit .km.; use mm or m" import poses aos -o bad.lf --unit km
want 2 "SCALE,OFFSET" import pictures pictures -o bad.lf --kelvin 0.04
want 2 "belong to the formats poses and pictures" import folder pictures --grid 2x4 -o bad.lf --focal 9
want 2 "does not apply to poses" import poses colmap -o bad.lf --grid 2x4
want 3 "does not match" import pictures pictures -o bad.lf --moments '{moment}.jpg'
want 2 "must be a text that ends the first" import pictures pictures -o bad.lf --moments 'leaf{camera}{moment}.png'
want 3 "does not match" import pictures pictures -o bad.lf --moments '*e*e*e*e*e*e*e*e*e*e*e*e*e*e{moment}*x'
want 2 "{moment} once" import pictures pictures -o bad.lf --moments 'leaf'
want 3 "there is no picture .leaf 1.png" import poses colmap -o bad.lf
want 3 "is not a folder" import poses colmap --pictures none -o bad.lf
want 3 "there is no none" import poses none -o bad.lf
mkdir empty && want 3 "format that is known" import poses empty -o bad.lf
want 3 "no PNG, JPEG or TIFF" import pictures empty -o bad.lf
echo '{"Labels": {"poly": []}}' >label.json && want 3 "format that is known" import poses label.json -o bad.lf
want 4 "exists" import poses colmap --pictures pictures -o aos.lf
cp -r pictures cut && head -c 900 "pictures/leaf 4.png" >"cut/leaf 4.png"
want 3 "leaf 4.png" import poses colmap --pictures cut -o bad.lf
cp -r pictures two && cp other/views/00_00.png "two/leaf 4.png"
want 3 "leaf 4.png has 64x64 pixels, colour of 8 bits, but" import poses colmap --pictures two -o bad.lf
want 3 "all pictures must be of one kind" import pictures two -o bad.lf
exit $failed
