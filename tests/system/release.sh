#!/usr/bin/env bash
# Version of the release: the tree names one, the programs report it, and each file that names another one is named.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
"$root/scripts/release_check.sh" 2>err || fail "this tree: $(cat err)"
version=$(sed -nE 's/^VERSION := (.*)/\1/p' "$root/Makefile")
"$sst" version | grep -qF "sst $version" || fail "sst version: $("$sst" version | head -n 1), not $version"

files='CHANGELOG.md README.md docs/man/sst.1 docs/man/sstd.8 docs/man/sstd.yaml.5 docs/man/sst-sim.1 docs/man/sst-rtsp.8 docs/man/sst-mqtt.8 docs/man/sst-onvif.8 debian/changelog python/pyproject.toml python/sst/__init__.py'
(cd "$root" && cp --parents Makefile $files "$tmp")
"$root/scripts/release_check.sh" "$tmp" 2>err || fail "a copy: $(cat err)"
for file in $files; do
  sed -i "s/${version//./\\.}/9.8.7/" "$file"
  "$root/scripts/release_check.sh" "$tmp" 2>err && fail "$file: another version passes"
  grep -q "^error: $file: .*9\.8\.7" err || fail "$file: $(cat err)"
  cp "$root/$file" "$file"
done
sed -i "s/^\(## ${version//./\\.}\) - .*/\1/" CHANGELOG.md
"$root/scripts/release_check.sh" "$tmp" 2>err && fail "a release without a date passes"
grep -q "^error: CHANGELOG.md: no heading" err || fail "without a date: $(cat err)"

# The bill of materials: libraries that programs link with and load, networks, the page; the same bytes again; faults are named.
build=$root/${SST_BUILD:-build}
evidence=$root/scripts/evidence.py
"$evidence" sbom --build "$build" -o one.json 2>err || fail "sbom: $(cat err)"
TZ=Asia/Tokyo LC_ALL=C "$evidence" sbom --build "$build" -o two.json 2>err && cmp -s one.json two.json || fail "sbom, again: $(cat err)"
/usr/bin/python3 - "$build/sst" <<'PY' || fail "sbom"
import hashlib, json, sys
bom = json.load(open("one.json"))
parts = {p["bom-ref"]: p for p in bom["components"]}
assert parts["program:sst"]["hashes"][0]["content"] == hashlib.sha256(open(sys.argv[1], "rb").read()).hexdigest()
assert parts["library:libjpeg.so.62"]["version"] and parts["library:libjpeg.so.62"]["scope"] == "required"
assert "model:pspnet-small.onnx" in parts and "embedded:daemon/web/app.js" in parts
links = {d["ref"]: d["dependsOn"] for d in bom["dependencies"]}
assert "library:libjpeg.so.62" in links["program:sstd"] and "program:sstd" in links[bom["metadata"]["component"]["bom-ref"]]
PY
# Each fault is named; make check-law has whole releases, and the schema of CycloneDX itself.
if git -C "$root" rev-parse HEAD >/dev/null 2>&1; then
  "$evidence" provenance --build "$build" -o prov.json "$sst" 2>err || fail "provenance: $(cat err)"
fi
/usr/bin/python3 - "$evidence" <<'PY' || fail "faults of a bill of materials"
import copy, importlib.util, json, os, sys
sys.dont_write_bytecode = True
spec = importlib.util.spec_from_file_location("evidence", sys.argv[1])
evidence = importlib.util.module_from_spec(spec)
spec.loader.exec_module(evidence)

def wrong(judge, good, words, change):
    bad, said = copy.deepcopy(good), []
    change(bad)
    judge(bad, said.append)
    assert any(words in s for s in said), (words, said)

bom = json.load(open("one.json"))
wrong(evidence.check_sbom, bom, "no CycloneDX", lambda b: b.update(specVersion="1.9"))
wrong(evidence.check_sbom, bom, "twice", lambda b: b["components"].append(b["components"][0]))
wrong(evidence.check_sbom, bom, "no component", lambda b: b["dependencies"][0]["dependsOn"].append("library:none"))
wrong(evidence.check_sbom, bom, "hash", lambda b: b["components"][0]["hashes"][0].update(content="0"))
wrong(evidence.check_sbom, bom, "UUID", lambda b: b.update(serialNumber="7"))
wrong(evidence.check_sbom, bom, "not installed", lambda b: [p for p in b["components"] if p["type"] == "library"][0].pop("version"))
if os.path.exists("prov.json"):
    statement = json.load(open("prov.json"))
    wrong(evidence.check_provenance, statement, "sha256", lambda b: b["subject"][0].update(digest={}))
    wrong(evidence.check_provenance, statement, "commit", lambda b: b["predicate"]["buildDefinition"].update(resolvedDependencies=[]))
PY
exit $failed
