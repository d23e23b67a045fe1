#!/usr/bin/env bash
# `sst calibration`: every format read by rules of its own, written here anew, and by OpenCV's FileStorage.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
python=${PYTHON:-/usr/bin/python3}
"$python" -c 'import cv2, numpy' 2>/dev/null || skip "python3-opencv is absent"

ok() { "$sst" calibration "$@" >out 2>err || fail "sst calibration $*: $(head -c 400 err)"; }

cat >tool.py <<'PY'
import ast, json, math, re, sys
import cv2, numpy as np

rng = np.random.default_rng(7)
X = np.array([[100., 50, 1500], [-300, 200, 2500], [0, 0, 1000], [350, -260, 1200], [-400, -300, 1600]])
worst = {}

def project(K4, d, P):  # the lens model written out; P in camera axes
    fx, fy, cx, cy = K4
    k1, k2, p1, p2, k3, k4, k5, k6 = list(d) + [0] * (8 - len(d))
    a, b = P[:, 0] / P[:, 2], P[:, 1] / P[:, 2]
    r = a * a + b * b
    s = (1 + k1 * r + k2 * r**2 + k3 * r**3) / (1 + k4 * r + k5 * r**2 + k6 * r**3)
    return np.stack([fx * (a * s + 2 * p1 * a * b + p2 * (r + 2 * a * a)) + cx,
                     fy * (b * s + p1 * (r + 2 * b * b) + 2 * p2 * a * b) + cy], 1)

def rodrigues(v):
    v = np.array(v, float)
    t = np.linalg.norm(v)
    if t == 0:
        return np.eye(3)
    n = v / t
    N = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.eye(3) + math.sin(t) * N + (1 - math.cos(t)) * N @ N

def make():  # an array of 2 x 3 with a hole, lenses of all kinds
    cams = []
    for row in range(2):
        for col in range(3):
            if (row, col) == (1, 1):
                continue
            ref = (row, col) == (0, 1)
            lens = [[-.26, .09, 1e-3, -2e-4, 0.], [-.1, .05, 1e-4, 1e-4, -.02], [.1, -.2, 1e-4, 2e-4, .05, .3, -.1, .02], []][(row + col) % 4]
            cams.append(dict(row=row, col=col, K=[2250 + rng.normal(), 2251 + rng.normal(), 999.5 + rng.normal(), 749.5 + rng.normal()],
                             d=lens, R=np.eye(3) if ref else rodrigues(rng.normal(0, .02, 3)),
                             c=np.zeros(3) if ref else np.array([(col - 1) * 40, row * 40, 0]) + rng.normal(0, 1, 3)))
    return cams

def text(cams):
    f = lambda v: '[' + ', '.join('%.17g' % x for x in np.ravel(v)) + ']'
    out = 'format: sst-calib\nversion: 1\nrows: 2\ncols: 3\nwidth: 2000\nheight: 1500\nreference: [0, 1]\ncameras:\n'
    for c in cams:
        out += '  - { row: %d, col: %d, name: cam-%d%d, focal_px: %s, centre_px: %s, distortion: %s, rotation: %s, position_mm: %s }\n' % (
            c['row'], c['col'], c['row'], c['col'], f(c['K'][:2]), f(c['K'][2:]), f(c['d']), f(c['R']), f(c['c']))
    return out

def check(what, c, got, limit=1e-6):
    want = project(c['K'], c['d'], (X - c['c']) @ c['R'].T)
    e = abs(got - want).max()
    worst[what] = max(worst.get(what, 0), e)
    if not e <= limit:
        sys.exit('%s: row %d, column %d: off by %g px' % (what, c['row'], c['col'], e))

def opencv(cams):
    for c in cams:
        fs = cv2.FileStorage('cv/%02d_%02d.yml' % (c['row'], c['col']), cv2.FILE_STORAGE_READ)
        m = lambda k: fs.getNode(k).mat()
        assert fs.getNode('image_width').real() == 2000 and fs.getNode('image_height').real() == 1500
        assert fs.getNode('camera_name').string() == 'cam-%d%d' % (c['row'], c['col'])
        q, _ = cv2.projectPoints(X, cv2.Rodrigues(m('R'))[0], m('T'), m('camera_matrix'), m('distortion_coefficients'))
        check('opencv', c, q[:, 0])

def multical(cams):
    f = json.load(open('calibration.json'))
    for c in cams:
        name = '%02d_%02d' % (c['row'], c['col'])
        cam = f['cameras'][name]
        pose = f['camera_poses'][name if name == '00_01' else name + '_to_00_01']
        K = np.array(cam['K'])
        assert np.array(cam['dist']).dtype == float and cam['image_size'] == [2000, 1500]
        assert cam['model'] == ('rational' if len(c['d']) == 8 else 'standard')
        check('multical', c, project([K[0, 0], K[1, 1], K[0, 2], K[1, 2]], np.ravel(cam['dist']),
                                     X / 1000 @ np.array(pose['R']).T + np.array(pose['T'])))

def mrcal(cams):
    for c in cams:
        f = ast.literal_eval(open('mrcal/%02d_%02d.cameramodel' % (c['row'], c['col'])).read())
        n = {'LENSMODEL_PINHOLE': 0, 'LENSMODEL_OPENCV5': 5, 'LENSMODEL_OPENCV8': 8}[f['lensmodel']]
        assert len(f['intrinsics']) == 4 + n and f['imagersize'] == [2000, 1500]
        rt = f['extrinsics']
        check('mrcal', c, project(f['intrinsics'][:4], f['intrinsics'][4:], X / 1000 @ rodrigues(rt[:3]).T + rt[3:]))

def chain(path):  # camchain.yaml, by its lines
    cams, T = [], np.eye(4)
    for block in re.split(r'^cam\d+:\n', open(path).read(), flags=re.M)[1:]:
        get = lambda k: ast.literal_eval(re.search(r'^  %s: (\[.*\])$' % k, block, re.M).group(1))
        step = re.findall(r'^  - (\[.*\])$', block, re.M)
        assert 'camera_model: pinhole' in block and 'distortion_model: radtan' in block and get('resolution') == [2000, 1500]
        T = (np.array([ast.literal_eval(s) for s in step]) if step else np.eye(4)) @ T
        cams.append((get('intrinsics'), get('distortion_coeffs'), T))
    return cams

def refit(c):  # the four coefficients that are nearest over the picture's rays
    u, v = [g.ravel() for g in np.meshgrid(np.linspace(0, 1999, 49), np.linspace(0, 1499, 37))]
    K = np.array([[c['K'][0], 0, c['K'][2]], [0, c['K'][1], c['K'][3]], [0, 0, 1]])
    d = np.array(c['d'] or [0] * 5)
    p = cv2.undistortPoints(np.stack([u, v], 1)[:, None], K, d, None, None, None)[:, 0]
    for _ in range(50):  # OpenCV's inverse is rough; make it exact
        q = project(c['K'], d, np.c_[p, np.ones(len(p))])
        p -= (q - np.stack([u, v], 1)) / c['K'][:2]
    a, b = p.T
    r = a * a + b * b
    x = np.stack([a * r, a * r * r, 2 * a * b, r + 2 * a * a], 1) * c['K'][0]
    y = np.stack([b * r, b * r * r, r + 2 * b * b, 2 * a * b], 1) * c['K'][1]
    k = np.linalg.lstsq(np.r_[x, y], np.r_[u - c['K'][2] - c['K'][0] * a, v - c['K'][3] - c['K'][1] * b], rcond=None)[0]
    e = project(c['K'], k, np.c_[p, np.ones(len(p))]) - np.stack([u, v], 1)
    return k, np.hypot(*e.T).max()

def kalibr(cams, told):
    most = 0
    first = np.eye(4)  # the chain begins at camera 0, wherever that is
    first[:3, :3], first[:3, 3] = cams[0]['R'], -cams[0]['R'] @ cams[0]['c'] / 1000
    for c, (K, d, T) in zip(cams, chain('camchain.yaml')):
        k, e = refit(c)
        most = max(most, e if len(c['d']) and any(c['d'][4:]) else 0)
        if not np.allclose(d, k, rtol=1e-5, atol=1e-8):
            sys.exit('kalibr: %s instead of %s' % (d, k))
        T = T @ first
        check('kalibr', dict(c, d=d), project(K, d, X / 1000 @ T[:3, :3].T + T[:3, 3]))
    told = float(re.search(r'up to (\S+) px', told).group(1))
    if abs(told - most) > 0.01 * most:
        sys.exit('kalibr: said %g px, it is %g' % (told, most))

def known(path, cams, grid, limit=1e-9):  # what `show --json` says
    s = json.load(open(path))
    assert (s['rows'], s['cols'], s['width'], s['height']) == (*grid, 2000, 1500), s
    for c, g in zip(cams, s['cameras']):
        assert (g['row'], g['col']) == (c['row'], c['col'])
        check(path, c, project(g['focal_px'] + g['centre_px'], g['distortion'],
                               (X - g['position_mm']) @ np.reshape(g['rotation'], (3, 3)).T), limit)

def write_cv(cams):  # as OpenCV itself writes: a folder for each of its forms
    import os
    for ending in ('yml', 'xml', 'json'):
        os.mkdir('own-' + ending)
        for c in cams:
            fs = cv2.FileStorage('own-%s/%02d_%02d.%s' % (ending, c['row'], c['col'], ending), cv2.FILE_STORAGE_WRITE)
            fs.write('calibration_time', 'Sat Nov 21 14:23:01 2026')
            fs.write('image_width', 2000)
            fs.write('image_height', 1500)
            fs.write('camera_matrix', np.array([[c['K'][0], 0, c['K'][2]], [0, c['K'][1], c['K'][3]], [0, 0, 1.]]))
            fs.write('distortion_coefficients', np.array([c['d'] or [0.] * 5]).T)
            fs.write('R', cv2.Rodrigues(c['R'])[0] if c['col'] == 2 else c['R'])
            fs.write('T', (-c['R'] @ c['c']).reshape(3, 1))
            fs.write('per_view_reprojection_errors', np.array([[.1, .2]], np.float32))
            fs.release()

cams = make()
for todo in sys.argv[1:]:
    if todo == 'make':
        open('calib.yaml', 'w').write(text(cams))
        write_cv(cams)
    elif todo == 'kalibr':
        kalibr(cams, open('err').read())
    elif todo.endswith('.seen'):
        known(todo, cams, (2, 3))
    else:
        {'opencv': opencv, 'multical': multical, 'mrcal': mrcal}[todo](cams)
print(', '.join('%s %.1e px' % w for w in worst.items()))
PY
check() { "$python" tool.py "$@" >said 2>&1 || fail "$(tail -n 1 said)"; cat said; }

"$python" tool.py make >/dev/null || { fail "the samples"; exit 1; }
ok convert calib.yaml -o cv
ok convert calib.yaml -o calibration.json
ok convert calib.yaml -o mrcal --to mrcal
want 3 "off by up to .* --lossy writes it" calibration convert calib.yaml -o bad-camchain.yaml
ok convert calib.yaml -o camchain.yaml --lossy
grep -q "^sst: warning: Kalibr has 4 coefficients" err || fail "no warning: $(cat err)"
check opencv multical mrcal kalibr

# And back: written files against OpenCV's.
forms="calib.yaml cv calibration.json own-yml own-xml own-json"
for form in $forms; do
  ok show "$form" --json
  mv out "$form.seen"
done
check $(printf '%s.seen ' $forms)
ok convert calib.yaml -o copy.yaml
ok convert copy.yaml -o again.yaml
cmp -s copy.yaml again.yaml || fail "a copy of a copy differs"
ok show calib.yaml
grep -q "^  0   1\* cam-01 " out || fail "show: $(cat out)"

# One camera, a pair.
ok convert cv/00_02.yml -o one.cameramodel
ok convert cv/00_02.yml -o one.yml
ok convert own-xml/00_02.xml -o one.yaml
mkdir two && cp cv/00_01.yml cv/00_02.yml two
ok convert two -o pair --to opencv-stereo
ok show pair
[ -e pair/intrinsics.yml ] && [ -e pair/extrinsics.yml ] || fail "no pair"

# --- refusals ---
mkdir plain.lf && echo '{}' >plain.lf/lightfield.json
want 3 "light field without a calibration" calibration show plain.lf
want 2 'unknown action `dance`' calibration dance calib.yaml
want 2 "-o OUT is missing" calibration convert calib.yaml
want 2 "show writes nothing" calibration show calib.yaml -o bad
printf 'cam0:\n  camera_model: omni\n  distortion_coeffs: []\n  distortion_model: none\n  intrinsics: [1, 9, 9, 9, 9]\n  resolution: [9, 9]\n' >omni.yaml
want 3 "omni.yaml:2:17: camera_model is omni; only pinhole is supported" calibration show omni.yaml
[ "$(wc -l <err)" = 1 ] || fail "said of another camera model: $(cat err)"
want 2 "unknown --to .kalbr.; did you mean .kalibr.?" calibration convert calib.yaml -o bad --to kalbr
want 2 "unknown calibration format" calibration convert calib.yaml -o bad --to colmap
want 2 "does not imply a calibration format" calibration convert calib.yaml -o bad.txt
want 3 "No such file" calibration show none.yaml
echo "x: 1" >noise.yaml
want 3 "is not in a known calibration format" calibration show noise.yaml
want 3 "write-only" calibration show mrcal/00_00.cameramodel
want 2 "more; name a folder" calibration convert calib.yaml -o bad.yml
want 4 "already exists\|exists" calibration convert calib.yaml -o cv
want 2 "two cameras" calibration convert calib.yaml -o bad --to opencv-stereo
sed 's/row: 1\b/row: 0/' camchain.yaml >twice.yaml
want 3 "same place" calibration show twice.yaml
sed '/^  row:/d; /^  col:/d' camchain.yaml >bare.yaml
want 2 "add --grid" calibration show bare.yaml
want 2 "do not fill a grid" calibration show bare.yaml --grid 2x3
ok show bare.yaml --grid 1x5
sed 's/rotation: \[/rotation: [9, /' calib.yaml >wrong.yaml
"$sst" calibration show wrong.yaml 2>err && fail "wrong.yaml was read"
[ "$(grep -c '^sst: error: wrong.yaml:[0-9]*:[0-9]*: rotation must be a list of 9' err)" -eq 5 ] || fail "not all faults: $(cat err)"
ok convert calib.yaml -o cv -f
mkdir mine && touch mine/thesis.tex
want 4 "does not replace" calibration convert calib.yaml -o mine --force

[ "$failed" -eq 0 ] && echo "calibration formats as documented"
exit $failed
