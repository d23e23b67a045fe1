#!/usr/bin/env bash
# Version of the release: the tree names one, the programs report it, and each file that names another one is named.
. "$(dirname "$0")/../lib.sh"
"$root/scripts/release_check.sh" 2>err || fail "this tree: $(cat err)"
version=$(sed -nE 's/^VERSION := (.*)/\1/p' "$root/Makefile")
"$sst" version | grep -qF "sst $version" || fail "sst version: $("$sst" version | head -n 1), not $version"

files='CHANGELOG.md README.md docs/man/sst.1 docs/man/sstd.8 docs/man/sstd.yaml.5 python/pyproject.toml python/sst/__init__.py'
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
# wrong PYTHON WORDS: a fault in it, b, is named
wrong() {
  /usr/bin/python3 -c "import json; b = json.load(open('$1')); $2; json.dump(b, open('wrong.json', 'w'))"
  "$evidence" check wrong.json 2>err && fail "$2 passes"
  grep -q "^error: wrong.json: .*$3" err || fail "$2: $(cat err)"
}
wrong one.json 'b["specVersion"] = "1.9"' "no CycloneDX"
wrong one.json 'b["components"].append(b["components"][0])' "twice"
wrong one.json 'b["dependencies"][0]["dependsOn"].append("library:none")' "no component"
wrong one.json 'b["components"][0]["hashes"][0]["content"] = "0"' "hash"
wrong one.json 'b["serialNumber"] = "7"' "UUID"
wrong one.json '[p for p in b["components"] if p["type"] == "library"][0].pop("version")' "not installed"

# A whole release, of two clones: archives are the same bytes; without a key that is said, with one the tag is signed and has the hashes.
if git -C "$root" rev-parse HEAD >/dev/null 2>&1; then
  export HOME=$tmp GIT_CONFIG_GLOBAL=/dev/null GIT_CONFIG_SYSTEM=/dev/null
  for clone in a b; do
    umask $([ $clone = a ] && echo 022 || echo 077)
    git clone -q --shared "$root" $clone 2>err || fail "clone: $(cat err)"
    mkdir $clone/build && ln -s "$build"/* $clone/build/
  done
  (cd a && TZ=Pacific/Auckland scripts/release.sh build) >out 2>err && grep -q 'no signing key' out || fail "release: $(cat out err)"
  if command -v ssh-keygen >/dev/null; then
    ssh-keygen -q -t ed25519 -N "" -f key
    echo "release@example.org $(cat key.pub)" >signers
    for set in gpg.format=ssh user.signingkey="$tmp/key.pub" gpg.ssh.allowedSignersFile="$tmp/signers" user.name=r user.email=release@example.org; do
      git -C b config "${set%%=*}" "${set#*=}"
    done
  fi
  (cd b && scripts/release.sh build) >out 2>err || fail "release: $(cat out err)"
  if [ -f key ]; then
    grep -q "^signed tag v$version" out && git -C b tag -v "v$version" >tag 2>err && grep -q "$(head -c 64 b/build/release/SHA256SUMS)" tag || fail "tag -v: $(cat out err)"
  fi
  cmp a/build/release/sst-*.tar.gz b/build/release/sst-*.tar.gz && cmp a/build/release/sst-*.cdx.json b/build/release/sst-*.cdx.json || fail "releases of two clones differ"
  (cd a/build/release && sha256sum -c --quiet SHA256SUMS) || fail "hashes"
  "$evidence" check a/build/release/*.json 2>err || fail "release: $(cat err)"
  grep -q "$(sha256sum <a/build/release/sst-"$version".tar.gz | cut -d' ' -f1)" a/build/release/*.provenance.json || fail "provenance names another archive"
  wrong "$(ls a/build/release/*.provenance.json)" 'b["subject"][0]["digest"] = {}' "sha256"
  wrong "$(ls a/build/release/*.provenance.json)" 'b["predicate"]["buildDefinition"]["resolvedDependencies"] = []' "commit"
  echo >>a/README.md
  (cd a && scripts/release.sh build) >out 2>err && fail "a release of what is not committed"
  grep -q "not committed" err || fail "not committed: $(cat err)"
fi
exit $failed
