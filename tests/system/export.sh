#!/usr/bin/env bash
# `sst export colmap` and `nerfstudio`: read by their documented rules, written here anew, against points whose places in
# the pictures are known.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
python=${PYTHON:-/usr/bin/python3}
"$python" -c 'import numpy' 2>/dev/null || skip "python3-numpy is absent"

ok() { "$sst" "$@" >out 2>err || fail "sst $*: $(head -c 400 err)"; }

cat >tool.py <<'PY'
import configparser, json, math, os, sys
import numpy as np

SIZE, GRID = (200, 150), (2, 3)
rng = np.random.default_rng(3)

def rodrigues(v):
    t = np.linalg.norm(v)
    n = np.array(v) / t
    N = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.eye(3) + math.sin(t) * N + (1 - math.cos(t)) * N @ N

def bent(P, fx, fy, cx, cy, k1, k2, p1, p2, k3=0, k4=0, k5=0, k6=0):  # FULL_OPENCV of COLMAP
    u, v = P[:, 0] / P[:, 2], P[:, 1] / P[:, 2]
    r2 = u * u + v * v
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    return np.stack([fx * (u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u)) + cx,
                     fy * (v * radial + 2 * p2 * u * v + p1 * (r2 + 2 * v * v)) + cy], 1)

def rotation(q):  # of a quaternion, w first
    w, x, y, z = q
    assert abs(w * w + x * x + y * y + z * z - 1) < 1e-12
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])

def lines(path):
    return [l.rstrip('\n') for l in open(path) if not l.startswith('#')]

def colmap(dir):  # name -> function of points (metres) that gives pixels, (0.5, 0.5) the upper left one's centre
    cams, images, made = {}, {}, {}
    for l in lines(dir + '/sparse/0/cameras.txt'):
        w = l.split()
        cams[int(w[0])] = (w[1], (int(w[2]), int(w[3])), [float(x) for x in w[4:]])
    two = lines(dir + '/sparse/0/images.txt')
    assert len(two) % 2 == 0 and not any(two[1::2])
    for l in two[::2]:
        w = l.split(' ')
        assert len(w) == 10
        images[int(w[0])] = (rotation([float(x) for x in w[1:5]]), np.array([float(x) for x in w[5:8]]), int(w[8]), w[9])
    assert lines(dir + '/sparse/0/points3D.txt') == []
    # COLMAP's database counts both in the order of the names, its extractor has one model for all.
    names = [images[i][3] for i in range(1, len(images) + 1)]
    assert names == sorted(names) and sorted(cams) == list(range(1, len(cams) + 1))
    assert [images[i][2] for i in sorted(images)] == (sorted(images) if len(cams) > 1 else [1] * len(images))
    assert len({model for model, _, _ in cams.values()}) == 1
    rigs(dir, images)
    readme(dir, cams)
    for R, t, cam, name in images.values():
        model, size, p = cams[cam]
        assert size == SIZE and len(p) == {'PINHOLE': 4, 'FULL_OPENCV': 12}[model]
        made[name] = lambda X, R=R, t=t, p=p + [0] * (12 - len(p)): bent(X @ R.T + t, *p)
    return made

def pose(w):
    return rotation([float(x) for x in w[:4]]), np.array([float(x) for x in w[4:7]])

def rigs(dir, images):  # an image's pose is its sensor's in the rig after the rig's in the world
    (rig,) = lines(dir + '/sparse/0/rigs.txt')
    w = rig.split()
    number = w[0]
    assert number == ('1' if w[1] == '1' else str(len(images) + 1)) and w[2] == 'CAMERA'
    config(dir, images, w[1] != '1', int(w[3]))
    sensor = {int(w[3]): (np.eye(3), np.zeros(3))}
    for i in range(4, len(w), 10):
        assert w[i] == 'CAMERA' and w[i + 2] == '1'
        sensor[int(w[i + 1])] = pose(w[i + 3:i + 10])
    assert len(sensor) == int(w[1])
    seen = set()
    for l in lines(dir + '/sparse/0/frames.txt'):
        w = l.split()
        assert w[1] == number and len(w) == 10 + 3 * int(w[9])
        assert number == '1' or w[0] == number
        Rr, tr = pose(w[2:9])
        for i in range(10, len(w), 3):
            assert w[i] == 'CAMERA'
            R, t, cam, _ = images[int(w[i + 2])]
            Rs, ts = sensor[int(w[i + 1])]
            assert cam == int(w[i + 1])
            assert np.allclose(Rs @ Rr, R, atol=1e-14) and np.allclose(Rs @ tr + ts, t, atol=1e-14)
            seen.add(int(w[i + 2]))
    assert seen == set(images)

def config(dir, images, array, reference):  # for rig_configurator: the reference first
    if not array:
        assert not os.path.exists(dir + '/rig_config.json')
        return
    (rig,) = json.load(open(dir + '/rig_config.json'))
    first, *rest = rig['cameras']
    R0, t0, cam, name = images[reference]
    assert first == {'image_prefix': name.split('.')[0], 'ref_sensor': True}
    found = {name.split('.')[0]: (R, t) for R, t, _, name in images.values()}
    assert len(rest) == len(images) - 1
    for c in rest:
        R, t = found[c['image_prefix']]
        Rs = rotation(c['cam_from_rig_rotation'])
        assert np.allclose(Rs @ R0, R, atol=1e-14)
        assert np.allclose(Rs @ t0 + c['cam_from_rig_translation'], t, atol=1e-14)

def readme(dir, cams):
    text = open(dir + '/README.txt').read()
    assert text.count('--ImageReader.camera_model %s ' % cams[1][0]) == 2
    assert text.count('--ImageReader.single_camera 1') == (2 if len(cams) == 1 else 0)
    assert text.count('rig_configurator') == (0 if len(cams) == 1 else 1)

def nerfstudio(dir):  # camera-to-world, camera x right, y up, z back
    f = json.load(open(dir + '/transforms.json'))
    assert f['camera_model'] == 'OPENCV'
    W = np.array(f['applied_transform'])
    assert np.allclose(W[:, :3] @ [0, -1, 0], [0, 0, 1])  # up, in our axes, is z in nerfstudio's
    made = {}
    for g in f['frames']:
        assert (g['w'], g['h']) == SIZE and g['k4'] == 0
        M = np.array(g['transform_matrix'])
        assert np.allclose(M[3], [0, 0, 0, 1]) and np.isclose(np.linalg.det(M[:3, :3]), 1)
        def project(X, M=M, g=g):
            P = ((X @ W[:, :3].T + W[:, 3]) - M[:3, 3]) @ M[:3, :3]
            return bent(P * [1, -1, -1], g['fl_x'], g['fl_y'], g['cx'], g['cy'], g['k1'], g['k2'], g['p1'], g['p2'], g['k3'])
        made[g['file_path'].split('/')[-1]] = project
        assert g['file_path'].startswith('images/')
    return made

def pfm(path):
    with open(path, 'rb') as f:
        assert f.readline() == b'Pf\n'
        w, h = map(int, f.readline().split())
        order = '<' if float(f.readline()) < 0 else '>'
        return np.flipud(np.frombuffer(f.read(), order + 'f4').reshape(h, w)).astype(float)

INFINITY = -7  # of the same pictures as those of a set that converges

def scene_truth(infinity=0, off=(0, 0), hole=None):  # points of the scene, by the true disparity of the reference view
    lf = json.load(open('scene/lightfield.json'))
    f, B = lf['focal_px'], lf['spacing_mm']
    d = pfm('scene/truth/00_01.pfm')
    x, y = rng.integers(0, SIZE[0], 50), rng.integers(0, SIZE[1], 50)
    d = d[y, x]
    Z = f * B / (d - infinity)
    X = np.stack([(x - (SIZE[0] - 1) / 2 - off[0]) * Z / f, (y - (SIZE[1] - 1) / 2 - off[1]) * Z / f, Z], 1) / 1000
    return X, {v['file']: np.stack([x - d * v['bx'], y - d * v['by']], 1) for v in lf['views'] if v['file'] != hole}

def hci():  # the pictures as those of the benchmark, which converge where d is 0; row 0.5 is the middle of two
    lf = json.load(open('scene/lightfield.json'))
    os.makedirs('hci')
    for v in lf['views']:
        os.link('scene/views/' + v['file'], 'hci/input_Cam%03d.png' % (v['row'] * GRID[1] + v['col']))
    with open('hci/parameters.cfg', 'w') as f:
        f.write('[intrinsics]\nfocal_length_mm = 100\nsensor_size_mm = %r\n[extrinsics]\nnum_cams_x = 3\nnum_cams_y = 2\n'
                'baseline_mm = %r\nfocus_distance_m = %r\n[meta]\ndisp_min = -1\ndisp_max = 40\n'
                % (100 * SIZE[0] / lf['focal_px'], lf['spacing_mm'], lf['focal_px'] * lf['spacing_mm'] / -INFINITY / 1000))

def parameters(path, focus_m):  # every key that the benchmark's own two readers ask for
    p = configparser.ConfigParser()
    p.read(path)
    for key in 'focal_length_mm image_resolution_x_px image_resolution_y_px sensor_size_mm fstop'.split():
        p.getfloat('intrinsics', key)
    for key in ('num_cams_x num_cams_y baseline_mm focus_distance_m center_cam_x_m center_cam_y_m center_cam_z_m '
                'center_cam_rx_rad center_cam_ry_rad center_cam_rz_rad').split():
        p.getfloat('extrinsics', key)
    for key in 'disp_min disp_max frustum_disp_min frustum_disp_max depth_map_scale'.split():
        p.getfloat('meta', key)
    for key in 'scene category date version authors contact'.split():
        assert p.get('meta', key)
    got = p.getfloat('extrinsics', 'focus_distance_m')
    assert abs(got - focus_m) <= 1e-12 * focus_m, (got, focus_m)
    # Z of a disparity by the benchmark's own formula
    f = p.getfloat('intrinsics', 'focal_length_mm') / p.getfloat('intrinsics', 'sensor_size_mm') * SIZE[0]
    return lambda d: 1 / (d / (f * p.getfloat('extrinsics', 'baseline_mm')) + 1 / (1000 * got))

def array(lens8):  # cameras of an array whose pictures these might be
    cams = {}
    for row in range(2):
        for col in range(3):
            ref = (row, col) == (0, 1)
            k = [.05, -.1, 2e-4, -3e-4, .02, 15, -.02, .01] if lens8 and col == 2 else [-.1, .05, 1e-3, -2e-3, .01 * row] if col else []
            cams['%02d_%02d.png' % (row, col)] = dict(
                row=row, col=col, k=k, K=[640 + rng.normal(), 641 + rng.normal(), 99.5 + rng.normal(), 74.5 + rng.normal()],
                R=np.eye(3) if ref else rodrigues(rng.normal(0, .01, 3)),
                c=np.zeros(3) if ref else np.array([(col - 1) * 80, row * 80, 0]) + rng.normal(0, .5, 3))
    return cams

def write_array(path, cams):
    f = lambda v: '[' + ', '.join('%.17g' % x for x in np.ravel(v)) + ']'
    with open(path, 'w') as o:
        o.write('format: sst-calib\nversion: 1\nrows: 2\ncols: 3\nwidth: 200\nheight: 150\nreference: [0, 1]\ncameras:\n')
        for c in cams.values():
            o.write('- { row: %d, col: %d, focal_px: %s, centre_px: %s, distortion: %s, rotation: %s, position_mm: %s }\n' % (
                c['row'], c['col'], f(c['K'][:2]), f(c['K'][2:]), f(c['k']), f(c['R']), f(c['c'])))

def array_truth(cams):
    X = np.stack([rng.uniform(-.2, .2, 50), rng.uniform(-.15, .15, 50), rng.uniform(1.5, 4, 50)], 1)
    return X, {n: bent((X - c['c'] / 1000) @ c['R'].T, *c['K'], *(c['k'] or [0] * 4)) for n, c in cams.items()}

def compare(made, truth, what):
    X, places = truth
    assert set(made) == set(places), (set(made), set(places))
    worst = max(abs(made[n](X) - 0.5 - places[n]).max() for n in places)  # ours: the centre is (0, 0)
    print('%s %.1e px' % (what, worst))
    if not worst < 1e-6:
        sys.exit('%s: off by %g px' % (what, worst))

if sys.argv[1] == 'hci':
    hci()
elif sys.argv[1] == 'make':
    write_array('calib.yaml', array(False))
    write_array('calib8.yaml', array(True))
else:
    five, eight, scene = array(False), array(True), scene_truth()
    compare(colmap('s-colmap'), scene, 'scene, colmap')
    compare(nerfstudio('s-nerf'), scene, 'scene, nerfstudio')
    compare(colmap('c-colmap'), array_truth(five), 'calibrated, colmap')
    compare(nerfstudio('c-nerf'), array_truth(five), 'calibrated, nerfstudio')
    compare(colmap('c8-colmap'), array_truth(eight), '8 coefficients, colmap')
    compare(colmap('hole'), scene_truth(hole='00_00.png'), 'with a hole, colmap')
    for name in 'conv', 'focus', 'stan-back':
        compare(colmap(name + '-colmap'), scene_truth(INFINITY), 'converging %s, colmap' % name)
    compare(nerfstudio('conv-nerf'), scene_truth(INFINITY), 'converging, nerfstudio')
    off = (0, 0.5 * INFINITY)
    for name in 'hci-lf', 'hci-back':
        compare(colmap(name + '-colmap'), scene_truth(INFINITY, off), '%s, colmap' % name)
        compare(nerfstudio(name + '-nerf'), scene_truth(INFINITY, off), '%s, nerfstudio' % name)
    lf = json.load(open('scene/lightfield.json'))
    fb = lf['focal_px'] * lf['spacing_mm']
    Z = parameters('hci-out/parameters.cfg', fb / -INFINITY / 1000)
    assert abs(Z(11) / (fb / 18) - 1) < 1e-9
    assert abs(parameters('s-hci/parameters.cfg', 1e9)(11) / (fb / 11) - 1) < 1e-6
    parameters('p-hci/parameters.cfg', 0)
PY
"$python" tool.py make || { fail "the samples"; exit 1; }

ok scene bush -o scene --size 200x150 --grid 2x3
ok export colmap scene -o s-colmap
ok export nerfstudio scene -o s-nerf --threads 1
ok rectify scene --calib calib.yaml -o cal
ok rectify scene --calib calib8.yaml -o cal8
ok export colmap cal -o c-colmap
ok export nerfstudio cal -o c-nerf
ok export colmap cal8 -o c8-colmap

# Views that converge: as the user says, as another format does, and with a hole of the grid.
focal=$("$python" -c 'import json; print(json.load(open("scene/lightfield.json"))["focal_px"])')
spacing=$("$python" -c 'import json; print(json.load(open("scene/lightfield.json"))["spacing_mm"])')
cameras="--focal-px $focal --spacing-mm $spacing"
ok import folder scene/views --grid 2x3 --infinity-px -7 -o conv
grep -q 'infinity at -7.000 px' out || fail "not said: $(cat out)"
# shellcheck disable=SC2086
{
  ok export colmap conv -o conv-colmap $cameras
  ok export nerfstudio conv -o conv-nerf $cameras
  ok import folder scene/views --grid 2x3 -o focus
  ok export colmap focus -o focus-colmap $cameras --focus-mm "$("$python" -c "print(repr($focal * $spacing / 7))")"
  ok export stanford conv -o stan $cameras
  ok import stanford stan -o stan-back
  ok export colmap stan-back -o stan-back-colmap
  mkdir holed && cp scene/views/* holed && rm holed/00_00.png
  ok import folder holed --grid 2x3 --infinity-px 0 -o holed.lf
  ok export colmap holed.lf -o hole $cameras
  [ ! -s err ] || fail "known to be parallel, and yet: $(cat err)"
  ok import folder scene/views --grid 2x3 -o plain
  ok export hci plain -o p-hci
  grep -q "warning.*focal_length_mm baseline_mm focus_distance_m 0 for what is not known" err || fail "no warning: $(cat err)"
  ok export nerfstudio plain -o p-nerf $cameras
  grep -q "warning: .*not known whether the views of plain are parallel" err || fail "no warning: $(cat err)"
}
"$python" tool.py hci || fail "the benchmark's set"
ok import hci hci -o hci-lf
ok export hci hci-lf -o hci-out
ok import hci hci-out -o hci-back
for lf in hci-lf hci-back; do
  ok export colmap $lf -o $lf-colmap
  ok export nerfstudio $lf -o $lf-nerf
done
ok export hci scene -o s-hci
"$python" tool.py check >said 2>&1 || fail "$(tail -n 3 said)"
cat said
for view in 00_00 00_01 01_02; do # raw frames, byte for byte
  cmp -s scene/views/$view.png c-colmap/images/$view.png || fail "$view is not the raw frame"
  cmp -s scene/views/$view.png s-nerf/images/$view.png || fail "$view is not the view"
done

# The other forms have no lenses: they get the rectified views.
ok rectify cal --bake -o baked
ok export stanford cal -o c-stanford
ok import stanford c-stanford -o back
for view in 00_00 00_01 01_02; do
  cmp -s baked/views/$view.png back/views/$view.png || fail "stanford: $view is not rectified"
done
ok export hci cal -o c-hci
cmp -s baked/views/01_02.png c-hci/input_Cam005.png || fail "hci: view 5 is not rectified"

# A light field shows the calibration that it has.
ok calibration show cal
grep -q "^6 cameras in a grid of 2 x 3" out || fail "show: $(head -n 3 out)"

# --- refusals ---
want 3 "off by up to .* px.*--lossy" export nerfstudio cal8 -o bad
ok export nerfstudio cal8 -o lossy --lossy
grep -q "^sst: warning: nerfstudio has 5 coefficients" err || fail "no warning: $(cat err)"
want 3 "focal length is unknown.*--focal-px" export colmap plain -o bad
want 3 "camera spacing is unknown.*--spacing-mm" export colmap plain -o bad --focal-px 640
ok export colmap plain -o given --focal-px 640 --spacing-mm 80
cmp -s given/sparse/0/cameras.txt s-colmap/sparse/0/cameras.txt || fail "--focal-px makes another camera"
want 2 "has a calibration" export colmap cal -o bad --focal-px 640
want 2 "belongs to nerfstudio" export hci scene -o bad --lossy
want 2 "give one" export colmap plain -o bad --focus-mm 3000 --infinity-px 0
want 3 "needs the focal length and the camera spacing" export colmap plain -o bad --focus-mm 3000
want 2 "has a calibration" export nerfstudio cal -o bad --infinity-px 0
ok import folder scene/views --grid 2x3 --range-min -3 --range-max 20 -o negative
want 3 "disparities down to -3.00 px, so its views converge.*--focus-mm.*--infinity-px" export nerfstudio negative -o bad --focal-px 640 --spacing-mm 80
want 3 "behind infinity at 2.00 px" export colmap negative -o bad --focal-px 640 --spacing-mm 80 --infinity-px 2
want 4 "exists" export colmap scene -o given
ok export colmap scene -o given --force
want 4 "does not replace" export nerfstudio scene -o given --force

[ "$failed" -eq 0 ] && echo "exports of cameras as documented"
exit $failed
