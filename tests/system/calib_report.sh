#!/usr/bin/env bash
# The calibration report of several made-up solutions: well-formed for an XML parser and an HTML parser, nothing of it
# comes from elsewhere, links and pictures lead somewhere, user text stays text, page and JSON tell the same.
. "$(dirname "$0")/../lib.sh"
tool=$root/${SST_BUILD:-build}/tests/tools/calib_report
[ -x "$tool" ] || { echo "skipped: $tool is not built"; exit 77; }

cat >check.py <<'PY'
import base64, html.parser, json, re, sys
import xml.etree.ElementTree as xml

page = open(sys.argv[1], encoding="utf-8").read()
out = open(sys.argv[2], encoding="utf-8").read()
expect = dict(a.split("=", 1) for a in sys.argv[3:])
figures = json.loads(out[out.index("\n{") + 1:])
root = xml.fromstring(page.split("\n", 1)[1])  # any fault raises

class Strict(html.parser.HTMLParser):
    stack, seen = [], set()
    def handle_starttag(self, tag, attrs):
        assert tag not in ("script", "link", "iframe", "object", "embed", "base", "form"), tag
        for name, value in attrs:
            assert not name.startswith("on"), (tag, name)
        self.seen.add(tag)
        self.stack.append(tag)
    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        self.stack.pop()
    def handle_endtag(self, tag):
        assert self.stack and self.stack.pop() == tag, tag
parser = Strict(convert_charrefs=True)
parser.feed(page)
parser.close()
assert not parser.stack, parser.stack
assert {"html", "head", "body", "svg", "table", "style", "h1"} <= parser.seen

ids = [e.get("id") for e in root.iter() if e.get("id")]
assert len(ids) == len(set(ids)), "an id is there twice"
for e in root.iter():
    for name in ("href", "src"):
        link = e.get(name)
        if link is None:
            continue
        if link.startswith("data:image/jpeg;base64,"):
            data = base64.b64decode(link.split(",")[1], validate=True)
            assert data[:2] == b"\xff\xd8" and data[-2:] == b"\xff\xd9", "not a whole JPEG"
        else:
            assert link[0] == "#" and link[1:] in ids, link
for e in root.iter("path"):  # only moves and numbers: nothing that a renderer stops at
    assert re.fullmatch(r"[MmLlHhVvQqAaZz0-9. e+-]*", e.get("d")), e.get("d")[:80]
for e in root.iter():
    for name in ("x", "y", "width", "height", "cx", "cy", "r"):
        if e.tag in ("rect", "circle", "text", "image") and e.get(name) is not None:
            value = float(e.get(name))
            assert value == value and abs(value) < 1e7 and (name not in ("width", "height", "r") or value >= 0), e.attrib
text = " ".join("".join(root.itertext()).split())
assert not re.search(r"\b(nan|inf)\b", text, re.I), re.search(r".{40}\b(nan|inf)\b", text, re.I)
assert "url(" not in page and "@import" not in page

assert f"Verdict: {figures['verdict']}" in text, figures["verdict"]
assert f"{figures['corners']:,} corners" in text
if figures["rms_px"] is not None:
    assert f"Reprojection error{figures['rms_px']:.3f} px" in text.replace("error ", "error"), figures["rms_px"]
for bar in figures["bars"]:
    assert bar["definition"] in text
    if bar["reason"]:
        assert " ".join(bar["reason"].split()) in text, bar["reason"]
for camera in figures["cameras"]:
    assert camera["name"] in "".join(root.itertext()), camera["name"]
if figures["weakest_link"]:
    assert f"{figures['weakest_link']['corners']:,} corners in" in text
for key, want in expect.items():
    if key == "pictures":
        assert page.count("data:image/jpeg") == int(want), page.count("data:image/jpeg")
    elif key == "lacks":
        assert want not in page, want
    elif key == "bytes":
        assert len(page.encode()) < int(want), len(page.encode())
    else:
        assert str(figures[key]) == want, (key, figures[key], want)
PY

# page NAME EXPECTED... -- SETTINGS...
page() {
  local name=$1 expect=()
  shift
  while [ "$1" != -- ]; do expect+=("$1"); shift; done
  shift
  "$tool" "$name.html" "$@" >"$name.out" 2>err || { fail "$name: $(cat err)"; return; }
  python3 check.py "$name.html" "$name.out" "${expect[@]}" 2>err || fail "$name: $(tail -n 3 err)"
}

page plain verdict=good pictures=3 cameras_known=36 bytes=5000000 -- frames=100
page troubled verdict=usable pictures=3 cameras_missing=1 worst_frame=frame0012 -- \
  frames=30 bent=7 moved=12 unsolved=30 hole=5 rig=1
page nasty cameras_known=6 lacks='<script' -- rows=2 cols=3 frames=8 nasty=1 outliers=0.02
page uncrossed verdict=usable pictures=0 -- rows=2 cols=2 frames=20 cross=nan pictures=0 light=0
page single cameras_known=1 -- rows=1 cols=1 frames=12
page pair cameras_known=2 -- rows=1 cols=2 frames=12 width=640 height=480
page many cameras_known=256 bytes=20000000 -- rows=16 cols=16 frames=6 pictures=0
page bare cameras_known=4 -- rows=2 cols=2 frames=6 plain=1
page upright cameras_known=3 -- rows=3 cols=1 frames=500 across=4 down=3 width=480 height=640
cmp -s plain.html <("$tool" again.html frames=100 >/dev/null 2>&1; cat again.html) || fail "the same input gave another page"
[ "$failed" = 0 ] && echo "calibration report: ok"
exit "$failed"
