#!/usr/bin/env bash
# Evidence judged by others: reuse on the tree, the bill of materials against CycloneDX's own schema (npm), whole releases of two clones. Downloads both; needs root for Debian's
# packages where they are missing, node's npm, and the network.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
for p in npm git; do command -v $p >/dev/null || skip "$p is not installed"; done
if ! command -v reuse >/dev/null || ! /usr/bin/python3 -c 'import jsonschema' 2>/dev/null; then
  [ "$(id -u)" -eq 0 ] || skip "reuse and python3-jsonschema are not installed, and only root installs them"
  apt-get -qq install -y --no-install-recommends reuse python3-jsonschema >apt.log 2>&1 || skip "apt: $(tail -n 1 apt.log)"
fi
reuse --root "$root" lint >reuse.log 2>&1 && tail -n 1 reuse.log || fail "reuse lint: $(grep -A5 '^# SUMMARY' reuse.log; head -n 12 reuse.log)"

npm pack --silent @cyclonedx/cyclonedx-library@10.3.0 >npm.log 2>&1 && tar xzf cyclonedx-*.tgz || skip "npm: $(tail -n 1 npm.log)"
"$root/scripts/evidence.py" sbom --build "$build" -o bom.json || fail "sbom"
/usr/bin/python3 - <<'PY' || fail "the bill of materials against the schema"
import glob, json, os
import jsonschema
schemas = {os.path.basename(f).replace(".SNAPSHOT", ""): json.load(open(f)) for f in glob.glob("package/res/schema/*.schema.json")}
store = {f"http://cyclonedx.org/schema/{n}": s for n, s in schemas.items()}
store.update({f"http://cyclonedx.org/schema/{n.replace('.schema', '.SNAPSHOT.schema')}": s for n, s in schemas.items()})
schema = schemas["bom-1.6.schema.json"]
judge = jsonschema.Draft7Validator(schema, resolver=jsonschema.RefResolver.from_schema(schema, store=store))
bom = json.load(open("bom.json"))
faults = [f"{e.json_path}: {e.message[:200]}" for e in judge.iter_errors(bom)]
print("\n".join(faults) or f"bill of materials: {len(bom['components'])} components, valid by CycloneDX's schema 1.6")
bom["components"][0]["type"] = "none"
assert any(True for _ in judge.iter_errors(bom)), "the schema accepts anything"
raise SystemExit(bool(faults))
PY

version=$(sed -nE 's/^VERSION := (.*)/\1/p' "$root/Makefile")
evidence=$root/scripts/evidence.py
# Whole releases, of two clones: archives are the same bytes; without a key that is said, with one the tag is signed and has the hashes.
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
  echo >>a/README.md
  (cd a && scripts/release.sh build) >out 2>err && fail "a release of what is not committed"
  grep -q "not committed" err || fail "not committed: $(cat err)"
fi
exit $failed
